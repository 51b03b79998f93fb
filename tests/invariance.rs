//! What must not change a picture.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3A};
use yarnray::geometry::{
    curve::{Basis, Curve},
    strand::{StrandOptions, Strands},
    yarn_frame::YarnFrame,
};

use crate::support::{WHITE_FIBER, difference, render};

/// Straight yarns before a fixed camera, every length in `unit` of `per_unit` millimetres, all moved by `offset` mm.
fn straight(unit: &str, per_unit: f64, offset: f64, ply_twist: f64, extra: &str) -> String {
    let l = |mm: f64| mm / per_unit;
    let o = l(offset);
    format!(
        r#"
        unit = "{unit}"
        [render]
        width = 40
        height = 30
        spp = 64
        filter = "box"
        {extra}
        [camera]
        type = "orthographic"
        position = [{o}, {o}, {}]
        target = [{o}, {o}, {o}]
        size = {}
        [fiber.f]
        r = 0.2
        tt = [0.1, 0.4, 0.25]
        d = [0.03, 0.35, 0.1]
        [yarn.y]
        radius = {}
        plies = 3
        ply_twist = {ply_twist}
        fiber = "f"
        fibers = 50
        density = 0.3
        fiber_twist = -20
        [[fabric]]
        yarn = "y"
        phase = 20
        translate = [{o}, {o}, {o}]
        source = {{ type = "straight", length = {}, count = 3, spacing = {} }}
        [[light]]
        type = "environment"
        radiance = 0.3
        [[light]]
        type = "distant"
        towards = [0.4, 0.5, 0.8]
        irradiance = 2
        angular_radius = 1
        [[light]]
        type = "point"
        position = [{}, {o}, {}]
        intensity = {}
        "#,
        l(offset + 50.0),
        l(6.0),
        l(1.0),
        l(12.0),
        l(2.1),
        l(offset + 3.0),
        l(offset + 10.0),
        // Intensity is per square of the unit.
        40.0 / (per_unit * per_unit),
    )
}

#[track_caller]
fn alike(name: &str, a: &str, b: &str, mean: f64, rmse: f64) {
    let (a, b) = (render(a, &[]), render(b, &[]));
    let ratio: [f64; 3] = std::array::from_fn(|k| b.mean()[k] / a.mean()[k]);
    let difference = difference(&a, &b);
    eprintln!("{name}: mean ratio {ratio:.5?}, relative RMSE {difference:.5}");
    assert!(ratio.iter().all(|r| (r - 1.0).abs() < mean), "{name}: {ratio:?}");
    assert!(difference < rmse, "{name}: {difference}");
}

#[test]
fn fibers_that_are_told_apart_leave_the_mean_as_it_is() {
    let close = |size, detail| {
        straight("mm", 1.0, 0.0, 15.0, &format!("fiber_detail = {detail}"))
            .replace("size = 6", &format!("size = {size}"))
    };
    // Close by only some fibres are seen, which are a few percent brighter or darker than all: of all yarns from end to end.
    let all = |detail| render(&close(12.0, detail), &["--width", "320", "--height", "240", "--spp", "4"]).mean();
    let (all_smooth, all_apart) = (all(false), all(true));
    let ratio: [f64; 3] = std::array::from_fn(|k| all_apart[k] / all_smooth[k]);
    let (smooth, apart) = (render(&close(1.5, false), &[]), render(&close(1.5, true), &[]));
    let seen = difference(&smooth, &apart);
    let noise = difference(&smooth, &render(&close(1.5, false), &["--seed", "1"]));
    eprintln!("mean ratio {ratio:.4?}, relative RMSE {seen:.4}, of noise {noise:.4}");
    assert!(ratio.iter().all(|r| (r - 1.0).abs() < 0.005), "{ratio:?}");
    assert!(seen > 1.2 * noise, "{seen} where noise is {noise}");
    // From far away nobody can tell.
    assert_eq!(difference(&render(&close(600.0, false), &[]), &render(&close(600.0, true), &[])), 0.0);
}

#[test]
fn units_do_not_matter() {
    let millimetres = straight("mm", 1.0, 0.0, 15.0, "");
    alike("cm", &millimetres, &straight("cm", 10.0, 0.0, 15.0, ""), 2e-3, 0.05);
    alike("m", &millimetres, &straight("m", 1000.0, 0.0, 15.0, ""), 2e-3, 0.05);
}

#[test]
fn places_do_not_matter() {
    let here = straight("mm", 1.0, 0.0, 15.0, "");
    alike("moved by a metre", &here, &straight("mm", 1.0, 1e3, 15.0, ""), 2e-3, 0.05);
    alike("moved by a kilometre", &here, &straight("mm", 1.0, 1e6, 15.0, ""), 2e-3, 0.05);
}

