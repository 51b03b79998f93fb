//! x
#![deny(unsafe_code)]
pub mod ffi;
pub mod math;
pub mod geometry;
pub mod scattering;
