//! Pile: floats that stand up from the ground cloth as loops (terry) or as cut tufts (velvet, corduroy), which find room
//! between the yarns of the ground and beside each other.
//!
//! Pile yarns are twisted little and bloom where they are free: loops grow thicker, and a tuft opens into the strands that it was
//! twisted of, which spread until they meet those of its neighbours.

mod arch;
mod tuft;

use std::{
    collections::BTreeSet,
    f64::consts::{PI, TAU},
};

use glam::{DVec2, DVec3};

use self::{
    arch::Arch,
    tuft::{Cut, Tuft, Vault},
};
use super::{
    super::{
        draft::{Draft, Pile},
        relax::{Ends, Relaxation, Rope},
    },
    Cloth, PatternStrand, StrandKind,
    edges::{Point, from_points, points},
};
use crate::math::{
    sampler::{hash2, unit},
    special::hermite,
};

/// How far from the middle of a crossing that holds it a pile yarn stands up, in spacings.
const RISE: f64 = 0.75;
const LEAST_RISE: f64 = 0.5;
/// Distance of points of loops and legs, in radii of the yarn.
const STEP: f64 = 1.1;

/// Rounds in which pile finds room.
const ROUNDS: usize = 80;
/// How much lower tufts are at the sides of a wale, of their height.
const ROUNDED: f64 = 0.55;
/// How far tufts lean by chance, of their height.
const LEAN: f64 = 0.06;
/// How far the tops of loops have bent over, at least and at most, radians: what lies hides more of the ground than what stands.
const BENT: [f64; 2] = [0.3, 2.1];
/// By how much the top of a loop is turned, at least and at most, in half turns.
const TURN: [f64; 2] = [0.3, 1.2];

#[cfg(test)]
mod tests;

/// Mean diameter of warp and weft.
fn diameter(cloth: &Cloth<'_>) -> f64 {
    cloth.weave.half_rooms[0] + cloth.weave.half_rooms[1]
}

/// A yarn, some of whose points stand free of the ground.
pub(super) struct Standing {
    strand: PatternStrand,
    /// For each point; empty where none does.
    free: Vec<bool>,
    /// Whether it is a tuft, which opens.
    tuft: Option<Tuft>,
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

    /// Whether its loops can be thicker than the rest of it: a round yarn carries no radii.
    fn opens(&self) -> bool {
        self.tuft.is_none() && !self.free.is_empty() && self.strand.curve.radii.is_some()
    }

    fn is_free(&self, point: usize) -> bool {
        self.free.get(point).copied().unwrap_or(false)
    }

    /// Puts a point between each foot and what stands on it: those of the ground are much nearer to each other, and a spline through
    /// both would swing out at the foot and fold there.
    fn ease_feet(&mut self) {
        const SHARE: f64 = 0.35;
        let way = points(&self.strand);
        let mut eased: Vec<(Point, bool)> = Vec::with_capacity(way.len() + 2 * way.len() / 8);
        for (i, &here) in way.iter().enumerate() {
            let [before, own] = [i.saturating_sub(1), i].map(|i| self.is_free(i));
            // The ground before or after the foot, the foot, and two points of the loop.
            let around = match (before, own) {
                (false, true) if i > 1 && i + 1 < way.len() => Some([i - 2, i - 1, i, i + 1]),
                (true, false) if i > 2 && i + 1 < way.len() => Some([i + 1, i, i - 1, i - 2]),
                _ => None,
            };
            if let Some(around) = around {
                let [ground, foot, first, second] = around.map(|i| way[i]);
                let length = foot.0.distance(first.0);
                let along = |a: Point, b: Point| (b.0 - a.0).normalize_or_zero() * length;
                let at = hermite([foot.0, first.0], [along(ground, foot), along(foot, second)], SHARE);
                let axis = foot.2.lerp(first.2, SHARE as f32);
                eased.push(((at, foot.1 + SHARE * (first.1 - foot.1), axis, foot.3), true));
            }
            eased.push((here, own));
        }
        if eased.len() > way.len() {
            let flat = self.strand.curve.radii.is_some();
            *self = Self::of(&self.strand, &eased, flat);
        }
    }

