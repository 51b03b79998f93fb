//! Discs at random in a circle that do not overlap.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use glam::{DMat2, DVec2};

use super::{
    slopes::{Slopes, Twist},
    yielding::{Ellipse, Yielding},
};

use crate::{
    geometry::{
        density::{AfterFiber, ChordFibers, ClearedStrip, MissingFibers, PlyPacking, TURNS},
        occluder::PlyGaps,
        yarn::{PlyParameters, PlyShape, YarnShape},
    },
    math::sampler::Stream,
};

/// Area fraction (of fibres in the ply) up to which [`hard_discs`] finds packings without overlap for any number.
pub const DENSEST: f64 = 0.78;

/// Centres of `count` discs of radius `radius` in a ply, in units of the core radius, within which the centres lie: even
/// over the core as far as discs that do not overlap can be. Where they do not fit they overlap as little as possible.
///
/// Discs are put down at random one after the other where there is room (random sequential addition). Where one finds none,
/// above an area fraction of about 0.4, all are put down anywhere instead and pushed apart. Neither crowds discs at the
/// outline, as a random walk to the equilibrium of hard discs would.
///
/// Discs of fibres that lean against the section are the ellipses in which it cuts them.
pub fn hard_discs(count: u32, radius: f64, twist: Twist, stream: &mut Stream) -> Vec<DVec2> {
    let share = radius / (1.0 + radius);
    leaning_discs(count, radius, &twist.scaled(twist.room(count, share)).in_core(share), stream)
}

/// [`hard_discs`] of fibres with known slopes at places in core radii.
pub(super) fn leaning_discs(count: u32, radius: f64, slopes: &Slopes, stream: &mut Stream) -> Vec<DVec2> {
    put_down(count, 2.0 * radius, slopes, stream).unwrap_or_else(|| {
        let mut centres: Vec<DVec2> = (0..count).map(|_| anywhere(stream)).collect();
        push_apart(&mut centres, 2.0 * radius, slopes);
        centres
    })
}

/// How the packings that [`hard_discs`] makes of fibres with a twist lie, from some of them; `radius` is in core radii. Where `stretch`, the long over
/// the short axis of their ply's section, is above 1, discs have given way to each other as [`Yielding`] has it.
///
/// The crowding and its depth are those with which lines by the rim meet as many discs as they do, by least squares of what would
/// pass if these lay at random. The regularity is that with which the gaps of [`PlyGaps`] pass as much as pieces of lines away from the
/// rim do; that by the rim with which they pass as much as lines in all directions through the packings, by least squares of the roots
/// over the ply's width. What is free after a fibre is that with which as much light leaves that met one as on lines from the place
/// where it did.
///
/// Of more than `MOST_MEASURED` discs some are packed as densely in their stead: the crowding is at the wall only, so it
/// falls with a disc's radius.
pub fn measured(count: u32, radius: f64, twist: Twist, stretch: f64) -> PlyPacking {
    let packed = count.min(MOST_MEASURED);
    let fewer = (f64::from(packed) / f64::from(count.max(1))).sqrt();
    // The same area fraction of the ply, whose radius is 1 + radius.
    let share = radius / (1.0 + radius) / fewer;
    if packed == 0 || share >= 1.0 {
        return PlyPacking { crowding: 0.0, depth: 0.0, regularity: 1.0, rim: 1.0, after: None };
    }
    let radius = share / (1.0 - share);
    let slopes = twist.scaled(twist.room(packed, share)).in_core(share);
    let packings: Vec<Vec<DVec2>> = (0..MEASURED.div_ceil(packed).clamp(LEAST_PACKINGS, MOST_PACKINGS))
        .map(|seed| leaning_discs(packed, radius, &slopes, &mut Stream::new(seed)))
        .collect();
    let pressed = Ellipse::of(DMat2::from_diagonal(DVec2::new(stretch, 1.0)));
    let sections: Vec<Vec<DVec2>> = match &pressed {
        None => packings,
        Some(ellipse) => packings.iter().flat_map(|discs| squeezed(discs, share, &slopes, ellipse)).collect(),
    };
    let lines = match &pressed {
        None => Lines { radius, stretch: 1.0, slopes },
        Some(ellipse) => Lines { radius, stretch, slopes: ellipse.slopes_in(&slopes) },
    };
    let mut ply = lines.ply(packed);
    lines.fit_wall(&sections, &mut ply);
    let core = pressed.as_ref().map_or(DVec2::ONE, |ellipse| ellipse.core(share) / (1.0 - share));
    let regularity = lines.inside(&sections, core);
    ply.regularity = regularity as f32;
    let rim = lines.rim(&sections, &mut ply);
    let after = Some(lines.after(&sections, &ply));
    PlyPacking { crowding: f64::from(ply.crowding) * fewer, depth: f64::from(ply.depth), regularity, rim, after }
}

