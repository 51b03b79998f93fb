//! Knitting that repeats, relaxed once: a few stitches with periodic borders that find their own width and height.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::{
    super::{
        chart::{Act, Chart, Stitch},
        rods::{APART, Rods, Run, Strand},
    },
    loops::{Border, Loops, Visit},
    shape::{Piece, Place, bobble::CLOSED, points_of, spaced},
};
use crate::geometry::spline::catmull_rom;

/// The pull across and along that blocks a piece, force by length: ribs, which fold together, and garter stitch, which draws
/// up, open a little under it, plain knit hardly.
const BLOCKING: DVec2 = DVec2::new(0.03, 0.015);
/// The same for each share of the stitches that are tucked or slipped. These rods slide where wool holds: they would draw the
/// yarn of the loops beside them into the width, and rows down, unless loops are pulled up.
const DRAWN_UP: DVec2 = DVec2::new(-0.06, 0.34);
/// The same for each share of the stitches that are yarn-overs: openwork is stretched to show its holes.
const OPENED: DVec2 = DVec2::new(0.8, 1.2);
/// How firmly it is pressed flat meanwhile, force by length of yarn and distance: loops that are worked together would
/// pile up in front of the cloth, and strands of cables stand on edge, where a wet one lets them slide beside each other.
const PRESSED: f64 = 0.15;
/// Points of a stitch while a cell finds its form; as many as are asked for after that.
const COARSE: u32 = 12;
/// A loop that is laid longer than so many of them has more points.
const CLOSE: f64 = 1.1;
/// Steps with coarse points, with fine ones, and while contact becomes firm.
const STEPS: [usize; 3] = [3000, 400, 200];

/// Relaxed cloth with periodic borders; its lower left corner is at the origin and its unit the yarn's diameter.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    /// Stitches of a row, and rows.
    pub(super) wide: u32,
    pub(super) high: u32,
    /// How wide and high it is.
    pub(super) period: DVec2,
    pub(super) rods: Rods,
    /// Whether its wales lean, so that rows wave, or cross.
    pub(super) leans: bool,
    /// How firmly it is pressed flat while it relaxes.
    press: f64,
    /// Pull on it across and along while it relaxes.
    pull: DVec2,
    /// The first point of each visit of each course, and behind them the end of the course.
    pub(super) visits: Vec<Vec<usize>>,
    /// Wale and course of each point.
    pub(super) grid: Vec<[f32; 2]>,
}

fn length(line: &[DVec3]) -> f64 {
    line.windows(2).map(|w| w[0].distance(w[1])).sum()
}

/// Yarn of the pieces of a course, in shares of a stitch's: a loop that is laid long, as in cables, draws some from others.
fn shares(course: &[Piece], lines: &[Vec<DVec3>], yarn: f64) -> Vec<f64> {
    const LONG: f64 = 1.4;
    let want = |(piece, line): (&Piece, &Vec<DVec3>)| piece.yarn * (length(line) / (LONG * piece.yarn * yarn)).max(1.0);
    let wanted: Vec<f64> = course.iter().zip(lines).map(want).collect();
    let scale = course.iter().map(|p| p.yarn).sum::<f64>() / wanted.iter().sum::<f64>();
    wanted.iter().map(|w| w * scale).collect()
}

impl Cell {
    /// Relaxes one repeat of a chart whose rows all fit `wide` stitches. `size` fixes the width of a stitch and the
    /// distance of rows; what it leaves open follows from the yarn.
    pub(super) fn relaxed(chart: &Chart, wide: u32, yarn: f64, points: u32, size: [Option<f64>; 2]) -> Self {
        let high = chart.rows();
        let rows = chart.work(wide, high, u64::MAX).unwrap_or_default();
        Self::of_rows(&rows, yarn, points, size)
    }

    /// The same of rows that have been worked.
    pub(super) fn of_rows(rows: &[Vec<Stitch>], yarn: f64, points: u32, size: [Option<f64>; 2]) -> Self {
        let wide = rows[0].len();
        let loops = Loops::new(rows, wide, Border::cell(wide));
        let mut cell = Self::laid(rows, &loops, yarn, size);
        cell.relax(&loops, points, size);
        cell
    }

