//! A whole piece: loops are laid out as their cell has them or in their closed form, yarns led from row to row, and what
//! is not at rest yet relaxed.

mod drawn;
pub(super) mod follow;
mod net;
pub(super) mod shaped;
pub(super) mod sheet;
mod thread;

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use rayon::prelude::*;

pub(super) use self::thread::{State, Thread, ease, settle};
use self::{drawn::drawn_points, shaped::Shaped, sheet::Sheet};
use super::{
    super::revolution::Revolution,
    STITCH_WIDTH, YARN_PER_STITCH,
    cell::Cell,
    colors::{Stretch, Way},
    loops::{Course, Hold, Loop, Loops, Visit},
    shape::{Piece, Place, points_of, spaced},
};
use crate::{geometry::spline::through_points, math::special::smooth_step};

/// Where a piece lies; its unit is the yarn's diameter.
pub(super) enum Surface {
    /// In the plane; widths of stitches and heights of rows.
    Plane { width: f64, height: f64 },
    /// The same where rows have widths of their own: of their stitches, from the first row on.
    Rows { widths: Vec<f64>, height: f64 },
    /// About the y axis; rows are turns of one spiral.
    Round { revolution: Revolution, height: f64 },
    /// Flat cloth that short rows bend.
    Bent(Sheet),
    /// Flat cloth that decreases and increases shape.
    Shaped(Shaped),
}

impl Surface {
    /// How far it is from one unit of `at` to the next.
    fn across(&self, p: &Place) -> f64 {
        match self {
            Self::Plane { width, .. } => *width,
            Self::Rows { widths, .. } => width_at(widths, p.up),
            Self::Bent(sheet) => sheet.width(),
            Self::Shaped(shaped) => shaped.width(),
            Self::Round { revolution, height } => TAU * revolution.radius((p.up + p.at - 0.5) * height),
        }
    }

    /// Where a place of a row is.
    fn place(&self, row: i32, p: &Place) -> DVec3 {
        match self {
            Self::Plane { width, height } => DVec3::new(p.at * width, p.up * height, p.out),
            Self::Rows { widths, height } => DVec3::new(p.at * width_at(widths, p.up), p.up * height, p.out),
            Self::Round { revolution, height } => revolution.place(p.at, (p.up + p.at - 0.5) * height, p.out),
            Self::Bent(sheet) => sheet.place(row, p),
            Self::Shaped(shaped) => shaped.place(p),
        }
    }

    /// The directions across and up at a place of a row of a flat piece.
    fn directions(&self, row: i32, p: &Place) -> [DVec3; 2] {
        match self {
            Self::Bent(sheet) => sheet.directions(row, p),
            Self::Shaped(shaped) => shaped.directions(p),
            Self::Plane { .. } | Self::Rows { .. } | Self::Round { .. } => [DVec3::X, DVec3::Y],
        }
    }
}

/// How a piece is laid out.
pub(super) struct Laying<'a> {
    pub(super) loops: &'a Loops,
    pub(super) surface: &'a Surface,
    /// The cell of each row of the chart, and the row in it; none where rows have no repeat.
    pub(super) cells: &'a (dyn Fn(usize) -> Option<(&'a Cell, usize)> + Sync),
    /// The cell of the back layer, of a cloth of two.
    pub(super) back: Option<&'a Cell>,
    /// Whether all of the piece repeats as its cell does.
    pub(super) even: bool,
    /// Whether cells are of the chart's own rows; else of knit and purl stitches that stand where others may.
    pub(super) own_cells: bool,
    /// Whether first and last stitches are slipped, which the chart's cells do not know.
    pub(super) slipped: bool,
    /// Length of yarn in a stitch, and its points.
    pub(super) yarn: f64,
    pub(super) points: u32,
}

/// Stitches and rows at the edges that find their place anew.
const EDGE: usize = 2;
/// Length of yarn beyond the first and the last stitch, in diameters.
const TAIL: f64 = 6.0;

