//! Hems: free edges that are turned to the wrong side, where what is turned in lies under the cloth.
//!
//! A pattern's hem allowance is the mirror image of what it lies under, so that it fits there; so is this one.

use std::collections::HashMap;

use glam::{DVec2, Vec2};
use rstar::{
    RTree,
    primitives::{GeomWithData, Line},
};

use super::{
    border::Border,
    fold::Fold,
    surface::{Anchor, BorderEdge, Finder},
};

/// How a hem is sewn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HemKind {
    /// Two needles' threads on the right side, and a looper's to and fro between them over the raw edge.
    Coverstitch,
    /// A needle's thread on the right side and a bobbin's below, which cross within the cloth.
    Lockstitch,
    /// None: the raw edge lies in a seam, as that of a neckband which is folded.
    Folded,
}

impl HemKind {
    /// How it is told.
    pub(super) fn told(self) -> &'static str {
        match self {
            Self::Coverstitch => "sewn by a coverstitch",
            Self::Lockstitch => "sewn by a lockstitch",
            Self::Folded => "folded",
        }
    }
}

/// How free edges are hemmed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hem {
    /// How it is sewn.
    pub kind: HemKind,
    /// How far inside of the edge the raw edge lies, mm.
    pub width: f64,
}

/// How the cloth of some panels is hemmed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turnup {
    pub(super) hem: Hem,
    pub(super) fold: Fold,
    /// What is left out beside seams and other edges under the cloth, mm.
    pub(super) aside: f64,
}

/// A place near a hemmed edge, or beyond it.
#[derive(Clone, Copy, Debug)]
pub(super) struct NearHem {
    /// Ends of the edge among the points of the sewn mesh.
    pub(super) vertices: [u32; 2],
    /// How far along the edge it is nearest, from 0 to 1, and beyond where it is straight before its end.
    pub(super) share: f32,
    /// Distance from the edge on the cloth, mm, negative beyond it.
    pub(super) distance: f32,
    /// Unit vector from the edge in the flat panel.
    pub(super) inward: Vec2,
}

/// A hemmed edge with the directions inwards at its ends, and how far it goes on straight beyond them, in its lengths.
struct HemEdge {
    border: BorderEdge,
    inward: [DVec2; 2],
    goes_on: [f64; 2],
}

impl HemEdge {
    /// The nearest place of it, and how far along it is.
    fn on(&self, from: DVec2) -> (DVec2, f64) {
        let [a, b] = self.border.ends;
        let t = (from - a).dot(b - a) / (b - a).length_squared().max(1e-300);
        let t = t.clamp(-self.goes_on[0], 1.0 + self.goes_on[1]);
        (a + (b - a) * t, t)
    }
}

/// Two edges that meet at less than this cosine have a corner between them.
pub(super) const CORNER: f64 = 0.8;

/// The hemmed edges of a panel, found by where they are.
pub(super) struct HemLine {
    edges: Vec<HemEdge>,
    tree: RTree<GeomWithData<Line<[f64; 2]>, usize>>,
    /// The box around them, as far as they go on.
    low: DVec2,
    high: DVec2,
    pub(super) turnup: Turnup,
    /// How far the cloth goes on beyond them, mm.
    pub(super) over: f64,
}

impl HemLine {
    /// Of edges of a panel's border; `None` if there are none.
    pub(super) fn new(edges: &[BorderEdge], turnup: Turnup) -> Option<Self> {
        if edges.is_empty() {
            return None;
        }
        let key = |p: DVec2| p.to_array().map(f64::to_bits);
        let firsts: HashMap<_, usize> = edges.iter().enumerate().map(|(i, e)| (key(e.ends[0]), i)).collect();
        let lasts: HashMap<_, usize> = edges.iter().enumerate().map(|(i, e)| (key(e.ends[1]), i)).collect();
        let over = turnup.fold.beyond(turnup.hem.width);
        let edge = |border: &BorderEdge| {
            let normal = |e: &BorderEdge| e.direction().perp();
            let neighbours = [lasts.get(&key(border.ends[0])), firsts.get(&key(border.ends[1]))];
            let own = normal(border);
            let inward = neighbours.map(|other| match other.map(|&i| normal(&edges[i])) {
                Some(other) if other.dot(own) > CORNER => (own + other).normalize_or(own),
                _ => own,
            });
            // Seen from a seam's allowance, or from what lies under a panel that becomes wider, the edge goes on.
            let length = border.ends[0].distance(border.ends[1]).max(1e-9);
            let goes_on = neighbours.map(|other| if other.is_none() { 2.0 * over / length } else { 0.0 });
            HemEdge { border: *border, inward, goes_on }
        };
        let edges: Vec<HemEdge> = edges.iter().map(edge).collect();
        let ends = |edge: &HemEdge| {
            let [a, b] = edge.border.ends;
            [a - (b - a) * edge.goes_on[0], b + (b - a) * edge.goes_on[1]]
        };
        let line = |(i, edge): (usize, &HemEdge)| {
            let [a, b] = ends(edge).map(|p| p.to_array());
            GeomWithData::new(Line::new(a, b), i)
        };
        let tree = RTree::bulk_load(edges.iter().enumerate().map(line).collect());
        let all = || edges.iter().flat_map(ends);
        let low = all().fold(DVec2::INFINITY, DVec2::min);
        let high = all().fold(DVec2::NEG_INFINITY, DVec2::max);
        Some(Self { tree, low, high, turnup, over, edges })
    }

