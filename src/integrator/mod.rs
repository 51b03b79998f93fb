//! Light along a path: what one sample of one pixel sees.
//!
//! A path tracer with next event estimation and multiple importance sampling. The one special thing is cloth: a ray
//! that meets a yarn is let through with the chance that it meets no fibre (which is no scattering event), else it
//! scatters at a vertex of the yarn's model, and goes on from inside the yarn, whose own plies the model has already
//! put in its way. An explicit fibre scatters at its surface (`fiber`).

mod direct;
mod fiber;
mod seen;
mod surface;

use glam::{Vec2, Vec3A};

use self::{
    direct::{Response, Scattered},
    seen::Flow,
};
use crate::{
    cloth::{Cloth, Met},
    film::{MatteId, Sample},
    geometry::{
        ray::{DoneWith, Ray},
        section::{Crossings, Section},
    },
    light::{AreaLight, Environment, Light, LightChooser},
    math::{Rgb, sampler::Sampler},
    scattering::{Arrival, LobeValues, fiber::FiberMaterial, mis_weight, yarn::YarnScatterer},
    scene::{CurveKind, Fabric, FiberDetail, Footprint, Ground, Layers, LightGroups, Material, Scene},
    trace::{Hit, SurfacePlace, YarnGeometry},
};

/// Scattering events after which paths may end by chance, at yarns and surfaces. One event at a yarn stands for many at
/// fibres: after the first instead of the fourth, noise times time is 4 to 14 % less on most scenes measured, 3 to 6 % more
/// under back light.
const ROULETTE_AFTER: u32 = 1;
/// The same at single fibres, where it makes no difference.
const ROULETTE_AFTER_FIBERS: u32 = 4;
/// Most yarns a path may pass unscattered in a row: a guard against geometry that repeats a hit for ever.
const MOST_PASSES: u32 = 10_000;
/// Where a ray that passes a yarn starts again, in yarn radii behind the surface,
const PASS_OFFSET: f32 = 1e-3;
/// and at least in units of the distance from the origin, by which single precision rounds positions.
const PASS_ROUNDING: f32 = 4e-7;

/// What was done, for the statistics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Rays from the camera.
    pub camera: u64,
    /// Rays that go on: after scattering or through a yarn.
    pub bounce: u64,
    /// Rays towards lights.
    pub shadow: u64,
    /// Camera paths that scattered at cloth.
    pub cloth_paths: u64,
    /// Scattering events at cloth, of all paths.
    pub events: u64,
    /// Samples that were not finite and were left out.
    pub invalid: u64,
}

impl Counters {
    /// Adds what another worker did.
    pub fn add(&mut self, other: &Self) {
        self.camera += other.camera;
        self.bounce += other.bounce;
        self.shadow += other.shadow;
        self.cloth_paths += other.cloth_paths;
        self.events += other.events;
        self.invalid += other.invalid;
    }
}

/// A scene ready for paths: shared by all threads.
#[derive(Debug)]
pub(crate) struct Integrator<'a> {
    cloth: &'a Cloth,
    ground: Option<Ground>,
    materials: &'a [Material],
    /// Environment lights, each with its place among all lights; several are added up.
    environments: Vec<(&'a Environment, usize)>,
    /// Surfaces that shine, each with its place among all lights.
    area_lights: Vec<(&'a AreaLight, usize)>,
    /// Lights for shadow rays.
    lights: LightChooser<'a>,
    light_groups: &'a LightGroups,
    max_bounces: u32,
    /// Albedo of one fibre of each ply, of each fabric's yarn and then of its variants; empty if no layer holds it.
    albedos: Vec<Vec<Vec<Rgb>>>,
    /// Whether samples name what they meet.
    identify: bool,
    /// How many fabrics there are, and then how many meshes: the numbers of these and of the ground come after.
    before_surfaces: [u32; 2],
    /// What else layers hold of the place seen first.
    layers: Layers,
    flow: Option<Flow>,
    /// View direction for depths.
    back: Vec3A,
    /// How wide pixels are.
    footprint: Footprint,
    /// Where fibres are told apart, if they are anywhere.
    fiber_detail: Option<FiberDetail>,
}

/// A worker's own memory: reused from sample to sample.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    /// The time of the path in work: where what moves is for all its rays.
    time: f32,
    crossings: Crossings,
    shadow_crossings: Crossings,
}

/// A path on its way.
struct Path<'s> {
    ray: Ray,
    throughput: Rgb,
    /// Density of the ray's direction, for weighing environment lights against their shadow rays; infinite from the camera.
    pdf: f32,
    /// Where that direction was drawn, and for which place a light was chosen.
    from: Vec3A,
    bounces: u32,
    passes: u32,
    /// Lobes of the first scattering at cloth to which what is found now belongs.
    shares: Option<LobeValues>,
    sampler: &'s mut Sampler,
}

