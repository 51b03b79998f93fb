//! Rays.

use glam::Vec3A;

/// A ray, and the stretch of it that counts.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3A,
    /// Where it goes; of unit length wherever distances matter.
    pub direction: Vec3A,
    /// Hits nearer than this do not count.
    pub t_near: f32,
    /// Hits farther than this do not count.
    pub t_far: f32,
    /// When it is there, from 0 to 1: where what moves is.
    pub time: f32,
    /// Whether what it meets first is looked at, and not only lit by or shaded from.
    pub looks: bool,
    /// The yarns that it is done with where it starts.
    pub done: DoneWith,
}

/// A place of a yarn among the scene's curves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct YarnPlace {
    /// Embree's geometry.
    pub geometry: u32,
    /// The segment within it.
    pub segment: u32,
}

/// Yarns within whose tubes a ray starts, and whose plies ahead it does not meet: what they do to the light on its way out is
/// known already, or it has passed them. The last four are remembered.
#[derive(Clone, Copy, Debug, Default)]
pub struct DoneWith {
    places: [Option<YarnPlace>; 4],
}

impl DoneWith {
    /// Only this one.
    #[inline]
    pub fn only(place: YarnPlace) -> Self {
        Self { places: [Some(place), None, None, None] }
    }

    /// These and another one.
    #[inline]
    #[must_use]
    pub fn and(self, place: YarnPlace) -> Self {
        let [a, b, c, _] = self.places;
        Self { places: [Some(place), a, b, c] }
    }

    /// Whether a place is within so many segments of one of these.
    #[inline]
    pub fn holds(&self, place: YarnPlace, within: u32) -> bool {
        let near = |at: &YarnPlace| at.geometry == place.geometry && at.segment.abs_diff(place.segment) <= within;
        self.places.iter().flatten().any(near)
    }
}

impl Ray {
    /// A ray without an end.
    pub fn new(origin: Vec3A, direction: Vec3A) -> Self {
        Self { origin, direction, t_near: 0.0, t_far: f32::INFINITY, time: 0.0, looks: true, done: DoneWith::default() }
    }

    /// Whether it can be traced: a NaN in a ray makes one query of Embree four hundred times as slow.
    pub fn is_finite(&self) -> bool {
        self.origin.is_finite() && self.direction.is_finite() && !self.t_near.is_nan() && !self.t_far.is_nan()
    }
}
