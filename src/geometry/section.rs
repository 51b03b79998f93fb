//! A ray in a yarn: which plies it crosses, in order, and how many fibres on the way (paper Sec. 3.2).
//!
//! The paper takes the ray as perpendicular to the yarn and looks at one cross-section. Here the ray is followed through
//! the yarn. Near the place where it enters, the yarn is its circle of curvature; farther along, where the ray runs
//! along the yarn, its next circle is looked up ([`Walker`]). What is seen of the ray in the unwound yarn, where plies are
//! straight cylinders, is a [`Way`]; plies are met by way of it, at any angle and in any bend. A ray that crosses the
//! yarn has a way of two stations, and one that runs along it one for every 0.8 radians by which the plies turn. Rays that
//! do not look but gather light are followed more coarsely, and light that leaves from inside takes its two stations from its
//! own place where it turns little.
//!
//! Embree's filter and the shading both ask for that way ([`Section::meets_ply`], [`Section::crossings`]), and so does the
//! light that leaves from inside ([`Section::plies_ahead`]).
//!
//! Frame: z is the yarn's tangent where the ray enters, x points to the camera (projected into the section), y = z x x;
//! the origin is on the yarn's axis. Lengths are in yarn radii. In the section the ray travels towards -x at y = h.

mod bowed;
mod crossing;
mod inside;
mod march;
mod neighbourhood;
mod reach;
mod seen_fiber;

use std::ops::ControlFlow;

use glam::{Vec2, Vec3A};

pub use self::{
    crossing::{Crossings, PlyAhead, PlyCrossing},
    inside::Inside,
    seen_fiber::SeenFiber,
};
use self::{march::Line, neighbourhood::Unbent, reach::LIGHT};
use super::{
    gaps::PlyGaps,
    walk::Walker,
    way::{self, Passage, Station, Way},
    yarn::YarnShape,
    yarn_frame::{Pressed, SectionGrowth, YarnFrame},
};
use crate::math::frame::sin_cos;

/// A place where a ray enters a yarn, as the ray sees it.
#[derive(Clone, Copy, Debug)]
pub struct Section<'a> {
    /// The frame's x axis in the world: across the yarn, towards the camera.
    pub x: Vec3A,
    /// The frame's y axis in the world: across the yarn and the ray.
    pub y: Vec3A,
    /// The frame's z axis in the world: the yarn's tangent.
    pub z: Vec3A,
    /// Origin of the frame in the world.
    pub centre: Vec3A,
    /// World length of one yarn radius.
    pub radius: f32,
    /// Offset of the ray from the yarn's axis, -1 to 1.
    pub h: f32,
    /// x where the ray enters the yarn, at y = h and z = 0.
    pub enter: f32,
    /// Sine of the camera direction's latitude against the yarn.
    pub sin: f32,
    /// Cosine of it, at least 1e-3.
    pub cos: f32,
    /// Whether depth and place along the yarn go together (see [`YarnShape::tilted`]).
    pub tilted: bool,
    /// Curvature in the section, 1/yarn radii.
    pub bend: Vec2,
    /// Whether what the ray meets is looked at: plies are followed more finely then.
    pub looked_at: bool,
    /// (cos, sin) of the plies' phase in this frame.
    pub phase: Vec2,
    /// How that phase grows along the yarn; `None` where it does as the yarn's shape says.
    pub turn: Option<f32>,
    /// How the section is pressed flat, if it is.
    pub pressed: Option<Pressed>,
    /// By how much the axis of pressing turns along the yarn, radians per yarn radius.
    pub pressed_turn: f32,
    /// How it grows along the yarn.
    pub growth: SectionGrowth,
    /// How far the yarn goes on either way, yarn radii.
    pub ends: [f32; 2],
    /// The way to the rest of the yarn, where it is more than this place.
    pub walker: Option<Walker<'a>>,
}

/// Turns `p` back by the angle of (cos, sin).
#[inline]
fn unrotate(p: Vec2, by: Vec2) -> Vec2 {
    Vec2::new(p.x * by.x + p.y * by.y, p.y * by.x - p.x * by.y)
}