impl<'a> Integrator<'a> {
    /// For a scene and its cloth.
    pub(crate) fn new(scene: &'a Scene, cloth: &'a Cloth) -> Self {
        let lights = LightChooser::new(&scene.lights);
        let mut environments = Vec::new();
        let mut area_lights = Vec::new();
        for (index, light) in scene.lights.iter().enumerate() {
            match light {
                Light::Environment(environment) => environments.push((environment, index)),
                Light::Area(area) => area_lights.push((area, index)),
                Light::Distant { .. } | Light::Point { .. } | Light::Spot { .. } => {}
            }
        }
        Self {
            cloth,
            ground: scene.ground,
            materials: &scene.materials,
            environments,
            area_lights,
            lights,
            light_groups: &scene.light_groups,
            max_bounces: scene.render.max_bounces,
            albedos: if scene.collected().albedo {
                scene.fabrics.iter().map(|f| ply_albedos(scene, f)).collect()
            } else {
                Vec::new()
            },
            identify: scene.layers.cryptomatte,
            before_surfaces: [scene.fabrics.len(), scene.objects.len()].map(|count| count as u32),
            layers: scene.layers,
            flow: Flow::of(scene),
            back: Vec3A::from(scene.camera.back_f32()),
            footprint: scene.camera.footprint(scene.render.height),
            fiber_detail: FiberDetail::of(scene).filter(|_| scene.fabrics.iter().any(|f| f.shows_fibers)),
        }
    }

    /// Follows one path from the camera.
    pub(crate) fn sample(
        &self,
        ray: Ray,
        sampler: &mut Sampler,
        scratch: &mut Scratch,
        counters: &mut Counters,
    ) -> Sample {
        let mut sample = Sample::default();
        let mut path = Path {
            ray,
            throughput: Rgb::ONE,
            pdf: f32::INFINITY,
            from: ray.origin,
            bounces: 0,
            passes: 0,
            shares: None,
            sampler,
        };
        counters.camera += 1;
        let mut cloth_events = 0;
        scratch.time = ray.time;
        loop {
            path.ray.time = scratch.time;
            path.ray.looks = path.bounces == 0;
            if !path.ray.is_finite() {
                // It would meet nothing, as a ray to the sky.
                sample.radiance = Rgb::splat(f32::NAN);
                break;
            }
            let hit = self.cloth.world().intersect(&path.ray);
            let ground = self.ground.and_then(|g| distance_to_ground(&g, &path.ray).map(|t| (g, t)));
            if !self.area_lights.is_empty() {
                let end = hit.as_ref().map_or(f32::INFINITY, |h| h.distance).min(ground.map_or(f32::INFINITY, |g| g.1));
                if self.area_lights(&path, end, &mut sample) {
                    break;
                }
            }
            let go_on = match (hit, ground) {
                (hit, Some((ground, t))) if hit.is_none_or(|h| t < h.distance) => {
                    let place = on_ground(&ground, &path.ray, t);
                    self.scatter_at_surface(&place, t, &mut path, &mut sample, scratch, counters)
                }
                (Some(hit), _) => {
                    let (go_on, scattered) = match self.cloth.at(&hit) {
                        Met::Surface(place) => {
                            (self.scatter_at_surface(place, hit.t, &mut path, &mut sample, scratch, counters), false)
                        }
                        Met::Yarn { section, yarns, scatterer } => {
                            let met = (yarns, scatterer);
                            self.scatter_at_yarn(&hit, section, met, &mut path, &mut sample, scratch, counters)
                        }
                        Met::Fiber { place, fibers, scatterer } => {
                            let met = (fibers, scatterer);
                            self.scatter_at_fiber(&hit, place, met, &mut path, &mut sample, scratch, counters)
                        }
                    };
                    if scattered {
                        cloth_events += 1;
                    }
                    go_on
                }
                _ => {
                    self.environment(&path, &mut sample);
                    false
                }
            };
            if !go_on {
                break;
            }
            counters.bounce += 1;
        }
        if cloth_events > 0 {
            counters.cloth_paths += 1;
            counters.events += cloth_events;
        }
        sample
    }

    /// Adds what a ray that meets nothing sees, weighed against shadow rays towards the same environment lights.
    #[inline]
    fn environment(&self, path: &Path<'_>, sample: &mut Sample) {
        for &(environment, index) in &self.environments {
            let weight = if path.pdf == f32::INFINITY {
                if !environment.visible {
                    continue;
                }
                1.0
            } else {
                let chance = self.lights.chance(index, path.from);
                let other = if chance > 0.0 { chance * environment.pdf(path.ray.direction) } else { 0.0 };
                mis_weight(path.pdf, other)
            };
            let light = path.throughput * environment.radiance(path.ray.direction) * weight;
            self.add(sample, path.bounces, path, index, light);
        }
    }

