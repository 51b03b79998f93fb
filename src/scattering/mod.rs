//! x
pub mod aggregated;
pub mod closed_forms;
pub mod fiber;
pub mod kernel;
pub mod lobes;
pub mod medium;
pub mod yarn;

use glam::Vec3A;

use crate::math::Rgb;

/// A value for each lobe: R, TT and D of single fibres, F and B of plies and yarn (paper Sec. 4).
#[derive(Clone, Copy, Debug, Default)]
pub struct LobeValues {
    /// Reflected once at a fibre's surface.
    pub r: Rgb,
    /// Passed through one fibre and left the forward chain.
    pub tt: Rgb,
    /// Scattered once inside a fibre.
    pub d: Rgb,
    /// Passed forward through any number of fibres.
    pub f: Rgb,
    /// Scattered more than once.
    pub b: Rgb,
}

impl LobeValues {
    /// All lobes together.
    #[inline]
    pub fn sum(&self) -> Rgb {
        self.r + self.tt + self.d + self.f + self.b
    }

    /// In the order of their names in files: R, TT, D, F, B.
    #[inline]
    pub fn to_array(self) -> [Rgb; 5] {
        [self.r, self.tt, self.d, self.f, self.b]
    }

    /// Every lobe times a colour.
    #[inline]
    pub fn scaled(self, by: Rgb) -> Self {
        Self { r: self.r * by, tt: self.tt * by, d: self.d * by, f: self.f * by, b: self.b * by }
    }
}

/// Light that arrives from one direction.
#[derive(Clone, Copy, Debug)]
pub struct Direct {
    /// Value with the cosine, 1/steradian, each lobe weighted against direction sampling.
    pub lobes: LobeValues,
    /// The share of F, which leaves from elsewhere.
    pub forward_share: f32,
}

/// Where a path goes on.
#[derive(Clone, Copy, Debug)]
pub struct Continuation {
    /// Unit direction in the section's frame.
    pub direction: Vec3A,
    /// Value over density.
    pub weight: Rgb,
    /// Density of the chosen component, 1/steradian, with the chance of choosing it.
    pub pdf: f32,
    /// To which lobes the light that comes from there belongs; the shares sum to 1.
    pub shares: LobeValues,
    /// Depth in the section at which the ray leaves.
    pub start: f32,
}

/// The balance heuristic for a light sample; an infinite density means that only light sampling can find this light.
#[inline]
pub fn mis_weight(pdf: f32, other: f32) -> f32 {
    if pdf == f32::INFINITY { 1.0 } else { pdf / (pdf + other).max(1e-30) }
}
