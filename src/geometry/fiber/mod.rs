//! Explicit fibres and plies of a yarn: the curves that the aggregated model answers for.
//!
//! Where fibres lie in a ply follows Zhao, Luan and Bala, "Fitting Procedural Yarn Models for Realistic Cloth
//! Rendering", SIGGRAPH 2016: a distribution over the section, a helix, migration towards the axis and back, all on
//! elliptical plies that wind around the yarn ([`Placement::Measured`]); or the packing that the aggregated model
//! assumes, fibres that do not overlap, even over the section ([`Placement::Regular`]), so that an error of the model can
//! be told from a difference of the geometry. Where a section is pressed flat, or its plies lean, the fibres of that packing give
//! way to each other.
//! Fibres that leave the ply are in [`flyaway`].
//!
//! Everything is a function of (seed, yarn, ply, fibre). A fibre of a closed yarn begins and ends at the seam, where the
//! yarn is cut: fibres of real yarn end too.

pub mod flyaway;
pub mod packing;
pub mod slopes;
mod yielding;

use std::{f64::consts::TAU, sync::OnceLock};

use glam::{DMat2, DVec2, DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::{
    curve::{Basis, Curve},
    density::{KnownPacking, PlyPacking},
    material_indices::MaterialIndices,
    ply::{PlyParameters, PlyShape, stretch_of_both},
    segment_uvs::SegmentUvs,
    strand::Strands,
    tube::{Tubes, spline_through},
    yarn::YarnShape,
    yarn_frame::{Pressed, YarnFrame},
};
use crate::math::sampler::{Stream, hash2};
use slopes::{Slopes, Twist};
use yielding::{Ellipse, Yielding};

/// Where the fibres of a ply lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Placement {
    /// Fibres that do not overlap, at random and even over the ply; rigid along it where its section is a circle and does not lean,
    /// and giving way to each other where it is not or does.
    Regular,
    /// As measured by Zhao et al. 2016.
    Measured(Distribution),
}

/// The distribution of fibres over a ply's section, and their migration (Zhao et al. 2016, Eqs. 2 to 4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distribution {
    /// Least acceptance of a fibre: at the distance R from the axis it is
    /// (1 - 2 epsilon) ((e - e^R) / (e - 1))^beta + epsilon.
    pub epsilon: f64,
    /// Exponent of the acceptance: 0 is even, more crowds fibres at the axis.
    pub beta: f64,
    /// A migrating fibre's distance from the axis lies between these multiples of its own.
    pub migration: [f64; 2],
    /// Turns of migration for each turn of the fibre around the ply.
    pub migration_rate: f64,
    /// How far a fibre wanders off its helix, standard deviation in fibre radii.
    pub jitter: f64,
}

/// How finely curves follow the helices: the farthest they may lie from them, in fibre radii.
pub const TOLERANCE: f64 = 0.02;
/// Largest turn of a fibre or ply between two points, radians: beyond, the spline's error is no longer of fourth order.
const LARGEST_TURN: f64 = 0.8;
/// The same of a fibre against a section that is not a circle: where fibres give way to each other, they do so within less.
const LARGEST_TURN_IN_ELLIPSE: f64 = 0.4;

/// Places of a yarn by the way to them: what the curves wound around it are made from.
struct Guide<'a> {
    strands: &'a Strands,
    /// The yarn's first segment.
    first: u32,
    /// Arc length in yarn radii from the yarn's start to [`LENGTH_STEPS`] places of each of its segments.
    lengths: Vec<f64>,
}

/// Places of each segment of a yarn to which its length is known.
const LENGTH_STEPS: usize = 4;
/// The most steps along one yarn.
const MOST_STEPS: f64 = 1e7;

/// The longest step in yarn radii with which a cubic spline follows curves that turn at `rate` (radians per yarn radius)
/// at `distance` from their axis to within `tolerance` (both in yarn radii).
///
/// A uniform cubic spline through a circle of radius r at steps of angle a misses it by r a^4 / 384.
fn step_for(rate: f64, distance: f64, tolerance: f64) -> f64 {
    let turn = (384.0 * tolerance / distance.max(1e-9)).powf(0.25).min(LARGEST_TURN);
    turn / rate.abs().max(1e-9)
}

