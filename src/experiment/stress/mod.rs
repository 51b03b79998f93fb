//! Stiff and extreme cases: what the parts do where numbers are very small, very large, or meet exactly.
//!
//! A [`Case`] runs its checks and reports for each the worst figure it found, where it found it, and the bound that the
//! figure has to keep. Cases draw all their random numbers from fixed keys: the same figures on every run.

mod closed_forms;
mod digits;
mod fibers;
mod geometry;
mod transport;
mod yarns;

use std::{
    fmt::Write as _,
    panic::{AssertUnwindSafe, catch_unwind},
    time::{Duration, Instant},
};

use serde_json::{Value, json};

/// By how much scattered light may exceed what came in.
const ENERGY_ABOVE: f64 = 1e-4;
/// What white yarns send on at least, of a single ray too: light leaves them at last, wherever it went.
const WHITE_ENERGY: f64 = 0.99;

/// Which part of the renderer a case is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Group {
    /// Lobes, models, closed forms.
    Scattering,
    /// Curves and rays.
    Geometry,
    /// Whole pictures.
    Transport,
}

impl Group {
    /// Its name in files and on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Scattering => "scattering",
            Self::Geometry => "geometry",
            Self::Transport => "transport",
        }
    }
}

/// How much is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scale {
    /// Every case, smaller: seconds.
    Quick,
    /// Minutes.
    Full,
}

impl Scale {
    /// One of two sizes.
    fn pick<T>(self, quick: T, full: T) -> T {
        if self == Self::Quick { quick } else { full }
    }
}

/// One extreme.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Case {
    /// Which part.
    pub group: Group,
    /// Stable name.
    pub name: &'static str,
    /// What is extreme, in words.
    pub about: &'static str,
    run: fn(Scale, &mut Checks),
}

/// What a figure has to keep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Bound {
    /// Not above.
    AtMost(f64),
    /// Not below.
    AtLeast(f64),
}

impl Bound {
    fn keeps(self, value: f64) -> bool {
        match self {
            Self::AtMost(most) => value <= most,
            Self::AtLeast(least) => value >= least,
        }
    }

    /// Whether `a` is worse than `b`; a NaN is worse than everything.
    fn worse(self, a: f64, b: f64) -> bool {
        match self {
            _ if b.is_nan() => false,
            _ if a.is_nan() => true,
            Self::AtMost(_) => a > b,
            Self::AtLeast(_) => a < b,
        }
    }
}

/// One thing that was checked, with the worst that was found.
#[derive(Clone, Debug)]
pub(crate) struct Check {
    /// What the figure is.
    pub what: &'static str,
    /// The worst figure.
    pub worst: f64,
    /// What it has to keep.
    pub bound: Bound,
    /// Where it was found.
    pub place: String,
    /// How many figures were looked at.
    pub count: u64,
}

impl Check {
    /// Whether the worst figure keeps the bound.
    pub(crate) fn passed(&self) -> bool {
        self.bound.keeps(self.worst)
    }
}

/// What a case collects.
#[derive(Debug, Default)]
pub(crate) struct Checks(Vec<Check>);

impl Checks {
    fn note(&mut self, what: &'static str, value: f64, bound: Bound, place: &dyn Fn() -> String) {
        if let Some(check) = self.0.iter_mut().find(|c| c.what == what) {
            check.count += 1;
            if bound.worse(value, check.worst) {
                check.worst = value;
                check.place = place();
            }
        } else {
            self.0.push(Check { what, worst: value, bound, place: place(), count: 1 });
        }
    }

    /// A figure that must not be above `bound`.
    fn at_most(&mut self, what: &'static str, value: f64, bound: f64, place: &dyn Fn() -> String) {
        self.note(what, value, Bound::AtMost(bound), place);
    }

    /// A figure that must not be below `bound`.
    fn at_least(&mut self, what: &'static str, value: f64, bound: f64, place: &dyn Fn() -> String) {
        self.note(what, value, Bound::AtLeast(bound), place);
    }

    /// A thing that must not happen: counted, and none is allowed.
    fn never(&mut self, what: &'static str, happened: bool, place: &dyn Fn() -> String) {
        if let Some(check) = self.0.iter_mut().find(|c| c.what == what) {
            check.count += 1;
            if happened {
                if check.worst == 0.0 {
                    check.place = place();
                }
                check.worst += 1.0;
            }
        } else {
            let place = if happened { place() } else { String::new() };
            self.0.push(Check {
                what,
                worst: f64::from(u8::from(happened)),
                bound: Bound::AtMost(0.0),
                place,
                count: 1,
            });
        }
    }
}

/// What became of a case.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    /// The case.
    pub case: Case,
    /// All it checked.
    pub checks: Vec<Check>,
    /// How long it took.
    pub elapsed: Duration,
    /// What it died of, if it did.
    pub panic: Option<String>,
}