impl Laying<'_> {
    /// The yarns: each goes through its rows, turns at the edges of a flat piece, and goes round and round in a tube.
    pub(super) fn threads(&self, ways: &[Way]) -> Vec<Thread> {
        let mut pieces = self.loops.pieces();
        self.follow(&mut pieces);
        let mut rows: Vec<Thread> = pieces.par_iter().enumerate().map(|(c, own)| self.row(c, own)).collect();
        ways.iter().map(|way| self.thread(way, &pieces, &mut rows)).collect()
    }

    /// A yarn on its way; of the `rows` it takes its own.
    fn thread(&self, way: &Way, pieces: &[Vec<Piece>], rows: &mut [Thread]) -> Thread {
        let mut all = Thread::default();
        // Where it begins, and where it is.
        let (mut start, mut here): (Option<Place>, Option<(i32, Place)>) = (None, None);
        for &Stretch { row, backwards, first } in &way.rows {
            let of = |c: usize| &self.loops.courses[c];
            let is_own = |c: &usize| of(*c).color == way.color && (of(*c).first == 0) == (first == 0);
            let is_own = |c: &usize| is_own(c) && (first == 0 || of(*c).visits.iter().any(|v| v.0 == first));
            let Some(c) = self.courses_of(row).find(is_own) else { continue };
            let mut own = std::mem::take(&mut rows[c]);
            let ends = pieces[c].first().zip(pieces[c].last());
            let Some(ends) = ends.map(|(a, b)| [a.places[0], b.places[b.places.len() - 1]]) else { continue };
            if backwards {
                own.reverse();
            }
            let [from, to] = if backwards { [ends[1], ends[0]] } else { ends };
            start.get_or_insert(from);
            match here {
                Some((before, place)) if row - before > 1 => self.carry(&mut all, place, from, own),
                Some((before, place)) if self.is_closed(before, row) => {
                    let front = [row - 1, row].map(|r| self.is_front(r, way.color, backwards));
                    self.wind(&mut all, row, [place, from], own, self.side(backwards), front);
                }
                Some((_, place)) if self.is_inside(row, c, backwards) => {
                    self.link(&mut all, place, from, own, backwards)
                }
                _ => all.turn(own, self.turn(row, &from, backwards)),
            }
            here = Some((row, to));
        }
        if !self.loops.border.finished {
            return all;
        }
        let is_in = |row: i32| way.rows.iter().any(|r| r.row == row);
        match here {
            Some((_, place)) if is_in(self.loops.rows) && self.loops.border.is_drawn() => {
                all.go_on(&self.drawn_in(place))
            }
            Some((row, place)) if is_in(self.loops.rows) => {
                // The last loop is drawn out whole: what comes up through the stitch is the yarn's end.
                let [across, up] = self.surface.directions(row, &place);
                all.draw_out(up);
                let backwards = way.rows.last().is_some_and(|r| r.backwards);
                all.tail(TAIL, (up - self.side(backwards) * across).normalize(), false);
            }
            Some((row, place)) => all.go_on(&self.hidden(row, place)),
            None => {}
        }
        match start {
            Some(place) if is_in(-1) => all.tail(TAIL, -self.surface.directions(-1, &place)[1], true),
            Some(place) => all.come_from(&self.hidden(way.rows[0].row, place)),
            None => {}
        }
        all
    }

    /// To which side a yarn turns before it goes through a row of a flat piece.
    fn side(&self, backwards: bool) -> f64 {
        match (self.loops.border.turns, backwards) {
            (true, _) => 0.0,
            (false, true) => 1.0,
            (false, false) => -1.0,
        }
    }

    /// How far a yarn bulges where it turns before it goes through a row, and how much of its length it keeps: at a side it is
    /// drawn in, beside a stitch that stays on the needle not.
    fn turn(&self, row: i32, from: &Place, backwards: bool) -> (DVec3, f64) {
        const SIDE: (f64, f64) = (0.2, 0.6);
        const BESIDE: (f64, f64) = (0.35, 1.0);
        let inside = 0.5 * self.loops.wide as f64 - from.at.abs() > 0.75;
        let (bulge, taut) = if inside && matches!(self.surface, Surface::Bent(_)) { BESIDE } else { SIDE };
        (self.surface.directions(row, from)[0] * self.side(backwards) * bulge, taut)
    }

    /// Whether a field of a row begins beside another one, for a yarn that comes from the row below.
    fn is_inside(&self, row: i32, c: usize, backwards: bool) -> bool {
        // Colours that are stranded all go through all of a row.
        let courses = &self.loops.courses;
        let first = courses[c].first;
        if backwards { courses[self.courses_of(row)].iter().any(|other| other.first > first) } else { first > 0 }
    }

    /// Whether the yarns of both layers go around each other before a row.
    fn is_closed(&self, before: i32, row: i32) -> bool {
        let is_row = |r: i32| (0..self.loops.rows).contains(&r);
        self.loops.is_double() && !self.loops.border.turns && is_row(before) && is_row(row)
    }

    /// Whether the stitch of a colour at a side is of the front layer, at the right one or at the left one.
    fn is_front(&self, row: i32, color: u16, right: bool) -> bool {
        let course = self.courses_of(row).map(|c| &self.loops.courses[c]).find(|c| c.color == color);
        let edge = course.and_then(|c| if right { c.visits.last() } else { c.visits.first() });
        edge.is_some_and(|(_, visit)| self.loops.layer_of(visit) > 0.0)
    }

    /// At a side the yarns of two layers turn and go around each other, once or until they have changed layers: it is closed.
    /// `front` says whether a row ends and the next one begins in the front layer.
    fn wind(&self, all: &mut Thread, row: i32, [from, to]: [Place; 2], own: Thread, side: f64, front: [bool; 2]) {
        // In stitches, and in diameters from what they go around.
        const BULGE: f64 = 0.2;
        const AROUND: f64 = 0.56;
        let edge = 0.5 * side * self.loops.wide as f64;
        let begin = if front[0] { 0.0 } else { PI };
        let turn = if front[0] == front[1] { TAU } else { PI };
        let line = (0..=64).map(|k| {
            let t = f64::from(k) / 64.0;
            let (sin, cos) = (PI * t).sin_cos();
            let up = from.up + (to.up - from.up) * 0.5 * (1.0 - cos);
            // Layers end half a stitch apart, and their yarns have one middle.
            let aside = (from.at - edge) * (1.0 - t) + (to.at - edge) * t;
            let at = edge + side * BULGE * sin + aside * (1.0 - sin);
            let middle = self.surface.place(row, &Place { at, up, out: 0.0 });
            let angle = begin + turn * smooth_step(t);
            let end = from.out.abs() + (to.out.abs() - from.out.abs()) * t;
            let radius = end + (AROUND - end) * sin * sin;
            let away = DVec3::new(side * sin, -cos, 0.0);
            middle + radius * (DVec3::Z * angle.cos() + away * angle.sin())
        });
        all.go_on(&line.collect::<Vec<_>>());
        all.pop();
        all.join(own);
    }

    /// A yarn turns where its field ends: behind the cloth, around the neighbour's yarn, which turns half way up and half
    /// way down from it.
    fn link(&self, all: &mut Thread, from: Place, to: Place, own: Thread, backwards: bool) {
        const OUT: f64 = 0.24;
        const UP: f64 = 0.17;
        let side = self.side(backwards);
        let far = if side > 0.0 { from.at.max(to.at) } else { from.at.min(to.at) } + side * OUT;
        let knots = [
            from,
            Place { at: from.at, up: from.up - UP, out: -1.2 },
            Place { at: 0.5 * (from.at + far), up: from.up - UP, out: -1.2 },
            Place { at: far, up: from.up + UP, out: -2.2 },
            Place { at: far, up: to.up - UP, out: -2.2 },
            Place { at: 0.5 * (to.at + far), up: to.up + UP, out: -1.2 },
            Place { at: to.at, up: to.up + UP, out: -1.2 },
            to,
        ]
        .map(|p| self.surface.place(0, &p));
        let line = (0..=8 * (knots.len() - 1)).map(|k| through_points(&knots, k / 8, (k % 8) as f64 / 8.0));
        all.go_on(&line.collect::<Vec<_>>());
        all.pop();
        all.join(own);
    }

    /// A yarn goes on some rows higher: up the side of a flat piece, inside of a tube.
    fn carry(&self, all: &mut Thread, from: Place, to: Place, own: Thread) {
        let turns = self.loops.border.turns;
        // The row before ended a turn farther, and a row higher, than it began.
        let from = if turns { Place { at: from.at - 1.0, up: from.up + 1.0, ..from } } else { from };
        let side = if turns { 0.0 } else { 0.12 * to.at.signum() };
        let line = (0..=64).map(|k| {
            let t = f64::from(k) / 64.0;
            let deep = (4.0 * t * (1.0 - t)).sqrt();
            let mix = |a: f64, b: f64| a + (b - a) * t;
            let out = mix(from.out, to.out) - deep;
            let place = Place { at: mix(from.at, to.at) + side * deep, up: mix(from.up, to.up), out };
            self.surface.place(0, &place)
        });
        all.go_on(&line.collect::<Vec<_>>());
        // The row begins with the last of these.
        all.pop();
        all.join(own);
    }

    /// The end of a yarn that neither casts on nor binds off: from the edge of the row back behind it, or between two layers.
    fn hidden(&self, row: i32, end: Place) -> Vec<DVec3> {
        const DEEP: f64 = -2.9;
        // Between layers there is room half way up.
        let (deep, rise) = if self.loops.is_double() { (0.0, 0.5 + self.loops.reach()) } else { (DEEP, 0.0) };
        let middle = if self.loops.border.turns { 0.5 } else { 0.0 };
        let inward = (middle - end.at).signum() / self.surface.across(&end);
        let line = (0..=64).map(|k| {
            let along = TAIL * f64::from(k) / 64.0;
            let at = end.at + inward * (along - 1.2).max(0.0);
            let share = smooth_step(along / 2.5);
            let out = end.out + (deep - end.out) * share;
            self.surface.place(row, &Place { at, up: end.up + rise * share, out })
        });
        line.collect()
    }

    /// Those of a row: they follow each other.
    fn courses_of(&self, row: i32) -> std::ops::Range<usize> {
        let courses = &self.loops.courses;
        courses.partition_point(|c| c.row < row)..courses.partition_point(|c| c.row <= row)
    }

    /// A yarn's way along a row, from left to right.
    fn row(&self, c: usize, pieces: &[Piece]) -> Thread {
        // What is left of a side stitch's yarn: there it is pulled from one side only.
        const DRAWN_IN: f64 = 0.87;
        // The same of yarn that is laid over the needle there: beyond it nothing spreads it.
        const LAID_AT_SIDE: f64 = 0.5;
        let course = &self.loops.courses[c];
        let round = self.loops.border.turns;
        let finished = self.loops.border.finished;
        let (low, high) = (EDGE as i32 - 1, self.loops.rows - EDGE as i32 + 1);
        let mut own = Thread::default();
        let count = course.visits.len();
        let cell = usize::try_from(course.row).ok().and_then(self.cells).map(|(cell, _)| cell);
        let unlike = cell.is_some_and(|cell| cell.high > 1);
        // Where a round begins anew within a repeat, stitches stand beside others than in their cell.
        let breaks = round && cell.is_some_and(|cell| !self.loops.wide.is_multiple_of(cell.wide as usize));
        // Whether it begins and ends at the sides, and not beside another field.
        let flat = matches!(self.surface, Surface::Plane { .. } | Surface::Rows { .. } | Surface::Shaped(_));
        let fields = &self.loops.courses[self.courses_of(course.row)];
        let ends = [course.first == 0, fields.iter().all(|f| f.first <= course.first)].map(|end| flat && end);
        for (k, piece) in pieces.iter().enumerate() {
            let side = (!round || breaks) && (k < EDGE || k + EDGE >= count);
            // A row goes on as the next one, which its cell knows only where all rows are alike.
            let begins = round && (!course.holds.is_empty() || unlike) && (k == 0 || k + 1 == count);
            let edge = side || begins || (finished && (course.row <= low || course.row >= high)) || course.is_mixed(k);
            let from = own.rest.len();
            self.lay(course, k, piece, edge, &mut own);
            let is_last = (k == 0 && ends[0]) || (k + 1 == count && ends[1]);
            // What is cast on holds itself.
            let laid = |l: &Loop| l.sign == 0.0 && l.twist == 0.0;
            let is_laid = |visit: &Visit| matches!(visit, Visit::Loop(i) if laid(&self.loops.loops[*i as usize]));
            let drawn = match is_last {
                true if course.row >= 0 && is_laid(&course.visits[k].1) => LAID_AT_SIDE,
                true => DRAWN_IN,
                false => 1.0,
            };
            let taut = drawn * self.rim(course.row, count);
            own.rest[from..].iter_mut().for_each(|rest| *rest *= taut);
        }
        if let (Some(piece), Some(end)) = (pieces.last(), pieces.last().and_then(|p| p.places.last())) {
            // The end of a row, where it is not the beginning of the next.
            if !round {
                own.push(self.surface.place(course.row, end), 0.0, piece.grid[piece.grid.len() - 1], State::Move);
            }
        }
        own
    }

    /// Share of its yarn that a cast-on or bound-off row of so many stitches has, 1 in other rows: it is as wide as what it
    /// holds, and ribs draw together.
    fn rim(&self, row: i32, count: usize) -> f64 {
        // Yarn in a stitch of plain knit over its width, and how much of a chain's goes along the edge.
        const WALE: f64 = YARN_PER_STITCH / STITCH_WIDTH;
        const ALONG: f64 = 0.73;
        if (0..self.loops.rows).contains(&row) || self.loops.is_double() {
            return 1.0;
        }
        let across = self.surface.across(&Place { at: 0.0, up: f64::from(row.clamp(0, self.loops.rows)), out: 0.0 });
        let width = if self.loops.border.turns { across / count as f64 } else { across };
        1.0 - ALONG * (1.0 - width * WALE / self.yarn).clamp(0.0, 0.5)
    }

    fn lay(&self, course: &Course, k: usize, piece: &Piece, edge: bool, out: &mut Thread) {
        let row = course.row;
        let finished = self.loops.border.finished;
        let held = |grid: [f32; 2]| {
            let head = grid[1] - row as f32;
            !finished && ((row == 0 && head < 0.1) || (row + 1 == self.loops.rows && head > 0.9))
        };
        let state = |grid: [f32; 2], rest: bool| match (held(grid), rest) {
            (true, _) => State::Held,
            (false, true) => State::Rest,
            (false, false) => State::Move,
        };
        let first = out.points.len();
        match (self.cell_of(course, k), &self.surface) {
            // As the cell has it.
            (Some((cell, r)), Surface::Plane { width, height }) => {
                let n = self.loops.wide as f64;
                let layer = self.loops.layer_of(&course.visits[k].1);
                let aside = self.loops.aside(&course.visits[k].1);
                let left = DVec3::new((aside - 0.5 * n) * width, f64::from(row) * height - r as f64 * height, layer);
                let rest = cell.rest(r, course.first + k);
                for (p, g) in cell.visit(r, course.first + k) {
                    let grid = [g[0], g[1] - r as f32 + row as f32];
                    out.push(p + left, rest, grid, state(grid, !edge));
                }
                self.lead(course, k, piece, first, out);
                return;
            }
            // Bent round, or by short rows, or of rows of other widths.
            (Some((cell, r)), _) => {
                let rest = cell.rest(r, course.first + k);
                for (p, g) in cell.visit(r, course.first + k) {
                    let place = self.place_of(course, k, (cell, r), p, f64::from(g[1] - r as f32));
                    let grid = [g[0], g[1] - r as f32 + row as f32];
                    out.push(self.surface.place(row, &place), rest, grid, state(grid, self.even && !edge));
                }
                self.lead(course, k, piece, first, out);
                return;
            }
            _ => {}
        }
        let line: Vec<DVec3> = piece.places.iter().map(|p| self.surface.place(row, p)).collect();
        let (count, length) = match course.visits[k].1 {
            // It is pulled tight.
            Visit::Through { .. } => drawn_points(&line, self.points),
            _ => (points_of(piece.yarn, self.points), piece.yarn * self.yarn),
        };
        for (point, i, share) in spaced(&line, count) {
            let (a, b) = (piece.grid[i], piece.grid[i + 1]);
            let grid = [0, 1].map(|c| a[c] + share as f32 * (b[c] - a[c]));
            out.push(point, length / count as f64, grid, state(grid, false));
        }
    }

    /// Leads the ends of a loop, laid from point `first` on as its cell has it, to the floats beside it, and around what it
    /// catches.
    fn lead(&self, course: &Course, k: usize, piece: &Piece, first: usize, out: &mut Thread) {
        const REACH: f64 = 0.22;
        let n = course.visits.len();
        let float = |k: usize| matches!(course.visits[k % n].1, Visit::Float { .. });
        let count = out.points.len() - first;
        let Some((begin, end)) = piece.places.first().zip(piece.places.last()) else { return };
        let sides = [(begin, first, k + n - 1, k + n - 1), (end, first + count - 1, k, k + 1)];
        let by = sides.map(|(place, point, joint, beside)| {
            let mixed = float(beside) || course.hold(joint % n) != Hold::None;
            if mixed { self.surface.place(course.row, place) - out.points[point] } else { DVec3::ZERO }
        });
        for i in 0..count {
            let along = (i as f64 + 0.5) / count as f64;
            for (by, from) in by.iter().zip([along, 1.0 - along]) {
                let near = 1.0 - from / REACH;
                out.points[first + i] += *by * smooth_step(near);
            }
        }
    }

    /// Whether a loop is as in its cell: through one below and held by one above, and nothing beside it leans.
    fn plain(&self, own: Option<&Loop>) -> bool {
        own.is_some_and(|l| {
            let above = |c: &u32| self.loops.loops[*c as usize].parents.len() == 1;
            let next = l.held.is_none_or(|row| row == l.row + 1);
            let usual = self.own_cells || (l.sign != 0.0 && l.twist == 0.0 && !l.bobble && next);
            let usual = usual && !self.loops.is_drawn(l);
            usual && l.parents.len() <= 1 && l.layer == 0.0 && l.children.iter().all(above)
        })
    }

    fn head(&self, own: &Loop) -> f64 {
        let border = self.loops.border;
        own.children.first().map_or(own.at, |&c| own.at + border.short(self.loops.loops[c as usize].foot - own.at))
    }
}

/// The width of a stitch so many rows up, between the middles of rows that have these.
fn width_at(widths: &[f64], up: f64) -> f64 {
    let along = (up - 0.5).clamp(0.0, (widths.len() - 1) as f64);
    let row = (along as usize).min(widths.len().saturating_sub(2));
    let next = widths[(row + 1).min(widths.len() - 1)];
    widths[row] + (next - widths[row]) * (along - row as f64)
}
