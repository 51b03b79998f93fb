//! `yarnray scatter`

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
};

use clap::Args;
use serde_json::{Value, json};

use super::{
    Failure,
    files::{Attempts, Files},
    log, names,
    terminal::print,
    write_text,
};
use crate::{
    experiment::{
        LOBES,
        goniometer::{
            self, Effort, Mean, Measurement, Specimen, View,
            picture::{self, SweepRow},
            ply_alone,
        },
    },
    files::{extension, has_extension},
    input::document::Value as Setting,
    math::words::counted,
    report::UNKNOWN,
    scene::{
        Model, Yarn,
        load::{Definitions, LoadOptions, load_definitions},
    },
};

const EXAMPLES: &str = "Examples:
  yarnray scatter silk1                                            a yarn of the built-in library
  yarnray scatter scenes/yarns.toml --yarn silk1 --theta 40        of a file
  yarnray scatter silk1 --offset 0.3 --phase 20 --json             one ray, for programs
  yarnray scatter silk1 -o silk1.png -o silk1.svg -o silk1.csv     a map, a polar picture, a table
  yarnray scatter silk1 --model aggregated --model printed         two models beside each other
  yarnray scatter silk1 --light 0,150                              the value for light from one direction
  yarnray scatter --fiber wool --theta 60                          a single fibre
  yarnray scatter silk1 --truth 1000000                            beside paths through explicit fibres
  yarnray scatter silk1 --flatten 1.5 --truth 1000000              the same pressed flat, as in a weave
  yarnray scatter silk1 --sweep density=0.1..0.7:7 -o sweep.svg    over any parameter";

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct ScatterArgs {
    /// A scene or library file (.toml), or the name of a yarn of the built-in library.
    #[arg(value_name = "FILE.toml|YARN", required_unless_present = "fiber")]
    source: Option<String>,
    /// Which yarn of the file; not needed if there is one only.
    #[arg(long, value_name = "NAME", conflicts_with = "fiber")]
    yarn: Option<String>,
    /// Measure one of its plies alone, counted from 0.
    #[arg(long, value_name = "K")]
    ply: Option<usize>,
    /// Measure a single fibre instead.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["ply", "model", "offset", "average", "phase"])]
    fiber: Option<String>,
    /// The yarn's model; repeated, all are shown. Default: aggregated.
    #[arg(long, value_parser = names(&Model::NAMES))]
    model: Vec<String>,
    /// Angle of the camera's direction from the plane across the yarn, degrees.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_hyphen_values = true)]
    theta: f64,
    /// Where rays meet the yarn, -1 to 1 across it.
    #[arg(long, value_name = "H", allow_hyphen_values = true, conflicts_with = "average")]
    offset: Option<f64>,
    /// Average over the width (the default).
    #[arg(long)]
    average: bool,
    /// Azimuth of the first ply, degrees, 0 towards the camera. Default: averaged over all.
    #[arg(long, value_name = "DEG", allow_hyphen_values = true)]
    phase: Option<f64>,
    /// Width over height of a yarn that is pressed flat, as in cloth, and seen along its short axis.
    #[arg(long, value_name = "RATIO", default_value_t = 1.0, conflicts_with = "fiber")]
    flatten: f64,
    /// Also the value, with the cosine, for light from this latitude and azimuth, degrees (0,0 is the camera's side).
    #[arg(long, value_name = "THETA,PHI", value_parser = pair, allow_hyphen_values = true)]
    light: Option<(f64, f64)>,
    /// Also trace this many paths through explicit fibres of one straight yarn, placed as the yarn's file says.
    #[arg(long, value_name = "N", conflicts_with = "fiber", value_parser = clap::value_parser!(u64).range(1..))]
    truth: Option<u64>,
    /// Samples of the model.
    #[arg(long, value_name = "N", default_value_t = 400_000)]
    samples: u64,
    /// Measure over a range of a parameter: `theta`, `offset`, `phase`, `flatten`, a key of the yarn or its fibre, or a dotted path.
    #[arg(long, value_name = "KEY=A..B:N")]
    sweep: Option<String>,
    /// Override a key of the yarn or its fibre, or any key by its dotted path (repeatable).
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Start of all random numbers.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u32,
    /// Where to write: .json (all), .csv (distribution or sweep), .png (map of the distribution), .svg (polar picture or
    /// plot of the sweep). Repeatable.
    #[arg(short, long = "out", value_name = "PATH")]
    out: Vec<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Two numbers with a comma.
fn pair(text: &str) -> Result<(f64, f64), String> {
    let (a, b) = text.split_once(',').ok_or("expected two numbers, as in 10,150")?;
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.is_finite()).ok_or("expected two numbers");
    Ok((number(a)?, number(b)?))
}

