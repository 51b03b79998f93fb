//! Places of a repeat that are alike share their variables.

use std::{collections::HashMap, hash::Hash};

use super::energy::{Energy, PER_NODE};

/// Least number of yarns to each side of a crossing that must be alike.
const LEAST_REACH: usize = 2;

impl Energy<'_> {
    /// The number of the free variable that each variable follows. Crossings are alike if yarns cross alike as far around them as
    /// the longest float reaches, and what lies between alike crossings is alike too: all warps of a twill or satin, and in a
    /// herringbone those between its turns. Without it they would give way by turns, which friction keeps them from.
    pub(super) fn alike(&self) -> Vec<usize> {
        let mut leader: Vec<usize> = (0..self.variables()).collect();
        if !self.draft.twines() {
            let around = self.surroundings();
            let mut leaders = HashMap::new();
            for side in 0..2 {
                let places = (0..self.count[side]).flat_map(|y| (0..self.length(side)).map(move |k| (y, k)));
                for (yarn, k) in places {
                    let (crossing, between) = (k / self.nodes, k % self.nodes);
                    let next = if between == 0 { crossing } else { (crossing + 1) % self.count[1 - side] };
                    let of = |c: usize| if side == 0 { around[c][yarn] } else { around[yarn][c] };
                    let at = self.at(side, yarn, k);
                    let first = *leaders.entry((side, between, of(crossing), of(next))).or_insert(at);
                    (0..PER_NODE).for_each(|c| leader[at + c] = first + c);
                }
            }
        }
        // Where nothing is alike each leads itself.
        let mut number = vec![None; leader.len()];
        let mut next = 0..;
        leader.iter().map(|&leads| *number[leads].get_or_insert_with(|| next.next().unwrap_or(0))).collect()
    }

    /// For each weft, for each warp: a number of what lies around their crossing.
    fn surroundings(&self) -> Vec<Vec<usize>> {
        let [warps, wefts] = self.count;
        let reach = self.longest_float().max(LEAST_REACH);
        let thick = |side: usize, yarn: usize| self.thickness[side][yarn].to_bits();
        let crossing = |i: usize, j: usize| (self.draft.warp_over(i, j), thick(1, i), thick(0, j));
        // First along the wefts, then across them.
        let rows = numbers_of(wefts, warps, |i, j| near(j, reach, warps).map(|j| crossing(i, j)).collect::<Vec<_>>());
        numbers_of(wefts, warps, |i, j| near(i, reach, wefts).map(|i| rows[i][j]).collect::<Vec<_>>())
    }

    /// Crossings of the longest float.
    fn longest_float(&self) -> usize {
        let float = |side: usize, yarn: usize| {
            let length = self.count[1 - side];
            let over = |k: usize| {
                let k = k % length;
                if side == 0 { self.draft.warp_over(k, yarn) } else { self.draft.warp_over(yarn, k) }
            };
            let (mut longest, mut float) = (0, 1);
            for k in 1..2 * length {
                float = if over(k) == over(k - 1) { float + 1 } else { 1 };
                longest = longest.max(float);
            }
            longest.min(length)
        };
        (0..2)
            .flat_map(|side| (0..self.count[side]).map(move |yarn| (side, yarn)))
            .map(|(s, y)| float(s, y))
            .max()
            .unwrap_or(0)
    }
}

/// Those up to `reach` on both sides of one of so many that repeat.
fn near(middle: usize, reach: usize, count: usize) -> impl Iterator<Item = usize> {
    (0..=2 * reach).map(move |k| (middle + k + count * reach - reach) % count)
}

/// Numbers what has the same key.
fn numbers_of<K: Eq + Hash>(wefts: usize, warps: usize, key: impl Fn(usize, usize) -> K) -> Vec<Vec<usize>> {
    let mut numbers = HashMap::new();
    let mut number = |key: K| {
        let next = numbers.len();
        *numbers.entry(key).or_insert(next)
    };
    (0..wefts).map(|i| (0..warps).map(|j| number(key(i, j))).collect()).collect()
}
