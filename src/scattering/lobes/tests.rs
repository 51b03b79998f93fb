//! The models against counted light, and what they sample against what they say.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, TAU};

use glam::Vec3A;

use super::*;
use crate::{
    geometry::{
        section::{Crossings, Section},
        yarn::tests::touching_yarn,
    },
    math::{Rgb, sampler::Stream},
    scattering::{
        LobeValues, mis_weight,
        testing::{SILK, lossless, material, section, silk, sphere},
    },
};

const MODELS: [ChordModel; 4] =
    [ChordModel::TwoStream, ChordModel::Paper, ChordModel::DualScattering, ChordModel::Printed];
/// Mean abs. relative errors over cases and channels, and the largest energy of the model.
#[derive(Debug, Default)]
struct Errors {
    back: f64,
    /// With B counted as all backward.
    back_all_of_b: f64,
    /// Of forward with unscattered light.
    forward: f64,
    largest: f64,
    count: f64,
}

/// Energies averaged over the yarn's width against the truth; lobes over the full circle are half backward.
///
/// Fibres of TT only are left out: what a yarn of them sends back is near 0, and no figure of MODEL.md can be met with
/// its relative error in the mean.
fn compare(model: ChordModel, counted_fibers: bool, plies: std::ops::RangeInclusive<u64>) -> Errors {
    let text = crate::testing::data("truth_energies.json");
    let cases: serde_json::Value = serde_json::from_str(&text).unwrap();
    let mut errors = Errors::default();
    for case in cases.as_array().unwrap() {
        let number = |key: &str| case[key].as_f64().unwrap();
        let triple = |v: &serde_json::Value| -> [f64; 3] { std::array::from_fn(|c| v[c].as_f64().unwrap()) };
        let count = case["n_plies"].as_u64().unwrap();
        if !plies.contains(&count) || case["name"].as_str().unwrap().starts_with("tt") {
            continue;
        }
        let materials: Vec<FiberMaterial> = (0..count as usize)
            .map(|k| {
                let scale = triple(&case["ply_scale"][k]);
                let albedo = |key: &str| -> [f64; 3] {
                    let a = triple(&case[key]);
                    std::array::from_fn(|c| a[c] * scale[c])
                };
                material(
                    (albedo("a_r"), albedo("a_tt"), albedo("a_d")),
                    [number("beta_R"), number("beta_TT"), number("beta_N")],
                )
            })
            .collect();
        let twist = number("twist_deg").to_radians();
        let shape = touching_yarn(count as u32, number("n") as u32, number("density_area"), 0.0, twist);
        let yarn = ChordYarn::new(shape, &materials.iter().collect::<Vec<_>>(), model);
        let (mut back, mut forward, mut forward_of_b, mut unscattered) = ([0.0; 3], [0.0; 3], [0.0; 3], 0.0);
        let (rows, phases) = (200, if count == 1 { 1 } else { 24 });
        for i in 0..rows * phases {
            let h = -1.0 + 2.0 * ((i % rows) as f32 + 0.5) / rows as f32;
            let phase = if number("ply_phase") > -900.0 {
                number("ply_phase").to_radians() as f32
            } else {
                TAU * (i / rows) as f32 / phases as f32
            };
            let section = section(number("theta_deg").to_radians() as f32, h, phase);
            let mut crossings = Crossings::new();
            section.crossings(yarn.occluder().shape(), &mut crossings);
            let share = 1.0 / f64::from(rows * phases);
            unscattered += f64::from(yarn.occluder().transparency(&crossings)) * share;
            if crossings.is_empty() {
                continue;
            }
            let fibers = |c: &PlyCrossing| if counted_fibers { f64::from(c.fibers) } else { yarn.fibers(c) };
            let out = yarn.aggregate(crossings.iter().map(|c| (c.ply, fibers(c))));
            let b_behind = if model == ChordModel::TwoStream { 1.0 } else { 0.5 };
            let behind = if model == ChordModel::Printed { 0.5 } else { 1.0 };
            for c in 0..3 {
                back[c] += ((out.r[c] + out.d[c]) * behind + out.b[c] * b_behind) * share;
                forward_of_b[c] += out.b[c] * (1.0 - b_behind) * share;
                forward[c] += (out.f[c] + (out.r[c] + out.d[c]) * (1.0 - behind)) * share;
            }
        }
        let (want_back, want_forward) = (triple(&case["back"]), triple(&case["fwd"]));
        let want_unscattered = number("T0");
        for c in 0..3 {
            errors.largest = errors.largest.max(back[c] + forward[c] + forward_of_b[c] + unscattered);
            let off = |got: f64, want: f64| (got / want - 1.0).abs();
            errors.back += off(back[c], want_back[c]);
            errors.back_all_of_b += off(back[c] + forward_of_b[c], want_back[c]);
            errors.forward += off(forward[c] + forward_of_b[c] + unscattered, want_forward[c] + want_unscattered);
            errors.count += 1.0;
        }
    }
    errors.back /= errors.count;
    errors.back_all_of_b /= errors.count;
    errors.forward /= errors.count;
    errors
}

