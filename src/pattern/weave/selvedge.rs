//! Selvedges: the weft turns around the outermost warp, over it on one way and under it on the other, so that one yarn runs
//! through all wefts.
//!
//! Only a plain weave holds each turn by itself. In other cloth the outermost warp floats free of the harness, as weavers let
//! it: each pick goes over it at one side and under it at the other. It is relaxed together with the warps beside it, so
//! that these give way. Cloth that stands up or twines is woven plain over some more warps at its sides instead.

use std::f64::consts::PI;

use glam::DVec3;

use super::{
    Cloth, Draft, PatternStrand, StrandKind, Threads, Weave,
    edges::{Point, from_points, points},
    unit_cell::{CellOptions, Node, UnitCell},
};
use crate::math::special::{hermite, smooth_step};

/// Points of a turn of the weft.
const TURN: usize = 12;
/// Warps of a selvedge that is woven plain.
const PLAIN: u32 = 3;
/// Warps of the cloth that give way to one that floats.
const GIVING: u32 = 3;
/// Warps beside these that stay where they are, and hold them.
const HOLDING: u32 = 2;
/// Distance of picks, in diameters, below which two lie in one shed of a selvedge.
const RIB: f64 = 1.42;
/// Distance of a selvedge's warps over that at which they jam.
const SLACK: f64 = 1.05;
/// Thickness of the warp that stands for the turns of wefts while a selvedge is relaxed.
const OUTSIDE: f64 = 0.25;
/// How far a turn's middle reaches out from that of the outermost warp, in distances of yarns that touch.
const BESIDE: f64 = 1.02;
/// How far the weft's ends stand out, of that.
const STUB: f64 = 0.6;

/// Joins all wefts into one. Where the draft itself does not hold each turn, the outermost warp floats. Cloth that twines or stands
/// up, and cloth of few warps, is woven plain over [`PLAIN`] warps instead, or as a rib of two picks where picks are too
/// close for that; these are as close as the picks let them be, and as many of the cloth's own are left out as stood there.
pub(super) fn selvedges(cloth: &Cloth<'_>, strands: Vec<PatternStrand>, hem: u32) -> Vec<PatternStrand> {
    let (mut warps, wefts): (Vec<_>, Vec<_>) = strands.into_iter().partition(|s| s.kind == StrandKind::Warp);
    let plan = (!holds_its_turns(cloth)).then(|| Plan::of(cloth));
    let weave = plan.as_ref().map(|plan| plan.weave(cloth, hem));
    let sides = plan.zip(weave.as_ref()).map(|(plan, weave)| Sides::new(cloth, plan, weave, hem));
    if let Some(sides) = &sides {
        warps = sides.warps(warps);
    }
    let row = |i: usize| match &sides {
        Some(sides) => sides.weft(i as u32, &points(&wefts[i])),
        None => from_crossing_to_crossing(&points(&wefts[i]), 0, cloth.cell.nodes).to_vec(),
    };
    let outermost = outermost(&warps);
    let radius = cloth.weave.half_rooms[1];
    // The weft, from the bottom left on.
    let mut way: Vec<Point> = Vec::new();
    for i in 0..wefts.len() {
        let mut row = row(i);
        let right = i % 2 == 0;
        if !right {
            row.reverse();
        }
        match way.last() {
            Some(&from) => turn(&mut way, from, row[0], &outermost[usize::from(!right)], radius),
            None => way.push(stub(row[0], &outermost[usize::from(!right)], radius)),
        }
        way.extend(row);
        if i + 1 == wefts.len() {
            way.push(stub(way[way.len() - 1], &outermost[usize::from(right)], radius));
        }
    }
    warps.push(from_points(StrandKind::Weft, 0, &way, cloth.weave.sized()));
    warps
}

/// A weft without so many warps at both sides.
fn from_crossing_to_crossing(way: &[Point], without: u32, nodes: usize) -> &[Point] {
    let off = without as usize * nodes + nodes / 2;
    &way[off..way.len() - off]
}

