//! Which pieces of yarn are near each other: a grid over segments, and the distance of two segments.

use std::ops::Range;

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use wide::f32x8;

/// The nearest points of two segments: how far along each (0 to 1), and the vector from the first to the second.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nearest {
    pub(crate) s: f64,
    pub(crate) t: f64,
    pub(crate) between: DVec3,
}

/// The nearest points of the segments `p0 p1` and `q0 q1`.
#[inline(always)] // a call costs as much as the work
pub(crate) fn nearest(p0: DVec3, p1: DVec3, q0: DVec3, q1: DVec3) -> Nearest {
    const TINY: f64 = 1e-18;
    let (d1, d2, r) = (p1 - p0, q1 - q0, p0 - q0);
    let (a, e, f) = (d1.length_squared().max(TINY), d2.length_squared().max(TINY), d2.dot(r));
    let (b, c) = (d1.dot(d2), d1.dot(r));
    let det = a * e - b * b;
    let s = if det > 1e-9 * a * e { ((b * f - c * e) / det).clamp(0.0, 1.0) } else { 0.5 };
    // Of s the nearest t, and of that the nearest s again: another one where t met its bounds, else the same.
    let t = ((b * s + f) * (1.0 / e)).clamp(0.0, 1.0);
    let s = ((b * t - c) * (1.0 / a)).clamp(0.0, 1.0);
    Nearest { s, t, between: (q0 + d2 * t) - (p0 + d1 * s) }
}

/// Points sorted into the cells of a grid, those that hold any. With a period in x and y, neighbours are found across its
/// borders.
pub(crate) struct PointGrid {
    /// Cells per period along x and y, where there is one.
    wrap: Option<[i32; 2]>,
    /// Of a cell.
    size: DVec3,
    /// Points by their cells; cells that follow each other along x do so here.
    entries: Vec<Entry>,
    /// Where each entry is, from `origin`: x, y and z by themselves, and some that are nowhere at the end.
    places: [Vec<f32>; 3],
    origin: DVec3,
    /// The cells in order, each with its first entry; one more at the end.
    cells: Vec<(Key, u32)>,
    /// The cell of each point.
    cell_of: Vec<Key>,
}

/// Points whose distances are found at once.
const LANES: usize = 8;
/// Points that are not worth two threads.
const FEW: usize = 4096;
/// So much farther, as a share of the way from the grid's first point, a distance in single precision may be.
const ROUNDED: f32 = 1e-6;

/// A point in a [`PointGrid`].
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    pub(crate) at: DVec3,
    pub(crate) index: u32,
}

/// Where a cell is along z, y and x, as one number that is sorted fast.
type Key = u64;

fn key([z, y, x]: [i32; 3]) -> Key {
    const HALF: i32 = 1 << 20;
    let place = |v: i32| (v.clamp(-HALF, HALF - 1) + HALF) as u64;
    place(z) << 42 | place(y) << 21 | place(x)
}

fn cell(key: Key) -> [i32; 3] {
    [42, 21, 0].map(|shift| ((key >> shift) & 0x1f_ffff) as i32 - (1 << 20))
}

/// The cell that a point is in.
fn key_of(point: DVec3, size: DVec3, wrap: Option<[i32; 2]>) -> Key {
    let mut c = (point / size).floor().as_ivec3();
    if let Some([nx, ny]) = wrap {
        (c.x, c.y) = (c.x.rem_euclid(nx), c.y.rem_euclid(ny));
    }
    key([c.z, c.y, c.x])
}

