//! `.smobj`, augmented stitch meshes (textiles-lab/smobj): polygons, each of a face of a library ([`super::faces`]), and
//! which edges of theirs are one.
//!
//! The flat yarns of a face are bent into its polygon by mean value coordinates (Floater 2003); heights go along the
//! polygon's normal, as much larger as the polygon is. Where yarns cross an edge that two polygons share they are one yarn,
//! whatever its faces make: tubes, increases, decreases, short rows. Points are taken as in [`super::yarns`].

use glam::{DVec2, DVec3};

use super::{
    CurveFileError, FileLocation, Line, ReadOptions,
    faces::{Crossing, Face, Library},
    lines, number, quoted,
    yarns::through_middles,
};
use crate::{
    geometry::curve::{Basis, Curve, CurveSet},
    math::words::counted,
};

/// A polygon of the mesh.
struct Polygon<'a> {
    corners: Vec<u32>,
    face: Option<&'a Face>,
    line: u64,
}

/// A piece of yarn in a polygon, and what its two ends are joined to: piece and end.
struct Piece {
    points: Vec<DVec3>,
    crossings: [Crossing; 2],
    joined: [Option<(usize, usize)>; 2],
}

/// Two edges that are one, each by its polygon and its place there.
struct Joint {
    edges: [[usize; 2]; 2],
    /// Whether they run against each other.
    turned: bool,
    line: u64,
}

/// Reads a mesh.
pub(super) fn parse(bytes: &[u8], library: &Library, options: &ReadOptions) -> Result<CurveSet, CurveFileError> {
    let mesh = Mesh::parse(bytes, library, options)?;
    let (mut pieces, first) = mesh.pieces()?;
    let loose = join(&mut pieces, &first, &mesh.joints)?;
    let mut set = CurveSet::default();
    if loose > 0 {
        set.notes.push(format!("{} of edges that are one lie in one of both only", counted(loose, "yarn")));
    }
    for (i, (polygon, closed)) in trace(&mut pieces).into_iter().enumerate() {
        let (basis, points) = match options.basis {
            Some(basis) => (basis, polygon),
            None => (Basis::CatmullRom, through_middles(&polygon, closed)),
        };
        set.curves.push(Curve { basis, closed, points, radii: None, flattening: None });
        set.ids.push(Some(i as i64));
    }
    Ok(set)
}

/// A mesh as its lines say it.
#[derive(Default)]
struct Mesh<'a> {
    /// The types of its faces: names, and what the library has by them.
    kinds: Vec<(String, Option<&'a Face>)>,
    corners: Vec<DVec3>,
    polygons: Vec<Polygon<'a>>,
    joints: Vec<Joint>,
}

impl<'a> Mesh<'a> {
    fn parse(bytes: &[u8], library: &'a Library, options: &ReadOptions) -> Result<Self, CurveFileError> {
        let mut mesh = Self::default();
        let mut points = 0;
        for line in lines(bytes) {
            let mut words = line.content.split_whitespace();
            match words.next() {
                Some("L") => {
                    let key = words.collect::<Vec<_>>().join(" ");
                    let face = library.get(&key);
                    mesh.kinds.push((key, face));
                }
                Some("v") => mesh.corners.push(corner(words, line.number)?),
                Some("f") => mesh.add_polygon(words, &line)?,
                Some("T") => {
                    let face = mesh.choose_type(words, &line)?;
                    points += face.yarns.iter().map(|y| y.points.len() as u64 + 2).sum::<u64>();
                }
                Some("e") => mesh.add_joint(words, &line)?,
                _ => {}
            }
            if 2 * points > options.max_points {
                return Err(CurveFileError::too_many_points(FileLocation::Line(line.number), 2 * points, options));
            }
        }
        Ok(mesh)
    }

