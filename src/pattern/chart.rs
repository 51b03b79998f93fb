//! Knitting charts: rows of steps, written as knitters write them, and the stitches that come of them.
//!
//! A chart is a list of rows from the cast-on edge upwards, each written from left to right as seen from the right side:
//!
//! | step | what it makes |
//! |---|---|
//! | `k`, `k4`, `p`, `p2` | knit and purl stitches |
//! | `ktbl`, `ptbl` | the same through the back of the loop, which twists it |
//! | `k2tog`, `ssk`, `p2tog`, `ssp` | one stitch of two; the left one of the two on top (leans right), or the right one (leans left) |
//! | `k3tog`, `sssk`, `cdd`, `p3tog`, `sssp`, `cddp` | one stitch of three; the left, the right or the middle one on top |
//! | `yo` | a stitch of none: an eyelet |
//! | `m1l`, `m1r`, `m1lp`, `m1rp` | a stitch out of the strand between two stitches of the row below, twisted to the left or the right, knitted or purled |
//! | `kfb`, `pfb` | two stitches of one |
//! | `sl`, `sl2`, `slwyif`, `miss` | a stitch that is slipped: the yarn passes behind it, or in front (`slwyif`) |
//! | `tuck` | a stitch that is slipped with a yarn over, to be worked together with it: brioche is made of these |
//! | `c4f`, `c4b` | a cable: two stitches cross two; those in front move to the left (`f`) or to the right (`b`). From 2 to 24; the front has the odd one |
//! | `t3f`, `t3b` | the same with purl stitches behind |
//! | `2/1lc`, `2/1rc`, `2/1lpc`, `2/1rpc` | the same in other words: two stitches in front of one, to the left or right, knit or purl behind |
//! | `-`, `-4` | stitches that stay on the needle: a short row turns beside them, and the next row begins there; one that is slipped beside them by both rows is wrapped |
//! | `ds` | a double stitch: slipped with the yarn pulled over the needle; the first plain stitch after such a turn is one by itself |
//! | `bo4`, `bop4` | stitches that are bound off, knitted or purled: each is passed over the next one, the last one over the `k` or `p` behind them |
//! | `co4` | stitches that are cast on within a row, as backward loops: over what the row below has bound off, or at a side |
//! | `mb`, `bobble` | five loops out of one stitch (`k yo k yo k`), turn, five purled, turn, all of them knitted together |
//!
//! `12: k2 p2` stands for twelve such rows. A row is repeated over the whole width; rows are repeated upwards.

mod gaps;
mod repeat;
mod steps;

use std::{fmt, sync::Arc};

use self::steps::parse_steps;
pub(super) use self::{
    gaps::{binds_from_right, gaps},
    repeat::Whole,
    steps::WIDEST_CABLE,
};

/// Which of several stitches worked together is on top.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Top {
    /// The left one: it leans to the right.
    Left,
    /// The right one.
    Right,
    /// The middle one, and it stands upright.
    Middle,
}

/// One step of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A stitch drawn through one of the row below.
    Plain {
        /// Whether the new loop goes to the back.
        purl: bool,
        /// Whether it is worked through the back of the loop below, which twists that.
        twisted: bool,
    },
    /// Several stitches become one.
    Together {
        /// How many, 2 or 3.
        take: u8,
        /// As in [`Step::Plain`].
        purl: bool,
        /// Which is on top.
        top: Top,
    },
    /// One stitch becomes two.
    FrontBack {
        /// As in [`Step::Plain`].
        purl: bool,
    },
    /// A stitch out of nothing.
    YarnOver,
    /// A stitch out of the strand between two of the row below, twisted.
    MakeOne {
        /// Whether its left leg is on top: it leans to the left.
        left: bool,
        /// As in [`Step::Plain`].
        purl: bool,
    },
    /// A stitch that is not worked.
    Slip {
        /// Whether the yarn passes in front of it.
        front: bool,
    },
    /// A stitch that is not worked, with a yarn over.
    Tuck,
    /// Stitches that change places with others.
    Cable {
        /// How many pass in front.
        front: u8,
        /// How many pass behind.
        back: u8,
        /// Whether those in front move to the left.
        left: bool,
        /// Whether those behind are purled.
        purl: bool,
    },
    /// Five loops out of one stitch, five more on the way back, and one through all of them.
    Bobble,
    /// A stitch that stays on the needle: the yarn turns before it comes to it.
    Unworked,
    /// A stitch that is worked and passed over the next one.
    BindOff {
        /// As in [`Step::Plain`].
        purl: bool,
    },
    /// A stitch that is cast on.
    CastOn,
}

