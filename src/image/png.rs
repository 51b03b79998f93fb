//! PNG files, and the way from linear light to the eight bits of a screen.

use std::{
    fs::File,
    io::{self, BufReader, BufWriter, Write as _},
    path::Path,
};

pub use crate::math::srgb::{linear_to_srgb, srgb_to_linear};

use super::{Channel, Image, ImageError, check_size, palette::Indexed, whole_file};
use crate::input::system::in_words;

/// The curve from linear light to the light that a screen shows, before the sRGB encoding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ToneMap {
    /// None: what is above one is cut off.
    #[default]
    Srgb,
    /// The curve that K. Narkowicz fitted to ACES: x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14), each channel alone
    /// ("ACES Filmic Tone Mapping Curve", 2016). Highlights roll off softly; 1 becomes 0.80, and white is 6.7.
    Filmic,
}

impl ToneMap {
    /// Every curve with its name in files and on the command line.
    pub const NAMES: [(&'static str, Self); 2] = [("srgb", Self::Srgb), ("filmic", Self::Filmic)];
}

/// How linear colours become eight bits.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Display {
    /// The curve.
    pub tone_map: ToneMap,
    /// Exposure in stops: light is multiplied by two to this power.
    pub exposure: f32,
    /// Keep alpha: straight in the file, as PNG demands. Otherwise the picture is opaque, over black.
    pub alpha: bool,
}

impl Display {
    /// One pixel: associated linear RGBA to RGBA in eight bits. NaN becomes 0, as do negative values.
    /// The same bits on every machine.
    pub fn encode(&self, color: [f32; 4]) -> [u8; 4] {
        let gain = libm::exp2f(self.exposure);
        let alpha = if self.alpha { color[3].clamp(0.0, 1.0) } else { 1.0 };
        // Straight colours; a pixel without coverage has none, and light without coverage (a glow) is cut off.
        let gain = if alpha > 0.0 { gain / alpha } else { 0.0 };
        let channel = |value: f32| {
            let value = value * gain;
            to_byte(linear_to_srgb(match self.tone_map {
                ToneMap::Srgb => value,
                ToneMap::Filmic => filmic(value),
            }))
        };
        [channel(color[0]), channel(color[1]), channel(color[2]), to_byte(alpha)]
    }
}

/// Narkowicz's fit, see [`ToneMap::Filmic`].
fn filmic(value: f32) -> f32 {
    // Also for NaN, which the minimum below would turn into white.
    if value.is_nan() || value <= 0.0 {
        return 0.0;
    }
    // Beyond this the quotient is above 1, which is cut; squared, infinity would become NaN.
    let x = value.min(1e4);
    (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)
}

/// 0 to 1 as 0 to 255, rounded to the nearest. NaN becomes 0.
fn to_byte(value: f32) -> u8 {
    (value * 255.0 + 0.5) as u8
}

/// Writes a PNG of eight bits per channel: RGB, or RGBA if `display.alpha`.
/// `row` is asked for every row from the top and fills in associated linear RGBA.
///
/// # Errors
/// [`ImageError::Write`]; then nothing has been left behind.
pub fn write(
    path: &Path,
    width: usize,
    height: usize,
    display: &Display,
    mut row: impl FnMut(usize, &mut [[f32; 4]]),
) -> Result<(), ImageError> {
    let number = |value| u32::try_from(value).map_err(|_| ImageError::unwritable(path, "too large for PNG"));
    let (columns, rows) = (number(width)?, number(height)?);
    whole_file::write(path, |file| {
        let mut buffer = BufWriter::new(file);
        let mut encoder = png::Encoder::new(&mut buffer, columns, rows);
        encoder.set_color(if display.alpha { png::ColorType::Rgba } else { png::ColorType::Rgb });
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header()?;
        let mut stream = writer.stream_writer()?;
        let mut colors = vec![[0.0; 4]; width];
        let mut bytes = Vec::with_capacity(width * 4);
        for y in 0..height {
            colors.fill([0.0; 4]);
            row(y, &mut colors);
            bytes.clear();
            for color in &colors {
                bytes.extend_from_slice(&display.encode(*color)[..if display.alpha { 4 } else { 3 }]);
            }
            stream.write_all(&bytes)?;
        }
        stream.finish()?;
        writer.finish()?;
        buffer.flush()
    })
}

/// The bytes of a PNG file of at most 256 colours, `width` in a row, the top row first: exact where the picture has no more,
/// else of the colours that come close, in a byte a pixel.
///
/// # Panics
/// If the size is zero or beyond 32 bits.
pub fn encode_few(width: usize, colors: &[[u8; 3]]) -> Vec<u8> {
    let Indexed { palette, pixels } = Indexed::new(colors);
    encode(width, &pixels, |encoder| {
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_palette(palette.into_flattened());
    })
}

/// The bytes of a PNG file of grey values, `width` in a row, the top row first.
///
/// # Panics
/// If the size is zero or beyond 32 bits.
pub fn encode_gray(width: usize, bytes: &[u8]) -> Vec<u8> {
    encode(width, bytes, |encoder| encoder.set_color(png::ColorType::Grayscale))
}

/// A PNG file of a byte a pixel.
fn encode(width: usize, bytes: &[u8], kind: impl FnOnce(&mut png::Encoder<'_, &mut Vec<u8>>)) -> Vec<u8> {
    let number = |value| u32::try_from(value).expect("a size of 32 bits");
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, number(width), number(bytes.len() / width));
    kind(&mut encoder);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(bytes)?;
        writer.finish()
    });
    written.expect("a picture of this size can be written to memory");
    out
}

