//! Cloth without files: weaving drafts and knitting charts become yarn curves.
//!
//! [`draft`] and [`weave`] make woven cloth, [`chart`] and [`knit`] knitted cloth, flat, as a tube or on a surface of
//! [`revolution`], or as a [`tile`] that is laid elsewhere; `rods` relaxes yarns as elastic rods, `relax` lets those of a
//! tile push each other apart until they touch, and `bend` tells where a yarn folds. What overlap is left [`overlap`] measures, and
//! `crowded` tells of much.
//!
//! [`overlap`]: crate::geometry::overlap
//! What happens by chance (how pile leans, where a fringe ends) is a function of its place: the same description gives the
//! same curves to the bit.

mod bend;
pub mod chart;
mod crowded;
pub mod draft;
pub mod knit;
pub mod knitspeak;
pub(crate) mod period;
mod relax;
pub mod revolution;
mod rods;
pub mod tile;
pub mod weave;
pub mod wif;

use glam::DVec3;

use crate::geometry::{
    chain::Chain,
    curve::{Basis, Curve},
};

/// The most control points that a generator makes, as many as a curve file may hold.
pub const MAX_POINTS: u64 = 1 << 27;

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
    /// Of how much of a yarn's section it is: 1, but for the strands that a cut tuft opens into.
    pub share: f64,
}

impl PatternStrand {
    /// Whether it is a strand of a cut tuft.
    pub(crate) fn is_of_tuft(&self) -> bool {
        self.share < 1.0
    }

    /// Length of yarn that it takes, in the curve's unit.
    pub fn yarn_length(&self) -> f64 {
        self.share * self.curve.polygon_length()
    }

    /// With the smoothest curve through the same points, a B-spline. Embree meets it sooner than a Catmull-Rom curve, it
    /// has no jumps of curvature where segments join, and so fewer points follow it.
    pub fn smooth(mut self) -> Self {
        let curve = &mut self.curve;
        let given = curve.radii.take();
        let chain = Chain::new(curve, given.as_deref().unwrap_or(&vec![0.0; curve.points.len()]));
        let knots: Vec<(usize, f64)> =
            (0..chain.segments()).map(|i| (i, 0.0)).chain([(chain.segments() - 1, 1.0)]).collect();
        let flattening = curve.flattening.take();
        let through = chain.through(&knots, curve.closed, Basis::BSpline);
        *curve = through.curve(curve.closed);
        let count = curve.points.len();
        curve.radii = given.map(|_| through.points[..count].iter().map(|p| p.w).collect());
        curve.flattening = flattening;
        if !curve.closed {
            // An open one has a control point beyond each end.
            self.coordinates.insert(0, self.coordinates[0]);
            self.coordinates.extend(self.coordinates.last().copied());
            if let Some(axes) = &mut curve.flattening {
                axes.insert(0, axes[0]);
                axes.extend(axes.last().copied());
            }
        }
        self
    }
}

/// Parallel straight yarns along x, `spacing` apart along y, centred.
pub fn straight(count: u32, length: f64, spacing: f64) -> Vec<Curve> {
    (0..count)
        .map(|i| {
            let y = (f64::from(i) - 0.5 * f64::from(count - 1)) * spacing;
            let points = [-0.5, -1.0 / 6.0, 1.0 / 6.0, 0.5].map(|x| DVec3::new(x * length, y, 0.0)).to_vec();
            Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening: None }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_strands_pass_the_same_points() {
        let points: Vec<DVec3> = (0..12).map(|i| DVec3::new(f64::from(i), f64::from(i * i % 5), 0.0)).collect();
        for closed in [false, true] {
            let strand = PatternStrand {
                curve: Curve {
                    basis: Basis::CatmullRom,
                    closed,
                    points: points.clone(),
                    radii: None,
                    flattening: None,
                },
                kind: StrandKind::Course,
                index: 0,
                coordinates: (0..12).map(|i| [i as f32, 0.5]).collect(),
                share: 1.0,
            };
            let smooth = strand.smooth();
            let count = smooth.curve.points.len();
            assert_eq!(smooth.coordinates.len(), count);
            let chain = Chain::new(&smooth.curve, &vec![0.0; count]);
            for (i, want) in points.iter().enumerate() {
                let at = if i < chain.segments() { chain.at(i, 0.0) } else { chain.at(i - 1, 1.0) };
                assert!((at.at.truncate() - *want).length() < 1e-12, "closed {closed}: point {i} is at {}", at.at);
                // The control point that stands for it.
                assert_eq!(smooth.coordinates[i + usize::from(!closed)][0], i as f32);
            }
        }
    }

    #[test]
    fn straight_yarns_are_straight_and_centred() {
        let yarns = straight(3, 12.0, 2.0);
        assert_eq!(yarns.len(), 3);
        assert_eq!(yarns[0].points[0], DVec3::new(-6.0, -2.0, 0.0));
        assert_eq!(yarns[2].points[3], DVec3::new(6.0, 2.0, 0.0));
    }
}
