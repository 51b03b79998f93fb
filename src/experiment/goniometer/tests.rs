//! What the goniometer says of specimens whose answer is known.

use std::f64::consts::PI;

use super::*;
use crate::{
    geometry::{ply::PlyParameters, yarn::touching_plies},
    scattering::fiber::FiberMaterial,
    scene::{
        Model, Yarn,
        load::{Definitions, LoadOptions, load_definitions},
    },
};

fn library(assignments: &[&str]) -> Definitions {
    let options =
        LoadOptions { assignments: assignments.iter().map(|a| (*a).to_owned()).collect(), ..LoadOptions::default() };
    load_definitions(None, &options).unwrap()
}

fn total(m: &Measurement) -> [f64; 3] {
    std::array::from_fn(|c| m.scattered.forward[c].mean + m.scattered.backward[c].mean)
}

#[test]
fn a_fiber_returns_its_albedos() {
    let material = FiberMaterial {
        r: [0.2, 0.0, 0.1],
        tt: [0.3, 0.5, 0.0],
        d: [0.1, 0.4, 0.0],
        beta_r: 0.15,
        beta_tt: 0.12,
        beta_n: 0.35,
    };
    for theta in [0.0, 0.7, 1.4] {
        let view = View { theta, ..View::default() };
        let m = measure(&Specimen::Fiber(&material), &view, Effort { paths: 50_000, seed: 1 });
        let lobes = m.lobes.unwrap();
        for (lobe, albedo) in [material.r, material.tt, material.d].into_iter().enumerate() {
            for (c, albedo) in albedo.into_iter().enumerate() {
                let (f, b) = (lobes[lobe].forward[c], lobes[lobe].backward[c]);
                let slack = 5.0 * f.se.unwrap().hypot(b.se.unwrap()) + 1e-3;
                assert!((f.mean + b.mean - albedo).abs() < slack, "theta {theta} lobe {lobe}: {f:?} {b:?}");
            }
        }
        // TT is narrow and forward.
        assert!(lobes[1].backward[1].mean < 1e-3);
    }
}

#[test]
fn energies_are_the_same_by_cells_by_lobes_and_by_values() {
    let definitions = library(&[]);
    let specimen = Specimen::Yarn(definitions.yarn("silk1").unwrap(), Model::Aggregated);
    let view = View { theta: 0.5, ..View::default() };
    let effort = Effort { paths: 60_000, seed: 3 };
    let m = measure(&specimen, &view, effort);
    for c in 0..3 {
        let cells: f64 = m.distribution.energy.iter().map(|e| e[c]).sum();
        assert!((cells - total(&m)[c]).abs() < 1e-9, "{cells} {:?}", total(&m));
    }
    // Values are drawn by another way through the model: their integral over the sphere.
    let prepared = specimen.prepare(&view);
    let (rows, columns) = (18, 24);
    let mut sum = [0.0; 3];
    for i in 0..rows * columns {
        let theta = (f64::from(i / columns) + 0.5) / f64::from(rows) * PI - 0.5 * PI;
        let phi = (f64::from(i % columns) + 0.5) / f64::from(columns) * 2.0 * PI;
        let v = value_of(&prepared, &view, (theta, phi), Effort { paths: 800, seed: i as u32 });
        let solid_angle = theta.cos() * PI / f64::from(rows) * 2.0 * PI / f64::from(columns);
        for (c, sum) in sum.iter_mut().enumerate() {
            *sum += v.iter().map(|lobe| lobe[c].mean).sum::<f64>() * solid_angle;
        }
    }
    for (c, sum) in sum.into_iter().enumerate() {
        assert!((sum / total(&m)[c] - 1.0).abs() < 0.02, "channel {c}: {sum} {:?}", total(&m));
    }
}

#[test]
fn white_yarns_lose_nothing() {
    let definitions =
        library(&["fiber.silk.r=[0.2,0.2,0.2]", "fiber.silk.tt=[0.5,0.5,0.5]", "fiber.silk.d=[0.3,0.3,0.3]"]);
    for (name, flatten) in [("silk1", 1.0), ("silk1", 2.0), ("knitting", 1.0)] {
        let specimen = Specimen::Yarn(definitions.yarn(name).unwrap(), Model::Aggregated);
        let m = measure(&specimen, &View { theta: 0.4, flatten, ..View::default() }, Effort { paths: 60_000, seed: 4 });
        let all = m.unscattered.mean + total(&m)[1];
        assert!((all - 1.0).abs() < 0.02, "{name}: {all}");
    }
}

