//! The vertex against a slow evaluation of the same model: all nodes, all channels, all azimuths.

use std::{
    f32::consts::{PI, TAU},
    f64::consts::TAU as TAU64,
};

use glam::Vec2;

use super::*;
use crate::{
    geometry::{
        cleared_strip::ClearedStrip,
        ply::{PlyParameters, PlyShape},
        yarn::touching_plies,
        yarn_frame::Pressed,
    },
    math::special::{GAUSS_LEGENDRE_4, front_share_of_wrapped_normal, wrapped_normal},
    scattering::{
        kernel::{DIFFUSE, Latitudes, kappa_of_variance, kernel, spread},
        lobe::LobeFrame,
        medium::{MirroredLobe, PlyOptics, extinction_rate},
        testing::{SILK, lossless, material, section, silk, sphere},
    },
};

fn yarn(plies: u32, fibers: u32, density: f64, ply_twist: f64, fiber_twist: f64, m: &FiberMaterial) -> AggregatedYarn {
    let shape = crate::geometry::yarn::tests::touching_yarn(plies, fibers, density, ply_twist, fiber_twist);
    let count = shape.plies.len();
    AggregatedYarn::new(shape, &vec![m; count])
}

/// Single scattering and B in their plain form, without any drawing: (single scattering, B) for each direction.
///
/// `beta` are the widths of R and TT, radians. Nodes per ply and channel as given; the share that escapes is a mean over 32 directions across the yarn, as the
/// specification has it.
fn quadrature(
    nodes: &[(f64, f64)],
    yarn: &AggregatedYarn,
    beta: [f64; 2],
    section: &Section<'_>,
    directions: &[Vec3A],
) -> Vec<[Rgb; 2]> {
    let mut crossings = Crossings::new();
    section.crossings(yarn.occluder().shape(), &mut crossings);
    let view = View::new(yarn, section);
    let mut out = vec![[Rgb::ZERO; 2]; directions.len()];
    let mut reaching = Rgb::ONE;
    for c in &crossings {
        let optics = &yarn.plies[c.ply];
        let depth = optics.rho * c.fibers;
        let ended = depth.one_minus_exp_neg();
        let mut clear_share = Rgb::ZERO;
        for &(u, weight) in nodes {
            for channel in 0..3 {
                let mut only = [0.0; 3];
                only[channel] = 1.0;
                let only = Rgb::from(only);
                let (d, e) = (depth.to_array()[channel], ended.to_array()[channel]);
                let x = if d > 1e-6 { -(-(u as f32) * e).ln_1p() / d } else { u as f32 };
                let amplitude = reaching * ended * (weight as f32);
                let at = c.enter + (c.exit - c.enter) * x;
                let inside = section.inside(yarn.occluder().shape(), section.point(at), c.travel_at(at));
                let node = (Spot::new(&view, c.ply, inside), c.fibers * x);
                for (w, out) in directions.iter().zip(&mut out) {
                    out[0] += amplitude * plain_lobes(&view, beta, &node, *w).0 * only;
                }
                let mean = (0..32)
                    .map(|i| {
                        let (s, c) = ((i as f32 + 0.5) / 32.0 * TAU).sin_cos();
                        plain_lobes(&view, beta, &node, Vec3A::new(c, s, 0.0)).1
                    })
                    .fold(Rgb::ZERO, |a, b| a + b)
                    / 32.0;
                clear_share += mean * only * (weight as f32);
            }
        }
        let energy = reaching * ended * optics.albedo * optics.leaves_yarn * (Rgb::ONE - clear_share);
        for (w, out) in directions.iter().zip(&mut out) {
            out[1] += plain_backward(&view, c, energy, *w);
        }
        reaching *= (-depth).exp();
    }
    out
}

