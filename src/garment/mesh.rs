//! Garment meshes: OBJ files with the flat panels as texture coordinates.
//!
//! What a picture's mesh does without is needed here: the group and material of each face, texture seams as they are in
//! the file, and the line of a face, so that what is wrong with a panel can be said where it is. `tobj` keeps none of the
//! lines and splits vertices, so that this reader is the program's own.

use std::{
    collections::HashMap,
    fmt,
    path::{Path, PathBuf},
};

use glam::{DVec2, DVec3};

use crate::{
    files::{EXPORT, foreign, obj_text::ObjLines, stage::PolygonMesh},
    geometry::polygon,
    input::system::in_words,
    math::words::counted,
};

/// The largest file that is read.
const MAX_BYTES: u64 = 1 << 30;

/// Why a garment cannot be laid: for the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct GarmentError {
    /// The mesh file, if it is at fault.
    pub path: Option<PathBuf>,
    /// Counted from 1; 0 where no line is at fault.
    pub line: usize,
    /// Whether the mesh is at fault, and not what is asked of it.
    pub of_mesh: bool,
    /// The number of the cloth that asks for what cannot be, if one does.
    pub cloth: Option<usize>,
    /// What is wrong.
    pub problem: String,
    /// What to do.
    pub hint: String,
}

impl GarmentError {
    /// Something that is wrong with the scene's numbers, not with the file.
    pub(crate) fn new(problem: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { of_mesh: false, ..Self::at(0, problem, hint) }
    }

    /// Something that is wrong with the mesh, in a line of its file or, at 0, as a whole.
    pub(super) fn at(line: usize, problem: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { path: None, line, of_mesh: true, cloth: None, problem: problem.into(), hint: hint.into() }
    }

    /// The same, of a file.
    #[must_use]
    pub(crate) fn of(mut self, path: &Path) -> Self {
        self.path.get_or_insert_with(|| path.to_owned());
        self
    }
}

impl fmt::Display for GarmentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.path, self.line) {
            (Some(path), 0) => write!(f, "{}: {}", path.display(), self.problem),
            (Some(path), line) => write!(f, "{}:{line}: {}", path.display(), self.problem),
            _ => write!(f, "{}", self.problem),
        }
    }
}

impl std::error::Error for GarmentError {}

/// A triangle of a garment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Face {
    /// Indices of its corners' positions, counter-clockwise from outside.
    pub points: [u32; 3],
    /// Indices of its corners' texture coordinates.
    pub uvs: [u32; 3],
    /// Index of its group and material together.
    pub part: u32,
    /// Where it is in the file.
    pub line: u32,
    /// Index of the polygon that it was cut from.
    pub polygon: u32,
}

/// The names that a `[[fabric.panel]]` may choose a face by.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Part {
    /// OBJ group, or object where there is no group.
    pub group: String,
    /// OBJ material; empty without.
    pub material: String,
}

/// A garment as it is in its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct GarmentMesh {
    /// Positions, in the file's unit.
    pub points: Vec<DVec3>,
    /// Texture coordinates, in their own unit.
    pub uvs: Vec<DVec2>,
    /// Triangles.
    pub faces: Vec<Face>,
    /// What faces belong to.
    pub parts: Vec<Part>,
    /// What was repaired, one line each.
    pub notes: Vec<String>,
}

impl GarmentMesh {
    /// Reads a file.
    ///
    /// # Errors
    /// What is wrong with it, and in which line.
    pub(crate) fn read(path: &Path) -> Result<Self, GarmentError> {
        let fail =
            |problem: String| GarmentError::new(problem, "a mesh in OBJ format with texture coordinates").of(path);
        let meta = std::fs::metadata(path).map_err(|e| fail(in_words(&e)))?;
        if !meta.is_file() {
            return Err(fail("not a file".to_owned()));
        }
        if let Some(format) = foreign(path) {
            let hint = format!("{EXPORT}, with its texture coordinates");
            return Err(GarmentError::new(format!("{format} files are not read"), hint).of(path));
        }
        if meta.len() > MAX_BYTES {
            return Err(fail(format!("{} bytes; at most {MAX_BYTES} are read", meta.len())));
        }
        let bytes = std::fs::read(path).map_err(|e| fail(in_words(&e)))?;
        Self::parse(&String::from_utf8_lossy(&bytes)).map_err(|e| e.of(path))
    }

