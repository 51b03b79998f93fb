//! A whole piece: loops are laid out as their cell has them or in their closed form, yarns led from row to row, and what
//! is not at rest yet relaxed.

use std::{collections::HashSet, f64::consts::TAU};

use glam::{DVec2, DVec3, IVec3};

use super::{
    super::{
        revolution::Revolution,
        rods::{Rods, Run, Strand},
    },
    cell::Cell,
    loops::{Loop, Loops, Visit},
    shape::{Piece, Place, points_of, spaced},
};

/// Where a piece lies; its unit is the yarn's diameter.
pub(super) enum Surface {
    /// In the plane; widths of stitches and heights of rows.
    Plane { width: f64, height: f64 },
    /// About the y axis; rows are turns of one spiral.
    Round { revolution: Revolution, height: f64 },
}

impl Surface {
    fn place(&self, p: &Place) -> DVec3 {
        match self {
            Self::Plane { width, height } => DVec3::new(p.at * width, p.up * height, p.out),
            Self::Round { revolution, height } => revolution.place(p.at, (p.up + p.at - 0.5) * height, p.out),
        }
    }
}

/// A yarn on its way through the cloth.
#[derive(Clone, Debug, Default)]
pub(super) struct Thread {
    pub(super) points: Vec<DVec3>,
    /// Length at rest of the segment that begins at each point.
    pub(super) rest: Vec<f64>,
    pub(super) grid: Vec<[f32; 2]>,
    /// What each point may do.
    pub(super) state: Vec<State>,
}

/// What a point may do while a piece relaxes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// It is at rest, as its cell has it.
    Rest,
    /// It moves.
    Move,
    /// Nothing holds it yet: it stays.
    Held,
}

/// How a piece is laid out.
pub(super) struct Laying<'a> {
    pub(super) loops: &'a Loops,
    pub(super) surface: &'a Surface,
    /// The cell of each row of the chart, and the row in it; none where rows have no repeat.
    pub(super) cells: &'a dyn Fn(usize) -> Option<(&'a Cell, usize)>,
    /// Whether all of the piece repeats as its cell does.
    pub(super) even: bool,
    /// Length of yarn in a stitch, and its points.
    pub(super) yarn: f64,
    pub(super) points: u32,
}

/// Stitches and rows at the edges that find their place anew.
const EDGE: usize = 2;

