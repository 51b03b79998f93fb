//! Film files: everything a render has collected, to the last bit. Checkpoints and parts of a split render are such files.
//!
//! ```text
//! "YARNFILM"                          8 bytes
//! version, length of the header       u32 each; all numbers are little-endian
//! header                              JSON: what the picture is of, how far it is
//! checksum                            u32, CRC-32 of all bytes so far
//! for each tile, row by row:
//!   length of the rest of the tile    u32
//!   next samples, shares, rays        2 u32, 2 f32, 2 u64: see film::Tile
//!   sums                              see film::Tile::save
//!   checksum                          u32, CRC-32 of the tile's bytes before it
//! ```
//! Nothing is allocated on the word of a file: a header that promises more pixels than the file has bytes for is refused.

use std::{
    fs::File,
    io::{self, BufReader, BufWriter, Read, Write},
    path::Path,
    time::Duration,
};

use serde_json::{Value, json};

use super::{Job, Shard, picture::Frame};
use crate::{
    film::{Film, TILE, Tile},
    image::{
        Attribute, Compression, ImageError, exr,
        png::{Display, ToneMap},
        whole_file,
    },
    integrator::Counters,
    scene::{Axes, Layers, Scene, Storage, identity},
};

const MAGIC: &[u8; 8] = b"YARNFILM";
const VERSION: u32 = 4;
/// Longest header that is read: identities hold a few lines for each light, yarn and fabric.
const HEADER_LIMIT: u32 = 64 << 20;
/// Bytes of a tile besides its sums and its length: next samples, shares, rays, checksum.
const TILE_EXTRA: usize = 36;

/// What a film is of. Known before the first sample, and the same for all parts of a render but for `shard`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct About {
    /// Every key that changes the picture's bits, with its value; the program's and Embree's version among them.
    pub keys: Vec<(String, String)>,
    /// How the picture is written.
    pub frame: Frame,
    /// What the film collects: the layers of the picture, and what guides a denoiser.
    pub collected: Layers,
    /// Metadata of the picture that do not depend on the run.
    pub metadata: Vec<(String, Attribute)>,
    /// Samples per pixel of the whole render.
    pub spp: u32,
    /// Which part of it this is, if it is a part.
    pub shard: Option<Shard>,
}

impl About {
    /// Of a scene's render, or of a part of it.
    pub(crate) fn new(scene: &Scene, embree: &str, metadata: Vec<(String, Attribute)>, shard: Option<Shard>) -> Self {
        let collected = scene.collected();
        let mut keys = vec![("yarnray".to_owned(), exr::SOFTWARE.to_owned()), ("embree".to_owned(), embree.to_owned())];
        keys.extend(scene.identity.iter().cloned());
        keys.push(("output.layers".to_owned(), layer_names(collected).join(", ")));
        if collected.light_groups > 0 {
            let groups = &scene.light_groups;
            let of_lights: Vec<&str> =
                (0..scene.lights.len()).map(|light| groups.names()[groups.of(light)].as_str()).collect();
            keys.push(("light.group".to_owned(), of_lights.join(", ")));
        }
        keys.push(("shard".to_owned(), shard_name(shard)));
        if shard.is_some() {
            keys.push(("render.spp".to_owned(), scene.render.spp.to_string()));
        }
        Self { keys, frame: Frame::new(scene), collected, metadata, spp: scene.render.spp, shard }
    }

    /// What stands in the way of going on with a job about `there`: keys with their values, none if nothing does.
    pub(crate) fn differences(&self, there: &Self) -> Vec<String> {
        identity::differences(&there.keys, &self.keys, ["there", "here"])
    }
}

fn layer_names(mut layers: Layers) -> Vec<&'static str> {
    let groups = (layers.light_groups > 0).then_some(Layers::LIGHT_GROUPS);
    Layers::NAMES.iter().filter(|(_, of)| *of(&mut layers)).map(|(name, _)| *name).chain(groups).collect()
}

fn shard_name(shard: Option<Shard>) -> String {
    shard.map_or("none".to_owned(), |s| format!("{}/{}", s.index, s.count))
}

/// The first part of a film file: all but the pixels.
#[derive(Clone, Debug)]
pub(crate) struct Header {
    /// What the film is of.
    pub about: About,
    /// The pixels: x0, y0, x1, y1, the latter exclusive.
    pub crop: [u32; 4],
    /// The first sample, and the one after the last that is asked for.
    pub samples: [u32; 2],
    /// The sample that comes next, where the fewest and where the most are taken.
    pub next: [u32; 2],
    /// Bytes of the file before the tiles.
    length: u64,
    done: u32,
    light_scale: f32,
    /// Whether adaptive sampling has made its plan.
    pub planned: bool,
    counters: Counters,
    /// Time in which samples were taken, of all runs together.
    pub elapsed: Duration,
}

