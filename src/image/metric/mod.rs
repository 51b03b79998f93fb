//! How far two pictures of the same scene are apart: one is tested, the other is the reference.
//!
//! [`Pair`] puts the two side by side and says which pixels count: those under the mask where both pictures are
//! finite. [`Comparison::new`] computes every metric of it; [`map`] makes pictures of errors. Fibre noise is not model
//! error: after [`Pair::downsampled`] by 2, 4 and 8 little of it is left, and where both files carry the variance of
//! their pixels, what noise alone would do is said beside what was found.

pub mod flip;
mod halves;
pub mod map;
pub mod ssim;

use std::fmt;

pub use halves::Halves;

use super::{Image, interleaved};

/// Added to the square of the reference in [relMSE](Errors::rel_mse): errors in what is nearly black count less.
pub const EPSILON: f64 = 1e-2;

/// The share of pixels, those with the largest error, that trimmed metrics leave out.
pub const TRIMMED: f64 = 1e-3;

/// Edges of the boxes by which pictures are reduced.
pub const FACTORS: [usize; 4] = [1, 2, 4, 8];

/// Why two pictures cannot be compared: the end of a sentence that names them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mismatch(String);

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Mismatch {}

/// Two pictures of the same size, pixel by pixel, and which pixels count.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// Pixels in a row.
    pub width: usize,
    /// Linear colours of the picture that is tested, the top row first; black where either picture is not finite.
    pub test: Vec<[f32; 3]>,
    /// Linear colours of the reference, the top row first; black where either picture is not finite.
    pub reference: Vec<[f32; 3]>,
    /// Which pixels count.
    pub counted: Vec<bool>,
    /// Variance of each pixel's mean, of both pictures together; where both have a layer `variance`.
    pub variance: Option<Vec<[f32; 3]>>,
    /// Pixels of each picture that are not finite; none of them counts.
    pub non_finite: [usize; 2],
}

impl Pair {
    /// Puts two pictures side by side.
    ///
    /// # Errors
    /// Their sizes differ, they are different parts of a frame, or one has no colours.
    pub fn new(test: &Image, reference: &Image) -> Result<Self, Mismatch> {
        let size = |image: &Image| [image.width, image.height];
        if size(test) != size(reference) {
            let ([w, h], [v, g]) = (size(test), size(reference));
            return Err(Mismatch(format!("their sizes differ: {w} x {h} and {v} x {g} pixels")));
        }
        if test.origin != reference.origin {
            let ([x, y], [u, v]) = (test.origin, reference.origin);
            return Err(Mismatch(format!(
                "they are different parts of the frame: one begins at pixel {x},{y}, the other at {u},{v}"
            )));
        }
        let colors = |image: &Image, which: &str| {
            let planes = image.rgb().ok_or_else(|| {
                let names: Vec<&str> = image.channels.iter().map(|c| c.name.as_str()).collect();
                Mismatch(format!("the {which} has no colours; its channels are {}", names.join(", ")))
            })?;
            Ok(interleaved(planes))
        };
        let variance = match (test.layer_rgb("variance"), reference.layer_rgb("variance")) {
            // Of one sample a pixel none is known, and the layer is 0 everywhere.
            (Some(a), Some(b)) if [a, b].iter().all(|v| v.iter().any(|plane| plane.iter().any(|v| *v > 0.0))) => {
                let sum = |(a, b): ([f32; 3], [f32; 3])| std::array::from_fn(|k| a[k] + b[k]);
                Some(interleaved(a).into_iter().zip(interleaved(b)).map(sum).collect())
            }
            _ => None,
        };
        let mut pair = Self {
            width: test.width,
            test: colors(test, "first")?,
            reference: colors(reference, "second")?,
            counted: vec![true; test.width * test.height],
            variance,
            non_finite: [0, 0],
        };
        pair.drop_non_finite();
        Ok(pair)
    }

