//! Files made by usd-core (`tests/data/stages/make_usd.py`) against values worked out by hand.

use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3, DVec4};

use super::*;
use crate::{
    files::{
        curve_file::{self, ReadOptions},
        stage::{MeshChoice, Stage},
    },
    geometry::{
        chain::Chain,
        curve::{Basis, Curve, CurveSet},
    },
};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/stages").join(name)
}

fn open(name: &str) -> Stage {
    Stage::open(&data(name)).unwrap()
}

fn curves(stage: &Stage, pattern: &str, frame: Option<f64>) -> (CurveSet, Vec<(String, usize)>) {
    stage.curves(&PrimPattern::parse(pattern).unwrap(), frame).unwrap()
}

/// The points of the fixtures.
fn point(i: usize) -> DVec3 {
    DVec3::new(i as f64, ((i * i) % 5) as f64, ((3 * i) % 4) as f64)
}

/// The basis matrices of USD's documentation, on four values.
fn blend(basis: &str, u: f64, p: [DVec4; 4]) -> DVec4 {
    let (uu, uuu) = (u * u, u * u * u);
    let weights = match basis {
        "linear" => [1.0 - u, u, 0.0, 0.0],
        "bezier" => {
            let v = 1.0 - u;
            [v * v * v, 3.0 * u * v * v, 3.0 * uu * v, uuu]
        }
        "bspline" => [
            (1.0 - 3.0 * u + 3.0 * uu - uuu) / 6.0,
            (4.0 - 6.0 * uu + 3.0 * uuu) / 6.0,
            (1.0 + 3.0 * u + 3.0 * uu - 3.0 * uuu) / 6.0,
            uuu / 6.0,
        ],
        _ => [
            0.5 * (-u + 2.0 * uu - uuu),
            0.5 * (2.0 - 5.0 * uu + 3.0 * uuu),
            0.5 * (u + 4.0 * uu - 3.0 * uuu),
            0.5 * (uuu - uu),
        ],
    };
    (0..4).map(|i| weights[i] * p[i]).sum()
}

/// What USD means by segment `s` of a curve at `u`: position, and the radius of vertex widths.
fn meant(basis: &str, wrap: &str, points: &[DVec4], s: usize, u: f64) -> DVec4 {
    let n = points.len();
    let mut all = points.to_vec();
    if wrap == "pinned" && matches!(basis, "bspline" | "catmullRom") {
        all.insert(0, 2.0 * points[0] - points[1]);
        all.push(2.0 * points[n - 1] - points[n - 2]);
    }
    let first = if basis == "bezier" { 3 * s } else { s };
    let n = all.len();
    blend(basis, u, std::array::from_fn(|i| all[(first + i) % n]))
}

/// A little beyond the end of segment `s`, on the next one; its end where there is no next one.
fn start(basis: &str, wrap: &str, points: &[DVec4], s: usize) -> DVec4 {
    let pieces = segments(basis, wrap, points.len());
    match (s + 1 < pieces, wrap) {
        (true, _) => meant(basis, wrap, points, s + 1, 0.125),
        (false, "periodic") => meant(basis, wrap, points, 0, 0.125),
        (false, _) => meant(basis, wrap, points, s, 1.0),
    }
}

/// The same place on a curve of this program.
fn made(basis: &str, wrap: &str, curve: &Curve, s: usize, u: f64) -> DVec4 {
    let radii = curve.radii.clone().unwrap();
    if basis == "linear" {
        let at = |i: usize| curve.points[i % curve.points.len()].extend(radii[i % radii.len()]);
        return at(s).lerp(at(s + 1), u);
    }
    let chain = Chain::new(curve, &radii);
    let (segment, u) = match (basis, wrap) {
        ("bezier", _) | ("catmullRom", "nonperiodic") => (8 * s + (8.0 * u) as usize, (8.0 * u).fract()),
        ("bspline" | "catmullRom", "periodic") => ((s + 1) % curve.points.len(), u),
        _ => (s, u),
    };
    if segment == chain.segments() { chain.at(segment - 1, 1.0).at } else { chain.at(segment, u).at }
}

fn segments(basis: &str, wrap: &str, n: usize) -> usize {
    match (basis, wrap) {
        ("bezier", "periodic") => n / 3,
        ("bezier", _) => (n - 1) / 3,
        (_, "periodic") => n,
        ("linear", _) | (_, "pinned") => n - 1,
        _ => n - 3,
    }
}

