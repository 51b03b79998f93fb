//! Stages of other programs: curves, meshes and cameras out of USD (`.usd`, `.usda`, `.usdc`, `.usdz`) and Alembic (`.abc`).
//!
//! A stage is a tree of objects with transforms, some of which change in time. Here it becomes plain values in the space
//! of the stage: transforms, visibility and instances are applied, a time is chosen. Lengths stay in the stage's unit.
//! `curves` and `polygons` say what curves and meshes of both formats have in common, `select` which objects are
//! meant. Files come from strangers: memory is bounded by the file's size, and damage is an error that says where.

mod alembic;
mod curves;
mod polygons;
mod select;
#[cfg(feature = "usd")]
mod usd;

use std::{
    fmt,
    fs::File,
    io::Read,
    path::{Path, PathBuf},
};

use glam::{DMat4, DVec3};

pub use polygons::{FaceGroup, PolygonMesh};
pub(crate) use select::glob;
pub use select::{MeshChoice, PrimPattern};
#[cfg(feature = "usd")]
pub use usd::write::{CurvesOut, Interpolated, write};

use crate::{files::extension, geometry::curve::CurveSet, input::system::hindrance};

/// Why a stage could not be read. Displays as one line: file, object, problem.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StageError {
    /// The file as the caller named it.
    pub file: PathBuf,
    /// The object at fault, if one is.
    pub object: Option<String>,
    /// What was expected and what was found.
    pub problem: String,
}

impl fmt::Display for StageError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}: ", self.file.display())?;
        if let Some(object) = &self.object {
            write!(out, "{object}: ")?;
        }
        out.write_str(&self.problem)
    }
}

impl std::error::Error for StageError {}

/// What is wrong, before the file is known.
#[derive(Debug)]
struct Problem {
    object: Option<String>,
    text: String,
    /// Whether the object is of a kind that is not read, and sound as far as can be told.
    unknown: bool,
}

impl Problem {
    fn new(text: impl Into<String>) -> Self {
        Self { object: None, text: text.into(), unknown: false }
    }

    /// Of an object of a kind that is not read: what is beside it is read all the same.
    fn unknown(text: impl Into<String>) -> Self {
        Self { unknown: true, ..Self::new(text) }
    }

    fn at(mut self, object: &str) -> Self {
        self.object.get_or_insert_with(|| object.to_owned());
        self
    }

    fn in_file(self, path: &Path) -> StageError {
        StageError { file: path.into(), object: self.object, problem: self.text }
    }
}

/// Names in a list, for what is there in place of what was asked for.
pub(crate) fn listed_or_none(names: &[impl AsRef<str>]) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// That there is no such camera, and which there are.
fn no_camera(path: &str, cameras: &[String]) -> Problem {
    Problem::new(format!("no camera at {path}; cameras here: {}", listed_or_none(cameras)))
}

/// The largest file that is read, and the most control points or corners of it.
const MAX_BYTES: u64 = 1 << 32;
const MAX_POINTS: usize = 1 << 28;
/// How deep objects may lie in one another.
const MAX_DEPTH: usize = 128;

/// A camera at one time, in the space of the stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageCamera {
    /// From the camera's space (looking along -z, y up) to the stage's, without scale.
    pub to_stage: DMat4,
    /// Width and height of the film: of the picture itself, in stage units, for orthographic cameras, else of the film
    /// behind the lens, in the unit of `focal_length`.
    pub aperture: [f64; 2],
    /// How far the film's middle lies beside the view, to the right and up, in the unit of `aperture`.
    pub offset: [f64; 2],
    /// Focal length; `None` for orthographic cameras.
    pub focal_length: Option<f64>,
    /// Length of a unit of `aperture` and `focal_length` in stage units.
    pub film_unit: f64,
    /// Lens opening as f-number; 0 for a pinhole.
    pub f_stop: f64,
    /// Distance in focus, stage units; 0 where none is given.
    pub focus_distance: f64,
}

