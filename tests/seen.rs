//! What an EXR says of the camera, and of where what is seen lies, moves and belongs.

use std::path::Path;

use yarnray::image::{self, Attribute, Image};

use crate::support::{SWATCH, WHITE_FIBER, directory, render, write, yarnray};

/// A yarn along x under an even sky, seen by a camera that the test gives.
fn scene(camera: &str, layers: &str, source: &str) -> String {
    format!(
        r#"
[render]
width = 60
height = 40
spp = 4
filter = "box"
filter_width = 0.5
frame = 1

[output]
layers = {layers}
frames_per_second = 23.976

[camera]
{camera}

[fiber.wool]
r = 0.1
tt = 0.3
d = 0.3
beta_r = 10
beta_tt = 10
beta_n = 25

[yarn.one]
radius = 2
plies = 1
fiber = "wool"
fibers = 50
density = 0.5

[[fabric]]
yarn = "one"
source = {{ {source} }}

[[light]]
type = "environment"
"#
    )
}

const VIEWS: [&str; 2] = [
    "type = \"perspective\"\nposition = [30, 25, 60]\ntarget = [4, 1, 2]\nfov = 25",
    "type = \"orthographic\"\nposition = [-20, 40, 50]\ntarget = [3, 0, 1]\nsize = 30",
];

#[track_caller]
fn matrix(image: &Image, name: &str) -> [[f32; 4]; 4] {
    match image.attribute(name) {
        Some(Attribute::Matrix(rows)) => *rows,
        other => panic!("{name}: {other:?}"),
    }
}

fn apply(rows: &[[f32; 4]; 4], point: [f32; 3]) -> [f64; 4] {
    let p = [point[0], point[1], point[2], 1.0].map(f64::from);
    rows.map(|row| row.into_iter().zip(p).map(|(a, b)| f64::from(a) * b).sum())
}

/// By how many pixels a place falls beside the middle of pixel `i` of 60 x 40.
fn off_pixel(to_ndc: &[[f32; 4]; 4], place: [f32; 3], i: usize) -> [f64; 2] {
    let [x, y, _, w] = apply(to_ndc, place);
    [60.0 * x / w - (i % 60) as f64 - 0.5, 40.0 * y / w - (i / 60) as f64 - 0.5]
}

fn read(directory: &Path, args: &[&str]) -> Image {
    yarnray(directory, &[&["render", "s.toml", "-q", "-o", "out.exr"], args].concat()).good();
    image::read(&directory.join("out.exr")).expect("a picture")
}

fn triple(image: &Image, names: [&str; 3], i: usize) -> [f32; 3] {
    names.map(|name| image.channel(name).expect("the channel")[i])
}

#[test]
fn positions_fall_on_their_pixels_by_the_matrices_of_the_file() {
    for camera in VIEWS {
        // Two yarns, far from the origin: their middle is not the world's.
        let source = "type = \"straight\", count = 3, length = 40, spacing = 7";
        let text = scene(camera, "[\"position\", \"depth\"]", source);
        let picture = render(&text, &[]).image;
        let (to_camera, to_ndc) = (matrix(&picture, "worldToCamera"), matrix(&picture, "worldToNDC"));
        let mut seen = 0;
        for i in 0..60 * 40 {
            let alpha = picture.channel("A").unwrap()[i];
            if alpha < 1.0 {
                continue;
            }
            seen += 1;
            let p = triple(&picture, ["P.X", "P.Y", "P.Z"], i);
            let off = off_pixel(&to_ndc, p, i);
            // The mean of samples all over the pixel is somewhere in it.
            assert!(off.iter().all(|o| o.abs() < 0.5), "{camera}, pixel {i}: {off:?} pixels off");
            let [_, _, z, _] = apply(&to_camera, p);
            let depth = f64::from(picture.channel("depth.Z").unwrap()[i]);
            assert!((-z - depth).abs() < 1e-3 * depth, "{camera}, pixel {i}: {z}, depth {depth}");
        }
        assert!(seen > 200, "{camera}: {seen} pixels are covered");
    }
}

/// A yarn's tube begins before its plies do: what lies between hides these.
#[test]
fn the_ground_hides_the_plies_behind_it() {
    let text = "render = { width = 96, height = 48, spp = 4, max_bounces = 0 }\n\
        camera = { type = \"orthographic\", position = [0, 6, 20], target = [0, 0, 0], size = 2.6 }\n\
        output = { layers = [\"position\"] }\n\
        ground = { height = 0, albedo = 0.5 }\n\
        [yarn.sample]\nradius = 1\nplies = 3\nply_twist = 25\nfiber = \"white\"\nfibers = 60\ndensity = 0.5\n\
        [[fabric]]\nyarn = \"sample\"\nphase = 0\nsource = { type = \"straight\", length = 9 }\n\
        [[light]]\ntype = \"environment\"\n";
    let picture = render(&(text.to_owned() + WHITE_FIBER), &[]).image;
    let lowest = picture.channel("P.Y").unwrap().iter().fold(f32::INFINITY, |low, y| low.min(*y));
    let highest = picture.channel("P.Y").unwrap().iter().fold(0.0f32, |high, y| high.max(*y));
    assert!(lowest > -1e-3 && highest > 0.8, "{lowest} to {highest}");
}

