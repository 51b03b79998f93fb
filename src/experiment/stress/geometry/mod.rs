//! Curves and rays: sizes, distances, degenerate curves, exact directions.

mod exact;

use std::f64::consts::TAU;

use glam::{DVec3, Vec3A};

use super::{Case, Checks, Group::Geometry, Scale};
use crate::{
    cloth::Cloth,
    geometry::{
        curve::{Basis, Curve},
        ray::{DoneWith, Ray, YarnPlace},
        section::Crossings,
    },
    math::sampler::Stream,
    scene::{
        Scene,
        load::{LoadOptions, parse},
    },
    trace::{Hit, HitPlace, World},
};
use exact::exact_rays;

pub(in crate::experiment) const CASES: &[Case] = &[
    Case { group: Geometry, name: "radii", about: "yarns and fibres of radius 1e-6 to 1e6 mm", run: radii },
    Case {
        group: Geometry,
        name: "far_from_the_origin",
        about: "a scene moved by 1e3 to 1e7 radii, and one that is as wide as that",
        run: far_away,
    },
    Case {
        group: Geometry,
        name: "degenerate_curves",
        about: "coincident and collinear points, two points, turns back, radius 0, tapered ends, radius above the bend's",
        run: degenerate,
    },
    Case {
        group: Geometry,
        name: "exact_rays",
        about: "rays exactly across and exactly along a straight yarn, or all but",
        run: exact_rays,
    },
    Case {
        group: Geometry,
        name: "inside_and_overlapping",
        about: "rays born inside a yarn; yarns that touch, overlap and all but coincide",
        run: inside,
    },
    Case {
        group: Geometry,
        name: "many_curves",
        about: "a million tiny closed loops, and one curve of a million points (2 % of that in --quick)",
        run: many,
    },
];

/// A scene of one fabric, whose curves the cases replace. `what` is `yarn` or `fiber`.
pub(super) fn scene(what: &str, extra: &str) -> Scene {
    let text = format!(
        r#"
        [fiber.f]
        r = 0.2
        tt = 0.5
        d = 0.3
        beta_r = 8.6
        beta_tt = 6.9
        beta_n = 20
        [yarn.f]
        radius = 1
        fiber = "f"
        fibers = 40
        density = 0.15
        [[fabric]]
        {what} = "f"
        {radius}
        source = {{ type = "straight", count = 1, length = 100 }}
        {extra}
        "#,
        radius = if what == "fiber" { "radius = 1" } else { "" }
    );
    parse("a stress case", &text, &LoadOptions::default()).expect("the cases' own scenes are sound")
}

/// Puts other curves into the scene's fabric, all of one radius.
fn with_curves(mut scene: Scene, curves: &[Curve], radius: f64) -> Scene {
    let fabric = &mut scene.fabrics[0];
    fabric.curves =
        curves.iter().map(|c| (c.clone(), c.radii.clone().unwrap_or_else(|| vec![radius; c.points.len()]))).collect();
    fabric.basis = Basis::CatmullRom;
    scene
}

fn world(scene: &Scene) -> World {
    Cloth::new(scene, 1).expect("Embree builds the cases' scenes").0.into_world()
}

fn open(points: Vec<DVec3>) -> Curve {
    Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening: None }
}

fn closed(points: Vec<DVec3>) -> Curve {
    Curve { closed: true, ..open(points) }
}

fn straight(from: DVec3, to: DVec3, segments: usize) -> Curve {
    open((0..=segments).map(|i| from.lerp(to, i as f64 / segments as f64)).collect())
}

/// A unit vector, even over the sphere.
fn any_direction(stream: &mut Stream) -> DVec3 {
    let z = 2.0 * f64::from(stream.next()) - 1.0;
    let (s, c) = (TAU * f64::from(stream.next())).sin_cos();
    let r = (1.0 - z * z).sqrt();
    DVec3::new(r * c, r * s, z)
}

/// The middle and radius of what was hit.
fn tube(hit: &Hit) -> (Vec3A, f32) {
    match &hit.place {
        HitPlace::Yarn(section) => (section.centre, section.radius),
        HitPlace::Fiber(place) => (place.centre, place.radius),
        HitPlace::Surface(_) => unreachable!("the cases have no meshes"),
    }
}

