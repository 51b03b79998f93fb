//! Where fibres are wide enough in the picture to be told apart.

use glam::{DVec3, Vec3A};
use rayon::prelude::*;

use super::{CurveKind, Fabric, Mode, Model, Scene, Yarn, camera::Footprint};
use crate::geometry::curve::Curve;

/// Fibres that are narrower, in pixels, are not told apart,
const LEAST_PIXELS: f32 = 0.25;
/// and from here on each is one of its own.
const ALL_PIXELS: f32 = 0.75;

/// How wide fibres are in a picture.
#[derive(Clone, Copy, Debug)]
pub struct FiberDetail {
    footprint: Footprint,
}

impl FiberDetail {
    /// `None` where fibres are explicit, or not to be told apart, or a model for comparison answers for them.
    pub fn of(scene: &Scene) -> Option<Self> {
        let render = &scene.render;
        let wanted = render.fiber_detail && render.mode != Mode::Fiber && render.model == Model::Aggregated;
        wanted.then(|| Self { footprint: scene.camera.footprint(render.height) })
    }

    /// The chance that a ray tells fibres apart which are so wide, millimetres, at a place.
    #[inline]
    pub fn chance(&self, width: f32, place: Vec3A) -> f32 {
        let pixels = width / self.footprint.at(place).max(1e-30);
        ((pixels - LEAST_PIXELS) / (ALL_PIXELS - LEAST_PIXELS)).clamp(0.0, 1.0)
    }

    /// Whether curves of a yarn come so close. Of curves that are not made, their middle counts, which is that of the scene.
    pub(super) fn reaches(&self, yarn: &Yarn, curves: &[(Curve, Vec<f64>)]) -> bool {
        let widest = 2.0 * yarn.plies.iter().map(|p| p.fiber_radius).fold(0.0, f64::max);
        let near = |at: DVec3, radius: f64| self.chance((widest * radius) as f32, at.as_vec3a()) > 0.0;
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
