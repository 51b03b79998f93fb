//! Letting yarns find room: springs for length, stiffness against bending, contact at the yarn's diameter.
//!
//! Position-based dynamics without time (after Mueller et al., "Position Based Dynamics", 2007): constraints are met one
//! after the other, again and again, in a fixed order, so that the result is the same everywhere. The unit of
//! length is the yarn's diameter.

use std::collections::BTreeSet;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::geometry::contact::{PointGrid, nearest};

/// How a rope goes on after its last point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Ends {
    /// It does not.
    Open,
    /// With its first point, moved by this much: a ring, or a yarn that crosses a periodic cell.
    Joined(DVec3),
}

/// One yarn of diameter 1.
#[derive(Clone, Debug)]
pub(super) struct Rope {
    pub(super) points: Vec<DVec3>,
    /// Points that stay where they are.
    pub(super) pinned: Vec<bool>,
    pub(super) ends: Ends,
    /// Length of each segment at rest.
    pub(super) rest: f64,
}

/// Yarns that want to be smooth, of their length, and apart.
pub(super) struct Relaxation {
    pub(super) ropes: Vec<Rope>,
    /// Size of the cell that repeats along x and y.
    pub(super) period: Option<DVec2>,
    /// How far along x the cell above begins, for its height: the tangent of the angle by which the cell is sheared.
    pub(super) shear: f64,
}

/// Two segments that may touch: segment i of a rope goes from its point i to the next.
struct Pair {
    first: u32,
    second: u32,
    /// By how many periods the second must be moved to be beside the first.
    shift: [i8; 2],
    /// Rounds until they could touch: not looked at before.
    rest: u8,
}

/// What may touch between two ropes, the first at least as early as the second; or within one.
struct Contacts {
    ropes: [usize; 2],
    pairs: Vec<Pair>,
}

/// Contacts are looked for this much beyond touching, and again after so many rounds.
const MARGIN: f64 = 0.3;
const ROUNDS_PER_SEARCH: usize = 8;
/// After so many rounds little moves, and a quarter of the searches do.
const SETTLED: usize = 32;
/// Two yarns come nearer by less than this in a round, but for the first few.
const STEP: f64 = 0.02;
/// Yarns are kept this far apart: a little more than they need, for what a spline does between points.
const APART: f64 = 1.025;
/// How firmly curves straighten, 0 to 1.
const STIFFNESS: f64 = 0.3;
/// Yarns do not bend more tightly than to this radius: half a diameter and a little, for a spline bends more at its points.
const TIGHTEST: f64 = 0.7;
/// The share of rounds at the end in which contact counts most.
const SETTLING: f64 = 0.3;
/// Along a yarn, closer than this is not contact but bending.
const ALONG: f64 = 2.2;

/// Relaxations of fewer points are not worth several threads.
const FEW: usize = 8192;

impl Relaxation {
    /// Meets all constraints `rounds` times, at the end with more weight on contact than on the rest; `tidy` may put
    /// points in order after each.
    pub(super) fn run(&mut self, rounds: usize, mut tidy: impl FnMut(&mut [Rope])) {
        let parallel = self.ropes.iter().map(|r| r.points.len()).sum::<usize>() >= FEW;
        let mut contacts = Vec::new();
        for round in 0..rounds {
            let often = if round < SETTLED { ROUNDS_PER_SEARCH } else { 4 * ROUNDS_PER_SEARCH };
            if round % often == 0 {
                contacts = independent(self.search());
            }
            let settling = round as f64 > (1.0 - SETTLING) * rounds as f64;
            let (stiffness, firmness) = if settling { (0.3 * STIFFNESS, 0.3) } else { (STIFFNESS, 1.0) };
            // Every other round backwards: a fixed direction would lean all loops to one side.
            let backwards = round % 2 == 1;
            each(&mut self.ropes, parallel, |rope| {
                rope.straighten(stiffness, backwards);
                rope.keep_length(firmness, backwards);
                rope.unbend(backwards);
            });
            if backwards {
                contacts.iter_mut().rev().for_each(|group| self.part(group, true, parallel));
            } else {
                contacts.iter_mut().for_each(|group| self.part(group, false, parallel));
            }
            tidy(&mut self.ropes);
        }
    }

