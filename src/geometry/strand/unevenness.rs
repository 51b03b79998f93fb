//! How the thickness of spun yarn changes along it.
//!
//! Spun yarn has thin and thick places of any length. Here the logarithm of its thickness is noise of equal strength in octaves
//! of wavelengths: cubic B-splines of normal deviates. The noise is laid by the curve's own points and not by length, so that it stays
//! where it is on a yarn that moves and stretches.

use glam::{DVec3, Vec3};

use crate::{
    geometry::{curve::Curve, spline::bspline_weights},
    math::{
        sampler::{Stream, hash2},
        warp::normal,
    },
};

/// Wavelengths between which thickness changes, in yarn radii: from two diameters, below which a yarn looks knotted, to
/// more than a piece of some stitches shows.
const WAVELENGTHS: [f64; 2] = [4.0, 128.0];

/// Mean variance of a cubic B-spline of independent deviates of variance 1: the integral of its four weights squared.
const SPLINE_VARIANCE: f64 = 151.0 / 315.0;

/// The deviates are cut here, so that no yarn breaks.
const MOST_DEVIATIONS: f64 = 2.5;

/// How uneven a yarn is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unevenness {
    /// Standard deviation of the radius along the yarn, relative to it.
    pub spread: f64,
    /// Start of what is random.
    pub seed: u32,
}

impl Unevenness {
    /// The sections of yarn number `yarn` with thin and thick places; `rest` has its points where it is at rest. Where a section
    /// is pressed flat its short axis stays, for that is the room between the yarns that press it, and it becomes
    /// narrower or wider.
    pub(super) fn of(self, yarn: usize, curve: &Curve, radii: &[f64], rest: &[DVec3]) -> Sections {
        let factors = self.factors(yarn, curve, radii, rest);
        let Some(axes) = &curve.flattening else {
            return Sections { radii: radii.iter().zip(&factors).map(|(r, f)| r * f).collect(), flattening: None };
        };
        let (radii, axes) =
            radii.iter().zip(axes).zip(&factors).map(|((r, axis), f)| pressed(*r, *axis, f * f)).unzip();
        Sections { radii, flattening: Some(axes) }
    }

    /// Radius over mean radius at each point of a curve.
    fn factors(self, yarn: usize, curve: &Curve, radii: &[f64], rest: &[DVec3]) -> Vec<f64> {
        let count = radii.len();
        let mean = radii.iter().sum::<f64>() / count.max(1) as f64;
        let length: f64 = rest.windows(2).map(|w| w[0].distance(w[1])).sum();
        let step = length / (count.max(2) - 1) as f64 / mean;
        let octaves = octaves(step);
        let strength: f64 = octaves.iter().map(|o| o.amplitude * o.amplitude).sum();
        if strength.is_nan() || strength <= 0.0 {
            return vec![1.0; count];
        }
        let scale = self.spread / (strength * SPLINE_VARIANCE).sqrt();
        let key = hash2(self.seed ^ 0x0e7e_a5ed, yarn as u32);
        let noises: Vec<Noise> =
            octaves.iter().map(|o| Noise::new(o, hash2(key, o.level), count, curve.closed)).collect();
        let most = MOST_DEVIATIONS * self.spread;
        let logarithm = |i: usize| noises.iter().map(|n| n.at(i)).sum::<f64>() * scale;
        (0..count).map(|i| logarithm(i).clamp(-most, most).exp()).collect()
    }
}

/// Sections along a yarn.
pub(super) struct Sections {
    /// Half of their long axes.
    pub(super) radii: Vec<f64>,
    /// As [`Curve::flattening`].
    pub(super) flattening: Option<Vec<Vec3>>,
}

/// Radius and flattening of a section `area` times as large and as high as before; round where it would be narrower than high.
fn pressed(radius: f64, axis: Vec3, area: f64) -> (f64, Vec3) {
    let ratio = axis.length();
    let round = || (radius * (area * f64::from(ratio)).sqrt(), axis / ratio);
    if f64::from(ratio) < area { (radius * area, axis / area as f32) } else { round() }
}

/// Noise whose deviates are `2^level` points apart.
#[derive(Debug)]
struct Octave {
    level: u32,
    /// Its share of the deviation, not normalised.
    amplitude: f64,
}

/// The octaves of points that are `step` radii apart. Those at either end fade out, so that thickness is continuous in the
/// step.
fn octaves(step: f64) -> Vec<Octave> {
    // A wave is two deviates long, and its spline needs some points.
    let of = |level: u32| {
        let wavelength = 2.0 * f64::from(1u32 << level) * step;
        let inside = (wavelength / WAVELENGTHS[0]).log2().min((WAVELENGTHS[1] / wavelength).log2());
        Octave { level, amplitude: (inside + 0.5).clamp(0.0, 1.0) }
    };
    (1..20).map(of).filter(|o| o.amplitude > 0.0).collect()
}

/// One octave along one curve.
struct Noise {
    deviates: Vec<f64>,
    /// Points from one deviate to the next.
    spacing: f64,
    amplitude: f64,
}

