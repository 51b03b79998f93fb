//! What stretches of yarn resist by themselves, inverted: of all that moves a node, bending is so much the stiffest that steepest
//! descent takes hundreds of steps to move anything else. Solving for it first (a preconditioner) leaves the rest to be found.

use super::{
    energy::{Energy, PER_NODE},
    rods::{SECTION_GRADIENT, STIFF_LENGTH, TENSION},
};

/// What holds a node to others, about: contact, energy by squared distance. From 1 to 5 all came down alike.
const HELD: f64 = 1.5;
/// The same of sections, by the squared logarithm of their width.
const SECTION_HELD: f64 = 5.0;
/// Length of yarn between nodes over length of cloth, about.
const STRETCH: f64 = 1.4;

/// Nodes of a yarn after each other that are free.
#[derive(Clone, Copy)]
pub(super) struct Stretch {
    pub(super) side: usize,
    pub(super) yarn: usize,
    /// Its first free variable.
    pub(super) first: usize,
    pub(super) nodes: usize,
}

/// The matrices of all stretches, decomposed: for places and for sections.
pub(super) struct Preconditioner(Vec<(Stretch, [Banded; 2])>);

impl Preconditioner {
    pub(super) fn new(energy: &Energy<'_>, stretches: &[Stretch], spacing: [f64; 2]) -> Self {
        let of = |stretch: &Stretch| {
            let Stretch { side, yarn, nodes, .. } = *stretch;
            let along = STRETCH * spacing[1 - side] / energy.nodes as f64;
            let force = TENSION * energy.stiffness[side] * energy.thickness[side][yarn].powi(2);
            let (tension, bending) = (force / along, force * STIFF_LENGTH * STIFF_LENGTH / along.powi(3));
            let place = [6.0 * bending + 2.0 * tension + HELD, -4.0 * bending - tension, bending];
            let change = SECTION_GRADIENT * energy.nodes as f64;
            let section = [2.0 * change + energy.section / energy.nodes as f64 + SECTION_HELD, -change, 0.0];
            (*stretch, [Banded::new(nodes, place), Banded::new(nodes, section)])
        };
        Self(stretches.iter().map(of).collect())
    }

    /// Solves for all free variables.
    pub(super) fn solve(&self, v: &mut [f64]) {
        for (stretch, [place, section]) in &self.0 {
            let v = &mut v[stretch.first..stretch.first + PER_NODE * stretch.nodes];
            place.solve(v);
            place.solve(&mut v[1..]);
            section.solve(&mut v[2..]);
        }
    }
}

/// A symmetric matrix of five diagonals as L D L'.
struct Banded {
    /// 1 / D.
    scale: Vec<f64>,
    /// Of each row of L, the value before the diagonal and the one before that.
    before: Vec<[f64; 2]>,
}

impl Banded {
    /// With the same diagonal all along and the same two beside it; what lies beyond both ends is held.
    fn new(count: usize, [diagonal, first, second]: [f64; 3]) -> Self {
        let (mut d, mut before) = (vec![0.0; count], vec![[0.0; 2]; count]);
        for i in 0..count {
            let far = if i > 1 { second / d[i - 2] } else { 0.0 };
            let shared = if i > 1 { far * d[i - 2] * before[i - 1][0] } else { 0.0 };
            let near = if i > 0 { (first - shared) / d[i - 1] } else { 0.0 };
            let by_near = if i > 0 { near * near * d[i - 1] } else { 0.0 };
            let by_far = if i > 1 { far * far * d[i - 2] } else { 0.0 };
            d[i] = diagonal - by_near - by_far;
            before[i] = [near, far];
        }
        Self { scale: d.iter().map(|d| 1.0 / d).collect(), before }
    }

    /// Solves for one variable of each node.
    fn solve(&self, v: &mut [f64]) {
        let at = |i: usize| PER_NODE * i;
        let count = self.scale.len();
        for i in 1..count {
            let [near, far] = self.before[i];
            v[at(i)] -= near * v[at(i - 1)] + if i > 1 { far * v[at(i - 2)] } else { 0.0 };
        }
        for i in (0..count).rev() {
            let mut value = v[at(i)] * self.scale[i];
            if i + 1 < count {
                value -= self.before[i + 1][0] * v[at(i + 1)];
            }
            if i + 2 < count {
                value -= self.before[i + 2][1] * v[at(i + 2)];
            }
            v[at(i)] = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_diagonals_are_solved() {
        for count in 1..9 {
            let diagonals = [7.0, -3.0, 0.5];
            let wanted: Vec<f64> = (0..count).map(|i| (i as f64 * 1.3).sin()).collect();
            let times = |i: usize| -> f64 {
                let beside = |k: usize| diagonals.get(i.abs_diff(k)).map_or(0.0, |d| d * wanted[k]);
                (0..count).map(beside).sum()
            };
            let mut v: Vec<f64> = (0..count).flat_map(|i| [times(i), 5.0, 6.0]).collect();
            Banded::new(count, diagonals).solve(&mut v);
            for (i, wanted) in wanted.iter().enumerate() {
                assert!((v[PER_NODE * i] - wanted).abs() < 1e-12, "{count}: {i}");
                assert_eq!(v[PER_NODE * i + 1], 5.0);
            }
        }
    }
}
