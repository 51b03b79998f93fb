//! Shapes, no light: yarn curves and their files, frames along them, plies in the cross-section.

mod chain;
pub mod curve;
pub mod curve_file;
pub mod density;
pub mod fiber;
pub mod garment;
pub mod mesh;
pub mod obj;
pub mod occluder;
pub mod pattern;
pub mod proposal;
pub mod ray;
pub mod section;
pub mod segment_uvs;
mod spline;
pub mod stage;
pub mod strand;
pub mod tube;
pub(crate) mod unreadable;
pub mod walk;
pub mod way;
pub mod yarn;
pub mod yarn_frame;
