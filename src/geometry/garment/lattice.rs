//! A panel divided into stitches: which it has room for, and where their corners lie.
//!
//! Corners of stitches at the panel's border are moved onto it, so that rows end where the cloth does; those beyond go
//! straight on from those within.

use glam::{DVec2, Vec3};
use rayon::prelude::*;

use super::{
    strain::{Strain, UNSTRAINED},
    surface::{Anchor, BorderEdge, Finder, Pose, Surface, single},
};

/// Corners that are kept beyond the outermost stitches: what a cubic through four of them needs, and loops that reach out.
const PAD: usize = 2;

/// How far corners with stitches on three sides go to the border.
const INNER: f64 = 0.35;

/// How a panel is divided.
#[derive(Clone, Copy, Debug)]
pub(super) struct Division {
    /// Width and height of a stitch, mm.
    pub(super) stitch: DVec2,
    /// Stitches and rows that repeat: a ring holds whole repeats.
    pub(super) repeat: [u32; 2],
    /// What is left across and up at free borders, mm: how far yarn reaches beyond its stitches, and what finishes it.
    pub(super) free: DVec2,
    /// What is left where panels are sewn together.
    pub(super) sewn: DVec2,
}

/// The stitches of a panel.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
    pub(super) panel: u32,
    /// Columns and rows of the box around it.
    pub(super) counts: [usize; 2],
    /// Width and height of a stitch as the panel is cut, mm.
    pub(super) stitch: DVec2,
    /// Whether the last column is beside the first.
    pub(super) ring: bool,
    kept: Vec<bool>,
    anchors: Vec<Anchor>,
    /// Which corners are moved onto a free border.
    free: Vec<bool>,
    /// Number of stitches.
    pub(super) stitches: u64,
    /// Stitches whose middle lies in the panel more than once.
    pub(super) doubled: usize,
}

impl Lattice {
    pub(super) fn new(surface: &Surface, panel: u32, border: &[BorderEdge], division: &Division) -> Self {
        let finder = Finder::new(surface, panel);
        let around = closing(panel, border);
        let margin = |edge: &BorderEdge| {
            let d = (edge.ends[1] - edge.ends[0]).normalize_or(DVec2::X);
            let left = if edge.sewn_to.is_none() { division.free } else { division.sewn };
            d.y.abs() * left.x + d.x.abs() * left.y
        };
        // A panel sewn to itself from left to right is knitted in the round: its sides are no border.
        let edges: Vec<(BorderEdge, f64)> =
            border.iter().filter(|e| around.is_none() || !is_side(e)).map(|e| (*e, margin(e))).collect();
        let mut low = border.iter().flat_map(|e| e.ends).fold(DVec2::INFINITY, DVec2::min);
        let mut high = border.iter().flat_map(|e| e.ends).fold(DVec2::NEG_INFINITY, DVec2::max);
        if border.is_empty() {
            (low, high) = (finder.low(), finder.low());
        }
        // What an edge along the box takes away, so that a rectangle is divided evenly.
        for axis in 0..2 {
            for (side, sign) in [(&mut low, 1.0), (&mut high, -1.0)] {
                let at = side[axis];
                let near = edges.iter().filter(|(e, _)| e.ends.iter().all(|p| (p[axis] - at).abs() < 0.5));
                side[axis] += sign * near.map(|(_, m)| *m).fold(0.0, f64::max);
            }
        }
        let ring = around.is_some();
        if let Some((left, circumference)) = around {
            (low.x, high.x) = (left, left + circumference);
        }
        let extent = (high - low).max(DVec2::splat(1e-6));
        let whole = |length: f64, stitch: f64, repeat: u32| {
            let n = (length / stitch).round().max(1.0) as usize;
            let repeat = repeat as usize;
            if repeat > 1 { ((n + repeat / 2) / repeat).max(1) * repeat } else { n }
        };
        let counts = [
            whole(extent.x, division.stitch.x, if ring { division.repeat[0] } else { 1 }),
            whole(extent.y, division.stitch.y, 1),
        ];
        let stitch = extent / DVec2::new(counts[0] as f64, counts[1] as f64);
        let mut lattice = Self {
            panel,
            counts,
            stitch,
            ring,
            kept: Vec::new(),
            anchors: Vec::new(),
            free: Vec::new(),
            stitches: 0,
            doubled: 0,
        };
        let middle = |i: usize| {
            let (x, y) = (i % counts[0], i / counts[0]);
            low + stitch * DVec2::new(x as f64 + 0.5, y as f64 + 0.5)
        };
        let layers: Vec<usize> = (0..counts[0] * counts[1])
            .into_par_iter()
            .with_min_len(256)
            .map(|i| if finder.find(middle(i)).is_some() { finder.layers(middle(i)).max(1) } else { 0 })
            .collect();
        lattice.doubled = layers.iter().filter(|&&n| n > 1).count();
        lattice.kept = layers.iter().map(|&n| n > 0).collect();
        lattice.drop_lonely();
        lattice.stitches = lattice.kept.iter().filter(|k| **k).count() as u64;
        lattice.place(&finder, &edges, low);
        lattice
    }

