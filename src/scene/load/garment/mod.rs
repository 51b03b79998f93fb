//! `source = { type = "garment" }`: cloth laid on a mesh with its panels as texture coordinates.

mod make;

use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};

use super::{
    Context, Range, Reader, UNITS,
    color::{self, ColorPlan},
    gauge::{per, stitch},
    known_yarns::{KnownYarns, thickness},
    mesh::{mesh_choice, prim_pattern, refuse_prim},
    pattern::{self, Stranding},
    weave, z_up,
};
use crate::{
    files::{
        curve_file,
        stage::{MeshChoice, PrimPattern},
    },
    garment::{Hem, HemKind, PanelChoice, SeamKind},
    input::diagnostic::Span,
    pattern::{
        chart::Chart,
        draft::{Draft, Threads},
        knit::{self, Edges, Form, Knit, Misfit, STITCHES_PER_SQUARE, Thickness, fits_stitch},
        tile::Tile,
        weave::{FLATTEN, Impossible, Weave},
    },
    scene::Yarn,
};

/// Control points of a stitch unless asked otherwise.
const POINTS: u64 = 12;
/// Above so many diameters of yarn in a stitch loops are a net.
const LOOSEST: f64 = 30.0;

/// What repeats, as it is written.
#[derive(Clone)]
enum Pattern {
    Knit {
        chart: Chart,
        yarn_per_stitch: Option<f64>,
        flatten: f64,
        stranding: Option<Stranding>,
    },
    /// A draft, how its threads differ, the warp's share of the crimp, and how flat yarns are.
    Weave {
        draft: Draft,
        threads: [Threads; 2],
        crimp: Option<f64>,
        flatten: f64,
    },
    File(PathBuf),
}

#[derive(Clone)]
struct ClothPlan {
    pattern: Pattern,
    name: String,
    points: usize,
    span: Span,
}

/// A panel's own cloth, or the fabric's.
struct Rule {
    panels: Option<PanelChoice>,
    /// What mattes call it, if not as the fabric.
    name: Option<String>,
    /// Where that stands; of the fabric's own cloth, where the mesh is named.
    span: Span,
    cloth: ClothPlan,
    /// Width and height of a stitch, mm.
    stitch: Option<DVec2>,
    grain: f64,
    /// Its yarn, if it is not the fabric's.
    yarn: Option<String>,
    /// Its colours, if they are not the fabric's.
    color: Option<ColorPlan>,
    /// How it is sewn, if not as all are.
    seam: Option<SeamKind>,
    /// How its free edges are hemmed, and whether it says so itself.
    hem: Option<Hem>,
    hems_itself: bool,
}

/// What a table says of hems.
#[derive(Clone, Copy)]
struct HemKeys {
    kind: Option<Option<HemKind>>,
    /// Millimetres.
    width: Option<f64>,
}

const HEMS: [(&str, Option<HemKind>); 4] = [
    ("none", None),
    ("coverstitch", Some(HemKind::Coverstitch)),
    ("lockstitch", Some(HemKind::Lockstitch)),
    ("folded", Some(HemKind::Folded)),
];
/// Width of a hem of which none is given, mm.
const HEM_WIDTH: f64 = 20.0;

impl HemKeys {
    fn read(table: &Reader<'_>, context: &Context<'_>) -> Self {
        let width = table.f64("hem_width", Range::POSITIVE).map(|w| w * context.unit);
        Self { kind: table.one_of("hem", &HEMS), width }
    }

    /// The hem of a table, which has what `outer` says where it says nothing.
    fn hem(self, table: &Reader<'_>, outer: Option<Self>) -> Option<Hem> {
        let kind = self.kind.or(outer.and_then(|o| o.kind)).flatten();
        if kind.is_none() && self.width.is_some() {
            table.error_at("hem_width", "a width of a hem where there is none", Some("hem = \"coverstitch\""));
        }
        let width = self.width.or(outer.and_then(|o| o.width)).unwrap_or(HEM_WIDTH);
        kind.map(|kind| Hem { kind, width })
    }
}

const SEAMS: [(&str, SeamKind); 3] =
    [("none", SeamKind::None), ("mattress", SeamKind::Mattress), ("overlock", SeamKind::Overlock)];

/// A garment whose text is sound and whose mesh is not read yet.
pub(super) struct GarmentPlan {
    path: PathBuf,
    span: Span,
    /// Millimetres, where the scene says so, and what they are multiplied by.
    unit: Option<f64>,
    scale: f64,
    uv_unit: Option<f64>,
    seam: SeamKind,
    /// Place and radius of what is laid, mm, if that is not all.
    near: Option<(DVec3, f64)>,
    body: Option<(PathBuf, Span)>,
    /// Which meshes of a stage are the garment, and which its body.
    choices: [MeshChoice; 2],
    /// Whether z points up, where the scene says so.
    z_up: Option<bool>,
    rules: Vec<Rule>,
}

