//! A straight way through a yarn, seen in the unwound yarn: unbent, round, its plies untwisted.
//!
//! There plies are straight cylinders along the yarn and the way is a curve. It is known, with its slope, at a few
//! stations, and goes from each to the next as the cubic that has both slopes. Where plies turn by `MOST_TURN` between two
//! stations that cubic is off by less than 0.01 yarn radii. A way that crosses a yarn steeply needs two stations, at its ends.
//! Plies are looked for four at a time.

use std::{
    array,
    ops::{Add, Mul},
};

use arrayvec::ArrayVec;
use glam::Vec2;
use wide::f32x4;

use super::ply::PlyShape;

/// The most by which plies turn between two stations, radians.
pub(super) const MOST_TURN: f32 = 0.8;
/// The most stations of a way.
const MOST_STATIONS: usize = 64;

/// A point of a way in the unwound yarn. Lengths are in yarn radii.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Station {
    /// Distance along the way.
    pub depth: f32,
    /// In the section of the unwound yarn.
    pub at: Vec2,
    /// How `at` changes with `depth`.
    pub slope: Vec2,
    /// Place along the yarn's axis.
    pub travel: f32,
    /// How `travel` changes with `depth`.
    pub advance: f32,
    /// How long a step along the yarn is here, over that on its axis: less inside of a bend.
    pub straightness: f32,
}

/// A way through a yarn, from its start on.
pub(crate) type Way = ArrayVec<Station, MOST_STATIONS>;

/// A stretch of a way that passes a ply.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passage {
    /// Where it enters the ply's core; where it only grazes the ply's outer fibres, the nearest point.
    pub enter: Station,
    /// Where it leaves the core.
    pub exit: Station,
    /// Depth where it is nearest to the ply's axis, along the straight line that goes on from there: before the start of the
    /// way if it starts beyond that point.
    pub foot: f32,
    /// Signed distance of that line from the ply's axis, in the circle that the ply's section becomes.
    pub offset: f32,
    /// Length in that circle of one unit of depth: in the mean of the passage.
    pub speed: f32,
    /// How much longer a step of the way is in that circle than in the round yarn's section, where it is nearest to the axis: 1 if the ply is
    /// round.
    pub stretched: f32,
    /// The share of the chord through the core that the way has: less than 1 where it begins or ends inside.
    pub share: f32,
}

/// What is between two stations: at(u) = from + u (slope + u (square + u cube)), u from 0 to 1.
#[derive(Clone, Copy)]
struct Arc {
    from: Vec2,
    to: Vec2,
    slope: Vec2,
    square: Vec2,
    cube: Vec2,
    /// How far it is off the line from `from` to `to` at most.
    off: f32,
}

/// Farther off a line an arc counts as bent.
const BENT: f32 = 1e-5;
/// Less off a line, one step of Newton's method tells where an arc enters a ply, in yarn radii.
const LITTLE: f32 = 0.02;
/// Farther off a line, in yarn radii, where an arc is nearest to a ply's axis does not tell what it has of the ply.
const MUCH: f32 = 0.15;

impl Arc {
    #[inline]
    fn between(a: &Station, b: &Station) -> Self {
        let length = b.depth - a.depth;
        let (from, to, slope) = (a.at, b.at, a.slope * length);
        let chord = to - from;
        let (bow, end_bow) = (slope - chord, b.slope * length - chord);
        let size = |v: Vec2| v.x.abs().max(v.y.abs()) * 1.42;
        let off = (4.0 / 27.0) * (size(bow) + size(end_bow));
        Self { from, to, slope, square: -2.0 * bow - end_bow, cube: bow + end_bow, off }
    }

    /// As seen from the middle of a ply, in coordinates in which it is a circle.
    #[inline]
    fn about(&self, ply: &PlyShape) -> Self {
        let centre = ply.distance * ply.direction;
        let (from, to) = (self.from - centre, self.to - centre);
        if ply.stretch.x == 1.0 {
            return Self { from, to, ..*self };
        }
        let to_circle = |p: Vec2| Vec2::new(p.dot(ply.direction), ply.direction.perp_dot(p)) * ply.stretch;
        Self {
            from: to_circle(from),
            to: to_circle(to),
            slope: to_circle(self.slope),
            square: to_circle(self.square),
            cube: to_circle(self.cube),
            off: self.off * ply.stretch.max_element(),
        }
    }

