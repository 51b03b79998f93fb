//! Alembic archives in the Ogawa container: curves and polygon meshes with their transforms.
//!
//! The layout was taken from the sources of Alembic 1.8 (lib/Alembic/AbcCoreOgawa and lib/Alembic/Ogawa). Archives have
//! neither unit nor up axis. Times are seconds; how many frames one has is what the archive says (`FramesPerTimeUnit`), or what
//! the distance of its samples tells, or else [`FRAMES_PER_SECOND`].

mod curves;
mod ogawa;
mod property;
#[cfg(test)]
mod tests;

use std::fmt;

use glam::{DMat4, DVec2, DVec3};

use super::{
    Contents, Format, MAX_DEPTH, PolygonMesh, PrimPattern, Problem, StageCamera, Take, curves::Spread, no_camera,
    polygons::AtCorners,
};
use ogawa::{Bytes, Cursor, Group};
pub(super) use ogawa::{HDF5_MAGIC, MAGIC};
use property::Compound;

/// Frames of a second where nothing tells them.
const FRAMES_PER_SECOND: f64 = 24.0;
/// Rates at which films and games run: samples so far apart are frames.
const RATES: [f64; 8] = [24000.0 / 1001.0, 24.0, 25.0, 30000.0 / 1001.0, 30.0, 50.0, 60000.0 / 1001.0, 60.0];
/// Objects that are read at most.
const MAX_OBJECTS: usize = 1 << 22;

/// When the samples of a property are, in seconds.
#[derive(Clone, Debug, PartialEq)]
struct TimeSampling {
    /// Seconds of a cycle, and the times in it; times without end where it is not cyclic.
    cycle: f64,
    times: Vec<f64>,
}

impl TimeSampling {
    fn time(&self, i: u32) -> f64 {
        let n = self.times.len();
        // A time per cycle beyond all others says that there are no cycles.
        if self.cycle > 1e100 {
            return self.times[(i as usize).min(n - 1)];
        }
        self.times[i as usize % n] + (i as usize / n) as f64 * self.cycle
    }

    /// The sample before a time, and how far it is from there to the next.
    fn around(&self, time: f64, samples: u32) -> (u32, f64) {
        let last = samples.saturating_sub(1);
        let (mut low, mut high) = (0, last);
        while low < high {
            let middle = low + (high - low).div_ceil(2);
            // Times that were rounded are meant.
            if self.time(middle) <= time + 1e-6 { low = middle } else { high = middle - 1 }
        }
        if low == last {
            return (last, 0.0);
        }
        let (before, after) = (self.time(low), self.time(low + 1));
        let share = if after > before { ((time - before) / (after - before)).clamp(0.0, 1.0) } else { 0.0 };
        (low, if share < 1e-6 { 0.0 } else { share })
    }
}

/// An archive in memory.
pub(super) struct Archive {
    bytes: Vec<u8>,
    samplings: Vec<TimeSampling>,
    /// Words that many headers share.
    metadata: Vec<String>,
    frames_per_second: f64,
}

impl fmt::Debug for Archive {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "Archive of {} bytes", self.bytes.len())
    }
}

/// An object on the way through an archive.
struct Object<'a> {
    path: String,
    name: &'a str,
    schema: &'a str,
    properties: Option<Compound<'a>>,
    to_stage: DMat4,
    /// Its children, of which some schemas know more.
    group: Group<'a>,
}

type Visit<'v> = dyn FnMut(&Object<'_>, bool) -> Result<(), Problem> + 'v;

