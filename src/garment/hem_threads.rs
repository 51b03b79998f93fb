//! The threads that sew hems: where they go through the cloth and what lies under it, along all panels of an edge.

use std::collections::HashMap;

use glam::DVec2;
use rayon::prelude::*;

use super::{
    edges::{ClothEdge, Way, ways},
    fold::Fold,
    hem::{CORNER, Hem, HemKind},
    lattice::Ground,
    lay::LaidYarn,
    sewing::{STEP, Sewing, THREAD},
    sheet::Bends,
    surface::{Anchor, BorderEdge, Pose, Surface},
};
use crate::pattern::StrandKind;

/// How far apart the needles of a coverstitch are, mm.
const NEEDLES_APART: f64 = 5.6;
/// How far from the raw edge the nearest needle of a coverstitch goes through, and that of a lockstitch, mm; no less than a share
/// of a stitch of the cloth.
const COVERED: f64 = 1.2;
const LOCKED: f64 = 2.0;
const STITCHES_FROM_RAW_EDGE: f64 = 0.8;

/// A thread: where each of its control points lies on the cloth, and how high over it, mm.
#[derive(Clone, Debug)]
pub(super) struct HemThread {
    places: Vec<(Anchor, f64)>,
    closed: bool,
    radius: f64,
    panel: u32,
    pub(super) cloth: usize,
}

impl HemThread {
    /// It in a frame.
    pub(super) fn lay(&self, surface: &Surface, pose: &Pose) -> LaidYarn {
        let point = |(anchor, height): &(Anchor, f64)| {
            let (at, normal) = surface.at(pose, *anchor);
            at + normal * *height
        };
        LaidYarn {
            points: self.places.iter().map(point).collect(),
            closed: self.closed,
            radius: self.radius,
            sections: Vec::new(),
            kind: StrandKind::Course,
            panel: self.panel,
            color: 0,
            coordinates: Vec::new(),
        }
    }

    /// What of it is on a part of the cloth.
    pub(super) fn on(self, part: &impl Fn(Anchor) -> bool) -> Vec<Self> {
        if self.places.iter().all(|(anchor, _)| part(*anchor)) {
            return vec![self];
        }
        // A piece of fewer points is no curve.
        let runs = self.places.chunk_by(|a, b| part(a.0) == part(b.0)).filter(|run| run.len() > 3 && part(run[0].0));
        runs.map(|run| Self { places: run.to_vec(), closed: false, ..self }).collect()
    }
}

/// The threads of all hems, and for each kind and width of hem the length of the edges that it is at, mm.
pub(super) fn hem_threads(
    sewing: &Sewing,
    grounds: &[Ground<'_>],
    first: &Pose,
    borders: &[Vec<BorderEdge>],
) -> (Vec<HemThread>, Vec<(Hem, f64)>) {
    let mut of_hem: Vec<(Hem, Vec<ClothEdge>)> = Vec::new();
    let mut edges = HashMap::new();
    for (panel, border) in borders.iter().enumerate() {
        let Some(hem) = sewing.hem(panel) else { continue };
        for (i, edge) in border.iter().enumerate().filter(|(i, _)| sewing.is_hemmed(panel, *i)) {
            let free = (edge.vertices, panel as u32, None);
            match of_hem.iter_mut().find(|(other, _)| *other == hem) {
                Some((_, all)) => all.push(free),
                None => of_hem.push((hem, vec![free])),
            }
            edges.insert(edge.vertices, (panel, i));
        }
    }
    let panels: HashMap<usize, Panel<'_>> = (edges.values().map(|(panel, _)| *panel))
        .map(|panel| (panel, Panel::new(sewing, &grounds[panel], panel, &borders[panel])))
        .collect();
    let mut threads = Vec::new();
    let mut lengths = Vec::new();
    for (hem, free) in of_hem {
        let mut length = 0.0;
        for way in ways(&free) {
            let rail = Rail::new(way, &edges, &panels, first);
            length += rail.length;
            threads.extend(rail.sew(hem));
        }
        lengths.push((hem, length));
    }
    (threads, lengths)
}

/// A panel with hemmed edges.
struct Panel<'a> {
    ground: &'a Ground<'a>,
    edges: &'a [BorderEdge],
    fold: Fold,
    bends: &'a Bends,
    cloth: usize,
    diameter: f64,
    stitch: DVec2,
}

