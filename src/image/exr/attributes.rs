//! The metadata in a header, byte by byte.

use std::{
    fs::File,
    io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write},
    path::Path,
};

use super::{super::ImageError, Attribute, damaged};

/// Longest text that is read back from an attribute, in bytes.
const TEXT_LIMIT: usize = 1 << 26;

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
pub(super) fn sort_attributes(file: &mut File) -> io::Result<()> {
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
