//! When a render ends, and the waves in which it gets there.

/// Why a render ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// All samples were taken.
    Samples,
    /// The time was over.
    Time,
    /// The estimated noise was low enough.
    Noise,
    /// The user or the system asked.
    Interrupted,
}

impl Stop {
    /// In words, for statistics and metadata.
    pub fn name(self) -> &'static str {
        match self {
            Self::Samples => "spp",
            Self::Time => "time",
            Self::Noise => "noise",
            Self::Interrupted => "interrupted",
        }
    }
}

/// Samples per pixel before the estimated noise is believed.
pub(super) const WARM_UP: u32 = 64;
/// Most samples per pixel of one wave.
const LARGEST_WAVE: u32 = 32;

/// The number of samples at which the wave ends that begins after `done`: 1, 2, 4 and so on, later in equal steps.
///
/// A fixed series, whatever the limits and wherever a render begins again: noise is looked at in the same places, and
/// a resumed render stops where one in a piece would.
pub(super) fn wave_end(done: u32) -> u32 {
    if done < LARGEST_WAVE {
        (done + 1).next_power_of_two()
    } else {
        (done / LARGEST_WAVE + 1).saturating_mul(LARGEST_WAVE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_end_in_the_same_places_from_wherever_they_begin() {
        let mut ends = vec![0];
        while ends[ends.len() - 1] < 200 {
            ends.push(wave_end(ends[ends.len() - 1]));
        }
        assert_eq!(ends, [0, 1, 2, 4, 8, 16, 32, 64, 96, 128, 160, 192, 224]);
        assert!(ends.contains(&WARM_UP));
        for done in 0..224 {
            let next = ends.iter().find(|&&e| e > done).unwrap();
            assert_eq!(wave_end(done), *next);
        }
        assert_eq!(wave_end(u32::MAX), u32::MAX);
    }
}
