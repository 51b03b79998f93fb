//! How far and how finely ways through a yarn are followed, and a step of one.

use glam::Vec2;

use crate::{
    geometry::way::{MOST_TURN, Station},
    math::frame::sin_cos,
};

/// How far and how finely a way is followed.
#[derive(Clone, Copy)]
pub(super) struct Reach {
    /// How far along the yarn it is taken for its circle of curvature, in yarn radii; beyond it is looked up anew.
    pub(super) near: f32,
    /// By how much the yarn may turn in that, radians: a sharp bend is over soon.
    pub(super) sharp: f32,
    /// How often it is looked up for one point: where it bends otherwise on the way there, a look-up falls short.
    pub(super) looks: usize,
    /// The longest way, in yarn radii.
    pub(super) longest: f32,
    /// The most by which plies turn from station to station, radians.
    pub(super) turn: f32,
    /// How much a bend counts as a turn.
    pub(super) bend: f32,
}

impl Reach {
    /// How far along the yarn from a place with that bend it is taken for its circle of curvature.
    #[inline]
    pub(super) fn near(&self, bend: Vec2) -> f32 {
        self.near.min(self.sharp / bend.length().max(1e-6))
    }
}

/// A ray that looks: off by less than 0.02 yarn radii.
pub(super) const LOOK: Reach = Reach { near: 0.5, sharp: 0.3, looks: 1, longest: 16.0, turn: MOST_TURN, bend: 1.0 };
/// The same into a pressed yarn, whose bends change within a radius where a weave's dives.
pub(super) const LOOK_INTO_PRESSED: Reach = Reach { sharp: 0.15, looks: 2, ..LOOK };
/// A ray that gathers light.
pub(super) const GATHER: Reach =
    Reach { near: 1.0, sharp: 0.3, looks: 1, longest: 16.0, turn: 1.6 * MOST_TURN, bend: 0.5 };
/// Light that leaves from inside: how far it still has to go is felt in all, and a weave's bend turns round within a radius or two.
pub(super) const LIGHT: Reach =
    Reach { near: 0.5, sharp: 0.3, looks: 1, longest: 16.0, turn: 2.0 * MOST_TURN, bend: 0.5 };
/// What may be left of a way without another station, in yarn radii.
pub(super) const LEAST_LEFT: f32 = 1e-3;

/// A station with what only the making of a way needs: the place in the yarn's real section, and its change with depth.
#[derive(Clone, Copy)]
pub(super) struct Step {
    pub(super) station: Station,
    pub(super) real: Vec2,
    pub(super) real_slope: Vec2,
}

/// (cos, sin) of an angle.
#[inline]
pub(super) fn angle(by: f32) -> Vec2 {
    let (sin, cos) = sin_cos(by);
    Vec2::new(cos, sin)
}
