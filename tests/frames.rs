//! Sequences: numbered files, moving cameras and yarns, and what the shutter makes of them.

use std::path::Path;

use yarnray::{
    cloth::Cloth,
    image::{self, Image},
    scene::load::{LoadOptions, load},
    trace::CurveGeometry,
};

use crate::support::{SWATCH, directory, listing, write, yarnray};

/// A yarn of two plies across an even sky, and what the test adds.
fn scene(camera: &str, source: &str) -> String {
    format!(
        r#"
[render]
width = 32
height = 24
spp = 64
filter = "box"

[output]
layers = ["normal"]

[camera]
{camera}

[fiber.wool]
r = 0.1
tt = 0.3
d = 0.3
beta_r = 10
beta_tt = 10
beta_n = 25

[yarn.two]
radius = 1
plies = 2
ply_twist = 30
fiber = "wool"
fibers = 50
density = 0.5
fiber_twist = 20

[[fabric]]
yarn = "two"
phase = 20
source = {{ {source} }}

[[light]]
type = "environment"
"#
    )
}

/// A straight yarn of some length along x, at a height.
fn straight(length: f64, y: f64) -> String {
    (0..=40).map(|i| format!("{} {y} 0\n", length * (f64::from(i) / 40.0 - 0.5))).collect()
}

#[track_caller]
fn render(directory: &Path, args: &[&str]) -> Image {
    yarnray(directory, &[&["render", "s.toml", "-q", "-o", "out.exr"], args].concat()).good();
    image::read(&directory.join("out.exr")).expect("a picture")
}

fn channel<'a>(image: &'a Image, name: &str) -> &'a [f32] {
    image.channel(name).expect("the channel")
}

/// The root of the mean square difference of a channel.
fn difference(a: &Image, b: &Image, name: &str) -> f64 {
    let (a, b) = (channel(a, name), channel(b, name));
    let sum: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    (sum / a.len() as f64).sqrt()
}

/// The mean of pictures.
fn average(images: &[Image]) -> Image {
    let mut mean = images[0].clone();
    for (c, channel) in mean.channels.iter_mut().enumerate() {
        for (i, sample) in channel.samples.iter_mut().enumerate() {
            *sample = images.iter().map(|image| image.channels[c].samples[i]).sum::<f32>() / images.len() as f32;
        }
    }
    mean
}

#[test]
fn frames_are_written_under_their_numbers() {
    let directory = directory();
    let d = directory.path();
    write(d, "s.toml", SWATCH);
    let args = ["render", "s.toml", "-q", "--spp", "1", "--frames", "8..10", "-o", "a.###.exr", "-o", "{frame}/b.png"];
    yarnray(d, &[&args[..], &["--stats", "s{frame}.json"]].concat()).good();
    let files = ["10", "8", "9", "a.008.exr", "a.009.exr", "a.010.exr", "s.toml", "s10.json", "s8.json", "s9.json"];
    assert_eq!(listing(d), files);
    assert_eq!(listing(&d.join("9")), ["b.png"]);
    assert_eq!(crate::support::read_json(&d.join("s9.json"))["frame"], 9);
    // Each frame has noise of its own, and the same one however it is reached.
    let read = |name: &str| image::read(&d.join(name)).unwrap().channels;
    assert!(read("a.008.exr") != read("a.009.exr"));
    let alone = ["render", "s.toml", "-q", "--spp", "1", "--frames", "9", "-o", "alone.exr"];
    yarnray(d, &alone).good();
    assert!(read("alone.exr") == read("a.009.exr"));
    let run = yarnray(d, &["render", "s.toml", "--frames", "1..2", "-o", "a.exr"]);
    assert_eq!(run.status, Some(2));
    assert_eq!(run.stderr, "error: --frames would write every frame to a.exr: put #### or {frame} into its name\n");
    for bad in ["2..1", "x", "1..", "-1..3"] {
        let run = yarnray(d, &["render", "s.toml", &format!("--frames={bad}"), "-o", "a.#.exr"]);
        assert_eq!(run.status, Some(2), "{bad}");
        assert!(run.stderr.contains("the first and the last of several, as in 1..24"), "{}", run.stderr);
    }
}

