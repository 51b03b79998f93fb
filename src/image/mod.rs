//! Pictures: from files to linear floats, and from the renderer's rows to files.
//!
//! Reading ([`read`]) looks at what a file is, not at what it is called. EXR and PNG need nothing but this program;
//! all else goes through OpenImageIO, which is loaded only then. Writing ([`exr::write`], [`output::write_colors`])
//! asks for row after row, so that EXR and PNG need no second copy of the picture, and a file appears whole or not at all
//! ([`whole_file::write`]).
//!
//! Colours are linear, with the primaries of Rec. 709, and associated with alpha wherever there is one.
//! The top row comes first. What is rendered, and what a number means, is not this room's business.

pub(crate) mod cryptomatte;
pub(crate) mod error;
pub mod exr;
pub mod metric;
mod oiio;
pub mod output;
mod palette;
pub mod png;
pub(crate) mod texture;
pub mod whole_file;

use std::{fs::File, io::Read as _, path::Path};

pub use error::ImageError;
pub use exr::{Attribute, Compression};

/// The largest picture that is read: pixels times channels. 2 GiB as floats, an environment of 16384 x 8192 in RGB.
pub const SAMPLE_LIMIT: usize = 1 << 29;

/// Whether OpenImageIO has been loaded into this process; always false without the feature `oiio`.
pub fn oiio_loaded() -> bool {
    #[cfg(feature = "oiio")]
    return crate::ffi::oiio::is_loaded();
    #[cfg(not(feature = "oiio"))]
    false
}

/// One channel of an [`Image`].
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Full name, such as "R", "albedo.G" or "Z".
    pub name: String,
    /// Width x height samples, the top row first.
    pub samples: Vec<f32>,
}

/// A picture in memory, channel by channel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Image {
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Where the first pixel stands, seen from the upper left corner of the display window; not zero in a crop.
    pub origin: [i32; 2],
    /// Width and height of the display window, in pixels; those of the picture unless it is a crop.
    pub display_size: [usize; 2],
    /// All channels, in the order of the file.
    pub channels: Vec<Channel>,
    /// Metadata with text or a number as its value, sorted by name. Only EXR files carry any.
    pub attributes: Vec<(String, Attribute)>,
}

/// Three planes as one list of colours.
pub fn interleaved([r, g, b]: [&[f32]; 3]) -> Vec<[f32; 3]> {
    r.iter().zip(g).zip(b).map(|((r, g), b)| [*r, *g, *b]).collect()
}

impl Image {
    /// A picture without channels or metadata that fills its display window.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, display_size: [width, height], ..Self::default() }
    }

    /// The samples of the channel of this full name.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|channel| channel.name == name).map(|channel| channel.samples.as_slice())
    }

    /// Red, green and blue of a layer: of "albedo" that is "albedo.R", "albedo.G" and "albedo.B".
    pub fn layer_rgb(&self, layer: &str) -> Option<[&[f32]; 3]> {
        let channel = |name: &str| self.channel(&format!("{layer}.{name}"));
        Some([channel("R")?, channel("G")?, channel("B")?])
    }

    /// Red, green and blue of the picture itself: the channels R, G and B; else those of the first layer that has
    /// them; else the grey of Y or of an only channel, three times.
    pub fn rgb(&self) -> Option<[&[f32]; 3]> {
        if let (Some(red), Some(green), Some(blue)) = (self.channel("R"), self.channel("G"), self.channel("B")) {
            return Some([red, green, blue]);
        }
        let layers = self.channels.iter().filter_map(|channel| channel.name.strip_suffix(".R"));
        if let Some(colors) = layers.filter_map(|layer| self.layer_rgb(layer)).next() {
            return Some(colors);
        }
        let grey = match self.channels.as_slice() {
            [only] => &only.samples,
            _ => self.channel("Y")?,
        };
        Some([grey, grey, grey])
    }

    /// The value of a piece of metadata.
    pub fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value)
    }
}

/// Reads a picture. What kind of file it is, its first bytes tell.
///
/// PNG, JPEG and other integer samples are taken as sRGB and made linear; floating-point samples are linear already.
/// The alpha of a PNG is associated on the way in. EXR parts other than the only one put their name before those of
/// their channels.
///
/// # Errors
/// [`ImageError`]: the file cannot be opened, is damaged, has more than [`SAMPLE_LIMIT`] samples, or needs an
/// OpenImageIO that is not there.
pub fn read(path: &Path) -> Result<Image, ImageError> {
    let unreadable = |error| ImageError::unreadable(path, &error);
    let mut start = [0; 8];
    let length = {
        let mut file = File::open(path).map_err(unreadable)?;
        if file.metadata().map_err(unreadable)?.is_dir() {
            return Err(ImageError::Read { path: path.into(), reason: "it is a directory".into() });
        }
        let mut length = 0;
        while length < start.len() {
            match file.read(&mut start[length..]).map_err(unreadable)? {
                0 => break,
                count => length += count,
            }
        }
        length
    };
    let start = &start[..length];
    if start.is_empty() {
        Err(ImageError::Read { path: path.into(), reason: "the file is empty".into() })
    } else if start.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        match exr::read(path) {
            // What the Rust crate does not know (deep data, subsampled channels), OpenImageIO may.
            Err(ImageError::Unsupported { path, reason }) => match oiio::read(&path) {
                Ok(image) => Ok(image),
                Err(other) => Err(ImageError::Unsupported { path, reason: format!("{reason}; {}", other.reason()) }),
            },
            result => result,
        }
    } else if start.starts_with(b"\x89PNG\r\n\x1a\n") {
        png::read(path)
    } else {
        oiio::read(path)
    }
}

/// Refuses a picture with more than [`SAMPLE_LIMIT`] samples, before anything is allocated for it.
fn check_size(path: &Path, width: usize, height: usize, channels: usize) -> Result<(), ImageError> {
    match width.checked_mul(height).and_then(|pixels| pixels.checked_mul(channels)) {
        Some(samples) if samples <= SAMPLE_LIMIT => Ok(()),
        _ => Err(ImageError::TooLarge { path: path.into(), width, height, channels }),
    }
}

#[cfg(test)]
mod tests;
