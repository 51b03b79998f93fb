//! The gaps between the fibres of a ply: how much light passes them, and how far it gets (docs/model.md, section 3).

use super::ply::PlyShape;

/// The gaps between the fibres of a ply, along a line and counted in expected fibres.
///
/// Fibres on a line are a renewal process: gaps of a dead zone d and an exponential beyond it. The chance that a stretch
/// with n fibres on the mean holds none is 1 - n up to n = d, then (1 - d) e^(-(n - d) / (1 - d)).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlyGaps {
    /// d, of fibres that keep out of each other.
    pub dead_zone: f32,
    /// Extinction per expected fibre of unscattered light beyond the first d fibres: 1 / (1 - d).
    pub rate: f32,
}

impl PlyShape {
    /// Area fraction eta of fibres that keep out of each other, at most 0.85; 0 for fibres that lie at random.
    pub fn density(&self) -> f64 {
        if self.regularity == 0.0 {
            return 0.0;
        }
        let (n, radius, fiber) = (f64::from(self.fibers), f64::from(self.radius), f64::from(self.fiber_radius));
        (n * fiber * fiber / (radius * radius)).min(0.85)
    }

    /// The dead zone after each fibre of a line that finds as much of itself inside fibres as the ply has area in them, in expected
    /// fibres; at most 0.85.
    pub fn mean_dead_zone(&self) -> f64 {
        (f64::from(self.regularity) * self.density()).min(0.85)
    }
}

impl PlyGaps {
    /// With a dead zone below one.
    #[inline]
    pub fn new(dead_zone: f32) -> Self {
        Self { dead_zone, rate: 1.0 / (1.0 - dead_zone) }
    }

    /// The share of light that passes a chord with so many expected `fibers` and meets none.
    #[inline]
    pub fn unscattered(&self, fibers: f32) -> f32 {
        if fibers < self.dead_zone {
            1.0 - fibers
        } else {
            (1.0 - self.dead_zone) * (-self.rate * (fibers - self.dead_zone)).exp()
        }
    }

    /// The inverse of [`Self::unscattered`]: after how many expected fibres the share `passed` is left.
    #[inline]
    pub fn fibers_passed(&self, passed: f32) -> f32 {
        let open = 1.0 - self.dead_zone;
        if passed > open { 1.0 - passed } else { self.dead_zone - (passed / open).max(1e-30).ln() * open }
    }

    /// Of light that meets another fibre after one and within so many expected `fibers`: after how many the share `met` has met it.
    #[inline]
    pub fn fibers_to_next(&self, fibers: f32, met: f32) -> f32 {
        let within = fibers - self.dead_zone;
        if within <= 0.0 {
            return met * fibers;
        }
        let left = 1.0 - met * -(-self.rate * within).exp_m1();
        (self.dead_zone - left.max(1e-30).ln() / self.rate).min(fibers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_meets_no_fiber_falls_evenly_and_is_inverted() {
        for density in [1e-4, 0.1, 0.5, 0.8] {
            let gaps = PlyGaps::new(density);
            assert_eq!(gaps.unscattered(0.0), 1.0);
            let mut before = 1.0;
            for i in 1..400 {
                let n = 0.01 * i as f32;
                let passed = gaps.unscattered(n);
                // No jump in value or slope: the share falls by what is left at most over 1 - eta.
                assert!(passed < before && before - passed < 0.0101, "density {density}, {n} fibres");
                assert!((gaps.fibers_passed(passed) - n).abs() < 1e-3, "density {density}, {n} fibres");
                before = passed;
            }
        }
    }

    #[test]
    fn from_one_fiber_to_the_next_one_is_expected_on_the_mean() {
        for density in [0.0, 0.2, 0.5, 0.7] {
            let gaps = PlyGaps::new(density);
            let mean = |fibers: f32| {
                let drawn = (0..4000).map(|i| gaps.fibers_to_next(fibers, (i as f32 + 0.5) / 4000.0));
                drawn.inspect(|n| assert!((0.0..=fibers).contains(n))).sum::<f32>() / 4000.0
            };
            assert!((mean(1e3) - 1.0).abs() < 2e-3, "density {density}: {}", mean(1e3));
            assert!(mean(1.0) < 1.0 && mean(0.1) <= 0.1 && mean(0.0) == 0.0);
        }
    }
}