impl Archive {
    pub(super) fn new(bytes: Vec<u8>) -> Result<Self, Problem> {
        if bytes.starts_with(HDF5_MAGIC) {
            return Err(Problem::new(
                "is Alembic in the HDF5 container, which is not supported: convert it with `abcconvert -toOgawa IN OUT`",
            ));
        }
        let mut archive =
            Self { bytes, samplings: Vec::new(), metadata: vec![String::new()], frames_per_second: FRAMES_PER_SECOND };
        let root = Bytes(&archive.bytes).root()?;
        let mut samplings = Vec::new();
        let mut cursor = Cursor::new(root.data(4)?);
        while !cursor.is_empty() {
            let _samples = cursor.u32()?;
            let cycle = cursor.f64()?;
            let count = cursor.u32()? as usize;
            let times = cursor.take(count.saturating_mul(8))?;
            let times: Vec<f64> =
                times.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes"))).collect();
            if times.is_empty() || times.iter().chain([&cycle]).any(|t| !t.is_finite()) {
                return Err(Problem::new("a list of times is empty or not finite"));
            }
            samplings.push(TimeSampling { cycle, times });
        }
        let mut metadata = vec![String::new()];
        let mut cursor = Cursor::new(root.data(5)?);
        while !cursor.is_empty() {
            let length = cursor.u8()?;
            metadata.push(cursor.text(length.into())?);
        }
        let of_archive = root.data(3).map(|own| String::from_utf8_lossy(own).into_owned()).unwrap_or_default();
        archive.frames_per_second = frames_per_second(&of_archive, &samplings);
        (archive.samplings, archive.metadata) = (samplings, metadata);
        Ok(archive)
    }
}

impl Format for Archive {
    fn unit_mm(&self) -> Option<f64> {
        None
    }

    fn up_axis(&self) -> Option<u8> {
        None
    }

    /// First and last frame of all that changes.
    fn frames(&self) -> Option<[f64; 2]> {
        let mut ends: Option<[f64; 2]> = None;
        let everything = PrimPattern::all();
        let seen = self.walk(&everything, None, &mut |object, _| {
            let Some(properties) = &object.properties else { return Ok(()) };
            for (schema, name) in [(".geom", "P"), (".xform", ".vals")] {
                let Some(own) = properties.compound(schema, &self.metadata)? else { continue };
                if let Some((sampling, samples)) = own.times(name, &self.samplings).filter(|(_, n)| *n > 1) {
                    let [first, last] = [0, samples - 1].map(|i| to_frame(sampling.time(i) * self.frames_per_second));
                    ends = Some(ends.map_or([first, last], |e| [e[0].min(first), e[1].max(last)]));
                }
            }
            Ok(())
        });
        seen.ok().and(ends)
    }

    fn contents(&self) -> Result<Contents, Problem> {
        let mut contents = Contents::default();
        self.walk(&PrimPattern::all(), None, &mut |object, _| {
            let list = match object.schema {
                CURVES => &mut contents.curves,
                MESH => &mut contents.meshes,
                CAMERA => &mut contents.cameras,
                _ => return Ok(()),
            };
            list.push(object.path.clone());
            Ok(())
        })?;
        Ok(contents)
    }

    fn visit(&self, pattern: &PrimPattern, frame: Option<f64>, take: &mut Take<'_>) -> Result<Vec<String>, Problem> {
        let time = frame.map(|f| f / self.frames_per_second);
        let mut notes = Vec::new();
        self.walk(pattern, time, &mut |object, visible| {
            let at = |p: Problem| p.at(&object.path);
            match (&mut *take, object.schema) {
                (Take::Curves(add), CURVES) if visible => {
                    let added = self.batch(object, time).and_then(|batch| match batch {
                        Some(batch) => add(&object.path, batch, &object.to_stage),
                        None => Ok(()),
                    });
                    match added.map_err(at) {
                        Err(problem) if problem.unknown => {
                            notes.push(format!("{} is left out: {}", object.path, problem.text));
                            Ok(())
                        }
                        added => added,
                    }
                }
                (Take::Meshes(add, uv), MESH) if visible => match self.mesh(object, time, *uv).map_err(at)? {
                    Some(mesh) => add(&object.path, mesh),
                    None => Ok(()),
                },
                _ => Ok(()),
            }
        })?;
        Ok(notes)
    }

