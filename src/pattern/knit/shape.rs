//! The curve that a yarn begins as: every loop through its parents on the right side, with room to spare.
//!
//! A loop is a closed form (after Crane, "A Simple Parametric Model of Plain-Knit Yarns", 2023: x = t + a sin 2t,
//! y = -h cos t, z = -d cos 2t) between its feet, below the line where it is drawn through its parents, and its head, above
//! the line where its children are drawn through it. The depth takes its sign from the loop itself at its feet and from
//! its children at its head; where several loops lie over each other, each has a depth of its own.

pub(super) mod bobble;
mod form;
mod rims;

use glam::DVec3;
use rayon::prelude::*;

use self::bobble::PILED;
use super::{
    loops::{Border, Course, Hold, Loop, Loops, Visit},
    rims::Rims,
};
use crate::{geometry::spline::through_points, math::special::smooth_step};

/// How far across, up and out a point is: stitches or turns, rows, yarn diameters.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Place {
    pub(in super::super) at: f64,
    pub(in super::super) up: f64,
    pub(in super::super) out: f64,
}

/// The yarn along one visit, from its left end to its right end, finely.
#[derive(Clone, Debug)]
pub(in super::super) struct Piece {
    pub(in super::super) places: Vec<Place>,
    /// Wale and course of each place.
    pub(in super::super) grid: Vec<[f32; 2]>,
    /// Its yarn, in shares of a stitch's.
    pub(in super::super) yarn: f64,
    /// How many points it needs for its bends, likewise: a strand that is lifted turns as often as a stitch of more yarn.
    pub(in super::super) bends: f64,
}

/// How deep a loop dives and how far legs lean (stitch 4.13 wide): with [`REACH`](super::loops::REACH) the densest plain stitch of this form whose
/// strands keep apart, found by a search.
const DEPTH: f64 = 0.763;
pub(super) const LEAN: f64 = 0.982 / 4.13;
/// Distance of loops that lie over each other.
const LAYER: f64 = 0.85;
/// How much of the way between two layers they come together where they are bound off.
const CLOSED_BY: f64 = 0.5;
/// How wide the foot is of what closes a bobble.
const CLOSING: f64 = 0.6;
/// How far from a lifted strand, in shares of the way to the stitch beside it, the yarn goes over to the other side.
const BESIDE_STRAND: f64 = 0.1;
/// How far yarn lies off the cloth where it passes stitches.
const FLOAT: f64 = 1.7;
/// How far below its row, in rows, a float goes on where it has been caught: between the feet of this row and of that below.
const BELOW: f64 = 0.8;
/// Places of a piece.
const STEPS: usize = 64;

/// One end of a visit, or its foot.
#[derive(Clone, Copy)]
struct Foot {
    at: f64,
    up: f64,
    out: f64,
    /// 1 where the yarn is behind what it is drawn through, -1 in front, else 0.
    behind: f64,
    /// Whether the yarn goes from one side of the cloth to the other there: a loop must be behind what it is drawn through
    /// right beside it.
    through: bool,
}

impl Foot {
    fn new(at: f64, up: f64, out: f64) -> Self {
        Self { at, up, out, behind: 0.0, through: false }
    }
}

impl Loops {
    /// Width of a stitch in units of `at`, in a course.
    fn step(&self, course: &Course) -> f64 {
        let count = course.visits.iter().filter(|(_, v)| self.is_stitch(v)).count().max(1);
        match self.border.turns {
            true => 1.0 / count as f64,
            // Loops of both layers beside each other.
            false if self.is_double() && course.row < 0 => 0.5,
            false => 1.0,
        }
    }

    /// How far a loop is out of the middle of a cloth of two layers, at a share of its height.
    fn layer(&self, own: &Loop, head: f64) -> f64 {
        let is_bound = || own.held == Some(self.rows);
        let share = match own.side {
            0.0 => return 0.0,
            // What is cast on leaves the middle below the feet of the first row.
            _ if own.sign == 0.0 => smooth_step(head / 0.45),
            _ if is_bound() => 1.0 - CLOSED_BY * smooth_step(head),
            _ => 1.0,
        };
        own.side * self.apart * share
    }

