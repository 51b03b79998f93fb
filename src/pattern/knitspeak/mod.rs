//! Written knitting instructions (KnitSpeak) as rows of a chart.
//!
//! `Row 1 (RS): k2, *p2, k2; rep from * to end.` is what patterns in books and on Stitch-Maps say, with the abbreviations of
//! the Craft Yarn Council. Rows on the wrong side are worked from the other end and show the other face of each stitch; rounds
//! are worked on the right side. Repeats to the end depend on the stitches on the needle, so rows are counted from the cast-on
//! on, and each becomes a row of a chart over the whole width. A row that turns leaves the rest of the stitches for later, and
//! the next one begins there.

mod brioche;
mod lines;
mod needle;
mod parser;
mod place;
mod rows;
mod step;
#[cfg(test)]
mod tests;
mod turns;
mod words;

use std::fmt;

use needle::Needle;
pub use rows::EveryFew;
use rows::{Again, Until, written};
use turns::{Stop, Turn};

use crate::input::diagnostic::excerpt;

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

/// How many stitches there may be.
fn stitches_that_fit() -> String {
    format!("1 to {MOST_STITCHES} fit on a needle")
}

/// Rounds of repeats in a row, within each other counted too.
const MOST_ROUNDS: u32 = 1_000_000;

/// How deep repeats may lie in one another.
const MOST_NESTED: usize = 16;

const KNOWN: &str = "k, p, tbl, yo, k2tog, ssk, skp, p2tog, ssp, k3tog, sssk, sk2p, p3tog, cdd, kfb, pfb, m1l, m1r, m1p, sl1, \
                     sl1 wyif, tuck, sl1yo, brk1, brp1, mb, turn, w&t, ds and cables such as c4f, 2/1 LC and LT are known; write \
                     repeats as *...; rep from * to end, [...] 3 times";

/// Instructions that have been read: which rows they are of, but not over how many stitches.
#[derive(Clone, Debug)]
pub struct Instructions {
    rows: Vec<Written>,
    /// How many of them, from the first one, are knitted once only: set-up rows.
    set_up: usize,
    again: Option<Again>,
    cast_on: Option<u32>,
    height: Option<f64>,
    ending: Option<EveryFew>,
    ends: bool,
}

/// When a piece ends that is repeated without another end.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WrittenEnd {
    /// How high it is to be, mm: [`Instructions::height`].
    pub height: Option<f64>,
    /// After how many rows it may end: [`Instructions::ending`].
    pub ending: Option<EveryFew>,
}

/// Rows of a chart, as instructions make them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Worked {
    /// From the cast-on edge up, each from left to right as seen from the right side.
    pub rows: Vec<String>,
    /// Whether the piece ends with them: they are shaped, or told to be repeated so often, or bound off. Else they may be repeated.
    pub whole: bool,
}

/// The rows of a chart, from the cast-on edge up, each from left to right as seen from the right side.
///
/// # Errors
/// A word that is none, a row that does not fit the stitches it finds, rows that are missing or come twice.
pub fn chart_rows(text: &str, cast_on: u32) -> Result<Vec<String>> {
    Ok(Instructions::read(text)?.work(cast_on, 0)?.rows)
}

/// How many rows are asked for of written instructions, beside what they say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// None: a piece as high as its text says, or of as many rows as charts have.
    Nothing,
    /// So many: where the text says no end, shaped rows go on too.
    Rows(u32),
    /// As many as a height takes, which is known when stitches have a size; shaped rows go on as well. The last of those that are worked are seldom
    /// wanted: they end where a row cannot be knitted.
    Height,
}

impl Asked {
    /// What is asked for by a count of rows, or else by a height if there is one.
    pub fn new(rows: Option<u32>, has_height: bool) -> Self {
        match rows {
            Some(rows) => Self::Rows(rows),
            None if has_height => Self::Height,
            None => Self::Nothing,
        }
    }
}

/// Rows that are worked for a height: so many are enough.
const ROWS_FOR_A_HEIGHT: usize = 2000;

impl Instructions {
    /// Reads instructions.
    ///
    /// # Errors
    /// A word that is none, rows that are missing or come twice.
    pub fn read(text: &str) -> Result<Self> {
        written(text)
    }

    /// How many stitches they say to cast on, if they do.
    pub fn cast_on(&self) -> Option<u32> {
        self.cast_on
    }

    /// How high the piece is to be, mm, if they repeat rows until it measures so much.
    pub fn height(&self) -> Option<f64> {
        self.height.filter(|_| self.again.as_ref().is_some_and(|again| again.until == Until::Open))
    }

    /// After how many rows repeats without an end may stop, if they say which row is the last.
    pub fn ending(&self) -> Option<EveryFew> {
        self.ending.filter(|_| self.again.as_ref().is_some_and(|again| again.until == Until::Open))
    }

    /// Both.
    pub fn end(&self) -> WrittenEnd {
        WrittenEnd { height: self.height(), ending: self.ending() }
    }