    fn camera(&self, path: &str, frame: Option<f64>) -> Result<StageCamera, Problem> {
        let time = frame.map(|f| f / self.frames_per_second);
        let mut found = None;
        self.walk(&PrimPattern::all(), time, &mut |object, _| {
            if object.schema == CAMERA && object.path == path {
                found = self.lens(object, time).map_err(|p| p.at(path))?;
            }
            Ok(())
        })?;
        found.ok_or_else(|| {
            let cameras = self.contents().map(|contents| contents.cameras).unwrap_or_default();
            no_camera(path, &cameras)
        })
    }
}

impl Archive {
    /// Visits the objects that are chosen, and whether they are visible.
    fn walk(&self, pattern: &PrimPattern, time: Option<f64>, visit: &mut Visit<'_>) -> Result<(), Problem> {
        let top = Bytes(&self.bytes).root()?.group(2)?;
        let mut walk = Walk { archive: self, pattern, time, left: MAX_OBJECTS };
        walk.children(top, "", DMat4::IDENTITY, [false, true], 0, visit)
    }

    /// The camera that an object is; none where it has no lens.
    fn lens(&self, object: &Object<'_>, time: Option<f64>) -> Result<Option<StageCamera>, Problem> {
        let Some(geometry) = self.geometry(object)? else { return Ok(None) };
        let Some(lens) = self.numbers(&geometry, ".core", time)? else { return Ok(None) };
        // Millimetres, centimetres of aperture and offset across and up, and behind squeeze and overscan f-number and focus.
        let &[focal_length, across, aside, up, above, _, _, _, _, _, f_stop, focus, ..] = lens.as_slice() else {
            return Err(Problem::new(format!("a camera of {} numbers; 16 are expected", lens.len())));
        };
        if [focal_length, across, up].iter().any(|v| !(v.is_finite() && *v > 0.0)) || !(aside + above).is_finite() {
            return Err(Problem::new("expected apertures and a focal length above 0"));
        }
        Ok(Some(StageCamera {
            to_stage: StageCamera::standing(&object.to_stage),
            aperture: [10.0 * across, 10.0 * up],
            offset: [10.0 * aside, 10.0 * above],
            focal_length: Some(focal_length),
            film_unit: 0.1,
            f_stop: if f_stop.is_finite() { f_stop.max(0.0) } else { 0.0 },
            focus_distance: if focus.is_finite() { focus.max(0.0) } else { 0.0 },
        }))
    }