    /// Leaves out stitches that have no neighbour in their row or none above and below: nothing would hold them.
    fn drop_lonely(&mut self) {
        for _ in 0..2 {
            let lonely: Vec<usize> = (0..self.kept.len())
                .filter(|&i| {
                    let (x, y) = ((i % self.counts[0]) as isize, (i / self.counts[0]) as isize);
                    let row = self.keeps(x - 1, y) || self.keeps(x + 1, y);
                    let column = self.keeps(x, y - 1) || self.keeps(x, y + 1);
                    self.kept[i] && !(row && column)
                })
                .collect();
            for i in lonely {
                self.kept[i] = false;
            }
        }
    }

    /// Whether there is a stitch.
    pub(super) fn keeps(&self, x: isize, y: isize) -> bool {
        let [columns, rows] = self.counts.map(|n| n as isize);
        let x = if self.ring { x.rem_euclid(columns) } else { x };
        (0..columns).contains(&x) && (0..rows).contains(&y) && self.kept[(y * columns + x) as usize]
    }

    /// Runs of stitches along a line: row `line` of axis 0, column `line` of axis 1, as first and one after the last.
    pub(super) fn runs(&self, axis: usize, line: usize) -> Vec<[usize; 2]> {
        let mut out: Vec<[usize; 2]> = Vec::new();
        for i in 0..self.counts[axis] {
            let at = if axis == 0 { line * self.counts[0] + i } else { i * self.counts[0] + line };
            if self.kept[at] {
                match out.last_mut() {
                    Some(run) if run[1] == i => run[1] = i + 1,
                    _ => out.push([i, i + 1]),
                }
            }
        }
        out
    }

    fn width(&self) -> usize {
        if self.ring { self.counts[0] } else { self.counts[0] + 1 + 2 * PAD }
    }

    fn height(&self) -> usize {
        self.counts[1] + 1 + 2 * PAD
    }

    /// The place of a corner in memory; `None` far outside.
    #[inline]
    fn index(&self, x: isize, y: isize) -> Option<usize> {
        let (w, h) = (self.width() as isize, self.height() as isize);
        let y = y + PAD as isize;
        let x = if self.ring { x.rem_euclid(w) } else { x + PAD as isize };
        (x >= 0 && x < w && y >= 0 && y < h).then_some((y * w + x) as usize)
    }

    /// Whether a corner lies on a border that is sewn to nothing.
    pub(super) fn is_free(&self, x: usize, y: usize) -> bool {
        self.index(x as isize, y as isize).is_some_and(|i| self.free[i])
    }

    /// Finds where each corner of a stitch lies.
    fn place(&mut self, finder: &Finder<'_>, edges: &[(BorderEdge, f64)], low: DVec2) {
        let (w, h) = (self.width(), self.height());
        let of_index = |i: usize| {
            let pad = if self.ring { 0 } else { PAD as isize };
            ((i % w) as isize - pad, (i / w) as isize - PAD as isize)
        };
        let stitches_at = |x: isize, y: isize| {
            [(-1, -1), (0, -1), (-1, 0), (0, 0)].iter().filter(|(dx, dy)| self.keeps(x + dx, y + dy)).count()
        };
        let grid = |x: isize, y: isize| low + self.stitch * DVec2::new(x as f64, y as f64);
        // By how much corners at the border move: onto what is left of it.
        let border: Vec<Option<(DVec2, bool)>> = (0..w * h)
            .into_par_iter()
            .with_min_len(256)
            .map(|i| {
                let (x, y) = of_index(i);
                let here = grid(x, y);
                // Where a row has a stitch more than the next, the inner corner goes only some of the way: all of it would
                // leave that stitch no room for its feet.
                let share = match stitches_at(x, y) {
                    0 | 4 => return None,
                    3 => INNER,
                    _ => 1.0,
                };
                let (to, free) = onto_border(here, edges, 2.5 * self.stitch.max_element());
                Some((share * (to - here), free))
            })
            .collect();
        let free: Vec<bool> = border.iter().map(|b| b.is_some_and(|b| b.1)).collect();
        let mut moved: Vec<Option<DVec2>> = border.into_iter().map(|b| b.map(|b| b.0)).collect();
        // Their neighbours inside follow by half, and those by half again.
        for _ in 0..2 {
            let next: Vec<Option<DVec2>> = (0..w * h)
                .into_par_iter()
                .with_min_len(256)
                .map(|i| {
                    let (x, y) = of_index(i);
                    if moved[i].is_some() || stitches_at(x, y) < 4 {
                        return moved[i];
                    }
                    let near = [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];
                    let around = || near.iter().filter_map(|(dx, dy)| moved[self.index(x + dx, y + dy)?]);
                    let count = around().count();
                    (count > 0).then(|| 0.5 * around().sum::<DVec2>() / count as f64)
                })
                .collect();
            moved = next;
        }
        let anchors = (0..w * h)
            .into_par_iter()
            .with_min_len(256)
            .map(|i| {
                let (x, y) = of_index(i);
                if stitches_at(x, y) == 0 {
                    return Anchor::NONE;
                }
                let mut here = grid(x, y) + moved[i].unwrap_or_default();
                if self.ring {
                    // The border at the seam is where the first corner lies, or a little outside by rounding.
                    here.x = here.x.max(low.x + 1e-6 * self.stitch.x);
                }
                let found = finder.find(here);
                if found.is_some() { found } else { nearest_anchor(here, edges) }
            })
            .collect();
        self.free = free;
        self.anchors = anchors;
    }

