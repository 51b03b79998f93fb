//! `.sf`, the face library of stitch meshes (textiles-lab/smobj): flat polygons with the yarns inside them.
//!
//! ```text
//! face knit+
//!     edge (-1,-0.6) -l1                 where an edge begins, counter-clockwise, and what crosses it
//!     yarn [3:0.5,0] (0,0,0.1) [2:0.7,0]   from edge:share,height over points to an edge
//! derive knit- -l1 -y1 +l1 +y1 by mirror-x from knit+ -l1 +y1 +l1 -y1
//! ```
//! A face is known by its name with the labels of its edges.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::{CurveFileError, Line, lines, quoted};

/// The most edges of a face.
const MOST_EDGES: usize = 64;

/// Where a yarn crosses the border of a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    pub(super) edge: usize,
    /// From the beginning of the edge, 0 to 1.
    pub(super) share: f64,
    pub(super) height: f64,
}

/// A yarn inside of a face.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FaceYarn {
    pub(super) ends: [Crossing; 2],
    /// Between the ends.
    pub(super) points: Vec<DVec3>,
}

/// A face of the library.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Face {
    pub(super) corners: Vec<DVec2>,
    labels: Vec<String>,
    pub(super) yarns: Vec<FaceYarn>,
}

impl Face {
    /// Mirrored left to right: edges run the other way round, from the last of the first edges that are alike, or from
    /// whichever makes the labels those that are asked for.
    fn mirrored(&self, labels: &[&str], turned: bool) -> Option<Self> {
        let n = self.corners.len();
        let swapped = |label: &str| if turned { swap_yarn(label) } else { label.to_owned() };
        let chain = self.labels.iter().take_while(|l| **l == self.labels[0]).count() - 1;
        let fits = |&first: &usize| (0..n).all(|j| swapped(&self.labels[(first + n - j) % n]) == labels[j]);
        let first = [chain].into_iter().chain(0..n).find(fits)?;
        let old = |j: usize| (first + n - j) % n;
        let new = |edge: usize| (first + n - edge) % n;
        let crossing = |c: &Crossing| Crossing { edge: new(c.edge), share: 1.0 - c.share, ..*c };
        let mirror = |p: &DVec3| DVec3::new(-p.x, p.y, p.z);
        Some(Self {
            corners: (0..n).map(|j| self.corners[(old(j) + 1) % n] * DVec2::new(-1.0, 1.0)).collect(),
            labels: (0..n).map(|j| self.labels[old(j)].clone()).collect(),
            yarns: self
                .yarns
                .iter()
                .map(|y| FaceYarn {
                    ends: [crossing(&y.ends[0]), crossing(&y.ends[1])],
                    points: y.points.iter().map(mirror).collect(),
                })
                .collect(),
        })
    }

    fn key(name: &str, labels: &[String]) -> String {
        std::iter::once(name).chain(labels.iter().map(String::as_str)).collect::<Vec<_>>().join(" ")
    }
}

/// `+y1` for `-y1` and the other way round; other labels as they are.
fn swap_yarn(label: &str) -> String {
    match label.split_at_checked(1) {
        Some(("+", rest)) if rest.starts_with('y') => format!("-{rest}"),
        Some(("-", rest)) if rest.starts_with('y') => format!("+{rest}"),
        _ => label.to_owned(),
    }
}

/// Faces by key.
pub(super) type Library = HashMap<String, Face>;