/// Whether all numbers of a hit can be used.
fn sound(hit: &Hit) -> bool {
    let (centre, radius) = tube(hit);
    let place = match &hit.place {
        HitPlace::Yarn(s) => {
            (s.x + s.y + s.z).is_finite() && s.h.abs() <= 1.0 && s.enter.is_finite() && s.phase.is_finite()
        }
        HitPlace::Fiber(p) => (p.tangent.length() - 1.0).abs() < 1e-4,
        HitPlace::Surface(_) => false,
    };
    place && hit.t.is_finite() && centre.is_finite() && radius.is_finite() && (hit.normal.length() - 1.0).abs() < 1e-4
}

/// Rays at a straight yarn along `axis` through `middle`: errors of hit positions over the radius, sorted, and the
/// number of rays that should have hit and did not.
fn shoot(world: &World, middle: DVec3, axis: DVec3, length: f64, radius: f64, n: u32) -> (Vec<f64>, u32) {
    let mut stream = Stream::new(n);
    let (mut errors, mut lost) = (Vec::new(), 0);
    for _ in 0..n {
        let target = middle + axis * ((f64::from(stream.next()) - 0.5) * 0.8 * length);
        let direction = any_direction(&mut stream);
        let across = direction - direction.dot(axis) * axis;
        // Steep rays leave by the open ends.
        if across.length() < 0.3 {
            continue;
        }
        let side = axis.cross(across).normalize();
        let h = 1.9 * f64::from(stream.next()) - 0.95;
        let origin = target + side * (h * radius) - direction * (12.0 * radius);
        let ray = Ray::new(origin.as_vec3a(), direction.as_vec3a());
        // The ray as it is in single precision.
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let Some(hit) = world.intersect(&ray) else {
            lost += 1;
            continue;
        };
        let p = o + d * f64::from(hit.t) - middle;
        let distance = (p - p.dot(axis) * axis).length();
        errors.push((distance - radius).abs() / radius);
    }
    errors.sort_by(f64::total_cmp);
    (errors, lost)
}

fn quantile(sorted: &[f64], q: f64) -> f64 {
    sorted.get(((sorted.len() as f64 - 1.0) * q).max(0.0) as usize).copied().unwrap_or(f64::NAN)
}

fn radii(scale: Scale, checks: &mut Checks) {
    let n = scale.pick(2000, 20_000);
    for exponent in -6..=6 {
        let radius = 10f64.powi(exponent);
        for what in ["yarn", "fiber"] {
            let axis = DVec3::new(0.6, 0.48, 0.64);
            let length = 60.0 * radius;
            let curve = straight(-axis * 0.5 * length, axis * 0.5 * length, 12);
            let scene = with_curves(scene(what, ""), &[curve], radius);
            let world = world(&scene);
            let (errors, lost) = shoot(&world, DVec3::ZERO, axis, length, radius, n);
            let at = || format!("{what} of radius 1e{exponent} mm");
            let name = "hit position, error over the radius, 99.9 % of rays";
            checks.at_most(name, quantile(&errors, 0.999), 1e-3, &at);
            checks.at_most("lost rays, share", f64::from(lost) / f64::from(n), 1e-3, &at);
            let mut stream = Stream::new(7);
            let mut again = 0;
            for _ in 0..n {
                // From anywhere inside in any direction: nothing may be in the way.
                let (d, o) = (any_direction(&mut stream), any_direction(&mut stream) * f64::from(stream.next()) * 0.98);
                let from = (o - o.dot(axis) * axis) * radius;
                let ray = scattered_in(6, from, d);
                again += u32::from(world.intersect(&ray).is_some());
            }
            checks.at_most(
                "rays scattered inside that meet their own curve, share",
                f64::from(again) / f64::from(n),
                0.0,
                &at,
            );
        }
    }
}

