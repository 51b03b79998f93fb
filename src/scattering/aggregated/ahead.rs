//! What a straight way meets of the plies of a yarn.

use arrayvec::ArrayVec;
use glam::Vec3A;

use super::{Spot, View};
use crate::{
    geometry::{density::ChordFibers, section::PlyAhead, yarn::MAX_PLIES},
    math::{Rgb, sampler::Stream},
};

/// A ply on a straight way.
pub(super) trait Stretch {
    /// The share of light that meets none of its fibres.
    fn through(&self) -> f32;
    /// The distance from which on it may meet one.
    fn begins(&self) -> f32;
    /// The distance at which it meets the first one, where so much is left of the light: at least [`Self::through`].
    fn meets(&self, left: f32) -> f32;
}

/// The ply on a way in which light meets its first fibre, and the distance where it does: what has met none is `left` by then. The last
/// ply stops what all let pass. `None` if there is none.
///
/// Plies may lie in each other. Each has its first fibre for itself, and the nearest is the one that is met: of the first ply that
/// stops the light at all, or of those behind it, which may begin before.
#[inline]
pub(super) fn nearest<S: Stretch>(
    plies: impl Iterator<Item = S>,
    mut left: f32,
    stream: &mut Stream,
) -> Option<(S, f32)> {
    let mut plies = plies.peekable();
    let (mut met, mut distance) = loop {
        let ply = plies.next()?;
        let through = ply.through();
        if left >= through || plies.peek().is_none() {
            let distance = ply.meets(left);
            break (ply, distance);
        }
        left = (left / through.max(1e-30)).min(1.0);
    };
    for ply in plies {
        if ply.begins() < distance {
            let left = stream.next();
            if left >= ply.through() {
                let before = ply.meets(left);
                if before < distance {
                    (met, distance) = (ply, before);
                }
            }
        }
    }
    Some((met, distance))
}

/// The most stretches of plies that are told apart on a way out: one of each ply.
pub(super) const STRETCHES: usize = MAX_PLIES;

/// The plies on a way out, in no order.
pub(super) type PliesAhead = ArrayVec<FibersAhead, STRETCHES>;

/// The fibres of a ply on a way out.
#[derive(Clone, Copy, Debug)]
pub(super) struct FibersAhead {
    pub(super) ply: usize,
    /// Signed distance of the way from the ply's axis, in the circle of the ply's radius.
    pub(super) offset: f32,
    /// Distance in the section to the point nearest to the ply's axis.
    pub(super) foot: f32,
    /// How many more are met there than by a way across the yarn.
    pub(super) tilt: f32,
    pub(super) chord: ChordFibers,
    /// How many are expected.
    pub(super) expected: f32,
}

/// The fibres of the plies on a way out from `shift` beside a place, in the direction `w` of the section's frame: of the place's own ply from
/// the distance `own` on, if they are asked for, and of others from `free` on.
///
/// A vertex asks a dozen times, from as many places of its code: one copy of this serves all of them, and is as fast as one in each. It
/// fills a list that is there, for one that is moved is copied with all the room that it has.
#[inline(never)]
pub(super) fn plies_ahead(
    view: &View<'_>,
    spot: &Spot,
    (shift, w): (Vec3A, Vec3A),
    own: Option<f32>,
    free: f32,
    plies: &mut PliesAhead,
) {
    let from = &spot.inside;
    let (thin, wide) = (view.section.thinness(), from.wide(w));
    let shape = view.yarn.occluder().shape();
    plies.clear();
    view.section.plies_ahead(shape, from, shift, w, |ahead| {
        let Some(free) = (if ahead.ply == spot.ply { own } else { Some(free) }) else { return };
        let PlyAhead { ply, foot, offset, length, stretched, .. } = ahead;
        let chord = shape.plies[ply].chord(offset, length, thin, wide / stretched);
        let tilt = ahead.tilt(shape, view.section, from, w, &chord);
        let fibers = FibersAhead { ply, offset, foot, tilt, chord, expected: tilt * chord.ahead(free - foot) };
        let _ = plies.try_push(fibers);
    });
}

