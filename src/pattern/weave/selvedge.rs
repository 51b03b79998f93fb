//! Selvedges: each yarn of the weft turns around the outermost warp, over it on one way and under it on the other, and so
//! runs from its first pick to its last. `shuttle` tells the way of each, and `turn` how it goes around the warp.
//!
//! Where the draft itself does not hold each turn, the outermost warp floats free of the harness, as weavers let it: each
//! pick goes over it as it enters and under it as it leaves, or the other way round. It is relaxed together with the warps
//! beside it, so that these give way. Cloth that stands up or twines is woven plain over some more warps at its sides
//! instead. Each layer of a cloth has selvedges of its own.

use std::collections::HashMap;

use glam::DVec3;

use super::{
    Cloth, Draft, PatternStrand, StrandKind, Threads, Weave,
    edges::{Point, between, from_points, points},
    shuttle::{Shuttles, Turn},
    turn::Edge,
    unit_cell::{CellOptions, Node, UnitCell},
};
use crate::math::special::hermite;

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
/// The same of such a selvedge from the cloth beside it, over that of its warps: wefts that go up and down as far as under
/// the loops of terry would fold on their way from one weave into the other.
const BESIDE: f64 = 1.4;
/// Thickness of the warp that stands for the turns of wefts while a selvedge is relaxed.
const OUTSIDE: f64 = 0.25;

/// Lets each weft yarn turn at the sides. Where the draft itself does not hold each turn, the outermost warp floats. Cloth that
/// twines or stands up, and cloth of few warps, is woven plain over [`PLAIN`] warps instead, or as a rib of two picks where
/// picks are too close for that; these are as close as the picks let them be, and as many of the cloth's own are left out as
/// stood there.
pub(super) fn selvedges(cloth: &Cloth<'_>, strands: Vec<PatternStrand>, hem: u32) -> Vec<PatternStrand> {
    let (mut warps, wefts): (Vec<_>, Vec<_>) = strands.into_iter().partition(|s| s.kind == StrandKind::Warp);
    let mut picks = Picks::new(cloth, wefts.len(), hem, cloth.weave.draft.layers() as u32);
    let plan = (!picks.are_held(cloth)).then(|| Plan::of(cloth, &picks));
    if plan.as_ref().is_some_and(|plan| plan.reach == 0) {
        picks = Picks::new(cloth, wefts.len(), hem, 1);
    }
    let weave = plan.as_ref().map(|plan| plan.weave(cloth, &picks));
    let sides = plan.zip(weave.as_ref()).map(|(plan, weave)| Sides::new(cloth, plan, weave, hem));
    let row = |pick: u32| {
        let body = points(&wefts[pick as usize]);
        let without = [false, true].map(|right| picks.outside_of(cloth, right, picks.layer(pick)));
        match &sides {
            Some(sides) => sides.weft(pick, &body, without),
            None => from_crossing_to_crossing(&body, without, cloth.cell.nodes).to_vec(),
        }
    };
    let mut rows: Vec<Vec<Point>> = (0..wefts.len() as u32).map(row).collect();
    let edges = [false, true].map(|right| {
        let edge = |layer: u32| {
            let from_outside = picks.outside_of(cloth, right, layer);
            let way = match &sides {
                Some(sides) => sides.outer_warp(right, from_outside),
                None => {
                    let index = from_side(cloth, right, from_outside);
                    warps.iter().find(|w| w.index == index).map(points).unwrap_or_default()
                }
            };
            let end = |row: &Vec<Point>| row[if right { row.len() - 1 } else { 0 }].0.y;
            let own = rows.iter().zip(0..).filter(|(_, pick)| picks.layer(*pick) == layer);
            let picks = own.map(|(row, _)| end(row)).collect();
            Edge { out: if right { 1.0 } else { -1.0 }, way, picks, radius: cloth.weave.half_rooms[1] }
        };
        (0..picks.layers).map(edge).collect::<Vec<Edge>>()
    });
    if let Some(sides) = &sides {
        warps = sides.warps(warps);
    }
    for yarn in &picks.shuttles.yarns {
        let mut way: Vec<Point> = Vec::new();
        let mut turn: Option<Turn> = None;
        for pass in yarn {
            let mut row = std::mem::take(&mut rows[pass.pick as usize]);
            if !pass.right {
                row.reverse();
            }
            let edge = |right: bool| &edges[usize::from(right)][picks.layer(pass.pick) as usize];
            match (way.last(), turn) {
                (Some(&from), Some(turn)) => edge(!pass.right).turn(&mut way, from, row[0], turn),
                _ => way.extend(edge(!pass.right).stub(row[1], row[0]).into_iter().rev()),
            }
            way.extend(row);
            if pass.turn.is_none() {
                way.extend(edge(pass.right).stub(way[way.len() - 2], way[way.len() - 1]));
            }
            turn = pass.turn;
        }
        warps.push(from_points(StrandKind::Weft, yarn[0].pick, &way, cloth.weave.sized()));
    }
    warps
}

