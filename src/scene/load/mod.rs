//! The renderer's keys: from a document to a checked [`Scene`], with every range, unit and default.
//!
//! All mistakes of a scene are reported together, each where it was written. Only when the text is sound are curve
//! files and images read.

mod chart_picture;
mod cloth;
mod color;
mod definitions;
mod draft_picture;
mod dyes;
mod garment;
mod gauge;
mod knit_size;
mod known_yarns;
mod mesh;
mod motion;
mod pattern;
mod poses;
mod sequence;
mod settings;
mod stage_camera;
mod stages;
mod tint;
mod view;
mod weave;
mod yarns;

use std::{
    cell::RefCell,
    fmt,
    ops::RangeInclusive,
    path::{Path, PathBuf},
};

use glam::{DAffine3, DMat3, DQuat, DVec3, EulerRot};

pub use definitions::{Definitions, load_definitions};

use super::{
    LightGroups, RenderSettings, Scene,
    animation::numbered,
    builder::{OutputSettings, SceneBuilder},
    defaults,
    view::CameraSetup,
};
use crate::files::curve_file;
use crate::geometry::proposal::UNITS;
use crate::input::{
    diagnostic::{Diagnostic, Diagnostics, Sources, Span, hinted, unknown_name},
    document::{Document, MAX_FILE_BYTES, Value},
    reader::{Range, Reader},
    system::in_words,
};
use crate::light::Light;
use crate::math::words::counted;

/// What the command line adds to a scene file.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// `KEY=VALUE` of each `--set`.
    pub assignments: Vec<String>,
    /// Keys that have an option of their own: dotted path, value, and the option as it was given.
    pub settings: Vec<Setting>,
    /// `--curves`: this file in place of the first fabric's curves.
    pub curves: Option<PathBuf>,
    /// `--frame`: the camera frames what there is.
    pub frame: bool,
    /// Frames that follow this one: files of theirs that are missing are told at once.
    pub frames: Option<RangeInclusive<u32>>,
    /// Measure garments, but lay no yarns on them: they are in [`Scene::garments`] only.
    pub survey: bool,
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

/// From z up to y up: a quarter turn about x.
const Y_UP: DMat3 = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);

/// `up`: whether z points up in a file, where the scene says so.
fn z_up(table: &Reader<'_>) -> Option<bool> {
    table.one_of("up", &[("y", false), ("z", true)])
}

/// What all parts of the loader share.
struct Context<'a> {
    sources: &'a Sources,
    diagnostics: &'a Diagnostics,
    /// Millimetres per unit of the scene.
    unit: f64,
    /// Whether all libraries were read: else they may have what is not found.
    libraries_are_read: bool,
    /// Files that the text names, and where.
    named: RefCell<Vec<(PathBuf, Span)>>,
    /// Stages that are open.
    stages: stages::Stages,
}

impl<'a> Context<'a> {
    fn new(sources: &'a Sources, diagnostics: &'a Diagnostics, unit: f64, libraries_are_read: bool) -> Self {
        Self {
            sources,
            diagnostics,
            unit,
            libraries_are_read,
            named: RefCell::default(),
            stages: stages::Stages::default(),
        }
    }
}

