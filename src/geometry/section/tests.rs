use std::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec3;

use super::{
    reach::{LOOK, angle},
    *,
};
use crate::{
    geometry::{
        curve::{Basis, Curve},
        fiber::{Placement, Plies},
        ply::PlyParameters,
        strand::{StrandOptions, Strands},
        tube::Tubes,
        yarn::{
            tests::{touching, touching_yarn},
            touching_plies,
        },
        yarn_frame::{ROUND, SectionGrowth},
    },
    math::sampler::Stream,
};

fn place() -> YarnFrame {
    YarnFrame {
        centre: Vec3A::ZERO,
        tangent: Vec3A::Z,
        curvature: Vec3A::ZERO,
        radius: 1.0,
        normal: Vec3A::X,
        phase: 0.3,
        turn: None,
        stride: 1.0,
        flattening: ROUND,
        flattening_turn: 0.0,
        growth: SectionGrowth::default(),
    }
}

fn ray(theta: f32, phi: f32, h: f32) -> (Vec3A, Vec3A) {
    let to_camera = Vec3A::new(theta.cos() * phi.cos(), theta.cos() * phi.sin(), theta.sin());
    let y = Vec3A::Z.cross(to_camera).normalize();
    (to_camera * 20.0 + h * y, -to_camera)
}

fn section_of(place: &YarnFrame, theta: f32, phi: f32, h: f32) -> Section<'static> {
    let (origin, direction) = ray(theta, phi, h);
    Section::new(place, origin, direction, true)
}

#[test]
fn fibers_of_an_elliptical_ply_keep_their_width_along_both_axes() {
    let ply = PlyParameters {
        radius: 0.6,
        aspect: 0.5,
        distance: 0.0,
        angle: 0.0,
        fibers: 20,
        fiber_radius: 0.09,
        fiber_twist: 0.0,
    };
    let shape = YarnShape::new(std::slice::from_ref(&ply), 0.0, true);
    let straight = YarnFrame { phase: 0.0, ..place() };
    const RAYS: i32 = 4000;
    for (phi, reach) in [(0.0, ply.long_axis()), (FRAC_PI_2, ply.short_axis())] {
        let (mut all, mut moment) = (0.0, 0.0);
        for i in 0..RAYS {
            let h = 2.0 * (f64::from(i) + 0.5) / f64::from(RAYS) - 1.0;
            let section = section_of(&straight, 0.0, phi as f32, h as f32);
            let mut crossings = Crossings::new();
            section.crossings(&shape, &mut crossings);
            let fibers: f64 = crossings.iter().map(|c| f64::from(c.fibers)).sum();
            all += fibers;
            moment += fibers * h * h;
        }
        let width = all * 2.0 / f64::from(RAYS);
        let want = 2.0 * ply.fiber_radius * f64::from(ply.fibers);
        assert!((width / want - 1.0).abs() < 2e-3, "{phi}: {width} {want}");
        // Centres are even within the ellipse that leaves the fibres inside.
        let want = (reach - ply.fiber_radius).powi(2) / 4.0 + ply.fiber_radius.powi(2) / 3.0;
        assert!((moment / all / want - 1.0).abs() < 4e-3, "{phi}: {} {want}", moment / all);
    }
}

/// The stretches of a ray inside each ply, by steps of `step` in depth until it leaves the yarn: `unwound` says where
/// (real section, phase of the plies) a point of the section's frame is.
fn walked(
    section: &Section<'_>,
    shape: &YarnShape,
    step: f32,
    core: bool,
    mut unwound: impl FnMut(Vec3A) -> Option<(Vec2, f32)>,
) -> Vec<Vec<(f32, f32)>> {
    let mut inside: Vec<Vec<(f32, f32)>> = vec![Vec::new(); shape.plies.len()];
    let mut depth = 0.5 * step;
    while depth < LOOK.longest {
        let Some((at, phase)) = unwound(section.point(depth)) else { break };
        if at.length() > 1.0 + 1e-3 && depth > 0.05 {
            break;
        }
        let round = section.pressed.map_or(at, |p| p.round(at));
        for (k, ply) in shape.plies.iter().enumerate() {
            let axis = ply.direction.rotate(angle(phase));
            let p = round - ply.distance * axis;
            let p = Vec2::new(p.dot(axis), axis.perp_dot(p)) * ply.stretch;
            if p.length() < if core { ply.core_radius } else { ply.radius } {
                let (from, to) = (depth - 0.5 * step, depth + 0.5 * step);
                match inside[k].last_mut() {
                    Some(last) if last.1 > from - 0.1 * step => last.1 = to,
                    _ => inside[k].push((from, to)),
                }
            }
        }
        depth += step;
    }
    inside
}

/// As [`walked`], in a yarn that goes on as a circle of curvature `bend` in the world's axes: each point is unbent by
/// itself, in double precision.
fn walked_on_circle(section: &Section<'_>, shape: &YarnShape, bend: Vec2) -> Vec<Vec<(f32, f32)>> {
    let k = f64::from(bend.length());
    walked(section, shape, 0.002, true, |p| {
        // Back from the section's frame to the world's axes.
        let p = section.to_world(p).as_dvec3();
        let bend = bend.as_dvec2();
        let (at, along) = if k > 1e-6 {
            let to_centre = bend / k;
            let out = 1.0 / k - p.truncate().dot(to_centre);
            let distance = out.hypot(p.z);
            let angle = p.z.atan2(out);
            if angle.abs() > 2.0 {
                return None;
            }
            (p.truncate() + to_centre * (1.0 / k - distance - p.truncate().dot(to_centre)), angle / k)
        } else {
            (p.truncate(), p.z)
        };
        // As the section's frame sees it.
        let world = Vec3A::new(at.x as f32, at.y as f32, 0.0);
        let local = section.to_local(world).truncate();
        let start = section.phase.to_angle();
        Some((local, start + shape.ply_rate * along as f32))
    })
}

