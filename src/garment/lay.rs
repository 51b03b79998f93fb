//! Yarns of a panel: rows across it, turned at their ends, or warps and wefts.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{
    floats::{FLOATING, Lanes, Strand, Stranded, Way, led},
    run::{Run, chains},
    sheet::Sheet,
    strain::{Shape, Shapes, Strain, UNSTRAINED},
};
use crate::{
    geometry::curve::{Basis, Curve},
    math::{
        sampler::{Stream, hash2},
        special::smooth_step,
        warp::normal,
    },
    pattern::{StrandKind, tile::Section},
};

/// A yarn as it lies, a B-spline.
#[derive(Clone, Debug)]
pub(crate) struct LaidYarn {
    /// Control points, mm.
    pub points: Vec<DVec3>,
    /// Whether the last is followed by the first.
    pub closed: bool,
    /// Outer radius where it is round, mm.
    pub radius: f64,
    /// Its section at each control point; empty if it is round everywhere.
    pub sections: Vec<Section>,
    /// What it is in the cloth.
    pub kind: StrandKind,
    /// On which panel it lies; a seam's is one of both.
    pub panel: u32,
    /// Its colour, where each colour is a yarn of its own; else 0.
    pub color: u16,
    /// At each control point its stitch and row from the panel's lower left corner; empty where it was not asked for.
    pub coordinates: Vec<[f32; 2]>,
}

impl LaidYarn {
    /// It as a curve, with half of its section's longer axis at each control point.
    pub(crate) fn into_curve(self) -> (Curve, Vec<f64>) {
        let Self { points, closed, radius, sections, .. } = self;
        let curve = |points, flattening| Curve { basis: Basis::BSpline, closed, points, radii: None, flattening };
        if sections.is_empty() {
            let radii = vec![radius; points.len()];
            return (curve(points, None), radii);
        }
        let (axes, widths) = sections.iter().map(|s| (s.short_axis, f64::from(s.half_width))).unzip();
        (curve(points, Some(axes)), widths)
    }
}

/// How loops differ from stitch to stitch and from row to row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tension {
    /// Start of what is random.
    pub seed: u32,
    /// Standard deviation of the size of loops.
    pub spread: f64,
}

/// Where on its way a yarn is.
#[derive(Clone, Copy)]
enum On {
    /// At a control point of a stitch that is strained so.
    Stitch(usize, usize, Strain),
    /// Behind a stitch, or between its row and another.
    Beside(usize),
}

/// So much of a turn's way do cut threads go beyond their last stitch.
pub(super) const CUT_END: f64 = 0.65;
/// The end of a knit's yarn goes back so far behind where it came from, in diameters.
const TAIL_DEEP: f32 = 1.1;
/// Up to this height of its first row, in rows, a stitch that is picked up comes from the wrong side.
const PICKED_UP: f32 = 0.6;
/// Its feet go this share of the way to so far behind the middle of the deepest of the cloth's yarns, in diameters: not all of
/// them, for in one layer a rib's feet would bend too tightly.
const FOOT_BEHIND: (f32, f64) = (0.7, 0.4);

/// What a panel's yarns are, beside their shapes.
#[derive(Clone, Copy)]
pub(super) struct Laying<'a> {
    pub(super) tension: Option<Tension>,
    /// The colours, where each is a yarn of its own.
    pub(super) stranded: Option<&'a Stranded>,
    /// Whether yarns know their stitches.
    pub(super) coordinates: bool,
}

/// Lays the yarns of a panel in several frames at once: for each frame the same yarns.
pub(super) fn lay(sheets: &[Sheet<'_>], shapes: &Shapes, laying: Laying<'_>) -> Vec<Vec<LaidYarn>> {
    let lattice = sheets[0].lattice;
    let of_axis = |axis: usize| {
        let chains = chains(lattice, axis, shapes.is_woven()).into_iter();
        chains.flat_map(|chain| match laying.stranded {
            Some(stranded) => Way::of_colors(lattice, &chain, stranded),
            None => vec![Way::plain(chain)],
        })
    };
    let ways: Vec<(usize, Way)> = (0..2)
        .filter(|&axis| shapes.has_axis(axis))
        .flat_map(|axis| of_axis(axis).map(move |way| (axis, way)))
        .collect();
    // What repeats is centred on the panel, but where it goes round.
    let shift = [0, 1].map(|axis| {
        let (n, repeat) = (lattice.counts[axis], shapes.counts[axis]);
        if axis == 0 && !lattice.ring { (repeat - (n % repeat) / 2) % repeat } else { 0 }
    });
    let lanes = Lanes::new(shapes, lattice);
    let frames = sheets.iter().enumerate().map(|(frame, sheet)| {
        let one = |(axis, way): &(usize, Way)| {
            let mut layer = Layer {
                sheet,
                shapes,
                shift,
                lanes,
                tension: laying.tension,
                axis: *axis,
                out: Vec::new(),
                sections: None,
                places: laying.coordinates.then(Vec::new),
            };
            let (closed, shape) = (way.runs[0].ring, layer.shape(way.runs[0].line));
            // They move with the yarn: one frame tells them.
            layer.sections = (frame == 0 && shape.is_pressed()).then(Vec::new);
            layer.way(way);
            LaidYarn {
                points: layer.out,
                closed,
                radius: shape.radius,
                sections: layer.sections.unwrap_or_default(),
                kind: shape.kind,
                panel: lattice.panel,
                color: way.color,
                coordinates: layer.places.unwrap_or_default(),
            }
        };
        ways.par_iter().map(one).collect()
    });
    frames.collect()
}

struct Layer<'a> {
    sheet: &'a Sheet<'a>,
    shapes: &'a Shapes,
    shift: [usize; 2],
    lanes: Lanes,
    tension: Option<Tension>,
    axis: usize,
    out: Vec<DVec3>,
    sections: Option<Vec<Section>>,
    places: Option<Vec<[f32; 2]>>,
}

