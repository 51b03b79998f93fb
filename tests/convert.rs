//! Curve files from one format to another, and stages in scenes, by the program itself.

use std::fs;

use crate::support::{directory, project, read_json, write, yarnray};

#[test]
fn cloth_goes_round_through_every_format() {
    let folder = directory();
    let at = folder.path();
    yarnray(at, &["make", "knit", "--stitches", "4", "--rows", "4", "-o", "a.txt", "-o", "a.usdc", "-q"]).good();
    for (from, to) in [("a.usdc", "b.usda"), ("b.usda", "c.hair"), ("c.hair", "d.usd"), ("d.usd", "e.txt")] {
        yarnray(at, &["convert", from, to]).good();
    }
    let numbers = |name: &str| -> Vec<f64> {
        let text = fs::read_to_string(at.join(name)).unwrap();
        text.split_whitespace().filter_map(|word| word.parse().ok()).collect()
    };
    let (first, last) = (numbers("a.txt"), numbers("e.txt"));
    assert_eq!(first.len(), last.len());
    assert!(first.iter().zip(&last).all(|(a, b)| (a - b).abs() < 1e-4), "points and radii are those of the first file");
}

#[test]
fn what_is_lost_is_said_and_nothing_is_half_written() {
    let folder = directory();
    let at = folder.path();
    let matrix = project("tests/data/stages/matrix.usda");
    let matrix = matrix.to_str().unwrap();
    let lost = yarnray(at, &["convert", matrix, "a.bcc", "--prim", "/bspline_pinned_vertex"]).good().stderr;
    assert!(lost.contains("radii are lost") && lost.contains("unit is lost"), "{lost}");
    for (arguments, expected) in [
        (vec!["convert", matrix, "b.bcc", "--prim", "/nothing"], "curves here: /linear_nonperiodic"),
        (vec!["convert", matrix, "b.bcc", "--prim", "nothing"], "begins with /"),
        (vec!["convert", matrix, "b.xyz"], "expected a name that ends in"),
        (vec!["convert", matrix, "b.bcc", "--unit", "cm"], "leave --unit out"),
        (vec!["convert", "missing.usda", "b.bcc"], "no such file"),
    ] {
        let refused = yarnray(at, &arguments);
        assert_eq!(refused.status, Some(2), "{arguments:?}");
        assert!(refused.stderr.contains(expected), "{arguments:?}: {}", refused.stderr);
        assert!(!at.join("b.bcc").exists());
    }
}

#[test]
fn scenes_take_curves_meshes_and_cameras_of_stages() {
    let folder = directory();
    let stages = project("tests/data/stages");
    let stages = stages.to_str().unwrap();
    let scene = format!(
        "camera = {{ type = \"usd\", path = \"{stages}/scene.usda\", prim = \"/rig/camera\" }}\n\
         [render]\nwidth = 8\nheight = 8\nspp = 1\n\
         [fiber.wool]\nr = [0.1, 0.1, 0.1]\ntt = [0.3, 0.3, 0.3]\nd = [0.3, 0.3, 0.3]\nbeta_r = 8\nbeta_tt = 8\nbeta_n = 20\n\
         [yarn.one]\nradius = 0.3\nplies = 2\nfiber = \"wool\"\nfibers = 30\ndensity = 0.3\n\
         [[fabric]]\nyarn = \"one\"\nsource = {{ type = \"file\", path = \"{stages}/scene.usda\", prim = \"/moving\" }}\n\
         [[fabric]]\nyarn = \"one\"\nsource = {{ type = \"file\", path = \"{stages}/scene.abc\", prim = \"/place\", unit = \"mm\" }}\n\
         [[mesh]]\npath = \"{stages}/mesh.usda\"\nprim = \"/panels\"\n\
         [[mesh]]\npath = \"{stages}/scene.abc\"\nunit = \"mm\"\n\
         [[light]]\ntype = \"environment\"\nradiance = 1\n"
    );
    write(folder.path(), "s.toml", scene);
    yarnray(folder.path(), &["render", "s.toml", "-o", "s.exr", "-q", "--stats", "s.json"]).good();
    let stats = read_json(&folder.path().join("s.json"));
    assert_eq!(stats["curves"]["yarns"], 9);
}

#[test]
fn shells_and_manuals_know_every_command() {
    let folder = directory();
    for shell in ["bash", "zsh", "fish"] {
        let text = yarnray(folder.path(), &["completions", shell]).good().stdout;
        assert!(text.contains("converge") && text.contains("--spp"), "{shell}");
    }
    yarnray(folder.path(), &["man", "man1"]).good();
    let page = fs::read_to_string(folder.path().join("man1/yarnray-render.1")).unwrap();
    assert!(page.starts_with(".ie") && page.contains("spp"), "{page:.200}");
}
