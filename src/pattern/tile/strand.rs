//! One yarn of a tile as a smooth line without ends: its length, places along it, and the spline through these.

use glam::{DVec2, DVec3, Vec3};

use super::{Section, TileStrand};
use crate::geometry::{chain::spline_through, curve::Basis, spline::evaluate};

/// No section is flatter than this, as the ratio of its axes.
const FLATTEST: f32 = 0.2;
/// Steps between two points at which lengths are known.
const STEPS: usize = 4;

impl TileStrand {
    /// Half of the section's longer axis at each point, and what presses it flat there, if anything does.
    pub(super) fn radii_and_flattening(&self) -> (Vec<f64>, Option<Vec<Vec3>>) {
        if self.sections.is_empty() {
            return (vec![self.radius; self.points.len()], None);
        }
        let (widths, axes) = self.sections.iter().map(|s| (f64::from(s.half_width), s.short_axis)).unzip();
        (widths, Some(axes))
    }

    /// From its start to its own continuation.
    pub fn jump(&self, period: DVec2) -> DVec3 {
        (DVec2::new(f64::from(self.step[0]), f64::from(self.step[1])) * period).extend(0.0)
    }

    /// Point i, where those before the first and after the last are of the repeats around.
    pub(super) fn around(&self, i: isize, period: DVec2) -> DVec3 {
        let n = self.points.len() as isize;
        self.points[i.rem_euclid(n) as usize] + self.jump(period) * i.div_euclid(n) as f64
    }

    /// The place between point i and the next.
    pub(super) fn at(&self, i: isize, u: f64, period: DVec2) -> DVec3 {
        let p = [-1, 0, 1, 2].map(|k| self.around(i + k, period).extend(0.0));
        evaluate(Basis::CatmullRom, p, u).at.truncate()
    }

    /// Its length from its start to its own continuation.
    pub fn length(&self, period: DVec2) -> f64 {
        self.lengths(period).last().copied().unwrap_or(0.0)
    }

    /// Where it is at steps between points, [`STEPS`] each, to its own continuation.
    fn steps(&self, period: DVec2) -> Vec<DVec3> {
        let of_point = |i: isize| (1..=STEPS).map(move |k| self.at(i, k as f64 / STEPS as f64, period));
        std::iter::once(self.at(0, 0.0, period)).chain((0..self.points.len() as isize).flat_map(of_point)).collect()
    }

    /// Length from the start to each of its steps.
    fn lengths(&self, period: DVec2) -> Vec<f64> {
        summed(self.steps(period).windows(2).map(|w| w[1].distance(w[0])))
    }

    /// Places of `count` points evenly along the yarn, in points from the first, the first among them.
    pub fn evenly(&self, count: usize, period: DVec2) -> Vec<f64> {
        Self::shared_out(&self.lengths(period), count)
    }

    /// As [`Self::evenly`], but closer to each other where the yarn bends: a spline through them keeps closer to it.
    pub fn closer_in_bends(&self, count: usize, period: DVec2) -> Vec<f64> {
        let ways: Vec<DVec3> = self.steps(period).windows(2).map(|w| w[1] - w[0]).collect();
        let weight = |k: usize| {
            let (before, after) = (ways[(k + ways.len() - 1) % ways.len()], ways[(k + 1) % ways.len()]);
            let length = ways[k].length();
            let bend = before.angle_between(after) / (2.0 * length).max(1e-300);
            length * (1.0 + 4.0 * self.radius * bend).sqrt()
        };
        Self::shared_out(&summed((0..ways.len()).map(weight)), count)
    }

    /// Places between which a sum over steps grows by as much, the first at its start.
    fn shared_out(lengths: &[f64], count: usize) -> Vec<f64> {
        let total = lengths[lengths.len() - 1];
        (0..count)
            .map(|k| {
                let wanted = total * k as f64 / count as f64;
                let i = lengths.partition_point(|&l| l <= wanted).clamp(1, lengths.len() - 1) - 1;
                let span = (lengths[i + 1] - lengths[i]).max(1e-300);
                (i as f64 + ((wanted - lengths[i]) / span).clamp(0.0, 1.0)) / STEPS as f64
            })
            .collect()
    }