/// A weft without so many warps at the left and at the right.
fn from_crossing_to_crossing(way: &[Point], without: [u32; 2], nodes: usize) -> &[Point] {
    let [left, right] = without.map(|warps| warps as usize * nodes + nodes / 2);
    &way[left..way.len() - right]
}

/// The number of a warp that is so many from the outermost one of a side.
fn from_side(cloth: &Cloth<'_>, right: bool, from_outside: u32) -> u32 {
    if right { cloth.count[0] - 1 - from_outside } else { from_outside }
}

/// Which pick of a repeat of so many one is, counted from the first one above the hem.
fn in_cloth(pick: u32, hem: u32, repeat: usize) -> usize {
    (i64::from(pick) - i64::from(hem)).rem_euclid(repeat as i64) as usize
}

/// The picks of a cloth and the shuttles that make them.
struct Picks {
    shuttles: Shuttles,
    hem: u32,
    /// Layers that turn by themselves.
    layers: u32,
}

impl Picks {
    fn new(cloth: &Cloth<'_>, count: usize, hem: u32, layers: u32) -> Self {
        let Weave { draft, shuttles, threads: [_, Threads { thickness, .. }], .. } = cloth.weave;
        // Where a layer has no warp of its own, its wefts turn as the others do.
        let layers = if layers > cloth.count[0] { 1 } else { layers };
        let mut known = HashMap::new();
        let yarn = |pick: usize| {
            let in_turns = |length: usize| in_cloth(pick as u32, hem, length.max(1));
            let shuttle = shuttles.get(in_turns(shuttles.len()));
            let thick = thickness.get(in_turns(thickness.len())).map(|t| t.to_bits());
            let next = known.len() as u32;
            *known.entry((shuttle, thick, in_turns(draft.layers()))).or_insert(next)
        };
        let yarns: Vec<u32> = (0..count).map(yarn).collect();
        Self { shuttles: Shuttles::new(&yarns, layers), hem, layers }
    }

    /// The layer of the cloth in which a pick turns.
    fn layer(&self, pick: u32) -> u32 {
        in_cloth(pick, self.hem, self.layers as usize) as u32
    }

    /// How many warps are outside of the one around which a layer turns.
    fn outside_of(&self, cloth: &Cloth<'_>, right: bool, layer: u32) -> u32 {
        from_side(cloth, right, layer) % self.layers
    }

    /// Whether the draft itself holds each turn: its yarn is over the outermost warp on one way and under it on the other.
    fn are_held(&self, cloth: &Cloth<'_>) -> bool {
        let draft = &cloth.weave.draft;
        let over = |pick: u32, warp: u32| draft.warp_over(in_cloth(pick, self.hem, draft.wefts()), warp as usize);
        !draft.twines()
            && draft.pile().is_none()
            && [false, true].into_iter().all(|right| {
                self.shuttles.turns(right).all(|[from, to]| {
                    let warp = from_side(cloth, right, self.outside_of(cloth, right, self.layer(from)));
                    over(from, warp) != over(to, warp)
                })
            })
    }
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
        points: cloth.cell.nodes as u32,
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
    /// Whether two picks lie in one shed of a selvedge.
    rib: bool,
}

