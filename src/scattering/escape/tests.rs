use std::f64::consts::{PI, TAU};

use super::*;

fn medium(radius: f64, albedo: f64, apart: f64) -> Medium {
    Medium { radius, apart, albedo, sent_back: 0.0, taken_back: 0.0 }
}

fn solved(medium: &Medium, stretch: f64) -> Solved {
    if stretch > 1.0 { pressed::solve(medium, stretch) } else { round::solve(medium) }
}

#[test]
fn nothing_is_lost_that_is_not_absorbed() {
    for stretch in [1.0, 1.5, 4.0] {
        for radius in [1e-6, 0.1, 1.0, 4.0, 20.0, 200.0, 1e9] {
            for (apart, taken_back) in [(0.0, 0.0), (0.5, 0.2)] {
                let white = Medium { taken_back, ..medium(radius, 1.0, apart) };
                let leaving = Leaving::new(
                    &[white, medium(radius, 0.0, apart), medium(radius, 0.3, apart)],
                    stretch,
                    &Solutions::default(),
                );
                for share in leaving.shares.iter().chain([&leaving.entering]) {
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
        let medium = medium(radius, albedo, apart);
        let (round, pressed) = (round::solve(&medium), pressed::solve(&medium, 1.0));
        for (a, b) in round.entering.into_iter().zip(pressed.entering) {
            assert!((a - b).abs() < 0.01, "{a} {b}");
        }
        for (i, (a, b)) in round.sectors[0].iter().zip(&pressed.sectors[0]).enumerate() {
            assert!((a.share - b.share).abs() < 0.01 * a.share + 1e-3, "{medium:?}, ring {i}: {} {}", a.share, b.share);
            for (a, b) in a.azimuths.iter().zip(b.azimuths) {
                assert!((a - b).abs() < 0.12, "{medium:?}, ring {i}: {a} {b}");
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
            let s = medium.apart - (1.0 - next()).ln();
            (x, y) = (x + s * dx, y + s * dy);
            if x * x + y * y >= 1.0 {
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
            for (sector, cells) in solved.sectors.iter().enumerate() {
                let angle = 0.5 * PI * sector as f64 / (solved.sectors.len().max(2) - 1) as f64;
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
