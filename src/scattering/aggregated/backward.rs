//! Lobe B: light that was scattered more than once (docs/model.md, section 7).

use std::{
    cell::OnceCell,
    f32::consts::{FRAC_1_PI, PI},
};

use arrayvec::ArrayVec;
use glam::{Vec2, Vec3A};
use wide::f32x8;

use super::{
    super::{
        escape::{Light, Outwards},
        kernel::{DIFFUSE, narrow_spread, sample_sine, sample_sine_diffuse},
        lobe::{LobeFrame, choose, normalised},
        medium::PlyOptics,
        mis_weight,
    },
    Spot, View,
    single::{Among, Drawn, Met, Node, NodeValue},
};
use crate::{
    geometry::section::Inside,
    math::{Rgb, sampler::Stream},
};

/// Cosines and sines of angles from -90 to 90 degrees, in the middle of eight equal parts.
const OUTLINE: [[f32; 8]; 2] = [
    [0.195_090, 0.555_570, 0.831_470, 0.980_785, 0.980_785, 0.831_470, 0.555_570, 0.195_090],
    [-0.980_785, -0.831_470, -0.555_570, -0.195_090, 0.195_090, 0.555_570, 0.831_470, 0.980_785],
];

/// How far along the yarn light that wanders about leaves at the most, in yarn radii.
const FARTHEST: f32 = 4.0;

/// Multiply scattered light of a vertex, made when first asked for: a path that goes on from the node may never do.
#[derive(Clone, Debug)]
pub(super) struct Backward {
    lobe: OnceCell<Lobe>,
    /// What is random about it.
    stream: Stream,
}

/// Multiply scattered light of the ply in which light from the node meets a fibre next.
#[derive(Clone, Debug)]
pub(super) struct Lobe {
    /// Where it begins: the node, or where light from there meets a fibre of another ply.
    spot: Spot,
    /// Whether that is another ply.
    away: bool,
    frame: LobeFrame,
    /// The axes against which azimuths count, as unit vectors across the frame's.
    axes: [Vec2; 2],
    /// Where to it leaves.
    outwards: Outwards,
    /// Energy that leaves the ply, given the direction drawn.
    energy: Rgb,
    /// What the path then has of each channel, over their mean: by this one is drawn for its direction.
    channels: Rgb,
    /// Chance that the node's drawn direction does not escape.
    pub(super) chance: f32,
    /// Draws where on a ply's outline it leaves.
    u_start: f32,
    /// In a yarn of several plies: light that leaves the ply and meets another one.
    again: Option<Again>,
}

/// Light that left the node's ply in a direction drawn from its lobe, and what other plies gave off that took it up.
#[derive(Clone, Debug)]
struct Again {
    /// At least one.
    ways: ArrayVec<Taken, 2>,
    /// Where each way that meets another ply does so. What the first gives off passes others, what the second does passes whatever
    /// lies there.
    meetings: ArrayVec<Meeting, 2>,
}

/// A direction that light took.
#[derive(Clone, Copy, Debug)]
struct Taken {
    /// Where it leaves from, in the section's frame.
    start: Vec3A,
    direction: Vec3A,
    /// Value there, past other plies, over density, and the density.
    weight: Rgb,
    pdf: f32,
    /// Chance that it goes on so.
    open: f32,
}

