//! What pixels have collected: sums owned by tiles, so that threads share nothing.
//!
//! All sums are exact ([`crate::math::exact`]): films of different samples of a picture, from threads, resumed runs or
//! other machines, add up to the film of all of them, to the bit. A pixel takes 84 bytes (count, colour, squares,
//! alpha), 144 with depth, normal and albedo, and 312 more for the light by where it came from. Position takes 36, motion
//! and texture coordinates 16 each.

mod matte;
mod noise;
mod parts;
mod sample;
#[cfg(test)]
mod tests;
mod tile;

use std::{collections::TryReserveError, fmt};

use glam::Vec3A;

use crate::{
    math::exact::{NarrowSum, Sum},
    scene::{Layers, LightGroups},
};

pub use matte::Matte;
pub use noise::Noise;
use noise::NoiseSums;
pub use parts::LightParts;
pub use sample::{MatteId, Sample};
pub use tile::Tile;
use tile::{TILE_BYTES, zeros};

/// Edge of a tile in pixels.
pub const TILE: u32 = 16;

/// There is no memory for a film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutOfMemory {
    /// What the film would take.
    pub bytes: u64,
}

impl fmt::Display for OutOfMemory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no memory for a film of {:.2} GB", self.bytes as f64 / 1e9)
    }
}

impl std::error::Error for OutOfMemory {}

/// A pixel as it stands in the picture.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pixel {
    /// Mean radiance.
    pub color: [f32; 3],
    /// Coverage.
    pub alpha: f32,
    /// Variance of the mean.
    pub variance: [f32; 3],
    /// Mean depth of what covers the pixel; 0 where nothing does.
    pub depth: f32,
    /// Mean normal of it, of unit length.
    pub normal: [f32; 3],
    /// Mean albedo of what is seen first, black where nothing is.
    pub albedo: [f32; 3],
    /// Mean place of what covers the pixel, millimetres about the scene's middle; 0 where nothing does.
    pub position: [f32; 3],
    /// Mean of the pixels by which it moves until the next frame, to the right and up.
    pub motion: [f32; 2],
    /// Mean of its texture coordinates.
    pub uv: [f32; 2],
    /// Mean radiance of each of [`LightParts::to_array`].
    pub parts: [[f32; 3]; LightParts::COUNT],
    /// Mean radiance of each group of lights.
    pub lights: [[f32; 3]; LightGroups::MOST],
    /// Number of samples.
    pub samples: u32,
}

/// All tiles of a picture or of its crop.
#[derive(Clone, Debug)]
pub struct Film {
    /// Upper left corner of what is rendered, in the whole picture.
    pub origin: [u32; 2],
    /// Width of what is rendered, pixels.
    pub width: u32,
    /// Height of what is rendered, pixels.
    pub height: u32,
    tiles: Vec<Tile>,
    columns: u32,
    /// The order in which tiles are rendered: along a Morton curve, so that neighbours share caches.
    order: Vec<u32>,
}

impl Film {
    /// An empty film for the pixels x0, y0, x1, y1 (the latter exclusive).
    ///
    /// `light_scale` is that of the scene ([`crate::scene::Scene::light_scale`]): the unit in which light is summed up.
    ///
    /// # Errors
    /// If there is no memory for it.
    pub fn new(crop: [u32; 4], layers: Layers, light_scale: f32) -> Result<Self, OutOfMemory> {
        Self::allocate(crop, layers, light_scale).map_err(|_| OutOfMemory { bytes: Self::bytes(crop, layers) })
    }

