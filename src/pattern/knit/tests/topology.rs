//! Which loop passes through which, measured on yarns and not on what was meant: as they are laid, by linking numbers; and
//! from there on no yarn may pass through another.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::{
    super::{
        loops::{Border, Loops, Visit},
        piece::follow::threaded,
        shape::bobble,
    },
    *,
};
use crate::{
    geometry::curve::{Basis, Curve},
    pattern::rods::passing::passed,
};

/// How a way is linked with a ring: how often it passes the ring towards the front less towards the back. The ring is closed far
/// below, the way far above, and crossings are counted as seen from the front (Gauss' linking number as a sum of signs where
/// the way is in front).
pub(super) fn linked(ring: &[DVec3], way: &[DVec3]) -> i32 {
    const FAR: f64 = 1e3;
    let closed = |line: &[DVec3], by: f64| -> Vec<DVec3> {
        let (first, last) = (line[0], line[line.len() - 1]);
        let far = [last, first].map(|p| DVec3::new(p.x, by, p.z));
        line.iter().copied().chain(far).chain([first]).collect()
    };
    // Heads of one height may meet in a point as seen from the front.
    const ASIDE: DVec3 = DVec3::new(1.3e-3, 0.7e-3, 0.0);
    let (ring, way) = (closed(ring, -FAR), closed(&way.iter().map(|p| *p + ASIDE).collect::<Vec<_>>(), FAR));
    let mut sum = 0;
    for a in ring.windows(2) {
        for b in way.windows(2) {
            let (u, v, w) = ((a[1] - a[0]).truncate(), (b[1] - b[0]).truncate(), (b[0] - a[0]).truncate());
            let turn = u.perp_dot(v);
            if turn == 0.0 {
                continue;
            }
            let (s, t) = (w.perp_dot(v) / turn, w.perp_dot(u) / turn);
            if (0.0..1.0).contains(&s) && (0.0..1.0).contains(&t) {
                let (below, above) = (a[0].z + s * (a[1].z - a[0].z), b[0].z + t * (b[1].z - b[0].z));
                sum += if above < below {
                    0
                } else if turn > 0.0 {
                    1
                } else {
                    -1
                };
            }
        }
    }
    sum
}

/// How often the yarn passes a loop, net, on its way from the head of one loop to that of the next in its row: by the loop
/// passed, the course and the visit that the way leads to.
type Passes = BTreeMap<(u32, usize, usize), i32>;

/// The loops of a course, as their visits.
fn visits_of(loops: &Loops, course: usize) -> Vec<(usize, u32)> {
    let visits = loops.courses[course].visits.iter().enumerate();
    visits.filter_map(|(k, (_, v))| if let Visit::Loop(i) = v { Some((k, *i)) } else { None }).collect()
}

/// The way of a course from the head of visit `from` to that of `end`.
fn way(cell: &Cell, course: usize, from: usize, end: usize) -> Vec<DVec3> {
    let mut way: Vec<DVec3> = Vec::new();
    for k in from..=end {
        let points: Vec<DVec3> = cell.visit(course, k).map(|(p, _)| p).collect();
        let half = points.len() / 2;
        way.extend(match k {
            k if k == from && k == end => &points[..],
            k if k == from => &points[half..],
            k if k == end => &points[..=half],
            _ => &points[..],
        });
    }
    way
}

/// What the chart says: a loop is passed towards the front on the way to a knit stitch, towards the back on the way from it;
/// the other way round for purl; and a twisted loop turns its back.
fn expected(loops: &Loops) -> Passes {
    let mut sums = Passes::new();
    for (parent, child) in loops.links() {
        let (p, c) = (&loops.loops[parent as usize], &loops.loops[child as usize]);
        // In and out three times: not linked in the end.
        if c.bobble {
            continue;
        }
        let sign = c.sign as i32 * if p.twist == 0.0 { 1 } else { -1 };
        let course = loops.courses.iter().position(|course| course.row == c.row).unwrap();
        let row = visits_of(loops, course);
        let n = row.iter().position(|(_, i)| *i == child).unwrap();
        *sums.entry((parent, course, row[n].0)).or_default() += sign;
        *sums.entry((parent, course, row[(n + 1) % row.len()].0)).or_default() -= sign;
    }
    sums.retain(|_, sum| *sum != 0);
    sums
}

