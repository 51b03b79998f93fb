//! What a yarn is made of: plies in its cross-section, and how they turn.
//!
//! All lengths are in units of the yarn's outer radius, so that one shape serves a yarn of any and of varying radius.

use std::f64::consts::{PI, TAU};

use glam::Vec2;

use super::{
    density::PlyPacking,
    ply::{PlyParameters, PlyShape},
    way::FourPlies,
};

/// The most plies a yarn can have.
pub const MAX_PLIES: usize = 64;

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
        let shapes: Vec<PlyShape> = plies.iter().map(PlyShape::new).collect();
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
            ply.pack(packing);
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
}