/// Compares crossings with stretches walked: the largest difference of where a ply is entered or left, or of the length of
/// a stretch that only one of them has.
fn difference(crossings: &Crossings, walked: &[Vec<(f32, f32)>]) -> f32 {
    let mut worst = 0.0f32;
    for (k, stretches) in walked.iter().enumerate() {
        let found: Vec<_> = crossings.iter().filter(|c| c.ply == k && c.exit > c.enter).collect();
        for c in &found {
            let same = stretches.iter().map(|s| (s.0 - c.enter).abs().max((s.1 - c.exit).abs()));
            worst = worst.max(same.fold(c.exit - c.enter, f32::min));
        }
        for s in stretches {
            let same = found.iter().map(|c| (s.0 - c.enter).abs().max((s.1 - c.exit).abs()));
            worst = worst.max(same.fold(s.1 - s.0, f32::min));
        }
    }
    worst
}

/// Share of values at most `bound`.
fn share_within(values: &[f32], bound: f32) -> f64 {
    values.iter().filter(|v| **v <= bound).count() as f64 / values.len() as f64
}

#[test]
fn points_of_depth_are_on_the_ray() {
    for (theta, phi, h) in [(0.0, 0.2, 0.4), (0.7, 2.0, -0.7), (-1.5, -1.0, 0.1)] {
        let (origin, direction) = ray(theta, phi, h);
        let section = Section::new(&place(), origin, direction, true);
        assert!((section.h - h).abs() < 1e-5);
        let from = section.point_on_ray(0.0);
        assert!((section.point_on_ray(1.7) - from - 1.7 * direction).length() < 1e-4);
        // It is the ray, somewhere along it, shifted along the yarn to where this place is.
        assert!((from.truncate().length() - 1.0).abs() < 1e-5 && from.z.abs() < 1e-5);
    }
}

#[test]
fn plies_are_met_where_a_walk_along_the_ray_meets_them_at_any_angle_and_in_any_bend() {
    let mut stream = Stream::new(11);
    let mut next = |from: f32, to: f32| from + (to - from) * stream.next();
    let mut crossings = Crossings::new();
    let (mut off, mut blocked, mut met) = (Vec::new(), 0, 0);
    for i in 0..1500 {
        let count = 1 + i % 4;
        let shape = touching_yarn(count, 60, 0.4, f64::from(next(-0.7, 0.7)), -0.4);
        let bend =
            Vec2::from_angle(next(0.0, std::f32::consts::TAU)) * next(0.0, 1.0) * if i % 3 == 0 { 0.0 } else { 1.0 };
        let place = YarnFrame { curvature: bend.extend(0.0).into(), ..place() };
        // Even over the sphere, and a third of them nearly along the yarn.
        let theta = if i % 3 == 1 { next(1.2, 1.57) } else { next(-1.0, 1.0).asin() };
        let section = section_of(&place, theta, next(0.0, std::f32::consts::TAU), next(-0.999, 0.999));
        section.crossings(&shape, &mut crossings);
        let walk = walked_on_circle(&section, &shape, bend);
        // Where the yarn has turned by more than a right angle no walk on a circle means anything.
        let reach = crossings.iter().map(|c| c.travel[1].abs()).fold(0.0, f32::max);
        if bend.length() * reach > 1.2 {
            continue;
        }
        off.push(difference(&crossings, &walk));
        blocked += usize::from(crossings.iter().all(|c| c.exit <= c.enter) != walk.iter().all(Vec::is_empty));
        met += usize::from(!crossings.is_empty());
        assert!(crossings.windows(2).all(|w| w[0].enter <= w[1].enter), "nearest first");
        assert_eq!(section.meets_ply(&shape).is_some(), !crossings.is_empty(), "filter and shading agree");
    }
    assert!(met > 900, "{met}");
    let worst = off.iter().fold(0.0, |a: f32, b| a.max(*b));
    println!(
        "{} rays: within .02 {:.4}, .05 {:.4}, worst {worst}; {blocked} seen otherwise",
        off.len(),
        share_within(&off, 0.02),
        share_within(&off, 0.05)
    );
    assert!(share_within(&off, 0.02) > 0.985, "{}", share_within(&off, 0.02));
    // Rays that only graze the outer fibres are no stretch of a core.
    assert!((blocked as f64) < 0.02 * off.len() as f64, "{blocked}");
}

#[test]
fn rays_straight_into_a_bend_meet_plies_where_they_are() {
    // Along such a ray the yarn turns slowly at first and fast behind its axis, where it has little room.
    let mut stream = Stream::new(12);
    let mut next = |from: f32, to: f32| from + (to - from) * stream.next();
    let mut crossings = Crossings::new();
    let mut off = Vec::new();
    for _ in 0..600 {
        let shape = touching_yarn(2, 60, 0.4, f64::from(next(-0.5, 0.5)), -0.4);
        let phi = next(0.0, std::f32::consts::TAU);
        // Away from the camera.
        let bend = -next(0.6, 0.9) * Vec2::from_angle(phi + next(-0.3, 0.3));
        let place = YarnFrame { curvature: bend.extend(0.0).into(), ..place() };
        let section = section_of(&place, next(-0.2, 0.2), phi, next(-0.7, 0.7));
        section.crossings(&shape, &mut crossings);
        let walk = walked_on_circle(&section, &shape, bend);
        let first = walk.iter().flatten().map(|s| s.0).fold(f32::INFINITY, f32::min);
        match crossings.iter().find(|c| c.exit > c.enter) {
            Some(met) => off.push((met.enter - first).abs()),
            None => assert!(walk.iter().all(Vec::is_empty), "a ply is missed at {first}"),
        }
    }
    let worst = off.iter().fold(0.0, |a: f32, b| a.max(*b));
    println!("within .02 {:.4}, .05 {:.4}, worst {worst}", share_within(&off, 0.02), share_within(&off, 0.05));
    assert!(share_within(&off, 0.02) > 0.99 && worst < 0.05, "{worst}");
}