    /// How many loops lie under the nearest one that a loop comes up through: what it is passed over lies around its legs.
    fn stacked(&self, own: &Loop) -> f64 {
        let count = own.parents.iter().filter(|p| !self.is_bound_within(&self.loops[**p as usize])).count();
        count.saturating_sub(1) as f64
    }

    /// How deep the feet of a loop dive: behind all that it is drawn through.
    fn foot_depth(&self, own: &Loop) -> f64 {
        // Feet of two layers must not pass each other.
        let over = own.side == 0.0 && own.parents.iter().any(|&p| self.loops[p as usize].sign == 0.0);
        let others = LAYER * self.stacked(own);
        // What binds off both layers is behind them.
        let closes = own.side == 0.0 && own.parents.iter().any(|&p| self.loops[p as usize].side != 0.0);
        let layers = if closes { (1.0 - CLOSED_BY) * self.apart } else { 0.0 };
        DEPTH + layers + if own.bobble { PILED } else { others } + if over { 0.5 } else { 0.0 }
    }

    /// Where the feet of a visit are: its middle, and how far up and out.
    fn foot(&self, course: &Course, visit: &Visit) -> Foot {
        let reach = self.reach();
        match visit {
            Visit::Loop(i) => {
                let l = &self.loops[*i as usize];
                let stack = self.stacked(l);
                let (below, out) = match l.sign {
                    // Behind the stitches that it lies between, or in front of purl ones.
                    0.0 if l.is_lifted() && l.layer == self.child_sign(l) => (reach, (DEPTH + 0.6) * l.layer),
                    0.0 if l.is_lifted() => (reach, DEPTH * l.layer),
                    0.0 => (0.0, 0.0),
                    // A bobble begins as any other loop.
                    sign if l.bobble => (reach, -sign * DEPTH),
                    // What closes two layers crosses the back one where its loops lean to the front ones.
                    sign if self.is_double() && l.side == 0.0 => {
                        (reach, self.layer(l, 0.0) - sign * self.foot_depth(l))
                    }
                    sign => (reach + 0.12 * stack, self.layer(l, 0.0) - sign * self.foot_depth(l)),
                };
                let behind = if l.is_lifted() { -l.layer } else { l.sign };
                Foot { behind, ..Foot::new(l.foot, self.up_at(course.row, l.foot) - below, out) }
            }
            Visit::Pass { at, front } => {
                let out = if *front { FLOAT } else { -FLOAT };
                Foot::new(*at, self.up_at(course.row, *at) - 0.5 * reach, out)
            }
            // Where it lies is told where it is laid.
            Visit::Through { at } => Foot::new(*at, f64::from(self.rows), 0.0),
            Visit::Float { at } => Foot::new(*at, self.up(course.row) - 0.5 * reach + course.lift, -FLOAT),
        }
    }

