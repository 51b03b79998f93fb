//! Numbers, not yarns: colours in one register, frames, special functions, sample points, exact sums, small statistics, numbers in words.
//!
//! Knows nothing of curves, light or files. `f32` serves rays and directions, `f64` tables and sums.

pub(crate) mod exact;
pub(crate) mod frame;
pub mod rgb;
pub mod sampler;
pub(crate) mod special;
pub(crate) mod srgb;
pub(crate) mod stats;
pub(crate) mod warp;
pub(crate) mod words;

pub use rgb::Rgb;
