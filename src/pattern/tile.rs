//! A patch of cloth that repeats along x and y: what is laid over garments.
//!
//! Every maker of cloth can give one: a [`Knit`](super::knit::Knit), a [`Weave`](super::weave::Weave), a periodic curve file.
//! A tile knows its stitches and its yarns and nothing of where they came from (`made`). It can be pulled and sheared
//! (`strained`), and its yarns go on from repeat to repeat as smooth lines (`strand`).

mod chain;
mod made;
mod strained;
mod strand;
#[cfg(test)]
mod tests;

use glam::{DVec2, DVec3, Vec3};

pub use self::chain::chain;
pub(super) use self::made::RelaxedRows;
use super::StrandKind;
use crate::geometry::{
    curve::{Basis, Curve},
    overlap::{Overlap, overlap_of_plied},
};

/// A periodic patch of cloth in the plane z = 0, right side towards +z, its lower left corner at the origin.
#[derive(Clone, Debug)]
pub struct Tile {
    /// Its width and height, after which it repeats, in the unit of all its lengths.
    pub period: DVec2,
    /// Stitches and rows of a knit in it, ends and picks of a weave.
    pub counts: [u32; 2],
    /// Its yarns, each once.
    pub strands: Vec<TileStrand>,
    /// Width over height to which stitches press its yarns where they lie on each other: sections follow from where yarns are.
    /// `None` where sections are as the tile's maker left them.
    pub flatten: Option<f64>,
}

/// One yarn of a [`Tile`] from its start to where it repeats.
#[derive(Clone, Debug)]
pub struct TileStrand {
    /// What it is in its cloth.
    pub kind: StrandKind,
    /// Which of its kind in the tile, from 0: row of a knit, warp or weft.
    pub index: u32,
    /// Points that it passes through smoothly; the point after the last is the first one, `step` periods on.
    pub points: Vec<DVec3>,
    /// How many periods across and up lie between its start and its own continuation; both 0 for a ring.
    pub step: [i32; 2],
    /// Its outer radius where it is round.
    pub radius: f64,
    /// Half of the room that it takes beside others, over its radius: see
    /// [`mean_half_width`](crate::geometry::yarn::mean_half_width).
    pub half_width: f64,
    /// Its section at each point; empty if it is round everywhere.
    pub sections: Vec<Section>,
    /// At each point its place in stitches and rows (ends and picks) from the tile's corner: what colours are laid by.
    pub coordinates: Vec<[f32; 2]>,
}

/// A section that is pressed flat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Half of its longer axis.
    pub half_width: f32,
    /// Direction of its shorter axis times the ratio of the shorter to the longer one, as [`Curve::flattening`] has it.
    pub short_axis: Vec3,
}

impl Tile {
    /// Width and height of a stitch.
    pub fn stitch(&self) -> DVec2 {
        self.period / DVec2::new(f64::from(self.counts[0]), f64::from(self.counts[1]))
    }

    /// Length of all its yarns.
    pub fn length(&self) -> f64 {
        self.strands.iter().map(|s| s.length(self.period)).sum()
    }

    /// The thickest yarn's diameter.
    pub fn diameter(&self) -> f64 {
        2.0 * self.strands.iter().map(|s| s.radius).fold(0.0, f64::max)
    }

    /// The tile, its yarns and their thickness, times a number.
    pub fn scaled(mut self, by: f64) -> Self {
        self.period *= by;
        for strand in &mut self.strands {
            strand.radius *= by;
            strand.points.iter_mut().for_each(|p| *p *= by);
            strand.sections.iter_mut().for_each(|s| s.half_width *= by as f32);
        }
        self
    }

    /// How far its yarns run into each other, lying flat; `None` where nothing lies near, and where yarns are so much thicker
    /// than the tile is wide that this would take more than 2^24 points.
    pub fn overlap(&self) -> Option<Overlap> {
        // Enough of it that most of the yarn has all its neighbours.
        let count = (16.0 * self.diameter() / self.period).ceil().max(DVec2::splat(3.0));
        let points: usize = self.strands.iter().map(|s| s.points.len()).sum();
        if count.max_element() > 3.0 && count.element_product() * points as f64 > f64::from(1 << 24) {
            return None;
        }
        let count = count.as_uvec2();
        let piece = self.repeated(count.x, count.y);
        let curves: Vec<(Curve, Vec<f64>, f64)> = piece
            .strands
            .into_iter()
            .map(|s| {
                let (radii, flattening) = s.radii_and_flattening();
                let closed = s.step == [0, 0];
                let curve = Curve { basis: Basis::CatmullRom, closed, points: s.points, radii: None, flattening };
                (curve, radii, s.half_width)
            })
            .collect();
        overlap_of_plied(curves.iter().map(|(curve, radii, half_width)| (curve, radii.as_slice(), *half_width)))
    }

    /// So many tiles beside and above each other as one: what is relaxed must not meet its own images.
    pub fn repeated(&self, across: u32, up: u32) -> Self {
        let [columns, rows] = self.counts;
        let mut strands = Vec::new();
        for strand in &self.strands {
            // Along its way copies continue each other, if it goes straight across or up.
            let [run, beside] = match strand.step {
                [1 | -1, 0] => [across, 1],
                [0, 1 | -1] => [up, 0],
                _ => [1, 2],
            };
            let copies: Vec<[u32; 2]> = match beside {
                0 => (0..across).map(|x| [x, 0]).collect(),
                1 => (0..up).map(|y| [0, y]).collect(),
                _ => (0..up).flat_map(|y| (0..across).map(move |x| [x, y])).collect(),
            };
            for (number, [x, y]) in copies.into_iter().enumerate() {
                let mut copy =
                    TileStrand { points: Vec::new(), sections: Vec::new(), coordinates: Vec::new(), ..strand.clone() };
                copy.index = strand.index + number as u32 * if beside == 0 { columns } else { rows };
                let step = DVec2::new(f64::from(strand.step[0]), f64::from(strand.step[1]));
                for k in 0..run {
                    let tiles = DVec2::new(f64::from(x), f64::from(y)) + f64::from(k) * step;
                    let shift = (tiles * self.period).extend(0.0);
                    let stitches = tiles * DVec2::new(f64::from(columns), f64::from(rows));
                    copy.points.extend(strand.points.iter().map(|p| *p + shift));
                    copy.sections.extend(&strand.sections);
                    let moved = |c: &[f32; 2]| [c[0] + stitches.x as f32, c[1] + stitches.y as f32];
                    copy.coordinates.extend(strand.coordinates.iter().map(moved));
                }
                strands.push(copy);
            }
        }
        let period = self.period * DVec2::new(f64::from(across), f64::from(up));
        Self { period, counts: [columns * across, rows * up], strands, flatten: self.flatten }
    }
}