    /// Loops as they are drawn through each other, before they relax.
    pub(super) fn laid(rows: &[Vec<Stitch>], loops: &Loops, yarn: f64, size: [Option<f64>; 2]) -> Self {
        let (wide, high) = (rows[0].len() as u32, rows.len() as u32);
        // Rather too large: yarns find room as the cell draws together.
        let scale = yarn / 13.9;
        let start = DVec2::new(size[0].unwrap_or(4.4 * scale), size[1].unwrap_or(3.0 * scale * loops.room()));
        let period = start * DVec2::new(wide.into(), high.into());
        let share = |is: &dyn Fn(Act) -> bool| {
            let count = rows.iter().flatten().filter(|s| is(s.act)).count();
            count as f64 / f64::from((wide * high).max(1))
        };
        let held = share(&|act| matches!(act, Act::Tuck | Act::Pass { .. }));
        let crosses = rows.iter().flatten().any(|s| s.layer != 0);
        let leans = loops.has_waves() || crosses;
        let pull = BLOCKING + DRAWN_UP * held + OPENED * share(&|act| act == Act::Over);
        let mut cell = Self {
            wide,
            high,
            period,
            rods: Rods { period: Some(period), ..Rods::default() },
            leans,
            press: if leans { PRESSED } else { 0.0 },
            pull: pull.max(DVec2::ZERO),
            visits: Vec::new(),
            grid: Vec::new(),
        };
        for course in loops.pieces() {
            let first = cell.rods.points.len();
            let mut visits = Vec::with_capacity(course.len() + 1);
            let place = |p: &Place| DVec3::new(p.at * start.x, p.up * start.y, p.out);
            let lines: Vec<Vec<DVec3>> = course.iter().map(|c| c.places.iter().map(place).collect()).collect();
            let shares = shares(&course, &lines, yarn);
            for ((piece, line), own) in course.iter().zip(&lines).zip(shares) {
                visits.push(cell.rods.points.len());
                // Points are near each other where a loop is laid long, for it must not cut its bends short.
                let count = points_of(own.max(piece.bends).max(length(line) / (CLOSE * yarn)), COARSE);
                for (point, k, share) in spaced(line, count) {
                    cell.rods.points.push(point);
                    cell.rods.rest.push(own * yarn / count as f64);
                    let (a, b) = (piece.grid[k], piece.grid[k + 1]);
                    cell.grid.push([0, 1].map(|c| a[c] + share as f32 * (b[c] - a[c])));
                }
            }
            let count = cell.rods.points.len() - first;
            visits.push(cell.rods.points.len());
            cell.rods.strands.push(Strand { start: first, count, jump: Some(DVec3::X * period.x) });
            cell.visits.push(visits);
        }
        cell
    }

    fn relax(&mut self, loops: &Loops, points: u32, size: [Option<f64>; 2]) {
        let free = size.map(|s| s.is_none());
        // The many strands of a bobble begin close to each other.
        let (growing, thin) = if loops.has_bobbles() { (STEPS[0] / 3, 0.3) } else { (STEPS[0] / 5, 0.5) };
        let (load, press) = (self.pull, self.press);
        let run = Run { steps: STEPS[0], growing, thin, free, load, press, firm: 1.0, calm: 0.01 };
        self.rods.relax(&run);
        self.refine(points);
        let run = Run { steps: STEPS[1], growing: 0, thin: 1.0, ..run };
        self.rods.relax(&run);
        self.rods.relax(&Run { steps: STEPS[2], firm: 4.0, ..run });
        self.period = self.rods.period.unwrap_or(self.period);
        self.mark(loops);
        // The middle of its thickness is in the plane.
        let middle = self.rods.points.iter().map(|p| p.z).sum::<f64>() / self.rods.points.len() as f64;
        self.rods.points.iter_mut().for_each(|p| p.z -= middle);
    }

