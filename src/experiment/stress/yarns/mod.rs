//! Yarns with each of the models: packings, twists, plies and rays at their ends.

mod counted;

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use glam::Vec3A;

use super::{Case, Checks, Group::Scattering, Scale};
use crate::{
    cloth::scatterer,
    experiment::goniometer::{self, Effort, Specimen, View, straight_section},
    geometry::{
        density::KnownPacking,
        fiber::Placement,
        ply::PlyParameters,
        section::Crossings,
        yarn::{MAX_PLIES, touching_plies},
    },
    math::{Rgb, sampler::Stream},
    scattering::{fiber::FiberMaterial, yarn::YarnScatterer},
    scene::{Model, Yarn},
};
use counted::samples_against_density;

pub(in crate::experiment) const CASES: &[Case] = &[
    Case {
        group: Scattering,
        name: "fiber_counts",
        about: "1 to 1 000 000 fibres in a ply, 0.001 to 10 000 expected on a chord",
        run: counts,
    },
    Case { group: Scattering, name: "packing", about: "area fractions from 1e-6 to 3, beyond overlap", run: packing },
    Case {
        group: Scattering,
        name: "twist",
        about: "fibre and ply twist from 0 to 89.9 degrees, both hands",
        run: twist,
    },
    Case {
        group: Scattering,
        name: "yarn_albedos",
        about: "a_F to 0 and to 1: albedos 0, 1e-6, 0.999999 and exactly 1 in each lobe",
        run: albedos,
    },
    Case { group: Scattering, name: "yarn_widths", about: "lobes from 1e-5 to 10 rad in a yarn", run: widths },
    Case {
        group: Scattering,
        name: "rays_on_a_yarn",
        about: "latitudes to 1e-6 rad from the yarn's direction and along it; offsets to exactly +-1",
        run: rays,
    },
    Case {
        group: Scattering,
        name: "many_plies",
        about: "1 to 64 plies, very unequal plies, a ply without fibres, plies of different fibres",
        run: plies,
    },
    Case {
        group: Scattering,
        name: "energy_over_the_width",
        about: "white yarns of all packings and twists under light from all sides, averaged over width and azimuth",
        run: energy,
    },
    Case {
        group: Scattering,
        name: "yarn_chi_square",
        about: "where samples of each lobe fall against their densities: eight yarns, five rays",
        run: samples_against_density,
    },
    Case {
        group: Scattering,
        name: "section_branches",
        about: "continuity of what a ray meets where rays turn steep, and where ellipses turn round",
        run: branches,
    },
];

fn fiber(r: f64, tt: f64, d: f64, beta: [f64; 3]) -> FiberMaterial {
    FiberMaterial { r: [r; 3], tt: [tt; 3], d: [d; 3], beta_r: beta[0], beta_tt: beta[1], beta_n: beta[2] }
}

const BETA: [f64; 3] = [0.15, 0.12, 0.35];

fn white() -> FiberMaterial {
    fiber(0.2, 0.5, 0.3, BETA)
}

/// Equal touching plies.
fn yarn(plies: u32, fibers: u32, density: f64, ply_twist: f64, fiber_twist: f64, material: &FiberMaterial) -> Yarn {
    let (radius, distance) = touching_plies(plies);
    let one = |k: u32| PlyParameters {
        radius,
        aspect: 1.0,
        distance,
        angle: TAU * f64::from(k) / f64::from(plies),
        fibers,
        fiber_radius: radius * (density / f64::from(fibers.max(1))).sqrt(),
        fiber_twist,
    };
    Yarn {
        name: "stress".to_owned(),
        radius: 1.0,
        plies: (0..plies).map(one).collect(),
        ply_twist,
        fibers: (0..plies).map(|_| ("stress".to_owned(), material.clone())).collect(),
        tilted: true,
        placement: Placement::Regular,
        known_packing: KnownPacking::default(),
        flyaways: None,
        unevenness: 0.0,
        tex: None,
    }
}

/// Of these the aggregated one sends on all of white light; the others, but for the printed one, no more than comes in. That is only asked
/// to stay finite.
const MODELS: [Model; 4] = [Model::Aggregated, Model::TwoStream, Model::Paper, Model::Printed];

