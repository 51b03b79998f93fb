mod double;
mod gaps;
mod openwork;
mod rims;
mod shaped;
mod short_rows;
mod topology;

use std::collections::BTreeSet;

use super::{
    super::{StrandKind, bend::folds, chart::PATTERNS},
    loops::{Border, Loops},
    *,
};
use crate::geometry::overlap::{Overlap, overlap};

fn knit(pattern: &str, stitches: u32, rows: u32) -> Knit {
    Knit {
        chart: Chart::named(pattern).unwrap(),
        stitches,
        rows,
        form: Form::Flat,
        edges: Edges::Finished,
        rims: Rims::default(),
        stitch_width: None,
        row_height: None,
        yarn_per_stitch: None,
        points: POINTS,
        colors: None,
        flat: true,
    }
}

/// Of strands of diameter 1.
fn measured(strands: &[PatternStrand]) -> Overlap {
    let radii: Vec<Vec<f64>> = strands.iter().map(|s| vec![0.5; s.curve.points.len()]).collect();
    overlap(strands.iter().zip(&radii).map(|(s, r)| (&s.curve, r.as_slice()))).unwrap()
}

/// How far strands of diameter 1 fold into themselves at most, in radians.
fn deepest_fold(strands: &[PatternStrand]) -> f64 {
    let folds = strands.iter().flat_map(|s| folds(&s.curve.points, 0.5));
    folds.fold(0.0, f64::max)
}

#[test]
fn every_pattern_keeps_its_yarns_apart() {
    for (pattern, _) in PATTERNS {
        let width = Chart::named(pattern).unwrap().even_width(100).unwrap();
        let stitches = width * 8_u32.div_ceil(width);
        let knit = knit(pattern, stitches, 8);
        let strands = knit.strands(1.0).unwrap();
        let found = measured(&strands);
        eprintln!("{pattern}: {found:?}");
        assert_eq!(strands.len(), 1, "{pattern}");
        assert!(found.share <= 0.02, "{pattern}: {found:?}");
        // Loops touch: else it would not be cloth.
        assert!(found.nearest < 1.03, "{pattern}: {found:?}");
    }
}

#[test]
fn plain_knit_has_the_proportions_of_real_knits() {
    let [width, height] = knit("stockinette", 10, 10).gauge();
    let yarn = YARN_PER_STITCH;
    // Munden's constants of plain knit, dry to fully relaxed: 5.0 to 5.5 and 3.8 to 4.2.
    eprintln!("Kc {:.2} Kw {:.2}, {:.3}", yarn / height, yarn / width, width / height);
    assert!((5.0..5.7).contains(&(yarn / height)), "{height}");
    assert!((3.8..4.2).contains(&(yarn / width)), "{width}");
}

#[test]
fn ribs_are_narrower_and_garter_stitch_is_shorter() {
    let gauge = |pattern| knit(pattern, 8, 8).gauge();
    let [plain, rib1, rib2, garter] = ["stockinette", "rib1x1", "rib2x2", "garter"].map(gauge);
    assert!(rib1[0] < 0.75 * plain[0] && rib2[0] < 0.8 * plain[0], "{plain:?} {rib1:?} {rib2:?}");
    assert!(garter[1] < 0.9 * plain[1], "{plain:?} {garter:?}");
}

#[test]
fn a_tube_is_one_spiral_and_its_courses_lie_in_their_wales() {
    let knit = Knit { form: Form::Tube, ..knit("rib2x2", 40, 6) };
    let strands = knit.strands(1.5).unwrap();
    let [s] = strands.as_slice() else { panic!("{} yarns", strands.len()) };
    assert!(!s.curve.closed && s.kind == StrandKind::Course);
    assert_eq!(s.curve.points.len(), s.coordinates.len());
    for (p, [wale, course]) in s.curve.points.iter().zip(&s.coordinates) {
        if !(1.0..5.0).contains(course) {
            continue;
        }
        let turn = p.x.atan2(p.z) / TAU;
        let off = turn - f64::from(*wale) / 40.0;
        assert!((off - off.round()).abs() * 40.0 < 1.0, "{p} {wale}");
    }
    assert!(measured(&knit.strands(1.0).unwrap()).share <= 0.02);
}

