//! The longitudinal kernel: the von Mises-Fisher lobe on the sphere in four dimensions, seen along its latitude.
//!
//! M(theta_i, theta_o) = kappa / (pi I1(kappa)) exp(-kappa s_i s_o) sinh(kappa c_i c_o) / (kappa c_i c_o), kappa = 1 / (4 beta^2)
//!
//! It takes the place of the paper's g(beta; theta_h) / cos^2(theta_i) (Eq. 5), which neither conserves energy nor
//! is reciprocal. For small beta the two agree: a Gaussian in theta_h. The integral of M cos^2(theta_o) over theta_o
//! is 1 for every theta_i and beta, M is symmetric, and beta -> infinity gives the diffuse lobe, M = 2 / pi.

use std::f32::consts::{FRAC_2_PI, TAU};

use crate::math::{Rgb, frame::sin_cos, sampler::Stream, warp::normal};

/// kappa of a lobe whose longitudinal standard deviation in theta_h is `beta` radians.
#[inline]
pub(crate) fn kappa_of_variance(beta_squared: Rgb) -> Rgb {
    Rgb::splat(0.25) / beta_squared.max(Rgb::splat(MIN_VARIANCE))
}

/// -ln of the mean cosine, I2(kappa) / I1(kappa), by which the lobe whose longitudinal standard deviation in theta_h is `beta` radians turns on
/// the sphere in four dimensions. Of light that meets one such lobe after another the mean cosines multiply, and these add.
pub(crate) fn spread(beta: f64) -> f64 {
    let kappa = 0.25 / (beta * beta).max(f64::from(MIN_VARIANCE));
    if kappa > 300.0 {
        return -(-1.5 / kappa + 0.375 / (kappa * kappa)).ln_1p();
    }
    // I2 / I1, I3 / I2 and so on, from orders on that are far beyond kappa.
    let ratio = (2..400).rev().fold(0.0, |next, order| 1.0 / (2.0 * f64::from(order) / kappa + next));
    -ratio.ln()
}

/// [`spread`] of a narrow lobe, by its variance beta^2.
#[inline]
pub(crate) fn narrow_spread(variance: f32) -> f32 {
    6.0 * variance
}

/// kappa of the lobe of such a [`spread`]; relative error below 2e-3.
#[inline]
pub(crate) fn kappa_of_spread(spread: Rgb) -> Rgb {
    let spread = spread.max(Rgb::splat(narrow_spread(MIN_VARIANCE)));
    let (mean, less) = ((-spread).exp(), spread.one_minus_exp_neg());
    let square = mean * mean;
    // Banerjee et al., Clustering on the Unit Hypersphere using von Mises-Fisher Distributions, 2005, Eq. 4.4, and what that is off by.
    let near = mean * (Rgb::splat(4.0) - square) / (less * (mean + Rgb::ONE));
    near * (Rgb::ONE - square * mean * less * 0.351)
}

/// The narrowest lobe that single precision carries, as a variance: beta of about 1e-4 radians, which is a
/// hundredth of a pixel of any real camera.
pub(crate) const MIN_VARIANCE: f32 = 1e-8;

/// Above this kappa the normalisation follows its asymptote to 4e-6.
const KAPPA_ASYMPTOTIC: f32 = 1e5;

/// (pi / 2)^2 C(kappa)^2 = P / Q, fitted for 4e-6 over all kappa >= 0; C is the factor kappa / (pi I1(kappa) e^-kappa).
#[allow(clippy::excessive_precision, reason = "the digits of the fit")]
const P: [f32; 8] = [0.034_491_077, 0.053_869_43, 0.383_853_46, 0.899_761_1, 1.917_204_4, 2.669_632_8, 2.351_903, 1.0];
#[allow(clippy::excessive_precision, reason = "the digits of the fit")]
const Q: [f32; 5] = [0.021_957_702, 0.017_794_89, 0.218_347_29, 0.351_789_57, 1.0];

/// The sines and cosines of two latitudes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Latitudes {
    /// (c_i - c_o)^2 + (s_i + s_o)^2, which is 0 at the specular latitude.
    off_specular: f32,
    /// c_i c_o
    cosines: f32,
}

impl Latitudes {
    /// From the sine and cosine of each direction's latitude.
    #[inline]
    pub(crate) fn new(sin_i: f32, cos_i: f32, sin_o: f32, cos_o: f32) -> Self {
        let (c, s) = (cos_i - cos_o, sin_i + sin_o);
        Self { off_specular: c * c + s * s, cosines: cos_i * cos_o }
    }
}

/// M for three values of kappa at once, in 1/radian; relative error below 1e-5.
#[inline]
pub(crate) fn kernel(kappa: Rgb, at: Latitudes) -> Rgb {
    normalised_kernel(kappa, normalisation(kappa), at)
}