impl Plan {
    fn of(cloth: &Cloth<'_>, picks: &Picks) -> Self {
        // At least one warp is left between both.
        let most = (cloth.count[0] - 1) / 2;
        let (draft, layers) = (&cloth.weave.draft, picks.layers);
        if !draft.twines() && draft.pile().is_none() && cloth.count[0] >= 2 * (layers + GIVING + HOLDING) {
            let spacing = cloth.cell.spacing[0];
            return Self { taken: layers, ends: layers, reach: GIVING + HOLDING, spacing, rib: false };
        }
        let rib = cloth.cell.spacing[1] < RIB * (cloth.weave.half_rooms[0] + cloth.weave.half_rooms[1]);
        let jammed = with_picks(cloth, Draft::rib(1 + usize::from(rib)), None);
        let spacing = SLACK * UnitCell::relax(&jammed.draft, &jammed.options()).spacing[0];
        // The cloth stays as wide.
        let taken = (f64::from(PLAIN) * spacing / cloth.cell.spacing[0]).round() as u32;
        Self { taken: taken.min(most), ends: PLAIN, reach: 0, spacing, rib }
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

    /// The weave of both sides.
    fn weave(&self, cloth: &Cloth<'_>, picks: &Picks) -> Weave {
        let body = &cloth.weave.draft;
        let under = [false, true].map(|right| picks.shuttles.under(right, self.rib));
        let high = period(&under, body.wefts());
        // By its number in the cloth, of which the repeat is `high`.
        let pick = |weft: usize| (weft + picks.hem as usize) % high;
        let layer = |number: usize| number as u32 % picks.layers;
        let sides = [false, true].map(|right| {
            let under = &under[usize::from(right)];
            // Of a warp of a selvedge, counted from the outside.
            let own = move |weft: usize, from_outside: u32, inverted: bool| {
                let outermost = under.get(pick(weft)).is_some_and(|under| *under != inverted);
                if self.reach == 0 {
                    return outermost != (from_outside % 2 == 1);
                }
                let warp = from_side(cloth, right, from_outside) as usize;
                if layer(warp) == layer(weft) { outermost } else { body.warp_over(weft, warp) }
            };
            // Most yarns change sides where the cloth begins: floats end there.
            let last = self.ends - 1;
            let next = if self.reach == 0 { self.taken } else { self.taken - 1 + picks.layers };
            let beside = from_side(cloth, right, next) as usize;
            let changes =
                |inverted: bool| (0..high).filter(|&i| own(i, last, inverted) != body.warp_over(i, beside)).count();
            let inverted = changes(false) < changes(true);
            move |weft: usize, from_outside: u32| own(weft, from_outside, inverted)
        });
        let outside = self.outside();
        let draft = Draft::from_fn(self.columns() as usize, high, |weft, column| {
            let column = column as u32;
            match self.body_warp(cloth, column) {
                Some(warp) => body.warp_over(weft, warp as usize),
                None if column < outside => sides[1](weft, outside - 1 - column),
                None if column == outside => !sides[1](weft, picks.outside_of(cloth, true, layer(weft))),
                None => sides[0](weft, column - outside - 1),
            }
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

/// The least number of picks, a multiple of the draft's, after which both sides go on as they began.
fn period(under: &[Vec<bool>; 2], wefts: usize) -> usize {
    let again = |period: usize| under.iter().all(|u| u.iter().zip(u.iter().skip(period)).all(|(a, b)| a == b));
    (1..).map(|k| k * wefts).find(|&period| again(period)).unwrap_or(wefts)
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
        // Beside the outermost warp that is left.
        let out = if right { 1.0 } else { -1.0 };
        let column = self.own(right, self.plan.ends - 1);
        let last = self.number(right, column) - out as i64;
        let thickness = &self.body.weave.threads[0].thickness;
        let thicker = thickness.get(last.rem_euclid(thickness.len().max(1) as i64) as usize).map_or(0.0, |t| t - 1.0);
        let apart = BESIDE * self.plan.spacing + thicker.max(0.0) * self.body.weave.half_rooms[0];
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

    /// The way of a warp of a selvedge, counted from the outside.
    fn outer_warp(&self, right: bool, from_outside: u32) -> Vec<Point> {
        self.moved(right, &self.cloth.strand(0, self.own(right, from_outside), self.hem))
    }

    /// A weft from its outermost crossing at the left to that at the right, beyond which there are so many warps; `body` is its
    /// way through the cloth.
    fn weft(&self, index: u32, body: &[Point], without: [u32; 2]) -> Vec<Point> {
        let Plan { taken, ends, reach, .. } = self.plan;
        let strand = self.cloth.strand(1, index, self.hem);
        let nodes = self.cloth.cell.nodes;
        let middle = from_crossing_to_crossing(body, [taken + GIVING.min(reach); 2], nodes);
        let [left, right] = [false, true].map(|right| Side { way: self.moved(right, &strand), right, sides: self });
        let outermost = |side: &Side<'_>| side.x(side.sides.own(side.right, without[usize::from(side.right)]));
        let [from, to] = [&left, &right].map(outermost);
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
