//! Plain text curves: `x y z [radius]` on each line, a blank line between curves, `#` begins a comment.
//!
//! A line with only a comment does not separate curves. Either all lines of a file have a radius or none has. A curve
//! whose last line repeats its first is closed.

use std::io::{self, Write};

use arrayvec::ArrayVec;
use glam::DVec3;

use super::repair::{Ends, Repair};
use super::{CurveFileError, FileLocation, ReadOptions, lines, number, quoted};
use crate::geometry::curve::{Basis, CurveSet};

/// A triangle and its first point again: the shortest loop that can be told from a line walked back and forth.
const SHORTEST_LOOP: usize = 4;

pub(super) fn parse(bytes: &[u8], options: &ReadOptions) -> Result<CurveSet, CurveFileError> {
    let basis = options.basis.unwrap_or(Basis::CatmullRom);
    let mut repair = Repair::default();
    let mut curve = OpenCurve::default();
    let mut layout = None;
    let mut total = 0_u64;
    for line in lines(bytes) {
        if line.blank {
            std::mem::take(&mut curve).finish(basis, &mut repair)?;
            continue;
        }
        if line.content.is_empty() {
            continue;
        }
        let (point, radius) = parse_point(&line.content, line.number)?;
        let (first_line, has_radius) = *layout.get_or_insert((line.number, radius.is_some()));
        if has_radius != radius.is_some() {
            let (here, there) = if has_radius { ("no radius", "one") } else { ("a radius", "none") };
            let problem = format!("found {here} here but {there} in line {first_line}");
            return Err(CurveFileError::line(line.number, problem).hint("give every line a radius, or none"));
        }
        total += 1;
        if total > options.max_points {
            return Err(CurveFileError::too_many_points(FileLocation::Line(line.number), total, options));
        }
        curve.points.push(point);
        curve.radii.extend(radius);
        curve.last_line = line.number;
    }
    curve.finish(basis, &mut repair)?;
    Ok(repair.finish())
}

fn parse_point(content: &str, line: u64) -> Result<(DVec3, Option<f64>), CurveFileError> {
    // One more than allowed is enough to know.
    let tokens: ArrayVec<&str, 5> = content.split_whitespace().take(5).collect();
    if !matches!(tokens.len(), 3 | 4) {
        let problem = format!("expected \"x y z\" or \"x y z radius\", found {}", quoted(content));
        return Err(CurveFileError::line(line, problem).hint("numbers are separated by spaces"));
    }
    let point = DVec3::new(number(tokens[0], "x", line)?, number(tokens[1], "y", line)?, number(tokens[2], "z", line)?);
    let Some(token) = tokens.get(3) else { return Ok((point, None)) };
    let radius = number(token, "the radius", line)?;
    if radius < 0.0 {
        return Err(CurveFileError::line(line, format!("expected a radius of 0 or more, found {}", quoted(token))));
    }
    Ok((point, Some(radius)))
}

/// The curve whose lines are being read.
#[derive(Default)]
struct OpenCurve {
    points: Vec<DVec3>,
    radii: Vec<f64>,
    last_line: u64,
}

impl OpenCurve {
    fn finish(mut self, basis: Basis, repair: &mut Repair) -> Result<(), CurveFileError> {
        match self.points.len() {
            0 => return Ok(()),
            1 => {
                return Err(CurveFileError::line(self.last_line, "expected a curve of two points or more, found one")
                    .hint("is there a blank line too many?"));
            }
            _ => {}
        }
        let mut ends = Ends::Open;
        let returns = self.points.first() == self.points.last() && self.radii.first() == self.radii.last();
        if returns && self.points.len() >= SHORTEST_LOOP {
            ends = Ends::Closed;
            self.points.pop();
            self.radii.pop();
        }
        let radii = (!self.radii.is_empty()).then_some(self.radii);
        repair.add(basis, ends, self.points, radii);
        Ok(())
    }
}

