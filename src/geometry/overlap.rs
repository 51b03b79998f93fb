//! How far yarns run into each other.

use glam::DVec3;
use rayon::prelude::*;

use super::contact::{PointGrid, Walk, nearest};
use crate::geometry::{
    chain::Chain,
    curve::{Basis, Curve},
    yarn_frame::NEARLY_ROUND,
};

/// How far yarns run into each other. Diameters are those of round yarns with the same area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// Length of all yarns.
    pub length: f64,
    /// Share of the length that overlaps another strand by more than [`TOLERATED`] of the mean diameter.
    pub share: f64,
    /// The deepest overlap, in mean diameters of the two: 0 if none touch, 1 if centre lines of round yarns meet.
    pub deepest: f64,
    /// The nearest that two strands come, in mean diameters of the two: distance of centre lines where yarns are round, else 1
    /// and the gap between surfaces; infinite if none come near.
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
    /// Along the section's long axis; its square is the difference of both squared half axes. Zero where it is round.
    wider: DVec3,
    /// Radius of the circle that has the section's area.
    round: f64,
    curve: u32,
    /// Distance from the yarn's start to the middle.
    along: f64,
}

impl Piece {
    /// Half of the section's short axis.
    fn short(&self) -> f64 {
        (self.radius * self.radius - self.wider.length_squared()).max(0.0).sqrt()
    }

    fn is_round(&self) -> bool {
        self.wider == DVec3::ZERO
    }
}

/// How near two sections come whose centres are `way` apart, as [`Overlap::nearest`]. Each stands for an ellipsoid that is as
/// high along the yarn as it is across its broad side, which a bent yarn contains. Two touch when the greatest value over
/// s of s (1 - s) w' [(1 - s) A + s B]^-1 w is 1, with w the way and A and B their matrices (Perram and Wertheim,
/// "Statistical mechanics of hard ellipsoids", 1985); [..]^-1 w is then normal to both.
fn between_pressed(a: &Piece, b: &Piece, way: DVec3) -> f64 {
    const ROUNDS: usize = 12;
    const SETTLED: f64 = 1e-4;
    let (high_a, high_b) = (a.short().powi(2), b.short().powi(2));
    let reach = |high: f64, wider: DVec3, n: DVec3| (high * n.length_squared() + wider.dot(n).powi(2)).sqrt();
    let both = a.round + b.round;
    let mut s = a.round / both;
    for round in 1.. {
        // (1 - s) A + s B is `even` times the identity, and u u' + v v'.
        let even = ((1.0 - s) * high_a + s * high_b).max(1e-300);
        let (u, v) = ((1.0 - s).sqrt() * a.wider, s.sqrt() * b.wider);
        let (uu, uv, vv) = (even + u.length_squared(), u.dot(v), even + v.length_squared());
        let (p, q, det) = (u.dot(way), v.dot(way), uu * vv - uv * uv);
        let n = (way - u * ((vv * p - uv * q) / det) - v * ((uu * q - uv * p) / det)) / even;
        let (reach_a, reach_b) = (reach(high_a, a.wider, n), reach(high_b, b.wider, n));
        let reached = reach_a + reach_b;
        if reached <= 0.0 {
            break;
        }
        // At the greatest value both reach as far as their shares.
        let next = reach_a / reached;
        if (next - s).abs() < SETTLED || round == ROUNDS {
            let apart = (s * (1.0 - s) * way.dot(n)).max(0.0).sqrt();
            // A way of nearly no length need not be the shortest out of each other.
            return (1.0 + (apart - 1.0) * reached / (n.length() * both)).max(0.0);
        }
        s = next;
    }
    // Centre lines meet: out of each other across the broad sides.
    (1.0 - (high_a.sqrt() + high_b.sqrt()) / both).max(0.0)
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
            let round = a.is_round() && b.is_round();
            // Farther than what was found already, however they lie: sections reach no farther than their radii.
            let least = (away - half - 0.5 * b.from.distance(b.to)) / both;
            let rounds = a.round + b.round;
            let nearest_pressed = |gap: f64| 1.0 + gap / rounds;
            let hopeless = if round { least > best } else { nearest_pressed((least - 1.0) * both) > best };
            if hopeless || best <= 0.0 {
                return;
            }
            if a.curve == b.curve {
                let along = (a.along - b.along).abs();
                if along.min(rings[a.curve as usize] - along) < ALONG * both {
                    return;
                }
            }
            let between = nearest(a.from, a.to, b.from, b.to).between;
            let length = between.length();
            if round {
                best = best.min(length / both);
            } else if nearest_pressed(length - both) <= best {
                best = best.min(between_pressed(a, b, between));
            }
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
    let wider = |segment: usize, u: f64, along: DVec3, radius: f64| {
        let axes = curve.flattening.as_deref().filter(|axes| !axes.is_empty())?;
        let point = |i: usize| axes[if curve.closed { i % axes.len() } else { i.min(axes.len() - 1) }];
        let (from, to) = (point(segment + shift), point(segment + shift + 1));
        // An axis has no sign.
        let to = if from.dot(to) < 0.0 { -to } else { to };
        let ratio = from.length() + u * (to.length() - from.length());
        if ratio > f64::from(NEARLY_ROUND) {
            return None;
        }
        let long = along.cross(from.lerp(to, u)).try_normalize()?;
        Some(long * (radius * (1.0 - ratio * ratio).sqrt()))
    };
    let mut along = 0.0;
    let mut here = chain.at(0, 0.0).at;
    for segment in 0..chain.segments() {
        let end = chain.at(segment, 1.0).at;
        let size = PIECE * 2.0 * here.w.max(1e-300);
        let steps = (end.truncate().distance(here.truncate()) * 1.05 / size).ceil().clamp(1.0, 256.0) as usize;
        for step in 1..=steps {
            let next = chain.at(segment, step as f64 / steps as f64).at;
            let way = next.truncate() - here.truncate();
            let (length, radius, u) = (way.length(), 0.5 * (here.w + next.w), (step as f64 - 0.5) / steps as f64);
            let wider = wider(segment, u, way, radius).unwrap_or(DVec3::ZERO);
            let piece = Piece {
                from: here.truncate(),
                to: next.truncate(),
                radius,
                wider,
                round: radius,
                curve: index,
                along: along + 0.5 * length,
            };
            out.push(Piece { round: (radius * piece.short()).sqrt(), ..piece });
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
mod tests;
