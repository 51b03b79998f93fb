//! The command line: one file per command, from arguments to a call and to what is printed.
//!
//! Exit status: 0 done; 1 a check failed; 2 bad usage or input, with one clear message; 130 interrupted by the user,
//! 143 by the system, 129 by a terminal that closed.

mod bench;
mod compare;
mod converge;
mod convert;
mod curve_files;
mod files;
mod info;
mod level;
mod log;
mod make;
mod manual;
mod merge;
mod pictures;
mod render;
mod scatter;
mod signals;
mod stress;
mod terminal;
mod working;

use std::{ops::RangeInclusive, path::PathBuf, process::ExitCode};

use clap::{Args, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

use self::working::Working;
use crate::{
    cloth::BuildError,
    experiment::{converge::ConvergeError, table3::BenchError},
    ffi::heap,
    geometry::{
        overlap::{self, Overlap},
        strand::Folds,
    },
    image::whole_file,
    input::{diagnostic::hinted, document::Value},
    math::words::counted,
    plan,
    render::OutOfMemory,
    scene::{
        Fabric, Mode, Model, Scene,
        load::{LoadError, LoadOptions, load},
    },
};

/// A renderer for knitted and woven cloth: yarns are curves, an analytic model answers for their fibres.
#[derive(Parser, Debug)]
#[command(name = "yarnray", version, long_version = crate::image::exr::SOFTWARE.strip_prefix("yarnray ").unwrap_or(""), after_help = EXAMPLES, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "Examples:
  yarnray render scenes/swatch.toml -o swatch.exr -o swatch.png
  yarnray render scenes/glove.toml --curves glove.bcc --spp 128 -o glove.png
  yarnray info scenes/swatch.toml
  yarnray scatter silk1 -o silk1.png

`yarnray COMMAND --help` has more for each command.";

#[derive(Subcommand, Debug)]
enum Command {
    /// Render a scene.
    Render(render::RenderArgs),
    /// Put parts of one render together: shards, crops, checkpoints.
    Merge(merge::MergeArgs),
    /// Measure explicit fibres against aggregated yarns at equal quality: Table 3.
    Bench(bench::BenchArgs),
    /// Compare two pictures: how far one is from the other, and where.
    Compare(compare::CompareArgs),
    /// Measure error against run time for modes and models.
    Converge(converge::ConvergeArgs),
    /// Tell what a scene or curve file holds, and what a render of it uses and leaves out.
    Info(info::InfoArgs),
    /// Make curve files of knitted and woven cloth.
    Make(make::MakeArgs),
    /// Write a curve file in another format.
    Convert(convert::ConvertArgs),
    /// Measure how a fibre, ply or yarn scatters light.
    Scatter(scatter::ScatterArgs),
    /// Run stiff and extreme cases, and tell which keep their bounds.
    Stress(stress::StressArgs),
    /// Print completions for a shell.
    Completions(manual::CompletionsArgs),
    /// Write manual pages.
    Man(manual::ManArgs),
}

/// What a command ends with besides success.
#[derive(Debug)]
enum Failure {
    /// Bad usage or input: exit status 2.
    Input(String),
    /// The work was done and a check failed: exit status 1.
    Check(String),
    /// Interrupted; what there was is saved: exit status 129, 130 or 143.
    Interrupted,
    /// Whoever read the output has gone: nothing is left to do, and nothing to say.
    Closed,
}

impl Failure {
    /// What is wrong with usage or input, with what to do about it.
    fn hinted(problem: impl std::fmt::Display, hint: impl std::fmt::Display) -> Self {
        Self::Input(hinted(format!("error: {problem}"), hint))
    }
}

impl From<LoadError> for Failure {
    fn from(error: LoadError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<crate::image::ImageError> for Failure {
    fn from(error: crate::image::ImageError) -> Self {
        Self::Input(format!("error: {error}"))
    }
}

impl From<BuildError> for Failure {
    fn from(error: BuildError) -> Self {
        match &error {
            BuildError::Embree(_) => Self::Input(format!("error: {error}")),
            BuildError::Memory { .. } => Self::hinted(
                error,
                "--max-memory GIGABYTES allows more; fewer yarns or pixels, or --mode yarn, take less",
            ),
        }
    }
}

impl From<plan::TooLarge> for Failure {
    fn from(error: plan::TooLarge) -> Self {
        Self::hinted(
            error,
            "--crop renders a part, and `yarnray merge` puts parts together; output.layers = [] takes less; \
             --max-memory GIGABYTES allows more",
        )
    }
}

impl From<OutOfMemory> for Failure {
    fn from(error: OutOfMemory) -> Self {
        Self::hinted(error, "--crop renders a part, and `yarnray merge` puts parts together")
    }
}

impl From<crate::ffi::oidn::OidnError> for Failure {
    fn from(error: crate::ffi::oidn::OidnError) -> Self {
        Self::Input(format!("error: {error}"))
    }
}

impl From<ConvergeError> for Failure {
    fn from(error: ConvergeError) -> Self {
        match error {
            ConvergeError::Failed(message) => Self::Input(message),
            ConvergeError::Interrupted => Self::Interrupted,
        }
    }
}

impl From<BenchError> for Failure {
    fn from(error: BenchError) -> Self {
        match error {
            BenchError::Case(message) | BenchError::Suite(message) => Self::Input(message),
            BenchError::Interrupted => Self::Interrupted,
        }
    }
}

/// So many threads, or as many as there are cores; and how many that is.
fn thread_pool(threads: Option<usize>) -> Result<(rayon::ThreadPool, usize), Failure> {
    let threads = threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => Ok((pool, threads)),
        Err(error) => Err(Failure::Input(format!("error: cannot start {threads} threads: {error}"))),
    }
}

/// Names of values that are numbers, as `--help` shows them.
const NUMBERS: [&str; 20] = [
    "N",
    "L",
    "R",
    "X",
    "D",
    "K",
    "DEG",
    "H",
    "R,Y",
    "THETA,PHI",
    "SECONDS",
    "GIGABYTES",
    "STOPS",
    "RELMSE",
    "A..B",
    "X0,Y0,X1,Y1",
    "RATIO",
    "WALES,COURSES",
    "N,M",
    "I/N",
];

/// Lets every option that takes a number take `-1` as well: its own message tells what is expected, where clap would look
/// for an option of this name.
fn take_negative_numbers(command: clap::Command) -> clap::Command {
    let is_number = |arg: &clap::Arg| {
        let names = arg.get_value_names().unwrap_or_default();
        names.iter().any(|name| NUMBERS.contains(&name.as_str()))
    };
    let command = command.mut_args(|arg| if is_number(&arg) { arg.allow_hyphen_values(true) } else { arg });
    command.mut_subcommands(take_negative_numbers)
}

/// Runs the program with the process's arguments.
pub fn run() -> ExitCode {
    heap::keep_small_pieces();
    let matches = take_negative_numbers(Cli::command()).get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let result = match cli.command {
        Command::Render(args) => render::run(&args),
        Command::Merge(args) => merge::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Converge(args) => converge::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Make(args) => make::run(&args),
        Command::Scatter(args) => scatter::run(&args),
        Command::Stress(args) => stress::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Completions(args) => manual::completions(&args, take_negative_numbers(Cli::command())),
        Command::Man(args) => manual::man(&args, Cli::command()),
    };
    match result {
        Ok(()) | Err(Failure::Closed) => ExitCode::SUCCESS,
        Err(Failure::Input(message)) => {
            log::error(&message);
            ExitCode::from(2)
        }
        Err(Failure::Check(message)) => {
            terminal::say(&message);
            ExitCode::from(1)
        }
        Err(Failure::Interrupted) => ExitCode::from(signals::exit_status()),
    }
}

/// Options that commands share which load a scene.
#[derive(Args, Debug, Clone, Default)]
struct SceneArgs {
    /// All frames, before the first of them.
    #[arg(skip)]
    frames: Option<RangeInclusive<u32>>,
    /// How yarns are represented.
    #[arg(long, value_parser = names(&Mode::NAMES))]
    mode: Option<String>,
    /// The yarns' scattering model.
    #[arg(long, value_parser = names(&Model::NAMES))]
    model: Option<String>,
    /// Stop at this many samples per pixel.
    #[arg(long, value_name = "N")]
    spp: Option<u32>,
    /// Stop after this many seconds of rendering.
    #[arg(long, value_name = "SECONDS")]
    time: Option<f64>,
    /// Stop at this estimated relative mean square error.
    #[arg(long, value_name = "X")]
    noise: Option<f64>,
    /// More samples where the first ones say that they are needed; --spp is then the mean.
    #[arg(long)]
    adaptive: bool,
    /// Picture width in pixels.
    #[arg(long, value_name = "N")]
    width: Option<u32>,
    /// Picture height in pixels.
    #[arg(long, value_name = "N")]
    height: Option<u32>,
    /// Render only these pixels (the last two exclusive).
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = crop)]
    crop: Option<[u32; 4]>,
    /// Most scattering events of a path.
    #[arg(long, value_name = "N")]
    max_bounces: Option<u32>,
    /// Threads; all cores if not given.
    #[arg(long, short = 'j', value_name = "N")]
    threads: Option<u32>,
    /// Refuse renders whose curves, BVH, film and textures would take more than so many gigabytes. Default: the machine's
    #[arg(long, value_name = "GIGABYTES")]
    max_memory: Option<f64>,
    /// Start of all random numbers.
    #[arg(long, value_name = "N")]
    seed: Option<u32>,
    /// Override any key of the scene by its dotted path (repeatable).
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Render this curve file in place of the first fabric's curves.
    #[arg(long, value_name = "FILE")]
    curves: Option<PathBuf>,
    /// Let the camera frame what there is.
    #[arg(long)]
    frame: bool,
}

