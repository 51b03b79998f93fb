//! Curves as chains of cubic segments: evaluated, measured, and put through fewer points or into another basis.

use std::ops::{Mul, Sub};

use glam::{DVec3, DVec4, Vec2};
use rayon::prelude::*;

use super::{
    curve::{Basis, Curve},
    segment_uvs::{self, SegmentUvs},
    spline::{SplinePoint, Weights, evaluate},
};
use crate::math::special::GAUSS_LEGENDRE_4;

/// A curve as a chain of segments that can be evaluated.
pub(crate) struct Chain {
    pub(crate) basis: Basis,
    pub(crate) points: Vec<DVec4>,
}

impl Chain {
    /// Adds the points that the ends need: closed curves repeat theirs, open Catmull-Rom curves reach their end
    /// points (a mirrored point beyond), B-splines with too few points repeat their ends.
    pub(crate) fn new(curve: &Curve, radii: &[f64]) -> Self {
        Self::at_time(curve, radii, &curve.points)
    }

    /// The chain of the same curve while its points are elsewhere.
    pub(crate) fn at_time(curve: &Curve, radii: &[f64], points: &[DVec3]) -> Self {
        assert_eq!(points.len(), curve.points.len(), "a curve has as many points at all times");
        Self::of_values(curve, |i| points[i].extend(radii[i]))
    }

    /// The chain of what is known at each point of a curve, asked for in their order.
    pub(crate) fn of_values(curve: &Curve, value: impl FnMut(usize) -> DVec4) -> Self {
        let points = curve.points.len();
        // Only repeated B-spline points mean something; elsewhere they make segments without a direction.
        let repeated = |i: usize| curve.basis != Basis::BSpline && i > 0 && curve.points[i] == curve.points[i - 1];
        let kept = || (0..points).filter(|i| !repeated(*i));
        let closed = curve.closed && kept().take(3).count() == 3;
        // The point before the first is known when all are there.
        let before = usize::from(closed || curve.basis != Basis::BSpline);
        let mut all = Vec::with_capacity(points + 3);
        all.resize(before, DVec4::ZERO);
        all.extend(kept().map(value));
        if all.len() == before + 1 {
            let p = all[before];
            all.push(p + DVec4::new(1e-6 * p.w.max(1e-12), 0.0, 0.0, 0.0));
        }
        let (first, second) = (all[before], all[before + 1]);
        let (last, last_but_one) = (all[all.len() - 1], all[all.len() - 2]);
        if closed {
            all[0] = last;
            all.extend([first, second]);
        } else if curve.basis == Basis::BSpline {
            while all.len() < 4 {
                all.insert(0, first);
                all.push(last);
            }
        } else {
            let beyond = |end: DVec4, next: DVec4| (2.0 * end - next).truncate().extend(end.w);
            all[0] = beyond(first, second);
            all.push(beyond(last, last_but_one));
        }
        Self { basis: curve.basis, points: all }
    }

    pub(crate) fn segments(&self) -> usize {
        self.points.len() - 3
    }

    /// The four control points of a segment.
    #[inline]
    pub(crate) fn points_of(&self, segment: usize) -> &[DVec4; 4] {
        self.points[segment..].first_chunk().expect("a segment has four points")
    }

    pub(crate) fn at(&self, segment: usize, u: f64) -> SplinePoint {
        let p = &self.points[segment..segment + 4];
        evaluate(self.basis, [p[0], p[1], p[2], p[3]], u)
    }

