//! Round tubes with nothing inside: explicit fibres as Embree takes them.
//!
//! In: curves in scene units, or the points that each tube passes at even parameters. Out: control points and segments
//! in single precision. A tube has no frame along it: a fibre scatters alike from all sides.

use std::sync::Arc;

use glam::{Vec3, Vec3A, Vec4};
use rayon::prelude::*;

use super::{
    chain::{self, Chain},
    curve::{Basis, Curve},
    spline::evaluate_f32,
};

/// How far off its surface a ray leaves a tube, in its radii: enough for rounding, too little to meet another.
const OFFSET: f32 = 1e-4;
/// The same in units of the distance from the origin, by which single precision rounds positions.
const ROUNDING: f32 = 4e-7;
/// The longest way through a tube, in its radii, that is taken in one step as if the tube were straight.
const LONGEST_CHORD: f32 = 6.0;

/// Tubes of one material in one geometry of Embree.
#[derive(Clone, Debug)]
pub struct Tubes {
    basis: Basis,
    points: Arc<Vec<Vec4>>,
    segments: Arc<Vec<u32>>,
    /// The first segment of each tube, and the number of all segments at the end.
    first_segments: Vec<u32>,
}

/// The axis of a tube at a hit.
#[derive(Clone, Copy, Debug)]
pub struct TubePlace {
    /// The nearest point of the axis.
    pub centre: Vec3A,
    /// Unit tangent of the axis.
    pub tangent: Vec3A,
    /// Radius there.
    pub radius: f32,
}

impl TubePlace {
    /// Where a ray in `direction` leaves a tube met at its surface, outward unit normal `normal`: outside of it, for what
    /// scatters there has already dealt with the way through.
    #[inline]
    pub fn leave(&self, normal: Vec3A, direction: Vec3A) -> Vec3A {
        let lift = self.radius * (1.0 + OFFSET) + ROUNDING * self.centre.abs().max_element();
        let outward = direction.dot(normal);
        if outward >= 0.0 {
            return self.centre + lift * normal;
        }
        let along = direction.dot(self.tangent);
        let across = 1.0 - along * along;
        let chord = -2.0 * outward / across.max(1e-6);
        if chord > LONGEST_CHORD {
            // Too far to know where a bent tube ends: from just inside; the way out never counts as a hit.
            return self.centre + (2.0 * self.radius - lift).max(0.0) * normal;
        }
        let exit = normal + chord * direction;
        let beside = exit - exit.dot(self.tangent) * self.tangent;
        self.centre + self.radius * chord * along * self.tangent + lift * beside.normalize_or(direction)
    }
}

impl Tubes {
    /// Takes curves as they are, each with its radii in the same unit. All are read in the basis of the first;
    /// straight ones are smooth curves through the same points.
    pub fn new(curves: &[(Curve, Vec<f64>)]) -> Self {
        let basis = match curves.first().map(|(curve, _)| curve.basis) {
            Some(Basis::BSpline) => Basis::BSpline,
            _ => Basis::CatmullRom,
        };
        let chains: Vec<Vec<Vec4>> = curves
            .par_iter()
            .map(|(curve, radii)| Chain::new(curve, radii).points.iter().map(|p| p.as_vec4()).collect())
            .collect();
        Self::from_chains(basis, &chains)
    }

    /// From the control points of each tube, at least four.
    pub fn from_chains(basis: Basis, chains: &[Vec<Vec4>]) -> Self {
        let mut segments = Vec::with_capacity(chains.iter().map(|c| c.len().saturating_sub(3)).sum());
        let mut first_segments = Vec::with_capacity(chains.len() + 1);
        let mut first = 0;
        for chain in chains {
            first_segments.push(segments.len() as u32);
            segments.extend(first..first + chain.len().saturating_sub(3) as u32);
            first += chain.len() as u32;
        }
        first_segments.push(segments.len() as u32);
        let mut points = Vec::with_capacity(first as usize);
        points.extend(chains.iter().flatten());
        Self { basis, points: points.into(), segments: segments.into(), first_segments }
    }

    /// The basis of the control points.
    pub fn basis(&self) -> Basis {
        self.basis
    }

    /// Control points, radius in `w`.
    pub fn points(&self) -> &Arc<Vec<Vec4>> {
        &self.points
    }

    /// The first of the four control points of each segment.
    pub fn segments(&self) -> &Arc<Vec<u32>> {
        &self.segments
    }

    /// Number of tubes.
    pub fn count(&self) -> usize {
        self.first_segments.len() - 1
    }

    /// The tube that a segment belongs to.
    pub fn tube_of(&self, segment: u32) -> usize {
        self.first_segments.partition_point(|&first| first <= segment) - 1
    }

    /// The segments of one tube.
    pub fn segments_of(&self, tube: usize) -> std::ops::Range<usize> {
        self.first_segments[tube] as usize..self.first_segments[tube + 1] as usize
    }

    /// Bytes of points and segments.
    pub fn bytes(&self) -> u64 {
        (size_of_val(self.points.as_slice())
            + size_of_val(self.segments.as_slice())
            + size_of_val(&*self.first_segments)) as u64
    }

    /// The axis at `u` (0 to 1) of a segment.
    #[inline]
    pub fn place(&self, segment: u32, u: f32) -> TubePlace {
        let first = self.segments[segment as usize] as usize;
        let p: &[Vec4; 4] = self.points[first..first + 4].try_into().expect("a segment has four points");
        let (at, d1, _) = evaluate_f32(self.basis, p, u);
        TubePlace { centre: Vec3A::from_vec4(at), tangent: Vec3A::from_vec4(d1).normalize_or(Vec3A::X), radius: at.w }
    }