    /// What may touch in the rounds to come.
    fn search(&self) -> Vec<Contacts> {
        let segments = || self.ropes.iter().flat_map(|rope| (0..rope.segments()).map(|i| rope.segment(i)));
        let middles: Vec<DVec3> = segments().map(|(p, q)| 0.5 * (p + q)).collect();
        let halves: Vec<f64> = segments().map(|(p, q)| 0.5 * p.distance(q)).collect();
        let rope_of: Vec<u32> =
            self.ropes.iter().enumerate().flat_map(|(r, rope)| (0..rope.segments()).map(move |_| r as u32)).collect();
        let mut starts = vec![0];
        starts.extend(self.ropes.iter().scan(0, |sum, rope| {
            *sum += rope.segments();
            Some(*sum)
        }));
        let longest = halves.iter().copied().fold(0.1, f64::max).min(0.5);
        let touch = 1.0 + MARGIN;
        // The grid is of a cell with right angles: what is near in a sheared one is a little further off there.
        let upright: Vec<DVec3> = middles.iter().map(|p| sheared(*p, -self.shear)).collect();
        let grid = PointGrid::new(&upright, (touch + 2.0 * longest) * (1.0 + self.shear.abs()), self.period);
        let of_rope = |r: usize| -> Vec<Contacts> {
            let mut found: Vec<Contacts> = Vec::new();
            let mut walk = grid.walk();
            let rope = &self.ropes[r];
            let apart = (ALONG / rope.rest).ceil() as usize;
            for i in 0..rope.segments() {
                let own = starts[r] + i;
                let (middle, half) = (middles[own], halves[own]);
                let widest = (touch + half + longest).powi(2);
                let (p0, p1) = rope.segment(i);
                for near in walk.around(own) {
                    let other = near.index as usize;
                    let mut cells = [0.0; 2];
                    let mut shift = DVec3::ZERO;
                    if let Some(period) = self.period {
                        let d = near.at - upright[own];
                        cells = [-(d.x / period.x).round(), -(d.y / period.y).round()];
                        shift = shift_by(cells, period, self.shear);
                    }
                    // Most of what cells hold is too far away: tell that before anything is computed.
                    let distance = (sheared(near.at, self.shear) + shift - middle).length_squared();
                    if distance > widest || other <= own || distance > (touch + half + halves[other]).powi(2) {
                        continue;
                    }
                    let second_rope = rope_of[other] as usize;
                    let second = other - starts[second_rope];
                    if second_rope == r {
                        let along = second - i;
                        let around = if rope.ends == Ends::Open { usize::MAX } else { rope.points.len() - along };
                        // A yarn's own image next door is another strand, unless it is the way across the border.
                        let same = match rope.ends {
                            Ends::Joined(jump) if around < along => (shift + jump).length_squared() < 1e-6,
                            _ => shift == DVec3::ZERO,
                        };
                        if same && along.min(around) < apart {
                            continue;
                        }
                    }
                    let (q0, q1) = self.ropes[second_rope].segment(second);
                    if nearest(p0, p1, q0 + shift, q1 + shift).between.length_squared() > touch * touch {
                        continue;
                    }
                    let ropes = [r, second_rope];
                    let group = found.iter().position(|c| c.ropes == ropes).unwrap_or_else(|| {
                        found.push(Contacts { ropes, pairs: Vec::new() });
                        found.len() - 1
                    });
                    let shift = cells.map(|c| c as i8);
                    found[group].pairs.push(Pair { first: i as u32, second: second as u32, shift, rest: 0 });
                }
            }
            found
        };
        (0..self.ropes.len()).into_par_iter().flat_map_iter(of_rope).collect()
    }

    /// Parts what touches, in a group of contacts that have no rope in common.
    fn part(&mut self, group: &mut [Contacts], backwards: bool, parallel: bool) {
        let mut taken: Vec<([Vec<DVec3>; 2], &mut Contacts)> = Vec::with_capacity(group.len());
        for contacts in group {
            // Within one rope the second is found empty.
            let points = contacts.ropes.map(|r| std::mem::take(&mut self.ropes[r].points));
            taken.push((points, contacts));
        }
        each(&mut taken, parallel, |(points, contacts)| {
            let [first, second] = points;
            let mut sides = Sides {
                points: [first, second],
                second: usize::from(contacts.ropes[0] != contacts.ropes[1]),
                ropes: contacts.ropes.map(|r| &self.ropes[r]),
                period: self.period.unwrap_or_default(),
                shear: self.shear,
            };
            if backwards {
                contacts.pairs.iter_mut().rev().for_each(|pair| sides.part(pair));
            } else {
                contacts.pairs.iter_mut().for_each(|pair| sides.part(pair));
            }
        });
        for ([first, second], contacts) in taken {
            let [a, b] = contacts.ropes;
            self.ropes[b].points = second;
            self.ropes[a].points = first;
        }
    }
}

