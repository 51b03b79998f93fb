//! Weaving drafts (WIF).
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _ = yarnray::geometry::pattern::wif::parse(data);
});