/// The links of loops with ways of later rows, and of their own row two stitches away or more.
fn links_of(cell: &Cell, loops: &Loops) -> Passes {
    let mut found = Passes::new();
    let high = cell.high as i32;
    let visit = |c: usize, k: usize| cell.visit(c, k).map(|(p, _)| p).collect::<Vec<DVec3>>();
    for c in 0..loops.courses.len() {
        for (k, i) in visits_of(loops, c) {
            let mut ring = visit(c, k);
            ring.extend(visit(c, k + 1).first());
            for d in 0..loops.courses.len() {
                let row = visits_of(loops, d);
                let count = loops.courses[d].visits.len();
                for (n, &(to, _)) in row.iter().enumerate() {
                    let (from, end) = if n > 0 { (row[n - 1].0, to) } else { (row[row.len() - 1].0, to + count) };
                    let way = way(cell, d, from, end);
                    let mut sum = 0;
                    for (x, y) in (-2..=2).flat_map(|x| (0..=2).map(move |y| (x, y))) {
                        let later = d as i32 + y * high - c as i32;
                        let beside = [from, end].iter().any(|v| (x * count as i32 + *v as i32 - k as i32).abs() <= 2);
                        if later < 0 || (later == 0 && beside) {
                            continue;
                        }
                        let by = DVec3::new(f64::from(x) * cell.period.x, f64::from(y) * cell.period.y, 0.0);
                        sum += linked(&ring, &way.iter().map(|p| *p + by).collect::<Vec<_>>());
                    }
                    if sum != 0 {
                        found.insert((i, d, to), sum);
                    }
                }
            }
        }
    }
    found
}

/// The chart as it relaxes, which is drawn as it says.
#[track_caller]
fn drawn(name: &str, rows: &[&str], wide: u32) -> Cell {
    let chart = Chart::parse(rows).unwrap();
    let rows = chart.work(wide, chart.rows(), 10_000).unwrap();
    let loops = Loops::new(&rows, wide as usize, Border::cell(wide as usize));
    let laid = Cell::laid(&rows, &loops, YARN_PER_STITCH, [None; 2]);
    let (expected, found) = (expected(&loops), links_of(&laid, &loops));
    let keys: BTreeSet<_> = expected.keys().chain(found.keys()).collect();
    let differ: Vec<_> = keys.into_iter().filter(|k| found.get(k) != expected.get(k)).collect();
    for key in &differ {
        eprintln!("{name}: {key:?} is {:?}, not {:?}", found.get(key), expected.get(key));
    }
    assert!(differ.is_empty(), "{name}: {} of {} differ", differ.len(), expected.len());
    let mut relaxed = None;
    let relax = || relaxed = Some(Cell::of_rows(&rows, YARN_PER_STITCH, POINTS, [None; 2]));
    assert_eq!(passed(relax), 0, "{name}: yarns passed through each other");
    relaxed.unwrap()
}

/// Charts in which every stitch stands beside others, with stitches of their cell.
fn all_drawn(charts: &[(&[&str], u32)]) {
    charts.iter().for_each(|(rows, wide)| drop(drawn(&rows.join(" / "), rows, *wide)));
}

#[test]
fn stitches_and_decreases() {
    all_drawn(&[
        (&["k3"], 3),
        (&["p3"], 3),
        (&["k p", "p k"], 4),
        (&["k2 p2"], 4),
        (&["k3", "p3"], 3),
        (&["ktbl2"], 4),
        (&["ktbl ptbl", "k p"], 4),
        (&["k3", "k2tog yo k"], 3),
        (&["k3", "yo ssk k"], 3),
        (&["k4", "yo p2tog k2"], 4),
        (&["p3", "yo ssp p"], 3),
        (&["k4", "k yo k3tog yo"], 4),
        (&["k4", "k yo sssk yo"], 4),
        (&["k4", "k yo cdd yo"], 4),
        (&["p4", "p yo p3tog yo"], 4),
        (&["p4", "p yo sssp yo"], 4),
        (&["p4", "p yo cddp yo"], 4),
    ]);
}

