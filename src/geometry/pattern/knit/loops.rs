//! Which loop passes through which: a chart's stitches become loops, and the way of the yarn through each row.

use super::{
    super::chart::{Act, Stitch, Top},
    colors::Hold,
};

/// A loop of yarn that a needle has held.
#[derive(Clone, Debug)]
pub(in super::super) struct Loop {
    /// The row it was made in; -1 is the cast-on edge.
    pub(in super::super) row: i32,
    /// Its middle across the cloth: in stitches, or in turns if the cloth is round.
    pub(in super::super) at: f64,
    /// 1 if it was drawn to the front, -1 to the back, 0 if it was laid over the needle.
    pub(in super::super) sign: f64,
    /// What it was drawn through, from the front as its own sign has it: the nearest to the new loop's head first.
    pub(in super::super) parents: Vec<u32>,
    /// What is drawn through it: loops of `held` and their sign.
    pub(in super::super) children: Vec<u32>,
    /// The row of its children, counted on beyond a periodic border.
    pub(in super::super) held: Option<i32>,
    /// Its place among the loops that its children are drawn through.
    pub(in super::super) rank: u8,
    /// 1 if its legs cross, the right one in front; -1 if the left one is; else 0.
    pub(in super::super) twist: f64,
    /// 1 if it passes in front of others that it changes places with, -1 behind.
    pub(in super::super) layer: f64,
    /// Share of a stitch's yarn.
    pub(in super::super) yarn: f64,
    /// Where its feet are across the cloth: half way between its own middle and those of its parents.
    pub(in super::super) foot: f64,
}

impl Loop {
    /// A loop with nothing around it yet, laid over the needle with a stitch's yarn.
    fn laid(row: i32, at: f64) -> Self {
        Self {
            row,
            at,
            sign: 0.0,
            parents: Vec::new(),
            children: Vec::new(),
            held: None,
            rank: 0,
            twist: 0.0,
            layer: 0.0,
            yarn: 1.0,
            foot: at,
        }
    }
}

/// What the yarn does on its way along a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) enum Visit {
    /// It makes a loop.
    Loop(u32),
    /// It passes a stitch.
    Pass {
        /// Where.
        at: f64,
        /// Whether in front.
        front: bool,
    },
    /// It passes behind a stitch of another colour.
    Float {
        /// Where.
        at: f64,
    },
}

/// A yarn's way along a row, from left to right.
#[derive(Clone, Debug)]
pub(in super::super) struct Course {
    pub(in super::super) row: i32,
    /// What the yarn does, each with the column of the chart.
    pub(in super::super) visits: Vec<(u32, Visit)>,
    pub(in super::super) color: u16,
    /// Visits of the row before its own, where it is a field of one.
    pub(in super::super) first: usize,
    /// How far its floats are lifted, in rows: those of several colours lie beside each other.
    pub(in super::super) lift: f64,
    /// What happens after each visit; none where nothing does.
    pub(in super::super) holds: Vec<Hold>,
}

impl Course {
    fn new(row: i32, visits: Vec<(u32, Visit)>) -> Self {
        Self { row, visits, color: 0, first: 0, lift: 0.0, holds: Vec::new() }
    }

    /// What happens between a visit and the next one.
    pub(in super::super) fn hold(&self, k: usize) -> Hold {
        self.holds.get(k).copied().unwrap_or(Hold::None)
    }

    /// Whether other colours change a visit: a float, a loop beside one, or one that catches another.
    pub(in super::super) fn is_mixed(&self, k: usize) -> bool {
        let n = self.visits.len();
        let before = (k + n - 1) % n;
        let float = |k: usize| matches!(self.visits[k].1, Visit::Float { .. });
        float(k) || float(before) || float((k + 1) % n) || self.hold(k) != Hold::None || self.hold(before) != Hold::None
    }
}

/// Loops and rows of a piece.
#[derive(Clone, Debug)]
pub(in super::super) struct Loops {
    pub(in super::super) loops: Vec<Loop>,
    pub(in super::super) courses: Vec<Course>,
    pub(in super::super) border: Border,
    /// Rows without edges, and stitches of the first one.
    pub(in super::super) rows: i32,
    pub(in super::super) wide: usize,
}

/// What is beside the last stitch of a row, above the last row and below the first one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) struct Border {
    /// Of a row that goes round: by how much `at` grows in a round.
    pub(in super::super) round: Option<f64>,
    /// The last row is below the first.
    pub(in super::super) stacked: bool,
    /// Flat or round: whether `at` counts turns.
    pub(in super::super) turns: bool,
    /// The first row is cast on and the last one bound off.
    pub(in super::super) finished: bool,
}