    /// Adds light of a light, by its place among all, that was scattered `events` times to a sample, to its group and to the part that it
    /// belongs to.
    #[inline]
    fn add(&self, sample: &mut Sample, events: u32, path: &Path<'_>, index: usize, light: Rgb) {
        self.add_light(sample, index, light);
        sample.parts.add(events, path.shares.as_ref(), light);
    }

    /// Adds light of a light to a sample and to its group, whatever part it belongs to.
    #[inline]
    fn add_light(&self, sample: &mut Sample, index: usize, light: Rgb) {
        sample.radiance += light;
        sample.lights[self.light_groups.of(index)] += light;
    }

    /// Adds what comes from area lights nearer than `end`, weighed against shadow rays towards them. Whether the
    /// camera sees one, which hides what is behind it.
    #[inline]
    fn area_lights(&self, path: &Path<'_>, end: f32, sample: &mut Sample) -> bool {
        let Ray { origin, direction, .. } = path.ray;
        if path.pdf == f32::INFINITY {
            let seen = self.area_lights.iter().filter(|(light, _)| light.visible);
            let met =
                |light: &AreaLight| light.shape.intersect(origin, direction, light.two_sided).filter(|&t| t < end);
            let nearest = seen.filter_map(|(light, index)| Some((met(light)?, light, index)));
            let nearest = nearest.min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((t, light, index)) = nearest {
                sample.alpha = 1.0;
                let point = origin + t * direction;
                sample.depth = (path.from - point).dot(self.back);
                self.sees(sample, point);
                self.add(sample, path.bounces, path, *index, path.throughput * light.radiance);
            }
            return nearest.is_some();
        }
        // Light leaves cloth beside the place for which lights are chosen. Both ways to a light must count the same directions: those in
        // which that place sees it.
        let before = (origin - path.from).dot(direction);
        for &(light, index) in &self.area_lights {
            let Some((distance, pdf)) = light.shape.seen(path.from, direction, light.two_sided) else { continue };
            let t = distance - before;
            if t > 0.0 && t < end {
                let weight = mis_weight(path.pdf, self.lights.chance(index, path.from) * pdf);
                self.add(sample, path.bounces, path, index, path.throughput * light.radiance * weight);
            }
        }
        false
    }

    /// Whether a path may go on, along its new ray, after a scattering event of weight `weight` at `from`; surely for the
    /// first `sure`.
    #[inline]
    fn survives(&self, path: &mut Path<'_>, from: Vec3A, weight: Rgb, u: f32, sure: u32) -> bool {
        path.from = from;
        path.throughput *= weight;
        path.bounces += 1;
        let largest = path.throughput.max_channel();
        if largest <= 0.0 || path.bounces >= self.max_bounces {
            // At the limit the path still collects what its last ray meets: only its scattering ends.
            return largest > 0.0 && path.bounces == self.max_bounces;
        }
        if path.bounces > sure && largest < 1.0 {
            let keep = largest.max(0.05);
            if u >= keep {
                return false;
            }
            path.throughput /= keep;
        }
        true
    }