#[test]
fn increases_slips_and_tucks() {
    all_drawn(&[
        (&["k3 kfb", "k3 k2tog"], 4),
        (&["k4", "k2 m1l k2tog"], 4),
        (&["k4", "k2 m1r k2tog"], 4),
        (&["p3 pfb", "p3 p2tog"], 4),
        (&["p4", "p2 m1lp p2tog"], 4),
        (&["p4", "p2 m1rp p2tog"], 4),
        (&["k4", "k2 m1rp k2tog"], 4),
        (&["k5", "k2tog k2 m1lp k"], 5),
        (&["k5", "k3tog yo k m1l k"], 5),
        (&["k3 p3", "k2tog m1l k p2tog m1r p"], 6),
        (&["k sl", "k2"], 4),
        (&["k4", "k sl k slwyif"], 4),
        // Linen stitch, and its back.
        (&["slwyif k", "k slwyif"], 4),
        (&["p sl", "sl p"], 4),
        (&["k2 slwyif2", "slwyif2 k2"], 4),
        (&["slwyif2 k", "k slwyif2", "k3"], 6),
        (&["k tuck", "tuck p"], 4),
    ]);
}

#[test]
fn strands_lifted_between_knit_and_purl() {
    all_drawn(&[
        (&["k3 p3", "k2tog k m1l p3"], 6),
        (&["k3 p3", "k2tog k m1r p3"], 6),
        (&["k3 p3", "k2tog k m1lp p3"], 6),
        (&["k3 p3", "k2tog k m1rp p3"], 6),
        (&["p3 k3", "p2tog p m1l k3"], 6),
        (&["p3 k3", "p2tog p m1rp k3"], 6),
        (&["k3 p3", "k3 m1l p2tog p"], 6),
        (&["k3 p3", "k3 m1r p2tog p"], 6),
        (&["p3 k3", "p3 m1l k2tog k"], 6),
        (&["p3 k3", "p3 m1rp k2tog k"], 6),
    ]);
}

/// Of a relaxed cell as yarns two periods wide and high: their overlap, and how far they fold.
fn measured_cell(cell: &Cell) -> (Overlap, f64) {
    let strand = |row: usize| {
        let count = cell.visits[row % cell.high as usize].len() - 1;
        let points: Vec<DVec3> = (0..2 * count).flat_map(|k| cell.visit(row, k)).map(|(p, _)| p).collect();
        let curve = Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening: None };
        PatternStrand { coordinates: Vec::new(), kind: StrandKind::Course, index: row as u32, share: 1.0, curve }
    };
    let strands: Vec<_> = (0..2 * cell.high as usize).map(strand).collect();
    (measured(&strands), deepest_fold(&strands))
}

#[test]
fn wide_cables_lie_flat_over_each_other() {
    let charts: [(&[&str], u32); 5] = [
        (&["p k8 p", "p c8f p", "4: p k8 p"], 10),
        (&["p k16 p", "p c8b c8f p", "6: p k16 p"], 18),
        (&["p k12 p", "p c8f k4 p", "4: p k12 p", "p k4 c8b p", "3: p k12 p"], 14),
        (&["p k10 p", "p c10f p", "6: p k10 p"], 12),
        (&["p k12 p", "p c12b p", "8: p k12 p"], 14),
    ];
    // Side by side, for each takes seconds.
    charts.par_iter().for_each(|(rows, wide)| {
        let cell = drawn(&rows.join(" / "), rows, *wide);
        let (overlap, fold) = measured_cell(&cell);
        let z = || cell.rods.points.iter().map(|p| p.z);
        let thick = 1.0 + z().fold(f64::MIN, f64::max) - z().fold(f64::MAX, f64::min);
        eprintln!("{rows:?}: {overlap:?}, {fold:.2}, {thick:.1}");
        assert!(overlap.share < 0.05 && overlap.deepest < 0.1 && fold == 0.0, "{rows:?}: {overlap:?} {fold}");
        // Two cloths over each other are about six yarns thick; strands that stand on edge are ten.
        assert!(thick < 9.0, "{rows:?}: {thick}");
    });
}

#[test]
fn cables() {
    all_drawn(&[
        (&["k3", "k 1/1lc"], 3),
        (&["k3 p", "2/1rc p"], 4),
        (&["k6", "k c4f k", "2: k6"], 6),
        (&["k6", "k c4b k", "2: k6"], 6),
        (&["p k3 p", "p t3f p", "p2 k2 p", "p t3b p"], 5),
        (&["p k2 p", "1/1lpc 1/1rpc", "k p2 k", "1/1rpc 1/1lpc"], 4),
        (&["p k6 p", "p c6b p", "4: p k6 p"], 8),
        (&["k8", "4/4lc", "2: k8"], 8),
    ]);
}

