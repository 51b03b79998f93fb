//! USD: the `openusd` crate composes the stage, so that sublayers, references, payloads, variants and native instances
//! are as any USD program sees them; this room walks its prims.
//!
//! A file, and each that it refers to, is looked over first ([`check`]), and a panic inside of the crate is an error like any other.

mod check;
mod children;
mod mesh;
mod resolver;
#[cfg(test)]
mod tests;
mod text;
mod value;
pub(super) mod write;

use std::{
    collections::HashSet,
    fmt,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
};

use glam::{DMat4, DVec3};
use openusd::{
    schemas::geom::{Imageable, Xformable},
    sdf,
    usd::{self, Prim, PrimPredicate, SchemaBase, SchemaKind, TimeCode},
};

use crate::files::has_extension;

use super::{
    Contents, Format, MAX_DEPTH, PrimPattern, Problem, StageCamera, Take,
    curves::{Batch, ID_NAMES, PLY_NAMES, Spread, StageBasis, Wrap},
    no_camera,
};
use resolver::LookingResolver;
use value::{Values, token};

impl From<anyhow::Error> for Problem {
    fn from(error: anyhow::Error) -> Self {
        // The chain of causes on one line.
        Self::new(format!("{error:#}").replace('\n', " "))
    }
}

/// A stage that is open.
pub(super) struct UsdStage {
    stage: usd::Stage,
}

impl fmt::Debug for UsdStage {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("UsdStage").finish_non_exhaustive()
    }
}

impl UsdStage {
    /// Opens the layer of these bytes at a path, and all that it refers to.
    pub(super) fn open(path: &Path, bytes: Vec<u8>) -> Result<Self, Problem> {
        if has_extension(path, "abc") && !check::is_usd(&bytes) {
            return Err(Problem::new("expected an Alembic file, found neither Ogawa nor HDF5 at its beginning"));
        }
        check::look_over(&bytes)?;
        let name = path.to_str().ok_or_else(|| Problem::new("the path is not UTF-8, which USD needs"))?;
        let open = || Ok(usd::Stage::builder().resolver(LookingResolver::new(path, bytes)).open(name)?);
        let stage = guarded(open).map_err(|problem| match text::broken_line(path) {
            Some(line) => Problem::new(format!("line {line}: {}", problem.text)),
            None => problem,
        });
        Ok(Self { stage: stage? })
    }

    /// What could not be composed, one line each.
    fn notes(&self) -> Vec<String> {
        self.stage.composition_errors().iter().map(|e| e.to_string().replace('\n', " ")).collect()
    }

    /// A word of the whole stage; none where it cannot be read.
    fn metadata(&self, name: &str) -> Option<sdf::Value> {
        guarded(|| Ok(self.stage.stage_metadata(name)?)).ok().flatten()
    }
}

impl Format for UsdStage {
    /// `metersPerUnit`, centimetres where it says nothing.
    fn unit_mm(&self) -> Option<f64> {
        let unit = self.metadata("metersPerUnit").and_then(|v| value::number(&v));
        Some(unit.filter(|u| u.is_finite() && *u > 0.0).unwrap_or(0.01) * 1000.0)
    }

    fn up_axis(&self) -> Option<u8> {
        let up = self.metadata("upAxis");
        Some(if up.as_ref().and_then(token).is_some_and(|t| t == "Z") { 2 } else { 1 })
    }

    fn frames(&self) -> Option<[f64; 2]> {
        let range = || {
            let stage = &self.stage;
            Ok(stage.has_authored_time_code_range().then(|| [stage.start_time_code(), stage.end_time_code()]))
        };
        guarded(range).ok().flatten()
    }

    fn contents(&self) -> Result<Contents, Problem> {
        guarded(|| {
            let mut contents = Contents::default();
            self.stage.traverse(PrimPredicate::DEFAULT_PROXIES, |path| {
                let kind = self.stage.prim(path.clone()).type_name().ok().flatten();
                let list = match kind.as_ref().map(|k| k.as_str()) {
                    Some("BasisCurves") => &mut contents.curves,
                    Some("Mesh") => &mut contents.meshes,
                    Some("Camera") => &mut contents.cameras,
                    // Those of UsdLux, and of renderers that name theirs after them.
                    Some(kind) if kind.ends_with("Light") || kind.starts_with("DomeLight") => &mut contents.lights,
                    _ => return,
                };
                list.push(path.as_str().to_owned());
            })?;
            Ok(contents)
        })
    }

