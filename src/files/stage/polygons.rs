//! Polygon meshes with texture coordinates that have corners of their own, and groups of faces.

use std::{collections::HashMap, ops::Range};

use glam::{DMat3, DMat4, DVec2, DVec3};

use super::{MAX_POINTS, Problem, listed_or_none};
use crate::geometry::{mesh::Mesh, polygon};

/// Faces that belong together: a subset of an object, or the object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FaceGroup {
    /// The name of the subset or object.
    pub name: String,
    /// Indices of faces.
    pub faces: Vec<u32>,
    /// Whether its faces are in another group as well: it is there for a material to be bound to, or is an object of which each
    /// face has a group.
    pub is_second: bool,
}

/// Polygons, in the space of the stage.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PolygonMesh {
    /// Corners, shared by faces.
    pub points: Vec<DVec3>,
    /// Number of corners of each face; at least three.
    pub counts: Vec<u32>,
    /// Indices into `points`, face by face, counter-clockwise as seen from outside.
    pub corners: Vec<u32>,
    /// Texture coordinates.
    pub uvs: Vec<DVec2>,
    /// Indices into `uvs`, one for each entry of `corners`; empty without texture coordinates.
    pub uv_corners: Vec<u32>,
    /// Unit normals, one for each entry of `corners`; empty without.
    pub normals: Vec<DVec3>,
    /// Faces by subset; those of no subset are in a group of their object's name.
    pub groups: Vec<FaceGroup>,
    /// What was left aside, one line each.
    pub notes: Vec<String>,
    /// What makes it other than it is meant, one line each.
    pub warnings: Vec<String>,
}

/// Values at the corners of faces: values and, where they are shared, which corner has which.
pub(super) struct AtCorners<T> {
    pub(super) values: Vec<T>,
    pub(super) indices: Option<Vec<u32>>,
}

/// Leaves those that are kept, of a list that may be missing.
#[cfg_attr(not(feature = "usd"), allow(dead_code, reason = "Alembic has no holes"))]
fn keep<T>(list: &mut Vec<T>, kept: &[bool]) {
    let mut kept = kept.iter();
    list.retain(|_| kept.next().is_some_and(|k| *k));
}

impl PolygonMesh {
    /// Faces of one object.
    pub(super) fn new(points: Vec<DVec3>, counts: &[i64], corners: &[i64]) -> Result<Self, Problem> {
        if let Some(i) = points.iter().position(|p| !p.is_finite()) {
            return Err(Problem::new(format!("point {i} is not finite")));
        }
        if let Some(i) = counts.iter().position(|c| !(3..=MAX_POINTS as i64).contains(c)) {
            return Err(Problem::new(format!("face {i} has {} corners, at least 3 are expected", counts[i])));
        }
        let total: i64 = counts.iter().fold(0, |sum, c| sum.saturating_add(*c));
        if total != corners.len() as i64 {
            let found = corners.len();
            return Err(Problem::new(format!("faces have {total} corners together, but there are {found} indices")));
        }
        if let Some(i) = corners.iter().position(|&c| c < 0 || c as usize >= points.len()) {
            let n = points.len();
            return Err(Problem::new(format!("corner {i} is of point {}, there are {n} points", corners[i])));
        }
        Ok(Self {
            points,
            counts: counts.iter().map(|&c| c as u32).collect(),
            corners: corners.iter().map(|&c| c as u32).collect(),
            ..Self::default()
        })
    }

    /// Gives it texture coordinates. Those that are not shared by index are where point and value are the same.
    pub(super) fn set_uvs(&mut self, given: AtCorners<DVec2>) -> Result<(), Problem> {
        if let Some(i) = given.values.iter().position(|uv| !uv.is_finite()) {
            return Err(Problem::new(format!("texture coordinate {i} is not finite")));
        }
        match given.indices {
            Some(indices) => (self.uvs, self.uv_corners) = (given.values, indices),
            None => {
                let mut known: HashMap<(u32, [u64; 2]), u32> = HashMap::with_capacity(self.points.len());
                self.uvs.clear();
                self.uv_corners = Vec::with_capacity(given.values.len());
                for (uv, &point) in given.values.iter().zip(&self.corners) {
                    let index = *known.entry((point, uv.to_array().map(f64::to_bits))).or_insert_with(|| {
                        self.uvs.push(*uv);
                        self.uvs.len() as u32 - 1
                    });
                    self.uv_corners.push(index);
                }
            }
        }
        Ok(())
    }