/// A closed curve in space that bends nearly everywhere, where it does most by 1 / `tightest` of its radius, 1.
fn wild_loop(stream: &mut Stream, tightest: f64) -> Strands {
    let (raw, curvatures) = loop {
        let mut wave = || [0.3 + f64::from(stream.next()), TAU * f64::from(stream.next())];
        let waves: [[[f64; 2]; 3]; 3] = std::array::from_fn(|_| [wave(), wave(), wave()]);
        let raw = move |t: f64| {
            let sum = |axis: usize| -> f64 {
                let term = |(k, w): (usize, &[[f64; 2]; 3])| {
                    let k = (k + 1) as f64;
                    w[axis][0] * (k * t + w[axis][1]).sin() / k.powf(1.5)
                };
                waves.iter().enumerate().map(term).sum()
            };
            DVec3::new(sum(0), sum(1), sum(2))
        };
        let h = 1e-3;
        let mut curvatures: Vec<f64> = (0..1000)
            .map(|i| {
                let t = TAU * f64::from(i) / 1000.0;
                let (a, b, c) = (raw(t - h), raw(t), raw(t + h));
                let (d1, d2) = ((c - a) / (2.0 * h), (c - 2.0 * b + a) / (h * h));
                d1.cross(d2).length() / d1.length().powi(3)
            })
            .collect();
        curvatures.sort_by(f64::total_cmp);
        if curvatures[999] < 5.0 * curvatures[500] {
            break (raw, curvatures);
        }
    };
    let size = curvatures[999] / tightest;
    let n = 200;
    let points: Vec<DVec3> = (0..n).map(|i| size * raw(TAU * f64::from(i) / f64::from(n))).collect();
    let curve = Curve { basis: Basis::CatmullRom, closed: true, points, radii: None, flattening: None };
    let basis = Basis::BSpline;
    let options = StrandOptions { tolerance: 0.005, longest_segment: 1.5, ..strand_options(basis, 0.6, TAU / 3.0) };
    Strands::new(&[(curve, vec![1.0; n as usize])], &options)
}

/// Through a curve's own points.
fn strand_options(basis: Basis, ply_rate: f64, symmetry: f64) -> StrandOptions {
    StrandOptions {
        basis,
        tolerance: 0.0,
        longest_segment: f64::INFINITY,
        ply_rate,
        symmetry,
        phases: vec![0.4],
        distances: false,
        unevenness: None,
        tube: 1.0,
    }
}

#[test]
fn in_real_loops_plies_are_met_where_the_yarn_itself_says() {
    // The walk looks for the nearest place on the yarn itself, at every step, from the step before.
    let mut stream = Stream::new(5);
    let (radius, distance) = touching_plies(3);
    let parameters: Vec<PlyParameters> = (0..3)
        .map(|k| PlyParameters {
            radius,
            aspect: 1.0,
            distance,
            angle: TAU * f64::from(k) / 3.0,
            fibers: 60,
            fiber_radius: 0.02,
            fiber_twist: -0.3,
        })
        .collect();
    let shape = YarnShape::new(&parameters, (0.6 * distance).atan(), true);
    let mut crossings = Crossings::new();
    let (mut off, mut first, mut seen_otherwise) = (Vec::new(), Vec::new(), 0);
    for round in 0..8 {
        let strands = wild_loop(&mut stream, 0.3 + 0.1 * f64::from(round));
        let segments = strands.segments().len();
        for _ in 0..150 {
            let segment = (2.0 + (segments as f32 - 4.0) * stream.next()) as u32;
            let u = stream.next();
            let place = strands.frame(segment, u);
            // A ray that enters the tube at a point of this place's section.
            let out = Vec2::from_angle(std::f32::consts::TAU * stream.next());
            let normal = out.x * place.normal + out.y * place.tangent.cross(place.normal);
            let z = 2.0 * stream.next() - 1.0;
            let turn = Vec2::from_angle(std::f32::consts::TAU * stream.next()) * (1.0 - z * z).sqrt();
            let direction = Vec3A::new(turn.x, turn.y, z);
            if direction.dot(normal) > -0.02 {
                continue;
            }
            let point = place.centre + normal;
            let section =
                Section::at_hit(Walker::new(&strands, segment, u, 0.0), point - 3.0 * direction, direction, 3.0, true);
            section.crossings(&shape, &mut crossings);
            let (mut at, _) = Walker::new(&strands, segment, u, 0.0);
            let mut place = strands.frame(segment, u);
            let mut lost = false;
            let walk = walked(&section, &shape, 0.004, true, |p| {
                let world = section.centre + section.radius * section.to_world(p);
                for _ in 0..4 {
                    let off = world - place.centre;
                    let step = off.dot(place.tangent) / (1.0 - place.curvature.dot(off)).max(0.1);
                    let Some(next) = at.walk(step) else {
                        lost = true;
                        return None;
                    };
                    place = next;
                }
                let (off, across) = (world - place.centre, place.tangent.cross(place.normal));
                Some((Vec2::new(off.dot(place.normal), off.dot(across)), place.phase))
            });
            if lost {
                continue;
            }
            off.push(difference(&crossings, &walk));
            let begins = |k: usize| walk[k].first().map_or(f32::INFINITY, |s| s.0);
            let front = (0..3).map(begins).fold(f32::INFINITY, f32::min);
            let found = crossings.iter().find(|c| c.exit > c.enter).map_or(f32::INFINITY, |c| c.enter);
            if front.is_finite() != found.is_finite() {
                seen_otherwise += 1;
            } else if front.is_finite() {
                first.push((front - found).abs());
            }
        }
    }
    let limit = 0.05 * radius as f32;
    println!(
        "{} rays: all within {limit:.3} {:.4}, first {:.4}, {seen_otherwise} seen otherwise",
        off.len(),
        share_within(&off, limit),
        share_within(&first, limit)
    );
    assert!(first.len() > 400, "{}", first.len());
    assert!(share_within(&first, limit) > 0.99, "{}", share_within(&first, limit));
    assert!((seen_otherwise as f64) < 0.005 * off.len() as f64, "{seen_otherwise} of {}", off.len());
}

