//! Lobe B: light that was scattered more than once (docs/model.md, section 7).

use std::{
    cell::OnceCell,
    f32::consts::{FRAC_1_PI, PI, TAU},
};

use glam::{Vec2, Vec3A};

use super::{
    super::{
        kernel::{DIFFUSE, normalised_kernel, sample_sine, sample_sine_diffuse},
        lobe::LobeFrame,
        medium::PlyOptics,
        mis_weight,
    },
    View,
    single::Node,
};
use crate::{
    geometry::{section::PlyCrossing, yarn_frame::Pressed},
    math::{Rgb, frame::sin_cos, sampler::Stream},
};

/// How strongly multiply scattered light moves sideways with the camera's offset.
const LEAN_SIDEWAYS: f32 = 1.2;

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
    /// How the section is pressed flat, if it is.
    flat: Option<Flat>,
    /// Unit vector across the axis towards which it leans, before [`Flat::turn`].
    lean_to: Vec2,
    /// The share that leans.
    pub(super) lean: Rgb,
    /// Energy that leaves the node's ply, given the direction drawn.
    energy: Rgb,
    /// Chance that the node's drawn direction does not escape.
    pub(super) chance: f32,
    /// In a yarn of several plies: light that leaves the ply and meets another one.
    again: Option<Again>,
    /// Channel mean of `lean`, for sampling.
    mean_lean: f32,
}

/// Light leaves a section that is pressed flat mostly through its broad sides: as much as is seen of them. Azimuths of a round
/// section, turned as by a map that makes a circle an ellipse, come near to that: towards the short axis of a section of the
/// ratio a : b there is a / b times as much as towards the long one.
#[derive(Clone, Copy, Debug)]
struct Flat {
    /// The short axis against x and y of the lobe's frame.
    axis: Vec2,
    /// Fourth root of long over short axis.
    fourth: f32,
}

impl Flat {
    /// Where the pressed section sends what a round one sends towards a unit vector across the axis.
    #[inline]
    fn turn(&self, round: Vec2) -> Vec2 {
        let inverse = self.fourth.recip();
        (round * inverse + (self.fourth - inverse) * round.dot(self.axis) * self.axis).normalize_or(round)
    }

