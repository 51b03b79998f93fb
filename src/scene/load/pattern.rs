//! `source = { type = "knit" }`: knitted cloth that the program makes.

use glam::DVec2;

use super::{
    Context, Range, Reader, chart_picture,
    color::{FabricCoordinates, StitchColors},
    knit_size::GivenSizes,
    known_yarns::KnownYarns,
};
use crate::{
    geometry::curve::Curve,
    input::{
        diagnostic::{Span, unknown_name},
        document::Value,
    },
    math::words::from_to,
    pattern::{
        chart::{Chart, ChartError, PATTERNS},
        knit::{self, CastOn, Closing, Colors, Edges, Form, Knit, Knitted, Measures, Rims, Thickness, Work},
        knitspeak::{Asked, Instructions, KnitSpeakError, WrittenEnd},
    },
};

/// A knit that is checked but for what only knitting tells.
pub(super) struct KnitPlan {
    knit: Knit,
    name: String,
    /// Where the chart's rows were written, for what is wrong with them.
    lines: Vec<Span>,
    header: Span,
    work: ColorWork,
    sizes: GivenSizes,
    yarn: Thickness,
}

/// How the stitches of a knit get their colours.
#[derive(Clone, Copy)]
enum ColorWork {
    /// A yarn for each colour.
    Yarns { work: Work, catch: Option<u32>, carry: u32 },
    /// One yarn that is dyed from place to place.
    Printed,
}

impl KnitPlan {
    /// What it is, with its gauge as knitters give it, stitches and rows in 10 cm, its size and its yarn.
    fn origin(&self, made: &Knitted) -> String {
        let [across, up] = made.gauge.map(|mm| 100.0 / mm);
        let Knit { rows, form, .. } = &self.knit;
        let Measures { stitches, across: size, up: height } = self.knit.measures(made);
        let (stitches, width) = (from_to(stitches.map(|n| n.to_string())), from_to(size.map(|mm| format!("{mm:.0}"))));
        let size = match form {
            Form::Flat if self.knit.edges == Edges::Tile => format!(", period {:.4} x {height:.4} mm", size[1]),
            Form::Flat if size[0] < size[1] => format!(", {width} mm wide, {height:.0} mm high"),
            Form::Flat => format!(", {width} x {height:.0} mm"),
            Form::Tube => format!(", {width} mm around, {height:.0} mm high"),
            Form::Revolution(_) => format!(", {width} mm around, {height:.0} mm along the profile"),
        };
        let length: f64 = made.strands.iter().map(|s| s.curve.polygon_length()).sum();
        let yarn = format!("{:.2} m of yarn", 1e-3 * length);
        format!("{}, {stitches} x {rows}, gauge {across:.1} x {up:.1} in 10 cm{size}, {yarn}", self.name)
    }

    /// The same with the counts that its sizes make; what cannot be knitted is told.
    pub(super) fn sized(mut self, context: &Context<'_>, warnings: &mut Vec<String>) -> Option<Self> {
        self.knit = self.sizes.apply(&self.knit, &self.yarn, context)?;
        self.told(self.knit.widths(), context)?;
        let cut_off = self.knit.cut_off().filter(|_| !self.lines.is_empty());
        let told = cut_off.into_iter().chain(self.knit.breaks_in_rounds());
        warnings.extend(told.map(|told| format!("{}: {told}", self.name)));
        Some(self)
    }

    /// Whether its rows go round.
    pub(super) fn is_round(&self) -> bool {
        self.knit.form.is_round()
    }

    /// Tells if yarns run into each other.
    pub(super) fn warn_of_overlap(&self, curves: &[(Curve, Vec<f64>)], warnings: &mut Vec<String>) {
        let curves: Vec<(&Curve, &[f64])> = curves.iter().map(|(curve, radii)| (curve, radii.as_slice())).collect();
        let told = self.knit.crowded(&self.yarn, &curves, |key| format!("`{key}`"));
        warnings.extend(told.map(|told| format!("{}: {told}", self.name)));
    }

    /// The colours of the stitches, as `of_rows` says for rows of so many, and the yarns they are of; what is wrong with the
    /// chart is told.
    pub(super) fn colors(
        &self,
        context: &Context<'_>,
        of_rows: &dyn Fn(&[u32]) -> Option<StitchColors>,
        warnings: &mut Vec<String>,
    ) -> Option<(Option<Colors>, Vec<usize>)> {
        let ColorWork::Yarns { work, catch, carry } = self.work else { return Some((None, Vec::new())) };
        let widths = self.told(self.knit.widths(), context)?;
        let (rows, yarns) = of_rows(&widths)?;
        if yarns.is_empty() {
            return Some((None, yarns));
        }
        let colors = Colors { rows, work, catch, carry };
        warnings.extend(colors.too_many("`color_work = \"intarsia\"`"));
        Some((Some(colors), yarns))
    }