impl Border {
    /// A difference across the cloth, the short way round.
    pub(in super::super) fn short(&self, d: f64) -> f64 {
        self.round.map_or(d, |round| d - round * (d / round).round())
    }
}

/// Yarn of what is no whole loop, in shares of a stitch's.
const OVER: f64 = 0.8;
const TUCKED: f64 = 0.75;
const LIFTED: f64 = 0.6;
const CAST_ON: f64 = 0.75;

/// The loop of each stitch, before there are any.
const NONE: u32 = u32::MAX;

impl Loops {
    /// The loops of rows from the first one upwards.
    pub(in super::super) fn new(rows: &[Vec<Stitch>], cast_on: usize, border: Border) -> Self {
        let backwards = border.round.is_none() && rows.len() % 2 == 1;
        Self::bound_off(rows, cast_on, border, backwards)
    }

    /// The same, with the side from which a finished piece is bound off.
    pub(in super::super) fn bound_off(rows: &[Vec<Stitch>], cast_on: usize, border: Border, backwards: bool) -> Self {
        let mut maker = Maker::new(rows, cast_on, border);
        maker.positions();
        maker.draw();
        if border.finished {
            maker.bind_off(backwards);
        }
        maker.finish()
    }

    /// Every loop with what is drawn through it: parent and child.
    #[cfg(test)]
    pub(in super::super) fn links(&self) -> Vec<(u32, u32)> {
        let of = |(i, l): (usize, &Loop)| l.parents.iter().map(|&p| (p, i as u32)).collect::<Vec<_>>();
        self.loops.iter().enumerate().flat_map(of).collect()
    }
}

struct Maker<'a> {
    rows: &'a [Vec<Stitch>],
    cast_on: usize,
    border: Border,
    /// Middles of the stitches of each row, and those of the cast-on edge before them.
    middles: Vec<Vec<f64>>,
    loops: Vec<Loop>,
    /// The loop made at each stitch.
    made: Vec<Vec<u32>>,
    cast: Vec<u32>,
    courses: Vec<Course>,
    below: Option<Course>,
    above: Option<Course>,
}

impl<'a> Maker<'a> {
    fn new(rows: &'a [Vec<Stitch>], cast_on: usize, border: Border) -> Self {
        Self {
            rows,
            cast_on,
            border,
            middles: Vec::new(),
            loops: Vec::new(),
            made: Vec::new(),
            cast: Vec::new(),
            courses: Vec::new(),
            below: None,
            above: None,
        }
    }

    /// Row r - 1, and whether it is one period down.
    fn under(&self, r: usize) -> Option<(usize, i32)> {
        match r.checked_sub(1) {
            Some(below) => Some((below, 0)),
            None => self.border.stacked.then(|| (self.rows.len() - 1, 1)),
        }
    }

    fn even(&self, count: usize) -> Vec<f64> {
        let n = count as f64;
        let at = |j: usize| match (self.border.turns, self.border.round) {
            (true, _) => (j as f64 + 0.5) / n,
            (false, Some(_)) => j as f64 + 0.5,
            (false, None) => j as f64 + 0.5 - 0.5 * n,
        };
        (0..count).map(at).collect()
    }

    /// Mean place of what a stitch is made of in the row below, measured from `near`.
    fn parent_middle(&self, below: &[f64], stitch: &Stitch, near: f64) -> f64 {
        let at = |p: u32| near + self.border.short(below[p as usize % below.len()] - near);
        if stitch.parents == 0 {
            // Between two stitches.
            let (p, n) = (stitch.first_parent as usize, below.len());
            let (left, right) = (at(((p + n - 1) % n) as u32), at((p % n) as u32));
            return match (p, self.border.round) {
                (0, None) => right,
                (p, None) if p >= n => left,
                _ => 0.5 * (left + right),
            };
        }
        let last = stitch.first_parent + u32::from(stitch.parents);
        (stitch.first_parent..last).map(at).sum::<f64>() / f64::from(stitch.parents)
    }

