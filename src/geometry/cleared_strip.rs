//! What light keeps clear of fibres on its way to one, as its way back finds it (docs/model.md, section 5).

use super::density::ChordFibers;

/// The strip as wide as a fibre that light has swept on its way to it, in which no other fibre can be, as a way back leaves it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClearedStrip {
    /// The length after which the way has left the strip.
    cleared: f32,
}

impl ClearedStrip {
    /// For light that is turned by an angle of a cosine.
    #[inline]
    pub(crate) fn new(width: f32, turn: f32) -> Self {
        let aside = (1.0 - turn * turn).max(1e-12).sqrt();
        Self { cleared: if turn < 0.0 { width / aside } else { width } }
    }

    /// The length between two distances along the way, less what lies in the strip.
    #[inline]
    pub(crate) fn length(&self, from: f32, to: f32) -> f32 {
        let outside = |t: f32| if t < self.cleared { 0.5 * t * t / self.cleared } else { t - 0.5 * self.cleared };
        outside(to) - outside(from)
    }

    /// The fibres on a chord ahead of where the way begins, less what lies in the strip; `foot` is the distance to the chord's middle.
    #[inline]
    pub(crate) fn fibers(&self, chord: &ChordFibers, foot: f32) -> f32 {
        let (from, to) = ((foot - chord.half).max(0.0), foot + chord.half);
        if to <= 0.0 {
            return 0.0;
        }
        let ring = self.length((to - chord.zone).max(0.0), to) / chord.zone;
        chord.even * (self.length(from, to) / (2.0 * chord.half)) + 0.5 * chord.ring * ring
    }
}
