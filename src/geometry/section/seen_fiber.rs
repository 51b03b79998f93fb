//! Which fibre of a ply a ray meets first, where fibres are wide enough to be told apart.
//!
//! The model draws how deep the first fibre lies: right on the mean, and smooth as clay. Seen from close by, rays that are close
//! to each other meet the same fibre. Here the number that it is drawn by is one of the place: a ply's surface is divided into
//! lines that run as its fibres do, and each has a number of its own. Over many lines the numbers are as even as those that
//! they stand for, and means stay what they are.

use std::f32::consts::{PI, TAU};

use super::{PlyCrossing, Section};
use crate::{
    geometry::yarn::YarnShape,
    math::sampler::{hash2, unit},
};

/// Lines for each width of a fibre around a ply of an area fraction: of fibres that lie over each other only a part is seen, more where
/// they are dense. Counted on packings of .3 to .6, where it is right within 6 % (a test does so).
#[inline]
fn lines_for_each_width(density: f32) -> f32 {
    2.25 - 1.25 * density
}

/// The share of lines that lie in tufts, and the number of lines in each.
const IN_TUFTS: f32 = 0.15;
const TUFT: f32 = 4.0;
/// How long a fibre stays on top, in its widths.
const LENGTH: f32 = 100.0;
/// What tells the second number of a fibre from the first.
const SIDE: u32 = 1;

/// A place on the surface of a ply, by its fibres.
#[derive(Clone, Copy, Debug)]
pub struct SeenFiber {
    /// Around the ply, against a fibre at its surface, in turns.
    turn: f32,
    /// Lines around the ply.
    lines: f32,
    /// How far along the yarn, in widths of a fibre.
    along: f32,
}

impl Section<'_> {
    /// Where the ray enters the first ply that it meets; `distance` is how far along the yarn the section is, in yarn radii.
    #[inline]
    pub fn seen_fiber(&self, shape: &YarnShape, front: &PlyCrossing, distance: f32) -> SeenFiber {
        let ply = &shape.plies[front.ply];
        let at = self.inside(shape, self.point(front.enter), front.travel[0]).in_ply(shape, front.ply);
        let angle = ply.direction.perp_dot(at).atan2(ply.direction.dot(at));
        let along = distance + front.travel[0];
        SeenFiber {
            turn: (angle - (ply.fiber_rate - shape.ply_rate) * along) / TAU,
            lines: lines_for_each_width(ply.density() as f32) * PI * ply.radius / ply.fiber_radius,
            along: along / (2.0 * ply.fiber_radius),
        }
    }
}

impl SeenFiber {
    /// Two numbers in [0, 1), even over all lines: the share of lines on which the first fibre is met before that of this one, and one that draws
    /// on which side of the ray its middle is. `key` tells plies apart; two fresh numbers `u` blend one fibre into the next along a line.
    #[inline]
    pub fn numbers(&self, key: u32, u: [f32; 2]) -> [f32; 2] {
        let wide = if u[0] < IN_TUFTS { TUFT } else { 1.0 };
        let lines = (self.lines / wide).round().max(1.0);
        // A turn of 1 may come of rounding.
        let line = ((self.turn - self.turn.floor()) * lines).min(lines - 1.0) as u32;
        let key = hash2(key, hash2(lines as u32, line));
        let along = self.along / (LENGTH * wide) + unit(key);
        let step = along.floor();
        let share = along - step;
        let next = u[1] < share * share * (3.0 - 2.0 * share);
        let fiber = hash2(key, (step as i32).wrapping_add(i32::from(next)) as u32);
        [unit(fiber), unit(hash2(fiber, SIDE))]
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, Vec3A};

    use super::*;
    use crate::{
        geometry::{
            fiber::{packing::hard_discs, slopes::Twist},
            section::Crossings,
            yarn::tests::touching_yarn,
            yarn_frame::{ROUND, SectionGrowth, YarnFrame},
        },
        math::sampler::Stream,
    };

