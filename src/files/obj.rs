//! Triangle meshes from Wavefront OBJ files.

use std::{
    fmt,
    fs::File,
    io::{self, BufRead, BufReader, Read},
    path::{Path, PathBuf},
};

use glam::{DVec2, DVec3};
use tobj::LoadError;

use super::{EXPORT, foreign, obj_text::ObjLines};
use crate::{
    geometry::{mesh::Mesh, polygon},
    input::system::in_words,
};

/// The largest file that is read.
const MAX_BYTES: u64 = 1 << 31;

/// Why a mesh could not be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct MeshError {
    path: PathBuf,
    /// Counted from 1; 0 where no line is at fault.
    line: usize,
    reason: String,
}

impl fmt::Display for MeshError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(f, "{}: {}", self.path.display(), self.reason),
            line => write!(f, "{}:{line}: {}", self.path.display(), self.reason),
        }
    }
}

impl std::error::Error for MeshError {}

/// The lines of a file for a parser, one at a time, so that its error has a place. Elements without faces are left out: the parser
/// would take those of three corners for faces.
struct OfFaces<R> {
    lines: ObjLines<R>,
    /// Of the file, the line that was given last.
    number: usize,
    /// What is wrong with it, if that was noticed here.
    problem: Option<String>,
    /// What is left of it.
    text: Vec<u8>,
    taken: usize,
}

impl<R: BufRead> OfFaces<R> {
    fn new(reader: R) -> Self {
        Self { lines: ObjLines::new(reader), number: 0, problem: None, text: Vec::new(), taken: 0 }
    }
}

impl<R: BufRead> Read for OfFaces<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let taken = self.fill_buf()?.read(buffer)?;
        self.consume(taken);
        Ok(taken)
    }
}

impl<R: BufRead> BufRead for OfFaces<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.taken == self.text.len()
            && let Some(line) = self.lines.next()
        {
            let line = line.inspect_err(|error| self.problem = Some(in_words(error)))?;
            self.number = line.number;
            if let Some(problem) = line.damage() {
                self.problem = Some(problem);
                return Err(io::ErrorKind::InvalidData.into());
            }
            let of_faces = !matches!(line.text.split_whitespace().next(), Some("l" | "p"));
            self.text = if of_faces { line.text.into_bytes() } else { Vec::new() };
            self.text.push(b'\n');
            self.taken = 0;
        }
        Ok(&self.text[self.taken..])
    }

    fn consume(&mut self, amount: usize) {
        self.taken += amount;
    }
}

/// Reads all faces of a file as one mesh; polygons are cut into triangles, materials, lines and points left aside. Where some
/// faces lack normals or texture coordinates, all go without.
///
/// # Errors
/// What is wrong with the file, and in which line.
pub(crate) fn read(path: &Path) -> Result<Mesh, MeshError> {
    read_grouped(path).map(|(mesh, _)| mesh)
}

/// As [`read`], with the names of groups and objects that have faces.
pub(crate) fn read_grouped(path: &Path) -> Result<(Mesh, Vec<String>), MeshError> {
    let fail = |line: usize, reason: String| MeshError { path: path.into(), line, reason };
    let file = File::open(path).map_err(|e| fail(0, in_words(&e)))?;
    let meta = file.metadata().map_err(|e| fail(0, in_words(&e)))?;
    if !meta.is_file() {
        return Err(fail(0, "not a file".to_owned()));
    }
    if let Some(format) = foreign(path) {
        return Err(fail(0, format!("{format} files are not read; {EXPORT}")));
    }
    if meta.len() > MAX_BYTES {
        return Err(fail(0, format!("{} bytes; at most {MAX_BYTES} are read", meta.len())));
    }
    parse(BufReader::new(file)).map_err(|(line, reason)| fail(line, reason))
}

