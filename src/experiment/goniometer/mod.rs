//! The virtual goniometer: how a fibre, a ply or a yarn spreads the light of one direction over all others.
//!
//! The specimen is straight and infinite. A pencil of rays from the camera's direction falls on it, at one offset or
//! evenly across its width; what is measured are shares of the light that meets it, per channel: unscattered,
//! backward (|phi| < 90 degrees, where phi = 0 is back towards the camera), forward, by lobe, and by direction.
//! Light is followed from the camera, so a share is the radiance that the camera sees under light of radiance 1 from
//! the directions in question.
//!
//! All figures are means over batches of samples with their own random numbers, and carry standard errors.

pub mod picture;
mod specimen;
mod truth;

use rayon::prelude::*;
use serde_json::{Value, json};

use specimen::Prepared;
pub(crate) use specimen::straight_section;
pub use specimen::{Specimen, ply_alone};
pub use truth::truth;

use super::LOBES;
use crate::{math::sampler::Sampler, scattering::LobeValues};
use glam::Vec3A;

/// From where the specimen is looked at. Angles in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Latitude of the camera's direction against the plane across the yarn.
    pub theta: f64,
    /// Where the rays meet the specimen, -1 to 1 across it; `None` for evenly over its width.
    pub offset: Option<f64>,
    /// Azimuth of the first ply from the camera's side; `None` for any.
    pub phase: Option<f64>,
    /// Width over height of the section of a yarn, at least 1: pressed flat it is seen along its short axis.
    pub flatten: f64,
}

impl Default for View {
    /// Straight at a round yarn, evenly over its width and all around.
    fn default() -> Self {
        Self { theta: 0.0, offset: None, phase: None, flatten: 1.0 }
    }
}

/// How much is spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// Number of samples.
    pub paths: u64,
    /// Start of all random numbers.
    pub seed: u32,
}

/// Cells of a [`Distribution`] over latitude.
pub const ROWS: usize = 36;
/// Cells of a [`Distribution`] over azimuth.
pub const COLUMNS: usize = 72;
/// Groups of samples whose spread tells the error of the mean.
const BATCHES: u64 = 32;

/// A mean with its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mean {
    /// The mean.
    pub mean: f64,
    /// Its standard error; not known from one sample.
    pub se: Option<f64>,
}

impl Mean {
    /// Of the means of batches of equal size.
    fn of(batches: impl Iterator<Item = f64>) -> Self {
        let (mut n, mut sum, mut square) = (0.0, 0.0, 0.0);
        for b in batches {
            n += 1.0;
            sum += b;
            square += b * b;
        }
        let mean = sum / n;
        let variance = (square / n - mean * mean).max(0.0);
        Self { mean, se: (n > 1.0).then(|| (variance / (n - 1.0)).sqrt()) }
    }
}

/// Energy per cell of (theta, phi): latitude from -90 to 90 degrees in rows, azimuth from -180 to 180 in columns.
#[derive(Clone, Debug)]
pub struct Distribution {
    /// Shares of the incident light, [`ROWS`] x [`COLUMNS`].
    pub energy: Vec<[f64; 3]>,
}

impl Distribution {
    /// Latitude of the middle of a row, radians.
    pub fn theta(row: usize) -> f64 {
        ((row as f64 + 0.5) / ROWS as f64 - 0.5) * std::f64::consts::PI
    }

    /// Azimuth of the middle of a column, radians.
    pub fn phi(column: usize) -> f64 {
        ((column as f64 + 0.5) / COLUMNS as f64 - 0.5) * std::f64::consts::TAU
    }

    /// Solid angle of a cell of a row, steradian.
    pub fn solid_angle(row: usize) -> f64 {
        let edge = |r: usize| ((r as f64 / ROWS as f64 - 0.5) * std::f64::consts::PI).sin();
        (edge(row + 1) - edge(row)) * std::f64::consts::TAU / COLUMNS as f64
    }

    /// Mean value of a cell: share per steradian.
    pub fn value(&self, row: usize, column: usize) -> [f64; 3] {
        self.energy[row * COLUMNS + column].map(|e| e / Self::solid_angle(row))
    }

    fn cell(w: Vec3A) -> usize {
        let theta = f64::from(w.z.clamp(-1.0, 1.0)).asin();
        let phi = f64::from(w.y).atan2(f64::from(w.x));
        let row = ((theta / std::f64::consts::PI + 0.5) * ROWS as f64) as usize;
        let column = ((phi / std::f64::consts::TAU + 0.5) * COLUMNS as f64) as usize;
        row.min(ROWS - 1) * COLUMNS + column.min(COLUMNS - 1)
    }
}

