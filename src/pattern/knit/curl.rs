//! How a knit curls by itself: its repeat is bent round to rings of several sizes, both ways and both sides out, and relaxed; the
//! energy of the rings tells its natural curvature and its stiffness.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::{
    super::rods::{Rods, Run, Strand},
    cell::Cell,
};
use crate::math::special::smooth_step;

/// Radii of the rings, in diameters.
const RADII: [f64; 3] = [5.0, 8.0, 14.0];
const STEPS: usize = 1500;
/// Share of the energy of a flat stitch that both sides must differ by: what relaxing leaves is smaller.
const NOISE: f64 = 0.02;

/// What bending one way does to a knit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bending {
    /// Curvature that it takes by itself, per diameter: to the back if positive.
    pub(super) natural: f64,
    /// Energy of a stitch by half the square of the curvature.
    pub(super) stiffness: f64,
}

/// Which way a knit is bent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// Along its courses, as its sides roll.
    Courses,
    /// Along its wales, as its lower and its upper edge do.
    Wales,
}

/// How rings and the flat cell relax.
const RUN: Run =
    Run { steps: STEPS, growing: 0, thin: 1.0, free: [true; 2], load: DVec2::ZERO, press: 0.0, firm: 1.0, calm: 0.002 };

/// Energy of a stitch of a cell that nothing bends.
fn flat_energy(cell: &Cell) -> f64 {
    let mut flat = cell.rods.clone();
    flat.relax(&RUN);
    flat.energy() / f64::from(cell.wide * cell.high)
}

impl Bending {
    /// Measured on a cell with so much energy in a stitch while it is flat.
    pub(super) fn of(cell: &Cell, flat: f64, way: Way) -> Self {
        let mut found = vec![(0.0, flat)];
        for radius in RADII {
            for side in [1.0, -1.0] {
                let (mut ring, counted, curvature) = bent(cell, way, radius, side);
                let free = [way == Way::Wales, way == Way::Courses];
                ring.relax(&Run { free, ..RUN });
                found.push((curvature, ring.energy() / counted));
            }
        }
        fitted(&found)
    }
}

/// The parabola through energies by curvatures, with the least squares. Cloth of which both sides are alike does not curl.
fn fitted(found: &[(f64, f64)]) -> Bending {
    let flat = found[0].1;
    let differ = found[1..].chunks(2).map(|both| (both[0].1 - both[1].1).abs()).fold(0.0, f64::max);
    // E = a k + b k^2, through the flat one.
    let sum = |f: &dyn Fn(f64, f64) -> f64| found[1..].iter().map(|&(k, e)| f(k, e - flat)).sum::<f64>();
    let (k2, k3, k4) = (sum(&|k, _| k * k), sum(&|k, _| k.powi(3)), sum(&|k, _| k.powi(4)));
    let (ke, k2e) = (sum(&|k, e| k * e), sum(&|k, e| k * k * e));
    let det = k2 * k4 - k3 * k3;
    let (a, b) = ((ke * k4 - k2e * k3) / det, (k2e * k2 - ke * k3) / det);
    let natural = match differ > NOISE * flat {
        false => 0.0,
        // No farther than what was measured.
        true if b > 0.0 => (-0.5 * a / b).clamp(-1.0 / RADII[0], 1.0 / RADII[0]),
        true => -a.signum() / RADII[0],
    };
    Bending { natural, stiffness: 2.0 * b }
}