#[test]
fn every_basis_wrap_and_spread_means_what_usd_means() {
    for file in ["matrix.usda", "matrix.usdc", "matrix.usdz"] {
        let stage = open(file);
        for basis in ["linear", "bezier", "bspline", "catmullRom"] {
            for wrap in ["nonperiodic", "periodic", "pinned"] {
                for spread in ["constant", "uniform", "varying", "vertex"] {
                    let name = format!("/{basis}_{wrap}_{spread}");
                    let (set, prims) = curves(&stage, &name, None);
                    assert_eq!(prims, [(name.clone(), 2)], "{file}");
                    assert_eq!((set.unit_mm, set.up_axis), (Some(10.0), Some(1)));
                    let wrap =
                        if matches!(basis, "linear" | "bezier") && wrap == "pinned" { "nonperiodic" } else { wrap };
                    let counts = if (basis, wrap) == ("bezier", "periodic") { [6, 3] } else { [7, 4] };
                    let (mut first, mut end) = (0, 0);
                    for (i, (curve, n)) in set.curves.iter().zip(counts).enumerate() {
                        assert_eq!(curve.closed, wrap == "periodic");
                        let own: Vec<DVec4> =
                            (first..first + n).map(|k| point(k).extend(0.1 + 0.05 * k as f64)).collect();
                        let pieces = segments(basis, wrap, n);
                        let ends = match wrap {
                            "pinned" => n - 2,
                            "periodic" => pieces,
                            _ => pieces + 1,
                        };
                        for (s, u) in (0..pieces).flat_map(|s| [(s, 0.0), (s, 0.5), (s, 0.99)]) {
                            let (want, got) = (meant(basis, wrap, &own, s, u), made(basis, wrap, curve, s, u));
                            // What is put through points rounds the corners of a curve between two of them.
                            let rounded = curve.basis == Basis::CatmullRom && u == 0.99;
                            let around = |d: f64| meant(basis, wrap, &own, s, 1.0 + d);
                            let step = (around(0.0) - around(-0.125)).abs()
                                + (around(0.0) - start(basis, wrap, &own, s)).abs();
                            let most = |exact: f64, step: f64| if rounded { exact + 0.15 * step } else { exact };
                            let off = (want - got).truncate().length();
                            let least = most(1e-5, step.truncate().length());
                            assert!(off < least, "{file} {name} {s} {u}: {want} {got} {least}");
                            let radius = match spread {
                                "constant" => 0.1,
                                "uniform" => 0.1 + 0.05 * i as f64,
                                "vertex" => want.w,
                                // usd-core counts as many for pinned curves as for open ones: they are spread evenly.
                                _ if wrap == "pinned" => {
                                    let along = (s as f64 + u) / pieces as f64;
                                    0.1 + 0.05 * (end as f64 + along * (ends - 1) as f64)
                                }
                                _ => {
                                    let at = |k: usize| 0.1 + 0.05 * (end + k % ends) as f64;
                                    at(s) + u * (at(s + 1) - at(s))
                                }
                            };
                            // Where varying widths jump back to the first of a ring, a spline through them is softer.
                            let last = 0.1 + 0.05 * (end + ends - 1) as f64;
                            if spread == "varying" && wrap == "periodic" && (s < 2 || s + 2 >= pieces) {
                                assert!(got.w > 0.04 && got.w < last + 0.06, "{file} {name} {s} {u}: {}", got.w);
                                continue;
                            }
                            // Radii of open Catmull-Rom curves level off in the last segment: by a sixteenth of a step.
                            let end_piece = (basis, wrap) == ("catmullRom", "pinned") && (s == 0 || s + 1 == pieces);
                            let level = if end_piece { 0.05 / 16.0 } else { 0.0 };
                            let off = (got.w - radius).abs();
                            assert!(off < most(level + 1e-5, step.w), "{file} {name} {s} {u}: {} {radius}", got.w);
                        }
                        first += n;
                        end += ends;
                    }
                }
            }
        }
    }
}

