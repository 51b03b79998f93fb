//! `yarnray scatter`: its promises to scripts.

use crate::support::{directory, listing, read_json, yarnray};

#[test]
fn scatter_prints_the_agreed_json() {
    let directory = directory();
    let run = yarnray(directory.path(), &["scatter", "silk1", "--theta", "30", "--samples", "4000", "--json"]).good();
    let report: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(report["yarn"], "silk1");
    assert_eq!(report["model"], "aggregated");
    assert_eq!(report["theta"], 30.0);
    assert!(report["offset"].is_null());
    let number = |v: &serde_json::Value| v.as_f64().unwrap();
    for channel in 0..3 {
        let of = |half: &str| number(&report[half][channel]);
        let lobes: f64 = ["R", "TT", "D", "F", "B"]
            .iter()
            .flat_map(|l| ["forward", "backward"].map(|half| number(&report["lobes"][l][half][channel])))
            .sum();
        assert!((of("forward") + of("backward") - lobes).abs() < 1e-9);
        assert!(of("forward") + of("backward") + number(&report["unscattered"]) < 1.01);
        assert!(number(&report["forward_se"][channel]) > 0.0);
    }
}

/// Green of what a yarn sends back and what it lets through, and all of both, of `scatter` with more options.
fn halves(more: &[&str]) -> [f64; 3] {
    let directory = directory();
    let args = ["scatter", "wool", "--samples", "20000", "--json"];
    let run = yarnray(directory.path(), &[&args, more].concat()).good();
    let report: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    let [back, forward] = ["backward", "forward"].map(|half| report[half][1].as_f64().unwrap());
    [back, forward, back + forward + report["unscattered"].as_f64().unwrap()]
}

#[test]
fn white_yarns_of_any_number_of_plies_give_back_all_light() {
    for plies in ["1", "2", "4", "7", "12", "64"] {
        let white = ["r=0.1", "tt=0.5", "d=0.4"].map(|of| ["--set", of]);
        let plies = format!("plies={plies}");
        let [.., all] = halves(&[white.as_flattened(), &["--set", &plies]].concat());
        assert!((all - 1.0).abs() < 0.01, "{plies}: {all}");
    }
}

#[test]
fn a_phase_may_have_any_number_of_turns() {
    let of = |phase: &str| halves(&["--phase", phase, "--offset", "0.3"]);
    let once = of("280");
    assert_ne!(once, of("100"));
    for phase in ["-80", "1000", "360000000280", "-360000000080"] {
        assert_eq!(of(phase), once, "{phase}");
    }
}

#[test]
fn tt_may_be_as_narrow_as_one_likes() {
    let of = |width: &str| halves(&["--set", "plies=1", "--set", &format!("beta_n={width}")]);
    let narrow = of("0.1");
    for width in ["0.02", "0.012", "0.001"] {
        let narrower = of(width);
        let alike = narrow.iter().zip(narrower).all(|(a, b)| (a - b).abs() < 0.004);
        assert!(alike, "{width} degrees: {narrower:?}, not {narrow:?}");
    }
}

#[test]
fn scatter_writes_every_format_and_sweeps_any_key() {
    let directory = directory();
    let outs = ["-o", "a.png", "-o", "a.svg", "-o", "a.csv", "-o", "a.json"];
    let args = ["scatter", "knitting", "--samples", "2000", "--offset", "0.2", "--phase", "10", "--light", "0,170"];
    yarnray(directory.path(), &[&args[..], &outs[..]].concat()).good();
    assert_eq!(listing(directory.path()), ["a.csv", "a.json", "a.png", "a.svg"]);
    let json = read_json(&directory.path().join("a.json"));
    assert_eq!(json["distribution"]["aggregated"]["value"].as_array().unwrap().len(), 36);
    assert!(json["value"]["lobes"]["F"][1].as_f64().unwrap() > 0.0);

    for (key, rows) in [("density=0.1..0.5:3", 3), ("theta=0..60:2", 2), ("fibers=10..40:4", 4), ("beta_n=10..60:2", 2)]
    {
        let run = yarnray(directory.path(), &["scatter", "knitting", "--samples", "500", "--sweep", key]).good();
        assert_eq!(run.stdout.lines().count(), rows + 1, "{key}: {}", run.stdout);
    }
}

