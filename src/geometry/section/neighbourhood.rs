//! The yarn about one of its places as a circle: points and directions, unbent and unwound.

use glam::{Vec2, Vec3A};

use super::{
    reach::{Reach, Step, angle},
    unrotate,
};
use crate::{
    geometry::{walk::LEAST_STRAIGHTNESS, way::Station, yarn_frame::Pressed},
    math::frame::sin_cos,
};

/// By how much a bent yarn may bow a way between two stations, in yarn radii.
const MOST_BOW: f32 = 0.2;

/// The yarn about one of its places, taken for its circle of curvature.
#[derive(Clone, Copy)]
pub(super) struct Neighbourhood {
    /// Where the place is, in the section's frame; none at the section itself.
    pub(super) place: Option<Placed>,
    /// How far along the yarn it is.
    pub(super) travel: f32,
    /// As the section's, in the place's axes.
    pub(super) bend: Vec2,
    pub(super) phase: Vec2,
    pub(super) turn: f32,
    pub(super) pressed: Option<Pressed>,
    pub(super) pressed_turn: f32,
    /// How fast a way turns in the unwound yarn, radians per yarn radius along the yarn.
    pub(super) turning: f32,
    /// The inverse of how far along the yarn its bend bows a way by [`MOST_BOW`].
    pub(super) bowing: f32,
}

/// A place of the yarn in a section's frame.
#[derive(Clone, Copy)]
pub(super) struct Placed {
    pub(super) origin: Vec3A,
    pub(super) x: Vec3A,
    pub(super) y: Vec3A,
    pub(super) z: Vec3A,
    /// The section's yarn radius over the one there.
    pub(super) scale: f32,
}

impl Placed {
    #[inline]
    pub(super) fn local(&self, v: Vec3A) -> Vec3A {
        self.scale * Vec3A::new(v.dot(self.x), v.dot(self.y), v.dot(self.z))
    }

    /// A vector of its axes in the section's frame.
    #[inline]
    pub(super) fn out(&self, v: Vec3A) -> Vec3A {
        v.x * self.x + v.y * self.y + v.z * self.z
    }
}

/// The yarn near its place as a circle: a point and a direction of the section's frame, unbent.
pub(super) struct Unbent {
    /// In the section, and its change along the direction.
    pub(super) at: Vec2,
    pub(super) slope: Vec2,
    /// Along the axis, and its change along the direction.
    pub(super) travel: f32,
    pub(super) advance: f32,
    pub(super) straightness: f32,
    /// By how much z of the point moves for each unit of `straightness`: sine of the yarn's turn over its curvature.
    pub(super) lean: f32,
    /// Cosine of the yarn's turn.
    pub(super) cos: f32,
}

impl Neighbourhood {
    /// With how fast it turns and bows ways. A bend turns them as well.
    #[inline]
    pub(super) fn rated(mut self, reach: Reach) -> Self {
        let bend = self.bend.length();
        self.turning = self.turn.abs() + reach.bend * bend + self.pressed_turn.abs();
        self.bowing = (bend * (0.125 / MOST_BOW)).sqrt();
        self
    }

    /// The station of a point in the section of the place itself.
    #[inline]
    pub(super) fn enter(&self, point: Vec3A, direction: Vec3A) -> Step {
        let at = point.truncate();
        let straightness = (1.0 - self.bend.dot(at)).max(LEAST_STRAIGHTNESS);
        let advance = direction.z / straightness;
        let unbent =
            Unbent { at, slope: direction.truncate(), travel: 0.0, advance, straightness, lean: 0.0, cos: 1.0 };
        self.unwind(&unbent, 0.0)
    }

    /// A point and a direction of the section's frame on the unbent yarn. `travel` is from this place.
    #[inline]
    pub(super) fn unbend(&self, point: Vec3A, direction: Vec3A) -> Unbent {
        let (point, direction) = match &self.place {
            None => (point, direction),
            Some(place) => (place.local(point - place.origin), place.local(direction)),
        };
        let (p, v) = (point.truncate(), direction.truncate());
        // In units of the bend's radius the point is at (ahead, k z) from the bend's centre; k stays in products that are
        // finite for a straight yarn.
        let bend = self.bend;
        let square = bend.length_squared();
        let ahead = (1.0 - bend.dot(p)).max(LEAST_STRAIGHTNESS);
        let z = point.z;
        let straightness = (ahead * ahead + square * z * z).sqrt();
        let half = z / (ahead + straightness);
        // atan x / x of half the angle, to 1 % at a right angle.
        let tan_squared = square * half * half;
        let travel = 2.0 * half * (15.0 + 4.0 * tan_squared) / (15.0 + 9.0 * tan_squared);
        let fall = bend.dot(v);
        let inverse = 1.0 / straightness;
        Unbent {
            at: p - bend * (z * half),
            slope: v - bend * ((fall * half + direction.z) * z * inverse),
            travel,
            advance: (ahead * direction.z + z * fall) * inverse * inverse,
            straightness,
            lean: z * inverse,
            cos: ahead * inverse,
        }
    }

    /// The point of the section's frame that is `at` in the yarn's section, so far along the yarn from this place: what [`Self::unbend`] has
    /// back.
    #[inline]
    pub(super) fn bent(&self, at: Vec2, travel: f32) -> Vec3A {
        let bend = self.bend;
        let k = bend.length();
        let (sin, cos) = sin_cos(k * travel);
        // sin / k and (1 - cos) / k^2, which are finite for a straight yarn.
        let (along, fall) =
            if k * travel.abs() > 1e-2 { (sin / k, (1.0 - cos) / (k * k)) } else { (travel, 0.5 * travel * travel) };
        let nearer = 1.0 - bend.dot(at);
        let point = (at + bend * (nearer * fall)).extend(nearer * along).into();
        self.place.map_or(point, |place| place.origin + place.out(point) / place.scale)
    }

    /// (cos, sin) of the plies' phase so far along from this place.
    #[inline]
    pub(super) fn phase_at(&self, travel: f32) -> Vec2 {
        let turned = self.turn * travel;
        if turned == 0.0 { self.phase } else { self.phase.rotate(angle(turned)) }
    }

    /// How the section is pressed so far along.
    #[inline]
    pub(super) fn pressed_at(&self, travel: f32) -> Option<Pressed> {
        let pressed = self.pressed?;
        let turned = self.pressed_turn * travel;
        Some(if turned == 0.0 { pressed } else { Pressed { axis: pressed.axis.rotate(angle(turned)), ..pressed } })
    }

    /// The station of an unbent point: pressed round and turned back with the plies.
    #[inline]
    pub(super) fn unwind(&self, unbent: &Unbent, depth: f32) -> Step {
        let &Unbent { at: real, slope: real_slope, travel, advance, straightness, .. } = unbent;
        let (round, round_slope) = match self.pressed_at(travel) {
            None => (real, real_slope),
            Some(pressed) => {
                let round = pressed.round(real);
                // B' = phi' (J B - B J) for the map B that makes round what is pressed along an axis at the angle phi.
                let turned = self.pressed_turn * (round.perp() - pressed.round(real.perp()));
                (round, pressed.round(real_slope) + advance * turned)
            }
        };
        let phase = self.phase_at(travel);
        let at = unrotate(round, phase);
        let slope = unrotate(round_slope - self.turn * advance * round.perp(), phase);
        let station = Station { depth, at, slope, travel: self.travel + travel, advance, straightness };
        Step { station, real, real_slope }
    }
}
