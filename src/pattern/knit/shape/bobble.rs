//! Bobbles: five loops come out of one stitch (knit, over, knit, over, knit), five are drawn through them on the way back, and
//! one through all of these.
//!
//! They are laid on a pouch: up a neck in front of the stitches beside it, where it is no wider than one, over a belly, and back
//! into the row. Heights in the pouch are thirds of it: the stitch below is at 0, the way back begins at 1.5, the loop that
//! closes it is at 3.

use std::f64::consts::TAU;

use super::{
    super::loops::{BELLY, Loop, Loops, REACH},
    CLOSING, DEPTH, Foot, LEAN, Piece, Place, smooth_step, through,
};

/// The share of its yarn before the head of the loop that closes it.
pub(in super::super) const CLOSED: f64 = 0.94;

/// Loops on the way there and on the way back.
const LOOPS: usize = 5;
/// Places of each of them, and of each turn.
const STEPS: usize = 32;
const TURN: usize = 24;
/// How far the belly stands out, in diameters.
const OUT: f64 = 2.4;
/// Width of a loop in the neck and on the belly, in stitches; distance of the heads that are worked together.
const NECK: f64 = 0.2;
const WIDE: f64 = 0.8;
const CLOSE: f64 = 0.0;
/// How far the first of those heads lies in front of the last one, in diameters.
pub(super) const PILED: f64 = 2.4;
/// How far feet and the head at the top reach beyond the line where they hold each other; the same on the belly.
const LOW: f64 = 3.0 * REACH / BELLY;
const BELLY_REACH: f64 = 0.35;

struct Pouch {
    at: f64,
    up: f64,
    /// Width of a stitch in units of `at`, and a third of the pouch in those of `up`.
    step: f64,
    third: f64,
}

impl Pouch {
    /// A place `side` widths from the middle of loop `x` of -2 to 2, `out` diameters off the pouch.
    fn place(&self, x: f64, side: f64, v: f64, out: f64) -> Place {
        let opened = smooth_step((v - 1.0) / 0.25);
        let wide = NECK + (WIDE - NECK) * opened;
        let apart = if v < 1.5 { wide } else { CLOSE + (WIDE - CLOSE) * (1.0 - smooth_step((v - 2.15) / 0.25)) };
        self.flat(x * apart + side * wide, v, out + bulge(v))
    }

    /// A place so many stitches across, not on the pouch.
    fn flat(&self, across: f64, v: f64, out: f64) -> Place {
        Place { at: self.at + self.step * across, up: self.up + v * self.third, out }
    }

    /// A loop out of the stitch below, or over the needle between two of these.
    fn there(&self, x: f64, over: bool) -> Vec<Place> {
        // Feet lie behind the stitch, and what is laid over the needle passes behind its head.
        const BEHIND: f64 = 1.1;
        let place = |k: usize| {
            let t = TAU * k as f64 / STEPS as f64;
            let (head, cos2) = (0.5 - 0.5 * t.cos(), (2.0 * t).cos());
            let v = -LOW + (1.5 + BELLY_REACH + LOW) * head;
            let side = t / TAU - 0.5 + LEAN * (2.0 * t).sin();
            let foot = if cos2 > 0.0 { BEHIND } else { DEPTH };
            let drawn = -(foot + (DEPTH - foot) * smooth_step((head - 0.3) / 0.4)) * cos2;
            let behind = -BEHIND - 0.6 * smooth_step((v + LOW) / 0.4) - bulge(v);
            let out = if over { behind + (drawn - behind) * smooth_step((v - 0.8) / 0.35) } else { drawn };
            self.place(x, side, v, out)
        };
        (0..STEPS).map(place).collect()
    }

    /// One on the way back, from right to left. Their heads lie over each other, the left one in front and the right one in the
    /// cloth.
    fn back(&self, x: f64) -> Vec<Place> {
        let foot = 1.5 - BELLY_REACH;
        let place = |k: usize| {
            let t = TAU * (1.0 - k as f64 / STEPS as f64);
            let head = 0.5 - 0.5 * t.cos();
            let side = t / TAU - 0.5 + LEAN * (2.0 * t).sin();
            let out = -DEPTH * (2.0 * t).cos() + PILED * (2.0 - x) / 4.0 * smooth_step((head - 0.31) / 0.14);
            self.place(x, side, foot + (3.0 + LOW - foot) * head, out)
        };
        (0..STEPS).map(place).collect()
    }
}

