//! Places of a repeat that are alike share their variables.

use std::{collections::HashMap, hash::Hash};

use super::energy::{Energy, PER_NODE};
use crate::pattern::draft::Draft;

/// Least number of yarns to each side of a crossing that must be alike.
pub(super) const LEAST_REACH: usize = 2;

impl Energy<'_> {
    /// The number of the free variable that each variable follows. Crossings are alike if yarns cross alike as far around them as
    /// the longest float reaches, and what lies between alike crossings is alike too: all warps of a twill or satin, and in a
    /// herringbone those between its turns. Without it they would give way by turns, which friction keeps them from.
    pub(super) fn alike(&self) -> Vec<usize> {
        if self.draft.twines() {
            return (0..self.variables()).collect();
        }
        let around = surroundings(self.draft, &self.thickness, longest_float(self.draft).max(LEAST_REACH));
        let mut numbers = HashMap::new();
        let mut alike = Vec::with_capacity(self.variables());
        for side in 0..2 {
            let nodes = (0..self.count[side]).flat_map(|yarn| (0..self.length(side)).map(move |k| (yarn, k)));
            for (yarn, k) in nodes {
                let [here, next] = self.between(side, yarn, k).map(|c| around[c / self.count[0]][c % self.count[0]]);
                let node = number(&mut numbers, (side, k % self.nodes, here, next));
                alike.extend((0..PER_NODE).map(|c| PER_NODE * node + c));
            }
        }
        // Both spacings.
        let nodes = PER_NODE * numbers.len();
        alike.extend([nodes, nodes + 1]);
        alike
    }

    /// The crossings that a node of a yarn is at or between, by their numbers, those of the lowest weft first.
    pub(super) fn between(&self, side: usize, yarn: usize, node: usize) -> [usize; 2] {
        let here = node / self.nodes;
        let next = if node.is_multiple_of(self.nodes) { here } else { (here + 1) % self.count[1 - side] };
        [here, next].map(|c| if side == 0 { c * self.count[0] + yarn } else { yarn * self.count[0] + c })
    }
}

/// For each weft, for each warp: a number of what lies as far as `reach` around their crossing.
pub(super) fn surroundings(draft: &Draft, thickness: &[Vec<f64>; 2], reach: usize) -> Vec<Vec<usize>> {
    let crossing = |i: usize, j: usize| (draft.warp_over(i, j), thickness[1][i].to_bits(), thickness[0][j].to_bits());
    let mut numbers = HashMap::new();
    let mut row = |i: usize| (0..draft.warps()).map(|j| number(&mut numbers, crossing(i, j))).collect();
    let crossings: Vec<Vec<usize>> = (0..draft.wefts()).map(&mut row).collect();
    // Along the wefts, then across them.
    let along = transposed(&around(&transposed(&crossings), reach));
    around(&along, reach)
}

/// Crossings of the longest float.
pub(super) fn longest_float(draft: &Draft) -> usize {
    let count = [draft.warps(), draft.wefts()];
    let float = |(side, yarn): (usize, usize)| {
        let length = count[1 - side];
        let over = |k: usize| {
            let k = k % length;
            if side == 0 { draft.warp_over(k, yarn) } else { draft.warp_over(yarn, k) }
        };
        let (mut longest, mut float) = (0, 1);
        for k in 1..2 * length {
            float = if over(k) == over(k - 1) { float + 1 } else { 1 };
            longest = longest.max(float);
        }
        longest.min(length)
    };
    let yarns = (0..2).flat_map(|side| (0..count[side]).map(move |yarn| (side, yarn)));
    yarns.map(float).max().unwrap_or(0)
}

/// The number of a key, in the order in which keys are met.
fn number<K: Eq + Hash>(numbers: &mut HashMap<K, usize>, key: K) -> usize {
    let next = numbers.len();
    *numbers.entry(key).or_insert(next)
}

/// For each of rows that repeat, numbers of what stands in each column from `reach` rows before it to as many behind. A run is told
/// by two shorter ones, each half as long or more, so that long runs cost no more room than short ones.
fn around(rows: &[Vec<usize>], reach: usize) -> Vec<Vec<usize>> {
    let (count, whole) = (rows.len(), 2 * reach + 1);
    let joined = |runs: &[Vec<usize>], by: usize| -> Vec<Vec<usize>> {
        let mut numbers = HashMap::new();
        let mut join = |r: usize| {
            let pairs = runs[r].iter().zip(&runs[(r + by) % count]);
            pairs.map(|(a, b)| number(&mut numbers, (*a, *b))).collect()
        };
        (0..count).map(&mut join).collect()
    };
    let (mut runs, mut length) = (rows.to_vec(), 1);
    while length < whole {
        let by = length.min(whole - length);
        runs = joined(&runs, by);
        length += by;
    }
    // They began so many rows before.
    runs.rotate_right(reach % count);
    runs
}

fn transposed(rows: &[Vec<usize>]) -> Vec<Vec<usize>> {
    (0..rows[0].len()).map(|j| rows.iter().map(|row| row[j]).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_alike_where_all_that_stands_in_them_is() {
        let rows: Vec<Vec<usize>> = [0, 1, 0, 2, 1, 0, 1, 0, 2, 1, 0].map(|v| vec![v, v % 2]).to_vec();
        for reach in [1, 2, 3, 5, 8] {
            let window = |middle: usize, column: usize| -> Vec<usize> {
                (0..=2 * reach).map(|k| rows[(middle + k + rows.len() * reach - reach) % rows.len()][column]).collect()
            };
            let found = around(&rows, reach);
            let places: Vec<(usize, usize)> = (0..rows.len()).flat_map(|r| [(r, 0), (r, 1)]).collect();
            for &(a, b) in &places {
                for &(c, d) in &places {
                    assert_eq!(found[a][b] == found[c][d], window(a, b) == window(c, d), "{reach}: {a} {b} {c} {d}");
                }
            }
        }
    }
}