impl Laying<'_> {
    /// One yarn through all rows: it turns at the edges of a flat piece, and goes round and round in a tube.
    pub(super) fn thread(&self) -> Thread {
        let courses = &self.loops.courses;
        let last = courses.len() - 1;
        let pieces = self.loops.pieces();
        let round = self.loops.border.turns;
        let mut all = Thread::default();
        for (c, (course, pieces)) in courses.iter().zip(&pieces).enumerate() {
            let mut own = Thread::default();
            let count = course.visits.len();
            for (k, ((_, visit), piece)) in course.visits.iter().zip(pieces).enumerate() {
                let side = !round && (k < EDGE || k + EDGE >= count);
                let edge = side || (self.loops.border.finished && (c <= EDGE || c + EDGE > last));
                self.lay(course.row, k, visit, piece, edge, &mut own);
            }
            if let (Some(piece), Some(end)) = (pieces.last(), pieces.last().and_then(|p| p.places.last())) {
                // The end of a row, where it is not the beginning of the next.
                if !round {
                    own.push(self.surface.place(end), 0.0, piece.grid[piece.grid.len() - 1], State::Move);
                }
            }
            let backwards = if round { course.row == -1 } else { course.row.rem_euclid(2) == 1 };
            if backwards {
                own.reverse();
            }
            all.join(
                own,
                if round {
                    0.0
                } else if backwards {
                    1.0
                } else {
                    -1.0
                },
            );
        }
        all
    }

    fn lay(&self, row: i32, k: usize, visit: &Visit, piece: &Piece, edge: bool, out: &mut Thread) {
        let own = match visit {
            Visit::Loop(i) => Some(&self.loops.loops[*i as usize]),
            Visit::Pass { .. } => None,
        };
        let rows = self.loops.courses.len();
        let finished = self.loops.border.finished;
        let cell = usize::try_from(row).ok().and_then(|r| (self.cells)(r));
        let held = |grid: [f32; 2]| {
            let head = grid[1] - row as f32;
            !finished && ((row == 0 && head < 0.1) || (row as usize + 1 == rows && head > 0.9))
        };
        let state = |grid: [f32; 2], rest: bool| match (held(grid), rest) {
            (true, _) => State::Held,
            (false, true) => State::Rest,
            (false, false) => State::Move,
        };
        match (cell, &self.surface) {
            // As the cell has it.
            (Some((cell, r)), Surface::Plane { width, height }) if self.even => {
                let n = self.loops.courses[0].visits.len() as f64;
                let left = DVec3::new(-0.5 * n * width, f64::from(row) * height - r as f64 * height, 0.0);
                let rest = cell.rest(r, k);
                for (p, g) in cell.visit(r, k) {
                    let grid = [g[0], g[1] - r as f32 + row as f32];
                    out.push(p + left, rest, grid, state(grid, !edge));
                }
                return;
            }
            // Bent round.
            (Some((cell, r)), Surface::Round { .. }) if self.plain(own) => {
                let Some(own) = own else { return };
                let [width, height] = cell.gauge();
                let count = self.loops.courses.get(row as usize).map_or(1, |c| c.visits.len()) as f64;
                let rest = cell.rest(r, k);
                for (p, g) in cell.visit(r, k) {
                    let head = f64::from(g[1] - r as f32);
                    let lean = own.foot - own.at + (self.head(own) - own.foot) * head;
                    let at = own.at + lean + (p.x / width - (k as f64 + 0.5)) / count;
                    let up = f64::from(row) + p.y / height - r as f64;
                    let grid = [g[0], g[1] - r as f32 + row as f32];
                    out.push(
                        self.surface.place(&Place { at, up, out: p.z }),
                        rest,
                        grid,
                        state(grid, self.even && !edge),
                    );
                }
                return;
            }
            _ => {}
        }
        let line: Vec<DVec3> = piece.places.iter().map(|p| self.surface.place(p)).collect();
        let count = points_of(piece.yarn, self.points);
        for (point, i, share) in spaced(&line, count) {
            let (a, b) = (piece.grid[i], piece.grid[i + 1]);
            let grid = [0, 1].map(|c| a[c] + share as f32 * (b[c] - a[c]));
            out.push(point, piece.yarn * self.yarn / count as f64, grid, state(grid, false));
        }
    }

    /// Whether a loop is as in its cell: through one below and held by one above, and nothing beside it leans.
    fn plain(&self, own: Option<&Loop>) -> bool {
        own.is_some_and(|l| {
            let above = |c: &u32| self.loops.loops[*c as usize].parents.len() == 1;
            l.parents.len() <= 1 && l.layer == 0.0 && l.children.iter().all(above)
        })
    }

    fn head(&self, own: &Loop) -> f64 {
        let border = self.loops.border;
        own.children.first().map_or(own.at, |&c| own.at + border.short(self.loops.loops[c as usize].foot - own.at))
    }
}

impl Thread {
    fn push(&mut self, point: DVec3, rest: f64, grid: [f32; 2], state: State) {
        self.points.push(point);
        self.rest.push(rest);
        self.grid.push(grid);
        self.state.push(state);
    }

    fn reverse(&mut self) {
        self.points.reverse();
        self.grid.reverse();
        self.state.reverse();
        // The rest of a segment is kept at its first point.
        self.rest.pop();
        self.rest.reverse();
        self.rest.push(0.0);
    }

    /// Goes on with another row; at the edge of a flat piece in a turn to that side.
    fn join(&mut self, mut next: Self, side: f64) {
        if let (Some(&from), Some(&to)) = (self.points.last(), next.points.first()) {
            if side != 0.0 {
                const BULGE: f64 = 0.8;
                let steps = (from.distance(to) / 0.7).ceil().clamp(2.0, 16.0) as usize;
                let (a, b) = (from + DVec3::X * side * BULGE, to + DVec3::X * side * BULGE);
                let at = |t: f64| {
                    let u = 1.0 - t;
                    from * (u * u * u) + a * (3.0 * u * u * t) + b * (3.0 * u * t * t) + to * (t * t * t)
                };
                let grid = self.grid[self.grid.len() - 1];
                let line: Vec<DVec3> = (0..=steps).map(|k| at(k as f64 / steps as f64)).collect();
                let rest = line.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>() / steps as f64;
                if let Some(last) = self.rest.last_mut() {
                    *last = rest;
                }
                line[1..steps].iter().for_each(|p| self.push(*p, rest, grid, State::Move));
            } else if let Some(last) = self.rest.last_mut()
                && *last == 0.0
            {
                *last = from.distance(to).max(0.1);
            }
        }
        self.points.append(&mut next.points);
        self.rest.append(&mut next.rest);
        self.grid.append(&mut next.grid);
        self.state.append(&mut next.state);
    }

