//! Colours that come with a draft or a curve file: a dye for each yarn, times what its fibres let through or scatter.

use std::collections::HashMap;

use glam::Vec3;

use crate::{math::srgb::srgb_to_linear, pattern::StrandKind};

/// Colours of a fabric's yarns.
#[derive(Default)]
pub(super) struct Dyes {
    /// Linear, each once.
    palette: Vec<Vec3>,
    numbers: HashMap<[u32; 3], u32>,
    by: By,
}

/// Which yarn has which of the palette.
enum By {
    /// Warps from the left and wefts from the bottom, in turns.
    Thread([Vec<u32>; 2]),
    /// Curves, as they come.
    Curve(Vec<Option<u32>>),
}

impl Default for By {
    fn default() -> Self {
        Self::Curve(Vec::new())
    }
}

impl Dyes {
    /// Of warps and wefts, sRGB; `None` where neither has colours.
    pub(super) fn of_threads(colors: &[Vec<[f64; 3]>; 2]) -> Option<Self> {
        let mut dyes = Self::default();
        let linear = |c: &[f64; 3]| c.map(|v| srgb_to_linear(v as f32));
        dyes.by = By::Thread([0, 1].map(|side| colors[side].iter().map(|c| dyes.number(linear(c))).collect()));
        (!dyes.palette.is_empty()).then_some(dyes)
    }

    /// Of the curves of a file, linear; `None` where none has a colour.
    pub(super) fn of_curves(colors: &[Option<[f32; 3]>]) -> Option<Self> {
        let mut dyes = Self::default();
        dyes.by = By::Curve(colors.iter().map(|c| c.map(|c| dyes.number(c))).collect());
        (!dyes.palette.is_empty()).then_some(dyes)
    }

    fn number(&mut self, color: [f32; 3]) -> u32 {
        let next = self.palette.len() as u32;
        *self.numbers.entry(color.map(f32::to_bits)).or_insert_with(|| {
            self.palette.push(Vec3::from(color).max(Vec3::ZERO));
            next
        })
    }

    /// The number of the dye of a curve at a place in the cloth.
    pub(super) fn at(&self, curve: usize, kind: Option<StrandKind>, [x, y]: [f32; 2]) -> Option<u32> {
        match &self.by {
            By::Curve(numbers) => numbers.get(curve).copied().flatten(),
            By::Thread(sides) => {
                let (side, place) = if kind == Some(StrandKind::Warp) { (0, x) } else { (1, y) };
                let numbers = &sides[side];
                let count = numbers.len().max(1) as i64;
                numbers.get((place.floor() as i64).rem_euclid(count) as usize).copied()
            }
        }
    }

    /// Linear colour of a dye.
    pub(super) fn color(&self, number: Option<u32>) -> Vec3 {
        number.and_then(|n| self.palette.get(n as usize)).copied().unwrap_or(Vec3::ONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_take_their_colours_in_turns() {
        let dyes = Dyes::of_threads(&[vec![[1.0; 3], [0.0; 3]], vec![]]).unwrap();
        let warp = |x: f32| dyes.color(dyes.at(7, Some(StrandKind::Warp), [x, 0.5]));
        assert_eq!([warp(0.5), warp(1.5), warp(2.5), warp(-0.5)], [Vec3::ONE, Vec3::ZERO, Vec3::ONE, Vec3::ZERO]);
        // The other side has none.
        assert_eq!(dyes.at(0, Some(StrandKind::Weft), [0.5; 2]), None);
        assert!(Dyes::of_threads(&[vec![], vec![]]).is_none());
    }

    #[test]
    fn curves_keep_theirs() {
        let dyes = Dyes::of_curves(&[None, Some([0.5, 0.0, 1.0]), Some([0.5, 0.0, 1.0])]).unwrap();
        assert_eq!([0, 1, 2, 3].map(|i| dyes.at(i, None, [0.0; 2])), [None, Some(0), Some(0), None]);
        assert_eq!(dyes.color(Some(0)), Vec3::new(0.5, 0.0, 1.0));
    }
}