/// Saves a job; the file is on the disk before it takes the place of an older one.
///
/// # Errors
/// [`ImageError::Write`]; an older file of this name is then as it was.
pub(crate) fn write(path: &Path, about: &About, job: &Job) -> Result<(), ImageError> {
    whole_file::write_durable(path, |file| write_to(&mut BufWriter::with_capacity(1 << 20, file), about, job))
}

fn write_to(out: &mut impl Write, about: &About, job: &Job) -> io::Result<()> {
    let header = header_json(about, job).to_string().into_bytes();
    let mut bytes = MAGIC.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((header.len() as u32).to_le_bytes());
    bytes.extend(header);
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    out.write_all(&bytes)?;
    for tile in job.film.tiles() {
        bytes.clear();
        bytes.extend([0; 4]);
        bytes.extend(tile.next.map(u32::to_le_bytes).as_flattened());
        bytes.extend(tile.share.map(f32::to_le_bytes).as_flattened());
        bytes.extend(tile.rays.map(u64::to_le_bytes).as_flattened());
        tile.save(&mut bytes);
        let length = bytes.len() as u32;
        bytes[..4].copy_from_slice(&length.to_le_bytes());
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        out.write_all(&bytes)?;
    }
    out.flush()
}

/// Reads a film file: what it is of, and the job to go on with.
///
/// # Errors
/// [`ImageError::Read`]: no film file, one of another version, cut short, or damaged.
pub(crate) fn read(path: &Path) -> Result<(About, Job), ImageError> {
    let (header, file) = open(path)?;
    let film = Film::new(header.crop, header.about.collected, header.light_scale);
    let mut film = film.map_err(|error| unreadable(path, &error.to_string()))?;
    let frame = &header.about.frame;
    let things = frame.fabrics.len() + frame.surfaces.len();
    let mut tiles = film.tiles_mut().iter_mut();
    read_tiles(path, &header, file, |bytes| {
        let Some(tile) = tiles.next() else { return false };
        let word = |k: usize| [bytes[k], bytes[k + 1], bytes[k + 2], bytes[k + 3]];
        tile.next = [4, 8].map(|k| u32::from_le_bytes(word(k)));
        tile.share = [12, 16].map(|k| f32::from_le_bytes(word(k)));
        let long = |k: usize| u64::from(u32::from_le_bytes(word(k + 4))) << 32 | u64::from(u32::from_le_bytes(word(k)));
        tile.rays = [20, 28].map(long);
        tile.load(&bytes[TILE_EXTRA..], things).is_some()
    })?;
    let job = Job {
        film,
        samples: header.samples[0]..header.samples[1],
        done: header.done,
        planned: header.planned,
        counters: header.counters,
        elapsed: header.elapsed,
    };
    Ok((header.about, job))
}

/// Reads the first part of a film file, and goes through the rest without keeping it: whether all of it is sound.
///
/// # Errors
/// [`ImageError`]: the file cannot be read, or is damaged.
pub(crate) fn check(path: &Path) -> Result<Header, ImageError> {
    let (header, file) = open(path)?;
    read_tiles(path, &header, file, |_| true)?;
    Ok(header)
}

/// Gives the bytes of every tile to `take`, which says whether they are its sums.
fn read_tiles(
    path: &Path,
    header: &Header,
    mut file: BufReader<File>,
    mut take: impl FnMut(&[u8]) -> bool,
) -> Result<(), ImageError> {
    let size = file.get_ref().metadata().map_err(|e| unreadable(path, &e.to_string()))?.len();
    let [width, height] = [header.crop[2] - header.crop[0], header.crop[3] - header.crop[1]];
    let mut at = header.length;
    let mut bytes = Vec::new();
    for i in 0..width.div_ceil(TILE) * height.div_ceil(TILE) {
        let damaged = |what: &str| unreadable(path, &format!("tile {i} at byte {at} is damaged: {what}"));
        let mut length = [0; 4];
        file.read_exact(&mut length).map_err(|e| unreadable_or_short(path, &e, at))?;
        let rest = u64::from(u32::from_le_bytes(length));
        if rest < TILE_EXTRA as u64 || rest > size.saturating_sub(at + length.len() as u64) {
            return Err(damaged("a length that the file does not have"));
        }
        bytes.clear();
        bytes.extend(length);
        (&mut file).take(rest).read_to_end(&mut bytes).map_err(|e| unreadable_or_short(path, &e, at))?;
        let Some((sums, checksum)) = bytes.split_last_chunk::<4>() else { return Err(damaged("too short")) };
        if crc32fast::hash(sums) != u32::from_le_bytes(*checksum) {
            return Err(damaged("its checksum is wrong"));
        }
        if sums.len() < TILE_EXTRA || !take(sums) {
            return Err(damaged("it holds something else than its sums"));
        }
        at += 4 + rest;
    }
    if at != size {
        return Err(unreadable(path, &format!("{} bytes follow after the last tile, at byte {at}", size - at)));
    }
    Ok(())
}

