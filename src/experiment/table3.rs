//! Table 3: explicit fibres and aggregated yarns at equal quality.
//!
//! For each case and method: two halves of a converged picture, until the sample variance promises a fraction of the target;
//! from their noise the samples that the target needs; then timed runs, methods by turns, so that a machine that
//! slows down slows both. A timed run's error is measured against its own converged picture of other seeds, without the latter's
//! noise, and its time is scaled by error over target, from which it is not far: error falls about as one over time.
//! Every run is a process of its own, so that its memory is its own.

use std::{
    fmt,
    path::Path,
    process::{Command, Stdio},
    sync::atomic::{AtomicBool, Ordering},
};

use serde_json::Value;

use super::{
    converged::{self, Converged, Half},
    method::Method,
    suite::{Case, Suite},
};
use crate::{
    image::{
        self, Image, interleaved,
        metric::{Comparison, Halves, Pair},
        whole_file,
    },
    math::stats::{Estimate, ratio},
    report::{
        machine,
        table3::{Missing, ModelError, Other, Row, Run, Table, metric},
    },
    scene::load,
};

/// One render.
#[derive(Clone, Debug)]
pub(crate) struct Job<'a> {
    /// What to render.
    pub case: &'a Case,
    /// How.
    pub method: Method,
    /// `KEY=VALUE` over the case's own.
    pub set: &'a [String],
    /// Most samples per pixel.
    pub spp: u32,
    /// Stop at this estimated relMSE.
    pub noise: Option<f64>,
    /// Start of the samples' random numbers.
    pub seed: u32,
    /// Whether the light by lobe is wanted.
    pub lobes: bool,
}

/// A finished render: its picture and its statistics, as `render --stats` writes them.
#[derive(Clone, Debug)]
pub(crate) struct Done {
    /// The picture.
    pub image: Image,
    /// The statistics.
    pub stats: Value,
}

/// Why a case or the suite ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum BenchError {
    /// This case cannot be measured: text for the user.
    Case(String),
    /// The suite cannot go on.
    Suite(String),
    /// The user or the system asked to stop.
    Interrupted,
}

impl fmt::Display for BenchError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Case(message) | Self::Suite(message) => f.write_str(message),
            Self::Interrupted => f.write_str("interrupted"),
        }
    }
}

/// Who renders: processes in earnest, something quicker in tests.
pub(crate) trait Renderer {
    /// A name for everything that changes the picture of a case, its samples aside.
    ///
    /// # Errors
    /// The scene cannot be loaded.
    fn fingerprint(&mut self, suite: &Suite, case: &Case, method: Method, set: &[String])
    -> Result<String, BenchError>;

    /// Renders.
    ///
    /// # Errors
    /// What the renderer says.
    fn render(&mut self, suite: &Suite, job: &Job<'_>) -> Result<Done, BenchError>;
}

/// Renders each job by a process of this very program.
#[derive(Debug)]
pub(crate) struct Processes<'a> {
    /// Threads of each; `None` for all.
    pub threads: Option<usize>,
    /// Where pictures lie until they are read.
    pub scratch: &'a Path,
    /// Raised when the run shall end.
    pub interrupt: &'a AtomicBool,
}

