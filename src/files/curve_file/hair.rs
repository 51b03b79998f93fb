//! cyHair, the format of Cem Yuksel's hair models (`.hair`). Little-endian throughout.
//!
//! | byte | size | meaning |
//! |---|---|---|
//! | 0 | 4 | `HAIR` |
//! | 4 | 4 | number of strands |
//! | 8 | 4 | number of points of all strands |
//! | 12 | 4 | which arrays follow: 1 segments, 2 points, 4 thickness, 8 transparency, 16 colours |
//! | 16 | 4 | segments of a strand, where there is no array of them |
//! | 20 | 20 | default thickness, transparency and colour |
//! | 40 | 88 | free text |
//! | 128 | | u16 segments\[strands\], f32 xyz\[points\], f32 thickness\[points\], and what is not looked at |
//!
//! A strand has one point more than segments. The format says nothing of a basis: points are taken as Catmull-Rom curves
//! unless asked otherwise. Thickness is read and written as a diameter.

use std::{
    io::{self, Write},
    ops::Range,
};

use glam::DVec3;

use super::repair::{Ends, Repair};
use super::{CurveFileError, FileLocation, ReadOptions};
use crate::{
    geometry::curve::{Basis, CurveSet},
    math::words::counted,
};

/// The first bytes of every cyHair file.
pub(super) const MAGIC: &[u8] = b"HAIR";

/// The most points of a strand: its segments are counted in two bytes.
pub(super) const MOST_POINTS: usize = u16::MAX as usize + 1;

const HEADER_BYTES: usize = 128;
const CUT_SHORT: &str = "is the file cut short?";
const SEGMENTS: u32 = 1;
const POINTS: u32 = 2;
const THICKNESS: u32 = 4;

pub(super) fn parse(bytes: &[u8], options: &ReadOptions) -> Result<CurveSet, CurveFileError> {
    let file = Hair::of(bytes, options)?;
    let mut repair = Repair::default();
    let mut first = 0_usize;
    for strand in 0..file.strands {
        let points = file.points_of(strand, first)?;
        first = points.end;
        let mut curve = points.clone().map(|point| file.point(point)).collect::<Result<Vec<DVec3>, _>>()?;
        let mut radii = match file.thickness {
            Some(start) => Some(points.map(|point| file.radius(start + 4 * point)).collect::<Result<Vec<f64>, _>>()?),
            None => None,
        };
        // As in text files: who repeats the first point means a ring.
        let ring = curve.len() >= 4 && curve.first() == curve.last();
        if ring {
            curve.pop();
            radii.iter_mut().for_each(|r| r.truncate(curve.len()));
        }
        let ends = if ring { Ends::Closed } else { Ends::Open };
        repair.add(options.basis.unwrap_or(Basis::CatmullRom), ends, curve, radii);
    }
    if first < file.points {
        repair.note(format!("{} of {} of no strand; ignored", counted(file.points - first, "point"), file.points));
    }
    Ok(repair.finish())
}

/// A file whose arrays are all there.
struct Hair<'a> {
    bytes: &'a [u8],
    strands: usize,
    points: usize,
    /// Where the counts of segments begin, if there are any, and the count of a strand where there are none.
    segments: Option<usize>,
    default_segments: usize,
    /// Where the points begin, and the thicknesses if there are any.
    places: usize,
    thickness: Option<usize>,
}

impl<'a> Hair<'a> {
    /// Reads the header. Everything that it promises must be there before anything is allocated for it.
    fn of(bytes: &'a [u8], options: &ReadOptions) -> Result<Self, CurveFileError> {
        if bytes.len() >= MAGIC.len() && !bytes.starts_with(MAGIC) {
            let found = super::quoted(&bytes[..MAGIC.len()].escape_ascii().to_string());
            let problem = format!("expected the letters HAIR, found {found}");
            return Err(CurveFileError::byte(0, problem).hint("is this another kind of file?"));
        }
        if bytes.len() < HEADER_BYTES {
            let problem = format!("the header takes {HEADER_BYTES} bytes but the file ends here");
            return Err(CurveFileError::byte(bytes.len(), problem).hint(CUT_SHORT));
        }
        let [strands, points, arrays, default_segments] = [4, 8, 12, 16].map(|at| u32_at(bytes, at));
        if arrays & POINTS == 0 {
            return Err(CurveFileError::byte(12, "expected an array of points, found none"));
        }
        let has = |bit: u32| u64::from(arrays & bit != 0);
        let promised = 2 * u64::from(strands) * has(SEGMENTS) + u64::from(points) * (12 + 4 * has(THICKNESS));
        let rest = (bytes.len() - HEADER_BYTES) as u64;
        if promised > rest {
            let problem = format!(
                "the header promises {strands} strands of {points} points, {promised} bytes, but only {rest} follow"
            );
            return Err(CurveFileError::byte(4, problem).hint(CUT_SHORT));
        }
        if u64::from(points) > options.max_points {
            return Err(CurveFileError::too_many_points(FileLocation::Byte(8), points, options));
        }
        let (strands, points) = (strands as usize, points as usize);
        let places = HEADER_BYTES + if has(SEGMENTS) == 1 { 2 * strands } else { 0 };
        Ok(Self {
            bytes,
            strands,
            points,
            segments: (has(SEGMENTS) == 1).then_some(HEADER_BYTES),
            default_segments: default_segments as usize,
            places,
            thickness: (has(THICKNESS) == 1).then_some(places + 12 * points),
        })
    }