impl Step {
    /// Stitches of the row below that it takes, and stitches that it makes.
    pub fn takes_and_makes(self) -> (u32, u32) {
        match self {
            Self::Plain { .. } | Self::Slip { .. } | Self::Tuck | Self::Bobble | Self::Unworked => (1, 1),
            Self::Together { take, .. } => (take.into(), 1),
            Self::FrontBack { .. } => (1, 2),
            Self::YarnOver | Self::MakeOne { .. } | Self::CastOn => (0, 1),
            Self::BindOff { .. } => (1, 0),
            Self::Cable { front, back, .. } => (u32::from(front) + u32::from(back), u32::from(front) + u32::from(back)),
        }
    }
}

/// What the yarn does at a stitch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// A loop is drawn through those below.
    Draw,
    /// A loop is laid over the needle.
    Over,
    /// The stitch below stays as it is; the yarn passes in front or behind.
    Pass {
        /// Whether in front.
        front: bool,
    },
    /// The stitch below stays, and a loop is laid over the needle beside it.
    Tuck,
    /// A loop is drawn through the strand below, which is lifted and twisted.
    Lift {
        /// Whether the left leg of the twisted strand is on top.
        left: bool,
    },
    /// A bobble grows out of the stitch below; one loop is left of it.
    Bobble,
    /// The stitch below stays as it is, and no yarn comes there.
    Unworked,
    /// The stitch below stays, and the yarn that has turned there is pulled over the needle: a double stitch.
    Double,
    /// A loop is drawn through the one below and the one bound off before it; the next stitch is drawn through it.
    BindOff,
    /// A twisted loop is laid over the needle.
    CastOn,
}

/// A stitch: what it is made of in the row below, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stitch {
    /// What the yarn does.
    pub act: Act,
    /// Whether the loop goes to the back.
    pub purl: bool,
    /// Whether it twists what it is drawn through.
    pub twisted: bool,
    /// The first stitch of the row below that it takes; of a yarn over or a lifted strand the stitch to its right.
    pub first_parent: u32,
    /// How many it takes: 0 of a yarn over or a lifted strand.
    pub parents: u8,
    /// Of several, which is on top.
    pub top: Top,
    /// Where stitches pass each other, 1 for those in front and -1 for those behind; else 0.
    pub layer: i8,
}

impl Stitch {
    /// Whether it is in the wale of those that it takes: strands of a cable change places.
    pub(super) fn is_in_line(&self) -> bool {
        self.parents > 0 && self.layer == 0
    }

    /// Whether it is a knit or a purl stitch above one other.
    pub(super) fn is_plain(&self) -> bool {
        self.act == Act::Draw && self.parents == 1 && self.layer == 0 && !self.twisted
    }
}