/// Reads the first part of a film file, and checks that the rest can be there.
///
/// # Errors
/// [`ImageError`]: the file cannot be read, or its first part is damaged.
pub(crate) fn read_header(path: &Path) -> Result<Header, ImageError> {
    open(path).map(|(header, _)| header)
}

/// Whether a file begins as film files do.
pub(crate) fn is_film(path: &Path) -> bool {
    let mut start = [0; MAGIC.len()];
    File::open(path).and_then(|mut f| f.read_exact(&mut start)).is_ok() && start == *MAGIC
}

fn open(path: &Path) -> Result<(Header, BufReader<File>), ImageError> {
    let file = File::open(path).map_err(|e| ImageError::unreadable(path, &e))?;
    let size = file.metadata().map_err(|e| ImageError::unreadable(path, &e))?.len();
    let mut file = BufReader::with_capacity(1 << 20, file);
    let mut start = [0; 16];
    file.read_exact(&mut start).map_err(|e| unreadable_or_short(path, &e, 0))?;
    let word = |k: usize| u32::from_le_bytes([start[k], start[k + 1], start[k + 2], start[k + 3]]);
    if !start.starts_with(MAGIC) {
        return Err(unreadable(path, "it is not a film file of yarnray"));
    }
    let (version, length) = (word(8), word(12));
    if version != VERSION {
        let reason = format!("it is a film file of version {version}; this program reads version {VERSION}");
        return Err(unreadable(path, &reason));
    }
    if length > HEADER_LIMIT || u64::from(length) + 20 > size {
        return Err(unreadable(path, &format!("it is cut short or damaged: a header of {length} bytes at byte 16")));
    }
    let mut bytes = start.to_vec();
    (&mut file).take(u64::from(length) + 4).read_to_end(&mut bytes).map_err(|e| unreadable_or_short(path, &e, 16))?;
    let Some((all, checksum)) = bytes.split_last_chunk::<4>() else { return Err(unreadable(path, "it is cut short")) };
    if crc32fast::hash(all) != u32::from_le_bytes(*checksum) {
        return Err(unreadable(path, "it is damaged: the checksum of its header is wrong"));
    }
    let json: Option<Value> = serde_json::from_slice(&all[16..]).ok();
    let header = json.and_then(|v| parse_header(&v, u64::from(length) + 20));
    let header = header.ok_or_else(|| unreadable(path, "its header is not one that this program writes"))?;
    // Before anything is allocated for it: are there bytes enough for all pixels?
    let [width, height] = [header.crop[2] - header.crop[0], header.crop[3] - header.crop[1]].map(u64::from);
    let tiles = width.div_ceil(TILE.into()) * height.div_ceil(TILE.into());
    let least = header.length
        + width * height * Tile::bytes_per_pixel(header.about.collected) as u64
        + tiles * (4 + TILE_EXTRA as u64);
    if size < least {
        return Err(unreadable(path, &format!("it is cut short: {size} bytes of {least} or more")));
    }
    Ok((header, file))
}

fn unreadable(path: &Path, reason: &str) -> ImageError {
    ImageError::Read { path: path.to_owned(), reason: reason.to_owned() }
}

fn unreadable_or_short(path: &Path, error: &io::Error, at: u64) -> ImageError {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => unreadable(path, &format!("it is cut short, at byte {at}")),
        _ => ImageError::unreadable(path, error),
    }
}

