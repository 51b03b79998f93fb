//! Loops in their closed form beside loops as a cell has them: what has been moved takes along what it holds and what holds
//! it, for feet must stay in the heads that they are drawn through.

use std::f64::consts::TAU;

use glam::DVec3;
use rayon::prelude::*;

use super::{
    super::{
        cell::Cell,
        loops::{Course, Visit},
        shape::{LEAN, Piece, Place},
    },
    Laying, Surface,
};
use crate::math::special::smooth_step;

/// How far a loop is from its closed form: across, up and out.
#[derive(Clone, Copy, Default)]
struct Moved {
    /// Its left and its right foot, behind what it is drawn through.
    foot: [DVec3; 2],
    /// Its left and its right leg, before it.
    leg: [DVec3; 2],
    head: DVec3,
}

/// Which places of a loop its parent follows, as shares of its piece from either end: that of a foot, which lies behind the
/// parent, and that of a leg, which is before it.
#[derive(Clone, Copy)]
struct Followed {
    foot: f64,
    leg: f64,
}

/// Loops that a cell has folded far come through elsewhere than in their closed form. What suits most stitches is taken.
const FOLLOWED: [Followed; 2] = [Followed { foot: 0.12, leg: 0.12 }, Followed { foot: 0.0, leg: 0.2 }];

/// Between which shares of its height a loop that binds off ribs leaves the way of the chart's next row for that to its head.
/// Found by trying 25 pairs on two ribs of six rows: from 0.3 to 0.7 legs miss loops of 2 x 2 rib, from 0.5 to 0.9 heads catch on those beside them
/// in 1 x 1 rib and stretch the yarn by 1 %.
const BOUND: [f64; 2] = [0.45, 0.8];

/// Loops that one thread takes at once.
const CHUNK: usize = 256;

/// How far what lies along a row is moved, by where it is across the cloth.
#[derive(Default)]
struct Field {
    /// From the left.
    knots: Vec<(f64, DVec3)>,
}

impl Field {
    fn new(mut knots: Vec<(f64, DVec3)>, round: Option<f64>) -> Self {
        if let Some(turn) = round {
            let beside = |by: f64| knots.iter().map(move |&(at, d)| (at + by, d)).collect::<Vec<_>>();
            knots = [beside(-turn), beside(0.0), beside(turn)].concat();
        }
        knots.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self { knots }
    }

    /// Nothing where the field has no knots.
    fn at(&self, at: f64) -> Option<DVec3> {
        let after = self.knots.partition_point(|k| k.0 < at);
        let (b, a) = (self.knots.get(after), after.checked_sub(1).map(|i| self.knots[i]));
        match (a, b) {
            (Some(a), Some(b)) => Some(a.1.lerp(b.1, (at - a.0) / (b.0 - a.0))),
            (a, b) => a.or(b.copied()).map(|k| k.1),
        }
    }
}

impl<'a> Laying<'a> {
    /// The cell that says where a visit lies, and its row there; none where that is its closed form.
    pub(super) fn cell_of(&self, course: &Course, k: usize) -> Option<(&'a Cell, usize)> {
        if self.slipped && (k == 0 || k + 1 == course.visits.len()) {
            return None;
        }
        let own = match course.visits[k].1 {
            Visit::Loop(i) => Some(&self.loops.loops[i as usize]),
            Visit::Pass { .. } => None,
            Visit::Float { .. } | Visit::Through { .. } => return None,
        };
        let (cell, r) = (self.cells)(usize::try_from(course.row).ok()?)?;
        let side = own.map_or(0.0, |l| l.side);
        let cell = (if side < 0.0 { self.back? } else { cell }, r);
        match self.surface {
            // Layers that are bound off together lean to each other.
            Surface::Plane { .. } => (self.even && (side == 0.0 || self.plain(own))).then_some(cell),
            // Where wales lean or cross nothing is as it would be in even rows: all of a repeat is taken as it is.
            Surface::Rows { .. } | Surface::Round { .. } | Surface::Bent(_) | Surface::Shaped(_) => {
                (cell.0.leans || self.plain(own)).then_some(cell)
            }
        }
    }

    /// The cell that says how a loop that binds off comes up through the last row, and the row there: the chart's next one.
    fn cell_above(&self, course: &Course, k: usize) -> Option<(&'a Cell, usize)> {
        let Visit::Loop(own) = course.visits[k].1 else { return None };
        // The last loop is drawn out.
        let is_last = self.loops.loops[own as usize].children.is_empty();
        let is_side = k == 0 || k + 1 == course.visits.len();
        // Round or bent, the last row is in its closed form, as what binds it off is.
        let laid = self.even && matches!(self.surface, Surface::Plane { .. }) && !is_last && !(self.slipped && is_side);
        let known = laid && self.own_cells && self.loops.ribbed && course.row == self.loops.rows;
        let row = usize::try_from(course.row).ok().filter(|_| known)?;
        Some(((self.cells)(0)?.0, row))
    }

