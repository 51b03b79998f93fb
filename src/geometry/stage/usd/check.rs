//! A look at a file before the reader sees it: counts that its bytes cannot hold are refused here.
//!
//! The reader of binary files takes room for as many values as a count says. So every count of the structural sections,
//! and of the arrays that fields point at, is held against the size of the file.

use crate::geometry::stage::Problem;

const MAGIC: &[u8] = b"PXR-USDC";
/// No compression of the format makes more of a byte: LZ4 stores 255 in one, its integers take two bits each.
const MOST_EXPANSION: u64 = 255 * 4;
const SECTION_ENTRY: usize = 32;

/// Looks a file over. The text reader makes room as it reads: of text only the depth counts. Layers inside of archives
/// are looked over one by one.
pub(in crate::geometry::stage) fn look_over(bytes: &[u8]) -> Result<(), Problem> {
    if bytes.starts_with(MAGIC) {
        return binary(bytes);
    }
    if bytes.starts_with(b"PK\x03\x04") {
        return archive(bytes);
    }
    if bytes.trim_ascii_start().starts_with(b"#usda") {
        return text(bytes);
    }
    Err(Problem::new("expected a USD file, found neither #usda, PXR-USDC nor an archive at its beginning"))
}

/// Files of a `.usdz` are stored, not deflated: they are looked over where they lie.
fn archive(bytes: &[u8]) -> Result<(), Problem> {
    let mut at = 0;
    while bytes[at..].starts_with(b"PK\x03\x04") {
        let field = |offset: usize, size: usize| number(bytes, at + offset, size);
        let (method, size) = (field(8, 2)?, field(18, 4)? as usize);
        let start = at + 30 + field(26, 2)? as usize + field(28, 2)? as usize;
        if method != 0 {
            return Err(Problem::new(format!("byte {at}: a file in it is compressed; in .usdz files none may be")));
        }
        let inside = start.checked_add(size).and_then(|end| bytes.get(start..end));
        let inside = inside.ok_or_else(|| Problem::new(format!("byte {at}: a file in it goes on beyond the end")))?;
        if inside.starts_with(MAGIC) {
            binary(inside).map_err(|p| Problem::new(format!("in the archive from byte {start} on: {}", p.text)))?;
        }
        at = start + size;
    }
    Ok(())
}

fn number(bytes: &[u8], at: usize, size: usize) -> Result<u64, Problem> {
    let end = at.checked_add(size);
    let Some(own) = end.and_then(|end| bytes.get(at..end)) else {
        return Err(Problem::new(format!("ends at byte {}, where a number at byte {at} is expected", bytes.len())));
    };
    let mut wide = [0; 8];
    wide[..size].copy_from_slice(own);
    Ok(u64::from_le_bytes(wide))
}

/// A part of the file that one section takes.
struct Section {
    start: usize,
    end: usize,
}

fn binary(bytes: &[u8]) -> Result<(), Problem> {
    let version = [number(bytes, 8, 1)?, number(bytes, 9, 1)?];
    if version < [0, 4] {
        return Err(Problem::new(format!(
            "is of version {}.{} of the binary format, 0.4 and later are read; save it anew with usdcat",
            version[0], version[1]
        )));
    }
    let toc = number(bytes, 16, 8)? as usize;
    let count = number(bytes, toc, 8)?;
    if count > 64 {
        return Err(Problem::new(format!("byte {toc}: {count} sections, at most 64 are expected")));
    }
    let section = |name: &str| -> Result<Section, Problem> {
        for i in 0..count as usize {
            let at = toc + 8 + i * SECTION_ENTRY;
            let entry = bytes.get(at..at + SECTION_ENTRY);
            let entry = entry.ok_or_else(|| Problem::new(format!("byte {at}: the list of sections is cut off")))?;
            if entry[..16].split(|&b| b == 0).next() == Some(name.as_bytes()) {
                let (start, size) = (number(bytes, at + 16, 8)? as usize, number(bytes, at + 24, 8)? as usize);
                let end = start.checked_add(size).filter(|&end| end <= bytes.len());
                let end = end.ok_or_else(|| Problem::new(format!("section {name} goes on beyond the end")))?;
                return Ok(Section { start, end });
            }
        }
        Err(Problem::new(format!("there is no section {name}")))
    };
    let believable = |name: &str, at: usize, count: u64, section: &Section| {
        let most = (section.end - section.start) as u64 * MOST_EXPANSION;
        if count <= most {
            return Ok(());
        }
        Err(Problem::new(format!("byte {at}: {count} {name} do not fit in {} bytes", section.end - section.start)))
    };
    for name in ["TOKENS", "STRINGS", "FIELDS", "FIELDSETS", "PATHS", "SPECS"] {
        let own = section(name)?;
        let count = number(bytes, own.start, 8)?;
        believable(&name.to_lowercase(), own.start, count, &own)?;
        if name == "TOKENS" {
            believable("bytes of tokens", own.start + 8, number(bytes, own.start + 8, 8)?, &own)?;
        }
    }
    fields(bytes, &section("FIELDS")?)
}

