//! Pictures as files: which formats there are, whether one can be written, and colours in each of them.

use std::path::Path;

use super::{
    ImageError,
    exr::{self, ChannelSpec, ExrLayout, Line, Sample},
    oiio,
    png::{self, Display},
    whole_file,
};
use crate::input::diagnostic::listed;

/// The extensions that can be written.
const EXTENSIONS: [(&str, Format); 11] = [
    ("exr", Format::Exr),
    ("png", Format::Png),
    ("hdr", Format::Linear),
    ("tif", Format::Linear),
    ("tiff", Format::Linear),
    ("jpg", Format::Screen),
    ("jpeg", Format::Screen),
    ("bmp", Format::Screen),
    ("tga", Format::Screen),
    ("ppm", Format::Screen),
    ("webp", Format::Screen),
];

/// What kind of file the extension of a path asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Multi-layer EXR: linear floats.
    Exr,
    /// PNG: eight bits for a screen.
    Png,
    /// A format of OpenImageIO with linear floats.
    Linear,
    /// A format of OpenImageIO with eight bits for a screen.
    Screen,
}

impl Format {
    /// The format that the extension names.
    ///
    /// # Errors
    /// [`ImageError::Write`], which lists the known extensions.
    pub fn of(path: &Path) -> Result<Self, ImageError> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
        let known = |found: &str| EXTENSIONS.iter().find(|(name, _)| *name == found).map(|(_, format)| *format);
        if let Some(format) = extension.as_deref().and_then(known) {
            return Ok(format);
        }
        let problem =
            extension.map_or_else(|| "it has no extension".to_owned(), |e| format!("unknown extension `{e}`"));
        let known = listed(EXTENSIONS.map(|(name, _)| name.to_owned()), "and");
        Err(ImageError::unwritable(path, format!("{problem}; known are {known}")))
    }
}

/// Checks before a long render that a picture can be written to `path` afterwards, and creates missing directories.
///
/// The extension must be known; if the format needs OpenImageIO, it is loaded and asked. A file must be possible in
/// the directory. An existing file stays untouched.
///
/// # Errors
/// [`ImageError::Write`].
pub fn check_writable(path: &Path) -> Result<Format, ImageError> {
    let format = Format::of(path)?;
    if matches!(format, Format::Linear | Format::Screen) {
        oiio::check_writable(path)?;
    }
    whole_file::check(path)?;
    Ok(format)
}

/// Writes colours in the format that the extension names. `row` is asked for every row from the top and fills in
/// associated linear RGBA.
///
/// EXR, Radiance and TIFF get linear floats, and alpha if `display.alpha` (Radiance has none); `display` is for the
/// others only.
///
/// # Errors
/// [`ImageError::Write`]; then nothing has been left behind.
pub fn write_colors(
    path: &Path,
    width: usize,
    height: usize,
    display: &Display,
    mut row: impl FnMut(usize, &mut [[f32; 4]]),
) -> Result<(), ImageError> {
    let format = Format::of(path)?;
    let is_radiance = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("hdr"));
    let channels = if display.alpha && !is_radiance { 4 } else { 3 };
    match format {
        Format::Png => return png::write(path, width, height, display, row),
        Format::Exr => {
            let channels = ["R", "G", "B", "A"][..channels].iter().map(|name| ChannelSpec::new(*name, Sample::F32));
            let layout = ExrLayout::new(width, height, channels.collect());
            let mut colors = vec![[0.0; 4]; width];
            return exr::write(path, &layout, |y, lines| {
                colors.fill([0.0; 4]);
                row(y, &mut colors);
                for (channel, line) in lines.iter_mut().enumerate() {
                    if let Line::Float(line) = line {
                        line.iter_mut().zip(&colors).for_each(|(sample, color)| *sample = color[channel]);
                    }
                }
            });
        }
        Format::Linear | Format::Screen => {}
    }
    let screen = format == Format::Screen;
    let mut samples = Vec::with_capacity(width * height * channels);
    let mut colors = vec![[0.0; 4]; width];
    for y in 0..height {
        colors.fill([0.0; 4]);
        row(y, &mut colors);
        for color in &colors {
            if screen {
                let bytes = display.encode(*color);
                samples.extend(bytes[..channels].iter().map(|byte| f32::from(*byte) / 255.0));
            } else {
                samples.extend_from_slice(&color[..channels]);
            }
        }
    }
    whole_file::replace(path, |temporary| oiio::write(temporary.path(), [width, height], channels, &samples, screen))
}
