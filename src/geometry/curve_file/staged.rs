//! Curves out of stages and into them.

use std::{io, path::Path};

use super::{CurveFileError, FileLocation, PrimPattern, ReadOptions, Stage, counted};
use crate::geometry::{
    curve::{Basis, Curve, CurveSet},
    stage::{self, Contents, CurvesOut, Interpolated, StageError},
};

/// The radius of curves that have none, in their own unit, where a format needs one.
const SOME_RADIUS: f64 = 0.5;

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
    read_open(&Stage::open(path)?, options)
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
                (format!("there are no curves in it, but {}", counted(n as u64, "mesh")), hint.to_owned())
            }
            (paths, _) => {
                let shown: Vec<&str> = paths.iter().take(8).map(String::as_str).collect();
                let dots = if paths.len() > shown.len() { ", ..." } else { "" };
                ("no visible curves are chosen".to_owned(), format!("curves here: {}{dots}", shown.join(", ")))
            }
        };
        return Err(CurveFileError::new(FileLocation::File, problem).hint(hint));
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

pub(super) fn can_write(path: &Path) -> bool {
    let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    matches!(extension.as_deref(), Some("usd" | "usda" | "usdc"))
}

/// One prim for each basis and kind of ends, with the number of each yarn.
pub(super) fn write(path: &Path, set: &CurveSet, out: &mut impl io::Write) -> io::Result<()> {
    let color = |i: usize| set.colors.get(i).copied().flatten();
    let kind = |i: usize, c: &Curve| (c.basis, c.closed, c.radii.is_some(), color(i).is_some());
    let all_have_ids = !set.ids.is_empty() && set.ids.iter().all(Option::is_some);
    let mut groups: Vec<CurvesOut<'_>> = Vec::new();
    let mut kinds = Vec::new();
    for (i, curve) in set.curves.iter().enumerate() {
        let own = kinds.iter().position(|k| *k == kind(i, curve)).unwrap_or_else(|| {
            kinds.push(kind(i, curve));
            let basis = match curve.basis {
                Basis::CatmullRom => "catmull_rom",
                Basis::BSpline => "b_spline",
                Basis::Linear => "linear",
            };
            let ends = if curve.closed { "closed" } else { "open" };
            let name =
                if kinds.len() == 1 { "yarns".to_owned() } else { format!("yarns_{basis}_{ends}_{}", kinds.len()) };
            groups.push(CurvesOut { name, curves: Vec::new(), radius: SOME_RADIUS, primvars: Vec::new() });
            kinds.len() - 1
        });
        groups[own].curves.push(curve);
        // The file's own numbers, where it has some for all.
        let id = if all_have_ids { set.ids[i].unwrap_or(0) } else { i as i64 };
        let id = i32::try_from(id).unwrap_or(i as i32);
        let primvars = &mut groups[own].primvars;
        match primvars.first_mut() {
            Some((_, Interpolated::Id(ids))) => ids.push(id),
            _ => primvars.push(("yarnId".into(), Interpolated::Id(vec![id]))),
        }
        if let Some(color) = color(i) {
            match primvars.get_mut(1) {
                Some((_, Interpolated::Color(colors))) => colors.push(color),
                _ => primvars.push(("displayColor".into(), Interpolated::Color(vec![color]))),
            }
        }
    }
    stage::write(path, set.unit_mm.unwrap_or(1.0), &groups, out)
}