/// Rows of a knit, from the cast-on edge.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chart {
    rows: Vec<Row>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Row {
    /// Shared by all rows that one line stands for.
    steps: Arc<[Step]>,
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
pub const PATTERNS: [(&str, &[&str]); 20] = [
    ("stockinette", &["k"]),
    ("reverse-stockinette", &["p"]),
    ("twisted-stockinette", &["ktbl"]),
    ("garter", &["k", "p"]),
    ("rib1x1", &["k p"]),
    ("rib2x2", &["k2 p2"]),
    ("seed", &["k p", "p k"]),
    ("moss", &["2: k p", "2: p k"]),
    ("double-moss", &["2: k2 p2", "2: p2 k2"]),
    ("basketweave", &["4: k4 p4", "4: p4 k4"]),
    ("brioche", &["k tuck", "tuck p"]),
    ("half-cardigan", &["k tuck", "k p"]),
    ("slip-stitch", &["k sl", "k", "sl k", "k"]),
    ("cable", &["3: p2 k4 p2", "p2 c4f p2", "2: p2 k4 p2"]),
    ("braid", &["p2 c4f k2 p2", "p2 k6 p2", "p2 k2 c4b p2", "p2 k6 p2"]),
    ("honeycomb", &["3: k8", "c4b c4f", "3: k8", "c4f c4b"]),
    ("basket-cable", &["3: k12", "k2 c4f c4f k2", "3: k12", "c4b c4b c4b"]),
    ("eyelet", &["3: k6", "k2 yo k2tog k2", "2: k6"]),
    ("lace", &["k7", "k yo k2tog k ssk yo k", "k7", "k2 yo cdd yo k2"]),
    ("feather-and-fan", &["k", "k2tog k2tog k2tog yo k yo k yo k yo k yo k yo k k2tog k2tog k2tog", "k", "p"]),
];

/// Most rows that a chart may have.
const MOST_ROWS: usize = 20_000;
/// How far from what is asked a number of stitches is looked for that a chart fits.
const LARGEST_STEP_ASIDE: usize = 200;

impl Chart {
    /// A pattern by its name.
    pub fn named(name: &str) -> Option<Self> {
        let (_, rows) = PATTERNS.iter().find(|(n, _)| *n == name)?;
        Self::parse(rows).ok()
    }

    /// Reads the rows of a chart, from the bottom upwards.
    ///
    /// ```
    /// use yarnray::pattern::chart::Chart;
    ///
    /// let lace = Chart::parse(&["k6", "k2tog yo k2 yo ssk"]).unwrap();
    /// // Twelve stitches, and every row keeps them: two decreases, two yarn-overs.
    /// let rows = lace.work(12, 4, 1000).unwrap();
    /// assert!(rows.iter().all(|row| row.len() == 12));
    /// ```
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
            let steps = Arc::from(parse_steps(steps, line)?);
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

    /// How many stitches steps make that are written as in a row.
    ///
    /// # Errors
    /// A step that is none.
    pub fn stitches_of(steps: &str) -> Result<u32, ChartError> {
        Ok(parse_steps(steps, 0)?.iter().map(|step| step.takes_and_makes().1).sum())
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
            if takes != makes || row.is_short() || row.binds_off() {
                return None;
            }
            width = width.checked_mul(takes / common_divisor(width, takes))?;
            if width > most {
                return None;
            }
        }
        Some(width)
    }

    /// Whether a piece has more or fewer stitches when all rows are knitted once: it would grow or be knitted out if they were
    /// repeated.
    pub fn is_shaped(&self) -> bool {
        let growth = |row: &Row| {
            let (takes, makes) = row.takes_and_makes();
            // Rows without the one or the other have no logarithm that could be made up for.
            (f64::from(makes) / f64::from(takes)).ln()
        };
        let growth: f64 = self.rows.iter().map(growth).sum();
        growth.is_nan() || growth.abs() >= 1e-9
    }

    /// The line of the description that a row of the knit, from 0, came from.
    pub(super) fn line_of(&self, row: usize) -> usize {
        self.rows[row % self.rows.len()].line
    }

    /// Whether rows may be cut anywhere: each stitch is made of one.
    pub fn is_plain(&self) -> bool {
        self.rows.iter().all(Row::is_plain)
    }

    /// Whether any stitch is tucked.
    pub(super) fn has_tucks(&self) -> bool {
        self.rows.iter().any(|row| row.steps.contains(&Step::Tuck))
    }

    /// How many stitches the widest cable has, if there is one.
    pub fn widest_cable(&self) -> Option<u32> {
        let wide = |step: &Step| {
            if let Step::Cable { front, back, .. } = step { Some(u32::from(*front) + u32::from(*back)) } else { None }
        };
        self.rows.iter().flat_map(|row| row.steps.iter()).filter_map(wide).max()
    }

    /// The next numbers of stitches to cast on, fewer and more, that `rows` rows fit; empty if none is near.
    fn counts_that_fit(&self, cast_on: u32, rows: u32) -> String {
        let all = self.fits();
        let fits = |&count: &u32| first_that_fit(&all, count, rows) == rows;
        let fewer = (1..cast_on).rev().take(LARGEST_STEP_ASIDE).find(fits);
        let more = (cast_on + 1..).take(LARGEST_STEP_ASIDE).find(fits);
        [fewer, more].into_iter().flatten().map(|count| count.to_string()).collect::<Vec<_>>().join(" or ")
    }

    /// How many of so many rows fit onto `cast_on` stitches, one after the other.
    pub fn rows_that_fit(&self, cast_on: u32, rows: u32) -> u32 {
        first_that_fit(&self.fits(), cast_on, rows)
    }

    /// What each row takes and makes: counted once, for it may be long and be tried often.
    fn fits(&self) -> Vec<Fit> {
        self.rows.iter().map(Row::fit).collect()
    }

    /// Knits `rows` rows onto `cast_on` stitches. Stitches that are bound off keep their places in their row.
    ///
    /// # Errors
    /// A row that does not fit the stitches it finds, stitches worked together from both sides of a gap, or more than `most`
    /// stitches in all.
    pub fn work(&self, cast_on: u32, rows: u32, most: u64) -> Result<Vec<Vec<Stitch>>, ChartError> {
        let mut out: Vec<Vec<Stitch>> = Vec::new();
        let (mut found, mut total) = (cast_on, 0_u64);
        for r in 0..rows {
            let row = &self.rows[r as usize % self.rows.len()];
            let fit = row.fit();
            let Some(made) = fit.made_of(found) else {
                let (does, hint) = match (fit.short, fit.plain) {
                    (true, _) => ("is written for", "a short row says what becomes of every stitch"),
                    (false, true) => ("has", "each row must be there once as a whole"),
                    (false, false) => (
                        "repeats over",
                        "the number of stitches must be a multiple of what a row with shaping or cables takes",
                    ),
                };
                let problem = format!("row {} {does} {} stitches, but finds {found}", r + 1, fit.takes);
                let counts = self.counts_that_fit(cast_on, rows);
                let hint = if counts.is_empty() { hint.to_owned() } else { format!("{hint}: cast on {counts}") };
                // It was knitted once from end to end, and was told to go on.
                let hint = match self.rows() {
                    whole if r == whole => format!("{hint}, or knit {whole} rows, the whole chart"),
                    whole if r > whole => format!("{hint}, or knit {whole} rows, the whole chart; up to {r} fit"),
                    _ => hint,
                };
                return Err(ChartError::new(Some(row.line), problem, hint));
            };
            total += made;
            if total > most {
                let problem = format!("more than {most} stitches by row {}", r + 1);
                return Err(ChartError::new(Some(row.line), problem, "fewer stitches, rows or increases"));
            }
            let mut stitches = row.work(found, made as usize);
            if let Some(below) = out.last()
                && !gaps::count_on(below, &mut stitches)
            {
                let problem = format!("row {} works stitches together from both sides of a gap", r + 1);
                return Err(ChartError::new(Some(row.line), problem, "cast on over the gap between them (co)"));
            }
            found = made as u32;
            out.push(stitches);
        }
        Ok(out)
    }
}