/// A picture for a stage in metres with z up tells of the same places as one in millimetres with y up.
#[test]
fn places_are_told_in_the_unit_and_the_axes_of_the_stage() {
    let text = scene(
        VIEWS[0],
        "[\"position\", \"depth\", \"normal\"]",
        "type = \"straight\", count = 3, length = 40, spacing = 7",
    );
    let usual = render(&text, &[]).image;
    let folder = directory();
    write(folder.path(), "s.toml", &text);
    let stage = ["--set", "output.unit=m", "--set", "output.up=z"];
    let other = read(folder.path(), &stage);
    assert_eq!(other.attribute("yarnray.meters_per_unit"), Some(&Attribute::Double(1.0)));
    assert_eq!(other.attribute("yarnray.up_axis"), Some(&Attribute::Text("Z".to_owned())));
    assert_eq!(usual.attribute("yarnray.meters_per_unit"), Some(&Attribute::Double(0.001)));
    let (to_camera, to_ndc) = (matrix(&other, "worldToCamera"), matrix(&other, "worldToNDC"));
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-5 * (1.0 + b.abs());
    let mut seen = 0;
    for i in (0..60 * 40).filter(|&i| usual.channel("A").unwrap()[i] >= 1.0) {
        seen += 1;
        for (names, length) in [(["P.X", "P.Y", "P.Z"], 1000.0), (["N.X", "N.Y", "N.Z"], 1.0)] {
            let [x, y, z] = triple(&usual, names, i).map(f64::from);
            let turned = triple(&other, names, i).map(|v| length * f64::from(v));
            assert!([x, -z, y].into_iter().zip(turned).all(|(a, b)| near(b, a)), "{names:?}, pixel {i}: {turned:?}");
        }
        let depth = f64::from(other.channel("depth.Z").unwrap()[i]);
        assert!(near(1000.0 * depth, f64::from(usual.channel("depth.Z").unwrap()[i])), "pixel {i}");
        let p = triple(&other, ["P.X", "P.Y", "P.Z"], i);
        assert!((-apply(&to_camera, p)[2] - depth).abs() < 1e-3 * depth, "pixel {i}");
        let off = off_pixel(&to_ndc, p, i);
        assert!(off.iter().all(|o| o.abs() < 0.5), "pixel {i}: {off:?} pixels off");
    }
    assert!(seen > 200, "{seen} pixels are covered");
    // A film keeps both; what it is merged into tells the same.
    yarnray(folder.path(), &[&["render", "s.toml", "-q", "-o", "part.film"], &stage[..]].concat()).good();
    yarnray(folder.path(), &["merge", "part.film", "-o", "merged.exr"]).good();
    let merged = image::read(&folder.path().join("merged.exr")).expect("a picture");
    for name in ["P.X", "P.Y", "P.Z", "N.X", "N.Y", "N.Z", "depth.Z"] {
        assert_eq!(merged.channel(name), other.channel(name), "{name}");
    }
    assert_eq!(merged.attribute("worldToCamera"), other.attribute("worldToCamera"));
}

/// Still or on its way, the picture of a USD camera lies where `horizontalApertureOffset` and its like put it.
#[test]
fn the_film_of_a_camera_may_lie_beside_its_view() {
    let folder = directory();
    for way in ["= (0, 0, 400)", ".timeSamples = { 0: (0, 0, 400), 1: (8, 0, 400) }"] {
        let camera = format!(
            "#usda 1.0\n(\nmetersPerUnit = 0.001\n)\ndef Camera \"shot\" {{\nfloat horizontalAperture = 36\n\
             float verticalAperture = 24\nfloat horizontalApertureOffset = 9\nfloat verticalApertureOffset = -6\n\
             float focalLength = 200\ndouble3 xformOp:translate{way}\n\
             uniform token[] xformOpOrder = [\"xformOp:translate\"]\n}}\n"
        );
        write(folder.path(), "shot.usda", camera);
        let source = "type = \"straight\", count = 3, length = 40, spacing = 3";
        let text = scene("type = \"usd\"\npath = \"shot.usda\"", "[\"position\"]", source);
        write(folder.path(), "s.toml", text);
        let picture = read(folder.path(), &["--frames", "0"]);
        let to_ndc = matrix(&picture, "worldToNDC");
        let [x, y, _, w] = apply(&to_ndc, [0.0; 3]);
        assert!((x / w - 0.25).abs() < 1e-5 && (y / w - 0.25).abs() < 1e-5, "{way}: {} {}", x / w, y / w);
        let alpha = picture.channel("A").unwrap();
        let covered: Vec<usize> = (0..60 * 40).filter(|&i| alpha[i] >= 1.0).collect();
        assert!(covered.len() > 50, "{way}: {} pixels are covered", covered.len());
        for i in covered {
            let off = off_pixel(&to_ndc, triple(&picture, ["P.X", "P.Y", "P.Z"], i), i);
            assert!(off.iter().all(|o| o.abs() < 0.5), "{way}, pixel {i}: {off:?} pixels off");
        }
    }
}

