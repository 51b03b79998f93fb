//! Curves and meshes in files: curve formats, OBJ meshes, and stages (USD, Alembic).
//!
//! Bytes in, curves and meshes out: each count is held against the file's size, and what cannot be read is told with its place.

pub mod curve_file;
pub(crate) mod mesh_file;
pub(crate) mod obj;
pub mod stage;

use std::path::Path;

/// What a file's name ends in, without the dot, in small letters.
pub(crate) fn extension(path: &Path) -> Option<String> {
    path.extension().map(|extension| extension.to_string_lossy().to_lowercase())
}

/// Whether a file's name ends in this, in letters of any size.
pub(crate) fn has_extension(path: &Path, wanted: &str) -> bool {
    extension(path).is_some_and(|extension| extension == wanted)
}
