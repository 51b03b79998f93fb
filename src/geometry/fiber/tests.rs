use glam::{DVec3, Vec3, Vec3A};

use super::{flyaway::Flyaways, *};
use crate::geometry::{
    curve::Curve,
    strand::StrandOptions,
    yarn::tests::{touching, touching_yarn},
};

/// A yarn of radius 0.5 bent to an arch.
fn arch(shape: &YarnShape) -> Strands {
    let points = (0..40)
        .map(|i| {
            let t = f64::from(i) / 39.0 * 2.0;
            DVec3::new(6.0 * t.cos(), 6.0 * t.sin(), 0.4 * t)
        })
        .collect();
    let curve = Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening: None };
    let options = StrandOptions {
        basis: Basis::BSpline,
        tolerance: 0.002,
        longest_segment: 1.5,
        ply_rate: f64::from(shape.ply_rate),
        symmetry: shape.symmetry,
        phases: vec![0.3],
        distances: false,
        unevenness: None,
        tube: 1.0,
    };
    Strands::new(&[(curve, vec![0.5; 40])], &options)
}

/// A straight yarn along z of radius 1 that is pressed along y, to axes of 1 : `ratio`.
fn pressed(shape: &YarnShape, ratio: f64) -> Strands {
    let points: Vec<DVec3> = (0..30).map(|i| DVec3::new(0.0, 0.0, 0.5 * f64::from(i))).collect();
    let flattening = Some(vec![Vec3::Y * ratio as f32; points.len()]);
    let curve = Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening };
    let options = StrandOptions {
        basis: Basis::CatmullRom,
        tolerance: 0.01,
        longest_segment: 2.0,
        ply_rate: f64::from(shape.ply_rate),
        symmetry: 1.0,
        phases: vec![0.0],
        distances: false,
        unevenness: None,
        tube: 1.0,
    };
    Strands::new(&[(curve, vec![1.0; 30])], &options)
}

/// Where a point lies in the section of the nearest place of a yarn: the place, and the point in yarn radii from it.
fn locate(strands: &Strands, point: Vec3A) -> (YarnFrame, DVec2) {
    let place = strands
        .segments_of(0)
        .flat_map(|s| (0..64).map(move |k| (s, k as f32 / 64.0)))
        .map(|(s, u)| strands.frame(s, u))
        .min_by(|a, b| (a.centre - point).length().total_cmp(&(b.centre - point).length()))
        .unwrap();
    let off = (point - place.centre) / place.radius;
    let across = place.tangent.cross(place.normal);
    (place, DVec2::new(f64::from(off.dot(place.normal)), f64::from(off.dot(across))))
}

#[test]
fn fibers_stay_in_their_ply_and_turn_as_the_model_says() {
    let (twist, count) = (-19f64.to_radians(), 33);
    let shape = touching_yarn(3, count, 0.4, 13f64.to_radians(), twist);
    let parameters = touching(3, count, 0.4, twist);
    let strands = arch(&shape);
    let made = Plies::new(&strands, &parameters, &shape, 1);
    let (tubes, first) = made.fibers(1, Placement::Regular);
    assert_eq!((tubes.count(), first.as_slice()), (count as usize, &[0][..]));
    let (points, segments) = made.fiber_counts();
    assert_eq!(points, 3 * tubes.points().len() as u64);
    assert_eq!(segments, 3 * tubes.segments().len() as u64);
    let ply = &shape.plies[1];
    for segment in (0..tubes.segments().len() as u32).step_by(17) {
        let at = tubes.place(segment, 0.5);
        assert!((f64::from(at.radius) - 0.5 * parameters[1].fiber_radius).abs() < 1e-6);
        let (place, p) = locate(&strands, at.centre);
        let axis = made.axis(&place, ply);
        let in_ply = p - f64::from(ply.distance) * axis;
        assert!(in_ply.length() < f64::from(ply.core_radius) * 1.002, "{in_ply}");
        // The tangent that the aggregated model takes for this place.
        let model = crate::geometry::ply::fiber_tangent(
            ply,
            shape.ply_rate,
            (f64::from(ply.distance) * axis).as_vec2(),
            axis.as_vec2(),
            p.as_vec2(),
        );
        let across = place.tangent.cross(place.normal);
        // A fibre on the outside of a bend has farther to go.
        let bend = place.curvature * place.radius;
        let stretch = 1.0 - p.x as f32 * bend.dot(place.normal) - p.y as f32 * bend.dot(across);
        let want = (model.x * place.normal + model.y * across + stretch * place.tangent).normalize();
        assert!(at.tangent.dot(want) > 0.9995, "{} {want}", at.tangent);
    }
}

