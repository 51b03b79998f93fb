//! `.yarns`, the yarns of stitch meshes (textiles-lab/smobj). Little-endian throughout.
//!
//! A file is a row of chunks: a tag of four letters, the length of the data as u32, the data.
//!
//! | tag | data |
//! |---|---|
//! | `f3..` | f32 xyz of every point |
//! | `src.` | u32 for each point: the line of the source that made it; not looked at |
//! | `yarn` | for each yarn u32 first point, u32 last point + 1, f32 radius, u8 red, green, blue, alpha (sRGB) |
//! | `strs`, `unit`, `chk.` | lengths that a simulation shall reach; not looked at |
//!
//! Points are those of a quadratic B-spline: the curve goes from middle to middle of the polygon's sides. It is read as a
//! Catmull-Rom curve through these middles and the places between them, and written as the polygon whose curve goes
//! through the points. A yarn that ends at its first point is closed.

use std::io::{self, Write};

use glam::DVec3;

use super::{CurveFileError, FileLocation, ReadOptions};
use crate::{
    geometry::curve::{Basis, Curve, CurveSet},
    math::{
        srgb::{linear_to_srgb, srgb_to_linear},
        words::counted,
    },
};

/// The first bytes of every such file.
pub(super) const MAGIC: &[u8] = b"f3..";

const YARN_BYTES: usize = 16;

pub(super) fn parse(bytes: &[u8], options: &ReadOptions) -> Result<CurveSet, CurveFileError> {
    let (points, points_at) = chunk(bytes, 0, b"f3..", 12)?;
    let (sources, sources_at) = chunk(bytes, points_at + points.len(), b"src.", 4)?;
    let (yarns, yarns_at) = chunk(bytes, sources_at + sources.len(), b"yarn", YARN_BYTES)?;
    let count = points.len() / 12;
    if sources.len() / 4 != count {
        let problem = format!("{} source lines for {count} points", sources.len() / 4);
        return Err(CurveFileError::byte(sources_at, problem));
    }
    if count as u64 > options.max_points {
        return Err(CurveFileError::too_many_points(FileLocation::Byte(4), count, options));
    }
    let point = |i: usize| -> Result<DVec3, CurveFileError> {
        let p = [0, 4, 8].map(|axis| f64::from(f32_at(points, 12 * i + axis)));
        match p.iter().position(|v| !v.is_finite()) {
            None => Ok(DVec3::from_array(p)),
            Some(axis) => {
                let problem = format!("expected a finite number for {}, found {}", ["x", "y", "z"][axis], p[axis]);
                Err(CurveFileError::byte(points_at + 12 * i + 4 * axis, problem))
            }
        }
    };
    let mut set = CurveSet::default();
    let mut too_short = 0;
    let mut end_before = 0;
    for (i, yarn) in yarns.chunks_exact(YARN_BYTES).enumerate() {
        let at = yarns_at + YARN_BYTES * i;
        let (begin, end) = (u32_at(yarn, 0) as usize, u32_at(yarn, 4) as usize);
        if begin > end || end > count || begin < end_before {
            let problem =
                format!("yarn {i} has points {begin} to {end}, of {count}, after those of the yarn before it");
            return Err(CurveFileError::byte(at, problem));
        }
        end_before = end;
        let radius = f64::from(f32_at(yarn, 8));
        if !(radius >= 0.0 && radius.is_finite()) {
            return Err(CurveFileError::byte(at + 8, format!("expected a radius of at least 0, found {radius}")));
        }
        let mut polygon = (begin..end).map(point).collect::<Result<Vec<DVec3>, _>>()?;
        polygon.dedup();
        let closed = polygon.len() > 3 && polygon.first() == polygon.last();
        if closed {
            polygon.pop();
        }
        if polygon.len() < 2 {
            too_short += 1;
            continue;
        }
        let (basis, points) = match options.basis {
            Some(basis) => (basis, polygon),
            None => (Basis::CatmullRom, through_middles(&polygon, closed)),
        };
        let radii = (radius > 0.0).then(|| vec![radius; points.len()]);
        set.curves.push(Curve { basis, closed, points, radii, flattening: None });
        set.colors.push(Some([12, 13, 14].map(|c| srgb_to_linear(f32::from(yarn[c]) / 255.0))));
        set.ids.push(Some(i as i64));
    }
    if too_short > 0 {
        set.notes.push(format!("{} of fewer than two points, left out", counted(too_short, "yarn")));
    }
    Ok(set)
}