impl Context<'_> {
    /// A path as it is meant: relative to the file that names it, or to where the program runs if an option does.
    fn resolve(&self, path: &str, span: Span) -> PathBuf {
        let source = span.source();
        let base = if self.sources.is_option(source) { None } else { Path::new(self.sources.name(source)).parent() };
        let path = base.map_or_else(|| PathBuf::from(path), |base| base.join(path));
        self.named.borrow_mut().push((path.clone(), span));
        path
    }

    /// Tells what is wrong with a file that is read with the text; it is not told again as a missing one.
    fn wrong_file(&self, path: &Path, span: Span, problem: String) {
        self.named.borrow_mut().retain(|(named, _)| named != path);
        self.error(span, problem, None);
    }

    /// Tells which of the named files are not there. Where the text has mistakes, no file is read; this at least is found
    /// out with them.
    fn tell_missing_files(&self) {
        for (path, span) in self.named.borrow().iter() {
            // One of a sequence is found when its number is known.
            if !path.exists() && numbered(path, 0).is_none() {
                self.error(*span, format!("{}: no such file", path.display()), None);
            }
        }
    }

    /// Tells which files of numbered ones are missing for some of these frames.
    fn tell_missing_frames(&self, frames: &RangeInclusive<u32>) {
        for (path, span) in self.named.borrow().iter().filter(|(path, _)| !path.exists()) {
            /// Of more it is told that there are so many.
            const MANY: usize = 1000;
            let mut missing = frames.clone().filter_map(|frame| numbered(path, frame)).filter(|file| !file.exists());
            if let Some(first) = missing.next() {
                let (others, of) = (missing.take(MANY).count(), format!("{} to {}", frames.start(), frames.end()));
                let more = match others {
                    0 => String::new(),
                    MANY => format!(", and {MANY} or more others of frames {of}"),
                    _ => format!(", and {} of frames {of}", counted(others, "other")),
                };
                self.error(*span, format!("{}: no such file{more}", first.display()), None);
            }
        }
    }

    /// Tells of a name of this kind (`yarn`, `fiber`, `material`) that nothing has; nothing is told where a library is
    /// missing that may have it.
    fn unknown<'n>(&self, span: Span, kind: &str, name: &str, names: impl Iterator<Item = &'n str> + Clone) {
        if self.libraries_are_read {
            let (message, hint) = unknown_name(kind, name, names);
            self.error(span, message, Some(hint));
        }
    }

    /// Tells of a yarn or a fibre (`kind`) that neither the scene nor the library inside the program has.
    fn unknown_thread<'n>(&self, span: Span, kind: &'n str, name: &str, names: &'n [String]) {
        let built_in = definitions::built_in_names(kind).filter(|of| !names.iter().any(|name| name == of));
        let built_in = built_in.map(|of| -> &'n str { of });
        self.unknown(span, kind, name, names.iter().map(String::as_str).chain(built_in));
    }

    /// Tells where no yarn has such a name.
    fn check_yarn(&self, span: Span, name: &str, library: &yarns::Library) {
        if !library.yarn_names.iter().any(|n| n == name) {
            self.unknown_thread(span, "yarn", name, &library.yarn_names);
        }
    }

    fn error(&self, span: Span, message: impl Into<String>, hint: Option<String>) {
        let diagnostic = Diagnostic::error(message).at(span);
        self.diagnostics.push(match hint {
            Some(hint) => diagnostic.hint(hint),
            None => diagnostic,
        });
    }

    fn warning(&self, span: Span, message: impl Into<String>) {
        self.diagnostics.push(Diagnostic::warning(message).at(span));
    }

    /// Of what is read for several frames: the same is said once.
    fn warning_once(&self, span: Span, message: impl Into<String>) {
        self.diagnostics.push_once(Diagnostic::warning(message).at(span));
    }

    /// Millimetres of a unit, of the file's own and the one that the scene says. What a file knows of itself is so, whatever
    /// the scene says, which may have been written for another file; told if they differ.
    fn unit_of(&self, (path, span): (&Path, Span), own: Option<f64>, asked: Option<f64>) -> Option<f64> {
        if let (Some(own), Some(asked)) = (own, asked)
            && (own - asked).abs() > 1e-6 * asked
        {
            let path = path.display();
            self.warning_once(
                span,
                format!("{path}: a unit of {own} mm is its own; the scene's, of {asked} mm, is not used"),
            );
        }
        own.or(asked)
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
    if curve_file::can_read(path) && path.is_file() {
        let hint = format!(
            "`yarnray render SCENE.toml --curves {name}` renders it in a scene, such as scenes/glove.toml; `yarnray info {name}` tells \
             what it holds\n"
        );
        return Err(LoadError(hinted(format!("{name}: error: a file of curves or meshes is no scene"), hint)));
    }
    let text = read_text(path).map_err(|problem| LoadError(format!("{name}: error: {problem}\n")))?;
    parse(&name, &text, options)
}

