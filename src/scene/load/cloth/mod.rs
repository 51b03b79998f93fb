//! `[[fabric]]`: curves from a file or a generator, and the yarn they are of.

mod make;

use std::path::{Path, PathBuf};

use glam::DAffine3;

use super::{
    super::{Mode, defaults},
    Context, Range, Reader, UNITS,
    color::{self, ColorPlan},
    garment::{self, GarmentPlan},
    known_yarns::KnownYarns,
    mesh::prim_pattern,
    pattern::{self, KnitPlan},
    placement, radians,
    weave::{self, WeavePlan},
    yarns::Library,
};
use crate::{
    files::{curve_file::ReadOptions, has_extension},
    geometry::curve::Basis,
    input::diagnostic::Span,
};

/// Cells of a periodic pattern that `--curves` shows, where the scene does not say how many: one looks like no cloth.
const SHOWN_CELLS: [u32; 2] = [6, 6];

/// How finely curves are resampled, for all fabrics.
pub(super) struct Detail {
    /// `None` for that of each file: exact, where points are kept.
    basis: Option<Basis>,
    tolerance: f64,
    longest_segment: f64,
    /// The number of the frame, in numbered curve files.
    pub(super) frame: u32,
    /// Whether yarns may move while the shutter is open: in the mode of yarns.
    pub(super) can_move: bool,
    /// When it opens and closes, in frames from the frame's own time.
    pub(super) shutter: Option<[f64; 2]>,
    /// Whether a layer holds how yarns move until the next frame, and whether one holds their texture coordinates.
    pub(super) flow: bool,
    pub(super) uv: bool,
    /// Whether garments are only measured, not laid.
    pub(super) survey: bool,
}

impl Detail {
    pub(super) fn read(table: &Reader<'_>) -> Self {
        let bases = [("auto", None), ("catmull-rom", Some(Basis::CatmullRom)), ("b-spline", Some(Basis::BSpline))];
        let basis = table.one_of_or("curve_basis", None, &bases);
        let tolerance = table.f64_or("curve_tolerance", defaults::CURVE_TOLERANCE, Range::between(0.0, 1.0));
        let longest_segment = table.f64_or("longest_segment", defaults::LONGEST_SEGMENT, Range::above(0.0));
        let frame = table.u64_or("frame", defaults::FRAME.into(), 0..=u64::from(u32::MAX)) as u32;
        let can_move = table.string_or("mode", Mode::Yarn.name()) == Mode::Yarn.name();
        Self {
            basis,
            tolerance,
            longest_segment,
            frame,
            can_move,
            shutter: None,
            flow: false,
            uv: false,
            survey: false,
        }
    }
}

enum Source {
    File(CurveFile),
    Knit(KnitPlan),
    Weave(Box<WeavePlan>),
    Garment(GarmentPlan),
    Straight { count: u32, length: f64, spacing: f64 },
}

/// A curve file, or one for each frame.
pub(super) struct CurveFile {
    pub(super) path: PathBuf,
    /// Curves at rest, if they are not those of the first frame.
    pub(super) rest: Option<PathBuf>,
    pub(super) span: Span,
    /// Millimetres, for a file that does not know its own.
    unit: Option<f64>,
    options: ReadOptions,
    up: Up,
    /// Whether the colours that the file gives its curves dye them.
    colors: bool,
}

#[derive(Clone, Copy, PartialEq)]
enum Up {
    /// As the file says; y if it does not.
    Auto,
    Y,
    Z,
}

/// What the curves of a fabric are, by name.
enum KindName {
    Yarn(String),
    Fiber(String),
}

impl KindName {
    fn name(&self) -> &str {
        match self {
            Self::Yarn(name) | Self::Fiber(name) => name,
        }
    }
}

/// A fabric whose text is sound and whose curves are not read yet.
pub(super) struct FabricPlan {
    keys: FabricKeys,
    source: Source,
}

/// What is said of a fabric, wherever its curves come from.
struct FabricKeys {
    name: Option<String>,
    kind: KindName,
    radius: Option<f64>,
    phases: Option<Vec<f64>>,
    seed: u32,
    color: ColorPlan,
    transform: DAffine3,
}

/// Reads one `[[fabric]]`; `curves` takes the place of the fabric's file or generator.
pub(super) fn plan(
    table: Reader<'_>,
    context: &Context<'_>,
    library: &Library,
    curves: Option<&Path>,
) -> Option<FabricPlan> {
    let fiber = table.string("fiber").map(str::to_owned);
    let yarn = if fiber.is_some() { table.string("yarn") } else { table.required_string("yarn") }.map(str::to_owned);
    for (key, name, names) in [("yarn", &yarn, &library.yarn_names), ("fiber", &fiber, &library.fiber_names)] {
        if let Some(name) = name
            && !names.contains(name)
        {
            let span = table.span(key).unwrap_or(table.header());
            context.unknown_thread(span, key, name, names);
        }
    }
    if yarn.is_some() && fiber.is_some() {
        let hint = "`yarn` if its curves are yarns, `fiber` if each is a single fibre";
        table.error_at("fiber", "give `yarn` or `fiber`, not both", Some(hint));
    }
    let name = table.string("name").map(str::to_owned);
    if name.as_ref().is_some_and(|n| n.trim().is_empty()) {
        table.error_at("name", "the name of a fabric cannot be empty", None);
    }
    let radius = table.f64("radius", Range::POSITIVE).map(|r| r * context.unit);
    let seed = table.u64_or("seed", 0, 0..=u64::from(u32::MAX)) as u32;
    let phases = table.numbers("phase", Range::FINITE).map(|p| p.into_iter().map(radians).collect());
    let transform = placement(&table, context);
    let mut color = color::plan(&table, context, library);
    let mut source = match table.table("source") {
        Some(source_table) => {
            let own = yarn.as_deref().map_or(("", None), |y| (y, library.yarns.get(y)));
            let fallback = if fiber.is_some() { defaults::FIBER_RADIUS } else { 0.5 };
            let known = KnownYarns { library, own, radius, fallback };
            source(source_table, &table, context, &known, curves)
        }
        None if curves.is_some() => {
            curves.map(|path| file_source(path.to_owned(), table.header(), None, None, true, context))
        }
        // What is there and no table is told already.
        None if table.has("source") => None,
        None => {
            table.error(
                "missing table `source`: where the curves come from",
                Some("source = { type = \"knit\" } or { type = \"file\", path = \"glove.bcc\" }"),
            );
            None
        }
    };
    if let Some(Source::Weave(plan)) = &mut source {
        color.take_order(&table, &plan.order);
        plan.take_shuttles(&color);
    }
    table.finish();
    let kind = fiber.map(KindName::Fiber).or(yarn.map(KindName::Yarn))?;
    let keys = FabricKeys { name, kind, radius, phases, seed, color, transform };
    Some(FabricPlan { keys, source: source? })
}

