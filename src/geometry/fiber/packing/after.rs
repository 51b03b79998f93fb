//! What light meets after a fibre, counted on packings: [`AfterFiber`] is fitted to ways out of fibres that lines met.

use std::{
    f64::consts::{FRAC_PI_4, TAU},
    ops::Add,
};

use arrayvec::ArrayVec;
use glam::DVec2;
use rayon::prelude::*;
use wide::f32x8;

use super::{
    line::{Hit, Line},
    lines::Lines,
};
use crate::{
    geometry::{
        after_fiber::{AfterFiber, AfterTurn, Missing, MissingFibers},
        cleared_strip::{ClearedStrip, misses},
        ply::PlyShape,
    },
    math::sampler::Stream,
};

/// Ways that one thread takes at once.
const CHUNK: usize = 4096;
/// Ways from a fibre.
const TURNS: usize = 4;

/// A fibre from which there are ways, of those that a line meets.
struct LookedAt {
    hit: usize,
    /// How many it stands for.
    weight: f32,
    /// By which angles light is turned there.
    turns: [f64; TURNS],
}

/// A way out of a ply from a fibre at which light was turned.
#[derive(Clone, Copy)]
struct Way {
    /// Whether the light met others before the fibre.
    later: bool,
    /// How many ways it stands for.
    weight: f32,
    /// Cosine of the light's turn.
    turn: f32,
    /// How much it is along the section's short axis, 0 to 1; a half where the section is round.
    short: f32,
    /// How many fibres are ahead, less those in the strip that light which goes back has swept.
    expected: f32,
    /// How much it is by the rim.
    by_rim: f32,
    /// How many it meets; if it goes back, but for those that the light met before.
    met: u32,
    /// The chance that it meets none of these, as far as their places tell, and whether it does not.
    open: f32,
    is_open: bool,
}

impl Way {
    /// What it should meet.
    fn law<'a>(&self, after: &'a AfterFiber) -> AfterTurn<'a> {
        after.turned(self.later, self.turn, self.short)
    }
}

/// Fits what light meets after a fibre to ways through packings: as many get out, and as many fibres are met, as are counted, about each number
/// of expected fibres and each turn, along each axis, inside and by the rim.
pub(super) fn after(lines: &Lines, sections: &[Vec<DVec2>], ply: &PlyShape) -> AfterFiber {
    let ways = ways(lines, sections, ply);
    let mut after = AfterFiber::free(0.0);
    let rate = (1.0 - ply.mean_dead_zone()).recip() as f32;
    for asked in [Asked::Unscattered { rate }, Asked::Counted] {
        // First as if those inside and by the rim and along both axes were alike: of some there are too few to begin with.
        for alike in [true, true, true, false, false, false] {
            let of_chunk = |ways: &[Way]| {
                let mut sums = Tables::default();
                for way in ways {
                    let law = way.law(&after);
                    sums.add(way, law.shares(), asked.counted(way), asked.fitted(way, &law));
                }
                sums
            };
            // In their order, whatever the number of threads.
            let sums: Vec<Tables> = ways.par_chunks(CHUNK).map(of_chunk).collect();
            let all = sums.into_iter().fold(Tables::default(), Tables::and);
            all.improve(&mut after, asked, alike);
        }
    }
    after
}