impl PointGrid {
    /// Sorts points into cells at least `reach` wide, so that all within `reach` of a point are in the 27 cells around
    /// it. `period` must be at least three times `reach`.
    pub(crate) fn new(points: &[DVec3], reach: f64, period: Option<DVec2>) -> Self {
        let wrap = period.map(|p| [(p.x / reach).floor().max(1.0) as i32, (p.y / reach).floor().max(1.0) as i32]);
        let size = match (period, wrap) {
            (Some(p), Some([nx, ny])) => DVec3::new(p.x / f64::from(nx), p.y / f64::from(ny), reach),
            _ => DVec3::splat(reach),
        };
        let key_of = |p: DVec3| key_of(p, size, wrap);
        let cell_of: Vec<Key> = points.par_iter().with_min_len(FEW).map(|&p| key_of(p)).collect();
        let mut order: Vec<(Key, u32)> = cell_of.iter().zip(0..).map(|(&key, index)| (key, index)).collect();
        order.par_sort_unstable();
        let mut cells: Vec<(Key, u32)> = Vec::new();
        for (at, &(key, _)) in order.iter().enumerate() {
            if cells.last().is_none_or(|last| last.0 != key) {
                cells.push((key, at as u32));
            }
        }
        cells.push((Key::MAX, points.len() as u32));
        let entry = |&(_, index): &(Key, u32)| Entry { at: points[index as usize], index };
        let entries: Vec<Entry> = order.par_iter().with_min_len(FEW).map(entry).collect();
        let origin = entries.first().map_or(DVec3::ZERO, |entry| entry.at);
        let places = [0, 1, 2].map(|axis| {
            let place = |i: usize| entries.get(i).map_or(f32::INFINITY, |entry| (entry.at - origin)[axis] as f32);
            (0..entries.len() + LANES).into_par_iter().with_min_len(FEW).map(place).collect()
        });
        Self { wrap, size, entries, places, origin, cells, cell_of }
    }

    /// All points, those of a cell one after the other: in this order [`Self::walk`] is quickest.
    pub(crate) fn in_order(&self) -> &[Entry] {
        &self.entries
    }

    /// What finds neighbours: quickest of points that follow each other in space.
    pub(crate) fn walk(&self) -> Walk<'_> {
        Walk { grid: self, ahead: false, known: std::array::from_fn(|_| Around::default()) }
    }

    /// What finds neighbours in a point's own cell and in one of each two opposite cells beside it, so that every pair of points
    /// in two cells is found once: of a grid without a period.
    pub(crate) fn walk_ahead(&self) -> Walk<'_> {
        Walk { ahead: true, ..self.walk() }
    }

    /// Whether two points are in one cell.
    pub(crate) fn share_cell(&self, a: usize, b: usize) -> bool {
        self.cell_of[a] == self.cell_of[b]
    }

    /// The entries of the 27 cells around a cell, as few runs.
    fn runs_around(&self, cell: Key, ahead: bool, runs: &mut Vec<Range<u32>>) {
        runs.clear();
        let [z, y, x] = self::cell(cell);
        let mut run = |z: i32, y: i32, from: i32, to: i32| {
            let first = self.cells.partition_point(|c| c.0 < key([z, y, from]));
            let after = first + self.cells[first..].iter().take_while(|c| c.0 <= key([z, y, to])).count();
            if first < after {
                runs.push(self.cells[first].1..self.cells[after].1);
            }
        };
        for dz in -1..=1 {
            for dy in -1..=1 {
                if ahead && (dz, dy) < (0, 0) {
                    continue;
                }
                let own = ahead && (dz, dy) == (0, 0);
                let z = z.saturating_add(dz);
                let (from, to) = (if own { x } else { x.saturating_sub(1) }, x.saturating_add(1));
                match self.wrap {
                    None => run(z, y.saturating_add(dy), from, to),
                    Some([nx, ny]) => {
                        let y = (y + dy).rem_euclid(ny);
                        run(z, y, from.max(0), to.min(nx - 1));
                        if from < 0 {
                            run(z, y, nx - 1, nx - 1);
                        }
                        if to >= nx {
                            run(z, y, 0, 0);
                        }
                    }
                }
            }
        }
    }
}

/// The cubes around some points: those that hold one, and all that touch these.
pub(crate) struct Cubes {
    size: DVec3,
    /// In order.
    cubes: Vec<Key>,
}

impl Cubes {
    /// Cubes so wide around points.
    pub(crate) fn around(points: impl Iterator<Item = DVec3>, size: f64) -> Self {
        let size = DVec3::splat(size);
        let mut cubes: Vec<Key> = points.map(|p| key_of(p, size, None)).collect();
        // Points that follow each other are mostly in one.
        cubes.dedup();
        cubes.par_sort_unstable();
        cubes.dedup();
        let beside = |&own: &Key| {
            let [z, y, x] = cell(own);
            (0..27).map(move |k| key([z + k / 9 - 1, y + k / 3 % 3 - 1, x + k % 3 - 1]))
        };
        let mut cubes: Vec<Key> = cubes.iter().flat_map(beside).collect();
        cubes.par_sort_unstable();
        cubes.dedup();
        Self { size, cubes }
    }

