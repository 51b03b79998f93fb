//! A point inside a yarn, and the short way out from there for light that leaves.

use glam::{Vec2, Vec3A};

use super::{
    Section,
    bowed::Bowed,
    neighbourhood::{Neighbourhood, Unbent},
    reach::{LEAST_LEFT, LIGHT, angle},
    unrotate,
};
use crate::geometry::{ply::fiber_tangent, way::Station, yarn::YarnShape, yarn_frame::Pressed};

/// A point inside a yarn, seen in the unwound yarn, and the way back from there.
#[derive(Clone, Copy, Debug)]
pub struct Inside {
    /// In the section's frame.
    pub point: Vec3A,
    /// About how far along the yarn.
    pub(super) travel: f32,
    /// In the section of the unwound yarn.
    pub(super) at: Vec2,
    /// The axes of that section, which turn with the plies, in the section's frame.
    pub(super) x: Vec3A,
    pub(super) y: Vec3A,
    /// The axis along the yarn.
    pub(super) z: Vec3A,
    /// How the section is pressed flat, against these axes.
    pub(super) pressed: Option<Pressed>,
    pub(super) straightness: f32,
    /// The yarn's curvature along x and y, 1/yarn radii.
    pub(super) bend: Vec2,
    /// Turns of the plies, radians per yarn radius.
    pub(super) turn: f32,
}

impl Inside {
    /// A vector of the yarn's axes there in the section's frame.
    #[inline]
    pub(super) fn out(&self, v: Vec3A) -> Vec3A {
        v.x * self.x + v.y * self.y + v.z * self.z
    }

    /// The point in a ply, from its axis, in radii of the circle within which the centres of its fibres lie; where the yarn is
    /// pressed flat, in the round section. Axes are those of the unwound yarn.
    #[inline]
    pub fn in_ply(&self, shape: &YarnShape, ply: usize) -> Vec2 {
        shape.plies[ply].in_core(self.at)
    }

    /// The same of a point that is a little off this one, by a vector of the section's frame.
    #[inline]
    pub fn beside_in_ply(&self, shape: &YarnShape, ply: usize, off: Vec3A) -> Vec2 {
        let off = self.across(off);
        shape.plies[ply].in_core(self.at + self.pressed.map_or(off, |pressed| pressed.round(off)))
    }

    /// The point of a ply's axis abreast of this one, in the section's frame.
    #[inline]
    pub fn axis_of(&self, shape: &YarnShape, ply: usize) -> Vec3A {
        let off = shape.plies[ply].distance * shape.plies[ply].direction - self.at;
        self.point + self.out_of(self.pressed.map_or(off, |pressed| pressed.real(off)))
    }

    /// The direction from a ply's axis, in the axes of [`Self::in_ply`], about which its rim is seen from the direction `w` of the section's frame:
    /// by the cosine.
    #[inline]
    pub fn facing(&self, shape: &YarnShape, ply: usize, w: Vec3A) -> Vec2 {
        self.as_in_circle(shape, ply, self.across(w)).normalize_or(Vec2::X)
    }

    /// A vector across the yarn there, in its unwound axes, in the circle that a ply's section becomes when its axes are made equal.
    #[inline]
    fn as_in_circle(&self, shape: &YarnShape, ply: usize, v: Vec2) -> Vec2 {
        shape.plies[ply].as_in_circle(self.pressed.map_or(v, |pressed| pressed.round(v)))
    }

    /// The other way.
    #[inline]
    fn as_in_section(&self, shape: &YarnShape, ply: usize, v: Vec2) -> Vec2 {
        let round = shape.plies[ply].as_in_section(v);
        self.pressed.map_or(round, |pressed| pressed.real(round))
    }

    /// The point of a ply's outline abreast of this one, by its direction from the ply's axis in the axes of [`Self::in_ply`], in the section's
    /// frame.
    #[inline]
    pub fn outline(&self, shape: &YarnShape, ply: usize, direction: Vec2) -> Vec3A {
        let off = self.as_in_section(shape, ply, shape.plies[ply].radius * direction);
        self.axis_of(shape, ply) + self.out_of(off)
    }

    /// The same so far along the yarn from there, in yarn radii: on the outline's part that has the same place in the frame of
    /// `section`, while the ply winds.
    #[inline]
    pub fn outline_along(
        &self,
        shape: &YarnShape,
        section: &Section<'_>,
        ply: usize,
        direction: Vec2,
        travel: f32,
    ) -> Vec3A {
        let of = &shape.plies[ply];
        let mut off = unrotate(of.as_in_section(direction), angle(self.turn * travel));
        if of.is_elliptical() {
            off = of.as_in_section(of.as_in_circle(off).normalize_or(Vec2::X));
        }
        section.point_at(shape, of.distance * of.direction + of.radius * off, self.travel + travel)
    }

