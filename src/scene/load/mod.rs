//! The renderer's keys: from a document to a checked [`Scene`], with every range, unit and default.
//!
//! All mistakes of a scene are reported together, each where it was written. Only when the text is sound are curve
//! files and images read.

mod cloth;
mod color;
mod definitions;
mod mesh;
mod motion;
mod pattern;
mod sequence;
mod settings;
mod view;
mod yarns;

use std::{
    fmt,
    path::{Path, PathBuf},
};

use glam::{DAffine3, DQuat, DVec3, EulerRot};

pub use definitions::{Definitions, load_definitions};

use super::{CurveKind, Fabric, Ground, Mode, Object, Scene, bounds, identity};
use crate::{
    geometry::fiber::packing,
    input::{
        diagnostic::{Diagnostic, Diagnostics, Sources, Span},
        document::{Document, MAX_FILE_BYTES, Value},
        reader::{Range, Reader},
    },
    light::Light,
};

/// What the command line adds to a scene file.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// `KEY=VALUE` of each `--set`.
    pub assignments: Vec<String>,
    /// Keys that have an option of their own: dotted path, value, and the option as it was given.
    pub settings: Vec<(String, Value, String)>,
    /// `--curves`: this file in place of the first fabric's curves.
    pub curves: Option<PathBuf>,
    /// `--frame`: the camera frames what there is.
    pub frame: bool,
}

/// Why a scene could not be loaded: text for the user, one or more messages with their places.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LoadError(pub String);

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.trim_end())
    }
}

impl std::error::Error for LoadError {}

/// Units of length and their millimetres.
const UNITS: [(&str, f64); 5] = [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("in", 25.4), ("um", 1e-3)];

/// What all parts of the loader share.
struct Context<'a> {
    sources: &'a Sources,
    diagnostics: &'a Diagnostics,
    /// Millimetres per unit of the scene.
    unit: f64,
}

impl Context<'_> {
    /// A path as it is meant: relative to the file that names it, or to where the program runs if an option does.
    fn resolve(&self, path: &str, span: Span) -> PathBuf {
        let source = span.source();
        let base = if self.sources.is_option(source) { None } else { Path::new(self.sources.name(source)).parent() };
        base.map_or_else(|| PathBuf::from(path), |base| base.join(path))
    }

    fn error(&self, span: Span, message: impl Into<String>, hint: Option<String>) {
        let diagnostic = Diagnostic::error(message).at(span);
        self.diagnostics.push(match hint {
            Some(hint) => diagnostic.hint(hint),
            None => diagnostic,
        });
    }

    /// A vector in the scene's unit, as millimetres.
    fn position(&self, v: [f64; 3]) -> DVec3 {
        DVec3::from(v) * self.unit
    }
}

/// Loads a scene file.
///
/// # Errors
/// Everything that is wrong with it, as text for the user.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, LoadError> {
    let name = path.display().to_string();
    let text = read_text(path).map_err(|problem| LoadError(format!("{name}: error: {problem}\n")))?;
    parse(&name, &text, options)
}

/// Loads a scene from its text; `name` is what messages call it, and paths are relative to where that would lie.
///
/// # Errors
/// Everything that is wrong with it, as text for the user.
pub fn parse(name: &str, text: &str, options: &LoadOptions) -> Result<Scene, LoadError> {
    let mut sources = Sources::new();
    let diagnostics = Diagnostics::new();
    match load_text(name, text, options, &mut sources, &diagnostics) {
        Some(mut scene) if !diagnostics.has_errors() => {
            if !diagnostics.is_empty() {
                scene.warnings.push(diagnostics.render(&sources).trim_end().to_owned());
            }
            Ok(scene)
        }
        _ => Err(LoadError(diagnostics.render(&sources))),
    }
}

/// The text of a scene, library or suite file.
///
/// # Errors
/// Why there is none, in words that may follow the file's name.
pub fn read_text(path: &Path) -> Result<String, String> {
    let meta = std::fs::metadata(path).map_err(|e| in_words(&e))?;
    if !meta.is_file() {
        return Err("not a file".to_owned());
    }
    if meta.len() > MAX_FILE_BYTES {
        return Err(format!("a scene file of {} bytes; at most {MAX_FILE_BYTES} are read", meta.len()));
    }
    let bytes = std::fs::read(path).map_err(|e| in_words(&e))?;
    String::from_utf8(bytes).map_err(|e| format!("byte {}: not UTF-8 text", e.utf8_error().valid_up_to()))
}

/// An input error without its number.
fn in_words(error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => "no such file".to_owned(),
        std::io::ErrorKind::PermissionDenied => "no permission to read it".to_owned(),
        _ => error.to_string(),
    }
}

fn load_text(
    name: &str,
    text: &str,
    options: &LoadOptions,
    sources: &mut Sources,
    diagnostics: &Diagnostics,
) -> Option<Scene> {
    let mut document = Document::parse(name, text, sources, diagnostics)?;
    merge_libraries(&mut document, sources, diagnostics);
    for (key, value, label) in &options.settings {
        document.set(key, value.clone(), label, sources, diagnostics);
    }
    for assignment in &options.assignments {
        document.apply_option(assignment, sources, diagnostics);
    }
    if diagnostics.has_errors() {
        return None;
    }
    build(name, &document, options, sources, diagnostics)
}