/// A cell that goes round in a ring about that radius, with its right side outside or inside: also the stitches in it, and its
/// curvature.
fn bent(cell: &Cell, way: Way, radius: f64, side: f64) -> (Rods, f64, f64) {
    let (own, high) = (cell.period, cell.high as usize);
    let (length, other) = if way == Way::Courses { (own.x, own.y) } else { (own.y, own.x) };
    let count = (TAU * radius / length).round().max(2.0);
    let radius = length * count / TAU;
    // Within a period that has room for it.
    let room = 2.0 * radius + 16.0;
    let place = |p: DVec3| {
        let along = if way == Way::Courses { p.x } else { p.y };
        let (sin, cos) = (along / radius).sin_cos();
        let r = radius + side * p.z;
        match way {
            Way::Courses => DVec3::new(0.5 * room + r * sin, p.y, r * cos),
            Way::Wales => DVec3::new(p.x, 0.5 * room + r * sin, r * cos),
        }
    };
    let (period, rows, repeats) = match way {
        Way::Courses => (DVec2::new(room, other), high, count as usize),
        Way::Wales => (DVec2::new(other, room), high * count as usize, 1),
    };
    let mut rods = Rods { period: Some(period), ..Rods::default() };
    for row in 0..rows {
        let start = rods.points.len();
        for k in 0..(cell.visits[row % high].len() - 1) * repeats {
            rods.points.extend(cell.visit(row, k).map(|(p, _)| place(p)));
            rods.rest.resize(rods.points.len(), cell.rest(row, k));
        }
        let jump = if way == Way::Courses { DVec3::ZERO } else { DVec3::X * other };
        rods.strands.push(Strand { start, count: rods.points.len() - start, jump: Some(jump) });
    }
    let stitches = count * f64::from(cell.wide * cell.high);
    (rods, stitches, side / radius)
}

/// An edge that rolls: its curvature grows towards the edge, so that each turn has room in the one around it (an involute of a
/// circle).
#[derive(Clone, Copy, Debug)]
struct Roll {
    /// 1 to the back, -1 to the front.
    back: f64,
    /// Radius of curvature where it begins, and how much less it is for each radian.
    outer: f64,
    tighter: f64,
    /// How much cloth it takes.
    length: f64,
}

/// An edge rolls by so much at most, and takes so much of the cloth: friction and weight hold the rest down.
const MOST_TURN: f64 = 0.75 * TAU;
const SHARE: f64 = 0.2;
/// Over so many times what it takes an edge that gives way at the corners rolls less and less.
const FADING: f64 = 2.0;

impl Roll {
    /// None where cloth does not curl.
    fn new(bending: Bending, thickness: f64, span: f64) -> Option<Self> {
        if bending.natural == 0.0 {
            return None;
        }
        let inner = (1.0 / bending.natural.abs()).max(thickness);
        let tighter = thickness / TAU;
        let turn = ((inner * inner + 2.0 * tighter * SHARE * span).sqrt() - inner) / tighter;
        let turn = turn.min(MOST_TURN);
        let length = inner * turn + 0.5 * tighter * turn * turn;
        Some(Self { back: bending.natural.signum(), outer: inner + tighter * turn, tighter, length })
    }

    /// Rolls what is at `at` from the middle between two such edges, and `out` of the plane, by a share of the curvature.
    fn place(&self, [at, out]: [f64; 2], half: f64, share: f64) -> [f64; 2] {
        let (side, from) = (at.signum(), half - self.length);
        let along = at.abs() - from;
        if along <= 0.0 || share < 1e-3 {
            return [at, out];
        }
        let rolled = along.min(self.length);
        let angle =
            (self.outer - (self.outer * self.outer - 2.0 * self.tighter * rolled).max(0.0).sqrt()) / self.tighter;
        let (outer, tighter, angle) = (self.outer / share, self.tighter / (share * share), angle * share);
        let (sin, cos) = angle.sin_cos();
        let radius = outer - tighter * angle;
        // Straight on beyond the edge.
        let over = along - rolled;
        let x = radius * sin + tighter * (1.0 - cos) + over * cos;
        let z = outer - radius * cos - tighter * sin + over * sin;
        [side * (from + x + self.back * sin * out), self.back * -z + cos * out]
    }
}

/// How a flat piece lies that is not blocked.
#[derive(Clone, Copy, Debug)]
pub(super) struct Curl {
    sides: Option<Roll>,
    ends: Option<Roll>,
    /// Whether the sides roll with more energy: they do in the corners too.
    sides_first: bool,
    half: DVec2,
}

impl Curl {
    /// Measured on the cell of a piece so wide and high, in diameters.
    pub(super) fn of(cell: &Cell, size: DVec2) -> Self {
        let z = || cell.rods.points.iter().map(|p| p.z);
        let thickness = z().fold(f64::MIN, f64::max) - z().fold(f64::MAX, f64::min) + 1.0;
        let flat = flat_energy(cell);
        let [sides, ends] = [Way::Courses, Way::Wales].map(|way| Bending::of(cell, flat, way));
        let energy = |b: Bending| b.stiffness * b.natural * b.natural;
        Self {
            sides: Roll::new(sides, thickness, size.x),
            ends: Roll::new(ends, thickness, size.y),
            sides_first: energy(sides) >= energy(ends),
            half: 0.5 * size,
        }
    }

