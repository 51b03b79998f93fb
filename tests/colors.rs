//! Colour work: yarns by row and motif, pictures over cloth and meshes, variation from yarn to yarn.

use std::path::Path;

use crate::support::{Picture, directory, mean, render, render_file, write, yarnray};

/// Fibres and yarns of three colours, and even light.
const YARNS: &str = "[fiber.white]\nr = 0.05\ntt = 0.35\nd = 0.5\n\
    [fiber.red]\nr = 0.05\ntt = [0.3, 0.02, 0.02]\nd = [0.5, 0.03, 0.03]\n\
    [fiber.blue]\nr = 0.05\ntt = [0.02, 0.02, 0.3]\nd = [0.03, 0.03, 0.5]\n\
    [yarn.white]\nradius = 1\nfiber = \"white\"\nfibers = 80\ndensity = 0.5\n\
    [yarn.red]\nradius = 1\nfiber = \"red\"\nfibers = 80\ndensity = 0.5\n\
    [yarn.blue]\nradius = 1\nfiber = \"blue\"\nfibers = 80\ndensity = 0.5\n\
    [[light]]\ntype = \"environment\"\nvisible = false\n";

/// Fifteen straight yarns side by side, 40 long, that fill a picture of 40 x 30 pixels.
fn yarns(colors: &str) -> String {
    format!(
        "render = {{ width = 40, height = 30, spp = 16, max_bounces = 16 }}\n\
         camera = {{ type = \"orthographic\", position = [0, 0, 50], target = [0, 0, 0], size = 30 }}\n{YARNS}\
         [[fabric]]\nyarn = \"white\"\nphase = 0\nsource = {{ type = \"straight\", count = 15, length = 40 }}\n{colors}\n"
    )
}

/// The mean of the pixels of one of `columns` x `rows` cells, of which (0, 0) is the upper left one.
fn cell(picture: &Picture, at: [usize; 2], columns: usize, rows: usize) -> [f64; 3] {
    let (w, h) = (picture.image.width, picture.image.height);
    let colors = picture.colors();
    let inside = |i: &usize| {
        // A pixel off the borders, where neighbours are seen.
        let (x, y) = (i % w * columns, i / w * rows);
        let off = |v: usize, n: usize, size: usize| v >= n * size + size / 5 && v + size / 5 < (n + 1) * size;
        off(x, at[0], w) && off(y, at[1], h)
    };
    mean(&(0..w * h).filter(inside).map(|i| colors[i]).collect::<Vec<_>>())
}

/// `"2 brown_wool"` is a yarn of the built-in library, as `"brown_wool"` is.
#[test]
fn counted_yarns_of_the_library_are_known() {
    let folder = directory();
    for (fabric, source) in [
        ("rows = [\"4 wool\", \"2 brown_wool\"]", "type = \"knit\", pattern = \"garter\", stitches = 6, rows = 8"),
        ("columns = [\"2 grey_wool\", \"wool\"]", "type = \"weave\", draft = \"plain\", warps = 6, wefts = 6"),
        ("", "type = \"weave\", draft = \"plain\", warps = 6, wefts = 6, warp_order = [\"3 brown_wool\", \"3 wool\"]"),
    ] {
        write(folder.path(), "s.toml", format!("[[fabric]]\nyarn = \"wool\"\n{fabric}\nsource = {{ {source} }}\n"));
        yarnray(folder.path(), &["info", "s.toml"]).good();
    }
}

#[test]
fn lobes_are_left_out_of_yarns_of_all_colors() {
    let shown = |setting: &str| {
        let scene =
            yarns("rows = [\"red\", \"white\", \"blue\"]").replace("spp = 16,", &format!("spp = 16, {setting}"));
        mean(&render(&scene, &[]).colors())
    };
    let [all, fewer] = [shown(""), shown("without = [\"D\", \"TT\"],")];
    // What is left reflects a twentieth in every colour.
    let [low, high] = [fewer.iter().copied().fold(f64::INFINITY, f64::min), fewer.iter().copied().fold(0.0, f64::max)];
    assert!(high < 0.3 * all[0] && high < 1.05 * low, "{all:?} {fewer:?}");
}

const LETTER: [&str; 5] = ["####", "#...", "###.", "#...", "#..."];

/// Whether a picture shows the letter in red on white, filling it.
#[track_caller]
fn shows_letter(picture: &Picture) {
    for (y, row) in LETTER.iter().enumerate() {
        for (x, sign) in row.chars().enumerate() {
            let [red, green, _] = cell(picture, [x, y], 4, 5);
            assert_eq!(sign == '#', red > 2.0 * green, "cell {x}, {y}: {red} {green}");
        }
    }
}

