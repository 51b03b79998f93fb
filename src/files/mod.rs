//! Curves and meshes in files: curve formats, OBJ meshes, and stages (USD, Alembic).
//!
//! Bytes in, curves and meshes out: each count is held against the file's size, and what cannot be read is told with its place.

pub mod curve_file;
pub(crate) mod obj;
pub mod stage;
pub(crate) mod unreadable;