/// The warps farthest to the left and to the right, and to which side each is.
fn outermost(warps: &[PatternStrand]) -> [(f64, Vec<Point>); 2] {
    // Pile yarns are cut into pieces.
    let longest = warps.iter().map(|w| w.curve.points.len()).max().unwrap_or(0);
    let place = |w: &&PatternStrand| w.curve.points.iter().map(|p| p.x).sum::<f64>() / w.curve.points.len() as f64;
    [-1.0, 1.0].map(|out| {
        let whole = warps.iter().filter(|w| 2 * w.curve.points.len() > longest);
        let last = whole.max_by(|a, b| (out * place(a)).total_cmp(&(out * place(b))));
        (out, last.map(points).unwrap_or_default())
    })
}

/// How far out the middle of a weft that turns around a warp is at a height, from `x`.
fn reach((out, warp): &(f64, Vec<Point>), x: f64, y: f64, radius: f64) -> f64 {
    // Warps go up.
    let above = warp.partition_point(|p| p.0.y < y);
    let around = &warp[above.saturating_sub(1)..warp.len().min(above + 1)];
    let nearest = around.iter().min_by(|a, b| (a.0.y - y).abs().total_cmp(&(b.0.y - y).abs()));
    nearest.map_or(0.0, |p| p.0.x - x + out * BESIDE * (p.1.max(radius) + radius))
}

/// The end of the weft, beyond its last crossing.
fn stub(last: Point, warp: &(f64, Vec<Point>), radius: f64) -> Point {
    let out = STUB * reach(warp, last.0.x, last.0.y, radius);
    (last.0 + DVec3::X * out, last.1, last.2, last.3)
}