/// A packing in an ellipse, at some turns; in core radii, as the packing. `share` is a disc's radius over the ply's.
fn squeezed<'a>(
    discs: &'a [DVec2],
    share: f64,
    slopes: &Slopes,
    ellipse: &'a Ellipse,
) -> impl Iterator<Item = Vec<DVec2>> + 'a {
    let yielding = Yielding::new(discs, share, slopes, ellipse);
    let slopes = ellipse.slopes_in(slopes).per_ply_radius(share);
    (0..SQUEEZED).map(move |turn| {
        let mut out = Vec::with_capacity(discs.len());
        yielding.squeeze(DVec2::from_angle(PI * f64::from(turn) / f64::from(SQUEEZED)), ellipse, &slopes, &mut out);
        out.iter_mut().for_each(|at| *at /= 1.0 - share);
        out
    })
}

/// The most discs of a packing that is measured, about how many discs are looked at, and in how many packings.
const MOST_MEASURED: u32 = 100;
const MEASURED: u32 = 1500;
const LEAST_PACKINGS: u32 = 15;
const MOST_PACKINGS: u32 = 100;
/// At how many turns a packing is squeezed.
const SQUEEZED: u32 = 4;

/// Lines in all directions through sections of discs of a radius whose long axis, x, is `stretch` times the short one; as seen in
/// the circle of radius 1 that their centres fill when the axes are made equal.
struct Lines {
    radius: f64,
    stretch: f64,
    /// Of the fibres, at their places in the sections.
    slopes: Slopes,
}

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

/// Directions of lines. In an ellipse those of one quarter are like those of another; in a circle all are alike.
const ANGLES: usize = 64;
const QUARTER: usize = ANGLES / 4 + 1;

impl Lines {
    /// A ply of so many discs that is such a section.
    fn ply(&self, discs: u32) -> PlyShape {
        let parameters = PlyParameters {
            radius: 1.0 + self.radius,
            aspect: 1.0,
            distance: 0.0,
            angle: 0.0,
            fibers: discs,
            fiber_radius: self.radius,
            fiber_twist: 0.0,
        };
        YarnShape::new(&[parameters], 0.0, true).plies.remove(0)
    }

    /// Which directions are alike.
    fn kind(&self, angle: usize) -> usize {
        match angle % (ANGLES / 2) {
            _ if self.stretch == 1.0 => 0,
            half => half.min(ANGLES / 2 - half),
        }
    }

    /// Sum over so many lines in all directions of squares of what is `off` of a direction's kind and a line, which was looked at so often.
    fn squares(&self, sections: &[Vec<DVec2>], lines: usize, off: impl Fn(usize, usize, f64) -> f64) -> f64 {
        let mut angles = [0.0; QUARTER];
        (0..ANGLES).for_each(|angle| angles[self.kind(angle)] += 1.0);
        let of_kind = |kind: usize| {
            let looks = sections.len() as f64 * angles[kind];
            angles[kind] * (0..lines).map(|line| off(kind, line, looks).powi(2)).sum::<f64>()
        };
        (0..QUARTER).filter(|&kind| angles[kind] > 0.0).map(of_kind).sum()
    }

