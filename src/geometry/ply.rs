//! A ply: its place in the yarn's cross-section, how many fibres it holds, and how they turn.
//!
//! All lengths are in units of the yarn's outer radius.

use glam::{Vec2, Vec3A};

use super::{after_fiber::AfterFiber, first_fiber::FirstFiber};

/// One ply as a person describes it. Lengths in yarn radii, angles in radians.
#[derive(Clone, Debug, PartialEq)]
pub struct PlyParameters {
    /// Geometric mean of the semi-axes of the ply's cross-section.
    pub radius: f64,
    /// Short over long semi-axis; the short one lies along the line to the yarn's axis. 1 for a round ply.
    pub aspect: f64,
    /// Distance of the ply's centre from the yarn's axis.
    pub distance: f64,
    /// Where the ply starts around the yarn.
    pub angle: f64,
    /// Number of fibres.
    pub fibers: u32,
    /// Radius of a fibre.
    pub fiber_radius: f64,
    /// Angle of the outermost fibres against the ply's axis; negative turns the other way.
    pub fiber_twist: f64,
}

impl PlyParameters {
    /// Whether it holds fibres, and all its numbers are finite and in their range.
    pub fn is_sound(&self) -> bool {
        let Self { radius, aspect, distance, angle, fibers, fiber_radius, fiber_twist } = *self;
        let positive = |v: f64| v > 0.0 && v.is_finite();
        let finite = distance.is_finite() && angle.is_finite() && fiber_twist.is_finite();
        fibers > 0 && positive(radius) && positive(fiber_radius) && positive(aspect) && aspect <= 1.0 && finite
    }

    /// The longer semi-axis of the cross-section.
    pub fn long_axis(&self) -> f64 {
        self.radius / self.aspect.sqrt()
    }

    /// The shorter semi-axis of the cross-section, which lies along the line to the yarn's axis.
    pub fn short_axis(&self) -> f64 {
        self.radius * self.aspect.sqrt()
    }

    /// How far it reaches from the yarn's axis: the shoulders of an ellipse stand out beyond the middle of its outer side.
    pub fn reach(&self) -> f64 {
        let (short, long) = (self.short_axis(), self.long_axis());
        let (along, across) = (short * short, long * long);
        // Where the outline is farthest, as the cosine of its parameter: at the middle unless the ellipse is flat enough.
        let cos = (self.distance * short / (across - along).max(1e-12)).min(1.0);
        let sin2 = 1.0 - cos * cos;
        (self.distance + short * cos).hypot(long * sin2.sqrt())
    }

    /// The same ply with its lengths in another unit, which is so many of the old ones.
    pub fn in_units_of(&self, unit: f64) -> Self {
        Self {
            radius: self.radius / unit,
            distance: self.distance / unit,
            fiber_radius: self.fiber_radius / unit,
            ..self.clone()
        }
    }

    /// The same ply as the only one of a yarn that is as wide as it: lengths in units of its longer semi-axis.
    pub fn alone(&self) -> Self {
        Self { distance: 0.0, angle: 0.0, ..self.in_units_of(self.long_axis()) }
    }
}

/// A ply made ready for rays.
#[derive(Clone, Debug)]
pub struct PlyShape {
    /// Distance of the centre from the yarn's axis.
    pub distance: f32,
    /// Unit vector towards the centre when the yarn's phase is 0.
    pub direction: Vec2,
    /// Radius of the circle that the ply's section becomes when its axes are made equal without changing its area.
    pub radius: f32,
    /// `radius` over the semi-axis along the line to the yarn's axis, and over the one across it: (1, 1) if round.
    pub stretch: Vec2,
    /// Radius of a fibre.
    pub fiber_radius: f32,
    /// Radius within which the fibres' centres lie: `radius - fiber_radius`.
    pub core_radius: f32,
    /// Number of fibres.
    pub fibers: f32,
    /// Turns of the fibre pattern around the ply's axis, radians per yarn radius along the yarn.
    pub fiber_rate: f32,
    /// How much fibres crowd at the wall, or with a minus sign at the axis: see [`super::density`].
    pub crowding: f32,
    /// How deep below the wall: [`super::density::PlyPacking::depth`].
    pub depth: f32,
    /// How regularly a line meets fibres: [`super::density::PlyPacking::regularity`].
    pub regularity: f32,
    /// The same by the rim: [`super::density::PlyPacking::rim`].
    pub rim: f32,
    /// How deep the first fibre on a line lies: [`super::density::PlyPacking::first`].
    pub first: Option<FirstFiber>,
    /// What is free of others after a fibre: [`super::density::PlyPacking::after`].
    pub after: Option<AfterFiber>,
}

impl PlyShape {
    /// A ply whose fibres lie evenly.
    pub(super) fn new(ply: &PlyParameters) -> Self {
        let root = ply.aspect.sqrt();
        let fiber_radius = ply.fiber_radius.min(0.999 * ply.radius);
        Self {
            distance: ply.distance as f32,
            direction: Vec2::new(ply.angle.cos() as f32, ply.angle.sin() as f32),
            radius: ply.radius as f32,
            stretch: Vec2::new((1.0 / root) as f32, root as f32),
            fiber_radius: fiber_radius as f32,
            core_radius: (ply.radius - fiber_radius) as f32,
            fibers: ply.fibers as f32,
            fiber_rate: (ply.fiber_twist.tan() / ply.radius) as f32,
            crowding: 0.0,
            depth: 0.0,
            regularity: 1.0,
            rim: 1.0,
            first: None,
            after: None,
        }
    }

