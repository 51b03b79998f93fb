//! What the command line promises.

use std::{
    collections::BTreeSet,
    io::{BufRead as _, BufReader},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use serde_json::Value;
use yarnray::image::{self, Attribute};

use crate::support::{
    SWATCH, bcc, directory, listing, program, project, read_json, render, weave_text, write, yarnray,
};

#[test]
fn help_carries_examples() {
    let directory = directory();
    let top = yarnray(directory.path(), &["--help"]).good();
    assert!(top.stdout.contains("Examples:\n  yarnray "), "{}", top.stdout);
    let commands: Vec<String> = top
        .stdout
        .lines()
        .skip_while(|l| !l.starts_with("Commands:"))
        .skip(1)
        .map_while(|l| l.strip_prefix("  ")?.split_whitespace().next().map(str::to_owned))
        .filter(|c| c != "help")
        .collect();
    assert!(commands.iter().any(|c| c == "render") && commands.iter().any(|c| c == "info"), "{commands:?}");
    for command in commands {
        for args in [[command.as_str(), "--help"], ["help", command.as_str()]] {
            let help = yarnray(directory.path(), &args).good().stdout;
            assert!(help.contains(&format!("Examples:\n  yarnray {command} ")), "{args:?}: {help}");
        }
    }
    let bare = yarnray::<&str>(directory.path(), &[]);
    assert_eq!(bare.status, Some(2));
    assert!(bare.stderr.contains("Usage:"));
    assert!(yarnray(directory.path(), &["--version"]).good().stdout.starts_with("yarnray 0."));
    assert_eq!(listing(directory.path()), [""; 0]);
}

#[test]
fn info_tells_of_scenes() {
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    let text = yarnray(directory.path(), &["info", "s.toml"]).good().stdout;
    for part in ["s.toml\n", "48 x 36, 8 spp, mode yarn, model aggregated", "1 yarn of `wool3` (3 plies of 60 fibres)"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    let json = yarnray(directory.path(), &["info", "s.toml", "--json", "--spp", "3"]).good().stdout;
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["image"]["spp"], 3);
    assert_eq!(json["fabrics"][0]["yarn"], "wool3");
    assert!(json["memory"]["bvh_bytes"].as_u64().unwrap() > 1000);
    assert_eq!(json["fingerprint"].as_str().unwrap().len(), 32);
    for list in ["used", "left_out"] {
        assert!(json[list].as_array().unwrap().iter().all(|f| f["name"].is_string() && f["reason"] != ""), "{json}");
    }
    assert_eq!(listing(directory.path()), ["s.toml"]);
}

/// The strands of a tuft are crowded as its fibres are: that is no overlap.
#[test]
fn info_tells_of_the_ground_of_pile_how_far_it_overlaps() {
    let info = yarnray(&project("scenes/weaves"), &["info", "velvet.toml", "--json"]).good().stdout;
    let json: Value = serde_json::from_str(&info).unwrap();
    assert!(json["overlap"]["share"].as_f64().unwrap() < 0.02, "{}", json["overlap"]);
    let text = yarnray(&project("scenes/weaves"), &["info", "velvet.toml"]).good().stdout;
    assert!(text.contains("strands of tufts not counted"), "{text}");
}

#[test]
fn info_tells_of_curve_files() {
    let directory = directory();
    let line = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    let square = vec![[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]];
    write(directory.path(), "a.bcc", bcc(&[(false, line), (true, square)]));
    write(directory.path(), "w.txt", weave_text(2));
    write(directory.path(), "r.txt", "0 0 0 0.5\n1 0 0 0.25\n");
    let info = |name: &str| -> Value {
        serde_json::from_str(&yarnray(directory.path(), &["info", name, "--json"]).good().stdout).unwrap()
    };
    let a = info("a.bcc");
    assert_eq!([&a["curves"], &a["closed"], &a["open"], &a["points"]].map(|v| v.as_u64().unwrap()), [2, 1, 1, 7]);
    assert_eq!(a["bounds"], serde_json::json!([[0.0, 0.0, 0.0], [2.0, 1.0, 1.0]]));
    assert_eq!([&a["basis"], &a["up"]], ["catmull-rom", "y"]);
    // A straight line of 2, and a round way through the corners of a square.
    assert!((a["length"].as_f64().unwrap() - 6.2038).abs() < 1e-3);
    assert_eq!(a["radii"], false);
    assert_eq!(info("w.txt")["curves"], 4);
    assert_eq!(info("r.txt")["radii"], true);
    let text = yarnray(directory.path(), &["info", "a.bcc"]).good().stdout;
    assert!(text.contains("curves    2 (1 closed, 1 open), catmull-rom"), "{text}");
}

#[test]
fn statistics_have_every_key_of_the_interface() {
    let stats = render(SWATCH, &["--seed", "7", "--threads", "2"]).stats;
    let number = |path: &str| -> f64 {
        stats.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("no number {path} in {stats:#}"))
    };
    assert_eq!([&stats["mode"], &stats["model"]], ["yarn", "aggregated"]);
    assert!(stats["yarnray"].as_str().unwrap().starts_with("0."));
    assert!(stats["scene"].as_str().unwrap().ends_with("scene.toml"));
    for (path, value) in [
        ("/seed", 7.0),
        ("/threads", 2.0),
        ("/image/width", 48.0),
        ("/image/height", 36.0),
        ("/image/spp_min", 8.0),
        ("/image/spp_mean", 8.0),
        ("/image/spp_max", 8.0),
        ("/rays/camera", 48.0 * 36.0 * 8.0),
        ("/curves/fibers", 0.0),
    ] {
        assert_eq!(number(path), value, "{path}");
    }
    for path in [
        "/seconds/load",
        "/seconds/generate",
        "/seconds/build",
        "/seconds/render",
        "/seconds/write",
        "/rays/bounce",
        "/rays/shadow",
        "/memory/geometry_bytes",
        "/memory/bvh_bytes",
        "/curves/yarns",
        "/curves/control_points",
        "/curves/segments",
        "/noise/rel_mse_estimate",
    ] {
        assert!(number(path) > 0.0, "{path}");
    }
    let parts: f64 =
        ["load", "generate", "build", "render", "write"].map(|p| number(&format!("/seconds/{p}"))).iter().sum();
    assert!(number("/seconds/total") >= 0.99 * parts, "{stats:#}");
    assert!(number("/mean_bounces") >= 1.0);
    assert!(number("/memory/scene_bytes") >= number("/memory/geometry_bytes") + number("/memory/bvh_bytes"));
    assert!(number("/memory/peak_rss_bytes") > number("/memory/scene_bytes"));
    let names =
        |key: &str| -> BTreeSet<&str> { stats[key].as_array().unwrap().iter().map(|n| n.as_str().unwrap()).collect() };
    let (used, left_out) = (names("used"), names("left_out"));
    assert!(used.is_disjoint(&left_out), "{used:?} {left_out:?}");
    assert!(used.is_superset(&["ply_filter", "environment", "distant_light"].into()), "{used:?}");
    assert!(left_out.is_superset(&["textures", "ground", "openimageio"].into()), "{left_out:?}");
}

