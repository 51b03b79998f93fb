//! Written instructions and the rows of charts that they are.

mod brioche;
mod short_rows;

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
    let all = "Row 1: k1, p1, k1 tbl, p1 tbl, yo, k2tog, ssk, p2tog, ssp, k3tog, sssk, p3tog, cdd, kfb, pfb, m1l, m1r, m1p, sl1, \
               sl1 wyif, tuck, miss, mb, c4f, c4b, t3f, t3b, 2/1 LC, 2/1 RPC\nRow 2: k to last 2 sts, p2, yo";
    let rows = rows(all, 51);
    let chart = crate::pattern::chart::Chart::parse(&rows).unwrap();
    assert_eq!(chart.work(51, 2, 1 << 20).unwrap().len(), 2);
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
    assert!(wrong("Cast on 4000000000 sts.\nRow 1: k", 4).problem.contains("4000000000 stitches are cast on"));
    assert!(wrong("Cast on 0 sts.\nRow 1: k", 4).hint.contains("1 to 20000"));
    assert!(wrong("Row 1: k1, *yo; rep from * to end", 4).problem.contains("none of the stitches"));
    assert!(wrong("Row 1: [k5, turn, p5, turn] 0 times", 10).problem.contains("no stitches"));
    let turns = "Row 1: [[k5, turn, p5, turn] 5000 times] 5000 times";
    assert!(wrong(turns, 10).problem.contains("turns within a repeat"));
    let deep = format!("Row 1: {}k1", "[".repeat(100));
    assert!(wrong(&deep, 1).problem.contains("deep"));
}

#[test]
fn heads_are_what_patterns_write() {
    let rib = ["k2 p2 k2 p2 k2"; 2];
    for text in [
        "1st row (RS): k2, *p2, k2; rep from * to end.\n2nd row: p2, *k2, p2; rep from * to end.",
        "1st row: (RS). K2. *P2. K2. Rep from * to end of row.\n2nd row: P2. *K2. P2. Rep from * to end of row.",
        "R1: k2, *p2, k2; rep from * to end\nR2: p2, *k2, p2; rep from * to end",
        "Row 1 [RS] - K2, *p2, k2; rep from * across.\nRow 2 \u{2013} P2, *k2, p2, rep from * across.",
        "Row 1. K 2, * P 2, K 2. Repeat from * across row.\nRow 2. P 2, *K 2, P 2* across row.",
        "First row (right side) K2, [p2, k2] to end.\nSecond row P2, [k2, p2] to end. (10 sts)",
        "Row 1: k2, *p2, k2*, rep from * to * across. Row 2: p2, {k2, p2} 2 times.",
        "RS rows: k2, *p2, k2;\n  rep from * to end.\nRow 2 and all WS rows: k the knits and p the purls.\nRow 3: k2, [p2, k2] x2",
    ] {
        match Instructions::read(text).and_then(|read| read.work(10, 0)) {
            Ok(found) => assert_eq!(found.rows[..2], rib, "{text}"),
            Err(wrong) => panic!("{text}: {wrong}"),
        }
    }
    assert_eq!(rows("Rounds 1\u{2013}2: *k1, p1*; rep from * around", 4), ["p k p k"; 2]);
    assert_eq!(
        rows("Row 1 and 2: k\nNext row: p\nNext 2 rows: k1, p1\nKnit 1 row", 2),
        ["k2", "p2", "p2", "p k", "p k", "p2"]
    );
    assert_eq!(rows("Row 1 (WS): purl\nAll RS rows: knit\nAll WS rows: k1, p1", 2), ["k2", "k2"]);
    let dictionary = "Row 1: K 4, * P 1, K 7. Repeat from * across row. End P 1, K 4.";
    assert_eq!(rows(dictionary, 25), ["k4 p k7 p k7 p k4"]);
    let nth = "7th row: k\n1st to 5th rows: p\n6th row: As 5th row";
    assert_eq!(rows(nth, 1), ["p", "k", "p", "k", "p", "k", "k"]);
    assert_eq!(rows("1st row: k\n2nd row: p1\n3rd to 6th rows: As 1st and 2nd rows 2 times more.", 1), ["k"; 6]);
    assert_eq!(
        rows("Row 1: k1, p1\nRow 2: p1, k1\nRow 4: k2\nRow 3 and every following 3rd row: p2", 2),
        ["p k", "k p", "p2", "p2"]
    );
}

