//! A panel divided into stitches: which it has room for, and where their corners lie.
//!
//! Corners of stitches at the panel's border are moved onto it, so that rows end where the cloth does, or so far beyond
//! it as is turned in at a seam.

use glam::DVec2;
use rayon::prelude::*;

use super::{
    border::{Border, Edge, Landing, NearSeam, closing, is_side},
    hem::{HemLine, NearHem, Turnup},
    seam::SeamKind,
    surface::{Anchor, BorderEdge, Finder, Surface, bounds},
};

/// Corners that are kept beyond the outermost stitches: what a cubic through four of them needs, and loops that reach out.
pub(super) const PAD: usize = 2;
/// Corners of a block that is looked at as a whole, along each side.
const BLOCK: usize = 16;

/// A flat panel, as it is divided into stitches and as threads are sewn through it.
pub(super) struct Ground<'a> {
    pub(super) finder: Finder<'a>,
    /// The border as stitches see it.
    pub(super) border: Border,
    /// The hemmed edges, if there are any.
    pub(super) hem: Option<HemLine>,
}

impl Ground<'_> {
    /// The place of the cloth at one of the flat panel, or on its border beside one outside; and whether it is inside.
    pub(super) fn anchor(&self, at: DVec2) -> (Anchor, bool) {
        let found = self.finder.find(at);
        let inside = found.is_some();
        (if inside { found } else { self.border.nearest_anchor(at) }, inside)
    }
}

/// How far corners with stitches on three sides go to the border.
const INNER: f64 = 0.35;

/// How a panel is divided.
#[derive(Clone, Copy, Debug)]
pub(super) struct Division<'a> {
    /// Width and height of a stitch, mm.
    pub(super) stitch: DVec2,
    /// Stitches and rows that repeat: a ring holds whole repeats.
    pub(super) repeat: [u32; 2],
    /// What is left across and up at free borders, mm: how far yarn reaches beyond its stitches, and what finishes it.
    pub(super) free: DVec2,
    /// What is left where panels are sewn together, by the kind of the seam, below (to the left) and above (to the right);
    /// negative is turned in.
    pub(super) sewn: [[DVec2; 2]; SeamKind::COUNT],
    /// The seam at each edge of the border.
    pub(super) seams: &'a [SeamKind],
    /// Whether the first row is picked up, at each edge.
    pub(super) picked_up: &'a [bool],
    /// How its free edges are hemmed, if they are, and which of the border's edges are.
    pub(super) turnup: Option<Turnup>,
    pub(super) hemmed: &'a [bool],
    /// Whether a panel that is sewn to itself goes round without a seam: knits do, of a weave no loom makes such a panel.
    pub(super) round: bool,
    /// Within this distance of a seam cloth is bent, mm.
    pub(super) bent: f64,
}

