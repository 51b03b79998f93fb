//! How woven cloth ends: cut, with selvedges, with a fringe, or hemmed.
//!
//! At a selvedge the weft turns around the outermost warp, over it on one way and under it on the other, so that one yarn
//! runs through all wefts. Only a plain weave holds each turn by itself; other cloth is woven plain over some more warps at its
//! sides. A hem is a piece of cloth at the bottom and at the top that is folded
//! to the back twice, its cut edge inside.

use std::f64::consts::PI;

use glam::DVec3;

use super::{Cloth, Draft, PatternStrand, StrandKind, Threads, UnitCell, Weave, strand};
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
const TURN: usize = 12;
/// Warps that a selvedge adds at each side.
const ENDS: u32 = 3;
/// Distance of picks, in diameters, below which two lie in one shed of a selvedge.
const RIB: f64 = 1.42;
/// Distance of a selvedge's warps over that at which they jam.
const SLACK: f64 = 1.05;
/// How far a turn's middle reaches out from that of the outermost warp, in distances of yarns that touch.
const BESIDE: f64 = 1.02;
/// How far the weft's ends stand out, of that.
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

/// Joins all wefts into one. Where the draft itself does not hold each turn, some warps at both sides are woven plain instead,
/// or as a rib of two picks where picks are too close for that. They are as close as these picks let them be, and as many
/// of the cloth's own are left out as stood in their place.
pub(super) fn selvedges(cloth: &Cloth<'_>, strands: Vec<PatternStrand>, hem: u32) -> Vec<PatternStrand> {
    let (mut warps, wefts): (Vec<_>, Vec<_>) = strands.into_iter().partition(|s| s.kind == StrandKind::Warp);
    let flat = cloth.weave.sized();
    let nodes = cloth.cell.nodes;
    let firm = holds_its_turns(cloth);
    // Both sides are as wide: theirs is one weave, begun elsewhere.
    let spacing = if firm { 0.0 } else { edge_spacing(cloth) };
    let taken = if firm { 0 } else { taken(cloth, spacing) };
    let weaves = (!firm).then(|| [false, true].map(|right| edge_weave(cloth, right, taken, hem, spacing)));
    let edges = weaves.as_ref().map(|weaves| [0, 1].map(|side| Edge::new(cloth, &weaves[side], side == 1, taken)));
    if let Some(edges) = &edges {
        warps.retain(|s| (taken..cloth.count[0] - taken).contains(&s.index));
        warps.extend(edges.iter().flat_map(|edge| (0..ENDS).map(|i| edge.warp(i, hem))));
    }
    // From crossing to crossing, from the left.
    let inner = |strand: &PatternStrand| {
        let points = points(strand);
        let off = nodes / 2 + taken as usize * nodes;
        points[off..points.len() - off].to_vec()
    };
    let row = |i: usize| {
        let Some(edges) = &edges else { return inner(&wefts[i]) };
        let mut parts = [edges[0].weft(i as u32, hem), inner(&wefts[i]), edges[1].weft(i as u32, hem)].into_iter();
        let mut way = parts.next().unwrap_or_default();
        for part in parts {
            let onwards = if part.len() > 1 { part[1].0 - part[0].0 } else { DVec3::X };
            join(&mut way, part[0], onwards, nodes);
            way.extend(part);
        }
        way
    };
    // The weft, from the bottom left on.
    let outermost = edges.as_ref().map_or(&cloth.cell, |edges| &edges[0].cloth.cell);
    let widths: Vec<f64> = outermost.yarns[0].iter().flatten().map(|node| node.axes[0]).collect();
    let wide = widths.iter().sum::<f64>() / widths.len().max(1) as f64;
    let beside = BESIDE * (wide + cloth.weave.weft_radius);
    let stub = |last: Point, out: f64| (last.0 + DVec3::X * (out * STUB * beside), last.1, last.2, last.3);
    let mut way: Vec<Point> = Vec::new();
    for i in 0..wefts.len() {
        let mut row = row(i);
        let out = if i % 2 == 0 { 1.0 } else { -1.0 };
        if out < 0.0 {
            row.reverse();
        }
        match way.last() {
            Some(&from) => turn(&mut way, from, row[0], -out * beside, cloth.weave.weft_radius),
            None => way.push(stub(row[0], -1.0)),
        }
        way.extend(row);
        if i + 1 == wefts.len() {
            way.push(stub(way[way.len() - 1], out));
        }
    }
    warps.push(from_points(StrandKind::Weft, 0, &way, flat));
    warps
}

/// Around the outermost warp from one pick to the next, without both: half an ellipse that reaches out by `out`.
fn turn(way: &mut Vec<Point>, from: Point, to: Point, out: f64, radius: f64) {
    let (middle, half) = (0.5 * (from.0 + to.0), 0.5 * (to.0 - from.0));
    // Round, so that any axis across the turn will do.
    let axis = DVec3::X.cross(half).normalize_or(DVec3::Z);
    way.extend((1..TURN).map(|k| {
        let (sin, cos) = (PI * k as f64 / TURN as f64).sin_cos();
        let p = middle - cos * half + out * sin * DVec3::X;
        (p, radius, axis, if 2 * k < TURN { from.3 } else { to.3 })
    }));
}