#[test]
fn stitches_are_written_in_many_ways() {
    for (text, takes, row) in [
        ("(k1, p1) x 6", 12, "p k p k p k p k p k p k"),
        ("(k1, p1) \u{d7}2", 4, "p k p k"),
        ("[k1, p1] six times", 12, "p k p k p k p k p k p k"),
        ("k2p2", 4, "p2 k2"),
        ("K 2, p 2", 4, "p2 k2"),
        ("knit 2, purl 2", 4, "p2 k2"),
        ("k2tog tbl, k2tog-tbl, k 2 tog, knit 2 together, p2 tog tbl", 10, "ssp k2tog k2tog ssk ssk"),
        ("k3 tog, sl 2 tog kwise, k1, p2sso", 6, "cdd k3tog"),
        ("slip 1 knitwise, k 1, psso; s1, k2tog, psso", 5, "sssk ssk"),
        ("pm, k1, yarn over, sl m, k2tog twice, yo twice", 5, "yo yo k2tog k2tog yo k"),
        ("sl1p wyif, sl 2 with yarn in back, slip 1 purlwise with yarn in front", 4, "slwyif sl sl slwyif"),
        ("LT, RT, C4L, 2/2RC, make 1, m1p", 12, "m1lp m1l 2/2rc c4f 1/1rc 1/1lc"),
        ("k until 3 sts remain, p to end", 5, "p3 k2"),
        ("K to 1 st before end, p1 tbl", 3, "ptbl k2"),
        ("k all sts", 3, "k3"),
        ("P.", 3, "p3"),
        ("*k1, p1; rep from * twice more, k1 - 7 sts", 7, "k p k p k p k"),
        ("pfb, kfb into", 0, ""),
    ] {
        let found = chart_rows(&format!("Row 1: {text}"), takes.max(1));
        match row {
            "" => assert!(found.unwrap_err().problem.contains("\"into\""), "{text}"),
            row => assert_eq!(found.map_err(|e| e.to_string()), Ok(vec![row.to_owned()]), "{text}"),
        }
    }
    assert_eq!(rows("Row 1: work in St st\nRow 2: st st\nRow 3: rev st st to last 1 st, k1", 3), ["k3", "k3", "k p2"]);
    assert_eq!(
        rows(
            "Row 1: k1, p2, yo, k1\nRow 2: knit the knit sts and purl the purl sts\nRow 3: k2, k the k sts and p the p sts as they appear to last st, k1",
            4
        ),
        ["k yo p2 k", "k2 p2 k", "k2 p k2"]
    );
    // On the wrong side increases show their purl faces.
    assert_eq!(
        rows("Row 1: k\nRow 2: p1, m1p, pfb, m1, p to end", 4),
        ["k4", "k m1l pfb_"].map(|r| r.replace("pfb_", "kfb m1lp k2"))
    );
}

#[test]
fn lengths_are_read_in_all_units() {
    for (more, height) in [
        ("Rep rows 1-2 until piece measures 10 cm.", Some(100.0)),
        ("Rep rows 1-2 for 10.5cm, ending with a WS row", Some(105.0)),
        ("These 2 rows form the pattern. Cont in patt until work measures 4 1/2 in.", Some(114.3)),
        ("Repeat rows 1 and 2 until it measures 4\u{bd}\" [11.5 cm]. Bind off.", Some(114.3)),
        ("Continue in pattern until piece measures 25 cm [10 in]\nBind off.", Some(250.0)),
        ("Rep rows 1-2.", None),
        ("Rep rows 1-2 3 times more (10 cm).", None),
        ("Rep rows 1-2 until 5 sts remain (10 cm).", None),
    ] {
        let found = Instructions::read(&format!("Row 1: k1, p1\nRow 2: k2\n{more}")).unwrap().height();
        let same = found.zip(height).map_or(found == height, |(a, b)| (a - b).abs() < 1e-9);
        assert!(same, "{more}: {found:?}");
    }
}

