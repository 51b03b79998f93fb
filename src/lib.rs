//! x
#![deny(unsafe_code)]
pub mod cli;
pub mod ffi;
pub mod film;
pub mod geometry;
pub mod image;
pub mod integrator;
pub mod math;
pub mod plan;
pub mod render;
pub mod report;
pub mod scattering;
pub mod scene;
#[cfg(test)]
mod testing;
pub mod trace;