    /// The way of the yarn along each course, in the order of [`Loops::courses`], visit by visit.
    pub(in super::super) fn pieces(&self) -> Vec<Vec<Piece>> {
        self.courses
            .par_iter()
            .map(|course| {
                let step = self.step(course);
                let n = course.visits.len();
                let foot = |k: usize| {
                    let (own, before) = (self.foot(course, &course.visits[k].1), course.hold((k + n - 1) % n));
                    // Where a float has been caught it is below the yarn that holds it, for one stitch.
                    match before == (Hold::Caught { down: true }) {
                        true => Foot { up: self.up(course.row) - BELOW, ..own },
                        false => own,
                    }
                };
                let feet: Vec<Foot> = (0..n).map(foot).collect();
                // Whether the yarn goes from one side of the cloth to the other between a visit and the next one.
                let changes = |k: usize| feet[k].behind * feet[(k + 1) % n].behind < 0.0;
                let is_lifted = |k: usize| self.made_by(&course.visits[k].1).is_some_and(Loop::is_lifted);
                // Whether it comes so from a stitch that it passes, or goes on to one.
                let from_pass = |k: usize| {
                    let (a, b) = (k, (k + 1) % n);
                    let passes = |k: usize| matches!(course.visits[k].1, Visit::Pass { .. });
                    let is_drawn = |k: usize| feet[k].behind != 0.0 && !passes(k);
                    ((passes(a) && is_drawn(b)) || (is_drawn(a) && passes(b))) && feet[a].out * feet[b].out < 0.0
                };
                let of_strand = |k: usize| self.made_by(&course.visits[k].1).is_some_and(|l| self.is_of_strand(l));
                let through = |k: usize| from_pass(k) || (changes(k) && (of_strand(k) || of_strand((k + 1) % n)));
                // The joint between a visit and the next, as the first one has it.
                let joint = |k: usize| -> Option<Foot> {
                    let (a, next) = (feet[k], (k + 1) % n);
                    if next == 0 && self.border.round.is_none() {
                        return None;
                    }
                    let round = if next == 0 { self.border.round.unwrap_or(0.0) } else { 0.0 };
                    let b = feet[next];
                    // Between two that are behind, the yarn stays behind both.
                    let out = match (a.behind, b.behind) {
                        (1.0, 1.0) => a.out.min(b.out),
                        (-1.0, -1.0) => a.out.max(b.out),
                        _ if from_pass(k) => 0.0,
                        _ => 0.5 * (a.out + b.out),
                    };
                    let (up, out) = match course.hold(k) {
                        Hold::None => (0.5 * (a.up + b.up), out),
                        // The float goes in front of the yarn between the stitches that hold it.
                        Hold::Caught { .. } => (self.up(course.row) - 0.5, -1.0),
                        Hold::Catches => (self.up(course.row) - 0.6, -2.8),
                        Hold::Crosses => (0.5 * (a.up + b.up) + course.lift, out),
                    };
                    // A strand between stitches of both sides leaves the room to the one that is on the other side of it.
                    let share = match (changes(k), is_lifted(k), is_lifted(next)) {
                        (true, true, false) => BESIDE_STRAND,
                        (true, false, true) => 1.0 - BESIDE_STRAND,
                        _ => 0.5,
                    };
                    let at = a.at + share * (b.at + round - a.at);
                    Some(Foot { through: through(k), ..Foot::new(at, up, out) })
                };
                let joints: Vec<Option<Foot>> = (0..n).map(joint).collect();
                (0..n)
                    .map(|k| {
                        let own = feet[k];
                        let (column, visit) = &course.visits[k];
                        let out = match visit {
                            // At a side the yarns of two layers stay apart.
                            Visit::Loop(i) if self.is_double() && self.loops[*i as usize].side != 0.0 => {
                                let l = &self.loops[*i as usize];
                                self.layer(l, 0.0) - l.sign * DEPTH
                            }
                            _ => own.out,
                        };
                        let end = |side: f64| Foot { at: own.at + side * 0.5 * step, out, ..own };
                        let left = match (k, self.border.round) {
                            (0, None) => None,
                            (0, Some(round)) => joints[n - 1].map(|j| Foot { at: j.at - round, ..j }),
                            _ => joints[k - 1],
                        };
                        let ends = [left.unwrap_or(end(-1.0)), joints[k].unwrap_or(end(1.0))];
                        match visit {
                            Visit::Loop(i) => match &self.loops[*i as usize] {
                                l if l.bobble => self.bobble(l, *column, own, ends, step),
                                l if self.is_roped(l) => {
                                    self.roped_piece(l, *column, own, ends, step, [k == 0, k + 1 == n])
                                }
                                l if self.is_bound_within(l) => self.bound_piece(l, *column, own, ends, step),
                                l => self.loop_piece(l, *column, own, ends, step),
                            },
                            Visit::Pass { .. } => pass_piece(*column, course.row, own, ends),
                            Visit::Float { .. } => {
                                let turns = [left.is_none(), joints[k].is_none()];
                                float_piece(pass_piece(*column, course.row, own, ends), turns)
                            }
                            Visit::Through { at } => self.through_piece(*column, *at, step, [k == 0, k + 1 == n]),
                        }
                    })
                    .collect()
            })
            .collect()
    }

    /// The loop that a visit makes, if it makes one.
    fn made_by(&self, visit: &Visit) -> Option<&Loop> {
        if let Visit::Loop(i) = visit { Some(&self.loops[*i as usize]) } else { None }
    }

    /// Whether a loop is drawn through the strand between two stitches.
    fn is_of_strand(&self, own: &Loop) -> bool {
        own.parents.iter().any(|&p| self.loops[p as usize].is_lifted())
    }