/// A PNG of the letter, each cell of so many pixels.
fn letter_png(path: &Path, size: u32, on: [u8; 3], off: [u8; 3]) {
    let mut encoder = png::Encoder::new(std::fs::File::create(path).unwrap(), 4 * size, 5 * size);
    encoder.set_color(png::ColorType::Rgb);
    let bit = |x: u32, y: u32| LETTER[(y / size) as usize].as_bytes()[(x / size) as usize] == b'#';
    let bytes: Vec<u8> =
        (0..5 * size).flat_map(|y| (0..4 * size).flat_map(move |x| if bit(x, y) { on } else { off })).collect();
    encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
}

#[test]
fn stripes_follow_the_rows_from_the_bottom_in_every_mode() {
    for mode in ["yarn", "ply", "fiber"] {
        let picture = render(&yarns("rows = [\"red\", \"white\", \"blue\"]"), &["--mode", mode]);
        for row in 0..15 {
            let [r, g, b] = cell(&picture, [0, 14 - row], 1, 15);
            let is = if r > 2.0 * g {
                "red"
            } else if b > 2.0 * g {
                "blue"
            } else {
                "white"
            };
            assert_eq!(is, ["red", "white", "blue"][row % 3], "{mode}, row {row}: {r} {g} {b}");
        }
        // The albedo of what is seen is that of its own yarn.
        let albedo = picture.image.layer_rgb("albedo").expect("a layer of albedo");
        let at = |x: usize, y: usize| albedo.map(|c| c[y * 40 + x]);
        let [r, g, _] = at(20, 29);
        assert!((r / g - 0.85 / 0.1).abs() < 0.01, "{mode}: {r} {g}");
    }
}

#[test]
fn a_motif_in_a_picture_stands_upright_and_unmirrored() {
    let directory = directory();
    letter_png(&directory.path().join("letter.png"), 7, [190, 20, 20], [240, 240, 230]);
    let motif = "motif = { image = \"letter.png\", fit = \"fabric\", yarns = { \"#ffffff\" = \"white\", \"#c02020\" = \"red\" } }";
    shows_letter(&render_file(&write(directory.path(), "s.toml", yarns(motif)), &[]));
}

#[test]
fn a_motif_in_knitted_stitches_stands_upright_and_unmirrored() {
    // Each sign is two stitches wide and three rows high, the height of two stitches' width.
    let rows: Vec<String> = LETTER
        .iter()
        .flat_map(|row| {
            let wide: String = row.chars().flat_map(|c| [c, c]).collect();
            std::iter::repeat_n(format!("{wide:?}"), 3)
        })
        .collect();
    let scene = format!(
        "render = {{ width = 64, height = 80, spp = 16, max_bounces = 8 }}\n\
         camera = {{ type = \"frame\", projection = \"orthographic\", margin = 0.0 }}\n{YARNS}\
         [[fabric]]\nyarn = \"white\"\nsource = {{ type = \"stockinette\", stitches = 8, rows = 15, edges = \"live\" }}\n\
         motif = {{ rows = [{}], yarns = {{ \".\" = \"white\", \"#\" = \"red\" }} }}\n",
        rows.join(", ")
    );
    // Only the cloth itself: without the free space beside it and without its outermost stitches.
    let picture = render(&scene, &[]);
    let (w, h) = (picture.image.width, picture.image.height);
    let alpha = picture.channel("A");
    let cloth = |i: &usize| alpha[*i] > 0.5;
    let columns: Vec<usize> = (0..w * h).filter(cloth).map(|i| i % w).collect();
    let rows: Vec<usize> = (0..w * h).filter(cloth).map(|i| i / w).collect();
    let (left, right) = (*columns.iter().min().unwrap(), columns.iter().max().unwrap() + 1);
    let (top, bottom) = (*rows.iter().min().unwrap(), rows.iter().max().unwrap() + 1);
    let colors = picture.colors();
    for (y, row) in LETTER.iter().enumerate() {
        for (x, sign) in row.chars().enumerate() {
            let within = |v: usize, low: usize, high: usize, n: usize, of: usize| {
                let place = (v - low) as f64 / (high - low) as f64 * of as f64 - n as f64;
                (0.3..0.7).contains(&place)
            };
            let inside =
                |i: &usize| alpha[*i] > 0.5 && within(i % w, left, right, x, 4) && within(i / w, top, bottom, y, 5);
            let [red, green, _] = mean(&(0..w * h).filter(inside).map(|i| colors[i]).collect::<Vec<_>>());
            assert_eq!(sign == '#', red > 1.6 * green, "cell {x}, {y}: {red} {green}");
        }
    }
}