/// What one ray on one yarn is asked.
struct SectionRay {
    theta: f64,
    h: f32,
    phase: f64,
}

/// Scatters `n` times at one place of a yarn whose fibres may all be white.
fn examine(
    scatterer: &YarnScatterer,
    model: Model,
    ray: &SectionRay,
    n: u32,
    white: bool,
    checks: &mut Checks,
    at: &dyn Fn() -> String,
) {
    let section = straight_section(ray.theta, ray.h, ray.phase, scatterer.shape().tilted);
    let mut crossings = Crossings::new();
    section.crossings(scatterer.shape(), &mut crossings);
    let fibers: f32 = crossings.iter().map(|c| c.fibers).sum();
    checks.never("fibres on a ray not finite or negative", !fibers.is_finite() || fibers < 0.0, at);
    let unscattered = scatterer.transparency(&crossings);
    checks.never("transparency outside 0 to 1", !(0.0..=1.0).contains(&unscattered), at);
    if unscattered >= 1.0 || crossings.is_empty() {
        return;
    }
    let scattered = f64::from(1.0 - unscattered);
    let mut stream = Stream::new((ray.h.to_bits() ^ (ray.theta as f32).to_bits()).wrapping_add(n));
    let uniform = 0.25 / std::f32::consts::PI;
    let (mut sum, mut square) = ([0.0; 3], [0.0; 3]);
    for _ in 0..n {
        let u = [0; 4].map(|_| stream.next());
        let vertex = scatterer.vertex(&section, &crossings, unscattered, Rgb::ONE, u, &mut stream);
        let z = 2.0 * stream.next() - 1.0;
        let (s, c) = (std::f32::consts::TAU * stream.next()).sin_cos();
        let across = (1.0 - z * z).max(0.0).sqrt();
        let w = Vec3A::new(across * c, across * s, z);
        for light_pdf in [f32::INFINITY, uniform, 0.0] {
            let direct = vertex.evaluate(w, light_pdf, stream.next());
            let all = direct.lobes.to_array();
            checks.never("a value not finite", all.iter().any(|l| !l.is_finite()), at);
            checks.never("a value negative", all.iter().any(|l| l.min_channel() < 0.0), at);
            checks.never("a start not finite", direct.start.is_some_and(|start| !start.is_finite()), at);
        }
        let u = [0; 3].map(|_| stream.next());
        let Some(next) = vertex.sample(u, &mut stream) else { continue };
        let finite =
            next.weight.is_finite() && next.pdf.is_finite() && next.direction.is_finite() && next.start.is_finite();
        checks.never("a sample not finite", !finite, at);
        checks.never("a sample negative", next.weight.min_channel() < 0.0 || next.pdf < 0.0, at);
        checks.at_most(
            "length of a sampled direction, off 1",
            f64::from((next.direction.length() - 1.0).abs()),
            1e-4,
            at,
        );
        if model != Model::Printed {
            let name = if model == Model::Aggregated {
                "largest sample weight, aggregated"
            } else {
                "largest sample weight, chord models"
            };
            checks.at_most(name, f64::from(next.weight.max_channel()), 6.0, at);
        }
        for (c, v) in next.weight.to_array().into_iter().enumerate() {
            sum[c] += f64::from(v) / f64::from(n);
            square[c] += f64::from(v).powi(2) / f64::from(n);
        }
    }
    if model == Model::Printed {
        return;
    }
    for c in 0..3 {
        let se = ((square[c] - sum[c] * sum[c]).max(0.0) / f64::from(n)).sqrt();
        // Energy of all light: what passed and what was scattered.
        let energy = 1.0 - scattered + scattered * sum[c];
        let slack = 4.0 * scattered * se;
        let name = if model == Model::Aggregated {
            "one ray: energy beyond 1 and four standard errors, aggregated"
        } else {
            "one ray: energy beyond 1 and four standard errors, chord models"
        };
        checks.at_most(name, energy - slack - 1.0, super::ENERGY_ABOVE, at);
        if white && model == Model::Aggregated {
            let name = "energy of white fibres, with four standard errors";
            checks.at_least(name, energy + slack, super::WHITE_ENERGY, at);
        }
    }
}

