//! `source = { type = "weave" }`: woven cloth that the program makes.

use super::{
    Context, Range, Reader,
    color::{ColorPlan, FabricCoordinates, in_turns},
    draft_picture, gauge,
    known_yarns::KnownYarns,
};
use crate::{
    geometry::curve::Curve,
    input::{
        diagnostic::Span,
        document::{Node, Value},
        system::in_words,
    },
    pattern::{
        PatternStrand, StrandKind,
        draft::{Draft, DraftError},
        period::counts_that_hold,
        weave::{self, Edges, Extent, Impossible, Measures, Weave, shuttles},
        wif::{self, WifUse, WovenWif},
    },
    scene::{Tufts, Yarn},
};

/// A weave that is checked.
pub(super) struct WeavePlan {
    weave: Weave,
    /// If it is not the fabric's own.
    pub(super) weft_yarn: Option<String>,
    /// Yarns of warps from the left and of wefts from the bottom, in turns; empty where they are all the same.
    pub(super) order: [Vec<String>; 2],
    /// Colours of warps and wefts in turns, sRGB; empty where the draft has none.
    pub(super) colors: [Vec<[f64; 3]>; 2],
    name: String,
    header: Span,
    /// Where the spacings of warps and wefts are given.
    setting: [Span; 2],
    /// Whether they are those of the draft's file.
    filed: [bool; 2],
    /// Whether the scene asks for hems.
    hems: bool,
}

/// Woven yarns.
pub(super) struct Woven {
    /// What it is and what it came to.
    pub(super) origin: String,
    /// Warps and wefts, with their places.
    pub(super) sides: [(Vec<Curve>, FabricCoordinates); 2],
    /// The cut tufts of each.
    pub(super) tufts: [Tufts; 2],
}

impl WeavePlan {
    /// Radii of warp and weft, mm.
    pub(super) fn radii(&self) -> [f64; 2] {
        self.weave.yarn_radii()
    }

    /// Gives each yarn of the weft its shuttle: those of the fabric's rows, or else of the draft's colours.
    pub(super) fn take_shuttles(&mut self, color: &ColorPlan) {
        self.weave.shuttles = match color.rows() {
            [] if color.is_plain() => shuttles(&self.colors[1]),
            rows => shuttles(rows),
        };
    }

    /// Weaves it.
    pub(super) fn make(&self, context: &Context<'_>, warnings: &mut Vec<String>) -> Option<Woven> {
        let wrong = |problem: String, hint: &str| context.error(self.header, problem, Some(hint.to_owned()));
        match self.weave.relax() {
            Ok(cloth) => {
                let strands = cloth.strands();
                let measures = cloth.measures();
                let low = if self.hems { measures.too_low_for_hems(context.unit) } else { None };
                let told = low.into_iter().chain(cloth.crowded(&strands));
                warnings.extend(told.map(|told| format!("{}: {told}", self.name)));
                let length = weave::yarn_lengths(&strands).map(|mm| mm / 1000.0);
                let (warps, wefts): (Vec<PatternStrand>, Vec<PatternStrand>) =
                    strands.into_iter().partition(|s| s.kind == StrandKind::Warp);
                let origin = self.origin(cloth.count(), &measures, length);
                let tufts = [&warps, &wefts].map(|side| {
                    let strands = || side.iter().enumerate().filter(|(_, s)| s.is_of_tuft());
                    let yarns = strands().map(|(_, s)| s.share).sum::<f64>().round() as usize;
                    Tufts { yarns, strands: strands().map(|(i, _)| i).collect() }
                });
                let sides = [warps, wefts].map(|side| FabricCoordinates::of(side, cloth.count()));
                return Some(Woven { origin, sides, tufts });
            }
            Err(Impossible::TooTight { warp, least }) => {
                let (key, least) = (if warp { "warp_spacing" } else { "weft_spacing" }, least / context.unit);
                if self.filed[usize::from(!warp)] {
                    let hint = "thinner yarns, or `spacing = false` in the draft for as close as they go";
                    let spacing = key.replace('_', " ");
                    wrong(
                        format!(
                            "the {spacing} of the draft leaves the yarns no room to pass: at least {least:.4} here"
                        ),
                        hint,
                    );
                } else {
                    let (count, threads) = if warp { ("ends_per_cm", "ends") } else { ("picks_per_cm", "picks") };
                    let most = 10.0 / (least * context.unit);
                    let problem = format!(
                        "`{key}` (or `{count}`) leaves the yarns no room to pass: at least {least:.4} apart here, at most {most:.1} \
                         {threads} a centimetre"
                    );
                    let hint = "thinner yarns, another `crimp`, or no spacing at all for the tightest";
                    context.error(self.setting[usize::from(!warp)], problem, Some(hint.to_owned()));
                }
            }
            Err(Impossible::TooMuchCover { most }) => wrong(
                format!("these yarns cover at most {most:.3} of the plane in this weave"),
                "a lower `cover`, a higher `flatten`, or no cover at all for the closest",
            ),
            Err(Impossible::TooLittleCover { least }) => wrong(
                format!("these yarns cover at least {least:.3} of the plane in this weave"),
                "a higher `cover`, or thinner yarns; where one distance of yarns is given, a greater one",
            ),
            Err(Impossible::TooFewWarps { least }) => wrong(
                format!("wefts that turn at the sides take at least {least} warps in this weave"),
                "more `warps`, or `edges = \"live\"`",
            ),
            Err(Impossible::TooSmall { warp, least }) => wrong(
                format!(
                    "the `{}` has no room for one yarn, or one repeat of a tile",
                    if warp { "width" } else { "height" }
                ),
                &format!("at least {:.3}", least / context.unit),
            ),
            Err(Impossible::Unpaired { warps }) => wrong(
                format!("this weave twines its warps in pairs: of {warps} one is left alone"),
                &format!("`warps` of {}", counts_that_hold(2, warps)),
            ),
            Err(Impossible::TooLarge) => {
                wrong("more than 2^27 control points".to_owned(), "fewer warps, wefts or points");
            }
        }
        None
    }

