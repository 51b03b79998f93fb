use std::f64::consts::TAU;

use super::*;
use crate::geometry::{section::Section, yarn::tests::touching_yarn};

fn options(basis: Basis) -> StrandOptions {
    StrandOptions {
        basis,
        tolerance: 0.01,
        longest_segment: 1.5,
        ply_rate: 0.4,
        symmetry: TAU,
        phases: vec![0.7],
        distances: true,
        unevenness: None,
        tube: 1.0,
    }
}

fn knit_like(n: usize, closed: bool) -> Curve {
    let points = (0..n)
        .map(|i| {
            let t = TAU * i as f64 / n as f64;
            DVec3::new(10.0 * t.cos(), 10.0 * t.sin(), 2.0 * (3.0 * t).sin())
        })
        .collect();
    Curve { basis: Basis::CatmullRom, closed, points, radii: None, flattening: None }
}

fn strands(curve: Curve, radius: f64, options: &StrandOptions) -> Strands {
    let radii = vec![radius; curve.points.len()];
    Strands::new(&[(curve, radii)], options)
}

#[test]
fn segments_take_the_material_index_nearest_to_their_middle() {
    for basis in [Basis::CatmullRom, Basis::BSpline] {
        for (closed, tolerance) in [(false, 0.01), (true, 0.01), (false, 0.0), (true, 0.0)] {
            let curve = Curve { basis, ..knit_like(400, closed) };
            // Three from point to point.
            let count = if closed { 1200 } else { 1198 };
            let material_indices: Vec<u16> = (0..count).map(|i| u16::from((300..750).contains(&i))).collect();
            let of = StrandOptions { tolerance, ..options(basis) };
            let s = Strands::with(
                &[(curve.clone(), vec![0.5; 400])],
                Along { material_indices: &[material_indices], ..Along::default() },
                StrandMotion::default(),
                &of,
            );
            for segment in 0..s.segments().len() as u32 {
                let at = s.frame(segment, 0.5).centre.as_dvec3();
                let angle = at.y.atan2(at.x).rem_euclid(TAU) / TAU * 400.0;
                // Not where one changes into the other.
                if [0.0, 100.0, 250.0, 400.0].iter().all(|edge: &f64| (angle - edge).abs() > 3.0) {
                    let want = u16::from((100.0..250.0).contains(&angle));
                    assert_eq!(s.material_index(segment), Some(want), "{basis:?} {closed} {tolerance}: at {angle}");
                }
            }
            assert_eq!(strands(curve, 0.5, &of).material_index(0), None);
        }
    }
}

#[test]
fn resampling_keeps_the_curve_within_its_tolerance_with_fewer_points() {
    for basis in [Basis::CatmullRom, Basis::BSpline] {
        for closed in [true, false] {
            let curve = knit_like(400, closed);
            let s = strands(curve.clone(), 0.5, &options(basis));
            assert!(s.segments().len() < 260, "{basis:?} {closed}: {} segments", s.segments().len());
            let worst = curve
                .points
                .iter()
                .map(|p| {
                    (0..s.segments().len() as u32)
                        .flat_map(|i| (0..=8).map(move |k| (i, k as f32 / 8.0)))
                        .map(|(i, u)| {
                            let place = s.frame(i, u);
                            let off = p.as_vec3a() - place.centre;
                            (off - off.dot(place.tangent) * place.tangent).length()
                                + if off.length() > 1.0 { 9.0 } else { 0.0 }
                        })
                        .fold(f32::MAX, f32::min)
                })
                .fold(0.0, f32::max);
            assert!(worst < 0.011 * 0.5, "{basis:?} closed {closed}: {worst}");
        }
    }
}

#[test]
fn frames_are_continuous_across_segments_and_seams() {
    for basis in [Basis::CatmullRom, Basis::BSpline] {
        let s = strands(knit_like(200, true), 0.5, &options(basis));
        let last = s.segments().len() as u32 - 1;
        for i in 0..=last {
            let next = if i == last { 0 } else { i + 1 };
            let (a, b) = (s.frame(i, 1.0), s.frame(next, 0.0));
            assert!((a.centre - b.centre).length() < 1e-4);
            let ply = |p: &YarnFrame| {
                let across = p.tangent.cross(p.normal);
                p.normal * p.phase.cos() + across * p.phase.sin()
            };
            assert!((ply(&a) - ply(&b)).length() < 3e-3, "segment {i} of {last}: {} {}", ply(&a), ply(&b));
        }
    }
}