/// R, TT and D of the plain form for a node with so many expected fibres before it, and what of them passes on the way out: past fibres that
/// are even over the core, which alone is passed.
fn plain_lobes(view: &View<'_>, beta: [f64; 2], (spot, before): &(Spot, f32), w: Vec3A) -> (Rgb, Rgb) {
    const SHRINK: f32 = 0.4;
    let shape = view.yarn.occluder().shape();
    let optics = &view.yarn.plies[spot.ply];
    let ply = &shape.plies[spot.ply];
    let out = Vec3A::new(w.x, w.y, 0.0).normalize_or_zero();
    let shift = optics.lead * (1.0 - SHRINK * ply.density() as f32).max(0.0) * (Vec3A::X + out);
    let sine = if out.x > 0.0 { out.y.abs() } else { 1.0 };
    let strip = ClearedStrip::new(2.0 * ply.fiber_radius, [0.0, sine], [0.0, f32::INFINITY]);
    let mut depth = Rgb::ZERO;
    view.section.plies_ahead(shape, &spot.inside, shift, w, |way| {
        let ply = &shape.plies[way.ply];
        let sigma = 2.0 * ply.fiber_radius * ply.fibers / (PI * ply.core_radius * ply.core_radius);
        let half = (ply.core_radius * ply.core_radius - way.offset * way.offset).max(0.0).sqrt() / way.length;
        let (from, to) = ((way.foot - half).max(0.0), (way.foot + half).max(0.0));
        if half > 0.0 {
            let cleared = strip.length(from + optics.lead, to + optics.lead);
            depth += view.yarn.plies[way.ply].rho * (sigma * (to - from - cleared));
        }
    });
    // Of the node's own fibre, for all of the way.
    let own = spot.inside.fiber_tangent(shape, view.section, spot.ply);
    let across = own.length_squared() - w.dot(own).powi(2);
    let depth = depth * (view.section.squeeze() * (across / (1.0 - w.z * w.z)).max(0.0).sqrt());
    let sines = [view.camera, w].map(|v| v.dot(spot.tangent).clamp(-1.0, 1.0));
    let cosines = sines.map(|sin| (1.0 - sin * sin).sqrt());
    let at = Latitudes::new(sines[0], cosines[0], sines[1], cosines[1]);
    let events = optics.events * (depth / optics.rho + Rgb::splat(*before));
    let [r, tt] = beta.map(|beta| Rgb::splat((beta * beta) as f32));
    let [r, tt] = [r, tt].map(|own| kernel(kappa_of_variance(events * tt + own), at));
    let clear = (-depth).exp();
    let lobes = optics.single_r * r + optics.single_tt * tt + optics.single_d * DIFFUSE;
    (lobes * clear * (cosines[1] / TAU), clear)
}

/// B of the plain form: a share of it, by the ply's thickness, leans as (1 + cos phi) / 2 pi from where the camera looks. The program
/// has solved where it leaves; its energy and its latitudes are the same.
fn plain_backward(view: &View<'_>, crossing: &PlyCrossing, energy: Rgb, w: Vec3A) -> Rgb {
    let shape = view.yarn.occluder().shape();
    let (ply, optics) = (&shape.plies[crossing.ply], &view.yarn.plies[crossing.ply]);
    let relative = if shape.plies.len() == 1 { crossing.offset / ply.radius } else { view.section.h };
    let to = 1.2 * relative.clamp(-1.0, 1.0).asin();
    let frame = LobeFrame::of_ply(shape, view.section, crossing, view.camera);
    let (at, cos) = frame.latitudes(w);
    let across = Vec2::new(w.dot(frame.x), w.dot(frame.y)).normalize();
    let free_paths = |chain: f32| {
        let sigma = 2.0 * ply.fiber_radius * ply.fibers / (PI * ply.core_radius);
        sigma * extinction_rate(f64::from(1.0 - chain), ply.density()) as f32
    };
    let thickness = Rgb::from(optics.chain.to_array().map(free_paths));
    let lean = thickness / (thickness + Rgb::splat(10.0)) * 3.2 * (Rgb::ONE - optics.albedo * 0.14);
    let latitude = optics.latitude_of_multiple(at, 0.0);
    let around = lean.min(Rgb::ONE) * across.dot(Vec2::from_angle(to)) + 1.0;
    energy * latitude * around * (cos / TAU)
}

