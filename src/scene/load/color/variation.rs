//! How yarns of a fabric differ from each other: thickness, phase, colour.

use crate::{
    math::{
        sampler::{Stream, hash2},
        warp::normal,
    },
    scene::Fabric,
};

/// Shades that variation draws yarns from, all as likely: a model is made for each.
pub(super) const SHADES: u32 = 32;
/// Deviation of normal numbers that stand in the middle of so many parts.
const SPREAD: f32 = 0.980_384;

/// How much yarns differ; standard deviations.
#[derive(Clone, Copy)]
pub(super) struct Variation {
    pub(super) seed: u32,
    /// Of the radius, relative.
    pub(super) radius: f64,
    /// Of the phase, radians.
    pub(super) phase: f64,
    /// Of the colour, relative.
    pub(super) color: f64,
    /// Of the size of loops, on garments.
    pub(super) tension: f64,
}

impl Variation {
    pub(super) fn apply(self, fabric: &mut Fabric) {
        let count = fabric.curves.len();
        let deviate = |index: usize, what: u32| {
            f64::from(normal(Stream::new(hash2(hash2(self.seed, index as u32), what)).next()))
        };
        if self.radius > 0.0 {
            for (index, (_, radii)) in fabric.curves.iter_mut().enumerate() {
                // Never thinner than a fifth, however wide the spread.
                let factor = (1.0 + self.radius * deviate(index, 1)).max(0.2);
                radii.iter_mut().for_each(|r| *r *= factor);
            }
        }
        if self.phase > 0.0 && !fabric.phases.is_empty() {
            let given = std::mem::take(&mut fabric.phases);
            fabric.phases = (0..count).map(|i| given[i % given.len()] + self.phase * deviate(i, 2)).collect();
        }
    }
}

/// The brightness of a shade, mean 1.
pub(super) fn shine(variation: Variation, shade: u32) -> f32 {
    let z = normal((shade as f32 + 0.5) / SHADES as f32);
    (1.0 + variation.color as f32 * z / SPREAD).max(0.0)
}
