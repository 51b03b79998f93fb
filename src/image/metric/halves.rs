//! Pictures that are known twice, from independent samples: errors against what they converge to, without their noise.
//!
//! Let R1 and R2 be independent pictures of the expected value R, and I another picture. Then (I - R1)(I - R2) has the
//! expected value (I - R)^2: the reference's own variance, which (I - R1)^2 would contain, is gone. The same as
//! subtracting from the square error against the mean of R1 and R2 its variance (R1 - R2)^2 / 4; and it holds for stratified
//! samples, whose variance the sample variance overstates. (Relative errors divide by the square of the noisy mean, which leaves a bias
//! of the order of the reference's own relative variance over the relative error that is measured.)

use super::EPSILON;

/// Two independent pictures of the same thing, with the same number of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Halves {
    /// Pixels in a row.
    pub width: usize,
    /// Linear colours of both, the top row first.
    pub colors: [Vec<[f32; 3]>; 2],
    /// Mean coverage of both.
    pub alpha: Vec<f32>,
}

impl Halves {
    /// Pixels that cloth covers by half or more: those of whole yarns, for metrics of a picture that is seen.
    pub fn mostly_covered(&self) -> Vec<bool> {
        self.alpha.iter().map(|alpha| *alpha >= 0.5).collect()
    }

    /// Pixels that cloth covers at all, for light that is summed: of half-covered ones alone, methods would be told apart by
    /// which of them have a little more of their yarns' edges.
    pub fn partly_covered(&self) -> Vec<bool> {
        self.alpha.iter().map(|alpha| *alpha > 0.0).collect()
    }

    /// The mean of both.
    pub fn mean(&self) -> Vec<[f32; 3]> {
        let [a, b] = &self.colors;
        a.iter().zip(b).map(|(a, b)| std::array::from_fn(|k| 0.5 * (a[k] + b[k]))).collect()
    }

    /// The variance of [`Self::mean`], estimated from the difference of the two: right on average, at each pixel vague.
    pub fn variance(&self) -> Vec<[f32; 3]> {
        let [a, b] = &self.colors;
        a.iter().zip(b).map(|(a, b)| std::array::from_fn(|k| 0.25 * (a[k] - b[k]).powi(2))).collect()
    }

    /// relMSE of one half, from the difference of the two: what its samples leave, stratified as they are.
    pub fn half_rel_mse(&self) -> f64 {
        let (mean, variance) = (self.mean(), self.variance());
        let channels = mean.as_flattened().iter().zip(variance.as_flattened());
        // The mean of two varies half as much as each.
        let relative = channels.map(|(m, v)| 2.0 * f64::from(*v) / (f64::from(*m).powi(2) + EPSILON));
        relative.sum::<f64>() / (3 * mean.len()) as f64
    }

    /// relMSE of a picture against what the halves converge to, over all pixels. May be slightly negative where there is
    /// no error.
    pub fn rel_mse(&self, picture: &[[f32; 3]]) -> f64 {
        product([picture, picture], [&self.colors[0], &self.colors[1]], |_| true)
    }

    /// relMSE between what two pictures converge to, after averaging boxes of `factor` pixels, over the boxes that are at
    /// least half counted; `None` where there is none.
    pub fn rel_mse_between(test: &Self, reference: &Self, counted: &[bool], factor: usize) -> Option<f64> {
        let reduce = |colors: &[[f32; 3]]| reduced(colors, counted, test.width, factor);
        let [a1, a2, r1, r2] =
            [&test.colors[0], &test.colors[1], &reference.colors[0], &reference.colors[1]].map(|c| reduce(c));
        let kept = a1.1;
        kept.contains(&true).then(|| product([&a1.0, &a2.0], [&r1.0, &r2.0], |i| kept[i]))
    }
}