/// The data of the chunk that begins at `at`, elements of `size` bytes, and where they begin.
fn chunk<'a>(bytes: &'a [u8], at: usize, tag: &[u8; 4], size: usize) -> Result<(&'a [u8], usize), CurveFileError> {
    let name = tag.escape_ascii();
    let Some(head) = bytes.get(at..at + 8) else {
        let problem = format!("expected the chunk `{name}`, but the file ends here");
        return Err(CurveFileError::byte(bytes.len(), problem).hint("is the file cut short?"));
    };
    if &head[..4] != tag {
        let problem = format!("expected the chunk `{name}`, found `{}`", head[..4].escape_ascii());
        return Err(CurveFileError::byte(at, problem).hint("is this another kind of file?"));
    }
    let length = u32_at(head, 4) as usize;
    if !length.is_multiple_of(size) {
        return Err(CurveFileError::byte(at + 4, format!("`{name}` has {length} bytes, not a multiple of {size}")));
    }
    let data = bytes.get(at + 8..).and_then(|rest| rest.get(..length)).ok_or_else(|| {
        let problem = format!("`{name}` promises {length} bytes, but only {} follow", bytes.len() - at - 8);
        CurveFileError::byte(at + 4, problem).hint("is the file cut short?")
    })?;
    Ok((data, at + 8))
}

/// Places on the quadratic curve of a polygon: the middle of each side, and between two of them the curve's own middle.
pub(super) fn through_middles(polygon: &[DVec3], closed: bool) -> Vec<DVec3> {
    let n = polygon.len();
    let middle = |i: usize| 0.5 * (polygon[i % n] + polygon[(i + 1) % n]);
    let nearest = |i: usize| (polygon[(i + n - 1) % n] + 6.0 * polygon[i % n] + polygon[(i + 1) % n]) / 8.0;
    if closed {
        return (0..n).flat_map(|i| [nearest(i), middle(i)]).collect();
    }
    let inner = (1..n - 1).flat_map(|i| [nearest(i), middle(i)]);
    [polygon[0], middle(0)].into_iter().chain(inner).chain([polygon[n - 1]]).collect()
}

/// The polygon whose quadratic curve goes through `points`, each of which is nearest to a corner.
fn polygon_through(points: &[DVec3], closed: bool) -> Vec<DVec3> {
    let n = points.len();
    let mut polygon = points.to_vec();
    // (a + 6 b + c) / 8 = p: each round leaves less than a ninth of the error.
    for _ in 0..24 {
        let inner = if closed { 0..n } else { 1..n - 1 };
        for i in inner {
            let beside = polygon[(i + n - 1) % n] + polygon[(i + 1) % n];
            polygon[i] = (8.0 * points[i] - beside) / 6.0;
        }
    }
    polygon
}