fn header_json(about: &About, job: &Job) -> Value {
    let Frame { width, height, layers, storage, axes, display, fabrics, surfaces, light_groups, middle } =
        about.frame.clone();
    let metadata: Vec<Value> = about
        .metadata
        .iter()
        .map(|(name, value)| match value {
            Attribute::Text(v) => json!([name, "text", v]),
            Attribute::Float(v) => json!([name, "float", v.to_bits()]),
            Attribute::Double(v) => json!([name, "double", v.to_bits()]),
            Attribute::Whole(v) => json!([name, "whole", v]),
            Attribute::Ratio(v, of) => json!([name, "ratio", [v, of]]),
            Attribute::Matrix(v) => json!([name, "matrix", bits(v.as_flattened())]),
            Attribute::Chromaticities(v) => json!([name, "chromaticities", bits(v.as_flattened())]),
        })
        .collect();
    let c = &job.counters;
    let next = || job.film.tiles().iter().flat_map(|t| t.next);
    let [x, y] = job.film.origin;
    json!({
        "keys": about.keys,
        "frame": {
            "width": width, "height": height,
            "layers": layer_names(layers),
            "compression": name_of(storage.compression, &Compression::NAMES),
            "half_lobes": storage.half_lobes,
            "unit_bits": axes.unit.to_bits(),
            "z_up": axes.z_up,
            "tone_map": name_of(display.tone_map, &ToneMap::NAMES),
            "exposure_bits": display.exposure.to_bits(),
            "alpha": display.alpha,
            "fabrics": fabrics,
            "surfaces": surfaces,
            "light_groups": light_groups,
            "middle_bits": middle.map(f64::to_bits),
        },
        "collected": layer_names(about.collected),
        "metadata": metadata,
        "spp": about.spp,
        "shard": about.shard.map(|s| [s.index, s.count]),
        "crop": [x, y, x + job.film.width, y + job.film.height],
        "samples": [job.samples.start, job.samples.end],
        "next": [next().min(), next().max()],
        "done": job.done,
        "light_scale_bits": job.film.light_scale().to_bits(),
        "planned": job.planned,
        "counters": [c.camera, c.bounce, c.shadow, c.cloth_paths, c.events, c.invalid],
        "nanoseconds": job.elapsed.as_nanos() as u64,
    })
}

