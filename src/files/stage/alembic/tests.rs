//! A file made by alembic3d (`tests/data/stages/make_abc.py`) against values worked out by hand.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::super::{Contents, MeshChoice, PrimPattern, Stage, StageError};
use crate::geometry::curve::Basis;

fn data() -> PathBuf {
    stages("scene.abc")
}

fn stages(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/stages").join(name)
}

fn point(i: usize) -> DVec3 {
    DVec3::new(i as f64, ((i * i) % 5) as f64, ((3 * i) % 4) as f64)
}

#[test]
fn curves_are_placed_and_timed() {
    let stage = Stage::open(&data()).unwrap();
    assert_eq!((stage.unit_mm(), stage.frames()), (None, Some([0.0, 2.0])));
    for frame in [0.0, 1.0, 1.5] {
        let (set, objects) = stage.curves(&PrimPattern::parse("/place").unwrap(), Some(frame)).unwrap();
        let names: Vec<&str> = objects.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(
            names,
            ["/place/linear_open", "/place/bspline_open", "/place/bspline_closed", "/place/catmull_open"]
        );
        let curve = &set.curves[0];
        assert_eq!((curve.basis, curve.points.len()), (Basis::Linear, 5));
        for (i, p) in curve.points.iter().enumerate() {
            // Twice as large, a quarter turn about z, moved along x.
            let q = 2.0 * point(i);
            let want = DVec3::new(10.0 * frame - q.y, q.x, q.z);
            assert!(p.distance(want) < 1e-5, "{frame} {i}: {p} {want}");
        }
        let radii = curve.radii.as_ref().unwrap();
        assert!((radii[3] - 0.5).abs() < 1e-6, "half of the width, twice as large: {}", radii[3]);
        assert_eq!((set.curves[1].points.len(), set.curves[2].basis), (4, Basis::BSpline));
        assert!(set.curves[4].closed && !set.curves[3].closed);
    }
}

#[test]
fn points_move_and_hidden_ones_are_not_there() {
    let stage = Stage::open(&data()).unwrap();
    let height = |frame| {
        let (set, _) = stage.curves(&PrimPattern::parse("/moving").unwrap(), frame).unwrap();
        set.curves[0].points[0].z
    };
    assert_eq!(
        [None, Some(0.0), Some(1.0), Some(1.5), Some(9.0)].map(height).map(|z| (z * 1e4).round() / 1e4),
        [0.0, 0.0, 1.0, 1.5, 2.0]
    );
    let all = stage.curves(&PrimPattern::all(), None).unwrap().1;
    assert!(all.iter().all(|(name, _)| name != "/hidden"));
    assert!(stage.contents().unwrap().curves.contains(&"/hidden".to_owned()));
}

/// `tests/data/stages/make_abc_labels.py`: two curves of three points and of two, labelled in every way.
#[test]
fn curves_have_colours_and_numbers() {
    const RED: [f32; 3] = [0.8, 0.05, 0.05];
    const GREEN: [f32; 3] = [0.1, 0.6, 0.1];
    const BLUE: [f32; 3] = [0.05, 0.1, 0.8];
    let stage = Stage::open(&stages("labels.abc")).unwrap();
    let read = |prim: &str| stage.curves(&PrimPattern::parse(prim).unwrap(), None).unwrap().0;
    let between: [f32; 3] = std::array::from_fn(|c| 0.5 * (GREEN[c] + BLUE[c]));
    for (prim, want) in
        [("/constant", [RED, RED]), ("/uniform", [RED, BLUE]), ("/vertex", [RED, between]), ("/indexed", [BLUE, GREEN])]
    {
        for (found, want) in read(prim).colors.iter().zip(want) {
            assert!(found.unwrap().iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-6), "{prim}: {found:?} {want:?}");
        }
        assert_eq!(read(prim).colors.len(), 2, "{prim}");
    }
    let numbered = read("/uniform");
    assert_eq!((numbered.ids, numbered.plies), (vec![Some(7), Some(9)], vec![Some(0), Some(1)]));
    // Three colours of two curves are left out, and said; text under the name of a colour is something else.
    let wrong = read("/wrong");
    assert!(wrong.colors.is_empty() && wrong.curves.len() == 2);
    assert_eq!(wrong.notes, ["colours are left out: uniform values are 2 here, found 3"]);
    assert!(read("/text").colors.is_empty());
}

