//! Scene files.
#![no_main]

use std::io::Write as _;

use libfuzzer_sys::fuzz_target;
use yarnray::scene::load::{LoadOptions, load};

fuzz_target!(|data: &[u8]| {
    let mut file = tempfile::Builder::new().suffix(".toml").tempfile().expect("a temporary file");
    file.write_all(data).expect("room on the disk");
    let _ = load(file.path(), &LoadOptions::default());
});
