//! One repeat of a weave in equilibrium: where its yarns are, how flat, and how close the loom beats them up.
//!
//! An energy is minimised over all nodes of one repeat and its two spacings, with periodic borders:
//! bending and tension of each yarn, contact of crossing and of neighbouring yarns as soft elliptical tubes, the
//! resistance of sections to flattening (area kept), and the force that packs the cloth in its plane. Peirce's crimp
//! balance (h1 + h2 = D, shared by stiffness) and jamming follow from it, and so does what his geometry leaves out: yarns
//! that group, floats that slide over crossings, layers. Lengths here are in mean yarn radii.

use glam::DVec3;

use super::{
    super::draft::Draft,
    intrusion::{Section, intrusion},
    minimize::minimize,
};

/// Axial tension of a yarn; the unit of all forces here.
const TENSION: f64 = 1.0;
/// Length over which tension straightens what bending resists, sqrt(B / T).
const STIFF_LENGTH: f64 = 2.0;
/// Resistance of a section to being flattened, energy per crossing and squared logarithm of its width.
const SECTION: f64 = 20.0;
/// The same of yarns that stay round.
const ROUND: f64 = 2000.0;
/// Resistance to changing its shape along the yarn.
const SECTION_GRADIENT: f64 = 2.0;
/// Stiffness of contact.
const CONTACT: f64 = 250.0;
/// What holds a yarn at its dent of the reed, energy per crossing and squared distance.
const REED: f64 = 0.2;
/// What keeps the cloth flat: the rollers of loom and finish.
const FLAT: f64 = 0.2;
/// How much harder yarns on the wrong side of each other are pushed back.
const BEHIND: f64 = 20.0;
/// Length of yarn over length of cloth between two nodes from which on yarns resist: about as steep as in Peirce's jammed
/// cloth (60 degrees). Steeper ones would slip through each other between their nodes.
const STEEPEST: f64 = 2.2;
/// How much they resist.
const STEEP: f64 = 200.0;
/// Distance of yarns, in half their width, at which the reed is full and they lie side by side: what presses harder makes
/// them climb over each other.
const FULL: f64 = 2.04;
/// Crossings of the largest repeat whose symmetry is looked for.
const MOST_SHIFTS: usize = 1024;
/// Resistance to spacings below what fills the reed.
const WALL: f64 = 200.0;
/// Force on each yarn that packs the cloth, unless spacings are given.
pub(super) const BEAT: f64 = 1.0;

/// What is woven.
#[derive(Clone, Debug)]
pub(super) struct CellOptions {
    /// Radii of warp and weft where they are round.
    pub(super) radius: [f64; 2],
    /// Width over height that a free yarn of each takes in cloth.
    pub(super) aspect: [f64; 2],
    /// The warp's share of the crimp, 0 to 1.
    pub(super) crimp: f64,
    /// Distances of warps and of wefts, where they are given.
    pub(super) spacing: [Option<f64>; 2],
    /// Distance of wefts over that of warps where neither is given; both find their own without it.
    pub(super) sett: Option<f64>,
    /// Force that packs the cloth.
    pub(super) beat: f64,
    /// Nodes of a yarn from one crossing to the next.
    pub(super) nodes: usize,
    /// Thickness of each yarn of the repeat over the mean; empty where all are alike.
    pub(super) thickness: [Vec<f64>; 2],
}

/// A place of a yarn in the cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Node {
    /// Sideways from the yarn's own place in an even cloth.
    pub(super) aside: f64,
    /// Above the cloth's middle.
    pub(super) height: f64,
    /// Half width and half height of the section.
    pub(super) axes: [f64; 2],
}

/// One repeat, relaxed; lengths in the unit of the radii.
#[derive(Clone, Debug)]
pub(super) struct UnitCell {
    /// Distance of warps and of wefts.
    pub(super) spacing: [f64; 2],
    /// Nodes from one crossing to the next.
    pub(super) nodes: usize,
    /// For warps and wefts, for each yarn of the repeat: its nodes; node `i * nodes` is at crossing i.
    pub(super) yarns: [Vec<Vec<Node>>; 2],
    /// The deepest that yarns run into each other, in mean diameters, and the share of their surface deeper than 5 %.
    pub(super) overlap: [f64; 2],
}

