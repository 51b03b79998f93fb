//! BCC, the Binary Curve Collection of Cem Yuksel's yarn-level models. Little-endian throughout.
//!
//! | byte | size | meaning |
//! |---|---|---|
//! | 0 | 3 | `BCC` |
//! | 3 | 1 | bytes per integer (high nibble) and per float (low nibble): 0x44, here also 0x48 |
//! | 4 | 2 | `C0` Catmull-Rom; by others `BS` B-spline, `PL` polyline, `BZ` Bezier (not read) |
//! | 6 | 1 | dimensions, 3 |
//! | 7 | 1 | axis that points up: 1 = y, 2 = z |
//! | 8 | 8 | number of curves |
//! | 16 | 8 | number of control points of all curves |
//! | 24 | 40 | free text; some writers leave garbage here, so it is not looked at |
//! | 64 | | for each curve an i32 n, then \|n\| points; n is negative for a closed curve |
//!
//! The format has neither radii nor a unit of length.

use std::io::{self, Write};

use glam::DVec3;
use rayon::prelude::*;

use super::repair::{Ends, Repair};
use super::{CurveFileError, FileLocation, ReadOptions, quoted};
use crate::{
    geometry::curve::{Basis, CurveSet},
    math::words::counted,
};

/// The first bytes of every BCC file.
pub(super) const MAGIC: &[u8] = b"BCC";

const HEADER_BYTES: usize = 64;
const COUNT_BYTES: usize = 4;
const CUT_SHORT: &str = "is the file cut short?";

struct Header {
    float_bytes: usize,
    basis: Basis,
    up: u8,
    curves: u64,
    points: u64,
}

impl Header {
    fn point_bytes(&self) -> usize {
        3 * self.float_bytes
    }
}

/// Curves read at a time, on all cores.
const BATCH: usize = 4096;

pub(super) fn parse(bytes: &[u8], options: &ReadOptions) -> Result<CurveSet, CurveFileError> {
    let header = parse_header(bytes)?;
    let body = bytes.len() - HEADER_BYTES;
    if header.curves > (body / COUNT_BYTES) as u64 {
        let problem = format!("the header promises {} curves but only {body} bytes follow it", header.curves);
        return Err(CurveFileError::byte(8, problem).hint(CUT_SHORT));
    }

    // First the counts alone, so that nothing is allocated for points that are not there.
    let mut found = 0;
    let mut end = HEADER_BYTES;
    for index in 0..header.curves {
        let curve = RawCurve::at(bytes, end, index, &header)?;
        found += u64::from(curve.count);
        end = curve.end;
    }
    let rest = bytes.len() - end;
    let missing = header.points.saturating_sub(found);
    if missing > (rest / header.point_bytes()) as u64 {
        let problem = format!(
            "the header promises {} points but the curves hold {found} and only {rest} bytes follow them",
            header.points
        );
        return Err(CurveFileError::byte(16, problem).hint(CUT_SHORT));
    }
    if found > options.max_points {
        return Err(CurveFileError::too_many_points(FileLocation::Byte(16), found, options));
    }

    let mut repair = Repair::default();
    if header.points != found {
        let promised = counted(header.points, "point");
        repair.note(format!("the header promises {promised} but the curves hold {found}; the header was ignored"));
    }
    if rest > 0 {
        repair.note(format!("{} after the last curve; ignored", counted(rest as u64, "byte")));
    }
    let up_axis = matches!(header.up, 1 | 2).then_some(header.up);
    if up_axis.is_none() {
        repair.note(format!("the axis that points up should be 1 or 2 but is {}; ignored", header.up));
    }
    let mut start = HEADER_BYTES;
    for first in (0..header.curves).step_by(BATCH) {
        let mut batch = Vec::new();
        for index in first..header.curves.min(first + BATCH as u64) {
            let curve = RawCurve::at(bytes, start, index, &header)?;
            start = curve.end;
            batch.push((index, curve));
        }
        let points: Vec<_> = batch.par_iter().map(|(index, curve)| curve.points(*index, &header)).collect();
        for ((_, curve), points) in batch.iter().zip(points) {
            let ends = if curve.closed { Ends::MarkedClosed } else { Ends::Open };
            repair.add(header.basis, ends, points?, None);
        }
    }
    Ok(CurveSet { up_axis, ..repair.finish() })
}