impl<'a> Guide<'a> {
    fn new(strands: &'a Strands, yarn: usize) -> Self {
        let segments = strands.segments_of(yarn);
        let mut lengths = Vec::with_capacity(segments.len() * LENGTH_STEPS + 1);
        let (mut length, mut before) = (0.0, None);
        for segment in segments.clone() {
            for k in usize::from(before.is_some())..=LENGTH_STEPS {
                let place = strands.frame(segment, k as f32 / LENGTH_STEPS as f32);
                if let Some(before) = before {
                    length += f64::from(place.centre.distance(before)) / f64::from(place.radius.max(1e-20));
                }
                before = Some(place.centre);
                lengths.push(length);
            }
        }
        Self { strands, first: segments.start, lengths }
    }

    /// The yarn's length in its radii.
    fn length(&self) -> f64 {
        self.lengths.last().copied().unwrap_or(0.0)
    }

    /// The yarn's segment, and how much of it has passed, after so many yarn radii along the yarn.
    fn find(&self, along: f64) -> (u32, f32) {
        let last = self.lengths.len() - 1;
        let i = self.lengths.partition_point(|&a| a <= along).clamp(1, last) - 1;
        let span = self.lengths[i + 1] - self.lengths[i];
        let t = if span > 0.0 { ((along - self.lengths[i]) / span).clamp(0.0, 1.0) } else { 0.0 };
        let u = ((i % LENGTH_STEPS) as f64 + t) / LENGTH_STEPS as f64;
        (self.first + (i / LENGTH_STEPS) as u32, u as f32)
    }

    /// The yarn's segment after so many yarn radii along it.
    fn segment_at(&self, along: f64) -> u32 {
        self.find(along).0
    }

    /// The place after so many yarn radii along the yarn.
    fn frame_at(&self, along: f64) -> YarnFrame {
        let (segment, u) = self.find(along);
        self.strands.frame(segment, u)
    }

    /// So many even steps along the yarn: where each begins, in yarn radii from the yarn's start, and the end of the last.
    fn steps(&self, count: usize) -> impl Iterator<Item = f64> + '_ {
        (0..=count).map(move |i| self.length() * i as f64 / count as f64)
    }
}

/// The point at `at` (yarn radii) of the round section at a place.
#[inline]
fn point(place: &YarnFrame, at: DVec2) -> Vec3 {
    place.point(at.as_vec2()).into()
}

/// The plies of a yarn, wound around its strands.
pub struct Plies<'a> {
    strands: &'a Strands,
    plies: &'a [PlyParameters],
    shape: &'a YarnShape,
    /// The longest step along a yarn, in yarn radii.
    longest_step: f64,
    /// Steps along each yarn, found when first asked for: yarns that stay whole need none.
    steps: OnceLock<Vec<usize>>,
    /// Of yarns of which some have opened: the radius of a whole one, and into how many strands.
    opened: Option<(f64, f64)>,
    seed: u32,
}

impl<'a> Plies<'a> {
    /// For `strands` whose phases belong to `shape`, made of `plies`. Fibres are random by `seed`.
    pub fn new(strands: &'a Strands, plies: &'a [PlyParameters], shape: &'a YarnShape, seed: u32) -> Self {
        let longest_step = plies
            .iter()
            .zip(&shape.plies)
            .map(|(p, s)| {
                let tolerance = TOLERANCE * p.fiber_radius;
                let own = f64::from(s.fiber_rate).abs().max(f64::from(shape.ply_rate - s.fiber_rate).abs());
                let helices =
                    step_for(own, p.radius, tolerance).min(step_for(f64::from(shape.ply_rate), p.distance, tolerance));
                // Against the yarn's short axis, and against the ply's.
                let pressed = if strands.flattened() { f64::from(s.fiber_rate).abs() } else { 0.0 };
                let elliptical =
                    if s.stretch == Vec2::ONE { 0.0 } else { f64::from(s.fiber_rate - shape.ply_rate).abs() };
                helices.min(LARGEST_TURN_IN_ELLIPSE / pressed.max(elliptical).max(1e-9))
            })
            .fold(f64::MAX, f64::min);
        Self { strands, plies, shape, longest_step, steps: OnceLock::new(), opened: None, seed }
    }

