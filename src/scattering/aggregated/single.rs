//! Lobes R, TT and D: light that ends its chain at a node and leaves from there (docs/model.md, section 6).

use std::{
    cell::OnceCell,
    f32::consts::{FRAC_1_PI, TAU},
};

use glam::Vec3A;

use super::{
    super::{
        LobeValues,
        escape::Light,
        kernel::{DIFFUSE, Latitudes, kappa_of_spread, kernel, sample_sine, sample_sine_diffuse},
        lobe::{LobeFrame, choose, normalised},
        medium::PlyOptics,
    },
    Spot, Turned, View,
    ahead::{FibersAhead, PliesAhead, plies_ahead},
    forward::ChainEnd,
    way_in::{WayBack, WayIn},
};
use crate::{
    geometry::{after_fiber::AfterTurn, section::PlyCrossing},
    math::{Rgb, sampler::Stream},
};

/// Fibres more than counted on the camera's side by which the node's lobes are widened for sampling, so that the
/// light's side, unknown then, does not make the true lobe wider than the sampled one.
const SAMPLING_WIDENING: f32 = 1.2;

/// A place inside a ply where light ends its chain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) spot: Spot,
    /// The camera's ray in the ply.
    pub(super) crossing: PlyCrossing,
    /// Of light from the camera, as of a chain's end.
    pub(super) axial: f32,
    /// Sine and cosine of its latitude against the fibre.
    sin: f32,
    cos: f32,
    /// How the light came here.
    pub(super) way_in: WayIn,
    /// Weight of an event here, before any albedo.
    pub(super) amplitude: Rgb,
    /// For sampling: widths of R that met TT on its way and of R that did not, and of TT.
    kappa: Rgb,
    /// Chances of these, and of D.
    chance: [f32; 4],
    /// Throughput times amplitude and albedo: what decides between escape and B.
    pub(super) weight: Rgb,
    /// Of light that meets another fibre after this one: the share that leaves the ply at last.
    pub(super) leaves: Rgb,
    /// Of light that leaves the ply and meets a fibre of another one: the share that leaves the yarn at last.
    pub(super) leaves_again: Rgb,
    /// A direction drawn from the lobes.
    pub(super) drawn: Drawn,
}

/// The node of a vertex, drawn when first asked for: a path that goes on as F asks for none unless light is sampled there.
#[derive(Clone, Debug)]
pub(super) struct LateNode {
    end: Option<ChainEnd>,
    /// The path's weight.
    weight: Rgb,
    u: [f32; 2],
    stream: Stream,
    node: OnceCell<Option<Node>>,
}

impl LateNode {
    /// Nothing yet, of the arguments of [`Node::draw`].
    #[inline]
    pub(super) fn new(end: Option<ChainEnd>, weight: Rgb, u: [f32; 2], stream: Stream) -> Self {
        Self { end, weight, u, stream, node: OnceCell::new() }
    }

    /// The node, always the same one.
    #[inline]
    pub(super) fn get(&self, view: &View<'_>) -> Option<&Node> {
        let draw = || Node::draw(view, self.end.as_ref()?, self.weight, self.u, &mut self.stream.clone());
        self.node.get_or_init(draw).as_ref()
    }
}

/// A direction of the node's lobes, their value there (with the way out), and the chance to escape.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drawn {
    pub(super) direction: Vec3A,
    pub(super) value: NodeValue,
    pub(super) escape: f32,
}

/// The node's lobes in one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct NodeValue {
    pub(super) r: Rgb,
    pub(super) tt: Rgb,
    pub(super) d: Rgb,
    /// Density of sampling, without the chance to escape.
    pub(super) pdf: f32,
    /// e^-optical depth.
    pub(super) clear: Rgb,
    /// e^-optical depth of the other plies alone.
    pub(super) open: Rgb,
}

impl NodeValue {
    const NOTHING: Self = Self { r: Rgb::ZERO, tt: Rgb::ZERO, d: Rgb::ZERO, pdf: 0.0, clear: Rgb::ONE, open: Rgb::ONE };

