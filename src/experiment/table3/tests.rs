//! The procedure with a renderer that draws its noise instead of tracing rays.

use serde_json::json;

use super::*;
use crate::experiment::suite::Measure;
use crate::image::Channel;

const SIZE: usize = 48;

/// A renderer whose pictures have a mean of 0.5, or `gain` times that for yarns, and the variance of `scale` / spp.
struct Fake {
    renders: Vec<String>,
    /// Variance of a sample: fibres, yarns.
    scale: [f64; 2],
    /// Seconds of a sample per pixel.
    speed: [f64; 2],
    gain: f64,
    stop_after: usize,
}

impl Fake {
    fn new() -> Self {
        Self { renders: Vec::new(), scale: [0.52, 0.26], speed: [0.1, 0.02], gain: 0.9, stop_after: usize::MAX }
    }
}

/// A number from 0 to 1 that looks random (splitmix64).
fn noise(i: u64) -> f64 {
    let mut z = i.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) as f64 / u64::MAX as f64
}

impl Renderer for Fake {
    fn fingerprint(&mut self, _: &Suite, case: &Case, method: Method, set: &[String]) -> Result<String, BenchError> {
        Ok(format!("{} {method} {}", case.scene.display(), set.join(" ")))
    }

    fn render(&mut self, _: &Suite, job: &Job<'_>) -> Result<Done, BenchError> {
        if job.case.name.contains("broken") {
            return Err(BenchError::Case("no memory".to_owned()));
        }
        if self.renders.len() == self.stop_after {
            return Err(BenchError::Interrupted);
        }
        self.renders.push(format!("{} {} {}", job.case.name, job.method, job.seed));
        let side = usize::from(job.method.model.is_some());
        let mean = if side == 1 { 0.5 * self.gain } else { 0.5 };
        let relative = self.scale[side] / (mean * mean + 0.01);
        let spp = job.noise.map_or(f64::from(job.spp), |limit| (relative / limit).ceil().min(f64::from(job.spp)));
        let deviation = (self.scale[side] / spp).sqrt();
        let mut image = Image::new(SIZE, SIZE);
        for (k, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
            let sample = |i: usize| {
                let start = (u64::from(job.seed) << 40) + (((i * 4 + k) * 2 + side) * 16) as u64;
                let normal: f64 = (0..12).map(|j| noise(start + j)).sum::<f64>() - 6.0;
                if k == 3 { 1.0 } else { (mean + deviation * normal) as f32 }
            };
            image.channels.push(Channel { name: name.to_owned(), samples: (0..SIZE * SIZE).map(sample).collect() });
        }
        let bytes = [1_000_000, 4_000][side];
        let stats = json!({
            "seconds": {"generate": 0.25, "build": 0.5, "render": spp * self.speed[side]},
            "memory": {"geometry_bytes": bytes, "bvh_bytes": 2 * bytes, "peak_rss_bytes": 100 * bytes},
            "mean_bounces": if side == 0 { 8.0 } else { 2.0 }, "image": {"spp_mean": spp},
            "rays": {"camera": spp, "bounce": 2.0 * spp, "shadow": spp},
        });
        Ok(Done { image, stats })
    }
}

fn suite(cases: &[&str]) -> Suite {
    let case = |name: &&str| Case {
        name: (*name).to_owned(),
        scene: format!("{name}.toml").into(),
        curves: None,
        set: Vec::new(),
        paper: None,
        held_out: false,
        within: 0.05,
        packings: 1,
    };
    Suite {
        path: "suite.toml".to_owned(),
        title: "test".to_owned(),
        measure: Measure::Cost,
        reference: Method::parse("yarn").unwrap(),
        tested: Method::parse("yarn:aggregated").unwrap(),
        others: Vec::new(),
        target: 0.02,
        repeats: 3,
        converged: 4.0,
        min_seconds: 2.0,
        max_spp: 100_000,
        size: None,
        packings: 1,
        cases: cases.iter().map(case).collect(),
        missing: vec![("glove".to_owned(), "no file".to_owned())],
        converge: None,
    }
}

fn run_quietly(suite: &Suite, fake: &mut Fake, directory: &Path) -> Result<Table, BenchError> {
    run(suite, fake, directory, None, |_| {}, |_| Ok(()))
}

