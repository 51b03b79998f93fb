//! OpenImageIO, loaded when an image first needs it and not before.
//!
//! `ffi/oiio.cpp` is compiled to a small shared library that travels inside this program (see `build.rs`). It is put
//! into memory and loaded on the first call here, and only then the loader brings in OpenImageIO itself: 126 MB
//! resident and 260 libraries on Debian 12, which a scene without such images must not pay for.

use std::{
    ffi::{CStr, CString, c_char},
    fmt,
    io::Write as _,
    os::fd::AsRawFd as _,
    os::unix::ffi::OsStrExt as _,
    path::Path,
    ptr, slice,
    sync::OnceLock,
};

use super::reason;

/// What bindgen makes from `ffi/oiio.h`.
#[allow(
    missing_docs,
    unreachable_pub,
    non_camel_case_types,
    unsafe_op_in_unsafe_fn,
    dead_code,
    clippy::all,
    clippy::undocumented_unsafe_blocks,
    clippy::allow_attributes_without_reason,
    reason = "generated code"
)]
mod face {
    include!(concat!(env!("OUT_DIR"), "/oiio_face.rs"));
}

static LIBRARY: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/liboiio_face.so"));
static FACE: OnceLock<Result<face::Face, String>> = OnceLock::new();

const MESSAGE_SIZE: usize = 1024;

/// Why OpenImageIO did not do what it was asked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum OiioError {
    /// The library itself cannot be loaded; the loader's reason.
    Missing(String),
    /// The picture has more samples than the caller allows: width, height, channels.
    TooLarge(usize, usize, usize),
    /// OpenImageIO's own message.
    Failed(String),
}

impl fmt::Display for OiioError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing(reason) => write!(formatter, "OpenImageIO cannot be loaded ({reason}); run tools/setup"),
            Self::TooLarge(width, height, channels) => {
                write!(formatter, "{width} x {height} pixels of {channels} channels are too many")
            }
            Self::Failed(reason) => write!(formatter, "{reason}"),
        }
    }
}

impl std::error::Error for OiioError {}

/// How the samples of a file are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sample {
    /// Eight bits: 0 to 1 become 0 to 255.
    U8,
    /// Floating point of 32 bits.
    Float,
}

/// A picture as OpenImageIO hands it over; its memory belongs to C.
pub(crate) struct Picture(face::YarnrayOiioImage);

impl Picture {
    /// Pixels in a row.
    pub(crate) fn width(&self) -> usize {
        to_usize(self.0.width)
    }

    /// Number of rows.
    pub(crate) fn height(&self) -> usize {
        to_usize(self.0.height)
    }

    /// Number of channels.
    pub(crate) fn channel_count(&self) -> usize {
        to_usize(self.0.channels)
    }

    /// The first pixel, seen from the upper left corner of the display window.
    pub(crate) fn origin(&self) -> [i32; 2] {
        [self.0.x, self.0.y]
    }

    /// Width and height of the display window.
    pub(crate) fn display_size(&self) -> [usize; 2] {
        [to_usize(self.0.display_width), to_usize(self.0.display_height)]
    }

    /// The channel that is the alpha, if there is one. Colours are associated with it.
    pub(crate) fn alpha_channel(&self) -> Option<usize> {
        usize::try_from(self.0.alpha_channel).ok()
    }

    /// Whether the samples are integers in the file and still carry the sRGB curve.
    pub(crate) fn is_srgb_encoded(&self) -> bool {
        self.0.srgb_encoded != 0
    }

    /// The name of every channel, in the order of the samples.
    pub(crate) fn channel_names(&self) -> Vec<String> {
        // SAFETY: yarnray_oiio_read fills `names` with `names_size` bytes, which live as long as `self`.
        let bytes = unsafe { slice::from_raw_parts(self.0.names.cast::<u8>(), self.0.names_size) };
        bytes
            .split(|byte| *byte == 0)
            .take(self.channel_count())
            .map(|name| String::from_utf8_lossy(name).into_owned())
            .collect()
    }

    /// All samples: rows from the top, pixels from the left, the channels of a pixel together.
    pub(crate) fn samples(&self) -> &[f32] {
        let count = self.width() * self.height() * self.channel_count();
        // SAFETY: yarnray_oiio_read allocates width x height x channels floats, zeroed, which live as long as `self`.
        unsafe { slice::from_raw_parts(self.0.data, count) }
    }
}

impl Drop for Picture {
    fn drop(&mut self) {
        if let Some(Ok(face)) = FACE.get() {
            // SAFETY: the picture came from yarnray_oiio_read, and nothing can refer to it any more.
            unsafe { face.yarnray_oiio_free(&mut self.0) }
        }
    }
}