    /// Takes the mesh of a stage; its groups are subsets of faces or objects, and faces have no lines.
    ///
    /// # Errors
    /// Faces without texture coordinates.
    pub(crate) fn from_polygons(given: &PolygonMesh) -> Result<Self, GarmentError> {
        if given.uv_corners.len() != given.corners.len() {
            let hint = "the texture coordinates (`st`) are the flat panels of the garment: export them with the mesh";
            return Err(GarmentError::at(0, "a mesh without texture coordinates", hint));
        }
        let mut mesh = Self { points: given.points.clone(), notes: given.notes.clone(), ..Self::default() };
        // Which group and which second one each face is in first, from 1.
        let mut names = vec![[0; 2]; given.counts.len()];
        for (group, number) in given.groups.iter().zip(1..) {
            for &face in &group.faces {
                let own = &mut names[face as usize][usize::from(group.is_second)];
                *own = if *own == 0 { number } else { *own };
            }
        }
        let name = |number: usize| given.groups.get(number.wrapping_sub(1)).map_or("", |group| &group.name);
        let mut parts: HashMap<[usize; 2], u32> = HashMap::new();
        let mut part = |own: &[usize; 2]| {
            *parts.entry(*own).or_insert_with(|| {
                mesh.part(&Part { group: name(own[0]).to_owned(), material: name(own[1]).to_owned() })
            })
        };
        let part_of_face: Vec<u32> = names.iter().map(&mut part).collect();
        // Corners that have the same point and value are one, however the file shares them.
        let mut known: HashMap<(u32, [u64; 2]), u32> = HashMap::new();
        let mut uv = |corner: usize| {
            let value = given.uvs[given.uv_corners[corner] as usize];
            *known.entry((given.corners[corner], value.to_array().map(f64::to_bits))).or_insert_with(|| {
                mesh.uvs.push(value);
                mesh.uvs.len() as u32 - 1
            })
        };
        // In the order of corners, which no cut changes.
        let uvs: Vec<u32> = (0..given.corners.len()).map(&mut uv).collect();
        let of_polygons = given.counts.iter().zip(&part_of_face).zip(0..);
        let faces =
            of_polygons.flat_map(|((&count, &part), polygon)| std::iter::repeat_n((part, polygon), count as usize - 2));
        let triangles = given.triangles_in_uv().zip(faces);
        mesh.faces = triangles
            .map(|(t, (part, polygon))| Face {
                points: t.map(|c| given.corners[c]),
                uvs: t.map(|c| uvs[c]),
                part,
                line: 0,
                polygon,
            })
            .collect();
        Ok(mesh)
    }

    /// Takes a mesh from the text of an OBJ file.
    ///
    /// # Errors
    /// As [`Self::read`], without the file's name.
    pub(crate) fn parse(text: &str) -> Result<Self, GarmentError> {
        let mut mesh = Self::default();
        let mut part = Part { group: String::new(), material: String::new() };
        let mut polygons = Counted::default();
        let mut polygon = 0;
        // Bytes in memory are always there.
        for line in ObjLines::new(text.as_bytes()).map_while(Result::ok) {
            let number = line.number;
            let mut words = line.text.split_whitespace();
            match words.next() {
                Some("v") => mesh.points.push(DVec3::from(numbers(words, number)?)),
                Some("vt") => mesh.uvs.push(DVec2::from(numbers(words, number)?)),
                Some("g" | "o") => part.group = words.collect::<Vec<_>>().join(" "),
                Some("usemtl") => part.material = words.collect::<Vec<_>>().join(" "),
                Some("f") => {
                    let own = mesh.part(&part);
                    let corners: Vec<(u32, u32)> = words.map(|w| mesh.corner(w, number)).collect::<Result<_, _>>()?;
                    if corners.len() < 3 {
                        let problem = format!("a face of {} corners", corners.len());
                        return Err(GarmentError::at(number, problem, "faces have three corners or more"));
                    }
                    if corners.len() > 4 {
                        polygons.add(&part.group, number);
                    }
                    let flat: Vec<DVec2> = corners.iter().map(|&(_, uv)| mesh.uvs[uv as usize]).collect();
                    mesh.faces.extend(polygon::triangles(&flat).into_iter().map(|t| Face {
                        points: t.map(|k| corners[k].0),
                        uvs: t.map(|k| corners[k].1),
                        part: own,
                        line: number as u32,
                        polygon,
                    }));
                    polygon += 1;
                }
                _ => {
                    if let Some(problem) = line.damage() {
                        return Err(GarmentError::at(number, problem, "is the file damaged?"));
                    }
                }
            }
        }
        if mesh.faces.is_empty() {
            return Err(GarmentError::at(0, "there are no faces in it", "is this an OBJ file?"));
        }
        polygons.note("face", "of more than four corners, cut into triangles", &mut mesh.notes);
        Ok(mesh)
    }