#[test]
fn figures_are_those_of_the_renderer() {
    let directory = tempfile::tempdir().unwrap();
    let mut fake = Fake::new();
    let table = run_quietly(&suite(&["a"]), &mut fake, directory.path()).unwrap();
    let row = &table.rows[0];
    // Noise of one sample over the target.
    let expected: [f64; 2] = [0.52 / 0.26 / 0.02, 0.26 / (0.45 * 0.45 + 0.01) / 0.02];
    for (run, (expected, speed)) in
        [&row.reference, &row.aggregated].into_iter().zip(expected.into_iter().zip(fake.speed))
    {
        assert!((run.spp - expected).abs() < 0.05 * expected, "{} for {expected}", run.spp);
        assert!((run.render_seconds - expected * speed).abs() < 0.05 * expected * speed);
        assert!((run.rays - 4.0 * run.spp).abs() < 1e-6 * run.rays);
        assert!(run.render_seconds_deviation.is_some_and(|d| d > 0.0 && d < 0.05 * run.render_seconds));
        // Runs near the target; those of yarns take less than two seconds, and are made twice as often.
        let runs = if speed < 0.05 { 6 } else { 3 };
        assert_eq!((run.build_seconds, run.timed_relmse.len()), (0.75, runs));
        assert!((run.timed_spp - expected).abs() < 0.06 * expected, "{} for {expected}", run.timed_spp);
        assert!(run.timed_relmse.iter().all(|error| (error - 0.02).abs() < 0.003), "{:?}", run.timed_relmse);
    }
    let ratio = expected[0] * 0.1 / (expected[1] * 0.02);
    assert!(
        (row.time_ratio - ratio).abs() < 0.07 * ratio && row.time_ratio_deviation.unwrap() < 0.1 * ratio,
        "{row:?}"
    );
    assert_eq!((row.memory_ratio, row.bounce_ratio, row.reference.peak_rss_bytes), (0.004, 0.25, 100_000_000));
    let error = &row.model_error;
    assert!(error.mean_ratio.iter().all(|r| (r - 0.9).abs() < 0.01), "{error:?}");
    let relative = 0.05 * 0.05 / 0.26;
    assert!((error.relmse_8.unwrap() - relative).abs() < 0.1 * relative, "{error:?}");
    // By turns.
    let timed: Vec<&str> =
        fake.renders.iter().map(String::as_str).filter(|r| !r.ends_with(" 1") && !r.ends_with(" 2")).collect();
    let yarns = |seeds: [u32; 2]| seeds.map(|seed| format!("a yarn:aggregated {seed}"));
    let expected: Vec<String> = (0..3_u32)
        .flat_map(|turn| [vec![format!("a yarn {}", 3 + turn)], yarns([3 + 2 * turn, 4 + 2 * turn]).into()].concat())
        .collect();
    assert_eq!(timed, expected);
    assert_eq!(table.missing, [Missing { name: "glove".to_owned(), reason: "no file".to_owned() }]);
}

#[test]
fn an_interrupted_suite_goes_on_where_it_was() {
    let directory = tempfile::tempdir().unwrap();
    let suite = suite(&["a", "broken", "b"]);
    // Two halves each, three runs of fibres, six of yarns: row a takes 13 renders. The next stop is in the runs of b.
    let mut fake = Fake { stop_after: 18, ..Fake::new() };
    assert_eq!(run_quietly(&suite, &mut fake, directory.path()), Err(BenchError::Interrupted));
    let mut fake = Fake::new();
    let mut saved = Vec::new();
    let table = run(
        &suite,
        &mut fake,
        directory.path(),
        None,
        |_| {},
        |table| {
            saved.push((table.rows.len(), table.missing.len()));
            Ok(())
        },
    );
    let table = table.unwrap();
    assert_eq!(saved, [(1, 1), (1, 2), (2, 2)]);
    assert_eq!(fake.renders.len(), 9, "only the timed runs of b: {:?}", fake.renders);
    assert!(fake.renders.iter().all(|r| r.starts_with("b ")));
    assert_eq!(table.missing[1], Missing { name: "broken".to_owned(), reason: "no memory".to_owned() });

    let mut fake = Fake::new();
    assert_eq!(run_quietly(&suite, &mut fake, directory.path()).unwrap(), table);
    assert!(fake.renders.is_empty());
    // Another target is another measurement, with other converged pictures.
    let other = Suite { target: 0.04, ..suite };
    run_quietly(&other, &mut fake, directory.path()).unwrap();
    assert!(fake.renders.len() >= 20);
}

#[test]
fn other_ways_are_compared_by_their_pictures() {
    let directory = tempfile::tempdir().unwrap();
    let mut suite = suite(&["a"]);
    suite.others.push(super::super::suite::OtherWay {
        name: "paper".to_owned(),
        method: Method::parse("yarn:paper").unwrap(),
        set: Vec::new(),
    });
    let table = run_quietly(&suite, &mut Fake::new(), directory.path()).unwrap();
    let other = &table.rows[0].others[0];
    assert_eq!(other.name, "paper");
    assert!((other.model_error.mean_ratio[0] - 0.9).abs() < 0.01);
    assert!(directory.path().join(&other.picture).exists());
}