/// Shares of light forward and back.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Halves {
    /// To the far side; without the unscattered part.
    pub forward: [Mean; 3],
    /// To the camera's side.
    pub backward: [Mean; 3],
}

/// What was measured.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// Samples taken.
    pub paths: u64,
    /// Share of light that met no fibre.
    pub unscattered: Mean,
    /// Scattered light.
    pub scattered: Halves,
    /// The same by lobe, R, TT, D, F, B; `None` where light has no lobes.
    pub lobes: Option<[Halves; 5]>,
    /// Scattered light by direction.
    pub distribution: Distribution,
    /// Largest weight of a sample.
    pub largest_weight: f64,
}

/// One sample's outcome in the specimen's frame: z along it, x towards the camera across it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    pub(crate) unscattered: f32,
    /// Direction and energy by lobe of what was scattered.
    pub(crate) scattered: Option<(Vec3A, LobeValues)>,
}

/// Sums of one batch.
#[derive(Clone)]
pub(crate) struct Tally {
    count: u64,
    unscattered: f64,
    /// `[forward, backward][lobe][channel]`
    halves: [[[f64; 3]; 5]; 2],
    energy: Vec<[f64; 3]>,
    largest: f64,
}

impl Tally {
    pub(crate) fn new() -> Self {
        Self {
            count: 0,
            unscattered: 0.0,
            halves: [[[0.0; 3]; 5]; 2],
            energy: vec![[0.0; 3]; ROWS * COLUMNS],
            largest: 0.0,
        }
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.unscattered += other.unscattered;
        for (mine, others) in self.halves.iter_mut().flatten().flatten().zip(other.halves.iter().flatten().flatten()) {
            *mine += others;
        }
        for (mine, others) in self.energy.iter_mut().flatten().zip(other.energy.iter().flatten()) {
            *mine += others;
        }
        self.largest = self.largest.max(other.largest);
    }

    pub(crate) fn add(&mut self, outcome: Outcome) {
        self.count += 1;
        self.unscattered += f64::from(outcome.unscattered);
        let Some((w, lobes)) = outcome.scattered else { return };
        let half = usize::from(w.x > 0.0);
        let cell = Distribution::cell(w);
        for (lobe, value) in lobes.to_array().into_iter().enumerate() {
            for (c, v) in value.to_array().into_iter().enumerate() {
                let v = f64::from(v);
                self.halves[half][lobe][c] += v;
                self.energy[cell][c] += v;
            }
        }
        self.largest = self.largest.max(f64::from(lobes.sum().max_channel()));
    }

    /// Means over batches. `lobes` says whether the split by lobe means anything.
    pub(crate) fn measure(batches: &[Self], lobes: bool) -> Measurement {
        let paths: u64 = batches.iter().map(|b| b.count).sum();
        let mean = |value: &dyn Fn(&Self) -> f64| Mean::of(batches.iter().map(|b| value(b) / b.count.max(1) as f64));
        let halves = |of: &dyn Fn(&[[f64; 3]; 5], usize) -> f64| Halves {
            forward: std::array::from_fn(|c| mean(&|b| of(&b.halves[0], c))),
            backward: std::array::from_fn(|c| mean(&|b| of(&b.halves[1], c))),
        };
        let mut energy = vec![[0.0; 3]; ROWS * COLUMNS];
        for batch in batches {
            for (sum, e) in energy.iter_mut().zip(&batch.energy) {
                *sum = std::array::from_fn(|c| sum[c] + e[c] / paths.max(1) as f64);
            }
        }
        Measurement {
            paths,
            unscattered: mean(&|b| b.unscattered),
            scattered: halves(&|h, c| h.iter().map(|lobe| lobe[c]).sum()),
            lobes: lobes.then(|| std::array::from_fn(|lobe| halves(&|h, c| h[lobe][c]))),
            distribution: Distribution { energy },
            largest_weight: batches.iter().map(|b| b.largest).fold(0.0, f64::max),
        }
    }
}