#[test]
fn what_a_ray_sees_changes_steadily_with_its_angle() {
    // From across the yarn to along it: the depth of the first ply moves in small steps but where another ply or another
    // turn of it comes first.
    let shape = touching_yarn(3, 60, 0.4, 0.4, -0.4);
    let mut crossings = Crossings::new();
    for bend in [0.0, 0.5, 0.9] {
        let place = YarnFrame { curvature: Vec3A::new(-bend, 0.0, 0.0), ..place() };
        for h in [-0.7, -0.2, 0.0, 0.4] {
            let (mut before, mut jumps) = (None, 0);
            let steps = 40_000;
            for i in 0..steps {
                let theta = 1.55 * i as f32 / steps as f32;
                let section = section_of(&place, theta, 0.0, h);
                section.crossings(&shape, &mut crossings);
                let now = crossings.first().map(|c| c.enter);
                if let (Some(a), Some(b)) = (before, now) {
                    let jump: f32 = b - a;
                    // Where the yarn has bent by a right angle, a circle is no guide.
                    let near = crossings[0].travel[0].abs() * bend < 1.0;
                    jumps += i32::from(near && jump.abs() > 0.03);
                }
                jumps += i32::from(now.is_some() != before.is_some());
                before = now;
            }
            assert!(jumps < 12, "bend {bend}, h {h}: {jumps} jumps");
        }
    }
}

#[test]
fn pressed_plies_are_the_pressed_image_of_round_ones() {
    // Points of the ray are in a ply if their image in the round section is.
    let shape = touching_yarn(3, 60, 0.4, 0.35, -0.4);
    let mut crossings = Crossings::new();
    let (mut off, mut seen) = (Vec::new(), 0);
    for i in 0..400 {
        let (theta, phi) = (-0.9 + 0.0044 * i as f32, 0.05 * i as f32);
        let h = -0.99 + 1.98 * ((i * 37 % 400) as f32) / 399.0;
        let ratio = 0.4 + 0.0015 * i as f32;
        let place = YarnFrame { flattening: ratio * Vec2::from_angle(0.7 * i as f32), ..place() };
        let section = section_of(&place, theta, phi, h);
        section.crossings(&shape, &mut crossings);
        let start = section.phase.to_angle();
        let walk = walked(&section, &shape, 0.001, true, |p| Some((p.truncate(), start + shape.ply_rate * p.z)));
        off.push(difference(&crossings, &walk));
        seen += crossings.len();
        assert_eq!(section.meets_ply(&shape).is_some(), !crossings.is_empty(), "filter and shading agree");
    }
    assert!(seen > 300 && share_within(&off, 0.02) > 0.98, "{}", share_within(&off, 0.02));
}

#[test]
fn pressed_yarns_hold_the_same_fibers_in_the_same_area() {
    // As wide as the round yarn they have half its area, and fibres thinner by the root of that. A ray along the short axis
    // meets as many centres as before within a fibre's width, one along the long axis twice as many.
    let shape = touching_yarn(1, 60, 0.4, 0.0, 0.0);
    let mut crossings = Crossings::new();
    let mut count = |flattening: Vec2, h: f32| {
        section_of(&YarnFrame { flattening, ..place() }, 0.0, 0.0, h).crossings(&shape, &mut crossings);
        crossings.iter().map(|c| c.fibers).sum::<f32>()
    };
    for h in [0.0, 0.2, -0.4] {
        let round = count(ROUND, h);
        // About: how wide a fibre is decides from how far it counts.
        assert!((count(Vec2::new(0.5, 0.0), h) / round / 0.5f32.sqrt() - 1.0).abs() < 0.05);
        assert!((count(Vec2::new(0.0, 0.5), 0.5 * h) / round / 2f32.sqrt() - 1.0).abs() < 0.05);
    }
    // All lines together, whose distance is the same, meet as many as are in the yarn, as thick as they are.
    let mut all =
        |flattening: Vec2| (0..4000).map(|i| f64::from(count(flattening, 0.0005 * i as f32 - 1.0))).sum::<f64>();
    let round = all(ROUND);
    for flattening in [Vec2::new(0.5, 0.0), Vec2::new(0.0, 0.5)] {
        let share = all(flattening) / round;
        assert!((share - 0.5f64.sqrt()).abs() < 1e-3, "{flattening} {share}");
    }
    assert_eq!(count(Vec2::new(0.0, 0.5), 0.6), 0.0, "a ray that meets the round tube only passes");
}

