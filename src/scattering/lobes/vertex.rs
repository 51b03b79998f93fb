//! One place of scattering by these models.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI, TAU};

use glam::Vec3A;

use super::ChordYarn;
use crate::{
    geometry::section::{PlyCrossing, Section},
    math::{
        Rgb,
        sampler::{OneOf, Stream},
        special::wrapped_normal,
        warp::normal,
    },
    scattering::{
        Arrival, Continuation, Direct, LobeValues,
        kernel::{DIFFUSE, MIN_VARIANCE, kappa_of_variance, kernel, kernel_scalar, sample_sine, sample_sine_diffuse},
        lobe::{LobeFrame, choose, normalised},
        mis_weight,
    },
};

/// One place of scattering, for one camera direction.
#[derive(Clone, Debug)]
pub struct ChordVertex<'a> {
    yarn: &'a ChordYarn,
    /// LobeFrame of the fibres at the front ply's surface, for R and D.
    fiber: LobeFrame,
    /// LobeFrame of the front ply, for F and B.
    ply: LobeFrame,
    /// Energies over 1 - T0.
    pub(super) energy: LobeValues,
    /// Chances of drawing R, D, F and B.
    chance: [f32; 4],
    kappa_r: f32,
    kappa_f: Rgb,
    sigma_f: [f32; 3],
    kappa_b: Rgb,
    /// Chances of the channels in drawing F and B.
    channel_f: [f32; 3],
    channel_b: [f32; 3],
    /// Where light of R, D and B leaves from, and that of F, in the section's frame.
    node: Vec3A,
    middle: Vec3A,
}

impl<'a> ChordVertex<'a> {
    /// `unscattered` is [`Occluder::transparency`](crate::geometry::occluder::Occluder::transparency) of `crossings`, which the
    /// caller has already decided against: all values here are over 1 - `unscattered`. `u` and the stream are those of
    /// [`Vertex::new`](crate::scattering::aggregated::Vertex::new), of which these models need one number.
    #[inline]
    pub fn new(
        yarn: &'a ChordYarn,
        section: &Section<'_>,
        crossings: &[PlyCrossing],
        unscattered: f32,
        arrival: impl Into<Arrival>,
        u: [f32; 4],
        _stream: &mut Stream,
    ) -> Self {
        let camera = Vec3A::new((1.0 - section.sin * section.sin).max(0.0).sqrt(), 0.0, section.sin);
        let Some(front) = crossings.first() else {
            let frame = LobeFrame::new(Vec3A::Z, camera);
            return Self {
                yarn,
                fiber: frame,
                ply: frame,
                energy: LobeValues::default(),
                chance: [0.0; 4],
                kappa_r: 1.0,
                kappa_f: Rgb::ONE,
                sigma_f: [1.0; 3],
                kappa_b: Rgb::ONE,
                channel_f: [0.0; 3],
                channel_b: [0.0; 3],
                node: section.point(0.0),
                middle: section.point(0.0),
            };
        };
        let out = yarn.aggregate(crossings.iter().map(|c| (c.ply, yarn.fibers(c))));
        let over = 1.0 / f64::from((1.0 - unscattered).max(1e-6));
        let scaled = |e: [f64; 3]| Rgb::from(e.map(|e| e * over));
        let energy =
            LobeValues { r: scaled(out.r), tt: Rgb::ZERO, d: scaled(out.d), f: scaled(out.f), b: scaled(out.b) };
        let weight = arrival.into().throughput.max(Rgb::splat(1e-20));
        let variance = |v: [f64; 3]| Rgb::from(v).max(Rgb::splat(MIN_VARIANCE));

        // Where the camera's ray first meets a fibre: the light of R, D and B leaves from there.
        let total: f64 = crossings.iter().map(|c| yarn.fibers(c)).sum();
        let first = -(f64::from(u[0]) * (-total).exp_m1()).ln_1p();
        Self {
            yarn,
            fiber: LobeFrame::new(front.tangent_at_entry(yarn.occluder().shape(), section), camera),
            ply: LobeFrame::of_ply(yarn.occluder().shape(), section, front, camera),
            energy,
            chance: normalised([energy.r, energy.d, energy.f, energy.b].map(|e| e.weighted_mean(weight))),
            kappa_r: yarn.plies[front.ply].kappa_r,
            kappa_f: kappa_of_variance(variance(out.forward_latitude)),
            // Beyond that the circle is evenly lit, and angles lose their digits.
            sigma_f: variance(out.forward_azimuth).min(Rgb::splat(400.0)).sqrt().to_array(),
            kappa_b: kappa_of_variance(variance(out.back_latitude)),
            channel_f: normalised((energy.f * weight).to_array()),
            channel_b: normalised((energy.b * weight).to_array()),
            node: section.point(depth_after(yarn, crossings, first)),
            middle: section.point(depth_after(yarn, crossings, 0.5 * total)),
        }
    }