/// Every field that points at an array points at a count that the file can hold.
fn fields(bytes: &[u8], section: &Section) -> Result<(), Problem> {
    let count = number(bytes, section.start, 8)? as usize;
    // Token indices, compressed, then the representations of values, compressed.
    let size = number(bytes, section.start + 8, 8)? as usize;
    let at = section.start.checked_add(16).and_then(|a| a.checked_add(size)).filter(|&a| a + 8 <= section.end);
    let at = at.ok_or_else(|| Problem::new("section FIELDS is cut off"))?;
    let size = number(bytes, at, 8)? as usize;
    let packed = at.checked_add(8 + size).and_then(|end| bytes.get(at + 8..end));
    let packed = packed.ok_or_else(|| Problem::new("section FIELDS is cut off"))?;
    let mut values = vec![0; count.saturating_mul(8)];
    // A first byte of 0 says that there is one chunk.
    let Some((0, packed)) = packed.split_first().map(|(&chunks, rest)| (chunks, rest)) else {
        return Err(Problem::new("section FIELDS is in several chunks, which are not read"));
    };
    let length = lz4_flex::block::decompress_into(packed, &mut values)
        .map_err(|e| Problem::new(format!("section FIELDS cannot be unpacked: {e}")))?;
    for value in values[..length].chunks_exact(8) {
        let value = u64::from_le_bytes(value.try_into().expect("eight bytes"));
        representation(bytes, value, 0)?;
    }
    Ok(())
}

const IS_ARRAY: u64 = 1 << 63;
const IS_INLINED: u64 = 1 << 62;
const IS_PACKED: u64 = 1 << 61;
const PAYLOAD: u64 = (1 << 48) - 1;
/// How deep dictionaries may hold dictionaries.
const MOST_NESTED: usize = 32;

/// Kinds of values by their number in the format.
mod kind {
    pub(super) const DICTIONARY: u64 = 31;
    pub(super) const FIRST_LIST_OP: u64 = 32;
    pub(super) const LAST_LIST_OP: u64 = 39;
    pub(super) const PATH_VECTOR: u64 = 40;
    pub(super) const TOKEN_VECTOR: u64 = 41;
    pub(super) const VARIANT_SELECTIONS: u64 = 45;
    pub(super) const TIME_SAMPLES: u64 = 46;
    pub(super) const DOUBLE_VECTOR: u64 = 48;
    pub(super) const LAYER_OFFSETS: u64 = 49;
    pub(super) const STRING_VECTOR: u64 = 50;
    pub(super) const UNREGISTERED_LIST_OP: u64 = 54;
    pub(super) const PAYLOAD_LIST_OP: u64 = 55;
    pub(super) const RELOCATES: u64 = 58;
}