#[test]
fn rows_are_repeated_as_they_are_told() {
    let work = |text: &str, stitches, least| Instructions::read(text).unwrap().work(stitches, least).unwrap();
    let two = "Row 1: k1, p1\nRow 2: k2\n";
    for (more, rows, whole) in [
        ("Rep rows 1-2.", 2, false),
        ("Repeat Rows 1 and 2 for pattern.", 2, false),
        ("These 2 rows form the pattern. Cont in patt until work measures 10 cm.", 2, false),
        ("Repeat rows 1-2 until piece measures 25 cm [10 in]\nBind off.", 2, true),
        ("Rep last 2 rows twice more", 6, true),
        ("Rep rows 1-2. Bind off.", 2, false),
        ("Rep rows 1-2, ending with row 2. Bind off.", 2, false),
        ("Rep rows 1-2, 3 times more. Bind off all sts.", 8, true),
        ("Work rows 1-2 3 times", 6, true),
        ("Repeat from row 1 for 5 more rows", 7, true),
        ("Rows 3-4: rep rows 1-2\nRepeat rows 3 and 4", 20, true),
        ("Rep row 2", 20, true),
    ] {
        let found = work(&format!("{two}{more}"), 2, 20);
        assert_eq!((found.rows.len(), found.whole), (rows, whole), "{more}");
        assert!(found.rows[2..].chunks(2).all(|w| more == "Rep row 2" || w[0] == "p k"), "{more}: {:?}", found.rows);
    }
    // A pattern of one row comes from the other side in the next one.
    assert_eq!(work("Row 1: *k1, p1; rep from * to last st, k1. Rep row 1.", 3, 20).rows, ["k p k", "p k p"]);
    assert_eq!(work("Rnd 1: *k1, p1; rep from *\nRep rnd 1", 2, 20).rows, ["p k"]);
    let shawl = "Cast on 9 sts.\nRow 1 (RS): k1, k2tog, k to last 3 sts, ssk, k1. (7 sts)\nRow 2: purl\nRep rows 1-2 until 5 sts remain.";
    assert_eq!(Instructions::read(shawl).unwrap().cast_on(), Some(9));
    assert_eq!(
        work(shawl, 9, 20),
        Worked { rows: ["k ssk k3 k2tog k", "k7", "k ssk k k2tog k"].map(String::from).to_vec(), whole: true }
    );
    let shaped = "Row 1: kfb, k to end\nRow 2: purl";
    assert_eq!(work(shaped, 4, 20), Worked { rows: vec!["k3 kfb".into(), "k5".into()], whole: true });
    assert_eq!(work(&format!("{shaped}\nrepeat rows 1-2"), 4, 7).rows.len(), 7);
}