    /// The tubes as curves with radii, to be written to a file.
    pub fn curves(&self) -> impl Iterator<Item = Curve> + '_ {
        self.first_segments.windows(2).map(|w| {
            let first = self.segments[w[0] as usize] as usize;
            curve_of(self.basis, &self.points[first..first + (w[1] - w[0]) as usize + 3])
        })
    }
}

/// The open curve of some control points with their radii.
pub(crate) fn curve_of(basis: Basis, points: &[Vec4]) -> Curve {
    // Catmull-Rom ends are mirrored points, which every reader makes for itself.
    let kept = if basis == Basis::BSpline { points } else { &points[1..points.len() - 1] };
    Curve {
        basis,
        closed: false,
        points: kept.iter().map(|p| p.truncate().as_dvec3()).collect(),
        radii: Some(kept.iter().map(|p| f64::from(p.w)).collect()),
        flattening: None,
    }
}

/// The control points of the uniform cubic B-spline that passes through `knots` (at least two), with the radius `w`
/// of each knot. At its ends the curve does not bend.
pub(crate) fn spline_through(knots: &[Vec3], radii: impl Fn(usize) -> f32) -> Vec<Vec4> {
    let points = chain::spline_through(knots.iter().map(|knot| knot.as_dvec3()));
    let knot_of = |i: usize| i.saturating_sub(1).min(knots.len() - 1);
    points.iter().enumerate().map(|(i, p)| p.as_vec3().extend(radii(knot_of(i)))).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::math::frame::orthonormal_basis;

    #[test]
    fn the_spline_passes_its_knots_and_follows_a_helix() {
        for n in [2, 3, 4, 5, 60] {
            let at = |t: f32| Vec3::new((0.5 * t).cos(), (0.5 * t).sin(), t);
            let knots: Vec<Vec3> = (0..n).map(|i| at(i as f32)).collect();
            let points = spline_through(&knots, |i| 1.0 + i as f32);
            assert_eq!(points.len(), n + 2);
            let tubes = Tubes::from_chains(Basis::BSpline, &[points]);
            assert_eq!(tubes.segments().len(), n - 1);
            for i in 0..n - 1 {
                let (a, b) = (tubes.place(i as u32, 0.0).centre, tubes.place(i as u32, 1.0).centre);
                assert!((a - Vec3A::from(knots[i])).length() < 1e-5 && (b - Vec3A::from(knots[i + 1])).length() < 1e-5);
                // Half a radian a step: the fourth power over 384 away from the ends.
                if i > 4 && i + 6 < n {
                    let middle = tubes.place(i as u32, 0.5).centre;
                    let error = (middle.truncate().length() - 1.0).abs();
                    assert!(error < 2e-4, "segment {i}: {error}");
                }
            }
        }
    }

    #[test]
    fn tubes_are_found_again() {
        let line = |x: f64| Curve {
            basis: Basis::CatmullRom,
            closed: false,
            points: (0..4).map(|i| DVec3::new(x, f64::from(i), 0.0)).collect(),
            radii: None,
            flattening: None,
        };
        let tubes = Tubes::new(&[(line(0.0), vec![0.1; 4]), (line(1.0), vec![0.2; 4])]);
        assert_eq!((tubes.count(), tubes.segments().len()), (2, 6));
        assert_eq!([0, 2, 3, 5].map(|s| tubes.tube_of(s)), [0, 0, 1, 1]);
        let place = tubes.place(4, 0.25);
        assert!((place.centre - Vec3A::new(1.0, 1.25, 0.0)).length() < 1e-6 && (place.radius - 0.2).abs() < 1e-6);
        let back: Vec<Curve> = tubes.curves().collect();
        assert_eq!(back[1].points, line(1.0).points);
    }

    #[test]
    fn rays_leave_a_tube_outside_of_it_on_the_side_where_they_go() {
        let place = TubePlace { centre: Vec3A::new(3.0, -2.0, 5.0), tangent: Vec3A::new(0.0, 0.6, 0.8), radius: 0.01 };
        let (s, t) = orthonormal_basis(place.tangent);
        for i in 0..2000 {
            let turn = i as f32 * 2.399_963;
            let normal = turn.cos() * s + turn.sin() * t;
            let z = 1.0 - 2.0 * (i as f32 + 0.5) / 2000.0;
            let r = (1.0 - z * z).sqrt();
            let w = Vec3A::new(r * (7.0 * turn).cos(), r * (7.0 * turn).sin(), z);
            let from = place.leave(normal, w);
            let rel = from - place.centre;
            let axial = rel.dot(place.tangent);
            let distance = (rel - axial * place.tangent).length() / place.radius;
            let along = w.dot(place.tangent);
            let long = w.dot(normal) < 0.0 && -2.0 * w.dot(normal) / (1.0 - along * along) > LONGEST_CHORD;
            if long {
                assert!(distance < 1.0 && distance > 0.99, "{distance}");
            } else {
                assert!((1.000_05..1.002).contains(&distance), "{distance}");
                // It moves away from the axis.
                assert!((rel - axial * place.tangent).dot(w) >= -1e-6 * place.radius, "{w}");
            }
            assert!(axial.abs() <= LONGEST_CHORD * place.radius * 1.001);
        }
    }
}
