//! Contact of yarns as soft elliptical tubes: neighbours of one side, and warps with the wefts that they cross.

use super::{
    cut::Cut,
    energy::{Energy, Gradient, PER_NODE, world},
    spheroid::Spheroid,
};

/// Stiffness of contact.
const CONTACT: f64 = 250.0;
/// How much harder yarns on the wrong side of each other are pushed back.
const BEHIND: f64 = 20.0;

/// Bounds of the nodes of a weft that a warp may meet.
struct Piece {
    /// Least and most aside.
    aside: [f64; 2],
    /// The most towards the warp's side.
    top: f64,
    /// Largest squared half axes of spheroids: level, and upright.
    widest: f64,
    high: f64,
}

impl Piece {
    /// Of nodes: how far each is aside and towards the warp's side.
    fn of<'a>(nodes: impl Iterator<Item = ([f64; 2], &'a Spheroid)>) -> Self {
        let none = Self { aside: [f64::MAX, f64::MIN], top: f64::MIN, widest: 0.0, high: 0.0 };
        nodes.fold(none, |all, ([aside, up], spheroid)| Self {
            aside: [all.aside[0].min(aside), all.aside[1].max(aside)],
            top: all.top.max(up),
            widest: all.widest.max(spheroid.widest),
            high: all.high.max(spheroid.high),
        })
    }

    /// How far along the weft a node of the warp, so far across it and up, may touch it, if it may at all.
    fn reach(&self, [across, up]: [f64; 2], warp: &Spheroid, parts: [f64; 2]) -> Option<f64> {
        let off = (self.aside[0] - across).max(across - self.aside[1]).max(0.0);
        let inside = (up - self.top).max(0.0);
        let high = parts[0] * warp.high + parts[1] * self.high;
        let widest = parts[0] * warp.widest + parts[1] * self.widest;
        // A little more, for what is rounded.
        let square = widest * (1.0 + 1e-9 - inside * inside / high) - off * off;
        (square > 0.0).then(|| square.sqrt() + 1e-9)
    }
}

