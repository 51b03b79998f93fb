//! Metrics on pictures given by formulas. Figures of independent implementations on the same pictures come from
//! `tools/check_metrics.py`, which makes the same pictures: flip-evaluator 1.7 (the authors' own) and scikit-image 0.26.

use super::*;
use crate::image::Channel;

const WIDTH: usize = 96;
const HEIGHT: usize = 64;

/// A number from 0 to 1 that looks random.
fn noise(i: u32) -> f64 {
    let mut i = i.wrapping_mul(2_654_435_761);
    i ^= i >> 15;
    i = i.wrapping_mul(2_246_822_519);
    i ^= i >> 13;
    f64::from(i) / 4_294_967_296.0
}

fn image(width: usize, height: usize, color: impl Fn(usize, usize) -> [f32; 3]) -> Image {
    let mut image = Image::new(width, height);
    for (k, name) in ["R", "G", "B"].into_iter().enumerate() {
        let samples = (0..width * height).map(|i| color(i % width, i / width)[k]).collect();
        image.channels.push(Channel { name: name.to_owned(), samples });
    }
    image
}

fn reference_at(x: usize, y: usize) -> [f64; 3] {
    let (x, y) = (x as f64, y as f64);
    [0.35 + 0.3 * (0.11 * x + 0.05 * y).sin(), 0.30 + 0.25 * (0.07 * x - 0.13 * y).cos(), 0.25 + 0.2 * (0.23 * y).sin()]
        .map(|v| v.max(0.0))
}

fn test_at(x: usize, y: usize) -> [f64; 3] {
    let reference = reference_at(x, y);
    let wave = 1.0 + 0.2 * (0.4 * x as f64).sin();
    let noise = |c: usize| 0.1 * (noise((3 * (y * WIDTH + x) + c) as u32) - 0.5);
    std::array::from_fn(|c| (reference[c] * wave + noise(c)).max(0.0))
}

/// A smooth picture, and the same with waves and noise.
fn plain() -> Pair {
    let test = image(WIDTH, HEIGHT, |x, y| test_at(x, y).map(|v| v as f32));
    let reference = image(WIDTH, HEIGHT, |x, y| reference_at(x, y).map(|v| v as f32));
    Pair::new(&test, &reference).unwrap()
}

/// The same with more range: squared, with a disc 40 times as bright that is elsewhere in the other picture.
fn bright() -> Pair {
    let disc = |x: usize, y: usize, center: f64, gain: f64| {
        if (x as f64 - center).powi(2) + (y as f64 - 20.0).powi(2) < 80.0 { gain } else { 1.0 }
    };
    let test = image(WIDTH, HEIGHT, |x, y| test_at(x, y).map(|v| (v * v * disc(x, y, 61.0, 36.0)) as f32));
    let reference = image(WIDTH, HEIGHT, |x, y| reference_at(x, y).map(|v| (v * v * disc(x, y, 60.0, 40.0)) as f32));
    Pair::new(&test, &reference).unwrap()
}

#[track_caller]
fn near(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value}, expected {expected} +- {tolerance}");
}

#[test]
fn flip_agrees_with_its_authors() {
    let pair = plain();
    let map = flip::ldr(&pair.test, &pair.reference, WIDTH);
    near(f64::from(map[10 * WIDTH + 20]), 0.324_491, 5e-5);
    near(f64::from(map[40 * WIDTH + 70]), 0.233_863, 5e-5);
    near(f64::from(map.iter().copied().fold(0.0, f32::max)), 0.432_102, 5e-5);
    near(Comparison::new(&pair).unwrap().flip_ldr, 0.223_139, 1e-5);

    let pair = bright();
    let exposures = flip::Exposures::of(&pair.reference).unwrap();
    near(f64::from(exposures.start), -2.495_536, 1e-4);
    near(f64::from(exposures.stop), 4.170_172, 1e-4);
    assert_eq!(exposures.count, 7);
    let map = flip::hdr(&pair.test, &pair.reference, WIDTH).unwrap();
    near(f64::from(map[10 * WIDTH + 20]), 0.420_114, 1e-4);
    near(f64::from(map[20 * WIDTH + 61]), 0.477_648, 1e-4);
    near(f64::from(map[40 * WIDTH + 70]), 0.286_573, 1e-4);
    near(f64::from(map.iter().copied().fold(0.0, f32::max)), 0.849_693, 1e-4);
    near(Comparison::new(&pair).unwrap().flip_hdr.unwrap(), 0.342_311, 2e-5);
}