#[test]
fn fibers_on_a_ray_are_those_of_its_length_and_tilt() {
    // Even fibres: 2 r_f n / area times the integral of |w x t| along the ray, at any angle; by a walk through the core.
    let shape = touching_yarn(2, 400, 0.4, 0.3, -0.5);
    let mut crossings = Crossings::new();
    for i in 0..200 {
        let theta = 1.4 * (i as f32 / 200.0);
        let section = section_of(&place(), theta, 0.1 * i as f32, 0.9 - 0.0089 * i as f32);
        section.crossings(&shape, &mut crossings);
        for c in &crossings {
            let ply = &shape.plies[c.ply];
            if c.exit - c.enter < 0.3 {
                continue;
            }
            let n = 400;
            let direction = section.direction();
            let sum: f32 = (0..n)
                .map(|k| {
                    let depth = c.enter + (c.exit - c.enter) * (k as f32 + 0.5) / n as f32;
                    let t = section.fiber_tangent(&shape, c.ply, section.point(depth), c.travel_at(depth));
                    direction.cross(t).length()
                })
                .sum();
            let sigma = 2.0 * ply.fiber_radius * ply.fibers / (std::f32::consts::PI * ply.core_radius.powi(2));
            let want = sigma * sum * (c.exit - c.enter) / n as f32;
            // A ray along the yarn winds through a ply: what is kept of it there is one chord.
            let bound = if theta < 0.8 { 0.1 } else { 0.25 };
            assert!((c.fibers / want - 1.0).abs() < bound, "theta {theta}: {} {want}", c.fibers);
        }
    }
}

/// Where a ray comes in along the fibres it meets few at first, and many where it comes in across them.
#[test]
fn fibers_on_a_ray_lie_where_they_are_tilted_against_it() {
    let shape = touching_yarn(1, 400, 0.4, 0.0, 0.45);
    let mut crossings = Crossings::new();
    let (mut off, mut most, mut even) = (0.0f32, 0.0f32, 0.0f32);
    let mut looks = 0.0;
    for i in 0..200 {
        let theta = 1.2 * (i as f32 / 200.0);
        let section = section_of(&place(), theta, 0.1 * i as f32, 0.8 - 0.00789 * i as f32);
        section.crossings(&shape, &mut crossings);
        for c in &crossings {
            const STEPS: usize = 400;
            let direction = section.direction();
            // Packings are measured across the yarn.
            let across = Vec3A::new(direction.x, direction.y, 0.0).normalize();
            let tilt = |share: f32| {
                let depth = c.enter + (c.exit - c.enter) * share;
                let t = section.fiber_tangent(&shape, c.ply, section.point(depth), c.travel_at(depth));
                direction.cross(t).length() / across.cross(t).length()
            };
            let tilts: Vec<f32> = (0..STEPS).map(|k| tilt((k as f32 + 0.5) / STEPS as f32)).collect();
            let all: f32 = tilts.iter().sum();
            let mut before = 0.0;
            for (k, tilt) in tilts.iter().enumerate() {
                before += tilt;
                let want = (k + 1) as f32 / STEPS as f32;
                let error = (c.share_before(before / all * c.fibers) - want).abs();
                off += error;
                most = most.max(error);
                even += (before / all - want).abs();
                looks += 1.0;
            }
        }
    }
    assert!(looks > 50_000.0 && most < 0.08 && off < 0.25 * even, "{} {most}, evenly {}", off / looks, even / looks);
}

#[test]
fn perpendicular_rays_see_the_same_with_and_without_tilt() {
    let shape = touching_yarn(3, 60, 0.4, 0.35, -0.4);
    let (mut a, mut b) = (Crossings::new(), Crossings::new());
    let (origin, direction) = ray(0.0, 0.7, 0.3);
    Section::new(&place(), origin, direction, true).crossings(&shape, &mut a);
    Section::new(&place(), origin, direction, false).crossings(&shape, &mut b);
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(&b) {
        assert!((a.enter - b.enter).abs() < 1e-6 && (a.fibers - b.fibers).abs() < 1e-5);
    }
}

#[test]
fn the_picture_does_not_depend_on_where_the_camera_stands() {
    // Two cameras see the same ply at the same place in the world.
    let shape = touching_yarn(3, 60, 0.4, 0.0, 0.0);
    for phi in [0.0f32, 1.0, 2.5, 4.0] {
        let section = section_of(&place(), 0.0, phi, 0.0);
        for (k, ply) in shape.plies.iter().enumerate() {
            let axis = ply.direction.rotate(section.phase);
            let world = section.to_world(Vec3A::new(axis.x, axis.y, 0.0));
            let angle = 0.3 + std::f32::consts::TAU * k as f32 / 3.0;
            assert!((world - Vec3A::new(angle.cos(), angle.sin(), 0.0)).length() < 1e-5);
        }
    }
}