fn name_of<T: PartialEq>(value: T, names: &[(&'static str, T)]) -> &'static str {
    names.iter().find(|(_, v)| *v == value).map_or("", |(name, _)| name)
}

/// Numbers to the last bit.
fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// What [`bits`] wrote.
fn floats<const N: usize>(v: &Value) -> Option<[f32; N]> {
    let bit = |v: &Value| Some(f32::from_bits(u32::try_from(v.as_u64()?).ok()?));
    v.as_array()?.iter().map(bit).collect::<Option<Vec<f32>>>()?.try_into().ok()
}

fn word(v: &Value) -> Option<u32> {
    u32::try_from(v.as_u64()?).ok()
}

fn words(v: &Value) -> Option<Vec<u32>> {
    v.as_array()?.iter().map(word).collect()
}

fn text(v: &Value) -> Option<String> {
    v.as_str().map(str::to_owned)
}

fn texts(v: &Value) -> Option<Vec<String>> {
    v.as_array()?.iter().map(text).collect()
}

/// A name and its value.
fn parse_attribute(item: &Value) -> Option<(String, Attribute)> {
    let value = match item[1].as_str()? {
        "text" => Attribute::Text(text(&item[2])?),
        "float" => Attribute::Float(f32::from_bits(word(&item[2])?)),
        "double" => Attribute::Double(f64::from_bits(item[2].as_u64()?)),
        "whole" => Attribute::Whole(i32::try_from(item[2].as_i64()?).ok()?),
        "ratio" => Attribute::Ratio(i32::try_from(item[2][0].as_i64()?).ok()?, word(&item[2][1])?),
        "matrix" => {
            let all = floats::<16>(&item[2])?;
            Attribute::Matrix(std::array::from_fn(|i| std::array::from_fn(|k| all[4 * i + k])))
        }
        "chromaticities" => {
            let all = floats::<8>(&item[2])?;
            Attribute::Chromaticities(std::array::from_fn(|i| [all[2 * i], all[2 * i + 1]]))
        }
        _ => return None,
    };
    Some((text(&item[0])?, value))
}

/// Layers by their names, of a scene of so many groups of lights.
fn parse_layers(names: &Value, groups: usize) -> Option<Layers> {
    let mut layers = Layers::NONE;
    for name in names.as_array()? {
        if name == Layers::LIGHT_GROUPS {
            layers.light_groups =
                u8::try_from(groups).ok().filter(|count| (1..=Layers::ALL.light_groups).contains(count))?;
            continue;
        }
        let (_, of) = Layers::NAMES.iter().find(|(known, _)| name == known)?;
        *of(&mut layers) = true;
    }
    Some(layers)
}

fn parse_frame(f: &Value) -> Option<Frame> {
    // Films of builds before have none of the names but those of fabrics.
    let named = |key: &str| if f[key].is_null() { Some(Vec::new()) } else { texts(&f[key]) };
    let light_groups = named("light_groups")?;
    Some(Frame {
        width: word(&f["width"])?,
        height: word(&f["height"])?,
        layers: parse_layers(&f["layers"], light_groups.len())?,
        storage: Storage {
            compression: Compression::NAMES.iter().find(|(n, _)| f["compression"] == *n)?.1,
            half_lobes: f["half_lobes"].as_bool()?,
        },
        // Films of builds before have neither.
        axes: match &f["unit_bits"] {
            Value::Null => Axes::default(),
            bits => Axes {
                unit: Some(f64::from_bits(bits.as_u64()?)).filter(|unit| unit.is_normal() && *unit > 0.0)?,
                z_up: f["z_up"].as_bool()?,
            },
        },
        display: Display {
            tone_map: ToneMap::NAMES.iter().find(|(n, _)| f["tone_map"] == *n)?.1,
            exposure: f32::from_bits(word(&f["exposure_bits"])?),
            alpha: f["alpha"].as_bool()?,
        },
        fabrics: texts(&f["fabrics"])?,
        surfaces: named("surfaces")?,
        light_groups,
        middle: {
            let bits = f["middle_bits"].as_array()?.iter().map(Value::as_u64).collect::<Option<Vec<_>>>()?;
            <[u64; 3]>::try_from(bits).ok()?.map(f64::from_bits)
        },
    })
}

fn parse_header(v: &Value, length: u64) -> Option<Header> {
    let keys =
        v["keys"].as_array()?.iter().map(|pair| Some((text(&pair[0])?, text(&pair[1])?))).collect::<Option<_>>()?;
    // Files of builds before this one have it under the second name.
    let metadata = v.get("metadata").or_else(|| v.get("story"))?;
    let metadata = metadata.as_array()?.iter().map(parse_attribute).collect::<Option<_>>()?;
    let frame = parse_frame(&v["frame"])?;
    let collected = parse_layers(&v["collected"], frame.light_groups.len())?;
    let shard = match words(&v["shard"]).as_deref() {
        None if v["shard"].is_null() => None,
        Some(&[index, count]) if 1 <= index && index <= count => Some(Shard { index, count }),
        _ => return None,
    };
    let crop: [u32; 4] = words(&v["crop"])?.try_into().ok()?;
    let samples: [u32; 2] = words(&v["samples"])?.try_into().ok()?;
    let inside = crop[0] < crop[2] && crop[1] < crop[3] && crop[2] <= frame.width && crop[3] <= frame.height;
    let light_scale = f32::from_bits(word(&v["light_scale_bits"])?);
    let sound = inside && light_scale.is_finite() && light_scale > 0.0;
    if !sound || frame.width.max(frame.height) > 65_536 || samples[0] > samples[1] {
        return None;
    }
    let counters: Vec<u64> = v["counters"].as_array()?.iter().map(Value::as_u64).collect::<Option<_>>()?;
    let [camera, bounce, shadow, cloth_paths, events, invalid] = counters.try_into().ok()?;
    Some(Header {
        about: About { keys, frame, collected, metadata, spp: word(&v["spp"])?, shard },
        crop,
        samples,
        next: words(&v["next"])?.try_into().ok()?,
        length,
        done: word(&v["done"])?,
        light_scale,
        planned: v["planned"].as_bool()?,
        counters: Counters { camera, bounce, shadow, cloth_paths, events, invalid },
        elapsed: Duration::from_nanos(v["nanoseconds"].as_u64()?),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        film::{MatteId, Sample},
        scene::SceneBuilder,
    };

    #[test]
    fn metadata_come_back_under_their_name_and_under_the_earlier_one() {
        let mut scene = SceneBuilder::new("a test");
        scene.size(8, 6);
        let scene = scene.build().unwrap();
        let metadata = vec![
            ("frame".to_owned(), Attribute::Whole(-3)),
            ("shutter".to_owned(), Attribute::Double(0.1)),
            ("comment".to_owned(), Attribute::Text("a \"b\"".to_owned())),
        ];
        let about = About::new(&scene, "4.3.3", metadata.clone(), None);
        let mut header = header_json(&about, &Job::new(&scene, None).unwrap());
        assert_eq!(parse_header(&header, 1).unwrap().about.metadata, metadata);
        let keys = header.as_object_mut().unwrap();
        let list = keys.remove("metadata").unwrap();
        keys.insert("story".to_owned(), list);
        assert_eq!(parse_header(&header, 1).unwrap().about.metadata, metadata);
        header.as_object_mut().unwrap().remove("story");
        assert!(parse_header(&header, 1).is_none());
    }

    /// Whoever writes the checksums right may still lie in the rest: an error each time, and no memory on the file's word.
    #[test]
    fn crafted_films_are_errors() {
        let mut scene = SceneBuilder::new("a test");
        scene.size(40, 33);
        let scene = scene.build().unwrap();
        let about = About::new(&scene, "4.3.3", Vec::new(), None);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.film");
        write(&path, &about, &Job::new(&scene, None).unwrap()).unwrap();
        let sound = std::fs::read(&path).unwrap();
        let problem = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            let [read, checked] = [read(&path).map(drop), check(&path).map(drop)].map(|r| r.map_err(|e| e.to_string()));
            assert!(read.is_err() || checked.is_ok(), "what is read must be sound: {checked:?}");
            read.err()
        };
        assert_eq!(problem(&sound), None);
        for length in (0..sound.len()).step_by(97) {
            assert!(problem(&sound[..length]).is_some(), "cut at {length}");
        }
        assert!(problem(&[&sound[..], &[0]].concat()).is_some_and(|p| p.contains("1 bytes follow")));
        // Headers with another value, and tiles that say another length.
        let length = u32::from_le_bytes(sound[12..16].try_into().unwrap()) as usize;
        let tiles = &sound[16 + length + 4..];
        let header: Value = serde_json::from_slice(&sound[16..16 + length]).unwrap();
        let with = |key: &str, value: Value| {
            let mut header = header.clone();
            *header.pointer_mut(key).unwrap() = value;
            let json = header.to_string().into_bytes();
            let mut bytes = [&sound[..12], &(json.len() as u32).to_le_bytes(), &json].concat();
            bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
            [&bytes, tiles].concat()
        };
        assert_eq!(problem(&with("/done", json!(0))), None);
        for (key, value) in [
            ("/crop", json!([0, 0, 41, 33])),
            ("/crop", json!([0, 0, 40, 32])),
            ("/crop", json!([7, 0, 7, 33])),
            ("/crop", json!([0, 0, -1, 33])),
            ("/frame/width", json!(u32::MAX)),
            ("/samples", json!([9, 3])),
            ("/samples", json!([0, 1u64 << 40])),
            ("/collected", json!(["position"])),
            ("/collected", json!(["everything"])),
            ("/light_scale_bits", json!(0)),
            ("/light_scale_bits", json!(f32::NAN.to_bits())),
            ("/shard", json!([3, 2])),
            ("/counters", json!([1, 2])),
            ("/keys", json!("none")),
            ("/metadata", json!([["a", "matrix", [1, 2, 3]]])),
        ] {
            assert!(problem(&with(key, value.clone())).is_some(), "{key} = {value}");
        }
        let mut large = with("/crop", json!([0, 0, 65_536, 65_536]));
        assert!(problem(&large).is_some());
        large = with("/frame/width", json!(65_536));
        assert_eq!(problem(&large), None, "a crop of a wide frame");
        let first = sound.len() - tiles.len();
        for length in [0, 8, u32::MAX, u32::from_le_bytes(tiles[..4].try_into().unwrap()) - 1] {
            let mut bytes = sound.clone();
            bytes[first..first + 4].copy_from_slice(&length.to_le_bytes());
            assert!(problem(&bytes).is_some_and(|p| p.contains("tile 0 at byte")), "{length}");
        }
        // A matte of cloth that the scene does not have.
        let mut scene = scene;
        scene.layers.cryptomatte = true;
        let about = About::new(&scene, "4.3.3", Vec::new(), None);
        let mut job = Job::new(&scene, None).unwrap();
        let matte = Some(MatteId { fabric: 7, yarn: 0, ply: 0 });
        job.film.tiles_mut()[0].add(3, 0, &Sample { matte, ..Sample::default() });
        write(&path, &about, &job).unwrap();
        let told = read(&path).map(drop).unwrap_err().to_string();
        assert!(told.contains("tile 0 at byte"), "{told}");
    }
}
