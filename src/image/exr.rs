//! EXR files: many named channels in one part, written row by row and compressed in blocks of rows.
//!
//! The crate `exr` compresses and decodes; what it does not offer is done here: no copy of the picture while writing,
//! metadata in a fixed order, so that equal pictures are equal files, and limits before anything is allocated.

use std::{
    collections::HashSet,
    fs::File,
    io::{self, BufRead, BufReader, BufWriter, Read, Seek, SeekFrom, Write},
    path::Path,
};

use exr::{
    block::{BlockIndex, UncompressedBlock, chunk::Chunk, reader::ChunksReader as _, writer::ChunksWriter as _},
    math::Vec2,
    meta::{
        BlockDescription,
        attribute::{
            AttributeValue, ChannelDescription, Chromaticities, Compression as Method, IntegerBounds, LineOrder,
            SampleType, Text,
        },
        header::Header,
    },
    prelude::f16,
};
use rayon::prelude::*;

use super::{Channel, Image, ImageError, check_size, output};

/// The program, its version and its commit: the attribute `software` of every EXR written here.
pub const SOFTWARE: &str = concat!("yarnray ", env!("CARGO_PKG_VERSION"), " (", env!("YARNRAY_COMMIT"), ")");

/// Uncompressed bytes in work at a time while writing: enough for every core with ordinary pictures.
const BATCH_BYTES: usize = 4 << 20;

/// Rows in work at a time for each thread, so that starting the work costs little beside it.
const BATCH_ROWS: usize = 32;

