//! Scattering models for all that cloth is made of: the one place that turns a model into scatterers.

use std::sync::Arc;

use rayon::prelude::*;

use crate::{
    geometry::{occluder::Occluder, yarn::YarnShape},
    scattering::{
        aggregated::{AggregatedYarn, Solutions},
        fiber::{FiberBcsdf, FiberMaterial},
        lobes::{ChordModel, ChordYarn},
        yarn::YarnScatterer,
    },
    scene::{Model, Yarn},
    trace::PerVariant,
};

/// How the curves of one geometry scatter.
#[derive(Debug)]
pub enum Scatterers {
    /// Yarns or plies, by a model for the fibres inside.
    Yarns(PerVariant<YarnScatterer>),
    /// Fibres.
    Fibers(PerVariant<FiberBcsdf>),
}

/// A round yarn with one of the models.
pub fn scatterer(yarn: &Yarn, model: Model) -> YarnScatterer {
    pressed_scatterer(yarn, model, 1.0)
}

/// The same of one that is pressed to axes of `stretch` : 1.
pub fn pressed_scatterer(yarn: &Yarn, model: Model, stretch: f64) -> YarnScatterer {
    of_shape(shape_for(yarn, model, stretch), &materials(yarn), model, stretch, &Solutions::default())
}

/// Fabrics whose yarns are pressed by no more than this apart, long over short axis, share what is solved for them: panels of one
/// garment. Along each yarn it varies by more.
const PRESSED_ALIKE: f64 = 0.08;

/// A shape that yarns share.
struct SharedShape<'a> {
    /// One of the yarns.
    yarn: &'a Yarn,
    /// From the least to the most that they are pressed: long over short axis.
    from: f64,
    to: f64,
    /// Halfway: that of the shape.
    stretch: f64,
    shape: Arc<YarnShape>,
}

/// What yarns share whose plies are alike, whatever their colour and their fabric.
pub(super) struct Shared<'a> {
    model: Model,
    shapes: Vec<SharedShape<'a>>,
    solutions: Solutions,
}

impl<'a> Shared<'a> {
    /// With the shapes of some yarns, pressed to axes of some number to 1.
    pub(super) fn new(yarns: impl IntoIterator<Item = (&'a Yarn, f64)>, model: Model) -> Self {
        let mut all: Vec<(&Yarn, f64)> = yarns.into_iter().collect();
        // From the least pressed on, so that each joins those that are a little less.
        all.sort_by(|(_, a), (_, b)| a.total_cmp(b));
        let mut alike: Vec<(&Yarn, f64, f64)> = Vec::new();
        for (yarn, stretch) in all {
            match alike.iter_mut().find(|(of, from, _)| is_shaped_as(yarn, of) && stretch <= from + PRESSED_ALIKE) {
                Some((_, _, to)) => *to = stretch,
                None => alike.push((yarn, stretch, stretch)),
            }
        }
        let shaped = |(yarn, from, to)| {
            let stretch = 0.5 * (from + to);
            SharedShape { yarn, from, to, stretch, shape: Arc::new(shape_for(yarn, model, stretch)) }
        };
        Self { model, shapes: alike.into_par_iter().map(shaped).collect(), solutions: Solutions::default() }
    }

    /// The shape of a yarn that is pressed to axes of `stretch` : 1, and what these are of all that share it.
    pub(super) fn shape(&self, yarn: &Yarn, stretch: f64) -> (Arc<YarnShape>, f64) {
        let shares = |of: &&SharedShape<'_>| is_shaped_as(yarn, of.yarn) && (of.from..=of.to).contains(&stretch);
        match self.shapes.iter().find(shares) {
            Some(of) => (Arc::clone(&of.shape), of.stretch),
            None => (Arc::new(shape_for(yarn, self.model, stretch)), stretch),
        }
    }

    /// Whole yarns, pressed to axes of `stretch` : 1 on the mean.
    pub(super) fn of_yarns(&self, yarn: &Yarn, variants: &[Yarn], stretch: f64) -> PerVariant<YarnScatterer> {
        let scatterer = |of: &Yarn| {
            let (shape, stretch) = self.shape(of, stretch);
            of_shape(shape, &materials(of), self.model, stretch, &self.solutions)
        };
        PerVariant::new(scatterer(yarn), variants.par_iter().map(&scatterer).collect())
    }

    /// One ply of a yarn that is pressed to axes of `stretch` : 1 as a yarn of its own, whose shape `alone` is given.
    pub(super) fn of_plies(
        &self,
        yarn: &Yarn,
        variants: &[Yarn],
        ply: usize,
        (alone, stretch): (YarnShape, f64),
    ) -> PerVariant<YarnScatterer> {
        let shape = Arc::new(match self.model {
            Model::Aggregated => alone.packed(&yarn.packings(stretch)[ply..=ply]),
            _ => alone,
        });
        let scatterer =
            |of: &Yarn| of_shape(Arc::clone(&shape), &[&of.fibers[ply].1], self.model, stretch, &self.solutions);
        PerVariant::new(scatterer(yarn), variants.par_iter().map(&scatterer).collect())
    }
}

/// Whether yarns are alike but for their material and for how they are pressed.
fn is_shaped_as(yarn: &Yarn, other: &Yarn) -> bool {
    let of = |yarn: &Yarn| (yarn.ply_twist, yarn.placement, yarn.known_packing, yarn.tilted);
    yarn.plies == other.plies && of(yarn) == of(other)
}

/// The fibres of one ply of a yarn.
pub(super) fn of_fibers(yarn: &Yarn, variants: &[Yarn], ply: usize) -> PerVariant<FiberBcsdf> {
    let fiber = |of: &Yarn| FiberBcsdf::new(&of.fibers[ply].1);
    PerVariant::new(fiber(yarn), variants.iter().map(fiber).collect())
}

/// What rays need of yarns that only ask whether they pass: one for all where variants differ in colour only.
pub(super) fn occluders(yarns: &PerVariant<YarnScatterer>) -> PerVariant<Occluder> {
    let own = yarns.own().occluder();
    if yarns.variants().iter().all(|yarn| yarn.occluder().shares_shape(own)) {
        return PerVariant::same(own.clone());
    }
    PerVariant::new(own.clone(), yarns.variants().iter().map(|yarn| yarn.occluder().clone()).collect())
}

/// A yarn's shape with all that a model asks of it: only the aggregated one looks at how fibres lie.
fn shape_for(yarn: &Yarn, model: Model, stretch: f64) -> YarnShape {
    match model {
        Model::Aggregated => yarn.shape().packed(&yarn.packings(stretch)),
        _ => yarn.shape(),
    }
}

fn materials(yarn: &Yarn) -> Vec<&FiberMaterial> {
    yarn.fibers.iter().map(|(_, material)| material).collect()
}

fn of_shape(
    shape: impl Into<Arc<YarnShape>>,
    materials: &[&FiberMaterial],
    model: Model,
    stretch: f64,
    solutions: &Solutions,
) -> YarnScatterer {
    let chord = match model {
        Model::Aggregated => {
            return YarnScatterer::Aggregated(AggregatedYarn::pressed(shape, materials, stretch, solutions));
        }
        Model::TwoStream => ChordModel::TwoStream,
        Model::Paper => ChordModel::Paper,
        Model::Printed => ChordModel::Printed,
        Model::DualScattering => ChordModel::DualScattering,
    };
    YarnScatterer::Chord(ChordYarn::new(shape, materials, chord))
}
