//! The aggregated yarn: one answer for the hundreds of fibres behind a point of a yarn. docs/model.md derives it.
//!
//! Light on its way along the camera's chord through the plies
//! * meets no fibre at all (the unscattered share T0, a delta, [`Occluder::transparency`]),
//! * or meets a first fibre. From there it passes on forward as TT through that one and all it meets on its own way out
//!   (lobe F, `forward`),
//! * or ends its chain of TT at a *node*: one of these fibres, where R, D or the wide part of TT sends it towards the
//!   light (`single`). On the way there it is dimmed by the plies ahead; what stays scatters on and leaves in the
//!   end as lobe B (`backward`).
//!
//! F takes the place of the paper's forward lobes (Eqs. 8 to 11, 15), B of its backward lobes without the single
//! scattering that R and D already hold (Eqs. 12 to 14); the paper counts that twice and can double the energy.
//!
//! # Estimation
//! A [`Vertex`] draws a first fibre and one way of F from it, a node of the fibres on that way, and one direction from that. The
//! share of F in its direction decides between F and the node, and is what the nodes' light is less; whether the node's direction
//! escapes decides between R/D/TT and B, as it would for a photon: with white fibres weights are near 1, and 1 on the mean. The directions
//! also serve as one-sample estimates of the shares that stay, so that no table of them is needed, in memory or in
//! set-up time. Each of the components (F, node lobes, B) is an integral of its own, with its own weight between light
//! sampling and direction sampling (balance heuristic), all given the places and the directions drawn.

use std::sync::Arc;

use glam::{Vec2, Vec3A};

pub use super::escape::Solutions;
use super::{
    Arrival, Continuation, Direct, LobeValues,
    escape::Place,
    fiber::FiberMaterial,
    medium::{PlyOptics, view_of_others},
    mis_weight,
};
use crate::{
    geometry::{
        occluder::{Occluder, Transparency},
        section::{Crossings, Inside, PlyCrossing, Section},
        yarn::YarnShape,
    },
    math::{
        Rgb,
        sampler::{OneOf, Stream},
    },
};
use ahead::{FibersAhead, PliesAhead, plies_ahead};
use backward::{Backward, Lobe};
use forward::Forward;
use single::LateNode;

mod ahead;
mod backward;
mod forward;
mod single;
mod way_in;

/// A yarn's shape and the optics of its plies.
#[derive(Clone, Debug)]
pub struct AggregatedYarn {
    occluder: Occluder,
    plies: Vec<PlyOptics>,
    /// Whether plies lie in each other.
    plies_overlap: bool,
    /// Expected energy of a node in each ply, for choosing between plies.
    node_gain: Vec<Rgb>,
}

impl AggregatedYarn {
    /// One material for each ply of the shape, which several yarns may share.
    ///
    /// # Panics
    /// If their numbers differ.
    pub fn new(shape: impl Into<Arc<YarnShape>>, materials: &[&FiberMaterial]) -> Self {
        Self::pressed(shape, materials, 1.0, &Solutions::default())
    }

    /// The same for a yarn that is pressed flat, to axes of `stretch` : 1 on the mean. What is solved for it is added to `solutions`, and
    /// not solved again.
    ///
    /// # Panics
    /// If there is not one material for each ply.
    pub fn pressed(
        shape: impl Into<Arc<YarnShape>>,
        materials: &[&FiberMaterial],
        stretch: f64,
        solutions: &Solutions,
    ) -> Self {
        let shape = shape.into();
        assert_eq!(shape.plies.len(), materials.len(), "one material for each ply");
        let others = view_of_others(shape.plies.len());
        let plies = shape.plies.iter().zip(materials);
        let plies: Vec<_> = plies.map(|(ply, m)| PlyOptics::new(m, ply, others, stretch, solutions)).collect();
        let node_gain = plies.iter().map(|p| p.albedo * (p.leaves_yarn + 1.0) * 0.5).collect();
        let plies_overlap = shape.plies_overlap();
        Self { occluder: Occluder::new(shape, Transparency::Gaps), plies, plies_overlap, node_gain }
    }

    /// The yarn without its colours: what rays see that only ask whether they pass.
    #[inline]
    pub fn occluder(&self) -> &Occluder {
        &self.occluder
    }
}

/// A yarn as one camera ray meets it.
#[derive(Clone, Copy, Debug)]
struct View<'a> {
    yarn: &'a AggregatedYarn,
    section: &'a Section<'a>,
    /// Towards the camera, in the section's frame.
    camera: Vec3A,
}