/// Reads a PNG of any kind: channels Y or R, G, B, and A with which they are associated; linear.
pub(super) fn read(path: &Path) -> Result<Image, ImageError> {
    let failed = |error: png::DecodingError| ImageError::Read {
        path: path.into(),
        reason: match error {
            png::DecodingError::IoError(error) if error.kind() == io::ErrorKind::UnexpectedEof => {
                "the PNG ends too early".to_owned()
            }
            png::DecodingError::IoError(error) => in_words(&error),
            error => format!("damaged PNG: {error}"),
        },
    };
    let file = File::open(path).map_err(|error| ImageError::unreadable(path, &error))?;
    let mut decoder = png::Decoder::new(BufReader::new(file));
    // Palettes and one to four bits become eight; a transparent colour becomes alpha.
    decoder.set_transformations(png::Transformations::EXPAND);
    let header = decoder.read_header_info().map_err(failed)?;
    let (width, height) = (header.width as usize, header.height as usize);
    check_size(path, width, height, 4)?;
    decoder.set_limits(png::Limits { bytes: 1 << 30 });
    let mut reader = decoder.read_info().map_err(failed)?;
    let size = reader.output_buffer_size().ok_or_else(|| ImageError::Read {
        path: path.into(),
        reason: "the PNG is too large for this machine".into(),
    })?;
    let mut bytes = vec![0; size];
    let frame = reader.next_frame(&mut bytes).map_err(failed)?;

    let names: &[&str] = match frame.color_type {
        png::ColorType::Grayscale | png::ColorType::Indexed => &["Y"],
        png::ColorType::GrayscaleAlpha => &["Y", "A"],
        png::ColorType::Rgb => &["R", "G", "B"],
        png::ColorType::Rgba => &["R", "G", "B", "A"],
    };
    let wide = frame.bit_depth == png::BitDepth::Sixteen;
    let sample = |index: usize| {
        if wide {
            f32::from(u16::from_be_bytes([bytes[2 * index], bytes[2 * index + 1]])) / 65535.0
        } else {
            f32::from(bytes[index]) / 255.0
        }
    };
    let curve: Vec<f32> = (0..=255_u8).map(|byte| srgb_to_linear(f32::from(byte) / 255.0)).collect();
    let light = |index: usize| if wide { srgb_to_linear(sample(index)) } else { curve[usize::from(bytes[index])] };
    let alpha = names.iter().position(|name| *name == "A");
    let channels = names
        .iter()
        .enumerate()
        .map(|(channel, name)| {
            let pixels = (0..width * height).map(|pixel| pixel * names.len());
            let samples = match alpha {
                Some(alpha) if alpha == channel => pixels.map(|first| sample(first + channel)).collect(),
                Some(alpha) => pixels.map(|first| light(first + channel) * sample(first + alpha)).collect(),
                None => pixels.map(|first| light(first + channel)).collect(),
            };
            Channel { name: (*name).to_owned(), samples }
        })
        .collect();
    Ok(Image { channels, ..Image::new(width, height) })
}
