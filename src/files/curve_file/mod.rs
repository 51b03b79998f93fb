//! Curve files: bytes in, a [`CurveSet`] out, and back to bytes.
//!
//! Seven formats are read: BCC (binary, Yuksel's yarn models), cyHair, PYP (periodic yarn patterns of MADYPG), the yarns
//! of stitch meshes, lines of Wavefront OBJ, plain text, and stages (USD and Alembic, by [`super::stage`]). All but PYP and Alembic are written.
//! Files come from strangers, so every number is checked before it is believed, memory stays a small multiple of the
//! file's size, and small defects are repaired with a note for the user. Radii, units and the direction of up are only
//! passed on; nothing is smoothed, scaled or sampled here.

mod abilities;
mod bcc;
mod faces;
mod hair;
#[cfg(feature = "usd")]
mod layer;
mod obj_lines;
mod pyp;
mod repair;
mod staged;
mod stitch_mesh;
#[cfg(test)]
mod tests;
mod text;
mod yarns;

use std::borrow::Cow;
use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::{
    files::{
        EXPORT, extension, foreign, has_extension,
        stage::{self, PrimPattern, Stage},
    },
    geometry::curve::{Basis, CurveSet},
    input::{diagnostic::listed, system::hindrance},
    pattern::tile::Tile,
};

pub(crate) use abilities::abilities;
pub use bcc::write_bcc;
pub use hair::write_hair;
pub use obj_lines::write_obj_lines;
pub use text::write_text;
pub use yarns::write_yarns;

/// The largest coordinate that is believed, in the file's own unit: beyond it no unit makes cloth of it.
const FARTHEST: f64 = 1e12;

/// The radius of curves that have none, in their own unit, where a format needs one.
pub(crate) const SOME_RADIUS: f64 = 0.5;

/// What the file itself cannot say.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// How the points of a text, cyHair, OBJ or `.yarns` file are meant; Catmull-Rom if absent. The other formats know their
    /// own.
    pub basis: Option<Basis>,
    /// How many cells of a periodic pattern (PYP) to lay out along x and y; each at least 1.
    pub tile: [u32; 2],
    /// The largest number of control points to accept, counted before repairs and, for PYP, over all cells.
    pub max_points: u64,
    /// Which objects of a stage (USD, Alembic) are meant; all if absent.
    pub prim: Option<PrimPattern>,
    /// The frame of a stage; its earliest time if absent.
    pub frame: Option<f64>,
    /// The face library of a stitch mesh; the file of its name that ends in `.sf` if absent.
    pub faces: Option<PathBuf>,
}

impl Default for ReadOptions {
    /// One cell, at most 2^27 points (3.2 GB of coordinates).
    fn default() -> Self {
        Self { basis: None, tile: [1, 1], max_points: 1 << 27, prim: None, frame: None, faces: None }
    }
}

/// The file formats that [`parse`] understands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Binary Curve Collection: a 64-byte header, then a count and little-endian coordinates for each curve.
    Bcc,
    /// cyHair: a 128-byte header, then arrays of segments, points and thickness.
    Hair,
    /// Line elements of a Wavefront OBJ file.
    Obj,
    /// MADYPG periodic yarn pattern: text sections `*pattern`, `*Q` and `*E`, lengths in metres.
    Pyp,
    /// `x y z [radius]` on each line, a blank line between curves, `#` begins a comment. A curve whose last line
    /// repeats its first, radius included, is closed (it needs four lines or more).
    Text,
    /// The yarns of a stitch mesh (textiles-lab/smobj): chunks of points, and radius and colour of each yarn.
    Yarns,
}

/// Where in a file something is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileLocation {
    /// No particular place: the file as a whole.
    File,
    /// Byte offset from the beginning, counted from 0.
    Byte(u64),
    /// Line number, counted from 1.
    Line(u64),
}

/// Why a curve file could not be read. Displays as one line: file, place, problem, hint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CurveFileError {
    /// The file as the caller named it; absent when the bytes came from elsewhere.
    pub file: Option<PathBuf>,
    /// Where the trouble begins.
    pub location: FileLocation,
    /// What was expected and what was found.
    pub problem: String,
    /// What the user might try.
    pub hint: Option<String>,
}

