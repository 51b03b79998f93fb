//! What light has met and left clear on its way to a node, as a way back finds it: the "hot spot" (docs/model.md, section 6).
//!
//! No fibre reaches into a straight piece of that way, so that a way beside it meets fewer. The fibres that passed the light on from piece to
//! piece stand where they stand, so that a way back along it meets them.

use arrayvec::ArrayVec;
use glam::Vec3A;

use super::{Spot, View};
use crate::geometry::{
    cleared_strip::{ClearedStrip, misses},
    density::ChordFibers,
};

/// So many of the last fibres on the way are known.
const KNOWN: usize = 4;

/// A place where light met a fibre.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    /// In the section's frame.
    pub(super) at: Vec3A,
    /// Where the light came from, across the fibre.
    pub(super) back: Vec3A,
}

/// The way of light to a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct WayIn {
    /// Where the light came from, across the node's fibre.
    pub(super) back: Vec3A,
    /// Fibres that have passed it on before the node.
    pub(super) before: f32,
    /// The last of these in the node's ply, from the last one on.
    known: [Place; KNOWN],
    count: usize,
}

/// A straight piece of the way in, or a fibre on it, as a way out finds it; lengths across the fibre.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// How far beside the piece the way out begins.
    aside: f32,
    /// Sine of the angle between both.
    sine: f32,
    /// The lengths of the way out between which it is beside the piece.
    from: f32,
    to: f32,
}

/// A fibre that has passed the light on, ahead of a way out.
#[derive(Clone, Copy, Debug)]
struct Passed {
    /// How far the place is where the light met it.
    far: f32,
    /// Sine of the angle under which that is beside the way.
    sine: f32,
    /// Cosine of the angle between the way and that on which the light came there.
    turn: f32,
}

/// A way out on the side where the light came from.
#[derive(Clone, Debug)]
pub(super) struct WayBack {
    pieces: ArrayVec<Piece, { KNOWN + 1 }>,
    fibers: ArrayVec<Passed, KNOWN>,
    /// As wide as a fibre.
    width: f32,
    /// How much of the section the way passes for each unit across the fibre.
    beside: f32,
}

impl WayIn {
    /// That to a node where the light came from `back`, when so many fibres had passed it on `before`. `fibers` are the last of these that are of the
    /// node's ply; the last one comes first.
    #[inline]
    pub(super) fn new(back: Vec3A, before: usize, fibers: impl Iterator<Item = Place>) -> Self {
        let mut way = Self { back, before: before as f32, known: [Place::default(); KNOWN], count: 0 };
        for (known, fiber) in way.known.iter_mut().zip(fibers) {
            *known = fiber;
            way.count += 1;
        }
        way
    }

    /// Whether the light came to the node from another fibre of its ply.
    #[inline]
    pub(super) fn later(&self) -> bool {
        self.count > 0
    }

    /// The same as a way towards `w` finds it, which begins `shift` beside the node and passes `beside` of the section for each unit across the fibre.
    #[inline]
    pub(super) fn seen(&self, view: &View<'_>, spot: &Spot, (shift, w): (Vec3A, Vec3A), beside: f32) -> WayBack {
        let ply = &view.yarn.occluder().shape().plies[spot.ply];
        let width = 2.0 * view.section.thinness() * ply.fiber_radius;
        let mut seen = WayBack { pieces: ArrayVec::new(), fibers: ArrayVec::new(), width, beside };
        let out = spot.across(w).normalize_or_zero();
        // From where the way out begins.
        let seen_from = |fiber: &Place| Place { at: spot.across(fiber.at - spot.inside.point) - shift, ..*fiber };
        let node = Place { at: -shift, back: self.back };
        let places: ArrayVec<Place, { KNOWN + 1 }> =
            std::iter::once(node).chain(self.known[..self.count].iter().map(seen_from)).collect();
        for (index, &Place { at, back }) in places.iter().enumerate() {
            let cos = back.dot(out);
            if index > 0 && at.dot(out) > 0.0 {
                let far = at.length();
                seen.fibers.push(Passed { far, sine: at.dot(spot.tangent.cross(out)) / far, turn: cos });
            }
            if cos > 0.0 {
                let beside = spot.tangent.cross(back);
                seen.pieces.push(Piece {
                    aside: -at.dot(beside),
                    sine: out.dot(beside),
                    from: (at.dot(back) / cos).max(0.0),
                    to: places.get(index + 1).map_or(f32::INFINITY, |next| next.at.dot(back) / cos),
                });
            }
        }
        seen
    }
}

impl WayBack {
    /// The same of light that TT bends into the way from directions about it, where it keeps a mean cosine: the mean of the squares.
    pub(super) fn bent(&self, cosine: f32) -> Self {
        // Twice the angle keeps the fourth power. It is bent somewhere on the way, and parallel to it from there.
        let bent = |sine: f32| (0.5 + (sine * sine - 0.5) * cosine.powi(3)).sqrt().copysign(sine);
        let mut all = self.clone();
        all.pieces.iter_mut().for_each(|piece| piece.sine = bent(piece.sine));
        all.fibers.iter_mut().for_each(|fiber| fiber.sine = bent(fiber.sine));
        all
    }

    /// The fibres of a chord on the way that would lie where the light has come by; `foot` is the distance to the chord's middle.
    #[inline]
    pub(super) fn cleared(&self, chord: &ChordFibers, foot: f32) -> f32 {
        let Self { width, beside, .. } = *self;
        let strip = |piece: &Piece| {
            let Piece { aside, sine, from, to } = *piece;
            ClearedStrip::new(width * beside, [aside * beside, sine], [from * beside, to * beside]).fibers(chord, foot)
        };
        self.pieces.iter().map(strip).sum()
    }

    /// The share of light that meets none of the fibres that it has met before.
    #[inline]
    pub(super) fn passes(&self) -> f32 {
        let radius = 0.5 * self.width;
        let open = |fiber: &Passed| misses(fiber.far * fiber.sine / radius, fiber.turn);
        self.fibers.iter().map(open).product()
    }
}
