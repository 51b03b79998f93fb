//! Flat cloth that decreases and increases shape: rows lie square to its wales, which come together and part, so that rows turn a
//! corner where a mitre or a shawl has its spine, and slant beside a raglan's edge. It is a net of stitches in the plane, held by
//! springs across, up and askew.
//!
//! Places are counted along each row, in stitches, as if it lay over the one below, so that wales lean from row to row; between rows
//! the cloth follows them.

use glam::DVec3;

use super::{super::shape::Place, net::Net};
use crate::{
    geometry::spline::{catmull_rom, through_points},
    pattern::chart::{Act, Stitch},
};

/// Stiffness of the net against shear and against bending, over that against stretching: rows turn corners within few stitches.
const SHEAR: f64 = 0.25;
const BEND: f64 = 0.1;
/// How much farther than a row is high three stitches are from the one that they become, in rows: what room they take.
const TRIPLE: f64 = 0.8;

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

/// Gives what is not known what is beside it.
fn filled(known: Vec<Option<f64>>) -> Vec<f64> {
    let value = |k: usize| {
        let sides = [known[..k].iter().rev().find_map(|v| *v), known[k + 1..].iter().find_map(|v| *v)];
        let beside: Vec<f64> = sides.into_iter().flatten().collect();
        known[k].unwrap_or_else(|| beside.iter().sum::<f64>() / beside.len().max(1) as f64)
    };
    (0..known.len()).map(value).collect()
}

/// The net as it is laid: the numbers of the points of each line, and what each point is drawn through.
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

    /// The stitches of the line below that a stitch of a line takes, or lies between: the first one and the last one.
    fn below(&self, line: usize, j: usize) -> Option<[usize; 2]> {
        let Some(stitch) = self.stitch(line, j) else { return (line > 0).then_some([j, j]) };
        let last = self.lines[line - 1].len() - 1;
        let first = stitch.first_parent as usize;
        let ends = match stitch.parents {
            0 => [first.saturating_sub(1), first],
            parents => [first, first + usize::from(parents) - 1],
        };
        Some(ends.map(|p| p.min(last)))
    }

    /// The stitch of a row; none for the cast-on edge and the top.
    fn stitch(&self, line: usize, j: usize) -> Option<&'a Stitch> {
        self.rows.get(line.checked_sub(1)?).map(|row| &row[j])
    }

    /// Whether a stitch stands in the wale of what it takes: strands of a cable change places.
    fn is_in_line(&self, line: usize, j: usize) -> bool {
        line > 0 && self.stitch(line, j).is_none_or(|s| s.parents > 0 && s.layer == 0 && s.act != Act::CastOn)
    }

    /// Holds the stitches of a line to each other and to those below.
    fn hold(&mut self, line: usize) {
        let (width, count) = (self.width(line), self.lines[line].len());
        let height = if line > 0 { (self.from[line][1] - self.from[line - 1][1]) * self.height } else { 0.0 };
        for j in 0..count {
            let own = self.lines[line][j];
            if j + 1 < count {
                self.net.hold(own, self.lines[line][j + 1], width, 1.0);
            }
            if j > 0 && j + 1 < count {
                self.net.straighten([self.lines[line][j - 1], own, self.lines[line][j + 1]], 0.5);
            }
            let Some([first, last]) = self.below(line, j) else { continue };
            let stitch = self.stitch(line, j);
            for p in first..=last {
                let parent = self.lines[line - 1][p];
                let (rest, firm) = match stitch {
                    Some(s) if s.act == Act::CastOn => continue,
                    Some(s) if s.parents == 0 => ((0.5 * width).hypot(height), SHEAR),
                    Some(s) if s.layer != 0 => (self.net.points[own].distance(self.net.points[parent]), 1.0),
                    Some(s) if s.parents > 2 => (height + TRIPLE * self.height, 1.0),
                    _ => (height, 1.0),
                };
                self.net.hold(parent, own, rest, firm);
            }
            if !self.is_in_line(line, j) {
                continue;
            }
            // A wale of three stitches wants to be straight.
            if first == last
                && line > 1
                && self.is_in_line(line - 1, first)
                && let Some([under, same]) = self.below(line - 1, first)
                && under == same
            {
                self.net.straighten([self.lines[line - 2][under], self.lines[line - 1][first], own], 0.5);
            }
            // Two beside each other, as what they take: a mesh with four corners.
            if j + 1 < count
                && self.is_in_line(line, j + 1)
                && let Some([right, _]) = self.below(line, j + 1)
                && right == last + 1
            {
                let rest = width.hypot(height);
                self.net.hold(self.lines[line - 1][last], self.lines[line][j + 1], rest, SHEAR);
                self.net.hold(self.lines[line - 1][right], own, rest, SHEAR);
            }
        }
    }

    /// By how many stitches each leans from what it takes, and what is made of each on the line below likewise.
    fn leans(&self, line: usize) -> [Vec<f64>; 2] {
        let [under, own] = [line - 1, line].map(|l| self.lines[l].len());
        let mut above: Vec<[f64; 2]> = vec![[0.0; 2]; under];
        let mut from_below = vec![None; own];
        for (j, lean) in from_below.iter_mut().enumerate().filter(|(j, _)| self.is_in_line(line, *j)) {
            let Some([first, last]) = self.below(line, j) else { continue };
            let by = |p: usize| self.at(line, j) - self.at(line - 1, p);
            for (p, own) in above.iter_mut().enumerate().take(last + 1).skip(first) {
                *own = [own[0] + by(p), own[1] + 1.0];
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