    /// Where stitches are across the cloth: evenly, and drawn along by cables.
    fn positions(&mut self) {
        const ROUNDS: usize = 6;
        const LINKS: f64 = 0.3;
        self.middles = self.rows.iter().map(|r| self.even(r.len())).collect();
        if self.border.round.is_none() {
            // Each row of a shaped piece lies over the one below.
            let mut shift = 0.0;
            for r in 1..self.rows.len() {
                let (row, below) = (&self.rows[r], self.even(self.rows[r - 1].len()));
                let own = self.even(row.len());
                let worked: Vec<f64> = row
                    .iter()
                    .zip(&own)
                    .filter(|(s, _)| s.parents > 0)
                    .map(|(s, at)| self.parent_middle(&below, s, *at) - at)
                    .collect();
                shift += worked.iter().sum::<f64>() / worked.len().max(1) as f64;
                self.middles[r].iter_mut().for_each(|at| *at += shift);
            }
        }
        if !self.rows.iter().flatten().any(|s| s.layer != 0) {
            return;
        }
        let mut children: Vec<Vec<Option<usize>>> = self.rows.iter().map(|r| vec![None; r.len()]).collect();
        for r in 0..self.rows.len() {
            let Some((below, _)) = self.under(r) else { continue };
            for (j, s) in self.rows[r].iter().enumerate() {
                (s.first_parent..s.first_parent + u32::from(s.parents))
                    .for_each(|p| children[below][p as usize] = Some(j));
            }
        }
        for _ in 0..ROUNDS {
            let mut next = self.middles.clone();
            for (r, row) in self.rows.iter().enumerate() {
                let (n, own) = (row.len(), &self.middles[r]);
                let step = if self.border.turns { 1.0 / n as f64 } else { 1.0 };
                for j in 0..n {
                    let (mut sum, mut count) = (0.0, 0.0_f64);
                    if let (Some((below, _)), true) = (self.under(r), row[j].parents > 0) {
                        sum += self.parent_middle(&self.middles[below], &row[j], own[j]) - own[j];
                        count += 1.0;
                    }
                    let above = if r + 1 < self.rows.len() { Some(r + 1) } else { self.border.stacked.then_some(0) };
                    if let (Some(above), Some(c)) = (above, children[r][j]) {
                        sum += self.border.short(self.middles[above][c] - own[j]);
                        count += 1.0;
                    }
                    let neighbour = |k: isize| {
                        let other = (j as isize + k).rem_euclid(n as isize) as usize;
                        self.border.short(own[other] - own[j] - k as f64 * step)
                    };
                    let beside = match (self.border.round, j) {
                        (None, 0) => neighbour(1),
                        (None, j) if j + 1 == n => neighbour(-1),
                        _ => 0.5 * (neighbour(-1) + neighbour(1)),
                    };
                    next[r][j] += LINKS * sum / count.max(1.0) + (1.0 - LINKS) * 0.5 * beside;
                }
            }
            self.middles = next;
        }
    }

    fn push(&mut self, made: Loop) -> u32 {
        self.loops.push(made);
        self.loops.len() as u32 - 1
    }

    /// The loops on the needle at a stitch, those made first at first, each with the periods down to it.
    fn content(&self, r: usize, j: usize, down: i32, out: &mut Vec<(u32, i32)>) {
        let (mut r, mut j, mut down) = (r, j, down);
        let mut later = Vec::new();
        // A stitch that is never worked is let go after a whole period.
        for _ in 0..=2 * self.rows.len() {
            let stitch = &self.rows[r][j];
            match stitch.act {
                Act::Pass { .. } | Act::Tuck => {
                    if stitch.act == Act::Tuck {
                        later.push((self.made[r][j], down));
                    }
                    j = stitch.first_parent as usize;
                    match self.under(r) {
                        Some((below, more)) => (r, down) = (below, down + more),
                        None => {
                            out.extend(self.cast.get(j).map(|&c| (c, 0)));
                            break;
                        }
                    }
                }
                _ => {
                    out.push((self.made[r][j], down));
                    break;
                }
            }
        }
        out.extend(later.into_iter().rev());
    }