/// Does something to each item: side by side, if that is worth while. Items know nothing of each other, so that it makes
/// no other difference.
fn each<T: Send>(items: &mut [T], parallel: bool, act: impl Fn(&mut T) + Send + Sync) {
    if parallel {
        items.par_iter_mut().for_each(act);
    } else {
        items.iter_mut().for_each(act);
    }
}

/// Groups contacts so that in each group no rope is met twice, early ones first.
fn independent(contacts: Vec<Contacts>) -> Vec<Vec<Contacts>> {
    let mut groups: Vec<(BTreeSet<usize>, Vec<Contacts>)> = Vec::new();
    for c in contacts {
        let free = groups.iter().position(|(met, _)| c.ropes.iter().all(|r| !met.contains(r)));
        let group = free.unwrap_or_else(|| {
            groups.push(Default::default());
            groups.len() - 1
        });
        groups[group].0.extend(c.ropes);
        groups[group].1.push(c);
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

/// The vector of so many periods of a sheared cell.
fn shift_by(cells: [f64; 2], period: DVec2, shear: f64) -> DVec3 {
    sheared(DVec3::new(cells[0] * period.x, cells[1] * period.y, 0.0), shear)
}

/// A place moved along x by so much of its height.
pub(super) fn sheared(p: DVec3, shear: f64) -> DVec3 {
    DVec3::new(p.x + shear * p.y, p.y, p.z)
}

impl Rope {
    fn segments(&self) -> usize {
        self.points.len() - usize::from(self.ends == Ends::Open)
    }

    /// The point after point i, and what is added to it.
    #[inline]
    fn next(&self, i: usize, count: usize) -> (usize, DVec3) {
        match self.ends {
            Ends::Joined(jump) if i + 1 == count => (0, jump),
            _ => (i + 1, DVec3::ZERO),
        }
    }

    fn segment(&self, i: usize) -> (DVec3, DVec3) {
        let (next, jump) = self.next(i, self.points.len());
        (self.points[i], self.points[next] + jump)
    }

    /// Moves every point towards where its four neighbours along the yarn would bend least.
    fn straighten(&mut self, stiffness: f64, backwards: bool) {
        let n = self.points.len() as isize;
        if n < 5 {
            return;
        }
        let range = if self.ends == Ends::Open { 2..n - 2 } else { 0..n };
        for k in range.clone() {
            let i = if backwards { range.end - 1 - (k - range.start) } else { k };
            let here = i as usize;
            if self.pinned[here] {
                continue;
            }
            let target = if (2..n - 2).contains(&i) {
                let p = &self.points[here - 2..here + 3];
                (4.0 * (p[1] + p[3]) - p[0] - p[4]) / 6.0
            } else {
                let at = |k: isize| {
                    let j = i + k;
                    let wrapped = self.points[j.rem_euclid(n) as usize];
                    match self.ends {
                        Ends::Joined(jump) => wrapped + jump * j.div_euclid(n) as f64,
                        Ends::Open => wrapped,
                    }
                };
                (4.0 * (at(-1) + at(1)) - at(-2) - at(2)) / 6.0
            };
            self.points[here] = self.points[here].lerp(target, stiffness);
        }
    }

    /// Opens bends that are too tight: a point and the middle of its neighbours come nearer to each other.
    fn unbend(&mut self, backwards: bool) {
        let n = self.points.len();
        let bends = if self.ends == Ends::Open { 1..n.saturating_sub(1) } else { 0..n };
        for k in bends.clone() {
            let i = if backwards { bends.end - 1 - (k - bends.start) } else { k };
            let (next, after) = self.next(i, n);
            let (last, before) = match self.ends {
                Ends::Joined(jump) if i == 0 => (n - 1, -jump),
                _ => (i - 1, DVec3::ZERO),
            };
            let (a, b) = (self.points[last] + before - self.points[i], self.points[next] + after - self.points[i]);
            // On an arc of that radius the chord over two segments would be so far away.
            let most = a.length_squared() * b.length_squared() / (4.0 * TIGHTEST * TIGHTEST);
            let away = -0.5 * (a + b);
            let square = away.length_squared();
            if square <= most {
                continue;
            }
            let by = away * ((1.0 - (most / square).sqrt()) / 1.5);
            for (point, by) in [(i, -by), (last, 0.5 * by), (next, 0.5 * by)] {
                if !self.pinned[point] {
                    self.points[point] += by;
                }
            }
        }
    }

    /// Brings every segment nearer to its length.
    fn keep_length(&mut self, firmness: f64, backwards: bool) {
        let segments = self.segments();
        for k in 0..segments {
            let i = if backwards { segments - 1 - k } else { k };
            let (next, jump) = self.next(i, self.points.len());
            let d = self.points[next] + jump - self.points[i];
            let length = d.length();
            if length < 1e-9 {
                continue;
            }
            let by = d * (firmness * 0.5 * (length - self.rest) / length);
            if !self.pinned[i] {
                self.points[i] += by;
            }
            if !self.pinned[next] {
                self.points[next] -= by;
            }
        }
    }
}

/// The points of two ropes that touch, taken out of them; of one rope, where `second` is 0.
struct Sides<'a> {
    points: [&'a mut [DVec3]; 2],
    second: usize,
    ropes: [&'a Rope; 2],
    period: DVec2,
    shear: f64,
}

impl Sides<'_> {
    /// Parts two segments if they are nearer than yarns can be.
    #[inline]
    fn part(&mut self, pair: &mut Pair) {
        if pair.rest > 0 {
            pair.rest -= 1;
            return;
        }
        let (a, b) = (pair.first as usize, pair.second as usize);
        let (a_next, a_jump) = self.ropes[0].next(a, self.points[0].len());
        let (b_next, b_jump) = self.ropes[1].next(b, self.points[self.second].len());
        let shift = shift_by(pair.shift.map(f64::from), self.period, self.shear);
        let (p0, p1) = (self.points[0][a], self.points[0][a_next] + a_jump);
        let (q0, q1) = (self.points[self.second][b], self.points[self.second][b_next] + b_jump);
        let near = nearest(p0, p1, q0 + shift, q1 + shift);
        let distance = near.between.length();
        if !(1e-9..APART).contains(&distance) {
            pair.rest = ((distance - APART) / STEP).clamp(0.0, 255.0) as u8;
            return;
        }
        let (s, t) = (near.s, near.t);
        let weight = (1.0 - s) * (1.0 - s) + s * s + (1.0 - t) * (1.0 - t) + t * t;
        let by = near.between * ((APART - distance) / (distance * weight));
        self.shift(0, a, -by * (1.0 - s));
        self.shift(0, a_next, -by * s);
        self.shift(1, b, by * (1.0 - t));
        self.shift(1, b_next, by * t);
    }

    #[inline]
    fn shift(&mut self, side: usize, point: usize, by: DVec3) {
        if !self.ropes[side].pinned[point] {
            self.points[side * self.second][point] += by;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two crossing ropes of the given height difference.
    fn cross(gap: f64) -> Relaxation {
        let line = |axis: DVec3, z: f64| (0..21).map(move |i| axis * (f64::from(i) - 10.0) * 0.5 + DVec3::Z * z);
        let rope = |axis, z| Rope {
            points: line(axis, z).collect(),
            pinned: (0..21).map(|i| matches!(i, 0 | 20)).collect(),
            ends: Ends::Open,
            rest: 0.5,
        };
        Relaxation { ropes: vec![rope(DVec3::X, 0.5 * gap), rope(DVec3::Y, -0.5 * gap)], period: None, shear: 0.0 }
    }

    #[test]
    fn crossing_yarns_part_and_stay_on_their_side() {
        let mut r = cross(0.1);
        r.run(200, |_| {});
        let (over, under) = (r.ropes[0].points[10], r.ropes[1].points[10]);
        assert!(over.z - under.z > 0.99, "{}", over.z - under.z);
        // Pinned ends have not moved.
        assert_eq!(r.ropes[0].points[0], DVec3::new(-5.0, 0.0, 0.05));
    }

    #[test]
    fn what_does_not_touch_stays() {
        let mut r = cross(1.5);
        let before = r.ropes.clone();
        r.run(50, |_| {});
        for (a, b) in before.iter().flat_map(|r| &r.points).zip(r.ropes.iter().flat_map(|r| &r.points)) {
            assert!(a.distance(*b) < 1e-9);
        }
    }

    #[test]
    fn ropes_across_a_border_part_all_along() {
        // Two rows that cross a cell 9 wide, one of them just above its upper border.
        let (n, period) = (18, DVec2::new(9.0, 9.0));
        let rope = |y: f64, z: f64| Rope {
            points: (0..n).map(|i| DVec3::new(0.5 * f64::from(i), y, z)).collect(),
            pinned: vec![false; n as usize],
            ends: Ends::Joined(DVec3::X * period.x),
            rest: 0.5,
        };
        let mut r = Relaxation { ropes: vec![rope(8.9, 0.0), rope(0.1, 0.3)], period: Some(period), shear: 0.0 };
        r.run(100, |_| {});
        for i in 0..n as usize {
            let gap = (r.ropes[1].points[i] + DVec3::Y * period.y).distance(r.ropes[0].points[i]);
            assert!((1.0..1.3).contains(&gap), "{i}: {gap}");
        }
    }

    #[test]
    fn a_bend_that_is_too_tight_opens() {
        // A hairpin of half circles a quarter of a diameter wide.
        let at = |i: i32| match i {
            0..10 => DVec3::new(f64::from(i) * 0.5, 0.0, 0.0),
            _ => DVec3::new(f64::from(19 - i) * 0.5, 0.25, 0.0),
        };
        let points: Vec<DVec3> = (0..20).map(at).collect();
        let mut rope = Rope { pinned: vec![false; 20], points, ends: Ends::Open, rest: 0.5 };
        for round in 0..200 {
            rope.keep_length(1.0, round % 2 == 1);
            rope.unbend(round % 2 == 1);
        }
        for w in rope.points.windows(3) {
            let (a, b) = (w[1] - w[0], w[2] - w[1]);
            let radius = a.length() * b.length() / (b - a).length();
            assert!(radius > 0.95 * TIGHTEST, "{radius}");
        }
    }

    #[test]
    fn groups_have_no_rope_twice_and_lose_nothing() {
        let contacts: Vec<Contacts> = (0..12)
            .flat_map(|a| (a..12.min(a + 4)).map(move |b| Contacts { ropes: [a, b], pairs: Vec::new() }))
            .collect();
        let count = contacts.len();
        let groups = independent(contacts);
        assert_eq!(groups.iter().map(Vec::len).sum::<usize>(), count);
        for group in groups {
            let mut met = BTreeSet::new();
            for c in &group {
                let fresh = met.insert(c.ropes[0]) && (c.ropes[0] == c.ropes[1] || met.insert(c.ropes[1]));
                assert!(fresh, "{:?} again", c.ropes);
            }
        }
    }

    #[test]
    fn a_ring_keeps_its_length_and_becomes_round() {
        let n = 40;
        let at = |i: usize| std::f64::consts::TAU * i as f64 / n as f64;
        let points: Vec<DVec3> = (0..n).map(|i| DVec3::new(3.0 * at(i).cos(), 2.0 * at(i).sin(), 0.0)).collect();
        let ring = Rope { points, pinned: vec![false; n], ends: Ends::Joined(DVec3::ZERO), rest: 16.0 / n as f64 };
        let mut r = Relaxation { ropes: vec![ring], period: None, shear: 0.0 };
        r.run(6000, |_| {});
        let points = &r.ropes[0].points;
        let middle = points.iter().sum::<DVec3>() / n as f64;
        let radii: Vec<f64> = points.iter().map(|p| p.distance(middle)).collect();
        let (low, high) = radii.iter().fold((f64::MAX, 0.0_f64), |(l, h), &x| (l.min(x), h.max(x)));
        assert!(high - low < 0.5, "{low} to {high}");
        assert!((low - 16.0 / std::f64::consts::TAU).abs() < 0.3, "{low}");
    }
}
