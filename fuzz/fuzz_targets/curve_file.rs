//! Every curve format from bytes: the first byte chooses the format.
#![no_main]

use libfuzzer_sys::fuzz_target;
use yarnray::files::curve_file::{Format, ReadOptions, parse};

fuzz_target!(|data: &[u8]| {
    let Some((choice, bytes)) = data.split_first() else { return };
    let formats = [Format::Bcc, Format::Hair, Format::Obj, Format::Pyp, Format::Text, Format::Yarns];
    let options = ReadOptions { max_points: 1 << 16, ..ReadOptions::default() };
    let _ = parse(bytes, formats[usize::from(*choice) % formats.len()], &options);
});
