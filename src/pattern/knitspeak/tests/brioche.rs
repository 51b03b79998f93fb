//! Brioche: rows of charts that the named pattern has, its words, and two rows of a number.

use super::*;
use crate::pattern::chart::{Chart, Stitch};

/// What is knitted of rows, over so many stitches.
fn knitted(rows: &[impl AsRef<str>], stitches: u32) -> Vec<Vec<Stitch>> {
    let chart = Chart::parse(rows).unwrap();
    chart.work(stitches, chart.rows(), 1 << 16).unwrap()
}

#[test]
fn instructions_make_the_rows_of_the_pattern() {
    let named = Chart::named("brioche").unwrap();
    for text in [
        "Row 1: *sl1yo, brk1; rep from *\nRow 2: *sl1yo, brk1; rep from *",
        "Row 1 (RS): *yf, sl 1, yo, brk; rep from * to end.\nRow 2 (WS): *yf sl1 yo, bk1; rep from * to end.",
        "Row 1: *yf sl1yo, k1; rep from *\nRow 2: *sl1 wyif, yo, brk1; rep from *",
        "Row 1: [sl 1 purlwise wyif, yo, brk1] to end\nRow 2: [wyif, sl1, yo, brk1] 4 times",
        "Row 1A (RS): *sl1yo, brk1; rep from *, slide\nRow 1B: *brp1, sl1yo; rep from *, turn\nRow 2A (WS): *brp1, sl1yo; rep from *, \
         slide\nRow 2B: *sl1yo, brk1; rep from *, turn",
    ] {
        let rows = rows(text, 8);
        let high = rows.len() as u32;
        assert_eq!(knitted(&rows, 8), named.work(8, high, 1000).unwrap(), "{text}");
    }
}

#[test]
fn stitches_are_worked_with_their_yarn_overs_where_they_have_some() {
    let set_up = "Row 1: *k1, sl1yo; rep from *\n";
    assert_eq!(rows(&format!("{set_up}Row 2: *brk1, sl1yo; rep from *"), 4), ["tuck k tuck k", "p tuck p tuck"]);
    let told = chart_rows(&format!("{set_up}Row 2: *sl1yo, brk1; rep from *"), 4).unwrap_err();
    assert_eq!(told.problem, "row 2 works brk where stitch 2 has no yarn over");
    assert!(told.hint.contains("sl1yo"), "{told}");
    let told = chart_rows("Row 1: *k1, sl1yo; rep from *\nRow 2: p\nRow 3: brp to end", 4).unwrap_err();
    assert!(told.problem.contains("row 3 works brp where stitch 1"), "{told}");
    // A yarn over is still there where its stitch was slipped again.
    assert_eq!(rows(&format!("{set_up}Row 2: sl1, k1, sl1, k1\nRow 3: k1, brk1, k1, brk1"), 4)[2], "k4");
}

#[test]
fn shaping_of_brioche_is_that_of_charts() {
    let set_up = "Row 1 (RS): *sl1yo, k1; rep from *\n";
    for (text, stitches, row) in [
        ("*sl1yo, brk1; rep from * to last 4 sts, brk2tog, brssk", 6, "tuck p p2tog ssp"),
        ("brLsl dec, sl1yo, brRsl dec, brk1", 8, "sssp tuck p3tog p"),
        ("brp2tog, brssp, sl1yo, brp1", 6, "k2tog ssk tuck k"),
    ] {
        assert_eq!(rows(&format!("{set_up}Row 2: {text}"), stitches)[1], row, "{text}");
    }
    for step in ["br4st dec", "brkyobrk"] {
        let told = chart_rows(&format!("{set_up}Row 2: {step}, k1"), 6).unwrap_err();
        let word = step.split(' ').next().unwrap();
        assert!(told.problem.contains(&format!("row 2: \"{word}\"")) && told.hint.contains("brRsl dec"), "{told}");
    }
}

#[test]
fn two_rows_of_a_number_are_of_one_side() {
    let rows = |text: &str| Instructions::read(text).and_then(|read| read.work(4, 1)).map(|worked| worked.rows);
    let pairs = [
        ("Row 1A", "*brk1, sl1yo; rep from *, slide."),
        ("Row 1B", "*sl1yo, brp1; rep from *. Turn."),
        ("Row 2A", "*sl1yo, brp1; rep from *. Do not turn, slide sts to other end of needle."),
        ("Row 2B", "*brk1, sl1yo; rep from *. Turn."),
    ];
    let written = |heads: [&str; 4]| -> String {
        heads.iter().zip(&pairs).map(|(head, (_, body))| format!("{head}: {body}\n")).collect()
    };
    let two = written(pairs.map(|(head, _)| head));
    let once = ["tuck k tuck k", "p tuck p tuck", "tuck k tuck k", "p tuck p tuck"];
    assert_eq!(rows(&two).unwrap(), once);
    assert_eq!(rows(&written(["Row 1 MC (RS)", "Row 1 CC (RS)", "Row 2 (MC, WS)", "Row 2 (WS, CC)"])).unwrap(), once);
    for (more, count) in [("Rep rows 1-2 twice more.", 12), ("Rep last 2 rows once more", 8)] {
        assert_eq!(rows(&format!("{two}{more}")).unwrap().len(), count, "{more}");
    }
    let set_up = rows(&format!("Set-up row (WS): *k1, sl1yo; rep from *\n{two}")).unwrap();
    assert_eq!(set_up[..3], ["p tuck p tuck", "tuck k tuck k", "p tuck p tuck"]);
    for (text, problem) in [
        ("Row 1 (MC): k\nRow 2 (CC): p".to_owned(), "row 1 is told to be of a yarn, and is the only row 1"),
        (format!("{two}Rep rows 1-2 for 20 rows"), "rows are counted, where each number has two of them"),
        (format!("{two}Row 1B: k"), "row 1 is written twice"),
        (format!("{two}All WS rows: p"), "rows of a side, where each number has two rows"),
        ("Row 1A (RS): k\nRow 1B (WS): p".to_owned(), "row 1 is said to be on the wrong side"),
    ] {
        let told = rows(&text).unwrap_err();
        assert!(told.problem.contains(problem), "{text}: {told}");
    }
}
