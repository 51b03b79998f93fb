//! A look at a file before the reader sees it: counts that its bytes cannot hold are refused here, and names that would
//! lead it in circles.
//!
//! The reader of binary files takes room for as many values as a count says. So every count of the structural sections,
//! and of the arrays that fields point at, is held against the size of the file.

use std::cell::Cell;

use super::text::{Kind, pieces};
use crate::files::stage::Problem;

const MAGIC: &[u8] = b"PXR-USDC";
/// No compression of the format makes more of a byte: LZ4 stores 255 in one, its integers take two bits each.
const MOST_EXPANSION: u64 = 255 * 4;
const SECTION_ENTRY: usize = 32;

const ARCHIVE: &[u8] = b"PK\x03\x04";

fn is_text(bytes: &[u8]) -> bool {
    bytes.trim_ascii_start().starts_with(b"#usda")
}

/// Whether a file begins as USD files do.
pub(super) fn is_usd(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC) || bytes.starts_with(ARCHIVE) || is_text(bytes)
}

/// Looks a file over. The text reader makes room as it reads: of text only the depth counts. Layers inside of archives
/// are looked over one by one.
pub(super) fn look_over(bytes: &[u8]) -> Result<(), Problem> {
    if bytes.starts_with(MAGIC) {
        return binary(bytes);
    }
    if bytes.starts_with(ARCHIVE) {
        return archive(bytes);
    }
    if is_text(bytes) {
        return text(bytes);
    }
    Err(Problem::new("expected a USD file, found neither #usda, PXR-USDC nor an archive at its beginning"))
}

/// Files of a `.usdz` are stored, not deflated: they are looked over where they lie.
fn archive(bytes: &[u8]) -> Result<(), Problem> {
    let mut at = 0;
    while bytes[at..].starts_with(ARCHIVE) {
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
    let tokens = section("TOKENS")?;
    let uncompressed = number(bytes, tokens.start + 8, 8)?;
    believable(tokens.start, number(bytes, tokens.start, 8)?, uncompressed)?;
    block(bytes, tokens.start + 16, uncompressed)?;
    let strings = section("STRINGS")?;
    believable(strings.start, number(bytes, strings.start, 8)?, (strings.end - strings.start) as u64 / 4)?;
    // Each a count, then so many numbers in one block or in several of the same count.
    packed_numbers(bytes, section("FIELDSETS")?.start, 1)?;
    packed_numbers(bytes, section("SPECS")?.start, 3)?;
    paths(bytes, &tokens, section("PATHS")?.start)?;
    fields(&Crate { bytes, version, looked_at: Cell::new(0) }, &section("FIELDS")?)
}

/// Unpacks a block into at most so many bytes.
fn unpacked(bytes: &[u8], at: usize, most: usize) -> Result<Vec<u8>, Problem> {
    let end = block(bytes, at, most as u64)?;
    // A first byte of 0 says that there is one chunk.
    let Some((0, packed)) = bytes[at + 8..end].split_first().map(|(&chunks, rest)| (chunks, rest)) else {
        return Err(Problem::new(format!("byte {at}: a block is in several chunks, which are not read")));
    };
    let mut out = vec![0; most];
    let length = lz4_flex::block::decompress_into(packed, &mut out)
        .map_err(|e| Problem::new(format!("byte {at}: a block cannot be unpacked: {e}")))?;
    out.truncate(length);
    Ok(out)
}

/// The paths: three lists of numbers, of which the second gives each path's last element by its token, properties below 0.
fn paths(bytes: &[u8], tokens: &Section, at: usize) -> Result<(), Problem> {
    let count = number(bytes, at + 8, 8)?;
    packed_numbers(bytes, at + 8, 3)?;
    believable(at, number(bytes, at, 8)?, count)?;
    let words = unpacked(bytes, tokens.start + 16, number(bytes, tokens.start + 8, 8)? as usize)?;
    let words: Vec<&[u8]> = words.split(|&b| b == 0).collect();
    let elements = block(bytes, at + 16, count)?;
    let coded = unpacked(bytes, elements, 4 + count.div_ceil(4) as usize + 4 * count as usize)?;
    for element in whole_numbers(&coded, count as usize)? {
        let word = words.get(element.unsigned_abs() as usize);
        let word = word.ok_or_else(|| Problem::new(format!("byte {elements}: a path of token {element}")))?;
        // Of variants the element is `{set=name}`; the root has an empty one.
        let variant = word.starts_with(b"{") && word.ends_with(b"}");
        if element > 0 && !variant && !word.is_empty() {
            identifier(word, elements)?;
        }
    }
    Ok(())
}

/// Names of prims are letters, digits and `_`, by USD's rule; others make paths that mean something else.
fn identifier(name: &[u8], at: usize) -> Result<(), Problem> {
    if !name.is_empty() && name.iter().all(|b| b.is_ascii_alphanumeric() || *b == b'_' || *b >= 0x80) {
        return Ok(());
    }
    let name = String::from_utf8_lossy(name);
    Err(Problem::new(format!("byte {at}: {name:?} is no name of a prim; one is of letters, digits and _")))
}

/// Braces of a path hold one variant: `{set=name}`. Others lead the reader in circles.
fn path(path: &[u8], at: usize) -> Result<(), Problem> {
    let mut open = false;
    let sound = path.iter().all(|&b| match b {
        b'{' => !std::mem::replace(&mut open, true),
        b'}' => std::mem::replace(&mut open, false),
        _ => true,
    });
    if sound && !open {
        return Ok(());
    }
    let path = String::from_utf8_lossy(path);
    Err(Problem::new(format!("byte {at}: <{path}> is no path; its braces do not hold one variant each")))
}

/// The format's coding of 32-bit numbers: the commonest step, two bits a number for the size of its step, the steps.
fn whole_numbers(coded: &[u8], count: usize) -> Result<Vec<i32>, Problem> {
    let step = |at: usize, size: usize| -> Result<i32, Problem> {
        let shift = 64 - 8 * size;
        // Sign of its own size.
        Ok((((number(coded, at, size)? << shift) as i64) >> shift) as i32)
    };
    if count == 0 {
        return Ok(Vec::new());
    }
    let common = step(0, 4)?;
    let mut at = 4 + count.div_ceil(4);
    let mut last = 0i32;
    (0..count)
        .map(|i| {
            let size = [0, 1, 2, 4][(number(coded, 4 + i / 4, 1)? >> (2 * (i % 4)) & 3) as usize];
            last = last.wrapping_add(if size == 0 { common } else { step(at, size)? });
            at += size;
            Ok(last)
        })
        .collect()
}

/// A count that its place has room for.
fn believable(at: usize, count: u64, most: u64) -> Result<(), Problem> {
    if count <= most {
        return Ok(());
    }
    Err(Problem::new(format!("byte {at}: {count} values do not fit where they are, {most} would")))
}

/// A compressed block, its size in front, that holds so many bytes when unpacked: the byte after it.
fn block(bytes: &[u8], at: usize, unpacked: u64) -> Result<usize, Problem> {
    let size = number(bytes, at, 8)?;
    believable(at, size, (bytes.len() - at - 8) as u64)?;
    believable(at, unpacked, size.saturating_mul(MOST_EXPANSION))?;
    Ok(at + 8 + size as usize)
}

/// A count, then so many numbers in each of some compressed blocks: the byte after them.
fn packed_numbers(bytes: &[u8], at: usize, blocks: usize) -> Result<usize, Problem> {
    let count = number(bytes, at, 8)?;
    (0..blocks).try_fold(at + 8, |at, _| block(bytes, at, count))
}

/// A binary file, and the version of the format.
struct Crate<'a> {
    bytes: &'a [u8],
    version: [u64; 2],
    /// Values that were looked at: several fields may share one, and dictionaries that share each other multiply.
    looked_at: Cell<usize>,
}