/// Writes curves as yarns, each of its mean radius and its colour, white if it has none.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`], before anything is written, if a number does not fit an f32 or there are too many
/// points; otherwise whatever `out` reports.
pub fn write_yarns(set: &CurveSet, out: &mut impl Write) -> io::Result<()> {
    let invalid = |problem: &str| io::Error::new(io::ErrorKind::InvalidInput, problem);
    let mut points: Vec<[f32; 3]> = Vec::new();
    let mut yarns: Vec<u8> = Vec::new();
    for (i, curve) in set.curves.iter().enumerate() {
        let begin = points.len();
        let polygon = polygon_of(curve);
        points.extend(polygon.iter().map(|p| p.as_vec3().to_array()));
        let ends = [begin, points.len()].map(u32::try_from);
        let [Ok(begin), Ok(end)] = ends else { return Err(invalid("a .yarns file has at most 357913941 points")) };
        let radius = curve.radii.as_ref().map_or(0.0, |r| r.iter().sum::<f64>() / r.len().max(1) as f64);
        let color = set.colors.get(i).copied().flatten().unwrap_or([1.0; 3]);
        yarns.extend([begin.to_le_bytes(), end.to_le_bytes(), (radius as f32).to_le_bytes()].concat());
        yarns.extend(color.map(|c| (255.0 * linear_to_srgb(c)).round() as u8));
        yarns.push(255);
    }
    if !points.iter().flatten().all(|v| v.is_finite()) {
        return Err(invalid("a coordinate does not fit a 4-byte float"));
    }
    if points.len() > u32::MAX as usize / 12 || yarns.len() > u32::MAX as usize {
        return Err(invalid("a .yarns file has at most 357913941 points"));
    }
    out.write_all(b"f3..")?;
    out.write_all(&(12 * points.len() as u32).to_le_bytes())?;
    for value in points.iter().flatten() {
        out.write_all(&value.to_le_bytes())?;
    }
    out.write_all(b"src.")?;
    out.write_all(&(4 * points.len() as u32).to_le_bytes())?;
    out.write_all(&vec![0; 4 * points.len()])?;
    out.write_all(b"yarn")?;
    out.write_all(&(yarns.len() as u32).to_le_bytes())?;
    out.write_all(&yarns)
}