fn counts(scale: Scale, checks: &mut Checks) {
    let n = scale.pick(150, 1500);
    for (fibers, density) in [
        (1, 1e-6),
        (1, 0.01),
        (1, 0.5),
        (1, 0.99),
        (2, 0.3),
        (7, 0.7),
        (1_000, 1e-8),
        (1_000_000, 1e-7),
        (1_000_000, 0.5),
        (1_000_000, 0.9),
        (u32::MAX, 0.9),
    ] {
        for model in MODELS {
            let scatterer = scatterer(&yarn(1, fibers, density, 0.0, 0.0, &white()), model);
            for h in [0.0, 0.5, 0.99, 0.999_999, 1.0] {
                let at = || format!("{fibers} fibres, density {density:e}, {}, h {h}", model.name());
                examine(&scatterer, model, &SectionRay { theta: 0.3, h, phase: 0.0 }, n, true, checks, &at);
            }
        }
    }
}

fn packing(scale: Scale, checks: &mut Checks) {
    let n = scale.pick(150, 1500);
    for density in [1e-6, 1e-3, 0.1, 0.5, 0.84, 0.849_999, 0.850_001, 0.9, 1.0, 1.5, 3.0] {
        for plies in [1, 3] {
            for model in MODELS {
                let scatterer = scatterer(&yarn(plies, 50, density, 0.0, 0.2, &white()), model);
                for (h, phase) in [(0.0, 0.0), (0.6, 1.0), (-0.97, 2.0)] {
                    let at = || format!("density {density}, {plies} plies, {}, h {h}", model.name());
                    examine(&scatterer, model, &SectionRay { theta: 0.4, h, phase }, n, true, checks, &at);
                }
            }
        }
    }
}

fn twist(scale: Scale, checks: &mut Checks) {
    let n = scale.pick(100, 1500);
    for degrees in [0.0f64, 1e-6, 20.0, 45.0, 80.0, 89.0, 89.9] {
        for (ply, fiber) in [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0)] {
            let (ply, fiber) = ((ply * degrees).to_radians(), (fiber * degrees).to_radians());
            for model in MODELS {
                let scatterer = scatterer(&yarn(3, 40, 0.3, ply, fiber, &white()), model);
                for (theta, h, phase) in [(0.0, 0.1, 0.5), (0.9, -0.5, 2.0), (-1.5, 0.8, 4.0)] {
                    let at = || format!("ply {ply:.3}, fibre {fiber:.3} rad, {}, theta {theta}, h {h}", model.name());
                    examine(&scatterer, model, &SectionRay { theta, h, phase }, n, true, checks, &at);
                }
            }
        }
    }
}

fn albedos(scale: Scale, checks: &mut Checks) {
    let n = scale.pick(100, 1000);
    for a in [0.0, 1e-12, 1e-6, 0.5, 0.999_999, 1.0 - 1e-12, 1.0] {
        for (r, tt, d) in [(a, 0.0, 0.0), (0.0, a, 0.0), (0.0, 0.0, a), (0.2 * a, 0.5 * a, 0.3 * a)] {
            // beta_n -> 0: TT is all chain, a_F -> 1 with tt -> 1.
            for beta_n in [1e-5, 0.35, 10.0] {
                let m = fiber(r, tt, d, [0.15, 0.12, beta_n]);
                let white = r + tt + d >= 1.0;
                for model in MODELS {
                    for (plies, fibers, density) in [(1, 400, 0.6), (2, 30, 0.2)] {
                        let scatterer = scatterer(&yarn(plies, fibers, density, 0.1, -0.3, &m), model);
                        for h in [0.0, 0.7] {
                            let at = || {
                                format!(
                                    "r {r}, tt {tt}, d {d}, beta_n {beta_n:e}, {}, {plies} plies of {fibers}, h {h}",
                                    model.name()
                                )
                            };
                            examine(
                                &scatterer,
                                model,
                                &SectionRay { theta: 0.3, h, phase: 0.8 },
                                n,
                                white,
                                checks,
                                &at,
                            );
                        }
                    }
                }
            }
        }
    }
}

