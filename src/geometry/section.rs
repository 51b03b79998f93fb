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

mod inside;
mod neighbourhood;

use std::ops::ControlFlow;

use arrayvec::ArrayVec;
use glam::{Vec2, Vec3A};
use wide::f32x4;

use super::{
    density::ChordFibers,
    walk::{LEAST_STRAIGHTNESS, Walker},
    way::{self, MOST_TURN, Passage, Station, Way},
    yarn::{MAX_PLIES, YarnShape, fiber_tangent},
    yarn_frame::{Pressed, YarnFrame},
};
use inside::Bowed;
pub use inside::Inside;
use neighbourhood::{Neighbourhood, Placed, Unbent};

use crate::math::{frame::sin_cos, special::GAUSS_LEGENDRE_4};

/// How far and how finely a way is followed.
#[derive(Clone, Copy)]
struct Reach {
    /// How far along the yarn it is taken for its circle of curvature, in yarn radii; beyond it is looked up anew.
    near: f32,
    /// The longest way, in yarn radii.
    longest: f32,
    /// The most by which plies turn from station to station, radians.
    turn: f32,
    /// How much a bend counts as a turn.
    bend: f32,
}

/// A ray that looks: off by less than 0.02 yarn radii.
const LOOK: Reach = Reach { near: 0.5, longest: 16.0, turn: MOST_TURN, bend: 1.0 };
/// A ray that gathers light.
const GATHER: Reach = Reach { near: 1.0, longest: 16.0, turn: 1.6 * MOST_TURN, bend: 0.5 };
/// Light that leaves from inside: how far it still has to go is felt in all.
const LIGHT: Reach = Reach { near: 1.2, longest: 16.0, turn: 2.0 * MOST_TURN, bend: 0.5 };
/// The shortest step from one station to the next, in yarn radii.
const LEAST_STEP: f32 = 0.1;
/// What may be left of a way without another station, in yarn radii.
const LEAST_LEFT: f32 = 1e-3;
/// Square of the yarn's radius less that of a point's distance from the axis: below, it is at the surface.
const AT_SURFACE: f32 = 0.02;
/// By how much a bent yarn may bow a way between two stations, in yarn radii.
const MOST_BOW: f32 = 0.2;
/// Angle, in radians, up to which a bend bows light that leaves from inside as a third-order curve.
const MOST_BENT: f32 = 0.6;
/// Turns, in radians, below which a way is taken for straight.
const STRAIGHT: f32 = 1e-3;
/// The same of a chord on which fibres are counted.
const STRAIGHT_CHORD: f32 = 0.3;

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
    /// How far the yarn goes on either way, yarn radii.
    pub ends: [f32; 2],
    /// The way to the rest of the yarn, where it is more than this place.
    pub walker: Option<Walker<'a>>,
}

/// One passage of a ray through a ply. Depths are distances along the ray from where it enters the yarn, in yarn radii.
#[derive(Clone, Copy, Debug)]
pub struct PlyCrossing {
    /// Index of the ply in the yarn's shape.
    pub ply: usize,
    /// Depth at which the ray enters the ply's core; a ray that only grazes its outer fibres has `enter` = `exit`.
    pub enter: f32,
    /// Depth at which it leaves the core, beyond `enter`.
    pub exit: f32,
    /// Depth of the middle of the chord.
    pub foot: f32,
    /// The fibres on the chord if they were not tilted, and where they lie, by distances in the section: x from the middle.
    pub chord: ChordFibers,
    /// Signed distance of the ray from the ply's axis, in the circle of the ply's radius.
    pub offset: f32,
    /// How far along the yarn the ray is at `enter` and at `exit`.
    pub travel: [f32; 2],
    /// Expected number of fibres on the chord.
    pub fibers: f32,
}

impl PlyCrossing {
    /// How far along the yarn the ray is at a depth of this crossing.
    #[inline]
    pub fn travel_at(&self, depth: f32) -> f32 {
        let length = self.exit - self.enter;
        let share = if length > 0.0 { (depth - self.enter) / length } else { 0.0 };
        self.travel[0] + share * (self.travel[1] - self.travel[0])
    }