impl<'a> Section<'a> {
    /// The section at `place` for a ray from `origin` along the unit vector `direction`, which enters the yarn there. The
    /// yarn goes on as a circle.
    #[inline]
    pub fn new(place: &YarnFrame, origin: Vec3A, direction: Vec3A, tilted: bool) -> Self {
        let z = place.tangent;
        let to_camera = -direction;
        let sin = to_camera.dot(z).clamp(-1.0, 1.0);
        let across = to_camera - sin * z;
        let length = across.length();
        // A ray along the yarn has no side: any will do.
        let x = if length > 1e-6 { across / length } else { place.normal };
        let y = z.cross(x);
        let h = ((origin - place.centre).dot(y) / place.radius).clamp(-1.0, 1.0);
        let k = if tilted { place.curvature * place.radius } else { Vec3A::ZERO };
        let (s, c) = sin_cos(place.phase);
        let normal = Vec2::new(place.normal.dot(x), place.normal.dot(y));
        Self {
            x,
            y,
            z,
            centre: place.centre,
            radius: place.radius,
            h,
            enter: (1.0 - h * h).max(0.0).sqrt(),
            sin,
            cos: length.max(1e-3),
            tilted,
            bend: Vec2::new(k.dot(x), k.dot(y)),
            looked_at: true,
            phase: normal.rotate(Vec2::new(c, s)),
            turn: place.turn,
            pressed: Pressed::new(place.flattening)
                .map(|pressed| Pressed { axis: pressed.axis.rotate(normal), ..pressed }),
            pressed_turn: place.flattening_turn,
            growth: place.growth,
            ends: [f32::NEG_INFINITY, f32::INFINITY],
            walker: None,
        }
    }