    /// The points by which the yarn finds room: all free ones and those beside them, few of the others.
    fn places(&self, step: f64) -> Vec<usize> {
        let points = &self.strand.curve.points;
        let free = |i: usize| self.is_free(i);
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

    /// A rope through some of its points, those that are `free` to move; the unit is a diameter.
    fn rope(&self, places: &[usize], free: impl Fn(usize) -> bool, diameter: f64) -> Rope {
        let points = &self.strand.curve.points;
        let pinned: Vec<bool> = places.iter().map(|&i| !free(i)).collect();
        let segments = places.windows(2).zip(pinned.windows(2));
        let lengths =
            segments.filter(|(_, pinned)| *pinned != [true; 2]).map(|(i, _)| points[i[0]].distance(points[i[1]]));
        let (sum, count) = lengths.fold((0.0, 0), |(sum, count), length| (sum + length, count + 1));
        let rest = if count > 0 { sum / f64::from(count) } else { STEP * 0.5 * diameter };
        let points = places.iter().map(|&i| points[i] / diameter).collect();
        Rope { points, pinned, ends: Ends::Open, rest: rest / diameter }
    }
}

/// Relaxes ropes of a diameter through places of yarns, and puts what is not pinned there.
fn find_room(yarns: &mut [Standing], places: &[(usize, Vec<usize>)], ropes: Vec<Rope>, diameter: f64, rounds: usize) {
    let mut relaxation = Relaxation { ropes, period: None, shear: 0.0 };
    relaxation.run(rounds, |_| {});
    for ((yarn, places), rope) in places.iter().zip(relaxation.ropes) {
        let points = &mut yarns[*yarn].strand.curve.points;
        for ((&i, point), _) in places.iter().zip(rope.points).zip(rope.pinned).filter(|(_, pinned)| !pinned) {
            points[i] = point * diameter;
        }
    }
}

/// A number from -1 to 1 by chance.
fn random(seed: u32, what: u32) -> f64 {
    2.0 * f64::from(unit(hash2(seed, what))) - 1.0
}

/// Lets what stands free find room; the ground stays.
pub(super) fn settle(mut yarns: Vec<Standing>, diameter: f64) -> Vec<PatternStrand> {
    if yarns.iter().any(|yarn| !yarn.free.is_empty()) {
        let step = 0.5 * STEP * diameter;
        let places: Vec<(usize, Vec<usize>)> = yarns.iter().map(|yarn| yarn.places(step)).enumerate().collect();
        let rope = |yarn: &Standing, places: &[usize]| yarn.rope(places, |i| yarn.is_free(i), diameter);
        let ropes = places.iter().map(|(yarn, places)| rope(&yarns[*yarn], places)).collect();
        find_room(&mut yarns, &places, ropes, diameter, ROUNDS);
    }
    arch::spread(&mut yarns, diameter);
    arch::bloom(&mut yarns, diameter);
    yarns.iter_mut().filter(|yarn| yarn.tuft.is_none()).for_each(Standing::ease_feet);
    let tufts: Vec<(&PatternStrand, &Tuft)> =
        yarns.iter().filter_map(|yarn| Some((&yarn.strand, yarn.tuft.as_ref()?))).collect();
    let mut opened = tuft::open(&tufts).into_iter();
    let strands = |yarn: Standing| match yarn.tuft {
        Some(_) => opened.next().unwrap_or_default(),
        None => vec![yarn.strand],
    };
    yarns.into_iter().flat_map(strands).collect()
}

/// Raises the floats of a pile yarn. It is held where it lies on the other side of the cloth.
pub(super) fn raise(cloth: &Cloth<'_>, strand: PatternStrand, number: i64, hem: i64) -> Vec<Standing> {
    let draft = &cloth.weave.draft;
    let side = usize::from(strand.kind == StrandKind::Weft);
    let own = number.rem_euclid([draft.warps(), draft.wefts()][side] as i64) as usize;
    let Some((pile, back)) = draft.pile().and_then(|pile| Some((pile, pile.stands(side, own)?))) else {
        return vec![Standing::ground(strand)];
    };
    let raised = Raised::new(cloth, pile, &strand, PileYarn { side, own, back }, hem);
    if pile.cut {
        return raised.tufts(spread(cloth, pile, side, raised.wale.is_some()));
    }
    match raised.looped() {
        Some(looped) => vec![looped],
        None => vec![Standing::ground(strand)],
    }
}

/// Which yarn of a repeat it is, warp (0) or weft (1), and whether it stands up on the back.
#[derive(Clone, Copy)]
struct PileYarn {
    side: usize,
    own: usize,
    back: bool,
}

/// A place where the ground holds a pile yarn.
struct Hold {
    /// The point of the yarn.
    at: i64,
    /// Whether it is in a border that is woven flat.
    flat: bool,
}

/// A pile yarn that is raised.
struct Raised<'a> {
    cloth: &'a Cloth<'a>,
    /// As it lies in the ground.
    strand: &'a PatternStrand,
    way: Vec<Point>,
    /// Its crossing c is at point `nodes / 2 + (c - first) * nodes`.
    first: i64,
    holds: Vec<Hold>,
    side: usize,
    /// 1 on the face, -1 on the back.
    up: f64,
    seed: u32,
    wale: Option<Wale>,
    /// How far legs stand from where their tuft is held, in points and in crossings.
    reach: i64,
    rise: f64,
    /// How far legs lean towards each other, in crossings.
    even: f64,
}

