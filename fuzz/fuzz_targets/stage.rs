//! USD and Alembic: the content chooses the format.
#![no_main]

use std::io::Write as _;

use libfuzzer_sys::fuzz_target;
use yarnray::files::stage::{PrimPattern, Stage};

fuzz_target!(|data: &[u8]| {
    let extension = if data.starts_with(b"Ogawa") {
        ".abc"
    } else if data.starts_with(b"PXR-USDC") {
        ".usdc"
    } else if data.starts_with(b"PK") {
        ".usdz"
    } else {
        ".usda"
    };
    let mut file = tempfile::Builder::new().suffix(extension).tempfile().expect("a temporary file");
    file.write_all(data).expect("room on the disk");
    if let Ok(stage) = Stage::open(file.path()) {
        let _ = stage.curves(&PrimPattern::all(), Some(1.0));
        let _ = stage.mesh(&PrimPattern::all(), Some(1.0));
        let _ = stage.contents();
    }
});