fn polygon_of(curve: &Curve) -> Vec<DVec3> {
    let (points, n) = (&curve.points, curve.points.len());
    let mut polygon = match curve.basis {
        Basis::Linear => points.clone(),
        Basis::CatmullRom => polygon_through(points, curve.closed),
        Basis::BSpline => {
            let knot = |i: usize| (points[(i + n - 1) % n] + 4.0 * points[i % n] + points[(i + 1) % n]) / 6.0;
            let knots: Vec<DVec3> =
                if curve.closed { (0..n).map(knot).collect() } else { (1..n - 1).map(knot).collect() };
            if knots.len() < 2 { points.clone() } else { polygon_through(&knots, curve.closed) }
        }
    };
    if curve.closed {
        polygon.extend(polygon.first().copied());
    }
    polygon
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

fn f32_at(bytes: &[u8], at: usize) -> f32 {
    f32::from_bits(u32_at(bytes, at))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::chain::Chain;

    fn file(yarns: &[(u32, u32, f32, [u8; 4])], points: &[[f32; 3]]) -> Vec<u8> {
        let mut bytes = b"f3..".to_vec();
        bytes.extend((12 * points.len() as u32).to_le_bytes());
        bytes.extend(points.iter().flatten().flat_map(|v| v.to_le_bytes()));
        bytes.extend(b"src.");
        bytes.extend((4 * points.len() as u32).to_le_bytes());
        bytes.extend(vec![0; 4 * points.len()]);
        bytes.extend(b"yarn");
        bytes.extend((16 * yarns.len() as u32).to_le_bytes());
        for (begin, end, radius, color) in yarns {
            bytes.extend([begin.to_le_bytes(), end.to_le_bytes(), radius.to_le_bytes(), *color].concat());
        }
        bytes
    }

    const CORNERS: [[f32; 3]; 6] =
        [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0], [4.0, 2.0, 1.0], [5.0, 0.0, 0.0], [5.0, 3.0, 0.0]];

    #[test]
    fn yarns_are_smooth_through_the_middles_of_their_sides() {
        let bytes = file(&[(0, 4, 0.25, [255, 0, 188, 255]), (4, 6, 0.0, [0; 4])], &CORNERS);
        let set = parse(&bytes, &ReadOptions::default()).unwrap();
        let points = &set.curves[0].points;
        assert_eq!((set.curves[0].basis, points.len(), set.curves.len()), (Basis::CatmullRom, 7, 2));
        assert_eq!([points[0], points[1], points[3]], [DVec3::ZERO, DVec3::X, DVec3::new(2.0, 1.0, 0.0)]);
        assert_eq!(points[2], DVec3::new(1.75, 0.25, 0.0));
        assert_eq!((set.curves[0].radii.as_ref().unwrap()[6], set.curves[1].radii.is_none()), (0.25, true));
        let [r, g, b] = set.colors[0].unwrap();
        assert!(r == 1.0 && g == 0.0 && (b - 0.5029).abs() < 1e-3, "{b}");
        let plain = parse(&bytes, &ReadOptions { basis: Some(Basis::Linear), ..ReadOptions::default() }).unwrap();
        assert_eq!(plain.curves[0].points.len(), 4);
    }

    #[test]
    fn curves_come_back_where_they_were() {
        let around = |i: u32| f64::from(i) / 24.0 * std::f64::consts::TAU;
        let points: Vec<DVec3> = (0..24).map(|i| DVec3::new(around(i).cos(), around(i).sin(), 0.1)).collect();
        for basis in [Basis::CatmullRom, Basis::BSpline] {
            for closed in [false, true] {
                let curve = Curve { basis, closed, points: points.clone(), radii: None, flattening: None };
                let set = CurveSet {
                    curves: vec![curve.clone()],
                    colors: vec![Some([0.2, 0.4, 0.6])],
                    ..CurveSet::default()
                };
                let mut bytes = Vec::new();
                write_yarns(&set, &mut bytes).unwrap();
                let again = parse(&bytes, &ReadOptions::default()).unwrap();
                let found = &again.curves[0];
                assert_eq!(found.closed, closed);
                assert!(again.colors[0].unwrap().iter().zip([0.2, 0.4, 0.6]).all(|(a, b)| (a - b).abs() < 0.01));
                // Every place of the one is near the other: the circle, but for the ends.
                let radius = if basis == Basis::BSpline { (4.0 + 2.0 * around(1).cos()) / 6.0 } else { 1.0 };
                let chain = Chain::new(found, &vec![0.0; found.points.len()]);
                for i in 2..chain.segments() - 2 {
                    let at = chain.at(i, 0.3).at.truncate();
                    let off = at.truncate().length() - radius;
                    assert!(off.abs() < 2e-3, "{basis:?} {closed}: {off}");
                }
            }
        }
    }

    #[test]
    fn damage_is_told_with_its_byte() {
        let wrong = |bytes: &[u8]| parse(bytes, &ReadOptions::default()).unwrap_err().to_string();
        let good = file(&[(0, 6, 0.1, [0; 4])], &CORNERS);
        assert!(wrong(b"f3..").contains("the file ends here"));
        assert!(wrong(&good[..40]).contains("byte 4: `f3..` promises 72 bytes, but only 32 follow"));
        assert!(wrong(b"abcdabcd").contains("expected the chunk `f3..`, found `abcd`"));
        assert!(wrong(&file(&[(0, 7, 0.1, [0; 4])], &CORNERS)).contains("yarn 0 has points 0 to 7, of 6"));
        assert!(wrong(&file(&[(0, 6, -1.0, [0; 4])], &CORNERS)).contains("expected a radius of at least 0"));
        let mut nan = CORNERS;
        nan[3][1] = f32::NAN;
        assert!(wrong(&file(&[(0, 6, 0.1, [0; 4])], &nan)).contains("byte 48: expected a finite number for y"));
        // However it is cut or changed, there is an answer.
        for end in 0..good.len() {
            let _ = parse(&good[..end], &ReadOptions::default());
            let mut changed = good.clone();
            changed[end] ^= 0xff;
            let _ = parse(&changed, &ReadOptions::default());
        }
    }
}
