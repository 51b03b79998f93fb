//! `[[mesh]]` and `[material.NAME]`: what stands beside the cloth or under it.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::{DAffine3, DVec2, DVec3};

use super::{
    super::{AlbedoTexture, Material, Object, animation::numbered, defaults},
    Context, Range, Reader, UNITS, Y_UP, placement, z_up,
};
use crate::{
    files::{
        obj,
        stage::{self, MeshChoice, PolygonMesh, PrimPattern, Stage},
    },
    geometry::{mesh::Mesh, polygon},
    image::texture::Texture,
    input::diagnostic::Span,
    math::Rgb,
    scattering::surface::SurfaceMaterial,
};

/// A material as it is written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MaterialPlan {
    albedo: [f64; 3],
    /// Roughness and refractive index of a coat.
    coat: Option<(f64, f64)>,
    /// A picture over it, where it was named, and how often it is repeated.
    texture: Option<(PathBuf, Span, [f64; 2])>,
    /// Whether the camera sees nothing where it is.
    holdout: bool,
}

/// Every `[material.NAME]`; `None` for one with mistakes.
pub(super) type Materials = BTreeMap<String, Option<MaterialPlan>>;

/// Reads every material, also those that the scene does not use.
pub(super) fn materials(root: &Reader<'_>, context: &Context<'_>) -> Materials {
    root.named_tables("material").into_iter().map(|(name, table)| (name.to_owned(), material(table, context))).collect()
}

fn material(table: Reader<'_>, context: &Context<'_>) -> Option<MaterialPlan> {
    let coated = table.kind_or("type", false, &[("diffuse", false), ("coated", true)]);
    let repeat = table.vec2("repeat", Range::POSITIVE).unwrap_or([1.0; 2]);
    let texture = table.string("texture").map(|path| {
        let span = table.span("texture").unwrap_or(table.header());
        (context.resolve(path, span), span, repeat)
    });
    let plain = if texture.is_some() { 1.0 } else { defaults::ALBEDO };
    let albedo = table.rgb_or("albedo", [plain; 3], Range::UNIT);
    let coat = (coated == Some(true)).then(|| {
        // A perfectly smooth coat would be a mirror, in which no light of no size is ever found.
        let roughness = table.f64_or("roughness", defaults::ROUGHNESS, Range::between(0.03, 1.0));
        (roughness, table.f64_or("ior", defaults::IOR, Range::between(1.01, 4.0)))
    });
    table.finish();
    Some(MaterialPlan { albedo, coat, texture, holdout: false })
}

/// The material that a table names under `material`, or a diffuse one of its `albedo`.
pub(super) fn material_of(table: &Reader<'_>, context: &Context<'_>, materials: &Materials) -> Option<MaterialPlan> {
    let albedo = table.rgb("albedo", Range::UNIT);
    let Some(name) = table.string("material") else {
        let albedo = albedo.unwrap_or([defaults::ALBEDO; 3]);
        return Some(MaterialPlan { albedo, coat: None, texture: None, holdout: false });
    };
    if albedo.is_some() {
        table.error_at("albedo", "give `material` or `albedo`, not both", None);
    }
    match materials.get(name) {
        Some(material) => material.clone(),
        None => {
            let span = table.span("material").unwrap_or(table.header());
            context.unknown(span, "material", name, materials.keys().map(String::as_str));
            None
        }
    }
}

impl MaterialPlan {
    /// Where its texture was named.
    pub(super) fn texture_span(&self) -> Option<Span> {
        self.texture.as_ref().map(|(_, span, _)| *span)
    }

    /// Adds it to the scene's materials, if it is not there yet, and gives its place.
    pub(super) fn make(self, context: &Context<'_>, made: &mut Vec<(Self, Material)>) -> Option<usize> {
        if let Some(place) = made.iter().position(|(plan, _)| *plan == self) {
            return Some(place);
        }
        let mut texture = None;
        if let Some((path, span, repeat)) = &self.texture {
            match Texture::open(path) {
                Ok(opened) => {
                    let repeat = DVec2::from(*repeat).as_vec2();
                    texture = Some(AlbedoTexture { texture: Arc::new(opened), repeat });
                }
                Err(error) => {
                    context.error(*span, error.to_string(), None);
                    return None;
                }
            }
        }
        let albedo = Rgb::from(self.albedo);
        let surface = match self.coat {
            None => SurfaceMaterial::diffuse(albedo),
            Some((roughness, ior)) => SurfaceMaterial::coated(albedo, roughness as f32, ior as f32),
        };
        let holdout = self.holdout;
        made.push((self, Material { surface, texture, holdout }));
        Some(made.len() - 1)
    }
}

