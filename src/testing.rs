//! Helpers of the tests: data that lies beside the project and is not part of it.

use std::path::PathBuf;

/// Where a file of the shared data would be: `YARNRAY_SHARED`, or `../shared` beside the project.
pub(crate) fn shared_path(name: &str) -> PathBuf {
    let base = std::env::var_os("YARNRAY_SHARED")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    base.join(name)
}

/// The text of a shared file; `None`, with a word on standard error, where it is absent.
pub(crate) fn shared(name: &str) -> Option<String> {
    let path = shared_path(name);
    let text = std::fs::read_to_string(&path).ok();
    if text.is_none() {
        eprintln!("skipped: {name} is not beside the project");
    }
    text
}