/// Reads a library.
pub(super) fn parse(bytes: &[u8]) -> Result<Library, CurveFileError> {
    let mut library = Library::new();
    let mut open: Option<(String, Face, u64)> = None;
    let mut to_derive: Vec<(u64, String)> = Vec::new();
    for Line { number, content, .. } in lines(bytes) {
        let (word, rest) = content.split_once(char::is_whitespace).unwrap_or((&content, ""));
        let wrong =
            |expected: &str| CurveFileError::line(number, format!("expected {expected}, found {}", quoted(&content)));
        match (word, &mut open) {
            ("", _) => {}
            ("face", _) => {
                close(&mut library, open.take())?;
                open = Some((rest.trim().to_owned(), Face::default(), number));
            }
            ("edge", Some((_, face, _))) => {
                let (place, label) = rest.trim().split_once(')').ok_or_else(|| wrong("edge (x,y) label"))?;
                let numbers = list(place.trim_start_matches('(')).ok_or_else(|| wrong("edge (x,y) label"))?;
                let &[x, y] = numbers.as_slice() else { return Err(wrong("edge (x,y) label")) };
                if face.corners.len() == MOST_EDGES {
                    return Err(CurveFileError::line(number, format!("a face has at most {MOST_EDGES} edges")));
                }
                face.corners.push(DVec2::new(x, y));
                face.labels.push(label.trim().to_owned());
            }
            ("yarn", Some((_, face, _))) => {
                let yarn = yarn(rest, face.corners.len());
                face.yarns.push(yarn.ok_or_else(|| wrong("yarn [edge:share,z] (x,y,z) ... [edge:share,z]"))?);
            }
            ("derive", _) => {
                close(&mut library, open.take())?;
                to_derive.push((number, rest.to_owned()));
            }
            _ => return Err(wrong("a line that begins with face, edge, yarn or derive")),
        }
    }
    close(&mut library, open)?;
    // A line may name a face that a later one makes.
    while !to_derive.is_empty() {
        let before = to_derive.len();
        let mut wrong = None;
        to_derive.retain(|(number, rest)| match derived(rest, &library) {
            Ok((key, face)) => {
                library.insert(key, face);
                false
            }
            Err(problem) => {
                wrong.get_or_insert(CurveFileError::line(*number, problem));
                true
            }
        });
        if let Some(error) = wrong.filter(|_| to_derive.len() == before) {
            return Err(error);
        }
    }
    Ok(library)
}

fn close(library: &mut Library, open: Option<(String, Face, u64)>) -> Result<(), CurveFileError> {
    if let Some((name, face, line)) = open {
        if face.corners.len() < 3 {
            let problem = format!("face {} has {} edges; at least 3 are expected", quoted(&name), face.corners.len());
            return Err(CurveFileError::line(line, problem));
        }
        library.insert(Face::key(&name, &face.labels), face);
    }
    Ok(())
}

fn list(text: &str) -> Option<Vec<f64>> {
    text.split(',').map(|n| n.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect()
}

/// `[e:share,z] (x,y,z) ... [e:share,z]`.
fn yarn(text: &str, edges: usize) -> Option<FaceYarn> {
    let mut ends = Vec::new();
    let mut points = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        let close = if rest.starts_with('[') { ']' } else { ')' };
        let (inside, after) = rest.get(1..)?.split_once(close)?;
        if close == ']' {
            let (edge, place) = inside.split_once(':')?;
            let edge = edge.trim().parse().ok().filter(|e| *e < edges)?;
            let &[share, height] = list(place)?.as_slice() else { return None };
            ends.push(Crossing { edge, share: Some(share).filter(|s| (0.0..=1.0).contains(s))?, height });
        } else {
            let &[x, y, z] = list(inside)?.as_slice() else { return None };
            (rest.starts_with('(') && ends.len() == 1).then_some(())?;
            points.push(DVec3::new(x, y, z));
        }
        rest = after.trim_start();
    }
    let ends = <[Crossing; 2]>::try_from(ends).ok()?;
    Some(FaceYarn { ends, points })
}

