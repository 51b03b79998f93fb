//! The aggregated yarn: one answer for the hundreds of fibres behind a point of a yarn.
//!
//! Light on its way along the camera's chord through the plies
//! * meets no fibre at all (the unscattered share T0, a delta, [`AggregatedYarn::transparency`]),
//! * passes all it meets as TT and leaves forward (lobe F),
//! * or ends its chain at a *node*: a place on the chord where R, D or the wide part of TT sends it towards the
//!   light. On the way there it is dimmed by the plies ahead (`optical_depth`); what stays scatters on and
//!   leaves in the end as lobe B.
//!
//! F takes the place of the paper's forward lobes (Eqs. 8 to 11, 15), B of its backward lobes without the single
//! scattering that R and D already hold (Eqs. 12 to 14); the paper counts that twice and can double the energy.
//!
//! # Estimation
//! A [`Vertex`] draws one node, and one direction from it. Whether that direction escapes decides between R/D/TT and
//! B, as it would for a photon: with white fibres every weight is 1. The direction also serves as a one-sample
//! estimate of the share that stays, so that no table of it is needed, in memory or in set-up time.
//! Each of the components (F, node lobes, B) is an integral of its own, with its own weight between light sampling
//! and direction sampling (balance heuristic), all given the node and the direction drawn.

use std::{
    cell::OnceCell,
    f32::consts::{FRAC_1_PI, PI, TAU},
};

use glam::{Vec2, Vec3A};

use super::{
    Continuation, Direct, LobeValues,
    fiber::FiberMaterial,
    kernel::{DIFFUSE, Latitudes, kappa_of_variance, kernel, kernel_scalar, sample_sine, sample_sine_diffuse},
    lobe::{LobeFrame, choose, normalised},
    medium::PlyOptics,
    mis_weight,
};
use crate::{
    geometry::{
        section::{Crossings, PlyCrossing, PlyParts, Section},
        yarn::YarnShape,
    },
    math::{Rgb, frame::sin_cos, sampler::Stream, special::wrapped_normal, warp::normal},
};

/// How strongly multiply scattered light moves sideways with the camera's offset.
const LEAN_SIDEWAYS: f32 = 1.2;
/// The most that the light's own way may brighten F against its mean: keeps sampled weights bounded.
const MAX_FORWARD_GAIN: f32 = 3.0;
/// Density of F (1/steradian) below which it is as the camera's chord has it: most light comes from elsewhere, and pays
/// nothing for F.
const FORWARD_TAIL: f32 = 1e-4;
/// Sine of the steepest latitude at which the mean of that gain is looked at.
const STEEPEST_MEAN: f32 = 0.99;
/// Fibres more than counted on the camera's side by which the node's lobes are widened for sampling, so that the
/// light's side, unknown then, does not make the true lobe wider than the sampled one.
const SAMPLING_WIDENING: f32 = 0.7;

/// A yarn's shape and the optics of its plies.
#[derive(Clone, Debug)]
pub struct AggregatedYarn {
    shape: YarnShape,
    plies: Vec<PlyOptics>,
    /// Expected energy of a node in each ply, for choosing between plies.
    node_gain: Vec<Rgb>,
    /// The model's plain form, as first specified for straight yarns: F by the camera's chord alone, neighbouring plies by
    /// their cores. Only for comparison with reference values of that form.
    plain: bool,
}

impl AggregatedYarn {
    /// One material for each ply of the shape.
    ///
    /// # Panics
    /// If their numbers differ.
    pub fn new(shape: YarnShape, materials: &[&FiberMaterial]) -> Self {
        assert_eq!(shape.plies.len(), materials.len(), "one material for each ply");
        let count = shape.plies.len();
        let plies: Vec<_> = shape.plies.iter().zip(materials).map(|(p, m)| PlyOptics::new(m, p, count)).collect();
        let node_gain = plies.iter().map(|p| p.albedo * (p.leaves_yarn + 1.0) * 0.5).collect();
        Self { shape, plies, node_gain, plain: false }
    }

    /// The yarn's geometry.
    pub fn shape(&self) -> &YarnShape {
        &self.shape
    }

    /// T0: the share of light that passes all plies on the ray and meets no fibre; grey.
    #[inline]
    pub fn transparency(&self, crossings: &[PlyCrossing]) -> f32 {
        let depth: f32 = crossings.iter().map(|c| c.fibers * self.plies[c.ply].rho_unscattered).sum();
        (-depth).exp()
    }
}

