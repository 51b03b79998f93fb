//! Loops of terry: how they stand up, and how thick they are where they are free.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::{Standing, find_room};
use crate::{
    geometry::contact::{PointGrid, nearest},
    math::special::smooth_step,
};

/// Half the width of a loop at its top, from axis to axis, and half the distance of its legs where they cross; in radii of the yarn.
const TOP: f64 = 1.9;
const WAIST: f64 = 1.35;
/// Where legs have come together, where they have crossed and where they begin to part, in heights of the loop.
const TOGETHER: f64 = 0.22;
const CROSSED: f64 = 0.7;
const PART: f64 = 0.5;
/// Points at which a loop's shape is computed, before points are set at even distances.
const FINE: usize = 96;

/// How much thicker loops are than the yarn in the ground where nothing is near, at most, and how much thinner where others press
/// them.
const BLOOM: f64 = 1.45;
const PRESSED: f64 = 0.88;
/// Rounds in which loops that have opened find room beside each other.
const ROUNDS: usize = 60;
/// How thick they are meanwhile, and how much of each stays by the ground, in diameters of the yarn.
const THICK: f64 = 1.4;
const HELD: f64 = 1.0;
/// Distance from the ground on a loop up to which its yarn opens, in diameters.
const OPENS: f64 = 2.0;
/// Along a yarn, nearer than this is not another strand, in diameters.
const ALONG: f64 = 2.4;
/// A spline comes nearer than its points by so much.
const SPARE: f64 = 0.98;

/// A loop to be made. Lengths are those of the cloth.
pub(super) struct Arch {
    pub(super) feet: [DVec3; 2],
    /// Unit vector away from the ground.
    pub(super) up: DVec3,
    pub(super) radius: f64,
    /// Along its axis.
    pub(super) height: f64,
    /// Unit vector to the side it bends over to, at right angles to `up`.
    pub(super) side: DVec3,
    /// By how much it has bent over at its top, radians.
    pub(super) bend: f64,
    /// By how much its top is turned about its axis, radians: by half a turn legs cross once.
    pub(super) turn: f64,
}

impl Arch {
    /// Places from the first foot to the second, without both, about `step` apart.
    pub(super) fn points(&self, step: f64) -> Vec<DVec3> {
        let fine: Vec<DVec3> = (0..=FINE).map(|k| self.at(k as f64 / FINE as f64)).collect();
        let length: f64 = fine.windows(2).map(|w| w[0].distance(w[1])).sum();
        let count = (length / step).ceil().max(6.0) as usize;
        let (mut gone, mut next, mut made) = (0.0, 1, Vec::with_capacity(count));
        for pair in fine.windows(2) {
            let piece = pair[0].distance(pair[1]);
            while next < count && gone + piece >= length * next as f64 / count as f64 {
                let s = (length * next as f64 / count as f64 - gone) / piece.max(1e-12);
                made.push(pair[0].lerp(pair[1], s));
                next += 1;
            }
            gone += piece;
        }
        made
    }

    /// A place on it, from 0 at the first foot to 1 at the second.
    fn at(&self, s: f64) -> DVec3 {
        let [a, b] = self.feet;
        let middle = 0.5 * (a + b);
        let (top, waist) = (TOP * self.radius, WAIST * self.radius);
        let half = 0.5 * a.distance(b);
        // The top is half a circle; legs have what is left of the height.
        let stem = (self.height - top).max(0.3 * self.height);
        let cap = PI * top / (2.0 * stem + PI * top);
        let leg = 0.5 * (1.0 - cap);
        let side = if s < 0.5 { -1.0 } else { 1.0 };
        let from_foot = s.min(1.0 - s);
        // Height on the axis, and distance from it.
        let (high, aside) = if from_foot < leg {
            let high = stem * from_foot / leg;
            let v = high / self.height;
            let foot = half + (waist - half) * smooth_step(v / TOGETHER);
            let end = stem / self.height;
            (high, foot + (top - waist) * smooth_step((v - PART) / (end - PART).max(1e-6)))
        } else {
            let angle = 0.5 * PI * (from_foot - leg) / (0.5 - leg);
            (stem + (self.height - stem) * angle.sin(), top * angle.cos())
        };
        let v = high / self.height;
        let turned = self.turn * smooth_step((v - 0.5 * TOGETHER) / (CROSSED - 0.5 * TOGETHER));
        // The axis is an arc of a circle.
        let bent = self.bend.max(1e-3);
        let (bent_sin, bent_cos) = (bent * v).sin_cos();
        let bend = (self.up * bent_sin + self.side * (1.0 - bent_cos)) * (self.height / bent);
        let axis = self.up * bent_cos + self.side * bent_sin;
        let along = (b - a - (b - a).dot(axis) * axis).normalize_or(DVec3::X);
        let across = axis.cross(along);
        let (sin, cos) = turned.sin_cos();
        let rise = (b - a).dot(self.up) * self.up * (0.5 * side * (1.0 - v));
        middle + rise + bend + (cos * along + sin * across) * (side * aside)
    }
}

