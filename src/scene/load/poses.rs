//! The meshes of a garment and its body at the times that are needed: files numbered by frame, or a stage with times.

use std::path::{Path, PathBuf};

use super::{
    super::animation::Files,
    Context, Y_UP,
    cloth::Detail,
    mesh::{polygons, tell},
    sequence::Times,
};
use crate::{
    files::{
        obj,
        stage::{self, MeshChoice, PolygonMesh, Stage},
    },
    garment::{GarmentError, GarmentMesh},
    geometry::mesh::Mesh,
    input::diagnostic::Span,
};

/// A mesh between two frames.
pub(super) fn between(a: &GarmentMesh, b: &GarmentMesh, share: f64) -> GarmentMesh {
    let mut mesh = a.clone();
    if share > 0.0 {
        for (p, q) in mesh.points.iter_mut().zip(&b.points) {
            *p = p.lerp(*q, share);
        }
    }
    mesh
}

/// A mesh of a file: of a stage at a frame.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Moment {
    pub(super) path: PathBuf,
    /// Bits of the frame; none for files of one time, and for the earliest of a stage.
    frame: Option<u64>,
}

impl Moment {
    fn of_file(path: &Path) -> Self {
        Self { path: path.to_owned(), frame: None }
    }

    /// The garment, +y up, and millimetres per unit where the file says so.
    pub(super) fn garment(
        &self,
        choice: &MeshChoice,
        z_up: Option<bool>,
        at: (&Context<'_>, Span),
    ) -> Result<(GarmentMesh, Option<f64>), GarmentError> {
        if !stage::is_stage(&self.path) {
            let mut mesh = GarmentMesh::read(&self.path)?;
            if z_up == Some(true) {
                mesh.points.iter_mut().for_each(upright);
            }
            return Ok((mesh, None));
        }
        let stage = at.0.stages.open(&self.path).map_err(|error| GarmentError::new(error.to_string(), ""))?;
        let fail = |problem: String| GarmentError::new(problem, "a mesh with texture coordinates; `prim` chooses one");
        let (mesh, unit) = self.of_stage(&stage, choice, z_up, at).map_err(fail)?;
        Ok((GarmentMesh::from_polygons(&mesh).map_err(|e| e.of(&self.path))?, unit))
    }

    /// The body, likewise.
    pub(super) fn body(
        &self,
        choice: &MeshChoice,
        z_up: Option<bool>,
        at: (&Context<'_>, Span),
    ) -> Result<(Mesh, Option<f64>), String> {
        if !stage::is_stage(&self.path) {
            let mut mesh = obj::read(&self.path).map_err(|e| e.to_string())?;
            if z_up == Some(true) {
                mesh.transform(&glam::DAffine3::from_mat3(Y_UP));
            }
            return Ok((mesh, None));
        }
        let stage = at.0.stages.open(&self.path).map_err(|e| e.to_string())?;
        let (mesh, unit) = self.of_stage(&stage, choice, z_up, at)?;
        // A garment's are in its report.
        tell(&mesh.notes, &self.path, at);
        Ok((mesh.to_mesh(), unit))
    }

    fn of_stage(
        &self,
        stage: &Stage,
        choice: &MeshChoice,
        z_up: Option<bool>,
        at: (&Context<'_>, Span),
    ) -> Result<(PolygonMesh, Option<f64>), String> {
        let mut mesh = polygons(stage, &self.path, choice, self.frame.map(f64::from_bits))?;
        tell(&mesh.warnings, &self.path, at);
        if z_up.unwrap_or(stage.up_axis() == Some(2)) {
            mesh.points.iter_mut().chain(&mut mesh.normals).for_each(upright);
        }
        Ok((mesh, stage.unit_mm()))
    }
}

/// z up becomes y up.
fn upright(p: &mut glam::DVec3) {
    *p = Y_UP * *p;
}

/// A time between two moments.
pub(super) struct Pose {
    pub(super) before: Moment,
    pub(super) after: Moment,
    pub(super) share: f64,
}

/// The moments of a frame, and the first of all.
pub(super) struct Frames {
    pub(super) rest: Moment,
    pub(super) poses: Vec<Pose>,
    /// How many of the poses are those of the shutter; the others are for the layer of motion.
    pub(super) shown: usize,
    pub(super) animated: bool,
}

impl Frames {
    pub(super) fn find(path: &Path, detail: &Detail) -> Self {
        let Times { all: times, shown } = Times::of(detail);
        if stage::is_stage(path) && path.exists() {
            let at = |time: f64| Moment { frame: Some(time.to_bits()), ..Moment::of_file(path) };
            let pose = |time: f64| Pose { before: at(time), after: at(time), share: 0.0 };
            let poses = times.into_iter().map(pose).collect();
            return Self { rest: Moment::of_file(path), poses, shown, animated: true };
        }
        let Some(there) = Files::about(path, detail.frame) else {
            let own = Moment::of_file(path);
            let pose = Pose { before: own.clone(), after: own.clone(), share: 0.0 };
            return Self { rest: own, poses: vec![pose], shown: 1, animated: false };
        };
        let needed = |frame: f64| Moment::of_file(&there.file(there.number_at(frame)));
        let poses = times
            .into_iter()
            .map(|time| Pose { before: needed(time.floor()), after: needed(time.ceil()), share: time - time.floor() })
            .collect();
        Self { rest: Moment::of_file(&there.file(there.first())), poses, shown, animated: true }
    }

    /// All moments, each once.
    pub(super) fn moments(&self) -> impl Iterator<Item = &Moment> {
        let mut all: Vec<&Moment> = self.poses.iter().flat_map(|p| [&p.before, &p.after]).collect();
        all.push(&self.rest);
        all.sort();
        all.dedup();
        all.into_iter()
    }
}