    /// Whether one of them holds a point.
    pub(crate) fn hold(&self, point: DVec3) -> bool {
        self.cubes.binary_search(&key_of(point, self.size, None)).is_ok()
    }
}

/// Cells that are remembered along x, y and z, as powers of two: a yarn that forms loops comes back to those that it left.
const REMEMBERED: [u32; 3] = [2, 1, 1];

/// A cell, and the entries around it as runs.
#[derive(Default)]
struct Around {
    cell: Option<Key>,
    runs: Vec<Range<u32>>,
}

/// Finds the neighbours of points in a [`PointGrid`].
pub(crate) struct Walk<'a> {
    grid: &'a PointGrid,
    ahead: bool,
    /// The cells last asked for, each in its place.
    known: [Around; 1 << (REMEMBERED[0] + REMEMBERED[1] + REMEMBERED[2])],
}

impl<'a> Walk<'a> {
    /// The entries around a cell, found anew unless they are remembered.
    fn go_to(&mut self, cell: Key) -> &[Range<u32>] {
        let mut place = 0;
        for (axis, bits) in REMEMBERED.into_iter().enumerate() {
            place = place << bits | (cell >> (21 * axis)) as usize & ((1 << bits) - 1);
        }
        let known = &mut self.known[place];
        if known.cell != Some(cell) {
            self.grid.runs_around(cell, self.ahead, &mut known.runs);
            known.cell = Some(cell);
        }
        &known.runs
    }