#[test]
fn bobbles() {
    all_drawn(&[
        (&["k5", "k2 mb k2", "2: k5"], 5),
        (&["p5", "p2 mb p2", "2: p5"], 5),
        (&["4: k6", "mb k5", "3: k6", "k3 mb k2"], 6),
        (&["k6", "k4 mb k", "k ssk yo k3", "2: k6"], 6),
    ]);
}

/// The loops of a bobble, by their numbers in the order of the yarn: 0 to 4 out of the stitch below, 5 to 9 on the way back,
/// 10 through these.
#[test]
fn loops_of_a_bobble_are_drawn_as_they_are_knitted() {
    let chart = Chart::parse(&["k5", "k2 mb k2", "2: k5"]).unwrap();
    let rows = chart.work(5, 4, 100).unwrap();
    let loops = Loops::new(&rows, 5, Border::cell(5));
    let pieces = loops.pieces();
    let line = |row: usize, k: usize| -> Vec<DVec3> {
        pieces[row][k].places.iter().map(|p| DVec3::new(p.at * 4.4, p.up * 3.5 * loops.room(), p.out)).collect()
    };
    let (below, before, own, after) = (line(0, 2), line(1, 1), line(1, 2), line(1, 3));
    let parts = bobble::loops();
    let middle = |r: &std::ops::Range<usize>| (r.start + r.end) / 2;
    // From the head of one loop to that of the next: to number n.
    let mut ways: Vec<Vec<DVec3>> = vec![[&before[before.len() / 2..], &own[..=middle(&parts[0])]].concat()];
    ways.extend(parts.windows(2).map(|w| own[middle(&w[0])..=middle(&w[1])].to_vec()));
    ways.push([&own[middle(&parts[10])..], &after[..=after.len() / 2]].concat());
    // Three knit stitches of one, and what is laid over the needle between them.
    let mut expected: BTreeMap<_, _> = (0..6).map(|n| ((11, n), if n % 2 == 0 { 1 } else { -1 })).collect();
    for child in 0..5 {
        // The first on the way back is drawn through the last on the way there.
        expected.extend([((4 - child, 5 + child), 1), ((4 - child, 6 + child), -1)]);
        // Those on the way back go from right to left.
        expected.extend([((5 + child, 10), -1), ((5 + child, 11), 1)]);
    }
    // What comes before a loop and leads from it is not drawn through it.
    let beside = |ring: usize, way: usize| ring < 11 && way <= ring + 1;
    expected.retain(|&(ring, way), _| !beside(ring, way));
    let rings: Vec<Vec<DVec3>> = parts.iter().map(|r| own[r.clone()].to_vec()).chain([below]).collect();
    let mut found = BTreeMap::new();
    for (i, ring) in rings.iter().enumerate() {
        found.extend(
            ways.iter().enumerate().filter(|(n, _)| !beside(i, *n)).map(|(n, way)| ((i, n), threaded(ring, way))),
        );
    }
    found.retain(|_, sum| *sum != 0);
    assert_eq!(found, expected);
}

#[test]
fn patterns_with_a_name() {
    for (name, rows) in PATTERNS {
        let wide = Chart::named(name).and_then(|c| c.even_width(100)).unwrap();
        drawn(name, rows, wide * 3_u32.div_ceil(wide));
    }
}

#[test]
fn strands_of_a_cable_that_pass_in_front_are_in_front() {
    for (rows, front, back) in
        [(&["p k4 p", "p c4f p", "2: p k4 p"][..], 3.5, 1.5), (&["p k4 p", "p c4b p", "2: p k4 p"], 1.5, 3.5)]
    {
        let chart = Chart::parse(rows).unwrap();
        let cell = Cell::relaxed(&chart, 6, YARN_PER_STITCH, POINTS, [None; 2]);
        // Legs of the loops below the crossing, by the middle of their columns.
        let depth = |column: f64| {
            let legs = (0..6).flat_map(|k| cell.visit(0, k));
            let near = |g: &[f32; 2]| (f64::from(g[0]) - column - 0.5).abs() < 1.0 && (0.4..0.7).contains(&g[1]);
            let z: Vec<f64> = legs.filter(|(_, g)| near(g)).map(|(p, _)| p.z).collect();
            z.iter().sum::<f64>() / z.len() as f64
        };
        let (front, back) = (depth(front), depth(back));
        eprintln!("{rows:?}: {front:.2} {back:.2}");
        assert!(front > back + 1.0, "{rows:?}: {front} {back}");
    }
}

