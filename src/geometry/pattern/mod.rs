//! Cloth without files: weaving drafts and knitting charts become yarn curves.
//!
//! [`draft`] and [`weave`] make woven cloth, [`chart`] and [`knit`] knitted cloth, flat, as a tube or on a surface of
//! [`revolution`]; `relax` lets yarns push each other apart until they touch, and [`overlap`] measures what is left.
//! Nothing here draws a random number: the same description gives the same curves to the bit.

pub mod chart;
mod contact;
pub mod draft;
pub mod knit;
pub mod overlap;
mod relax;
pub mod revolution;
pub mod weave;

use glam::DVec3;

use super::curve::{Basis, Curve};

/// The most control points that a generator makes, as many as a curve file may hold.
pub const MAX_POINTS: u64 = 1 << 26;

/// What a strand is in its cloth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StrandKind {
    /// A row of a knit, counted from the cast-on edge.
    Course,
    /// A yarn along the loom (y), counted from the left.
    Warp,
    /// A yarn across the loom (x), counted from the bottom.
    Weft,
}

/// A yarn of a made cloth with its place in it.
#[derive(Clone, Debug)]
pub struct PatternStrand {
    /// Its curve.
    pub curve: Curve,
    /// Row of a knit, warp or weft.
    pub kind: StrandKind,
    /// Which of its kind, from 0.
    pub index: u32,
    /// Where each control point of the curve is in the cloth's own grid: wale and course of a knit, warp and weft of a
    /// weave. Stitch or crossing i spans i to i + 1, and its centre is at i + 1/2.
    pub coordinates: Vec<[f32; 2]>,
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
    fn straight_yarns_are_straight_and_centred() {
        let yarns = straight(3, 12.0, 2.0);
        assert_eq!(yarns.len(), 3);
        assert_eq!(yarns[0].points[0], DVec3::new(-6.0, -2.0, 0.0));
        assert_eq!(yarns[2].points[3], DVec3::new(6.0, 2.0, 0.0));
    }
}