/// A place on the camera's chord where light meets a fibre.
#[derive(Clone, Copy, Debug)]
struct Spot {
    /// The ply.
    ply: usize,
    /// Where that is.
    inside: Inside,
    /// Unit tangent of the fibre there.
    tangent: Vec3A,
    /// How much deeper on the camera's ray it is than where the gaps between fibres have the first one: 0 but of a first fibre's own light.
    deeper: f32,
}

impl<'a> View<'a> {
    fn new(yarn: &'a AggregatedYarn, section: &'a Section<'a>) -> Self {
        let camera = Vec3A::new((1.0 - section.sin * section.sin).max(0.0).sqrt(), 0.0, section.sin);
        Self { yarn, section, camera }
    }

    /// The depth in a ply before which the share `x` of the fibres on the chord lies.
    #[inline]
    fn depth(&self, crossing: &PlyCrossing, x: f32) -> f32 {
        (crossing.foot - crossing.chord.place(x) / self.section.cos).max(0.0)
    }

    /// The place of the first fibre in a ply at a depth, whose middle is so far `beside` the ray, in the circle of the ply's radius.
    #[inline]
    fn first_spot(&self, crossing: &PlyCrossing, depth: f32, beside: f32) -> Spot {
        let Self { yarn, section, .. } = self;
        let shape = yarn.occluder().shape();
        let inside = section.inside(shape, section.point(depth), crossing.travel_at(depth));
        let tangent = inside.fiber_tangent_beside(shape, section, crossing.ply, self.camera, beside);
        Spot { ply: crossing.ply, inside, tangent: tangent.normalize(), deeper: 0.0 }
    }
}

impl Spot {
    /// A place in a ply.
    #[inline]
    fn new(view: &View<'_>, ply: usize, inside: Inside) -> Self {
        let tangent = inside.fiber_tangent(view.yarn.occluder().shape(), view.section, ply);
        Self { ply, inside, tangent: tangent.normalize(), deeper: 0.0 }
    }

    /// The place in the ply's section, and the axes against which azimuths of light that leaves from there count. Of light that goes on from the
    /// first fibre it is that one's middle: what goes back finds its way clear, and the rest is ahead of where it met the fibre.
    #[inline]
    fn place(&self, view: &View<'_>) -> (Place, [Vec3A; 2]) {
        self.placed(view, self.inside.in_ply(view.yarn.occluder().shape(), self.ply))
    }

    /// The same of light that came from `back`: where it met the fibre.
    #[inline]
    fn place_met(&self, view: &View<'_>, back: Vec3A) -> (Place, [Vec3A; 2]) {
        let met = view.section.thinness() * view.yarn.plies[self.ply].lead * back;
        self.placed(view, self.inside.beside_in_ply(view.yarn.occluder().shape(), self.ply, met))
    }

    /// The same of a point of the ply.
    #[inline]
    fn placed(&self, view: &View<'_>, at: Vec2) -> (Place, [Vec3A; 2]) {
        let [in_circle, within] = self.inside.short_axis(view.yarn.occluder().shape(), self.ply);
        let (place, axes) = view.yarn.plies[self.ply].leaving.place(at, in_circle);
        // From the axes of the circle to those of the section: where both are pressed, one is turned against the other.
        let turned = Vec2::new(in_circle.dot(within), in_circle.perp_dot(within));
        (place, axes.map(|axis| self.inside.out_of(turned.rotate(axis))))
    }

    /// How much of a vector is along the fibre, for each unit of the fibre's own part along the yarn.
    ///
    /// Fibres of a ply wind around its axis as one screw, so that this stays what it is along straight light and where a fibre mirrors it or
    /// lets it through in its latitude: whichever fibres of the ply light meets in between.
    #[inline]
    fn axial(&self, v: Vec3A) -> f32 {
        v.dot(self.tangent) / self.inside.along(self.tangent)
    }

