//! Warps of the unit square.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use glam::{Vec2, Vec3A};

use super::frame::sin_cos;

/// A point of the unit disc, uniform in area (Shirley and Chiu's concentric map).
#[inline]
pub(crate) fn disc(u: Vec2) -> Vec2 {
    let p = 2.0 * u - Vec2::ONE;
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (radius, angle) =
        if p.x.abs() > p.y.abs() { (p.x, FRAC_PI_4 * (p.y / p.x)) } else { (p.y, FRAC_PI_2 - FRAC_PI_4 * (p.x / p.y)) };
    let (sin, cos) = sin_cos(angle);
    radius * Vec2::new(cos, sin)
}

/// A direction about +z with density cos(theta) / pi per steradian.
#[inline]
pub(crate) fn cosine_hemisphere(u: Vec2) -> Vec3A {
    let p = disc(u);
    Vec3A::new(p.x, p.y, (1.0 - p.length_squared()).max(0.0).sqrt())
}

/// A direction about +z, uniform in the cone of which `one_minus_cos` is 1 - cos of its half angle.
#[inline]
pub(crate) fn cone(u: Vec2, one_minus_cos: f32) -> Vec3A {
    let below = u.x * one_minus_cos;
    let sin_theta = (below * (2.0 - below)).max(0.0).sqrt();
    let (sin, cos) = sin_cos(TAU * u.y);
    Vec3A::new(sin_theta * cos, sin_theta * sin, 1.0 - below)
}

/// A standard normal deviate from one uniform number, to 1e-6 or so in the centre and finite at 0 and 1
/// (Giles, "Approximating the erfinv function", GPU Computing Gems 2011).
#[inline]
pub(crate) fn normal(u: f32) -> f32 {
    let x = (2.0 * u - 1.0).clamp(-0.999_999_9, 0.999_999_9);
    let w = -((1.0 - x) * (1.0 + x)).ln();
    let horner = |w: f32, c: [f32; 9]| c.iter().fold(0.0, |p, &c| p * w + c);
    let p = if w < 5.0 {
        horner(
            w - 2.5,
            [
                2.810_226_4e-8,
                3.432_739_4e-7,
                -3.523_387_7e-6,
                -4.391_506_5e-6,
                0.000_218_580_87,
                -0.001_253_725,
                -0.004_177_681_6,
                0.246_640_73,
                1.501_409_4,
            ],
        )
    } else {
        horner(
            w.sqrt() - 3.0,
            [
                -0.000_200_214_26,
                0.000_100_950_56,
                0.001_349_343_2,
                -0.003_673_428_4,
                0.005_739_507_7,
                -0.007_622_461_3,
                0.009_438_87,
                1.001_674,
                2.832_976_8,
            ],
        )
    };
    p * x * std::f32::consts::SQRT_2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_inverts_its_distribution_function() {
        for i in 1..9999 {
            let u = f64::from(i) / 1e4;
            let z = f64::from(normal(u as f32));
            let back = 0.5 * (1.0 + libm::erf(z / std::f64::consts::SQRT_2));
            assert!((back - u).abs() < 1e-6, "u = {u}: back {back}");
        }
        assert!(normal(0.0).is_finite() && normal(1.0).is_finite());
        assert_eq!(normal(0.5), 0.0);
    }

    #[test]
    fn discs_and_cones_are_uniform() {
        let n = 256;
        let (mut inner, mut cap) = (0, 0);
        for i in 0..n * n {
            let u = Vec2::new(((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32);
            inner += usize::from(disc(u).length_squared() < 0.25);
            let w = cone(u, 0.3);
            assert!((w.length() - 1.0).abs() < 1e-6 && w.z >= 0.7 - 1e-6);
            cap += usize::from(w.z > 0.85);
            assert!((cosine_hemisphere(u).length() - 1.0).abs() < 1e-6);
        }
        assert!((inner as f32 / (n * n) as f32 - 0.25).abs() < 2e-3);
        assert!((cap as f32 / (n * n) as f32 - 0.5).abs() < 4e-3);
    }
}