fn file_source(
    path: PathBuf,
    span: Span,
    unit: Option<f64>,
    table: Option<&Reader<'_>>,
    by_option: bool,
    context: &Context<'_>,
) -> Source {
    let mut options = ReadOptions::default();
    if by_option && has_extension(&path, "pyp") {
        options.tile = SHOWN_CELLS;
    }
    let mut up = Up::Auto;
    let mut colors = false;
    if let Some(table) = table {
        let bases = [("catmull-rom", Basis::CatmullRom), ("b-spline", Basis::BSpline)];
        options.basis = table.one_of("basis", &bases);
        options.prim = prim_pattern(table, "prim");
        colors = table.bool_or("colors", false);
        options.faces = table.string("faces").map(|p| context.resolve(p, table.span("faces").unwrap_or(span)));
        up = table.one_of_or("up", Up::Auto, &[("auto", Up::Auto), ("y", Up::Y), ("z", Up::Z)]);
        if let Some(tile) = table.numbers("tile", Range::between(1.0, 100_000.0)) {
            match tile.as_slice() {
                &[x, y] if x.fract() == 0.0 && y.fract() == 0.0 => options.tile = [x as u32, y as u32],
                _ => table.error_at(
                    "tile",
                    "expected two whole numbers",
                    Some("tile = [8, 12] repeats a pattern 8 times across and 12 times up"),
                ),
            }
        }
    }
    let rest = table.and_then(|t| t.string("rest").map(|p| context.resolve(p, t.span("rest").unwrap_or(span))));
    Source::File(CurveFile { path, rest, span, unit, options, up, colors })
}

/// What a fabric's curves come from.
#[derive(Clone, Copy, PartialEq, Eq)]
enum SourceKind {
    File,
    Knit,
    Weave,
    Straight,
    /// Short for a flat knit of that pattern.
    Stockinette,
    Garment,
}

fn source(
    table: Reader<'_>,
    fabric: &Reader<'_>,
    context: &Context<'_>,
    yarns: &KnownYarns<'_>,
    curves: Option<&Path>,
) -> Option<Source> {
    let kinds = [
        ("file", SourceKind::File),
        ("knit", SourceKind::Knit),
        ("weave", SourceKind::Weave),
        ("straight", SourceKind::Straight),
        ("stockinette", SourceKind::Stockinette),
        ("garment", SourceKind::Garment),
    ];
    let kind = table.kind("type", &kinds);
    let header = table.header();
    let made = match kind {
        Some(SourceKind::File) => {
            let unit = table.one_of("unit", &UNITS);
            let named = table.string("path");
            let path = match (curves, named) {
                (Some(path), _) => Some(path.to_owned()),
                (None, Some(name)) => Some(context.resolve(name, table.span("path").unwrap_or(table.header()))),
                (None, None) => {
                    table.error(
                        "this fabric has no curve file of its own",
                        Some("give one with --curves FILE, or add `path = \"FILE\"`"),
                    );
                    None
                }
            };
            let span = if curves.is_some() { table.header() } else { table.span("path").unwrap_or(table.header()) };
            // Read all keys in any case, so that each is known.
            let by_option = curves.is_some();
            let source = file_source(path.clone().unwrap_or_default(), span, unit, Some(&table), by_option, context);
            path.map(|_| source)
        }
        Some(SourceKind::Knit) => pattern::knit(&table, fabric, context, yarns).map(Source::Knit),
        Some(SourceKind::Weave) => {
            weave::weave(&table, fabric, context, yarns).map(|plan| Source::Weave(Box::new(plan)))
        }
        Some(SourceKind::Stockinette) => pattern::stockinette(&table, fabric, context, yarns).map(Source::Knit),
        Some(SourceKind::Garment) => garment::garment(&table, fabric, context, yarns).map(Source::Garment),
        Some(SourceKind::Straight) => Some(Source::Straight {
            count: table.u64_or("count", 1, 1..=1_000_000) as u32,
            length: table.f64_or("length", 10.0, Range::POSITIVE) * context.unit,
            spacing: table.f64("spacing", Range::POSITIVE).map_or(2.0 * yarns.radius(), |s| s * context.unit),
        }),
        None => None,
    };
    if let Some(path) = curves
        && kind.is_some_and(|kind| kind != SourceKind::File)
    {
        table.finish();
        return Some(file_source(path.to_owned(), header, None, None, true, context));
    }
    table.finish();
    made
}
