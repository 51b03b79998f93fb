//! `yarnray converge`

use std::path::PathBuf;

use clap::Args;

use super::{
    Failure, SceneArgs,
    files::{Attempts, Files},
    log,
    signals::interrupt_flag,
    terminal::print,
    thread_pool, write_text,
};
use crate::{
    experiment::{
        converge::{self, Options},
        method::Method,
    },
    scene::Mode,
};

const EXAMPLES: &str = "Examples:
  yarnray converge scenes/swatch.toml --method yarn:aggregated --method yarn:two-stream --reference none
                                        noise of two models against time, in out/converge/
  yarnray converge scenes/swatch.toml --width 192 --height 144 --spp 255
                                        explicit fibres and the aggregated model, both against explicit fibres
  yarnray converge scenes/swatch.toml --target 0.01 --seeds 8 -o out/study

Writes converge.csv, converge.json and converge.svg. Every method is rendered with several seeds; each time the samples have doubled, the
relMSE (square error / (square of the truth + 0.01)) is taken against the method's own converged picture (noise) and against that of the
reference (noise and model error), both of independent seeds and without their own noise. Converged pictures are kept in the folder
`cache` beside the output.";

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct ConvergeArgs {
    /// The scene file.
    scene: PathBuf,
    /// Mode, or mode:model, of a curve (repeatable). Default: the reference, and yarn with the scene's model.
    #[arg(long = "method", value_name = "MODE[:MODEL]", value_parser = Method::parse)]
    methods: Vec<Method>,
    /// Mode, or mode:model, whose converged picture counts as true; `none` measures noise only.
    #[arg(long, value_name = "MODE[:MODEL]|none", default_value = "fiber")]
    reference: String,
    /// Renders behind every point, each with its own seed.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(2..=1000))]
    seeds: u32,
    /// Samples per pixel of each half of a converged picture. Default: twice --spp
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..))]
    converged_spp: Option<u32>,
    /// Error for which times are told.
    #[arg(long, value_name = "RELMSE", default_value_t = 0.01)]
    target: f64,
    /// The directory to write to.
    #[arg(short, long, value_name = "DIRECTORY", default_value = "out/converge")]
    out: PathBuf,
    /// Where converged pictures are kept. Default: the directory `cache` beside the output
    #[arg(long, value_name = "DIRECTORY")]
    cache: Option<PathBuf>,
    /// Say nothing of the progress.
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    options: SceneArgs,
}

pub(super) fn run(args: &ConvergeArgs) -> Result<(), Failure> {
    if !(args.target.is_finite() && args.target > 0.0) {
        return Err(Failure::Input(format!("error: --target must be above 0, found {}", args.target)));
    }
    let ignored = [
        ("--mode", args.options.mode.is_some(), "--method MODE[:MODEL]"),
        ("--noise", args.options.noise.is_some(), "--target says to which error times are told"),
    ];
    if let Some((option, _, hint)) = ignored.into_iter().find(|(_, given, _)| *given) {
        return Err(Failure::hinted(
            format!("{option}: `converge` measures methods at rising numbers of samples"),
            hint,
        ));
    }
    let reference = match args.reference.as_str() {
        "none" => None,
        text => Some(Method::parse(text).map_err(|e| Failure::Input(format!("error: --reference {text}: {e}")))?),
    };
    let files = ["converge.csv", "converge.json", "converge.svg"].map(|name| args.out.join(name));
    let cache = args.cache.clone().unwrap_or_else(|| args.out.parent().unwrap_or(&args.out).join("cache"));
    let load = |method: Method| {
        let mut options = args.options.clone();
        options.mode = Some(method.mode.name().to_owned());
        if let Some(model) = method.model {
            options.model = Some(model.name().to_owned());
        }
        options.load(&args.scene, true).map_err(|error| error.to_string())
    };
    let outputs = Files::default().reads("SCENE", [&args.scene]).writes("-o", &files);
    outputs.refuse()?;
    let plain = args.options.load(&args.scene, args.quiet)?;
    outputs.check(args.quiet)?;
    let methods = if args.methods.is_empty() {
        let yarn = Method { mode: Mode::Yarn, model: Some(plain.render.model) };
        // The reference may be just that, by its mode alone.
        let is_yarn = |method: &Method| Method { model: method.model.or(yarn.model), ..*method } == yarn;
        reference.into_iter().chain(Some(yarn).filter(|_| !reference.as_ref().is_some_and(is_yarn))).collect()
    } else {
        args.methods.clone()
    };
    let (pool, threads) = thread_pool(plain.render.threads)?;
    let options = Options {
        methods,
        reference,
        seeds: args.seeds,
        spp: plain.render.spp,
        seconds: plain.render.time,
        converged_spp: args.converged_spp.unwrap_or_else(|| plain.render.spp.saturating_mul(2)),
        target: args.target,
        threads,
    };
    let interrupt = interrupt_flag();
    let say = |text: &str| {
        if !args.quiet {
            log::say(text);
        }
    };
    let result = pool.install(|| converge::run(load, &options, &cache, &interrupt, say))?;
    let mut attempts = Attempts::default();
    let json = serde_json::to_string_pretty(&result.to_json()).expect("numbers and text become JSON") + "\n";
    for (file, text) in files.iter().zip([result.to_csv(), json, result.to_svg()]) {
        attempts.note(write_text(file, &text));
    }
    print(&result.to_text())?;
    attempts.finish()
}