    /// How light that came from `back` goes on from here towards `w`. It starts where it met the fibre, on the side where it came from, and is
    /// inside of it first if it goes on forward. What goes straight on meets what the camera's ray would: it starts where the gaps have
    /// the fibre, which know how many are behind.
    #[inline]
    fn turned(&self, view: &View<'_>, back: Vec3A, w: Vec3A) -> Turned {
        /// Cosines of turns, of 50 and 25 degrees: from none of it straight on to all.
        const STRAIGHT_ON: [f32; 2] = [0.642_787_6, 0.906_307_8];
        let out = self.across(w);
        let length = out.length().max(1e-6);
        let out = out / length;
        let cos = -back.dot(out);
        let lead = view.section.thinness() * view.yarn.plies[self.ply].lead;
        let [none, all] = STRAIGHT_ON;
        let nearer = ((cos - none) / (all - none)).clamp(0.0, 1.0) * self.deeper;
        Turned {
            cos,
            shift: lead * (back + cos.max(0.0) * out) + nearer * view.camera,
            free: (lead * (1.0 + cos.max(0.0)) + nearer * view.section.cos).max(0.0),
            beside: (1.0 - w.z * w.z).max(0.0).sqrt() / length,
        }
    }

    /// Where light that came from `back` leaves towards `w`: other yarns are met from there.
    #[inline]
    fn leaves_from(&self, view: &View<'_>, back: Vec3A, w: Vec3A) -> Vec3A {
        self.inside.point + self.turned(view, back, w).shift
    }

    /// The part of a vector across the fibre.
    #[inline]
    fn across(&self, v: Vec3A) -> Vec3A {
        v - v.dot(self.tangent) * self.tangent
    }

    /// The optical depth of plies other than its own that lie ahead at `shift` from here in the direction `w`, per channel; `other` is told of each, and of the
    /// fibres on its way.
    #[inline]
    fn past_own(&self, view: &View<'_>, shift: Vec3A, w: Vec3A, mut other: impl FnMut(FibersAhead)) -> Rgb {
        let free = 2.0 * view.section.thinness() * view.yarn.plies[self.ply].lead;
        let mut ahead = PliesAhead::new();
        plies_ahead(view, self, (shift, w), view.yarn.plies_overlap.then_some(free), free, &mut ahead);
        let mut depth = Rgb::ZERO;
        for fibers in ahead.iter().filter(|of| of.ply != self.ply && of.expected > 0.0) {
            depth += fibers.depth(view, &ahead);
            other(*fibers);
        }
        depth
    }
}

/// How light goes on from a fibre, as seen along it: there others that run along it are circles.
#[derive(Clone, Copy, Debug)]
struct Turned {
    /// The cosine of its turn.
    cos: f32,
    /// From the fibre's place to where the way on begins.
    shift: Vec3A,
    /// How far from there on fibres of plies in which it may lie have their middles: the fibre keeps them away, or lies in them.
    free: f32,
    /// How much of the section it passes for each unit across the fibre.
    beside: f32,
}

/// From where light leaves the yarn.
enum Leaves<'a> {
    /// From a fibre, to which it came from there.
    At(Spot, Vec3A),
    /// From elsewhere around its ply, in which it wandered about.
    Around(Spot, &'a Lobe),
}

/// One place of scattering, for one camera direction: see the module's notes.
#[derive(Clone, Debug)]
pub struct Vertex<'a> {
    view: View<'a>,
    forward: Option<Forward>,
    node: LateNode,
    backward: Backward,
}

impl<'a> Vertex<'a> {
    /// Draws the first fibre and the node. `unscattered` is [`Occluder::transparency`] of `crossings`, which the caller has
    /// already decided against: all values here are over 1 - `unscattered`.
    #[inline]
    pub fn new(
        yarn: &'a AggregatedYarn,
        section: &'a Section<'a>,
        crossings: &Crossings,
        unscattered: f32,
        arrival: impl Into<Arrival>,
        u: [f32; 4],
        stream: &mut Stream,
    ) -> Self {
        let view = View::new(yarn, section);
        let Arrival { throughput, lit, first_fiber } = arrival.into();
        let weight = throughput.max(Rgb::splat(1e-20));
        // It takes an unknown number of them.
        let mut of_forward = stream.branch();
        let first = first_fiber.unwrap_or_else(|| [u[1], of_forward.next()]);
        let forward = Forward::draw(&view, crossings, unscattered, (weight, lit), first, &mut of_forward);
        let end = forward.as_ref().and_then(|forward| forward.end(&view, crossings, u[0]));
        let node = LateNode::new(end, weight, [u[2], u[3]], stream.branch());
        Self { view, forward, node, backward: Backward::later(stream) }
    }

    /// The chance that a path goes on as F.
    #[inline]
    fn forward_chance(&self) -> f32 {
        self.forward.as_ref().map_or(0.0, |f| f.drawn.chance)
    }