#[test]
fn regular_fibers_do_not_cut_through_each_other() {
    let shape = touching_yarn(1, 40, 0.5, 0.0, 0.3);
    let parameters = touching(1, 40, 0.5, 0.3);
    let strands = arch(&shape);
    let (tubes, _) = Plies::new(&strands, &parameters, &shape, 4).fibers(0, Placement::Regular);
    let per_fiber = tubes.segments().len() / 40;
    let middle = |fiber: usize| tubes.place((fiber * per_fiber + per_fiber / 2) as u32, 0.0);
    for i in 0..40 {
        for j in 0..i {
            let gap = middle(i).centre.distance(middle(j).centre) / (2.0 * middle(i).radius);
            assert!(gap > 0.99, "fibres {i} and {j}: {gap}");
        }
    }
}

/// A straight yarn along z of radius 1.
fn straight(shape: &YarnShape) -> Strands {
    pressed(shape, 1.0)
}

/// How much of the fibres' section lies in two of them, by circles across their common direction, at places along a yarn.
fn overlap(tubes: &Tubes, fibers: usize) -> f64 {
    let per_fiber = tubes.segments().len() / fibers;
    let (mut twice, mut all) = (0.0, 0.0);
    for step in (2..per_fiber - 2).step_by(3) {
        for u in [0.0, 0.5] {
            let at: Vec<_> = (0..fibers).map(|fiber| tubes.place((fiber * per_fiber + step) as u32, u)).collect();
            for (i, a) in at.iter().enumerate() {
                let radius = f64::from(a.radius);
                all += std::f64::consts::PI * radius * radius;
                for b in &at[..i] {
                    let (between, along) = ((b.centre - a.centre).as_dvec3(), (a.tangent + b.tangent).as_dvec3());
                    let apart = between.cross(along.normalize()).length() / (2.0 * radius);
                    if apart < 1.0 {
                        twice += 2.0 * radius * radius * (apart.acos() - apart * (1.0 - apart * apart).sqrt());
                    }
                }
            }
        }
    }
    twice / all
}

#[test]
fn fibers_that_lean_do_not_lie_in_each_other() {
    // As circles of the section they would by several percent.
    for (plies, count, density, ply_twist, fiber_twist, most) in [
        (1, 60, 0.6, 0.0, 30.0, 1e-4),
        (1, 60, 0.3, 0.0, -45.0, 1e-4),
        (2, 60, 0.6, 20.0, 0.0, 1e-3),
        (2, 60, 0.6, 20.0, 20.0, 1e-3),
        (2, 60, 0.6, 20.0, -20.0, 1e-3),
        (3, 40, 0.5, 30.0, -30.0, 3e-3),
    ] {
        let [ply_twist, fiber_twist] = [ply_twist, fiber_twist].map(f64::to_radians);
        let shape = touching_yarn(plies, count, density, ply_twist, fiber_twist);
        let parameters = touching(plies, count, density, fiber_twist);
        let strands = straight(&shape);
        for seed in 0..2 {
            let (tubes, _) = Plies::new(&strands, &parameters, &shape, seed).fibers(0, Placement::Regular);
            let found = overlap(&tubes, count as usize);
            assert!(found < most, "{plies} plies of {count} at {density}, {ply_twist} {fiber_twist}: {found}");
        }
    }
}

