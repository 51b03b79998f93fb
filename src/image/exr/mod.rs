//! EXR files: many named channels in one part, written row by row and compressed in blocks of rows.
//!
//! The crate `exr` compresses and decodes; what it does not offer is done here: no copy of the picture while writing,
//! metadata in a fixed order, so that equal pictures are equal files, and limits before anything is allocated.

mod attributes;
mod read;
mod write;

use std::path::Path;

use exr::meta::attribute::Compression as Method;

use super::ImageError;
pub use attributes::read_attributes;
pub(super) use read::read;
#[cfg(test)]
pub(super) use write::half;
pub use write::write;

/// The program, its version and its commit: the attribute `software` of every EXR written here.
pub const SOFTWARE: &str = concat!("yarnray ", env!("CARGO_PKG_VERSION"), " (", env!("YARNRAY_COMMIT"), ")");

/// How rows are compressed; none of these loses anything.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Compression {
    /// Deflate, row by row: what compositors read fastest.
    #[default]
    Zips,
    /// Deflate over 16 rows: the smallest of smooth pictures.
    Zip,
    /// Wavelets over 32 rows: the smallest of noisy pictures.
    Piz,
    /// Run lengths, row by row.
    Rle,
    /// None.
    None,
}

impl Compression {
    /// Every compression with its name in scene files.
    pub const NAMES: [(&'static str, Self); 5] =
        [("zips", Self::Zips), ("zip", Self::Zip), ("piz", Self::Piz), ("rle", Self::Rle), ("none", Self::None)];

    fn method(self) -> Method {
        match self {
            Self::Zips => Method::ZIP1,
            Self::Zip => Method::ZIP16,
            Self::Piz => Method::PIZ,
            Self::Rle => Method::RLE,
            Self::None => Method::Uncompressed,
        }
    }
}

/// How the samples of a channel are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sample {
    /// 16 bits. Finite values beyond 65504 are stored as that, so that a highlight does not become infinite.
    F16,
    /// 32 bits.
    F32,
    /// Whole numbers, such as identifiers.
    U32,
}

/// One channel to write.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChannelSpec {
    /// Full name, such as "R", "albedo.G" or "Z".
    pub name: String,
    /// How its samples are stored.
    pub sample: Sample,
}

impl ChannelSpec {
    /// A channel with this name and kind of sample.
    pub fn new(name: impl Into<String>, sample: Sample) -> Self {
        Self { name: name.into(), sample }
    }
}

/// The value of a piece of metadata.
#[derive(Debug, Clone, PartialEq)]
pub enum Attribute {
    /// Text, in UTF-8.
    Text(String),
    /// A number.
    Float(f32),
    /// A number of 64 bits.
    Double(f64),
    /// A whole number.
    Whole(i32),
    /// A ratio of whole numbers.
    Ratio(i32, u32),
    /// A matrix that is multiplied by a column, row by row. (In the file it stands for rows that are multiplied by it.)
    Matrix([[f32; 4]; 4]),
    /// x and y of red, green, blue and white by the CIE.
    Chromaticities([[f32; 2]; 4]),
}

/// Those of linear Rec. 709, which all colours here are.
pub const REC_709: Attribute = Attribute::Chromaticities([[0.64, 0.33], [0.3, 0.6], [0.15, 0.06], [0.3127, 0.329]]);

/// What an EXR file contains besides its samples.
#[derive(Debug, Clone, PartialEq)]
pub struct ExrLayout {
    /// Pixels in a row of the data window, which is what is written.
    pub width: usize,
    /// Number of rows of the data window.
    pub height: usize,
    /// The first pixel of the data window, seen from the upper left corner of the display window.
    pub origin: [i32; 2],
    /// Width and height of the display window, in pixels: of the whole picture, if only a crop is written.
    pub display_size: [usize; 2],
    /// The channels, in the order in which `row` gets their lines. (In the file they stand sorted by name.)
    pub channels: Vec<ChannelSpec>,
    /// Metadata. `software` is written as well, see [`SOFTWARE`].
    pub attributes: Vec<(String, Attribute)>,
    /// How rows are compressed.
    pub compression: Compression,
}

impl ExrLayout {
    /// A picture that fills its display window, without metadata.
    pub fn new(width: usize, height: usize, channels: Vec<ChannelSpec>) -> Self {
        Self {
            width,
            height,
            origin: [0, 0],
            display_size: [width, height],
            channels,
            attributes: Vec::new(),
            compression: Compression::default(),
        }
    }
}

/// One row of one channel, to be filled; it starts as zeros.
#[derive(Debug)]
pub enum Line<'a> {
    /// Of a channel of [`Sample::F16`] or [`Sample::F32`].
    Float(&'a mut [f32]),
    /// Of a channel of [`Sample::U32`].
    Whole(&'a mut [u32]),
}

fn damaged(path: &Path, what: &str) -> ImageError {
    ImageError::Read { path: path.into(), reason: format!("damaged EXR: {what}") }
}