#[test]
fn transforms_visibility_and_instances_are_applied() {
    let stage = open("scene.usda");
    assert_eq!((stage.unit_mm(), stage.up_axis(), stage.frames()), (Some(1000.0), Some(2), Some([1.0, 10.0])));
    let (set, prims) = stage.curves(&PrimPattern::all(), None).unwrap();
    let names: Vec<&str> = prims.iter().map(|(name, _)| name.as_str()).collect();
    let expected = [
        "/top/arm/curve",
        "/top/free/curve",
        "/instance0/curve",
        "/instance1/curve",
        "/many/prototypes/a",
        "/many/prototypes/a",
        "/moving",
        "/dyed",
    ];
    assert_eq!(names, expected);
    let ends = |i: usize| [set.curves[i].points[0], set.curves[i].points[1]];
    let near = |got: [DVec3; 2], want: [[f64; 3]; 2]| {
        assert!(got.iter().zip(want).all(|(g, w)| g.distance(w.into()) < 1e-6), "{got:?} {want:?}");
    };
    // About (0, 1, 0): turned from +x to +y, twice as large; then moved by 10.
    near(ends(0), [[12.0, 1.0, 0.0], [12.0, 3.0, 0.0]]);
    assert!((set.curves[0].radii.as_ref().unwrap()[0] - 0.5).abs() < 1e-9);
    near(ends(1), [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0]]);
    near(ends(2), [[0.0, 20.0, 0.0], [1.0, 20.0, 0.0]]);
    near(ends(3), [[0.0, 21.0, 0.0], [1.0, 21.0, 0.0]]);
    near(ends(4), [[0.0; 3], [1.0, 0.0, 0.0]]);
    near(ends(5), [[0.0, 30.0, 0.0], [0.0, 33.0, 0.0]]);
    assert!((set.curves[5].radii.as_ref().unwrap()[1] - 0.75).abs() < 1e-3);
}

#[test]
fn instances_are_hidden_by_their_ids() {
    let folder = tempfile::tempdir().unwrap();
    let seen = |name: &str, ids: &str, hidden: &str| -> Vec<f64> {
        let path = folder.path().join(name);
        let text = format!(
            "#usda 1.0\ndef PointInstancer \"many\" {{\nrel prototypes = </many/a>\nint[] protoIndices = [0, 0, 0]\n\
             point3f[] positions = [(0,0,0), (10,0,0), (20,0,0)]\n{ids}{hidden}def BasisCurves \"a\" {{\n\
             uniform token type = \"linear\"\nint[] curveVertexCounts = [2]\npoint3f[] points = [(0,0,0), (0,1,0)]\n\
             float[] widths = [0.1, 0.1]\n}}\n}}\n"
        );
        std::fs::write(&path, text).unwrap();
        let (set, _) = Stage::open(&path).and_then(|stage| stage.curves(&PrimPattern::all(), None)).unwrap();
        set.curves.iter().map(|curve| curve.points[0].x).collect()
    };
    assert_eq!(seen("all.usda", "", ""), [0.0, 10.0, 20.0]);
    assert_eq!(seen("by_place.usda", "", "int64[] invisibleIds = [1, 7]\n"), [0.0, 20.0]);
    assert_eq!(seen("by_id.usda", "int64[] ids = [7, 8, 9]\n", "int64[] invisibleIds = [1, 7]\n"), [10.0, 20.0]);
}

/// A stage of this text.
fn of_text(text: &str) -> Stage {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stage.usda");
    std::fs::write(&path, format!("#usda 1.0\n{text}")).unwrap();
    Stage::open(&path).unwrap()
}

/// A curve, and what else stands in its prim.
fn line(name: &str, own: &str) -> String {
    format!(
        "def BasisCurves \"{name}\" {{\nuniform token type = \"linear\"\nint[] curveVertexCounts = [2]\n\
         point3f[] points = [(0,0,0), (0,1,0)]\nfloat[] widths = [0.1, 0.1]\n{own}\n}}\n"
    )
}

/// Prototypes are kept where nobody draws them: below an `over`, which declares nothing, or a `class`.
#[test]
fn prototypes_may_be_overs_and_classes() {
    for kept in ["over \"kept\"", "class \"kept\"", "def Scope \"kept\""] {
        let stage = of_text(&format!(
            "def PointInstancer \"many\" {{\nrel prototypes = </kept/a>\nint[] protoIndices = [0, 0]\n\
             point3f[] positions = [(1,0,0), (2,0,0)]\n}}\n{kept} {{\ndef Xform \"a\" {{\n{}}}\n}}\n",
            line("c", "")
        ));
        let (set, _) = curves(&stage, "/many", None);
        let x: Vec<f64> = set.curves.iter().map(|curve| curve.points[0].x).collect();
        assert_eq!(x, [1.0, 2.0], "{kept}");
    }
}