    /// The section of a yarn where a ray meets it at the distance `t`.
    #[inline]
    pub fn at_hit(
        (walker, place): (Walker<'a>, YarnFrame),
        origin: Vec3A,
        direction: Vec3A,
        t: f32,
        tilted: bool,
    ) -> Self {
        let mut section = Self::new(&place, origin, direction, tilted);
        if tilted {
            section.ends = walker.ends();
            section.walker = Some(walker);
            if section.ends != [f32::NEG_INFINITY, f32::INFINITY] {
                // Through the flat end of a yarn a ray enters anywhere.
                let x = (origin + t * direction - place.centre).dot(section.x) / place.radius;
                section.enter = x.clamp(-section.enter, section.enter);
            }
        }
        section
    }

    /// The section of a yarn at the place abreast of the start of a ray within it.
    #[inline]
    pub fn at_start(at: (Walker<'a>, YarnFrame), origin: Vec3A, direction: Vec3A, tilted: bool) -> Self {
        let (centre, radius) = (at.1.centre, at.1.radius);
        let mut section = Self::at_hit(at, origin, direction, 0.0, tilted);
        section.enter = (origin - centre).dot(section.x) / radius;
        section
    }

    /// A vector of this frame in the world.
    #[inline]
    pub fn to_world(&self, v: Vec3A) -> Vec3A {
        v.x * self.x + v.y * self.y + v.z * self.z
    }

    /// A vector of the world in this frame.
    #[inline]
    pub fn to_local(&self, v: Vec3A) -> Vec3A {
        Vec3A::new(v.dot(self.x), v.dot(self.y), v.dot(self.z))
    }

    /// The direction of the ray in this frame.
    #[inline]
    pub fn direction(&self) -> Vec3A {
        if self.tilted {
            Vec3A::new(-(1.0 - self.sin * self.sin).max(0.0).sqrt(), 0.0, -self.sin)
        } else {
            Vec3A::new(-self.cos, 0.0, 0.0)
        }
    }

    /// The point on the ray at a depth, in this frame.
    #[inline]
    pub fn point(&self, depth: f32) -> Vec3A {
        Vec3A::new(self.enter, self.h, 0.0) + depth * self.direction()
    }

    /// The world position of a point of this frame.
    #[inline]
    pub fn point_in_world(&self, point: Vec3A) -> Vec3A {
        self.centre + self.radius * self.to_world(point)
    }

    /// The world position of the point on the ray at a depth.
    #[inline]
    pub fn point_on_ray(&self, depth: f32) -> Vec3A {
        self.point_in_world(self.point(depth))
    }

    /// How many more fibres lie on a chord than on that of the round section, by its length there: fibres are closer to each
    /// other by the ratio of the axes, and thinner than the yarn by its root (see [`YarnFrame::round_radius`]).
    #[inline]
    pub fn squeeze(&self) -> f32 {
        self.pressed.map_or(1.0, |pressed| pressed.stretch.sqrt())
    }

    /// How much of the round section's radius a unit of the ray passes where it enters, in the section: 1 if that is not pressed.
    #[inline]
    pub fn rounded(&self) -> f32 {
        self.pressed.map_or(1.0, |pressed| pressed.round(Vec2::X).length())
    }

    /// How thick fibres are there over those of the round section, in radii of the yarn.
    #[inline]
    pub fn thinness(&self) -> f32 {
        1.0 / self.squeeze()
    }

    /// Of a slope across the yarn along it, at a point of the round section, that in the section as it is there: as wide as it grows, and
    /// `pressed`. What presses turns as well: the map A at the angle phi is R(phi) S R(-phi), so that A' = phi' (J A - A J) + R(phi) S' R(-phi).
    #[inline]
    fn real_slope(&self, pressed: Option<Pressed>, at: Vec2, slope: Vec2) -> Vec2 {
        let SectionGrowth { widening, thickening } = self.growth;
        match pressed {
            None => slope + widening * at,
            Some(pressed) => {
                let real = pressed.real(at);
                let turned = self.pressed_turn * (real.perp() - pressed.real(at.perp()));
                let grown = widening * real + thickening * at.dot(pressed.axis) * pressed.axis;
                pressed.real(slope) + turned + grown
            }
        }
    }

    /// The tangent of a fibre of a ply at a `point` of this frame, `travel` farther along the yarn: its part along the yarn
    /// is 1.
    #[inline]
    pub fn fiber_tangent(&self, shape: &YarnShape, ply: usize, point: Vec3A, travel: f32) -> Vec3A {
        self.inside(shape, point, travel).fiber_tangent(shape, self, ply)
    }

    /// How deep the ray comes nearest to the axis of the first ply it meets, if it meets any: what the filter asks of every
    /// candidate hit.
    #[inline]
    pub fn meets_ply(&self, shape: &YarnShape) -> Option<f32> {
        let mut met = None;
        self.march_ray(shape, |a, b| {
            met = way::passes(a, b, &shape.fours);
            if met.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        met
    }

    /// Fills `out` with the plies on the ray's way, nearest first.
    #[inline]
    pub fn crossings(&self, shape: &YarnShape, out: &mut Crossings) {
        out.clear();
        let mut way = Way::new();
        self.march_ray(shape, |a, b| keep(&mut way, a, b));
        way::passages::<true>(&way, &shape.plies, &shape.fours, |index, passing| {
            let ply = &shape.plies[index];
            if ply.fibers == 0.0 {
                return;
            }
            let passage = passing.as_it_goes(ply.core_radius);
            let Passage { enter, exit, offset, stretched, .. } = passage;
            let length = passage.speed / self.cos;
            let wide = self.squeeze() / (self.rounded() * stretched);
            let chord = ply.chord(passage.offset, length, self.thinness(), wide);
            let gaps = PlyGaps::new(ply.dead_zone(&chord, passage.offset, length));
            let (met, ends) = self.fibers_over_chord(shape, index, &way, &enter, &exit);
            let fibers = chord.total() * passage.share / self.cos * met;
            let (from, to) = (enter.depth, exit.depth);
            let foot = 0.5 * (from + to);
            let travel = [enter.travel, exit.travel];
            // Signed as h is: seen from the camera, towards which x points.
            let offset = -offset;
            let crossing = PlyCrossing {
                ply: index,
                enter: from,
                exit: to,
                foot,
                chord,
                offset,
                wide,
                length,
                travel,
                fibers,
                ends,
                gaps,
            };
            let place = out.iter().position(|c| c.enter > from).unwrap_or(out.len());
            if place == out.capacity() {
                // What lies deepest is seen least.
                return;
            }
            if out.is_full() {
                out.pop();
            }
            out.insert(place, crossing);
        });
    }

    /// The plies that lie ahead of a point `shift` beside one inside the yarn, in a direction `w` of this frame; one may come
    /// more than once. Of a pressed section fibres are closer to each other than of a round one, by [`Self::squeeze`].
    #[inline]
    pub fn plies_ahead(
        &self,
        shape: &YarnShape,
        from: &Inside,
        shift: Vec3A,
        w: Vec3A,
        mut visit: impl FnMut(PlyAhead<'_>),
    ) {
        let (cos, direction) = self.direction_out(w);
        let start = from.point + shift;
        let mut pass = |way: &[Station]| {
            // Measured of pressed yarns alone: of round ones light from behind, which is too little, became less.
            let bent = from.pressed.is_some() && way::is_bent(way);
            let mut ahead = |ply: usize, Passage { offset, foot, speed, stretched, .. }: Passage| {
                let (foot, length) = (foot * cos, speed / cos);
                visit(PlyAhead { ply, offset, foot, length, stretched, way, start, bent, cos });
            };
            if bent {
                return way::bent_passages(way, &shape.plies, &shape.fours, &mut ahead);
            }
            way::passages::<false>(way, &shape.plies, &shape.fours, |ply, passing| {
                ahead(ply, passing.as_it_goes(shape.plies[ply].core_radius));
            });
        };
        if self.ends == [f32::NEG_INFINITY, f32::INFINITY]
            && let Some(way) = from.way_out(self, shift, direction)
        {
            return pass(&way);
        }
        let line = Line { start, direction, reach: LIGHT };
        let mut near = self.neighbourhood(self.turn(shape), from.travel, LIGHT);
        let first = self.step(&mut near, line.start, direction, 0.0, LIGHT);
        let mut way = Way::new();
        self.march(&line, first, &mut near, |a, b| keep(&mut way, a, b));
        pass(&way);
    }

    /// The length in the section of a unit of a way out in the direction `w`, of which a steep way has little, and where the way leads.
    #[inline]
    fn direction_out(&self, w: Vec3A) -> (f32, Vec3A) {
        let cos = (1.0 - w.z * w.z).max(1e-9).sqrt();
        (cos, if self.tilted { w } else { Vec3A::new(w.x, w.y, 0.0) })
    }

    /// The place at a `distance` in the section, as [`Self::plies_ahead`] gives them, from a point `shift` beside one inside the yarn.
    #[inline]
    pub fn beyond(&self, shape: &YarnShape, from: &Inside, shift: Vec3A, w: Vec3A, distance: f32) -> Inside {
        let (cos, direction) = self.direction_out(w);
        let depth = distance / cos;
        let travel = from.travel + depth * direction.dot(from.z) / from.straightness;
        self.inside(shape, from.point + shift + depth * direction, travel)
    }

    /// The point of this frame that is `at` in the section of the unwound yarn and `travel` along it.
    pub(super) fn point_at(&self, shape: &YarnShape, at: Vec2, travel: f32) -> Vec3A {
        let near = self.neighbourhood(self.turn(shape), travel, LIGHT);
        let beyond = travel - near.travel;
        let round = at.rotate(near.phase_at(beyond));
        near.bent(near.pressed_at(beyond).map_or(round, |pressed| pressed.real(round)), beyond)
    }

    /// A point of this frame, which is about `travel` along the yarn, in the unwound yarn.
    #[inline]
    pub fn inside(&self, shape: &YarnShape, point: Vec3A, travel: f32) -> Inside {
        let near = self.neighbourhood(self.turn(shape), travel, LIGHT);
        let Unbent { at, travel: beyond, straightness, lean, cos, .. } = near.unbend(point, Vec3A::ZERO);
        let (phase, pressed) = (near.phase_at(beyond), near.pressed_at(beyond));
        // The frame turned with the bend: sin / k = `lean`, and (1 - cos) / k^2 = lean^2 / (1 + cos).
        let bend = near.bend;
        let out = |v: Vec3A| near.place.map_or(v, |place| place.out(v));
        let turned = |v: Vec2| {
            let part = bend.dot(v);
            out((v - bend * (part * lean * lean / (1.0 + cos))).extend(-part * lean).into())
        };
        Inside {
            point,
            travel: near.travel + beyond,
            at: unrotate(pressed.map_or(at, |p| p.round(at)), phase),
            x: turned(phase),
            y: turned(phase.perp()),
            z: out((bend * lean).extend(cos).into()),
            pressed: pressed.map(|p| Pressed { axis: unrotate(p.axis, phase), ..p }),
            straightness,
            bend: unrotate(bend, phase),
            turn: near.turn,
        }
    }
}

/// Keeps the stations of a way.
#[inline]
fn keep(way: &mut Way, a: &Station, b: &Station) -> ControlFlow<()> {
    if way.is_empty() {
        way.push(*a);
    }
    way.push(*b);
    if way.is_full() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

#[cfg(test)]
mod tests;
