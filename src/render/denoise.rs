//! A denoised picture beside the rendered one, by Open Image Denoise. No figure is ever made from it.

use crate::{
    ffi::oidn::{Denoiser, Guides, OidnError},
    film::Film,
};

/// What a denoiser made of a film.
#[derive(Clone, Debug)]
pub struct Denoised {
    width: u32,
    pixels: Vec<[f32; 3]>,
    /// By whom, for metadata.
    pub by: String,
}

impl Denoised {
    /// Denoises what a film holds, by the albedo and normal that it has collected
    /// ([`Scene::collected`](crate::scene::Scene::collected)).
    ///
    /// # Errors
    /// The library's own.
    pub fn new(denoiser: &Denoiser, film: &Film) -> Result<Self, OidnError> {
        let size = (film.width * film.height) as usize;
        let [mut color, mut albedo, mut normal] = [(); 3].map(|()| Vec::with_capacity(size));
        for y in 0..film.height {
            for x in 0..film.width {
                let p = film.pixel(x, y);
                color.push(p.color);
                albedo.push(p.albedo);
                normal.push(p.normal);
            }
        }
        let guides = Guides { albedo: &albedo, normal: &normal };
        let pixels = denoiser.denoise(film.width as usize, film.height as usize, &color, &guides)?;
        Ok(Self { width: film.width, pixels, by: format!("Open Image Denoise {}", denoiser.version()) })
    }

    /// The colour of a pixel, in a column and row of what is rendered.
    pub fn pixel(&self, x: u32, y: u32) -> [f32; 3] {
        self.pixels[(y * self.width + x) as usize]
    }
}
