use std::f64::consts::{PI, TAU};

use glam::DVec2;

use super::*;
use crate::{
    geometry::fiber::{packing::hard_discs, slopes::Twist},
    scattering::{
        medium::PlyOptics,
        testing::{first_disc, material, packed_ply},
    },
};

fn medium(radius: f64, albedo: f64, apart: f64) -> Medium {
    let spacing = Spacing { lead: 0.2, apart };
    Medium { radius, spacing, albedo, bends: None, alone: true, sent_back: 0.0, taken_back: 0.0 }
}

fn solved(medium: &Medium, stretch: f64) -> Solved {
    if stretch > 1.0 {
        pressed::solve(medium, stretch, &Solutions::default())
    } else {
        round::solve(medium, &Solutions::default())
    }
}

#[test]
fn nothing_is_lost_that_is_not_absorbed() {
    for stretch in [1.0, 1.5, 4.0] {
        for radius in [1e-6, 0.1, 1.0, 4.0, 20.0, 200.0, 1e9] {
            for (apart, taken_back) in [(0.0, 0.0), (0.5, 0.2), (0.5, 0.68)] {
                // What other plies take of nothing is nothing.
                let of = |taken_back, albedo| {
                    let alone = apart == 0.0;
                    Medium { alone, taken_back, ..medium(radius, albedo, apart) }
                };
                let channels = [of(taken_back, 1.0), of(0.0, 0.0), of(taken_back, 0.3)];
                let leaving = Leaving::new(&channels, stretch, &Solutions::default());
                // Nothing enters a ply that is alone.
                let entering = (taken_back > 0.0).then_some(&leaving.entering);
                for share in leaving.shares.iter().chain(entering) {
                    let [white, black, grey] = share.to_array();
                    assert!((white - 1.0).abs() < 1e-5, "{stretch} {radius} {apart}: {white}");
                    assert!(black == 0.0 && (0.0..0.31).contains(&grey), "{stretch} {radius} {apart}: {black} {grey}");
                }
                for row in &leaving.azimuths {
                    let mean = row.iter().fold(Rgb::ZERO, |sum, value| sum + *value) / AZIMUTHS as f32;
                    assert!((mean - Rgb::ONE).max_channel().abs() < 1e-5, "{stretch} {radius} {apart}: {mean:?}");
                    assert!(row.iter().all(|value| value.is_finite() && value.min_channel() >= 0.0));
                }
            }
        }
    }
}

#[test]
fn both_solutions_agree_where_the_section_is_nearly_round() {
    for (radius, albedo, apart) in [(2.0, 0.9, 0.0), (6.0, 0.9, 0.8), (6.0, 0.3, 0.4), (6.0, 1.0, 0.8)] {
        let medium = Medium { alone: false, taken_back: 0.2, ..medium(radius, albedo, apart) };
        let solutions = Solutions::default();
        let (round, pressed) = (round::solve(&medium, &solutions), pressed::solve(&medium, 1.0, &solutions));
        let (a, b) = (round.entering, pressed.entering);
        assert!((a - b).abs() < 0.01 && a > 0.0, "{a} {b}");
        let met = round.met[0].iter().zip(&pressed.met[0]);
        for (i, (a, b)) in round.onward[0].iter().zip(&pressed.onward[0]).chain(met).enumerate() {
            assert!((a.share - b.share).abs() < 0.01 * a.share + 1e-3, "{medium:?}, ring {i}: {} {}", a.share, b.share);
            for (a, b) in a.azimuths.iter().zip(b.azimuths) {
                assert!((a - b).abs() < 0.12, "{medium:?}, ring {i}: {a} {b}");
            }
        }
    }
}

/// However little TT turns light, the tables of directions have it.
#[test]
fn light_that_tt_hardly_bends_leaves_as_what_it_bends_a_little() {
    for stretch in [1.0, 1.6] {
        let azimuths = |sigma: f64| {
            let spacing = Spacing { lead: 0.3, apart: 0.4 };
            let bends = Bends { radius: 4.0, spacing, chain: 0.8, other: 0.1, sigma, share: 1.0 };
            let bent = Medium { bends: Some(bends), taken_back: 0.1, ..medium(2.0, 0.9, 0.3) };
            solved(&bent, stretch).onward.iter().flatten().flat_map(|cell| cell.azimuths).collect::<Vec<_>>()
        };
        let little = azimuths(1e-2);
        // Each cell sends it to some sides more than to others.
        assert!(little.iter().any(|part| *part > 1.3));
        for sigma in [1e-3, 3e-4, 1e-5, 1e-12] {
            for (a, b) in azimuths(sigma).iter().zip(&little) {
                assert!((a - b).abs() < 1e-5, "{stretch} {sigma}: {a}, not {b}");
            }
        }
    }
}