    fn allocate(crop: [u32; 4], layers: Layers, light_scale: f32) -> Result<Self, TryReserveError> {
        let [x0, y0, x1, y1] = crop;
        let (width, height) = (x1 - x0, y1 - y0);
        let (columns, rows) = (width.div_ceil(TILE), height.div_ceil(TILE));
        let count = rows as usize * columns as usize;
        let mut tiles = Vec::new();
        tiles.try_reserve_exact(count)?;
        for i in 0..rows * columns {
            let (x, y) = (x0 + i % columns * TILE, y0 + i / columns * TILE);
            tiles.push(Tile::new(x, y, TILE.min(x1 - x), TILE.min(y1 - y), layers, light_scale)?);
        }
        let mut order: Vec<u32> = zeros(count)?;
        order.iter_mut().zip(0..).for_each(|(place, i)| *place = i);
        order.sort_unstable_by_key(|i| morton(i % columns, i / columns));
        Ok(Self { origin: [x0, y0], width, height, tiles, columns, order })
    }

    /// Bytes of memory that a film takes; with Cryptomatte if four plies cover each pixel.
    pub fn bytes(crop: [u32; 4], layers: Layers) -> u64 {
        let [width, height] = [crop[2] - crop[0], crop[3] - crop[1]].map(u64::from);
        let matte =
            if layers.cryptomatte { size_of::<Vec<(MatteId, u32)>>() + 4 * size_of::<(MatteId, u32)>() } else { 0 };
        let tiles = width.div_ceil(TILE.into()) * height.div_ceil(TILE.into());
        width * height * (Tile::bytes_per_pixel(layers) + matte) as u64 + tiles * TILE_BYTES
    }

    /// The tiles in the order in which to render them.
    pub fn tiles_in_order(&mut self) -> Vec<&mut Tile> {
        let mut slots: Vec<Option<&mut Tile>> = self.tiles.iter_mut().map(Some).collect();
        self.order.iter().filter_map(|&i| slots[i as usize].take()).collect()
    }

    /// Which pixels of the whole picture these are: x0, y0, x1, y1, the latter exclusive.
    pub fn crop(&self) -> [u32; 4] {
        let [x, y] = self.origin;
        [x, y, x + self.width, y + self.height]
    }

    /// The unit in which light is summed up.
    pub fn light_scale(&self) -> f32 {
        self.tiles[0].scale
    }

    /// Adds another film's samples and what they cost; its pixels must lie within this one's, its layers and its unit of light must
    /// be the same.
    pub fn add(&mut self, other: &Self) {
        for tile in &other.tiles {
            let [x, y] = [tile.x - self.origin[0], tile.y - self.origin[1]];
            let first = &mut self.tiles[(y / TILE * self.columns + x / TILE) as usize];
            first.rays = std::array::from_fn(|k| first.rays[k].saturating_add(tile.rays[k]));
            for y in 0..tile.height {
                for x in 0..tile.width {
                    let (px, py) = (tile.x + x - self.origin[0], tile.y + y - self.origin[1]);
                    let mine = &mut self.tiles[(py / TILE * self.columns + px / TILE) as usize];
                    let i = ((py % TILE) * mine.width + px % TILE) as usize;
                    let j = (y * tile.width + x) as usize;
                    mine.sums.merge(i, &tile.sums, j);
                    mine.matte.merge(i, &tile.matte, j);
                }
            }
        }
    }

    /// The tiles, row by row.
    pub fn tiles(&self) -> &[Tile] {
        &self.tiles
    }

    /// The tiles, row by row, to add samples to.
    pub fn tiles_mut(&mut self) -> &mut [Tile] {
        &mut self.tiles
    }