/// Light that a ply gives off around the place on its rim where it came.
#[derive(Clone, Copy, Debug)]
struct Meeting {
    spot: Spot,
    /// As the lobe's own.
    axes: [Vec2; 2],
    outwards: Outwards,
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
        let frame = LobeFrame::of_ply(view.yarn.occluder().shape(), view.section, &node.crossing, view.camera);
        // As the fibres have it that the light met.
        let frame = frame.with_latitude(node.axial * node.spot.inside.along(frame.z));
        let (away, left) = Meeting::away(view, &frame, node, stream);
        let energy = node.amplitude * optics.albedo * left;
        let weight = node.weight * left;
        let channels = if weight.mean() > 1e-30 { weight * weight.mean().recip() } else { Rgb::ONE };
        let (spot, axes, outwards) = match &away {
            Some(Meeting { spot, axes, outwards, .. }) => (*spot, *axes, *outwards),
            None => {
                let (place, axes) = node.spot.place(view);
                let swirl = Vec2::from_angle(optics.swirl(-node.axial));
                let axes = axes_across(&frame, axes).map(|axis| swirl.rotate(axis));
                (node.spot, axes, optics.leaving.draw(Light::Onward, &place, stream))
            }
        };
        let (u_start, chance) = (stream.next(), 1.0 - node.drawn.escape);
        let away = away.is_some();
        let mut lobe = Self { spot, away, frame, axes, outwards, energy, channels, chance, u_start, again: None };
        if view.yarn.occluder().shape().plies.len() > 1 && lobe.chance > 0.0 {
            lobe.again = lobe.again(view, node, stream);
        }
        lobe
    }

    /// Value (with the cosine) and density, 1/steradian, of light that leaves the ply towards `w`, whatever lies there.
    #[inline]
    pub(super) fn value(&self, view: &View<'_>, w: Vec3A) -> (Rgb, f32) {
        let optics = &view.yarn.plies[self.spot.ply];
        let (arriving, spread) = self.arriving(view, w);
        let (at, cos) = arriving.latitudes(w);
        let latitude = optics.latitude_of_multiple(at, spread);
        let around =
            optics.leaving.towards(self.outwards, azimuth(&self.frame, self.axes, w)) * (cos * (0.5 * FRAC_1_PI));
        let share = latitude * around;
        (self.energy * share, share.weighted_mean(self.channels))
    }

    /// Where light that has wandered about in the ply of a place leaves it towards `w`, in the section's frame: on the part of its outline
    /// that faces there, by e^(-k d) / (d^2 + l^2) of the distance d from the place. That is Poisson's kernel, by which light that spreads
    /// from a point reaches a circle, with a mean way l and with what is lost on the way. Meanwhile it gets on along the ply, in about the
    /// latitude in which it leaves ([`PlyOptics::along`]).
    pub(super) fn start(&self, view: &View<'_>, spot: &Spot, w: Vec3A) -> Vec3A {
        let shape = view.yarn.occluder().shape();
        let (facing, shares) = outline(view, spot, w);
        let mut left = self.u_start * shares.reduce_add();
        let mut drawn = OUTLINE[0].len() as f32;
        for (part, share) in shares.to_array().into_iter().enumerate() {
            if left < share {
                drawn = part as f32 + left / share;
                break;
            }
            left -= share;
        }
        let angle = PI * (drawn / OUTLINE[0].len() as f32 - 0.5);
        let direction = Vec2::from_angle(angle).rotate(facing);
        let across = (spot.inside.outline(shape, spot.ply, direction) - spot.inside.point).length();
        let along = spot.inside.along(w);
        let slope = along / (1.0 - along * along).max(1e-6).sqrt();
        let travel = view.yarn.plies[spot.ply].along * across * slope;
        spot.inside.outline_along(shape, view.section, spot.ply, direction, travel.clamp(-FARTHEST, FARTHEST))
    }

    /// The frame with the latitude that light had which leaves towards the azimuth of `w`, as the fibres have it that it leaves from; and by how
    /// much that is spread ([`spread`](super::super::kernel::spread)).
    ///
    /// What the fibres of a ply mirror keeps its part along them ([`Spot::axial`]), which differs from that along the axis by how far from the
    /// axis the light passes it.
    #[inline]
    fn arriving(&self, view: &View<'_>, w: Vec3A) -> (LobeFrame, f32) {
        let LobeFrame { sin, z, .. } = self.frame;
        let slope = view.yarn.plies[self.spot.ply].slope;
        if slope == 0.0 {
            return (self.frame, 0.0);
        }
        let (_, shares) = outline(view, &self.spot, w - w.dot(z) * z);
        let beside = f32x8::new(OUTLINE[1]);
        let inverse = shares.reduce_add().max(1e-30).recip();
        let mean = (shares * beside).reduce_add() * inverse;
        let off = beside - f32x8::splat(mean);
        let variance = (shares * off * off).reduce_add() * inverse;
        // One half of the outline or the other: each has a quarter of an even distribution's variance, and the middles have the rest.
        const OF_HALF: f32 = 0.25;
        let side = if self.u_start < 0.5 { -1.0 } else { 1.0 };
        let lean = -slope * (mean + side * ((1.0 - OF_HALF) * variance).sqrt());
        // By how much fibres lean there, towards the light: about them it leaves in the latitude in which it came.
        let lean = Vec2::new(1.0, lean).normalize();
        let about = (sin * lean.x).clamp(-1.0, 1.0);
        let arriving = self.frame.with_latitude(about * lean.x + (1.0 - about * about).sqrt() * lean.y);
        // theta_h turns by half as much.
        let spread = narrow_spread(0.25 * OF_HALF * slope * slope * variance);
        (arriving, spread)
    }

    /// From a place to where other plies are counted of light that wandered about from there and leaves from `start` ([`Self::start`]). Where
    /// plies lie in each other it has left some of theirs behind by then: halfway to where it leaves its own.
    fn come_by_then(view: &View<'_>, spot: &Spot, start: impl FnOnce() -> Vec3A) -> Vec3A {
        const COME: f32 = 0.5;
        if view.yarn.plies_overlap { COME * (start() - spot.inside.point) } else { Vec3A::ZERO }
    }

    /// What plies other than that of a place let pass of light that wandered about from there and leaves towards `w`.
    fn open(&self, view: &View<'_>, spot: &Spot, w: Vec3A) -> Rgb {
        let shift = Self::come_by_then(view, spot, || self.start(view, spot, w));
        (-spot.past_own(view, shift, w, |_| {})).exp()
    }

    /// Follows a direction of light that leaves the ply, and one of what the next ply gives off.
    fn again(&self, view: &View<'_>, node: &Node, stream: &mut Stream) -> Option<Again> {
        let w = self.draw(view, stream);
        let (value, pdf) = self.value(view, w);
        let start = self.start(view, &self.spot, w);
        let shift = Self::come_by_then(view, &self.spot, || start);
        let (open, met) = match self.away || view.yarn.plies_overlap {
            true => others_past(view, &self.spot, (shift, w), stream),
            false => node.others(view, w, stream),
        };
        let (way, rest) = Taken::new(node, (start, w, value, pdf), open)?;
        let mut again = Again { ways: ArrayVec::from_iter([way]), meetings: ArrayVec::new() };
        if rest.max_channel() <= 0.0 {
            return Some(again);
        }
        let met = met.unwrap_or(Met { ply: self.spot.ply, distance: 0.0 });
        let from = (&self.spot.inside, shift, w, met);
        let first = Meeting::new(view, &self.frame, from, (rest, Light::Met), stream);
        let w = first.draw(view, &self.frame, stream);
        let (value, pdf) = first.value(view, &self.frame, w);
        let start = self.start(view, &first.spot, w);
        let shift = Self::come_by_then(view, &first.spot, || start);
        let (open, met) = others_past(view, &first.spot, (shift, w), stream);
        again.meetings.push(first);
        let Some((way, rest)) = Taken::new(node, (start, w, value, pdf), open) else { return Some(again) };
        again.ways.push(way);
        if rest.max_channel() > 0.0 {
            let met = met.unwrap_or(Met { ply: first.spot.ply, distance: 0.0 });
            let from = (&first.spot.inside, shift, w, met);
            again.meetings.push(Meeting::new(view, &self.frame, from, (rest, Light::MetForGood), stream));
        }
        Some(again)
    }

    /// The lobe's value towards `w`, weighted against direction sampling, by the places from which it leaves; `open` is what the other
    /// plies let pass from the node, `at_node` the chance that the path goes on from the node.
    #[inline]
    pub(super) fn evaluate(
        &self,
        view: &View<'_>,
        node: &Node,
        (w, light_pdf): (Vec3A, f32),
        open: Rgb,
        at_node: f32,
        mut visit: impl FnMut(&Spot, Rgb),
    ) {
        let (first, pdf) = self.value(view, w);
        let chance = at_node * self.chance;
        match &self.again {
            None => visit(&self.spot, first * mis_weight(light_pdf, chance * pdf)),
            Some(again) => {
                let open = if self.away || view.yarn.plies_overlap { self.open(view, &self.spot, w) } else { open };
                let goes_on = |open: Rgb| node.chance_out(open, node.leaves_again);
                visit(&self.spot, first * open * mis_weight(light_pdf, chance * goes_on(open) * pdf));
                let mut left = chance * (1.0 - again.ways[0].open);
                for (i, meeting) in again.meetings.iter().enumerate() {
                    let (value, pdf) = meeting.value(view, &self.frame, w);
                    let Some(next) = again.ways.get(i + 1) else {
                        visit(&meeting.spot, value * mis_weight(light_pdf, left * pdf));
                        break;
                    };
                    if value.max_channel() > 0.0 {
                        let open = self.open(view, &meeting.spot, w);
                        visit(&meeting.spot, value * open * mis_weight(light_pdf, left * goes_on(open) * pdf));
                    }
                    left *= 1.0 - next.open;
                }
            }
        }
    }

    /// Draws a direction: with its value, its density with the chance of B, and the place from which it leaves.
    #[inline]
    pub(super) fn sample(
        &self,
        view: &View<'_>,
        node: &Node,
        u: [f32; 2],
        stream: &mut Stream,
    ) -> (Vec3A, Rgb, f32, Vec3A) {
        let (direction, value, pdf, start) = match &self.again {
            None => {
                let w = self.draw(view, stream);
                let (value, pdf) = self.value(view, w);
                (w, value, pdf, self.start(view, &self.spot, w))
            }
            Some(again) => {
                let mut chance = 1.0;
                let mut taken = None;
                for way in &again.ways {
                    if stream.next() < way.open {
                        taken = Some((way.direction, way.weight * way.pdf, way.pdf * way.open * chance, way.start));
                        break;
                    }
                    chance *= 1.0 - way.open;
                }
                taken.unwrap_or_else(|| match again.meetings.get(again.ways.len() - 1) {
                    Some(last) => {
                        let w = last.draw_by(view, &self.frame, u, stream);
                        let (value, pdf) = last.value(view, &self.frame, w);
                        (w, value, pdf * chance, self.start(view, &last.spot, w))
                    }
                    None => (Vec3A::Z, Rgb::ZERO, 0.0, node.spot.inside.point),
                })
            }
        };
        (direction, value, pdf * self.chance, start)
    }

    /// Draws a direction from the lobe.
    #[inline]
    fn draw(&self, view: &View<'_>, stream: &mut Stream) -> Vec3A {
        let optics = &view.yarn.plies[self.spot.ply];
        let lat = [stream.next(), stream.next()];
        let channel = choose(normalised(self.channels.to_array()), stream.next());
        let around = optics.leaving.azimuth(self.outwards, |value| value.to_array()[channel], stream);
        let mut left = stream.next();
        let lobe = optics.mirrored.iter().find(|lobe| {
            left -= lobe.share.to_array()[channel];
            left < 0.0
        });
        let sin = match lobe {
            Some(lobe) => {
                let (LobeFrame { sin, cos, .. }, spread) =
                    self.arriving(view, direction(&self.frame, 0.0, around, self.axes));
                sample_sine(lobe.kappa(spread).to_array()[channel], sin, cos, lat, stream)
            }
            None => sample_sine_diffuse(lat),
        };
        direction(&self.frame, sin, around, self.axes)
    }
}