    /// As a weaver would describe it, in millimetres and metres.
    fn origin(&self, count: [u32; 2], measures: &Measures, [warp, weft]: [f64; 2]) -> String {
        let [ends, picks] = measures.spacing.map(|s| 10.0 / s);
        let [width, height] = measures.size;
        format!(
            "{}, {} x {}: {ends:.1} ends and {picks:.1} picks per cm, {width:.1} x {height:.1} mm, {:.1} % see-through, \
             {warp:.2} m of warp and {weft:.2} m of weft",
            self.name,
            count[0],
            count[1],
            100.0 * measures.see_through,
        )
    }
}

/// Reads the keys of a weave.
pub(super) fn weave(
    table: &Reader<'_>,
    fabric: &Reader<'_>,
    context: &Context<'_>,
    yarns: &KnownYarns<'_>,
) -> Option<WeavePlan> {
    let (name, drafted) = draft(table, context);
    let wif = drafted.as_ref().and_then(|d| d.wif.as_ref());
    let known = |name: &str, span: Span| context.check_yarn(span, name, yarns.library);
    let weft_yarn = table.string("weft_yarn").filter(|name| *name != yarns.name());
    weft_yarn.inspect(|name| known(name, table.span("weft_yarn").unwrap_or(table.header())));
    let order = ["warp_order", "weft_order"].map(|key| in_turns(table, key, context, &known));
    let written = |side: usize| wif.and_then(|w| w.radius[side]).filter(|_| !yarns.has_radius());
    let weft_of_its_own = weft_yarn.and_then(|name| yarns.library.yarns.get(name));
    let radius = [yarns.radius(), weft_of_its_own.map_or(yarns.radius(), |y| y.radius)];
    let half_width = [yarns.half_width(), weft_of_its_own.map_or(yarns.half_width(), Yarn::half_width)];
    let half_rooms = [0, 1].map(|side| written(side).unwrap_or(radius[side]) * half_width[side]);
    let Setting { spacing: [warp_spacing, weft_spacing], spans, filed, cover } = setting(table, fabric, context, wif);
    let count = drafted.as_ref().map_or([weave::YARNS; 2], Drafted::count);
    let warps = extent(table, context, "warps", "width", count[0]);
    let wefts = extent(table, context, "wefts", "height", count[1]);
    let crimp = table.f64("crimp", Range::UNIT);
    let flatten = table.f64_or("flatten", weave::FLATTEN, Range::between(1.0, 4.0));
    let points = table.u64_or("points", weave::POINTS.into(), 4..=24) as u32;
    let pile = standing(table, context, "pile_height", half_rooms[0]);
    let edges = edges(table, context, half_rooms[0], drafted.as_ref());
    let tile = table.bool_or("tile", false);
    if tile && table.has("edges") {
        table.error_at("tile", "a tile has no edges", Some("leave out `edges`"));
    }
    if !table.bool_or("flat", true) {
        table.error_at("flat", "woven cloth lies flat by itself", Some("leave out `flat`"));
    }
    let Drafted { draft, wif, .. } = drafted?;
    let (threads, colors) = wif.map(|w| (w.threads, w.colors)).unwrap_or_default();
    let default_pile = weave::pile_height(&draft, half_rooms[0]);
    let weave = Weave {
        draft,
        warps,
        wefts,
        half_rooms,
        half_width,
        warp_spacing,
        weft_spacing,
        cover,
        crimp,
        flatten,
        points,
        edges: if tile { Edges::Live } else { edges },
        pile_height: pile.unwrap_or(default_pile),
        threads,
        shuttles: Vec::new(),
        tile,
    };
    if pile.is_some() && weave.draft.pile().is_none() {
        table.error_at("pile_height", "this draft has no pile", Some("draft = \"terry\", \"velvet\" or \"corduroy\""));
    }
    warn_about_loose(table, &weave.draft);
    Some(WeavePlan {
        weave,
        weft_yarn: weft_yarn.map(str::to_owned),
        order,
        colors,
        name,
        header: table.header(),
        setting: spans,
        filed,
        hems: edges == Edges::Finished && table.has("edges"),
    })
}