#[test]
fn a_round_may_begin_within_a_repeat() {
    // Where a rib begins anew, stitches stand beside others than in its cell: two wales of knit, or three of purl.
    for (pattern, stitches) in [("rib1x1", 25), ("rib1x1", 41), ("rib2x2", 41), ("rib2x2", 42), ("rib2x2", 43)] {
        let knit = Knit { form: Form::Tube, ..knit(pattern, stitches, 8) };
        let found = measured(&knit.strands(1.0).unwrap());
        assert!(found.nearest > 0.85 && found.share < 0.05, "{pattern} on {stitches}: {found:?}");
    }
}

/// A small hat: rib, stockinette, decreases to a crown.
fn hat(stitches: u32) -> Knit {
    let chart = ["4: k2 p2", "3: k", "k6 k2tog", "k", "k5 ssk", "k", "k4 k2tog", "k3 k2tog", "k2 k2tog", "k1 k2tog"];
    let chart = Chart::parse(&chart).unwrap();
    let radius = f64::from(stitches) * 3.9 / TAU;
    let profile = [(1.0, 0.0), (1.0, 17.0), (0.62, 34.0), (0.27, 40.0)].map(|(r, y)| DVec2::new(r * radius, y));
    Knit { rows: chart.rows(), chart, form: Form::Revolution(profile.into()), ..knit("stockinette", stitches, 1) }
}

#[test]
fn a_hat_keeps_its_yarns_apart_and_its_form() {
    let hat = hat(48);
    let strands = hat.strands(1.0).unwrap();
    let found = measured(&strands);
    eprintln!("hat: {found:?}");
    assert!(found.share <= 0.05, "{found:?}");
    let Form::Revolution(profile) = &hat.form else { unreachable!() };
    let widest = strands.iter().flat_map(|s| &s.curve.points).map(|p| p.x.hypot(p.z)).fold(0.0, f64::max);
    assert!((widest - profile[0].x).abs() < 3.0, "{widest} {}", profile[0].x);
}

#[test]
fn yarns_do_not_fold_into_themselves_where_a_brim_is_turned_up() {
    // As scenes/beanie.toml has it, in diameters, with half of the stitches.
    let chart = Chart::parse(&["24: k2 p2", "8: k"]).unwrap();
    let profile = [
        (31.0, 26.0),
        (31.0, 9.0),
        (30.9, 3.0),
        (30.1, 1.0),
        (28.3, 0.2),
        (26.5, 1.0),
        (25.7, 3.0),
        (25.7, 30.0),
        (25.7, 60.0),
    ];
    let form = Form::Revolution(profile.map(|(r, y)| DVec2::new(r, y)).into());
    let brim = Knit { rows: chart.rows(), chart, form, ..knit("stockinette", 48, 1) };
    let strands = brim.strands(1.0).unwrap();
    let deepest = deepest_fold(&strands);
    assert!(deepest < 0.5, "{deepest}");
}