#[test]
fn energies_are_as_far_from_counted_light_as_was_measured_for_each_model() {
    // Figures of MODEL.md, section 0, for 88 cases of one ply, of which 68 are here: B over the circle as each model
    // has it. Hence within 12 %, or 0.02. Of K, section 5 says
    // 0.095 and 0.19: its forward figure is held to 0.05.
    for (model, counted, back, forward) in [
        (ChordModel::TwoStream, true, 0.11, 0.23),
        (ChordModel::Paper, true, 0.22, 0.21),
        (ChordModel::Printed, false, 0.56, 2.08),
        (ChordModel::Printed, true, 0.59, 1.82),
    ] {
        let e = compare(model, counted, 1..=1);
        eprintln!("{model:?}, counted fibres {counted}: {e:?}");
        let several = compare(model, counted, 2..=3);
        eprintln!("  several plies: {several:?}");
        assert_eq!(e.count, 204.0);
        let slack = |figure: f64| (0.12 * figure).max(0.02);
        assert!((e.back - back).abs() < slack(back), "{model:?}: back {}, not {back}", e.back);
        let narrow = if model == ChordModel::TwoStream { 0.05 } else { slack(forward) };
        assert!((e.forward - forward).abs() < narrow, "{model:?}: forward {}, not {forward}", e.forward);
        if model == ChordModel::Printed {
            assert!(e.largest > 1.7, "the printed model gains energy: {}", e.largest);
            if !counted {
                assert!((e.back_all_of_b - 1.14).abs() < 0.05, "with all of B backward: {}", e.back_all_of_b);
            }
        } else {
            assert!(e.largest <= 1.0 + 1e-6 && several.largest <= 1.0 + 1e-6);
        }
    }
}