/// Light that ends its chain: a place inside a ply.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// The ply.
    ply: usize,
    /// The camera's ray in it.
    crossing: PlyCrossing,
    /// Where, in the section.
    point: Vec2,
    /// How far along the yarn.
    travel: f32,
    /// Unit tangent of the fibre there.
    tangent: Vec3A,
    /// 1 / z of `tangent`.
    tangent_stretch: f32,
    /// Sine and cosine of the camera's latitude against the fibre.
    sin: f32,
    cos: f32,
    /// Expected fibres between the camera and the node.
    before: f32,
    /// Weight of an event here, before any albedo.
    amplitude: Rgb,
    /// Widths for sampling the lobes.
    kappa_r: f32,
    kappa_tt: f32,
    /// Chances of R, TT and D.
    chance: [f32; 3],
    /// Throughput times amplitude: what decides between escape and B.
    weight: Rgb,
}

/// Multiply scattered light of the node's ply.
#[derive(Clone, Copy, Debug)]
struct Backward {
    frame: LobeFrame,
    /// cos and sin of the azimuth towards which it leans.
    lean_to: (f32, f32),
    /// Energy that leaves the node's ply, given the direction drawn.
    energy: Rgb,
    /// Chance that the node's drawn direction does not escape.
    chance: f32,
    /// In a yarn of several plies: light that leaves the ply and meets another one.
    again: Option<Again>,
    /// Channel means of the ply's shares, for sampling.
    mirrored: f32,
    lean: f32,
    kappa: f32,
}

/// Light that left the node's ply in a direction drawn from its lobe, as far as other plies took it up.
#[derive(Clone, Copy, Debug)]
struct Again {
    /// The direction, B's value over density there, and its density.
    direction: Vec3A,
    weight: Rgb,
    pdf: f32,
    /// Chance that it goes on in this direction.
    open: f32,
    /// Energy that other plies took up and give off evenly.
    energy: Rgb,
}

/// Light that passes as TT.
#[derive(Clone, Debug)]
struct Forward {
    frame: LobeFrame,
    energy: Rgb,
    /// Chance of each channel when sampling.
    channel: [f32; 3],
    kappa: Rgb,
    sigma: [f32; 3],
    /// Half way through the fibres on the camera's chord.
    middle: f32,
    /// Expected fibres on the camera's chord.
    fibers: f32,
    /// Optical depths of the camera's half.
    half_depth: Rgb,
    half_depth_unscattered: f32,
    /// e^-depth - e^-depth_unscattered of the whole chord.
    passed: Rgb,
    /// What the light's own way adds, made when first asked for: most light comes from elsewhere. `None` where the lobe
    /// is as the camera's chord has it.
    far_half: OnceCell<Option<FarHalf>>,
}

/// The half of F's way that is the light's.
#[derive(Clone, Copy, Debug)]
struct FarHalf {
    /// By how much the light's plain chords count.
    scale: f32,
    /// What F's gain is over: that of the camera's chord, and the gain's mean over the lobe.
    norm: Rgb,
}

/// One place of scattering, for one camera direction: see the module's notes.
#[derive(Clone, Debug)]
pub struct Vertex<'a> {
    yarn: &'a AggregatedYarn,
    section: &'a Section,
    camera: Vec3A,
    forward: Option<Forward>,
    forward_chance: f32,
    node: Option<Node>,
    /// Multiply scattered light, made when first asked for: a path that goes on from the node may never do.
    backward: OnceCell<Backward>,
    /// What is random about it.
    backward_stream: Stream,
    /// The direction drawn from the node's lobes, their value there (with the way out), density, and chance to escape.
    drawn: Drawn,
}

#[derive(Clone, Copy, Debug)]
struct Drawn {
    direction: Vec3A,
    value: NodeValue,
    escape: f32,
}

/// The node's lobes in one direction.
#[derive(Clone, Copy, Debug)]
struct NodeValue {
    r: Rgb,
    tt: Rgb,
    d: Rgb,
    /// Density of sampling, without the chance to escape.
    pdf: f32,
    /// e^-optical depth.
    clear: Rgb,
    /// e^-optical depth of the other plies alone.
    open: Rgb,
}

