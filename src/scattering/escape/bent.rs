//! Transport in an ellipse with the directions into which TT bends light: towards where light of a place leaves.

use std::f64::consts::TAU;

use wide::f32x8;

use super::{
    AZIMUTHS, Bends, Medium, Outgoing, RINGS, Spacing,
    flight::{CELLS, Flight, QUARTER, SECTORS, landing},
};
use crate::math::special::share_of_wrapped_normal;

/// Directions, one for each azimuth that is held, and places along each, that are looked at from every cell.
const DIRECTIONS: usize = AZIMUTHS;
const PLACES: usize = 12;
/// Events that are followed by direction. Light that is still inside goes on as that of which nobody knows where it came from.
const FOLLOWED: usize = 12;
/// Azimuths from the short axis to the long one, with both: for the others the section is mirrored.
const SOLVED: usize = AZIMUTHS / 4 + 1;

/// The half axes of a section of the area of a circle, in the unit of its radius.
fn axes(radius: f64, stretch: f64) -> [f64; 2] {
    [radius / stretch.sqrt(), radius * stretch.sqrt()]
}

/// Of a direction.
fn angle(k: usize) -> f64 {
    TAU * k as f64 / DIRECTIONS as f64
}

/// Of light that fibres send on.
#[derive(Debug)]
pub(super) struct Flights {
    /// All round.
    even: Ways,
    /// As TT of a chain, through the fibre, which keeps others off all that way.
    chain: Ways,
}

/// For each cell and direction: what leaves without meeting anything, and where something is met next, and how likely.
#[derive(Debug)]
struct Ways {
    escape: Vec<f32>,
    next: Vec<[(u16, f32); 4 * PLACES]>,
}

impl Flights {
    /// For fibres as [`Bends`] has them.
    pub(super) fn new(radius: f64, spacing: Spacing, stretch: f64) -> Self {
        let axes = axes(radius, stretch);
        let Spacing { lead, apart } = spacing;
        Self { even: Ways::new(axes, spacing), chain: Ways::new(axes, Spacing { lead, apart: apart + lead }) }
    }
}

impl Ways {
    fn new(axes: [f64; 2], spacing: Spacing) -> Self {
        let mut out = Self { escape: Vec::new(), next: Vec::new() };
        for cell in 0..CELLS {
            for k in 0..DIRECTIONS {
                let flight = Flight::new(cell, angle(k), axes, spacing);
                let mut next = [(0, 0.0); 4 * PLACES];
                for m in 0..PLACES {
                    let at = flight.at((m as f64 + 0.5) / PLACES as f64);
                    for (to, (cell, weight)) in next[4 * m..].iter_mut().zip(landing(at)) {
                        *to = (cell as u16, (flight.met * weight / PLACES as f64) as f32);
                    }
                }
                out.escape.push((1.0 - flight.met) as f32);
                out.next.push(next);
            }
        }
        out
    }
}

/// How likely TT of a chain turns light by each number of directions: a wrapped normal distribution, of any width, without what is the same all
/// round.
fn turns(sigma: f64, share: f64) -> [f32; DIRECTIONS] {
    let width = TAU / DIRECTIONS as f64;
    let part = |k: usize| share_of_wrapped_normal([-0.5, 0.5].map(|half| (k as f64 + half) * width), sigma);
    let parts: [f64; DIRECTIONS] = std::array::from_fn(part);
    let all: f64 = parts.iter().sum();
    let parts = parts.map(|part| (part / all - (1.0 - share) / DIRECTIONS as f64).max(0.0));
    let all: f64 = parts.iter().sum();
    parts.map(|part| (part / all) as f32)
}

/// Where to light leaves of each cell between the short axis and the long one, by [`QUARTER`] sectors and by rings: over what would go there if it
/// left evenly.
pub(super) struct Bent {
    /// Of light that meets something in the cell.
    pub(super) met: Vec<[f64; AZIMUTHS]>,
    /// Of light that goes on from there and is not counted as going straight out.
    pub(super) onward: Vec<[f64; AZIMUTHS]>,
}