#[test]
fn directions_are_as_far_from_counted_light_as_was_measured_for_each_model() {
    // L1 distance over 18 x 24 cells of (theta, phi), relative to the truth's energy: MODEL.md, section 0.
    let Some(text) = crate::testing::shared("oracle/truth_single_ply.json") else { return };
    let truth: serde_json::Value = serde_json::from_str(&text).unwrap();
    let (rows, columns) = (18, 24);
    let fine = 3;
    let grid: Vec<(Vec3A, f64)> = sphere(rows * fine, columns * fine).collect();
    for (model, figure) in [(ChordModel::TwoStream, 0.33), (ChordModel::Paper, 0.35), (ChordModel::Printed, 1.61)] {
        let (mut sum, mut count) = (0.0, 0.0);
        for case in truth["cases"].as_array().unwrap() {
            if case["name"].as_str().unwrap().starts_with("tt") {
                continue;
            }
            let number = |key: &str| case[key].as_f64().unwrap();
            let triple = |key: &str| -> [f64; 3] {
                std::array::from_fn(|c| case[key][c].as_f64().unwrap() * case["ply_scale"][0][c].as_f64().unwrap())
            };
            let m = material(
                (triple("a_r"), triple("a_tt"), triple("a_d")),
                [number("beta_R"), number("beta_TT"), number("beta_N")],
            );
            let twist = number("twist_deg").to_radians();
            let shape = touching_yarn(1, number("n") as u32, number("density_area"), 0.0, twist);
            let yarn = ChordYarn::new(shape, &[&m], model);
            let mut cells = vec![[0.0; 3]; rows * columns];
            let lines = 16;
            for i in 0..lines {
                let h = -1.0 + 2.0 * (i as f32 + 0.5) / lines as f32;
                let section = section(number("theta_deg").to_radians() as f32, h, 0.0);
                let mut crossings = Crossings::new();
                section.crossings(yarn.occluder().shape(), &mut crossings);
                let t0 = yarn.occluder().transparency(&crossings);
                let vertex = ChordVertex::new(&yarn, &section, &crossings, t0, Rgb::ONE, [0.5; 4], &mut Stream::new(1));
                for (index, (w, dw)) in grid.iter().enumerate() {
                    let value = vertex.values(*w).0.sum().to_array();
                    let (row, column) = (index / (columns * fine) / fine, index % (columns * fine) / fine);
                    for c in 0..3 {
                        cells[row * columns + column][c] += f64::from(value[c] * (1.0 - t0)) * dw / f64::from(lines);
                    }
                }
            }
            for c in 0..3 {
                let (mut off, mut total) = (0.0, 0.0);
                for (index, cell) in cells.iter().enumerate() {
                    let want = case["theta_phi_energy"][index * 3 + c].as_f64().unwrap();
                    off += (cell[c] - want).abs();
                    total += want;
                }
                sum += off / total;
                count += 1.0;
            }
        }
        let mean = sum / count;
        eprintln!("{model:?}: L1 {mean:.3} over {count}");
        assert!((mean - figure).abs() < 0.15 * figure, "{model:?}: L1 {mean}, not {figure}");
    }
}

/// Plies, fibres, density, ply and fibre twist, h, theta, phase.
type Case = (u32, u32, f64, f64, f64, f32, f32, f32);

/// The configurations of the sampling tests.
const CASES: [Case; 6] = [
    (1, 100, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0),
    (1, 100, 0.3, 0.0, 0.0, 0.7, 1.0, 0.0),
    (1, 25, 0.1, 0.0, 0.0, 0.95, 0.3, 0.0),
    (1, 400, 0.6, 0.0, 0.44, 0.3, 0.5, 0.0),
    (3, 70, 0.5, 0.23, -0.33, -0.56, 0.8, 0.4),
    (2, 50, 0.2, 0.1, 0.7, 0.25, 0.9, 2.0),
];

fn build(case: Case, materials: &[&FiberMaterial], model: ChordModel) -> (ChordYarn, Section<'static>, Crossings) {
    let (plies, fibers, density, ply_twist, fiber_twist, h, theta, phase) = case;
    let shape = touching_yarn(plies, fibers, density, ply_twist, fiber_twist);
    let materials: Vec<_> = (0..plies as usize).map(|k| materials[k % materials.len()]).collect();
    let yarn = ChordYarn::new(shape, &materials, model);
    let section = section(theta, h, phase);
    let mut crossings = Crossings::new();
    section.crossings(yarn.occluder().shape(), &mut crossings);
    (yarn, section, crossings)
}

fn uniform(stream: &mut Stream) -> Vec3A {
    let z = 2.0 * stream.next() - 1.0;
    let (s, c) = (TAU * stream.next()).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3A::new(r * c, r * s, z)
}