    /// The lobes together, and the share of each.
    #[inline]
    pub(super) fn lobes(&self) -> (Rgb, LobeValues) {
        let sum = self.r + self.tt + self.d;
        let inverse = Rgb::ONE / sum.max(Rgb::splat(1e-30));
        let shares =
            LobeValues { r: self.r * inverse, tt: self.tt * inverse, d: self.d * inverse, ..Default::default() };
        (sum, shares)
    }
}

impl Node {
    /// The node at a chain's end, with a direction drawn from its lobes. `None` if its fibres are black.
    #[inline]
    pub(super) fn draw(view: &View<'_>, end: &ChainEnd, weight: Rgb, u: [f32; 2], stream: &mut Stream) -> Option<Self> {
        let mut node = Self::at(view, end, weight);
        if node.chance.iter().sum::<f32>() <= 0.0 {
            return None;
        }
        // Before rejection sampling takes an unknown number of them: a stream's first numbers may be the even ones, and
        // what lies in the way of the azimuth makes most of the noise under a wide light.
        let [u_azimuth, u_lobe] = [stream.next(), stream.next()];
        let lobe = choose(node.chance, u_lobe);
        let sin = match node.kappa.to_array().get(lobe) {
            Some(kappa) => sample_sine(*kappa, node.sin, node.cos, u, stream),
            None => sample_sine_diffuse(u),
        };
        let frame = LobeFrame::new(node.spot.tangent, view.camera);
        let direction = frame.direction(sin, TAU * u_azimuth);
        let value = node.toward(view, direction);
        node.drawn = Drawn { direction, value, escape: node.escape_chance(value.clear) };
        Some(node)
    }

    /// The node at a chain's end, without a direction.
    #[inline]
    pub(super) fn at(view: &View<'_>, end: &ChainEnd, throughput: Rgb) -> Self {
        let ChainEnd { spot, way_in, crossing, axial, amplitude } = *end;
        let before = way_in.before;
        let optics = &view.yarn.plies[spot.ply];
        let sin = (axial * spot.inside.along(spot.tangent)).clamp(-1.0, 1.0);
        let weight = throughput * amplitude;
        let leaves = optics.leaving.share(Light::Onward, &spot.place(view).0);
        let widening = Rgb::splat(SAMPLING_WIDENING);
        let (untouched, spread) = optics.touched(before, widening, None);
        let lobes =
            [optics.single_r * (Rgb::ONE - untouched), optics.single_r * untouched, optics.single_tt, optics.single_d];
        let once_more =
            optics.spread_tt * (1.0 + before) + (optics.events * widening).max_channel() * optics.spread_expected_tt;
        Self {
            spot,
            crossing,
            way_in,
            axial,
            sin,
            cos: (1.0 - sin * sin).sqrt(),
            amplitude,
            kappa: kappa_of_spread(Rgb::from([optics.spread_r + spread.max_channel(), optics.spread_r, once_more])),
            chance: normalised(lobes.map(|a| a.weighted_mean(weight))),
            weight: weight * optics.albedo,
            leaves,
            leaves_again: optics.leaving.entering,
            drawn: Drawn { direction: Vec3A::ZERO, value: NodeValue::NOTHING, escape: 0.0 },
        }
    }