fn parse_header(bytes: &[u8]) -> Result<Header, CurveFileError> {
    if bytes.len() >= MAGIC.len() && !bytes.starts_with(MAGIC) {
        let found = quoted(&bytes[..MAGIC.len()].escape_ascii().to_string());
        let problem = format!("expected the letters BCC, found {found}");
        return Err(CurveFileError::byte(0, problem).hint("is this another kind of file?"));
    }
    if bytes.len() < HEADER_BYTES {
        let problem = format!("the header takes {HEADER_BYTES} bytes but the file ends here");
        return Err(CurveFileError::byte(bytes.len(), problem).hint(CUT_SHORT));
    }
    let float_bytes = match bytes[3] {
        0x44 => 4,
        0x48 => 8,
        other => {
            let problem = format!("expected number sizes 0x44 or 0x48, found {other:#04x}");
            return Err(CurveFileError::byte(3, problem).hint("write 4-byte integers with 4-byte or 8-byte floats"));
        }
    };
    let basis = match &bytes[4..6] {
        b"C0" => Basis::CatmullRom,
        b"BS" => Basis::BSpline,
        b"PL" => Basis::Linear,
        b"BZ" => {
            return Err(CurveFileError::byte(4, "expected curve type C0, BS or PL, found BZ")
                .hint("Bezier curves are not supported, so convert them to Catmull-Rom curves (C0)"));
        }
        other => {
            let found = quoted(&other.escape_ascii().to_string());
            return Err(CurveFileError::byte(4, format!("expected curve type C0, BS or PL, found {found}")));
        }
    };
    if bytes[6] != 3 {
        return Err(CurveFileError::byte(6, format!("expected curves in 3 dimensions, found {}", bytes[6])));
    }
    let u64_at = |at: usize| u64::from_le_bytes(bytes_at(bytes, at).expect("the length of the header was checked"));
    Ok(Header { float_bytes, basis, up: bytes[7], curves: u64_at(8), points: u64_at(16) })
}

fn bytes_at<const SIZE: usize>(bytes: &[u8], at: usize) -> Option<[u8; SIZE]> {
    bytes.get(at..)?.first_chunk().copied()
}

/// A curve whose points are known to be there, but not yet looked at.
struct RawCurve<'a> {
    closed: bool,
    count: u32,
    coordinates: &'a [u8],
    coordinates_at: usize,
    end: usize,
}

impl<'a> RawCurve<'a> {
    fn at(bytes: &'a [u8], at: usize, index: u64, header: &Header) -> Result<Self, CurveFileError> {
        let Some(count) = bytes_at(bytes, at).map(i32::from_le_bytes) else {
            let problem = format!("expected curve {index} of {} here, found {} bytes", header.curves, bytes.len() - at);
            return Err(CurveFileError::byte(at, problem).hint(CUT_SHORT));
        };
        let closed = count < 0;
        let count = count.unsigned_abs();
        let coordinates_at = at + COUNT_BYTES;
        let rest = &bytes[coordinates_at..];
        // In u64, because the product may not fit a 32-bit machine's usize.
        let needed = u64::from(count) * header.point_bytes() as u64;
        if needed > rest.len() as u64 {
            let problem = format!("curve {index} claims {count} points but only {} bytes follow", rest.len());
            return Err(CurveFileError::byte(at, problem).hint(CUT_SHORT));
        }
        let coordinates = &rest[..needed as usize];
        Ok(Self { closed, count, coordinates, coordinates_at, end: coordinates_at + coordinates.len() })
    }