/// Whether OpenImageIO is in this process already.
pub(crate) fn is_loaded() -> bool {
    matches!(FACE.get(), Some(Ok(_)))
}

/// The version of the OpenImageIO that runs, such as "2.4.7". Loads it.
///
/// # Errors
/// [`OiioError::Missing`].
#[cfg(test)]
pub(crate) fn version() -> Result<String, OiioError> {
    // SAFETY: the function takes nothing and catches every exception.
    let number = unsafe { face()?.yarnray_oiio_version() };
    Ok(format!("{}.{}.{}", number / 10000, number / 100 % 100, number % 100))
}

/// Whether OpenImageIO has a writer for the extension of this path. Loads it.
///
/// # Errors
/// [`OiioError::Missing`].
pub(crate) fn can_write(path: &Path) -> Result<bool, OiioError> {
    let face = face()?;
    let path = c_path(path)?;
    // SAFETY: the path ends in NUL and outlives the call.
    Ok(unsafe { face.yarnray_oiio_can_write(path.as_ptr()) } != 0)
}

/// Reads the first picture of a file that has at most `sample_limit` samples (pixels times channels).
///
/// # Errors
/// [`OiioError`]: the library is missing, the picture too large, or not readable.
pub(crate) fn read(path: &Path, sample_limit: usize) -> Result<Picture, OiioError> {
    let face = face()?;
    let path = c_path(path)?;
    let mut message = [0_u8; MESSAGE_SIZE];
    // Owned from the start, so that it is released whatever happens.
    let mut picture = Picture(face::YarnrayOiioImage {
        width: 0,
        height: 0,
        channels: 0,
        x: 0,
        y: 0,
        display_width: 0,
        display_height: 0,
        alpha_channel: -1,
        srgb_encoded: 0,
        names_size: 0,
        names: ptr::null_mut(),
        data: ptr::null_mut(),
    });
    // SAFETY: the path ends in NUL; picture and message are writable, and the size told is the message's own.
    let code = unsafe {
        face.yarnray_oiio_read(
            path.as_ptr(),
            sample_limit as u64,
            &mut picture.0,
            message.as_mut_ptr().cast::<c_char>(),
            message.len(),
        )
    };
    match code {
        face::YARNRAY_OIIO_DONE => Ok(picture),
        face::YARNRAY_OIIO_TOO_LARGE => {
            Err(OiioError::TooLarge(picture.width(), picture.height(), picture.channel_count()))
        }
        _ => Err(OiioError::Failed(text(&message))),
    }
}

/// Writes `samples` (rows from the top, the channels of a pixel together) in the format that the extension names.
///
/// # Errors
/// [`OiioError`]; a damaged file may then stand at `path`, so give a temporary name.
///
/// # Panics
/// If there are not width x height x channels samples.
pub(crate) fn write(
    path: &Path,
    size: [usize; 2],
    channels: usize,
    samples: &[f32],
    sample: Sample,
) -> Result<(), OiioError> {
    assert_eq!(samples.len(), size[0] * size[1] * channels, "as many samples as pixels times channels");
    let face = face()?;
    let path = c_path(path)?;
    let number = |value| i32::try_from(value).map_err(|_| OiioError::TooLarge(size[0], size[1], channels));
    let kind = match sample {
        Sample::U8 => face::YARNRAY_OIIO_U8,
        Sample::Float => face::YARNRAY_OIIO_FLOAT,
    };
    let mut message = [0_u8; MESSAGE_SIZE];
    // SAFETY: the path ends in NUL, the sizes belong to `samples` (asserted above), and the message has that size.
    let code = unsafe {
        face.yarnray_oiio_write(
            path.as_ptr(),
            number(size[0])?,
            number(size[1])?,
            number(channels)?,
            samples.as_ptr(),
            kind,
            message.as_mut_ptr().cast::<c_char>(),
            message.len(),
        )
    };
    if code == face::YARNRAY_OIIO_DONE { Ok(()) } else { Err(OiioError::Failed(text(&message))) }
}

/// A picture in OpenImageIO's texture cache.
#[derive(Debug)]
pub(crate) struct TextureFile {
    raw: ptr::NonNull<face::YarnrayOiioTexture>,
    size: [usize; 2],
}

// SAFETY: the texture system is made for lookups from all threads; a texture is not changed after it is opened.
unsafe impl Send for TextureFile {}
// SAFETY: as above.
unsafe impl Sync for TextureFile {}

