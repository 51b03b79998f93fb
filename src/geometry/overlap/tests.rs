use std::f64::consts::TAU;

use glam::{DAffine3, DQuat, EulerRot, Vec2};

use super::*;
use crate::{
    geometry::{
        strand::{StrandOptions, Strands},
        yarn_frame::{Pressed, YarnFrame},
    },
    pattern::{
        draft::Draft,
        straight,
        weave::{Extent, Weave},
    },
    scene::transform_curves,
};

fn measured(curves: &[Curve], radius: f64) -> Overlap {
    let radii: Vec<Vec<f64>> = curves.iter().map(|c| vec![radius; c.points.len()]).collect();
    overlap(curves.iter().zip(&radii).map(|(c, r)| (c, r.as_slice()))).unwrap()
}

#[test]
fn parallel_yarns_overlap_over_their_whole_length_or_not_at_all() {
    let apart = measured(&straight(3, 10.0, 2.2), 1.0);
    assert_eq!((apart.share, apart.deepest), (0.0, 0.0));
    assert!((apart.nearest - 1.1).abs() < 1e-6 && (apart.length - 30.0).abs() < 1e-6);
    let into = measured(&straight(2, 10.0, 1.8), 1.0);
    assert!((into.deepest - 0.1).abs() < 1e-6 && into.share == 1.0);
    let slightly = measured(&straight(2, 10.0, 1.92), 1.0);
    assert!(slightly.share == 0.0 && (slightly.deepest - 0.04).abs() < 1e-6);
    assert_eq!(measured(&straight(2, 10.0, 9.0), 1.0).nearest, f64::INFINITY);
}

#[test]
fn a_crossing_overlaps_where_it_is() {
    let line = |axis: DVec3, z: f64| Curve {
        basis: Basis::CatmullRom,
        closed: false,
        points: (0..41).map(|i| axis * (f64::from(i) - 20.0) + DVec3::Z * z).collect(),
        radii: None,
        flattening: None,
    };
    let found = measured(&[line(DVec3::X, 0.0), line(DVec3::Y, 1.0)], 1.0);
    assert!((found.nearest - 0.5).abs() < 1e-6);
    // Within 1.9 of the other: sqrt(1.9^2 - 1) to both sides, of 40.
    let expected = (1.9_f64 * 1.9 - 1.0).sqrt() / 20.0;
    assert!((found.share - expected).abs() < 0.02, "{} {expected}", found.share);
}

#[test]
fn a_bend_is_no_overlap_but_a_loop_is() {
    let ring = |radius: f64, turns: f64| Curve {
        basis: Basis::CatmullRom,
        closed: false,
        points: (0..=64)
            .map(|i| std::f64::consts::TAU * turns * f64::from(i) / 64.0)
            .map(|a| DVec3::new(radius * a.cos(), radius * a.sin(), 0.01 * a))
            .collect(),
        radii: None,
        flattening: None,
    };
    assert_eq!(measured(&[ring(1.2, 0.5)], 1.0).share, 0.0);
    assert!(measured(&[ring(3.0, 2.0)], 1.0).share > 0.9);
}

#[test]
fn one_piece_in_eight_tells_about_how_much_overlaps() {
    let mut shares = Vec::new();
    // Thinner and thicker than they were woven, some of them twice as thick as others.
    for by in [0.8, 1.05, 1.15, 1.3] {
        let mut curves = woven("twill 2/1", 1.5, 24);
        for (i, (_, radii)) in curves.iter_mut().enumerate() {
            radii.iter_mut().for_each(|r| *r *= if i % 3 == 0 { 0.5 * by } else { by });
        }
        let all = of(&curves).share;
        let some = sampled_overlap(curves.iter().map(|(c, r)| (c, r.as_slice(), 1.0))).unwrap().share;
        assert!((all - some).abs() < 0.03, "{by}: {some} of {all}");
        shares.push(all);
    }
    assert!(shares[0] < 0.02 && shares[3] > 0.3, "{shares:?}");
}

