//! A net of stitches: points that springs hold apart, and that want to lie on lines. It finds its form as cloth does that is blocked.

use glam::DVec3;

use crate::pattern::rods::Fire;

/// Most steps, and how many springs and lines are worked through at most, for nets that are large.
const STEPS: usize = 8000;
const MOST: usize = 400_000_000;
/// The force at which it is at rest: that of a spring longer by so much.
const CALM: f64 = 2e-4;
/// The longest step in time, of points of mass 1 and springs of stiffness 1.
const TIME: f64 = 0.3;

struct Spring {
    ends: [usize; 2],
    rest: f64,
    firm: f64,
}

/// Three points that want to be on a line, the second one at a share of the way.
struct Line {
    points: [usize; 3],
    share: f64,
}

pub(super) struct Net {
    pub(super) points: Vec<DVec3>,
    springs: Vec<Spring>,
    lines: Vec<Line>,
    /// Stiffness against bending, over that against stretching.
    bend: f64,
}

impl Net {
    pub(super) fn new(bend: f64) -> Self {
        Self { points: Vec::new(), springs: Vec::new(), lines: Vec::new(), bend }
    }

    /// The number of another point.
    pub(super) fn add(&mut self, point: DVec3) -> usize {
        self.points.push(point);
        self.points.len() - 1
    }

    /// Holds two points so far apart; `firm` is 1 across and up, and less askew.
    pub(super) fn hold(&mut self, a: usize, b: usize, rest: f64, firm: f64) {
        if a != b {
            self.springs.push(Spring { ends: [a, b], rest, firm });
        }
    }

    /// Makes the second of three points want to lie at a share of the way between the others.
    pub(super) fn straighten(&mut self, points: [usize; 3], share: f64) {
        self.lines.push(Line { points, share });
    }

    /// Pulls of all springs; gives the largest.
    fn forces(&self, forces: &mut [DVec3]) -> f64 {
        forces.fill(DVec3::ZERO);
        for Spring { ends: [a, b], rest, firm } in &self.springs {
            let d = self.points[*b] - self.points[*a];
            let length = d.length().max(1e-9);
            let pull = d * (firm * (length - rest) / length);
            forces[*a] += pull;
            forces[*b] -= pull;
        }
        for Line { points: [a, b, c], share } in &self.lines {
            let off = self.points[*b] - self.points[*a].lerp(self.points[*c], *share);
            forces[*a] += off * (self.bend * (1.0 - share));
            forces[*b] -= off * self.bend;
            forces[*c] += off * (self.bend * share);
        }
        forces.iter().map(|f| f.length_squared()).fold(0.0, f64::max).sqrt()
    }

    /// How much springs across and up are longer or shorter than at rest, in the mean, over their length.
    pub(super) fn strain(&self) -> f64 {
        let firm = || self.springs.iter().filter(|s| s.firm == 1.0);
        let of = |s: &Spring| (self.points[s.ends[0]].distance(self.points[s.ends[1]]) / s.rest - 1.0).abs();
        firm().map(of).sum::<f64>() / firm().count().max(1) as f64
    }

    /// The corners of a box around it.
    pub(super) fn bounds(&self) -> [DVec3; 2] {
        let low = self.points.iter().copied().fold(DVec3::MAX, DVec3::min);
        [low, self.points.iter().copied().fold(DVec3::MIN, DVec3::max)]
    }

    /// Lets it find its form.
    pub(super) fn relax(&mut self) {
        let n = self.points.len();
        let (mut forces, mut speeds) = (vec![DVec3::ZERO; n], vec![DVec3::ZERO; n]);
        let mut fire = Fire::new(TIME);
        for _ in 0..STEPS.min(MOST / (self.springs.len() + self.lines.len()).max(1)) {
            if self.forces(&mut forces) < CALM {
                return;
            }
            let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
            let (power, force2, speed2) = (dot(&forces, &speeds), dot(&forces, &forces), dot(&speeds, &speeds));
            let (keep, turn) = fire.adapt(power, force2.sqrt(), speed2.sqrt());
            for ((p, v), f) in self.points.iter_mut().zip(&mut speeds).zip(&forces) {
                *v = *v * keep + *f * (turn + fire.dt);
                *p += *v * fire.dt;
            }
        }
    }
}