impl Division<'_> {
    /// A panel with its border.
    pub(super) fn ground<'s>(&self, surface: &'s Surface, panel: u32, border: &[BorderEdge]) -> Ground<'s> {
        // A panel sewn to itself from left to right is knitted in the round: its sides are no border.
        let round = self.closing(panel, border).is_some();
        let edge = |(i, border): (usize, &BorderEdge)| {
            let d = border.direction();
            let (seam, hemmed) = (self.seams[i], self.hemmed[i]);
            let sides = match border.sewn_to {
                _ if hemmed => [DVec2::ZERO; 2],
                None => [self.free; 2],
                Some(_) => self.sewn[seam as usize],
            };
            // The cloth is to the left of its edges.
            let [x, y] = [sides[usize::from(d.y > 0.0)].x, sides[usize::from(d.x < 0.0)].y];
            Edge {
                border: *border,
                margin: d.y.abs() * x + d.x.abs() * y,
                seam,
                first: border.is_first(panel, i),
                picked_up: self.picked_up[i],
                hemmed,
            }
        };
        let edges: Vec<Edge> = border.iter().enumerate().map(edge).filter(|e| !(round && is_side(&e.border))).collect();
        let hemmed: Vec<BorderEdge> = edges.iter().filter(|e| e.hemmed).map(|e| e.border).collect();
        let hem = self.turnup.and_then(|turnup| HemLine::new(&hemmed, turnup));
        Ground { finder: Finder::new(surface, panel), border: Border::new(edges), hem }
    }

    /// Where a panel that is knitted in the round begins from the left, and its circumference.
    fn closing(&self, panel: u32, border: &[BorderEdge]) -> Option<(f64, f64)> {
        closing(panel, border).filter(|_| self.round)
    }
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
    /// The same of the whole panel, where only a part is laid.
    whole: Vec<bool>,
    /// Where each corner lies.
    pub(super) anchors: Vec<Anchor>,
    /// Which corners are moved onto a free border.
    free: Vec<bool>,
    /// Which are moved onto an edge of another panel along which stitches are picked up; empty if none is.
    picked_up: Vec<bool>,
    /// Number of stitches.
    pub(super) stitches: u64,
    /// Stitches whose middle lies in the panel more than once.
    pub(super) doubled: usize,
    /// Columns and rows before those of the flat panel: they are turned in.
    pub(super) turned_in: [usize; 2],
    /// Corners near a seam that is turned in, in the order of their places.
    pub(super) near: Vec<(u32, NearSeam)>,
    /// Corners near a hem or in what lies under it, in the order of their places.
    pub(super) near_hem: Vec<(u32, NearHem)>,
}

impl Lattice {
    pub(super) fn new(
        ground: &Ground<'_>,
        panel: u32,
        border: &[BorderEdge],
        division: &Division<'_>,
        lays: &(impl Fn(Anchor) -> bool + Sync),
    ) -> Self {
        let Ground { finder, border: edges, hem } = ground;
        let around = division.closing(panel, border);
        let [mut low, mut high] = bounds(border);
        if border.is_empty() {
            (low, high) = (finder.low(), finder.low());
        }
        let flat_low = low;
        // What an edge along the box takes away, so that a rectangle is divided evenly.
        for axis in 0..2 {
            for (side, sign) in [(&mut low, 1.0), (&mut high, -1.0)] {
                let at = side[axis];
                let near = edges.all().iter().filter(|e| e.border.ends.iter().all(|p| (p[axis] - at).abs() < 0.5));
                // The widest of what is turned in, unless something is left out.
                let most = |a: f64, b: f64| if a.max(b) > 0.0 { a.max(b) } else { a.min(b) };
                side[axis] += sign * near.map(|e| e.margin).fold(0.0, most);
            }
        }
        if let Some([least, most]) = hem.as_ref().map(HemLine::bounds) {
            (low, high) = (low.min(least), high.max(most));
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
            whole: Vec::new(),
            anchors: Vec::new(),
            free: Vec::new(),
            picked_up: Vec::new(),
            stitches: 0,
            doubled: 0,
            turned_in: ((flat_low - low) / stitch).round().max(DVec2::ZERO).as_usizevec2().to_array(),
            near: Vec::new(),
            near_hem: Vec::new(),
        };
        let middle = |i: usize| {
            let (x, y) = (i % counts[0], i / counts[0]);
            low + stitch * DVec2::new(x as f64 + 0.5, y as f64 + 0.5)
        };
        let under = |i: usize| hem.as_ref()?.under(middle(i), stitch, finder, edges);
        let layers: Vec<(usize, bool)> = (0..counts[0] * counts[1])
            .into_par_iter()
            .with_min_len(256)
            .map(|i| match finder.find(middle(i)) {
                found if found.is_some() && lays(found) => (finder.layers(middle(i)).max(1), true),
                found if found.is_some() => (1, false),
                _ => under(i).map_or((0, true), |found| (1, lays(found))),
            })
            .collect();
        lattice.doubled = layers.iter().filter(|(n, laid)| *laid && *n > 1).count();
        lattice.keep(layers.iter().map(|(n, _)| *n > 0).collect(), &middle, ground);
        if layers.iter().any(|(_, laid)| !laid) {
            lattice.whole = std::mem::take(&mut lattice.kept);
            lattice.keep(layers.iter().map(|(n, laid)| *laid && *n > 0).collect(), &middle, ground);
        }
        lattice.stitches = lattice.kept.iter().filter(|k| **k).count() as u64;
        lattice.place(ground, low, division.bent);
        lattice
    }