/// A section of a yarn as it is rendered.
struct Section {
    frame: YarnFrame,
    outline: Vec<DVec3>,
}

/// What a search without any short cut finds of yarns as they are rendered: the deepest that a point of one's surface
/// lies inside another, and the share of sections of which any point lies deeper than is tolerated, both by the diameter
/// of the round yarn, `diameter`.
fn searched(curves: &[(Curve, Vec<f64>)], diameter: f64, around: usize) -> [f64; 2] {
    const PER_SEGMENT: usize = 4;
    let options = StrandOptions {
        basis: curves[0].0.basis,
        tolerance: 1e-3,
        longest_segment: 1.0,
        ply_rate: 0.0,
        symmetry: TAU,
        phases: vec![0.0],
        distances: false,
        unevenness: None,
        tube: 1.0,
    };
    let strands = Strands::new(curves, &options);
    let section = |segment: u32, k: usize| {
        let frame = strands.frame(segment, k as f32 / PER_SEGMENT as f32);
        let angle = |i: usize| Vec2::from_angle((TAU * i as f64 / around as f64) as f32);
        Section { outline: (0..around).map(|i| frame.point(angle(i)).as_dvec3()).collect(), frame }
    };
    let yarns: Vec<Vec<Section>> = (0..strands.yarns())
        .map(|y| {
            strands
                .segments_of(y)
                .flat_map(|s| (0..PER_SEGMENT).map(move |k| (s, k)))
                .map(|(s, k)| section(s, k))
                .collect()
        })
        .collect();
    let widest = curves.iter().flat_map(|c| &c.1).fold(0.0f64, |w, r| w.max(*r));
    // In the section across the other yarn in which the point lies, between two that are known.
    let depth_between = |point: DVec3, pair: [&Section; 2]| {
        if pair.iter().all(|s| s.frame.centre.as_dvec3().distance_squared(point) > 2.0 * widest * widest) {
            return 0.0;
        }
        let [a, b] = pair.map(|s| f64::from((point.as_vec3a() - s.frame.centre).dot(s.frame.tangent)));
        if !(a >= 0.0 && b <= 0.0) {
            return 0.0;
        }
        let share = a / (a - b).max(1e-12);
        let frame = &pair[usize::from(share > 0.5)].frame;
        let centre = pair[0].frame.centre.as_dvec3().lerp(pair[1].frame.centre.as_dvec3(), share);
        let off = (point - centre).as_vec3a() / frame.radius;
        let off = Vec2::new(off.dot(frame.normal), off.dot(frame.tangent.cross(frame.normal)));
        if Pressed::new(frame.flattening).map_or(off, |pressed| pressed.round(off)).length() >= 1.0 {
            return 0.0;
        }
        let corner = |i: usize| pair[0].outline[i % around].lerp(pair[1].outline[i % around], share);
        let to_side = |i: usize| {
            let (from, way) = (corner(i), corner(i + 1) - corner(i));
            point.distance(from + way * ((point - from).dot(way) / way.length_squared()).clamp(0.0, 1.0))
        };
        (0..around).map(to_side).fold(f64::MAX, f64::min)
    };
    let depth = |point: DVec3, other: &[Section]| {
        other.windows(2).map(|pair| depth_between(point, [&pair[0], &pair[1]])).fold(0.0, f64::max)
    };
    let (mut deepest, mut over, mut all) = (0.0f64, 0, 0);
    for (i, yarn) in yarns.iter().enumerate() {
        for section in yarn {
            let others = || yarns.iter().enumerate().filter(|(j, _)| *j != i);
            let here = section.outline.iter().map(|p| others().map(|(_, o)| depth(*p, o)).fold(0.0, f64::max));
            let here = here.fold(0.0, f64::max) / diameter;
            deepest = deepest.max(here);
            over += usize::from(here > TOLERATED);
            all += 1;
        }
    }
    [deepest, over as f64 / all as f64]
}