/// Longest text that is read back from an attribute, in bytes.
const TEXT_LIMIT: usize = 1 << 26;

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

    output::write_file(path, |file| {
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
pub(super) fn half(value: f32) -> f16 {
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

/// The bytes of one attribute in a header: its name, and the whole of it.
struct RawAttribute {
    name: Vec<u8>,
    kind: Vec<u8>,
    bytes: Vec<u8>,
}

/// Reads the next attribute of a header; `None` at the end of the header. Values longer than the limit are skipped,
/// and `bytes` is then empty.
fn next_attribute(file: &mut (impl BufRead + Seek), limit: usize) -> io::Result<Option<RawAttribute>> {
    let mut word = || {
        let mut bytes = Vec::new();
        file.by_ref().take(256).read_until(0, &mut bytes)?;
        if bytes.pop() == Some(0) { Ok(bytes) } else { Err(io::Error::from(io::ErrorKind::InvalidData)) }
    };
    let name = word()?;
    if name.is_empty() {
        return Ok(None);
    }
    let kind = word()?;
    let mut size = [0; 4];
    file.read_exact(&mut size)?;
    let size = u32::from_le_bytes(size);
    let mut bytes = Vec::new();
    if size as usize > limit {
        file.seek_relative(i64::from(size))?;
    } else {
        bytes.resize(size as usize, 0);
        file.read_exact(&mut bytes)?;
    }
    Ok(Some(RawAttribute { name, kind, bytes }))
}

/// Puts the attributes of a file of one part in the order of their names, as the C++ library does. The crate keeps
/// them in a hash map, whose order changes from run to run: equal pictures would be different files.
fn sort_attributes(file: &mut File) -> io::Result<()> {
    // Behind magic number and version.
    const START: u64 = 8;
    file.seek(SeekFrom::Start(START))?;
    let mut attributes = Vec::new();
    let mut reader = BufReader::new(&mut *file);
    while let Some(attribute) = next_attribute(&mut reader, usize::MAX)? {
        attributes.push(attribute);
    }
    attributes.sort_by(|a, b| a.name.cmp(&b.name));
    let mut bytes = Vec::new();
    for attribute in attributes {
        for word in [attribute.name, attribute.kind] {
            bytes.extend(word);
            bytes.push(0);
        }
        // The size has just been read as 32 bits.
        bytes.extend((attribute.bytes.len() as u32).to_le_bytes());
        bytes.extend(attribute.bytes);
    }
    file.seek(SeekFrom::Start(START))?;
    file.write_all(&bytes)
}

/// Little-endian numbers, one behind the other.
fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().map(|word| f32::from_le_bytes(*word)).collect()
}

/// The metadata of an EXR file whose value is text, a number, a matrix or chromaticities, sorted by name; of the first part if there are many.
///
/// # Errors
/// [`ImageError::Read`].
pub fn read_attributes(path: &Path) -> Result<Vec<(String, Attribute)>, ImageError> {
    let failed = |error: io::Error| match error.kind() {
        io::ErrorKind::InvalidData | io::ErrorKind::UnexpectedEof => damaged(path, "its header"),
        _ => ImageError::unreadable(path, &error),
    };
    let mut file = BufReader::new(File::open(path).map_err(failed)?);
    let mut start = [0; 8];
    file.read_exact(&mut start).map_err(failed)?;
    if !start.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        return Err(ImageError::Read { path: path.into(), reason: "it is not an EXR file".into() });
    }
    let mut attributes = Vec::new();
    while let Some(attribute) = next_attribute(&mut file, TEXT_LIMIT).map_err(failed)? {
        let value = match (attribute.kind.as_slice(), attribute.bytes.as_slice()) {
            (b"string", bytes) => Attribute::Text(String::from_utf8_lossy(bytes).into_owned()),
            (b"float", &[a, b, c, d]) => Attribute::Float(f32::from_le_bytes([a, b, c, d])),
            (b"int", &[a, b, c, d]) => Attribute::Whole(i32::from_le_bytes([a, b, c, d])),
            (b"double", &[a, b, c, d, e, f, g, h]) => Attribute::Double(f64::from_le_bytes([a, b, c, d, e, f, g, h])),
            (b"rational", &[a, b, c, d, e, f, g, h]) => {
                Attribute::Ratio(i32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]))
            }
            (b"m44f", bytes) if bytes.len() == 64 => {
                let all = floats(bytes);
                Attribute::Matrix(std::array::from_fn(|row| std::array::from_fn(|column| all[4 * column + row])))
            }
            (b"chromaticities", bytes) if bytes.len() == 32 => {
                let all = floats(bytes);
                Attribute::Chromaticities(std::array::from_fn(|i| [all[2 * i], all[2 * i + 1]]))
            }
            _ => continue,
        };
        attributes.push((String::from_utf8_lossy(&attribute.name).into_owned(), value));
    }
    attributes.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(attributes)
}

fn damaged(path: &Path, what: &str) -> ImageError {
    ImageError::Read { path: path.into(), reason: format!("damaged EXR: {what}") }
}

