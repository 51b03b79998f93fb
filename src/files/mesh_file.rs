//! What a mesh in a file is, told before it is used.

use std::{collections::HashMap, path::Path};

use glam::{DVec2, DVec3};

use super::{
    obj,
    stage::{MeshChoice, Stage},
};
use crate::geometry::mesh::Mesh;

/// A mesh as `info` tells of it, in the unit of its file.
pub(crate) struct MeshFacts {
    /// Places of corners, each once.
    pub vertices: usize,
    pub triangles: usize,
    pub open_edges: usize,
    /// Groups or objects, of a stage subsets too.
    pub groups: Vec<String>,
    pub bounds: (DVec3, DVec3),
    /// Lowest and highest texture coordinates; `None` without.
    pub uvs: Option<(DVec2, DVec2)>,
    pub unit_mm: Option<f64>,
}

impl MeshFacts {
    /// Reads an OBJ file; `None` where there is no face in it.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub(crate) fn read(path: &Path) -> Result<Option<Self>, String> {
        let (mesh, groups) = obj::read_grouped(path).map_err(|e| e.to_string())?;
        Ok(Self::of(&mesh, groups, None))
    }

    /// Reads the visible meshes of a stage, likewise.
    ///
    /// # Errors
    /// What is wrong with the stage.
    pub(crate) fn of_stage(stage: &Stage) -> Result<Option<Self>, String> {
        let polygons = stage.mesh(&MeshChoice::all(), None).map_err(|e| e.to_string())?;
        let groups = polygons.groups.iter().map(|group| group.name.clone()).collect();
        Ok(Self::of(&polygons.to_mesh(), groups, stage.unit_mm()))
    }

    fn of(mesh: &Mesh, mut groups: Vec<String>, unit_mm: Option<f64>) -> Option<Self> {
        let bounds = mesh.bounds()?;
        groups.sort();
        groups.dedup();
        let uvs = mesh.uvs.iter().map(|&uv| (uv, uv)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let (vertices, open_edges) = border(mesh);
        Some(Self { vertices, triangles: mesh.triangles.len(), open_edges, groups, bounds, uvs, unit_mm })
    }
}

/// How many places the corners of a mesh are at, and how many edges have no face of the same side beyond them: none of a
/// closed mesh, whose inside is known.
pub(crate) fn border(mesh: &Mesh) -> (usize, usize) {
    let mut known: HashMap<[u64; 3], u32> = HashMap::with_capacity(mesh.points.len());
    let places: Vec<u32> = mesh
        .points
        .iter()
        .map(|p| {
            let next = known.len() as u32;
            // -0 is 0.
            *known.entry((*p + 0.0).to_array().map(f64::to_bits)).or_insert(next)
        })
        .collect();
    let mut edges: HashMap<(u32, u32), i64> = HashMap::new();
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| places[i as usize]);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry((from.min(to), from.max(to))).or_default() += (to as i64 - from as i64).signum();
        }
    }
    (known.len(), edges.values().filter(|sum| **sum != 0).count())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn open_edges_are_those_with_one_side() {
        // Each face of a box has corners of its own.
        assert_eq!(border(&Mesh::cuboid(DVec3::ONE)), (8, 0));
        assert_eq!(border(&Mesh::plane(DVec2::ONE)), (4, 4));
        let mut turned = Mesh::cuboid(DVec3::ONE);
        turned.triangles[0].swap(0, 1);
        assert_eq!(border(&turned).1, 3);
    }
}
