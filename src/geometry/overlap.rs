//! How far yarns run into each other.

use glam::DVec3;
use rayon::prelude::*;

use super::contact::{PointGrid, Walk, nearest};
use crate::geometry::{
    chain::Chain,
    curve::{Basis, Curve},
};

/// How far yarns run into each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// Length of all yarns.
    pub length: f64,
    /// Share of the length that overlaps another strand by more than [`TOLERATED`] of the mean diameter.
    pub share: f64,
    /// The deepest overlap, in mean diameters of the two: 0 if none touch, 1 if centre lines meet.
    pub deepest: f64,
    /// The nearest that two strands come, in mean diameters of the two; infinite if none come near.
    pub nearest: f64,
}

/// Overlap that counts, in diameters.
pub const TOLERATED: f64 = 0.05;

/// Along a yarn, nearer than this many diameters is not another strand.
const ALONG: f64 = 2.0;
/// Length of the pieces that are compared, in diameters.
const PIECE: f64 = 0.35;
/// More pieces are not compared: 1.5 GB.
const MOST_PIECES: usize = 1 << 24;

/// A straight piece of a yarn.
#[derive(Clone, Copy)]
struct Piece {
    from: DVec3,
    to: DVec3,
    /// Half of the section's long axis.
    radius: f64,
    /// Along the section's short axis, as long as its ratio to the long one; zero where it is round.
    flattening: DVec3,
    curve: u32,
    /// Distance from the yarn's start to the middle.
    along: f64,
}

impl Piece {
    /// How far the section reaches in a direction.
    fn reach(&self, direction: DVec3) -> f64 {
        let ratio = self.flattening.length_squared();
        if ratio <= 0.0 {
            return self.radius;
        }
        let along = direction.dot(self.flattening).powi(2) / ratio;
        self.radius / (along / ratio + 1.0 - along).max(1e-12).sqrt()
    }
}

/// Measures curves with their radii (one for each control point): for every piece the nearest strand that is not its
/// neighbour along the yarn. `None` where this would take too much memory.
pub fn overlap<'a>(curves: impl Iterator<Item = (&'a Curve, &'a [f64])>) -> Option<Overlap> {
    let mut pieces = Vec::new();
    let mut rings = Vec::new();
    for (index, (curve, radii)) in curves.enumerate() {
        let length = cut(curve, radii, index as u32, &mut pieces);
        rings.push(if curve.closed { length } else { f64::INFINITY });
        if pieces.len() > MOST_PIECES {
            return None;
        }
    }
    let widest = pieces.iter().map(|p| p.radius).fold(0.0, f64::max);
    let longest = pieces.iter().map(|p| p.from.distance(p.to)).fold(0.0, f64::max);
    let middles: Vec<DVec3> = pieces.iter().map(|p| 0.5 * (p.from + p.to)).collect();
    let reach = 2.0 * widest + longest;
    if reach <= 0.0 || !reach.is_finite() {
        return Some(Overlap { length: 0.0, share: 0.0, deepest: 0.0, nearest: f64::INFINITY });
    }
    let grid = PointGrid::new(&middles, reach, None);
    let nearest_of = |walk: &mut Walk<'_>, i: usize| {
        let a = &pieces[i];
        let half = 0.5 * a.from.distance(a.to);
        let mut best = f64::INFINITY;
        walk.within(i, middles[i], reach, |near| {
            let away = middles[i].distance(near.at);
            if away > reach {
                return;
            }
            let b = &pieces[near.index as usize];
            let both = a.radius + b.radius;
            // Farther than what was found already, however they lie: sections reach no farther than their radii.
            if away - half - 0.5 * b.from.distance(b.to) > best * both {
                return;
            }
            if a.curve == b.curve {
                let along = (a.along - b.along).abs();
                if along.min(rings[a.curve as usize] - along) < ALONG * both {
                    return;
                }
            }
            let between = nearest(a.from, a.to, b.from, b.to).between;
            let (distance, way) = (between.length(), between.normalize_or_zero());
            best = best.min(distance / (a.reach(way) + b.reach(way)));
        });
        best as f32
    };
    let all = (0..pieces.len()).into_par_iter().with_min_len(512);
    let found: Vec<f32> = all.map_init(|| grid.walk(), nearest_of).collect();
    let (mut length, mut over, mut near) = (0.0, 0.0, f64::INFINITY);
    for (piece, distance) in pieces.iter().zip(found) {
        let here = piece.from.distance(piece.to);
        length += here;
        near = near.min(distance.into());
        if f64::from(distance) < 1.0 - TOLERATED {
            over += here;
        }
    }
    Some(Overlap {
        length,
        share: if length > 0.0 { over / length } else { 0.0 },
        deepest: (1.0 - near).max(0.0),
        nearest: near,
    })
}

