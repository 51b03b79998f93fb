//! Lights of all kinds against closed forms and against each other.

use yarnray::image::exr::{self, ChannelSpec, ExrLayout, Line, Sample};

use crate::support::{Picture, SWATCH, WHITE_FIBER, directory, render};

/// The middle of a floor of albedo 0.8 at y = 0, seen straight from above; `more` are tables of lights.
fn floor(more: &str, spp: u32) -> Picture {
    let scene = format!(
        "render = {{ width = 16, height = 16, spp = {spp}, max_bounces = 1 }}\n\
         camera = {{ type = \"orthographic\", position = [0, 500, 0], target = [0, 0, 0], up = [0, 0, -1], size = 0.01 }}\n\
         ground = {{ height = 0, albedo = 0.8 }}\n{more}"
    );
    render(&scene, &[])
}

#[test]
fn a_floor_has_the_irradiance_of_the_closed_forms() {
    let pi = std::f64::consts::PI;
    // Each light with its irradiance at the floor's middle.
    let lights = [
        (
            "type = \"sphere\"\nposition = [0, 5, 3]\nradius = 1.5\nradiance = 2",
            2.0 * pi * 2.25 / 34.0 * 5.0 / 34f64.sqrt(),
        ),
        ("type = \"disk\"\nposition = [0, 2, 0]\nradius = 1\nradiance = 3", 3.0 * pi * 1.0 / 5.0),
        // A square of half side 1 at height 1: 4 times the form of one corner, (2 / sqrt 2) atan(1 / sqrt 2) of pi.
        ("type = \"rectangle\"\nposition = [0, 1, 0]\nsize = [2, 2]", 4.0 * (0.5f64.sqrt() * (0.5f64.sqrt()).atan())),
        ("type = \"spot\"\nposition = [0, 10, 0]\nangle = 20\nintensity = 50", 0.5),
        ("type = \"point\"\nposition = [0, 3, 4]\nintensity = 50", 2.0 * 0.6),
        ("type = \"distant\"\ntowards = [0, 1, 1]\nirradiance = 2", 2f64.sqrt()),
        ("type = \"distant\"\ntowards = [0, 1, 0]\nangular_radius = 60\nirradiance = 2", 2.0),
    ];
    let mut all = String::new();
    let mut sum = 0.0;
    for (light, irradiance) in lights {
        // A camera that looks through the lights sees the floor all the same.
        let hidden = if light.contains("\nradius") || light.contains("size") { "\nvisible = false\n" } else { "\n" };
        let table = format!("[[light]]\n{light}{hidden}");
        let got = floor(&table, 64).mean()[1];
        let want = 0.8 / pi * irradiance;
        assert!((got / want - 1.0).abs() < 0.015, "{light}: {got}, not {want}");
        all += &table;
        sum += want;
    }
    // All at once.
    let got = floor(&all, 256).mean()[1];
    assert!((got / sum - 1.0).abs() < 0.02, "all lights: {got}, not {sum}");
}

/// Light leaves a yarn beside the place where it came in; a ball no larger than the yarn is met from there in other directions,
/// and must not count twice. From ten times its size away, it is a point.
#[test]
fn a_small_ball_near_a_yarn_is_a_point() {
    let yarn = |light: &str| {
        let scene = format!(
            "render = {{ width = 64, height = 48, spp = 64, max_bounces = 1 }}\n\
             camera = {{ type = \"orthographic\", position = [0, 0, 20], target = [0, 0, 0], size = 2 }}\n\
             {WHITE_FIBER}\
             [yarn.sample]\nradius = 1\nplies = 1\nfiber = \"white\"\nfibers = 100\ndensity = 0.4\n\
             [[fabric]]\nyarn = \"sample\"\nsource = {{ type = \"straight\", length = 40 }}\n[[light]]\n{light}"
        );
        render(&scene, &[]).mean()[1]
    };
    let point = yarn("type = \"point\"\nposition = [0, 7.07, 7.07]\nintensity = 2.827433");
    let ball = yarn("type = \"sphere\"\nposition = [0, 7.07, 7.07]\nradius = 0.3\nradiance = 10\nvisible = false");
    assert!((ball / point - 1.0).abs() < 0.03, "{ball} of a ball, {point} of a point");
}

/// Angles of any size are angles.
#[test]
fn a_sky_turns_by_whole_rounds() {
    let sky = |rotate: &str| {
        let folder = directory();
        let path = folder.path().join("sky.exr");
        let layout = ["R", "G", "B"].map(|name| ChannelSpec::new(name, Sample::F32));
        exr::write(&path, &ExrLayout::new(8, 4, layout.into()), |_, lines| {
            for (channel, line) in lines.iter_mut().enumerate() {
                if let Line::Float(line) = line {
                    line.iter_mut().enumerate().for_each(|(x, v)| *v = ((x + channel) % 3) as f32);
                }
            }
        })
        .unwrap();
        floor(
            &format!(
                "[[light]]\ntype = \"environment\"\nimage = {:?}\nrotate = {rotate}\n",
                path.display().to_string()
            ),
            8,
        )
        .mean()
    };
    assert_eq!(sky("30"), sky("-7170"));
    assert!(sky("1e300").iter().all(|v| v.is_finite()));
}