    /// Other points on the same curves, so many in a stitch of [`COARSE`].
    fn refine(&mut self, points: u32) {
        let old = std::mem::take(&mut self.rods);
        let (grid, visits) = (std::mem::take(&mut self.grid), std::mem::take(&mut self.visits));
        self.rods.period = old.period;
        for (strand, visits) in old.strands.iter().zip(visits) {
            let jump = strand.jump.unwrap_or_default();
            let n = strand.count as isize;
            let at = |i: isize| old.points[strand.start + i.rem_euclid(n) as usize] + jump * i.div_euclid(n) as f64;
            let first = self.rods.points.len();
            let mut starts = Vec::with_capacity(visits.len());
            for w in visits.windows(2) {
                starts.push(self.rods.points.len());
                let (from, count) = (w[0] - strand.start, w[1] - w[0]);
                let fine = ((count as f64 * f64::from(points) / f64::from(COARSE)).round() as usize).max(2);
                let rest = old.rest[w[0]] * count as f64 / fine as f64;
                for k in 0..fine {
                    let along = k as f64 * count as f64 / fine as f64;
                    let (i, t) = (along.floor() as usize, along.fract());
                    let i0 = (from + i) as isize;
                    let point = catmull_rom([-1, 0, 1, 2].map(|k| at(i0 + k)), t);
                    self.rods.points.push(point);
                    self.rods.rest.push(rest);
                    let (g, h) = (grid[w[0] + i], if i + 1 < count { grid[w[0] + i + 1] } else { grid[w[0] + i] });
                    self.grid.push([0, 1].map(|c| g[c] + t as f32 * (h[c] - g[c])));
                }
            }
            let count = self.rods.points.len() - first;
            starts.push(self.rods.points.len());
            self.rods.strands.push(Strand { start: first, count, jump: Some(jump) });
            self.visits.push(starts);
        }
    }

    /// Yarn slides through its loops as it relaxes: finds which points are whose anew, by the highest point of each loop.
    fn mark(&mut self, loops: &Loops) {
        let old = std::mem::take(&mut self.rods);
        let old_visits = std::mem::take(&mut self.visits);
        self.grid.clear();
        self.rods.period = old.period;
        for ((strand, visits), course) in old.strands.iter().zip(old_visits).zip(&loops.courses) {
            let jump = strand.jump.unwrap_or_default();
            let n = strand.count as isize;
            let at = |i: isize| old.points[strand.start + i.rem_euclid(n) as usize] + jump * i.div_euclid(n) as f64;
            let counts: Vec<isize> = visits.windows(2).map(|w| (w[1] - w[0]) as isize).collect();
            let is_loop = |k: usize| matches!(course.visits[k].1, Visit::Loop(_));
            let is_bobble = |k: usize| matches!(course.visits[k].1, Visit::Loop(i) if loops.loops[i as usize].bobble);
            // Points of a visit before its head, and how far from there it is looked for.
            let before = |k: usize| if is_bobble(k) { (CLOSED * counts[k] as f64) as isize } else { counts[k] / 2 };
            let around = |k: usize| match is_loop(k) {
                true if is_bobble(k) => (counts[k] - before(k)) / 2,
                true => counts[k] / 4,
                false => 0,
            };
            let middle = |k: usize| (visits[k] - strand.start) as isize + before(k);
            // First by how much all have slid, then each for itself.
            let height =
                |s: isize| -> f64 { (0..counts.len()).filter(|&k| is_loop(k)).map(|k| at(middle(k) + s).y).sum() };
            let most = (0..counts.len()).filter(|&k| !is_bobble(k)).map(|k| counts[k] / 2).max().unwrap_or(0);
            let slid = (-most..=most).max_by(|&a, &b| height(a).total_cmp(&height(b))).unwrap_or(0);
            let head = |k: usize| {
                let (from, reach) = (middle(k) + slid, around(k));
                let highest = (from - reach..=from + reach).max_by(|&a, &b| at(a).y.total_cmp(&at(b).y));
                highest.unwrap_or(from)
            };
            let heads: Vec<isize> = (0..counts.len()).map(head).collect();
            let start = |k: usize| {
                let last = (k + counts.len() - 1) % counts.len();
                let from = heads[last] - if k == 0 { n } else { 0 };
                let after = if is_bobble(last) { 2 * (counts[last] - before(last)) } else { counts[last] };
                let before = if is_bobble(k) { 2 * before(k) } else { counts[k] };
                from + (heads[k] - from) * after / (after + before)
            };
            let mut starts: Vec<isize> = (0..counts.len()).map(start).collect();
            starts.push(starts[0] + n);
            let first = self.rods.points.len();
            let mut marks = Vec::with_capacity(starts.len());
            for k in 0..counts.len() {
                marks.push(self.rods.points.len());
                let count = (starts[k + 1] - starts[k]) as f64;
                for i in starts[k]..starts[k + 1] {
                    let share = (i - starts[k]) as f64 / count;
                    let rise = match is_loop(k) {
                        true if is_bobble(k) => (1.0 - (share - CLOSED).abs() / (1.0 - CLOSED)).max(0.3),
                        true => 0.5 - 0.5 * (TAU * share).cos(),
                        false => 0.0,
                    };
                    self.rods.points.push(at(i));
                    self.rods.rest.push(old.rest[strand.start + i.rem_euclid(n) as usize]);
                    let (column, row) = (f64::from(course.visits[k].0), f64::from(course.row));
                    self.grid.push([(column + share) as f32, (row + 0.02 + 0.96 * rise) as f32]);
                }
            }
            marks.push(self.rods.points.len());
            self.rods.strands.push(Strand { start: first, count: strand.count, jump: strand.jump });
            self.visits.push(marks);
        }
    }

