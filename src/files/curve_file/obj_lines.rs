//! Curves as the line elements of Wavefront OBJ: `v x y z` and `l i j k ...`, as modelling programs export them.
//!
//! Faces, normals and all else are passed over. Lines that begin where the line before ended go on with it, because some
//! programs write every edge as a line of its own; one that comes back to its first vertex is closed. OBJ has neither
//! radii nor a basis: points are taken as Catmull-Rom curves unless asked otherwise.

use std::io::{self, Write};

use glam::DVec3;

use super::repair::{Ends, Repair};
use super::{CurveFileError, FileLocation, ReadOptions, number, quoted};
use crate::{
    files::obj_text::ObjLines,
    geometry::curve::{Basis, CurveSet},
};

pub(super) fn parse(bytes: &[u8], options: &ReadOptions) -> Result<CurveSet, CurveFileError> {
    let basis = options.basis.unwrap_or(Basis::CatmullRom);
    let mut vertices: Vec<DVec3> = Vec::new();
    let mut repair = Repair::default();
    let mut chain: Vec<usize> = Vec::new();
    let mut total = 0_u64;
    let finish = |chain: &mut Vec<usize>, vertices: &[DVec3], repair: &mut Repair| {
        if chain.is_empty() {
            return;
        }
        let ring = chain.len() >= 4 && chain.first() == chain.last();
        if ring {
            chain.pop();
        }
        let points = chain.drain(..).map(|i| vertices[i]).collect();
        repair.add(basis, if ring { Ends::Closed } else { Ends::Open }, points, None);
    };
    // Bytes in memory are always there.
    for line in ObjLines::new(bytes).map_while(Result::ok) {
        let at = line.number as u64;
        let mut tokens = line.text.split('#').next().unwrap_or_default().split_whitespace();
        match tokens.next() {
            Some("v") => {
                let mut coordinate = |name| match tokens.next() {
                    Some(token) => number(token, name, at),
                    None => {
                        let problem = format!("expected \"v x y z\", found {}", quoted(&line.text));
                        Err(CurveFileError::line(at, problem))
                    }
                };
                vertices.push(DVec3::new(coordinate("x")?, coordinate("y")?, coordinate("z")?));
            }
            Some("l") => {
                for (i, token) in tokens.enumerate() {
                    let index = vertex(token, vertices.len(), at)?;
                    if i == 0 {
                        let closed = chain.len() >= 4 && chain.first() == chain.last();
                        if chain.last() == Some(&index) && !closed {
                            continue;
                        }
                        finish(&mut chain, &vertices, &mut repair);
                    }
                    chain.push(index);
                    total += 1;
                    if total > options.max_points {
                        return Err(CurveFileError::too_many_points(FileLocation::Line(at), total, options));
                    }
                }
            }
            _ => {
                if let Some(problem) = line.damage() {
                    return Err(CurveFileError::line(at, problem));
                }
            }
        }
    }
    finish(&mut chain, &vertices, &mut repair);
    Ok(repair.finish())
}

/// A vertex by its number: from 1, or from -1 backwards. A texture coordinate after a slash is passed over.
fn vertex(token: &str, known: usize, line: u64) -> Result<usize, CurveFileError> {
    let text = token.split('/').next().unwrap_or_default();
    let index = text.parse::<i64>().ok().and_then(|i| match i {
        1.. => usize::try_from(i - 1).ok(),
        0 => None,
        _ => known.checked_sub(usize::try_from(i.unsigned_abs()).ok()?),
    });
    index.filter(|&i| i < known).ok_or_else(|| {
        let problem = format!("expected one of the {known} vertices above, found {}", quoted(token));
        CurveFileError::line(line, problem).hint("vertices count from 1, or backwards from -1")
    })
}

/// Writes curves as OBJ lines; radii and basis are lost.
///
/// # Errors
/// Whatever `out` reports.
pub fn write_obj_lines(set: &CurveSet, out: &mut impl Write) -> io::Result<()> {
    let mut first = 1_u64;
    for curve in &set.curves {
        for DVec3 { x, y, z } in &curve.points {
            writeln!(out, "v {x:?} {y:?} {z:?}")?;
        }
        write!(out, "l")?;
        for i in 0..curve.points.len() as u64 {
            write!(out, " {}", first + i)?;
        }
        if curve.closed {
            write!(out, " {first}")?;
        }
        writeln!(out)?;
        first += curve.points.len() as u64;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::curve::Curve;

    fn read(text: &str) -> CurveSet {
        parse(text.as_bytes(), &ReadOptions::default()).unwrap()
    }

    #[test]
    fn lines_are_those_of_all_obj_files() {
        for text in ["\u{feff}v 0 0 0\rv 1 0 0\rv 2 1 0\rl 1 2 3", "v 0 0 0\nv 1 0 0\nv 2 1 0\nl 1 \\\n2 3\n"] {
            assert_eq!(read(text).curves[0].points.len(), 3, "{text:?}");
        }
        let damaged = parse(b"v 0 0 0\nvv 1 0 0\n", &ReadOptions::default()).unwrap_err();
        assert_eq!(damaged.location, FileLocation::Line(2));
    }

    #[test]
    fn what_is_written_is_read() {
        let curve = |n: u32, closed| Curve {
            basis: Basis::CatmullRom,
            closed,
            points: (0..n).map(|i| DVec3::new(f64::from(i), 0.1 * f64::from(i * i), f64::from(n))).collect(),
            radii: None,
            flattening: None,
        };
        let set = CurveSet { curves: vec![curve(2, false), curve(4, true), curve(3, false)], ..CurveSet::default() };
        let mut bytes = Vec::new();
        write_obj_lines(&set, &mut bytes).unwrap();
        assert_eq!(parse(&bytes, &ReadOptions::default()).unwrap(), set);
    }

    #[test]
    fn edges_one_by_one_become_a_curve() {
        let text = "o yarn\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 5 5 5\nvn 0 0 1\nl 1 2\nl 2 3/7\nl -1 -2\nf 1 2 3\n";
        let curves: Vec<usize> = read(text).curves.iter().map(|c| c.points.len()).collect();
        assert_eq!(curves, [3, 2]);
    }

    #[test]
    fn mistakes_are_explained() {
        for (text, message) in [
            ("v 1 2\n", "line 1: expected \"v x y z\", found \"v 1 2\""),
            ("v 1 2 x\n", "line 1: expected a finite number for z, found \"x\""),
            (
                "v 1 2 3\nl 1 2\n",
                "line 2: expected one of the 1 vertices above, found \"2\"; vertices count from 1, or backwards from -1",
            ),
            (
                "l 0\n",
                "line 1: expected one of the 0 vertices above, found \"0\"; vertices count from 1, or backwards from -1",
            ),
        ] {
            assert_eq!(parse(text.as_bytes(), &ReadOptions::default()).unwrap_err().to_string(), message);
        }
        let few = ReadOptions { max_points: 1, ..ReadOptions::default() };
        let error = parse(b"v 0 0 0\nv 1 0 0\nl 1 2\n", &few).unwrap_err();
        assert_eq!(error.to_string(), "line 3: 2 points are more than the 1 allowed");
    }
}