fn common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { common_divisor(b, a % b) }
}

/// What a row asks of the number of stitches that it finds.
struct Fit {
    takes: u32,
    makes: u32,
    /// Whether it may be cut anywhere.
    plain: bool,
    /// Whether some stitches stay unworked: it is written once over the whole width.
    short: bool,
}

impl Fit {
    /// How many stitches the row makes of those that it finds; `None` where it does not fit them.
    fn made_of(&self, found: u32) -> Option<u64> {
        match found.checked_rem(self.takes)? {
            _ if self.short => (found == self.takes).then_some(self.makes.into()),
            0 => Some(u64::from(found / self.takes) * u64::from(self.makes)),
            _ => (self.plain && found > self.takes).then_some(found.into()),
        }
    }
}

/// How many of so many rows, which are taken again and again, fit one after the other onto stitches.
fn first_that_fit(all: &[Fit], cast_on: u32, rows: u32) -> u32 {
    let mut found = Some(cast_on);
    let fits = |fit: &&Fit| {
        found = found.and_then(|found| u32::try_from(fit.made_of(found)?).ok());
        found.is_some()
    };
    all.iter().cycle().take(rows as usize).take_while(fits).count() as u32
}

impl Row {
    fn fit(&self) -> Fit {
        let (takes, makes) = self.takes_and_makes();
        Fit { takes, makes, plain: self.is_plain(), short: self.is_short() }
    }

