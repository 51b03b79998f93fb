//! The smallest repeat of a whole cloth: drafts of weaving programs list every end and every pick.

use super::{Draft, DraftError};
use crate::pattern::period::period;

/// The most crossings of a repeat: relaxing a large one takes half a millisecond and 5 kB for each.
pub const MOST_CROSSINGS: usize = 512 * 512;

/// How the threads of one system differ: one value for each of the repeat, relative to their mean; empty where all are
/// alike.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Threads {
    /// Thickness.
    pub thickness: Vec<f64>,
    /// Room that each takes in the reed or in the fell.
    pub spacing: Vec<f64>,
}

impl Draft {
    /// The smallest repeat of a cloth: for each pick from the bottom, for each end from the left, whether the end is on
    /// top. `threads` are those of the whole cloth and become those of the repeat.
    ///
    /// # Errors
    /// A repeat of more than [`MOST_CROSSINGS`] crossings, or no crossing at all.
    pub fn repeat_of(over: &[Vec<bool>], threads: &mut [Threads; 2]) -> Result<Self, DraftError> {
        let (ends, picks) = (over.first().map_or(0, Vec::len), over.len());
        if ends == 0 || over.iter().any(|row| row.len() != ends) {
            let problem = "a draft without crossings".to_owned();
            return Err(DraftError { problem, hint: "every pick crosses every end".to_owned() });
        }
        let same = |values: &[f64], i: usize, j: usize| values.is_empty() || values[i] == values[j];
        let alike = |side: usize, i: usize, j: usize| {
            let Threads { thickness, spacing } = &threads[side];
            same(thickness, i, j) && same(spacing, i, j)
        };
        let warps = period(ends, |i, j| alike(0, i, j) && over.iter().all(|row| row[i] == row[j]));
        let wefts = period(picks, |i, j| alike(1, i, j) && over[i] == over[j]);
        let draft = Self::from_fn(warps, wefts, |weft, warp| over[weft][warp]).limited()?;
        for (threads, count) in threads.iter_mut().zip([warps, wefts]) {
            for values in [&mut threads.thickness, &mut threads.spacing] {
                values.truncate(count);
                relative(values);
            }
        }
        Ok(draft)
    }
}

/// Values over their mean; none where all are the same.
fn relative(values: &mut Vec<f64>) {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    if values.iter().all(|v| (v - mean).abs() <= 1e-6 * mean) {
        values.clear();
    }
    values.iter_mut().for_each(|v| *v /= mean);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cloth_is_its_repeat() {
        let twill = Draft::named("twill 2/2").unwrap();
        // 10 x 9 threads are no whole number of repeats.
        let over: Vec<Vec<bool>> = (0..9).map(|i| (0..10).map(|j| twill.warp_over(i, j)).collect()).collect();
        let mut threads = [Threads::default(), Threads::default()];
        assert_eq!(Draft::repeat_of(&over, &mut threads).unwrap(), twill);
        // Thick ends in turns with thin ones, twice as many as the twill has.
        let thickness = |i: usize| if i.is_multiple_of(5) { 3.0 } else { 1.0 };
        threads[0].thickness = (0..10).map(thickness).collect();
        threads[1].spacing = vec![0.7; 9];
        let draft = Draft::repeat_of(&over, &mut threads).unwrap();
        assert_eq!((draft.warps(), draft.wefts()), (10, 4));
        assert!((threads[0].thickness[0] - 3.0 / 1.4).abs() < 1e-12 && threads[0].thickness.len() == 10);
        assert!(threads[1].spacing.is_empty());
    }

    #[test]
    fn what_never_repeats_is_whole_or_too_large() {
        let noise = |i: usize, j: usize| (i * i * 31 + j * j * 17 + i * j) % 7 < 3;
        let over = |n: usize| -> Vec<Vec<bool>> { (0..n).map(|i| (0..n).map(|j| noise(i, i * j)).collect()).collect() };
        let mut threads = [Threads::default(), Threads::default()];
        assert_eq!(Draft::repeat_of(&over(6), &mut threads).unwrap().warps(), 6);
        let scrambled: Vec<Vec<bool>> =
            (0..600u32).map(|i| (0..600u32).map(|j| crate::math::sampler::hash2(i, j) & 1 == 1).collect()).collect();
        let error = Draft::repeat_of(&scrambled, &mut threads).unwrap_err();
        assert!(error.problem.contains("600 ends x 600 picks"), "{error}");
        assert!(Draft::repeat_of(&[], &mut threads).is_err());
    }
}
