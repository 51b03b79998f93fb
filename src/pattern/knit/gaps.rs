//! Stitches that are bound off within a piece: what holds them, and what closes the gap.

use std::ops::Range;

use super::{
    super::chart::{Act, ChartError, Stitch, binds_from_right, gaps},
    Knit, short_rows,
};

/// What is wrong with a gap, and what to do.
type Wrong = (String, String);

/// Whether each stitch that is bound off is held by the next one, and each gap within a row is cast on over.
///
/// # Errors
/// Rows that one yarn cannot go through, with their line in the chart.
pub(super) fn check(rows: &[Vec<Stitch>], knit: &Knit) -> Result<(), ChartError> {
    let is_new = |s: &Stitch| matches!(s.act, Act::BindOff | Act::CastOn);
    let Some(first) = rows.iter().position(|row| row.iter().any(is_new)) else { return Ok(()) };
    let wrong = |r: usize, (problem, hint): Wrong| Err(ChartError::new(Some(knit.chart.line_of(r)), problem, hint));
    let does = |what: &str| format!("row {} binds off or casts on, {what}", first + 1);
    if knit.colors.is_some() {
        let hint = "color_work = \"printed\" is of one yarn".to_owned();
        return wrong(first, (does("in a knit of several colours"), hint));
    }
    if short_rows::any(rows) {
        return wrong(first, (does("beside short rows"), "leave out `bo` and `co`, or `-`".to_owned()));
    }
    let first = !knit.form.is_round() && binds_from_right(rows);
    for (r, row) in rows.iter().enumerate() {
        let backwards = !knit.form.is_round() && (r % 2 == 1) != first;
        for gap in gaps(row) {
            if let Some(found) = held(row, r, &gap, backwards, knit).or_else(|| closed(rows, r, &gap, knit)) {
                return wrong(r, found);
            }
        }
    }
    Ok(())
}

/// What is wrong with the stitch that the last loop of a gap is passed over.
fn held(row: &[Stitch], r: usize, gap: &Range<usize>, backwards: bool, knit: &Knit) -> Option<Wrong> {
    let next = if backwards { gap.start.checked_sub(1) } else { Some(gap.end) };
    let way = if backwards { "right to left" } else { "left to right" };
    match next.and_then(|j| row.get(j)) {
        None if knit.form.is_round() => {
            let problem = format!("row {} binds off its last stitch, and nothing is left to pass it over", r + 1);
            Some((problem, "begin the rounds elsewhere, so that stitches are left on both sides".to_owned()))
        }
        None => {
            let problem = format!(
                "row {} goes from {way} and binds off its last stitch, and nothing is left to pass it over",
                r + 1
            );
            Some((problem, "bind off where the next row begins, on the same side".to_owned()))
        }
        Some(s) if s.act != Act::Draw || s.parents != 1 || s.layer != 0 => {
            let problem = format!("row {} goes from {way} and binds off before a stitch that is no k or p", r + 1);
            Some((problem, "the last stitch that is bound off is passed over the next one: k or p".to_owned()))
        }
        Some(_) => None,
    }
}

/// What is wrong with what is above a gap.
fn closed(rows: &[Vec<Stitch>], r: usize, gap: &Range<usize>, knit: &Knit) -> Option<Wrong> {
    let (row, is_round) = (&rows[r], knit.form.is_round());
    if gap.start == 0 && is_round {
        let problem = format!("round {} binds off its first stitch", r + 1);
        return Some((problem, "begin the rounds elsewhere, so that stitches are left on both sides".to_owned()));
    }
    // At a side the piece becomes narrower.
    if gap.start == 0 || gap.end == row.len() {
        return None;
    }
    let count = gap.len();
    let hint = format!("the next row casts on over the gap: co{count}");
    let Some(above) = rows.get(r + 1) else {
        let problem = format!("row {}, the last one, binds off {count} stitches within it", r + 1);
        return Some((problem, hint));
    };
    let after = above.iter().position(|s| s.parents > 0 && s.first_parent as usize >= gap.end);
    let before = above.iter().rposition(|s| s.parents > 0 && (s.first_parent as usize) < gap.start);
    let between = before.map_or(0, |b| b + 1)..after.unwrap_or(above.len());
    let is_closed = above[between].iter().any(|s| s.act == Act::CastOn);
    (!is_closed).then(|| (format!("row {} goes on over the gap of {count} stitches of row {}", r + 2, r + 1), hint))
}
