//! Written knitting instructions (KnitSpeak) as rows of a chart.
//!
//! `Row 1 (RS): k2, *p2, k2; rep from * to end.` is what patterns in books and on Stitch-Maps say. Rows on the wrong side
//! are worked from the other end and show the other face of each stitch; rounds are worked on the right side. Repeats to
//! the end depend on the stitches on the needle, so rows are counted from the cast-on on, and each becomes a row of a
//! chart over the whole width. A row that turns leaves the rest of the stitches for later, and the next one begins there.

mod rows;
#[cfg(test)]
mod tests;
mod words;

use std::fmt;

use rows::written_rows;

/// Why instructions could not be followed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KnitSpeakError {
    /// Line of the text, from 0, if it is about one.
    pub line: Option<usize>,
    /// What is wrong.
    pub problem: String,
    /// What to do.
    pub hint: String,
}

impl fmt::Display for KnitSpeakError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}", self.problem, self.hint)
    }
}

impl std::error::Error for KnitSpeakError {}

type Result<T> = std::result::Result<T, KnitSpeakError>;

fn error<T>(line: usize, problem: impl Into<String>, hint: impl Into<String>) -> Result<T> {
    Err(KnitSpeakError { line: Some(line), problem: problem.into(), hint: hint.into() })
}

/// Most rows, and most stitches of one.
const MOST_ROWS: usize = 20_000;

const MOST_STITCHES: u32 = 20_000;

/// Rounds of repeats in a row, within each other counted too.
const MOST_ROUNDS: u32 = 1_000_000;

/// How deep repeats may lie in one another.
const MOST_NESTED: usize = 16;

const KNOWN: &str = "k, p, ktbl, ptbl, yo, k2tog, ssk, skp, p2tog, ssp, k3tog, sssk, sk2p, p3tog, cdd, kfb, m1l, m1r, sl1, \
                     sl1 wyif, tuck, mb, turn, w&t, ds and cables such as c4f and 2/1 LC are known; write repeats as *...; rep from * to end, \
                     [...] 3 times";

/// The rows of a chart, from the cast-on edge up, each from left to right as seen from the right side.
///
/// # Errors
/// A word that is none, a row that does not fit the stitches it finds, rows that are missing or come twice.
pub fn chart_rows(text: &str, cast_on: u32) -> Result<Vec<String>> {
    let rows = written_rows(text)?;
    let mut found = cast_on;
    // Stitches that the row before has left when it turned.
    let mut behind = 0;
    rows.iter()
        .enumerate()
        .map(|(i, row)| {
            let (worked, ahead) = row.body.work(found, behind, row.line, i + 1)?;
            behind = ahead;
            found = worked.iter().map(|s| s.makes * s.count).sum();
            if found == 0 || found > MOST_STITCHES {
                return error(row.line, format!("row {} makes {found} stitches", i + 1), "1 to 20000 fit on a needle");
            }
            row.side.seen_from_right(worked, row.line)
        })
        .collect()
}

/// Which side faces the knitter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Right,
    Wrong,
}

/// A row as it is written.
#[derive(Clone, Debug)]
struct Written {
    line: usize,
    side: Side,
    body: Sequence,
}

/// One or more of the same step.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Steps {
    name: String,
    takes: u32,
    makes: u32,
    count: u32,
}

#[derive(Clone, Debug)]
enum Item {
    Steps(Steps),
    /// A step until so many stitches are left.
    Until(Steps, u32),
    /// A sequence so many times.
    Times(Sequence, u32),
    /// A sequence until so many stitches are left.
    Repeat(Sequence, u32),
    /// The row ends here.
    Turn,
}

#[derive(Clone, Debug, Default)]
struct Sequence(Vec<Item>);

impl Sequence {
    /// The steps of a row that finds so many stitches and begins where `behind` of them were left; and how many it leaves itself.
    fn work(&self, found: u32, behind: u32, line: usize, row: usize) -> Result<(Vec<Steps>, u32)> {
        let unworked = |count| Steps { name: "-".to_owned(), takes: 1, makes: 1, count };
        let mut out: Vec<Steps> = Vec::new();
        push(&mut out, unworked(behind));
        let (mut left, mut rounds) = (found - behind, MOST_ROUNDS);
        self.follow(&mut left, &mut out, &mut rounds, line, row)?;
        if left > 0 && !matches!(self.0.last(), Some(Item::Turn)) {
            let problem = format!("row {row} leaves {left} of {} stitches unworked", found - behind);
            return error(line, problem, "rep from * to end, `turn` for a short row, or another number of `stitches`");
        }
        push(&mut out, unworked(left));
        Ok((out, left))
    }

