//! What changes from frame to frame: numbered paths, and values between keys.

use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::math::special::hermite;

/// A path with the number of a frame in it: `####`, `%04d` and `$F4` become `0007`, `{frame}`, `%d` and `$F` become `7`. `None`
/// for a path that has no place for a number, and so is the same for all frames.
pub(crate) fn numbered(path: &Path, frame: u32) -> Option<PathBuf> {
    let text = as_signs(path.to_str()?);
    if !text.contains('#') && !text.contains("{frame}") {
        return None;
    }
    let text = text.replace("{frame}", &frame.to_string());
    let mut out = String::with_capacity(text.len());
    let mut rest = text.as_str();
    while let Some(start) = rest.find('#') {
        let after = rest[start..].trim_start_matches('#');
        let width = rest.len() - start - after.len();
        out.push_str(&rest[..start]);
        out.push_str(&format!("{frame:0width$}"));
        rest = after;
    }
    out.push_str(rest);
    Some(out.into())
}

/// A name whose places for numbers are all written with signs: `#` for each digit, `{frame}` for as many as there are.
fn as_signs(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find(['%', '$']) {
        let own = &rest[start..];
        let (signs, length) = match place_of_number(own) {
            Some((0 | 1, length)) => ("{frame}".to_owned(), length),
            Some((digits, length)) => ("#".repeat(digits), length),
            None => (own[..1].to_owned(), 1),
        };
        out.push_str(&rest[..start]);
        out.push_str(&signs);
        rest = &own[length..];
    }
    out.push_str(rest);
    out
}

/// The digits that `%04d` or `$F4` at the beginning of a text asks for, and its length.
fn place_of_number(text: &str) -> Option<(usize, usize)> {
    const MOST: usize = 16;
    let (after, around) = match text.strip_prefix("$F") {
        Some(after) => (after, 2),
        None => (text.strip_prefix('%')?, 2),
    };
    let digits = after.len() - after.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let ends = |rest: &str| !rest.starts_with(|c: char| c.is_ascii_alphabetic());
    if text.starts_with('%') && !after[digits..].strip_prefix('d').is_some_and(ends) {
        return None;
    }
    let width = if digits == 0 { 1 } else { after[..digits].parse().ok()? };
    (width <= MOST).then_some((width, around + digits))
}

/// A sequence of numbered files, about one of its frames.
pub(crate) struct Files {
    pattern: PathBuf,
    frame: u32,
    /// Those that there are, from the smallest to the largest; none where the frame has no file, which its reader tells.
    numbers: Vec<u32>,
}

impl Files {
    /// `None` where the path is that of a file itself, or has no place for a number.
    pub(crate) fn about(path: &Path, frame: u32) -> Option<Self> {
        let own = numbered(path, frame).filter(|_| !path.exists())?;
        let numbers = if own.exists() { numbers(path) } else { Vec::new() };
        Some(Self { pattern: path.to_owned(), frame, numbers })
    }

    /// The number of the file that is shown at a frame: before the first one and after the last one all stands still.
    pub(crate) fn number_at(&self, frame: f64) -> u32 {
        let (Some(first), Some(last)) = (self.numbers.first(), self.numbers.last()) else { return self.frame };
        (frame as i64).clamp((*first).into(), (*last).into()) as u32
    }

    /// The file of a number.
    pub(crate) fn file(&self, number: u32) -> PathBuf {
        numbered(&self.pattern, number).unwrap_or_else(|| self.pattern.clone())
    }

    /// The number of the first file.
    pub(crate) fn first(&self) -> u32 {
        self.numbers.first().copied().unwrap_or(self.frame)
    }
}

/// The numbers for which a numbered file exists, from the smallest to the largest.
fn numbers(path: &Path) -> Vec<u32> {
    // A folder may have the number as well as the file, or in its place.
    let has_place = |part: &&Path| part.file_name().is_some_and(|name| numbered(Path::new(name), 0).is_some());
    let Some(place) = path.ancestors().filter(has_place).last() else { return Vec::new() };
    let folder = place.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let numbers_in = |name: &str| -> Vec<u32> {
        let runs = name.split(|c: char| !c.is_ascii_digit());
        runs.filter_map(|digits| digits.parse().ok()).collect()
    };
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let names = entries.filter_map(|e| e.ok()?.file_name().into_string().ok());
    let of = |pattern: &Path, number: u32| numbered(pattern, number).unwrap_or_default();
    let fits =
        |name: &str, number: u32| of(place, number).file_name() == Some(name.as_ref()) && of(path, number).exists();
    let mut found: Vec<u32> =
        names.filter_map(|name| numbers_in(&name).into_iter().filter(|&n| fits(&name, n)).min()).collect();
    found.sort_unstable();
    found
}

/// A value that goes smoothly through keys in time and stays at the first and the last: a Catmull-Rom spline with its
/// slopes by the keys' own times (cubic Hermite, finite differences).
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    keys: Vec<(f64, DVec3)>,
}