    #[inline]
    fn at(&self, u: f32) -> Vec2 {
        self.from + u * (self.slope + u * (self.square + u * self.cube))
    }

    #[inline]
    fn slope_at(&self, u: f32) -> Vec2 {
        self.slope + u * (2.0 * self.square + 3.0 * u * self.cube)
    }

    #[inline]
    fn bend_at(&self, u: f32) -> Vec2 {
        2.0 * self.square + 6.0 * u * self.cube
    }

    /// The station at `u` of the arc from `a` to `b`.
    #[inline]
    fn station(&self, a: &Station, b: &Station, u: f32) -> Station {
        let length = b.depth - a.depth;
        Station {
            depth: a.depth + u * length,
            at: self.at(u),
            slope: self.slope_at(u) / length.max(1e-12),
            travel: a.travel + u * (b.travel - a.travel),
            advance: a.advance + u * (b.advance - a.advance),
            straightness: a.straightness + u * (b.straightness - a.straightness),
        }
    }

    /// Where it is nearest to the middles of four plies, each in coordinates in which it is a circle: a bit for each ply that
    /// it passes, and u, by so many rounds of Newton's method.
    #[inline]
    fn nearest<const ROUNDS: u32>(&self, plies: &FourPlies) -> (u32, f32x4) {
        let from = plies.to_circle(plies.seen(self.from));
        let chord = plies.to_circle(Four::splat(self.to - self.from));
        let inverse = f32x4::ONE / chord.dot(chord).fast_max(f32x4::splat(1e-20));
        let between = |u: f32x4| u.fast_max(f32x4::ZERO).fast_min(f32x4::ONE);
        let mut u = between(-from.dot(chord) * inverse);
        let at = from + chord * u;
        let off = f32x4::splat(self.off) * plies.largest_stretch;
        let reach = plies.radius + off;
        let near = at.dot(at).simd_lt(reach * reach) & plies.present;
        if self.off <= BENT || near.none() {
            return (near.to_bitmask(), u);
        }
        // Newton for at . slope = 0.
        let slope = plies.to_circle(Four::splat(self.slope));
        let square = plies.to_circle(Four::splat(self.square));
        let cube = plies.to_circle(Four::splat(self.cube));
        let at = |u: f32x4| from + (slope + (square + cube * u) * u) * u;
        let (two, three) = (f32x4::splat(2.0), f32x4::splat(3.0));
        for _ in 0..ROUNDS {
            let at = at(u);
            let slope = slope + (square * two + cube * (three * u)) * u;
            let bend = (square + cube * (three * u)) * two;
            let speed = slope.dot(slope);
            let rise = (speed + at.dot(bend)).fast_max(f32x4::splat(0.2) * speed + f32x4::splat(1e-20));
            u = between(u - at.dot(slope) / rise);
        }
        let square = |u: f32x4| {
            let at = at(u);
            at.dot(at)
        };
        let mut nearest = square(u);
        if ROUNDS > 1 && self.off > MUCH {
            // It may turn back, and be nearest where it begins or ends. (Where only straight ways are asked for, this is left out: see
            // `Section::plies_ahead`.)
            for end in [f32x4::ZERO, f32x4::ONE] {
                let there = square(end);
                u = there.simd_lt(nearest).select(end, u);
                nearest = nearest.fast_min(there);
            }
        }
        let inside = nearest.simd_lt(plies.radius * plies.radius) & plies.present;
        (inside.to_bitmask(), u)
    }