/// Light that starts in the middle of a ring and meets something, followed step by step: what leaves towards each quarter of azimuths,
/// about the short axis, the long one, and so on.
fn walked(medium: &Medium, stretch: f64, ring: usize, angle: f64) -> [f64; 4] {
    let mut stream = Stream::new(8);
    let mut next = || f64::from(stream.next());
    let axes = [medium.radius / stretch.sqrt(), medium.radius * stretch.sqrt()];
    let r = ((ring as f64 + 0.5) / RINGS as f64).sqrt();
    let (mut out, mut started) = ([0.0; 4], 0.0);
    for _ in 0..200_000 {
        let (mut x, mut y) = (r * angle.cos(), r * angle.sin());
        let (mut weight, mut first) = (1.0, true);
        loop {
            let phi = TAU * next();
            let (dx, dy) = (phi.cos() / axes[0], phi.sin() / axes[1]);
            let s = flight::length_of(-(1.0 - next()).ln(), medium.spacing.apart);
            // What is met has its middle within the section.
            let middle = s + medium.spacing.lead;
            let (beyond_x, beyond_y) = (x + middle * dx, y + middle * dy);
            (x, y) = (x + s * dx, y + s * dy);
            if beyond_x * beyond_x + beyond_y * beyond_y >= 1.0 {
                if !first {
                    out[(phi / (0.5 * PI) + 0.5) as usize % 4] += weight;
                }
                break;
            }
            started += f64::from(u8::from(first));
            weight *= medium.albedo;
            first = false;
        }
    }
    out.map(|part| part / started)
}

#[test]
fn as_much_leaves_a_section_towards_each_side_as_is_found_step_by_step() {
    for (radius, albedo, apart, stretch) in [(3.0, 0.9, 0.5, 1.0), (5.0, 0.9, 0.8, 2.0), (5.0, 0.5, 0.0, 1.5)] {
        let medium = medium(radius, albedo, apart);
        let solved = solved(&medium, stretch);
        for ring in [2, 9, 15] {
            for (sector, cells) in solved.onward.iter().enumerate() {
                let angle = 0.5 * PI * sector as f64 / (solved.onward.len().max(2) - 1) as f64;
                let want = walked(&medium, stretch, ring, angle);
                let cell = &cells[ring];
                // Each quarter reaches three azimuths to either side, with half of the outermost ones.
                let quarter = |q: usize| {
                    let part = |k: usize| cell.azimuths[(q * AZIMUTHS / 4 + AZIMUTHS + k - 3) % AZIMUTHS];
                    let sum: f64 = (1..6).map(part).sum::<f64>() + 0.5 * (part(0) + part(6));
                    sum * cell.share / AZIMUTHS as f64
                };
                for (q, want) in want.into_iter().enumerate() {
                    let found = quarter(q);
                    assert!(
                        (found - want).abs() < 0.012 + 0.05 * want,
                        "{medium:?} {stretch}, ring {ring}, sector {sector}, side {q}: {found:.4}, not {want:.4}"
                    );
                }
            }
        }
    }
}

/// Light that starts in the middle of a ring, followed from fibre to fibre, where TT bends it or it goes all round: what leaves towards each
/// azimuth, in twelve of them, and what of it does so before anything turned it all round or straightened it.
fn walked_by_fibers(bends: &Bends, stretch: f64, ring: usize, angle: f64) -> [f64; 12] {
    let mut stream = Stream::new(5);
    let axes = [bends.radius / stretch.sqrt(), bends.radius * stretch.sqrt()];
    let r = ((ring as f64 + 0.5) / RINGS as f64).sqrt();
    let mut out = [0.0; 12];
    const WALKS: usize = 100_000;
    for _ in 0..WALKS {
        let (mut x, mut y) = (r * angle.cos(), r * angle.sin());
        let mut phi = TAU * f64::from(stream.next());
        let Spacing { lead, apart } = bends.spacing;
        let (mut weight, mut kept_off) = (1.0, apart);
        loop {
            let s = flight::length_of(-(1.0 - f64::from(stream.next())).ln(), kept_off);
            let to = |s: f64| (x + s * phi.cos() / axes[0], y + s * phi.sin() / axes[1]);
            let beyond = to(s + lead);
            (x, y) = to(s);
            if beyond.0 * beyond.0 + beyond.1 * beyond.1 >= 1.0 {
                out[((phi / TAU * 12.0 + 0.5).rem_euclid(12.0)) as usize % 12] += weight / WALKS as f64;
                break;
            }
            weight *= bends.chain + bends.other;
            if f64::from(stream.next()) * (bends.chain + bends.other) < bends.chain {
                phi += bends.sigma * f64::from(crate::math::warp::normal(stream.next()));
                kept_off = apart + lead;
            } else {
                phi = TAU * f64::from(stream.next());
                kept_off = apart;
            }
        }
    }
    out
}

