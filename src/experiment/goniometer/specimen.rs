//! What can be put on the goniometer.

use glam::{Vec2, Vec3A};

use super::{Outcome, View};
use crate::{
    cloth::pressed_scatterer,
    geometry::{
        section::{Crossings, Section},
        yarn_frame::{Pressed, ROUND, SectionGrowth, YarnFrame},
    },
    math::{Rgb, sampler::Sampler},
    scattering::{
        LobeValues,
        fiber::{FiberBcsdf, FiberMaterial},
        yarn::YarnScatterer,
    },
    scene::{Model, Yarn},
};

/// What is measured.
#[derive(Clone, Copy, Debug)]
pub enum Specimen<'a> {
    /// One fibre.
    Fiber(&'a FiberMaterial),
    /// A yarn with one of the models.
    Yarn(&'a Yarn, Model),
}

/// The specimen ready for rays.
pub(crate) enum Prepared {
    Fiber(FiberBcsdf),
    Yarn(YarnScatterer),
}

/// A yarn that is one ply of another, as thick as the ply is wide.
pub fn ply_alone(yarn: &Yarn, ply: usize) -> Yarn {
    let of = &yarn.plies[ply];
    Yarn {
        name: format!("{} ply {ply}", yarn.name),
        radius: yarn.radius * of.long_axis(),
        plies: vec![of.alone()],
        ply_twist: 0.0,
        fibers: vec![yarn.fibers[ply].clone()],
        ..yarn.clone()
    }
}

impl Specimen<'_> {
    pub(crate) fn prepare(&self, view: &View) -> Prepared {
        match self {
            Self::Fiber(material) => Prepared::Fiber(FiberBcsdf::new(material)),
            Self::Yarn(yarn, model) => Prepared::Yarn(pressed_scatterer(yarn, *model, view.flatten)),
        }
    }
}

/// A straight yarn along z, seen from `theta` at azimuth 0: the section where a ray of offset `h` meets it.
pub(crate) fn straight_section(theta: f64, h: f32, phase: f64, tilted: bool) -> Section<'static> {
    let place = YarnFrame {
        centre: Vec3A::ZERO,
        tangent: Vec3A::Z,
        curvature: Vec3A::ZERO,
        radius: 1.0,
        normal: Vec3A::X,
        phase: phase as f32,
        turn: None,
        stride: 1.0,
        flattening: ROUND,
        flattening_turn: 0.0,
        growth: SectionGrowth::default(),
    };
    let towards = Vec3A::new(theta.cos() as f32, 0.0, theta.sin() as f32);
    Section::new(&place, Vec3A::new(0.0, h, 0.0), -towards, tilted)
}

impl Prepared {
    /// Where a ray meets a yarn, the plies on its way, and the share of light that meets no fibre of them.
    fn meet(yarn: &YarnScatterer, view: &View, sampler: &mut Sampler) -> (Section<'static>, Crossings, f32) {
        let [u_offset, u_phase, _, _] = sampler.next4();
        let h = view.offset.map_or(2.0 * u_offset - 1.0, |h| h as f32);
        let phase = view.phase.unwrap_or(f64::from(u_phase) * std::f64::consts::TAU);
        // The short axis points to the camera.
        let pressed = Pressed::new(Vec2::new(view.flatten.recip() as f32, 0.0));
        let section = Section { pressed, ..straight_section(view.theta, h, phase, yarn.shape().tilted) };
        let mut crossings = Crossings::new();
        section.crossings(yarn.shape(), &mut crossings);
        let unscattered = yarn.transparency(&crossings);
        (section, crossings, unscattered)
    }

    /// One ray: what passes, and where the rest goes.
    pub(crate) fn draw(&self, view: &View, sampler: &mut Sampler) -> Outcome {
        match self {
            Self::Fiber(bcsdf) => {
                let (sin, cos) = (view.theta.sin() as f32, view.theta.cos() as f32);
                let u = sampler.next4();
                let mut stream = sampler.stream(sampler.position());
                let scattered = bcsdf
                    .sample(sin, cos, Rgb::ONE, u, &mut stream)
                    .map(|sample| (sample.wi, sample.lobes.scaled(Rgb::splat(1.0 / sample.pdf))));
                Outcome { unscattered: 0.0, scattered }
            }
            Self::Yarn(yarn) => {
                let (section, crossings, unscattered) = Self::meet(yarn, view, sampler);
                if unscattered >= 1.0 {
                    return Outcome { unscattered, scattered: None };
                }
                let u = sampler.next4();
                let [u0, u1, u2, _] = sampler.next4();
                let mut stream = sampler.stream(sampler.position());
                let vertex = yarn.vertex(&section, &crossings, unscattered, Rgb::ONE, u, &mut stream);
                let scattered = vertex
                    .sample([u0, u1, u2], &mut stream)
                    .map(|next| (next.direction, next.shares.scaled(next.weight * (1.0 - unscattered))));
                Outcome { unscattered, scattered }
            }
        }
    }

    /// One drawn answer for light from `w`.
    pub(crate) fn value(&self, view: &View, w: Vec3A, sampler: &mut Sampler) -> LobeValues {
        match self {
            Self::Fiber(bcsdf) => bcsdf.evaluate(view.theta.sin() as f32, view.theta.cos() as f32, w, Rgb::ONE).0,
            Self::Yarn(yarn) => {
                let (section, crossings, unscattered) = Self::meet(yarn, view, sampler);
                if unscattered >= 1.0 {
                    return LobeValues::default();
                }
                let u = sampler.next4();
                let mut stream = sampler.stream(sampler.position());
                let vertex = yarn.vertex(&section, &crossings, unscattered, Rgb::ONE, u, &mut stream);
                vertex.evaluate(w, f32::INFINITY, 0.5).lobes.scaled(Rgb::splat(1.0 - unscattered))
            }
        }
    }
}
