//! Yarn curves made by formula, for scenes without a file.

use std::f64::consts::TAU;

use glam::DVec3;

use super::curve::{Basis, Curve};

/// A flat stockinette swatch: rows of interlocking loops. Lengths in units of the yarn's diameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stockinette {
    /// Loops in a row.
    pub stitches: u32,
    /// Rows.
    pub rows: u32,
    /// Width of a stitch.
    pub width: f64,
    /// Distance between rows.
    pub height: f64,
    /// Control points of a loop.
    pub points: u32,
}

impl Stockinette {
    /// Proportions found by a search for the densest stitch of this form whose strands keep 1.02 diameters apart:
    /// 14.5 diameters of yarn in a stitch, as in real knits (13 to 15).
    pub const WIDTH: f64 = 4.13;
    /// As [`Self::WIDTH`].
    pub const HEIGHT: f64 = 2.28;

    /// The rows, each one open curve in the plane z = 0, centred; right side towards +z.
    ///
    /// x = t + a sin 2t, y = h cos t, z = -d cos 2t per loop (after Crane, "A Simple Parametric Model of Plain-Knit Yarns",
    /// 2023): the legs of a loop lie in front of the head of the loop below.
    pub fn curves(&self, diameter: f64) -> Vec<Curve> {
        let per_radian = self.width / TAU;
        // From the same search: how far a loop reaches into its neighbours, leans out, and dives.
        let (reach, lean, depth) = (1.915, 0.982, 0.763);
        let count = self.stitches * self.points;
        (0..self.rows)
            .map(|row| {
                let base = (f64::from(row) - 0.5 * f64::from(self.rows - 1)) * self.height;
                let points = (0..=count)
                    .map(|i| {
                        let t = TAU * f64::from(i) / f64::from(self.points);
                        let x = (t - 0.5 * TAU * f64::from(self.stitches)) * per_radian + lean * (2.0 * t).sin();
                        DVec3::new(x, base - reach * t.cos(), -depth * (2.0 * t).cos()) * diameter
                    })
                    .collect();
                Curve { basis: Basis::CatmullRom, closed: false, points, radii: None }
            })
            .collect()
    }
}

/// Parallel straight yarns along x, `spacing` apart along y, centred.
pub fn straight(count: u32, length: f64, spacing: f64) -> Vec<Curve> {
    (0..count)
        .map(|i| {
            let y = (f64::from(i) - 0.5 * f64::from(count - 1)) * spacing;
            let points = [-0.5, -1.0 / 6.0, 1.0 / 6.0, 0.5].map(|x| DVec3::new(x * length, y, 0.0)).to_vec();
            Curve { basis: Basis::CatmullRom, closed: false, points, radii: None }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loops_interlock_without_cutting_through_each_other() {
        let swatch =
            Stockinette { stitches: 3, rows: 4, width: Stockinette::WIDTH, height: Stockinette::HEIGHT, points: 64 };
        let curves = swatch.curves(1.0);
        let mut nearest = f64::MAX;
        for (i, a) in curves.iter().enumerate() {
            for b in &curves[i + 1..] {
                for p in &a.points {
                    for q in &b.points {
                        nearest = nearest.min(p.distance(*q));
                    }
                }
            }
        }
        eprintln!("nearest strands: {nearest:.3} diameters");
        assert!(nearest > 1.0, "strands of different rows come within {nearest} diameters");
        assert!(nearest < 1.1, "loops hang in each other: {nearest}");
        // The head of a loop of the row below is behind the legs of the row above where they cross.
        let own = swatch.curves(1.0)[1].points.clone();
        let nearest_own = (0..own.len())
            .flat_map(|i| ((i + 20)..own.len()).map(move |j| (i, j)))
            .map(|(i, j)| own[i].distance(own[j]))
            .fold(f64::MAX, f64::min);
        eprintln!("nearest strands of one row: {nearest_own:.3} diameters");
        assert!(nearest_own > 1.0);
    }

    #[test]
    fn straight_yarns_are_straight_and_centred() {
        let yarns = straight(3, 12.0, 2.0);
        assert_eq!(yarns.len(), 3);
        assert_eq!(yarns[0].points[0], DVec3::new(-6.0, -2.0, 0.0));
        assert_eq!(yarns[2].points[3], DVec3::new(6.0, 2.0, 0.0));
    }
}