/// Far from the scene's middle single precision rounds places by more than a share of a thin yarn; what a ray has passed is behind it
/// all the same.
#[test]
fn thin_yarns_far_out_are_passed_once() {
    let rays = |place: f64| {
        let at = format!("[{place}, {place}, {place}]");
        let yarn = |at: &str| {
            format!("[[fabric]]\nyarn = \"thin\"\ntranslate = {at}\nsource = {{ type = \"straight\", length = 9 }}\n")
        };
        let scene = format!(
            "render = {{ width = 48, height = 36, spp = 8, max_bounces = 0 }}\n\
             camera = {{ type = \"orthographic\", position = [{place}, {place}, {}], target = {at}, size = 0.15 }}\n\
             {WHITE_FIBER}\
             [yarn.thin]\nradius = 0.05\nplies = 1\nfiber = \"white\"\nfibers = 60\ndensity = 0.1\n{}{}\
             [[light]]\ntype = \"environment\"\n",
            place + 20.0,
            yarn(&at),
            yarn(&format!("[{0}, {0}, {0}]", -place)),
        );
        render(&scene, &[]).stats["rays"]["bounce"].as_f64().unwrap()
    };
    let [near, far] = [rays(10.0), rays(3000.0)];
    assert!(near > 1000.0 && far < 1.2 * near, "{near} rays go on, far out {far}");
}

#[test]
fn the_ways_to_intersect_plies_agree_where_they_must() {
    let way = |twist, name: &str| straight("mm", 1.0, 0.0, twist, &format!("ply_intersection = \"{name}\""));
    alike("untwisted plies", &way(0.0, "tilted"), &way(0.0, "perpendicular"), 0.02, 0.08);
    alike("twisted plies", &way(12.0, "tilted"), &way(12.0, "perpendicular"), 0.03, 0.12);
}

/// The direction in which a ply lies that starts at `angle`.
fn ply(place: &YarnFrame, angle: f64) -> Vec3A {
    let (sin, cos) = (f64::from(place.phase) + angle).sin_cos();
    place.normal * cos as f32 + place.tangent.cross(place.normal) * sin as f32
}

/// The angle between a ply direction at one place and at another, about the tangent.
fn turn(from: &YarnFrame, to: &YarnFrame) -> f64 {
    let (a, b) = (ply(from, 0.0), ply(to, 0.0));
    f64::from(a.cross(b).dot(to.tangent)).atan2(f64::from(a.dot(b)))
}

/// A closed curve that winds in space, so that a carried frame does not come back as it left.
fn loop_in_space(points: usize, wave: f64) -> Curve {
    let at = |i: usize| {
        let t = TAU * i as f64 / points as f64;
        DVec3::new(20.0 * t.cos(), 14.0 * t.sin(), wave * (2.0 * t).sin() + 0.5 * wave * (3.0 * t).cos())
    };
    Curve {
        basis: Basis::CatmullRom,
        closed: true,
        points: (0..points).map(at).collect(),
        radii: None,
        flattening: None,
    }
}

#[test]
fn plies_are_continuous_along_a_yarn_and_across_its_seam() {
    let mut worst: f64 = 0.0;
    for basis in [Basis::CatmullRom, Basis::BSpline] {
        for (points, wave, plies, rate, start) in
            [(24, 0.0, 3, 0.21, 0.0), (40, 6.0, 3, 0.17, 1.0), (33, 9.0, 2, -0.4, 2.0), (50, 5.0, 1, 0.05, 3.0)]
        {
            let curve = loop_in_space(points, wave);
            let radii = vec![1.0; curve.points.len()];
            let symmetry = TAU / f64::from(plies);
            let options = StrandOptions {
                basis,
                tolerance: 0.005,
                longest_segment: 3.0,
                ply_rate: rate,
                symmetry,
                phases: vec![start],
                distances: false,
                unevenness: None,
                tube: 1.0,
            };
            let strands = Strands::new(&[(curve, radii)], &options);
            let count = strands.segments().len() as u32;
            for segment in 0..count {
                let next = (segment + 1) % count;
                let (end, begin) = (strands.frame(segment, 1.0), strands.frame(next, 0.0));
                assert!(end.centre.distance(begin.centre) < 1e-3, "segment {segment} of {count}");
                assert!(end.tangent.dot(begin.tangent) > 1.0 - 1e-4, "segment {segment} of {count}");
                let mut turned = turn(&end, &begin);
                if next == 0 {
                    // Over the seam the section need only come back onto itself.
                    turned -= symmetry * (turned / symmetry).round();
                }
                worst = worst.max(turned.abs());
                assert!(turned.abs() < 2e-3, "{plies} plies, rate {rate}: {turned} between {segment} and {next}");
            }
        }
    }
    eprintln!("largest jump of a ply: {worst:.1e} rad");
}

#[test]
fn plies_turn_evenly_between_points() {
    // The rate is radians per radius of yarn; closing the seam may change it by half a symmetry over the whole.
    let curve = loop_in_space(30, 0.0);
    let radii = vec![1.0; 30];
    let options = StrandOptions {
        basis: Basis::CatmullRom,
        tolerance: 0.005,
        longest_segment: 3.0,
        ply_rate: 0.3,
        symmetry: TAU / 3.0,
        phases: vec![],
        distances: false,
        unevenness: None,
        tube: 1.0,
    };
    let strands = Strands::new(&[(curve, radii)], &options);
    let mut total = 0.0;
    for segment in 0..strands.segments().len() as u32 {
        for step in 0..8 {
            let place = |u: i32| strands.frame(segment, u as f32 / 8.0);
            total += turn(&place(step), &place(step + 1));
        }
    }
    let wanted = 0.3 * strands.length();
    eprintln!("{total:.3} rad of plies, {wanted:.3} wanted");
    assert!((total - wanted).abs() < TAU / 6.0 + 0.1, "{total} and {wanted}");
}
