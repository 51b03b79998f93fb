//! Surfaces of revolution about the y axis, given by a profile of radius and height.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, DVec4};

use crate::geometry::{curve::Basis, spline::evaluate};

/// A profile curve, walked by its length.
#[derive(Clone, Debug)]
pub struct Revolution {
    /// Radius and height, evenly spaced along the curve.
    samples: Vec<DVec2>,
    length: f64,
}

/// How many samples a profile has between two given points.
const STEPS: usize = 64;

impl Revolution {
    /// The surface whose profile goes smoothly (Catmull-Rom) through points of (radius, height); at least two, radii at
    /// least 0. Walking along the profile, the outside is to the right: upwards it is away from the axis.
    pub fn new(profile: &[DVec2]) -> Self {
        let n = profile.len();
        let at = |i: isize| {
            let last = n as isize - 1;
            let p = if i < 0 {
                2.0 * profile[0] - profile[1]
            } else if i > last {
                2.0 * profile[n - 1] - profile[n - 2]
            } else {
                profile[i as usize]
            };
            DVec4::new(p.x, p.y, 0.0, 0.0)
        };
        let mut fine = vec![profile[0]];
        for i in 0..n as isize - 1 {
            let p = [at(i - 1), at(i), at(i + 1), at(i + 2)];
            for step in 1..=STEPS {
                let q = evaluate(Basis::CatmullRom, p, step as f64 / STEPS as f64).at;
                fine.push(DVec2::new(q.x.max(0.0), q.y));
            }
        }
        let mut lengths = vec![0.0];
        for w in fine.windows(2) {
            lengths.push(lengths[lengths.len() - 1] + w[0].distance(w[1]));
        }
        let length = lengths[lengths.len() - 1];
        let count = fine.len();
        let samples = (0..count)
            .map(|i| {
                let s = length * i as f64 / (count - 1) as f64;
                let k = lengths.partition_point(|&l| l <= s).clamp(1, count - 1);
                let span = lengths[k] - lengths[k - 1];
                fine[k - 1].lerp(fine[k], if span > 0.0 { ((s - lengths[k - 1]) / span).min(1.0) } else { 0.0 })
            })
            .collect();
        Self { samples, length }
    }

    /// Length of the profile.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Radius and height at a place along the profile; before its start and beyond its end it goes straight on.
    fn profile(&self, along: f64) -> (DVec2, DVec2) {
        let last = self.samples.len() - 1;
        let x = along / self.length * last as f64;
        let i = (x.floor().max(0.0) as usize).min(last - 1);
        let (a, b) = (self.samples[i], self.samples[i + 1]);
        // The direction changes evenly between the middles of the pieces.
        let piece = |k: usize| (self.samples[k + 1] - self.samples[k]).normalize_or(DVec2::Y);
        let f = x - i as f64;
        let direction = if f < 0.5 {
            piece(i.saturating_sub(1)).lerp(piece(i), (f + 0.5).clamp(0.0, 1.0))
        } else {
            piece(i).lerp(piece((i + 1).min(last - 1)), (f - 0.5).clamp(0.0, 1.0))
        };
        (a + (b - a) * f, direction.normalize_or(DVec2::Y))
    }

    /// Radius at a place along the profile, at least a thousandth of its length.
    pub fn radius(&self, along: f64) -> f64 {
        self.profile(along).0.x.max(1e-3 * self.length)
    }

    /// The place at `turn` (1 is a full turn, counter-clockwise seen from above, from +z towards +x), so far along the profile and `out` off it.
    pub fn place(&self, turn: f64, along: f64, out: f64) -> DVec3 {
        let (at, direction) = self.profile(along);
        let (sin, cos) = (TAU * turn).sin_cos();
        let radius = at.x + out * direction.y;
        DVec3::new(radius * sin, at.y - out * direction.x, radius * cos)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tube_is_a_tube() {
        let tube = Revolution::new(&[DVec2::new(5.0, 0.0), DVec2::new(5.0, 20.0)]);
        assert!((tube.length() - 20.0).abs() < 1e-12);
        assert!(tube.place(0.0, 7.0, 1.0).distance(DVec3::new(0.0, 7.0, 6.0)) < 1e-9);
        assert!(tube.place(0.25, 7.0, 0.0).distance(DVec3::new(5.0, 7.0, 0.0)) < 1e-9);
        assert!(tube.place(0.5, -1.0, 0.0).distance(DVec3::new(0.0, -1.0, -5.0)) < 1e-9);
    }

    #[test]
    fn a_dome_is_walked_by_its_length_and_its_outside_is_outside() {
        let arc: Vec<DVec2> = (0..=16)
            .map(|i| f64::from(i) / 16.0 * TAU / 4.0)
            .map(|a| DVec2::new(10.0 * a.cos(), 10.0 * a.sin()))
            .collect();
        let dome = Revolution::new(&arc);
        assert!((dome.length() - 10.0 * TAU / 4.0).abs() < 0.02);
        for i in 0..20 {
            let along = dome.length() * (f64::from(i) + 0.5) / 20.0;
            assert!((dome.place(0.3, along, 0.0).length() - 10.0).abs() < 0.01);
            assert!((dome.place(0.3, along, 2.0).length() - 12.0).abs() < 0.01);
            let angle = along / 10.0;
            assert!((dome.place(0.1, along, 0.0).y - 10.0 * angle.sin()).abs() < 0.02);
        }
    }
}
