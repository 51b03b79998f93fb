//! Where a large repeat is a small one over and over: the weaves of a figure and of its ground.

use std::collections::{HashMap, VecDeque};

use super::{
    energy::Energy,
    parts::Part,
    symmetry::{LEAST_REACH, longest_float, surroundings},
};

/// Most ends and picks of such a weave.
const WIDEST: usize = 64;
/// Most crossings of one.
const MOST: usize = 1024;

/// How far around a crossing all must be of a weave for it to be there as in that weave. Measured in damask of 128 and 400 threads:
/// five crossings and more from a border, nodes go 0.02 radii aside and 0.006 up or down from where they are in the weave itself.
/// Weaves of long floats need as much as half of these.
const REACH: [usize; 3] = [4, 8, 16];
/// The same for it to begin so, where no weave reaches farther.
const BEGINNING: usize = 2;

/// A place of a part's repeat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// Which part.
    pub(super) part: usize,
    /// Its warp and weft there.
    pub(super) at: [usize; 2],
}

/// The regular parts of a repeat.
pub(super) struct Regular {
    pub(super) parts: Vec<Part>,
    /// For each crossing, those of the lowest weft first, a number of what surrounds it.
    pub(super) kinds: Vec<usize>,
    /// Where in a part it is if what surrounds it is too.
    within: Vec<Option<Place>>,
    /// Whether it is as in that part.
    pub(super) stays: Vec<bool>,
}

impl Regular {
    pub(super) fn find(energy: &Energy<'_>) -> Self {
        for reach in REACH {
            let found = Self::within(energy, reach);
            let floats = found.parts.iter().map(|part| longest_float(&part.draft));
            if floats.max().is_some_and(|longest| longest <= 2 * reach) {
                return found;
            }
        }
        let found = Self::within(energy, BEGINNING);
        Self { stays: vec![false; found.stays.len()], ..found }
    }

    /// Those around whose crossings all is regular as far as `reach`.
    fn within(energy: &Energy<'_>, reach: usize) -> Self {
        let around = surroundings(energy.draft, &energy.thickness, reach);
        let [warps, wefts] = energy.count;
        let mut parts: Vec<Part> = Vec::new();
        let mut places: HashMap<usize, Place> = HashMap::new();
        for (weft, warp) in (0..wefts).flat_map(|i| (0..warps).map(move |j| (i, j))) {
            let kind = around[weft][warp];
            if places.contains_key(&kind) {
                continue;
            }
            let ends = (1..=WIDEST.min(warps)).find(|p| around[weft][(warp + p) % warps] == kind);
            let picks = (1..=WIDEST.min(wefts)).find(|q| around[(weft + q) % wefts][warp] == kind);
            let (Some(ends), Some(picks)) = (ends, picks) else { continue };
            let (first, count) = ([warp, weft], [ends, picks]);
            if ends * picks > MOST || !goes_on(energy, first, count, reach) {
                continue;
            }
            let part = Part { share: 0.0, ..Part::of(energy, first, count) };
            // Floats of a brocade may be wider than what is looked at.
            if part.draft.loose().iter().any(|loose| !loose.is_empty()) {
                continue;
            }
            let kind_at = |at: [usize; 2]| around[(weft + at[1]) % wefts][(warp + at[0]) % warps];
            if !tells_apart(&part, kind_at) {
                continue;
            }
            for at in (0..picks).flat_map(|y| (0..ends).map(move |x| [x, y])) {
                places.entry(kind_at(at)).or_insert(Place { part: parts.len(), at });
            }
            parts.push(part);
        }
        let kinds: Vec<usize> = around.into_iter().flatten().collect();
        let within: Vec<Option<Place>> = kinds.iter().map(|kind| places.get(kind).copied()).collect();
        let each = 1.0 / within.len() as f64;
        within.iter().flatten().for_each(|place| parts[place.part].share += each);
        let stays = within.iter().map(Option::is_some).collect();
        Self { parts, kinds, within, stays }
    }

    /// For each crossing the part that it is most likely of: that which it goes on with from the nearest crossing within one.
    pub(super) fn nearest(&self, energy: &Energy<'_>) -> Vec<Option<Place>> {
        let [warps, wefts] = energy.count;
        let mut nearest = self.within.clone();
        let mut queue: VecDeque<usize> = (0..nearest.len()).filter(|&c| nearest[c].is_some()).collect();
        while let Some(crossing) = queue.pop_front() {
            let Some(place) = nearest[crossing] else { continue };
            let (weft, warp) = (crossing / warps, crossing % warps);
            let draft = &self.parts[place.part].draft;
            let count = [draft.warps(), draft.wefts()];
            // To the right, upwards, to the left, downwards: by one yarn, or by all but one of a repeat.
            for (side, on) in [(0, true), (1, true), (0, false), (1, false)] {
                let step = |at: [usize; 2], count: [usize; 2]| {
                    let mut at = at;
                    at[side] = (at[side] + if on { 1 } else { count[side] - 1 }) % count[side];
                    at
                };
                let (at, there) = (step(place.at, count), step([warp, weft], [warps, wefts]));
                let next = there[1] * warps + there[0];
                if nearest[next].is_none()
                    && draft.warp_over(at[1], at[0]) == energy.draft.warp_over(there[1], there[0])
                {
                    nearest[next] = Some(Place { part: place.part, at });
                    queue.push_back(next);
                }
            }
        }
        nearest
    }
}

/// Whether crossings of a part are of one kind only where they are alike in it. A part as wide or as high as the whole may hold a
/// border, with all that goes over into each other on both sides of it.
fn tells_apart(part: &Part, kind_at: impl Fn([usize; 2]) -> usize) -> bool {
    let own = surroundings(&part.draft, &part.thickness, longest_float(&part.draft).max(LEAST_REACH));
    let mut of = HashMap::new();
    let mut places =
        own.iter().enumerate().flat_map(|(y, row)| row.iter().enumerate().map(move |(x, own)| ([x, y], *own)));
    places.all(|(at, own)| *of.entry(kind_at(at)).or_insert(own) == own)
}

/// Whether so many warps and wefts from `first` on go on around themselves, as far as `reach`, as if they repeated.
fn goes_on(energy: &Energy<'_>, first: [usize; 2], count: [usize; 2], reach: usize) -> bool {
    // Where each is in the whole, and where in the repeat.
    let along = |side: usize| {
        let whole = energy.count[side];
        let own = move |k: usize| (k + reach * count[side] - reach) % count[side];
        (0..count[side] + 2 * reach)
            .map(move |k| ((first[side] + k + reach * whole - reach) % whole, (first[side] + own(k)) % whole))
    };
    let same_yarns = |side: usize| along(side).all(|(k, own)| energy.thickness[side][k] == energy.thickness[side][own]);
    let same = |(weft, own_weft): (usize, usize)| {
        along(0).all(|(warp, own)| energy.draft.warp_over(weft, warp) == energy.draft.warp_over(own_weft, own))
    };
    same_yarns(0) && same_yarns(1) && along(1).all(same)
}