impl StageCamera {
    /// Where a camera stands, from its transform: the lens does not scale with its stand.
    fn standing(to_stage: &DMat4) -> DMat4 {
        let axis = |i: usize| to_stage.col(i).truncate().normalize_or(DVec3::AXES[i]).extend(0.0);
        DMat4::from_cols(axis(0), axis(1), axis(2), to_stage.w_axis)
    }
}

/// What a stage holds, by path.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Contents {
    /// Curve objects.
    pub curves: Vec<String>,
    /// Meshes.
    pub meshes: Vec<String>,
    /// Cameras.
    pub cameras: Vec<String>,
    /// Lights, which are not read; of Alembic, which has its own way of each program for them, none.
    pub lights: Vec<String>,
}

/// A stage that is open. It can be asked at any number of times.
#[derive(Debug)]
pub struct Stage {
    path: PathBuf,
    format: Box<dyn Format>,
}

/// What a format of stages answers; times are frames, `None` the earliest.
trait Format: fmt::Debug {
    fn unit_mm(&self) -> Option<f64>;

    fn up_axis(&self) -> Option<u8>;

    fn frames(&self) -> Option<[f64; 2]>;

    fn contents(&self) -> Result<Contents, Problem>;

    /// Hands over the visible objects that are chosen, those that `take` is for; gives notes for the user.
    fn visit(&self, pattern: &PrimPattern, frame: Option<f64>, take: &mut Take<'_>) -> Result<Vec<String>, Problem>;

    fn camera(&self, path: &str, frame: Option<f64>) -> Result<StageCamera, Problem>;
}

/// What takes the objects of a kind.
enum Take<'a> {
    /// The curves of one object, with its path and transform.
    Curves(&'a mut AddCurves<'a>),
    /// One mesh, already in the space of the stage, with its path; and by which set of texture coordinates, where one is named.
    Meshes(&'a mut AddMesh<'a>, Option<&'a str>),
}

/// Extensions of stages.
pub(super) const EXTENSIONS: [&str; 5] = ["usda", "usdc", "usd", "usdz", "abc"];

/// Whether a file's name says that it is a stage.
pub fn is_stage(path: &Path) -> bool {
    extension(path).is_some_and(|found| EXTENSIONS.contains(&found.as_str()))
}

impl Stage {
    /// Opens a file, with all that it refers to.
    ///
    /// # Errors
    /// The file cannot be read, or is neither USD nor Alembic. What a USD file refers to and is not there becomes a note
    /// of what is read.
    pub fn open(path: &Path) -> Result<Self, StageError> {
        let open = || {
            let bytes = readable(path)?;
            if bytes.starts_with(alembic::MAGIC) || bytes.starts_with(alembic::HDF5_MAGIC) {
                Ok(Box::new(alembic::Archive::new(bytes)?) as Box<dyn Format>)
            } else {
                open_usd(path, bytes)
            }
        };
        let format = open().map_err(|p: Problem| p.in_file(path))?;
        Ok(Self { path: path.into(), format })
    }

    /// The file as it was named.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Millimetres per unit, where the stage says so: USD does (a centimetre if it is silent), Alembic does not.
    pub fn unit_mm(&self) -> Option<f64> {
        self.format.unit_mm()
    }

    /// Which axis points up: 1 for y, 2 for z; `None` where the stage does not say.
    pub fn up_axis(&self) -> Option<u8> {
        self.format.up_axis()
    }

    /// First and last time that something is known of, in frames.
    pub fn frames(&self) -> Option<[f64; 2]> {
        self.format.frames()
    }

    /// What the stage holds, visible or not.
    ///
    /// # Errors
    /// The stage is damaged.
    pub fn contents(&self) -> Result<Contents, StageError> {
        self.format.contents().map_err(|p| p.in_file(&self.path))
    }