/// Reads all channels of all parts at full resolution. Whole numbers become floats, exact up to 16 million.
/// The picture covers the data windows of all parts, with zeros where one has nothing.
pub(super) fn read(path: &Path) -> Result<Image, ImageError> {
    let failed = |error: exr::error::Error| match error {
        exr::error::Error::Io(error) => ImageError::unreadable(path, &error),
        exr::error::Error::NotSupported(reason) => {
            ImageError::Unsupported { path: path.into(), reason: reason.into_owned() }
        }
        exr::error::Error::Invalid(reason) => damaged(path, &reason),
        exr::error::Error::Aborted => damaged(path, "unreadable"),
    };
    let file = File::open(path).map_err(|error| ImageError::unreadable(path, &error))?;
    let reader = exr::block::read(BufReader::new(file), false).map_err(failed)?;
    let headers = reader.headers();
    // In exr 1.74, damaged DWA makes the process abort (it allocates what the file says) and damaged B44 panics.
    // The C++ library checks both.
    let trustful = |compression| {
        use Method::{B44, B44A, DWAA, DWAB};
        matches!(compression, B44 | B44A | DWAA(_) | DWAB(_))
    };
    if let Some(header) = headers.iter().find(|header| trustful(header.compression)) {
        let reason = format!("EXR with {} is left to OpenImageIO", header.compression);
        return Err(ImageError::Unsupported { path: path.into(), reason });
    }

    // The window around all parts, in 64 bits: corners may be anywhere in 32.
    let corners = |header: &Header| {
        let start = header.own_attributes.layer_position;
        let size = header.layer_size;
        [
            i64::from(start.x()),
            i64::from(start.y()),
            i64::from(start.x()) + size.x() as i64,
            i64::from(start.y()) + size.y() as i64,
        ]
    };
    let windows: Vec<[i64; 4]> = headers.iter().map(corners).collect();
    let window = windows
        .iter()
        .copied()
        .reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])])
        .ok_or_else(|| damaged(path, "no part"))?;
    let (width, height) = ((window[2] - window[0]) as usize, (window[3] - window[1]) as usize);
    check_size(path, width, height, headers.iter().map(|header| header.channels.list.len()).sum())?;

    let display = headers[0].shared_attributes.display_window;
    let offset = |corner: i64, display: i32| i32::try_from(corner - i64::from(display)).unwrap_or(0);
    let mut image = Image {
        origin: [offset(window[0], display.position.x()), offset(window[1], display.position.y())],
        display_size: [display.size.x(), display.size.y()],
        attributes: read_attributes(path)?,
        ..Image::new(width, height)
    };
    // The first channel of each part.
    let mut first = Vec::new();
    for header in headers {
        first.push(image.channels.len());
        let part = header.own_attributes.layer_name.as_ref().map(|name| String::from_utf8_lossy(name.bytes()));
        let part = part.filter(|part| headers.len() > 1 && !part.is_empty());
        for channel in &header.channels.list {
            let name = String::from_utf8_lossy(channel.name.bytes());
            let name = match &part {
                // Some programs put the name of the part into the channel's as well.
                Some(part) if !name.strip_prefix(&**part).is_some_and(|rest| rest.starts_with('.')) => {
                    format!("{part}.{name}")
                }
                _ => name.into_owned(),
            };
            image.channels.push(Channel { name, samples: vec![0.0; width * height] });
        }
    }

    let full_size = |_: &_, _, block: BlockIndex| block.level == Vec2(0, 0);
    let mut blocks = reader.filter_chunks(false, full_size).map_err(failed)?.sequential_decompressor(false);
    let mut seen = HashSet::new();
    let mut wholes = Vec::new();
    let mut halves = Vec::new();
    while let Some(block) = blocks.decompress_next_block() {
        let block = block.map_err(failed)?;
        let header = &blocks.meta_data().headers[block.index.layer];
        // The same block twice means that another is missing.
        if !seen.insert((block.index.layer, block.index.pixel_position)) {
            return Err(damaged(path, "a block is missing"));
        }
        let window_of_part = windows[block.index.layer];
        let (left, top) = ((window_of_part[0] - window[0]) as usize, (window_of_part[1] - window[1]) as usize);
        for line in block.lines(&header.channels) {
            let place = line.location;
            let start = (top + place.position.y()) * width + left + place.position.x();
            let target = image
                .channels
                .get_mut(first[place.layer] + place.channel)
                .and_then(|channel| channel.samples.get_mut(start..start + place.sample_count))
                .ok_or_else(|| damaged(path, "a block outside of the picture"))?;
            match header.channels.list[place.channel].sample_type {
                SampleType::F32 => line.read_samples_into_slice(target).map_err(failed)?,
                SampleType::F16 => {
                    halves.resize(target.len(), f16::ZERO);
                    line.read_samples_into_slice(&mut halves).map_err(failed)?;
                    target.iter_mut().zip(&halves).for_each(|(to, from)| *to = from.to_f32());
                }
                SampleType::U32 => {
                    wholes.resize(target.len(), 0_u32);
                    line.read_samples_into_slice(&mut wholes).map_err(failed)?;
                    target.iter_mut().zip(&wholes).for_each(|(to, from)| *to = *from as f32);
                }
            }
        }
    }
    Ok(image)
}