    fn mesh(&self, object: &Object<'_>, time: Option<f64>, set: Option<&str>) -> Result<Option<PolygonMesh>, Problem> {
        let Some(geometry) = self.geometry(object)? else { return Ok(None) };
        let integers = |name: &str| -> Result<Vec<i64>, Problem> {
            let around = geometry.at(name, time, &self.samplings)?;
            around.map_or(Ok(Vec::new()), |around| around.before.integers(name))
        };
        let points = vectors(&self.numbers(&geometry, "P", time)?.unwrap_or_default(), "P")?;
        let mut mesh = PolygonMesh::new(points, &integers(".faceCounts")?, &integers(".faceIndices")?)?;
        // The usual set, and behind it those that programs add.
        let more = geometry.compound(".arbGeomParams", &self.metadata)?;
        let mut sets = Vec::new();
        let has_own = self.extent(&geometry, "uv")?.is_some();
        if has_own {
            sets.push(word(geometry.metadata("uv"), "sourceName").unwrap_or("uv").to_owned());
        }
        for name in more.iter().flat_map(Compound::names) {
            if more.as_ref().map_or(Ok(None), |more| self.extent(more, name))? == Some(2) {
                sets.push(name.to_owned());
            }
        }
        if let Some(chosen) = mesh.choose_uvs(&object.path, &sets, set)? {
            let (own, name) = match &more {
                Some(more) if chosen > 0 || !has_own => (more, sets[chosen].as_str()),
                _ => (&geometry, "uv"),
            };
            if let Some(uv) = self.indexed(own, name, time)? {
                let values = uv.values.chunks_exact(2).map(|p| DVec2::new(p[0], p[1])).collect();
                let spread = spread_of(own.metadata(name), Spread::FaceVarying);
                mesh.set_uvs(at_corners(&mesh, name, AtCorners { values, indices: uv.indices }, spread)?)?;
            }
        }
        if let Some(n) = self.indexed(&geometry, "N", time)? {
            let values = vectors(&n.values, "N")?;
            let spread = spread_of(geometry.metadata("N"), Spread::FaceVarying);
            let normals = at_corners(&mesh, "N", AtCorners { values, indices: n.indices }, spread)?;
            mesh.set_normals(&normals);
        }
        for (i, (name, schema)) in self.child_headers(object.group)?.iter().enumerate() {
            if schema == FACE_SET {
                let properties = self.properties(object.group.group(i + 1)?)?;
                let own = properties.as_ref().map(|p| p.compound(".faceset", &self.metadata)).transpose()?.flatten();
                let faces = own.map(|own| own.at(".faces", time, &self.samplings)).transpose()?.flatten();
                if let Some(faces) = faces {
                    mesh.add_group(name, &faces.before.integers(".faces")?, false)?;
                }
            }
        }
        mesh.group_the_rest(object.name);
        // Alembic winds its faces clockwise.
        mesh.place(&object.to_stage, true)?;
        Ok(Some(mesh))
    }

    fn geometry<'a>(&self, object: &Object<'a>) -> Result<Option<Compound<'a>>, Problem> {
        object.properties.as_ref().map_or(Ok(None), |p| p.compound(".geom", &self.metadata))
    }

    fn numbers(&self, own: &Compound<'_>, name: &str, time: Option<f64>) -> Result<Option<Vec<f64>>, Problem> {
        own.at(name, time, &self.samplings)?.map(|around| around.between(name)).transpose()
    }

    /// A parameter of geometry: an array, or values and indices in a compound.
    fn indexed(
        &self,
        geometry: &Compound<'_>,
        name: &str,
        time: Option<f64>,
    ) -> Result<Option<AtCorners<f64>>, Problem> {
        let Some(own) = geometry.compound(name, &self.metadata)? else {
            return Ok(self.numbers(geometry, name, time)?.map(|values| AtCorners { values, indices: None }));
        };
        let Some(values) = self.numbers(&own, ".vals", time)? else { return Ok(None) };
        let indices = own.at(".indices", time, &self.samplings)?;
        let indices = indices.map(|around| around.before.integers(".indices")).transpose()?;
        let known = |&i: &i64| {
            let index = usize::try_from(i).ok().filter(|&i| i < values.len()).map(|i| i as u32);
            index.ok_or_else(|| Problem::new(format!("`{name}` has index {i} of {} values", values.len())))
        };
        let indices = indices.map(|own| own.iter().map(known).collect::<Result<Vec<u32>, Problem>>()).transpose()?;
        Ok(Some(AtCorners { values, indices }))
    }

    fn properties<'a>(&self, object: Group<'a>) -> Result<Option<Compound<'a>>, Problem> {
        if object.len() == 0 || !object.is_group(0) {
            return Ok(None);
        }
        Compound::new(object.group(0)?, &self.metadata).map(Some)
    }

    /// Name and schema of each child.
    fn child_headers(&self, object: Group<'_>) -> Result<Vec<(String, String)>, Problem> {
        let Some(last) = object.len().checked_sub(1).filter(|&i| !object.is_group(i)) else { return Ok(Vec::new()) };
        let data = object.data(last)?;
        // Hashes of all properties and children end the list.
        let mut cursor = Cursor::new(data.get(..data.len().saturating_sub(32)).unwrap_or_default());
        let mut out = Vec::new();
        while !cursor.is_empty() {
            let length = cursor.u32()?;
            let name = cursor.text(length)?;
            let metadata = match cursor.u8()? {
                0xff => {
                    let length = cursor.u32()?;
                    cursor.text(length)?
                }
                i => self.metadata.get(usize::from(i)).cloned().unwrap_or_default(),
            };
            out.push((name, word(&metadata, "schema").unwrap_or_default().to_owned()));
        }
        Ok(out)
    }

    /// From the object's space to its parent's, and whether the parent's counts.
    fn transform(&self, properties: &Compound<'_>, time: Option<f64>) -> Result<(DMat4, bool), Problem> {
        let Some(own) = properties.compound(".xform", &self.metadata)? else { return Ok((DMat4::IDENTITY, true)) };
        let inherits = self.numbers(&own, ".inherits", time)?.is_none_or(|v| v.first().is_none_or(|&x| x != 0.0));
        let operations = own.at(".ops", time, &self.samplings)?;
        let operations = operations.map_or(Ok(Vec::new()), |around| around.before.integers(".ops"))?;
        let values = self.numbers(&own, ".vals", time)?.unwrap_or_default();
        let mut rest = values.as_slice();
        let mut take = |count: usize| {
            let (own, left) = rest.split_at_checked(count).ok_or_else(|| Problem::new("a transform lacks values"))?;
            rest = left;
            Ok::<_, Problem>(own)
        };
        let mut matrix = DMat4::IDENTITY;
        for operation in operations {
            matrix *= match operation >> 4 {
                0 => DMat4::from_scale(DVec3::from_slice(take(3)?)),
                1 => DMat4::from_translation(DVec3::from_slice(take(3)?)),
                2 => {
                    let v = take(4)?;
                    let axis = DVec3::from_slice(v).normalize_or(DVec3::Y);
                    DMat4::from_axis_angle(axis, v[3].to_radians())
                }
                // Rows there are columns here.
                3 => DMat4::from_cols_slice(take(16)?),
                4 => DMat4::from_rotation_x(take(1)?[0].to_radians()),
                5 => DMat4::from_rotation_y(take(1)?[0].to_radians()),
                6 => DMat4::from_rotation_z(take(1)?[0].to_radians()),
                other => return Err(Problem::new(format!("a transform has the unknown operation {other}"))),
            };
        }
        if !matrix.is_finite() {
            return Err(Problem::new("a transform is not finite"));
        }
        Ok((matrix, inherits))
    }
}

