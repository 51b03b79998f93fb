//! Pile: floats that stand up from the ground cloth as loops (terry) or as cut tufts (velvet, corduroy), which find room
//! between the yarns of the ground and beside each other.

use std::f64::consts::PI;

use glam::DVec3;

use super::{
    super::relax::{Ends, Relaxation, Rope},
    Cloth, PatternStrand, StrandKind,
    edges::{Point, from_points, points},
};
use crate::math::sampler::hash2;

/// How far from the middle of a crossing that holds it a pile yarn stands up, in spacings.
const RISE: f64 = 0.7;
/// Distance of points of loops and legs, in radii of the yarn.
const STEP: f64 = 1.1;

/// Rounds in which pile finds room.
const ROUNDS: usize = 80;

/// A yarn, some of whose points stand free of the ground.
pub(super) struct Standing {
    strand: PatternStrand,
    /// For each point; empty where none does.
    free: Vec<bool>,
}

impl Standing {
    fn ground(strand: PatternStrand) -> Self {
        Self { strand, free: Vec::new() }
    }

    fn of(like: &PatternStrand, points: &[(Point, bool)], flat: bool) -> Self {
        let places: Vec<Point> = points.iter().map(|p| p.0).collect();
        let strand = from_points(like.kind, like.index, &places, flat);
        Self { strand, free: points.iter().map(|p| p.1).collect() }
    }

    /// The points by which the yarn finds room: all free ones and those beside them, few of the others.
    fn places(&self, step: f64) -> Vec<usize> {
        let points = &self.strand.curve.points;
        let free = |i: usize| self.free.get(i).copied().unwrap_or(false);
        let mut places: Vec<usize> = Vec::new();
        for i in 0..points.len() {
            let beside = free(i) || (i > 0 && free(i - 1)) || free(i + 1);
            let far = places.last().is_none_or(|&last| points[last].distance(points[i]) > step);
            if beside || far || i + 1 == points.len() {
                places.push(i);
            }
        }
        places
    }

    fn rope(&self, places: &[usize], diameter: f64) -> Rope {
        let points = &self.strand.curve.points;
        let pinned: Vec<bool> = places.iter().map(|&i| !self.free.get(i).copied().unwrap_or(false)).collect();
        let segments = places.windows(2).zip(pinned.windows(2));
        let lengths =
            segments.filter(|(_, pinned)| *pinned != [true; 2]).map(|(i, _)| points[i[0]].distance(points[i[1]]));
        let (sum, count) = lengths.fold((0.0, 0), |(sum, count), length| (sum + length, count + 1));
        let rest = if count > 0 { sum / f64::from(count) } else { STEP * 0.5 * diameter };
        let points = places.iter().map(|&i| points[i] / diameter).collect();
        Rope { points, pinned, ends: Ends::Open, rest: rest / diameter }
    }
}

/// Lets what stands free find room; the ground stays.
pub(super) fn settle(mut yarns: Vec<Standing>, diameter: f64) -> Vec<PatternStrand> {
    if yarns.iter().any(|yarn| !yarn.free.is_empty()) {
        let places: Vec<Vec<usize>> = yarns.iter().map(|yarn| yarn.places(0.5 * STEP * diameter)).collect();
        let ropes = yarns.iter().zip(&places).map(|(yarn, places)| yarn.rope(places, diameter)).collect();
        let mut relaxation = Relaxation { ropes, period: None, shear: 0.0 };
        relaxation.run(ROUNDS, |_| {});
        for ((yarn, places), rope) in yarns.iter_mut().zip(&places).zip(relaxation.ropes) {
            for (&i, point) in places.iter().zip(rope.points).filter(|(i, _)| yarn.free.get(**i) == Some(&true)) {
                yarn.strand.curve.points[i] = point * diameter;
            }
        }
    }
    yarns.into_iter().map(|yarn| yarn.strand).collect()
}