#[test]
fn keys_move_the_camera_and_a_turntable_turns_it() {
    let directory = directory();
    let d = directory.path();
    let source = "type = \"straight\", length = 6";
    let keyed = "type = \"perspective\"\nposition = [0, 0, 9]\nfov = 40\n\
                 [[camera.key]]\nframe = 1\nposition = [0, 0, 12]\nfov = 40\n\
                 [[camera.key]]\nframe = 5\nposition = [3, 1, 8]\ntarget = [0.5, 0, 0]\n\
                 [[camera.key]]\nframe = 9\nposition = [0, 0, 12]\nfov = 50\n";
    write(d, "s.toml", scene(keyed, source));
    let at_key = render(d, &["--frames", "5"]);
    let stands = "type = \"perspective\"\nposition = [3, 1, 8]\ntarget = [0.5, 0, 0]\nfov = 45\n";
    write(d, "s.toml", scene(stands, source));
    let there = render(d, &["--frames", "5"]);
    assert!(difference(&at_key, &there, "A") < 1e-3, "{}", difference(&at_key, &there, "A"));
    // Whoever says where it stands need not name its type.
    write(d, "s.toml", scene(&stands.replace("type = \"perspective\"\n", ""), source));
    assert_eq!(difference(&render(d, &["--frames", "5"]), &there, "A"), 0.0);
    // Most of a quarter of a turn later, the camera looks nearly along the yarn.
    let turning = "direction = [0, 0, 1]\n[camera.turntable]\nframes = 20\n";
    write(d, "s.toml", scene(turning, source));
    let wide = |image: &Image| {
        let alpha = channel(image, "A");
        (0..32).filter(|x| (0..24).any(|y| alpha[y * 32 + x] > 0.0)).count()
    };
    let [start, later, half] = ["1", "5", "11"].map(|frame| wide(&render(d, &["--frames", frame])));
    assert!(start > 20 && (5..15).contains(&later), "{start} and {later} columns");
    assert!(start.abs_diff(half) <= 1, "{start} and {half} columns");
}

#[test]
fn a_shutter_blurs_what_the_camera_does_meanwhile() {
    let directory = directory();
    let d = directory.path();
    let source = "type = \"straight\", length = 4";
    let camera = |more: &str| {
        format!(
            "type = \"perspective\"\nposition = [0, 0, 12]\nfov = 40\n{more}\n\
             [[camera.key]]\nframe = 1\nposition = [0, 0, 12]\ntarget = [0, 0, 0]\n\
             [[camera.key]]\nframe = 2\nposition = [3, 2, 12]\ntarget = [3, 2, 0]\n"
        )
    };
    write(d, "s.toml", scene(&camera("shutter = [0, 1]"), source));
    let blurred = render(d, &["--frames", "1", "--stats", "s.json"]);
    let stats = crate::support::read_json(&d.join("s.json"));
    let used = |name: &str| stats["used"].as_array().unwrap().iter().any(|n| n == name);
    assert!(used("camera_motion") && !used("yarn_motion"));
    // The same as many pictures along the way.
    let steps: Vec<Image> = (0..16)
        .map(|i| {
            let s = (f64::from(i) + 0.5) / 16.0;
            let here = format!("[{}, {}, 12]\ntarget = [{}, {}, 0]", 3.0 * s, 2.0 * s, 3.0 * s, 2.0 * s);
            write(d, "s.toml", scene(&format!("type = \"perspective\"\nposition = {here}\nfov = 40"), source));
            render(d, &["--spp", "8"])
        })
        .collect();
    let want = average(&steps);
    assert!(difference(&blurred, &want, "A") < 0.06, "{}", difference(&blurred, &want, "A"));
    assert!(difference(&steps[0], &want, "A") > 0.15, "{}", difference(&steps[0], &want, "A"));
    // A camera that stands still costs nothing and changes nothing.
    let still = "type = \"perspective\"\nposition = [0, 0, 12]\nfov = 40\n";
    write(d, "s.toml", scene(still, source));
    let plain = render(d, &[]);
    write(d, "s.toml", scene(&format!("{still}shutter = [0, 1]\n"), source));
    assert!(render(d, &[]).channels == plain.channels);
}

