//! Makes the loops of a chart's stitches: where they are, what they are drawn through, and the edges.

mod across;
mod net;

use super::{super::rims::CastOn, BELLY, BOBBLE, Border, Course, Loop, Loops, TRIPLE, Visit};
use crate::pattern::chart::{Act, Stitch, Top};

/// Yarn of what is no whole loop, in shares of a stitch's.
const OVER: f64 = 0.8;
const TUCKED: f64 = 0.68;
pub(super) const LIFTED: f64 = 0.6;
const DOUBLED: f64 = 0.48;
const CAST_ON: f64 = 0.82;
const CABLE_CAST_ON: f64 = 1.15;

/// The loop of each stitch, before there are any.
const NONE: u32 = u32::MAX;

/// How far up rows begin, in mean rows: all of them, the room that they have, and each stitch where rows are short.
struct Heights {
    heights: Vec<f64>,
    room: f64,
    levels: Vec<Vec<f64>>,
}

pub(super) struct Maker<'a> {
    rows: &'a [Vec<Stitch>],
    cast_on: usize,
    border: Border,
    /// Middles of the stitches of each row, and those of the cast-on edge before them.
    middles: Vec<Vec<f64>>,
    /// How far each stitch is above the beginning of its row, in rows, where rows wave; else nothing.
    rises: Vec<Vec<f64>>,
    /// Whether it is flat and shaped, so that its wales lean.
    shaped: bool,
    loops: Vec<Loop>,
    /// The loop made at each stitch.
    made: Vec<Vec<u32>>,
    cast: Vec<u32>,
    courses: Vec<Course>,
    below: Option<Course>,
    above: Option<Course>,
}