/// Distance of warps and of wefts, and how many there are to 10 mm.
const DISTANCES: [(&str, &str); 2] = [("warp_spacing", "ends_per_cm"), ("weft_spacing", "picks_per_cm")];

/// How closely yarns are set, of warp and weft.
struct Setting {
    /// From the middle of a yarn to that of the next, mm.
    spacing: [Option<f64>; 2],
    /// Where the scene gives it, or else what is woven.
    spans: [Span; 2],
    /// Whether that is of a draft's file and not of the scene.
    filed: [bool; 2],
    /// The share of the plane that yarns cover.
    cover: Option<f64>,
}

/// The setting that is asked for, or that of the draft's file.
fn setting(table: &Reader<'_>, fabric: &Reader<'_>, context: &Context<'_>, wif: Option<&WovenWif>) -> Setting {
    let cover = table.f64("cover", Range::between(0.01, 1.0));
    let in_file = |side: usize| wif.and_then(|w| w.spacing[side]).filter(|_| cover.is_none());
    let asked = DISTANCES.map(|(key, density)| spacing(table, context, key, density));
    let gauge = gauge(table, fabric, &asked);
    let of_gauge = table.span("gauge").or(fabric.span("gauge"));
    let span = |key: &str| table.span(key);
    let spans = DISTANCES.map(|(key, density)| span(key).or(span(density)).or(of_gauge).unwrap_or(table.header()));
    let asked = [0, 1].map(|side| asked[side].or(gauge.map(|g| g[side])));
    let filed = [0, 1].map(|side| asked[side].is_none() && in_file(side).is_some());
    let spacing = [0, 1].map(|side| asked[side].or_else(|| in_file(side)));
    if cover.is_some() && spacing.iter().all(Option::is_some) {
        table.error_at("cover", "spacings both ways are given, and a cover", Some("leave one of them out"));
    }
    Setting { spacing, spans, filed, cover }
}

/// Thickness of a thread over the mean from which on cloth is not hemmed unless asked.
const UNEQUAL: f64 = 1.5;

/// Cloth that is not hemmed unless asked: three layers of it do not lie flat, and hems of a small sample would leave no pile.
fn is_too_thick_for_hems(drafted: &Drafted) -> bool {
    let Drafted { draft, wif, .. } = drafted;
    draft.pile().is_some() || draft.layers() > 1 || wif.as_ref().is_some_and(has_unequal_threads)
}

fn has_unequal_threads(wif: &WovenWif) -> bool {
    wif.threads.iter().flat_map(|t| &t.thickness).any(|t| *t > UNEQUAL)
}

/// How far a fringe or a pile stands out, mm, where a warp takes twice `half_room`.
fn standing(table: &Reader<'_>, context: &Context<'_>, key: &str, half_room: f64) -> Option<f64> {
    // As a round number, for messages.
    let longest = weave::longest(half_room) / context.unit;
    let digits = 10f64.powf(longest.log10().floor() - 2.0);
    let longest = Range::above(0.0).and_at_most((longest / digits).floor() * digits);
    table.f64(key, longest).map(|length| length * context.unit)
}