/// Raises the floats of a pile yarn. It is held where it lies on the other side of the cloth.
pub(super) fn raise(cloth: &Cloth<'_>, strand: PatternStrand, number: i64, hem: i64) -> Vec<Standing> {
    let draft = &cloth.weave.draft;
    let Some(pile) = draft.pile() else { return vec![Standing::ground(strand)] };
    let side = usize::from(strand.kind == StrandKind::Weft);
    let [own, size] = [side, 1 - side].map(|side| [draft.warps(), draft.wefts()][side] as i64);
    let own = number.rem_euclid(own) as usize;
    let Some(back) = pile.stands(side, own) else {
        return vec![Standing::ground(strand)];
    };
    let nodes = cloth.cell.nodes as i64;
    let way = points(&strand);
    // Crossing c is at point `nodes / 2 + (c - first) * nodes`.
    let first = if side == 0 { -hem } else { 0 };
    let crossings = (way.len() as i64 - 1) / nodes;
    let held = |c: i64| {
        let other = (c + first).rem_euclid(size) as usize;
        let warp_over = if side == 0 { draft.warp_over(other, own) } else { draft.warp_over(own, other) };
        let on_top = warp_over == (side == 0);
        on_top == back
    };
    // A hem, and what it is folded onto, is woven flat, as borders of towels are.
    let flat_border = if hem > 0 { hem + 1 } else { 0 };
    let border = |c: i64| side == 0 && !(flat_border..i64::from(cloth.count[1]) - flat_border).contains(&(c + first));
    let at = |c: i64| nodes / 2 + c * nodes;
    let holds: Vec<(i64, bool)> = (0..crossings).filter(|&c| held(c)).map(|c| (at(c), border(c))).collect();
    let rise = (RISE * nodes as f64).round() as i64;
    let made = Raised { cloth, side, up: if back { -1.0 } else { 1.0 }, seed: strand.index ^ ((side as u32) << 30) };
    // Nothing where a part would begin beyond the end: the yarn may end on top of its last crossing.
    let part = |from: i64, to: i64| -> Vec<(Point, bool)> {
        let (from, to) = (from.max(0), to.min(way.len() as i64 - 1));
        if from > to { Vec::new() } else { way[from as usize..=to as usize].iter().map(|&p| (p, false)).collect() }
    };
    let flat = cloth.weave.sized();
    if pile.cut {
        let tuft = |at: i64| {
            let base = part(at - rise, at + rise);
            let (a, b) = (base[0].0, base[base.len() - 1].0);
            let free = |points: Vec<Point>| points.into_iter().map(|p| (p, true));
            let mut all: Vec<(Point, bool)> = free(made.leg(a, -1.0, at as u32)).collect();
            all.reverse();
            all.extend(&base);
            all.extend(free(made.leg(b, 1.0, at as u32)));
            Standing::of(&strand, &all, flat)
        };
        return holds.iter().filter(|(_, border)| !border).map(|&(at, _)| tuft(at)).collect();
    }
    let Some((&(start, _), &(end, _))) = holds.first().zip(holds.last()) else { return vec![Standing::ground(strand)] };
    let mut all = part(0, start + rise);
    for pair in holds.windows(2) {
        let [(from, flat_from), (to, flat_to)] = [pair[0], pair[1]];
        if to - from > nodes && !flat_from && !flat_to {
            let (a, b) = (all[all.len() - 1].0, way[(to - rise) as usize]);
            all.extend(made.arch(a, b, from as u32).into_iter().map(|p| (p, true)));
            all.extend(part(to - rise, to + rise));
        } else {
            all.extend(part(from + rise + 1, to + rise));
        }
    }
    all.extend(part(end + rise + 1, way.len() as i64 - 1));
    vec![Standing::of(&strand, &all, flat)]
}

struct Raised<'a> {
    cloth: &'a Cloth<'a>,
    side: usize,
    /// 1 on the face, -1 on the back.
    up: f64,
    seed: u32,
}

impl Raised<'_> {
    fn radius(&self) -> f64 {
        [self.cloth.weave.warp_radius, self.cloth.weave.weft_radius][self.side]
    }

    /// From -1 to 1.
    fn random(&self, place: u32, what: u32) -> f64 {
        f64::from(hash2(hash2(self.seed, place), what) >> 8) / f64::from(1u32 << 23) - 1.0
    }

    /// Along the yarn, across it, up.
    fn direction(&self, along: f64, across: f64, up: f64) -> DVec3 {
        if self.side == 0 { DVec3::new(across, along, up * self.up) } else { DVec3::new(along, across, up * self.up) }
    }

    fn at(&self, p: DVec3, near: Point) -> Point {
        (p, self.radius(), self.direction(1.0, 0.0, 0.0), near.3)
    }

    /// A leg that stands up from `from` and leans to `out` along the yarn.
    fn leg(&self, from: Point, out: f64, place: u32) -> Vec<Point> {
        let (r, height) = (self.radius(), self.cloth.weave.pile_height);
        let what = if out > 0.0 { 0 } else { 8 };
        let (lean, aside) = (0.25 * self.random(place, what), 0.25 * self.random(place, what + 1));
        let height = height * (1.0 + 0.06 * self.random(place, what + 2));
        let steps = (height / (STEP * r)).ceil().max(2.0) as usize;
        let leg = |k: usize| {
            let s = k as f64 / steps as f64;
            let along = r * (0.5 * out * s + lean * s * s * height / r);
            let p = from.0 + self.direction(along, aside * height * s * s, height * s);
            self.at(p, from)
        };
        (1..=steps).map(leg).collect()
    }

    /// A loop from `from` to `to`, without both: a drop, which yarn that wants to untwist turns out of the warp's plane, and
    /// which falls over as it likes.
    fn arch(&self, from: Point, to: Point, place: u32) -> Vec<Point> {
        let (r, height) = (self.radius(), self.cloth.weave.pile_height);
        let height = height * (1.0 + 0.1 * self.random(place, 2));
        let (lean, aside) = (0.45 * height * self.random(place, 0), 0.45 * height * self.random(place, 1));
        let twist = 0.35 * PI * self.random(place, 3);
        let wide = (0.16 * height).max(1.2 * r);
        let steps = (2.4 * height / (STEP * r)).ceil().max(6.0) as usize;
        let arch = |k: usize| {
            let s = k as f64 / steps as f64;
            let up = (PI * s).sin();
            // Wider at the top than at the foot, and turned more.
            let across = -wide * (2.0 * PI * s).sin();
            let (sin, cos) = (twist * up).sin_cos();
            let fallen = up * up;
            let p = from.0.lerp(to.0, s)
                + self.direction(lean * fallen + across * cos, aside * fallen + across * sin, height * up);
            self.at(p, if s < 0.5 { from } else { to })
        };
        (1..steps).map(arch).collect()
    }
}