    /// Whether a visit takes a place of its own in its row.
    fn is_stitch(&self, visit: &Visit) -> bool {
        match visit {
            // Lifted strands lie between stitches.
            Visit::Loop(i) => !self.loops[*i as usize].is_lifted(),
            Visit::Pass { .. } | Visit::Float { .. } | Visit::Through { .. } => true,
        }
    }
}

/// The yarn passes a stitch.
fn pass_piece(column: u32, row: i32, foot: Foot, ends: [Foot; 2]) -> Piece {
    let piece = |k: usize| {
        let t = k as f64 / STEPS as f64;
        let (end, share) = if t < 0.5 { (ends[0], 2.0 * t) } else { (ends[1], 2.0 - 2.0 * t) };
        // It is on its side before it meets the legs of the stitch.
        let share = smooth_step(if end.through { 3.0 * share } else { share });
        let place = Place {
            at: end.at + (foot.at - end.at) * if t < 0.5 { 2.0 * t } else { 2.0 - 2.0 * t },
            up: end.up + (foot.up - end.up) * share,
            out: end.out + (foot.out - end.out) * share,
        };
        (place, [column as f32 + t as f32, row as f32 + 0.02])
    };
    let (places, grid) = (0..=STEPS).map(piece).unzip();
    Piece { places, grid, yarn: PASSED, bends: PASSED }
}

/// The yarn floats behind a stitch, or turns behind it where that is the first or the last one of its row.
fn float_piece(mut piece: Piece, [at_left, at_right]: [bool; 2]) -> Piece {
    // Half way it is drawn towards the edge, beside which it would be seen.
    const KEPT: usize = STEPS * 3 / 10;
    let (from, to) = (if at_left { STEPS - KEPT } else { 0 }, if at_right { KEPT } else { STEPS });
    // The float of a row of one stitch keeps a step.
    let kept = from.min(to.max(1) - 1)..=to.max(1);
    let share = (kept.end() - kept.start()) as f64 / STEPS as f64;
    piece.places = piece.places[kept.clone()].to_vec();
    piece.grid = piece.grid[kept].to_vec();
    piece.yarn *= share;
    piece.bends *= share;
    piece
}

/// Yarn that passes a stitch, in shares of a stitch's: a little more than its width.
const PASSED: f64 = 0.26;

/// A smooth line through places in so many steps, without the last one.
fn through(knots: &[Place], steps: usize) -> impl Iterator<Item = Place> {
    let points: Vec<DVec3> = knots.iter().map(|p| DVec3::new(p.at, p.up, p.out)).collect();
    (0..steps).map(move |k| {
        let along = k as f64 * (points.len() - 1) as f64 / steps as f64;
        let p = through_points(&points, along as usize, along.fract());
        Place { at: p.x, up: p.y, out: p.z }
    })
}

/// Cuts a curve into so many pieces of equal length: the first point of each, with its place along `line` (whole steps and
/// a share).
pub(in super::super) fn spaced(line: &[DVec3], count: usize) -> Vec<(DVec3, usize, f64)> {
    let mut lengths = Vec::with_capacity(line.len());
    let mut sum = 0.0;
    for (i, p) in line.iter().enumerate() {
        sum += if i > 0 { p.distance(line[i - 1]) } else { 0.0 };
        lengths.push(sum);
    }
    let mut k = 0;
    (0..count)
        .map(|i| {
            let along = sum * i as f64 / count as f64;
            while k + 2 < line.len() && lengths[k + 1] <= along {
                k += 1;
            }
            let span = lengths[k + 1] - lengths[k];
            let share = if span > 0.0 { (along - lengths[k]) / span } else { 0.0 };
            (line[k].lerp(line[k + 1], share), k, share)
        })
        .collect()
}

/// Points that a visit is given.
pub(in super::super) fn points_of(yarn: f64, per_stitch: u32) -> usize {
    (2 * (0.5 * yarn * f64::from(per_stitch)).round() as usize).max(2)
}

impl Border {
    /// The borders of a periodic cell so many stitches wide.
    pub(in super::super) fn cell(wide: usize) -> Self {
        let round = Some(wide as f64);
        Self {
            round,
            stacked: true,
            turns: false,
            finished: false,
            rims: Rims::default(),
            mirrored: false,
            slants: false,
        }
    }
}
