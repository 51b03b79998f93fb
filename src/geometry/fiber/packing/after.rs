//! What light meets in packings after a fibre that it has met.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use glam::DVec2;

use super::lines::Lines;
use crate::{
    geometry::{
        density::{AfterFiber, ClearedStrip, MissingFibers, TURNS},
        yarn::PlyShape,
    },
    math::sampler::Stream,
};

/// A number for each number of expected fibres of [`AfterFiber`].
type Knots = [f32; AfterFiber::KNOTS];

/// A fibre on a line: where the line enters it, and where it is abreast of its centre.
struct Hit {
    fiber: usize,
    enter: f64,
    lies: f64,
}

/// Light that is out, about each number of expected fibres, and what would be of fibres at random.
struct Out {
    /// Extinction per expected fibre.
    rate: f64,
    /// Whether more than expected may be met.
    blocked: bool,
    counted: [f64; AfterFiber::KNOTS + 1],
    at_random: [f64; AfterFiber::KNOTS + 1],
}

impl Out {
    fn of(ply: &PlyShape, blocked: bool) -> Self {
        let none = [0.0; AfterFiber::KNOTS + 1];
        Self { rate: (1.0 - ply.mean_dead_zone()).recip(), counted: none, at_random: none, blocked }
    }

    fn add(&mut self, weight: f64, expected: f64, is_out: bool) {
        let at = (expected / f64::from(AfterFiber::STEP)).min((AfterFiber::KNOTS - 1) as f64);
        for (knot, share) in [(at as usize, 1.0 - at.fract()), (at as usize + 1, at.fract())] {
            self.counted[knot] += weight * share * f64::from(u8::from(is_out));
            self.at_random[knot] += weight * share * (-self.rate * expected).exp();
        }
    }

    /// Both together.
    fn with(&self, other: &Self) -> Self {
        let sum = |of: fn(&Self) -> &[f64; AfterFiber::KNOTS + 1]| {
            std::array::from_fn(|knot| of(self)[knot] + of(other)[knot])
        };
        Self { counted: sum(|out| &out.counted), at_random: sum(|out| &out.at_random), ..*self }
    }

    /// How many of the expected fibres are missing at each knot: of `all` light where too little of this is out to tell, and as many as at the
    /// one before where that is too little as well.
    fn missing(&self, all: &Self) -> Knots {
        const LEAST: f64 = 12.0;
        /// By how many more than expected may be met, at most.
        const MOST_MORE: f64 = 2.0;
        let least = if self.blocked { -MOST_MORE } else { 0.0 };
        let mut missing = [0.0f32; AfterFiber::KNOTS];
        for knot in 1..AfterFiber::KNOTS {
            let before = missing[knot - 1];
            if let Some(out) = [self, all].into_iter().find(|out| out.counted[knot] >= LEAST) {
                let of_random = (out.counted[knot] / out.at_random[knot]).ln() / self.rate;
                // The more are to be expected, the more are met.
                missing[knot] = of_random.clamp(least, f64::from(before + AfterFiber::STEP)) as f32;
            } else {
                missing[knot] = before;
            }
        }
        missing
    }
}

impl Lines {
    /// What light meets after a fibre: so much less of fibres at random would keep as much of it in.
    pub(super) fn after(&self, sections: &[Vec<DVec2>], ply: &PlyShape) -> AfterFiber {
        let on_ways = |turn: f64| {
            let near = |axis: Option<f64>| self.after_on_ways(sections, ply, turn, axis);
            if self.stretch == 1.0 { [near(None); 2] } else { [near(Some(0.0)), near(Some(FRAC_PI_2))] }
        };
        let [onward, back] = TURNS.map(|turns| turns.map(on_ways));
        let missing = |[[a, b], [c, d]]: [[[[Knots; 2]; 2]; 2]; 2], which: usize| {
            let rows = |rim: usize| std::array::from_fn(|knot| [a, b, c, d].map(|numbers| numbers[which][rim][knot]));
            MissingFibers { inside: rows(0), rim: rows(1) }
        };
        let [first, later] = [0, 1].map(|which| missing(onward, which));
        let [back, back_later] = [0, 1].map(|which| missing(back, which));
        AfterFiber { first, later, back, back_later }
    }