    /// A point of the unwound yarn's section from the ply's axis, in the circle of [`Self::radius`] that the ply's section becomes when its axes
    /// are made equal.
    #[inline]
    pub(super) fn in_circle(&self, at: Vec2) -> Vec2 {
        self.as_in_circle(at - self.distance * self.direction)
    }

    /// A vector of the unwound yarn's section in that circle.
    #[inline]
    pub(super) fn as_in_circle(&self, v: Vec2) -> Vec2 {
        self.stretched(v, self.stretch)
    }

    /// A vector of that circle in the unwound yarn's section.
    #[inline]
    pub(super) fn as_in_section(&self, v: Vec2) -> Vec2 {
        self.stretched(v, self.stretch.recip())
    }

    #[inline]
    fn stretched(&self, v: Vec2, by: Vec2) -> Vec2 {
        if !self.is_elliptical() {
            return v;
        }
        let (along, across) = (v.dot(self.direction), self.direction.perp_dot(v));
        by.x * along * self.direction + by.y * across * self.direction.perp()
    }

    /// Whether its section is not a circle.
    #[inline]
    pub fn is_elliptical(&self) -> bool {
        self.stretch.x != 1.0
    }

    /// Long over short axis of its section in a yarn that is pressed to axes of `pressed` : 1: the mean over all turns of the ply, of half
    /// the trace of what the square of the circle becomes, (s + 1/s) / 2 for each.
    pub(crate) fn stretch_of_both(&self, pressed: f64) -> f64 {
        stretch_of_both(pressed, f64::from(self.stretch.x / self.stretch.y))
    }

    /// The same in radii of the circle within which the centres of its fibres lie.
    #[inline]
    pub(super) fn in_core(&self, at: Vec2) -> Vec2 {
        self.in_circle(at) / self.core_radius
    }
}

/// Long over short axis of a circle that is pressed twice, to axes of `a` : 1 and `b` : 1: as [`PlyShape::stretch_of_both`].
pub(super) fn stretch_of_both(a: f64, b: f64) -> f64 {
    if b == 1.0 {
        return a;
    }
    let half_trace = 0.25 * (a + a.recip()) * (b + b.recip());
    half_trace + (half_trace * half_trace - 1.0).max(0.0).sqrt()
}

/// The tangent of a fibre, not of unit length (its z, along the yarn, is 1): a fibre at `at` in a ply with centre
/// `centre`, both in the section of the yarn. `axis` is the unit vector from the yarn's axis to the ply.
#[inline]
pub fn fiber_tangent(ply: &PlyShape, ply_rate: f32, centre: Vec2, axis: Vec2, at: Vec2) -> Vec3A {
    let p = at - centre;
    if ply.stretch.x == 1.0 {
        // Both rotations act on the same circle: the fibre's rate is the total one.
        let (w, f) = (ply_rate, ply.fiber_rate);
        return Vec3A::new(-(w * centre.y + f * p.y), w * centre.x + f * p.x, 1.0);
    }
    // The ellipse turns with the ply; within it fibres turn at the rest of their rate, as on a stretched circle.
    let own = ply.fiber_rate - ply_rate;
    let q = Vec2::new(p.dot(axis) * ply.stretch.x, p.perp_dot(axis) * -ply.stretch.y);
    let turn = Vec2::new(-q.y / ply.stretch.x, q.x / ply.stretch.y) * own;
    let local = turn.x * axis + turn.y * axis.perp();
    Vec3A::new(-ply_rate * at.y + local.x, ply_rate * at.x + local.y, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::yarn::tests::touching_yarn;

    #[test]
    fn plies_reach_as_far_as_the_farthest_point_of_their_outline() {
        for (aspect, distance) in [(1.0, 0.5), (0.9, 0.5), (0.67, 0.42), (0.4, 0.3), (0.7, 0.0), (1.0, 0.0), (1.4, 0.2)]
        {
            let ply = PlyParameters {
                radius: 0.5,
                aspect,
                distance,
                angle: 1.0,
                fibers: 10,
                fiber_radius: 0.01,
                fiber_twist: 0.0,
            };
            let (short, long) = (ply.short_axis(), ply.long_axis());
            let at = |k: u32| {
                let (sin, cos) = (1e-3 * f64::from(k)).sin_cos();
                (distance + short * cos).hypot(long * sin)
            };
            let farthest = (0..6284).map(at).fold(0.0, f64::max);
            assert!((ply.reach() - farthest).abs() < 1e-6, "{aspect} {distance}: {} {farthest}", ply.reach());
            let halved = ply.in_units_of(2.0);
            assert!((halved.reach() - 0.5 * farthest).abs() < 1e-6 && halved.fiber_radius == 0.005);
        }
    }

    #[test]
    fn elliptical_tangents_reduce_to_round_ones() {
        let round = touching_yarn(3, 50, 0.4, 0.3, -0.5);
        let mut ellipse = round.plies[0].clone();
        ellipse.stretch = Vec2::new(1.0 + 1e-6, 1.0 - 1e-6);
        let (centre, axis) = (Vec2::new(0.3, 0.44), Vec2::new(0.3, 0.44).normalize());
        let at = Vec2::new(0.41, 0.2);
        let a = fiber_tangent(&round.plies[0], round.ply_rate, centre, axis, at);
        let b = fiber_tangent(&ellipse, round.ply_rate, centre, axis, at);
        assert!((a - b).length() < 1e-5, "{a} {b}");
    }
}