    fn takes_and_makes(&self) -> (u32, u32) {
        self.steps.iter().map(|s| s.takes_and_makes()).fold((0, 0), |a, b| (a.0 + b.0, a.1 + b.1))
    }

    /// Each stitch on its own: may be cut anywhere.
    fn is_plain(&self) -> bool {
        self.steps.iter().all(|s| s.takes_and_makes() == (1, 1)) && !self.is_short()
    }

    /// Whether some of its stitches stay unworked.
    fn is_short(&self) -> bool {
        self.steps.contains(&Step::Unworked)
    }

    /// Whether stitches are bound off in it.
    fn binds_off(&self) -> bool {
        self.steps.iter().any(|step| matches!(step, Step::BindOff { .. }))
    }

    fn work(&self, found: u32, made: usize) -> Vec<Stitch> {
        let mut out = Vec::with_capacity(made);
        let (mut at, mut left) = (0_u32, made);
        for step in self.steps.iter().cycle() {
            let (takes, makes) = step.takes_and_makes();
            if left == 0 && at >= found {
                break;
            }
            let plain = Stitch {
                act: Act::Draw,
                purl: false,
                twisted: false,
                first_parent: at,
                parents: 1,
                top: Top::Left,
                layer: 0,
            };
            match *step {
                Step::Plain { purl, twisted } => out.push(Stitch { purl, twisted, ..plain }),
                Step::Together { take, purl, top } => out.push(Stitch { purl, parents: take, top, ..plain }),
                Step::FrontBack { purl } => out.extend([Stitch { purl, ..plain }; 2]),
                Step::YarnOver => out.push(Stitch { act: Act::Over, parents: 0, ..plain }),
                Step::MakeOne { left, purl } => {
                    out.push(Stitch { act: Act::Lift { left }, purl, parents: 0, ..plain });
                }
                Step::Slip { front } => out.push(Stitch { act: Act::Pass { front }, ..plain }),
                Step::Tuck => out.push(Stitch { act: Act::Tuck, ..plain }),
                Step::Bobble => out.push(Stitch { act: Act::Bobble, ..plain }),
                Step::Unworked => out.push(Stitch { act: Act::Unworked, ..plain }),
                Step::BindOff { purl } => out.push(Stitch { act: Act::BindOff, purl, ..plain }),
                Step::CastOn => out.push(Stitch { act: Act::CastOn, parents: 0, ..plain }),
                Step::Cable { front, back, left, purl } => {
                    let (front, back) = (u32::from(front), u32::from(back));
                    let ahead = |i| Stitch { first_parent: at + if left { back } else { 0 } + i, layer: 1, ..plain };
                    let behind =
                        |i| Stitch { purl, first_parent: at + if left { 0 } else { front } + i, layer: -1, ..plain };
                    if left {
                        out.extend((0..front).map(ahead));
                        out.extend((0..back).map(behind));
                    } else {
                        out.extend((0..back).map(behind));
                        out.extend((0..front).map(ahead));
                    }
                }
            }
            at += takes;
            left = left.saturating_sub(makes as usize);
        }
        out
    }
}

#[cfg(test)]
mod tests;
