//! Curves and meshes in files: curve formats, OBJ meshes, and stages (USD, Alembic).
//!
//! Bytes in, curves and meshes out: each count is held against the file's size, and what cannot be read is told with its place.

pub mod curve_file;
pub(crate) mod mesh_file;
pub(crate) mod obj;
pub(crate) mod obj_text;
pub mod stage;

use std::path::Path;

/// What a file's name ends in, without the dot, in small letters.
pub(crate) fn extension(path: &Path) -> Option<String> {
    path.extension().map(|extension| extension.to_string_lossy().to_lowercase())
}

/// What to do with a file that [`foreign`] knows.
pub(crate) const EXPORT: &str = "export it as USD, Alembic or OBJ";

/// The format of meshes and scenes that a file's name tells and that is not read, by its usual name.
pub(crate) fn foreign(path: &Path) -> Option<&'static str> {
    Some(match extension(path)?.as_str() {
        "fbx" => "FBX",
        "gltf" | "glb" => "glTF",
        "stl" => "STL",
        "ply" => "PLY",
        "dae" => "Collada",
        "3ds" | "max" => "3ds Max",
        "ma" | "mb" => "Maya",
        "blend" => "Blender",
        "c4d" => "Cinema 4D",
        "hip" | "hiplc" | "hipnc" | "bgeo" | "geo" => "Houdini",
        "zprj" | "zpac" => "CLO and Marvelous Designer",
        "vdb" => "OpenVDB",
        _ => return None,
    })
}

/// Whether a file's name ends in this, in letters of any size.
pub(crate) fn has_extension(path: &Path, wanted: &str) -> bool {
    extension(path).is_some_and(|extension| extension == wanted)
}
