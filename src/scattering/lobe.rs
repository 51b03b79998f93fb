//! What all lobes share: the frame about an axis, and choosing between a few.

use glam::Vec3A;

use super::kernel::Latitudes;
use crate::{
    geometry::{
        section::{PlyCrossing, Section},
        yarn::YarnShape,
    },
    math::frame::{orthonormal_basis, sin_cos},
};

/// An axis, the camera's azimuth about it, and what completes them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LobeFrame {
    /// Towards the camera, across the axis.
    pub(crate) x: Vec3A,
    /// z x x.
    pub(crate) y: Vec3A,
    /// The axis.
    pub(crate) z: Vec3A,
    /// Sine of the camera's latitude.
    pub(crate) sin: f32,
    /// Cosine of the camera's latitude.
    pub(crate) cos: f32,
}

impl LobeFrame {
    /// About the unit vector `axis`, for a camera direction.
    #[inline]
    pub(crate) fn new(axis: Vec3A, camera: Vec3A) -> Self {
        let sin = axis.dot(camera).clamp(-1.0, 1.0);
        let across = camera - sin * axis;
        let cos = across.length();
        // Seen end on, every azimuth is as good as another.
        let x = if cos > 1e-6 { across / cos } else { orthonormal_basis(axis).0 };
        Self { x, y: axis.cross(x), z: axis, sin, cos }
    }

    /// The same with another latitude of the camera, by its sine.
    #[inline]
    pub(crate) fn with_latitude(self, sin: f32) -> Self {
        let sin = sin.clamp(-1.0, 1.0);
        Self { sin, cos: (1.0 - sin * sin).sqrt(), ..self }
    }

    /// About a ply where a ray passes it, on the bent yarn.
    #[inline]
    pub(crate) fn of_ply(shape: &YarnShape, section: &Section<'_>, crossing: &PlyCrossing, camera: Vec3A) -> Self {
        Self::new(crossing.ply_tangent(shape, section), camera)
    }

    /// A vector of the world in this frame.
    #[inline]
    pub(crate) fn to_local(self, v: Vec3A) -> Vec3A {
        Vec3A::new(v.dot(self.x), v.dot(self.y), v.dot(self.z))
    }

    /// A vector of this frame in the world.
    #[inline]
    pub(crate) fn to_world(self, v: Vec3A) -> Vec3A {
        v.x * self.x + v.y * self.y + v.z * self.z
    }

    /// Latitudes of the camera and of `w`, and the cosine of `w`'s latitude.
    #[inline]
    pub(crate) fn latitudes(&self, w: Vec3A) -> (Latitudes, f32) {
        let sin = w.dot(self.z).clamp(-1.0, 1.0);
        let cos = (1.0 - sin * sin).sqrt();
        (Latitudes::new(self.sin, self.cos, sin, cos), cos)
    }

    /// The direction of a latitude's sine and an azimuth, 0 towards the camera.
    #[inline]
    pub(crate) fn direction(&self, sin: f32, phi: f32) -> Vec3A {
        let cos = (1.0 - sin * sin).max(0.0).sqrt();
        let (s, c) = sin_cos(phi);
        cos * (c * self.x + s * self.y) + sin * self.z
    }
}

/// Weights over their sum; zeros if there is nothing to choose.
#[inline]
pub(crate) fn normalised<const N: usize>(w: [f32; N]) -> [f32; N] {
    let total: f32 = w.iter().sum();
    if total > 0.0 { w.map(|x| x / total) } else { [0.0; N] }
}

/// Index chosen with the given chances, which sum to 1: never one whose chance is 0.
#[inline]
pub(crate) fn choose<const N: usize>(chances: [f32; N], mut u: f32) -> usize {
    let mut last = 0;
    for (index, chance) in chances.into_iter().enumerate() {
        if chance > 0.0 {
            if u < chance {
                return index;
            }
            last = index;
        }
        u -= chance;
    }
    last
}
