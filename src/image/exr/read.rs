//! Reading all channels of all parts.

use std::{collections::HashSet, fs::File, io::BufReader, path::Path};

use exr::{
    block::{BlockIndex, reader::ChunksReader as _},
    math::Vec2,
    meta::{
        attribute::{Compression as Method, SampleType},
        header::Header,
    },
    prelude::f16,
};

use super::{
    super::{Channel, Image, ImageError, check_size},
    damaged, read_attributes,
};

/// Reads all channels of all parts at full resolution. Whole numbers become floats, exact up to 16 million.
/// The picture covers the data windows of all parts, with zeros where one has nothing.
pub(in crate::image) fn read(path: &Path) -> Result<Image, ImageError> {
    let failed = |error| failure(path, error);
    let file = File::open(path).map_err(|error| ImageError::unreadable(path, &error))?;
    let reader = exr::block::read(BufReader::new(file), false).map_err(failed)?;
    check_compression(path, reader.headers())?;
    let windows = Windows::of(path, reader.headers())?;
    let (mut image, first) = empty_image(path, reader.headers(), &windows)?;

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
        let [left, top] = windows.corner(block.index.layer);
        for line in block.lines(&header.channels) {
            let place = line.location;
            let start = (top + place.position.y()) * image.width + left + place.position.x();
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

fn failure(path: &Path, error: exr::error::Error) -> ImageError {
    match error {
        exr::error::Error::Io(error) => ImageError::unreadable(path, &error),
        exr::error::Error::NotSupported(reason) => {
            ImageError::Unsupported { path: path.into(), reason: reason.into_owned() }
        }
        exr::error::Error::Invalid(reason) => damaged(path, &reason),
        exr::error::Error::Aborted => damaged(path, "unreadable"),
    }
}

/// In exr 1.74, damaged DWA makes the process abort (it allocates what the file says) and damaged B44 panics. The C++
/// library checks both.
fn check_compression(path: &Path, headers: &[Header]) -> Result<(), ImageError> {
    use Method::{B44, B44A, DWAA, DWAB};
    let trustful = |header: &&Header| matches!(header.compression, B44 | B44A | DWAA(_) | DWAB(_));
    let Some(header) = headers.iter().find(trustful) else { return Ok(()) };
    let reason = format!("EXR with {} is left to OpenImageIO", header.compression);
    Err(ImageError::Unsupported { path: path.into(), reason })
}

/// The data windows of all parts: left, top, and right and bottom, which are exclusive. In 64 bits: corners may be
/// anywhere in 32.
struct Windows {
    parts: Vec<[i64; 4]>,
    /// The window around all.
    all: [i64; 4],
}

impl Windows {
    fn of(path: &Path, headers: &[Header]) -> Result<Self, ImageError> {
        let corners = |header: &Header| {
            let start = header.own_attributes.layer_position;
            let size = header.layer_size;
            let [left, top] = [i64::from(start.x()), i64::from(start.y())];
            [left, top, left + size.x() as i64, top + size.y() as i64]
        };
        let parts: Vec<[i64; 4]> = headers.iter().map(corners).collect();
        let around = |a: [i64; 4], b: [i64; 4]| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])];
        let all = parts.iter().copied().reduce(around).ok_or_else(|| damaged(path, "no part"))?;
        Ok(Self { parts, all })
    }

    /// Where a part begins in the window around all.
    fn corner(&self, part: usize) -> [usize; 2] {
        let [left, top, ..] = self.parts[part];
        [(left - self.all[0]) as usize, (top - self.all[1]) as usize]
    }
}

/// The picture with all channels, still black, and the first channel of each part.
fn empty_image(path: &Path, headers: &[Header], windows: &Windows) -> Result<(Image, Vec<usize>), ImageError> {
    let [left, top, right, bottom] = windows.all;
    let (width, height) = ((right - left) as usize, (bottom - top) as usize);
    check_size(path, width, height, headers.iter().map(|header| header.channels.list.len()).sum())?;

    let display = headers[0].shared_attributes.display_window;
    let offset = |corner: i64, display: i32| i32::try_from(corner - i64::from(display)).unwrap_or(0);
    let mut image = Image {
        origin: [offset(left, display.position.x()), offset(top, display.position.y())],
        display_size: [display.size.x(), display.size.y()],
        attributes: read_attributes(path)?,
        ..Image::new(width, height)
    };
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
    Ok((image, first))
}