impl<'a> Panel<'a> {
    fn new(sewing: &'a Sewing, ground: &'a Ground<'a>, panel: usize, edges: &'a [BorderEdge]) -> Self {
        let (cloth, diameter) = sewing.cloth(panel);
        let bends = sewing.bends(cloth);
        let fold = bends.hem.expect("a panel with hemmed edges has a fold for them");
        Self { ground, edges, fold, bends, cloth, diameter, stitch: sewing.division(panel).stitch }
    }

    /// By how much what lies under the cloth is lower, for a seam's allowance lies between, mm.
    fn room(&self, at: DVec2) -> f64 {
        let seam = self.ground.border.seam_within(at, self.bends.widest_room());
        seam.map_or(0.0, |(distance, kind)| self.bends.rooms[kind as usize].at(distance))
    }

    /// By how much a line parallel to hemmed edges goes on further beyond the end of one, a millimetre for each that it is
    /// further inside: up to the seam there, or to the line of the other hem at a corner.
    fn lean(&self, edge: &BorderEdge, last: bool) -> f64 {
        let end = edge.ends[usize::from(last)];
        let Some(beside) = self.edges.iter().find(|other| other.ends[usize::from(!last)] == end) else { return 0.0 };
        let (along, inward) = (edge.direction(), edge.direction().perp());
        if beside.sewn_to.is_some() {
            let up = if last { beside.direction() } else { -beside.direction() };
            return (up.dot(along) / up.dot(inward).max(0.3)).clamp(-1.0, 1.0);
        }
        let other = beside.direction().perp();
        let cosine = inward.dot(other);
        if cosine > CORNER { 0.0 } else { (other.dot(along) / (1.0 + cosine).max(0.3)).clamp(-1.5, 1.5) }
    }
}

/// An edge on a [`Rail`].
struct Step {
    panel: usize,
    ends: [DVec2; 2],
    /// Unit vectors inwards at both ends.
    inward: [DVec2; 2],
    /// By how much lines further inside go on further at both ends: see [`Panel::lean`].
    lean: [f64; 2],
}

/// A hemmed edge over all its panels, walked by its length in the first frame.
struct Rail<'a> {
    panels: &'a HashMap<usize, Panel<'a>>,
    steps: Vec<Step>,
    /// Length up to each step, mm.
    starts: Vec<f64>,
    length: f64,
    closed: bool,
}

/// A place of a thread: mm along the edge, mm inside of it, height.
type Place = [f64; 3];

impl<'a> Rail<'a> {
    fn new(
        way: Way,
        edges: &HashMap<[u32; 2], (usize, usize)>,
        panels: &'a HashMap<usize, Panel<'a>>,
        first: &Pose,
    ) -> Self {
        let mut found: Vec<(usize, BorderEdge)> = Vec::new();
        for pair in way.vertices.windows(2) {
            let (panel, i) = edges[&[pair[0], pair[1]]];
            found.push((panel, panels[&panel].edges[i]));
        }
        let goes_on = |[(panel, edge), (other, next)]: [&(usize, BorderEdge); 2]| {
            panel == other && edge.ends[1] == next.ends[0] && edge.direction().dot(next.direction()) > CORNER
        };
        // A ring starts where a panel does.
        let breaks = |i: &usize| !goes_on([&found[i - 1], &found[*i]]);
        if let Some(start) = (1..found.len()).find(breaks).filter(|_| way.closed) {
            found.rotate_left(start);
        }
        let mut starts = Vec::with_capacity(found.len());
        let mut length = 0.0;
        for (_, edge) in &found {
            starts.push(length);
            let [a, b] = edge.vertices.map(|v| first.vertex(v).0);
            length += a.distance(b);
        }
        let mut steps = Vec::with_capacity(found.len());
        let mut from = 0;
        while from < found.len() {
            let panel = found[from].0;
            let run = 1 + found[from..].windows(2).take_while(|pair| goes_on([&pair[0], &pair[1]])).count();
            let edges: Vec<BorderEdge> = found[from..from + run].iter().map(|f| f.1).collect();
            let until = starts.get(from + run).copied().unwrap_or(length);
            let share = |at: f64| (at - starts[from]) / (until - starts[from]).max(1e-9);
            let shares: Vec<f64> =
                (from..=from + run).map(|i| share(starts.get(i).copied().unwrap_or(length))).collect();
            steps.extend(on_panel(panel, &panels[&panel], &edges, &shares));
            from += run;
        }
        Self { panels, steps, starts, length, closed: way.closed }
    }