    /// Outward unit normal of the ply where the ray enters.
    pub fn normal(&self, shape: &YarnShape, section: &Section<'_>) -> Vec3A {
        let ply = &shape.plies[self.ply];
        let spot = section.inside(shape, section.point(self.enter), self.travel[0]);
        let p = spot.at - ply.distance * ply.direction;
        // The gradient of the distance in the ply's circle, first in the unwound yarn.
        let (along, across) = (p.dot(ply.direction), ply.direction.perp_dot(p));
        let stretch = ply.stretch * ply.stretch;
        let gradient = stretch.x * along * ply.direction + stretch.y * across * ply.direction.perp();
        // A step along the yarn turns the point back by as much as the plies turn.
        let rate = section.turn(shape);
        let rise = -rate * gradient.dot(spot.at.perp()) / spot.straightness;
        let wound = spot.pressed.map_or(gradient, |pressed| pressed.round(gradient));
        spot.out(wound.extend(rise).into()).normalize_or(Vec3A::X)
    }

    /// Unit tangent of the fibres where the ray enters.
    pub fn tangent_at_entry(&self, shape: &YarnShape, section: &Section<'_>) -> Vec3A {
        section.fiber_tangent(shape, self.ply, section.point(self.enter), self.travel[0]).normalize()
    }

    /// Unit tangent of the ply's axis where the ray passes it.
    #[inline]
    pub fn ply_tangent(&self, shape: &YarnShape, section: &Section<'_>) -> Vec3A {
        let depth = self.foot.clamp(self.enter, self.exit);
        let spot = section.inside(shape, section.point(depth), self.travel_at(depth));
        let ply = &shape.plies[self.ply];
        spot.tangent_at(shape, section, self.ply, ply.distance * ply.direction).normalize()
    }
}

/// The plies a ray crosses, nearest first; a ray along the yarn may cross one more than once.
pub type Crossings = ArrayVec<PlyCrossing, MAX_PLIES>;

/// A ply on a way out of a yarn.
#[derive(Clone, Copy, Debug)]
pub struct PlyAhead {
    /// Index of the ply in the yarn's shape.
    pub ply: usize,
    /// Signed distance of the way from the ply's axis, in the circle of the ply's radius.
    pub offset: f32,
    /// Distance in the section from the start to the way's point nearest to the ply's axis; negative behind the start.
    pub foot: f32,
    /// Length in the circle of one unit of that distance.
    pub length: f32,
}

/// A station with what only the making of a way needs: the place in the yarn's real section, and its change with depth.
#[derive(Clone, Copy)]
struct Step {
    station: Station,
    real: Vec2,
    real_slope: Vec2,
}

/// A straight line through a yarn.
#[derive(Clone, Copy)]
struct Line {
    start: Vec3A,
    direction: Vec3A,
    reach: Reach,
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

    /// The world position of the point on the ray at a depth.
    #[inline]
    pub fn point_on_ray(&self, depth: f32) -> Vec3A {
        self.centre + self.radius * self.to_world(self.point(depth))
    }

    /// By how much fibres are closer to each other than in the round section: its area over this one's.
    #[inline]
    pub fn squeeze(&self) -> f32 {
        self.pressed.map_or(1.0, |pressed| pressed.stretch)
    }

    /// The tangent of a fibre of a ply at a `point` of this frame, `travel` farther along the yarn: its part along the yarn
    /// is 1.
    #[inline]
    pub fn fiber_tangent(&self, shape: &YarnShape, ply: usize, point: Vec3A, travel: f32) -> Vec3A {
        self.inside(shape, point, travel).fiber_tangent(shape, self, ply)
    }

