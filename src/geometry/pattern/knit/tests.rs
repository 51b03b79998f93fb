use super::super::overlap::{Overlap, overlap};
use super::*;

fn knit(pattern: &str, stitches: u32, rows: u32) -> Knit {
    Knit {
        chart: Chart::named(pattern).unwrap(),
        stitches,
        rows,
        form: Form::Flat,
        stitch_width: None,
        row_height: None,
        yarn_per_stitch: YARN_PER_STITCH,
        points: POINTS,
    }
}

/// Of strands of diameter 1.
fn measured(strands: &[PatternStrand]) -> Overlap {
    let radii: Vec<Vec<f64>> = strands.iter().map(|s| vec![0.5; s.curve.points.len()]).collect();
    overlap(strands.iter().zip(&radii).map(|(s, r)| (&s.curve, r.as_slice()))).unwrap()
}

#[test]
fn every_pattern_keeps_its_yarns_apart() {
    for (pattern, _) in super::super::chart::PATTERNS {
        let width = Chart::named(pattern).unwrap().even_width(100).unwrap();
        let stitches = width * 12_u32.div_ceil(width);
        let knit = knit(pattern, stitches, 12);
        let found = measured(&knit.strands(1.0).unwrap());
        let per_stitch = found.length / f64::from(stitches * 12);
        eprintln!("{pattern}: {:?} {found:?}, {per_stitch:.2} per stitch", knit.gauge());
        assert!(found.share <= 0.02, "{pattern}: {found:?}");
        assert!((13.0..15.0).contains(&per_stitch), "{pattern}: {per_stitch}");
        // Loops touch: else it would not be cloth.
        assert!(found.nearest < 1.03, "{pattern}: {found:?}");
    }
}

#[test]
fn stockinette_has_the_proportions_of_real_knits() {
    let strands = knit("stockinette", 10, 10).strands(2.0).unwrap();
    let at = |row: usize, stitch: usize| strands[row].curve.points[stitch * POINTS as usize];
    assert!((at(4, 5).distance(at(4, 4)) / 2.0 - STITCH_WIDTH).abs() < 1e-9);
    assert!((at(5, 4).distance(at(4, 4)) / 2.0 - ROW_HEIGHT).abs() < 1e-9);
    let low = strands.iter().flat_map(|s| &s.curve.points).map(|p| p.z).fold(f64::MAX, f64::min);
    let high = strands.iter().flat_map(|s| &s.curve.points).map(|p| p.z).fold(f64::MIN, f64::max);
    // The cloth is two to three yarns thick.
    assert!((2.0..3.2).contains(&((high - low) / 2.0 + 1.0)), "{low} {high}");
}

#[test]
fn ribs_are_narrower_and_garter_stitch_is_shorter() {
    let gauge = |pattern| knit(pattern, 8, 8).gauge();
    assert_eq!(gauge("stockinette"), [STITCH_WIDTH, ROW_HEIGHT]);
    assert_eq!(gauge("seed"), [STITCH_WIDTH, ROW_HEIGHT]);
    assert!(gauge("rib1x1")[0] < gauge("rib2x2")[0] && gauge("rib2x2")[0] < STITCH_WIDTH);
    assert!(gauge("garter")[1] < ROW_HEIGHT && gauge("rib1x1")[1] == ROW_HEIGHT);
}