/// Of light that meets something in a cell, and is turned all round there: its azimuths are those of light that goes on evenly.
#[test]
fn light_that_tt_bends_leaves_towards_where_it_is_found_fiber_by_fiber() {
    for (stretch, chain, other) in [(1.0, 0.75, 0.2), (1.6, 0.75, 0.2), (1.6, 0.5, 0.1), (2.2, 0.6, 0.39)] {
        let bends =
            Bends { radius: 6.0, spacing: Spacing { lead: 0.3, apart: 0.4 }, chain, other, sigma: 0.45, share: 1.0 };
        let lost = 1.0 - chain * 0.83;
        let bent = Medium {
            bends: Some(bends),
            taken_back: 0.1,
            ..medium(6.0 * lost, 1.0 - (1.0 - chain - other) / lost, 0.3)
        };
        let solved = solved(&bent, stretch);
        for ring in [2, 9, 15] {
            for (sector, cells) in solved.met.iter().enumerate() {
                let angle = 0.5 * PI * sector as f64 / (solved.met.len().max(2) - 1) as f64;
                let walked = walked_by_fibers(&bends, stretch, ring, angle);
                let all: f64 = walked.iter().sum();
                for (k, want) in walked.into_iter().enumerate() {
                    // Each twelfth has an azimuth in its middle and half of each beside.
                    let at = |k: usize| cells[ring].azimuths[k % AZIMUTHS] / AZIMUTHS as f64;
                    let found = at(2 * k) + 0.5 * (at(2 * k + 1) + at(2 * k + AZIMUTHS - 1));
                    let want = want / all;
                    assert!(
                        (found - want).abs() < 0.008 + 0.06 * want,
                        "{stretch} {chain} {other}, ring {ring}, sector {sector}, azimuth {k}: {found:.4}, not {want:.4}"
                    );
                }
            }
        }
    }
}

/// Parallel light is followed through packings of discs that scatter it evenly around, from where it meets them: of what two and more
/// did, the tables have as much, and as much of it on each side.
#[test]
fn light_that_packings_scatter_on_leaves_as_the_tables_have_it() {
    const WALKS: usize = 60_000;
    const SIDES: usize = 4;
    // Straight on, the two sides, and back, of which the first has little of dense plies.
    for (fibers, density, most) in
        [(60, 0.2, [0.03, 0.05, 0.03]), (60, 0.35, [0.08, 0.03, 0.03]), (143, 0.35, [0.06, 0.04, 0.02])]
    {
        let albedo = 0.9;
        let shape = packed_ply(fibers, density);
        let ply = &shape.plies[0];
        let radius = f64::from(ply.fiber_radius / ply.core_radius);
        let scattering = material(([albedo; 3], [0.0; 3], [0.0; 3]), [0.1, 0.1, 0.4]);
        let leaving = PlyOptics::new(&scattering, ply, 0.0, 1.0, &Solutions::default()).leaving;
        let packings: Vec<Vec<DVec2>> =
            (0..32).map(|seed| hard_discs(fibers, radius, Twist::NONE, &mut Stream::new(seed))).collect();
        let mut stream = Stream::new(7);
        let (mut walked, mut told) = ([0.0; SIDES], [0.0; SIDES]);
        for walk in 0..WALKS {
            let discs = &packings[walk % packings.len()];
            let beside = (2.0 * f64::from(stream.next()) - 1.0) * (1.0 + radius);
            let (mut from, mut w, mut at, mut weight) = (DVec2::new(-3.0, beside), DVec2::X, None, 1.0);
            let mut first = None;
            while let Some((disc, place)) = first_disc(discs, radius, from, w, at) {
                if at.is_some() && first.is_none() {
                    first = at.map(|disc: usize| (discs[disc], weight));
                }
                weight *= albedo;
                (from, at) = (place, Some(disc));
                w = DVec2::from_angle(TAU * f64::from(stream.next()));
            }
            let Some((middle, before)) = first else { continue };
            let side = |angle: f64| ((angle / TAU * SIDES as f64 + 0.5).rem_euclid(SIDES as f64)) as usize % SIDES;
            walked[side(w.y.atan2(w.x))] += weight;
            let (place, axes) = leaving.place(middle.as_vec2(), Vec2::X);
            let share = before * f64::from(leaving.share(Light::Onward, &place).mean());
            let outwards = leaving.draw(Light::Onward, &place, &mut stream);
            for k in 0..AZIMUTHS {
                let angle = TAU * (k as f64 + 0.5) / AZIMUTHS as f64;
                let towards = DVec2::from_angle(angle).as_vec2();
                let towards = leaving.towards(outwards, Vec2::new(towards.dot(axes[0]), towards.dot(axes[1])));
                told[side(angle)] += share * f64::from(towards.mean()) / AZIMUTHS as f64;
            }
        }
        let of = |all: &[f64; SIDES]| [all[0], all[1] + all[3], all[2]];
        for ((side, most), (told, walked)) in
            ["on", "aside", "back"].iter().zip(most).zip(of(&told).into_iter().zip(of(&walked)))
        {
            let ratio = told / walked;
            assert!((ratio - 1.0).abs() < most, "{fibers} fibres, {density}, {side}: {ratio:.3}");
        }
        let ratio = told.iter().sum::<f64>() / walked.iter().sum::<f64>();
        assert!((ratio - 1.0).abs() < 0.02, "{fibers} fibres, {density}: {ratio:.3}");
    }
}