/// Two numbers with a comma between them.
fn two(text: &str) -> Option<[f64; 2]> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|n| n.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    numbers?.try_into().ok()
}

/// Reads a length or another number that must be above 0.
fn positive(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|v: &f64| *v > 0.0 && v.is_finite()).ok_or_else(|| "expected a number above 0".to_owned())
}

/// Reads four numbers with commas between them.
fn crop(text: &str) -> Result<[u32; 4], String> {
    let numbers: Result<Vec<u32>, _> = text.split(',').map(|n| n.trim().parse()).collect();
    numbers
        .ok()
        .and_then(|n| n.try_into().ok())
        .ok_or_else(|| "expected four whole numbers, as in 300,200,460,320".to_owned())
}

/// Reads the name of a value.
fn named<T: Clone + Send + Sync>(
    list: &'static [(&'static str, T)],
) -> impl clap::builder::TypedValueParser<Value = T> {
    let value = move |name: &str| list.iter().find(|(known, _)| *known == name).map(|(_, value)| value.clone());
    clap::builder::TypedValueParser::map(names(list), move |name| value(&name).expect("only known names come here"))
}

/// Reads a name from a list, and keeps it.
fn names<T>(list: &'static [(&'static str, T)]) -> clap::builder::PossibleValuesParser {
    list.iter().map(|(name, _)| *name).collect::<Vec<_>>().into()
}

