//! Knitted cloth: loops drawn through loops, as a chart says, on a flat piece, a tube or a surface of revolution.
//!
//! A chart's rows (`rows`) become loops, each with what it is drawn through (`loops`); these become curves that cross on the
//! right side of each other (`shape`); the curves are relaxed as elastic rods, cloth that repeats as one cell with periodic
//! borders that finds its own gauge (`cell`, and `kinds` where nothing repeats); and a piece is put together (`make`), with one
//! yarn from row to row and finished edges (`piece`), as large as is asked for (`size`).
//! Last, yarns are pressed flat where they lie on each other (`pressed`). Inside this folder the unit is the distance at which the centre lines
//! of two yarns touch: the diameter of yarn that stays round ([`Thickness`]).

mod bonds;
mod cell;
mod colors;
mod crowded;
mod curl;
mod gaps;
mod kinds;
mod loops;
mod make;
mod piece;
mod pressed;
mod rims;
mod round;
mod rows;
mod shape;
mod short_rows;
mod size;

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use self::cell::Cell;
pub(crate) use self::colors::{Way, caught, in_use, too_many_strands};
pub(super) use self::pressed::{Alike, flatten_where_touching};
pub use self::{
    colors::{CARRY_ROWS, CATCH_FLOATS, Colors, Work},
    rims::{CastOn, Closing, Rims},
    size::{Measures, Misfit, ROW_HEIGHTS, STITCH_WIDTHS, Sizes, Thickness, YARNS_PER_STITCH, fits_stitch},
};
use super::{
    PatternStrand,
    chart::{Act, Chart, ChartError, Stitch, Whole},
    period::counts_that_hold,
    revolution::Revolution,
    tile::RelaxedRows,
};

/// What a knit is knitted to.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// In the plane z = 0, centred, right side towards +z; rows go back and forth.
    Flat,
    /// Round about the y axis, right side out, in one spiral. The radius is what the stitches need.
    Tube,
    /// On a surface of revolution about the y axis: the profile from the cast-on edge, radius and height in the unit of
    /// the diameter. Its right side is to the right of the way along the profile.
    Revolution(Vec<DVec2>),
}

impl Form {
    /// Whether its rows are rounds, of which one goes on as the next.
    pub(crate) fn is_round(&self) -> bool {
        *self != Self::Flat
    }
}

/// How a piece begins and ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Edges {
    /// Cast on (long-tail) and bound off.
    #[default]
    Finished,
    /// The same, and the first stitch of each row of a flat piece is slipped: a chain along both sides.
    Slipped,
    /// Open loops at the top, nothing below the first row.
    Live,
    /// No edges at all: a flat patch whose rows are yarns that go on at one border as they begin at the other.
    Tile,
}

