//! Damaged files: scenes, curves, drafts, instructions; stages are damaged beside their readers. Case i is made from i alone, so that a failure can be run again.

use std::panic::{AssertUnwindSafe, catch_unwind};

use yarnray::{
    files::curve_file::{self, Format, ReadOptions},
    geometry::curve::CurveSet,
    pattern::{chart::Chart, knitspeak, straight, wif},
    scene::load::{LoadOptions, load},
};

use crate::support::{SWATCH, directory, project, weave_text, write};

/// A small generator of random numbers: splitmix64.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n as u64) as usize
    }

    fn of<'a>(&mut self, list: &[&'a str]) -> &'a str {
        list[self.below(list.len())]
    }
}

const VALUES: [&str; 30] = [
    "0",
    "-1",
    "1",
    "2",
    "0.5",
    "1e308",
    "-1e308",
    "1e-320",
    "nan",
    "inf",
    "-inf",
    "true",
    "\"frame\"",
    "[]",
    "{}",
    "[0, 0, 0]",
    "[1, nan, 2]",
    "\"\"",
    "9223372036854775807",
    "-0.0",
    "1e39",
    "1e-45",
    "89.9",
    "360",
    "{ type = \"straight\" }",
    "{ type = \"file\", path = \"weave.txt\" }",
    "\"in\"",
    "[[1]]",
    "64",
    "1e17",
];

const LINES: [&str; 14] = [
    "[render]",
    "[[fabric]]",
    "[[light]]",
    "type = \"point\"",
    "position = [0, 0, 0]",
    "unit = \"um\"",
    "phase = [1, 2]",
    "[ground]",
    "height = 1e300",
    "[yarn.wool3.ply]",
    "[[yarn.wool3.ply]]",
    "ply_radius = 0.2",
    "crop = [0, 0, 1, 1]",
    "scale = 1e-200",
];

fn damaged(random: &mut Random) -> Vec<u8> {
    let mut lines: Vec<String> = SWATCH.lines().map(str::to_owned).collect();
    if random.below(3) == 0 {
        for line in &mut lines {
            if line.starts_with("source") {
                *line = "source = { type = \"file\", path = \"weave.txt\", basis = \"b-spline\" }".to_owned();
            }
        }
    }
    for _ in 0..=random.below(4) {
        let at = random.below(lines.len());
        match random.below(6) {
            // One value becomes another: the deepest errors lie beyond the parser.
            0..=2 => {
                if let Some((key, _)) = lines[at].clone().split_once('=') {
                    lines[at] = format!("{key}= {}", random.of(&VALUES));
                }
            }
            3 => lines.insert(at, random.of(&LINES).to_owned()),
            4 => {
                lines.remove(at);
                if lines.is_empty() {
                    lines.push(String::new());
                }
            }
            _ => {
                let other = random.below(lines.len());
                lines.swap(at, other);
            }
        }
    }
    let mut bytes = lines.join("\n").into_bytes();
    if random.below(4) == 0 {
        for _ in 0..=random.below(3) {
            let at = random.below(bytes.len().max(1));
            match random.below(3) {
                0 if at < bytes.len() => bytes[at] = random.below(256) as u8,
                1 => bytes.truncate(at),
                _ => bytes.insert(at.min(bytes.len()), b"\"[]{}=.#\n'\\-\xff"[random.below(13)]),
            }
        }
    }
    bytes
}

#[test]
fn damaged_scenes_never_panic() {
    let cases = std::env::var("YARNRAY_FUZZ_CASES").ok().and_then(|c| c.parse().ok()).unwrap_or(4000_u64);
    let directory = directory();
    write(directory.path(), "weave.txt", weave_text(2));
    let mut loaded = 0;
    for case in 0..cases {
        let mut random = Random(case);
        let text = damaged(&mut random);
        let path = write(directory.path(), "fuzz.toml", &text);
        let result = catch_unwind(AssertUnwindSafe(|| load(&path, &LoadOptions::default())));
        match result {
            Ok(Ok(_)) => loaded += 1,
            Ok(Err(error)) => {
                let message = error.to_string();
                assert!(message.contains("error: "), "case {case}: {message:?}");
            }
            Err(_) => panic!("case {case} panicked:\n{}", String::from_utf8_lossy(&text)),
        }
    }
    eprintln!("{loaded} of {cases} damaged scenes were still loaded");
    assert!(loaded > 0, "damage must leave some scenes whole, or nothing behind the parser is reached");
}

/// A few bytes cut off, changed, put in or said twice.
fn battered(whole: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for _ in 0..=random.below(4) {
        let at = random.below(bytes.len().max(1));
        match random.below(6) {
            0 => bytes.truncate(at),
            1 => bytes.insert(at.min(bytes.len()), b"-9e[]{}=.#\n*"[random.below(12)]),
            2 => {
                let piece =
                    bytes[at.min(bytes.len())..].iter().copied().take(1 + random.below(40)).collect::<Vec<u8>>();
                bytes.splice(at.min(bytes.len())..at.min(bytes.len()), piece);
            }
            _ if at < bytes.len() => bytes[at] = random.below(256) as u8,
            _ => {}
        }
    }
    bytes
}