    /// Which of an object's sets of texture coordinates is meant: the one that is asked for, or the first, which is noted where
    /// there are more; `None` where there are none.
    pub(super) fn choose_uvs(
        &mut self,
        object: &str,
        sets: &[String],
        asked: Option<&str>,
    ) -> Result<Option<usize>, Problem> {
        let all = listed_or_none(sets);
        if let Some(asked) = asked {
            let missing = || Problem::new(format!("no texture coordinates `{asked}`; there are: {all}"));
            return sets.iter().position(|set| set == asked).map(Some).ok_or_else(missing);
        }
        if let [first, _, ..] = sets {
            self.notes
                .push(format!("{object}: of the texture coordinates {all} `{first}` are taken; `uv` names others"));
        }
        Ok((!sets.is_empty()).then_some(0))
    }

    /// Gives it normals; none at all where one has no direction.
    pub(super) fn set_normals(&mut self, given: &AtCorners<DVec3>) {
        let at = |i: usize| given.indices.as_ref().map_or(given.values[i], |own| given.values[own[i] as usize]);
        let normals: Vec<DVec3> = (0..self.corners.len()).map(|i| at(i).normalize_or_zero()).collect();
        if !normals.contains(&DVec3::ZERO) {
            self.normals = normals;
        }
    }

    /// Puts it into the space of the stage; faces are turned where that mirrors them, or where they were wound the
    /// other way from the start.
    ///
    /// # Errors
    /// If that space is nowhere.
    pub(super) fn place(&mut self, to_stage: &DMat4, clockwise: bool) -> Result<(), Problem> {
        if !to_stage.is_finite() {
            return Err(Problem::new("its transform is not finite"));
        }
        for p in &mut self.points {
            *p = to_stage.transform_point3(*p);
        }
        let turn = DMat3::from_mat4(*to_stage).inverse().transpose();
        for n in &mut self.normals {
            *n = (turn * *n).normalize_or(*n);
        }
        if (to_stage.determinant() < 0.0) != clockwise {
            let mut first = 0;
            for &count in &self.counts {
                let own = first..first + count as usize;
                self.corners[own.clone()].reverse();
                if !self.uv_corners.is_empty() {
                    self.uv_corners[own.clone()].reverse();
                }
                if !self.normals.is_empty() {
                    self.normals[own.clone()].reverse();
                }
                first = own.end;
            }
        }
        Ok(())
    }

    /// Puts all faces into a second group of this name, unless there is one.
    pub(super) fn group_all(&mut self, name: &str) {
        if !self.counts.is_empty() && !self.groups.iter().any(|group| group.name == name) {
            let faces = (0..self.counts.len() as u32).collect();
            self.groups.push(FaceGroup { name: name.to_owned(), faces, is_second: true });
        }
    }

    /// Puts faces of no group into one of this name; where there are none such, all faces are a second group.
    pub(super) fn group_the_rest(&mut self, name: &str) {
        let mut taken = vec![false; self.counts.len()];
        let own = self.groups.iter().filter(|group| !group.is_second);
        own.flat_map(|group| &group.faces).for_each(|&f| taken[f as usize] = true);
        let rest: Vec<u32> = (0..self.counts.len() as u32).filter(|&f| !taken[f as usize]).collect();
        if rest.is_empty() {
            self.group_all(name);
        } else {
            self.groups.push(FaceGroup { name: name.to_owned(), faces: rest, is_second: false });
        }
    }

    /// Adds a group of these faces.
    pub(super) fn add_group(&mut self, name: &str, faces: &[i64], is_second: bool) -> Result<(), Problem> {
        let count = self.counts.len();
        let known = |&face: &i64| {
            let face = usize::try_from(face).ok().filter(|&f| f < count).map(|f| f as u32);
            face.ok_or_else(|| Problem::new(format!("subset {name} names a face that is none of {count}")))
        };
        let faces = faces.iter().map(known).collect::<Result<_, _>>()?;
        self.groups.push(FaceGroup { name: name.to_owned(), faces, is_second });
        Ok(())
    }