/// An angle in radians, less than a turn: single precision holds it to the last ten millionth.
fn azimuth(degrees: f64) -> f64 {
    degrees.rem_euclid(360.0).to_radians()
}

/// The most that a yarn can be pressed flat: as in weaves.
const MOST_FLATTENED: f64 = 4.0;

/// The name of the measurement of explicit fibres.
const TRUTH: &str = "truth";

fn input(message: impl std::fmt::Display) -> Failure {
    Failure::Input(format!("error: {message}"))
}

/// A range of a parameter.
struct Sweep {
    key: String,
    values: Vec<f64>,
}

impl Sweep {
    fn parse(text: &str) -> Result<Self, Failure> {
        let wrong = || input(format!("--sweep {text}: expected KEY=A..B:N, as in density=0.1..0.7:7"));
        let (key, rest) = text.split_once('=').ok_or_else(wrong)?;
        let (from, rest) = rest.split_once("..").ok_or_else(wrong)?;
        let (to, count) = rest.rsplit_once(':').ok_or_else(wrong)?;
        let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(wrong);
        let (from, to) = (number(from)?, number(to)?);
        let count: u32 = count.trim().parse().map_err(|_| wrong())?;
        if !(1..=1000).contains(&count) || key.trim().is_empty() {
            return Err(input(format!("--sweep {text}: a range has 1 to 1000 values")));
        }
        let key = key.trim().to_owned();
        let value = |i: u32| match i {
            0 => from,
            i if i + 1 == count => to,
            i => decimal(from + (to - from) * f64::from(i) / f64::from(count - 1)),
        };
        let values: Vec<f64> = (0..count).map(value).collect();
        if let Some(between) = values.iter().find(|v| is_whole(&key) && v.fract() != 0.0) {
            let every = match (to - from).abs() + 1.0 {
                all if from.fract() == 0.0 && to.fract() == 0.0 && all <= 1000.0 => {
                    format!("--sweep {key}={from}..{to}:{all} takes every one")
                }
                _ => format!("--sweep {key}={}..{}:2 takes whole numbers", from.floor(), to.ceil()),
            };
            let problem = format!(
                "--sweep {text}: `{key}` takes whole numbers, but {between} is among its {}",
                counted(count, "value")
            );
            return Err(Failure::hinted(problem, every));
        }
        Ok(Self { key, values })
    }
}