impl Energy<'_> {
    /// Contact of yarns of one side that lie beside or upon each other, in planes across the cloth.
    pub(super) fn neighbours(
        &self,
        side: usize,
        x: &[f64],
        spacing: [f64; 2],
        cuts: &[Cut],
        axes: &[[f64; 2]],
        gradient: &mut Gradient<'_>,
    ) -> f64 {
        let n = self.length(side);
        let count = self.count[side];
        let thickest = self.thickness[side].iter().fold(1.0, |m: f64, t| m.max(*t));
        let far = ((3.2 * thickest * self.radius[side] / spacing[side]).ceil() as usize).clamp(1, 5);
        let mut sum = 0.0;
        for yarn in 0..count {
            for apart in 1..=far {
                let size = self.round(side, yarn) + self.round(side, (yarn + apart) % count);
                let stiff = 4.0 * CONTACT * size * size / self.nodes as f64;
                for k in (0..n).filter(|k| self.counts(side, yarn, k / self.nodes)) {
                    let (a, b) = (self.at(side, yarn, k), self.at(side, (yarn + apart) % count, k));
                    let d = [apart as f64 * spacing[side] + x[b] - x[a], x[b + 1] - x[a + 1]];
                    if d[0].abs() > 2.0 * size || d[1].abs() > 2.0 * size {
                        continue;
                    }
                    let (s, t) = (axes[a / PER_NODE], axes[b / PER_NODE]);
                    let (cut_s, cut_t) = (&cuts[a / PER_NODE], &cuts[b / PER_NODE]);
                    let axes = [0, 1].map(|c| s[c] * cut_s.longer[c] + t[c] * cut_t.longer[c]);
                    let scaled = [d[0] / axes[0], d[1] / axes[1]];
                    let f = scaled[0] * scaled[0] + scaled[1] * scaled[1];
                    if f >= 1.0 {
                        continue;
                    }
                    let root = f.sqrt().max(1e-6);
                    let depth = 1.0 - root;
                    sum += 0.5 * stiff * depth * depth;
                    let by_f = -0.5 * stiff * depth / root;
                    let by_d = [0, 1].map(|c| by_f * 2.0 * scaled[c] / axes[c]);
                    for (c, by) in by_d.into_iter().enumerate() {
                        gradient.nodes[b + c] += by;
                        gradient.nodes[a + c] -= by;
                    }
                    gradient.spacing[side] += by_d[0] * apart as f64;
                    let by_axes = [0, 1].map(|c| -by_f * 2.0 * scaled[c] * scaled[c] / axes[c]);
                    for (node, axes, cut) in [(a, s, cut_s), (b, t, cut_t)] {
                        let by = [0, 1].map(|c| by_axes[c] * axes[c]);
                        gradient.nodes[node + 2] += by[0] * cut.longer[0] - by[1] * cut.longer[1];
                        let by_tangent = [0, 1].map(|k| by[0] * cut.slopes[0][k] + by[1] * cut.slopes[1][k]);
                        gradient.tangents[node / PER_NODE] += world(side, [by_tangent[0], by_tangent[1], 0.0]);
                    }
                }
            }
        }
        sum
    }

    /// Contact of warps with wefts, the warp on the side that the draft says. Nodes are spheroids: as wide as the yarn
    /// level and across it, as high as it all else. Two spheroids touch about where an ellipsoid around the sum of both
    /// is reached, whose matrix (squared half axes) is (1 + 1/r) P + (1 + r) Q with r the ratio of the radii: exact for
    /// round yarns.
    pub(super) fn crossings(
        &self,
        x: &[f64],
        spacing: [f64; 2],
        spheroids: &[Spheroid],
        gradient: &mut Gradient<'_>,
    ) -> f64 {
        let per_node = 1.0 / self.nodes as f64;
        let (step_x, step_y) = (spacing[0] * per_node, spacing[1] * per_node);
        let (warp_length, weft_length) = (self.length(0) as isize, self.length(1) as isize);
        let g = &mut *gradient.nodes;
        let mut sum = 0.0;
        for i in 0..self.count[1] {
            for j in (0..self.count[0]).filter(|j| self.counts(0, *j, i)) {
                let sign = if self.draft.warp_over(i, j) { 1.0 } else { -1.0 };
                let (own, other) = (self.round(0, j), self.round(1, i));
                let (size, ratio) = (own + other, own / other);
                let parts = [1.0 + ratio.recip(), 1.0 + ratio];
                // A crossing has more pairs the more nodes there are.
                let stiff = CONTACT * size * size * (4.0 * per_node).powi(2);
                let limit = 1.6 * size;
                let reach_y = (limit / step_y).ceil() as isize;
                let first = self.at(1, i, 0);
                let warp_node = |b: isize| ((i * self.nodes) as isize + b).rem_euclid(warp_length) as usize;
                let weft_node = |a: isize| ((j * self.nodes) as isize + a).rem_euclid(weft_length) as usize;
                let asides = (-reach_y..=reach_y).map(|b| x[self.at(0, j, warp_node(b))]);
                let [left, right] = asides.fold([f64::MAX, f64::MIN], |[l, r], x| [l.min(x), r.max(x)]);
                let near = ((left - limit) / step_x) as isize - 1..=((right + limit) / step_x) as isize;
                let near = near.map(|a| first + PER_NODE * weft_node(a));
                let piece = Piece::of(near.map(|v| ([x[v], sign * x[v + 1]], &spheroids[v / PER_NODE])));
                for b in -reach_y..=reach_y {
                    let w = self.at(0, j, warp_node(b));
                    let warp = &spheroids[w / PER_NODE];
                    let Some(reach_x) = piece.reach([b as f64 * step_y, sign * x[w + 1]], warp, parts) else {
                        continue;
                    };
                    let reach_x = reach_x.min(limit);
                    // Nodes of the weft near this one of the warp.
                    let (from, to) =
                        (((x[w] - reach_x) / step_x).ceil() as isize, ((x[w] + reach_x) / step_x) as isize);
                    let mut node = weft_node(from);
                    for a in from..=to {
                        let v = first + PER_NODE * node;
                        node = if node + 1 == weft_length as usize { 0 } else { node + 1 };
                        let weft = &spheroids[v / PER_NODE];
                        let d = [x[w] - a as f64 * step_x, b as f64 * step_y - x[v]];
                        let dz = sign * (x[w + 1] - x[v + 1]);
                        // On the wrong side: back through the middle.
                        let inside = dz.max(0.0);
                        // Most do not touch, which is soon told of the level ellipse's circumcircle.
                        let widest = parts[0] * warp.widest + parts[1] * weft.widest;
                        let high = parts[0] * warp.high + parts[1] * weft.high;
                        if (d[0] * d[0] + d[1] * d[1]) * high + inside * inside * widest >= widest * high * (1.0 + 1e-9)
                        {
                            continue;
                        }
                        if d[1].abs() > limit {
                            continue;
                        }
                        let m = [0, 1, 2].map(|c| parts[0] * warp.level[c] + parts[1] * weft.level[c]);
                        let det = 1.0 / (m[0] * m[2] - m[1] * m[1]);
                        let way = [(m[2] * d[0] - m[1] * d[1]) * det, (m[0] * d[1] - m[1] * d[0]) * det];
                        let flat = d[0] * way[0] + d[1] * way[1];
                        if flat >= 1.0 {
                            continue;
                        }
                        let pz = 1.0 / high;
                        let behind = BEHIND * (-dz).max(0.0) / size;
                        let f = flat + inside * inside * pz;
                        if f >= 1.0 {
                            continue;
                        }
                        let root = f.sqrt().max(1e-6);
                        let depth = (1.0 - root) * (1.0 + behind);
                        sum += 0.5 * stiff * depth * depth;
                        let by_f = -0.5 * stiff * depth * (1.0 + behind) / root;
                        let (gx, gy) = (2.0 * by_f * way[0], 2.0 * by_f * way[1]);
                        let back = -stiff * depth * (1.0 - root) * BEHIND / size;
                        let gz = sign * if behind > 0.0 { back } else { 2.0 * by_f * inside * pz };
                        g[w] += gx;
                        g[v] -= gy;
                        g[w + 1] += gz;
                        g[v + 1] -= gz;
                        gradient.spacing[0] -= gx * a as f64 * per_node;
                        gradient.spacing[1] += gy * b as f64 * per_node;
                        let up = inside * pz;
                        for ((node, at), part) in [(warp, w), (weft, v)].into_iter().zip(parts) {
                            let (by_flattening, by_heading) = node.gradient(way, up);
                            g[at + 2] -= by_f * part * by_flattening;
                            gradient.headings[at / PER_NODE] -= by_f * part * by_heading;
                        }
                    }
                }
            }
        }
        sum
    }
}
