//! Where the edges of stitches lie on a panel's border, within it or, to be turned in, beyond.

use glam::DVec2;
use rstar::{
    RTree,
    primitives::{GeomWithData, Line},
};

use super::{
    seam::SeamKind,
    surface::{Anchor, BorderEdge},
};

/// An edge of the border as stitches see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub(super) border: BorderEdge,
    /// How much of the cloth is left out at it, mm: negative where the cloth goes on to be turned in.
    pub(super) margin: f64,
    /// How it is sewn, if it is.
    pub(super) seam: SeamKind,
    /// Whether it is the first of two that are sewn together.
    pub(super) first: bool,
    /// Whether its first row is picked up along the other's edge.
    pub(super) picked_up: bool,
    /// Whether it is hemmed: what goes on beyond it is not the border's.
    pub(super) hemmed: bool,
}

/// Where a corner of a stitch goes on the border.
#[derive(Clone, Copy, Debug)]
pub(super) struct Landing {
    pub(super) at: DVec2,
    /// Whether the border is sewn to nothing there, nor hemmed.
    pub(super) free: bool,
    /// Whether the first row is picked up there.
    pub(super) picked_up: bool,
    /// Whether it is at the end of what is turned in.
    pub(super) turned_in: bool,
}

/// A place of the panel near a seam that is turned in, or beyond it.
#[derive(Clone, Copy, Debug)]
pub(super) struct NearSeam {
    /// Ends of the seam's edge among the points of the sewn mesh.
    pub(super) vertices: [u32; 2],
    /// How far along the edge it is nearest, from 0 to 1.
    pub(super) share: f32,
    /// How far beyond the seam it is, mm; 0 on the panel.
    pub(super) over: f32,
    /// How it is sewn.
    pub(super) kind: SeamKind,
    /// Whether its edge is the first of the two.
    pub(super) first: bool,
}

/// Sine of the angle to rows or wales up to which an edge does not slant.
const LEVEL: f64 = 0.1;

/// The nearest place of an edge, and how far along it is, from 0 to 1.
fn on(edge: &BorderEdge, from: DVec2) -> (DVec2, f64) {
    let [a, b] = edge.ends;
    let t = ((from - a).dot(b - a) / (b - a).length_squared().max(1e-300)).clamp(0.0, 1.0);
    (a.lerp(b, t), t)
}

/// Distance inwards from the line through an edge.
fn inside(edge: &BorderEdge, at: DVec2) -> f64 {
    let [a, b] = edge.ends;
    (b - a).normalize_or(DVec2::X).perp_dot(at - a)
}

/// The edge nearest to a point; of two that meet there the one that it lies straight before.
fn nearest<'a>(from: DVec2, edges: impl IntoIterator<Item = &'a Edge>) -> Option<&'a Edge> {
    let key = |edge: &Edge| on(&edge.border, from).0.distance_squared(from) - 1e-6 * inside(&edge.border, from).powi(2);
    edges.into_iter().min_by(|a, b| key(a).total_cmp(&key(b)))
}

/// The border of a panel as stitches see it: its edges, found by where they are.
pub(super) struct Border {
    edges: Vec<Edge>,
    tree: RTree<GeomWithData<Line<[f64; 2]>, usize>>,
    /// How far the cloth goes on beyond it at the most, mm.
    pub(super) turned_in: f64,
    /// How much of the cloth is left out or added at it at the most, mm.
    widest: f64,
}

impl Border {
    pub(super) fn new(edges: Vec<Edge>) -> Self {
        let line = |(i, edge): (usize, &Edge)| {
            let [a, b] = edge.border.ends.map(|p| p.to_array());
            GeomWithData::new(Line::new(a, b), i)
        };
        let tree = RTree::bulk_load(edges.iter().enumerate().map(line).collect());
        let turned_in = edges.iter().map(|e| -e.margin).fold(0.0, f64::max);
        let widest = edges.iter().map(|e| e.margin.abs()).fold(0.0, f64::max);
        Self { edges, tree, turned_in, widest }
    }

    pub(super) fn all(&self) -> &[Edge] {
        &self.edges
    }

    /// The edges within a distance of a point, and perhaps a few beyond, in their order.
    fn around(&self, from: DVec2, reach: f64) -> Vec<&Edge> {
        // By a little more, for the tree may round otherwise.
        let reach = 1.000_01 * reach + 1e-9;
        let mut found: Vec<usize> =
            self.tree.locate_within_distance(from.to_array(), reach * reach).map(|line| line.data).collect();
        found.sort_unstable();
        found.into_iter().map(|i| &self.edges[i]).collect()
    }

