//! Stitches that are bound off within a row: the next row finds the others.

use std::ops::Range;

use super::{Act, Stitch};

fn is_bound(stitch: &Stitch) -> bool {
    stitch.act == Act::BindOff
}

/// Runs of stitches of a row that are bound off, by their columns.
pub(in super::super) fn gaps(row: &[Stitch]) -> Vec<Range<usize>> {
    let mut gaps: Vec<Range<usize>> = Vec::new();
    for (j, _) in row.iter().enumerate().filter(|(_, s)| is_bound(s)) {
        match gaps.last_mut() {
            Some(gap) if gap.end == j => gap.end += 1,
            _ => gaps.push(j..j + 1),
        }
    }
    gaps
}

/// Counts what a row takes of the row below by columns there, where it has counted stitches that are left. False if a stitch, or
/// those that change places, would lie on both sides of a gap.
pub(super) fn count_on(below: &[Stitch], row: &mut [Stitch]) -> bool {
    if !below.iter().any(is_bound) {
        return true;
    }
    let left: Vec<u32> = (0..below.len() as u32).filter(|&j| !is_bound(&below[j as usize])).collect();
    let column = |k: u32| left.get(k as usize).copied().unwrap_or(below.len() as u32);
    for stitch in row.iter_mut() {
        let last = stitch.first_parent + u32::from(stitch.parents.max(1)) - 1;
        if stitch.parents > 1 && column(last) - column(stitch.first_parent) != last - stitch.first_parent {
            return false;
        }
        stitch.first_parent = column(stitch.first_parent);
    }
    // Those that change places are the only ones that do not come in the order of what they take.
    let worked = || row.iter().filter(|s| s.parents > 0);
    gaps(below).iter().all(|gap| {
        let sides = || worked().map(|s| s.first_parent as usize >= gap.end);
        sides().zip(sides().skip(1)).all(|(before, after)| before <= after)
    })
}

/// Whether the first row of a flat piece goes from right to left: stitches at a side are bound off where a row begins.
pub(in super::super) fn binds_from_right(rows: &[Vec<Stitch>]) -> bool {
    let ends_there = |(r, row): (usize, &Vec<Stitch>)| {
        gaps(row).iter().any(|gap| if r % 2 == 1 { gap.start == 0 } else { gap.end == row.len() })
    };
    rows.iter().enumerate().any(ends_there)
}
