//! A straight way through a yarn, seen in the unwound yarn: unbent, round, its plies untwisted.
//!
//! There plies are straight cylinders along the yarn and the way is a curve. It is known, with its slope, at a few
//! stations, and goes from each to the next as the cubic that has both slopes. Between two stations the plies turn by
//! [`MOST_TURN`] at most, where that cubic is off by less than 0.005 yarn radii. A way that crosses a yarn steeply needs
//! two stations, at its ends.

use arrayvec::ArrayVec;
use glam::Vec2;

use super::yarn::PlyShape;

/// The most by which plies turn between two stations, radians.
pub(super) const MOST_TURN: f32 = 0.8;
/// The most stations of a way.
const MOST_STATIONS: usize = 64;

/// A point of a way in the unwound yarn. Lengths are in yarn radii.
#[derive(Clone, Copy, Debug)]
pub struct Station {
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
pub type Way = ArrayVec<Station, MOST_STATIONS>;

/// A stretch of a way that passes a ply.
#[derive(Clone, Copy, Debug)]
pub struct Passage {
    /// Depth at which it enters the ply's core; where it only grazes the ply's outer fibres, that of the nearest point.
    pub enter: f32,
    /// Depth at which it leaves the core.
    pub exit: f32,
    /// Depth where it is nearest to the ply's axis, along the straight line that goes on from there: before the start of the
    /// way if it starts beyond that point.
    pub foot: f32,
    /// Signed distance of that line from the ply's axis, in the circle that the ply's section becomes.
    pub offset: f32,
    /// Length in that circle of one unit of depth: in the mean of the passage.
    pub speed: f32,
    /// The share of the chord through the core that the way has: less than 1 where it begins or ends inside.
    pub share: f32,
}

/// What is between two stations, in coordinates in which a ply is a circle about the origin.
struct Arc {
    from: Vec2,
    to: Vec2,
    /// at(u) = from + u (slope + u (square + u cube)), u from 0 to 1.
    slope: Vec2,
    square: Vec2,
    cube: Vec2,
    /// How far it is off the line from `from` to `to` at most.
    off: f32,
    /// 1 / |to - from|^2
    inverse: f32,
}

impl Arc {
    /// As seen from the middle of a ply: from that of the way itself, for all round plies.
    #[inline]
    fn about(&self, ply: &PlyShape) -> Self {
        let centre = ply.distance * ply.direction;
        let (from, to) = (self.from - centre, self.to - centre);
        if ply.stretch.x == 1.0 {
            return Self { from, to, ..*self };
        }
        let to_circle = |p: Vec2| Vec2::new(p.dot(ply.direction), ply.direction.perp_dot(p)) * ply.stretch;
        let [from, to, slope, square, cube] = [from, to, self.slope, self.square, self.cube].map(to_circle);
        let chord = to - from;
        let off = self.off * ply.stretch.max_element();
        Self { from, to, slope, square, cube, off, inverse: 1.0 / chord.length_squared().max(1e-20) }
    }

    #[inline]
    fn between(a: &Station, b: &Station) -> Self {
        let length = b.depth - a.depth;
        Self::hermite(a.at, b.at, a.slope * length, b.slope * length)
    }

    #[inline]
    fn hermite(from: Vec2, to: Vec2, slope: Vec2, end_slope: Vec2) -> Self {
        let chord = to - from;
        let (bow, end_bow) = (slope - chord, end_slope - chord);
        let size = |v: Vec2| v.x.abs().max(v.y.abs()) * 1.42;
        let off = (4.0 / 27.0) * (size(bow) + size(end_bow));
        let inverse = 1.0 / chord.length_squared().max(1e-20);
        Self { from, to, slope, square: -2.0 * bow - end_bow, cube: bow + end_bow, off, inverse }
    }

    #[inline]
    fn at(&self, u: f32) -> Vec2 {
        self.from + u * (self.slope + u * (self.square + u * self.cube))
    }

    #[inline]
    fn slope_at(&self, u: f32) -> Vec2 {
        self.slope + u * (2.0 * self.square + 3.0 * u * self.cube)
    }