    fn points(&self, index: u64, header: &Header) -> Result<Vec<DVec3>, CurveFileError> {
        let mut points = Vec::with_capacity(self.count as usize);
        for (number, point) in self.coordinates.chunks_exact(header.point_bytes()).enumerate() {
            let mut coordinates = [0.0; 3];
            for (axis, float) in point.chunks_exact(header.float_bytes).enumerate() {
                let value = match float {
                    &[a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
                    _ => f64::from_le_bytes(bytes_at(float, 0).expect("floats have 4 or 8 bytes")),
                };
                if !value.is_finite() {
                    let at = self.coordinates_at + number * header.point_bytes() + axis * header.float_bytes;
                    let name = ["x", "y", "z"][axis];
                    let problem = format!(
                        "expected a finite number for {name} of point {number} of curve {index}, found {value}"
                    );
                    return Err(CurveFileError::byte(at, problem));
                }
                coordinates[axis] = value;
            }
            points.push(DVec3::from_array(coordinates));
        }
        Ok(points)
    }
}

/// The most points of a curve: they are counted in four bytes with a sign.
pub(super) const MOST_POINTS: usize = i32::MAX as usize;

/// Writes curves as BCC with 4-byte floats.
///
/// The format has no place for radii and the unit of length: they are left out. Where `up_axis` is absent, z is written.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`], before anything is written, if the curves differ in basis, a coordinate does not
/// fit an f32, or a curve has more than `i32::MAX` points; otherwise whatever `out` reports.
pub fn write_bcc(set: &CurveSet, out: &mut impl Write) -> io::Result<()> {
    let invalid = |problem: &str| io::Error::new(io::ErrorKind::InvalidInput, problem);
    let basis = set.curves.first().map_or(Basis::CatmullRom, |curve| curve.basis);
    let mut points = 0_u64;
    for curve in &set.curves {
        if curve.basis != basis {
            return Err(invalid("a BCC file has one basis for all curves"));
        }
        if curve.points.len() > MOST_POINTS {
            return Err(invalid("a curve of a BCC file has at most 2147483647 points"));
        }
        if !curve.points.iter().all(|point| point.as_vec3().is_finite()) {
            return Err(invalid("a coordinate does not fit a 4-byte float"));
        }
        points += curve.points.len() as u64;
    }
    let kind = match basis {
        Basis::CatmullRom => b"C0",
        Basis::BSpline => b"BS",
        Basis::Linear => b"PL",
    };
    let mut info = [0; 40];
    info[..7].copy_from_slice(b"yarnray");
    out.write_all(MAGIC)?;
    out.write_all(&[0x44, kind[0], kind[1], 3, set.up_axis.unwrap_or(2)])?;
    out.write_all(&(set.curves.len() as u64).to_le_bytes())?;
    out.write_all(&points.to_le_bytes())?;
    out.write_all(&info)?;
    for curve in &set.curves {
        let count = curve.points.len() as i32;
        out.write_all(&(if curve.closed { -count } else { count }).to_le_bytes())?;
        for point in &curve.points {
            for value in point.as_vec3().to_array() {
                out.write_all(&value.to_le_bytes())?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::curve::Curve;

    const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [0.1, 1.0, -2.5]];

    /// A file byte by byte, independent of `write_bcc`. Counts are as written, so negative for closed curves.
    fn file(kind: &[u8; 2], total: u64, curves: &[(i32, &[[f32; 3]])]) -> Vec<u8> {
        let mut bytes = b"BCC\x44".to_vec();
        bytes.extend(kind);
        bytes.extend([3, 1]);
        bytes.extend((curves.len() as u64).to_le_bytes());
        bytes.extend(total.to_le_bytes());
        bytes.extend([0xff; 40]);
        for (count, points) in curves {
            bytes.extend(count.to_le_bytes());
            bytes.extend(points.iter().flatten().flat_map(|value| value.to_le_bytes()));
        }
        bytes
    }

    fn triangle() -> Vec<u8> {
        file(b"C0", 3, &[(-3, &TRIANGLE)])
    }

    fn parsed(bytes: &[u8]) -> CurveSet {
        parse(bytes, &ReadOptions::default()).expect("a readable file")
    }

    fn message(bytes: &[u8]) -> String {
        parse(bytes, &ReadOptions::default()).expect_err("a broken file").to_string()
    }

    fn with(mut bytes: Vec<u8>, at: usize, patch: &[u8]) -> Vec<u8> {
        bytes[at..at + patch.len()].copy_from_slice(patch);
        bytes
    }

    #[test]
    fn a_small_file_is_read_exactly() {
        let bytes = file(b"C0", 5, &[(-3, &TRIANGLE), (2, &TRIANGLE[..2])]);
        let set = parsed(&bytes);
        let points: Vec<DVec3> =
            TRIANGLE.iter().map(|p| DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))).collect();
        let curve = |closed, points: &[DVec3]| Curve {
            basis: Basis::CatmullRom,
            closed,
            points: points.to_vec(),
            radii: None,
            flattening: None,
        };
        assert_eq!(
            set,
            CurveSet {
                curves: vec![curve(true, &points), curve(false, &points[..2])],
                up_axis: Some(1),
                ..CurveSet::default()
            }
        );
    }

    #[test]
    fn the_curve_type_gives_the_basis() {
        for (kind, basis) in [(b"C0", Basis::CatmullRom), (b"BS", Basis::BSpline), (b"PL", Basis::Linear)] {
            assert_eq!(parsed(&file(kind, 3, &[(3, &TRIANGLE)])).curves[0].basis, basis);
        }
    }

    #[test]
    fn eight_byte_floats_keep_all_digits() {
        let mut bytes = with(file(b"C0", 2, &[]), 3, &[0x48]);
        bytes[8] = 1;
        bytes.extend(2_i32.to_le_bytes());
        bytes.extend([0.1_f64, 0.2, 0.3, 0.4, 0.5, 0.6].iter().flat_map(|value| value.to_le_bytes()));
        assert_eq!(parsed(&bytes).curves[0].points, [DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.4, 0.5, 0.6)]);
    }

