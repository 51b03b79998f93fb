//! `[[fabric]]`: curves from a file or a generator, and the yarn they are of.

use std::{
    f64::consts::TAU,
    path::{Path, PathBuf},
};

use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use super::{
    super::{CurveKind, Fabric, FabricMotion, GarmentFacts, Mode, Taken, Yarn, defaults, transform_curves},
    Context, Range, Reader, UNITS,
    color::{self, ColorPlan, FabricCoordinates},
    dyes::Dyes,
    garment::{self, GarmentPlan},
    mesh::prim_pattern,
    pattern::{self, KnitPlan},
    placement, radians, sequence,
    weave::{self, WeavePlan, Woven},
    yarns::Library,
};
use crate::{
    geometry::{
        curve::{Basis, Curve, CurveSet},
        curve_file::{self, CurveFileError, ReadOptions},
        pattern::straight,
        stage,
    },
    input::diagnostic::Span,
    math::sampler::Stream,
};

/// Columns that a yarn counts where nothing is known of its cloth.
const COLUMNS: f32 = 256.0;

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
    pub(super) fn read(table: Option<&Reader<'_>>) -> Self {
        let bases = [("auto", None), ("catmull-rom", Some(Basis::CatmullRom)), ("b-spline", Some(Basis::BSpline))];
        let basis = table.and_then(|t| t.one_of_or("curve_basis", None, &bases));
        let tolerance = table.map_or(defaults::CURVE_TOLERANCE, |t| {
            t.f64_or("curve_tolerance", defaults::CURVE_TOLERANCE, Range::between(0.0, 1.0))
        });
        let longest_segment = table.map_or(defaults::LONGEST_SEGMENT, |t| {
            t.f64_or("longest_segment", defaults::LONGEST_SEGMENT, Range::above(0.0))
        });
        let frame = table.and_then(|t| t.u64("frame", 0..=u64::from(u32::MAX))).map_or(defaults::FRAME, |f| f as u32);
        let can_move = table.is_none_or(|t| t.string_or("mode", Mode::Yarn.name()) == Mode::Yarn.name());
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
    fn into_name(self) -> String {
        match self {
            Self::Yarn(name) | Self::Fiber(name) => name,
        }
    }
}

/// A fabric whose text is sound and whose curves are not read yet.
pub(super) struct FabricPlan {
    name: Option<String>,
    kind: KindName,
    radius: Option<f64>,
    phases: Option<Vec<f64>>,
    seed: u32,
    color: ColorPlan,
    transform: DAffine3,
    source: Source,
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
            context.unknown(span, key, name, names.iter().map(String::as_str));
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
    let source = match table.table("source") {
        Some(source_table) => {
            let own = yarn.as_deref().map_or(("", None), |y| (y, library.yarns.get(y)));
            let fallback = if fiber.is_some() { defaults::FIBER_RADIUS } else { 0.5 };
            let known = Yarns { library, own, radius, fallback };
            source(source_table, &table, context, &known, curves)
        }
        None if curves.is_some() => {
            curves.map(|path| file_source(path.to_owned(), table.header(), None, None, true, context))
        }
        None => {
            table.error(
                "missing table `source`: where the curves come from",
                Some("source = { type = \"knit\" } or { type = \"file\", path = \"glove.bcc\" }"),
            );
            None
        }
    };
    if let Some(Source::Weave(plan)) = &source {
        color.take_order(&table, &plan.order);
    }
    table.finish();
    let kind = fiber.map(KindName::Fiber).or(yarn.map(KindName::Yarn))?;
    Some(FabricPlan { name, kind, radius, phases, seed, color, transform, source: source? })
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
    if by_option && path.extension().is_some_and(|e| e.eq_ignore_ascii_case("pyp")) {
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

/// The yarns that a source may name.
pub(super) struct Yarns<'a> {
    pub(super) library: &'a Library,
    /// The fabric's own, by name and, where it is sound, as it is.
    own: (&'a str, Option<&'a Yarn>),
    /// What the fabric says in place of its yarn's radius.
    radius: Option<f64>,
    /// That of fibres, or something to go on with where the yarn has mistakes.
    fallback: f64,
}

impl Yarns<'_> {
    /// Radius of the fabric's yarns or fibres, millimetres.
    pub(super) fn radius(&self) -> f64 {
        self.radius.or(self.own.1.map(|y| y.radius)).unwrap_or(self.fallback)
    }