    /// Whether it stays as it was blocked.
    pub(super) fn is_flat(&self) -> bool {
        self.sides.is_none() && self.ends.is_none()
    }

    /// Where a point of the piece comes to lie, from its middle. Edges that give way at the corners roll less and less towards them.
    pub(super) fn place(&self, p: DVec3) -> DVec3 {
        let share = |own: &Roll, first: Option<Roll>, at: f64, half: f64| {
            let over = |first: Roll| (FADING * own.length).min(half - first.length);
            smooth_step(first.map_or(1.0, |first| (half - at.abs() - first.length) / over(first)))
        };
        let across = |p: DVec3, share: f64| {
            let [x, z] = self.sides.map_or([p.x, p.z], |roll| roll.place([p.x, p.z], self.half.x, share));
            DVec3::new(x, p.y, z)
        };
        let up = |p: DVec3, share: f64| {
            let [y, z] = self.ends.map_or([p.y, p.z], |roll| roll.place([p.y, p.z], self.half.y, share));
            DVec3::new(p.x, y, z)
        };
        match self.sides_first {
            true => across(up(p, self.ends.map_or(0.0, |own| share(&own, self.sides, p.x, self.half.x))), 1.0),
            false => up(across(p, self.sides.map_or(0.0, |own| share(&own, self.ends, p.y, self.half.y))), 1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{super::chart::Chart, YARN_PER_STITCH},
        *,
    };

    fn bending(name: &str) -> [Bending; 2] {
        let chart = Chart::named(name).unwrap();
        let wide = chart.even_width(100).unwrap();
        let cell = Cell::relaxed(&chart, wide, YARN_PER_STITCH, 14, [None; 2]);
        let flat = flat_energy(&cell);
        let found = [Way::Courses, Way::Wales].map(|way| Bending::of(&cell, flat, way));
        eprintln!("{name}: {found:?}");
        found
    }

    #[test]
    fn sides_of_stockinette_roll_to_the_back_and_its_edges_to_the_front() {
        let [sides, ends] = bending("stockinette");
        assert!(sides.natural > 0.05 && ends.natural < -0.05, "{sides:?} {ends:?}");
        assert!(sides.stiffness > 0.0 && ends.stiffness > 0.0);
        let purl = bending("reverse-stockinette");
        for (purl, knit) in purl.iter().zip([sides, ends]) {
            assert!((purl.natural + knit.natural).abs() < 0.01, "{purl:?} {knit:?}");
        }
    }

    #[test]
    fn what_is_alike_on_both_sides_lies_flat() {
        for name in ["garter", "seed", "rib1x1"] {
            assert_eq!(bending(name).map(|b| b.natural), [0.0; 2], "{name}");
        }
    }

    #[test]
    fn a_roll_keeps_the_length_of_the_cloth_and_its_thickness() {
        let roll = Roll::new(Bending { natural: 0.2, stiffness: 1.0 }, 2.4, 100.0).unwrap();
        let at = |k: u32, out: f64| DVec2::from(roll.place([f64::from(k) * 0.01, out], 50.0, 1.0));
        let length: f64 = (0..5000).map(|k| at(k, 0.0).distance(at(k + 1, 0.0))).sum();
        assert!((length - 50.0).abs() < 1e-3, "{length}");
        for k in (0..5000).step_by(100) {
            assert!((at(k, 0.5).distance(at(k, -0.5)) - 1.0).abs() < 1e-9);
        }
        // To the back, and what is a turn inside of the other has room.
        assert!(at(4000, 0.0).y < 0.0);
        for (a, b) in (2000..5000).step_by(20).flat_map(|a| (a + 700..5000).step_by(20).map(move |b| (a, b))) {
            assert!(at(a, 0.0).distance(at(b, 0.0)) > 2.39, "{a} {b}");
        }
    }
}
