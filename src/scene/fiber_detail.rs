//! Where fibres are wide enough in the picture to be told apart.

use glam::{DVec3, Vec3A};
use rayon::prelude::*;

use super::{CurveKind, Fabric, Mode, Model, Scene, Yarn};
use crate::geometry::curve::Curve;

/// Fibres that are narrower, in pixels, are not told apart,
const LEAST_PIXELS: f32 = 0.25;
/// and from here on each is one of its own.
const ALL_PIXELS: f32 = 0.75;

/// How wide fibres are in a picture.
#[derive(Clone, Copy, Debug)]
pub struct FiberDetail {
    camera: DVec3,
    /// [`super::Camera::pixel_width`].
    pixel_width: (f32, f32),
}

impl FiberDetail {
    /// `None` where fibres are explicit, or not to be told apart, or a model for comparison answers for them.
    pub fn of(scene: &Scene) -> Option<Self> {
        let render = &scene.render;
        let wanted = render.fiber_detail && render.mode != Mode::Fiber && render.model == Model::Aggregated;
        let (camera, pixel_width) = (scene.camera.position, scene.camera.pixel_width(render.height));
        wanted.then_some(Self { camera, pixel_width })
    }

    /// The chance that a ray tells fibres apart which are so wide, millimetres, at a place.
    #[inline]
    pub fn chance(&self, width: f32, place: Vec3A) -> f32 {
        self.share(width, (place - self.camera.as_vec3a()).length())
    }

    #[inline]
    fn share(&self, width: f32, distance: f32) -> f32 {
        let pixel = self.pixel_width.0 + self.pixel_width.1 * distance;
        let pixels = width / pixel.max(1e-30);
        ((pixels - LEAST_PIXELS) / (ALL_PIXELS - LEAST_PIXELS)).clamp(0.0, 1.0)
    }

    /// Whether curves of a yarn come so close. Of curves that are not made, their middle counts, which is that of the scene.
    pub(super) fn reaches(&self, yarn: &Yarn, curves: &[(Curve, Vec<f64>)]) -> bool {
        let widest = 2.0 * yarn.plies.iter().map(|p| p.fiber_radius).fold(0.0, f64::max);
        let near =
            |at: DVec3, radius: f64| self.share((widest * radius) as f32, (at - self.camera).length() as f32) > 0.0;
        if curves.is_empty() {
            return near(DVec3::ZERO, yarn.radius);
        }
        curves.par_iter().any(|(curve, radii)| curve.points.iter().zip(radii).any(|(p, r)| near(*p, *r)))
    }
}

impl Scene {
    /// Notes of which fabrics fibres may be told apart.
    pub(super) fn look_for_fibers(&mut self) {
        let detail = FiberDetail::of(self);
        let seen = |fabric: &Fabric| {
            let CurveKind::Yarn(yarn) = fabric.kind else { return false };
            detail.is_some_and(|detail| detail.reaches(&self.yarns[yarn], &fabric.curves))
        };
        let seen: Vec<bool> = self.fabrics.iter().map(seen).collect();
        for (fabric, seen) in self.fabrics.iter_mut().zip(seen) {
            fabric.shows_fibers = seen;
        }
    }
}
