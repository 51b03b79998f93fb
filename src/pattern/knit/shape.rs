//! The curve that a yarn begins as: every loop through its parents on the right side, with room to spare.
//!
//! A loop is a closed form (after Crane, "A Simple Parametric Model of Plain-Knit Yarns", 2023: x = t + a sin 2t,
//! y = -h cos t, z = -d cos 2t) between its feet, below the line where it is drawn through its parents, and its head, above
//! the line where its children are drawn through it. The depth takes its sign from the loop itself at its feet and from
//! its children at its head; where several loops lie over each other, each has a depth of its own.

pub(super) mod bobble;
mod rims;

use std::f64::consts::TAU;

use glam::DVec3;

use self::bobble::PILED;
use super::{
    colors::Hold,
    loops::{Border, Course, Loop, Loops, Visit},
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
}

/// How deep a loop dives, how far feet and heads reach beyond the line where they hold each other (rows 2.28 apart), and how
/// far legs lean (stitch 4.13 wide): the densest plain stitch of this form whose strands keep apart, found by a search.
const DEPTH: f64 = 0.763;
pub(super) const REACH: f64 = 0.775 / 2.28;
pub(super) const LEAN: f64 = 0.982 / 4.13;
/// Distance of loops that lie over each other, and of cables that pass each other.
const LAYER: f64 = 0.85;
const CABLE: f64 = 2.6;
/// Width of a strand that is lifted between two stitches.
const NARROW: f64 = 0.9;
/// How wide a stitch is out of which a bobble grows.
const HOLDS_BOBBLE: f64 = 1.35;
/// How much of the way between two layers they come together where they are bound off.
const CLOSED_BY: f64 = 0.5;
/// How wide the foot is of what closes a bobble.
const CLOSING: f64 = 0.6;
/// How far yarn lies off the cloth where it passes stitches.
const FLOAT: f64 = 1.7;
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

    fn child_sign(&self, own: &Loop) -> f64 {
        let sign = own.children.first().map_or(own.sign, |&c| self.loops[c as usize].sign);
        if sign == 0.0 { 1.0 } else { sign }
    }

    /// How deep the feet of a loop dive: behind all that it is drawn through.
    fn foot_depth(&self, own: &Loop) -> f64 {
        // Feet of two layers must not pass each other.
        let over = own.side == 0.0 && own.parents.iter().any(|&p| self.loops[p as usize].sign == 0.0);
        let others = LAYER * own.parents.len().saturating_sub(1) as f64;
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
                let stack = l.parents.len().saturating_sub(1) as f64;
                let (below, out) = match l.sign {
                    // Behind the stitches that it lies between, or in front of purl ones.
                    0.0 if l.is_lifted() => (reach, DEPTH * l.layer + if l.layer > 0.0 { 0.6 } else { 0.0 }),
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
                Foot { at: l.foot, up: self.up_at(course.row, l.foot) - below, out, behind }
            }
            Visit::Pass { at, front } => {
                let out = if *front { FLOAT } else { -FLOAT };
                Foot { at: *at, up: self.up_at(course.row, *at) - 0.5 * reach, out, behind: 0.0 }
            }
            // Where it lies is told where it is laid.
            Visit::Through { at } => Foot { at: *at, up: f64::from(self.rows), out: 0.0, behind: 0.0 },
            Visit::Float { at } => {
                Foot { at: *at, up: self.up(course.row) - 0.5 * reach + course.lift, out: -FLOAT, behind: 0.0 }
            }
        }
    }

    /// The way of the yarn along each course, in the order of [`Loops::courses`], visit by visit.
    pub(in super::super) fn pieces(&self) -> Vec<Vec<Piece>> {
        self.courses
            .iter()
            .map(|course| {
                let step = self.step(course);
                let feet: Vec<Foot> = course.visits.iter().map(|(_, v)| self.foot(course, v)).collect();
                let n = feet.len();
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
                        _ => 0.5 * (a.out + b.out),
                    };
                    let (up, out) = match course.hold(k) {
                        Hold::None => (0.5 * (a.up + b.up), out),
                        // The float dips below the feet of the stitches that hold it, in front of the yarn between them.
                        Hold::Caught => (self.up(course.row) - 0.5, -1.0),
                        Hold::Catches => (self.up(course.row) - 0.8, -3.0),
                        Hold::Crosses => (0.5 * (a.up + b.up) + course.lift, out),
                    };
                    Some(Foot { at: 0.5 * (a.at + b.at + round), up, out, behind: 0.0 })
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
                                l => self.loop_piece(l, *column, own, ends, step),
                            },
                            Visit::Pass { .. } | Visit::Float { .. } => pass_piece(*column, course.row, own, ends),
                            Visit::Through { at } => self.through_piece(*column, *at, step, [k == 0, k + 1 == n]),
                        }
                    })
                    .collect()
            })
            .collect()
    }

    /// Whether a visit takes a place of its own in its row.
    fn is_stitch(&self, visit: &Visit) -> bool {
        match visit {
            // Lifted strands lie between stitches.
            Visit::Loop(i) => !self.loops[*i as usize].is_lifted(),
            Visit::Pass { .. } | Visit::Float { .. } | Visit::Through { .. } => true,
        }
    }

    fn loop_piece(&self, own: &Loop, column: u32, foot: Foot, ends: [Foot; 2], step: f64) -> Piece {
        let over = own.sign == 0.0;
        let child = self.child_sign(own);
        let children = || own.children.iter().map(|&c| &self.loops[c as usize]);
        let count = own.children.len().max(1) as f64;
        let border = self.border;
        let mean = |of: &dyn Fn(&Loop) -> f64| children().map(of).sum::<f64>() / count;
        let head_at =
            if own.children.is_empty() { own.at } else { own.at + mean(&|c: &Loop| border.short(c.foot - own.at)) };
        let bound = own.held == Some(own.row);
        let held = own.held.unwrap_or(own.row + 1);
        let drawn = self.is_drawn(own);
        let bound_off = self.border.finished && held == self.rows;
        let head_up = |at: f64| match drawn {
            true => self.ring(at) + rims::BEYOND,
            false => self.up_at(held, at) + self.reach() + if bound { 0.5 } else { 0.0 },
        };
        // Where rows are short a row may climb along a stitch.
        let level = self.up_at(own.row, foot.at);
        let foot_up = |at: f64| foot.up + (self.up_at(own.row, at) - level);
        let swap = self.swap(own, head_up(head_at) - foot_up(head_at), head_at - foot.at);
        let head_depth = swap.map_or(DEPTH + LAYER * f64::from(own.rank), |s| s.depth);
        let foot_depth = self.foot_depth(own);
        let spread = match over && own.side != 0.0 {
            // Cast on for both layers, it is as wide as others where its layer is alone.
            true => 2.0,
            false if children().any(|c| c.bobble) => HOLDS_BOBBLE,
            false if drawn => rims::PINCHED,
            false => 1.0 + 0.8 * (count - 1.0),
        };
        // Its head is as wide as what is drawn through it.
        let spread = if own.children.is_empty() { spread } else { spread * mean(&|c: &Loop| c.wide) };
        let crossing = match over {
            true if own.is_lifted() => 0.46,
            true => 0.35,
            false => 0.5,
        };
        // A tuck stays on its side of the stitch that it is worked with.
        let reach = if over && own.rank > 0 { TAU / 14.0 } else { TAU / 6.0 };
        let piece = |k: usize| {
            let t = TAU * k as f64 / STEPS as f64;
            let head = 0.5 - 0.5 * t.cos();
            let (cos2, sin2) = ((2.0 * t).cos(), (2.0 * t).sin());
            let upper = smooth_step((head - 0.3) / 0.4);
            let mix = |low: f64, high: f64| low + (high - low) * upper;
            // At its ends a foot goes over into the neighbour's.
            let inside = smooth_step(t.min(TAU - t) / reach);
            let (side, end) = if k <= STEPS / 2 { (-1.0, ends[0]) } else { (1.0, ends[1]) };
            let turned = if own.twist == 0.0 { 1.0 } else { 1.0 - 2.0 * smooth_step((head - crossing) / 0.24 + 0.5) };
            let wide = match own.is_lifted() {
                true => NARROW,
                // What closes a bobble goes through heads that lie close.
                false => mix(if own.bobble { CLOSING } else { own.wide }, spread),
            };
            let across = (t / TAU - 0.5 + if over { 0.5 } else { 1.0 } * LEAN * sin2) * wide * turned;
            // Layers that are bound off together are beside each other before what closes them comes through.
            let lean = if own.side != 0.0 && bound_off { smooth_step((head - 0.2) / 0.4) } else { upper };
            let moved = swap.map_or(lean, |s| s.moved(head));
            let at = foot.at
                + (head_at - foot.at) * moved
                + step * across
                + (1.0 - inside) * (end.at - (foot.at + side * 0.5 * step * own.wide));
            let low = foot_up(at);
            let up = low + (head_up(at) - low) * head + (1.0 - inside) * (end.up - foot_up(end.at));
            let mut out = if over {
                laid_over(own, child, [foot.out, head_depth], head)
            } else {
                let deep = |depth: f64| if cos2 > 0.0 { depth } else { DEPTH };
                mix(-own.sign * deep(foot_depth), -child * deep(head_depth)) * cos2
            };
            out += swap.map_or(0.0, |s| s.raised(head)) + self.layer(own, head);
            if drawn {
                out += (Self::around(t / TAU) - out) * upper;
            }
            if own.bobble {
                // The last one of those that it is drawn through lies in the cloth.
                out += PILED * (1.0 - smooth_step((head - 0.42) / 0.16));
            }
            if own.twist != 0.0 {
                let bump = 1.0 - smooth_step((head - crossing).abs() / 0.25);
                out += side * own.twist * 0.55 * bump;
            }
            out += (1.0 - inside) * (end.out - foot.out);
            let place = Place { at, up, out };
            (place, [column as f32 + (t / TAU) as f32, own.row as f32 + 0.02 + 0.96 * head as f32])
        };
        let (places, grid) = (0..=STEPS).map(piece).unzip();
        Piece { places, grid, yarn: own.yarn }
    }
}

