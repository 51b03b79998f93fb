//! The same cloth as yarns, as plies and as fibres.

use crate::support::{Picture, directory, read_json, render, weave_text, write, yarnray};

/// A weave of white-ish three-ply yarn, and what is added to its yarn.
fn weave(fibers: u32, extra: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let directory = directory();
    write(directory.path(), "weave.txt", weave_text(6));
    let scene = format!(
        r#"
        [render]
        width = 48
        height = 36
        [camera]
        direction = [0.3, 0.2, 1]
        margin = -0.3
        [fiber.silk]
        r = 0.2
        tt = [0.1, 0.4, 0.25]
        d = [0.03, 0.35, 0.1]
        beta_r = 8.6
        beta_tt = 6.9
        beta_n = 20
        [yarn.y]
        radius = 1
        plies = 3
        ply_twist = 13
        fiber = "silk"
        fibers = {fibers}
        density = 0.4
        fiber_twist = -19
        {extra}
        [[fabric]]
        yarn = "y"
        source = {{ type = "file", path = "weave.txt" }}
        [[light]]
        type = "environment"
        radiance = 1
        "#
    );
    let path = write(directory.path(), "weave.toml", scene);
    (directory, path)
}

fn picture(path: &std::path::Path, args: &[&str]) -> Picture {
    crate::support::render_file(path, args)
}

#[test]
fn yarns_plies_and_fibers_are_the_same_cloth() {
    let (_directory, path) = weave(40, "");
    let [yarn, ply, fiber] =
        [("yarn", "64"), ("ply", "64"), ("fiber", "32")].map(|(m, spp)| picture(&path, &["--mode", m, "--spp", spp]));
    let number = |p: &Picture, key: &str| p.stats[key].as_f64().unwrap();
    for (name, other, allowed) in [("yarn", &yarn, 0.05), ("ply", &ply, 0.05)] {
        for (a, b) in other.mean().into_iter().zip(fiber.mean()) {
            assert!((a / b - 1.0).abs() < allowed, "{name}: {a} and {b}");
        }
    }
    let curves = |p: &Picture, key: &str| p.stats["curves"][key].as_u64().unwrap();
    assert_eq!((curves(&yarn, "yarns"), curves(&yarn, "fibers")), (12, 0));
    assert_eq!((curves(&ply, "yarns"), curves(&ply, "fibers")), (36, 0));
    assert_eq!((curves(&fiber, "yarns"), curves(&fiber, "fibers")), (0, 12 * 3 * 40));
    assert!(number(&fiber, "mean_bounces") > 3.0 * number(&yarn, "mean_bounces"), "{}", fiber.stats);
}

/// Light that is scattered many times in a yarn that is pressed flat leaves through its broad sides.
#[test]
fn pressed_yarns_are_as_bright_as_their_fibers() {
    let (_directory, path) = weave(40, "");
    let cloth = [
        r#"fabric=[{yarn="y", source={type="weave", edges="live", warps=5, wefts=5, flatten=1.5}}]"#,
        "fiber.silk.r=0",
        "fiber.silk.tt=0",
        "fiber.silk.d=[0.3,0.6,0.9]",
    ]
    .map(|set| ["--set", set]);
    let picture = |mode: &str, spp: &str| {
        let mut args = cloth.concat();
        args.extend(["--mode", mode, "--spp", spp]);
        picture(&path, &args).mean()
    };
    for (yarn, fiber) in picture("yarn", "64").into_iter().zip(picture("fiber", "32")) {
        assert!((yarn / fiber - 1.0).abs() < 0.06, "{yarn} and {fiber}");
    }
}

#[test]
fn memory_is_told_before_it_is_taken() {
    let (directory, path) = weave(150, "");
    let scene = path.to_str().unwrap();
    // Small scenes are all fixed costs; yarns are too few here for their BVH to be told to 15 %.
    for (mode, bvh) in [("yarn", "compact"), ("ply", "compact"), ("fiber", "compact"), ("fiber", "fast")] {
        let set = format!("render.bvh={bvh:?}");
        let told = yarnray(directory.path(), &["info", scene, "--json", "--mode", mode, "--set", &set]).good();
        let told: serde_json::Value = serde_json::from_str(&told.stdout).unwrap();
        let made = picture(&path, &["--mode", mode, "--set", &set, "--spp", "1"]).stats;
        let bytes = |v: &serde_json::Value, key: &str| v["memory"][key].as_f64().unwrap();
        let geometry = bytes(&told, "geometry_bytes") / bytes(&made, "geometry_bytes");
        assert!((geometry - 1.0).abs() < 0.15, "{mode} {bvh}: geometry {geometry}");
        if mode == "fiber" {
            let tree = bytes(&told, "bvh_bytes") / bytes(&made, "bvh_bytes");
            assert!((tree - 1.0).abs() < 0.15, "{mode} {bvh}: BVH {tree}");
        }
    }
    let run = yarnray(
        directory.path(),
        &["render", scene, "--mode", "fiber", "--max-memory", "0.01", "--spp", "1", "-o", "big.exr"],
    );
    assert_eq!(run.status, Some(2), "{}", run.stderr);
    assert!(run.stderr.contains("may take 10.0 MB") && run.stderr.contains("--max-memory"), "{}", run.stderr);
    assert!(!directory.path().join("big.exr").exists());
}

