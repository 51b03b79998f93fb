//! Pictures that commands write of a film.

use std::path::PathBuf;

use clap::Args;

use super::{files::Attempts, named};
use crate::{
    image::png::{Display, ToneMap},
    render::picture::{self, Picture},
};

/// What the command line says of pictures for a screen.
#[derive(Args, Debug, Clone)]
pub(super) struct DisplayArgs {
    /// Curve of the picture for a screen.
    #[arg(long, value_parser = named(&ToneMap::NAMES))]
    tone_map: Option<ToneMap>,
    /// Exposure of the picture for a screen, in stops.
    #[arg(long, value_name = "STOPS", value_parser = stops)]
    exposure: Option<f32>,
}

impl DisplayArgs {
    /// Lets it win over what a scene says.
    pub(super) fn apply(&self, display: &mut Display) {
        display.tone_map = self.tone_map.unwrap_or(display.tone_map);
        display.exposure = self.exposure.unwrap_or(display.exposure);
    }
}

/// Reads a number of stops.
fn stops(text: &str) -> Result<f32, String> {
    text.parse()
        .ok()
        .filter(|s| (-100.0..=100.0).contains(s))
        .ok_or_else(|| "expected a number of stops from -100 to 100".to_owned())
}

/// The pictures without noise that stand beside others, where a format has no room for both.
pub(super) fn denoised_beside(paths: &[PathBuf]) -> Vec<PathBuf> {
    paths.iter().filter_map(|path| picture::denoised_path(path)).collect()
}

/// Writes a picture to all paths, and without noise beside them; gives the files written.
pub(super) fn write_pictures(paths: &[PathBuf], picture: &Picture, attempts: &mut Attempts) -> Vec<PathBuf> {
    let mut written = Vec::new();
    for path in paths {
        if attempts.note(picture.write(path)) {
            written.push(path.clone());
        }
        match picture.write_denoised(path) {
            Ok(beside) => written.extend(beside),
            Err(error) => _ = attempts.note(Err(error)),
        }
    }
    written
}