fn widths(scale: Scale, checks: &mut Checks) {
    let n = scale.pick(100, 1500);
    for beta in [1e-5, 1e-4, 1e-3, 0.02, 0.7, 1.5, 3.2, 10.0] {
        for beta_n in [1e-5, 1e-3, 0.35, 3.2, 10.0] {
            let m = fiber(0.2, 0.5, 0.3, [beta, beta, beta_n]);
            for model in MODELS {
                let scatterer = scatterer(&yarn(2, 60, 0.3, 0.2, -0.3, &m), model);
                for (theta, h) in [(0.0, 0.0), (1.2, 0.5)] {
                    let at = || format!("beta {beta:e}, beta_n {beta_n:e}, {}, theta {theta}, h {h}", model.name());
                    examine(&scatterer, model, &SectionRay { theta, h, phase: 1.0 }, n, true, checks, &at);
                }
            }
        }
    }
}

fn rays(scale: Scale, checks: &mut Checks) {
    let n = scale.pick(60, 1000);
    for (plies, ply_twist, fiber_twist) in [(1, 0.0, 0.0), (1, 0.0, 0.7), (3, 0.3, -0.4)] {
        for model in MODELS {
            let scatterer = scatterer(&yarn(plies, 60, 0.4, ply_twist, fiber_twist, &white()), model);
            for off in [FRAC_PI_2, 0.8, FRAC_PI_4, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 0.0] {
                for h in [-1.0, -0.999_999_9, -0.5, 0.0, 0.3, 0.999, 1.0] {
                    let theta = FRAC_PI_2 - off;
                    let at = || format!("{off:e} rad from the yarn, h {h}, {plies} plies, {}", model.name());
                    examine(&scatterer, model, &SectionRay { theta, h, phase: 0.3 }, n, true, checks, &at);
                }
            }
        }
    }
}

fn plies(scale: Scale, checks: &mut Checks) {
    let n = scale.pick(60, 800);
    // Of few fibres plies let light pass between them; of many each shuts in what comes from its neighbours.
    let yarns =
        [1, 2, 3, 5, 7, 12, 20, MAX_PLIES as u32].into_iter().flat_map(|count| [20, 200].map(|fibers| (count, fibers)));
    for (count, fibers) in yarns {
        for model in MODELS {
            let scatterer = scatterer(&yarn(count, fibers, 0.4, 0.2, -0.2, &white()), model);
            for i in 0..9 {
                let (h, phase) = (-0.96 + 0.24 * i as f32, 0.7 * f64::from(i));
                let at = || format!("{count} plies of {fibers} fibres, {}, h {h}", model.name());
                examine(&scatterer, model, &SectionRay { theta: 0.4, h, phase }, n, true, checks, &at);
            }
        }
    }
    // A thick ply with a thin one at its side, one that holds nothing, one of black fibres, one squeezed flat.
    let mut odd = yarn(4, 30, 0.4, 0.2, 0.1, &white());
    for (k, radius) in [0.6, 0.006, 0.2, 0.15].into_iter().enumerate() {
        let p = &mut odd.plies[k];
        p.fiber_radius *= radius / p.radius;
        p.radius = radius;
        p.distance = 1.0 - radius;
    }
    odd.plies[2].fibers = 0;
    odd.plies[3].aspect = 0.02;
    odd.fibers[3].1 = fiber(0.0, 0.0, 0.0, BETA);
    let mut empty = yarn(3, 30, 0.4, 0.2, 0.1, &white());
    for p in &mut empty.plies {
        p.fibers = 0;
    }
    for (name, yarn) in [("unequal plies", &odd), ("plies without fibres", &empty)] {
        for model in MODELS {
            let scatterer = scatterer(yarn, model);
            for i in 0..40 {
                let (h, phase) = (-0.975 + 0.05 * i as f32, 0.37 * f64::from(i));
                let at = || format!("{name}, {}, h {h}, phase {phase:.2}", model.name());
                examine(&scatterer, model, &SectionRay { theta: 0.2, h, phase }, n, false, checks, &at);
            }
        }
    }
}