#[test]
fn repeats_end_where_they_are_told_to() {
    let rows = |text: &str, stitches| {
        let read = Instructions::read(text).map_err(|e| e.to_string())?;
        read.work(stitches, 20).map(|worked| (worked.rows.len(), worked.whole)).map_err(|e| e.to_string())
    };
    // By stitches: the repeat is worked to its end where it keeps them, and what remains is taken off at once.
    let wider = "Row 1 (RS): k1, m1l, k to last st, m1r, k1.\nRow 2: Purl.\nRep rows 1-2 ";
    for end in
        ["until you have 9 sts", "until there are 9 sts", "until 9 sts on needle", "till 9 sts are on the needles."]
    {
        assert_eq!(rows(&format!("{wider}{end}"), 3), Ok((6, true)), "{end}");
    }
    assert_eq!(rows(&format!("{wider}until you have 9 sts, ending with a RS row"), 3), Ok((5, true)));
    assert_eq!(
        rows("Row 1: m1l, k to end\nRow 2: m1p, p to end\nRep rows 1-2 until there are 6 sts", 3),
        Ok((3, true))
    );
    let narrower = "Row 1 (RS): k1, k2tog, k to last 3 sts, ssk, k1\nRow 2: purl\nRep rows 1-2 until 5 sts remain";
    assert_eq!(rows(narrower, 9), Ok((3, true)));
    assert_eq!(rows(&format!("{narrower}, ending with a wrong side row"), 9), Ok((4, true)));
    // By rows and times.
    let two = "Row 1: knit. Row 2: purl. Rep last 2 rows ";
    for (end, count) in [
        ("until 30 rows have been worked", 30),
        ("until row 30 has been worked", 30),
        ("for a total of 30 rows", 30),
        ("for 30 rows", 32),
        ("a total of 5 times", 10),
        ("5 times in all", 10),
        ("5 times", 12),
        ("5 more times, ending with a WS row", 12),
        ("5 times more, ending with row 2. Bind off", 12),
        ("twice more, then bind off all sts loosely", 6),
    ] {
        assert_eq!(rows(&format!("{two}{end}"), 4), Ok((count, true)), "{end}");
    }
    assert_eq!(rows("Row 1: knit. Row 2: purl. Rep these 2 rows a total of 5 times", 4), Ok((10, true)));
    // Without an end.
    for end in ["", "for pattern", "for the lace pattern", "throughout", "to desired length", "until it is long enough"]
    {
        assert_eq!(rows(&format!("{two}{end}"), 4), Ok((2, false)), "{end}");
    }
    for (end, problem) in [
        ("until bananas", "\"until bananas\" says no end of the repeat"),
        ("to the moon", "\"to the moon\" says no end"),
        ("until 9 sts are decreased", "\"until 9 sts are decreased\""),
        ("until it is time", "\"until it is time\""),
        ("until 10 cm, ending with tea", "\"ending with tea\" ends on no row"),
        ("5 times, ending with a RS row", "row 12 is the last and on the wrong side"),
        ("5 times, ending with row 1", "the repeats end with row 2, and are to end with row 1"),
        ("until 10 cm, ending with row 3", "row 3 is to be the last, and is not repeated"),
        ("until row 1", "2 rows are written, and it is to end after 1"),
        ("until there are 9 sts", "there are never 9 stitches: 4 are there after row 4"),
    ] {
        let told = rows(&format!("{two}{end}"), 4).unwrap_err();
        assert!(told.contains(problem), "{end}: {told}");
    }
    let round = "Rnd 1: k. Rep rnd 1 until 5 cm, ending with a WS round";
    assert!(rows(round, 4).unwrap_err().contains("rounds have no wrong side"));
}

#[test]
fn a_height_ends_with_the_row_that_is_said() {
    let ending = |text: &str| Instructions::read(text).unwrap().ending();
    let four = "Row 1: k. Row 2: p. Row 3: k. Row 4: p. Rep rows 1-4 until 5 cm, ending ";
    let every = |apart, rest| Some(EveryFew { apart, rest });
    assert_eq!(ending(&format!("{four}with a WS row")), every(2, 0));
    assert_eq!(ending(&format!("{four}after a RS row.")), every(2, 1));
    assert_eq!(ending(&four.replace("Row 1", "Row 1 (WS)").replace("ending ", "ending with a WS row")), every(2, 1));
    assert_eq!(ending(&format!("{four}on row 2 of pattern")), every(4, 2));
    assert_eq!(ending("Set-up row: k. Row 1: k. Row 2: p. Rep rows 1-2 until 5 cm, ending with row 2"), every(2, 1));
    assert_eq!(ending("Row 1: k. Rep row 1 until 5 cm"), None);
    let [even, odd, fourth] = [(2, 0), (2, 1), (4, 2)].map(|(apart, rest)| EveryFew { apart, rest });
    assert_eq!([even.nearest(20.9), even.nearest(21.1), even.nearest(0.2)], [20, 22, 2]);
    assert_eq!([odd.nearest(20.9), odd.nearest(0.1), fourth.nearest(20.4)], [21, 1, 22]);
    assert_eq!([even.from(20), odd.from(20), fourth.from(20)], [20, 21, 22]);
}

