//! The normal that does not turn about the yarn, and how far plies have turned about it, carried along a chain.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec3, DVec4};
use rayon::prelude::*;

use super::{StrandOptions, frames::PointFrame};
use crate::{
    geometry::{
        chain::Chain,
        spline::{SplinePoint, Weights},
    },
    math::special::GAUSS_LEGENDRE_4,
};

/// How far the inner side of a bend may run backwards, in yarn radii, before plies are seen to break: about the radius of one
/// ply of three.
const SEEN_FOLD: f64 = 0.5;

/// A normal carried along a chain, and how far plies have turned about it.
pub(super) struct Winding {
    pub(super) knots: Vec<Knot>,
    /// Turns of the plies, radians per yarn radius.
    ply_rate: f64,
    /// By how much a closed chain turns the normal against itself.
    angle: f64,
    /// Where plies are seen to break, if they are.
    pub(super) tight: Option<Tight>,
}

/// The tightest of the places where a yarn folds into itself.
#[derive(Clone, Copy)]
pub(super) struct Tight {
    pub(super) segment: usize,
    /// In yarn radii.
    pub(super) fold: f64,
    /// How many such places there are.
    pub(super) places: usize,
}

impl Tight {
    /// That of a yarn of which both are parts.
    fn and(self, other: Self) -> Self {
        let worst = if other.fold > self.fold { other } else { self };
        Self { places: self.places + other.places, ..worst }
    }
}

/// A knot of a chain.
#[derive(Clone, Copy)]
pub(super) struct Knot {
    pub(super) tangent: DVec3,
    pub(super) normal: DVec3,
    /// How far along the chain, in yarn radii.
    along: f64,
}

impl Knot {
    /// Of which nothing is known yet.
    const START: Self = Self { tangent: DVec3::X, normal: DVec3::Y, along: 0.0 };
}

/// Segments along which a normal is carried in one go; longer chains are cut, whatever the number of threads.
const STRETCH: usize = 16_384;

impl Winding {
    /// Carries the normal along the chain and integrates the phase of the plies. `pressed` are the directions of the sections'
    /// short axes at the ends of its segments, with the ratio of both axes.
    pub(super) fn new(chain: &Chain, pressed: Option<&[DVec4]>, options: &StrandOptions) -> Self {
        let mut knots = vec![Knot::START; chain.segments() + 1];
        let stretches = knots[1..].par_chunks_mut(STRETCH).enumerate();
        let firsts: Vec<(Knot, Option<Tight>)> =
            stretches.map(|(i, after)| carry(chain, pressed, i * STRETCH, after)).collect();
        // Each stretch began with a normal of its own: turned as a whole, it goes on where the one before ends.
        let mut tight: Option<Tight> = None;
        for (i, (first, its_tight)) in firsts.into_iter().enumerate() {
            let start = i * STRETCH;
            let end = std::mem::replace(&mut knots[start], first);
            if i > 0 {
                let (sin, cos) = (end.normal.dot(first.tangent.cross(first.normal)), end.normal.dot(first.normal));
                let size = sin.hypot(cos);
                let (sin, cos) = if size > 0.0 { (sin / size, cos / size) } else { (0.0, 1.0) };
                for knot in knots[start..].iter_mut().take(STRETCH + 1) {
                    knot.normal = cos * knot.normal + sin * knot.tangent.cross(knot.normal);
                    knot.along += end.along;
                }
            }
            tight = tight.into_iter().chain(its_tight).reduce(Tight::and);
        }
        let (start, end) = (knots[0].normal, knots[knots.len() - 1]);
        let angle = end.tangent.dot(start.cross(end.normal)).atan2(start.dot(end.normal));
        Self { knots, ply_rate: options.ply_rate, angle, tight }
    }

    /// The angle by which the plies have turned up to a knot.
    fn turned(&self, knot: usize) -> f64 {
        self.ply_rate * self.knots[knot].along
    }

    /// By how much a closed yarn's section comes back turned, when its plies turn as they do at rest.
    pub(super) fn residual(&self, at_rest: &Self) -> f64 {
        self.angle + at_rest.turned(at_rest.knots.len() - 1)
    }

    /// How far along the chain each control point is, in yarn radii.
    pub(super) fn distances(&self) -> Vec<f32> {
        let at = |i: usize| self.knots[i.min(self.knots.len() - 1)].along as f32;
        std::iter::once(at(0)).chain((0..=self.knots.len()).map(at)).collect()
    }

    /// What is known at each control point.
    pub(super) fn frames(&self, at_rest: &Self, missing: f64, phase: f64) -> Vec<PointFrame> {
        let segments = self.knots.len() - 1;
        let turned = |i: usize| at_rest.turned(i) - missing * i as f64 / segments as f64;
        // Knot i is where segment i starts: the second of its four points.
        let frame = |i: usize| {
            let angle = |i: usize| phase + turned(i.min(segments));
            let within = |angle: f64| angle - TAU * (angle / TAU).round();
            let growth = angle(i + 1) - angle(i);
            let normal = self.knots[i.min(segments)].normal;
            PointFrame::new(normal, within(angle(i)), growth, within(angle(i + 1)))
        };
        let mut frames = Vec::with_capacity(segments + 3);
        frames.push(frame(0));
        frames.extend((0..=segments).map(frame));
        frames.push(frame(segments));
        frames
    }
}