    /// Where the chart's next row has what binds off a stitch, for each place of its piece.
    fn through_last(&self, course: &Course, k: usize, piece: &Piece) -> Option<Vec<Place>> {
        let (cell, r) = self.cell_above(course, k)?;
        let mut points: Vec<DVec3> = cell.visit(r, course.first + k).map(|(p, _)| p).collect();
        points.extend(cell.visit(r, course.first + k + 1).next().map(|(p, _)| p));
        let steps = (piece.places.len() - 1).max(1) as f64;
        let at = |i: usize| {
            let along = i as f64 / steps * (points.len() - 1) as f64;
            let j = (along as usize).min(points.len() - 2);
            self.place_of(course, k, (cell, r), points[j].lerp(points[j + 1], along - j as f64), 0.0)
        };
        Some((0..piece.places.len()).map(at).collect())
    }

    /// Where a point of a cell's visit is on the surface.
    pub(super) fn place_of(&self, course: &Course, k: usize, (cell, r): (&Cell, usize), p: DVec3, head: f64) -> Place {
        let [width, height] = cell.gauge();
        let row = f64::from(course.row);
        let out = p.z + self.loops.layer_of(&course.visits[k].1);
        match (self.surface, course.visits[k].1) {
            (Surface::Round { .. }, _) if cell.leans => {
                let at = p.x / width / self.loops.wide as f64;
                Place { at, up: row + p.y / height - r as f64, out }
            }
            (Surface::Rows { .. } | Surface::Round { .. } | Surface::Bent(_) | Surface::Shaped(_), Visit::Loop(i)) => {
                let own = &self.loops.loops[i as usize];
                let lean = own.foot - own.at + (self.head(own) - own.foot) * head;
                let count = if self.loops.border.turns { course.visits.len() as f64 } else { 1.0 };
                let at = own.at + lean + (p.x / width - ((course.first + k) as f64 + 0.5)) / count;
                let share = p.y / height - r as f64;
                // A cell of several rows has its own room for what passes.
                let up = if cell.high > 1 { row + share } else { self.loops.within(course.row, at, share) };
                Place { at, up, out }
            }
            (_, visit) => {
                let at = p.x / width - 0.5 * self.loops.wide as f64 + self.loops.aside(&visit);
                Place { at, up: row + p.y / height - r as f64, out }
            }
        }
    }

    /// How far up a row is at a place of it where it climbs over short rows, in rows; else 0.
    fn climbed(&self, row: i32, at: f64) -> f64 {
        if self.loops.levels().is_empty() { 0.0 } else { self.loops.up_at(row, at) }
    }

    /// How far a cell has moved a visit from its closed form.
    fn moved(&self, course: &Course, k: usize, piece: &Piece, followed: Followed) -> Option<Moved> {
        let (cell, r) = self.cell_of(course, k)?;
        let mut points: Vec<DVec3> = cell.visit(r, course.first + k).map(|(p, _)| p).collect();
        points.extend(cell.visit(r, course.first + k + 1).next().map(|(p, _)| p));
        let line: Vec<DVec3> = piece.places.iter().map(|p| self.surface.place(course.row, p)).collect();
        let length = |line: &[DVec3]| line.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>();
        let whole = length(&line);
        let by = |share: f64, head: f64| {
            let i = (share * (line.len() - 1) as f64).round() as usize;
            let along = length(&line[..=i]) / whole * (points.len() - 1) as f64;
            let (j, t) =
                ((along as usize).min(points.len() - 2), along - (along as usize).min(points.len() - 2) as f64);
            let point = points[j].lerp(points[j + 1], t);
            let vector = |p: &Place| DVec3::new(p.at, p.up - self.climbed(course.row, p.at), p.out);
            vector(&self.place_of(course, k, (cell, r), point, head)) - vector(&piece.places[i])
        };
        let is_bobble = matches!(course.visits[k].1, Visit::Loop(i) if self.loops.loops[i as usize].bobble);
        let sides = |share: f64| [by(share, 0.0), by(1.0 - share, 0.0)];
        // Of a bobble only the feet are as those of other loops.
        let foot = sides(if is_bobble { 0.0 } else { followed.foot });
        Some(match is_bobble {
            true => Moved { foot, leg: foot, head: 0.5 * (foot[0] + foot[1]) },
            false => Moved { foot, leg: sides(followed.leg), head: by(0.5, 1.0) },
        })
    }