    /// Goes on straight for a while at both ends.
    pub(super) fn tails(&mut self, length: f64, at_start: DVec3, at_end: DVec3) {
        const STEP: f64 = 0.6;
        let steps = (length / STEP).round().max(1.0) as usize;
        if let (Some(&from), Some(&grid)) = (self.points.last(), self.grid.last()) {
            if let Some(last) = self.rest.last_mut() {
                *last = STEP;
            }
            (1..=steps).for_each(|k| self.push(from + at_end * (STEP * k as f64), STEP, grid, State::Move));
        }
        if let (Some(&from), Some(&grid)) = (self.points.first(), self.grid.first()) {
            let mut tail = Self::default();
            (1..=steps).rev().for_each(|k| tail.push(from + at_start * (STEP * k as f64), STEP, grid, State::Move));
            tail.join(std::mem::take(self), 0.0);
            *self = tail;
        }
    }
}

impl Thread {
    /// More points on the same curve: so many times as many, about.
    pub(super) fn refine(&mut self, times: f64) {
        let old = std::mem::take(self);
        let n = old.points.len();
        let count = ((n - 1) as f64 * times).round() as usize;
        let at = |i: usize| old.points[i.min(n - 1)];
        for k in 0..=count {
            let along = k as f64 * (n - 1) as f64 / count as f64;
            let (i, t) = ((along as usize).min(n - 2), along - (along as usize).min(n - 2) as f64);
            let [a, b, c, d] = [at(i.saturating_sub(1)), at(i), at(i + 1), at(i + 2)];
            let point = b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)));
            let (g, h) = (old.grid[i], old.grid[i + 1]);
            // Where a round begins anew, places jump.
            let h = if (0..2).any(|k| (h[k] - g[k]).abs() > 2.0) { g } else { h };
            self.push(point, old.rest[i] / times, [0, 1].map(|k| g[k] + t as f32 * (h[k] - g[k])), old.state[i]);
        }
    }
}

/// Relaxes what moves in some yarns, among what is at rest within reach of it.
pub(super) fn settle(threads: &mut [Thread], run: &Run) {
    // What is at rest takes part if it is in such a cube beside one in which something moves.
    const CUBE: f64 = 2.0;
    if threads.iter().all(|t| t.state.iter().all(|s| *s != State::Move)) {
        return;
    }
    let mut rods = Rods::default();
    // Where each point of the rods is from.
    let mut from: Vec<(usize, usize)> = Vec::new();
    let whole = threads.iter().all(|t| t.state.iter().all(|s| *s != State::Rest));
    let cube = |p: DVec3| (p / CUBE).floor().as_ivec3();
    let mut near: HashSet<IVec3> = HashSet::new();
    if !whole {
        for t in threads.iter() {
            for (p, _) in t.points.iter().zip(&t.state).filter(|(_, s)| **s == State::Move) {
                let own = cube(*p);
                let beside = |k: i32| IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
                near.extend((0..27).map(|k| own + beside(k)));
            }
        }
    }
    for (k, t) in threads.iter().enumerate() {
        let n = t.points.len();
        let taken: Vec<bool> = t.points.iter().map(|p| whole || near.contains(&cube(*p))).collect();
        let mut i = 0;
        while i < n {
            if !taken[i] {
                i += 1;
                continue;
            }
            let start = rods.points.len();
            while i < n && taken[i] {
                rods.points.push(t.points[i]);
                rods.rest.push(t.rest[i].max(1e-3));
                rods.fixed.push(t.state[i] != State::Move);
                from.push((k, i));
                i += 1;
            }
            rods.strands.push(Strand { start, count: rods.points.len() - start, jump: None });
        }
    }
    rods.relax(run);
    for (p, (k, i)) in rods.points.iter().zip(from) {
        threads[k].points[i] = *p;
    }
}

/// Radius of a tube of so many stitches.
pub(super) fn tube(stitches: u32, width: f64, rows: f64, height: f64) -> Revolution {
    let radius = width * f64::from(stitches) / TAU;
    Revolution::new(&[DVec2::new(radius, 0.0), DVec2::new(radius, rows * height)])
}