    /// What one of the plies was made from.
    pub fn parameters(&self, ply: usize) -> &'a PlyParameters {
        &self.plies[ply]
    }

    /// Of yarns of this radius, some of which have opened into so many strands each, a curve for each strand.
    #[must_use]
    pub fn with_opened(self, radius: f64, strands: f64) -> Self {
        Self { opened: Some((radius, strands)), ..self }
    }

    /// Steps along each yarn: at least one for each of its segments.
    fn steps(&self) -> &[usize] {
        self.steps.get_or_init(|| {
            let steps_of = |yarn| {
                let radii = self.strands.length_of(yarn) / self.strands.mean_radius_of(yarn);
                self.strands.segments_of(yarn).len().max((radii / self.longest_step).ceil().min(MOST_STEPS) as usize)
            };
            (0..self.strands.yarns()).into_par_iter().map(steps_of).collect()
        })
    }

    /// Control points and segments of all fibres together, before any is made.
    pub fn fiber_counts(&self) -> (u64, u64) {
        let fibers: u64 = self.plies.iter().map(|p| u64::from(p.fibers)).sum();
        self.counts(fibers)
    }

    /// Control points and segments of one curve for each ply, before any is made.
    pub fn ply_counts(&self) -> (u64, u64) {
        self.counts(self.plies.len() as u64)
    }

    fn counts(&self, curves: u64) -> (u64, u64) {
        let steps: u64 = self.steps().iter().map(|&steps| steps as u64).sum();
        (curves * (steps + 3 * self.steps().len() as u64), curves * steps)
    }

    /// Direction from the yarn's axis to a ply at a step, in the section.
    #[inline]
    fn axis(&self, place: &YarnFrame, ply: &PlyShape) -> DVec2 {
        let turned = DVec2::from_angle(f64::from(place.phase));
        turned.rotate(ply.direction.as_dvec2())
    }

    /// The fibres of one ply in all yarns, and the first of each yarn.
    pub fn fibers(&self, ply: usize, placement: Placement) -> (Tubes, Vec<u32>) {
        let per_yarn: Vec<Vec<Vec<Vec4>>> =
            (0..self.strands.yarns()).into_par_iter().map(|yarn| self.fibers_of(yarn, ply, placement)).collect();
        let mut first = Vec::with_capacity(per_yarn.len());
        let mut all = Vec::with_capacity(per_yarn.iter().map(Vec::len).sum());
        for fibers in per_yarn {
            first.push(all.len() as u32);
            all.extend(fibers);
        }
        (Tubes::from_chains(Basis::BSpline, &all), first)
    }

    fn fibers_of(&self, yarn: usize, ply: usize, placement: Placement) -> Vec<Vec<Vec4>> {
        let (parameters, shape) = (&self.plies[ply], &self.shape.plies[ply]);
        let guide = Guide::new(self.strands, yarn);
        let places: Vec<(f64, YarnFrame)> = guide.steps(self.steps()[yarn]).map(|s| (s, guide.frame_at(s))).collect();
        let mut stream = Stream::new(hash2(hash2(self.seed, yarn as u32), ply as u32));
        let start = TAU * f64::from(stream.next());
        let core = f64::from(shape.core_radius);
        let own_rate = f64::from(shape.fiber_rate - self.shape.ply_rate);
        let radius = parameters.fiber_radius as f32;
        let twist = Twist::of(shape, self.shape.ply_rate);
        let regular = match placement {
            Placement::Regular => {
                packing::hard_discs(parameters.fibers, parameters.fiber_radius / core, twist, &mut stream)
            }
            Placement::Measured(_) => Vec::new(),
        };
        // On the circle that the ply's section becomes; then in the ply's own axes, then in the yarn's.
        let turned = |along: f64| DVec2::from_angle(start + own_rate * along);
        let knot = |along: f64, place: &YarnFrame, at: DVec2| {
            let axis = self.axis(place, shape);
            let in_ply = turned(along).rotate(at) / shape.stretch.as_dvec2();
            point(place, axis * (f64::from(shape.distance) + in_ply.x) + axis.perp() * in_ply.y)
        };
        let yielding = self.yielding_knots(&places, ply, &regular, turned, knot);
        let mut knots = Vec::with_capacity(places.len());
        (0..parameters.fibers as usize)
            .map(|fiber| {
                let wander: Box<dyn Fn(f64) -> DVec2> = match placement {
                    Placement::Regular => {
                        let at = core * regular[fiber];
                        Box::new(move |_| at)
                    }
                    Placement::Measured(d) => d.wanderer(core, parameters.fiber_radius, own_rate, &mut stream),
                };
                knots.clear();
                if yielding.is_empty() {
                    knots.extend(places.iter().map(|(along, place)| knot(*along, place, wander(*along))));
                } else {
                    knots.extend_from_slice(&yielding[fiber * places.len()..][..places.len()]);
                }
                spline_through(&knots, |step| places[step].1.round_radius() * radius)
            })
            .collect()
    }

    /// The knots of a ply's fibres, one fibre after the other, with `centres` in core radii that give way to each other where the
    /// ply's section is not a circle; nothing where it is one everywhere. `turned` is by what a packing is turned so far along the
    /// yarn, as (cos, sin), and `knot` the place of a fibre in a circle, by yarn radii from the ply's axis.
    fn yielding_knots(
        &self,
        places: &[(f64, YarnFrame)],
        ply: usize,
        centres: &[DVec2],
        turned: impl Fn(f64) -> DVec2,
        knot: impl Fn(f64, &YarnFrame, DVec2) -> Vec3,
    ) -> Vec<Vec3> {
        let (parameters, shape) = (&self.plies[ply], &self.shape.plies[ply]);
        let steps = places.len();
        if centres.is_empty() {
            return Vec::new();
        }
        let sections: Vec<Option<LeaningSection>> =
            places.iter().map(|(_, place)| self.leaning_section(place, shape)).collect();
        let Some(flattest) = sections.iter().flatten().map(|s| s.ellipse).reduce(Ellipse::flatter) else {
            return Vec::new();
        };
        let fiber = parameters.fiber_radius / parameters.radius;
        let twist = Twist::of(shape, self.shape.ply_rate);
        let room = twist.room(parameters.fibers, fiber);
        let yielding = Yielding::new(centres, fiber, &twist.scaled(room).in_core(fiber), &flattest);
        let mut knots = vec![Vec3::ZERO; centres.len() * steps];
        let mut at = Vec::with_capacity(centres.len());
        for (step, ((along, place), section)) in places.iter().zip(&sections).enumerate() {
            let Some(section) = section else {
                for (fiber, centre) in centres.iter().enumerate() {
                    knots[fiber * steps + step] = knot(*along, place, f64::from(shape.core_radius) * *centre);
                }
                continue;
            };
            yielding.squeeze(turned(*along), &section.ellipse, &section.slopes.scaled(room), &mut at);
            let middle = place.point(shape.distance * self.axis(place, shape).as_vec2());
            let radius = place.round_radius() * shape.radius;
            let across = place.tangent.cross(place.normal);
            for (fiber, at) in at.iter().enumerate() {
                let off = radius * at.as_vec2();
                knots[fiber * steps + step] = (middle + off.x * place.normal + off.y * across).into();
            }
        }
        knots
    }

    /// What the circle of a ply's section is at a place; `None` if it is a circle whose fibres lean alike however it turns.
    fn leaning_section(&self, place: &YarnFrame, ply: &PlyShape) -> Option<LeaningSection> {
        let pressed = Pressed::new(place.flattening);
        let rate = f64::from(self.shape.ply_rate);
        let middle = f64::from(ply.distance) * self.axis(place, ply);
        if pressed.is_none() && ply.stretch == Vec2::ONE && rate * middle == DVec2::ZERO {
            return None;
        }
        let real = |at: DVec2| pressed.map_or(at, |pressed| pressed.real(at.as_vec2()).as_dvec2());
        let real_of = |map: DMat2| DMat2::from_cols(real(map.x_axis), real(map.y_axis));
        let (axis, stretch) = (self.axis(place, ply), ply.stretch.as_dvec2());
        // From the circle to the ply in the round yarn, and on to the yarn as it is pressed.
        let in_yarn = DMat2::from_cols(axis / stretch.x, axis.perp() / stretch.y);
        let map = real_of(in_yarn);
        // The ply turns with the yarn, and the fibres in its circle with the rest of their rate.
        let quarter = DMat2::from_cols(DVec2::Y, DVec2::NEG_X);
        let turning = quarter * in_yarn * rate + in_yarn * quarter * (f64::from(ply.fiber_rate) - rate);
        let unit = f64::from(ply.radius) * f64::from(place.round_radius() / place.radius);
        let linear = if map.determinant() > 0.0 { unit * real_of(turning) * map.inverse() } else { DMat2::ZERO };
        let slopes = Slopes { middle: real(rate * middle.perp()), linear, even: 0.0 };
        Some(LeaningSection { ellipse: Ellipse::or_circle(map), slopes })
    }

    /// For each segment of so many curves along each yarn, the material index of the yarn's segment below it; nothing if
    /// nothing was.
    pub fn material_indices_along(&self, curves: usize) -> MaterialIndices {
        let mut material_indices = Vec::new();
        for yarn in 0..self.strands.yarns() {
            let (guide, steps) = (Guide::new(self.strands, yarn), self.steps()[yarn]);
            let half = 0.5 * guide.length() / steps.max(1) as f64;
            let below = guide.steps(steps).take(steps).map(|start| guide.segment_at(start + half));
            let along: Vec<u16> = below.filter_map(|segment| self.strands.material_index(segment)).collect();
            material_indices.extend(std::iter::repeat_n(along, curves).flatten());
        }
        MaterialIndices::new(material_indices, self.strands.material_indices().blended())
    }

    /// For each segment of so many curves along each yarn, the texture coordinates of the yarn where it starts and ends;
    /// nothing if nobody asked for them.
    pub fn uvs_along(&self, curves: usize) -> SegmentUvs {
        let own = self.strands.uvs();
        let mut uvs = SegmentUvs::default();
        for yarn in (0..self.strands.yarns()).filter(|_| !own.is_empty()) {
            let (guide, steps) = (Guide::new(self.strands, yarn), self.steps()[yarn]);
            let at = |along: f64| {
                let (segment, u) = guide.find(along);
                own.at(segment, u)
            };
            let along = SegmentUvs::between(&guide.steps(steps).map(at).collect::<Vec<_>>());
            (0..curves).for_each(|_| uvs.append(&along));
        }
        uvs
    }

    /// Mean radius of strands made along plies, in radii of the yarns that these belong to.
    pub fn mean_width(&self, plies: &Strands) -> f64 {
        let all = |of: &Strands| (0..of.yarns()).map(|yarn| of.mean_radius_of(yarn)).sum::<f64>();
        all(plies) / all(self.strands).max(1e-300)
    }

    /// Mean ratio of the short to the long axis of the yarns' sections.
    pub fn mean_flattening(&self) -> f64 {
        self.strands.mean_flattening()
    }

    /// One curve for each yarn along the middle of a ply, as wide as the ply. Its section is what an ellipse, pressed flat
    /// with the yarn and cut across the ply instead of across the yarn, becomes.
    pub fn ply_curves(&self, ply: usize) -> Vec<(Curve, Vec<f64>)> {
        let shape = &self.shape.plies[ply];
        let semi_axes = shape.radius / shape.stretch;
        (0..self.strands.yarns())
            .into_par_iter()
            .map(|yarn| {
                let guide = Guide::new(self.strands, yarn);
                let places: Vec<YarnFrame> = guide.steps(self.steps()[yarn]).map(|s| guide.frame_at(s)).collect();
                let knots: Vec<Vec3> =
                    places.iter().map(|p| point(p, f64::from(shape.distance) * self.axis(p, shape))).collect();
                let points = spline_through(&knots, |_| 0.0);
                let sections: Vec<(DVec3, f64)> = (0..points.len())
                    .map(|i| {
                        // The knot that the point stands for.
                        let place = &places[i.saturating_sub(1).min(knots.len() - 1)];
                        let axis = self.axis(place, shape).as_vec2();
                        let middle = place.point(shape.distance * axis);
                        let half = |to: Vec2| (place.point(shape.distance * axis + to) - middle).as_dvec3();
                        // The ply goes on along the bent yarn and turns about it.
                        let bent = f64::from(place.radius - place.radius * place.curvature.dot(middle - place.centre));
                        let turned = half(self.shape.ply_rate * shape.distance * axis.perp());
                        let along = bent * place.tangent.as_dvec3() + turned;
                        let halves = [half(semi_axes.x * axis), half(semi_axes.y * axis.perp())];
                        cut_across(halves, along.normalize_or(place.tangent.as_dvec3()))
                    })
                    .collect();
                let curve = Curve {
                    basis: Basis::BSpline,
                    closed: false,
                    points: points.iter().map(|p| p.truncate().as_dvec3()).collect(),
                    radii: None,
                    flattening: Some(sections.iter().map(|s| s.0.as_vec3()).collect()),
                };
                (curve, sections.iter().map(|s| s.1).collect())
            })
            .collect()
    }
}