impl<'a> Vertex<'a> {
    /// Draws a node. `throughput` is the path's weight so far; `unscattered` is [`AggregatedYarn::transparency`] of
    /// `crossings`, which the caller has already decided against: all values here are over 1 - `unscattered`.
    #[inline]
    pub fn new(
        yarn: &'a AggregatedYarn,
        section: &'a Section,
        crossings: &Crossings,
        unscattered: f32,
        throughput: Rgb,
        u: [f32; 4],
        stream: &mut Stream,
    ) -> Self {
        let camera = Vec3A::new((1.0 - section.sin * section.sin).max(0.0).sqrt(), 0.0, section.sin);
        let scattered = (1.0 - unscattered).max(1e-6);
        let weight = throughput.max(Rgb::splat(1e-20)) / scattered;

        // Along the chord, front to back: what reaches each ply, and what ends in it.
        let mut reaching = Rgb::ONE;
        let mut chain = Rgb::ZERO;
        let mut total = 0.0;
        let mut chosen: Option<(usize, Rgb, f32)> = None;
        let mut pick = u[0];
        for (i, c) in crossings.iter().enumerate() {
            let optics = &yarn.plies[c.ply];
            let depth = optics.rho * c.fibers;
            let ended = depth.one_minus_exp_neg();
            let energy = (reaching * ended * yarn.node_gain[c.ply]).weighted_mean(weight);
            if energy > 0.0 {
                // Reservoir of one: the same uniform number serves all plies.
                total += energy;
                let chance = energy / total;
                if pick < chance {
                    chosen = Some((i, reaching, energy));
                    pick /= chance;
                } else {
                    pick = (pick - chance) / (1.0 - chance);
                }
                pick = pick.clamp(0.0, 0.999_999_94);
            }
            reaching *= (-depth).exp();
            chain += optics.chain * c.fibers;
        }
        let forward = Forward::new(yarn, section, crossings, camera, reaching, chain, unscattered, weight, scattered);
        let forward_energy = forward.as_ref().map_or(0.0, |f| f.energy.weighted_mean(throughput));
        let mut vertex = Self {
            yarn,
            section,
            camera,
            forward,
            forward_chance: if forward_energy > 0.0 { forward_energy / (forward_energy + total) } else { 0.0 },
            node: None,
            backward: OnceCell::new(),
            backward_stream: stream.fork(),
            drawn: Drawn {
                direction: Vec3A::ZERO,
                value: NodeValue {
                    r: Rgb::ZERO,
                    tt: Rgb::ZERO,
                    d: Rgb::ZERO,
                    pdf: 0.0,
                    clear: Rgb::ONE,
                    open: Rgb::ONE,
                },
                escape: 0.0,
            },
        };
        if let Some((i, reaching, energy)) = chosen {
            let share = energy / total * scattered;
            vertex.draw_node(crossings, i, reaching / share, weight, throughput, u[1], pick);
            vertex.draw_direction([u[2], u[3]], stream);
        }
        vertex
    }

    /// Places the node along the chord of one ply: exponentially, by a channel drawn with the path's weights.
    #[inline]
    #[allow(clippy::too_many_arguments, reason = "one step of the constructor")]
    fn draw_node(
        &mut self,
        crossings: &Crossings,
        index: usize,
        reaching: Rgb,
        weight: Rgb,
        throughput: Rgb,
        u_depth: f32,
        u_channel: f32,
    ) {
        let crossing = &crossings[index];
        let optics = &self.yarn.plies[crossing.ply];
        let depth = optics.rho * crossing.fibers;
        let ended = depth.one_minus_exp_neg();
        let chances = normalised((reaching * ended * self.yarn.node_gain[crossing.ply] * weight).to_array());
        let channel = choose(chances, u_channel);
        let (d, e) = (depth.to_array()[channel], ended.to_array()[channel]);
        let x = if d > 1e-4 { (-(-u_depth * e).ln_1p() / d).clamp(0.0, 1.0) } else { u_depth };
        // Density of x in [0, 1] for each channel: d e^-dx / (1 - e^-d), 1 for d -> 0.
        let fall = (depth * -x).exp();
        let density = fall * depth.select_below(1e-6, Rgb::ONE, depth / ended.max(Rgb::splat(1e-30)));
        let drawn = Rgb::from(chances).weighted_mean(density) * 3.0;
        let amplitude = reaching * ended * density / drawn.max(1e-30);

        self.node = Some(self.place_node(crossing, x, amplitude, throughput));
    }