impl Track {
    /// Through keys whose times increase; `None` without any.
    pub fn new(keys: Vec<(f64, DVec3)>) -> Option<Self> {
        debug_assert!(keys.windows(2).all(|k| k[0].0 < k[1].0), "keys stand in order");
        (!keys.is_empty()).then_some(Self { keys })
    }

    /// The value at a time.
    pub fn at(&self, time: f64) -> DVec3 {
        let keys = &self.keys;
        let next = keys.partition_point(|(t, _)| *t <= time);
        if next == 0 || next == keys.len() {
            return keys[next.saturating_sub(1)].1;
        }
        let slope = |i: usize| {
            let (a, b) = (&keys[i.saturating_sub(1)], &keys[(i + 1).min(keys.len() - 1)]);
            (b.1 - a.1) / (b.0 - a.0)
        };
        let ((t0, v0), (t1, v1)) = (keys[next - 1], keys[next]);
        let span = t1 - t0;
        let s = (time - t0) / span;
        hermite([v0, v1], [next - 1, next].map(|i| span * slope(i)), s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_take_numbers() {
        let of = |path: &str| numbered(Path::new(path), 7).map(|p| p.display().to_string());
        assert_eq!(of("out/hat.####.exr").as_deref(), Some("out/hat.0007.exr"));
        assert_eq!(of("#/hat_{frame}.exr").as_deref(), Some("7/hat_7.exr"));
        for name in ["hat.%04d.exr", "hat.$F4.exr"] {
            assert_eq!(of(name).as_deref(), Some("hat.0007.exr"));
        }
        assert_eq!(of("hat.%d.$F.exr").as_deref(), Some("hat.7.7.exr"));
        for name in ["hat.exr", "100%.exr", "50%deep.exr", "$HOME.exr", "%99d.exr", "%04", "%", "$"] {
            assert_eq!(of(name), None, "{name}");
        }
        assert_eq!(numbered(Path::new("a#.b"), 1234), Some("a1234.b".into()));
    }

    #[test]
    fn files_of_a_sequence_are_found() {
        let folder = tempfile::tempdir().expect("a directory");
        for name in ["x.0012.bcc", "x.0009.bcc", "x.9.bcc", "y.0001.bcc", "x.0003.txt"] {
            std::fs::write(folder.path().join(name), "").expect("a file");
        }
        assert_eq!(numbers(&folder.path().join("x.####.bcc")), [9, 12]);
        for name in ["0004/a.bcc", "0007/a.bcc", "0007/a.7.bcc", "0008/b.bcc"] {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            std::fs::write(path, "").expect("a file");
        }
        assert_eq!(numbers(&folder.path().join("####/a.bcc")), [4, 7]);
        assert_eq!(numbers(&folder.path().join("####/a.{frame}.bcc")), [7]);
        assert!(numbers(&folder.path().join("z.####.bcc")).is_empty());
        assert!(numbers(&folder.path().join("none/z.####.bcc")).is_empty());
        let files = Files::about(&folder.path().join("x.####.bcc"), 9).expect("a place for a number");
        assert_eq!([-3.0, 0.0, 9.0, 10.0, 12.0, 13.0].map(|frame| files.number_at(frame)), [9, 9, 9, 10, 12, 12]);
        assert_eq!((files.first(), files.file(12)), (9, folder.path().join("x.0012.bcc")));
        // Of a frame without a file nothing else is shown.
        let none = Files::about(&folder.path().join("x.####.bcc"), 3).expect("a place for a number");
        assert_eq!((none.number_at(12.0), none.first()), (3, 3));
        assert!(Files::about(&folder.path().join("x.0012.bcc"), 3).is_none());
    }

    #[test]
    fn tracks_go_through_their_keys_smoothly_and_stay_at_the_ends() {
        let track = Track::new(vec![
            (1.0, DVec3::ZERO),
            (4.0, DVec3::new(3.0, 1.0, 0.0)),
            (5.0, DVec3::new(4.0, -1.0, 2.0)),
            (9.0, DVec3::new(8.0, 0.0, 0.0)),
        ])
        .expect("keys");
        for &(time, value) in &track.keys {
            assert!((track.at(time) - value).length() < 1e-12);
            // The slope is the same from both sides.
            let h = 1e-6;
            let (before, after) = ((value - track.at(time - h)) / h, (track.at(time + h) - value) / h);
            assert!(time == 1.0 || time == 9.0 || (before - after).length() < 1e-4, "{before} {after}");
        }
        // What grows evenly in time does so between uneven keys.
        for i in 0..80 {
            let time = 1.0 + f64::from(i) / 10.0;
            assert!((track.at(time).x - (time - 1.0)).abs() < 1e-12);
        }
        assert_eq!((track.at(-3.0), track.at(99.0)), (DVec3::ZERO, DVec3::new(8.0, 0.0, 0.0)));
        assert!(Track::new(Vec::new()).is_none());
        assert_eq!(Track::new(vec![(2.0, DVec3::ONE)]).expect("a key").at(7.0), DVec3::ONE);
    }
}