#[test]
fn rows_that_turn_are_counted_with_what_they_go_back() {
    // Each of them is two rows, of which the second one is on the wrong side.
    let text = |ending: &str| {
        format!("Row 1 (RS): k5, turn, p to end. Repeat row 1 until piece measures 10 cm, ending with a {ending} row.")
    };
    let error = Instructions::read(&text("RS")).unwrap_err();
    assert!(error.problem.contains("none of the repeated rows ends on the side"), "{error}");
    let (worked, rows) =
        Instructions::read(&text("WS")).unwrap().work_piece(10, Asked::new(Some(7), false), 12).unwrap();
    assert_eq!((worked.rows.len(), rows), (8, 8));
}

#[test]
fn repeated_rows_have_numbers_where_those_that_they_repeat_do() {
    let short = "Row 1 (RS): k\nRow 2: p\nShort row 1 (RS): k to last 4 sts, turn\nShort row 2: p to end\n\
                 Row 3: k\nRow 4: p\nRep rows 1-4 twice more.\nRow 13: p\nRow 14: p";
    // Four rows with two short ones between them, and all again twice; then two more.
    let rows = rows(short, 10);
    assert_eq!((rows.len(), rows[2].as_str(), rows[8].as_str(), rows[14].as_str()), (20, "-4 k6", "-4 k6", "-4 k6"));
    assert_eq!(rows[18..], ["p10", "k10"]);
    let pairs = "Row 1A (RS): k\nRow 1B (RS): k\nRow 2A: p\nRow 2B: p\nRep rows 1-2 once more.\nRow 5A: p\nRow 5B: p";
    assert_eq!(chart_rows(pairs, 3).unwrap().len(), 10);
    let none = "Row 1A (RS): k\nRow 1B (RS): k\nRep last 0 rows twice more.";
    assert!(chart_rows(none, 3).unwrap_err().problem.contains("no row is there to repeat"));
}

#[test]
fn shaped_rows_go_on_where_more_of_them_are_asked_for() {
    let text = "Row 1: k1, m1, k to end\nRow 2: p";
    let read = Instructions::read(text).unwrap();
    let work = |read: &Instructions, stitches, asked| read.work_piece(stitches, asked, 20).map(|(worked, _)| worked);
    let asked = work(&read, 14, Asked::Rows(6)).unwrap();
    assert_eq!(asked, Instructions::read(&format!("{text}\nRep rows 1-2.")).unwrap().work(14, 6).unwrap());
    assert_eq!((asked.rows.len(), asked.rows[4].as_str()), (6, "k15 m1l k"));
    assert_eq!(read.work(14, 6).unwrap().rows.len(), 2);
    // Fewer are cut off by who knits them, and what is bound off does not go on.
    assert_eq!(work(&read, 14, Asked::Rows(1)).unwrap().rows.len(), 2);
    let bound_off = Instructions::read(&format!("{text}\nBind off.")).unwrap();
    assert_eq!(work(&bound_off, 14, Asked::Rows(6)).unwrap().rows.len(), 2);
    // Where a height counts the rows, those that cannot be knitted are not wanted.
    let narrower = Instructions::read("Row 1: k2tog, k to end").unwrap();
    assert_eq!(work(&narrower, 5, Asked::Height).unwrap().rows.len(), 4);
    for rows in [20, 5000] {
        assert!(work(&narrower, 5, Asked::Rows(rows)).is_err(), "{rows}");
    }
}

