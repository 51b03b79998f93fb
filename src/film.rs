//! What pixels have collected: sums owned by tiles, so that threads share nothing.

mod matte;

use glam::Vec3A;

use crate::{
    integrator::{ClothId, LightParts, Sample},
    scene::Layers,
};

pub use matte::Matte;

/// Edge of a tile in pixels.
pub const TILE: u32 = 16;

/// The pixels of one tile, row by row.
#[derive(Clone, Debug)]
pub struct Tile {
    /// Upper left pixel, in the whole picture.
    pub x: u32,
    /// As `x`.
    pub y: u32,
    /// Size; smaller than [`TILE`] at the right and lower edge.
    pub width: u32,
    /// As `width`.
    pub height: u32,
    count: Vec<u32>,
    /// Sums of radiance and of its squares.
    color: Vec<[f64; 3]>,
    square: Vec<[f64; 3]>,
    alpha: Vec<f32>,
    depth: Vec<f32>,
    normal: Vec<[f32; 3]>,
    albedo: Vec<[f32; 3]>,
    parts: Vec<[[f32; 3]; LightParts::COUNT]>,
    matte: Matte,
}

impl Tile {
    fn new(x: u32, y: u32, width: u32, height: u32, layers: Layers) -> Self {
        let n = (width * height) as usize;
        let sized = |wanted: bool| if wanted { n } else { 0 };
        Self {
            x,
            y,
            width,
            height,
            count: vec![0; n],
            color: vec![[0.0; 3]; n],
            square: vec![[0.0; 3]; n],
            alpha: vec![0.0; n],
            depth: vec![0.0; sized(layers.depth)],
            normal: vec![[0.0; 3]; sized(layers.normal)],
            albedo: vec![[0.0; 3]; sized(layers.albedo)],
            parts: vec![[[0.0; 3]; LightParts::COUNT]; sized(layers.lobes)],
            matte: Matte::new(sized(layers.cryptomatte)),
        }
    }

    /// Adds a sample to a pixel, given from the tile's corner. A sample that is not finite is refused.
    #[inline]
    pub fn add(&mut self, x: u32, y: u32, sample: &Sample) -> bool {
        if !sample.radiance.is_finite() {
            return false;
        }
        let i = (y * self.width + x) as usize;
        self.count[i] += 1;
        for (c, v) in sample.radiance.to_array().into_iter().enumerate() {
            let v = f64::from(v);
            self.color[i][c] += v;
            self.square[i][c] += v * v;
        }
        self.alpha[i] += sample.alpha;
        if let Some(depth) = self.depth.get_mut(i) {
            *depth += sample.depth;
        }
        if let Some(normal) = self.normal.get_mut(i) {
            let n: [f32; 3] = sample.normal.to_array();
            *normal = std::array::from_fn(|c| normal[c] + n[c]);
        }
        if let Some(albedo) = self.albedo.get_mut(i) {
            let a = sample.albedo.to_array();
            *albedo = std::array::from_fn(|c| albedo[c] + a[c]);
        }
        if let Some(cloth) = sample.cloth {
            self.matte.add(i, cloth, 1);
        }
        if let Some(parts) = self.parts.get_mut(i) {
            for (sum, value) in parts.iter_mut().zip(sample.parts.to_array()) {
                let v = value.to_array();
                *sum = std::array::from_fn(|c| sum[c] + v[c]);
            }
        }
        true
    }

    /// Sum over the tile's pixels and channels of the variance of the mean over (mean^2 + 0.01), and their number.
    fn relative_error(&self) -> (f64, f64) {
        let mut sum = 0.0;
        let mut n = 0.0;
        for ((&count, color), square) in self.count.iter().zip(&self.color).zip(&self.square) {
            if count < 2 {
                continue;
            }
            let c = f64::from(count);
            for k in 0..3 {
                let mean = color[k] / c;
                let variance = ((square[k] / c - mean * mean).max(0.0)) / (c - 1.0);
                sum += variance / (mean * mean + 0.01);
                n += 1.0;
            }
        }
        (sum, n)
    }
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
    /// Size of what is rendered.
    pub width: u32,
    /// As `width`.
    pub height: u32,
    tiles: Vec<Tile>,
    columns: u32,
    /// The order in which tiles are rendered: along a Morton curve, so that neighbours share caches.
    order: Vec<u32>,
}

