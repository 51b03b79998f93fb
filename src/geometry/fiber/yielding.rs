//! Fibres of a ply whose section is not a circle, or leans: they give way to each other instead of being squeezed together.
//!
//! A packing of discs is squeezed with its section, but fibres stay as thick. Along the short axis they would come closer than
//! two radii, and stick out of the ply. Where a ply winds around its yarn they are cut in ellipses, against which the packing turns.
//! Here the packing is squeezed so that all fibres stay inside of the ply's ellipse, and
//! those that overlap are pushed apart, pair after pair, a fixed number of times. What comes out is a continuous function of
//! how the section is pressed and of how the packing is turned in it, so fibres stay smooth along the yarn; and it is the packing
//! itself where the section is a circle.

use glam::{DMat2, DVec2};

use super::{
    packing::DiscGrid,
    slopes::{DENSEST, Slopes},
};

/// How often all pairs are pushed apart. At an area fraction of 0.5 and axes of 1.5 : 1 the area that lies in two fibres falls
/// from 2.4 % to 0.001 %; in far denser packings more rounds make fibres wriggle along the yarn.
const ROUNDS: usize = 16;
/// By how much pairs are pushed farther than needed, because the last of them would take for ever, and because fibres are
/// smooth between the places where they are: so much for each unit by which the long axis, or that of a leaning fibre's ellipse,
/// is longer than the radius of the circle, and the most.
const FARTHER: f64 = 0.1;
const MOST_FARTHER: f64 = 0.02;
/// How much farther apart than where they touch a pair may come to lie in the squeezed packing, in fibre radii, and still be
/// looked at: others may push it together.
const SLACK: f64 = 0.8;
/// Least semi-axis of the ellipse in which centres stay, in ply radii.
const LEAST_AXIS: f64 = 1e-3;
/// Sections whose axes differ by less are circles.
const NEARLY_ROUND: f64 = 1.0001;

/// A ply's fibres, ready to be squeezed. Lengths in ply radii.
pub(super) struct Yielding<'a> {
    /// Centres in core radii.
    centres: &'a [DVec2],
    /// Radius of a fibre.
    fiber: f64,
    /// How near the axes of two fibres may come: two fibre radii, or less if they do in the packing.
    contact: f64,
    /// Those after each fibre that it may meet, one fibre after the other; what comes out depends on their order.
    others: Vec<u32>,
    /// Where those of each fibre end. None where fibres do not give way.
    ends: Vec<usize>,
}

/// An ellipse as which a ply is seen, of the area of its circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ellipse {
    /// Turns the circle before it is stretched, as (cos, sin).
    before: DVec2,
    /// Long semi-axis, in radii of the circle, at least 1; the short one is its inverse.
    long: f64,
    /// Turns the ellipse, whose long axis is x.
    after: DVec2,
}

impl Ellipse {
    /// Of a map from the circle that keeps areas but for a factor; `None` if it leaves a circle, or nothing.
    pub(super) fn of(map: DMat2) -> Option<Self> {
        Some(Self::or_circle(map)).filter(|ellipse| ellipse.long > 1.0)
    }

    /// The same, and a turned circle of a map that leaves one; one that is not turned if the map leaves nothing.
    pub(super) fn or_circle(map: DMat2) -> Self {
        let (x, y) = (map.x_axis, map.y_axis);
        // A turn times a stretch, and a mirrored one.
        let even = 0.5 * DVec2::new(x.x + y.y, x.y - y.x);
        let odd = 0.5 * DVec2::new(x.x - y.y, x.y + y.x);
        let (long, short) = (even.length() + odd.length(), even.length() - odd.length());
        if !(long.is_finite() && short > 0.0) {
            return Self { before: DVec2::X, long: 1.0, after: DVec2::X };
        }
        if long <= NEARLY_ROUND * short {
            return Self { before: even / even.length(), long: 1.0, after: DVec2::X };
        }
        let (even, odd) = (even.to_angle(), odd.to_angle());
        Self {
            before: DVec2::from_angle(0.5 * (even - odd)),
            long: (long / short).sqrt(),
            after: DVec2::from_angle(0.5 * (even + odd)),
        }
    }

    /// What slopes in the circle become in this ellipse, with its axes those of the place.
    pub(super) fn slopes_in(&self, circle: &Slopes) -> Slopes {
        let axes = DVec2::new(self.long, self.long.recip());
        let (stretch, back) = (DMat2::from_diagonal(axes), DMat2::from_diagonal(axes.recip()));
        Slopes { middle: stretch * circle.middle, linear: stretch * circle.linear * back, even: circle.even }
    }

