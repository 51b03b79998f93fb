//! How cloth is turned in where it is sewn: seen from the right side both panels go down into a line. At a hem it turns
//! right round and lies under itself.
//!
//! Across a seam, s is the distance from it on the cloth (negative for what was left beyond the line, to be turned in),
//! z the height over the cloth. Both panels do the same on either side of the plane through the line, so that yarns that
//! stay on their side by their radius do not meet.
//!
//! Over a body seams are pressed flat: edges that are joined below are laid to one side, others apart, each under its own
//! panel.

use std::f64::consts::{FRAC_PI_2, PI};

use super::seam::SeamKind;

/// Exponent of the superellipse that the right side follows round the bend of a seam, and of a hem, a circle.
const FULL: f64 = 6.0;
const ROUND: f64 = 2.0;
/// Yarns on the inner side of a bend go round it with this radius, in diameters: more tightly they would run into each other.
const BEND: f64 = 0.9;
/// From the plane between two panels to the outermost middles of their yarns, in diameters: yarns of a weave touch all along. Those
/// of a knit meet here and there, and a sewing yarn presses them on each other by a fifth.
const ASIDE_WOVEN: f64 = 0.51;
const ASIDE_KNITTED: f64 = 0.4;

/// How a cloth is turned in at each kind of seam.
pub(super) type Folds = [Option<Fold>; SeamKind::COUNT];

/// The way of cloth across a seam: flat, round a bend to upright, straight on, and perhaps apart again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fold {
    /// Radius of the bend in the middle of the cloth, mm.
    pub(super) radius: f64,
    /// How far from the seam's plane the middle is where it goes straight down, mm.
    pub(super) half: f64,
    /// For what length it does, mm, and by what angle it turns then, radians.
    wall: f64,
    flare: f64,
    /// Radius at which cloth keeps its length, mm.
    neutral: f64,
    /// Yarns do not bend about less than this, mm.
    least: f64,
    /// How far the cloth's wrong side and its right side are from its middle, mm.
    sides: [f64; 2],
    /// Between which heights the middles of its yarns lie, mm.
    heights: [f64; 2],
    /// Exponent of the superellipse that its right side follows, and up to which angle: whole quarters of a turn, radians.
    exponent: f64,
    full: f64,
    /// Whether what is turned in is laid to one side.
    laid_over: bool,
}

/// A place on the way: the angle by which the cloth is turned there, how far the bend has moved down, and what is straight
/// behind it, mm.
struct Turned {
    angle: f64,
    down: f64,
    straight: f64,
}

impl Fold {
    /// Of cloth whose yarns' middles lie between two heights, of yarn of a diameter; `None` where cloth stays flat.
    pub(super) fn new(
        kind: SeamKind,
        [low, high]: [f64; 2],
        diameter: f64,
        knitted: bool,
        pressed: bool,
    ) -> Option<Self> {
        let (wall, flare) = match kind {
            SeamKind::None => return None,
            // Without any wall a slot stands open between loops that touch at one height only.
            SeamKind::Mattress if pressed => (0.8 * diameter, FRAC_PI_2),
            // Where the edges part the sewing yarn has room between them. Before, somewhere on the wall, loops of both sides
            // touch.
            SeamKind::Mattress => (1.8 * diameter, 50_f64.to_radians()),
            SeamKind::Overlock => (f64::INFINITY, 0.0),
        };
        let laid_over = pressed && kind == SeamKind::Overlock;
        let radius = BEND * diameter - low;
        let sides = [0.5 * diameter - low, 0.5 * diameter + high];
        let half = high + diameter * if knitted { ASIDE_KNITTED } else { ASIDE_WOVEN };
        let (neutral, least, heights) = (radius + 0.5 * low, 0.3 * diameter, [low, high]);
        let full = FRAC_PI_2 * (1.0 + (flare / FRAC_PI_2).floor());
        let exponent = FULL;
        Some(Self { radius, half, wall, flare, exponent, full, neutral, least, sides, heights, laid_over })
    }

    /// Of a hem: half a turn, whose outermost place is the edge, and then straight back under the cloth.
    pub(super) fn of_hem([low, high]: [f64; 2], diameter: f64) -> Self {
        let sides = [0.5 * diameter - low, 0.5 * diameter + high];
        let radius = BEND * diameter - low;
        Self {
            radius,
            half: sides[1],
            wall: 0.0,
            flare: FRAC_PI_2,
            exponent: ROUND,
            full: PI,
            neutral: radius + 0.5 * low,
            least: 0.3 * diameter,
            sides,
            heights: [low, high],
            laid_over: false,
        }
    }