    /// The panel at a length along the edge, and the place on it so far inside.
    fn at(&self, along: f64, inside: f64) -> (&'a Panel<'a>, DVec2) {
        let along = if self.closed { along.rem_euclid(self.length) } else { along.clamp(0.0, self.length) };
        let i = self.starts.partition_point(|s| *s <= along).max(1) - 1;
        let until = self.starts.get(i + 1).copied().unwrap_or(self.length);
        let t = ((along - self.starts[i]) / (until - self.starts[i]).max(1e-9)).clamp(0.0, 1.0);
        let Step { panel, ends: [a, b], inward: [first, last], lean } = &self.steps[i];
        let inward = first.lerp(*last, t).normalize_or(*first);
        let lean = lean[0] + t * (lean[1] - lean[0]);
        let along = (*b - *a).normalize_or(DVec2::X);
        (&self.panels[panel], a.lerp(*b, t) + inside * (inward + lean * along))
    }

    /// The threads of a hem.
    fn sew(&self, hem: Hem) -> Vec<HemThread> {
        let panel = &self.panels[&self.steps[0].panel];
        let (d, stitch) = (panel.diameter, panel.stitch.max_element());
        let radius = THREAD.clamp(0.15 * d, 0.5 * d);
        let line = |least: f64| (hem.width - least.max(STITCHES_FROM_RAW_EDGE * stitch)).max(0.5 * hem.width);
        let line = line(if hem.kind == HemKind::Lockstitch { LOCKED } else { COVERED });
        // Between corners the line is shorter than the edge.
        let leans: f64 = self.steps.iter().map(|s| s.lean[1] - s.lean[0]).sum();
        let length = (self.length + line * leans).max(0.1 * self.length);
        let count = (length / STEP.max(16.0 * radius)).round().max(1.0) as usize;
        let step = length / count as f64;
        let seam = Stitching { radius, step, count, width: hem.width, diameter: d, fold: panel.fold };
        let threads: Vec<Vec<Place>> = match hem.kind {
            HemKind::Coverstitch => {
                let lines = [(line - NEEDLES_APART).max(0.5 * line), line];
                vec![seam.needle(lines[0]), seam.needle(lines[1]), seam.looper(lines)]
            }
            HemKind::Lockstitch => [1.0, -1.0].map(|side| seam.crossing(line, side)).into(),
            HemKind::Folded => Vec::new(),
        };
        let bottom = panel.fold.skins()[1];
        let place = |&[along, inside, height]: &Place| {
            let (panel, at) = self.at(along * self.length / length, inside);
            // What is below goes down where what is turned in does, what is between by its share.
            let share = (height / bottom).clamp(0.0, 1.0);
            (panel.ground.anchor(at).0, height - share * panel.room(at))
        };
        let thread = |places: Vec<Place>| HemThread {
            places: places.par_iter().with_min_len(256).map(place).collect(),
            closed: self.closed,
            radius,
            panel: self.steps[0].panel as u32,
            cloth: panel.cloth,
        };
        threads.into_iter().map(thread).collect()
    }
}

/// Edges of one panel in a row; `shares` of their length lie before each and in all.
fn on_panel(number: usize, panel: &Panel<'_>, edges: &[BorderEdge], shares: &[f64]) -> Vec<Step> {
    let normal = |e: &BorderEdge| e.direction().perp();
    let ends = [panel.lean(&edges[0], false), panel.lean(&edges[edges.len() - 1], true)];
    let lean = |i: usize| ends[0] + shares[i] * (ends[1] - ends[0]);
    let inward = |i: usize| {
        let [before, after] = [i.max(1) - 1, i.min(edges.len() - 1)].map(|k| normal(&edges[k]));
        (before + after).normalize_or(after)
    };
    let step = |(i, edge): (usize, &BorderEdge)| Step {
        panel: number,
        ends: edge.ends,
        inward: [inward(i), inward(i + 1)],
        lean: [lean(i), lean(i + 1)],
    };
    edges.iter().enumerate().map(step).collect()
}