#[test]
fn more_fibers_cost_the_aggregated_model_nothing() {
    let stats = |fibers, mode: &str| {
        let (directory, path) = weave(fibers, "");
        let file = directory.path().join("stats.json");
        let args = ["render", path.to_str().unwrap(), "-q", "--mode", mode, "--spp", "1", "--set"];
        let stats_args = ["render.fiber_detail=false", "--stats", "stats.json", "-o", "x.exr"];
        yarnray(directory.path(), &[&args[..], &stats_args].concat()).good();
        read_json(&file)["memory"].clone()
    };
    let (few, many) = (stats(30, "yarn"), stats(60, "yarn"));
    assert_eq!(few["geometry_bytes"], many["geometry_bytes"]);
    assert_eq!(few["bvh_bytes"], many["bvh_bytes"]);
    let (few, many) = (stats(30, "fiber"), stats(60, "fiber"));
    // Thinner fibres are followed more closely, so twice as many take at least twice the memory.
    let ratio = many["bvh_bytes"].as_f64().unwrap() / few["bvh_bytes"].as_f64().unwrap();
    assert!((1.9..3.0).contains(&ratio), "{ratio}");
}

#[test]
fn fly_aways_are_curves_in_every_mode() {
    let flyaways = "flyaways = { hair_density = 0.5, hair_start = 0.4, hair_rise = [0.4, 0.1], hair_length = [0.8, 0.2], \
                    loop_density = 0.3, loop_height = [0.6, 0.05] }";
    let (_a, plain) = weave(20, "");
    let (_b, hairy) = weave(20, flyaways);
    for mode in ["yarn", "fiber"] {
        let args = ["--mode", mode, "--spp", "4"];
        let fibers = |p: &Picture| p.stats["curves"]["fibers"].as_u64().unwrap();
        let (plain, hairy) = (picture(&plain, &args), picture(&hairy, &args));
        assert!(fibers(&hairy) > fibers(&plain) + 300, "{mode}: {} and {}", fibers(&hairy), fibers(&plain));
        let covered = |p: &Picture| p.channel("A").iter().sum::<f32>();
        assert!(covered(&hairy) > covered(&plain), "hairs cover gaps");
    }
}

#[test]
fn white_fibers_under_a_white_sky_are_as_bright_as_the_sky() {
    let scene = r#"
        render = { width = 24, height = 24, spp = 96, mode = "fiber", max_bounces = 5000 }
        [camera]
        direction = [0.2, 0.1, 1]
        margin = -0.4
        [fiber.white]
        r = 0.2
        tt = 0.5
        d = 0.3
        beta_r = 8.6
        beta_tt = 6.9
        beta_n = 20
        [yarn.white]
        radius = 1
        plies = 2
        ply_twist = 15
        fiber = "white"
        fibers = 60
        density = 0.5
        fiber_twist = -20
        [[fabric]]
        yarn = "white"
        source = { type = "straight", count = 3, length = 8 }
        [[light]]
        type = "environment"
        radiance = 1
    "#;
    let picture = render(scene, &[]);
    for mean in picture.mean() {
        assert!((mean - 1.0).abs() < 0.003, "{mean}");
    }
    assert_eq!(picture.stats["invalid_samples"], 0);
}

#[test]
fn a_lobe_that_is_left_out_is_dark_in_every_mode() {
    let (_directory, path) = weave(30, "");
    for mode in ["yarn", "ply", "fiber"] {
        let args = ["--mode", mode, "--spp", "4", "--set", "output.layers=[\"lobes\"]"];
        let whole = picture(&path, &args);
        let without = picture(&path, &[&args[..], &["--set", "render.without=[\"D\"]"]].concat());
        assert!(without.mean()[1] < 0.9 * whole.mean()[1], "{mode}: D is much of this green");
        let lobe =
            |p: &Picture| p.channel("D_direct.G").iter().sum::<f32>() + p.channel("D_indirect.G").iter().sum::<f32>();
        assert!(lobe(&whole) > 0.0 && lobe(&without) == 0.0, "{mode}");
    }
}

#[test]
fn fibers_are_written_for_other_programs_and_come_back_as_the_same_cloth() {
    let (directory, path) = weave(12, "");
    let scene = path.to_str().unwrap();
    let args = ["make", "fibers", scene, "-o", "fibers.txt", "-o", "fibers.hair", "-o", "fibers.bcc", "--quiet"];
    yarnray(directory.path(), &args).good();
    let info = |file: &str| -> serde_json::Value {
        let run = yarnray(directory.path(), &["info", file, "--json"]).good();
        serde_json::from_str(&run.stdout).unwrap()
    };
    for file in ["fibers.txt", "fibers.hair", "fibers.bcc"] {
        assert_eq!(info(file)["curves"], 12 * 3 * 12, "{file}");
    }
    // The same camera and light on the fibres of the file: each pixel sees the same fibres.
    let text = std::fs::read_to_string(&path).unwrap();
    let source = "source = { type = \"file\", path = \"fibers.txt\", basis = \"b-spline\" }";
    let again = text
        .replace("yarn = \"y\"", "fiber = \"silk\"")
        .replace("source = { type = \"file\", path = \"weave.txt\" }", source)
        .replace(
            "direction = [0.3, 0.2, 1]\n        margin = -0.3",
            "type = \"perspective\"\n        position = [3, 2, 40]\n        fov = 20",
        );
    let first = text.replace(
        "direction = [0.3, 0.2, 1]\n        margin = -0.3",
        "type = \"perspective\"\n        position = [3, 2, 40]\n        fov = 20",
    );
    let first = picture(&write(directory.path(), "first.toml", first), &["--mode", "fiber", "--spp", "32"]);
    let again = picture(&write(directory.path(), "again.toml", again), &["--spp", "32"]);
    for (a, b) in first.mean().into_iter().zip(again.mean()) {
        assert!((a / b - 1.0).abs() < 0.01, "{a} and {b}");
    }
    let wrong = yarnray(directory.path(), &["make", "fibers", scene, "-o", "fibers.xyz"]);
    assert_eq!(wrong.status, Some(2));
    assert!(wrong.stderr.contains("fibers.xyz: expected a name that ends in"), "{}", wrong.stderr);
}