/// The number that a person would write: of twelve digits.
fn decimal(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// Whether a key, or a dotted path to it, takes whole numbers only.
fn is_whole(key: &str) -> bool {
    matches!(key.rsplit('.').next(), Some("fibers" | "plies"))
}

/// One thing on the goniometer, seen from somewhere.
struct Job {
    definitions: Definitions,
    view: View,
}

/// What one job gave, by name.
struct Found {
    all: Vec<(String, Measurement)>,
    values: Option<[[Mean; 3]; 5]>,
    title: String,
}

impl ScatterArgs {
    fn file(&self) -> Option<PathBuf> {
        self.source.as_ref().map(PathBuf::from).filter(|path| has_extension(path, "toml"))
    }

    fn models(&self) -> Vec<Model> {
        let find = |name: &String| Model::NAMES.iter().find(|(n, _)| n == name).map(|(_, m)| *m);
        let given: Vec<Model> = self.model.iter().filter_map(find).collect();
        if given.is_empty() { vec![Model::Aggregated] } else { given }
    }

    /// What `--set` says, by dotted paths.
    fn assignments(&self) -> Result<Vec<String>, Failure> {
        let spelled = |assignment: &String| match assignment.split_once('=') {
            Some((key, value)) => Ok(format!("{}={value}", self.path_of(key.trim())?)),
            // That this is no assignment is told where it is read.
            None => Ok(assignment.clone()),
        };
        self.set.iter().map(spelled).collect()
    }

    fn load(&self, set: &[String], extra: Option<(String, Setting, String)>) -> Result<Definitions, Failure> {
        let file = self.file();
        if let Some(path) = &file
            && self.fiber.is_none()
            && !(set.is_empty() && extra.is_none())
        {
            // Keys are set where the yarn is described: in the built-in library, if the scene only names it.
            let plain = load_definitions(Some(path), &LoadOptions::default())?;
            if plain.is_built_in(&self.yarn(&plain)?.name) {
                return self.load_from(None, set, extra);
            }
        }
        self.load_from(file.as_deref(), set, extra)
    }

    fn load_from(
        &self,
        file: Option<&Path>,
        set: &[String],
        extra: Option<(String, Setting, String)>,
    ) -> Result<Definitions, Failure> {
        let settings = extra.into_iter().collect();
        let options = LoadOptions { assignments: set.to_vec(), settings, ..LoadOptions::default() };
        Ok(load_definitions(file, &options)?)
    }

    fn yarn<'a>(&self, definitions: &'a Definitions) -> Result<&'a Yarn, Failure> {
        let name = match (&self.yarn, &self.source) {
            (Some(name), _) => name.clone(),
            (None, Some(name)) if self.file().is_none() => name.clone(),
            _ => {
                let mut all = definitions.yarns.keys();
                match (all.next(), all.next()) {
                    (Some(one), None) => one.clone(),
                    (None, _) => return Err(input("the file describes no yarn")),
                    _ => {
                        let list: Vec<_> = definitions.yarns.keys().map(String::as_str).collect();
                        return Err(input(format!("which yarn? --yarn takes one of {}", list.join(", "))));
                    }
                }
            }
        };
        Ok(definitions.yarn(&name)?)
    }

    fn check(&self, view: &View) -> Result<(), Failure> {
        if view.theta.is_nan() || view.theta.abs() >= std::f64::consts::FRAC_PI_2 {
            let theta = view.theta.to_degrees();
            return Err(input(format!("theta {theta}: expected an angle above -90 and below 90 degrees")));
        }
        if view.offset.is_some_and(|h| !(-1.0..=1.0).contains(&h)) {
            return Err(input(format!("offset {}: expected a number from -1 to 1", view.offset.unwrap_or_default())));
        }
        if view.phase.is_some_and(|p| !p.is_finite()) {
            return Err(input("phase: expected an angle"));
        }
        if !(1.0..=MOST_FLATTENED).contains(&view.flatten) {
            return Err(input(format!("flatten {}: expected a ratio from 1 to {MOST_FLATTENED}", view.flatten)));
        }
        if view.flatten > 1.0 && view.phase.is_some() && self.truth.is_some() {
            return Err(input(
                "--phase: explicit fibres that are pressed flat are seen with plies at any azimuth: leave it out",
            ));
        }
        Ok(())
    }

    fn view(&self) -> Result<View, Failure> {
        let view = View {
            theta: self.theta.to_radians(),
            offset: self.offset,
            phase: self.phase.map(azimuth),
            flatten: self.flatten,
        };
        self.check(&view)?;
        Ok(view)
    }

    /// The job for one value of the sweep, with these assignments.
    fn swept(&self, sweep: &Sweep, at: f64, set: &[String]) -> Result<Job, Failure> {
        let mut view = self.view()?;
        if self.fiber.is_some() && matches!(sweep.key.as_str(), "offset" | "phase" | "flatten") {
            return Err(input(format!(
                "--sweep {}: a single fibre has none; `theta` or a key of the fibre",
                sweep.key
            )));
        }
        match sweep.key.as_str() {
            "theta" => view.theta = at.to_radians(),
            "offset" => view.offset = Some(at),
            "phase" => view.phase = Some(azimuth(at)),
            "flatten" => view.flatten = at,
            _ => {
                let path = self.path_of(&sweep.key)?;
                let value = if is_whole(&path) { Setting::Integer(at as i64) } else { Setting::Float(at) };
                let label = format!("--sweep {}={at}", sweep.key);
                return Ok(Job { definitions: self.load(set, Some((path, value, label)))?, view });
            }
        }
        self.check(&view)?;
        Ok(Job { definitions: self.load(set, None)?, view })
    }

    /// The dotted path that a short key stands for: of the yarn, or of the fibre it is made of.
    fn path_of(&self, key: &str) -> Result<String, Failure> {
        if key.contains('.') {
            return Ok(key.to_owned());
        }
        let of_fiber = matches!(key, "r" | "tt" | "d" | "beta_r" | "beta_tt" | "beta_n");
        if let Some(fiber) = &self.fiber {
            return Ok(format!("fiber.{fiber}.{key}"));
        }
        let definitions = self.load(&[], None)?;
        let yarn = self.yarn(&definitions)?;
        if !of_fiber {
            return Ok(format!("yarn.{}.{key}", yarn.name));
        }
        let fiber = &yarn.fibers[0].0;
        if !definitions.fibers.contains_key(fiber) && !definitions.is_built_in(&yarn.name) {
            let problem =
                format!("{key}: `{}` is of the built-in fibre `{fiber}`, which this file does not describe", yarn.name);
            let hint = format!("a [fiber.{fiber}] in the file, or `yarnray scatter --fiber {fiber}`");
            return Err(Failure::hinted(problem, hint));
        }
        Ok(format!("fiber.{fiber}.{key}"))
    }

    fn measure(&self, job: &Job) -> Result<Found, Failure> {
        let effort = Effort { paths: self.samples, seed: self.seed };
        let light = self.light.map(|(t, p)| (t.to_radians(), p.to_radians()));
        let values = |s: &Specimen<'_>| light.map(|l| goniometer::value(s, &job.view, l, effort));
        if let Some(name) = &self.fiber {
            let specimen = Specimen::Fiber(job.definitions.fiber(name)?);
            let all = vec![("fiber".to_owned(), goniometer::measure(&specimen, &job.view, effort))];
            return Ok(Found { all, values: values(&specimen), title: format!("fibre {name}") });
        }
        let whole = self.yarn(&job.definitions)?;
        let yarn = match self.ply {
            None => whole.clone(),
            Some(k) if k < whole.plies.len() => ply_alone(whole, k),
            Some(k) => {
                let n = whole.plies.len();
                return Err(input(format!("--ply {k}: `{}` has {n} plies, counted from 0", whole.name)));
            }
        };
        let mut all = Vec::new();
        let mut at_light = None;
        for model in self.models() {
            let specimen = Specimen::Yarn(&yarn, model);
            all.push((model.name().to_owned(), goniometer::measure(&specimen, &job.view, effort)));
            at_light = at_light.or_else(|| values(&specimen));
        }
        if let Some(paths) = self.truth {
            let truth = goniometer::truth(&yarn, &job.view, Effort { paths, ..effort })?;
            all.push((TRUTH.to_owned(), truth));
        }
        Ok(Found { all, values: at_light, title: format!("yarn {}", yarn.name) })
    }
}