/// How often a value of eight bytes may be shared in the mean, as the reader would make as many of it.
const MOST_SHARED: usize = 128;

/// Every field that points at an array points at a count that the file can hold.
fn fields(file: &Crate<'_>, section: &Section) -> Result<(), Problem> {
    let bytes = file.bytes;
    let count = number(bytes, section.start, 8)?;
    // Token indices, compressed, then the representations of values, compressed.
    let at = packed_numbers(bytes, section.start, 1)?;
    block(bytes, at, count.saturating_mul(8))?;
    let values = unpacked(bytes, at, count as usize * 8)?;
    for value in values.chunks_exact(8) {
        let value = u64::from_le_bytes(value.try_into().expect("eight bytes"));
        representation(file, value, 0)?;
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
    use std::ops::RangeInclusive;

    pub(super) const INTEGERS: RangeInclusive<u64> = 3..=6;
    /// Of two, four and eight bytes.
    pub(super) const FLOATS: RangeInclusive<u64> = 7..=9;
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
fn representation(file: &Crate<'_>, value: u64, depth: usize) -> Result<(), Problem> {
    let (bytes, at) = (file.bytes, (value & PAYLOAD) as usize);
    file.looked_at.set(file.looked_at.get() + 1);
    if file.looked_at.get() > bytes.len() / 8 * MOST_SHARED {
        return Err(Problem::new(format!("byte {at}: dictionaries or time samples share each other without end")));
    }
    let own = (value >> 48) & 0xff;
    if value & IS_INLINED != 0 || at == 0 {
        return Ok(());
    }
    if value & IS_ARRAY != 0 {
        return array(file, at, own, value & IS_PACKED != 0);
    }
    // What is not packed takes at least a byte of the file for each value.
    let count = |at: usize| {
        let count = number(bytes, at, 8)?;
        believable(at, count, bytes.len() as u64).map(|()| count as usize)
    };
    match own {
        kind::PATH_VECTOR
        | kind::TOKEN_VECTOR
        | kind::STRING_VECTOR
        | kind::DOUBLE_VECTOR
        | kind::LAYER_OFFSETS
        | kind::VARIANT_SELECTIONS
        | kind::RELOCATES => count(at).map(|_| ()),
        kind::FIRST_LIST_OP..=kind::LAST_LIST_OP | kind::UNREGISTERED_LIST_OP | kind::PAYLOAD_LIST_OP => {
            // A byte that tells which lists follow, at most six; the first bit is no list.
            let lists = number(bytes, at, 1)? >> 1;
            if lists == 0 { Ok(()) } else { list_op(bytes, own, at + 1, lists.count_ones()) }
        }
        kind::DICTIONARY => dictionary(file, at, depth),
        kind::TIME_SAMPLES => {
            if depth > 0 {
                return Err(Problem::new(format!("byte {at}: time samples inside of another value")));
            }
            let times = offset(bytes, at)?;
            representation(file, number(bytes, times, 8)?, depth + 1)?;
            let values = offset(bytes, times + 8)?;
            let count = count(values)?;
            (0..count).try_for_each(|i| representation(file, number(bytes, values + 8 + 8 * i, 8)?, depth + 1))
        }
        _ => Ok(()),
    }
}

/// An array: its count, whose width hangs on the version, then values as they are, or packed: whole numbers in a block,
/// fractions as whole numbers (`i`) or as places in a table that comes first (`t`).
fn array(file: &Crate<'_>, at: usize, own: u64, packed: bool) -> Result<(), Problem> {
    const FEWEST_PACKED: u64 = 4;
    let bytes = file.bytes;
    let at = if file.version < [0, 5] { at.saturating_add(4) } else { at };
    let wide = if file.version < [0, 7] { 4 } else { 8 };
    let count = number(bytes, at, wide)?;
    let values = at + wide;
    let whole = kind::INTEGERS.contains(&own) && file.version >= [0, 5];
    let fraction = kind::FLOATS.contains(&own) && file.version >= [0, 6];
    if !packed || count < FEWEST_PACKED || !(whole || fraction) {
        return believable(at, count, (bytes.len() - values) as u64);
    }
    if whole {
        return block(bytes, values, count).map(|_| ());
    }
    match number(bytes, values, 1)? as u8 {
        b'i' => block(bytes, values + 1, count).map(|_| ()),
        b't' => {
            let size = number(bytes, values + 1, 4)?;
            believable(values + 1, size, (bytes.len() - values - 5) as u64 / 2)?;
            let width = 2 << (own - kind::FLOATS.start());
            block(bytes, values + 5 + size as usize * width, count).map(|_| ())
        }
        code => Err(Problem::new(format!("byte {values}: fractions are packed in an unknown way, {code}"))),
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
fn dictionary(file: &Crate<'_>, at: usize, depth: usize) -> Result<(), Problem> {
    let bytes = file.bytes;
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
        representation(file, number(bytes, value, 8)?, depth + 1)?;
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

/// Brackets of text in one another, outside of quotes and comments: each takes a call of the reader. Quoted names of prims
/// are looked at as well.
fn text(bytes: &[u8]) -> Result<(), Problem> {
    const MOST: usize = 1000;
    let (mut depth, mut deepest) = (0usize, 0);
    // Whether `def`, `over` or `class` came before, with at most a type between.
    let mut declares = false;
    for piece in pieces(bytes, 0) {
        match piece.kind {
            Kind::Mark(b'{' | b'[' | b'(') => {
                depth += 1;
                deepest = deepest.max(depth);
                declares = false;
            }
            Kind::Mark(mark @ (b'}' | b']' | b')' | b'=')) => {
                depth = depth.saturating_sub(usize::from(mark != b'='));
                declares = false;
            }
            Kind::Quoted if std::mem::take(&mut declares) => {
                identifier(&bytes[piece.inner.clone()], piece.inner.start)?
            }
            Kind::Path => path(&bytes[piece.inner], piece.all.start)?,
            Kind::Word => declares |= matches!(&bytes[piece.all], b"def" | b"over" | b"class"),
            _ => {}
        }
    }
    if deepest > MOST {
        return Err(Problem::new(format!("brackets lie {deepest} deep in one another, at most {MOST} are read")));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each dictionary holds the next one twice: the reader would make two to the power of their number.
    #[test]
    fn dictionaries_that_multiply_are_refused() {
        let chain = |count: u64| {
            let value = |i: u64| kind::DICTIONARY << 48 | (8 + i * 48);
            let mut bytes = vec![0; 8];
            for i in 0..count {
                bytes.extend(2u64.to_le_bytes());
                for _ in 0..2 {
                    bytes.extend(0u32.to_le_bytes());
                    bytes.extend(8u64.to_le_bytes());
                    bytes.extend(value(i + 1).to_le_bytes());
                }
            }
            // The last one is empty.
            bytes.extend(0u64.to_le_bytes());
            let file = Crate { bytes: &bytes, version: [0, 8], looked_at: Cell::new(0) };
            representation(&file, value(0), 0)
        };
        assert!(chain(4).is_ok());
        let problem = chain(30).unwrap_err();
        assert!(problem.text.contains("share each other"), "{}", problem.text);
    }
}
