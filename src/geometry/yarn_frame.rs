//! A place on a yarn's axis with all that is known there: the frame across the yarn, how it bends, how its plies lie.

use glam::{Vec2, Vec3A};

/// A place on a yarn's axis.
#[derive(Clone, Copy, Debug)]
pub struct YarnFrame {
    /// The yarn's centre.
    pub centre: Vec3A,
    /// Unit tangent of the yarn.
    pub tangent: Vec3A,
    /// Curvature vector: second derivative by arc length, 1/length.
    pub curvature: Vec3A,
    /// Outer radius of the yarn.
    pub radius: f32,
    /// Unit vector across the yarn that does not turn with the plies (rotation-minimising along the yarn).
    pub normal: Vec3A,
    /// Angle of the plies about the tangent, from `normal`, radians.
    pub phase: f32,
    /// How that angle grows along the yarn, radians per yarn radius; `None` where it does as the yarn's shape says.
    pub turn: Option<f32>,
    /// Length of the segment that this place is on, in yarn radii, as far as its speed here tells.
    pub stride: f32,
    /// Along the short axis of the section in the frame of `normal` and `tangent x normal`, as long as the ratio of the
    /// short axis to the long one: [`ROUND`], or any other vector of length 1, where the yarn is not pressed flat.
    pub flattening: Vec2,
    /// By how much that axis turns in the frame along the yarn, radians per yarn radius.
    pub flattening_turn: f32,
    /// How the section changes along the yarn.
    pub growth: SectionGrowth,
}

/// How a section changes along the yarn, for each yarn radius: its fibres go with it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SectionGrowth {
    /// Of the long axis, over it.
    pub widening: f32,
    /// Of the ratio of the short axis to the long one.
    pub thickening: f32,
}

/// [`YarnFrame::flattening`] of a round yarn.
pub const ROUND: Vec2 = Vec2::X;
/// A section whose axes differ by less is round.
pub(super) const NEARLY_ROUND: f32 = 0.9999;

impl YarnFrame {
    /// The point of the world at `at` of the round section that this one was pressed from, in yarn radii along `normal`
    /// and `tangent x normal`.
    pub fn point(&self, at: Vec2) -> Vec3A {
        let at = Pressed::new(self.flattening).map_or(at, |pressed| pressed.real(at));
        let across = self.tangent.cross(self.normal);
        self.centre + self.radius * (at.x * self.normal + at.y * across)
    }

    /// From the yarn's axis to a point, across the yarn.
    #[inline]
    pub fn beside(&self, point: Vec3A) -> Vec3A {
        let off = point - self.centre;
        off - off.dot(self.tangent) * self.tangent
    }

    /// Radius of the circle that has the section's area: fibres stay as thick when a yarn is pressed flat.
    pub fn round_radius(&self) -> f32 {
        Pressed::new(self.flattening).map_or(self.radius, |pressed| self.radius / pressed.stretch.sqrt())
    }
}

/// How a section is pressed flat: an affine map that takes circles to ellipses, and with them the plies inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pressed {
    /// Unit vector along the short axis.
    pub axis: Vec2,
    /// Long over short axis, above 1.
    pub stretch: f32,
}

impl Pressed {
    /// From [`YarnFrame::flattening`]; `None` where the section is round.
    #[inline]
    pub fn new(flattening: Vec2) -> Option<Self> {
        let ratio = flattening.length();
        (ratio < NEARLY_ROUND).then(|| Self { axis: flattening / ratio, stretch: 1.0 / ratio })
    }

    /// A point or a vector of the pressed section in the round one.
    #[inline]
    pub fn round(&self, p: Vec2) -> Vec2 {
        p + (self.stretch - 1.0) * p.dot(self.axis) * self.axis
    }

    /// A point or a vector of the round section in the pressed one.
    #[inline]
    pub fn real(&self, p: Vec2) -> Vec2 {
        p + (1.0 / self.stretch - 1.0) * p.dot(self.axis) * self.axis
    }
}
