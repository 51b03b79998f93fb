//! Every scene of the project, and real curve files.

use std::path::Path;

use crate::support::{Picture, directory, mean, project, render, render_file, shared, write, yarnray};

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

#[test]
fn every_scene_of_the_project_renders() {
    let of_folder = |folder| std::fs::read_dir(project(folder)).unwrap().map(|e| e.unwrap().path());
    let folders = ["scenes", "scenes/patterns", "scenes/table3", "scenes/variants"];
    let mut names: Vec<_> = folders.into_iter().flat_map(of_folder).collect();
    names.sort();
    let glove = shared("data/curves/glove.bcc");
    let mut rendered = 0;
    for path in names {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if !name.ends_with(".toml") {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        let folder = path.parent().unwrap();
        if text.contains("[[row]]") {
            // A suite: it has to be sound, down to the name of a row.
            let run = yarnray(folder, &["bench", &name, "--row", "no such row"]);
            assert_eq!(run.stderr, format!("error: no row of {name} contains no such row\n"));
            continue;
        }
        if !text.contains("[[fabric]]") {
            // A library: it has to be sound by itself.
            yarnray(folder, &["info", &name]).good();
            continue;
        }
        let mut args = vec!["--width", "32", "--height", "24", "--spp", "2"];
        let needs_curves = text.contains("--curves") && !text.contains("path =");
        let curves = glove.as_ref().map(|g| g.to_string_lossy().into_owned());
        if needs_curves {
            let Some(curves) = &curves else { continue };
            args.extend(["--curves", curves]);
        }
        let info = [&["info", name.as_str()][..], if needs_curves { &args[6..] } else { &[] }].concat();
        yarnray(folder, &info).good();
        sound(&render_file(&path, &args), &name);
        rendered += 1;
    }
    assert!(rendered >= 2);
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