/// Adds the tables of the files under `library`; what the scene itself says wins.
fn merge_libraries(document: &mut Document, sources: &mut Sources, diagnostics: &Diagnostics) {
    let paths: Vec<(String, Span)> =
        Reader::new(document, diagnostics).strings("library").into_iter().map(|(p, s)| (p.to_owned(), s)).collect();
    for (path, span) in paths {
        let full = Context { sources, diagnostics, unit: 1.0 }.resolve(&path, span);
        match read_text(&full) {
            Ok(text) => {
                if let Some(library) = Document::parse(&full.display().to_string(), &text, sources, diagnostics) {
                    document.merge(library, sources);
                }
            }
            Err(problem) => diagnostics.push(
                Diagnostic::error(format!("cannot read the library {}: {problem}", full.display()))
                    .at(span)
                    .hint("paths are relative to the file that names them"),
            ),
        }
    }
}

fn build(
    name: &str,
    document: &Document,
    options: &LoadOptions,
    sources: &Sources,
    diagnostics: &Diagnostics,
) -> Option<Scene> {
    let root = Reader::new(document, diagnostics);
    root.strings("library");
    root.u64("schema", 1..=1);
    let unit = root.one_of_or("unit", 1.0, &UNITS);
    let context = Context { sources, diagnostics, unit };

    let render_table = root.table("render");
    let settings = settings::render(render_table.as_ref());
    let output = settings::output(root.table("output"));
    let tilted = render_table
        .as_ref()
        .is_none_or(|r| r.one_of_or("ply_intersection", true, &[("tilted", true), ("perpendicular", false)]));
    let mut detail = cloth::Detail::read(render_table.as_ref());
    if let Some(table) = render_table {
        table.finish();
    }
    let library = yarns::read(&root, &context, tilted);
    let fabric_tables = root.tables("fabric");
    if fabric_tables.is_empty() && options.curves.is_some() {
        root.error("`--curves` needs a [[fabric]] whose curves it replaces", None);
    }
    let plans: Vec<Option<cloth::FabricPlan>> = fabric_tables
        .into_iter()
        .enumerate()
        .map(|(i, table)| {
            let curves = if i == 0 { options.curves.as_deref() } else { None };
            cloth::plan(table, &context, &library, curves)
        })
        .collect();
    let materials = mesh::materials(&root, &context);
    let mesh_plans = mesh::meshes(&root, &context, &materials);
    let camera_plan = view::camera(&root, &context, options.frame);
    let light_plans = view::lights(&root, &context);
    let ground_plan = view::ground(&root, &context, &materials);
    root.finish();
    if diagnostics.has_errors() {
        return None;
    }
    detail.shutter = camera_plan.as_ref().and_then(view::CameraPlan::shutter);

    // The text is sound: now the files.
    let mut warnings = Vec::new();
    let mut fabrics: Vec<Fabric> = plans
        .into_iter()
        .flatten()
        .enumerate()
        .filter_map(|(i, plan)| plan.make(i, &context, &library, &detail, &mut warnings))
        .flatten()
        .collect();
    let mut made = Vec::new();
    let mut objects: Vec<Object> =
        mesh_plans.into_iter().flatten().filter_map(|plan| plan.make(&context, &mut made)).collect();
    let mut lights: Vec<Light> = light_plans.into_iter().flatten().filter_map(|l| l.make(&context)).collect();
    if diagnostics.has_errors() {
        return None;
    }
    cloth::tell_names_apart(&mut fabrics);

    // Single precision is kept for what is near: the middle of the cloth becomes the origin.
    let around =
        |objects: &[Object]| objects.iter().filter_map(|o| o.mesh.bounds()).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    let middle = bounds(&fabrics).or(around(&objects)).map_or(DVec3::ZERO, |(low, high)| 0.5 * (low + high));
    for fabric in &mut fabrics {
        fabric.transform(&DAffine3::from_translation(-middle));
    }
    for object in &mut objects {
        object.mesh.transform(&DAffine3::from_translation(-middle));
    }
    for light in &mut lights {
        light.translate(-middle);
    }
    let render = settings?;
    let aspect = f64::from(render.width) / f64::from(render.height);
    let frame = f64::from(render.frame.unwrap_or(1));
    let (camera, camera_path) = camera_plan?.make(&fabrics, &objects, middle, aspect, frame);
    let ground = ground_plan.and_then(|plan| {
        let height = plan.height.map(|h| h * unit - middle.y);
        let lowest = [bounds(&fabrics), around(&objects)].into_iter().flatten().map(|(low, _)| low.y);
        let lowest = lowest.reduce(f64::min).unwrap_or(0.0);
        if let Some(span) = plan.material.texture_span() {
            context.error(span, "the ground has no texture coordinates: give this material to a plane", None);
        }
        let material = plan.material.make(&context, &mut made)?;
        Some(Ground { height: height.unwrap_or(lowest) as f32, material })
    });
    if diagnostics.has_errors() {
        return None;
    }
    let mut scene = Scene {
        path: name.to_owned(),
        render,
        display: output.display,
        layers: output.layers,
        storage: output.storage,
        denoise: output.denoise,
        camera,
        camera_path,
        yarns: library.yarns.into_values().collect(),
        fibers: library.fibers.into_iter().collect(),
        fabrics,
        objects,
        materials: made.into_iter().map(|(_, material)| material).collect(),
        lights,
        ground,
        middle,
        identity: Vec::new(),
        fingerprint: String::new(),
        warnings,
    };
    keep_used(&mut scene);
    for lobe in scene.render.without.clone() {
        let of_yarns = scene.yarns.iter_mut().flat_map(|y| &mut y.fibers);
        for (_, fiber) in of_yarns.chain(&mut scene.fibers) {
            lobe.remove_from(fiber);
        }
    }
    warn_about_precision(&mut scene);
    warn_about_density(&mut scene);
    warn_about_standing_hairs(&mut scene);
    scene.identity = identity::identity(&scene);
    scene.fingerprint = identity::fingerprint(&scene.identity);
    Some(scene)
}

