//! Letting yarns find room: springs for length, stiffness against bending, contact at the yarn's diameter.
//!
//! Position-based dynamics without time (after Mueller et al., "Position Based Dynamics", 2007): constraints are met one
//! after the other, again and again, in a fixed order, so that the result is the same everywhere. The unit of
//! length is the yarn's diameter.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::contact::{Grid, nearest};

/// How a rope goes on after its last point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Ends {
    /// It does not.
    Open,
    /// With its first point, moved by this much: a ring, or a yarn that crosses a periodic cell.
    Joined(DVec3),
}

/// A run of points that are one yarn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rope {
    pub(super) first: usize,
    pub(super) count: usize,
    pub(super) ends: Ends,
    /// Length of each segment at rest.
    pub(super) rest: f64,
}

/// Yarns of diameter 1 that want to be smooth, of their length, and apart.
pub(super) struct Relaxation {
    pub(super) points: Vec<DVec3>,
    pub(super) ropes: Vec<Rope>,
    /// Points that stay where they are.
    pub(super) pinned: Vec<bool>,
    /// Size of the cell that repeats along x and y.
    pub(super) period: Option<DVec2>,
}

/// A segment: its rope's next point, and the place along its rope.
#[derive(Clone, Copy)]
struct Segment {
    a: u32,
    b: u32,
    rope: u32,
    /// What is added to point b.
    jump: DVec3,
}

/// Two segments that may touch.
struct Pair {
    first: u32,
    second: u32,
    /// What is added to the second to bring it beside the first.
    shift: DVec3,
    /// Rounds until they could touch: not looked at before.
    rest: u8,
}

/// Contacts are looked for this much beyond touching, and again after so many rounds.
const MARGIN: f64 = 0.3;
const ROUNDS_PER_SEARCH: usize = 8;
/// After so many rounds little moves, and half as many searches do.
const SETTLED: usize = 32;
/// Two yarns come nearer by less than this in a round, but for the first few.
const STEP: f64 = 0.04;
/// Yarns are kept this far apart: a little more than they need, for what a spline does between points.
const APART: f64 = 1.025;
/// How firmly curves straighten, 0 to 1.
const STIFFNESS: f64 = 0.3;
/// The share of rounds at the end in which contact counts most.
const SETTLING: f64 = 0.3;
/// Along a yarn, closer than this is not contact but bending.
const ALONG: f64 = 2.2;

impl Relaxation {
    /// Meets all constraints `rounds` times, at the end with more weight on contact than on the rest; `tidy` may put
    /// points in order after each.
    pub(super) fn run(&mut self, rounds: usize, mut tidy: impl FnMut(&mut [DVec3])) {
        let segments = self.segments();
        let mut pairs = Vec::new();
        for round in 0..rounds {
            let often = if round < SETTLED { ROUNDS_PER_SEARCH } else { 2 * ROUNDS_PER_SEARCH };
            if round % often == 0 {
                pairs = self.search(&segments);
            }
            let settling = round as f64 > (1.0 - SETTLING) * rounds as f64;
            let (stiffness, firmness) = if settling { (0.3 * STIFFNESS, 0.3) } else { (STIFFNESS, 1.0) };
            // Every other round backwards: a fixed direction would lean all loops to one side.
            if round % 2 == 0 {
                self.straighten(stiffness, false);
                self.keep_length(segments.iter(), firmness);
                self.part(&segments, pairs.iter_mut());
            } else {
                self.straighten(stiffness, true);
                self.keep_length(segments.iter().rev(), firmness);
                self.part(&segments, pairs.iter_mut().rev());
            }
            tidy(&mut self.points);
        }
    }

    fn segments(&self) -> Vec<Segment> {
        let mut out = Vec::with_capacity(self.points.len());
        for (index, rope) in self.ropes.iter().enumerate() {
            let segment = |i: usize, next: usize, jump| Segment {
                a: (rope.first + i) as u32,
                b: (rope.first + next) as u32,
                rope: index as u32,
                jump,
            };
            out.extend((1..rope.count).map(|i| segment(i - 1, i, DVec3::ZERO)));
            if let Ends::Joined(jump) = rope.ends {
                out.push(segment(rope.count - 1, 0, jump));
            }
        }
        out
    }