#[test]
fn rows_share_the_lean_that_decreases_make() {
    // A row of decreases takes a tenth of the stitches: evenly spaced, those beside them would jump by half a stitch.
    let chart = Chart::parse(&["6: k", "k8 k2tog", "6: k"]).unwrap();
    let knit = Knit { rows: chart.rows(), chart, form: Form::Tube, ..knit("stockinette", 100, 1) };
    let rows = knit.worked().unwrap();
    let border = Border {
        round: Some(1.0),
        stacked: false,
        turns: true,
        finished: true,
        rims: Rims::default(),
        mirrored: false,
        slants: false,
    };
    let made = Loops::new(&rows, 100, border);
    let lean = |row: i32| {
        let count = rows[row as usize].len() as f64;
        let of = |l: &loops::Loop| match l.parents[..] {
            [p] if l.row == row => border.short(l.at - made.loops[p as usize].at).abs() * count,
            _ => 0.0,
        };
        made.loops.iter().map(of).fold(0.0, f64::max)
    };
    let worst = (1..13).map(lean).fold(0.0, f64::max);
    assert!(worst < 0.25, "{:?}", (1..13).map(lean).collect::<Vec<_>>());
    // Those above and below lean less and less.
    assert!(
        lean(6) > lean(8) && lean(8) > 2.0 * lean(12) && lean(6) > lean(4) && lean(4) > lean(2),
        "{:?}",
        (1..13).map(lean).collect::<Vec<_>>()
    );
    // Stitches keep about their width.
    for row in 0..13 {
        let mut at: Vec<f64> = made.loops.iter().filter(|l| l.row == row).map(|l| l.at).collect();
        at.sort_by(f64::total_cmp);
        let count = rows[row as usize].len() as f64;
        assert!(at.windows(2).all(|w| (0.75..1.25).contains(&((w[1] - w[0]) * count))), "{row}: {at:?}");
    }
}

#[test]
fn the_same_knit_is_the_same_to_the_bit() {
    // Large enough that rods are relaxed side by side.
    let once = hat(48).strands(1.3).unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let again = pool.install(|| hat(48).strands(1.3).unwrap());
    for (a, b) in once.iter().zip(&again) {
        assert_eq!(a.curve, b.curve);
    }
}

#[test]
fn a_finished_piece_ends_at_its_rim_and_a_live_one_has_open_loops() {
    let finished = knit("stockinette", 8, 6);
    let live = Knit { edges: Edges::Live, ..finished.clone() };
    for piece in [&finished, &live] {
        let strands = piece.strands(1.0).unwrap();
        let [one] = strands.as_slice() else { panic!("{} yarns", strands.len()) };
        let points = &one.curve.points;
        let (low, high) = points.iter().fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p.y), h.max(p.y)));
        let ends = [points[0].y, points[points.len() - 1].y];
        // The last row of the live one ends at its feet.
        let row = if piece.edges == Edges::Live { 7.0 } else { 3.0 };
        assert!(ends[0] < low + 3.0 && ends[1] > high - row, "{low} {high} {ends:?}");
    }
    // The cast-on edge and the bind-off are rows of their own.
    let rows = |piece: &Knit| {
        let strands = piece.strands(1.0).unwrap();
        strands[0].coordinates.iter().map(|c| c[1].floor() as i32).collect::<BTreeSet<_>>()
    };
    assert_eq!(rows(&finished), (-1..=6).collect());
    assert_eq!(rows(&live), (0..6).collect());
}

#[test]
fn charts_that_do_not_fit_are_refused() {
    let chart = Chart::parse(&["k", "c4f"]).unwrap();
    let error = Knit { chart, ..knit("stockinette", 6, 4) }.strands(1.0).unwrap_err();
    assert_eq!(error.problem, "row 2 repeats over 4 stitches, but finds 6");
}

/// A piece of stockinette in colours: a sign for each stitch, rows from the bottom.
/// More kinds of plain rows than there are cells for: the others are laid without.
#[test]
fn a_shaped_chart_may_have_rows_of_many_kinds() {
    let rows = ["4: k", "4: p", "4: k p", "4: p k", "4: k2 p", "4: k p2", "4: k2 p2", "k28 k2tog"];
    let chart = Chart::parse(&rows).unwrap();
    let knit = Knit { rows: chart.rows(), chart, ..knit("stockinette", 30, 1) };
    let knitted = knit.knitted(1.0).unwrap();
    assert_eq!(knitted.strands.len(), 1);
    assert!(measured(&knitted.strands).share < 0.05);
}

fn in_colors(rows: &[&str], form: Form) -> Knit {
    let row = |r: &&str| r.bytes().map(|b| u16::from(b - b'a')).collect();
    let colors = Colors { rows: rows.iter().map(row).collect(), work: Work::Stranded, catch: Some(5), carry: 3 };
    let count = rows.len() as u32;
    Knit { colors: Some(colors), form, ..knit("stockinette", rows[0].len() as u32, count) }
}

