//! Shapes, no light: yarn curves and their files, frames along them, plies in the cross-section.

mod chain;
pub mod curve;
pub mod curve_file;
pub(crate) mod density;
pub mod fiber;
pub(crate) mod garment;
pub mod mesh;
pub(crate) mod obj;
pub(crate) mod occluder;
pub mod pattern;
pub(crate) mod proposal;
pub mod ray;
pub mod section;
pub(crate) mod segment_uvs;
mod spline;
pub mod stage;
pub mod strand;
pub(crate) mod tube;
pub(crate) mod unreadable;
pub(crate) mod walk;
pub(crate) mod way;
pub mod yarn;
pub mod yarn_frame;