/// Reads damaged files with `read`, which gives the words of its error; some are still sound, some are not.
fn batter(name: &str, whole: &[u8], cases: u64, read: impl Fn(&[u8]) -> Result<(), String>) {
    assert_eq!(read(whole), Ok(()), "{name}");
    let (mut good, mut bad) = (0, 0);
    for case in 0..cases {
        let bytes = battered(whole, &mut Random(case));
        match catch_unwind(AssertUnwindSafe(|| read(&bytes))) {
            Ok(Ok(())) => good += 1,
            Ok(Err(message)) => {
                assert!(!message.is_empty() && message.len() < 1000, "{name} {case}: {message}");
                bad += 1;
            }
            Err(_) => panic!("{name}, case {case} panicked:\n{}", String::from_utf8_lossy(&bytes)),
        }
    }
    assert!(good > 0 && bad > 0, "{name}: {good} are read, {bad} are not");
}

#[test]
fn damaged_curves_drafts_and_instructions_never_panic() {
    let folder = directory();
    let at = folder.path();
    let mut set = CurveSet { curves: straight(3, 4.0, 0.6), ..CurveSet::default() };
    for curve in &mut set.curves {
        curve.radii = Some(vec![0.2; curve.points.len()]);
    }
    let small = ReadOptions { max_points: 100_000, ..ReadOptions::default() };
    let formats = [("a.bcc", Format::Bcc), ("a.hair", Format::Hair), ("a.obj", Format::Obj), ("a.txt", Format::Text)];
    for (name, format) in formats.into_iter().chain([("a.yarns", Format::Yarns)]) {
        let mut bytes = Vec::new();
        curve_file::write(at.join(name).as_path(), &set, &mut bytes).unwrap();
        let read = |bytes: &[u8]| curve_file::parse(bytes, format, &small).map(|_| ()).map_err(|e| e.to_string());
        batter(name, &bytes, 3000, read);
    }
    let mesh = "L k -l1 +y1 +l1 -y1\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 2 0\nv 0 2 0\nf 1 2 3 4\nT 1\nf 4 3 5 6\nT 1\ne 1/3 2/-1\n";
    let faces = "face k\nedge (-1,-1) -l1\nedge (1,-1) +y1\nedge (1,1) +l1\nedge (-1,1) -y1\nyarn [3:0.5,0] (-0.5,0,0.1) [2:0.7,0]\n\
                 yarn [2:0.3,0] (0.5,0,0.1) [1:0.5,0]\nyarn [0:0.3,0] (0,0.6,-0.1) [0:0.7,0]\n";
    let stitch_mesh = |mesh: &[u8], faces: &[u8]| {
        write(at, "a.smobj", mesh);
        write(at, "a.sf", faces);
        curve_file::read(&at.join("a.smobj"), &small).map(|_| ()).map_err(|e| e.to_string())
    };
    batter("a.smobj", mesh.as_bytes(), 1000, |bytes| stitch_mesh(bytes, faces.as_bytes()));
    batter("a.sf", faces.as_bytes(), 1000, |bytes| stitch_mesh(mesh.as_bytes(), bytes));
    let tartan = std::fs::read(project("tests/data/drafts/tartan.wif")).unwrap();
    batter("tartan.wif", &tartan, 2000, |bytes| {
        let file = wif::parse(bytes).map_err(|e| e.to_string())?;
        file.woven(wif::WifUse::default()).map(|_| ()).map_err(|e| e.to_string())
    });
    let rows = "Row 1 (RS): k2, *p2, k2; rep from * to end.\nRow 2: p2, *k2, p2; rep from * to end.\n";
    batter("instructions", rows.as_bytes(), 3000, |bytes| {
        let text = String::from_utf8_lossy(bytes);
        let rows = knitspeak::chart_rows(&text, 10).map_err(|e| e.to_string())?;
        Chart::parse(&rows).map(|_| ()).map_err(|e| e.to_string())
    });
    let turns = "Cast on 12 sts.\nRow 1 (RS): k5, turn, p5, turn, k to end\nRow 2: p\n\
                 Row 3: [k2, turn, p2, turn] 3 times, k2tog, k to last 2 sts, kfb, k1\n\
                 Repeat rows 2-3 until piece measures 3 cm, ending with a WS row.\n";
    for (text, asked) in [rows, turns].into_iter().zip([(Some(7), false), (None, true)]) {
        batter("worked instructions", text.as_bytes(), 1000, |bytes| {
            let text = String::from_utf8_lossy(bytes);
            let written = knitspeak::Instructions::read(&text).map_err(|e| e.to_string())?;
            let asked = knitspeak::Asked::new(asked.0, asked.1);
            written.work_piece(10, asked, 12).map(|_| ()).map_err(|e| e.to_string())
        });
    }
}
