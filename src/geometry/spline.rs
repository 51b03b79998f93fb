//! Uniform cubic splines: evaluation of one segment, in `f64` for set-up and in `f32` for hits.

use glam::{DVec3, DVec4, Vec3A, Vec4};

use super::curve::Basis;

/// The weights of four control points at `u` in 0..1: of the position, its first and its second derivative by u.
macro_rules! weights {
    ($name:ident, $float:ty) => {
        #[inline]
        fn $name(basis: Basis, u: $float) -> [[$float; 4]; 3] {
            let (u2, u3) = (u * u, u * u * u);
            match basis {
                Basis::BSpline => {
                    let v = 1.0 - u;
                    let sixth = 1.0 / 6.0;
                    [
                        [
                            v * v * v * sixth,
                            (4.0 - 6.0 * u2 + 3.0 * u3) * sixth,
                            (1.0 + 3.0 * (u + u2 - u3)) * sixth,
                            u3 * sixth,
                        ],
                        [-0.5 * v * v, 0.5 * (3.0 * u2 - 4.0 * u), 0.5 * (1.0 + 2.0 * u - 3.0 * u2), 0.5 * u2],
                        [v, 3.0 * u - 2.0, 1.0 - 3.0 * u, u],
                    ]
                }
                Basis::CatmullRom | Basis::Linear => [
                    [
                        0.5 * (-u + 2.0 * u2 - u3),
                        0.5 * (2.0 - 5.0 * u2 + 3.0 * u3),
                        0.5 * (u + 4.0 * u2 - 3.0 * u3),
                        0.5 * (u3 - u2),
                    ],
                    [
                        0.5 * (-1.0 + 4.0 * u - 3.0 * u2),
                        0.5 * (-10.0 * u + 9.0 * u2),
                        0.5 * (1.0 + 8.0 * u - 9.0 * u2),
                        0.5 * (3.0 * u2 - 2.0 * u),
                    ],
                    [2.0 - 3.0 * u, 9.0 * u - 5.0, 4.0 - 9.0 * u, 3.0 * u - 1.0],
                ],
            }
        }
    };
}
weights!(weights_f32, f32);
weights!(weights_f64, f64);

/// The weights of four control points of a B-spline at `u` in 0..1.
pub(crate) fn bspline_weights(u: f64) -> [f64; 4] {
    weights_f64(Basis::BSpline, u)[0]
}

/// A point of a segment and its derivative by u. `w` is the radius.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SplinePoint {
    /// Position and radius.
    pub(crate) at: DVec4,
    /// First derivative.
    pub(crate) d1: DVec4,
}

/// Evaluates a segment with control points `p` at `u`.
#[inline]
pub(crate) fn evaluate(basis: Basis, p: [DVec4; 4], u: f64) -> SplinePoint {
    let sum = |w: [f64; 4]| w[0] * p[0] + w[1] * p[1] + w[2] * p[2] + w[3] * p[3];
    let [a, b, _] = weights_f64(basis, u);
    SplinePoint { at: sum(a), d1: sum(b) }
}

/// The weights of a place in a segment, for many segments at the same place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weights([[f64; 4]; 3]);

impl Weights {
    /// At `u` in 0..1.
    pub(crate) fn new(basis: Basis, u: f64) -> Self {
        Self(weights_f64(basis, u))
    }

    /// The curve's point and its first derivative at that place.
    #[inline]
    pub(crate) fn evaluate(&self, p: &[DVec4; 4]) -> SplinePoint {
        let sum = |w: &[f64; 4]| w[0] * p[0] + w[1] * p[1] + w[2] * p[2] + w[3] * p[3];
        let [a, b, _] = &self.0;
        SplinePoint { at: sum(a), d1: sum(b) }
    }

