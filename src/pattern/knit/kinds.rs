//! What a piece without a repeat begins with: cells for those of its rows that are like their neighbours.

use rayon::prelude::*;

use super::{Knit, cell::Cell};
use crate::pattern::chart::{Chart, Stitch};

/// Cells of rows that are alike, and which row takes which.
#[derive(Default)]
pub(super) struct Kinds {
    cells: Vec<Cell>,
    of_row: Vec<Option<usize>>,
}

impl Kinds {
    /// The cell of a row, and the row in it; none where it is not like its neighbours.
    pub(super) fn of(&self, row: usize) -> Option<(&Cell, usize)> {
        let kind = self.of_row.get(row).copied().flatten()?;
        Some((&self.cells[kind], 0))
    }

    /// Width of a stitch in each row: that of its kind, if none is given. Near rows of another kind widths go over into each other.
    pub(super) fn widths(&self, given: Option<f64>) -> Vec<f64> {
        /// Rows to each side over which they do.
        const REACH: usize = 3;
        let own = self.gauge([given, None])[0];
        let known: Vec<(usize, f64)> = self
            .of_row
            .iter()
            .enumerate()
            .filter_map(|(row, kind)| Some((row, given.unwrap_or(self.cells[(*kind)?].gauge()[0]))))
            .collect();
        let at = |row: usize| {
            let after = known.partition_point(|k| k.0 < row);
            match (after.checked_sub(1).map(|i| known[i]), known.get(after)) {
                (Some(a), Some(b)) => a.1 + (b.1 - a.1) * (row - a.0) as f64 / (b.0 - a.0) as f64,
                (a, b) => a.or(b.copied()).map_or(own, |k| k.1),
            }
        };
        let widths: Vec<f64> = (0..self.of_row.len()).map(at).collect();
        let mean = |row: usize| {
            let near = &widths[row.saturating_sub(REACH)..(row + REACH + 1).min(widths.len())];
            near.iter().sum::<f64>() / near.len() as f64
        };
        (0..widths.len()).map(mean).collect()
    }

    /// That of the cell that most rows take, unless it is given.
    pub(super) fn gauge(&self, given: [Option<f64>; 2]) -> [f64; 2] {
        let count = |k: usize| self.of_row.iter().filter(|o| **o == Some(k)).count();
        let most = (0..self.cells.len()).max_by_key(|&k| (count(k), std::cmp::Reverse(k)));
        let own = most.map_or([4.0, 2.8], |k| self.cells[k].gauge());
        [0, 1].map(|c| given[c].unwrap_or(own[c]))
    }
}

impl Knit {
    /// Cells for rows of knit and purl columns that are above and below their like: what a shaped piece begins with.
    pub(super) fn rows_of_a_kind(&self, rows: &[Vec<Stitch>], size: [Option<f64>; 2], points: u32) -> Kinds {
        const MOST_KINDS: usize = 6;
        let kinds: Vec<Option<Vec<bool>>> = rows.iter().map(|r| column_signs(r)).collect();
        let mut known: Vec<Vec<bool>> = Vec::new();
        let of_row: Vec<Option<usize>> = (0..rows.len())
            .map(|r| {
                let kind = kinds[r].as_ref()?;
                let alike =
                    |other: Option<usize>| other.and_then(|o| kinds.get(o)).is_none_or(|k| k.as_ref() == Some(kind));
                if !alike(r.checked_sub(1)) || !alike(Some(r + 1)) {
                    return None;
                }
                known.iter().position(|k| k == kind).or_else(|| {
                    (known.len() < MOST_KINDS).then(|| {
                        known.push(kind.clone());
                        known.len() - 1
                    })
                })
            })
            .collect();
        if known.is_empty() {
            known.push(vec![false]);
        }
        let cell = |kind: &Vec<bool>| {
            let row: Vec<&str> = kind.iter().map(|purl| if *purl { "p" } else { "k" }).collect();
            let chart = Chart::parse(&[row.join(" ")]).expect("knits and purls are a chart");
            let relaxed = |points, size| Cell::relaxed(&chart, kind.len() as u32, self.yarn(size), points, size);
            // Of few points it would find another size than a piece of nothing else has.
            let own = if points < self.points { relaxed(self.points, size).gauge().map(Some) } else { size };
            relaxed(points, own)
        };
        Kinds { cells: known.par_iter().map(cell).collect(), of_row }
    }
}

/// Whether rows of plain knit and purl stitches lie in sections of several rows, each of other columns, as a welt of ribbing below
/// stockinette: which draw together by as much as each does by itself.
pub(super) fn in_sections(rows: &[Vec<Stitch>]) -> bool {
    const LEAST: usize = 6;
    let kinds: Option<Vec<Vec<bool>>> =
        rows.iter().map(|row| column_signs(row).filter(|_| row.iter().all(Stitch::is_plain))).collect();
    let Some(kinds) = kinds else { return false };
    let sections: Vec<&[Vec<bool>]> = kinds.chunk_by(|a, b| a == b).collect();
    sections.len() > 1 && sections.iter().all(|section| section.len() >= LEAST)
}

/// Whether most stitches of rows of one width go aside from what they are drawn through, row by row to one side, until the cloth lies
/// stitches beside its cast-on edge: on the bias, as where one edge decreases and the other one increases.
pub(super) fn slant(rows: &[Vec<Stitch>]) -> bool {
    const FAR: i64 = 2;
    if rows.windows(2).any(|pair| pair[0].len() != pair[1].len()) {
        return false;
    }
    // The offset that half of a row's stitches have no more than, and the other half no less.
    let aside = |row: &Vec<Stitch>| {
        let mut offsets: Vec<i64> = row
            .iter()
            .enumerate()
            .filter(|(_, stitch)| stitch.parents == 1 && stitch.is_in_line())
            .map(|(j, stitch)| j as i64 - i64::from(stitch.first_parent))
            .collect();
        offsets.sort_unstable();
        offsets.get(offsets.len() / 2).copied().filter(|_| 2 * offsets.len() > row.len()).unwrap_or(0)
    };
    let mut sum = 0;
    rows.iter().any(|row| {
        sum += aside(row);
        sum.abs() >= FAR
    })
}

/// Knit or purl along a row, once around its repeat, if that is short.
fn column_signs(row: &[Stitch]) -> Option<Vec<bool>> {
    const LONGEST: usize = 12;
    let repeats = |n: &usize| (0..row.len()).all(|j| row[j].purl == row[j % n].purl);
    let n = (1..=LONGEST.min(row.len())).find(repeats)?;
    Some(row[..n].iter().map(|s| s.purl).collect())
}