    /// The node at the fraction `x` of a ply's chord.
    #[inline]
    fn place_node(&self, crossing: &PlyCrossing, x: f32, amplitude: Rgb, throughput: Rgb) -> Node {
        let optics = &self.yarn.plies[crossing.ply];
        let ply = &self.yarn.shape.plies[crossing.ply];
        let point = Vec2::new(crossing.enter + (crossing.exit - crossing.enter) * x, self.section.h);
        let travel = self.section.travel(point.x);
        let (axis, centre) = if self.section.slope == 0.0 {
            (crossing.axis, crossing.centre)
        } else {
            let axis = self.section.ply_axis(ply, Section::turn(&self.yarn.shape, travel));
            (axis, self.section.ply_centre(ply, axis, travel))
        };
        let straight = self.section.fiber_tangent(&self.yarn.shape, crossing.ply, centre, axis, point);
        let tangent = straight + self.section.bent(travel);
        let length = tangent.length();
        let tangent = tangent / length;
        let sin = tangent.dot(self.camera).clamp(-1.0, 1.0);
        let before = crossing.fibers * x;
        let widened = optics.chain.max_channel() * (before + SAMPLING_WIDENING);
        let kappa = |variance: f32| kappa_of_variance(Rgb::splat(variance)).to_array()[0];
        let weight = throughput.max(Rgb::splat(1e-20)) * amplitude;
        let lobes = [optics.single_r, optics.single_tt, optics.single_d].map(|a| a.weighted_mean(weight));
        Node {
            ply: crossing.ply,
            crossing: *crossing,
            point,
            travel,
            tangent,
            tangent_stretch: length,
            sin,
            cos: (1.0 - sin * sin).sqrt(),
            before,
            amplitude,
            kappa_r: kappa(optics.beta_r_squared + widened * optics.beta_tt_squared),
            kappa_tt: kappa((1.0 + widened) * optics.beta_tt_squared),
            chance: normalised(lobes),
            weight: weight * optics.albedo,
        }
    }

    /// Draws a direction from the node's lobes; whether it escapes says how much light stays for B.
    #[inline]
    fn draw_direction(&mut self, u: [f32; 2], stream: &mut Stream) {
        let Some(node) = self.node else { return };
        if node.chance.iter().sum::<f32>() <= 0.0 {
            self.node = None;
            return;
        }
        let optics = &self.yarn.plies[node.ply];
        // Before rejection sampling takes an unknown number of them: a stream's first numbers may be the even ones, and
        // what lies in the way of the azimuth makes most of the noise under a wide light.
        let [u_azimuth, u_lobe] = [stream.next(), stream.next()];
        let sin = match choose(node.chance, u_lobe) {
            0 => sample_sine(node.kappa_r, node.sin, node.cos, u, stream),
            1 => sample_sine(node.kappa_tt, node.sin, node.cos, u, stream),
            _ => sample_sine_diffuse(u),
        };
        let frame = LobeFrame::new(node.tangent, self.camera);
        let direction = frame.direction(sin, TAU * u_azimuth);
        let value = self.node_value(&node, direction);
        let escape = self.escape_chance(&node, optics, value.clear);
        self.drawn = Drawn { direction, value, escape };
    }

    /// Lobe B of a node.
    #[inline]
    fn backward(&self, node: &Node) -> &Backward {
        self.backward.get_or_init(|| self.backward_at(node))
    }

    fn backward_at(&self, node: &Node) -> Backward {
        let optics = &self.yarn.plies[node.ply];
        let Drawn { value, escape, .. } = self.drawn;
        let energy = node.amplitude * optics.albedo * optics.leaves_ply * (Rgb::ONE - value.clear);
        let mut backward = self.backward_of(&node.crossing, energy, 1.0 - escape);
        if self.yarn.shape.plies.len() > 1 && backward.chance > 0.0 {
            let w = backward.draw(&mut self.backward_stream.clone());
            let (value, pdf) = self.backward_value(&backward, node.ply, w);
            if pdf > 0.0 {
                let open = (-self.optical_depth(node, w).1).exp();
                let weight = value / pdf;
                let energy = weight * (Rgb::ONE - open) * optics.leaves_yarn;
                let chance = self.open_chance(node, optics, open);
                backward.again = Some(Again { direction: w, weight: weight * open, pdf, open: chance, energy });
            }
        }
        backward
    }

    /// The chance, given how open a direction is, that multiply scattered light goes on in it.
    #[inline]
    fn open_chance(&self, node: &Node, optics: &PlyOptics, open: Rgb) -> f32 {
        let out = open.weighted_mean(node.weight);
        let stay = ((Rgb::ONE - open) * optics.leaves_yarn).weighted_mean(node.weight);
        if out + stay > 0.0 { out / (out + stay) } else { 1.0 }
    }

    /// Lobe B of a ply, for a given energy and chance of sampling.
    #[inline]
    fn backward_of(&self, crossing: &PlyCrossing, energy: Rgb, chance: f32) -> Backward {
        let optics = &self.yarn.plies[crossing.ply];
        let frame = LobeFrame::of_ply(&self.yarn.shape, self.section, crossing, self.camera);
        let relative = if self.yarn.shape.plies.len() == 1 {
            crossing.offset / self.yarn.shape.plies[0].radius
        } else {
            self.section.h
        };
        let (lean_sin, lean_cos) = sin_cos(LEAN_SIDEWAYS * relative.clamp(-1.0, 1.0).asin());
        Backward {
            frame,
            lean_to: (lean_cos, lean_sin),
            energy,
            chance,
            again: None,
            mirrored: optics.mirrored.mean(),
            lean: optics.lean.mean().min(0.95),
            kappa: 0.125 / optics.beta_r_squared.max(super::kernel::MIN_VARIANCE),
        }
    }