/// Where tufts stand in rows across the yarns that they are cut of; in crossings.
#[derive(Clone)]
struct Wale {
    middle: f64,
    /// Distance to the next.
    period: f64,
    /// Where legs stand at the ground, from the middle, in order: at their tips they are as far from each other.
    feet: Vec<f64>,
}

impl Wale {
    /// Share of a wale's period that is no groove.
    const FULL: f64 = 0.85;

    /// Of a place, how far it is from the middle of its wale.
    fn beside(&self, place: f64) -> f64 {
        let away = (place - self.middle) / self.period;
        (away - away.round()) * self.period
    }

    /// Where the tips of a leg are that stands at a place, from the middle of its wale.
    fn tips(&self, foot: f64) -> f64 {
        let count = self.feet.len().max(1) as f64;
        let order = self.feet.iter().filter(|f| **f < foot - 1e-6).count() as f64;
        Self::FULL * self.period * ((order + 0.5).min(count - 0.5) / count - 0.5)
    }
}

/// Whether a yarn of a side is held at its crossing with another: there it lies on the side of the cloth that its pile leaves.
fn is_held(draft: &Draft, side: usize, own: usize, other: usize, back: bool) -> bool {
    let on_top = if side == 0 { draft.warp_over(other, own) } else { !draft.warp_over(own, other) };
    on_top == back
}

/// Places, in crossings, where the pile yarns of a repeat are held.
fn held_places<'a>(draft: &'a Draft, pile: &'a Pile, side: usize) -> impl Iterator<Item = usize> + 'a {
    let [own, other] = if side == 0 { [draft.warps(), draft.wefts()] } else { [draft.wefts(), draft.warps()] };
    (0..own)
        .filter_map(move |yarn| Some((yarn, pile.stands(side, yarn)?)))
        .flat_map(move |(yarn, back)| (0..other).filter(move |&c| is_held(draft, side, yarn, c, back)))
}

/// The wales of a pile, unless it is held everywhere alike; its legs rise so far from where they are held.
fn wale(draft: &Draft, pile: &Pile, side: usize, rise: f64) -> Option<Wale> {
    const ALIKE: f64 = 0.2;
    let period = if side == 0 { draft.wefts() } else { draft.warps() } as f64;
    let (sum, count) = held_places(draft, pile, side).fold((DVec2::ZERO, 0.0), |(sum, count), place| {
        (sum + DVec2::from_angle(TAU * place as f64 / period), count + 1.0)
    });
    (sum.length() > ALIKE * count).then(|| {
        let mut wale = Wale { middle: sum.to_angle() / TAU * period, period, feet: Vec::new() };
        let places: BTreeSet<usize> = held_places(draft, pile, side).collect();
        let holds = places.into_iter().map(|place| wale.beside(place as f64));
        wale.feet = holds.flat_map(|hold| [hold - rise, hold + rise]).collect();
        wale
    })
}

/// Half the room of a leg, across the yarns of the pile and along them, in wales or everywhere alike.
fn spread(cloth: &Cloth<'_>, pile: &Pile, side: usize, in_wales: bool) -> [f64; 2] {
    let draft = &cloth.weave.draft;
    let [p, q] = cloth.cell.spacing;
    let size = [p * draft.warps() as f64, q * draft.wefts() as f64];
    let legs = 2.0 * held_places(draft, pile, side).count().max(1) as f64;
    if in_wales {
        // Tufts behind each other share what their wale has of the repeat's other side.
        let places: BTreeSet<usize> = held_places(draft, pile, side).collect();
        let across = 2.0 * size[side] * places.len() as f64 / legs;
        return [0.5 * across, 0.5 * Wale::FULL * size[0] * size[1] / (legs * across)];
    }
    let standing = (0..[draft.warps(), draft.wefts()][side]).filter(|&yarn| pile.stands(side, yarn).is_some()).count();
    let across = size[side] / standing.max(1) as f64;
    [0.5 * across, 0.5 * size[0] * size[1] / (legs * across)]
}

