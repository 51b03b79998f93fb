//! Flat cloth that decreases and increases shape: rows lie square to its wales, which come together and part, so that rows turn a
//! corner where a mitre or a shawl has its spine, and slant beside a raglan's edge. It is a net of stitches in the plane, held by
//! springs across, up and askew.
//!
//! Places are counted along each row, in stitches, as if it lay over the one below, so that wales lean from row to row; between rows
//! the cloth follows them.

use glam::DVec3;

use super::{
    super::{
        bonds::{self, At, Bond, Made, Origin},
        loops::TRIPLE,
        shape::Place,
    },
    net::Net,
};
use crate::{
    geometry::spline::{catmull_rom, through_points},
    pattern::chart::{Act, Stitch},
};

/// Stiffness of the net against shear and against bending, over that against stretching: rows turn corners within few stitches.
const SHEAR: f64 = 0.25;
const BEND: f64 = 0.1;

/// The beginnings of a row's stitches, from the left.
struct Line {
    points: Vec<DVec3>,
    /// Where the first one is, and how far up they are, in rows.
    first: f64,
    up: f64,
    /// By how many stitches the wale of each leans to the right on its way to the line above, and from that below.
    to_above: Vec<f64>,
    from_below: Vec<f64>,
}

/// The net at rest; its unit is the yarn's diameter, its middle at the origin.
pub(in super::super) struct Shaped {
    /// The cast-on edge, the rows, and the top of the last one.
    lines: Vec<Line>,
    width: f64,
}

impl Line {
    /// How far along its list a place is.
    fn along(&self, at: f64) -> f64 {
        at - self.first
    }

    /// Where it is at a place; beyond its ends it goes straight on.
    fn at(&self, at: f64, width: f64) -> DVec3 {
        let (x, last) = (self.along(at), self.points.len() - 1);
        if last == 0 {
            return self.points[0] + DVec3::X * (x * width);
        }
        let k = (x.max(0.0) as usize).min(last - 1);
        let t = x - k as f64;
        match (0.0..=1.0).contains(&t) {
            true => through_points(&self.points, k, t),
            false => self.points[k].lerp(self.points[k + 1], t),
        }
    }

    /// One of its leans at a place.
    fn lean(&self, leans: &[f64], at: f64) -> f64 {
        let (x, last) = (self.along(at), leans.len() - 1);
        let x = x.clamp(0.0, last as f64);
        let k = (x as usize).min(last.saturating_sub(1));
        let next = leans[(k + 1).min(last)];
        leans[k] + (next - leans[k]) * (x - k as f64)
    }
}

/// Gives what is not known the mean of what is known on either side of it.
fn filled(known: Vec<Option<f64>>) -> Vec<f64> {
    let beside = |k: usize| {
        let sides = [known[..k].iter().rev().find_map(|v| *v), known[k + 1..].iter().find_map(|v| *v)];
        let sides: Vec<f64> = sides.into_iter().flatten().collect();
        sides.iter().sum::<f64>() / sides.len().max(1) as f64
    };
    known.iter().enumerate().map(|(k, value)| value.unwrap_or_else(|| beside(k))).collect()
}

/// The net as it is laid: the numbers of the points of each line.
struct Laid<'a> {
    net: Net,
    lines: Vec<Vec<usize>>,
    /// Where the first stitch of each is, and how far up it is.
    from: &'a [[f64; 2]],
    rows: &'a [Vec<Stitch>],
    widths: &'a [f64],
    height: f64,
}

impl<'a> Laid<'a> {
    fn new(rows: &'a [Vec<Stitch>], from: &'a [[f64; 2]], widths: &'a [f64], height: f64) -> Self {
        let mut laid = Self { net: Net::new(BEND), lines: Vec::new(), from, rows, widths, height };
        let taken = |s: &Stitch| s.first_parent as usize + usize::from(s.parents);
        let cast_on = rows[0].iter().map(taken).max().unwrap_or(0).max(1);
        let counts = std::iter::once(cast_on).chain(rows.iter().map(Vec::len)).chain(rows.last().map(Vec::len));
        for (line, count) in counts.enumerate() {
            let up = from[line][1] * height;
            let point = |j: usize| DVec3::new(laid.at(line, j) * laid.width(line), up, 0.0);
            let points: Vec<DVec3> = (0..count).map(point).collect();
            let numbers = points.into_iter().map(|p| laid.net.add(p)).collect();
            laid.lines.push(numbers);
        }
        (0..laid.lines.len()).for_each(|line| laid.hold(line));
        laid
    }

