//! Flat cloth that short rows bend: columns with more rows are longer. It is a net of stitches, held by springs across, up and
//! askew, that finds its form: a wedge from an edge to the other bends it in its plane, one that ends in its middle makes it
//! bulge to the front.

use glam::DVec3;

use super::{super::shape::Place, net::Net};
use crate::{
    geometry::spline::catmull_rom,
    math::special::hermite,
    pattern::chart::{Act, Stitch},
};

/// Stiffness of the net against shear and against bending, over that against stretching: it is blocked, and bulges only where
/// it must.
const SHEAR: f64 = 0.25;
const BEND: f64 = 1.2;
/// Springs so much too long or short, in the mean, are not blocked flat: the cloth bulges.
const STRAINED: f64 = 0.02;
/// How far its middle is out of its plane then at first, in diameters.
const BULGE: f64 = 1.0;

/// Stitches of one column from the cast-on edge to the bind-off.
struct Column {
    /// How far up they are, in rows.
    levels: Vec<f64>,
    at: Vec<DVec3>,
}

/// The net at rest; its unit is the yarn's diameter, its middle at the origin.
pub(in super::super) struct Sheet {
    columns: Vec<Column>,
    /// How far up each stitch of each row begins.
    levels: Vec<Vec<f64>>,
    width: f64,
}

/// The net as it is laid, and which points make a column.
struct Laid {
    net: Net,
    /// For each column its points and their levels, upwards.
    columns: Vec<Vec<(usize, f64)>>,
}

/// The first point of a column that is as high as a level.
fn point_at(column: &[(usize, f64)], level: f64) -> usize {
    let k = column.partition_point(|(_, own)| *own < level - 1e-9);
    column[k.min(column.len() - 1)].0
}

fn next_above(column: &[(usize, f64)], level: f64) -> Option<(usize, f64)> {
    column.get(column.partition_point(|(_, own)| *own < level + 1e-9)).copied()
}

impl Laid {
    fn new(levels: &[Vec<f64>], rows: &[Vec<Stitch>], [width, height]: [f64; 2]) -> Self {
        let n = rows[0].len();
        let makes = |s: &Stitch| !matches!(s.act, Act::Unworked | Act::Double);
        let mut laid = Self { net: Net::new(BEND), columns: Vec::new() };
        for j in 0..n {
            let own = (0..rows.len()).filter(|&r| makes(&rows[r][j])).map(|r| levels[r][j]);
            let all = std::iter::once(-1.0).chain(own).chain(std::iter::once(levels[rows.len()][j]));
            let at = j as f64 + 0.5 - 0.5 * n as f64;
            let column = all.map(|level| (laid.net.add(DVec3::new(at * width, level * height, 0.0)), level));
            let column = column.collect();
            laid.columns.push(column);
        }
        laid.hold_columns(height);
        // The edges are rows too.
        let all = vec![true; n];
        let worked = |r: usize| rows[r].iter().map(makes).collect::<Vec<bool>>();
        laid.hold_row(&vec![-1.0; n], &all, [width, height]);
        (0..rows.len()).for_each(|r| laid.hold_row(&levels[r], &worked(r), [width, height]));
        laid.hold_row(&levels[rows.len()], &all, [width, height]);
        laid
    }

    fn hold_columns(&mut self, height: f64) {
        for column in std::mem::take(&mut self.columns) {
            for w in column.windows(2) {
                self.net.hold(w[0].0, w[1].0, height * (w[1].1 - w[0].1), 1.0);
            }
            for w in column.windows(3) {
                let share = (w[1].1 - w[0].1) / (w[2].1 - w[0].1);
                self.net.straighten([w[0].0, w[1].0, w[2].0], share);
            }
            self.columns.push(column);
        }
    }

    /// Holds the stitches of a row, those that are worked, to each other and to those above.
    fn hold_row(&mut self, levels: &[f64], worked: &[bool], [width, height]: [f64; 2]) {
        for j in 1..worked.len() {
            if !(worked[j - 1] && worked[j]) {
                continue;
            }
            let [left, right] = [j - 1, j].map(|k| point_at(&self.columns[k], levels[k]));
            self.net.hold(left, right, width, 1.0);
            for (from, to) in [(left, j), (right, j - 1)] {
                if let Some((above, level)) = next_above(&self.columns[to], levels[to]) {
                    self.net.hold(from, above, width.hypot(height * (level - levels[to])), SHEAR);
                }
            }
            if j >= 2 && worked[j - 2] {
                let far = point_at(&self.columns[j - 2], levels[j - 2]);
                self.net.straighten([far, left, right], 0.5);
            }
        }
    }

