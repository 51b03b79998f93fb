//! A line through the discs of a section.

use std::f64::consts::TAU;

use glam::DVec2;

use super::lines::Lines;
use crate::math::sampler::Stream;

/// Its direction, and how far beside the middle it is.
pub(super) struct Line<'a> {
    pub(super) discs: &'a [DVec2],
    pub(super) along: DVec2,
    pub(super) offset: f64,
}

/// A fibre on a line: where the line enters it, and where it is abreast of its centre.
pub(super) struct Hit {
    pub(super) fiber: usize,
    pub(super) enter: f64,
    pub(super) lies: f64,
}

impl<'a> Line<'a> {
    /// One of all that may meet a disc, or of those in a direction.
    pub(super) fn random(lines: &Lines, discs: &'a [DVec2], along: Option<DVec2>, stream: &mut Stream) -> Self {
        let along = along.unwrap_or_else(|| DVec2::from_angle(TAU * f64::from(stream.next())));
        let offset = (2.0 * f64::from(stream.next()) - 1.0) * (lines.reach(along.perp()) + lines.radius);
        Self { discs, along, offset }
    }

    /// The fibres on it.
    pub(super) fn hits(&self, lines: &Lines) -> Vec<Hit> {
        let across = self.along.perp();
        let hit = |(fiber, disc): (usize, &DVec2)| {
            let off = disc.dot(across) - self.offset;
            let half = lines.radius * lines.slopes.half_width(*disc, across);
            let lies = disc.dot(self.along);
            let enter = lies - lines.radius * (1.0 - (off / half).powi(2)).sqrt();
            (off.abs() < half).then_some(Hit { fiber, enter, lies })
        };
        self.discs.iter().enumerate().filter_map(hit).collect()
    }
}
