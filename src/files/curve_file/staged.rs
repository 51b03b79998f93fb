//! Curves out of stages.

use std::path::Path;

use super::{CurveFileError, FileLocation, PrimPattern, ReadOptions, Stage};
use crate::{
    files::stage::{Contents, StageError},
    geometry::curve::CurveSet,
};

impl From<StageError> for CurveFileError {
    fn from(error: StageError) -> Self {
        let problem = match &error.object {
            Some(object) => format!("{object}: {}", error.problem),
            None => error.problem.clone(),
        };
        Self { file: Some(error.file), ..Self::new(FileLocation::File, problem) }
    }
}

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<CurveSet, CurveFileError> {
    let stage = Stage::open(path)?;
    let mut set = read_open(&stage, options)?;
    if let (None, Some([first, last])) = (options.frame, stage.frames().filter(|[first, last]| first < last)) {
        set.notes.push(format!("frames {first} to {last} are in it: the curves are those of the earliest"));
    }
    Ok(set)
}

pub(super) fn read_open(stage: &Stage, options: &ReadOptions) -> Result<CurveSet, CurveFileError> {
    let everything = PrimPattern::all();
    let (mut set, objects) = stage.curves(options.prim.as_ref().unwrap_or(&everything), options.frame)?;
    if objects.is_empty() {
        let Contents { curves, meshes, .. } = stage.contents()?;
        let (problem, hint) = match (curves.as_slice(), meshes.len()) {
            ([], 0) => {
                ("there are no curves in it".to_owned(), "curves are BasisCurves prims or Alembic curves".to_owned())
            }
            ([], n) => {
                let hint = "a mesh goes into [[mesh]], or under yarns: source = { type = \"garment\" }";
                let meshes = if n == 1 { "a mesh".to_owned() } else { format!("{n} meshes") };
                (format!("there are no curves in it, but {meshes}"), hint.to_owned())
            }
            (paths, _) => {
                let shown: Vec<&str> = paths.iter().take(8).map(String::as_str).collect();
                let dots = if paths.len() > shown.len() { ", ..." } else { "" };
                ("no visible curves are chosen".to_owned(), format!("curves here: {}{dots}", shown.join(", ")))
            }
        };
        // What could not be composed may be what was meant.
        let missing: String = set.notes.iter().map(|note| format!("; {note}")).collect();
        return Err(CurveFileError::new(FileLocation::File, problem + &missing).hint(hint));
    }
    let points: u64 = set.curves.iter().map(|c| c.points.len() as u64).sum();
    if points > options.max_points {
        return Err(CurveFileError::too_many_points(FileLocation::File, points, options));
    }
    if options.basis.is_some() {
        set.notes.push("the basis asked for was ignored: stages know their own".into());
    }
    Ok(set)
}