    /// The node's lobes towards `w`, dimmed by the way out.
    #[inline]
    pub(super) fn toward(&self, view: &View<'_>, w: Vec3A) -> NodeValue {
        let optics = &view.yarn.plies[self.spot.ply];
        let way = self.way_out(view, w, |_| {});
        let Passing { clear, after, untouched } = way.passes(optics);
        let sin = w.dot(self.spot.tangent).clamp(-1.0, 1.0);
        let cos = (1.0 - sin * sin).sqrt();
        let at = Latitudes::new(self.sin, self.cos, sin, cos);
        // Chains of TT on both sides widen the lobes.
        let even = cos * (0.5 * FRAC_1_PI);
        let scale = self.amplitude * clear * even;
        let [p_touched, p_untouched, p_tt, p_d] = self.chance;
        // What is drawn from, for all three widths at once.
        let [touched, single, bent] = kernel(self.kappa, at).to_array();
        let mut value = NodeValue {
            r: Rgb::ZERO,
            tt: Rgb::ZERO,
            d: optics.single_d * scale * DIFFUSE,
            pdf: p_d * DIFFUSE,
            clear,
            open: (-way.others).exp(),
        };
        let mut r = Rgb::ZERO;
        let (untouched, spread) = optics.touched(self.way_in.before, after, untouched);
        if p_touched > 0.0 {
            r += (Rgb::ONE - untouched) * kernel(kappa_of_spread(spread + Rgb::splat(optics.spread_r)), at);
            value.pdf += p_touched * touched;
        }
        if p_untouched > 0.0 {
            r += untouched * single;
            value.pdf += p_untouched * single;
        }
        value.r = optics.single_r * scale * r;
        if p_tt > 0.0 {
            let spread = optics.events * after * optics.spread_expected_tt;
            let known = Rgb::splat((1.0 + self.way_in.before) * optics.spread_tt);
            let m = kernel(kappa_of_spread(spread + known), at);
            value.tt = optics.single_tt * scale * m;
            value.pdf += p_tt * bent;
        }
        value.pdf *= even;
        value
    }

    /// The chance, given the clearness of a direction, that light sent there counts as escaped and not as B.
    #[inline]
    pub(super) fn escape_chance(&self, clear: Rgb) -> f32 {
        self.chance_out(clear, self.leaves)
    }

    /// The chance that light goes out where `open` of it may, and of the rest `stays` goes on inside.
    #[inline]
    pub(super) fn chance_out(&self, open: Rgb, stays: Rgb) -> f32 {
        // By the channel that has most of each, so that none has a large weight.
        let out = (open * self.weight).max_channel();
        let stay = ((Rgb::ONE - open) * stays * self.weight).max_channel();
        if out + stay > 0.0 { out / (out + stay) } else { 1.0 }
    }

    /// What other plies let pass in a direction, and where light meets one of them, if it does: one of them, by the fibres in each.
    #[inline]
    pub(super) fn others(&self, view: &View<'_>, w: Vec3A, stream: &mut Stream) -> (Rgb, Option<Met>) {
        let mut among = Among::default();
        let WayOut { others, .. } = self.way_out(view, w, |fibers| among.offer(fibers, stream));
        ((-others).exp(), among.met(view, stream))
    }

    /// What lies between the node and the outside in a direction of the section's frame; `other` is told of the fibres in each other ply.
    ///
    /// The way begins as that of F does, and no other fibre is met at once
    /// ([`AfterFiber`](crate::geometry::after_fiber::AfterFiber)). Where it goes back the way that the light came, it finds what that left clear
    /// ([`WayIn`]). What TT bends into that direction set out in others about it.
    #[inline]
    fn way_out(&self, view: &View<'_>, w: Vec3A, mut other: impl FnMut(FibersAhead)) -> WayOut {
        let (yarn, spot) = (view.yarn, &self.spot);
        let shape = yarn.occluder().shape();
        let optics = &yarn.plies[spot.ply];
        let Turned { cos: turn, shift, free, beside } = spot.turned(view, self.way_in.back, w);
        let later = self.way_in.later();
        let short = spot.inside.along_short_axis(shape, spot.ply, w);
        let back = (turn < 0.0).then(|| self.way_in.seen(view, spot, (shift, w), beside));
        let direct = (back.as_ref(), optics.after.turned(later, turn, short));
        let cosine = optics.tt.cosine;
        // A mean over the directions from which TT bends light into this one.
        let from_around = back.as_ref().filter(|_| cosine < 1.0).map(|back| back.bent(cosine));
        let bent = from_around.as_ref().map(|back| (Some(back), optics.after.turned(later, turn * cosine, short)));
        let mut ahead = PliesAhead::new();
        plies_ahead(view, spot, (shift, w), Some(0.0), free, &mut ahead);
        let open = |back: Option<&WayBack>| back.map_or(1.0, WayBack::passes);
        let ways_back = [direct.0, from_around.as_ref().or(direct.0)];
        let mut out = WayOut { open: ways_back.map(open), ..WayOut::default() };
        for fibers in &ahead {
            if fibers.ply == spot.ply {
                let by_rim = shape.plies[fibers.ply].by_rim(fibers.offset);
                let uncovered = fibers.uncovered(view, &ahead);
                let depth = |(back, after): &(Option<&WayBack>, AfterTurn<'_>)| {
                    let FibersAhead { foot, tilt, ref chord, expected, .. } = *fibers;
                    let cleared = back.map_or(0.0, |back| tilt * back.cleared(chord, foot));
                    let ahead = (expected - cleared).max(0.0);
                    let [met, counted] = after.met_and_counted(ahead, by_rim);
                    optics.depth(met, counted * uncovered)
                };
                out.own += depth(&direct);
                if let Some(bent) = &bent {
                    *out.bent.get_or_insert(Rgb::ZERO) += depth(bent);
                }
            } else {
                out.others += fibers.depth(view, &ahead);
                other(*fibers);
            }
        }
        out
    }
}