    /// What light meets after a fibre: so much less of fibres at random would keep as much of it in.
    fn after(&self, sections: &[Vec<DVec2>], ply: &PlyShape) -> AfterFiber {
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

    fn across(angle: usize) -> DVec2 {
        DVec2::from_angle(TAU * angle as f64 / ANGLES as f64)
    }

    /// How far the section reaches beside lines across which a direction is, in radii of the circle.
    fn reach(&self, across: DVec2) -> f64 {
        let root = self.stretch.sqrt();
        if self.stretch == 1.0 { 1.0 } else { DVec2::new(root * across.x, across.y / root).length() }
    }

    /// What a line of a kind meets at a distance from the middle, its fibres counted as they are, and how much of the circle a unit
    /// of it passes.
    fn chord(&self, ply: &PlyShape, kind: usize, offset: f64) -> (ChordFibers, f32) {
        let (root, reach) = (self.stretch.sqrt(), self.reach(Self::across(kind)));
        let length = (root * reach) as f32;
        (ply.chord(offset as f32, length, root.recip() as f32, reach.recip() as f32), length)
    }

    /// How many of a chord's fibres a line meets, which are thinner along it than the circle's.
    fn met(&self, chord: &ChordFibers) -> f64 {
        f64::from(chord.total()) * self.stretch.sqrt()
    }

    /// Looks at lines at some distances in all directions: tells the direction's kind, and for each line how many discs of a section
    /// it meets, as circles and as the ellipses of fibres that lean.
    fn look(&self, sections: &[Vec<DVec2>], offsets: &[f64], mut tell: impl FnMut(usize, &[[u32; 2]])) {
        let mut met = vec![[0; 2]; offsets.len()];
        for angle in 0..ANGLES {
            let (across, kind) = (Self::across(angle), self.kind(angle));
            let reach = self.reach(across);
            for discs in sections {
                met.fill([0; 2]);
                for disc in discs {
                    let at = disc.dot(across);
                    let half_width = self.radius * self.slopes.half_width(*disc, across);
                    for (offset, [circles, ellipses]) in offsets.iter().zip(&mut met) {
                        let off = (at - reach * offset).abs();
                        *circles += u32::from(off < self.radius);
                        *ellipses += u32::from(off < half_width);
                    }
                }
                tell(kind, &met);
            }
        }
    }

    /// Gives a ply the crowding with which lines by its rim meet as many fibres as they do.
    fn fit_wall(&self, sections: &[Vec<DVec2>], ply: &mut PlyShape) {
        // From the rim as far in as one fibre and a half reach, which is where light comes in and goes out.
        const LINES: usize = 30;
        const STEP: f64 = 0.1;
        const DEPTHS: usize = 11;
        const DEPTH_STEP: f64 = 0.05;
        const MOST: f64 = 0.6;
        let offsets: [f64; LINES] = std::array::from_fn(|line| 1.0 + self.radius * (1.0 - STEP * (line as f64 + 0.5)));
        let mut met = [[0u64; LINES]; QUARTER];
        self.look(sections, &offsets, |kind, counts| {
            met[kind].iter_mut().zip(counts).for_each(|(sum, [circles, _])| *sum += u64::from(*circles));
        });
        let mut error = |crowding: f64, depth: f64| -> f64 {
            (ply.crowding, ply.depth) = (crowding as f32, depth as f32);
            self.squares(sections, LINES, |kind, line, looks| {
                let found = self.met(&self.chord(ply, kind, offsets[line]).0);
                (-found).exp() - (-(met[kind][line] as f64) / looks).exp()
            })
        };
        let mut best = (f64::INFINITY, 0.0, 0.0);
        for depth in (0..DEPTHS).map(|k| DEPTH_STEP * k as f64) {
            // For a depth the error has one least value.
            let (mut low, mut high) = (0.0, MOST);
            for _ in 0..24 {
                let third = (high - low) / 3.0;
                if error(low + third, depth) < error(high - third, depth) {
                    high -= third;
                } else {
                    low += third;
                }
            }
            let crowding = 0.5 * (low + high);
            let found = error(crowding, depth);
            if found < best.0 {
                best = (found, crowding, depth);
            }
        }
        (ply.crowding, ply.depth) = (best.1 as f32, best.2 as f32);
    }

    /// The regularity with which gaps between fibres pass as much as pieces of lines away from the rim do, or 1 where there is no room
    /// for these. `core` has the semi-axes of what centres fill.
    fn inside(&self, sections: &[Vec<DVec2>], core: DVec2) -> f64 {
        // Pieces that meet about so many fibres: longer ones pass next to nothing.
        const MET: [f64; 2] = [1.1, 2.2];
        const PIECES: usize = 20_000;
        // How far from the middle they reach, in core radii, and the longest of them.
        const REACH: f64 = 0.75;
        const LONGEST: f64 = 1.2;
        let share = self.radius / (1.0 + self.radius);
        let fraction = sections[0].len() as f64 * share * share;
        let mut stream = Stream::new(0x51de);
        let mut next = || f64::from(stream.next());
        let (mut sum, mut weight) = (0.0, 0.0);
        for wanted in MET {
            let length = wanted * 0.5 * PI * self.radius / fraction;
            if length > LONGEST {
                continue;
            }
            let (mut met, mut clear) = (0u64, 0u64);
            for k in 0..PIECES {
                let at = next().sqrt() * (REACH - 0.5 * length).max(0.1) * DVec2::from_angle(TAU * next()) * core;
                let along = DVec2::from_angle(TAU * next());
                let is_met = |disc: &&DVec2| {
                    let way = **disc - at;
                    let half_width = self.radius * self.slopes.half_width(**disc, along.perp());
                    way.dot(along).abs() < 0.5 * length && way.perp_dot(along).abs() < half_width
                };
                let count = sections[k % sections.len()].iter().filter(is_met).count() as u64;
                met += count;
                clear += u64::from(count == 0);
            }
            let (met, clear) = (met as f64 / PIECES as f64, clear as f64 / PIECES as f64);
            // What passes falls with the dead zone.
            let (mut low, mut high) = (0.0, 0.95);
            for _ in 0..24 {
                let zone = 0.5 * (low + high);
                let passes = f64::from(PlyGaps::new(zone as f32).unscattered(met as f32));
                (low, high) = if passes > clear { (zone, high) } else { (low, zone) };
            }
            sum += 0.5 * (low + high) / fraction;
            weight += 1.0;
        }
        if weight > 0.0 { sum / weight } else { 1.0 }
    }

    /// The regularity by the rim with which gaps between the fibres of a ply pass as much as lines through sections do.
    fn rim(&self, sections: &[Vec<DVec2>], ply: &mut PlyShape) -> f64 {
        const LINES: usize = 24;
        let offsets: [f64; LINES] =
            std::array::from_fn(|line| (1.0 + self.radius) * (line as f64 + 0.5) / LINES as f64);
        // How often a line is clear, and how many discs it meets, as circles and as ellipses.
        let mut clear = [[0u32; LINES]; QUARTER];
        let mut met = [[[0u64; 2]; LINES]; QUARTER];
        self.look(sections, &offsets, |kind, counts| {
            for ((clear, met), [circles, ellipses]) in clear[kind].iter_mut().zip(&mut met[kind]).zip(counts) {
                *clear += u32::from(*ellipses == 0);
                met[0] += u64::from(*circles);
                met[1] += u64::from(*ellipses);
            }
        });
        let wider = |[circles, ellipses]: [u64; 2]| if circles == 0 { 1.0 } else { ellipses as f64 / circles as f64 };
        let mut error = |rim: f64| -> f64 {
            ply.rim = rim as f32;
            self.squares(sections, LINES, |kind, line, looks| {
                let (chord, length) = self.chord(ply, kind, offsets[line]);
                let gaps = PlyGaps::new(ply.dead_zone(&chord, offsets[line] as f32, length));
                let passes = gaps.unscattered((self.met(&chord) * wider(met[kind][line])) as f32);
                f64::from(passes).sqrt() - (f64::from(clear[kind][line]) / looks).sqrt()
            })
        };
        // The error has one least value; steps of a hundredth are finer than it is known.
        let tries = (0..=300).map(|i| 0.01 * f64::from(i));
        tries.map(|s| (s, error(s))).min_by(|a, b| a.1.total_cmp(&b.1)).map_or(1.0, |best| best.0)
    }
}

/// A point of the unit disc.
fn anywhere(stream: &mut Stream) -> DVec2 {
    f64::from(stream.next()).sqrt() * DVec2::from_angle(TAU * f64::from(stream.next()))
}

/// Random sequential addition; `None` if a disc finds no room.
fn put_down(count: u32, diameter: f64, slopes: &Slopes, stream: &mut Stream) -> Option<Vec<DVec2>> {
    let mut centres: Vec<DVec2> = Vec::with_capacity(count as usize);
    let mut grid = DiscGrid::new(count as usize, diameter * slopes.longest(1.0));
    for disc in 0..count {
        let apart = |at: DVec2, other: DVec2| slopes.distance_squared(at, other) >= diameter * diameter;
        let free = |at: &DVec2| grid.near(*at).all(|j| apart(*at, centres[j]));
        let at = (0..TRIES).map(|_| anywhere(stream)).find(free)?;
        grid.add(disc, at);
        centres.push(at);
    }
    Some(centres)
}

/// How often a disc is put down before it counts as finding no room.
const TRIES: u32 = 2000;

/// A grid of cells as wide as a disc, over the unit disc.
pub(super) struct DiscGrid {
    cells: Vec<Vec<u32>>,
    side: i32,
    inverse: f64,
}

impl DiscGrid {
    pub(super) fn new(discs: usize, diameter: f64) -> Self {
        // No finer than a few discs to a cell, however thin they are.
        let width = diameter.max(2.0 / (discs as f64).sqrt().max(1.0));
        let side = (2.0 / width).ceil() as i32 + 2;
        Self { cells: vec![Vec::new(); (side * side) as usize], side, inverse: 1.0 / width }
    }

