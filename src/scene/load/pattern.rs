//! `source = { type = "knit" }`: knitted cloth that the program makes.

use glam::DVec2;

use super::{Context, Range, Reader, chart_picture, cloth::Yarns, color::FabricCoordinates};
use crate::{
    geometry::{
        curve::Curve,
        pattern::{
            MAX_POINTS,
            chart::{Chart, PATTERNS},
            knit::{self, Edges, Form, Knit},
            knitspeak,
        },
    },
    input::{
        diagnostic::{Span, unknown_name},
        document::Value,
    },
};

/// Stitches of a knit that says no number.
const STITCHES: u64 = 20;

/// A knit that is checked but for what only knitting tells.
pub(super) struct KnitPlan {
    knit: Knit,
    name: String,
    /// Where the chart's rows were written, for what is wrong with them.
    lines: Vec<Span>,
    header: Span,
}

impl KnitPlan {
    /// What it is, with its gauge as knitters give it: stitches and rows in 10 cm.
    fn origin(&self, gauge: [f64; 2]) -> String {
        let [across, up] = gauge.map(|mm| 100.0 / mm);
        format!("{}, {} x {}, gauge {across:.1} x {up:.1} in 10 cm", self.name, self.knit.stitches, self.knit.rows)
    }

    /// The yarns with their places; what is wrong with the chart is told.
    pub(super) fn curves(
        &self,
        diameter: f64,
        context: &Context<'_>,
    ) -> Option<(Vec<Curve>, FabricCoordinates, String)> {
        match self.knit.knitted(diameter) {
            Ok(made) => {
                let (curves, coordinates) = FabricCoordinates::of(made.strands, [self.knit.stitches, self.knit.rows]);
                Some((curves, coordinates, self.origin(made.gauge)))
            }
            Err(error) => {
                let span = error.line.and_then(|l| self.lines.get(l)).unwrap_or(&self.header);
                context.error(*span, error.problem, Some(error.hint));
                None
            }
        }
    }
}

/// `pattern`, `chart` or `instructions`: its name, the chart, and where its rows were written.
pub(super) fn chart(table: &Reader<'_>, context: &Context<'_>) -> (String, Option<Chart>, Vec<Span>) {
    if let Some(text) = table.string("instructions") {
        return ("knit".to_owned(), written(table, text), Vec::new());
    }
    if let Some(Value::Table(_)) = table.node("chart").map(|node| &node.value)
        && let Some(picture) = table.table("chart")
    {
        if table.has("pattern") {
            table.error_at(
                "chart",
                "both `pattern` and `chart` are given",
                Some("a chart is a pattern of its own: keep one"),
            );
        }
        return ("knit".to_owned(), drawn(table, picture, context), Vec::new());
    }
    let chart_rows = table.strings("chart");
    if table.has("chart") && chart_rows.is_empty() {
        // A value of another type is told already.
        if table.node("chart").is_some_and(|node| matches!(&node.value, Value::Array(rows) if rows.is_empty())) {
            table.error_at("chart", "a chart without rows", Some("chart = [\"12: k2 p2\", \"3: k\"]"));
        }
    }
    let pattern = table.string("pattern");
    if pattern.is_some() && !chart_rows.is_empty() {
        table.error_at(
            "chart",
            "both `pattern` and `chart` are given",
            Some("a chart is a pattern of its own: keep one"),
        );
    }
    let (name, chart) = if chart_rows.is_empty() {
        let name = pattern.unwrap_or("stockinette");
        let chart = Chart::named(name);
        if chart.is_none() {
            let (message, hint) = unknown_name("pattern", name, PATTERNS.iter().map(|(n, _)| *n));
            table.error_at("pattern", message, Some(&hint));
        }
        (name, chart)
    } else {
        let rows: Vec<&str> = chart_rows.iter().map(|(text, _)| *text).collect();
        match Chart::parse(&rows) {
            Ok(chart) => ("knit", Some(chart)),
            Err(error) => {
                let span = error.line.map_or(table.header(), |l| chart_rows[l].1);
                context.error(span, error.problem, Some(error.hint));
                ("knit", None)
            }
        }
    };
    (name.to_owned(), chart, chart_rows.iter().map(|(_, span)| *span).collect())
}

/// A chart that is a picture.
fn drawn(table: &Reader<'_>, picture: Reader<'_>, context: &Context<'_>) -> Option<Chart> {
    let rows = chart_picture::rows(picture, context)?;
    match Chart::parse(&rows) {
        Ok(chart) => Some(chart),
        Err(error) => {
            let row = error.line.map_or(String::new(), |line| format!("row {} of the picture: ", line + 1));
            table.error_at("chart", format!("{row}{}", error.problem), Some(&error.hint));
            None
        }
    }
}