#[test]
fn yarns_blur_as_they_would_for_a_camera_that_moves_the_other_way() {
    let directory = directory();
    let d = directory.path();
    write(d, "y.0001.txt", straight(20.0, 0.0));
    write(d, "y.0002.txt", straight(20.0, 2.5));
    let still = "type = \"orthographic\"\nposition = [0, 1, 12]\ntarget = [0, 1, 0]\nsize = 8\n";
    let numbered = "type = \"file\", path = \"y.####.txt\"";
    write(d, "s.toml", scene(&format!("{still}shutter = [0, 1]"), numbered));
    let yarn = render(d, &["--frames", "1", "--stats", "s.json"]);
    let stats = crate::support::read_json(&d.join("s.json"));
    assert!(stats["used"].as_array().unwrap().iter().any(|n| n == "yarn_motion"));
    write(d, "y.txt", straight(20.0, 0.0));
    let moving = format!(
        "{still}shutter = [0, 1]\n[[camera.key]]\nframe = 1\nposition = [0, 1, 12]\ntarget = [0, 1, 0]\n\
         [[camera.key]]\nframe = 2\nposition = [0, -1.5, 12]\ntarget = [0, -1.5, 0]\n"
    );
    write(d, "s.toml", scene(&moving, "type = \"file\", path = \"y.txt\""));
    let camera = render(d, &["--frames", "1"]);
    for name in ["A", "G", "N.Y"] {
        assert!(difference(&yarn, &camera, name) < 0.02, "{name}: {}", difference(&yarn, &camera, name));
    }
    let alpha = channel(&yarn, "A");
    assert!(alpha.iter().any(|a| (0.2..0.8).contains(a)), "it is blurred");
    // Without a shutter the sequence stands still at its frame; after its last file as well.
    write(d, "s.toml", scene(still, numbered));
    let sharp = render(d, &["--frames", "2"]);
    write(d, "s.toml", scene(&format!("{still}shutter = [0, 1]"), numbered));
    assert!(render(d, &["--frames", "2"]).channels == sharp.channels);
}

#[test]
fn plies_move_with_a_yarn_that_stretches() {
    let directory = directory();
    let d = directory.path();
    // Stretched by half and lifted, with its points where they were on the yarn.
    write(d, "y.0003.txt", straight(20.0, 0.0));
    write(d, "y.0004.txt", straight(30.0, 2.0));
    let camera = "type = \"orthographic\"\nposition = [0, 0, 12]\nsize = 8\nshutter = [0, 0.5]";
    let phases = |source: &str, frame: u32| -> Vec<(f32, f32)> {
        let path = write(d, "s.toml", scene(camera, source));
        let options = LoadOptions { assignments: vec![format!("render.frame={frame}")], ..LoadOptions::default() };
        let scene = load(&path, &options).unwrap();
        let (cloth, _) = Cloth::new(&scene, 1).unwrap();
        let CurveGeometry::Yarns(yarns) = &cloth.world().geometries()[0] else { panic!("yarns") };
        let (low, high) = scene.bounds().unwrap();
        let segments = yarns.strands.segments().len() as u32;
        // The phase, and the share of the yarn at which it is.
        let ends = (low.x as f32 + 1.0, high.x as f32 - 1.0);
        (0..segments)
            .map(|i| {
                let place = yarns.strands.frame(i, 0.5);
                ((place.centre.x - ends.0) / (ends.1 - ends.0), place.phase)
            })
            .collect()
    };
    let numbered = "type = \"file\", path = \"y.####.txt\"";
    let (before, after) = (phases(numbered, 3), phases(numbered, 4));
    // Both wind evenly, at the same rate along the yarn as it was made.
    let turn = |phases: &[(f32, f32)], share: f32| {
        *phases.iter().min_by(|a, b| (a.0 - share).abs().total_cmp(&(b.0 - share).abs())).unwrap()
    };
    let rate = 20.0 * 30f32.to_radians().tan() / 0.5;
    for i in 1..10 {
        let share = i as f32 / 10.0;
        let ((s0, p0), (s1, p1)) = (turn(&before, share), turn(&after, share));
        let off = p1 - p0 - rate * (s1 - s0);
        let off = off - std::f32::consts::TAU * (off / std::f32::consts::TAU).round();
        assert!(off.abs() < 0.02, "at {share}: {off} radians off");
    }
    // By its own length the plies of the stretched yarn would have slid along.
    let own = phases("type = \"file\", path = \"y.0004.txt\"", 4);
    let slid = (1..10).any(|i| {
        let ((s0, p0), (s1, p1)) = (turn(&before, i as f32 / 10.0), turn(&own, i as f32 / 10.0));
        let off = p1 - p0 - rate * (s1 - s0);
        (off - std::f32::consts::TAU * (off / std::f32::consts::TAU).round()).abs() > 0.3
    });
    assert!(slid);
}