#[test]
fn an_exr_names_its_colours_and_its_rate() {
    let picture = render(&scene(VIEWS[0], "[]", "type = \"straight\", count = 1, length = 40"), &[]).image;
    assert_eq!(picture.attribute("framesPerSecond"), Some(&Attribute::Ratio(24_000, 1001)));
    let Some(Attribute::Chromaticities([red, .., white])) = picture.attribute("chromaticities") else {
        panic!("no chromaticities")
    };
    assert_eq!((*red, *white), ([0.64, 0.33], [0.3127, 0.329]));
    for layer in ["P.X", "forward.u", "uv.U"] {
        assert!(picture.channel(layer).is_none(), "{layer} was not asked for");
    }
    let plain = render(SWATCH, &["--spp", "1"]).image;
    assert_eq!(plain.attribute("framesPerSecond"), None);
}

/// A straight yarn along x at a place.
fn straight(x: f64, y: f64, z: f64) -> String {
    (0..=10).map(|i| format!("{} {} {z}\n", 40.0 * (f64::from(i) / 10.0 - 0.5) + x, y)).collect()
}

#[test]
fn motion_is_that_of_yarns_and_camera_until_the_next_frame() {
    // Straight from the front, a pixel is a millimetre: 40 rows of an orthographic view 40 high.
    let view = "type = \"orthographic\"\nposition = [0, 0, 90]\ntarget = [0, 0, 0]\nsize = 40\n";
    let source = "type = \"file\", path = \"y.####.txt\", unit = \"mm\"";
    let d = directory();
    write(d.path(), "y.0001.txt", straight(0.0, 0.0, 0.0));
    write(d.path(), "y.0002.txt", straight(0.0, 3.0, 0.0));
    write(d.path(), "y.0003.txt", straight(2.0, 3.0, 0.0));
    let keys = "[[camera.key]]\nframe = 1\nposition = [0, 0, 90]\ntarget = [0, 0, 0]\n\
                [[camera.key]]\nframe = 2\nposition = [5, 0, 90]\ntarget = [5, 0, 0]\n";
    let moves = |camera: &str, args: &[&str]| {
        write(d.path(), "s.toml", scene(camera, "[\"motion\"]", source));
        let image = read(d.path(), args);
        let (u, v, alpha) = (image.channel("forward.u"), image.channel("forward.v"), image.channel("A"));
        let (u, v, alpha) = (u.expect("u"), v.expect("v"), alpha.expect("alpha"));
        let covered: Vec<[f32; 2]> = (0..alpha.len()).filter(|i| alpha[*i] > 0.0).map(|i| [u[i], v[i]]).collect();
        assert!((0..alpha.len()).all(|i| alpha[i] > 0.0 || (u[i], v[i]) == (0.0, 0.0)), "nothing does not move");
        assert!(covered.len() > 60, "{} pixels", covered.len());
        let first = covered[0];
        for [u, v] in covered {
            assert!((u - first[0]).abs() < 2e-3 && (v - first[1]).abs() < 2e-3, "{u} {v}, elsewhere {first:?}");
        }
        first
    };
    let near = |[u, v]: [f32; 2], want: [f32; 2]| {
        assert!((u - want[0]).abs() < 2e-3 && (v - want[1]).abs() < 2e-3, "{u} {v}, not {want:?}");
    };
    // Up in the picture is positive, as in Nuke.
    near(moves(view, &["--frames", "1"]), [0.0, 3.0]);
    near(moves(view, &["--frames", "2"]), [2.0, 0.0]);
    // After the last file all stand still.
    near(moves(view, &["--frames", "3"]), [0.0, 0.0]);
    near(moves(&format!("{view}{keys}"), &["--frames", "1"]), [-5.0, 3.0]);
    // A shutter changes what is blurred, not how far things move until the next frame.
    let blurred = format!("{view}shutter = [0, 0.5]\n");
    near(moves(&blurred, &["--frames", "1"]), [0.0, 3.0]);
    // In a mode in which yarns do not move there is a clear word.
    write(d.path(), "s.toml", scene(view, "[\"motion\"]", source));
    let run = yarnray(d.path(), &["render", "s.toml", "-q", "--mode", "fiber", "-o", "out.exr"]);
    assert_eq!(run.status, Some(2));
    assert!(run.stderr.contains("the layer of motion needs mode = \"yarn\""), "{}", run.stderr);
}

