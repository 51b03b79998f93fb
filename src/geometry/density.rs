//! How many fibres of a ply a line meets, and where along it (docs/model.md, section 2).
//!
//! A ply's fibres do not lie evenly: discs that must not overlap line up at the wall, and loosely spun fibres gather at
//! the axis. The *crowding* q says how much. For q > 0 a share q of the fibres is taken to lie on a circle at the wall and the rest
//! even; for q < 0 their density falls as 1 - 3 q (1 - 2 r^2 / R_c^2) with the distance r from the ply's axis, where R_c is the
//! radius within which the centres lie. Either has the second moment 2 <r^2> / R_c^2 - 1 = q, if the circle is that of R_c.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2};

use wide::f32x4;

use super::{after_fiber::AfterFiber, first_fiber::FirstFiber, ply::PlyShape};

/// How the fibres of a ply lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlyPacking {
    /// q, above -1 and at most 1; below -1/3 it counts as -1/3, where no fibre is left at the wall.
    pub crowding: f64,
    /// How far inside R_c the circle lies on which fibres crowd, in fibre radii; 0 where q is not above 0.
    pub depth: f64,
    /// How much more regular than chance what a line meets is, because fibres keep out of each other: the dead zone after each
    /// fibre, over the share of the line that lies inside fibres. 0 where they lie at random.
    pub regularity: f64,
    /// The same of lines by the rim, where fibres lie in another order.
    pub rim: f64,
    /// How deep the first fibre on a line lies. `None` if that is as the gaps have it.
    pub first: Option<FirstFiber>,
    /// What light meets after a fibre. `None` if no other is within the mean dead zone, and those beyond lie at random.
    pub after: Option<AfterFiber>,
}

impl PlyPacking {
    /// Of fibres that lie evenly up to the wall, in a regular order or at random (0).
    pub fn evenly(regularity: f64) -> Self {
        Self { crowding: 0.0, depth: 0.0, regularity, rim: regularity, first: None, after: None }
    }
}

/// What of [`PlyPacking`] is known, and not to be measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KnownPacking {
    /// [`PlyPacking::crowding`].
    pub crowding: Option<f64>,
    /// [`PlyPacking::regularity`], at least 0.
    pub regularity: Option<f64>,
}

impl KnownPacking {
    /// What is known in place of what was measured.
    pub fn over(self, measured: PlyPacking) -> PlyPacking {
        PlyPacking {
            crowding: self.crowding.unwrap_or(measured.crowding),
            depth: if self.crowding.is_some() { 0.0 } else { measured.depth },
            regularity: self.regularity.unwrap_or(measured.regularity),
            rim: self.regularity.unwrap_or(measured.rim),
            ..measured
        }
    }
}

/// The fibres a line through a ply meets. Lengths are in yarn radii along the line, from the point nearest to the ply's
/// axis; a coordinate grows the way the light travels out.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChordFibers {
    /// Expected fibres of those that lie evenly along the chord.
    pub even: f32,
    /// Expected fibres of those at the wall, half of them at each end.
    pub ring: f32,
    /// Half length of the chord on which the centres lie.
    pub half: f32,
    /// How far from each end of the chord the fibres at the wall reach, at most `half`.
    pub zone: f32,
}