/// How many frames a second has, by what an archive says of itself and by its times.
fn frames_per_second(of_archive: &str, samplings: &[TimeSampling]) -> f64 {
    let sound = |rate: &f64| rate.is_finite() && (1e-3..=1e6).contains(rate);
    if let Some(told) = word(of_archive, "FramesPerTimeUnit").and_then(|rate| rate.trim().parse().ok()).filter(sound) {
        return told;
    }
    // The first sampling is that of what does not change: a second long.
    let even = samplings.iter().skip(1).filter(|s| s.times.len() == 1 && s.cycle > 0.0).map(|s| 1.0 / s.cycle);
    let film = |rate: f64| RATES.into_iter().find(|known| (rate / known - 1.0).abs() < 1e-5);
    even.filter_map(film).next().unwrap_or(FRAMES_PER_SECOND)
}

/// A frame; one that is whole but for rounding is whole.
fn to_frame(frame: f64) -> f64 {
    if (frame - frame.round()).abs() < 1e-6 * frame.abs().max(1.0) { frame.round() } else { frame }
}

const CURVES: &str = "AbcGeom_Curve_v2";
const MESH: &str = "AbcGeom_PolyMesh_v1";
const CAMERA: &str = "AbcGeom_Camera_v1";
const FACE_SET: &str = "AbcGeom_FaceSet_v1";

struct Walk<'a> {
    archive: &'a Archive,
    pattern: &'a PrimPattern,
    time: Option<f64>,
    left: usize,
}