    /// A line f: corners by their numbers.
    fn add_polygon<'w>(&mut self, words: impl Iterator<Item = &'w str>, line: &Line<'_>) -> Result<(), CurveFileError> {
        let index = |word: &str| {
            let place: usize = word.split('/').next()?.parse().ok()?;
            (1..=self.corners.len()).contains(&place).then(|| place as u32 - 1)
        };
        let corners = words.map(index).collect::<Option<Vec<u32>>>();
        let corners =
            corners.filter(|c| c.len() > 2).ok_or_else(|| expected("three or more corners that there are", line))?;
        self.polygons.push(Polygon { corners, face: None, line: line.number });
        Ok(())
    }

    /// A line T: the type of the last polygon.
    fn choose_type<'w>(
        &mut self,
        mut words: impl Iterator<Item = &'w str>,
        line: &Line<'_>,
    ) -> Result<&'a Face, CurveFileError> {
        let number = words.next().and_then(|w| w.parse::<usize>().ok());
        let kind = number.and_then(|k| self.kinds.get(k.checked_sub(1)?));
        let (key, face) = kind.ok_or_else(|| expected("the number of a line L above", line))?;
        let polygon = self.polygons.last_mut().ok_or_else(|| expected("a face before its type", line))?;
        let face = face.ok_or_else(|| {
            let problem = format!("the face {} is not in the library", quoted(key));
            CurveFileError::line(line.number, problem).hint("`faces` names another library (.sf)")
        })?;
        if face.corners.len() != polygon.corners.len() {
            let (has, needs) = (polygon.corners.len(), face.corners.len());
            let problem = format!("a face of {has} edges is of a type of {needs}");
            return Err(CurveFileError::line(line.number, problem));
        }
        polygon.face = Some(face);
        Ok(face)
    }

    /// A line e: two edges as face and edge, with a minus where it is walked backwards.
    fn add_joint<'w>(
        &mut self,
        mut words: impl Iterator<Item = &'w str>,
        line: &Line<'_>,
    ) -> Result<(), CurveFileError> {
        let place = |word: Option<&str>| {
            let (polygon, edge) = word?.split_once('/')?;
            let (polygon, edge): (usize, i64) = (polygon.parse().ok()?, edge.parse().ok()?);
            let (polygon, at) = (polygon.checked_sub(1)?, usize::try_from(edge.unsigned_abs()).ok()?.checked_sub(1)?);
            (at < self.polygons.get(polygon)?.corners.len()).then_some(([polygon, at], edge < 0))
        };
        let (Some((a, turned)), Some((b, other))) = (place(words.next()), place(words.next())) else {
            return Err(expected("e face/edge face/-edge of faces above", line));
        };
        self.joints.push(Joint { edges: [a, b], turned: turned != other, line: line.number });
        Ok(())
    }

    /// The pieces of yarn of all polygons, and where those of each begin, with the end of the last.
    fn pieces(&self) -> Result<(Vec<Piece>, Vec<usize>), CurveFileError> {
        let mut pieces = Vec::new();
        let mut first = Vec::with_capacity(self.polygons.len() + 1);
        for polygon in &self.polygons {
            first.push(pieces.len());
            let face =
                polygon.face.ok_or_else(|| CurveFileError::line(polygon.line, "a face without a type (a line T)"))?;
            let own: Vec<DVec3> = polygon.corners.iter().map(|&c| self.corners[c as usize]).collect();
            pieces.extend(bent(face, &own));
        }
        first.push(pieces.len());
        Ok((pieces, first))
    }
}

/// A line v: a corner's place.
fn corner<'w>(mut words: impl Iterator<Item = &'w str>, line: u64) -> Result<DVec3, CurveFileError> {
    let mut p = [0.0; 3];
    for (value, name) in p.iter_mut().zip(["x", "y", "z"]) {
        *value = number(words.next().unwrap_or(""), name, line)?;
    }
    Ok(DVec3::from_array(p))
}

fn expected(what: &str, line: &Line<'_>) -> CurveFileError {
    CurveFileError::line(line.number, format!("expected {what}, found {}", quoted(&line.content)))
}

