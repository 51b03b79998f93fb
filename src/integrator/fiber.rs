//! Scattering at an explicit fibre: the reference that every aggregate is compared with.

use glam::{Vec2, Vec3A};

use super::{Integrator, Path, Sample, Scratch, add};
use crate::{
    ffi::embree::Ray,
    geometry::tube::TubePlace,
    integrator::Counters,
    math::{Rgb, frame::orthonormal_basis},
    scattering::mis_weight,
    trace::{Fleece, Hit},
};

/// How far off its surface light leaves a fibre, in its radii: enough for rounding, too little to meet another.
const OFFSET: f32 = 1e-4;
/// The same in units of the distance from the origin, by which single precision rounds positions.
const ROUNDING: f32 = 4e-7;
/// The longest way through a fibre, in its radii, that is taken in one step as if the fibre were straight.
const LONGEST_CHORD: f32 = 6.0;

/// A fibre at a hit, in the frame of its BCSDF: z along the fibre, x towards the camera.
pub(crate) struct Frame {
    x: Vec3A,
    y: Vec3A,
    z: Vec3A,
    /// Sine and cosine of the camera's latitude.
    pub(crate) sin_o: f32,
    /// As `sin_o`.
    pub(crate) cos_o: f32,
}

impl Frame {
    /// For a fibre's tangent and the direction towards the camera, both of unit length.
    pub(crate) fn new(tangent: Vec3A, camera: Vec3A) -> Self {
        let sin_o = camera.dot(tangent).clamp(-1.0, 1.0);
        let across = camera - sin_o * tangent;
        let cos_o = across.length();
        // Seen end on, every azimuth is as good as another.
        let x = if cos_o > 1e-6 { across / cos_o } else { orthonormal_basis(tangent).0 };
        Self { x, y: tangent.cross(x), z: tangent, sin_o, cos_o }
    }

    #[inline]
    fn to_local(&self, v: Vec3A) -> Vec3A {
        Vec3A::new(v.dot(self.x), v.dot(self.y), v.dot(self.z))
    }

    /// A vector of this frame in the world.
    #[inline]
    pub(crate) fn to_world(&self, v: Vec3A) -> Vec3A {
        v.x * self.x + v.y * self.y + v.z * self.z
    }
}

/// Where a ray in `direction` leaves a fibre met at its surface: outside of it, as the BCSDF has already dealt with
/// the way through.
#[inline]
pub(crate) fn start(place: &TubePlace, normal: Vec3A, direction: Vec3A) -> Vec3A {
    let lift = place.radius * (1.0 + OFFSET) + ROUNDING * place.centre.abs().max_element();
    let outward = direction.dot(normal);
    if outward >= 0.0 {
        return place.centre + lift * normal;
    }
    let along = direction.dot(place.tangent);
    let across = 1.0 - along * along;
    let chord = -2.0 * outward / across.max(1e-6);
    if chord > LONGEST_CHORD {
        // Too far to know where a bent fibre ends: from just inside; the way out never counts as a hit.
        return place.centre + (2.0 * place.radius - lift).max(0.0) * normal;
    }
    let exit = normal + chord * direction;
    let beside = exit - exit.dot(place.tangent) * place.tangent;
    place.centre + place.radius * chord * along * place.tangent + lift * beside.normalize_or(direction)
}

impl Integrator<'_> {
    /// Scatters at a fibre. Returns whether the path goes on, and whether it scattered.
    #[inline]
    #[allow(clippy::too_many_arguments, reason = "a path, what it met, and the worker's own memory")]
    pub(super) fn scatter_at_fiber(
        &self,
        hit: &Hit,
        place: &TubePlace,
        fleece: &Fleece,
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
            self.describe(sample, fleece.fabric, fleece.pick(hit.segment), fleece.ply, || fleece.yarn_of(hit.segment));
        }
        let [u_choice, u_x, u_y, u_roulette] = path.sampler.next4();
        let u = path.sampler.next4();
        let fiber = fleece.fiber_at(hit.segment);
        let frame = Frame::new(place.tangent, -path.ray.direction);

        if let Some(&(light, chance, _)) = self.lights.iter().find(|l| u_choice < l.2).or(self.lights.last())
            && let Some(towards) = light.sample(place.centre + place.radius * hit.normal, Vec2::new(u_x, u_y))
        {
            let local = frame.to_local(towards.direction);
            let (lobes, pdf) = fiber.evaluate(frame.sin_o, frame.cos_o, local, path.throughput);
            if lobes.sum().max_channel() > 0.0 {
                let mut ray = Ray::new(start(place, hit.normal, towards.direction), towards.direction);
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
        let Some(next) = fiber.sample(frame.sin_o, frame.cos_o, path.throughput, u, &mut stream) else {
            return (false, true);
        };
        path.shares.get_or_insert_with(|| {
            // A channel without any value has no throughput from here on, and its shares do not matter.
            next.lobes.scaled(Rgb::ONE / next.lobes.sum().max(Rgb::splat(1e-30)))
        });
        path.pdf = next.pdf;
        let direction = frame.to_world(next.wi);
        path.ray = Ray::new(start(place, hit.normal, direction), direction);
        (self.survives(path, next.weight, u_roulette), true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_leaves_a_fiber_outside_of_it_on_the_side_where_it_goes() {
        let place = TubePlace { centre: Vec3A::new(3.0, -2.0, 5.0), tangent: Vec3A::new(0.0, 0.6, 0.8), radius: 0.01 };
        let (s, t) = orthonormal_basis(place.tangent);
        for i in 0..2000 {
            let turn = i as f32 * 2.399_963;
            let normal = turn.cos() * s + turn.sin() * t;
            let z = 1.0 - 2.0 * (i as f32 + 0.5) / 2000.0;
            let r = (1.0 - z * z).sqrt();
            let w = Vec3A::new(r * (7.0 * turn).cos(), r * (7.0 * turn).sin(), z);
            let from = start(&place, normal, w);
            let rel = from - place.centre;
            let axial = rel.dot(place.tangent);
            let distance = (rel - axial * place.tangent).length() / place.radius;
            let along = w.dot(place.tangent);
            let long = w.dot(normal) < 0.0 && -2.0 * w.dot(normal) / (1.0 - along * along) > LONGEST_CHORD;
            if long {
                assert!(distance < 1.0 && distance > 0.99, "{distance}");
            } else {
                assert!((1.000_05..1.002).contains(&distance), "{distance}");
                // It moves away from the axis.
                assert!((rel - axial * place.tangent).dot(w) >= -1e-6 * place.radius, "{w}");
            }
            assert!(axial.abs() <= LONGEST_CHORD * place.radius * 1.001);
        }
    }
}