impl Film {
    /// An empty film for the pixels x0, y0, x1, y1 (the latter exclusive).
    pub fn new(crop: [u32; 4], layers: Layers) -> Self {
        let [x0, y0, x1, y1] = crop;
        let (width, height) = (x1 - x0, y1 - y0);
        let (columns, rows) = (width.div_ceil(TILE), height.div_ceil(TILE));
        let tiles = (0..rows * columns)
            .map(|i| {
                let (x, y) = (x0 + i % columns * TILE, y0 + i / columns * TILE);
                Tile::new(x, y, TILE.min(x1 - x), TILE.min(y1 - y), layers)
            })
            .collect();
        let mut order: Vec<u32> = (0..rows * columns).collect();
        order.sort_by_key(|i| morton(i % columns, i / columns));
        Self { origin: [x0, y0], width, height, tiles, columns, order }
    }

    /// The tiles in the order in which to render them.
    pub fn tiles_in_order(&mut self) -> Vec<&mut Tile> {
        let mut slots: Vec<Option<&mut Tile>> = self.tiles.iter_mut().map(Some).collect();
        self.order.iter().filter_map(|&i| slots[i as usize].take()).collect()
    }

    /// The pixel in a column and row of what is rendered.
    pub fn pixel(&self, x: u32, y: u32) -> Pixel {
        let tile = &self.tiles[(y / TILE * self.columns + x / TILE) as usize];
        let i = ((y % TILE) * tile.width + x % TILE) as usize;
        let samples = tile.count[i];
        if samples == 0 {
            return Pixel::default();
        }
        let n = f64::from(samples);
        let mean = tile.color[i].map(|c| c / n);
        let variance = std::array::from_fn(|k| {
            if samples < 2 {
                return 0.0;
            }
            ((tile.square[i][k] / n - mean[k] * mean[k]).max(0.0) / (n - 1.0)) as f32
        });
        let alpha = tile.alpha[i] / samples as f32;
        let normal = tile.normal.get(i).map_or([0.0; 3], |&v| Vec3A::from(v).normalize_or_zero().to_array());
        Pixel {
            color: mean.map(|c| c as f32),
            alpha,
            variance,
            depth: tile.depth.get(i).map_or(0.0, |d| if tile.alpha[i] > 0.0 { d / tile.alpha[i] } else { 0.0 }),
            normal,
            albedo: tile.albedo.get(i).map_or([0.0; 3], |a| a.map(|v| v / samples as f32)),
            parts: tile.parts.get(i).map_or_else(Default::default, |l| l.map(|c| c.map(|v| v / samples as f32))),
            samples,
        }
    }

    /// What covers a pixel and by how many samples, in the order of the ids; nothing if the scene asks for no matte.
    pub fn covering(&self, x: u32, y: u32) -> &[(ClothId, u32)] {
        let tile = &self.tiles[(y / TILE * self.columns + x / TILE) as usize];
        tile.matte.counts(((y % TILE) * tile.width + x % TILE) as usize)
    }

    /// An estimate of the picture's relative mean square error: the mean over pixels and channels of the variance of
    /// the mean over (mean^2 + 0.01); `None` before two samples a pixel.
    pub fn relative_error(&self) -> Option<f64> {
        let (sum, n) = self.tiles.iter().map(Tile::relative_error).fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        (n > 0.0).then(|| sum / n)
    }

    /// Least, mean and most samples of a pixel.
    pub fn samples(&self) -> (u32, f64, u32) {
        let counts = || self.tiles.iter().flat_map(|t| &t.count).copied();
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
    use crate::math::Rgb;

    #[test]
    fn pixels_are_found_again_and_average() {
        let mut film = Film::new([5, 7, 45, 40], Layers::ALL);
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
        assert!(film.relative_error().is_some());
    }

    #[test]
    fn every_tile_is_rendered_once() {
        let mut film = Film::new([0, 0, 100, 33], Layers::NONE);
        let mut seen: Vec<(u32, u32)> = film.tiles_in_order().iter().map(|t| (t.x, t.y)).collect();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), 7 * 3);
    }
}