/// Around a warp from one pick to the next, without both: half an ellipse, along which the weft lies flat on the warp.
fn turn(way: &mut Vec<Point>, from: Point, to: Point, warp: &(f64, Vec<Point>), radius: f64) {
    let (middle, half) = (0.5 * (from.0 + to.0), 0.5 * (to.0 - from.0));
    let out = reach(warp, middle.x, middle.y, radius);
    way.extend((1..TURN).map(|k| {
        let share = k as f64 / TURN as f64;
        let (sin, cos) = (PI * share).sin_cos();
        let p = middle - cos * half + out * sin * DVec3::X;
        let (_, wide, axis, coordinates) = between(from, to, share);
        let inwards = (half.length() * sin * DVec3::X - out * cos * half.normalize_or_zero()).normalize_or(DVec3::Z);
        // An axis has no sign; at both ends it is that of the pick.
        let pick = if 2 * k < TURN { from.2 } else { to.2 };
        let inwards = inwards.as_vec3();
        let flat = inwards * 1.0_f32.copysign(inwards.dot(pick)) * axis.length();
        (p, wide, pick.lerp(flat, smooth_step(2.0 * share.min(1.0 - share)) as f32), coordinates)
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

/// What both sides of a cloth are woven as: from the left the last warps of the cloth, the right selvedge, the left one, and
/// the first warps of the cloth, all as far from each other.
struct Plan {
    /// Warps of the cloth at each side in whose place selvedges are.
    taken: u32,
    /// Warps of each selvedge.
    ends: u32,
    /// Warps beside each that give way or hold them.
    reach: u32,
    /// Distance of warps.
    spacing: f64,
    /// Picks in one shed of a selvedge.
    picks: usize,
}

impl Plan {
    fn of(cloth: &Cloth<'_>) -> Self {
        // At least one warp is left between both.
        let most = (cloth.count[0] - 1) / 2;
        let draft = &cloth.weave.draft;
        if !draft.twines() && draft.pile().is_none() && cloth.count[0] >= 2 * (1 + GIVING + HOLDING) {
            return Self { taken: 1, ends: 1, reach: GIVING + HOLDING, spacing: cloth.cell.spacing[0], picks: 1 };
        }
        let close = cloth.cell.spacing[1] < RIB * (cloth.weave.half_rooms[0] + cloth.weave.half_rooms[1]);
        let picks = 1 + usize::from(close);
        let jammed = with_picks(cloth, Draft::selvedge(picks, 1, false), None);
        let spacing = SLACK * UnitCell::relax(&jammed.draft, &jammed.options()).spacing[0];
        // The cloth stays as wide.
        let taken = (f64::from(PLAIN) * spacing / cloth.cell.spacing[0]).round() as u32;
        Self { taken: taken.min(most), ends: PLAIN, reach: 0, spacing, picks }
    }

    /// The column between both selvedges, where wefts turn: a thin warp makes room.
    fn outside(&self) -> u32 {
        self.reach + self.ends
    }

    fn columns(&self) -> u32 {
        2 * (self.reach + self.ends) + 1
    }

    /// The warp of the cloth in a column, unless that is one of a selvedge.
    fn body_warp(&self, cloth: &Cloth<'_>, column: u32) -> Option<u32> {
        let Self { taken, ends, reach, .. } = *self;
        if column < reach {
            return Some(cloth.count[0] - taken - reach + column);
        }
        column.checked_sub(reach + 2 * ends + 1).map(|column| taken + column)
    }

    /// The weave of both sides. `hem` picks come before the first.
    fn weave(&self, cloth: &Cloth<'_>, hem: u32) -> Weave {
        let body = &cloth.weave.draft;
        let high = lowest_common_multiple(body.wefts(), 2 * self.picks);
        let [right, left] = [true, false].map(|right| {
            // The weft turns right after even picks, left after odd ones; there the sheds of a rib must change.
            let draft = |inverted| Draft::selvedge(self.picks, hem as usize + usize::from(right), inverted);
            // Most yarns change sides where the cloth begins: floats end there.
            let (own, beside) =
                if right { (0, cloth.count[0] - 1 - self.taken) } else { (self.ends as usize - 1, self.taken) };
            let changes = |draft: &Draft| {
                (0..high).filter(|&i| draft.warp_over(i, own) != body.warp_over(i, beside as usize)).count()
            };
            let [straight, inverted] = [false, true].map(draft);
            if changes(&straight) < changes(&inverted) { inverted } else { straight }
        });
        let outside = self.outside() as usize;
        let draft =
            Draft::from_fn(self.columns() as usize, high, |weft, column| match self.body_warp(cloth, column as u32) {
                Some(warp) => body.warp_over(weft, warp as usize),
                None if column < outside => right.warp_over(weft, column - self.reach as usize),
                None if column == outside => !right.warp_over(weft, self.ends as usize - 1),
                None => left.warp_over(weft, column - outside - 1),
            });
        Weave { crimp: cloth.weave.crimp, ..with_picks(cloth, draft, Some(self.spacing)) }
    }

    /// How the sides are relaxed.
    fn options(&self, cloth: &Cloth<'_>, weave: &Weave) -> CellOptions {
        let given = &cloth.weave.threads;
        let of = |list: &[f64], i: usize| list.get(i % list.len().max(1)).copied().unwrap_or(1.0);
        let warp = |column: u32| match self.body_warp(cloth, column) {
            Some(n) => of(&given[0].thickness, n as usize),
            None if column == self.outside() => OUTSIDE,
            None => 1.0,
        };
        let thickness = [
            (0..self.columns()).map(warp).collect(),
            (0..weave.draft.wefts()).map(|i| of(&given[1].thickness, i)).collect(),
        ];
        CellOptions { thickness, ..weave.options() }
    }

    /// The node of the cloth at a `[side, yarn, node]` of the sides, where they are woven as the cloth is, and whether it stays.
    fn known(&self, cloth: &Cloth<'_>, [side, yarn, node]: [usize; 3]) -> Option<(Node, bool)> {
        let UnitCell { nodes, yarns, .. } = &cloth.cell;
        // The nearest.
        let crossing = if side == 0 { yarn } else { (node + nodes / 2) / nodes };
        let column = crossing as u32 % self.columns();
        let own = self.body_warp(cloth, column)? as usize;
        let length = yarns[1 - side].len() * nodes;
        let (yarn, node) = match side {
            0 => (own, node),
            _ => (yarn, (own * nodes + node + length - crossing * nodes % length) % length),
        };
        let yarn = &yarns[side][yarn % yarns[side].len()];
        Some((yarn[node % yarn.len()], !(HOLDING..self.columns() - HOLDING).contains(&column)))
    }
}

fn lowest_common_multiple(a: usize, b: usize) -> usize {
    let (mut x, mut y) = (a, b);
    while y != 0 {
        (x, y) = (y, x % y);
    }
    a / x.max(1) * b
}

/// Both sides, relaxed.
struct Sides<'a> {
    body: &'a Cloth<'a>,
    plan: Plan,
    /// As they were planned, and as many wefts as the cloth has.
    cloth: Cloth<'a>,
    hem: u32,
    /// How far the left and the right side are moved along x.
    shift: [f64; 2],
}

impl<'a> Sides<'a> {
    fn new(body: &'a Cloth<'a>, plan: Plan, weave: &'a Weave, hem: u32) -> Self {
        let known = |place| plan.known(body, place);
        let cell = UnitCell::relax_beside(&weave.draft, &plan.options(body, weave), known);
        let count = [plan.columns(), body.count[1]];
        let cloth = Cloth { weave, cell, count };
        let mut sides = Self { body, plan, cloth, hem, shift: [0.0; 2] };
        sides.shift = [false, true].map(|right| sides.moved_by(right));
        sides
    }

    /// Column of a warp of the cloth, the `from_side`th beside a selvedge.
    fn beside(&self, right: bool, from_side: u32) -> u32 {
        let Plan { ends, reach, .. } = self.plan;
        if right { reach - 1 - from_side } else { reach + 2 * ends + 1 + from_side }
    }

    /// Column of a warp of a selvedge, counted inwards.
    fn own(&self, right: bool, from_outside: u32) -> u32 {
        let outside = self.plan.outside();
        if right { outside - 1 - from_outside } else { outside + 1 + from_outside }
    }

    /// The number that a column of a side has in the cloth.
    fn number(&self, right: bool, column: u32) -> i64 {
        let Plan { taken, ends, reach, .. } = self.plan;
        let [taken, ends, reach, count] = [taken, ends, reach, self.body.count[0]].map(i64::from);
        i64::from(column) + if right { count - taken - reach } else { taken - reach - 2 * ends - 1 }
    }

    /// Where a column is on the mean, before it is moved.
    fn place(&self, column: u32) -> f64 {
        mean_place(&self.cloth, column)
    }

    /// How far a side is to be moved along x.
    fn moved_by(&self, right: bool) -> f64 {
        let body = |column: u32| self.body.position(0, self.number(right, column) as f64 + 0.5);
        if self.plan.reach > 0 {
            let held = self.beside(right, GIVING);
            return body(held) - self.cloth.position(0, f64::from(held) + 0.5);
        }
        // Beside the outermost warp that is left, as far as they are from each other.
        let out = if right { 1.0 } else { -1.0 };
        let column = self.own(right, self.plan.ends - 1);
        let last = self.number(right, column) - out as i64;
        let thickness = &self.body.weave.threads[0].thickness;
        let thicker = thickness.get(last.rem_euclid(thickness.len().max(1) as i64) as usize).map_or(0.0, |t| t - 1.0);
        let apart = self.plan.spacing + thicker.max(0.0) * self.body.weave.half_rooms[0];
        self.body.position(0, last as f64 + 0.5) + out * apart - self.place(column)
    }

    /// The points of a strand of a side, where they are in the cloth.
    fn moved(&self, right: bool, strand: &PatternStrand) -> Vec<Point> {
        let (by, number) = (self.shift[usize::from(right)], self.number(right, 0) as f32);
        let moved = |(p, radius, axis, [x, y]): Point| (p + DVec3::X * by, radius, axis, [x + number, y]);
        points(strand).into_iter().map(moved).collect()
    }

    /// Those of the cloth that are left, as they give way, and those of both selvedges.
    fn warps(&self, body: Vec<PatternStrand>) -> Vec<PatternStrand> {
        let Plan { taken, ends, reach, .. } = self.plan;
        let flat = self.cloth.weave.sized();
        let giving = GIVING.min(reach);
        let left = taken + giving..self.body.count[0] - taken - giving;
        let mut warps: Vec<PatternStrand> = body.into_iter().filter(|s| left.contains(&s.index)).collect();
        for right in [false, true] {
            let columns = (0..giving).map(|k| self.beside(right, k)).chain((0..ends).map(|k| self.own(right, k)));
            warps.extend(columns.map(|column| {
                let index = self.number(right, column).max(0) as u32;
                let way = self.moved(right, &self.cloth.strand(0, column, self.hem));
                from_points(StrandKind::Warp, index, &way, flat)
            }));
        }
        warps
    }

    /// A weft from the outermost crossing at the left to that at the right; `body` is its way through the cloth.
    fn weft(&self, index: u32, body: &[Point]) -> Vec<Point> {
        let Plan { taken, ends, reach, .. } = self.plan;
        let strand = self.cloth.strand(1, index, self.hem);
        let nodes = self.cloth.cell.nodes;
        let middle = from_crossing_to_crossing(body, taken + GIVING.min(reach), nodes);
        let [left, right] = [false, true].map(|right| Side { way: self.moved(right, &strand), right, sides: self });
        let [from, to] = [&left, &right].map(|side| side.x(side.sides.own(side.right, 0)));
        if reach > 0 {
            let mut way = left.part(from, middle[0].0.x);
            way.pop();
            way.extend(middle);
            way.extend(&right.part(middle[middle.len() - 1].0.x, to)[1..]);
            return way;
        }
        let [inner_left, inner_right] = [&left, &right].map(|side| side.x(side.sides.own(side.right, ends - 1)));
        let mut way = left.part(from, inner_left);
        join(&mut way, middle, nodes);
        join(&mut way, &right.part(inner_right, to), nodes);
        way
    }
}

/// Where a warp is on the mean.
fn mean_place(cloth: &Cloth<'_>, warp: u32) -> f64 {
    let nodes = &cloth.cell.yarns[0][warp as usize % cloth.cell.yarns[0].len()];
    let aside = nodes.iter().map(|node| node.aside).sum::<f64>() / nodes.len() as f64;
    cloth.position(0, f64::from(warp) + 0.5) + aside
}

/// A weft on its way through a side.
struct Side<'a> {
    way: Vec<Point>,
    right: bool,
    sides: &'a Sides<'a>,
}

impl Side<'_> {
    /// Where a column is.
    fn x(&self, column: u32) -> f64 {
        self.sides.place(column) + self.sides.shift[usize::from(self.right)]
    }

    /// What is at a place; its points lie evenly along x.
    fn at(&self, x: f64) -> Point {
        let last = self.way.len() - 1;
        let step = (self.way[last].0.x - self.way[0].0.x) / last as f64;
        let place = ((x - self.way[0].0.x) / step).clamp(0.0, last as f64);
        let i = (place as usize).min(last - 1);
        between(self.way[i], self.way[i + 1], place - i as f64)
    }

    /// From one place to another, both of them too.
    fn part(&self, from: f64, to: f64) -> Vec<Point> {
        let step = self.way[1].0.x - self.way[0].0.x;
        let inside = (from + 0.5 * step)..(to - 0.5 * step);
        let points = self.way.iter().copied().filter(|p| inside.contains(&p.0.x));
        std::iter::once(self.at(from)).chain(points).chain([self.at(to)]).collect()
    }
}

/// A point so far on the way from one to another.
fn between(a: Point, b: Point, share: f64) -> Point {
    let coordinates = [0, 1].map(|k| a.3[k] + share as f32 * (b.3[k] - a.3[k]));
    (a.0.lerp(b.0, share), a.1 + share * (b.1 - a.1), a.2.lerp(b.2, share as f32), coordinates)
}

/// Leads the way on to `next` and along it.
fn join(way: &mut Vec<Point>, next: &[Point], nodes: usize) {
    let ([.., before, from], [to, onwards, ..]) = (&way[..], next) else { return way.extend(next) };
    let (before, from) = (*before, *from);
    let steps = nodes.max(2);
    let length = from.0.distance(to.0);
    let [a, b] = [from.0 - before.0, onwards.0 - to.0].map(|d| d.normalize_or_zero() * length);
    for k in 1..steps {
        let s = k as f64 / steps as f64;
        let p = hermite([from.0, to.0], [a, b], s);
        let coordinates = if s < 0.5 { from.3 } else { to.3 };
        way.push((p, from.1 + s * (to.1 - from.1), from.2.lerp(to.2, s as f32), coordinates));
    }
    way.extend(next);
}