/// The factor of M that depends on kappa only: for lobes whose width never changes.
#[inline]
pub(crate) fn normalisation(kappa: Rgb) -> Rgb {
    let bounded = kappa.min(Rgb::splat(KAPPA_ASYMPTOTIC));
    let beyond = kappa / bounded.max(Rgb::splat(1e-30));
    let beyond = beyond.max(Rgb::ONE);
    let p = P[1..].iter().fold(Rgb::splat(P[0]), |sum, &c| sum * bounded + c);
    let q = Q[1..].iter().fold(Rgb::splat(Q[0]), |sum, &c| sum * bounded + c);
    (p / q).sqrt() * FRAC_2_PI * beyond * beyond.sqrt()
}

/// [`kernel`] with [`normalisation`] of the same kappa at hand.
#[inline]
pub(crate) fn normalised_kernel(kappa: Rgb, normalisation: Rgb, at: Latitudes) -> Rgb {
    let x = kappa * (2.0 * at.cosines);
    // (1 - e^-2x) / 2x
    let spread = x.select_below(1e-6, Rgb::ONE, x.one_minus_exp_neg() / x.max(Rgb::splat(1e-30)));
    normalisation * (kappa * (-0.5 * at.off_specular)).exp() * spread
}

/// M for one kappa.
#[inline]
pub(crate) fn kernel_scalar(kappa: f32, at: Latitudes) -> f32 {
    kernel(Rgb::splat(kappa), at).to_array()[0]
}

/// The diffuse lobe's M, in 1/radian: the limit of [`kernel`] for kappa -> 0.
pub(crate) const DIFFUSE: f32 = FRAC_2_PI;

/// Draws sin(theta_o) with density M cos^2(theta_o) per radian of theta_o.
///
/// `u` drives the first try and where it falls along the lobe; `stream` serves further tries.
#[inline]
pub(crate) fn sample_sine(kappa: f32, sin_i: f32, cos_i: f32, u: [f32; 2], stream: &mut Stream) -> f32 {
    let w = sample_polar_cosine(kappa, u[0], stream);
    let across = (1.0 - w * w).max(0.0).sqrt() * (2.0 * u[1] - 1.0);
    (across * cos_i - w * sin_i).clamp(-1.0, 1.0)
}

/// Draws sin(theta_o) with density (2/pi) cos^2(theta_o): the latitude of a point uniform on the 3-sphere.
#[inline]
pub(crate) fn sample_sine_diffuse(u: [f32; 2]) -> f32 {
    u[0].sqrt() * sin_cos(TAU * u[1]).1
}

