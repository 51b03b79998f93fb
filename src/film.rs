//! What pixels have collected: sums owned by tiles, so that threads share nothing.
//!
//! All sums are exact ([`crate::math::exact`]): films of different samples of a picture, from threads, resumed runs or
//! other machines, add up to the film of all of them, to the bit. A pixel takes 84 bytes (count, colour, squares,
//! alpha), 144 with depth, normal and albedo, and 312 more for the light by where it came from. Position takes 24, motion
//! and texture coordinates 16 each.

mod matte;
mod parts;
mod sample;

use std::{collections::TryReserveError, fmt};

use glam::Vec3A;

use crate::{
    math::exact::{Exact, NarrowSum, SquareSum, Sum},
    scene::Layers,
};

pub use matte::Matte;
pub use parts::LightParts;
pub use sample::{ClothId, Sample};

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

/// So many empty elements, if there is memory for them.
fn zeros<T: Clone + Default>(count: usize) -> Result<Vec<T>, TryReserveError> {
    let mut all = Vec::new();
    all.try_reserve_exact(count)?;
    all.resize(count, T::default());
    Ok(all)
}

/// The pixels of one tile, row by row.
#[derive(Clone, Debug)]
pub struct Tile {
    /// Column of the upper left pixel, in the whole picture.
    pub x: u32,
    /// Row of the upper left pixel, in the whole picture.
    pub y: u32,
    /// Columns of pixels; fewer than [`TILE`] at the right edge.
    pub width: u32,
    /// Rows of pixels; fewer than [`TILE`] at the lower edge.
    pub height: u32,
    /// The sample that comes next for the even and the odd pixels, by (x + y) mod 2: the same but for adaptive
    /// sampling.
    pub next: [u32; 2],
    /// What light is divided by before it is summed up; a power of two.
    scale: f32,
    /// How densely adaptive sampling takes samples of the even and the odd pixels, against the picture's mean.
    pub share: [f32; 2],
    /// Rays traced for the even and the odd pixels: what their samples cost.
    pub rays: [u64; 2],
    sums: Sums,
    matte: Matte,
}

/// Bytes of a tile besides its pixels: itself, what the allocator keeps for each of its sums, its place in the order.
const TILE_BYTES: u64 = (size_of::<Tile>() + 8 * 16 + size_of::<u32>()) as u64;

/// Sums over the samples of each pixel. Layers that are not asked for are empty.
#[derive(Clone, Debug, PartialEq)]
struct Sums {
    count: Vec<u32>,
    color: Vec<[Sum; 3]>,
    square: Vec<[SquareSum; 3]>,
    alpha: Vec<NarrowSum>,
    depth: Vec<Sum>,
    normal: Vec<[NarrowSum; 3]>,
    albedo: Vec<[NarrowSum; 3]>,
    position: Vec<[NarrowSum; 3]>,
    motion: Vec<[NarrowSum; 2]>,
    uv: Vec<[NarrowSum; 2]>,
    parts: Vec<[[NarrowSum; 3]; LightParts::COUNT]>,
}

/// Does the same with every vector of sums.
macro_rules! for_all_sums {
    ($sums:expr, $do:ident $(, $more:expr)*) => {{
        let Sums { count, color, square, alpha, depth, normal, albedo, position, motion, uv, parts } = $sums;
        $do(count $(, $more)*);
        $do(color $(, $more)*);
        $do(square $(, $more)*);
        $do(alpha $(, $more)*);
        $do(depth $(, $more)*);
        $do(normal $(, $more)*);
        $do(albedo $(, $more)*);
        $do(position $(, $more)*);
        $do(motion $(, $more)*);
        $do(uv $(, $more)*);
        $do(parts $(, $more)*);
    }};
}

impl Sums {
    fn new(n: usize, layers: Layers) -> Result<Self, TryReserveError> {
        let sized = |wanted: bool| if wanted { n } else { 0 };
        Ok(Self {
            count: zeros(n)?,
            color: zeros(n)?,
            square: zeros(n)?,
            alpha: zeros(n)?,
            depth: zeros(sized(layers.depth))?,
            normal: zeros(sized(layers.normal))?,
            albedo: zeros(sized(layers.albedo))?,
            position: zeros(sized(layers.position))?,
            motion: zeros(sized(layers.motion))?,
            uv: zeros(sized(layers.uv))?,
            parts: zeros(sized(layers.lobes))?,
        })
    }