#[test]
fn scatter_takes_any_yarn_of_a_scene() {
    let directory = directory();
    let d = directory.path();
    let source = "source = { type = \"straight\", count = 1, length = 2 }";
    let both = format!("[[fabric]]\nyarn = \"wool\"\n{source}\n[[fabric]]\nyarn = \"silk\"\n{source}\n");
    crate::support::write(d, "s.toml", format!("unit = \"cm\"\n{both}"));
    let args = ["scatter", "s.toml", "--samples", "2000", "--seed", "3"];
    let run = yarnray(d, &args);
    assert!(run.stderr.contains("silk, wool"), "{}", run.stderr);
    let own = |more: &[&str], library: &[&str]| {
        let of_scene = yarnray(d, &[&args[..], &["--yarn", "wool"], more].concat()).good().stdout;
        let of_library =
            yarnray(d, &[&["scatter", "wool", "--samples", "2000", "--seed", "3"], library].concat()).good().stdout;
        assert_eq!(of_scene, of_library);
    };
    own(&[], &[]);
    for more in [["--set", "beta_n=40"], ["--set", "fibers=10"], ["--sweep", "ply_twist=0..30:2"]] {
        own(&more, &more);
    }
}

#[test]
fn the_error_of_one_sample_is_not_known() {
    let directory = directory();
    let run = yarnray(directory.path(), &["scatter", "silk1", "--samples", "1"]).good();
    assert!(run.stdout.contains("+- n/a n/a n/a\n"), "{}", run.stdout);
    let run = yarnray(directory.path(), &["scatter", "silk1", "--samples", "1", "--json"]).good();
    let report: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    assert!(report["forward_se"][0].is_null() && report["unscattered_se"].is_null());
    let run = yarnray(directory.path(), &["scatter", "silk1", "--samples", "1", "--sweep", "theta=0..60:2"]).good();
    assert!(run.stdout.lines().nth(1).unwrap().ends_with(','), "{}", run.stdout);
}

#[test]
fn a_sweep_goes_by_round_steps() {
    let directory = directory();
    let args = ["scatter", "silk1", "--samples", "50", "--sweep", "density=0.1..0.7:7"];
    let run = yarnray(directory.path(), &args).good();
    let at: Vec<&str> = run.stdout.lines().skip(1).map(|line| line.split(',').next().unwrap()).collect();
    assert_eq!(at, ["0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7"]);
}

#[test]
fn scatter_refuses_what_it_cannot_do_with_one_clear_message() {
    let directory = directory();
    for (args, word) in [
        (&["scatter", "silk2x"][..], "did you mean \"silk2\"?"),
        (&["scatter", "silk1", "--theta", "90"], "above -90 and below 90"),
        (&["scatter", "silk1", "--offset", "1.1"], "from -1 to 1"),
        (&["scatter", "silk1", "--flatten", "0.5"], "from 1 to 4"),
        (&["scatter", "silk1", "--flatten", "1.5", "--phase", "3", "--truth", "9"], "leave it out"),
        (&["scatter", "silk1", "--ply", "3"], "3 plies"),
        (&["scatter", "silk1", "--sweep", "density=0.1"], "KEY=A..B:N"),
        (&["scatter", "silk1", "--sweep", "nonsense=1..2:2"], "unknown key `nonsense`"),
        (&["scatter", "silk1", "--sweep", "density=0..1:2"], "density"),
        (&["scatter", "silk1", "--sweep", "fibers=10..11:3"], "--sweep fibers=10..11:2 takes every one"),
        (&["scatter", "silk1", "--sweep", "yarn.silk1.fibers=1.5..3.5:2"], "takes whole numbers, but 1.5"),
        (&["scatter", "silk1", "-o", "x.exr"], ".json, .csv, .svg or .png"),
        (&["scatter", "absent.toml"], "no such file"),
        (&["scatter", "--fiber", "wol"], "did you mean \"wool\"?"),
        (&["scatter", "wool", "--fiber", "silk"], "beside --fiber silk: expected a scene or library file"),
        (&["scatter", "--fiber", "silk", "--phase", "3"], "--phase"),
        (&["scatter", "--fiber", "silk", "--model", "paper"], "--model"),
        (&["scatter", "--fiber", "silk", "--sweep", "offset=0..1:2"], "a single fibre has none"),
    ] {
        let run = yarnray(directory.path(), args);
        assert_eq!(run.status, Some(2), "{args:?}: {}", run.stderr);
        assert!(run.stderr.contains(word), "{args:?}: {}", run.stderr);
    }
    assert_eq!(listing(directory.path()), [""; 0]);
}
