//! What a yarn is made of: plies in its cross-section, how they turn, how many fibres each holds.
//!
//! All lengths are in units of the yarn's outer radius, so that one shape serves a yarn of any and of varying radius.

use std::f64::consts::{PI, TAU};

use glam::{Vec2, Vec3A};

use super::{after_fiber::AfterFiber, density::PlyPacking, way::FourPlies};

/// The most plies a yarn can have.
pub const MAX_PLIES: usize = 64;

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
    /// The longer semi-axis of the cross-section.
    pub fn long_axis(&self) -> f64 {
        self.radius / self.aspect.sqrt()
    }

    /// The shorter semi-axis of the cross-section, which lies along the line to the yarn's axis.
    pub fn short_axis(&self) -> f64 {
        self.radius * self.aspect.sqrt()
    }

    /// The same ply as the only one of a yarn that is as wide as it: lengths in units of its longer semi-axis.
    pub fn alone(&self) -> Self {
        let unit = self.long_axis();
        Self {
            radius: self.radius / unit,
            distance: 0.0,
            angle: 0.0,
            fiber_radius: self.fiber_radius / unit,
            ..self.clone()
        }
    }
}

/// Mean half width of a yarn of these plies as it is seen from all sides, yarn radii, at most 1: half of the room that it takes
/// beside others. Plied yarns turn, and lie in the hollows between each other's plies.
pub fn mean_half_width(plies: &[PlyParameters]) -> f64 {
    const DIRECTIONS: u32 = 360;
    let reach = |direction: f64| {
        let of = |ply: &PlyParameters| {
            let (sin, cos) = (direction - ply.angle).sin_cos();
            ply.distance * cos + (ply.short_axis() * cos).hypot(ply.long_axis() * sin)
        };
        plies.iter().map(of).fold(0.0, f64::max)
    };
    let sum: f64 = (0..DIRECTIONS).map(|k| reach(TAU * f64::from(k) / f64::from(DIRECTIONS))).sum();
    (sum / f64::from(DIRECTIONS)).min(1.0)
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
    /// How deep below the wall: [`PlyPacking::depth`].
    pub depth: f32,
    /// How regularly a line meets fibres: [`PlyPacking::regularity`].
    pub regularity: f32,
    /// The same by the rim: [`PlyPacking::rim`].
    pub rim: f32,
    /// What is free of others after a fibre: [`PlyPacking::after`].
    pub after: Option<AfterFiber>,
}

/// The cross-section of a yarn and how it turns along it.
#[derive(Clone, Debug)]
pub struct YarnShape {
    /// The plies, at most [`MAX_PLIES`].
    pub plies: Vec<PlyShape>,
    /// Where they are, four by four.
    pub(super) fours: Vec<FourPlies>,
    /// Turns of the plies around the yarn's axis, radians per yarn radius along the yarn.
    pub ply_rate: f32,
    /// Whether any ply is elliptical.
    pub elliptical: bool,
    /// Whether rays see plies as tilted cylinders on a bent yarn; false is the paper's perpendicular section.
    pub tilted: bool,
    /// Whether one round ply fills the yarn, so that no ray through the yarn can miss it.
    pub filled: bool,
    /// The smallest turn of the section that maps it onto itself, radians: 2 pi, or a part of it for equal plies.
    pub symmetry: f64,
}

impl PlyShape {
    /// A point of the unwound yarn's section from the ply's axis, in the circle of [`Self::radius`] that the ply's section becomes when its axes
    /// are made equal.
    #[inline]
    pub(super) fn in_circle(&self, at: Vec2) -> Vec2 {
        let from = at - self.distance * self.direction;
        let (along, across) = (from.dot(self.direction), self.direction.perp_dot(from));
        self.stretch.x * along * self.direction + self.stretch.y * across * self.direction.perp()
    }

    /// The same in radii of the circle within which the centres of its fibres lie.
    #[inline]
    pub(super) fn in_core(&self, at: Vec2) -> Vec2 {
        self.in_circle(at) / self.core_radius
    }
}

impl YarnShape {
    /// From the plies and the angle (radians) that a ply makes with the yarn's axis at its centre's distance.
    ///
    /// # Panics
    /// If there is no ply, or more than [`MAX_PLIES`].
    pub fn new(plies: &[PlyParameters], ply_twist: f64, tilted: bool) -> Self {
        assert!((1..=MAX_PLIES).contains(&plies.len()), "a yarn has 1 to {MAX_PLIES} plies");
        // The twist is stated for the mean distance; plies share one rate, or they would cut through each other.
        let distance = plies.iter().map(|p| p.distance).sum::<f64>() / plies.len() as f64;
        let ply_rate = if distance > 1e-9 { ply_twist.tan() / distance } else { 0.0 };
        let shapes: Vec<PlyShape> = plies
            .iter()
            .map(|p| {
                let root = p.aspect.sqrt();
                let fiber_radius = p.fiber_radius.min(0.999 * p.radius);
                PlyShape {
                    distance: p.distance as f32,
                    direction: Vec2::new(p.angle.cos() as f32, p.angle.sin() as f32),
                    radius: p.radius as f32,
                    stretch: Vec2::new((1.0 / root) as f32, root as f32),
                    fiber_radius: fiber_radius as f32,
                    core_radius: (p.radius - fiber_radius) as f32,
                    fibers: p.fibers as f32,
                    fiber_rate: (p.fiber_twist.tan() / p.radius) as f32,
                    crowding: 0.0,
                    depth: 0.0,
                    regularity: 1.0,
                    rim: 1.0,
                    after: None,
                }
            })
            .collect();
        let equal = plies.iter().enumerate().all(|(k, p)| {
            let even = TAU * k as f64 / plies.len() as f64;
            PlyParameters { angle: 0.0, ..p.clone() } == PlyParameters { angle: 0.0, ..plies[0].clone() }
                && (p.angle - plies[0].angle - even).abs() < 1e-9
        });
        Self {
            elliptical: plies.iter().any(|p| (p.aspect - 1.0).abs() > 1e-6),
            filled: plies.len() == 1 && plies[0].distance == 0.0 && plies[0].aspect == 1.0 && plies[0].radius >= 1.0,
            symmetry: if equal { TAU / plies.len() as f64 } else { TAU },
            fours: FourPlies::of(&shapes),
            plies: shapes,
            ply_rate: ply_rate as f32,
            tilted,
        }
    }