/// Drops kinds of yarn and fibre that no fabric uses: libraries hold many.
fn keep_used(scene: &mut Scene) {
    let (mut yarns, mut fibers) = (Vec::new(), Vec::new());
    let place_in = |kept: &mut Vec<usize>, index: usize| {
        kept.iter().position(|&k| k == index).unwrap_or_else(|| {
            kept.push(index);
            kept.len() - 1
        })
    };
    for fabric in &mut scene.fabrics {
        fabric.kind = match fabric.kind {
            CurveKind::Yarn(yarn) => CurveKind::Yarn(place_in(&mut yarns, yarn)),
            CurveKind::Fiber(fiber) => CurveKind::Fiber(place_in(&mut fibers, fiber)),
        };
    }
    scene.yarns = yarns.into_iter().map(|y| scene.yarns[y].clone()).collect();
    scene.fibers = fibers.into_iter().map(|f| scene.fibers[f].clone()).collect();
}

/// Explicit fibres that do not fit their ply overlap.
fn warn_about_density(scene: &mut Scene) {
    if scene.render.mode != Mode::Fiber {
        return;
    }
    for yarn in &scene.yarns {
        let fullest = yarn.plies.iter().map(|p| f64::from(p.fibers) * (p.fiber_radius / p.radius).powi(2));
        let fullest = fullest.fold(0.0, f64::max);
        if fullest > packing::DENSEST {
            scene.warnings.push(format!(
                "yarn `{}`: fibres would fill {:.0} % of a ply; above {:.0} % they overlap",
                yarn.name,
                100.0 * fullest,
                100.0 * packing::DENSEST
            ));
        }
    }
}

/// Fly-aways are made where yarns are when the shutter opens, and stay there.
fn warn_about_standing_hairs(scene: &mut Scene) {
    let hairy = |thread| matches!(thread, CurveKind::Yarn(yarn) if scene.yarns[yarn].flyaways.is_some());
    let still = scene.fabrics.iter().filter(|f| !f.motion.later.is_empty() && hairy(f.kind));
    let warnings = still.map(|f| format!("the fly-aways of `{}` stand still while the shutter is open", f.name));
    scene.warnings.extend(warnings.collect::<Vec<_>>());
}

/// Single-precision hits lose a percent of a radius where the scene is a hundred thousand radii wide.
fn warn_about_precision(scene: &mut Scene) {
    let Some((low, high)) = scene.bounds() else { return };
    let thinnest = scene.fabrics.iter().flat_map(|f| &f.curves).flat_map(|(_, r)| r).copied().fold(f64::MAX, f64::min);
    let ratio = 0.5 * (high - low).length() / thinnest;
    if ratio > 1e5 {
        scene.warnings.push(format!(
            "the scene is {ratio:.1e} times as wide as its thinnest yarn: positions of hits are uncertain by more than \
             0.2 % of that yarn's radius"
        ));
    }
}

/// `scale`, `rotate` (about x, then y, then z) and `translate` of a table.
fn placement(table: &Reader<'_>, context: &Context<'_>) -> DAffine3 {
    let scale = table.f64_or("scale", 1.0, Range::POSITIVE);
    let [rx, ry, rz] = table.vec3_or("rotate", [0.0; 3], Range::FINITE).map(radians);
    let translate = context.position(table.vec3_or("translate", [0.0; 3], Range::FINITE));
    let rotation = DQuat::from_euler(EulerRot::ZYX, rz, ry, rx);
    DAffine3::from_scale_rotation_translation(DVec3::splat(scale), rotation, translate)
}

/// Angles in files are degrees.
fn radians(degrees: f64) -> f64 {
    degrees.to_radians()
}

/// Twist angles: less than a quarter turn, or yarn would be infinitely long.
const TWIST: Range = Range::between(-89.9, 89.9);