    /// A chain in the wanted basis through places of this one; the last of a closed one is the first again.
    pub(crate) fn through(&self, knots: &[(usize, f64)], closed: bool, basis: Basis) -> Self {
        let knots: Vec<DVec4> = knots.iter().map(|&(segment, u)| self.at(segment, u).at).collect();
        let distinct = if closed { &knots[..knots.len() - 1] } else { &knots[..] };
        if basis != Basis::BSpline {
            let curve = Curve {
                basis,
                closed,
                points: distinct.iter().map(|p| p.truncate()).collect(),
                radii: None,
                flattening: None,
            };
            return Self::new(&curve, &distinct.iter().map(|p| p.w).collect::<Vec<f64>>());
        }
        let mut points = if closed {
            // An open curve that has gone round before and goes on round after: what is beyond its ends does not reach here.
            let (count, far) = (distinct.len(), FORGOTTEN);
            let around = (0..count + 2 * far).map(|i| distinct[(i + far * (count - 1)) % count]);
            spline_through(around)[far..far + count + 3].to_vec()
        } else {
            spline_through(distinct.iter().copied())
        };
        // Where radii jump a spline through them would go below them, down to nothing.
        const LEAST: f64 = 0.5;
        let last = points.len() - 1;
        let radius = |i: usize| knots[i.min(knots.len() - 1)].w;
        for (i, p) in points.iter_mut().enumerate() {
            let near = [i.saturating_sub(2), i.saturating_sub(1), i.min(last)].map(radius);
            if p.w <= 0.0 {
                p.w = LEAST * near.into_iter().fold(f64::MAX, f64::min).max(0.0);
            }
        }
        Self { basis, points }
    }

    /// The curve that makes this chain, without radii.
    pub(crate) fn curve(&self, closed: bool) -> Curve {
        let points = self.points.iter().map(|p| p.truncate());
        let added = if closed { [1, 2] } else { [usize::from(self.basis != Basis::BSpline); 2] };
        let points = points.take(self.points.len() - added[1]).skip(added[0]).collect();
        Curve { basis: self.basis, closed, points, radii: None, flattening: None }
    }

    /// Arc length from the chain's start to each of its knots.
    pub(crate) fn lengths(&self) -> Vec<f64> {
        let nodes = GAUSS_LEGENDRE_4.map(|(u, weight)| (Weights::new(self.basis, u), weight));
        let length_of = |segment: usize| {
            let p = self.points_of(segment);
            let mut length = 0.0;
            for (node, weight) in &nodes {
                length += weight * node.speed(p);
            }
            length
        };
        let mut lengths = vec![0.0; self.segments() + 1];
        let ends = lengths[1..].par_iter_mut().with_min_len(PARALLEL).enumerate();
        ends.for_each(|(segment, length)| *length = length_of(segment));
        let mut sum = 0.0;
        for length in &mut lengths {
            sum += *length;
            *length = sum;
        }
        lengths
    }
}

/// Segments for which a task of their own is worth while.
const PARALLEL: usize = 4096;

/// How a chain is resampled.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit {
    /// The basis wanted.
    pub(crate) basis: Basis,
    /// How far from the old chain it may lie.
    pub(crate) tolerance: f64,
    /// The longest segment.
    pub(crate) longest: f64,
}

/// A place of a chain by the way to it: its segment, and where in it. Given `lengths` to the chain's knots.
fn place_at(chain: &Chain, lengths: &[f64], along: f64) -> (usize, f64) {
    let segment = lengths.partition_point(|&l| l <= along).clamp(1, lengths.len() - 1) - 1;
    let span = lengths[segment + 1] - lengths[segment];
    if span <= 0.0 {
        return (segment, 0.0);
    }
    let t = ((along - lengths[segment]) / span).clamp(0.0, 1.0);
    // The cubic that is right at both knots, in value and slope, if it rises from one to the other.
    let slope = |u: f64| span / chain.at(segment, u).d1.truncate().length();
    let (a, b) = (slope(0.0), slope(1.0));
    if !(a <= 3.0 && b <= 3.0) {
        return (segment, t);
    }
    (segment, (t * (a + t * (3.0 - 2.0 * a - b + t * (a + b - 2.0)))).clamp(0.0, 1.0))
}

/// Every so many segments a curve is looked at before it is looked at all along.
const SPARSE: usize = 37;
/// Knots around a segment which its shape depends on, as near as tells whether more knots are needed.
const AROUND: usize = 8;