    fn visit(&self, pattern: &PrimPattern, frame: Option<f64>, take: &mut Take<'_>) -> Result<Vec<String>, Problem> {
        guarded(|| {
            let (mut at_rest, mut unknown) = (Vec::new(), Vec::new());
            self.walk(pattern, frame, &mut |prim, to_stage, values| {
                let at = |p: Problem| p.at(&prim.path);
                match (&mut *take, prim.kind.as_str()) {
                    (Take::Curves(add), "BasisCurves") => add(&prim.path, batch(values).map_err(at)?, to_stage)?,
                    (Take::Meshes(add, uv), "Mesh") => add(&prim.path, mesh::read(values, to_stage, *uv).map_err(at)?)?,
                    (Take::Curves(_), "NurbsCurves" | "HermiteCurves") => {
                        unknown.push(format!("{} is left out: {} are not read, BasisCurves are", prim.path, prim.kind));
                        return Ok(());
                    }
                    _ => return Ok(()),
                }
                if deformed(values).map_err(at)? {
                    at_rest.push(prim.path.clone());
                }
                Ok(())
            })?;
            let mut notes = self.notes();
            notes.append(&mut unknown);
            if !at_rest.is_empty() {
                notes.push(format!(
                    "{} is as modelled, in no pose: skeletons and blend shapes are not applied; bake them into `points`",
                    at_rest.join(", ")
                ));
            }
            Ok(notes)
        })
    }

    fn camera(&self, path: &str, frame: Option<f64>) -> Result<StageCamera, Problem> {
        guarded(|| {
            let at = sdf::path(path).map_err(|e| Problem::new(format!("{path} is no path of a prim: {e:#}")))?;
            let prim = self.stage.prim(at.clone());
            if prim.type_name()?.is_none_or(|t| t != "Camera") {
                return Err(no_camera(path, &self.contents()?.cameras));
            }
            let values = Values { prim: &prim, time: time_code(frame) };
            let mut to_stage = DMat4::IDENTITY;
            let mut above = Some(at);
            while let Some(path) = above.filter(|p| !p.is_abs_root()) {
                let (local, alone) = placed(&self.stage.prim(path.clone()), values.time)?;
                to_stage = local * to_stage;
                above = if alone { None } else { path.parent() };
            }
            let number = |name, otherwise| values.number(name).map(|v| v.unwrap_or(otherwise));
            let orthographic = values.token("projection")?.is_some_and(|p| p == "orthographic");
            let aperture = [number("horizontalAperture", 20.955)?, number("verticalAperture", 15.2908)?];
            let offset = [number("horizontalApertureOffset", 0.0)?, number("verticalApertureOffset", 0.0)?];
            let focal_length = number("focalLength", 50.0)?;
            if offset.iter().any(|v| !v.is_finite()) {
                return Err(Problem::new("expected finite offsets of the aperture").at(path));
            }
            if aperture.iter().chain([&focal_length]).any(|v| !v.is_finite() || *v <= 0.0) {
                return Err(Problem::new("expected apertures and a focal length above 0").at(path));
            }
            // USD measures film in tenths of a unit, that of orthographic pictures as well.
            Ok(StageCamera {
                to_stage: StageCamera::standing(&to_stage),
                aperture: if orthographic { aperture.map(|a| 0.1 * a) } else { aperture },
                offset: if orthographic { offset.map(|a| 0.1 * a) } else { offset },
                focal_length: (!orthographic).then_some(focal_length),
                film_unit: 0.1,
                f_stop: number("fStop", 0.0)?.max(0.0),
                focus_distance: number("focusDistance", 0.0)?.max(0.0),
            })
        })
    }
}

impl UsdStage {
    /// Visits each visible prim that is chosen, with its transform; instancers repeat what is below their prototypes.
    fn walk(&self, pattern: &PrimPattern, frame: Option<f64>, visit: &mut Visit<'_>) -> Result<(), Problem> {
        let walk = Walk { stage: &self.stage, time: time_code(frame), pattern };
        let roots = self.stage.root_prims()?;
        for name in roots {
            let path = sdf::Path::abs_root().append_path(name.as_str())?;
            walk.prim(&path, Above::default(), visit)?;
        }
        Ok(())
    }
}

/// A prim as visitors see it.
struct PrimName {
    path: String,
    kind: String,
}

type Visit<'a> = dyn FnMut(&PrimName, &DMat4, &Values<'_>) -> Result<(), Problem> + 'a;

struct Walk<'a> {
    stage: &'a usd::Stage,
    time: TimeCode,
    pattern: &'a PrimPattern,
}

/// What a prim has from those above it.
#[derive(Clone, Copy, Default)]
struct Above {
    to_parent: DMat4,
    /// Whether the path of one of them is chosen.
    chosen: bool,
    /// Whether the material that the nearest of them has bound is chosen.
    material: bool,
    /// Whether they are stand-ins and helpers, which are not what is rendered.
    helper: bool,
    /// Whether they are repeated by an instancer: what is kept as `over` or `class` is meant then.
    prototype: bool,
    depth: usize,
}

