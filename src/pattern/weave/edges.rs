//! How woven cloth ends: cut, with selvedges, with a fringe, or hemmed.
//!
//! At a selvedge the weft turns around a warp of its own (a floating selvedge: over it on the way out, under it on the way
//! back), so that one yarn runs through all wefts. A hem is a piece of cloth at the bottom and at the top that is folded
//! to the back twice, its cut edge inside.

use std::f64::consts::PI;

use glam::DVec3;

use super::{Cloth, PatternStrand, StrandKind, strand};
use crate::math::{sampler::hash2, special::smooth_step};

/// How the cloth ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Edges {
    /// All yarns are cut half a spacing beyond the last crossing.
    Live,
    /// The weft turns at the sides; warps are cut.
    Selvedge,
    /// Selvedges, and warps that go on for this length.
    Fringe(f64),
    /// Selvedges, and hems at the bottom and at the top.
    Finished,
}

/// Points of a turn of the weft.
const TURN: usize = 8;
/// How far a selvedge's warp is from the last one, and how far the weft's ends reach beyond it, in distances from a warp's middle
/// to that of a weft upon it. Yarns that pass between two warps from one side to the other need 1.73 of them.
const BESIDE: f64 = 1.9;
const STUB: f64 = 0.7;
/// Depth of a hem, in thicknesses of the cloth, and that of the part folded in.
const HEM: [f64; 2] = [4.0, 3.0];

/// How much thicker cloth counts where it is folded: yarns inside of a fold are pushed together, and would else lie in each other.
const FOLDED: f64 = 1.3;

/// A point of a yarn: where it is, half its width, its flattening, and its place in the cloth.
pub(super) type Point = (DVec3, f64, DVec3, [f32; 2]);

/// The points of a strand, so that it can be cut and joined.
pub(super) fn points(strand: &PatternStrand) -> Vec<Point> {
    let curve = &strand.curve;
    let radius = |i: usize| curve.radii.as_ref().map_or(0.0, |r| r[i]);
    let flattening = |i: usize| curve.flattening.as_ref().map_or(DVec3::Z, |f| f[i]);
    (0..curve.points.len()).map(|i| (curve.points[i], radius(i), flattening(i), strand.coordinates[i])).collect()
}

pub(super) fn from_points(kind: StrandKind, index: u32, points: &[Point], flat: bool) -> PatternStrand {
    let mut made = strand(kind, index, points.iter().map(|p| (p.0, p.3)));
    if flat {
        made.curve.radii = Some(points.iter().map(|p| p.1).collect());
        made.curve.flattening = Some(points.iter().map(|p| p.2).collect());
    }
    made
}

/// Whether hems at both ends of cloth so high do not reach each other.
pub(super) fn has_room_for_hems(height: f64, thickness: f64) -> bool {
    2.0 * HEM[0] * FOLDED * thickness < height
}

/// Wefts that a hem takes at each end.
pub(super) fn hem_wefts(thickness: f64, spacing: f64) -> u32 {
    let length = FOLDED * thickness * (HEM[0] + HEM[1] + PI + 0.5 * PI);
    (length / spacing).floor() as u32
}