/// Carries a normal, whichever is easy to find at their start, along segments of a chain, `start` the first: fills in the knots
/// where each ends, and returns the one where they start, and the tightest bend.
fn carry(chain: &Chain, pressed: Option<&[DVec4]>, start: usize, knots: &mut [Knot]) -> (Knot, Option<Tight>) {
    let [a, b, c, d] = GAUSS_LEGENDRE_4;
    let nodes = [a, b, c, d, (1.0, 0.0)].map(|(u, weight)| (u, Weights::new(chain.basis, u), weight));
    let tangent_of = |p: &SplinePoint, fallback: DVec3| p.d1.truncate().try_normalize().unwrap_or(fallback);
    // Where the segment before ends: straight segments do not go on as they began.
    let mut here = if start == 0 { chain.at(0, 0.0) } else { chain.at(start - 1, 1.0) };
    let mut tangent = tangent_of(&here, DVec3::X);
    // Any rule will do for where the turning starts; this one is easy to reproduce: +z, laid across the yarn.
    let across = |axis: DVec3| (axis - axis.dot(tangent) * tangent).try_normalize();
    let mut normal = if tangent.z.abs() < 0.999 { across(DVec3::Z) } else { across(DVec3::X) }.unwrap_or(DVec3::Y);
    let mut along = 0.0;
    let (mut fold, mut tight): (f64, Option<Tight>) = (0.0, None);
    let first = Knot { tangent, normal, along };
    for (segment, knot) in (start..).zip(knots) {
        let points = chain.points_of(segment);
        let axes = pressed.map(|pressed| [pressed[segment], pressed[segment + 1]]);
        for (u, weights, weight) in &nodes {
            let next = weights.evaluate(points);
            let velocity = next.d1.truncate();
            let speed = velocity.length();
            let next_tangent = velocity.try_normalize().unwrap_or(tangent);
            normal = double_reflection(here.at.truncate(), tangent, next.at.truncate(), next_tangent, normal);
            along += weight * speed / next.at.w.max(1e-300);
            // The inner side of a step is as much shorter than its middle as the step turns, times the radius; what is
            // less than nothing runs backwards. Angles and lengths stay finite where curvature does not.
            let distance = next.at.truncate().distance(here.at.truncate());
            let forward = distance / (0.5 * (here.at.w + next.at.w)).max(1e-300);
            // An angle is at most pi / 2 times its chord.
            if fold > 0.0 || FRAC_PI_2 * tangent.distance(next_tangent) > forward {
                let before = fold;
                // A section that is pressed reaches less far inwards.
                let inwards = axes.map_or(1.0, |[from, to]| reach(from.lerp(to, *u), next_tangent - tangent));
                let forward = forward / inwards.max(1e-300);
                fold = (fold + tangent.angle_between(next_tangent) - forward).max(0.0);
                if fold > SEEN_FOLD {
                    let here = Tight { segment, fold, places: usize::from(before <= SEEN_FOLD) };
                    tight = tight.into_iter().chain([here]).reduce(Tight::and);
                }
            }
            (here, tangent) = (next, next_tangent);
        }
        // Rounding must not accumulate over thousands of segments.
        normal = (normal - normal.dot(tangent) * tangent).try_normalize().unwrap_or(normal);
        *knot = Knot { tangent, normal, along };
    }
    (first, tight)
}

/// How far a section reaches in a direction, of half its long axis: `axis` is its short axis and the ratio of both.
fn reach(axis: DVec4, direction: DVec3) -> f64 {
    let (short, direction) = (axis.truncate().normalize_or_zero(), direction.normalize_or_zero());
    let cos2 = short.dot(direction).powi(2).min(1.0);
    (1.0 - cos2 * (1.0 - axis.w * axis.w)).max(0.0).sqrt()
}

/// Carries `normal` from one point of a curve to the next without turning it about the tangent.
fn double_reflection(from: DVec3, tangent: DVec3, to: DVec3, next_tangent: DVec3, normal: DVec3) -> DVec3 {
    let reflect = |v: DVec3, plane: DVec3, square: f64| v - 2.0 / square * plane.dot(v) * plane;
    let step = to - from;
    let c1 = step.length_squared();
    if c1 == 0.0 {
        return normal;
    }
    let (n, t) = (reflect(normal, step, c1), reflect(tangent, step, c1));
    let turn = next_tangent - t;
    let c2 = turn.length_squared();
    if c2 > 1e-300 { reflect(n, turn, c2) } else { n }
}