const TWO_COLORS: [&str; 8] = [
    "aaaaaaaaaaaaaaaa",
    "aaaaaaaaaaaaaaaa",
    "abababababababab",
    "aabbaabbaabbaabb",
    "aaaaaaaabaaaaaaa",
    "bbbbbbbbbbbbbbbb",
    "aaaaaaaaaaaaaaaa",
    "aaaaaaaaaaaaaaaa",
];

#[test]
fn each_colour_is_a_yarn_whose_floats_are_on_the_back() {
    for form in [Form::Flat, Form::Tube] {
        let knit = in_colors(&TWO_COLORS, form.clone());
        let made = knit.knitted(1.0).unwrap();
        assert_eq!(made.colors, [0, 1], "{form:?}");
        let found = measured(&made.strands);
        eprintln!("{form:?}: {found:?}");
        assert!(found.share <= 0.02, "{form:?}: {found:?}");
        let radius = 16.0 * made.gauge[0] / TAU;
        let depth = |p: &DVec3| if form.is_round() { p.x.hypot(p.z) - radius } else { p.z };
        // From round to round no yarn crosses the inside of a tube.
        let points = made.strands.iter().flat_map(|strand| &strand.curve.points);
        let deepest = points.map(depth).fold(0.0, f64::min);
        assert!(deepest > -5.0, "{form:?}: {deepest}");
        // Row 4 has one stitch of the second colour: what else that has in this row is a float.
        let (mut floats, mut loops) = (Vec::new(), Vec::new());
        for (strand, color) in made.strands.iter().zip(&made.colors) {
            for (p, [wale, course]) in strand.curve.points.iter().zip(&strand.coordinates) {
                // Away from edges, from its one stitch and from where it is caught.
                if !(4.0..5.0).contains(course) || !(1.0..15.0).contains(wale) || (7.0..10.0).contains(wale) {
                    continue;
                }
                if *color == 1 { floats.push(depth(p)) } else { loops.push(depth(p)) }
            }
        }
        let back = loops.iter().copied().fold(f64::MAX, f64::min);
        let mean = floats.iter().sum::<f64>() / floats.len() as f64;
        eprintln!("{form:?}: {} points of floats, {mean:.2}, loops from {back:.2}", floats.len());
        assert!(floats.len() > 20);
        assert!(mean < -1.1, "{form:?}: {mean}");
        let behind = floats.iter().filter(|z| **z < -0.5).count();
        assert!(behind as f64 > 0.95 * floats.len() as f64, "{form:?}: {floats:?}");
    }
}

/// At the sides of flat work what floats is caught, and turns behind the edge stitch: it does not hang out of the cloth.
#[test]
fn floats_turn_behind_the_edge_stitches() {
    let [plain, two, round] = ["aaaaaaaaaaaaaaaaaaaa", "aaaaaaaaabbaaaaaaaaa", "aaaaaaaabaabaaaaaaaa"];
    let made = in_colors(&[plain, two, round, two, two, plain], Form::Flat).knitted(1.0).unwrap();
    assert_eq!(made.colors, [0, 1]);
    let found = measured(&made.strands);
    assert!(found.share <= 0.02, "{found:?}");
    let [ground, float] = [&made.strands[0], &made.strands[1]];
    let far = |points: &[DVec3], side: f64| points.iter().map(|p| side * p.x).fold(0.0, f64::max) / made.gauge[0];
    for side in [-1.0, 1.0] {
        // In stitches from the middle.
        let (own, edge) = (far(&float.curve.points, side), far(&ground.curve.points, side));
        assert!((9.0..9.9).contains(&own), "side {side}: the float reaches {own}");
        assert!(edge > own + 0.1, "side {side}: the float reaches {own}, the edge {edge}");
    }
    // Where it is caught, beside the edge stitches and between, it lies before the yarn that knits there.
    let depths = |yarn: &PatternStrand, row: f32, wale: f32| -> Vec<f64> {
        let is_there = |[w, c]: &[f32; 2]| (w - wale).abs() < 0.1 && (row..row + 0.3).contains(c);
        let at = yarn.coordinates.iter().zip(&yarn.curve.points).filter(|(grid, _)| is_there(grid));
        at.map(|(_, p)| p.z).collect()
    };
    for (row, wales) in [(2.0, [1.0, 3.0, 15.0, 19.0]), (3.0, [1.0, 4.0, 15.0, 19.0])] {
        for wale in wales {
            let [own, working] = [float, ground].map(|yarn| depths(yarn, row, wale));
            let own = own.iter().sum::<f64>() / own.len() as f64;
            let behind = working.iter().copied().fold(0.0, f64::min);
            assert!(
                own > behind + 0.4,
                "row {row} at {wale}: the float at {own}, the yarn that catches it at {behind}"
            );
        }
    }
}