impl Taken {
    /// Light of a start, direction, value and density, which other plies let pass so far, and what they do not. `None` if there is none.
    fn new(node: &Node, (start, direction, value, pdf): (Vec3A, Vec3A, Rgb, f32), open: Rgb) -> Option<(Self, Rgb)> {
        let weight = (pdf > 0.0).then(|| value / pdf)?;
        let way = Self { start, direction, weight: weight * open, pdf, open: node.chance_out(open, node.leaves_again) };
        Some((way, weight * (Rgb::ONE - open)))
    }
}

impl Meeting {
    /// Where light from the node in its direction is stopped by another ply, if it is and not in its own: one or the other by chance. And of
    /// that light what leaves the ply that stops it, over the chance.
    fn away(view: &View<'_>, frame: &LobeFrame, node: &Node, stream: &mut Stream) -> (Option<Self>, Rgb) {
        let Drawn { direction, value: NodeValue { clear, open, .. }, .. } = node.drawn;
        let out_of_own = (clear / open.max(Rgb::splat(1e-30))).min(Rgb::ONE);
        let stays = node.leaves * (Rgb::ONE - out_of_own);
        let goes = out_of_own * (Rgb::ONE - open);
        if goes.max_channel() <= 0.0 {
            return (None, stays);
        }
        let [at_home, elsewhere] = [stays, goes * node.leaves_again].map(|left| (node.weight * left).mean());
        let chance = elsewhere / (at_home + elsewhere).max(1e-30);
        if stream.next() >= chance {
            return (None, stays * (1.0 - chance).max(1e-30).recip());
        }
        let (_, met) = node.others(view, direction, stream);
        let met = met.unwrap_or(Met { ply: node.spot.ply, distance: 0.0 });
        let from = (&node.spot.inside, Vec3A::ZERO, direction, met);
        let there = Self::new(view, frame, from, (goes, Light::Met), stream);
        let left = there.energy * chance.max(1e-30).recip();
        (Some(there), left)
    }

