//! What ends cloth: chains along free edges, overcast edges of weaves, and the yarns of seams.

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;

use super::{fold::Fold, lay::LaidYarn, surface::Pose};
use crate::{
    math::special::hermite,
    pattern::{StrandKind, tile::chain},
};

/// A way along the edge of cloth: fine vertices of the sewn mesh one after the other, the cloth to the left.
#[derive(Clone, Debug)]
pub(super) struct Way {
    pub(super) vertices: Vec<u32>,
    pub(super) closed: bool,
    /// The panel to the left, of the first edge.
    pub(super) panel: u32,
}

/// An edge of the cloth: its ends, the panel to its left, and the one that is sewn to it.
pub(super) type ClothEdge = ([u32; 2], u32, Option<u32>);

/// Joins edges of one kind to ways.
pub(super) fn ways(edges: &[ClothEdge]) -> Vec<Way> {
    // Of a branching only one way goes on.
    let mut next: HashMap<u32, usize> = HashMap::with_capacity(edges.len());
    let mut before: HashMap<u32, usize> = HashMap::with_capacity(edges.len());
    for (i, (ends, ..)) in edges.iter().enumerate() {
        next.entry(ends[0]).or_insert(i);
        before.entry(ends[1]).or_insert(i);
    }
    let mut used = vec![false; edges.len()];
    let mut out = Vec::new();
    // Open ways from their starts, then what is left: rings.
    for starts_only in [true, false] {
        for start in 0..edges.len() {
            if used[start] || (starts_only && before.contains_key(&edges[start].0[0])) {
                continue;
            }
            let mut vertices = vec![edges[start].0[0]];
            let mut at = start;
            loop {
                used[at] = true;
                vertices.push(edges[at].0[1]);
                match next.get(&edges[at].0[1]) {
                    Some(&i) if !used[i] => at = i,
                    _ => break,
                }
            }
            let closed = vertices.len() > 3 && vertices[0] == vertices[vertices.len() - 1];
            out.push(Way { vertices, closed, panel: edges[start].1 });
        }
    }
    out
}

/// A way in one frame, walked by its length in the first: what runs along it stays where it is on the cloth.
struct Rail<'a> {
    pose: &'a Pose,
    way: &'a Way,
    lengths: &'a [f64],
}

impl Rail<'_> {
    /// Position at a share of the length, and unit vectors along, inwards (to the left) and out.
    fn at(&self, share: f64) -> [DVec3; 4] {
        let total = self.lengths[self.lengths.len() - 1];
        let share = if self.way.closed { share.rem_euclid(1.0) } else { share };
        let s = share * total;
        let n = self.lengths.len();
        let i = self.lengths.partition_point(|&l| l <= s).clamp(1, n - 1) - 1;
        let t = (s - self.lengths[i]) / (self.lengths[i + 1] - self.lengths[i]).max(1e-300);
        let vertex = |k: isize| {
            let last = n as isize - 1;
            let k = if self.way.closed { k.rem_euclid(last) } else { k.clamp(0, last) };
            self.pose.vertex(self.way.vertices[k as usize])
        };
        let i = i as isize;
        let ((a, na), (b, nb)) = (vertex(i), vertex(i + 1));
        let direction = |k: isize| (vertex(k + 1).0 - vertex(k - 1).0).normalize_or(DVec3::X);
        let along = direction(i).lerp(direction(i + 1), t.clamp(0.0, 1.0)).normalize_or(DVec3::X);
        // Smoothly through the vertices, with directions of both ends.
        let chord = a.distance(b);
        let (h, t1) = (t.clamp(0.0, 1.0), t - t.clamp(0.0, 1.0));
        let slopes = [i, i + 1].map(|k| chord * direction(k));
        let at = hermite([a, b], slopes, h) + along * (t1 * chord);
        let out = na.lerp(nb, h);
        let out = (out - out.dot(along) * along).normalize_or(DVec3::Y);
        [at, along, out.cross(along), out]
    }

    /// A place so many steps along, mm in and out.
    fn place(&self, share: f64, inward: f64, out: f64) -> DVec3 {
        let [at, _, to_left, up] = self.at(share);
        at + to_left * inward + up * out
    }
}

/// What runs along a way.
#[derive(Clone, Copy, Debug)]
pub(super) enum Finish {
    /// Links of a chain, so far apart, mm, of yarn that takes so much room, and of its radius.
    Chain { link: f64, room: f64, radius: f64 },
    /// Thread over and over the edge, a turn each `step`, as far in as `reach`.
    Overcast { step: f64, radius: f64, reach: f64 },
    /// To and fro between edges that are turned in, a turn each `step`. Places are mm from the seam's plane and out, on the
    /// left side and on the right.
    Mattress { step: f64, radius: f64, hooks: [[f64; 2]; 2] },
    /// Through both edges that lie against each other, a stitch each `step`; places are those of `fold` as it stands upright.
    Needle { step: f64, radius: f64, line: [[f64; 2]; 2], fold: Fold },
    /// From the needle's line over the edge and back, on the left side or on the right.
    Looper { step: f64, radius: f64, line: [f64; 2], edge: [f64; 2], side: f64, fold: Fold },
}

