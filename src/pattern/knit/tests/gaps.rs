//! Stitches that are bound off and cast on within a piece.

use rayon::prelude::*;

use super::{
    super::piece::follow::threaded,
    topology::{Stitches, yarn_of_stitches},
    *,
};
use crate::pattern::{
    chart::{Act, binds_from_right},
    rods::passing::passed,
};

fn piece(rows: &[&str], form: Form) -> Knit {
    let chart = Chart::parse(rows).unwrap();
    let (stitches, rows) = (12, chart.rows());
    Knit { chart, form, stitches, rows, ..knit("stockinette", 1, 1) }
}

/// How a loop's yarn passes a ring on its way up and on its way down.
fn passes(stitches: &Stitches, ring: &[DVec3], own: (i32, i32)) -> Option<[i32; 2]> {
    let of = |by: i32| stitches.get(&(own.0, own.1 + by)).map(Vec::as_slice);
    let (before, own, after) = (of(-1)?, of(0)?, of(1)?);
    let half = own.len() / 2;
    let up = [&before[before.len() / 2..], &own[..=half]].concat();
    let down = [&own[half..], &after[..=after.len() / 2]].concat();
    Some([threaded(ring, &up), threaded(ring, &down)])
}

/// The same of what is laid around its legs: the upper part of a loop that is bound off.
fn passes_bound(stitches: &Stitches, ring: (i32, i32), own: (i32, i32)) -> [i32; 2] {
    let (ring, own) = (&stitches[&ring], &stitches[&own]);
    let (n, half) = (ring.len(), own.len() / 2);
    let ring = &ring[n / 5..n - n / 5];
    [threaded(ring, &own[..=half]), threaded(ring, &own[half..])]
}

/// Stitches away from the sides that are not drawn through the one below, and those that are bound off whose next one is not
/// drawn through them; and how many of both there are.
fn undrawn(piece: &Knit) -> (Vec<String>, usize) {
    let (rows, stitches) = (piece.worked().unwrap(), yarn_of_stitches(piece, true));
    let (mut wrong, mut count) = (Vec::new(), 0);
    let first = binds_from_right(&rows);
    for (r, row) in rows.iter().enumerate().skip(1) {
        let backwards = !piece.form.is_round() && (r % 2 == 1) != first;
        for (k, s) in row.iter().enumerate().skip(2).take(row.len() - 4) {
            let own = (r as i32, k as i32);
            let (below, parent) = (r as i32 - 1, s.first_parent as i32);
            let sign = if s.purl { -1 } else { 1 };
            // What is cast on is twisted.
            let is_cast = |below: &Stitch| below.act == Act::CastOn;
            let turned = if rows[r - 1].get(s.first_parent as usize).is_some_and(is_cast) { -1 } else { 1 };
            if matches!(s.act, Act::Draw | Act::BindOff)
                && let (Some(ring), Some(next)) = (stitches.get(&(below, parent)), stitches.get(&(below, parent + 1)))
                && let Some(found) = passes(&stitches, &[ring, &next[..1]].concat(), own)
            {
                count += 1;
                if found != [sign * turned, -sign * turned] {
                    wrong.push(format!("row {} stitch {}: {found:?}", r + 1, k + 1));
                }
            }
            if s.act == Act::BindOff {
                count += 1;
                let found = passes_bound(&stitches, own, (own.0, own.1 + if backwards { -1 } else { 1 }));
                if found != [-sign, sign] {
                    wrong.push(format!("row {} stitch {} over the next: {found:?}", r + 1, k + 1));
                }
            }
        }
    }
    (wrong, count)
}

