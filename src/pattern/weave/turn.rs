//! How wefts turn around the outermost warp of a side, are carried up beside it, and end.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec3, Vec3};

use super::{
    edges::{Point, between},
    shuttle::Turn,
};
use crate::math::special::smooth_step;

/// Distance of the points of a turn, in radii of the weft.
const STEP: f64 = 0.45;

/// Points of a turn at most, and of what is carried past a pick: thin yarn far from its neighbours takes no more to be round.
const MOST_POINTS: f64 = 64.0;

/// How far a turn's middle reaches out from that of the outermost warp, in distances of yarns that touch.
const BESIDE: f64 = 1.02;
/// How far the weft's ends stand out, of that.
const STUB: f64 = 0.6;
/// Points of such an end.
const STUB_POINTS: usize = 3;

/// The outermost warp of a side, around which wefts of a radius turn.
pub(super) struct Edge {
    /// To which side it is.
    pub(super) out: f64,
    /// Upwards.
    pub(super) way: Vec<Point>,
    /// Heights of the picks that turn around it.
    pub(super) picks: Vec<f64>,
    pub(super) radius: f64,
}

impl Edge {
    /// The warp's middle at a height, and half its width.
    fn at(&self, y: f64) -> (DVec3, f64) {
        let Some(last) = self.way.len().checked_sub(2) else {
            return self.way.first().map_or((DVec3::ZERO, 0.0), |p| (p.0, p.1));
        };
        let i = self.way.partition_point(|p| p.0.y < y).saturating_sub(1).min(last);
        let (a, b) = (&self.way[i], &self.way[i + 1]);
        let share = ((y - a.0.y) / (b.0.y - a.0.y)).clamp(0.0, 1.0);
        (a.0.lerp(b.0, share), a.1 + share * (b.1 - a.1))
    }

    /// How far the middle of a weft beside the warp is from its middle, at a height.
    fn beside(&self, y: f64) -> f64 {
        BESIDE * (self.at(y).1.max(self.radius) + self.radius)
    }

    /// Where the middle of a weft is in a lane, at a height, along x.
    fn lane(&self, y: f64, lane: u32) -> f64 {
        let others = f64::from(lane - 1) * 2.0 * BESIDE * self.radius;
        self.at(y).0.x + self.out * (self.beside(y) + others)
    }

    /// The end of a weft, outwards from its last crossing, to which it comes from `before`.
    pub(super) fn stub(&self, before: Point, last: Point) -> [Point; STUB_POINTS] {
        let length = STUB * (self.lane(last.0.y, 1) - last.0.x);
        // It goes on as it comes, and ends level.
        let slope = (last.0 - before.0) / (last.0.x - before.0.x).abs().max(1e-9);
        let aside = slope.reject_from(DVec3::X).clamp_length_max(1.0) * length.abs();
        std::array::from_fn(|k| {
            let share = (k + 1) as f64 / STUB_POINTS as f64;
            (last.0 + share * length * DVec3::X + share * (1.0 - 0.5 * share) * aside, last.1, last.2, last.3)
        })
    }

    /// From one pick to the next of the same yarn, without both.
    pub(super) fn turn(&self, way: &mut Vec<Point>, from: Point, to: Point, turn: Turn) {
        if turn.past == 0 { self.around(way, from, to, turn.lane) } else { self.carry(way, from, to, turn.lane) }
    }

