//! Tops that are drawn together and the cable cast-on: what goes through what, and that nothing is left open.

use super::{super::piece::follow::threaded, *};
use crate::pattern::rods::passing::passed;

/// The points of one yarn with their wale and course.
fn yarn(piece: &Knit) -> Vec<(DVec3, [f32; 2])> {
    let mut strands = Vec::new();
    let passes = passed(|| strands = piece.strands(1.0).unwrap());
    let found = measured(&strands);
    eprintln!("{passes} passes, {found:?}");
    assert!(passes == 0 && strands.len() == 1 && found.share <= 0.05, "{} {found:?}", strands.len());
    strands[0].curve.points.iter().copied().zip(strands[0].coordinates.iter().copied()).collect()
}

/// The points of a stitch, or of a part of one.
fn part(yarn: &[(DVec3, [f32; 2])], row: i32, of: impl Fn([f32; 2]) -> bool) -> Vec<DVec3> {
    // What leads from row to row, and tails, are of no stitch.
    let own = yarn.windows(2).filter(|w| w[0].1 != w[1].1).map(|w| w[1]);
    own.filter(|(_, g)| g[1].floor() as i32 == row && of(*g)).map(|(p, _)| p).collect()
}

fn drawn() -> [Knit; 2] {
    let top = Rims { top: Closing::Drawn, ..Rims::default() };
    let tube = Knit { form: Form::Tube, rims: top, ..knit("stockinette", 16, 12) };
    let chart = ["6: k", "k4 k2tog", "k", "k3 k2tog", "k2 k2tog", "k k2tog", "k2tog"];
    let chart = Chart::parse(&chart).unwrap();
    let radius = 36.0 * 4.1 / TAU;
    let profile =
        [(1.0, 0.0), (1.0, 12.0), (0.8, 22.0), (0.4, 30.0), (0.2, 32.0)].map(|(r, y)| DVec2::new(r * radius, y));
    [
        tube,
        Knit {
            rows: chart.rows(),
            chart,
            form: Form::Revolution(profile.into()),
            rims: top,
            ..knit("stockinette", 36, 1)
        },
    ]
}

#[test]
fn the_yarn_goes_once_through_all_loops_that_it_draws_together() {
    for piece in drawn() {
        let widths = piece.widths().unwrap();
        let (last, count) = (widths.len() as i32 - 1, *widths.last().unwrap());
        let yarn = yarn(&piece);
        let way: Vec<DVec3> = yarn.iter().filter(|(_, g)| g[1] >= (last + 1) as f32).map(|(p, _)| *p).collect();
        let through = |k: u32| {
            let mut ring = part(&yarn, last, |g| g[0].floor() as u32 == k);
            ring.extend(part(&yarn, last, |g| g[0].floor() as u32 == k + 1).first());
            threaded(&ring, &way)
        };
        let through: Vec<i32> = (0..count).map(through).collect();
        assert!(through.iter().all(|t| *t == through[0] && t.abs() == 1), "{through:?}");
    }
}

#[test]
fn what_is_drawn_together_is_closed_and_its_tail_is_inside() {
    for piece in drawn() {
        let yarn = yarn(&piece);
        let high = yarn.iter().map(|(p, _)| p.y).fold(f64::MIN, f64::max);
        let top = yarn.iter().filter(|(p, _)| p.y > high - 4.0).map(|(p, _)| p.x.hypot(p.z)).fold(f64::MAX, f64::min);
        let (end, _) = yarn[yarn.len() - 1];
        eprintln!("nearest to the axis {top:.2}, the tail ends {:.2} below the top", high - end.y);
        // As many heads side by side leave such a ring.
        let count = f64::from(*piece.widths().unwrap().last().unwrap());
        assert!(top < count / TAU + 0.3, "{top}");
        let widest = yarn.iter().map(|(p, _)| p.x.hypot(p.z)).fold(0.0, f64::max);
        assert!(end.x.hypot(end.z) < widest - 1.5 && end.y < high - 2.5, "{end}");
    }
}