/// How far out the pouch is at a height.
fn bulge(v: f64) -> f64 {
    OUT * smooth_step((v - 0.5) / 0.9) * (1.0 - smooth_step((v - 1.9) / 0.8))
}

impl Loops {
    /// A bobble whose first foot is at `foot`, between the ends of its neighbours.
    pub(super) fn bobble(&self, own: &Loop, column: u32, foot: Foot, ends: [Foot; 2], step: f64) -> Piece {
        let up = self.up_at(own.row, own.at);
        let pouch = Pouch { at: foot.at, up, step, third: BELLY / (3.0 * self.room()) };
        // The loop that closes it.
        let closing = Foot { up: up + 3.0 * pouch.third - self.reach(), ..foot };
        let side = |by: f64| Foot { at: foot.at + by * step, out: closing.out, ..closing };
        let last = self.loop_piece(own, column, closing, [side(-0.5 * CLOSING), side(0.5 * CLOSING)], step);
        let (open, shut) = (last.places[0], last.places[last.places.len() - 1]);
        let end = |f: Foot| Place { at: f.at, up: f.up, out: f.out };
        let numbers = || (0..LOOPS).map(|i| i as f64 - 2.0);

        let mut places: Vec<Place> = numbers().enumerate().flat_map(|(i, x)| pouch.there(x, i % 2 == 1)).collect();
        places[0] = end(ends[0]);
        places.extend(through(
            &[
                pouch.place(2.0, 0.5, -LOW, -1.1),
                pouch.place(2.0, 0.68, 0.1, -0.9),
                pouch.place(2.0, 0.72, 0.7, -0.5),
                pouch.place(2.0, 0.72, 1.05, -0.4),
                pouch.place(2.0, 0.5, 1.5 - BELLY_REACH, -DEPTH),
            ],
            TURN,
        ));
        numbers().rev().for_each(|x| places.extend(pouch.back(x)));
        places.extend(through(
            &[
                pouch.place(-2.0, -0.5, 1.5 - BELLY_REACH, -DEPTH),
                pouch.place(-2.0, -0.75, 1.45, -0.6),
                pouch.place(-2.0, -0.7, 1.9, -0.3),
                pouch.place(-2.0, -0.62, 2.22, 0.3),
                pouch.place(-2.0, -0.55, 2.36, 0.4),
                pouch.flat(-0.45, 2.42, 0.2),
                open,
            ],
            TURN,
        ));
        let before = places.len();
        places.extend(&last.places[..last.places.len() - 1]);
        // Down behind it, to the next stitch.
        places.extend(through(&[shut, pouch.flat(0.48, 1.6, -1.4), pouch.flat(0.5, 0.2, -1.4), end(ends[1])], TURN));
        places.push(end(ends[1]));
        let count = places.len() as f32;
        let grid = |k: usize| {
            let course = k.checked_sub(before).and_then(|k| last.grid.get(k)).map_or(own.row as f32 + 0.3, |g| g[1]);
            [column as f32 + k as f32 / count, course]
        };
        Piece { grid: (0..places.len()).map(grid).collect(), places, yarn: own.yarn, bends: own.yarn }
    }
}

/// Where the loops of a bobble begin and end in its piece, in the order of the yarn.
#[cfg(test)]
pub(in super::super) fn loops() -> Vec<std::ops::Range<usize>> {
    let there = (0..LOOPS).map(|i| i * STEPS..(i + 1) * STEPS);
    let back = there.clone().map(|r| r.start + LOOPS * STEPS + TURN..r.end + LOOPS * STEPS + TURN);
    let last = 2 * (LOOPS * STEPS + TURN);
    there.chain(back).chain(std::iter::once(last..last + super::STEPS)).collect()
}
