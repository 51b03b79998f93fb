//! Output files: which formats there are, whether a path can be written, and files that appear whole or not at all.

use std::{
    fs::{self, File},
    io::{self, Seek as _},
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

use super::{
    ImageError,
    exr::{self, ChannelSpec, ExrLayout, Line, Sample},
    oiio,
    png::{self, Display},
};
use crate::input::{diagnostic::listed, system::in_words};

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
    check_file(path)?;
    Ok(format)
}

/// Checks before a long render that a file can be written to `path` afterwards, and creates missing directories. An
/// existing file stays untouched.
///
/// # Errors
/// [`ImageError::Write`].
pub fn check_file(path: &Path) -> Result<(), ImageError> {
    check_target(path)?;
    // Dropped at once, and with that removed.
    temporary(path).map(drop)
}

/// Writes a file so that it is seen whole or not at all: the content goes to a temporary file beside it, which takes
/// the name `path` at the end. Missing directories are created. A link is followed.
///
/// A target that is no ordinary file, such as /dev/stdout, is written to after the content is complete.
///
/// # Errors
/// [`ImageError::Write`]; then nothing is left behind, and an older file of this name is as it was.
pub fn write_file(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), ImageError> {
    replace(path, |temporary| write(temporary.as_file_mut()).map_err(|error| in_words(&error)))
}

/// Writes a file that is written again and again and must outlive the machine's failures: the content is
/// on the disk before it takes the name `path`, and a program that is killed meanwhile leaves one file, `path.new`, that the
/// next one writes over. Links, and targets that are no ordinary files, are as for [`write_file`].
///
/// # Errors
/// [`ImageError::Write`]; then an older file of this name is as it was.
pub fn write_durable(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), ImageError> {
    check_target(path)?;
    let target = behind_links(path);
    if is_special(&target) {
        return write_file(path, write);
    }
    let mut beside = target.clone().into_os_string();
    beside.push(".new");
    let beside = Path::new(&beside);
    let written = File::create(beside).and_then(|mut file| {
        write(&mut file)?;
        file.sync_all()
    });
    written.and_then(|()| fs::rename(beside, &target)).map_err(|error| {
        // What cannot be removed is written over the next time.
        let _ = fs::remove_file(beside);
        ImageError::unwritable(path, in_words(&error))
    })
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
    replace(path, |temporary| oiio::write(temporary.path(), [width, height], channels, &samples, screen))
}

/// Lets `write` fill a temporary file with the extension of `path`, then gives it that name.
fn replace(path: &Path, write: impl FnOnce(&mut NamedTempFile) -> Result<(), String>) -> Result<(), ImageError> {
    check_target(path)?;
    let target = behind_links(path);
    let mut temporary = temporary(&target).map_err(|error| ImageError::unwritable(path, error.reason()))?;
    write(&mut temporary).map_err(|reason| ImageError::unwritable(path, reason))?;
    if is_special(&target) {
        // Renaming would put a file in the place of the device or pipe.
        let copied = File::options().write(true).open(&target).and_then(|mut device| {
            temporary.rewind()?;
            io::copy(&mut temporary, &mut device)
        });
        return copied.map(drop).map_err(|error| ImageError::unwritable(path, in_words(&error)));
    }
    temporary.persist(&target).map_err(|error| ImageError::unwritable(path, in_words(&error.error)))?;
    Ok(())
}

/// What a path names in the end, there or not yet: the name of a link stays a link, and its target is what is replaced.
fn behind_links(path: &Path) -> PathBuf {
    let nowhere = || Some(directory_of(path).unwrap_or(Path::new(".")).join(fs::read_link(path).ok()?));
    fs::canonicalize(path).ok().or_else(nowhere).unwrap_or_else(|| path.to_owned())
}

/// Whether something that is neither a file nor a directory has this name: a device, a pipe.
fn is_special(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
}

/// Refuses directories, read-only files and directories that cannot be; makes nothing.
pub fn check_place(path: &Path) -> Result<(), ImageError> {
    if let Ok(metadata) = fs::metadata(path) {
        if metadata.is_dir() {
            return Err(ImageError::unwritable(path, "it is a directory"));
        }
        if metadata.permissions().readonly() {
            return Err(ImageError::unwritable(path, "the file exists and is read-only"));
        }
    }
    match directory_of(path).into_iter().flat_map(Path::ancestors).find_map(|place| fs::metadata(place).ok()) {
        Some(place) if !place.is_dir() => Err(no_directory(path, "a file is in its place")),
        _ => Ok(()),
    }
}

/// As [`check_place`], and creates the directory that the file goes into.
pub fn check_target(path: &Path) -> Result<(), ImageError> {
    check_place(path)?;
    let Some(directory) = directory_of(path) else { return Ok(()) };
    fs::create_dir_all(directory).map_err(|error| no_directory(path, &in_words(&error)))
}

fn directory_of(path: &Path) -> Option<&Path> {
    path.parent().filter(|directory| !directory.as_os_str().is_empty())
}

fn no_directory(path: &Path, reason: &str) -> ImageError {
    let directory = directory_of(path).unwrap_or(Path::new(".")).display();
    ImageError::unwritable(path, format!("no directory `{directory}`, and it cannot be created: {reason}"))
}

/// An empty file in the directory of `path`, with its extension and the permissions of any new file, that is removed
/// when dropped.
fn temporary(path: &Path) -> Result<NamedTempFile, ImageError> {
    let suffix = path.extension().map(|extension| format!(".{}", extension.to_string_lossy())).unwrap_or_default();
    let parent = directory_of(path).unwrap_or(Path::new("."));
    let elsewhere = std::env::temp_dir();
    let directory = if is_special(path) { elsewhere.as_path() } else { parent };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".yarnray-").suffix(&suffix);
    #[cfg(unix)]
    // The umask still applies; without this, only the owner could read the picture.
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(directory).map_err(|error| {
        let reason = format!("no file can be made in `{}`: {}", directory.display(), in_words(&error));
        ImageError::unwritable(path, reason)
    })
}