#[test]
fn pressed_fibers_that_lean_do_not_lie_in_each_other() {
    for (plies, density, twist) in [(1, 0.5, 30.0f64), (2, 0.5, 20.0)] {
        let twist = twist.to_radians();
        let shape = touching_yarn(plies, 50, density, twist, -twist);
        let parameters = touching(plies, 50, density, -twist);
        let strands = pressed(&shape, 0.6);
        let (tubes, _) = Plies::new(&strands, &parameters, &shape, 3).fibers(0, Placement::Regular);
        let found = overlap(&tubes, 50);
        assert!(found < 5e-3, "{plies} plies at {density}: {found}");
    }
}

#[test]
fn more_fibers_than_there_is_room_for_lean_less_and_do_not_hang() {
    for (count, density, twist) in [(200u32, 0.75f64, 60.0f64), (20, 0.77, 85.0), (1, 0.9, 89.0), (0, 0.0, 45.0)] {
        let twist = Twist { fibers: twist.to_radians().tan(), plies: 1.0 };
        let fiber = (density / f64::from(count.max(1))).sqrt();
        let room = twist.room(count, fiber);
        assert!((0.0..=1.0).contains(&room) && (room == 1.0) == (count == 0), "{room}");
        let discs = packing::hard_discs(count, fiber / (1.0 - fiber), twist, &mut Stream::new(2));
        assert!(discs.len() == count as usize && discs.iter().all(|d| d.length() <= 1.0 + 1e-12));
        assert!(
            packing::measured(count, fiber / (1.0 - fiber), twist, 1.5, KnownPacking::default()).regularity.is_finite()
        );
    }
}

#[test]
fn elliptical_plies_keep_their_short_axis_towards_the_yarn() {
    let shape_of = |parameters: &[PlyParameters]| YarnShape::new(parameters, 0.25, true);
    let mut parameters = touching(2, 60, 0.3, -0.4);
    for p in &mut parameters {
        p.aspect = 0.6;
        p.radius = 0.4;
    }
    let shape = shape_of(&parameters);
    let strands = arch(&shape);
    let made = Plies::new(&strands, &parameters, &shape, 2);
    let (tubes, _) = made.fibers(0, Placement::Regular);
    let ply = &shape.plies[0];
    let (mut short, mut long) = (0.0f64, 0.0f64);
    for segment in (0..tubes.segments().len() as u32).step_by(7) {
        let (place, p) = locate(&strands, tubes.place(segment, 0.3).centre);
        let axis = made.axis(&place, ply);
        let q = p - f64::from(ply.distance) * axis;
        short = short.max(q.dot(axis).abs());
        long = long.max(q.dot(axis.perp()).abs());
    }
    let core = f64::from(ply.core_radius);
    assert!((short / (core * 0.6f64.sqrt()) - 1.0).abs() < 0.06, "{short}");
    assert!((long / (core / 0.6f64.sqrt()) - 1.0).abs() < 0.06, "{long}");
}

