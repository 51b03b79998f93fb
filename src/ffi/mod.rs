//! The fence: what is written in C or C++ is reached through this folder, and `unsafe` is found nowhere else.
//!
//! - Each `unsafe` block says in a `SAFETY:` comment which promise it relies on, and what is passed out is safe to use.
//! - No panic crosses into C, no exception into Rust: callbacks and C++ bodies catch them.
//! - An error is read at once after the call that can fail, with its message, and becomes a `Result`.
//! - What C allocates is released by `Drop`.
#![allow(unsafe_code, reason = "calling C is unsafe; this folder is where it is checked")]

pub(crate) mod embree;
pub(crate) mod heap;
pub(crate) mod oidn;
#[cfg(feature = "oiio")]
pub(crate) mod oiio;

/// The loader's own words, which stand in the source of libloading's error.
fn reason(error: &libloading::Error) -> String {
    std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string)
}