#[test]
fn what_is_bound_off_and_cast_on_holds_from_both_sides() {
    let buttonhole = ["4: k", "k4 bo4 k4", "k4 co4 k4", "3: k"];
    let cases: [(&[&str], Form); 9] = [
        (&buttonhole, Form::Flat),
        (&buttonhole, Form::Tube),
        // From right to left, and purled.
        (&["3: k", "k4 bo4 k4", "k4 co4 k4", "3: k"], Form::Flat),
        (&["3: p", "p4 bop4 p4", "p4 co4 p4", "3: p"], Form::Flat),
        (&["4: k", "k4 bo k7", "k4 co k7", "3: k"], Form::Flat),
        // Of another number.
        (&["4: k", "k4 bo4 k4", "k4 co3 k4", "3: k"], Form::Flat),
        // Sides of an armhole, where either row begins, and a sleeve that is cast on.
        (&["4: k", "bo3 k9", "k6 bo3", "3: k"], Form::Flat),
        (&["4: k", "k9 bo3", "bo3 k6", "3: k"], Form::Flat),
        (&["4: k", "k12 co4", "co4 k16", "4: k"], Form::Flat),
    ];
    cases.par_iter().for_each(|(rows, form)| {
        let piece = piece(rows, form.clone());
        let mut found = (Vec::new(), 0);
        let passes = passed(|| found = undrawn(&piece));
        assert!(passes == 0 && found.0.is_empty() && found.1 > 30, "{rows:?} {form:?}: {passes} passes, {found:?}");
        let made = piece.knitted(1.0).unwrap();
        let overlap = measured(&made.strands);
        assert!(made.strands.len() == 1 && overlap.share < 0.05, "{rows:?} {form:?}: {overlap:?}");
    });
}

#[test]
fn no_loop_of_a_buttonhole_stays_live() {
    for row in ["k4 bo4 k4", "p4 bop4 p4"] {
        for first in ["4: k", "3: k"] {
            let rows = Chart::parse(&[first, row, "k4 co4 k4", "2: k"]).unwrap().work(12, 6, 1000).unwrap();
            let border = Border {
                round: None,
                stacked: false,
                turns: false,
                finished: true,
                rims: Rims::default(),
                mirrored: false,
                slants: false,
            };
            let loops = Loops::new(&rows, 12, border).loops;
            // The last loop of all is drawn out.
            assert_eq!(loops.iter().filter(|l| l.held.is_none()).count(), 1, "{first} {row}");
        }
    }
}

#[test]
fn what_cannot_be_bound_off_is_told() {
    let cases: [(&[&str], Form, &str, &str); 10] = [
        (&["k", "k4 bo4 k4"], Form::Flat, "row 2, the last one, binds off 4 stitches within it", "co4"),
        (&["k", "k4 bo4 k4", "k"], Form::Flat, "row 3 goes on over the gap of 4 stitches of row 2", "co4"),
        (&["k", "k4 bo4 k4", "k8 co4"], Form::Flat, "row 3 goes on over the gap", "co4"),
        (&["k", "k4 bo4 k4", "k3 k2tog k3"], Form::Flat, "row 3 works stitches together from both sides", "co"),
        (&["k", "k4 bo4 k4", "k3 1/1lc k3"], Form::Flat, "row 3 works stitches together from both sides", "co"),
        (
            &["k", "bo3 k9", "bo3 k6"],
            Form::Flat,
            "row 3 goes from right to left and binds off its last stitch",
            "same side",
        ),
        (&["2: k", "k4 bo4 yo k4", "k"], Form::Flat, "row 3 goes from left to right and binds off before", "k or p"),
        (
            &["k", "k4 sl bo3 k4", "k5 co3 k4"],
            Form::Flat,
            "row 2 goes from right to left and binds off before",
            "k or p",
        ),
        (&["k", "bo4 k8", "co4 k8"], Form::Tube, "round 2 binds off its first stitch", "elsewhere"),
        (&["k", "k8 bo4", "k8 co4"], Form::Tube, "row 2 binds off its last stitch", "elsewhere"),
    ];
    for (rows, form, problem, hint) in cases {
        match piece(rows, form).worked() {
            Err(wrong) => assert!(wrong.problem.contains(problem) && wrong.hint.contains(hint), "{rows:?}: {wrong}"),
            Ok(_) => panic!("{rows:?} is knitted"),
        }
    }
    let colors = Colors { rows: vec![vec![0, 1]; 3], work: Work::Stranded, catch: None, carry: 0 };
    let dyed = Knit { colors: Some(colors), ..piece(&["k", "k4 bo4 k4", "k4 co4 k4"], Form::Flat) };
    assert!(dyed.worked().unwrap_err().problem.contains("several colours"));
    let short = piece(&["k", "k4 bo4 k4", "k4 co4 k4", "k10 -2", "k10 -2", "k"], Form::Flat);
    assert!(short.worked().unwrap_err().problem.contains("beside short rows"));
}