#[test]
fn a_flattened_section_keeps_its_axes_wherever_points_are_put() {
    for (basis, closed) in [(Basis::CatmullRom, true), (Basis::CatmullRom, false), (Basis::BSpline, true)] {
        // The short axis across the plane in which the curve mostly lies, turned by up to half a radian, with signs that
        // say nothing.
        let curve = knit_like(200, closed);
        let short = |p: &DVec3| {
            let angle = p.y.atan2(p.x);
            let outward = DVec3::new(p.x, p.y, 0.0).normalize();
            let tilt = 0.5 * (2.0 * angle).sin();
            (DVec3::Z * tilt.cos() + outward * tilt.sin(), 0.6 + 0.2 * angle.cos())
        };
        let vectors = curve.points.iter().enumerate().map(|(i, p)| {
            let (axis, ratio) = short(p);
            axis * if i % 3 == 0 { -ratio } else { ratio }
        });
        let flattening = Some(vectors.map(|v| v.as_vec3()).collect());
        let round = strands(curve.clone(), 0.5, &options(basis));
        let pose = vec![curve.points.iter().map(|p| *p + DVec3::X).collect()];
        let radii = vec![0.5; curve.points.len()];
        let movement = StrandMotion { later: &[pose], ..StrandMotion::default() };
        let s = Strands::moving(&[(Curve { flattening, ..curve }, radii)], movement, &options(basis));
        assert!(s.flattened() && !round.flattened() && round.mean_flattening() == 1.0);
        assert_eq!(s.segments().len(), round.segments().len());
        for i in 0..s.segments().len() as u32 {
            for (u, time) in [(0.0, 0.0), (0.3, 0.5), (0.5, 1.0), (1.0, 0.0)] {
                let place = s.frame_at(i, u, time);
                let centre = place.centre - Vec3A::X * time;
                let (axis, ratio) = short(&centre.as_dvec3());
                let axis = axis - axis.dot(place.tangent.as_dvec3()) * place.tangent.as_dvec3();
                let found = (place.flattening.length(), place.point(place.flattening.normalize()) - place.centre);
                assert!((f64::from(found.0) - ratio).abs() < 0.01, "{basis:?} {i} {u}: {} {ratio}", found.0);
                let cos = found.1.normalize().as_dvec3().dot(axis.normalize()).abs();
                assert!(cos > 0.998, "{basis:?} closed {closed} {i} {u}: {cos}");
                assert!((f64::from(found.1.length()) / 0.5 - ratio).abs() < 0.01, "pressed along its axis");
            }
        }
    }
}

/// The tangents of fibres are the directions in which they go on: with the plies, and with a section that becomes wider and flatter and
/// whose axis turns.
#[test]
fn fibres_go_along_with_a_section_that_changes() {
    let shape = touching_yarn(1, 40, 0.4, 0.0, 0.4);
    let rate = f64::from(shape.plies[0].fiber_rate);
    let points: Vec<DVec3> = (0..30).map(|i| DVec3::new(0.0, 0.0, 0.2 * f64::from(i))).collect();
    let swell = |z: f64| (1.5 * z).sin();
    let radii: Vec<f64> = points.iter().map(|p| 0.5 + 0.1 * swell(p.z)).collect();
    let axis = |p: &DVec3| (DVec3::new((0.5 * p.z).cos(), (0.5 * p.z).sin(), 0.0) * (0.7 - 0.2 * swell(p.z))).as_vec3();
    for pressed in [false, true] {
        let flattening = pressed.then(|| points.iter().map(axis).collect());
        let curve = Curve { basis: Basis::CatmullRom, closed: false, points: points.clone(), radii: None, flattening };
        let s =
            Strands::new(&[(curve, radii.clone())], &StrandOptions { ply_rate: rate, ..options(Basis::CatmullRom) });
        let mut most = 0.0_f32;
        for segment in 4..s.segments().len() as u32 - 4 {
            for (k, u) in [0.2, 0.5, 0.8].into_iter().enumerate() {
                let at = 0.8 * Vec2::from_angle(segment as f32 + k as f32);
                let on_fibre = |u: f32| {
                    let place = s.frame(segment, u);
                    place.point(at.rotate(Vec2::from_angle(place.phase)))
                };
                let place = s.frame(segment, u);
                let section = Section::new(&place, on_fibre(u) + 9.0 * Vec3A::Y, Vec3A::NEG_Y, true);
                let local = section.to_local(on_fibre(u) - place.centre) / place.radius;
                let tangent = section.to_world(section.fiber_tangent(&shape, 0, local, 0.0)).normalize();
                let way = (on_fibre(u + 0.01) - on_fibre(u - 0.01)).normalize();
                most = most.max(tangent.distance(way));
            }
        }
        assert!(most < 0.012, "{pressed}: {most}");
    }
}

