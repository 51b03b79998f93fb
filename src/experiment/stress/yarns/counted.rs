//! Where samples fall, counted in bins against the densities that they are drawn by.

use std::f64::consts::TAU;

use glam::Vec3A;

use super::{
    super::{Checks, Scale, fibers::chi_square},
    MODELS, fiber, yarn,
};
use crate::{
    cloth::scatterer,
    experiment::goniometer::straight_section,
    geometry::section::{Crossings, Section},
    math::{Rgb, sampler::Stream},
    scattering::{LobeValues, mis_weight},
    scene::{Model, Yarn},
};

/// Cells of (theta, phi) in which samples are counted.
const BINS: usize = 16;

/// Samples for each vertex whose densities are summed up: the sums are less noisy than the counts by far.
const SAMPLES_PER_SUM: u32 = 10;

fn bin(w: Vec3A) -> usize {
    let row = ((f64::from(w.z) * 0.5 + 0.5) * BINS as f64) as usize;
    let phi = f64::from(w.y).atan2(f64::from(w.x)).rem_euclid(TAU);
    row.min(BINS - 1) * BINS + ((phi / TAU * BINS as f64) as usize).min(BINS - 1)
}

/// A direction in a bin, for two numbers in [0, 1); all bins have the same solid angle.
fn within(bin: usize, u: [f32; 2]) -> Vec3A {
    let place = |i: usize, u: f32| (i as f64 + f64::from(u)) / BINS as f64;
    let z = place(bin / BINS, u[0]) * 2.0 - 1.0;
    let (s, c) = (place(bin % BINS, u[1]) * TAU).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3A::new((r * c) as f32, (r * s) as f32, z as f32)
}

/// The density behind a multiple-importance weight: values weighted for a light density of 1 give it away.
fn density_of(full: f32, weighted: f32) -> f64 {
    if weighted > 0.0 { f64::from((full / weighted - 1.0).max(0.0)) } else { 0.0 }
}

/// Plies, fibres, their share of the area, twist of plies and of fibres, and the fibre of yarns whose samples are counted.
fn counted_yarns() -> [Yarn; 8] {
    let wide = fiber(0.2, 0.5, 0.3, [0.35, 0.3, 0.6]);
    let clear = fiber(0.05, 0.9, 0.0, [0.3, 0.3, 0.5]);
    let dull = fiber(0.1, 0.0, 0.6, [0.4, 0.3, 0.6]);
    let shiny = fiber(0.6, 0.2, 0.1, [0.25, 0.25, 0.4]);
    [
        yarn(1, 40, 0.25, 0.2, -0.33, &wide),
        yarn(1, 150, 0.6, 0.0, 0.0, &wide),
        yarn(1, 300, 0.4, 0.0, 0.5, &clear),
        yarn(1, 20, 0.1, 0.0, -0.6, &dull),
        yarn(2, 100, 0.5, 0.4, -0.3, &shiny),
        yarn(3, 40, 0.25, 0.2, -0.33, &wide),
        yarn(3, 200, 0.7, -0.5, 0.4, &clear),
        yarn(4, 60, 0.3, 0.0, 0.0, &dull),
    ]
}

/// The rays: latitude and offset.
const COUNTED_RAYS: [(f64, f32); 5] = [(0.0, 0.2), (0.6, -0.7), (-0.4, 0.35), (1.1, 0.05), (-0.9, -0.93)];

/// The largest deviation of 8 x 5 x 3 correct counts is this or less in 99 of 100 runs: 3.8 by Sidak's correction if
/// it were normal; chi-square's tail is longer.
const MOST_DEVIATION: f64 = 5.0;

