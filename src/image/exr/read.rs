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
