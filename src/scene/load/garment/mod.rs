//! `source = { type = "garment" }`: cloth laid on a mesh with its panels as texture coordinates.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use glam::{DVec2, DVec3};

use super::{
    super::{FabricMotion, GarmentFacts},
    Context, Range, Reader, UNITS,
    cloth::{Detail, Yarns},
    color::{self, ColorPlan, FabricCoordinates},
    mesh::prim_pattern,
    pattern,
    poses::{Frames, Moment, Pose, between},
    sequence::check_moves,
    weave,
    yarns::Library,
};
use crate::{
    geometry::{
        curve::{Basis, Curve},
        curve_file,
        garment::{Cloth, Garment, GarmentError, GarmentMesh, Laid, LaidYarn, Options, Report, SeamKind, Tension},
        mesh::Mesh,
        pattern::{
            chart::Chart,
            draft::Draft,
            knit::{self, Edges, Form, Knit},
            tile::Tile,
            weave::{Impossible, Weave},
        },
        stage::PrimPattern,
    },
    input::diagnostic::{Span, unknown_name},
};

/// Control points of a stitch unless asked otherwise.
const POINTS: u64 = 12;
/// Stitches per area times the square of their yarn's length, of relaxed plain knit (after Munden, "The Geometry and
/// Dimensional Properties of Plain-Knit Fabrics", 1959).
const MUNDEN: f64 = 23.1;
/// Below so many diameters of yarn in a stitch loops jam; above so many they are a net.
const TIGHTEST: f64 = 10.5;
const LOOSEST: f64 = 30.0;

/// What repeats, as it is written.
#[derive(Clone)]
enum Pattern {
    Knit { chart: Chart, yarn_per_stitch: Option<f64> },
    Weave { draft: Draft, crimp: f64 },
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
    group: Option<String>,
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
}

const SEAMS: [(&str, SeamKind); 3] =
    [("none", SeamKind::None), ("mattress", SeamKind::Mattress), ("overlock", SeamKind::Overlock)];

/// Grams of yarns of such lengths, mm, by their tex (grams in a kilometre); `None` where that of one is not known.
fn weight(lengths: &[f64], tex: &[Option<f64>]) -> Option<f64> {
    let all = lengths.iter().zip(tex).filter(|(length, _)| **length > 0.0);
    all.map(|(length, tex)| Some(length * 1e-6 * (*tex)?)).sum()
}

impl Rule {
    /// Tex of its yarn, or of the garment's `yarn` where it names none.
    fn tex(&self, yarn: &str, library: &Library) -> Option<f64> {
        library.yarns.get(self.yarn.as_deref().unwrap_or(yarn))?.tex
    }

    /// What messages call it.
    fn origin(&self, mesh: &Path) -> String {
        let group = self.group.as_ref().map_or(String::new(), |g| format!(", {g}"));
        format!("{}{group}, {}", mesh.display(), self.cloth.name)
    }
}

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
    prims: [Option<PrimPattern>; 2],
    /// Whether z points up, where the scene says so.
    z_up: Option<bool>,
    rules: Vec<Rule>,
}

