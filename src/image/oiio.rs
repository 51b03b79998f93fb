//! The pictures that only OpenImageIO knows: Radiance, TIFF, JPEG and the rest.
//!
//! Everything else in this room calls these three functions and need not know whether the feature is built in.

use std::path::Path;

use super::{Image, ImageError};

#[cfg(feature = "oiio")]
use {
    super::{Channel, SAMPLE_LIMIT},
    crate::{
        ffi::oiio::{self as library, OiioError},
        math::srgb::srgb_to_linear,
    },
};

#[cfg(not(feature = "oiio"))]
const MISSING: &str = "only EXR and PNG are built in; other formats need OpenImageIO: build with the feature `oiio`";

/// Reads a picture of any format that OpenImageIO knows; integer samples are made linear.
#[cfg(feature = "oiio")]
pub(super) fn read(path: &Path) -> Result<Image, ImageError> {
    let picture = library::read(path, SAMPLE_LIMIT).map_err(|error| match error {
        OiioError::TooLarge(width, height, channels) => {
            ImageError::TooLarge { path: path.into(), width, height, channels }
        }
        OiioError::Missing(_) => ImageError::Unsupported { path: path.into(), reason: error.to_string() },
        OiioError::Failed(reason) => ImageError::Read { path: path.into(), reason },
    })?;
    let names = picture.channel_names();
    let decode: fn(f32) -> f32 = if picture.is_srgb_encoded() { srgb_to_linear } else { |value| value };
    let channels = names
        .into_iter()
        .enumerate()
        .map(|(index, name)| {
            let samples = picture.samples().iter().skip(index).step_by(picture.channel_count()).copied();
            let is_alpha = picture.alpha_channel() == Some(index);
            let samples = if is_alpha { samples.collect() } else { samples.map(decode).collect() };
            Channel { name, samples }
        })
        .collect();
    Ok(Image {
        origin: picture.origin(),
        display_size: picture.display_size(),
        channels,
        ..Image::new(picture.width(), picture.height())
    })
}

/// Without the feature: an error that says how to get it.
#[cfg(not(feature = "oiio"))]
pub(super) fn read(path: &Path) -> Result<Image, ImageError> {
    Err(ImageError::Unsupported { path: path.into(), reason: MISSING.into() })
}

/// Checks that OpenImageIO is there and can write what the extension names.
#[cfg(feature = "oiio")]
pub(super) fn check_writable(path: &Path) -> Result<(), ImageError> {
    match library::can_write(path) {
        Ok(true) => Ok(()),
        Ok(false) => Err(ImageError::unwritable(path, "this OpenImageIO has no writer for the format")),
        Err(error) => Err(ImageError::unwritable(path, error.to_string())),
    }
}

/// Without the feature: an error that says how to get it.
#[cfg(not(feature = "oiio"))]
pub(super) fn check_writable(path: &Path) -> Result<(), ImageError> {
    Err(ImageError::unwritable(path, MISSING))
}

/// Writes interleaved samples to `path`, whose extension names the format: bytes if `eight_bits`, else floats.
/// The error is a reason without a path, since `path` is a temporary name.
#[cfg(feature = "oiio")]
pub(super) fn write(
    path: &Path,
    size: [usize; 2],
    channels: usize,
    samples: &[f32],
    eight_bits: bool,
) -> Result<(), String> {
    let sample = if eight_bits { library::Sample::U8 } else { library::Sample::Float };
    library::write(path, size, channels, samples, sample).map_err(|error| error.to_string())
}

/// Without the feature: an error that says how to get it.
#[cfg(not(feature = "oiio"))]
pub(super) fn write(
    _path: &Path,
    _size: [usize; 2],
    _channels: usize,
    _samples: &[f32],
    _eight_bits: bool,
) -> Result<(), String> {
    Err(MISSING.to_owned())
}