    /// How much cloth goes on beyond a hem's edge so that its raw edge lies so far inside of it, mm.
    pub(super) fn beyond(&self, width: f64) -> f64 {
        width + PI * self.neutral - 2.0 * self.begin()
    }

    /// Which share of a hem's turn is done at a distance on the cloth.
    pub(super) fn turned_share(&self, s: f64) -> f64 {
        ((self.begin() - s) / (PI * self.neutral)).clamp(0.0, 1.0)
    }

    /// Heights of the cloth's right side and of the outer side of what is turned under it at a hem, mm.
    pub(super) fn skins(&self) -> [f64; 2] {
        [self.sides[1], -2.0 * self.radius - self.sides[1]]
    }

    /// Height of the cloth's wrong side, mm.
    pub(super) fn wrong_side(&self) -> f64 {
        -self.sides[0]
    }

    /// The distance from the seam at which the bend begins, mm.
    pub(super) fn begin(&self) -> f64 {
        self.half + self.radius
    }

    /// The distance on the cloth at which it goes straight down, mm.
    pub(super) fn upright(&self) -> f64 {
        self.begin() - self.neutral * FRAC_PI_2
    }

    fn turned(&self, s: f64) -> Turned {
        let after = self.upright() - s;
        if after <= 0.0 {
            return Turned { angle: (self.begin() - s) / self.neutral, down: 0.0, straight: 0.0 };
        }
        let parted = (after - self.wall).max(0.0);
        let turned = (parted / self.neutral).min(self.flare);
        Turned { angle: FRAC_PI_2 + turned, down: after.min(self.wall), straight: parted - turned * self.neutral }
    }

    /// Where a place of the cloth comes to lie: distance from the seam's plane and height, mm. `side` is 1 on the side to
    /// which edges are laid and -1 on the other.
    pub(super) fn bend(&self, s: f64, z: f64, side: f64) -> [f64; 2] {
        if s >= self.begin() {
            return [s, z];
        }
        let at = self.off(s, z.max(self.least - self.radius));
        if s < self.upright() { self.lay_over(at, side) } else { at }
    }

    /// Where a place below the bends comes to lie if edges are laid to one side: all of it turns about an axis under the
    /// first bend of that side.
    pub(super) fn lay_over(&self, [aside, out]: [f64; 2], side: f64) -> [f64; 2] {
        let deep = -self.radius - out;
        if !self.laid_over || deep <= 0.0 {
            return [aside, out];
        }
        // Layers keep their distances; the seam's plane keeps its length.
        let middle = self.begin();
        let from_axis = middle - aside * side;
        let angle = (deep / middle).min(FRAC_PI_2);
        let straight = (deep - middle * FRAC_PI_2).max(0.0);
        let (sin, cos) = angle.sin_cos();
        [side * (middle - from_axis * cos + straight), -self.radius - from_axis * sin]
    }

    /// How far below the cloth's middle all of it reaches where so much is turned in, mm.
    pub(super) fn depth(&self, over: f64) -> f64 {
        let upright = self.off(-over, self.sides[1])[1].min(self.off(-over, -self.sides[0])[1]);
        let lowest = match self.laid_over {
            true => self.lay_over([-self.half - self.sides[0], upright], 1.0)[1],
            false => (0..32).map(|i| self.off(-over * f64::from(i) / 31.0, self.sides[1])[1]).fold(upright, f64::min),
        };
        -lowest
    }

    /// What lies so far before the right side of what is turned in, at a distance on the cloth.
    pub(super) fn before(&self, s: f64, clear: f64) -> [f64; 2] {
        self.off(s, self.sides[1] + clear)
    }

    /// What lies so far behind its wrong side.
    pub(super) fn behind(&self, s: f64, clear: f64) -> [f64; 2] {
        self.off(s, -self.sides[0] - clear)
    }

    /// By how much a layer bulges out of a round bend at an angle of it: the nearer to the right side, the more. Loops there
    /// are drawn over the bend and fill it, so that both sides meet in a narrow line; round they would leave a groove
    /// as wide as a column.
    fn fullness(&self, angle: f64, z: f64) -> f64 {
        let [low, high] = self.heights;
        let front = ((z - low) / (high - low).max(1e-9)).clamp(0.0, 1.0);
        let n = ROUND + (self.exponent - ROUND) * front;
        let (sin, cos) = angle.min(self.full).sin_cos();
        (sin.abs().powf(n) + cos.abs().powf(n)).powf(-1.0 / n)
    }

