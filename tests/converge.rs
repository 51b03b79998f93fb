//! `yarnray converge`

use serde_json::Value;

use crate::support::{SWATCH, directory, listing, read_json, write, yarnray};

#[test]
fn noise_falls_as_one_over_time() {
    let directory = directory();
    let d = directory.path();
    write(d, "s.toml", SWATCH);
    let args = [
        "converge",
        "s.toml",
        "--method=yarn:aggregated",
        "--method=yarn:two-stream",
        "--reference=yarn:aggregated",
        "--spp=64",
        "--converged-spp=96",
        "--seeds=3",
        "--width=24",
        "--height=18",
        "--target=0.02",
    ];
    let run = yarnray(d, &args).good();
    assert_eq!(run.stdout.lines().count(), 2, "{}", run.stdout);
    assert!(run.stderr.contains("converged picture of yarn:two-stream: half 2 of 2, 96 spp"), "{}", run.stderr);
    assert_eq!(listing(&d.join("out/converge")), ["converge.csv", "converge.json", "converge.svg"]);
    assert_eq!(listing(&d.join("out/cache")).len(), 2);

    let json = read_json(&d.join("out/converge/converge.json"));
    let curves = json["curves"].as_array().unwrap();
    let spp = |curve: &Value| -> Vec<u64> {
        curve["points"].as_array().unwrap().iter().map(|p| p["spp"].as_u64().unwrap()).collect()
    };
    assert_eq!(curves.iter().map(spp).collect::<Vec<_>>(), [[1, 2, 4, 8, 16, 32, 64]; 2]);
    for curve in curves {
        // Against samples, not time: that is free of the machine's moods.
        let noise = |i: usize| curve["points"][i]["noise"]["mean"].as_f64().unwrap();
        let slope = (noise(6) / noise(1)).log2() / 5.0;
        assert!((-1.5..-0.75).contains(&slope), "{slope}: {curve}");
        assert!(curve["noise_fit"]["slope"].as_f64().unwrap() < -0.3);
    }
    // The reference has no model error; the other model does, and it stays.
    assert!(curves[0]["points"][6]["error"].is_null());
    let last = &curves[1]["points"][6];
    let [noise, error] = ["noise", "error"].map(|name| last[name]["mean"].as_f64().unwrap());
    assert!(error > noise, "{last}");
    let csv = std::fs::read_to_string(d.join("out/converge/converge.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + 2 * 7);

    // Once more: the converged pictures are kept, and another scene has others.
    let again = yarnray(d, &args).good();
    assert!(again.stderr.contains("from ") && !again.stderr.contains("half 1"), "{}", again.stderr);
    let other = [&args[..], &["--set", "light.0.radiance=0.2", "--method=yarn:aggregated"]].concat();
    assert!(yarnray(d, &other).good().stderr.contains("half 1"));
}

#[test]
fn wrong_questions_are_refused() {
    let directory = directory();
    let d = directory.path();
    write(d, "s.toml", SWATCH);
    for (args, part) in [
        (&["none.toml", "--reference=none"][..], "none.toml: error: no such file"),
        (&["s.toml", "--method=cloth"], "unknown mode `cloth`"),
        (&["s.toml", "--reference=yarn:magic"], "error: --reference yarn:magic: unknown model `magic`"),
        (&["s.toml", "--seeds=1"], "invalid value '1'"),
        (&["s.toml", "--target=0"], "error: --target must be above 0, found 0"),
    ] {
        let run = yarnray(d, &[&["converge"], args].concat());
        assert_eq!(run.status, Some(2), "{args:?}");
        assert!(run.stderr.contains(part), "{}", run.stderr);
    }
    assert_eq!(listing(d), ["s.toml"]);
}