    /// The box around what is turned in, as far as it lies beyond the edges.
    pub(super) fn bounds(&self) -> [DVec2; 2] {
        let beyond = |e: &HemEdge| [0, 1].map(|k| e.border.ends[k] - e.inward[k] * self.over);
        let all = || self.edges.iter().flat_map(beyond);
        [all().fold(DVec2::INFINITY, DVec2::min), all().fold(DVec2::NEG_INFINITY, DVec2::max)]
    }

    /// How far from an edge a place may lie for which [`Self::near`] tells anything.
    fn reach(&self, inside: f64, beyond: f64) -> f64 {
        inside.max(self.over + beyond)
    }

    /// Whether [`Self::near`] may tell anything of places within a distance of one.
    pub(super) fn is_around(&self, at: DVec2, distance: f64, inside: f64, beyond: f64) -> bool {
        let reach = distance + self.reach(inside, beyond);
        self.tree.locate_within_distance(at.to_array(), reach * reach).next().is_some()
    }

    /// Where a place lies against the nearest of the edges, if it is within what is turned in by one of them or so far inside.
    pub(super) fn near(&self, at: DVec2, inside: f64, beyond: f64) -> Option<NearHem> {
        let reach = self.reach(inside, beyond);
        if (at - self.low + reach).min(self.high - at + reach).min_element() < 0.0 {
            return None;
        }
        let mut found: Vec<usize> =
            self.tree.locate_within_distance(at.to_array(), reach * reach).map(|line| line.data).collect();
        found.sort_unstable();
        let signed = |edge: &HemEdge| {
            let (on, t) = edge.on(at);
            let [a, b] = edge.border.ends;
            let off = (b - a).perp_dot(at - a).signum();
            (off * on.distance(at), t)
        };
        let nearest = found.into_iter().map(|i| (&self.edges[i], signed(&self.edges[i])));
        let (edge, (distance, t)) = nearest.min_by(|(_, a), (_, b)| a.0.abs().total_cmp(&b.0.abs()))?;
        let [first, last] = edge.inward;
        let inward = first.lerp(last, t.clamp(0.0, 1.0)).normalize_or(first);
        (distance <= inside && -distance <= self.over + beyond).then(|| NearHem {
            vertices: edge.border.vertices,
            share: t as f32,
            distance: distance as f32,
            inward: inward.as_vec2(),
        })
    }

    /// Where on the panel a place beyond it comes to lie under the cloth, if it is one that is turned in there; the middle of a stitch.
    pub(super) fn under(&self, at: DVec2, stitch: DVec2, finder: &Finder<'_>, border: &Border) -> Option<Anchor> {
        let near = self.near(at, 0.0, 0.0)?;
        let from = f64::from(near.distance);
        let to = self.turnup.fold.bend(from, 0.0, 1.0)[0];
        let place = at + near.inward.as_dvec2() * (to - from);
        // Where two hems meet at a corner each takes its half.
        let (low, high) = (stitch.min_element(), stitch.max_element());
        let own = self.near(place, to + low, 0.0).is_some_and(|other| f64::from(other.distance) > to - 0.5 * low);
        let found = finder.find(place);
        (own && found.is_some() && !border.is_near_other(place, self.turnup.aside + 0.5 * high)).then_some(found)
    }

    /// Which share of the edges' length has no room for a hem of some width: the panel has no cloth so far inside, or an edge
    /// across it is hemmed and lies nearer, so that each has its half.
    pub(super) fn without_room(&self, finder: &Finder<'_>, width: f64) -> NoRoom {
        let (mut all, mut bare, mut met) = (0.0, 0.0, 0.0);
        for edge in &self.edges {
            let [a, b] = edge.border.ends;
            let length = a.distance(b);
            let at = a.midpoint(b) + edge.inward[0] * width;
            all += length;
            if !finder.find(at).is_some() {
                bare += length;
            } else if self.is_met(edge, at, width) {
                met += length;
            }
        }
        let share = |part: f64| part / f64::max(all, 1e-9);
        NoRoom { bare: share(bare), met: share(met) }
    }

    /// Whether a place so far inside of an edge lies nearer to one across.
    fn is_met(&self, edge: &HemEdge, at: DVec2, width: f64) -> bool {
        let within = (1.0 - 1e-6) * width;
        let inward = edge.border.direction().perp();
        let mut near = self.tree.locate_within_distance(at.to_array(), within * within);
        near.any(|line| self.edges[line.data].border.direction().perp().dot(inward) < ACROSS)
    }

    /// The widest hem for which no more than a share of the edges' length has no room, mm.
    pub(super) fn widest(&self, finder: &Finder<'_>, share: f64) -> f64 {
        let (mut fits, mut fails) = (0.0, self.turnup.hem.width);
        for _ in 0..24 {
            let width = 0.5 * (fits + fails);
            let NoRoom { bare, met } = self.without_room(finder, width);
            *(if bare > share || met > share { &mut fails } else { &mut fits }) = width;
        }
        fits
    }
}

/// Two edges face each other across a panel if their directions inwards are at less than this cosine.
const ACROSS: f64 = -0.5;

/// Shares of the length of hemmed edges.
pub(super) struct NoRoom {
    /// Where the panel has no cloth.
    pub(super) bare: f64,
    /// Where a hem across has it.
    pub(super) met: f64,
}
