//! Panels that are sewn together.

use super::*;
use crate::geometry::spline::evaluate;

/// Two panels that meet at 80 mm along an axis, sewn: the yarns of each panel, and those of the seam.
pub(super) fn sewn(tile: &Tile, axis: usize, seam: SeamKind) -> [Vec<LaidYarn>; 3] {
    let mut text = String::new();
    sheet(&mut text, "first", 8, 8, 10.0, 0.0, &|u, v| DVec3::new(u, v, 0.0));
    sheet(&mut text, "second", 8, 8, 10.0, 200.0, &|u, v| DVec3::new(u, v, 0.0) + 80.0 * DVec3::AXES[axis]);
    let mesh = GarmentMesh::parse(&text).unwrap();
    let (_, yarns) = laid(&mesh, Options { seam, ..options(tile.clone()) });
    let mut out = [const { Vec::new() }; 3];
    for yarn in yarns {
        let middle = yarn.points.iter().sum::<DVec3>() / yarn.points.len() as f64;
        let of_cloth = (2.0 * yarn.radius - tile.diameter()).abs() < 1e-9;
        // What finishes free edges goes round both.
        match yarn.closed {
            true => {}
            false => out[if of_cloth { usize::from(middle[axis] > 80.0) } else { 2 }].push(yarn),
        }
    }
    out
}

/// Places along yarns, close to each other.
fn along(yarns: &[LaidYarn]) -> Vec<DVec3> {
    let segment = |w: &[DVec3]| {
        let points = [w[0], w[1], w[2], w[3]].map(|p| p.extend(0.0));
        (0..6).map(move |k| evaluate(Basis::BSpline, points, f64::from(k) / 6.0).at.truncate())
    };
    yarns.iter().flat_map(|yarn| yarn.points.windows(4).flat_map(segment)).collect()
}

/// The distance of both panels' middle lines, the least in each stitch along the seam, in diameters.
fn distances(panels: [&[DVec3]; 2], tile: &Tile, axis: usize) -> Vec<f64> {
    let near = |p: &&DVec3| (p[axis] - 80.0).abs() < 6.0;
    let [first, second] = panels.map(|panel| panel.iter().filter(near).collect::<Vec<&DVec3>>());
    let step = tile.stitch()[1 - axis];
    let windows = (15.0 / step) as usize..(65.0 / step) as usize;
    let least = |window: usize| {
        let inside = |p: &&&DVec3| (p[1 - axis] / step).floor() as usize == window;
        let of = |p: &&DVec3| second.iter().map(|q| p.distance(**q)).fold(f64::MAX, f64::min);
        first.iter().filter(inside).map(of).fold(f64::MAX, f64::min) / tile.diameter()
    };
    windows.map(least).collect()
}

#[test]
fn panels_meet_at_seams_without_overlap() {
    let mut wrong = Vec::new();
    for kind in [SeamKind::None, SeamKind::Mattress, SeamKind::Overlock] {
        for (tile, axis) in [(stockinette(), 0), (stockinette(), 1), (woven(), 0), (woven(), 1)] {
            let [first, second, _] = sewn(&tile, axis, kind).map(|yarns| along(&yarns));
            let distances = distances([&first, &second], &tile, axis);
            let (least, most) = distances.iter().fold((f64::MAX, 0.0_f64), |(a, b), d| (a.min(*d), b.max(*d)));
            eprintln!("{kind:?} {axis}: {least:.3} to {most:.3}");
            // Not into each other, and with less than a yarn between them.
            if least < 0.95 || most > 2.0 {
                wrong.push(format!("{kind:?} {axis}, woven {}: {distances:.2?}", tile.strands.len() > 1));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn seams_are_turned_in_and_sewn_where_nobody_looks() {
    for (tile, axis) in [(stockinette(), 0), (stockinette(), 1), (woven(), 0)] {
        let d = tile.diameter();
        let deepest = |places: &[DVec3]| places.iter().map(|p| p.z).fold(f64::MAX, f64::min);
        for kind in [SeamKind::None, SeamKind::Mattress, SeamKind::Overlock] {
            let [first, second, threads] = sewn(&tile, axis, kind).map(|yarns| along(&yarns));
            if kind == SeamKind::None {
                assert!(threads.is_empty() && deepest(&first) > -3.0 * d && deepest(&second) > -3.0 * d);
                continue;
            }
            // Both edges go in, as deep as each other, and the thread stays below what is seen.
            assert!(deepest(&first) < -3.0 * d && (deepest(&first) - deepest(&second)).abs() < d);
            assert!(threads.iter().all(|p| p.z < -0.8 * d && (p[axis] - 80.0).abs() < 5.0 * d), "{kind:?} {axis}");
            let crossings = threads.windows(2).filter(|w| (w[0][axis] < 80.0) != (w[1][axis] < 80.0)).count();
            let step = if kind == SeamKind::Mattress { 2.0 * tile.stitch().y } else { 4.0 };
            assert!(crossings as f64 > 0.8 * 2.0 * 80.0 / step, "{kind:?} {axis}: {crossings}");
            // An overlock goes round both edges, below the deepest loop; a mattress seam stays between them.
            let under = deepest(&threads) < deepest(&first);
            assert_eq!(under, kind == SeamKind::Overlock, "{axis}: {} {}", deepest(&threads), deepest(&first));
        }
    }
}