    /// Where a stitch of a line is, in stitches.
    fn at(&self, line: usize, j: usize) -> f64 {
        self.from[line][0] + j as f64
    }

    fn width(&self, line: usize) -> f64 {
        self.widths[line.saturating_sub(1).min(self.widths.len() - 1)]
    }

    /// What a stitch of a line is made of. The top goes on as the last row.
    fn made(&self, [line, j]: At) -> Option<Made> {
        let (line, column) = (usize::try_from(line).ok()?, usize::try_from(j).ok()?);
        self.lines.get(line)?.get(column)?;
        let Some(below) = line.checked_sub(1) else { return Some(Made { origin: Origin::Cast, below: [0; 2] }) };
        let Some(stitch) = self.rows.get(below).map(|row| row[column]) else {
            return Some(Made { origin: Origin::Drawn, below: [j; 2] });
        };
        let Made { origin, below: ends } = Made::of(&stitch);
        let last = self.lines[below].len() as isize - 1;
        let origin = if stitch.act == Act::CastOn { Origin::Cast } else { origin };
        Some(Made { origin, below: ends.map(|p| p.clamp(0, last)) })
    }

    fn node(&self, [line, j]: At) -> usize {
        self.lines[line as usize][j as usize]
    }

    /// Holds the stitches of a line to each other and to those below.
    fn hold(&mut self, line: usize) {
        let mut bonds = Vec::new();
        let count = self.lines[line].len() as isize;
        (0..count).for_each(|j| bonds::of_stitch(&|at| self.made(at), [line as isize, j], &mut bonds));
        let up = |line: usize| self.from[line][1];
        let (width, height) = (self.width(line), (up(line) - up(line.saturating_sub(1))) * self.height);
        for bond in bonds {
            let (ends, rest, firm) = match bond {
                Bond::Beside(ends) => (ends, width, 1.0),
                Bond::Drawn { ends, count } if count > 2 => (ends, height + TRIPLE * self.height, 1.0),
                Bond::Drawn { ends, .. } => (ends, height, 1.0),
                Bond::Crossed(ends) => {
                    let [parent, own] = ends.map(|end| self.net.points[self.node(end)]);
                    (ends, own.distance(parent), 1.0)
                }
                Bond::Between(ends) => (ends, (0.5 * width).hypot(height), SHEAR),
                Bond::Askew(ends) => (ends, width.hypot(height), SHEAR),
                Bond::Straight(places) => {
                    self.net.straighten(places.map(|place| self.node(place)), 0.5);
                    continue;
                }
            };
            let [a, b] = ends.map(|end| self.node(end));
            self.net.hold(a, b, rest, firm);
        }
    }

    /// By how many stitches each stitch of a line leans from what it takes, and before that those below it to what is made of them.
    fn leans(&self, line: usize) -> [Vec<f64>; 2] {
        let [under, own] = [line - 1, line].map(|l| self.lines[l].len());
        let mut above: Vec<[f64; 2]> = vec![[0.0; 2]; under];
        let mut from_below = vec![None; own];
        for (j, lean) in from_below.iter_mut().enumerate() {
            let made = self.made([line as isize, j as isize]).filter(|made| made.origin == Origin::Drawn);
            let Some([first, last]) = made.map(|made| made.below.map(|p| p as usize)) else { continue };
            let by = |p: usize| self.at(line, j) - self.at(line - 1, p);
            for (p, [sum, count]) in above.iter_mut().enumerate().take(last + 1).skip(first) {
                (*sum, *count) = (*sum + by(p), *count + 1.0);
            }
            *lean = Some(0.5 * (by(first) + by(last)));
        }
        let to_above = above.into_iter().map(|[sum, count]| (count > 0.0).then(|| sum / count)).collect();
        [filled(to_above), filled(from_below)]
    }
}