fn woven(draft: &str, flatten: f64, yarns: u32) -> Vec<(Curve, Vec<f64>)> {
    let extent = Extent::Yarns(yarns);
    let weave = Weave { warps: extent, wefts: extent, flatten, ..Weave::of(Draft::named(draft).unwrap(), 1.0) };
    let strands = weave.strands().unwrap();
    strands
        .into_iter()
        .map(|s| {
            let r = s.curve.radii.clone().unwrap_or(vec![1.0; s.curve.points.len()]);
            (s.curve, r)
        })
        .collect()
}

fn of(curves: &[(Curve, Vec<f64>)]) -> Overlap {
    overlap(curves.iter().map(|(c, r)| (c, r.as_slice()))).unwrap()
}

/// A straight yarn of half width 1, half as high.
fn ribbon(through: DVec3, along: DVec3, short: DVec3) -> (Curve, Vec<f64>) {
    let points: Vec<DVec3> = (0..21).map(|i| through + along * (0.4 * f64::from(i) - 4.0)).collect();
    let count = points.len();
    let flattening = Some(vec![0.5 * short.as_vec3(); count]);
    (Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening }, vec![1.0; count])
}

#[test]
fn pressed_yarns_overlap_by_what_one_reaches_into_the_other() {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let diameter = 2.0 * 0.5_f64.sqrt();
    let askew = (y + z).normalize();
    // Where the other is, its way and its short axis, and how deep it is in a yarn along x that lies flat.
    for (at, along, short, depth) in [
        (0.8 * z, y, z, Some(0.2)),
        (1.1 * z, y, z, Some(-0.1)),
        (1.8 * y, x, z, Some(0.2)),
        (1.3 * z, x, y, Some(0.2)),
        (1.3 * z, y, x, Some(0.2)),
        (1.4 * askew, x, y, None),
        (1.1 * askew, x, z, None),
        (0.9 * askew, (x + 0.3 * y).normalize(), z, None),
        (1.1 * z, (x + y + 0.5 * z).normalize(), (z - 0.25 * x - 0.25 * y).normalize(), None),
    ] {
        let curves = [ribbon(DVec3::ZERO, x, z), ribbon(at, along, short)];
        let found = of(&curves);
        if let Some(depth) = depth {
            assert!((1.0 - found.nearest - depth / diameter).abs() < 5e-3, "{at}: {found:?} {depth}");
        }
        let [deepest, _] = searched(&curves, diameter, 240);
        assert!((found.deepest - deepest).abs() < 0.01, "{at}: {found:?}, {deepest}");
    }
}

/// Also pushed into each other, turned about and drawn larger.
#[test]
fn woven_yarns_overlap_as_a_search_over_their_surface_has_it() {
    for (draft, flatten, raised) in
        [("plain", 1.2, 0.0), ("plain", 1.5, 0.0), ("plain", 1.5, 0.3), ("twill 2/1", 1.5, 0.0)]
    {
        let mut curves = woven(draft, flatten, 3);
        let (warps, _) = curves.split_at_mut(3);
        warps.iter_mut().flat_map(|c| &mut c.0.points).for_each(|p| p.z += raised);
        let turn = DQuat::from_euler(EulerRot::XYZ, 0.4, 3.0, -1.1);
        let by = DAffine3::from_scale_rotation_translation(DVec3::splat(2.0), turn, DVec3::new(5.0, -3.0, 1.0));
        let mut turned = curves.clone();
        transform_curves(&mut turned, &by);
        for (curves, diameter) in [(&curves, 2.0), (&turned, 4.0)] {
            let found = of(curves);
            let [deepest, share] = searched(curves, diameter, 48);
            let told = format!("{draft} {flatten} {raised}: {found:?}, {deepest}, {share}");
            assert!((found.deepest - deepest).abs() < 0.015, "{told}");
            // What is near counts too, not only the sections that lie in each other.
            assert!((0.0..0.15).contains(&(found.share - share)), "{told}");
            assert_eq!(found.deepest > 0.1, raised > 0.0, "{told}");
        }
    }
}
