//! A top that is drawn together: the yarn through all loops of the last row, pulled tight, and its tail inside.

use glam::DVec3;

use super::{super::shape::Place, Laying};
use crate::geometry::spline::through_points;

/// Points on a stretch of the yarn that is drawn, in a piece with so many in a stitch, and its length.
pub(super) fn drawn_points(line: &[DVec3], per_stitch: u32) -> (usize, f64) {
    /// Length of a segment, in diameters, where a stitch has 14 points.
    const STEP: f64 = 0.55;
    /// It is pulled so much shorter than it is laid.
    const TIGHT: f64 = 0.85;
    let length: f64 = line.windows(2).map(|w| w[0].distance(w[1])).sum();
    let count = (length / STEP * f64::from(per_stitch) / 14.0).ceil().max(3.0);
    (count as usize, TIGHT * length)
}

impl Laying<'_> {
    /// The tail: from the last loop to the inside and back down behind the stitches.
    pub(super) fn drawn_in(&self, end: Place) -> Vec<DVec3> {
        const DEEP: f64 = 3.1;
        let step = 1.0 / self.loops.wide as f64;
        // How far on around, how far down in rows, and how deep.
        const WAY: [[f64; 3]; 5] =
            [[0.0, 0.0, 0.0], [0.0, 0.0, 0.35], [-0.05, 0.25, 0.8], [-0.1, 1.0, 1.0], [-0.1, 2.4, 1.0]];
        let knots = WAY.map(|[on, down, deep]| {
            let at = end.at + on * step;
            // The round rises by a row.
            let up = end.up - down - (at - end.at);
            self.surface.place(self.loops.rows, &Place { at, up, out: end.out - deep * (DEEP + end.out) })
        });
        (0..=16 * (knots.len() - 1)).map(|k| through_points(&knots, k / 16, (k % 16) as f64 / 16.0)).collect()
    }
}