#[test]
fn what_cannot_be_drawn_together_is_told() {
    let [tube, _] = drawn();
    let problem = |piece: Knit| piece.strands(1.0).unwrap_err().problem;
    let flat = problem(Knit { form: Form::Flat, ..tube.clone() });
    assert_eq!(flat, "only the last row of a finished tube or revolution is drawn together");
    assert_eq!(problem(Knit { stitches: 40, ..tube.clone() }), "40 stitches of the last row cannot be drawn together");
    assert_eq!(problem(Knit { rows: 2, ..tube }), "a tube of 2 rows is too short to be drawn together");
}

/// Every loop is wound around by the yarn that goes on to the next one.
#[test]
fn loops_of_a_cable_cast_on_come_from_between_the_two_before_them() {
    let cable = Rims { cast_on: CastOn::Cable, ..Rims::default() };
    let turned = Chart::parse(&["-3 k9", "-3 k9", "k", "k", "k"]).unwrap();
    let turned = Knit { chart: turned, rows: 5, rims: cable, ..knit("stockinette", 12, 1) };
    let flat = Knit { rims: cable, ..knit("stockinette", 12, 6) };
    let tube = Knit { form: Form::Tube, rims: cable, ..knit("rib1x1", 24, 6) };
    for (name, piece, sign) in [("flat", flat, 1), ("from the left", turned, -1), ("tube", tube, 1)] {
        let yarn = yarn(&piece);
        let wound = |k: i32| {
            let of = |k: i32, low: bool, right: bool| {
                part(&yarn, -1, move |g| {
                    let (own, share) = (g[0].floor() as i32 == k, g[0].fract());
                    own && (low == (g[1] < -0.9)) && (right == (share > 0.5))
                })
            };
            // From the loop on the left before its neighbour and behind it; cast on from the left, the other way round.
            let (from, around) = if sign > 0 { (k, k + 1) } else { (k + 1, k) };
            let mut ring = [of(from, true, sign > 0), of(around, true, sign < 0)];
            let mut leg = of(around, false, sign > 0);
            // From the foot of the one to that of the other, and from the head down.
            ring.iter_mut().chain([&mut leg]).for_each(|part| part.reverse());
            leg.extend(leg.last().map(|p| *p - DVec3::Y * 4.0));
            threaded(&ring.concat(), &leg)
        };
        let wound: Vec<i32> = (2..piece.stitches as i32 - 3).map(wound).collect();
        assert!(wound.iter().all(|w| *w == wound[0] && w.abs() == 1), "{name}: {wound:?}");
    }
}

/// Bound off, the yarn's end comes up out of the last stitch and bends nowhere as tightly as a loop that is not there would.
#[test]
fn the_last_loop_is_drawn_out() {
    for (pattern, stitches) in [("stockinette", 12), ("garter", 12), ("cable", 16)] {
        let knit = Knit { yarn_per_stitch: Some(14.5), ..knit(pattern, stitches, 9) };
        let strands = knit.strands(1.0).unwrap();
        let points = &strands[0].curve.points;
        let end = &points[points.len() - 2 * POINTS as usize..];
        // The radius of the circle through three points.
        let radius = |p: &[DVec3]| {
            let [a, b, c] = [p[1] - p[0], p[2] - p[1], p[0] - p[2]];
            a.length() * b.length() * c.length() / (2.0 * a.cross(b).length()).max(1e-9)
        };
        let least = end.windows(3).map(radius).fold(f64::MAX, f64::min);
        assert!(least > 0.6, "{pattern}: a bend of {least} diameters");
        let highest = points.iter().map(|p| p.y).fold(f64::MIN, f64::max);
        assert!(highest - points[points.len() - 1].y < 1e-9, "{pattern}: the end hangs down");
    }
}
