//! Tiles and the sums of their pixels.

use std::{collections::TryReserveError, ops::Range};

use super::{
    LightParts, Matte, Sample,
    noise::{NOISE_OFFSET, NoiseSums},
};
use crate::{
    math::exact::{Exact, NarrowSum, SquareSum, Sum},
    scene::Layers,
};

/// So many empty elements, if there is memory for them.
pub(super) fn zeros<T: Clone + Default>(count: usize) -> Result<Vec<T>, TryReserveError> {
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
    /// Columns of pixels; fewer than [`TILE`](super::TILE) at the right edge.
    pub width: u32,
    /// Rows of pixels; fewer than [`TILE`](super::TILE) at the lower edge.
    pub height: u32,
    /// The sample that comes next for the even and the odd pixels, by (x + y) mod 2: the same but for adaptive
    /// sampling.
    pub next: [u32; 2],
    /// What light is divided by before it is summed up; a power of two.
    pub(super) scale: f32,
    /// How densely adaptive sampling takes samples of the even and the odd pixels, against the picture's mean.
    pub share: [f32; 2],
    /// Rays traced for the even and the odd pixels: what their samples cost.
    pub rays: [u64; 2],
    pub(super) sums: Sums,
    pub(super) matte: Matte,
}

/// Bytes of a tile besides its pixels: itself, what the allocator keeps for each of its sums, its place in the order.
pub(super) const TILE_BYTES: u64 = (size_of::<Tile>() + 8 * 16 + size_of::<u32>()) as u64;

/// Sums over the samples of each pixel. Layers that are not asked for are empty.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sums {
    pub(super) count: Vec<u32>,
    pub(super) color: Vec<[Sum; 3]>,
    pub(super) square: Vec<[SquareSum; 3]>,
    pub(super) alpha: Vec<NarrowSum>,
    pub(super) depth: Vec<Sum>,
    pub(super) normal: Vec<[NarrowSum; 3]>,
    pub(super) albedo: Vec<[NarrowSum; 3]>,
    /// Wide sums: a scene may lie a kilometre away, and many samples of that are beyond the narrow ones.
    pub(super) position: Vec<[Sum; 3]>,
    pub(super) motion: Vec<[NarrowSum; 2]>,
    pub(super) uv: Vec<[NarrowSum; 2]>,
    pub(super) parts: Vec<[[NarrowSum; 3]; LightParts::COUNT]>,
    /// Of each pixel one for each group of lights.
    pub(super) lights: Vec<[NarrowSum; 3]>,
}

/// Does the same with every vector of sums.
macro_rules! for_all_sums {
    ($sums:expr, $do:ident $(, $more:expr)*) => {{
        let Sums { count, color, square, alpha, depth, normal, albedo, position, motion, uv, parts, lights } = $sums;
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
        $do(lights $(, $more)*);
    }};
}
#[cfg(test)]
pub(super) use for_all_sums;

impl Sums {
    pub(super) fn new(n: usize, layers: Layers) -> Result<Self, TryReserveError> {
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
            lights: zeros(n * usize::from(layers.light_groups))?,
        })
    }

    /// Adds pixel `j` of other sums to pixel `i`.
    pub(super) fn merge(&mut self, i: usize, other: &Self, j: usize) {
        fn one<T: Exact>(sums: &mut [T], i: usize, other: &[T], j: usize) {
            if let (Some(sum), Some(more)) = (sums.get_mut(i), other.get(j)) {
                sum.merge(more);
            }
        }
        let Self { count, color, square, alpha, depth, normal, albedo, position, motion, uv, parts, lights } = other;
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
        self.lights_of(i).zip(other.lights_of(j)).for_each(|(i, j)| one(&mut self.lights, i, lights, j));
    }

    /// Groups of lights.
    fn groups(&self) -> usize {
        self.lights.len() / self.count.len().max(1)
    }

    /// Where those of a pixel's groups of lights are.
    pub(super) fn lights_of(&self, i: usize) -> Range<usize> {
        self.groups() * i..self.groups() * (i + 1)
    }
}

impl Tile {
    pub(super) fn new(
        x: u32,
        y: u32,
        width: u32,
        height: u32,
        layers: Layers,
        scale: f32,
    ) -> Result<Self, TryReserveError> {
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
            position.iter_mut().zip(sample.position.to_array()).for_each(|(sum, v)| sum.add(v));
        }
        if let Some(motion) = sums.motion.get_mut(i) {
            add_each(motion, sample.motion.to_array());
        }
        if let Some(uv) = sums.uv.get_mut(i) {
            add_each(uv, sample.uv.to_array());
        }
        if let Some(id) = sample.matte {
            self.matte.add(i, id, 1);
        }
        if let Some(parts) = sums.parts.get_mut(i) {
            for (sum, value) in parts.iter_mut().zip(sample.parts.to_array()) {
                add_each(sum, (value * down).to_array());
            }
        }
        let own = sums.lights_of(i);
        for (sum, value) in sums.lights[own].iter_mut().zip(sample.lights) {
            add_each(sum, (value * down).to_array());
        }
        true
    }

    /// Number of samples, mean and variance of the mean of a pixel's channels.
    #[inline]
    pub(super) fn moments(&self, i: usize) -> (u32, [f64; 3], [f64; 3]) {
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
    pub(super) fn add_noise(&self, sums: &mut NoiseSums) {
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
            + sized(layers.position, <[Sum; 3]>::BYTES)
            + sized(layers.motion, <[NarrowSum; 2]>::BYTES)
            + sized(layers.uv, <[NarrowSum; 2]>::BYTES)
            + sized(layers.lobes, LightParts::COUNT * narrow)
            + usize::from(layers.light_groups) * narrow
            + sized(layers.cryptomatte, size_of::<u32>())
    }

    /// Appends all sums to a file's bytes.
    pub fn save(&self, out: &mut Vec<u8>) {
        for_all_sums!(&self.sums, save_all, out);
        self.matte.save(out);
    }

    /// Takes back what [`Self::save`] wrote for a tile of this size and these layers, of a scene of so many fabrics and surfaces: `None` if it
    /// is something else.
    pub fn load(&mut self, mut bytes: &[u8], things: usize) -> Option<()> {
        let mut expected = 0;
        for_all_sums!(&self.sums, add_bytes, &mut expected);
        if bytes.len() < expected {
            return None;
        }
        for_all_sums!(&mut self.sums, load_all, &mut bytes);
        self.matte.load(bytes, things)
    }
}

#[inline]
fn add_each<const N: usize>(sum: &mut [NarrowSum; N], value: [f32; N]) {
    sum.iter_mut().zip(value).for_each(|(sum, v)| sum.add(v));
}

pub(super) fn add_bytes<T: Exact>(sums: &[T], bytes: &mut usize) {
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