/// A yarn's node in the vector of variables: `[aside, height, ln(width / round)]`.
const PER_NODE: usize = 3;

struct Energy<'a> {
    draft: &'a Draft,
    /// Mean of each side, in mean radii.
    radius: [f64; 2],
    /// Thickness of each yarn over the mean of its side.
    thickness: [Vec<f64>; 2],
    rest: [f64; 2],
    /// Tension and bending of warp and weft relative to the mean.
    stiffness: [f64; 2],
    /// Resistance of sections to being flattened.
    section: f64,
    beat: f64,
    nodes: usize,
    count: [usize; 2],
    fixed: [Option<f64>; 2],
    contact: f64,
    /// Distance of wefts over that of warps, where it is fixed.
    sett: Option<f64>,
    /// Spacings at which the reed is full.
    densest: [f64; 2],
    /// How much a variable of spacing moves it.
    gear: f64,
}

impl Energy<'_> {
    /// Nodes of one yarn of a side.
    fn length(&self, side: usize) -> usize {
        self.count[1 - side] * self.nodes
    }

    fn base(&self, side: usize) -> usize {
        if side == 0 { 0 } else { PER_NODE * self.count[0] * self.length(0) }
    }

    fn at(&self, side: usize, yarn: usize, node: usize) -> usize {
        self.base(side) + PER_NODE * (yarn * self.length(side) + node)
    }

    fn variables(&self) -> usize {
        self.base(1) + PER_NODE * self.count[1] * self.length(1) + 2
    }

    fn spacing(&self, x: &[f64]) -> [f64; 2] {
        let n = x.len();
        if let Some(sett) = self.sett {
            return [1.0, sett].map(|share| share * x[n - 2] * self.gear);
        }
        [0, 1].map(|side| self.fixed[side].unwrap_or(x[n - 2 + side] * self.gear))
    }

    fn value(&self, x: &[f64], g: &mut [f64]) -> f64 {
        g.fill(0.0);
        let spacing = self.spacing(x);
        let tangents = self.tangents(x, spacing);
        let axes = self.all_axes(x);
        let mut gradient = Gradient {
            nodes: g,
            spacing: [0.0; 2],
            tangents: vec![DVec3::ZERO; tangents.len()],
            headings: vec![0.0; tangents.len()],
        };
        let mut sum = 0.0;
        for side in 0..2 {
            sum += self.rods(side, x, spacing, gradient.nodes, &mut gradient.spacing);
            sum += self.neighbours(side, x, spacing, &tangents, &axes, &mut gradient);
            // Each yarn of the other side is pressed together by the spacings of this one.
            let yarns = (self.count[0] * self.count[1]) as f64;
            let tight = (self.densest[side] - spacing[side]).max(0.0);
            sum += yarns * (self.beat * spacing[side] + 0.5 * WALL * tight * tight);
            gradient.spacing[side] += yarns * (self.beat - WALL * tight);
        }
        let spheroids: Vec<Spheroid> = axes.iter().zip(&tangents).map(|(a, t)| Spheroid::new(*a, t.unit)).collect();
        sum += self.crossings(x, spacing, &spheroids, &mut gradient);
        let Gradient { nodes: g, spacing: mut by_spacing, tangents: mut by_tangent, headings } = gradient;
        for ((by, heading), tangent) in by_tangent.iter_mut().zip(headings).zip(&tangents) {
            let t = tangent.unit;
            *by += heading / t.truncate().length_squared().max(1e-6) * DVec3::new(-t.y, t.x, 0.0);
        }
        self.hand_on_tangents(&by_tangent, &tangents, g, &mut by_spacing);
        let n = g.len();
        if let Some(sett) = self.sett {
            g[n - 2] = (by_spacing[0] + sett * by_spacing[1]) * self.gear;
            g[n - 1] = 0.0;
            return sum;
        }
        for side in 0..2 {
            g[n - 2 + side] = if self.fixed[side].is_some() { 0.0 } else { by_spacing[side] * self.gear };
        }
        sum
    }

    /// Bending, tension, sections and the reed.
    fn rods(&self, side: usize, x: &[f64], spacing: [f64; 2], g: &mut [f64], by_spacing: &mut [f64; 2]) -> f64 {
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
            let mut before = edge(n - 1);
            for k in 0..n {
                let (a, b) = (self.at(side, yarn, k), self.at(side, yarn, (k + 1) % n));
                let p = self.at(side, yarn, (k + n - 1) % n);
                let (t2, l2) = edge(k);
                let (t1, l1) = before;
                before = (t2, l2);
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

    /// The number of the free variable that each variable follows: where a shift by some warps and wefts maps the draft
    /// onto itself, what it maps onto each other is one. All warps of a twill or satin are alike.
    fn alike(&self) -> Vec<usize> {
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

    /// Leads every even warp from one side of its right neighbour to the other after each weft, below it.
    fn twine(&self, x: &mut [f64]) {
        let r = self.radius[0];
        // Both move from their dents to the middle between them.
        let together = 0.5 * self.spacing(x)[0];
        for warp in (0..self.count[0]).step_by(2) {
            for k in 0..self.length(0) {
                let turn = std::f64::consts::PI * k as f64 / self.nodes as f64;
                let (crossing, straight) = (self.at(0, warp, k), self.at(0, warp + 1, k));
                x[crossing] = together - 2.2 * r * turn.cos();
                x[straight] = -together;
                // At the top over each weft, at the bottom between two.
                x[crossing + 1] = 2.6 * r * (2.0 * turn).cos();
                x[straight + 1] = -r;
            }
        }
    }

    /// Radius of a yarn where it is round.
    fn round(&self, side: usize, yarn: usize) -> f64 {
        self.radius[side] * self.thickness[side][yarn]
    }

    fn axes(&self, side: usize, yarn: usize, flat: f64) -> [f64; 2] {
        [self.round(side, yarn) * flat.exp(), self.round(side, yarn) * (-flat).exp()]
    }

    /// Half width and half height of all nodes.
    fn all_axes(&self, x: &[f64]) -> Vec<[f64; 2]> {
        let nodes = x[..x.len() - 2].chunks_exact(PER_NODE);
        let warps = self.base(1) / PER_NODE;
        let place = |i: usize| if i < warps { (0, i / self.length(0)) } else { (1, (i - warps) / self.length(1)) };
        let axes = |(side, yarn): (usize, usize), flat: f64| self.axes(side, yarn, flat);
        nodes.enumerate().map(|(i, node)| axes(place(i), node[2])).collect()
    }

    /// Unit tangents of all nodes, in the world, with half the way between their neighbours along the yarn.
    fn tangents(&self, x: &[f64], spacing: [f64; 2]) -> Vec<Tangent> {
        let mut all = Vec::with_capacity(x.len() / PER_NODE);
        for side in 0..2 {
            let n = self.length(side);
            let along = 2.0 * spacing[1 - side] / self.nodes as f64;
            for yarn in 0..self.count[side] {
                for k in 0..n {
                    let (a, b) = (self.at(side, yarn, (k + n - 1) % n), self.at(side, yarn, (k + 1) % n));
                    let way = world(side, [along, x[b] - x[a], x[b + 1] - x[a + 1]]);
                    let length = way.length();
                    all.push(Tangent { unit: way / length, length });
                }
            }
        }
        all
    }

    /// Hands the gradient by tangents on to nodes and spacings.
    fn hand_on_tangents(&self, by_tangent: &[DVec3], tangents: &[Tangent], g: &mut [f64], by_spacing: &mut [f64; 2]) {
        for side in 0..2 {
            let n = self.length(side);
            for yarn in 0..self.count[side] {
                for k in 0..n {
                    let (a, b) = (self.at(side, yarn, (k + n - 1) % n), self.at(side, yarn, (k + 1) % n));
                    let node = self.at(side, yarn, k) / PER_NODE;
                    let t = &tangents[node];
                    let by = by_tangent[node];
                    let [along, aside, height] = local(side, (by - by.dot(t.unit) * t.unit) / t.length);
                    by_spacing[1 - side] += 2.0 * along / self.nodes as f64;
                    g[b] += aside;
                    g[a] -= aside;
                    g[b + 1] += height;
                    g[a + 1] -= height;
                }
            }
        }
    }

    /// Contact of yarns of one side that lie beside or upon each other, in planes across the cloth.
    fn neighbours(
        &self,
        side: usize,
        x: &[f64],
        spacing: [f64; 2],
        tangents: &[Tangent],
        axes: &[[f64; 2]],
        gradient: &mut Gradient<'_>,
    ) -> f64 {
        let n = self.length(side);
        let count = self.count[side];
        let thickest = self.thickness[side].iter().fold(1.0, |m: f64, t| m.max(*t));
        let far = ((3.2 * thickest * self.radius[side] / spacing[side]).ceil() as usize).clamp(1, 5);
        // Half height of a sloping yarn's cut, over its own.
        let steep = |at: usize| 1.0 / local(side, tangents[at / PER_NODE].unit)[0].max(0.2);
        let mut sum = 0.0;
        for yarn in 0..count {
            for apart in 1..=far {
                let size = self.round(side, yarn) + self.round(side, (yarn + apart) % count);
                let stiff = 4.0 * self.contact * size * size / self.nodes as f64;
                for k in 0..n {
                    let (a, b) = (self.at(side, yarn, k), self.at(side, (yarn + apart) % count, k));
                    let d = [apart as f64 * spacing[side] + x[b] - x[a], x[b + 1] - x[a + 1]];
                    if d[0].abs() > 2.0 * size || d[1].abs() > 2.0 * size {
                        continue;
                    }
                    let (s, t) = (axes[a / PER_NODE], axes[b / PER_NODE]);
                    let (steep_s, steep_t) = (steep(a), steep(b));
                    let axes = [s[0] + t[0], s[1] * steep_s + t[1] * steep_t];
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
                    gradient.nodes[a + 2] += by_axes[0] * s[0] - by_axes[1] * s[1] * steep_s;
                    gradient.nodes[b + 2] += by_axes[0] * t[0] - by_axes[1] * t[1] * steep_t;
                    let along = world(side, [1.0, 0.0, 0.0]);
                    gradient.tangents[a / PER_NODE] -= by_axes[1] * s[1] * steep_s * steep_s * along;
                    gradient.tangents[b / PER_NODE] -= by_axes[1] * t[1] * steep_t * steep_t * along;
                }
            }
        }
        sum
    }

    /// Contact of warps with wefts, the warp on the side that the draft says. Nodes are spheroids: as wide as the yarn
    /// level and across it, as high as it all else. Two spheroids touch about where an ellipsoid around the sum of both
    /// is reached, whose matrix (squared half axes) is (1 + 1/r) P + (1 + r) Q with r the ratio of the radii: exact for
    /// round yarns.
    fn crossings(&self, x: &[f64], spacing: [f64; 2], spheroids: &[Spheroid], gradient: &mut Gradient<'_>) -> f64 {
        let per_node = 1.0 / self.nodes as f64;
        let (step_x, step_y) = (spacing[0] * per_node, spacing[1] * per_node);
        let (warp_length, weft_length) = (self.length(0) as isize, self.length(1) as isize);
        let g = &mut *gradient.nodes;
        let mut sum = 0.0;
        for i in 0..self.count[1] {
            for j in 0..self.count[0] {
                let sign = if self.draft.warp_over(i, j) { 1.0 } else { -1.0 };
                let (own, other) = (self.round(0, j), self.round(1, i));
                let (size, ratio) = (own + other, own / other);
                let parts = [1.0 + ratio.recip(), 1.0 + ratio];
                // A crossing has more pairs the more nodes there are.
                let stiff = self.contact * size * size * (4.0 * per_node).powi(2);
                let limit = 1.6 * size;
                let reach_y = (limit / step_y).ceil() as isize;
                for b in -reach_y..=reach_y {
                    let node = ((i * self.nodes) as isize + b).rem_euclid(warp_length) as usize;
                    let w = self.at(0, j, node);
                    let warp = &spheroids[w / PER_NODE];
                    // Nodes of the weft near this one of the warp.
                    let (from, to) = (((x[w] - limit) / step_x).ceil() as isize, ((x[w] + limit) / step_x) as isize);
                    for a in from..=to {
                        let node = ((j * self.nodes) as isize + a).rem_euclid(weft_length) as usize;
                        let v = self.at(1, i, node);
                        let weft = &spheroids[v / PER_NODE];
                        let d = [x[w] - a as f64 * step_x, b as f64 * step_y - x[v]];
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
                        let pz = 1.0 / (parts[0] * warp.high + parts[1] * weft.high);
                        let dz = sign * (x[w + 1] - x[v + 1]);
                        // On the wrong side: back through the middle.
                        let (inside, behind) = (dz.max(0.0), BEHIND * (-dz).max(0.0) / size);
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

/// A node as crossing yarns meet it.
struct Spheroid {
    /// Squared half axes: wide, high.
    wide: f64,
    high: f64,
    /// The level part of its matrix: xx, xy, yy.
    level: [f64; 3],
    /// Level unit vector across the yarn.
    across: [f64; 2],
}

impl Spheroid {
    fn new(axes: [f64; 2], tangent: DVec3) -> Self {
        let flat = tangent.truncate().length().max(1e-3);
        let across = [-tangent.y / flat, tangent.x / flat];
        let [wide, high] = axes.map(|v| v * v);
        let more = wide - high;
        let level =
            [high + more * across[0] * across[0], more * across[0] * across[1], high + more * across[1] * across[1]];
        Self { wide, high, level, across }
    }

    /// Of w' Q w by the logarithm of the flattening and by the yarn's heading, for the level part of w and its height.
    fn gradient(&self, way: [f64; 2], up: f64) -> (f64, f64) {
        let across = way[0] * self.across[0] + way[1] * self.across[1];
        let along = way[0] * self.across[1] - way[1] * self.across[0];
        let by_flattening = 2.0 * (self.wide * across * across - self.high * (along * along + up * up));
        (by_flattening, -2.0 * (self.wide - self.high) * across * along)
    }
}

/// What the gradient of the energy is gathered in.
struct Gradient<'a> {
    nodes: &'a mut [f64],
    spacing: [f64; 2],
    tangents: Vec<DVec3>,
    /// By the angle of each node's tangent in the plane.
    headings: Vec<f64>,
}

#[derive(Clone, Copy)]
struct Tangent {
    unit: DVec3,
    /// Length of the way from the node before to the one after.
    length: f64,
}

/// From along, aside and height of a warp or a weft to x, y, z.
fn world(side: usize, [along, aside, height]: [f64; 3]) -> DVec3 {
    if side == 0 { DVec3::new(aside, along, height) } else { DVec3::new(along, aside, height) }
}

fn local(side: usize, v: DVec3) -> [f64; 3] {
    if side == 0 { [v.y, v.x, v.z] } else { [v.x, v.y, v.z] }
}

/// The distance at which yarns of a side lie side by side, in the unit of the radii.
pub(super) fn full(draft: &Draft, options: &CellOptions, side: usize) -> f64 {
    FULL * options.radius[side] * options.aspect[side].sqrt() / draft.layers() as f64
}

impl UnitCell {
    /// Relaxes one repeat of `draft`.
    pub(super) fn relax(draft: &Draft, options: &CellOptions) -> Self {
        let unit = 0.5 * (options.radius[0] + options.radius[1]);
        let radius = options.radius.map(|r| r / unit);
        let count = [draft.warps(), draft.wefts()];
        let crimp = options.crimp.clamp(0.04, 0.96);
        let total = count[0] * count[1] * options.nodes;
        let mut energy = Energy {
            draft,
            radius,
            thickness: [0, 1].map(|side| match options.thickness[side].as_slice() {
                [] => vec![1.0; count[side]],
                given => given.to_vec(),
            }),
            rest: options.aspect.map(|a| 0.5 * a.ln()),
            // The stiffer side bends less: h1 / h2 = B2 / B1.
            stiffness: [2.0 * (1.0 - crimp), 2.0 * crimp],
            // What shall stay round does not give way.
            section: if options.aspect == [1.0; 2] { ROUND } else { SECTION },
            beat: options.beat,
            nodes: options.nodes,
            count,
            fixed: options.spacing.map(|s| s.map(|s| s / unit)),
            contact: CONTACT,
            sett: options.sett.filter(|_| options.spacing == [None; 2] && !draft.twines()),
            densest: [0, 1].map(|side| full(draft, options, side) / unit),
            gear: 0.5 / (total as f64).sqrt(),
        };
        let mut x = vec![0.0; energy.variables()];
        let half = 0.5 * (radius[0] + radius[1]);
        for side in 0..2 {
            let n = energy.length(side);
            for yarn in 0..count[side] {
                for node in 0..n {
                    let over = |crossing: usize| {
                        let crossing = crossing % count[1 - side];
                        let warp_over =
                            if side == 0 { draft.warp_over(crossing, yarn) } else { draft.warp_over(yarn, crossing) };
                        if warp_over == (side == 0) { half } else { -half }
                    };
                    let share = (node % options.nodes) as f64 / options.nodes as f64;
                    let smooth = 0.5 - 0.5 * (std::f64::consts::PI * share).cos();
                    let crossing = node / options.nodes;
                    let at = energy.at(side, yarn, node);
                    x[at + 1] = over(crossing) * (1.0 - smooth) + over(crossing + 1) * smooth;
                }
            }
        }
        let n = x.len();
        for side in 0..2 {
            x[n - 2 + side] = 2.2 * (radius[0] + radius[1]) / energy.gear;
        }
        if draft.twines() {
            // An open cloth: warps in pairs, hardly flattened, and room for a warp to pass between wefts.
            energy.densest = [3.4 * radius[0], 3.4 * radius[0] + 3.0 * radius[1]];
            energy.rest[0] *= 0.3;
            energy.twine(&mut x);
        }
        let rest = energy.rest;
        let same = energy.alike();
        let count_free = same.iter().max().map_or(0, |m| m + 1);
        let mut free = vec![0.0; count_free];
        // Alike by what starts alike.
        x.iter().zip(&same).for_each(|(v, &i)| free[i] = *v);
        for (contact, flat, most) in [(1.0, 0.0, 400), (1.0, 1.0, 700)] {
            energy.contact = contact * CONTACT;
            energy.rest = rest.map(|r| flat * r);
            let (mut full, mut by_full) = (vec![0.0; x.len()], vec![0.0; x.len()]);
            let mut value = |free: &[f64], by_free: &mut [f64]| {
                full.iter_mut().zip(&same).for_each(|(v, &i)| *v = free[i]);
                let value = energy.value(&full, &mut by_full);
                by_free.fill(0.0);
                by_full.iter().zip(&same).for_each(|(g, &i)| by_free[i] += g);
                value
            };
            minimize(&mut free, &mut value, 1e-3, 0.3, most);
        }
        x.iter_mut().zip(&same).for_each(|(v, &i)| *v = free[i]);
        let spacing = energy.spacing(&x).map(|s| s * unit);
        let yarns = [0, 1].map(|side| {
            (0..count[side])
                .map(|yarn| {
                    (0..energy.length(side))
                        .map(|node| {
                            let at = energy.at(side, yarn, node);
                            let flat = x[at + 2].max(0.0);
                            Node {
                                aside: x[at] * unit,
                                height: x[at + 1] * unit,
                                axes: energy.axes(side, yarn, flat).map(|v| v * unit),
                            }
                        })
                        .collect()
                })
                .collect()
        });
        let mut cell = Self { spacing, nodes: options.nodes, yarns, overlap: [0.0; 2] };
        let (deepest, share) = intrusion(&cell.sections(), 0.1 * unit);
        cell.overlap = [deepest / (2.0 * unit), share];
        cell
    }

    /// The cross-sections of all yarns, with a crossing or more of the next repeats.
    fn sections(&self) -> Vec<Vec<Section>> {
        let mut all = Vec::new();
        for side in 0..2 {
            let (own, other) = (self.yarns[side].len() as i64, self.yarns[1 - side].len() as i64);
            for index in -2..own + 2 {
                let yarn = &self.yarns[side][index.rem_euclid(own) as usize];
                let (from, to) = (-2 * self.nodes as i64, (other + 2) * self.nodes as i64);
                let along = self.spacing[1 - side] / self.nodes as f64;
                let at = |k: i64| {
                    let node = &yarn[k.rem_euclid(yarn.len() as i64) as usize];
                    let (a, b) = (k as f64 * along, index as f64 * self.spacing[side] + node.aside);
                    if side == 0 { DVec3::new(b, a, node.height) } else { DVec3::new(a, b, node.height) }
                };
                all.push(
                    (from..=to)
                        .map(|k| {
                            let tangent = (at(k + 1) - at(k - 1)).normalize();
                            let minor = (DVec3::Z - tangent.z * tangent).normalize();
                            let axes = yarn[k.rem_euclid(yarn.len() as i64) as usize].axes;
                            Section { at: at(k), tangent, minor, axes }
                        })
                        .collect(),
                );
            }
        }
        all
    }

    /// Length of all yarns of a side in one repeat.
    pub(super) fn length(&self, side: usize) -> f64 {
        let along = self.spacing[1 - side] / self.nodes as f64;
        let step = |a: &Node, b: &Node| DVec3::new(along, b.aside - a.aside, b.height - a.height).length();
        let yarn = |y: &Vec<Node>| (0..y.len()).map(|k| step(&y[k], &y[(k + 1) % y.len()])).sum::<f64>();
        self.yarns[side].iter().map(yarn).sum()
    }

    /// Share of the plane that no yarn covers, seen along the normal of the cloth.
    pub(super) fn see_through(&self) -> f64 {
        const CELLS: usize = 24;
        let count = [self.yarns[0].len(), self.yarns[1].len()];
        let size = [count[0] * CELLS, count[1] * CELLS];
        let mut covered = vec![false; size[0] * size[1]];
        for side in 0..2 {
            let n = self.yarns[side][0].len() as f64;
            let along = size[1 - side];
            for (index, yarn) in self.yarns[side].iter().enumerate() {
                for step in 0..along {
                    // Between nodes.
                    let place = (step as f64 + 0.5) / along as f64 * n;
                    let (k, share) = (place as usize, place.fract());
                    let (a, b) = (&yarn[k], &yarn[(k + 1) % yarn.len()]);
                    let mix = |p: f64, q: f64| p + share * (q - p);
                    let middle = index as f64 + mix(a.aside, b.aside) / self.spacing[side];
                    let half = mix(a.axes[0], b.axes[0]) / self.spacing[side];
                    // A cell's middle is at (c + 1/2) / CELLS.
                    let first = ((middle - half) * CELLS as f64 - 0.5).ceil() as i64;
                    let last = ((middle + half) * CELLS as f64 - 0.5).floor() as i64;
                    for c in first..=last.min(first + size[side] as i64) {
                        let across = c.rem_euclid(size[side] as i64) as usize;
                        let cell = if side == 0 { step * size[0] + across } else { across * size[0] + step };
                        covered[cell] = true;
                    }
                }
            }
        }
        covered.iter().filter(|c| !**c).count() as f64 / covered.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gradient_is_that_of_the_energy() {
        let draft = Draft::named("twill 2/1").unwrap();
        let energy = Energy {
            draft: &draft,
            radius: [0.8, 1.2],
            thickness: [vec![1.3, 0.7, 1.0], vec![1.0, 0.9, 1.1]],
            rest: [0.2, 0.1],
            stiffness: [1.2, 0.8],
            section: SECTION,
            beat: 1.0,
            nodes: 4,
            count: [3, 3],
            fixed: [None; 2],
            contact: CONTACT,
            sett: None,
            densest: [1.6, 2.4],
            gear: 0.1,
        };
        let n = energy.variables();
        let mut x: Vec<f64> = (0..n).map(|i| 0.3 * (i as f64 * 1.7).sin()).collect();
        for yarn in 0..3 {
            for k in 0..12 {
                let over = |side: usize, k: usize| {
                    if side == 0 { draft.warp_over(k / 4, yarn) } else { !draft.warp_over(yarn, k / 4) }
                };
                for side in 0..2 {
                    x[energy.at(side, yarn, k) + 1] += if over(side, k) { 0.8 } else { -0.8 };
                }
            }
        }
        (x[n - 2], x[n - 1]) = (22.0, 28.0);
        let mut g = vec![0.0; n];
        energy.value(&x, &mut g);
        let mut other = vec![0.0; n];
        for i in 0..n {
            let h = 1e-5;
            let mut at = |d: f64| {
                let mut y = x.clone();
                y[i] += d;
                energy.value(&y, &mut other)
            };
            let want = (at(h) - at(-h)) / (2.0 * h);
            assert!((g[i] - want).abs() < 1e-3 * (1.0 + want.abs()), "variable {i} of {n}: {} {want}", g[i]);
        }
    }
}