#[test]
fn a_colour_that_is_not_needed_for_long_is_cut() {
    let mut rows = vec!["bbbbbbbb"];
    rows.extend(["aaaaaaaa"; 6]);
    rows.push("bbbbbbbb");
    let cut = in_colors(&rows, Form::Flat).knitted(1.0).unwrap();
    assert_eq!(cut.colors, [1, 0, 1]);
    let found = measured(&cut.strands);
    assert!(found.share <= 0.02, "{found:?}");
    // Every yarn ends at an edge: at the corners, or behind the edge stitches.
    let half = 4.0 * cut.gauge[0];
    for strand in &cut.strands {
        let points = &strand.curve.points;
        for end in [points[0], points[points.len() - 1]] {
            let inside = end.x.abs() < half - 1.0 && end.z > -1.5 && end.y.abs() < 0.5 * 8.0 * cut.gauge[1] - 1.0;
            assert!(!inside, "{end}");
        }
    }
    // Carried up the side it is one.
    let carried = in_colors(&["aaaaaaaa", "aaaaaaaa", "bbbbbbbb", "bbbbbbbb", "aaaaaaaa", "aaaaaaaa"], Form::Flat);
    let carried = carried.knitted(1.0).unwrap();
    assert_eq!(carried.colors, [0, 1]);
    let found = measured(&carried.strands);
    assert!(found.share <= 0.02, "{found:?}");
}

#[test]
fn a_tile_goes_on_at_one_border_as_it_begins_at_the_other() {
    let tile = Knit { edges: Edges::Tile, ..knit("rib2x2", 8, 3) };
    let made = tile.knitted(1.0).unwrap();
    let period = DVec3::new(8.0 * made.gauge[0], 0.0, 0.0);
    assert_eq!(made.strands.len(), 3);
    for strand in &made.strands {
        let points = &strand.curve.points;
        assert!((points[points.len() - 1] - points[0]).distance(period) < 1e-9);
    }
    // Beside itself and above itself it is the same cloth: no yarn runs into another.
    let copies = (0..9).flat_map(|k| {
        let by = DVec3::new(f64::from(k % 3) * period.x, f64::from(k / 3) * 3.0 * made.gauge[1], 0.0);
        made.strands.iter().map(move |s| {
            let mut copy = s.clone();
            copy.curve.points.iter_mut().for_each(|p| *p += by);
            copy.curve.points.pop();
            copy.coordinates.pop();
            copy
        })
    });
    let found = measured(&copies.collect::<Vec<_>>());
    // Where a row is cut its two ends lie behind each other, within reach along the yarn.
    assert!(found.share <= 0.03, "{found:?}");
    let error = Knit { stitches: 10, ..tile }.knitted(1.0).unwrap_err();
    assert_eq!(error.problem, "a tile of 10 x 3 of what repeats over 4 x 1");
}

