//! Discs at random in a circle that do not overlap.

mod after;
mod first;
mod line;
mod lines;
mod measure;
#[cfg(test)]
mod tests;

use std::f64::consts::TAU;

use glam::DVec2;

pub use self::measure::measured;
pub use super::slopes::DENSEST;
use super::slopes::{Slopes, Twist};
use crate::math::sampler::Stream;

/// Centres of `count` discs of radius `radius` in a ply, in units of the core radius, within which the centres lie: even
/// over the core as far as discs that do not overlap can be. Where they do not fit they overlap as little as possible.
///
/// Discs are put down at random one after the other where there is room (random sequential addition). Where one finds none,
/// above an area fraction of about 0.4, all are put down anywhere instead and pushed apart. Neither crowds discs at the
/// outline, as a random walk to the equilibrium of hard discs would.
///
/// Discs of fibres that lean against the section are the ellipses in which it cuts them.
pub fn hard_discs(count: u32, radius: f64, twist: Twist, stream: &mut Stream) -> Vec<DVec2> {
    let share = radius / (1.0 + radius);
    leaning_discs(count, radius, &twist.scaled(twist.room(count, share)).in_core(share), stream)
}

/// [`hard_discs`] of fibres with known slopes at places in core radii.
pub(super) fn leaning_discs(count: u32, radius: f64, slopes: &Slopes, stream: &mut Stream) -> Vec<DVec2> {
    put_down(count, 2.0 * radius, slopes, stream).unwrap_or_else(|| {
        let mut centres: Vec<DVec2> = (0..count).map(|_| anywhere(stream)).collect();
        push_apart(&mut centres, 2.0 * radius, slopes);
        centres
    })
}

/// A point of the unit disc.
fn anywhere(stream: &mut Stream) -> DVec2 {
    f64::from(stream.next()).sqrt() * DVec2::from_angle(TAU * f64::from(stream.next()))
}

/// Random sequential addition; `None` if a disc finds no room.
fn put_down(count: u32, diameter: f64, slopes: &Slopes, stream: &mut Stream) -> Option<Vec<DVec2>> {
    let mut centres: Vec<DVec2> = Vec::with_capacity(count as usize);
    let mut grid = DiscGrid::new(count as usize, diameter * slopes.longest(1.0));
    for disc in 0..count {
        let apart = |at: DVec2, other: DVec2| slopes.distance_squared(at, other) >= diameter * diameter;
        let free = |at: &DVec2| grid.near(*at).all(|j| apart(*at, centres[j]));
        let at = (0..TRIES).map(|_| anywhere(stream)).find(free)?;
        grid.add(disc, at);
        centres.push(at);
    }
    Some(centres)
}

/// How often a disc is put down before it counts as finding no room.
const TRIES: u32 = 2000;

/// A grid of cells as wide as a disc, over the unit disc.
pub(super) struct DiscGrid {
    cells: Vec<Vec<u32>>,
    side: i32,
    inverse: f64,
}

impl DiscGrid {
    pub(super) fn new(discs: usize, diameter: f64) -> Self {
        // No finer than a few discs to a cell, however thin they are.
        let width = diameter.max(2.0 / (discs as f64).sqrt().max(1.0));
        let side = (2.0 / width).ceil() as i32 + 2;
        Self { cells: vec![Vec::new(); (side * side) as usize], side, inverse: 1.0 / width }
    }

    pub(super) fn add(&mut self, disc: u32, at: DVec2) {
        let cell = self.cell(at);
        self.cells[cell].push(disc);
    }

    fn place(&self, at: DVec2) -> (i32, i32) {
        let k = |v: f64| (((v + 1.0) * self.inverse) as i32).clamp(0, self.side - 1);
        (k(at.x), k(at.y))
    }

    fn cell(&self, at: DVec2) -> usize {
        let (x, y) = self.place(at);
        (y * self.side + x) as usize
    }

    pub(super) fn near(&self, at: DVec2) -> impl Iterator<Item = usize> + '_ {
        let (x, y) = self.place(at);
        let range = |v: i32| (v - 1).max(0)..=(v + 1).min(self.side - 1);
        range(y)
            .flat_map(move |y| range(x).map(move |x| (y * self.side + x) as usize))
            .flat_map(|cell| self.cells[cell].iter().map(|&i| i as usize))
    }
}

/// Moves overlapping discs apart, each pair by half of what it overlaps, until none does or nothing more is gained.
fn push_apart(centres: &mut [DVec2], diameter: f64, slopes: &Slopes) {
    // A little farther than needed, or the last of them would take for ever.
    let wanted = diameter * 1.005;
    let reach = wanted * slopes.longest(1.0);
    for round in 0..3000 {
        let mut grid = DiscGrid::new(centres.len(), reach);
        for (i, &c) in centres.iter().enumerate() {
            grid.add(i as u32, c);
        }
        let mut worst = 0.0f64;
        let mut moves = vec![DVec2::ZERO; centres.len()];
        for (i, &c) in centres.iter().enumerate() {
            for j in grid.near(c) {
                if j == i {
                    continue;
                }
                let between = c - centres[j];
                let distance = slopes.distance_squared(c, centres[j]).sqrt();
                if distance < wanted {
                    let direction = if distance > 1e-12 { between / distance } else { DVec2::from_angle(i as f64) };
                    moves[i] += 0.5 * (wanted - distance) * direction;
                    worst = worst.max(1.0 - distance / diameter);
                }
            }
        }
        if worst <= 0.0 && round > 0 {
            break;
        }
        for (c, m) in centres.iter_mut().zip(moves) {
            *c = (*c + m).clamp_length_max(1.0);
        }
    }
}
