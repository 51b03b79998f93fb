//! What the tests of the models share.

use glam::{DVec2, Vec3A};

use super::fiber::FiberMaterial;
use crate::geometry::{
    density::KnownPacking,
    fiber::{packing::measured, slopes::Twist},
    section::Section,
    yarn::{YarnShape, tests::touching_yarn},
    yarn_frame::{ROUND, SectionGrowth, YarnFrame},
};

/// Albedos of R, TT and D.
pub(super) type Albedos = ([f64; 3], [f64; 3], [f64; 3]);

/// Silk as Zhu et al. 2023 print it.
pub(super) const SILK: Albedos = ([0.2; 3], [0.1, 0.4, 0.25], [0.03, 0.35, 0.1]);

pub(super) fn material(albedo: Albedos, beta: [f64; 3]) -> FiberMaterial {
    FiberMaterial { r: albedo.0, tt: albedo.1, d: albedo.2, beta_r: beta[0], beta_tt: beta[1], beta_n: beta[2] }
}

pub(super) fn silk() -> FiberMaterial {
    material(SILK, [0.15, 0.12, 0.35])
}

pub(super) fn lossless() -> FiberMaterial {
    material(([0.2; 3], [0.5; 3], [0.3; 3]), [0.15, 0.12, 0.35])
}

/// A yarn of one untwisted ply whose fibres lie as this program packs them.
pub(super) fn packed_ply(fibers: u32, density: f64) -> YarnShape {
    let shape = touching_yarn(1, fibers, density, 0.0, 0.0);
    let radius = f64::from(shape.plies[0].fiber_radius / shape.plies[0].core_radius);
    shape.packed(&[measured(fibers, radius, Twist::NONE, 1.0, KnownPacking::default())])
}

/// The first disc that a ray from a place meets, but for one, and where.
pub(super) fn first_disc(
    discs: &[DVec2],
    radius: f64,
    from: DVec2,
    w: DVec2,
    but: Option<usize>,
) -> Option<(usize, DVec2)> {
    let enters = |(i, disc): (usize, &DVec2)| {
        let way = *disc - from;
        let (along, off) = (way.dot(w), way.perp_dot(w));
        let is_met = Some(i) != but && along > 0.0 && off.abs() < radius;
        is_met.then(|| (along - (radius * radius - off * off).sqrt(), i))
    };
    let first = discs.iter().enumerate().filter_map(enters).min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((first.1, from + first.0 * w))
}

/// The section of a straight yarn along z, seen from latitude `theta` at azimuth 0.
pub(super) fn section(theta: f32, h: f32, phase: f32) -> Section<'static> {
    let place = YarnFrame {
        centre: Vec3A::ZERO,
        tangent: Vec3A::Z,
        curvature: Vec3A::ZERO,
        radius: 1.0,
        normal: Vec3A::X,
        phase,
        turn: None,
        stride: 1.0,
        flattening: ROUND,
        flattening_turn: 0.0,
        growth: SectionGrowth::default(),
    };
    let towards = Vec3A::new(theta.cos(), 0.0, theta.sin());
    Section::new(&place, h * Vec3A::Y, -towards, true)
}

/// Directions over the sphere, about z, each with its solid angle.
pub(super) fn sphere(n_theta: usize, n_phi: usize) -> impl Iterator<Item = (Vec3A, f64)> {
    let dt = std::f64::consts::PI / n_theta as f64;
    let dp = std::f64::consts::TAU / n_phi as f64;
    (0..n_theta * n_phi).map(move |i| {
        let theta = (i / n_phi) as f64 * dt + 0.5 * dt - std::f64::consts::FRAC_PI_2;
        let phi = (i % n_phi) as f64 * dp + 0.5 * dp;
        let (s, c) = theta.sin_cos();
        (Vec3A::new((c * phi.cos()) as f32, (c * phi.sin()) as f32, s as f32), c * dt * dp)
    })
}