#[test]
fn statistics_say_what_info_says() {
    // A render takes the curves out of its scene: what it says of them afterwards must be what was there.
    let scene =
        SWATCH.replace("type = \"stockinette\", stitches = 4, rows = 6", "type = \"weave\", warps = 4, wefts = 4");
    let directory = directory();
    write(directory.path(), "s.toml", scene);
    let args = ["render", "s.toml", "-q", "--spp", "1", "-o", "s.exr", "--stats", "s.json"];
    yarnray(directory.path(), &args).good();
    let stats = read_json(&directory.path().join("s.json"));
    let info = yarnray(directory.path(), &["info", "s.toml", "--json"]).good().stdout;
    let info: Value = serde_json::from_str(&info).unwrap();
    for key in ["used", "left_out"] {
        let named: Vec<&Value> = info[key].as_array().unwrap().iter().map(|f| &f["name"]).collect();
        assert_eq!(stats[key].as_array().unwrap().iter().collect::<Vec<_>>(), named, "{key}");
    }
    assert!(stats["used"].as_array().unwrap().iter().any(|n| n == "flattening"));
    assert!(stats["curves"]["given_points"].as_u64() > Some(0));
    assert_eq!(stats["curves"]["given_points"], info["fabrics"][0]["given_points"]);
}