    /// The lobes towards `w`, and the density of drawing `w` from any of them.
    #[inline]
    pub(super) fn values(&self, w: Vec3A) -> (LobeValues, f32) {
        let mut value = LobeValues::default();
        let mut pdf = 0.0;
        let [p_r, p_d, p_f, p_b] = self.chance;
        // The back half is the fibre's own, as in a_B: half of R and D for every tilt of the fibres.
        if p_r + p_d > 0.0 && (!self.yarn.model.half_single() || w.dot(self.fiber.x) > 0.0) {
            let (at, cos) = self.fiber.latitudes(w);
            let even = cos * even_azimuth(self.yarn.model.half_single());
            if p_r > 0.0 {
                let m = kernel_scalar(self.kappa_r, at) * even;
                value.r = self.energy.r * m;
                pdf += p_r * m;
            }
            value.d = self.energy.d * (DIFFUSE * even);
            pdf += p_d * DIFFUSE * even;
        }
        if p_f + p_b > 0.0 {
            let (at, cos) = self.ply.latitudes(w);
            if p_f > 0.0 {
                let m = kernel(self.kappa_f, at) * cos;
                if m.max_channel() > 1e-12 {
                    // Centred at phi = pi; printed at 0, which is backward by the text's own words.
                    let off = w.dot(self.ply.y).atan2(w.dot(self.ply.x)) - PI;
                    let density = m * Rgb::from(self.sigma_f.map(|s| wrapped_normal(off, s)));
                    value.f = self.energy.f * density;
                    pdf += p_f * density.weighted_mean(Rgb::from(self.channel_f)) * 3.0;
                }
            }
            // N_B = 1 / 2 pi over the full circle, as printed (Eqs. 12 and 16), sends half of B forward. Two streams
            // have counted all light that leaves forward already.
            if p_b > 0.0 && (!self.yarn.model.half_b() || w.dot(self.ply.x) > 0.0) {
                let density = kernel(self.kappa_b, at) * (cos * even_azimuth(self.yarn.model.half_b()));
                value.b = self.energy.b * density;
                pdf += p_b * density.weighted_mean(Rgb::from(self.channel_b)) * 3.0;
            }
        }
        (value, pdf)
    }

    /// The value of the lobes for light from `w` (section frame), in 1/steradian, with the cosine, over 1 - T0, weighted
    /// against direction sampling; `light_pdf` is the density (1/steradian) of drawing `w`, or infinite for light that
    /// no sampled direction can meet. `u_start` draws where it leaves from.
    #[inline]
    pub fn evaluate(&self, w: Vec3A, light_pdf: f32, u_start: f32) -> Direct {
        let (value, pdf) = self.values(w);
        let mut start = OneOf::new(u_start);
        start.offer(value.f.mean(), self.middle);
        start.offer((value.sum() - value.f).mean(), self.node);
        let lobes = value.scaled(Rgb::splat(mis_weight(light_pdf, pdf)));
        Direct { lobes, start: start.drawn }
    }

    /// Draws where the path goes on. `u` are three fresh numbers: which lobe, and the direction.
    #[inline]
    pub fn sample(&self, u: [f32; 3], stream: &mut Stream) -> Option<Continuation> {
        let [p_r, p_d, p_f, p_b] = self.chance;
        let lat = [u[1], stream.next()];
        let azimuth = |half: bool| if half { PI * u[2] - FRAC_PI_2 } else { TAU * u[2] };
        let forward = p_f > 0.0 && u[0] >= p_r + p_d && (u[0] < p_r + p_d + p_f || p_b <= 0.0);
        let direction = if forward {
            let channel = choose(self.channel_f, stream.next());
            let kappa = self.kappa_f.to_array()[channel];
            let sin = sample_sine(kappa, self.ply.sin, self.ply.cos, lat, stream);
            self.ply.direction(sin, PI + self.sigma_f[channel] * normal(u[2]))
        } else if u[0] < p_r {
            let sin = sample_sine(self.kappa_r, self.fiber.sin, self.fiber.cos, lat, stream);
            self.fiber.direction(sin, azimuth(self.yarn.model.half_single()))
        } else if u[0] < p_r + p_d {
            self.fiber.direction(sample_sine_diffuse(lat), azimuth(self.yarn.model.half_single()))
        } else if p_b > 0.0 {
            let kappa = self.kappa_b.to_array()[choose(self.channel_b, stream.next())];
            let sin = sample_sine(kappa, self.ply.sin, self.ply.cos, lat, stream);
            self.ply.direction(sin, azimuth(self.yarn.model.half_b()))
        } else {
            return None;
        };
        let (value, pdf) = self.values(direction);
        let sum = value.sum();
        let share = |lobe: Rgb| lobe / sum.max(Rgb::splat(1e-30));
        (pdf > 0.0).then(|| Continuation {
            direction,
            weight: sum / pdf,
            pdf,
            shares: LobeValues {
                r: share(value.r),
                tt: Rgb::ZERO,
                d: share(value.d),
                f: share(value.f),
                b: share(value.b),
            },
            start: if forward { self.middle } else { self.node },
        })
    }

    /// Where light of R, D and B leaves from, in the section's frame.
    #[inline]
    pub fn place(&self) -> Vec3A {
        self.node
    }
}

/// The depth at which the ray has met `count` fibres.
#[inline]
fn depth_after(yarn: &ChordYarn, crossings: &[PlyCrossing], mut count: f64) -> f32 {
    let mut depth = 0.0;
    for c in crossings {
        let n = yarn.fibers(c);
        let share = if n > 0.0 { (count / n).min(1.0) } else { 0.0 };
        depth = c.enter + (c.exit - c.enter) * share as f32;
        count -= n;
        if count <= 0.0 {
            break;
        }
    }
    depth
}

/// Density of an azimuth that is even over the circle or over its back half, 1/radian.
#[inline]
fn even_azimuth(half: bool) -> f32 {
    if half { FRAC_1_PI } else { 0.5 * FRAC_1_PI }
}