    /// The points of a strand, which are those from `first` on.
    fn points_of(&self, strand: usize, first: usize) -> Result<Range<usize>, CurveFileError> {
        let place = self.segments.map_or(16, |start| start + 2 * strand);
        let segments = self.segments.map_or(self.default_segments, |_| {
            usize::from(u16::from_le_bytes([self.bytes[place], self.bytes[place + 1]]))
        });
        let left = self.points - first;
        if segments >= left {
            let problem = format!("strand {strand} has {segments} segments but only {left} points are left for it");
            return Err(CurveFileError::byte(place, problem));
        }
        Ok(first..first + segments + 1)
    }

    fn point(&self, point: usize) -> Result<DVec3, CurveFileError> {
        let at = self.places + 12 * point;
        let p = [0, 4, 8].map(|axis| f64::from(f32_at(self.bytes, at + axis)));
        match p.iter().position(|v| !v.is_finite()) {
            None => Ok(DVec3::from_array(p)),
            Some(axis) => {
                let problem = format!("expected a finite number for {}, found {}", ["x", "y", "z"][axis], p[axis]);
                Err(CurveFileError::byte(at + 4 * axis, problem))
            }
        }
    }

    /// The radius of which the thickness stands at a byte.
    fn radius(&self, at: usize) -> Result<f64, CurveFileError> {
        let thickness = f64::from(f32_at(self.bytes, at));
        if thickness >= 0.0 && thickness.is_finite() {
            Ok(0.5 * thickness)
        } else {
            Err(CurveFileError::byte(at, format!("expected a thickness of 0 or more, found {thickness}")))
        }
    }
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

fn f32_at(bytes: &[u8], at: usize) -> f32 {
    f32::from_bits(u32_at(bytes, at))
}

/// Writes curves as cyHair; a closed curve repeats its first point. The basis is lost.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`], before anything is written, if some curves have radii and others none, a number does
/// not fit an f32, or a curve has more than 65536 points; otherwise whatever `out` reports.
pub fn write_hair(set: &CurveSet, out: &mut impl Write) -> io::Result<()> {
    let invalid = |problem: &str| io::Error::new(io::ErrorKind::InvalidInput, problem);
    let has_radii = set.curves.first().is_some_and(|curve| curve.radii.is_some());
    let mut points = 0_u64;
    for curve in &set.curves {
        let count = curve.points.len() + usize::from(curve.closed);
        if !(2..=MOST_POINTS).contains(&count) {
            return Err(invalid("a strand of a .hair file has 2 to 65536 points"));
        }
        if curve.radii.as_ref().map(Vec::len) != has_radii.then_some(curve.points.len()) {
            return Err(invalid("a .hair file has radii for all points or for none"));
        }
        if !curve.points.iter().all(|p| p.as_vec3().is_finite()) {
            return Err(invalid("a coordinate does not fit a 4-byte float"));
        }
        points += count as u64;
    }
    let (Ok(strands), Ok(points)) = (u32::try_from(set.curves.len()), u32::try_from(points)) else {
        return Err(invalid("a .hair file has at most 4294967295 points"));
    };
    let arrays = SEGMENTS | POINTS | if has_radii { THICKNESS } else { 0 };
    out.write_all(MAGIC)?;
    for value in [strands, points, arrays, 0] {
        out.write_all(&value.to_le_bytes())?;
    }
    // Defaults: thickness 1, opaque, white.
    for value in [1.0_f32, 0.0, 1.0, 1.0, 1.0] {
        out.write_all(&value.to_le_bytes())?;
    }
    let mut info = [0; 88];
    info[..7].copy_from_slice(b"yarnray");
    out.write_all(&info)?;
    for curve in &set.curves {
        let segments = curve.points.len() + usize::from(curve.closed) - 1;
        out.write_all(&(segments as u16).to_le_bytes())?;
    }
    for curve in &set.curves {
        for p in curve.points.iter().chain(curve.points.first().filter(|_| curve.closed)) {
            for value in p.as_vec3().to_array() {
                out.write_all(&value.to_le_bytes())?;
            }
        }
    }
    for radii in set.curves.iter().filter_map(|c| Some((c.radii.as_ref()?, c.closed))) {
        for r in radii.0.iter().chain(radii.0.first().filter(|_| radii.1)) {
            out.write_all(&((2.0 * r) as f32).to_le_bytes())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::curve::Curve;

    fn set() -> CurveSet {
        let line = |n: u32, closed| Curve {
            basis: Basis::CatmullRom,
            closed,
            points: (0..n).map(|i| DVec3::new(f64::from(i), f64::from(i * i) * 0.25, f64::from(n))).collect(),
            radii: Some((0..n).map(|i| 0.5 + 0.125 * f64::from(i)).collect()),
            flattening: None,
        };
        CurveSet { curves: vec![line(3, false), line(5, true), line(2, false)], ..CurveSet::default() }
    }

    fn written(set: &CurveSet) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_hair(set, &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn what_is_written_is_read() {
        let set = set();
        let bytes = written(&set);
        assert_eq!(bytes.len(), 128 + 3 * 2 + 11 * 16);
        let again = parse(&bytes, &ReadOptions::default()).unwrap();
        assert_eq!(again, set);
        assert_eq!(written(&again), bytes);
    }

    #[test]
    fn ends_may_have_no_thickness() {
        let mut set = set();
        set.curves[0].radii = Some(vec![0.5, 0.25, 0.0]);
        assert_eq!(parse(&written(&set), &ReadOptions::default()).unwrap(), set);
    }

    #[test]
    fn strands_without_an_array_of_segments_are_equally_long() {
        let mut bytes = b"HAIR".to_vec();
        for value in [2_u32, 4, 2, 1] {
            bytes.extend(value.to_le_bytes());
        }
        bytes.resize(128, 0);
        bytes.extend((0..12).flat_map(|i| (i as f32).to_le_bytes()));
        let read = parse(&bytes, &ReadOptions::default()).unwrap();
        assert_eq!(read.curves.len(), 2);
        assert_eq!(read.curves[1].points, [DVec3::new(6.0, 7.0, 8.0), DVec3::new(9.0, 10.0, 11.0)]);
        assert!(read.curves[1].radii.is_none());
    }

    #[test]
    fn damage_is_explained() {
        let good = written(&set());
        let with = |at: usize, patch: &[u8]| {
            let mut bytes = good.clone();
            bytes[at..at + patch.len()].copy_from_slice(patch);
            bytes
        };
        for (bytes, message) in [
            (good[..50].to_vec(), "byte 50: the header takes 128 bytes but the file ends here; is the file cut short?"),
            (with(0, b"HEIR"), "byte 0: expected the letters HAIR, found \"HEIR\"; is this another kind of file?"),
            (with(12, &[1]), "byte 12: expected an array of points, found none"),
            (
                with(4, &u32::MAX.to_le_bytes()),
                "byte 4: the header promises 4294967295 strands of 11 points, 8589934766 bytes, but only 182 follow; \
                 is the file cut short?",
            ),
            (with(130, &[200]), "byte 130: strand 1 has 200 segments but only 8 points are left for it"),
            (with(134, &f32::NAN.to_le_bytes()), "byte 134: expected a finite number for x, found NaN"),
            (with(good.len() - 4, &(-1.0_f32).to_le_bytes()), "byte 306: expected a thickness of 0 or more, found -1"),
        ] {
            assert_eq!(parse(&bytes, &ReadOptions::default()).unwrap_err().to_string(), message);
        }
        let few = ReadOptions { max_points: 10, ..ReadOptions::default() };
        assert_eq!(parse(&good, &few).unwrap_err().to_string(), "byte 8: 11 points are more than the 10 allowed");
    }
}
