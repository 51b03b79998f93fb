//! The smallest repeat of a chart: rows that are written out over a whole width list every stitch.

use std::sync::Arc;

use super::{Chart, Row};
use crate::pattern::period::period;

/// The piece that a chart is written out for, where a border may cut its repeat.
#[derive(Clone, Copy, Debug, Default)]
pub(in super::super) struct Whole {
    /// Its stitches, if it ends at its sides.
    pub(in super::super) stitches: Option<u32>,
    /// Its rows, if it ends at its top.
    pub(in super::super) rows: Option<u32>,
}

impl Chart {
    /// The chart with as few stitches in each row, and as few rows, as knit the same. What fits a whole row or all rows only in
    /// part counts as a repeat where they are there once, in `whole`.
    pub(in super::super) fn smallest(&self, whole: Whole) -> Self {
        let mut rows: Vec<Row> = Vec::with_capacity(self.rows.len());
        for (i, row) in self.rows.iter().enumerate() {
            // All rows of a line share their steps.
            let steps = match (i.checked_sub(1).map(|below| &self.rows[below]), rows.last()) {
                (Some(below), Some(last)) if Arc::ptr_eq(&below.steps, &row.steps) => Arc::clone(&last.steps),
                _ => row.smallest(whole.stitches),
            };
            rows.push(Row { steps, line: row.line });
        }
        let all = rows.len();
        let high = period(all, |a, b| Arc::ptr_eq(&rows[a].steps, &rows[b].steps) || rows[a].steps == rows[b].steps);
        if all.is_multiple_of(high) || whole.rows.is_some_and(|count| count as usize <= all) {
            rows.truncate(high);
        }
        Self { rows }
    }
}

impl Row {
    /// The steps of its smallest repeat, on a row of so many stitches if it is there once.
    fn smallest(&self, stitches: Option<u32>) -> Arc<[super::Step]> {
        let all = self.steps.len();
        // A short row is written for its stitches.
        if self.is_short() {
            return Arc::clone(&self.steps);
        }
        let wide = period(all, |a, b| self.steps[a] == self.steps[b]);
        let (takes, _) = self.takes_and_makes();
        if wide < all && (all.is_multiple_of(wide) || stitches == Some(takes)) {
            Arc::from(&self.steps[..wide])
        } else {
            Arc::clone(&self.steps)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn smallest(rows: &[&str], whole: [Option<u32>; 2]) -> Vec<usize> {
        let [stitches, rows_of_piece] = whole;
        let chart = Chart::parse(rows).unwrap().smallest(Whole { stitches, rows: rows_of_piece });
        chart.rows.iter().map(|row| row.steps.len()).collect()
    }

    #[test]
    fn rows_that_are_written_out_are_their_repeat() {
        let goes_on = [None; 2];
        assert_eq!(smallest(&["k2 p2 k2 p2 k2 p2", "k8"], goes_on), [4, 1]);
        assert_eq!(smallest(&["k8 k8", "c4b c4b c4f c4f"], goes_on), [1, 4]);
        assert_eq!(smallest(&["k2 yo k2tog k2 yo k2tog", "k12"], goes_on), [4, 1]);
        assert_eq!(smallest(&["3: k p", "k p k p", "p k", "4: k p k p", "p k p k"], goes_on), [2; 5]);
        // A short row is there once.
        assert_eq!(smallest(&["k8", "k4 -4"], goes_on), [1, 8]);
    }

    #[test]
    fn what_fits_only_in_part_is_a_repeat_where_it_is_there_once() {
        let rows = ["k sl k sl k", "k5", "k sl k sl k", "k5", "k sl k sl k"];
        assert_eq!(smallest(&rows, [None; 2]), [5, 1, 5, 1, 5]);
        assert_eq!(smallest(&rows, [Some(5), Some(5)]), [2, 1]);
        assert_eq!(smallest(&rows, [Some(10), Some(6)]), [5, 1, 5, 1, 5]);
        // A repeat is seen twice at least: sides of their own are none.
        assert_eq!(smallest(&["k p p p k"], [Some(5), None]), [5]);
    }

    #[test]
    fn patterns_with_a_name_are_as_wide_and_as_high_as_they_are_written() {
        for (name, _) in super::super::PATTERNS {
            let chart = Chart::named(name).unwrap();
            let smallest = chart.smallest(Whole::default());
            assert_eq!(smallest.rows(), chart.rows(), "{name}");
            assert_eq!(smallest.even_width(100), chart.even_width(100), "{name}");
        }
    }
}