#[test]
fn what_is_not_asked_for_is_left_out() {
    let directory = directory();
    let scene = SWATCH.replace("plies = 3", "plies = 1").replace("ply_twist = 18", "");
    write(directory.path(), "s.toml", scene);
    yarnray(directory.path(), &["render", "s.toml", "-q", "--spp", "1", "-o", "s.png", "--stats", "s.json"]).good();
    let stats = read_json(&directory.path().join("s.json"));
    for name in ["ply_filter", "ply_twist", "lobe_layers", "depth_layer", "normal_layer"] {
        assert!(stats["left_out"].as_array().unwrap().iter().any(|n| n == name), "{name}: {stats:#}");
    }
}

#[test]
fn outputs_go_where_they_are_asked_to() {
    let directory = directory();
    write(directory.path(), "swatch.toml", SWATCH);
    let run = yarnray(directory.path(), &["render", "swatch.toml", "--spp", "1"]).good();
    assert_eq!(listing(&directory.path().join("out")), ["swatch.exr"]);
    assert!(run.stderr.contains("wrote out/swatch.exr"), "{}", run.stderr);
    assert_eq!(run.stdout, "");
    let args = ["render", "swatch.toml", "-q", "--spp", "1", "-o", "a/b/x.exr", "-o", "x.png", "--out", "y.PNG"];
    yarnray(directory.path(), &args).good();
    assert_eq!(listing(&directory.path().join("a/b")), ["x.exr"]);
    assert_eq!(listing(directory.path()), ["a", "out", "swatch.toml", "x.png", "y.PNG"]);
    let png = image::read(&directory.path().join("x.png")).unwrap();
    let exr = image::read(&directory.path().join("a/b/x.exr")).unwrap();
    assert_eq!([png.width, png.height], [exr.width, exr.height]);
    // The screen's picture is the EXR's, rounded to eight bits.
    let [a, b] = [png.rgb().unwrap()[1], exr.rgb().unwrap()[1]];
    for (a, b) in a.iter().zip(b) {
        assert!((a - b.clamp(0.0, 1.0)).abs() < 0.006, "{a} {b}");
    }
}

#[test]
fn exr_files_tell_their_story() {
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    yarnray(directory.path(), &["render", "s.toml", "-q", "--seed", "5", "--spp", "3", "-o", "s.exr"]).good();
    let picture = image::read(&directory.path().join("s.exr")).unwrap();
    let text = |name: &str| match picture.attribute(name) {
        Some(Attribute::Text(text)) => text.clone(),
        other => panic!("{name}: {other:?} of {:?}", picture.attributes),
    };
    let info = yarnray(directory.path(), &["info", "s.toml", "--json", "--seed", "5"]).good().stdout;
    let info: Value = serde_json::from_str(&info).unwrap();
    assert_eq!(text("yarnray.fingerprint"), info["fingerprint"]);
    assert_eq!(text("yarnray.seed"), "5");
    assert_eq!(text("yarnray.model"), "aggregated");
    assert_eq!(text("yarnray.mode"), "yarn");
    assert!(text("yarnray.command").ends_with("render s.toml -q --seed 5 --spp 3 -o s.exr"));
    assert!(text("software").starts_with("yarnray 0."));
    assert_eq!(picture.attribute("yarnray.spp"), Some(&Attribute::Double(3.0)));
    assert!(matches!(picture.attribute("yarnray.seconds"), Some(Attribute::Double(s)) if *s > 0.0));
}

