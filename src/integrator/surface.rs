//! Scattering at what is no cloth: the ground and meshes.

use glam::Vec3A;

use super::{
    Counters, Integrator, Path, ROULETTE_AFTER, Scratch,
    direct::{Response, Scattered},
};
use crate::{
    film::{MatteId, Sample},
    geometry::ray::{DoneWith, Ray},
    math::{Rgb, frame::orthonormal_basis},
    scattering::mis_weight,
    trace::SurfacePlace,
};

/// How far off a surface rays start, in units of the larger of their distance and place, which single precision rounds.
const OFFSET: f32 = 1e-5;

impl Integrator<'_> {
    /// Scatters at a surface met at the distance `t`. Returns whether the path goes on.
    pub(super) fn scatter_at_surface(
        &self,
        place: &SurfacePlace,
        t: f32,
        path: &mut Path<'_>,
        sample: &mut Sample,
        scratch: &mut Scratch,
        counters: &mut Counters,
    ) -> bool {
        let material = &self.materials[place.material];
        if material.holdout && path.bounces == 0 {
            return false;
        }
        let mut albedo = material.surface.albedo();
        if let Some(picture) = &material.texture {
            // As wide as a pixel there: light that comes after other scattering sees no wider, which only costs noise.
            let uv = place.uv * picture.repeat;
            let width = self.footprint.at(place.point) * place.uv_per_length * picture.repeat.max_element();
            albedo *= Rgb::from(picture.texture.sample(uv.x, uv.y, width)).min(Rgb::ONE);
        }
        if path.bounces == 0 {
            sample.alpha = 1.0;
            if self.identify {
                let [fabrics, meshes] = self.before_surfaces;
                sample.matte = Some(MatteId { fabric: fabrics + place.mesh.unwrap_or(meshes), yarn: 0, ply: 0 });
            }
            sample.depth = (path.from - place.point).dot(self.back);
            self.sees_moving(sample, place.point, place.next);
            sample.uv = place.uv;
            sample.normal = place.shading;
            sample.albedo = albedo;
        }
        if path.bounces >= self.max_bounces {
            return false;
        }
        let [u_choice, light_x, light_y, u_roulette] = path.sampler.next4();
        let [x, y, u_part, _] = path.sampler.next4();
        // Both flat and shading normal are on the camera's side.
        let normal = place.shading;
        let (tangent, bitangent) = orthonormal_basis(normal);
        let to_local = |v: Vec3A| Vec3A::new(v.dot(tangent), v.dot(bitangent), v.dot(normal));
        let wo = to_local(-path.ray.direction);
        let start = place.point + OFFSET * (1.0 + place.point.abs().max_element().max(t)) * place.normal;

        self.next_event(start, [u_choice, light_x, light_y], path, sample, scratch, counters, |direction, pdf| {
            if direction.dot(place.normal) <= 0.0 {
                return None;
            }
            let (value, own_pdf) = material.surface.evaluate(albedo, wo, to_local(direction));
            Some(Response {
                value: Scattered::Surface(value),
                weight: mis_weight(pdf, own_pdf),
                start,
                done: DoneWith::default(),
            })
        });
        let Some(next) = material.surface.sample(albedo, wo, [u_part, x, y]) else { return false };
        let direction = next.wi.x * tangent + next.wi.y * bitangent + next.wi.z * normal;
        if direction.dot(place.normal) <= 0.0 {
            return false;
        }
        path.ray = Ray::new(start, direction);
        path.pdf = next.pdf;
        self.survives(path, start, next.weight, u_roulette, ROULETTE_AFTER)
    }
}
