use super::*;

fn worked(rows: &[&str], cast_on: u32, count: u32) -> Vec<Vec<Stitch>> {
    Chart::parse(rows).unwrap().work(cast_on, count, 1000).unwrap()
}

#[test]
fn named_patterns_are_sound_and_even() {
    for (name, _) in PATTERNS {
        let chart = Chart::named(name).unwrap();
        let width = chart.even_width(100).unwrap();
        let rows = chart.work(3 * width, 2 * chart.rows(), 10_000).unwrap();
        assert!(rows.iter().all(|r| r.len() == 3 * width as usize), "{name}");
    }
    assert!(Chart::named("stockinet").is_none());
}

#[test]
fn decreases_take_two_and_increases_make_two() {
    let rows = worked(&["k", "k3 k2tog", "k ssk kfb"], 15, 3);
    assert_eq!(rows.iter().map(Vec::len).collect::<Vec<_>>(), [15, 12, 12]);
}

#[test]
fn a_hat_ends_with_few_stitches() {
    let rows = worked(&["3: k", "k3 k2tog", "k", "k2 k2tog", "k1 k2tog", "k2tog"], 20, 8);
    assert_eq!(rows.iter().map(Vec::len).collect::<Vec<_>>(), [20, 20, 20, 16, 16, 12, 8, 4]);
    assert_eq!((rows[3][3].first_parent, rows[3][3].parents), (3, 2));
    assert_eq!((rows[3][4].first_parent, rows[3][4].parents), (5, 1));
    // Every loop is held by exactly one stitch.
    for pair in rows.windows(2) {
        let mut held = vec![0; pair[0].len()];
        for s in &pair[1] {
            for p in s.first_parent..s.first_parent + u32::from(s.parents) {
                held[p as usize] += 1;
            }
        }
        assert!(held.iter().all(|&h| h == 1));
    }
}

#[test]
fn charts_that_grow_or_shrink_are_told_from_those_that_repeat() {
    let is_shaped = |rows: &[&str]| Chart::parse(rows).unwrap().is_shaped();
    assert!(PATTERNS.iter().all(|(_, rows)| !is_shaped(rows)));
    assert!(!is_shaped(&["k2 yo k2tog", "k k yo", "k k2tog"]) && !is_shaped(&["k4 bo4 k4", "k4 co4 k4"]));
    assert!(!is_shaped(&["k20", "k15 -5"]));
    for rows in [["12: k2 p2", "k6 k2tog"], ["6: k", "bo4 k8"], ["k", "kfb k"], ["k", "bo12"], ["co4 k8", "k"]] {
        assert!(is_shaped(&rows), "{rows:?}");
    }
}

#[test]
fn rows_that_would_fit_are_told_of_a_chart_that_is_knitted_out() {
    let chart = Chart::parse(&["6: k", "bo4 k8", "6: k"]).unwrap();
    assert_eq!(chart.work(12, 13, 1000).unwrap().len(), 13);
    let told = chart.work(12, 20, 1000).unwrap_err();
    assert!(told.hint.ends_with("or knit 13 rows, the whole chart; up to 19 fit"), "{told}");
    let told = Chart::parse(&["k6 k2tog", "k"]).unwrap().work(16, 20, 1000).unwrap_err();
    assert!(told.hint.ends_with("or knit 2 rows, the whole chart"), "{told}");
}

#[test]
fn what_is_bound_off_keeps_its_place_and_is_not_found_above() {
    let rows = worked(&["k", "k2 bo2 k2", "k2 co3 k2", "k", "bo3 k4"], 6, 6);
    assert_eq!(rows.iter().map(Vec::len).collect::<Vec<_>>(), [6, 6, 7, 7, 7, 4]);
    let parents = |r: usize| rows[r].iter().filter(|s| s.parents > 0).map(|s| s.first_parent).collect::<Vec<_>>();
    assert_eq!((parents(2), parents(5)), (vec![0, 1, 4, 5], vec![3, 4, 5, 6]));
    // A row of shaping has no repeat, even where it keeps the number of stitches.
    assert_eq!(Chart::parse(&["bo k co"]).unwrap().even_width(100), None);
}

