//! What a yarn by itself resists: stretching, bending, steepness, flattening, and leaving its dent of the reed.

use super::{
    beside::{Beside, NEIGHBOURS},
    energy::Energy,
};

/// Axial tension of a yarn; the unit of all forces here.
pub(super) const TENSION: f64 = 1.0;
/// Length over which tension straightens what bending resists, sqrt(B / T).
pub(super) const STIFF_LENGTH: f64 = 2.0;
/// Resistance to changing its shape along the yarn.
pub(super) const SECTION_GRADIENT: f64 = 2.0;
/// What holds a yarn at its dent of the reed, energy per crossing and squared distance.
const REED: f64 = 0.2;
/// What keeps neighbours together straight, as the reed beats picks up: energy per crossing and squared distance by which their
/// mean goes aside.
const BEATEN: f64 = 10.0;
/// What keeps the cloth flat: the rollers of loom and finish.
const FLAT: f64 = 0.2;
/// Length of yarn over length of cloth between two nodes from which on yarns resist: about as steep as in Peirce's jammed
/// cloth (60 degrees). Steeper ones would slip through each other between their nodes.
const STEEPEST: f64 = 2.2;
/// How much they resist.
const STEEP: f64 = 200.0;

impl Energy<'_> {
    /// Bending, tension, sections and the reed.
    pub(super) fn rods(
        &self,
        side: usize,
        x: &[f64],
        spacing: [f64; 2],
        g: &mut [f64],
        by_spacing: &mut [f64; 2],
    ) -> f64 {
        let per_node = 1.0 / self.nodes as f64;
        let along = spacing[1 - side] * per_node;
        let n = self.length(side);
        let mut sum = 0.0;
        for yarn in 0..self.count[side] {
            // A yarn is as stiff as its fibres are many.
            let tension = TENSION * self.stiffness[side] * self.thickness[side][yarn].powi(2);
            let bending = tension * STIFF_LENGTH * STIFF_LENGTH;
            let edge = |k: usize| {
                let (a, b) = (self.at(side, yarn, k), self.at(side, yarn, (k + 1) % n));
                let e = [along, x[b] - x[a], x[b + 1] - x[a + 1]];
                let length = (e[0] * e[0] + e[1] * e[1] + e[2] * e[2]).sqrt();
                (e.map(|v| v / length), length)
            };
            // The last edge, and which it is.
            let mut last = (n - 1, edge(n - 1));
            for k in (0..n).filter(|k| self.counts(side, yarn, k / self.nodes)) {
                let (a, b) = (self.at(side, yarn, k), self.at(side, yarn, (k + 1) % n));
                let p = self.at(side, yarn, (k + n - 1) % n);
                let (t2, l2) = edge(k);
                let before = (k + n - 1) % n;
                let (t1, l1) = if last.0 == before { last.1 } else { edge(before) };
                last = (k, (t2, l2));
                // Tension.
                sum += tension * l2;
                by_spacing[1 - side] += tension * t2[0] * per_node;
                for c in 0..2 {
                    g[b + c] += tension * t2[1 + c];
                    g[a + c] -= tension * t2[1 + c];
                }
                // Steepness.
                let over = (l2 / along - STEEPEST).max(0.0);
                sum += 0.5 * STEEP * per_node * over * over;
                let by_length = STEEP * per_node * over / along;
                by_spacing[1 - side] += by_length * (t2[0] - l2 / along) * per_node;
                for c in 0..2 {
                    g[b + c] += by_length * t2[1 + c];
                    g[a + c] -= by_length * t2[1 + c];
                }
                // Bending: B |t2 - t1|^2 / (2 l) with l the mean of both lengths.
                let cos = t1[0] * t2[0] + t1[1] * t2[1] + t1[2] * t2[2];
                let (q, mean) = (1.0 - cos, 0.5 * (l1 + l2));
                sum += bending * q / mean;
                let half = 0.5 * q / (mean * mean);
                for c in 0..3 {
                    let d1 = bending * (-(t2[c] - cos * t1[c]) / (l1 * mean) - half * t1[c]);
                    let d2 = bending * (-(t1[c] - cos * t2[c]) / (l2 * mean) - half * t2[c]);
                    if c == 0 {
                        by_spacing[1 - side] += (d1 + d2) * per_node;
                    } else {
                        g[a + c - 1] += d1 - d2;
                        g[p + c - 1] -= d1;
                        g[b + c - 1] += d2;
                    }
                }
                // Section.
                let off = x[a + 2] - self.rest[side];
                let below = x[a + 2].min(0.0);
                sum += per_node * self.section * (0.5 * off * off + 10.0 * below * below);
                g[a + 2] += per_node * self.section * (off + 20.0 * below);
                let change = x[b + 2] - x[a + 2];
                let stiff = SECTION_GRADIENT / per_node;
                sum += 0.5 * stiff * change * change;
                g[b + 2] += stiff * change;
                g[a + 2] -= stiff * change;
                sum += 0.5 * per_node * (REED * x[a] * x[a] + FLAT * x[a + 1] * x[a + 1]);
                g[a] += per_node * REED * x[a];
                g[a + 1] += per_node * FLAT * x[a + 1];
            }
        }
        sum
    }

    /// The force on neighbours that go aside together: each float may push one of them, but none pushes the cloth's threads out of
    /// their line. A herringbone's picks would follow its zigzag.
    pub(super) fn together(&self, side: usize, x: &[f64], g: &mut [f64]) -> f64 {
        let (count, crossings) = (self.count[side], self.count[1 - side]);
        let many = count.min(NEIGHBOURS);
        let line = self.out_of_line(side, x);
        for crossing in 0..crossings {
            let off: Vec<f64> = (0..count).map(|yarn| line[yarn * crossings + crossing]).collect();
            for (first, sum) in sums_from(&off, many).into_iter().enumerate() {
                // The last yarn of those that begin there is in all of their sums.
                self.push_aside(side, [(first + many - 1) % count, crossing], sum, g);
            }
        }
        0.5 * BEATEN * line.iter().map(|v| v * v).sum::<f64>()
    }

    /// How far each yarn, with those that follow it, goes aside at each crossing from where they are in the mean.
    pub(super) fn out_of_line(&self, side: usize, x: &[f64]) -> Vec<f64> {
        let (count, crossings) = (self.count[side], self.count[1 - side]);
        let many = count.min(NEIGHBOURS);
        let mut line = vec![0.0; count * crossings];
        for crossing in 0..crossings {
            let of: Vec<f64> = (0..count).map(|yarn| self.aside(side, yarn, crossing, x)).collect();
            for (yarn, sum) in sums_from(&of, many).into_iter().enumerate() {
                line[yarn * crossings + crossing] = sum / many as f64;
            }
        }
        for line in line.chunks_mut(crossings) {
            let mean = line.iter().sum::<f64>() / crossings as f64;
            line.iter_mut().for_each(|v| *v -= mean);
        }
        line
    }

    /// How far a yarn is aside between one crossing and the next, in the mean.
    pub(super) fn aside(&self, side: usize, yarn: usize, crossing: usize, x: &[f64]) -> f64 {
        let nodes = crossing * self.nodes..(crossing + 1) * self.nodes;
        nodes.map(|k| x[self.at(side, yarn, k)]).sum::<f64>() / self.nodes as f64
    }

    /// Hands on to the nodes of a yarn from one crossing to the next by how much the groups that it is in are out of line.
    fn push_aside(&self, side: usize, [yarn, crossing]: [usize; 2], sum: f64, g: &mut [f64]) {
        let by_node = BEATEN / (self.many(side) * self.nodes) as f64;
        let nodes = crossing * self.nodes..(crossing + 1) * self.nodes;
        nodes.for_each(|k| g[self.at(side, yarn, k)] += by_node * sum);
    }

    /// Neighbours that go aside together.
    fn many(&self, side: usize) -> usize {
        self.beside.as_ref().map_or(self.count[side].min(NEIGHBOURS), |beside| beside.many(side))
    }

    /// The same where the repeat is a window of a larger one: groups reach beyond it, and are out of line by what the whole was
    /// when `beside` was taken and by what has changed since.
    pub(super) fn together_beside(&self, beside: &Beside, side: usize, x: &[f64], g: &mut [f64]) -> f64 {
        let (count, crossings, many) = (self.count[side], self.count[1 - side], self.many(side));
        // Of a whole side groups go around; else the first ones begin before the window.
        let around = beside.whole[side] == count;
        let before = if around { 0 } else { many - 1 };
        let mut sum = 0.0;
        for crossing in 0..crossings {
            let mut moved = vec![0.0; before + count + many];
            for yarn in 0..count {
                let index = yarn * crossings + crossing;
                moved[before + yarn] = self.aside(side, yarn, crossing, x) - beside.aside[side][index];
            }
            if around {
                let (own, next) = moved.split_at_mut(count);
                next.copy_from_slice(&own[..many]);
            }
            let groups = before + count;
            let mut line: Vec<f64> = sums_from(&moved, many)[..groups].iter().map(|v| v / many as f64).collect();
            for (group, line) in line.iter_mut().enumerate() {
                *line += beside.line[side][group * crossings + crossing];
            }
            sum += line.iter().map(|v| v * v).sum::<f64>();
            // The groups of a yarn are those that begin up to so many before it.
            let first = |yarn: usize| if around { yarn + count + 1 - many } else { yarn };
            for yarn in 0..count {
                let of = (first(yarn)..first(yarn) + many).map(|group| line[group % groups]).sum();
                self.push_aside(side, [yarn, crossing], of, g);
            }
        }
        0.5 * BEATEN * sum
    }
}

/// Sums of so many values from each on, around the end.
fn sums_from(values: &[f64], many: usize) -> Vec<f64> {
    let count = values.len();
    let mut sum: f64 = values[..many].iter().sum();
    let from = |first: usize| {
        let here = sum;
        sum += values[(first + many) % count] - values[first];
        here
    };
    (0..count).map(from).collect()
}
