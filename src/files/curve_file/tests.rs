//! What the formats share: recognising files, the real files of the shared folder, and hostile bytes.

use std::env;
use std::path::PathBuf;

use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

use super::*;

fn scratch(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("a written file");
    (folder, path)
}

fn small_bcc() -> Vec<u8> {
    let mut bytes = Vec::new();
    let set = text::parse(b"0 0 0\n1 0 0\n0 1 0\n0 0 0\n\n1 2 3\n4 5 6\n", &ReadOptions::default()).expect("text");
    write_bcc(&set, &mut bytes).expect("a vector takes everything");
    bytes
}

#[test]
fn content_comes_before_the_extension() {
    let (_folder, path) = scratch("misnamed.txt", &small_bcc());
    assert_eq!(read(&path, &ReadOptions::default()).expect("BCC").curves.len(), 2);
    let (_folder, path) = scratch("plain.CURVES", b"0 0 0\n1 0 0\n");
    assert_eq!(read(&path, &ReadOptions::default()).expect("text").curves.len(), 1);
}

#[test]
fn errors_name_the_file() {
    let message = |path: &Path| {
        let error = read(path, &ReadOptions::default()).expect_err("unreadable").to_string();
        error.strip_prefix(&format!("{}: ", path.display())).expect("the path comes first").to_owned()
    };
    let (folder, path) = scratch("cut.bcc", &small_bcc()[..80]);
    assert_eq!(message(&path), "byte 64: curve 0 claims 3 points but only 12 bytes follow; is the file cut short?");
    assert!(message(&folder.path().join("missing.bcc")).starts_with("no such file"));
    let renamed = folder.path().join("folder.bcc");
    fs::create_dir(&renamed).expect("a folder");
    assert_eq!(message(&renamed), "expected a regular file, found a folder, pipe or device");
    let (_folder, path) = scratch("straight.yarn", b"YARN");
    assert_eq!(
        message(&path),
        "expected a curve file, found neither the letters BCC or HAIR nor a known extension; \
         name it .bcc, .hair, .pyp, .obj, .yarns, .txt, .curves, .smobj, .usda, .usdc, .usd, .usdz or .abc after its content"
    );
}

#[test]
fn points_beyond_all_reach_are_an_error() {
    let (folder, path) = scratch("far.txt", b"0 0 0\n1 0 0\n\n0 0 0\n0 -1e300 0\n");
    let error = read(&path, &ReadOptions::default()).expect_err("too far").to_string();
    let problem = "point 1 of curve 1 is at [0e0, -1e300, 0e0]; coordinates may be at most 1e12; is the file damaged?";
    assert_eq!(error, format!("{}: {problem}", path.display()));
    // A tile too.
    let path = folder.path().join("far.pyp");
    let text = "*pattern\n10 20 0.5 1\n*Q\n1 1 1e13 0\n*E\n0 0 1 0\n";
    fs::write(&path, text).unwrap();
    assert!(read_tile(&path).unwrap_err().to_string().contains("coordinates may be at most 1e12"));
    fs::write(&path, text.replace("1e13", "1")).unwrap();
    assert!(read_tile(&path).is_ok());
}

#[test]
fn options_without_effect_are_noted() {
    let options = ReadOptions { basis: Some(Basis::Linear), tile: [2, 1], ..ReadOptions::default() };
    let notes = parse(&small_bcc(), Format::Bcc, &options).expect("BCC").notes;
    assert_eq!(
        notes,
        [
            "the basis asked for was ignored: this format fixes its own",
            "the tile counts asked for were ignored: only periodic patterns (.pyp) are tiled"
        ]
    );
    let notes = parse(b"# nothing\n", Format::Text, &ReadOptions::default()).expect("text").notes;
    assert_eq!(notes, ["the file holds no curve that can be drawn"]);
}