/// How the cloth ends.
fn edges(table: &Reader<'_>, context: &Context<'_>, half_room: f64, drafted: Option<&Drafted>) -> Edges {
    let fringe = standing(table, context, "fringe", half_room);
    let length = fringe.unwrap_or_else(|| weave::fringe(half_room));
    let fringed = Edges::Fringe(length);
    let names = Edges::NAMES.map(|(name, edges)| (name, edges(length)));
    let default = match fringe {
        Some(_) => fringed,
        None if drafted.is_some_and(|d| d.draft.cut_wefts()) => Edges::Live,
        None if drafted.is_some_and(is_too_thick_for_hems) => Edges::Selvedge,
        None => Edges::Finished,
    };
    let edges = table.one_of_or("edges", default, &names);
    if fringe.is_some() && edges != fringed {
        table.error_at("fringe", "only `edges = \"fringe\"` has a fringe", None);
    }
    if let Some(Err((problem, instead))) = drafted.map(|d| edges.suit(&d.draft)) {
        let at = if table.has("edges") { "edges" } else { "fringe" };
        table.error_at(at, problem, Some(&format!("edges = \"{}\"", instead.name())));
    }
    edges
}

/// Yarns that always stay on one side are held by nothing.
fn warn_about_loose(table: &Reader<'_>, draft: &Draft) {
    if let Some(problem) = draft.loose_in_words() {
        table.warning_at("draft", problem, Some("warps count from the left, wefts from the bottom"));
    }
}

/// A distance of yarns, or how many there are to 10 mm.
fn spacing(table: &Reader<'_>, context: &Context<'_>, key: &str, density: &str) -> Option<f64> {
    let spacing = table.f64(key, Range::POSITIVE).map(|s| s * context.unit);
    let counted = table.f64(density, Range::POSITIVE).map(|n| 10.0 / n);
    if spacing.is_some() && counted.is_some() {
        table.error_at(density, format!("give `{key}` or `{density}`, not both"), None);
    }
    spacing.or(counted)
}

/// Distances of warps and of wefts by the `gauge`, ends and picks, of the weave or of its fabric.
fn gauge(table: &Reader<'_>, fabric: &Reader<'_>, spacings: &[Option<f64>; 2]) -> Option<[f64; 2]> {
    let place = gauge::gauged(table, Some(fabric))?;
    let given = gauge::stitch(place, None)?;
    if spacings.iter().any(Option::is_some) {
        let hint = "`gauge` has ends and picks: leave out `ends_per_cm`, `picks_per_cm` and spacings";
        place.error_at("gauge", "both a gauge and distances of yarns are given", Some(hint));
    }
    Some(given.to_array())
}

/// A number of yarns, `default` unless given, or the length that they fill.
fn extent(table: &Reader<'_>, context: &Context<'_>, key: &str, length: &str, default: u32) -> Extent {
    let asked = table.f64(length, Range::POSITIVE).map(|l| l * context.unit);
    if asked.is_some() && table.has(key) {
        table.error_at(length, format!("give `{key}` or `{length}`, not both"), None);
    }
    let count = table.u64_or(key, default.into(), 1..=1_000_000) as u32;
    asked.map_or(Extent::Yarns(count), Extent::Length)
}

/// A draft, and what its file says beside it.
pub(super) struct Drafted {
    pub(super) draft: Draft,
    pub(super) wif: Option<WovenWif>,
    /// Whether it is a picture, all of which is woven unless the scene says otherwise.
    pub(super) drawn: bool,
}

impl Drafted {
    /// Warps and wefts where the scene gives none.
    fn count(&self) -> [u32; 2] {
        match &self.wif {
            Some(wif) => wif.count,
            None if self.drawn => [self.draft.warps() as u32, self.draft.wefts() as u32],
            None => [weave::YARNS; 2],
        }
    }
}

/// `draft`: a name, rows of a matrix, a loom's lists, a picture or a file.
pub(super) fn draft(table: &Reader<'_>, context: &Context<'_>) -> (String, Option<Drafted>) {
    if let Some(Value::Table(_)) = table.node("draft").map(|node| &node.value)
        && let Some(own) = table.table("draft")
    {
        if own.has("type") {
            return from_file(own, context);
        }
        if own.has("image") {
            let drafted = draft_picture::draft(own, context).map(|draft| Drafted { draft, wif: None, drawn: true });
            return ("figured weave".to_owned(), drafted);
        }
    }
    let read: Option<(String, Result<Draft, DraftError>)> =
        if matches!(table.node("draft").map(|node| &node.value), Some(Value::Table(_))) {
            table.table("draft").and_then(loom).map(|draft| ("weave".to_owned(), draft))
        } else {
            let rows = table.strings("draft");
            match rows.as_slice() {
                [] if table.has("draft") => {
                    // A value of another type is told already.
                    let empty = |node: &Node| matches!(&node.value, Value::Array(rows) if rows.is_empty());
                    if table.node("draft").is_some_and(empty) {
                        table.error_at("draft", "a draft without rows", Some("draft = [\"#..\", \".#.\", \"..#\"]"));
                    }
                    None
                }
                [] => Some(("plain weave".to_owned(), Draft::named("plain"))),
                [(name, _)] if !name.contains(['#', '.']) => Some((format!("{name} weave"), Draft::named(name))),
                rows => {
                    let rows: Vec<&str> = rows.iter().map(|(text, _)| *text).collect();
                    Some(("weave".to_owned(), Draft::matrix(&rows)))
                }
            }
        };
    match read {
        Some((name, Ok(draft))) => (name, Some(Drafted { draft, wif: None, drawn: false })),
        Some((_, Err(error))) => {
            table.error_at("draft", error.problem, Some(&error.hint));
            (String::new(), None)
        }
        None => (String::new(), None),
    }
}

