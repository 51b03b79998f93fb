//! Which of a fabric's materials segments are made of.

use crate::math::sampler::{hash2, unit};

/// A material index for each segment of some curves; none at all where these are of one material.
#[derive(Clone, Debug, Default)]
pub struct MaterialIndices {
    of_segments: Vec<u16>,
    blended: bool,
}

impl MaterialIndices {
    /// One for each segment, or none. Where they are `blended`, as a print's colours are, a segment goes over into its neighbours;
    /// else it ends where it ends, as one yarn does where another begins.
    pub fn new(of_segments: Vec<u16>, blended: bool) -> Self {
        Self { of_segments, blended }
    }

    /// Their number.
    pub fn len(&self) -> usize {
        self.of_segments.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.of_segments.is_empty()
    }

    /// Whether segments go over into each other.
    pub fn blended(&self) -> bool {
        self.blended
    }

    /// Bytes that they take.
    pub fn bytes(&self) -> u64 {
        size_of_val(&*self.of_segments) as u64
    }

    /// That of a segment, if any has one.
    #[inline]
    pub fn of(&self, segment: u32) -> Option<u16> {
        self.of_segments.get(segment as usize).copied()
    }

    /// That at `u` (0 to 1) of a segment. Towards a `neighbour`, behind (`true`) or before it, more and more places have that one's, half
    /// of them where both meet: which ones is random, and always the same for one place.
    #[inline]
    pub fn at(&self, segment: u32, u: f32, neighbour: impl FnOnce(bool) -> Option<u32>) -> Option<u16> {
        let own = self.of(segment)?;
        let share = (u - 0.5).abs();
        if !self.blended || unit(hash2(u.to_bits(), segment)) >= share {
            return Some(own);
        }
        Some(neighbour(u > 0.5).and_then(|next| self.of(next)).unwrap_or(own))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_print_goes_over_from_segment_to_segment() {
        let printed = MaterialIndices::new(vec![0, 1, 1], true);
        let next =
            |segment: u32| move |forward: bool| if forward { segment.checked_add(1) } else { segment.checked_sub(1) };
        let share = |segment: u32, from: f32| {
            const COUNT: u16 = 4000;
            let at = |i: u16| from + 0.1 * f32::from(i) / f32::from(COUNT);
            let ones = (0..COUNT).filter(|&i| printed.at(segment, at(i), next(segment)) == Some(1)).count();
            ones as f32 / f32::from(COUNT)
        };
        for (segment, from, want) in [
            (0, 0.0, 0.0),
            (0, 0.5, 0.05),
            (0, 0.9, 0.45),
            (1, 0.0, 0.55),
            (1, 0.4, 0.95),
            (1, 0.9, 1.0),
            (2, 0.9, 1.0),
        ] {
            let share = share(segment, from);
            assert!((share - want).abs() < 0.03, "segment {segment} from {from}: {share}, not {want}");
        }
    }

    #[test]
    fn one_yarn_ends_where_another_begins() {
        let yarns = MaterialIndices::new(vec![0, 1], false);
        assert_eq!(yarns.at(0, 0.999, |_| Some(1)), Some(0));
        assert_eq!(yarns.at(1, 0.0, |_| Some(0)), Some(1));
        assert_eq!(MaterialIndices::default().at(1, 0.0, |_| Some(0)), None);
    }
}
