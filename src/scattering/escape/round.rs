//! Transport in a circle: each harmonic of the azimuth for itself.

use std::f64::consts::PI;

use super::{
    AZIMUTHS, Medium, Outgoing, RINGS, Solutions, Solved, bent,
    flight::{Flight, SECTORS},
    linear,
};

/// Directions, and places along each, that are looked at from every ring.
const DIRECTIONS: usize = 24;
const PLACES: usize = 16;
/// Harmonics that are looked at, and the even part.
const HARMONICS: usize = 9;

/// For each harmonic and ring: what leaves without meeting anything, and what meets something next in each other ring.
struct Transport {
    escape: [[f64; RINGS]; HARMONICS],
    next: [[[f64; RINGS]; RINGS]; HARMONICS],
}

impl Transport {
    fn new(medium: &Medium) -> Self {
        let mut out = Self { escape: [[0.0; RINGS]; HARMONICS], next: [[[0.0; RINGS]; RINGS]; HARMONICS] };
        for i in 0..RINGS {
            for k in 0..DIRECTIONS {
                let angle = PI * (k as f64 + 0.5) / DIRECTIONS as f64;
                let flight = Flight::new(i * SECTORS, angle, [medium.radius; 2], medium.spacing);
                let escape = (1.0 - flight.met) / DIRECTIONS as f64;
                harmonics(angle.cos()).zip(&mut out.escape).for_each(|(wave, of)| of[i] += escape * wave);
                for m in 0..PLACES {
                    let (x, y) = flight.at((m as f64 + 0.5) / PLACES as f64);
                    let to2 = x * x + y * y;
                    let ring = ((to2 * RINGS as f64) as usize).min(RINGS - 1);
                    let met = flight.met / (DIRECTIONS * PLACES) as f64;
                    let turned = x / to2.sqrt().max(1e-12);
                    harmonics(turned).zip(&mut out.next).for_each(|(wave, of)| of[i][ring] += met * wave);
                }
            }
        }
        out
    }

    /// The same if of what leaves the share `taken_back` returns.
    fn closed(&self, taken_back: f64) -> Self {
        let mut out = Self { escape: self.escape, next: self.next };
        for i in 0..RINGS {
            let escape = self.escape[0][i];
            let leaves = escape * (1.0 - taken_back);
            let more = if escape > 0.0 { leaves / escape } else { 0.0 };
            out.escape.iter_mut().for_each(|of| of[i] *= more);
            let met: f64 = out.next[0][i].iter().sum();
            if met > 0.0 {
                let rest = (1.0 - leaves) / met;
                out.next.iter_mut().for_each(|of| of[i].iter_mut().for_each(|chance| *chance *= rest));
            } else {
                // It meets nothing else: what returns does so where it was.
                out.next.iter_mut().for_each(|of| of[i][i] = 1.0 - leaves);
            }
        }
        out
    }

    /// Of light that meets something in each ring, what leaves at last.
    fn leaving(&self, albedo: f64) -> [[f64; RINGS]; HARMONICS] {
        std::array::from_fn(|m| {
            // L = albedo (escape + next L)
            let mut matrix = [0.0; RINGS * RINGS];
            for (i, row) in self.next[m].iter().enumerate() {
                for (j, chance) in row.iter().enumerate() {
                    matrix[i * RINGS + j] = f64::from(u8::from(i == j)) - albedo * chance;
                }
            }
            let mut out = self.escape[m].map(|escape| albedo * escape);
            linear::solve(&mut matrix, &mut out, RINGS);
            out
        })
    }
}

/// cos(m x) for each harmonic m, from cos(x).
fn harmonics(cos: f64) -> impl Iterator<Item = f64> {
    let mut last = (cos, 1.0);
    (0..HARMONICS).map(move |_| {
        let now = last.1;
        last = (now, 2.0 * cos * now - last.0);
        now
    })
}

/// From the sums over all azimuths of what leaves, times each harmonic.
fn outgoing(waves: [f64; HARMONICS]) -> Outgoing {
    let towards = |k: usize| {
        let cos = (2.0 * PI * k as f64 / AZIMUTHS as f64).cos();
        harmonics(cos).zip(waves).skip(1).map(|(wave, of)| 2.0 * wave * of).sum::<f64>() + waves[0]
    };
    Outgoing::new(waves[0], std::array::from_fn(towards))
}

pub(super) fn solve(medium: &Medium, solutions: &Solutions) -> Solved {
    let open = Transport::new(medium);
    let transport = open.closed(medium.sent_back);
    let leaving = transport.leaving(medium.albedo);
    let onward = std::array::from_fn(|i| {
        let met: f64 = transport.next[0][i].iter().sum();
        outgoing(std::array::from_fn(|m| {
            let out: f64 = transport.next[m][i].iter().zip(leaving[m]).map(|(chance, out)| chance * out).sum();
            if met > 0.0 { out / met } else { leaving[m][RINGS - 1] }
        }))
    });
    let mut onward = vec![onward];
    let bent = medium.bends.map(|bends| {
        let alike: [Outgoing; RINGS] = std::array::from_fn(|i| outgoing(std::array::from_fn(|m| leaving[m][i])));
        bent::solve(medium, &bends, 1.0, &solutions.flights(&bends, 1.0), |cell, k| {
            let turned = k + AZIMUTHS - cell % SECTORS * (AZIMUTHS / SECTORS);
            let of = &alike[cell / SECTORS];
            of.share * of.azimuths[turned % AZIMUTHS] / AZIMUTHS as f64
        })
    });
    if let Some(bent) = &bent {
        super::turn(&mut onward, &bent.onward);
    }
    let mut solved = Solved { onward, met: Vec::new(), for_good: Vec::new(), entering: 0.0 };
    if !medium.alone {
        let past = open.leaving(medium.albedo);
        solved.met.push(std::array::from_fn(|i| outgoing(std::array::from_fn(|m| past[m][i]))));
        if let Some(bent) = &bent {
            super::turn(&mut solved.met, &bent.met);
        }
        let for_good = open.closed(medium.taken_back).leaving(medium.albedo)[0];
        solved.for_good.push(for_good);
        let enters: f64 = open.escape[0].iter().sum();
        let out: f64 = open.escape[0].iter().zip(for_good).map(|(chance, out)| chance * out).sum();
        solved.entering = if enters > 0.0 { out / enters } else { for_good[RINGS - 1] };
    }
    solved
}
