//! A yarn as points on its way through a piece, and how those of them that may move relax.

use glam::DVec3;
use rayon::prelude::*;

use super::super::shape::spaced;
use crate::{
    geometry::{contact::Cubes, spline::through_points},
    pattern::{
        bend::folds,
        rods::{Rods, Run, Strand},
    },
};

/// The longest segment, in diameters.
const LONGEST: f64 = 1.0;
/// Points that one thread takes at once.
const CHUNK: usize = 1024;

/// A yarn on its way through the cloth.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Thread {
    pub(in super::super) points: Vec<DVec3>,
    /// Length at rest of the segment that begins at each point.
    pub(in super::super) rest: Vec<f64>,
    pub(in super::super) grid: Vec<[f32; 2]>,
    /// What each point may do.
    pub(in super::super) state: Vec<State>,
}

/// What a point may do while a piece relaxes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum State {
    /// It is at rest, as its cell has it.
    Rest,
    /// It moves.
    Move,
    /// Nothing holds it yet: it stays.
    Held,
}

impl Thread {
    pub(super) fn push(&mut self, point: DVec3, rest: f64, grid: [f32; 2], state: State) {
        self.points.push(point);
        self.rest.push(rest);
        self.grid.push(grid);
        self.state.push(state);
    }

    pub(super) fn reverse(&mut self) {
        self.points.reverse();
        self.grid.reverse();
        self.state.reverse();
        // The rest of a segment is kept at its first point.
        self.rest.pop();
        self.rest.reverse();
        self.rest.push(0.0);
    }

    /// Goes on with another row.
    pub(super) fn join(&mut self, mut next: Self) {
        if let (Some(&from), Some(&to)) = (self.points.last(), next.points.first())
            && let Some(last) = self.rest.last_mut()
            && *last == 0.0
        {
            *last = from.distance(to).max(0.1);
            if *last > LONGEST {
                // Along a long segment its neighbours would count as other strands.
                self.go_on(&[from, to]);
                self.pop();
            }
        }
        self.points.append(&mut next.points);
        self.rest.append(&mut next.rest);
        self.grid.append(&mut next.grid);
        self.state.append(&mut next.state);
    }

    /// Turns and goes on with another row: it bulges so far, and is drawn taut to a share of its length.
    pub(super) fn turn(&mut self, next: Self, (bulge, taut): (DVec3, f64)) {
        if let (Some(&from), Some(&to), true) = (self.points.last(), next.points.first(), bulge != DVec3::ZERO) {
            let (a, b) = (from + bulge, to + bulge);
            let at = |k: u32| {
                let t = f64::from(k) / 32.0;
                let u = 1.0 - t;
                from * (u * u * u) + a * (3.0 * u * u * t) + b * (3.0 * u * t * t) + to * (t * t * t)
            };
            let first = self.rest.len() - 1;
            self.go_on(&(0..=32).map(at).collect::<Vec<_>>());
            self.rest[first..].iter_mut().for_each(|rest| *rest *= taut);
            // The row begins with the last of these.
            self.pop();
        }
        self.join(next);
    }

    /// Goes on along a line that begins where it ends.
    pub(super) fn go_on(&mut self, line: &[DVec3]) {
        const STEP: f64 = 0.7;
        let (Some(&grid), Some(last)) = (self.grid.last(), self.rest.last_mut()) else { return };
        let length: f64 = line.windows(2).map(|w| w[0].distance(w[1])).sum();
        let count = (length / STEP).ceil().clamp(2.0, 64.0) as usize;
        let rest = length / count as f64;
        *last = rest;
        for (point, ..) in spaced(line, count).into_iter().skip(1) {
            self.push(point, rest, grid, State::Move);
        }
        self.push(line[line.len() - 1], rest, grid, State::Move);
    }

    /// Begins with the same line, from its far end.
    pub(super) fn come_from(&mut self, line: &[DVec3]) {
        let Some(&grid) = self.grid.first() else { return };
        let mut own = Self::default();
        own.push(line[0], 0.0, grid, State::Move);
        own.go_on(line);
        own.reverse();
        own.pop();
        own.join(std::mem::take(self));
        *self = own;
    }

    pub(super) fn pop(&mut self) {
        self.points.pop();
        self.rest.pop();
        self.grid.pop();
        self.state.pop();
    }

    /// Ends at the head of its last loop, whose leg goes back down from there.
    pub(super) fn draw_out(&mut self, up: DVec3) {
        while let [.., before, last] = self.points.as_slice()
            && before.dot(up) >= last.dot(up)
        {
            self.pop();
        }
    }