#[test]
fn what_is_not_knitted_is_told_with_its_row_and_word() {
    for (text, problem, hint) in [
        ("Row 1: k1\nRow 2: k1, bind off sts", "row 2: \"bind\"", "by a line of its own"),
        ("Row 1: BO 3, k1", "needs 3 stitches for bo, 1 are left", "fits"),
        ("Row 1: k1, cast off some sts", "row 1: \"cast\"", "4 sts"),
        ("Row 1: inc 1, k1", "row 1: \"inc\"", "kfb"),
        ("Row 1: k to m, k1", "row 1: markers", "say how many"),
        ("Row 1: k1b", "row 1: \"k1b\"", "k1 tbl"),
        ("Row 1: work in patt", "row 1: \"work\"", "k the knits"),
        ("Row 1: k 5 tog", "row 1: \"k5tog\"", "are known"),
        ("Row 1: k1\nRow 2: k1 (3 sts)", "row 2 makes 1 stitches, and says that it has 3", "fits"),
        ("Set-up row\nRow 1: k1", "expected \"Row 1: ...\"", "are known"),
        ("Row 1: k1\nSet-up row: k1", "comes after", "before Row 1"),
        ("Set-up row: k1\nRow 1: k1\nRow 1: k1", "row 1 is written twice", "are known"),
        ("Set-up row 1: k1\nSet-up row 3: k1\nRow 1: k1", "set-up row 2 is missing", "expected"),
        ("Set-up row: k1\nRow 1: k1\nRep rows 1-2", "row 2 is repeated", "rows 1 to 1"),
        ("Row 1: k1\nRow 2: bind off 1 st", "row 2 binds off all stitches", "a line of its own: Bind off"),
        ("Row 1: k the knits and p the purls", "row 1 is the first one", "say which"),
        ("Row 1: k1\nRep rows 1-4", "row 2 is repeated", "rows 1 to 1"),
        ("Row 1: k1\nRep row 1\nRow 2: p1", "rows come after", "3 times"),
        ("Row 1: k1\nRep row 1 until 5 sts remain", "5 stitches never remain", "another number"),
        ("Row 1: k1\nRep row 1 until 10 cm, inc 1 st at end", "\"inc\" in rows", "write rows"),
        ("Rows 4-1: k1", "no range", "Rows 1-4"),
        ("Row 99999999999: k1", "no row", "Row 1:"),
    ] {
        let wrong = Instructions::read(text).and_then(|read| read.work(1, 20)).unwrap_err();
        assert!(wrong.problem.contains(problem) && wrong.hint.contains(hint), "{text}: {wrong}");
    }
}

#[test]
fn stitches_are_bound_off_and_cast_on_within_rows() {
    let rows = |text: &str| chart_rows(text, 12).unwrap();
    for (off, on) in [
        ("BO4", "CO4"),
        ("bind off 4 sts", "cast on 4 sts"),
        ("bind off the next 4 stitches knitwise", "cast on 4"),
        ("cast off 4", "co 4 sts"),
    ] {
        let text = format!(
            "Row 1 (RS): k\nRow 2: p\nRow 3: k4, {off}, k to end (8 sts)\nRow 4: p4, {on}, p4 (12 sts)\nBind off."
        );
        assert_eq!(rows(&text), ["k12", "k12", "k4 bo4 k4", "k4 co4 k4"], "{text}");
    }
    // On the wrong side, and at the beginning of rows.
    assert_eq!(
        rows("Row 1 (WS): bo 2, k to end\nRow 2: bind off 2 sts, k to end\nRow 3: bo 2 purlwise, p to end"),
        ["bop2 p10", "k8 bo2", "bo2 k6"]
    );
}

