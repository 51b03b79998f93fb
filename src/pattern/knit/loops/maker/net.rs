//! Where the stitches of a repeat are whose wales lean: decreases draw them together, yarn-overs drive them apart, and
//! courses stay square to their wales, so that rows wave.
//!
//! The repeat is a net in the plane with periodic borders, a point for each stitch. Springs along courses and wales keep
//! their lengths, weaker ones askew keep angles, and it finds its own width and height.

use glam::DVec2;

use crate::pattern::{
    chart::{Act, Stitch},
    knit::{
        ROW_HEIGHT, STITCH_WIDTH,
        bonds::{self, At, Bond, Made},
    },
    rods::Fire,
};

/// Stiffness against shear and against bending of courses and of wales, over that against stretching: knitted cloth shears
/// easily, but not without a force.
const SHEAR: f64 = 0.25;
const BEND: f64 = 0.1;
/// Most steps, and the force at which it is at rest: that of a spring longer by so much of a diameter.
const STEPS: usize = 4000;
const CALM: f64 = 1e-3;
/// The longest step in time, of points of mass 1 and springs of stiffness 1.
const TIME: f64 = 0.3;

/// A point of the net, moved by so many periods.
#[derive(Clone, Copy)]
struct Node {
    point: usize,
    periods: DVec2,
}

struct Spring {
    ends: [Node; 2],
    /// Its length at rest, in diameters.
    rest: f64,
    firm: f64,
}

pub(super) struct Net {
    points: Vec<DVec2>,
    /// Stitches of a row, and rows.
    wide: usize,
    high: usize,
    period: DVec2,
    springs: Vec<Spring>,
    /// Three points that want to be evenly spaced on a line.
    lines: Vec<[Node; 3]>,
}

/// Whether a stitch moves the wales beside it: what takes more or less than one.
fn is_shaping(stitch: &Stitch) -> bool {
    matches!(stitch.act, Act::Draw | Act::Over) && stitch.layer == 0 && stitch.parents != 1
}

impl Net {
    /// The net of a repeat; none if no wale leans in it.
    pub(super) fn new(rows: &[Vec<Stitch>]) -> Option<Self> {
        let (wide, high) = (rows[0].len(), rows.len());
        // Strands that are lifted close to a decrease would not stay in the loops that they are drawn through.
        let is_lifted = |s: &Stitch| matches!(s.act, Act::Lift { .. });
        let even = rows.iter().all(|row| row.len() == wide);
        if !even || !rows.iter().flatten().any(is_shaping) || rows.iter().flatten().any(is_lifted) {
            return None;
        }
        let size = DVec2::new(STITCH_WIDTH, ROW_HEIGHT);
        let place = |k: usize| size * DVec2::new((k % wide) as f64 + 0.5, (k / wide) as f64);
        let points = (0..wide * high).map(place).collect();
        let period = size * DVec2::new(wide as f64, high as f64);
        let mut net = Self { points, wide, high, period, springs: Vec::new(), lines: Vec::new() };
        (0..high).for_each(|r| net.hold_row(rows, r));
        Some(net)
    }

    /// A stitch of a row, counted on beyond the sides and below the first row.
    fn node(&self, [r, j]: At) -> Node {
        let (wide, high) = (self.wide as isize, self.high as isize);
        let periods = DVec2::new(j.div_euclid(wide) as f64, r.div_euclid(high) as f64);
        Node { point: (r.rem_euclid(high) * wide + j.rem_euclid(wide)) as usize, periods }
    }

    fn at(&self, node: Node) -> DVec2 {
        self.points[node.point] + node.periods * self.period
    }