    /// The place on the border nearest to a point, moved by the margins of the edges around; the point itself if no border
    /// is within `reach`.
    pub(super) fn onto(&self, from: DVec2, reach: f64) -> Landing {
        let close = |e: &&Edge| on(&e.border, from).0.distance_squared(from) < (reach + e.margin.abs()).powi(2);
        let near: Vec<&Edge> = self.around(from, reach + self.widest).into_iter().filter(close).collect();
        let Some(Edge { border, margin, picked_up, hemmed, .. }) = nearest(from, near.iter().copied()) else {
            return Landing { at: from, free: false, picked_up: false, turned_in: false };
        };
        let mut at = on(border, from).0;
        if *margin < 0.0 {
            let d = border.direction();
            // Where it slants what is turned in ends in steps: nobody sees them, and no stitch is drawn out for them.
            let slants = d.x.abs().min(d.y.abs()) > LEVEL;
            at = if slants { from } else { at + d.perp() * *margin };
        }
        for _ in 0..4 {
            for Edge { border, margin, .. } in near.iter().filter(|e| e.margin >= 0.0) {
                let [a, b] = border.ends;
                let d = (b - a).normalize_or(DVec2::X);
                let (along, off) = ((at - a).dot(d), d.perp_dot(at - a));
                if (-1e-9..=a.distance(b) + 1e-9).contains(&along) && off < *margin && off > -2.0 * margin - 1e-9 {
                    at += d.perp() * (margin - off);
                }
            }
        }
        let free = border.sewn_to.is_none() && !hemmed;
        Landing { at, free, picked_up: *picked_up, turned_in: *margin < 0.0 }
    }

    /// The place of the border nearest to a point.
    pub(super) fn nearest_anchor(&self, from: DVec2) -> Anchor {
        let Some(line) = self.tree.nearest_neighbor(&from.to_array()) else { return Anchor::NONE };
        let distance = on(&self.edges[line.data].border, from).0.distance(from);
        nearest(from, self.around(from, distance)).map_or(Anchor::NONE, |Edge { border, .. }| {
            let ([a, b], t) = (border.anchors, on(border, from).1);
            let mix = |k: usize| a.share[k] + (b.share[k] - a.share[k]) * t as f32;
            Anchor { face: a.face, share: [mix(0), mix(1)] }
        })
    }

    /// Whether a point outside of the panel is on what is turned in at a seam.
    pub(super) fn is_turned_in(&self, at: DVec2) -> bool {
        /// The least cosine to an edge's normal of what lies straight before it.
        const BEFORE: f64 = 0.8;
        let around = self.around(at, self.turned_in / BEFORE);
        let Some(Edge { border, margin, .. }) = nearest(at, around) else { return false };
        let out = -inside(border, at);
        // Straight before the seam, not beside its ends.
        *margin < 0.0 && out > 0.0 && out < -margin && out > BEFORE * on(border, at).0.distance(at)
    }

    /// Whether an edge that is not hemmed is within a distance of a place.
    pub(super) fn is_near_other(&self, at: DVec2, within: f64) -> bool {
        self.around(at, within).iter().any(|e| !e.hemmed && on(&e.border, at).0.distance(at) < within)
    }

    /// The distance to the nearest of the seams that are turned in, and its kind, if there is one within a distance.
    pub(super) fn seam_within(&self, at: DVec2, within: f64) -> Option<(f64, SeamKind)> {
        let edge = nearest(at, self.around(at, within).into_iter().filter(|e| e.margin < 0.0))?;
        Some((on(&edge.border, at).0.distance(at), edge.seam)).filter(|(distance, _)| *distance < within)
    }

    /// Where a place lies against the nearest of the seams that are turned in, within a distance of it.
    pub(super) fn near_seam(&self, at: DVec2, within: f64, on_panel: bool) -> Option<NearSeam> {
        let edge = nearest(at, self.around(at, within).into_iter().filter(|e| e.margin < 0.0))?;
        let (to, share) = on(&edge.border, at);
        let distance = to.distance(at);
        let over = if on_panel { 0.0 } else { distance as f32 };
        let found =
            NearSeam { vertices: edge.border.vertices, share: share as f32, over, kind: edge.seam, first: edge.first };
        (distance < within).then_some(found)
    }
}

/// Whether the first row of a panel is picked up along an edge of another, `mate`, and not knitted into the heads of its last
/// row: that edge slants or goes up its wales.
pub(super) fn is_picked_up(edge: &BorderEdge, mate: &BorderEdge) -> bool {
    // The cloth is to the left of its edges: first rows stand on edges that go right, last ones hang from such as go left.
    let [own, other] = [edge, mate].map(BorderEdge::direction);
    own.x > own.y.abs() && !(other.x < 0.0 && other.y.abs() <= LEVEL)
}

/// Whether an edge goes rather up or down than across.
pub(super) fn is_side(edge: &BorderEdge) -> bool {
    let d = edge.ends[1] - edge.ends[0];
    d.y.abs() > d.x.abs()
}

/// Where a panel begins from the left, and its circumference, if its straight left and right sides are sewn together.
pub(super) fn closing(panel: u32, border: &[BorderEdge]) -> Option<(f64, f64)> {
    let sides: Vec<&BorderEdge> = border.iter().filter(|e| is_side(e)).collect();
    let low = sides.iter().flat_map(|e| e.ends).map(|p| p.x).fold(f64::INFINITY, f64::min);
    let high = sides.iter().flat_map(|e| e.ends).map(|p| p.x).fold(f64::NEG_INFINITY, f64::max);
    let width = high - low;
    let straight = |e: &&&BorderEdge| {
        let Some((other, edge)) = e.sewn_to else { return false };
        let Some(mate) = border.get(edge as usize).filter(|_| other == panel) else { return false };
        let level = (e.ends[0].y - mate.ends[1].y).abs().max((e.ends[1].y - mate.ends[0].y).abs());
        let apart = (e.ends[0].x - mate.ends[1].x).abs();
        level < 0.02 * width && apart > 0.98 * width
    };
    let sound = sides.iter().filter(straight).count();
    (!sides.is_empty() && width > 0.0 && sound == sides.len()).then_some((low, width))
}
