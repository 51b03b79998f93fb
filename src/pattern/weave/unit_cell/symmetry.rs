//! Yarns of a repeat that are alike share their variables.

use super::energy::{Energy, PER_NODE};

/// Crossings of the largest repeat whose symmetry is looked for.
const MOST_SHIFTS: usize = 1024;

impl Energy<'_> {
    /// The number of the free variable that each variable follows: where a shift by some warps and wefts maps the draft
    /// onto itself, what it maps onto each other is one. All warps of a twill or satin are alike.
    pub(super) fn alike(&self) -> Vec<usize> {
        let [warps, wefts] = self.count;
        let n = self.variables();
        let mut leader: Vec<usize> = (0..n).collect();
        if warps * wefts <= MOST_SHIFTS && !self.draft.twines() {
            let shifts = (0..warps).flat_map(|a| (0..wefts).map(move |b| (a, b))).skip(1);
            let maps = |&(a, b): &(usize, usize)| {
                let same = |side: usize, by: usize| {
                    let list = &self.thickness[side];
                    (0..list.len()).all(|i| list[i] == list[(i + by) % list.len()])
                };
                let over = |i: usize, j: usize| self.draft.warp_over(i, j) == self.draft.warp_over(i + b, j + a);
                same(0, a) && same(1, b) && (0..wefts).all(|i| (0..warps).all(|j| over(i, j)))
            };
            // All shifts together are a group: the least variable of an orbit leads it.
            for (a, b) in shifts.filter(maps) {
                for (side, own, along) in [(0, a, b), (1, b, a)] {
                    let length = self.length(side);
                    for (yarn, k) in (0..self.count[side]).flat_map(|y| (0..length).map(move |k| (y, k))) {
                        let there = (k + along * self.nodes) % length;
                        let (from, to) =
                            (self.at(side, yarn, k), self.at(side, (yarn + own) % self.count[side], there));
                        for c in 0..PER_NODE {
                            leader[to + c] = leader[to + c].min(from + c);
                        }
                    }
                }
            }
        }
        let mut number = vec![usize::MAX; n];
        let mut next = 0;
        (0..n)
            .map(|i| {
                let leads = leader[i];
                if number[leads] == usize::MAX {
                    number[leads] = next;
                    next += 1;
                }
                number[leads]
            })
            .collect()
    }
}