#[test]
fn results_do_not_depend_on_threads() {
    let definitions = library(&[]);
    let specimen = Specimen::Yarn(definitions.yarn("silk1").unwrap(), Model::Aggregated);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| measure(&specimen, &View::default(), Effort { paths: 2000, seed: 5 }).distribution.energy)
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn a_ply_alone_has_the_density_it_has_in_its_yarn() {
    let definitions = library(&[]);
    let yarn = definitions.yarn("silk1").unwrap();
    let alone = ply_alone(yarn, 1);
    let density = |p: &crate::geometry::ply::PlyParameters| f64::from(p.fibers) * (p.fiber_radius / p.radius).powi(2);
    assert!((density(&alone.plies[0]) / density(&yarn.plies[1]) - 1.0).abs() < 1e-12);
    assert_eq!(alone.plies.len(), alone.fibers.len());
    let long = alone.plies[0].radius / alone.plies[0].aspect.sqrt();
    assert!((long - 1.0).abs() < 1e-12, "it fills its yarn: {long}");
}

#[test]
fn an_option_of_density_takes_the_place_of_a_fiber_radius() {
    let definitions = library(&["yarn.silk1.density=0.5"]);
    let p = &definitions.yarn("silk1").unwrap().plies[0];
    assert!((f64::from(p.fibers) * (p.fiber_radius / p.radius).powi(2) - 0.5).abs() < 1e-12);
}

/// The truths: explicit fibres traced by another program.
fn oracle() -> Vec<serde_json::Value> {
    serde_json::from_str(&crate::testing::data("truth_energies.json")).unwrap()
}

/// The yarn and view of one of them.
fn configuration(v: &serde_json::Value) -> (Yarn, View) {
    let number = |key: &str| v[key].as_f64().unwrap();
    let triple = |v: &serde_json::Value| -> [f64; 3] { std::array::from_fn(|c| v[c].as_f64().unwrap()) };
    let plies = v["n_plies"].as_u64().unwrap() as u32;
    let (radius, distance) = touching_plies(plies);
    let one = |k: u32| PlyParameters {
        radius,
        aspect: 1.0,
        distance,
        angle: 2.0 * PI * f64::from(k) / f64::from(plies),
        fibers: v["n"].as_u64().unwrap() as u32,
        fiber_radius: number("r_f") * radius,
        fiber_twist: number("twist_deg").to_radians(),
    };
    let fiber = |k: u32| {
        let scale = triple(&v["ply_scale"][k as usize]);
        let scaled = |key: &str| -> [f64; 3] { std::array::from_fn(|c| triple(&v[key])[c] * scale[c]) };
        FiberMaterial {
            r: scaled("a_r"),
            tt: scaled("a_tt"),
            d: scaled("a_d"),
            beta_r: number("beta_R"),
            beta_tt: number("beta_TT"),
            beta_n: number("beta_N"),
        }
    };
    let yarn = Yarn {
        plies: (0..plies).map(one).collect(),
        fibers: (0..plies).map(|k| (format!("ply {k}"), fiber(k))).collect(),
        ply_twist: 0.0,
        radius: 1.0,
        ..library(&[]).yarn("silk1").unwrap().clone()
    };
    let phase = number("ply_phase");
    let view =
        View { theta: number("theta_deg").to_radians(), phase: (phase > -100.0).then_some(phase), ..View::default() };
    (yarn, view)
}

/// Mean errors over cases and channels: of reflected and of transmitted (with unscattered) energy as shares of the
/// incident light, and the same relative to the truth, or to 1 % of the light
/// where that is more (fibres that only transmit return 1e-5, of which the model makes several times as much). Each case has its own seed, so that noise is averaged over.
fn errors(model: Model, cases: &[&serde_json::Value], paths: u64) -> [f64; 4] {
    let mut sums = [0.0; 4];
    for (seed, v) in cases.iter().enumerate() {
        let (yarn, view) = configuration(v);
        let m = measure(&Specimen::Yarn(&yarn, model), &view, Effort { paths, seed: seed as u32 });
        let (reflected, transmitted) = m.energies();
        let t0 = v["T0"].as_f64().unwrap();
        for c in 0..3 {
            let want = [v["back"][c].as_f64().unwrap(), v["fwd"][c].as_f64().unwrap() + t0];
            for (k, got) in [reflected[c].mean, transmitted[c].mean].into_iter().enumerate() {
                sums[k] += (got - want[k]).abs();
                sums[k + 2] += (got - want[k]).abs() / want[k].max(0.01);
            }
        }
    }
    sums.map(|s| s / (3 * cases.len()) as f64)
}

