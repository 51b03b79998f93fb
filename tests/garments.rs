//! Garments from outside: cloth that moves with its mesh, prints, seams, and what cannot be laid.

use std::{fmt::Write as _, path::Path};

use glam::{DMat3, DVec3, Vec3};
use yarnray::{
    cloth::Cloth,
    scene::{
        Fabric, Scene,
        load::{LoadOptions, load},
    },
    trace::CurveGeometry,
};

use crate::support::{directory, shared, write, yarnray};

type Point = [f64; 3];

/// Two panels of 80 x 80 mm, sewn side by side and placed in space by `at`.
fn mesh(at: &dyn Fn(f64, f64) -> Point) -> String {
    const CELLS: usize = 8;
    let mut text = String::new();
    for (panel, name) in ["left", "right"].into_iter().enumerate() {
        for j in 0..=CELLS {
            for i in 0..=CELLS {
                let (u, v) = (10.0 * i as f64, 10.0 * j as f64);
                let [x, y, z] = at(80.0 * panel as f64 + u, v);
                writeln!(text, "v {x} {y} {z}\nvt {} {v}", 200.0 * panel as f64 + u).unwrap();
            }
        }
        writeln!(text, "g {name}").unwrap();
        for j in 0..CELLS {
            for i in 0..CELLS {
                let a = (CELLS + 1) * ((CELLS + 1) * panel + j) + i + 1;
                let corners = [a, a + 1, a + CELLS + 2, a + CELLS + 1].map(|c| format!("{c}/{c}"));
                writeln!(text, "f {}", corners.join(" ")).unwrap();
            }
        }
    }
    text
}

fn flat(u: f64, v: f64) -> Point {
    [u, v, 0.0]
}

/// Turned about a slanting axis and moved, as it is.
fn turned(u: f64, v: f64) -> Point {
    let (s, c) = 0.7_f64.sin_cos();
    let [x, y, z] = [c * u - s * v, s * u + c * v, 0.0];
    [x + 30.0, c * y - s * z, s * y + c * z - 20.0]
}

/// Bent: about as long as before.
fn bent(u: f64, v: f64) -> Point {
    [u, v, 8.0 * (u / 30.0).sin()]
}

/// A garment of loops of 4 x 3 mm, and what the test adds.
fn scene(source: &str, fabric: &str, camera: &str) -> String {
    format!(
        "[render]\nwidth = 32\nheight = 24\nspp = 4\n[camera]\n{camera}\n\
         [fiber.wool]\nr = 0.1\ntt = 0.3\nd = 0.3\nbeta_r = 10\nbeta_tt = 10\nbeta_n = 25\n\
         [yarn.two]\nradius = 0.6\nplies = 2\nply_twist = 20\nfiber = \"wool\"\nfibers = 50\ndensity = 0.5\n\
         [yarn.dark]\nradius = 0.6\nplies = 2\nply_twist = 20\nfiber = \"wool\"\nfibers = 50\ndensity = 0.5\n\
         [[fabric]]\nyarn = \"two\"\ngauge = [25, 33.3333]\n{fabric}\n\
         source = {{ type = \"garment\", unit = \"mm\", cloth = {{ type = \"knit\", pattern = \"stockinette\" }}, {source} }}\n\
         [[light]]\ntype = \"environment\"\n"
    )
}

const STILL: &str = "type = \"perspective\"\nposition = [80, 40, 300]\ntarget = [80, 40, 0]";

fn at_frame(path: &Path, frame: u32) -> Scene {
    let options = LoadOptions { assignments: vec![format!("render.frame={frame}")], ..LoadOptions::default() };
    load(path, &options).unwrap_or_else(|e| panic!("{e}"))
}

/// All control points of a scene, of each yarn, in the scene's own space.
fn points(scene: &Scene) -> Vec<Vec<Point>> {
    let place = |p: &glam::DVec3| (*p + scene.middle).to_array();
    scene.fabrics.iter().flat_map(|f| &f.curves).map(|(curve, _)| curve.points.iter().map(place).collect()).collect()
}

