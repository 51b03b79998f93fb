//! A straight line followed through a yarn, from station to station.

use std::ops::ControlFlow;

use glam::{Vec2, Vec3A};

use super::{
    Section,
    bowed::Bowed,
    neighbourhood::{Neighbourhood, Placed},
    reach::{GATHER, LEAST_LEFT, LOOK, LOOK_INTO_PRESSED, Reach, Step, angle},
};
use crate::geometry::{way::Station, yarn::YarnShape, yarn_frame::Pressed};

/// The shortest step towards the surface, in yarn radii.
const LEAST_STEP: f32 = 0.1;
/// The shortest that a step is made by turns and bends, in yarn radii.
const SHORTEST_STEP: f32 = 0.02;
/// Of what a reach lets plies turn in a step, how much they may turn when the step is made; else it is halved.
const MOST_TURNED: f32 = 0.8;
/// Square of the yarn's radius less that of a point's distance from the axis: below, it is at the surface.
const AT_SURFACE: f32 = 0.02;
/// Turns, in radians, below which a way is taken for straight.
const STRAIGHT: f32 = 1e-3;

/// A straight line through a yarn.
#[derive(Clone, Copy)]
pub(super) struct Line {
    pub(super) start: Vec3A,
    pub(super) direction: Vec3A,
    pub(super) reach: Reach,
}

impl Section<'_> {
    /// Turns of the plies, radians per yarn radius.
    #[inline]
    pub(super) fn turn(&self, shape: &YarnShape) -> f32 {
        if self.tilted { self.turn.unwrap_or(shape.ply_rate) } else { shape.ply_rate }
    }

    /// Goes along the ray from station to station, until it leaves the yarn or `visit` has seen enough.
    #[inline]
    pub(super) fn march_ray(&self, shape: &YarnShape, visit: impl FnMut(&Station, &Station) -> ControlFlow<()>) {
        let reach = match self.pressed {
            _ if !self.looked_at => GATHER,
            Some(_) => LOOK_INTO_PRESSED,
            None => LOOK,
        };
        let line = Line { start: self.point(0.0), direction: self.direction(), reach };
        let mut near = self.neighbourhood(self.turn(shape), 0.0, reach);
        let first = near.enter(line.start, line.direction);
        self.march(&line, first, &mut near, visit);
    }

    /// Goes from station to station, until the way leaves the yarn or `visit` has seen enough.
    #[inline]
    pub(super) fn march(
        &self,
        line: &Line,
        first: Step,
        near: &mut Neighbourhood,
        mut visit: impl FnMut(&Station, &Station) -> ControlFlow<()>,
    ) {
        let Line { start, direction, reach } = *line;
        let mut here = first;
        loop {
            let Step { station, real, real_slope } = here;
            let (inside, outward) = (1.0 - real.length_squared(), real.dot(real_slope));
            if inside < AT_SURFACE && outward > 0.0 && station.depth > 0.0 {
                return;
            }
            let bowed = Bowed {
                at: real,
                slope: real_slope,
                advance: station.advance,
                straightness: station.straightness,
                bend: near.bend,
            };
            let mut step = reach.longest;
            if real_slope.length_squared() > 1e-12 {
                step = bowed.to_surface().max(LEAST_STEP);
            }
            step = step.min(reach.longest - station.depth);
            let end = self.ends[usize::from(station.advance > 0.0)];
            if end.is_finite() && station.advance != 0.0 {
                step = step.min((end - station.travel) / station.advance);
            }
            if step.is_nan() || step <= LEAST_LEFT {
                return;
            }
            let rate = near.turning;
            let mut turning = rate * station.advance.abs();
            // Faster inside of the bend.
            turning *= (station.straightness / (1.0 - near.bend.dot(real + step * real_slope)).max(0.3)).max(1.0);
            let mut next = here;
            if turning * step <= STRAIGHT {
                next.station.depth += step;
                next.station.at += step * station.slope;
                next.station.travel += step * station.advance;
                next.real += step * real_slope;
            } else {
                let bows = station.advance.abs() * step * near.bowing;
                // Where a yarn has no room for its bend, way after way would be too far.
                step = (step / (turning * step / reach.turn).max(bows).ceil()).max(SHORTEST_STEP.min(step));
                // Inside of a bend it may turn out faster.
                for _ in 0..4 {
                    let depth = station.depth + step;
                    next = self.step(near, start + depth * direction, direction, depth, reach);
                    // How far it turns, and how much faster at the end than at the start.
                    let turned = (next.station.travel - station.travel).abs();
                    let hastened = 2.0 * step * (next.station.advance - station.advance).abs();
                    if rate * turned.max(hastened) <= MOST_TURNED * reach.turn || step <= SHORTEST_STEP {
                        break;
                    }
                    step *= 0.5;
                }
            }
            if visit(&station, &next.station).is_break() {
                return;
            }
            here = next;
        }
    }

    /// The yarn about the place so far along it: the section itself, if that is near enough.
    #[inline]
    pub(super) fn neighbourhood(&self, rate: f32, travel: f32, reach: Reach) -> Neighbourhood {
        if travel.abs() > reach.near(self.bend)
            && let Some(far) = self.walk_to(travel, reach)
        {
            return far;
        }
        Neighbourhood {
            place: None,
            travel: 0.0,
            bend: self.bend,
            phase: self.phase,
            turn: rate,
            pressed: self.pressed,
            pressed_turn: self.pressed_turn,
            turning: 0.0,
            bowing: 0.0,
        }
        .rated(reach)
    }

    /// The yarn about the place so far along it, from the yarn itself. `None` where there is none, or it does not go so far.
    #[inline]
    fn walk_to(&self, travel: f32, reach: Reach) -> Option<Neighbourhood> {
        let mut walker = self.walker?;
        let place = walker.walk(travel)?;
        let across = place.tangent.cross(place.normal);
        let section = |v: Vec3A| Vec2::new(v.dot(place.normal), v.dot(across));
        let found = Neighbourhood {
            place: Some(Placed {
                origin: self.to_local(place.centre - self.centre) / self.radius,
                x: self.to_local(place.normal),
                y: self.to_local(across),
                z: self.to_local(place.tangent),
                scale: self.radius / place.radius,
            }),
            travel,
            bend: section(place.curvature) * place.radius,
            phase: angle(place.phase),
            turn: place.turn.unwrap_or(0.0),
            pressed: Pressed::new(place.flattening),
            pressed_turn: place.flattening_turn,
            turning: 0.0,
            bowing: 0.0,
        };
        Some(found.rated(reach))
    }

    /// The station at a point of this frame, by the neighbourhood known so far or by a nearer one.
    #[inline]
    pub(super) fn step(
        &self,
        near: &mut Neighbourhood,
        point: Vec3A,
        direction: Vec3A,
        depth: f32,
        reach: Reach,
    ) -> Step {
        let mut unbent = near.unbend(point, direction);
        for _ in 0..reach.looks {
            if unbent.travel.abs() <= reach.near(near.bend) {
                break;
            }
            let Some(far) = self.walk_to(near.travel + unbent.travel, reach) else { break };
            *near = far;
            unbent = near.unbend(point, direction);
        }
        near.unwind(&unbent, depth)
    }
}