/// Random ways, half of them onward and half back.
fn ways(lines: &Lines, sections: &[Vec<DVec2>], ply: &PlyShape) -> Vec<Way> {
    const RAYS: usize = 16_000;
    let mut stream = Stream::new(0xaf7e);
    let mut rays = Vec::with_capacity(RAYS);
    for ray in 0..RAYS {
        let line = Line::random(lines, &sections[ray % sections.len()], None, &mut stream);
        let mut hits = line.hits(lines);
        let Some(first) = (0..hits.len()).min_by(|&a, &b| hits[a].enter.total_cmp(&hits[b].enter)) else {
            continue;
        };
        hits.swap(0, first);
        // Any other one stands for all but the first.
        let others = hits.len() - 1;
        let other = 1 + (f64::from(stream.next()) * others as f64) as usize;
        let looked_at = [(0, 1.0), (other, others as f32)].map(|(hit, weight)| {
            let turn = |turn: usize| (turn as f64 + f64::from(stream.next())) / TURNS as f64 * TAU;
            (hit < hits.len()).then(|| LookedAt { hit, weight, turns: std::array::from_fn(turn) })
        });
        rays.push((line, hits, looked_at));
    }
    // All that is random is drawn.
    let of_ray = |(line, hits, looked_at): (Line<'_>, Vec<Hit>, [Option<LookedAt>; 2])| {
        let mut ways = ArrayVec::<Way, { 2 * TURNS }>::new();
        for (later, of) in looked_at.into_iter().enumerate() {
            let Some(LookedAt { hit, weight, turns }) = of else { continue };
            for turn in turns {
                let w = DVec2::from_angle(turn).rotate(line.along);
                let way = line.turned(lines, ply, (&hits[hit], &hits), later > 0, w);
                ways.extend(way.map(|way| Way { weight, ..way }));
            }
        }
        ways
    };
    rays.into_par_iter().with_min_len(RAYS / 64).flat_map_iter(of_ray).collect()
}

impl Line<'_> {
    /// The way of its light that is turned to a direction at one of them, the first or a `later` one. `None` if it begins outside of the ply.
    fn turned(&self, lines: &Lines, ply: &PlyShape, (hit, hits): (&Hit, &[Hit]), later: bool, w: DVec2) -> Option<Way> {
        let (along, across) = (self.along, self.along.perp());
        let at = |distance: f64| distance * along + self.offset * across;
        let turn = w.dot(along);
        // As the model has it: abreast of the fibre's centre, and from where the light came.
        let from = at(hit.lies) + FRAC_PI_4 * lines.radius * (turn.max(0.0) * w - along);
        let (expected, offset) = ahead(lines, ply, from, w, (turn < 0.0).then_some(turn))?;
        let mut met = met(lines, self.discs, hit.fiber, at(hit.enter), w);
        let (mut open, mut is_open) = (1.0, true);
        if turn < 0.0 {
            for before in hits.iter().filter(|of| of.enter < hit.enter) {
                let way = at(before.lies) - from;
                if way.dot(w) > 0.0 {
                    open *= misses((way.dot(w.perp()) / lines.radius) as f32, turn as f32);
                }
                if let Some(at) = met.iter().position(|of| *of == before.fiber) {
                    met.swap_remove(at);
                    is_open = false;
                }
            }
        }
        Some(Way {
            later,
            weight: 1.0,
            turn: turn as f32,
            short: if lines.stretch == 1.0 { 0.5 } else { (w.y * w.y) as f32 },
            expected: expected as f32,
            by_rim: ply.by_rim(offset),
            met: met.len() as u32,
            open,
            is_open,
        })
    }
}

/// The others that a way from a place on a fibre meets.
fn met(lines: &Lines, discs: &[DVec2], fiber: usize, from: DVec2, w: DVec2) -> Vec<usize> {
    let is_met = |(other, disc): &(usize, &DVec2)| {
        let way = **disc - from;
        *other != fiber
            && way.dot(w) >= 0.0
            && way.dot(w.perp()).abs() < lines.radius * lines.slopes.half_width(**disc, w.perp())
    };
    discs.iter().enumerate().filter(is_met).map(|(other, _)| other).collect()
}

/// The fibres that light is expected to meet from a place in a direction, less those in the strip that it has swept if it was
/// turned `back` by an angle of a cosine; and the distance of its way from the ply's axis. `None` if the place is outside and there are none.
fn ahead(lines: &Lines, ply: &PlyShape, from: DVec2, w: DVec2, back: Option<f64>) -> Option<(f64, f32)> {
    let root = lines.stretch.sqrt();
    let (beside, scales) = (from.dot(w.perp()), lines.scales(w.perp()));
    if beside.abs() >= scales.reach * (1.0 + lines.radius) {
        return None;
    }
    let [foot, offset] = [lines.middle(from, w) / root, beside / scales.reach].map(|v| v as f32);
    let chord = scales.chord(ply, offset);
    let swept = |turn: f64| {
        let sine = (1.0 - turn * turn).max(0.0).sqrt() as f32;
        let strip = ClearedStrip::new(2.0 * scales.thin * lines.radius as f32, [0.0, sine], [0.0, f32::INFINITY]);
        strip.fibers(&chord, foot)
    };
    let ahead = (chord.ahead(-foot) - back.map_or(0.0, swept)).max(0.0);
    // As wide as they are in the middle of what is ahead.
    let middle = 0.5 * ((foot - chord.half).max(0.0) + (foot + chord.half).max(0.0));
    let wider = lines.slopes.half_width(from + root * f64::from(middle) * w, w.perp());
    Some((wider * root * f64::from(ahead), offset))
}

