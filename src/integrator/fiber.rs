//! Scattering at an explicit fibre: the reference that every aggregate is compared with.

use super::{
    Counters, Integrator, Path, ROULETTE_AFTER_FIBERS, Scratch,
    direct::{Response, Scattered},
};
use crate::{
    film::Sample,
    geometry::ray::{DoneWith, Ray},
    geometry::tube::TubePlace,
    math::Rgb,
    scattering::{fiber::FiberBcsdf, lobe::LobeFrame, mis_weight},
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
        (fibers, fiber): (&FiberGeometry, &FiberBcsdf),
        path: &mut Path<'_>,
        sample: &mut Sample,
        scratch: &mut Scratch,
        counters: &mut Counters,
    ) -> (bool, bool) {
        let here = place.centre + place.radius * hit.normal;
        if path.bounces == 0 {
            sample.alpha = 1.0;
            sample.normal = hit.normal;
            sample.depth = (path.from - here).dot(self.back);
            self.sees(sample, here);
            if self.layers.uv {
                sample.uv = fibers.uvs.at(hit.segment, hit.u);
            }
            self.describe(sample, fibers.fabric, fibers.material_index_at(hit.segment, hit.u), fibers.ply, || {
                fibers.yarn_of(hit.segment)
            });
        }
        if path.bounces >= self.max_bounces {
            return (false, false);
        }
        let [u_choice, u_x, u_y, u_roulette] = path.sampler.next4();
        let u = path.sampler.next4();
        let frame = LobeFrame::new(place.tangent, -path.ray.direction);

        self.next_event(here, [u_choice, u_x, u_y], path, sample, scratch, counters, |direction, pdf| {
            let (lobes, own_pdf) = fiber.evaluate(frame.sin, frame.cos, frame.to_local(direction), path.throughput);
            let start = place.leave(hit.normal, direction);
            Some(Response {
                value: Scattered::Cloth(lobes),
                weight: mis_weight(pdf, own_pdf),
                start,
                done: DoneWith::default(),
            })
        });

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
