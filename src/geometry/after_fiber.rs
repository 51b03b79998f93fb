//! What light meets after a fibre that it met, where it goes on and where it goes back (docs/model.md, section 5).

use wide::f32x8;

/// How many fibres fewer than at random places light meets on its way out after one that it met: others are kept away by the first, and
/// then follow all the closer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AfterFiber {
    /// Of light that goes on after the first fibre on its way into the ply.
    pub first: MissingFibers,
    /// Of light that goes on after another one.
    pub later: MissingFibers,
    /// Of light that goes back after the first, where those in a [`ClearedStrip`](super::cleared_strip::ClearedStrip) are not expected. Below 0 where more are met than
    /// expected.
    pub back: MissingFibers,
    /// Of light that goes back after another one, where those that it met before are left out as well.
    pub back_later: MissingFibers,
}

/// The fibres that are missing, for light that ends at the next one and for light that passes nearly all. They differ: one fibre that is
/// surely in the way stops the one and keeps little of the other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MissingFibers {
    /// So many that as much light meets none.
    pub unscattered: Missing,
    /// So many that as many are met on the mean.
    pub counted: Missing,
}

/// They by how many are expected: a row is of those at a knot ([`AfterFiber::expected`]), and the last one of more.
///
/// Of a row's eight numbers two are of light that is turned in the section by one of four angles, on ways along the long axis of a pressed
/// section and along the short one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Missing {
    /// On ways through the inside of the ply.
    pub inside: [[f32; 2 * TURNED]; AfterFiber::KNOTS],
    /// On ways by its rim ([`PlyShape::by_rim`](super::ply::PlyShape::by_rim)).
    pub rim: [[f32; 2 * TURNED]; AfterFiber::KNOTS],
}

/// How many turns are told apart of light that goes on, and of light that goes back.
const TURNED: usize = 4;
/// The cosines of these turns, of 0, 25, 50 and 85 degrees and of 95, 125, 150 and 170; in between it is as the cosine says.
const TURN_COSINES: [[f32; TURNED]; 2] =
    [[1.0, 0.906_307_8, 0.642_787_6, 0.087_155_744], [-0.087_155_744, -0.573_576_45, -0.866_025_4, -0.984_807_7]];

impl AfterFiber {
    pub(crate) const KNOTS: usize = 8;
    /// Expected fibres at the first knot after 0. At the others it is so many times the square of their number: most of the light that gets out
    /// meets few.
    const FIRST: f32 = 0.06;

    /// How many fibres are expected at a knot.
    pub(crate) fn expected(knot: usize) -> f32 {
        Self::FIRST * (knot * knot) as f32
    }

    /// The knot, not the last one, from which on so many fibres are expected, and where they are between it and the next, 0 to 1.
    #[inline]
    pub(crate) fn knot(expected: f32) -> (usize, f32) {
        let at = expected * Self::FIRST.recip();
        let below = (at.sqrt() as usize).min(Self::KNOTS - 2);
        (below, ((at - (below * below) as f32) / (2 * below + 1) as f32).clamp(0.0, 1.0))
    }

    /// Of fibres of which none is within so many expected ones of light that goes on; light that goes back finds its strip clear alone.
    pub(crate) fn free(fibers: f32) -> Self {
        let rows = std::array::from_fn(|knot| [fibers.min(Self::expected(knot)); 2 * TURNED]);
        let onward = MissingFibers::alike(Missing { inside: rows, rim: rows });
        Self { first: onward, later: onward, back: MissingFibers::default(), back_later: MissingFibers::default() }
    }

    /// That of light by whether it met others before the fibre, by the cosine of its turn across it and by how much its way is along the
    /// section's short axis, from 0 to 1.
    #[inline]
    pub(crate) fn turned(&self, later: bool, turn: f32, short: f32) -> AfterTurn<'_> {
        let missing = match (later, turn < 0.0) {
            (false, false) => &self.first,
            (true, false) => &self.later,
            (false, true) => &self.back,
            (true, true) => &self.back_later,
        };
        AfterTurn { missing, shares: shares(turn, short) }
    }
}

impl MissingFibers {
    fn alike(missing: Missing) -> Self {
        Self { unscattered: missing, counted: missing }
    }
}