    /// Lets no pixel count where either picture is not finite.
    fn drop_non_finite(&mut self) {
        let infinite = |color: &[f32; 3]| color.iter().any(|v| !v.is_finite());
        for i in 0..self.counted.len() {
            let found = [infinite(&self.test[i]), infinite(&self.reference[i])];
            for (count, found) in self.non_finite.iter_mut().zip(found) {
                *count += usize::from(found);
            }
            if found.contains(&true) {
                // Black in both: what looks at the surroundings of a pixel sees no difference here.
                (self.test[i], self.reference[i], self.counted[i]) = ([0.0; 3], [0.0; 3], false);
            }
        }
    }

    /// Lets only pixels count that also count under the mask, one entry for each pixel.
    pub fn restrict(&mut self, mask: &[bool]) {
        self.counted.iter_mut().zip(mask).for_each(|(counted, mask)| *counted &= mask);
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.counted.len() / self.width.max(1)
    }

    /// Number of pixels that count.
    pub fn count(&self) -> usize {
        self.counted.iter().filter(|c| **c).count()
    }

    /// Both pictures with `factor` x `factor` pixels averaged to one. Only whole boxes are kept; of a box, only pixels
    /// that count are averaged, and it counts if they are at least half of it. `None` where not one box fits.
    pub fn downsampled(&self, factor: usize) -> Option<Self> {
        let boxes = Boxes::new(self.width, &self.counted, factor);
        if boxes.columns == 0 || boxes.rows == 0 {
            return None;
        }
        Some(Self {
            width: boxes.columns,
            test: boxes.mean(&self.test, 1),
            reference: boxes.mean(&self.reference, 1),
            counted: boxes.counted(),
            // The variance of a mean: the sum over the square of the count.
            variance: self.variance.as_ref().map(|v| boxes.mean(v, 2)),
            non_finite: self.non_finite,
        })
    }

    /// Test, reference and their variance at every pixel that counts.
    fn pixels(&self) -> impl Iterator<Item = (usize, [f64; 3], [f64; 3])> {
        let counted = self.counted.iter().enumerate().filter(|(_, counted)| **counted);
        counted.map(|(i, _)| (i, self.test[i].map(f64::from), self.reference[i].map(f64::from)))
    }
}

/// Half of a picture's width, and its colours at half its width and height: means of four. A last odd row or column is left
/// out.
pub fn halved(colors: &[[f32; 3]], width: usize) -> (usize, Vec<[f32; 3]>) {
    (width / 2, Boxes::new(width, &vec![true; colors.len()], 2).mean(colors, 1))
}

/// The whole boxes of `factor` x `factor` pixels of a picture, row by row.
struct Boxes<'a> {
    width: usize,
    columns: usize,
    rows: usize,
    factor: usize,
    counted: &'a [bool],
}

impl<'a> Boxes<'a> {
    fn new(width: usize, counted: &'a [bool], factor: usize) -> Self {
        let height = counted.len() / width.max(1);
        Self { width, columns: width / factor, rows: height / factor, factor, counted }
    }

    /// The pixels that count of each box.
    fn pixels(&self) -> impl Iterator<Item = impl Iterator<Item = usize>> {
        let boxes =
            (0..self.rows).flat_map(move |y| (0..self.columns).map(move |x| (x * self.factor, y * self.factor)));
        boxes.map(move |(x, y)| {
            let all = (y..y + self.factor).flat_map(move |y| (x..x + self.factor).map(move |x| y * self.width + x));
            all.filter(move |i| self.counted[*i])
        })
    }

    /// Sums over boxes, divided by the count of pixels to some power.
    fn mean(&self, colors: &[[f32; 3]], power: i32) -> Vec<[f32; 3]> {
        self.pixels()
            .map(|pixels| {
                let mut sum = [0.0_f64; 3];
                let mut count = 0.0_f64;
                for i in pixels {
                    sum = std::array::from_fn(|k| sum[k] + f64::from(colors[i][k]));
                    count += 1.0;
                }
                sum.map(|v| (v / count.max(1.0).powi(power)) as f32)
            })
            .collect()
    }

    /// Whether at least half of each box counts.
    fn counted(&self) -> Vec<bool> {
        self.pixels().map(|pixels| 2 * pixels.count() >= self.factor * self.factor).collect()
    }
}