    /// Speed at that place: the length of the first derivative.
    #[inline]
    pub(crate) fn speed(&self, p: &[DVec4; 4]) -> f64 {
        let w = &self.0[1];
        (w[0] * p[0] + w[1] * p[1] + w[2] * p[2] + w[3] * p[3]).truncate().length()
    }
}

/// Evaluates a segment in single precision: position and first derivative with the radius in `w`, second derivative.
#[inline]
pub(crate) fn evaluate_f32(basis: Basis, p: &[Vec4; 4], u: f32) -> (Vec4, Vec4, Vec3A) {
    let sum = |w: [f32; 4]| w[0] * p[0] + w[1] * p[1] + w[2] * p[2] + w[3] * p[3];
    let [a, b, c] = weights_f32(basis, u);
    (sum(a), sum(b), Vec3A::from_vec4(sum(c)))
}

/// A number between the second and the third of four points, and its change with `u`: Catmull-Rom.
#[inline]
pub(crate) fn catmull_rom_f32(values: [f32; 4], u: f32) -> [f32; 2] {
    let sum = |w: [f32; 4]| w[0] * values[0] + w[1] * values[1] + w[2] * values[2] + w[3] * values[3];
    let [a, b, _] = weights_f32(Basis::CatmullRom, u);
    [sum(a), sum(b)]
}

/// Catmull-Rom between the second and the third of four points, at `t` in 0..1.
#[inline]
pub(crate) fn catmull_rom([a, b, c, d]: [DVec3; 4], t: f64) -> DVec3 {
    b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)))
}

/// The same through a list of points, which ends in its first and its last one: `t` of the way from point `i` to the next.
#[inline]
pub(crate) fn through_points(points: &[DVec3], i: usize, t: f64) -> DVec3 {
    let at = |k: usize| points[k.min(points.len() - 1)];
    catmull_rom([at(i.saturating_sub(1)), at(i), at(i + 1), at(i + 2)], t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bases_interpolate_and_their_derivatives_are_derivatives() {
        let p = [
            DVec4::new(0.0, 0.1, 2.0, 0.5),
            DVec4::new(1.0, 0.3, 1.0, 0.4),
            DVec4::new(2.0, -0.4, 0.0, 0.3),
            DVec4::new(3.5, 1.4, 0.3, 0.2),
        ];
        for basis in [Basis::CatmullRom, Basis::BSpline] {
            for i in 1..20 {
                let u = f64::from(i) / 20.0;
                let here = evaluate(basis, p, u);
                let h = 1e-5;
                let (a, b) = (evaluate(basis, p, u - h), evaluate(basis, p, u + h));
                assert!(((b.at - a.at) / (2.0 * h) - here.d1).length() < 1e-8);
                let second = (b.d1 - a.d1) / (2.0 * h);
                let q = p.map(|v| v.as_vec4());
                let (at, d1, d2) = evaluate_f32(basis, &q, u as f32);
                assert!((at.as_dvec4() - here.at).length() < 1e-6);
                assert!((d1.as_dvec4() - here.d1).length() < 1e-5);
                assert!((d2.as_dvec3() - second.truncate()).length() < 1e-5);
            }
        }
        assert!((evaluate(Basis::CatmullRom, p, 0.0).at - p[1]).length() < 1e-12);
        assert!((evaluate(Basis::CatmullRom, p, 1.0).at - p[2]).length() < 1e-12);
        let points = p.map(|v| v.truncate());
        assert!((catmull_rom(points, 0.3) - evaluate(Basis::CatmullRom, p, 0.3).at.truncate()).length() < 1e-12);
        assert!((through_points(&points, 1, 0.3) - catmull_rom(points, 0.3)).length() < 1e-12);
        assert_eq!([through_points(&points, 0, 0.0), through_points(&points, 3, 0.0)], [points[0], points[3]]);
        let start = (p[0] + 4.0 * p[1] + p[2]) / 6.0;
        assert!((evaluate(Basis::BSpline, p, 0.0).at - start).length() < 1e-12);
    }
}