    /// Keeps some stitches, and those beyond seams beside them.
    fn keep(&mut self, kept: Vec<bool>, middle: &(impl Fn(usize) -> DVec2 + Sync), ground: &Ground<'_>) {
        self.kept = kept;
        self.turn_in(middle, ground);
        self.drop_lonely();
    }

    /// Adds the stitches beyond seams that are turned in; where a hem turns these are cut away.
    fn turn_in(&mut self, middle: &(impl Fn(usize) -> DVec2 + Sync), ground: &Ground<'_>) {
        let Ground { border: edges, hem, .. } = ground;
        let bends = |at: DVec2| hem.as_ref().is_some_and(|hem| hem.near(at, hem.turnup.fold.begin(), 0.0).is_some());
        let steps = (edges.turned_in / self.stitch.min_element()).ceil() as usize;
        let columns = self.counts[0] as isize;
        for _ in 0..steps {
            let beyond = |&i: &usize| {
                let (x, y) = (i as isize % columns, i as isize / columns);
                let beside = || (-1..2).any(|dy| (-1..2).any(|dx| self.keeps(x + dx, y + dy)));
                !self.kept[i] && beside() && edges.is_turned_in(middle(i)) && !bends(middle(i))
            };
            let found: Vec<usize> = (0..self.kept.len()).into_par_iter().with_min_len(1024).filter(beyond).collect();
            if found.is_empty() {
                break;
            }
            found.into_iter().for_each(|i| self.kept[i] = true);
        }
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

    /// The run of a row that holds a stitch, as it is where all of the panel is laid.
    pub(super) fn whole_run(&self, line: usize, stitch: usize) -> [usize; 2] {
        let kept = if self.whole.is_empty() { &self.kept } else { &self.whole };
        let row = &kept[line * self.counts[0]..(line + 1) * self.counts[0]];
        let first = row[..stitch].iter().rposition(|k| !k).map_or(0, |i| i + 1);
        let last = row[stitch..].iter().position(|k| !k).map_or(row.len(), |i| stitch + i);
        [first, last.max(stitch + 1)]
    }

    pub(super) fn width(&self) -> usize {
        if self.ring { self.counts[0] } else { self.counts[0] + 1 + 2 * PAD }
    }

    pub(super) fn height(&self) -> usize {
        self.counts[1] + 1 + 2 * PAD
    }

    /// The place of a corner in memory; `None` far outside.
    #[inline]
    pub(super) fn index(&self, x: isize, y: isize) -> Option<usize> {
        let (w, h) = (self.width() as isize, self.height() as isize);
        let y = y + PAD as isize;
        let x = if self.ring { x.rem_euclid(w) } else { x + PAD as isize };
        (x >= 0 && x < w && y >= 0 && y < h).then_some((y * w + x) as usize)
    }

    /// Whether a corner lies on a border that is sewn to nothing.
    pub(super) fn is_free(&self, x: usize, y: usize) -> bool {
        self.index(x as isize, y as isize).is_some_and(|i| self.free[i])
    }

    /// How much of a stitch's foot, so far across it, is picked up along another panel's edge, from 0 to 1.
    pub(super) fn picked_up(&self, x: usize, y: usize, across: f32) -> f32 {
        if self.picked_up.is_empty() {
            return 0.0;
        }
        let at = |x: usize| {
            let picked_up = self.index(x as isize, y as isize).is_some_and(|i| self.picked_up[i]);
            f32::from(u8::from(picked_up))
        };
        let [left, right] = [at(x), at(x + 1)];
        left + (right - left) * across.clamp(0.0, 1.0)
    }

    /// Finds where each corner of a stitch lies.
    fn place(&mut self, ground: &Ground<'_>, low: DVec2, bent: f64) {
        let (edges, hem) = (&ground.border, ground.hem.as_ref());
        let (w, h) = (self.width(), self.height());
        let of_index = |i: usize| {
            let pad = if self.ring { 0 } else { PAD as isize };
            ((i % w) as isize - pad, (i / w) as isize - PAD as isize)
        };
        let stitches_at = |x: isize, y: isize| {
            [(-1, -1), (0, -1), (-1, 0), (0, 0)].iter().filter(|(dx, dy)| self.keeps(x + dx, y + dy)).count()
        };
        let grid = |x: isize, y: isize| low + self.stitch * DVec2::new(x as f64, y as f64);
        let (least, most) = (self.stitch.min_element(), self.stitch.max_element());
        let by_hem = hem.map_or(0.0, |hem| hem.turnup.fold.begin()) + (PAD + 1) as f64 * most;
        // By how much corners at the border move: onto what is left of it.
        let border: Vec<Option<(DVec2, Landing)>> = (0..w * h)
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
                let landing = edges.onto(here, 2.5 * self.stitch.max_element());
                // Neither what lies under a hem nor what ends above it is drawn out to an end.
                let near_hem = hem.and_then(|hem| hem.near(here, by_hem, by_hem));
                if near_hem.is_some_and(|near| landing.turned_in || f64::from(near.distance) < 0.5 * least) {
                    return None;
                }
                Some((share * (landing.at - here), landing))
            })
            .collect();
        let free: Vec<bool> = border.iter().map(|b| b.is_some_and(|b| b.1.free)).collect();
        let picked_up: Vec<bool> = border.iter().map(|b| b.is_some_and(|b| b.1.picked_up)).collect();
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
        let turned = edges.turned_in > 0.0;
        // Corners so many steps from the border may be near a seam.
        let steps = ((bent + edges.turned_in) / self.stitch.min_element()) as isize + 2;
        let by_border = |x: isize, y: isize| {
            turned
                && [(-steps, 0), (steps, 0), (0, -steps), (0, steps)].iter().any(|(dx, dy)| !self.keeps(x + dx, y + dy))
        };
        // Whole blocks of corners are far from a hem.
        let across = w.div_ceil(BLOCK);
        let by_hems = |hem: &HemLine, block: usize| {
            let (x, y) = of_index(BLOCK * (block / across * w + block % across));
            let (low, high) = (grid(x, y), grid(x + BLOCK as isize, y + BLOCK as isize));
            hem.is_around(low.midpoint(high), 0.5 * low.distance(high), by_hem, by_hem)
        };
        let blocks = 0..across * h.div_ceil(BLOCK);
        let hemmed: Vec<bool> =
            hem.map_or_else(Vec::new, |hem| blocks.into_par_iter().map(|block| by_hems(hem, block)).collect());
        let placed: Vec<(Anchor, Option<NearSeam>, Option<NearHem>)> = (0..w * h)
            .into_par_iter()
            .with_min_len(256)
            .map(|i| {
                let (x, y) = of_index(i);
                let hem = hem.filter(|_| hemmed[i / w / BLOCK * across + i % w / BLOCK]);
                let near_hem = hem.and_then(|hem| hem.near(grid(x, y), by_hem, by_hem));
                if stitches_at(x, y) == 0 {
                    return (Anchor::NONE, None, near_hem);
                }
                let mut here = grid(x, y) + moved[i].unwrap_or_default();
                if self.ring {
                    // The border at the seam is where the first corner lies, or a little outside by rounding.
                    here.x = here.x.max(low.x + 1e-6 * self.stitch.x);
                }
                let (anchor, inside) = ground.anchor(here);
                let on_panel = inside || near_hem.is_some_and(|near| near.distance < 0.0);
                let near = by_border(x, y).then(|| edges.near_seam(here, bent, on_panel)).flatten();
                (anchor, near, near_hem)
            })
            .collect();
        self.free = free;
        self.picked_up = if picked_up.contains(&true) { picked_up } else { Vec::new() };
        self.near = placed.iter().enumerate().filter_map(|(i, p)| Some((i as u32, p.1?))).collect();
        self.near_hem = placed.iter().enumerate().filter_map(|(i, p)| Some((i as u32, p.2?))).collect();
        self.anchors = placed.into_iter().map(|p| p.0).collect();
    }
}