/// A ply's section at a place of the yarn.
struct LeaningSection {
    /// What its circle is.
    ellipse: Ellipse,
    /// How fibres lean at places in ply radii.
    slopes: Slopes,
}

/// Two conjugate half axes of an ellipse, looked at along the unit vector `tangent`: the ellipse's short axis, as long as
/// its ratio to the long one, and the length of half of the long one.
fn cut_across(halves: [DVec3; 2], tangent: DVec3) -> (DVec3, f64) {
    let [a, b] = halves.map(|h| h - h.dot(tangent) * tangent);
    // The angle t at which a cos t + b sin t is longest or shortest.
    let t = 0.5 * (2.0 * a.dot(b)).atan2(a.length_squared() - b.length_squared());
    let (long, short) = (a * t.cos() + b * t.sin(), b * t.cos() - a * t.sin());
    let ratio = (short.length() / long.length().max(1e-300)).min(1.0);
    (short.normalize_or(a.cross(tangent).normalize_or(DVec3::X)) * ratio, long.length())
}

impl Placement {
    /// How the fibres that are placed in a ply lie, from some that are, as far as it is not known: the crowding to 0.01 or so, and the
    /// regularity to some hundredths. `stretch` is the long over the short axis of the yarn's section, 1 if it is round.
    pub fn packing_of(self, ply: &PlyParameters, twist: Twist, known: KnownPacking, stretch: f64) -> PlyPacking {
        let core = ply.radius - ply.fiber_radius;
        let fiber = ply.fiber_radius / core;
        match self {
            _ if ply.fibers == 0 || core <= 0.0 => known.over(PlyPacking::evenly(1.0)),
            Self::Regular => {
                packing::measured(ply.fibers, fiber, twist, stretch_of_both(stretch, ply.aspect.recip()), known)
            }
            Self::Measured(distribution) => {
                let crowding = distribution.crowding(fiber);
                known.over(PlyPacking { crowding, ..PlyPacking::evenly(0.0) })
            }
        }
    }
}

