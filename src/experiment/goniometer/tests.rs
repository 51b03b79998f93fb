//! What the goniometer says of specimens whose answer is known.

use std::f64::consts::PI;

use super::*;
use crate::{
    scattering::fiber::FiberMaterial,
    scene::{
        Model,
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

const AVERAGED: View = View { theta: 0.0, offset: None, phase: None };

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
        let view = View { theta, ..AVERAGED };
        let m = measure(&Specimen::Fiber(&material), &view, Effort { paths: 50_000, seed: 1 });
        let lobes = m.lobes.unwrap();
        for (lobe, albedo) in [material.r, material.tt, material.d].into_iter().enumerate() {
            for (c, albedo) in albedo.into_iter().enumerate() {
                let (f, b) = (lobes[lobe].forward[c], lobes[lobe].backward[c]);
                let slack = 5.0 * f.se.hypot(b.se) + 1e-3;
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
    let view = View { theta: 0.5, offset: None, phase: None };
    let effort = Effort { paths: 60_000, seed: 3 };
    let m = measure(&specimen, &view, effort);
    for c in 0..3 {
        let cells: f64 = m.distribution.energy.iter().map(|e| e[c]).sum();
        assert!((cells - total(&m)[c]).abs() < 1e-9, "{cells} {:?}", total(&m));
    }
    // Values are drawn by another way through the model: their integral over the sphere.
    let (rows, columns) = (18, 24);
    let mut sum = [0.0; 3];
    for i in 0..rows * columns {
        let theta = (f64::from(i / columns) + 0.5) / f64::from(rows) * PI - 0.5 * PI;
        let phi = (f64::from(i % columns) + 0.5) / f64::from(columns) * 2.0 * PI;
        let v = value(&specimen, &view, (theta, phi), Effort { paths: 800, seed: i as u32 });
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
    for name in ["silk1", "knitting"] {
        let specimen = Specimen::Yarn(definitions.yarn(name).unwrap(), Model::Aggregated);
        let m = measure(&specimen, &View { theta: 0.4, ..AVERAGED }, Effort { paths: 60_000, seed: 4 });
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
        pool.install(|| measure(&specimen, &AVERAGED, Effort { paths: 2000, seed: 5 }).distribution.energy)
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn a_ply_alone_has_the_density_it_has_in_its_yarn() {
    let definitions = library(&[]);
    let yarn = definitions.yarn("silk1").unwrap();
    let alone = ply_alone(yarn, 1);
    let density = |p: &crate::geometry::yarn::PlyParameters| f64::from(p.fibers) * (p.fiber_radius / p.radius).powi(2);
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
