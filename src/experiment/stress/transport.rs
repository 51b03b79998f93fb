//! Whole pictures: white furnaces, extreme lights, cameras in strange places, extreme sizes and depths.

use std::sync::atomic::AtomicBool;

use super::{Case, Checks, Group::Transport, Scale};
use crate::{
    cloth::Cloth,
    render::{Rendered, render},
    scene::{
        Layers,
        load::{LoadOptions, parse},
    },
};

pub(super) const CASES: &[Case] = &[
    Case {
        group: Transport,
        name: "white_furnace",
        about: "cloth of albedo 1 under an even sky of radiance 1: yarns with the aggregated model, and single fibres",
        run: furnace,
    },
    Case {
        group: Transport,
        name: "black_and_nearly_white",
        about: "albedos 0 and 1 - 1e-6 under an even sky",
        run: black,
    },
    Case { group: Transport, name: "extreme_lights", about: "every kind of light at 1e-20 and 1e20", run: lights },
    Case {
        group: Transport,
        name: "inside_the_cloth",
        about: "a point light and a camera inside a yarn, and both",
        run: inside,
    },
    Case {
        group: Transport,
        name: "picture_sizes",
        about: "pictures of 1 x 1, 16384 x 1 and 1 x 16384 pixels",
        run: sizes,
    },
    Case {
        group: Transport,
        name: "path_depths",
        about: "at most 1 and at most 10 000 scattering events",
        run: depths,
    },
    Case { group: Transport, name: "nothing_there", about: "no cloth, no light, neither", run: nothing },
    Case { group: Transport, name: "threads", about: "the same picture for 1, 2 and 5 threads", run: threads },
];

/// How far from 1 white cloth under a white sky may be, beside four standard errors.
const FURNACE: f64 = 0.005;

/// A scene's pieces; each case changes some.
struct Pieces {
    render: String,
    camera: String,
    albedo: [f64; 3],
    yarn: String,
    cloth: String,
    lights: String,
}

const SKY: &str = "[[light]]\ntype = \"environment\"\nradiance = 1\n";
const PATCH: &str = "[[fabric]]\nyarn = \"y\"\nsource = { type = \"straight\", count = 5, length = 12 }\n";

impl Pieces {
    fn new() -> Self {
        Self {
            render: "width = 24\nheight = 18\nspp = 32\nmax_bounces = 64".to_owned(),
            camera: "camera = \"frame\"".to_owned(),
            albedo: [0.2, 0.5, 0.3],
            yarn: "radius = 1\nplies = 3\nply_twist = 15\nfiber = \"f\"\nfibers = 40\ndensity = 0.3\nfiber_twist = -20"
                .to_owned(),
            cloth: PATCH.to_owned(),
            lights: SKY.to_owned(),
        }
    }

    fn text(&self) -> String {
        let [r, tt, d] = self.albedo;
        format!(
            "{}\n[render]\n{}\n[fiber.f]\nr = {r}\ntt = {tt}\nd = {d}\nbeta_r = 8.6\nbeta_tt = 6.9\nbeta_n = 20\n\
             [yarn.y]\n{}\n{}\n{}",
            // A camera table has to stand after the plain keys, which is here, too.
            self.camera,
            self.render,
            self.yarn,
            self.cloth,
            self.lights
        )
    }

    fn rendered(&self, threads: usize) -> Picture {
        let mut scene =
            parse("a stress case", &self.text(), &LoadOptions::default()).expect("the cases' own scenes are sound");
        scene.layers = Layers::NONE;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be started");
        let rendered = pool.install(|| {
            let (cloth, _) = Cloth::new(&scene, threads).expect("Embree builds the cases' scenes");
            render(&scene, &cloth, &AtomicBool::new(false), |_| {}).expect("the cases' films are small")
        });
        let (width, height) = (scene.render.width, scene.render.height);
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let mut picture = Picture { colors: Vec::new(), mean: [0.0; 3], se: [0.0; 3], rendered };
        for (x, y) in pixels {
            let pixel = picture.rendered.film.pixel(x, y);
            picture.colors.push(pixel.color);
            for c in 0..3 {
                picture.mean[c] += f64::from(pixel.color[c]);
                picture.se[c] += f64::from(pixel.variance[c]);
            }
        }
        let n = picture.colors.len() as f64;
        picture.mean = picture.mean.map(|m| m / n);
        picture.se = picture.se.map(|v| v.sqrt() / n);
        picture
    }