    /// The section of a straight yarn, along x, that a ray from +z meets at a distance from its start.
    fn section(shape: &YarnShape, x: f32, y: f32) -> Section<'static> {
        let place = YarnFrame {
            centre: Vec3A::new(x, 0.0, 0.0),
            tangent: Vec3A::X,
            curvature: Vec3A::ZERO,
            radius: 1.0,
            normal: Vec3A::Y,
            phase: shape.ply_rate * x,
            turn: None,
            stride: 1.0,
            flattening: ROUND,
            flattening_turn: 0.0,
            growth: SectionGrowth::default(),
        };
        Section::new(&place, Vec3A::new(x, y, 5.0), Vec3A::NEG_Z, true)
    }

    /// What is seen there, and of which ply.
    fn met(shape: &YarnShape, x: f32, y: f32) -> Option<(SeenFiber, usize)> {
        let section = section(shape, x, y);
        let mut crossings = Crossings::new();
        section.crossings(shape, &mut crossings);
        crossings.first().map(|front| (section.seen_fiber(shape, front, x), front.ply))
    }

    #[test]
    fn numbers_are_even_over_the_lines() {
        const BINS: usize = 16;
        const COUNT: usize = 40_000;
        let mut bins = [[0u32; BINS]; 2];
        let mut u = Stream::new(3);
        for i in 0..COUNT {
            let place = SeenFiber { turn: u.next(), lines: 47.3, along: 300.0 * i as f32 * 1.618 };
            for (bins, number) in bins.iter_mut().zip(place.numbers(i as u32 % 40, [u.next(), u.next()])) {
                assert!((0.0..1.0).contains(&number));
                bins[(number * BINS as f32) as usize] += 1;
            }
        }
        let mean = (COUNT / BINS) as f32;
        for bins in bins {
            let chi_square: f32 = bins.iter().map(|&n| (n as f32 - mean).powi(2) / mean).sum();
            // 15 degrees of freedom: above 37.7 once in a thousand.
            assert!(chi_square < 37.7, "{chi_square}");
        }
    }

    #[test]
    fn lines_run_as_fibers_do() {
        // Past all plies and their fibres: what is seen at a place goes on along the tangent of the fibre there.
        for plies in [1, 3] {
            let shape = touching_yarn(plies, 60, 0.5, 0.3, -0.4);
            for step in 0..200u8 {
                let (x, y) = (3.0 + 0.05 * f32::from(step), -0.9 + 0.009 * f32::from(step));
                let Some((here, ply)) = met(&shape, x, y) else { continue };
                // A short way along the fibre, as seen from +z.
                let section = section(&shape, x, y);
                let mut crossings = Crossings::new();
                section.crossings(&shape, &mut crossings);
                let front = &crossings[0];
                if front.exit - front.enter < 0.3 {
                    continue;
                }
                let tangent = section.to_world(front.tangent_at_entry(&shape, &section));
                let length = 0.01 / tangent.x;
                let Some((next, next_ply)) = met(&shape, x + 0.01, y + length * tangent.y) else { continue };
                if next_ply != ply {
                    continue;
                }
                let change = next.turn - here.turn;
                let change = change - change.round();
                assert!(change.abs() < 2e-4, "{plies} plies, at {x}, {y}: {change} turns");
            }
        }
    }

    #[test]
    fn as_many_lines_are_told_apart_as_in_packings() {
        const STEPS: u32 = 2000;
        for (count, density) in [(60, 0.3), (150, 0.5), (300, 0.6)] {
            let share = (density / f64::from(count)).sqrt();
            let radius = share / (1.0 - share);
            let (mut seen, mut wide) = (0.0, 0.0);
            for seed in 0..8 {
                let discs = hard_discs(count, radius, Twist::NONE, &mut Stream::new(seed));
                let first = |y: f64| {
                    let front = |disc: &DVec2| {
                        let off = (disc.y - y) / radius;
                        (off.abs() < 1.0).then(|| disc.x + radius * (1.0 - off * off).sqrt())
                    };
                    let depths = discs.iter().enumerate().filter_map(|(i, disc)| front(disc).map(|x| (i, x)));
                    depths.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
                };
                // The middle of the ply, where its surface faces the ray.
                let at = |step: u32| 0.7 * (2.0 * f64::from(step) / f64::from(STEPS) - 1.0);
                let changes = (1..=STEPS).filter(|&step| first(at(step)) != first(at(step - 1))).count();
                seen += changes as f64;
                wide += 1.4 / (2.0 * radius);
            }
            let lines = seen / wide;
            let stated = f64::from(lines_for_each_width(density as f32));
            assert!((lines / stated - 1.0).abs() < 0.06, "{count} fibres at {density}: {lines}, not {stated}");
        }
    }
}