/// Cuts a curve into straight pieces; gives its length.
fn cut(curve: &Curve, radii: &[f64], index: u32, out: &mut Vec<Piece>) -> f64 {
    let chain = Chain::new(curve, radii);
    // Segment i of an open B-spline is near its points i + 1 and i + 2.
    let shift = usize::from(curve.basis == Basis::BSpline && !curve.closed);
    let flattening = |segment: usize| {
        let axes = curve.flattening.as_ref()?;
        axes.get((segment + shift).min(axes.len().checked_sub(1)?)).copied()
    };
    let mut along = 0.0;
    let mut here = chain.at(0, 0.0).at;
    for segment in 0..chain.segments() {
        let end = chain.at(segment, 1.0).at;
        let size = PIECE * 2.0 * here.w.max(1e-300);
        let steps = (end.truncate().distance(here.truncate()) * 1.05 / size).ceil().clamp(1.0, 256.0) as usize;
        for step in 1..=steps {
            let next = chain.at(segment, step as f64 / steps as f64).at;
            let length = next.truncate().distance(here.truncate());
            out.push(Piece {
                from: here.truncate(),
                to: next.truncate(),
                radius: 0.5 * (here.w + next.w),
                flattening: flattening(segment).unwrap_or(DVec3::ZERO),
                curve: index,
                along: along + 0.5 * length,
            });
            along += length;
            here = next;
            if out.len() > MOST_PIECES {
                return along;
            }
        }
    }
    along
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::straight;

    fn measured(curves: &[Curve], radius: f64) -> Overlap {
        let radii: Vec<Vec<f64>> = curves.iter().map(|c| vec![radius; c.points.len()]).collect();
        overlap(curves.iter().zip(&radii).map(|(c, r)| (c, r.as_slice()))).unwrap()
    }

    #[test]
    fn parallel_yarns_overlap_over_their_whole_length_or_not_at_all() {
        let apart = measured(&straight(3, 10.0, 2.2), 1.0);
        assert_eq!((apart.share, apart.deepest), (0.0, 0.0));
        assert!((apart.nearest - 1.1).abs() < 1e-6 && (apart.length - 30.0).abs() < 1e-6);
        let into = measured(&straight(2, 10.0, 1.8), 1.0);
        assert!((into.deepest - 0.1).abs() < 1e-6 && into.share == 1.0);
        let slightly = measured(&straight(2, 10.0, 1.92), 1.0);
        assert!(slightly.share == 0.0 && (slightly.deepest - 0.04).abs() < 1e-6);
        assert_eq!(measured(&straight(2, 10.0, 9.0), 1.0).nearest, f64::INFINITY);
    }

    #[test]
    fn a_crossing_overlaps_where_it_is() {
        let line = |axis: DVec3, z: f64| Curve {
            basis: Basis::CatmullRom,
            closed: false,
            points: (0..41).map(|i| axis * (f64::from(i) - 20.0) + DVec3::Z * z).collect(),
            radii: None,
            flattening: None,
        };
        let found = measured(&[line(DVec3::X, 0.0), line(DVec3::Y, 1.0)], 1.0);
        assert!((found.nearest - 0.5).abs() < 1e-6);
        // Within 1.9 of the other: sqrt(1.9^2 - 1) to both sides, of 40.
        let expected = (1.9_f64 * 1.9 - 1.0).sqrt() / 20.0;
        assert!((found.share - expected).abs() < 0.02, "{} {expected}", found.share);
    }

    #[test]
    fn a_bend_is_no_overlap_but_a_loop_is() {
        let ring = |radius: f64, turns: f64| Curve {
            basis: Basis::CatmullRom,
            closed: false,
            points: (0..=64)
                .map(|i| std::f64::consts::TAU * turns * f64::from(i) / 64.0)
                .map(|a| DVec3::new(radius * a.cos(), radius * a.sin(), 0.01 * a))
                .collect(),
            radii: None,
            flattening: None,
        };
        assert_eq!(measured(&[ring(1.2, 0.5)], 1.0).share, 0.0);
        assert!(measured(&[ring(3.0, 2.0)], 1.0).share > 0.9);
    }
}