/// How far from a hold legs stand that keep out of each other's way, in points.
fn reach(cloth: &Cloth<'_>, pile: &Pile, side: usize, holds: &[Hold]) -> i64 {
    let nodes = cloth.cell.nodes as f64;
    if !pile.cut {
        return (RISE * nodes).floor() as i64;
    }
    let nearest = holds.windows(2).map(|pair| pair[1].at - pair[0].at).min().unwrap_or(i64::MAX);
    let own_room = 0.5 * diameter(cloth) / cloth.cell.spacing[1 - side];
    // The feet of a tuft and of the next on its yarn stand beside each other.
    let beside = RISE.min(0.5 * nearest as f64 / nodes - own_room).max(LEAST_RISE);
    (beside * nodes).floor() as i64
}

impl<'a> Raised<'a> {
    fn new(cloth: &'a Cloth<'a>, pile: &Pile, strand: &'a PatternStrand, yarn: PileYarn, hem: i64) -> Self {
        let (draft, nodes) = (&cloth.weave.draft, cloth.cell.nodes as i64);
        let PileYarn { side, own, back } = yarn;
        let size = [draft.wefts(), draft.warps()][side] as i64;
        let held = |crossing: i64| is_held(draft, side, own, crossing.rem_euclid(size) as usize, back);
        let way = points(strand);
        let first = if side == 0 { -hem } else { 0 };
        // A hem, and what it is folded onto, is woven flat, as borders of towels are.
        let border = if hem > 0 { hem + 1 } else { 0 };
        let flat = |crossing: i64| side == 0 && !(border..i64::from(cloth.count[1]) - border).contains(&crossing);
        let holds: Vec<Hold> = (0..(way.len() as i64 - 1) / nodes)
            .filter(|c| held(c + first))
            .map(|c| Hold { at: nodes / 2 + c * nodes, flat: flat(c + first) })
            .collect();
        let reach = reach(cloth, pile, side, &holds);
        let rise = reach as f64 / nodes as f64;
        let wale = wale(draft, pile, side, rise);
        let per_repeat = (0..size).filter(|&c| held(c)).count().max(1) as f64;
        let even = if wale.is_some() { 0.0 } else { (RISE - 0.25 * size as f64 / per_repeat).clamp(0.0, RISE) };
        let (up, seed) = (if back { -1.0 } else { 1.0 }, strand.index ^ ((side as u32) << 30));
        Self { cloth, strand, way, first, holds, side, up, seed, wale, reach, rise, even }
    }

    /// Its points in the ground between two, these among them; nothing where that would begin beyond the end: the yarn may end on
    /// top of its last crossing.
    fn part(&self, from: i64, to: i64) -> Vec<(Point, bool)> {
        let (from, to) = (from.max(0), to.min(self.way.len() as i64 - 1));
        if from > to { Vec::new() } else { self.way[from as usize..=to as usize].iter().map(|&p| (p, false)).collect() }
    }

    /// What is left of it where its floats are cut: a tuft at each hold, whose legs have half of this room.
    fn tufts(&self, spread: [f64; 2]) -> Vec<Standing> {
        self.holds.iter().filter(|hold| !hold.flat).map(|hold| self.tuft(hold.at, spread)).collect()
    }

    fn tuft(&self, at: i64, spread: [f64; 2]) -> Standing {
        let nodes = self.cloth.cell.nodes as i64;
        let base = self.part(at - self.reach, at + self.reach);
        let (a, b) = (base[0].0, base[base.len() - 1].0);
        let place = (at - nodes / 2) as f64 / nodes as f64 + self.first as f64;
        let [before, after] = [(a, -1.0), (b, 1.0)].map(|(foot, out)| self.leg(foot, out, at as u32, place));
        let tuft = Tuft {
            across: self.direction(0.0, 1.0, 0.0),
            legs: [before.len(), after.len()],
            stride: (nodes as usize / 4).max(1),
            radius: self.radius(),
            spread,
            cut: self.cut(0.5 * (a.0.z + b.0.z), place),
            seed: hash2(self.seed, at as u32),
        };
        let free = |p: Point| (p, true);
        let all: Vec<(Point, bool)> =
            before.into_iter().rev().map(free).chain(base).chain(after.into_iter().map(free)).collect();
        Standing { tuft: Some(tuft), ..Standing::of(self.strand, &all, self.cloth.weave.sized()) }
    }