impl<'a> Maker<'a> {
    pub(super) fn new(rows: &'a [Vec<Stitch>], cast_on: usize, border: Border) -> Self {
        Self {
            rows,
            cast_on,
            border,
            middles: Vec::new(),
            rises: Vec::new(),
            shaped: false,
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
                Act::Pass { .. } | Act::Tuck | Act::Unworked | Act::Double => {
                    if matches!(stitch.act, Act::Tuck | Act::Double) {
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

    pub(super) fn draw(&mut self) {
        if self.border.finished {
            let first = &self.middles[0];
            let at: Vec<f64> = if first.len() == self.cast_on { first.clone() } else { self.even(self.cast_on) };
            let (twist, yarn) = match self.border.rims.cast_on {
                CastOn::LongTail => (1.0, CAST_ON),
                CastOn::Cable => (0.0, CABLE_CAST_ON),
            };
            self.cast = at.iter().map(|&at| self.push(Loop { twist, yarn, ..Loop::laid(-1, at) })).collect();
            let visits = self.cast.iter().enumerate().map(|(j, &c)| (j as u32, Visit::Loop(c))).collect();
            self.below = Some(Course::new(-1, visits));
        }
        // Loops first, for at a periodic border they are drawn through those of the last row.
        for (r, row) in self.rows.iter().enumerate() {
            let mut made = Vec::with_capacity(row.len());
            let mut visits = Vec::with_capacity(row.len());
            for (j, s) in row.iter().enumerate() {
                let at = self.middles[r][j];
                let base = Loop { layer: s.layer.into(), wide: self.width(r, j), ..Loop::laid(r as i32, at) };
                let new = match s.act {
                    Act::Draw | Act::BindOff | Act::Lift { .. } => {
                        Some(Loop { sign: if s.purl { -1.0 } else { 1.0 }, ..base })
                    }
                    Act::Bobble => Some(Loop { sign: 1.0, bobble: true, yarn: BOBBLE, ..base }),
                    Act::Over => Some(Loop { yarn: OVER, ..base }),
                    Act::Tuck => Some(Loop { yarn: TUCKED, ..base }),
                    Act::Double => Some(Loop { yarn: DOUBLED, ..base }),
                    Act::CastOn => Some(Loop { twist: 1.0, yarn: CAST_ON, ..base }),
                    Act::Unworked => None,
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
            let first = row.iter().position(|s| s.act != Act::Unworked).unwrap_or(0);
            self.courses.push(Course { first, ..Course::new(r as i32, visits) });
        }
        let mut content = Vec::new();
        for r in 0..self.rows.len() {
            for j in 0..self.rows[r].len() {
                let (s, own) = (self.rows[r][j], self.made[r][j]);
                content.clear();
                // It is passed over what comes out.
                let before = self.bound_before(r, j);
                content.extend(before.map(|b| (b, 0)));
                match (s.act, self.under(r)) {
                    (Act::Lift { left }, under) => {
                        let twist = if left { -1.0 } else { 1.0 };
                        self.lift(own, under, s, twist);
                        continue;
                    }
                    (Act::Draw | Act::BindOff | Act::Bobble, Some((below, down))) => {
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
                    (Act::Draw | Act::BindOff | Act::Bobble, None) => {
                        let all = s.first_parent..s.first_parent + u32::from(s.parents);
                        content.extend(all.filter_map(|p| self.cast.get(p as usize)).map(|&c| (c, 0)));
                    }
                    _ => continue,
                }
                self.link(own, &content, r as i32, s.twisted);
                if before.is_some() {
                    let own = &mut self.loops[own as usize];
                    own.foot = own.at;
                }
            }
        }
    }

    /// The loop that is bound off right before a stitch, as the row is worked.
    fn bound_before(&self, r: usize, j: usize) -> Option<u32> {
        let backwards = self.border.round.is_none() && (r % 2 == 1) != self.border.mirrored;
        let before = if backwards { j + 1 } else { j.checked_sub(1)? };
        self.rows[r].get(before).filter(|s| s.act == Act::BindOff).map(|_| self.made[r][before])
    }

    /// A loop is drawn through others.
    fn link(&mut self, own: u32, through: &[(u32, i32)], row: i32, twisted: bool) {
        let at = self.loops[own as usize].at;
        let mut mean = 0.0;
        let mut rank = 0;
        for &(p, down) in through {
            let held = row + down * self.rows.len() as i32;
            let parent = &mut self.loops[p as usize];
            parent.held = Some(held);
            parent.rank = rank as u8;
            // What is bound off within the piece lies above, around its legs.
            rank += usize::from(parent.row != row || down > 0 || row == self.rows.len() as i32);
            parent.children.push(own);
            if twisted {
                parent.twist = 1.0;
            }
            mean += self.border.short(parent.at - at);
            self.loops[own as usize].parents.push(p);
        }
        // Where wales lean, a foot is where its own row has it.
        if self.shaped {
            return;
        }
        // Where others come from far or pass each other they have done so when they are worked.
        const FAR: f64 = 0.8;
        let stitches = if self.border.turns { self.rows[0].len() as f64 } else { 1.0 };
        mean /= through.len().max(1) as f64;
        if !self.rises.is_empty() {
            mean = mean.clamp(-FAR, FAR);
        }
        if self.loops[own as usize].layer == 0.0 && (mean.abs() * stitches < FAR || !self.rises.is_empty()) {
            self.loops[own as usize].foot = at + 0.5 * mean;
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
            let purl =
                |v: Option<&(u32, Visit)>| matches!(v, Some((_, Visit::Loop(i))) if self.loops[*i as usize].sign < 0.0);
            let between = place.checked_sub(1).is_none_or(|k| purl(course.visits.get(k)));
            let front = between && (purl(course.visits.get(place)) || place == course.visits.len());
            self.loops[strand as usize].layer = if front { 1.0 } else { -1.0 };
            course.visits.insert(place, (column, Visit::Loop(strand)));
            self.link(own, &[(strand, down)], r, false);
        }
    }

    /// Each stitch of the last row, or so many `together`, is drawn through and the one before it laid over what comes out.
    /// `next` is the row that would come above it, if that is known.
    pub(super) fn bind_off(&mut self, backwards: bool, together: usize, next: Option<&[Stitch]>) {
        let last = self.rows.len() - 1;
        let row = self.rows.len() as i32;
        let mut columns = self.open(last, together);
        if backwards {
            columns.reverse();
        }
        let mut visits = Vec::with_capacity(columns.len());
        let mut before: Option<u32> = None;
        for j in columns {
            let bound = j * together..(j + 1) * together;
            let at = self.middles[last][bound.clone()].iter().sum::<f64>() / together as f64;
            // In pattern: as the next row has it, or wales of purl, as of a rib, are purled.
            let is_purled = |r: usize| self.rows[r].get(j).is_some_and(|s| s.purl && s.act == Act::Draw);
            let purl = match next.and_then(|next| next.get(j)) {
                Some(stitch) => stitch.purl,
                None => together == 1 && (last.saturating_sub(1)..=last).all(is_purled),
            };
            let own = self.push(Loop { sign: if purl { -1.0 } else { 1.0 }, ..Loop::laid(row, at) });
            let mut content: Vec<(u32, i32)> = before.map(|b| (b, 0)).into_iter().collect();
            bound.for_each(|j| self.content(last, j, 0, &mut content));
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

    /// Which columns of a row have live loops, counted in so many `together`.
    fn open(&self, r: usize, together: usize) -> Vec<usize> {
        let row = &self.rows[r];
        (0..row.len() / together).filter(|j| row[j * together].act != Act::BindOff).collect()
    }

    /// The yarn goes through every loop of the last row.
    pub(super) fn draw_together(&mut self) {
        let last = self.rows.len() - 1;
        let row = self.rows.len() as i32;
        let mut visits = Vec::with_capacity(self.rows[last].len());
        for j in self.open(last, 1) {
            let mut content = Vec::new();
            self.content(last, j, 0, &mut content);
            content.into_iter().for_each(|(p, _)| self.loops[p as usize].held = Some(row));
            visits.push((j as u32, Visit::Through { at: self.middles[last][j] }));
        }
        self.above = Some(Course::new(row, visits));
    }

    /// How far up each row begins, in mean rows, and how much higher rows are than without room to change places: three
    /// stitches that become one take it, cables, and stitches that lean far; and, above them, bobbles.
    fn heights(&self) -> Heights {
        const CROSSING: f64 = 0.5;
        let belly = |r: usize| if self.rows[r].iter().any(|s| s.act == Act::Bobble) { BELLY } else { 0.0 };
        let room = |r: usize| {
            let Some((below, _)) = self.under(r) else { return 0.0 };
            let turn = if self.border.turns { self.rows[r].len() as f64 } else { 1.0 };
            let of = |(s, at): (&Stitch, &f64)| {
                // Shaped cloth gives way where three become one.
                if s.act == Act::CastOn || (self.shaped && s.layer == 0) {
                    return 0.0;
                }
                let lean = self.parent_middle(&self.middles[below], s, *at) - at;
                let lean = CROSSING * turn * self.border.short(lean).abs();
                match s.layer {
                    0 => (2.0 * lean - 0.5).max(if s.parents > 2 { TRIPLE } else { 0.0 }),
                    _ => lean,
                }
            };
            self.rows[r].iter().zip(&self.middles[r]).map(of).fold(belly(below), f64::max)
        };
        let rooms: Vec<f64> = (0..self.rows.len()).map(room).collect();
        let mut up = 0.0;
        let mut heights: Vec<f64> = Vec::with_capacity(self.rows.len());
        for room in &rooms {
            up += room;
            heights.push(up);
            up += 1.0;
        }
        if !self.border.stacked {
            up += belly(self.rows.len() - 1);
        }
        let room = up / self.rows.len() as f64;
        heights.iter_mut().for_each(|h| *h /= room);
        Heights { levels: self.levels(&rooms, room), heights, room }
    }

    /// How far up each stitch of each row begins where rows are short: above as many rows as have been worked there. A double
    /// stitch is drawn up by half of one.
    fn levels(&self, rooms: &[f64], room: f64) -> Vec<Vec<f64>> {
        const DOUBLE: f64 = 0.5;
        if !self.rows.iter().flatten().any(|s| s.act == Act::Unworked) {
            return Vec::new();
        }
        let mut below = vec![0.0; self.cast_on];
        let mut levels = Vec::with_capacity(self.rows.len() + 1);
        for (row, room) in self.rows.iter().zip(rooms) {
            let at = |s: &Stitch| {
                let parents = s.first_parent..s.first_parent + u32::from(s.parents.max(1));
                let top = parents.filter_map(|p| below.get(p as usize)).copied().fold(0.0, f64::max);
                top + if s.act == Act::Unworked { 0.0 } else { *room }
            };
            let own: Vec<f64> = row.iter().map(at).collect();
            let high = |s: &Stitch| match s.act {
                Act::Unworked => 0.0,
                Act::Double => DOUBLE,
                _ => 1.0,
            };
            below = row.iter().zip(&own).map(|(s, at)| at + high(s)).collect();
            levels.push(own);
        }
        levels.push(below);
        levels.iter_mut().flatten().for_each(|up| *up /= room);
        levels
    }

    pub(super) fn finish(mut self) -> Loops {
        self.lean_with_neighbours();
        let Heights { heights, room, levels } = self.heights();
        let wave = |(at, rises): (&Vec<f64>, &Vec<f64>)| -> Vec<(f64, f64)> {
            let mut wave: Vec<(f64, f64)> = at.iter().copied().zip(rises.iter().map(|rise| rise / room)).collect();
            wave.sort_by(|a, b| a.0.total_cmp(&b.0));
            wave
        };
        let waves = self.middles.iter().zip(&self.rises).map(wave).collect();
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
            heights,
            room,
            levels,
            waves,
            shaped: if self.shaped { self.middles.iter().map(|row| row[0]).collect() } else { Vec::new() },
            bobbles: self.rows.iter().flatten().any(|s| s.act == Act::Bobble),
            apart: 0.0,
            ribbed: false,
        }
    }
}