/// Mean of (t1 - r1)(t2 - r2) / (r^2 + [`EPSILON`]) over channels and pixels, r the mean of r1 and r2.
fn product(test: [&[[f32; 3]]; 2], reference: [&[[f32; 3]]; 2], counted: impl Fn(usize) -> bool) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for i in (0..reference[0].len()).filter(|i| counted(*i)) {
        for k in 0..3 {
            let at = |picture: &[[f32; 3]]| f64::from(picture[i][k]);
            let [r1, r2] = reference.map(at);
            sum += (at(test[0]) - r1) * (at(test[1]) - r2) / ((0.5 * (r1 + r2)).powi(2) + EPSILON);
            count += 1.0;
        }
    }
    sum / count
}

/// Boxes averaged over the pixels that count, and which boxes are at least half counted.
fn reduced(colors: &[[f32; 3]], counted: &[bool], width: usize, factor: usize) -> (Vec<[f32; 3]>, Vec<bool>) {
    if factor == 1 {
        return (colors.to_vec(), counted.to_vec());
    }
    let boxes = super::Boxes::new(width, counted, factor);
    (boxes.mean(colors, 1), boxes.counted())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A number from 0 to 1 that looks random (splitmix64).
    fn noise(i: u32) -> f32 {
        let mut z = u64::from(i).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / 16_777_216.0
    }

    /// A picture of the truth 0.5 (0.55 in the right half for the other model) and normal noise.
    fn picture(seed: u32, deviation: f32, bright: bool) -> Vec<[f32; 3]> {
        (0..64 * 64_u32)
            .map(|i| {
                let level = if bright && i % 64 >= 32 { 0.55 } else { 0.5 };
                std::array::from_fn(|k| {
                    let sum: f32 = (0..12).map(|j| noise(seed + 36 * i + 12 * k as u32 + j)).sum();
                    level + deviation * (sum - 6.0)
                })
            })
            .collect()
    }

    fn halves(seed: u32, deviation: f32, bright: bool) -> Halves {
        let colors = [seed, seed + 7_000_000].map(|s| picture(s, deviation, bright));
        Halves { width: 64, colors, alpha: vec![1.0; 64 * 64] }
    }

    #[test]
    fn the_references_own_noise_does_not_count() {
        let reference = halves(1, 0.04, false);
        // The noise of the picture itself: 0.01 / (0.25 + 0.01).
        let found = reference.rel_mse(&picture(90_000_000, 0.1, false));
        assert!((found - 0.01 / 0.26).abs() < 0.1 * 0.01 / 0.26, "{found}");
        let half = reference.half_rel_mse();
        assert!((half - 0.0016 / 0.26).abs() < 0.1 * 0.0016 / 0.26, "{half}");
        let exact = reference.rel_mse(&vec![[0.5; 3]; 64 * 64]);
        assert!(exact.abs() < 3e-4, "a single half has 0.006: {exact}");
        let variance = reference.variance().as_flattened().iter().map(|v| f64::from(*v)).sum::<f64>() / 12288.0;
        assert!((variance - 0.0008).abs() < 4e-5, "of the mean: half of 0.0016, {variance}");
    }

    #[test]
    fn models_are_compared_without_noise() {
        let (test, reference) = (halves(30_000_000, 0.015, true), halves(1, 0.015, false));
        // Half of the pixels are 0.05 too bright.
        let expected = 0.5 * 0.0025 / 0.26;
        for factor in [1, 8] {
            let found = Halves::rel_mse_between(&test, &reference, &[true; 64 * 64], factor).unwrap();
            assert!((found - expected).abs() < 0.12 * expected, "{factor}: {found}, expected {expected}");
        }
        let left: Vec<bool> = (0..64 * 64).map(|i| i % 64 < 32).collect();
        let found = Halves::rel_mse_between(&test, &reference, &left, 8).unwrap();
        assert!(found.abs() < 0.1 * expected, "{found}");
        assert_eq!(Halves::rel_mse_between(&test, &reference, &[false; 64 * 64], 8), None);
    }
}
