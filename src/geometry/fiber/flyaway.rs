//! Fly-aways: hairs that end outside of the ply, and loops that leave it and come back (Zhao, Luan and Bala 2016, Sec. 4.2).
//!
//! They are curves of their own in every mode: what the aggregated model answers for lies inside the plies.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, Vec4};
use rayon::prelude::*;

use super::{Guide, Plies, point};
use crate::{
    geometry::{
        curve::Basis,
        tube::{Tubes, spline_through},
    },
    math::{
        sampler::{Stream, hash2},
        warp::normal,
    },
};

/// Mean and standard deviation.
pub type Spread = [f64; 2];

/// The fly-aways of a yarn. Lengths in yarn radii, counts for each ply and each yarn radius of its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flyaways {
    /// Number of hairs.
    pub hair_density: f64,
    /// Distance from the ply's axis at which a hair begins.
    pub hair_start: Spread,
    /// By how much it moves away from the axis.
    pub hair_rise: Spread,
    /// How far it goes along the ply, either way.
    pub hair_length: Spread,
    /// How far it turns around the ply, radians.
    pub hair_turn: Spread,
    /// Number of loops.
    pub loop_density: f64,
    /// Greatest distance of a loop from the ply's axis.
    pub loop_height: Spread,
    /// Turns of a fibre around the ply from one end of a loop to the other.
    pub loop_turns: f64,
}

impl Flyaways {
    /// The same with lengths in another unit, which is so many of the old ones.
    pub fn in_units_of(self, unit: f64) -> Self {
        let lengths = |spread: Spread| spread.map(|length| length / unit);
        Self {
            hair_density: self.hair_density * unit,
            hair_start: lengths(self.hair_start),
            hair_rise: lengths(self.hair_rise),
            hair_length: lengths(self.hair_length),
            loop_density: self.loop_density * unit,
            loop_height: lengths(self.loop_height),
            ..self
        }
    }
}

/// Points of a hair: it is nearly straight.
const HAIR_POINTS: usize = 9;
fn loop_points(of: &Flyaways) -> usize {
    (LOOP_POINTS * of.loop_turns.max(0.5)).ceil() as usize
}

/// Points of a loop for each of its turns.
const LOOP_POINTS: f64 = 14.0;

impl Plies<'_> {
    /// Control points and segments of all fly-aways to be expected.
    pub fn flyaway_counts(&self, of: &Flyaways) -> (u64, u64) {
        let length = |y| self.strands.length_of(y) / self.strands.mean_radius_of(y) * self.hairiness(y);
        let lengths = (0..self.strands.yarns()).map(length);
        let plies = self.plies.len() as f64 * lengths.sum::<f64>();
        let (hairs, loops) = (of.hair_density * plies, of.loop_density * plies);
        let knots = hairs * HAIR_POINTS as f64 + loops * loop_points(of) as f64;
        ((knots + 2.0 * (hairs + loops)) as u64, (knots - hairs - loops) as u64)
    }

    /// How many of the fly-aways of a yarn as thick a curve has: the strands that a yarn has opened into share its own, and no
    /// more, on each length of it.
    fn hairiness(&self, yarn: usize) -> f64 {
        /// Thinner than this share of the whole yarn is a strand.
        const STRAND: f64 = 0.6;
        match self.opened {
            Some((radius, strands)) if self.strands.mean_radius_of(yarn) < STRAND * radius => {
                self.strands.mean_radius_of(yarn) / (radius * strands)
            }
            _ => 1.0,
        }
    }

    /// The fly-aways of one ply in all yarns, the first of each yarn, and for each of them the yarn's segment from which
    /// it comes.
    pub fn flyaways(&self, ply: usize, of: &Flyaways) -> (Tubes, Vec<u32>, Vec<u32>) {
        let per_yarn: Vec<Vec<(Vec<Vec4>, u32)>> =
            (0..self.strands.yarns()).into_par_iter().map(|yarn| self.flyaways_of(yarn, ply, of)).collect();
        let mut first = Vec::with_capacity(per_yarn.len());
        let (mut all, mut segments) = (Vec::new(), Vec::new());
        for curves in per_yarn {
            first.push(all.len() as u32);
            for (curve, segment) in curves {
                all.push(curve);
                segments.push(segment);
            }
        }
        (Tubes::from_chains(Basis::BSpline, &all), first, segments)
    }

    fn flyaways_of(&self, yarn: usize, ply: usize, of: &Flyaways) -> Vec<(Vec<Vec4>, u32)> {
        let (parameters, shape) = (&self.plies[ply], &self.shape.plies[ply]);
        let guide = Guide::new(self.strands, yarn);
        let length = guide.length();
        let mut stream = Stream::new(hash2(hash2(self.seed ^ 0x5eed_f1a5, yarn as u32), ply as u32));
        let own_rate = f64::from(shape.fiber_rate - self.shape.ply_rate);
        let radius = parameters.fiber_radius as f32;
        let draw = |stream: &mut Stream, [mean, deviation]: Spread| {
            // Cut at three deviations: a hair a hundred radii long is an accident of numbers.
            mean + deviation * f64::from(normal(stream.next())).clamp(-3.0, 3.0)
        };
        let counted = length * self.hairiness(yarn);
        let count = |stream: &mut Stream, density: f64| (density * counted + f64::from(stream.next())).floor() as usize;
        let mut curves = Vec::new();
        let mut add = |path: &dyn Fn(f64) -> (f64, DVec2), points: usize| {
            let knots: Vec<_> = (0..points)
                .map(|i| {
                    let (along, at) = path(i as f64 / (points - 1) as f64);
                    let place = guide.frame_at(along);
                    let axis = self.axis(&place, shape);
                    let at = axis * (f64::from(shape.distance) + at.x) + axis.perp() * at.y;
                    (point(&place, at), place.round_radius())
                })
                .collect();
            let points: Vec<_> = knots.iter().map(|k| k.0).collect();
            curves.push((spline_through(&points, |i| knots[i].1 * radius), guide.segment_at(path(0.0).0)));
        };
        for _ in 0..count(&mut stream, of.hair_density) {
            let z = length * f64::from(stream.next());
            let angle = TAU * f64::from(stream.next());
            let start = draw(&mut stream, of.hair_start).clamp(0.0, parameters.radius);
            let [rise, run, turn] = [of.hair_rise, of.hair_length, of.hair_turn].map(|s| draw(&mut stream, s));
            let sign = if stream.next() < 0.5 { -1.0 } else { 1.0 };
            add(
                &|t| {
                    let along = z + sign * run * t;
                    // Bent as the fibres under it are.
                    let turned = angle + turn * t + own_rate * (along - z);
                    ((along).clamp(0.0, length), DVec2::from_angle(turned) * (start + rise * t).max(0.0))
                },
                HAIR_POINTS,
            );
        }
        let turns = of.loop_turns;
        let run = turns * TAU / own_rate.abs().max(0.1);
        for _ in 0..count(&mut stream, of.loop_density) {
            let z = (length - run).max(0.0) * f64::from(stream.next());
            let angle = TAU * f64::from(stream.next());
            let inside = parameters.radius * (0.7 + 0.25 * f64::from(stream.next()));
            let height = draw(&mut stream, of.loop_height).max(inside);
            add(
                &|t| {
                    let along = (z + run * t).min(length);
                    let r = inside + (height - inside) * (PI * t).sin().powi(2);
                    (along, DVec2::from_angle(angle + own_rate * run * t) * r)
                },
                loop_points(of),
            );
        }
        curves
    }
}