    /// Every point in the 27 cells around a point, itself too, in an order that depends on the points alone.
    pub(crate) fn around(&mut self, point: usize) -> impl Iterator<Item = &'a Entry> {
        let grid = self.grid;
        let runs = self.go_to(grid.cell_of[point]);
        runs.iter().flat_map(|run| &grid.entries[run.start as usize..run.end as usize])
    }

    /// Of the points around a place, those within a distance and some that are a little farther; in the same order. Of a grid
    /// without a period.
    pub(crate) fn within(&mut self, at: DVec3, distance: f64, mut found: impl FnMut(&'a Entry)) {
        let PointGrid { entries, places, origin, size, wrap, .. } = self.grid;
        let from = (at - *origin).as_vec3();
        let most = f32x8::splat((distance as f32 + ROUNDED * (from.length() + distance as f32)).powi(2));
        let from = from.to_array().map(f32x8::splat);
        for run in self.go_to(key_of(at, *size, *wrap)) {
            let (mut first, end) = (run.start as usize, run.end as usize);
            while first < end {
                let mut square = f32x8::ZERO;
                for (places, from) in places.iter().zip(from) {
                    let lanes: [f32; LANES] = places[first..first + LANES].try_into().expect("so many");
                    let away = f32x8::from(lanes) - from;
                    square = away.mul_add(away, square);
                }
                let mut near = square.simd_le(most).to_bitmask();
                if end - first < LANES {
                    near &= (1 << (end - first)) - 1;
                }
                while near != 0 {
                    found(&entries[first + near.trailing_zeros() as usize]);
                    near &= near - 1;
                }
                first += LANES;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::Stream;

    #[test]
    fn nearest_points_of_segments_are_those_of_a_fine_search() {
        let mut stream = Stream::new(3);
        let mut point = || DVec3::new(stream.next().into(), stream.next().into(), stream.next().into());
        for _ in 0..200 {
            let [p0, p1, q0, q1] = [point(), point(), point(), point()];
            let found = nearest(p0, p1, q0, q1).between.length();
            let mut best = f64::MAX;
            for i in 0..=200 {
                let p = p0.lerp(p1, f64::from(i) / 200.0);
                let t = ((p - q0).dot(q1 - q0) / (q1 - q0).length_squared()).clamp(0.0, 1.0);
                best = best.min(p.distance(q0.lerp(q1, t)));
            }
            assert!(found <= best + 1e-12 && found > best - 0.01, "{found} {best}");
        }
    }

    #[test]
    fn looking_ahead_finds_every_pair_once() {
        let mut stream = Stream::new(9);
        let points: Vec<DVec3> = (0..400)
            .map(|_| DVec3::new(f64::from(stream.next()) * 4.0, f64::from(stream.next()) * 5.0, stream.next().into()))
            .collect();
        let grid = PointGrid::new(&points, 0.8, None);
        let mut walk = grid.walk_ahead();
        let mut found = vec![0; points.len() * points.len()];
        for i in 0..points.len() {
            for j in walk.around(i).map(|e| e.index as usize).filter(|j| !grid.share_cell(i, *j) || *j > i) {
                found[i.min(j) * points.len() + i.max(j)] += 1;
            }
        }
        for i in 0..points.len() {
            for j in i + 1..points.len() {
                let count = found[i * points.len() + j];
                assert!(count <= 1 && (count == 1 || points[i].distance(points[j]) > 0.8), "{i} {j} {count}");
            }
        }
    }

    #[test]
    fn what_is_within_a_distance_is_told_as_one_by_one() {
        let mut stream = Stream::new(11);
        // Also far from where all begins.
        for far in [0.0, 1e4] {
            let points: Vec<DVec3> = (0..500)
                .map(|_| 4.0 * DVec3::new(stream.next().into(), stream.next().into(), stream.next().into()) + far)
                .collect();
            let grid = PointGrid::new(&points, 1.0, None);
            for (mut walk, mut all) in [(grid.walk(), grid.walk()), (grid.walk_ahead(), grid.walk_ahead())] {
                for (i, p) in points.iter().enumerate() {
                    let mut found = Vec::new();
                    walk.within(*p, 0.9, |e| found.push(e.index));
                    let mut within = |distance: f64| -> Vec<u32> {
                        all.around(i).filter(|e| e.at.distance(*p) <= distance).map(|e| e.index).collect()
                    };
                    let [least, most] = [within(0.9), within(0.901)];
                    assert!(least.iter().all(|index| found.contains(index)), "{i}");
                    assert!(found.iter().all(|index| most.contains(index)), "{i}");
                }
            }
        }
    }

    #[test]
    fn cubes_hold_what_is_near_points() {
        let mut stream = Stream::new(17);
        let mut point = || 8.0 * (DVec3::from([0; 3].map(|_| f64::from(stream.next()))) - 0.5);
        let points: Vec<DVec3> = (0..20).map(|_| point()).collect();
        let cubes = Cubes::around(points.iter().copied(), 0.5);
        let mut far = 0;
        for _ in 0..2000 {
            let at = point();
            let nearest = points.iter().map(|p| (*p - at).abs().max_element()).fold(f64::INFINITY, f64::min);
            assert!(cubes.hold(at) || nearest > 0.5, "{at}");
            assert!(!cubes.hold(at) || nearest < 1.0, "{at}");
            far += usize::from(!cubes.hold(at));
        }
        assert!(far > 500, "{far}");
    }

    #[test]
    fn the_grid_finds_every_neighbour_once() {
        let mut stream = Stream::new(7);
        let period = DVec2::new(4.0, 5.0);
        let points: Vec<DVec3> = (0..400)
            .map(|_| DVec3::new(f64::from(stream.next()) * 4.0, f64::from(stream.next()) * 5.0, stream.next().into()))
            .collect();
        for period in [Some(period), None] {
            let grid = PointGrid::new(&points, 1.0, period);
            let mut walk = grid.walk();
            for (i, p) in points.iter().enumerate() {
                let mut found = vec![0; points.len()];
                for entry in walk.around(i) {
                    assert_eq!(entry.at, points[entry.index as usize]);
                    found[entry.index as usize] += 1;
                }
                for (q, count) in points.iter().zip(&found) {
                    let mut d = *q - *p;
                    if let Some(period) = period {
                        d.x -= period.x * (d.x / period.x).round();
                        d.y -= period.y * (d.y / period.y).round();
                    }
                    assert!(*count <= 1);
                    assert!(*count == 1 || d.length() > 1.0);
                }
            }
        }
    }
}