    /// Where before (`sign` -1) or behind (1) the place `u`, which is nearer to the origin, it is at the distance `radius`.
    #[inline]
    fn crossing(&self, radius: f32, u: f32, sign: f32) -> f32 {
        let (low, high) = if sign < 0.0 { (0.0, u) } else { (u, 1.0) };
        // First as if it were straight from there.
        let (at, slope) = (self.at(u), self.slope_at(u));
        let inverse = 1.0 / slope.length_squared().max(1e-20);
        let foot = -at.dot(slope) * inverse;
        let half = (foot * foot + (radius * radius - at.length_squared()) * inverse).max(0.0).sqrt();
        let mut u = (u + foot + sign * half).clamp(low, high);
        if self.off <= BENT {
            return u;
        }
        for _ in 0..if self.off < LITTLE { 1 } else { 2 } {
            let (at, slope) = (self.at(u), self.slope_at(u));
            let rise = 2.0 * at.dot(slope);
            if rise.abs() < 1e-12 {
                break;
            }
            u = (u - (at.length_squared() - radius * radius) / rise).clamp(low, high);
        }
        u
    }
}

/// Four points or vectors of the section.
#[derive(Clone, Copy)]
struct Four {
    x: f32x4,
    y: f32x4,
}

impl Four {
    #[inline]
    fn splat(v: Vec2) -> Self {
        Self { x: f32x4::splat(v.x), y: f32x4::splat(v.y) }
    }

    #[inline]
    fn dot(self, other: Self) -> f32x4 {
        self.x * other.x + self.y * other.y
    }
}

impl Add for Four {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y }
    }
}

impl Mul<f32x4> for Four {
    type Output = Self;

    #[inline]
    fn mul(self, by: f32x4) -> Self {
        Self { x: self.x * by, y: self.y * by }
    }
}

/// Four plies, or fewer, of a yarn's section, side by side.
#[derive(Clone, Debug)]
pub(super) struct FourPlies {
    /// Index of the first.
    first: usize,
    /// Set for each that there is.
    present: f32x4,
    /// Centres.
    centre: [f32x4; 2],
    /// Radii of circles of the same area.
    radius: f32x4,
    /// Unless all are round: directions and stretches, as those of [`PlyShape`].
    ellipses: Option<[f32x4; 4]>,
    /// The largest stretch of each.
    largest_stretch: f32x4,
}

impl FourPlies {
    /// All plies of a yarn.
    pub(super) fn of(plies: &[PlyShape]) -> Vec<Self> {
        let four = |(index, some): (usize, &[PlyShape])| {
            let lanes = |of: &dyn Fn(&PlyShape) -> f32| f32x4::new(array::from_fn(|k| some.get(k).map_or(0.0, of)));
            let ellipses = some.iter().any(|ply| ply.stretch.x != 1.0).then(|| {
                [lanes(&|p| p.direction.x), lanes(&|p| p.direction.y), lanes(&|p| p.stretch.x), lanes(&|p| p.stretch.y)]
            });
            Self {
                first: 4 * index,
                present: lanes(&|_| 1.0).simd_gt(f32x4::ZERO),
                centre: [lanes(&|p| p.distance * p.direction.x), lanes(&|p| p.distance * p.direction.y)],
                radius: lanes(&|p| p.radius),
                ellipses,
                largest_stretch: lanes(&|p| p.stretch.max_element()),
            }
        };
        plies.chunks(4).enumerate().map(four).collect()
    }

    /// A point as seen from the middle of each.
    #[inline]
    fn seen(&self, at: Vec2) -> Four {
        Four { x: f32x4::splat(at.x) - self.centre[0], y: f32x4::splat(at.y) - self.centre[1] }
    }

    /// Vectors in coordinates in which each ply is a circle.
    #[inline]
    fn to_circle(&self, v: Four) -> Four {
        let Some([x, y, along, across]) = self.ellipses else { return v };
        Four { x: (v.x * x + v.y * y) * along, y: (x * v.y - y * v.x) * across }
    }
}

/// The depth at which the way from one station to the next comes nearest to the axis of a ply that it passes; the first, if it
/// passes several of four.
#[inline]
pub(super) fn passes(a: &Station, b: &Station, plies: &[FourPlies]) -> Option<f32> {
    let arc = Arc::between(a, b);
    plies.iter().find_map(|four| {
        let (met, u) = arc.nearest::<2>(four);
        let u = u.to_array();
        let first = (0..4).filter(|lane| met >> lane & 1 != 0).map(|lane| u[lane]).fold(f32::INFINITY, f32::min);
        (met != 0).then_some(a.depth + first * (b.depth - a.depth))
    })
}