    /// Takes faces away that are holes.
    #[cfg_attr(not(feature = "usd"), allow(dead_code, reason = "Alembic has no holes"))]
    pub(super) fn cut_out(&mut self, holes: &[i64]) -> Result<(), Problem> {
        let count = self.counts.len();
        let mut kept = vec![true; count];
        for &hole in holes {
            let face = usize::try_from(hole).ok().and_then(|f| kept.get_mut(f));
            *face.ok_or_else(|| Problem::new(format!("hole {hole} is no face of {count}")))? = false;
        }
        let of_corners: Vec<bool> =
            kept.iter().zip(&self.counts).flat_map(|(&k, &n)| std::iter::repeat_n(k, n as usize)).collect();
        let mut before = 0;
        let number = |&k: &bool| {
            let own = before;
            before += u32::from(k);
            own
        };
        let moved: Vec<u32> = kept.iter().map(number).collect();
        keep(&mut self.corners, &of_corners);
        keep(&mut self.uv_corners, &of_corners);
        keep(&mut self.normals, &of_corners);
        keep(&mut self.counts, &kept);
        for group in &mut self.groups {
            group.faces.retain(|&f| kept[f as usize]);
            group.faces.iter_mut().for_each(|f| *f = moved[*f as usize]);
        }
        self.groups.retain(|group| !group.faces.is_empty());
        Ok(())
    }

    /// Adds another one. Where one of them has no texture coordinates its own are zero, which is noted; normals are kept where both have
    /// them.
    pub(super) fn append(&mut self, mut other: Self) {
        let (first_point, first_face) = (self.points.len() as u32, self.counts.len() as u32);
        if !self.uv_corners.is_empty() || !other.uv_corners.is_empty() {
            let zero = |mesh: &mut Self| {
                if mesh.uv_corners.is_empty() && !mesh.corners.is_empty() {
                    let names: Vec<&str> = mesh.groups.iter().map(|group| group.name.as_str()).collect();
                    mesh.notes.push(format!(
                        "without texture coordinates beside meshes that have some: {}",
                        names.join(", ")
                    ));
                    mesh.uvs = vec![DVec2::ZERO];
                    mesh.uv_corners = vec![0; mesh.corners.len()];
                }
            };
            zero(self);
            zero(&mut other);
            let first = self.uvs.len() as u32;
            self.uvs.extend(other.uvs);
            self.uv_corners.extend(other.uv_corners.into_iter().map(|i| i + first));
        }
        if self.corners.is_empty() || (!self.normals.is_empty() && !other.normals.is_empty()) {
            self.normals.extend(&other.normals);
        } else {
            self.normals.clear();
        }
        self.points.extend(other.points);
        self.counts.extend(other.counts);
        self.corners.extend(other.corners.into_iter().map(|c| c + first_point));
        for mut group in other.groups {
            group.faces.iter_mut().for_each(|f| *f += first_face);
            self.groups.push(group);
        }
        self.notes.extend(other.notes);
        self.warnings.extend(other.warnings);
    }

    /// The same as triangles whose corners have a point, a normal and a texture coordinate each.
    pub fn to_mesh(&self) -> Mesh {
        let mut mesh = Mesh::default();
        let mut known: HashMap<(u32, u32, [u64; 3]), u32> = HashMap::with_capacity(self.points.len());
        let mut vertex = |corner: usize| {
            let uv = self.uv_corners.get(corner).copied();
            let normal = self.normals.get(corner).copied();
            let bits = normal.map_or([0; 3], |n| n.to_array().map(f64::to_bits));
            *known.entry((self.corners[corner], uv.unwrap_or(0), bits)).or_insert_with(|| {
                mesh.points.push(self.points[self.corners[corner] as usize]);
                mesh.uvs.extend(uv.map(|i| self.uvs[i as usize]));
                mesh.normals.extend(normal);
                mesh.points.len() as u32 - 1
            })
        };
        // In the order of corners, which no cut changes.
        let vertices: Vec<u32> = (0..self.corners.len()).map(&mut vertex).collect();
        mesh.triangles = self.triangles().map(|t| t.map(|corner| vertices[corner])).collect();
        mesh
    }

    /// The indices into `corners` of every triangle, each polygon cut as it lies in space.
    pub fn triangles(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        let at = |&corner: &u32| self.points[corner as usize];
        self.cut(move |own| polygon::in_plane(&self.corners[own].iter().map(at).collect::<Vec<_>>()))
    }

