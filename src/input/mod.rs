//! Text files from the user, and every message about them.
//!
//! [`document`] turns TOML text and `--set` options into one tree that knows where everything was written; [`reader`]
//! reads it key by key and collects what is wrong; [`diagnostic`] shows that to the user. Scenes and suites are read
//! with them; this module knows the keys of neither. [`system`] has the words for what the operating system refuses.

pub(crate) mod diagnostic;
pub(crate) mod document;
pub(crate) mod reader;
pub(crate) mod system;