#[test]
fn values_integrate_to_the_energies_and_the_density_to_one() {
    for model in MODELS {
        for case in CASES {
            let (silk, white) = (silk(), lossless());
            let (yarn, section, crossings) = build(case, &[&silk, &white], model);
            let t0 = yarn.occluder().transparency(&crossings);
            let throughput = Rgb::new(1.0, 0.3, 2.0);
            let vertex = ChordVertex::new(&yarn, &section, &crossings, t0, throughput, [0.5; 4], &mut Stream::new(1));
            let (mut energy, mut density) = ([0.0; 5], 0.0);
            for (w, dw) in sphere(800, 800) {
                let (value, pdf) = vertex.values(w);
                for (sum, lobe) in energy.iter_mut().zip(value.to_array()) {
                    *sum += f64::from(lobe.mean()) * dw;
                }
                density += f64::from(pdf) * dw;
            }
            assert!((density - 1.0).abs() < 3e-3, "{model:?} {case:?}: density {density}");
            for (got, want) in energy.iter().zip(vertex.energy.to_array()) {
                let want = f64::from(want.mean());
                assert!(
                    (got - want).abs() < 3e-3 * (want + 0.1),
                    "{model:?} {case:?}: {energy:?}, not {:?}",
                    vertex.energy
                );
            }
        }
    }
}

#[test]
fn samples_average_to_the_energies_and_light_sampling_joins_without_loss() {
    for model in MODELS {
        for (index, case) in CASES.into_iter().enumerate() {
            let (silk, white) = (silk(), lossless());
            let (yarn, section, crossings) = build(case, &[&silk, &white], model);
            let t0 = yarn.occluder().transparency(&crossings);
            let mut stream = Stream::new(40 + index as u32);
            let n = 20_000;
            let mut sums = [[0f64; 2]; 2];
            let mut shares = [0f64; 5];
            let mut largest = 0f32;
            let mut want = LobeValues::default();
            for _ in 0..n {
                let u = [0; 4].map(|_| stream.next());
                let vertex = ChordVertex::new(&yarn, &section, &crossings, t0, Rgb::ONE, u, &mut stream);
                want = vertex.energy;
                let drawn = vertex.sample([0; 3].map(|_| stream.next()), &mut stream);
                let weight = drawn.map_or(0.0, |c| c.weight.mean());
                largest = largest.max(weight);
                if let Some(c) = drawn {
                    assert!((c.shares.sum().mean() - 1.0).abs() < 1e-4, "shares {:?}", c.shares);
                    for (sum, share) in shares.iter_mut().zip(c.shares.to_array()) {
                        *sum += f64::from((share * c.weight).mean()) / f64::from(n);
                    }
                    let [front, back] = [crossings[0].enter, crossings.last().unwrap().exit].map(|d| section.point(d));
                    let chord = front.distance(back) + 1e-5;
                    assert!(
                        c.start.distance(front) <= chord && c.start.distance(back) <= chord,
                        "start {} in {front}..{back}",
                        c.start
                    );
                    // Drawing and evaluating say the same, with a light of any density.
                    let direct = vertex.evaluate(c.direction, f32::INFINITY, 0.5);
                    assert!(
                        (direct.lobes.sum().mean() - c.weight.mean() * c.pdf).abs() <= 1e-4 * direct.lobes.sum().mean()
                    );
                }
                let even = 0.25 * FRAC_1_PI;
                let light = vertex.evaluate(uniform(&mut stream), even, 0.5).lobes.sum().mean() / even;
                let own = vertex
                    .sample([0; 3].map(|_| stream.next()), &mut stream)
                    .map_or(0.0, |c| c.weight.mean() * mis_weight(c.pdf, even));
                for (sum, value) in sums.iter_mut().zip([weight, light + own]) {
                    sum[0] += f64::from(value) / f64::from(n);
                    sum[1] += f64::from(value).powi(2) / f64::from(n);
                }
            }
            let total = f64::from(want.sum().mean());
            for [mean, square] in sums {
                let se = ((square - mean * mean).max(0.0) / f64::from(n)).sqrt();
                assert!((mean - total).abs() < 4.5 * se + 1e-4, "{model:?} {case:?}: {mean} +- {se}, not {total}");
            }
            for (got, want) in shares.iter().zip(want.to_array()) {
                assert!((got - f64::from(want.mean())).abs() < 0.02 * total, "{model:?} {case:?}: shares {shares:?}");
            }
            // One mixture for all: a weight is the energy but for colours.
            assert!(f64::from(largest) < 4.0 * total, "{model:?} {case:?}: a weight of {largest}");
        }
    }
}