    /// The optical depth between a node and the outside in a direction of the section's frame, per channel: of all
    /// plies, and of all but the node's own.
    ///
    /// Near its own fibre the way is clearer than the mean medium: the camera's ray has already swept a strip as wide
    /// as a fibre (the "hot spot"), and the light starts at the fibre's surface, not at its centre.
    #[inline]
    fn optical_depth(&self, node: &Node, w: Vec3A) -> (Rgb, Rgb) {
        let shape = &self.yarn.shape;
        let optics = &self.yarn.plies[node.ply];
        let cos = (1.0 - w.z * w.z).max(1e-6).sqrt();
        let ahead = Vec2::new(w.x, w.y) / cos;
        let start = node.point + optics.shift * (Vec2::X + ahead);
        let width = 2.0 * shape.plies[node.ply].fiber_radius;
        let cleared = if ahead.x > 0.0 { width / ahead.y.abs().max(1e-6) } else { width };
        let ramp = |t: f32| if t < cleared { 0.5 * t * t / cleared } else { t - 0.5 * cleared };
        let mut own = Rgb::ZERO;
        let mut others = Rgb::ZERO;
        let plain = self.yarn.plain;
        let parts = if plain { PlyParts::Cores } else { PlyParts::CoreOf(node.ply) };
        self.section.chords_ahead(shape, start, node.travel, w, parts, |ply, from, to, offset| {
            let passed = &self.yarn.plies[ply];
            if ply == node.ply || plain {
                let depth = passed.rho * (passed.sigma * (ramp(to + optics.lead) - ramp(from + optics.lead)));
                if ply == node.ply {
                    own += depth;
                } else {
                    others += depth;
                }
            } else {
                let other = &shape.plies[ply];
                let full = 2.0 * (other.radius * other.radius - offset * offset).max(1e-8).sqrt();
                others += passed.rho * (other.fibers_on_chord(offset) * ((to - from) / full).min(1.0));
            }
        });
        let along = w.dot(node.tangent);
        let tilt = (1.0 - along * along).max(1e-9).sqrt() * node.tangent_stretch / cos * self.section.squeeze();
        others *= tilt;
        (own * tilt + others, others)
    }

    /// The node's lobes towards `w`, dimmed by the way out.
    #[inline]
    fn node_value(&self, node: &Node, w: Vec3A) -> NodeValue {
        let optics = &self.yarn.plies[node.ply];
        let (depth, others) = self.optical_depth(node, w);
        let clear = (-depth).exp();
        let sin = w.dot(node.tangent).clamp(-1.0, 1.0);
        let cos = (1.0 - sin * sin).sqrt();
        let at = Latitudes::new(node.sin, node.cos, sin, cos);
        // Chains of TT on both sides widen the lobes.
        let passed = optics.chain * (depth / optics.rho.max(Rgb::splat(1e-6)) + node.before);
        let beta_tt = Rgb::splat(optics.beta_tt_squared);
        let even = cos * (0.5 * FRAC_1_PI);
        let scale = node.amplitude * clear * even;
        let [p_r, p_tt, p_d] = node.chance;
        let mut value = NodeValue {
            r: Rgb::ZERO,
            tt: Rgb::ZERO,
            d: optics.single_d * scale * DIFFUSE,
            pdf: p_d * DIFFUSE,
            clear,
            open: (-others).exp(),
        };
        if p_r > 0.0 {
            let m = kernel(kappa_of_variance(passed * beta_tt + optics.beta_r_squared), at);
            value.r = optics.single_r * scale * m;
            value.pdf += p_r * kernel_scalar(node.kappa_r, at);
        }
        if p_tt > 0.0 {
            let m = kernel(kappa_of_variance((passed + 1.0) * beta_tt), at);
            value.tt = optics.single_tt * scale * m;
            value.pdf += p_tt * kernel_scalar(node.kappa_tt, at);
        }
        value.pdf *= even;
        value
    }