/// How threads go, by their radius and so many stitches of a length, mm.
struct Stitching {
    radius: f64,
    step: f64,
    count: usize,
    width: f64,
    /// Of the cloth's yarn.
    diameter: f64,
    fold: Fold,
}

impl Stitching {
    /// The places of all stitches; `one` has those of each, along from its hole.
    fn all(&self, one: &[Place]) -> Vec<Place> {
        let stitch = |k: usize| one.iter().map(move |[x, inside, z]| [x + k as f64 * self.step, *inside, *z]);
        (0..self.count).flat_map(stitch).collect()
    }

    /// A needle's thread: along the right side, down through both layers, round the looper's, and up through the same hole.
    fn needle(&self, line: f64) -> Vec<Place> {
        let (r, step) = (self.radius, self.step);
        let [top, bottom] = self.fold.skins();
        let middle = 0.5 * (top + bottom);
        let stitch = [
            [r, middle],
            [r, top - 1.5 * r],
            [3.0 * r, top + 0.3 * r],
            [0.3 * step, top + 0.6 * r],
            [0.5 * step, top + 0.6 * r],
            [0.7 * step, top + 0.6 * r],
            [step - 3.0 * r, top + 0.3 * r],
            [step - r, top - 1.5 * r],
            [step - r, middle],
            [step - 2.0 * r, bottom - r],
            [step - 2.0 * r, bottom - 4.0 * r],
            [step, bottom - 5.0 * r],
            [step + 2.0 * r, bottom - 4.0 * r],
            [step + 2.0 * r, bottom - r],
        ];
        self.all(&stitch.map(|[x, z]| [x, line, z]))
    }

    /// A looper's thread below: through the loops of one needle and round them, straight over to those of the other, round them
    /// over the raw edge, and slantwise back to the next.
    fn looper(&self, [low, high]: [f64; 2]) -> Vec<Place> {
        let (r, step) = (self.radius, self.step);
        let bottom = self.fold.skins()[1];
        let (gap, turn) = (high - low, (4.6 * r).min(0.4 * step));
        // Loops hold it close to the cloth; behind the raw edge it goes up to the layer above.
        let (held, flat) = (bottom - 1.3 * r, bottom - 1.1 * r);
        let raw = self.width + 0.5 * self.diameter;
        let (over, above) = (raw + 4.0 * r, 0.5 * (bottom + self.fold.wrong_side()));
        let before = low - 4.0 * r;
        self.all(&[
            [0.0, low + 0.2 * gap, flat],
            [0.0, low, held],
            [0.0, before, held],
            [0.5 * turn, before - r, flat],
            [turn, before, flat],
            [turn, low + 0.15 * gap, flat],
            [0.5 * turn, low + 0.5 * gap, flat],
            [0.0, high - 0.2 * gap, flat],
            [0.0, high, held],
            [0.0, raw, flat],
            [0.0, over, above],
            [0.5 * turn, over + r, above],
            [turn, over, above],
            [turn, raw, flat],
            [turn, high - 0.15 * gap, flat],
            [0.5 * (turn + step), low + 0.5 * gap, flat],
        ])
    }

    /// One of the two threads of a lockstitch: on the right side (1) or below (-1), and into the cloth to where it holds the other.
    fn crossing(&self, line: f64, side: f64) -> Vec<Place> {
        let (r, step) = (self.radius, self.step);
        let [top, bottom] = self.fold.skins();
        let middle = 0.5 * (top + bottom);
        let skin = if side > 0.0 { top } else { bottom };
        // It goes past the other on one side, across behind it, and back on the other side.
        let [before, after] = [line + side * 1.8 * r, line - side * 1.8 * r];
        let [near, behind] = [middle + side * 2.2 * r, middle - side * 2.2 * r];
        let (flat, within) = (skin + side * 0.4 * r, skin - side * r);
        self.all(&[
            [0.5 * r, after, behind],
            [2.4 * r, after, near],
            [1.5 * r, after, within],
            [3.0 * r, line, flat + side * 0.2 * r],
            [0.3 * step, line, flat],
            [0.5 * step, line, flat],
            [0.7 * step, line, flat],
            [step - 3.0 * r, line, flat + side * 0.2 * r],
            [step - 1.5 * r, before, within],
            [step - 2.4 * r, before, near],
            [step - 0.5 * r, before, behind],
        ])
    }
}
