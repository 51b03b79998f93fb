//! Short rows: the yarn turns before the end of a row, and what stays on the needle is worked later.
//!
//! The gap is closed as German short rows do: the first stitch after a turn is slipped, and the yarn pulled over the needle
//! with it; a later row works both together.

use super::{
    super::chart::{Act, ChartError, Stitch, binds_from_right},
    Knit,
    colors::Way,
};

/// How many stitches stay unworked on the left and on the right of a row.
type Ends = [usize; 2];

fn ends(row: &[Stitch]) -> Ends {
    let is_worked = |s: &Stitch| s.act != Act::Unworked;
    let left = row.iter().position(is_worked).unwrap_or(row.len());
    let right = row.iter().rev().position(is_worked).unwrap_or(row.len());
    [left, right]
}

pub(super) fn any(rows: &[Vec<Stitch>]) -> bool {
    rows.iter().flatten().any(|s| s.act == Act::Unworked)
}

/// Whether the first row goes from right to left: rows are written for a yarn that begins on either side. `bound` says
/// whether it must end at an edge.
pub(super) fn from_right(rows: &[Vec<Stitch>], bound: bool) -> bool {
    binds_from_right(rows) || (any(rows) && follow(rows, false, bound).is_err())
}

/// Leads the one yarn of a piece with short rows or gaps to where its rows begin; `first` says whether the first goes from right to left.
pub(super) fn lead(ways: &mut [Way], rows: &[Vec<Stitch>], first: bool) {
    for stretch in ways.iter_mut().flat_map(|way| &mut way.rows) {
        let row = usize::try_from(stretch.row).ok().and_then(|r| rows.get(r));
        stretch.backwards ^= first;
        stretch.first = row.map_or(0, |row| ends(row)[0] as u32);
    }
}

/// Whether row `r` goes from right to left.
fn goes_left(r: usize, first: bool) -> bool {
    (r % 2 == 1) != first
}

/// What is wrong with a row, from 0.
struct Wrong {
    row: usize,
    problem: String,
    hint: &'static str,
}

/// Follows a yarn from row to row.
fn follow(rows: &[Vec<Stitch>], first: bool, bound: bool) -> Result<(), Wrong> {
    const HINT: &str = "a turn is between two rows, which leave the same stitches unworked on that side";
    // Stitches between the yarn and the edge on its side.
    let mut here = 0;
    for (row, own) in rows.iter().enumerate() {
        let [left, right] = ends(own);
        let [begin, end] = if goes_left(row, first) { [right, left] } else { [left, right] };
        if begin != here {
            let problem = match row {
                0 => format!("row 1 begins beside {begin} unworked stitches, but its yarn hangs at the edge"),
                _ => format!(
                    "row {} begins beside {begin} unworked stitches, but row {row} turned beside {here}",
                    row + 1
                ),
            };
            return Err(Wrong { row, problem, hint: HINT });
        }
        here = end;
    }
    match here {
        _ if !bound => Ok(()),
        0 => Ok(()),
        _ => Err(Wrong {
            row: rows.len() - 1,
            problem: format!("row {}, the last one, turns beside {here} stitches that are to be bound off", rows.len()),
            hint: "one row more, to the edge",
        }),
    }
}

/// Whether the yarn can be pulled over a stitch.
fn is_plain(stitch: &Stitch) -> bool {
    let plain = matches!(stitch.act, Act::Draw | Act::Tuck) && stitch.parents == 1;
    plain && stitch.layer == 0 && !stitch.twisted
}

/// Turns the yarn where rows leave stitches unworked: makes the first stitch after each turn a double one.
///
/// # Errors
/// Rows that no yarn can go through, with their line in the chart.
pub(super) fn turned(rows: &mut [Vec<Stitch>], knit: &Knit) -> Result<(), ChartError> {
    let Some(short) = rows.iter().position(|row| row.iter().any(|s| s.act == Act::Unworked)) else { return Ok(()) };
    let wrong = |Wrong { row, problem, hint }: Wrong| ChartError::new(Some(knit.chart.line_of(row)), problem, hint);
    if knit.form.is_round() {
        let problem = format!("row {} leaves stitches unworked in the round", short + 1);
        return Err(wrong(Wrong {
            row: short,
            problem,
            hint: "short rows are knitted back and forth: form = \"flat\"",
        }));
    }
    if knit.colors.is_some() {
        let problem = format!("row {} is short, in a knit of several colours", short + 1);
        return Err(wrong(Wrong { row: short, problem, hint: "color_work = \"printed\" is of one yarn" }));
    }
    for (row, own) in rows.iter().enumerate() {
        let n = own.len();
        let [left, right] = ends(own);
        let (problem, hint) = if n != knit.stitches as usize {
            let problem = format!("row {} makes {n} stitches of {}, beside short rows", row + 1, knit.stitches);
            (problem, "each row of a piece with short rows keeps the number of stitches")
        } else if left == n {
            (format!("row {} works no stitch", row + 1), "leave the row out")
        } else if own[left..n - right].iter().any(|s| s.act == Act::Unworked) {
            let problem = format!("row {} leaves stitches unworked between others", row + 1);
            (problem, "only those at the ends of a row: where the yarn comes by, `sl` slips a stitch")
        } else {
            continue;
        };
        return Err(wrong(Wrong { row, problem, hint }));
    }
    let bound = knit.is_finished();
    let first = match (follow(rows, false, bound), follow(rows, true, bound)) {
        (Ok(()), _) => false,
        (_, Ok(())) => true,
        // The way that goes on longer is more likely meant.
        (Err(a), Err(b)) => return Err(wrong(if b.row > a.row { b } else { a })),
    };
    for r in 1..rows.len() {
        let (below, own) = rows.split_at_mut(r);
        let (below, own) = (&below[r - 1], &mut own[0]);
        let [left, right] = ends(own);
        let turn = match goes_left(r, first) {
            true if right > 0 => Some(own.len() - 1 - right),
            false if left > 0 => Some(left),
            _ => None,
        };
        if let Some(stitch) = turn.map(|k| &mut own[k]).filter(|s| is_plain(s)) {
            stitch.act = Act::Double;
        }
        // What stays shows as it did.
        for stitch in own.iter_mut().filter(|s| matches!(s.act, Act::Unworked | Act::Double)) {
            stitch.purl = below.get(stitch.first_parent as usize).is_some_and(|s| s.purl);
        }
    }
    Ok(())
}