/// Places on the chain (segment, and where in it) at equal arc length, as few as keep the curve through them within the
/// tolerance of the old one; `None` if that takes the chain's own points.
pub(crate) fn resample(chain: &Chain, lengths: &[f64], closed: bool, fit: &Fit) -> Option<Vec<(usize, f64)>> {
    let total = lengths[lengths.len() - 1];
    let longest = fit.longest.max(total * 1e-7);
    let fewest = if closed { 4 } else { 1 };
    // With as many points as were given, those given are exact; another basis may need some more.
    let exact = chain.basis == fit.basis;
    let most = if exact { chain.segments() } else { 2 * chain.segments() }.max(fewest);
    let mut count = ((total / longest).ceil() as usize).max(fewest).min(most);
    loop {
        if exact && count >= most {
            return None;
        }
        let knot = |i: usize| place_at(chain, lengths, total * i as f64 / count as f64);
        // How far segment `of` of the curve `made`, which stands for segment `i` of `count`, is off the chain.
        let off = |made: &Chain, of: usize, i: usize| {
            [0.25, 0.5, 0.75].map(|u| {
                let (segment, v) = place_at(chain, lengths, total * (i as f64 + u) / count as f64);
                let want = chain.at(segment, v);
                let off = made.at(of, u).at.truncate() - want.at.truncate();
                // A shift along the yarn is no error of its shape.
                let t = want.d1.truncate().try_normalize().unwrap_or(DVec3::ZERO);
                (off - off.dot(t) * t).length()
            })
        };
        let largest = |errors: [f64; 3]| errors.into_iter().fold(0.0, f64::max);
        let around = if fit.basis == Basis::BSpline { AROUND } else { 1 };
        let mut worst = (around..count.saturating_sub(around))
            .step_by(SPARSE)
            .map(|i| {
                let near: Vec<_> = (i - around..=i + 1 + around).map(knot).collect();
                largest(off(&chain.through(&near, false, fit.basis), around, i))
            })
            .fold(0.0, f64::max);
        if worst <= fit.tolerance || count >= most {
            let knots: Vec<_> = (0..count + 1).into_par_iter().with_min_len(PARALLEL).map(knot).collect();
            let made = chain.through(&knots, closed, fit.basis);
            let all = (0..count).into_par_iter().with_min_len(PARALLEL).map(|i| largest(off(&made, i, i)));
            worst = all.reduce(|| 0.0, f64::max);
            if worst <= fit.tolerance || count >= most {
                return Some(knots);
            }
        }
        // The error of a cubic falls with the third power of the spacing at least.
        let grow = (worst / fit.tolerance).powf(1.0 / 3.0).clamp(1.1, 2.0);
        count = ((count as f64 * grow).ceil() as usize).min(most);
    }
}

/// The material index nearest to the middle of each segment: of `chain` itself, or of one made through places of it.
pub(crate) fn nearest_indices(
    curve: &Curve,
    material_indices: &[u16],
    chain: &Chain,
    knots: Option<&[(usize, f64)]>,
) -> Vec<u16> {
    let starts = starts_among_points(curve, chain, knots);
    let points = curve.points.len();
    let steps =
        if curve.closed { material_indices.len() / points } else { (material_indices.len() - 1) / (points - 1).max(1) }
            as f64;
    starts
        .windows(2)
        .map(|ends| {
            let index = (0.5 * (ends[0] + ends[1]) * steps).round() as usize;
            material_indices
                [if curve.closed { index % material_indices.len() } else { index.min(material_indices.len() - 1) }]
        })
        .collect()
}

/// The places among a curve's points, from 0, at which each segment of `chain`, or of one made through places of it,
/// starts, and where the last one ends.
fn starts_among_points(curve: &Curve, chain: &Chain, knots: Option<&[(usize, f64)]>) -> Vec<f64> {
    // Segment i starts at given point i, and between points i and i + 2 of an open B-spline.
    let shift = if chain.basis == Basis::BSpline && !curve.closed { 1.0 } else { 0.0 };
    match knots {
        None => (0..=chain.segments()).map(|i| i as f64 + shift).collect(),
        Some(knots) => knots.iter().map(|&(segment, u)| segment as f64 + u + shift).collect(),
    }
}

