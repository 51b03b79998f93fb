//! Pile: floats that stand up from the ground cloth as loops (terry) or as cut tufts (velvet, corduroy), which find room
//! between the yarns of the ground and beside each other.
//!
//! Pile yarns are twisted little and bloom where they are free: loops grow thicker, and a tuft opens into the strands that it was
//! twisted of, which spread until they meet those of its neighbours.

use std::{
    collections::{BTreeSet, HashMap},
    f64::consts::{PI, TAU},
};

use glam::{DVec2, DVec3, IVec2};
use rayon::prelude::*;

use super::{
    super::{
        draft::{Draft, Pile},
        relax::{Ends, Relaxation, Rope},
    },
    Cloth, PatternStrand, StrandKind,
    edges::{Point, from_points, points},
};
use crate::math::{sampler::hash2, special::smooth_step};

/// How far from the middle of a crossing that holds it a pile yarn stands up, in spacings.
const RISE: f64 = 0.7;
/// Distance of points of loops and legs, in radii of the yarn.
const STEP: f64 = 1.1;

/// Rounds in which pile finds room.
const ROUNDS: usize = 80;
/// Strands across a tuft's yarn: of five there are 19.
const ACROSS: u32 = 5;
/// How much thicker strands are at their tips, at most, and loops where they are free.
const BLOOM_CUT: f64 = 2.2;
const BLOOM_LOOP: f64 = 1.7;
/// How far the tip of a strand is from its place by chance, and from the cut, in radii of the yarn.
const UNEVEN: f64 = 0.35;
const CUT: f64 = 0.2;
/// How far tufts at the border of a wale lean out, of half its period, and how much lower they are at its sides.
const LEAN_OUT: f64 = 0.05;
const ROUNDED: f64 = 0.55;
/// How far tufts lean by chance, and loops, of their height.
const LEAN: f64 = 0.12;
const LEAN_LOOP: f64 = 0.3;

/// A yarn, some of whose points stand free of the ground.
pub(super) struct Standing {
    strand: PatternStrand,
    /// For each point; empty where none does.
    free: Vec<bool>,
    /// Whether it is a tuft, which opens.
    tuft: Option<Tuft>,
}

/// How a tuft opens.
struct Tuft {
    /// Unit vector across the plane in which it is bent.
    across: DVec3,
    /// Points of its first leg and of its last.
    legs: [usize; 2],
    /// Radius of the yarn where it carries none of its own.
    radius: f64,
    /// Half its width at the tips, across the yarn and along it.
    spread: [f64; 2],
    seed: u32,
}

impl Tuft {
    /// Its strands: side by side where it is held, apart at the tips.
    fn open(&self, strand: &PatternStrand, flat: bool) -> Vec<PatternStrand> {
        let mut way = points(strand);
        if strand.curve.radii.is_none() {
            way.iter_mut().for_each(|p| p.1 = self.radius);
        }
        let last = way.len() - 1;
        let thin = 1.0 / f64::from(ACROSS);
        let strands = bundle();
        let random = |what: u32| f64::from(hash2(self.seed, what) >> 8) / f64::from(1u32 << 23) - 1.0;
        let turned = DVec2::from_angle(PI * random(0));
        // Where it is on a leg, which of them, and from 0 to 1 at the tip.
        let [first, second] = self.legs;
        let on_leg = |i: usize| {
            if i < first {
                (0, 1.0 - i as f64 / first as f64)
            } else {
                (1, (i + second).saturating_sub(last) as f64 / second.max(1) as f64)
            }
        };
        let one = |(k, at): (usize, DVec2)| {
            let at = turned.rotate(at);
            let chance = |leg: usize, what: u32| random(1 + 8 * k as u32 + 4 * leg as u32 + what);
            let place = |i: usize| -> Point {
                let (p, radius, axis, coordinates) = way[i];
                let tangent = (way[(i + 1).min(last)].0 - way[i.saturating_sub(1)].0).normalize_or(DVec3::Z);
                let major = (self.across - self.across.dot(tangent) * tangent).normalize_or(self.across);
                let minor = tangent.cross(major);
                let (leg, s) = on_leg(i);
                let [wide, long] = self.spread.map(|spread| (spread / radius - 1.0).max(0.0));
                let bloom = ((1.0 + wide) * (1.0 + long)).sqrt().min(BLOOM_CUT) - 1.0;
                let thick = 1.0 + bloom * s.sqrt();
                // Not before there is room, and beyond what they need at the tips only.
                let apart = |spread: f64| 1.0 + spread.min(bloom) * s.sqrt() + (spread - spread.min(bloom)) * s;
                let at = at * DVec2::new(apart(wide), apart(long));
                let by_chance = DVec2::new(chance(leg, 0), chance(leg, 1)) * (UNEVEN * s);
                let off = (at + by_chance) * radius;
                let cut = tangent * (CUT * radius * chance(leg, 2) * s);
                (
                    p + off.x * major + off.y * minor + cut,
                    thin * radius * thick,
                    minor.as_vec3() * axis.length(),
                    coordinates,
                )
            };
            let places: Vec<Point> = (0..=last).map(place).collect();
            let mut made = from_points(strand.kind, strand.index, &places, flat);
            made.curve.radii = Some(places.iter().map(|p| p.1).collect());
            made.share = strand.share / strands.len() as f64;
            made
        };
        strands.iter().copied().enumerate().map(one).collect()
    }
}

