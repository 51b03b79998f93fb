//! Environment lights: one radiance, or an image in latitude and longitude with tables for importance sampling.

use std::{f32::consts::PI, sync::Arc};

use glam::{Mat3A, Vec2, Vec3A};

use crate::math::{Rgb, frame::sin_cos};

/// An environment light: one radiance, or an image in latitude and longitude.
#[derive(Clone, Debug)]
pub struct Environment {
    /// Factor on the image, or the radiance itself.
    pub radiance: Rgb,
    /// The image, where there is one.
    pub image: Option<Arc<EnvironmentMap>>,
    /// Whether the camera sees it; it lights the cloth in any case.
    pub visible: bool,
}

/// A latitude-longitude image with its tables for importance sampling. The top row is up (+y), the middle column is
/// straight ahead (-z) unless rotated.
#[derive(Clone, Debug)]
pub struct EnvironmentMap {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
    /// Distribution of rows, and in each row of columns, by luminance and solid angle; each ends in 1.
    rows: Vec<f32>,
    columns: Vec<f32>,
    /// Mean over the sphere and the channels.
    mean: f32,
    /// From the world to the image's frame.
    rotation: Mat3A,
}

impl Environment {
    /// Mean radiance over all directions.
    pub fn mean(&self) -> Rgb {
        match &self.image {
            None => self.radiance,
            Some(map) => self.radiance * map.mean,
        }
    }

    /// What comes from a direction.
    #[inline]
    pub fn radiance(&self, direction: Vec3A) -> Rgb {
        match &self.image {
            None => self.radiance,
            Some(map) => self.radiance * map.radiance(direction),
        }
    }

    /// Density (1/steradian) with which [`super::Light::sample`] draws a direction; 0 if it never does.
    #[inline]
    pub fn pdf(&self, direction: Vec3A) -> f32 {
        self.image.as_ref().map_or(0.0, |map| map.pdf(direction))
    }
}

impl EnvironmentMap {
    /// From rows of pixels, the top row first, and a rotation from the world to the image. Negative and non-finite
    /// values count as 0.
    ///
    /// # Panics
    /// If the number of pixels is not `width` x `height` or either is 0.
    pub fn new(width: usize, height: usize, mut pixels: Vec<[f32; 3]>, rotation: Mat3A) -> Self {
        assert!(width > 0 && height > 0 && pixels.len() == width * height, "an image has all its pixels");
        for p in pixels.iter_mut().flatten() {
            if !(*p >= 0.0 && p.is_finite()) {
                *p = 0.0;
            }
        }
        let mut columns = Vec::with_capacity(width * height);
        let mut rows = Vec::with_capacity(height);
        let (mut total, mut solid) = (0f64, 0f64);
        for y in 0..height {
            let sin = ((y as f64 + 0.5) / height as f64 * std::f64::consts::PI).sin();
            let mut row = 0f64;
            let start = columns.len();
            for x in 0..width {
                row += f64::from(Rgb::from(pixels[y * width + x]).mean());
                columns.push(row as f32);
            }
            let norm = if row > 0.0 { 1.0 / row as f32 } else { 0.0 };
            for (x, c) in columns[start..].iter_mut().enumerate() {
                *c = if row > 0.0 { *c * norm } else { (x + 1) as f32 / width as f32 };
            }
            columns[start + width - 1] = 1.0;
            total += row * sin;
            solid += sin * width as f64;
            rows.push(total);
        }
        let mean = total / solid;
        let mut rows: Vec<f32> = rows
            .into_iter()
            .enumerate()
            .map(|(y, r)| if total > 0.0 { (r / total) as f32 } else { (y + 1) as f32 / height as f32 })
            .collect();
        rows[height - 1] = 1.0;
        Self { width, height, pixels, rows, columns, mean: mean as f32, rotation }
    }

    /// The pixels, the top row first.
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    /// From the world to the image.
    pub fn rotation(&self) -> Mat3A {
        self.rotation
    }