fn far_away(scale: Scale, checks: &mut Checks) {
    let n = scale.pick(2000, 10_000);
    for exponent in 3..=7 {
        let d = 10f64.powi(exponent);
        let at = || format!("1e{exponent} radii");
        // The loader brings what is far away to the middle.
        let moved = parse(
            "a stress case",
            &format!(
                "[fiber.f]\nr = 0.2\n[yarn.f]\nradius = 1\nfiber = \"f\"\nfibers = 40\ndensity = 0.15\n[[fabric]]\nyarn = \"f\"\n\
                 translate = [{d}, -{d}, {d}]\nsource = {{ type = \"straight\", count = 1, length = 60 }}\n"
            ),
            &LoadOptions::default(),
        )
        .expect("the cases' own scenes are sound");
        let moved_world = world(&moved);
        let points = &moved.fabrics[0].curves[0].0.points;
        let axis = (points[points.len() - 1] - points[0]).normalize();
        let (errors, lost) = shoot(&moved_world, DVec3::ZERO, axis, 60.0, 1.0, n);
        checks.at_most("moved: hit position, error over the radius, 99.9 %", quantile(&errors, 0.999), 1e-3, &at);
        checks.at_most("moved: lost rays, share", f64::from(lost) / f64::from(n), 1e-3, &at);

        // One that is wide in itself keeps the digits of single precision, and says so.
        let axis = DVec3::new(0.6, 0.48, 0.64);
        let side = DVec3::new(-0.8, 0.36, 0.48);
        let piece = |at: DVec3| straight(at - axis * 30.0, at + axis * 30.0, 12);
        let wide = with_curves(scene("yarn", ""), &[piece(-side * d), piece(side * d)], 1.0);
        let wide_world = world(&wide);
        let (errors, lost) = shoot(&wide_world, side * d, axis, 60.0, 1.0, n);
        let name = "as wide: hit position, error over single precision's, 99.9 %";
        // Positions carry 2^-24 of themselves, a few times over.
        checks.at_most(name, quantile(&errors, 0.999) / (1e-3 + 4e-7 * d), 1.0, &at);
        if exponent <= 5 {
            checks.at_most("as wide, to 1e5 radii: lost rays, share", f64::from(lost) / f64::from(n), 2e-3, &at);
        }
        checks.never("a hit that is not sound", !sound_hits(&wide_world, side * d, 3.0, n / 4), &at);
    }
}

/// Whether all hits of rays about a place can be used.
fn sound_hits(world: &World, middle: DVec3, size: f64, n: u32) -> bool {
    let mut stream = Stream::new(3);
    let mut crossings = Crossings::new();
    (0..n).all(|i| {
        let target = middle + any_direction(&mut stream) * (size * f64::from(stream.next()));
        let direction = any_direction(&mut stream);
        let from = if i % 3 == 0 { target } else { target - direction * (4.0 * size) };
        let ray = Ray::new(from.as_vec3a(), direction.as_vec3a());
        let passed = world.transmittance(&ray, &mut crossings);
        (0.0..=1.0).contains(&passed) && world.intersect(&ray).is_none_or(|hit| sound(&hit))
    })
}