    /// Where so much light meets a ply that set out towards `w` at `shift` from a place.
    fn new(
        view: &View<'_>,
        frame: &LobeFrame,
        (from, shift, w, met): (&Inside, Vec3A, Vec3A, Met),
        (arrives, light): (Rgb, Light),
        stream: &mut Stream,
    ) -> Self {
        let shape = view.yarn.occluder().shape();
        let leaving = &view.yarn.plies[met.ply].leaving;
        let inside = view.section.beyond(shape, from, shift, w, met.distance);
        let spot = Spot::new(view, met.ply, inside);
        let (place, axes) = spot.place_met(view, -spot.across(w).normalize_or_zero());
        Self {
            axes: axes_across(frame, axes),
            outwards: leaving.draw(light, &place, stream),
            energy: arrives * leaving.share(light, &place),
            spot,
        }
    }

    /// Value (with the cosine) and density, 1/steradian, of light that leaves the ply towards `w`, whatever lies there: by the
    /// diffuse lobe about the node's axis.
    #[inline]
    fn value(&self, view: &View<'_>, frame: &LobeFrame, w: Vec3A) -> (Rgb, f32) {
        let around = view.yarn.plies[self.spot.ply].leaving.towards(self.outwards, azimuth(frame, self.axes, w));
        let value = around * (DIFFUSE * frame.latitudes(w).1 * (0.5 * FRAC_1_PI));
        (self.energy * value, value.mean())
    }