impl Outcome {
    /// Whether every check passed.
    pub(crate) fn passed(&self) -> bool {
        self.panic.is_none() && !self.checks.is_empty() && self.checks.iter().all(Check::passed)
    }
}

/// All cases, in the order of the report.
pub(crate) fn cases() -> Vec<Case> {
    [closed_forms::CASES, fibers::CASES, yarns::CASES, geometry::CASES, transport::CASES].concat()
}

/// Runs one case. A panic is caught and counts as a failure.
pub(crate) fn run(case: &Case, scale: Scale) -> Outcome {
    let started = Instant::now();
    let mut checks = Checks::default();
    let died = catch_unwind(AssertUnwindSafe(|| (case.run)(scale, &mut checks))).err().map(|payload| {
        let text = payload.downcast_ref::<String>().map(String::as_str);
        text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("a panic without words").to_owned()
    });
    Outcome { case: *case, checks: checks.0, elapsed: started.elapsed(), panic: died }
}

/// Some digits of a figure; whole numbers as they are.
pub(crate) fn figure(v: f64) -> String {
    if v == 0.0 || (v.fract() == 0.0 && v.abs() < 1e6) {
        format!("{v}")
    } else if (1e-3..1e4).contains(&v.abs()) {
        format!("{v:.4}")
    } else {
        format!("{v:.2e}")
    }
}

/// The report for programs.
pub(crate) fn to_json(outcomes: &[Outcome], scale: Scale, elapsed: Duration) -> Value {
    let check = |c: &Check| {
        let (relation, bound) = match c.bound {
            Bound::AtMost(b) => ("at most", b),
            Bound::AtLeast(b) => ("at least", b),
        };
        // JSON has no infinity and no NaN.
        let worst = if c.worst.is_finite() { json!(c.worst) } else { json!(c.worst.to_string()) };
        json!({
            "what": c.what, "worst": worst, "relation": relation, "bound": bound, "at": c.place,
            "count": c.count, "passed": c.passed(),
        })
    };
    let cases: Vec<Value> = outcomes
        .iter()
        .map(|o| {
            json!({
                "group": o.case.group.name(), "name": o.case.name, "about": o.case.about, "passed": o.passed(),
                "seconds": o.elapsed.as_secs_f64(), "panic": o.panic,
                "checks": o.checks.iter().map(check).collect::<Vec<_>>(),
            })
        })
        .collect();
    json!({
        "yarnray": env!("CARGO_PKG_VERSION"), "commit": env!("YARNRAY_COMMIT"),
        "scale": if scale == Scale::Full { "full" } else { "quick" },
        "passed": outcomes.iter().all(Outcome::passed),
        "seconds": elapsed.as_secs_f64(),
        "cases": cases,
    })
}

/// The report as a Markdown table.
pub(crate) fn to_markdown(outcomes: &[Outcome], scale: Scale, elapsed: Duration) -> String {
    let failed = outcomes.iter().filter(|o| !o.passed()).count();
    let checks: usize = outcomes.iter().map(|o| o.checks.len()).sum();
    let mut out = format!(
        "# Stress report\n\nyarnray {} ({}), `yarnray stress{}`: {} cases, {checks} checks, {failed} cases failed, {:.1} s.\n\n\
         For each check the worst figure found, the bound it has to keep, and where it was found. \"count\" is how many \
         figures were looked at.\n",
        env!("CARGO_PKG_VERSION"),
        env!("YARNRAY_COMMIT"),
        if scale == Scale::Quick { " --quick" } else { "" },
        outcomes.len(),
        elapsed.as_secs_f64()
    );
    let mut group = None;
    for o in outcomes {
        if group != Some(o.case.group) {
            group = Some(o.case.group);
            let name = o.case.group.name();
            let _ = write!(
                out,
                "\n## {}{}\n\n| case | check | worst | bound | count | at | result |\n| --- | --- | ---: | ---: | ---: | --- | --- |\n",
                name[..1].to_uppercase(),
                &name[1..]
            );
        }
        let title = format!("**{}**: {} ({:.2} s)", o.case.name, o.case.about, o.elapsed.as_secs_f64());
        if let Some(panic) = &o.panic {
            let _ = writeln!(out, "| {title} | died: {} | | | | | **fail** |", panic.replace(['|', '\n'], " "));
        }
        for (i, c) in o.checks.iter().enumerate() {
            let bound = match c.bound {
                Bound::AtMost(b) => format!("<= {}", figure(b)),
                Bound::AtLeast(b) => format!(">= {}", figure(b)),
            };
            let _ = writeln!(
                out,
                "| {} | {} | {} | {bound} | {} | {} | {} |",
                if i == 0 { title.as_str() } else { "" },
                c.what,
                figure(c.worst),
                c.count,
                c.place.replace('|', "/"),
                if c.passed() { "pass" } else { "**fail**" }
            );
        }
    }
    out
}

#[cfg(test)]
mod tests;