/// Length of a link as it relaxes, in diameters.
const LINK: f64 = 3.2;
/// A chain's middle is so far inside the edge, in diameters of its yarn.
pub(super) const CHAIN_INSIDE: f64 = 1.1;

/// What runs along an edge, and of which cloth it is.
#[derive(Clone, Debug)]
pub(super) struct Edging {
    pub(super) way: Way,
    pub(super) finish: Finish,
    pub(super) cloth: usize,
    /// Links, turns or stitches: as many in all frames as in the first.
    count: usize,
    /// Length from the way's start to each of its vertices in the first frame, mm.
    lengths: Vec<f64>,
}

impl Edging {
    /// Counts along the way as it is in the first frame.
    pub(super) fn new(way: Way, finish: Finish, cloth: usize, first: &Pose) -> Self {
        let step = match finish {
            Finish::Chain { link, .. } => link,
            Finish::Overcast { step, .. }
            | Finish::Mattress { step, .. }
            | Finish::Needle { step, .. }
            | Finish::Looper { step, .. } => step,
        };
        let mut lengths = vec![0.0];
        for pair in way.vertices.windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|v| first.vertex(v).0);
            lengths.push(lengths[lengths.len() - 1] + a.distance(b));
        }
        let count = ((lengths[lengths.len() - 1] / step).round() as usize).max(1);
        Self { way, finish, cloth, count, lengths }
    }
}

/// A link of the chains along edges, as it relaxes.
pub(super) fn relaxed_link() -> Vec<DVec3> {
    chain(LINK)
}

/// The yarns along some edges in all frames, chains of this link: for each frame the same yarns.
pub(super) fn finish(poses: &[Pose], edgings: &[&Edging], link: &[DVec3]) -> Vec<Vec<LaidYarn>> {
    poses
        .iter()
        .map(|pose| {
            let one = |edging: &&Edging| {
                let rail = Rail { pose, way: &edging.way, lengths: &edging.lengths };
                let (points, radius) = points(&rail, &edging.finish, edging.count, link);
                LaidYarn {
                    points,
                    closed: edging.way.closed,
                    radius,
                    sections: Vec::new(),
                    kind: StrandKind::Course,
                    panel: edging.way.panel,
                    color: 0,
                    coordinates: Vec::new(),
                }
            };
            edgings.par_iter().map(one).collect()
        })
        .collect()
}

fn points(rail: &Rail<'_>, finish: &Finish, count: usize, link: &[DVec3]) -> (Vec<DVec3>, f64) {
    let share = |step: f64| step / count as f64;
    let mut out = Vec::new();
    let radius = match *finish {
        Finish::Chain { room: d, radius, .. } => {
            for i in 0..count {
                for p in link {
                    let along = i as f64 + p.x / LINK;
                    // An open chain's last loop ends in its last link.
                    if !rail.way.closed && along > count as f64 {
                        continue;
                    }
                    out.push(rail.place(share(along), d * (CHAIN_INSIDE + p.y), d * p.z));
                }
            }
            radius
        }
        Finish::Overcast { radius, reach, .. } => {
            // Round the edge: eight places of each turn.
            for i in 0..count * 8 {
                let turn = i as f64 / 8.0;
                let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
                out.push(rail.place(share(turn), 0.5 * reach * (1.0 - cos) - radius, 0.5 * reach * sin));
            }
            radius
        }
        Finish::Mattress { radius, hooks: [left, right], .. } => {
            // A rung, under the bars between two stitches of one side, a rung back, and under those of the other.
            for i in 0..count {
                for (along, [side, out_of], sign) in
                    [(0.06, left, 1.0), (0.44, left, 1.0), (0.56, right, -1.0), (0.94, right, -1.0)]
                {
                    out.push(rail.place(share(i as f64 + along), sign * side, out_of));
                }
            }
            radius
        }
        Finish::Needle { radius, line: [left, right], fold, .. } => {
            for i in 0..count {
                // Along the one side, and through to the loopers of the other.
                for (along, [side, out_of], sign) in [
                    (0.0, right, -1.0),
                    (0.03, left, 0.2),
                    (0.1, left, 1.0),
                    (0.5, left, 1.0),
                    (0.9, left, 1.0),
                    (0.97, left, 0.2),
                ] {
                    let [aside, out_of] = fold.lay_over([sign * side, out_of], 1.0);
                    out.push(rail.place(share(i as f64 + along), aside, out_of));
                }
            }
            radius
        }
        Finish::Looper { radius, line, edge, side, fold, .. } => {
            let middle = [0.5 * (line[0] + edge[0]), 0.5 * (line[1] + edge[1])];
            let (over, back) = ([-0.5 * edge[0], edge[1] - 2.0 * radius], [0.6 * edge[0], edge[1] - 2.0 * radius]);
            // Loops of both sides meet at the edge, one a little before the other.
            let shift = 0.06 * side;
            for i in 0..count {
                for (along, [off, out_of]) in [
                    (0.0, line),
                    (0.22, middle),
                    (0.4, edge),
                    (0.44, back),
                    (0.5, over),
                    (0.56, back),
                    (0.6, edge),
                    (0.78, middle),
                ] {
                    let [aside, out_of] = fold.lay_over([side * off, out_of], 1.0);
                    out.push(rail.place(share(i as f64 + along + shift), aside, out_of));
                }
            }
            radius
        }
    };
    (out, radius)
}
