//! FLIP, the difference that a person sees when two pictures are flipped in place.
//!
//! 1. P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström, M. Fairchild: "FLIP: A Difference Evaluator
//!    for Alternating Images", HPG 2020. Colours are blurred as the eye does at the distance of viewing, compared in a
//!    space where differences look even, and raised by what edges and points have changed.
//! 2. P. Andersson, J. Nilsson, P. Shirley, T. Akenine-Möller: "Visualizing Errors in Rendered High Dynamic Range
//!    Images", Eurographics 2021: the largest difference over a range of exposures.
//!
//! Kernels of both papers are products of one-dimensional ones, or sums of two such products, and are applied so.

use std::f32::consts::PI;

use rayon::prelude::*;

/// Pixels per degree of visual angle at a screen of 3840 pixels and 0.7 m, seen from 0.7 m: the papers' default.
pub const PIXELS_PER_DEGREE: f32 = 0.7 * (3840.0 / 0.7) * (PI / 180.0);

/// Exponent of the colour difference, \[1\] Sec. 4.1.3.
const COLOR_EXPONENT: f32 = 0.7;
/// Exponent of the feature difference, \[1\] Sec. 4.2.
const FEATURE_EXPONENT: f32 = 0.5;
/// Below this share of the largest colour difference, errors spread over all but the top of the range.
const CUT_SHARE: f32 = 0.4;
/// The value that the cut is mapped to.
const CUT_VALUE: f32 = 0.95;
/// Width of the feature detectors in degrees.
const FEATURE_WIDTH: f32 = 0.082;

/// Sensitivity to contrast in luminance, red-green and blue-yellow: two Gaussians each, (a, b) as in \[1\] Table 1.
const SENSITIVITY: [[(f32, f32); 2]; 3] =
    [[(1.0, 0.0047), (0.0, 1e-5)], [(1.0, 0.0053), (0.0, 1e-5)], [(34.1, 0.04), (13.5, 0.025)]];

