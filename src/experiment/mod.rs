//! Experiments on the renderer's own parts: what they say, held against what is true.
//!
//! [`goniometer`] measures how a fibre, ply or yarn scatters.

pub mod goniometer;
