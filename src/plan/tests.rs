//! The same picture with a feature forced in and left out.

use std::sync::atomic::AtomicBool;

use super::*;
use crate::{
    cloth::Cloth,
    render,
    scene::force::{FORCEABLE, force},
    scene::load::{LoadOptions, parse},
};

/// One filled yarn under an even sky and a distant light: needs next to nothing.
const MINIMAL: &str = r#"
[render]
width = 32
height = 24
spp = 16
[fiber.f]
r = 0.2
d = 0.4
beta_r = 8.6
[yarn.y]
radius = 1
fiber = "f"
fibers = 60
density = 0.4
[[fabric]]
yarn = "y"
source = { type = "straight", count = 3, length = 6 }
[[light]]
type = "environment"
radiance = 0.5
"#;

const DISTANT: &str = "[[light]]\ntype = \"distant\"\ntowards = [0.3, 0.4, 1]\nirradiance = 2\n";

fn scene(text: &str) -> Scene {
    let mut scene = parse("a test", text, &LoadOptions::default()).unwrap();
    scene.layers = Layers::NONE;
    scene
}

fn used(scene: &Scene, name: &str) -> bool {
    let plan = Plan::new(scene);
    plan.features.iter().find(|f| f.name == name).unwrap_or_else(|| panic!("no feature {name}")).used
}

/// Colour of each pixel, and the variance of its mean.
fn picture(scene: &Scene) -> Vec<([f32; 3], [f32; 3])> {
    let (cloth, _) = Cloth::new(scene, 1).unwrap();
    let film = render::render(scene, &cloth, &AtomicBool::new(false), |_| {}).unwrap().film;
    (0..24)
        .flat_map(|y| (0..32).map(move |x| (x, y)))
        .map(|(x, y)| film.pixel(x, y))
        .map(|p| (p.color, p.variance))
        .collect()
}

/// Forces a feature in: it was left out, is used then, and the pictures are the same, to the bit or within their noise.
fn forced_is_the_same(text: &str, name: &str, to_the_bit: bool) {
    let plain = scene(text);
    let mut forced = plain.clone();
    force(&mut forced, name).unwrap();
    assert!(!used(&plain, name) && used(&forced, name), "{name}");
    let (a, b) = (picture(&plain), picture(&forced));
    if to_the_bit {
        assert!(a.iter().zip(&b).all(|(a, b)| a.0.map(f32::to_bits) == b.0.map(f32::to_bits)), "{name}");
        return;
    }
    for c in 0..3 {
        let sum = |p: &[([f32; 3], [f32; 3])]| -> (f64, f64) {
            p.iter().fold((0.0, 0.0), |s, p| (s.0 + f64::from(p.0[c]), s.1 + f64::from(p.1[c])))
        };
        let ((a, va), (b, vb)) = (sum(&a), sum(&b));
        assert!((a - b).abs() < 4.0 * (va + vb).sqrt() + 1e-6 * a, "{name}: {a} and {b}, variances {va} and {vb}");
    }
}

#[test]
fn layers_do_not_change_the_picture() {
    for name in [
        "lobe_layers",
        "depth_layer",
        "normal_layer",
        "albedo_layer",
        "cryptomatte",
        "variance_layer",
        "sample_layer",
        "position_layer",
        "motion_layer",
        "uv_layer",
    ] {
        forced_is_the_same(MINIMAL, name, true);
    }
}

#[test]
fn shapes_forced_in_do_not_change_the_picture() {
    forced_is_the_same(MINIMAL, "flyaways", true);
    forced_is_the_same(MINIMAL, "uneven_yarns", true);
    forced_is_the_same(MINIMAL, "meshes", true);
    let three = MINIMAL.replace("radius = 1\n", "radius = 1\nplies = 3\n");
    forced_is_the_same(&three, "ply_twist", false);
    forced_is_the_same(&three, "elliptical_plies", false);
    forced_is_the_same(MINIMAL, "ply_filter", false);
    forced_is_the_same(MINIMAL, "all_lobes", false);
}

#[test]
fn lights_and_lenses_forced_in_do_not_change_the_picture() {
    for name in ["environment_image", "distant_light", "point_light", "area_lights", "depth_of_field"] {
        forced_is_the_same(MINIMAL, name, false);
    }
    let lit = format!("{MINIMAL}{DISTANT}");
    for name in ["environment_image", "point_light", "area_lights"] {
        forced_is_the_same(&lit, name, false);
    }
}

#[test]
fn every_forceable_feature_is_in_the_plan_and_others_are_refused() {
    // A single ply has nothing to wind around.
    let three = MINIMAL.replace("radius = 1\n", "radius = 1\nplies = 3\n");
    for name in FORCEABLE {
        let mut scene = scene(&three);
        force(&mut scene, name).unwrap();
        assert!(used(&scene, name), "{name}");
    }
    assert!(force(&mut scene(MINIMAL), "nonsense").unwrap_err().contains("cannot be forced"));
}

#[test]
fn memory_of_layers_is_told() {
    let plan = Plan::new(&scene(MINIMAL));
    let lobes = plan.features.iter().find(|f| f.name == "lobe_layers").unwrap();
    assert!(!lobes.used && lobes.bytes > Some(32 * 24 * 100), "{lobes:?}");
}