/// The square error of a channel over the square of its reference, with [`EPSILON`].
pub fn relative_square(test: f64, reference: f64) -> f64 {
    (test - reference).powi(2) / (reference * reference + EPSILON)
}

/// Errors at one resolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Edge of the boxes that were averaged, in pixels; 1 is full resolution.
    pub factor: usize,
    /// Number of pixels or boxes that count.
    pub count: usize,
    /// Root of the mean square error, over pixels and channels.
    pub rmse: f64,
    /// Mean over pixels and channels of (test - reference)^2 / (reference^2 + [`EPSILON`]).
    pub rel_mse: f64,
    /// The same without the [`TRIMMED`] share of pixels with the largest error: fireflies.
    pub rel_mse_trimmed: f64,
    /// What noise alone would do, where the variance of both pictures is known.
    pub noise: Option<Noise>,
}

/// What the noise of two pictures explains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// The relMSE that pictures of equal means and this variance have. Pixels whose samples are stratified vary less
    /// than their sample variance says, so that this is an upper bound for pictures made here.
    pub rel_mse: f64,
    /// Root mean square of z = (test - reference) / deviation over pixels and channels; 1 if noise is all there is.
    pub z_rms: f64,
    /// The share of |z| within 1, 2 and 3; noise alone gives 0.683, 0.954 and 0.997.
    pub within: [f64; 3],
}

impl Errors {
    /// Errors of a pair as it is; `factor` is only noted. `None` where no pixel counts.
    pub fn of(pair: &Pair, factor: usize) -> Option<Self> {
        let mut square = 0.0;
        let mut relative: Vec<f64> = Vec::with_capacity(pair.counted.len());
        for (_, test, reference) in pair.pixels() {
            square += (0..3).map(|k| (test[k] - reference[k]).powi(2)).sum::<f64>() / 3.0;
            relative.push((0..3).map(|k| relative_square(test[k], reference[k])).sum::<f64>() / 3.0);
        }
        let count = relative.len();
        if count == 0 {
            return None;
        }
        let rel_mse = relative.iter().sum::<f64>() / count as f64;
        let kept = count - ((count as f64 * TRIMMED).ceil() as usize).min(count - 1);
        relative.sort_by(f64::total_cmp);
        Some(Self {
            factor,
            count,
            rmse: (square / count as f64).sqrt(),
            rel_mse,
            rel_mse_trimmed: relative[..kept].iter().sum::<f64>() / kept as f64,
            noise: pair.variance.as_ref().and_then(|variance| Noise::of(pair, variance)),
        })
    }
}

impl Noise {
    fn of(pair: &Pair, variance: &[[f32; 3]]) -> Option<Self> {
        let mut rel_mse = 0.0;
        let mut square = 0.0;
        let mut within = [0.0; 3];
        let (mut channels, mut scored) = (0.0, 0.0);
        for (i, test, reference) in pair.pixels() {
            for k in 0..3 {
                let variance = f64::from(variance[i][k]);
                rel_mse += variance / (reference[k] * reference[k] + EPSILON);
                channels += 1.0;
                // Where nothing varies, as in an even background, there is no noise to compare with.
                if variance > 0.0 {
                    let z = (test[k] - reference[k]) / variance.sqrt();
                    square += z * z;
                    scored += 1.0;
                    for (share, limit) in within.iter_mut().zip([1.0, 2.0, 3.0]) {
                        *share += f64::from(u8::from(z.abs() <= limit));
                    }
                }
            }
        }
        (scored > 0.0).then(|| Self {
            rel_mse: rel_mse / channels,
            z_rms: (square / scored).sqrt(),
            within: within.map(|share| share / scored),
        })
    }
}