    /// Control points of the uniform cubic B-spline that passes through its places, given in points from the first. As
    /// the points, they repeat one step on.
    pub fn spline(&self, places: &[f64], period: DVec2) -> Vec<DVec3> {
        let at = |place: &f64| self.at(place.floor() as isize, place.fract(), period);
        periodic_spline(&places.iter().map(at).collect::<Vec<_>>(), self.jump(period))
    }

    /// Sections at places, given in points from the first, as control points of the same spline have them; empty if it is
    /// round. Of those between two places the narrowest counts, so that nothing that presses is passed by.
    pub fn sections_at(&self, places: &[f64]) -> Vec<Section> {
        if self.sections.is_empty() {
            return Vec::new();
        }
        let n = self.sections.len();
        let of = |i: isize| self.sections[i.rem_euclid(n as isize) as usize];
        let at = |place: f64| {
            let (i, u) = (place.floor() as isize, place.fract() as f32);
            let (a, b) = (of(i), of(i + 1));
            // An axis has no sign.
            let next = if a.short_axis.dot(b.short_axis) < 0.0 { -b.short_axis } else { b.short_axis };
            Section {
                half_width: a.half_width + u * (b.half_width - a.half_width),
                short_axis: a.short_axis.lerp(next, u),
            }
        };
        let around = |k: usize| {
            let place = |k: isize| {
                let (turns, k) = (k.div_euclid(places.len() as isize), k.rem_euclid(places.len() as isize));
                places[k as usize] + (turns * n as isize) as f64
            };
            let [before, own, after] = [-1, 0, 1].map(|by| place(k as isize + by));
            let between = own.midpoint(before).floor() as isize..=own.midpoint(after).ceil() as isize;
            let narrow = |s: &Section| s.half_width * s.short_axis.length();
            between.map(of).fold(at(own), |a, b| if narrow(&b) < narrow(&a) { b } else { a })
        };
        let mut sections: Vec<Section> = (0..places.len()).map(around).collect();
        // Widths and ratios follow the spline, directions are those of its knots.
        let sizes = sections.iter().map(|s| DVec3::new(s.half_width.into(), s.short_axis.length().into(), 0.0));
        let sizes: Vec<DVec3> = sizes.collect();
        for (section, size) in sections.iter_mut().zip(periodic_spline(&sizes, DVec3::ZERO)) {
            section.half_width = size.x as f32;
            section.short_axis = section.short_axis.normalize_or(Vec3::Z) * (size.y as f32).clamp(FLATTEST, 1.0);
        }
        sections
    }

    /// How often it rises to a head: as many loops as a row of a knit has in a period.
    pub(super) fn heads(&self) -> u32 {
        let (low, high) = self.points.iter().fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p.y), h.max(p.y)));
        let middle = 0.5 * (low + high);
        let n = self.points.len();
        let rises = (0..n).filter(|&i| self.points[i].y < middle && self.points[(i + 1) % n].y >= middle).count();
        rises.max(1) as u32
    }
}

/// Sums of the first none, one, two and so on.
fn summed(parts: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sum = 0.0;
    let sums = parts.map(|part| {
        sum += part;
        sum
    });
    std::iter::once(0.0).chain(sums).collect()
}

/// Control points of the uniform cubic B-spline through knots that go on `jump` further with the first of them.
fn periodic_spline(knots: &[DVec3], jump: DVec3) -> Vec<DVec3> {
    // After so many knots a B-spline has forgotten another.
    const FAR: usize = 28;
    let n = knots.len();
    let knot = |k: usize| knots[k % n] + jump * (k / n) as f64;
    // The repeats before the first are counted from some way back.
    let back = FAR.div_ceil(n) * n;
    let all = (0..back + n + FAR).map(knot).collect::<Vec<_>>();
    let shift = jump * (back / n) as f64;
    // One control point lies before the first knot.
    spline_through(all.into_iter()).iter().skip(back + 1).take(n).map(|p| *p - shift).collect()
}
