//! What a render takes in memory besides its curves, told before it begins.

use std::fmt;

use crate::{film::Film, light::Light, math::words::bytes_in_words, scene::Scene};

/// Bytes of a pixel that the denoiser is given and gives back: colour, albedo, normal, the result.
const DENOISER_BYTES: u64 = 4 * size_of::<[f32; 3]>() as u64;

/// Bytes of the parts of a render that are not curves ([`crate::cloth::estimates`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Memory {
    /// Pixels that are rendered.
    pub pixels: [u32; 2],
    /// The film, with its layers.
    pub film: u64,
    /// Images of the sky, and textures as far as the texture cache keeps them.
    pub textures: u64,
    /// Pictures that go to the denoiser and come back.
    pub denoiser: u64,
    /// What all may take: `render.max_memory`, or the memory of the machine where that is known.
    pub limit: Option<u64>,
}

/// A film, with what else is known, does not fit into memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TooLarge(Memory);

impl Memory {
    /// Of a scene's render.
    pub(crate) fn new(scene: &Scene) -> Self {
        let [x0, y0, x1, y1] = scene.render.crop;
        let pixels = [x1 - x0, y1 - y0];
        let count = u64::from(pixels[0]) * u64::from(pixels[1]);
        let skies = scene.lights.iter().filter_map(|light| match light {
            Light::Environment(sky) => sky.image.as_ref(),
            _ => None,
        });
        let textures = scene.materials.iter().filter_map(|m| m.texture.as_ref());
        let cached: u64 = textures.map(|t| t.texture.bytes()).sum();
        Self {
            pixels,
            film: Film::bytes(scene.render.crop, scene.collected()),
            textures: skies.map(|sky| sky.bytes()).sum::<u64>() + cached.min(crate::image::texture::CACHE_BYTES),
            denoiser: if scene.denoise { count * DENOISER_BYTES } else { 0 },
            limit: scene.render.max_memory.or_else(machine_bytes),
        }
    }

    /// All of it.
    pub(crate) fn bytes(&self) -> u64 {
        self.film + self.textures + self.denoiser
    }

    /// Whether it fits, before anything is made.
    ///
    /// # Errors
    /// [`TooLarge`] if it does not.
    pub(crate) fn check(&self) -> Result<(), TooLarge> {
        if self.limit.is_some_and(|limit| self.bytes() > limit) { Err(TooLarge(*self)) } else { Ok(()) }
    }
}

impl fmt::Display for TooLarge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Memory { pixels: [width, height], film, textures, denoiser, limit } = self.0;
        write!(f, "{width} x {height} pixels need {} of film", bytes_in_words(film))?;
        if textures + denoiser > 0 {
            let [textures, denoiser] = [textures, denoiser].map(bytes_in_words);
            write!(f, ", {textures} of textures and {denoiser} for the denoiser")?;
        }
        write!(f, "; all may take {}", bytes_in_words(limit.unwrap_or(u64::MAX)))
    }
}

impl std::error::Error for TooLarge {}

/// Memory and swap space of the machine, or what a container may have of its memory; `None` where no system tells.
fn machine_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let field = |name: &str| -> Option<u64> {
        let value = text.lines().find_map(|line| line.strip_prefix(name))?;
        Some(value.trim_start_matches(':').trim().strip_suffix(" kB")?.parse::<u64>().ok()? * 1024)
    };
    let machine = field("MemTotal")? + field("SwapTotal").unwrap_or(0);
    let container = std::fs::read_to_string("/sys/fs/cgroup/memory.max").ok().and_then(|t| t.trim().parse().ok());
    Some(container.map_or(machine, |limit: u64| limit.min(machine)))
}
