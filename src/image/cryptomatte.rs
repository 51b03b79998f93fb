//! Cryptomatte, version 1.2 of Psyop's specification: identifiers by the hash of a name, ranked by coverage.

use std::collections::BTreeMap;

use super::{
    Attribute,
    exr::{ChannelSpec, Sample},
};

/// Identifiers kept for each pixel, those of the largest coverage.
pub(crate) const DEPTH: usize = 6;

/// The identifier of a name: MurmurHash3, kept from being infinite, subnormal or not a number as a float.
pub(crate) fn id(name: &str) -> u32 {
    let hash = murmur3(name.as_bytes());
    if matches!(hash >> 23 & 0xff, 0 | 0xff) { hash ^ 1 << 23 } else { hash }
}

/// MurmurHash3 for 32-bit machines, from seed 0 (Austin Appleby).
fn murmur3(bytes: &[u8]) -> u32 {
    let scramble = |k: u32| k.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let (words, rest) = bytes.as_chunks::<4>();
    let mut hash = words.iter().fold(0_u32, |h, w| {
        (h ^ scramble(u32::from_le_bytes(*w))).rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64)
    });
    let mut last = [0; 4];
    last[..rest.len()].copy_from_slice(rest);
    hash ^= scramble(u32::from_le_bytes(last)) ^ bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

/// The channels of a layer: `NAME00.R` the first identifier, `NAME00.G` its coverage, `NAME00.B` the second, and so on.
pub(crate) fn channels(layer: &str) -> impl Iterator<Item = ChannelSpec> {
    let parts = (0..DEPTH / 2).flat_map(|pair| ["R", "G", "B", "A"].map(|part| (pair, part)));
    // Identifiers are exact in 32 bits only.
    parts.map(move |(pair, part)| ChannelSpec::new(format!("{layer}{pair:02}.{part}"), Sample::F32))
}

/// The metadata by which programs find a layer and the names in it.
pub(crate) fn attributes<'a>(layer: &str, names: impl Iterator<Item = &'a str>) -> Vec<(String, Attribute)> {
    // Sorted, so that equal pictures are equal files.
    let manifest: BTreeMap<&str, String> = names.map(|name| (name, format!("{:08x}", id(name)))).collect();
    let manifest = serde_json::to_string(&manifest).expect("text becomes JSON");
    let key = &format!("{:08x}", murmur3(layer.as_bytes()))[..7];
    [
        ("name", layer.to_owned()),
        ("hash", "MurmurHash3_32".to_owned()),
        ("conversion", "uint32_to_float32".to_owned()),
        ("manifest", manifest),
    ]
    .map(|(what, value)| (format!("cryptomatte/{key}/{what}"), Attribute::Text(value)))
    .into()
}

/// The samples of a pixel in the order of [`channels`]: what covers it with its number of samples, of `total`. Several
/// entries of one identifier count together.
pub(crate) fn rank(covering: &mut Vec<(u32, u32)>, total: u32) -> [f32; 2 * DEPTH] {
    covering.sort_unstable();
    covering.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
    // Equal coverage goes by identifier: any rule will do, if it is always the same.
    covering.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
    let mut out = [0.0; 2 * DEPTH];
    for (pair, &(id, count)) in out.as_chunks_mut::<2>().0.iter_mut().zip(covering.iter()) {
        *pair = [f32::from_bits(id), count as f32 / total as f32];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_those_of_the_specification() {
        // The first four values are published with MurmurHash3, the floats with the specification.
        for (text, hash) in [
            ("", 0),
            ("hello", 0x248b_fa47),
            ("hello, world", 0x149b_bb7f),
            ("The quick brown fox jumps over the lazy dog", 0x2e4f_f723),
        ] {
            assert_eq!(murmur3(text.as_bytes()), hash, "{text}");
        }
        for (text, float) in
            [("hello", 6.070_563e-17), ("cube", -4.084_619e15), ("sphere", 2.790_186e15), ("plane", 3.665_576_2e-11)]
        {
            assert_eq!(f32::from_bits(id(text)), float, "{text}");
        }
        assert_eq!(id(""), 1 << 23, "zero is no identifier");
    }

    #[test]
    fn identifiers_are_ordinary_numbers() {
        for i in 0..20_000 {
            assert!(f32::from_bits(id(&format!("name {i}"))).is_normal());
        }
    }

    #[test]
    fn ranks_go_by_coverage() {
        let mut met = vec![(9, 1), (4, 2), (7, 3), (9, 1), (5, 2), (1, 1), (2, 1), (3, 1)];
        let ranks = rank(&mut met, 16);
        let ids: Vec<u32> = ranks.iter().step_by(2).map(|f| f.to_bits()).collect();
        let coverage: Vec<f32> = ranks.iter().skip(1).step_by(2).map(|c| c * 16.0).collect();
        assert_eq!(
            (ids.as_slice(), coverage.as_slice()),
            (&[7, 4, 5, 9, 1, 2][..], &[3.0, 2.0, 2.0, 2.0, 1.0, 1.0][..])
        );
        assert_eq!(rank(&mut Vec::new(), 3), [0.0; 12]);
    }
}
