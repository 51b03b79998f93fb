//! Knitting: written instructions, and the charts that come of them. The first byte is the number of stitches.
#![no_main]

use libfuzzer_sys::fuzz_target;
use yarnray::pattern::{chart::Chart, knitspeak::chart_rows};

fuzz_target!(|data: &[u8]| {
    let Some((stitches, text)) = data.split_first() else { return };
    let Ok(text) = std::str::from_utf8(text) else { return };
    if let Ok(rows) = chart_rows(text, u32::from(*stitches) + 1) {
        let chart = Chart::parse(&rows).expect("written instructions become steps that charts know");
        let _ = chart.work(u32::from(*stitches) + 1, chart.rows(), 1 << 16);
    }
});
