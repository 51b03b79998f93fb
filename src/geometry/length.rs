//! How long curves are.

use super::{
    chain::Chain,
    curve::{Basis, Curve},
};

/// Length of the curve itself, which passes beside the control points of a B-spline; in the unit of its points.
pub fn length(curve: &Curve) -> f64 {
    if curve.basis == Basis::Linear {
        return curve.polygon_length();
    }
    let chain = Chain::of_values(curve, |i| curve.points[i].extend(0.0));
    chain.lengths().last().copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use glam::{DVec2, DVec3};

    use super::*;

    #[test]
    fn the_length_is_that_of_the_curve_and_not_of_its_control_points() {
        let ring = |basis| {
            let points = (0..8).map(|k| DVec3::from((DVec2::from_angle(TAU / 8.0 * f64::from(k)), 0.0))).collect();
            Curve { basis, closed: true, points, radii: None, flattening: None }
        };
        // Knots of the B-spline lie at a sixth of 4 + 2 cos 45 of the points' distance from the middle.
        let inner = (4.0 + 2.0_f64.sqrt()) / 6.0;
        let [spline, through, straight] =
            [Basis::BSpline, Basis::CatmullRom, Basis::Linear].map(|basis| length(&ring(basis)));
        assert!((spline / (TAU * inner) - 1.0).abs() < 0.005, "{spline}");
        assert!((through / TAU - 1.0).abs() < 0.01, "{through}");
        assert!((straight - ring(Basis::Linear).polygon_length()).abs() < 1e-9, "{straight}");
    }
}
