//! Knitting charts: rows of steps, written as knitters write them, and the stitches that come of them.
//!
//! A chart is a list of rows from the cast-on edge upwards, each written from left to right as seen from the right side:
//!
//! | step | what it makes |
//! |---|---|
//! | `k`, `k4` | knit stitches |
//! | `p`, `p2` | purl stitches |
//! | `k2tog`, `ssk` | one stitch of two; the left one of the two on top (leans right), or the right one (leans left) |
//! | `kfb` | two stitches of one |
//! | `yo` | a stitch of none: an eyelet |
//! | `c4f`, `c4b` | a cable: two stitches cross two; those that move to the left pass in front, or at the back. Any even number up to 12 |
//!
//! `12: k2 p2` stands for twelve such rows. A row is repeated over the whole width; rows are repeated upwards.

use std::fmt;

/// One step of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A knit stitch: the new loop comes to the front.
    Knit,
    /// A purl stitch: the new loop goes to the back.
    Purl,
    /// Two stitches become one; on top is the left of them (`k2tog`) or the right (`ssk`).
    Together {
        /// Whether the left one is on top.
        left_on_top: bool,
    },
    /// One stitch becomes two.
    FrontBack,
    /// A stitch out of nothing.
    YarnOver,
    /// So many stitches change sides in two halves.
    Cable {
        /// How many; even.
        size: u8,
        /// Whether those that move to the left pass in front.
        left_in_front: bool,
    },
}

impl Step {
    /// Stitches of the row below that it takes, and stitches that it makes.
    pub fn takes_and_makes(self) -> (u32, u32) {
        match self {
            Self::Knit | Self::Purl => (1, 1),
            Self::Together { .. } => (2, 1),
            Self::FrontBack => (1, 2),
            Self::YarnOver => (0, 1),
            Self::Cable { size, .. } => (size.into(), size.into()),
        }
    }
}

/// A stitch: which loops of the row below it was pulled through, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stitch {
    /// Whether it goes to the back.
    pub purl: bool,
    /// The first stitch of the row below that it holds.
    pub first_parent: u32,
    /// How many it holds: 0 for a yarn over and in the first row.
    pub parents: u8,
    /// Where two pass each other, 1 for those in front and -1 for those behind; else 0.
    pub layer: i8,
    /// Of two stitches worked together, whether the left is on top.
    pub left_on_top: bool,
}

/// Rows of a knit, from the cast-on edge.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chart {
    rows: Vec<Row>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Row {
    steps: Vec<Step>,
    /// The line of the description it came from, from 0.
    line: usize,
}

/// What is wrong with a chart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChartError {
    /// The line of the description, from 0, if it is about one.
    pub line: Option<usize>,
    /// What is wrong.
    pub problem: String,
    /// What to do.
    pub hint: String,
}

impl fmt::Display for ChartError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}", self.problem, self.hint)
    }
}

impl std::error::Error for ChartError {}

impl ChartError {
    pub(super) fn new(line: Option<usize>, problem: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { line, problem: problem.into(), hint: hint.into() }
    }
}

/// Patterns with a name, and their rows.
pub const PATTERNS: [(&str, &[&str]); 8] = [
    ("stockinette", &["k"]),
    ("reverse-stockinette", &["p"]),
    ("garter", &["k", "p"]),
    ("rib1x1", &["k p"]),
    ("rib2x2", &["k2 p2"]),
    ("seed", &["k p", "p k"]),
    ("cable", &["3: p2 k4 p2", "p2 c4f p2", "2: p2 k4 p2"]),
    ("eyelet", &["3: k6", "k2 k2tog yo k2", "2: k6"]),
];

/// Most rows and most steps of a row that a chart may have.
const MOST_ROWS: usize = 20_000;
const MOST_STEPS: usize = 20_000;
const STEPS: &str = "steps are k, p, k4, p2, k2tog, ssk, kfb, yo, c4f, c4b, with spaces between them";

impl Chart {
    /// A pattern by its name.
    pub fn named(name: &str) -> Option<Self> {
        let (_, rows) = PATTERNS.iter().find(|(n, _)| *n == name)?;
        Self::parse(rows).ok()
    }

    /// Reads the rows of a chart, from the bottom upwards.
    ///
    /// # Errors
    /// A step that is none, or too many of them.
    pub fn parse(lines: &[impl AsRef<str>]) -> Result<Self, ChartError> {
        let mut rows = Vec::new();
        for (line, text) in lines.iter().enumerate() {
            let text = text.as_ref();
            let (count, steps) = match text.split_once(':') {
                Some((count, steps)) => match count.trim().parse::<usize>() {
                    Ok(n) if (1..=MOST_ROWS).contains(&n) => (n, steps),
                    _ => {
                        let problem = format!("expected a number of rows before the colon, found \"{}\"", count.trim());
                        return Err(ChartError::new(Some(line), problem, "as in \"12: k2 p2\""));
                    }
                },
                None => (1, text),
            };
            let steps = parse_steps(steps, line)?;
            if rows.len() + count > MOST_ROWS {
                let problem = format!("more than {MOST_ROWS} rows");
                return Err(ChartError::new(Some(line), problem, "rows repeat by themselves"));
            }
            rows.extend(std::iter::repeat_n(Row { steps, line }, count));
        }
        if rows.is_empty() {
            return Err(ChartError::new(None, "a chart without rows", "as in rows = [\"k2 p2\"]"));
        }
        Ok(Self { rows })
    }

