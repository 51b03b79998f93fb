//! How far a picture is from its limit.

/// What is added to the squared mean in relative errors, so that black pixels do not count without end; in the square of the
/// unit in which a film sums up light.
pub(super) const NOISE_OFFSET: f64 = 0.01;

/// Sums of an estimate of noise.
#[derive(Default)]
pub(super) struct NoiseSums {
    pub(super) sum: f64,
    pub(super) pixels: f64,
    pub(super) differences: f64,
    pub(super) paired: f64,
}

/// An estimate of a picture's relative mean square error: the mean over pixels and channels of the variance of the
/// mean over (mean^2 + 0.01). Where lights are very faint or very strong, 0.01 is relative to them
/// ([`Scene::light_scale`](crate::scene::Scene::light_scale)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// The estimate.
    pub estimate: f64,
    /// Lower end of its interval of 95 %.
    pub low: f64,
    /// Upper end of its interval of 95 %.
    pub high: f64,
}