    /// Whether the fabric itself says it.
    pub(super) fn has_radius(&self) -> bool {
        self.radius.is_some()
    }

    /// Name of the fabric's yarn.
    pub(super) fn name(&self) -> &str {
        self.own.0
    }
}

fn source(
    table: Reader<'_>,
    fabric: &Reader<'_>,
    context: &Context<'_>,
    yarns: &Yarns<'_>,
    curves: Option<&Path>,
) -> Option<Source> {
    let kinds = [("file", 0), ("knit", 1), ("weave", 2), ("straight", 3), ("stockinette", 4), ("garment", 5)];
    let kind = table.kind("type", &kinds);
    let header = table.header();
    let made = match kind {
        Some(0) => {
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
        Some(1) => pattern::knit(&table, fabric, context, yarns).map(Source::Knit),
        Some(2) => weave::weave(&table, context, yarns).map(|plan| Source::Weave(Box::new(plan))),
        // Short for a flat knit of that pattern.
        Some(4) => pattern::stockinette(&table, fabric, context).map(Source::Knit),
        Some(5) => garment::garment(&table, fabric, context, yarns).map(Source::Garment),
        Some(3) => Some(Source::Straight {
            count: table.u64_or("count", 1, 1..=1_000_000) as u32,
            length: table.f64_or("length", 10.0, Range::POSITIVE) * context.unit,
            spacing: table.f64("spacing", Range::POSITIVE).map_or(2.0 * yarns.radius(), |s| s * context.unit),
        }),
        _ => None,
    };
    if let (Some(path), Some(1..)) = (curves, kind) {
        table.finish();
        return Some(file_source(path.to_owned(), header, None, None, true, context));
    }
    table.finish();
    made
}

/// Curves of one kind of yarn, before they are moved to their place.
struct Made {
    origin: String,
    from_file: bool,
    kind: CurveKind,
    curves: Vec<(Curve, Vec<f64>)>,
    /// Where their points are in the cloth, if that is known.
    coordinates: Option<FabricCoordinates>,
    /// Their colours, if they are not the fabric's.
    color: Option<ColorPlan>,
    /// Colours that came with them.
    dyes: Option<Dyes>,
    motion: FabricMotion,
    /// Whether there are no more points than are needed.
    exact: bool,
}

impl Made {
    fn new(
        origin: String,
        kind: CurveKind,
        curves: Vec<(Curve, Vec<f64>)>,
        coordinates: Option<FabricCoordinates>,
    ) -> Self {
        Self {
            origin,
            from_file: false,
            kind,
            curves,
            coordinates,
            color: None,
            dyes: None,
            motion: FabricMotion::default(),
            exact: false,
        }
    }
}

impl FabricPlan {
    /// Reads or makes the curves: one fabric for each kind of yarn.
    pub(super) fn make(
        self,
        index: usize,
        context: &Context<'_>,
        library: &Library,
        detail: &Detail,
        warnings: &mut Vec<String>,
        garments: &mut Vec<GarmentFacts>,
    ) -> Option<Vec<Fabric>> {
        let place_of = |name: &str| library.yarns.keys().position(|n| n == name).map(CurveKind::Yarn);
        let (kind, own_radius) = match &self.kind {
            KindName::Yarn(name) => (place_of(name)?, library.yarns[name].radius),
            KindName::Fiber(name) => {
                (CurveKind::Fiber(library.fibers.keys().position(|n| n == name)?), defaults::FIBER_RADIUS)
            }
        };
        let radius = self.radius.unwrap_or(own_radius);
        let with_radius = |curves: Vec<Curve>, radius: f64| -> Vec<(Curve, Vec<f64>)> {
            let with = |mut curve: Curve| {
                let radii = curve.radii.take().unwrap_or_else(|| vec![radius; curve.points.len()]);
                (curve, radii)
            };
            curves.into_iter().map(with).collect()
        };
        let made = match self.source {
            Source::Garment(plan) => {
                let (tension, places) = (self.color.tension(), self.color.needs_places() || detail.uv);
                let (panels, facts) = {
                    let name = match &self.kind {
                        KindName::Yarn(name) | KindName::Fiber(name) => name.as_str(),
                    };
                    plan.make((name, radius), tension, places, context, library, detail, warnings)?
                };
                garments.push(facts);
                panels
                    .into_iter()
                    .map(|panel| {
                        let kind = panel.yarn.as_deref().map_or(Some(kind), place_of)?;
                        let made = Made::new(panel.origin, kind, panel.curves, Some(panel.coordinates));
                        Some(Made { color: panel.color, motion: panel.motion, exact: true, ..made })
                    })
                    .collect::<Option<Vec<Made>>>()?
            }
            Source::Knit(plan) => {
                let plan = plan.sized(2.0 * radius, context, warnings)?;
                let colors = match kind {
                    CurveKind::Yarn(base) if !self.color.is_plain() => {
                        let of_rows = |widths: &[u32]| self.color.stitches(widths, base, context, library);
                        plan.colors(context, &of_rows, warnings)?
                    }
                    _ => Default::default(),
                };
                let (curves, coordinates, origin) = plan.curves(2.0 * radius, colors, context)?;
                let curves = with_radius(curves, radius);
                plan.warn_of_overlap(&curves, warnings);
                vec![Made::new(origin, kind, curves, Some(coordinates))]
            }
            Source::Weave(plan) => {
                let Woven { origin, sides } = plan.make(context)?;
                let [(warps, mut coordinates), (wefts, weft_coordinates)] = sides;
                let weft = plan.weft_yarn.as_deref().map_or(Some(kind), place_of)?;
                let [warp_radius, weft_radius] = plan.radii();
                let (mut warps, wefts) = (with_radius(warps, warp_radius), with_radius(wefts, weft_radius));
                let dyes = || Dyes::of_threads(&plan.colors);
                if weft == kind {
                    warps.extend(wefts);
                    coordinates.join(weft_coordinates);
                    vec![Made { dyes: dyes(), ..Made::new(origin, kind, warps, Some(coordinates)) }]
                } else {
                    let warp = Made::new(format!("warp of {origin}"), kind, warps, Some(coordinates));
                    let weft = Made::new(format!("weft of {origin}"), weft, wefts, Some(weft_coordinates));
                    vec![Made { dyes: dyes(), ..warp }, Made { dyes: dyes(), ..weft }]
                }
            }
            Source::Straight { count, length, spacing } => {
                let curves = with_radius(straight(count, length, spacing), radius);
                vec![Made::new(format!("{count} straight"), kind, curves, None)]
            }
            Source::File(file) => {
                let mut colors = None;
                let mut read = |path: &Path, frame: Option<f64>| {
                    let (mut set, scale) = file.read(path, frame, context, warnings)?;
                    colors.get_or_insert_with(|| std::mem::take(&mut set.colors));
                    let own_radii = |mut curve: Curve| {
                        let given = curve.radii.take().filter(|_| self.radius.is_none());
                        let radii = given.map_or_else(
                            || vec![radius; curve.points.len()],
                            |r| r.iter().map(|r| r * scale).collect(),
                        );
                        (curve, radii)
                    };
                    let mut curves: Vec<(Curve, Vec<f64>)> = set.curves.into_iter().map(own_radii).collect();
                    if file.up == Up::Z || (file.up == Up::Auto && set.up_axis == Some(2)) {
                        // z up becomes y up: a quarter turn about x.
                        let turn = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);
                        transform_curves(&mut curves, &DAffine3::from_mat3(turn));
                    }
                    Some(curves)
                };
                let (path, curves, motion) = sequence::read(&file, detail, context, &mut read)?;
                let dyes = colors.filter(|_| file.colors).map(|colors| Dyes::of_curves(&colors));
                if let Some(None) = dyes {
                    warnings.push(format!("{}: `colors` is asked for, but no curve has one", path.display()));
                }
                let made = Made::new(path.display().to_string(), kind, curves, None);
                vec![Made { from_file: true, motion, dyes: dyes.flatten(), ..made }]
            }
        };
        let mut stream = Stream::new(self.seed ^ (index as u32).wrapping_mul(0x9e37_79b9));
        let name = self.name.unwrap_or_else(|| self.kind.into_name());
        let fabric = |Made { origin, from_file, kind, curves, coordinates, color, dyes, motion, exact }: Made| {
            let phases =
                self.phases.clone().unwrap_or_else(|| curves.iter().map(|_| TAU * f64::from(stream.next())).collect());
            let of_file = match curves.first().map(|(curve, _)| curve.basis) {
                Some(Basis::BSpline) => Basis::BSpline,
                _ => Basis::CatmullRom,
            };
            let mut fabric = Fabric {
                name: name.clone(),
                origin,
                from_file,
                kind,
                curves,
                motion,
                variants: Vec::new(),
                material_indices: Vec::new(),
                uvs: Vec::new(),
                taken: Taken::default(),
                phases,
                seed: self.seed,
                basis: detail.basis.unwrap_or(of_file),
                tolerance: if exact { 0.0 } else { detail.tolerance },
                longest_segment: detail.longest_segment,
            };
            fabric.transform(&self.transform);
            let coordinates = match detail.uv {
                false => coordinates,
                true => {
                    let places = coordinates.unwrap_or_else(|| FabricCoordinates::along(COLUMNS, &fabric));
                    fabric.uvs = places.uvs(&fabric);
                    Some(places)
                }
            };
            color.as_ref().unwrap_or(&self.color).apply(
                &mut fabric,
                dyes.as_ref(),
                |f| coordinates.unwrap_or_else(|| FabricCoordinates::along(COLUMNS, f)),
                context,
                library,
            )?;
            Some(fabric)
        };
        made.into_iter().map(fabric).collect()
    }
}