    /// The inverse of [`Self::turn`], and how much denser azimuths lie here than they do there.
    #[inline]
    fn unturn(&self, pressed: Vec2) -> (Vec2, f32) {
        let inverse = self.fourth.recip();
        let round = pressed * self.fourth + (inverse - self.fourth) * pressed.dot(self.axis) * self.axis;
        let square = round.length_squared().max(1e-12);
        (round / square.sqrt(), square.recip())
    }
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
        let short_axis = node.spot.inside.short_axis();
        let mut lobe = Self::new(view, &node.crossing, short_axis, energy, 1.0 - node.drawn.escape);
        if view.yarn.occluder().shape().plies.len() > 1 && lobe.chance > 0.0 {
            let w = lobe.draw(optics, stream);
            let (value, pdf) = lobe.value(view, node.spot.ply, w);
            if pdf > 0.0 {
                let open = (-node.optical_depth(view, w).1).exp();
                let weight = value / pdf;
                let energy = weight * (Rgb::ONE - open) * node.leaves_again;
                let chance = open_chance(node, open);
                lobe.again = Some(Again { direction: w, weight: weight * open, pdf, open: chance, energy });
            }
        }
        lobe
    }

    /// Lobe B of a ply, for a given energy and chance of sampling; `short_axis` is that of the yarn's section, if it is pressed
    /// flat.
    #[inline]
    pub(super) fn new(
        view: &View<'_>,
        crossing: &PlyCrossing,
        short_axis: Option<(Vec3A, Pressed)>,
        energy: Rgb,
        chance: f32,
    ) -> Self {
        let shape = view.yarn.occluder().shape();
        let optics = &view.yarn.plies[crossing.ply];
        let relative = if shape.plies.len() == 1 { crossing.offset / shape.plies[0].radius } else { view.section.h };
        let (lean_sin, lean_cos) = sin_cos(LEAN_SIDEWAYS * relative.clamp(-1.0, 1.0).asin());
        let frame = LobeFrame::of_ply(shape, view.section, crossing, view.camera);
        let flat = short_axis.map(|(axis, pressed)| {
            let axis = Vec2::new(axis.dot(frame.x), axis.dot(frame.y)).normalize_or(Vec2::X);
            Flat { axis, fourth: pressed.stretch.sqrt().sqrt() }
        });
        // It leans from where the camera is.
        let camera = flat.map_or(Vec2::X, |flat| flat.unturn(Vec2::X).0);
        let lean_to = Vec2::new(lean_cos, lean_sin).rotate(camera);
        let lean = optics.lean(view.section.squeeze() / view.section.rounded());
        Self { frame, flat, lean_to, lean, energy, chance, again: None, mean_lean: lean.mean() }
    }

    /// Value (with the cosine) and density, 1/steradian, of light that leaves the ply towards `w`, whatever lies there.
    #[inline]
    pub(super) fn value(&self, view: &View<'_>, ply: usize, w: Vec3A) -> (Rgb, f32) {
        let optics = &view.yarn.plies[ply];
        let (at, cos) = self.frame.latitudes(w);
        let (lean, dense) = self.leaning(w);
        let even = cos * (0.5 * FRAC_1_PI) * dense;
        let mut latitude = Rgb::splat(DIFFUSE);
        if optics.mirrored.max_channel() > 0.0 {
            let m = normalised_kernel(optics.mirrored_kappa, optics.mirrored_factor, at);
            latitude += optics.mirrored * (m - latitude);
        }
        let matt = off_a_matt_cylinder(lean) - 1.0;
        let value = self.energy * latitude * (self.lean * matt + 1.0) * even;
        let pdf = latitude.mean() * (self.mean_lean * lean + 1.0) * even;
        (value, pdf)
    }

    /// Cosine of the azimuth of `w` from where the lobe leans to, in a round section, and how much denser azimuths lie in this one.
    #[inline]
    pub(super) fn leaning(&self, w: Vec3A) -> (f32, f32) {
        let across = Vec2::new(w.dot(self.frame.x), w.dot(self.frame.y));
        let across = across / across.length().max(1e-12);
        let (round, dense) = self.flat.map_or((across, 1.0), |flat| flat.unturn(across));
        (round.dot(self.lean_to), dense)
    }

    /// A direction by the sine of its latitude and by its azimuth in a round section, as a unit vector across the axis.
    #[inline]
    fn direction(&self, sin: f32, round: Vec2) -> Vec3A {
        let across = self.flat.map_or(round, |flat| flat.turn(round));
        let cos = (1.0 - sin * sin).max(0.0).sqrt();
        cos * (across.x * self.frame.x + across.y * self.frame.y) + sin * self.frame.z
    }

    /// Density per steradian of the diffuse lobe about the axis: (2/pi) cos / 2 pi, as a flat section has it.
    #[inline]
    fn even(&self, w: Vec3A) -> f32 {
        DIFFUSE * self.frame.latitudes(w).1 * (0.5 * FRAC_1_PI) * self.leaning(w).1
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
                let goes_on = open_chance(node, open);
                let even = self.even(w);
                first * open * mis_weight(light_pdf, chance * goes_on * pdf)
                    + again.energy * even * mis_weight(light_pdf, chance * (1.0 - again.open) * even)
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
                let sin = sample_sine_diffuse([u[0], stream.next()]);
                let (s, c) = sin_cos(TAU * u[1]);
                let w = self.direction(sin, Vec2::new(c, s));
                let even = self.even(w);
                (w, again.energy * even, even * (1.0 - again.open))
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
        // Azimuth with density (1 + lean cos(phi - phi0)) / 2 pi: uniform, then folded towards the front.
        let mut phi = TAU * stream.next();
        if stream.next() < self.mean_lean && stream.next() > 0.5 * (1.0 + sin_cos(phi).1) {
            phi = PI - phi;
        }
        // Turned by phi0.
        let (s, c) = sin_cos(phi);
        self.direction(sin, self.lean_to.rotate(Vec2::new(c, s)))
    }
}

/// What a matt cylinder sends off, against an even azimuth, by the cosine of the angle to the light, averaged over its width:
/// (pi / 4) ((pi - angle) cos + sin).
#[inline]
pub(super) fn off_a_matt_cylinder(cos: f32) -> f32 {
    let cos = cos.clamp(-1.0, 1.0);
    (0.25 * PI * ((PI - cos.acos()) * cos + (1.0 - cos * cos).sqrt())).max(0.0)
}

/// The chance, given how open a direction is, that multiply scattered light goes on in it.
#[inline]
fn open_chance(node: &Node, open: Rgb) -> f32 {
    let out = open.weighted_mean(node.weight);
    let stay = ((Rgb::ONE - open) * node.leaves_again).weighted_mean(node.weight);
    if out + stay > 0.0 { out / (out + stay) } else { 1.0 }
}
