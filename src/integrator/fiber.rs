//! Scattering at an explicit fibre: the reference that every aggregate is compared with.

use glam::Vec2;

use super::{Counters, Integrator, Path, ROULETTE_AFTER_FIBERS, Scratch, add};
use crate::{
    film::Sample,
    geometry::ray::Ray,
    geometry::tube::TubePlace,
    math::Rgb,
    scattering::{lobe::LobeFrame, mis_weight},
    trace::{FiberGeometry, Hit},
};

impl Integrator<'_> {
    /// Scatters at a fibre. Returns whether the path goes on, and whether it scattered.
    #[inline]
    #[allow(clippy::too_many_arguments, reason = "a path, what it met, and the worker's own memory")]
    pub(super) fn scatter_at_fiber(
        &self,
        hit: &Hit,
        place: &TubePlace,
        fibers: &FiberGeometry,
        path: &mut Path<'_>,
        sample: &mut Sample,
        scratch: &mut Scratch,
        counters: &mut Counters,
    ) -> (bool, bool) {
        if path.bounces >= self.max_bounces {
            return (false, false);
        }
        if path.bounces == 0 {
            sample.normal = hit.normal;
            self.describe(sample, fibers.fabric, fibers.material_index(hit.segment), fibers.ply, || {
                fibers.yarn_of(hit.segment)
            });
        }
        let [u_choice, u_x, u_y, u_roulette] = path.sampler.next4();
        let u = path.sampler.next4();
        let fiber = fibers.fiber_at(hit.segment);
        let frame = LobeFrame::new(place.tangent, -path.ray.direction);

        let here = place.centre + place.radius * hit.normal;
        if let Some((light, chance)) = self.lights.choose(here, u_choice)
            && let Some(towards) = light.sample(here, Vec2::new(u_x, u_y))
        {
            let local = frame.to_local(towards.direction);
            let (lobes, pdf) = fiber.evaluate(frame.sin, frame.cos, local, path.throughput);
            if lobes.sum().max_channel() > 0.0 {
                let mut ray = Ray::new(place.leave(hit.normal, towards.direction), towards.direction);
                ray.t_far = towards.distance;
                counters.shadow += 1;
                let passed = self.shadow(&ray, scratch);
                if passed > 0.0 {
                    let weight = mis_weight(towards.pdf * chance, pdf) * passed / chance;
                    let light = path.throughput * towards.weight * weight;
                    match path.shares {
                        None => {
                            let found = lobes.scaled(light);
                            sample.radiance += found.sum();
                            sample.parts.add_lobes(path.bounces + 1, found);
                        }
                        Some(_) => add(sample, path.bounces + 1, path, lobes.sum() * light),
                    }
                }
            }
        }

        let mut stream = path.sampler.stream(path.sampler.position());
        let Some(next) = fiber.sample(frame.sin, frame.cos, path.throughput, u, &mut stream) else {
            return (false, true);
        };
        path.shares.get_or_insert_with(|| {
            // A channel without any value has no throughput from here on, and its shares do not matter.
            next.lobes.scaled(Rgb::ONE / next.lobes.sum().max(Rgb::splat(1e-30)))
        });
        path.pdf = next.pdf;
        let direction = frame.to_world(next.wi);
        path.ray = Ray::new(place.leave(hit.normal, direction), direction);
        (self.survives(path, here, next.weight, u_roulette, ROULETTE_AFTER_FIBERS), true)
    }
}
