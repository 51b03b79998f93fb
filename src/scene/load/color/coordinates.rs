//! Where every point of a fabric's curves lies in the cloth: its stitch and row, its warp and weft.

use glam::Vec2;

use crate::{
    geometry::curve::Curve,
    pattern::{PatternStrand, StrandKind},
    scene::Fabric,
};

/// Where each control point of a fabric lies in its own grid.
pub(in crate::scene::load) struct FabricCoordinates {
    /// Wale and course, warp and weft, or the place along a yarn and the yarn's number; none where the latter holds for
    /// every curve.
    points: Vec<Vec<[f32; 2]>>,
    /// What each curve is in its cloth; none where nothing is known.
    pub(super) kinds: Vec<StrandKind>,
    /// Columns and rows.
    pub(super) extent: [f32; 2],
    /// Width and height of a stitch, mm, where that is known.
    pub(super) stitch: Option<[f32; 2]>,
    /// The yarn of each curve in the library, where each is of one colour; else empty.
    pub(super) own: Vec<usize>,
    /// Whether each warp and each weft is a thread, of one yarn all along.
    threads: bool,
}

impl FabricCoordinates {
    /// That of curves of which nothing is known: `columns` along each, and one row each.
    pub(in crate::scene::load) fn along(columns: f32, fabric: &Fabric) -> Self {
        let extent = [columns, fabric.curves.len() as f32];
        Self { points: Vec::new(), kinds: Vec::new(), extent, stitch: None, own: Vec::new(), threads: false }
    }

    /// That of cloth that the program makes, and its curves.
    pub(in crate::scene::load) fn of(strands: Vec<PatternStrand>, extent: [u32; 2]) -> (Vec<Curve>, Self) {
        let extent = extent.map(|n| n as f32);
        let mut grid =
            Self { points: Vec::new(), kinds: Vec::new(), extent, stitch: None, own: Vec::new(), threads: true };
        let curves = strands.into_iter().map(PatternStrand::smooth).map(|strand| {
            grid.points.push(strand.coordinates);
            grid.kinds.push(strand.kind);
            strand.curve
        });
        (curves.collect(), grid)
    }

    /// That of yarns laid on a garment, by stitches and rows from the corner of each panel, of which the largest has so many;
    /// a stitch is so wide and high, mm.
    pub(in crate::scene::load) fn laid(
        points: Vec<Vec<[f32; 2]>>,
        kinds: Vec<StrandKind>,
        extent: [f32; 2],
        stitch: [f32; 2],
    ) -> Self {
        Self { points, kinds, extent, stitch: Some(stitch), own: Vec::new(), threads: false }
    }

    /// The same of curves each of which is of one yarn of the library.
    pub(in crate::scene::load) fn with_yarns(mut self, own: Vec<usize>) -> Self {
        self.own = own;
        self
    }

    /// Of the curves of both, this one's first.
    pub(in crate::scene::load) fn join(&mut self, other: Self) {
        self.points.extend(other.points);
        self.kinds.extend(other.kinds);
    }

    /// Where a curve that is a thread begins, in the cloth.
    pub(super) fn thread(&self, curve: usize) -> Option<[f32; 2]> {
        let woven = matches!(self.kinds.get(curve), Some(StrandKind::Warp | StrandKind::Weft));
        self.points.get(curve)?.first().copied().filter(|_| self.threads && woven)
    }

    fn at(&self, curve: usize, point: usize, count: usize) -> [f32; 2] {
        match self.points.get(curve).and_then(|p| p.get(point)) {
            Some(at) => *at,
            None => [point as f32 / (count.max(2) - 1) as f32 * self.extent[0] * 0.999_99, curve as f32 + 0.5],
        }
    }

    /// Texture coordinates of each control point: columns and rows as shares of the fabric's, as a tint sees them.
    pub(in crate::scene::load) fn uvs(&self, fabric: &Fabric) -> Vec<Vec<Vec2>> {
        let of_curve = |(i, (curve, _)): (usize, &(Curve, Vec<f64>))| {
            let count = curve.points.len();
            (0..count).map(|point| Vec2::from(self.at(i, point, count)) / Vec2::from(self.extent)).collect()
        };
        fabric.curves.iter().enumerate().map(of_curve).collect()
    }

    /// At the place `place` of `steps` from each control point to the next.
    pub(super) fn between(&self, curve: usize, place: usize, steps: usize, count: usize) -> [f32; 2] {
        let (point, share) = ((place / steps).min(count - 1), (place % steps) as f32 / steps as f32);
        let (a, b) = (self.at(curve, point, count), self.at(curve, (point + 1).min(count - 1), count));
        // Where a round begins anew, its coordinates jump.
        if (0..2).any(|k| (b[k] - a[k]).abs() > 0.5 * self.extent[k]) {
            return a;
        }
        [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
    }
}

/// Into how many steps the way from one control point to the next is divided: about as long as the yarn is thick.
pub(super) fn steps(curve: &Curve, radii: &[f64]) -> usize {
    let thickness = 2.0 * radii.iter().sum::<f64>() / radii.len().max(1) as f64;
    let length = curve.polygon_length() / curve.points.len().max(2) as f64;
    ((length / thickness).ceil() as usize).clamp(1, 1024)
}
