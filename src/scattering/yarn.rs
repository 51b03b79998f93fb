//! Any of the yarn models behind one face: the only place that asks which it is.

use glam::Vec3A;

use super::{
    Arrival, Continuation, Direct,
    aggregated::{AggregatedYarn, Vertex},
    lobes::{ChordVertex, ChordYarn},
};
use crate::{
    geometry::{
        occluder::Occluder,
        section::{Crossings, PlyCrossing, Section},
        yarn::YarnShape,
    },
    math::sampler::Stream,
};

/// A yarn with one of the models.
#[derive(Clone, Debug)]
pub enum YarnScatterer {
    /// The recommended model.
    Aggregated(AggregatedYarn),
    /// The comparison models, which look at the camera's chord only.
    Chord(ChordYarn),
}

/// One scattering at such a yarn.
#[derive(Clone, Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "lives on the stack for one scattering; boxing would allocate in the hot path"
)]
pub enum YarnVertex<'a> {
    /// Of [`YarnScatterer::Aggregated`].
    Aggregated(Vertex<'a>),
    /// Of [`YarnScatterer::Chord`].
    Chord(ChordVertex<'a>),
}

impl YarnScatterer {
    /// The yarn without its colours: what rays see that only ask whether they pass.
    #[inline]
    pub fn occluder(&self) -> &Occluder {
        match self {
            Self::Aggregated(yarn) => yarn.occluder(),
            Self::Chord(yarn) => yarn.occluder(),
        }
    }

    /// The yarn's cross-section.
    #[inline]
    pub fn shape(&self) -> &YarnShape {
        self.occluder().shape()
    }

    /// The share of light that passes all plies on the ray and meets no fibre.
    #[inline]
    pub fn transparency(&self, crossings: &[PlyCrossing]) -> f32 {
        self.occluder().transparency(crossings)
    }

    /// Draws what is random about a scattering, given that the ray was not let through; see [`Vertex::new`].
    #[inline]
    pub fn vertex<'a>(
        &'a self,
        section: &'a Section<'a>,
        crossings: &Crossings,
        unscattered: f32,
        arrival: impl Into<Arrival>,
        u: [f32; 4],
        stream: &mut Stream,
    ) -> YarnVertex<'a> {
        match self {
            Self::Aggregated(yarn) => {
                YarnVertex::Aggregated(Vertex::new(yarn, section, crossings, unscattered, arrival, u, stream))
            }
            Self::Chord(yarn) => {
                YarnVertex::Chord(ChordVertex::new(yarn, section, crossings, unscattered, arrival, u, stream))
            }
        }
    }
}

impl YarnVertex<'_> {
    /// The value for light from `w`; see [`Vertex::evaluate`].
    #[inline]
    pub fn evaluate(&self, w: Vec3A, light_pdf: f32, u_start: f32) -> Direct {
        match self {
            Self::Aggregated(v) => v.evaluate(w, light_pdf, u_start),
            Self::Chord(v) => v.evaluate(w, light_pdf, u_start),
        }
    }

    /// Where the path goes on; see [`Vertex::sample`].
    #[inline]
    pub fn sample(&self, u: [f32; 3], stream: &mut Stream) -> Option<Continuation> {
        match self {
            Self::Aggregated(v) => v.sample(u, stream),
            Self::Chord(v) => v.sample(u, stream),
        }
    }

    /// The density, 1/steradian, with which paths go on as lobe F towards `w`; 0 for models without it.
    pub fn forward_density(&self, w: Vec3A) -> f32 {
        match self {
            Self::Aggregated(v) => v.forward_density(w),
            Self::Chord(_) => 0.0,
        }
    }

    /// About where light is scattered, in the section's frame: at the first fibre that the ray meets.
    #[inline]
    pub fn place(&self) -> Vec3A {
        match self {
            Self::Aggregated(v) => v.place(),
            Self::Chord(v) => v.place(),
        }
    }
}