impl Walk<'_> {
    /// A prim and all below it.
    fn prim(&self, path: &sdf::Path, above: Above, visit: &mut Visit<'_>) -> Result<(), Problem> {
        if above.depth > MAX_DEPTH {
            return Err(Problem::new(format!("prims lie more than {MAX_DEPTH} deep")).at(path.as_str()));
        }
        let prim = self.stage.prim(path.clone());
        if !prim.is_active()? || !prim.is_loaded()? {
            return Ok(());
        }
        if !above.prototype && (!prim.is_defined()? || prim.is_abstract()?) {
            return Ok(());
        }
        let values = Values { prim: &prim, time: self.time };
        if values.token("visibility")?.is_some_and(|v| v == "invisible") {
            return Ok(());
        }
        let helper = values.token("purpose")?.map_or(above.helper, |p| p == "proxy" || p == "guide");
        let (local, alone) = placed(&prim, self.time).map_err(|p| p.at(path.as_str()))?;
        let name = PrimName {
            path: path.as_str().to_owned(),
            kind: prim.type_name()?.map_or(String::new(), |t| t.as_str().to_owned()),
        };
        let own = Above {
            to_parent: if alone { local } else { above.to_parent * local },
            chosen: above.chosen || self.pattern.matches(&name.path),
            material: self.bound_material_matches(&prim)?.unwrap_or(above.material),
            helper,
            depth: above.depth + 1,
            ..above
        };
        if name.kind == "PointInstancer" {
            return self.instances(&prim, &name, own, visit);
        }
        if (own.chosen || own.material) && !helper {
            visit(&name, &own.to_parent, &values)?;
        }
        for child in prim.child_names()? {
            self.prim(&path.append_path(child.as_str())?, own, visit)?;
        }
        Ok(())
    }

    /// Whether the pattern chooses the material that is bound to the prim itself; none where none is.
    fn bound_material_matches(&self, prim: &Prim) -> Result<Option<bool>, Problem> {
        if !self.pattern.names_materials() {
            return Ok(None);
        }
        let targets = prim.relationship("material:binding").targets()?;
        Ok(targets.first().map(|t| self.pattern.matches_material(t.as_str())))
    }

    fn instances(&self, prim: &Prim, name: &PrimName, own: Above, visit: &mut Visit<'_>) -> Result<(), Problem> {
        let values = Values { prim, time: self.time };
        let prototypes = prim.relationship("prototypes").targets()?;
        let indices = values.integers("protoIndices")?.unwrap_or_default();
        let positions = values.vectors("positions")?.unwrap_or_default();
        let turns = values.rotations("orientations")?.unwrap_or_default();
        let scales = values.vectors("scales")?.unwrap_or_default();
        // The crate has no way to `inactiveIds`, which is a metadatum.
        let hidden: HashSet<i64> = values.integers("invisibleIds")?.unwrap_or_default().into_iter().collect();
        let ids = values.integers("ids")?.unwrap_or_default();
        let count = indices.len();
        let fits = |n: usize| n == 0 || n == count;
        if positions.len() != count || !fits(turns.len()) || !fits(scales.len()) || !fits(ids.len()) {
            let found = [positions.len(), turns.len(), scales.len(), ids.len()];
            return Err(Problem::new(format!(
                "{count} protoIndices, but {} positions, {} orientations, {} scales and {} ids",
                found[0], found[1], found[2], found[3]
            ))
            .at(&name.path));
        }
        for (i, &index) in indices.iter().enumerate() {
            if hidden.contains(&ids.get(i).copied().unwrap_or(i as i64)) {
                continue;
            }
            let Some(prototype) = usize::try_from(index).ok().and_then(|i| prototypes.get(i)) else {
                let have = prototypes.len();
                return Err(Problem::new(format!("instance {i} is of prototype {index}, of which there are {have}"))
                    .at(&name.path));
            };
            let placed = DMat4::from_scale_rotation_translation(
                scales.get(i).copied().unwrap_or(DVec3::ONE),
                turns.get(i).copied().unwrap_or_default(),
                positions[i],
            );
            self.prim(prototype, Above { to_parent: own.to_parent * placed, prototype: true, ..own }, visit)?;
        }
        Ok(())
    }
}

/// Whether a skeleton or blend shapes move its points.
fn deformed(values: &Values<'_>) -> Result<bool, Problem> {
    let listed = |name: &str| Ok::<_, Problem>(values.value(name)?.is_some());
    Ok(listed("primvars:skel:jointIndices")? || listed("skel:blendShapes")?)
}

