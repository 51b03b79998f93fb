//! Walking along a yarn from one of its places.

use glam::Vec3A;

use super::{strand::Strands, yarn_frame::YarnFrame};

/// The least that a point inside of a bend counts as away from the centre of the bend, in radii of the bend.
pub(crate) const LEAST_STRAIGHTNESS: f32 = 0.15;

/// A place of a yarn from which one can walk.
#[derive(Clone, Copy, Debug)]
pub struct Walker<'a> {
    strands: &'a Strands,
    segment: u32,
    u: f32,
    time: f32,
    /// Length of the segment in yarn radii, as far as its speed here tells.
    stride: f32,
}

impl<'a> Walker<'a> {
    /// At `u` (0 to 1) of a segment, at a time from 0 to 1; with the frame there.
    #[inline]
    pub fn new(strands: &'a Strands, segment: u32, u: f32, time: f32) -> (Self, YarnFrame) {
        let frame = strands.frame_at(segment, u, time);
        (Self { strands, segment, u, time, stride: frame.stride }, frame)
    }

    /// How far the yarn goes on before and behind this place, in yarn radii, as far as a segment tells: infinite unless an
    /// end of an open yarn is near.
    #[inline]
    pub fn ends(&self) -> [f32; 2] {
        [
            if self.strands.goes_on(self.segment, false) { f32::NEG_INFINITY } else { -self.u * self.stride },
            if self.strands.goes_on(self.segment, true) { f32::INFINITY } else { (1.0 - self.u) * self.stride },
        ]
    }

    /// The segment it is on.
    #[inline]
    pub fn segment(&self) -> u32 {
        self.segment
    }

    /// How far along that segment, 0 to 1.
    #[inline]
    pub fn u(&self) -> f32 {
        self.u
    }

    /// Walks so much further along the yarn, in yarn radii: the frame there, or `None` where the yarn does not go on so far.
    /// Segments of a yarn are about equally long.
    #[inline]
    pub fn walk(&mut self, distance: f32) -> Option<YarnFrame> {
        let mut u = self.u + distance / self.stride.max(1e-6);
        while !(0.0..=1.0).contains(&u) {
            let forward = u > 1.0;
            self.segment = self.strands.neighbour(self.segment, forward)?;
            u += if forward { -1.0 } else { 1.0 };
        }
        self.u = u;
        let frame = self.strands.frame_at(self.segment, u, self.time);
        self.stride = frame.stride;
        Some(frame)
    }

    /// Walks from `place`, where it is, towards the place abreast of a point: there, where the yarn is a circle between, and no
    /// more than two yarn radii at once.
    #[inline]
    pub fn walk_abreast(&mut self, place: &YarnFrame, point: Vec3A) -> Option<YarnFrame> {
        let off = point - place.centre;
        let straightness = (1.0 - off.dot(place.curvature)).max(LEAST_STRAIGHTNESS);
        let distance = off.dot(place.tangent) / (straightness * place.radius);
        self.walk(distance.clamp(-2.0, 2.0))
    }
}