    /// What a cell has moved beside something that no cell has.
    fn known(&self, pieces: &[Vec<Piece>], followed: Followed) -> Vec<Option<Moved>> {
        let loops = self.loops;
        let of_cell = |(course, k): (&Course, usize)| self.cell_of(course, k).is_some();
        let mut at: Vec<Option<(usize, usize)>> = vec![None; loops.loops.len()];
        for (c, course) in loops.courses.iter().enumerate() {
            for (k, (_, visit)) in course.visits.iter().enumerate() {
                if let Visit::Loop(i) = visit
                    && of_cell((course, k))
                {
                    at[*i as usize] = Some((c, k));
                }
            }
        }
        let needed = |i: usize| {
            let own = &loops.loops[i];
            own.parents.iter().chain(&own.children).any(|j| at[*j as usize].is_none())
        };
        let moved = |i: usize| {
            let (c, k) = at[i].filter(|_| needed(i))?;
            self.moved(&loops.courses[c], k, &pieces[c][k], followed)
        };
        (0..at.len())
            .into_par_iter()
            .with_min_len(CHUNK)
            .map(|i| moved(i).or(at[i].map(|_| Moved::default())))
            .collect()
    }

    /// How far the heads below a row, and the feet and the legs above it are moved, in a layer.
    fn around(&self, course: &Course, known: &[Option<Moved>], followed: Followed, layer: f64) -> [Field; 3] {
        // So far from the middle feet and legs are, in stitches.
        let side = |share: f64| 0.5 - share - LEAN * (2.0 * TAU * share).sin();
        let sides = [side(followed.foot), side(followed.leg).max(0.25)];
        let loops = &self.loops.loops;
        let border = self.loops.border;
        let [end, leg] = sides.map(|s| if border.turns { s / course.visits.len() as f64 } else { s });
        let (mut heads, mut feet, mut legs) = (Vec::new(), Vec::new(), Vec::new());
        for (_, visit) in &course.visits {
            let Visit::Loop(i) = visit else { continue };
            let own = &loops[*i as usize];
            if own.side != layer {
                continue;
            }
            let below = own.parents.iter().filter(|p| loops[**p as usize].row < own.row);
            heads.extend(below.map(|p| (own.foot, known[*p as usize].unwrap_or_default().head)));
            for child in own.children.iter().filter(|c| loops[**c as usize].row > own.row) {
                let at = own.at + border.short(loops[*child as usize].foot - own.at);
                let m = known[*child as usize].unwrap_or_default();
                feet.extend([(at - end, m.foot[0]), (at + end, m.foot[1])]);
                legs.extend([(at - leg, m.leg[0]), (at + leg, m.leg[1])]);
            }
        }
        [heads, feet, legs].map(|knots| Field::new(knots, border.round))
    }

    /// Moves what is in its closed form with what it is drawn through and what is drawn through it.
    pub(super) fn follow(&self, pieces: &mut [Vec<Piece>]) {
        let tried = FOLLOWED.map(|followed| self.followed(pieces, followed));
        let held =
            |moved: &Vec<(usize, Vec<Piece>)>| moved.par_iter().map(|(c, own)| self.held(*c, own)).sum::<usize>();
        let best = tried.into_iter().rev().max_by_key(held);
        for (c, own) in best.into_iter().flatten() {
            pieces[c] = own;
        }
    }