#[test]
fn what_moves_is_between_its_poses_and_takes_its_plies_along() {
    for (basis, closed) in [(Basis::CatmullRom, true), (Basis::CatmullRom, false), (Basis::BSpline, true)] {
        let curve = knit_like(200, closed);
        let radii = vec![0.5; curve.points.len()];
        // Lifted, turned a little and stretched by a fifth along x.
        let move_by = |s: f64, p: &DVec3| {
            let turn = glam::DQuat::from_rotation_y(0.2 * s);
            turn * DVec3::new(p.x * (1.0 + 0.2 * s), p.y, p.z) + DVec3::new(0.0, 3.0 * s, 0.0)
        };
        let pose = |s: f64| -> Vec<Vec<DVec3>> { vec![curve.points.iter().map(|p| move_by(s, p)).collect()] };
        let later = [pose(0.5), pose(1.0)];
        let rest = [curve.points.clone()];
        let motion = StrandMotion { later: &later, rest: Some(&rest), ..StrandMotion::default() };
        let o = options(basis);
        let moving = Strands::moving(&[(curve.clone(), radii.clone())], motion, &o);
        let still = strands(curve.clone(), 0.5, &o);
        for i in (0..still.segments().len() as u32).step_by(7) {
            let (a, b) = (moving.frame_at(i, 0.3, 0.0), still.frame(i, 0.3));
            assert_eq!((a.centre, a.phase), (b.centre, b.phase), "it starts where it is");
            let centre = b.centre.as_dvec3();
            for s in [0.25, 0.5, 0.75, 1.0] {
                let place = moving.frame_at(i, 0.3, s as f32);
                let want = move_by(s, &centre).as_vec3a();
                assert!((place.centre - want).length() < 0.03, "{basis:?} {s}: {} {want}", place.centre);
                let turn = (place.phase - b.phase) / std::f32::consts::TAU;
                let off = (turn - turn.round()).abs() * std::f32::consts::TAU;
                // A closed yarn shares out how much its frame turns more or less on the way around.
                assert!(off < if closed { 0.3 } else { 1e-5 }, "{basis:?} closed {closed} at {s}: {off}");
            }
        }
    }
}

#[test]
fn a_seam_of_equal_plies_closes_on_a_part_of_a_turn() {
    let mut o = options(Basis::CatmullRom);
    o.symmetry = TAU / 3.0;
    let free = strands(knit_like(200, false), 0.5, &o).frame(0, 0.0).phase;
    let s = strands(knit_like(200, true), 0.5, &o);
    let last = s.segments().len() as u32 - 1;
    let (a, b) = (s.frame(last, 1.0), s.frame(0, 0.0));
    let across = a.tangent.cross(a.normal);
    let ply = a.normal * a.phase.cos() + across * a.phase.sin();
    let angle = ply.dot(b.tangent.cross(b.normal)).atan2(ply.dot(b.normal)) - b.phase;
    let turns = f64::from(angle) / (TAU / 3.0);
    assert!((turns - turns.round()).abs() < 2e-3, "{turns}");
    assert_eq!(free, b.phase);
}

#[test]
fn the_phase_grows_with_arc_length_over_the_radius() {
    let curve = Curve {
        basis: Basis::Linear,
        closed: false,
        points: (0..50).map(|i| DVec3::new(f64::from(i) * 0.4, 0.0, 0.0)).collect(),
        radii: None,
        flattening: None,
    };
    let s = strands(curve, 0.5, &options(Basis::CatmullRom));
    let total: f32 = (0..s.segments().len()).map(|i| SegmentFrame::new(&s.frames, i).growth).sum();
    assert!((f64::from(total) - 0.4 * 49.0 * 0.4 / 0.5).abs() < 1e-3, "{total}");
    assert_eq!(s.frame(0, 0.0).phase, 0.7);
    assert!((s.frame(3, 0.3).normal - Vec3A::Z).length() < 1e-6, "a straight yarn carries +z along");
    assert!((s.length() - 19.6).abs() < 1e-9);
}