fn parse(reader: impl BufRead) -> Result<(Mesh, Vec<String>), (usize, String)> {
    // Polygons are cut here: the parser's fans do not fill hollow ones.
    let options = tobj::LoadOptions { triangulate: false, single_index: true, ignore_points: true, ignore_lines: true };
    let mut reader = OfFaces::new(reader);
    // Materials of the file are not asked for: the scene names its own.
    let loaded = tobj::load_obj_buf(&mut reader, &options, |_| Ok(Default::default()));
    let (models, _) = loaded.map_err(|error| match (error, reader.problem.take()) {
        (_, Some(problem)) => (reader.number, problem),
        // Faces are put together when an object ends: the line is no longer known.
        (
            LoadError::FaceVertexOutOfBounds
            | LoadError::FaceTexCoordOutOfBounds
            | LoadError::FaceNormalOutOfBounds
            | LoadError::FaceColorOutOfBounds,
            None,
        ) => (0, format!("{error}: a face names what the file does not have")),
        (_, None) => (reader.number, format!("{error}; is this an OBJ file?")),
    })?;
    let with_faces = models.into_iter().filter(|m| !m.mesh.indices.is_empty());
    let (names, meshes): (Vec<String>, Vec<tobj::Mesh>) = with_faces.map(|m| (m.name, m.mesh)).unzip();
    if meshes.is_empty() {
        return Err((0, "there are no faces in it".to_owned()));
    }
    let normals = meshes.iter().all(|m| m.normals.len() == m.positions.len());
    let uvs = meshes.iter().all(|m| m.texcoords.len() / 2 == m.positions.len() / 3);
    let mut mesh = Mesh::default();
    for part in meshes {
        let first = mesh.points.len() as u64;
        if first + (part.positions.len() / 3) as u64 > u64::from(u32::MAX) {
            return Err((0, "more than 2^32 points".to_owned()));
        }
        let vector = |v: &[f32]| DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]));
        mesh.points.extend(part.positions.chunks_exact(3).map(vector));
        if normals {
            mesh.normals.extend(part.normals.chunks_exact(3).map(|n| vector(n).normalize_or(DVec3::Y)));
        }
        if uvs {
            mesh.uvs.extend(part.texcoords.chunks_exact(2).map(|t| DVec2::new(f64::from(t[0]), f64::from(t[1]))));
        }
        // Where all are triangles, none is counted.
        let counts = part.face_arities.iter().map(|&count| count as usize);
        let triangles = part.indices.len() / 3 * usize::from(part.face_arities.is_empty());
        let mut rest = part.indices.as_slice();
        for count in counts.chain(std::iter::repeat_n(3, triangles)) {
            let (face, others) = rest.split_at(count);
            let corners: Vec<DVec3> = face.iter().map(|&i| mesh.points[first as usize + i as usize]).collect();
            let cut = polygon::triangles(&polygon::in_plane(&corners));
            mesh.triangles.extend(cut.into_iter().map(|t| t.map(|k| face[k] + first as u32)));
            rest = others;
        }
    }
    if let Some(point) = mesh.points.iter().position(|p| !p.is_finite()) {
        return Err((0, format!("point {point} is not finite")));
    }
    if mesh.uvs.iter().any(|uv| !uv.is_finite()) {
        return Err((0, "a texture coordinate is not finite".to_owned()));
    }
    Ok((mesh, names))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Mesh, (usize, String)> {
        parse(text.as_bytes()).map(|(mesh, _)| mesh)
    }

    #[test]
    fn faces_of_all_forms_are_read() {
        let quad = "# a quad\no one\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
        let mesh = parsed(quad).unwrap();
        assert_eq!((mesh.points.len(), mesh.triangles.len()), (4, 2));
        assert!(mesh.normals.is_empty() && mesh.uvs.is_empty());
        let full = "v 0 0 0\nv 2 0 0\nv 0 3 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 5\nf 1/1/1 2/2/1 -1/-1/-1\n";
        let mesh = parsed(full).unwrap();
        assert_eq!(mesh.normals[2], DVec3::Z);
        assert_eq!((mesh.uvs[1], mesh.points[1]), (DVec2::X, DVec3::new(2.0, 0.0, 0.0)));
        // Two objects, one of which has normals: none has.
        let mixed = format!("{full}o two\nf 1 2 3\n");
        let mesh = parsed(&mixed).unwrap();
        assert_eq!((mesh.triangles.len(), mesh.normals.len(), mesh.uvs.len()), (2, 0, 0));
        assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.points.len()));
    }

    #[test]
    fn hollow_faces_are_filled_within_their_outline() {
        let mesh = parsed("v 0 0 0\nv 12 6 0\nv 24 0 0\nv 12 24 0\nf 1 2 3 4\nf 3 4 1 2\n").unwrap();
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| mesh.points[i as usize]);
            0.5 * (b - a).cross(c - a)
        };
        assert_eq!(mesh.triangles.len(), 4);
        assert!(mesh.triangles.iter().all(|t| area(t) == DVec3::new(0.0, 0.0, 108.0)), "{:?}", mesh.triangles);
    }

    #[test]
    fn lines_and_points_are_no_faces() {
        let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
        let with_face = format!("{corners}l 1 2 3\np 1 2 3 4\nf 1 2 4\nl 1 2 3 4\n");
        assert_eq!(parsed(&with_face).unwrap().triangles.len(), 1);
        assert!(parsed(&format!("{corners}l 1 2 3\n")).unwrap_err().1.contains("no faces"));
    }

    #[test]
    fn lines_end_and_go_on_as_they_may() {
        let plain = parsed("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        for text in [
            "\u{feff}v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 \\\n2 3",
            "v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3",
            "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n",
        ] {
            assert_eq!(parsed(text).unwrap(), plain, "{text:?}");
        }
        let damaged = parsed("v 0 0 0\nxv 1 0 0\nv 0 1 0\nf 1 2 2\n").unwrap_err();
        assert!(damaged.0 == 2 && damaged.1.contains("\"xv\""), "{damaged:?}");
        // The first line of those that belong together.
        assert_eq!(parsed("v 0 0 0\nv 1 \\\nzero 0\n").unwrap_err().0, 2);
    }

    #[test]
    fn mistakes_are_placed() {
        assert_eq!(parsed("v 0 0 0\nv 1 zero 0\n").unwrap_err().0, 2);
        assert!(parsed("v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 9\n").unwrap_err().1.contains("does not have"));
        assert_eq!(parsed("v 0 0 0\nf 1 2 x\n").unwrap_err().0, 2);
        assert!(parsed("").unwrap_err().1.contains("no faces"));
        assert!(parsed("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap_err().1.contains("finite"));
        assert!(parsed("\u{0}\u{1}garbage").is_err());
        let missing = read(Path::new("/nowhere/at/all.obj")).unwrap_err();
        assert_eq!(missing.to_string(), "/nowhere/at/all.obj: no such file");
    }
}
