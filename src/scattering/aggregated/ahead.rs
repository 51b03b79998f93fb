//! What a way out of a yarn meets of a ply.

use glam::Vec3A;

use super::View;
use crate::geometry::{
    density::ChordFibers,
    section::{Inside, PlyAhead},
};

/// How fibres look across a way: in units of those of the round yarn, for [`FibersAhead::new`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Across {
    w: Vec3A,
    thin: f32,
    wide: f32,
}

impl Across {
    /// For a way from a place in the direction `w` of the section's frame.
    #[inline]
    pub(super) fn new(view: &View<'_>, from: &Inside, w: Vec3A) -> Self {
        Self { w, thin: view.section.thinness(), wide: from.wide(w) }
    }
}

/// The fibres of a ply on a way out.
#[derive(Clone, Copy, Debug)]
pub(super) struct FibersAhead {
    pub(super) ply: usize,
    /// Distance in the section to the point nearest to the ply's axis.
    pub(super) foot: f32,
    /// How many more are met there than by a way across the yarn.
    pub(super) tilt: f32,
    pub(super) chord: ChordFibers,
    /// How many are expected.
    pub(super) expected: f32,
}

impl FibersAhead {
    /// Of a ply that lies ahead of a place.
    #[inline]
    pub(super) fn new(view: &View<'_>, from: &Inside, across: Across, ahead: &PlyAhead<'_>) -> Self {
        let Across { w, thin, wide } = across;
        let shape = view.yarn.occluder().shape();
        let &PlyAhead { ply, foot, offset, length, .. } = ahead;
        let chord = shape.plies[ply].chord(offset, length, thin, wide);
        let tilt = ahead.tilt(shape, view.section, from, w, &chord);
        Self { ply, foot, tilt, chord, expected: tilt * chord.ahead(-foot) }
    }

    /// Distance in the section at which so many of them are passed.
    #[inline]
    pub(super) fn distance_past(&self, passed: f32) -> f32 {
        let behind = (self.expected - passed).max(0.0) / self.tilt;
        let at = self.chord.place((behind / self.chord.total().max(1e-20)).min(1.0));
        (self.foot + at).max(0.0)
    }
}