    /// All of it, its floats loops; `None` where nothing holds it.
    fn looped(&self) -> Option<Standing> {
        let (first, last) = (self.holds.first()?.at, self.holds.last()?.at);
        let reach = self.reach;
        let mut all = self.part(0, first + reach);
        for pair in self.holds.windows(2) {
            let (from, to) = (pair[0].at, pair[1].at);
            if to - from > self.cloth.cell.nodes as i64 && !pair[0].flat && !pair[1].flat {
                let (a, b) = (all[all.len() - 1].0, self.way[(to - reach) as usize]);
                all.extend(self.arch(a, b, from as u32).into_iter().map(|p| (p, true)));
                all.extend(self.part(to - reach, to + reach));
            } else {
                all.extend(self.part(from + reach + 1, to + reach));
            }
        }
        all.extend(self.part(last + reach + 1, self.way.len() as i64 - 1));
        Some(Standing::of(self.strand, &all, self.cloth.weave.sized()))
    }

    fn radius(&self) -> f64 {
        self.cloth.weave.half_rooms[self.side]
    }

    /// From -1 to 1.
    fn random(&self, place: u32, what: u32) -> f64 {
        random(hash2(self.seed, place), what)
    }

    /// Along the yarn, across it, up.
    fn direction(&self, along: f64, across: f64, up: f64) -> DVec3 {
        if self.side == 0 { DVec3::new(across, along, up * self.up) } else { DVec3::new(along, across, up * self.up) }
    }

    fn at(&self, p: DVec3, near: Point) -> Point {
        (p, self.radius(), self.direction(1.0, 0.0, 0.0).as_vec3(), near.3)
    }

    /// The face of the pile over feet at a height, of a tuft that is held at `place` along the yarn, in crossings.
    fn cut(&self, foot: f64, place: f64) -> Cut {
        let vault = self.wale.as_ref().map(|wale| {
            let own = place - wale.beside(place);
            let half = 0.5 * wale.period * self.cloth.cell.spacing[1 - self.side];
            let middle = self.cloth.position(1 - self.side, own + 0.5);
            Vault { axis: 1 - self.side, middle, half, lower: ROUNDED }
        });
        Cut { foot, top: foot + self.up * self.cloth.weave.pile_height, vault }
    }

    /// A leg that stands up from `from`, before or after the place `hold` along the yarn, in crossings.
    fn leg(&self, from: Point, out: f64, place_of: u32, hold: f64) -> Vec<Point> {
        let (r, height) = (self.radius(), self.cloth.weave.pile_height);
        let what = if out > 0.0 { 0 } else { 8 };
        let [lean, aside] = [what, what + 1].map(|what| LEAN * height * self.random(place_of, what));
        let spacing = self.cloth.cell.spacing[1 - self.side];
        // Tips share the width of their wale; else both legs of a tuft and of the next stand alike far apart at their tips.
        let (to, lower) = match &self.wale {
            Some(wale) => {
                let foot = wale.beside(hold) + out * self.rise;
                let tips = wale.tips(foot);
                (tips - foot, ROUNDED * (2.0 * tips / wale.period).powi(2))
            }
            None => (-out * self.even, 0.0),
        };
        let height = height * (1.0 - lower);
        let steps = (height / (STEP * r)).ceil().max(2.0) as usize;
        let leg = |k: usize| {
            let s = k as f64 / steps as f64;
            self.at(from.0 + self.direction(to * spacing * s + lean * s * s, aside * s * s, height * s), from)
        };
        (1..=steps).map(leg).collect()
    }

    /// A loop from `from` to `to`, without both. Yarn that wants to untwist turns all of them to one side, each by another
    /// angle.
    fn arch(&self, from: Point, to: Point, place: u32) -> Vec<Point> {
        let height = self.cloth.weave.pile_height;
        let random = |what: u32| self.random(place, what);
        let side = DVec2::from_angle(PI * random(0)).extend(0.0);
        let arch = Arch {
            feet: [from.0, to.0],
            up: self.direction(0.0, 0.0, 1.0),
            radius: self.radius(),
            height: height * (1.0 + 0.05 * random(2)),
            side,
            bend: BENT[0] + (BENT[1] - BENT[0]) * (0.5 + 0.5 * random(1)).sqrt(),
            turn: PI * (TURN[0] + (TURN[1] - TURN[0]) * (0.5 + 0.5 * random(3))),
        };
        let points = arch.points(STEP * self.radius());
        let count = points.len();
        let near = |k: usize| if 2 * k < count { from } else { to };
        points.into_iter().enumerate().map(|(k, p)| self.at(p, near(k))).collect()
    }
}