/// The folder of real files, which is not part of the repository.
fn shared(file: &str) -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let folders = [Some(beside), env::var_os("YARNRAY_SHARED").map(PathBuf::from)];
    let found = folders.into_iter().flatten().map(|folder| folder.join("data").join(file)).find(|path| path.exists());
    if found.is_none() {
        crate::testing::skipped(&format!("{file} is not beside the project"));
    }
    found
}

#[test]
fn real_bcc_files_are_read() {
    // File, curves, closed curves, points in the file, closing repeats, basis, up.
    let expected = [
        ("glove", 70, 70, 58_545, 8, Basis::CatmullRom, 1),
        ("alien_sweater", 146, 146, 139_528, 22, Basis::CatmullRom, 1),
        ("openwork_trellis_pattern", 1, 0, 19_730, 0, Basis::CatmullRom, 2),
        ("flame_ribbing_pattern", 1, 0, 49_745, 0, Basis::CatmullRom, 2),
        ("knittubeinit", 39, 39, 18_228, 0, Basis::BSpline, 1),
    ];
    for (name, curves, closed, points, repeats, basis, up) in expected {
        let Some(path) = shared(&format!("curves/{name}.bcc")) else { continue };
        let set = read(&path, &ReadOptions::default()).expect(name);
        assert_eq!(set.curves.len(), curves, "{name}");
        assert_eq!(set.curves.iter().filter(|curve| curve.closed).count(), closed, "{name}");
        assert_eq!(point_count(&set), points - repeats, "{name}");
        assert!(set.curves.iter().all(|curve| curve.basis == basis), "{name}");
        assert_eq!((set.up_axis, set.unit_mm), (Some(up), None), "{name}");
        let note = format!("{repeats} of {curves} curves repeated the first point at the end; the repeat was dropped");
        assert_eq!(set.notes, if repeats > 0 { vec![note] } else { vec![] }, "{name}");

        let mut bytes = Vec::new();
        write_bcc(&set, &mut bytes).expect("a vector takes everything");
        let again = parse(&bytes, Format::Bcc, &ReadOptions::default()).expect(name);
        assert_eq!(again, CurveSet { notes: vec![], ..set }, "{name}");
    }
}

#[test]
fn real_patterns_become_continuous_yarns() {
    // File, vertices in a cell, curves of 3 x 2 cells.
    for (name, vertices, curves) in [
        ("stockinette", 100, 4),
        ("stocktiny", 13, 2),
        ("basket", 80, 20),
        ("satin", 130, 25),
        ("cartridge_belt_rib", 356, 8),
    ] {
        let Some(path) = shared(&format!("patterns/{name}.pyp")) else { continue };
        let set = read(&path, &ReadOptions { tile: [3, 2], ..ReadOptions::default() }).expect(name);
        assert_eq!(point_count(&set), vertices * 6, "{name}");
        assert_eq!(set.curves.len(), curves, "{name}");
        assert_eq!((set.up_axis, set.unit_mm), (None, Some(1000.0)), "{name}");
        assert!(set.notes.is_empty(), "{name}: {:?}", set.notes);
        for curve in &set.curves {
            assert!(!curve.closed, "{name}");
            let mut steps: Vec<f64> = curve.points.windows(2).map(|pair| pair[0].distance(pair[1])).collect();
            steps.sort_by(f64::total_cmp);
            let (median, longest) = (steps[steps.len() / 2], steps[steps.len() - 1]);
            assert!(longest < 3.0 * median, "{name}: longest step {longest}, median {median}");
        }
    }
}

fn point_count(set: &CurveSet) -> usize {
    set.curves.iter().map(|curve| curve.points.len()).sum()
}

/// Hostile files for each format in the daily tests; `YARNRAY_FUZZ_CASES` asks for another number.
const FUZZ_CASES: u32 = 20_000;