#[test]
fn similarity_agrees_with_scikit_image() {
    let pair = plain();
    let map = ssim::map(&pair.test, &pair.reference, WIDTH);
    assert_eq!(map.len(), (WIDTH - 10) * (HEIGHT - 10));
    let at = |x: usize, y: usize| map.iter().find(|(i, _)| *i == y * WIDTH + x).unwrap().1;
    near(at(10, 20), 0.581_455, 2e-6);
    near(at(5, 5), 0.683_197, 2e-6);
    near(at(48, 32), 0.711_819, 2e-6);
    near(Comparison::new(&pair).unwrap().ssim.unwrap(), 0.675_428_6, 1e-6);
}

#[test]
fn errors_agree_with_numpy() {
    let comparison = Comparison::new(&plain()).unwrap();
    let ratios = [1.004_738_474, 1.001_471_427, 0.999_877_936];
    for (ratio, expected) in comparison.mean_ratio.into_iter().zip(ratios) {
        near(ratio, expected, 1e-8);
    }
    near(comparison.full().rmse, 0.057_298_012_46, 1e-10);
    near(comparison.full().rel_mse, 0.034_763_481_87, 1e-10);
    near(comparison.full().rel_mse_trimmed, 0.034_627_165_12, 1e-10);
    for (factor, rel_mse, rmse) in [
        (2, 0.019_198_643_91, 0.050_485_386_20),
        (4, 0.013_249_288_06, 0.044_771_480_42),
        (8, 0.011_740_553_72, 0.042_667_985_30),
    ] {
        // Boxes are kept in single precision.
        let errors = comparison.reduced(factor).unwrap();
        near(errors.rel_mse, rel_mse, 1e-8);
        near(errors.rmse, rmse, 1e-8);
    }
    assert_eq!((comparison.ratio_uncertainty, comparison.full().noise), (None, None));
}

#[test]
fn equal_pictures_differ_by_nothing() {
    let mut pair = plain();
    pair.test = pair.reference.clone();
    let comparison = Comparison::new(&pair).unwrap();
    assert_eq!(comparison.mean_ratio, [1.0; 3]);
    assert_eq!((comparison.full().rmse, comparison.full().rel_mse, comparison.flip_ldr), (0.0, 0.0, 0.0));
    assert_eq!(comparison.flip_hdr, Some(0.0));
    near(comparison.ssim.unwrap(), 1.0, 1e-12);
}

#[test]
fn black_against_white_is_the_end_of_the_scale() {
    let white = image(32, 32, |_, _| [1.0; 3]);
    let black = image(32, 32, |_, _| [0.0; 3]);
    let comparison = Comparison::new(&Pair::new(&white, &black).unwrap()).unwrap();
    // flip-evaluator again; not 1, for the largest difference on a screen is that of green and blue.
    near(comparison.flip_ldr, 0.967_395, 1e-5);
    assert_eq!(comparison.flip_hdr, None);
    assert!(comparison.mean_ratio.iter().all(|r| !r.is_finite()));
    near(comparison.full().rel_mse, 1.0 / EPSILON, 1e-9);
    let same = Comparison::new(&Pair::new(&black, &black).unwrap()).unwrap();
    assert_eq!((same.mean_ratio, same.full().rel_mse), ([1.0; 3], 0.0));
}

#[test]
fn pixels_that_are_not_finite_are_counted_and_left_out() {
    let test = image(24, 24, |x, y| if (x, y) == (3, 4) { [f32::NAN, 1.0, 1.0] } else { [1.0; 3] });
    let reference = image(24, 24, |x, y| if x == 9 { [f32::INFINITY; 3] } else { [if y < 12 { 1.0 } else { 2.0 }; 3] });
    let pair = Pair::new(&test, &reference).unwrap();
    assert_eq!((pair.non_finite, pair.count()), ([1, 24], 24 * 24 - 25));
    let mut upper = pair.clone();
    upper.restrict(&(0..24 * 24).map(|i| i < 24 * 12).collect::<Vec<bool>>());
    let comparison = Comparison::new(&upper).unwrap();
    assert_eq!(comparison.pixels, [24 * 24, 24 * 12 - 13]);
    assert_eq!((comparison.mean_ratio, comparison.full().rmse), ([1.0; 3], 0.0), "the lower half is masked");
    let lower = Comparison::new(&pair).unwrap();
    assert!(lower.full().rmse > 0.5 && lower.flip_ldr.is_finite() && lower.ssim.unwrap().is_finite());
    upper.restrict(&[false; 24 * 24]);
    assert_eq!(Comparison::new(&upper), None);
}