#[test]
fn the_recommended_model_keeps_its_distance_from_the_oracle() {
    let all = oracle();
    let dense = |plies: &dyn Fn(u64) -> bool| -> Vec<&serde_json::Value> {
        all.iter()
            .filter(|v| plies(v["n_plies"].as_u64().unwrap()) && v["density_area"].as_f64().unwrap() >= 0.3 - 1e-9)
            .collect()
    };
    // Of one ply, fibres that only transmit make most of the third error.
    // With 16,000 paths and one seed for all cases, noise alone moves these means by 0.001 (relative ones by 0.005).
    for (name, cases, paths, bounds) in [
        ("one ply", dense(&|n| n == 1), 64_000, [0.0063, 0.0079, 0.03, 0.056]),
        ("several plies", dense(&|n| n > 1), 192_000, [0.0022, 0.0018, 0.013, 0.0057]),
    ] {
        let ours = errors(Model::Aggregated, &cases, paths);
        let printed = errors(Model::Printed, &cases, 16_000);
        eprintln!("{name}, {} cases of density 0.3 to 0.9: {ours:.4?}; printed {printed:.3?}", cases.len());
        assert!(ours.iter().zip(bounds).all(|(e, bound)| *e <= bound), "{name}: {ours:?}");
        assert!(printed.iter().zip(ours).all(|(p, o)| *p > 4.0 * o), "the printed model has become good: {printed:?}");
    }
}

/// The table of truth that is part of the project, with the yarns it is of.
fn table() -> (Definitions, Vec<serde_json::Value>) {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/truth");
    let definitions = load_definitions(Some(&folder.join("yarns.toml")), &LoadOptions::default()).unwrap();
    let text = std::fs::read_to_string(folder.join("table.json")).unwrap();
    (definitions, serde_json::from_str(&text).unwrap())
}

fn seen(row: &serde_json::Value) -> View {
    View { theta: row["theta"].as_f64().unwrap().to_radians(), ..View::default() }
}

#[test]
fn the_recommended_model_keeps_to_the_table_of_truth() {
    let (definitions, rows) = table();
    let mut errors = [0.0; 3];
    for row in &rows {
        let yarn = definitions.yarn(row["yarn"].as_str().unwrap()).unwrap();
        for (k, model) in [Model::Aggregated, Model::TwoStream, Model::Printed].into_iter().enumerate() {
            let m = measure(&Specimen::Yarn(yarn, model), &seen(row), Effort { paths: 20_000, seed: 2 });
            let (back, on) = m.energies();
            let unscattered = row["unscattered"].as_f64().unwrap();
            for c in 0..3 {
                let number = |key: &str| row[key][c].as_f64().unwrap();
                for (got, want, se) in [
                    (back[c], number("backward"), number("backward_se")),
                    (on[c], number("forward") + unscattered, number("forward_se")),
                ] {
                    errors[k] += (got.mean / want - 1.0).abs() / (6 * rows.len()) as f64;
                    let slack = (0.06 * want + 0.01).max(4.0 * se.hypot(got.se.unwrap()));
                    if model == Model::Aggregated {
                        assert!((got.mean - want).abs() < slack, "{row}, channel {c}: {got:?}, not {want}");
                    }
                }
            }
        }
    }
    eprintln!(
        "mean relative errors: aggregated {:.4}, two-stream {:.3}, printed {:.3}",
        errors[0], errors[1], errors[2]
    );
    assert!(errors[0] < 0.05 && errors[1] > 2.0 * errors[0] && errors[2] > 5.0 * errors[0], "{errors:?}");
}

#[test]
fn a_new_truth_agrees_with_the_table() {
    let (definitions, rows) = table();
    for row in rows.iter().filter(|r| r["yarn"] == "ply" || r["yarn"] == "three") {
        let yarn = definitions.yarn(row["yarn"].as_str().unwrap()).unwrap();
        let m = truth(yarn, &seen(row), Effort { paths: 6_000, seed: 77 }).unwrap();
        assert_eq!(m.paths, 6_000);
        for c in 0..3 {
            for (got, key) in [(m.scattered.backward[c], "backward"), (m.scattered.forward[c], "forward")] {
                let (want, se) = (row[key][c].as_f64().unwrap(), row[format!("{key}_se")][c].as_f64().unwrap());
                assert!(
                    (got.mean - want).abs() < 5.0 * se.hypot(got.se.unwrap()),
                    "{row}, {key} {c}: {got:?}, not {want} +- {se}"
                );
            }
        }
        let whole = m.distribution.energy.iter().map(|e| e[1]).sum::<f64>();
        let halves = m.scattered.forward[1].mean + m.scattered.backward[1].mean;
        assert!((whole - halves).abs() < 1e-9 && m.lobes.is_none());
    }
}