#[test]
fn samples_fall_where_the_density_says() {
    // Chi-square over 12 x 16 cells of (sin theta, phi).
    let (silk, white) = (material(SILK, [0.3, 0.25, 0.5]), lossless());
    for model in MODELS {
        let (yarn, section, crossings) = build((3, 20, 0.2, 0.23, -0.33, 0.2, 0.5, 0.4), &[&silk, &white], model);
        let t0 = yarn.occluder().transparency(&crossings);
        let vertex = ChordVertex::new(&yarn, &section, &crossings, t0, Rgb::ONE, [0.5; 4], &mut Stream::new(1));
        let cell = |w: Vec3A| {
            let row = ((w.z * 0.5 + 0.5) * 12.0).clamp(0.0, 11.0) as usize;
            row * 16 + ((w.y.atan2(w.x) / TAU + 0.5) * 16.0).clamp(0.0, 15.0) as usize
        };
        let n = 300_000;
        let (mut counts, mut expected) = ([0f64; 192], [0f64; 192]);
        let mut stream = Stream::new(7);
        for _ in 0..n {
            if let Some(c) = vertex.sample([0; 3].map(|_| stream.next()), &mut stream) {
                counts[cell(c.direction)] += 1.0;
            }
        }
        for (w, dw) in sphere(2400, 1600) {
            expected[cell(w)] += f64::from(vertex.values(w).1) * dw * f64::from(n);
        }
        let (mut chi2, mut cells) = (0.0, 0.0);
        for (got, want) in counts.iter().zip(expected) {
            if want > 10.0 {
                chi2 += (got - want).powi(2) / want;
                cells += 1.0;
            } else {
                assert!(*got < 60.0, "{model:?}: {got} samples where {want} were expected");
            }
        }
        assert!(cells > 50.0 && chi2 < cells + 5.0 * f64::sqrt(2.0 * cells), "{model:?}: chi2 {chi2} of {cells}");
    }
}

#[test]
fn no_number_of_fibers_plies_or_albedo_makes_light_but_in_the_printed_model() {
    let mut largest = [0f64; MODELS.len()];
    for (k, model) in MODELS.into_iter().enumerate() {
        for albedo in [
            [0.0, 0.0, 0.0],
            [0.2, 0.5, 0.3],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.5, 0.0, 0.4999],
            [0.01, 0.98, 0.0],
            [0.2, 0.4, 0.35],
        ] {
            for beta_n in [0.01, 0.35, 0.8, 3.0] {
                let m = material(([albedo[0]; 3], [albedo[1]; 3], [albedo[2]; 3]), [0.15, 0.12, beta_n]);
                let s = silk();
                for count in 1..=3usize {
                    let shape = touching_yarn(count as u32, 50, 0.3, 0.1, 0.2);
                    let materials = [&m, &s, &m];
                    let yarn = ChordYarn::new(shape, &materials[..count], model);
                    for i in 0..=70 {
                        let n = 10f64.powf(-3.0 + 0.1 * f64::from(i));
                        // Different plies, some of which the ray hardly meets.
                        let out = yarn.aggregate((0..count).map(|p| (p, if p == 1 { 0.3 * n.sqrt() } else { n })));
                        let depth = (0..count).map(|p| if p == 1 { 0.3 * n.sqrt() } else { n }).sum::<f64>();
                        let unscattered = if model == ChordModel::Printed { 0.0 } else { (-depth).exp() };
                        for c in 0..3 {
                            let all = [out.r[c], out.d[c], out.f[c], out.b[c]];
                            assert!(
                                all.iter().all(|e| e.is_finite() && *e >= 0.0),
                                "{model:?} {albedo:?} n {n}: {all:?}"
                            );
                            let total = all.iter().sum::<f64>() + unscattered;
                            largest[k] = largest[k].max(total);
                            let widths = [out.forward_latitude[c], out.forward_azimuth[c], out.back_latitude[c]];
                            assert!(widths.iter().all(|v| v.is_finite() && *v >= 0.0), "{model:?} n {n}: {widths:?}");
                            if model == ChordModel::TwoStream && count == 1 && albedo.iter().sum::<f64>() == 1.0 {
                                assert!((total - 1.0).abs() < 1e-9, "white fibres keep {total} of all light");
                            }
                        }
                    }
                }
            }
        }
    }
    eprintln!("largest energies: {largest:?}");
    let [two_stream, paper, dual, printed] = largest;
    assert!(two_stream <= 1.0 + 1e-9 && paper <= 1.0 + 1e-9 && printed > 1.9, "{largest:?}");
    // Light that turns back among endlessly many fibres is not missed in what passes the few that there are.
    assert!((1.5..1.8).contains(&dual), "{largest:?}");
}