impl<'a> Walk<'a> {
    /// The children of an object; what is known of it are whether it is chosen and whether it is visible.
    fn children(
        &mut self,
        parent: Group<'a>,
        path: &str,
        to_stage: DMat4,
        [chosen, visible]: [bool; 2],
        depth: usize,
        visit: &mut Visit<'_>,
    ) -> Result<(), Problem> {
        if depth > MAX_DEPTH {
            return Err(Problem::new(format!("objects lie more than {MAX_DEPTH} deep")).at(path));
        }
        for (i, (name, schema)) in self.archive.child_headers(parent)?.iter().enumerate() {
            self.left =
                self.left.checked_sub(1).ok_or_else(|| Problem::new(format!("more than {MAX_OBJECTS} objects")))?;
            let path = format!("{path}/{name}");
            let group = parent.group(i + 1).map_err(|p| p.at(&path))?;
            let properties = self.archive.properties(group).map_err(|p| p.at(&path))?;
            let (mut own, mut seen) = (to_stage, visible);
            if let Some(properties) = &properties {
                let (local, inherits) = self.archive.transform(properties, self.time).map_err(|p| p.at(&path))?;
                own = if inherits { to_stage * local } else { local };
                let shown = self.archive.numbers(properties, "visible", self.time)?;
                seen &= shown.is_none_or(|v| v.first().is_none_or(|&x| x != 0.0));
            }
            let chosen = chosen || self.pattern.matches(&path);
            let object = Object { path, name, schema, properties, to_stage: own, group };
            if chosen {
                visit(&object, seen)?;
            }
            self.children(group, &object.path, own, [chosen, seen], depth + 1, visit)?;
        }
        Ok(())
    }
}

/// A word of metadata such as `schema=...;geoScope=vtx`.
fn word<'a>(metadata: &'a str, key: &str) -> Option<&'a str> {
    metadata.split(';').find_map(|pair| pair.strip_prefix(key)?.strip_prefix('='))
}

fn spread_of(metadata: &str, otherwise: Spread) -> Spread {
    match word(metadata, "geoScope") {
        Some("con") => Spread::Constant,
        Some("uni") => Spread::Uniform,
        Some("var") => Spread::Varying,
        Some("vtx") => Spread::Vertex,
        Some("fvr") => Spread::FaceVarying,
        _ => otherwise,
    }
}

fn vectors(numbers: &[f64], name: &str) -> Result<Vec<DVec3>, Problem> {
    if !numbers.len().is_multiple_of(3) {
        return Err(Problem::new(format!("`{name}` has {} numbers, which is no multiple of 3", numbers.len())));
    }
    Ok(numbers.chunks_exact(3).map(DVec3::from_slice).collect())
}

/// Values of points as values of corners.
fn at_corners<T>(mesh: &PolygonMesh, name: &str, given: AtCorners<T>, spread: Spread) -> Result<AtCorners<T>, Problem> {
    let found = given.indices.as_ref().map_or(given.values.len(), Vec::len);
    let expected = match spread {
        Spread::FaceVarying => mesh.corners.len(),
        Spread::Vertex | Spread::Varying => mesh.points.len(),
        _ => return Err(Problem::new(format!("`{name}` is {}, expected of corners or points", spread.name()))),
    };
    if found != expected {
        return Err(Problem::new(format!("`{name}` should have {expected} values, found {found}")));
    }
    // Of pairs and triples there are fewer than of numbers.
    let known = given.values.len();
    if let Some(index) = given.indices.iter().flatten().find(|&&i| i as usize >= known) {
        return Err(Problem::new(format!("`{name}` has index {index} of {known} values")));
    }
    if spread == Spread::FaceVarying {
        return Ok(given);
    }
    let index = |&c: &u32| given.indices.as_ref().map_or(c, |own| own[c as usize]);
    let indices = Some(mesh.corners.iter().map(index).collect());
    Ok(AtCorners { values: given.values, indices })
}