#[test]
fn yarns_do_not_pass_each_other_in_pieces() {
    let tube = Knit { form: Form::Tube, ..knit("stockinette", 24, 6) };
    // Cables in a piece that has no repeat.
    let chart = Chart::parse(&["k", "p k4 p k4", "p c4f p c4b", "p k4 p k4", "p k4 k2tog k3", "k", "k"]).unwrap();
    let shaped = Knit { chart, rows: 7, ..knit("stockinette", 10, 1) };
    for (name, piece) in [
        ("flat", knit("stockinette", 8, 6)),
        ("cable", knit("cable", 8, 6)),
        ("brioche", knit("brioche", 10, 8)),
        ("half-cardigan", knit("half-cardigan", 10, 8)),
        ("tube", tube),
        ("hat", hat(24)),
        ("shaped", shaped),
        ("floats", in_colors(&TWO_COLORS, Form::Flat)),
        ("floats in a tube", in_colors(&TWO_COLORS, Form::Tube)),
    ] {
        assert_eq!(passed(|| drop(piece.strands(1.0).unwrap())), 0, "{name}");
    }
}

/// Stitches of a yarn by row, from the cast-on edge, and column.
pub(super) type Stitches = BTreeMap<(i32, i32), Vec<DVec3>>;

/// The yarn of each stitch of a piece of one yarn. `turns` says whether what leads from row to row is of the stitch before it.
pub(super) fn yarn_of_stitches(piece: &Knit, turns: bool) -> Stitches {
    stitches_of(piece, &piece.knitted(1.0).unwrap(), 0, turns)
}

/// What is of each stitch in a yarn of a piece, from left to right. Round pieces are unrolled.
pub(super) fn stitches_of(piece: &Knit, made: &Knitted, yarn: usize, turns: bool) -> Stitches {
    let counts = piece.widths().unwrap();
    let radius = made.gauge[0] * f64::from(piece.stitches) / TAU;
    let unrolled = |p: DVec3, [wale, course]: [f32; 2]| match piece.form {
        Form::Flat => p,
        _ => {
            // The turn nearest to where the stitch belongs.
            let count = if course < 0.0 { piece.stitches } else { counts[(course as usize).min(counts.len() - 1)] };
            let (turn, own) = (p.x.atan2(p.z) / TAU, f64::from(wale) / f64::from(count));
            DVec3::new((turn + (own - turn).round()) * TAU * radius, p.y, p.x.hypot(p.z) - radius)
        }
    };
    let mut stitches = Stitches::new();
    let mut last = [f32::NAN; 2];
    for (p, [wale, course]) in made.strands[yarn].curve.points.iter().zip(&made.strands[yarn].coordinates) {
        if std::mem::replace(&mut last, [*wale, *course]) == [*wale, *course] && !turns {
            continue;
        }
        stitches.entry((course.floor() as i32, wale.floor() as i32)).or_default().push(unrolled(*p, [*wale, *course]));
    }
    for own in stitches.values_mut().filter(|own| own[0].x > own[own.len() - 1].x) {
        own.reverse();
    }
    stitches
}

/// How a loop's yarn passes the one that it is drawn through, on its way there and on its way back.
fn held(stitches: &Stitches, (r, k): (i32, i32)) -> [i32; 2] {
    let of = |r: i32, k: i32| stitches[&(r, k)].as_slice();
    let ring = [of(r - 1, k), &of(r - 1, k + 1)[..1]].concat();
    let [before, own, after] = [k - 1, k, k + 1].map(|k| of(r, k));
    let half = own.len() / 2;
    let to = [&before[before.len() / 2..], &own[..=half]].concat();
    let from = [&own[half..], &after[..=after.len() / 2]].concat();
    [threaded(&ring, &to), threaded(&ring, &from)]
}

/// Stitches that are not drawn through what the chart says, away from the sides.
fn undrawn(piece: &Knit) -> Vec<(i32, i32)> {
    let (rows, stitches) = (piece.worked().unwrap(), yarn_of_stitches(piece, true));
    let is_drawn = |r: i32, k: i32| {
        // Cast-on loops are twisted.
        let sign = if rows[r as usize][k as usize].purl == (r > 0) { -1 } else { 1 };
        held(&stitches, (r, k)) == [sign, -sign]
    };
    let all = (0..rows.len() as i32).flat_map(|r| (2..piece.stitches as i32 - 2).map(move |k| (r, k)));
    all.filter(|&(r, k)| !is_drawn(r, k)).collect()
}