/// From where to where a fabric goes along x.
fn across(scene: &Scene, fabric: &Fabric) -> [f64; 2] {
    let points = fabric.curves.iter().flat_map(|(curve, _)| &curve.points);
    points
        .map(|p| p.x + scene.middle.x)
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

/// For each yarn whether it is closed, and the phase of the plies in the middle of each segment.
fn phases(scene: &Scene) -> Vec<(bool, Vec<f32>)> {
    let (cloth, _) = Cloth::new(scene, 1).unwrap();
    let closed = scene.fabrics.iter().map(|f| f.curves.iter().map(|(curve, _)| curve.closed).collect::<Vec<_>>());
    let of = |(geometry, closed): (&CurveGeometry, Vec<bool>)| {
        let CurveGeometry::Yarns(yarns) = geometry else { panic!("yarns") };
        let phase = |i: u32| yarns.strands.frame(i, 0.5).phase;
        let yarn = |(yarn, closed): (usize, bool)| (closed, yarns.strands.segments_of(yarn).map(phase).collect());
        closed.into_iter().enumerate().map(yarn).collect::<Vec<_>>()
    };
    cloth.world().geometries().iter().zip(closed).flat_map(of).collect()
}

fn distance(a: Point, b: Point) -> f64 {
    [0, 1, 2].map(|k| (a[k] - b[k]).powi(2)).iter().sum::<f64>().sqrt()
}

/// Frames as files: at rest, bent, and turned as a whole.
fn three_frames(d: &Path) {
    for (number, at) in [(1, &flat as &dyn Fn(f64, f64) -> Point), (2, &bent), (3, &turned)] {
        write(d, &format!("g.{number:04}.obj"), mesh(at));
    }
}

#[test]
fn stitches_go_with_the_cloth_and_plies_keep_their_places() {
    let folder = directory();
    let d = folder.path();
    three_frames(d);
    let path = write(d, "s.toml", scene("path = \"g.####.obj\"", "vary = { tension = 0.04 }", STILL));
    let [rest, bent_one, turned_one] = [1, 2, 3].map(|frame| at_frame(&path, frame));
    let [a, b, c] = [&rest, &bent_one, &turned_one].map(points);
    let count = |yarns: &[Vec<Point>]| yarns.iter().map(Vec::len).collect::<Vec<_>>();
    assert!(count(&a) == count(&b) && count(&a) == count(&c));
    assert!(a.iter().map(Vec::len).sum::<usize>() > 10_000);
    // Cloth that is turned as a whole takes its yarns with it as they are.
    let mut worst = [0.0_f64; 2];
    for ((p, q), r) in a.iter().flatten().zip(b.iter().flatten()).zip(c.iter().flatten()) {
        let [u, v, w] = *p;
        let [x, y, z] = turned(u, v);
        let (sin, cos) = 0.7_f64.sin_cos();
        // The normal is turned about x only.
        worst[0] = worst[0].max(distance(*r, [x, y - w * sin, z + w * cos]));
        // Where it bends each point stays over its place of the panel: aside by no more than its height times the slope.
        let [_, _, height] = bent(u, v);
        worst[1] = worst[1].max(distance(*q, [u, v, height + w]) - 8.0 / 30.0 * w.abs());
    }
    assert!(worst[0] < 2e-3, "{worst:?}");
    assert!(worst[1] < 0.5, "{worst:?}");
    // Plies wind as at rest: by the same angle at each place of a yarn. One that is closed comes back turned as it bends, and
    // that is spread over all of it.
    let [a, b, c] = [&rest, &bent_one, &turned_one].map(phases);
    assert!(a.iter().map(|yarn| yarn.1.len()).sum::<usize>() > 10_000);
    let slid = |other: &[(bool, Vec<f32>)], closed: bool| {
        let yarns = a.iter().zip(other).filter(|(x, _)| x.0 == closed);
        let pairs = yarns.flat_map(|(x, y)| x.1.iter().zip(&y.1));
        let off = |(x, y): (&f32, &f32)| ((x - y) / std::f32::consts::TAU).fract().abs();
        pairs.map(off).map(|turns| turns.min(1.0 - turns)).fold(0.0, f32::max)
    };
    assert!(slid(&b, false) < 1e-3 && slid(&c, false) < 1e-3, "{} {}", slid(&b, false), slid(&c, false));
    assert!(slid(&b, true) < 0.2 && slid(&c, true) < 1e-3, "{} {}", slid(&b, true), slid(&c, true));
}

/// The triangles of a mesh file of centimetres, in millimetres.
fn triangles(path: &Path) -> Vec<[DVec3; 3]> {
    let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let (parts, _) = tobj::load_obj(path, &options).unwrap();
    let of_part = |tobj::Model { mesh, .. }: tobj::Model| {
        let corner = |i: u32| 10.0 * Vec3::from_slice(&mesh.positions[3 * i as usize..]).as_dvec3();
        mesh.indices.chunks_exact(3).map(|face| [0, 1, 2].map(|k| corner(face[k]))).collect::<Vec<_>>()
    };
    parts.into_iter().flat_map(of_part).collect()
}

fn middle([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (a + b + c) / 3.0
}

/// Two edges of a triangle and its normal.
fn axes([a, b, c]: &[DVec3; 3]) -> DMat3 {
    DMat3::from_cols(b - a, c - a, (b - a).cross(c - a).normalize())
}

/// Frames of a simulated pullover in which its arms rise fastest: yarns are laid in each frame for itself, out of the body and
/// let out where they are pressed, and go on with the cloth all the same.
#[test]
fn stitches_of_a_worn_pullover_do_not_jump() {
    let Some(folder) = shared("data/garments/pullover_anim") else { return };
    let file = |name: &str| folder.join(format!("{name}.####.obj")).to_str().unwrap().replace('\\', "/");
    let source = format!("path = \"{}\", body = \"{}\"", file("pullover"), file("mannequin"));
    let own = directory();
    let text = scene(&source, "", STILL).replace("unit = \"mm\"", "unit = \"cm\"");
    let path = write(own.path(), "s.toml", text);
    let frames: Vec<Vec<Point>> = (5..8).map(|k| points(&at_frame(&path, k)).concat()).collect();
    assert!(frames[0].len() > 500_000 && frames.iter().all(|f| f.len() == frames[0].len()));
    let meshes: Vec<Vec<[DVec3; 3]>> =
        (5..8).map(|k| triangles(&folder.join(format!("pullover.{k:04}.obj")))).collect();
    for (yarns, cloth) in frames.windows(2).zip(meshes.windows(2)) {
        let [before, after] = cloth else { panic!("two frames") };
        let middles: Vec<DVec3> = before.iter().map(middle).collect();
        // How far a point is from where it would be if it went with the triangle that is nearest to it.
        let off = |(p, q): (&Point, &Point)| {
            let [p, q] = [*p, *q].map(DVec3::from_array);
            let far = |face: &usize| middles[*face].distance_squared(p);
            let nearest = (0..middles.len()).min_by(|a, b| far(a).total_cmp(&far(b))).unwrap();
            let (from, to) = (&before[nearest], &after[nearest]);
            (middle(to) + axes(to) * (axes(from).inverse() * (p - middle(from)))).distance(q)
        };
        let mut all: Vec<f64> = yarns[0].iter().zip(&yarns[1]).step_by(61).map(off).collect();
        all.sort_by(f64::total_cmp);
        let share = |below: f64| all[(below * (all.len() - 1) as f64) as usize];
        let told = format!("{:.3} {:.2} {:.2} {:.1}", share(0.5), share(0.99), share(0.999), share(1.0));
        assert!(share(0.5) < 0.05 && share(0.99) < 1.6 && share(0.999) < 4.5 && share(1.0) < 12.0, "{told}");
    }
}

#[test]
fn the_shutter_sees_the_cloth_on_its_way() {
    let folder = directory();
    let d = folder.path();
    write(d, "g.0001.obj", mesh(&flat));
    write(d, "g.0002.obj", mesh(&|u, v| [u, v, 12.0]));
    let camera = format!("{STILL}\nshutter = [0, 0.5]");
    let path = write(d, "s.toml", scene("path = \"g.####.obj\"", "", &camera));
    let scene = at_frame(&path, 1);
    let motion = &scene.fabrics[0].motion;
    let lowest = |yarns: &[Vec<glam::DVec3>]| yarns.iter().flatten().map(|p| p.z).fold(f64::MAX, f64::min);
    let open: Vec<Vec<glam::DVec3>> = scene.fabrics[0].curves.iter().map(|(c, _)| c.points.clone()).collect();
    let last = motion.later.last().expect("it moves");
    let risen = lowest(last) - lowest(&open);
    assert!((risen - 6.0).abs() < 1e-3, "{risen}");
    // What is around follows by the number of the frame as well.
    let mut text = scene_with_body(&camera);
    text = text.replace("BODY", "g.####.obj");
    let path = write(d, "with.toml", text);
    let highest = |frame| at_frame(&path, frame).objects[0].mesh.points.iter().map(|p| p.z).fold(f64::MIN, f64::max);
    let body = [1, 2].map(|frame| highest(frame) + at_frame(&path, frame).middle.z);
    assert!((body[1] - body[0] - 12.0).abs() < 1e-6, "{body:?}");
}

fn scene_with_body(camera: &str) -> String {
    scene("path = \"g.####.obj\"", "", camera) + "[[mesh]]\npath = \"BODY\"\nunit = \"mm\"\n"
}

#[test]
fn a_frame_of_another_mesh_is_named() {
    let folder = directory();
    let d = folder.path();
    three_frames(d);
    let shorter = mesh(&flat);
    let shorter = shorter.trim_end().rsplit_once('\n').unwrap().0;
    write(d, "g.0002.obj", shorter);
    write(d, "s.toml", scene("path = \"g.####.obj\"", "", STILL));
    let run = yarnray(d, &["render", "s.toml", "-q", "--frames", "2", "-o", "o.png"]);
    assert_eq!(run.status, Some(2), "{}", run.stderr);
    assert!(run.stderr.contains("g.0002.obj: 254 triangles, where the first frame has 256"), "{}", run.stderr);
    assert!(!d.join("o.png").exists());
    // A number that is not there.
    let run = yarnray(d, &["render", "s.toml", "-q", "--frames", "9", "-o", "o.png"]);
    assert!(run.status == Some(2) && run.stderr.contains("g.0009.obj"), "{}", run.stderr);
}

#[test]
fn motifs_are_placed_by_lengths() {
    let folder = directory();
    let d = folder.path();
    write(d, "g.obj", mesh(&flat));
    // Two stitches of 4 x 3 mm, 40 mm from the left and 30 from below.
    let motif = "motif = { rows = [\"##\"], yarns = { \"#\" = \"dark\" }, place = [40, 30], repeat = \"none\" }";
    // Floats would lead the dark yarn from edge to edge.
    let printed = "cloth = { type = \"knit\", color_work = \"printed\" }";
    let own = format!("[[fabric.panel]]\ngroup = \"left\"\n{printed}\n{motif}");
    let source = "path = \"g.obj\"";
    let path = write(d, "s.toml", scene(source, "", STILL).replace("[[light]]", &format!("{own}\n[[light]]")));
    let scene = load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let mut dark = Vec::new();
    for fabric in &scene.fabrics {
        let is_dark = |i: &u16| fabric.variants.get(usize::from(*i)).is_some_and(|y| y.name == "dark");
        for ((curve, _), indices) in fabric.curves.iter().zip(&fabric.material_indices) {
            let steps = indices.len() / curve.points.len().max(2) + 1;
            let places = indices.iter().enumerate().filter(|(_, i)| is_dark(i));
            dark.extend(
                places.map(|(k, _)| curve.points[(k / steps.max(1)).min(curve.points.len() - 1)] + scene.middle),
            );
        }
    }
    assert!(!dark.is_empty());
    let middle = dark.iter().sum::<glam::DVec3>() / dark.len() as f64;
    // Within a stitch and what is left for the edge.
    assert!((middle.x - 44.0).abs() < 5.0 && (middle.y - 31.5).abs() < 5.0, "{middle}");
    // Not elsewhere, and not on the other panel.
    assert!(dark.iter().all(|p| (p.x - 44.0).abs() < 10.0 && (p.y - 31.5).abs() < 8.0));
}

#[test]
fn cloth_that_has_no_room_is_an_error() {
    let folder = directory();
    let d = folder.path();
    write(d, "g.obj", mesh(&flat));
    write(d, "s.toml", scene("path = \"g.obj\", scale = 0.02", "", STILL));
    let run = yarnray(d, &["make", "garment", "s.toml", "-o", "y.txt"]);
    assert_eq!(run.status, Some(2), "{}", run.stderr);
    // Each panel is 80 x 80 mm without the scale.
    let told = "no panel has room for a stitch of 4.000 x 3.000 mm: the largest has an area of 2.560 mm2";
    assert!(run.stderr.contains(told), "{}", run.stderr);
    assert!(!d.join("y.txt").exists());
}

#[test]
fn info_says_which_panels_stand_on_their_heads() {
    let folder = directory();
    let d = folder.path();
    let down = |at: &dyn Fn(f64, f64) -> Point, fabric: &str| {
        write(d, "g.obj", mesh(at));
        write(d, "s.toml", scene("path = \"g.obj\"", fabric, STILL));
        let told = yarnray(d, &["info", "s.toml"]).good().stdout;
        told.lines().find(|l| l.contains("go down")).map(str::to_owned)
    };
    let told = down(&|u, v| [-u, -v, 0.0], "").unwrap();
    assert!(told.contains("2 panels with wales that go down") && told.contains("`left`"), "{told}");
    assert_eq!(down(&|u, v| [-u, -v, 0.0], "grain = 180"), None);
    assert_eq!(down(&flat, ""), None);
    assert_eq!(down(&|u, v| [u, 0.0, -v], ""), None);
}

#[test]
fn info_tells_how_much_is_stretched_and_compressed() {
    let folder = directory();
    let d = folder.path();
    for (across, stretched, compressed) in [(0.8, 0.0, 1.0), (1.2, 1.0, 0.0), (1.0, 0.0, 0.0)] {
        write(d, "g.obj", mesh(&|u, v| [across * u, v, 0.0]));
        write(d, "s.toml", scene("path = \"g.obj\", uv_unit = \"mm\"", "", STILL));
        let told = yarnray(d, &["info", "s.toml"]).good().stdout;
        let range = format!("{:.3} to {:.3} (5 to 95 % of the cloth)", f64::min(across, 1.0), f64::max(across, 1.0));
        let shares = format!(
            "{:.1} % of the cloth is stretched by more than a tenth, {:.1} % is compressed by more than a tenth\n",
            100.0 * stretched,
            100.0 * compressed
        );
        assert!(told.contains(&range) && told.contains(&shares), "{told}");
        let json = yarnray(d, &["info", "s.toml", "--json"]).good().stdout;
        let json = serde_json::from_str::<serde_json::Value>(&json).unwrap()["garments"][0].clone();
        let found = ["stretched", "compressed"].map(|key| json[key].as_f64());
        assert_eq!(found, [Some(stretched), Some(compressed)], "{json}");
    }
}

/// `info` lays nothing, but reads the body: one that is not there is an error, one with a rim a warning, in words of its own.
#[test]
fn a_body_is_looked_at_before_yarns_are_laid() {
    let folder = directory();
    let d = folder.path();
    write(d, "m.obj", mesh(&flat));
    write(d, "s.toml", scene("path = \"m.obj\", body = \"body.obj\"", "", STILL));
    let missing = yarnray(d, &["info", "s.toml"]);
    assert!(missing.status == Some(2) && missing.stderr.contains("body.obj: no such file"), "{}", missing.stderr);
    let corners = "v 0 0 -9\nv 9 0 -9\nv 0 9 -9\nv 0 0 -18\n";
    let open = "f 1 2 3\nf 1 3 4\nf 1 4 2\n";
    write(d, "body.obj", format!("o stand\n{corners}{open}"));
    let said = yarnray(d, &["info", "s.toml"]).good().stdout;
    assert_eq!(said.matches("the body is open: 3 edges").count(), 1, "{said}");
    let said = yarnray(d, &["info", "body.obj"]).good().stdout;
    assert!(said.contains("4 vertices, 3 triangles, open at 3 edges\n  groups    `stand`\n"), "{said}");
    write(d, "body.obj", format!("o stand\n{corners}{open}f 2 4 3\n"));
    let said = yarnray(d, &["info", "s.toml"]).good().stdout;
    assert!(!said.contains("the body is open"), "{said}");
    let info: serde_json::Value =
        serde_json::from_str(&yarnray(d, &["info", "body.obj", "--json"]).good().stdout).unwrap();
    assert_eq!((&info["vertices"], &info["open_edges"], &info["uv_bounds"]), (&4.into(), &0.into(), &().into()));
}

/// Notes of what was repaired are said where a picture is made, once for all of its frames.
#[test]
fn a_render_says_once_what_was_repaired() {
    let folder = directory();
    let d = folder.path();
    let mut faces = mesh(&flat);
    // Wound the other way, it would show its wrong side.
    faces = faces.replace("f 1/1 2/2 11/11 10/10\n", "f 10/10 11/11 2/2 1/1\n");
    write(d, "g.obj", faces);
    write(d, "s.toml", scene("path = \"g.obj\"", "", STILL));
    let told = "note: 2 triangles wound against their neighbours, turned round (first in panel `left`, line 164)\n";
    let says = |args: &[&str]| {
        let run = yarnray(d, &[&["render", "s.toml", "--spp", "1"], args].concat()).good();
        run.stderr.matches(told).count()
    };
    assert_eq!(says(&["-o", "o.png"]), 1);
    assert_eq!(says(&["--frames", "1..2", "-o", "o.####.png"]), 1);
    assert_eq!(says(&["-o", "o.png", "-q"]), 0);
}

#[test]
fn panels_without_names_are_chosen_by_number() {
    let folder = directory();
    let d = folder.path();
    let nameless: String = mesh(&flat).lines().filter(|l| !l.starts_with('g')).map(|l| format!("{l}\n")).collect();
    write(d, "g.obj", nameless);
    let own = |key: &str| {
        let panel = format!("[[fabric.panel]]\n{key}\ncloth = {{ type = \"knit\", pattern = \"rib1x1\" }}\n[[light]]");
        write(d, "s.toml", scene("path = \"g.obj\"", "", STILL).replace("[[light]]", &panel));
        yarnray(d, &["info", "s.toml"])
    };
    let told = own("panel = 2").good().stdout;
    assert!(
        told.contains("  panels     1 without a name: ") && told.contains("\n             2 without a name: "),
        "{told}"
    );
    let lines: Vec<&str> = told.lines().filter(|l| l.contains(" without a name: ")).collect();
    assert!(lines[0].ends_with("of stockinette") && lines[1].ends_with("of rib1x1"), "{told}");
    assert!(told.contains(" of stockinette and rib1x1 in 2 panels"), "{told}");
    let json: serde_json::Value =
        serde_json::from_str(&yarnray(d, &["info", "s.toml", "--json"]).good().stdout).unwrap();
    assert_eq!(json["garments"][0]["panels"][1]["cloth"], "rib1x1", "{json}");
    let scene = load(&d.join("s.toml"), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let left_of = |fabric: &Fabric| across(&scene, fabric)[0];
    let [stockinette, rib] = scene.fabrics.as_slice() else { panic!("{} fabrics", scene.fabrics.len()) };
    assert!(rib.origin.ends_with("g.obj, 2, rib1x1"), "{}", rib.origin);
    assert!(left_of(stockinette) < 5.0 && left_of(rib) > 75.0, "{} {}", left_of(stockinette), left_of(rib));
    assert!(told.contains("  edges     80 mm sewn, 480 mm free, as cut\n"), "{told}");
    let refused = own("panel = 3");
    assert!(refused.stderr.contains("there is no panel 3: the garment has 2 panels"), "{}", refused.stderr);
    let hint = "the mesh has neither groups nor materials; `panel = 1` chooses by number";
    assert!(own("group = \"left\"").stderr.contains(hint));
}

/// What finishes a knitted panel ends where a woven one begins, whose edges are overcast.
#[test]
fn free_edges_are_finished_as_their_panels_are() {
    let folder = directory();
    let d = folder.path();
    write(d, "g.obj", mesh(&flat));
    let woven = "[[fabric.panel]]\ngroup = \"right\"\ncloth = { type = \"weave\", draft = \"plain\" }\n[[light]]";
    write(d, "s.toml", scene("path = \"g.obj\"", "", STILL).replacen("[[light]]", woven, 1));
    let scene = load(&d.join("s.toml"), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let [knit, weave] = scene.fabrics.as_slice() else { panic!("{} fabrics", scene.fabrics.len()) };
    let [[_, knit_ends], [weave_begins, _]] = [across(&scene, knit), across(&scene, weave)];
    assert!(knit_ends < 90.0 && weave_begins > 70.0, "{knit_ends} {weave_begins}");
}

/// A seam whose sides do not quite meet, or are divided in other ways, stays open: that is told with both panels.
#[test]
fn seams_that_stay_open_are_told() {
    let folder = directory();
    let d = folder.path();
    write(d, "s.toml", scene("path = \"g.obj\"", "", STILL));
    write(d, "g.obj", mesh(&flat));
    assert!(!yarnray(d, &["info", "s.toml"]).good().stdout.contains("not sewn"));
    // The right panel's left side: the first nine are the left panel's right one.
    write(d, "g.obj", mesh(&flat).replace("\nv 80 ", "\nv 80.02 ").replacen("v 80.02 ", "v 80 ", 9));
    let open = yarnray(d, &["info", "s.toml"]).good().stdout;
    let note = "panel `left` (number 1, line 164) and panel `right` (number 2, line 391) lie within 0.020 mm of each other along 80 mm and are not sewn";
    assert!(open.contains(note), "{open}");
    assert!(open.contains("  edges     0 mm sewn, 640 mm free, as cut\n"), "{open}");
}

/// Single precision would tell places 10 km away apart by a millimetre.
#[test]
fn garments_far_from_the_origin_are_laid_as_near_to_it() {
    let folder = directory();
    let d = folder.path();
    let laid = |by: f64| {
        write(d, "g.obj", mesh(&|u, v| [u + by, v, 0.0]));
        let path = write(d, "s.toml", scene("path = \"g.obj\"", "", STILL));
        let scene = load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let points = scene.fabrics.iter().flat_map(|f| &f.curves).flat_map(|(curve, _)| curve.points.clone());
        points.map(|p| p + scene.middle - DVec3::new(by, 0.0, 0.0)).collect::<Vec<_>>()
    };
    let (near, far) = (laid(0.0), laid(1e7));
    assert_eq!(near.len(), far.len());
    let furthest = near.iter().zip(&far).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(furthest < 1e-3, "{furthest}");
}