    #[test]
    fn broken_headers_are_explained() {
        let cases: &[(Vec<u8>, &str)] = &[
            (vec![], "byte 0: the header takes 64 bytes but the file ends here; is the file cut short?"),
            (
                triangle()[..40].to_vec(),
                "byte 40: the header takes 64 bytes but the file ends here; is the file cut short?",
            ),
            (
                with(triangle(), 0, b"HAI"),
                "byte 0: expected the letters BCC, found \"HAI\"; is this another kind of file?",
            ),
            (
                with(triangle(), 3, &[0x88]),
                "byte 3: expected number sizes 0x44 or 0x48, found 0x88; \
                 write 4-byte integers with 4-byte or 8-byte floats",
            ),
            (
                with(triangle(), 4, b"BZ"),
                "byte 4: expected curve type C0, BS or PL, found BZ; \
                 Bezier curves are not supported, so convert them to Catmull-Rom curves (C0)",
            ),
            (with(triangle(), 4, b"C1"), "byte 4: expected curve type C0, BS or PL, found \"C1\""),
            (with(triangle(), 6, &[2]), "byte 6: expected curves in 3 dimensions, found 2"),
            (
                with(triangle(), 8, &u64::MAX.to_le_bytes()),
                "byte 8: the header promises 18446744073709551615 curves but only 40 bytes follow it; \
                 is the file cut short?",
            ),
        ];
        for (bytes, expected) in cases {
            assert_eq!(message(bytes), *expected);
        }
    }