    /// The corners in one frame.
    pub(super) fn sheet(&self, surface: &Surface, pose: &Pose) -> Sheet<'_> {
        let place = |anchor: &Anchor| {
            if !anchor.is_some() {
                return (Vec3::NAN, Vec3::Y);
            }
            let (at, normal) = surface.at(pose, *anchor);
            (single(at), single(normal))
        };
        let (points, normals) = self.anchors.par_iter().with_min_len(256).map(place).unzip();
        let mut sheet = Sheet { lattice: self, points, normals };
        for _ in 0..PAD {
            sheet.extend();
        }
        sheet
    }
}

/// Whether an edge goes rather up or down than across.
fn is_side(edge: &BorderEdge) -> bool {
    let d = edge.ends[1] - edge.ends[0];
    d.y.abs() > d.x.abs()
}

/// Where a panel begins from the left, and its circumference, if its straight left and right sides are sewn together.
fn closing(panel: u32, border: &[BorderEdge]) -> Option<(f64, f64)> {
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

/// The place on the border nearest to a point, moved inside by the margins of the edges around, and whether the border is
/// free there; the point itself if no border is within `reach`.
fn onto_border(from: DVec2, edges: &[(BorderEdge, f64)], reach: f64) -> (DVec2, bool) {
    let on = |e: &BorderEdge| {
        let [a, b] = e.ends;
        let t = ((from - a).dot(b - a) / (b - a).length_squared().max(1e-300)).clamp(0.0, 1.0);
        a.lerp(b, t)
    };
    let near: Vec<&(BorderEdge, f64)> =
        edges.iter().filter(|(e, m)| on(e).distance_squared(from) < (reach + m).powi(2)).collect();
    let nearest = near.iter().map(|(e, _)| (on(e), e.sewn_to.is_none())).min_by(|a, b| {
        let key = |p: &(DVec2, bool)| p.0.distance_squared(from);
        key(a).total_cmp(&key(b))
    });
    let Some((mut at, free)) = nearest else { return (from, false) };
    for _ in 0..4 {
        for (e, margin) in &near {
            let [a, b] = e.ends;
            let d = (b - a).normalize_or(DVec2::X);
            let (along, off) = ((at - a).dot(d), d.perp_dot(at - a));
            if (-1e-9..=a.distance(b) + 1e-9).contains(&along) && off < *margin && off > -2.0 * margin - 1e-9 {
                at += d.perp() * (margin - off);
            }
        }
    }
    (at, free)
}

/// The place of the border nearest to a point.
fn nearest_anchor(from: DVec2, edges: &[(BorderEdge, f64)]) -> Anchor {
    let on = |(e, _): &(BorderEdge, f64)| {
        let [a, b] = e.ends;
        let t = ((from - a).dot(b - a) / (b - a).length_squared().max(1e-300)).clamp(0.0, 1.0);
        (a.lerp(b, t).distance_squared(from), t, e.anchors)
    };
    edges.iter().map(on).min_by(|a, b| a.0.total_cmp(&b.0)).map_or(Anchor::NONE, |(_, t, [a, b])| {
        let mix = |k: usize| a.share[k] + (b.share[k] - a.share[k]) * t as f32;
        Anchor { face: a.face, share: [mix(0), mix(1)] }
    })
}

/// The corners of a panel's stitches in one frame.
#[derive(Clone, Debug)]
pub(super) struct Sheet<'a> {
    pub(super) lattice: &'a Lattice,
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
}