/// F of the plain form, and T0: the camera's chord alone says how much passes, and the mean number of TT events how far it
/// is spread. The program has a better F; the chain's rate, the kernel and the wrapped normal are the same.
fn plain_forward(yarn: &AggregatedYarn, beta_tt: f64, section: &Section<'_>, directions: &[Vec3A]) -> (Vec<Rgb>, f32) {
    let mut crossings = Crossings::new();
    section.crossings(yarn.occluder().shape(), &mut crossings);
    let view = View::new(yarn, section);
    let sum = |of: &dyn Fn(&PlyOptics) -> Rgb| {
        crossings.iter().map(|c| of(&yarn.plies[c.ply]) * c.fibers).fold(Rgb::ZERO, |a, b| a + b)
    };
    let passed = (-sum(&|p| p.rho)).exp();
    let unscattered = (-sum(&|p| Rgb::splat(p.gaps.rate))).exp().mean();
    let Some(front) = crossings.first() else { return (vec![Rgb::ZERO; directions.len()], unscattered) };
    let optics = &yarn.plies[front.ply];
    let chain = sum(&|p| p.chain);
    let events = chain.select_below(1e-6, Rgb::ONE, chain / chain.one_minus_exp_neg().max(Rgb::splat(1e-30)));
    let frame = LobeFrame::of_ply(yarn.occluder().shape(), section, front, view.camera);
    let value = |w: &Vec3A| {
        let (at, cos) = frame.latitudes(*w);
        let off = w.dot(frame.y).atan2(w.dot(frame.x)) - PI;
        let around = Rgb::from((events.sqrt() * optics.tt.sigma).to_array().map(|s| wrapped_normal(off, s)));
        let m = kernel(kappa_of_variance(events * ((beta_tt * beta_tt) as f32)), at);
        (passed - unscattered).max(Rgb::ZERO) * m * around * cos
    };
    (directions.iter().map(value).collect(), unscattered)
}

/// The configurations of the sampling tests: plies, fibres, density, ply and fibre twist, h, theta, phase.
type Case = (u32, u32, f64, f64, f64, f32, f32, f32);
const CASES: [Case; 7] = [
    (1, 100, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0),
    (1, 100, 0.3, 0.0, 0.0, 0.7, 1.0, 0.0),
    (1, 25, 0.1, 0.0, 0.0, 0.95, 0.3, 0.0),
    (1, 400, 0.6, 0.0, 0.44, 0.3, 0.5, 0.0),
    (3, 100, 0.4, 0.0, 0.0, 0.28, 0.4, 0.4),
    (3, 70, 0.5, 0.23, -0.33, -0.56, 0.8, 0.4),
    (2, 50, 0.2, 0.1, 0.7, 0.25, 0.9, 2.0),
];

/// How sections are pressed flat in the sampling tests.
const PRESSED: [Option<Pressed>; 2] = [None, Some(Pressed { axis: Vec2::new(0.8, 0.6), stretch: 2.0 })];

/// Every case, round and pressed flat.
fn cases() -> impl Iterator<Item = (Case, Option<Pressed>)> {
    CASES.into_iter().flat_map(|case| PRESSED.map(|pressed| (case, pressed)))
}

pub(super) fn build(case: Case, pressed: Option<Pressed>, m: &FiberMaterial) -> (AggregatedYarn, Section<'static>) {
    let (plies, fibers, density, ply_twist, fiber_twist, h, theta, phase) = case;
    let mut shape = crate::geometry::yarn::tests::touching_yarn(plies, fibers, density, ply_twist, fiber_twist);
    // Crowded as fibres that keep out of each other are.
    for ply in &mut shape.plies {
        ply.crowding = 0.06;
    }
    let section = Section { pressed, ..section(theta, h, phase) };
    let stretch = pressed.map_or(1.0, |pressed| f64::from(pressed.stretch));
    (AggregatedYarn::pressed(shape, &vec![m; plies as usize], stretch, &Solutions::default()), section)
}

