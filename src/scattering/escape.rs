//! What leaves a ply of light that is scattered evenly around in it, by where it is: transport in a disc, solved when a
//! model is made ready.

use std::f64::consts::PI;

/// Rings of equal area into which the disc is cut.
pub(crate) const RINGS: usize = 16;
/// The thickest disc that so few rings tell, in mean free paths of its radius: of thicker ones the outer part is as thick.
const THICKEST: f64 = 24.0;
/// Directions, and places along each, that are looked at from every ring.
const DIRECTIONS: usize = 24;
const PLACES: usize = 16;

/// What sends light on takes part in its own escape: a chance to escape with so much of it, in mean free paths, `own`.
pub(crate) fn past_itself(escape: f64, own: f64) -> f64 {
    escape * (1.0 + own) / (1.0 + own * escape)
}

/// A disc in which light goes straight until it meets something that sends it on evenly around.
#[derive(Clone, Debug)]
pub(crate) struct Disc {
    /// Chance to leave the disc from each ring without meeting anything. It says where light enters as well.
    escape: [f64; RINGS],
    /// Chance to meet something next in each other ring.
    next: [[f64; RINGS]; RINGS],
    /// How much thicker the disc is than the one that is looked at; at least 1.
    thicker: f64,
}

impl Disc {
    /// A disc of so many mean free paths' radius.
    pub(crate) fn new(radius: f64) -> Self {
        let thicker = (radius / THICKEST).max(1.0);
        let radius = radius.min(THICKEST);
        let (mut escape, mut next) = ([0.0; RINGS], [[0.0; RINGS]; RINGS]);
        for (i, (escape, next)) in escape.iter_mut().zip(&mut next).enumerate() {
            let r2 = (i as f64 + 0.5) / RINGS as f64;
            for k in 0..DIRECTIONS {
                let out = r2.sqrt() * (PI * (k as f64 + 0.5) / DIRECTIONS as f64).cos();
                // To the rim, as shares of the radius.
                let length = (1.0 - r2 + out * out).sqrt() - out;
                let met = -(-radius * length).exp_m1();
                *escape += (1.0 - met) / DIRECTIONS as f64;
                for m in 0..PLACES {
                    let u = (m as f64 + 0.5) / PLACES as f64;
                    // Evenly spaced in what is met, also where next to nothing is.
                    let s = if met > 1e-9 { -(-u * met).ln_1p() / radius } else { u * length };
                    let ring = ((r2 + s * (s + 2.0 * out)) * RINGS as f64) as usize;
                    next[ring.min(RINGS - 1)] += met / (DIRECTIONS * PLACES) as f64;
                }
            }
        }
        Self { escape, next, thicker }
    }

    /// The same for what is `own` wide, see [`past_itself`], if of what leaves the share `taken_back` returns.
    fn closed(&self, own: f64, taken_back: f64) -> Self {
        let mut disc = self.clone();
        for (escape, next) in disc.escape.iter_mut().zip(&mut disc.next) {
            let out = past_itself(*escape, own) * (1.0 - taken_back);
            let rest = if *escape < 1.0 { (1.0 - out) / (1.0 - *escape) } else { 0.0 };
            *escape = out;
            next.iter_mut().for_each(|chance| *chance *= rest);
        }
        disc
    }

    /// The mean escape over the disc.
    #[cfg(test)]
    fn mean_escape(&self) -> f64 {
        self.escape.iter().sum::<f64>() / RINGS as f64
    }