/// Reads a garment: its source and the fabric's `gauge`, `grain` and `[[fabric.panel]]`.
pub(super) fn garment(
    source: &Reader<'_>,
    fabric: &Reader<'_>,
    context: &Context<'_>,
    yarns: &KnownYarns<'_>,
) -> Option<GarmentPlan> {
    let path =
        source.required_string("path").map(|p| context.resolve(p, source.span("path").unwrap_or(source.header())));
    let span = source.span("path").unwrap_or(source.header());
    let scale = source.f64_or("scale", 1.0, Range::POSITIVE);
    let unit = source.one_of("unit", &UNITS);
    let body_prims = prim_pattern(source, "body_prim").unwrap_or_else(PrimPattern::all);
    let choices = [mesh_choice(source), MeshChoice { prims: body_prims, uv: None }];
    let z_up = z_up(source);
    let uv_unit = source.one_of("uv_unit", &UNITS);
    let seam = source.one_of("seam", &SEAMS);
    let hem_keys = HemKeys::read(source, context);
    let hem = hem_keys.hem(source, None);
    let body = source.string("body").map(|p| {
        let span = source.span("body").unwrap_or(source.header());
        (context.resolve(p, span), span)
    });
    if let Some(path) = &path {
        refuse_prim(source, "prim", path);
        refuse_prim(source, "uv", path);
        refuse_prim(source, "body_prim", body.as_ref().map_or(path, |(body, _)| body));
    }
    let near = source.table("near").and_then(|table| {
        let at = table.required_vec3("at", Range::PLACE).map(|at| context.position(at));
        let radius = table.required_f64("radius", Range::POSITIVE).map(|r| r * context.unit);
        table.finish();
        at.zip(radius)
    });
    let own = match source.table("cloth") {
        Some(table) => cloth(table, context),
        None => {
            source.error(
                "missing table `cloth`: what is laid on the garment",
                Some("cloth = { type = \"knit\", pattern = \"stockinette\" }"),
            );
            None
        }
    };
    let knitted = own.as_ref().is_none_or(|c| !matches!(c.pattern, Pattern::Weave { .. }));
    let seam = seam.unwrap_or(if knitted { SeamKind::Mattress } else { SeamKind::Overlock });
    let whole =
        WholeFabric { cloth: own, stitch: stitch(fabric, None), per: per(fabric), grain: grain(fabric), hem_keys };
    let first = whole.cloth.clone().map(|cloth| Rule {
        panels: None,
        name: None,
        span,
        cloth,
        stitch: whole.stitch,
        grain: whole.grain,
        yarn: None,
        color: None,
        seam: None,
        hem,
        hems_itself: false,
    });
    let panels: Vec<Option<Rule>> =
        fabric.tables("panel").into_iter().map(|table| whole.panel(table, context, yarns)).collect();
    let rules = std::iter::once(first).chain(panels).collect::<Option<Vec<Rule>>>()?;
    Some(GarmentPlan { path: path?, span, unit, scale, uv_unit, seam, near, body, choices, z_up, rules })
}

/// What panels have where they say nothing else.
struct WholeFabric {
    cloth: Option<ClothPlan>,
    /// Of the `gauge`, and the length that it counts in.
    stitch: Option<DVec2>,
    per: f64,
    grain: f64,
    hem_keys: HemKeys,
}

impl WholeFabric {
    /// Reads a `[[fabric.panel]]`.
    fn panel(&self, table: Reader<'_>, context: &Context<'_>, yarns: &KnownYarns<'_>) -> Option<Rule> {
        let panels = chosen(&table);
        let name = table.string("name").map(str::to_owned);
        if name.as_ref().is_some_and(String::is_empty) {
            table.error_at("name", "the name of a panel cannot be empty", None);
        }
        let own_cloth = table.table("cloth").map(|t| cloth(t, context));
        let yarn = table.string("yarn").map(str::to_owned);
        if let Some(name) = &yarn {
            context.check_yarn(table.span("yarn").unwrap_or(table.header()), name, yarns.library);
        }
        let colored = ["rows", "columns", "motif", "tint", "vary"].iter().any(|k| table.has(k));
        let color = color::plan(&table, context, yarns.library);
        if color.tension().is_some() {
            table.error_at("vary", "`tension` is of the whole garment", Some("`vary` of the fabric"));
        }
        let own_hem = HemKeys::read(&table, context);
        let hem = own_hem.hem(&table, Some(self.hem_keys));
        let rule = Rule {
            panels: Some(panels?),
            name,
            span: table.span("group").or(table.span("panel")).unwrap_or(table.header()),
            stitch: stitch(&table, Some(self.per)).or(self.stitch),
            grain: if table.has("grain") { grain(&table) } else { self.grain },
            cloth: match own_cloth {
                Some(cloth) => cloth?,
                None => self.cloth.clone()?,
            },
            yarn,
            color: colored.then_some(color),
            seam: table.one_of("seam", &SEAMS),
            hem,
            hems_itself: own_hem.kind.is_some(),
        };
        table.finish();
        Some(rule)
    }
}