    /// Renders with all threads there are.
    fn picture(&self) -> Picture {
        self.rendered(std::thread::available_parallelism().map_or(1, usize::from))
    }
}

struct Picture {
    colors: Vec<[f32; 3]>,
    mean: [f64; 3],
    se: [f64; 3],
    rendered: Rendered,
}

impl Picture {
    fn sound(&self, checks: &mut Checks, at: &dyn Fn() -> String) {
        checks.at_most("samples not finite", self.rendered.counters.invalid as f64, 0.0, at);
        checks.never(
            "a pixel not finite or negative",
            self.colors.iter().flatten().any(|v| !v.is_finite() || *v < 0.0),
            at,
        );
    }
}

fn furnace(scale: Scale, checks: &mut Checks) {
    let yarns = [
        (
            "3 plies, density 0.3",
            "radius = 1\nplies = 3\nply_twist = 15\nfiber = \"f\"\nfibers = 40\ndensity = 0.3\nfiber_twist = -20",
        ),
        ("1 ply, density 0.7", "radius = 1\nfiber = \"f\"\nfibers = 200\ndensity = 0.7"),
        ("2 plies, density 0.05", "radius = 1\nplies = 2\nfiber = \"f\"\nfibers = 20\ndensity = 0.05"),
    ];
    let mut pieces = Pieces::new();
    pieces.render = format!("width = 24\nheight = 18\nspp = {}\nmax_bounces = 10000", scale.pick(64, 1024));
    let mut judge = |picture: &Picture, at: &dyn Fn() -> String| {
        picture.sound(checks, at);
        for c in 0..3 {
            let slack = 4.0 * picture.se[c];
            checks.at_most("brightness above 1, less four standard errors", picture.mean[c] - slack - 1.0, FURNACE, at);
            checks.at_least("brightness, with four standard errors", picture.mean[c] + slack, 1.0 - FURNACE, at);
        }
    };
    for (name, yarn) in yarns {
        yarn.clone_into(&mut pieces.yarn);
        judge(&pieces.picture(), &|| format!("yarns, {name}"));
    }
    // Fibres side by side, three layers deep.
    pieces.cloth = (0..3)
        .map(|layer| {
            format!(
                "[[fabric]]\nfiber = \"f\"\nradius = 0.05\ntranslate = [0, 0.03, {}]\nname = \"layer {layer}\"\nsource = {{ type = \"straight\", \
                 count = 30, length = 4, spacing = 0.11 }}\n",
                0.12 * f64::from(layer)
            )
        })
        .collect();
    judge(&pieces.picture(), &|| "fibres".to_owned());
}

fn black(scale: Scale, checks: &mut Checks) {
    let mut pieces = Pieces::new();
    pieces.render = format!("width = 24\nheight = 18\nspp = {}\nmax_bounces = 2000", scale.pick(16, 256));
    pieces.albedo = [0.0; 3];
    let dark = pieces.picture();
    dark.sound(checks, &|| "albedo 0".to_owned());
    // What is seen is the sky through and between the yarns: each sample is the sky or nothing.
    checks.at_most("brightness of black cloth and its gaps", dark.mean[0], 0.9, &|| "albedo 0".to_owned());
    checks.at_most(
        "bounced paths of black cloth",
        (dark.rendered.counters.events as f64 - dark.rendered.counters.cloth_paths as f64).abs(),
        0.0,
        &|| "albedo 0".to_owned(),
    );
    pieces.albedo = [0.2, 0.5, 0.299_999];
    let bright = pieces.picture();
    let at = || "albedo 1 - 1e-6".to_owned();
    bright.sound(checks, &at);
    checks.at_least(
        "brightness of nearly white cloth, with four standard errors",
        bright.mean[1] + 4.0 * bright.se[1],
        0.99,
        &at,
    );
}