#[test]
fn pieces_are_drawn_through_each_other_from_edge_to_edge() {
    for (pattern, form, stitches) in [
        ("stockinette", Form::Flat, 10),
        ("rib2x2", Form::Flat, 16),
        ("rib1x1", Form::Flat, 10),
        ("seed", Form::Flat, 10),
        ("stockinette", Form::Tube, 24),
        ("rib2x2", Form::Tube, 32),
        ("rib1x1", Form::Tube, 32),
    ] {
        let piece = Knit { form: form.clone(), ..knit(pattern, stitches, 6) };
        let passes = passed(|| drop(piece.strands(1.0).unwrap()));
        let undrawn = undrawn(&piece);
        assert!(passes == 0 && undrawn.is_empty(), "{pattern} {form:?}: {passes} passes, {undrawn:?}");
    }
}

/// How the bind-off passes each loop of the last row, away from the sides.
fn bound_off(piece: &Knit) -> Vec<[i32; 2]> {
    let stitches = yarn_of_stitches(piece, true);
    (2..piece.stitches as i32 - 2).map(|k| held(&stitches, (piece.rows as i32, k))).collect()
}

#[test]
fn the_bind_off_holds_each_loop_of_the_last_row() {
    for (pattern, form, stitches) in [
        ("stockinette", Form::Flat, 10),
        ("rib1x1", Form::Flat, 12),
        ("rib2x2", Form::Flat, 16),
        ("seed", Form::Flat, 12),
        ("garter", Form::Flat, 10),
        ("stockinette", Form::Tube, 24),
        ("rib1x1", Form::Tube, 32),
        ("rib2x2", Form::Tube, 32),
        ("seed", Form::Tube, 24),
    ] {
        // Flat pieces end on either side of the cloth.
        let rows: &[u32] = if form.is_round() { &[6] } else { &[6, 7] };
        for &rows in rows {
            let piece = Knit { form: form.clone(), ..knit(pattern, stitches, rows) };
            let next = piece.chart.work(stitches, rows + 1, 1000).unwrap().pop().unwrap();
            let mut held = Vec::new();
            let passes = passed(|| held = bound_off(&piece));
            // To the front through a knit stitch, to the back through a purl one.
            let sign = |k: usize| if next[k + 2].purl { -1 } else { 1 };
            let wrong: Vec<usize> = (0..held.len()).filter(|&k| held[k] != [sign(k), -sign(k)]).collect();
            assert!(
                passes == 0 && wrong.is_empty(),
                "{pattern} {form:?} {rows}: {passes} passes, {wrong:?} of {held:?}"
            );
        }
    }
}

#[test]
fn tucks_leave_chains_at_the_sides() {
    let stitches = yarn_of_stitches(&knit("brioche", 10, 8), true);
    for r in [0, 2, 4] {
        let ring = [&stitches[&(r, 0)][..], &stitches[&(r, 1)][..1]].concat();
        let through = |r: i32| threaded(&ring, &stitches[&(r, 0)][..stitches[&(r, 0)].len() / 2]);
        assert_eq!((through(r + 1), through(r + 2)), (0, 1), "row {r}");
    }
}

#[test]
fn slipped_sides_are_chains() {
    let piece = Knit { edges: Edges::Slipped, ..knit("stockinette", 10, 9) };
    assert_eq!(passed(|| drop(piece.strands(1.0).unwrap())), 0);
    assert_eq!(undrawn(&piece), []);
    let stitches = yarn_of_stitches(&piece, true);
    // Rows that begin on the left slip their first stitch, and the next one is drawn through that of the row before.
    for r in [1, 3, 5] {
        let ring = [&stitches[&(r, 0)][..], &stitches[&(r, 1)][..1]].concat();
        let through = |r: i32| threaded(&ring, &stitches[&(r, 0)][..stitches[&(r, 0)].len() / 2]);
        assert_eq!((through(r + 1), through(r + 2)), (0, 1), "row {r}");
    }
    let found = measured(&piece.strands(1.0).unwrap());
    assert!(found.share <= 0.02, "{found:?}");
    let tube = Knit { form: Form::Tube, ..piece };
    assert!(tube.strands(1.0).unwrap_err().problem.contains("sides"));
}
