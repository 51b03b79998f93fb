//! `yarnray bench`

use std::path::{Path, PathBuf};

use clap::Args;

use super::{
    Failure,
    files::{Attempts, Files},
    log,
    signals::interrupt_flag,
    terminal::print,
    thread_pool, write_text,
};
use crate::{
    experiment::{
        LOBES, converge,
        converged::{Converged, key},
        fidelity,
        suite::{ConvergePlan, Measure, Suite},
        table3::{self, BenchError, Processes},
    },
    math::words::counted,
    report::{
        fidelity::Table as FidelityTable,
        page::Picture,
        table3::{
            Missing, Row, Table,
            html::{Plot, RowPictures, page},
        },
    },
    scene::load,
};

const EXAMPLES: &str = "Examples:
  yarnray bench scenes/table3.toml               the whole table, in out/table3/: up to 40 minutes on 2 cores
  yarnray bench scenes/table3.toml --quick       smaller pictures, a looser target, fewer rows: minutes
  yarnray bench scenes/table3.toml --row silk    only rows whose name contains this
  yarnray bench scenes/fidelity.toml             how far pictures are from those of explicit fibres, on many fabrics

Writes table.md, table.csv and table.json, anew after every row, and, unless the suite is of measure \"fidelity\", report.html (a page that
needs nothing else). Begun again, it goes on after the last row that was finished; converged pictures are kept in the directory `cache`
within. Each render is a process of its own.";

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct BenchArgs {
    /// The suite file.
    suite: PathBuf,
    /// Measure what the suite's table `[quick]` says.
    #[arg(long)]
    quick: bool,
    /// Only rows whose name contains this (repeatable).
    #[arg(long, value_name = "TEXT")]
    row: Vec<String>,
    /// The directory to write to. Default: out/SUITE
    #[arg(short, long, value_name = "DIRECTORY")]
    out: Option<PathBuf>,
    /// Threads of each render; all cores if not given.
    #[arg(long, short = 'j', value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    threads: Option<u32>,
    /// Say nothing of the progress.
    #[arg(long, short)]
    quiet: bool,
}

pub(super) fn run(args: &BenchArgs) -> Result<(), Failure> {
    let mut suite = Suite::load(&args.suite, args.quick)?;
    if !args.row.is_empty() {
        let wanted = |name: &str| args.row.iter().any(|text| name.contains(text.as_str()));
        suite.cases.retain(|case| wanted(&case.name));
        suite.missing.retain(|(name, _)| wanted(name));
        if suite.cases.is_empty() && suite.missing.is_empty() {
            return Err(Failure::Input(format!("error: no row of {} contains {}", suite.path, args.row.join(" or "))));
        }
    }
    let stem = args.suite.file_stem().map_or("suite".into(), |stem| stem.to_string_lossy().into_owned());
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from("out").join(stem));
    let page = (suite.measure != Measure::Fidelity).then_some("report.html");
    let names = ["table.md", "table.csv", "table.json", "rows/x", "cache/x"].into_iter().chain(page);
    let written: Vec<PathBuf> = names.map(|name| out.join(name)).collect();
    Files::default().reads("SUITE", [&args.suite]).writes("-o", &written).check(args.quiet)?;
    let threads = args.threads.map(|threads| threads as usize);
    let interrupt = interrupt_flag();
    let say = |text: &str| {
        if !args.quiet {
            log::say(text);
        }
    };
    let mut processes = Processes { threads, scratch: &out, interrupt: &interrupt };
    if suite.measure == Measure::Fidelity {
        return run_fidelity(&suite, &mut processes, &out, say);
    }
    let saved = |table: &Table| write(&out, table, &[]).map_err(as_bench_error);
    let table = table3::run(&suite, &mut processes, &out, threads, say, saved)?;
    let mut plots = Vec::new();
    for name in suite.converge.iter().flat_map(|plan| &plan.cases) {
        if let Some(plan) = &suite.converge
            && suite.case(name).is_some()
        {
            plots.push(plot(&suite, plan, name, &out, threads, &interrupt, say)?);
        }
    }
    write(&out, &table, &plots)?;
    if !args.quiet {
        log::say(&format!("wrote {}", out.join("report.html").display()));
    }
    print(&table.to_markdown())?;
    not_measured(&suite, &table.missing)
}

/// Measures how far pictures are from the reference's, and writes the table.
fn run_fidelity(
    suite: &Suite,
    processes: &mut Processes<'_>,
    out: &Path,
    say: impl FnMut(&str),
) -> Result<(), Failure> {
    let write = |table: &FidelityTable| {
        let texts = [("table.md", table.to_markdown()), ("table.csv", table.to_csv()), ("table.json", table.to_json())];
        write_all(out, texts)
    };
    let saved = |table: &FidelityTable| write(table).map_err(as_bench_error);
    let table = fidelity::run(suite, processes, out, say, saved)?;
    write(&table)?;
    print(&table.to_markdown())?;
    not_measured(suite, &table.missing)
}