/// Linear Rec. 709 to XYZ, the fractions of \[1\]'s colour pipeline.
const TO_XYZ: [[f32; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// The inverse of [`TO_XYZ`].
const FROM_XYZ: [[f32; 3]; 3] = [
    [3.241_003_2, -1.537_399, -0.498_615_9],
    [-0.969_224_3, 1.875_93, 0.041_554_23],
    [0.055_639_42, -0.204_011_2, 1.057_149],
];

/// A curve for film, K. Narkowicz's fit to ACES with its usual exposure of 0.6 inside: numerator and denominator,
/// from the square down.
const TONE_MAP: [[f32; 3]; 2] = [[0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0], [0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14]];

/// Colours as three planes of equal size.
type Planes = [Vec<f32>; 3];

/// The difference of two pictures in linear light as a screen without tone mapping shows them: values beyond 0 to 1 are
/// cut. One value from 0 to 1 for each pixel.
///
/// # Panics
/// If a picture is not `width` pixels wide, or their sizes differ.
pub fn ldr(test: &[[f32; 3]], reference: &[[f32; 3]], width: usize) -> Vec<f32> {
    let kernels = Kernels::new(PIXELS_PER_DEGREE);
    let cut = |color: &[f32; 3]| color.map(|v| v.clamp(0.0, 1.0));
    kernels.difference(&planes(test, cut), &planes(reference, cut), width)
}

/// The range of exposures, in stops, that HDR FLIP looks at, and their number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposures {
    /// The brightest luminance of the reference lands at 0.85 on the screen.
    pub start: f32,
    /// The median luminance lands there.
    pub stop: f32,
    /// Even steps, both ends included.
    pub count: u32,
}

impl Exposures {
    /// The range for a reference, \[2\] Sec. 3; `None` for a picture without light.
    ///
    /// Where more than half of the pixels are black, the median of the others is taken: the paper leaves that open.
    pub fn of(reference: &[[f32; 3]]) -> Option<Self> {
        let luminance = |c: &[f32; 3]| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
        let mut all: Vec<f32> = reference.iter().map(luminance).collect();
        all.sort_by(f32::total_cmp);
        // Of an even number of pixels the upper of the two in the middle, as the authors' program does.
        let median = |sorted: &[f32]| sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        let highest = *all.last()?;
        let mut middle = median(&all);
        if middle <= 0.0 {
            middle = median(&all[all.partition_point(|v| *v <= 0.0)..]);
        }
        if middle <= 0.0 || !highest.is_finite() {
            return None;
        }
        // Where the curve reaches 0.85: the larger root of a quadratic.
        let [a, b, c] = std::array::from_fn(|i| TONE_MAP[0][i] - 0.85 * TONE_MAP[1][i]);
        let half = -0.5 * b / a;
        let shown = half + (half * half - c / a).sqrt();
        let (start, stop) = ((shown / highest).log2(), (shown / middle).log2());
        Some(Self { start, stop, count: (stop - start).ceil().max(2.0) as u32 })
    }
}

/// The difference of two pictures of any range: at each pixel the largest over a range of exposures, see [`Exposures`].
/// `None` for a reference without light.
///
/// # Panics
/// If a picture is not `width` pixels wide, or their sizes differ.
pub fn hdr(test: &[[f32; 3]], reference: &[[f32; 3]], width: usize) -> Option<Vec<f32>> {
    let exposures = Exposures::of(reference)?;
    let kernels = Kernels::new(PIXELS_PER_DEGREE);
    let step = (exposures.stop - exposures.start) / (exposures.count - 1) as f32;
    let mut largest = vec![0.0_f32; reference.len()];
    for i in 0..exposures.count {
        let gain = (exposures.start + i as f32 * step).exp2();
        let shown = |color: &[f32; 3]| color.map(|v| tone_map(v * gain));
        let map = kernels.difference(&planes(test, shown), &planes(reference, shown), width);
        largest.iter_mut().zip(map).for_each(|(most, value)| *most = most.max(value));
    }
    Some(largest)
}

fn tone_map(value: f32) -> f32 {
    let x = value.clamp(0.0, 1e4);
    let at = |k: [f32; 3]| (k[0] * x + k[1]) * x + k[2];
    (at(TONE_MAP[0]) / at(TONE_MAP[1])).clamp(0.0, 1.0)
}

fn planes(colors: &[[f32; 3]], shown: impl Fn(&[f32; 3]) -> [f32; 3]) -> Planes {
    let mut out: Planes = std::array::from_fn(|_| Vec::with_capacity(colors.len()));
    for color in colors {
        for (plane, value) in out.iter_mut().zip(shown(color)) {
            plane.push(value);
        }
    }
    out
}

fn multiply(m: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// The white point: the sums of [`TO_XYZ`]'s rows.
fn white() -> [f32; 3] {
    multiply(&TO_XYZ, [1.0; 3])
}

/// Linear light to luminance and two opponent colours, a linear relative of CIELab.
fn to_opponent(rgb: [f32; 3]) -> [f32; 3] {
    let (xyz, white) = (multiply(&TO_XYZ, rgb), white());
    let [x, y, z] = std::array::from_fn(|i| xyz[i] / white[i]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn from_opponent(c: [f32; 3]) -> [f32; 3] {
    let y = (c[0] + 16.0) / 116.0;
    let relative = [y + c[1] / 500.0, y, y - c[2] / 200.0];
    let white = white();
    multiply(&FROM_XYZ, std::array::from_fn(|i| relative[i] * white[i]))
}

/// Linear light to CIELab whose colours fade with darkness, after Hunt.
fn to_hunt_lab(rgb: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let (xyz, white) = (multiply(&TO_XYZ, rgb), white());
    let [x, y, z] = std::array::from_fn(|i| {
        let t = xyz[i] / white[i];
        if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    });
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// The distance for large colour differences, raised to its power.
fn color_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let distance = (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2]);
    distance.powf(COLOR_EXPONENT)
}

/// Everything that depends on the distance of viewing only.
struct Kernels {
    /// For each opponent colour, up to two blurs: weight, and a kernel for both axes.
    eye: [Vec<(f32, Vec<f32>)>; 3],
    /// Gaussian, its first and its second derivative; the positive and the negative part of a derivative sum to one each.
    smooth: Vec<f32>,
    edge: Vec<f32>,
    point: Vec<f32>,
    /// The difference between the most different colours of a screen.
    largest: f32,
}

impl Kernels {
    fn new(pixels_per_degree: f32) -> Self {
        let widest = SENSITIVITY.as_flattened().iter().map(|(_, b)| *b).fold(0.0, f32::max);
        let reach = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i32;
        let eye = SENSITIVITY.map(|gaussians| {
            let parts: Vec<(f32, Vec<f32>)> = gaussians
                .iter()
                .filter(|(a, _)| *a > 0.0)
                .map(|(a, b)| {
                    let at = |x: i32| (-(PI * x as f32 / pixels_per_degree).powi(2) / b).exp();
                    let kernel: Vec<f32> = (-reach..=reach).map(at).collect();
                    let sum: f32 = kernel.iter().sum();
                    (a * (PI / b).sqrt() * sum * sum, kernel.iter().map(|v| v / sum).collect())
                })
                .collect();
            let total: f32 = parts.iter().map(|(weight, _)| weight).sum();
            parts.into_iter().map(|(weight, kernel)| (weight / total, kernel)).collect()
        });
        let deviation = 0.5 * FEATURE_WIDTH * pixels_per_degree;
        let reach = (3.0 * deviation).ceil() as i32;
        let gaussian = |x: f32| (-x * x / (2.0 * deviation * deviation)).exp();
        let kernel = |f: &dyn Fn(f32) -> f32| -> Vec<f32> {
            let raw: Vec<f32> = (-reach..=reach).map(|x| f(x as f32)).collect();
            let sum = |sign: f32| raw.iter().map(|v| (sign * v).max(0.0)).sum::<f32>().max(f32::MIN_POSITIVE);
            let (positive, negative) = (sum(1.0), sum(-1.0));
            raw.iter().map(|v| v / if *v > 0.0 { positive } else { negative }).collect()
        };
        let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(to_hunt_lab);
        Self {
            eye,
            smooth: kernel(&gaussian),
            edge: kernel(&|x| -x * gaussian(x)),
            point: kernel(&|x| (x * x / (deviation * deviation) - 1.0) * gaussian(x)),
            largest: color_distance(green, blue),
        }
    }

    /// The difference of two pictures whose values are 0 to 1.
    fn difference(&self, test: &Planes, reference: &Planes, width: usize) -> Vec<f32> {
        let [test, reference] = [test, reference].map(|picture| {
            let pixels = (0..picture[0].len()).into_par_iter();
            let opponent: Vec<[f32; 3]> =
                pixels.map(|i| to_opponent([picture[0][i], picture[1][i], picture[2][i]])).collect();
            let opponent = planes(&opponent, |c| *c);
            (self.perceived(&opponent, width), self.features(&opponent[0], width))
        });
        let pixels = (0..test.0.len()).into_par_iter();
        pixels
            .map(|i| {
                let color = self.spread(color_distance(test.0[i], reference.0[i]));
                let [edge, point] = [0, 1].map(|k| (test.1[i][k] - reference.1[i][k]).abs());
                let feature = (edge.max(point) * std::f32::consts::FRAC_1_SQRT_2).powf(FEATURE_EXPONENT);
                color.powf(1.0 - feature)
            })
            .collect()
    }

    /// Most differences are small: they get most of the range from 0 to 1.
    fn spread(&self, difference: f32) -> f32 {
        let cut = CUT_SHARE * self.largest;
        if difference < cut {
            difference * CUT_VALUE / cut
        } else {
            CUT_VALUE + (difference - cut) / (self.largest - cut) * (1.0 - CUT_VALUE)
        }
    }

    /// What the eye makes of colours at the distance of viewing, in a space where differences look even.
    fn perceived(&self, opponent: &Planes, width: usize) -> Vec<[f32; 3]> {
        let blurred: Planes = std::array::from_fn(|channel| {
            let mut sum = vec![0.0; opponent[channel].len()];
            for (weight, kernel) in &self.eye[channel] {
                let part = convolve(&opponent[channel], width, kernel, kernel);
                sum.iter_mut().zip(part).for_each(|(sum, value)| *sum += weight * value);
            }
            sum
        });
        (0..blurred[0].len())
            .into_par_iter()
            .map(|i| {
                let rgb = from_opponent([blurred[0][i], blurred[1][i], blurred[2][i]]);
                to_hunt_lab(rgb.map(|v| v.clamp(0.0, 1.0)))
            })
            .collect()
    }

    /// How much of an edge and of a point stands at each pixel.
    fn features(&self, luminance: &[f32], width: usize) -> Vec<[f32; 2]> {
        let grey: Vec<f32> = luminance.iter().map(|y| (y + 16.0) / 116.0).collect();
        let size = |kernel: &[f32]| {
            let across = convolve(&grey, width, kernel, &self.smooth);
            let along = convolve(&grey, width, &self.smooth, kernel);
            across.into_iter().zip(along).map(|(x, y)| x.hypot(y)).collect::<Vec<f32>>()
        };
        size(&self.edge).into_iter().zip(size(&self.point)).map(|(edge, point)| [edge, point]).collect()
    }
}

/// A plane under a kernel for rows and one for columns, both of odd length; beyond its edges it goes on as it ends.
fn convolve(plane: &[f32], width: usize, rows: &[f32], columns: &[f32]) -> Vec<f32> {
    let height = plane.len() / width;
    let tap =
        |position: usize, k: usize, length: usize, size: usize| (position + k).saturating_sub(length / 2).min(size - 1);
    let mut across = vec![0.0; plane.len()];
    across.par_chunks_mut(width).zip(plane.par_chunks(width)).for_each(|(out, line)| {
        for (x, out) in out.iter_mut().enumerate() {
            *out = rows.iter().enumerate().map(|(k, w)| w * line[tap(x, k, rows.len(), width)]).sum();
        }
    });
    let mut both = vec![0.0; plane.len()];
    both.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (k, weight) in columns.iter().enumerate() {
            let line = &across[tap(y, k, columns.len(), height) * width..][..width];
            out.iter_mut().zip(line).for_each(|(out, value)| *out += weight * value);
        }
    });
    both
}