#[test]
fn fields_of_intarsia_are_linked_where_they_meet() {
    let knit = in_colors(&["aaaabbbb"; 6], Form::Flat);
    let colors = knit.colors.map(|c| Colors { work: Work::Intarsia, ..c });
    let knit = Knit { colors, ..knit };
    let made = knit.knitted(1.0).unwrap();
    // The first yarn casts on and binds off.
    assert_eq!(made.colors, [0, 1]);
    let found = measured(&made.strands);
    eprintln!("intarsia: {found:?}");
    assert!(found.share <= 0.03, "{found:?}");
    // Where it turns at the border, each yarn is held by the other: it cannot be drawn back to its own side.
    let reach = |color: usize, side: f64| {
        let inner = |c: &[f32; 2]| (1.0..5.0).contains(&c[1]) && (3.0..5.0).contains(&c[0]);
        let points = made.strands[color].curve.points.iter().zip(&made.strands[color].coordinates);
        points.filter(|(_, c)| inner(c)).map(|(p, _)| p.x * side).fold(f64::MIN, f64::max)
    };
    assert!(reach(0, 1.0) > 0.2 && reach(1, -1.0) > 0.2, "{} {}", reach(0, 1.0), reach(1, -1.0));
}

#[test]
fn a_piece_that_is_not_blocked_rolls_to_its_sides() {
    let blocked = knit("stockinette", 24, 30);
    let free = Knit { flat: false, ..blocked.clone() };
    let [a, b] = [&blocked, &free].map(|piece| piece.strands(1.0).unwrap());
    // Depth of what is near the middle of an edge, against that of the same points where it is blocked.
    let depth = |strands: &[PatternStrand], near: &dyn Fn(&[f32; 2]) -> bool| {
        let points = strands[0].curve.points.iter().zip(&strands[0].coordinates);
        let z: Vec<f64> = points.filter(|(_, c)| near(c)).map(|(p, _)| p.z).collect();
        z.iter().sum::<f64>() / z.len() as f64
    };
    let side = |c: &[f32; 2]| (2.0..3.0).contains(&c[0]) && (13.0..17.0).contains(&c[1]);
    let top = |c: &[f32; 2]| (27.0..28.0).contains(&c[1]) && (10.0..14.0).contains(&c[0]);
    let [side, top] = [&side as &dyn Fn(&[f32; 2]) -> bool, &top].map(|near| depth(&b, near) - depth(&a, near));
    eprintln!("side {side:.2}, top {top:.2}");
    assert!(side < -2.0 && top > 2.0, "{side} {top}");
    let found = measured(&b);
    eprintln!("{found:?}");
    assert!(found.share <= 0.03, "{found:?}");
    let told = |knit: Knit| knit.knitted(1.0).unwrap_err().problem;
    assert!(told(Knit { form: Form::Tube, ..free.clone() }).contains("curl"));
    let shaped = Chart::parse(&["k", "k2tog k"]).unwrap();
    assert!(told(Knit { chart: shaped, ..free }).contains("curls"));
}

#[test]
fn linen_stitch_is_dense() {
    let chart = Chart::parse(&["slwyif k", "k slwyif"]).unwrap();
    for wide in [2, 4] {
        let cell = Cell::relaxed(&chart, wide, YARN_PER_STITCH, POINTS, [None; 2]);
        let [width, height] = cell.gauge();
        // Narrower than stockinette, with half as many rows again.
        let found = [width / STITCH_WIDTH, height / ROW_HEIGHT];
        eprintln!("{wide}: {found:?} of stockinette");
        assert!((0.65..0.95).contains(&found[0]) && (0.6..0.8).contains(&found[1]), "{wide}: {found:?}");
        assert!(cell.stretch() < 1.1, "{wide}: {}", cell.stretch());
    }
}

#[test]
fn loops_are_not_held_for_ever() {
    let wrong = |chart: &[&str], stitches: u32, yarn: Option<f64>| {
        let chart = Chart::parse(chart).unwrap();
        Knit { chart, yarn_per_stitch: yarn, ..knit("stockinette", stitches, 4) }.widths().map_err(|e| e.to_string())
    };
    for (chart, told) in [
        (&["sl k"][..], "row 5: stitch 1 is slipped for 5 rows, and a loop of this yarn reaches over 4 at most"),
        (&["k", "k tuck"], "ok"),
        (&["k tuck"], "row 7: stitch 2 is held by slips and tucks for 7 rows"),
        (&["4: k sl", "k"], "ok"),
        (&["5: k sl", "k"], "by `yarn_per_stitch`"),
        (&["6: k tuck", "k"], "ok"),
        (&["slwyif k", "k slwyif"], "ok"),
    ] {
        match wrong(chart, 8, None) {
            Ok(_) => assert_eq!(told, "ok", "{chart:?}"),
            Err(error) => assert!(error.contains(told), "{chart:?}: {error}"),
        }
    }
    // What the hint proposes fits.
    assert!(wrong(&["5: k sl", "k"], 8, Some(1.18 * YARN_PER_STITCH)).is_ok());
}

