//! The rims of a finished piece: loops of the last row that are drawn together, the rope of a cable cast-on, and the chain of what
//! is bound off within the piece.

use std::f64::consts::TAU;

use super::{
    super::{
        loops::{Loop, Loops},
        rims::CastOn,
    },
    Foot, Piece, Place, STEPS, smooth_step, through,
};

/// How far heads reach beyond the yarn that draws them together, in rows, and how narrow they are.
pub(super) const BEYOND: f64 = 0.33;
pub(super) const PINCHED: f64 = 0.3;
/// How far below that yarn a loop's left leg is and how far above its right one, in diameters.
const AROUND: f64 = 1.0;
/// Steps of each half of a rope's stitch.
const ROPE: usize = 32;
/// Which part of a loop stands above a rope, as shares of it.
const STANDS: [usize; 2] = [STEPS * 9 / 32, STEPS * 23 / 32];

/// How far up the neck of a loop is that is bound off, where the one before lies around it, and how far its yarn goes up above
/// that, in rows.
const NECK: f64 = 0.62;
const ABOVE: f64 = 0.87;
/// Up to which place such a loop stands, and from which one on again.
const UPRIGHT: [usize; 2] = [STEPS * 12 / 64, STEPS - STEPS * 12 / 64];

impl Loops {
    /// Whether a loop is drawn together with all of its row.
    pub(in super::super) fn is_drawn(&self, own: &Loop) -> bool {
        self.border.is_drawn() && own.children.is_empty() && own.held == Some(self.rows)
    }

    /// How far out a loop that is drawn together is near its head, so far along it: it stands across the yarn that draws it.
    pub(super) fn around(along: f64) -> f64 {
        const HEAD: f64 = 0.17;
        AROUND * (0.25 * TAU * ((along - 0.5) / HEAD).clamp(-1.0, 1.0)).sin()
    }

    /// Whether a loop is of a cable cast-on.
    pub(super) fn is_roped(&self, own: &Loop) -> bool {
        own.row < 0 && !own.is_lifted() && self.border.rims.cast_on == CastOn::Cable
    }

    /// How far up the ring is that draws loops together: at the end of the profile all around, where rounds rise by a row.
    pub(super) fn ring(&self, at: f64) -> f64 {
        f64::from(self.rows) + 0.5 - at
    }

    /// The yarn through a loop: over its left leg and under its right one. Before the `first` it comes up from inside, and
    /// after the `last` it stays there.
    pub(super) fn through_piece(&self, column: u32, at: f64, step: f64, [first, last]: [bool; 2]) -> Piece {
        const RISE: f64 = 0.35;
        let end = if last { 0.3 } else { 0.5 };
        let place = |k: usize| {
            let share = k as f64 / STEPS as f64;
            let s = -0.5 + (end + 0.5) * share;
            let below = if first { 1.0 - smooth_step((s + 0.5) / RISE) } else { 0.0 };
            let at = at + s * step;
            let place = Place { at, up: self.ring(at) - 0.6 * below, out: -1.2 * below };
            (place, [column as f32 + share as f32, self.rows as f32 + 0.02])
        };
        let (places, grid) = (0..=STEPS).map(place).unzip();
        Piece { places, grid, yarn: 0.0, bends: 0.0 }
    }

