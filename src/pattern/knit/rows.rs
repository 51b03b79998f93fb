//! The rows of a piece as they are worked: as the chart has them, with sides that hold.

use super::{Closing, Knit, Repeat, YARN_PER_STITCH, cell::Cell, gaps, kinds, short_rows};
use crate::pattern::{
    MAX_POINTS,
    chart::{Act, ChartError, Stitch},
};

/// Over how many rows a loop is slipped at most, of usual yarn, and held in all: where a stitch is slipped for five rows they no
/// longer find room beside its loop, and more yarn-overs than this have none on the needle.
const MOST_SLIPPED: u32 = 4;
const MOST_HELD: u32 = 6;
/// Yarn that each row takes of a loop that is held over it, and what its head and feet take, in units.
const HELD_ROW: f64 = 2.9;
const HELD_ENDS: f64 = YARN_PER_STITCH - HELD_ROW * (MOST_SLIPPED + 1) as f64;

/// For how many rows a stitch is not worked, and slipped in so many of them.
#[derive(Clone, Copy, Default, PartialEq)]
struct Held {
    rows: u32,
    slipped: u32,
}

impl Knit {
    /// Whether every loop is worked before it is held for too long.
    fn check_held(&self, rows: &[Vec<Stitch>]) -> Result<(), ChartError> {
        // What the yarn wraps where it turns is not drawn up by it.
        let is_unworked = |s: Option<&Stitch>| s.is_some_and(|s| s.act == Act::Unworked);
        let is_wrapped = |row: &[Stitch], j: usize| is_unworked(row.get(j + 1)) || j > 0 && is_unworked(row.get(j - 1));
        let is_held = |s: &Stitch| matches!(s.act, Act::Pass { .. } | Act::Tuck);
        if !rows.iter().flatten().any(is_held) {
            return Ok(());
        }
        let yarn = self.yarn(self.size());
        let most_slipped = (((yarn - HELD_ENDS) / HELD_ROW + 1e-9).floor() as u32).max(2) - 1;
        let most_held = MOST_HELD.max(most_slipped);
        let mut below = vec![Held::default(); self.stitches as usize];
        for (r, row) in rows.iter().enumerate() {
            let mut held = Vec::with_capacity(row.len());
            for (j, s) in row.iter().enumerate() {
                let before = below.get(s.first_parent as usize).copied().unwrap_or_default();
                let own = match s.act {
                    Act::Pass { .. } if is_wrapped(row, j) => before,
                    Act::Pass { .. } => Held { rows: before.rows + 1, slipped: before.slipped + 1 },
                    Act::Tuck => Held { rows: before.rows + 1, ..before },
                    Act::Unworked | Act::Double => before,
                    Act::Draw | Act::Over | Act::Lift { .. } | Act::Bobble | Act::BindOff | Act::CastOn => {
                        Held::default()
                    }
                };
                if own.slipped > most_slipped || own.rows > most_held {
                    let (what, count, most) = match own.slipped > most_slipped {
                        true => ("slipped", own.slipped, most_slipped),
                        false => ("held by slips and tucks", own.rows, most_held),
                    };
                    let more = (HELD_ENDS + HELD_ROW * f64::from(count + 1)) / yarn;
                    let problem = format!(
                        "row {}: stitch {} is {what} for {count} rows, and a loop of this yarn reaches over {most} at most",
                        r + 1,
                        j + 1
                    );
                    let hint = match own.slipped > most_slipped {
                        true => format!(
                            "work it (k or p) after {most} rows, or {more:.2} times the yarn in a stitch by `yarn_per_stitch`"
                        ),
                        false => format!("work it (k or p) after {most} rows"),
                    };
                    return Err(ChartError::new(Some(self.chart.line_of(r)), problem, hint));
                }
                held.push(own);
            }
            below = held;
        }
        Ok(())
    }