    fn draw(&mut self) {
        if self.border.finished {
            let first = &self.middles[0];
            let at: Vec<f64> = if first.len() == self.cast_on { first.clone() } else { self.even(self.cast_on) };
            self.cast =
                at.iter().map(|&at| self.push(Loop { twist: 1.0, yarn: CAST_ON, ..Loop::laid(-1, at) })).collect();
            let visits = self.cast.iter().enumerate().map(|(j, &c)| (j as u32, Visit::Loop(c))).collect();
            self.below = Some(Course::new(-1, visits));
        }
        // Loops first, for at a periodic border they are drawn through those of the last row.
        for (r, row) in self.rows.iter().enumerate() {
            let mut made = Vec::with_capacity(row.len());
            let mut visits = Vec::with_capacity(row.len());
            for (j, s) in row.iter().enumerate() {
                let at = self.middles[r][j];
                let base = Loop { layer: s.layer.into(), ..Loop::laid(r as i32, at) };
                let new = match s.act {
                    Act::Draw | Act::Lift { .. } => Some(Loop { sign: if s.purl { -1.0 } else { 1.0 }, ..base }),
                    Act::Over => Some(Loop { yarn: OVER, ..base }),
                    Act::Tuck => Some(Loop { yarn: TUCKED, ..base }),
                    Act::Pass { front } => {
                        visits.push((j as u32, Visit::Pass { at, front }));
                        None
                    }
                };
                made.push(new.map_or(NONE, |new| {
                    self.loops.push(new);
                    let i = self.loops.len() as u32 - 1;
                    visits.push((j as u32, Visit::Loop(i)));
                    i
                }));
            }
            self.made.push(made);
            self.courses.push(Course::new(r as i32, visits));
        }
        let mut content = Vec::new();
        for r in 0..self.rows.len() {
            for j in 0..self.rows[r].len() {
                let (s, own) = (self.rows[r][j], self.made[r][j]);
                content.clear();
                match (s.act, self.under(r)) {
                    (Act::Lift { left }, under) => {
                        let twist = if left { -1.0 } else { 1.0 };
                        self.lift(own, under, s, twist);
                        continue;
                    }
                    (Act::Draw, Some((below, down))) => {
                        let all = s.first_parent..s.first_parent + u32::from(s.parents);
                        let order: Vec<u32> = match s.top {
                            Top::Left => all.collect(),
                            Top::Right => all.rev().collect(),
                            Top::Middle => {
                                let middle = s.first_parent + u32::from(s.parents) / 2;
                                [middle].into_iter().chain(all.filter(|p| *p != middle)).collect()
                            }
                        };
                        order.into_iter().for_each(|p| self.content(below, p as usize, down, &mut content));
                    }
                    (Act::Draw, None) => {
                        let all = s.first_parent..s.first_parent + u32::from(s.parents);
                        content.extend(all.filter_map(|p| self.cast.get(p as usize)).map(|&c| (c, 0)));
                    }
                    _ => continue,
                }
                self.link(own, &content, r as i32, s.twisted);
            }
        }
    }

    /// A loop is drawn through others.
    fn link(&mut self, own: u32, through: &[(u32, i32)], row: i32, twisted: bool) {
        let at = self.loops[own as usize].at;
        let mut mean = 0.0;
        for (rank, &(p, down)) in through.iter().enumerate() {
            let held = row + down * self.rows.len() as i32;
            let parent = &mut self.loops[p as usize];
            parent.held = Some(held);
            parent.rank = rank as u8;
            parent.children.push(own);
            if twisted {
                parent.twist = 1.0;
            }
            mean += self.border.short(parent.at - at);
            self.loops[own as usize].parents.push(p);
        }
        if !through.is_empty() {
            self.loops[own as usize].foot = at + 0.5 * mean / through.len() as f64;
        }
    }

    /// A loop is drawn through the strand between two stitches of the row below.
    fn lift(&mut self, own: u32, under: Option<(usize, i32)>, s: Stitch, twist: f64) {
        let near = self.loops[own as usize].at;
        let r = self.loops[own as usize].row;
        let (row, down, at) = match under {
            Some((below, down)) => (below as i32, down, self.parent_middle(&self.middles[below], &s, near)),
            None => (-1, 0, near),
        };
        let strand = self.push(Loop { twist, yarn: LIFTED, ..Loop::laid(row, at) });
        let column = s.first_parent;
        let course = match under {
            Some((below, _)) => Some(&mut self.courses[below]),
            None => self.below.as_mut(),
        };
        if let Some(course) = course {
            let place = course.visits.iter().position(|(j, _)| *j >= column).unwrap_or(course.visits.len());
            course.visits.insert(place, (column, Visit::Loop(strand)));
            self.link(own, &[(strand, down)], r, false);
        }
    }

    /// Each stitch of the last row is drawn through it and through the one before it.
    fn bind_off(&mut self, backwards: bool) {
        let last = self.rows.len() - 1;
        let row = self.rows.len() as i32;
        let n = self.rows[last].len();
        let mut visits = Vec::with_capacity(n);
        let mut before: Option<u32> = None;
        for k in 0..n {
            let j = if backwards { n - 1 - k } else { k };
            let at = self.middles[last][j];
            let own = self.push(Loop { sign: 1.0, ..Loop::laid(row, at) });
            let mut content: Vec<(u32, i32)> = before.map(|b| (b, 0)).into_iter().collect();
            self.content(last, j, 0, &mut content);
            self.link(own, &content, row, false);
            self.loops[own as usize].foot = at;
            visits.push((j as u32, Visit::Loop(own)));
            before = Some(own);
        }
        if backwards {
            visits.reverse();
        }
        self.above = Some(Course::new(row, visits));
    }

    fn finish(mut self) -> Loops {
        let mut courses = Vec::new();
        courses.extend(self.below.take());
        courses.append(&mut self.courses);
        courses.extend(self.above.take());
        Loops {
            loops: self.loops,
            courses,
            border: self.border,
            rows: self.rows.len() as i32,
            wide: self.rows[0].len(),
        }
    }
}