#[test]
fn tight_bends_are_found_where_they_are() {
    let points = (0..41)
        .map(|i| {
            let x = f64::from(i) - 20.0;
            DVec3::new(x, 6.0 * (-x * x / 2.0).exp(), 0.0)
        })
        .collect();
    let curve = Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening: None };
    let s = strands(curve, 0.5, &options(Basis::CatmullRom));
    assert_eq!(s.tight_bends().len(), 1);
    let bend = s.tight_bends()[0];
    let place = s.frame(bend.segment as u32, 0.5);
    assert!(place.centre.x.abs() < 1.5 && bend.fold > 0.5 && bend.fold < 3.0, "{bend:?} at {}", place.centre);
    assert_eq!(bend.places, 1);
}

/// Curvature of real files is without bounds: a point given twice, a step there and back.
#[test]
fn a_bend_without_radius_has_a_fold_of_a_number() {
    let p = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let there_and_back = vec![p(0.0, 0.0), p(5.0, 0.0), p(10.0, 0.0), p(5.0, 1e-9), p(0.0, 0.0)];
    let twice = vec![p(0.0, 0.0), p(5.0, 0.0), p(5.0, 0.0), p(5.0, 5.0), p(5.0, 10.0)];
    let arc = (0..20).map(|i| f64::from(i) * 0.1).map(|a| p(3.0 * a.cos(), 3.0 * a.sin())).collect();
    for (points, folded) in [(there_and_back, true), (twice, false), (arc, false)] {
        let curve = Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening: None };
        let s = strands(curve, 0.5, &options(Basis::CatmullRom));
        assert_eq!(!s.tight_bends().is_empty(), folded, "{:?}", s.tight_bends());
        // A turn back is half a turn.
        assert!(s.tight_bends().iter().all(|b| b.fold > 0.5 && b.fold < 3.2), "{:?}", s.tight_bends());
    }
}

#[test]
fn degenerate_curves_do_not_break() {
    let p = |x: f64| DVec3::new(x, 0.0, 0.0);
    for (points, closed, basis) in [
        (vec![p(0.0), p(0.0)], false, Basis::CatmullRom),
        (vec![p(0.0), p(1.0)], true, Basis::CatmullRom),
        (vec![p(0.0), p(1.0)], false, Basis::BSpline),
        (vec![p(0.0), p(1.0), p(0.0)], false, Basis::CatmullRom),
        (vec![p(0.0), p(1.0), p(1.0), p(2.0)], false, Basis::Linear),
        (vec![p(0.0), p(1.0), p(0.0)], true, Basis::BSpline),
    ] {
        for target in [Basis::CatmullRom, Basis::BSpline] {
            let curve = Curve { basis, closed, points: points.clone(), radii: None, flattening: None };
            let s = strands(curve, 0.3, &options(target));
            for i in 0..s.segments().len() as u32 {
                let place = s.frame(i, 0.5);
                assert!(place.centre.is_finite() && place.normal.is_finite() && place.phase.is_finite(), "{points:?}");
            }
        }
    }
    assert_eq!(Strands::new(Vec::new(), &options(Basis::CatmullRom)).yarns(), 0);
}

#[test]
fn distances_go_on_from_segment_to_segment_as_fast_as_the_yarn() {
    for basis in [Basis::CatmullRom, Basis::BSpline] {
        for closed in [false, true] {
            let s = strands(knit_like(60, closed), 0.5, &options(basis));
            let count = s.segments().len() as u32;
            let at = |segment, u| s.distance_along(segment, u).expect("asked for");
            assert_eq!(at(0, 0.0), 0.0);
            assert!((f64::from(at(count - 1, 1.0)) * 0.5 / s.length_of(0) - 1.0).abs() < 1e-3);
            for segment in 0..count {
                for u in [0.0, 0.3, 0.8] {
                    let step = (at(segment, u + 0.1) - at(segment, u)) / 0.1;
                    let stride = s.frame(segment, u + 0.05).stride;
                    assert!((step / stride - 1.0).abs() < 0.02, "{segment}, {u}: {step} for {stride}");
                }
                if segment > 0 {
                    assert!((at(segment - 1, 1.0) - at(segment, 0.0)).abs() < 1e-4);
                }
            }
            let silent = StrandOptions { distances: false, ..options(basis) };
            assert_eq!(strands(knit_like(60, closed), 0.5, &silent).distance_along(0, 0.5), None);
        }
    }
}