fn energy(scale: Scale, checks: &mut Checks) {
    let effort = Effort { paths: scale.pick(2_000, 50_000), seed: 5 };
    for (plies, ply_twist, fiber_twist) in
        [(1, 0.0, 0.0), (1, 0.0, 0.5), (2, 0.1, -0.2), (3, 0.22, -0.33), (3, 0.5, 0.5), (7, 0.3, -0.3)]
    {
        for density in [0.02, 0.1, 0.3, 0.6, 0.85] {
            for theta in [0.0, 0.6, 1.2, 1.5] {
                for model in [Model::Aggregated, Model::TwoStream, Model::Paper] {
                    let yarn = yarn(plies, 60, density, ply_twist, fiber_twist, &white());
                    let view = View { theta, ..View::default() };
                    let m = goniometer::measure(&Specimen::Yarn(&yarn, model), &view, effort);
                    let (back, on) = m.energies();
                    let total = back[1].mean + on[1].mean;
                    // Batches share a sequence of sample points: their spread is that of the sum, not of its parts.
                    let slack = 4.0 * back[1].se.unwrap_or(0.0).hypot(on[1].se.unwrap_or(0.0));
                    let at = || {
                        format!(
                            "{plies} plies, twist {ply_twist} {fiber_twist}, density {density}, theta {theta}, {}: {total:.5} +- {:.5}",
                            model.name(),
                            slack / 4.0
                        )
                    };
                    checks.at_most(
                        "energy beyond 1 and four standard errors",
                        total - slack - 1.0,
                        super::ENERGY_ABOVE,
                        &at,
                    );
                    if model == Model::Aggregated {
                        checks.at_least(
                            "energy, aggregated, with four standard errors",
                            total + slack,
                            super::WHITE_ENERGY,
                            &at,
                        );
                    }
                }
            }
        }
    }
}

fn branches(_: Scale, checks: &mut Checks) {
    let fibers = |yarn: &YarnScatterer, theta: f64, h: f32, phase: f64| -> f64 {
        let mut crossings = Crossings::new();
        straight_section(theta, h, phase, true).crossings(yarn.shape(), &mut crossings);
        crossings.iter().map(|c| f64::from(c.fibers)).sum()
    };
    for (ply_twist, fiber_twist) in [(0.0, 0.4), (0.2, -0.3), (0.7, 0.7)] {
        let scatterer = scatterer(&yarn(3, 60, 0.4, ply_twist, fiber_twist, &white()), Model::Aggregated);
        for i in 0..200 {
            let (h, phase) = (-0.9 + 0.009 * i as f32, 0.1 * f64::from(i));
            // Slopes are held at 1: a ray of 45 degrees.
            let (below, above) = (FRAC_PI_4 - 1e-5, FRAC_PI_4 + 1e-5);
            let (a, b) = (fibers(&scatterer, below, h, phase), fibers(&scatterer, above, h, phase));
            let at = || format!("ply twist {ply_twist}, h {h:.3}, phase {phase:.2}: {a:.4} and {b:.4} fibres");
            let name = if ply_twist < 0.3 {
                "fibres on a ray across 45 degrees, usual twist, jump over one and the count"
            } else {
                "fibres on a ray across 45 degrees, strong twist, jump over one and the count"
            };
            // Two rounds and three of placing the plies, for usual twists: they move by some percent of their radius.
            checks.at_most(name, (a - b).abs() / (1.0 + a.max(b)), 0.1, &at);
        }
    }
    // An ellipse that is all but round, and a round ply.
    let round = yarn(3, 60, 0.4, 0.2, -0.3, &white());
    let mut nearly = round.clone();
    for p in &mut nearly.plies {
        p.aspect = 1.0 - 1e-5;
    }
    let (round, nearly) = (scatterer(&round, Model::Aggregated), scatterer(&nearly, Model::Aggregated));
    for i in 0..200 {
        let (h, phase) = (-0.9 + 0.009 * i as f32, 0.1 * f64::from(i));
        for theta in [0.0, 0.5, 1.2] {
            let (a, b) = (fibers(&round, theta, h, phase), fibers(&nearly, theta, h, phase));
            let at = || format!("theta {theta}, h {h:.3}: {a:.4} and {b:.4} fibres");
            checks.at_most(
                "round and nearly round plies, jump over one and the count",
                (a - b).abs() / (1.0 + a.max(b)),
                0.02,
                &at,
            );
        }
    }
}
