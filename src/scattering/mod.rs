//! Light at one crossing of a ray and a yarn: pure functions, no rays, no files.
//!
//! Every model answers the same three questions about a vertex: what it returns for light from a direction
//! ([`Direct`]: value with the cosine, per steradian, each lobe weighted against direction sampling), where a path goes
//! on ([`Continuation`]: value over density), and how much light passes without meeting a fibre (a number, grey). A
//! value is over 1 minus that number, because the caller has already decided that the ray did meet a fibre.
//!
//! | paper | here |
//! | --- | --- |
//! | Eq. 2, fibres on a chord | `fibers` of [`crate::geometry::section::PlyCrossing`] |
//! | Eqs. 3 and 4, averaged lobes | [`lobes`] (the paper's models), [`medium`] (the chain of TT) |
//! | Eqs. 5 and 6, one fibre | [`fiber`], with the kernel of [`kernel`] |
//! | Eqs. 8 to 11 and 15, forward lobes | [`aggregated`], lobe F; [`lobes`], [`closed_forms`] as printed |
//! | Eqs. 12 to 14, backward lobes and appendix A | [`aggregated`], lobe B; [`lobes`], [`closed_forms`] as printed |
//! | Eqs. 7 and 13, sums of lobes | [`LobeValues`] |
//!
//! [`aggregated`] is the default. It keeps the paper's lobes (R, TT, D, F, B) and departs from it where explicit fibres
//! say otherwise: normalised, reciprocal fibre lobes; single scattering along the camera's chord with the light's own way
//! through the plies; multiple scattering that does not count single scattering again; light that meets no fibre.
//! [`lobes`] has the paper's model as printed and in its most charitable reading, and a two-stream variant, to compare.

pub mod aggregated;
pub(crate) mod closed_forms;
pub(crate) mod escape;
pub mod fiber;
pub(crate) mod kernel;
pub(crate) mod lobe;
pub mod lobes;
pub(crate) mod medium;
pub mod surface;
#[cfg(test)]
mod testing;
pub mod yarn;

use std::ops::AddAssign;

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
    /// Names of the lobes in files, in the order of [`Self::to_array`].
    pub const NAMES: [&str; 5] = ["R", "TT", "D", "F", "B"];

    /// All lobes together.
    #[inline]
    pub fn sum(&self) -> Rgb {
        self.r + self.tt + self.d + self.f + self.b
    }

    /// In the order of [`Self::NAMES`].
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

impl AddAssign for LobeValues {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        self.r += other.r;
        self.tt += other.tt;
        self.d += other.d;
        self.f += other.f;
        self.b += other.b;
    }
}

/// A path that comes to a vertex.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Its weight so far.
    pub throughput: Rgb,
    /// Whether light may be sampled at the vertex too. Where only the path itself finds light, less has to be known of F.
    pub lit: bool,
    /// Where fibres are told apart, two numbers in [0, 1) in place of random ones: the share of those lines whose first fibre is met before this
    /// one, and on which side of the ray it is.
    pub first_fiber: Option<[f32; 2]>,
}

impl From<Rgb> for Arrival {
    /// A path of this weight, where light may be sampled.
    fn from(throughput: Rgb) -> Self {
        Self { throughput, lit: true, first_fiber: None }
    }
}

/// Light that arrives from one direction.
#[derive(Clone, Copy, Debug)]
pub struct Direct {
    /// Value with the cosine, 1/steradian, each lobe weighted against direction sampling.
    pub lobes: LobeValues,
    /// One of the places from which it leaves, drawn by what leaves from each, in the section's frame; `None` where nothing does.
    pub start: Option<Vec3A>,
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
    /// Where the path leaves from, in the section's frame.
    pub start: Vec3A,
}

/// The balance heuristic for a light sample; an infinite density means that only light sampling can find this light.
#[inline]
pub fn mis_weight(pdf: f32, other: f32) -> f32 {
    if pdf == f32::INFINITY { 1.0 } else { pdf / (pdf + other).max(1e-30) }
}