impl SceneArgs {
    /// Keys of the scene that these options set, their values, and the options as they were given.
    fn settings(&self) -> Vec<(String, Value, String)> {
        type Given = (Option<Value>, String);
        let text = |v: &Option<String>| -> Given { (v.clone().map(Value::from), v.clone().unwrap_or_default()) };
        let count = |v: Option<u32>| -> Given { (v.map(Value::from), v.map_or(String::new(), |n| n.to_string())) };
        let number = |v: Option<f64>| -> Given { (v.map(Value::Float), v.map_or(String::new(), |n| n.to_string())) };
        let crop = self.crop.map_or(String::new(), |crop| crop.map(|v| v.to_string()).join(","));
        let all: [(&str, Given); 13] = [
            ("mode", text(&self.mode)),
            ("model", text(&self.model)),
            ("spp", count(self.spp)),
            ("time", number(self.time)),
            ("noise", number(self.noise)),
            ("width", count(self.width)),
            ("height", count(self.height)),
            ("adaptive", (self.adaptive.then_some(Value::Boolean(true)), String::new())),
            ("max_bounces", count(self.max_bounces)),
            ("threads", count(self.threads)),
            ("seed", count(self.seed)),
            ("max_memory", number(self.max_memory)),
            ("crop", (self.crop.map(Value::from), crop)),
        ];
        let setting = |(key, (value, shown)): (&str, Given)| {
            let option = format!("--{} {shown}", key.replace('_', "-")).trim_end().to_owned();
            Some((format!("render.{key}"), value?, option))
        };
        all.into_iter().filter_map(setting).collect()
    }

