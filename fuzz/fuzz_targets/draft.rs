//! Weaving drafts (WIF).
#![no_main]

use libfuzzer_sys::fuzz_target;
use yarnray::pattern::wif::{WifUse, parse};

fuzz_target!(|data: &[u8]| {
    if let Ok(file) = parse(data) {
        let _ = file.woven(WifUse::default());
    }
});