fn degenerate(scale: Scale, checks: &mut Checks) {
    let n = scale.pick(500, 5000);
    let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let circle = |radius: f64, points: usize| {
        let at = |i: usize| TAU * i as f64 / points as f64;
        closed((0..points).map(|i| p(radius * at(i).cos(), radius * at(i).sin(), 0.0)).collect())
    };
    let with_radii = |curve: Curve, radii: Vec<f64>| Curve { radii: Some(radii), ..curve };
    let cases: Vec<(&str, Curve)> = vec![
        ("two points", open(vec![p(-5.0, 0.0, 0.0), p(5.0, 0.0, 0.0)])),
        ("two points, all but one", open(vec![p(0.0, 0.0, 0.0), p(1e-9, 0.0, 0.0)])),
        ("all points in one place", open(vec![p(1.0, 1.0, 1.0); 6])),
        ("a loop in one place", closed(vec![p(1.0, 1.0, 1.0); 6])),
        (
            "points repeated",
            open(vec![p(-5.0, 0.0, 0.0), p(0.0, 0.0, 0.0), p(0.0, 0.0, 0.0), p(0.0, 0.0, 0.0), p(5.0, 1.0, 0.0)]),
        ),
        ("ends repeated", open(vec![p(-5.0, 0.0, 0.0), p(-5.0, 0.0, 0.0), p(5.0, 1.0, 0.0), p(5.0, 1.0, 0.0)])),
        (
            "collinear, uneven",
            open(vec![p(-5.0, 0.0, 0.0), p(-4.999_999, 0.0, 0.0), p(4.0, 0.0, 0.0), p(5.0, 0.0, 0.0)]),
        ),
        ("there and back", open(vec![p(-5.0, 0.0, 0.0), p(5.0, 0.0, 0.0), p(-5.0, 0.0, 0.0)])),
        ("there and back, closed", closed(vec![p(-5.0, 0.0, 0.0), p(5.0, 0.0, 0.0), p(0.0, 0.0, 0.0)])),
        (
            "turns of 180 degrees",
            open((0..9).map(|i| p(if i % 2 == 0 { -5.0 } else { 5.0 }, 0.0, 0.01 * f64::from(i))).collect()),
        ),
        ("a ring as thick as its bend", circle(1.0, 16)),
        ("a ring thicker than its bend", circle(0.3, 16)),
        ("a closed triangle", circle(4.0, 3)),
        ("radius 0", with_radii(straight(p(-5.0, 0.0, 0.0), p(5.0, 0.0, 0.0), 5), vec![0.0; 6])),
        (
            "ends tapered to 0",
            with_radii(straight(p(-5.0, 0.0, 0.0), p(5.0, 0.0, 0.0), 4), vec![0.0, 1.0, 1.0, 1.0, 0.0]),
        ),
        (
            "radius from 1e-6 to 10 and back",
            with_radii(straight(p(-5.0, 0.0, 0.0), p(5.0, 0.0, 0.0), 4), vec![1e-6, 10.0, 1e-6, 10.0, 1e-6]),
        ),
        (
            "huge and tiny steps",
            open(vec![p(-1e6, 0.0, 0.0), p(-1e-6, 0.0, 0.0), p(1e-6, 1e-6, 0.0), p(1e6, 1.0, 0.0)]),
        ),
    ];
    for (name, curve) in cases {
        for what in ["yarn", "fiber"] {
            for basis in [Basis::CatmullRom, Basis::BSpline] {
                let at = || format!("{name}, {what}, {basis:?}");
                let curve = Curve { basis, ..curve.clone() };
                let mut scene = with_curves(scene(what, ""), &[curve], 1.0);
                scene.fabrics[0].basis = basis;
                let world = world(&scene);
                checks.never("a hit that is not sound", !sound_hits(&world, DVec3::ZERO, 6.0, n), &at);
                let segments = world.geometries()[0].curves().2.len();
                checks.at_most("segments made", segments as f64, 5000.0, &at);
                let points = world.geometries()[0].curves().1;
                checks.never("a control point that is not finite", points.iter().any(|p| !p.is_finite()), &at);
            }
        }
    }
}

/// A ray from inside the world's only yarn that was scattered there, in this segment.
fn scattered_in(segment: u32, from: DVec3, direction: DVec3) -> Ray {
    let done = DoneWith::only(YarnPlace { geometry: 0, segment });
    Ray { done, ..Ray::new(from.as_vec3a(), direction.as_vec3a()) }
}