#[test]
fn set_up_rows_are_knitted_once() {
    let work = |text: &str, least| Instructions::read(text).unwrap().work(4, least).unwrap();
    // The rows behind are numbered from 1 and repeated by these numbers, or by themselves.
    let pattern = "Row 1 (RS): k2, p2\nRow 2: k the knits and p the purls";
    for text in [
        format!("Set-up row (WS): k\n{pattern}\nRep rows 1-2"),
        format!("Set up row: Knit.\n{pattern}\nRep rows 1 and 2 for pattern."),
        format!("Foundation row (WS): k. {pattern}"),
        format!("Knit 1 row.\n{pattern}\nThese 2 rows form the pattern."),
    ] {
        let made = work(&text, 5);
        assert_eq!(made.rows, ["p4", "p2 k2", "p2 k2", "p2 k2", "p2 k2"], "{text}");
        assert!(made.whole, "{text}");
    }
    // Without a word on sides, row 1 is on the right one.
    assert_eq!(work("Set-up row: k\nRow 1: k2, p2\nRow 2: k2, p2", 3).rows, ["p4", "p2 k2", "p2 k2"]);
    assert_eq!(
        work("Set-up rows 1-2: k\nRow 1: p\nRow 2: p\nRep rows 1-2 once more. Bind off.", 20).rows,
        ["k4", "p4", "p4", "k4", "p4", "k4"]
    );
    assert_eq!(work("Set-up rnd: p\nRnd 1: k\nRnd 2 and all even rnds: p\nRnd 3: k", 3).rows, ["p4", "k4", "p4", "k4"]);
    // Their stitches count too.
    assert_eq!(work("Set-up row: kfb, k3 (5 sts)\nRow 1: k5\nRow 2: p5", 4).rows, ["pfb p3", "k5", "k5", "k5"]);
    // Row 1 would be on the right side.
    assert_eq!(work("Set-up row: k", 20), Worked { rows: vec!["p4".into()], whole: false });
}

#[test]
fn one_row_of_a_flat_piece_is_worked_from_both_sides() {
    let piece = |text: &str, asked| Instructions::read(text).unwrap().work_piece(4, asked, 20).unwrap().0.rows;
    assert_eq!(piece("Row 1: Knit.", Asked::Nothing), ["k4", "p4"]);
    assert_eq!(piece("Row 1: Knit.", Asked::Rows(1)), ["k4"]);
    assert_eq!(piece("Rnd 1: Knit.", Asked::Nothing), ["k4"]);
    let three = "Row 1: Knit.\nRow 2: Purl.\nRow 3: Purl.";
    assert_eq!(piece(three, Asked::Nothing), ["k4", "k4", "p4", "p4", "p4", "k4"]);
}

#[test]
fn all_rows_are_told_at_once() {
    let piece = |text: &str| Instructions::read(text).unwrap().work_piece(4, Asked::Nothing, 20).unwrap().0.rows;
    for text in ["All rows: Knit.", "Every row: knit", "Knit every row.", "Knit all rows."] {
        assert_eq!(piece(text), ["k4", "p4"], "{text}");
    }
    assert_eq!(piece("Purl every row"), ["p4", "k4"]);
    assert_eq!(piece("Knit every round."), ["k4"]);
    assert_eq!(piece("RS rows: Knit. WS rows: Purl."), ["k4", "k4"]);
    assert_eq!(piece("Set-up row: Purl.\nSet-up row: Purl.\nAll rows: Knit.")[..4], ["p4", "k4", "k4", "p4"]);
}

#[test]
fn what_stands_behind_is_never_left_out() {
    let piece = |text: &str| Instructions::read(text).unwrap().work_piece(6, Asked::Nothing, 20).unwrap().0.rows;
    let wrong = |text: &str| Instructions::read(text).map(|_| ()).unwrap_err().problem;
    // Rows without a number behind a cast-on and behind repeats, in one line as in several.
    for text in [
        "Cast on 6 sts. Knit 4 rows. Row 1 (RS): knit. Row 2: purl. Rep rows 1-2 twice more. Bind off.",
        "Cast on 6 sts.\nKnit 4 rows.\nRow 1 (RS): knit.\nRow 2: purl.\nRep rows 1-2 twice more.\nBind off.",
        "Row 1: knit. Row 2: purl. Rep rows 1-2 twice more. Knit 4 rows. Bind off.",
    ] {
        assert_eq!(piece(text).len(), 10, "{text}");
    }
    assert!(wrong("Cast on 6 sts and knit 4 rows.\nRow 1: k").contains("more than a cast-on"));
    let later = "Cast on 6 sts.\nKnit 10 rows.\nCast on 3 sts.\nKnit 10 rows.\nBind off.";
    assert!(wrong(later).contains("cast on behind rows"));
    assert!(piece("Cast on 6 sts, join to work in the round, being careful not to twist.\nRnd 1: k").len() == 1);
    // One repeat in a sentence.
    let four = "Row 1: k\nRow 2: p\nRow 3: k\nRow 4: p\n";
    for end in [
        "Rep rows 1-4 twice, then rows 1-3 once more. Bind off.",
        "Rep rows 1-4 twice more, then rep rows 1 and 2 once more, then purl 5 rows. Bind off.",
        "Rep rows 1-2 3 times more; work 4 rows in garter st.",
        "Rep rows 1 and 2 for 10 cm, then knit 4 rows.",
    ] {
        let problem = wrong(&format!("{four}{end}"));
        assert!(problem.contains("behind the end of a repeat"), "{end}: {problem}");
    }
    assert_eq!(piece(&format!("{four}Rep rows 1-4 twice more, then bind off.")).len(), 12);
}

