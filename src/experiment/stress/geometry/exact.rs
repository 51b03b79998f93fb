//! Rays exactly across and along yarns.

use glam::{DVec3, Vec3A};

use super::{
    super::{Checks, Scale},
    scene, sound, straight, with_curves, world,
};
use crate::{
    geometry::{ray::Ray, section::Crossings},
    math::sampler::Stream,
    scene::load::{LoadOptions, parse},
    trace::{CurveGeometry, HitPlace, World},
};

pub(super) fn exact_rays(scale: Scale, checks: &mut Checks) {
    let n = scale.pick(500, 4000);
    for (name, axis) in [("x", DVec3::X), ("z", DVec3::Z), ("a diagonal", DVec3::new(0.6, 0.48, 0.64))] {
        let curve = straight(-axis * 30.0, axis * 30.0, 10);
        let scene = with_curves(scene("yarn", ""), &[curve], 1.0);
        let yarn = Straight { name, axis, side: axis.any_orthonormal_vector(), world: world(&scene) };
        for tilt in [0.0, 1e-8, 1e-6, 1e-4] {
            yarn.rays_across(tilt, n, checks);
        }
        for tilt in [0.0, 1e-7, 1e-5, 1e-3] {
            yarn.rays_along(tilt, checks);
        }
    }
    rays_of_a_scene(n, checks);
    // Rays that are no rays meet nothing, at once.
    let world = world(&scene("yarn", ""));
    let mut crossings = Crossings::new();
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let ray = Ray::new(Vec3A::new(0.0, bad, 5.0), Vec3A::NEG_Z);
        let met = world.intersect(&ray).is_some() || world.transmittance(&ray, &mut crossings) != 0.0;
        checks.never("a ray that is not finite meets something", met, &|| format!("{bad}"));
    }
}

/// A straight yarn along an axis, and a direction across it.
struct Straight {
    name: &'static str,
    axis: DVec3,
    side: DVec3,
    world: World,
}

impl Straight {
    /// Rays that are off a right angle to the yarn by `tilt`.
    fn rays_across(&self, tilt: f64, n: u32, checks: &mut Checks) {
        let Self { name, axis, side, world } = self;
        let mut crossings = Crossings::new();
        let direction = (*side + *axis * tilt).normalize();
        let (mut calls, mut most, mut lost) = ([0u64; 2], 0, 0);
        let mut stream = Stream::new(11);
        for i in 0..n {
            let h = 1.96 * (f64::from(i) + 0.5) / f64::from(n) - 0.98;
            let along = 20.0 * (f64::from(stream.next()) - 0.5);
            let ray = |h: f64| {
                let origin = *axis * along + axis.cross(*side) * h - direction * 10.0;
                Ray::new(origin.as_vec3a(), direction.as_vec3a())
            };
            let (hit, passed, asked) = world.probe(&ray(h), &mut crossings);
            calls = [calls[0] + u64::from(asked[0]), calls[1] + u64::from(asked[1])];
            most = most.max(asked[0]).max(asked[1]);
            let at = || format!("across {name}, tilted by {tilt:e}, h {h:.3}");
            if hit.is_none() {
                lost += 1;
                continue;
            }
            // What the crossing itself says of the same ray, or of one a rounding error beside it: towards a ply's wall
            // the chord has a slope without bound.
            let mut own = |h: f64| {
                let hit = world.intersect(&ray(h))?;
                let (HitPlace::Yarn(section), CurveGeometry::Yarns(yarns)) = (&hit.place, &world.geometries()[0])
                else {
                    return None;
                };
                let yarn = yarns.occluders.own();
                section.crossings(yarn.shape(), &mut crossings);
                let own = yarn.transparency(&crossings);
                // Below a thousandth, a shadow ray counts as blocked.
                Some(if own < 1e-3 { 0.0 } else { own })
            };
            let near: Vec<f32> = [h, h - 1e-6, h + 1e-6].into_iter().filter_map(&mut own).collect();
            let (low, high) = near.iter().fold((f32::MAX, f32::MIN), |(low, high), &t| (low.min(t), high.max(t)));
            let off = (low - passed).max(passed - high).max(0.0);
            checks.at_most("transmittance, off the crossing's own", f64::from(off), 2e-5, &at);
        }
        let at = || format!("across {name}, tilted by {tilt:e}");
        let calls = calls[0].max(calls[1]) as f64 / f64::from(n);
        if tilt < 1e-6 {
            // Embree offers one hit again and again; nothing in a scene sends such rays (see below).
            checks.at_most("filter calls of one ray, exactly across", f64::from(most), 2000.0, &at);
        } else {
            checks.at_most("filter calls of a ray, mean", calls, 8.0, &at);
            checks.at_most("filter calls of one ray", f64::from(most), 32.0, &at);
        }
        checks.at_most("lost rays", f64::from(lost), 0.0, &at);
    }