#[test]
fn values_agree_with_the_reference_vectors() {
    let text = crate::testing::data("model_vectors.json");
    let vectors: serde_json::Value = serde_json::from_str(&text).unwrap();
    let numbers =
        |v: &serde_json::Value| -> Vec<f64> { v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect() };
    let triple = |v: &serde_json::Value| -> [f64; 3] { numbers(v).try_into().unwrap() };
    let mut compared = 0;
    for (index, v) in vectors.as_array().unwrap().iter().enumerate() {
        let count = v["n_plies"].as_u64().unwrap() as u32;
        let (radius, distance) = touching_plies(count);
        let beta = numbers(&v["beta"]);
        let m = material((triple(&v["a_r"]), triple(&v["a_tt"]), triple(&v["a_d"])), [beta[0], beta[1], beta[2]]);
        // The vectors have plies of radius 1 that touch; here the yarn has radius 1.
        let parameters: Vec<PlyParameters> = (0..count)
            .map(|k| PlyParameters {
                radius,
                aspect: 1.0,
                distance,
                angle: TAU64 * f64::from(k) / f64::from(count),
                fibers: v["n"].as_u64().unwrap() as u32,
                fiber_radius: v["r_f"].as_f64().unwrap() * radius,
                fiber_twist: v["twist_deg"].as_f64().unwrap().to_radians(),
            })
            .collect();
        let shape = YarnShape::new(&parameters, 0.0, true);
        let mut yarn = AggregatedYarn::new(shape.clone(), &vec![&m; count as usize]);
        // Chains run straight, and what leaves them is even: as much as lies behind, twice.
        let chain = 2.0 * front_share_of_wrapped_normal(m.beta_n) - 1.0;
        let out = 1.0 - chain;
        let straight = FiberMaterial {
            tt: m.tt.map(|tt| tt * chain),
            d: std::array::from_fn(|c| m.d[c] + m.tt[c] * out),
            beta_n: 1e-6,
            ..m.clone()
        };
        // Each other ply takes as much of the view as one that touches.
        let others = f64::from(count - 1) * 0.1817;
        let straight = |ply: &PlyShape| PlyOptics::new(&straight, ply, others, 1.0, &Solutions::default());
        for (ply, straight) in yarn.plies.iter_mut().zip(shape.plies.iter().map(straight)) {
            (ply.rho, ply.leaves_yarn, ply.slope) = (straight.rho, straight.leaves_yarn, 0.0);
            let single = |part: &dyn Fn(usize) -> f64| {
                Rgb::from([0, 1, 2].map(|c: usize| part(c) / (1.0 - m.tt[c] * chain).max(1e-12)))
            };
            (ply.chain, ply.chain_share) = (Rgb::from(m.tt.map(|tt| tt * chain)), chain as f32);
            ply.single_r = single(&|c| m.r[c]);
            ply.single_d = single(&|c| m.d[c]);
            ply.single_tt = single(&|c| m.tt[c] * out);
            ply.albedo = ply.single_r + ply.single_d + ply.single_tt;
            // Chains widen R by their mean, and what was only ever reflected is as wide as two reflections.
            (ply.sharp, ply.events) = (false, ply.chain);
            let [touched, untouched] = straight.mirrored.map(|lobe| lobe.share);
            let two_reflections = Rgb::splat(spread(2f64.sqrt() * beta[0]) as f32);
            let lobe = |share| MirroredLobe { share, spread: two_reflections };
            ply.mirrored = [touched + untouched, Rgb::ZERO].map(lobe);
        }
        let section = section(
            v["theta_c"].as_f64().unwrap() as f32,
            (v["h"].as_f64().unwrap() * radius) as f32,
            v["phase"].as_f64().unwrap() as f32,
        );
        let directions: Vec<Vec3A> = v["w_l"]
            .as_array()
            .unwrap()
            .iter()
            .map(|w| {
                let w = numbers(w);
                Vec3A::new(w[0] as f32, w[1] as f32, w[2] as f32)
            })
            .collect();
        let values = quadrature(&GAUSS_LEGENDRE_4, &yarn, [beta[0], beta[1]], &section, &directions);
        let (forward, t0) = plain_forward(&yarn, beta[1], &section, &directions);
        let want = v["T0"].as_f64().unwrap();
        assert!((f64::from(t0) - want).abs() < 1e-4 * want + 1e-5, "vector {index}: T0 {t0}, not {want}");
        for (d, value) in values.iter().enumerate() {
            let value = [forward[d], value[0], value[1]];
            for (lobe, name) in ["V_F", "V_I1", "V_I2"].iter().enumerate() {
                let want = triple(&v[*name][d]);
                for (c, &want) in want.iter().enumerate() {
                    let got = f64::from(value[lobe].to_array()[c]);
                    // Far in the tails of narrow lobes single-precision sines set the last digits of the exponent.
                    let slack = 1e-4 * want + 1e-6;
                    assert!((got - want).abs() < slack, "vector {index} direction {d} {name}[{c}]: {got}, not {want}");
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 2000);
}

/// White fibres whose colours take different ways through them.
fn white_by_different_ways() -> FiberMaterial {
    material(([0.1, 0.2, 0.0], [0.9, 0.3, 0.0], [0.0, 0.5, 1.0]), [0.15, 0.12, 0.35])
}

#[test]
fn white_fibers_return_all_light_whatever_ways_its_colours_take() {
    for (index, (case, pressed)) in cases().enumerate() {
        for (m, slack) in [(lossless(), 0.003), (white_by_different_ways(), 0.01)] {
            let (yarn, section) = build(case, pressed, &m);
            let arrival = Arrival { throughput: Rgb::ONE, lit: index % 2 == 0, first_fiber: None };
            let mut crossings = Crossings::new();
            section.crossings(yarn.occluder().shape(), &mut crossings);
            if crossings.is_empty() {
                // It passes beside what is pressed flat.
                continue;
            }
            let t0 = yarn.occluder().transparency(&crossings);
            let mut stream = Stream::new(9);
            let (mut sum, mut square) = ([0f64; 3], [0f64; 3]);
            let n = 30_000;
            for _ in 0..n {
                let u = [0; 4].map(|_| stream.next());
                let vertex = Vertex::new(&yarn, &section, &crossings, t0, arrival, u, &mut stream);
                let u = [0; 3].map(|_| stream.next());
                let weight = vertex.sample(u, &mut stream).map_or(Rgb::ZERO, |c| c.weight);
                for (c, w) in weight.to_array().into_iter().enumerate() {
                    sum[c] += f64::from(w) / f64::from(n);
                    square[c] += f64::from(w).powi(2) / f64::from(n);
                }
            }
            for c in 0..3 {
                let se = ((square[c] - sum[c] * sum[c]).max(0.0) / f64::from(n)).sqrt();
                eprintln!("{case:?} {pressed:?} channel {c}: {:.5} +- {se:.5}", sum[c]);
                // The node's lobes are as wide as the light's way makes them, those that decide what stays as sampled.
                let off = (sum[c] - 1.0).abs();
                assert!(off < 4.5 * se + slack, "{case:?} {pressed:?} channel {c}: {} +- {se}", sum[c]);
            }
        }
    }
}

#[test]
fn samples_estimate_the_integral_with_bounded_weights_and_light_weighting_loses_nothing() {
    for (index, (case, pressed)) in cases().enumerate() {
        for (white, m, lit) in [(true, lossless(), true), (false, silk(), true), (false, silk(), false)] {
            let (yarn, section) = build(case, pressed, &m);
            let arrival = Arrival { throughput: Rgb::ONE, lit, first_fiber: None };
            let mut crossings = Crossings::new();
            section.crossings(yarn.occluder().shape(), &mut crossings);
            let t0 = yarn.occluder().transparency(&crossings);
            let mut stream = Stream::new(100 + index as u32);
            let n = 20_000;
            let (mut sum, mut square, mut largest) = (0f64, 0f64, 0f32);
            let (mut both, mut both_square) = (0f64, 0f64);
            for _ in 0..n {
                let u = [0; 4].map(|_| stream.next());
                let vertex = Vertex::new(&yarn, &section, &crossings, t0, arrival, u, &mut stream);
                let u = [0; 3].map(|_| stream.next());
                let weight = vertex.sample(u, &mut stream).map_or(Rgb::ZERO, |c| c.weight);
                largest = largest.max(weight.max_channel());
                sum += f64::from(weight.mean()) / f64::from(n);
                square += f64::from(weight.mean()).powi(2) / f64::from(n);
                // The same integral by light sampling (uniform over the sphere) and direction sampling together.
                let z = 2.0 * stream.next() - 1.0;
                let (s, c) = (TAU * stream.next()).sin_cos();
                let r = (1.0 - z * z).max(0.0).sqrt();
                let uniform = 1.0 / (4.0 * PI);
                let light = vertex.evaluate(Vec3A::new(r * c, r * s, z), uniform, 0.5).lobes.sum().mean() / uniform;
                let u = [0; 3].map(|_| stream.next());
                let own = vertex.sample(u, &mut stream).map_or(0.0, |c| c.weight.mean() * mis_weight(c.pdf, uniform));
                let value = f64::from(light + own);
                both += value / f64::from(n);
                both_square += value * value / f64::from(n);
            }
            let se = ((square - sum * sum).max(0.0) / f64::from(n)).sqrt();
            let both_se = ((both_square - both * both).max(0.0) / f64::from(n)).sqrt();
            assert!(
                (sum - both).abs() < 4.5 * (se + both_se) + 1e-4,
                "{case:?}: {sum} +- {se}, with light {both} +- {both_se}"
            );
            assert!(largest < 8.0, "{case:?}: a weight of {largest}");
            if white {
                let off = f64::from(1.0 - t0) * (sum - 1.0);
                assert!(off.abs() < 0.02 + 4.0 * se, "{case:?}: white fibres return {sum} +- {se} beside T0 {t0}");
                eprintln!("{case:?}: {sum:.4} +- {se:.4}, T0 {t0:.4}, largest weight {largest:.3}");
            }
        }
    }
}

/// Fibres that only transmit, many of them on a way: each fibre that light is followed to, and what comes after the last, has its share.
#[test]
fn light_finds_as_much_of_f_as_directions_do() {
    let m = material(([0.0; 3], [0.98, 0.9, 0.5], [0.0; 3]), [0.15, 0.2, 0.6]);
    for case in [CASES[3], CASES[5]] {
        let (yarn, section) = build(case, None, &m);
        let mut crossings = Crossings::new();
        section.crossings(yarn.occluder().shape(), &mut crossings);
        let t0 = yarn.occluder().transparency(&crossings);
        let mut stream = Stream::new(12);
        let n = 100_000;
        let (mut sum, mut square) = ([[0f64; 3]; 2], [[0f64; 3]; 2]);
        for _ in 0..n {
            let u = [0; 4].map(|_| stream.next());
            let vertex = Vertex::new(&yarn, &section, &crossings, t0, Rgb::ONE, u, &mut stream);
            let z = 2.0 * stream.next() - 1.0;
            let (s, c) = (TAU * stream.next()).sin_cos();
            let r = (1.0 - z * z).max(0.0).sqrt();
            let lit = vertex.evaluate(Vec3A::new(r * c, r * s, z), f32::INFINITY, 0.5).lobes.f * (4.0 * PI);
            let drawn = vertex.forward.as_ref().map_or(Rgb::ZERO, |f| f.drawn.share);
            for (k, value) in [lit, drawn].into_iter().enumerate() {
                for (c, value) in value.to_array().into_iter().enumerate() {
                    sum[k][c] += f64::from(value) / f64::from(n);
                    square[k][c] += f64::from(value).powi(2) / f64::from(n);
                }
            }
        }
        for c in 0..3 {
            let se = |k: usize| ((square[k][c] - sum[k][c] * sum[k][c]) / f64::from(n)).sqrt();
            let [lit, drawn] = [sum[0][c], sum[1][c]];
            eprintln!("{case:?} channel {c}: {lit:.4} +- {:.4}, {drawn:.4} +- {:.4}", se(0), se(1));
            assert!((lit - drawn).abs() < 4.5 * (se(0) + se(1)) && se(0) < 0.02 * lit, "{case:?} {c}: {lit} {drawn}");
        }
    }
}

#[test]
fn sample_densities_match_where_samples_fall() {
    PRESSED.into_iter().for_each(densities_match);
}

fn densities_match(pressed: Option<Pressed>) {
    // Chi-square per component over 8 x 12 cells of (sin theta, phi): the density of the component, times its chance,
    // integrated over a cell, against the number of samples that fell there. Same node for all: fixed numbers.
    let case = (1, 40, 0.2, 0.0, -0.33, 0.2, 0.5, 0.4);
    let (yarn, section) = build(case, pressed, &material(SILK, [0.3, 0.25, 0.5]));
    let mut crossings = Crossings::new();
    section.crossings(yarn.occluder().shape(), &mut crossings);
    let t0 = yarn.occluder().transparency(&crossings);
    let vertex = Vertex::new(&yarn, &section, &crossings, t0, Rgb::ONE, [0.3, 0.4, 0.6, 0.2], &mut Stream::new(5));
    let cell = |w: Vec3A| {
        let row = ((w.z * 0.5 + 0.5) * 8.0).clamp(0.0, 7.0) as usize;
        let column = ((w.y.atan2(w.x) / TAU + 0.5) * 12.0).clamp(0.0, 11.0) as usize;
        row * 12 + column
    };
    let n = 200_000;
    let mut stream = Stream::new(77);
    let (view, node, forward) =
        (&vertex.view, vertex.node.get(&vertex.view).unwrap(), vertex.forward.as_ref().unwrap());
    // F hangs on the fibres that light met: what leaves from the first.
    let first = forward.fibers[0];
    let mut alone = forward.clone();
    alone.fibers.truncate(1);
    let mut counts = [[0f64; 96]; 2];
    for _ in 0..n {
        // The directions of F and of the node are fixed in a vertex; they are drawn anew.
        let mut again = Forward::new(view, &first, forward.weight);
        again.follow(view, first, 0.0, &mut stream);
        if again.fibers.len() == 1 && stream.next() < again.drawn.chance {
            counts[0][cell(again.drawn.direction)] += 1.0;
        }
        let u = [0; 3].map(|_| stream.next());
        if let Some(c) = vertex.sample(u, &mut stream)
            && !c.shares.b.is_zero()
        {
            counts[1][cell(c.direction)] += 1.0;
        }
    }
    let mut expected = [[0f64; 96]; 2];
    let backward = vertex.backward.of(view, node);
    for (w, dw) in sphere(1600, 1200) {
        let alone = alone.density(view, w);
        let b = backward.value(view, w).1 * (1.0 - vertex.forward_chance()) * backward.chance;
        for (k, density) in [alone, b].into_iter().enumerate() {
            expected[k][cell(w)] += f64::from(density) * dw * f64::from(n);
        }
    }
    for k in 0..2 {
        let (mut chi2, mut cells) = (0.0, 0.0);
        for (&got, &want) in counts[k].iter().zip(&expected[k]) {
            if want > 10.0 {
                chi2 += (got - want).powi(2) / want;
                cells += 1.0;
            } else {
                assert!(got < 60.0, "component {k}: {got} samples where {want} were expected");
            }
        }
        let most = cells + 5.0 * f64::sqrt(2.0 * cells);
        assert!(cells > 20.0 && chi2 < most, "{pressed:?}, component {k}: chi2 {chi2} of {cells}");
    }
}

#[test]
fn the_far_field_of_an_untwisted_ply_is_reciprocal() {
    let m = silk();
    let yarn = yarn(1, 100, 0.3, 0.0, 0.0, &m);
    let far_field = |theta_o: f32, theta_i: f32, phi: f32| {
        let w = Vec3A::new(theta_i.cos() * phi.cos(), theta_i.cos() * phi.sin(), theta_i.sin());
        let n = 400;
        (0..n)
            .map(|i| {
                let h = -1.0 + 2.0 * (i as f32 + 0.5) / n as f32;
                // B leans by the camera's offset and is left out, as is the light's own way in F.
                quadrature(&GAUSS_LEGENDRE_4, &yarn, [m.beta_r, m.beta_tt], &section(theta_o, h, 0.0), &[w])[0][0]
                    .mean()
                    / n as f32
            })
            .sum::<f32>()
            / theta_i.cos()
    };
    for (a, b, phi) in [(0.2, -0.5, 0.6), (0.9, 0.1, 2.0), (-0.3, 0.35, 1.2)] {
        let (there, back) = (far_field(a, b, phi), far_field(b, a, -phi));
        assert!((there / back - 1.0).abs() < 0.02, "{there} {back}");
    }
}

#[test]
fn black_empty_and_extreme_yarns_stay_finite_and_dark() {
    let black = material(([0.0; 3], [0.0; 3], [0.0; 3]), [0.15, 0.12, 0.35]);
    let clear = material(([0.0; 3], [1.0; 3], [0.0; 3]), [0.15, 0.12, 0.35]);
    let narrow = material(SILK, [1e-5, 1e-5, 1e-5]);
    let wide = material(SILK, [4.0, 4.0, 4.0]);
    let mut stream = Stream::new(3);
    for m in [black, clear, narrow, wide, lossless()] {
        for (plies, fibers, density, twist) in
            [(1, 1, 1e-6, 0.0), (1, 5000, 0.9, 1.57), (3, 10, 2.0, -1.5), (64, 3, 0.3, 0.4)]
        {
            let yarn = yarn(plies, fibers, density, twist, -twist, &m);
            for theta in [0.0, 1.2, 1.57, -std::f32::consts::FRAC_PI_2] {
                for h in [0.0, 0.5, 1.0, -1.0, 0.999_999] {
                    let section = section(theta, h, 0.3);
                    let mut crossings = Crossings::new();
                    section.crossings(yarn.occluder().shape(), &mut crossings);
                    let t0 = yarn.occluder().transparency(&crossings);
                    assert!((0.0..=1.0).contains(&t0));
                    for _ in 0..20 {
                        let u = [0; 4].map(|_| stream.next());
                        let vertex = Vertex::new(&yarn, &section, &crossings, t0, Rgb::ONE, u, &mut stream);
                        let w = Vec3A::new(stream.next() - 0.5, stream.next() - 0.5, stream.next() - 0.5).normalize();
                        let direct = vertex.evaluate(w, 1.0, 0.5);
                        assert!(direct.lobes.sum().is_finite() && direct.lobes.sum().min_channel() >= 0.0);
                        if let Some(c) = vertex.sample([0; 3].map(|_| stream.next()), &mut stream) {
                            assert!(c.weight.is_finite() && c.weight.min_channel() >= 0.0, "{:?}", c.weight);
                            assert!(c.direction.is_finite() && c.pdf > 0.0);
                        }
                    }
                }
            }
        }
    }
}
