//! Stitch meshes and their libraries of faces: the mesh, a byte of 0, the library.
#![no_main]

use libfuzzer_sys::fuzz_target;
use yarnray::files::curve_file::{ReadOptions, read};

fuzz_target!(|data: &[u8]| {
    let mut parts = data.splitn(2, |&byte| byte == 0);
    let folder = tempfile::tempdir().expect("a temporary folder");
    for name in ["a.smobj", "a.sf"] {
        std::fs::write(folder.path().join(name), parts.next().unwrap_or_default()).expect("room on the disk");
    }
    let options = ReadOptions { max_points: 1 << 16, ..ReadOptions::default() };
    let _ = read(&folder.path().join("a.smobj"), &options);
});