/// Reads a garment: its source and the fabric's `gauge`, `grain` and `[[fabric.panel]]`.
pub(super) fn garment(
    source: &Reader<'_>,
    fabric: &Reader<'_>,
    context: &Context<'_>,
    yarns: &Yarns<'_>,
) -> Option<GarmentPlan> {
    let path =
        source.required_string("path").map(|p| context.resolve(p, source.span("path").unwrap_or(source.header())));
    let span = source.span("path").unwrap_or(source.header());
    let scale = source.f64_or("scale", 1.0, Range::POSITIVE);
    let unit = source.one_of("unit", &UNITS);
    let prims = [prim_pattern(source, "prim"), prim_pattern(source, "body_prim")];
    let z_up = source.one_of("up", &[("y", false), ("z", true)]);
    let uv_unit = source.one_of("uv_unit", &UNITS);
    let seam = source.one_of("seam", &SEAMS);
    let body = source.string("body").map(|p| {
        let span = source.span("body").unwrap_or(source.header());
        (context.resolve(p, span), span)
    });
    let near = source.table("near").and_then(|table| {
        let at = table.required_vec3("at", Range::FINITE).map(|at| context.position(at));
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
    let (gauge, per) = (stitch(fabric, None), per(fabric));
    let grain = grain(fabric);
    let first =
        own.clone().map(|cloth| Rule { group: None, cloth, stitch: gauge, grain, yarn: None, color: None, seam: None });
    let panels: Vec<Option<Rule>> = fabric
        .tables("panel")
        .into_iter()
        .map(|table| {
            if !table.has("group") {
                table.error("missing key `group`: which panels these are", Some("group = \"rib_*\""));
            }
            let group = table.string("group").map(str::to_owned);
            let own_cloth = table.table("cloth").map(|t| cloth(t, context));
            let yarn = table.string("yarn").map(str::to_owned);
            if let Some(name) = &yarn
                && !yarns.library.yarn_names.contains(name)
            {
                let (message, hint) = unknown_name("yarn", name, yarns.library.yarn_names.iter().map(String::as_str));
                table.error_at("yarn", message, Some(&hint));
            }
            let colored = ["rows", "columns", "motif", "tint", "vary"].iter().any(|k| table.has(k));
            let color = color::plan(&table, context, yarns.library);
            let rule = Rule {
                group: Some(group?),
                stitch: stitch(&table, Some(per)).or(gauge),
                grain: if table.has("grain") { self::grain(&table) } else { grain },
                cloth: match own_cloth {
                    Some(cloth) => cloth?,
                    None => own.clone()?,
                },
                yarn,
                color: colored.then_some(color),
                seam: table.one_of("seam", &SEAMS),
            };
            table.finish();
            Some(rule)
        })
        .collect();
    let knitted = own.as_ref().is_none_or(|c| !matches!(c.pattern, Pattern::Weave { .. }));
    let seam = seam.unwrap_or(if knitted { SeamKind::Mattress } else { SeamKind::Overlock });
    let mut rules = vec![first?];
    for panel in panels {
        rules.push(panel?);
    }
    Some(GarmentPlan { path: path?, span, unit, scale, uv_unit, seam, near, body, prims, z_up, rules })
}

fn grain(table: &Reader<'_>) -> f64 {
    super::radians(table.f64_or("grain", 0.0, Range::between(-360.0, 360.0)))
}

/// Millimetres in which the numbers of `gauge` are counted.
fn per(table: &Reader<'_>) -> f64 {
    let units = [("10 cm", 100.0), ("cm", 10.0), ("inch", 25.4), ("in", 25.4)];
    table.one_of_or("gauge_per", 100.0, &units)
}

/// Width and height of a stitch from `gauge`, mm.
pub(super) fn stitch(table: &Reader<'_>, outer: Option<f64>) -> Option<DVec2> {
    let own = if table.has("gauge_per") || outer.is_none() { per(table) } else { outer.unwrap_or(100.0) };
    let gauge = table.vec2("gauge", Range::between(1e-3, 1e6))?;
    Some(own / DVec2::from(gauge))
}

/// Reads `cloth = { .. }`.
fn cloth(table: Reader<'_>, context: &Context<'_>) -> Option<ClothPlan> {
    let span = table.header();
    let points = table.u64_or("points", POINTS, 4..=200) as usize;
    let kind = table.kind("type", &[("knit", 0), ("weave", 1), ("file", 2), ("stockinette", 3)]);
    let made = match kind {
        Some(0) => {
            let yarn_per_stitch = table.f64("yarn_per_stitch", Range::between(6.0, 60.0));
            let (name, chart, _) = pattern::chart(&table, context);
            chart.map(|chart| (name, Pattern::Knit { chart, yarn_per_stitch }))
        }
        Some(1) => {
            let crimp = table.f64_or("crimp", 0.5, Range::UNIT);
            let (name, drafted) = weave::draft(&table, context);
            drafted.map(|d| (name, Pattern::Weave { draft: d.draft, crimp }))
        }
        Some(2) => {
            let path = table.required_string("path");
            path.map(|p| {
                let path = context.resolve(p, table.span("path").unwrap_or(span));
                (path.display().to_string(), Pattern::File(path))
            })
        }
        Some(_) => Chart::named("stockinette")
            .map(|chart| ("stockinette".to_owned(), Pattern::Knit { chart, yarn_per_stitch: None })),
        None => None,
    };
    table.finish();
    let (name, pattern) = made?;
    Some(ClothPlan { pattern, name, points, span })
}

impl ClothPlan {
    /// What repeats, mm, of yarn of a radius.
    fn tile(
        &self,
        stitch: Option<DVec2>,
        radius: f64,
        context: &Context<'_>,
        warnings: &mut Vec<String>,
    ) -> Option<Tile> {
        let d = 2.0 * radius;
        let tell = |problem: String, hint: &str| {
            context.error(self.span, problem, Some(hint.to_owned()));
            None
        };
        match &self.pattern {
            Pattern::Knit { chart, yarn_per_stitch } => {
                let length = yarn_per_stitch
                    .or(stitch.map(|s| (MUNDEN * s.element_product()).sqrt() / d))
                    .unwrap_or(knit::YARN_PER_STITCH);
                if let Some(s) = stitch {
                    let about = format!(
                        "a stitch of {:.3} x {:.3} mm takes about {:.2} mm of yarn, {length:.1} diameters of {d:.3} mm",
                        s.x,
                        s.y,
                        length * d
                    );
                    if length < TIGHTEST || s.x < 2.0 * d || s.y < d {
                        let problem = format!("the yarn is too thick for this gauge: {about}");
                        let least = (MUNDEN * s.element_product()).sqrt() / 13.0 / 2.0;
                        return tell(problem, &format!("thinner yarn (radius about {least:.3} mm), or fewer stitches"));
                    }
                    if length > LOOSEST {
                        warnings.push(format!("the yarn is thin for this gauge: {about}; the cloth will be a net"));
                    }
                }
                let knit = Knit {
                    chart: chart.clone(),
                    stitches: 1,
                    rows: 1,
                    form: Form::Flat,
                    stitch_width: stitch.map(|s| s.x / d),
                    row_height: stitch.map(|s| s.y / d),
                    yarn_per_stitch: Some(length.clamp(6.0, 60.0)),
                    edges: Edges::Live,
                    points: knit::POINTS,
                    colors: None,
                };
                match Tile::of_knit(&knit, d) {
                    Ok(tile) => Some(tile),
                    Err(error) => tell(error.problem, &error.hint),
                }
            }
            Pattern::Weave { draft, crimp } => {
                let [warp_spacing, weft_spacing] = [stitch.map(|s| s.x), stitch.map(|s| s.y)];
                let own = Weave::of(draft.clone(), radius);
                let weave = Weave { warp_spacing, weft_spacing, crimp: Some(*crimp), ..own };
                match Tile::of_weave(&weave) {
                    Ok(tile) => Some(tile),
                    Err(Impossible::TooTight { warp, least }) => {
                        let which = if warp { "warp" } else { "weft" };
                        let problem = format!(
                            "the yarn is too thick for this gauge: {which} threads of {d:.3} mm need {least:.4} mm each"
                        );
                        tell(problem, "thinner yarn, fewer threads, or another `crimp`")
                    }
                    Err(_) => tell("the draft is too large for a garment".to_owned(), "a smaller repeat"),
                }
            }
            Pattern::File(path) => match curve_file::read_tile(path) {
                Err(error) => tell(error.to_string(), "a periodic curve file (.pyp)"),
                Ok(tile) => Some(match stitch {
                    None => tile,
                    Some(s) => {
                        let own = tile.stitch();
                        let scale = (s.element_product() / own.element_product()).sqrt();
                        let period = s * DVec2::new(f64::from(tile.counts[0]), f64::from(tile.counts[1]));
                        tile.scaled(scale).pulled(period, 200)
                    }
                }),
            },
        }
    }
}

/// What a rule has become: curves of one kind of yarn.
pub(super) struct MadePanels {
    pub(super) origin: String,
    /// The yarn's name, if it is not the fabric's.
    pub(super) yarn: Option<String>,
    pub(super) color: Option<ColorPlan>,
    pub(super) curves: Vec<(Curve, Vec<f64>)>,
    /// From which of the curves on they lie on the panel of a name.
    pub(super) panels: Vec<(usize, String)>,
    pub(super) coordinates: FabricCoordinates,
    pub(super) motion: FabricMotion,
}

impl GarmentPlan {
    /// Reads the mesh and lays the yarns, unless only facts are wanted.
    #[expect(clippy::too_many_arguments, reason = "each is needed once, by name")]
    pub(super) fn make(
        self,
        (yarn, radius): (&str, f64),
        tension: Option<Tension>,
        colored: bool,
        context: &Context<'_>,
        library: &Library,
        detail: &Detail,
        warnings: &mut Vec<String>,
    ) -> Option<(Vec<MadePanels>, GarmentFacts)> {
        let cloths = self.cloths(radius, context, library, warnings);
        let frames = Frames::find(&self.path, detail);
        let (read, own_unit) = self.read(&frames, context)?;
        let unit = self.unit.or(own_unit).unwrap_or(context.unit) * self.scale;
        let rest = &read[&frames.rest];
        let cloths = cloths?;
        let sizes: Vec<DVec2> = cloths.iter().map(|c| c.tile.stitch()).collect();
        let overlap = cloths.iter().filter_map(|c| c.tile.overlap()).max_by(|a, b| a.share.total_cmp(&b.share));
        let options = Options {
            unit_mm: unit,
            uv_mm: self.uv_unit,
            cloths,
            seam: self.seam,
            tension,
            coordinates: colored || self.rules.iter().any(|r| r.color.is_some()),
            near: self.near,
        };
        let garment = Garment::new(rest, options).map_err(|error| self.tell(error, context)).ok()?;
        let mut notes = garment.report().notes.clone();
        let tex: Vec<Option<f64>> = self.rules.iter().map(|rule| rule.tex(yarn, library)).collect();
        let mut facts = GarmentFacts {
            weight: weight(&garment.report().yarn_length, &tex),
            overlap: overlap.map(|o| [o.share, o.deepest]),
            ..self.facts(garment.report())
        };
        let meshes = self.posed(&frames, &read, context)?;
        let kept = kept(&meshes, frames.shown);
        let shown = kept.iter().filter(|i| **i < frames.shown).count();
        check_moves(&kept[1..shown], &kept[shown..], self.span, detail, context)?;
        if detail.survey {
            facts.repairs.clone_from(&notes);
            return Some((self.not_laid(&garment, &sizes, shown), facts));
        }
        let mut meshes: Vec<GarmentMesh> =
            meshes.into_iter().enumerate().filter(|(i, _)| kept.contains(i)).map(|(_, mesh)| mesh).collect();
        // Plies wind by lengths in the first frame, so that they keep their places from frame to frame.
        let with_rest = frames.animated && (meshes.len() > 1 || meshes[0].points != rest.points);
        let times = meshes.len();
        if with_rest {
            meshes.push(rest.clone());
        }
        let bodies = self.bodies(&kept, unit, with_rest, detail, context)?;
        let all: Vec<&GarmentMesh> = meshes.iter().collect();
        let body: Vec<&Mesh> = bodies.iter().collect();
        let mut laid = match garment.lay(rest, &all, &body, &mut notes) {
            Ok(laid) => laid,
            Err((_, problem)) => {
                context.error(self.span, problem, None);
                return None;
            }
        };
        let names: Vec<String> = garment.report().panels.iter().map(|p| p.group.clone()).collect();
        drop(garment);
        let at_rest = if with_rest { laid.pop() } else { None };
        debug_assert_eq!(laid.len(), times);
        let mut later = laid.split_off(1);
        let flow = later.split_off(shown - 1);
        let first = laid.pop()?;
        let lengths: Vec<f64> = first.iter().map(|yarns| length(yarns)).collect();
        facts.yarn_length = lengths.iter().sum();
        facts.weight = weight(&lengths, &tex);
        facts.repairs = notes;
        Some((self.made(first, [later, flow], at_rest, (&sizes, &names)), facts))
    }

    /// The relaxed tile of each rule, for yarns of `radius` where the rule names none.
    fn cloths(
        &self,
        radius: f64,
        context: &Context<'_>,
        library: &Library,
        warnings: &mut Vec<String>,
    ) -> Option<Vec<Cloth>> {
        let made = self.rules.iter().map(|rule| {
            let yarn = rule.yarn.as_ref().and_then(|name| library.yarns.get(name));
            let tile = rule.cloth.tile(rule.stitch, yarn.map_or(radius, |yarn| yarn.radius), context, warnings)?;
            let (group, points) = (rule.group.clone(), rule.cloth.points);
            Some(Cloth { group, tile, grain: rule.grain, points, seam: rule.seam })
        });
        made.collect()
    }

    /// The meshes of all moments, and the unit that their file has, mm.
    fn read(&self, frames: &Frames, context: &Context<'_>) -> Option<(BTreeMap<Moment, GarmentMesh>, Option<f64>)> {
        let mut read = BTreeMap::new();
        let mut own_unit = None;
        for moment in frames.moments() {
            let found = moment.garment(self.prims[0].as_ref(), self.z_up, context);
            let (mesh, unit) = found.map_err(|error| self.tell(error, context)).ok()?;
            own_unit = unit;
            read.insert(moment.clone(), mesh);
        }
        Some((read, own_unit))
    }

    fn tell(&self, error: GarmentError, context: &Context<'_>) {
        let hint = Some(error.hint.clone()).filter(|h| !h.is_empty());
        let unnamed = error.line > 0 && error.path.is_none();
        let error = if unnamed { GarmentError { path: Some(self.path.clone()), ..error } } else { error };
        context.error(self.span, error.to_string(), hint);
    }

    /// What is known before yarns are laid; of their weight and overlap nothing.
    fn facts(&self, report: &Report) -> GarmentFacts {
        GarmentFacts {
            path: self.path.display().to_string(),
            cloth: self.rules[0].cloth.name.clone(),
            panels: report.panels.iter().map(|p| p.group.clone()).zip(report.stitches.iter().copied()).collect(),
            stitches: report.all_stitches(),
            yarn_length: report.yarn_length.iter().sum(),
            weight: None,
            overlap: None,
            control_points: report.control_points,
            uv_ratio: [report.ratio.p5, report.ratio.p50, report.ratio.p95],
            stretched: report.stretched,
            uv_mm: report.uv_mm,
            bounds: report.bounds,
            repairs: Vec::new(),
        }
    }

    /// The garment's mesh in every pose; all must have the faces of the one at rest.
    fn posed(
        &self,
        frames: &Frames,
        read: &BTreeMap<Moment, GarmentMesh>,
        context: &Context<'_>,
    ) -> Option<Vec<GarmentMesh>> {
        let mut meshes = Vec::new();
        for pose in &frames.poses {
            let (a, b) = (&read[&pose.before], &read[&pose.after]);
            for (mesh, moment) in [(a, &pose.before), (b, &pose.after)] {
                if let Err(problem) = read[&frames.rest].same_topology(mesh) {
                    let message = format!("{}: {problem}", moment.path.display());
                    context.error(self.span, message, Some("all frames have the same faces".to_owned()));
                    return None;
                }
            }
            meshes.push(between(a, b, pose.share));
        }
        Some(meshes)
    }

    /// What a survey tells of each rule that has panels: all but its yarns, which are not laid.
    fn not_laid(self, garment: &Garment, sizes: &[DVec2], shown: usize) -> Vec<MadePanels> {
        let mut out = Vec::new();
        for (i, rule) in self.rules.into_iter().enumerate() {
            let Some(counts) = garment.counts(i) else { continue };
            // The place of the last stitch says how many there are.
            let last = counts.map(|n| n as f32 - 0.5);
            out.push(MadePanels {
                origin: rule.origin(&self.path),
                yarn: rule.yarn,
                color: rule.color,
                curves: Vec::new(),
                panels: Vec::new(),
                coordinates: FabricCoordinates::laid(vec![vec![last]], garment.kinds(i), sizes[i].as_vec2().to_array()),
                motion: FabricMotion { later: vec![Vec::new(); shown - 1], ..FabricMotion::default() },
            });
        }
        out
    }

    /// Yarns as curves, for each rule that has any; `sizes` are those of its stitches, mm, and `names` of all panels.
    fn made(
        self,
        first: Laid,
        [mut later, mut flow]: [Vec<Laid>; 2],
        mut rest: Option<Laid>,
        (sizes, names): (&[DVec2], &[String]),
    ) -> Vec<MadePanels> {
        let points = |laid: &mut Laid, rule: usize| -> Vec<Vec<DVec3>> {
            std::mem::take(&mut laid[rule]).into_iter().map(|yarn| yarn.points).collect()
        };
        let mut out = Vec::new();
        for (i, (yarns, rule)) in first.into_iter().zip(self.rules).enumerate() {
            if yarns.is_empty() {
                continue;
            }
            let motion = FabricMotion {
                later: later.iter_mut().map(|laid| points(laid, i)).collect(),
                rest: rest.as_mut().map(|laid| points(laid, i)),
                flow: flow.iter_mut().map(|laid| points(laid, i)).collect(),
            };
            let mut panels: Vec<(usize, String)> = Vec::new();
            for (k, yarn) in yarns.iter().enumerate() {
                let name = &names[yarn.panel as usize];
                if panels.last().is_none_or(|(_, before)| before != name) {
                    panels.push((k, name.clone()));
                }
            }
            let mut kinds = Vec::with_capacity(yarns.len());
            let mut places = Vec::with_capacity(yarns.len());
            let curves = yarns
                .into_iter()
                .map(|LaidYarn { points, closed, radius, kind, coordinates, .. }| {
                    kinds.push(kind);
                    places.push(coordinates);
                    let radii = vec![radius; points.len()];
                    (Curve { basis: Basis::BSpline, closed, points, radii: None, flattening: None }, radii)
                })
                .collect();
            out.push(MadePanels {
                origin: rule.origin(&self.path),
                yarn: rule.yarn,
                color: rule.color,
                curves,
                panels,
                coordinates: FabricCoordinates::laid(places, kinds, sizes[i].as_vec2().to_array()),
                motion,
            });
        }
        out
    }

    /// The body in each pose that is kept.
    fn bodies(
        &self,
        kept: &[usize],
        unit: f64,
        with_rest: bool,
        detail: &Detail,
        context: &Context<'_>,
    ) -> Option<Vec<Mesh>> {
        let Some((path, span)) = &self.body else { return Some(Vec::new()) };
        let own = Frames::find(path, detail);
        let mut read: BTreeMap<Moment, Mesh> = BTreeMap::new();
        for moment in own.moments() {
            match moment.body(self.prims[1].as_ref(), self.z_up, context) {
                Ok((mut mesh, own_unit)) => {
                    // A body without a unit of its own has the garment's.
                    let scale = self.unit.or(own_unit).map_or(unit, |mm| mm * self.scale);
                    mesh.transform(&glam::DAffine3::from_scale(DVec3::splat(scale)));
                    read.insert(moment.clone(), mesh);
                }
                Err(problem) => {
                    context.error(*span, problem, None);
                    return None;
                }
            }
        }
        let posed = |pose: &Pose| {
            let (a, b) = (&read[&pose.before], &read[&pose.after]);
            let mut mesh = a.clone();
            if a.points.len() == b.points.len() {
                mesh.points = a.points.iter().zip(&b.points).map(|(a, b)| a.lerp(*b, pose.share)).collect();
            }
            mesh
        };
        let last = own.poses.len() - 1;
        let mut out: Vec<Mesh> = kept.iter().map(|&i| posed(&own.poses[i.min(last)])).collect();
        if with_rest {
            out.push(read[&own.rest].clone());
        }
        Some(out)
    }
}

/// Which poses are laid: one where nothing moves while the shutter is open, and those behind `shown` if anything moves
/// from one of them to the next.
fn kept(meshes: &[GarmentMesh], shown: usize) -> Vec<usize> {
    let moves = |poses: &[GarmentMesh]| poses.windows(2).any(|pair| pair[0].points != pair[1].points);
    let mut kept: Vec<usize> = if moves(&meshes[..shown]) { (0..shown).collect() } else { vec![0] };
    if moves(&meshes[shown..]) {
        kept.extend(shown..meshes.len());
    }
    kept
}

/// Length of yarns, mm: between the places where segments of their B-splines join.
fn length(yarns: &[LaidYarn]) -> f64 {
    let of = |yarn: &LaidYarn| {
        let knot = |w: &[DVec3]| (w[0] + 4.0 * w[1] + w[2]) / 6.0;
        yarn.points.windows(4).map(|w| knot(&w[..3]).distance(knot(&w[1..]))).sum::<f64>()
    };
    // Chords are a little shorter than what they span: by two percent for loops of twelve points.
    yarns.iter().map(of).sum()
}