    /// The flatter one of two.
    pub(super) fn flatter(self, other: Self) -> Self {
        if other.long > self.long { other } else { self }
    }

    /// Semi-axes of the ellipse in which the centres of fibres of a radius stay, in radii of the ply.
    pub(super) fn core(&self, fiber: f64) -> DVec2 {
        (DVec2::new(self.long, self.long.recip()) - fiber).max(DVec2::splat(LEAST_AXIS))
    }
}

impl<'a> Yielding<'a> {
    /// For fibres with `centres` in core radii, and a radius of `fiber` in ply radii, packed with `slopes` at these centres. `flattest`
    /// is the ellipse with the shortest of all short axes that they will be squeezed into.
    pub(super) fn new(centres: &'a [DVec2], fiber: f64, slopes: &Slopes, flattest: &Ellipse) -> Self {
        let core = 1.0 - fiber;
        let reach = (2.0 + SLACK) * fiber * slopes.longest(1.0) / flattest.core(fiber).y;
        let mut yielding = Self { centres, fiber, contact: 2.0 * fiber, others: Vec::new(), ends: Vec::new() };
        if centres.len() as f64 * fiber * fiber > DENSEST {
            // There is no room: they overlap in the packing as well.
            return yielding;
        }
        let mut grid = DiscGrid::new(centres.len(), reach.min(2.0));
        for (i, &centre) in centres.iter().enumerate() {
            grid.add(i as u32, centre);
        }
        for (i, &centre) in centres.iter().enumerate() {
            let from = yielding.others.len();
            let near = grid.near(centre).filter(|&j| j > i && centre.distance_squared(centres[j]) < reach * reach);
            yielding.others.extend(near.map(|j| j as u32));
            let others = &mut yielding.others[from..];
            others.sort_unstable();
            let distances = others.iter().map(|&j| core * slopes.distance_squared(centre, centres[j as usize]).sqrt());
            yielding.contact = distances.fold(yielding.contact, f64::min);
            yielding.ends.push(yielding.others.len());
        }
        yielding
    }

