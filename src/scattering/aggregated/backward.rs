//! Lobe B: light that was scattered more than once (docs/model.md, section 7).

use std::{cell::OnceCell, f32::consts::FRAC_1_PI};

use glam::{Vec2, Vec3A};

use super::{
    super::{
        escape::Outwards,
        kernel::{DIFFUSE, normalised_kernel, sample_sine, sample_sine_diffuse},
        lobe::LobeFrame,
        medium::PlyOptics,
        mis_weight,
    },
    View,
    single::Node,
};
use crate::math::{Rgb, sampler::Stream};

/// Multiply scattered light of a vertex, made when first asked for: a path that goes on from the node may never do.
#[derive(Clone, Debug)]
pub(super) struct Backward {
    lobe: OnceCell<Lobe>,
    /// What is random about it.
    stream: Stream,
}

/// Multiply scattered light of the node's ply.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lobe {
    frame: LobeFrame,
    /// The axes against which azimuths count, as unit vectors across the frame's.
    axes: [Vec2; 2],
    /// Where to it leaves.
    outwards: Outwards,
    /// Energy that leaves the node's ply, given the direction drawn.
    energy: Rgb,
    /// Chance that the node's drawn direction does not escape.
    pub(super) chance: f32,
    /// In a yarn of several plies: light that leaves the ply and meets another one.
    again: Option<Again>,
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
    /// Energy that other plies took up and give off.
    energy: Rgb,
    /// How they do, as the lobe's own.
    axes: [Vec2; 2],
    outwards: Outwards,
}

impl Backward {
    /// Nothing yet; takes a stream of its own for later.
    #[inline]
    pub(super) fn later(stream: &mut Stream) -> Self {
        Self { lobe: OnceCell::new(), stream: stream.fork() }
    }

    /// The lobe of a node, always the same one.
    #[inline]
    pub(super) fn of(&self, view: &View<'_>, node: &Node) -> &Lobe {
        self.lobe.get_or_init(|| Lobe::of_node(view, node, &mut self.stream.clone()))
    }
}

impl Lobe {
    fn of_node(view: &View<'_>, node: &Node, stream: &mut Stream) -> Self {
        let optics = &view.yarn.plies[node.spot.ply];
        let energy = node.amplitude * optics.albedo * node.leaves * (Rgb::ONE - node.drawn.value.clear);
        let (place, axes) = node.spot.place(view.yarn);
        let frame = LobeFrame::of_ply(view.yarn.occluder().shape(), view.section, &node.crossing, view.camera);
        let outwards = optics.leaving.draw(&place, stream);
        let axes = axes_across(&frame, axes);
        let mut lobe = Self { frame, axes, outwards, energy, chance: 1.0 - node.drawn.escape, again: None };
        if view.yarn.occluder().shape().plies.len() > 1 && lobe.chance > 0.0 {
            let w = lobe.draw(optics, stream);
            let (value, pdf) = lobe.value(view, node.spot.ply, w);
            if pdf > 0.0 {
                let (open, rim) = node.others(view, w, stream);
                let weight = value / pdf;
                let inside = &node.spot.inside;
                let (place, axes) = optics.leaving.place(rim.unwrap_or(Vec2::X), inside.short_axis_within());
                let outwards = optics.leaving.draw(&place, stream);
                let energy = weight * (Rgb::ONE - open) * node.leaves_again;
                let chance = node.chance_out(open, node.leaves_again);
                let axes = axes_across(&frame, axes.map(|axis| inside.out_of(axis)));
                lobe.again =
                    Some(Again { direction: w, weight: weight * open, pdf, open: chance, energy, axes, outwards });
            }
        }
        lobe
    }

    /// Value (with the cosine) and density, 1/steradian, of light that leaves the ply towards `w`, whatever lies there.
    #[inline]
    pub(super) fn value(&self, view: &View<'_>, ply: usize, w: Vec3A) -> (Rgb, f32) {
        let optics = &view.yarn.plies[ply];
        let (at, cos) = self.frame.latitudes(w);
        let mut latitude = Rgb::splat(DIFFUSE);
        if optics.mirrored.max_channel() > 0.0 {
            let m = normalised_kernel(optics.mirrored_kappa, optics.mirrored_factor, at);
            latitude += optics.mirrored * (m - latitude);
        }
        let around = optics.leaving.towards(self.outwards, self.azimuth(self.axes, w)) * (cos * (0.5 * FRAC_1_PI));
        (self.energy * latitude * around, latitude.mean() * around.mean())
    }