#[test]
fn measured_fibers_crowd_at_the_axis_and_migrate() {
    let shape = touching_yarn(1, 400, 0.3, 0.0, 0.35);
    let parameters = touching(1, 400, 0.3, 0.35);
    let strands = arch(&shape);
    let made = Plies::new(&strands, &parameters, &shape, 3);
    let radii = |beta: f64, migration: [f64; 2], segment_of: &dyn Fn(usize) -> usize| -> Vec<f64> {
        let d = Distribution { epsilon: 0.0, beta, migration, migration_rate: 1.0, jitter: 0.0 };
        let (tubes, _) = made.fibers(0, Placement::Measured(d));
        let per = tubes.segments().len() / 400;
        (0..400)
            .map(|i| {
                let segment = segment_of(i).min(per - 1);
                locate(&strands, tubes.place((i * per + segment) as u32, 0.5).centre).1.length()
            })
            .collect()
    };
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let even = mean(&radii(0.0, [1.0, 1.0], &|_| 5)) / f64::from(shape.plies[0].core_radius);
    let crowded = mean(&radii(1.5, [1.0, 1.0], &|_| 5)) / f64::from(shape.plies[0].core_radius);
    assert!((even - 2.0 / 3.0).abs() < 0.03, "even: {even}");
    assert!(crowded < 0.55, "crowded: {crowded}");
    let (a, b) = (radii(0.0, [0.5, 1.0], &|_| 4), radii(0.0, [0.5, 1.0], &|_| 9));
    let moved = a.iter().zip(&b).filter(|(a, b)| (*a - *b).abs() > 0.05).count();
    assert!(moved > 150, "{moved} fibres of 400 migrate");
}

#[test]
fn flyaways_are_as_many_and_reach_as_far_as_asked() {
    let shape = touching_yarn(3, 30, 0.3, 0.2, -0.3);
    let parameters = touching(3, 30, 0.3, -0.3);
    let strands = arch(&shape);
    let made = Plies::new(&strands, &parameters, &shape, 9);
    let of = Flyaways {
        hair_density: 2.0,
        hair_start: [0.4, 0.02],
        hair_rise: [0.5, 0.05],
        hair_length: [0.8, 0.2],
        hair_turn: [0.3, 0.1],
        loop_density: 1.0,
        loop_height: [0.7, 0.05],
        loop_turns: 0.5,
    };
    let (tubes, first, from) = made.flyaways(2, &of);
    assert_eq!(from.len(), tubes.count());
    let length = strands.length_of(0) / 0.5;
    assert!((tubes.count() as f64 - 3.0 * length).abs() <= 2.0, "{} over {length}", tubes.count());
    assert_eq!(first, [0]);
    let far = (0..tubes.segments().len() as u32)
        .map(|s| locate(&strands, tubes.place(s, 1.0).centre).1.length())
        .fold(0.0, f64::max);
    assert!((1.0..2.2).contains(&far), "{far}");
    let none = Flyaways { hair_density: 0.0, loop_density: 0.0, ..of };
    assert!(made.flyaways(0, &none).0.count() <= 1);
    // As one of 16 strands of a yarn four times as thick, which share its hairs.
    let strand = made.with_opened(4.0 * 0.5, 16.0);
    let (expected, found) = (3.0 * length / (4.0 * 16.0), strand.flyaways(2, &of).0.count() as f64);
    assert!((found - expected).abs() <= 2.0, "{found} of {expected}");
}

#[test]
fn fibers_and_plies_are_pressed_flat_with_their_yarn() {
    let shape = touching_yarn(3, 33, 0.3, 0.25, -0.3);
    let parameters = touching(3, 33, 0.3, -0.3);
    let strands = pressed(&shape, 0.5);
    let made = Plies::new(&strands, &parameters, &shape, 1);
    let (mut wide, mut high) = (0.0f32, 0.0f32);
    for ply in 0..3 {
        let tubes = made.fibers(ply, Placement::Regular).0;
        for segment in 0..tubes.segments().len() as u32 {
            let place = tubes.place(segment, 0.5);
            let centre = place.centre;
            assert!(centre.x.hypot(2.0 * centre.y) < 1.0, "within the ellipse");
            let thick = place.radius / (0.5f32.sqrt() * shape.plies[ply].fiber_radius);
            assert!((thick - 1.0).abs() < 1e-3, "as thick as in a round yarn of the same area: {thick}");
            (wide, high) = (wide.max(centre.x.abs()), high.max(centre.y.abs()));
        }
        // The ply as a tube of its own: its section is the ellipse that the fibres' circle became.
        let (curve, radii) = &made.ply_curves(ply)[0];
        let flattening = curve.flattening.as_ref().expect("a pressed ply is not round");
        let r = f64::from(shape.plies[ply].radius);
        for (vector, long) in flattening.iter().zip(radii) {
            assert!(*long <= r * 1.001 && *long > 0.5 * r && vector.length() <= 1.0);
            // Its area, cut at an angle.
            let area = long * long * f64::from(vector.length()) / (0.5 * r * r);
            assert!(area < 1.001 && area > 0.9, "{area}");
        }
    }
    assert!(wide > 0.9 && high > 0.45, "{wide} {high}");
}