impl Edges {
    /// By name; a tile is asked for otherwise.
    pub const NAMES: [(&'static str, Self); 3] =
        [("finished", Self::Finished), ("slipped", Self::Slipped), ("live", Self::Live)];
}

/// A piece of knitting.
#[derive(Clone, Debug, PartialEq)]
pub struct Knit {
    /// Its rows.
    pub chart: Chart,
    /// Stitches cast on.
    pub stitches: u32,
    /// Rows to knit.
    pub rows: u32,
    /// Its form.
    pub form: Form,
    /// How it begins and ends.
    pub edges: Edges,
    /// How a finished piece is cast on and closed at its top.
    pub rims: Rims,
    /// Width of a stitch in units; what the pattern draws itself to if absent.
    pub stitch_width: Option<f64>,
    /// Distance between rows in units, likewise.
    pub row_height: Option<f64>,
    /// Length of yarn in a stitch, in units; what suits the gauge if absent.
    pub yarn_per_stitch: Option<f64>,
    /// Control points of a stitch.
    pub points: u32,
    /// Colour work, if there is any: a yarn for each colour.
    pub colors: Option<Colors>,
    /// Whether a flat piece is blocked; else its edges roll as they would by themselves.
    pub flat: bool,
}

/// What is knitted again and again: a chart as small as it goes, and the stitches that all its rows fit.
struct Repeat {
    chart: Chart,
    wide: u32,
}

/// A piece as it came out.
#[derive(Clone, Debug)]
pub struct Knitted {
    /// Its yarns.
    pub strands: Vec<PatternStrand>,
    /// The colour of each yarn: 0 where there is no colour work.
    pub colors: Vec<u16>,
    /// Width of a stitch and distance between rows; of rows of other widths those of the kind that has most of them.
    pub gauge: [f64; 2],
    /// Width of a stitch in each row.
    pub widths: Vec<f64>,
}

/// Yarn in a stitch of plain knit of middling tightness, in units: Peirce's closed loop has 16.7, firm cloth 14.
pub const YARN_PER_STITCH: f64 = 16.2;
/// Width of a stitch of stockinette as it relaxes, in units.
pub const STITCH_WIDTH: f64 = 4.15;
/// Height of a row of stockinette as it relaxes, in units.
pub const ROW_HEIGHT: f64 = 2.9;
/// Stitches in the square of the length of yarn that one of them has: Munden's constant of fully relaxed plain knit.
pub const STITCHES_PER_SQUARE: f64 = 5.5 * 4.2;
/// Width over height of a yarn's section where stitches press on it, unless asked otherwise.
pub const FLATTEN: f64 = 1.5;
/// Stitches, and rows, unless asked otherwise.
pub const COUNT: u32 = 20;
/// Control points of a stitch unless asked otherwise.
pub const POINTS: u32 = 24;

/// The largest cell that is relaxed once and repeated, in stitches.
const LARGEST_CELL: u32 = 2048;
/// Points of a stitch while a piece without a cell is relaxed.
const COARSE: u32 = 14;

impl Knit {
    /// How many control points the cloth would have at most if it kept its width.
    pub fn control_points(&self) -> u64 {
        self.layers()
            * (u64::from(self.stitches) * u64::from(self.rows) * u64::from(self.points) + u64::from(self.rows))
    }

    /// Rows that are knitted unless rows or a height are asked for: those of a chart that is shaped, by itself or over a profile, once,
    /// and all of one that is `written` out.
    pub fn rows_of(chart: &Chart, form: &Form, written: bool) -> u32 {
        match (chart.is_shaped(), written) {
            (true, _) => chart.rows(),
            (false, true) if matches!(form, Form::Revolution(_)) => chart.rows(),
            (false, true) => chart.rows().max(COUNT),
            (false, false) => COUNT,
        }
    }

    /// That a chart is cut off, if it is, for people.
    pub(crate) fn cut_off(&self) -> Option<String> {
        let (rows, all) = (self.rows, self.chart.rows());
        (rows < all).then(|| format!("{rows} rows are knitted of a chart of {all}"))
    }

    /// That the repeat of the chart does not go into its rounds, if so, for people.
    pub(crate) fn breaks_in_rounds(&self) -> Option<String> {
        let Repeat { wide, .. } = self.form.is_round().then(|| self.repeat_in(Whole::default()))??;
        let count = self.stitches;
        let told = || {
            let fits = counts_that_hold(wide, count);
            format!(
                "the pattern repeats after {wide} stitches and breaks where rounds of {count} begin; {fits} would hold it"
            )
        };
        (!count.is_multiple_of(wide)).then(told)
    }

    fn size(&self) -> [Option<f64>; 2] {
        [self.stitch_width, self.row_height]
    }

    /// Length of yarn in a stitch, in diameters: given, or by Munden what a gauge of both width and height needs.
    fn yarn(&self, size: [Option<f64>; 2]) -> f64 {
        self.yarn_per_stitch.unwrap_or(match size {
            [Some(width), Some(height)] => (STITCHES_PER_SQUARE * width * height).sqrt(),
            _ => YARN_PER_STITCH,
        })
    }

    /// Width and height of a stitch on a profile: the mean of all rows.
    fn size_on(&self, profile: &Revolution, rows: &[Vec<Stitch>]) -> [f64; 2] {
        let height = profile.length() / rows.len() as f64;
        let width =
            |(r, row): (usize, &Vec<Stitch>)| TAU * profile.radius((r as f64 + 0.5) * height) / row.len() as f64;
        [rows.iter().enumerate().map(width).sum::<f64>() / rows.len() as f64, height]
    }

    /// The repeat of the chart, if it has one that fits the stitches.
    fn repeat(&self) -> Option<Repeat> {
        let ends = self.edges != Edges::Tile;
        self.repeat_in(Whole {
            stitches: (ends && !self.form.is_round()).then_some(self.stitches),
            rows: ends.then_some(self.rows),
        })
    }

    /// The same of a piece of these rows, unless sections of it have sizes of their own or it lies on the bias.
    fn repeat_of(&self, rows: &[Vec<Stitch>], size: [Option<f64>; 2]) -> Option<Repeat> {
        let open = size[0].is_none() && self.flat && self.colors.is_none() && self.edges != Edges::Tile;
        let by_itself = (open && kinds::in_sections(rows)) || self.slants(rows);
        self.repeat().filter(|_| !by_itself)
    }

    /// Whether a flat piece of these rows lies on the bias: all of it, and not stitches that a lace moves within its repeat.
    fn slants(&self, rows: &[Vec<Stitch>]) -> bool {
        let repeats = || self.repeat().is_some_and(|repeat| repeat.wide < self.stitches);
        self.form == Form::Flat && self.edges != Edges::Tile && kinds::slant(rows) && !repeats()
    }

    fn repeat_in(&self, whole: Whole) -> Option<Repeat> {
        let chart = self.chart.smallest(whole);
        let wide = chart.even_width(LARGEST_CELL)?;
        (u64::from(wide) * u64::from(chart.rows()) <= LARGEST_CELL.into()).then_some(Repeat { chart, wide })
    }

    /// The repeat of a chart that goes on without an end, or what is wrong with asking for one.
    fn repeat_for(&self, what: &str) -> Result<Repeat, ChartError> {
        let hint = "every row makes as many stitches as it takes, and few rows and stitches repeat";
        let problem = || format!("a chart with shaping or short rows has no repeat {what}");
        self.repeat_in(Whole::default()).ok_or_else(|| ChartError::new(None, problem(), hint))
    }

    /// Width of a stitch and distance between rows, in diameters: given, or found by relaxing a repeat of the chart.
    pub fn gauge(&self) -> [f64; 2] {
        if let [Some(width), Some(height)] = self.size() {
            return [width, height];
        }
        let rows = self.worked().unwrap_or_default();
        match self.repeat_of(&rows, self.size()) {
            Some(repeat) => self.cell(&repeat, self.size(), self.points).gauge(),
            None => {
                let points = if short_rows::any(&rows) { self.points } else { COARSE };
                self.rows_of_a_kind(&rows, self.size(), points).gauge(self.size())
            }
        }
    }

    fn cell(&self, Repeat { chart, wide }: &Repeat, size: [Option<f64>; 2], points: u32) -> Cell {
        let yarn = self.yarn(size);
        let is_whole = *wide == self.stitches && self.edges != Edges::Tile && !self.form.is_round();
        // Of a piece with borders of its own, rows are as high as the pattern between them makes them: beside other stitches,
        // loops that are held would draw them down.
        let middle = if is_whole && size[1].is_none() { chart.middle(*wide) } else { None };
        let own_height = |(own, stitches): (Chart, u32)| {
            let own = own.smallest(Whole::default());
            Cell::relaxed(&own, stitches, yarn, points, size).gauge()[1]
        };
        let height = middle.map(own_height);
        Cell::relaxed(chart, *wide, yarn, points, [size[0], size[1].or(height)])
    }

    /// A repeat of the chart as it relaxes: what a [`super::tile::Tile`] is made of. It is large enough that no yarn is
    /// near its own image.
    ///
    /// # Errors
    /// A chart that grows or shrinks has no repeat.
    pub(super) fn relaxed_rows(&self) -> Result<RelaxedRows, ChartError> {
        const SMALLEST: f64 = 9.0;
        let repeat = self.repeat_for("that could be laid")?;
        self.check_held_on(&repeat)?;
        let cell = self.cell(&repeat, self.size(), self.points);
        self.check_relaxed(&cell)?;
        let [across, up] = (SMALLEST / cell.period).ceil().max(DVec2::ONE).to_array();
        let row = |r: usize| -> Vec<(DVec3, [f32; 2])> {
            let visits = (cell.visits[r % cell.high as usize].len() - 1) * across as usize;
            (0..visits).flat_map(|k| cell.visit(r, k)).collect()
        };
        Ok(RelaxedRows {
            period: cell.period * DVec2::new(across, up),
            counts: [cell.wide * across as u32, cell.high * up as u32],
            rows: (0..cell.high as usize * up as usize).map(row).collect(),
        })
    }

    /// How many stitches each row has.
    ///
    /// # Errors
    /// A chart that does not fit the stitches or the rows, or that makes too many control points.
    pub fn widths(&self) -> Result<Vec<u32>, ChartError> {
        Ok(self.worked()?.iter().map(|row| row.len() as u32).collect())
    }

    /// How many control points its longest yarn has at least, of a piece of one colour: those of the stitches that are drawn
    /// through others, and of finished edges.
    ///
    /// # Errors
    /// As [`Self::widths`].
    pub fn least_points(&self) -> Result<u64, ChartError> {
        let is_drawn = |s: &&Stitch| matches!(s.act, Act::Draw | Act::Lift { .. } | Act::BindOff);
        let rows = self.worked()?;
        let drawn = rows.iter().map(|row| row.iter().filter(is_drawn).count() as u64);
        // Of a stitch that is cast on, in percent of a row's: the bind-off, or what draws the last row together, comes to it.
        const CAST_ON: u64 = 80;
        let edges =
            if self.is_finished() { u64::from(self.stitches) * u64::from(self.points) * CAST_ON / 100 } else { 0 };
        // A tile has a yarn for each row.
        let stitches: u64 = if self.edges == Edges::Tile { drawn.max().unwrap_or(0) } else { drawn.sum() };
        Ok(stitches * u64::from(self.points) + edges)
    }

    fn is_finished(&self) -> bool {
        matches!(self.edges, Edges::Finished | Edges::Slipped)
    }

    fn has_slipped_sides(&self) -> bool {
        self.edges == Edges::Slipped && !self.form.is_round()
    }

    /// Whether a flat piece with sides has tucks, which come to them.
    fn has_tucks(&self) -> bool {
        self.is_finished() && !self.form.is_round() && self.chart.has_tucks()
    }

    fn is_double(&self) -> bool {
        self.colors.as_ref().is_some_and(|c| c.work == Work::DoubleKnit)
    }

    fn layers(&self) -> u64 {
        if self.is_double() { 2 } else { 1 }
    }

    /// What cannot be knitted together.
    fn check(&self) -> Result<(), ChartError> {
        let slipped = self.edges == Edges::Slipped;
        let plain = Chart::named("stockinette").is_some_and(|plain| plain == self.chart);
        let wrong = match &self.colors {
            _ if slipped && self.form.is_round() => {
                ("what is knitted round has no sides to slip", "edges = \"finished\"")
            }
            Some(_) if slipped => (
                "slipped sides are knitted of one yarn",
                "edges = \"finished\" where several yarns come and go at the sides",
            ),
            Some(colors) if colors.work == Work::DoubleKnit => match self.form {
                _ if colors.rows.iter().flatten().any(|c| *c > 1) => {
                    ("double knitting takes two colours, one for each layer", "a third is knitted with \"stranded\"")
                }
                _ if self.edges == Edges::Tile => {
                    ("a tile is of one yarn in each row, and double knitting of two", "leave out `tile`")
                }
                _ if !plain => {
                    ("both sides of double knitting are stockinette", "leave out `pattern`, `chart` and `instructions`")
                }
                Form::Revolution(_) => {
                    ("both layers of double knitting have the same rows and stitches", "form = \"flat\" or \"tube\"")
                }
                _ => return Ok(()),
            },
            _ if self.flat => return Ok(()),
            _ if self.form.is_round() || self.edges == Edges::Tile => {
                ("only flat pieces with edges are blocked or curl", "leave out `flat`")
            }
            _ if self.repeat().is_none() => {
                ("how a chart with shaping curls is not known: it has no repeat", "leave out `flat`")
            }
            _ => return Ok(()),
        };
        Err(ChartError::new(None, wrong.0, wrong.1))
    }
}

#[cfg(test)]
mod tests;