    /// The same, each polygon cut as it lies in the texture coordinates, which must be there.
    pub(crate) fn triangles_in_uv(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        self.cut(|own| self.uv_corners[own].iter().map(|&uv| self.uvs[uv as usize]).collect())
    }

    fn cut<'a>(&'a self, flat: impl Fn(Range<usize>) -> Vec<DVec2> + 'a) -> impl Iterator<Item = [usize; 3]> + 'a {
        let first = self.counts.iter().scan(0, |sum, &count| {
            let first = *sum;
            *sum += count as usize;
            Some(first..*sum)
        });
        first.flat_map(move |own| {
            let first = own.start;
            polygon::triangles(&flat(own)).into_iter().map(move |t| t.map(|k| first + k))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quad() -> PolygonMesh {
        let points = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        PolygonMesh::new(points.to_vec(), &[4], &[0, 1, 2, 3]).unwrap()
    }

    #[test]
    fn mirrored_faces_are_turned() {
        let mut mesh = quad();
        mesh.place(&DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)), false).unwrap();
        let nowhere = DMat4::from_translation(DVec3::new(f64::NAN, 0.0, 0.0));
        assert!(mesh.clone().place(&nowhere, false).is_err());
        assert_eq!(mesh.corners, [3, 2, 1, 0]);
        assert_eq!(mesh.triangles().collect::<Vec<_>>(), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn hollow_faces_are_cut_by_ears() {
        let points = [[0.0, 0.0], [12.0, 6.0], [24.0, 0.0], [12.0, 24.0]].map(|[x, y]| DVec3::new(0.0, x, y));
        let mut mesh = PolygonMesh::new(points.to_vec(), &[4, 3], &[0, 1, 2, 3, 0, 1, 3]).unwrap();
        assert_eq!(mesh.triangles().collect::<Vec<_>>(), [[1, 2, 3], [0, 1, 3], [4, 5, 6]]);
        // Convex as it was cut from flat cloth.
        let uv = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        mesh.set_uvs(AtCorners { values: uv.map(DVec2::from).to_vec(), indices: None }).unwrap();
        assert_eq!(mesh.triangles_in_uv().collect::<Vec<_>>(), [[0, 1, 2], [0, 2, 3], [4, 5, 6]]);
    }

    #[test]
    fn unshared_texture_coordinates_are_shared_where_they_are_the_same() {
        let points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        let mut mesh = PolygonMesh::new(points.to_vec(), &[3, 3], &[0, 1, 2, 2, 1, 3]).unwrap();
        let uv = |x, y| DVec2::new(x, y);
        let values = vec![uv(0.0, 0.0), uv(1.0, 0.0), uv(0.0, 1.0), uv(0.0, 1.0), uv(5.0, 0.0), uv(1.0, 1.0)];
        mesh.set_uvs(AtCorners { values, indices: None }).unwrap();
        assert_eq!(mesh.uv_corners, [0, 1, 2, 2, 3, 4]);
    }

    #[test]
    fn meshes_add_up() {
        let mut all = PolygonMesh::default();
        let mut textured = quad();
        textured.set_uvs(AtCorners { values: vec![DVec2::ONE; 4], indices: None }).unwrap();
        textured.group_the_rest("a");
        all.append(textured);
        let mut bare = quad();
        bare.group_the_rest("b");
        all.append(bare);
        assert_eq!((all.points.len(), all.corners[4], all.uv_corners.len()), (8, 4, 8));
        assert_eq!(all.uvs[all.uv_corners[7] as usize], DVec2::ZERO);
        assert_eq!(all.notes, ["without texture coordinates beside meshes that have some: b"]);
        assert_eq!(all.groups[1], FaceGroup { name: "b".into(), faces: vec![1], is_second: false });
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let points = vec![DVec3::ZERO; 3];
        let refused = |counts: &[i64], corners: &[i64]| PolygonMesh::new(points.clone(), counts, corners).is_err();
        assert!(refused(&[2], &[0, 1]) && refused(&[3], &[0, 1]) && refused(&[3], &[0, 1, 3]));
        assert!(refused(&[3], &[0, 1, -1]) && refused(&[i64::MAX, i64::MAX], &[]));
        assert!(PolygonMesh::new(vec![DVec3::NAN], &[], &[]).is_err());
        assert!(quad().add_group("x", &[1], false).is_err() && quad().add_group("x", &[-1], true).is_err());
    }
}