    /// A loop that is bound off within the piece: it stands up to its neck, is laid to the side and around the next one, the leg that was
    /// worked first before both of its legs, the other one behind them.
    pub(super) fn bound_piece(&self, own: &Loop, column: u32, foot: Foot, ends: [Foot; 2], step: f64) -> Piece {
        let stands = Loop { children: Vec::new(), held: None, ..own.clone() };
        let whole = self.loop_piece(&stands, column, foot, ends, step);
        let next = &self.loops[own.children[0] as usize];
        let away = self.border.short(next.at - own.at) / step;
        let side = away.signum();
        let next_sign = if next.sign == 0.0 { 1.0 } else { next.sign };
        // Half the width of the next one's neck, and how far out that is.
        let (wide, neck) = if self.is_bound_within(next) { (0.12, 0.25) } else { (0.3, 0.6) };
        let [near, far] = [away.abs() - wide, away.abs() + wide];
        let out = neck * next_sign;
        let knots = [
            [-0.12, NECK, 0.25 * own.sign],
            [0.05, ABOVE, 0.6 * own.sign],
            [0.36, ABOVE, own.sign],
            [near, NECK, out + own.sign],
            [far, NECK, out + own.sign],
            [far + 0.23, NECK, out],
            [far, NECK, out - own.sign],
            [near, NECK, out - own.sign],
            [0.54, ABOVE, -0.7 * own.sign],
            [0.3, ABOVE, -0.2 * own.sign],
            [0.12, NECK, 0.25 * own.sign],
        ];
        let up = self.up_at(own.row, own.at);
        let place = |[across, above, out]: [f64; 3]| Place { at: own.at + side * across * step, up: up + above, out };
        let mut knots: Vec<Place> = knots.map(place).into();
        if side < 0.0 {
            knots.reverse();
        }
        let [from, to] = UPRIGHT;
        knots.insert(0, whole.places[from]);
        knots.push(whole.places[to]);
        let mut places = whole.places[..from].to_vec();
        places.extend(through(&knots, 3 * ROPE));
        places.extend(&whole.places[to..]);
        let base = own.row as f32 + 0.02;
        let rise = whole.grid[from][1] - base;
        let course = |k: usize| {
            let along = k.saturating_sub(from).min(3 * ROPE) as f32 / (3 * ROPE) as f32;
            let laid = rise + (0.96 - rise) * (1.0 - (2.0 * along - 1.0).abs());
            match k {
                _ if k < from => whole.grid[k][1],
                _ if k > from + 3 * ROPE => whole.grid[k - 3 * ROPE - from + to][1],
                _ => base + laid,
            }
        };
        let count = places.len() as f32;
        let grid = (0..places.len()).map(|k| [column as f32 + k as f32 / count, course(k)]).collect();
        Piece { places, grid, yarn: own.yarn, bends: own.yarn }
    }

    /// A loop of a cable cast-on: drawn to the front between the two before it, across the last one and up. `ends_row` says
    /// whether it is the left or the right one of the row.
    pub(super) fn roped_piece(
        &self,
        own: &Loop,
        column: u32,
        foot: Foot,
        ends: [Foot; 2],
        step: f64,
        ends_row: [bool; 2],
    ) -> Piece {
        let whole = self.loop_piece(own, column, foot, ends, step);
        let [from, to] = STANDS;
        let stands = &whole.places[from..=to];
        // The loop before is on the right, unless it is cast on from the left.
        let side = if self.border.mirrored { -1.0 } else { 1.0 };
        let knot =
            |[across, up, out]: [f64; 3]| Place { at: foot.at + side * across * step, up: foot.up + 1.0 + up, out };
        const BEHIND: [[f64; 3]; 4] = [[0.5, -0.62, 0.0], [0.2, -0.7, -1.25], [-0.2, -0.85, -1.2], [-0.4, -0.65, -0.5]];
        const BEFORE: [[f64; 3]; 5] =
            [[0.38, -0.75, 0.45], [0.62, -0.98, 1.1], [1.0, -0.9, 1.45], [1.35, -0.74, 1.1], [1.5, -0.62, 0.0]];
        let (first, last) = if self.border.mirrored { (ends_row[1], ends_row[0]) } else { (ends_row[0], ends_row[1]) };
        let (near, far) = if self.border.mirrored { (to, from) } else { (from, to) };
        // From the gap behind to the loop that stands, and from there before the one on the side to the next gap.
        let plain = |k: usize| whole.places[if k < STEPS / 2 { 0 } else { STEPS }];
        let behind: Vec<Place> = match first {
            true => vec![plain(near), whole.places[near]],
            false => BEHIND.iter().map(|k| knot(*k)).chain([whole.places[near]]).collect(),
        };
        let before: Vec<Place> = match last {
            true => vec![whole.places[far], plain(far)],
            false => std::iter::once(whole.places[far]).chain(BEFORE.iter().map(|k| knot(*k))).collect(),
        };
        let [left, right] = match self.border.mirrored {
            false => [behind, before],
            true => [before.into_iter().rev().collect(), behind.into_iter().rev().collect::<Vec<_>>()],
        };
        let mut places: Vec<Place> = through(&left, ROPE).collect();
        places.extend(&stands[..stands.len() - 1]);
        places.extend(through(&right, ROPE));
        places.push(right[right.len() - 1]);
        let count = places.len() as f32;
        let course = |k: usize| match k.checked_sub(ROPE).and_then(|k| whole.grid[from..to].get(k)) {
            Some(grid) => grid[1],
            None => own.row as f32 + 0.02,
        };
        let grid = (0..places.len()).map(|k| [column as f32 + k as f32 / count, course(k)]).collect();
        Piece { places, grid, yarn: own.yarn, bends: own.yarn }
    }
}