/// Share of the core's radius below which the length of a chord does not tell how fast it is passed.
const SHORT_CHORD: f32 = 0.01;

/// How little of a straight way's the curve of a bent one's distance from a ply's axis counts, and of a bent one's a straight way's.
const LEAST_CURVE: f32 = 0.2;

/// How far a line is followed to its nearest point, in yarn radii.
const FARTHEST_FOOT: f32 = 16.0;

/// A passage as it is found.
#[derive(Clone, Copy)]
pub(super) struct Passing {
    /// Square of the least distance so far, and its depth.
    nearest: f32,
    depth: f32,
    passage: Passage,
    /// Whether the core was met.
    core: bool,
    /// Whether the way came in from outside of the core, and went out of it.
    whole: [bool; 2],
}

impl Passing {
    #[inline]
    fn at(a: &Station) -> Self {
        let passage =
            Passage { enter: *a, exit: *a, foot: a.depth, offset: 0.0, speed: 0.0, stretched: 1.0, share: 1.0 };
        Self { nearest: f32::INFINITY, depth: a.depth, passage, core: false, whole: [false; 2] }
    }

    /// Goes on along an arc from `a` to `b`, which is nearest to the ply's axis at `u`. Whether it stays in the ply.
    #[inline]
    fn follow<const ENDS: bool>(&mut self, way: &Arc, ply: &PlyShape, a: &Station, b: &Station, u: f32) -> bool {
        let length = b.depth - a.depth;
        let arc = way.about(ply);
        let (at, slope) = (arc.at(u), arc.slope_at(u));
        let distance = at.length_squared();
        let passage = &mut self.passage;
        if distance < self.nearest {
            // The square of the distance from the ply's axis is a parabola there: its curve is the ply's, as the way sees it.
            let square = slope.length_squared().max(1e-24);
            let (outward, curve) = (at.dot(slope), square + at.dot(arc.bend_at(u)));
            let curve = curve.clamp(LEAST_CURVE * square, square / LEAST_CURVE);
            self.nearest = distance;
            self.depth = a.depth + length * u;
            passage.offset = (distance - outward * outward / curve).max(0.0).sqrt().copysign(slope.perp_dot(at));
            let ahead = length * (u - outward / curve);
            passage.foot = a.depth + ahead.clamp(-FARTHEST_FOOT, FARTHEST_FOOT);
            passage.speed = curve.sqrt() / length;
            if ply.stretch.x != 1.0 {
                passage.stretched = (square / way.slope_at(u).length_squared().max(1e-24)).sqrt();
            }
            if ENDS && !self.core {
                passage.enter = way.station(a, b, u);
                passage.exit = passage.enter;
            }
        }
        let inside = ply.core_radius * ply.core_radius;
        if ENDS && distance < inside {
            if !self.core {
                let begins = arc.from.length_squared() >= inside;
                let enter = if begins { arc.crossing(ply.core_radius, u, -1.0) } else { 0.0 };
                passage.enter = way.station(a, b, enter);
                self.core = true;
                self.whole[0] = begins;
            }
            let leaves = arc.to.length_squared() >= inside;
            let exit = if leaves { arc.crossing(ply.core_radius, u, 1.0) } else { 1.0 };
            passage.exit = way.station(a, b, exit);
            self.whole[1] = leaves;
        }
        arc.to.length_squared() < ply.radius * ply.radius
    }

    /// As the way goes: where it enters and leaves the core of this radius, if that was asked.
    #[inline]
    pub(super) fn as_it_goes(mut self, core_radius: f32) -> Passage {
        let p = &mut self.passage;
        p.speed = p.speed.max(1e-4);
        if !self.core {
            return self.passage;
        }
        // The chord as if straight, over the depth that it really takes; by the slope where there is next to no chord.
        let chord = 2.0 * (core_radius * core_radius - p.offset * p.offset).max(0.0).sqrt();
        let short = SHORT_CHORD * core_radius;
        let depth = p.exit.depth - p.enter.depth;
        if self.whole == [true; 2] {
            p.speed = (chord + short) / (depth + short / p.speed);
        } else {
            p.share = (depth * p.speed / chord.max(1e-6)).min(1.0);
        }
        self.passage
    }

