//! Helpers of the tests: cloth, data of the project, and data that lies beside it and is not part of it.

use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

use crate::pattern::{
    chart::Chart,
    knit::{Edges, FLATTEN, Form, Knit, Rims, Thickness},
    tile::Tile,
};

/// Stockinette of stitches of 4 x 3 mm.
pub(crate) fn stockinette() -> Tile {
    Tile::of_knit(&stockinette_knit(), &Thickness::round(0.6)).unwrap()
}

fn stockinette_knit() -> Knit {
    Knit {
        chart: Chart::named("stockinette").unwrap(),
        stitches: 1,
        rows: 1,
        form: Form::Flat,
        stitch_width: Some(4.0 / 1.2),
        row_height: Some(3.0 / 1.2),
        yarn_per_stitch: Some(13.9),
        edges: Edges::Live,
        rims: Rims::default(),
        points: 24,
        colors: None,
        flat: true,
    }
}

/// Stockinette as it comes by itself, of yarn of three plies that stitches press flat: of stitches of 4 x 2.8 mm.
pub(crate) fn pressed_stockinette() -> Tile {
    let knit = Knit { stitch_width: None, row_height: None, yarn_per_stitch: None, ..stockinette_knit() };
    Tile::of_knit(&knit, &Thickness { radius: 0.65, half_width: 0.91, flatten: FLATTEN }).unwrap()
}

/// The text of a file of `tests/data`.
pub(crate) fn data(name: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Writes a PNG of 8 bits a channel, the top row first.
pub(crate) fn write_png(path: &Path, width: usize, color: png::ColorType, bytes: &[u8]) {
    let height = bytes.len() / (width * color.samples());
    let file = std::fs::File::create(path).unwrap();
    let mut encoder = png::Encoder::new(file, width as u32, height as u32);
    encoder.set_color(color);
    encoder.write_header().unwrap().write_image_data(bytes).unwrap();
}

/// Says what is not tested, past the harness, which would show it for failed tests only.
pub(crate) fn skipped(what: &str) {
    let _ = writeln!(std::io::stderr(), "skipped: {what}");
}

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
        skipped(&format!("{name} is not beside the project"));
    }
    text
}