    /// Whether the loops of a repeat hold each other: where its size is open it would fall apart, or be drawn out of shape, until
    /// the yarn is stretched.
    pub(super) fn check_relaxed(&self, cell: &Cell) -> Result<(), ChartError> {
        const MOST: f64 = 1.25;
        let stretch = cell.stretch();
        if stretch <= MOST || self.size().iter().all(Option::is_some) {
            return Ok(());
        }
        let [width, height] = cell.gauge();
        let problem = format!(
            "the stitches of this chart do not hold each other: relaxed, a stitch is {width:.1} x {height:.1} yarns wide and high, and its \
             yarn {stretch:.1} times as long as it is"
        );
        let hint = match self.chart.widest_cable() {
            Some(wide) => format!("at least {} plain rows between crossings of {wide} stitches", wide - 1),
            None => "plain rows between those with slips, tucks or decreases".to_owned(),
        };
        Err(ChartError::new(None, problem, hint))
    }

    /// As [`Self::check_held`] of a chart that repeats, which is relaxed as if it went on.
    pub(super) fn check_held_on(&self, Repeat { chart, wide }: &Repeat) -> Result<(), ChartError> {
        let longest = MOST_HELD + self.yarn(self.size()) as u32;
        let rows = chart.work(*wide, chart.rows().saturating_add(longest), u64::MAX)?;
        Self { chart: chart.clone(), stitches: *wide, ..self.clone() }.check_held(&rows)
    }

    pub(super) fn worked(&self) -> Result<Vec<Vec<Stitch>>, ChartError> {
        let most_stitches = MAX_POINTS / (self.layers() * u64::from(self.points)).max(1);
        let mut rows = self.chart.work(self.stitches, self.rows, most_stitches)?;
        gaps::check(&rows, self)?;
        short_rows::turned(&mut rows, self)?;
        self.check_held(&rows)?;
        self.repeat().map_or(Ok(()), |repeat| self.check_held_on(&repeat))?;
        if self.has_tucks() {
            pass_tucks_at_sides(&mut rows);
        }
        if self.has_slipped_sides() {
            slip_first_stitches(&mut rows, self.is_finished());
        }
        Ok(rows)
    }

    /// The row that would come above the last one, of a chart that repeats, where each of its stitches is drawn through one
    /// of that row: what is bound off goes on in the pattern.
    pub(super) fn next(&self, rows: &[Vec<Stitch>]) -> Option<Vec<Stitch>> {
        let bound_off = self.is_finished() && self.rims.top == Closing::BoundOff && self.repeat().is_some();
        let last = rows.last().filter(|_| bound_off)?;
        let next = match kinds::in_sections(rows) {
            true => last.clone(),
            false => self.chart.work(self.stitches, self.rows + 1, u64::MAX).ok()?.pop()?,
        };
        (next.len() == last.len() && next.iter().all(Stitch::is_plain)).then_some(next)
    }
}

/// Beyond the last stitch nothing holds a yarn over: tucks there become passes, which make a chain along the side.
fn pass_tucks_at_sides(rows: &mut [Vec<Stitch>]) {
    for r in 0..rows.len() {
        for side in [0, rows[r].len().saturating_sub(1)] {
            let stitch = |row: &Vec<Stitch>| row.get(side).copied();
            let is_drawn = |s: &Stitch| s.act == Act::Draw;
            if rows[r].len() > 2 && rows[r][side].act == Act::Tuck {
                let worked = rows[r..].iter().chain(rows[..r].iter().rev()).filter_map(stitch).find(is_drawn);
                // The yarn passes where the chain is not seen.
                rows[r][side].act = Act::Pass { front: worked.is_some_and(|s| s.purl) };
            }
        }
    }
}

/// Rows begin on the left and on the right by turns. The first one holds the cast-on edge.
fn slip_first_stitches(rows: &mut [Vec<Stitch>], finished: bool) {
    let right = short_rows::from_right(rows, finished);
    for (r, row) in rows.iter_mut().enumerate().skip(1).filter(|(_, row)| row.len() > 2) {
        let first = if (r % 2 == 1) == right { 0 } else { row.len() - 1 };
        if row[first].act == Act::Draw && row[first].parents == 1 && row[first].layer == 0 {
            row[first].act = Act::Pass { front: false };
        }
    }
}
