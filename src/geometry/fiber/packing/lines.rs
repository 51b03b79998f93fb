//! Lines through packings: how many fibres they meet, and how often none.

use std::f64::consts::{PI, TAU};

use glam::DVec2;

use crate::{
    geometry::{
        density::ChordFibers,
        fiber::slopes::Slopes,
        gaps::PlyGaps,
        ply::{PlyParameters, PlyShape},
        yarn::YarnShape,
    },
    math::sampler::Stream,
};

/// Lines in all directions through sections of discs of a radius whose long axis, x, is `stretch` times the short one; as seen in
/// the circle of radius 1 that their centres fill when the axes are made equal.
pub(super) struct Lines {
    pub(super) radius: f64,
    pub(super) stretch: f64,
    /// Of the fibres, at their places in the sections.
    pub(super) slopes: Slopes,
}

/// How the circle of [`Lines`] is passed by lines in a direction.
#[derive(Clone, Copy)]
pub(super) struct Scales {
    /// [`Lines::reach`].
    pub(super) reach: f64,
    /// How much of the circle a unit of a line passes, in radii of the section's long axis.
    pub(super) length: f32,
    /// How thick fibres are along a line and how wide across it, over their radius.
    pub(super) thin: f32,
    pub(super) wide: f32,
}

impl Scales {
    /// The fibres on one at a distance from the middle, in the circle.
    pub(super) fn chord(&self, ply: &PlyShape, offset: f32) -> ChordFibers {
        ply.chord(offset, self.length, self.thin, self.wide)
    }
}

/// Fibres that a line meets, or many do.
#[derive(Clone, Copy, Default)]
pub(super) struct Met {
    pub(super) fibers: f64,
    /// The sum of their widths across the line, over those that they had if they did not lean.
    widths: f64,
}

impl Met {
    fn add(&mut self, other: Self) {
        self.fibers += other.fibers;
        self.widths += other.widths;
    }

    /// The mean width.
    fn width(self) -> f64 {
        if self.fibers == 0.0 { 1.0 } else { self.widths / self.fibers }
    }

    /// As many fibres that do not lean, of which a line meets fewer by as much as they are thinner. By the rim these are more than would
    /// be met if the fibres stood upright where they are: fibres that lean reach farther out.
    fn across(self) -> f64 {
        self.fibers / self.width()
    }
}

/// Directions of lines. In an ellipse those of one quarter are like those of another; in a circle all are alike.
const ANGLES: usize = 64;
const QUARTER: usize = ANGLES / 4 + 1;