    fn part(&mut self, part: &Part) -> u32 {
        let found = self.parts.iter().rposition(|p| p == part);
        found.unwrap_or_else(|| {
            self.parts.push(part.clone());
            self.parts.len() - 1
        }) as u32
    }

    /// `v/vt/vn` of a face; negative numbers count from the end.
    fn corner(&self, word: &str, line: usize) -> Result<(u32, u32), GarmentError> {
        let mut parts = word.split('/');
        let index = |text: Option<&str>, count: usize, what: &str| -> Result<u32, GarmentError> {
            let text = text.unwrap_or("");
            let value: Option<i64> = text.parse().ok();
            let Some(value) = value else {
                if what == "texture coordinate" && text.is_empty() {
                    let hint = "the texture coordinates are the flat panels of the garment: export them with the mesh";
                    return Err(GarmentError::at(line, "a face without texture coordinates", hint));
                }
                let shown: String = word.chars().take(20).collect();
                let problem = format!("expected v/vt of a corner, found \"{}\"", shown.escape_debug());
                return Err(GarmentError::at(line, problem, "f 1/1 2/2 3/3"));
            };
            let place = if value < 0 { count as i64 + value } else { value - 1 };
            if place < 0 || place >= count as i64 {
                let problem = format!("a face names {what} {value} of {count}");
                return Err(GarmentError::at(line, problem, "is the file cut short?"));
            }
            Ok(place as u32)
        };
        let point = index(parts.next(), self.points.len(), "point")?;
        Ok((point, index(parts.next(), self.uvs.len(), "texture coordinate")?))
    }

    /// Whether another frame of an animation has the same faces.
    ///
    /// # Errors
    /// What differs.
    pub(crate) fn same_topology<'a>(&'a self, other: &'a Self) -> Result<(), String> {
        if self.points.len() != other.points.len() {
            return Err(format!("{} points, where the first frame has {}", other.points.len(), self.points.len()));
        }
        if self.faces.len() != other.faces.len() {
            return Err(format!("{} triangles, where the first frame has {}", other.faces.len(), self.faces.len()));
        }
        // Texture coordinates that move may cut a polygon otherwise; the first frame's cut counts.
        let polygons = |mesh: &'a Self| mesh.faces.chunk_by(|a, b| a.polygon == b.polygon);
        let differs = polygons(self).zip(polygons(other)).find(|(a, b)| a != b && outline(a) != outline(b));
        match differs {
            Some((_, [face, ..])) if face.line > 0 => {
                Err(format!("the face in line {} has other corners than in the first frame", face.line))
            }
            Some(_) => Err("a face has other corners than in the first frame".to_owned()),
            None => Ok(()),
        }
    }
}

/// The edges around the triangles of a polygon, between corners that are point and texture coordinates.
fn outline(faces: &[Face]) -> Vec<[(u32, u32); 2]> {
    polygon::outline(faces.iter().map(|f| [0, 1, 2].map(|k| (f.points[k], f.uvs[k]))))
}

/// A panel by the name of its group, for people.
pub(super) fn panel_in_words(group: &str) -> String {
    if group.is_empty() { "the panel without a name".to_owned() } else { format!("panel `{group}`") }
}

/// Something that was found several times: how often, and where first.
#[derive(Clone, Debug, Default)]
pub(super) struct Counted {
    count: usize,
    panel: String,
    line: usize,
}

impl Counted {
    pub(super) fn add(&mut self, panel: &str, line: usize) {
        if self.count == 0 {
            (self.panel, self.line) = (panel.to_owned(), line);
        }
        self.count += 1;
    }

    pub(super) fn count(&self) -> usize {
        self.count
    }

    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// Both together.
    pub(super) fn with(self, later: Self) -> Self {
        let count = self.count + later.count;
        if self.count > 0 { Self { count, ..self } } else { Self { count, ..later } }
    }

