//! A fibre averaged over its azimuths.

use std::f64::consts::PI as PI64;

use super::ChordModel;
use crate::{
    geometry::ply::PlyShape,
    math::{Rgb, special::front_share_of_wrapped_normal},
    scattering::{fiber::FiberMaterial, kernel::kappa_of_variance},
};

/// Variance of theta_h of the diffuse lobe, radians^2: a quarter of that of theta under (2 / pi) cos^2(theta).
const DIFFUSE_VARIANCE: f64 = (PI64 * PI64 / 12.0 - 0.5) / 4.0;

/// Variance of an angle that is even over a half circle, radians^2.
const HALF_CIRCLE_VARIANCE: f64 = PI64 * PI64 / 12.0;

/// A fibre averaged over its azimuths (Eqs. 3 and 4), and its ply; energies and widths per channel.
#[derive(Clone, Debug)]
pub(super) struct AveragedFiber {
    pub(super) r: [f64; 3],
    pub(super) d: [f64; 3],
    /// 1 - a_F, a_F, and a_B.
    pub(super) loss: [f64; 3],
    pub(super) forward: [f64; 3],
    pub(super) back: [f64; 3],
    /// 1 - a_F - a_B.
    pub(super) absorbed: [f64; 3],
    /// (beta_F^M)^2, (beta_B^M)^2 and (beta_F^N)^2, radians^2 (the first two in theta_h).
    pub(super) forward_latitude: [f64; 3],
    pub(super) back_latitude: [f64; 3],
    pub(super) forward_azimuth: [f64; 3],
    pub(super) kappa_r: f32,
    /// The printed number of fibres on the longest chord.
    pub(super) printed_fibers: f64,
}

/// Weighted mean; 0 where all weights are 0, of which no lobe is made.
fn mean_of(parts: [(f64, f64); 3]) -> f64 {
    let total: f64 = parts.iter().map(|p| p.0).sum();
    if total > 0.0 { parts.iter().map(|p| p.0 * p.1).sum::<f64>() / total } else { 0.0 }
}

impl AveragedFiber {
    pub(super) fn new(material: &FiberMaterial, ply: &PlyShape, model: ChordModel) -> Self {
        let direct_d = material.d;
        let averaged = FiberMaterial {
            d: if model == ChordModel::DualScattering { [0.0; 3] } else { material.d },
            ..material.clone()
        };
        let channels = |value: &dyn Fn(usize) -> f64| [value(0), value(1), value(2)];
        let m = &averaged;
        // Hemispheres relative to phi_i, as the text has it (phi_r - phi_i); with those as printed in Eqs. 3 and 4,
        // fixed ones, TT would leak backward even if it were a mirror's straight ray.
        let q = front_share_of_wrapped_normal(m.beta_n);
        let side = |c: usize| 0.5 * (m.r[c] + m.d[c]);
        let absorbed = |c: usize| (1.0 - m.r[c] - m.tt[c] - m.d[c]).max(0.0);
        let back = |c: usize| side(c) + m.tt[c] * (1.0 - q);
        let (br, btt) = (m.beta_r * m.beta_r, m.beta_tt * m.beta_tt);
        let latitude =
            |c: usize, tt: f64| mean_of([(0.5 * m.r[c], br), (m.tt[c] * tt, btt), (0.5 * m.d[c], DIFFUSE_VARIANCE)]);
        // Variance of the front half of TT: exact below beta_n = 0.8, and never more than an even half circle's.
        let z = 0.5 * PI64 / m.beta_n.max(1e-6);
        let density = (-0.5 * z * z).exp() / (2.0 * PI64).sqrt();
        let tt_azimuth = (m.beta_n * m.beta_n * (1.0 - 2.0 * z * density / q)).clamp(0.0, HALF_CIRCLE_VARIANCE);
        let (n, radius, fiber) = (f64::from(ply.fibers), f64::from(ply.radius), f64::from(ply.fiber_radius));
        let twist = f64::from(ply.fiber_rate) * radius;
        Self {
            r: m.r,
            d: direct_d,
            loss: channels(&|c| (absorbed(c) + back(c)).min(1.0)),
            forward: channels(&|c| side(c) + m.tt[c] * q),
            back: channels(&back),
            absorbed: channels(&absorbed),
            forward_latitude: channels(&|c| latitude(c, q)),
            back_latitude: channels(&|c| latitude(c, 1.0 - q)),
            forward_azimuth: channels(&|c| {
                mean_of([(m.tt[c] * q, tt_azimuth), (side(c), HALF_CIRCLE_VARIANCE), (0.0, 0.0)])
            }),
            kappa_r: kappa_of_variance(Rgb::splat(br as f32)).to_array()[0],
            // Eq. 2 with c = 1 and the text's d l sqrt(n / pi), l = 2 on the diameter of the unit circle. (Printed:
            // "l = 2h"; a chord is 2 sqrt(1 - h^2).)
            printed_fibers: n * (fiber / radius).powi(2) * (1.0 + twist * twist).sqrt() * 2.0 * (n / PI64).sqrt(),
        }
    }
}
