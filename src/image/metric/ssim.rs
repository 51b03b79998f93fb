//! Structural similarity: Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli, "Image Quality Assessment: From Error
//! Visibility to Structural Similarity", IEEE Transactions on Image Processing 2004.

use crate::image::png::linear_to_srgb;

/// Half the width of the window: Gaussian weights with a deviation of 1.5 pixels, 11 pixels wide.
const REACH: usize = 5;
const DEVIATION: f64 = 1.5;

/// (K1 L)^2 and (K2 L)^2 for values from 0 to 1.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// The similarity at every pixel whose window lies inside the picture, as (pixel, mean of the three channels): 1 where
/// both agree. Colours are taken as a screen shows them, sRGB-encoded and cut to 0 to 1. Empty for pictures of fewer than
/// 11 x 11 pixels.
pub fn map(a: &[[f32; 3]], b: &[[f32; 3]], width: usize) -> Vec<(usize, f64)> {
    let height = a.len() / width.max(1);
    if width <= 2 * REACH || height <= 2 * REACH {
        return Vec::new();
    }
    let kernel: Vec<f64> = {
        let raw: Vec<f64> = (0..=2 * REACH)
            .map(|i| (-(i as f64 - REACH as f64).powi(2) / (2.0 * DEVIATION * DEVIATION)).exp())
            .collect();
        let sum: f64 = raw.iter().sum();
        raw.iter().map(|v| v / sum).collect()
    };
    let mut out: Vec<(usize, f64)> =
        (REACH..height - REACH).flat_map(|y| (REACH..width - REACH).map(move |x| (y * width + x, 0.0))).collect();
    for channel in 0..3 {
        let shown = |colors: &[[f32; 3]]| -> Vec<f64> {
            colors.iter().map(|c| f64::from(linear_to_srgb(c[channel]))).collect()
        };
        let (a, b) = (shown(a), shown(b));
        let product = |p: &[f64], q: &[f64]| -> Vec<f64> { p.iter().zip(q).map(|(p, q)| p * q).collect() };
        let mean = |plane: &[f64]| weighted(plane, width, &kernel);
        let (mean_a, mean_b) = (mean(&a), mean(&b));
        let (square_a, square_b, cross) = (mean(&product(&a, &a)), mean(&product(&b, &b)), mean(&product(&a, &b)));
        for (i, (_, sum)) in out.iter_mut().enumerate() {
            let (ma, mb) = (mean_a[i], mean_b[i]);
            let (va, vb, vab) = (square_a[i] - ma * ma, square_b[i] - mb * mb, cross[i] - ma * mb);
            *sum += (2.0 * ma * mb + C1) * (2.0 * vab + C2) / ((ma * ma + mb * mb + C1) * (va + vb + C2)) / 3.0;
        }
    }
    out
}

/// Weighted means over all windows that lie inside, row by row.
fn weighted(plane: &[f64], width: usize, kernel: &[f64]) -> Vec<f64> {
    let inner = width + 1 - kernel.len();
    let lines: Vec<Vec<f64>> = plane
        .chunks_exact(width)
        .map(|line| line.windows(kernel.len()).map(|w| w.iter().zip(kernel).map(|(v, k)| v * k).sum()).collect())
        .collect();
    lines
        .windows(kernel.len())
        .flat_map(|rows| (0..inner).map(move |x| rows.iter().zip(kernel).map(|(row, k)| row[x] * k).sum()))
        .collect()
}
