//! Panels that are sewn together.

use super::*;
use crate::geometry::{curve::Basis, spline::evaluate};

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
pub(super) fn along(yarns: &[LaidYarn]) -> Vec<DVec3> {
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

/// A seam through (80, 40) that leans to the right from upright by an angle, between panels whose grains are turned against
/// each other by another, radians.
#[derive(Clone, Copy)]
struct Leaning {
    lean: f64,
    turn: f64,
}

impl Leaning {
    const AT: DVec2 = DVec2::new(80.0, 40.0);

    /// Distance along the seam and to its right.
    fn of(self, p: DVec3) -> [f64; 2] {
        let (sin, cos) = self.lean.sin_cos();
        let from = p.truncate() - Self::AT;
        [from.dot(DVec2::new(sin, cos)), from.dot(DVec2::new(cos, -sin))]
    }

    /// Both panels, flat, on either side.
    fn mesh(self) -> GarmentMesh {
        const CELLS: usize = 10;
        let mut text = String::new();
        for (panel, name) in ["first", "second"].into_iter().enumerate() {
            for j in 0..=CELLS {
                for i in 0..=CELLS {
                    let (share, y) = (i as f64 / CELLS as f64, 80.0 * j as f64 / CELLS as f64);
                    let edge = Self::AT.x + (y - Self::AT.y) * self.lean.tan();
                    let x = if panel == 0 { share * edge } else { edge + share * (160.0 - edge) };
                    let uv = match panel {
                        0 => DVec2::new(x, y),
                        _ => DVec2::from_angle(self.turn).rotate(DVec2::new(x, y) - Self::AT) + 400.0,
                    };
                    writeln!(text, "v {x} {y} 0\nvt {} {}", uv.x, uv.y).unwrap();
                }
            }
            writeln!(text, "g {name}").unwrap();
            for j in 0..CELLS {
                for i in 0..CELLS {
                    let a = 1 + panel * (CELLS + 1) * (CELLS + 1) + j * (CELLS + 1) + i;
                    let [b, c, d] = [a + 1, a + CELLS + 2, a + CELLS + 1];
                    writeln!(text, "f {a}/{a} {b}/{b} {c}/{c} {d}/{d}").unwrap();
                }
            }
        }
        GarmentMesh::parse(&text).unwrap()
    }

    /// Yarns of both panels and of the seam, within 8 mm of it.
    fn sewn(self, tile: &Tile, seam: SeamKind) -> [Vec<LaidYarn>; 3] {
        let garment = Garment::new(&self.mesh(), Options { seam, ..options(tile.clone()) }).unwrap();
        let yarns = garment.lay(&self.mesh(), &[&self.mesh()], &[], &[], &mut Vec::new()).unwrap();
        let near = |p: DVec3| {
            let [along, aside] = self.of(p);
            along.abs() < 25.0 && aside.abs() < 8.0
        };
        let mut out = [const { Vec::new() }; 3];
        for yarn in yarns.into_iter().flatten().flatten() {
            // The chain or hem around both has the yarn of cloth or a width of its own, and is not near.
            let of_cloth = (2.0 * yarn.radius - tile.diameter()).abs() < 1e-9;
            let place = if of_cloth { yarn.panel as usize } else { 2 };
            out[place].extend(within(&[yarn], &near));
        }
        out
    }

    /// The least and the largest distance of both panels' middle lines in steps of a stitch along the seam, in diameters.
    fn distances(self, panels: [&[LaidYarn]; 2], tile: &Tile) -> [f64; 2] {
        let [first, second] = panels.map(along);
        let step = tile.stitch().max_element();
        let window = |p: &DVec3| (self.of(*p)[0] / step).floor() as i64;
        let most = (24.0 / step) as i64;
        let of = |p: &DVec3| second.iter().map(|q| p.distance(*q)).fold(f64::MAX, f64::min) / tile.diameter();
        let mut least = std::collections::BTreeMap::new();
        for p in first.iter().filter(|p| (-most..most).contains(&window(p))) {
            let known = least.entry(window(p)).or_insert(f64::MAX);
            *known = f64::min(*known, of(p));
        }
        least.values().fold([f64::MAX, 0.0], |[a, b], d| [a.min(*d), b.max(*d)])
    }
}

#[test]
fn slanting_seams_meet_as_straight_ones_do() {
    let mut wrong = Vec::new();
    // Edges that only meet are straight: where they slant rows end in steps.
    for kind in [SeamKind::Mattress, SeamKind::Overlock] {
        // Measured: up to 0.19 and 0.03 of the yarn within 8 mm overlaps; straight 0.09 and 0.03. Knits are drawn together by a fifth.
        for (tile, name, nearest, most) in [(stockinette(), "knit", 0.75, 0.22), (woven(), "woven", 0.95, 0.04)] {
            for (lean, turn) in [(0.0, 0.0), (15.0, 0.0), (30.0, 0.0), (45.0, 0.0), (20.0, 35.0)] {
                let seam = Leaning { lean: f64::to_radians(lean), turn: f64::to_radians(turn) };
                let [first, second, threads] = seam.sewn(&tile, kind);
                assert!(!threads.is_empty());
                let [least, furthest] = seam.distances([&first, &second], &tile);
                let cloth = run_into_each_other(&[first.clone(), second.clone()].concat()).share;
                let sewn = run_into_each_other(&[first, second, threads].concat()).share;
                let told = format!("{kind:?} {name} {lean} {turn}: {least:.2} to {furthest:.2}, {cloth:.3}, {sewn:.3}");
                eprintln!("{told}");
                if least < nearest || furthest > 2.0 || cloth > most {
                    wrong.push(told);
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Two panels of a ball of 63 mm, sewn along its front, over a ball of 60 mm.
fn on_a_ball() -> GarmentMesh {
    let mut text = String::new();
    let at = |u: f64, v: f64| {
        let (angle, height) = ((u - 60.0) / 63.0, (v - 40.0) / 63.0);
        63.0 * DVec3::new(angle.sin() * height.cos(), height.sin(), angle.cos() * height.cos())
    };
    sheet(&mut text, "first", 12, 16, 5.0, 0.0, &at);
    sheet(&mut text, "second", 12, 16, 5.0, 200.0, &|u, v| at(u + 60.0, v));
    GarmentMesh::parse(&text).unwrap()
}

#[test]
fn allowances_stay_out_of_a_body() {
    let body = Mesh::sphere(60.0, 96);
    for (kind, tile) in
        [(SeamKind::Mattress, stockinette()), (SeamKind::Overlock, stockinette()), (SeamKind::Overlock, woven())]
    {
        let lay = |pressed: bool| {
            let garment = Garment::new(&on_a_ball(), Options { seam: kind, pressed, ..options(tile.clone()) }).unwrap();
            let yarns = garment.lay(&on_a_ball(), &[&on_a_ball()], &[&body], &[], &mut Vec::new()).unwrap();
            yarns.into_iter().flatten().flatten().collect::<Vec<_>>()
        };
        let deepest = |yarns: &[LaidYarn]| along(yarns).iter().map(|p| p.length() - 60.0).fold(f64::MAX, f64::min);
        let (upright, pressed) = (lay(false), lay(true));
        // Ends of yarns, turns and chains at free edges are not of the seam.
        let by_seam = |yarns: &[LaidYarn]| within(yarns, &|p| p.x.abs() < 20.0 && p.y.abs() < 26.0);
        let (before, now) = (deepest(&by_seam(&upright)), deepest(&by_seam(&pressed)));
        eprintln!(
            "{kind:?}: {before:.2} before, {now:.2} mm off the body, {:.3} of {:.3}",
            run_into_each_other(&by_seam(&pressed)).share,
            run_into_each_other(&by_seam(&upright)).share
        );
        assert!(before < -0.5 && now > 0.4 * tile.diameter(), "{kind:?}: {before} {now}");
        // The cloth itself comes down again a little further on.
        let aside = within(&pressed, &|p| p.x.abs() > 34.0 && p.y.abs() < 20.0);
        let highest = along(&aside).iter().map(|p| p.length()).fold(0.0, f64::max);
        assert!(highest < 63.0 + 2.0 * tile.diameter(), "{kind:?}: {highest}");
    }
}

/// The upper side of yarns near a seam, from 8 mm to its left to as far to its right, mean along it, in cells of a tenth of
/// a diameter; in diameters.
fn upper_side(yarns: &[LaidYarn], diameter: f64, seam: Leaning) -> Vec<f64> {
    const LOWEST: f64 = -3.0;
    let [rows, columns] = [40.0, 16.0].map(|length| (10.0 * length / diameter) as usize);
    let mut heights = vec![LOWEST; rows * columns];
    for p in along(yarns) {
        let [row, column] = seam.of(p).map(|s| (10.0 * s / diameter).round() as i64);
        for (i, j) in (-5..6).flat_map(|i: i64| (-5..6).map(move |j: i64| (i, j))) {
            let place = [row + i + rows as i64 / 2, column + j + columns as i64 / 2];
            let inside = place.iter().zip([rows, columns]).all(|(at, n)| (0..n as i64).contains(at));
            let rise = (0.25 - 0.01 * (i * i + j * j) as f64).max(0.0).sqrt();
            if inside {
                let height = &mut heights[place[0] as usize * columns + place[1] as usize];
                *height = height.max(p.z / diameter + rise);
            }
        }
    }
    let mean = |column: usize| heights.iter().skip(column).step_by(columns).sum::<f64>() / rows as f64;
    (0..columns).map(mean).collect()
}

/// A seam shows as a line, as a valley between two columns does, not as a groove of a column's width.
#[test]
fn columns_meet_at_mattress_seams() {
    let mut wrong = Vec::new();
    let tile = stockinette();
    for (lean, turn) in [(0.0, 0.0), (15.0, 0.0), (30.0, 0.0), (60.0, 0.0), (5.0, 50.0), (0.0, 80.0)] {
        let seam = Leaning { lean: f64::to_radians(lean), turn: f64::to_radians(turn) };
        for pressed in [false, true] {
            let garment = Garment::new(&seam.mesh(), Options { pressed, ..options(tile.clone()) }).unwrap();
            let yarns = garment.lay(&seam.mesh(), &[&seam.mesh()], &[], &[], &mut Vec::new()).unwrap();
            let yarns: Vec<LaidYarn> = yarns.into_iter().flatten().flatten().collect();
            let heights = upper_side(&yarns, tile.diameter(), seam);
            let away = &heights[..heights.len() / 4];
            let cloth = away.iter().sum::<f64>() / away.len() as f64;
            let deeper = |by: f64| 0.1 * heights.iter().filter(|h| **h < cloth - by).count() as f64;
            let told = format!("{lean} {turn} pressed {pressed}: {:.1} and {:.1}", deeper(1.0), deeper(1.5));
            eprintln!("{told}");
            // Measured: 1.0 to 1.5 and 0.5 to 0.7; round bends left 1.7 to 2.3 and 1.2 to 1.5.
            if deeper(1.0) > 1.6 || deeper(1.5) > 0.8 {
                wrong.push(told);
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The feet of a band that is picked up along an edge are behind it; heads of a last row lie as they were knitted.
#[test]
fn stitches_are_picked_up_from_the_wrong_side() {
    let tile = stockinette();
    let feet = |lean: f64, turn: f64| {
        let seam = Leaning { lean: lean.to_radians(), turn: turn.to_radians() };
        let [_, band, _] = seam.sewn(&tile, SeamKind::None);
        let at_seam = |p: &DVec3| seam.of(*p)[1] < 0.1 * tile.stitch().y;
        let heights = along(&band).into_iter().filter(at_seam).map(|p| p.z / tile.diameter());
        heights.fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)))
    };
    for (lean, turn) in [(0.0, 90.0), (30.0, 120.0), (60.0, 150.0)] {
        let (low, high) = feet(lean, turn);
        assert!(low > -2.0 && high < -0.3, "{lean} {turn}: {low} to {high}");
    }
    let (_, high) = feet(0.0, -90.0);
    assert!(high > 0.0, "{high}");
}

#[test]
fn edges_that_are_knitted_on_leave_no_gap() {
    let mut wrong = Vec::new();
    let tile = stockinette();
    // Rows of the second panel are level with those of the first, at an angle, or along the seam as of a band.
    let level = [0.0, 15.0, 30.0, 45.0].map(|lean| (lean, 0.0));
    let bands = [(0.0, 90.0), (0.0, -90.0), (30.0, -60.0), (30.0, 120.0), (60.0, -30.0), (60.0, 150.0)];
    for (lean, turn) in level.into_iter().chain([(20.0, 35.0)]).chain(bands) {
        let seam = Leaning { lean: f64::to_radians(lean), turn: f64::to_radians(turn) };
        let [first, second, _] = seam.sewn(&tile, SeamKind::None);
        let furthest = seam.distances([&first, &second], &tile)[1];
        let cloth = run_into_each_other(&[first, second].concat()).share;
        let told = format!("{lean} {turn}: {furthest:.2}, {cloth:.3}");
        eprintln!("{told}");
        // Measured: 0.15 to 1.29, and of bands 0.16 to 0.36, of others up to 0.43 of the yarn within 8 mm. Feet of bands lie among
        // the turns of the other panel's rows, on the wrong side.
        if furthest > 1.4 || cloth > if turn.abs() > 40.0 { 0.38 } else { 0.48 } {
            wrong.push(told);
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