pub(super) fn run(args: &ScatterArgs) -> Result<(), Failure> {
    for path in &args.out {
        let extension = extension(path).unwrap_or_default();
        if !matches!(extension.as_str(), "json" | "csv" | "svg" | "png") {
            return Err(input(format!("{}: expected the extension .json, .csv, .svg or .png", path.display())));
        }
        if extension == "png" && args.sweep.is_some() {
            return Err(input(format!("{}: a sweep is written as .json, .csv or .svg", path.display())));
        }
    }
    Files::default().writes("-o", &args.out).check(true)?;
    if let (Some(name), Some(source), None) = (&args.fiber, &args.source, args.file()) {
        return Err(input(format!(
            "`{source}` beside --fiber {name}: expected a scene or library file (.toml), or nothing"
        )));
    }
    if args.samples == 0 {
        return Err(input("--samples 0: expected at least 1"));
    }
    match &args.sweep {
        Some(text) => run_sweep(args, &Sweep::parse(text)?),
        None => run_one(args),
    }
}

fn pretty(value: &Value) -> String {
    serde_json::to_string_pretty(value).expect("numbers and text become JSON") + "\n"
}

fn run_one(args: &ScatterArgs) -> Result<(), Failure> {
    let job = Job { definitions: args.load(&args.assignments()?, None)?, view: args.view()? };
    let found = args.measure(&job)?;
    let mut report = report_json(args, &job, &found);
    let shown: Vec<(&str, &Measurement)> = found.all.iter().map(|(n, m)| (n.as_str(), m)).collect();
    let (mut attempts, mut written) = (Attempts::default(), Vec::new());
    for path in &args.out {
        let is_written = if has_extension(path, "png") {
            attempts.note(picture::write_map(path, &format!("{}, theta {}", found.title, args.theta), &shown))
        } else if has_extension(path, "csv") {
            attempts.note(write_text(path, &picture::distribution_csv(&shown)))
        } else if has_extension(path, "svg") {
            let title = format!("{}, theta {}: share per radian of azimuth", found.title, args.theta);
            attempts.note(write_text(path, &picture::polar_svg(&title, &shown)))
        } else {
            let mut whole = report.clone();
            for (name, m) in &shown {
                whole["distribution"][*name] = m.distribution_json();
            }
            attempts.note(write_text(path, &pretty(&whole)))
        };
        if is_written {
            written.push(path);
        }
    }
    if args.json {
        report["wrote"] = json!(written.iter().map(|p| p.display().to_string()).collect::<Vec<_>>());
        print(&pretty(&report))?;
    } else {
        let wrote = written.iter().map(|path| format!("wrote {}\n", path.display()));
        print(&(report_text(args, &found) + &wrote.collect::<String>()))?;
    }
    attempts.finish()
}

