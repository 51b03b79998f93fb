//! Damaged scene files. Case i is made from i alone, so that a failure can be run again.

use std::panic::{AssertUnwindSafe, catch_unwind};

use yarnray::scene::load::{LoadOptions, load};

use crate::support::{SWATCH, directory, weave_text, write};

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