fn lights(scale: Scale, checks: &mut Checks) {
    let spp = scale.pick(8, 64);
    for power in [1e-20, 1e20] {
        for (name, light) in [
            ("environment", format!("[[light]]\ntype = \"environment\"\nradiance = {power:e}\n")),
            ("distant", format!("[[light]]\ntype = \"distant\"\ntowards = [0.3, 0.4, 1]\nirradiance = {power:e}\n")),
            (
                "disc of the sky",
                format!(
                    "[[light]]\ntype = \"distant\"\ntowards = [0.3, 0.4, 1]\nirradiance = {power:e}\nangular_radius = 5\n"
                ),
            ),
            ("point", format!("[[light]]\ntype = \"point\"\nposition = [0, 0, 8]\nintensity = {power:e}\n")),
        ] {
            let mut pieces = Pieces::new();
            pieces.render = format!("width = 24\nheight = 18\nspp = {spp}\nseed = 3");
            pieces.lights = light.clone();
            let picture = pieces.picture();
            let at = || format!("{name}, {power:e}");
            picture.sound(checks, &at);
            // Light is linear: the same picture, times the power.
            pieces.lights = light.replace(&format!("{power:e}"), "1");
            let plain = pieces.picture();
            let ratio = picture.mean[1] / (plain.mean[1] * power);
            checks.at_most("brightness over that of power 1, off 1", (ratio - 1.0).abs(), 1e-3, &at);
        }
    }
    // A faint light beside a strong one, and the same light many times.
    let mut pieces = Pieces::new();
    pieces.render = format!("width = 24\nheight = 18\nspp = {spp}");
    pieces.lights = format!(
        "{SKY}[[light]]\ntype = \"distant\"\ntowards = [0, 0, 1]\nirradiance = 1e20\n[[light]]\ntype = \"point\"\nposition = [0, 0, 9]\nintensity = 1e-20\n"
    );
    pieces.picture().sound(checks, &|| "1e-20 beside 1e20".to_owned());
}

fn inside(scale: Scale, checks: &mut Checks) {
    let point = |at: &str| format!("[[light]]\ntype = \"point\"\nposition = {at}\nintensity = 1\n");
    // The yarns lie along x, 2 apart or a bit more, the middle one on the axis.
    let within = "[camera]\ntype = \"perspective\"\nposition = [0, 0.1, 0.2]\ntarget = [1, 0.3, 5]\nfov = 60";
    let along = "[camera]\ntype = \"perspective\"\nposition = [0, 0, 0]\ntarget = [1, 0, 0]\nfov = 60";
    for (name, camera, light) in [
        ("a light inside", "camera = \"frame\"", point("[0, 0.1, 0.2]")),
        ("a light on the axis", "camera = \"frame\"", point("[0, 0, 0]")),
        ("a light on the surface", "camera = \"frame\"", point("[0, 0, 1]")),
        ("a camera inside", within, SKY.to_owned()),
        ("a camera on the axis, along the yarn", along, SKY.to_owned()),
        ("a camera and a light inside", within, point("[0.1, 0.1, 0.2]")),
        ("a light at the camera", within, point("[0, 0.1, 0.2]")),
    ] {
        let mut pieces = Pieces::new();
        pieces.render = format!("width = 24\nheight = 18\nspp = {}\nmax_bounces = 200", scale.pick(16, 256));
        camera.clone_into(&mut pieces.camera);
        pieces.lights = light;
        let at = || name.to_owned();
        let picture = pieces.picture();
        picture.sound(checks, &at);
        let events = picture.rendered.counters.events as f64 / picture.rendered.counters.camera as f64;
        checks.at_most("scattering events of a path, mean", events, 100.0, &at);
        checks.at_most("seconds", picture.rendered.elapsed.as_secs_f64(), 60.0, &at);
    }
}