    /// Holds the stitches of a row to each other and to those below.
    fn hold_row(&mut self, rows: &[Vec<Stitch>], r: usize) {
        let [wide, high] = [self.wide, self.high].map(|count| count as isize);
        let made = |[r, j]: At| {
            let made = Made::of(&rows[r.rem_euclid(high) as usize][j.rem_euclid(wide) as usize]);
            let round = j.div_euclid(wide) * wide;
            Some(Made { below: made.below.map(|p| p + round), ..made })
        };
        let mut bonds = Vec::new();
        (0..wide).for_each(|j| bonds::of_stitch(&made, [r as isize, j], &mut bonds));
        for bond in bonds {
            let (ends, rest, firm) = match bond {
                Bond::Beside(ends) => (ends, STITCH_WIDTH, 1.0),
                Bond::Drawn { ends, .. } => (ends, ROW_HEIGHT, 1.0),
                // Stitches that change places stay as far from each other as they are.
                Bond::Crossed(ends) => {
                    let [parent, own] = ends.map(|end| self.at(self.node(end)));
                    (ends, own.distance(parent), 1.0)
                }
                Bond::Between(ends) => (ends, (0.5 * STITCH_WIDTH).hypot(ROW_HEIGHT), SHEAR),
                Bond::Askew(ends) => (ends, STITCH_WIDTH.hypot(ROW_HEIGHT), SHEAR),
                Bond::Straight(places) => {
                    self.lines.push(places.map(|place| self.node(place)));
                    continue;
                }
            };
            self.springs.push(Spring { ends: ends.map(|end| self.node(end)), rest, firm });
        }
    }

    /// Forces on the points, and on the logarithms of width and height; gives the largest of a point.
    fn forces(&self, forces: &mut [DVec2]) -> (f64, DVec2) {
        forces.fill(DVec2::ZERO);
        let mut virial = DVec2::ZERO;
        for Spring { ends: [a, b], rest, firm } in &self.springs {
            let d = self.at(*b) - self.at(*a);
            let length = d.length().max(1e-9);
            let pull = d * (firm * (length - rest) / length);
            forces[a.point] += pull;
            forces[b.point] -= pull;
            virial += pull * d;
        }
        for [a, b, c] in &self.lines {
            let off = self.at(*b) - 0.5 * (self.at(*a) + self.at(*c));
            forces[a.point] += off * (0.5 * BEND);
            forces[b.point] -= off * BEND;
            forces[c.point] += off * (0.5 * BEND);
        }
        (forces.iter().map(|f| f.length_squared()).fold(0.0, f64::max).sqrt(), -virial)
    }

    /// Lets it find its form.
    pub(super) fn relax(&mut self) {
        let n = self.points.len();
        let (mut forces, mut speeds) = (vec![DVec2::ZERO; n], vec![DVec2::ZERO; n]);
        // Its size moves as if it weighed as much as its points.
        let (weight, mut size_speed) = ((n as f64).sqrt() * self.period.max_element(), DVec2::ZERO);
        let mut fire = Fire::new(TIME);
        for _ in 0..STEPS {
            let (largest, size_force) = self.forces(&mut forces);
            let size_force = size_force / weight;
            if largest < CALM && size_force.length() < CALM {
                return;
            }
            let dot = |a: &[DVec2], b: &[DVec2]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
            let power = dot(&forces, &speeds) + size_force.dot(size_speed);
            let force = (dot(&forces, &forces) + size_force.length_squared()).sqrt();
            let speed = (dot(&speeds, &speeds) + size_speed.length_squared()).sqrt();
            let (keep, turn) = fire.adapt(power, force, speed);
            for ((p, v), f) in self.points.iter_mut().zip(&mut speeds).zip(&forces) {
                *v = *v * keep + *f * (turn + fire.dt);
                *p += *v * fire.dt;
            }
            size_speed = size_speed * keep + size_force * (turn + fire.dt);
            let by = DVec2::ONE + size_speed * (fire.dt / weight);
            self.period *= by;
            self.points.iter_mut().for_each(|p| *p *= by);
        }
    }

    /// Where each stitch is, in widths of stitches and heights of rows, those of each row from the first one. The middle of
    /// all is where it would be if they were even.
    pub(super) fn places(&self) -> Vec<Vec<DVec2>> {
        let count = DVec2::new(self.wide as f64, self.high as f64);
        let unit = self.period / count;
        let middle = self.points.iter().sum::<DVec2>() / (unit * count.x * count.y);
        let shift = 0.5 * (count - DVec2::Y) - middle;
        self.points.chunks(self.wide).map(|row| row.iter().map(|p| *p / unit + shift).collect()).collect()
    }
}