/// What lies between a node and the outside, as optical depths per channel.
#[derive(Clone, Copy, Debug, Default)]
struct WayOut {
    /// In the node's ply.
    own: Rgb,
    /// There, for light that set out in another direction and that TT bends into this one, if that is another depth.
    bent: Option<Rgb>,
    /// In all other plies.
    others: Rgb,
    /// What of the light of `own` and of `bent` meets none of the fibres that it met on its way in, which they leave out.
    open: [f32; 2],
}

/// What of the light of a node gets out.
#[derive(Clone, Copy, Debug)]
struct Passing {
    clear: Rgb,
    /// The fibres that are expected on the way of what TT passes on.
    after: Rgb,
    /// The share of it that met no fibre, where that is not as [`PlyOptics::touched`] has it.
    untouched: Option<Rgb>,
}

impl WayOut {
    #[inline]
    fn passes(&self, optics: &PlyOptics) -> Passing {
        let depth = self.bent.unwrap_or(self.own) + self.others;
        let after = depth / optics.rho;
        let [open, open_bent] = self.open;
        let past_known = Rgb::ONE - (Rgb::ONE - optics.straight) * (1.0 - open_bent);
        let clear = (-depth).exp() * past_known;
        if self.bent.is_none() {
            return Passing { clear, after, untouched: None };
        }
        // Light that meets nothing is not bent.
        let unscattered = |fibers: Rgb| (-(fibers * optics.gaps.rate)).exp();
        let straight = unscattered((self.own + self.others) / optics.rho) * open;
        let clear = (straight + (clear - unscattered(after) * open_bent).max(Rgb::ZERO)).min(Rgb::ONE);
        Passing { clear, after, untouched: Some(straight / clear.max(Rgb::splat(1e-30))) }
    }
}

/// Where a way out meets a fibre of another ply.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    pub(super) ply: usize,
    /// Distance in the section.
    pub(super) distance: f32,
}

/// One of the plies on a way out, drawn by the fibres in each.
#[derive(Default)]
pub(super) struct Among {
    fibers: f32,
    drawn: Option<FibersAhead>,
}

impl Among {
    #[inline]
    pub(super) fn offer(&mut self, fibers: FibersAhead, stream: &mut Stream) {
        self.fibers += fibers.expected;
        if fibers.expected > 0.0 && stream.next() * self.fibers < fibers.expected {
            self.drawn = Some(fibers);
        }
    }

    /// Where light that goes straight on until a fibre takes it out of its way meets that one in the ply drawn, as the mean of the channels
    /// has it.
    #[inline]
    pub(super) fn met(&self, view: &View<'_>, stream: &mut Stream) -> Option<Met> {
        let fibers = self.drawn?;
        let rate = view.yarn.plies[fibers.ply].rho.mean();
        let passed = -(-stream.next() * (1.0 - (-rate * fibers.expected).exp())).ln_1p() / rate;
        Some(Met { ply: fibers.ply, distance: fibers.distance_past(passed) })
    }
}