fn sizes(scale: Scale, checks: &mut Checks) {
    for (width, height) in [(1, 1), (scale.pick(4096, 16384), 1), (1, scale.pick(4096, 16384))] {
        let mut pieces = Pieces::new();
        pieces.render = format!("width = {width}\nheight = {height}\nspp = {}", scale.pick(2, 8));
        let picture = pieces.picture();
        let at = || format!("{width} x {height}");
        picture.sound(checks, &at);
        checks.never("a pixel without its samples", picture.rendered.film.samples().0 != scale.pick(2, 8), &at);
    }
}

fn depths(scale: Scale, checks: &mut Checks) {
    let spp = scale.pick(32, 512);
    let mut before = 0.0;
    for depth in [1, 10, 10_000] {
        let mut pieces = Pieces::new();
        pieces.render = format!("width = 24\nheight = 18\nspp = {spp}\nmax_bounces = {depth}");
        let picture = pieces.picture();
        let at = || format!("at most {depth} events");
        picture.sound(checks, &at);
        let c = &picture.rendered.counters;
        checks.at_most(
            "scattering events of a path over the most allowed",
            c.events as f64 / c.cloth_paths as f64 / f64::from(depth),
            1.0,
            &at,
        );
        checks.at_least(
            "brightness gained by longer paths",
            picture.mean[1] - before,
            -4.0 * picture.se[1] - 1e-3,
            &at,
        );
        checks.at_most("seconds", picture.rendered.elapsed.as_secs_f64(), 60.0, &at);
        before = picture.mean[1];
    }
}

fn nothing(_: Scale, checks: &mut Checks) {
    let fixed = "[camera]\ntype = \"perspective\"\nposition = [0, 0, 30]\ntarget = [0, 0, 0]\nfov = 30";
    for (name, cloth, lights, value) in
        [("no cloth", "", SKY, Some(1.0)), ("no light", PATCH, "", Some(0.0)), ("neither", "", "", Some(0.0))]
    {
        for camera in [fixed, "camera = \"frame\""] {
            let mut pieces = Pieces::new();
            pieces.cloth = cloth.to_owned();
            pieces.lights = lights.to_owned();
            // Cloth of which nothing is said has light.
            let none = if lights.is_empty() { "light = []\n" } else { "" };
            pieces.camera = format!("{none}{camera}");
            let at = || format!("{name}, {}", camera.split('\n').next().unwrap_or(""));
            let picture = pieces.picture();
            picture.sound(checks, &at);
            if let Some(value) = value {
                let off = picture.colors.iter().flatten().map(|v| (f64::from(*v) - value).abs()).fold(0.0, f64::max);
                checks.at_most("pixels off what they must be", off, 0.0, &at);
            }
        }
    }
}

fn threads(scale: Scale, checks: &mut Checks) {
    for (name, lights) in [
        ("sky", SKY.to_owned()),
        ("sky and point", format!("{SKY}[[light]]\ntype = \"point\"\nposition = [2, 3, 5]\nintensity = 10\n")),
    ] {
        let mut pieces = Pieces::new();
        pieces.render = format!("width = 40\nheight = 33\nspp = {}", scale.pick(4, 32));
        pieces.lights = lights;
        let one = pieces.rendered(1);
        for n in [2, 5] {
            let other = pieces.rendered(n);
            let bits = |p: &Picture| p.colors.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
            let different = bits(&one).iter().zip(bits(&other)).filter(|(a, b)| **a != *b).count();
            checks.at_most("values that differ", different as f64, 0.0, &|| format!("{name}, {n} threads"));
        }
    }
}