impl PlyShape {
    /// The expected fibres on an untwisted chord whose signed distance from the ply's axis is `offset` (yarn radii, in
    /// the circle of [`Self::radius`]); `length` is how much of that circle a unit of the line passes, 1 for round plies; `thin`
    /// how thick fibres are along the line, over their radius, 1 where the yarn is not pressed flat; `wide` how thick they are across the
    /// line in that circle, over their radius there, 1 as well.
    ///
    /// Exact for the density above: the number of centres within a fibre's radius of the line. (The paper's Eq. 2,
    /// d l sqrt(n / pi), lacks a factor of 1.128 / sqrt(d) against counted fibres.)
    #[inline]
    pub fn chord(&self, offset: f32, length: f32, thin: f32, wide: f32) -> ChordFibers {
        // Centres keep as far from the rim as fibres are thick: across the line, and along it.
        let half_width = self.half_width(wide);
        let core = self.radius - half_width;
        let inverse = 1.0 / core;
        let circle = if self.depth == 0.0 { inverse } else { 1.0 / (core - self.depth * half_width).max(1e-3 * core) };
        let (upper, lower) = (offset + half_width, offset - half_width);
        // In the circle of all centres, and in that on which they crowd.
        let at = Segments::new([upper * inverse, lower * inverse, upper * circle, lower * circle]);
        let count = self.fibers * FRAC_1_PI / (length * wide);
        let [upper, lower, ..] = at.areas();
        let mut even = upper - lower;
        let mut ring = 0.0;
        if self.crowding > 0.0 {
            even *= 1.0 - self.crowding;
            let [.., upper, lower] = at.angles();
            ring = self.crowding * (upper - lower);
        } else if self.crowding < 0.0 {
            let [upper, lower, ..] = at.cubics();
            even -= 2.0 * self.crowding.max(-1.0 / 3.0) * (upper - lower);
        }
        // The line meets fibres whose centres lie up to a fibre's radius beside it. Those of the mean fibre lie on a chord as long as the chords
        // of the core there, each counted as often as it is long.
        let [right, left, ..] = at.u.to_array();
        let squares = (right - left) * (1.0 - (right * right + right * left + left * left) / 3.0);
        // No more than the longest of them: at the rim both vanish, and the areas' difference before the other.
        let [of_right, of_left, ..] = at.cos.to_array();
        let longest = if right * left < 0.0 { 1.0 } else { of_right.max(of_left) };
        let mean = (2.0 * squares / (upper - lower).max(1e-20)).min(longest);
        let half = (mean * self.core_along(wide)).max(0.5 * self.fiber_radius);
        let half = half / length;
        let zone = (thin * self.fiber_radius).min(half);
        ChordFibers { even: (count * even).max(0.0), ring: (count * ring).max(0.0), half, zone }
    }
}

impl PlyShape {
    /// The dead zone after each fibre that a chord of [`Self::chord`] meets, in expected fibres: the share of the whole line through
    /// the ply that lies inside fibres, a mean chord pi / 2 r_f in each, times [`PlyPacking::regularity`], or by the rim
    /// [`PlyPacking::rim`]; at most 0.85.
    #[inline]
    pub fn dead_zone(&self, chord: &ChordFibers, offset: f32, length: f32) -> f32 {
        let line = 2.0 * (self.radius * self.radius - offset * offset).max(0.0).sqrt();
        let inside = FRAC_PI_2 * self.fiber_radius * chord.total() * length;
        let regularity = self.regularity + self.by_rim(offset) * (self.rim - self.regularity);
        (regularity * inside / line.max(1e-12)).min(0.85)
    }

    /// Half of the chord on which centres of fibres lie that are so far beside the ply's axis, in the circle of [`Self::radius`]; `wide` as for
    /// [`Self::chord`].
    #[inline]
    pub fn half_chord(&self, middle: f32, wide: f32) -> f32 {
        let core = self.radius - self.half_width(wide);
        self.core_along(wide) * (1.0 - (middle / core).powi(2)).max(0.0).sqrt()
    }

    /// How far from the ply's axis the middle of the first fibre is that a line meets at a distance from it: on either side of the line within a
    /// fibre's width; `u` draws it. Those at the wall are as likely anywhere there, others as the chord of the core is long, which is taken
    /// to be linear in between.
    #[inline]
    pub fn middle_beside(&self, offset: f32, wide: f32, u: f32) -> f32 {
        /// About the share of first fibres that lie at the wall: 26 to 46 % in dense plies.
        const AT_WALL: f32 = 0.4;
        let half_width = self.half_width(wide);
        let core = self.radius - half_width;
        let [left, right] = [offset - half_width, offset + half_width].map(|at| at.clamp(-core, core));
        let [a, b] = [left, right].map(|at| (core * core - at * at).max(0.0).sqrt());
        let root = (a * a + u * (b * b - a * a)).max(0.0).sqrt();
        let by_length = if a + root > 0.0 { (u * (a + b) / (a + root)).min(1.0) } else { u };
        left + (by_length + AT_WALL * (u - by_length)) * (right - left)
    }

