//! A sample's light by where it came from: what compositors put together again.

use crate::{math::Rgb, scattering::LobeValues};

/// The parts of a sample's radiance. Everything seen is in exactly one of them, so their sum is the radiance.
///
/// Light is direct where it was scattered once on its way from the light to the camera, indirect where more often. It
/// belongs to the lobe of its first scattering at cloth, counted from the camera.
#[derive(Clone, Copy, Debug, Default)]
pub struct LightParts {
    /// Lights that the camera sees, unscattered.
    pub emission: Rgb,
    /// Scattered by other surfaces only, never by cloth: direct, indirect.
    pub surface: [Rgb; 2],
    /// Scattered by cloth: direct, indirect.
    pub lobes: [LobeValues; 2],
}

impl LightParts {
    /// Number of parts in [`Self::to_array`].
    pub const COUNT: usize = 13;

    /// Adds light that was scattered `events` times, and at cloth first with the shares `lobes`, if at all.
    #[inline]
    pub fn add(&mut self, events: u32, lobes: Option<&LobeValues>, light: Rgb) {
        match lobes {
            Some(shares) => self.lobes[indirect(events)] += shares.scaled(light),
            None if events == 0 => self.emission += light,
            None => self.surface[indirect(events)] += light,
        }
    }

    /// Adds light whose last scattering before the camera's path, number `events`, is its first at cloth.
    #[inline]
    pub fn add_lobes(&mut self, events: u32, found: LobeValues) {
        self.lobes[indirect(events)] += found;
    }

    /// Emission; surface direct, indirect; R, TT, D, F, B direct; the same indirect.
    #[inline]
    pub fn to_array(self) -> [Rgb; Self::COUNT] {
        let [direct, indirect] = self.lobes.map(LobeValues::to_array);
        let mut all = [Rgb::ZERO; Self::COUNT];
        all[0] = self.emission;
        all[1..3].copy_from_slice(&self.surface);
        all[3..8].copy_from_slice(&direct);
        all[8..].copy_from_slice(&indirect);
        all
    }
}

#[inline]
fn indirect(events: u32) -> usize {
    usize::from(events > 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_light_is_in_one_part() {
        let shares = LobeValues { r: Rgb::splat(0.25), b: Rgb::splat(0.75), ..LobeValues::default() };
        for (events, lobes, place) in
            [(0, None, 0), (1, None, 1), (2, None, 2), (1, Some(&shares), 3), (2, Some(&shares), 8), (9, None, 2)]
        {
            let mut parts = LightParts::default();
            parts.add(events, lobes, Rgb::splat(4.0));
            let all = parts.to_array().map(|c| c.max_channel());
            assert_eq!(all.iter().sum::<f32>(), 4.0);
            assert_eq!(all[place], if lobes.is_some() { 1.0 } else { 4.0 }, "{events} {all:?}");
        }
    }
}