/// `group` or `panel` of a `[[fabric.panel]]`.
fn chosen(table: &Reader<'_>) -> Option<PanelChoice> {
    let (group, number) = (table.string("group"), table.u64("panel", 1..=u64::from(u32::MAX)));
    match (table.has("group"), table.has("panel")) {
        (true, true) => table.error_at("panel", "give `group` or `panel`, not both", None),
        (false, false) => {
            let hint = "group = \"rib_*\", or panel = 1 of those that `info` counts";
            table.error("missing key `group` or `panel`: which panels these are", Some(hint));
        }
        _ => {}
    }
    group.map(|name| PanelChoice::Named(name.to_owned())).or(number.map(|n| PanelChoice::Numbered(n as usize)))
}

fn grain(table: &Reader<'_>) -> f64 {
    super::radians(table.f64_or("grain", 0.0, Range::between(-360.0, 360.0)))
}

/// What lies on a garment.
#[derive(Clone, Copy)]
enum ClothKind {
    Knit,
    Weave,
    File,
    Stockinette,
}

/// Reads `cloth = { .. }`.
fn cloth(table: Reader<'_>, context: &Context<'_>) -> Option<ClothPlan> {
    let span = table.header();
    let points = table.u64_or("points", POINTS, 4..=200) as usize;
    let kinds = [
        ("knit", ClothKind::Knit),
        ("weave", ClothKind::Weave),
        ("file", ClothKind::File),
        ("stockinette", ClothKind::Stockinette),
    ];
    let kind = table.kind("type", &kinds);
    let made = match kind {
        Some(ClothKind::Knit) => {
            let [shortest, longest] = knit::YARNS_PER_STITCH;
            let yarn_per_stitch = table.f64("yarn_per_stitch", Range::between(shortest, longest));
            let flatten = pattern::flatten(&table);
            let stranding = pattern::work_of_tile(&table);
            let pattern::Charted { name, chart, .. } = pattern::chart(&table, context);
            chart.map(|chart| (name, Pattern::Knit { chart, yarn_per_stitch, flatten, stranding }))
        }
        Some(ClothKind::Weave) => {
            let crimp = table.f64("crimp", Range::UNIT);
            let flatten = table.f64_or("flatten", FLATTEN, Range::between(1.0, 4.0));
            let (name, drafted) = weave::draft(&table, context);
            drafted.map(|d| {
                if d.draft.pile().is_some() {
                    let hint = "a draft without pile, or the cloth as a piece of its own";
                    table.error_at("draft", "no pile is laid on a garment", Some(hint));
                }
                if d.wif.as_ref().is_some_and(|wif| wif.colors.iter().any(|side| !side.is_empty())) {
                    let hint = "`columns` and `rows` of the fabric name the yarns of warps and wefts";
                    table.warning_at("draft", "colours of a draft's file are not used on a garment", Some(hint));
                }
                let threads = d.wif.map(|wif| wif.threads).unwrap_or_default();
                (name, Pattern::Weave { draft: d.draft, threads, crimp, flatten })
            })
        }
        Some(ClothKind::File) => {
            let path = table.required_string("path");
            path.map(|p| {
                let path = context.resolve(p, table.span("path").unwrap_or(span));
                (path.display().to_string(), Pattern::File(path))
            })
        }
        Some(ClothKind::Stockinette) => {
            let stranding = pattern::work_of_tile(&table);
            let flatten = pattern::flatten(&table);
            let knit = |chart| Pattern::Knit { chart, yarn_per_stitch: None, flatten, stranding };
            Chart::named("stockinette").map(|chart| ("stockinette".to_owned(), knit(chart)))
        }
        None => None,
    };
    table.finish();
    let (name, pattern) = made?;
    Some(ClothPlan { pattern, name, points, span })
}

