//! Yarn models that know the camera's chord only: the paper's, in two readings, and a repair of its energies.
//!
//! All send light back by R and D of single fibres and by B, and on by F, with energies that depend on the fibres on
//! the camera's ray and widths that depend on nothing else. They are there to compare with [`super::aggregated`].
//!
//! | | [`ChordModel::TwoStream`] | [`ChordModel::Paper`] | [`ChordModel::Printed`] |
//! |---|---|---|---|
//! | fibres on a ray | counted form ([`PlyCrossing::fibers`]) | the same | d l sqrt(n / pi) (Eq. 2) |
//! | unscattered light | e^-n | e^-n | none |
//! | ply's energies | two streams, all orders | Eqs. 8 to 10, Poisson mean | Eqs. 8 to 10, real n |
//! | R and D | back half, taken off B | back half, taken off B | full circle and weight, also in B |
//! | azimuth of B | back half | full circle (Eq. 12) | full circle (Eq. 12) |
//! | several plies | in order | in order | Eq. 14 |
//!
//! [`ChordModel::DualScattering`] is the classical form that the paper starts from (Zinke et al. 2008, Yuksel 2008): as
//! `Paper`, but the averaged fibre has no D, and light that meets a fibre turns back among infinitely many. It is not missed
//! in what passes, so that thin yarns of pale fibres return more than they get.
//!
//! In order: B_1 + F_1^2 B_2 + F_1^2 F_2^2 B_3 ..., which is what Eq. 14 seems to mean; as printed it counts each ply
//! twice and dims none. Forward, plies multiply (Eq. 14). All three use the kernel of [`super::kernel`] for every
//! longitudinal lobe, since the printed one (Eq. 5) neither conserves energy nor is reciprocal.
//!
//! `Printed` returns more light than it gets, up to twice: that is what it is for, and nothing here stops it.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI, TAU};
use std::f64::consts::PI as PI64;
use std::sync::Arc;

use glam::Vec3A;

use super::{
    Continuation, Direct, LobeValues,
    closed_forms::{
        endless_back, endless_steps, mean_steps, once_back, passed, poisson_mean_steps, poisson_once_back,
        poisson_passed, poisson_thrice_back, thrice_back, two_stream,
    },
    fiber::FiberMaterial,
    kernel::{DIFFUSE, MIN_VARIANCE, kappa_of_variance, kernel, kernel_scalar, sample_sine, sample_sine_diffuse},
    lobe::{LobeFrame, choose, normalised},
    mis_weight,
};
use crate::{
    geometry::{
        occluder::{Occluder, Transparency},
        section::{PlyCrossing, Section},
        yarn::{PlyShape, YarnShape},
    },
    math::{
        Rgb,
        sampler::Stream,
        special::{front_share_of_wrapped_normal, wrapped_normal},
        warp::normal,
    },
};

/// Variance of theta_h of the diffuse lobe, radians^2: a quarter of that of theta under (2 / pi) cos^2(theta).
const DIFFUSE_VARIANCE: f64 = (PI64 * PI64 / 12.0 - 0.5) / 4.0;
/// Variance of an angle that is even over a half circle, radians^2.
const HALF_CIRCLE_VARIANCE: f64 = PI64 * PI64 / 12.0;

/// Which of the models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChordModel {
    /// The energies of two streams, light forward and light back, in each ply.
    TwoStream,
    /// The most charitable reading of the paper.
    Paper,
    /// The paper's equations as printed; only what cannot be read is mended.
    Printed,
    /// Classical dual scattering: no D in the averages, infinitely many fibres behind.
    DualScattering,
}

impl ChordModel {
    /// Whether R and D keep to the back half of the circle.
    #[inline]
    fn half_single(self) -> bool {
        self != Self::Printed
    }

    /// Whether B does.
    #[inline]
    fn half_b(self) -> bool {
        self == Self::TwoStream
    }
}