/// Loads a scene from its text; `name` is what messages call it, and paths are relative to where that would lie.
///
/// ```
/// use yarnray::scene::load::{LoadOptions, parse};
///
/// let text = r#"
/// [fiber.wool]
/// tt = [0.6, 0.4, 0.3]
/// [yarn.thin]
/// radius = 0.2 # millimetres
/// fiber = "wool"
/// fibers = 80
/// density = 0.4
/// [[fabric]]
/// yarn = "thin"
/// source = { type = "straight", count = 3, length = 5 }
/// "#;
/// let scene = parse("three yarns", text, &LoadOptions::default()).unwrap();
/// assert_eq!(scene.fabrics[0].curves.len(), 3);
///
/// // What is wrong with a scene is told with its place.
/// let wrong = text.replace("fibers = 80", "fibres = 80");
/// let told = parse("three yarns", &wrong, &LoadOptions::default()).unwrap_err().to_string();
/// assert!(told.contains("three yarns:7") && told.contains("fibers"), "{told}");
/// ```
///
/// # Errors
/// Everything that is wrong with it, as text for the user.
pub fn parse(name: &str, text: &str, options: &LoadOptions) -> Result<Scene, LoadError> {
    let Some(threads) = threads(name, text, options) else { return parse_here(name, text, options) };
    // As much stack as a program's first thread has.
    match rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(8 << 20).build() {
        Ok(pool) => {
            let options = options.clone();
            pool.install(move || parse_here(name, text, &options))
        }
        Err(error) => Err(LoadError(format!("{name}: error: cannot start {threads} threads: {error}\n"))),
    }
}

/// How many threads a scene or the command line asks for, if they do; what is wrong is told later.
fn threads(name: &str, text: &str, options: &LoadOptions) -> Option<usize> {
    let (mut sources, diagnostics) = (Sources::new(), Diagnostics::new());
    let mut document = Document::parse(name, text, &mut sources, &diagnostics)?;
    apply_options(&mut document, &options.settings, &options.assignments, &mut sources, &diagnostics);
    settings::threads(&Reader::new(&document, &diagnostics).table_or_empty("render"))
}

/// Said of a scene that says `light = []`, which is no mistake: its depth, normals and masks are there.
const NO_LIGHT: &str =
    "the scene has no light: the picture will be black (without `light = []` it has a sky and a sun)";

