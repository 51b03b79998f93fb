//! Whether the yarns of a made cloth run into each other more than is right.

use crate::geometry::{
    curve::Curve,
    overlap::{Overlap, overlap_of_plied, sampled_overlap},
};

/// A larger share of the yarns' length is told.
const MOST: f64 = 0.05;
/// Fewer places are not seen, where strands are as deep in each other as this.
const FEW: f64 = 0.002;
const DEEP: f64 = 0.5;
/// Cloth of so few control points is looked at everywhere, more of it by samples.
const SMALL: usize = 10_000;
/// Cloth of more than this is looked at from its lower edge as far up as it has so many.
const ENOUGH: usize = 400_000;

/// A curve of the cloth, its radii, and its mean half width over them.
pub(super) type Measured<'a> = (&'a Curve, &'a [f64], f64);

/// How far yarns overlap, where that is more than is right. The cloth lies as it was made, y up.
pub(super) fn crowding(curves: &[Measured<'_>]) -> Option<Overlap> {
    let count: usize = curves.iter().map(|(curve, ..)| curve.points.len()).sum();
    let found = if count <= SMALL {
        overlap_of_plied(curves.iter().copied())
    } else if count <= ENOUGH {
        sampled_overlap(curves.iter().copied())
    } else {
        let part = lower_part(curves, ENOUGH as f64 / count as f64);
        sampled_overlap(part.iter().map(|(curve, radii, half_width)| (curve, radii.as_slice(), *half_width)))
    }?;
    (found.share > MOST || (found.share > FEW && found.deepest > DEEP)).then_some(found)
}

/// What is told of it, and why it is so.
pub(super) fn in_words(found: &Overlap, why: &str) -> String {
    let [share, deepest] = [found.share, found.deepest].map(|part| 100.0 * part);
    format!("{share:.1} % of the yarn overlaps, by up to {deepest:.0} % of its diameter: {why}")
}

/// What yarns have until they first leave this share of the cloth's height, from below.
fn lower_part(curves: &[Measured<'_>], share: f64) -> Vec<(Curve, Vec<f64>, f64)> {
    let heights = || curves.iter().flat_map(|(curve, ..)| &curve.points).map(|p| p.y);
    let (lowest, highest) = heights().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), y| (lo.min(y), hi.max(y)));
    let top = lowest + (highest - lowest) * share;
    let part = |&(curve, radii, half_width): &Measured<'_>| {
        let n = curve.points.iter().position(|p| p.y > top).unwrap_or(curve.points.len());
        let start = Curve {
            basis: curve.basis,
            closed: curve.closed && n == curve.points.len(),
            points: curve.points[..n].to_vec(),
            radii: None,
            flattening: curve.flattening.as_ref().map(|axes| axes[..n.min(axes.len())].to_vec()),
        };
        // The fewest points of a spline.
        (n >= 4).then(|| (start, radii[..n].to_vec(), half_width))
    };
    curves.iter().filter_map(part).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::geometry::curve::Basis;

    /// Straight yarns up the cloth, so far apart.
    fn warps(count: usize, points: usize, apart: f64) -> Vec<Curve> {
        let curve = |i: usize| Curve {
            basis: Basis::CatmullRom,
            closed: false,
            points: (0..points).map(|k| DVec3::new(i as f64 * apart, k as f64, 0.0)).collect(),
            radii: None,
            flattening: None,
        };
        (0..count).map(curve).collect()
    }

    fn share(curves: &[Curve]) -> Option<f64> {
        let radii = vec![0.5; curves[0].points.len()];
        let measured: Vec<Measured<'_>> = curves.iter().map(|c| (c, radii.as_slice(), 1.0)).collect();
        crowding(&measured).map(|found| found.share)
    }

    #[test]
    fn yarns_side_by_side_are_not_crowded_and_yarns_in_each_other_are() {
        assert_eq!(share(&warps(10, 50, 1.0)), None);
        assert!(share(&warps(10, 50, 0.9)).unwrap() > 0.99);
    }

    #[test]
    fn large_cloth_is_told_by_its_lower_part() {
        let mut curves = warps(10, ENOUGH / 5, 1.0);
        assert_eq!(share(&curves), None);
        // One yarn is shifted into the next: of the lower part a fifth of all length.
        curves[4].points.iter_mut().for_each(|p| p.x += 0.2);
        let told = share(&curves).unwrap();
        assert!((0.15..0.25).contains(&told), "{told}");
        // What happens above is not seen.
        let mut curves = warps(10, ENOUGH / 5, 1.0);
        curves[4].points[ENOUGH / 8..].iter_mut().for_each(|p| p.x += 0.2);
        assert_eq!(share(&curves), None);
    }
}
