//! Straight ways between the cells of an ellipse: rings and sectors of the circle that it becomes when its axes are made equal.

use std::f64::consts::TAU;

use super::{RINGS, Spacing};

/// Sectors of the whole, a multiple of 4.
pub(super) const SECTORS: usize = 12;
/// Those from the short axis to the long one, with both.
pub(super) const QUARTER: usize = SECTORS / 4 + 1;
/// Ring by ring, sector by sector from the short axis on.
pub(super) const CELLS: usize = RINGS * SECTORS;

/// How many events are expected on a way of so many mean free paths after one: of fibres that keep `apart`, all the more of them are missing on
/// it the longer it is, `apart` at last.
fn expected(length: f64, apart: f64) -> f64 {
    if apart > 0.0 { length + apart * (-length / apart).exp_m1() } else { length }
}

/// The way on which so many are.
pub(super) fn length_of(expected: f64, apart: f64) -> f64 {
    if apart <= 0.0 {
        return expected;
    }
    // x + e^-x - 1 = y, by Newton from above.
    let y = expected / apart;
    let mut x = y + (2.0 * y).sqrt().min(1.0);
    for _ in 0..3 {
        let free = -(-x).exp_m1();
        if free < 1e-9 {
            break;
        }
        x -= (x - free - y) / free;
    }
    apart * x
}

/// A way from the middle of a cell.
pub(super) struct Flight {
    /// In the circle that the section becomes.
    from: (f64, f64),
    /// There, for each mean free path.
    step: (f64, f64),
    /// Until nothing is left to be met, in mean free paths.
    length: f64,
    apart: f64,
    /// The chance to meet something.
    pub(super) met: f64,
}

impl Flight {
    /// At an angle (radians) from the short axis of a section whose half axes are so many mean free paths long.
    pub(super) fn new(cell: usize, angle: f64, [short, long]: [f64; 2], spacing: Spacing) -> Self {
        let r2 = ((cell / SECTORS) as f64 + 0.5) / RINGS as f64;
        let (sin, cos) = (TAU * (cell % SECTORS) as f64 / SECTORS as f64).sin_cos();
        let (x, y) = (r2.sqrt() * cos, r2.sqrt() * sin);
        let (sin, cos) = angle.sin_cos();
        let (dx, dy) = (cos / short, sin / long);
        let (square, outward) = (dx * dx + dy * dy, x * dx + y * dy);
        let rim = ((outward * outward + square * (1.0 - r2)).sqrt() - outward) / square;
        let Spacing { lead, apart } = spacing;
        let length = (rim - lead).max(0.0);
        let met = -(-expected(length, apart)).exp_m1();
        Self { from: (x, y), step: (dx, dy), length, apart, met }
    }

    /// In the circle, where light meets something, when the share `u` of what does has done so: evenly along the way where next to nothing is met.
    pub(super) fn at(&self, u: f64) -> (f64, f64) {
        let s = if self.met > 1e-9 { length_of(-(-u * self.met).ln_1p(), self.apart) } else { u * self.length };
        (self.from.0 + s * self.step.0, self.from.1 + s * self.step.1)
    }
}

/// In which cells a point is, and how much in each: by a cubic between the sectors, or light would spread around.
pub(super) fn landing((x, y): (f64, f64)) -> [(usize, f64); 4] {
    let ring = (((x * x + y * y) * RINGS as f64) as usize).min(RINGS - 1);
    let at = y.atan2(x) / TAU * SECTORS as f64 + SECTORS as f64;
    let (sector, t) = (at as usize, at.fract());
    let weights = [
        -t * (t - 1.0) * (t - 2.0) / 6.0,
        (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
        -t * (t + 1.0) * (t - 2.0) / 2.0,
        t * (t + 1.0) * (t - 1.0) / 6.0,
    ];
    std::array::from_fn(|k| (ring * SECTORS + (sector + SECTORS + k - 1) % SECTORS, weights[k]))
}