/// Texture coordinates where each segment of a resampled curve starts and ends, from those of the given points.
pub(crate) fn uvs_of_segments(
    curve: &Curve,
    uvs: &[Vec2],
    chain: &Chain,
    knots: Option<&[(usize, f64)]>,
) -> SegmentUvs {
    let point = |i: usize| uvs[if curve.closed { i % uvs.len() } else { i.min(uvs.len() - 1) }];
    let at =
        |place: &f64| segment_uvs::mixed([point(*place as usize), point(*place as usize + 1)], place.fract() as f32);
    let places: Vec<Vec2> = starts_among_points(curve, chain, knots).iter().map(at).collect();
    SegmentUvs::between(&places)
}

/// After so many knots a B-spline has forgotten another: (2 - sqrt 3)^28 is 1e-16.
const FORGOTTEN: usize = 28;

/// The control points of the uniform cubic B-spline that passes through `knots` (at least two) and does not bend at its
/// ends: one for each knot, and one beyond each end.
///
/// Control points c obey `(c[i-1] + 4 c[i] + c[i+1]) / 6 = knot[i]`; the tridiagonal system is solved in one sweep each way.
pub(crate) fn spline_through<V>(knots: impl ExactSizeIterator<Item = V>) -> Vec<V>
where
    V: Copy + Sub<Output = V> + Mul<f64, Output = V>,
{
    let n = knots.len();
    debug_assert!(n >= 2, "a curve has two points");
    // Ends without bending: c[-1] = 2 c[0] - c[1] makes the first row c[0] = knot 0. The point before is put in at last.
    let mut c: Vec<V> = Vec::with_capacity(n + 2);
    let mut factors = Vec::with_capacity(n);
    for (i, knot) in knots.enumerate() {
        if i == 0 {
            c.push(knot);
        }
        if i == 0 || i == n - 1 {
            c.push(knot);
            factors.push(0.0);
            continue;
        }
        let pivot = 1.0 / (4.0 - factors[i - 1]);
        let before = c[i];
        c.push((knot * 6.0 - before) * pivot);
        factors.push(pivot);
    }
    for i in (1..n - 1).rev() {
        c[i + 1] = c[i + 1] - c[i + 2] * factors[i];
    }
    c[0] = c[1] * 2.0 - c[2];
    c.push(c[n] * 2.0 - c[n - 1]);
    c
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(n: usize, closed: bool, basis: Basis) -> (Curve, Vec<f64>) {
        let at = |i: usize| std::f64::consts::TAU * i as f64 / n as f64;
        let points = (0..n).map(|i| DVec3::new(3.0 * at(i).cos(), 2.0 * at(i).sin(), (2.0 * at(i)).sin())).collect();
        (
            Curve { basis, closed, points, radii: None, flattening: None },
            (0..n).map(|i| 0.2 + 0.1 * at(i).cos()).collect(),
        )
    }

    #[test]
    fn radii_that_jump_stay_above_nothing() {
        let points = (0..12).map(|i| DVec3::X * f64::from(i)).collect();
        let radii: Vec<f64> = (0..12).map(|i| if i == 5 { 0.3 } else { 1.2 }).collect();
        let curve = Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening: None };
        let chain = Chain::new(&curve, &radii);
        let knots: Vec<(usize, f64)> = (0..11).map(|i| (i, 0.0)).chain([(10, 1.0)]).collect();
        let smooth = chain.through(&knots, false, Basis::BSpline);
        assert!(smooth.points.iter().all(|p| p.w >= 0.15), "{:?}", smooth.points);
    }

    #[test]
    fn chains_in_either_basis_pass_their_knots() {
        for closed in [false, true] {
            for n in [4, 7, 50] {
                let (curve, radii) = wave(n, closed, Basis::CatmullRom);
                let chain = Chain::new(&curve, &radii);
                let knots: Vec<(usize, f64)> =
                    (0..chain.segments()).map(|i| (i, 0.0)).chain([(chain.segments() - 1, 1.0)]).collect();
                for basis in [Basis::CatmullRom, Basis::BSpline] {
                    let made = chain.through(&knots, closed, basis);
                    assert_eq!(made.segments(), chain.segments());
                    for i in 0..made.segments() {
                        assert!(
                            (made.at(i, 0.0).at - chain.at(i, 0.0).at).length() < 1e-12,
                            "{basis:?} {closed} {n} {i}"
                        );
                        assert!(
                            (made.at(i, 1.0).at - chain.at(i, 1.0).at).length() < 1e-12,
                            "{basis:?} {closed} {n} {i}"
                        );
                    }
                    let again = Chain::new(&made.curve(closed), &vec![0.0; made.points.len()]);
                    assert_eq!(again.segments(), made.segments());
                    for i in 0..made.segments() {
                        let (a, b) = (again.at(i, 0.4).at.truncate(), made.at(i, 0.4).at.truncate());
                        assert!((a - b).length() < 1e-12, "{basis:?} {closed} {n} {i}");
                    }
                    if closed {
                        let (first, last) = (made.at(0, 0.0), made.at(made.segments() - 1, 1.0));
                        assert!((first.d1 - last.d1).length() < 1e-12, "{basis:?} is smooth at its seam");
                    }
                }
            }
        }
    }

    #[test]
    fn a_straight_chain_is_as_long_as_it_is() {
        let points = [0.0, 1.0, 1.5, 4.0].map(|x| DVec3::new(0.6 * x, 0.8 * x, 0.0)).to_vec();
        let curve = Curve { basis: Basis::Linear, closed: false, points, radii: None, flattening: None };
        let lengths = Chain::new(&curve, &[0.1; 4]).lengths();
        for (knot, end) in [0.0, 1.0, 1.5, 4.0].into_iter().enumerate() {
            assert!((lengths[knot] - end).abs() < 1e-9, "{lengths:?}");
        }
    }

    #[test]
    fn lengths_are_those_of_many_small_steps_and_places_lie_where_they_say() {
        for (basis, n) in [(Basis::CatmullRom, 12), (Basis::BSpline, 12), (Basis::CatmullRom, 60)] {
            let (curve, radii) = wave(n, true, basis);
            let chain = Chain::new(&curve, &radii);
            let lengths = chain.lengths();
            let steps = 4000;
            let mut sum = 0.0;
            for segment in 0..chain.segments() {
                for k in 0..steps {
                    let at = |k: u32| chain.at(segment, f64::from(k) / f64::from(steps)).at.truncate();
                    if k == steps / 3 {
                        let (found, u) = place_at(&chain, &lengths, sum);
                        assert_eq!(found, segment);
                        assert!((u - 1.0 / 3.0).abs() < 5e-3, "{basis:?} {n} {segment}: {u}");
                    }
                    sum += at(k).distance(at(k + 1));
                }
                // The spacing of 12 points is coarser than any yarn's.
                assert!(
                    (lengths[segment + 1] / sum - 1.0).abs() < 1e-5,
                    "{basis:?} {n}: {} {sum}",
                    lengths[segment + 1]
                );
            }
        }
    }

    #[test]
    fn fewer_places_stay_within_the_tolerance() {
        let (curve, radii) = wave(200, true, Basis::CatmullRom);
        let chain = Chain::new(&curve, &radii);
        let fit = Fit { basis: Basis::CatmullRom, tolerance: 0.01, longest: 2.0 };
        let lengths = chain.lengths();
        let knots = resample(&chain, &lengths, true, &fit).expect("fewer than given");
        assert!(knots.len() < 60, "{}", knots.len());
        let made = chain.through(&knots, true, fit.basis);
        for i in 0..made.segments() {
            let p = made.at(i, 0.5).at.truncate();
            let near = (0..2000).map(|k| chain.at(k / 10, f64::from(k as u32 % 10) / 10.0).at.truncate().distance(p));
            assert!(near.fold(f64::MAX, f64::min) < 0.05);
        }
    }
}