/// What is counted of ways, and what the fit so far has of them.
#[derive(Clone, Copy, Default)]
struct Sum<T = f32> {
    ways: T,
    weight: T,
    counted: T,
    fitted: T,
}

/// For each number of a row.
type Sums = Sum<f32x8>;

impl<T: Add<Output = T>> Sum<T> {
    fn and(self, other: Self) -> Self {
        Self {
            ways: self.ways + other.ways,
            weight: self.weight + other.weight,
            counted: self.counted + other.counted,
            fitted: self.fitted + other.fitted,
        }
    }
}

impl Sums {
    /// What is said of `shares` of a way.
    fn add(&mut self, shares: f32x8, weight: f32, counted: f32, fitted: f32) {
        let weights = shares * f32x8::splat(weight);
        let (counted, fitted) = (weights * f32x8::splat(counted), weights * f32x8::splat(fitted));
        *self = self.and(Self { ways: shares, weight: weights, counted, fitted });
    }

    /// Those of one number.
    fn of(&self, number: usize) -> Sum {
        let [ways, weight, counted, fitted] =
            [self.ways, self.weight, self.counted, self.fitted].map(|lanes| lanes.to_array()[number]);
        Sum { ways, weight, counted, fitted }
    }
}

/// What is to be as it is counted.
#[derive(Clone, Copy)]
enum Asked {
    /// How much light is out, where so much ends for each fibre that is met.
    Unscattered { rate: f32 },
    /// How many fibres are met.
    Counted,
}

impl Asked {
    fn counted(self, way: &Way) -> f32 {
        match self {
            Self::Unscattered { .. } => f32::from(u8::from(way.is_open && way.met == 0)),
            Self::Counted => way.met as f32,
        }
    }

    fn fitted(self, way: &Way, law: &AfterTurn<'_>) -> f32 {
        match self {
            Self::Unscattered { rate } => way.open * (-rate * law.met(way.expected, way.by_rim)).exp(),
            Self::Counted => law.counted(way.expected, way.by_rim),
        }
    }

    /// By how many more fibres the fit should have missing; where few ways tell, by less.
    fn more_missing(self, sum: Sum) -> f32 {
        /// So many ways that are as the fit has it are thought to be there besides.
        const AS_FITTED: f32 = 10.0;
        if sum.ways == 0.0 {
            return 0.0;
        }
        let besides = AS_FITTED * sum.weight / sum.ways;
        match self {
            Self::Unscattered { rate } => ((sum.counted + besides) / (sum.fitted + besides)).ln() / rate,
            Self::Counted => (sum.fitted - sum.counted) / (sum.weight + besides),
        }
    }

    fn of(self, missing: &mut MissingFibers) -> &mut Missing {
        match self {
            Self::Unscattered { .. } => &mut missing.unscattered,
            Self::Counted => &mut missing.counted,
        }
    }
}

/// Sums for the rows of a [`Missing`]: inside and by the rim.
type Table = [[Sums; AfterFiber::KNOTS]; 2];

/// Those of an [`AfterFiber`]: first, later, back, back later.
#[derive(Default)]
struct Tables([Table; 4]);

impl Tables {
    fn and(mut self, other: Self) -> Self {
        let all = self.0.iter_mut().flatten().flatten();
        all.zip(other.0.iter().flatten().flatten()).for_each(|(sums, more)| *sums = sums.and(*more));
        self
    }

    fn add(&mut self, way: &Way, shares: f32x8, counted: f32, fitted: f32) {
        let table = &mut self.0[2 * usize::from(way.turn < 0.0) + usize::from(way.later)];
        let (below, at) = AfterFiber::knot(way.expected);
        for (knot, of_knot) in [(below, 1.0 - at), (below + 1, at)] {
            for (rows, of_rim) in table.iter_mut().zip([1.0 - way.by_rim, way.by_rim]) {
                rows[knot].add(shares * f32x8::splat(of_knot * of_rim), way.weight, counted, fitted);
            }
        }
    }