/// How far out a loop is that was laid over the needle, at a share of its height.
fn laid_over(own: &Loop, child: f64, [foot, head_depth]: [f64; 2], head: f64) -> f64 {
    let legs = if own.rank > 0 { 0.12 } else { 0.06 };
    // A lifted strand stays on its side of the heads of the row below.
    let [from, over] = match own.is_lifted() {
        true if own.layer == child => [0.5, 0.25],
        true => [0.3, 0.2],
        false => [0.0, 0.5],
    };
    let (low, high) = (smooth_step((head - from) / over), smooth_step(2.0 * head - 1.0));
    foot * (1.0 - low) - child * (legs * low + (head_depth - legs) * high)
}

/// A loop on its way to where it is worked passes others, between the heads of its own row and the feet of that above.
#[derive(Clone, Copy)]
struct Swap {
    /// From which share of its height on; it ends as far from the other end.
    from: f64,
    /// How far in front of the others it passes.
    front: f64,
    /// How far it lies over the last of those that are worked together with it, up to its head.
    over: f64,
    /// How deep its head dives without that.
    depth: f64,
}

impl Swap {
    /// The share of its height in which it comes forward, and goes back again.
    fn ramp(self) -> f64 {
        0.25 * (1.0 - 2.0 * self.from)
    }