/// A prim's own purpose and binding win over those from above, as `ComputePurpose` and `ComputeBoundMaterial` have it.
#[test]
fn purpose_and_material_are_the_nearest_ones() {
    let prims = |stage: &Stage, pattern: &str| -> Vec<String> {
        curves(stage, pattern, None).1.into_iter().map(|(name, _)| name).collect()
    };
    let purpose = |p: &str| format!("uniform token purpose = \"{p}\"");
    let stage = of_text(&format!(
        "def Xform \"g\" {{\n{}\n{}{}{}}}\n{}",
        purpose("proxy"),
        line("inherits", ""),
        line("render", &purpose("render")),
        line("usual", &purpose("default")),
        line("guide", &purpose("guide"))
    ));
    assert_eq!(prims(&stage, "/"), ["/g/render", "/g/usual"]);
    let bound = |m: &str| format!("rel material:binding = </looks/{m}>");
    let stage = of_text(&format!(
        "def Xform \"g\" {{\n{}\n{}{}}}\n{}def Scope \"looks\" {{\ndef Material \"wool\" {{\n}}\n\
         def Material \"silk\" {{\n}}\n}}\n",
        bound("wool"),
        line("inherits", ""),
        line("silken", &bound("silk")),
        line("other", &bound("silk"))
    ));
    assert_eq!(prims(&stage, "material:/looks/wool"), ["/g/inherits"]);
    assert_eq!(prims(&stage, "material:/looks/silk"), ["/g/silken", "/other"]);
    assert_eq!(prims(&stage, "/g material:/looks/silk"), ["/g/inherits", "/g/silken", "/other"]);
}

#[test]
fn holes_are_no_faces_and_skeletons_are_told() {
    let stage = of_text(
        "def Mesh \"m\" {\nint[] faceVertexCounts = [3, 4, 3]\n\
         int[] faceVertexIndices = [0, 1, 2, 0, 2, 3, 4, 0, 4, 1]\nint[] holeIndices = [1]\n\
         point3f[] points = [(0,0,0), (1,0,0), (1,1,0), (0,1,0), (-1,0,1)]\n\
         texCoord2f[] primvars:st = [(0,0), (1,0), (2,0), (3,0), (4,0), (5,0), (6,0), (7,0), (8,0), (9,0)] (\n\
         interpolation = \"faceVarying\"\n)\nint[] primvars:skel:jointIndices = [0, 0, 0, 0, 0]\n\
         def GeomSubset \"a\" {\nint[] indices = [0, 1]\n}\ndef GeomSubset \"b\" {\nint[] indices = [1]\n}\n}\n",
    );
    let mesh = stage.mesh(&MeshChoice::all(), None).unwrap();
    assert_eq!((mesh.counts.as_slice(), mesh.corners.as_slice()), ([3, 3].as_slice(), [0, 1, 2, 0, 4, 1].as_slice()));
    assert_eq!(mesh.uvs[mesh.uv_corners[3] as usize].x, 7.0);
    let groups: Vec<(&str, &[u32])> = mesh.groups.iter().map(|g| (g.name.as_str(), g.faces.as_slice())).collect();
    assert_eq!(groups, [("a", [0].as_slice()), ("m", [1].as_slice())]);
    assert!(mesh.warnings.len() == 1 && mesh.warnings[0].starts_with("/m is as modelled"), "{:?}", mesh.warnings);
}