    /// How far centres of fibres keep from the rim across a line.
    #[inline]
    fn half_width(&self, wide: f32) -> f32 {
        (self.fiber_radius * wide).min(0.999 * self.radius)
    }

    /// How far from the ply's axis they lie along it.
    #[inline]
    fn core_along(&self, wide: f32) -> f32 {
        (self.radius - self.fiber_radius / wide).max(0.0)
    }

    /// How much the first fibre on a line at a distance from the ply's axis lies as those by the rim do, from 0 to 1.
    #[inline]
    pub fn first_by_rim(&self, offset: f32) -> f32 {
        FirstFiber::by_rim((self.radius - offset.abs()) / self.fiber_radius)
    }

    /// Packs the fibres so; until then they lie evenly.
    pub fn pack(&mut self, packing: &PlyPacking) {
        self.crowding = packing.crowding as f32;
        self.depth = packing.depth as f32;
        self.regularity = packing.regularity as f32;
        self.rim = packing.rim as f32;
        self.first = packing.first;
        self.after = packing.after;
    }

    /// How much the order of fibres on a line at a distance from the ply's axis is that by the rim, from 0 to 1: from two fibres below it
    /// on it is that of the inside.
    #[inline]
    pub fn by_rim(&self, offset: f32) -> f32 {
        let depth = (self.radius - offset.abs()) / self.fiber_radius;
        (2.0 - 0.5 * depth).clamp(0.0, 1.0)
    }
}

impl ChordFibers {
    /// All fibres on the chord.
    #[inline]
    pub fn total(&self) -> f32 {
        self.even + self.ring
    }

    /// The fibres that lie ahead of the coordinate `t`.
    #[inline]
    pub fn ahead(&self, t: f32) -> f32 {
        let even = ((self.half - t) / (2.0 * self.half)).clamp(0.0, 1.0);
        let far = ((self.half - t) / self.zone).clamp(0.0, 1.0);
        let near = ((-self.half - t) / self.zone + 1.0).clamp(0.0, 1.0);
        self.even * even + 0.5 * self.ring * (far + near)
    }

    /// The coordinate behind which the share `x` of the fibres lies, seen from the end of the chord: `ahead(t) = x total`.
    #[inline]
    pub fn place(&self, x: f32) -> f32 {
        // From the end inwards: dense where the wall's fibres lie, even between, dense again.
        let even = self.even / (2.0 * self.half);
        let wall = even + 0.5 * self.ring / self.zone;
        let in_zone = wall * self.zone;
        let wanted = x * self.total();
        let beyond = self.total() - in_zone;
        let depth = if wanted < in_zone {
            wanted / wall
        } else if wanted < beyond && even > 0.0 {
            self.zone + (wanted - in_zone) / even
        } else {
            2.0 * self.half - (self.total() - wanted) / wall.max(1e-30)
        };
        self.half - depth.clamp(0.0, 2.0 * self.half)
    }
}

/// What lies on one side of each of four chords of the unit circle at distances u, clamped to [-1, 1], from its centre.
struct Segments {
    u: f32x4,
    /// sqrt(1 - u^2)
    cos: f32x4,
    /// asin(u)
    angle: f32x4,
}