    /// Of light that meets something in each ring, the share that leaves at last if each meeting keeps the share `albedo`.
    fn leaving(&self, albedo: f64) -> [f64; RINGS] {
        // L = albedo (escape + next L), ring after ring from the axis on. What each ring gives away is summed, never taken from
        // one: no digits are lost where nearly all stays.
        let mut moves = self.next.map(|row| row.map(|chance| albedo * chance));
        let mut left = self.escape.map(|escape| albedo * escape);
        let mut lost = [1.0 - albedo; RINGS];
        let mut given = [0.0; RINGS];
        for i in 0..RINGS {
            given[i] = moves[i][i + 1..].iter().sum::<f64>() + left[i] + lost[i];
            if given[i] <= 0.0 && i + 1 < RINGS {
                // Ways are shorter than a ring is wide.
                (given[i], moves[i][i + 1]) = (1.0, 1.0);
            }
            let (done, later) = moves.split_at_mut(i + 1);
            for (k, row) in later.iter_mut().enumerate().map(|(k, row)| (i + 1 + k, row)) {
                let by = row[i] / given[i];
                row.iter_mut().zip(&done[i]).skip(i + 1).for_each(|(to, on)| *to += by * on);
                left[k] += by * left[i];
                lost[k] += by * lost[i];
            }
        }
        let mut out = [0.0; RINGS];
        for i in (0..RINGS).rev() {
            let moved: f64 = (i + 1..RINGS).map(|j| moves[i][j] * out[j]).sum();
            out[i] = ((left[i] + moved) / given[i].max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        }
        out
    }

    /// Of light that comes from the middle of each ring, or from the rim, and meets something, and of light that enters from all
    /// sides: the share that leaves at last. `own` and `taken_back` as in `closed`.
    pub(crate) fn shares(&self, albedo: f64, own: f64, taken_back: f64) -> ([f64; RINGS + 1], f64) {
        let closed = self.closed(own, taken_back);
        let leaving = closed.leaving(albedo);
        let mean = |weights: &[f64; RINGS]| {
            let sum: f64 = weights.iter().sum();
            let all: f64 = weights.iter().zip(leaving).map(|(weight, share)| weight * share).sum();
            if sum > 0.0 { all / sum } else { leaving[RINGS - 1] }
        };
        let of_rings = closed.next.each_ref().map(mean);
        let [before, last] = [of_rings[RINGS - 2], of_rings[RINGS - 1]];
        let rim = (last + 0.5 * (last - before)).clamp(0.0, 1.0);
        let shares: [f64; RINGS + 1] = std::array::from_fn(|i| of_rings.get(i).copied().unwrap_or(rim));
        // As deep below the rim as in the disc that was looked at.
        let deep = |i: usize| {
            let r = ((i as f64 + 0.5) / RINGS as f64).min(1.0).sqrt();
            at(&shares, (1.0 - (1.0 - r) * self.thicker).max(0.0).powi(2))
        };
        // What enters is met where what leaves would come from.
        (if self.thicker > 1.0 { std::array::from_fn(deep) } else { shares }, mean(&self.escape))
    }
}

/// Where a square distance from the axis is between two of [`Disc::shares`], and how far.
#[inline]
pub(crate) fn between(r2: f32) -> (usize, f32) {
    let at = (r2 * RINGS as f32 - 0.5).clamp(0.0, RINGS as f32 - 0.5);
    let ring = (at as usize).min(RINGS - 1);
    // From the last ring to the rim it is half as far as from ring to ring.
    (ring, (at - ring as f32) * if ring + 1 == RINGS { 2.0 } else { 1.0 })
}

fn at(shares: &[f64; RINGS + 1], r2: f64) -> f64 {
    let (ring, share) = between(r2 as f32);
    shares[ring] + (shares[ring + 1] - shares[ring]) * f64::from(share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::special::escape_probability_of_disc;

    #[test]
    fn a_disc_loses_nothing_that_is_not_absorbed() {
        for radius in [1e-6, 0.1, 1.0, 4.0, 20.0, 200.0, 1e9] {
            for (own, back) in [(0.0, 0.0), (0.3, 0.2)] {
                let disc = Disc::new(radius);
                let closed = disc.closed(own, back);
                for (escape, next) in closed.escape.iter().zip(&closed.next) {
                    assert!((escape + next.iter().sum::<f64>() - 1.0).abs() < 1e-9, "radius {radius}");
                }
                let (shares, entering) = disc.shares(1.0, own, back);
                assert!(
                    shares.iter().chain([&entering]).all(|s| (s - 1.0).abs() < 1e-6),
                    "radius {radius}: {shares:?}"
                );
                assert_eq!(disc.shares(0.0, own, back).1, 0.0);
            }
        }
    }

    #[test]
    fn the_escape_of_all_rings_is_that_of_the_disc() {
        for radius in [0.1, 0.5, 1.0, 2.0, 4.0] {
            let (found, want) = (Disc::new(radius).mean_escape(), escape_probability_of_disc(radius));
            assert!((found / want - 1.0).abs() < 0.02, "radius {radius}: {found}, not {want}");
        }
    }

    #[test]
    fn more_leaves_from_the_rim_than_from_the_middle() {
        let (shares, entering) = Disc::new(4.0).shares(0.9, 0.0, 0.0);
        let (thick, _) = Disc::new(1e6).shares(0.9, 0.0, 0.0);
        assert!(thick[0] == thick[RINGS - 1] && thick[RINGS] > thick[0] + 0.3, "{thick:?}");
        assert!(shares.windows(2).all(|w| w[1] >= w[0] - 1e-3), "{shares:?}");
        assert!(shares[RINGS - 1] > 1.3 * shares[0] && entering > shares[RINGS / 2], "{shares:?}, {entering}");
    }
}