impl Lines {
    /// A ply of so many discs that is such a section.
    pub(super) fn ply(&self, discs: u32) -> PlyShape {
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

    fn across(angle: usize) -> DVec2 {
        DVec2::from_angle(TAU * angle as f64 / ANGLES as f64)
    }

    /// How far the section reaches beside lines across which a direction is, in radii of the circle.
    pub(super) fn reach(&self, across: DVec2) -> f64 {
        let root = self.stretch.sqrt();
        if self.stretch == 1.0 { 1.0 } else { DVec2::new(root * across.x, across.y / root).length() }
    }

    /// What a line of a kind meets at a distance from the middle, its fibres counted as they are, and how much of the circle a unit
    /// of it passes.
    pub(super) fn chord(&self, ply: &PlyShape, kind: usize, offset: f64) -> (ChordFibers, f32) {
        let scales = self.scales(Self::across(kind));
        (scales.chord(ply, offset as f32), scales.length)
    }

    /// How the circle is passed by lines across which a direction is.
    pub(super) fn scales(&self, across: DVec2) -> Scales {
        let (root, reach) = (self.stretch.sqrt(), self.reach(across));
        let [length, thin, wide] = [root * reach, root.recip(), reach.recip()].map(|v| v as f32);
        Scales { reach, length, thin, wide }
    }

    /// How far along a line from a place the middle of its way through the section is.
    pub(super) fn middle(&self, from: DVec2, along: DVec2) -> f64 {
        let root = self.stretch.sqrt();
        let [from, to] = [from, along].map(|v| DVec2::new(v.x / root, v.y * root));
        -from.dot(to) / to.length_squared()
    }

    /// How many of a chord's fibres a line meets, which are thinner along it than the circle's.
    pub(super) fn met(&self, chord: &ChordFibers) -> f64 {
        f64::from(chord.total()) * self.stretch.sqrt()
    }

    /// Looks at lines at some distances in all directions: tells the direction's kind, and what each line meets of a section.
    pub(super) fn look(&self, sections: &[Vec<DVec2>], offsets: &[f64], mut tell: impl FnMut(usize, &[Met])) {
        let mut met = vec![Met::default(); offsets.len()];
        for angle in 0..ANGLES {
            let (across, kind) = (Self::across(angle), self.kind(angle));
            let reach = self.reach(across);
            for discs in sections {
                met.fill(Met::default());
                for disc in discs {
                    let at = disc.dot(across);
                    let width = self.slopes.half_width(*disc, across);
                    for (offset, met) in offsets.iter().zip(&mut met) {
                        if (at - reach * offset).abs() < self.radius * width {
                            met.add(Met { fibers: 1.0, widths: width });
                        }
                    }
                }
                tell(kind, &met);
            }
        }
    }

    /// Gives a ply the crowding with which lines by its rim meet as many fibres as they do.
    pub(super) fn fit_wall(&self, sections: &[Vec<DVec2>], ply: &mut PlyShape) {
        // From the rim as far in as one fibre and a half reach, which is where light comes in and goes out.
        const LINES: usize = 30;
        const STEP: f64 = 0.1;
        const DEPTHS: usize = 11;
        const DEPTH_STEP: f64 = 0.05;
        const MOST: f64 = 0.6;
        let offsets: [f64; LINES] = std::array::from_fn(|line| 1.0 + self.radius * (1.0 - STEP * (line as f64 + 0.5)));
        let mut met = [[Met::default(); LINES]; QUARTER];
        self.look(sections, &offsets, |kind, counts| {
            met[kind].iter_mut().zip(counts).for_each(|(sum, met)| sum.add(*met));
        });
        let mut error = |crowding: f64, depth: f64| -> f64 {
            (ply.crowding, ply.depth) = (crowding as f32, depth as f32);
            self.squares(sections, LINES, |kind, line, looks| {
                let found = self.met(&self.chord(ply, kind, offsets[line]).0);
                (-found).exp() - (-met[kind][line].across() / looks).exp()
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
    pub(super) fn inside(&self, sections: &[Vec<DVec2>], core: DVec2) -> f64 {
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
    pub(super) fn rim(&self, sections: &[Vec<DVec2>], ply: &PlyShape) -> f64 {
        const LINES: usize = 24;
        let offsets: [f64; LINES] =
            std::array::from_fn(|line| (1.0 + self.radius) * (line as f64 + 0.5) / LINES as f64);
        // How often a line is clear, and what it meets.
        let mut clear = [[0u32; LINES]; QUARTER];
        let mut met = [[Met::default(); LINES]; QUARTER];
        self.look(sections, &offsets, |kind, counts| {
            for ((clear, sum), met) in clear[kind].iter_mut().zip(&mut met[kind]).zip(counts) {
                *clear += u32::from(met.fibers == 0.0);
                sum.add(*met);
            }
        });
        let error = |rim: f64| -> f64 {
            let ply = &PlyShape { rim: rim as f32, ..ply.clone() };
            self.squares(sections, LINES, |kind, line, looks| {
                let (chord, length) = self.chord(ply, kind, offsets[line]);
                let gaps = PlyGaps::new(ply.dead_zone(&chord, offsets[line] as f32, length));
                let passes = gaps.unscattered((self.met(&chord) * met[kind][line].width()) as f32);
                f64::from(passes).sqrt() - (f64::from(clear[kind][line]) / looks).sqrt()
            })
        };
        // The error has one least value; steps of a hundredth are finer than it is known.
        let tries = (0..=300).map(|i| 0.01 * f64::from(i));
        tries.map(|s| (s, error(s))).min_by(|a, b| a.1.total_cmp(&b.1)).map_or(1.0, |best| best.0)
    }
}
