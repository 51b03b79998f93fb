//! Standard output and standard error, either of which may be gone: a closed pipe, a full disk.
//!
//! What a command was asked for goes to standard output, and cannot be lost unnoticed. What it says beside goes to
//! standard error, and is dropped where it cannot be written: no work is lost for a log.

use std::io::{self, Write as _};

use super::Failure;
use crate::input::system::in_words;

/// Prints what was asked for.
///
/// # Errors
/// [`Failure::Closed`] if whoever read it has gone, else [`Failure::Input`] with the reason.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|error| match error.kind() {
        io::ErrorKind::BrokenPipe => Failure::Closed,
        _ => Failure::Input(format!("error: cannot write standard output: {}", in_words(&error))),
    })
}

/// Says a line beside the work.
pub(super) fn say(line: &str) {
    say_bytes(format!("{line}\n").as_bytes());
}

/// Says whole lines beside the work.
pub(super) fn say_bytes(lines: &[u8]) {
    // There is nowhere left to complain.
    let _ = io::stderr().write_all(lines);
}