    /// Works a piece of as many rows as are asked for, or of as many as charts have `otherwise`; and tells how many rows it has unless they are asked
    /// for.
    ///
    /// # Errors
    /// As [`Self::work`].
    pub fn work_piece(&self, cast_on: u32, asked: Asked, otherwise: u32) -> Result<(Worked, u32)> {
        let rows = self.ending().map_or(otherwise, |ending| ending.from(otherwise));
        let asked = match asked {
            Asked::Nothing if self.height().is_some() => Asked::Height,
            asked => asked,
        };
        let worked = self.worked(cast_on, asked, rows as usize)?;
        let rows = if worked.whole { worked.rows.len() as u32 } else { rows };
        Ok((worked, rows))
    }

    /// Works them over so many stitches. What they tell to repeat without an end, and does not repeat from the first row on
    /// with as many stitches, is repeated for at least `least` rows. Fewer rows than that, if they are an odd number of a flat piece, are
    /// worked once more from the other side.
    ///
    /// # Errors
    /// A row that does not fit the stitches it finds, or does not make as many as it says.
    pub fn work(&self, cast_on: u32, least: usize) -> Result<Worked> {
        self.worked(cast_on, Asked::Nothing, least)
    }

    /// As [`Self::work`], for at least `otherwise` rows where nothing is asked for.
    fn worked(&self, cast_on: u32, asked: Asked, otherwise: usize) -> Result<Worked> {
        let mut needle = Needle::new(cast_on, &self.rows);
        let (set_up, pattern) = self.rows.split_at(self.set_up);
        set_up.iter().try_for_each(|row| needle.work(row))?;
        let begun = needle.found;
        pattern.iter().try_for_each(|row| needle.work(row))?;
        // Rows that turn are there as often as they are told, as those that change the number of stitches.
        let shaped = needle.found != cast_on || self.turns();
        let more_asked = asked != Asked::Nothing;
        let least = if let Asked::Rows(rows) = asked { rows as usize } else { otherwise };
        // Over an odd number of rows the other side comes next.
        let other_side_next = needle.next != self.rows[0].side;
        let from_both_sides = !shaped && needle.behind == 0 && other_side_next && needle.rows.len() < least;
        // What set-up rows are for is repeated, whether it is told or not; so is what is shaped, where more rows are asked for.
        let goes_on = !pattern.is_empty()
            && !self.ends
            && if set_up.is_empty() {
                shaped && more_asked || from_both_sides
            } else {
                needle.found == begun || more_asked
            };
        let implied = || Again {
            rows: (self.set_up..self.rows.len()).collect(),
            until: Until::Open,
            line: self.rows[self.set_up].line,
        };
        let Some(again) = &self.again.clone().or_else(|| goes_on.then(implied)) else {
            return Ok(Worked { rows: needle.rows, whole: self.ends || shaped });
        };
        match again.until {
            Until::Left(count) | Until::Have(count) => self.work_until(again, count, &mut needle)?,
            Until::Open => {
                let all = again.rows.iter().copied().eq(0..self.rows.len());
                if all && !shaped && needle.behind == 0 {
                    if other_side_next {
                        (0..again.rows.len()).try_for_each(|k| needle.work(&self.copy(again, &needle, k)))?;
                    }
                    // Bound off behind no height, they are as many as those of a chart.
                    return Ok(Worked { rows: needle.rows, whole: self.ends && self.height.is_some() });
                }
                let least = if asked == Asked::Height { ROWS_FOR_A_HEIGHT } else { least }.min(MOST_ROWS);
                for k in 0.. {
                    let count = needle.rows.len();
                    if count >= least && self.ending.is_none_or(|ending| ending.holds(count as u32)) {
                        break;
                    }
                    match needle.work(&self.copy(again, &needle, k)) {
                        Err(_) if asked == Asked::Height => break,
                        worked => worked?,
                    }
                }
            }
        }
        Ok(Worked { rows: needle.rows, whole: true })
    }

    /// The row that is repeated as the `k`-th after those that are written.
    fn copy(&self, again: &Again, needle: &Needle, k: usize) -> Written {
        let row = &self.rows[again.rows[k % again.rows.len()]];
        // Rows go on by turns, whichever they repeat.
        Written { line: again.line, side: needle.next, count: None, ..row.clone() }
    }