/// Sets of any name; the usual one unless another is asked for. A material bound to all faces names them all.
#[test]
fn texture_coordinates_are_chosen_and_materials_name_meshes() {
    let mesh = |name: &str, sets: &[&str], more: &str| {
        let set = |(i, name): (usize, &&str)| {
            format!("texCoord2f[] primvars:{name} = [({i},0), (1,0), (0,1)] (\ninterpolation = \"vertex\"\n)\n")
        };
        let sets: String = sets.iter().enumerate().map(set).collect();
        format!(
            "def Mesh \"{name}\" {{\nint[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]\n\
             point3f[] points = [(0,0,0), (1,0,0), (1,1,0)]\nuniform token subdivisionScheme = \"none\"\n{sets}{more}}}\n"
        )
    };
    let stage = of_text(&format!(
        "{}{}{}",
        mesh("two", &["pattern", "st"], "rel material:binding = </looks/wool>\n"),
        mesh("odd", &["flat"], ""),
        mesh("none", &[], "")
    ));
    let read = |prim: &str, uv: Option<&str>| {
        let choice = MeshChoice { prims: PrimPattern::parse(prim).unwrap(), uv: uv.map(str::to_owned) };
        stage.mesh(&choice, None)
    };
    let usual = read("/two", None).unwrap();
    assert_eq!((usual.uvs[0].x, usual.notes.len()), (1.0, 1));
    assert!(usual.notes[0].contains("of the texture coordinates st, pattern `st` are taken"), "{:?}", usual.notes);
    let groups: Vec<(&str, bool)> = usual.groups.iter().map(|g| (g.name.as_str(), g.is_second)).collect();
    assert_eq!(groups, [("wool", true), ("two", false)]);
    let asked = read("/two", Some("pattern")).unwrap();
    assert_eq!((asked.uvs[0].x, asked.notes.len()), (0.0, 0));
    assert_eq!(read("/odd", None).unwrap().uvs.len(), 3);
    assert!(read("/none", None).unwrap().uvs.is_empty());
    let wrong = read("/two", Some("uv")).unwrap_err().to_string();
    assert!(wrong.ends_with("/two: no texture coordinates `uv`; there are: st, pattern"), "{wrong}");
}

/// The primvar of widths wins over the attribute, and what a prim above has of one value is of all below it.
#[test]
fn primvars_come_from_above() {
    let curve = |name: &str, more: &str| {
        format!(
            "def BasisCurves \"{name}\" {{\nuniform token type = \"linear\"\nint[] curveVertexCounts = [2]\n\
             point3f[] points = [(0,0,0), (1,0,0)]\n{more}}}\n"
        )
    };
    let constant = "(\ninterpolation = \"constant\"\n)\n";
    let stage = of_text(&format!(
        "def Xform \"top\" {{\ncolor3f[] primvars:displayColor = [(1, 0, 0)] {constant}float[] primvars:widths = [0.5] {constant}\
         int[] primvars:yarnId = [9] {constant}{}{}def Xform \"own\" {{\ncolor3f[] primvars:displayColor = [(0, 1, 0)] (\n\
         interpolation = \"vertex\"\n)\n{}}}\n}}\n",
        curve("a", ""),
        curve("b", "float[] widths = [0.1]\nfloat[] primvars:widths = [0.2]\nint[] primvars:yarnId = [3]\n"),
        curve("c", "float[] widths = [0.1]\n")
    ));
    let (set, _) = stage.curves(&PrimPattern::all(), None).unwrap();
    let radii: Vec<f64> = set.curves.iter().map(|c| c.radii.as_ref().unwrap()[0]).collect();
    assert!(radii.iter().zip([0.25, 0.1, 0.25]).all(|(a, b)| (a - b).abs() < 1e-6), "{radii:?}");
    assert_eq!(set.ids, [Some(9), Some(3), Some(9)]);
    // Values along another prim's points are its own.
    assert_eq!(set.colors, [Some([1.0, 0.0, 0.0]), Some([1.0, 0.0, 0.0]), None]);
}

#[test]
fn curves_of_other_kinds_are_named() {
    let stage = of_text(
        "def NurbsCurves \"n\" {\n}\ndef BasisCurves \"b\" {\nuniform token type = \"linear\"\nint[] curveVertexCounts = [2]\n\
         point3f[] points = [(0,0,0), (1,0,0)]\n}\n",
    );
    let (set, _) = stage.curves(&PrimPattern::all(), None).unwrap();
    assert_eq!(set.curves.len(), 1);
    assert_eq!(set.notes, ["/n is left out: NurbsCurves are not read, BasisCurves are"]);
    assert!(stage.mesh(&MeshChoice::all(), None).unwrap().warnings.is_empty());
}

