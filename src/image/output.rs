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

/// Files of one extension.
struct Kind {
    extension: &'static str,
    format: Format,
    /// Whether they hold alpha.
    alpha: bool,
    /// The most pixels across and down, where that is less than a render may have.
    most: Option<usize>,
}

/// All that can be written.
const KINDS: [Kind; 11] = {
    const fn kind(extension: &'static str, format: Format) -> Kind {
        Kind { extension, format, alpha: true, most: None }
    }
    const fn opaque(kind: Kind) -> Kind {
        Kind { alpha: false, ..kind }
    }
    const fn at_most(most: usize, kind: Kind) -> Kind {
        Kind { most: Some(most), ..kind }
    }
    [
        kind("exr", Format::Exr),
        kind("png", Format::Png),
        opaque(kind("hdr", Format::Linear)),
        kind("tif", Format::Linear),
        kind("tiff", Format::Linear),
        // libjpeg ends the process where there are more.
        opaque(at_most(65_500, kind("jpg", Format::Screen))),
        opaque(at_most(65_500, kind("jpeg", Format::Screen))),
        kind("bmp", Format::Screen),
        at_most(65_535, kind("tga", Format::Screen)),
        opaque(kind("ppm", Format::Screen)),
        at_most(16_383, kind("webp", Format::Screen)),
    ]
};

impl Kind {
    fn of(path: &Path) -> Result<&'static Self, ImageError> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
        let known = |found: &str| KINDS.iter().find(|kind| kind.extension == found);
        if let Some(kind) = extension.as_deref().and_then(known) {
            return Ok(kind);
        }
        let problem =
            extension.map_or_else(|| "it has no extension".to_owned(), |e| format!("unknown extension `{e}`"));
        let known = listed(KINDS.map(|kind| kind.extension.to_owned()), "and");
        Err(ImageError::unwritable(path, format!("{problem}; known are {known}")))
    }
}

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
        Kind::of(path).map(|kind| kind.format)
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

/// Checks that the format has room for a picture of this size; makes nothing.
///
/// # Errors
/// [`ImageError::Write`].
pub fn check_size(path: &Path, width: usize, height: usize) -> Result<(), ImageError> {
    match Kind::of(path)? {
        Kind { extension, most: Some(most), .. } if width.max(height) > *most => {
            let problem = format!("{width} x {height} pixels: .{extension} has room for {most} across and down");
            Err(ImageError::unwritable(path, problem))
        }
        _ => Ok(()),
    }
}

/// Writes colours in the format that the extension names. `row` is asked for every row from the top and fills in
/// associated linear RGBA.
///
/// EXR, Radiance and TIFF get linear floats; the rest of `display` is for the others only. Alpha is written if
/// `display.alpha`; formats without it (JPEG, PPM, Radiance) get the picture over black.
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
    check_size(path, width, height)?;
    let &Kind { format, alpha, .. } = Kind::of(path)?;
    let display = Display { alpha: display.alpha && alpha, ..*display };
    let channels = if display.alpha { 4 } else { 3 };
    match format {
        Format::Png => return png::write(path, width, height, &display, row),
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