    /// The chance, given the clearness of a direction, that light sent there counts as escaped and not as B.
    #[inline]
    fn escape_chance(&self, node: &Node, optics: &PlyOptics, clear: Rgb) -> f32 {
        let out = clear.weighted_mean(node.weight);
        let stay = ((Rgb::ONE - clear) * optics.leaves_yarn).weighted_mean(node.weight);
        if out + stay > 0.0 { out / (out + stay) } else { 1.0 }
    }

    /// The value of the lobes for light from `w` (section frame), in 1/steradian, with the cosine, over 1 - T0; each
    /// component weighted against direction sampling, where `light_pdf` is the density (1/steradian) of drawing `w`,
    /// or infinite for light that no sampled direction can meet.
    #[inline]
    pub fn evaluate(&self, w: Vec3A, light_pdf: f32) -> Direct {
        let mut lobes = LobeValues::default();
        let mut forward_part = 0.0;
        if let Some(forward) = &self.forward {
            let (value, pdf) = self.forward_value(forward, w);
            lobes.f = value * mis_weight(light_pdf, self.forward_chance * pdf);
            forward_part = lobes.f.mean();
        }
        if let Some(node) = &self.node {
            let at_node = 1.0 - self.forward_chance;
            let value = self.node_value(node, w);
            let escape = self.escape_chance(node, &self.yarn.plies[node.ply], value.clear);
            let weight = mis_weight(light_pdf, at_node * escape * value.pdf);
            lobes.r = value.r * weight;
            lobes.tt = value.tt * weight;
            lobes.d = value.d * weight;
            let backward = self.backward(node);
            let optics = &self.yarn.plies[node.ply];
            let (first, pdf) = self.backward_value(backward, node.ply, w);
            let chance = at_node * backward.chance;
            lobes.b = match &backward.again {
                None => first * mis_weight(light_pdf, chance * pdf),
                Some(again) => {
                    let open = self.open_chance(node, optics, value.open);
                    let even = even_over_fibers(backward.frame.latitudes(w).1);
                    first * value.open * mis_weight(light_pdf, chance * open * pdf)
                        + again.energy * even * mis_weight(light_pdf, chance * (1.0 - again.open) * even)
                }
            };
        }
        let total = lobes.sum().mean();
        Direct { lobes, forward_share: if total > 0.0 { forward_part / total } else { 0.0 } }
    }

    /// Draws where the path goes on. `u` are three fresh numbers: which component, and the direction of F or B.
    #[inline]
    pub fn sample(&self, u: [f32; 3], stream: &mut Stream) -> Option<Continuation> {
        if u[0] < self.forward_chance {
            let forward = self.forward.as_ref()?;
            let channel = choose(forward.channel, stream.next());
            let kappa = forward.kappa.to_array()[channel];
            let frame = &forward.frame;
            let sin = sample_sine(kappa, frame.sin, frame.cos, [u[1], stream.next()], stream);
            let w = frame.direction(sin, PI + forward.sigma[channel] * normal(u[2]));
            let (value, pdf) = self.forward_value(forward, w);
            let pdf = pdf * self.forward_chance;
            return (pdf > 0.0).then(|| Continuation {
                direction: w,
                weight: value / pdf,
                pdf,
                shares: LobeValues { f: Rgb::ONE, ..LobeValues::default() },
                start: self.forward_start(),
            });
        }
        let node = self.node.as_ref()?;
        let at_node = 1.0 - self.forward_chance;
        let again = (u[0] - self.forward_chance) / at_node;
        let start = self.node_start();
        if again < self.drawn.escape {
            let NodeValue { r, tt, d, pdf, .. } = self.drawn.value;
            let pdf = pdf * at_node * self.drawn.escape;
            let sum = r + tt + d;
            let share = |lobe: Rgb| lobe / sum.max(Rgb::splat(1e-30));
            return (pdf > 0.0).then(|| Continuation {
                direction: self.drawn.direction,
                weight: sum / pdf,
                pdf,
                shares: LobeValues { r: share(r), tt: share(tt), d: share(d), ..LobeValues::default() },
                start,
            });
        }
        let backward = self.backward(node);
        let shares = LobeValues { b: Rgb::ONE, ..LobeValues::default() };
        let chance = at_node * backward.chance;
        let (direction, value, pdf) = match &backward.again {
            None => {
                let w = backward.draw(stream);
                let (value, pdf) = self.backward_value(backward, node.ply, w);
                (w, value, pdf)
            }
            Some(again) if stream.next() < again.open => {
                (again.direction, again.weight * again.pdf, again.pdf * again.open)
            }
            Some(again) => {
                let frame = &backward.frame;
                let sin = sample_sine_diffuse([u[1], stream.next()]);
                let w = frame.direction(sin, TAU * u[2]);
                let even = even_over_fibers((1.0 - sin * sin).max(0.0).sqrt());
                (w, again.energy * even, even * (1.0 - again.open))
            }
        };
        let pdf = pdf * chance;
        (pdf > 0.0).then(|| Continuation { direction, weight: value / pdf, pdf, shares, start })
    }