    /// Bytes of pixels and tables.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&*self.pixels) + size_of_val(&*self.rows) + size_of_val(&*self.columns)) as u64
    }

    #[inline]
    fn cell(&self, direction: Vec3A) -> (usize, usize) {
        let d = self.rotation * direction;
        let v = d.y.clamp(-1.0, 1.0).acos() / PI;
        let u = 0.5 + d.x.atan2(-d.z) / (2.0 * PI);
        (
            ((u * self.width as f32) as usize).min(self.width - 1),
            ((v * self.height as f32) as usize).min(self.height - 1),
        )
    }

    /// The pixel in a direction. (Between pixels there is nothing: what is drawn is what is sampled.)
    #[inline]
    pub(super) fn radiance(&self, direction: Vec3A) -> Rgb {
        let (x, y) = self.cell(direction);
        self.pixels[y * self.width + x].into()
    }

    fn step(table: &[f32], i: usize) -> f32 {
        table[i] - if i == 0 { 0.0 } else { table[i - 1] }
    }

    fn pdf(&self, direction: Vec3A) -> f32 {
        let (x, y) = self.cell(direction);
        self.cell_pdf(x, y)
    }

    /// Density per steradian of a cell: its share over its solid angle.
    fn cell_pdf(&self, x: usize, y: usize) -> f32 {
        let row = &self.columns[y * self.width..(y + 1) * self.width];
        let share = Self::step(&self.rows, y) * Self::step(row, x);
        let (top, bottom) = self.row_cosines(y);
        share / ((top - bottom) * 2.0 * PI / self.width as f32)
    }

    fn row_cosines(&self, y: usize) -> (f32, f32) {
        let at = |y: usize| (PI * y as f32 / self.height as f32).cos();
        (at(y), at(y + 1))
    }

    /// A direction and its density (1/steradian).
    pub(super) fn sample(&self, u: Vec2) -> Option<(Vec3A, f32)> {
        let y = self.rows.partition_point(|&c| c <= u.y).min(self.height - 1);
        let row = &self.columns[y * self.width..(y + 1) * self.width];
        let x = row.partition_point(|&c| c <= u.x).min(self.width - 1);
        let within = |table: &[f32], i: usize, u: f32| {
            let low = if i == 0 { 0.0 } else { table[i - 1] };
            ((u - low) / (table[i] - low).max(1e-20)).clamp(1e-4, 1.0 - 1e-4)
        };
        let (top, bottom) = self.row_cosines(y);
        let cos = top + (bottom - top) * within(&self.rows, y, u.y);
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let longitude = ((x as f32 + within(row, x, u.x)) / self.width as f32 - 0.5) * 2.0 * PI;
        let (s, c) = sin_cos(longitude);
        let local = Vec3A::new(sin * s, cos, -sin * c);
        let pdf = self.cell_pdf(x, y);
        (pdf > 0.0).then(|| (self.rotation.transpose() * local, pdf))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::Stream;

    fn map() -> EnvironmentMap {
        let (w, h) = (24, 12);
        let pixels = (0..w * h)
            .map(|i| {
                let bright = if i % 37 == 5 { 40.0 } else { 0.3 };
                [bright, 0.5 * bright, 0.1]
            })
            .collect();
        EnvironmentMap::new(w, h, pixels, Mat3A::from_rotation_y(0.4))
    }

    #[test]
    fn sampling_an_image_integrates_to_its_mean_with_the_stated_density() {
        let map = map();
        let mut stream = Stream::new(4);
        let n = 40_000;
        let (mut sum, mut mass) = (0f64, 0f64);
        for _ in 0..n {
            let (d, pdf) = map.sample(Vec2::new(stream.next(), stream.next())).unwrap();
            assert!((d.length() - 1.0).abs() < 1e-5);
            assert!((map.pdf(d) / pdf - 1.0).abs() < 1e-3, "{} {pdf}", map.pdf(d));
            sum += f64::from(map.radiance(d).mean() / pdf) / f64::from(n);
            let uniform = {
                let z = 2.0 * stream.next() - 1.0;
                let (s, c) = sin_cos(2.0 * PI * stream.next());
                let r = (1.0 - z * z).sqrt();
                Vec3A::new(r * c, z, r * s)
            };
            mass += f64::from(map.pdf(uniform)) * 4.0 * std::f64::consts::PI / f64::from(n);
        }
        let want = f64::from(map.mean) * 4.0 * std::f64::consts::PI;
        assert!((sum / want - 1.0).abs() < 0.02, "{sum} {want}");
        assert!((mass - 1.0).abs() < 0.05, "the density has mass {mass}");
    }

    #[test]
    fn up_is_up_and_the_middle_is_ahead() {
        let mut pixels = vec![[0.0; 3]; 8 * 4];
        pixels[4] = [7.0, 0.0, 0.0];
        pixels[2 * 8 + 4] = [0.0, 5.0, 0.0];
        let map = EnvironmentMap::new(8, 4, pixels, Mat3A::IDENTITY);
        assert_eq!(map.radiance(Vec3A::new(0.05, 1.0, -0.1).normalize()).to_array()[0], 7.0);
        assert_eq!(map.radiance(Vec3A::new(0.1, -0.2, -1.0).normalize()).to_array()[1], 5.0);
    }

    #[test]
    fn black_and_broken_images_are_dark_not_broken() {
        let map = EnvironmentMap::new(2, 1, vec![[f32::NAN, -1.0, f32::INFINITY]; 2], Mat3A::IDENTITY);
        assert_eq!(map.mean, 0.0);
        for i in 0..10 {
            if let Some((d, pdf)) = map.sample(Vec2::splat(i as f32 * 0.1)) {
                assert!(d.is_finite() && pdf.is_finite());
            }
        }
    }
}