/// `without` is what leaves of each cell towards an azimuth where no direction is known, of light that meets something there.
pub(super) fn solve(
    medium: &Medium,
    bends: &Bends,
    stretch: f64,
    flights: &Flights,
    without: impl Fn(usize, usize) -> f64,
) -> Bent {
    let turns = turns(bends.sigma, bends.share).map(|chance| f32x8::splat(bends.chain as f32 * chance));
    let even = f32x8::splat((bends.other / DIRECTIONS as f64) as f32);
    let lanes =
        |of: &dyn Fn(usize) -> f64| f32x8::new(std::array::from_fn(|k| if k < SOLVED { of(k) as f32 } else { 0.0 }));
    let kept = (bends.chain + bends.other).max(1e-12);
    // What leaves of light that meets something in a cell on its way in a direction.
    let mut met: Vec<f32x8> = Vec::with_capacity(CELLS * DIRECTIONS);
    for cell in 0..CELLS {
        let start = lanes(&|k| without(cell, k) / medium.albedo.max(1e-12) * kept * AZIMUTHS as f64);
        met.extend([start; DIRECTIONS]);
    }
    // Of light that goes on from there in one.
    let onward = |ways: &Ways, met: &[f32x8], onward: &mut Vec<f32x8>| {
        let ways = ways.escape.iter().zip(&ways.next).enumerate();
        let of = ways.map(|(i, (escape, next))| {
            let direction = i % DIRECTIONS;
            let out = lanes(&|k| if k == direction { f64::from(*escape) * AZIMUTHS as f64 } else { 0.0 });
            next.iter().fold(out, |sum, (cell, chance)| {
                sum + met[usize::from(*cell) * DIRECTIONS + direction] * f32x8::splat(*chance)
            })
        });
        onward.clear();
        onward.extend(of);
    };
    let [mut around, mut on] = [const { Vec::new() }; 2];
    for _ in 0..FOLLOWED {
        onward(&flights.even, &met, &mut around);
        onward(&flights.chain, &met, &mut on);
        let of_cells = around.chunks_exact(DIRECTIONS).zip(on.chunks_exact(DIRECTIONS));
        for (met, (around, on)) in met.chunks_exact_mut(DIRECTIONS).zip(of_cells) {
            let around = around.iter().fold(f32x8::ZERO, |sum, of| sum + *of) * even;
            for (k, met) in met.iter_mut().enumerate() {
                let of = turns.iter().enumerate();
                *met = of.fold(around, |sum, (turn, chance)| sum + on[(k + turn) % DIRECTIONS] * *chance);
            }
        }
    }
    // Light goes on evenly around from where the tables begin.
    onward(&flights.even, &met, &mut around);
    let mean: Vec<[f32; 8]> = around
        .chunks_exact(DIRECTIONS)
        .map(|onward| {
            (onward.iter().fold(f32x8::ZERO, |sum, of| sum + *of) / f32x8::splat(DIRECTIONS as f32)).to_array()
        })
        .collect();
    let half = SECTORS / 2;
    let towards = |ring: usize, sector: usize, k: usize| {
        // Mirrored about the axes, until it is between them.
        let (k, sector) = if 2 * k > AZIMUTHS { (AZIMUTHS - k, SECTORS - sector) } else { (k, sector) };
        let (k, sector) = if k >= SOLVED { (AZIMUTHS / 2 - k, half + SECTORS - sector) } else { (k, sector) };
        f64::from(mean[ring * SECTORS + sector % SECTORS][k])
    };
    let of_cell = |i: usize| {
        let (sector, ring) = (i / RINGS, i % RINGS);
        let all: [f64; AZIMUTHS] = std::array::from_fn(|k| towards(ring, sector, k));
        let axes = axes(medium.radius, stretch);
        let straight = |k| 1.0 - Flight::new(ring * SECTORS + sector, angle(k), axes, medium.spacing).met;
        let rest = std::array::from_fn(|k| all[k] - straight(k));
        (Outgoing::new(1.0, all).azimuths, Outgoing::new(1.0, rest).azimuths)
    };
    let (met, onward) = (0..QUARTER * RINGS).map(of_cell).unzip();
    Bent { met, onward }
}
