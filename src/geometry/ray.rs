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
}

impl Ray {
    /// A ray without an end.
    pub fn new(origin: Vec3A, direction: Vec3A) -> Self {
        Self { origin, direction, t_near: 0.0, t_far: f32::INFINITY, time: 0.0, looks: true }
    }

    /// Whether it can be traced: a NaN in a ray makes one query of Embree four hundred times as slow.
    pub fn is_finite(&self) -> bool {
        self.origin.is_finite() && self.direction.is_finite() && !self.t_near.is_nan() && !self.t_far.is_nan()
    }
}
