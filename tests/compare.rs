//! `yarnray compare` on files.

use serde_json::Value;
use yarnray::image::png::Display;

use crate::support::{SWATCH, directory, listing, write, yarnray};

/// Writes pictures with a gradient: `a.exr`, the brighter `b.exr`, one of another size, one without colours.
fn pictures(directory: &std::path::Path) {
    for (name, width, gain) in [("a.exr", 40, 1.0), ("b.exr", 40, 1.1), ("small.exr", 20, 1.0), ("mask.png", 40, 1.0)] {
        yarnray::image::output::write_colors(&directory.join(name), width, 24, &Display::default(), |y, row| {
            for (x, out) in row.iter_mut().enumerate() {
                let v = match name {
                    "mask.png" => f32::from(u8::from(x < 10)),
                    _ => gain * (0.1 + 0.02 * x as f32 + 0.01 * y as f32),
                };
                *out = [v, v, 0.5 * v, 1.0];
            }
        })
        .unwrap();
    }
}

#[test]
fn metrics_maps_and_pages() {
    let directory = directory();
    let d = directory.path();
    pictures(d);
    let run = yarnray(d, &["compare", "b.exr", "a.exr", "-o", "map.png", "-o", "page.html", "--json"]).good();
    let json: Value = serde_json::from_str(&run.stdout).unwrap();
    for channel in 0..3 {
        let ratio = json["mean_ratio"][channel].as_f64().unwrap();
        assert!((ratio - 1.1).abs() < 1e-6, "{ratio}");
    }
    let factors: Vec<u64> = json["errors"].as_array().unwrap().iter().map(|e| e["factor"].as_u64().unwrap()).collect();
    assert_eq!(factors, [1, 2, 4, 8]);
    assert!(json["ssim"].as_f64().unwrap() > 0.9 && json["flip_hdr"].as_f64().unwrap() > 0.0);
    assert_eq!(json["epsilon"], 0.01);
    assert_eq!(listing(d), ["a.exr", "b.exr", "map.png", "mask.png", "page.html", "small.exr"]);
    let map = yarnray::image::read(&d.join("map.png")).unwrap();
    assert_eq!(map.width, 40);
    assert!(map.height > 24, "the scale stands below");
    let page = std::fs::read_to_string(d.join("page.html")).unwrap();
    assert!(page.contains("b.exr against a.exr") && page.matches("data:image/png;base64,").count() >= 3);

    let text = yarnray(d, &["compare", "b.exr", "a.exr"]).good().stdout;
    assert!(text.starts_with("b.exr against a.exr: 960 of 960 pixels count\n"), "{text}");
    assert!(text.contains("mean ratio  R 1.10000  G 1.10000  B 1.10000"), "{text}");
    let masked = yarnray(d, &["compare", "b.exr", "a.exr", "--mask", "mask.png"]).good().stdout;
    assert!(masked.contains("240 of 960 pixels count"), "{masked}");
    yarnray(d, &["compare", "b.exr", "a.exr", "-o", "r.png", "--map", "relative"]).good();
}

#[test]
fn thresholds_set_the_status() {
    let directory = directory();
    let d = directory.path();
    pictures(d);
    let run = |threshold: &str| yarnray(d, &["compare", "b.exr", "a.exr", "--threshold", threshold]);
    for good in ["mean_ratio=0.11", "relmse_8=0.02", "ssim=0.9", "rmse=1", "flip_ldr=0.5"] {
        assert_eq!(run(good).status, Some(0), "{good}");
    }
    for (bad, message) in
        [("mean_ratio=0.09", "mean_ratio is 0.1000"), ("ssim=1", "ssim is 0.9"), ("relmse=1e-4", "worse than 0.0001")]
    {
        let run = run(bad);
        assert_eq!(run.status, Some(1), "{bad}");
        assert!(run.stderr.contains(message) && run.stdout.contains("mean ratio"), "{run:?}");
    }
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let directory = directory();
    let d = directory.path();
    pictures(d);
    let before = listing(d);
    for (args, message) in [
        (&["small.exr", "a.exr"][..], "error: small.exr and a.exr: their sizes differ: 20 x 24 and 40 x 24 pixels\n"),
        (&["none.exr", "a.exr"], "error: cannot read none.exr: no such file\n"),
        (
            &["a.exr", "b.exr", "--mask", "small.exr"],
            "error: the mask small.exr: its size, 20 x 24, is not that of the pictures, 40 x 24\n",
        ),
        (&["a.exr", "b.exr", "--mask", "alpha"], "error: a.exr has no alpha channel `A` for --mask alpha\n"),
        (
            &["a.exr", "b.exr", "-o", "map.exr"],
            "error: cannot write map.exr: expected a name that ends in .png (an error map) or .html (a page)\n",
        ),
    ] {
        let run = yarnray(d, &[&["compare"], args].concat());
        assert_eq!((run.status, run.stderr.as_str(), run.stdout.as_str()), (Some(2), message, ""), "{args:?}");
    }
    for (threshold, part) in [
        ("flop=1", "unknown metric `flop`; known are mean_ratio, ssim"),
        ("ssim_2=1", "unknown metric `ssim_2`"),
        ("rmse", "expected METRIC=VALUE"),
        ("rmse=x", "expected a number after `rmse=`, found `x`"),
    ] {
        let run = yarnray(d, &["compare", "a.exr", "b.exr", "--threshold", threshold]);
        assert_eq!(run.status, Some(2));
        assert!(run.stderr.contains(part), "{}", run.stderr);
    }
    assert_eq!(listing(d), before);
}

#[test]
fn a_picture_for_a_screen_beside_one_of_radiance_is_told() {
    let directory = directory();
    let d = directory.path();
    write(d, "s.toml", SWATCH);
    yarnray(d, &["render", "s.toml", "-q", "--spp", "1", "-o", "a.exr", "-o", "a.png"]).good();
    let told = yarnray(d, &["compare", "a.png", "a.exr"]).good().stderr;
    assert!(told.contains("note: a.png holds colours for a screen") && told.contains("a.exr radiance"), "{told}");
    assert_eq!(yarnray(d, &["compare", "a.exr", "a.exr"]).good().stderr, "");
}

#[test]
fn renders_of_two_seeds_differ_by_noise_only() {
    let directory = directory();
    let d = directory.path();
    write(d, "s.toml", SWATCH);
    for seed in ["1", "2"] {
        let out = format!("{seed}.exr");
        yarnray(d, &["render", "s.toml", "-q", "--spp", "64", "--seed", seed, "-o", &out]).good();
    }
    let json = yarnray(d, &["compare", "1.exr", "2.exr", "--mask", "alpha", "--json"]).good().stdout;
    let json: Value = serde_json::from_str(&json).unwrap();
    for channel in 0..3 {
        let ratio = json["mean_ratio"][channel].as_f64().unwrap();
        let uncertainty = json["mean_ratio_uncertainty"][channel].as_f64().unwrap();
        // 2.5 times what 95 % keep to is nearly five standard errors.
        assert!((ratio - 1.0).abs() < 2.5 * uncertainty && uncertainty < 0.05, "{ratio} +- {uncertainty}");
    }
    for errors in json["errors"].as_array().unwrap() {
        // Samples are stratified: noise is at most what their variance says. Channels vary together, so that each pixel
        // is one look.
        let z = errors["noise"]["z_rms"].as_f64().unwrap();
        let spread = 4.0 / (2.0 * errors["count"].as_f64().unwrap()).sqrt();
        assert!(z > 0.7 - spread && z < 1.1 + spread, "{errors}");
    }
}
