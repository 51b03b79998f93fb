//! Edges that are turned up and sewn.

use super::{seams::along, *};
use crate::garment::surface::Pose;

const WIDTH: f64 = 24.0;

fn hemmed(tile: Tile, kind: HemKind) -> Options {
    let mut options = options(tile);
    options.cloths[0].hem = Some(Hem { kind, width: WIDTH });
    options
}

/// Whether a yarn is one of cloth, and not a thread that sews it.
fn is_cloth(yarn: &LaidYarn, tile: &Tile) -> bool {
    (2.0 * yarn.radius - tile.diameter()).abs() < 1e-9
}

fn fold_of(garment: &Garment) -> super::super::fold::Fold {
    garment.sewing.bends(0).hem.unwrap()
}

/// Two panels of 80 x 100 mm side by side, sewn.
fn two_panels() -> GarmentMesh {
    let mut text = String::new();
    sheet(&mut text, "first", 8, 10, 10.0, 0.0, &|u, v| DVec3::new(u, v, 0.0));
    sheet(&mut text, "second", 8, 10, 10.0, 200.0, &|u, v| DVec3::new(u + 80.0, v, 0.0));
    GarmentMesh::parse(&text).unwrap()
}

/// A round panel of 160 mm radius.
fn round() -> GarmentMesh {
    const SIDES: usize = 48;
    let mut text = "g round\nv 0 0 0\nvt 0 0\n".to_owned();
    for ring in 1..=4 {
        for i in 0..SIDES {
            let at = DVec2::from_angle(std::f64::consts::TAU * i as f64 / SIDES as f64) * 40.0 * f64::from(ring);
            writeln!(text, "v {0} {1} 0\nvt {0} {1}", at.x, at.y).unwrap();
        }
    }
    let at = |ring: usize, i: usize| if ring == 0 { 1 } else { 2 + (ring - 1) * SIDES + i % SIDES };
    for ring in 0..4 {
        for i in 0..SIDES {
            let mut corners = vec![at(ring, i), at(ring + 1, i), at(ring + 1, i + 1)];
            if ring > 0 {
                corners.push(at(ring, i + 1));
            }
            let corners: Vec<String> = corners.iter().map(|c| format!("{c}/{c}")).collect();
            writeln!(text, "f {}", corners.join(" ")).unwrap();
        }
    }
    GarmentMesh::parse(&text).unwrap()
}

/// Which places are of a part.
type Inside<'a> = &'a dyn Fn(DVec3) -> bool;

