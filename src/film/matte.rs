//! What covers each pixel: counts of samples, from which Cryptomatte layers are made.

use super::MatteId;

/// For each pixel of a tile, how many samples met which ply or surface.
///
/// Counts are whole numbers, kept in the order of their ids: the same samples make the same matte in whatever order
/// they come, and in whatever shares they were taken. All ids are kept, however small, so that none that grows later
/// has been forgotten.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Matte {
    pixels: Vec<Vec<(MatteId, u32)>>,
}

impl Matte {
    /// For so many pixels.
    pub(super) fn new(pixels: usize) -> Self {
        Self { pixels: vec![Vec::new(); pixels] }
    }

    /// Counts `samples` more at a pixel; does nothing in a matte without pixels, which nobody asked for.
    #[inline]
    pub fn add(&mut self, pixel: usize, id: MatteId, samples: u32) {
        let Some(counts) = self.pixels.get_mut(pixel) else { return };
        match counts.binary_search_by_key(&id, |(id, _)| *id) {
            Ok(place) => counts[place].1 += samples,
            Err(place) => counts.insert(place, (id, samples)),
        }
    }

    /// What covers a pixel and by how many samples, in the order of the ids.
    pub fn counts(&self, pixel: usize) -> &[(MatteId, u32)] {
        self.pixels.get(pixel).map_or(&[], Vec::as_slice)
    }

    /// Adds the counts of pixel `j` of another matte to pixel `i`.
    pub(super) fn merge(&mut self, i: usize, other: &Self, j: usize) {
        other.counts(j).iter().for_each(|(id, count)| self.add(i, *id, *count));
    }

    /// Appends the counts to a file's bytes.
    pub(super) fn save(&self, out: &mut Vec<u8>) {
        for counts in &self.pixels {
            out.extend((counts.len() as u32).to_le_bytes());
            for (id, count) in counts {
                out.extend([id.fabric, id.yarn, id.ply, *count].map(u32::to_le_bytes).as_flattened());
            }
        }
    }

    /// Takes back what [`Self::save`] wrote for so many pixels, of a scene of so many fabrics and surfaces: `None` if it is something else.
    pub(super) fn load(&mut self, bytes: &[u8], things: usize) -> Option<()> {
        let (words, []) = bytes.as_chunks::<4>() else { return None };
        let mut words = words.iter().map(|w| u32::from_le_bytes(*w));
        for counts in &mut self.pixels {
            counts.clear();
            for _ in 0..words.next()? {
                let mut word = || words.next();
                counts.push((MatteId { fabric: word()?, yarn: word()?, ply: word()? }, word()?));
            }
            let known = counts.iter().all(|(id, _)| (id.fabric as usize) < things);
            if !known || !counts.is_sorted_by_key(|(id, _)| *id) {
                return None;
            }
        }
        words.next().is_none().then_some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_do_not_depend_on_their_order() {
        let id = |yarn, ply| MatteId { fabric: 0, yarn, ply };
        let met = [id(3, 1), id(0, 0), id(3, 0), id(3, 1), id(0, 0), id(7, 2), id(3, 1)];
        let mut forward = Matte::new(2);
        let mut backward = Matte::new(2);
        met.iter().for_each(|&m| forward.add(1, m, 1));
        met.iter().rev().for_each(|&m| backward.add(1, m, 1));
        assert_eq!(forward, backward);
        assert_eq!(forward.counts(1), [(id(0, 0), 2), (id(3, 0), 1), (id(3, 1), 3), (id(7, 2), 1)]);
        assert!(forward.counts(0).is_empty());
        let mut none = Matte::default();
        none.add(1, met[0], 1);
        assert!(none.counts(1).is_empty());
        let mut bytes = Vec::new();
        forward.save(&mut bytes);
        let mut again = Matte::new(2);
        assert_eq!(again.load(&bytes, 1), Some(()));
        assert_eq!(again, forward);
        assert_eq!(again.load(&bytes, 0), None);
        assert_eq!(again.load(&bytes[..bytes.len() - 4], 1), None);
        bytes.extend([0; 4]);
        assert_eq!(again.load(&bytes, 1), None);
    }
}
