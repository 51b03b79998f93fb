//! A renderer for knitted and woven cloth: yarns as curves, fibres by an analytic model.
//!
//! Cloth is fibres twisted into plies, plies into yarns, yarns knitted or woven. Here only yarns are geometry. Where a
//! ray meets a yarn its plies are found in the cross-section, and a multi-level scattering model answers for the
//! hundreds of fibres inside: Zhu et al., "A Practical and Hierarchical Yarn-based Shading Model for Cloth", EGSR
//! 2023 ("the paper" everywhere in this code), with the departures that [`scattering`] names.
//!
//! # The way of a picture
//! ```text
//! scene.toml   --input, scene::load------------>  Scene     checked; millimetres, radians; no TOML, no Embree
//! Scene        --cloth------------------------->  curves by the mode, a scattering model for each yarn
//! curves       --trace::World------------------>  what Embree holds, and which light passes
//! camera ray   --trace------------------------->  Hit       place on a yarn, seen in its cross-section
//! Hit          --cloth------------------------->  the model that scatters there
//! Hit          --geometry::section------------->  plies crossed, in order, with their fibres
//! crossings    --scattering-------------------->  value, density, sampled direction of a vertex
//! paths        --integrator-------------------->  radiance of one sample
//! samples      --render, film------------------>  pixels    --render::picture, image-->  EXR, PNG, ...
//! the run      --report, plan------------------>  statistics, metadata                  --cli-->  screen
//! ```
//! A program needs few of them: [`scene`] (a [`scene::SceneBuilder`], or [`scene::load`] for files), [`cloth::Cloth`] and
//! [`render`] make a picture; [`files::curve_file`] and [`pattern`] read and make curves; [`image`] reads
//! pictures and compares them; [`experiment::goniometer`] measures yarns. What is not for others is not public.
//!
//! Only one thing looks back: during traversal Embree asks a filter whether a ray meets a ply or slips through. The
//! filter lives in [`trace`], which knows shapes and transparency only, and is a pure function of ray and hit.
//!
//! # The rooms, from ground to top
//! A room uses only rooms above it in this list (`tests/layering.rs` holds the exact table).
//! * [`ffi`]: Embree, OpenImageIO, Open Image Denoise and the heap behind a safe face; the only `unsafe` code.
//! * [`math`]: numbers, not yarns. [`input`]: TOML with positions, and what is said of files. [`image`]: pictures at rest.
//! * [`geometry`]: shapes, no light: curves, frames along yarns, plies in the cross-section, fibres in plies.
//! * [`pattern`]: cloth made without files: charts are knitted, drafts are woven, yarns relax until they touch.
//! * [`files`]: curves and meshes in files: curve formats, OBJ, USD and Alembic.
//! * [`garment`]: such cloth laid on a garment's mesh, stitch by stitch, and sewn.
//! * [`trace`]: rays against curves and meshes, no light.
//! * [`scattering`]: light at one crossing; pure functions, no rays, no files. [`light`]: light sources.
//! * [`scene`]: what the user asked for. [`cloth`]: its curves by mode, their models, and what a hit scatters by.
//! * [`film`]: what a sample is, and what pixels collect.
//! * [`integrator`]: light along a path. [`render`]: the driver, films in files, and pictures from films.
//! * [`plan`]: what a scene needs and what is left out. [`report`]: what a run was, and what many were.
//! * [`experiment`]: what parts and pictures say, held against what is true. [`cli`]: the program.
//!
//! # Conventions
//! * Lengths are millimetres in a [`scene::Scene`], yarn radii in [`geometry::section`] and [`scattering`]. Angles are
//!   radians everywhere but in files.
//! * Right-handed, +y up. Directions point away from the place of scattering. "Camera" is the side from which a path
//!   comes (the paper's r), "light" the side to which it goes (its i).
//! * theta is measured from the plane across a fibre or yarn, phi around it; phi = 0 is back towards the camera.
//! * Scattering values include the cosine towards the light and are per steradian.
//! * `f32` for rays and directions, `f64` for set-up and sums.

#![deny(unsafe_code)]
#![allow(
    rustdoc::private_intra_doc_links,
    reason = "the map names all rooms; `cargo doc --document-private-items` shows those that are not public"
)]

pub mod cli;
pub mod cloth;
pub mod experiment;
pub(crate) mod ffi;
pub mod files;
pub mod film;
pub(crate) mod garment;
pub mod geometry;
pub mod image;
pub(crate) mod input;
pub(crate) mod integrator;
pub mod light;
pub mod math;
pub mod pattern;
pub(crate) mod plan;
pub mod render;
pub(crate) mod report;
pub mod scattering;
pub mod scene;
#[cfg(test)]
mod testing;
pub mod trace;