    /// The same of light that is turned by an angle, on ways in all directions or near one of an angle: after the first fibre on
    /// a line and after another one, of each on ways through the inside and by the rim.
    fn after_on_ways(&self, sections: &[Vec<DVec2>], ply: &PlyShape, turn: f64, axis: Option<f64>) -> [[Knots; 2]; 2] {
        /// How near, radians.
        const NEAR: f64 = 0.25;
        const RAYS: usize = 20_000;
        let mut stream = Stream::new(0xaf7e);
        let mut next = || f64::from(stream.next());
        let turns = [turn, -turn];
        let mut counts = [0, 1].map(|later| [0, 1].map(|_| Out::of(ply, later == 1 && turn > FRAC_PI_2)));
        let mut hits = Vec::new();
        for ray in 0..RAYS {
            let discs = &sections[ray % sections.len()];
            // Near an axis to one side only: to the other it would lead elsewhere.
            let (along, turns) = match axis {
                None => (TAU * next(), &turns[..]),
                Some(axis) => (axis + NEAR * (2.0 * next() - 1.0) - turns[ray % 2], &turns[ray % 2..=ray % 2]),
            };
            let along = DVec2::from_angle(along);
            let across = along.perp();
            let offset = (2.0 * next() - 1.0) * (self.reach(across) + self.radius);
            hits.clear();
            hits.extend(discs.iter().enumerate().filter_map(|(fiber, disc)| {
                let off = disc.dot(across) - offset;
                let half = self.radius * self.slopes.half_width(*disc, across);
                let lies = disc.dot(along);
                let enter = lies - self.radius * (1.0 - (off / half).powi(2)).sqrt();
                (off.abs() < half).then_some(Hit { fiber, enter, lies })
            }));
            let Some(first) = (0..hits.len()).min_by(|&a, &b| hits[a].enter.total_cmp(&hits[b].enter)) else {
                continue;
            };
            hits.swap(0, first);
            // Any other one stands for all but the first.
            let others = hits.len() - 1;
            let other = 1 + (next() * others as f64) as usize;
            let looked_at = [Some((&hits[0], 1.0)), hits.get(other).map(|hit| (hit, others as f64))];
            for (later, (hit, counts)) in looked_at.into_iter().zip(&mut counts).enumerate() {
                let Some((hit, weight)) = hit else { continue };
                let at = |lies: f64| lies * along + offset * across;
                let tilt = self.slopes.half_width(discs[hit.fiber], across);
                for &turn in turns {
                    let w = DVec2::from_angle(turn).rotate(along);
                    // As the model has it: abreast of the fibre's centre, and from where the light came.
                    let from = at(hit.lies) + FRAC_PI_4 * self.radius * (along.dot(w).max(0.0) * w - along);
                    let swept = later == 0 && turn.abs() > FRAC_PI_2;
                    if let Some((ahead, offset)) = self.ahead(ply, from, w, swept.then_some(turn)) {
                        let is_out = self.is_free(discs, hit.fiber, at(hit.enter), w);
                        let by_rim = f64::from(ply.by_rim(offset));
                        for (count, share) in counts.iter_mut().zip([1.0 - by_rim, by_rim]) {
                            count.add(share * weight, tilt * ahead, is_out);
                        }
                    }
                }
            }
        }
        counts.map(|[inside, rim]| {
            let all = inside.with(&rim);
            [inside, rim].map(|out| out.missing(&all))
        })
    }

    /// Whether a way from a place on a fibre meets no other.
    fn is_free(&self, discs: &[DVec2], fiber: usize, from: DVec2, w: DVec2) -> bool {
        discs.iter().enumerate().all(|(other, disc)| {
            let way = *disc - from;
            other == fiber
                || way.dot(w) < 0.0
                || way.dot(w.perp()).abs() >= self.radius * self.slopes.half_width(*disc, w.perp())
        })
    }

    /// The fibres, as circles, that light is expected to meet from a place in a direction, less those in the strip that it has swept if it was
    /// `turned` back by an angle; and the distance of its way from the ply's axis. `None` if the place is outside and there are none.
    fn ahead(&self, ply: &PlyShape, from: DVec2, w: DVec2, turned: Option<f64>) -> Option<(f64, f32)> {
        let root = self.stretch.sqrt();
        let (beside, reach) = (from.dot(w.perp()), self.reach(w.perp()));
        if beside.abs() >= reach * (1.0 + self.radius) {
            return None;
        }
        // The middle of the line's way through the section.
        let [from, to] = [from, w].map(|v| DVec2::new(v.x / root, v.y * root));
        let foot = (-from.dot(to) / to.length_squared() / root) as f32;
        let [offset, length, thin, wide] =
            [beside / reach, root * reach, root.recip(), reach.recip()].map(|v| v as f32);
        let chord = ply.chord(offset, length, thin, wide);
        let ahead = match turned {
            Some(turn) => ClearedStrip::new(2.0 * thin * self.radius as f32, turn.cos() as f32).fibers(&chord, foot),
            None => chord.ahead(-foot),
        };
        Some((root * f64::from(ahead), offset))
    }
}