pub(super) fn samples_against_density(scale: Scale, checks: &mut Checks) {
    let n = scale.pick(10_000, 100_000);
    debug_assert!((mis_weight(1.0, 0.0) - 1.0).abs() < 1e-6, "weights are those of the balance heuristic");
    for (index, yarn) in counted_yarns().iter().enumerate() {
        for (i, &(theta, h)) in COUNTED_RAYS.iter().enumerate() {
            // The models for comparison have one density for all: one ray of each yarn will do.
            let models = if i == index % COUNTED_RAYS.len() { &MODELS[..] } else { &MODELS[..1] };
            for &model in models {
                let seed = (index * COUNTED_RAYS.len() + i) as u32;
                let Counted { expected, counts } = count(yarn, model, (theta, h), n, seed);
                let at = || format!("{}, yarn {index}, theta {theta}, h {h}", model.name());
                let mut compare = |name: &'static str, k: usize| {
                    checks.at_most(name, chi_square(&expected[k], &counts[k]), MOST_DEVIATION, &at);
                };
                if model == Model::Aggregated {
                    compare("chi-square of F, standard deviations", 0);
                    compare("chi-square of single scattering, standard deviations", 1);
                    // Each ply weighs its own B by itself: of several the density cannot be read from the weight.
                    if yarn.plies.len() == 1 {
                        compare("chi-square of B, standard deviations", 2);
                    }
                } else {
                    compare("chi-square of chord models, standard deviations", 3);
                    let total: f64 = expected[3].iter().sum::<f64>() / f64::from(n);
                    checks.at_most("density of chord models, integral off 1", (total - 1.0).abs(), 0.01, &at);
                }
            }
        }
    }
}

/// Expected and counted samples of F, of single scattering, of B and of all, in bins.
struct Counted {
    expected: [Vec<f64>; 4],
    counts: [Vec<f64>; 4],
}

fn count(yarn: &Yarn, model: Model, (theta, h): (f64, f32), n: u32, seed: u32) -> Counted {
    let scatterer = scatterer(yarn, model);
    let section: Section<'_> = straight_section(theta, h, 0.6, true);
    let mut crossings = Crossings::new();
    section.crossings(scatterer.shape(), &mut crossings);
    let unscattered = scatterer.transparency(&crossings);
    let mut stream = Stream::new(seed);
    // One node for all: its place hangs on the first two numbers only.
    let node = [0.3, 0.45];
    let vertex = |stream: &mut Stream| {
        let u = [node[0], node[1], stream.next(), stream.next()];
        scatterer.vertex(&section, &crossings, unscattered, Rgb::ONE, u, stream)
    };
    let empty = || std::array::from_fn(|_| vec![0.0; BINS * BINS]);
    let mut counted = Counted { expected: empty(), counts: empty() };
    // The first fibre, and with it the densities, is drawn anew in each vertex: densities are summed over vertices,
    // each at one place of every bin.
    for i in 0..n {
        let v = vertex(&mut stream);
        for cell in (0..BINS * BINS).filter(|_| i % SAMPLES_PER_SUM == 0) {
            let w = within(cell, [stream.next(), stream.next()]);
            let (full, weighted) = (v.evaluate(w, f32::INFINITY, 0.5).lobes, v.evaluate(w, 1.0, 0.5).lobes);
            let density =
                |part: fn(&LobeValues) -> Rgb| density_of(part(&full).max_channel(), part(&weighted).max_channel());
            // Parts of F are weighed by themselves: their density is asked for.
            let forward = f64::from(v.forward_density(w));
            let densities = [forward, density(|l| l.r + l.tt + l.d), density(|l| l.b), density(LobeValues::sum)];
            for (expected, density) in counted.expected.iter_mut().zip(densities) {
                expected[cell] += density * 2.0 * TAU / (BINS * BINS) as f64 * f64::from(SAMPLES_PER_SUM);
            }
        }
        let u = [0; 3].map(|_| stream.next());
        let Some(next) = v.sample(u, &mut stream) else { continue };
        let cell = bin(next.direction);
        let lobe = if !next.shares.f.is_zero() {
            0
        } else if next.shares.b.is_zero() {
            1
        } else {
            2
        };
        counted.counts[lobe][cell] += 1.0;
        counted.counts[3][cell] += 1.0;
    }
    counted
}