    /// Adds pixel `j` of other sums to pixel `i`.
    fn merge(&mut self, i: usize, other: &Self, j: usize) {
        fn one<T: Exact>(sums: &mut [T], i: usize, other: &[T], j: usize) {
            if let (Some(sum), Some(more)) = (sums.get_mut(i), other.get(j)) {
                sum.merge(more);
            }
        }
        let Self { count, color, square, alpha, depth, normal, albedo, position, motion, uv, parts } = other;
        one(&mut self.count, i, count, j);
        one(&mut self.color, i, color, j);
        one(&mut self.square, i, square, j);
        one(&mut self.alpha, i, alpha, j);
        one(&mut self.depth, i, depth, j);
        one(&mut self.normal, i, normal, j);
        one(&mut self.albedo, i, albedo, j);
        one(&mut self.position, i, position, j);
        one(&mut self.motion, i, motion, j);
        one(&mut self.uv, i, uv, j);
        one(&mut self.parts, i, parts, j);
    }
}

impl Tile {
    fn new(x: u32, y: u32, width: u32, height: u32, layers: Layers, scale: f32) -> Result<Self, TryReserveError> {
        let n = (width * height) as usize;
        let matte = Matte::new(if layers.cryptomatte { n } else { 0 });
        Ok(Self {
            x,
            y,
            width,
            height,
            next: [0; 2],
            share: [1.0; 2],
            rays: [0; 2],
            scale,
            sums: Sums::new(n, layers)?,
            matte,
        })
    }

    /// Adds a sample to a pixel, given from the tile's corner. A sample that is not finite, or brighter than
    /// [`Sum::LIMIT`] times the light's scale, is refused.
    #[inline]
    pub fn add(&mut self, x: u32, y: u32, sample: &Sample) -> bool {
        // A division by a power of two loses nothing.
        let down = 1.0 / self.scale;
        let radiance = (sample.radiance * down).to_array();
        // NaN compares as false.
        if !radiance.iter().all(|v| v.abs() < Sum::LIMIT) {
            return false;
        }
        let i = (y * self.width + x) as usize;
        let sums = &mut self.sums;
        sums.count[i] += 1;
        for (c, v) in radiance.into_iter().enumerate() {
            sums.color[i][c].add(v);
            sums.square[i][c].add_square_of(v);
        }
        sums.alpha[i].add(sample.alpha);
        if let Some(depth) = sums.depth.get_mut(i) {
            depth.add(sample.depth);
        }
        if let Some(normal) = sums.normal.get_mut(i) {
            add_each(normal, sample.normal.to_array());
        }
        if let Some(albedo) = sums.albedo.get_mut(i) {
            add_each(albedo, sample.albedo.to_array());
        }
        if let Some(position) = sums.position.get_mut(i) {
            add_each(position, sample.position.to_array());
        }
        if let Some(motion) = sums.motion.get_mut(i) {
            add_each(motion, sample.motion.to_array());
        }
        if let Some(uv) = sums.uv.get_mut(i) {
            add_each(uv, sample.uv.to_array());
        }
        if let Some(cloth) = sample.cloth {
            self.matte.add(i, cloth, 1);
        }
        if let Some(parts) = sums.parts.get_mut(i) {
            for (sum, value) in parts.iter_mut().zip(sample.parts.to_array()) {
                add_each(sum, (value * down).to_array());
            }
        }
        true
    }

    /// Number of samples, mean and variance of the mean of a pixel's channels.
    #[inline]
    fn moments(&self, i: usize) -> (u32, [f64; 3], [f64; 3]) {
        let count = self.sums.count[i];
        let n = f64::from(count.max(1));
        let mean = self.sums.color[i].map(|c| c.value() / n);
        let variance = std::array::from_fn(|k| {
            if count < 2 {
                return 0.0;
            }
            (self.sums.square[i][k].value() / n - mean[k] * mean[k]).max(0.0) / (n - 1.0)
        });
        (count, mean, variance)
    }

    /// The mean over a pixel's channels of the variance of the mean over (mean^2 + 0.01), if it has two samples.
    fn relative_variance(&self, i: usize) -> Option<f64> {
        let (count, mean, variance) = self.moments(i);
        (count >= 2).then(|| (0..3).map(|k| variance[k] / (mean[k] * mean[k] + NOISE_OFFSET)).sum::<f64>() / 3.0)
    }