impl Distribution {
    /// 2 <r^2> - 1 of the fibres' distances from the axis, in core radii; `fiber_radius` in those too.
    fn crowding(&self, fiber_radius: f64) -> f64 {
        const FIBERS: u32 = 1000;
        const PLACES: u32 = 8;
        let mut stream = Stream::new(0);
        let mut sum = 0.0;
        for _ in 0..FIBERS {
            let wander = self.wanderer(1.0, fiber_radius, 1.0, &mut stream);
            sum += (0..PLACES).map(|k| wander(5.0 * f64::from(k)).length_squared()).sum::<f64>();
        }
        2.0 * sum / f64::from(FIBERS * PLACES) - 1.0
    }

    /// A fibre drawn from the distribution: where it is in the ply's circle (yarn radii) after so many yarn radii, before
    /// the ply's own turning. `core` is the radius within which its centre stays.
    fn wanderer(&self, core: f64, fiber_radius: f64, rate: f64, stream: &mut Stream) -> Box<dyn Fn(f64) -> DVec2> {
        let d = *self;
        let e = std::f64::consts::E;
        let mut own = 0.0;
        // The chance of refusal is below 1 - epsilon / 2 at the very edge only; a thousand tries never fail in practice.
        for _ in 0..1000 {
            own = f64::from(stream.next()).sqrt();
            let accept = (1.0 - 2.0 * d.epsilon) * ((e - own.exp()) / (e - 1.0)).max(0.0).powf(d.beta) + d.epsilon;
            if f64::from(stream.next()) < accept {
                break;
            }
        }
        let angle = TAU * f64::from(stream.next());
        let start = TAU * f64::from(stream.next());
        let jitter: [[f64; 2]; 4] = std::array::from_fn(|_| {
            // Four waves of incommensurable length make a wandering without a visible period.
            [TAU * f64::from(stream.next()), 0.5 + 2.0 * f64::from(stream.next())]
        });
        let [least, most] = d.migration;
        let amplitude = d.jitter * fiber_radius / 2f64.sqrt();
        Box::new(move |along| {
            let turned = rate.abs() * along;
            let migrated = least + (most - least) * 0.5 * ((d.migration_rate * turned + start).cos() + 1.0);
            let mut at = DVec2::from_angle(angle) * (own * migrated * core);
            if amplitude > 0.0 {
                let wave = |k: usize| (jitter[k][1] * turned.max(0.3 * along) + jitter[k][0]).sin();
                at += amplitude * DVec2::new(wave(0) + wave(1), wave(2) + wave(3));
                let reach = at.length();
                if reach > core {
                    at *= core / reach;
                }
            }
            at
        })
    }
}

#[cfg(test)]
mod tests;