    fn draw(&self, view: &View<'_>, frame: &LobeFrame, stream: &mut Stream) -> Vec3A {
        self.draw_by(view, frame, [stream.next(), stream.next()], stream)
    }

    #[inline]
    fn draw_by(&self, view: &View<'_>, frame: &LobeFrame, u: [f32; 2], stream: &mut Stream) -> Vec3A {
        let around = view.yarn.plies[self.spot.ply].leaving.azimuth(self.outwards, Rgb::mean, stream);
        direction(frame, sample_sine_diffuse(u), around, self.axes)
    }
}

/// What plies other than that of a place let pass on a way, by its shift from there and its direction, and where light meets one of them, if
/// it does: as [`Node::others`] has it of the node's.
fn others_past(view: &View<'_>, spot: &Spot, (shift, w): (Vec3A, Vec3A), stream: &mut Stream) -> (Rgb, Option<Met>) {
    let mut among = Among::default();
    let depth = spot.past_own(view, shift, w, |fibers| among.offer(fibers, stream));
    ((-depth).exp(), among.met(view, stream))
}

/// The side of a ply's outline that faces a direction, in the axes of [`Inside::in_ply`], and how much of the light leaves there from each part
/// of it: see [`Lobe::start`].
#[inline]
fn outline(view: &View<'_>, spot: &Spot, w: Vec3A) -> (Vec2, f32x8) {
    let PlyOptics { mean_way, fading, .. } = view.yarn.plies[spot.ply];
    let shape = view.yarn.occluder().shape();
    let facing = spot.inside.facing(shape, spot.ply, w);
    let at = spot.inside.in_ply(shape, spot.ply);
    let [ahead, beside] = [at.dot(facing), facing.perp_dot(at)].map(f32x8::splat);
    let [cos, sin] = OUTLINE.map(f32x8::new);
    let (x, y) = (cos - ahead, sin - beside);
    let square = x * x + y * y;
    let shares = cos * (square.sqrt() * f32x8::splat(-fading)).exp() / (square + f32x8::splat(mean_way * mean_way));
    (facing, shares)
}

/// Cosine and sine of the azimuth of `w` against axes across a lobe's frame, but for a factor.
#[inline]
fn azimuth(frame: &LobeFrame, axes: [Vec2; 2], w: Vec3A) -> Vec2 {
    let across = Vec2::new(w.dot(frame.x), w.dot(frame.y));
    Vec2::new(across.dot(axes[0]), across.dot(axes[1]))
}

/// A direction by the sine of its latitude and by its azimuth against axes across a lobe's frame.
#[inline]
fn direction(frame: &LobeFrame, sin: f32, azimuth: Vec2, axes: [Vec2; 2]) -> Vec3A {
    let across = azimuth.x * axes[0] + azimuth.y * axes[1];
    let cos = (1.0 - sin * sin).max(0.0).sqrt();
    cos * (across.x * frame.x + across.y * frame.y) + sin * frame.z
}

/// Two axes across a ply, which stand square on each other, as unit vectors across a lobe's frame.
#[inline]
fn axes_across(frame: &LobeFrame, axes: [Vec3A; 2]) -> [Vec2; 2] {
    let across = |axis: Vec3A| Vec2::new(axis.dot(frame.x), axis.dot(frame.y));
    let zero = across(axes[0]).normalize_or(Vec2::X);
    let side = zero.perp();
    [zero, if side.dot(across(axes[1])) < 0.0 { -side } else { side }]
}