    /// The courses that are moved so, by their numbers.
    fn followed(&self, pieces: &[Vec<Piece>], followed: Followed) -> Vec<(usize, Vec<Piece>)> {
        let known = self.known(pieces, followed);
        let is_closed = |visit: &Visit| matches!(visit, Visit::Loop(i) if known[*i as usize].is_none());
        if known.iter().all(Option::is_none) {
            return Vec::new();
        }
        let moved = |(c, course): (usize, &Course)| {
            if !course.visits.iter().any(|(_, visit)| is_closed(visit)) {
                return None;
            }
            let layers: &[f64] = if self.loops.is_double() { &[1.0, 0.0, -1.0] } else { &[0.0] };
            let fields: Vec<_> = layers.iter().map(|l| (*l, self.around(course, &known, followed, *l))).collect();
            let reach = self.loops.reach();
            let mut own = pieces[c].clone();
            for (k, ((_, visit), piece)) in course.visits.iter().zip(&mut own).enumerate() {
                let Visit::Loop(i) = visit else { continue };
                let own_side = self.loops.loops[*i as usize].side;
                let field = fields.iter().find(|(layer, _)| *layer == own_side);
                let (true, Some((_, [heads, feet, legs]))) = (is_closed(visit), field) else { continue };
                let through_last = self.through_last(course, k, piece);
                for (n, (place, grid)) in piece.places.iter_mut().zip(&piece.grid).enumerate() {
                    let below = heads.at(place.at);
                    let line = self.loops.up_at(course.row + 1, place.at);
                    let share = (0.5 + 0.5 * (place.up - line) / reach).clamp(0.0, 1.0);
                    let above = feet.at(place.at).zip(legs.at(place.at)).map(|(foot, leg)| foot.lerp(leg, share));
                    // The edges hang on what they hold.
                    let foot = below.or(above).unwrap_or_default();
                    let rise = f64::from(grid[1] - course.row as f32).clamp(0.0, 1.0);
                    let by = foot.lerp(above.unwrap_or(foot), rise);
                    let climb = self.climbed(course.row, place.at + by.x) - self.climbed(course.row, place.at);
                    *place = Place { at: place.at + by.x, up: place.up + by.y + climb, out: place.out + by.z };
                    if let Some(own) = through_last.as_ref().map(|own| own[n]) {
                        let share = smooth_step((rise - BOUND[0]) / (BOUND[1] - BOUND[0]));
                        let mix = |low: f64, high: f64| low + (high - low) * share;
                        let [at, up, out] =
                            [(own.at, place.at), (own.up, place.up), (own.out, place.out)].map(|(a, b)| mix(a, b));
                        *place = Place { at, up, out };
                    }
                }
            }
            Some((c, own))
        };
        self.loops.courses.par_iter().enumerate().filter_map(moved).collect()
    }

    /// How many loops of a course in its closed form are drawn through by what a cell has.
    fn held(&self, c: usize, pieces: &[Piece]) -> usize {
        let (loops, own) = (&self.loops.loops, &self.loops.courses[c]);
        let Some(above) = self.courses_of(own.row + 1).next().map(|d| &self.loops.courses[d]) else { return 0 };
        let points = |k: usize| {
            let (cell, r) = self.cell_of(above, k)?;
            let visit = cell.visit(r, above.first + k);
            let place = |(p, g): (DVec3, [f32; 2])| self.place_of(above, k, (cell, r), p, f64::from(g[1] - r as f32));
            Some(visit.map(|p| self.surface.place(above.row, &place(p))).collect::<Vec<_>>())
        };
        let is_held = |k: usize| {
            let (_, Visit::Loop(child)) = above.visits[k] else { return false };
            let [parent] = loops[child as usize].parents[..] else { return false };
            let is_parent = |(_, visit): &(u32, Visit)| *visit == Visit::Loop(parent);
            let Some(parent) = own.visits.iter().position(is_parent) else { return false };
            let (Some(before), Some(mut way)) = (points(k - 1), points(k)) else { return false };
            way.truncate(way.len() / 2 + 1);
            way.splice(..0, before[before.len() / 2..].iter().copied());
            let ring: Vec<DVec3> = pieces[parent].places.iter().map(|p| self.surface.place(own.row, p)).collect();
            threaded(&ring, &way) != 0
        };
        (1..above.visits.len()).filter(|&k| is_held(k)).count()
    }
}

/// How often a way passes through a surface that spans a ring, towards the front less towards the back where the ring goes up,
/// to the right and down. The ring is closed by a straight line; the surface is a fan about its middle.
pub(in super::super) fn threaded(ring: &[DVec3], way: &[DVec3]) -> i32 {
    let middle = ring.iter().sum::<DVec3>() / ring.len() as f64;
    let mut sum = 0;
    for k in 0..ring.len() {
        let (a, b) = (ring[k] - middle, ring[(k + 1) % ring.len()] - middle);
        let normal = b.cross(a);
        for step in way.windows(2) {
            let (from, by) = (step[0] - middle, step[1] - step[0]);
            let toward = normal.dot(by);
            let t = -normal.dot(from) / toward;
            let at = from + t * by;
            // Where the segment meets the triangle's plane, in shares of its sides.
            let (u, v) = (at.cross(b).dot(a.cross(b)), a.cross(at).dot(a.cross(b)));
            if toward != 0.0 && (0.0..1.0).contains(&t) && u >= 0.0 && v >= 0.0 && u + v < normal.length_squared() {
                sum += if toward > 0.0 { 1 } else { -1 };
            }
        }
    }
    sum
}