    /// Depth (x of the section) from which light of the node's lobes and of B leaves.
    #[inline]
    pub fn node_start(&self) -> f32 {
        self.node.map_or(self.section.enter, |n| n.point.x)
    }

    /// Depth from which light of F leaves: the middle of the fibres on the chord.
    #[inline]
    pub fn forward_start(&self) -> f32 {
        self.forward.as_ref().map_or(self.section.enter, |f| f.middle)
    }

    #[inline]
    fn backward_value(&self, backward: &Backward, ply: usize, w: Vec3A) -> (Rgb, f32) {
        let optics = &self.yarn.plies[ply];
        let (at, cos) = backward.frame.latitudes(w);
        let across = (w.dot(backward.frame.x), w.dot(backward.frame.y));
        let length = (across.0 * across.0 + across.1 * across.1).sqrt().max(1e-12);
        let lean = (across.0 * backward.lean_to.0 + across.1 * backward.lean_to.1) / length;
        let m = if backward.mirrored > 0.0 { kernel_scalar(backward.kappa, at) } else { 0.0 };
        let even = cos * (0.5 * FRAC_1_PI);
        let latitude = optics.mirrored * (m - DIFFUSE) + DIFFUSE;
        let value = backward.energy * latitude * (optics.lean * lean + 1.0) * even;
        let pdf = (backward.mirrored * (m - DIFFUSE) + DIFFUSE) * (backward.lean * lean + 1.0) * even;
        (value, pdf)
    }

    #[inline]
    fn forward_value(&self, forward: &Forward, w: Vec3A) -> (Rgb, f32) {
        let (at, cos) = forward.frame.latitudes(w);
        let m = kernel(forward.kappa, at) * cos;
        if m.max_channel() < 1e-12 {
            return (Rgb::ZERO, 0.0);
        }
        let off = w.dot(forward.frame.y).atan2(w.dot(forward.frame.x)) - PI;
        let around = Rgb::from(forward.sigma.map(|s| wrapped_normal(off, s)));
        let density = m * around;
        let pdf = (density * Rgb::from(forward.channel)).mean() * 3.0;
        let value = forward.energy * density;
        if density.max_channel() < FORWARD_TAIL {
            return (value, pdf);
        }
        let far_half = forward.far_half.get_or_init(|| forward.far_half(self.yarn, self.section, self.camera));
        match far_half {
            Some(far_half) => (value * forward.gain(far_half, self.yarn, self.section, w), pdf),
            None => (value, pdf),
        }
    }
}

impl Backward {
    /// Draws a direction from the lobe.
    #[inline]
    fn draw(&self, stream: &mut Stream) -> Vec3A {
        let frame = &self.frame;
        let lat = [stream.next(), stream.next()];
        let sin = if stream.next() < self.mirrored {
            sample_sine(self.kappa, frame.sin, frame.cos, lat, stream)
        } else {
            sample_sine_diffuse(lat)
        };
        // Azimuth with density (1 + lean cos(phi - phi0)) / 2 pi: uniform, then folded towards the front.
        let mut phi = TAU * stream.next();
        if stream.next() < self.lean && stream.next() > 0.5 * (1.0 + sin_cos(phi).1) {
            phi = PI - phi;
        }
        // Turned by phi0.
        let (s, c) = sin_cos(phi);
        let (c0, s0) = self.lean_to;
        let cos = (1.0 - sin * sin).max(0.0).sqrt();
        cos * ((c * c0 - s * s0) * frame.x + (s * c0 + c * s0) * frame.y) + sin * frame.z
    }
}

/// Density per steradian of the diffuse lobe about an axis, by the cosine of the latitude: (2/pi) cos / 2 pi.
#[inline]
fn even_over_fibers(cos: f32) -> f32 {
    DIFFUSE * cos * (0.5 * FRAC_1_PI)
}