/// Whether both outermost warps change sides after each pick, as those of a plain weave.
fn holds_its_turns(cloth: &Cloth<'_>) -> bool {
    let draft = &cloth.weave.draft;
    let changes = |warp: usize| (0..draft.wefts()).all(|i| draft.warp_over(i, warp) != draft.warp_over(i + 1, warp));
    draft.layers() == 1
        && !draft.twines()
        && draft.pile().is_none()
        && draft.wefts() > 1
        && changes(0)
        && changes(cloth.count[0] as usize - 1)
}

/// Warps of each side in whose place selvedges are, so that the cloth stays as wide; at least one is left between them.
fn taken(cloth: &Cloth<'_>, spacing: f64) -> u32 {
    let taken = (f64::from(ENDS) * spacing / cloth.cell.spacing[0]).round() as u32;
    taken.min((cloth.count[0] - 1) / 2)
}

/// Whether picks are so close that two lie in one shed of a selvedge.
fn is_rib(cloth: &Cloth<'_>) -> bool {
    cloth.cell.spacing[1] < RIB * (cloth.weave.warp_radius + cloth.weave.weft_radius)
}

/// A weave of the cloth's yarns with its picks.
fn with_picks(cloth: &Cloth<'_>, draft: Draft, warp_spacing: Option<f64>) -> Weave {
    let picks = Threads { thickness: Vec::new(), spacing: cloth.weave.threads[1].spacing.clone() };
    Weave {
        draft,
        warp_spacing,
        weft_spacing: Some(cloth.cell.spacing[1]),
        cover: None,
        crimp: None,
        threads: [Threads::default(), picks],
        ..cloth.weave.clone()
    }
}

/// Distance of the warps of a selvedge: a little more than that at which they jam.
fn edge_spacing(cloth: &Cloth<'_>) -> f64 {
    let jammed = with_picks(cloth, Draft::selvedge(if is_rib(cloth) { 2 } else { 1 }, 1, false), None);
    SLACK * UnitCell::relax(&jammed.draft, &jammed.options()).spacing[0]
}

/// The weave of a selvedge beside the warps that are not `taken`, its own `spacing` apart. `hem` picks come before the first.
fn edge_weave(cloth: &Cloth<'_>, right: bool, taken: u32, hem: u32, spacing: f64) -> Weave {
    let weave = cloth.weave;
    // The weft turns right after even picks, left after odd ones; there the sheds of a rib must change.
    let first = hem as usize + usize::from(right);
    let draft = |inverted| Draft::selvedge(if is_rib(cloth) { 2 } else { 1 }, first, inverted);
    // Most yarns change sides where the cloth begins: floats end there.
    let (own, beside) = if right { (0, cloth.count[0] - 1 - taken) } else { (ENDS as usize - 1, taken) };
    let changes = |draft: &Draft| {
        let rows = 0..(4 * weave.draft.wefts()).min(1024);
        rows.filter(|&i| draft.warp_over(i, own) != weave.draft.warp_over(i, beside as usize)).count()
    };
    let [straight, inverted] = [false, true].map(draft);
    let draft = if changes(&straight) < changes(&inverted) { inverted } else { straight };
    with_picks(cloth, draft, Some(spacing))
}

/// The warps of a selvedge and their part of the wefts.
struct Edge<'a> {
    cloth: Cloth<'a>,
    /// Thickness of wefts over the mean, in turns.
    thickness: &'a [f64],
    /// Along x, and in numbers of warps.
    shift: (f64, i64),
}

impl<'a> Edge<'a> {
    fn new(body: &Cloth<'a>, weave: &'a Weave, right: bool, taken: u32) -> Self {
        let cell = UnitCell::relax(&weave.draft, &weave.options());
        let spacing = cell.spacing[0];
        let cloth = Cloth { weave, cell, count: [ENDS, body.count[1]] };
        let last = i64::from(if right { body.count[0] - 1 - taken } else { taken });
        let thickness = &body.weave.threads[0].thickness;
        let thicker = thickness.get(last.rem_euclid(thickness.len().max(1) as i64) as usize).map_or(0.0, |t| t - 1.0);
        let beside = spacing + thicker.max(0.0) * weave.warp_radius;
        let out = beside + 0.5 * f64::from(ENDS - 1) * spacing;
        let at = body.position(0, last as f64 + 0.5);
        let first = if right { last + 1 } else { last - i64::from(ENDS) };
        let shift = (if right { at + out } else { at - out }, first);
        Self { cloth, thickness: &body.weave.threads[1].thickness, shift }
    }

    fn moved(&self, strand: &PatternStrand, thickness: f64) -> Vec<Point> {
        let moved = |(p, radius, axis, [x, y]): Point| {
            (p + DVec3::X * self.shift.0, radius * thickness, axis, [x + self.shift.1 as f32, y])
        };
        points(strand).into_iter().map(moved).collect()
    }

    fn warp(&self, number: u32, hem: u32) -> PatternStrand {
        let strand = self.cloth.strand(0, number, hem);
        let index = (self.shift.1 + i64::from(number)).max(0) as u32;
        from_points(StrandKind::Warp, index, &self.moved(&strand, 1.0), self.cloth.weave.sized())
    }

    /// From the first crossing to the last.
    fn weft(&self, index: u32, hem: u32) -> Vec<Point> {
        let number = i64::from(index) - i64::from(hem);
        let count = self.thickness.len().max(1) as i64;
        let thickness = self.thickness.get(number.rem_euclid(count) as usize).copied().unwrap_or(1.0);
        let mut points = self.moved(&self.cloth.strand(1, index, hem), thickness);
        let half = self.cloth.cell.nodes / 2;
        points.drain(..half);
        points.truncate(points.len() - half);
        points
    }
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