/// Points with velocities go on from the sample before, whose number of points counts.
#[test]
fn velocities_move_points() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sim.usda");
    let text = "#usda 1.0\n(\n    timeCodesPerSecond = 25\n)\ndef BasisCurves \"c\" {\nuniform token type = \"linear\"\n\
                int[] curveVertexCounts.timeSamples = { 1: [2], 2: [3] }\n\
                point3f[] points.timeSamples = { 1: [(0,0,0), (1,0,0)], 2: [(0,1,0), (1,1,0), (2,1,0)] }\n\
                vector3f[] velocities.timeSamples = { 1: [(0,25,0), (0,50,0)], 2: [(0,0,0), (0,0,0), (0,0,25)] }\n}\n";
    std::fs::write(&path, text).unwrap();
    let stage = Stage::open(&path).unwrap();
    let at = |frame: f64| stage.curves(&PrimPattern::all(), Some(frame)).unwrap().0.curves[0].points.clone();
    for (frame, want) in [
        (0.5, vec![[0.0, -0.5, 0.0], [1.0, -1.0, 0.0]]),
        (1.0, vec![[0.0; 3], [1.0, 0.0, 0.0]]),
        (1.5, vec![[0.0, 0.5, 0.0], [1.0, 1.0, 0.0]]),
        (2.5, vec![[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.5]]),
    ] {
        let found = at(frame);
        assert_eq!(found.len(), want.len(), "{frame}");
        assert!(found.iter().zip(&want).all(|(p, w)| p.distance(DVec3::from(*w)) < 1e-5), "{frame}: {found:?}");
    }
}

#[test]
fn prims_are_chosen_by_path_and_material_and_times_by_frame() {
    let stage = open("scene.usda");
    assert_eq!(curves(&stage, "/top/*", None).1.len(), 2);
    assert_eq!(curves(&stage, "/instance1", None).1, [("/instance1/curve".to_owned(), 1)]);
    assert_eq!(curves(&stage, "material:/looks/*_wool", None).1, [("/dyed".to_owned(), 1)]);
    assert!(curves(&stage, "/nothing", None).1.is_empty());
    let height = |frame| curves(&stage, "/moving", frame).0.curves[0].points[0].z;
    assert_eq!([None, Some(1.0), Some(5.5), Some(10.0), Some(99.0)].map(height), [0.0, 0.0, 5.0, 10.0, 10.0]);
}

/// usd-core writes whole numbers without a point, and takes samples in any order.
#[test]
fn samples_written_as_whole_numbers_go_evenly() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("shot.usda");
    let text = "#usda 1.0\ndef Xform \"rig\" {\ndouble xformOp:rotateY.timeSamples = { 11: 90, 1: 0 }\n\
                uniform token[] xformOpOrder = [\"xformOp:rotateY\"]\n\
                def Camera \"camera\" {\nfloat focalLength.timeSamples = { 1: 35, 11: 70.5 }\n\
                float horizontalApertureOffset = 2\nfloat verticalApertureOffset = -1.5\n}\n}\n";
    std::fs::write(&path, text).unwrap();
    let stage = Stage::open(&path).unwrap();
    for (frame, focal_length, angle) in [(0.0, 35.0, 0.0), (1.0, 35.0, 0.0), (3.0, 42.1, 18.0), (99.0, 70.5, 90.0)] {
        let camera = stage.camera("/rig/camera", Some(frame)).unwrap();
        assert!((camera.focal_length.unwrap() - focal_length).abs() < 1e-5, "{frame}: {:?}", camera.focal_length);
        assert_eq!(camera.offset, [2.0, -1.5]);
        let want = DMat4::from_rotation_y(f64::to_radians(angle));
        assert!(camera.to_stage.abs_diff_eq(want, 1e-6), "{frame}: {:?}", camera.to_stage);
    }
}

#[test]
fn cameras_stand_where_they_are() {
    let stage = open("scene.usda");
    assert_eq!(stage.contents().unwrap().cameras, ["/rig/camera"]);
    let camera = stage.camera("/rig/camera", Some(10.0)).unwrap();
    let want = DMat4::from_translation(DVec3::new(0.0, 0.0, 3.0)) * DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2);
    assert!(camera.to_stage.abs_diff_eq(want, 1e-6), "{:?}", camera.to_stage);
    assert_eq!((camera.aperture, camera.focal_length), ([36.0, 24.0], Some(35.0)));
    assert_eq!((camera.f_stop, camera.focus_distance), (4.0, 2.0));
    let missing = stage.camera("/rig", None).unwrap_err().to_string();
    assert!(missing.contains("no camera at /rig") && missing.contains("/rig/camera"), "{missing}");
}