/// What lies under the cloth does not cut into it, on straight edges, on a tube, on a round one, and across a seam.
#[test]
fn both_layers_of_a_hem_keep_apart() {
    let mut wrong = Vec::new();
    let by_straight = |p: DVec3| p.y < 40.0 && (p.x - 50.0).abs() < 20.0;
    let by_seam = |p: DVec3| p.y < 40.0 && (p.x - 80.0).abs() < 20.0;
    let by_round = |p: DVec3| p.truncate().length() > 130.0 && p.x.abs() < 60.0;
    // Measured, of knits and of weaves: 0.06, 0.18, 0.15, 0.26 and 0.01, 0.04, 0.13, 0.04; with threads up to 0.35 and 0.19. Loops
    // within the bend lie close, and under a round edge they are drawn together.
    let cases: [(&str, GarmentMesh, Inside<'_>, [f64; 4]); 4] = [
        ("straight", square(), &by_straight, [0.08, 0.21, 0.02, 0.10]),
        ("tube", tube(), &|_| true, [0.21, 0.33, 0.06, 0.14]),
        ("seam", two_panels(), &by_seam, [0.18, 0.26, 0.15, 0.22]),
        ("round", round(), &by_round, [0.29, 0.38, 0.06, 0.19]),
    ];
    for (name, mesh, near, most) in cases {
        for (k, tile) in [stockinette(), woven()].into_iter().enumerate() {
            let seam = if k == 0 { SeamKind::Mattress } else { SeamKind::Overlock };
            let (_, yarns) = laid(&mesh, Options { seam, ..hemmed(tile.clone(), HemKind::Coverstitch) });
            let (cloth, threads): (Vec<_>, Vec<_>) = yarns.into_iter().partition(|y| is_cloth(y, &tile));
            assert!(!threads.is_empty());
            let cloth = within(&cloth, near);
            let alone = run_into_each_other(&cloth).share;
            let sewn = run_into_each_other(&[cloth, within(&threads, near)].concat()).share;
            let told = format!("{name} {k}: {alone:.3}, {sewn:.3} with threads");
            eprintln!("{told}");
            if alone > most[2 * k] || sewn > most[2 * k + 1] {
                wrong.push(told);
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Seen from outside the edge is a fold: cloth comes up to it everywhere and no further, and nothing is bound off.
#[test]
fn a_hemmed_edge_is_a_fold() {
    for tile in [stockinette(), woven()] {
        let d = tile.diameter();
        let options = hemmed(tile.clone(), HemKind::Coverstitch);
        let garment = Garment::new(&square(), options).unwrap();
        let fold = fold_of(&garment);
        let laid = garment.lay(&square(), &[&square()], &[], &[], &mut Vec::new()).unwrap();
        let cloth: Vec<LaidYarn> = laid.into_iter().flatten().flatten().filter(|y| is_cloth(y, &tile)).collect();
        let places: Vec<DVec3> = along(&cloth).into_iter().filter(|p| (p.x - 50.0).abs() < 22.0).collect();
        let step = tile.stitch().x;
        for window in (29.0 / step).ceil() as usize..(71.0 / step) as usize {
            let inside = |p: &&DVec3| (p.x / step) as usize == window;
            let lowest = places.iter().filter(inside).map(|p| p.y - 0.5 * d).fold(f64::MAX, f64::min);
            assert!(lowest > -0.2 * d && lowest < 0.9 * d, "{window}: {lowest}");
        }
        // The lower layer reaches as far in as it is to, lies below the upper one, and no lower than it is thick.
        let [top, bottom] = fold.skins();
        let deep: Vec<&DVec3> = places.iter().filter(|p| p.z < -fold.radius).collect();
        let raw = deep.iter().map(|p| p.y).filter(|y| *y < 50.0).fold(0.0, f64::max);
        assert!((raw - WIDTH).abs() < 0.7 * tile.stitch().y + d, "{raw}");
        assert!(places.iter().all(|p| p.z < top && p.z > bottom), "{bottom} to {top}");
        let middle = places.iter().filter(|p| p.y > 40.0 && p.y < 60.0);
        assert!(middle.into_iter().all(|p| p.z > -fold.radius));
    }
}

/// Each stitch of a needle's thread goes down through both layers and comes up again, and the thread lies on the right side
/// in between; a looper's thread stays below, and reaches over the raw edge.
#[test]
fn every_stitch_of_a_hem_goes_through_both_layers() {
    for (mesh, edges, corners) in [(square(), 400.0, 4.0), (tube(), 480.0, 0.0), (two_panels(), 520.0, 4.0)] {
        for tile in [stockinette(), woven()] {
            let garment = Garment::new(&mesh, hemmed(tile.clone(), HemKind::Coverstitch)).unwrap();
            let is_tube = corners == 0.0;
            let height = |p: &DVec3| if is_tube { p.x.hypot(p.z) - TUBE } else { p.z };
            let fold = fold_of(&garment);
            let [top, bottom] = fold.skins();
            let laid = garment.lay(&mesh, &[&mesh], &[], &[], &mut Vec::new()).unwrap();
            let threads: Vec<LaidYarn> =
                laid.into_iter().flatten().flatten().filter(|y| y.radius < 0.3 * tile.diameter()).collect();
            // Of a hem round each way, over all panels.
            let of_hem: Vec<&LaidYarn> = threads.iter().filter(|y| y.closed).collect();
            assert_eq!(of_hem.len(), if is_tube { 6 } else { 3 });
            let step = (16.0 * of_hem[0].radius).max(2.5);
            let mut stitches = 0;
            for thread in of_hem {
                let places = along(std::slice::from_ref(thread));
                let up = places.iter().map(|p| i32::from(height(p) > top)).collect::<Vec<_>>();
                let down = places.iter().map(|p| i32::from(height(p) < bottom)).collect::<Vec<_>>();
                let starts = |inside: &[i32]| inside.windows(2).filter(|w| w[0] < w[1]).count();
                let (over, under) = (starts(&up), starts(&down));
                if over == 0 {
                    // A looper's: below all the way but behind the raw edge.
                    assert!(places.iter().all(|p| height(p) < -fold.radius + 0.1), "{bottom}");
                    let reach =
                        places.iter().map(|p| if is_tube { p.y.min(60.0 - p.y) } else { p.y }).filter(|y| *y < 50.0);
                    assert!(reach.fold(0.0, f64::max) > WIDTH + 0.3);
                } else {
                    assert!(over.abs_diff(under) <= 1, "{over} {under}");
                    stitches += over;
                }
            }
            let line = WIDTH - (0.8 * tile.stitch().max_element()).max(1.2);
            let wanted = 2.0 * (edges - 2.0 * corners * line) / step;
            assert!((stitches as f64 - wanted).abs() < 0.02 * wanted + 4.0, "{stitches} of {wanted}");
        }
    }
}

#[test]
fn a_lockstitch_has_a_thread_on_either_side() {
    let tile = woven();
    let (_, yarns) = laid(&square(), hemmed(tile.clone(), HemKind::Lockstitch));
    let threads: Vec<&LaidYarn> = yarns.iter().filter(|y| !is_cloth(y, &tile)).collect();
    assert_eq!(threads.len(), 2);
    let mean = |y: &LaidYarn| y.points.iter().map(|p| p.z).sum::<f64>() / y.points.len() as f64;
    assert!(mean(threads[0]) > 0.0 && mean(threads[1]) < -2.0 * tile.diameter());
    // They hold each other: the upper one comes below the lower one, and never into it.
    let lowest = threads[0].points.iter().map(|p| p.z).fold(f64::MAX, f64::min);
    let highest = threads[1].points.iter().map(|p| p.z).fold(f64::MIN, f64::max);
    assert!(lowest < highest, "{lowest} {highest}");
    let both: Vec<LaidYarn> = threads.into_iter().cloned().collect();
    let found = run_into_each_other(&within(&both, &|p| p.y < 40.0 && (p.x - 50.0).abs() < 20.0));
    // Measured: 0.03, by at most 0.16.
    assert!(found.share < 0.05 && found.deepest < 0.2, "{found:?}");
}

/// What lies under the cloth is turned and not mirrored, so that an S twist stays S and a twill leans as it does.
#[test]
fn what_is_turned_up_keeps_its_hand() {
    let garment = Garment::new(&square(), hemmed(stockinette(), HemKind::Coverstitch)).unwrap();
    let pose: Pose = garment.surface.pose(&garment.panels.points(&square(), 1.0));
    let lattice = &garment.lattices[0];
    let sheet = Sheet::new(lattice, &garment.surface, &pose, garment.sewing.bends(0));
    let mut found = [0; 2];
    for y in 0..lattice.counts[1] {
        let p = glam::Vec3::new(0.5 * lattice.counts[0] as f32, y as f32 + 0.5, 0.1);
        let step = |axis: glam::Vec3| 100.0 * (sheet.place(p + 0.01 * axis) - sheet.place(p));
        let [across, up, out] = glam::Vec3::AXES.map(step);
        let volume = across.cross(up).dot(out) / lattice.stitch.element_product() as f32;
        assert!(volume > 0.2, "{y}: {volume}");
        found[usize::from(out.z < 0.0)] += 1;
        assert_eq!(out.z < 0.0, up.y < 0.0, "{y}");
    }
    assert!(found[1] > 10 && found[0] > 20, "{found:?}");
}

#[test]
fn hems_are_the_same_on_any_number_of_threads() {
    let lay = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| laid(&two_panels(), hemmed(stockinette(), HemKind::Coverstitch)).1)
    };
    let (one, three) = (lay(1), lay(3));
    assert_eq!(one.len(), three.len());
    assert!(one.iter().zip(&three).all(|(a, b)| a.points == b.points));
}

#[test]
fn hems_stay_out_of_a_body() {
    let body = Mesh::sphere(60.0, 96);
    let mut text = String::new();
    sheet(&mut text, "band", 24, 16, 5.0, 0.0, &|u, v| {
        let (angle, height) = ((u - 60.0) / 62.0, (v - 40.0) / 62.0);
        62.0 * DVec3::new(angle.sin() * height.cos(), height.sin(), angle.cos() * height.cos())
    });
    let mesh = GarmentMesh::parse(&text).unwrap();
    for tile in [stockinette(), woven()] {
        let options = Options { pressed: true, ..hemmed(tile.clone(), HemKind::Coverstitch) };
        let garment = Garment::new(&mesh, options).unwrap();
        let yarns = garment.lay(&mesh, &[&mesh], &[&body], &[], &mut Vec::new()).unwrap();
        let yarns: Vec<LaidYarn> = yarns.into_iter().flatten().flatten().collect();
        let deepest = along(&yarns).iter().map(|p| p.length() - 60.0).fold(f64::MAX, f64::min);
        assert!(deepest > 0.3 * tile.diameter(), "{deepest}");
    }
}

#[test]
fn hems_that_cannot_be_sewn_are_told() {
    let error = |mesh: &GarmentMesh, width: f64, group: Option<&str>| {
        let mut options = hemmed(stockinette(), HemKind::Coverstitch);
        options.cloths[0].hem = Some(Hem { kind: HemKind::Coverstitch, width });
        if let Some(group) = group {
            let own = Cloth {
                panels: Some(PanelChoice::Named(group.to_owned())),
                hems_itself: true,
                ..options.cloths[0].clone()
            };
            options.cloths[0].hem = None;
            options.cloths.push(own);
        }
        Garment::new(mesh, options).err().unwrap()
    };
    let narrow = error(&square(), 4.0, None);
    assert!(narrow.problem.contains("too narrow") && narrow.hint.contains("hem_width"), "{narrow:?}");
    let wide = error(&square(), 130.0, None);
    assert!(wide.problem.contains("wider than panel `square`") && wide.line > 0, "{wide:?}");
    // Opposite hems meet in the middle of 100 mm; where no edge across is hemmed there is room for more.
    let mut text = String::new();
    sheet(&mut text, "wide", 16, 10, 10.0, 0.0, &|u, v| DVec3::new(u, v, 0.0));
    let wide = GarmentMesh::parse(&text).unwrap();
    let meets = error(&wide, 51.0, None);
    assert!(meets.problem.contains("51.00 mm meets the one across panel `wide`") && meets.line > 0, "{meets:?}");
    assert!(
        meets.hint.contains("`hem_width` of at most 49.9 mm") || meets.hint.contains("at most 50.0 mm"),
        "{meets:?}"
    );
    let fits = |mesh: &GarmentMesh, width: f64| {
        let mut options = hemmed(stockinette(), HemKind::Coverstitch);
        options.cloths[0].hem = Some(Hem { kind: HemKind::Coverstitch, width });
        Garment::new(mesh, options).map(|_| ())
    };
    assert_eq!(fits(&wide, 49.9), Ok(()));
    assert_eq!(fits(&round(), 120.0), Ok(()));
    // A panel within another is sewn all round.
    let mut text = String::new();
    let at = |u: f64, v: f64| DVec3::new(u, v, 0.0);
    sheet(&mut text, "left", 4, 12, 10.0, 0.0, &at);
    sheet(&mut text, "right", 4, 12, 10.0, 300.0, &|u, v| at(u + 80.0, v));
    sheet(&mut text, "below", 4, 4, 10.0, 500.0, &|u, v| at(u + 40.0, v));
    sheet(&mut text, "middle", 4, 4, 10.0, 700.0, &|u, v| at(u + 40.0, v + 40.0));
    sheet(&mut text, "above", 4, 4, 10.0, 900.0, &|u, v| at(u + 40.0, v + 80.0));
    let mesh = GarmentMesh::parse(&text).unwrap();
    let sewn = error(&mesh, WIDTH, Some("middle"));
    assert!(sewn.problem.contains("\"middle\" is free to be hemmed"), "{sewn:?}");
}
