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
    math::{
        sampler::{hash2, unit},
        special::smooth_step_f32,
    },
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
/// What tells the lines of a rim from those of the surface.
const RIM: u32 = 2;
/// How far from a ply's edge its rim begins to be seen, and from where on it alone is, in widths of a fibre.
const RIM_WIDTHS: [f32; 2] = [1.6, 0.7];

/// A place on the surface of a ply, by its fibres.
#[derive(Clone, Copy, Debug)]
pub struct SeenFiber {
    /// Around the ply, against a fibre at its surface, in turns.
    turn: f32,
    /// Lines around the ply.
    lines: f32,
    /// How far along the yarn, in widths of a fibre.
    along: f32,
    rim: Option<Rim>,
}

/// A place at the edge of a ply. There the lines of the surface are seen from the side, as steps; the edge of fibres is
/// that of those that pass their highest place near it, and has no steps.
#[derive(Clone, Copy, Debug)]
struct Rim {
    /// The chance that it is met as a rim.
    chance: f32,
    /// The edge against a fibre at the surface, in turns.
    turn: f32,
    /// Fibres around the ply of which each is the highest for as long as it stays within its own width of the edge.
    lines: f32,
}

impl Section<'_> {
    /// Where the ray enters the first ply that it meets; `distance` is how far along the yarn the section is, in yarn radii.
    #[inline]
    pub fn seen_fiber(&self, shape: &YarnShape, front: &PlyCrossing, distance: f32) -> SeenFiber {
        let ply = &shape.plies[front.ply];
        let turn_at = |depth: f32, travel: f32| {
            let at = self.inside(shape, self.point(depth), travel).in_ply(shape, front.ply);
            let angle = ply.direction.perp_dot(at).atan2(ply.direction.dot(at));
            (angle - (ply.fiber_rate - shape.ply_rate) * (distance + travel)) / TAU
        };
        let width = 2.0 * ply.fiber_radius;
        let inside = (ply.radius - front.offset.abs()) / (front.wide * width);
        let [from, whole] = RIM_WIDTHS;
        let chance = smooth_step_f32((from - inside) / (from - whole));
        let rim = (chance > 0.0).then(|| Rim {
            chance,
            // The place on the ray that is next to the axis is that on the edge, but for its distance.
            turn: turn_at(front.foot, front.travel_at(front.foot)),
            lines: TAU / (1.0 - (width / ply.radius).min(1.0)).acos(),
        });
        SeenFiber {
            turn: turn_at(front.enter, front.travel[0]),
            lines: lines_for_each_width(ply.density() as f32) * PI * ply.radius / ply.fiber_radius,
            along: (distance + front.travel[0]) / width,
            rim,
        }
    }
}

impl SeenFiber {
    /// Two numbers in [0, 1), even over all lines: the share of lines on which the first fibre is met before that of this one, and one that draws
    /// on which side of the ray its middle is. `key` tells plies apart; three fresh numbers `u` blend one fibre into the next along a
    /// line, and the surface into the rim.
    #[inline]
    pub fn numbers(&self, key: u32, u: [f32; 3]) -> [f32; 2] {
        if let Some(rim) = self.rim.filter(|rim| u[2] < rim.chance) {
            return rim.numbers(hash2(key, RIM), self.along);
        }
        let wide = if u[0] < IN_TUFTS { TUFT } else { 1.0 };
        let lines = (self.lines / wide).round().max(1.0);
        // A turn of 1 may come of rounding.
        let line = ((self.turn - self.turn.floor()) * lines).min(lines - 1.0) as u32;
        let key = hash2(key, hash2(lines as u32, line));
        let along = self.along / (LENGTH * wide) + unit(key);
        let step = along.floor();
        let share = along - step;
        let next = u[1] < smooth_step_f32(share);
        let fiber = hash2(key, (step as i32).wrapping_add(i32::from(next)) as u32);
        [unit(fiber), unit(hash2(fiber, SIDE))]
    }
}

impl Rim {
    /// As [`SeenFiber::numbers`]: even, too, but without jumps from one line to the next.
    fn numbers(&self, key: u32, along: f32) -> [f32; 2] {
        let lines = self.lines.round().max(1.0);
        let place = (self.turn - self.turn.floor()) * lines;
        let (first, share) = (place.floor(), place.fract());
        // The last line is beside the first.
        let of_line = |next: f32, side: u32| {
            let key = hash2(key, ((first + next) % lines) as u32);
            let along = along / LENGTH + unit(key);
            let step = along.floor();
            let fiber = |next: i32| unit(hash2(hash2(key, (step as i32).wrapping_add(next) as u32), side));
            blended([fiber(0), fiber(1)], smooth_step_f32(along - step))
        };
        [0, SIDE].map(|side| blended([of_line(0.0, side), of_line(1.0, side)], smooth_step_f32(share)))
    }
}

/// From one of two numbers that are even in [0, 1] to the other, by a share: the share of such pairs that come to less than these
/// do, which is even again.
#[inline]
fn blended([from, to]: [f32; 2], share: f32) -> f32 {
    let sum = from + share * (to - from);
    let (more, less) = (share.max(1.0 - share), share.min(1.0 - share));
    // The sum of two even numbers is even between two slopes.
    let slope = |left: f32| 0.5 * left * left / (more * less).max(1e-9);
    let even = if sum < less {
        slope(sum)
    } else if sum > more {
        1.0 - slope(1.0 - sum)
    } else {
        (sum - 0.5 * less) / more
    };
    even.min(1.0 - f32::EPSILON)
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
        for chance in [0.0, 0.4, 1.0] {
            let mut bins = [[0u32; BINS]; 2];
            let mut u = Stream::new(3);
            for i in 0..COUNT {
                let rim = Some(Rim { chance, turn: u.next(), lines: 11.7 });
                let place = SeenFiber { turn: u.next(), lines: 47.3, along: 300.0 * i as f32 * 1.618, rim };
                for (bins, number) in bins.iter_mut().zip(place.numbers(i as u32 % 40, [(); 3].map(|()| u.next()))) {
                    assert!((0.0..1.0).contains(&number));
                    bins[(number * BINS as f32) as usize] += 1;
                }
            }
            let mean = (COUNT / BINS) as f32;
            for bins in bins {
                let chi_square: f32 = bins.iter().map(|&n| (n as f32 - mean).powi(2) / mean).sum();
                // 15 degrees of freedom: above 37.7 once in a thousand.
                assert!(chi_square < 37.7, "a rim by {chance}: {chi_square}");
            }
        }
    }

    #[test]
    fn a_rim_has_no_steps() {
        const STEPS: u32 = 20_000;
        let numbers = |step: u32| {
            let share = step as f32 / STEPS as f32;
            Rim { chance: 1.0, turn: 3.0 * share, lines: 11.7 }.numbers(7, 500.0 * share)
        };
        for step in 0..STEPS {
            let (here, next) = (numbers(step), numbers(step + 1));
            // Three turns of twelve lines, in each of which a number goes from 0 to 1 at most, by two smooth steps.
            assert!((0..2).all(|k| (here[k] - next[k]).abs() < 36.0 * 4.0 / STEPS as f32), "{step}: {here:?} {next:?}");
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
