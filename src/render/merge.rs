//! Parts of one render put together: what one machine would have rendered, to the bit.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use super::{
    Job,
    film_file::{self, About, Header},
};
use crate::{
    film::{Film, OutOfMemory},
    image::ImageError,
    scene::identity,
};

/// Why parts do not make a picture.
#[derive(Debug)]
pub(crate) enum MergeError {
    /// A file cannot be read.
    File(ImageError),
    /// The files do not fit together; what is wrong, in words.
    Parts(String),
    /// The whole film does not fit into memory.
    Memory(OutOfMemory),
}

impl From<OutOfMemory> for MergeError {
    fn from(error: OutOfMemory) -> Self {
        Self::Memory(error)
    }
}

impl fmt::Display for MergeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(error) => error.fmt(f),
            Self::Parts(problem) => f.write_str(problem),
            Self::Memory(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for MergeError {}

impl From<ImageError> for MergeError {
    fn from(error: ImageError) -> Self {
        Self::File(error)
    }
}

/// Keys in which parts of one render may differ, and the number of samples, which a shard names to fix its part and a whole film
/// does not.
const OF_THE_PART: [&str; 3] = ["shard", "render.crop", "render.spp"];

/// Puts parts of a render together: shards of its samples, crops of its frame, or shards of crops.
///
/// All parts must be of one render (the error names the keys that differ), finished, and together hold every sample of
/// every pixel of a rectangle once. With `partial`, samples may be missing and parts unfinished; pixels are then weighed by
/// what they have. One part is in memory at a time, besides the result.
///
/// # Errors
/// Which files do not fit and why, or what is missing.
pub(crate) fn merge(paths: &[PathBuf], partial: bool) -> Result<(About, Job), MergeError> {
    let mut parts: Vec<(&Path, Header)> = Vec::new();
    for path in paths {
        parts.push((path, film_file::read_header(path)?));
    }
    let Some((first, _)) = parts.first() else { return Err(MergeError::Parts("there are no parts".to_owned())) };
    let first: &Path = first;
    same_render(&parts)?;
    parts.sort_by_key(|(_, h)| (h.crop[1], h.crop[0], h.crop[3], h.crop[2], h.samples[0]));
    let mut problems = Vec::new();
    for crop in parts.chunk_by(|a, b| a.1.crop == b.1.crop) {
        // One film by itself may have stopped by noise or time: it is what its render was.
        let whole = parts.len() == 1 && crop[0].1.about.shard.is_none();
        samples_once(crop, partial || whole, &mut problems)?;
    }
    let crop = rectangle(&parts, partial, &mut problems)?;
    if !problems.is_empty() {
        problems.push("  hint: `--partial` merges what there is".to_owned());
        return Err(MergeError::Parts(problems.join("\n")));
    }

    let (mut about, mut job) = film_file::read(first)?;
    let alone = paths.len() == 1;
    if job.film.crop() != crop || !alone {
        let mut film = Film::new(crop, about.collected, job.film.light_scale())?;
        film.add(&job.film);
        job.film = film;
    }
    for path in &paths[1..] {
        let (_, part) = film_file::read(path)?;
        job.film.add(&part.film);
        job.counters.add(&part.counters);
        job.elapsed += part.elapsed;
        job.samples.start = job.samples.start.min(part.samples.start);
        job.samples.end = job.samples.end.max(part.samples.end);
    }
    if !alone {
        // All samples are there (or nobody will go on from here): the next one is the same for all tiles.
        job.done = job.samples.end - job.samples.start;
        let next = [job.samples.end; 2];
        job.film.tiles_mut().iter_mut().for_each(|t| t.next = next);
    }
    about.shard = None;
    about.keys.retain(|(key, _)| !OF_THE_PART.contains(&key.as_str()));
    about.keys.push(("shard".to_owned(), "none".to_owned()));
    about.keys.push(("render.crop".to_owned(), format!("{crop:?}")));
    Ok((about, job))
}

/// Refuses parts of different renders.
fn same_render(parts: &[(&Path, Header)]) -> Result<(), MergeError> {
    let keys = |h: &Header| -> Vec<(String, String)> {
        let mut keys = h.about.keys.clone();
        keys.retain(|(key, _)| !OF_THE_PART.contains(&key.as_str()));
        keys.push(("render.spp".to_owned(), h.about.spp.to_string()));
        keys
    };
    let (first, header) = &parts[0];
    let wanted = keys(header);
    if let Some((path, _)) = parts.iter().find(|(_, h)| h.planned && parts.len() > 1) {
        return Err(MergeError::Parts(format!(
            "{} was sampled adaptively: what one machine would have sampled cannot be made from such parts",
            path.display()
        )));
    }
    for (path, header) in &parts[1..] {
        let differences = identity::differences(&keys(header), &wanted, ["in the former", "in the latter"]);
        if !differences.is_empty() {
            return Err(MergeError::Parts(format!(
                "{} and {} are not of one render:\n  {}",
                path.display(),
                first.display(),
                differences.join("\n  ")
            )));
        }
    }
    Ok(())
}

/// Checks that the parts of one crop, sorted by their samples, hold each sample once.
fn samples_once(parts: &[(&Path, Header)], partial: bool, problems: &mut Vec<String>) -> Result<(), MergeError> {
    let spp = parts[0].1.about.spp;
    let shards = parts.iter().find_map(|(_, h)| h.about.shard).map(|s| s.count);
    let mut end = 0;
    let mut missing = |from: u32, to: u32| {
        if from < to && !partial {
            // Which shards those are, if all parts are shards of the same number.
            let lost = |i: &u32| {
                let s = super::Shard { index: *i, count: shards.unwrap_or(1) }.samples(spp);
                from <= s.start && s.end <= to && !s.is_empty()
            };
            let names: Vec<String> =
                shards.map_or(Vec::new(), |n| (1..=n).filter(lost).map(|i| format!("{i}/{n}")).collect());
            let names = if names.is_empty() { String::new() } else { format!(": shard {}", names.join(", ")) };
            problems.push(format!("samples {from} to {to} of {spp} are missing{names}"));
        }
    };
    let mut before: Option<&Path> = None;
    for (path, header) in parts {
        let [from, to] = header.samples;
        missing(end, from);
        // An empty shard overlaps nothing.
        if from < end && from < header.next[1] {
            return Err(MergeError::Parts(format!(
                "{} and {} both hold samples {from} to {}",
                before.unwrap_or(path).display(),
                path.display(),
                end.min(to.max(header.next[1])),
            )));
        }
        end = end.max(to).max(header.next[1]);
        before = Some(path);
    }
    missing(end, spp);
    for (path, header) in parts {
        if header.next[0] < header.samples[1] && !partial {
            let of = header.samples[1] - header.samples[0];
            let has = header.next[0].saturating_sub(header.samples[0]);
            problems.push(format!(
                "{} is not finished: it has {has} of its {of} samples; `render --resume` goes on with it",
                path.display()
            ));
        }
    }
    Ok(())
}

/// The rectangle that the parts' crops make, each pixel once.
fn rectangle(parts: &[(&Path, Header)], partial: bool, problems: &mut Vec<String>) -> Result<[u32; 4], MergeError> {
    let crops: Vec<(&Path, [u32; 4])> =
        parts.chunk_by(|a, b| a.1.crop == b.1.crop).map(|same| (same[0].0, same[0].1.crop)).collect();
    let mut all = crops[0].1;
    let mut area = 0;
    for (i, (path, c)) in crops.iter().enumerate() {
        for (other, o) in &crops[..i] {
            if c[0] < o[2] && o[0] < c[2] && c[1] < o[3] && o[1] < c[3] {
                return Err(MergeError::Parts(format!(
                    "{} and {} both hold pixels {},{} to {},{}",
                    other.display(),
                    path.display(),
                    c[0].max(o[0]),
                    c[1].max(o[1]),
                    c[2].min(o[2]),
                    c[3].min(o[3])
                )));
            }
        }
        all = [all[0].min(c[0]), all[1].min(c[1]), all[2].max(c[2]), all[3].max(c[3])];
        area += u64::from(c[2] - c[0]) * u64::from(c[3] - c[1]);
    }
    let whole = u64::from(all[2] - all[0]) * u64::from(all[3] - all[1]);
    if area < whole && !partial {
        // The rows and columns of the crops' edges cut the rectangle into cells; each empty one has a name.
        let edges = |k: usize| {
            let mut edges: Vec<u32> = crops.iter().flat_map(|(_, c)| [c[k], c[k + 2]]).collect();
            edges.sort_unstable();
            edges.dedup();
            edges
        };
        for y in edges(1).windows(2) {
            for x in edges(0).windows(2) {
                let inside = |c: &[u32; 4]| c[0] <= x[0] && x[1] <= c[2] && c[1] <= y[0] && y[1] <= c[3];
                if !crops.iter().any(|(_, c)| inside(c)) {
                    problems.push(format!("pixels {},{} to {},{} are missing", x[0], y[0], x[1], y[1]));
                }
            }
        }
    }
    Ok(all)
}
