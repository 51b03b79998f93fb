//! Every scene of the project, and real curve files.

use std::{path::Path, sync::Mutex};

use crate::support::{Picture, directory, mean, project, render, render_file, scenes, shared, write, yarnray};

/// No channel may hold what is not a number, and somewhere there must be cloth.
#[track_caller]
fn sound(picture: &Picture, name: &str) {
    for channel in &picture.image.channels {
        assert!(channel.samples.iter().all(|s| s.is_finite()), "{name}: {}", channel.name);
    }
    for key in ["R", "G", "B", "A", "depth.Z", "variance.R"] {
        assert!(picture.channel(key).iter().all(|&s| s >= 0.0), "{name}: {key}");
    }
    assert_eq!(picture.stats["invalid_samples"], 0, "{name}");
    assert!(picture.channel("A").iter().any(|&a| a > 0.5), "{name}: no cloth");
    assert!(picture.mean().iter().all(|&c| c > 0.0), "{name}: black");
}

/// What a file below `scenes` turned out to be.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Kind {
    Suite,
    Library,
    Scene,
    /// A scene whose curves are not beside the project.
    Skipped,
}

/// Holds that a file is sound: a suite down to its rows, a library by itself, a scene as a tiny picture.
fn check(path: &Path, glove: Option<&Path>) -> Kind {
    let name = path.file_name().unwrap().to_string_lossy().into_owned();
    let text = std::fs::read_to_string(path).unwrap();
    let folder = path.parent().unwrap();
    if text.contains("[[row]]") {
        let run = yarnray(folder, &["bench", &name, "--row", "no such row"]);
        assert_eq!(run.stderr, format!("error: no row of {name} contains no such row\n"));
        return Kind::Suite;
    }
    if !text.contains("[[fabric]]") {
        yarnray(folder, &["info", &name]).good();
        return Kind::Library;
    }
    let mut curves = Vec::new();
    if text.contains("--curves") && !text.contains("path =") {
        let Some(glove) = glove else { return Kind::Skipped };
        curves = vec!["--curves".to_owned(), glove.to_string_lossy().into_owned()];
    }
    let curves: Vec<&str> = curves.iter().map(String::as_str).collect();
    yarnray(folder, &[&["info", name.as_str()], &curves[..]].concat()).good();
    let small = ["--width", "32", "--height", "24", "--spp", "2"];
    sound(&render_file(path, &[&small, &curves[..]].concat()), &name);
    Kind::Scene
}

#[test]
fn every_scene_of_the_project_renders() {
    let glove = shared("data/curves/glove.bcc");
    // Most of the time goes into making cloth, much of it on one core.
    let waiting = Mutex::new(scenes(&project("scenes")).into_iter());
    let kinds = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from).min(4) {
            scope.spawn(|| {
                loop {
                    let Some(path) = waiting.lock().unwrap().next() else { break };
                    let kind = check(&path, glove.as_deref());
                    kinds.lock().unwrap().push(kind);
                }
            });
        }
    });
    let kinds = kinds.into_inner().unwrap();
    let count = |kind: Kind| kinds.iter().filter(|k| **k == kind).count();
    let rendered = count(Kind::Scene) + count(Kind::Skipped);
    assert_eq!([count(Kind::Suite), count(Kind::Library), rendered], [2, 3, 50]);
}

/// A scene for any curve file: `source` without its path, and the yarn's radius in millimetres.
fn scene(path: &Path, source: &str, radius: f64) -> String {
    format!(
        "render = {{ width = 40, height = 30, spp = 4 }}\n[fiber.f]\nr = 0.2\ntt = 0.3\nd = 0.2\n[yarn.y]\n\
         radius = {radius}\nplies = 3\nply_twist = 15\nfiber = \"f\"\nfibers = 30\ndensity = 0.3\nfiber_twist = -20\n\
         [[fabric]]\nyarn = \"y\"\nsource = {{ type = \"file\", path = {:?}, {source} }}\n\
         [[light]]\ntype = \"environment\"\n",
        path.canonicalize().unwrap().display().to_string()
    )
}

#[test]
fn real_curve_files_render() {
    for (file, source, radius, curves, share) in [
        ("data/curves/glove.bcc", "unit = \"cm\"", 0.9, 70, 0.1),
        ("data/curves/flame_ribbing_pattern.bcc", "unit = \"cm\"", 1.0, 1, 0.02),
        ("data/curves/openwork_trellis_pattern.bcc", "unit = \"cm\"", 0.6, 1, 0.02),
        ("data/curves/knittubeinit.bcc", "unit = \"cm\"", 1.0, 0, 0.1),
        ("data/patterns/stockinette.pyp", "tile = [3, 3]", 0.4, 0, 0.1),
        ("data/patterns/basket.pyp", "tile = [3, 3]", 0.4, 0, 0.1),
        ("data/patterns/satin.pyp", "tile = [3, 3]", 0.4, 0, 0.1),
    ] {
        let Some(path) = shared(file) else { continue };
        let directory = directory();
        let picture = render_file(&write(directory.path(), "s.toml", scene(&path, source, radius)), &[]);
        sound(&picture, file);
        let yarns = picture.stats["curves"]["yarns"].as_u64().unwrap();
        assert!(yarns > 0 && (curves == 0 || yarns == curves), "{file}: {yarns} yarns");
        let cloth = picture.channel("A").iter().map(|&a| f64::from(a)).sum::<f64>() / 1200.0;
        eprintln!("{file}: {yarns} yarns, {cloth:.2} of the picture is cloth");
        assert!(cloth > share, "{file}: {cloth}");
    }
}

#[test]
fn the_sweater_needs_little_memory() {
    let Some(path) = shared("data/curves/alien_sweater.bcc") else { return };
    let scene = project("scenes/glove.toml");
    let curves = path.to_string_lossy().into_owned();
    // The film's exact sums take 484 bytes a pixel with all layers that are on by default: here it is about the cloth.
    let layers = "output.layers=[\"depth\", \"variance\"]";
    let size = ["--width", "768", "--height", "576", "--spp", "1", "--set", layers];
    let picture = render_file(&scene, &[&["--curves", curves.as_str()][..], &size].concat());
    sound(&picture, "sweater");
    let number = |a: &str, b: &str| picture.stats[a][b].as_f64().unwrap();
    let made = number("memory", "geometry_bytes") + number("memory", "bvh_bytes");
    let per_point = made / number("curves", "control_points");
    let per_given = made / number("curves", "given_points");
    let peak = number("memory", "peak_rss_bytes") / 1e6;
    eprintln!(
        "sweater: peak {peak:.0} MB, {per_point:.1} bytes a control point, {per_given:.1} a given point, {:.2} s",
        number("seconds", "total")
    );
    assert!(peak < 150.0, "{peak} MB");
    assert!(per_point < 120.0, "{per_point} bytes a control point");
}

#[test]
fn cloth_of_three_lines_has_light_unless_none_is_wanted() {
    let scene = "[[fabric]]\nyarn = \"wool\"\nsource = { type = \"stockinette\", stitches = 4, rows = 4 }\n";
    let small = ["--width", "24", "--height", "18", "--spp", "4"];
    let lit = mean(&render(scene, &small).colors());
    assert!(lit.iter().all(|v| (0.1..1.0).contains(v)), "{lit:?}");
    let dark = render(&format!("light = []\n{scene}"), &small).colors();
    assert!(dark.iter().flatten().all(|v| *v == 0.0));
}
