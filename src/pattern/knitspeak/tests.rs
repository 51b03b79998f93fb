use super::*;

fn rows(text: &str, stitches: u32) -> Vec<String> {
    chart_rows(text, stitches).unwrap()
}

#[test]
fn flat_rows_turn_at_the_edge() {
    // Two rows of rib: what is knitted on one side is purled on the other, over the same stitches.
    let rib = "Row 1 (RS): k2, *p2, k2; rep from * to end.\nRow 2 (WS): p2, *k2, p2; rep from * to end.";
    assert_eq!(rows(rib, 10), ["k2 p2 k2 p2 k2"; 2]);
    // A row of one side only shows where the row begins.
    assert_eq!(rows("Row 1: k3, p1\nRow 2: k1, p3", 4), ["p k3", "p k3"]);
}

#[test]
fn rounds_are_all_on_the_right_side() {
    assert_eq!(rows("Rnd 1: *k1, p1; rep from * to end\nRnd 2: knit", 4), ["p k p k", "k4"]);
    assert_eq!(rows("Rnd 1: *k1, p1; repeat from * around.", 4), ["p k p k"]);
    assert_eq!(rows("Row 1: *k1, p1* repeat to end", 4), ["p k p k"]);
    let decreases = "Row 1: sl 1, k2tog, psso, sl 1, k1, psso, k to end\nRow 2: purl\nRow 3: sl 2, k to end";
    assert_eq!(rows(decreases, 7), ["k2 ssk sssk", "k4", "k2 sl sl"]);
}

#[test]
fn lace_keeps_its_count() {
    let lace = "Cast on 14 sts.\nRow 1 (RS): k2, *yo, ssk, k1, k2tog, yo; rep from * to last 2 sts, k2.\n\
                Row 2 and all WS rows: Purl.\nRow 3: k2, [yo, k1, sk2p, k1, yo] twice, k2.";
    assert_eq!(
        rows(lace, 14),
        ["k2 yo k2tog k ssk yo yo k2tog k ssk yo k2", "k14", "k2 yo k sssk k yo yo k sssk k yo k2", "k14"]
    );
}

#[test]
fn charts_know_every_stitch_that_is_understood() {
    let all = "Row 1: k1, p1, k1 tbl, p1 tbl, yo, k2tog, ssk, p2tog, ssp, k3tog, sssk, p3tog, cdd, kfb, m1l, m1r, sl1, \
               sl1 wyif, tuck, miss, mb, c4f, c4b, t3f, t3b, 2/1 LC, 2/1 RPC\nRow 2: k to last 2 sts, p2, yo";
    let rows = rows(all, 50);
    let chart = crate::pattern::chart::Chart::parse(&rows).unwrap();
    assert_eq!(chart.work(50, 2, 1 << 20).unwrap().len(), 2);
}

#[test]
fn repeats_and_ranges() {
    assert_eq!(rows("Rows 1-2: k\nRows 3 and 4: Repeat rows 1-2", 1), ["k", "p", "k", "p"]);
    assert_eq!(rows("Row 1: *k1, p1; rep from * 2 more times, k to end", 8), ["k2 p k p k p k"]);
    assert_eq!(rows("Row 1: (k1, [p1, k1] 2 times) 2x", 10), ["k p k p k2 p k p k"]);
    assert_eq!(rows("Row 1: sl1 wyif, k to last 2 sts, k1 tbl, sl1 wyib", 6), ["sl ktbl k3 slwyif"]);
    assert_eq!(rows("Row 1: 2/1 LC, c4f, k1", 8), ["k c4f 2/1lc"]);
    assert_eq!(rows("Row 1 (RS, 4 sts): k4\nRow 2 (4 sts): p4", 4), ["k4", "k4"]);
}

#[test]
fn mistakes_are_named() {
    let wrong = |text: &str, stitches| chart_rows(text, stitches).unwrap_err();
    assert!(wrong("Row 1: k2, zork", 4).problem.contains("zork"));
    assert!(wrong("Row 1: k2", 4).problem.contains("leaves 2 of 4"));
    assert!(wrong("Row 1: *k3; rep from * to end", 8).to_string().contains("2 fewer"));
    assert!(wrong("Row 1: k6", 4).problem.contains("needs 6"));
    assert!(wrong("Row 1: k\nRow 3: k", 1).problem.contains("row 2 is missing"));
    assert!(wrong("Row 1: k\nRow 1: k", 1).problem.contains("twice"));
    assert!(wrong("Row 1: [k1, p1", 2).problem.contains("not closed"));
    assert!(wrong("Row 1: k1] ", 1).problem.contains("closes nothing"));
    assert!(wrong("k2, p2", 4).line == Some(0));
    assert!(wrong("", 4).problem.contains("no row"));
    let endless = "Row 1: [[[yo] 20000 times] 20000 times] 20000 times, k to end";
    assert!(wrong(endless, 4).problem.contains("repeats more than"));
    assert!(wrong("Row 1: 4294967295/1 LC", 4).problem.contains("is no cable"));
    // As wide as a chart's, and no wider.
    assert_eq!(rows("Row 1: 20/4 LC", 24), ["20/4lc"]);
    assert!(wrong("Row 1: 20/5 LC", 25).problem.contains("is no cable"));
    assert_eq!(rows("Row 1: c24f", 24), ["c24f"]);
    assert!(wrong("Row 1: c26f", 26).problem.contains("c26f"));
    let deep = format!("Row 1: {}k1", "[".repeat(100));
    assert!(wrong(&deep, 1).problem.contains("deep"));
}

#[test]
fn short_rows_turn_and_the_next_row_begins_there() {
    let wedge = "Row 1 (RS): k5, w&t\nRow 2 (WS): p to end\nRow 3: k3, turn, leaving rem sts unworked\nRow 4: DS, p2\n\
                 Row 5: knit\nRow 6: p6, wrap and turn\nRow 7: k4, turn\nRow 8: p to end";
    assert_eq!(rows(wedge, 8), ["-3 k5", "-3 k5", "-5 k3", "-5 ds k2", "k8", "k6 -2", "-2 k4 -2", "-2 k6"]);
    let wrong = |text: &str| chart_rows(text, 8).unwrap_err();
    assert!(wrong("Row 1: k5, turn, p5").problem.contains("\"p5\" comes after the turn"));
    assert!(wrong("Row 1: *k2, turn; rep from * to end").problem.contains("comes after the turn"));
    assert!(wrong("Row 1: k5, turn\nRow 2: p6").problem.contains("needs 6"));
    assert!(wrong("Row 1: k5\nRow 2: p8").hint.contains("`turn`"));
}