/// Joins all wefts into one that turns around two more warps, one at each side.
pub(super) fn selvedges(cloth: &Cloth<'_>, strands: Vec<PatternStrand>) -> Vec<PatternStrand> {
    let (mut warps, wefts): (Vec<_>, Vec<_>) = strands.into_iter().partition(|s| s.kind == StrandKind::Warp);
    let radius = [cloth.weave.warp_radius, cloth.weave.weft_radius];
    let flat = cloth.weave.sized();
    let nodes = cloth.cell.nodes;
    let reach = radius[0] + radius[1];
    let spacing = cloth.cell.spacing[0];
    let edge = 0.5 * (cloth.size(0) - spacing) + spacing.max(BESIDE * reach);
    // The two warps: straight, round.
    let last = cloth.count[0];
    for (sign, index, place) in [(-1.0, last, -0.5), (1.0, last + 1, last as f32 + 0.5)] {
        let like = points(&warps[0]);
        let straight: Vec<Point> = like
            .iter()
            .map(|(p, _, _, c)| (DVec3::new(sign * edge, p.y, 0.0), radius[0], DVec3::Z, [place, c[1]]))
            .collect();
        warps.push(from_points(StrandKind::Warp, index, &straight, flat));
    }
    // The weft, from the bottom left on.
    let mut way: Vec<Point> = Vec::new();
    for (i, weft) in wefts.iter().enumerate() {
        let mut row = points(weft);
        // Up to the last crossing on both sides.
        row.drain(..nodes / 2);
        row.truncate(row.len() - nodes / 2);
        let out = if i % 2 == 0 { 1.0 } else { -1.0 };
        if out < 0.0 {
            row.reverse();
        }
        if i == 0 {
            let first = row[0];
            let start = DVec3::new(-edge - STUB * reach, first.0.y, reach);
            let over = DVec3::new(-edge, first.0.y, reach);
            way.extend([start, over].map(|p| (p, radius[1], DVec3::Z, [-0.5, first.3[1]])));
            join(&mut way, first, row[1].0 - first.0, nodes);
        }
        way.extend(row);
        let from = *way.last().expect("a row has points");
        let place = if out > 0.0 { last as f32 + 0.5 } else { -0.5 };
        let Some(next) = wefts.get(i + 1) else {
            let over = DVec3::new(out * edge, from.0.y, reach);
            join(&mut way, (over, radius[1], DVec3::Z, [place, from.3[1]]), out * DVec3::X, nodes);
            let end = DVec3::new(out * (edge + STUB * reach), from.0.y, reach);
            way.push((over, radius[1], DVec3::Z, [place, from.3[1]]));
            way.push((end, radius[1], DVec3::Z, [place, from.3[1]]));
            break;
        };
        let mut there = points(next);
        there.drain(..nodes / 2);
        there.truncate(there.len() - nodes / 2);
        if out > 0.0 {
            there.reverse();
        }
        let (to, onwards) = (there[0], there[1].0 - there[0].0);
        let turn = |k: usize| {
            let angle = PI * (k as f64 / TURN as f64 - 0.5);
            let share = 0.5 + 0.5 * angle.sin();
            let p = DVec3::new(
                out * (edge + reach * angle.cos()),
                from.0.y + share * (to.0.y - from.0.y),
                -reach * angle.sin(),
            );
            (p, radius[1], DVec3::Z, [place, if 2 * k < TURN { from.3[1] } else { to.3[1] }])
        };
        join(&mut way, turn(0), out * DVec3::X, nodes);
        way.extend((0..=TURN).map(turn));
        join(&mut way, to, onwards, nodes);
    }
    warps.push(from_points(StrandKind::Weft, 0, &way, flat));
    warps
}

/// Leads the way on to `to`, without it, and arrives in the direction `onwards`.
fn join(way: &mut Vec<Point>, to: Point, onwards: DVec3, nodes: usize) {
    let [.., before, from] = way[..] else { return };
    let steps = nodes.max(2);
    let length = from.0.distance(to.0);
    let [a, b] = [from.0 - before.0, onwards].map(|d| d.normalize_or_zero() * length);
    for k in 1..steps {
        let s = k as f64 / steps as f64;
        let t = 1.0 - s;
        // Hermite's cubic.
        let p = t * t * ((1.0 + 2.0 * s) * from.0 + s * a) + s * s * ((1.0 + 2.0 * t) * to.0 - t * b);
        let coordinates = if s < 0.5 { from.3 } else { to.3 };
        way.push((p, from.1 + s * (to.1 - from.1), from.2.lerp(to.2, s), coordinates));
    }
}