    /// Goes on straight for a while at its end or its start.
    pub(super) fn tail(&mut self, length: f64, way: DVec3, at_start: bool) {
        let end = if at_start { self.points.first() } else { self.points.last() };
        let Some(&from) = end else { return };
        let line = [from, from + way * length];
        if at_start { self.come_from(&line) } else { self.go_on(&line) }
    }
}

impl Thread {
    /// More points on the same curve: so many times as many, about.
    pub(in super::super) fn refine(&mut self, times: f64) {
        let old = std::mem::take(self);
        let n = old.points.len();
        let count = ((n - 1) as f64 * times).round() as usize;
        let place = |k: usize| {
            let along = k as f64 * (n - 1) as f64 / count as f64;
            let i = (along as usize).min(n - 2);
            (i, along - i as f64)
        };
        let grid = |(i, t): (usize, f64)| {
            let (g, h) = (old.grid[i], old.grid[i + 1]);
            // Where a round begins anew, places jump.
            let h = if (0..2).any(|k| (h[k] - g[k]).abs() > 2.0) { g } else { h };
            [0, 1].map(|k| g[k] + t as f32 * (h[k] - g[k]))
        };
        let places = || (0..count + 1).into_par_iter().with_min_len(CHUNK).map(place);
        *self = Self {
            points: places().map(|(i, t)| through_points(&old.points, i, t)).collect(),
            rest: places().map(|(i, _)| old.rest[i] / times).collect(),
            grid: places().map(grid).collect(),
            state: places().map(|(i, _)| old.state[i]).collect(),
        };
    }
}

/// Relaxes what moves in some yarns, among what is at rest within reach of it.
pub(in super::super) fn settle(threads: &mut [Thread], run: &Run) {
    // What is at rest takes part if it is in such a cube beside one in which something moves.
    const CUBE: f64 = 2.0;
    if threads.iter().all(|t| t.state.iter().all(|s| *s != State::Move)) {
        return;
    }
    let mut rods = Rods::default();
    // Where each point of the rods is from.
    let mut from: Vec<(usize, usize)> = Vec::new();
    let whole = threads.iter().all(|t| t.state.iter().all(|s| *s != State::Rest));
    let states = threads.iter().flat_map(|t| t.points.iter().zip(&t.state));
    let moving = states.filter(|(_, state)| !whole && **state == State::Move).map(|(point, _)| *point);
    let near = Cubes::around(moving, CUBE);
    for (k, t) in threads.iter().enumerate() {
        let n = t.points.len();
        let taken: Vec<bool> = t.points.par_iter().with_min_len(CHUNK).map(|p| whole || near.hold(*p)).collect();
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

/// Relaxes what still folds into itself, with a quarter of a stitch on either side of it; all else is at rest meanwhile.
/// `per_stitch` is the number of points in a stitch, `radius` that of the yarn.
pub(in super::super) fn ease(threads: &mut [Thread], per_stitch: usize, radius: f64, run: &Run) {
    // How far a yarn may turn beyond what its radius allows, in radians; plies are seen to break at five times that.
    const FOLD: f64 = 0.1;
    const ROUNDS: usize = 8;
    // Rounds go on while no larger share of the folds is left.
    const UNFOLDS: f64 = 0.9;
    let reach = per_stitch / 4;
    let mut left = usize::MAX;
    for _ in 0..ROUNDS {
        let folds: Vec<Vec<usize>> = threads
            .iter()
            .map(|t| {
                let along = folds(&t.points, radius).enumerate();
                along.filter(|(_, fold)| *fold > FOLD).map(|(i, _)| i).collect()
            })
            .collect();
        // What is left hardly unfolds.
        let count: usize = folds.iter().map(Vec::len).sum();
        if count as f64 > UNFOLDS * left as f64 {
            return;
        }
        left = count;
        let states: Vec<Vec<State>> = threads.iter().map(|t| t.state.clone()).collect();
        for ((t, own), folds) in threads.iter_mut().zip(&states).zip(folds) {
            t.state.iter_mut().filter(|s| **s == State::Move).for_each(|s| *s = State::Rest);
            for i in folds {
                let near = i.saturating_sub(reach)..(i + 3 + reach).min(own.len());
                t.state[near.clone()].copy_from_slice(&own[near]);
            }
        }
        settle(threads, run);
        threads.iter_mut().zip(states).for_each(|(t, own)| t.state = own);
    }
}