/// Every metric of a pair.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Number of pixels, and of those that count.
    pub pixels: [usize; 2],
    /// Pixels of test and reference that are not finite.
    pub non_finite: [usize; 2],
    /// Mean colour of the test and of the reference.
    pub means: [[f64; 3]; 2],
    /// Mean of the test over mean of the reference, for each channel; NaN where the reference is black.
    pub mean_ratio: [f64; 3],
    /// 95 % of all repetitions with this noise have their ratio at most this far from the expected one, where the variance
    /// is known: 1.96 standard errors.
    pub ratio_uncertainty: Option<[f64; 3]>,
    /// Errors at full resolution and after [`FACTORS`], as far as the picture allows.
    pub errors: Vec<Errors>,
    /// Mean of [`ssim::map`]; `None` if no window of 11 x 11 pixels fits around a pixel that counts.
    pub ssim: Option<f64>,
    /// Mean of [`flip::ldr`].
    pub flip_ldr: f64,
    /// Mean of [`flip::hdr`]; `None` if the reference is black.
    pub flip_hdr: Option<f64>,
}

impl Comparison {
    /// Computes all of it; `None` where no pixel counts.
    ///
    /// ```
    /// use yarnray::image::{Channel, Image, metric::{Comparison, Pair}};
    ///
    /// let grey = |value: f32| {
    ///     let mut image = Image::new(16, 16);
    ///     image.channels = ["R", "G", "B"].map(|name| Channel { name: name.into(), samples: vec![value; 256] }).into();
    ///     image
    /// };
    /// let pair = Pair::new(&grey(0.55), &grey(0.5)).unwrap();
    /// let comparison = Comparison::new(&pair).unwrap();
    /// assert!((comparison.mean_ratio[0] - 1.1).abs() < 1e-6);
    /// // (0.55 - 0.5)^2 / (0.5^2 + 0.01)
    /// assert!((comparison.full().rel_mse - 0.0025 / 0.26).abs() < 1e-7);
    /// ```
    ///
    /// FLIP and SSIM look at the surroundings of a pixel too: there, pixels that do not count have their colours all the
    /// same (those that are not finite are black in both pictures).
    pub fn new(pair: &Pair) -> Option<Self> {
        let errors: Vec<Errors> = FACTORS
            .iter()
            .filter_map(|factor| match factor {
                1 => Errors::of(pair, 1),
                _ => Errors::of(&pair.downsampled(*factor)?, *factor),
            })
            .collect();
        let count = errors.first().filter(|e| e.factor == 1)?.count;
        let mut means = [[0.0; 3]; 2];
        let mut variance = [0.0; 3];
        for (i, test, reference) in pair.pixels() {
            for k in 0..3 {
                means[0][k] += test[k] / count as f64;
                means[1][k] += reference[k] / count as f64;
                variance[k] += pair.variance.as_ref().map_or(0.0, |v| f64::from(v[i][k])) / (count * count) as f64;
            }
        }
        // The deviation of a ratio near one: that of the difference over the mean.
        let uncertainty = |k: usize| 1.96 * variance[k].sqrt() / means[1][k];
        let mean = |map: &[f32]| {
            let counted = map.iter().zip(&pair.counted).filter(|(_, counted)| **counted);
            counted.map(|(v, _)| f64::from(*v)).sum::<f64>() / count as f64
        };
        let (mut similarity, mut windows) = (0.0, 0_u32);
        for (i, value) in ssim::map(&pair.test, &pair.reference, pair.width) {
            if pair.counted[i] {
                similarity += value;
                windows += 1;
            }
        }
        Some(Self {
            pixels: [pair.counted.len(), count],
            non_finite: pair.non_finite,
            means,
            // Black is as bright as black.
            mean_ratio: std::array::from_fn(
                |k| if means[0][k] == means[1][k] { 1.0 } else { means[0][k] / means[1][k] },
            ),
            ratio_uncertainty: pair.variance.as_ref().map(|_| std::array::from_fn(uncertainty)),
            errors,
            ssim: (windows > 0).then(|| similarity / f64::from(windows)),
            flip_ldr: mean(&flip::ldr(&pair.test, &pair.reference, pair.width)),
            flip_hdr: flip::hdr(&pair.test, &pair.reference, pair.width).map(|map| mean(&map)),
        })
    }

    /// Errors at full resolution.
    pub fn full(&self) -> &Errors {
        &self.errors[0]
    }

    /// Errors after boxes of this edge were averaged.
    pub fn reduced(&self, factor: usize) -> Option<&Errors> {
        self.errors.iter().find(|e| e.factor == factor)
    }
}

#[cfg(test)]
mod tests;