/// Written instructions over so many `stitches`, as a chart.
fn written(table: &Reader<'_>, text: &str) -> Option<Chart> {
    if let Some(other) = ["pattern", "chart"].into_iter().find(|key| table.has(key)) {
        table.error_at(other, format!("both `{other}` and `instructions` are given"), Some("keep one of them"));
    }
    let stitches = table.u64_or("stitches", STITCHES, 1..=1_000_000) as u32;
    let rows = match knitspeak::chart_rows(text, stitches) {
        Ok(rows) => rows,
        Err(error) => {
            let line = error.line.map_or(String::new(), |line| format!("line {}: ", line + 1));
            table.error_at("instructions", format!("{line}{}", error.problem), Some(&error.hint));
            return None;
        }
    };
    match Chart::parse(&rows) {
        Ok(chart) => Some(chart),
        Err(error) => {
            table.error_at("instructions", error.problem, Some(&error.hint));
            None
        }
    }
}

/// Reads the keys of a knit.
pub(super) fn knit(table: &Reader<'_>, context: &Context<'_>, yarns: &Yarns<'_>) -> Option<KnitPlan> {
    let (name, chart, lines) = chart(table, context);
    let profile = table.pairs("profile", Range::FINITE);
    let forms = [("flat", 0), ("tube", 1), ("revolution", 2)];
    let form = match table.one_of_or("form", if profile.is_some() { 2 } else { 0 }, &forms) {
        0 => Some(Form::Flat),
        1 => Some(Form::Tube),
        _ => revolution(table, context, profile.as_deref(), yarns.radius()),
    };
    if let (Some(Form::Flat | Form::Tube), true) = (&form, profile.is_some()) {
        table.error_at("profile", "a profile is of a surface of revolution", Some("form = \"revolution\""));
    }
    let rows = if lines_are_all(&form, &lines) { chart.as_ref().map_or(20, Chart::rows) } else { 20 };
    counted(table, chart, form, &name, rows, lines)
}

/// Shaped pieces are knitted once, from the first row of the chart to the last.
fn lines_are_all(form: &Option<Form>, lines: &[Span]) -> bool {
    matches!(form, Some(Form::Revolution(_))) && !lines.is_empty()
}

/// `type = "stockinette"`: a flat knit of that pattern.
pub(super) fn stockinette(table: &Reader<'_>) -> Option<KnitPlan> {
    counted(table, Chart::named("stockinette"), Some(Form::Flat), "stockinette", 20, Vec::new())
}

fn counted(
    table: &Reader<'_>,
    chart: Option<Chart>,
    form: Option<Form>,
    name: &str,
    rows: u32,
    lines: Vec<Span>,
) -> Option<KnitPlan> {
    let stitches = table.u64_or("stitches", STITCHES, 1..=1_000_000) as u32;
    let rows = table.u64_or("rows", rows.into(), 1..=1_000_000) as u32;
    let stitch_width = table.f64("stitch_width", Range::between(1.0, 20.0));
    let row_height = table.f64("row_height", Range::between(0.5, 20.0));
    let yarn_per_stitch = table.f64("yarn_per_stitch", Range::between(6.0, 60.0));
    let edges = table.one_of_or("edges", Edges::Finished, &[("finished", Edges::Finished), ("live", Edges::Live)]);
    let points = table.u64_or("points", knit::POINTS.into(), 12..=200) as u32;
    let (chart, form) = (chart?, form?);
    let knit = Knit { chart, stitches, rows, form, edges, stitch_width, row_height, yarn_per_stitch, points };
    if knit.control_points() > MAX_POINTS {
        table.error_at("stitches", "more than 2^27 control points", Some("fewer stitches, rows or points"));
    }
    if knit.form != Form::Flat && knit.stitches < 3 {
        table.error_at("stitches", "knitting in the round takes at least 3 stitches", None);
        return None;
    }
    Some(KnitPlan { knit, name: name.to_owned(), lines, header: table.header() })
}

/// The profile in millimetres, if it is one.
fn revolution(table: &Reader<'_>, context: &Context<'_>, profile: Option<&[[f64; 2]]>, radius: f64) -> Option<Form> {
    const HINT: &str =
        "profile = [[90, 0], [90, 60], [70, 110], [10, 130]]: radius and height from the cast-on edge on";
    let Some(profile) = profile else {
        if !table.has("profile") {
            table.error("a surface of revolution needs a `profile`", Some(HINT));
        }
        return None;
    };
    let profile: Vec<DVec2> = profile.iter().map(|p| DVec2::from(*p) * context.unit).collect();
    if !(2..=10_000).contains(&profile.len()) {
        table.error_at("profile", "a profile has 2 to 10000 points", Some(HINT));
    } else if profile.iter().any(|p| p.x < 0.0) {
        table.error_at("profile", "the radius of a profile must be at least 0", Some(HINT));
    } else if profile.windows(2).any(|w| w[0].distance(w[1]) < 1e-3 * radius) {
        table.error_at("profile", "two points of the profile fall together", Some(HINT));
    } else {
        return Some(Form::Revolution(profile));
    }
    None
}