    /// Number of rows before they repeat.
    pub fn rows(&self) -> u32 {
        self.rows.len() as u32
    }

    /// The smallest width that all rows fit a whole number of times, if every row makes as many stitches as it takes
    /// and the width is at most `most`.
    pub fn even_width(&self, most: u32) -> Option<u32> {
        let mut width = 1_u32;
        for row in &self.rows {
            let (takes, makes) = row.takes_and_makes();
            if takes != makes {
                return None;
            }
            width = width.checked_mul(takes / common_divisor(width, takes))?;
            if width > most {
                return None;
            }
        }
        Some(width)
    }

    /// Knits `rows` rows onto `cast_on` stitches.
    ///
    /// # Errors
    /// A row that does not fit the stitches it finds, or more than `most` stitches in all.
    pub fn work(&self, cast_on: u32, rows: u32, most: u64) -> Result<Vec<Vec<Stitch>>, ChartError> {
        let mut out: Vec<Vec<Stitch>> = Vec::new();
        let (mut found, mut total) = (cast_on, 0_u64);
        for r in 0..rows {
            let row = &self.rows[r as usize % self.rows.len()];
            let (takes, makes) = row.takes_and_makes();
            let cut = takes == 0 || !found.is_multiple_of(takes);
            if takes == 0 || (cut && !row.is_plain()) {
                let problem = format!("row {} repeats over {takes} stitches, but finds {found}", r + 1);
                let hint = "the number of stitches must be a multiple of what a row with shaping or cables takes";
                return Err(ChartError::new(Some(row.line), problem, hint));
            }
            let made = if cut { u64::from(found) } else { u64::from(found / takes) * u64::from(makes) };
            total += made;
            if total > most {
                let problem = format!("more than {most} stitches by row {}", r + 1);
                return Err(ChartError::new(Some(row.line), problem, "fewer stitches, rows or increases"));
            }
            let stitches = row.work(found, made as usize, r == 0);
            found = stitches.len() as u32;
            out.push(stitches);
        }
        Ok(out)
    }
}

fn common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { common_divisor(b, a % b) }
}

impl Row {
    fn takes_and_makes(&self) -> (u32, u32) {
        self.steps.iter().map(|s| s.takes_and_makes()).fold((0, 0), |a, b| (a.0 + b.0, a.1 + b.1))
    }

    /// Knit and purl alone: may be cut anywhere.
    fn is_plain(&self) -> bool {
        self.steps.iter().all(|s| matches!(s, Step::Knit | Step::Purl))
    }

    fn work(&self, found: u32, made: usize, first_row: bool) -> Vec<Stitch> {
        let mut out = Vec::with_capacity(made);
        let mut at = 0_u32;
        for step in self.steps.iter().cycle() {
            let (takes, _) = step.takes_and_makes();
            if out.len() >= made && at >= found {
                break;
            }
            let plain = Stitch { purl: false, first_parent: at, parents: 1, layer: 0, left_on_top: false };
            match *step {
                Step::Knit => out.push(plain),
                Step::Purl => out.push(Stitch { purl: true, ..plain }),
                Step::Together { left_on_top } => out.push(Stitch { parents: 2, left_on_top, ..plain }),
                Step::FrontBack => out.extend([plain, plain]),
                Step::YarnOver => out.push(Stitch { parents: 0, ..plain }),
                Step::Cable { size, left_in_front } => {
                    let half = u32::from(size) / 2;
                    let layer = if left_in_front { 1 } else { -1 };
                    out.extend((0..half).map(|i| Stitch { first_parent: at + half + i, layer, ..plain }));
                    out.extend((0..half).map(|i| Stitch { first_parent: at + i, layer: -layer, ..plain }));
                }
            }
            at += takes;
        }
        if first_row {
            // There is nothing below to hold or to cross.
            for s in &mut out {
                (s.parents, s.layer) = (0, 0);
            }
        }
        out
    }
}

fn parse_steps(text: &str, line: usize) -> Result<Vec<Step>, ChartError> {
    let mut steps = Vec::new();
    for token in text.split([' ', ',', '\t']).filter(|t| !t.is_empty()) {
        let (count, step) = parse_step(token).ok_or_else(|| {
            let shown: String = token.chars().take(20).collect();
            ChartError::new(Some(line), format!("unknown step \"{}\"", shown.escape_debug()), STEPS)
        })?;
        if steps.len() + count > MOST_STEPS {
            return Err(ChartError::new(Some(line), format!("more than {MOST_STEPS} steps in a row"), "steps repeat"));
        }
        steps.extend(std::iter::repeat_n(step, count));
    }
    if steps.iter().all(|s| s.takes_and_makes().0 == 0) {
        return Err(ChartError::new(Some(line), "a row that takes no stitch of the row below", STEPS));
    }
    Ok(steps)
}

