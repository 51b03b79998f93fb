//! Files that appear whole or not at all, and whether a path can be written.

use std::{
    fs::{self, File},
    io::{self, Seek as _},
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

use super::ImageError;
use crate::input::system::in_words;

/// Checks before a long render that a file can be written to `path` afterwards, and creates missing directories. An
/// existing file stays untouched.
///
/// # Errors
/// [`ImageError::Write`].
pub fn check(path: &Path) -> Result<(), ImageError> {
    let target = behind_links(path);
    check_target(&target)?;
    if is_special(&target) {
        return Ok(());
    }
    // Dropped at once, and with that removed.
    temporary(&target).map(drop)
}

/// Writes a file so that it is seen whole or not at all: the content goes to a temporary file beside it, which takes
/// the name `path` at the end. Missing directories are created. A link is followed.
///
/// A target that is no ordinary file, such as /dev/stdout, is written to after the content is complete.
///
/// # Errors
/// [`ImageError::Write`]; then nothing is left behind, and an older file of this name is as it was.
pub fn write(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), ImageError> {
    replace(path, |temporary| write(temporary.as_file_mut()).map_err(|error| in_words(&error)))
}

/// Writes a file that is written again and again and must outlive the machine's failures: the content is
/// on the disk before it takes the name `path`, and a program that is killed meanwhile leaves one file, `path.new`, that the
/// next one writes over. Links, and targets that are no ordinary files, are as for [`write`](fn@write).
///
/// # Errors
/// [`ImageError::Write`]; then an older file of this name is as it was.
pub fn write_durable(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), ImageError> {
    check_target(path)?;
    let target = behind_links(path);
    if is_special(&target) {
        return self::write(path, write);
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

/// Lets `write` fill a temporary file with the extension of `path`, then gives it that name.
pub(super) fn replace(
    path: &Path,
    write: impl FnOnce(&mut NamedTempFile) -> Result<(), String>,
) -> Result<(), ImageError> {
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