impl Shaped {
    /// Lets a net of rows find its form, with the width of a stitch in each row and the height of all. `from` says for the cast-on
    /// edge, each row, and the top of the last one where its first stitch is and how far up it begins.
    pub(in super::super) fn relaxed(rows: &[Vec<Stitch>], from: &[[f64; 2]], widths: &[f64], height: f64) -> Self {
        let mut laid = Laid::new(rows, from, widths, height);
        laid.net.relax();
        let [low, high] = laid.net.bounds();
        let middle = 0.5 * (low + high);
        let line = |(numbers, [first, up]): (&Vec<usize>, &[f64; 2])| Line {
            first: *first,
            up: *up,
            points: numbers.iter().map(|n| laid.net.points[*n] - middle).collect(),
            // Beyond the edges none leans.
            to_above: vec![0.0; numbers.len()],
            from_below: vec![0.0; numbers.len()],
        };
        let mut lines: Vec<Line> = laid.lines.iter().zip(from).map(line).collect();
        for k in 1..lines.len() {
            let [to_above, from_below] = laid.leans(k);
            lines[k - 1].to_above = to_above;
            lines[k].from_below = from_below;
        }
        Self { lines, width: widths[0] }
    }

    pub(super) fn width(&self) -> f64 {
        self.width
    }

    /// The line below a place so many rows up, and the share of the way to the next one; below 0 and above 1 beyond the edges.
    fn between(&self, up: f64) -> (usize, f64) {
        let above = self.lines.partition_point(|line| line.up <= up).clamp(1, self.lines.len() - 1);
        let [low, high] = [above - 1, above].map(|k| self.lines[k].up);
        (above - 1, (up - low) / (high - low))
    }

    /// By how many stitches the wale leans in a row's height, at a place.
    fn lean(&self, at: f64, up: f64) -> f64 {
        let (k, t) = self.between(up);
        let (low, high) = (&self.lines[k], &self.lines[k + 1]);
        let t = t.clamp(0.0, 1.0);
        (1.0 - t) * low.lean(&low.to_above, at) + t * high.lean(&high.from_below, at)
    }

    /// Where the cloth is.
    fn middle(&self, at: f64, up: f64) -> DVec3 {
        let (k, t) = self.between(up);
        let lean = self.lean(at, up);
        let (low, high) = (&self.lines[k], &self.lines[k + 1]);
        // Where its wale crosses both lines.
        let (from, to) = (at - lean * t, at + lean * (1.0 - t));
        let (a, b) = (low.at(from, self.width), high.at(to, self.width));
        if !(0.0..=1.0).contains(&t) {
            return a + (b - a) * t;
        }
        let before = k.checked_sub(1).map(|k| self.lines[k].at(from - low.lean(&low.from_below, from), self.width));
        let after = self.lines.get(k + 2).map(|l| l.at(to + high.lean(&high.to_above, to), self.width));
        catmull_rom([before.unwrap_or(2.0 * a - b), a, b, after.unwrap_or(2.0 * b - a)], t)
    }

    /// The directions along a row and up its wale at a place.
    pub(super) fn directions(&self, p: &Place) -> [DVec3; 2] {
        const BY: f64 = 0.25;
        let lean = self.lean(p.at, p.up) * BY;
        let across = self.middle(p.at + BY, p.up) - self.middle(p.at - BY, p.up);
        let up = self.middle(p.at + lean, p.up + BY) - self.middle(p.at - lean, p.up - BY);
        [across.normalize_or(DVec3::X), up.normalize_or(DVec3::Y)]
    }

    /// A place; it lies in the plane.
    pub(super) fn place(&self, p: &Place) -> DVec3 {
        self.middle(p.at, p.up) + DVec3::Z * p.out
    }
}