    /// Whether plies lie in each other: more than a thousandth of the section of one in another.
    pub fn plies_overlap(&self) -> bool {
        const RINGS: u16 = 32;
        const SECTORS: u16 = 64;
        let inside = |of: &PlyShape, at: Vec2| of.in_circle(at).length_squared() < of.radius * of.radius;
        let covered = |(ply, own): (usize, &PlyShape)| {
            let within = (0..RINGS * SECTORS).filter(|place| {
                let radius = own.radius * ((f32::from(place / SECTORS) + 0.5) / f32::from(RINGS)).sqrt();
                let angle = std::f32::consts::TAU * (f32::from(place % SECTORS) + 0.5) / f32::from(SECTORS);
                let section = radius * Vec2::from_angle(angle) / own.stretch;
                let at = own.distance * own.direction + section.rotate(own.direction);
                self.plies.iter().enumerate().any(|(other, of)| other != ply && inside(of, at))
            });
            1000 * within.count() > usize::from(RINGS * SECTORS)
        };
        self.plies.iter().enumerate().any(covered)
    }

    /// The same with the fibres of each ply packed as they are measured to be; without it they are even.
    ///
    /// # Panics
    /// If there is not one packing for each ply.
    pub fn packed(mut self, packings: &[PlyPacking]) -> Self {
        assert_eq!(self.plies.len(), packings.len(), "one packing for each ply");
        for (ply, packing) in self.plies.iter_mut().zip(packings) {
            ply.crowding = packing.crowding as f32;
            ply.depth = packing.depth as f32;
            ply.regularity = packing.regularity as f32;
            ply.rim = packing.rim as f32;
            ply.after = packing.after;
        }
        self
    }
}

/// Radius and distance from the axis (yarn radii) of `count` equal round plies that touch each other and the
/// yarn's outline.
pub fn touching_plies(count: u32) -> (f64, f64) {
    if count == 1 {
        return (1.0, 0.0);
    }
    let s = (PI / f64::from(count)).sin();
    let radius = s / (1.0 + s);
    (radius, 1.0 - radius)
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
pub(crate) mod tests {
    use super::*;

    /// `count` touching round plies with `fibers` each at area fraction `density`.
    pub(crate) fn touching(count: u32, fibers: u32, density: f64, fiber_twist: f64) -> Vec<PlyParameters> {
        let (radius, distance) = touching_plies(count);
        let ply = |k: u32| PlyParameters {
            radius,
            aspect: 1.0,
            distance,
            angle: TAU * f64::from(k) / f64::from(count),
            fibers,
            fiber_radius: radius * (density / f64::from(fibers)).sqrt(),
            fiber_twist,
        };
        (0..count).map(ply).collect()
    }

    /// A yarn of [`touching`] plies.
    pub(crate) fn touching_yarn(count: u32, fibers: u32, density: f64, ply_twist: f64, fiber_twist: f64) -> YarnShape {
        YarnShape::new(&touching(count, fibers, density, fiber_twist), ply_twist, true)
    }

    #[test]
    fn plies_overlap_where_one_lies_in_another() {
        let touching = |count| touching(count, 40, 0.5, 0.0);
        for count in [1, 2, 3, 7] {
            let plies = touching(count);
            assert!(!YarnShape::new(&plies, 0.3, true).plies_overlap(), "{count} touching");
            let wider: Vec<_> =
                plies.iter().map(|ply| PlyParameters { radius: 1.05 * ply.radius, ..ply.clone() }).collect();
            assert_eq!(YarnShape::new(&wider, 0.3, true).plies_overlap(), count > 1, "{count}");
        }
        // The short axis lies along the line to the yarn's axis, where the other one is.
        let flat: Vec<_> = touching(2)
            .iter()
            .map(|ply| PlyParameters { radius: 1.05 * ply.radius, aspect: 0.8, ..ply.clone() })
            .collect();
        assert!(!YarnShape::new(&flat, 0.3, true).plies_overlap());
    }

    #[test]
    fn plied_yarns_are_as_wide_as_the_hulls_of_their_plies() {
        // Perimeters of hulls of circles over 2 pi (Cauchy).
        for count in [2, 3, 4] {
            let radius = touching_plies(count).0;
            let expected = radius + 2.0 * f64::from(count) * radius / TAU;
            assert!((mean_half_width(&touching(count, 10, 0.5, 0.0)) - expected).abs() < 1e-4, "{count}");
        }
        assert_eq!(mean_half_width(&touching(1, 10, 0.5, 0.0)), 1.0);
    }

    #[test]
    fn touching_plies_touch() {
        for n in 2..=20 {
            let (radius, distance) = touching_plies(n);
            assert!((radius + distance - 1.0).abs() < 1e-12);
            assert!((distance * (PI / f64::from(n)).sin() - radius).abs() < 1e-12, "neighbours of {n} plies touch");
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