impl TextureFile {
    /// Opens a texture; `copy` names a file that does not exist yet, for a copy that can be filtered if the file
    /// itself cannot, and which has to stay as long as the texture.
    ///
    /// # Errors
    /// [`OiioError`]
    pub(crate) fn open(path: &Path, copy: &Path, sample_limit: usize) -> Result<Self, OiioError> {
        let face = face()?;
        let (path, copy) = (c_path(path)?, c_path(copy)?);
        let mut message = [0_u8; MESSAGE_SIZE];
        let mut raw = ptr::null_mut();
        let mut size = [0_i32; 2];
        // SAFETY: paths end in NUL; all other pointers are writable, and the size told is the message's own.
        let code = unsafe {
            face.yarnray_oiio_texture_open(
                path.as_ptr(),
                copy.as_ptr(),
                sample_limit as u64,
                &mut raw,
                size.as_mut_ptr(),
                message.as_mut_ptr().cast::<c_char>(),
                message.len(),
            )
        };
        match ptr::NonNull::new(raw) {
            Some(raw) if code == face::YARNRAY_OIIO_DONE => Ok(Self { raw, size: size.map(to_usize) }),
            _ => Err(OiioError::Failed(text(&message))),
        }
    }

    /// Width and height in pixels.
    pub(crate) fn size(&self) -> [usize; 2] {
        self.size
    }

    /// The linear colour at (u, v), filtered over `width`; black where the file can no longer be read.
    #[inline]
    pub(crate) fn sample(&self, u: f32, v: f32, width: f32) -> [f32; 3] {
        let mut rgb = [0.0; 3];
        if let Some(Ok(face)) = FACE.get() {
            // SAFETY: the texture is open until it is dropped, and `rgb` takes three floats.
            unsafe { face.yarnray_oiio_texture_sample(self.raw.as_ptr(), u, v, width, rgb.as_mut_ptr()) };
        }
        rgb
    }
}

impl Drop for TextureFile {
    fn drop(&mut self) {
        if let Some(Ok(face)) = FACE.get() {
            // SAFETY: it came from yarnray_oiio_texture_open, and nothing can refer to it any more.
            unsafe { face.yarnray_oiio_texture_close(self.raw.as_ptr()) }
        }
    }
}

/// Bytes that textures take in memory now; 0 while OpenImageIO is not loaded.
pub(crate) fn texture_bytes() -> u64 {
    match FACE.get() {
        // SAFETY: the function takes nothing and catches every exception.
        Some(Ok(face)) => u64::try_from(unsafe { face.yarnray_oiio_texture_bytes() }).unwrap_or(0),
        _ => 0,
    }
}

fn face() -> Result<&'static face::Face, OiioError> {
    FACE.get_or_init(load).as_ref().map_err(|reason| OiioError::Missing(reason.clone()))
}

/// Puts the library into sealed memory and loads it from there: no file to install, none to clean up.
fn load() -> Result<face::Face, String> {
    let memory = memfd::MemfdOptions::new()
        .allow_sealing(true)
        .create("yarnray-oiio")
        .map_err(|error| format!("no memory file: {error}"))?;
    memory.as_file().write_all(LIBRARY).map_err(|error| format!("no memory file: {error}"))?;
    use memfd::FileSeal::{SealGrow, SealSeal, SealShrink, SealWrite};
    memory.add_seals(&[SealShrink, SealGrow, SealWrite, SealSeal]).map_err(|error| format!("no seal: {error}"))?;
    let path = format!("/proc/self/fd/{}", memory.as_file().as_raw_fd());
    use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
    // RTLD_NOW: a symbol that another version of OpenImageIO lacks is an error here, not a crash in the first call.
    // SAFETY: the bytes are the library that build.rs made of ffi/oiio.cpp, sealed against change; its initializers
    // and those of OpenImageIO are plain static constructors.
    let library = unsafe { Library::open(Some(&path), RTLD_NOW | RTLD_LOCAL) }.map_err(|error| reason(&error))?;
    // SAFETY: the bindings are made from the header that this very library was compiled with.
    unsafe { face::Face::from_library(libloading::Library::from(library)) }.map_err(|error| reason(&error))
}

fn c_path(path: &Path) -> Result<CString, OiioError> {
    CString::new(path.as_os_str().as_bytes()).map_err(|_| OiioError::Failed("the path contains a NUL".to_owned()))
}

/// The message up to its NUL, in one line.
fn text(message: &[u8]) -> String {
    let text = CStr::from_bytes_until_nul(message).unwrap_or_default().to_string_lossy();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Sizes that C counts in `int`; a negative one would be a bug there and counts as nothing.
fn to_usize(size: i32) -> usize {
    usize::try_from(size).unwrap_or(0)
}
