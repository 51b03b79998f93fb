//! What light keeps clear of fibres on its way to one, as its way back finds it (docs/model.md, section 6).

use super::density::ChordFibers;

/// The chance that a line misses a fibre that another line met, at any place of its width: the first line passes that place `aside`, in fibre
/// radii, and makes an angle of the cosine `cos` with the second. 0 to 1.
#[inline]
pub(crate) fn misses(aside: f32, cos: f32) -> f32 {
    let cos = cos.abs().max(1e-3);
    ((aside.abs() - (1.0 - cos)) / (2.0 * cos)).clamp(0.0, 1.0)
}

/// A strip as wide as a fibre that light has swept on its way in, in which no other fibre can be, as a way back finds it: beside the way, by
/// which a part of what the way meets has its middle in the strip.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClearedStrip {
    /// How far beside the strip's middle the way begins, in its widths.
    aside: f32,
    /// By how much that grows with each length of the way.
    slope: f32,
    /// The lengths of the way between which it is beside the strip.
    from: f32,
    to: f32,
}

impl ClearedStrip {
    /// Of a way that begins so far `aside` of the strip's middle, gets by `slope` farther aside with each length, and is beside it from one length
    /// to another, all in the unit of `width`.
    #[inline]
    pub(crate) fn new(width: f32, [aside, slope]: [f32; 2], [from, to]: [f32; 2]) -> Self {
        Self { aside: aside / width, slope: slope / width, from, to }
    }

    /// The length of the way between two distances along it that the strip takes away.
    #[inline]
    pub(crate) fn length(&self, from: f32, to: f32) -> f32 {
        /// A way that turns less from the strip is taken to be as far beside it all along as in its middle.
        const ALONG: f32 = 1e-3;
        let (first, last) = (from.max(self.from), to.min(self.to));
        if first >= last {
            return 0.0;
        }
        let beside = |t: f32| self.aside + self.slope * t;
        if (self.slope * (last - first)).abs() < ALONG {
            return (1.0 - beside(0.5 * (first + last)).abs()).max(0.0) * (last - first);
        }
        // Of a distance in widths the part inside, from the strip's middle on.
        let up_to = |u: f32| {
            let u = u.clamp(-1.0, 1.0);
            u - 0.5 * u * u.abs()
        };
        (up_to(beside(last)) - up_to(beside(first))) / self.slope
    }

    /// The fibres on a chord ahead of where the way begins that would lie in the strip; `foot` is the distance to the chord's middle.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_beside_a_strip_loses_what_it_shares_with_it() {
        // Also nearly along it, and where it ends nowhere.
        for (aside, slope) in [(0.0, 0.7), (0.03, 0.0), (-0.05, 0.4), (0.02, -0.01), (0.0, 1e-7), (0.3, 0.1)] {
            for ends in [[0.0, f32::INFINITY], [0.2, 0.5]] {
                let (width, steps) = (0.1f32, 20_000);
                let strip = ClearedStrip::new(width, [aside, slope], ends);
                let (from, to) = (0.1, 0.9);
                let step = (to - from) / steps as f32;
                let shared = |k: i32| {
                    let t = from + (k as f32 + 0.5) * step;
                    let inside = (1.0 - ((aside + slope * t) / width).abs()).max(0.0);
                    if t > ends[0] && t < ends[1] { f64::from(inside * step) } else { 0.0 }
                };
                let want: f64 = (0..steps).map(shared).sum();
                let found = f64::from(strip.length(from, to));
                assert!((found - want).abs() < 1e-4, "{aside} {slope} {ends:?}: {found} {want}");
            }
        }
    }

    #[test]
    fn a_line_misses_fibers_of_other_lines_as_often_as_thrown_ones() {
        for (aside, cos) in [(0.0f32, 1.0f32), (0.4, 1.0), (1.5, 0.9), (0.9, -0.5), (1.2, 0.05), (3.0, 0.7)] {
            // The fibre's middle is anywhere in its width, across the way of the first line.
            let clear = (0..10_000).filter(|k| {
                let off = 2.0 * (*k as f32 + 0.5) / 10_000.0 - 1.0;
                (aside - off * cos).abs() > 1.0
            });
            let want = clear.count() as f32 / 10_000.0;
            assert!((misses(aside, cos) - want).abs() < 1e-3, "{aside} {cos}: {} {want}", misses(aside, cos));
        }
    }
}