/// What goes wrong with a file on its way. Positions are taken modulo the length.
#[derive(Clone, Debug)]
enum Damage {
    Set(usize, u8),
    Insert(usize, &'static [u8]),
    Overwrite(usize, &'static [u8]),
    Remove(usize, usize),
    Repeat(usize, usize),
    Cut(usize),
}

/// Pieces with a meaning in one of the formats, and numbers at the limits.
const PIECES: &[&[u8]] = &[
    b"0",
    b"1",
    b"-1",
    b"9",
    b".",
    b"e",
    b"e308",
    b"-",
    b" ",
    b"\n",
    b"\n\n",
    b"#",
    b"*",
    b"*Q\n",
    b"*E\n",
    b"*x\n",
    b"nan",
    b"inf",
    b"4294967296",
    b"-2147483648",
    b"99999999999999999999",
    b"0 0 0\n",
    b"1 0 1 0\n",
    b"BCC",
    b"BS",
    b"PL",
    b"BZ",
    b"\x48",
    b"\xef\xbb\xbf",
    b"\xff\xff\xff\xff",
    b"\x00\x00\x00\x80",
    b"\xff\xff\xff\x7f",
    b"\x00\x00\xc0\x7f",
    b"\x00\x00\x80\x7f",
    b"\x02\x00\x00\x00",
    b"\xfd\xff\xff\xff",
    b"\x00\x00\x00\x00\x00\x00\x00\x80",
    b"\xff\xff\xff\xff\xff\xff\xff\xff",
];

impl Damage {
    fn strategy() -> impl Strategy<Value = Self> {
        let at = 0..1_000_usize;
        let length = 1..40_usize;
        let piece = prop::sample::select(PIECES);
        prop_oneof![
            3 => (at.clone(), any::<u8>()).prop_map(|(at, byte)| Self::Set(at, byte)),
            3 => (at.clone(), piece.clone()).prop_map(|(at, piece)| Self::Insert(at, piece)),
            4 => (at.clone(), piece).prop_map(|(at, piece)| Self::Overwrite(at, piece)),
            1 => (at.clone(), length.clone()).prop_map(|(at, length)| Self::Remove(at, length)),
            1 => (at.clone(), length).prop_map(|(at, length)| Self::Repeat(at, length)),
            1 => at.prop_map(Self::Cut),
        ]
    }

    fn apply(&self, bytes: &mut Vec<u8>) {
        let size = bytes.len();
        let start = |at: &usize| at % (size + 1);
        let range = |at: &usize, length: &usize| start(at)..size.min(start(at) + length);
        match self {
            Self::Set(at, byte) => {
                if let Some(target) = bytes.get_mut(start(at)) {
                    *target = *byte;
                }
            }
            Self::Insert(at, piece) => drop(bytes.splice(start(at)..start(at), piece.iter().copied())),
            Self::Overwrite(at, piece) => drop(bytes.splice(range(at, &piece.len()), piece.iter().copied())),
            Self::Remove(at, length) => drop(bytes.drain(range(at, length))),
            Self::Repeat(at, length) => {
                let again = bytes[range(at, length)].to_vec();
                bytes.splice(start(at)..start(at), again);
            }
            Self::Cut(at) => bytes.truncate(start(at)),
        }
    }
}

/// Every promise that [`parse`] makes about what it returns, or a readable refusal.
fn check_promises(bytes: &[u8], format: Format, options: &ReadOptions) -> Result<bool, TestCaseError> {
    let set = match parse(bytes, format, options) {
        Ok(set) => set,
        Err(error) => {
            let message = error.to_string();
            prop_assert!(!message.is_empty() && message.len() < 400 && !message.contains('\n'), "{}", message);
            return Ok(false);
        }
    };
    let cells = if format == Format::Pyp { options.tile[0] as usize * options.tile[1] as usize } else { 1 };
    prop_assert!(point_count(&set) <= bytes.len() * cells, "more points than bytes");
    prop_assert!(point_count(&set) as u64 <= options.max_points, "more points than allowed");
    for curve in &set.curves {
        let points = &curve.points;
        prop_assert!(points.len() >= if curve.closed { 3 } else { 2 }, "too few points");
        prop_assert!(points.iter().all(|point| point.is_finite()), "coordinates that are not finite");
        prop_assert!(!curve.closed || points.first() != points.last(), "the first point is repeated");
        if curve.basis != Basis::BSpline {
            prop_assert!(points.windows(2).all(|pair| pair[0] != pair[1]), "duplicates are left");
        }
        if let Some(radii) = &curve.radii {
            prop_assert_eq!(radii.len(), points.len());
            prop_assert!(radii.iter().all(|radius| radius.is_finite() && *radius >= 0.0), "a radius is wrong");
        }
    }
    Ok(true)
}

const BASES: &[Option<Basis>] = &[None, Some(Basis::CatmullRom), Some(Basis::BSpline), Some(Basis::Linear)];

/// Damages small sound files and tells how many were still read.
fn fuzz(format: Format, seeds: Vec<Vec<u8>>) {
    let cases = match env::var("YARNRAY_FUZZ_CASES") {
        Ok(text) => text.parse().expect("YARNRAY_FUZZ_CASES must be a whole number"),
        Err(_) => FUZZ_CASES,
    };
    let options = (prop::sample::select(BASES), [1..5_u32, 1..5_u32], 1..200_u64)
        .prop_map(|(basis, tile, max_points)| ReadOptions { basis, tile, max_points, ..ReadOptions::default() });
    let strategy = (prop::sample::select(seeds), prop::collection::vec(Damage::strategy(), 0..6), options);
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let read = std::cell::Cell::new(0_u32);
    let result = runner.run(&strategy, |(mut bytes, damages, options)| {
        for damage in &damages {
            damage.apply(&mut bytes);
        }
        read.set(read.get() + u32::from(check_promises(&bytes, format, &options)?));
        Ok(())
    });
    if let Err(failure) = result {
        panic!("{failure}");
    }
    eprintln!("{format:?}: {} of {cases} damaged files were still read", read.get());
    // Were all refused, nothing behind the first check would be tested.
    assert!(read.get() > cases / 20, "only {} of {cases} files were read", read.get());
    assert!(read.get() < cases, "no file was refused");
}

#[test]
fn hostile_bcc_files_do_no_harm() {
    let typed = |kind: &[u8; 2]| {
        let mut bytes = small_bcc();
        bytes[4..6].copy_from_slice(kind);
        bytes
    };
    let mut long = small_bcc();
    long[3] = 0x48;
    fuzz(Format::Bcc, vec![typed(b"C0"), typed(b"BS"), typed(b"PL"), long, vec![]]);
}

#[test]
fn hostile_patterns_do_no_harm() {
    let along_x = "*pattern # n\n10 20 0.5 2\n*Q\n1 1 0 0\n5 1 0 0\n*E\n0 1 0 -1\n1 0 1 1\n*RL\n1\n1\n";
    let diagonal = "*pattern\n1 1 0.1 3\n\n*Q\n0 0 0 0\n.5 0 0 0\n.2 .3 0 0\n\n*E # e\n0 1 1 0\n1 0 1 1\n2 2 -2 1\n";
    let ring =
        "*pattern\r\n1 1 0.1 3\r\n*Q\r\n0 0 0 0\r\n.5 0 0 0\r\n.2 .3 0 0\r\n*E\r\n0 1 0 0\r\n1 2 0 0\r\n2 0 0 0\r\n";
    fuzz(Format::Pyp, [along_x, diagonal, ring].map(|text| text.as_bytes().to_vec()).to_vec());
}

#[test]
fn hostile_text_files_do_no_harm() {
    let plain = "# x y z\n0 0 0\n1 0 0\n0 1 0\n0 0 0\n\n1 2 3\n4 5 6\n";
    let with_radii = "0 0 0 1\n0 0 0 1\n1 0 0 .5\n\n\n1 2 3 0\n4 5 6e-3 0\n4 5 6e-3 0\n";
    fuzz(Format::Text, [plain, with_radii].map(|text| text.as_bytes().to_vec()).to_vec());
}