    /// Around the warp, and around what is carried beside it: straight out and half a circle, or half an ellipse where picks
    /// are farther from each other than it reaches out; the weft lies flat on the warp. A rounder turn breaks no plies.
    fn around(&self, way: &mut Vec<Point>, from: Point, to: Point, lane: u32) {
        let (middle, half) = (0.5 * (from.0 + to.0), 0.5 * (to.0 - from.0));
        let reach = self.out * (self.lane(middle.y, lane) - middle.x);
        let round = half.length().min(reach);
        let (straight, arc) = (reach - round, FRAC_PI_2 * (half.length() + round));
        let length = 2.0 * straight + arc;
        let steps = (length / (STEP * self.radius)).round().clamp(4.0, MOST_POINTS) as usize;
        way.extend((1..steps).map(|k| {
            let share = k as f64 / steps as f64;
            let along = share * length;
            let angle = (PI * (along - straight) / arc).clamp(0.0, PI);
            let (sin, cos) = angle.sin_cos();
            let out = straight.min(along).min(length - along) + round * sin;
            let p = middle - cos * half + self.out * out * DVec3::X;
            let (_, wide, axis, coordinates) = between(from, to, share);
            let inwards = half.length() * sin * DVec3::X * -self.out + round * cos * half.normalize_or_zero();
            let inwards = inwards.normalize_or(DVec3::Z).as_vec3();
            // An axis has no sign; at both ends it is that of the pick.
            let pick = if 2 * k < steps { from.2 } else { to.2 };
            let flat = inwards * 1.0_f32.copysign(inwards.dot(pick)) * axis.length();
            let turned = 2.0 * (angle / PI).min(1.0 - angle / PI);
            (p, wide, pick.lerp(flat, smooth_step(turned) as f32), coordinates)
        }));
    }

    /// Up beside the warp, past picks of others: over and under them as the warp is, so that those that turn meanwhile hold both.
    fn carry(&self, way: &mut Vec<Point>, from: Point, to: Point, lane: u32) {
        let (begin, rise) = (from.0.y, to.0.y - from.0.y);
        // The first and the last pick that it passes.
        let mut passed = self.picks.iter().copied().filter(|y| (begin..to.0.y).contains(y));
        let [first, last] = [passed.clone().nth(1), passed.next_back()].map(|y| y.unwrap_or(begin + 0.5 * rise));
        let below = |y: f64| self.at(y).0.z;
        let height = |y: f64| {
            if y < first {
                from.0.z + smooth_step((y - begin) / (first - begin)) * (below(first) - from.0.z)
            } else if y > last {
                to.0.z + smooth_step((to.0.y - y) / (to.0.y - last)) * (below(last) - to.0.z)
            } else {
                below(y)
            }
        };
        // Corners are quarters of ellipses.
        let up = self.beside(begin).min(0.5 * rise);
        let picks = 1 + self.picks.iter().filter(|y| (begin..to.0.y).contains(y)).count();
        let least = (rise / picks as f64).max((self.lane(begin, lane) - from.0.x).abs()) / MOST_POINTS;
        let step = (STEP * self.radius).max(least);
        let flat = 0.5 * (from.2.length() + to.2.length());
        let corner = |end: Point, sign: f64| {
            let reach = self.out * (self.lane(end.0.y, lane) - end.0.x);
            let round = reach.min(self.beside(end.0.y));
            let straight = reach - round;
            let steps = (FRAC_PI_2 * 0.5 * (round + up) / step).round().max(3.0) as u32;
            let out = (0..(straight / step).round() as u32).map(|k| (f64::from(k) * step, 0.0));
            let bend = (0..steps).map(|k| (straight, FRAC_PI_2 * f64::from(k) / f64::from(steps)));
            let at = |(out, angle): (f64, f64)| {
                let (sin, cos) = angle.sin_cos();
                let y = end.0.y + sign * up * (1.0 - cos);
                let x = end.0.x + self.out * out;
                let x = x + sin * (self.lane(y, lane) - x);
                let axis = end.2 * cos as f32 + Vec3::X * flat * sin as f32;
                (DVec3::new(x, y, height(y)), end.1, axis, end.3)
            };
            // Without the end itself.
            out.chain(bend).skip(1).map(at).collect::<Vec<Point>>()
        };
        let (first, mut last) = (corner(from, 1.0), corner(to, -1.0));
        last.reverse();
        // Where the corners meet there is one place between them, and no two that fall together.
        let straight = rise - 2.0 * up;
        let steps = if straight > 0.01 * step { (straight / step).ceil() } else { 0.0 };
        let beside = (0..=steps as usize).map(|k| {
            let y = begin + up + straight * k as f64 / steps.max(1.0);
            let (_, wide, _, coordinates) = between(from, to, (y - begin) / rise);
            (DVec3::new(self.lane(y, lane), y, height(y)), wide, Vec3::X * flat, coordinates)
        });
        way.extend(first);
        way.extend(beside);
        way.extend(last);
    }
}