/// Lets warps go on beyond both ends, each its own way.
pub(super) fn fringe(cloth: &Cloth<'_>, strands: &mut [PatternStrand], length: f64) {
    let (spacing, radius) = (cloth.cell.spacing[0], cloth.weave.warp_radius);
    let flat = cloth.weave.sized();
    let step = 1.2 * radius;
    let steps = (length / step).ceil().max(2.0) as usize;
    for strand in strands.iter_mut().filter(|s| s.kind == StrandKind::Warp) {
        let mut way = points(strand);
        for end in 0..2 {
            if end == 0 {
                way.reverse();
            }
            let last = way[way.len() - 1];
            let away = if end == 0 { -1.0 } else { 1.0 };
            let random = |k: u32| f64::from(hash2(strand.index, 2 * k + end) >> 8) / f64::from(1u32 << 24) - 0.5;
            let (lean, bend, lift, cut) = (random(1), random(2), random(3), 1.0 + 0.15 * random(4));
            let aim = 0.15 * radius - last.0.z;
            for k in 1..=steps {
                let s = k as f64 / steps as f64;
                let ease = smooth_step(s);
                let aside = spacing * (0.5 * lean * s + 0.7 * bend * (PI * s).sin()) * s;
                let height = aim * ease.min(1.0) + 1.4 * radius * lift * ease;
                let p = last.0 + DVec3::new(aside, away * length * cut * s, height);
                way.push((p, last.1 + s * (radius - last.1), last.2.lerp(DVec3::Z, s), last.3));
            }
            if end == 0 {
                way.reverse();
            }
        }
        *strand = from_points(StrandKind::Warp, strand.index, &way, flat);
    }
}

/// Folds everything beyond `half` the height to the back, twice.
pub(super) fn hem(strands: &mut [PatternStrand], half: f64, thickness: f64) {
    let fold = Fold { half, thickness: FOLDED * thickness };
    for strand in strands {
        let flattening = strand.curve.flattening.as_mut();
        if let Some(axes) = flattening {
            for (axis, p) in axes.iter_mut().zip(&strand.curve.points) {
                *axis = fold.turn(p.y, *axis);
            }
        }
        for p in &mut strand.curve.points {
            *p = fold.place(*p);
        }
    }
}

/// The way of a hem in the plane of y and z.
struct Fold {
    half: f64,
    thickness: f64,
}

impl Fold {
    /// At a distance beyond the edge: y beyond it, z, and how far the cloth has turned.
    fn at(&self, s: f64) -> (f64, f64, f64) {
        let t = self.thickness;
        let [back, _] = HEM.map(|h| h * t);
        let (first, second) = (PI * t, PI * 0.5 * t);
        if s <= first {
            let angle = s / t;
            return (t * angle.sin(), -t * (1.0 - angle.cos()), angle);
        }
        let s = s - first;
        if s <= back {
            return (-s, -2.0 * t, PI);
        }
        let s = s - back;
        if s <= second {
            let angle = s / (0.5 * t);
            return (-back - 0.5 * t * angle.sin(), -2.0 * t + 0.5 * t * (1.0 - angle.cos()), PI + angle);
        }
        (-back + (s - second), -t, 2.0 * PI)
    }

    fn turn(&self, y: f64, v: DVec3) -> DVec3 {
        let beyond = y.abs() - self.half;
        if beyond <= 0.0 {
            return v;
        }
        let (sin, cos) = self.at(beyond).2.sin_cos();
        let side = y.signum();
        // Outwards and up turn towards down and inwards.
        let (out, up) = (v.y * side, v.z);
        DVec3::new(v.x, side * (out * cos + up * sin), up * cos - out * sin)
    }

    fn place(&self, p: DVec3) -> DVec3 {
        let beyond = p.y.abs() - self.half;
        if beyond <= 0.0 {
            return p;
        }
        let (y, z, angle) = self.at(beyond);
        let side = p.y.signum();
        DVec3::new(p.x, side * (self.half + y + p.z * angle.sin()), z + p.z * angle.cos())
    }
}
