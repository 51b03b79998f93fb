//! Rows that turn: what they leave, what closes the turn, and rows that go as far as others have turned.

use super::*;

const PLAIN: &str = "Row 1 (RS): k\nRow 2: p\n";

fn behind(text: &str, stitches: u32) -> Vec<String> {
    rows(&format!("{PLAIN}{text}"), stitches).split_off(2)
}

fn wrong(text: &str) -> String {
    chart_rows(&format!("{PLAIN}{text}"), 8).unwrap_err().to_string()
}

#[test]
fn short_rows_turn_and_the_next_row_begins_there() {
    let wedge = "Row 1 (RS): k5, turn\nRow 2 (WS): p to end\nRow 3: k3, turn, leaving rem sts unworked\nRow 4: DS, p2\n\
                 Row 5: knit\nRow 6: p6, turn\nRow 7: k4, turn (2 sts unworked)\nRow 8: p to end";
    assert_eq!(rows(wedge, 8), ["-3 k5", "-3 k5", "-5 k3", "-5 ds k2", "k8", "k6 -2", "-2 k4 -2", "-2 k6"]);
    for (text, problem) in [
        ("Row 3: k5, turn, leaving 4 sts unworked", "row 3 turns beside 3 stitches, and says that it leaves 4"),
        ("Row 3: *k2, turn; rep from * to end", "row 3: turns within a repeat"),
        ("Row 3: k5, turn\nRow 4: p6", "row 4 needs 6 stitches"),
        ("Row 3: k5\nRow 4: p8", "`turn` for a short row"),
        ("Row 3: k to end, w&t", "row 3 has no stitch left to wrap"),
    ] {
        assert!(wrong(text).contains(problem), "{text}: {}", wrong(text));
    }
    assert!(chart_rows("Rnd 1: k5, turn\nRnd 2: k", 8).unwrap_err().problem.contains("row 1 turns, and goes round"));
}

#[test]
fn a_wrap_goes_behind_a_stitch_and_back_in_front_of_it() {
    for turn in [
        "w&t",
        "W&T",
        "w+t",
        "w & t",
        "wrap and turn",
        "wrap & turn",
        "wrap next st and turn",
        "wrap next st, turn",
        "wrap & turn (w&t)",
    ] {
        assert_eq!(
            behind(&format!("Row 3: K5, {turn}.\nRow 4: p to end\nRow 5: k"), 8),
            ["-2 sl k5", "-2 slwyif k5", "k8"],
            "{turn}"
        );
    }
    // As it is seen from the right side; where the yarn comes from a purl stitch it is in front first.
    let other = "Row 1 (WS): p5, w&t\nRow 2: k to end\nRow 3: k5, w&t\nRow 4: p to end";
    assert_eq!(rows(other, 8), ["k5 sl -2", "k5 slwyif -2", "p5 slwyif -2", "p5 sl -2"]);
}

#[test]
fn wraps_are_picked_up_where_it_is_said() {
    let turned = "Row 3: k6, w&t\nRow 4: p4, w&t\n";
    let picked = ["- sl k6", "- ds k4 sl -", "k6 ds -", "k8"];
    let kept = ["- sl k6", "- slwyif k4 sl -", "k6 slwyif -", "k8"];
    for (words, expected) in [
        ("Row 5: k to end\nRow 6: p", kept),
        ("Row 5: k4, knit wrapped st, k to end\nRow 6: p", kept),
        ("Row 5: k to end, picking up wraps\nRow 6: purl, picking up wraps as you go", picked),
        ("Row 5: Knit, knitting wraps together with the sts they wrap.\nRow 6: Purl picking up wraps", picked),
        ("Row 5: k, knit wraps tog with wrapped sts as you come to them\nRow 6: p", picked),
        ("Row 5: k across, picking up all wraps and working them tog with their sts\nRow 6: p, hiding wraps", picked),
    ] {
        assert_eq!(behind(&format!("{turned}{words}"), 8), expected, "{words}");
    }
    // Stitch by stitch.
    for stitch in [
        "knit wrapped st together with its wrap",
        "k wrap with st",
        "k1 with wrap",
        "pick up wrap and knit it tog with st",
        "knit next st tog with its wrap",
    ] {
        let text = format!("Row 3: k5, w&t\nRow 4: p5\nRow 5: k to wrapped st, {stitch}, k2");
        assert_eq!(behind(&text, 8), ["-2 sl k5", "-2 ds k5", "k8"], "{stitch}");
    }
    for (row, problem) in [
        ("k4, k1 with wrap, k3", "row 5 has no wrap around stitch 5"),
        ("k5, pick up wrap, k2", "row 5: \"pick up wrap\" does not say how it is worked"),
        ("k5, wrap, k3", "row 5: \"wrap\" is no stitch that is known here; say w&t"),
    ] {
        let told = wrong(&format!("Row 3: k5, w&t\nRow 4: p5\nRow 5: {row}"));
        assert!(told.contains(problem), "{row}: {told}");
    }
}