impl CurveFileError {
    fn new(location: FileLocation, problem: impl Into<String>) -> Self {
        Self { file: None, location, problem: problem.into(), hint: None }
    }

    fn byte(offset: usize, problem: impl Into<String>) -> Self {
        Self::new(FileLocation::Byte(offset as u64), problem)
    }

    fn line(number: u64, problem: impl Into<String>) -> Self {
        Self::new(FileLocation::Line(number), problem)
    }

    fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    fn in_file(mut self, path: &Path) -> Self {
        self.file = Some(path.to_path_buf());
        self
    }

    fn too_many_points(location: FileLocation, found: impl fmt::Display, options: &ReadOptions) -> Self {
        Self::new(location, format!("{found} points are more than the {} allowed", options.max_points))
    }
}

impl fmt::Display for CurveFileError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(out, "{}: ", file.display())?;
        }
        match self.location {
            FileLocation::File => {}
            FileLocation::Byte(offset) => write!(out, "byte {offset}: ")?,
            FileLocation::Line(number) => write!(out, "line {number}: ")?,
        }
        out.write_str(&self.problem)?;
        match &self.hint {
            Some(hint) => write!(out, "; {hint}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for CurveFileError {}

/// Reads the curves of a file.
///
/// Stages are known by their extension (`.usd`, `.usda`, `.usdc`, `.usdz`, `.abc`), and stitch meshes (`.smobj`). Else the
/// content decides first (BCC, cyHair and `.yarns` files begin with letters of their own), then the extension: `.bcc`,
/// `.hair`, `.pyp`, `.obj`, `.yarns`, `.txt` or `.curves`. Repairs are listed in [`CurveSet::notes`].
///
/// # Errors
/// The file cannot be read, is of no known format, or breaks the rules of its format.
pub fn read(path: &Path, options: &ReadOptions) -> Result<CurveSet, CurveFileError> {
    read_unnamed(path, options).and_then(within_reach).map_err(|error| error.in_file(path))
}

/// Reads a periodic curve file (PYP) as the tile that it repeats, millimetres.
///
/// # Errors
/// As [`read`]; a file of another format.
pub fn read_tile(path: &Path) -> Result<Tile, CurveFileError> {
    let read = || {
        let tile = pyp::tile(&read_bytes(path)?)?;
        check_reach(tile.strands.iter().map(|strand| strand.points.as_slice()))?;
        Ok(tile)
    };
    read().map_err(|error: CurveFileError| error.in_file(path))
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, CurveFileError> {
    let unreadable = |error: std::io::Error| {
        let problem = hindrance(&error).map_or_else(|| format!("cannot be read: {error}"), str::to_owned);
        CurveFileError::new(FileLocation::File, problem)
    };
    let metadata = fs::metadata(path).map_err(|error| unreadable(error).hint("is the path right?"))?;
    // A pipe or a device may never end.
    if !metadata.is_file() {
        return Err(CurveFileError::new(FileLocation::File, "expected a regular file, found a folder, pipe or device"));
    }
    fs::read(path).map_err(unreadable)
}

/// Reads the curves of a stage that is open: at several times it need not be opened again.
///
/// # Errors
/// The stage is damaged, or has no visible curves that are chosen.
pub fn read_stage(stage: &Stage, options: &ReadOptions) -> Result<CurveSet, CurveFileError> {
    staged::read_open(stage, options).and_then(within_reach).map_err(|error| error.in_file(stage.path()))
}

fn read_unnamed(path: &Path, options: &ReadOptions) -> Result<CurveSet, CurveFileError> {
    if stage::is_stage(path) {
        return staged::read(path, options);
    }
    if has_extension(path, STITCH_MESH) {
        let own = path.with_extension("sf");
        let library = options.faces.as_ref().unwrap_or(&own);
        let in_library = |error: CurveFileError| {
            let text = error.in_file(library).to_string();
            CurveFileError::new(FileLocation::File, format!("its faces: {text}"))
        };
        let library = read_bytes(library).and_then(|bytes| faces::parse(&bytes)).map_err(in_library)?;
        return stitch_mesh::parse(&read_bytes(path)?, &library, options);
    }
    let bytes = read_bytes(path)?;
    let format = recognise(&bytes, path).ok_or_else(|| {
        if let Some(format) = foreign(path) {
            return CurveFileError::new(FileLocation::File, format!("{format} files are not read")).hint(EXPORT);
        }
        CurveFileError::new(
            FileLocation::File,
            "expected a curve file, found neither the letters BCC or HAIR nor a known extension",
        )
        .hint(format!(
            "name it {} after its content",
            dotted(EXTENSIONS.iter().map(|(name, _)| *name).chain([STITCH_MESH]).chain(stage::EXTENSIONS))
        ))
    })?;
    // Binary formats tell what they miss.
    if bytes.is_empty() && matches!(format, Format::Text | Format::Obj) {
        return Err(CurveFileError::new(FileLocation::File, "the file is empty").hint("is the file cut short?"));
    }
    parse(&bytes, format, options)
}

/// The curves, unless they reach so far that no picture of them could be made.
fn within_reach(set: CurveSet) -> Result<CurveSet, CurveFileError> {
    check_reach(set.curves.iter().map(|curve| curve.points.as_slice()))?;
    Ok(set)
}

fn check_reach<'a>(curves: impl Iterator<Item = &'a [DVec3]>) -> Result<(), CurveFileError> {
    let far = |(number, points): (usize, &[DVec3])| {
        let point = points.iter().position(|point| point.abs().max_element() > FARTHEST)?;
        Some((number, point, points[point]))
    };
    let Some((curve, point, at)) = curves.enumerate().find_map(far) else { return Ok(()) };
    let problem = format!(
        "point {point} of curve {curve} is at [{:e}, {:e}, {:e}]; coordinates may be at most {FARTHEST:e}",
        at.x, at.y, at.z
    );
    Err(CurveFileError::new(FileLocation::File, problem).hint("is the file damaged?"))
}

fn recognise(bytes: &[u8], path: &Path) -> Option<Format> {
    if bytes.starts_with(bcc::MAGIC) {
        return Some(Format::Bcc);
    }
    if bytes.starts_with(hair::MAGIC) {
        return Some(Format::Hair);
    }
    if bytes.starts_with(yarns::MAGIC) {
        return Some(Format::Yarns);
    }
    of_extension(path)
}

/// Extensions by which formats are known where the content does not tell, but for stages and stitch meshes.
const EXTENSIONS: [(&str, Format); 7] = [
    ("bcc", Format::Bcc),
    ("hair", Format::Hair),
    ("pyp", Format::Pyp),
    ("obj", Format::Obj),
    ("yarns", Format::Yarns),
    ("txt", Format::Text),
    ("curves", Format::Text),
];

/// The extension of stitch meshes.
const STITCH_MESH: &str = "smobj";

fn of_extension(path: &Path) -> Option<Format> {
    let found = extension(path)?;
    EXTENSIONS.iter().find(|(name, _)| *name == found).map(|(_, format)| *format)
}

/// Extensions with their dots, for messages.
fn dotted<'a>(names: impl Iterator<Item = &'a str>) -> String {
    listed(names.map(|name| format!(".{name}")), "or")
}

fn is_written(format: Format) -> bool {
    format != Format::Pyp
}

/// The extensions of files that [`write()`] writes, as in "`.bcc, .hair or .obj`".
pub fn written_extensions() -> String {
    let own = EXTENSIONS.iter().filter(|(_, format)| is_written(*format)).map(|(name, _)| *name);
    #[cfg(feature = "usd")]
    let own = own.chain(layer::EXTENSIONS);
    dotted(own)
}

/// Reads curves from bytes of a known format; touches nothing outside its arguments.
///
/// ```
/// use yarnray::files::curve_file::{FileLocation, Format, ReadOptions, parse};
///
/// let set = parse(b"0 0 0\n1 0 0\n2 1 0\n3 1 0\n", Format::Text, &ReadOptions::default()).unwrap();
/// assert_eq!(set.curves[0].points.len(), 4);
///
/// let error = parse(b"0 0 0\n1 zero 0\n", Format::Text, &ReadOptions::default()).unwrap_err();
/// assert_eq!(error.location, FileLocation::Line(2));
/// ```
///
/// # Errors
/// The bytes break the rules of the format, or hold more points than allowed. [`CurveFileError::file`] is absent.
pub fn parse(bytes: &[u8], format: Format, options: &ReadOptions) -> Result<CurveSet, CurveFileError> {
    let mut set = match format {
        Format::Bcc => bcc::parse(bytes, options)?,
        Format::Hair => hair::parse(bytes, options)?,
        Format::Obj => obj_lines::parse(bytes, options)?,
        Format::Pyp => pyp::parse(bytes, options)?,
        Format::Text => text::parse(bytes, options)?,
        Format::Yarns => yarns::parse(bytes, options)?,
    };
    if set.curves.is_empty() {
        set.notes.push("the file holds no curve that can be drawn".into());
    }
    if matches!(format, Format::Bcc | Format::Pyp) && options.basis.is_some() {
        set.notes.push("the basis asked for was ignored: this format fixes its own".into());
    }
    if format != Format::Pyp && options.tile != [1, 1] {
        set.notes.push("the tile counts asked for were ignored: only periodic patterns (.pyp) are tiled".into());
    }
    Ok(set)
}

/// Whether a file is named as those that [`read`] reads, stages (which may hold no curves) among them.
pub fn can_read(path: &Path) -> bool {
    recognise(&[], path).is_some() || has_extension(path, STITCH_MESH) || stage::is_stage(path)
}

/// The format that a file's name asks for, if it can be written.
fn written_as(path: &Path) -> Option<Format> {
    of_extension(path).filter(|format| is_written(*format))
}

/// Whether [`write()`] knows a format by this name.
pub fn can_write(path: &Path) -> bool {
    #[cfg(feature = "usd")]
    if layer::can_write(path) {
        return true;
    }
    written_as(path).is_some()
}

/// Writes curves in the format that the extension of `path` names (`.bcc`, `.hair`, `.obj`, `.yarns`, `.txt`,
/// `.curves`, `.usda`, `.usdc`, `.usd`) to `out`.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`] if there is no such format or the curves do not fit it; whatever `out` reports.
pub fn write(path: &Path, set: &CurveSet, out: &mut impl io::Write) -> io::Result<()> {
    #[cfg(feature = "usd")]
    if layer::can_write(path) {
        return layer::write(path, set, out);
    }
    match written_as(path) {
        Some(Format::Bcc) => write_bcc(set, out),
        Some(Format::Hair) => write_hair(set, out),
        Some(Format::Obj) => write_obj_lines(set, out),
        Some(Format::Text) => write_text(set, out),
        Some(Format::Yarns) => write_yarns(set, out),
        Some(Format::Pyp) | None => {
            Err(io::Error::new(io::ErrorKind::InvalidInput, format!("a curve file ends in {}", written_extensions())))
        }
    }
}

/// One line of a text format.
struct Line<'a> {
    /// Counted from 1.
    number: u64,
    /// Without comment and surrounding space.
    content: Cow<'a, str>,
    /// Nothing on it, not even a comment.
    blank: bool,
}

/// The lines of a text format. Bytes that are no UTF-8 become replacement characters, which no number contains.
fn lines(bytes: &[u8]) -> impl Iterator<Item = Line<'_>> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    bytes.split(|&byte| byte == b'\n').zip(1..).map(|(raw, number)| {
        let raw = raw.trim_ascii();
        let end = raw.iter().position(|&byte| byte == b'#').unwrap_or(raw.len());
        Line { number, content: String::from_utf8_lossy(raw[..end].trim_ascii()), blank: raw.is_empty() }
    })
}

/// A finite number, or an error that says which one was expected.
fn number(token: &str, name: &str, line: u64) -> Result<f64, CurveFileError> {
    match token.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(CurveFileError::line(line, format!("expected a finite number for {name}, found {}", quoted(token)))),
    }
}

/// A piece of the file for a message: quoted, escaped and not too long.
pub(super) fn quoted(token: &str) -> String {
    const LONGEST: usize = 40;
    let head: String = token.chars().take(LONGEST).collect();
    let dots = if head.len() < token.len() { "..." } else { "" };
    format!("\"{}{dots}\"", head.escape_debug())
}
