//! Next event estimation: light that comes to a vertex straight from a light, whatever the vertex is of.

use glam::{Vec2, Vec3A};

use super::{Counters, Integrator, Path, Scratch, distance_to_ground};
use crate::{
    film::Sample,
    geometry::ray::{DoneWith, Ray},
    light::Chosen,
    math::Rgb,
    scattering::LobeValues,
};

/// What a vertex answers to light from one direction. Values are per steradian and hold the cosine.
pub(super) struct Response {
    /// The value, by what scatters.
    pub(super) value: Scattered,
    /// Weight against drawing the same direction by scattering; 1 where the value holds it.
    pub(super) weight: f32,
    /// Where the shadow ray starts.
    pub(super) start: Vec3A,
    /// What the shadow ray is done with.
    pub(super) done: DoneWith,
}

/// A value of scattering.
pub(super) enum Scattered {
    /// By the lobes of a yarn or fibre.
    Cloth(LobeValues),
    /// By another surface.
    Surface(Rgb),
}

impl Integrator<'_> {
    /// Chooses a light for the place `at` and a direction towards it by `u`, asks the vertex by `respond` what it answers
    /// to that direction of that density (per steradian, with the choice), and adds what comes through to the sample.
    #[inline]
    #[allow(clippy::too_many_arguments, reason = "a path, what it met, and the worker's own memory")]
    pub(super) fn next_event(
        &self,
        at: Vec3A,
        u: [f32; 3],
        path: &Path<'_>,
        sample: &mut Sample,
        scratch: &mut Scratch,
        counters: &mut Counters,
        respond: impl FnOnce(Vec3A, f32) -> Option<Response>,
    ) {
        let Some(Chosen { index, light, chance }) = self.lights.choose(at, u[0]) else { return };
        let Some(towards) = light.sample(at, Vec2::new(u[1], u[2])) else { return };
        let Some(Response { value, weight, start, done }) = respond(towards.direction, towards.pdf * chance) else {
            return;
        };
        if value.sum().max_channel() <= 0.0 {
            return;
        }
        // The light is as far as from `at`.
        let t_far = towards.distance - (start - at).dot(towards.direction);
        let ray = Ray { t_far, done, ..Ray::new(start, towards.direction) };
        counters.shadow += 1;
        let passed = self.shadow(&ray, scratch);
        if passed <= 0.0 {
            return;
        }
        let light = path.throughput * (towards.weight * (weight * passed / chance));
        let events = path.bounces + 1;
        match value {
            Scattered::Cloth(lobes) => {
                let found = lobes.scaled(light);
                match path.shares {
                    // The path's first scattering at cloth: the light belongs to this very vertex's lobes.
                    None => {
                        self.add_light(sample, index, found.sum());
                        sample.parts.add_lobes(events, found);
                    }
                    Some(_) => self.add(sample, events, path, index, found.sum()),
                }
            }
            Scattered::Surface(value) => self.add(sample, events, path, index, value * light),
        }
    }

    /// The share of light that comes through along a shadow ray.
    #[inline]
    fn shadow(&self, ray: &Ray, scratch: &mut Scratch) -> f32 {
        if self.ground.is_some_and(|g| distance_to_ground(&g, ray).is_some()) {
            return 0.0;
        }
        self.cloth
            .world()
            .transmittance(&Ray { time: scratch.time, looks: false, ..*ray }, &mut scratch.shadow_crossings)
    }
}

impl Scattered {
    fn sum(&self) -> Rgb {
        match self {
            Self::Cloth(lobes) => lobes.sum(),
            Self::Surface(value) => *value,
        }
    }
}