    /// The passage of a bent way that begins within the yarn: the straight one that is as far from its ends, where it begins and leaves.
    pub(super) fn straightened(mut self, ply: &PlyShape) -> Passage {
        let p = &mut self.passage;
        p.speed = p.speed.max(1e-4);
        if !self.core {
            return self.passage;
        }
        let beside = |square: f32| (square - p.offset * p.offset).max(0.0).sqrt();
        // Along the chord, from its middle.
        let place = |at: &Station, whole: bool, outward: f32| {
            let square = if whole { ply.core_radius * ply.core_radius } else { ply.in_circle(at.at).length_squared() };
            let before = if whole { outward < 0.0 } else { at.depth < self.depth };
            if before { -beside(square) } else { beside(square) }
        };
        let (from, to) = (place(&p.enter, self.whole[0], -1.0), place(&p.exit, self.whole[1], 1.0));
        let short = SHORT_CHORD * ply.core_radius;
        p.speed = ((to - from).max(0.0) + short) / (p.exit.depth - p.enter.depth + short / p.speed);
        p.foot = p.enter.depth - from / p.speed;
        self.passage
    }
}

/// Whether a way is bent so much that what it has of a ply is not told by where it is nearest to the ply's axis.
#[inline]
pub(super) fn is_bent(way: &[Station]) -> bool {
    way.windows(2).any(|pair| Arc::between(&pair[0], &pair[1]).off > MUCH)
}

/// Calls `visit` with every passage of a way through one of `plies`, which are `fours` four by four, and the ply's index;
/// without `ENDS` where it enters and leaves is not asked.
#[inline]
pub(super) fn passages<const ENDS: bool>(
    way: &[Station],
    plies: &[PlyShape],
    fours: &[FourPlies],
    mut visit: impl FnMut(usize, Passing),
) {
    let end = way.last().map_or(0.0, |last| last.depth);
    // A way that ends before it comes to the core has not passed the ply.
    let passed = |open: &Passing| !ENDS || open.core || open.depth < end;
    for four in fours {
        let plies = &plies[four.first..];
        let mut open = [None; 4];
        let mut opened = 0;
        for pair in way.windows(2) {
            let (a, b) = (&pair[0], &pair[1]);
            let arc = Arc::between(a, b);
            let (met, u) = if ENDS { arc.nearest::<2>(four) } else { arc.nearest::<1>(four) };
            let mut left = met | opened;
            if left == 0 {
                continue;
            }
            let u = u.to_array();
            while left != 0 {
                let lane = left.trailing_zeros() as usize;
                left &= left - 1;
                let stays = met >> lane & 1 != 0
                    && open[lane].get_or_insert_with(|| Passing::at(a)).follow::<ENDS>(
                        &arc,
                        &plies[lane],
                        a,
                        b,
                        u[lane],
                    );
                if stays {
                    opened |= 1 << lane;
                } else if let Some(open) = open[lane].take() {
                    opened &= !(1 << lane);
                    visit(four.first + lane, open);
                }
            }
        }
        for (lane, open) in open.iter().enumerate() {
            if let Some(open) = open.as_ref().filter(|open| passed(open)) {
                visit(four.first + lane, *open);
            }
        }
    }
}

/// The same of a bent way, each as [`Passing::straightened`]. Few are.
#[inline(never)]
pub(super) fn bent_passages(
    way: &[Station],
    plies: &[PlyShape],
    fours: &[FourPlies],
    visit: &mut dyn FnMut(usize, Passage),
) {
    passages::<true>(way, plies, fours, |ply, passing| visit(ply, passing.straightened(&plies[ply])));
}

/// The station at a depth of a way, from those before and behind it.
#[inline]
pub(super) fn station_at(way: &[Station], depth: f32) -> Station {
    let last = way.len() - 1;
    let i = way[1..last.max(1)].iter().take_while(|s| s.depth < depth).count();
    let (a, b) = (&way[i], &way[(i + 1).min(last)]);
    let length = b.depth - a.depth;
    let u = if length > 0.0 { ((depth - a.depth) / length).clamp(0.0, 1.0) } else { 0.0 };
    Arc::between(a, b).station(a, b, u)
}