#[test]
fn fingerprints_change_with_the_picture_only() {
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    let of = |args: &[&str]| -> String {
        let all = [&["info", "s.toml", "--json"], args].concat();
        let json: Value = serde_json::from_str(&yarnray(directory.path(), &all).good().stdout).unwrap();
        json["fingerprint"].as_str().unwrap().to_owned()
    };
    let first = of(&[]);
    for same in [&["--spp", "99"][..], &["--threads", "1"], &["--time", "5"], &["--noise", "0.1"]] {
        assert_eq!(of(same), first, "{same:?}");
    }
    for other in [
        &["--seed", "1"][..],
        &["--model", "two-stream"],
        &["--max-bounces", "3"],
        &["--set", "fiber.wool.beta_n=24"],
        &["--set", "yarn.wool3.radius=1.1"],
        &["--set", "light.0.radiance=0.3"],
        &["--set", "camera.fov=26"],
        &["--set", "render.ply_intersection=perpendicular"],
        &["--set", "render.force=[\"distant_light\"]"],
        &["--set", "render.force=[\"all_lobes\"]"],
        &["--set", "render.bvh=fast"],
        &["--set", "fabric.0.source.rows=7"],
    ] {
        assert_ne!(of(other), first, "{other:?}");
    }
}

#[test]
fn where_nothing_is_there_is_no_alpha() {
    let scene = SWATCH.replace("fov = 25", "fov = 25\nmargin = 0.25") + "\n";
    let picture = render(&scene, &["--set", "render.filter=box"]);
    let (alpha, depth, red) = (picture.channel("A"), picture.channel("depth.Z"), picture.channel("R"));
    for x in 0..48 {
        for row in [0, 35] {
            let i = row * 48 + x;
            assert_eq!([alpha[i], depth[i]], [0.0, 0.0]);
            assert!((red[i] - 0.35).abs() < 1e-6, "the sky shows: {}", red[i]);
        }
    }
    assert!(alpha.iter().any(|&a| a > 0.95));
    assert!(alpha.iter().all(|&a| (0.0..=1.0).contains(&a)));
}

#[test]
fn time_stops_a_render() {
    let started = Instant::now();
    let stats = render(SWATCH, &["--spp", "1000000", "--time", "1"]).stats;
    let elapsed = started.elapsed().as_secs_f64();
    assert_eq!(stats["stopped_by"], "time");
    let seconds = stats["seconds"]["render"].as_f64().unwrap();
    eprintln!("--time 1: rendered {seconds:.2} s, {elapsed:.2} s in all");
    assert!((0.9..3.0).contains(&seconds), "{seconds}");
    let (least, most) = (stats["image"]["spp_min"].as_u64().unwrap(), stats["image"]["spp_max"].as_u64().unwrap());
    assert!(least >= 1 && most < 1_000_000, "{least} {most}");
    // No picture is no success.
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    let run = yarnray(directory.path(), &["render", "s.toml", "--time", "1e-9", "-o", "x.png"]);
    assert!(run.status == Some(2) && run.stderr.contains("no sample was taken in the time"), "{}", run.stderr);
}

/// A name that is no text is no reason to lose a render.
#[test]
fn names_need_not_be_text() {
    use std::os::unix::ffi::OsStrExt as _;
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    let out = std::ffi::OsStr::from_bytes(b"o\xff.exr");
    let status = program(directory.path()).args(["render", "s.toml", "-q", "--spp", "1", "-o"]).arg(out).status();
    assert!(status.unwrap().success() && directory.path().join(out).exists());
    let status = program(directory.path()).args(["compare"]).args([out, out]).stdout(Stdio::null()).status();
    assert!(status.unwrap().success());
}

/// What cloth covers does not depend on whether light is followed.
#[test]
fn without_bounces_there_is_still_alpha() {
    let scene = SWATCH.replace("fov = 25", "fov = 25\nmargin = 0.25");
    let of = |bounces: &str| render(&scene, &["--spp", "4", "--max-bounces", bounces]);
    let (dark, lit) = (of("0"), of("1"));
    for channel in ["A", "depth.Z"] {
        assert_eq!(dark.channel(channel), lit.channel(channel), "{channel}");
    }
}

