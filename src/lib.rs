//! x
#![deny(unsafe_code)]
pub mod ffi;
pub mod geometry;
pub mod image;
pub mod math;
pub mod scattering;
pub mod scene;
#[cfg(test)]
mod testing;