fn parse_step(token: &str) -> Option<(usize, Step)> {
    match token {
        "k2tog" => return Some((1, Step::Together { left_on_top: true })),
        "ssk" => return Some((1, Step::Together { left_on_top: false })),
        "kfb" => return Some((1, Step::FrontBack)),
        "yo" => return Some((1, Step::YarnOver)),
        _ => {}
    }
    let number = |digits: &str| digits.parse::<usize>().ok().filter(|n| (1..=MOST_STEPS).contains(n));
    if let Some(rest) = token.strip_prefix('c') {
        let left_in_front = rest.ends_with('f');
        let size = number(rest.strip_suffix(['f', 'b'])?)?;
        let fits = size % 2 == 0 && size <= 12;
        return fits.then_some((1, Step::Cable { size: size as u8, left_in_front }));
    }
    let (step, rest) = match token.split_at_checked(1)? {
        ("k", rest) => (Step::Knit, rest),
        ("p", rest) => (Step::Purl, rest),
        _ => return None,
    };
    Some((if rest.is_empty() { 1 } else { number(rest)? }, step))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn worked(rows: &[&str], cast_on: u32, count: u32) -> Vec<Vec<Stitch>> {
        Chart::parse(rows).unwrap().work(cast_on, count, 1000).unwrap()
    }

    #[test]
    fn named_patterns_are_sound_and_even() {
        for (name, _) in PATTERNS {
            let chart = Chart::named(name).unwrap();
            let width = chart.even_width(100).unwrap();
            let rows = chart.work(3 * width, 2 * chart.rows(), 10_000).unwrap();
            assert!(rows.iter().all(|r| r.len() == 3 * width as usize), "{name}");
        }
        assert!(Chart::named("stockinet").is_none());
    }

    #[test]
    fn decreases_take_two_and_increases_make_two() {
        let rows = worked(&["k", "k3 k2tog", "k ssk kfb"], 15, 3);
        assert_eq!(rows.iter().map(Vec::len).collect::<Vec<_>>(), [15, 12, 12]);
    }

    #[test]
    fn a_hat_ends_with_few_stitches() {
        let rows = worked(&["3: k", "k3 k2tog", "k", "k2 k2tog", "k1 k2tog", "k2tog"], 20, 8);
        assert_eq!(rows.iter().map(Vec::len).collect::<Vec<_>>(), [20, 20, 20, 16, 16, 12, 8, 4]);
        assert_eq!((rows[3][3].first_parent, rows[3][3].parents), (3, 2));
        assert_eq!((rows[3][4].first_parent, rows[3][4].parents), (5, 1));
        // Every loop is held by exactly one stitch.
        for pair in rows.windows(2) {
            let mut held = vec![0; pair[0].len()];
            for s in &pair[1] {
                for p in s.first_parent..s.first_parent + u32::from(s.parents) {
                    held[p as usize] += 1;
                }
            }
            assert!(held.iter().all(|&h| h == 1));
        }
    }

    #[test]
    fn cables_cross_halves() {
        let row = &worked(&["k4", "c4f"], 4, 2)[1];
        assert_eq!(
            row.iter().map(|s| (s.first_parent, s.layer)).collect::<Vec<_>>(),
            [(2, 1), (3, 1), (0, -1), (1, -1)]
        );
        assert_eq!(worked(&["k4", "c4b"], 4, 2)[1][0].layer, -1);
    }

    #[test]
    fn plain_rows_may_be_cut_and_others_not() {
        assert_eq!(worked(&["k2 p2"], 7, 1)[0].iter().filter(|s| s.purl).count(), 3);
        let error = Chart::parse(&["k", "k3 k2tog"]).unwrap().work(9, 2, 1000).unwrap_err();
        assert_eq!((error.line, error.problem.as_str()), (Some(1), "row 2 repeats over 5 stitches, but finds 9"));
    }

    #[test]
    fn mistakes_are_explained() {
        for (rows, problem) in [
            (&["k2 q"][..], "unknown step \"q\""),
            (&["c5f"], "unknown step \"c5f\""),
            (&["c14f"], "unknown step \"c14f\""),
            (&["k0"], "unknown step \"k0\""),
            (&["k99999999999999999999"], "unknown step \"k9999999999999999999\""),
            (&["yo"], "a row that takes no stitch of the row below"),
            (&[""], "a row that takes no stitch of the row below"),
            (&["x: k"], "expected a number of rows before the colon, found \"x\""),
            (&["20000: k", "k"], "more than 20000 rows"),
            (&["k20000 p"], "more than 20000 steps in a row"),
            (&[], "a chart without rows"),
        ] {
            assert_eq!(Chart::parse(rows).unwrap_err().problem, problem);
        }
        let grows = Chart::parse(&["kfb"]).unwrap().work(4, 60, 5000).unwrap_err();
        assert_eq!(grows.problem, "more than 5000 stitches by row 10");
    }
}
