//! From scene files to a checked description: text, positions, typed reading, and the messages on the way.
//!
//! [`document`] turns TOML text and `--set` options into one tree that knows where everything was written;
//! [`reader`] reads that tree key by key and collects what is wrong; [`diagnostic`] shows it to the user.
//! None of the three knows which keys the renderer has.

pub mod diagnostic;
pub mod document;
pub mod reader;