/// The yarns of a face in a polygon.
fn bent(face: &Face, polygon: &[DVec3]) -> Vec<Piece> {
    let n = polygon.len();
    let area = |i: usize| polygon[i].cross(polygon[(i + 1) % n]);
    let twice: DVec3 = (0..n).map(area).sum();
    let flat: f64 = (0..n).map(|i| face.corners[i].perp_dot(face.corners[(i + 1) % n])).sum();
    let normal = twice.normalize_or_zero() * (twice.length() / flat.abs().max(1e-12)).sqrt();
    let at_edge = |c: &Crossing| polygon[c.edge].lerp(polygon[(c.edge + 1) % n], c.share) + normal * c.height;
    let inside = |p: &DVec3| {
        let weights = mean_value(&face.corners, p.truncate());
        polygon.iter().zip(weights).map(|(v, w)| *v * w).sum::<DVec3>() + normal * p.z
    };
    let piece = |yarn: &super::faces::FaceYarn| {
        let [a, b] = &yarn.ends;
        let points = [at_edge(a)].into_iter().chain(yarn.points.iter().map(inside)).chain([at_edge(b)]).collect();
        Piece { points, crossings: yarn.ends, joined: [None; 2] }
    };
    face.yarns.iter().map(piece).collect()
}

/// Mean value coordinates of a place in or beside a polygon.
fn mean_value(corners: &[DVec2], at: DVec2) -> Vec<f64> {
    let n = corners.len();
    let away: Vec<DVec2> = corners.iter().map(|c| *c - at).collect();
    if let Some(i) = away.iter().position(|d| d.length() < 1e-9) {
        return (0..n).map(|k| f64::from(u8::from(k == i))).collect();
    }
    let half_tangent = |i: usize| {
        let (a, b) = (away[i], away[(i + 1) % n]);
        let (cross, dot) = (a.perp_dot(b), a.dot(b));
        // tan(t / 2) = sin t / (1 + cos t); on an edge it has no bound.
        cross / (a.length() * b.length() + dot).max(1e-12)
    };
    let weights: Vec<f64> =
        (0..n).map(|i| (half_tangent((i + n - 1) % n) + half_tangent(i)) / away[i].length()).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|w| w / sum).collect()
}

/// Joins pieces across edges that are one, in their order along it; gives how many have no other.
fn join(pieces: &mut [Piece], first: &[usize], joints: &[Joint]) -> Result<u64, CurveFileError> {
    let mut loose = 0;
    for &Joint { edges: [a, b], turned, line } in joints {
        let along = |[polygon, edge]: [usize; 2], back: bool| {
            let own = (first[polygon]..first[polygon + 1]).flat_map(|piece| [(piece, 0), (piece, 1)]);
            let mut own: Vec<(usize, usize)> = own.filter(|&(p, end)| pieces[p].crossings[end].edge == edge).collect();
            let place = |&(p, end): &(usize, usize)| pieces[p].crossings[end].share;
            own.sort_by(|x, y| place(x).total_cmp(&place(y)));
            if back {
                own.reverse();
            }
            own
        };
        let (one, other) = (along(a, false), along(b, turned));
        loose += one.len().abs_diff(other.len()) as u64;
        for (x, y) in one.into_iter().zip(other) {
            if x == y || pieces[x.0].joined[x.1].is_some() || pieces[y.0].joined[y.1].is_some() {
                return Err(CurveFileError::line(line, "an edge that is joined already"));
            }
            let last = |(p, end): (usize, usize)| if end == 0 { 0 } else { pieces[p].points.len() - 1 };
            let (i, j) = (last(x), last(y));
            let middle = 0.5 * (pieces[x.0].points[i] + pieces[y.0].points[j]);
            (pieces[x.0].points[i], pieces[y.0].points[j]) = (middle, middle);
            pieces[x.0].joined[x.1] = Some(y);
            pieces[y.0].joined[y.1] = Some(x);
        }
    }
    Ok(loose)
}

/// Whole yarns, those with ends first, and whether they are closed.
fn trace(pieces: &mut [Piece]) -> Vec<(Vec<DVec3>, bool)> {
    let mut seen = vec![false; pieces.len()];
    let mut yarns = Vec::new();
    let ends = (0..pieces.len()).flat_map(|p| [(p, 0), (p, 1)]).filter(|&(p, end)| pieces[p].joined[end].is_none());
    let starts: Vec<(usize, usize)> = ends.chain((0..pieces.len()).map(|p| (p, 0))).collect();
    for start in starts {
        let mut at = Some(start);
        let mut points: Vec<DVec3> = Vec::new();
        let mut closed = false;
        while let Some((piece, end)) = at {
            if seen[piece] {
                closed = !points.is_empty();
                break;
            }
            seen[piece] = true;
            let mut own = std::mem::take(&mut pieces[piece].points);
            if end == 1 {
                own.reverse();
            }
            points.extend(own);
            at = pieces[piece].joined[1 - end];
        }
        points.dedup();
        if closed && points.first() == points.last() {
            points.pop();
        }
        let distinct = points.iter().any(|p| Some(p) != points.first());
        if points.len() > 1 && distinct {
            let ring = closed && points.len() > 2;
            yarns.push((points, ring));
        }
    }
    yarns
}