impl Renderer for Processes<'_> {
    fn fingerprint(
        &mut self,
        suite: &Suite,
        case: &Case,
        method: Method,
        set: &[String],
    ) -> Result<String, BenchError> {
        match load::load(&case.scene, &case.options(suite, method, set)) {
            Ok(scene) => Ok(scene.fingerprint),
            Err(error) => Err(BenchError::Suite(format!(
                "{}: row \"{}\" by {method} does not load:\n{error}",
                suite.path, case.name
            ))),
        }
    }

    fn render(&mut self, suite: &Suite, job: &Job<'_>) -> Result<Done, BenchError> {
        let fail = |message: String| BenchError::Case(message);
        let directory = tempfile::Builder::new().prefix("run-").tempdir_in(self.scratch).map_err(|e| {
            BenchError::Suite(format!("error: no directory can be made in {}: {e}", self.scratch.display()))
        })?;
        let (picture, stats) = (directory.path().join("picture.exr"), directory.path().join("stats.json"));
        let program =
            std::env::current_exe().map_err(|e| BenchError::Suite(format!("error: cannot find this program: {e}")))?;
        let options = job.case.options(suite, job.method, job.set);
        let mut command = Command::new(program);
        command.arg("render").arg(&job.case.scene).arg("--quiet").arg("-o").arg(&picture).arg("--stats").arg(&stats);
        command.args(["--spp", &job.spp.to_string(), "--seed", &job.seed.to_string()]);
        if let Some(noise) = job.noise {
            command.args(["--noise", &noise.to_string()]);
        }
        if let Some(threads) = self.threads {
            command.args(["--threads", &threads.to_string()]);
        }
        if let Some(curves) = &options.curves {
            command.arg("--curves").arg(curves);
        }
        for assignment in &options.assignments {
            command.args(["--set", assignment]);
        }
        command.args(["--set", if job.lobes { "output.layers=[\"lobes\"]" } else { "output.layers=[]" }]);
        let output = command
            .stdin(Stdio::null())
            .output()
            .map_err(|e| BenchError::Suite(format!("error: cannot run this program: {e}")))?;
        if self.interrupt.load(Ordering::Relaxed) || matches!(output.status.code(), Some(129 | 130 | 143)) {
            return Err(BenchError::Interrupted);
        }
        if !output.status.success() {
            let message = String::from_utf8_lossy(&output.stderr).trim().to_owned();
            return Err(fail(if message.is_empty() {
                format!("the render ended with {}", output.status)
            } else {
                message
            }));
        }
        let text = std::fs::read_to_string(&stats).map_err(|e| fail(format!("no statistics of a render: {e}")))?;
        Ok(Done {
            image: image::read(&picture).map_err(|e| fail(e.to_string()))?,
            stats: serde_json::from_str(&text).map_err(|e| fail(format!("statistics of a render: {e}")))?,
        })
    }
}

/// What of the statistics goes into the table.
struct Figures {
    seconds: f64,
    build: f64,
    geometry: u64,
    bvh: u64,
    peak: u64,
    bounces: f64,
    spp: f64,
    rays: f64,
}

impl Figures {
    fn of(stats: &Value) -> Result<Self, BenchError> {
        let number = |path: &str| {
            let value = stats.pointer(path).and_then(Value::as_f64);
            value.ok_or_else(|| BenchError::Case(format!("the statistics of a render lack the number {path}")))
        };
        Ok(Self {
            seconds: number("/seconds/render")?,
            build: number("/seconds/generate")? + number("/seconds/build")?,
            geometry: number("/memory/geometry_bytes")? as u64,
            bvh: number("/memory/bvh_bytes")? as u64,
            peak: number("/memory/peak_rss_bytes")? as u64,
            bounces: number("/mean_bounces")?,
            spp: number("/image/spp_mean")?,
            rays: number("/rays/camera")? + number("/rays/bounce")? + number("/rays/shadow")?,
        })
    }
}

/// Seeds: the first halves of converged pictures have 1, the second 2, timed runs 3 and on.
const FIRST_TIMED_SEED: u32 = 3;

/// Most runs in a row of what is over in a moment.
const MOST_OFTEN: f64 = 10.0;

