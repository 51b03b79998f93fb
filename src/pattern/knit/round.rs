//! The form of a tube: how wide its rounds are, and how it closes.

use std::f64::consts::TAU;

use glam::DVec2;

use super::super::{chart::ChartError, revolution::Revolution};
use crate::math::words;

/// The share of a round's height by which its radius differs from the next one's at most: cloth that widens faster would be flat
/// and then wave.
const STEEPEST: f64 = 0.95;
/// Rounds to each side over which the radius is evened out, for cloth that resists bending.
const REACH: usize = 4;

/// What each round of a tube would be wide by itself, from the first one on.
pub(super) struct Rounds<'a> {
    /// Width of a stitch, in diameters.
    pub(super) widths: &'a [f64],
    /// Stitches.
    pub(super) counts: Vec<usize>,
    /// Height of a round, in diameters.
    pub(super) height: f64,
    /// Radius of the ring to which the last round is drawn together, if it is.
    pub(super) ring: Option<f64>,
}

impl Rounds<'_> {
    /// The tube, as high along its profile as its rounds together: each is as wide as its stitches make it, as far as its neighbours
    /// let it.
    ///
    /// # Errors
    /// It has too few rounds to be drawn together.
    pub(super) fn tube(&self) -> Result<Revolution, ChartError> {
        let rounds = self.counts.len();
        let (height, high) = (self.height, self.height * rounds as f64);
        let own: Vec<f64> =
            self.counts.iter().zip(self.widths).map(|(count, width)| *count as f64 * width / TAU).collect();
        let even = own.iter().all(|radius| *radius == own[0]);
        if even && self.ring.is_none() {
            return Ok(Revolution::new(&[DVec2::new(own[0], 0.0), DVec2::new(own[0], high)]));
        }
        let mut radii = no_steeper(&own, STEEPEST * height);
        if let Some(ring) = self.ring {
            let most = |round: usize| ring + STEEPEST * height * ((rounds - round) as f64 - 0.5);
            if radii[0] > most(0) {
                let widest = own.iter().copied().fold(0.0, f64::max);
                let least = ((widest - ring) / (STEEPEST * height)).ceil() + 1.0;
                let rows = words::counted(rounds as u64, "row");
                let problem = format!("a tube of {rows} is too short to be drawn together");
                return Err(ChartError::new(None, problem, format!("{least} rows or more")));
            }
            radii.iter_mut().enumerate().for_each(|(round, radius)| *radius = radius.min(most(round)));
        }
        let mut radii = evened(&radii);
        // From the cast-on edge to the middle of the first round, and from that of the last to the upper edge.
        radii.insert(0, radii[0]);
        radii.push(self.ring.unwrap_or(radii[rounds]));
        let mut at = DVec2::new(radii[0], 0.0);
        let mut profile = vec![at];
        for (k, &radius) in radii.iter().enumerate().skip(1) {
            let along = if k == 1 || k > rounds { 0.5 * height } else { height };
            let rise = (along * along - (radius - at.x).powi(2)).max(0.0).sqrt();
            at = DVec2::new(radius, at.y + rise);
            profile.push(at);
        }
        Ok(Revolution::new(&profile))
    }
}

/// Values of which none differs from the one before by more than `most`: half way between the least such that are not below and the
/// greatest that are not above.
fn no_steeper(values: &[f64], most: f64) -> Vec<f64> {
    let envelope = |sign: f64| {
        let mut bound: Vec<f64> = values.iter().map(|v| sign * v).collect();
        for i in 1..bound.len() {
            bound[i] = bound[i].max(bound[i - 1] - most);
        }
        for i in (1..bound.len()).rev() {
            bound[i - 1] = bound[i - 1].max(bound[i] - most);
        }
        bound.into_iter().map(move |v| sign * v)
    };
    envelope(1.0).zip(envelope(-1.0)).map(|(above, below)| 0.5 * (above + below)).collect()
}

/// Means over the same number of values to each side.
fn evened(values: &[f64]) -> Vec<f64> {
    let mean = |i: usize| {
        let reach = REACH.min(i).min(values.len() - 1 - i);
        values[i - reach..=i + reach].iter().sum::<f64>() / (2 * reach + 1) as f64
    };
    (0..values.len()).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rounds(counts: Vec<usize>, ring: Option<f64>, widths: &[f64]) -> Rounds<'_> {
        Rounds { widths, counts, height: 3.0, ring }
    }

    #[test]
    fn a_tube_is_as_wide_as_its_stitches() {
        let widths = [4.0; 60];
        let counts: Vec<usize> = (0..60).map(|round| 40 + round / 3).collect();
        let tube = rounds(counts.clone(), None, &widths).tube().unwrap();
        assert!((tube.length() / 180.0 - 1.0).abs() < 1e-3, "{}", tube.length());
        for (round, count) in counts.iter().enumerate().skip(3).take(54) {
            let (radius, own) = (tube.radius((round as f64 + 0.5) * 3.0), *count as f64 * 4.0 / TAU);
            assert!((radius / own - 1.0).abs() < 0.02, "round {round}: {radius} for {own}");
        }
    }

    #[test]
    fn what_narrows_at_once_goes_over_within_some_rounds() {
        let counts: Vec<usize> = (0..40).map(|round| if round < 20 { 80 } else { 40 }).collect();
        let tube = rounds(counts, None, &[4.0; 40]).tube().unwrap();
        let radius = |round: usize| tube.radius((round as f64 + 0.5) * 3.0);
        assert!((radius(2) - 80.0 * 4.0 / TAU).abs() < 0.1 && (radius(38) - 40.0 * 4.0 / TAU).abs() < 0.1);
        for round in 1..40 {
            assert!((radius(round) - radius(round - 1)).abs() < 3.0, "{round}");
        }
    }

    #[test]
    fn a_tube_that_is_drawn_together_ends_at_its_ring() {
        let tube = rounds(vec![16; 12], Some(3.5), &[4.0; 12]).tube().unwrap();
        assert!((tube.radius(tube.length()) - 3.5).abs() < 1e-6);
        assert!((tube.radius(3.0) - 16.0 * 4.0 / TAU).abs() < 1e-6);
        let short = rounds(vec![16; 2], Some(3.5), &[4.0; 2]).tube().unwrap_err();
        assert_eq!(short.problem, "a tube of 2 rows is too short to be drawn together");
        assert_eq!(short.hint, "4 rows or more");
        assert!(rounds(vec![16; 4], Some(3.5), &[4.0; 4]).tube().is_ok());
        // Halved every other round: so flat a crown would wave.
        let counts = vec![64, 64, 32, 32, 16, 16, 8];
        let flat = rounds(counts, Some(2.3), &[4.0; 7]).tube().unwrap_err();
        assert_eq!(flat.hint, "15 rows or more");
    }
}
