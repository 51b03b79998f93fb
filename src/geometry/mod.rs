//! Shapes, no light: yarn curves, frames along them, plies in the cross-section, fibres in plies.

pub(crate) mod after_fiber;
pub(crate) mod chain;
pub(crate) mod cleared_strip;
pub(crate) mod contact;
pub mod curve;
pub(crate) mod density;
pub mod fiber;
pub(crate) mod first_fiber;
pub(crate) mod gaps;
pub mod length;
pub mod material_indices;
pub mod mesh;
pub(crate) mod occluder;
pub mod overlap;
pub mod ply;
pub(crate) mod proposal;
pub mod ray;
pub mod section;
pub(crate) mod segment_uvs;
pub(crate) mod spline;
pub mod strand;
pub(crate) mod tube;
pub(crate) mod walk;
pub(crate) mod way;
pub mod yarn;
pub mod yarn_frame;