    /// Rays that are off the yarn's direction by `tilt`.
    fn rays_along(&self, tilt: f64, checks: &mut Checks) {
        let Self { name, axis, side, world } = self;
        let mut crossings = Crossings::new();
        let direction = (*axis + *side * tilt).normalize();
        for i in 0..50 {
            let h = 0.025 * f64::from(i);
            for from in [-60.0, 0.0, 29.0] {
                let at = || format!("along {name}, tilted by {tilt:e}, {h:.3} off the axis");
                let ray = Ray::new((*axis * from + axis.cross(*side) * h).as_vec3a(), direction.as_vec3a());
                let (hit, passed, asked) = world.probe(&ray, &mut crossings);
                checks.never("a hit that is not sound", hit.is_some_and(|h| !sound(&h)), &at);
                checks.never("transmittance outside 0 to 1", !(0.0..=1.0).contains(&passed), &at);
                let asked = f64::from(asked[0].max(asked[1]));
                checks.at_most("filter calls of a ray along the yarn", asked, 200.0, &at);
            }
        }
    }
}

/// What a scene sends exactly across its yarns: an orthographic camera's rays, and shadow rays to a distant light.
fn rays_of_a_scene(n: u32, checks: &mut Checks) {
    let exact = parse(
        "a stress case",
        "[fiber.f]\nr = 0.2\n[yarn.f]\nradius = 1\nfiber = \"f\"\nfibers = 40\ndensity = 0.15\n[[fabric]]\nyarn = \"f\"\n\
         source = { type = \"straight\", count = 1, length = 60 }\n[camera]\ntype = \"orthographic\"\nposition = [0, 0, 50]\n\
         target = [0, 0, 0]\nsize = 1.8\n[[light]]\ntype = \"distant\"\ntowards = [0, 0, 1]\n",
        &LoadOptions::default(),
    )
    .expect("the cases' own scenes are sound");
    let world = world(&exact);
    let mut crossings = Crossings::new();
    let (mut camera, mut light) = (0u64, 0u64);
    let mut stream = Stream::new(2);
    for i in 0..n {
        let at = glam::Vec2::new(30.0, (i as f32 + 0.5) / n as f32 * 40.0);
        let ray = exact.camera.ray(at, glam::Vec2::splat(0.5), 60, 40);
        camera += u64::from(world.probe(&ray, &mut crossings).2[0]);
        let from = Vec3A::new(stream.next(), 1.8 * stream.next() - 0.9, -3.0);
        if let Some(towards) = exact.lights[0].sample(from, glam::Vec2::splat(0.5)) {
            light += u64::from(world.probe(&Ray::new(from, towards.direction), &mut crossings).2[1]);
        }
    }
    let at = || "a scene's own exact rays".to_owned();
    checks.at_most("filter calls of a camera's ray, orthographic, mean", camera as f64 / f64::from(n), 8.0, &at);
    checks.at_most("filter calls of a shadow ray to a distant light, mean", light as f64 / f64::from(n), 8.0, &at);
}