    /// The short axis of a ply's section there, as a unit vector in its circle and one across the unwound yarn; any where it is a circle.
    #[inline]
    pub fn short_axis(&self, shape: &YarnShape, ply: usize) -> [Vec2; 2] {
        let of = &shape.plies[ply];
        match self.pressed {
            _ if of.is_elliptical() => {
                // Of the map from the circle to the section, the direction that it shortens most.
                let [x, y] = [Vec2::X, Vec2::Y].map(|axis| self.as_in_section(shape, ply, axis));
                let long = 0.5 * (2.0 * x.dot(y)).atan2(x.length_squared() - y.length_squared());
                let short = Vec2::from_angle(long).perp();
                [short, (short.x * x + short.y * y).normalize_or(short)]
            }
            Some(pressed) => [pressed.axis; 2],
            None => [Vec2::X; 2],
        }
    }

    /// How much a direction of the section's frame is along the short axis of a ply's section there: the square of a cosine, and a half where
    /// that is a circle.
    #[inline]
    pub fn along_short_axis(&self, shape: &YarnShape, ply: usize, w: Vec3A) -> f32 {
        if self.pressed.is_none() && !shape.plies[ply].is_elliptical() {
            return 0.5;
        }
        let [_, short] = self.short_axis(shape, ply);
        let across = self.across(w);
        across.dot(short).powi(2) / across.length_squared().max(1e-12)
    }

    /// A vector across the unwound yarn in the section's frame.
    #[inline]
    pub fn out_of(&self, v: Vec2) -> Vec3A {
        v.x * self.x + v.y * self.y
    }

    /// How much of a vector of the section's frame is along the yarn there.
    #[inline]
    pub fn along(&self, v: Vec3A) -> f32 {
        v.dot(self.z)
    }

    /// A vector of the section's frame across the yarn there.
    #[inline]
    pub(super) fn across(&self, v: Vec3A) -> Vec2 {
        Vec2::new(v.dot(self.x), v.dot(self.y))
    }

    /// How thick fibres are across a line in the direction `w` of the section's frame, over their radius, in the circle that a
    /// pressed section was.
    #[inline]
    pub fn wide(&self, w: Vec3A) -> f32 {
        self.pressed.map_or(1.0, |pressed| {
            let across = self.across(w);
            pressed.stretch.sqrt() * across.length() / pressed.round(across).length().max(1e-12)
        })
    }

    /// The tangent of a fibre of a ply there, in the section's frame: its part along the yarn is 1.
    #[inline]
    pub fn fiber_tangent(&self, shape: &YarnShape, section: &Section<'_>, ply: usize) -> Vec3A {
        self.tangent_at(shape, section, ply, self.at)
    }

    /// The same of one so far beside a ray that comes from `w`, in the circle of the ply's radius.
    #[inline]
    pub fn fiber_tangent_beside(
        &self,
        shape: &YarnShape,
        section: &Section<'_>,
        ply: usize,
        w: Vec3A,
        beside: f32,
    ) -> Vec3A {
        let off = shape.plies[ply].as_in_section(beside * self.facing(shape, ply, w).perp());
        self.tangent_at(shape, section, ply, self.at + off)
    }

    /// The same at another point of the unwound yarn's section.
    #[inline]
    pub(super) fn tangent_at(&self, shape: &YarnShape, section: &Section<'_>, ply: usize, at: Vec2) -> Vec3A {
        let of = &shape.plies[ply];
        let t = fiber_tangent(of, shape.ply_rate, of.distance * of.direction, of.direction, at);
        let across = section.real_slope(self.pressed, at, t.truncate()) / self.straightness;
        self.out(across.extend(1.0).into())
    }

    /// The two stations of a way out from `shift` beside this point in a direction `w` of the section's frame: `None` unless it
    /// turns and bends little, and stays near enough for the bend to be that of this place.
    #[inline]
    pub(super) fn way_out(&self, section: &Section<'_>, shift: Vec3A, w: Vec3A) -> Option<[Station; 2]> {
        let real = self.pressed.map_or(self.at, |pressed| pressed.real(self.at));
        let advance = w.dot(self.z) / self.straightness;
        let straightness = self.straightness;
        let from =
            Bowed { at: real + self.across(shift), slope: self.across(w), advance, straightness, bend: self.bend };
        let depth = from.to_surface();
        let to = from.ahead(depth)?;
        let turning = self.turn.abs() + if self.pressed.is_some() { section.pressed_turn.abs() } else { 0.0 };
        let turned = turning * to.travel;
        let is_near = section.walker.is_none() || to.travel.abs() <= LIGHT.near(self.bend);
        if !turned.is_finite() || turned.abs() > LIGHT.turn || depth <= LEAST_LEFT || !is_near {
            return None;
        }
        let start = Unbent { at: from.at, slope: from.slope, travel: 0.0, advance, straightness, lean: 0.0, cos: 1.0 };
        let end = Unbent { straightness, ..to };
        let about = Neighbourhood {
            place: None,
            travel: self.travel,
            bend: self.bend,
            phase: Vec2::X,
            turn: self.turn,
            pressed: self.pressed,
            pressed_turn: section.pressed_turn,
            turning: 0.0,
            bowing: 0.0,
        };
        Some([about.unwind(&start, 0.0).station, about.unwind(&end, depth).station])
    }
}