    pub(super) fn add(&mut self, disc: u32, at: DVec2) {
        let cell = self.cell(at);
        self.cells[cell].push(disc);
    }

    fn place(&self, at: DVec2) -> (i32, i32) {
        let k = |v: f64| (((v + 1.0) * self.inverse) as i32).clamp(0, self.side - 1);
        (k(at.x), k(at.y))
    }

    fn cell(&self, at: DVec2) -> usize {
        let (x, y) = self.place(at);
        (y * self.side + x) as usize
    }

    pub(super) fn near(&self, at: DVec2) -> impl Iterator<Item = usize> + '_ {
        let (x, y) = self.place(at);
        let range = |v: i32| (v - 1).max(0)..=(v + 1).min(self.side - 1);
        range(y)
            .flat_map(move |y| range(x).map(move |x| (y * self.side + x) as usize))
            .flat_map(|cell| self.cells[cell].iter().map(|&i| i as usize))
    }
}

/// Moves overlapping discs apart, each pair by half of what it overlaps, until none does or nothing more is gained.
fn push_apart(centres: &mut [DVec2], diameter: f64, slopes: &Slopes) {
    // A little farther than needed, or the last of them would take for ever.
    let wanted = diameter * 1.005;
    let reach = wanted * slopes.longest(1.0);
    for round in 0..3000 {
        let mut grid = DiscGrid::new(centres.len(), reach);
        for (i, &c) in centres.iter().enumerate() {
            grid.add(i as u32, c);
        }
        let mut worst = 0.0f64;
        let mut moves = vec![DVec2::ZERO; centres.len()];
        for (i, &c) in centres.iter().enumerate() {
            for j in grid.near(c) {
                if j == i {
                    continue;
                }
                let between = c - centres[j];
                let distance = slopes.distance_squared(c, centres[j]).sqrt();
                if distance < wanted {
                    let direction = if distance > 1e-12 { between / distance } else { DVec2::from_angle(i as f64) };
                    moves[i] += 0.5 * (wanted - distance) * direction;
                    worst = worst.max(1.0 - distance / diameter);
                }
            }
        }
        if worst <= 0.0 && round > 0 {
            break;
        }
        for (c, m) in centres.iter_mut().zip(moves) {
            *c = (*c + m).clamp_length_max(1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn discs_do_not_overlap_and_fill_the_core_evenly() {
        for (count, density) in [(2u32, 0.3f64), (33, 0.25), (70, 0.5), (150, 0.7), (1000, 0.6)] {
            let fiber = (density / f64::from(count)).sqrt();
            let radius = fiber / (1.0 - fiber);
            let (mut inner, mut total) = (0.0, 0.0);
            for seed in 0..(3000 / count).clamp(3, 40) {
                let discs = hard_discs(count, radius, Twist::NONE, &mut Stream::new(seed));
                assert_eq!(discs.len(), count as usize);
                for (i, a) in discs.iter().enumerate() {
                    assert!(a.length() <= 1.0 + 1e-12);
                    for b in &discs[..i] {
                        let gap = a.distance(*b) / (2.0 * radius);
                        assert!(gap > 0.999_99, "{count} discs at {density}: {gap}");
                    }
                }
                inner += discs.iter().filter(|d| d.length_squared() < 0.5).count() as f64;
                total += f64::from(count);
            }
            // Half of the core's area holds about half of the centres; discs line up at the wall when dense.
            let share = inner / total;
            assert!(count < 10 || (0.44..0.56).contains(&share), "{count} discs at {density}: {share}");
        }
    }

    #[test]
    fn too_many_discs_overlap_and_do_not_hang() {
        for (count, radius) in [(50, 0.5), (3, 10.0), (0, 0.1), (1, 2.0), (400, 1e-9)] {
            let discs = hard_discs(count, radius, Twist::NONE, &mut Stream::new(7));
            assert_eq!(discs.len(), count as usize);
            assert!(discs.iter().all(|d| d.is_finite() && d.length() <= 1.0 + 1e-12));
        }
    }

    #[test]
    fn crowding_is_that_of_many_packings_and_falls_with_the_discs() {
        let of = |count: u32, density: f64| {
            let fiber = (density / f64::from(count)).sqrt();
            (count, fiber / (1.0 - fiber))
        };
        for (count, radius) in [of(33, 0.25), of(70, 0.5)] {
            let many: Vec<f64> = (1000..1060)
                .flat_map(|seed| hard_discs(count, radius, Twist::NONE, &mut Stream::new(seed)))
                .map(|at| at.length_squared())
                .collect();
            let want = 2.0 * many.iter().sum::<f64>() / many.len() as f64 - 1.0;
            let got = measured(count, radius, Twist::NONE, 1.0).crowding;
            assert!((got - want).abs() < 0.03, "{count}: {got}, not {want}");
        }
        let (few, radius) = of(100, 0.5);
        let (many, smaller) = of(10_000, 0.5);
        let crowding = |count, radius| measured(count, radius, Twist::NONE, 1.0).crowding;
        assert!(crowding(many, smaller).abs() < 0.5 * crowding(few, radius).abs() + 0.01);
        assert_eq!(crowding(0, 0.1), 0.0);
        assert!(crowding(1, 1.0).is_finite() && crowding(u32::MAX, 1e-9).is_finite());
    }

    #[test]
    fn lines_pass_loose_packings_more_regularly_than_dense_ones_that_are_pushed_apart() {
        let of = |count: u32, density: f64| {
            let fiber = (density / f64::from(count)).sqrt();
            measured(count, fiber / (1.0 - fiber), Twist::NONE, 1.0).regularity
        };
        let (loose, dense) = (of(100, 0.2), of(100, 0.6));
        assert!((1.2..1.7).contains(&loose) && (0.4..1.1).contains(&dense), "{loose} {dense}");
        // Thin fibres are packed as fewer thick ones of the same share.
        assert!((of(10_000, 0.4) - of(1_000, 0.4)).abs() < 1e-9);
    }

    #[test]
    fn lines_by_the_rim_meet_as_many_fibers_as_in_packings_and_pass_as_much() {
        // Others than those that are measured, down to one fibre and a half below the rim.
        for (count, density) in [(78u32, 0.2f64), (78, 0.4), (78, 0.6), (60, 0.35), (25, 0.5), (200, 0.55)] {
            let fiber = (density / f64::from(count)).sqrt();
            let radius = fiber / (1.0 - fiber);
            let lines = Lines { radius, stretch: 1.0, slopes: Slopes::NONE };
            let packing = measured(count, radius, Twist::NONE, 1.0);
            let mut ply = lines.ply(count);
            (ply.crowding, ply.depth) = (packing.crowding as f32, packing.depth as f32);
            (ply.regularity, ply.rim) = (packing.regularity as f32, packing.rim as f32);
            let packings: Vec<_> =
                (500..560).map(|seed| hard_discs(count, radius, Twist::NONE, &mut Stream::new(seed))).collect();
            let offsets: Vec<f64> = (0..15).map(|k| 1.0 + radius * (0.9 - 0.2 * f64::from(k))).collect();
            let (mut met, mut clear, mut looks) = (vec![0.0; 15], vec![0.0; 15], 0.0);
            lines.look(&packings, &offsets, |_, counts| {
                looks += 1.0;
                for (k, [count, _]) in counts.iter().enumerate() {
                    met[k] += f64::from(*count);
                    clear[k] += f64::from(u8::from(*count == 0));
                }
            });
            let (mut off, mut passed, mut found, mut want) = (0.0, 0.0, 0.0, 0.0);
            for (k, offset) in offsets.iter().enumerate() {
                let (chord, length) = lines.chord(&ply, 0, *offset);
                let (model, counted) = ((-lines.met(&chord)).exp(), (-met[k] / looks).exp());
                off += (model - counted).abs();
                passed += counted;
                let gaps = PlyGaps::new(ply.dead_zone(&chord, *offset as f32, length));
                found += f64::from(gaps.unscattered(lines.met(&chord) as f32));
                want += clear[k] / looks;
            }
            // By one number, the second moment, .05 to .25 off.
            assert!(off < 0.08 * passed, "{count} at {density}: {off} of {passed}");
            assert!((found / want - 1.0).abs() < 0.16, "{count} at {density}: {found} {want}");
        }
    }

    #[test]
    fn as_much_light_leaves_after_a_fiber_as_in_other_packings() {
        for (count, density, stretch) in [(60u32, 0.3f64, 1.0), (60, 0.45, 1.0), (60, 0.6, 1.0), (100, 0.4, 1.5)] {
            let share = (density / f64::from(count)).sqrt();
            let radius = share / (1.0 - share);
            let packing = measured(count, radius, Twist::NONE, stretch);
            let lines = Lines { radius, stretch, slopes: Slopes::NONE };
            let mut ply = lines.ply(count);
            (ply.crowding, ply.depth) = (packing.crowding as f32, packing.depth as f32);
            ply.regularity = packing.regularity as f32;
            let packings: Vec<_> =
                (500..620).map(|seed| hard_discs(count, radius, Twist::NONE, &mut Stream::new(seed))).collect();
            let sections = match Ellipse::of(DMat2::from_diagonal(DVec2::new(stretch, 1.0))) {
                None => packings,
                Some(ellipse) => packings.iter().flat_map(|p| squeezed(p, share, &Slopes::NONE, &ellipse)).collect(),
            };
            let after = packing.after.unwrap();
            let other = lines.after(&sections, &ply);
            let rate = (1.0 - ply.mean_dead_zone()).recip() as f32;
            let rows = |of: &AfterFiber| {
                [of.first, of.later, of.back, of.back_later].map(|missing| [missing.inside, missing.rim]).concat()
            };
            for (rows, others) in rows(&after).iter().zip(&rows(&other)) {
                for (knot, (row, other)) in rows.iter().zip(others).enumerate() {
                    let out = |missing: f32| (rate * (missing - AfterFiber::STEP * knot as f32)).exp();
                    let off = row.iter().zip(other).map(|(a, b)| (out(*a) - out(*b)).abs()).fold(0.0, f32::max);
                    // The few ways by the rim of a few packings.
                    assert!(off < 0.13, "{count} at {density}, knot {knot}: {row:?}, not {other:?}");
                }
            }
            // Along the axes of a pressed section it is not the same.
            let round = after.first.inside.iter().skip(1).all(|row| row[0] == row[1]);
            assert_eq!(stretch == 1.0, round, "{after:?}");
        }
    }

    #[test]
    fn packings_that_give_way_are_measured_as_they_lie_then() {
        let of = |density: f64, stretch: f64| {
            let fiber = (density / 70.0).sqrt();
            measured(70, fiber / (1.0 - fiber), Twist::NONE, stretch)
        };
        for density in [0.25, 0.5] {
            let (round, nearly, flat) = (of(density, 1.0), of(density, 1.01), of(density, 2.0));
            assert!((round.crowding - nearly.crowding).abs() < 0.01, "{round:?} {nearly:?}");
            assert!((round.regularity - nearly.regularity).abs() < 0.15, "{round:?} {nearly:?}");
            assert!((round.crowding - flat.crowding).abs() < 0.04, "{round:?} {flat:?}");
        }
        // Dense ones that were only pushed apart are in better order when they have given way to each other.
        assert!(of(0.5, 1.5).regularity > of(0.5, 1.0).regularity);
        assert!(
            measured(1, 1.0, Twist::NONE, 4.0).crowding.is_finite()
                && measured(3, 0.9, Twist::NONE, 100.0).regularity.is_finite()
        );
    }

    #[test]
    fn a_seed_gives_one_packing() {
        let make = |seed| hard_discs(40, 0.08, Twist::NONE, &mut Stream::new(seed));
        assert_eq!(make(5), make(5));
        assert_ne!(make(5), make(6));
    }
}