    fn ends(&self, s: &Segment) -> (DVec3, DVec3) {
        (self.points[s.a as usize], self.points[s.b as usize] + s.jump)
    }

    fn search(&self, segments: &[Segment]) -> Vec<Pair> {
        let middles: Vec<DVec3> = segments.iter().map(|s| 0.5 * (self.ends(s).0 + self.ends(s).1)).collect();
        let halves: Vec<f64> = segments.iter().map(|s| 0.5 * self.ends(s).0.distance(self.ends(s).1)).collect();
        let longest = 2.0 * halves.iter().copied().fold(0.1, f64::max).min(0.5);
        let reach = 1.0 + MARGIN + longest;
        let grid = Grid::new(&middles, reach, self.period);
        let of_segment = |i: usize| -> Vec<Pair> {
            let mut found = Vec::new();
            let (a, middle) = (&segments[i], middles[i]);
            let rope = &self.ropes[a.rope as usize];
            let apart = (ALONG / rope.rest).ceil() as usize;
            let (p0, p1) = self.ends(a);
            grid.around(middle, |j| {
                if j as usize <= i {
                    return;
                }
                let b = &segments[j as usize];
                let mut shift = DVec3::ZERO;
                if let Some(period) = self.period {
                    let d = middles[j as usize] - middle;
                    shift.x = -period.x * (d.x / period.x).round();
                    shift.y = -period.y * (d.y / period.y).round();
                }
                // Most of what a cell holds is too far away: tell that before anything is computed.
                let far = 1.0 + MARGIN + halves[i] + halves[j as usize];
                if (middles[j as usize] + shift - middle).length_squared() > far * far {
                    return;
                }
                if a.rope == b.rope {
                    let along = (b.a - a.a) as usize;
                    let around = if rope.ends == Ends::Open { usize::MAX } else { rope.count - along };
                    // A yarn's own image next door is another strand, unless it is the way across the border.
                    let same = match rope.ends {
                        Ends::Joined(jump) if around < along => (shift + jump).length_squared() < 1e-6,
                        _ => shift == DVec3::ZERO,
                    };
                    if same && along.min(around) < apart {
                        return;
                    }
                }
                let (q0, q1) = self.ends(b);
                let d = nearest(p0, p1, q0 + shift, q1 + shift).between.length_squared();
                if d < (1.0 + MARGIN) * (1.0 + MARGIN) {
                    found.push(Pair { first: i as u32, second: j, shift, rest: 0 });
                }
            });
            found
        };
        (0..segments.len()).into_par_iter().with_min_len(256).flat_map_iter(of_segment).collect()
    }

    /// Moves every point towards where its four neighbours along the yarn would bend least.
    fn straighten(&mut self, stiffness: f64, backwards: bool) {
        let ropes = std::mem::take(&mut self.ropes);
        for rope in &ropes {
            let n = rope.count as isize;
            if n < 5 {
                continue;
            }
            let range = if rope.ends == Ends::Open { 2..n - 2 } else { 0..n };
            for k in range.clone() {
                let i = if backwards { range.end - 1 - (k - range.start) } else { k };
                let here = rope.first + i as usize;
                if self.pinned[here] {
                    continue;
                }
                let target = if (2..n - 2).contains(&i) {
                    let p = &self.points[here - 2..here + 3];
                    (4.0 * (p[1] + p[3]) - p[0] - p[4]) / 6.0
                } else {
                    let at = |k: isize| {
                        let j = i + k;
                        let wrapped = self.points[rope.first + j.rem_euclid(n) as usize];
                        match rope.ends {
                            Ends::Joined(jump) => wrapped + jump * j.div_euclid(n) as f64,
                            Ends::Open => wrapped,
                        }
                    };
                    (4.0 * (at(-1) + at(1)) - at(-2) - at(2)) / 6.0
                };
                let moved = self.points[here].lerp(target, stiffness);
                self.points[here] = moved;
            }
        }
        self.ropes = ropes;
    }