fn report_json(args: &ScatterArgs, job: &Job, found: &Found) -> Value {
    let (first_name, first) = &found.all[0];
    let mut report = first.to_json();
    report["yarn"] = json!(found.title.split_once(' ').map_or("", |(_, name)| name));
    report["model"] = json!(first_name);
    report["theta"] = json!(args.theta);
    report["offset"] = json!(job.view.offset);
    report["phase"] = json!(args.phase);
    report["flatten"] = json!(job.view.flatten);
    if let (Some(values), Some((theta, phi))) = (&found.values, args.light) {
        let by_lobe = LOBES.iter().zip(values).map(|(n, v)| ((*n).to_owned(), json!(v.map(|m| m.mean))));
        report["value"] = json!({"light": [theta, phi], "lobes": Value::Object(by_lobe.collect())});
    }
    let others: serde_json::Map<String, Value> =
        found.all[1..].iter().filter(|(n, _)| n != TRUTH).map(|(n, m)| (n.clone(), m.to_json())).collect();
    if !others.is_empty() {
        report["others"] = Value::Object(others);
    }
    if let Some((_, truth)) = found.all.iter().find(|(n, _)| n == TRUTH) {
        report["truth"] = truth.to_json();
        let off = |a: &[Mean; 3], b: &[Mean; 3]| -> [f64; 3] { std::array::from_fn(|c| a[c].mean - b[c].mean) };
        report["difference"] = json!({
            "forward": off(&first.scattered.forward, &truth.scattered.forward),
            "backward": off(&first.scattered.backward, &truth.scattered.backward),
            "unscattered": first.unscattered.mean - truth.unscattered.mean,
        });
    }
    report
}

