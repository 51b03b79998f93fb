//! Transport in an ellipse: ring by ring and sector by sector of the circle that it becomes when its axes are made equal.

use std::f64::consts::TAU;

use super::{
    AZIMUTHS, Medium, Outgoing, RINGS, Solutions, Solved, Spacing, bent,
    flight::{CELLS, Flight, QUARTER, SECTORS, landing},
    linear,
};

/// Directions, twice the azimuths that are held, and places along each, that are looked at from every cell.
const DIRECTIONS: usize = 2 * AZIMUTHS;
const PLACES: usize = 12;

/// From one cell: what leaves without meeting anything, towards each azimuth, and what meets something next in each other cell.
#[derive(Clone)]
struct Row {
    escape: [f64; AZIMUTHS],
    next: Vec<f64>,
}

impl Row {
    fn new(ring: usize, sector: usize, axes: [f64; 2], spacing: Spacing) -> Self {
        let mut out = Self { escape: [0.0; AZIMUTHS], next: vec![0.0; CELLS] };
        for k in 0..DIRECTIONS {
            let angle = TAU * k as f64 / DIRECTIONS as f64;
            let flight = Flight::new(ring * SECTORS + sector, angle, axes, spacing);
            // Directions between two azimuths by halves.
            for azimuth in [k / 2, k.div_ceil(2) % AZIMUTHS] {
                out.escape[azimuth] += 0.5 * (1.0 - flight.met) / DIRECTIONS as f64;
            }
            for m in 0..PLACES {
                let u = (m as f64 + 0.5) / PLACES as f64;
                for (cell, weight) in landing(flight.at(u)) {
                    out.next[cell] += weight * flight.met / (DIRECTIONS * PLACES) as f64;
                }
            }
        }
        out
    }

    /// The same for the cell `own`, if of what leaves the share `taken_back` returns.
    fn closed(&self, own: usize, taken_back: f64) -> Self {
        let escape: f64 = self.escape.iter().sum();
        let leaves = escape * (1.0 - taken_back);
        let more = if escape > 0.0 { leaves / escape } else { 0.0 };
        let mut next = self.next.clone();
        let met: f64 = next.iter().sum();
        if met > 0.0 {
            next.iter_mut().for_each(|chance| *chance *= (1.0 - leaves) / met);
        } else {
            // It meets nothing else: what returns does so where it was.
            next[own] = 1.0 - leaves;
        }
        Self { escape: self.escape.map(|part| part * more), next }
    }

    /// The row of the cell that this one becomes when the section is mirrored about the long axis, the short one, or both.
    fn mirrored(&self, long: bool, short: bool) -> Self {
        let image = |k: usize, of: usize| {
            let k = if long { (of + of / 2 - k) % of } else { k };
            if short { (of - k) % of } else { k }
        };
        let next = (0..CELLS).map(|cell| self.next[cell / SECTORS * SECTORS + image(cell % SECTORS, SECTORS)]);
        Self { escape: std::array::from_fn(|k| self.escape[image(k, AZIMUTHS)]), next: next.collect() }
    }
}

/// Of light that meets something in each cell: what leaves at last towards each azimuth.
fn leaving(rows: &[Row], albedo: f64) -> Vec<f64> {
    // L = albedo (escape + next L)
    let mut matrix: Vec<f64> = rows.iter().flat_map(|row| row.next.iter().map(|chance| -albedo * chance)).collect();
    matrix.iter_mut().step_by(CELLS + 1).for_each(|own| *own += 1.0);
    let mut out: Vec<f64> = rows.iter().flat_map(|row| row.escape.map(|part| albedo * part)).collect();
    linear::solve(&mut matrix, &mut out, CELLS);
    out
}

pub(super) fn solve(medium: &Medium, stretch: f64, solutions: &Solutions) -> Solved {
    let axes = [medium.radius / stretch.sqrt(), medium.radius * stretch.sqrt()];
    // All four quarters from one of them.
    let rows: Vec<Row> = (0..RINGS)
        .flat_map(|ring| {
            let quarter: Vec<Row> = (0..QUARTER).map(|sector| Row::new(ring, sector, axes, medium.spacing)).collect();
            let half = SECTORS / 2;
            (0..SECTORS).map(move |sector| {
                let (upper, mirrored) = (sector.min(SECTORS - sector), sector > half);
                let (first, long) = (upper.min(half - upper), upper > half / 2);
                quarter[first].mirrored(long, mirrored)
            })
        })
        .collect();
    let closed =
        |share: f64| -> Vec<Row> { rows.iter().enumerate().map(|(own, row)| row.closed(own, share)).collect() };
    let near = closed(medium.sent_back);
    let out = leaving(&near, medium.albedo);
    let cells = |of: &dyn Fn(usize) -> Outgoing| -> Vec<[Outgoing; RINGS]> {
        (0..QUARTER).map(|sector| std::array::from_fn(|ring| of(ring * SECTORS + sector))).collect()
    };
    let mean = |weights: &[f64], out: &[f64], own: usize| {
        let sum: f64 = weights.iter().sum();
        let mut towards = [0.0; AZIMUTHS];
        for (cell, (weight, out)) in weights.iter().zip(out.chunks_exact(AZIMUTHS)).enumerate() {
            // Where nothing is met it is as from the place itself.
            let weight = if sum > 0.0 { weight / sum } else { f64::from(u8::from(cell == own)) };
            towards.iter_mut().zip(out).for_each(|(to, from)| *to += weight * from);
        }
        Outgoing::new(towards.iter().sum::<f64>(), towards)
    };
    let mut onward = cells(&|own| mean(&near[own].next, &out, own));
    let bent = medium.bends.map(|bends| {
        let flights = solutions.flights(&bends, stretch);
        bent::solve(medium, &bends, stretch, &flights, |cell, k| out[cell * AZIMUTHS + k])
    });
    if let Some(bent) = &bent {
        super::turn(&mut onward, &bent.onward);
    }
    let mut solved = Solved { onward, met: Vec::new(), for_good: Vec::new(), entering: 0.0 };
    if !medium.alone {
        let [past, for_good] = [0.0, medium.taken_back].map(|share| leaving(&closed(share), medium.albedo));
        let of = |out: &[f64], cell: usize| {
            let towards: [f64; AZIMUTHS] = std::array::from_fn(|k| out[cell * AZIMUTHS + k]);
            Outgoing::new(towards.iter().sum(), towards)
        };
        solved.met = cells(&|cell| of(&past, cell));
        if let Some(bent) = &bent {
            super::turn(&mut solved.met, &bent.met);
        }
        solved.for_good = cells(&|cell| of(&for_good, cell)).iter().map(|rings| rings.map(|out| out.share)).collect();
        let enters: Vec<f64> = rows.iter().map(|row| row.escape.iter().sum()).collect();
        solved.entering = mean(&enters, &for_good, CELLS - 1).share;
    }
    solved
}