    /// Fills `out` with the fibres' places in the ellipse, in ply radii; the packing is turned by the angle of (cos, sin) first.
    /// `slopes` are those at such places.
    pub(super) fn squeeze(&self, turned: DVec2, ellipse: &Ellipse, slopes: &Slopes, out: &mut Vec<DVec2>) {
        let core = ellipse.core(self.fiber);
        let turned = ellipse.before.rotate(turned);
        out.clear();
        out.extend(self.centres.iter().map(|&centre| core * turned.rotate(centre)));
        let inverse = core.recip();
        let longer = ellipse.long * slopes.longest(0.0);
        let contact = self.contact * (1.0 + (FARTHER * (longer - 1.0)).min(MOST_FARTHER));
        let slopes = slopes.turned_back(ellipse.after);
        for _ in 0..ROUNDS {
            let mut moved = false;
            let mut from = 0;
            for (i, &to) in self.ends.iter().enumerate() {
                // From where it is now, all at once: no push waits for the one before it.
                let (here, mut back) = (out[i], DVec2::ZERO);
                for &j in &self.others[from..to] {
                    let there = &mut out[j as usize];
                    let between = *there - here;
                    let square = slopes.distance_squared(here, *there);
                    if square < contact * contact {
                        let distance = square.sqrt();
                        let apart = between * (0.5 * (contact - distance) / distance.max(1e-9));
                        *there += apart;
                        back += apart;
                        moved = true;
                    }
                }
                out[i] = here - back;
                from = to;
            }
            if !moved {
                break;
            }
            for at in out.iter_mut() {
                let beyond = (*at * inverse).length_squared();
                if beyond > 1.0 {
                    *at /= beyond.sqrt();
                }
            }
        }
        for at in out.iter_mut() {
            *at = ellipse.after.rotate(*at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::fiber::{packing::hard_discs, slopes::Twist},
        math::sampler::Stream,
    };

    /// Of a circle that is pressed to axes of `stretch` : 1 along an axis at an angle.
    fn pressed(stretch: f64, angle: f64) -> Ellipse {
        let (root, axis) = (stretch.sqrt(), DVec2::from_angle(angle));
        let map = |v: DVec2| (v - v.dot(axis) * axis) * root + v.dot(axis) / root * axis;
        Ellipse::of(DMat2::from_cols(map(DVec2::X), map(DVec2::Y))).unwrap()
    }

    fn packing(count: u32, density: f64, seed: u32) -> (Vec<DVec2>, f64) {
        let fiber = (density / f64::from(count)).sqrt();
        (hard_discs(count, fiber / (1.0 - fiber), Twist::NONE, &mut Stream::new(seed)), fiber)
    }

    /// Pairs for each fibre that overlap by more than a thousandth, and how deep they do on the mean and at most, over two radii.
    fn overlap(at: &[DVec2], fiber: f64) -> (f64, f64, f64) {
        let (mut pairs, mut sum, mut most) = (0.0, 0.0, 0.0f64);
        for (i, a) in at.iter().enumerate() {
            for b in &at[..i] {
                let depth = 1.0 - a.distance(*b) / (2.0 * fiber);
                if depth > 1e-3 {
                    (pairs, sum, most) = (pairs + 1.0, sum + depth, most.max(depth));
                }
            }
        }
        (pairs / at.len() as f64, sum / pairs.max(1.0), most)
    }

    /// The mean of [`overlap`] over packings and turns.
    fn mean_overlap(
        count: u32,
        density: f64,
        stretch: f64,
        squeeze: impl Fn(&[DVec2], f64, DVec2, &Ellipse) -> Vec<DVec2>,
    ) -> (f64, f64, f64) {
        let ellipse = pressed(stretch, 0.4);
        let (mut pairs, mut depth, mut most) = (0.0, 0.0, 0.0f64);
        for seed in 0..4 {
            let (centres, fiber) = packing(count, density, seed);
            for turn in 0..5 {
                let (p, d, m) =
                    overlap(&squeeze(&centres, fiber, DVec2::from_angle(0.7 * f64::from(turn)), &ellipse), fiber);
                (pairs, depth, most) = (pairs + p / 20.0, depth + p * d / 20.0, most.max(m));
            }
        }
        (pairs, depth / pairs.max(1e-9), most)
    }

    fn yielding(centres: &[DVec2], fiber: f64, turned: DVec2, ellipse: &Ellipse) -> Vec<DVec2> {
        let mut out = Vec::new();
        Yielding::new(centres, fiber, &Slopes::NONE, ellipse).squeeze(turned, ellipse, &Slopes::NONE, &mut out);
        out
    }

    fn affine(centres: &[DVec2], fiber: f64, turned: DVec2, ellipse: &Ellipse) -> Vec<DVec2> {
        let axes = (1.0 - fiber) * DVec2::new(ellipse.long, ellipse.long.recip());
        let turned = ellipse.before.rotate(turned);
        centres.iter().map(|&centre| ellipse.after.rotate(axes * turned.rotate(centre))).collect()
    }

    #[test]
    fn an_ellipse_is_what_a_map_makes_of_the_circle() {
        for (stretch, angle) in [(1.5, 0.0), (2.5, 0.4), (1.01, 2.0), (4.0, -1.0)] {
            let ellipse = pressed(stretch, angle);
            assert!((ellipse.long * ellipse.long - stretch).abs() < 1e-9);
            let (root, axis) = (stretch.sqrt(), DVec2::from_angle(angle));
            for turn in 0..7 {
                let v = DVec2::from_angle(f64::from(turn));
                let want = (v - v.dot(axis) * axis) * root + v.dot(axis) / root * axis;
                let axes = DVec2::new(ellipse.long, ellipse.long.recip());
                let got = ellipse.after.rotate(axes * ellipse.before.rotate(v));
                assert!((got - want).length() < 1e-9, "{got} {want}");
            }
        }
        assert_eq!(Ellipse::of(DMat2::from_angle(0.3)), None);
        assert_eq!(Ellipse::of(DMat2::ZERO), None);
        assert_eq!(Ellipse::of(DMat2::from_diagonal(DVec2::new(f64::NAN, 1.0))), None);
    }

    #[test]
    fn squeezed_fibers_do_not_lie_in_each_other() {
        // Round packings have none of it.
        for (count, density, stretch, most_pairs, most_depth) in [
            (33, 0.1, 2.5, 0.001, 0.01),
            (70, 0.25, 1.5, 0.001, 0.01),
            (70, 0.25, 2.5, 0.005, 0.01),
            (33, 0.5, 1.5, 0.03, 0.02),
            (150, 0.5, 1.5, 0.03, 0.02),
            (70, 0.5, 2.5, 0.06, 0.02),
            (70, 0.6, 1.5, 0.25, 0.02),
            (70, 0.75, 1.5, 0.9, 0.03),
        ] {
            let (before, deep, _) = mean_overlap(count, density, stretch, affine);
            let (pairs, depth, _) = mean_overlap(count, density, stretch, yielding);
            assert!(
                pairs <= most_pairs && (pairs == 0.0 || depth < most_depth),
                "{count} at {density}, {stretch}: {pairs} {depth}"
            );
            assert!(pairs * depth < 0.25 * before * deep);
        }
    }

    #[test]
    fn squeezed_fibers_stay_in_the_ellipse_and_keep_their_crowding() {
        for (count, density, stretch) in [(33u32, 0.1, 2.5), (70, 0.5, 1.5), (70, 0.5, 2.5), (150, 0.7, 1.5)] {
            let ellipse = pressed(stretch, 1.0);
            let axes = DVec2::new(ellipse.long, ellipse.long.recip());
            let (mut moment, mut round, mut all) = (0.0, 0.0, 0.0);
            for seed in 0..8 {
                let (centres, fiber) = packing(count, density, seed);
                for turn in 0..5 {
                    let at = yielding(&centres, fiber, DVec2::from_angle(0.7 * f64::from(turn)), &ellipse);
                    for (at, centre) in at.iter().zip(&centres) {
                        let at = DVec2::new(ellipse.after.x, -ellipse.after.y).rotate(*at);
                        for around in 0..12 {
                            let edge = at + fiber * DVec2::from_angle(f64::from(around));
                            assert!((edge / axes).length() < 1.0 + 0.15 * fiber, "{edge} beyond {axes}");
                        }
                        moment += (at / (axes - fiber)).length_squared();
                        round += centre.length_squared();
                        all += 1.0;
                    }
                }
            }
            assert!(
                (2.0 * (moment - round) / all).abs() < 0.035,
                "{count} at {density}, {stretch}: {moment} {round} of {all}"
            );
        }
    }

    #[test]
    fn squeezed_fibers_move_smoothly_with_the_turn_and_with_the_pressing() {
        // On its ellipse a fibre moves by no more than the long axis for each radian.
        for (density, most, most_mean) in [(0.25, 1.1, 1.02), (0.5, 1.3, 1.03), (0.7, 2.0, 1.1)] {
            let (centres, fiber) = packing(70, density, 3);
            let step = 1e-4;
            for turn in 0..20 {
                let turn = 0.17 * f64::from(turn);
                let at =
                    |turn: f64, stretch| yielding(&centres, fiber, DVec2::from_angle(turn), &pressed(stretch, 0.4));
                let (here, there) = (at(turn, 1.5), at(turn + step, 1.5));
                let way =
                    |a: &[DVec2], b: &[DVec2]| a.iter().zip(b).map(|(a, b)| a.distance(*b) / step).fold(0.0, f64::max);
                assert!(way(&here, &there) < most * 1.5f64.sqrt(), "{density}: {}", way(&here, &there));
                let squares =
                    |a: &[DVec2], b: &[DVec2]| a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum::<f64>();
                let plain = |turn: f64| affine(&centres, fiber, DVec2::from_angle(turn), &pressed(1.5, 0.4));
                let rate = (squares(&here, &there) / squares(&plain(turn), &plain(turn + step))).sqrt();
                assert!(rate < most_mean, "{density}: {rate} times as far");
                assert!(way(&here, &at(turn, 1.5 + step)) < most, "{density}: {}", way(&here, &at(turn, 1.5 + step)));
            }
            // Down to the packing itself.
            let nearly = yielding(&centres, fiber, DVec2::X, &pressed(1.001, 0.0));
            for (at, centre) in nearly.iter().zip(&centres) {
                assert!(at.distance((1.0 - fiber) * *centre) < 1e-3);
            }
        }
    }

    #[test]
    fn fibers_without_room_are_left_as_they_are() {
        for (count, fiber) in [(50, 0.5), (3, 0.9), (1, 0.999), (0, 0.1), (400, 1e-9), (2, 0.6)] {
            let centres = hard_discs(count, fiber / (1.0 - fiber), Twist::NONE, &mut Stream::new(7));
            for stretch in [1.2, 4.0, 100.0] {
                let at = yielding(&centres, fiber, DVec2::Y, &pressed(stretch, 0.2));
                assert!(at.len() == count as usize && at.iter().all(|at| at.is_finite()));
            }
        }
    }
}
