//! Where stitches are across the cloth.

use glam::DVec2;

use super::{Maker, net::Net};
use crate::pattern::chart::Act;

/// Rounds of looking for it.
const ROUNDS: usize = 100;
/// By how much a round goes beyond what it finds.
const BEYOND: f64 = 1.5;

impl Maker<'_> {
    pub(super) fn even(&self, count: usize) -> Vec<f64> {
        let n = count as f64;
        let at = |j: usize| match (self.border.turns, self.border.round) {
            (true, _) => (j as f64 + 0.5) / n,
            (false, Some(_)) => j as f64 + 0.5,
            (false, None) => j as f64 + 0.5 - 0.5 * n,
        };
        (0..count).map(at).collect()
    }

    /// Where stitches are: evenly, and in shaped cloth so that wales run on where stitches come and go.
    pub(in super::super) fn positions(&mut self) {
        self.middles = self.rows.iter().map(|r| self.even(r.len())).collect();
        if self.border.stacked
            && let Some(mut net) = Net::new(self.rows)
        {
            net.relax();
            let places = net.places();
            self.middles = places.iter().map(|row| row.iter().map(|p| p.x).collect()).collect();
            let rise = |(r, row): (usize, &Vec<DVec2>)| row.iter().map(|p| p.y - r as f64).collect();
            self.rises = places.iter().enumerate().map(rise).collect();
            return;
        }
        // Other rows of one width stand over each other as their repeat does, whichever way its decreases lean.
        let is_shaped = self.border.slants || self.rows.windows(2).any(|w| w[0].len() != w[1].len());
        if !is_shaped {
            return;
        }
        let is_flat = self.border.round.is_none();
        if is_flat {
            self.lie_over_each_other();
            self.shaped = self.rows.iter().flatten().all(|s| s.act != Act::Unworked);
        }
        if !self.border.stacked && !self.shaped {
            self.share_shaping();
        }
    }

    /// Width of a stitch, in mean widths, where its row is not even.
    pub(super) fn width(&self, r: usize, j: usize) -> f64 {
        // Loops of other widths do not hold each other.
        const RANGE: [f64; 2] = [0.6, 1.4];
        let Some(round) = self.border.round.filter(|_| !self.rises.is_empty()) else { return 1.0 };
        let (row, n) = (&self.middles[r], self.middles[r].len());
        let left = if j > 0 { row[j - 1] } else { row[n - 1] - round };
        let right = if j + 1 < n { row[j + 1] } else { row[0] + round };
        (0.5 * (right - left)).clamp(RANGE[0], RANGE[1])
    }

    /// What is drawn through nothing leans as the stitches beside it, so that feet keep their distances.
    pub(super) fn lean_with_neighbours(&mut self) {
        if self.rises.is_empty() {
            return;
        }
        for course in &self.courses {
            let loops: Vec<u32> = course.visits.iter().filter_map(|(_, v)| v.made()).collect();
            let n = loops.len();
            let lean = |k: usize| {
                let own = &self.loops[loops[k % n] as usize];
                (!own.parents.is_empty()).then_some(own.foot - own.at)
            };
            let leans: Vec<f64> = (0..n)
                .map(|k| {
                    let sides = [(1..n).find_map(|by| lean(k + n - by)), (1..n).find_map(|by| lean(k + by))];
                    lean(k).unwrap_or_else(|| 0.5 * sides.iter().flatten().sum::<f64>())
                })
                .collect();
            for (i, lean) in loops.into_iter().zip(leans) {
                let own = &mut self.loops[i as usize];
                own.foot = own.at + lean;
            }
        }
    }

    /// Each row of a shaped flat piece lies over the one below.
    fn lie_over_each_other(&mut self) {
        let mut shift = 0.0;
        for r in 1..self.rows.len() {
            let (row, below) = (&self.rows[r], self.even(self.rows[r - 1].len()));
            let own = self.even(row.len());
            let worked: Vec<f64> = row
                .iter()
                .zip(&own)
                .filter(|(s, _)| s.parents > 0)
                .map(|(s, at)| self.parent_middle(&below, s, *at) - at)
                .collect();
            shift += worked.iter().sum::<f64>() / worked.len().max(1) as f64;
            self.middles[r].iter_mut().for_each(|at| *at += shift);
        }
    }

    /// A row of decreases would move every stitch of the next one against its wale. Springs along the courses, as long as
    /// stitches are wide, and along the wales, which want to be straight, are equally stiff: rows above and below share
    /// what moves. The first row stays, and the sides of a tube, where a round goes over into the next.
    fn share_shaping(&mut self) {
        // What takes each stitch: stitches of the row above.
        let mut children: Vec<Vec<Vec<usize>>> = self.rows.iter().map(|r| vec![Vec::new(); r.len()]).collect();
        for r in 1..self.rows.len() {
            for (j, s) in self.rows[r].iter().enumerate().filter(|(_, s)| s.is_in_line()) {
                for p in s.first_parent..s.first_parent + u32::from(s.parents) {
                    let n = children[r - 1].len();
                    children[r - 1][p as usize % n].push(j);
                }
            }
        }
        for _ in 0..ROUNDS {
            for (r, row) in children.iter().enumerate().skip(1) {
                for (j, above) in row.iter().enumerate() {
                    let by = self.drawn_by(r, j, above);
                    self.middles[r][j] += BEYOND * by;
                }
            }
        }
    }

    /// How far the springs of a stitch would move it.
    fn drawn_by(&self, r: usize, j: usize, children: &[usize]) -> f64 {
        let (own, row) = (&self.middles[r], &self.rows[r]);
        let (at, n) = (own[j], own.len());
        let width = if self.border.turns { 1.0 / n as f64 } else { 1.0 };
        let (mut pull, mut stiffness) = (0.0, 0.0);
        let mut add = |by: f64, weight: f64| {
            pull += weight * by;
            stiffness += weight;
        };
        // Beside the border of a tube is the middle of half a stitch.
        match (j.checked_sub(1), self.border.turns) {
            (Some(left), _) => add(own[left] + width - at, 1.0),
            (None, true) => add(0.5 * width - at, 2.0),
            (None, false) => {}
        }
        match (own.get(j + 1), self.border.turns) {
            (Some(right), _) => add(right - width - at, 1.0),
            (None, true) => add(1.0 - 0.5 * width - at, 2.0),
            (None, false) => {}
        }
        if row[j].is_in_line() {
            add(self.parent_middle(&self.middles[r - 1], &row[j], at) - at, 1.0);
        }
        for &c in children {
            let (child, middle) = (&self.rows[r + 1][c], self.middles[r + 1][c]);
            let many = f64::from(child.parents);
            let lean = self.border.short(middle - self.parent_middle(own, child, middle));
            add(lean * many, 1.0 / (many * many));
        }
        if stiffness > 0.0 { pull / stiffness } else { 0.0 }
    }
}
