//! The rows of a piece as they are worked: as the chart has them, with sides that hold.

use super::{Closing, Knit, short_rows};
use crate::pattern::{
    MAX_POINTS,
    chart::{Act, ChartError, Stitch},
};

impl Knit {
    pub(super) fn worked(&self) -> Result<Vec<Vec<Stitch>>, ChartError> {
        let most_stitches = MAX_POINTS / (self.layers() * u64::from(self.points)).max(1);
        let mut rows = self.chart.work(self.stitches, self.rows, most_stitches)?;
        short_rows::turned(&mut rows, self)?;
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
        let next = self.chart.work(self.stitches, self.rows + 1, u64::MAX).ok()?.pop()?;
        let is_plain = |s: &Stitch| s.act == Act::Draw && s.parents == 1 && s.layer == 0 && !s.twisted;
        (next.len() == last.len() && next.iter().all(is_plain)).then_some(next)
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