impl Forward {
    #[inline]
    #[allow(clippy::too_many_arguments, reason = "one step of the vertex's constructor")]
    fn new(
        yarn: &AggregatedYarn,
        section: &Section,
        crossings: &Crossings,
        camera: Vec3A,
        passed: Rgb,
        chain: Rgb,
        unscattered: f32,
        weight: Rgb,
        scattered: f32,
    ) -> Option<Self> {
        let energy = (passed - unscattered).max(Rgb::ZERO);
        let front = crossings.first()?;
        // Below this the lobe cannot be told from zero in an image, and its shape is all cancellation.
        if energy.max_channel() < 1e-7 {
            return None;
        }
        let optics = &yarn.plies[front.ply];
        // Mean number of TT events of light that had at least one: k / (1 - e^-k).
        let events = chain.select_below(1e-6, Rgb::ONE, chain / chain.one_minus_exp_neg().max(Rgb::splat(1e-30)));
        let sigma = (events.sqrt() * optics.beta_n).to_array();

        let fibers: f32 = crossings.iter().map(|c| c.fibers).sum();
        let mut left = 0.5 * fibers;
        let mut middle = front.enter;
        let mut half_depth = Rgb::ZERO;
        let mut half_depth_unscattered = 0.0;
        for c in crossings {
            let optics = &yarn.plies[c.ply];
            half_depth += optics.rho * (0.5 * c.fibers);
            half_depth_unscattered += optics.rho_unscattered * 0.5 * c.fibers;
            if left >= 0.0 {
                let share = if c.fibers > 0.0 { (left / c.fibers).min(1.0) } else { 1.0 };
                middle = c.enter + (c.exit - c.enter) * share;
                left -= c.fibers;
                if left == 0.0 {
                    left = -1.0;
                }
            }
        }
        Some(Self {
            frame: LobeFrame::of_ply(&yarn.shape, section, front, camera),
            energy: energy / scattered,
            channel: normalised((energy * weight).to_array()),
            kappa: kappa_of_variance(events * optics.beta_tt_squared),
            sigma,
            middle,
            fibers,
            half_depth,
            half_depth_unscattered,
            passed: energy,
            far_half: OnceCell::new(),
        })
    }

    /// The light's half of the way.
    fn far_half(&self, yarn: &AggregatedYarn, section: &Section, camera: Vec3A) -> Option<FarHalf> {
        if yarn.plain {
            return None;
        }
        let mut plain = 0.0;
        let start = Vec2::new(self.middle, section.h);
        let travel = section.travel(self.middle);
        section.chords_ahead(&yarn.shape, start, travel, -camera, PlyParts::Whole, |ply, from, to, _| {
            plain += section.squeeze() * yarn.plies[ply].sigma * (to - from);
        });
        let far_half = FarHalf {
            scale: if plain > 0.0 { (0.5 * self.fibers / plain).clamp(0.3, 2.0) } else { 1.0 },
            norm: Rgb::ONE / self.passed.max(Rgb::splat(1e-12)),
        };
        if self.passed.max_channel() <= 1e-3 {
            return Some(far_half);
        }
        // The gain must not make or lose light: over its mean, by three-point Gauss-Hermite quadrature in azimuth.
        let spread = self.sigma.iter().sum::<f32>() / 3.0;
        // Along the yarn there is no azimuth; the gain hardly hangs on the latitude.
        let latitude = (-self.frame.sin).clamp(-STEEPEST_MEAN, STEEPEST_MEAN);
        let towards = |off: f32| self.gain(&far_half, yarn, section, self.frame.direction(latitude, PI + off));
        let reach = 3f32.sqrt() * spread;
        let mean = (towards(reach) + towards(-reach)) * (1.0 / 6.0) + towards(0.0) * (2.0 / 3.0);
        // Where hardly anything seems to leave forward, the chords ahead know nothing of the few fibres there are.
        let mean = self.passed.select_below(1e-3, Rgb::ONE, mean);
        (mean.min_channel() > 1.0 / MAX_FORWARD_GAIN).then(|| FarHalf { norm: far_half.norm / mean, ..far_half })
    }

    /// F was weighed by the camera's chord alone; here its far half is that of the light's own way.
    #[inline]
    fn gain(&self, far_half: &FarHalf, yarn: &AggregatedYarn, section: &Section, w: Vec3A) -> Rgb {
        let mut depth = self.half_depth;
        let mut unscattered = self.half_depth_unscattered;
        let start = Vec2::new(self.middle, section.h);
        let travel = section.travel(self.middle);
        section.chords_ahead(&yarn.shape, start, travel, w, PlyParts::Whole, |ply, from, to, _| {
            let optics = &yarn.plies[ply];
            let fibers = far_half.scale * section.squeeze() * optics.sigma * (to - from);
            depth += optics.rho * fibers;
            unscattered += optics.rho_unscattered * fibers;
        });
        let passed = ((-depth).exp() - (-unscattered).exp()).max(Rgb::ZERO);
        (passed * far_half.norm).min(Rgb::splat(MAX_FORWARD_GAIN))
    }
}

#[cfg(test)]
mod tests;
