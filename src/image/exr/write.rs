//! Writing, from the top down and in blocks of rows.

use std::{
    collections::HashSet,
    io::{self, BufWriter},
    path::Path,
};

use exr::{
    block::{BlockIndex, UncompressedBlock, chunk::Chunk, writer::ChunksWriter as _},
    math::Vec2,
    meta::{
        BlockDescription,
        attribute::{AttributeValue, ChannelDescription, Chromaticities, IntegerBounds, LineOrder, SampleType, Text},
        header::Header,
    },
    prelude::f16,
};
use rayon::prelude::*;

use super::{
    super::{ImageError, whole_file},
    Attribute, ExrLayout, Line, SOFTWARE, Sample,
    attributes::sort_attributes,
};

/// Uncompressed bytes in work at a time while writing: enough for every core with ordinary pictures.
const BATCH_BYTES: usize = 4 << 20;

/// Rows in work at a time for each thread, so that starting the work costs little beside it.
const BATCH_ROWS: usize = 32;

/// Writes an EXR file of one part.
///
/// `row` is asked for every row once, from the top (the first row of the data window is 0), with one line for each
/// channel of the layout, in that order. NaN and infinity are stored as they are.
///
/// Memory: a few blocks of rows, 12 MB at the peak for 768 x 576 pixels of 30 channels. Compression runs in the
/// thread pool of the caller; the file does not depend on the number of threads.
///
/// # Errors
/// [`ImageError::Write`]: the layout makes no EXR (names that are empty, too long or there twice; no pixels), or the
/// file cannot be written. Then nothing has been left behind.
pub fn write(path: &Path, layout: &ExrLayout, mut row: impl FnMut(usize, &mut [Line<'_>])) -> Result<(), ImageError> {
    let header = header(layout).map_err(|reason| ImageError::unwritable(path, reason))?;
    // Where the line of each channel of the file comes from.
    let mut order: Vec<usize> = (0..layout.channels.len()).collect();
    order.sort_by_key(|index| layout.channels[*index].name.as_bytes());
    let block_rows = header.compression.scan_lines_per_block();
    let block_bytes = header.channels.bytes_per_pixel * layout.width * block_rows;
    let batch_size =
        (BATCH_BYTES / block_bytes.max(1)).clamp(1, rayon::current_num_threads() * BATCH_ROWS / block_rows);
    let mut rows = Rows::new(layout);

    whole_file::write(path, |file| {
        let written =
            exr::block::write(BufWriter::new(&mut *file), [header].into_iter().collect(), true, |meta, chunks| {
                let headers = meta.headers.as_slice();
                let blocks: Vec<_> = exr::block::enumerate_ordered_header_block_indices(headers).collect();
                for batch in blocks.chunks(batch_size) {
                    let filled: Vec<_> = batch
                        .iter()
                        .map(|(index, block)| (*index, rows.block(layout, &order, *block, &mut row)))
                        .collect();
                    let compressed: Vec<(usize, exr::error::Result<Chunk>)> = filled
                        .into_par_iter()
                        .map(|(index, block)| (index, block.compress_to_chunk(headers)))
                        .collect();
                    for (index, chunk) in compressed {
                        chunks.write_chunk(index, chunk?)?;
                    }
                }
                Ok(())
            });
        written.map_err(|error| match error {
            exr::error::Error::Io(error) => error,
            other => io::Error::other(other.to_string()),
        })?;
        sort_attributes(file)
    })
}

/// The rows that are being asked for, one after another.
struct Rows {
    floats: Vec<f32>,
    wholes: Vec<u32>,
}

impl Rows {
    fn new(layout: &ExrLayout) -> Self {
        let wholes = layout.channels.iter().filter(|channel| channel.sample == Sample::U32).count();
        let floats = layout.channels.len() - wholes;
        Self { floats: vec![0.0; floats * layout.width], wholes: vec![0; wholes * layout.width] }
    }

    /// One block of rows, in the bytes that EXR compresses.
    fn block(
        &mut self,
        layout: &ExrLayout,
        order: &[usize],
        index: BlockIndex,
        row: &mut impl FnMut(usize, &mut [Line<'_>]),
    ) -> UncompressedBlock {
        let mut data = Vec::with_capacity(index.pixel_size.area() * 4 * layout.channels.len());
        for y in index.pixel_position.y()..index.pixel_position.y() + index.pixel_size.height() {
            self.floats.fill(0.0);
            self.wholes.fill(0);
            let mut floats = self.floats.chunks_exact_mut(layout.width);
            let mut wholes = self.wholes.chunks_exact_mut(layout.width);
            let mut lines: Vec<Line<'_>> = layout
                .channels
                .iter()
                .map(|channel| match channel.sample {
                    Sample::U32 => Line::Whole(wholes.next().expect("one line per channel")),
                    Sample::F16 | Sample::F32 => Line::Float(floats.next().expect("one line per channel")),
                })
                .collect();
            row(y, &mut lines);
            for channel in order {
                match (&lines[*channel], layout.channels[*channel].sample) {
                    (Line::Whole(line), _) => data.extend(line.iter().flat_map(|value| value.to_ne_bytes())),
                    (Line::Float(line), Sample::F16) => {
                        data.extend(line.iter().flat_map(|value| half(*value).to_ne_bytes()));
                    }
                    (Line::Float(line), _) => data.extend(line.iter().flat_map(|value| value.to_ne_bytes())),
                }
            }
        }
        UncompressedBlock { index, data }
    }
}

/// The nearest number of 16 bits; what is finite stays finite.
pub(in crate::image) fn half(value: f32) -> f16 {
    let largest = f16::MAX.to_f32();
    f16::from_f32(if value.is_finite() { value.clamp(-largest, largest) } else { value })
}

/// The header of the layout, or why there is none.
fn header(layout: &ExrLayout) -> Result<Header, String> {
    if layout.width == 0 || layout.height == 0 || layout.channels.is_empty() {
        return Err("a picture needs at least one pixel and one channel".to_owned());
    }
    let mut seen = HashSet::new();
    for channel in &layout.channels {
        check_name("channel", &channel.name)?;
        if !seen.insert(&channel.name) {
            return Err(format!("two channels are called `{}`", channel.name));
        }
    }
    let channels = layout.channels.iter().map(|channel| {
        let sample = match channel.sample {
            Sample::F16 => SampleType::F16,
            Sample::F32 => SampleType::F32,
            Sample::U32 => SampleType::U32,
        };
        ChannelDescription::named(text(&channel.name), sample)
    });
    let mut channels: Vec<_> = channels.collect();
    channels.sort_by(|a, b| a.name.bytes().cmp(b.name.bytes()));
    let mut header = Header::new(text("unnamed"), (layout.width, layout.height), channels.into_iter().collect())
        .with_encoding(layout.compression.method(), BlockDescription::ScanLines, LineOrder::Increasing);
    header.own_attributes.layer_name = None;
    header.own_attributes.software_name = Some(text(SOFTWARE));
    header.own_attributes.layer_position = Vec2(layout.origin[0], layout.origin[1]);
    header.shared_attributes.display_window =
        IntegerBounds::new((0, 0), (layout.display_size[0], layout.display_size[1]));
    let mut seen = HashSet::new();
    for (name, value) in &layout.attributes {
        check_name("attribute", name)?;
        if RESERVED.contains(&name.as_str()) || !seen.insert(name) {
            return Err(format!("the attribute `{name}` is there already"));
        }
        let value = match value {
            Attribute::Text(value) => AttributeValue::Text(text(value)),
            Attribute::Float(value) => AttributeValue::F32(*value),
            Attribute::Double(value) => AttributeValue::F64(*value),
            Attribute::Whole(value) => AttributeValue::I32(*value),
            Attribute::Ratio(value, of) => AttributeValue::Rational((*value, *of)),
            Attribute::Matrix(rows) => AttributeValue::Matrix4x4(std::array::from_fn(|i| rows[i % 4][i / 4])),
            Attribute::Chromaticities(values) => {
                let [red, green, blue, white] = values.map(|[x, y]| Vec2(x, y));
                AttributeValue::Chromaticities(Chromaticities { red, green, blue, white })
            }
        };
        set(&mut header, name, value);
    }
    Ok(header)
}

/// Puts an attribute where the crate keeps it: it has fields for what OpenEXR has names for.
fn set(header: &mut Header, name: &str, value: AttributeValue) {
    let (shared, own) = (&mut header.shared_attributes, &mut header.own_attributes);
    match (name, value) {
        ("chromaticities", AttributeValue::Chromaticities(value)) => shared.chromaticities = Some(value),
        ("framesPerSecond", AttributeValue::Rational(value)) => own.frames_per_second = Some(value),
        ("worldToCamera", AttributeValue::Matrix4x4(value)) => own.world_to_camera = Some(value),
        ("worldToNDC", AttributeValue::Matrix4x4(value)) => own.world_to_normalized_device = Some(value),
        (name, value) => _ = own.other.insert(text(name), value),
    }
}

/// Attributes that the format itself needs, or that are written anyway.
const RESERVED: [&str; 14] = [
    "channels",
    "chunkCount",
    "compression",
    "dataWindow",
    "displayWindow",
    "lineOrder",
    "name",
    "pixelAspectRatio",
    "screenWindowCenter",
    "screenWindowWidth",
    "software",
    "tiles",
    "type",
    "version",
];

fn check_name(what: &str, name: &str) -> Result<(), String> {
    if name.is_empty() || name.len() > 255 || name.contains('\0') {
        return Err(format!("an EXR {what} cannot be called `{name}`: 1 to 255 bytes, none of them zero"));
    }
    Ok(())
}

/// EXR keeps bytes; UTF-8 is what programs make of them today.
fn text(value: &str) -> Text {
    Text::from_slice_unchecked(value.as_bytes())
}