/// Looks a value over: arrays and lists have counts, dictionaries and time samples hold further values.
fn representation(bytes: &[u8], value: u64, depth: usize) -> Result<(), Problem> {
    let at = (value & PAYLOAD) as usize;
    let own = (value >> 48) & 0xff;
    if value & IS_INLINED != 0 || at == 0 {
        return Ok(());
    }
    // What is not packed takes at least a byte of the file for each value.
    let count = |at: usize, packed: bool| {
        let count = number(bytes, at, 8)?;
        let most = bytes.len() as u64 * if packed { MOST_EXPANSION } else { 1 };
        if count > most {
            return Err(Problem::new(format!("byte {at}: {count} values do not fit in the file")));
        }
        Ok(count as usize)
    };
    if value & IS_ARRAY != 0 {
        return count(at, value & IS_PACKED != 0).map(|_| ());
    }
    match own {
        kind::PATH_VECTOR
        | kind::TOKEN_VECTOR
        | kind::STRING_VECTOR
        | kind::DOUBLE_VECTOR
        | kind::LAYER_OFFSETS
        | kind::VARIANT_SELECTIONS
        | kind::RELOCATES => count(at, value & IS_PACKED != 0).map(|_| ()),
        kind::FIRST_LIST_OP..=kind::LAST_LIST_OP | kind::UNREGISTERED_LIST_OP | kind::PAYLOAD_LIST_OP => {
            // A byte that tells which lists follow, at most six; the first bit is no list.
            let lists = number(bytes, at, 1)? >> 1;
            if lists == 0 { Ok(()) } else { list_op(bytes, own, at + 1, lists.count_ones()) }
        }
        kind::DICTIONARY => dictionary(bytes, at, depth),
        kind::TIME_SAMPLES => {
            if depth > 0 {
                return Err(Problem::new(format!("byte {at}: time samples inside of another value")));
            }
            let times = offset(bytes, at)?;
            representation(bytes, number(bytes, times, 8)?, depth + 1)?;
            let values = offset(bytes, times + 8)?;
            let count = count(values, false)?;
            (0..count).try_for_each(|i| representation(bytes, number(bytes, values + 8 + 8 * i, 8)?, depth + 1))
        }
        _ => Ok(()),
    }
}

/// Lists whose items have one size are followed to the last; of references and payloads the first count is looked at.
fn list_op(bytes: &[u8], kind: u64, mut at: usize, lists: u32) -> Result<(), Problem> {
    let size = match kind {
        32..=34 | 36 | 38 | kind::UNREGISTERED_LIST_OP => Some(4),
        37 | 39 => Some(8),
        _ => None,
    };
    for _ in 0..lists {
        let count = number(bytes, at, 8)?;
        if count > bytes.len() as u64 {
            return Err(Problem::new(format!("byte {at}: {count} items do not fit in the file")));
        }
        let Some(size) = size else { return Ok(()) };
        at += 8 + size * count as usize;
    }
    Ok(())
}

/// A count, then for each entry the index of its key, and an offset from there to its value.
fn dictionary(bytes: &[u8], at: usize, depth: usize) -> Result<(), Problem> {
    if depth > MOST_NESTED {
        return Err(Problem::new(format!("byte {at}: dictionaries lie more than {MOST_NESTED} deep")));
    }
    let count = number(bytes, at, 8)?;
    if count > bytes.len() as u64 {
        return Err(Problem::new(format!("byte {at}: {count} entries do not fit in the file")));
    }
    let mut entry = at + 8;
    for _ in 0..count {
        let value = offset(bytes, entry + 4)?;
        representation(bytes, number(bytes, value, 8)?, depth + 1)?;
        entry = value + 8;
    }
    Ok(())
}

/// Where an offset, counted from its own place, leads.
fn offset(bytes: &[u8], at: usize) -> Result<usize, Problem> {
    let by = number(bytes, at, 8)? as i64;
    let to = i64::try_from(at).ok().and_then(|at| at.checked_add(by)).and_then(|to| usize::try_from(to).ok());
    to.filter(|&to| to > at && to < bytes.len())
        .ok_or_else(|| Problem::new(format!("byte {at}: an offset leads out of the file")))
}

/// Brackets of text in one another, outside of quotes and comments: each takes a call of the reader.
fn text(bytes: &[u8]) -> Result<(), Problem> {
    const MOST: usize = 1000;
    let (mut depth, mut deepest, mut i) = (0usize, 0, 0);
    while i < bytes.len() {
        match bytes[i] {
            b'{' | b'[' | b'(' => {
                depth += 1;
                deepest = deepest.max(depth);
            }
            b'}' | b']' | b')' => depth = depth.saturating_sub(1),
            b'#' => i += bytes[i..].iter().position(|&b| b == b'\n').unwrap_or(bytes.len() - i - 1),
            quote @ (b'"' | b'\'') => {
                let long = bytes[i..].starts_with(&[quote; 3]);
                let end: &[u8] = if long { &[quote; 3] } else { &[quote; 1] };
                i += end.len();
                while i < bytes.len() && !bytes[i..].starts_with(end) {
                    i += if bytes[i] == b'\\' { 2 } else { 1 };
                }
                i += end.len() - 1;
            }
            _ => {}
        }
        i += 1;
    }
    if deepest > MOST {
        return Err(Problem::new(format!("brackets lie {deepest} deep in one another, at most {MOST} are read")));
    }
    Ok(())
}