impl CurveFile {
    /// Reads one file; points become millimetres. Gives the scale, by which radii have not been multiplied yet.
    fn read(
        &self,
        path: &Path,
        frame: Option<f64>,
        context: &Context<'_>,
        warnings: &mut Vec<String>,
    ) -> Option<(CurveSet, f64)> {
        let options = ReadOptions { frame, ..self.options.clone() };
        let read = if stage::is_stage(path) && path.is_file() {
            let open = context.stages.open(path).map_err(CurveFileError::from);
            open.and_then(|stage| curve_file::read_stage(&stage, &options))
        } else {
            curve_file::read(path, &options)
        };
        let mut set = match read {
            Ok(set) => set,
            Err(error) => {
                context.error(self.span, error.to_string(), None);
                return None;
            }
        };
        if set.curves.is_empty() {
            let is_obj = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"));
            let hint =
                is_obj.then(|| "curves of an OBJ file are its lines (`l`); its triangles go into a [[mesh]]".into());
            context.error(self.span, format!("{}: it holds no curve that can be drawn", path.display()), hint);
            return None;
        }
        let mut note = |text: String| {
            // Of a stage that is read at several times, once.
            if !warnings.contains(&text) {
                warnings.push(text);
            }
        };
        set.notes.iter().for_each(|text| note(format!("{}: {text}", path.display())));
        // What a file knows of itself is so, whatever the scene says, which may have been written for another file.
        if let (Some(own), Some(asked)) = (set.unit_mm, self.unit)
            && own != asked
        {
            let path = path.display();
            note(format!("{path}: a unit of {own} mm is its own; the scene's, of {asked} mm, is not used"));
        }
        let scale = set.unit_mm.or(self.unit).unwrap_or(context.unit);
        set.curves.par_iter_mut().for_each(|c| c.points.iter_mut().for_each(|p| *p *= scale));
        Some((set, scale))
    }
}
