//! Small defects of curve files that every format shares, mended and counted.

use glam::DVec3;

use crate::{
    geometry::curve::{Basis, Curve, CurveSet},
    math::words::counted,
};

/// A closing gap this many times the median segment is a curve wrongly marked closed (Yuksel's tea cozy has 174).
const WIDE_GAP: f64 = 10.0;

/// A cubic B-spline reaches a point that is repeated three times; more repeats add nothing.
const END_REPEATS: usize = 3;

/// What a file says about the two ends of a curve.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Ends {
    /// They are apart.
    Open,
    /// The last point is followed by the first.
    Closed,
    /// The last point is followed by the first, in a format whose mark of this is known to be wrong at times.
    MarkedClosed,
}

/// Takes curves as the file has them, keeps those that can be drawn, and remembers what it did.
#[derive(Default)]
pub(super) struct Repair {
    set: CurveSet,
    seen: u64,
    closing_repeats: u64,
    wide_gaps: Tally,
    flat_loops: Tally,
    skipped: Tally,
    duplicates: u64,
    duplicate_curves: Tally,
}

/// How often, and where for the first time.
#[derive(Default)]
struct Tally {
    count: u64,
    first: u64,
}

impl Tally {
    fn add(&mut self, curve: u64) {
        if self.count == 0 {
            self.first = curve;
        }
        self.count += 1;
    }
}

impl Repair {
    /// Adds the next curve of the file. `points` must be finite and `radii`, if any, equally many.
    pub(super) fn add(&mut self, basis: Basis, ends: Ends, mut points: Vec<DVec3>, mut radii: Option<Vec<f64>>) {
        let index = self.seen;
        self.seen += 1;

        let written = points.len();
        if ends != Ends::Open {
            while points.len() > 1 && points.last() == points.first() {
                points.pop();
            }
        }
        // Whoever repeats the first point has drawn the last segment, however long it is.
        let closing_repeat = points.len() < written;

        if !has_distinct(&points, 2) {
            self.skipped.add(index);
            return;
        }
        let mut closed = ends != Ends::Open;
        if closed && !has_distinct(&points, 3) {
            closed = false;
            self.flat_loops.add(index);
        } else if ends == Ends::MarkedClosed && !closing_repeat && has_wide_gap(&points) {
            closed = false;
            self.wide_gaps.add(index);
        }
        if closing_repeat {
            self.closing_repeats += 1;
        }

        let trimmed = points.len();
        if let Some(radii) = &mut radii {
            radii.truncate(trimmed);
        }
        let end_repeats = if basis == Basis::BSpline && !closed { END_REPEATS } else { 1 };
        drop_duplicates(&mut points, radii.as_mut(), end_repeats);
        if points.len() < trimmed {
            self.duplicates += (trimmed - points.len()) as u64;
            self.duplicate_curves.add(index);
        }
        self.set.curves.push(Curve { basis, closed, points, radii, flattening: None });
    }

    /// Adds a line for the user that is not about a single curve.
    pub(super) fn note(&mut self, note: String) {
        self.set.notes.push(note);
    }

    /// The curves kept, and a note for each kind of repair.
    pub(super) fn finish(mut self) -> CurveSet {
        let curves = |tally: &Tally| format!("{} (first: curve {})", counted(tally.count, "curve"), tally.first);
        let notes = &mut self.set.notes;
        if self.closing_repeats > 0 {
            notes.push(format!(
                "{} of {} repeated the first point at the end; the repeat was dropped",
                self.closing_repeats,
                counted(self.seen, "curve")
            ));
        }
        if self.wide_gaps.count > 0 {
            notes.push(format!(
                "{} marked closed, but the ends are more than {WIDE_GAP} median segments apart; treated as open",
                curves(&self.wide_gaps)
            ));
        }
        if self.flat_loops.count > 0 {
            notes.push(format!(
                "{} marked closed with only two distinct points; treated as open",
                curves(&self.flat_loops)
            ));
        }
        if self.skipped.count > 0 {
            notes.push(format!("{} without two distinct points; skipped", curves(&self.skipped)));
        }
        if self.duplicates > 0 {
            notes.push(format!(
                "{} equal to the point before, in {}; dropped",
                counted(self.duplicates, "point"),
                curves(&self.duplicate_curves)
            ));
        }
        self.set
    }
}

/// Whether at least `wanted` (2 or 3) points differ from each other.
fn has_distinct(points: &[DVec3], wanted: usize) -> bool {
    let Some(&first) = points.first() else { return false };
    let Some(&second) = points.iter().find(|&&point| point != first) else { return false };
    wanted < 3 || points.iter().any(|&point| point != first && point != second)
}

fn has_wide_gap(points: &[DVec3]) -> bool {
    let mut lengths: Vec<f64> =
        points.windows(2).map(|pair| pair[0].distance(pair[1])).filter(|&length| length > 0.0).collect();
    if lengths.is_empty() {
        return false;
    }
    let middle = lengths.len() / 2;
    let (_, &mut median, _) = lengths.select_nth_unstable_by(middle, f64::total_cmp);
    points[0].distance(points[points.len() - 1]) > WIDE_GAP * median
}