    /// Brings what is asked nearer to what is counted; as if all of one turn were `alike`, or each for itself.
    fn improve(&self, after: &mut AfterFiber, asked: Asked, alike: bool) {
        let AfterFiber { first, later, back, back_later } = after;
        for (table, missing) in self.0.iter().zip([first, later, back, back_later]) {
            let Missing { inside, rim } = asked.of(missing);
            for (sums, rows) in table.iter().zip([inside, rim]) {
                for knot in 1..AfterFiber::KNOTS {
                    for k in 0..rows[knot].len() {
                        let sum = if alike { of_turn(table, knot, k) } else { sums[knot].of(k) };
                        rows[knot][k] = within(rows[knot][k] + asked.more_missing(sum), rows[knot - 1][k], knot);
                    }
                }
            }
        }
    }
}

/// The sum about a knot and of the turn of a row's number, along both axes, inside and by the rim.
fn of_turn([inside, rim]: &Table, knot: usize, number: usize) -> Sum {
    let both = |sums: &Sums| sums.of(number).and(sums.of(number ^ 1));
    both(&inside[knot]).and(both(&rim[knot]))
}

/// Missing fibres at a knot so that the more are expected, the more are met.
fn within(missing: f32, before: f32, knot: usize) -> f32 {
    /// By how many more than expected may be met, at most.
    const MOST_MORE: f32 = 2.0;
    missing.clamp(-MOST_MORE, before + AfterFiber::expected(knot) - AfterFiber::expected(knot - 1))
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::{
        super::tests::{measured_ply, other_sections},
        *,
    };
    use crate::geometry::density::KnownPacking;

    #[test]
    fn as_much_light_leaves_after_a_fiber_as_in_other_packings() {
        let given = KnownPacking { crowding: Some(0.1), regularity: Some(0.6) };
        let measured_only = KnownPacking::default();
        for (count, density, stretch, known) in [
            (60u32, 0.2f64, 1.0, measured_only),
            (60, 0.45, 1.0, measured_only),
            (60, 0.45, 1.0, given),
            (60, 0.6, 1.0, measured_only),
            (100, 0.4, 1.5, measured_only),
        ] {
            let (lines, ply) = measured_ply(count, density, stretch, known);
            let law = ply.after.unwrap();
            let rate = (1.0 - ply.mean_dead_zone()).recip() as f32;
            // By turns of 12 degrees: light that is out and fibres that are met, as they are and by the law.
            let mut sums = [[[0.0f64; 5]; 15]; 2];
            for way in ways(&lines, &other_sections(count, density, stretch), &ply) {
                let sum = &mut sums[usize::from(way.later)][(way.turn.acos() / PI * 15.0).min(14.0) as usize];
                let numbers = [Asked::Unscattered { rate }, Asked::Counted]
                    .map(|asked| [asked.counted(&way), asked.fitted(&way, &way.law(&law))])
                    .concat();
                let weighted = numbers.iter().map(|number| way.weight * number).chain([way.weight]);
                sum.iter_mut().zip(weighted).for_each(|(sum, number)| *sum += f64::from(number));
            }
            for (later, turns) in sums.iter().enumerate() {
                for (turn, [out, by_law, met, met_by_law, all]) in turns.iter().enumerate() {
                    let case = format!("{count} at {density}, {stretch}, {known:?}, later {later}, turn {turn}");
                    let (out, by_law) = (out / all, by_law / all);
                    assert!((out - by_law).abs() < 0.01 + 0.04 * out, "{case}: {out} are out, {by_law} by the law");
                    let (met, met_by_law) = (met / all, met_by_law / all);
                    assert!(
                        (met - met_by_law).abs() < 0.02 + 0.05 * met,
                        "{case}: {met} are met, {met_by_law} by the law"
                    );
                }
            }
            // Along the axes of a pressed section it is not the same.
            let rows = law.first.unscattered.inside;
            let round = rows.iter().skip(1).all(|row| row[0] == row[1]);
            assert_eq!(stretch == 1.0, round, "{rows:?}");
        }
    }
}