fn report_text(args: &ScatterArgs, found: &Found) -> String {
    let mut text = format!(
        "{}, theta {} degrees, {}\n",
        found.title,
        args.theta,
        args.offset.map_or("averaged over the width".to_owned(), |h| format!("offset {h}"))
    );
    let error = |m: Mean| m.se.map_or(UNKNOWN.to_owned(), |se| format!("{se:.4}"));
    let line = |text: &mut String, name: &str, m: &[Mean; 3]| {
        let _ = writeln!(
            text,
            "  {name:14} {:.4} {:.4} {:.4}   +- {} {} {}",
            m[0].mean,
            m[1].mean,
            m[2].mean,
            error(m[0]),
            error(m[1]),
            error(m[2])
        );
    };
    for (name, m) in &found.all {
        let _ = writeln!(text, "{name} ({})", counted(m.paths, "sample"));
        line(&mut text, "backward", &m.scattered.backward);
        line(&mut text, "forward", &m.scattered.forward);
        let _ = writeln!(text, "  {:14} {:.4}   +- {}", "unscattered", m.unscattered.mean, error(m.unscattered));
        for (lobe, half) in LOBES.iter().zip(m.lobes.iter().flatten()) {
            let sum: [f64; 3] = std::array::from_fn(|c| half.forward[c].mean + half.backward[c].mean);
            if sum.iter().any(|s| *s > 0.0) {
                let _ = writeln!(
                    text,
                    "  {lobe:3} back        {:.4} {:.4} {:.4}   forward {:.4} {:.4} {:.4}",
                    half.backward[0].mean,
                    half.backward[1].mean,
                    half.backward[2].mean,
                    half.forward[0].mean,
                    half.forward[1].mean,
                    half.forward[2].mean
                );
            }
        }
    }
    if let Some((_, truth)) = found.all.iter().find(|(n, _)| n == TRUTH) {
        for (name, m) in found.all.iter().filter(|(n, _)| n != TRUTH) {
            let _ = writeln!(text, "{name} over truth, reflected and transmitted (with unscattered)");
            let ((back, on), (true_back, true_on)) = (m.energies(), truth.energies());
            for (what, a, b) in [("reflected", back, true_back), ("transmitted", on, true_on)] {
                let r: [f64; 3] = std::array::from_fn(|c| a[c].mean / b[c].mean);
                let _ = writeln!(text, "  {what:14} {:.3}  {:.3}  {:.3}", r[0], r[1], r[2]);
            }
        }
    }
    if let (Some(values), Some((theta, phi))) = (&found.values, args.light) {
        let _ = writeln!(text, "value for light from ({theta}, {phi}), 1/sr, by {}", found.all[0].0);
        for (lobe, v) in LOBES.iter().zip(values) {
            line(&mut text, lobe, v);
        }
    }
    text
}

fn run_sweep(args: &ScatterArgs, sweep: &Sweep) -> Result<(), Failure> {
    let mut rows = Vec::new();
    let mut names: Vec<String> = Vec::new();
    let mut title = String::new();
    // Everything is read before anything is measured.
    let set = args.assignments()?;
    let jobs = sweep.values.iter().map(|&at| args.swept(sweep, at, &set)).collect::<Result<Vec<_>, _>>()?;
    for (job, &at) in jobs.iter().zip(&sweep.values) {
        let found = args.measure(job)?;
        names = found.all.iter().map(|(n, _)| n.clone()).collect();
        rows.push(SweepRow { at, energies: found.all.iter().map(|(_, m)| m.energies()).collect() });
        title = found.title;
    }
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let csv = picture::sweep_csv(&sweep.key, &names, &rows);
    let as_json = || {
        let rows: Vec<Value> = rows
            .iter()
            .map(|row| {
                let mut out = json!({ "at": row.at });
                for (name, (reflected, transmitted)) in names.iter().zip(&row.energies) {
                    out[*name] = json!({
                        "reflected": reflected.map(|m| m.mean), "reflected_se": reflected.map(|m| m.se),
                        "transmitted": transmitted.map(|m| m.mean), "transmitted_se": transmitted.map(|m| m.se),
                    });
                }
                out
            })
            .collect();
        pretty(&json!({"specimen": title, "key": sweep.key, "rows": rows}))
    };
    let (mut attempts, mut written) = (Attempts::default(), Vec::new());
    for path in &args.out {
        let text = if has_extension(path, "csv") {
            csv.clone()
        } else if has_extension(path, "svg") {
            picture::sweep_svg(&format!("{title}: energy over {}", sweep.key), &sweep.key, &names, &rows)
        } else {
            as_json()
        };
        if attempts.note(write_text(path, &text)) {
            written.push(path);
        }
    }
    if args.json {
        print(&as_json())?;
    } else {
        print(&csv)?;
        written.iter().for_each(|path| log::say(&format!("wrote {}", path.display())));
    }
    attempts.finish()
}