    /// The pixel in a column and row of what is rendered.
    pub fn pixel(&self, x: u32, y: u32) -> Pixel {
        let tile = &self.tiles[(y / TILE * self.columns + x / TILE) as usize];
        let i = ((y % TILE) * tile.width + x % TILE) as usize;
        let (samples, mean, variance) = tile.moments(i);
        if samples == 0 {
            return Pixel::default();
        }
        let sums = &tile.sums;
        let n = f64::from(samples);
        let color = |sum: &[NarrowSum; 3]| sum.map(|v| (v.value() / n) as f32);
        let radiance = |sum: &[NarrowSum; 3]| color(sum).map(|c| c * tile.scale);
        let alpha = sums.alpha[i].value();
        let of_cover = |sum: NarrowSum| if alpha > 0.0 { (sum.value() / alpha) as f32 } else { 0.0 };
        let far_of_cover = |sum: Sum| if alpha > 0.0 { (sum.value() / alpha) as f32 } else { 0.0 };
        let normal = |sum: &[NarrowSum; 3]| Vec3A::from(color(sum)).normalize_or_zero().to_array();
        let mut lights = [[0.0; 3]; LightGroups::MOST];
        for (light, sum) in lights.iter_mut().zip(&sums.lights[sums.lights_of(i)]) {
            *light = radiance(sum);
        }
        Pixel {
            color: mean.map(|c| c as f32 * tile.scale),
            alpha: (alpha / n) as f32,
            variance: variance.map(|v| (v * f64::from(tile.scale).powi(2)) as f32),
            depth: sums.depth.get(i).map_or(0.0, |d| far_of_cover(*d)),
            normal: sums.normal.get(i).map_or([0.0; 3], normal),
            albedo: sums.albedo.get(i).map_or([0.0; 3], color),
            position: sums.position.get(i).map_or([0.0; 3], |p| p.map(far_of_cover)),
            motion: sums.motion.get(i).map_or([0.0; 2], |m| m.map(of_cover)),
            uv: sums.uv.get(i).map_or([0.0; 2], |uv| uv.map(of_cover)),
            parts: sums.parts.get(i).map_or_else(Default::default, |p| std::array::from_fn(|k| radiance(&p[k]))),
            lights,
            samples,
        }
    }

    /// What covers a pixel and by how many samples, in the order of the ids; nothing if the scene asks for no matte.
    pub fn covering(&self, x: u32, y: u32) -> &[(MatteId, u32)] {
        let tile = &self.tiles[(y / TILE * self.columns + x / TILE) as usize];
        tile.matte.counts(((y % TILE) * tile.width + x % TILE) as usize)
    }

    /// How far the picture is from its limit, as far as its own samples tell; `None` before two samples a pixel.
    ///
    /// The interval comes from the differences of neighbours: two pixels side by side see nearly the same, so that the
    /// difference of their variances tells how well each is known. Edges make it wider, never narrower. It knows
    /// nothing of light that no sample has found yet.
    pub fn noise(&self) -> Option<Noise> {
        let mut sums = NoiseSums::default();
        self.tiles.iter().for_each(|tile| tile.add_noise(&mut sums));
        let NoiseSums { sum, pixels, differences, paired } = sums;
        (pixels > 0.0).then(|| {
            let estimate = sum / pixels;
            // Pixels without a neighbour are as well known as the others.
            let variance = if paired > 0.0 { differences * pixels / paired } else { sum * sum };
            let reach = 1.96 * variance.sqrt() / pixels;
            Noise { estimate, low: (estimate - reach).max(0.0), high: estimate + reach }
        })
    }

    /// Least, mean and most samples of a pixel.
    pub fn samples(&self) -> (u32, f64, u32) {
        let counts = || self.tiles.iter().flat_map(|t| &t.sums.count).copied();
        let total: f64 = counts().map(f64::from).sum();
        let pixels = f64::from(self.width) * f64::from(self.height);
        (counts().min().unwrap_or(0), total / pixels, counts().max().unwrap_or(0))
    }
}

/// Bits of x and y by turns.
fn morton(x: u32, y: u32) -> u64 {
    let spread = |v: u32| {
        let mut v = u64::from(v);
        v = (v | v << 16) & 0x0000_ffff_0000_ffff;
        v = (v | v << 8) & 0x00ff_00ff_00ff_00ff;
        v = (v | v << 4) & 0x0f0f_0f0f_0f0f_0f0f;
        v = (v | v << 2) & 0x3333_3333_3333_3333;
        (v | v << 1) & 0x5555_5555_5555_5555
    };
    spread(x) | spread(y) << 1
}
