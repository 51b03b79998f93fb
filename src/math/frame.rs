//! Orthonormal frames and small-angle helpers.

use glam::Vec3A;

/// Two unit vectors that complete a unit vector to a right-handed frame.
///
/// Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017: no branch, no singular direction.
#[inline]
pub(crate) fn orthonormal_basis(n: Vec3A) -> (Vec3A, Vec3A) {
    let sign = 1f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vec3A::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3A::new(b, sign + n.y * n.y * a, -n.y))
}

/// Sine and cosine of any finite angle in radians, to 2e-7 for |x| < 100; several times as fast as the library's.
#[inline]
pub(crate) fn sin_cos(x: f32) -> (f32, f32) {
    // Reduce to [-pi/4, pi/4] by quarter turns, pi/2 in three parts (Cody and Waite), then Taylor-like minimax
    // polynomials of single precision (coefficients as in the Cephes library, S. Moshier).
    let quarters = (x * std::f32::consts::FRAC_2_PI).round_ties_even();
    let r = ((x - quarters * 1.570_312_5) - quarters * 4.837_513e-4) - quarters * 7.549_79e-8;
    let r2 = r * r;
    let sin = r + r * r2 * (-0.166_666_55 + r2 * (0.008_332_161 - r2 * 1.951_529_6e-4));
    let cos = 1.0 - 0.5 * r2 + r2 * r2 * (0.041_666_646 + r2 * (-0.001_388_731_6 + r2 * 2.443_315_7e-5));
    match (quarters as i32) & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_basis_is_orthonormal_and_right_handed_everywhere() {
        for i in 0..2000 {
            let z = 1.0 - 2.0 * (i as f32) / 1999.0;
            let phi = i as f32 * 2.399_963;
            let r = (1.0 - z * z).max(0.0).sqrt();
            let n = Vec3A::new(r * phi.cos(), r * phi.sin(), z).normalize();
            let (s, t) = orthonormal_basis(n);
            for error in [s.dot(t), s.dot(n), t.dot(n), s.length() - 1.0, t.length() - 1.0, s.cross(t).dot(n) - 1.0] {
                assert!(error.abs() < 1e-5, "n = {n}, error {error}");
            }
        }
    }

    #[test]
    fn sine_and_cosine_agree_with_the_library() {
        for i in -200_000..200_000 {
            let x = i as f32 * 5e-4;
            let (s, c) = sin_cos(x);
            let (want_s, want_c) = (f64::from(x).sin(), f64::from(x).cos());
            assert!((f64::from(s) - want_s).abs() < 2e-7 + 2e-9 * f64::from(x.abs()), "sin {x}: {s}, not {want_s}");
            assert!((f64::from(c) - want_c).abs() < 2e-7 + 2e-9 * f64::from(x.abs()), "cos {x}: {c}, not {want_c}");
        }
    }
}
