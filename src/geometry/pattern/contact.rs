//! Which pieces of yarn are near each other: a hashed grid over segments, and the distance of two segments.

use glam::{DVec2, DVec3, IVec3};

/// The nearest points of two segments: how far along each (0 to 1), and the vector from the first to the second.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nearest {
    pub(super) s: f64,
    pub(super) t: f64,
    pub(super) between: DVec3,
}

/// The nearest points of the segments `p0 p1` and `q0 q1`.
#[inline]
pub(super) fn nearest(p0: DVec3, p1: DVec3, q0: DVec3, q1: DVec3) -> Nearest {
    const TINY: f64 = 1e-18;
    let (d1, d2, r) = (p1 - p0, q1 - q0, p0 - q0);
    let (a, e, f) = (d1.length_squared().max(TINY), d2.length_squared().max(TINY), d2.dot(r));
    let (b, c) = (d1.dot(d2), d1.dot(r));
    let det = a * e - b * b;
    let mut s = if det > 1e-9 * a * e { ((b * f - c * e) / det).clamp(0.0, 1.0) } else { 0.5 };
    let mut t = (b * s + f) / e;
    if !(0.0..=1.0).contains(&t) {
        t = t.clamp(0.0, 1.0);
        s = ((b * t - c) / a).clamp(0.0, 1.0);
    }
    Nearest { s, t, between: (q0 + d2 * t) - (p0 + d1 * s) }
}

/// Points sorted into the cells of a hashed grid. With a period in x and y, neighbours are found across its borders.
pub(super) struct Grid {
    cell: DVec3,
    /// Cells per period along x and y, where there is one.
    wrap: Option<[i32; 2]>,
    mask: usize,
    /// For each bucket where its entries begin; one more at the end.
    starts: Vec<u32>,
    entries: Vec<(IVec3, u32)>,
}

impl Grid {
    /// Sorts points into cells at least `reach` wide, so that all within `reach` of a point are in the 27 cells around
    /// it. `period` must be at least three times `reach`.
    pub(super) fn new(points: &[DVec3], reach: f64, period: Option<DVec2>) -> Self {
        let wrap = period.map(|p| [(p.x / reach).floor().max(1.0) as i32, (p.y / reach).floor().max(1.0) as i32]);
        let cell = match (period, wrap) {
            (Some(p), Some([nx, ny])) => DVec3::new(p.x / f64::from(nx), p.y / f64::from(ny), reach),
            _ => DVec3::splat(reach),
        };
        let buckets = points.len().next_power_of_two().max(16);
        let mut grid = Self { cell, wrap, mask: buckets - 1, starts: vec![0; buckets + 1], entries: Vec::new() };
        let cells: Vec<IVec3> = points.iter().map(|&p| grid.cell_of(p)).collect();
        for &c in &cells {
            let bucket = grid.bucket(c);
            grid.starts[bucket + 1] += 1;
        }
        for i in 0..buckets {
            grid.starts[i + 1] += grid.starts[i];
        }
        let mut next = grid.starts.clone();
        grid.entries = vec![(IVec3::ZERO, 0); points.len()];
        for (i, &c) in cells.iter().enumerate() {
            let slot = &mut next[grid.bucket(c)];
            grid.entries[*slot as usize] = (c, i as u32);
            *slot += 1;
        }
        grid
    }

    fn cell_of(&self, p: DVec3) -> IVec3 {
        self.wrapped((p / self.cell).floor().as_ivec3())
    }

    fn wrapped(&self, mut c: IVec3) -> IVec3 {
        if let Some([nx, ny]) = self.wrap {
            c.x = c.x.rem_euclid(nx);
            c.y = c.y.rem_euclid(ny);
        }
        c
    }

    fn bucket(&self, c: IVec3) -> usize {
        let h = (c.x as u32).wrapping_mul(0x9e37_79b1)
            ^ (c.y as u32).wrapping_mul(0x85eb_ca77)
            ^ (c.z as u32).wrapping_mul(0xc2b2_ae3d);
        (h ^ (h >> 15)) as usize & self.mask
    }

    /// Calls `found` with every point in the 27 cells around `p`, in an order that depends on the points alone.
    pub(super) fn around(&self, p: DVec3, mut found: impl FnMut(u32)) {
        let middle = (p / self.cell).floor().as_ivec3();
        for dz in -1..=1 {
            for dy in -1..=1 {
                for dx in -1..=1 {
                    let c = self.wrapped(middle + IVec3::new(dx, dy, dz));
                    let bucket = self.bucket(c);
                    for &(cell, i) in &self.entries[self.starts[bucket] as usize..self.starts[bucket + 1] as usize] {
                        if cell == c {
                            found(i);
                        }
                    }
                }
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
    fn the_grid_finds_every_neighbour_once() {
        let mut stream = Stream::new(7);
        let period = DVec2::new(4.0, 5.0);
        let points: Vec<DVec3> = (0..400)
            .map(|_| DVec3::new(f64::from(stream.next()) * 4.0, f64::from(stream.next()) * 5.0, stream.next().into()))
            .collect();
        let grid = Grid::new(&points, 1.0, Some(period));
        for p in &points {
            let mut found = vec![0; points.len()];
            grid.around(*p, |i| found[i as usize] += 1);
            for (q, count) in points.iter().zip(&found) {
                let mut d = *q - *p;
                d.x -= period.x * (d.x / period.x).round();
                d.y -= period.y * (d.y / period.y).round();
                assert!(*count <= 1);
                assert!(*count == 1 || d.length() > 1.0);
            }
        }
    }
}
