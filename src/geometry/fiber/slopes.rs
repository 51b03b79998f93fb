//! How fibres lean against the section that they are packed in.
//!
//! The section cuts a fibre that turns around its ply in an ellipse, longer along the turn by the secant of its tilt. Two fibres
//! that lie as far apart as they are thick may therefore be nearer than that in the section if one lies beside the other, and must
//! be farther apart if one runs after the other.

use glam::{DMat2, DVec2};

use crate::geometry::ply::PlyShape;

/// Area fraction (of fibres in the ply) up to which [`hard_discs`](super::packing::hard_discs) finds packings without overlap for any number.
pub const DENSEST: f64 = 0.78;

/// How the fibres of a ply lean against its axis, and the ply against the yarn's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist {
    /// Slope of a fibre at the ply's radius: the tangent of its tilt.
    pub fibers: f64,
    /// Slope of the ply's axis.
    pub plies: f64,
}

/// How far fibres run sideways for each unit along the yarn, by where they are in a section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Slopes {
    /// Of a fibre in the ply's middle.
    pub middle: DVec2,
    /// How it changes with the place.
    pub linear: DMat2,
    /// Mean square along each axis of a slope that is alike in all directions, because the section turns against it.
    pub even: f64,
}

impl Twist {
    /// Of fibres that run straight along the yarn.
    pub const NONE: Self = Self { fibers: 0.0, plies: 0.0 };

    /// Of a ply in a yarn whose plies turn by `ply_rate`, radians per yarn radius.
    pub fn of(ply: &PlyShape, ply_rate: f32) -> Self {
        Self { fibers: f64::from(ply.fiber_rate * ply.radius), plies: f64::from(ply_rate * ply.distance) }
    }

    /// How much of the slopes there is room for: with all of it, `count` ellipses of fibres with a radius of `fiber` in ply radii
    /// may fill more of the section than can be packed.
    pub(super) fn room(self, count: u32, fiber: f64) -> f64 {
        const STEPS: u32 = 30;
        let circles = f64::from(count) * fiber * fiber;
        let fits = |share: f64| circles * self.scaled(share).in_core(fiber).mean_secant() <= DENSEST;
        if fits(1.0) {
            return 1.0;
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..STEPS {
            let share = 0.5 * (low + high);
            (low, high) = if fits(share) { (share, high) } else { (low, share) };
        }
        low
    }

    /// With so much of its slopes.
    pub(super) fn scaled(self, share: f64) -> Self {
        Self { fibers: share * self.fibers, plies: share * self.plies }
    }

    /// Slopes at places in core radii of a round section that is turned against the ply in all directions; `fiber` is a fibre's
    /// radius over the ply's.
    pub(super) fn in_core(self, fiber: f64) -> Slopes {
        let turn = DMat2::from_cols(DVec2::Y, DVec2::NEG_X);
        let even = 0.5 * self.plies * self.plies;
        Slopes { middle: DVec2::ZERO, linear: self.fibers * (1.0 - fiber).max(0.0) * turn, even }
    }

    /// The same as if all sides of the ply were that on the yarn's outside, where light meets it. There the slope of the ply adds to that of its
    /// fibres; it is all that they have in the ply's middle.
    pub(super) fn outside(self, fiber: f64) -> Slopes {
        let in_core = self.fibers * (1.0 - fiber).max(0.0);
        Self { fibers: in_core + self.plies, plies: 0.0 }.in_core(0.0)
    }
}

impl Slopes {
    /// Of fibres that run straight along the yarn.
    #[cfg(test)]
    pub(super) const NONE: Self = Self { middle: DVec2::ZERO, linear: DMat2::ZERO, even: 0.0 };

    /// With so much of them.
    pub(super) fn scaled(&self, share: f64) -> Self {
        Self { middle: share * self.middle, linear: share * self.linear, even: share * share * self.even }
    }

    #[inline]
    fn at(&self, place: DVec2) -> DVec2 {
        self.middle + self.linear * place
    }

    /// The squared distance between the axes of two fibres at places `a` and `b`, as both run half way between them.
    #[inline]
    pub(super) fn distance_squared(&self, a: DVec2, b: DVec2) -> f64 {
        let (between, slope) = (b - a, self.at(0.5 * (a + b)));
        let (square, along) = (between.length_squared(), between.dot(slope));
        let steep = 1.0 + slope.length_squared() + 2.0 * self.even;
        square - (along * along + self.even * square) / steep
    }

    /// Half the width across a line that a fibre at a place has in the section, over its radius. `across` is of unit length.
    #[inline]
    pub(super) fn half_width(&self, place: DVec2, across: DVec2) -> f64 {
        (1.0 + self.even + self.at(place).dot(across).powi(2)).sqrt()
    }

    /// In axes that are turned by the angle of (cos, sin).
    pub(super) fn turned_back(&self, axes: DVec2) -> Self {
        let (turn, back) = (DMat2::from_cols(axes, axes.perp()), DMat2::from_cols(axes, axes.perp()).transpose());
        Self { middle: back * self.middle, linear: back * self.linear * turn, even: self.even }
    }

    /// Of places in core radii, for those in ply radii; `fiber` is a fibre's radius over the ply's.
    pub(super) fn per_ply_radius(self, fiber: f64) -> Self {
        Self { linear: self.linear / (1.0 - fiber), ..self }
    }

    /// How much longer than wide a fibre's ellipse may be, at most, at places within `reach` of the middle.
    pub(super) fn longest(&self, reach: f64) -> f64 {
        let columns = self.linear.x_axis.length_squared() + self.linear.y_axis.length_squared();
        let slope = self.middle.length() + columns.sqrt() * reach;
        (1.0 + slope * slope + 2.0 * self.even).sqrt()
    }

    /// The mean area of a fibre's ellipse, over its circle's, at places within 1 of the middle.
    fn mean_secant(&self) -> f64 {
        const RINGS: u32 = 16;
        let secant = |ring: u32| {
            let at = DVec2::new(((f64::from(ring) + 0.5) / f64::from(RINGS)).sqrt(), 0.0);
            (1.0 + self.at(at).length_squared() + 2.0 * self.even).sqrt()
        };
        (0..RINGS).map(secant).sum::<f64>() / f64::from(RINGS)
    }
}
