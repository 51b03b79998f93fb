//! White cloth under a white sky: nothing is absorbed, so nothing may be seen but the sky.

use crate::support::{directory, render_file, weave_text, write};

/// Mean over covered pixels and over all, for a fabric of white yarn.
fn white(name: &str, source: &str, plies: u32, density: f64, extra: &str) {
    let directory = directory();
    write(directory.path(), "weave.txt", weave_text(6));
    let scene = format!(
        r#"
        [render]
        width = 40
        height = 30
        spp = 64
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
    let covered: Vec<[f64; 3]> =
        colors.iter().zip(alpha).filter(|&(_, &a)| a > 0.99).map(|(c, _)| *c).collect();
    let all = picture.mean();
    eprintln!(
        "{name}, {plies} plies, density {density}{extra}: {} covered pixels, all {:.4}, {:.2} bounces",
        covered.len(),
        all[0],
        picture.stats["mean_bounces"]
    );
    assert_eq!(picture.stats["invalid_samples"], 0);
    for channel in all {
        assert!((channel - 1.0).abs() < 0.005, "{name}, {plies} plies, density {density}: {channel}");
    }
    if covered.len() > 100 {
        for channel in crate::support::mean(&covered) {
            assert!((channel - 1.0).abs() < 0.005, "{name}, {plies} plies, density {density}, covered: {channel}");
        }
    }
}

#[test]
fn knits_of_one_and_three_plies() {
    let source = "{ type = \"stockinette\", stitches = 5, rows = 8 }";
    for (plies, density) in [(1, 0.25), (1, 0.6), (3, 0.15), (3, 0.4), (3, 0.8)] {
        white("knit", source, plies, density, "");
    }
}

#[test]
fn weaves_of_one_to_four_plies() {
    let source = "{ type = \"file\", path = \"weave.txt\" }";
    for (plies, density) in [(1, 0.5), (2, 0.3), (3, 0.5), (4, 0.3)] {
        white("weave", source, plies, density, "");
    }
}

#[test]
fn perpendicular_sections_lose_nothing_either() {
    white("knit", "{ type = \"stockinette\", stitches = 5, rows = 8 }", 3, 0.4, "ply_intersection = \"perpendicular\"");
}