#[test]
fn sequences_that_do_not_fit_together_say_why() {
    let directory = directory();
    let d = directory.path();
    write(d, "y.1.txt", straight(20.0, 0.0));
    write(d, "y.2.txt", "0 0 0\n1 0 0\n2 0 0\n");
    let camera = "type = \"perspective\"\nposition = [0, 0, 12]\nshutter = [0, 0.5]";
    write(d, "s.toml", scene(camera, "type = \"file\", path = \"y.#.txt\""));
    let refused = |args: &[&str], parts: &[&str]| {
        let run = yarnray(d, &[&["render", "s.toml", "-q", "-o", "o.exr"], args].concat());
        assert_eq!(run.status, Some(2), "{}", run.stderr);
        for part in parts {
            assert!(run.stderr.contains(part), "{part}: {}", run.stderr);
        }
        assert!(!d.join("o.exr").exists());
    };
    refused(
        &["--frames", "1"],
        &[
            "y.2.txt: curve 0 is not as in another frame: 3 points, open, there 41 points, open",
            "yarns keep their points",
        ],
    );
    refused(&["--frames", "7"], &["y.7.txt: no such file"]);
    // Curves of a stage come and go from frame to frame, not while the shutter is open.
    let curve = |name: &str, y: u32, more: &str| {
        format!(
            "def BasisCurves \"{name}\" {{\nuniform token type = \"linear\"\nint[] curveVertexCounts = [2]\n\
             point3f[] points = [(-5,{y},0), (5,{y},0)]\nfloat[] widths = [1, 1]\n{more}}}\n"
        )
    };
    let hidden = "token visibility.timeSamples = { 1: \"invisible\", 3: \"inherited\" }\n";
    write(d, "shot.usda", format!("#usda 1.0\n{}{}", curve("a", 0, ""), curve("b", 1, hidden)));
    write(d, "t.toml", scene(camera, "type = \"file\", path = \"shot.usda\""));
    let frame = |number: &str| yarnray(d, &["render", "t.toml", "-o", "t.exr", "--frames", number]);
    let told = frame("3").good().stderr;
    assert!(told.contains("in its first frame 1 curves, where another frame has 2: plies wind as in"), "{told}");
    let told = frame("2..2").good().stderr;
    assert!(!told.contains("curves, where"), "{told}");
    write(d, "t.toml", scene(&camera.replace("0.5]", "1.5]"), "type = \"file\", path = \"shot.usda\""));
    let told = frame("2");
    assert_eq!(told.status, Some(2));
    assert!(told.stderr.contains("shot.usda: at frame 3.125: 2 curves, where another frame has 1"), "{}", told.stderr);
    // Of several frames before the first is rendered.
    write(d, "y.2.txt", straight(20.0, 1.0));
    write(d, "y.4.txt", straight(20.0, 3.0));
    let run = yarnray(d, &["render", "s.toml", "-q", "-o", "o.#.exr", "--frames", "1..6"]);
    assert_eq!(run.status, Some(2), "{}", run.stderr);
    assert!(run.stderr.contains("y.3.txt: no such file, and 2 others of frames 1 to 6\n"), "{}", run.stderr);
    assert!(!d.join("o.1.exr").exists());
}