/// Whether `upper` passes in front, at each place where two courses cross as seen along z, with the place's wale.
fn crossings(lower: &[DVec3], upper: &[DVec3], points: usize) -> Vec<(f64, bool)> {
    let mut found = Vec::new();
    for (i, a) in lower.windows(2).enumerate() {
        for b in upper.windows(2) {
            let (d, e, r) = ((a[1] - a[0]).truncate(), (b[1] - b[0]).truncate(), (b[0] - a[0]).truncate());
            let det = d.perp_dot(e);
            let (s, t) = (r.perp_dot(e) / det, r.perp_dot(d) / det);
            if (0.0..1.0).contains(&s) && (0.0..1.0).contains(&t) {
                let front = b[0].lerp(b[1], t).z > a[0].lerp(a[1], s).z;
                found.push(((i as f64 + s) / points as f64, front));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

#[test]
fn loops_hold_each_other() {
    for (pattern, front_at_head) in
        [("stockinette", [true, true]), ("reverse-stockinette", [false, false]), ("rib1x1", [true, false])]
    {
        let strands = knit(pattern, 8, 8).strands(1.0).unwrap();
        let found = crossings(&strands[3].curve.points, &strands[4].curve.points, POINTS as usize);
        // Inside, away from the ends: in each stitch the new loop is behind both legs of the old one and in front of its
        // head (and the other way round for purl), twice each.
        for stitch in 2..6 {
            let own: Vec<bool> = found
                .iter()
                .filter(|(wale, _)| (f64::from(stitch)..f64::from(stitch + 1)).contains(wale))
                .map(|(_, front)| *front)
                .collect();
            let head = front_at_head[stitch as usize % 2];
            assert_eq!(own, [!head, head, head, !head], "{pattern}, stitch {stitch}");
        }
    }
}

#[test]
fn a_tube_is_closed_and_its_courses_lie_in_their_wales() {
    let knit = Knit { form: Form::Tube, ..knit("rib2x2", 40, 6) };
    let strands = knit.strands(1.5).unwrap();
    assert_eq!(strands.len(), 6);
    for s in &strands {
        assert!(s.curve.closed && s.kind == StrandKind::Course);
        assert_eq!((s.curve.points.len(), s.coordinates.len()), (40 * POINTS as usize, 40 * POINTS as usize));
        for (p, [wale, course]) in s.curve.points.iter().zip(&s.coordinates) {
            let turn = p.x.atan2(p.z) / TAU;
            let off = turn - f64::from(*wale) / 40.0;
            assert!((off - off.round()).abs() * 40.0 < 0.6, "{p} {wale}");
            assert!((f64::from(*course) - f64::from(s.index)) >= 0.0 && f64::from(*course) <= f64::from(s.index) + 1.0);
        }
    }
    assert!(measured(&knit.strands(1.0).unwrap()).share <= 0.02);
}

/// A small hat: rib, stockinette, decreases to a crown.
fn hat(stitches: u32) -> Knit {
    let chart = ["4: k2 p2", "3: k", "k6 k2tog", "k", "k5 ssk", "k", "k4 k2tog", "k3 k2tog", "k2 k2tog", "k1 k2tog"];
    let chart = Chart::parse(&chart).unwrap();
    let radius = f64::from(stitches) * 3.6 / TAU;
    let profile = [(1.0, 0.0), (1.0, 15.0), (0.62, 30.0), (0.27, 35.0)].map(|(r, y)| DVec2::new(r * radius, y));
    Knit { rows: chart.rows(), chart, form: Form::Revolution(profile.into()), ..knit("stockinette", stitches, 1) }
}

#[test]
fn a_hat_keeps_its_yarns_apart_and_its_form() {
    let hat = hat(48);
    let strands = hat.strands(1.0).unwrap();
    let found = measured(&strands);
    eprintln!("hat: {found:?}");
    assert!(found.share <= 0.02, "{found:?}");
    assert_eq!(strands.last().unwrap().curve.points.len(), 12 * POINTS as usize);
    let Form::Revolution(profile) = &hat.form else { unreachable!() };
    let widest = strands.iter().flat_map(|s| &s.curve.points).map(|p| p.x.hypot(p.z)).fold(0.0, f64::max);
    assert!((widest - profile[0].x).abs() < 3.0, "{widest} {}", profile[0].x);
}

#[test]
fn the_same_knit_is_the_same_to_the_bit() {
    // Large enough that ropes are relaxed side by side.
    let once = hat(48).strands(1.3).unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let again = pool.install(|| hat(48).strands(1.3).unwrap());
    for (a, b) in once.iter().zip(&again) {
        assert_eq!(a.curve, b.curve);
    }
}

#[test]
fn a_chart_that_does_not_fit_is_an_error() {
    assert!(hat(50).strands(1.0).unwrap_err().problem.starts_with("row 8 repeats over 8 stitches"));
    let chart = Chart::parse(&["kfb"]).unwrap();
    let grows = Knit { chart, rows: 200, ..knit("stockinette", 5, 1) };
    assert!(grows.strands(1.0).unwrap_err().problem.starts_with("more than"));
}