    /// Repeats rows until there are so many stitches.
    fn work_until(&self, again: &Again, count: u32, needle: &mut Needle) -> Result<()> {
        let is_past = |found: u32, begun: u32| if begun < count { found > count } else { found < count };
        let begun = needle.found;
        let mut at_last = None;
        let mut next = 0;
        while needle.found != count {
            let is_whole = next % again.rows.len() == 0;
            let stuck = is_whole && (at_last == Some(needle.found) || needle.rows.len() > MOST_ROWS);
            if stuck || is_past(needle.found, begun) {
                let (found, row) = (needle.found, needle.rows.len());
                let problem = match again.until {
                    Until::Left(_) => format!("{count} stitches never remain: {found} do after row {row}"),
                    _ => format!("there are never {count} stitches: {found} are there after row {row}"),
                };
                let hint = "another number of `stitches` fits, or rows that make fewer or more than they find";
                return error(again.line, problem, hint);
            }
            if is_whole {
                at_last = Some(needle.found);
            }
            needle.work(&self.copy(again, needle, next))?;
            next += 1;
        }
        // What remains is taken off at once. Else the repeat is worked to its end, if it keeps the stitches.
        let is_last = |rows: usize, next: usize| match self.ending {
            Some(ending) => ending.holds(rows as u32),
            None => matches!(again.until, Until::Left(_)) || next.is_multiple_of(again.rows.len()),
        };
        let mut ahead = needle.clone();
        for next in next..=next + again.rows.len() {
            if is_last(ahead.rows.len(), next) {
                *needle = ahead;
                return Ok(());
            }
            if ahead.work(&self.copy(again, &ahead, next)).is_err() || ahead.found != count {
                break;
            }
        }
        match self.ending {
            None => Ok(()),
            Some(_) => {
                let problem = format!(
                    "the row with {count} stitches, row {}, is not the one it is to end with",
                    needle.rows.len()
                );
                error(again.line, problem, "leave out what it ends with, or another number of stitches")
            }
        }
    }

    /// Whether any row turns before its end.
    fn turns(&self) -> bool {
        self.rows.iter().any(|row| row.body.turns())
    }
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
    /// Whether it goes round.
    round: bool,
    /// The side that it says it is on.
    said: Option<Side>,
    /// How many stitches it says that it has in the end.
    count: Option<u32>,
    /// Whether the next row is of the same side, as the second colour's in brioche: the stitches are slid to the other end.
    slides: bool,
    body: Sequence,
}

impl Written {
    /// How many times it brings the next row to the other side than a row that goes from end to end.
    fn flips(&self) -> usize {
        self.body.parts().count().saturating_sub(1) + usize::from(self.slides)
    }
}

/// One or more of the same step.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Steps {
    name: String,
    takes: u32,
    makes: u32,
    count: u32,
}

impl Steps {
    /// So many stitches, each of one.
    fn of(name: &str, count: u32) -> Self {
        Self { name: name.to_owned(), takes: 1, makes: 1, count }
    }
}

/// Stitches that are told by how they look from the right side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Look {
    Knit,
    Purl,
    /// As those below.
    Below,
}

#[derive(Clone, Debug)]
enum Item {
    Steps(Steps),
    /// A step as far as that.
    Until(Steps, Stop),
    /// Stitches that look so, as far as that.
    Look(Look, Stop),
    /// A sequence so many times.
    Times(Sequence, u32),
    /// A sequence as far as that.
    Repeat(Sequence, Stop),
    /// The yarn turns.
    Turn(Turn),
    /// Stitches around which wraps lie, which are worked with them.
    Wrapped(Steps),
    /// A double stitch, which is worked as one.
    Doubled(Steps),
    /// Wraps are worked with their stitches, in this row or from here on.
    PickUp {
        always: bool,
    },
    /// The stitches are slid to the other end of the needle: the next row is of the same side.
    Slide,
}

#[derive(Clone, Debug, Default)]
struct Sequence(Vec<Item>);

impl Side {
    fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Wrong => "wrong",
        }
    }

    fn other(self) -> Self {
        match self {
            Self::Right => Self::Wrong,
            Self::Wrong => Self::Right,
        }
    }

    /// The steps of a worked row as a row of a chart.
    fn seen_from_right(self, mut worked: Vec<Steps>, line: usize, row: usize) -> Result<String> {
        match self {
            // Rows on the right side run from right to left.
            Self::Right => worked.reverse(),
            Self::Wrong => {
                for steps in &mut worked {
                    let Some(name) = other_face(&steps.name) else {
                        let problem =
                            format!("row {row}: {} on the wrong side has no stitch that shows it", steps.name);
                        return error(line, problem, "work it on a right-side row");
                    };
                    steps.name = name.to_owned();
                }
            }
        }
        let words = worked.iter().map(|s| match (s.name.as_str(), s.count) {
            (name, 1) => name.to_owned(),
            ("k" | "p" | "bo" | "bop" | "co" | "-", n) => format!("{}{n}", s.name),
            (name, n) => vec![name; n as usize].join(" "),
        });
        Ok(words.collect::<Vec<String>>().join(" "))
    }
}

/// What a step on the wrong side looks like from the right side.
fn other_face(name: &str) -> Option<&'static str> {
    const FACES: [(&str, &str); 18] = [
        ("k", "p"),
        ("ktbl", "ptbl"),
        ("k2tog", "p2tog"),
        ("ssk", "ssp"),
        ("k3tog", "p3tog"),
        ("sssk", "sssp"),
        ("cdd", "cddp"),
        ("kfb", "pfb"),
        // Which of two crossed legs is on top is the same from both sides.
        ("m1l", "m1lp"),
        ("m1r", "m1rp"),
        ("yo", "yo"),
        // The yarn in front of the knitter is behind the cloth.
        ("sl", "slwyif"),
        ("tuck", "tuck"),
        ("ds", "ds"),
        ("bo", "bop"),
        ("co", "co"),
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

/// A piece of the text for a message.
fn short(text: &str) -> String {
    excerpt(text.trim(), 30)
}