/// How much each number of a row of [`Missing`] holds of light with a cosine of its turn, and so much along the short axis.
#[inline]
fn shares(turn: f32, short: f32) -> f32x8 {
    let knots = &TURN_COSINES[usize::from(turn < 0.0)];
    let past = |k: usize| ((knots[k] - turn) / (knots[k] - knots[k + 1])).clamp(0.0, 1.0);
    let [a, b, c] = [past(0), past(1), past(2)];
    let long = 1.0 - short;
    let [at0, at1, at2, at3] = [1.0 - a, a - b, b - c, c];
    f32x8::new([at0 * long, at0 * short, at1 * long, at1 * short, at2 * long, at2 * short, at3 * long, at3 * short])
}

/// [`AfterFiber`] on one way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AfterTurn<'a> {
    missing: &'a MissingFibers,
    /// How much of each number of a row holds.
    shares: f32x8,
}

impl AfterTurn<'_> {
    /// How much each number of a row of [`Missing`] holds.
    pub(crate) fn shares(&self) -> f32x8 {
        self.shares
    }

    /// How many fibres light meets that ends at the first one, where so many are expected, on a way that is so much by the rim.
    #[inline]
    pub(crate) fn met(&self, expected: f32, by_rim: f32) -> f32 {
        self.less(&self.missing.unscattered, expected, AfterFiber::knot(expected), by_rim)
    }

    /// How many it meets on the mean.
    #[inline]
    pub(crate) fn counted(&self, expected: f32, by_rim: f32) -> f32 {
        self.less(&self.missing.counted, expected, AfterFiber::knot(expected), by_rim)
    }

    /// Both.
    #[inline]
    pub(crate) fn met_and_counted(&self, expected: f32, by_rim: f32) -> [f32; 2] {
        let knot = AfterFiber::knot(expected);
        [&self.missing.unscattered, &self.missing.counted].map(|missing| self.less(missing, expected, knot, by_rim))
    }

    #[inline]
    fn less(&self, missing: &Missing, expected: f32, (below, at): (usize, f32), by_rim: f32) -> f32 {
        let [from, to] = [below, below + 1].map(|knot| {
            let [inside, rim] = [&missing.inside, &missing.rim].map(|rows| f32x8::new(rows[knot]));
            inside + (rim - inside) * f32x8::splat(by_rim)
        });
        let missing = from + (to - from) * f32x8::splat(at);
        (expected - (missing * self.shares).reduce_add()).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_a_fiber_no_more_are_met_than_are_expected_and_the_more_the_more_are() {
        let turns = [[0.0f32, 25.0, 50.0, 85.0], [95.0, 125.0, 150.0, 170.0]];
        for (cosine, turn) in TURN_COSINES.iter().flatten().zip(turns.iter().flatten()) {
            assert!((cosine - turn.to_radians().cos()).abs() < 1e-6, "{cosine} of {turn} degrees");
        }
        let free = AfterFiber::free(0.5);
        assert!((free.turned(true, 1.0, 0.3).met(2.0, 0.6) - 1.5).abs() < 1e-6);
        let rows = std::array::from_fn(|knot| {
            [1.0, 0.9, 0.5, 0.4, 0.3, 0.2, 0.2, 0.1].map(|share: f32| share * AfterFiber::expected(knot))
        });
        let missing = Missing { inside: rows, rim: rows.map(|row: [f32; 8]| row.map(|missing| 0.5 * missing)) };
        let missing = MissingFibers::alike(missing);
        let after = AfterFiber { first: missing, later: missing, back: MissingFibers::default(), back_later: missing };
        for (turn, short) in [(1.0, 0.0), (0.9, 0.5), (0.3, 1.0), (0.0, 0.2)] {
            let turned = after.turned(false, turn, short);
            let mut before = 0.0;
            for i in 1..=200 {
                let expected = 0.02 * i as f32;
                let met = turned.met(expected, 0.0);
                assert!(met >= before - 1e-6 && met <= expected, "{turn} {short}: {met} of {expected}");
                before = met;
            }
        }
        assert!(after.turned(false, 1.0, 0.0).met(1.0, 0.0).abs() < 1e-6, "straight on none is met");
        assert!(
            (after.turned(false, 0.364_971_7, 1.0).met(1.0, 0.0) - 0.85).abs() < 1e-6,
            "halfway between two turns, and across"
        );
        assert!(
            (after.turned(false, 1.0, 0.0).met(1.0, 0.5) - 0.25).abs() < 1e-6,
            "half by the rim, where half are missing"
        );
        assert_eq!(after.turned(false, -0.5, 1.0).met(1.0, 1.0), 1.0, "back");
    }
}