#[test]
fn meshes_have_sides_groups_and_coordinates() {
    let stage = Stage::open(&data()).unwrap();
    let mesh = stage.mesh(&MeshChoice::all(), None).unwrap();
    assert_eq!((mesh.points.len(), mesh.counts.as_slice()), (5, [4, 3].as_slice()));
    // Alembic winds its faces the other way.
    assert_eq!(mesh.corners, [3, 2, 1, 0, 2, 4, 1]);
    assert_eq!(mesh.uv_corners, [3, 2, 1, 0, 2, 0, 1]);
    let groups: Vec<(&str, &[u32])> = mesh.groups.iter().map(|g| (g.name.as_str(), g.faces.as_slice())).collect();
    assert_eq!(groups, [("collar", [1].as_slice()), ("panels", [0].as_slice())]);
}

/// By what an archive says, else by the distance of its samples where that is one of film, else 24.
#[test]
fn archives_have_their_own_frames() {
    use super::{TimeSampling, frames_per_second};
    let even = |cycle: f64| TimeSampling { cycle, times: vec![0.0] };
    let still = even(1.0);
    let of =
        |words: &str, own: &[TimeSampling]| frames_per_second(words, &[std::slice::from_ref(&still), own].concat());
    assert_eq!(of("_ai_Application=x;FramesPerTimeUnit=25.000000;_ai_Description=y", &[even(1.0 / 30.0)]), 25.0);
    assert_eq!(of("", &[even(1.0 / 30.0)]), 30.0);
    assert_eq!(of("", &[even(1001.0 / 24000.0)]), 24000.0 / 1001.0);
    for own in [vec![], vec![even(0.37)], vec![TimeSampling { cycle: 1e200, times: vec![0.0, 0.04] }]] {
        assert_eq!(of("FramesPerTimeUnit=none", &own), 24.0);
    }
    // Samples at frames are at frames, whatever the rate.
    assert_eq!(
        Stage::open(&data()).unwrap().frames(),
        Stage::open(&data()).unwrap().frames().map(|f| f.map(f64::round))
    );
}

#[test]
fn cameras_that_are_not_there_are_told() {
    let problem = Stage::open(&data()).unwrap().camera("/none", None).unwrap_err().to_string();
    assert!(problem.contains("no camera at /none; cameras here: "), "{problem}");
}

#[test]
fn damaged_files_are_errors() {
    damage(&stages("labels.abc"));
    let whole = damage(&data());
    let read = |bytes: &[u8]| read(&tempfile::tempdir().unwrap().path().join("x.abc"), bytes);
    let old = [b"\x89HDF\r\n\x1a\n".as_slice(), &[0; 64]].concat();
    assert!(read(&old).unwrap_err().to_string().contains("HDF5"));
    let mut open = whole;
    open[5] = 0;
    assert!(read(&open).unwrap_err().to_string().contains("not closed"));
}

fn read(path: &Path, bytes: &[u8]) -> Result<Contents, StageError> {
    std::fs::write(path, bytes).unwrap();
    let stage = Stage::open(path)?;
    stage.curves(&PrimPattern::all(), Some(1.0))?;
    stage.mesh(&MeshChoice::all(), Some(1.0))?;
    stage.contents()
}

/// Reads a file cut off and changed in many ways; what cannot be read is an error. Gives its bytes.
fn damage(file: &Path) -> Vec<u8> {
    let whole = std::fs::read(file).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.abc");
    let read = |bytes: &[u8]| read(&path, bytes);
    assert!(read(&whole).is_ok());
    let mut random = crate::math::sampler::Stream::new(3);
    for round in 0..400 {
        let mut bytes = whole.clone();
        if round < 100 {
            bytes.truncate(bytes.len() * round / 100);
            assert!(read(&bytes).is_err(), "{round}");
            continue;
        }
        for _ in 0..1 + round % 9 {
            let at = (f64::from(random.next()) * bytes.len() as f64) as usize;
            bytes[at.min(whole.len() - 1)] = (f64::from(random.next()) * 256.0) as u8;
        }
        let _ = read(&bytes);
    }
    whole
}