    /// Lets it leave its plane, to the front.
    fn bulge(&mut self) {
        let [low, high] = self.net.bounds();
        for p in &mut self.net.points {
            let side = (2.0 * *p - low - high) / (high - low).max(DVec3::splat(1e-9));
            p.z = BULGE * (1.0 - side.x * side.x) * (1.0 - side.y * side.y);
        }
    }
}

impl Column {
    /// Where it is at a level; beyond its ends it goes straight on.
    fn at(&self, level: f64) -> DVec3 {
        let n = self.levels.len();
        let k = self.levels.partition_point(|l| *l <= level).clamp(1, n - 1) - 1;
        let (low, high) = (self.levels[k], self.levels[k + 1]);
        let (span, t) = (high - low, (level - low) / (high - low));
        let (a, b) = (self.at[k], self.at[k + 1]);
        if !(0.0..=1.0).contains(&t) {
            return a + (b - a) * t;
        }
        let slope = |i: usize| {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(n - 1));
            (self.at[after] - self.at[before]) / (self.levels[after] - self.levels[before]) * span
        };
        hermite([a, b], [k, k + 1].map(slope), t)
    }
}

impl Sheet {
    /// Lets a net of stitches of a size find its form. `levels` are those of each stitch of each row and, behind them, the tops.
    pub(in super::super) fn relaxed(levels: &[Vec<f64>], rows: &[Vec<Stitch>], size: [f64; 2]) -> Self {
        let mut laid = Laid::new(levels, rows, size);
        laid.net.relax();
        if laid.net.strain() > STRAINED {
            laid.bulge();
            laid.net.relax();
        }
        let [low, high] = laid.net.bounds();
        let middle = 0.5 * (low + high);
        let column = |points: &Vec<(usize, f64)>| Column {
            levels: points.iter().map(|p| p.1).collect(),
            at: points.iter().map(|p| laid.net.points[p.0] - middle).collect(),
        };
        Self { columns: laid.columns.iter().map(column).collect(), levels: levels.to_vec(), width: size[0] }
    }

    pub(super) fn width(&self) -> f64 {
        self.width
    }

    /// How far up a row is at a place across it: in a column, and along the row between columns.
    fn level(&self, row: i32, column: usize) -> f64 {
        usize::try_from(row).ok().and_then(|r| self.levels.get(r)).map_or(f64::from(row), |levels| levels[column])
    }

    /// Where the cloth is at a place across it, `above` the beginning of a row.
    fn middle(&self, row: i32, at: f64, above: f64) -> DVec3 {
        let n = self.columns.len();
        let x = at + 0.5 * (n - 1) as f64;
        let k = (x.floor().max(0.0) as usize).min(n - 2);
        let t = x - k as f64;
        let column = |k: usize| self.columns[k].at(self.level(row, k) + above);
        let (b, c) = (column(k), column(k + 1));
        if !(0.0..=1.0).contains(&t) {
            return b + (c - b) * t;
        }
        let a = if k > 0 { column(k - 1) } else { 2.0 * b - c };
        let d = if k + 2 < n { column(k + 2) } else { 2.0 * c - b };
        catmull_rom([a, b, c, d], t)
    }

    /// How far a place is above the beginning of its row.
    fn above(&self, row: i32, p: &Place) -> f64 {
        let last = self.columns.len() - 1;
        let x = (p.at + 0.5 * last as f64).clamp(0.0, last as f64);
        let k = (x as usize).min(last - 1);
        let [left, right] = [k, k + 1].map(|k| self.level(row, k));
        p.up - (left + (right - left) * (x - k as f64))
    }

    /// The directions along a row and up at a place of it.
    pub(super) fn directions(&self, row: i32, p: &Place) -> [DVec3; 2] {
        const BY: f64 = 0.5;
        let above = self.above(row, p);
        let across = self.middle(row, p.at + BY, above) - self.middle(row, p.at - BY, above);
        let up = self.middle(row, p.at, above + BY) - self.middle(row, p.at, above - BY);
        [across.normalize_or(DVec3::X), up.normalize_or(DVec3::Y)]
    }

    /// A place of a row.
    pub(super) fn place(&self, row: i32, p: &Place) -> DVec3 {
        let [across, up] = self.directions(row, p);
        self.middle(row, p.at, self.above(row, p)) + across.cross(up).normalize_or(DVec3::Z) * p.out
    }
}