#[test]
#[cfg(feature = "oiio")]
fn a_tint_lies_over_the_cloth_as_it_is_seen() {
    let directory = directory();
    letter_png(&directory.path().join("letter.png"), 16, [255, 40, 40], [255, 255, 255]);
    let scene = yarns("tint = { image = \"letter.png\" }");
    let picture = render_file(&write(directory.path(), "s.toml", scene), &[]);
    shows_letter(&picture);
    // White leaves the yarn as it was.
    let plain = render(&yarns(""), &[]);
    let (tinted, plain) = (cell(&picture, [2, 4], 4, 5), cell(&plain, [2, 4], 4, 5));
    assert!((0..3).all(|k| (tinted[k] / plain[k] - 1.0).abs() < 0.03), "{tinted:?} {plain:?}");
}

#[test]
#[cfg(feature = "oiio")]
fn a_textured_plane_shows_its_picture_upright() {
    let directory = directory();
    letter_png(&directory.path().join("letter.png"), 16, [255, 20, 20], [255, 255, 255]);
    let scene = "render = { width = 64, height = 80, spp = 4 }\n\
        camera = { type = \"orthographic\", position = [0, 50, 0], target = [0, 0, 0], up = [0, 0, -1], size = 10 }\n\
        [material.print]\ntexture = \"letter.png\"\n\
        [[mesh]]\nshape = \"plane\"\nsize = [8, 10]\nmaterial = \"print\"\n[[light]]\ntype = \"environment\"\n";
    let picture = render_file(&write(directory.path(), "s.toml", scene), &[]);
    shows_letter(&picture);
    assert!((cell(&picture, [3, 4], 4, 5)[1] - 1.0).abs() < 1e-3, "white is white");
    assert!(picture.stats["used"].as_array().unwrap().iter().any(|f| f == "textures"));
    // From far away the letter is the mean of its light, whatever pixel looks where.
    let far = scene.replace("size = 10 }", "size = 640 }").replace("size = [8, 10]", "size = [4096, 5120]");
    let far = far.replace("[material.print]", "[material.print]\nrepeat = [4096, 4096]");
    let far = render_file(&write(directory.path(), "far.toml", far), &[]);
    let green = far.mean()[1];
    assert!((green - 0.5).abs() < 0.05, "{green}");
    assert!(far.colors().iter().all(|c| (c[1] - green).abs() < 0.01));
}

#[test]
fn rows_and_columns_of_a_weave_are_its_wefts_and_warps() {
    let scene = format!(
        "render = {{ width = 48, height = 48, spp = 24, max_bounces = 8 }}\n\
         camera = {{ type = \"frame\", projection = \"orthographic\", margin = -0.01 }}\n{YARNS}\
         [[fabric]]\nyarn = \"white\"\nsource = {{ type = \"weave\", warps = 6, wefts = 6, edges = \"live\" }}\n\
         rows = [\"3 red\", \"white\", \"2 white\"]\n\
         columns = [\"blue\", \"blue\", \"blue\", \"white\", \"white\", \"white\"]\n"
    );
    let picture = render(&scene, &[]);
    let quarter = |x, y| cell(&picture, [x, y], 2, 2);
    // Wefts, the lower three of them red, cross warps, the left three of them blue.
    let ([r, g, b], white) = (quarter(0, 1), quarter(1, 0));
    assert!(r > 1.4 * g && b > 1.4 * g, "below left {r} {g} {b}");
    assert!((white[0] / white[2] - 1.0).abs() < 0.2 && (white[1] / white[0] - 1.0).abs() < 0.2, "{white:?}");
    let ([r, g, b], [r2, g2, b2]) = (quarter(0, 0), quarter(1, 1));
    assert!(b > 1.2 * g && r < 1.1 * g, "above left {r} {g} {b}");
    assert!(r2 > 1.2 * g2 && b2 < 1.1 * g2, "below right {r2} {g2} {b2}");
}

#[test]
fn variation_follows_its_seed_and_nothing_else() {
    let with = |vary: &str| render(&yarns(vary), &[]).colors();
    let plain = with("");
    assert_eq!(with("vary = { seed = 4 }"), plain);
    for what in ["radius = 0.2", "color = 0.3"] {
        let one = with(&format!("vary = {{ seed = 1, {what} }}"));
        assert_eq!(one, with(&format!("vary = {{ seed = 1, {what} }}")), "{what}");
        assert_ne!(one, plain, "{what}");
        assert_ne!(one, with(&format!("vary = {{ seed = 2, {what} }}")), "{what}");
    }
    // Yarns differ in brightness, each the same along its length.
    let picture = render(&yarns("vary = { seed = 1, color = 0.3 }"), &["--spp", "64"]);
    let rows: Vec<[f64; 2]> = (0..15).map(|y| [0, 1].map(|x| cell(&picture, [x, y], 2, 15)[1])).collect();
    let spread = rows.iter().map(|r| r[0]).fold(0.0, f64::max) / rows.iter().map(|r| r[0]).fold(9.0, f64::min);
    assert!(spread > 1.15, "{rows:?}");
    assert!(rows.iter().all(|r| (r[0] / r[1] - 1.0).abs() < 0.1), "{rows:?}");
}