#[test]
fn what_does_not_hold_together_is_told() {
    let chart = Chart::parse(&["c8f"]).unwrap();
    let wrong = Knit { chart, ..knit("stockinette", 8, 4) }.strands(1.0).unwrap_err();
    assert!(
        wrong.problem.contains("do not hold each other") && wrong.hint.contains("at least 7 plain rows"),
        "{wrong}"
    );
}

/// One decrease far above does not change the size of the stitches below it: a piece that has no repeat is as wide and high as plain
/// stockinette is.
#[test]
fn shaping_does_not_change_the_gauge() {
    let piece = |chart: &[&str], form: Form| Knit {
        chart: Chart::parse(chart).unwrap(),
        stitches: 22,
        rows: 24,
        form,
        ..knit("stockinette", 22, 24)
    };
    for form in [Form::Flat, Form::Tube] {
        let plain = piece(&["24: k"], form.clone()).gauge();
        for chart in [
            &["20: k", "k10 k2tog k10", "3: k"],
            &["20: k", "k10 kfb k11", "3: k"],
            &["10: k", "k9 bo4 k9", "k9 co4 k9"],
        ] {
            let gauge = piece(chart, form.clone()).gauge();
            for (own, plain) in gauge.iter().zip(plain) {
                assert!((own / plain - 1.0).abs() < 0.01, "{chart:?} {form:?}: {gauge:?} beside {plain}");
            }
        }
    }
}

/// A welt of ribbing is drawn in, and stockinette above it is as wide as it is by itself.
#[test]
fn sections_are_as_wide_as_their_stitches() {
    let alone = |pattern: &str| knit(pattern, 20, 20).gauge()[0];
    let (rib, plain) = (alone("rib2x2"), alone("stockinette"));
    for (chart, form) in [
        (["16: k2 p2", "16: k"], Form::Flat),
        (["16: k2 p2", "16: k"], Form::Tube),
        (["16: k2 p2", "10: k"], Form::Flat),
    ] {
        let piece = Knit {
            chart: Chart::parse(&chart).unwrap(),
            stitches: 24,
            rows: chart.iter().map(|line| line[..2].parse::<u32>().unwrap()).sum(),
            form: form.clone(),
            ..knit("stockinette", 24, 32)
        };
        let made = piece.knitted(1.0).unwrap();
        let last = made.widths.len() - 1;
        assert!((made.widths[4] / rib - 1.0).abs() < 0.02, "{form:?}: {} of {rib}", made.widths[4]);
        assert!((made.widths[last - 2] / plain - 1.0).abs() < 0.02, "{form:?}: {} of {plain}", made.widths[last - 2]);
        // The yarns themselves are so wide, within a stitch and the loops of both sides.
        let wide = |rows: std::ops::Range<f32>| {
            let points = made.strands.iter().flat_map(|s| s.curve.points.iter().zip(&s.coordinates));
            let of_rows =
                points.filter(|(_, at)| rows.contains(&at[1]) && (2.0..22.0).contains(&at[0])).map(|(p, _)| p.x);
            of_rows.fold([f64::MAX, f64::MIN], |[a, b], x| [a.min(x), b.max(x)])
        };
        let ratio = |rows| {
            let [from, to] = wide(rows);
            to - from
        };
        let (welt, body) = (ratio(3.0..10.0), ratio(22.0..25.0));
        assert!((0.55..0.8).contains(&(welt / body)), "{form:?}: a welt {welt} wide below {body}");
    }
}