    /// All visible curves of the objects that `pattern` chooses, at a frame (at the earliest if `None`), in the order of
    /// the stage. Beside them the objects in that order, each with the number of its curves.
    ///
    /// # Errors
    /// An object breaks the rules of its format, or there are more than 2^28 points.
    pub fn curves(
        &self,
        pattern: &PrimPattern,
        frame: Option<f64>,
    ) -> Result<(CurveSet, Vec<(String, usize)>), StageError> {
        let mut set = CurveSet { unit_mm: self.unit_mm(), up_axis: self.up_axis(), ..CurveSet::default() };
        let mut objects = Vec::new();
        let mut points = 0;
        let mut add = |path: &str, batch: curves::Batch, to_stage: &DMat4| {
            let before = set.curves.len();
            batch.add_to(&mut set, to_stage).map_err(|p| p.at(path))?;
            objects.push((path.to_owned(), set.curves.len() - before));
            points += set.curves[before..].iter().map(|c| c.points.len()).sum::<usize>();
            if points > MAX_POINTS {
                return Err(Problem::new(format!("more than {MAX_POINTS} points")).at(path));
            }
            Ok(())
        };
        let notes = self.format.visit(pattern, frame, &mut Take::Curves(&mut add));
        set.notes.extend(notes.map_err(|p| p.in_file(&self.path))?);
        Ok((set, objects))
    }

    /// All visible meshes that are chosen, as one, at a frame (at the earliest if `None`). Faces of an object, and of its
    /// subsets, are groups of their names.
    ///
    /// # Errors
    /// What is chosen is damaged, or is more than is read at once.
    pub fn mesh(&self, choice: &MeshChoice, frame: Option<f64>) -> Result<PolygonMesh, StageError> {
        let mut all = PolygonMesh::default();
        let mut add = |path: &str, mesh: PolygonMesh| {
            all.append(mesh);
            if all.points.len() > MAX_POINTS || all.corners.len() > MAX_POINTS {
                return Err(Problem::new(format!("more than {MAX_POINTS} points")).at(path));
            }
            Ok(())
        };
        let notes = self.format.visit(&choice.prims, frame, &mut Take::Meshes(&mut add, choice.uv.as_deref()));
        all.warnings.extend(notes.map_err(|p| p.in_file(&self.path))?);
        Ok(all)
    }

    /// The camera of this path at a frame (at the earliest if `None`).
    ///
    /// # Errors
    /// There is no such camera.
    pub fn camera(&self, path: &str, frame: Option<f64>) -> Result<StageCamera, StageError> {
        self.format.camera(path, frame).map_err(|p| p.in_file(&self.path))
    }
}

#[cfg(feature = "usd")]
fn open_usd(path: &Path, bytes: Vec<u8>) -> Result<Box<dyn Format>, Problem> {
    Ok(Box::new(usd::UsdStage::open(path, bytes)?))
}

#[cfg(not(feature = "usd"))]
fn open_usd(_: &Path, _: Vec<u8>) -> Result<Box<dyn Format>, Problem> {
    Err(Problem::new("is no Alembic archive, and this program was built without USD (the feature `usd`)"))
}

type AddCurves<'a> = dyn FnMut(&str, curves::Batch, &DMat4) -> Result<(), Problem> + 'a;
type AddMesh<'a> = dyn FnMut(&str, PolygonMesh) -> Result<(), Problem> + 'a;

/// The bytes of a regular file that is not too large.
fn readable(path: &Path) -> Result<Vec<u8>, Problem> {
    let words =
        |e: std::io::Error| Problem::new(hindrance(&e).map_or_else(|| format!("cannot be read: {e}"), str::to_owned));
    let metadata = std::fs::metadata(path).map_err(words)?;
    if !metadata.is_file() {
        return Err(Problem::new("expected a regular file, found a folder, pipe or device"));
    }
    if metadata.len() > MAX_BYTES {
        return Err(Problem::new(format!("{} bytes; at most {MAX_BYTES} are read", metadata.len())));
    }
    let mut bytes = Vec::new();
    File::open(path).and_then(|mut file| file.read_to_end(&mut bytes)).map_err(words)?;
    Ok(bytes)
}