impl FibersAhead {
    /// Where plies lie in each other: the share of the fibres that light meets which passes nearly all, of those that it meets in this ply
    /// alone. Others begin within a fibre of another ply on the way, which it has met already.
    #[inline]
    pub(super) fn uncovered(&self, view: &View<'_>, all: &[Self]) -> f32 {
        if !view.yarn.plies_overlap {
            return 1.0;
        }
        let stretch = |of: &Self| ((of.foot - of.chord.half).max(0.0), (of.foot + of.chord.half).max(0.0));
        let (from, to) = stretch(self);
        let open = all.iter().filter(|other| other.ply != self.ply).map(|other| {
            let (begins, ends) = stretch(other);
            let both = (to.min(ends) - from.max(begins)).max(0.0);
            1.0 - view.yarn.plies[other.ply].density * both / (to - from).max(1e-6)
        });
        open.product()
    }

    /// The optical depth of a ply other than that in which the way begins, among `all` on the way.
    #[inline]
    pub(super) fn depth(&self, view: &View<'_>, all: &[Self]) -> Rgb {
        view.yarn.plies[self.ply].depth(self.expected, self.expected * self.uncovered(view, all))
    }

    /// Distance in the section at which so many of them are passed.
    #[inline]
    pub(super) fn distance_past(&self, passed: f32) -> f32 {
        let behind = (self.expected - passed).max(0.0) / self.tilt;
        let at = self.chord.place((behind / self.chord.total().max(1e-20)).min(1.0));
        (self.foot + at).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ply in which light meets fibres at random, one per length from where it begins, in an evenly dense `length`.
    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Even {
        begins: f32,
        length: f32,
    }

    impl Stretch for Even {
        fn through(&self) -> f32 {
            (-self.length).exp()
        }

        fn begins(&self) -> f32 {
            self.begins
        }

        fn meets(&self, left: f32) -> f32 {
            self.begins - left.ln()
        }
    }

    /// Where plies lie in each other light meets the nearest fibre: the places are those of fibres of all of them, thrown at random.
    #[test]
    fn of_plies_that_lie_in_each_other_the_nearest_fiber_is_met() {
        let plies = [(0.0, 2.0), (0.5, 1.0), (1.0, 2.5), (4.0, 1.0)].map(|(begins, length)| Even { begins, length });
        let all: f32 = plies.iter().map(|ply| ply.through()).product();
        let mut stream = Stream::new(3);
        const RAYS: usize = 200_000;
        let (mut found, mut want) = ([[0.0f32; 10]; 4], [[0.0f32; 10]; 4]);
        for _ in 0..RAYS {
            let left = 1.0 - stream.next() * (1.0 - all);
            let (ply, distance) = nearest(plies.iter().copied(), left, &mut stream).expect("there are plies");
            let index = plies.iter().position(|of| *of == ply).expect("one of them");
            found[index][((2.0 * distance) as usize).min(9)] += 1.0 / RAYS as f32;
        }
        // The chance to get to a place past all plies, and then to meet a fibre of one.
        const STEP: f32 = 1e-3;
        let inside = |ply: &Even, at: f32| (at >= ply.begins && at < ply.begins + ply.length) as u8 as f32;
        let mut left = 1.0;
        for step in 0..5000 {
            let at = (step as f32 + 0.5) * STEP;
            for (want, ply) in want.iter_mut().zip(&plies) {
                want[((2.0 * at) as usize).min(9)] += left * inside(ply, at) * STEP / (1.0 - all);
            }
            left *= (-STEP * plies.iter().map(|ply| inside(ply, at)).sum::<f32>()).exp();
        }
        for (found, want) in found.as_flattened().iter().zip(want.as_flattened()) {
            assert!((found - want).abs() < 0.004, "{found} {want}");
        }
    }
}