/// An error if a row is missing that the suite did not already know to be.
fn not_measured(suite: &Suite, missing: &[Missing]) -> Result<(), Failure> {
    let failed: Vec<String> = missing
        .iter()
        .filter(|missing| !suite.missing.iter().any(|(name, _)| *name == missing.name))
        .map(|missing| format!("{} was not measured: {}", missing.name, missing.reason))
        .collect();
    if failed.is_empty() { Ok(()) } else { Err(Failure::Check(failed.join("\n"))) }
}

fn as_bench_error(failure: Failure) -> BenchError {
    match failure {
        Failure::Input(message) | Failure::Check(message) => BenchError::Suite(message),
        Failure::Interrupted | Failure::Closed => BenchError::Interrupted,
    }
}

/// Writes the table in all its forms, and the page.
fn write(out: &Path, table: &Table, plots: &[Plot]) -> Result<(), Failure> {
    let pictures: Vec<Option<RowPictures>> = table.rows.iter().map(|row| pictures(out, row)).collect();
    let page = page(table, &pictures, plots);
    let texts = [table.to_markdown(), table.to_csv(), table.to_json(), page];
    write_all(out, ["table.md", "table.csv", "table.json", "report.html"].into_iter().zip(texts))
}

/// Writes every file that can be written.
fn write_all(out: &Path, files: impl IntoIterator<Item = (&'static str, String)>) -> Result<(), Failure> {
    let mut attempts = Attempts::default();
    for (name, text) in files {
        attempts.note(write_text(&out.join(name), &text));
    }
    attempts.finish()
}

/// The pictures of a row; `None` if a file is gone.
fn pictures(out: &Path, row: &Row) -> Option<RowPictures> {
    let load = |name: &str| Converged::load(&out.join(name));
    let mean = |picture: &Converged| Picture { width: picture.halves.width, colors: picture.halves.mean() };
    let [reference, aggregated] = [load(&row.pictures[0])?, load(&row.pictures[1])?];
    let width = aggregated.halves.width;
    let lobes = aggregated.lobes.iter().flatten().zip(LOBES);
    Some(RowPictures {
        reference: mean(&reference),
        aggregated: mean(&aggregated),
        lobes: lobes.map(|(colors, name)| (name, Picture { width, colors: colors.clone() })).collect(),
        others: row.others.iter().map(|other| load(&other.picture).as_ref().map(mean)).collect::<Option<_>>()?,
    })
}

/// Error against time of one case; kept beside the rows.
fn plot(
    suite: &Suite,
    plan: &ConvergePlan,
    name: &str,
    out: &Path,
    threads: Option<usize>,
    interrupt: &std::sync::atomic::AtomicBool,
    say: impl Fn(&str) + Sync,
) -> Result<Plot, Failure> {
    let case = suite.case(name).ok_or_else(|| Failure::Input(format!("error: no row is called {name}")))?;
    let load = |method| load::load(&case.scene, &case.options(suite, method, &[])).map_err(|error| error.to_string());
    let fingerprint = load(suite.tested).map_err(Failure::Input)?.fingerprint;
    let settings = format!("{plan:?} {} {} {} {threads:?}", suite.reference, suite.tested, suite.target);
    let stem = out.join("rows").join(format!("converge-{}", key(&[&fingerprint, &settings])));
    let [svg_file, text_file] = ["svg", "txt"].map(|extension| stem.with_extension(extension));
    let kept = std::fs::read_to_string(&svg_file).ok().zip(std::fs::read_to_string(&text_file).ok());
    if let Some((svg, text)) = kept {
        return Ok(Plot { caption: text, svg });
    }
    say(&format!("{name}: error against time, {}", counted(plan.seeds, "seed")));
    let (pool, threads) = thread_pool(threads)?;
    let options = converge::Options {
        methods: vec![suite.reference, suite.tested],
        reference: Some(suite.reference),
        seeds: plan.seeds,
        spp: plan.spp,
        seconds: Some(plan.seconds),
        converged_spp: plan.converged_spp,
        target: suite.target,
        threads,
    };
    let result = pool.install(|| converge::run(load, &options, &out.join("cache"), interrupt, &say))?;
    let text = format!(
        "{name}. Solid: noise, against the method's own converged picture; dashed: noise and model error, against explicit fibres. Bars: 95 % \
         over {} seeds. {}",
        plan.seeds,
        result.to_text().trim_end().replace('\n', "; ")
    );
    write_text(&svg_file, &result.to_svg())?;
    write_text(&text_file, &text)?;
    Ok(Plot { caption: text, svg: result.to_svg() })
}
