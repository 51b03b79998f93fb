//! Binary layers as usd-core takes them.
//!
//! The `openusd` crate (0.6) stores `primChildren` and `properties` as arrays of tokens. usd-core 26 refuses such a file: it
//! has them as token vectors, the same bytes under another type. And the crate compresses lists of four integers, usd-core
//! only those of sixteen: it takes what is shorter for plain numbers. Both are put right in the table of fields, which is
//! written again behind all other sections.

use std::io;

/// Types of values in the format.
const INT: u64 = 3;
const TOKEN: u64 = 11;
const TOKEN_VECTOR: u64 = 41;
const ARRAY: u64 = 1 << 63;
const COMPRESSED: u64 = 1 << 61;
/// Lists of fewer integers are never compressed.
const FEWEST: usize = 16;
const SECTION_ENTRY: usize = 32;

/// The same layer with lists of children and of integers as usd-core writes them.
///
/// # Errors
/// The bytes are no binary layer.
pub(super) fn as_usd_core_writes(bytes: &[u8]) -> io::Result<Vec<u8>> {
    rewritten(bytes).ok_or_else(|| io::Error::new(io::ErrorKind::InvalidData, "a binary layer that cannot be read"))
}

fn rewritten(bytes: &[u8]) -> Option<Vec<u8>> {
    let toc = usize::try_from(number(bytes, 16)?).ok()?;
    let sections = usize::try_from(number(bytes, toc)?).ok()?;
    let entry = |name: &[u8]| {
        (0..sections).map(|i| toc + 8 + i * SECTION_ENTRY).find(|&at| bytes.get(at..at + name.len()) == Some(name))
    };
    let start = |entry: usize| usize::try_from(number(bytes, entry + 16)?).ok();
    let tokens = start(entry(b"TOKENS\0")?)?;
    let own = entry(b"FIELDS\0")?;
    let fields = start(own)?;

    // Which tokens are names of lists of children.
    let text = unpacked(bytes, tokens + 16, usize::try_from(number(bytes, tokens + 8)?).ok()?)?;
    let lists: Vec<i64> = text
        .split(|&b| b == 0)
        .zip(0..)
        .filter(|(token, _)| [&b"primChildren"[..], b"properties"].contains(token))
        .map(|(_, index)| index)
        .collect();
    let count = usize::try_from(number(bytes, fields)?).ok()?;
    let packed = usize::try_from(number(bytes, fields + 8)?).ok()?;
    let names = integers(&unpacked(bytes, fields + 8, 8 + 5 * count)?, count)?;
    let second = fields + 16 + packed;
    let mut values = unpacked(bytes, second, 8 * count)?;
    let mut out = bytes[..toc].to_vec();
    for (value, name) in values.chunks_exact_mut(8).zip(&names) {
        let bits = u64::from_le_bytes(value.try_into().ok()?);
        let (kind, payload) = (bits >> 48 & 0xff, bits & ((1 << 48) - 1));
        if kind == TOKEN && bits & ARRAY != 0 && lists.contains(name) {
            value.copy_from_slice(&(TOKEN_VECTOR << 48 | payload).to_le_bytes());
        }
        let packed = ARRAY | COMPRESSED;
        let count = usize::try_from(number(bytes, usize::try_from(payload).ok()?).unwrap_or(0)).ok()?;
        if kind == INT && bits & packed == packed && count < FEWEST {
            let list = integers(&unpacked(bytes, payload as usize + 8, 8 + 5 * count)?, count)?;
            let place = out.len() as u64;
            out.extend((count as u64).to_le_bytes());
            out.extend(list.iter().flat_map(|v| (*v as i32).to_le_bytes()));
            value.copy_from_slice(&(ARRAY | INT << 48 | place).to_le_bytes());
        }
    }

    // The table of contents moves behind the new section.
    let start_of_fields = out.len();
    out.extend(&bytes[fields..second]);
    let mut block = vec![0];
    block.extend(lz4_flex::block::compress(&values));
    out.extend((block.len() as u64).to_le_bytes());
    out.extend(block);
    let new_toc = out.len();
    out.extend(&bytes[toc..]);
    let place = new_toc + (own - toc) + 16;
    out[place..place + 8].copy_from_slice(&(start_of_fields as u64).to_le_bytes());
    out[place + 8..place + 16].copy_from_slice(&((new_toc - start_of_fields) as u64).to_le_bytes());
    out[16..24].copy_from_slice(&(new_toc as u64).to_le_bytes());
    Some(out)
}