    /// Scatters at a yarn or passes it. Returns whether the path goes on, and whether it scattered.
    #[inline]
    #[allow(clippy::too_many_arguments, reason = "a path, what it met, and the worker's own memory")]
    fn scatter_at_yarn(
        &self,
        hit: &Hit,
        section: &Section<'_>,
        (yarns, yarn): (&YarnGeometry, &YarnScatterer),
        path: &mut Path<'_>,
        sample: &mut Sample,
        scratch: &mut Scratch,
        counters: &mut Counters,
    ) -> (bool, bool) {
        section.crossings(yarn.shape(), &mut scratch.crossings);
        let unscattered = yarn.transparency(&scratch.crossings);
        let [u_pass, u_light_choice, u_light_x, u_light_y] = path.sampler.next4();
        let seen = self.seen_fiber(hit, section, (yarns, yarn), path, scratch);
        // A line without any fibre comes after all others.
        let u_pass = seen.map_or(u_pass, |[number, _]| 1.0 - number);
        if u_pass < unscattered {
            path.passes += 1;
            // Behind the surface, so that the same hit is not found again.
            let entry = section.point_on_ray(0.0);
            let offset = (PASS_OFFSET * section.radius).max(PASS_ROUNDING * entry.abs().max_element());
            let behind = entry - offset * hit.normal;
            let done = path.ray.done.and(hit.yarn_place());
            path.ray = Ray { done, ..Ray::new(behind, path.ray.direction) };
            return (path.passes < MOST_PASSES, false);
        }
        if path.bounces == 0
            && let Some(front) = scratch.crossings.first()
        {
            sample.alpha = 1.0;
            sample.normal = section.to_world(front.normal(yarn.shape(), section));
            let point = section.point_on_ray(front.enter);
            sample.depth = (path.from - point).dot(self.back);
            self.sees_yarn(sample, hit, yarns, point, scratch.time);
            let ply = yarns.first_ply + front.ply;
            let index = yarns.strands.material_index_at(hit.segment, hit.u);
            self.describe(sample, yarns.fabric, index, ply, || yarns.strands.yarn_of(hit.segment));
        }
        if path.bounces >= self.max_bounces {
            return (false, false);
        }
        let u = path.sampler.next4();
        let [u_roulette, u_component, u_x, u_y] = path.sampler.next4();
        let mut stream = path.sampler.even_stream();
        let first_fiber = seen.map(|[number, side]| [(number / (1.0 - unscattered)).min(1.0 - f32::EPSILON), side]);
        let arrival = Arrival { throughput: path.throughput, lit: !self.lights.is_empty(), first_fiber };
        let vertex = yarn.vertex(section, &scratch.crossings, unscattered, arrival, u, &mut stream);

        let place = section.point_in_world(vertex.place());
        let u_start = stream.next();
        let light = [u_light_choice, u_light_x, u_light_y];
        self.next_event(place, light, path, sample, scratch, counters, |direction, pdf| {
            let direct = vertex.evaluate(section.to_local(direction), pdf, u_start);
            let start = section.point_in_world(direct.start?);
            let done = DoneWith::only(hit.yarn_place());
            Some(Response { value: Scattered::Cloth(direct.lobes), weight: 1.0, start, done })
        });

        let Some(next) = vertex.sample([u_component, u_x, u_y], &mut stream) else { return (false, true) };
        path.shares.get_or_insert(next.shares);
        path.pdf = next.pdf;
        let done = DoneWith::only(hit.yarn_place());
        path.ray = Ray { done, ..Ray::new(section.point_in_world(next.start), section.to_world(next.direction)) };
        (self.survives(path, place, next.weight, u_roulette, ROULETTE_AFTER), true)
    }

    /// Notes of what cloth a camera path met first.
    #[inline]
    fn describe(
        &self,
        sample: &mut Sample,
        fabric: usize,
        index: Option<u16>,
        ply: usize,
        yarn: impl FnOnce() -> usize,
    ) {
        if let Some(variants) = self.albedos.get(fabric) {
            sample.albedo = variants[index.map_or(0, |index| 1 + usize::from(index))][ply];
        }
        if self.identify {
            sample.matte = Some(MatteId { fabric: fabric as u32, yarn: yarn() as u32, ply: ply as u32 });
        }
    }
}

/// Albedo of one fibre of each ply of a fabric's yarn, or of the one fibre it is made of; then of all its variants.
fn ply_albedos(scene: &Scene, fabric: &Fabric) -> Vec<Vec<Rgb>> {
    let fibers = match fabric.kind {
        CurveKind::Yarn(yarn) => &scene.yarns[yarn].fibers[..],
        CurveKind::Fiber(fiber) => std::slice::from_ref(&scene.fibers[fiber]),
    };
    let albedo = |m: &FiberMaterial| Rgb::from(std::array::from_fn(|c| m.r[c] + m.tt[c] + m.d[c]));
    let variants = fabric.variants.iter().map(|yarn| &yarn.fibers[..]);
    std::iter::once(fibers).chain(variants).map(|fibers| fibers.iter().map(|(_, m)| albedo(m)).collect()).collect()
}

/// The place where a ray meets the ground at the distance `t`.
#[inline]
fn on_ground(ground: &Ground, ray: &Ray, t: f32) -> SurfacePlace {
    let mut point = ray.origin + t * ray.direction;
    point.y = ground.height;
    let normal = if ray.direction.y < 0.0 { Vec3A::Y } else { Vec3A::NEG_Y };
    SurfacePlace {
        point,
        next: point,
        normal,
        shading: normal,
        uv: Vec2::ZERO,
        uv_per_length: 0.0,
        material: ground.material,
        mesh: None,
    }
}

/// Where a ray meets the ground.
#[inline]
fn distance_to_ground(ground: &Ground, ray: &Ray) -> Option<f32> {
    let t = (ground.height - ray.origin.y) / ray.direction.y;
    (t > ray.t_near && t < ray.t_far && t.is_finite()).then_some(t)
}