#[test]
fn short_ways_out_are_those_that_are_followed() {
    // Light that leaves from inside: two stations from the place itself against the march from station to station.
    let mut stream = Stream::new(17);
    let mut next = |from: f32, to: f32| from + (to - from) * stream.next();
    let (mut off, mut short) = (Vec::new(), 0);
    for i in 0..2000 {
        let shape = touching_yarn(1 + i % 4, 60, 0.4, f64::from(next(-0.5, 0.5)), -0.4);
        let bend = Vec2::from_angle(next(0.0, std::f32::consts::TAU)) * next(0.0, 0.6);
        let flattening = Vec2::from_angle(next(0.0, std::f32::consts::TAU)) * next(0.3, 0.9);
        let flattening = if i % 2 == 0 { ROUND } else { flattening };
        let place = YarnFrame { curvature: bend.extend(0.0).into(), flattening, ..place() };
        let mut section = section_of(&place, next(-0.8, 0.8), next(0.0, std::f32::consts::TAU), next(-0.9, 0.9));
        section.pressed_turn = next(-0.2, 0.2);
        let depth = next(0.1, 0.9) * section.enter;
        if section.pressed.is_some_and(|pressed| pressed.round(section.point(depth).truncate()).length() > 1.0) {
            // Beside what is pressed flat.
            continue;
        }
        let from = section.inside(&shape, section.point(depth), depth * section.direction().z);
        let z = next(-0.98, 0.98);
        let w: Vec3A = (Vec2::from_angle(next(0.0, std::f32::consts::TAU)) * (1.0 - z * z).sqrt()).extend(z).into();
        let Some(way) = from.way_out(&section, Vec3A::ZERO, w) else { continue };
        short += 1;
        let line = Line { start: from.point, direction: w, reach: LOOK };
        let mut near = section.neighbourhood(section.turn(&shape), 0.0, LOOK);
        let first = section.step(&mut near, line.start, w, 0.0, LOOK);
        let mut long = Way::new();
        section.march(&line, first, &mut near, |a, b| keep(&mut long, a, b));
        // The length inside of all cores.
        let cores = |way: &[Station]| {
            let mut sum = 0.0;
            way::passages::<true>(way, &shape.plies, &shape.fours, |k, passing| {
                let p = passing.as_it_goes(shape.plies[k].core_radius);
                sum += p.exit.depth - p.enter.depth;
            });
            sum
        };
        off.push((cores(&way) - cores(&long)).abs());
    }
    println!("{short} short ways: within .05 {:.4}, .2 {:.4}", share_within(&off, 0.05), share_within(&off, 0.2));
    assert!(short > 1200, "{short}");
    assert!(share_within(&off, 0.05) > 0.95 && share_within(&off, 0.2) > 0.98);
}

#[test]
fn normals_stand_on_the_plies() {
    // Points moved a little along the normal's plane stay on the ply's surface: the normal is that of the walk's distance.
    let mut stream = Stream::new(3);
    let shape = touching_yarn(3, 60, 0.4, 0.5, -0.4);
    let mut crossings = Crossings::new();
    for i in 0..200 {
        let bend = Vec3A::new(0.8 * stream.next(), 0.3 * stream.next(), 0.0);
        let flattening = ROUND * if i % 2 == 0 { 1.0 } else { 0.6 };
        let place = YarnFrame { curvature: bend, flattening, ..place() };
        let section = section_of(
            &place,
            1.0 - 2.0 * stream.next(),
            std::f32::consts::TAU * stream.next(),
            1.6 * stream.next() - 0.8,
        );
        section.crossings(&shape, &mut crossings);
        let Some(c) = crossings.iter().find(|c| c.exit - c.enter > 0.2 && c.travel[0].abs() < 0.5) else { continue };
        let ply = &shape.plies[c.ply];
        let distance = |p: Vec3A| {
            let spot = section.inside(&shape, p, 0.01);
            (spot.at - ply.distance * ply.direction).length()
        };
        let (at, e) = (section.point(c.enter), 2e-3);
        let slope = |v: Vec3A| (distance(at + e * v) - distance(at - e * v)) / (2.0 * e);
        let want = Vec3A::new(slope(Vec3A::X), slope(Vec3A::Y), slope(Vec3A::Z)).normalize();
        let normal = c.normal(&shape, &section);
        assert!(normal.dot(want) > 0.995, "{normal} {want}");
    }
}

#[test]
fn elliptical_plies_have_the_chords_of_their_ellipse() {
    let ply = PlyParameters {
        radius: 0.5,
        aspect: 0.64,
        distance: 0.45,
        angle: 0.4,
        fibers: 100,
        fiber_radius: 1e-4,
        fiber_twist: 0.0,
    };
    let shape = YarnShape::new(&[ply], 0.0, true);
    assert!(shape.elliptical && !shape.filled);
    let (short, long) = (0.5 * 0.8, 0.5 / 0.8);
    let mut crossings = Crossings::new();
    for i in 0..200 {
        let phi = 0.1 * i as f32;
        let h = -0.95 + 0.0095 * i as f32;
        let section = section_of(&place(), 0.0, phi, h);
        section.crossings(&shape, &mut crossings);
        let axis = shape.plies[0].direction.rotate(section.phase);
        let inside = (0..40_000)
            .filter(|s| {
                let x = 1.0 - 2.0 * (*s as f32 + 0.5) / 40_000.0;
                let p = Vec2::new(x, h) - 0.45 * axis;
                x.abs() <= section.enter && (p.dot(axis) / short).powi(2) + (p.perp_dot(axis) / long).powi(2) < 1.0
            })
            .count() as f32
            / 20_000.0;
        let chord = crossings.first().map_or(0.0, |c| c.exit - c.enter);
        assert!((inside - chord).abs() < 2e-3, "ray {i}: {inside} {chord}");
        if let Some(c) = crossings.first() {
            // Even fibres: 2 r_f n / area of the ellipse for each unit of chord.
            let want = 2.0 * 1e-4 * 100.0 / (std::f32::consts::PI * 0.25) * chord;
            assert!(chord < 0.05 || (c.fibers / want - 1.0).abs() < 2e-2, "ray {i}: {} {want}", c.fibers);
        }
    }
}