fn number(bytes: &[u8], at: usize) -> Option<u64> {
    bytes.get(at..at.checked_add(8)?)?.try_into().ok().map(u64::from_le_bytes)
}

/// The compressed block at `at`, behind its length: one chunk, `most` bytes at most.
fn unpacked(bytes: &[u8], at: usize, most: usize) -> Option<Vec<u8>> {
    let length = usize::try_from(number(bytes, at)?).ok()?;
    let block = bytes.get(at + 8..(at + 8).checked_add(length)?)?;
    let (&0, block) = block.split_first()? else { return None };
    let mut out = vec![0; most];
    let length = lz4_flex::block::decompress_into(block, &mut out).ok()?;
    out.truncate(length);
    Some(out)
}

/// Integers as the format packs them: a common difference, two bits for each difference's size, the other differences.
fn integers(bytes: &[u8], count: usize) -> Option<Vec<i64>> {
    let common = i64::from(i32::from_le_bytes(bytes.get(..4)?.try_into().ok()?));
    let codes = bytes.get(4..4 + count.div_ceil(4))?;
    let mut rest = bytes.get(4 + codes.len()..)?;
    let mut value = 0;
    (0..count)
        .map(|i| {
            let size = [0, 1, 2, 4][usize::from(codes[i / 4] >> (2 * (i % 4)) & 3)];
            let (own, others) = rest.split_at_checked(size)?;
            rest = others;
            value += match *own {
                [] => common,
                [a] => i64::from(a as i8),
                [a, b] => i64::from(i16::from_le_bytes([a, b])),
                [a, b, c, d] => i64::from(i32::from_le_bytes([a, b, c, d])),
                _ => return None,
            };
            Some(value)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        files::curve_file,
        geometry::curve::{Basis, Curve, CurveSet},
    };

    fn kinds(bytes: &[u8]) -> Vec<u64> {
        let toc = number(bytes, 16).unwrap() as usize;
        let entry = (0..6).map(|i| toc + 8 + 32 * i).find(|&at| bytes[at..].starts_with(b"FIELDS\0")).unwrap();
        let fields = number(bytes, entry + 16).unwrap() as usize;
        let count = number(bytes, fields).unwrap() as usize;
        let second = fields + 16 + number(bytes, fields + 8).unwrap() as usize;
        unpacked(bytes, second, 8 * count).unwrap().chunks_exact(8).map(|v| u64::from(v[6])).collect()
    }

    #[test]
    fn lists_of_children_are_token_vectors() {
        let points = (0..5).map(|i| glam::DVec3::new(f64::from(i), 0.0, 0.0)).collect();
        let curve = Curve { basis: Basis::BSpline, closed: false, points, radii: None, flattening: None };
        // Seven counts and ids: fewer than are compressed.
        let set = CurveSet { curves: vec![curve; 7], ..CurveSet::default() };
        let mut bytes = Vec::new();
        curve_file::write(std::path::Path::new("a.usdc"), &set, &mut bytes).unwrap();
        // Of the root, of /cloth and of its curves.
        assert_eq!(kinds(&bytes).iter().filter(|k| **k == TOKEN_VECTOR).count(), 3);
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.usdc"), &bytes).unwrap();
        let read = curve_file::read(&folder.path().join("a.usdc"), &curve_file::ReadOptions::default()).unwrap();
        assert_eq!((read.curves.len(), read.ids[6]), (7, Some(6)));
        let again = as_usd_core_writes(&bytes).unwrap();
        assert_eq!(kinds(&again), kinds(&bytes));
        assert!(as_usd_core_writes(b"PXR-USDC").is_err() && as_usd_core_writes(&bytes[..40]).is_err());
    }
}