fn inside(scale: Scale, checks: &mut Checks) {
    let n = scale.pick(500, 5000);
    let mut crossings = Crossings::new();
    for apart in [3.0, 2.0, 1.5, 0.5, 1e-3] {
        let (a, b) = (DVec3::new(0.0, 0.0, -0.5 * apart), DVec3::new(0.0, 0.0, 0.5 * apart));
        let line = |at: DVec3, phase: f64| straight(at + DVec3::X * (phase - 30.0), at + DVec3::X * (30.0 + phase), 12);
        let both = with_curves(scene("yarn", ""), &[line(a, 0.0), line(b, 1.7)], 1.0);
        let one = with_curves(scene("yarn", ""), &[line(a, 0.0)], 1.0);
        let (both, one) = (world(&both), world(&one));
        let mut stream = Stream::new(5);
        for _ in 0..n {
            // Through both, across: each counts once.
            let h = 1.9 * f64::from(stream.next()) - 0.95;
            let x = 10.0 * (f64::from(stream.next()) - 0.5);
            let ray = Ray::new(DVec3::new(x, h, 20.0).as_vec3a(), Vec3A::new(0.01, 0.0, -1.0).normalize());
            let (single, double) = (one.transmittance(&ray, &mut crossings), both.transmittance(&ray, &mut crossings));
            let want = if single * single < 1e-3 { 0.0 } else { single * single };
            let at = || format!("axes {apart} radii apart, h {h:.3}: {double}, not {want}");
            // Rays close to the limit of what counts as blocked may fall on either side.
            if (single * single - 1e-3).abs() > 1e-5 {
                checks.at_most(
                    "transmittance of two yarns, off the product",
                    f64::from((double - want).abs()),
                    1e-3,
                    &at,
                );
            }
            // From inside the first towards the second: the first is behind the ray at once.
            let from = a + DVec3::new(x, 0.6 * h, 0.6 * (f64::from(stream.next()) - 0.5));
            let away = scattered_in(((x + 30.0) / 5.0) as u32, from, DVec3::NEG_Z);
            let met = one.intersect(&away).is_some() || one.transmittance(&away, &mut crossings) != 1.0;
            checks.never("a ray scattered inside meets its own yarn", met, &at);
        }
    }
    // On a bent yarn, from the surface inwards and outwards: the yarn itself may be met again only round the bend.
    let ring = |points: u32| {
        let at = |i: u32| TAU * f64::from(i) / f64::from(points);
        closed((0..points).map(|i| DVec3::new(6.0 * at(i).cos(), 6.0 * at(i).sin(), 0.0)).collect())
    };
    let world = world(&with_curves(scene("yarn", ""), &[ring(24)], 1.0));
    let mut stream = Stream::new(9);
    let (mut again, mut rays) = (0, 0);
    for _ in 0..n {
        let d = any_direction(&mut stream);
        let phi = TAU * f64::from(stream.next());
        let target = DVec3::new(6.0 * phi.cos(), 6.0 * phi.sin(), 0.0);
        let ray = Ray::new((target - d * 20.0).as_vec3a(), d.as_vec3a());
        let Some(hit) = world.intersect(&ray) else { continue };
        let HitPlace::Yarn(section) = hit.place else { continue };
        let point = ray.origin + hit.t * ray.direction;
        let off = (point - section.centre).length() / section.radius;
        checks.at_most(
            "hit position on a bent yarn, error over the radius",
            f64::from((off - 1.0).abs()),
            0.02,
            &|| format!("direction {d:.3}"),
        );
        // Outwards from just above the surface.
        let out = Ray::new(point + 1e-3 * hit.normal, hit.normal);
        rays += 1;
        again += u32::from(world.intersect(&out).is_some_and(|h| h.t < 0.5));
    }
    checks.at_most(
        "rays outwards that meet the same place again, share",
        f64::from(again) / f64::from(rays),
        0.0,
        &|| format!("{again} of {rays}"),
    );
}

fn many(scale: Scale, checks: &mut Checks) {
    let loops = scale.pick(20_000, 1_000_000);
    let mut stream = Stream::new(1);
    let curves: Vec<Curve> = (0..loops)
        .map(|_| {
            let middle = any_direction(&mut stream) * (100.0 * f64::from(stream.next()).cbrt());
            let (u, v) = {
                let a = any_direction(&mut stream);
                (a, a.any_orthonormal_vector())
            };
            closed(
                (0..4)
                    .map(|i| {
                        middle + 0.1 * (f64::from(i) * TAU / 4.0).cos() * u + 0.1 * (f64::from(i) * TAU / 4.0).sin() * v
                    })
                    .collect(),
            )
        })
        .collect();
    let long = open(
        (0..loops)
            .map(|i| {
                let t = 0.1 * f64::from(i);
                let r = 1.0 + 99.0 * f64::from(i) / f64::from(loops);
                DVec3::new(r * t.cos(), r * t.sin(), 0.002 * t)
            })
            .collect(),
    );
    for (name, curves, radius) in [("loops", curves, 0.02), ("one curve", vec![long], 0.02)] {
        let mut scene = with_curves(scene("yarn", ""), &curves, radius);
        scene.fabrics[0].tolerance = 0.0;
        scene.fabrics[0].longest_segment = 1e9;
        let started = std::time::Instant::now();
        let world = world(&scene);
        let seconds = started.elapsed().as_secs_f64();
        let segments = world.geometries()[0].curves().2.len() as f64;
        let at = || format!("{name}: {segments} segments in {seconds:.2} s");
        checks.at_least("segments for each point", segments / f64::from(loops), 0.99, &at);
        checks.at_most(
            "bytes for each segment",
            (world.geometry_bytes() + world.bvh_bytes()) as f64 / segments,
            200.0,
            &at,
        );
        checks.at_most("microseconds to build a segment", 1e6 * seconds / segments, 100.0, &at);
        let started = std::time::Instant::now();
        let rays = scale.pick(2000, 20_000);
        checks.never("a hit that is not sound", !sound_hits(&world, DVec3::ZERO, 100.0, rays), &at);
        let each = 1e6 * started.elapsed().as_secs_f64() / f64::from(2 * rays);
        checks.at_most("microseconds for a ray", each, 2000.0, &at);
    }
}