#[test]
fn boxes_average_what_counts() {
    let picture = image(7, 5, |x, y| [(x + 10 * y) as f32, 0.0, 1.0]);
    let mut pair = Pair::new(&picture, &picture).unwrap();
    pair.counted[1] = false;
    pair.variance = Some(vec![[0.5; 3]; 35]);
    let half = pair.downsampled(2).unwrap();
    assert_eq!((half.width, half.height(), half.count()), (3, 2, 6), "rests of boxes are dropped");
    assert_eq!(half.test[0], [(10.0 + 11.0) / 3.0, 0.0, 1.0]);
    assert_eq!(half.test[1], [(2.0 + 3.0 + 12.0 + 13.0) / 4.0, 0.0, 1.0]);
    assert_eq!([half.variance.as_ref().unwrap()[0][0], half.variance.as_ref().unwrap()[1][0]], [0.5 / 3.0, 0.5 / 4.0]);
    pair.counted[0] = false;
    pair.counted[7] = false;
    assert!(!pair.downsampled(2).unwrap().counted[0], "one of four pixels is less than half");
    assert_eq!(pair.downsampled(8), None);
}

#[test]
fn noise_is_told_from_difference() {
    // Sums of twelve even numbers have variance one and are nearly normal.
    let normal = |i: usize| (0..12).map(|k| noise((12 * i + k) as u32)).sum::<f64>() - 6.0;
    let noisy = |gain: f64, first: usize| {
        let mut out = image(64, 64, |_, _| [0.0; 3]);
        for k in 0..3 {
            let samples = (0..64 * 64).map(|i| (gain * (1.0 + 0.1 * normal(first + 3 * i + k))) as f32);
            out.channels[k].samples = samples.collect();
        }
        for name in ["variance.R", "variance.G", "variance.B"] {
            let samples = vec![(0.01 * gain * gain) as f32; 64 * 64];
            out.channels.push(Channel { name: name.to_owned(), samples });
        }
        out
    };
    let (a, b, brighter) = (noisy(1.0, 0), noisy(1.0, 1_000_000), noisy(1.05, 2_000_000));
    let same = Comparison::new(&Pair::new(&a, &b).unwrap()).unwrap();
    for errors in &same.errors {
        let found = errors.noise.unwrap();
        // Of 192 to 12288 values of z.
        let tolerance = 4.0 / (2.0 * 3.0 * errors.count as f64).sqrt();
        near(found.z_rms, 1.0, tolerance);
        near(found.within[0], 0.683, 2.0 * tolerance);
        near(found.within[2], 0.997, tolerance);
        near(errors.rel_mse / found.rel_mse, 1.0, 3.0 * tolerance);
    }
    let uncertainty = same.ratio_uncertainty.unwrap();
    // 1.96 sqrt(2 x 0.01 / 4096)
    near(uncertainty[1], 0.004_33, 5e-5);
    assert!((0..3).all(|k| (same.mean_ratio[k] - 1.0).abs() < 2.0 * uncertainty[k]));
    let other = Comparison::new(&Pair::new(&brighter, &b).unwrap()).unwrap();
    assert!((0..3).all(|k| (other.mean_ratio[k] - 1.0).abs() > 5.0 * uncertainty[k]));
    assert!(other.reduced(8).unwrap().noise.unwrap().z_rms > 2.0);
}

#[test]
fn pictures_that_do_not_match_are_refused() {
    let small = image(4, 3, |_, _| [1.0; 3]);
    let large = image(4, 4, |_, _| [1.0; 3]);
    let message = |a: &Image, b: &Image| Pair::new(a, b).unwrap_err().to_string();
    assert_eq!(message(&small, &large), "their sizes differ: 4 x 3 and 4 x 4 pixels");
    let moved = Image { origin: [2, 0], ..small.clone() };
    assert_eq!(
        message(&moved, &small),
        "they are different parts of the frame: one begins at pixel 2,0, the other at 0,0"
    );
    let mut depth = Image::new(4, 3);
    for name in ["Z", "id"] {
        depth.channels.push(Channel { name: name.to_owned(), samples: vec![0.0; 12] });
    }
    assert_eq!(message(&small, &depth), "the second has no colours; its channels are Z, id");
}