    /// Whether the ray meets any ply: what the filter asks of every candidate hit.
    #[inline]
    pub fn meets_ply(&self, shape: &YarnShape) -> bool {
        let mut met = false;
        self.march_ray(shape, |a, b| {
            met = way::passes(a, b, &shape.fours);
            if met { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        met
    }

    /// Fills `out` with the plies on the ray's way, nearest first.
    #[inline]
    pub fn crossings(&self, shape: &YarnShape, out: &mut Crossings) {
        out.clear();
        let mut way = Way::new();
        self.march_ray(shape, |a, b| keep(&mut way, a, b));
        way::passages::<true>(&way, shape, |index, passage| {
            let ply = &shape.plies[index];
            if ply.fibers == 0.0 {
                return;
            }
            let Passage { enter, exit, offset, .. } = passage;
            let chord = ply.chord(passage.offset, passage.speed / self.cos);
            let fibers =
                chord.total() * passage.share / self.cos * self.fibers_over_chord(shape, index, &way, &enter, &exit);
            let (from, to) = (enter.depth, exit.depth);
            let foot = 0.5 * (from + to);
            let travel = [enter.travel, exit.travel];
            // Signed as h is: seen from the camera, towards which x points.
            let offset = -offset;
            let crossing = PlyCrossing { ply: index, enter: from, exit: to, foot, chord, offset, travel, fibers };
            let place = out.iter().position(|c| c.enter > from).unwrap_or(out.len());
            if out.is_full() {
                // What lies deepest is seen least.
                out.pop();
            }
            out.insert(place.min(out.len()), crossing);
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
        mut visit: impl FnMut(PlyAhead),
    ) {
        // Distances in the section, of which a steep way has few.
        let cos = (1.0 - w.z * w.z).max(1e-9).sqrt();
        let direction = if self.tilted { w } else { Vec3A::new(w.x, w.y, 0.0) };
        let mut pass = |ply: usize, Passage { offset, foot, speed, .. }: Passage| {
            visit(PlyAhead { ply, offset, foot: foot * cos, length: speed / cos });
        };
        if self.ends == [f32::NEG_INFINITY, f32::INFINITY]
            && let Some(way) = from.way_out(shift, direction)
        {
            return way::passages::<false>(&way, shape, pass);
        }
        let line = Line { start: from.point + shift, direction, reach: LIGHT };
        let mut near = self.neighbourhood(self.turn(shape), from.travel, LIGHT);
        let first = self.step(&mut near, line.start, direction, 0.0, LIGHT);
        let mut way = Way::new();
        self.march(&line, first, &mut near, |a, b| keep(&mut way, a, b));
        way::passages::<false>(&way, shape, &mut pass);
    }

    /// Turns of the plies, radians per yarn radius.
    #[inline]
    fn turn(&self, shape: &YarnShape) -> f32 {
        if self.tilted { self.turn.unwrap_or(shape.ply_rate) } else { shape.ply_rate }
    }

    /// Goes along the ray from station to station, until it leaves the yarn or `visit` has seen enough.
    #[inline]
    fn march_ray(&self, shape: &YarnShape, visit: impl FnMut(&Station, &Station) -> ControlFlow<()>) {
        let reach = if self.looked_at { LOOK } else { GATHER };
        let line = Line { start: self.point(0.0), direction: self.direction(), reach };
        let mut near = self.neighbourhood(self.turn(shape), 0.0, reach);
        let first = near.enter(line.start, line.direction);
        self.march(&line, first, &mut near, visit);
    }

    /// Goes from station to station, until the way leaves the yarn or `visit` has seen enough.
    #[inline]
    fn march(
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
                step /= (turning * step / reach.turn).max(bows).ceil();
                // Inside of a bend it may turn out faster.
                for _ in 0..4 {
                    let depth = station.depth + step;
                    next = self.step(near, start + depth * direction, direction, depth, reach);
                    let turned = rate * (next.station.travel - station.travel);
                    if turned.abs() <= 1.3 * reach.turn {
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
    fn neighbourhood(&self, rate: f32, travel: f32, reach: Reach) -> Neighbourhood {
        if travel.abs() > reach.near
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
    fn step(&self, near: &mut Neighbourhood, point: Vec3A, direction: Vec3A, depth: f32, reach: Reach) -> Step {
        let mut unbent = near.unbend(point, direction);
        if unbent.travel.abs() > reach.near
            && let Some(far) = self.walk_to(near.travel + unbent.travel, reach)
        {
            *near = far;
            unbent = near.unbend(point, direction);
        }
        near.unwind(&unbent, depth)
    }

    /// A point of this frame, which is about `travel` along the yarn, in the unwound yarn.
    #[inline]
    pub fn inside(&self, shape: &YarnShape, point: Vec3A, travel: f32) -> Inside {
        let near = self.neighbourhood(self.turn(shape), travel, LIGHT);
        let Unbent { at, travel: beyond, straightness, lean, cos, .. } = near.unbend(point, Vec3A::ZERO);
        let (phase, pressed) = (near.phase_at(beyond), near.pressed_at(beyond));
        // The frame turned with the bend: sin / k = `lean`, and (1 - cos) / k^2 = lean^2 / (1 + cos).
        let bend = near.bend;
        let out = |v: Vec3A| near.place.map_or(v, |p| v.x * p.x + v.y * p.y + v.z * p.z);
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

    /// Fibres that a unit of a chord's depth meets over those that it would meet across untwisted round plies: the mean
    /// from `enter` to `exit` of |w x t| for the unit vector w of the ray and the tangents t (of z = 1) of the fibres, times
    /// [`Self::squeeze`]. (The paper's 1 / cos(theta_fiber), Eq. 2, takes the worst place for all: fibres near the ply's
    /// axis are not tilted.)
    #[inline]
    fn fibers_over_chord(&self, shape: &YarnShape, ply: usize, way: &Way, enter: &Station, exit: &Station) -> f32 {
        let of = &shape.plies[ply];
        let along = |at: &Station| if self.tilted { at.advance * at.straightness } else { -self.sin };
        if of.fiber_rate == 0.0 && shape.ply_rate == 0.0 {
            // Fibres along the yarn.
            let along = 0.5 * (along(enter) + along(exit));
            return (1.0 - along * along).max(1e-6).sqrt() * self.squeeze();
        }
        // Tangent and ray at both ends; between them both are linear, or the parabola through the middle where the ray is
        // seen to bend. The mean is by four-point Gauss-Legendre quadrature.
        let direction = self.direction();
        let end = |at: &Station| match self.pressed {
            // In the unwound yarn's axes: the ray moves as it is seen to, and as those axes turn.
            None => {
                let t = fiber_tangent(of, shape.ply_rate, of.distance * of.direction, of.direction, at.at);
                let w = at.slope + self.turn(shape) * at.advance * at.at.perp();
                (t.truncate() / at.straightness, w, along(at))
            }
            Some(_) => {
                let t = self.fiber_tangent(shape, ply, self.point(at.depth), at.travel);
                let t = t / t.z.abs().max(1e-6).copysign(t.z);
                (t.truncate(), direction.truncate(), -self.sin)
            }
        };
        let ((ta, wa, za), (tb, wb, zb)) = (end(enter), end(exit));
        let nodes = f32x4::new(GAUSS_LEGENDRE_4.map(|(node, _)| node as f32));
        let weights = f32x4::new(GAUSS_LEGENDRE_4.map(|(_, weight)| weight as f32));
        let (mut tm, mut wm, mut zm) = (Vec2::ZERO, Vec2::ZERO, 0.0);
        if (shape.ply_rate * (exit.travel - enter.travel)).abs() > STRAIGHT_CHORD {
            let (t, w, z) = end(&way::station_at(way, 0.5 * (enter.depth + exit.depth)));
            (tm, wm, zm) = (4.0 * t - 2.0 * (ta + tb), 4.0 * w - 2.0 * (wa + wb), 4.0 * z - 2.0 * (za + zb));
        }
        let bow = nodes * (f32x4::ONE - nodes);
        let mix = |a: f32, b: f32, m: f32| f32x4::splat(a) + nodes * f32x4::splat(b - a) + bow * f32x4::splat(m);
        let (tx, ty) = (mix(ta.x, tb.x, tm.x), mix(ta.y, tb.y, tm.y));
        let (wx, wy, wz) = (mix(wa.x, wb.x, wm.x), mix(wa.y, wb.y, wm.y), mix(za, zb, zm));
        let (cx, cy, cz) = (wy - wz * ty, wz * tx - wx, wx * ty - wy * tx);
        // Between two places where the unwound yarn's axes have turned, the straight line is shorter than w.
        let square = (cx * cx + cy * cy + cz * cz) / (wx * wx + wy * wy + wz * wz);
        (square.sqrt() * weights).reduce_add() * self.squeeze()
    }
}

/// How far it is from a point of the section along a slope to the unit circle: negative from outside.
#[inline]
fn to_surface(at: Vec2, slope: Vec2) -> f32 {
    let (speed, outward) = (slope.length_squared().max(1e-12), at.dot(slope));
    let square = outward * outward + speed * (1.0 - at.length_squared());
    (square.max(0.0).sqrt() - outward) / speed
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

/// (cos, sin) of an angle.
#[inline]
fn angle(by: f32) -> Vec2 {
    let (sin, cos) = sin_cos(by);
    Vec2::new(cos, sin)
}

#[cfg(test)]
mod tests;