/// Splits the work over batches, in the calling thread's rayon pool; the same result for any number of threads.
pub(crate) fn in_batches(effort: Effort, lobes: bool, run: impl Fn(u64, u64, &mut Tally) + Sync) -> Measurement {
    let batches: Vec<Tally> = (0..BATCHES)
        .into_par_iter()
        .map(|batch| {
            let count = effort.paths / BATCHES + u64::from(batch < effort.paths % BATCHES);
            let mut tally = Tally::new();
            run(batch, count, &mut tally);
            tally
        })
        .filter(|tally| tally.count > 0)
        .collect();
    Tally::measure(&batches, lobes)
}

/// Measures what the specimen's model says.
pub fn measure(specimen: &Specimen<'_>, view: &View, effort: Effort) -> Measurement {
    let prepared = specimen.prepare(view);
    in_batches(effort, true, |batch, count, tally| {
        for index in 0..count {
            let mut sampler = Sampler::new(effort.seed, batch as u32, 0, index as u32);
            tally.add(prepared.draw(view, &mut sampler));
        }
    })
}

/// The value of the scattering for light from one direction: S cos(theta) in 1/steradian by lobe, averaged over what the
/// view leaves open.
pub fn value(specimen: &Specimen<'_>, view: &View, light: (f64, f64), effort: Effort) -> [[Mean; 3]; 5] {
    value_of(&specimen.prepare(view), view, light, effort)
}

/// The same of a specimen that is prepared for the view.
fn value_of(prepared: &Prepared, view: &View, (theta, phi): (f64, f64), effort: Effort) -> [[Mean; 3]; 5] {
    let w = Vec3A::new((theta.cos() * phi.cos()) as f32, (theta.cos() * phi.sin()) as f32, theta.sin() as f32);
    let batches: Vec<[[f64; 3]; 5]> = (0..BATCHES)
        .into_par_iter()
        .map(|batch| {
            let count = (effort.paths / BATCHES).max(1);
            let mut sum = [[0.0; 3]; 5];
            for index in 0..count {
                let mut sampler = Sampler::new(effort.seed, batch as u32, 1, index as u32);
                let lobes = prepared.value(view, w, &mut sampler).to_array();
                for (sum, lobe) in sum.iter_mut().zip(lobes) {
                    let lobe = lobe.to_array();
                    *sum = std::array::from_fn(|c| sum[c] + f64::from(lobe[c]) / count as f64);
                }
            }
            sum
        })
        .collect();
    std::array::from_fn(|lobe| std::array::from_fn(|c| Mean::of(batches.iter().map(|b| b[lobe][c]))))
}

fn means(m: &[Mean; 3]) -> Value {
    json!(m.map(|m| m.mean))
}

fn errors(m: &[Mean; 3]) -> Value {
    json!(m.map(|m| m.se))
}

impl Measurement {
    /// Reflected share and transmitted share, the latter with what met no fibre, per channel.
    pub fn energies(&self) -> ([Mean; 3], [Mean; 3]) {
        let error = |m: Mean| Some(m.se?.hypot(self.unscattered.se?));
        let with = |m: Mean| Mean { mean: m.mean + self.unscattered.mean, se: error(m) };
        (self.scattered.backward, self.scattered.forward.map(with))
    }

    /// Energies with standard errors, and lobes where there are any.
    pub fn to_json(&self) -> Value {
        let mut out = json!({
            "forward": means(&self.scattered.forward), "forward_se": errors(&self.scattered.forward),
            "backward": means(&self.scattered.backward), "backward_se": errors(&self.scattered.backward),
            "unscattered": self.unscattered.mean, "unscattered_se": self.unscattered.se,
            "paths": self.paths,
        });
        if let Some(lobes) = &self.lobes {
            let by_name = LOBES.iter().zip(lobes).map(|(name, half)| {
                ((*name).to_owned(), json!({"forward": means(&half.forward), "backward": means(&half.backward)}))
            });
            out["lobes"] = Value::Object(by_name.collect());
        }
        out
    }

    /// The distribution: middles of the cells in degrees, and values per steradian, row by row.
    pub fn distribution_json(&self) -> Value {
        let degrees =
            |n: usize, at: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..n).map(|i| at(i).to_degrees()).collect() };
        let values: Vec<Vec<[f64; 3]>> =
            (0..ROWS).map(|r| (0..COLUMNS).map(|c| self.distribution.value(r, c)).collect()).collect();
        json!({
            "theta": degrees(ROWS, &Distribution::theta),
            "phi": degrees(COLUMNS, &Distribution::phi),
            "value": values,
        })
    }
}

#[cfg(test)]
mod tests;