/// Drops points equal to the one before, but keeps runs of up to `end_repeats` at both ends.
fn drop_duplicates(points: &mut Vec<DVec3>, radii: Option<&mut Vec<f64>>, end_repeats: usize) {
    if points.windows(2).all(|pair| pair[0] != pair[1]) {
        return;
    }
    let run = |same: &mut dyn Iterator<Item = bool>| 1 + same.take_while(|&same| same).count();
    let head = run(&mut points.windows(2).map(|pair| pair[0] == pair[1]));
    let tail = run(&mut points.windows(2).rev().map(|pair| pair[0] == pair[1]));
    let tail_start = points.len() - tail;
    let keep: Vec<bool> = (0..points.len())
        .map(|index| {
            index == 0
                || points[index] != points[index - 1]
                || (index < head && index < end_repeats)
                || (index >= tail_start && index - tail_start < end_repeats)
        })
        .collect();
    retain_marked(points, &keep);
    if let Some(radii) = radii {
        retain_marked(radii, &keep);
    }
}

fn retain_marked<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut marks = keep.iter();
    values.retain(|_| marks.next().copied().unwrap_or(false));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(xs: &[f64]) -> Vec<DVec3> {
        xs.iter().map(|&x| DVec3::new(x, x * x, 0.0)).collect()
    }

    fn repaired(basis: Basis, ends: Ends, xs: &[f64]) -> CurveSet {
        let mut repair = Repair::default();
        repair.add(basis, ends, line(xs), Some((0..xs.len()).map(|index| index as f64).collect()));
        repair.finish()
    }

    #[test]
    fn a_sound_curve_is_left_alone() {
        let set = repaired(Basis::CatmullRom, Ends::MarkedClosed, &[0.0, 1.0, 2.0, 1.5]);
        assert_eq!(set.curves[0].points, line(&[0.0, 1.0, 2.0, 1.5]));
        assert!(set.curves[0].closed);
        assert!(set.notes.is_empty());
    }

    #[test]
    fn a_repeated_first_point_is_dropped_however_often_it_stands_there() {
        let set = repaired(Basis::Linear, Ends::MarkedClosed, &[0.0, 1.0, 2.0, 0.0, 0.0]);
        assert_eq!(set.curves[0].points, line(&[0.0, 1.0, 2.0]));
        assert_eq!(set.curves[0].radii.as_deref(), Some(&[0.0, 1.0, 2.0][..]));
        assert!(set.curves[0].closed);
        assert_eq!(set.notes, ["1 of 1 curve repeated the first point at the end; the repeat was dropped"]);
    }

    #[test]
    fn an_open_curve_may_end_where_it_began() {
        let set = repaired(Basis::Linear, Ends::Open, &[0.0, 1.0, 2.0, 0.0]);
        assert_eq!(set.curves[0].points.len(), 4);
        assert!(!set.curves[0].closed);
    }

    #[test]
    fn a_wide_gap_opens_a_curve_only_where_the_mark_is_doubtful() {
        let spiral: Vec<f64> = (0..30).map(|index| f64::from(index) * 0.01).collect();
        let set = repaired(Basis::CatmullRom, Ends::MarkedClosed, &spiral);
        assert!(!set.curves[0].closed);
        assert_eq!(
            set.notes,
            ["1 curve (first: curve 0) marked closed, but the ends are more than 10 median segments apart; \
                 treated as open"]
        );
        assert!(repaired(Basis::CatmullRom, Ends::Closed, &spiral).curves[0].closed);
        // The long way back is drawn here.
        let drawn: Vec<f64> = spiral.iter().copied().chain([0.0]).collect();
        assert!(repaired(Basis::CatmullRom, Ends::MarkedClosed, &drawn).curves[0].closed);
    }

    #[test]
    fn loops_of_two_points_open_and_single_points_go() {
        let set = repaired(Basis::Linear, Ends::Closed, &[0.0, 1.0, 0.0, 1.0, 0.0]);
        assert_eq!(set.curves[0].points, line(&[0.0, 1.0, 0.0, 1.0]));
        assert!(!set.curves[0].closed);
        assert_eq!(
            set.notes[1],
            "1 curve (first: curve 0) marked closed with only two distinct points; treated as open"
        );
        for ends in [Ends::Open, Ends::Closed] {
            for xs in [&[][..], &[1.0], &[1.0, 1.0, 1.0]] {
                let set = repaired(Basis::BSpline, ends, xs);
                assert!(set.curves.is_empty());
                assert_eq!(set.notes, ["1 curve (first: curve 0) without two distinct points; skipped"]);
            }
        }
    }

    #[test]
    fn duplicates_go_but_the_ends_of_a_b_spline_stay() {
        let xs = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 3.0, 3.0];
        let set = repaired(Basis::CatmullRom, Ends::Open, &xs);
        assert_eq!(set.curves[0].points, line(&[0.0, 1.0, 2.0, 3.0]));
        assert_eq!(set.curves[0].radii.as_deref(), Some(&[0.0, 4.0, 6.0, 7.0][..]));
        assert_eq!(set.notes, ["5 points equal to the point before, in 1 curve (first: curve 0); dropped"]);
        let set = repaired(Basis::BSpline, Ends::Open, &xs);
        assert_eq!(set.curves[0].points, line(&[0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0]));
        let set = repaired(Basis::BSpline, Ends::Closed, &xs);
        assert_eq!(set.curves[0].points, line(&[0.0, 1.0, 2.0, 3.0]));
    }
}