impl ClothPlan {
    /// What repeats, mm, of yarn of a radius; fibres, which are no yarn, stay round.
    fn tile(
        &self,
        stitch: Option<DVec2>,
        (yarn, radius): (Option<&Yarn>, f64),
        context: &Context<'_>,
        warnings: &mut Vec<String>,
    ) -> Option<Tile> {
        let made = match &self.pattern {
            Pattern::Knit { chart, yarn_per_stitch, flatten, .. } => {
                let yarn = thickness(yarn, radius, *flatten);
                knit_tile(chart, &yarn, *yarn_per_stitch, stitch, warnings)
            }
            Pattern::Weave { draft, threads, crimp, flatten } => {
                let half_width = yarn.map_or(1.0, Yarn::half_width);
                let [warp_spacing, weft_spacing] = [stitch.map(|s| s.x), stitch.map(|s| s.y)];
                let (crimp, flatten, threads) = (*crimp, *flatten, threads.clone());
                let own = Weave { half_width: [half_width; 2], ..Weave::of(draft.clone(), radius * half_width) };
                weave_tile(&Weave { warp_spacing, weft_spacing, crimp, flatten, threads, ..own }, 2.0 * radius)
            }
            Pattern::File(path) => file_tile(path, stitch),
        };
        made.map_err(|misfit| context.error(self.span, misfit.problem, Some(misfit.hint))).ok()
    }
}

/// One repeat of a knit of yarn, which takes so many of its diameters a stitch, and of a stitch so large, mm.
fn knit_tile(
    chart: &Chart,
    yarn: &Thickness,
    yarn_per_stitch: Option<f64>,
    stitch: Option<DVec2>,
    warnings: &mut Vec<String>,
) -> Result<Tile, Misfit> {
    let (unit, d) = (yarn.pressed(), 2.0 * yarn.radius);
    let length = yarn_per_stitch
        .map(|diameters| diameters * d / unit)
        .or(stitch.map(|s| (STITCHES_PER_SQUARE * s.element_product()).sqrt() / unit))
        .unwrap_or(knit::YARN_PER_STITCH);
    if let Some(s) = stitch {
        fits_stitch(s.x / unit, s.y / unit, yarn)?;
        let diameters = length * unit / d;
        if diameters > LOOSEST {
            warnings.push(format!(
                "the yarn is thin for this gauge: a stitch of {:.3} x {:.3} mm takes about {:.2} mm of yarn, \
                 {diameters:.1} diameters of {d:.3} mm; the cloth will be a net",
                s.x,
                s.y,
                length * unit
            ));
        }
    }
    let knit = Knit {
        chart: chart.clone(),
        stitches: 1,
        rows: 1,
        form: Form::Flat,
        stitch_width: stitch.map(|s| s.x / unit),
        row_height: stitch.map(|s| s.y / unit),
        yarn_per_stitch: Some(length.clamp(knit::YARNS_PER_STITCH[0], knit::YARNS_PER_STITCH[1])),
        edges: Edges::Live,
        rims: knit::Rims::default(),
        points: knit::POINTS,
        colors: None,
        flat: true,
    };
    Tile::of_knit(&knit, yarn).map_err(|error| Misfit { key: None, problem: error.problem, hint: error.hint })
}

/// One repeat of a weave of yarn of a diameter, mm.
fn weave_tile(weave: &Weave, diameter: f64) -> Result<Tile, Misfit> {
    Tile::of_weave(weave).map_err(|error| match error {
        Impossible::TooTight { warp, least } => {
            let which = if warp { "warp" } else { "weft" };
            let problem = format!(
                "the yarn is too thick for this gauge: {which} threads of {diameter:.3} mm need {least:.4} mm each"
            );
            Misfit { key: None, problem, hint: "thinner yarn, fewer threads, or another `crimp`".to_owned() }
        }
        _ => Misfit {
            key: None,
            problem: "the draft is too large for a garment".to_owned(),
            hint: "a smaller repeat".to_owned(),
        },
    })
}

/// The cell of a periodic curve file, relaxed to a stitch of a size, mm, where one is wanted.
fn file_tile(path: &Path, stitch: Option<DVec2>) -> Result<Tile, Misfit> {
    let tile = curve_file::read_tile(path).map_err(|error| Misfit {
        key: None,
        problem: error.to_string(),
        hint: "a periodic curve file (.pyp)".to_owned(),
    })?;
    let Some(stitch) = stitch else { return Ok(tile) };
    let scale = (stitch.element_product() / tile.stitch().element_product()).sqrt();
    let period = stitch * DVec2::new(f64::from(tile.counts[0]), f64::from(tile.counts[1]));
    Ok(tile.scaled(scale).pulled(period, 200))
}