    /// The value of the lobes for light from `w` (section frame), in 1/steradian, with the cosine, over 1 - T0; each
    /// component weighted against direction sampling, where `light_pdf` is the density (1/steradian) of drawing `w`,
    /// or infinite for light that no sampled direction can meet. `u_start` draws where it leaves from.
    #[inline]
    pub fn evaluate(&self, w: Vec3A, light_pdf: f32, u_start: f32) -> Direct {
        let mut lobes = LobeValues::default();
        let mut start = OneOf::new(u_start);
        if let Some(forward) = &self.forward {
            forward.toward(&self.view, w, |fiber, part| {
                let value = part.value * mis_weight(light_pdf, part.density());
                start.offer(value.mean(), Leaves::At(fiber.spot, fiber.back));
                lobes.f += value;
            });
        }
        if let Some(node) = self.node.get(&self.view) {
            let at_node = 1.0 - self.forward_chance();
            let value = node.toward(&self.view, w);
            let weight = mis_weight(light_pdf, at_node * node.escape_chance(value.clear) * value.pdf);
            lobes.r = value.r * weight;
            lobes.tt = value.tt * weight;
            lobes.d = value.d * weight;
            start.offer((lobes.r + lobes.tt + lobes.d).mean(), Leaves::At(node.spot, node.way_in.back));
            let lobe = self.backward.of(&self.view, node);
            lobe.evaluate(&self.view, node, (w, light_pdf), value.open, at_node, |spot, value| {
                start.offer(value.mean(), Leaves::Around(*spot, lobe));
                lobes.b += value;
            });
        }
        let leaves_from = |leaves| match leaves {
            Leaves::At(spot, back) => spot.leaves_from(&self.view, back, w),
            Leaves::Around(spot, lobe) => lobe.start(&self.view, &spot, w),
        };
        Direct { lobes, start: start.drawn.map(leaves_from) }
    }

    /// The density, 1/steradian, with which paths go on as F towards `w`, whichever of its parts they belong to: a check of
    /// [`Self::sample`], for [`Self::evaluate`] weighs each part by itself.
    pub fn forward_density(&self, w: Vec3A) -> f32 {
        self.forward.as_ref().map_or(0.0, |forward| forward.density(&self.view, w))
    }

    /// Draws where the path goes on. `u` are three fresh numbers: which component, and the direction of B.
    #[inline]
    pub fn sample(&self, u: [f32; 3], stream: &mut Stream) -> Option<Continuation> {
        let forward_chance = self.forward_chance();
        if let Some(forward) = &self.forward
            && u[0] < forward_chance
        {
            let drawn = &forward.drawn;
            let direction = drawn.direction;
            // The last fibre that it met.
            let last = forward.fibers.last();
            let start = last.map_or(self.place(), |last| last.spot.leaves_from(&self.view, last.back, direction));
            return Some(Continuation {
                direction,
                weight: drawn.share / forward_chance,
                pdf: drawn.pdf * forward_chance,
                shares: LobeValues { f: Rgb::ONE, ..LobeValues::default() },
                start,
            });
        }
        let node = self.node.get(&self.view)?;
        let at_node = 1.0 - forward_chance;
        let again = (u[0] - forward_chance) / at_node;
        if again < node.drawn.escape {
            let (sum, shares) = node.drawn.value.lobes();
            let pdf = node.drawn.value.pdf * at_node * node.drawn.escape;
            let direction = node.drawn.direction;
            let start = node.spot.leaves_from(&self.view, node.way_in.back, direction);
            return (pdf > 0.0).then(|| Continuation { direction, weight: sum / pdf, pdf, shares, start });
        }
        let lobe = self.backward.of(&self.view, node);
        let (direction, value, pdf, start) = lobe.sample(&self.view, node, [u[1], u[2]], stream);
        let pdf = pdf * at_node;
        let shares = LobeValues { b: Rgb::ONE, ..LobeValues::default() };
        (pdf > 0.0).then(|| Continuation { direction, weight: value / pdf, pdf, shares, start })
    }

    /// The place of the first fibre, in the section's frame: about where light is scattered.
    #[inline]
    pub fn place(&self) -> Vec3A {
        let first = self.forward.as_ref().and_then(|forward| forward.fibers.first());
        first.map_or_else(|| self.view.section.point(0.0), |first| first.spot.inside.point)
    }
}

#[cfg(test)]
mod azimuth_tests;
#[cfg(test)]
mod start_tests;
#[cfg(test)]
mod swirl_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod way_in_tests;
#[cfg(test)]
mod way_out_tests;