/// `KEY by OPERATION ... from KEY`.
fn derived(text: &str, library: &Library) -> Result<(String, Face), String> {
    let parts = text.split_once(" by ").and_then(|(key, rest)| Some((key, rest.split_once(" from ")?)));
    let (key, (operations, from)) = parts.ok_or("expected derive FACE by OPERATIONS from FACE")?;
    let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let (key, from) = (words(key), words(from).join(" "));
    let source = library.get(&from).ok_or_else(|| format!("there is no face {}", quoted(&from)))?;
    let operations = words(operations);
    if let Some(other) = operations.iter().find(|o| !["mirror-x", "mirror-z", "reverse-yarn"].contains(&o.as_str())) {
        return Err(format!("unknown operation {}; mirror-x, mirror-z and reverse-yarn are known", quoted(other)));
    }
    let does = |name: &str| operations.iter().any(|o| o == name);
    let labels: Vec<&str> = key.iter().skip(1).map(String::as_str).collect();
    let other = || format!("the labels of {} are not those that it gets", quoted(&key.join(" ")));
    if labels.len() != source.corners.len() {
        return Err(other());
    }
    let mut face = match does("mirror-x") {
        true => source.mirrored(&labels, does("reverse-yarn")).ok_or_else(other)?,
        false => source.clone(),
    };
    if does("reverse-yarn") {
        face.labels.iter_mut().for_each(|l| *l = swap_yarn(l));
        for yarn in &mut face.yarns {
            yarn.ends.reverse();
            yarn.points.reverse();
        }
    }
    if does("mirror-z") {
        for yarn in &mut face.yarns {
            yarn.ends.iter_mut().for_each(|e| e.height = -e.height);
            yarn.points.iter_mut().for_each(|p| p.z = -p.z);
        }
    }
    if face.labels.iter().zip(&labels).any(|(a, b)| a != b) {
        return Err(other());
    }
    Ok((key.join(" "), face))
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNIT: &str = "face knit+ # to the right\n\tedge (-1,-0.6) -l1\n\tedge (1,-0.6) +y1\n\tedge (1,0.6) +l1\n\tedge (-1,0.6) -y1\n\
                        \tyarn [3:0.4,0] (-0.5,0,0.1) [2:0.7,0.2]\n";

    #[test]
    fn faces_are_mirrored_and_reversed() {
        let text = format!(
            "derive again -l1 +y1 +l1 -y1 by mirror-x from knit- -l1 -y1 +l1 +y1\n\
             {KNIT}derive knit- -l1 -y1 +l1 +y1 by mirror-x from knit+ -l1 +y1 +l1 -y1\n\
             derive purl+ -l1 -y1 +l1 +y1 by mirror-z reverse-yarn from knit+ -l1 +y1 +l1 -y1\n"
        );
        let library = parse(text.as_bytes()).unwrap();
        let left = &library["knit- -l1 -y1 +l1 +y1"];
        assert_eq!(left.corners, library["knit+ -l1 +y1 +l1 -y1"].corners);
        let crossing = |edge, share, height| Crossing { edge, share, height };
        assert_eq!(left.yarns[0].ends, [crossing(1, 0.6, 0.0), crossing(2, 1.0 - 0.7, 0.2)]);
        assert_eq!(left.yarns[0].points, [DVec3::new(0.5, 0.0, 0.1)]);
        // Twice mirrored is the same, made of a face that comes later.
        assert_eq!(library["again -l1 +y1 +l1 -y1"].corners, left.corners);
        let purl = &library["purl+ -l1 -y1 +l1 +y1"].yarns[0];
        assert_eq!((purl.ends[0].edge, purl.ends[0].height, purl.points[0].z), (2, -0.2, -0.1));
    }

    #[test]
    fn two_loops_below_change_places() {
        let text = "face two\nedge (-1,0) -l1\nedge (0,-1) -l1\nedge (1,0) +y1\nedge (1,1) +l1\nedge (-1,1) -y1\n\
                    yarn [0:0.25,0] [3:0.5,0]\nderive owt -l1 -l1 -y1 +l1 +y1 by mirror-x from two -l1 -l1 +y1 +l1 -y1\n";
        let library = parse(text.as_bytes()).unwrap();
        let mirrored = &library["owt -l1 -l1 -y1 +l1 +y1"];
        assert_eq!(mirrored.corners[0], DVec2::new(-1.0, 0.0));
        assert_eq!(mirrored.yarns[0].ends[0], Crossing { edge: 1, share: 0.75, height: 0.0 });
    }

    #[test]
    fn mistakes_have_their_line() {
        let wrong = |more: &str| parse(format!("{KNIT}{more}").as_bytes()).unwrap_err().to_string();
        assert!(wrong("yarn [4:0.5,0] [0:0.5,0]\n").starts_with("line 7: expected yarn [edge:share,z]"));
        assert!(wrong("edge 1 2 x\n").contains("line 7: expected edge (x,y) label"));
        assert!(wrong("derive a x by mirror-x from b x\n").contains("no face \"b x\""));
        assert!(wrong("derive a -l1 +y1 +l1 -y1 by twist from knit+ -l1 +y1 +l1 -y1\n").contains("unknown operation"));
        assert!(wrong("derive a x x x x by mirror-x from knit+ -l1 +y1 +l1 -y1\n").contains("not those that it gets"));
        assert!(wrong("nonsense\n").contains("line 7: expected a line that begins with face"));
        assert!(parse(b"face a\nedge (0,0) x\n").unwrap_err().to_string().contains("has 1 edges"));
    }
}