    #[test]
    fn missing_data_is_explained() {
        let cases: &[(Vec<u8>, &str)] = &[
            (
                with(triangle(), 64, &2_000_000_000_i32.to_le_bytes()),
                "byte 64: curve 0 claims 2000000000 points but only 36 bytes follow; is the file cut short?",
            ),
            (
                with(triangle(), 64, &i32::MIN.to_le_bytes()),
                "byte 64: curve 0 claims 2147483648 points but only 36 bytes follow; is the file cut short?",
            ),
            (with(triangle(), 8, &[2]), "byte 104: expected curve 1 of 2 here, found 0 bytes; is the file cut short?"),
            (
                with(triangle(), 16, &u64::MAX.to_le_bytes()),
                "byte 16: the header promises 18446744073709551615 points but the curves hold 3 \
                 and only 0 bytes follow them; is the file cut short?",
            ),
        ];
        for (bytes, expected) in cases {
            assert_eq!(message(bytes), *expected);
        }
    }

    #[test]
    fn coordinates_must_be_finite() {
        let bytes =
            with(file(b"C0", 5, &[(2, &TRIANGLE[..2]), (3, &TRIANGLE)]), 64 + 28 + 4 + 16, &f32::NAN.to_le_bytes());
        assert_eq!(message(&bytes), "byte 112: expected a finite number for y of point 1 of curve 1, found NaN");
        let bytes = with(triangle(), 68, &f32::NEG_INFINITY.to_le_bytes());
        assert_eq!(message(&bytes), "byte 68: expected a finite number for x of point 0 of curve 0, found -inf");
    }

    #[test]
    fn harmless_disagreements_become_notes() {
        let set = parsed(&with(triangle(), 16, &[1]));
        assert_eq!(set.notes, ["the header promises 1 point but the curves hold 3; the header was ignored"]);
        let mut bytes = triangle();
        bytes.push(7);
        assert_eq!(parsed(&bytes).notes, ["1 byte after the last curve; ignored"]);
        let set = parsed(&with(triangle(), 7, &[9]));
        assert_eq!(set.notes, ["the axis that points up should be 1 or 2 but is 9; ignored"]);
        assert_eq!(set.up_axis, None);
        let set = parsed(&file(b"C0", 4, &[(0, &[]), (-1, &TRIANGLE[..1]), (3, &TRIANGLE)]));
        assert_eq!(set.curves.len(), 1);
        assert_eq!(set.notes, ["2 curves (first: curve 0) without two distinct points; skipped"]);
    }

    #[test]
    fn the_number_of_points_is_limited() {
        let options = ReadOptions { max_points: 2, ..ReadOptions::default() };
        let error = parse(&triangle(), &options).expect_err("one point too many");
        assert_eq!(error.to_string(), "byte 16: 3 points are more than the 2 allowed");
    }

    #[test]
    fn what_is_written_is_read_back_bit_for_bit() {
        for kind in [b"C0", b"BS", b"PL"] {
            let set = parsed(&file(kind, 5, &[(-3, &TRIANGLE), (2, &TRIANGLE[1..])]));
            let mut bytes = Vec::new();
            write_bcc(&set, &mut bytes).expect("a vector takes everything");
            assert_eq!(parsed(&bytes), set);
            let expected = file(kind, 5, &[(-3, &TRIANGLE), (2, &TRIANGLE[1..])]);
            assert_eq!((&bytes[..24], &bytes[64..]), (&expected[..24], &expected[64..]));
        }
    }

    #[test]
    fn what_does_not_fit_is_not_written() {
        let mut set = parsed(&file(b"C0", 5, &[(-3, &TRIANGLE), (2, &TRIANGLE[1..])]));
        let refusal = |set: &CurveSet| {
            let mut bytes = Vec::new();
            let error = write_bcc(set, &mut bytes).expect_err("must not fit").to_string();
            assert!(bytes.is_empty());
            error
        };
        set.curves[1].points[0].x = 1e300;
        assert_eq!(refusal(&set), "a coordinate does not fit a 4-byte float");
        set.curves[0].basis = Basis::Linear;
        assert_eq!(refusal(&set), "a BCC file has one basis for all curves");
    }
}