impl<'a> Layer<'a> {
    fn shape(&self, line: usize) -> &'a Shape {
        let shape = self.shapes.of_line(self.axis, line + self.shift[1 - self.axis]);
        shape.expect("a tile has a yarn for each of its lines")
    }

    /// The section of a yarn of a run at a place of it.
    fn section(&self, run: &Run, on: On) -> Section {
        let shape = self.shape(run.line);
        let (s, k, strain) = match on {
            On::Stitch(s, k, strain) => (s, k, strain),
            On::Beside(_) if shape.kind == StrandKind::Course => return self.shapes.beside,
            On::Beside(s) => (s, 0, UNSTRAINED),
        };
        self.shapes.section(shape, s + self.shift[self.axis], k, strain)
    }

    /// A place in stitches across, rows up, mm out.
    fn push(&mut self, p: Vec3, run: &Run, on: On) {
        let pressed = self.sections.is_some().then(|| self.section(run, on));
        let at = if let (Some(sections), Some(Section { half_width, short_axis })) = (&mut self.sections, pressed) {
            // Where the axis points to on the cloth as it lies, a part of the yarn's width away.
            let stitch = self.sheet.lattice.stitch.extend(1.0).as_vec3();
            let step = 0.25 * half_width * short_axis / stitch;
            let (at, direction) = self.sheet.place_and_direction(p, step);
            let short_axis = direction.normalize_or(Vec3::Y) * short_axis.length();
            sections.push(Section { half_width, short_axis });
            at
        } else {
            self.sheet.place(p)
        };
        self.out.push(at.as_dvec3());
        if let Some(places) = &mut self.places {
            // Colours are by stitches of the panel: what reaches over the border is of the last one.
            let mut place = [p.x, p.y];
            place[self.axis] = place[self.axis].clamp(run.first as f32 + 0.01, run.last as f32 - 0.01);
            place[1 - self.axis] = run.line as f32 + 0.5;
            if self.shapes.strands[0].kind == StrandKind::Course {
                let head = (p.y - run.line as f32).clamp(-0.2, 1.2);
                place[1] = run.line as f32 + head.clamp(0.02, 0.98);
            }
            // They are counted from the flat panel's corner: what is turned in has the colour of the stitch beside it.
            let before = self.sheet.lattice.turned_in.map(|n| n as f32);
            places.push([0, 1].map(|k| (place[k] - before[k]).max(0.02)));
        }
    }

    fn way(&mut self, way: &Way) {
        let runs = &way.runs;
        if !runs[0].ring {
            self.tail(&runs[0], way.strand(0), true);
        }
        for (i, run) in runs.iter().enumerate() {
            self.stitches(run, way.strand(i));
            if let Some(next) = runs.get(i + 1) {
                self.turn([(run, way.strand(i)), (next, way.strand(i + 1))]);
            }
        }
        let last = runs.len() - 1;
        if !runs[last].ring {
            self.tail(&runs[last], way.strand(last), false);
        }
    }

    /// All control points of a run's stitches.
    fn stitches(&mut self, run: &Run, strand: Option<Strand<'_>>) {
        let (sheet, axis) = (self.sheet, self.axis);
        let strain = |s: usize| {
            let (x, y) = if axis == 0 { (s, run.line) } else { (run.line, s) };
            sheet.strain(x as isize, y as isize)
        };
        let per_stitch = self.shape(run.line).per_stitch;
        let count = run.last - run.first;
        let order = |i: usize| if run.backwards { run.last - 1 - i } else { run.first + i };
        let (mut before, mut here) = (strain(order(0)), strain(order(0)));
        // The end of a run's last stitch is the start of one that is not there.
        let far_end = |layer: &mut Self, strain| {
            let place = layer.corner(run.line, run.last, strand, strain);
            layer.push(place, run, On::Stitch(run.last, 0, strain));
        };
        if run.backwards {
            far_end(self, here);
        }
        for i in 0..count {
            let s = order(i);
            let next = strain(order((i + 1).min(count - 1)));
            let floats = strand.filter(|strand| !strand.row.knits(strand.color, s));
            for k in 0..if floats.is_some() { FLOATING.len() } else { per_stitch } {
                if let Some(strand) = floats {
                    let place = self.float(run, s, k, strand);
                    self.push(place, run, On::Beside(s));
                    continue;
                }
                // Strain changes evenly from the middle of a stitch to that of the next.
                let t = (k as f32 + 0.5) / per_stitch as f32 - 0.5;
                let (other, share) = if t < 0.0 { (before, -t) } else { (next, t) };
                let mixed = [0, 1, 2].map(|a| here[a] + share * (other[a] - here[a]));
                let k = if run.backwards { per_stitch - 1 - k } else { k };
                let place = self.place(run.line, s, k, mixed) + self.led(run.line, s, k, strand);
                self.push(place, run, On::Stitch(s, k, mixed));
            }
            (before, here) = (here, next);
        }
        if !run.ring && !run.backwards {
            far_end(self, here);
        }
    }

    /// Where a yarn is at the start of a stitch; also of one after the last.
    fn corner(&self, line: usize, s: usize, strand: Option<Strand<'_>>, strain: Strain) -> Vec3 {
        let base = self.place(line, s, 0, strain);
        strand.and_then(|strand| self.lanes.joint(strand, line, s)).unwrap_or(base)
    }

    /// Control point k of the way behind a stitch, in the order of the run.
    fn float(&self, run: &Run, s: usize, k: usize, strand: Strand<'_>) -> Vec3 {
        let k = if run.backwards { FLOATING.len() - 1 - k } else { k };
        match k {
            0 => self.corner(run.line, s, Some(strand), UNSTRAINED),
            _ => self.lanes.float(strand, run.line, s as f32 + FLOATING[k]),
        }
    }

    /// By how much control point k of a stitch is led to what its yarn does before and after.
    fn led(&self, line: usize, s: usize, k: usize, strand: Option<Strand<'_>>) -> Vec3 {
        let along = k as f32 / self.shape(line).per_stitch as f32;
        let to = |(joint, share): (usize, f32)| {
            let strand = strand.filter(|_| led(share) > 0.0)?;
            let place = self.lanes.joint(strand, line, joint)?;
            Some((place - self.place(line, joint, 0, UNSTRAINED)) * led(share))
        };
        [(s, along), (s + 1, 1.0 - along)].into_iter().filter_map(to).sum()
    }

    /// Control point k of stitch s of a line.
    fn place(&self, line: usize, s: usize, k: usize, strain: Strain) -> Vec3 {
        let shape = self.shape(line);
        let count = self.shapes.counts[self.axis];
        let stitch = s + self.shift[self.axis];
        let mut p = self.shapes.control(shape, (stitch % count) * shape.per_stitch + k, strain);
        p[self.axis] += (stitch / count * count) as f32 - self.shift[self.axis] as f32;
        p[1 - self.axis] += line as f32 - shape.index as f32;
        if let Some(tension) = self.tension {
            let deviate = |what: u32, which: u32| {
                normal(Stream::new(hash2(hash2(tension.seed ^ self.sheet.lattice.panel, what), which)).next())
            };
            let own = deviate(line as u32, 1 + s as u32) * 0.8 + deviate(line as u32 ^ 0x5bd1_e995, 0) * 0.6;
            let size = 1.0 + tension.spread as f32 * own;
            let middle = line as f32 + 0.5;
            p[1 - self.axis] = middle + (p[1 - self.axis] - middle) * size;
        }
        if self.axis == 0 {
            // Feet are drawn through to the wrong side of the edge along which they are picked up.
            let across = p.x - s as f32;
            let foot = 1.0 - smooth_step(f64::from((p.y - line as f32) / PICKED_UP)) as f32;
            let share = foot * self.sheet.lattice.picked_up(s, line, across);
            let (most, deep) = FOOT_BEHIND;
            let behind = (self.shapes.heights[0] - deep * self.shapes.diameter) as f32;
            p.z += share * most * (behind - p.z).min(0.0);
        }
        p
    }

    /// By how much a turn goes beyond the last stitch, in stitches: half a round of the way to the next row.
    fn bulge(&self) -> f32 {
        let stitch = self.sheet.lattice.stitch;
        let [along, across] = [stitch[self.axis], stitch[1 - self.axis]];
        (turn(across, self.shapes.diameter) / along) as f32
    }

    /// From the end of a run round to the start of the next that the yarn knits.
    fn turn(&mut self, [(run, strand), (next, beside)]: [(&Run, Option<Strand<'_>>); 2]) {
        let outward = if run.backwards { -1.0 } else { 1.0 };
        let corner = if self.axis == 0 { [run.end(), run.line + 1] } else { [run.line + 1, run.end()] };
        // Where panels lie beside each other the selvedge goes to the wrong side.
        let sewn = !self.sheet.lattice.is_free(corner[0], corner[1]) && !self.sheet.is_turned_in(corner[0], corner[1]);
        let bulge = self.bulge() * outward * if sewn { 0.3 } else { 1.0 };
        let d = self.shapes.diameter as f32;
        // Colours lie behind each other there, and behind all what is carried over rows.
        let rows = next.line - run.line;
        let layer = strand.map_or(0, |strand| strand.rank()) + usize::from(rows > 1);
        let deep = if sewn { 1.5 * d } else { 0.0 } + d * layer as f32;
        let from = self.corner(run.line, run.end(), strand, UNSTRAINED);
        let to = self.corner(next.line, next.start(), beside, UNSTRAINED);
        let near = 0.12 / rows as f32;
        let between = (1..2 * rows).map(|i| i as f32 / (2 * rows) as f32);
        let shares = std::iter::once(near).chain(between).chain([1.0 - near]);
        // Where the next row ends further out the yarn goes there behind it and turns; from where it ends further in, back.
        let further = (next.start() as f32 - run.end() as f32) * outward;
        let aside = |i: f32| from[self.axis] + (to[self.axis] - from[self.axis]) * i / further.abs();
        let steps = (1..further.abs() as usize).map(|i| i as f32);
        let outermost = if further > 0.0 { to } else { from }[self.axis];
        let round = shares.map(|share| {
            let out = if share == near || share == 1.0 - near { 0.62 } else { 1.0 };
            (share, outermost + bulge * out, deep * out)
        });
        let passing = steps.map(|i| (if further > 0.0 { near } else { 1.0 - near }, aside(i), deep.max(d)));
        let places: Vec<(f32, f32, f32)> =
            if further > 0.0 { passing.chain(round).collect() } else { round.chain(passing).collect() };
        for (share, along, deep) in places {
            let mut p = from.lerp(to, share);
            p[self.axis] = along;
            p.z -= deep;
            self.push(p, run, On::Beside(run.end()));
        }
    }

    /// The end of a yarn: over the border to the wrong side, and back behind the stitches; cut at the edge of a weave and of
    /// what is turned in, where nobody looks and bends leave no room.
    fn tail(&mut self, run: &Run, strand: Option<Strand<'_>>, first: bool) {
        let corner = if first { run.start() } else { run.end() };
        let outward = if (corner == run.last) == (run.last > run.first) { 1.0_f32 } else { -1.0 };
        let from = self.corner(run.line, corner, strand, UNSTRAINED);
        let bulge = self.bulge();
        let at = if self.axis == 0 { [corner, run.line] } else { [run.line, corner] };
        // How far out it goes, and which share of its way up and behind it has come by then.
        let way: Vec<(f32, f32)> = if self.shapes.is_woven() || self.sheet.is_turned_in(at[0], at[1]) {
            [0.3, CUT_END as f32, 1.0].map(|out| (out * bulge, 0.0)).into()
        } else {
            // From wherever the yarn is, for a float's end lies behind the cloth already: half a round, and back.
            let inward = (run.last - run.first).min(3) as f32;
            let half_round = [(0.4, 0.02), (0.85, 0.2), (1.0, 0.5), (0.85, 0.8), (0.4, 0.98)];
            let back = [(-0.1, 1.0), (-0.6 * inward, 1.0), (-inward, 0.95)];
            half_round.map(|(out, share)| (out * bulge, share)).into_iter().chain(back).collect()
        };
        // Between the feet of this row and of the next, where no lane is.
        let (up, deep) = (0.5, TAIL_DEEP * self.shapes.diameter as f32);
        let place = |&(along, share): &(f32, f32)| {
            let mut p = from;
            p[self.axis] += outward * along;
            p[1 - self.axis] += share * up;
            p.z -= share * deep;
            p
        };
        let places: Vec<Vec3> = way.iter().map(place).collect();
        if first {
            places.into_iter().rev().for_each(|p| self.push(p, run, On::Beside(corner)));
        } else {
            places.into_iter().for_each(|p| self.push(p, run, On::Beside(corner)));
        }
    }
}

/// How far a turn from a row to the next reaches beyond the last stitch, mm.
pub(super) fn turn(across: f64, diameter: f64) -> f64 {
    (0.45 * across).max(0.7 * diameter)
}
