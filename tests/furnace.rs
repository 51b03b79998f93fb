//! White cloth under a white sky: nothing is absorbed, so nothing may be seen but the sky.

use crate::support::{directory, mean, render_file, weave_text, write};

/// How far from 1 the mean may be.
const ALLOWED: f64 = 0.005;

/// Mean over covered pixels and over all, for a fabric of white yarn.
///
/// `YARNRAY_FURNACE_SPP` gives more samples, for measuring.
fn white(name: &str, source: &str, plies: u32, density: f64, spp: u32, extra: &str) -> Vec<String> {
    let spp = std::env::var("YARNRAY_FURNACE_SPP").unwrap_or_else(|_| spp.to_string());
    let directory = directory();
    write(directory.path(), "weave.txt", weave_text(6));
    let scene = format!(
        r#"
        [render]
        width = 40
        height = 30
        spp = {spp}
        max_bounces = 2000
        {extra}
        [camera]
        direction = [0.3, 0.2, 1]
        margin = -0.3
        [fiber.white]
        r = 0.2
        tt = 0.5
        d = 0.3
        beta_r = 8.6
        beta_tt = 6.9
        beta_n = 20
        [yarn.white]
        radius = 1
        plies = {plies}
        ply_twist = {}
        fiber = "white"
        fibers = 60
        density = {density}
        fiber_twist = -20
        [[fabric]]
        yarn = "white"
        source = {source}
        [[light]]
        type = "environment"
        radiance = 1
        "#,
        if plies > 1 { 15 } else { 0 }
    );
    let picture = render_file(&write(directory.path(), "white.toml", scene), &[]);
    let alpha = picture.channel("A");
    let colors = picture.colors();
    let covered: Vec<[f64; 3]> = colors.iter().zip(alpha).filter(|&(_, &a)| a > 0.99).map(|(c, _)| *c).collect();
    let variance = picture.channel("variance.R");
    // Standard error of the mean over some pixels.
    let error = |pixels: &dyn Fn(usize) -> bool| -> f64 {
        let chosen: Vec<f64> = (0..alpha.len()).filter(|&i| pixels(i)).map(|i| f64::from(variance[i])).collect();
        chosen.iter().sum::<f64>().sqrt() / chosen.len().max(1) as f64
    };
    let label = format!("{name}, {plies} plies, density {density} {extra}");
    let mut wrong = Vec::new();
    let mut check = |what: &str, mean: [f64; 3], error: f64| {
        eprintln!("{label}: {what} {:.4} +- {error:.4}", mean[0]);
        if mean.iter().any(|m| (m - 1.0).abs() > ALLOWED) {
            wrong.push(format!("{label}: {what} {mean:.4?} +- {error:.4}"));
        }
    };
    check("the whole picture", picture.mean(), error(&|_| true));
    if covered.len() > 100 {
        check("covered pixels", mean(&covered), error(&|i| alpha[i] > 0.99));
    }
    assert_eq!(picture.stats["invalid_samples"], 0);
    wrong
}

#[test]
fn knits_of_one_and_three_plies() {
    let source = "{ type = \"stockinette\", stitches = 5, rows = 8 }";
    let mut wrong = Vec::new();
    for (plies, density) in [(1, 0.25), (1, 0.6), (3, 0.15), (3, 0.4), (3, 0.8)] {
        wrong.extend(white("knit", source, plies, density, 256, ""));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn weaves_of_one_to_four_plies() {
    let source = "{ type = \"file\", path = \"weave.txt\" }";
    let mut wrong = Vec::new();
    // With fewer samples the noise of the pixels that are covered comes near the bound; 3000 have .9997 to 1.0006, +- .0006 to .0008.
    for (plies, density) in [(1, 0.5), (2, 0.3), (3, 0.5), (4, 0.3)] {
        wrong.extend(white("weave", source, plies, density, 640, ""));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn perpendicular_sections_lose_nothing_either() {
    let source = "{ type = \"stockinette\", stitches = 5, rows = 8 }";
    let wrong = white("knit", source, 3, 0.4, 256, "ply_intersection = \"perpendicular\"");
    assert!(wrong.is_empty(), "{wrong:#?}");
}