/// Where the strands of a yarn of radius 1 are in its section: in rings of six, as close as they lie.
fn bundle() -> Vec<DVec2> {
    let rings = ACROSS as i32 / 2;
    let step = 2.0 / f64::from(ACROSS);
    let place =
        |(a, b): (i32, i32)| DVec2::new(f64::from(a) + 0.5 * f64::from(b), 0.75f64.sqrt() * f64::from(b)) * step;
    let all = (-rings..=rings).flat_map(|a| (-rings..=rings).map(move |b| (a, b)));
    all.filter(|(a, b)| (a + b).abs() <= rings).map(place).collect()
}

impl Standing {
    fn ground(strand: PatternStrand) -> Self {
        Self { strand, free: Vec::new(), tuft: None }
    }

    fn of(like: &PatternStrand, points: &[(Point, bool)], flat: bool) -> Self {
        let places: Vec<Point> = points.iter().map(|p| p.0).collect();
        let strand = from_points(like.kind, like.index, &places, flat);
        Self { strand, free: points.iter().map(|p| p.1).collect(), tuft: None }
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
    let mut strands = Vec::new();
    let mut legs = Vec::new();
    let mut room: f64 = 0.0;
    for yarn in yarns {
        let Some(tuft) = yarn.tuft else {
            strands.push(yarn.strand);
            continue;
        };
        let opened = tuft.open(&yarn.strand, yarn.strand.curve.flattening.is_some());
        legs.extend((strands.len()..strands.len() + opened.len()).map(|strand| (strand, tuft.legs)));
        room = room.max(4.0 * tuft.spread[0] * tuft.spread[1] / opened.len() as f64);
        strands.extend(opened);
    }
    share_room(&mut strands, &legs, room);
    strands
}

/// Lets strands, which open around the leg that they are of, find their places among those of all others: each has `room` of
/// the plane, and pushes those away that are nearer than in the closest packing of such rooms. `legs` are strands with the
/// points of their first leg and of their last; they bend from the ground up.
fn share_room(strands: &mut [PatternStrand], legs: &[(usize, [usize; 2])], room: f64) {
    /// In which tips come to rest.
    const ROUNDS: usize = 80;
    /// How far a tip goes from where it stood, at most, in distances of neighbours.
    const FURTHEST: f64 = 2.5;
    /// They press on each other, or cracks would stay where tufts stood apart.
    const PRESSED: f64 = 1.15;
    if legs.is_empty() {
        return;
    }
    let distance = PRESSED * (2.0 / 3f64.sqrt() * room).sqrt();
    // The last point of each leg, and the points below it.
    let ends: Vec<(usize, usize, usize)> = legs
        .iter()
        .flat_map(|&(strand, [first, last])| {
            [(strand, 0, first), (strand, strands[strand].curve.points.len() - 1, last)]
        })
        .filter(|(.., points)| *points > 0)
        .collect();
    let stood: Vec<DVec2> = ends.iter().map(|&(strand, tip, _)| strands[strand].curve.points[tip].truncate()).collect();
    let mut tips = stood.clone();
    for _ in 0..ROUNDS {
        let cell = |p: DVec2| (p / distance).floor().as_ivec2();
        let mut cells: HashMap<IVec2, Vec<usize>> = HashMap::new();
        tips.iter().enumerate().for_each(|(i, p)| cells.entry(cell(*p)).or_default().push(i));
        let pushed = |(i, p): (usize, &DVec2)| {
            let around = (-1..=1).flat_map(|y| (-1..=1).map(move |x| IVec2::new(x, y)));
            let near = around.filter_map(|by| cells.get(&(cell(*p) + by))).flatten().filter(|&&k| k != i);
            let push: DVec2 = near
                .map(|&k| {
                    let off = *p - tips[k];
                    let apart = off.length();
                    if apart < distance { 0.5 * (distance - apart) * off.normalize_or(DVec2::X) } else { DVec2::ZERO }
                })
                .sum();
            // Half of it: each is pushed by several.
            stood[i] + (*p + 0.5 * push - stood[i]).clamp_length_max(FURTHEST * distance)
        };
        tips = tips.par_iter().enumerate().map(pushed).collect();
    }
    for ((&(strand, tip, points), from), to) in ends.iter().zip(&stood).zip(&tips) {
        let way = &mut strands[strand].curve.points;
        for k in 0..points {
            let i = if tip == 0 { k } else { tip - k };
            let s = 1.0 - k as f64 / points as f64;
            way[i] += ((*to - *from) * s * s).extend(0.0);
        }
    }
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
    let up = if back { -1.0 } else { 1.0 };
    let seed = strand.index ^ ((side as u32) << 30);
    let wale = wale(draft, pile, side);
    let per_repeat = (0..size).filter(|&c| held(c - first)).count().max(1) as f64;
    let even = if wale.is_some() { 0.0 } else { (RISE - 0.25 * size as f64 / per_repeat).clamp(0.0, RISE) };
    let made = Raised { cloth, side, up, seed, wale, even };
    // Nothing where a part would begin beyond the end: the yarn may end on top of its last crossing.
    let part = |from: i64, to: i64| -> Vec<(Point, bool)> {
        let (from, to) = (from.max(0), to.min(way.len() as i64 - 1));
        if from > to { Vec::new() } else { way[from as usize..=to as usize].iter().map(|&p| (p, false)).collect() }
    };
    let flat = cloth.weave.sized();
    if pile.cut {
        let spread = spread(cloth, pile, side);
        let tuft = |at: i64| {
            let base = part(at - rise, at + rise);
            let (a, b) = (base[0].0, base[base.len() - 1].0);
            let free = |points: Vec<Point>| points.into_iter().map(|p| (p, true));
            let place = |at: i64| (at - nodes / 2) as f64 / nodes as f64 + first as f64;
            let legs = [(a, -1.0, at - rise), (b, 1.0, at + rise)]
                .map(|(foot, out, foot_at)| made.leg(foot, out, at as u32, place(foot_at)));
            let counts = [legs[0].len(), legs[1].len()];
            let [before, after] = legs;
            let mut all: Vec<(Point, bool)> = free(before).collect();
            all.reverse();
            all.extend(&base);
            all.extend(free(after));
            let seed = hash2(made.seed, at as u32);
            let tuft =
                Tuft { across: made.direction(0.0, 1.0, 0.0), legs: counts, radius: made.radius(), spread, seed };
            Standing { tuft: Some(tuft), ..Standing::of(&strand, &all, flat) }
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
    wale: Option<Wale>,
    /// How far legs lean towards each other, in crossings.
    even: f64,
}

/// Where tufts stand in rows across the yarns that they are cut of; in crossings.
#[derive(Clone, Copy)]
struct Wale {
    middle: f64,
    /// Distance to the next.
    period: f64,
}

/// Places, in crossings, where the pile yarns of a repeat are held.
fn held_places<'a>(draft: &'a Draft, pile: &'a Pile, side: usize) -> impl Iterator<Item = usize> + 'a {
    let [own, other] = if side == 0 { [draft.warps(), draft.wefts()] } else { [draft.wefts(), draft.warps()] };
    (0..own).filter_map(move |yarn| Some((yarn, pile.stands(side, yarn)?))).flat_map(move |(yarn, back)| {
        (0..other).filter(move |&c| {
            let on_top = if side == 0 { draft.warp_over(c, yarn) } else { !draft.warp_over(yarn, c) };
            on_top == back
        })
    })
}

/// The wales of a pile, unless it is held everywhere alike.
fn wale(draft: &Draft, pile: &Pile, side: usize) -> Option<Wale> {
    const ALIKE: f64 = 0.2;
    let period = if side == 0 { draft.wefts() } else { draft.warps() } as f64;
    let (sum, count) = held_places(draft, pile, side).fold((DVec2::ZERO, 0.0), |(sum, count), place| {
        (sum + DVec2::from_angle(TAU * place as f64 / period), count + 1.0)
    });
    (sum.length() > ALIKE * count).then(|| Wale { middle: sum.to_angle() / TAU * period, period })
}

/// Half the room of a leg, across the yarns of the pile and along them.
fn spread(cloth: &Cloth<'_>, pile: &Pile, side: usize) -> [f64; 2] {
    /// Share of a wale's period that is no groove.
    const FULL: f64 = 0.85;
    let draft = &cloth.weave.draft;
    let [p, q] = cloth.cell.spacing;
    let size = [p * draft.warps() as f64, q * draft.wefts() as f64];
    let legs = 2.0 * held_places(draft, pile, side).count().max(1) as f64;
    if wale(draft, pile, side).is_some() {
        // Tufts behind each other share what their wale has of the repeat's other side.
        let places: BTreeSet<usize> = held_places(draft, pile, side).collect();
        let across = 2.0 * size[side] * places.len() as f64 / legs;
        return [0.5 * across, 0.5 * FULL * size[0] * size[1] / (legs * across)];
    }
    let standing = (0..[draft.warps(), draft.wefts()][side]).filter(|&yarn| pile.stands(side, yarn).is_some()).count();
    let across = size[side] / standing.max(1) as f64;
    [0.5 * across, 0.5 * size[0] * size[1] / (legs * across)]
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

    fn at(&self, p: DVec3, bloom: f64, near: Point) -> Point {
        (p, self.radius() * bloom, self.direction(1.0, 0.0, 0.0).as_vec3(), near.3)
    }

    /// A leg that stands up from `from`, which is at `place` along the yarn, in crossings, and leans from the middle of its wale.
    fn leg(&self, from: Point, out: f64, place_of: u32, place: f64) -> Vec<Point> {
        let (r, height) = (self.radius(), self.cloth.weave.pile_height);
        let what = if out > 0.0 { 0 } else { 8 };
        let [lean, aside] = [what, what + 1].map(|what| LEAN * height * self.random(place_of, what));
        let beside = self.wale.map_or(0.0, |wale| {
            let away = (place - wale.middle) / wale.period;
            2.0 * (away - away.round())
        });
        let period = self.wale.map_or(0.0, |wale| 0.5 * wale.period * self.cloth.cell.spacing[1 - self.side]);
        // Both legs of a tuft and of the next stand alike far apart at their tips.
        let inwards = self.even * self.cloth.cell.spacing[1 - self.side];
        let height = height * (1.0 - ROUNDED * beside * beside) * (1.0 + 0.04 * self.random(place_of, what + 2));
        let steps = (height / (STEP * r)).ceil().max(2.0) as usize;
        let leg = |k: usize| {
            let s = k as f64 / steps as f64;
            let along = LEAN_OUT * beside * period * s.powf(1.5) + (lean - out * inwards) * s * s;
            let p = from.0 + self.direction(along, aside * s * s, height * s);
            self.at(p, 1.0, from)
        };
        (1..=steps).map(leg).collect()
    }

    /// A loop from `from` to `to`, without both: a drop, which yarn that wants to untwist turns out of the warp's plane, all
    /// to one side.
    fn arch(&self, from: Point, to: Point, place: u32) -> Vec<Point> {
        let (r, height) = (self.radius(), self.cloth.weave.pile_height);
        let height = height * (1.0 + 0.05 * self.random(place, 2));
        let [lean, aside] = [0, 1].map(|what| LEAN_LOOP * height * self.random(place, what));
        let twist = PI * (0.25 + 0.12 * self.random(place, 3));
        let wide = 2.4 * r;
        let steps = (2.4 * height / (STEP * r)).ceil().max(6.0) as usize;
        let arch = |k: usize| {
            let s = k as f64 / steps as f64;
            // Rounder at the top than a sine.
            let up = (PI * s).sin().powf(0.8);
            // Wider at the top than at the foot, and turned more: what lies between both feet is turned with it.
            let across = -wide * (TAU * s).sin();
            let (sin, cos) = (twist * up * up).sin_cos();
            let fallen = up * up;
            let (middle, half) = (0.5 * (from.0 + to.0), 0.5 * (to.0 - from.0).length());
            let along = -half * (1.0 - 2.0 * s) + across;
            let base = DVec3::Z * (from.0.lerp(to.0, s) - middle).z;
            let p =
                middle + base + self.direction(lean * fallen + along * cos, aside * fallen + along * sin, height * up);
            let bloom = 1.0 + (BLOOM_LOOP - 1.0) * smooth_step((5.0 * s.min(1.0 - s)).min(1.0));
            self.at(p, bloom, if s < 0.5 { from } else { to })
        };
        (1..steps).map(arch).collect()
    }
}