    /// Whether a pixel, given from the tile's corner, is even or odd: 0 or 1, as on a chessboard over the whole picture.
    #[inline]
    pub fn color_of(&self, x: u32, y: u32) -> usize {
        ((self.x + x + self.y + y) & 1) as usize
    }

    /// The even or the odd pixels of the tile.
    fn of_color(&self, color: usize) -> impl Iterator<Item = usize> {
        let all = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        all.filter(move |&(x, y)| self.color_of(x, y) == color).map(|(x, y)| (y * self.width + x) as usize)
    }

    /// Number of the even or the odd pixels.
    pub fn pixels_of(&self, color: usize) -> u32 {
        self.of_color(color).count() as u32
    }

    /// The mean number of rays of a sample of the even or the odd pixels; `None` if they have none.
    pub fn rays_per_sample(&self, color: usize) -> Option<f64> {
        let samples: f64 = self.of_color(color).map(|i| f64::from(self.sums.count[i])).sum();
        (samples > 0.0).then(|| self.rays[color] as f64 / samples)
    }

    /// The mean over the even or the odd pixels, and over channels, of the variance of one sample over (mean^2 + 0.01);
    /// `None` if no such pixel has two samples.
    pub fn error_per_sample(&self, color: usize) -> Option<f64> {
        let errors =
            self.of_color(color).filter_map(|i| Some(self.relative_variance(i)? * f64::from(self.sums.count[i])));
        let (sum, n) = errors.fold((0.0, 0.0), |(sum, n), e| (sum + e, n + 1.0));
        (n > 0.0).then(|| sum / n)
    }

    /// Adds the tile's share to an estimate of noise.
    fn add_noise(&self, sums: &mut NoiseSums) {
        for row in 0..self.height as usize {
            let mut left = None;
            for x in 0..self.width as usize {
                let here = self.relative_variance(row * self.width as usize + x);
                if let Some(here) = here {
                    sums.sum += here;
                    sums.pixels += 1.0;
                }
                // Pairs side by side, each pixel in one of them.
                match (x % 2, left, here) {
                    (1, Some(left), Some(here)) => {
                        let difference: f64 = left - here;
                        sums.differences += difference * difference;
                        sums.paired += 2.0;
                    }
                    _ => left = here,
                }
            }
        }
    }

    /// Least bytes of a pixel in [`Self::save`]; Cryptomatte adds 16 for each ply that covers it.
    pub fn bytes_per_pixel(layers: Layers) -> usize {
        let sized = |wanted: bool, bytes: usize| if wanted { bytes } else { 0 };
        let narrow = <[NarrowSum; 3]>::BYTES;
        u32::BYTES
            + <[Sum; 3]>::BYTES
            + <[SquareSum; 3]>::BYTES
            + NarrowSum::BYTES
            + sized(layers.depth, Sum::BYTES)
            + sized(layers.normal, narrow)
            + sized(layers.albedo, narrow)
            + sized(layers.position, narrow)
            + sized(layers.motion, <[NarrowSum; 2]>::BYTES)
            + sized(layers.uv, <[NarrowSum; 2]>::BYTES)
            + sized(layers.lobes, LightParts::COUNT * narrow)
            + sized(layers.cryptomatte, size_of::<u32>())
    }

    /// Appends all sums to a file's bytes.
    pub fn save(&self, out: &mut Vec<u8>) {
        for_all_sums!(&self.sums, save_all, out);
        self.matte.save(out);
    }

    /// Takes back what [`Self::save`] wrote for a tile of this size and these layers: `None` if it is something else.
    pub fn load(&mut self, mut bytes: &[u8]) -> Option<()> {
        let mut expected = 0;
        for_all_sums!(&self.sums, add_bytes, &mut expected);
        if bytes.len() < expected {
            return None;
        }
        for_all_sums!(&mut self.sums, load_all, &mut bytes);
        self.matte.load(bytes)
    }
}

#[inline]
fn add_each<const N: usize>(sum: &mut [NarrowSum; N], value: [f32; N]) {
    sum.iter_mut().zip(value).for_each(|(sum, v)| sum.add(v));
}

fn add_bytes<T: Exact>(sums: &[T], bytes: &mut usize) {
    *bytes += sums.len() * T::BYTES;
}

fn save_all<T: Exact>(sums: &[T], out: &mut Vec<u8>) {
    sums.iter().for_each(|s| s.save(out));
}