#[test]
fn meshes_keep_corners_groups_and_sides() {
    let stage = open("mesh.usda");
    let mesh = |pattern: &str| {
        stage.mesh(&MeshChoice { prims: PrimPattern::parse(pattern).unwrap(), uv: None }, None).unwrap()
    };
    let panels = mesh("/panels");
    assert_eq!((panels.counts.as_slice(), panels.points.len()), ([4, 5, 3].as_slice(), 7));
    let groups: Vec<(&str, &[u32])> = panels.groups.iter().map(|g| (g.name.as_str(), g.faces.as_slice())).collect();
    assert_eq!(groups, [("body", [0, 1].as_slice()), ("collar", [2].as_slice()), ("panels", [0, 1, 2].as_slice())]);
    assert_eq!(panels.groups.iter().map(|g| g.is_second).collect::<Vec<_>>(), [false, false, true]);
    assert_eq!(panels.uv_corners, [0, 1, 2, 3, 1, 4, 5, 6, 2, 3, 7, 6]);
    assert_eq!(panels.uvs[7], glam::DVec2::new(7.0, 14.0));
    let flat = mesh("/flat");
    assert_eq!(flat.uvs.len(), 7, "equal coordinates at a point are one");
    assert_eq!(mesh("/vertex").uv_corners, mesh("/vertex").corners);
    for turned in ["/left", "/mirrored"] {
        assert_eq!(mesh(turned).corners[..4], [3, 2, 1, 0], "{turned}");
    }
    assert_eq!(mesh("/left").groups[0].name, "left");
}

#[test]
fn what_is_written_is_read_again() {
    let wave = |k: usize| DVec3::new(k as f64, (k as f64).sin(), 0.5);
    let curve = |basis, closed, n: usize, radii: Option<fn(usize) -> f64>| Curve {
        basis,
        closed,
        points: (0..n).map(wave).collect(),
        radii: radii.map(|r| (0..n).map(r).collect()),
        flattening: None,
    };
    let even = |_| 0.25;
    let growing = |k: usize| 0.1 + 0.01 * k as f64;
    let curves = [
        curve(Basis::BSpline, false, 7, Some(growing)),
        curve(Basis::BSpline, true, 6, Some(even)),
        curve(Basis::CatmullRom, false, 5, Some(growing)),
        curve(Basis::CatmullRom, true, 5, None),
        curve(Basis::Linear, false, 2, Some(even)),
    ];
    let folder = tempfile::tempdir().unwrap();
    for name in ["cloth.usda", "cloth.usdc", "cloth.usd"] {
        let groups: Vec<write::CurvesOut<'_>> = curves
            .iter()
            .enumerate()
            .map(|(i, c)| write::CurvesOut {
                name: format!("yarn{i}"),
                curves: vec![c, c],
                radius: 0.3,
                primvars: vec![
                    ("yarnId".into(), write::Interpolated::Id(vec![7, 8])),
                    ("displayColor".into(), write::Interpolated::Color(vec![[0.5, 0.2, 0.1]; 2])),
                ],
            })
            .collect();
        let path = folder.path().join(name);
        write::write(&path, 1.0, &groups, &mut std::fs::File::create(&path).unwrap()).unwrap();
        let stage = Stage::open(&path).unwrap();
        assert_eq!((stage.unit_mm(), stage.up_axis()), (Some(1.0), Some(1)));
        let (set, prims) = stage.curves(&PrimPattern::all(), None).unwrap();
        assert_eq!(prims.len(), 5, "{name}");
        for (i, (given, read)) in curves.iter().zip(set.curves.chunks(2)).enumerate() {
            assert_eq!((read[0].basis, read[0].closed), (given.basis, given.closed), "{name} {i}");
            assert!(read[1].points.iter().zip(&given.points).all(|(a, b)| a.distance(*b) < 1e-6));
            let radius = |k: usize| given.radii.as_ref().map_or(0.3, |r| r[k]);
            for (k, &r) in read[0].radii.as_ref().unwrap().iter().enumerate() {
                assert!((r - radius(k)).abs() < 1e-6, "{name} {i} {k}: {r} {}", radius(k));
            }
        }
    }
}