#[test]
fn rows_go_as_far_as_others_have_turned() {
    let narrower = "Short row 3 (RS): k to last 2 sts, w&t\nShort row 4 (WS): Purl to 2 sts before end, w&t\n\
                    Row 5: k to 2 sts before last wrapped st, w&t\nRow 6: p to 2 sts before wrapped st, w&t\n\
                    Row 7: k to end, picking up wraps\nRow 8: p to end, picking up wraps";
    assert_eq!(
        behind(narrower, 14),
        ["- sl k12", "- ds k10 sl -", "-3 sl k8 ds -", "-3 ds k6 sl -3", "k10 ds -3", "k14"]
    );
    let wider = "Row 3: k8, w&t\nRow 4: p4, w&t\nRow 5: knit to wrapped st, knit wrap with st, w&t\n\
                 Row 6: purl to wrapped st, purl wrapped st with its wrap, w&t\nRow 7: k to 1 st past wrapped st, turn\n\
                 Row 8: p to end";
    assert_eq!(
        behind(wider, 12),
        ["-3 sl k8", "-3 ds k4 sl -3", "-2 sl k5 ds -3", "-2 slwyif k6 sl -2", "- k8 slwyif -2", "- k11"]
    );
    let german = "Row 3: k10, turn, make double stitch\nRow 4: p8, turn, mds\nRow 5: k to ds, k ds, k1, turn, mds\n\
                  Row 6: p to 2 sts before ds, turn\nRow 7: mds, k to 1 st before gap, turn\nRow 8: p\n\
                  Row 9: k, working double stitches as one";
    assert_eq!(
        behind(german, 14),
        ["-4 k10", "-4 ds k8 -", "-3 k9 ds -", "-3 ds k6 -4", "-4 k5 ds -4", "-4 k10", "k14"]
    );
    for (row, problem) in [
        ("k to 9 sts before wrap, turn", "row 5 has 4 stitches before the wrapped stitch, not 9"),
        ("k to 4 sts past wrap, turn", "row 5 has 3 stitches behind the wrapped stitch, not 4"),
        ("k to ds, turn", "row 5 comes to no double stitch"),
        ("k2, k ds, k to end", "row 5 has no double stitch where stitch 3 is"),
        ("k to moon, turn", "row 5: expected \"to end\", \"to last 3 sts\" or \"to wrapped st\", found \"moon\""),
    ] {
        let told = wrong(&format!("Row 3: k4, w&t\nRow 4: p to end\nRow 5: {row}"));
        assert!(told.contains(problem), "{row}: {told}");
    }
}

#[test]
fn a_row_that_turns_and_goes_on_is_several() {
    assert_eq!(behind("Row 3: k6, turn, p4, turn, k to end\nRow 4: p", 8), ["-2 k6", "-2 k4 -2", "k6 -2", "k8"]);
    assert_eq!(behind("Row 3: k6, w&t, p to end\nRow 4 (RS): k\nRow 5: p", 8), ["- sl k6", "- slwyif k6", "k8", "k8"]);
    assert_eq!(behind("Row 3: [k5, turn, p5, turn] twice, k to end", 8), ["-3 k5", "-3 k5", "-3 k5", "-3 k5", "k8"]);
    let told = wrong("Row 3: k6, turn, p to end\nRow 4 (WS): k");
    assert!(told.contains("row 4 is said to be on the wrong side"), "{told}");
}

#[test]
fn short_rows_have_numbers_of_their_own() {
    let text = "Short rows:\nShort row 1 (RS): k5, w&t\nShort row 2 (WS): p to end\nRow 3: k\nRow 4: p\nRep rows 1-4 once more.\n\
                Rep short rows 1 and 2 once more. Rep row 3 once more.";
    let (there, back) = ("-2 sl k5", "-2 slwyif k5");
    assert_eq!(behind(text, 8), [there, back, "k8", "k8", "k8", "k8", there, back, "k8", "k8", there, back, "k8"]);
    // Numbers that go on, of whichever rows.
    for heads in [
        ["Row 3", "Row 4"],
        ["Short-row 3", "SR 4"],
        ["Next short row", "Next row"],
        ["3rd short row", "Row 4 (short row)"],
    ] {
        let text = format!("{}: k5, w&t\n{}: p to end\nRow 5: k", heads[0], heads[1]);
        assert_eq!(behind(&text, 8), [there, back, "k8"], "{heads:?}");
    }
    let told = wrong("Short row 1: k5, w&t\nShort row 2: p\nRep short rows 1-3 twice");
    assert!(told.contains("short rows are repeated that are not written before"), "{told}");
}

#[test]
fn pieces_with_short_rows_end_with_a_whole_repeat() {
    let piece = |text: &str, asked| Instructions::read(text).unwrap().work_piece(8, asked, 20).map(|(made, _)| made);
    let text = format!("{PLAIN}Row 3: k5, w&t\nRow 4: p");
    // They are there once, or as often as rows are asked for.
    let once = piece(&text, Asked::Nothing).unwrap();
    assert_eq!((once.rows.len(), once.whole), (4, true));
    assert_eq!(piece(&text, Asked::Rows(10)).unwrap().rows.len(), 10);
    for (more, count) in
        [("Rep rows 1-4", 20), ("Rep rows 3-4 for pattern", 20), ("Rep rows 1-4, ending with row 2", 22)]
    {
        assert_eq!(piece(&format!("{text}\n{more}"), Asked::Nothing).unwrap().rows.len(), count, "{more}");
    }
    let six = format!("{text}\nRow 5: k\nRow 6: p\nRep rows 1-6");
    assert_eq!(piece(&six, Asked::Nothing).unwrap().rows.len(), 24);
}