#[test]
fn cables_cross_halves() {
    let row = &worked(&["k4", "c4f"], 4, 2)[1];
    assert_eq!(row.iter().map(|s| (s.first_parent, s.layer)).collect::<Vec<_>>(), [(2, 1), (3, 1), (0, -1), (1, -1)]);
    assert_eq!(worked(&["k4", "c4b"], 4, 2)[1][0].layer, -1);
}

#[test]
fn steps_may_be_written_in_capital_letters() {
    let (books, small) = (["2: K2, P2 C4F 2/1LC SSK"], ["2: k2, p2 c4f 2/1lc ssk"]);
    let [books, small] = [books, small].map(|lines| Chart::parse(&lines).unwrap());
    assert!(books.rows.iter().zip(&small.rows).all(|(a, b)| a.steps == b.steps));
    assert!(Chart::parse(&["K2 Q2"]).unwrap_err().problem.contains("\"Q2\""));
}

/// Else a line of 13 characters asks for 20,000 rows of 20,000 steps.
#[test]
fn rows_of_one_line_share_their_steps() {
    let chart = Chart::parse(&["20000: k20000"]).unwrap();
    assert_eq!((chart.rows.len(), chart.rows[0].steps.len()), (20_000, 20_000));
    assert!(chart.rows.iter().all(|row| Arc::ptr_eq(&row.steps, &chart.rows[0].steps)));
}

#[test]
fn plain_rows_may_be_cut_and_others_not() {
    assert_eq!(worked(&["k2 p2"], 7, 1)[0].iter().filter(|s| s.purl).count(), 3);
    // Cut, and not left out.
    let error = Chart::parse(&["k20 p4"]).unwrap().work(16, 2, 1000).unwrap_err();
    assert_eq!(error.problem, "row 1 has 24 stitches, but finds 16");
    assert!(error.hint.ends_with("cast on 24"), "{}", error.hint);
    let error = Chart::parse(&["k", "k3 k2tog"]).unwrap().work(9, 2, 1000).unwrap_err();
    assert_eq!((error.line, error.problem.as_str()), (Some(1), "row 2 repeats over 5 stitches, but finds 9"));
    assert!(error.hint.ends_with("takes: cast on 5 or 10"), "{}", error.hint);
    // Four stitches of each five of the second row, by sevens in the third.
    let error = Chart::parse(&["k", "k3 k2tog", "k5 k2tog"]).unwrap().work(10, 3, 1000).unwrap_err();
    assert!(error.hint.ends_with("takes: cast on 35"), "{}", error.hint);
}

#[test]
fn mistakes_are_explained() {
    for (rows, problem) in [
        (&["k2 q"][..], "unknown step \"q\""),
        (&["c1f"], "no cable \"c1f\""),
        (&["c26f"], "no cable \"c26f\""),
        (&["2/0lc"], "no cable \"2/0lc\""),
        (&["k0"], "no step \"k0\""),
        (&["c99999999999f"], "no cable \"c99999999999f\""),
        (&["c/2lc"], "unknown step \"c/2lc\""),
        (&["k99999999999999999999"], "no step \"k9999999999999999999\""),
        (&["yo"], "a row that takes no stitch of the row below"),
        (&[""], "a row that takes no stitch of the row below"),
        (&["x: k"], "expected a number of rows before the colon, found \"x\""),
        (&["20000: k", "k"], "more than 20000 rows"),
        (&["k20000 p"], "more than 20000 steps in a row"),
        (&[], "a chart without rows"),
    ] {
        assert_eq!(Chart::parse(rows).unwrap_err().problem, problem);
    }
    let named = Chart::parse(&["Stockinette"]).unwrap_err();
    assert_eq!(named.problem, "unknown step \"Stockinette\"");
    assert!(named.hint.contains("pattern = \"stockinette\""), "{}", named.hint);
    let grows = Chart::parse(&["kfb"]).unwrap().work(4, 60, 5000).unwrap_err();
    assert_eq!(grows.problem, "more than 5000 stitches by row 10");
}