/// The curves of a prim.
fn batch(values: &Values<'_>) -> Result<Batch, Problem> {
    let basis = match values.token("type")?.as_deref() {
        Some("linear") => StageBasis::Linear,
        None | Some("cubic") => match values.token("basis")?.as_deref() {
            None | Some("bezier") => StageBasis::Bezier,
            Some("bspline") => StageBasis::BSpline,
            Some("catmullRom") => StageBasis::CatmullRom,
            Some(other) => {
                let known = "bezier, bspline and catmullRom are";
                return Err(Problem::new(format!("the basis \"{other}\" is not read; {known}")));
            }
        },
        Some(other) => return Err(Problem::new(format!("`type` is \"{other}\", expected linear or cubic"))),
    };
    let wrap = match values.token("wrap")?.as_deref() {
        None | Some("nonperiodic") => Wrap::NonPeriodic,
        Some("periodic") => Wrap::Periodic,
        Some("pinned") => Wrap::Pinned,
        Some(other) => {
            return Err(Problem::new(format!("`wrap` is \"{other}\", expected nonperiodic, periodic or pinned")));
        }
    };
    // The primvar wins over the attribute, as in USD's schema.
    let widths = values.primvar("widths", |own, name| own.numbers(name), Spread::Constant)?;
    let widths = match (widths, values.numbers("widths")?) {
        (None, Some(widths)) => Some((widths, values.spread("widths", Spread::Vertex)?)),
        (widths, _) => widths,
    };
    Ok(Batch {
        colors: colors(values)?,
        ids: ids(values, &ID_NAMES)?,
        plies: ids(values, &PLY_NAMES)?,
        basis,
        wrap,
        counts: values.integers("curveVertexCounts")?.unwrap_or_default(),
        points: values.points()?,
        widths,
    })
}

/// `displayColor`, linear as USD has it.
fn colors(values: &Values<'_>) -> Result<Option<(Vec<DVec3>, Spread)>, Problem> {
    values.primvar("displayColor", |own, name| own.vectors(name), Spread::Constant)
}

fn ids(values: &Values<'_>, names: &[&str]) -> Result<Option<(Vec<i64>, Spread)>, Problem> {
    // Other programs keep other things under such names.
    Ok(names
        .iter()
        .find_map(|name| values.primvar(name, |own, name| own.integers(name), Spread::Constant).ok().flatten()))
}

/// Any prim as one with a transform; where it has none, that is the identity.
struct AnyPrim(Prim);

impl SchemaBase for AnyPrim {
    const KIND: SchemaKind = SchemaKind::AbstractTyped;

    fn prim(&self) -> &Prim {
        &self.0
    }
}

impl Imageable for AnyPrim {}
impl Xformable for AnyPrim {}

/// A prim's own transform, and whether those above it do not count.
fn placed(prim: &Prim, time: TimeCode) -> Result<(DMat4, bool), Problem> {
    // The crate takes the names of operations as they are for names of attributes.
    let of_a_name = |c: char| c.is_alphanumeric() || matches!(c, '_' | ':' | '!');
    for operation in (Values { prim, time }).tokens("xformOpOrder")?.unwrap_or_default() {
        if !operation.chars().all(of_a_name) {
            return Err(Problem::new(format!("{operation:?} is no name of a transform's operation")));
        }
    }
    let view = AnyPrim(prim.clone());
    Ok((matrix(view.local_to_parent_transform(time)?), view.resets_xform_stack()?))
}

/// USD multiplies rows from the left: the same sixteen numbers in order are the columns here.
fn matrix(m: openusd::gf::Matrix4d) -> DMat4 {
    DMat4::from_cols_array(&m.0)
}

fn time_code(time: Option<f64>) -> TimeCode {
    time.map_or(TimeCode::EARLIEST, TimeCode::new)
}

/// Runs work inside of the crate; a panic there becomes a problem, without words on standard error.
fn guarded<T>(work: impl FnOnce() -> Result<T, Problem>) -> Result<T, Problem> {
    quiet::panics_of_this_thread(|| catch_unwind(AssertUnwindSafe(work)))
        .unwrap_or_else(|_| Err(Problem::new("is damaged, or uses what the reader does not know")))
}

/// Keeps the panics of one thread from being printed.
mod quiet {
    use std::{cell::Cell, panic, sync::Once};

    thread_local! {
        static QUIET: Cell<bool> = const { Cell::new(false) };
    }

    pub(super) fn panics_of_this_thread<T>(work: impl FnOnce() -> T) -> T {
        static HOOK: Once = Once::new();
        HOOK.call_once(|| {
            let loud = panic::take_hook();
            panic::set_hook(Box::new(move |info| {
                if !QUIET.get() {
                    loud(info);
                }
            }));
        });
        let before = QUIET.replace(true);
        let out = work();
        QUIET.set(before);
        out
    }
}
