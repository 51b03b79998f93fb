//! Integration tests: the program and the library from outside, as people and scripts meet them.
//!
//! Data that lies beside the project is looked for under `YARNRAY_SHARED`, or `../shared`; what needs it says that it
//! was skipped where it is absent.

// Table 3's procedure from end to end, resumed, and with mistakes in suites.
mod bench;
// What the command line promises: help, info, statistics, outputs, stops, signals, metadata.
mod cli;
// What compositors get: parts that add up to the picture, precision and compression.
mod compositing;
// Colour work: yarns by row and motif, pictures over cloth and meshes, variation from yarn to yarn.
mod colors;
// The same picture to the bit: threads, repeated runs, crops; and another one for another seed.
mod determinism;
// Scenes against what they looked like, within their noise.
mod golden;
// Two pictures against each other: metrics, masks, thresholds, maps and pages.
mod compare;
// Curve files from one format to another; curves, meshes and cameras of stages in scenes; completions, manuals.
mod convert;
// Error against run time: files, slopes, converged pictures that are kept.
mod converge;
// Licences and sources of what the program links, and the compiler that it asks for.
mod dependencies;
// Sequences: numbered files, moving cameras and yarns, the shutter.
mod frames;
// What bad input is answered with: whole messages, exit status 2, no output.
mod errors;
// Scenes that are built in code, without text.
mod builder;
// Pictures against explicit fibres, where the truths lie beside the project.
mod fabric_truth;
// White cloth under a white sky is as bright as the sky.
mod furnace;
// Cloth laid on garment meshes: movement, prints, seams, and what cannot be laid.
mod garments;
// Damaged scene files give errors, never panics.
mod fuzz;
// Yarns, plies or fibres as curves: the same cloth, its memory told beforehand.
mod modes;
// Every command that help and documents print.
mod documented;
// Checkpoints, shards and merging: the same picture, whatever happens on the way.
mod farm;
// What must not change a picture: units, places, seams, and the way plies are intersected where it cannot matter.
mod invariance;
// Which room of the crate may use which, and what may stand in one room only.
mod layering;
// Lights of all kinds against closed forms and against each other.
mod lights;
// The virtual goniometer.
mod scatter;
// Meshes and the materials of surfaces.
mod meshes;
// Cloth that the program makes: formats, overlap, errors.
mod make;
// Every scene of the project, and real curve files.
mod scenes;
// What an EXR says of the camera, and the layers of position, motion and texture coordinates.
mod seen;
// Stiff and extreme cases, as the program reports them.
mod stress;
// Outputs that fail, clash or have nowhere to go.
mod outputs;
// A real Slurm of one machine: shards, a requeued one among them, make the frame of one machine.
mod slurm;
// Temporary directories, runs of the program, pictures: what the others share.
mod support;