#[test]
fn noise_stops_a_render() {
    let stats = render(SWATCH, &["--spp", "100000", "--noise", "0.02"]).stats;
    assert_eq!(stats["stopped_by"], "noise");
    assert!(stats["noise"]["rel_mse_estimate"].as_f64().unwrap() <= 0.02);
}

/// Starts a render without end, sends a signal once it is under way, and gives what became of it.
fn interrupted(signal: &str, code: i32) {
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    let mut child = program(directory.path())
        .args(["render", "s.toml", "-v", "--spp", "100000000", "-o", "s.exr", "-o", "s.png", "--stats", "s.json"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    let started = lines.by_ref().any(|line| line.contains(" of 100000000 spp"));
    assert!(started, "the render ended by itself");
    assert_eq!(listing(directory.path()), ["s.toml"], "nothing is there before the picture is");
    let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    // Whatever else it says, so that it is not held up.
    lines.for_each(drop);
    let until = Instant::now() + Duration::from_secs(20);
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if Instant::now() > until {
            child.kill().unwrap();
            panic!("{signal}: still running");
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    assert_eq!(status.code(), Some(code), "{signal}");
    assert_eq!(listing(directory.path()), ["s.exr", "s.json", "s.png", "s.toml"]);
    let picture = image::read(&directory.path().join("s.exr")).unwrap();
    assert!(picture.channel("samples.count").unwrap().iter().all(|&n| n >= 1.0));
    let mean = picture.rgb().unwrap()[0].iter().sum::<f32>();
    assert!(mean > 0.0);
    assert_eq!(picture.attribute("yarnray.stopped_by"), Some(&Attribute::Text("interrupted".to_owned())));
    assert_eq!(read_json(&directory.path().join("s.json"))["stopped_by"], "interrupted");
}

#[test]
fn an_interrupted_render_saves_what_it_has() {
    interrupted("-INT", 130);
    interrupted("-TERM", 143);
}

#[test]
fn curves_of_a_file_take_the_place_of_the_first_fabric() {
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    write(directory.path(), "w.txt", weave_text(3));
    let args = ["info", "s.toml", "--json", "--curves", "w.txt"];
    let json: Value = serde_json::from_str(&yarnray(directory.path(), &args).good().stdout).unwrap();
    assert_eq!(json["fabrics"][0]["yarns"], 6);
    assert_eq!(json["fabrics"][0]["source"], "w.txt");
}

#[test]
fn models_answer_differently() {
    let mut means = Vec::new();
    let mut pictures = Vec::new();
    for model in ["aggregated", "two-stream", "paper", "printed"] {
        let picture = render(SWATCH, &["--model", model]);
        assert_eq!(picture.stats["model"], model);
        assert_eq!(picture.stats["invalid_samples"], 0, "{model}");
        means.push(picture.mean()[1]);
        let colors = picture.colors();
        for (other, before) in &pictures {
            assert_ne!(&colors, before, "{model} and {other}");
        }
        pictures.push((model, colors));
    }
    eprintln!("mean green of the models: {means:.4?}");
    assert!(means.iter().all(|m| *m > 0.05 && *m < 2.0), "{means:?}");
}

#[test]
fn an_empty_scene_is_a_black_picture_and_a_warning() {
    let directory = directory();
    write(directory.path(), "empty.toml", "");
    let arguments = ["render", "empty.toml", "--width", "8", "--height", "8", "--spp", "1", "-o", "o.exr"];
    let run = yarnray(directory.path(), &arguments).good();
    let nothing = "warning: there is nothing to see: the scene has no [[fabric]] and no [[mesh]]\n";
    assert!(run.stderr.contains(nothing) && !run.stderr.contains("light"), "{}", run.stderr);
    let library = project("scenes/yarns.toml").display().to_string();
    let told = yarnray(directory.path(), &["info", &library]).good().stdout;
    let what = "no [[mesh]]; it is a library of ";
    assert!(told.contains(what) && told.contains("`library = [\"yarns.toml\"]`") && !told.contains("black"), "{told}");
    let picture = image::read(&directory.path().join("o.exr")).expect("it was written");
    let [r, _, _] = picture.rgb().expect("it has colours");
    assert!(r.iter().all(|v| *v == 0.0));
}

#[test]
fn a_model_of_yarns_says_nothing_of_single_fibres() {
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    let warned = |more: &[&str]| {
        let told = yarnray(directory.path(), &[&["info", "s.toml"], more].concat()).good().stdout;
        told.contains("the model `printed` is of yarns and plies, and mode fiber shows neither")
    };
    assert!(warned(&["--mode", "fiber", "--model", "printed"]));
    assert!(!warned(&["--mode", "fiber"]) && !warned(&["--model", "printed"]));
}

#[test]
fn numbers_below_zero_are_answered_by_the_option() {
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    for (args, message) in [
        ("--spp -1", "invalid value '-1' for '--spp <N>'"),
        ("--crop -1,0,4,4", "invalid value '-1,0,4,4' for '--crop <X0,Y0,X1,Y1>': expected four whole numbers"),
        ("--crop 5,5,2,2", "--crop 5,5,2,2: error"),
        ("--shard -1/2", "invalid value '-1/2' for '--shard <I/N>'"),
        ("--frames -5..5", "invalid value '-5..5' for '--frames <A..B>': expected one frame or the first and the last"),
        ("--time -1", "`time` must be above 0, found -1"),
        ("--exposure nan", "expected a number of stops from -100 to 100"),
        ("--exposure inf", "expected a number of stops from -100 to 100"),
    ] {
        let all: Vec<&str> = ["render", "s.toml", "-o", "x.png"].into_iter().chain(args.split(' ')).collect();
        let run = yarnray(directory.path(), &all);
        assert_eq!(run.status, Some(2), "{args}");
        assert!(run.stderr.contains(message), "{args}: {}", run.stderr);
    }
    yarnray(directory.path(), &["render", "s.toml", "-q", "--spp", "1", "--exposure", "-1.5", "-o", "x.png"]).good();
}

#[test]
fn a_curve_file_is_no_scene() {
    let directory = directory();
    write(directory.path(), "g.bcc", bcc(&[(false, vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])]));
    write(directory.path(), "t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write(directory.path(), "s.toml", SWATCH);
    for command in ["render", "converge"] {
        let run = yarnray(directory.path(), &[command, "g.bcc"]);
        assert_eq!(run.status, Some(2));
        assert!(run.stderr.contains("g.bcc: error: a file of curves or meshes is no scene\n"), "{}", run.stderr);
        assert!(run.stderr.contains("--curves g.bcc"), "{}", run.stderr);
    }
    write(directory.path(), "g.usda", "#usda 1.0\n");
    let run = yarnray(directory.path(), &["render", "g.usda"]);
    assert!(
        run.status == Some(2) && run.stderr.contains("g.usda: error: a file of curves or meshes"),
        "{}",
        run.stderr
    );
    // Options of scenes are for scenes.
    for args in [["g.bcc", "--spp", "7"], ["g.bcc", "--set", "a=1"], ["s.toml", "--radius", "2"]] {
        let run = yarnray(directory.path(), &[&["info"], &args[..]].concat());
        assert!(
            run.status == Some(2) && run.stderr.contains(&format!("{}: only", args[1])),
            "{args:?}: {}",
            run.stderr
        );
    }
    let run = yarnray(directory.path(), &["render", "s.toml", "--curves", "t.obj", "-o", "x.png"]);
    assert_eq!(run.status, Some(2));
    assert!(run.stderr.contains("it holds no curve that can be drawn"), "{}", run.stderr);
    assert!(run.stderr.contains("triangles go into a [[mesh]]"), "{}", run.stderr);
}

#[test]
fn a_picture_whose_light_overflows_fails() {
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    let light = "light=[{type=\"environment\", radiance=3e38}]";
    let run = yarnray(directory.path(), &["render", "s.toml", "--spp", "4", "--set", light, "-o", "x.png"]);
    assert_eq!(run.status, Some(2), "{}", run.stderr);
    assert!(
        run.stderr.contains("samples are not finite") && run.stderr.contains("lights too bright"),
        "{}",
        run.stderr
    );
}