/// Writes curves as text, every number with as many digits as reading it back exactly takes.
///
/// The format has no place for the basis, the unit of length and the direction of up: they are left out. A closed
/// curve ends with its first line again, so an open curve that ends where it began is read back as closed. There is no
/// comment that says what the columns are: Mitsuba refuses files with comments.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`], before anything is written, if only some curves have radii or a curve has not one
/// radius for each point; otherwise whatever `out` reports.
pub fn write_text(set: &CurveSet, out: &mut impl Write) -> io::Result<()> {
    let invalid = |problem: &str| io::Error::new(io::ErrorKind::InvalidInput, problem);
    let has_radii = set.curves.first().is_some_and(|curve| curve.radii.is_some());
    for curve in &set.curves {
        if curve.radii.is_some() != has_radii {
            return Err(invalid("a text file has radii for all curves or for none"));
        }
        if curve.radii.as_ref().is_some_and(|radii| radii.len() != curve.points.len()) {
            return Err(invalid("a curve needs one radius for each point"));
        }
    }
    for (index, curve) in set.curves.iter().enumerate() {
        if index > 0 {
            writeln!(out)?;
        }
        let repeat = curve.closed.then_some(0);
        for at in (0..curve.points.len()).chain(repeat) {
            let DVec3 { x, y, z } = curve.points[at];
            // Debug format, because Display spells 1e300 with 300 zeros.
            match &curve.radii {
                Some(radii) => writeln!(out, "{x:?} {y:?} {z:?} {:?}", radii[at])?,
                None => writeln!(out, "{x:?} {y:?} {z:?}")?,
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::curve::Curve;

    fn parsed(text: &str) -> CurveSet {
        parse(text.as_bytes(), &ReadOptions::default()).expect("a readable file")
    }

    fn message(text: &str) -> String {
        parse(text.as_bytes(), &ReadOptions::default()).expect_err("a broken file").to_string()
    }

    #[test]
    fn blank_lines_separate_curves_and_comments_do_not() {
        let set =
            parsed("\u{feff}# two curves\r\n\r\n0 0 0 # start\r\n# still the first\r\n1 0 0\n \t\n\n1 2 3\n+4 5. -6e0");
        let curve = |points: &[[f64; 3]]| Curve {
            basis: Basis::CatmullRom,
            closed: false,
            points: points.iter().map(|&point| point.into()).collect(),
            radii: None,
            flattening: None,
        };
        assert_eq!(
            set,
            CurveSet {
                curves: vec![curve(&[[0.0; 3], [1.0, 0.0, 0.0]]), curve(&[[1.0, 2.0, 3.0], [4.0, 5.0, -6.0]])],
                ..CurveSet::default()
            }
        );
    }

    #[test]
    fn radii_and_the_basis_are_taken_over() {
        let options = ReadOptions { basis: Some(Basis::BSpline), ..ReadOptions::default() };
        let set = parse(b"0 0 0 0.5\n0 0 0 0.5\n1 0 0 0\n", &options).expect("a readable file");
        assert_eq!(set.curves[0].basis, Basis::BSpline);
        assert_eq!(set.curves[0].radii.as_deref(), Some(&[0.5, 0.5, 0.0][..]));
    }

    #[test]
    fn a_repeated_first_line_closes_a_curve() {
        let set = parsed("0 0 0 1\n1 0 0 1\n0 1 0 1\n0 0 0 1\n");
        assert!(set.curves[0].closed);
        assert_eq!((set.curves[0].points.len(), set.curves[0].radii.as_ref().map(Vec::len)), (3, Some(3)));
        assert!(set.notes.is_empty());
        assert!(!parsed("0 0 0 1\n1 0 0 1\n0 1 0 1\n0 0 0 2\n").curves[0].closed);
        assert!(!parsed("0 0 0\n1 0 0\n0 0 0\n").curves[0].closed);
    }

    #[test]
    fn mistakes_are_explained() {
        for (text, expected) in [
            (
                "0 0 0\n1 0\n",
                "line 2: expected \"x y z\" or \"x y z radius\", found \"1 0\"; numbers are separated by spaces",
            ),
            (
                "1,0,0\n",
                "line 1: expected \"x y z\" or \"x y z radius\", found \"1,0,0\"; numbers are separated by spaces",
            ),
            (
                "1 2 3 4 5 6\n",
                "line 1: expected \"x y z\" or \"x y z radius\", found \"1 2 3 4 5 6\"; numbers are separated by spaces",
            ),
            ("0 0 0\n0 zero 0\n", "line 2: expected a finite number for y, found \"zero\""),
            ("0 0 0\n0 0 inf\n", "line 2: expected a finite number for z, found \"inf\""),
            ("0 0 0 nan\n", "line 1: expected a finite number for the radius, found \"nan\""),
            ("0 0 0 -1\n", "line 1: expected a radius of 0 or more, found \"-1\""),
            ("0 0 0 1\n1 0 0\n", "line 2: found no radius here but one in line 1; give every line a radius, or none"),
            (
                "0 0 0\n1 0 0\n\n1 1 1 1\n",
                "line 4: found a radius here but none in line 1; give every line a radius, or none",
            ),
            (
                "0 0 0\n1 0 0\n\n1 1 1\n\n",
                "line 4: expected a curve of two points or more, found one; is there a blank line too many?",
            ),
        ] {
            assert_eq!(message(text), expected);
        }
        let error = parse(b"0 0 \xff\x07\n", &ReadOptions::default()).expect_err("not a number");
        assert_eq!(error.to_string(), "line 1: expected a finite number for z, found \"\u{fffd}\\u{7}\"");
        let long = format!("{} 0 0\n", "x".repeat(1000));
        assert_eq!(message(&long), format!("line 1: expected a finite number for x, found \"{}...\"", "x".repeat(40)));
    }

    #[test]
    fn the_number_of_points_is_limited() {
        let options = ReadOptions { max_points: 2, ..ReadOptions::default() };
        let error = parse(b"0 0 0\n1 0 0\n2 0 0\n", &options).expect_err("one point too many");
        assert_eq!(error.to_string(), "line 3: 3 points are more than the 2 allowed");
    }

    #[test]
    fn what_is_written_is_read_back_exactly() {
        let points =
            vec![DVec3::new(0.1, 1e300, -1e-300), DVec3::new(f64::from(0.1_f32), f64::MIN, 5e-324), DVec3::X, DVec3::Y];
        let curve =
            |closed, radii| Curve { basis: Basis::CatmullRom, closed, points: points.clone(), radii, flattening: None };
        let radii = Some(vec![0.1, 0.2, 0.0, 1.0 / 3.0]);
        for radii in [None, radii] {
            let set = CurveSet { curves: vec![curve(true, radii.clone()), curve(false, radii)], ..CurveSet::default() };
            let mut bytes = Vec::new();
            write_text(&set, &mut bytes).expect("a vector takes everything");
            assert!(!bytes.contains(&b'#'), "Mitsuba refuses comments");
            assert_eq!(parse(&bytes, &ReadOptions::default()).expect("a readable file"), set);
        }
    }

    #[test]
    fn mixed_radii_are_not_written() {
        let curve = |radii| Curve {
            basis: Basis::Linear,
            closed: false,
            points: vec![DVec3::X, DVec3::Y],
            radii,
            flattening: None,
        };
        for (curves, expected) in [
            (vec![curve(None), curve(Some(vec![1.0, 1.0]))], "a text file has radii for all curves or for none"),
            (vec![curve(Some(vec![1.0]))], "a curve needs one radius for each point"),
        ] {
            let mut bytes = Vec::new();
            let error =
                write_text(&CurveSet { curves, ..CurveSet::default() }, &mut bytes).expect_err("cannot be said");
            assert_eq!((error.to_string().as_str(), bytes.len()), (expected, 0));
        }
    }
}