enum Source {
    File(MeshFile),
    Shape(&'static str, Mesh),
}

/// A mesh file as it is named.
struct MeshFile {
    path: PathBuf,
    span: Span,
    /// Millimetres, where the scene says so.
    unit: Option<f64>,
    /// Whether z points up, where the scene says so.
    z_up: Option<bool>,
    /// Which meshes of a stage.
    choice: MeshChoice,
    frame: u32,
}

/// A mesh whose text is sound and whose file is not read yet.
pub(super) struct MeshPlan {
    /// Where the scene has one.
    name: Option<String>,
    source: Source,
    smooth: bool,
    transform: DAffine3,
    material: MaterialPlan,
}

/// Reads every `[[mesh]]`.
pub(super) fn meshes(
    root: &Reader<'_>,
    context: &Context<'_>,
    materials: &Materials,
    frame: u32,
) -> Vec<Option<MeshPlan>> {
    root.tables("mesh").into_iter().map(|table| mesh(table, context, materials, frame)).collect()
}

fn mesh(table: Reader<'_>, context: &Context<'_>, materials: &Materials, frame: u32) -> Option<MeshPlan> {
    let name = table.string("name").map(str::to_owned);
    if name.as_ref().is_some_and(|n| n.trim().is_empty()) {
        table.error_at("name", "the name of a mesh cannot be empty", None);
    }
    let transform = placement(&table, context);
    let holdout = table.bool_or("holdout", false);
    let material = material_of(&table, context, materials).map(|material| MaterialPlan { holdout, ..material });
    let mut smooth = false;
    let source = match (table.string("path"), table.has("shape")) {
        (Some(_), true) => {
            table.error_at("shape", "give `path` or `shape`, not both", None);
            table.of_unknown_kind();
            None
        }
        (Some(path), false) => {
            let span = table.span("path").unwrap_or(table.header());
            let unit = table.one_of("unit", &UNITS);
            let z_up = z_up(&table);
            let choice = mesh_choice(&table);
            smooth = table.bool_or("smooth", false);
            let path = context.resolve(path, span);
            refuse_prim(&table, "prim", &path);
            refuse_prim(&table, "uv", &path);
            Some(Source::File(MeshFile { path, span, unit, z_up, choice, frame }))
        }
        (None, true) => shape(&table, context),
        (None, false) => {
            if !table.has("path") {
                let hint =
                    "path = \"body.obj\", or shape = \"sphere\", \"cylinder\", \"box\", \"plane\" or \"revolution\"";
                table.error("missing key `path` or `shape` in the mesh", Some(hint));
            }
            table.of_unknown_kind();
            None
        }
    };
    table.finish();
    Some(MeshPlan { name, source: source?, smooth, transform, material: material? })
}

fn shape(table: &Reader<'_>, context: &Context<'_>) -> Option<Source> {
    let kinds = ["sphere", "cylinder", "box", "plane", "revolution"].map(|name| (name, name));
    let kind = table.kind("shape", &kinds)?;
    let length = |key: &str| table.required_f64(key, Range::POSITIVE).map(|l| l * context.unit);
    let segments = || table.u64_or("segments", defaults::MESH_SEGMENTS.into(), 3..=4096) as u32;
    let mesh = match kind {
        "sphere" => {
            let (radius, segments) = (length("radius"), segments());
            Mesh::sphere(radius?, segments)
        }
        "cylinder" => {
            let (radius, height, segments) = (length("radius"), length("height"), segments());
            Mesh::cylinder(radius?, height?, segments)
        }
        "box" => {
            let size = table.required_vec3("size", Range::POSITIVE);
            Mesh::cuboid(context.position(size?))
        }
        "plane" => {
            let size = table.vec2("size", Range::POSITIVE);
            if size.is_none() && !table.has("size") {
                table.error("missing key `size` in the mesh", Some("size = [200, 100], along x and z"));
            }
            Mesh::plane(DVec2::from(size?) * context.unit)
        }
        _ => {
            let (profile, segments) = (profile(table, context), segments());
            Mesh::revolution(&profile?, segments)
        }
    };
    Some(Source::Shape(kind, mesh))
}

/// Radius and height, from the bottom up.
fn profile(table: &Reader<'_>, context: &Context<'_>) -> Option<Vec<DVec2>> {
    const HINT: &str = "profile = [[60, 0], [75, 80], [0, 120]]: radius and height, from the bottom up";
    if !table.has("profile") {
        table.error("missing key `profile` in the mesh", Some(HINT));
    }
    let points = table.pairs("profile", Range::FINITE)?;
    let points: Vec<DVec2> = points.into_iter().map(|p| DVec2::from(p) * context.unit).collect();
    let wrong = if points.len() < 2 {
        "a profile has at least two points"
    } else if points.iter().any(|p| p.x < 0.0) {
        "the radius of a profile must be at least 0"
    } else if points.windows(2).any(|w| w[0] == w[1]) {
        "two points of the profile fall together"
    } else {
        return Some(points);
    };
    table.error_at("profile", wrong, Some(HINT));
    None
}

/// Meshes of a stage as one, millimetres of its unit and the axis that points up.
fn of_stage(
    (context, span): (&Context<'_>, Span),
    path: &Path,
    choice: &MeshChoice,
    frame: f64,
) -> Result<(Mesh, Option<f64>, Option<u8>), String> {
    let stage = context.stages.open(path).map_err(|e| e.to_string())?;
    let mesh = polygons(&stage, path, choice, Some(frame))?;
    tell(&mesh.warnings, path, (context, span));
    tell(&mesh.notes, path, (context, span));
    Ok((mesh.to_mesh(), stage.unit_mm(), stage.up_axis()))
}

/// The visible meshes of a stage that are chosen, at a frame; an error if there are none.
pub(super) fn polygons(
    stage: &Stage,
    path: &Path,
    choice: &MeshChoice,
    frame: Option<f64>,
) -> Result<PolygonMesh, String> {
    let mesh = stage.mesh(choice, frame).map_err(|e| e.to_string())?;
    if mesh.counts.is_empty() {
        let known = stage.contents().map_err(|e| e.to_string())?.meshes;
        // What could not be composed may be what was meant.
        let missing: String = mesh.warnings.iter().map(|warning| format!("; {warning}")).collect();
        return Err(format!(
            "{}: no visible mesh is chosen; meshes here: {}{missing}",
            path.display(),
            stage::listed_or_none(&known)
        ));
    }
    Ok(mesh)
}

/// Says once what makes a mesh of this file other than it is meant.
pub(super) fn tell(warnings: &[String], path: &Path, (context, span): (&Context<'_>, Span)) {
    for warning in warnings {
        context.warning_once(span, format!("{}: {warning}", path.display()));
    }
}

/// `prim` and `uv`: which meshes of a stage, and by which texture coordinates.
pub(super) fn mesh_choice(table: &Reader<'_>) -> MeshChoice {
    let prims = prim_pattern(table, "prim").unwrap_or_else(PrimPattern::all);
    MeshChoice { prims, uv: table.string("uv").map(str::to_owned) }
}

/// `prim`, or another key: which objects of a stage.
pub(super) fn prim_pattern(table: &Reader<'_>, key: &str) -> Option<PrimPattern> {
    let text = table.string(key)?;
    match PrimPattern::parse(text) {
        Ok(pattern) => Some(pattern),
        Err(problem) => {
            table.error_at(key, problem, Some("prim = \"/Garment/*\""));
            None
        }
    }
}

/// Refuses `prim`, or another key, of a file that has none.
pub(super) fn refuse_prim(table: &Reader<'_>, key: &str, path: &Path) {
    if table.has(key) && !stage::is_stage(path) {
        let (what, hint) = match key {
            "uv" => ("texture coordinates", "leave it out: an OBJ file has one set of them"),
            _ => (
                "meshes",
                "leave it out: all faces of an OBJ file are taken, and `group` of a [[fabric.panel]] chooses panels",
            ),
        };
        let problem = format!("`{key}` chooses {what} of a USD or Alembic file, which {} is not", path.display());
        table.error_at(key, problem, Some(hint));
    }
}

impl MeshPlan {
    /// Reads the file, if there is one, and puts the mesh in its place; that of the next frame as well if `flow` says so.
    pub(super) fn make(
        self,
        flow: bool,
        context: &Context<'_>,
        materials: &mut Vec<(MaterialPlan, Material)>,
    ) -> Option<Object> {
        let mut next = Vec::new();
        let (usual, origin, mut mesh) = match self.source {
            Source::Shape(kind, mesh) => (kind.to_owned(), kind.to_owned(), mesh),
            Source::File(file) => {
                let (path, mut mesh) = file.read(file.frame, context)?;
                if let Some(later) = flow.then(|| file.later(&path)).flatten() {
                    let (path, later) = file.read(later, context)?;
                    next = file.moved(&mesh, later, &path, context)?;
                }
                if self.smooth && mesh.normals.is_empty() {
                    mesh.smooth();
                }
                // That of the scene, which is the same in every frame.
                let usual = file.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                (usual, path.display().to_string(), mesh)
            }
        };
        mesh.transform(&self.transform);
        next.iter_mut().for_each(|p| *p = self.transform.transform_point3(*p));
        if let Some((_, span, _)) = &self.material.texture
            && mesh.uvs.is_empty()
        {
            context.error(*span, format!("{origin} has no texture coordinates for this texture"), None);
        }
        let name = self.name.unwrap_or(usual);
        Some(Object { name, origin, mesh, material: self.material.make(context, materials)?, next })
    }
}

/// Whether triangles are those of the same polygons, which may be cut otherwise where they bend.
fn same_faces(a: &[[u32; 3]], b: &[[u32; 3]]) -> bool {
    // Larger polygons than of so many triangles are not put together.
    const MOST: usize = 256;
    if a.len() != b.len() {
        return false;
    }
    let outline = |triangles: &[[u32; 3]]| polygon::outline(triangles.iter().copied());
    let mut at = 0;
    while at < a.len() {
        let most = MOST.min(a.len() - at);
        let same = |n: &usize| a[at] == b[at] || outline(&a[at..at + n]) == outline(&b[at..at + n]);
        match (1..=most).find(same) {
            Some(n) => at += n,
            None => return false,
        }
    }
    true
}

impl MeshFile {
    /// The file of a frame.
    fn of_frame(&self, frame: u32) -> PathBuf {
        numbered(&self.path, frame).filter(|_| !self.path.exists()).unwrap_or_else(|| self.path.clone())
    }

    /// The next frame, if what is in the file of this one may move until then.
    fn later(&self, own: &Path) -> Option<u32> {
        let next = self.frame.checked_add(1)?;
        let path = self.of_frame(next);
        (stage::is_stage(own) || path != own && path.exists()).then_some(next)
    }

    /// The mesh of a frame, millimetres, +y up, and its file.
    fn read(&self, frame: u32, context: &Context<'_>) -> Option<(PathBuf, Mesh)> {
        let path = self.of_frame(frame);
        let read = if stage::is_stage(&path) {
            of_stage((context, self.span), &path, &self.choice, f64::from(frame))
        } else {
            obj::read(&path).map(|mesh| (mesh, None, None)).map_err(|error| error.to_string())
        };
        let (mut mesh, own_unit, up_axis) = read.map_err(|error| context.error(self.span, error, None)).ok()?;
        let scale = context.unit_of((&path, self.span), own_unit, self.unit).unwrap_or(context.unit);
        let z_up = self.z_up.unwrap_or(up_axis == Some(2));
        let up = if z_up { DAffine3::from_mat3(Y_UP) } else { DAffine3::IDENTITY };
        mesh.transform(&(DAffine3::from_scale(DVec3::splat(scale)) * up));
        Some((path, mesh))
    }

    /// Points of the next frame's mesh; none if nothing moves.
    fn moved(&self, mesh: &Mesh, later: Mesh, path: &Path, context: &Context<'_>) -> Option<Vec<DVec3>> {
        if mesh.points.len() == later.points.len() && same_faces(&mesh.triangles, &later.triangles) {
            return Some(if mesh.points == later.points { Vec::new() } else { later.points });
        }
        let message = format!(
            "{}: {} points and {} triangles, where the frame before has {} and {}, or others",
            path.display(),
            later.points.len(),
            later.triangles.len(),
            mesh.points.len(),
            mesh.triangles.len()
        );
        let hint =
            "the layer of motion follows a mesh whose frames have the same faces; leave it out of `layers` otherwise";
        context.error(self.span, message, Some(hint.to_owned()));
        None
    }
}