#[cfg(test)]
mod tests {
    use super::{super::faces, *};

    /// A knit stitch, an increase, a decrease and a turn, simplified.
    const LIBRARY: &str = "\
        face knit+\nedge (-1,-1) -l1\nedge (1,-1) +y1\nedge (1,1) +l1\nedge (-1,1) -y1\n\
        yarn [3:0.5,0] (-0.5,0,0.1) [2:0.7,0]\nyarn [2:0.3,0] (0.5,0,0.1) [1:0.5,0]\nyarn [0:0.3,0] (0,0.6,-0.1) [0:0.7,0]\n\
        derive knit- -l1 -y1 +l1 +y1 by mirror-x from knit+ -l1 +y1 +l1 -y1\n\
        face more+\nedge (-1,-1) -l1\nedge (1,-1) +y1\nedge (1,1) +l1\nedge (0,1.5) +l1\nedge (-1,1) -y1\n\
        yarn [4:0.5,0] [3:0.7,0]\nyarn [3:0.3,0] [2:0.7,0]\nyarn [2:0.3,0] [1:0.5,0]\nyarn [0:0.3,0] (0,0.6,-0.1) [0:0.7,0]\n\
        face less+\nedge (-1,-1) -l1\nedge (0,-1.5) -l1\nedge (1,-1) +y1\nedge (1,1) +l1\nedge (-1,1) -y1\n\
        yarn [4:0.5,0] [3:0.7,0]\nyarn [3:0.3,0] [2:0.5,0]\nyarn [0:0.3,0] (-0.3,0,-0.1) [0:0.7,0]\nyarn [1:0.3,0] (0.3,0,-0.1) [1:0.7,0]\n\
        face turn\nedge (0,-1) -y1\nedge (1,0) x\nedge (0,1) +y1\nyarn [0:0.5,0] (0.5,0,0) [2:0.5,0]\n";

    const KINDS: &str = "L knit+ -l1 +y1 +l1 -y1\nL knit- -l1 -y1 +l1 +y1\nL more+ -l1 +y1 +l1 +l1 -y1\nL less+ -l1 -l1 +y1 +l1 -y1\nL turn -y1 x +y1\n";

    fn read(mesh: &str) -> Result<CurveSet, CurveFileError> {
        let library = faces::parse(LIBRARY.as_bytes()).unwrap();
        parse(format!("{KINDS}{mesh}").as_bytes(), &library, &ReadOptions::default())
    }

    /// A tube of rounds of so many knit stitches.
    fn tube(around: usize, rounds: usize) -> String {
        let mut text = String::new();
        for r in 0..=rounds {
            for k in 0..around {
                let turn = k as f64 / around as f64 * std::f64::consts::TAU;
                text += &format!("v {} {} {}\n", turn.cos(), r as f64, -turn.sin());
            }
        }
        let corner = |k: usize, r: usize| r * around + k % around + 1;
        for r in 0..rounds {
            for k in 0..around {
                text += &format!(
                    "f {} {} {} {}\nT 1\n",
                    corner(k, r),
                    corner(k + 1, r),
                    corner(k + 1, r + 1),
                    corner(k, r + 1)
                );
            }
        }
        for r in 0..rounds {
            for k in 0..around {
                let own = r * around + k + 1;
                text += &format!("e {own}/2 {}/-4\n", r * around + (k + 1) % around + 1);
                if r + 1 < rounds {
                    text += &format!("e {own}/3 {}/-1\n", own + around);
                }
            }
        }
        text
    }