#[test]
fn black_empty_and_extreme_yarns_stay_finite() {
    let black = material(([0.0; 3], [0.0; 3], [0.0; 3]), [0.15, 0.12, 0.35]);
    let clear = material(([0.0; 3], [1.0; 3], [0.0; 3]), [0.15, 0.12, 0.35]);
    let narrow = material(SILK, [1e-5, 1e-5, 1e-5]);
    let wide = material(SILK, [4.0, 4.0, 4.0]);
    let coloured = material(([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]), [0.15, 0.12, 0.35]);
    let mut stream = Stream::new(3);
    for model in MODELS {
        for m in [&black, &clear, &narrow, &wide, &coloured, &lossless()] {
            for (plies, fibers, density, twist) in
                [(1, 1, 1e-6, 0.0), (1, 5000, 0.9, 1.57), (3, 10, 2.0, -1.5), (64, 3, 0.3, 0.4)]
            {
                let shape = touching_yarn(plies, fibers, density, twist, -twist);
                let yarn = ChordYarn::new(shape, &vec![m; plies as usize], model);
                for theta in [0.0, 1.2, FRAC_PI_2 - 1e-6, -FRAC_PI_2] {
                    for h in [0.0, 0.5, 1.0, -1.0, 0.999_999] {
                        let section = section(theta, h, 0.3);
                        let mut crossings = Crossings::new();
                        section.crossings(yarn.occluder().shape(), &mut crossings);
                        let t0 = yarn.occluder().transparency(&crossings);
                        assert!((0.0..=1.0).contains(&t0));
                        for _ in 0..20 {
                            let u = [0; 4].map(|_| stream.next());
                            let vertex = ChordVertex::new(&yarn, &section, &crossings, t0, Rgb::ONE, u, &mut stream);
                            assert!(vertex.place().is_finite());
                            let direct = vertex.evaluate(uniform(&mut stream), 1.0, stream.next());
                            assert!(direct.lobes.sum().is_finite() && direct.lobes.sum().min_channel() >= 0.0);
                            assert!(direct.start.is_none_or(|start| start.is_finite()));
                            if let Some(c) = vertex.sample([0; 3].map(|_| stream.next()), &mut stream) {
                                assert!(c.weight.is_finite() && c.weight.min_channel() >= 0.0, "{:?}", c.weight);
                                assert!(c.direction.is_finite() && c.pdf > 0.0 && c.pdf.is_finite());
                                assert!(c.shares.sum().is_finite());
                            }
                        }
                    }
                }
            }
        }
    }
}