#[test]
fn a_light_that_the_camera_sees_hides_the_floor() {
    let light = |visible| {
        format!(
            "[[light]]\ntype = \"disk\"\ntwo_sided = true\nposition = [0, 2, 0]\nradius = 1\nradiance = 3\nvisible = {visible}"
        )
    };
    let seen = floor(&light(true), 4);
    assert!(seen.colors().iter().all(|c| (c[0] - 3.0).abs() < 1e-6));
    assert!(seen.channel("depth.Z").iter().all(|d| (d - 498.0).abs() < 0.01));
    assert!(floor(&light(false), 4).mean()[0] < 1.0);
}

#[test]
fn cloth_under_a_ball_of_light_is_as_under_a_disc_of_the_sky() {
    // The ball is found by shadow rays and by sampled directions, the disc by shadow rays only.
    let angle = 25f64.to_radians();
    let cloth = &SWATCH[..SWATCH.find("[[light]]").unwrap()];
    let far = 5e4;
    let ball = format!(
        "{cloth}[[light]]\ntype = \"sphere\"\nposition = [0, {}, {}]\nradius = {}\nradiance = 2\nvisible = false\n",
        0.6 * far,
        0.8 * far,
        far * angle.sin()
    );
    let disc = format!(
        "{cloth}[[light]]\ntype = \"distant\"\ntowards = [0, 0.6, 0.8]\nangular_radius = 25\nirradiance = {}\n",
        2.0 * std::f64::consts::PI * angle.sin().powi(2)
    );
    let args = ["--spp", "1024"];
    let (ball, disc) = (render(&ball, &args), render(&disc, &args));
    let (a, b) = (ball.mean(), disc.mean());
    // Both share the random numbers of their paths, but for those that the ball alone asks for.
    for k in 0..3 {
        assert!((a[k] / b[k] - 1.0).abs() < 0.0015, "{a:?} {b:?}");
    }
}

#[test]
fn a_light_out_of_focus_is_a_disc_as_wide_as_its_circle_of_confusion() {
    let bulb = |lens: &str| {
        let scene = format!(
            "render = {{ width = 120, height = 90, spp = 64, filter = \"box\" }}\n\
             camera = {{ type = \"perspective\", position = [0, 0, 0], target = [0, 0, -1], fov = 40{lens} }}\n\
             [[light]]\ntype = \"sphere\"\nposition = [0, 0, -100]\nradius = 1.5\n"
        );
        let alpha = render(&scene, &[]).channel("A").iter().map(|&a| f64::from(a)).collect::<Vec<_>>();
        // The diameter of an even disc that spreads as much from top to bottom; pixels themselves spread by 1 / 12.
        let (mut sum, mut squares) = (0.0, 0.0);
        for (y, row) in alpha.chunks(120).enumerate() {
            let all = row.iter().sum::<f64>();
            (sum, squares) = (sum + all, squares + all * (y as f64 - 44.5).powi(2));
        }
        (sum, 4.0 * (squares / sum - 1.0 / 12.0).sqrt())
    };
    let pixels = 90.0 / (2.0 * 20f64.to_radians().tan());
    let (sharp, width) = bulb("");
    assert!((sharp / (std::f64::consts::PI * (0.015 * pixels).powi(2)) - 1.0).abs() < 0.03, "{sharp}");
    assert!((width / (0.03 * pixels) - 1.0).abs() < 0.05, "{width}");
    let (same, width) = bulb(", aperture = 10, focus_distance = 100");
    assert!((same / sharp - 1.0).abs() < 0.03 && (width / (0.03 * pixels) - 1.0).abs() < 0.05, "{same} {width}");
    // Opening over distance, once as seen from the light and once from the sharp plane.
    for (lens, opening) in [
        (", aperture = 10, focus_distance = 40", 10.0),
        (", f_number = 4, focus = [7, 3, -40]", 3.0 / 20f64.to_radians().tan()),
    ] {
        let (blurred, width) = bulb(lens);
        let circle = opening * (1.0 / 40.0 - 1.0 / 100.0) * pixels;
        // What is blurred spreads by both.
        let wanted = circle.hypot(0.03 * pixels);
        assert!((width / wanted - 1.0).abs() < 0.03, "{lens}: {width}, not {wanted}");
        assert!((blurred / sharp - 1.0).abs() < 0.05, "{lens}: {blurred}, not {sharp}");
    }
}
