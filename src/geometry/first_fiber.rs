//! How deep the first fibre that light meets in a ply lies (docs/model.md, section 4).

/// The depth of first fibres by that at which the gaps of [`PlyGaps`](super::gaps::PlyGaps) have as many of them: in fibre radii below the end of the chord
/// on which centres lie, where the gaps have [`FirstFiber::of_gaps`].
///
/// Each knot has a number for ways along the long axis of a pressed section and one for those along the short axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstFiber {
    /// On lines through the inside of the ply.
    pub inside: [[f32; 2]; FirstFiber::KNOTS],
    /// On lines by its rim.
    pub rim: [[f32; 2]; FirstFiber::KNOTS],
}

impl FirstFiber {
    pub(crate) const KNOTS: usize = 7;
    const LAST: usize = Self::KNOTS - 1;
    /// The depth of the second knot. At the others it is so many times the square of their number: fibres at the wall differ most.
    const FIRST: f32 = 0.1;

    /// The depth by the gaps alone at a knot.
    pub(crate) fn of_gaps(knot: usize) -> f32 {
        Self::FIRST * (knot * knot) as f32
    }

    /// How much a line counts as one by the rim that is so many fibre radii inside of it, 0 to 1.
    #[inline]
    pub fn by_rim(deep: f32) -> f32 {
        const ALL: f32 = 3.0;
        const NONE: f32 = 5.0;
        ((NONE - deep) / (NONE - ALL)).clamp(0.0, 1.0)
    }

    /// How deep it lies that is so deep by the gaps alone, on a line that counts so much `by_rim` and is so much along the `short` axis, 0 to 1. Beyond
    /// the last knot it is as the gaps have it.
    #[inline]
    pub fn depth(&self, of_gaps: f32, by_rim: f32, short: f32) -> f32 {
        if of_gaps >= Self::of_gaps(Self::LAST) {
            return of_gaps;
        }
        let at = of_gaps.max(0.0) * Self::FIRST.recip();
        let below = (at.sqrt() as usize).min(Self::LAST - 1);
        let share = ((at - (below * below) as f32) / (2 * below + 1) as f32).clamp(0.0, 1.0);
        let mix = |a: f32, b: f32, share: f32| a + share * (b - a);
        let [from, to] = [below, below + 1].map(|knot| {
            let [inside, rim] = [self.inside[knot], self.rim[knot]].map(|[long, along]| mix(long, along, short));
            mix(inside, rim, by_rim)
        });
        mix(from, to, share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_fibers_lie_between_those_at_the_knots() {
        let [inside, rim] = [1.0, 0.5].map(|of_rim| {
            std::array::from_fn(|knot| [1.0, 0.5].map(|of_short| of_rim * of_short * FirstFiber::of_gaps(knot)))
        });
        let first = FirstFiber { inside, rim };
        for step in 0..200u8 {
            let depth = 0.05 * f32::from(step);
            let share = |share: f32| if depth < FirstFiber::of_gaps(FirstFiber::LAST) { share } else { 1.0 };
            assert!((first.depth(depth, 0.0, 0.0) - depth).abs() < 1e-5, "{depth}");
            assert!((first.depth(depth, 0.0, 0.5) - share(0.75) * depth).abs() < 1e-5, "{depth}");
            assert!((first.depth(depth, 0.5, 0.0) - share(0.75) * depth).abs() < 1e-5, "{depth}");
        }
        assert_eq!(first.depth(-1.0, 0.3, 0.0), 0.0);
        assert_eq!([0.0, 3.0, 4.0, 5.0, 9.0].map(FirstFiber::by_rim), [1.0, 1.0, 0.5, 0.0, 0.0]);
    }
}