    /// Where it is nearest to the origin, if that is nearer than `radius`.
    #[inline]
    fn nearest(&self, radius: f32) -> Option<(f32, Vec2)> {
        let chord = self.to - self.from;
        let mut u = (-self.from.dot(chord) * self.inverse).clamp(0.0, 1.0);
        let reach = radius + self.off;
        if (self.from + u * chord).length_squared() >= reach * reach {
            return None;
        }
        // Newton for at . slope = 0; a line needs none.
        let mut at = self.at(u);
        if self.off > 1e-5 {
            for _ in 0..2 {
                let slope = self.slope_at(u);
                let bend = 2.0 * self.square + 6.0 * u * self.cube;
                let speed = slope.length_squared();
                u = (u - at.dot(slope) / (speed + at.dot(bend)).max(0.2 * speed + 1e-20)).clamp(0.0, 1.0);
                at = self.at(u);
            }
        }
        (at.length_squared() < radius * radius).then_some((u, at))
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
        if self.off <= 1e-5 {
            return u;
        }
        for _ in 0..2 {
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

/// Whether the way from one station to the next passes any ply.
#[inline]
pub(super) fn passes(a: &Station, b: &Station, plies: &[PlyShape]) -> bool {
    let arc = Arc::between(a, b);
    plies.iter().any(|ply| arc.about(ply).nearest(ply.radius).is_some())
}

/// Share of the core's radius below which the length of a chord does not tell how fast it is passed.
const SHORT_CHORD: f32 = 0.01;

/// How far a straight line is followed to its nearest point, in yarn radii.
const FARTHEST_FOOT: f32 = 16.0;

/// A passage that has begun.
struct Open {
    /// Square of the least distance so far, and its depth.
    nearest: f32,
    depth: f32,
    passage: Passage,
    /// Whether the core was met.
    core: bool,
    /// Whether the way came in from outside of the core, and went out of it.
    whole: [bool; 2],
}

impl Open {
    #[inline]
    fn closed(mut self, core_radius: f32) -> Passage {
        let p = &mut self.passage;
        if !self.core {
            (p.enter, p.exit) = (self.depth, self.depth);
        }
        p.speed = p.speed.max(1e-4);
        if !self.core {
            return self.passage;
        }
        // The chord as if straight, over the depth that it really takes; by the slope where there is next to no chord.
        let chord = 2.0 * (core_radius * core_radius - p.offset * p.offset).max(0.0).sqrt();
        let short = SHORT_CHORD * core_radius;
        if self.whole == [true; 2] {
            p.speed = (chord + short) / (p.exit - p.enter + short / p.speed);
        } else {
            p.share = ((p.exit - p.enter) * p.speed / chord.max(1e-6)).min(1.0);
        }
        self.passage
    }
}

/// Calls `visit` with every passage of a way through a ply, in order; without `ENDS` where it enters and leaves is not asked.
#[inline]
pub(super) fn passages<const ENDS: bool>(way: &[Station], ply: &PlyShape, mut visit: impl FnMut(Passage)) {
    let (outer, core) = (ply.radius, ply.core_radius);
    let mut open: Option<Open> = None;
    for pair in way.windows(2) {
        let (a, b) = (&pair[0], &pair[1]);
        let arc = Arc::between(a, b).about(ply);
        let Some((u, at)) = arc.nearest(outer) else {
            if let Some(open) = open.take() {
                visit(open.closed(core));
            }
            continue;
        };
        let length = b.depth - a.depth;
        let slope = arc.slope_at(u);
        let size = slope.length();
        let distance = at.length_squared();
        let now = open.get_or_insert(Open {
            nearest: f32::INFINITY,
            depth: a.depth,
            passage: Passage { enter: a.depth, exit: a.depth, foot: a.depth, offset: 0.0, speed: 0.0, share: 1.0 },
            core: false,
            whole: [false; 2],
        });
        if distance < now.nearest {
            now.nearest = distance;
            now.depth = a.depth + length * u;
            now.passage.offset = slope.perp_dot(at) / size.max(1e-12);
            let ahead = length * (u - at.dot(slope) / (size * size).max(1e-12));
            now.passage.foot = a.depth + ahead.clamp(-FARTHEST_FOOT, FARTHEST_FOOT);
            now.passage.speed = size / length;
        }
        let inside = core * core;
        if ENDS && distance < inside {
            if !now.core {
                let begins = arc.from.length_squared() >= inside;
                let enter = if begins { arc.crossing(core, u, -1.0) } else { 0.0 };
                now.passage.enter = a.depth + length * enter;
                now.core = true;
                now.whole[0] = begins;
            }
            let ends = arc.to.length_squared() >= inside;
            let exit = if ends { arc.crossing(core, u, 1.0) } else { 1.0 };
            now.passage.exit = a.depth + length * exit;
            now.whole[1] = ends;
        }
        if arc.to.length_squared() >= outer * outer
            && let Some(open) = open.take()
        {
            visit(open.closed(core));
        }
    }
    // A way that ends before it comes to the core has not passed the ply.
    let end = way.last().map_or(0.0, |last| last.depth);
    if let Some(open) = open.filter(|open| !ENDS || open.core || open.depth < end) {
        visit(open.closed(core));
    }
}

/// The station at a depth of a way, from those before and behind it.
#[inline]
pub(super) fn station_at(way: &[Station], depth: f32) -> Station {
    let last = way.len() - 1;
    let i = way[1..last.max(1)].iter().take_while(|s| s.depth < depth).count();
    let (a, b) = (&way[i], &way[(i + 1).min(last)]);
    let length = b.depth - a.depth;
    let u = if length > 0.0 { ((depth - a.depth) / length).clamp(0.0, 1.0) } else { 0.0 };
    let arc = Arc::between(a, b);
    Station {
        depth,
        at: arc.at(u),
        slope: if length > 0.0 { arc.slope_at(u) / length } else { a.slope },
        travel: a.travel + u * (b.travel - a.travel),
        advance: a.advance + u * (b.advance - a.advance),
        straightness: a.straightness + u * (b.straightness - a.straightness),
    }
}