    fn off(&self, s: f64, z: f64) -> [f64; 2] {
        let Turned { angle, down, straight } = self.turned(s);
        let (sin, cos) = angle.sin_cos();
        let out = (self.radius + z) * self.fullness(angle, z);
        [self.begin() - out * sin - straight * cos, out * cos - self.radius - down - straight * sin]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cloth_goes_on_evenly_and_stays_on_its_side() {
        for kind in [SeamKind::Mattress, SeamKind::Overlock] {
            let fold = Fold::new(kind, [-0.8, 0.7], 1.0, true, false).unwrap();
            assert_eq!(fold.bend(fold.begin(), 0.3, 1.0), [fold.begin(), 0.3]);
            let [s, z] = fold.bend(fold.upright(), 0.0, 1.0);
            assert!((s - fold.half).abs() < 1e-9 && (z + fold.radius).abs() < 1e-9);
            let mut before = fold.bend(6.0, 0.0, 1.0);
            for i in 1..900 {
                let here = fold.bend(6.0 - 0.01 * f64::from(i), 0.0, 1.0);
                let step = (here[0] - before[0]).hypot(here[1] - before[1]);
                // Outside of the neutral line cloth is drawn out, most where it bulges.
                assert!((0.0099..0.0170).contains(&step), "{i}: {step}");
                before = here;
            }
            // Right sides face each other and are pressed together no more than is wanted; what is turned in lies under the cloth.
            let across = |s: f64| fold.bend(s, 0.7, 1.0)[0] - ASIDE_KNITTED;
            assert!((0..600).map(|i| across(3.0 - 0.01 * f64::from(i))).all(|gap| gap > -1e-9));
            assert!(fold.bend(-2.0, 0.0, 1.0)[1] < -2.0);
        }
        assert_eq!(Fold::new(SeamKind::None, [-0.8, 0.7], 1.0, true, false), None);
    }

    /// Seen from outside both right sides meet as two columns do: no groove that is wider or deeper than a yarn.
    #[test]
    fn right_sides_meet_below_a_narrow_groove() {
        for (kind, pressed) in [SeamKind::Mattress, SeamKind::Overlock].into_iter().zip([true, false]) {
            let fold = Fold::new(kind, [-0.8, 0.7], 1.0, true, pressed).unwrap();
            let upper = 0.7 + 0.5;
            let skin: Vec<_> = (-100..1000).map(|i| fold.bend(0.005 * f64::from(i), upper, 1.0)).collect();
            let gap = |depth: f64| {
                let here = skin.iter().filter(|[_, out]| (out - (upper - depth)).abs() < 0.02);
                2.0 * here.map(|[aside, _]| *aside).fold(f64::MAX, f64::min)
            };
            assert!(gap(0.5) < 1.0 && gap(1.0) < 0.5, "{kind:?}: {} {}", gap(0.5), gap(1.0));
            // And closed for more than a yarn below.
            assert!((0..12).all(|i| gap(1.8 + 0.1 * f64::from(i)) < 0.2), "{kind:?}: {}", gap(1.8));
        }
    }

    #[test]
    fn what_is_pressed_lies_flat_and_keeps_its_layers_apart() {
        for kind in [SeamKind::Mattress, SeamKind::Overlock] {
            let fold = Fold::new(kind, [-0.8, 0.7], 1.0, true, true).unwrap();
            let upright = Fold::new(kind, [-0.8, 0.7], 1.0, true, false).unwrap();
            // However much is turned in, it goes no deeper.
            assert!(fold.depth(30.0) < 8.0 && (fold.depth(30.0) - fold.depth(60.0)).abs() < 1e-9, "{kind:?}");
            assert!(upright.depth(30.0) > 20.0);
            let places = |side: f64| (0..1500).map(move |i| (side, 3.0 - 0.01 * f64::from(i)));
            let at = |side: f64, s: f64, z: f64| {
                let [aside, out] = fold.bend(s, z, side);
                [side * aside, out]
            };
            let mut nearest = f64::MAX;
            for (_, s) in places(1.0).filter(|(_, s)| *s < 0.0) {
                for (_, t) in places(-1.0).filter(|(_, t)| *t < 0.0) {
                    let ([a, b], [c, d]) = (at(1.0, s, 0.0), at(-1.0, t, 0.0));
                    nearest = nearest.min((a - c).hypot(b - d));
                }
            }
            // Middles of both stay apart by what is between their right sides, and under the cloth.
            assert!(nearest > 2.0 * (0.7 + ASIDE_KNITTED) - 1e-9, "{kind:?}: {nearest}");
            let lowest = places(1.0).map(|(side, s)| at(side, s, -0.8)[1]).fold(f64::MAX, f64::min);
            assert!(lowest > -fold.depth(12.0) - 1e-9, "{kind:?}: {lowest}");
            let [aside, out] = at(1.0, -9.0, -0.8);
            assert!(aside > 4.0 && out < -0.8 - 1.0, "{kind:?}: {aside} {out}");
        }
    }
}
