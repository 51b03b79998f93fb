//! How far yarns run into each other.

use std::{
    borrow::Cow,
    collections::BTreeMap,
    ops::Range,
    sync::atomic::{AtomicU32, Ordering::Relaxed},
};

use glam::DVec3;
use rayon::prelude::*;

use super::contact::{PointGrid, nearest};
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
/// Pieces that one thread takes at once.
const CHUNK: usize = 512;
/// Stretches of a curve that are cut before their pieces are put together: few, so that memory is used again.
const AT_ONCE: usize = 16;
/// So many tell a share of a twentieth to a hundredth of itself, or nearly.
const ENOUGH: u32 = 1 << 14;
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
    fn middle(&self) -> DVec3 {
        0.5 * (self.from + self.to)
    }

    fn length(&self) -> f64 {
        self.from.distance(self.to)
    }

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
    overlap_of_plied(curves.map(|(curve, radii)| (curve, radii, 1.0)))
}

/// As [`overlap`] of yarns which in the mean are narrower than their radii, each by a factor: see
/// [`mean_half_width`](super::yarn::mean_half_width).
pub fn overlap_of_plied<'a>(curves: impl Iterator<Item = (&'a Curve, &'a [f64], f64)>) -> Option<Overlap> {
    let (pieces, rings) = pieces(curves)?;
    Some(Overlap::of(&pieces, &rings, Looked::All))
}

/// About the same, by one in eight pieces, and of many by [`ENOUGH`]: to warn of much.
pub fn sampled_overlap<'a>(curves: impl Iterator<Item = (&'a Curve, &'a [f64], f64)>) -> Option<Overlap> {
    let (pieces, rings) = pieces(curves)?;
    Some(Overlap::of(&pieces, &rings, Looked::OneIn((pieces.len() as u32 / ENOUGH).max(8))))
}

/// The pieces that are looked at.
#[derive(Clone, Copy, PartialEq)]
enum Looked {
    All,
    /// One in so many, at steps that fall in with no period of the cloth.
    OneIn(u32),
}

impl Looked {
    fn at(self, index: usize) -> bool {
        match self {
            Self::All => true,
            // The golden ratio, in 32 bits.
            Self::OneIn(many) => (index as u32).wrapping_mul(0x9e37_79b1) < u32::MAX / many,
        }
    }
}

impl Overlap {
    /// Of the pieces that are looked at.
    fn of(pieces: &[Piece], rings: &[f64], looked: Looked) -> Self {
        let found = Near::of(pieces, rings, looked);
        let (mut length, mut over, mut near) = (0.0, 0.0, f64::INFINITY);
        for (_, (piece, distance)) in pieces.iter().zip(found).enumerate().filter(|(i, _)| looked.at(*i)) {
            let (here, distance) = (piece.length(), f64::from(f32::from_bits(distance.into_inner())));
            length += here;
            near = near.min(distance);
            if distance < 1.0 - TOLERATED {
                over += here;
            }
        }
        let share = if length > 0.0 { over / length } else { 0.0 };
        Self { length, share, deepest: (1.0 - near).max(0.0), nearest: near }
    }
}

/// Curves as straight pieces, and the length of each that is closed; infinite of others.
fn pieces<'a>(curves: impl Iterator<Item = (&'a Curve, &'a [f64], f64)>) -> Option<(Vec<Piece>, Vec<f64>)> {
    let mut pieces = Vec::new();
    let mut rings = Vec::new();
    for (index, (curve, radii, half_width)) in curves.enumerate() {
        let radii: Cow<'_, [f64]> = match half_width {
            1.0 => Cow::Borrowed(radii),
            _ => radii.iter().map(|r| r * half_width).collect(),
        };
        let length = cut(curve, &radii, index as u32, &mut pieces);
        rings.push(if curve.closed { length } else { f64::INFINITY });
        if pieces.len() > MOST_PIECES {
            return None;
        }
    }
    Some((pieces, rings))
}

/// Looks for the nearest other strand of all pieces.
struct Near<'a> {
    pieces: &'a [Piece],
    /// Length of each curve that is closed; infinite of others.
    rings: &'a [f64],
    /// How near another one comes to each: bits of a number that is not negative, which are in the order of the numbers.
    found: Vec<AtomicU32>,
}