    #[test]
    fn a_tube_is_knitted_of_rounds() {
        let set = read(&tube(6, 3)).unwrap();
        let closed: Vec<&Curve> = set.curves.iter().filter(|c| c.closed).collect();
        // The upper round has open loops, and so have the feet of the lower one.
        assert_eq!((closed.len(), set.curves.len(), set.notes.len()), (2, 2 + 6 + 6, 0));
        for curve in closed {
            // Up, over the loop's head in the next round, and down, six times.
            assert!(curve.points.iter().all(|p| (0.4..1.2).contains(&p.x.hypot(p.z))));
            let heights = |up: bool| curve.points.windows(2).filter(|w| (w[1].y > w[0].y + 1e-9) == up).count();
            assert!(heights(true) >= 6 && heights(false) >= 6);
            let low = curve.points.iter().fold(f64::MAX, |l, p| l.min(p.y));
            let high = curve.points.iter().fold(f64::MIN, |h, p| h.max(p.y));
            assert!((1.0..1.5).contains(&(high - low)), "{low} to {high}");
        }
    }

    #[test]
    fn increases_decreases_and_turns_lead_yarns_on() {
        // A stitch, above it one that makes two, above these one that makes one of them.
        let corners = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 1 3 0\nv 0 3.5 0\nv -1 3 0\nv 1 5 0\nv -1 5 0\n";
        let faces = "f 1 2 3 4\nT 1\nf 4 3 5 6 7\nT 3\nf 7 6 5 8 9\nT 4\n";
        let set = read(&format!("{corners}{faces}e 1/3 2/-1\ne 2/4 3/-1\ne 2/3 3/-2\n")).unwrap();
        assert_eq!(set.notes, Vec::<String>::new());
        // The loop of each row runs on through the row above: one yarn a row, and the foot of the lowest.
        assert_eq!((set.curves.len(), set.curves.iter().any(|c| c.closed)), (1 + 1 + 1 + 2, false));
        let longest = set.curves.iter().map(|c| c.points.len()).max().unwrap();
        assert!(longest > 10, "{longest}");
        // A turn at the right end joins a row with the one above, knitted back.
        let short = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 2 4 0\nv 0 4 0\nv 3 2 0\n\
                     f 1 2 3 4\nT 1\nf 4 3 5 6\nT 2\nf 2 7 5\nT 5\ne 1/3 2/-1\n";
        let set = read(short).unwrap();
        let before = set.curves.len();
        let set = read(&format!("{short}e 1/2 3/1\ne 3/3 2/-2\n")).unwrap();
        assert_eq!(set.curves.len(), before - 2);
    }

    #[test]
    fn mistakes_have_their_line() {
        let quad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
        let wrong = |more: &str| read(more).unwrap_err().to_string();
        assert!(wrong(&format!("{quad}T 9\n")).starts_with("line 11: expected the number of a line L above"));
        assert!(wrong(&format!("{quad}T 3\n")).contains("a face of 4 edges is of a type of 5"));
        assert!(wrong(quad).contains("line 10: a face without a type"));
        assert!(wrong("v 0 0 0\nf 1 2 3\n").contains("three or more corners that there are"));
        assert!(wrong(&format!("{quad}T 1\ne 1/2 2/-4\n")).contains("of faces above"));
        assert!(wrong(&format!("{quad}T 1\ne 1/{} 1/1\n", i64::MIN)).contains("of faces above"));
        assert!(wrong(&format!("{quad}L what x\nT 6\n")).contains("not in the library"));
        assert!(wrong("v 0 nan 0\n").contains("finite number for y"));
        assert!(wrong(&format!("{quad}T 1\n{quad}T 1\ne 1/3 2/-1\ne 1/3 2/-1\n")).contains("joined already"));
    }

    #[test]
    fn coordinates_give_the_place_itself() {
        let corners = [DVec2::new(-1.0, -1.0), DVec2::new(1.0, -1.2), DVec2::new(1.4, 0.9), DVec2::new(-0.8, 1.1)];
        for at in [DVec2::new(0.1, 0.2), DVec2::new(-0.9, -0.8), corners[2]] {
            let again: DVec2 = corners.iter().zip(mean_value(&corners, at)).map(|(c, w)| *c * w).sum();
            assert!(again.distance(at) < 1e-9, "{at}: {again}");
        }
    }
}
