//! `yarnray stress`

use std::{path::PathBuf, time::Instant};

use clap::Args;

use super::{
    Failure,
    files::{Attempts, Files},
    terminal::print,
    write_text,
};
use crate::{
    experiment::stress::{self, Bound, Outcome, Scale, figure},
    files::has_extension,
    input::diagnostic::unknown_name,
};

const EXAMPLES: &str = "Examples:
  yarnray stress                              every case, in minutes
  yarnray stress --quick                      every case, smaller, in three minutes
  yarnray stress --case radii --case twist    some of them
  yarnray stress -o stress.md -o stress.json  the report in two formats";

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct StressArgs {
    /// Smaller cases: three minutes in place of many.
    #[arg(long)]
    quick: bool,
    /// Only this case (repeatable).
    #[arg(long, value_name = "NAME")]
    case: Vec<String>,
    /// List the cases and run none.
    #[arg(long)]
    list: bool,
    /// Where to write the report: .md or .json. Repeatable.
    #[arg(short, long = "out", value_name = "PATH")]
    out: Vec<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// No line for each case.
    #[arg(long, short)]
    quiet: bool,
}

pub(super) fn run(args: &StressArgs) -> Result<(), Failure> {
    let all = stress::cases();
    if args.list {
        let lines = all.iter().map(|case| format!("{:12}{:26}{}\n", case.group.name(), case.name, case.about));
        return print(&lines.collect::<String>());
    }
    for name in &args.case {
        if !all.iter().any(|c| c.name == name) {
            let (message, hint) = unknown_name("case", name, all.iter().map(|c| c.name));
            return Err(Failure::hinted(message, hint));
        }
    }
    for path in &args.out {
        if !has_extension(path, "md") && !has_extension(path, "json") {
            return Err(Failure::Input(format!("error: {}: expected the extension .md or .json", path.display())));
        }
    }
    Files::default().writes("-o", &args.out).check(args.quiet)?;
    let scale = if args.quick { Scale::Quick } else { Scale::Full };
    let started = Instant::now();
    let mut outcomes = Vec::new();
    // A case that dies is reported like any other; the panic's own message would only repeat it.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    for case in all.iter().filter(|c| args.case.is_empty() || args.case.iter().any(|n| n == c.name)) {
        let outcome = stress::run(case, scale);
        if !args.quiet && !args.json {
            print(&in_words(&outcome))?;
        }
        outcomes.push(outcome);
    }
    std::panic::set_hook(hook);
    let elapsed = started.elapsed();
    let json = stress::to_json(&outcomes, scale, elapsed);
    let text = serde_json::to_string_pretty(&json).expect("numbers and text become JSON") + "\n";
    let mut attempts = Attempts::default();
    for path in &args.out {
        let markdown = has_extension(path, "md");
        let content = if markdown { stress::to_markdown(&outcomes, scale, elapsed) } else { text.clone() };
        attempts.note(write_text(path, &content));
    }
    let failed = outcomes.iter().filter(|o| !o.passed()).count();
    let sum = format!("{} cases in {:.1} s, {failed} failed", outcomes.len(), elapsed.as_secs_f64());
    if args.json {
        print(&text)?;
    } else {
        print(&format!("{sum}\n"))?;
    }
    attempts.finish()?;
    if failed > 0 { Err(Failure::Check(format!("error: {failed} cases of {} failed", outcomes.len()))) } else { Ok(()) }
}

/// One line for a case, and one for each check that failed.
fn in_words(outcome: &Outcome) -> String {
    let verdict = if outcome.passed() { "pass" } else { "FAIL" };
    let mut out = format!("{verdict}  {:26}{:7.2} s\n", outcome.case.name, outcome.elapsed.as_secs_f64());
    if let Some(panic) = &outcome.panic {
        out += &format!("      died: {panic}\n");
    }
    for check in outcome.checks.iter().filter(|c| !c.passed()) {
        let bound = match check.bound {
            Bound::AtMost(b) => format!("at most {}", figure(b)),
            Bound::AtLeast(b) => format!("at least {}", figure(b)),
        };
        out += &format!("      {}: {}, not {bound}, at {}\n", check.what, figure(check.worst), check.place);
    }
    out
}