/// Runs a suite. Rows that `directory` holds already, from the same program and of the same scenes, are taken from there;
/// new ones are kept there. After every row `saved` gets the table so far; `say` is told what is being done.
///
/// # Errors
/// [`BenchError::Suite`] or [`BenchError::Interrupted`]; cases that fail are listed as missing.
pub(crate) fn run(
    suite: &Suite,
    renderer: &mut impl Renderer,
    directory: &Path,
    threads: Option<usize>,
    mut say: impl FnMut(&str),
    mut saved: impl FnMut(&Table) -> Result<(), BenchError>,
) -> Result<Table, BenchError> {
    let missing = suite.missing.iter().map(|(name, reason)| Missing { name: name.clone(), reason: reason.clone() });
    let mut table = Table {
        title: suite.title.clone(),
        suite: suite.path.clone(),
        machine: machine::describe(),
        commit: machine::commit().to_owned(),
        metric: metric(),
        target: suite.target,
        repeats: suite.repeats as usize,
        threads: threads.unwrap_or(0),
        rows: Vec::new(),
        missing: missing.collect(),
    };
    // All scenes are looked at before anything takes long.
    let mut keys = Vec::new();
    for case in &suite.cases {
        let mut parts = vec![format!(
            "{} {} {} {} {threads:?} {}",
            suite.target, suite.repeats, suite.converged, suite.max_spp, suite.min_seconds
        )];
        for (method, set) in ways(suite) {
            parts.push(renderer.fingerprint(suite, case, method, set)?);
        }
        parts.extend(suite.others.iter().map(|other| other.name.clone()));
        let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
        keys.push(converged::key(&parts));
    }
    for (case, key) in suite.cases.iter().zip(keys) {
        let file = directory.join("rows").join(format!("{key}.json"));
        let kept = std::fs::read_to_string(&file).ok().and_then(|text| serde_json::from_str::<Row>(&text).ok());
        let kept = kept.filter(|row| row.pictures.iter().all(|picture| directory.join(picture).exists()));
        if let Some(row) = kept {
            say(&format!("{}: measured before", case.name));
            table.rows.push(Row { name: case.name.clone(), paper: case.paper, ..row });
        } else {
            match measure(suite, case, renderer, directory, &mut say) {
                Ok(row) => {
                    let text = serde_json::to_string_pretty(&row).expect("numbers and text become JSON");
                    whole_file::write(&file, |file| std::io::Write::write_all(file, text.as_bytes()))
                        .map_err(|e| BenchError::Suite(format!("error: {e}")))?;
                    table.rows.push(row);
                }
                Err(BenchError::Case(reason)) => {
                    say(&format!("{}: {reason}", case.name));
                    table.missing.push(Missing { name: case.name.clone(), reason });
                }
                Err(error) => return Err(error),
            }
        }
        saved(&table)?;
    }
    Ok(table)
}

/// Every way in which a case is rendered: reference, tested, others.
fn ways(suite: &Suite) -> impl Iterator<Item = (Method, &[String])> {
    let none: &[String] = &[];
    [(suite.reference, none), (suite.tested, none)]
        .into_iter()
        .chain(suite.others.iter().map(|o| (o.method, o.set.as_slice())))
}

