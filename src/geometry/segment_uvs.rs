//! Texture coordinates along curves that are made of segments.

use glam::Vec2;

/// Texture coordinates where each segment starts and ends; empty if nobody asks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SegmentUvs(Vec<[Vec2; 2]>);

/// How far coordinates of neighbours may lie apart; beyond it they jump, as at the seam of a tube.
const MOST: f32 = 0.5;

fn jumps([a, b]: [Vec2; 2]) -> bool {
    (b - a).abs().max_element() > MOST
}

/// What lies a share of the way between two neighbours; the first of them where they jump.
pub(super) fn mixed([a, b]: [Vec2; 2], share: f32) -> Vec2 {
    if jumps([a, b]) { a } else { a.lerp(b, share) }
}

impl SegmentUvs {
    /// Of segments between places that follow each other. One over a jump keeps what it starts with.
    pub fn between(places: &[Vec2]) -> Self {
        let segment = |ends: &[Vec2]| [ends[0], ends[usize::from(!jumps([ends[0], ends[1]]))]];
        Self(places.windows(2).map(segment).collect())
    }

    /// Of segments each of which has one place.
    pub fn constant(places: impl Iterator<Item = Vec2>) -> Self {
        Self(places.map(|uv| [uv; 2]).collect())
    }

    /// Those at `u` (0 to 1) of a segment; zero if nobody asked for them.
    #[inline]
    pub fn at(&self, segment: u32, u: f32) -> Vec2 {
        self.0.get(segment as usize).map_or(Vec2::ZERO, |[start, end]| start.lerp(*end, u))
    }

    /// Puts those of other segments behind these.
    pub fn append(&mut self, other: &Self) {
        self.0.extend_from_slice(&other.0);
    }

    /// Number of segments.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether nobody asked for them, or there are no segments.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Gives back memory that was taken for more segments.
    pub fn shrink_to_fit(&mut self) {
        self.0.shrink_to_fit();
    }

    /// Bytes that they take.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.0)
    }
}