    /// The yarns with their places; what is wrong with the chart is told.
    pub(super) fn curves(
        &self,
        (colors, yarns): (Option<Colors>, Vec<usize>),
        context: &Context<'_>,
    ) -> Option<(Vec<Curve>, FabricCoordinates, String)> {
        if let ColorWork::Yarns { work, .. } = self.work
            && let Err(problem) = work.takes(yarns.len().max(1))
        {
            let hint = "a `motif` or `rows` of the fabric of two yarns; more of them are knitted with \"stranded\"";
            context.error(self.header, problem, Some(hint.to_owned()));
            return None;
        }
        let knit = Knit { colors, ..self.knit.clone() };
        let made = self.told(knit.pressed(&self.yarn), context)?;
        let origin = self.origin(&made);
        let (curves, coordinates) = FabricCoordinates::of(made.strands, [knit.stitches, knit.rows]);
        let own = if yarns.is_empty() { yarns } else { made.colors.iter().map(|c| yarns[usize::from(*c)]).collect() };
        Some((curves, coordinates.with_yarns(own), origin))
    }

    fn told<T>(&self, made: Result<T, ChartError>, context: &Context<'_>) -> Option<T> {
        made.map_err(|error| {
            let span = error.line.and_then(|l| self.lines.get(l)).unwrap_or(&self.header);
            context.error(*span, error.problem, Some(error.hint));
        })
        .ok()
    }
}

/// What `pattern`, `chart` or `instructions` say.
pub(super) struct Charted {
    pub(super) name: String,
    pub(super) chart: Option<Chart>,
    /// Where the rows of the chart were written.
    lines: Vec<Span>,
    /// Stitches to cast on and rows to knit unless asked otherwise.
    stitches: u32,
    rows: u32,
    /// When the piece ends by its instructions.
    end: WrittenEnd,
}

impl Charted {
    fn new(name: &str, chart: Option<Chart>) -> Self {
        Self {
            name: name.to_owned(),
            chart,
            lines: Vec::new(),
            stitches: knit::COUNT,
            rows: knit::COUNT,
            end: WrittenEnd::default(),
        }
    }
}