#[test]
fn extreme_rays_stay_finite() {
    let shape = touching_yarn(3, 60, 0.4, 1.5, -1.5);
    let mut crossings = Crossings::new();
    for bend in [0.0, 1.0, 30.0] {
        for theta in [std::f32::consts::FRAC_PI_2, 1.57, -1.57, 0.0] {
            for h in [-1.0, 1.0, 0.0, 0.999_999] {
                let place = YarnFrame { curvature: Vec3A::new(bend, 0.0, 0.0), ..place() };
                let section = section_of(&place, theta, 0.3, h);
                section.crossings(&shape, &mut crossings);
                for c in &crossings {
                    assert!(c.fibers.is_finite() && c.enter.is_finite() && c.exit.is_finite(), "{c:?}");
                    assert!(c.normal(&shape, &section).is_finite());
                    assert!(c.tangent_at_entry(&shape, &section).is_finite());
                    assert!(c.ply_tangent(&shape, &section).is_finite());
                }
            }
        }
    }
}

/// At a cusp of a curve neither its bend nor the turn of its plies has a bound; ways through it must end all the same.
#[test]
fn ways_through_a_cusp_end() {
    let shape = touching_yarn(2, 60, 0.4, 0.3, 0.2);
    let mut stream = Stream::new(7);
    for bend in [1e2_f32, 1e4, 6e5, 1e9] {
        for _ in 0..50 {
            let [phi, theta, h] = [stream.next(), stream.next(), stream.next()];
            let cusp = YarnFrame {
                curvature: Vec3A::new(bend, 0.05 * bend, 0.0),
                turn: Some(1e-3 * bend),
                flattening_turn: 1e-3,
                ..place()
            };
            let section = section_of(&cusp, 2.8 * (theta - 0.5), TAU as f32 * phi, 1.98 * (h - 0.5));
            let mut stations = 0;
            section.march_ray(&shape, |_, _| {
                stations += 1;
                if stations < 100_000 { std::ops::ControlFlow::Continue(()) } else { std::ops::ControlFlow::Break(()) }
            });
            assert!(stations <= 2000, "bend {bend}: {stations} stations");
        }
    }
}

/// What is left of a ply's fibres on the camera's line, as the camera counts it and as light does that goes on along the same line.
#[test]
fn light_that_goes_straight_on_meets_the_fibers_that_the_camera_has_not_met() {
    // Of plies and fibres of both hands, across the yarn and up to 45 degrees along it, where the unwound way is bent.
    for (ply_twist, fiber_twist) in [(13.0, -19.0), (13.0, 19.0), (-25.0, 10.0)] {
        let shape = touching_yarn(3, 70, 0.5, ply_twist, fiber_twist);
        for theta in [0.0f32, 0.4, -0.8] {
            let (mut counted, mut met, mut off) = (0.0, 0.0, 0.0);
            for i in 0..4000 {
                let mut stream = Stream::new(i);
                let phase = stream.next() * TAU as f32;
                let section = section_of(&YarnFrame { phase, ..place() }, theta, 0.0, 1.9 * (stream.next() - 0.5));
                let mut crossings = Crossings::new();
                section.crossings(&shape, &mut crossings);
                for c in crossings.iter().filter(|c| c.fibers > 0.05) {
                    let x = 0.9 * stream.next();
                    let depth = (c.foot - c.chord.place(x) / section.cos).max(0.0);
                    let from = section.inside(&shape, section.point(depth), c.travel_at(depth));
                    let w = section.direction();
                    let mut ahead = 0.0;
                    section.plies_ahead(&shape, &from, Vec3A::ZERO, w, |way| {
                        if way.ply == c.ply {
                            let chord =
                                shape.plies[c.ply].chord(way.offset, way.length, 1.0, from.wide(w) / way.stretched);
                            ahead += way.tilt(&shape, &section, &from, w, &chord) * chord.ahead(-way.foot);
                        }
                    });
                    // A ray may cross a ply twice.
                    if crossings.iter().filter(|other| other.ply == c.ply).count() == 1 {
                        counted += (1.0 - x) * c.fibers;
                        met += ahead;
                        off += ((1.0 - x) * c.fibers - ahead).abs();
                    }
                }
            }
            let case = format!("plies {ply_twist}, fibres {fiber_twist}, theta {theta}");
            assert!((met / counted - 1.0).abs() < MEAN_OFF, "{case}: {met} of {counted}");
            assert!(off / counted < EACH_OFF, "{case}: each off by {}", off / counted);
        }
    }
}

/// By how much the light's count may be off on the mean, and in each place: it knows the fibres' tilt in the middle of its way only.
const MEAN_OFF: f32 = 0.03;
const EACH_OFF: f32 = 0.12;

#[test]
fn points_of_the_unwound_yarn_are_found_where_they_lie() {
    let mut stream = Stream::new(9);
    let shape = touching_yarn(3, 40, 0.4, 20.0, 0.0);
    for i in 0..400 {
        let mut u = || stream.next();
        let place = YarnFrame {
            curvature: if i % 4 == 0 { Vec3A::ZERO } else { Vec3A::new(0.9 * u(), 0.4 * u() - 0.2, 0.0) },
            flattening: if i % 3 == 0 { ROUND } else { Vec2::new(0.3 * u(), 0.3 * u()) },
            flattening_turn: 0.2 * u(),
            turn: Some(0.5 * u()),
            ..place()
        };
        let section = section_of(&place, 0.8 * u() - 0.4, TAU as f32 * u(), u() - 0.5);
        let at = 0.9 * u().sqrt() * angle(TAU as f32 * u());
        let travel = 0.6 * u() - 0.3;
        let inside = section.inside(&shape, section.point_at(&shape, at, travel), travel);
        assert!((inside.at - at).length() < 1e-3, "{} {at}: {place:?}", inside.at);
        assert!((inside.travel - travel).abs() < 1e-3, "{} {travel}: {place:?}", inside.travel);
    }
}