/// The cosine between a von Mises-Fisher direction in four dimensions and its mean: density sqrt(1-w^2) e^(kappa w).
#[inline]
fn sample_polar_cosine(kappa: f32, u: f32, stream: &mut Stream) -> f32 {
    let mut first = Some(u);
    // Acceptance is above one half for every kappa; the bound only guards the loop.
    for _ in 0..1000 {
        let a = first.take().unwrap_or_else(|| stream.next());
        if kappa < 0.7 {
            let w = sample_sine_diffuse([a, stream.next()]);
            if stream.next() < (kappa * (w - 1.0)).exp() {
                return w;
            }
        } else {
            // u = 1 - w is nearly a Gamma(3/2) variate: an exponential plus half the square of a normal one.
            let z = normal(stream.next());
            let below = (0.5 * z * z - (1.0 - a).max(1e-30).ln()) / kappa;
            let keep = stream.next();
            if below < 2.0 && keep * keep < 1.0 - 0.5 * below {
                return 1.0 - below;
            }
        }
    }
    1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads_are_those_of_their_lobes() {
        for i in 0..200 {
            let beta = 10f64.powf(-3.9 + 0.025 * f64::from(i));
            let kappa = 0.25 / (beta * beta);
            let [found, ..] = kappa_of_spread(Rgb::splat(spread(beta) as f32)).to_array();
            assert!((f64::from(found) / kappa - 1.0).abs() < 2e-3, "{beta}: {found}, not {kappa}");
        }
        // The mean cosine of a lobe is that of the latitudes that it sends light to from the equator: of cos(theta) cos(phi) on the sphere.
        let kappa = 0.25 / 0.3f64.powi(2);
        let (mut mean, mut sum) = (0.0, 0.0);
        for i in 0..20_000 {
            let w = -1.0 + 2.0 * (f64::from(i) + 0.5) / 20_000.0;
            let share = (1.0 - w * w).sqrt() * (kappa * (w - 1.0)).exp();
            (mean, sum) = (mean + w * share, sum + share);
        }
        assert!((-(mean / sum).ln() / spread(0.3) - 1.0).abs() < 1e-5, "{}", mean / sum);
    }
    use crate::math::special::bessel_i1_scaled;

    fn exact(kappa: f64, ti: f64, to: f64) -> f64 {
        let (si, ci, so, co) = (ti.sin(), ti.cos(), to.sin(), to.cos());
        let x = kappa * ci * co;
        let spread = if x < 1e-9 { 1.0 - x } else { -(-2.0 * x).exp_m1() / (2.0 * x) };
        let e = -0.5 * kappa * ((ci - co).powi(2) + (si + so).powi(2));
        kappa / (std::f64::consts::PI * bessel_i1_scaled(kappa)) * e.exp() * spread
    }

    fn latitudes(ti: f64, to: f64) -> Latitudes {
        Latitudes::new(ti.sin() as f32, ti.cos() as f32, to.sin() as f32, to.cos() as f32)
    }

    #[test]
    fn single_precision_agrees_with_the_definition() {
        for i in 0..60 {
            let beta = 10f64.powf(-3.0 + f64::from(i) * 0.08);
            let kappa = 0.25 / (beta * beta);
            for j in 0..40 {
                let ti = -1.5 + 3.0 * f64::from(j) / 39.0;
                // Close to the peak: far from it single-precision sines carry no more digits of the exponent.
                for k in -3..=3 {
                    let to = (-ti + f64::from(k) * beta).clamp(-1.57, 1.57);
                    let want = exact(f64::from(kappa as f32), ti, to);
                    let got = f64::from(kernel_scalar(kappa as f32, latitudes(ti, to)));
                    let slack = 1e-5 + kappa * 3e-7 * (ti + to).abs() + 1e-13 * kappa;
                    assert!((got / want - 1.0).abs() < slack, "beta {beta} ti {ti} to {to}: {got} {want}");
                }
            }
        }
    }

    #[test]
    fn the_kernel_is_normalised_symmetric_and_diffuse_in_its_limit() {
        for beta in [1e-3, 0.02, 0.15, 0.5, 1.0, 3.0, 30.0, 1e4] {
            let kappa = 0.25 / (beta * beta);
            for ti in [0.0, 0.5, 1.2, -1.4, 1.55] {
                let n = 400_000;
                let mut sum = 0.0;
                for i in 0..n {
                    let to = (f64::from(i) + 0.5) / f64::from(n) * std::f64::consts::PI - std::f64::consts::FRAC_PI_2;
                    sum += f64::from(kernel_scalar(kappa as f32, latitudes(ti, to))) * to.cos().powi(2);
                }
                sum *= std::f64::consts::PI / f64::from(n);
                assert!((sum - 1.0).abs() < 2e-4, "beta {beta} theta {ti}: {sum}");
            }
            let (a, b) =
                (kernel_scalar(kappa as f32, latitudes(0.7, -0.4)), kernel_scalar(kappa as f32, latitudes(-0.4, 0.7)));
            assert_eq!(a, b, "reciprocity at beta {beta}");
        }
        assert!((kernel_scalar(0.0, latitudes(0.3, 1.0)) - DIFFUSE).abs() < 1e-6);
    }

    #[test]
    fn extreme_widths_stay_finite() {
        for kappa in [0.0, 1e-30, 1e-6, 1.0, 1e5, 1.0001e5, 1e7, 2.5e7, 1e12, 1e20] {
            for ti in [0.0, 1.0, std::f64::consts::FRAC_PI_2] {
                for to in [-ti, 0.2, std::f64::consts::FRAC_PI_2] {
                    let m = kernel_scalar(kappa, latitudes(ti, to));
                    assert!(m.is_finite() && m >= 0.0, "kappa {kappa} ti {ti} to {to}: {m}");
                }
            }
        }
    }

    #[test]
    fn samples_follow_the_density() {
        // Chi-square over 40 bins of equal expected count in sin(theta), each width and latitude; bound at about 4 sigma.
        for (case, (beta, ti)) in [
            (0.02f64, 0.3f64),
            (0.15, 0.0),
            (0.15, 1.2),
            (0.5, -0.8),
            (0.59, 0.4),
            (0.61, 0.4),
            (2.0, 1.5),
            (0.15, 1.56),
        ]
        .into_iter()
        .enumerate()
        {
            let kappa = 0.25 / (beta * beta);
            let (si, ci) = (ti.sin() as f32, ti.cos() as f32);
            let bins = 40;
            let fine = 40_000;
            let mut cumulative = Vec::with_capacity(fine + 1);
            let mut sum = 0.0;
            cumulative.push(0.0);
            for i in 0..fine {
                let to = (i as f64 + 0.5) / fine as f64 * std::f64::consts::PI - std::f64::consts::FRAC_PI_2;
                sum += exact(kappa, ti, to) * to.cos().powi(2);
                cumulative.push(sum);
            }
            let mut stream = Stream::new(case as u32);
            let n = 100_000;
            let mut counts = vec![0u32; bins];
            for _ in 0..n {
                let u = [stream.next(), stream.next()];
                let so = sample_sine(kappa as f32, si, ci, u, &mut stream);
                let to = f64::from(so).asin();
                let place = ((to / std::f64::consts::PI + 0.5) * fine as f64).clamp(0.0, fine as f64 - 1e-6);
                let (i, t) = (place as usize, place.fract());
                let share = (cumulative[i] * (1.0 - t) + cumulative[i + 1] * t) / sum;
                counts[((share * bins as f64) as usize).min(bins - 1)] += 1;
            }
            let want = f64::from(n) / bins as f64;
            let chi2: f64 = counts.iter().map(|&c| (f64::from(c) - want).powi(2) / want).sum();
            assert!(chi2 < 39.0 + 4.0 * (2.0f64 * 39.0).sqrt(), "beta {beta} theta {ti}: chi2 {chi2} {counts:?}");
        }
    }
}