#[test]
fn counts_of_rows_are_no_rows() {
    let read = |text: &str| Instructions::read(text);
    let piece = |text: &str| read(text).unwrap().work_piece(6, Asked::Nothing, 20).unwrap().0.rows.len();
    assert_eq!(piece("Rows 1-12: knit. Continue for 10 rows. Bind off."), 22);
    assert_eq!(piece("Row 1: k\nRow 2: p\nWork 4 rows in pattern. Bind off."), 6);
    let problem = read("Rows 1-6: knit. Work 4 rows in garter stitch. Bind off.").unwrap_err().problem;
    assert!(problem.contains("what is worked in them"), "{problem}");
    let problem = read("Rows 1-4: knit.\nRep last 10 rows once more.").unwrap_err().problem;
    assert_eq!(problem, "10 rows are to be repeated, and 4 are written");
    // "In" is no unit where no length is told of, and "row 1" no end of what is measured from there.
    let height = |end: &str| read(&format!("Row 1: k\nRow 2: p\n{end}")).unwrap().height;
    assert_eq!(height("Rep rows 1 and 2 in pattern."), None);
    assert_eq!(height("Rep rows 1 and 2 for 2 in."), Some(50.8));
    assert_eq!(height("Rep rows 1 and 2 until piece measures 3 cm from row 1."), Some(30.0));
}

#[test]
fn rows_are_told_of_every_fourth_and_of_brackets() {
    let made = |text: &str, stitches| Instructions::read(text).unwrap().work(stitches, 1).unwrap().rows;
    let every = "Row 1: k\nRow 3: k\nRow 5: k\nEvery 4th row: p2tog, p to end\nAll WS rows: p\nBind off.";
    assert_eq!(made(every, 6), ["k6", "k6", "k6", "k2tog k4", "k5", "k5"]);
    assert_eq!(made("Rows 1-3: knit. Every 4th row: k2tog, k to end. Bind off.", 6).len(), 4);
    for head in ["Row 2 (and all WS rows): Purl.", "Row 2 and all even-numbered rows: Purl."] {
        assert_eq!(made(&format!("Row 1 (RS): k. {head} Row 3: p. Bind off."), 6), ["k6", "k6", "p6", "k6"], "{head}");
    }
    assert_eq!(made("Row 1: k\nRow 2: p\nRow 3 (dec row): k1, k2tog, k to end\nRow 4: p", 6)[2], "k3 k2tog k");
    let problem = Instructions::read("Row 1 (RS): k. Row 2 (RS): p.").unwrap_err().problem;
    assert_eq!(problem, "row 2 is said to be on the right side, and other rows say otherwise");
    assert_eq!(rows("Row 1: (k1, p1) rep 3 times", 6), ["p k p k p k"]);
    let problem = chart_rows("Row 1: k4, *k2; rep from * to end", 4).unwrap_err().to_string();
    assert!(problem.contains("2 more `stitches` fit") && !problem.contains("fewer"), "{problem}");
}