#[test]
fn pressed_yarns_agree_with_pressed_fibers() {
    let definitions = library(&[]);
    let yarn = definitions.yarn("silk1").unwrap();
    let view = View { flatten: 1.75, ..View::default() };
    let ours = measure(&Specimen::Yarn(yarn, Model::Aggregated), &view, Effort { paths: 60_000, seed: 6 });
    let fibers = truth(yarn, &view, Effort { paths: 24_000, seed: 6 }).unwrap();
    assert!((ours.unscattered.mean - fibers.unscattered.mean).abs() < 0.01 + 4.0 * fibers.unscattered.se.unwrap());
    for ((got, want), bound) in [(ours.energies().0, fibers.energies().0), (ours.energies().1, fibers.energies().1)]
        .into_iter()
        .zip([0.05, 0.04])
    {
        for c in 0..3 {
            let off = (got[c].mean / want[c].mean).ln().abs();
            assert!(
                off < bound + 4.0 * want[c].se.unwrap() / want[c].mean,
                "channel {c}: {:?}, not {:?}",
                got[c],
                want[c]
            );
        }
    }
    // As wide as when it was round, it is less deep.
    let round = measure(&Specimen::Yarn(yarn, Model::Aggregated), &View::default(), Effort { paths: 20_000, seed: 6 });
    assert!(ours.unscattered.mean > round.unscattered.mean, "{:?} {:?}", ours.unscattered, round.unscattered);
}

#[test]
fn white_fibers_return_all_light_whatever_their_packing() {
    let (definitions, _) = table();
    let mut yarn = definitions.yarn("three").unwrap().clone();
    for (_, fiber) in &mut yarn.fibers {
        (fiber.r, fiber.tt, fiber.d) = ([0.2; 3], [0.5; 3], [0.3; 3]);
    }
    let view = View { theta: 0.3, offset: Some(0.2), phase: Some(0.4), ..View::default() };
    let m = truth(&yarn, &view, Effort { paths: 4_000, seed: 1 }).unwrap();
    let all = m.unscattered.mean + total(&m)[0];
    assert!((all - 1.0).abs() < 1e-4, "{all}");
}

/// Light that wanders about in an elliptical ply leaves it across its flat sides, whichever way these lie.
#[test]
fn elliptical_plies_send_light_where_their_fibers_do() {
    let definitions = library(&[]);
    let mut yarn = ply_alone(definitions.yarn("rayon1").unwrap(), 0);
    for (_, fiber) in &mut yarn.fibers {
        (fiber.r, fiber.tt, fiber.d) = ([0.0; 3], [0.0; 3], [0.97, 0.95, 0.9]);
    }
    for phase in [0.0, 0.5 * PI] {
        let view = View { phase: Some(phase), ..View::default() };
        let ours = measure(&Specimen::Yarn(&yarn, Model::Aggregated), &view, Effort { paths: 80_000, seed: 8 });
        let fibers = truth(&yarn, &view, Effort { paths: 80_000, seed: 8 }).unwrap();
        let [got, want] = [&ours, &fibers].map(|m| by_azimuth(&m.distribution));
        for (sector, (got, want)) in got.iter().zip(&want).enumerate() {
            for c in 0..3 {
                // As circles they were .86 to 1.13 of it.
                let off = (got[c] / want[c]).ln().abs();
                assert!(off < 0.08, "phase {phase}, sector {sector}, channel {c}: {got:?}, not {want:?}");
            }
        }
    }
}

/// What goes straight on, to the sides and back, each a third of the azimuths from one to the other.
fn by_azimuth(distribution: &Distribution) -> [[f64; 3]; 3] {
    let mut sums = [[0.0; 3]; 3];
    for (cell, energy) in distribution.energy.iter().enumerate() {
        let from_back = ((cell % COLUMNS) as f64 + 0.5) / COLUMNS as f64 * 2.0 - 1.0;
        let sector = (3.0 * (1.0 - from_back.abs())) as usize;
        (0..3).for_each(|c| sums[sector.min(2)][c] += energy[c]);
    }
    sums
}