    /// The same cloth seen from its other side: its knit stitches are purl.
    pub(super) fn turned(&self) -> Self {
        let mut turned = self.clone();
        turned.rods.points.iter_mut().for_each(|p| p.z = -p.z);
        turned
    }

    /// How far its plane is from that of the same cloth turned, where both touch.
    pub(super) fn touching(&self) -> f64 {
        0.5 * APART - self.rods.points.iter().map(|p| p.z).fold(f64::MAX, f64::min)
    }

    /// By how much its yarn is longer than it is at rest: 1 where nothing pulls.
    pub(super) fn stretch(&self) -> f64 {
        let length = |s: &Strand| {
            let own = &self.rods.points[s.start..s.start + s.count];
            length(own) + s.jump.map_or(0.0, |jump| (own[0] + jump).distance(own[s.count - 1]))
        };
        self.rods.strands.iter().map(length).sum::<f64>() / self.rods.rest.iter().sum::<f64>()
    }

    /// Width of a stitch and distance of rows.
    pub(super) fn gauge(&self) -> [f64; 2] {
        [self.period.x / f64::from(self.wide), self.period.y / f64::from(self.high)]
    }

    /// The points of visit `k` of row `row`, counted on beyond the borders; and the first point of the visit after it.
    pub(super) fn visit(&self, row: usize, k: usize) -> impl Iterator<Item = (DVec3, [f32; 2])> + '_ {
        let high = self.high as usize;
        let starts = &self.visits[row % high];
        let count = starts.len() - 1;
        let (turn, rise) = ((k / count) as f64, (row / high) as f64);
        let by = DVec3::new(turn * self.period.x, rise * self.period.y, 0.0);
        let add = [(turn * f64::from(self.wide)) as f32, (rise * f64::from(self.high)) as f32];
        let own = starts[k % count]..starts[k % count + 1];
        own.map(move |i| (self.rods.points[i] + by, [self.grid[i][0] + add[0], self.grid[i][1] + add[1]]))
    }

    /// Length of a segment at rest in a visit.
    pub(super) fn rest(&self, row: usize, k: usize) -> f64 {
        let starts = &self.visits[row % self.high as usize];
        self.rods.rest[starts[k % (starts.len() - 1)]]
    }
}