    /// The first of these options that is given, as it is spelled.
    fn given(&self) -> Option<String> {
        let others = [("--set", !self.set.is_empty()), ("--curves", self.curves.is_some()), ("--frame", self.frame)];
        let others = others.into_iter().filter(|(_, given)| *given).map(|(option, _)| option.to_owned());
        let of_keys =
            self.settings().into_iter().filter_map(|(_, _, option)| Some(option.split(' ').next()?.to_owned()));
        of_keys.chain(others).next()
    }

    /// Loads a scene with these options, and shows that it does unless `quiet`.
    fn load(&self, path: &std::path::Path, quiet: bool) -> Result<Scene, LoadError> {
        self.load_or_survey(path, quiet, false)
    }

    /// As [`Self::load`]; a survey lays no yarns on garments.
    fn load_or_survey(&self, path: &std::path::Path, quiet: bool, survey: bool) -> Result<Scene, LoadError> {
        let options = LoadOptions {
            survey,
            assignments: self.set.clone(),
            settings: self.settings(),
            curves: self.curves.clone(),
            frame: self.frame,
            frames: self.frames.clone(),
        };
        let _working = Working::on(format!("loading {}", path.display()), quiet);
        load(path, &options)
    }
}

/// The command as it was given, for metadata; what is not UTF-8 in it is replaced.
fn command_line() -> String {
    std::env::args_os().map(|arg| arg.to_string_lossy().into_owned()).collect::<Vec<_>>().join(" ")
}

/// Writes text to a file that appears whole or not at all.
fn write_text(path: &std::path::Path, text: &str) -> Result<(), Failure> {
    use std::io::Write as _;
    Ok(whole_file::write(path, |file| file.write_all(text.as_bytes()))?)
}

/// Where the yarns of a fabric fold into themselves, for people: `yarns` are all that it has.
fn folds_in_words(scene: &Scene, fabric: &Fabric, folds: &Folds, yarns: usize) -> String {
    let Folds { worst, places, .. } = folds;
    let at = folds.at + scene.middle;
    format!(
        "{}: {} of {yarns} yarns bend so tightly at {} (one in {:.0} diameters of yarn) that they fold into themselves and \
         their plies break; the worst is yarn {} at segment {}{} ([{:.1}, {:.1}, {:.1}] mm), whose inner side runs backwards by {:.1} of its radius{}",
        fabric.origin,
        folds.yarns,
        counted(*places, "place"),
        folds.length / (*places).max(1) as f64,
        worst.yarn,
        worst.segment,
        fabric.panel_of(worst.yarn).map_or(String::new(), |name| format!(" of panel `{name}`")),
        at.x,
        at.y,
        at.z,
        worst.fold,
        match fabric.from_file && 2 * folds.yarns > yarns {
            true => "; is the radius or the unit of the file another one? `yarnray info` of it proposes both",
            false => "",
        }
    )
}

/// What was measured of yarns that run into each other, for people: `by` says by which diameter, `tufts` whether strands of tufts lie
/// beside them, which were not.
fn overlap_in_words(o: &Overlap, by: &str, tufts: bool) -> String {
    let without = if tufts { "; strands of tufts not counted" } else { "" };
    if o.nearest.is_infinite() {
        return format!("no yarn comes near another{without}");
    }
    format!(
        "{:.2} % of their length overlaps by more than {:.0} % of the diameter; strands come within {:.3} diameters (they touch at 1), {by}{without}",
        100.0 * o.share,
        100.0 * overlap::TOLERATED,
        o.nearest
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        take_negative_numbers(Cli::command()).debug_assert();
    }
}