/// A yarn of radius 1 that is pressed to half of its width and dives as warps of a weave do: 60 degrees steep, bent by `bend` at its
/// crests. Short axes lie in the plane of the wave.
fn dive(shape: &YarnShape, bend: f64) -> Strands {
    const STEEP: f64 = 1.73;
    let (rate, height) = (bend / STEEP, STEEP * STEEP / bend);
    let count = (4.0 * std::f64::consts::TAU / rate) as u32;
    let place = |i: u32| 0.5 * f64::from(i);
    let points = (0..count).map(|i| DVec3::new(0.0, place(i), height * (rate * place(i)).sin())).collect();
    let short = |i: u32| (0.5 * DVec3::new(0.0, -STEEP * (rate * place(i)).cos(), 1.0).normalize()).as_vec3();
    let flattening = Some((0..count).map(short).collect());
    let curve = Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening };
    let options = strand_options(Basis::CatmullRom, f64::from(shape.ply_rate), shape.symmetry);
    Strands::new(&[(curve, vec![1.0; count as usize])], &options)
}

/// Light that goes along a pressed yarn leaves through fibres that lie there: the share that meets none is that of explicit fibres, also
/// where the yarn turns away.
#[test]
fn light_along_a_sharp_bend_meets_the_fibers_that_are_there() {
    const TWIST: f64 = -0.33;
    let shape = touching_yarn(3, 40, 0.4, 0.2, TWIST);
    let parameters = touching(3, 40, 0.4, TWIST);
    let strands = dive(&shape, 1.0);
    let (mut clear, mut expected, mut rays) = (0.0, 0.0, 0);
    for seed in 1..4 {
        let made = Plies::new(&strands, &parameters, &shape, seed);
        let plies: Vec<Tubes> = (0..3).map(|ply| made.fibers(ply, Placement::Regular).0).collect();
        let ways: Vec<Vec<Vec3A>> =
            plies.iter().flat_map(|tubes| (0..tubes.count()).map(|fiber| way_of(tubes, fiber))).collect();
        for (ply, tubes) in plies.iter().enumerate() {
            for segment in (0..tubes.segments().len() as u32).step_by(3) {
                let at = tubes.place(segment, 0.5);
                let own = 40 * ply + tubes.tube_of(segment);
                let Some((walker, place)) = abreast(&strands, at.centre) else { continue };
                // Along the yarn, by 0.4 radians off it.
                let w = (place.tangent + 0.42 * Vec3A::new(0.8, 0.36, 0.48)).normalize();
                let meets = |way: &Vec<Vec3A>| {
                    way.iter().any(|p| {
                        let (off, along) = (*p - at.centre, (*p - at.centre).dot(w));
                        along > 0.0 && along < 3.0 && (off - along * w).length() < at.radius
                    })
                };
                let met = ways.iter().enumerate().any(|(fiber, way)| fiber != own && meets(way));
                let section = Section::at_start((walker, place), at.centre, w, true);
                let (inside, w) = (section.inside(&shape, section.point(0.0), 0.0), section.to_local(w));
                let mut fibers = 0.0;
                section.plies_ahead(&shape, &inside, Vec3A::ZERO, w, |ahead| {
                    let wide = inside.wide(w) / ahead.stretched;
                    let chord = shape.plies[ahead.ply].chord(ahead.offset, ahead.length, section.thinness(), wide);
                    fibers += ahead.tilt(&shape, &section, &inside, w, &chord) * chord.ahead(-ahead.foot);
                });
                clear += f64::from(u8::from(!met));
                expected += f64::from((-fibers).exp());
                rays += 1;
            }
        }
    }
    let [clear, expected] = [clear, expected].map(|sum: f64| sum / f64::from(rays));
    assert!(rays > 1000 && (expected / clear - 1.0).abs() < 0.12, "{rays} rays: clear {clear}, expected {expected}");
}

/// The axis of a fibre, finely.
fn way_of(tubes: &Tubes, fiber: usize) -> Vec<Vec3A> {
    let places = tubes.segments_of(fiber).flat_map(|s| (0..16).map(move |k| (s as u32, k as f32 / 16.0)));
    places.map(|(segment, u)| tubes.place(segment, u).centre).collect()
}

/// The place abreast of a point within a strand, away from its ends.
fn abreast(strands: &Strands, point: Vec3A) -> Option<(Walker<'_>, YarnFrame)> {
    let segments = strands.segments().len() as u32;
    let places = (4..segments - 4).flat_map(|s| (0..8).map(move |k| (s, k as f32 / 8.0)));
    let (segment, u) = places.min_by(|a, b| {
        let off = |&(s, u): &(u32, f32)| strands.frame(s, u).centre.distance_squared(point);
        off(a).total_cmp(&off(b))
    })?;
    let (mut walker, mut place) = Walker::new(strands, segment, u, 0.0);
    for _ in 0..4 {
        place = walker.walk_abreast(&place, point)?;
    }
    let near = (4..segments - 4).contains(&walker.segment()) && (point - place.centre).dot(place.tangent).abs() < 1e-2;
    near.then_some((walker, place))
}