#[test]
fn damaged_files_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    // Each under a name of its own: layers are known by their names.
    let made = std::cell::Cell::new(0);
    let refused = |name: &str, bytes: &[u8]| {
        made.set(made.get() + 1);
        let path = folder.path().join(format!("{}_{name}", made.get()));
        std::fs::write(&path, bytes).unwrap();
        let read = |stage: Stage| {
            stage.curves(&PrimPattern::all(), None)?;
            stage.mesh(&MeshChoice::all(), None)?;
            stage.contents()
        };
        Stage::open(&path).and_then(read).map_err(|e| e.to_string())
    };
    for name in ["matrix.usda", "matrix.usdc", "matrix.usdz", "scene.usda", "mesh.usda"] {
        let whole = std::fs::read(data(name)).unwrap();
        let mut random = crate::math::sampler::Stream::new(7);
        // ROUNDS=6000 looks longer.
        let rounds = std::env::var("ROUNDS").map_or(60, |r| r.parse().unwrap());
        for round in 0..rounds {
            let mut bytes = whole.clone();
            if round < 20 {
                bytes.truncate(bytes.len() * round / 20);
            } else {
                for _ in 0..1 + round % 7 {
                    let at = (f64::from(random.next()) * bytes.len() as f64) as usize;
                    bytes[at.min(whole.len() - 1)] = (f64::from(random.next()) * 256.0) as u8;
                }
            }
            // No panic, no endless allocation; what is still sound may be read.
            let _ = refused(name, &bytes);
        }
        assert_eq!(refused(name, &whole).err(), None, "{name}");
        for path in std::fs::read_dir(folder.path()).unwrap() {
            std::fs::remove_file(path.unwrap().path()).unwrap();
        }
    }
    assert!(refused("x.usda", b"hello").unwrap_err().contains("#usda"));
    let deep = format!("#usda 1.0\n{}", "def Xform \"a\" {\n".repeat(5000));
    assert!(refused("deep.usda", deep.as_bytes()).unwrap_err().contains("deep"));
    for name in ["}a", "a b", "", "a/b", "a.b"] {
        let odd = format!("#usda 1.0\ndef Xform \"{name}\" {{ }}\n");
        assert!(refused("odd.usda", odd.as_bytes()).unwrap_err().contains("no name of a prim"), "{name}");
    }
    let odd = "#usda 1.0\ndef Scope \"a\" {\nrel b = </c}d/e>\n}\n";
    assert!(refused("odd.usda", odd.as_bytes()).unwrap_err().contains("is no path"));
    let huge = "#usda 1.0\ndef BasisCurves \"a\" {\nuniform token type = \"linear\"\nint[] curveVertexCounts = [2147483647]\n\
                point3f[] points = [(0,0,0)]\n}\n";
    assert!(refused("huge.usda", huge.as_bytes()).unwrap_err().contains("/a: "));
}

/// Curves of one width have a prim of their own; rounding makes no width of its own.
#[test]
fn widths_that_are_one_are_constant() {
    let curve = |radius: &dyn Fn(usize) -> f64| Curve {
        basis: Basis::BSpline,
        closed: false,
        points: (0..6).map(|i| DVec3::new(i as f64, 0.0, 0.0)).collect(),
        radii: Some((0..6).map(radius).collect()),
        flattening: None,
    };
    let single = |r: f64| f64::from(r as f32);
    let set = CurveSet {
        curves: vec![
            curve(&|_| 0.2),
            curve(&|_| 0.5),
            curve(&|i| single(0.2) * (1.0 + 1e-7 * i as f64)),
            curve(&|i| 0.1 + 0.1 * i as f64),
        ],
        ids: vec![Some(3), Some(3), Some(4), Some(5)],
        plies: vec![Some(0), Some(1), Some(0), Some(0)],
        unit_mm: Some(10.0),
        ..CurveSet::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plies.usda");
    curve_file::write(&path, &set, &mut std::fs::File::create(&path).unwrap()).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert_eq!(text.matches("def BasisCurves").count(), 3, "{text}");
    assert_eq!((text.matches("\"constant\"").count(), text.matches("\"varying\"").count()), (2, 1), "{text}");
    let again = curve_file::read(&path, &ReadOptions::default()).unwrap();
    assert_eq!(again.ids, [Some(3), Some(4), Some(3), Some(5)]);
    assert_eq!(again.plies, [Some(0), Some(0), Some(1), Some(0)]);
    assert_eq!(again.unit_mm, Some(10.0));
    let radii = |i: usize| again.curves[i].radii.as_ref().unwrap();
    assert!((radii(1)[5] - 0.2).abs() < 1e-6 && (radii(2)[0] - 0.5).abs() < 1e-6 && (radii(3)[5] - 0.6).abs() < 1e-6);
}