    /// Says of so many of a thing what they are, once.
    pub(super) fn note(&self, noun: &str, what: &str, notes: &mut Vec<String>) {
        if self.count > 0 {
            let line = if self.line > 0 { format!(", line {}", self.line) } else { String::new() };
            let things = counted(self.count as u64, noun);
            notes.push(format!("{things} {what} (first in {}{line})", panel_in_words(&self.panel)));
        }
    }
}

fn numbers<'a, const N: usize>(
    mut words: impl Iterator<Item = &'a str>,
    line: usize,
) -> Result<[f64; N], GarmentError> {
    let mut out = [0.0; N];
    for value in &mut out {
        let word = words.next().unwrap_or("");
        let shown: String = word.chars().take(20).collect();
        let parsed: Option<f64> = word.parse().ok();
        *value = parsed.filter(|v| v.is_finite() && v.abs() < 1e12).ok_or_else(|| {
            let problem = format!("expected {N} finite numbers, found \"{}\"", shown.escape_debug());
            GarmentError::at(line, problem, "v 1.0 2.0 3.0 and vt 0.5 0.5")
        })?;
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUAD: &str = "g a b\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

    #[test]
    fn faces_keep_groups_materials_and_lines() {
        let mesh =
            GarmentMesh::parse(&format!("{QUAD}usemtl red\nf 1/1 2/2 3/3 4/4\ng c\nf -4/-4 -3/-3/9 -2/-2\n")).unwrap();
        assert_eq!(mesh.faces.len(), 3);
        assert_eq!(mesh.parts[1], Part { group: "c".into(), material: "red".into() });
        assert_eq!((mesh.faces[2].points, mesh.faces[2].line), ([0, 1, 2], 13));
        assert!(mesh.notes.is_empty());
    }

    #[test]
    fn lines_are_those_of_all_obj_files() {
        let plain = GarmentMesh::parse(&format!("{QUAD}f 1/1 2/2 3/3 4/4\n")).unwrap();
        let split = format!("{QUAD}f 1/1 2/2 \\\n3/3 4/4\n");
        let with_mark = format!("\u{feff}{}", &QUAD["g a b\n".len()..]);
        assert_eq!(GarmentMesh::parse(&split).unwrap(), plain);
        assert_eq!(GarmentMesh::parse(&split.replace("\\\n", "").replace('\n', "\r")).unwrap(), plain);
        assert_eq!(GarmentMesh::parse(&(with_mark + "f 1/1 2/2 3/3\n")).unwrap().points.len(), 4);
    }

    #[test]
    fn polygons_are_cut_as_the_first_frame_says() {
        let cut = |x: f64| format!("{}vt {x} {x}\nf 2/2 3/5 4/4 1/1\n", QUAD.replace("vt 1 1\n", "vt 9 9\n"));
        let [first, hollow] = [1.0, 0.3].map(|x| GarmentMesh::parse(&cut(x)).unwrap());
        assert_ne!(first.faces, hollow.faces, "the hollow one is cut through its inner corner");
        first.same_topology(&hollow).unwrap();
        let mut other = GarmentMesh::parse(&cut(1.0)).unwrap();
        other.faces[1].points.swap(0, 2);
        assert!(first.same_topology(&other).unwrap_err().contains("line 11"));
    }

    #[test]
    fn mistakes_are_placed() {
        let wrong = |more: &str| GarmentMesh::parse(&format!("{QUAD}{more}")).unwrap_err();
        assert_eq!(wrong("f 1/1 2/2 9/3\n").line, 10);
        assert!(wrong("f 1 2 3\n").problem.contains("texture"));
        assert!(wrong("f 1//1 2//1 3//1\n").problem.contains("texture"));
        assert!(wrong("f 1/1 -9/2 3/3\n").problem.contains("-9"));
        assert!(wrong("v nan 0 0\n").problem.contains("finite"));
        assert!(wrong("").problem.contains("no faces"));
        assert_eq!(wrong("vtt 0 0\n").line, 10);
        let many = GarmentMesh::parse(&format!("{QUAD}v 0 2 0\nvt 0 2\nf 1/1 2/2 3/3 4/4 5/5\n")).unwrap();
        assert!(many.notes[0].starts_with("1 face of more than four corners"), "{:?}", many.notes);
    }
}