/// `{ type = "wif", path = "x.wif" }`.
fn from_file(table: Reader<'_>, context: &Context<'_>) -> (String, Option<Drafted>) {
    table.kind("type", &[("wif", ())]);
    let defaults = WifUse::default();
    let take = WifUse {
        spacing: table.bool_or("spacing", defaults.spacing),
        thickness: table.bool_or("thickness", defaults.thickness),
        colors: table.bool_or("colors", defaults.colors),
    };
    let path = table.required_string("path").map(str::to_owned);
    let span = table.span("path").unwrap_or(table.header());
    table.finish();
    let Some(path) = path.map(|p| context.resolve(&p, span)) else { return (String::new(), None) };
    let wrong = |problem: String, hint: Option<String>| {
        context.error(span, format!("{}: {problem}", path.display()), hint);
        (String::new(), None)
    };
    let bytes = match std::fs::read(&path) {
        Ok(bytes) => bytes,
        Err(error) => {
            context.wrong_file(&path, span, format!("{}: {}", path.display(), in_words(&error)));
            return (String::new(), None);
        }
    };
    let file = match wif::parse(&bytes) {
        Ok(file) => file,
        Err(error) => return wrong(error.without_hint(), error.hint),
    };
    match file.woven(take) {
        Ok(woven) => {
            for note in &woven.notes {
                context.warning(span, format!("{}: {note}", path.display()));
            }
            let name = file.title.clone().unwrap_or_else(|| "weave".to_owned());
            (name, Some(Drafted { draft: woven.draft.clone(), wif: Some(woven), drawn: false }))
        }
        Err(error) => wrong(error.problem, Some(error.hint)),
    }
}

/// `threading`, `tie_up` and `treadling`; `None` where that is told.
fn loom(table: Reader<'_>) -> Option<Result<Draft, DraftError>> {
    const HINT: &str = "threading = [1, 2, 3, 4], tie_up = [[1, 2], [2, 3], [3, 4], [4, 1]], treadling = [1, 2, 3, 4]";
    let missing: Vec<&str> = ["threading", "tie_up", "treadling"].into_iter().filter(|key| !table.has(key)).collect();
    for key in &missing {
        table.error(format!("missing key `{key}` of the loom"), Some(HINT));
    }
    let count = |number: f64| (number.fract() == 0.0 && (1.0..=1024.0).contains(&number)).then_some(number as u32);
    let whole = |key: &str| -> Option<Vec<u32>> {
        let numbers = table.numbers(key, Range::FINITE)?;
        let counts = numbers.into_iter().map(count).collect::<Option<Vec<u32>>>();
        if counts.is_none() {
            table.error_at(key, format!("`{key}` expects whole numbers from 1 to 1024"), Some(HINT));
        }
        counts
    };
    let (threading, treadling) = (whole("threading"), whole("treadling"));
    let shafts = |node: &Node| -> Option<Vec<u32>> {
        let number = |node: &Node| match node.value {
            Value::Integer(value) => count(value as f64),
            _ => None,
        };
        match &node.value {
            Value::Array(elements) => elements.iter().map(number).collect(),
            _ => number(node).map(|shaft| vec![shaft]),
        }
    };
    let tie_up = match table.node("tie_up").map(|node| &node.value) {
        Some(Value::Array(treadles)) => treadles.iter().map(shafts).collect::<Option<Vec<_>>>(),
        _ => None,
    };
    if tie_up.is_none() && table.has("tie_up") {
        table.error_at("tie_up", "`tie_up` expects the shafts that each treadle raises", Some(HINT));
    }
    table.finish();
    Some(Draft::from_loom(&threading?, &tie_up?, &treadling?))
}
