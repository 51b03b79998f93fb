//! Numbers, not yarns: colours in one register, frames, special functions, sample points, exact sums, small statistics.
//!
//! Knows nothing of curves, light or files. `f32` serves rays and directions, `f64` tables and sums.

pub mod exact;
pub mod frame;
pub mod rgb;
pub mod sampler;
pub mod special;
pub mod srgb;
pub mod stats;
pub mod warp;

pub use rgb::Rgb;
