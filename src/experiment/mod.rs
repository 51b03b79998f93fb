//! Experiments on the renderer's own parts: what they say, held against what is true.
//!
//! [`goniometer`] measures how a fibre, ply or yarn scatters; [`stress`] runs stiff and extreme cases. [`converge`] measures
//! error against run time; [`table3`] what explicit fibres and aggregated yarns cost at equal quality, [`fidelity`] how far
//! apart their pictures are, as a [`suite`] says.

pub(crate) mod converge;
pub(crate) mod converged;
pub(crate) mod fidelity;
pub mod goniometer;
pub(crate) mod method;
pub(crate) mod stress;
pub(crate) mod suite;
pub(crate) mod table3;

/// Names of the lobes in the files that experiments write.
pub const LOBES: [&str; 5] = crate::scattering::LobeValues::NAMES;