impl<'a> Near<'a> {
    /// How near another strand comes to each piece, in mean diameters: bits of single precision. Of pieces that are
    /// looked at: to others one may come nearer.
    fn of(pieces: &'a [Piece], rings: &'a [f64], looked: Looked) -> Vec<AtomicU32> {
        let found = pieces.iter().map(|_| AtomicU32::new(f32::INFINITY.to_bits())).collect();
        let near = Self { pieces, rings, found };
        // By thickness, so that a thin piece does not look at all within reach of a thick one. Where few look, they do.
        let class = |piece: &Piece| if looked == Looked::All { piece.radius.log2().floor() as i32 } else { 0 };
        let mut classes: BTreeMap<i32, Vec<usize>> = BTreeMap::new();
        for (i, piece) in pieces.iter().enumerate().filter(|(_, piece)| piece.radius > 0.0 && piece.radius.is_finite())
        {
            classes.entry(class(piece)).or_default().push(i);
        }
        // Longer pieces of thin yarns count for thick ones too.
        let mut longest = 0.0;
        for (class, members) in &classes {
            let most = |of: fn(&Piece) -> f64| members.iter().map(|&i| of(&pieces[i])).fold(0.0, f64::max);
            longest = f64::max(longest, most(Piece::length));
            let reach = 2.0 * most(|piece| piece.radius) + longest;
            if !reach.is_finite() {
                continue;
            }
            let middles: Vec<DVec3> = members.iter().map(|&i| pieces[i].middle()).collect();
            let grid = PointGrid::new(&middles, reach, None);
            // Every piece within reach of those that look, each by itself.
            let look = |looking: &[usize]| {
                looking.par_iter().with_min_len(CHUNK).for_each_init(
                    || grid.walk(),
                    |walk, &own| {
                        walk.within(pieces[own].middle(), reach, |other| {
                            near.pair(own, members[other.index as usize], reach);
                        });
                    },
                );
            };
            if looked != Looked::All {
                look(&members.iter().copied().filter(|&own| looked.at(own)).collect::<Vec<_>>());
                continue;
            }
            (0..members.len()).into_par_iter().with_min_len(CHUNK).for_each_init(
                || grid.walk_ahead(),
                |walk, own| {
                    walk.within(middles[own], reach, |other| {
                        let other = other.index as usize;
                        if other > own || !grid.share_cell(own, other) {
                            near.pair(members[own], members[other], reach);
                        }
                    });
                },
            );
            classes.range(..class).for_each(|(_, thinner)| look(thinner));
        }
        near.found
    }

    /// Looks how near two pieces are, unless their middles are farther apart than `reach`.
    fn pair(&self, i: usize, j: usize, reach: f64) {
        let (a, b) = (&self.pieces[i], &self.pieces[j]);
        let away = a.middle().distance(b.middle());
        if i == j || away > reach {
            return;
        }
        // What is known of the one that is farther from all others.
        let known = [i, j].map(|k| f32::from_bits(self.found[k].load(Relaxed)));
        let best = f64::from(known[0].max(known[1]));
        let both = a.radius + b.radius;
        let round = a.is_round() && b.is_round();
        // Farther than what was found already, however they lie: sections reach no farther than their radii.
        let least = (away - 0.5 * (a.length() + b.length())) / both;
        let rounds = a.round + b.round;
        let nearest_pressed = |gap: f64| 1.0 + gap / rounds;
        let hopeless = if round { least > best } else { nearest_pressed((least - 1.0) * both) > best };
        if hopeless || best <= 0.0 {
            return;
        }
        if a.curve == b.curve {
            let along = (a.along - b.along).abs();
            if along.min(self.rings[a.curve as usize] - along) < ALONG * both {
                return;
            }
        }
        let between = nearest(a.from, a.to, b.from, b.to).between;
        let length = between.length();
        let distance = if round {
            length / both
        } else if nearest_pressed(length - both) <= best {
            between_pressed(a, b, between)
        } else {
            return;
        };
        // The least of all, in whatever order they come.
        for k in [i, j] {
            self.found[k].fetch_min((distance as f32).to_bits(), Relaxed);
        }
    }
}

/// Cuts a curve into straight pieces; gives its length.
fn cut(curve: &Curve, radii: &[f64], index: u32, out: &mut Vec<Piece>) -> f64 {
    let chain = Chain::new(curve, radii);
    // Segment i of an open B-spline is near its points i + 1 and i + 2.
    let shift = usize::from(curve.basis == Basis::BSpline && !curve.closed);
    let wider = |segment: usize, u: f64, along: DVec3, radius: f64| {
        let axes = curve.flattening.as_deref().filter(|axes| !axes.is_empty())?;
        let point = |i: usize| axes[if curve.closed { i % axes.len() } else { i.min(axes.len() - 1) }].as_dvec3();
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
    // The pieces of some segments, as if the curve began with them, and their length.
    let pieces_of = |segments: Range<usize>| {
        let mut own = Vec::with_capacity(2 * segments.len());
        let mut along = 0.0;
        let mut here = chain.at(segments.start, 0.0).at;
        for segment in segments {
            let end = chain.at(segment, 1.0).at;
            let size = PIECE * 2.0 * here.w.max(1e-300);
            let steps = (end.truncate().distance(here.truncate()) * 1.05 / size).ceil().clamp(1.0, 256.0) as usize;
            for step in 1..=steps {
                let next = chain.at(segment, step as f64 / steps as f64).at;
                let way = next.truncate() - here.truncate();
                let (length, radius, u) = (way.length(), 0.5 * (here.w + next.w), (step as f64 - 0.5) / steps as f64);
                let piece = Piece {
                    from: here.truncate(),
                    to: next.truncate(),
                    radius,
                    wider: wider(segment, u, way, radius).unwrap_or(DVec3::ZERO),
                    round: radius,
                    curve: index,
                    along: along + 0.5 * length,
                };
                own.push(Piece { round: (radius * piece.short()).sqrt(), ..piece });
                along += length;
                here = next;
            }
        }
        (own, along)
    };
    let (count, mut along) = (chain.segments(), 0.0);
    let stretches: Vec<_> = (0..count).step_by(CHUNK).map(|start| start..(start + CHUNK).min(count)).collect();
    for at_once in stretches.chunks(AT_ONCE) {
        let parts: Vec<(Vec<Piece>, f64)> = at_once.par_iter().map(|segments| pieces_of(segments.clone())).collect();
        for (pieces, length) in parts {
            out.extend(pieces.into_iter().map(|piece| Piece { along: along + piece.along, ..piece }));
            along += length;
        }
        if out.len() > MOST_PIECES {
            break;
        }
    }
    along
}

#[cfg(test)]
mod tests;