fn measure(
    suite: &Suite,
    case: &Case,
    renderer: &mut impl Renderer,
    directory: &Path,
    say: &mut impl FnMut(&str),
) -> Result<Row, BenchError> {
    let mut converged = |renderer: &mut _, method, set: &[String], lobes| -> Result<(Converged, String), BenchError> {
        let half = |seed| Job { case, method, set, spp: suite.max_spp, noise: None, seed, lobes };
        converge(
            suite,
            [half(1), half(2)],
            // The mean of two halves has half of the noise of one.
            Some(2.0 * suite.target / suite.converged),
            renderer,
            directory,
            say,
        )
    };
    let (reference, reference_file) = converged(renderer, suite.reference, &[], false)?;
    let (tested, tested_file) = converged(renderer, suite.tested, &[], true)?;
    let mut others = Vec::new();
    for other in &suite.others {
        let (picture, file) = converged(renderer, other.method, &other.set, false)?;
        others.push(Other {
            name: other.name.clone(),
            model_error: model_error(&picture.halves, &reference.halves)?,
            picture: file,
        });
    }
    let methods = [suite.reference, suite.tested];
    let truths = [&reference, &tested];
    let spp =
        truths.map(|truth| (sample_noise(truth) / suite.target).ceil().clamp(1.0, f64::from(suite.max_spp)) as u32);
    let mut timed: [Vec<(Figures, f64)>; 2] = [Vec::new(), Vec::new()];
    // What is over in a moment is timed more often: more samples would not do, for stratified samples gain more than one over
    // their number.
    let often = [0, 1].map(|side| {
        let seconds = f64::from(spp[side]) * truths[side].sample_seconds;
        (suite.min_seconds / seconds.max(1e-9)).ceil().clamp(1.0, MOST_OFTEN) as u32
    });
    for repeat in 0..suite.repeats {
        for side in 0..2 {
            let method = methods[side];
            for again in 0..often[side] {
                let number = repeat * often[side] + again;
                let all = suite.repeats * often[side];
                say(&format!("{}: {method}, timed run {} of {all}, {} spp", case.name, number + 1, spp[side]));
                let seed = FIRST_TIMED_SEED + number;
                let job = Job { case, method, set: &[], spp: spp[side], noise: None, seed, lobes: false };
                let done = renderer.render(suite, &job)?;
                let error = truths[side].halves.rel_mse(&colors(&done.image)?);
                let expected = sample_noise(truths[side]) / f64::from(spp[side]);
                if error.is_nan() || error <= 0.2 * expected {
                    return Err(BenchError::Case(format!(
                        "the error of a run by {method} cannot be measured: {error:.2e}, expected {expected:.2e}"
                    )));
                }
                timed[side].push((Figures::of(&done.stats)?, error));
            }
        }
    }
    let size = [reference.halves.width, reference.halves.alpha.len() / reference.halves.width.max(1)];
    let [(reference_run, reference_time), (tested_run, tested_time)] =
        [0, 1].map(|side| summary(&timed[side], methods[side], truths[side], suite.target));
    let (time_ratio, time_ratio_deviation) = ratio(&reference_time, &tested_time);
    let bytes = |run: &Run| (run.geometry_bytes + run.bvh_bytes) as f64;
    Ok(Row {
        name: case.name.clone(),
        scene: case.scene.display().to_string(),
        size,
        time_ratio,
        time_ratio_deviation,
        memory_ratio: bytes(&tested_run) / bytes(&reference_run),
        bounce_ratio: tested_run.mean_bounces / reference_run.mean_bounces,
        model_error: model_error(&tested.halves, &reference.halves)?,
        reference: reference_run,
        aggregated: tested_run,
        others,
        paper: case.paper,
        pictures: [reference_file, tested_file],
    })
}

/// The relMSE of one sample per pixel, if noise falls as one over their number, from that of one half with half of the samples.
fn sample_noise(truth: &Converged) -> f64 {
    0.5 * truth.spp * truth.halves.half_rel_mse()
}

/// Means over timed runs, each scaled to the target.
fn summary(timed: &[(Figures, f64)], method: Method, truth: &Converged, target: f64) -> (Run, Estimate) {
    let scaled = |get: fn(&Figures) -> f64| -> Estimate {
        let values: Vec<f64> = timed.iter().map(|(figures, error)| get(figures) * error / target).collect();
        Estimate::of(&values).expect("there is at least one run")
    };
    let mean =
        |get: fn(&Figures) -> f64| timed.iter().map(|(figures, _)| get(figures)).sum::<f64>() / timed.len() as f64;
    let time = scaled(|f| f.seconds);
    let run = Run {
        method: method.to_string(),
        render_seconds: time.mean,
        render_seconds_deviation: time.deviation,
        build_seconds: mean(|f| f.build),
        geometry_bytes: timed[0].0.geometry,
        bvh_bytes: timed[0].0.bvh,
        peak_rss_bytes: timed.iter().map(|(figures, _)| figures.peak).max().unwrap_or(0),
        mean_bounces: mean(|f| f.bounces),
        spp: scaled(|f| f.spp).mean,
        rays: scaled(|f| f.rays).mean,
        timed_spp: mean(|f| f.spp),
        timed_relmse: timed.iter().map(|(_, error)| *error).collect(),
        timed_seconds: timed.iter().map(|(figures, _)| figures.seconds).collect(),
        converged_spp: truth.spp,
    };
    (run, time)
}