/// A piece of a yarn.
struct Piece {
    yarn: usize,
    ends: [DVec3; 2],
    /// How far its middle is from the yarn's start.
    along: f64,
    /// Whether it is of the ground, which does not open.
    ground: bool,
}

/// Lets loops find room beside each other for what they are when they have opened.
pub(super) fn spread(yarns: &mut [Standing], diameter: f64) {
    let thick = THICK * diameter;
    // Which yarn, and which of its points: a loop, and its feet.
    let mut loops: Vec<(usize, Vec<usize>)> = Vec::new();
    for (yarn, standing) in yarns.iter().enumerate().filter(|(_, standing)| standing.opens()) {
        let count = standing.free.len();
        let mut first = 0;
        while let Some(start) = (first.max(1)..count).find(|&i| standing.free[i]) {
            first = (start..count).find(|&i| !standing.free[i]).unwrap_or(count);
            loops.push((yarn, (start - 1..(first + 1).min(count)).collect()));
        }
    }
    let far: Vec<Vec<f64>> = yarns.iter().map(|yarn| from_ground(&yarn.strand.curve.points, &yarn.free)).collect();
    let free = |yarn: usize, i: usize| far[yarn][i] > HELD * diameter;
    let ropes = loops.iter().map(|(yarn, places)| yarns[*yarn].rope(places, |i| free(*yarn, i), thick)).collect();
    find_room(yarns, &loops, ropes, thick, ROUNDS);
}

/// Lets loops open where they have room: each point of `yarns` that is free is as thick as what is near it leaves, half of
/// the way.
pub(super) fn bloom(yarns: &mut [Standing], diameter: f64) {
    let reach = BLOOM * diameter;
    let mut pieces: Vec<Piece> = Vec::new();
    let mut firsts = Vec::new();
    for (yarn, standing) in yarns.iter().enumerate() {
        firsts.push(pieces.len());
        let mut gone = 0.0;
        for (i, pair) in standing.strand.curve.points.windows(2).enumerate() {
            let length = pair[0].distance(pair[1]);
            let ground = !standing.is_free(i) && !standing.is_free(i + 1);
            pieces.push(Piece { yarn, ends: [pair[0], pair[1]], along: gone + 0.5 * length, ground });
            gone += length;
        }
    }
    let middles: Vec<DVec3> = pieces.iter().map(|p| 0.5 * (p.ends[0] + p.ends[1])).collect();
    let longest = pieces.iter().map(|p| p.ends[0].distance(p.ends[1])).fold(0.0, f64::max);
    let grid = PointGrid::new(&middles, reach + longest, None);
    let room = |piece: usize| {
        let own = &pieces[piece];
        let mut room = reach;
        grid.walk().within(middles[piece], reach + longest, |other| {
            let other = &pieces[other.index as usize];
            if other.yarn != own.yarn || (other.along - own.along).abs() > ALONG * diameter {
                let [p0, p1] = own.ends;
                let apart = nearest(p0, p1, other.ends[0], other.ends[1]).between.length();
                room = room.min(if other.ground { 2.0 * apart - diameter } else { apart });
            }
        });
        room
    };
    yarns.par_iter_mut().zip(firsts).filter(|(yarn, _)| yarn.opens()).for_each(|(yarn, first)| {
        let Some(radii) = &mut yarn.strand.curve.radii else { return };
        let points = &yarn.strand.curve.points;
        let (last, free) = (points.len() - 1, &yarn.free);
        // The ground is pressed flat, and loops are not.
        let opened = from_ground(points, free).into_iter().map(|far| smooth_step(far / (OPENS * diameter)));
        let opened: Vec<f64> = opened.collect();
        let room: Vec<f64> =
            (0..last).map(|i| if free[i] || free[i + 1] { room(first + i) } else { diameter }).collect();
        let least: Vec<f64> = (0..=last)
            .map(|i| room[i.saturating_sub(2)..(i + 2).min(last)].iter().fold(reach, |a, &b| a.min(b)))
            .collect();
        for i in (0..=last).filter(|&i| free[i]) {
            let around = &least[i.saturating_sub(2)..(i + 3).min(last + 1)];
            let room = SPARE * around.iter().sum::<f64>() / around.len() as f64;
            let room = room.min(least[i]).clamp(PRESSED * diameter, reach);
            radii[i] *= 1.0 + (room / diameter - 1.0) * if room > diameter { opened[i] } else { 1.0 };
        }
    });
}

/// For each point how far it is on its loop from the nearer foot: 0 in the ground.
fn from_ground(points: &[DVec3], free: &[bool]) -> Vec<f64> {
    let mut far = vec![f64::INFINITY; points.len()];
    let mut walk = |order: &mut dyn Iterator<Item = usize>| {
        let (mut gone, mut before) = (0.0, None);
        for i in order {
            gone = match before {
                Some(k) if free.get(i) == Some(&true) => gone + points[i].distance(points[k]),
                _ => 0.0,
            };
            far[i] = far[i].min(gone);
            before = Some(i);
        }
    };
    walk(&mut (0..points.len()));
    walk(&mut (0..points.len()).rev());
    far
}