impl Noise {
    fn new(octave: &Octave, key: u32, count: usize, closed: bool) -> Self {
        let nominal = f64::from(1u32 << octave.level);
        let deviate = |k: usize| f64::from(normal(Stream::new(hash2(key, k as u32)).next()));
        let amplitude = octave.amplitude;
        if closed {
            // A whole number of deviates, and the first ones again.
            let around = (count as f64 / nominal).round().max(1.0) as usize;
            let deviates = (0..around + 3).map(|k| deviate(k % around)).collect();
            return Self { deviates, spacing: count as f64 / around as f64, amplitude };
        }
        let deviates = (0..(count as f64 / nominal) as usize + 4).map(deviate).collect();
        Self { deviates, spacing: nominal, amplitude }
    }

    fn at(&self, point: usize) -> f64 {
        let place = point as f64 / self.spacing;
        let (cell, t) = (place as usize, place.fract());
        let near = &self.deviates[cell..cell + 4];
        self.amplitude * near.iter().zip(bspline_weights(t)).map(|(d, w)| d * w).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{geometry::curve::Basis, math::stats::Estimate};

    const SPREAD: f64 = 0.06;

    fn line(count: usize, step: f64, closed: bool, flattening: Option<Vec3>) -> Curve {
        let points = (0..count).map(|i| i as f64 * step * DVec3::X).collect();
        let flattening = flattening.map(|axis| vec![axis; count]);
        Curve { basis: Basis::CatmullRom, closed, points, radii: None, flattening }
    }

    fn sections(curve: &Curve, yarn: usize) -> Sections {
        Unevenness { spread: SPREAD, seed: 3 }.of(yarn, curve, &vec![1.0; curve.points.len()], &curve.points)
    }

    fn estimate(values: &[f64]) -> Estimate {
        Estimate::of(values).expect("some values")
    }

    #[test]
    fn radii_have_the_spread_that_is_asked_for_whatever_the_points() {
        for step in [0.3, 0.7, 1.35, 2.5] {
            let curve = line(20_000, step, false, None);
            let radii = sections(&curve, 0).radii;
            let (mean, deviation) = (estimate(&radii).mean, estimate(&radii).deviation.unwrap());
            assert!((mean - 1.0).abs() < 0.01 && (deviation / SPREAD - 1.0).abs() < 0.1, "{step}: {mean} {deviation}");
            // Smooth within a radius, and without memory over many wavelengths.
            let apart = |radii: &[f64], steps: usize| {
                let differences: Vec<f64> = radii.windows(steps + 1).map(|w| w[steps] - w[0]).collect();
                estimate(&differences).deviation.unwrap() / SPREAD
            };
            let [near, far] = [1.0, 400.0].map(|radii_apart: f64| apart(&radii, (radii_apart / step).ceil() as usize));
            assert!(near < 0.35 * f64::max(step, 1.0) && (far / 2f64.sqrt() - 1.0).abs() < 0.1, "{step}: {near} {far}");
        }
    }

    #[test]
    fn yarns_differ_and_stay_as_they_are_where_they_stretch() {
        let of = |step: f64, yarn: usize| sections(&line(500, step, false, None), yarn).radii;
        let largest = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert_eq!(of(1.35, 0), of(1.35, 0));
        assert!(largest(&of(1.35, 0), &of(1.35, 1)) > 2.0 * SPREAD);
        for step in [1.0, 1.35, 1.9, 2.7] {
            let change = largest(&of(step, 0), &of(1.02 * step, 0));
            assert!(change < 0.1 * SPREAD, "{step}: {change}");
        }
    }

    #[test]
    fn closed_yarns_close() {
        let radii = sections(&line(333, 1.35, true, None), 0).radii;
        let step = |i: usize| radii[(i + 1) % radii.len()] - radii[i];
        let most = (0..332).map(|i| step(i).abs()).fold(0.0, f64::max);
        assert!(step(332).abs() <= most && (step(332) - step(331)).abs() < most, "{} of {most}", step(332));
    }

    #[test]
    fn pressed_yarns_keep_their_height_and_no_section_is_higher_than_wide() {
        let (ratio, area) = (0.6, |r: f64, axis: Vec3| r * r * f64::from(axis.length()));
        let round = sections(&line(500, 1.35, false, None), 0).radii;
        let Sections { radii, flattening } = sections(&line(500, 1.35, false, Some(ratio as f32 * Vec3::Z)), 0);
        for ((r, axis), round) in radii.iter().zip(flattening.expect("flat sections")).zip(&round) {
            assert!((r * f64::from(axis.length()) - ratio).abs() < 1e-6, "{r} {axis}");
            assert!((area(*r, axis) / (ratio * round * round) - 1.0).abs() < 1e-6);
        }
        // Nearly round, the thin places become round and the area stays.
        let Sections { radii, flattening } = sections(&line(500, 1.35, false, Some(0.98 * Vec3::Z)), 0);
        for ((r, axis), round) in radii.iter().zip(flattening.expect("flat sections")).zip(&round) {
            assert!(axis.length() <= 1.0 + 1e-6);
            assert!((area(*r, axis) / (0.98 * round * round) - 1.0).abs() < 1e-6);
        }
    }
}
