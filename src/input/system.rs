//! Why the operating system refuses a file, in the words that all messages share.

use std::io;

/// The usual hindrances; `None` for the others, which the operating system has its own words for.
pub(crate) fn hindrance(error: &io::Error) -> Option<&'static str> {
    match error.kind() {
        io::ErrorKind::NotFound => Some("no such file"),
        io::ErrorKind::PermissionDenied => Some("permission denied"),
        io::ErrorKind::NotADirectory => Some("part of the path is not a directory"),
        io::ErrorKind::StorageFull => Some("the disk is full"),
        io::ErrorKind::ReadOnlyFilesystem => Some("the file system is read-only"),
        _ => None,
    }
}

/// The hindrance, or else the operating system's words.
pub(crate) fn in_words(error: &io::Error) -> String {
    hindrance(error).map_or_else(|| error.to_string(), str::to_owned)
}