/// A fibre averaged over its azimuths (Eqs. 3 and 4), and its ply; energies and widths per channel.
#[derive(Clone, Debug)]
struct AveragedFiber {
    r: [f64; 3],
    d: [f64; 3],
    /// 1 - a_F, a_F, and a_B.
    loss: [f64; 3],
    forward: [f64; 3],
    back: [f64; 3],
    /// 1 - a_F - a_B.
    absorbed: [f64; 3],
    /// (beta_F^M)^2, (beta_B^M)^2 and (beta_F^N)^2, radians^2 (the first two in theta_h).
    forward_latitude: [f64; 3],
    back_latitude: [f64; 3],
    forward_azimuth: [f64; 3],
    kappa_r: f32,
    /// The printed number of fibres on the longest chord.
    printed_fibers: f64,
}

/// Weighted mean; 0 where all weights are 0, of which no lobe is made.
fn mean_of(parts: [(f64, f64); 3]) -> f64 {
    let total: f64 = parts.iter().map(|p| p.0).sum();
    if total > 0.0 { parts.iter().map(|p| p.0 * p.1).sum::<f64>() / total } else { 0.0 }
}

impl AveragedFiber {
    fn new(material: &FiberMaterial, ply: &PlyShape, model: ChordModel) -> Self {
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

/// What all fibres on a ray do to light, per channel: energies of the lobes and their variances.
#[derive(Clone, Copy, Debug, Default)]
struct Aggregate {
    r: [f64; 3],
    d: [f64; 3],
    f: [f64; 3],
    b: [f64; 3],
    forward_latitude: [f64; 3],
    forward_azimuth: [f64; 3],
    back_latitude: [f64; 3],
}

/// A yarn's shape and the averages of its fibres.
#[derive(Clone, Debug)]
pub struct ChordYarn {
    occluder: Occluder,
    plies: Vec<AveragedFiber>,
    model: ChordModel,
}

impl ChordYarn {
    /// One material for each ply of the shape, which several yarns may share.
    ///
    /// # Panics
    /// If their numbers differ.
    pub fn new(shape: impl Into<Arc<YarnShape>>, materials: &[&FiberMaterial], model: ChordModel) -> Self {
        let shape = shape.into();
        assert_eq!(shape.plies.len(), materials.len(), "one material for each ply");
        let plies = shape.plies.iter().zip(materials).map(|(p, m)| AveragedFiber::new(m, p, model)).collect();
        // As printed the model has no light that passes: a ply is opaque.
        let transparency = if model == ChordModel::Printed { Transparency::Opaque } else { Transparency::Random };
        Self { occluder: Occluder::new(shape, transparency), plies, model }
    }

    /// The yarn's cross-section.
    #[inline]
    pub fn shape(&self) -> &YarnShape {
        self.occluder.shape()
    }

    /// The yarn without its colours: what rays see that only ask whether they pass.
    #[inline]
    pub fn occluder(&self) -> &Occluder {
        &self.occluder
    }

    /// T0: the share of light that passes all plies on the ray and meets no fibre; grey.
    #[inline]
    pub fn transparency(&self, crossings: &[PlyCrossing]) -> f32 {
        self.occluder.transparency(crossings)
    }

    /// n_l of the model.
    #[inline]
    fn fibers(&self, crossing: &PlyCrossing) -> f64 {
        if self.model != ChordModel::Printed {
            return f64::from(crossing.fibers);
        }
        let h = f64::from(crossing.offset / self.shape().plies[crossing.ply].radius);
        self.plies[crossing.ply].printed_fibers * (1.0 - h * h).max(0.0).sqrt()
    }

    /// The lobes of plies in order, each with its number of fibres.
    fn aggregate(&self, plies: impl Iterator<Item = (usize, f64)> + Clone) -> Aggregate {
        let mut out = Aggregate::default();
        for c in 0..3 {
            self.aggregate_channel(c, plies.clone(), &mut out);
        }
        out
    }

    fn aggregate_channel(&self, c: usize, plies: impl Iterator<Item = (usize, f64)>, out: &mut Aggregate) {
        let printed = self.model == ChordModel::Printed;
        let (mut reaching, mut depth, mut events) = (1.0, 0.0, 0.0);
        let (mut latitude, mut azimuth) = (0.0, 0.0);
        let (mut weights, mut weighted) = (0.0, 0.0);
        for (index, (ply, n)) in plies.enumerate() {
            let fiber = &self.plies[ply];
            let (loss, back) = (fiber.loss[c], fiber.back[c]);
            let front = index == 0;
            // Eq. 8, Eq. 10, and the share of the latter that is single scattering at the first fibre.
            let (mut returned, transmitted, single) = match self.model {
                ChordModel::TwoStream => {
                    let (r, t) = two_stream(fiber.absorbed[c], back, n);
                    (r, t, -0.5 * (-2.0 * n).exp_m1())
                }
                ChordModel::Paper => {
                    let once = back * poisson_once_back(loss, n);
                    let thrice = back.powi(3) * poisson_thrice_back(loss, n);
                    (once + thrice, poisson_passed(loss, n), -(-n).exp_m1())
                }
                ChordModel::DualScattering => {
                    let (once, thrice) = endless_back(loss, back);
                    let met = -(-n).exp_m1();
                    ((once + thrice) * met, poisson_passed(loss, n), met)
                }
                ChordModel::Printed => {
                    (back * once_back(loss, n) + back.powi(3) * thrice_back(loss, n), passed(loss, n), 1.0)
                }
            };
            let steps = match self.model {
                ChordModel::Printed => mean_steps(loss, n),
                ChordModel::DualScattering => endless_steps(loss),
                ChordModel::TwoStream | ChordModel::Paper => poisson_mean_steps(loss, n, front),
            };
            if front {
                let share = if printed { 1.0 } else { 0.5 * single };
                (out.r[c], out.d[c]) = (fiber.r[c] * share, fiber.d[c] * share);
                if !printed {
                    // What R and D show is no longer B's. Turned-back TT has no lobe of its own and stays here.
                    let averaged_d = if self.model == ChordModel::DualScattering { 0.0 } else { out.d[c] };
                    returned = (returned - out.r[c] - averaged_d).max(0.0);
                }
            }
            // Printed Eq. 14: sum of a_B (1 + a_F^2) over plies, none dimmed by those before it. A yarn of one ply is
            // that ply.
            let twice = printed && self.plies.len() > 1;
            let weight = returned * reaching * reaching;
            out.b[c] += if twice { returned * (1.0 + transmitted * transmitted) } else { weight };
            // Eq. 12, which the appendix does not derive; then Eq. 17 with its weights read as products of the plies
            // before, and divided by their sum: v_B + 2 (v_F of the plies before).
            weights += weight;
            weighted += weight * (fiber.back_latitude[c] + 2.0 * (fiber.forward_latitude[c] * steps + latitude));
            // Eq. 11 as variances: printed, v is a sum of widths in one place and a width in the next. Of a Poisson
            // number of fibres, forward light has met n a_F in the mean.
            let met = if printed { n } else { n * fiber.forward[c] };
            latitude += met * fiber.forward_latitude[c];
            azimuth += met * fiber.forward_azimuth[c];
            events += met;
            reaching *= transmitted;
            depth += n;
        }
        // F is light that met at least one fibre. (Eqs. 15 and 17 contradict each other on how plies add up; light
        // in F has passed all of them.)
        let scattered = if printed { 1.0 } else { -(-events).exp_m1() };
        if scattered > 0.0 {
            latitude /= scattered;
            azimuth /= scattered;
        }
        let unscattered = if printed { 0.0 } else { (-depth).exp() };
        out.f[c] = (reaching - unscattered).max(0.0);
        out.forward_latitude[c] = latitude;
        out.forward_azimuth[c] = azimuth;
        out.back_latitude[c] = if weights > 0.0 { weighted / weights } else { 0.0 };
    }
}

/// One place of scattering, for one camera direction.
#[derive(Clone, Debug)]
pub struct ChordVertex<'a> {
    yarn: &'a ChordYarn,
    /// LobeFrame of the fibres at the front ply's surface, for R and D.
    fiber: LobeFrame,
    /// LobeFrame of the front ply, for F and B.
    ply: LobeFrame,
    /// Energies over 1 - T0.
    energy: LobeValues,
    /// Chances of drawing R, D, F and B.
    chance: [f32; 4],
    kappa_r: f32,
    kappa_f: Rgb,
    sigma_f: [f32; 3],
    kappa_b: Rgb,
    /// Chances of the channels in drawing F and B.
    channel_f: [f32; 3],
    channel_b: [f32; 3],
    node: f32,
    middle: f32,
}

impl<'a> ChordVertex<'a> {
    /// `throughput` is the path's weight so far; `unscattered` is [`ChordYarn::transparency`] of `crossings`, which the
    /// caller has already decided against: all values here are over 1 - `unscattered`. `u` and the stream are those of
    /// [`super::aggregated::Vertex::new`], of which these models need one number.
    #[inline]
    pub fn new(
        yarn: &'a ChordYarn,
        section: &Section<'_>,
        crossings: &[PlyCrossing],
        unscattered: f32,
        throughput: Rgb,
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
                node: 0.0,
                middle: 0.0,
            };
        };
        let out = yarn.aggregate(crossings.iter().map(|c| (c.ply, yarn.fibers(c))));
        let over = 1.0 / f64::from((1.0 - unscattered).max(1e-6));
        let scaled = |e: [f64; 3]| Rgb::from(e.map(|e| e * over));
        let energy =
            LobeValues { r: scaled(out.r), tt: Rgb::ZERO, d: scaled(out.d), f: scaled(out.f), b: scaled(out.b) };
        let weight = throughput.max(Rgb::splat(1e-20));
        let variance = |v: [f64; 3]| Rgb::from(v).max(Rgb::splat(MIN_VARIANCE));