    /// Cosine and sine of the azimuth of `w` against the lobe's axes, but for a factor.
    #[inline]
    fn azimuth(&self, axes: [Vec2; 2], w: Vec3A) -> Vec2 {
        let across = Vec2::new(w.dot(self.frame.x), w.dot(self.frame.y));
        Vec2::new(across.dot(axes[0]), across.dot(axes[1]))
    }

    /// A direction by the sine of its latitude and by its azimuth against the lobe's axes.
    #[inline]
    fn direction(&self, sin: f32, azimuth: Vec2, axes: [Vec2; 2]) -> Vec3A {
        let across = azimuth.x * axes[0] + azimuth.y * axes[1];
        let cos = (1.0 - sin * sin).max(0.0).sqrt();
        cos * (across.x * self.frame.x + across.y * self.frame.y) + sin * self.frame.z
    }

    /// What comes back from other plies leaves towards `w` by the diffuse lobe about the axis: value for an energy of one, and
    /// density, per steradian.
    #[inline]
    fn sent_back(&self, view: &View<'_>, ply: usize, again: &Again, w: Vec3A) -> (Rgb, f32) {
        let around = view.yarn.plies[ply].leaving.towards(again.outwards, self.azimuth(again.axes, w));
        let value = around * (DIFFUSE * self.frame.latitudes(w).1 * (0.5 * FRAC_1_PI));
        (value, value.mean())
    }

    /// The lobe's value towards `w`, weighted against direction sampling; `open` is what the other plies let pass, `at_node`
    /// the chance that the path goes on from the node.
    #[inline]
    pub(super) fn evaluate(
        &self,
        view: &View<'_>,
        node: &Node,
        w: Vec3A,
        open: Rgb,
        at_node: f32,
        light_pdf: f32,
    ) -> Rgb {
        let (first, pdf) = self.value(view, node.spot.ply, w);
        let chance = at_node * self.chance;
        match &self.again {
            None => first * mis_weight(light_pdf, chance * pdf),
            Some(again) => {
                let goes_on = node.chance_out(open, node.leaves_again);
                let (even, even_pdf) = self.sent_back(view, node.spot.ply, again, w);
                first * open * mis_weight(light_pdf, chance * goes_on * pdf)
                    + again.energy * even * mis_weight(light_pdf, chance * (1.0 - again.open) * even_pdf)
            }
        }
    }

    /// Draws a direction: with its value, and its density with the chance of B.
    #[inline]
    pub(super) fn sample(&self, view: &View<'_>, node: &Node, u: [f32; 2], stream: &mut Stream) -> (Vec3A, Rgb, f32) {
        let (direction, value, pdf) = match &self.again {
            None => {
                let w = self.draw(&view.yarn.plies[node.spot.ply], stream);
                let (value, pdf) = self.value(view, node.spot.ply, w);
                (w, value, pdf)
            }
            Some(again) if stream.next() < again.open => {
                (again.direction, again.weight * again.pdf, again.pdf * again.open)
            }
            Some(again) => {
                let sin = sample_sine_diffuse(u);
                let w = self.direction(
                    sin,
                    view.yarn.plies[node.spot.ply].leaving.azimuth(again.outwards, stream),
                    again.axes,
                );
                let (even, pdf) = self.sent_back(view, node.spot.ply, again, w);
                (w, again.energy * even, pdf * (1.0 - again.open))
            }
        };
        (direction, value, pdf * self.chance)
    }

    /// Draws a direction from the lobe.
    #[inline]
    fn draw(&self, optics: &PlyOptics, stream: &mut Stream) -> Vec3A {
        let frame = &self.frame;
        let lat = [stream.next(), stream.next()];
        // A channel, and then the share of its lobe.
        let at = 3.0 * stream.next();
        let channel = (at as usize).min(2);
        let sin = if at - (channel as f32) < optics.mirrored.to_array()[channel] {
            sample_sine(optics.mirrored_kappa.to_array()[channel], frame.sin, frame.cos, lat, stream)
        } else {
            sample_sine_diffuse(lat)
        };
        self.direction(sin, optics.leaving.azimuth(self.outwards, stream), self.axes)
    }
}

/// Two axes across a ply, which stand square on each other, as unit vectors across a lobe's frame.
#[inline]
fn axes_across(frame: &LobeFrame, axes: [Vec3A; 2]) -> [Vec2; 2] {
    let across = |axis: Vec3A| Vec2::new(axis.dot(frame.x), axis.dot(frame.y));
    let zero = across(axes[0]).normalize_or(Vec2::X);
    let side = zero.perp();
    [zero, if side.dot(across(axes[1])) < 0.0 { -side } else { side }]
}