#[test]
fn fibers_of_a_pressed_yarn_give_way_to_each_other() {
    let shape = touching_yarn(3, 33, 0.5, 0.25, -0.3);
    let parameters = touching(3, 33, 0.5, -0.3);
    // Of all plies together: pairs for each fibre that lie in each other by more than 2 %, so far between two knots.
    let deep = |ratio: f64, u: f32| {
        let strands = pressed(&shape, ratio);
        let made = Plies::new(&strands, &parameters, &shape, 1);
        let fibers: Vec<Tubes> = (0..3).map(|ply| made.fibers(ply, Placement::Regular).0).collect();
        let steps = (fibers[0].segments().len() / 33) as u32;
        let (mut pairs, mut all) = (0, 0);
        for step in 0..steps {
            let at = |tubes: &Tubes, fiber: u32| {
                let place = tubes.place(fiber * steps + step, u);
                (place.centre.truncate(), place.radius)
            };
            let places: Vec<_> = fibers.iter().flat_map(|f| (0..33).map(move |fiber| at(f, fiber))).collect();
            for (i, a) in places.iter().enumerate() {
                pairs += places[..i].iter().filter(|b| a.0.distance(b.0) < 0.98 * (a.1 + b.1)).count();
            }
            all += places.len();
        }
        pairs as f64 / all as f64
    };
    let found = [deep(1.0, 0.0), deep(1.0, 0.5), deep(0.6667, 0.0), deep(0.6667, 0.25), deep(0.6667, 0.5)];
    // Squeezed together with their section, every second fibre would.
    assert!(found[..3].iter().all(|&pairs| pairs < 0.002) && found[3..].iter().all(|&pairs| pairs < 0.04), "{found:?}");
}

#[test]
fn the_same_seed_makes_the_same_fibers() {
    let shape = touching_yarn(2, 20, 0.3, 0.2, -0.3);
    let parameters = touching(2, 20, 0.3, -0.3);
    let strands = arch(&shape);
    let points =
        |seed| Plies::new(&strands, &parameters, &shape, seed).fibers(1, Placement::Regular).0.points().to_vec();
    assert_eq!(points(1), points(1));
    assert_ne!(points(1), points(2));
}

#[test]
fn ply_curves_run_through_the_middle_of_their_plies() {
    let shape = touching_yarn(3, 33, 0.3, 0.25, -0.3);
    let parameters = touching(3, 33, 0.3, -0.3);
    let strands = arch(&shape);
    let made = Plies::new(&strands, &parameters, &shape, 1);
    let curves = made.ply_curves(2);
    assert_eq!(curves.len(), 1);
    let (curve, radii) = &curves[0];
    // A round ply cut across itself: as wide as it is towards the yarn's axis, narrower the other way.
    assert!((radii[3] - 0.5 * parameters[2].radius).abs() < 1e-4);
    let ratio = curve.flattening.as_ref().expect("a twisted ply is cut at an angle")[3].length();
    assert!((ratio / 0.25f32.cos() - 1.0).abs() < 0.01, "{ratio}");
    let tubes = Tubes::new(&[(curve.clone(), radii.clone())]);
    for segment in 0..tubes.segments().len() as u32 {
        let (place, p) = locate(&strands, tubes.place(segment, 0.5).centre);
        let want = f64::from(shape.plies[2].distance) * made.axis(&place, &shape.plies[2]);
        assert!((p - want).length() < 0.03, "{p} {want}");
    }
}
