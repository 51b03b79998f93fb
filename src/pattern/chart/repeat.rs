//! The smallest repeat of a chart: rows that are written out over a whole width list every stitch.

use std::sync::Arc;

use super::{Chart, Row, Step};
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

/// The most stitches of both borders together.
const MOST_BORDER: u32 = 32;

/// Where what repeats begins and ends, in stitches of a row, and how many a repeat has.
#[derive(Clone, Copy)]
struct Sides {
    left: u32,
    right: u32,
    own: u32,
}

impl Chart {
    /// What repeats between borders of its own, as most patterns are written, and how many stitches that has: at least half of all
    /// `wide` are between both borders. `None` where there are no borders, or nothing repeats.
    pub(in super::super) fn middle(&self, wide: u32) -> Option<(Self, u32)> {
        let rows: Vec<Worked> = self.rows.iter().map(|row| row.worked(wide)).collect::<Option<_>>()?;
        // The narrowest borders, and of these the narrowest repeat.
        for borders in 1..=(wide / 2).min(MOST_BORDER) {
            let middle = wide - borders;
            for own in (1..=middle / 2).filter(|own| middle.is_multiple_of(*own)) {
                for left in 0..=borders {
                    let sides = Sides { left, right: left + middle, own };
                    if let Some(steps) = rows.iter().map(|row| row.between(sides)).collect::<Option<Vec<_>>>() {
                        let row = |(steps, row): (&[Step], &Row)| Row { steps: Arc::from(steps), line: row.line };
                        return Some((Self { rows: steps.into_iter().zip(&self.rows).map(row).collect() }, own));
                    }
                }
            }
        }
        None
    }
}

/// The steps of a row over all of its stitches.
struct Worked {
    steps: Vec<Step>,
    /// How many stitches the steps before each of them take and make, and all of them.
    before: Vec<(u32, u32)>,
}

impl Worked {
    /// The steps of one repeat between borders.
    fn between(&self, Sides { left, right, own }: Sides) -> Option<&[Step]> {
        let at = |stitches: u32| self.before.binary_search(&(stitches, stitches)).ok();
        let (first, next, end) = (at(left)?, at(left + own)?, at(right)?);
        let (middle, count) = (&self.steps[first..end], next - first);
        let repeats = middle.len().is_multiple_of(count) && middle.iter().zip(&middle[count..]).all(|(a, b)| a == b);
        repeats.then(|| &middle[..count])
    }
}

impl Row {
    /// Its steps on so many stitches, of which it takes as many as it makes; `None` where it does not go into them.
    fn worked(&self, wide: u32) -> Option<Worked> {
        let (takes, makes) = self.takes_and_makes();
        if self.is_short() || takes == 0 || takes != makes || !wide.is_multiple_of(takes) {
            return None;
        }
        let steps = self.steps.repeat((wide / takes) as usize);
        let sums = steps.iter().scan((0, 0), |sum, step| {
            let (takes, makes) = step.takes_and_makes();
            *sum = (sum.0 + takes, sum.1 + makes);
            Some(*sum)
        });
        let before = std::iter::once((0, 0)).chain(sums).collect();
        Some(Worked { steps, before })
    }

    /// The steps of its smallest repeat, on a row of so many stitches if it is there once.
    fn smallest(&self, stitches: Option<u32>) -> Arc<[Step]> {
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
    fn what_repeats_between_borders_is_found() {
        let middle = |rows: &[&str], wide: u32| {
            let found = Chart::parse(rows).unwrap().middle(wide);
            found.map(|(chart, own)| (chart.rows.iter().map(|row| row.steps.len()).collect::<Vec<_>>(), own))
        };
        let linen = ["k2 k sl k sl k sl k2", "p2 p sl p sl p sl p2"];
        assert_eq!(middle(&linen, 10), Some((vec![2, 2], 2)));
        // Borders of garter stitch beside plain knit, and lace, whose steps take and make different numbers.
        assert_eq!(middle(&["k10", "k2 p6 k2"], 10), Some((vec![1, 1], 1)));
        assert_eq!(middle(&["k3 yo k2tog yo k2tog yo k2tog k2", "k3 p6 k2"], 11), Some((vec![2, 2], 2)));
        // A repeat that borders cut in two begins beside them.
        assert_eq!(middle(&["p k6 p k6 p k6 p", "k p6 k p6 k p6 k"], 22), Some((vec![7, 7], 7)));
        for (rows, wide) in
            [(&["k p p p k2 p k"][..], 8), (&["k2 p2 k2 p2"], 8), (&["k2tog k3 yo"], 5), (&["k4 -4"], 8)]
        {
            let found = middle(rows, wide);
            assert!(found.is_none(), "{rows:?}: {found:?}");
        }
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