        // Where the camera's ray first meets a fibre: the light of R, D and B leaves from there.
        let total: f64 = crossings.iter().map(|c| yarn.fibers(c)).sum();
        let first = -(f64::from(u[0]) * (-total).exp_m1()).ln_1p();
        Self {
            yarn,
            fiber: LobeFrame::new(front.tangent_at_entry(yarn.shape(), section), camera),
            ply: LobeFrame::of_ply(yarn.shape(), section, front, camera),
            energy,
            chance: normalised([energy.r, energy.d, energy.f, energy.b].map(|e| e.weighted_mean(weight))),
            kappa_r: yarn.plies[front.ply].kappa_r,
            kappa_f: kappa_of_variance(variance(out.forward_latitude)),
            // Beyond that the circle is evenly lit, and angles lose their digits.
            sigma_f: variance(out.forward_azimuth).min(Rgb::splat(400.0)).sqrt().to_array(),
            kappa_b: kappa_of_variance(variance(out.back_latitude)),
            channel_f: normalised((energy.f * weight).to_array()),
            channel_b: normalised((energy.b * weight).to_array()),
            node: depth_after(yarn, crossings, first),
            middle: depth_after(yarn, crossings, 0.5 * total),
        }
    }

    /// The lobes towards `w`, and the density of drawing `w` from any of them.
    #[inline]
    fn values(&self, w: Vec3A) -> (LobeValues, f32) {
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
    /// no sampled direction can meet.
    #[inline]
    pub fn evaluate(&self, w: Vec3A, light_pdf: f32) -> Direct {
        let (value, pdf) = self.values(w);
        let total = value.sum().mean();
        let lobes = value.scaled(Rgb::splat(mis_weight(light_pdf, pdf)));
        Direct { lobes, forward_share: if total > 0.0 { value.f.mean() / total } else { 0.0 } }
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

    /// Depth from which light of R, D and B leaves.
    #[inline]
    pub fn node_start(&self) -> f32 {
        self.node
    }

    /// Depth from which light of F leaves: the middle of the fibres on the chord.
    #[inline]
    pub fn forward_start(&self) -> f32 {
        self.middle
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

#[cfg(test)]
mod tests;