#[test]
fn motion_is_that_of_meshes_as_well() {
    let view = "type = \"orthographic\"\nposition = [0, 0, 90]\ntarget = [0, 0, 0]\nsize = 40\n";
    let d = directory();
    let square = |x: f64, y: f64| {
        let corners = [[-8.0, -8.0], [8.0, -8.0], [8.0, 8.0], [-8.0, 8.0]];
        corners.map(|[u, v]| format!("v {} {} 0\n", x + u, y + v)).concat() + "f 1 2 3 4\n"
    };
    write(d.path(), "m.0001.obj", square(0.0, 0.0));
    write(d.path(), "m.0002.obj", square(3.0, -2.0));
    // Half as large in the scene, beside a yarn that stands still.
    let mesh = "[[mesh]]\npath = \"m.####.obj\"\nunit = \"mm\"\nscale = 0.5\n";
    let source = "type = \"straight\", count = 1, length = 1";
    write(d.path(), "s.toml", scene(view, "[\"motion\"]", source) + mesh);
    let moved = |frame: &str| {
        let image = read(d.path(), &["--frames", frame]);
        let (u, v) = (image.channel("forward.u").expect("u"), image.channel("forward.v").expect("v"));
        let at = (0..u.len()).max_by(|&a, &b| u[a].abs().total_cmp(&u[b].abs())).expect("pixels");
        [u[at], v[at]]
    };
    let [u, v] = moved("1");
    assert!((u - 1.5).abs() < 2e-3 && (v + 1.0).abs() < 2e-3, "{u} {v}");
    // After the last file it stands still.
    assert_eq!(moved("2"), [0.0, 0.0]);
    write(d.path(), "m.0002.obj", square(3.0, -2.0) + "f 1 2 3\n");
    let run = yarnray(d.path(), &["render", "s.toml", "-q", "--frames", "1", "-o", "out.exr"]);
    assert_eq!(run.status, Some(2));
    assert!(
        run.stderr.contains("m.0002.obj: 4 points and 3 triangles, where the frame before has 4 and 2"),
        "{}",
        run.stderr
    );
}

#[test]
fn texture_coordinates_run_over_the_cloth_as_a_tint_does() {
    for mode in ["yarn", "ply", "fiber"] {
        let view = "type = \"frame\"\ndirection = [0, 0, 1]\nprojection = \"orthographic\"";
        let source = "type = \"weave\", draft = \"plain\", warps = 12, wefts = 10, edges = \"live\"";
        let picture = render(&scene(view, "[\"uv\", \"position\"]", source), &["--mode", mode]).image;
        let channel = |name: &str| picture.channel(name).expect("the channel");
        let (alpha, u, v) = (channel("A"), channel("uv.U"), channel("uv.V"));
        let mut sums = [[0.0_f64; 5]; 2];
        let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for i in (0..alpha.len()).filter(|&i| alpha[i] == 1.0) {
            for ((sums, ends), (uv, axis)) in sums.iter_mut().zip(&mut ends).zip([(u[i], "P.X"), (v[i], "P.Y")]) {
                let (uv, at) = (f64::from(uv), f64::from(channel(axis)[i]));
                *ends = [ends[0].min(at), ends[1].max(at)];
                assert!((-0.05..1.05).contains(&uv), "{mode}: {uv}");
                let more = [1.0, uv, at, uv * at, at * at];
                sums.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
            }
        }
        for ([n, uv, at, both, square], [from, to]) in sums.into_iter().zip(ends) {
            // The slope of coordinates over places: one over the cloth's size.
            let slope = (both - uv * at / n) / (square - at * at / n);
            let (size, seen) = (1.0 / slope, to - from);
            assert!(
                n > 500.0 && (size / seen - 1.0).abs() < 0.08,
                "{mode}: {n} pixels, as if {size} mm wide, not {seen}"
            );
            // Evenly over it: the mean is near the middle.
            assert!((uv / n - 0.5).abs() < 0.03, "{mode}: mean {}", uv / n);
        }
    }
}