impl Sheet<'_> {
    /// Goes on straight by one more corner on all sides.
    fn extend(&mut self) {
        let lattice = self.lattice;
        let (w, h) = (lattice.width(), lattice.height());
        let pad = if lattice.ring { 0 } else { PAD as isize };
        let made: Vec<(usize, Vec3, Vec3)> = (0..w * h)
            .into_par_iter()
            .with_min_len(1024)
            .filter(|&i| self.points[i].is_nan())
            .filter_map(|i| {
                let (x, y) = ((i % w) as isize - pad, (i / w) as isize - PAD as isize);
                let known = |dx: isize, dy: isize| lattice.index(x + dx, y + dy).filter(|&k| !self.points[k].is_nan());
                let mut best = (0.0, Vec3::ZERO, Vec3::ZERO);
                // Straight on from the two before counts most; slantwise or from one alone is a last resort.
                for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)] {
                    let Some(a) = known(dx, dy) else { continue };
                    let slant = if dx != 0 && dy != 0 { 0.05 } else { 1.0 };
                    let (at, weight) = match known(2 * dx, 2 * dy) {
                        Some(b) => (2.0 * self.points[a] - self.points[b], slant),
                        None => (self.points[a], 1e-4 * slant),
                    };
                    best = (best.0 + weight, best.1 + weight * at, best.2 + weight * self.normals[a]);
                }
                (best.0 > 0.0).then(|| (i, best.1 / best.0, best.2.normalize_or(Vec3::Y)))
            })
            .collect();
        for (i, point, normal) in made {
            (self.points[i], self.normals[i]) = (point, normal);
        }
    }

    fn corner(&self, x: isize, y: isize) -> Option<usize> {
        self.lattice.index(x, y).filter(|&i| !self.points[i].is_nan())
    }

    /// How a stitch is strained against its cut.
    pub(super) fn strain(&self, x: isize, y: isize) -> Strain {
        let corner = |dx, dy| self.corner(x + dx, y + dy).map(|i| self.points[i]);
        let (Some(a), Some(b), Some(c), Some(d)) = (corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)) else {
            return UNSTRAINED;
        };
        let size = self.lattice.stitch.as_vec2();
        let (across, up) = (0.5 * (b - a + d - c), 0.5 * (c - a + d - b));
        let lengths = [across.length(), up.length()];
        let sine = across.dot(up) / (lengths[0] * lengths[1]).max(1e-12);
        [lengths[0] / size.x, lengths[1] / size.y, sine]
    }

    /// Position and unit normal at a place, in stitches across and rows up.
    #[inline]
    pub(super) fn at(&self, x: f32, y: f32) -> (Vec3, Vec3) {
        let (i, j) = (x.floor(), y.floor());
        let (u, v) = (x - i, y - j);
        let (i, j) = (i as isize, j as isize);
        let (wu, wv) = (cubic(u), cubic(v));
        let mut point = Vec3::ZERO;
        for (row, wy) in wv.into_iter().enumerate() {
            for (column, wx) in wu.into_iter().enumerate() {
                let k = self.lattice.index(i + column as isize - 1, j + row as isize - 1);
                point += wx * wy * k.map_or(Vec3::NAN, |k| self.points[k]);
            }
        }
        // Normals turn slowly: a linear mean will do.
        let (mut flat, mut normal, mut weight) = (Vec3::ZERO, Vec3::ZERO, 0.0);
        for (dx, dy, share) in
            [(0, 0, (1.0 - u) * (1.0 - v)), (1, 0, u * (1.0 - v)), (0, 1, (1.0 - u) * v), (1, 1, u * v)]
        {
            if let Some(k) = self.corner(i + dx, j + dy) {
                flat += share * self.points[k];
                normal += share * self.normals[k];
                weight += share;
            }
        }
        if point.is_nan() {
            // Beyond what is known: the nearest that is.
            point = if weight > 1e-3 { flat / weight } else { self.nearest(x, y) };
        }
        (point, normal.normalize_or(Vec3::Y))
    }

    fn nearest(&self, x: f32, y: f32) -> Vec3 {
        let (i, j) = (x.round() as isize, y.round() as isize);
        (0..8_isize)
            .flat_map(|r| (-r..=r).flat_map(move |dy| (-r..=r).map(move |dx| (dx, dy))))
            .find_map(|(dx, dy)| self.corner(i + dx, j + dy))
            .map_or(Vec3::ZERO, |k| self.points[k])
    }
}

/// Weights of four values in a row, between the second and the third: Catmull-Rom.
#[inline]
fn cubic(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [0.5 * (2.0 * t2 - t - t3), 0.5 * (2.0 - 5.0 * t2 + 3.0 * t3), 0.5 * (t + 4.0 * t2 - 3.0 * t3), 0.5 * (t3 - t2)]
}