    fn takes(&self) -> u32 {
        let of = |item: &Item| match item {
            Item::Steps(steps) => steps.takes.saturating_mul(steps.count),
            Item::Times(sequence, times) => sequence.takes().saturating_mul(*times),
            Item::Until(..) | Item::Repeat(..) | Item::Turn => 0,
        };
        self.0.iter().map(of).fold(0, u32::saturating_add)
    }

    /// `rounds` are those that are left: repeats of what takes no stitch would never end.
    fn follow(&self, left: &mut u32, out: &mut Vec<Steps>, rounds: &mut u32, line: usize, row: usize) -> Result<()> {
        let Some(fewer) = rounds.checked_sub(1) else {
            return error(line, format!("row {row} repeats more than {MOST_ROUNDS} times"), "fewer repeats");
        };
        *rounds = fewer;
        for item in &self.0 {
            match item {
                Item::Steps(steps) => {
                    let takes = steps.takes.saturating_mul(steps.count);
                    if takes > *left {
                        let problem = format!("row {row} needs {takes} stitches for {}, {left} are left", steps.name);
                        return error(line, problem, "another number of `stitches` fits");
                    }
                    *left -= takes;
                    push(out, steps.clone());
                }
                Item::Until(steps, last) => {
                    let room = left.saturating_sub(*last);
                    if steps.takes == 0 || !room.is_multiple_of(steps.takes) {
                        return error(line, format!("row {row}: {} does not fit {room} stitches", steps.name), KNOWN);
                    }
                    push(out, Steps { count: room / steps.takes, ..steps.clone() });
                    *left -= room;
                }
                Item::Turn => {}
                Item::Times(sequence, times) => {
                    for _ in 0..*times {
                        sequence.follow(left, out, rounds, line, row)?;
                    }
                }
                Item::Repeat(sequence, last) => {
                    let takes = sequence.takes();
                    let room = left.saturating_sub(*last);
                    if takes == 0 || room == 0 || !room.is_multiple_of(takes) {
                        let rest = room.checked_rem(takes).unwrap_or(0);
                        let problem = format!("row {row} repeats over {takes} stitches, but has {room} for it");
                        return error(line, problem, format!("{rest} fewer `stitches`, or {} more, fit", takes - rest));
                    }
                    for _ in 0..room / takes {
                        sequence.follow(left, out, rounds, line, row)?;
                    }
                }
            }
            if out.len() > MOST_STITCHES as usize {
                return error(line, format!("row {row} has more than {MOST_STITCHES} steps"), "fewer repeats");
            }
        }
        Ok(())
    }
}

fn push(out: &mut Vec<Steps>, steps: Steps) {
    match out.last_mut() {
        Some(last) if last.name == steps.name => last.count = last.count.saturating_add(steps.count),
        _ if steps.count > 0 => out.push(steps),
        _ => {}
    }
}

impl Side {
    /// The steps of a worked row as a row of a chart.
    fn seen_from_right(self, mut worked: Vec<Steps>, line: usize) -> Result<String> {
        match self {
            // Rows on the right side run from right to left.
            Self::Right => worked.reverse(),
            Self::Wrong => {
                for steps in &mut worked {
                    let Some(name) = other_face(&steps.name) else {
                        let problem = format!("{} on the wrong side has no stitch that shows it", steps.name);
                        return error(line, problem, "work it on a right-side row");
                    };
                    steps.name = name.to_owned();
                }
            }
        }
        let words = worked.iter().map(|s| match (s.name.as_str(), s.count) {
            (name, 1) => name.to_owned(),
            ("k" | "p" | "-", n) => format!("{}{n}", s.name),
            (name, n) => vec![name; n as usize].join(" "),
        });
        Ok(words.collect::<Vec<String>>().join(" "))
    }
}

/// What a step on the wrong side looks like from the right side.
fn other_face(name: &str) -> Option<&'static str> {
    const FACES: [(&str, &str); 11] = [
        ("k", "p"),
        ("ktbl", "ptbl"),
        ("k2tog", "p2tog"),
        ("ssk", "ssp"),
        ("k3tog", "p3tog"),
        ("yo", "yo"),
        // The yarn in front of the knitter is behind the cloth.
        ("sl", "slwyif"),
        ("tuck", "tuck"),
        ("ds", "ds"),
        ("-", "-"),
        ("miss", "miss"),
    ];
    FACES.iter().find_map(|&(a, b)| {
        if name == a {
            Some(b)
        } else if name == b {
            Some(a)
        } else {
            None
        }
    })
}

fn starts_with(text: &str, words: &str) -> bool {
    text.get(..words.len()).is_some_and(|start| start.eq_ignore_ascii_case(words))
}

/// A piece of the text for a message.
fn short(text: &str) -> String {
    text.chars().take(30).collect::<String>().escape_debug().to_string()
}