    /// How much of the way across is behind it at a share of its height.
    fn moved(self, head: f64) -> f64 {
        smooth_step((head - self.from - self.ramp()) / (2.0 * self.ramp()))
    }

    /// How far it is in front there.
    fn raised(self, head: f64) -> f64 {
        let by = |off: f64| smooth_step((off - self.from) / self.ramp());
        self.front * by(head.min(1.0 - head)) + self.over * by(head)
    }
}

impl Loops {
    /// How a loop so many rows high, worked so far across from its feet, passes those that it changes places with, or that are
    /// worked together with it.
    fn swap(&self, own: &Loop, high: f64, across: f64) -> Option<Swap> {
        const FAR: f64 = 0.6;
        let child = &self.loops[*own.children.first()? as usize];
        let stitches = |d: f64| d.abs() * if self.border.turns { self.wide as f64 } else { 1.0 };
        let together = || child.parents.iter().map(|p| &self.loops[*p as usize]);
        let beside = together().any(|l| stitches(self.border.short(l.at - own.at)) > 0.25);
        let bound = together().any(|l| l.row == child.row);
        let last = (child.parents.len() - 1) as f64;
        let (mut front, mut over, mut depth) = (0.0, 0.0, DEPTH + LAYER * f64::from(own.rank));
        if child.layer != 0.0 {
            front = CABLE * child.layer.max(0.0);
        } else if beside && !bound {
            over = child.sign * LAYER * (last - f64::from(own.rank));
            depth = DEPTH + LAYER * last;
        } else if stitches(across) < FAR {
            return None;
        }
        // Heads reach so far up from the row below, and feet down from that above.
        Some(Swap { from: (2.0 * self.reach() / high).min(0.4), front, over, depth })
    }
}

/// The yarn passes a stitch.
fn pass_piece(column: u32, row: i32, foot: Foot, ends: [Foot; 2]) -> Piece {
    let piece = |k: usize| {
        let t = k as f64 / STEPS as f64;
        let (end, share) = if t < 0.5 { (ends[0], 2.0 * t) } else { (ends[1], 2.0 - 2.0 * t) };
        let share = smooth_step(share);
        let place = Place {
            at: end.at + (foot.at - end.at) * if t < 0.5 { 2.0 * t } else { 2.0 - 2.0 * t },
            up: end.up + (foot.up - end.up) * share,
            out: end.out + (foot.out - end.out) * share,
        };
        (place, [column as f32 + t as f32, row as f32 + 0.02])
    };
    let (places, grid) = (0..=STEPS).map(piece).unzip();
    Piece { places, grid, yarn: PASSED }
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
        Self { round, stacked: true, turns: false, finished: false, rims: Rims::default(), mirrored: false }
    }
}