/// The picture of two halves, a job each, from the cache or rendered and put there; and its file, from the directory of the table. It has
/// as many samples as the jobs say, or fewer once the relMSE of the first half is estimated to be below `limit`.
pub(super) fn converge(
    suite: &Suite,
    halves: [Job<'_>; 2],
    limit: Option<f64>,
    renderer: &mut impl Renderer,
    directory: &Path,
    say: &mut impl FnMut(&str),
) -> Result<(Converged, String), BenchError> {
    let mut settings = vec![format!("{limit:?}")];
    for job in &halves {
        settings.push(renderer.fingerprint(suite, job.case, job.method, job.set)?);
        settings.push(format!("{} {} {}", job.spp, job.seed, job.lobes));
    }
    let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
    let path = converged::path(&directory.join("cache"), &settings);
    let name =
        format!("cache/{}", path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()));
    if let Some(found) = Converged::load(&path) {
        return Ok((found, name));
    }
    let mut half = |number: u32, job: Job<'_>| -> Result<Half, BenchError> {
        let label: Vec<String> = std::iter::once(job.method.to_string()).chain(job.set.iter().cloned()).collect();
        say(&format!("{}: {}, converged picture, half {number} of 2", job.case.name, label.join(" ")));
        let done = renderer.render(suite, &job)?;
        let figures = Figures::of(&done.stats)?;
        Ok(Half { image: done.image, spp: figures.spp, seconds: figures.seconds })
    };
    let [first, second] = halves;
    let first = half(1, Job { noise: limit, ..first })?;
    let second = half(2, Job { spp: first.spp.round() as u32, ..second })?;
    let converged =
        Converged::new(&first, &second).ok_or_else(|| BenchError::Case("a picture without colours".to_owned()))?;
    converged.store(&path).map_err(|e| BenchError::Suite(format!("error: {e}")))?;
    Ok((converged, name))
}

fn colors(image: &Image) -> Result<Vec<[f32; 3]>, BenchError> {
    image.rgb().map(interleaved).ok_or_else(|| BenchError::Case("a picture without colours".to_owned()))
}

/// How far one converged picture is from another, on the cloth.
pub(super) fn model_error(test: &Halves, reference: &Halves) -> Result<ModelError, BenchError> {
    let cloth = reference.mostly_covered();
    let picture = |colors: Vec<[f32; 3]>| {
        let mut image = Image::new(reference.width, cloth.len() / reference.width.max(1));
        for (k, name) in ["R", "G", "B"].into_iter().enumerate() {
            let samples = colors.iter().map(|c| c[k]).collect();
            image.channels.push(image::Channel { name: name.to_owned(), samples });
        }
        image
    };
    let fail = |reason: &str| BenchError::Case(format!("the converged pictures cannot be compared: {reason}"));
    let mut pair = Pair::new(&picture(test.mean()), &picture(reference.mean())).map_err(|e| fail(&e.to_string()))?;
    pair.restrict(&cloth);
    let comparison = Comparison::new(&pair).ok_or_else(|| fail("no pixel is covered"))?;
    if comparison.mean_ratio.iter().any(|ratio| !ratio.is_finite()) {
        return Err(fail("a channel of the reference is black"));
    }
    Ok(ModelError {
        mean_ratio: comparison.mean_ratio,
        relmse: Halves::rel_mse_between(test, reference, &cloth, 1).ok_or_else(|| fail("no pixel is covered"))?,
        relmse_8: Halves::rel_mse_between(test, reference, &cloth, 8),
        flip: comparison.flip_hdr.ok_or_else(|| fail("the reference is black"))?,
    })
}

#[cfg(test)]
mod tests;
