//! How much light passes a yarn and meets no fibre, by its shape and the gaps between its fibres, whatever their colour
//! (docs/model.md, section 3).

use std::sync::Arc;

use super::{section::PlyCrossing, yarn::YarnShape};

/// What light finds between the fibres of a yarn.
#[derive(Clone, Debug)]
pub enum Transparency {
    /// Those of each crossing.
    Gaps,
    /// Gaps between fibres that lie at random: e^-n for n expected fibres.
    Random,
    /// No gaps.
    Opaque,
}

/// A yarn as rays see it that only ask whether they pass.
#[derive(Clone, Debug)]
pub struct Occluder {
    shape: Arc<YarnShape>,
    transparency: Transparency,
}

impl Occluder {
    /// For a shape, which several yarns may share.
    pub fn new(shape: Arc<YarnShape>, transparency: Transparency) -> Self {
        Self { shape, transparency }
    }

    /// The yarn's cross-section.
    #[inline]
    pub fn shape(&self) -> &YarnShape {
        &self.shape
    }

    /// Whether it is the same yarn but for the colour of its fibres: with the same shape in memory.
    pub fn shares_shape(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.shape, &other.shape)
    }

    /// T0: the share of light that passes all plies on the ray and meets no fibre; grey.
    #[inline]
    pub fn transparency(&self, crossings: &[PlyCrossing]) -> f32 {
        match &self.transparency {
            Transparency::Gaps => crossings.iter().map(|c| c.gaps.unscattered(c.fibers)).product(),
            Transparency::Random => (-crossings.iter().map(|c| c.fibers).sum::<f32>()).exp(),
            Transparency::Opaque if crossings.is_empty() => 1.0,
            Transparency::Opaque => 0.0,
        }
    }
}