/// Loads a scene on the threads that there are.
fn parse_here(name: &str, text: &str, options: &LoadOptions) -> Result<Scene, LoadError> {
    let mut sources = Sources::new();
    let diagnostics = Diagnostics::new();
    match load_text(name, text, options, &mut sources, &diagnostics) {
        Some(mut scene) if !diagnostics.has_errors() => {
            // Of a scene with nothing to see, that is told.
            if scene.lights.is_empty() && !scene.shows_nothing() {
                scene.warnings.push(NO_LIGHT.to_owned());
            }
            scene.warnings.extend(diagnostics.warnings(&sources));
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

fn load_text(
    name: &str,
    text: &str,
    options: &LoadOptions,
    sources: &mut Sources,
    diagnostics: &Diagnostics,
) -> Option<Scene> {
    let mut document = Document::parse(name, text, sources, diagnostics)?;
    let libraries_are_read = complete(&mut document, options, sources, diagnostics);
    build(name, &document, options, sources, diagnostics, libraries_are_read)
}

/// Adds the libraries of a document and what the command line says. Whether all libraries could be read.
fn complete(document: &mut Document, options: &LoadOptions, sources: &mut Sources, diagnostics: &Diagnostics) -> bool {
    // Which libraries there are is said before they are read, and of their tables what is said after.
    let (of_libraries, others): (Vec<String>, _) = options.assignments.iter().cloned().partition(|a| is_of_library(a));
    apply_options(document, &[], &of_libraries, sources, diagnostics);
    let libraries_are_read = merge_libraries(document, sources, diagnostics);
    apply_options(document, &options.settings, &others, sources, diagnostics);
    libraries_are_read
}

/// Whether an assignment of the command line is of the scene's key `library`.
fn is_of_library(assignment: &str) -> bool {
    assignment.split(['=', '.']).next().is_some_and(|key| key.trim() == "library")
}

/// Dotted path of a key, its value, and the option as it was given.
type Setting = (String, Value, String);

/// Adds what the command line says of a scene's keys.
fn apply_options(
    document: &mut Document,
    settings: &[Setting],
    assignments: &[String],
    sources: &mut Sources,
    diagnostics: &Diagnostics,
) {
    for (key, value, label) in settings {
        document.set(key, value.clone(), label, sources, diagnostics);
    }
    for assignment in assignments {
        document.apply_option(assignment, sources, diagnostics);
    }
}

/// Adds the tables of the files under `library`; what the scene itself says wins. Whether all of them could be read.
fn merge_libraries(document: &mut Document, sources: &mut Sources, diagnostics: &Diagnostics) -> bool {
    let mut whole = true;
    let paths: Vec<(String, Span)> =
        Reader::new(document, diagnostics).strings("library").into_iter().map(|(p, s)| (p.to_owned(), s)).collect();
    for (path, span) in paths {
        let full = Context::new(sources, diagnostics, 1.0, true).resolve(&path, span);
        match read_text(&full) {
            Ok(text) => match Document::parse(&full.display().to_string(), &text, sources, diagnostics) {
                Some(library) => document.merge(library, sources),
                None => whole = false,
            },
            Err(problem) => {
                whole = false;
                diagnostics.push(
                    Diagnostic::error(format!("cannot read the library {}: {problem}", full.display()))
                        .at(span)
                        .hint("paths are relative to the file that names them"),
                );
            }
        }
    }
    whole
}

fn build(
    name: &str,
    document: &Document,
    options: &LoadOptions,
    sources: &Sources,
    diagnostics: &Diagnostics,
    libraries_are_read: bool,
) -> Option<Scene> {
    let root = Reader::new(document, diagnostics);
    root.strings("library");
    root.u64("schema", 1..=1);
    let unit = root.one_of_or("unit", 1.0, &UNITS);
    let context = Context::new(sources, diagnostics, unit, libraries_are_read);
    let plans = Plans::read(&root, options, &context);
    root.finish();
    if diagnostics.has_errors() {
        context.tell_missing_files();
        return None;
    }
    if let Some(frames) = &options.frames {
        context.tell_missing_frames(frames);
        if diagnostics.has_errors() {
            return None;
        }
    }
    // The text is sound: now the files.
    let builder = plans.make(name, &context)?;
    if diagnostics.has_errors() {
        return None;
    }
    match builder.build() {
        Ok(scene) => Some(scene),
        Err(error) => {
            diagnostics.push(Diagnostic::error(error.to_string()));
            None
        }
    }
}

/// Everything that a scene's text says, before the files it names are read. `None` where something is wrong.
struct Plans {
    render: RenderSettings,
    output: OutputSettings,
    detail: cloth::Detail,
    library: yarns::Library,
    fabrics: Vec<Option<cloth::FabricPlan>>,
    meshes: Vec<Option<mesh::MeshPlan>>,
    camera: Option<CameraSetup>,
    lights: Vec<Option<view::GroupedLight>>,
    ground: Option<view::GroundPlan>,
}

impl Plans {
    fn read(root: &Reader<'_>, options: &LoadOptions, context: &Context<'_>) -> Self {
        let table = root.table_or_empty("render");
        let render = settings::render(&table);
        let output = settings::output(root.table_or_empty("output"));
        let intersections = [("tilted", true), ("perpendicular", false)];
        let tilted = table.one_of_or("ply_intersection", defaults::TILTED, &intersections);
        let mut detail = cloth::Detail::read(&table);
        table.finish();
        let mut library = yarns::read(root, context, tilted, definitions::built_in_fiber);
        definitions::add_built_in(&mut library, root.node("fabric"), tilted);
        let tables = root.tables("fabric");
        if tables.is_empty() && options.curves.is_some() {
            root.error("`--curves` needs a [[fabric]] whose curves it replaces", None);
        }
        let fabric = |(i, table)| {
            let curves = if i == 0 { options.curves.as_deref() } else { None };
            cloth::plan(table, context, &library, curves)
        };
        let fabrics = tables.into_iter().enumerate().map(fabric).collect();
        let materials = mesh::materials(root, context);
        let meshes = mesh::meshes(root, context, &materials, detail.frame);
        let camera = view::camera(root, context, options.frame, detail.frame);
        detail.survey = options.survey;
        (detail.flow, detail.uv) = (output.layers.motion, output.layers.uv);
        detail.shutter = camera.as_ref().and_then(|camera| camera.motion.shutter);
        let lights = view::lights(root, context);
        let ground = view::ground(root, context, &materials);
        Self { render, output, detail, library, fabrics, meshes, camera, lights, ground }
    }

    /// Reads the files; what is wrong with them is told.
    fn make(self, name: &str, context: &Context<'_>) -> Option<SceneBuilder> {
        let mut warnings = Vec::new();
        let mut garments = Vec::new();
        let fabrics = self.fabrics.into_iter().flatten().enumerate();
        let fabrics = fabrics
            .filter_map(|(i, plan)| plan.make(i, context, &self.library, &self.detail, &mut warnings, &mut garments))
            .flatten()
            .collect();
        let mut made = Vec::new();
        let objects = self.meshes.into_iter().flatten();
        let objects = objects.filter_map(|plan| plan.make(self.detail.flow, context, &mut made)).collect();
        let lights = self.lights.into_iter().flatten();
        let (groups, lights): (Vec<Option<String>>, Vec<Light>) =
            lights.filter_map(|of| Some((of.group, of.light.make(context)?))).unzip();
        let light_groups = LightGroups::new(groups.iter().map(Option::as_deref)).unwrap_or_default();
        let ground = self.ground.and_then(|plan| plan.make(context, &mut made));
        Some(SceneBuilder {
            name: name.to_owned(),
            render: self.render,
            output: self.output,
            camera: self.camera?,
            yarns: self.library.yarns.into_values().collect(),
            fibers: self.library.fibers.into_iter().collect(),
            fabrics,
            objects,
            materials: made.into_iter().map(|(_, material)| material).collect(),
            lights,
            light_groups,
            ground,
            garments,
            warnings,
        })
    }
}

/// `scale`, `rotate` (about x, then y, then z) and `translate` of a table.
fn placement(table: &Reader<'_>, context: &Context<'_>) -> DAffine3 {
    let scale = table.f64_or("scale", 1.0, Range::POSITIVE.and_at_most(1e9));
    let [rx, ry, rz] = table.vec3_or("rotate", [0.0; 3], Range::FINITE).map(radians);
    let translate = context.position(table.vec3_or("translate", [0.0; 3], Range::PLACE));
    let rotation = DQuat::from_euler(EulerRot::ZYX, rz, ry, rx);
    DAffine3::from_scale_rotation_translation(DVec3::splat(scale), rotation, translate)
}

/// Angles in files are degrees.
fn radians(degrees: f64) -> f64 {
    degrees.to_radians()
}

/// Twist angles: less than a quarter turn, or yarn would be infinitely long.
const TWIST: Range = Range::between(-89.9, 89.9);