impl Segments {
    #[inline]
    fn new(u: [f32; 4]) -> Self {
        let one = f32x4::ONE;
        let u = f32x4::from(u);
        let a = u.abs().fast_min(one);
        // asin(a) = pi/2 - sqrt(1 - a) poly(a), |error| < 2e-8 (Abramowitz and Stegun 4.4.46).
        const C: [f32; 8] = [
            -0.001_262_491_1,
            0.006_670_09,
            -0.017_088_126,
            0.030_891_88,
            -0.050_174_303,
            0.088_978_99,
            -0.214_598_8,
            FRAC_PI_2,
        ];
        let poly = C[1..].iter().fold(f32x4::splat(C[0]), |p, &c| p * a + f32x4::splat(c));
        let asin = f32x4::splat(FRAC_PI_2) - (one - a).sqrt() * poly;
        Self { u: a.copysign(u), cos: (one - a * a).sqrt(), angle: asin.copysign(u) }
    }

    /// Areas of the disc below the chords, less pi / 2.
    #[inline]
    fn areas(&self) -> [f32; 4] {
        (self.u * self.cos + self.angle).to_array()
    }

    #[inline]
    fn angles(&self) -> [f32; 4] {
        self.angle.to_array()
    }

    /// u (1 - u^2)^(3/2): the integral of (1 - 4 u^2) sqrt(1 - u^2).
    #[inline]
    fn cubics(&self) -> [f32; 4] {
        (self.u * self.cos * self.cos * self.cos).to_array()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::yarn::tests::touching_yarn;

    fn ply(fibers: u32, density: f64, crowding: f32) -> PlyShape {
        let mut ply = touching_yarn(1, fibers, density, 0.0, 0.0).plies[0].clone();
        ply.crowding = crowding;
        ply
    }

    #[test]
    fn the_count_of_fibers_integrates_to_all_of_them_and_has_its_moment() {
        // Each fibre covers a width of 2 r_f of all offsets: int n(y) dy = 2 r_f n. The second moment of n(y) is that
        // of one coordinate of the centres, <r^2> / 2 = (1 + q) R_c^2 / 4, and of the fibre's width, r_f^2 / 3.
        for (fibers, density) in [(25, 0.1), (100, 0.5), (400, 0.7)] {
            for crowding in [-1.0f32 / 3.0, -0.1, 0.0, 0.05, 0.3, 1.0] {
                let ply = ply(fibers, density, crowding);
                let n = 40_000;
                let (mut sum, mut moment) = (0.0, 0.0);
                for i in 0..n {
                    let y = -1.0 + 2.0 * (i as f32 + 0.5) / n as f32;
                    let count = f64::from(ply.chord(y, 1.0, 1.0, 1.0).total()) * 2.0 / f64::from(n);
                    sum += count;
                    moment += count * f64::from(y * y);
                }
                let want = 2.0 * f64::from(ply.fiber_radius) * f64::from(fibers);
                assert!((sum / want - 1.0).abs() < 1e-3, "{sum} {want}");
                let (core, fiber) = (f64::from(ply.core_radius), f64::from(ply.fiber_radius));
                let want = (1.0 + f64::from(crowding)) * core * core / 4.0 + fiber * fiber / 3.0;
                assert!((moment / sum / want - 1.0).abs() < 2e-3, "{fibers} {crowding}: {} {want}", moment / sum);
                assert_eq!(ply.chord(1.5, 1.0, 1.0, 1.0).total(), 0.0);
            }
        }
    }

    #[test]
    fn fibers_of_pressed_plies_keep_their_width_across_a_line() {
        // Across the short axis of a section of 2 : 1, and across the long one.
        for wide in [0.5f32.sqrt(), 2.0f32.sqrt()] {
            let ply = ply(70, 0.5, 0.05);
            let n = 40_000;
            let chord = |i: i32| ply.chord((2.0 * (i as f32 + 0.5) / n as f32 - 1.0) * ply.radius, 1.0, 1.0, wide);
            let sum: f64 = (0..n).map(|i| f64::from(chord(i).total() * ply.radius) * 2.0 / f64::from(n)).sum();
            let want = 2.0 * f64::from(ply.fiber_radius) * 70.0;
            assert!((sum / want - 1.0).abs() < 1e-3, "{sum} {want}");
            // The outermost fibres touch the rim, however wide they are.
            let at = |share: f32| ply.chord(ply.radius - share * wide * ply.fiber_radius, 1.0, 1.0, wide).total();
            assert!(at(0.0) < 1e-3 && at(0.5) > 0.3 * at(1.0) && at(1.0) > 0.5, "{} {} {}", at(0.0), at(0.5), at(1.0));
        }
    }

    #[test]
    fn fibers_on_a_line_have_their_middles_beside_it_and_in_the_core() {
        let ply = ply(60, 0.4, 0.05);
        for wide in [0.8f32, 1.0, 1.25] {
            let half_width = wide * ply.fiber_radius;
            let core = ply.radius - half_width;
            for i in 0..=200 {
                let offset = ply.radius * (0.01 * i as f32 - 1.0);
                let middles = [0.0, 0.5, 0.999_999].map(|u| ply.middle_beside(offset, wide, u));
                for middle in middles {
                    assert!(middle.abs() <= core + 1e-6 && (middle - offset).abs() <= half_width + 1e-6, "{offset}");
                    assert!(ply.half_chord(middle, wide) >= 0.0);
                }
                assert!(middles.is_sorted(), "{middles:?}");
                // More of them are inwards.
                if offset.abs() < core {
                    assert!((middles[1] - offset) * offset <= 1e-6, "{offset}");
                }
            }
            assert!((ply.half_chord(0.0, wide) - (ply.radius - ply.fiber_radius / wide)).abs() < 1e-6);
            assert_eq!(ply.half_chord(ply.radius, wide), 0.0);
        }
    }

    #[test]
    fn chords_by_the_rim_are_no_longer_than_the_core() {
        for (fibers, density) in [(60, 0.4), (150, 0.55), (300, 0.2)] {
            let ply = ply(fibers, density, 0.05);
            let core = ply.radius - ply.fiber_radius;
            let least = 0.5 * ply.fiber_radius;
            for i in 0..20_000 {
                let offset = ply.radius - ply.fiber_radius * i as f32 * 1e-4;
                // Of the chords in the strip the innermost is the longest.
                let inner = (offset - ply.fiber_radius).min(core);
                let longest = (core * core - inner * inner).sqrt().max(least);
                let half = ply.chord(offset, 1.0, 1.0, 1.0).half;
                assert!(half >= least && half <= longest + 1e-4, "{half} at {offset}, {longest}");
            }
        }
    }

    #[test]
    fn places_along_a_chord_hold_the_share_that_lies_ahead_of_them() {
        for crowding in [-0.2, 0.0, 0.1, 1.0] {
            for (fibers, density) in [(1, 0.5), (25, 0.1), (70, 0.5)] {
                let ply = ply(fibers, density, crowding);
                for i in 0..=40 {
                    let chord = ply.chord(0.025 * i as f32 * ply.radius, 1.3, 1.0, 1.0);
                    if chord.total() < 1e-6 {
                        continue;
                    }
                    assert!((chord.ahead(-2.0) - chord.total()).abs() < 1e-5 && chord.ahead(2.0) == 0.0);
                    for k in 0..=20 {
                        let x = k as f32 / 20.0;
                        let t = chord.place(x);
                        assert!(t.abs() <= chord.half * 1.000_001);
                        let ahead = chord.ahead(t) / chord.total();
                        assert!((ahead - x).abs() < 2e-3, "q {crowding}, {fibers} fibres, {chord:?}: {ahead}, not {x}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_segment_area_is_exact_to_single_precision() {
        for i in 0..=2000 {
            let u = -1.0 + f64::from(i) * 1e-3;
            let want = u * (1.0 - u * u).max(0.0).sqrt() + u.clamp(-1.0, 1.0).asin();
            let got = Segments::new([u as f32, 0.0, 2.0, -2.0]).areas();
            assert!((f64::from(got[0]) - want).abs() < 4e-7, "u = {u}");
            assert_eq!(got[1..], [0.0, FRAC_PI_2, -FRAC_PI_2]);
        }
    }
}