fn load_all<T: Exact>(sums: &mut [T], bytes: &mut &[u8]) {
    for sum in sums {
        let (one, rest) = bytes.split_at(T::BYTES);
        *sum = T::load(one);
        *bytes = rest;
    }
}

/// What is added to the squared mean in relative errors, so that black pixels do not count without end.
const NOISE_OFFSET: f64 = 0.01;

/// Sums of an estimate of noise.
#[derive(Default)]
struct NoiseSums {
    sum: f64,
    pixels: f64,
    differences: f64,
    paired: f64,
}

/// An estimate of a picture's relative mean square error: the mean over pixels and channels of the variance of the
/// mean over (mean^2 + 0.01).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// The estimate.
    pub estimate: f64,
    /// Lower end of its interval of 95 %.
    pub low: f64,
    /// Upper end of its interval of 95 %.
    pub high: f64,
}

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
            if layers.cryptomatte { size_of::<Vec<(ClothId, u32)>>() + 4 * size_of::<(ClothId, u32)>() } else { 0 };
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

    /// Adds another film's samples; its pixels must lie within this one's, its layers and its unit of light must
    /// be the same.
    pub fn add(&mut self, other: &Self) {
        for tile in &other.tiles {
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
        let alpha = sums.alpha[i].value();
        let of_cover = |sum: NarrowSum| if alpha > 0.0 { (sum.value() / alpha) as f32 } else { 0.0 };
        let depth = |sum: &Sum| if alpha > 0.0 { (sum.value() / alpha) as f32 } else { 0.0 };
        let normal = |sum: &[NarrowSum; 3]| Vec3A::from(color(sum)).normalize_or_zero().to_array();
        Pixel {
            color: mean.map(|c| c as f32 * tile.scale),
            alpha: (alpha / n) as f32,
            variance: variance.map(|v| (v * f64::from(tile.scale).powi(2)) as f32),
            depth: sums.depth.get(i).map_or(0.0, depth),
            normal: sums.normal.get(i).map_or([0.0; 3], normal),
            albedo: sums.albedo.get(i).map_or([0.0; 3], color),
            position: sums.position.get(i).map_or([0.0; 3], |p| p.map(of_cover)),
            motion: sums.motion.get(i).map_or([0.0; 2], |m| m.map(of_cover)),
            uv: sums.uv.get(i).map_or([0.0; 2], |uv| uv.map(of_cover)),
            parts: sums
                .parts
                .get(i)
                .map_or_else(Default::default, |p| std::array::from_fn(|k| color(&p[k]).map(|c| c * tile.scale))),
            samples,
        }
    }

    /// What covers a pixel and by how many samples, in the order of the ids; nothing if the scene asks for no matte.
    pub fn covering(&self, x: u32, y: u32) -> &[(ClothId, u32)] {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Rgb, sampler::Stream};

    #[test]
    fn pixels_are_found_again_and_average() {
        let mut film = Film::new([5, 7, 45, 40], Layers::ALL, 1.0).unwrap();
        for tile in film.tiles_in_order() {
            for y in 0..tile.height {
                for x in 0..tile.width {
                    for k in 0..4u32 {
                        let v = (tile.x + x) as f32 + 100.0 * (tile.y + y) as f32 + k as f32;
                        let sample = Sample { radiance: Rgb::splat(v), alpha: 1.0, depth: v, ..Sample::default() };
                        assert!(tile.add(x, y, &sample));
                    }
                    let bad = Sample { radiance: Rgb::splat(f32::NAN), ..Sample::default() };
                    assert!(!tile.add(x, y, &bad), "a NaN is refused");
                }
            }
        }
        for y in 0..33 {
            for x in 0..40 {
                let p = film.pixel(x, y);
                let want = (5 + x) as f32 + 100.0 * (7 + y) as f32 + 1.5;
                assert_eq!((p.color[1], p.samples, p.alpha, p.depth), (want, 4, 1.0, want));
                // Variance of 0, 1, 2, 3 is 5/3 (unbiased); of their mean a quarter of it.
                assert!((p.variance[0] - 5.0 / 12.0).abs() < 1e-3, "{:?}", p.variance);
            }
        }
        assert_eq!(film.samples(), (4, 4.0, 4));
        let noise = film.noise().unwrap();
        assert!(0.0 < noise.low && noise.low < noise.estimate && noise.estimate < noise.high, "{noise:?}");
    }

    /// Over many renders the interval must be about as wide as the estimates differ, or wider where the picture has edges.
    #[test]
    fn the_interval_of_the_noise_is_as_wide_as_estimates_differ() {
        for (edges, narrowest, widest) in [(0.0, 0.7, 1.4), (0.8, 0.7, 4.0)] {
            let (mut sum, mut square, mut reach) = (0.0, 0.0, 0.0);
            let runs = 40;
            for run in 0..runs {
                let mut random = Stream::new(run);
                let mut film = Film::new([0, 0, 48, 32], Layers::NONE, 1.0).unwrap();
                for tile in film.tiles_mut() {
                    for i in 0..tile.width * tile.height * 16 {
                        let (x, y) = (i % tile.width, i / tile.width % tile.height);
                        let size = if (tile.x + x) % 8 < 4 { 1.0 } else { 1.0 - edges };
                        // Exponential: as skewed as a path tracer's samples.
                        let v = -size * (1.0 - random.next()).ln();
                        tile.add(x, y, &Sample { radiance: Rgb::splat(v), ..Sample::default() });
                    }
                }
                let noise = film.noise().unwrap();
                sum += noise.estimate;
                square += noise.estimate * noise.estimate;
                reach += noise.high - noise.estimate;
            }
            let n = f64::from(runs);
            let deviation = (square / n - (sum / n).powi(2)).sqrt();
            let ratio = reach / n / 1.96 / deviation;
            assert!((narrowest..widest).contains(&ratio), "edges {edges}: {ratio}");
        }
    }

    #[test]
    fn tiles_come_back_from_their_bytes() {
        let layers = Layers::ALL;
        assert_eq!(Tile::bytes_per_pixel(Layers::NONE), 84);
        assert_eq!(Tile::bytes_per_pixel(Layers::DEFAULT), 144);
        assert_eq!(Tile::bytes_per_pixel(layers), 516);
        let mut tile = Tile::new(0, 0, 3, 2, layers, 1.0).unwrap();
        let cloth = Some(ClothId { fabric: 1, yarn: 70_000, ply: 2 });
        for x in 0..3 {
            let radiance = Rgb::splat(0.3 + x as f32);
            tile.add(x, 1, &Sample { radiance, alpha: 1.0, depth: -2.5, normal: Vec3A::X, cloth, ..Sample::default() });
        }
        let mut bytes = Vec::new();
        tile.save(&mut bytes);
        assert_eq!(bytes.len(), 6 * 516 + 3 * 16);
        let mut again = Tile::new(0, 0, 3, 2, layers, 1.0).unwrap();
        assert_eq!(again.load(&bytes), Some(()));
        assert_eq!((&again.sums, &again.matte), (&tile.sums, &tile.matte));
        for cut in [0, 5, bytes.len() - 1] {
            assert_eq!(again.load(&bytes[..cut]), None);
        }
        bytes.push(0);
        assert_eq!(again.load(&bytes), None);
    }

    /// What `info` says beforehand, and what a picture of a cinema's size may take.
    #[test]
    fn a_film_is_as_small_as_it_says() {
        let crop = [0, 0, 3840, 2160];
        let per_pixel = Film::bytes(crop, Layers::DEFAULT) as f64 / (3840.0 * 2160.0);
        assert!((144.0..150.0).contains(&per_pixel), "{per_pixel} bytes a pixel");
        for layers in [Layers::NONE, Layers::DEFAULT, Layers { lobes: true, ..Layers::DEFAULT }] {
            let sums = Sums::new(5, layers).unwrap();
            let mut bytes = 0;
            for_all_sums!(&sums, add_bytes, &mut bytes);
            assert_eq!(bytes, 5 * Tile::bytes_per_pixel(layers));
            // In memory they are as tight as in the file.
            assert_eq!(size_of_val(&*sums.color) + size_of_val(&*sums.square), 5 * 72);
        }
    }

    #[test]
    fn no_memory_is_an_error() {
        let too_large = Film::new([0, 0, u32::MAX, 65_536], Layers::ALL, 1.0).unwrap_err();
        assert!(too_large.to_string().starts_with("no memory for a film of "), "{too_large}");
    }

    #[test]
    fn every_tile_is_rendered_once() {
        let mut film = Film::new([0, 0, 100, 33], Layers::NONE, 1.0).unwrap();
        let mut seen: Vec<(u32, u32)> = film.tiles_in_order().iter().map(|t| (t.x, t.y)).collect();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), 7 * 3);
    }
}