/// `pattern`, `chart` or `instructions`.
pub(super) fn chart(table: &Reader<'_>, context: &Context<'_>) -> Charted {
    if let Some(text) = table.string("instructions") {
        return written(table, text, context);
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
        return Charted::new("knit", drawn(table, picture, context));
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
    Charted { lines: chart_rows.iter().map(|(_, span)| *span).collect(), ..Charted::new(name, chart) }
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

/// Written instructions over so many `stitches`, or as many as they cast on.
fn written(table: &Reader<'_>, text: &str, context: &Context<'_>) -> Charted {
    for other in ["pattern", "chart"].into_iter().filter(|key| table.has(key)) {
        table.error_at(other, format!("both `{other}` and `instructions` are given"), Some("keep one of them"));
    }
    let told = |error: KnitSpeakError| {
        let whole = table.span("instructions").unwrap_or(table.header());
        let place = error.line.map_or(whole, |line| context.sources.line_of_text(whole, line));
        let line = error.line.filter(|_| place == whole).map_or(String::new(), |line| format!("line {}: ", line + 1));
        context.error(place, format!("{line}{}", error.problem), Some(error.hint));
    };
    let mut charted = Charted::new("knit", None);
    let Ok(read) = Instructions::read(text).map_err(told) else { return charted };
    charted.stitches = read.cast_on().unwrap_or(charted.stitches);
    let stitches = table.u64_or("stitches", charted.stitches.into(), 1..=1_000_000) as u32;
    charted.end = read.end();
    let rows = table.u64("rows", 1..=1_000_000).map(|rows| rows as u32);
    let asked = Asked::new(rows, table.has("height"));
    let Ok((worked, rows)) = read.work_piece(stitches, asked, knit::COUNT).map_err(told) else { return charted };
    charted.rows = rows;
    charted.chart =
        Chart::parse(&worked.rows).map_err(|e| table.error_at("instructions", e.problem, Some(&e.hint))).ok();
    charted
}

/// Reads the keys of a knit.
pub(super) fn knit(
    table: &Reader<'_>,
    fabric: &Reader<'_>,
    context: &Context<'_>,
    yarns: &KnownYarns<'_>,
) -> Option<KnitPlan> {
    let charted = chart(table, context);
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
    let rows = match (&charted.chart, &form) {
        (Some(chart), Some(form)) if !table.has("instructions") => {
            Knit::rows_of(chart, form, !charted.lines.is_empty())
        }
        _ => charted.rows,
    };
    let mut sizes = GivenSizes::read(table, Some(fabric), context, &form);
    sizes.or_written(charted.end, form.as_ref(), table.has("tile"));
    counted(table, yarns, Charted { rows, ..charted }, form, sizes)
}

/// `type = "stockinette"`: a flat knit of that pattern.
pub(super) fn stockinette(
    table: &Reader<'_>,
    fabric: &Reader<'_>,
    context: &Context<'_>,
    yarns: &KnownYarns<'_>,
) -> Option<KnitPlan> {
    let form = Some(Form::Flat);
    let sizes = GivenSizes::read(table, Some(fabric), context, &form);
    counted(table, yarns, Charted::new("stockinette", Chart::named("stockinette")), form, sizes)
}

/// Over how many stitches a float goes before it is caught, if it is, and over how many rows a yarn is carried.
#[derive(Clone, Copy)]
pub(super) struct Stranding {
    pub(super) catch: Option<u32>,
    pub(super) carry: u32,
}

fn stranding(table: &Reader<'_>) -> Stranding {
    let catch = table.u64_or("catch_floats", knit::CATCH_FLOATS.into(), 0..=1_000_000) as u32;
    let carry = table.u64_or("carry_rows", knit::CARRY_ROWS.into(), 0..=1_000_000) as u32;
    Stranding { catch: (catch > 0).then_some(catch), carry }
}

/// Width over height to which stitches press yarns.
pub(super) fn flatten(table: &Reader<'_>) -> f64 {
    table.f64_or("flatten", knit::FLATTEN, Range::between(1.0, 2.0))
}

/// How the colours of a knit on a garment are worked; `None` where one yarn changes its colour.
pub(super) fn work_of_tile(table: &Reader<'_>) -> Option<Stranding> {
    let stranded = table.one_of_or("color_work", true, &[("stranded", true), ("printed", false)]);
    let stranding = stranding(table);
    stranded.then_some(stranding)
}

fn counted(
    table: &Reader<'_>,
    yarns: &KnownYarns<'_>,
    Charted { name, chart, lines, stitches, rows, .. }: Charted,
    form: Option<Form>,
    sizes: GivenSizes,
) -> Option<KnitPlan> {
    let stitches = table.u64_or("stitches", stitches.into(), 1..=1_000_000) as u32;
    let rows = table.u64_or("rows", rows.into(), 1..=1_000_000) as u32;
    let in_range = |[least, most]: [f64; 2]| Range::between(least, most);
    let stitch_width = table.f64("stitch_width", in_range(knit::STITCH_WIDTHS));
    let row_height = table.f64("row_height", in_range(knit::ROW_HEIGHTS));
    let yarn_per_stitch = table.f64("yarn_per_stitch", in_range(knit::YARNS_PER_STITCH));
    let yarn = yarns.thickness(flatten(table));
    let edges = table.one_of_or("edges", Edges::Finished, &Edges::NAMES);
    let tile = table.bool_or("tile", false);
    if tile && (table.has("edges") || form.as_ref().is_some_and(Form::is_round)) {
        table.error_at("tile", "a tile is flat and has no edges", Some("leave out `edges` and `form`"));
    }
    let edges = if tile { Edges::Tile } else { edges };
    let rims = rims(table, edges, form.as_ref());
    let flat = table.bool_or("flat", true);
    let points = table.u64_or("points", knit::POINTS.into(), 12..=200) as u32;
    let [stranded, intarsia, double] = Work::NAMES.map(|(name, work)| (name, Some(work)));
    let works = [stranded, intarsia, double, ("printed", None)];
    let work = table.one_of_or("color_work", Some(Work::Stranded), &works);
    if let (Some(work), Some(form)) = (work, &form)
        && let Err([problem, hint]) = work.suits(form)
    {
        table.error_at("color_work", problem, Some(hint));
    }
    let Stranding { catch, carry } = stranding(table);
    // A tile is of one yarn for each row.
    let work = match work.filter(|work| !tile || *work == Work::DoubleKnit) {
        Some(work) => ColorWork::Yarns { work, catch, carry },
        None => ColorWork::Printed,
    };
    let (chart, form) = (chart?, form?);
    let knit = Knit {
        chart,
        stitches,
        rows,
        form,
        edges,
        rims,
        stitch_width,
        row_height,
        yarn_per_stitch,
        points,
        colors: None,
        flat,
    };
    if let Err(wrong) = knit.check_counts() {
        table.error_at("stitches", wrong.problem, Some(&wrong.hint));
        return None;
    }
    Some(KnitPlan { knit, name, lines, header: table.header(), work, sizes, yarn })
}

/// `cast_on` and `top` of a finished piece.
fn rims(table: &Reader<'_>, edges: Edges, form: Option<&Form>) -> Rims {
    let rims = Rims {
        cast_on: table.one_of_or("cast_on", CastOn::LongTail, &CastOn::NAMES),
        top: table.one_of_or("top", Closing::BoundOff, &Closing::NAMES),
    };
    for key in ["cast_on", "top"] {
        if table.has(key) && matches!(edges, Edges::Live | Edges::Tile) {
            table.error_at(key, format!("open loops have no `{key}`"), Some("edges = \"finished\""));
        }
    }
    if rims.top == Closing::Drawn && form == Some(&Form::Flat) {
        table.error_at("top", "a flat piece is not drawn together", Some("form = \"tube\" or \"revolution\""));
    }
    rims
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
    Form::revolution(profile, radius).map_err(|problem| table.error_at("profile", problem, Some(HINT))).ok()
}