    fn keep_length<'a>(&mut self, segments: impl Iterator<Item = &'a Segment>, firmness: f64) {
        for s in segments {
            let (p, q) = self.ends(s);
            let d = q - p;
            let length = d.length();
            if length < 1e-9 {
                continue;
            }
            let by = d * (firmness * 0.5 * (length - self.ropes[s.rope as usize].rest) / length);
            self.shift(s.a as usize, by);
            self.shift(s.b as usize, -by);
        }
    }

    fn part<'a>(&mut self, segments: &[Segment], pairs: impl Iterator<Item = &'a mut Pair>) {
        for pair in pairs {
            if pair.rest > 0 {
                pair.rest -= 1;
                continue;
            }
            let (a, b) = (&segments[pair.first as usize], &segments[pair.second as usize]);
            let (p0, p1) = self.ends(a);
            let (q0, q1) = self.ends(b);
            let near = nearest(p0, p1, q0 + pair.shift, q1 + pair.shift);
            let distance = near.between.length();
            if !(1e-9..APART).contains(&distance) {
                pair.rest = ((distance - APART) / STEP).clamp(0.0, 255.0) as u8;
                continue;
            }
            let (s, t) = (near.s, near.t);
            let weight = (1.0 - s) * (1.0 - s) + s * s + (1.0 - t) * (1.0 - t) + t * t;
            let by = near.between * ((APART - distance) / (distance * weight));
            self.shift(a.a as usize, -by * (1.0 - s));
            self.shift(a.b as usize, -by * s);
            self.shift(b.a as usize, by * (1.0 - t));
            self.shift(b.b as usize, by * t);
        }
    }

    fn shift(&mut self, point: usize, by: DVec3) {
        if !self.pinned[point] {
            self.points[point] += by;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two crossing ropes of the given height difference.
    fn cross(gap: f64) -> Relaxation {
        let line = |axis: DVec3, z: f64| (0..21).map(move |i| axis * (f64::from(i) - 10.0) * 0.5 + DVec3::Z * z);
        let points: Vec<DVec3> = line(DVec3::X, 0.5 * gap).chain(line(DVec3::Y, -0.5 * gap)).collect();
        let rope = |first| Rope { first, count: 21, ends: Ends::Open, rest: 0.5 };
        let pinned = points.iter().enumerate().map(|(i, _)| matches!(i, 0 | 20 | 21 | 41)).collect();
        Relaxation { points, ropes: vec![rope(0), rope(21)], pinned, period: None }
    }

    #[test]
    fn crossing_yarns_part_and_stay_on_their_side() {
        let mut r = cross(0.1);
        r.run(200, |_| {});
        let (over, under) = (r.points[10], r.points[31]);
        assert!(over.z - under.z > 0.99, "{}", over.z - under.z);
        // Pinned ends have not moved.
        assert_eq!(r.points[0], DVec3::new(-5.0, 0.0, 0.05));
    }

    #[test]
    fn what_does_not_touch_stays() {
        let mut r = cross(1.5);
        let before = r.points.clone();
        r.run(50, |_| {});
        for (a, b) in before.iter().zip(&r.points) {
            assert!(a.distance(*b) < 1e-9);
        }
    }

    #[test]
    fn a_ring_keeps_its_length_and_becomes_round() {
        let n = 40;
        let at = |i: usize| std::f64::consts::TAU * i as f64 / n as f64;
        let points: Vec<DVec3> = (0..n).map(|i| DVec3::new(3.0 * at(i).cos(), 2.0 * at(i).sin(), 0.0)).collect();
        let rest = 16.0 / n as f64;
        let ropes = vec![Rope { first: 0, count: n, ends: Ends::Joined(DVec3::ZERO), rest }];
        let mut r = Relaxation { pinned: vec![false; n], points, ropes, period: None };
        r.run(6000, |_| {});
        let middle = r.points.iter().sum::<DVec3>() / n as f64;
        let radii: Vec<f64> = r.points.iter().map(|p| p.distance(middle)).collect();
        let (low, high) = radii.iter().fold((f64::MAX, 0.0_f64), |(l, h), &x| (l.min(x), h.max(x)));
        assert!(high - low < 0.5, "{low} to {high}");
        assert!((low - 16.0 / std::f64::consts::TAU).abs() < 0.3, "{low}");
    }
}
