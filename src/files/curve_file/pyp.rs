//! PYP, the periodic yarn patterns of MADYPG: one cell of a cloth that repeats along x and y. Text, in metres.
//!
//! | section | rows |
//! |---|---|
//! | `*pattern` | one: period along x, period along y, yarn radius, number n of vertices and of edges |
//! | `*Q` | n: x y z twist |
//! | `*E` | n: from to dx dy; the edge ends at vertex `to` of the cell dx, dy further on |
//!
//! Whatever follows a section's name on its line is a comment. Other sections (rest lengths, directors and so on) are
//! for simulations and are skipped. As there are as many edges as vertices and a yarn neither forks nor merges, the
//! edges form cycles. A cycle whose cell offsets add up to zero is a ring; any other is an endless yarn, of which the
//! file holds one period.

use arrayvec::ArrayVec;
use glam::{DVec2, DVec3};

use super::repair::{Ends, Repair};
use super::{CurveFileError, FileLocation, ReadOptions, lines, number, quoted};
use crate::{
    geometry::curve::{Basis, CurveSet},
    math::words::counted,
    pattern::{
        StrandKind,
        tile::{Tile, TileStrand},
    },
};

const MILLIMETRES_PER_METRE: f64 = 1000.0;
const CUT_SHORT: &str = "is the file cut short?";

/// A whole number of cells along x and y.
type Cell = [i64; 2];

pub(super) fn parse(bytes: &[u8], options: &ReadOptions) -> Result<CurveSet, CurveFileError> {
    let [columns, rows] = options.tile;
    if columns == 0 || rows == 0 {
        let problem = format!("expected tile counts of 1 or more, found {columns} x {rows}");
        return Err(CurveFileError::new(FileLocation::File, problem));
    }
    let cell = PatternCell::parse(bytes)?;
    let total = cell.vertices.len() as u128 * u128::from(columns) * u128::from(rows);
    if total > u128::from(options.max_points) {
        let found = format!("{columns} x {rows} cells of {}", cell.vertices.len());
        return Err(CurveFileError::too_many_points(FileLocation::File, found, options));
    }

    let mut repair = Repair::default();
    for yarn in cell.yarns() {
        yarn.lay_out(&cell, options.tile, &mut repair)?;
    }
    Ok(CurveSet { unit_mm: Some(MILLIMETRES_PER_METRE), ..repair.finish() })
}

/// The cell itself, millimetres.
pub(super) fn tile(bytes: &[u8]) -> Result<Tile, CurveFileError> {
    let cell = PatternCell::parse(bytes)?;
    if cell.radius > cell.period[0].max(cell.period[1]) {
        let [x, y] = cell.period;
        let problem = format!("the radius {} is larger than the cell of {x} x {y} that repeats", cell.radius);
        return Err(CurveFileError::new(FileLocation::File, problem));
    }
    let strand = |yarn: Yarn| {
        let points = yarn.stops.iter().map(|&(vertex, offset)| place(&cell, vertex, offset));
        let mut points: Vec<DVec3> = points.collect::<Result<_, _>>()?;
        let cells = |shift: i64| {
            // The least number has no positive one.
            i32::try_from(shift).ok().filter(|cells| *cells > i32::MIN).ok_or_else(|| {
                let problem = format!("a yarn repeats {shift} cells farther on; {} is the most", i32::MAX);
                CurveFileError::new(FileLocation::File, problem)
            })
        };
        let mut step = [cells(yarn.shift[0])?, cells(yarn.shift[1])?];
        // Which way the file walks along a yarn does not matter.
        if step[0] < 0 || (step[0] == 0 && step[1] < 0) {
            points.reverse();
            step = step.map(|s| -s);
        }
        Ok(TileStrand {
            kind: StrandKind::Course,
            index: 0,
            points: points.into_iter().map(|p| p * MILLIMETRES_PER_METRE).collect(),
            step,
            radius: cell.radius * MILLIMETRES_PER_METRE,
            half_width: 1.0,
            sections: Vec::new(),
            coordinates: Vec::new(),
        })
    };
    let strands = cell.yarns().map(strand).collect::<Result<_, CurveFileError>>()?;
    Ok(Tile::of_strands(DVec2::from(cell.period) * MILLIMETRES_PER_METRE, strands))
}

/// The file's content, checked: each vertex has one edge that leaves and one that arrives.
struct PatternCell {
    period: [f64; 2],
    radius: f64,
    vertices: Vec<DVec3>,
    /// The edge that leaves each vertex: where it ends, and how many cells further on.
    next: Vec<(usize, Cell)>,
}

struct Pattern {
    period: [f64; 2],
    radius: f64,
    count: u64,
}

struct Edge {
    line: u64,
    from: u32,
    to: u32,
    shift: [i32; 2],
}

/// The sections in the order of [`SECTION_NAMES`].
#[derive(Clone, Copy, PartialEq, Eq)]
enum Section {
    Pattern,
    Vertices,
    Edges,
    Other,
}

const SECTION_NAMES: [(&str, Section); 3] =
    [("*pattern", Section::Pattern), ("*Q", Section::Vertices), ("*E", Section::Edges)];

impl PatternCell {
    fn parse(bytes: &[u8]) -> Result<Self, CurveFileError> {
        let mut pattern: Option<Pattern> = None;
        let mut vertices = Vec::new();
        let mut edges = Vec::new();
        let mut section = None;
        let mut heading_lines = [0_u64; 3];
        for line in lines(bytes) {
            let content: &str = &line.content;
            if content.is_empty() {
                continue;
            }
            if content.starts_with('*') {
                let name = content.split_whitespace().next().unwrap_or(content);
                let known = SECTION_NAMES.iter().position(|&(known, _)| known == name);
                if let Some(known) = known {
                    if heading_lines[known] > 0 {
                        let problem = format!(
                            "expected one section {name}, found a second (first: line {})",
                            heading_lines[known]
                        );
                        return Err(CurveFileError::line(line.number, problem));
                    }
                    heading_lines[known] = line.number;
                }
                section = Some(known.map_or(Section::Other, |known| SECTION_NAMES[known].1));
                continue;
            }
            match section {
                None => {
                    let problem = format!("expected a section name such as *pattern, found {}", quoted(content));
                    return Err(CurveFileError::line(line.number, problem).hint("is this another kind of file?"));
                }
                Some(Section::Pattern) if pattern.is_some() => {
                    return Err(CurveFileError::line(line.number, "expected one row in *pattern, found a second"));
                }
                Some(Section::Pattern) => pattern = Some(parse_pattern(content, line.number)?),
                Some(Section::Vertices) => vertices.push(parse_vertex(content, line.number)?),
                Some(Section::Edges) => edges.push(parse_edge(content, line.number)?),
                Some(Section::Other) => {}
            }
        }

        for (&(name, _), heading_line) in SECTION_NAMES.iter().zip(heading_lines) {
            if heading_line == 0 {
                return Err(CurveFileError::new(FileLocation::File, format!("expected a section {name}, found none"))
                    .hint(CUT_SHORT));
            }
        }
        let [pattern_line, vertices_line, edges_line] = heading_lines;
        let Some(pattern) = pattern else {
            return Err(CurveFileError::line(pattern_line, "expected one row in *pattern, found none").hint(CUT_SHORT));
        };
        for (name, line, found) in [("*Q", vertices_line, vertices.len()), ("*E", edges_line, edges.len())] {
            if found as u64 != pattern.count {
                let promised = counted(pattern.count, "row");
                let problem = format!("expected {promised} in {name} as *pattern says, found {found}");
                return Err(CurveFileError::line(line, problem).hint(CUT_SHORT));
            }
        }
        let next = link(&edges, vertices.len())?;
        Ok(Self { period: pattern.period, radius: pattern.radius, vertices, next })
    }

    /// One yarn for each cycle of edges, in the order of their smallest vertices.
    fn yarns(&self) -> impl Iterator<Item = Yarn> {
        let mut seen = vec![false; self.next.len()];
        (0..self.next.len()).filter_map(move |first| {
            let mut yarn = Yarn { stops: Vec::new(), shift: [0, 0] };
            let mut vertex = first;
            while !seen[vertex] {
                seen[vertex] = true;
                yarn.stops.push((vertex, yarn.shift));
                let (next, shift) = self.next[vertex];
                yarn.shift = plus(yarn.shift, shift);
                vertex = next;
            }
            (!yarn.stops.is_empty()).then_some(yarn)
        })
    }
}

/// The edge that leaves each vertex. There are as many edges as vertices, so none of them is missing.
fn link(edges: &[Edge], vertex_count: usize) -> Result<Vec<(usize, Cell)>, CurveFileError> {
    // Line 0 stands for "no edge yet".
    let mut leaving = vec![0_u64; vertex_count];
    let mut arriving = vec![0_u64; vertex_count];
    let mut next = vec![(0, [0, 0]); vertex_count];
    for edge in edges {
        for (vertex, lines, verb) in [(edge.from, &mut leaving, "leaves"), (edge.to, &mut arriving, "arrives at")] {
            let Some(line) = lines.get_mut(vertex as usize) else {
                let problem = format!("expected a vertex from 0 to {}, found {vertex}", vertex_count.saturating_sub(1));
                return Err(CurveFileError::line(edge.line, problem));
            };
            if *line > 0 {
                let problem = format!("a second edge {verb} vertex {vertex} (first: line {line})");
                return Err(CurveFileError::line(edge.line, problem).hint("yarns cannot fork or merge"));
            }
            *line = edge.line;
        }
        next[edge.from as usize] = (edge.to as usize, edge.shift.map(i64::from));
    }
    Ok(next)
}

fn fields<'a>(content: &'a str, names: &str, line: u64) -> Result<[&'a str; 4], CurveFileError> {
    // One more than allowed is enough to know.
    let tokens: ArrayVec<&str, 5> = content.split_whitespace().take(5).collect();
    tokens.as_slice().try_into().map_err(|_| {
        CurveFileError::line(line, format!("expected four numbers \"{names}\", found {}", quoted(content)))
    })
}

fn parse_pattern(content: &str, line: u64) -> Result<Pattern, CurveFileError> {
    let [px, py, radius, count] = fields(content, "px py radius n", line)?;
    let positive = |token, name| match number(token, name, line)? {
        value if value > 0.0 => Ok(value),
        _ => Err(CurveFileError::line(line, format!("expected {name} above 0, found {}", quoted(token)))),
    };
    let period = [positive(px, "the period px")?, positive(py, "the period py")?];
    let radius = positive(radius, "the radius")?;
    let count = integer(count, "the number of vertices", line)?;
    Ok(Pattern { period, radius, count })
}

fn parse_vertex(content: &str, line: u64) -> Result<DVec3, CurveFileError> {
    let [x, y, z, twist] = fields(content, "x y z twist", line)?;
    number(twist, "the twist", line)?;
    Ok(DVec3::new(number(x, "x", line)?, number(y, "y", line)?, number(z, "z", line)?))
}

fn parse_edge(content: &str, line: u64) -> Result<Edge, CurveFileError> {
    let [from, to, dx, dy] = fields(content, "from to dx dy", line)?;
    let from = integer(from, "a vertex", line)?;
    let to = integer(to, "a vertex", line)?;
    Ok(Edge { line, from, to, shift: [integer(dx, "dx", line)?, integer(dy, "dy", line)?] })
}

fn integer<T: std::str::FromStr>(token: &str, name: &str, line: u64) -> Result<T, CurveFileError> {
    token
        .parse()
        .map_err(|_| CurveFileError::line(line, format!("expected a whole number for {name}, found {}", quoted(token))))
}

fn plus(a: Cell, b: Cell) -> Cell {
    [a[0] + b[0], a[1] + b[1]]
}

fn minus(a: Cell, b: Cell) -> Cell {
    [a[0] - b[0], a[1] - b[1]]
}

/// One period of a yarn.
struct Yarn {
    /// Each vertex and the cell it lies in, as seen from the first vertex.
    stops: Vec<(usize, Cell)>,
    /// From the first vertex to the same vertex one period later.
    shift: Cell,
}

impl Yarn {
    /// Adds this yarn's curves to a cloth of `tile` cells: every vertex once for each cell.
    fn lay_out(&self, cell: &PatternCell, tile: [u32; 2], repair: &mut Repair) -> Result<(), CurveFileError> {
        let cells = || (0..i64::from(tile[1])).flat_map(|y| (0..i64::from(tile[0])).map(move |x| [x, y]));
        if self.shift == [0, 0] {
            for home in cells() {
                let points = self.stops.iter().map(|&(vertex, offset)| place(cell, vertex, plus(home, offset)));
                add(points.collect::<Result<_, _>>()?, Ends::Closed, cell.radius, repair);
            }
            return Ok(());
        }

        // A knitted loop bulges into the neighbouring cell and comes back. Were it cut at the cell's border, the edge
        // of the cloth would be all scraps; so each vertex counts towards the cell the yarn has reached by its shift.
        let inside = |[x, y]: Cell| (0..i64::from(tile[0])).contains(&x) && (0..i64::from(tile[1])).contains(&y);
        for start in 0..self.stops.len() {
            let step = self.step_to(start);
            if step == [0, 0] {
                continue;
            }
            for home in cells().filter(|&home| !inside(minus(home, step))) {
                let mut points = Vec::new();
                let (mut stop, mut at) = (start, home);
                while inside(at) {
                    let (vertex, offset) = self.stops[stop];
                    points.push(place(cell, vertex, plus(at, minus(offset, self.reached(stop))))?);
                    stop = (stop + 1) % self.stops.len();
                    at = plus(at, self.step_to(stop));
                }
                add(points, Ends::Open, cell.radius, repair);
            }
        }
        Ok(())
    }

    /// How many cells of the period's shift are behind the yarn at a stop. Never runs back.
    fn reached(&self, stop: usize) -> Cell {
        // In i128, because a hostile shift times a long yarn leaves i64.
        self.shift.map(|shift| (i128::from(shift) * stop as i128 / self.stops.len() as i128) as i64)
    }

    /// From the cell reached at the stop before (in the period before, for the first) to the one reached at `stop`.
    fn step_to(&self, stop: usize) -> Cell {
        match stop.checked_sub(1) {
            Some(before) => minus(self.reached(stop), self.reached(before)),
            None => minus(self.shift, self.reached(self.stops.len() - 1)),
        }
    }
}

fn add(points: Vec<DVec3>, ends: Ends, radius: f64, repair: &mut Repair) {
    let radii = vec![radius; points.len()];
    repair.add(Basis::CatmullRom, ends, points, Some(radii));
}

fn place(cell: &PatternCell, vertex: usize, at: Cell) -> Result<DVec3, CurveFileError> {
    let point = cell.vertices[vertex] + DVec3::new(at[0] as f64 * cell.period[0], at[1] as f64 * cell.period[1], 0.0);
    if point.is_finite() {
        return Ok(point);
    }
    let problem =
        format!("expected finite coordinates, found {point} for vertex {vertex} in cell {}, {}", at[0], at[1]);
    Err(CurveFileError::new(FileLocation::File, problem))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::curve::Curve;

    /// A cell of 10 x 20 with the given vertices (at z = 0) and edges.
    fn file(vertices: &[[f64; 2]], edges: &[[i64; 4]]) -> String {
        let mut text = format!("*pattern # px py radius n\n10 20 0.5 {}\n\n*Q # dofs\n", vertices.len());
        for [x, y] in vertices {
            text += &format!("{x} {y} 0 0.25\n");
        }
        text += "\n*E # edges: v0 v1 dx dy\n";
        for [from, to, dx, dy] in edges {
            text += &format!("{from} {to} {dx} {dy}\n");
        }
        text + "\n*RL # rest lengths\nanything\n"
    }

    fn tiled(text: &str, tile: [u32; 2]) -> CurveSet {
        parse(text.as_bytes(), &ReadOptions { tile, ..ReadOptions::default() }).expect("a readable file")
    }

    fn message(text: &str) -> String {
        parse(text.as_bytes(), &ReadOptions::default()).expect_err("a broken file").to_string()
    }

    fn flat(curve: &Curve) -> Vec<[f64; 2]> {
        curve.points.iter().map(|point| [point.x, point.y]).collect()
    }

    #[test]
    fn a_yarn_along_x_becomes_one_curve_for_each_row() {
        // The second vertex lies in the cell below, as the head of a knitted loop does; it is not cut off there.
        let text = file(&[[1.0, 1.0], [5.0, 19.0]], &[[0, 1, 0, -1], [1, 0, 1, 1]]);
        let set = tiled(&text, [2, 2]);
        assert_eq!(set.unit_mm, Some(1000.0));
        assert_eq!(set.up_axis, None);
        assert!(set.notes.is_empty());
        let curves: Vec<_> = set.curves.iter().map(flat).collect();
        assert_eq!(
            curves,
            [
                [[1.0, 1.0], [5.0, -1.0], [11.0, 1.0], [15.0, -1.0]],
                [[1.0, 21.0], [5.0, 19.0], [11.0, 21.0], [15.0, 19.0]]
            ]
        );
        for curve in &set.curves {
            assert_eq!((curve.basis, curve.closed), (Basis::CatmullRom, false));
            assert_eq!(curve.radii.as_deref(), Some(&[0.5; 4][..]));
        }
    }

    #[test]
    fn a_yarn_may_run_backwards_and_along_y() {
        let text = file(&[[1.0, 1.0], [1.0, 15.0]], &[[1, 0, 0, 0], [0, 1, 0, -1]]);
        let curves: Vec<_> = tiled(&text, [1, 2]).curves.iter().map(flat).collect();
        assert_eq!(curves, [[[1.0, 21.0], [1.0, 15.0], [1.0, 1.0], [1.0, -5.0]]]);
    }

    #[test]
    fn a_yarn_of_several_cells_is_cut_at_the_border_of_the_cloth() {
        // Shift (2, 1): the second vertex one column on, the first one again another column on and a row up.
        let text = file(&[[1.0, 1.0], [2.0, 2.0]], &[[0, 1, 1, 0], [1, 0, 1, 1]]);
        let set = tiled(&text, [3, 2]);
        let curves: Vec<_> = set.curves.iter().map(flat).collect();
        let expected: [&[[f64; 2]]; 4] = [
            &[[1.0, 1.0], [12.0, 2.0], [21.0, 21.0]],
            &[[11.0, 1.0], [22.0, 2.0]],
            &[[1.0, 21.0], [12.0, 22.0]],
            &[[2.0, 2.0], [11.0, 21.0], [22.0, 22.0]],
        ];
        assert_eq!(curves, expected);
        // Two corners of the cloth hold one vertex of a yarn each.
        assert_eq!(set.notes, ["2 curves (first: curve 2) without two distinct points; skipped"]);
    }

    #[test]
    fn a_tile_is_wider_than_half_its_yarn() {
        let text = file(&[[1.0, 1.0]], &[[0, 0, 1, 0]]);
        assert_eq!(tile(text.as_bytes()).unwrap().counts[1], 1);
        let error = tile(text.replace("10 20 0.5", "10 20 2e4").as_bytes()).unwrap_err();
        assert!(error.to_string().contains("radius 20000 is larger than the cell of 10 x 20"), "{error}");
    }

    #[test]
    fn a_yarn_of_one_vertex_joins_through_the_cells() {
        let curves: Vec<_> = tiled(&file(&[[1.0, 1.0]], &[[0, 0, 1, 0]]), [3, 1]).curves.iter().map(flat).collect();
        assert_eq!(curves, [[[1.0, 1.0], [11.0, 1.0], [21.0, 1.0]]]);
    }

    #[test]
    fn a_ring_is_closed_in_every_cell() {
        let text = file(&[[9.0, 0.0], [1.0, 1.0], [2.0, 3.0]], &[[0, 1, 1, 0], [1, 2, 0, 0], [2, 0, -1, 0]]);
        let set = tiled(&text, [2, 1]);
        assert!(set.curves.iter().all(|curve| curve.closed));
        let curves: Vec<_> = set.curves.iter().map(flat).collect();
        assert_eq!(curves, [[[9.0, 0.0], [11.0, 1.0], [12.0, 3.0]], [[19.0, 0.0], [21.0, 1.0], [22.0, 3.0]]]);
    }

    #[test]
    fn shifts_at_the_limit_do_not_overflow() {
        let far = i64::from(i32::MIN);
        let text = file(&[[1.0, 1.0], [2.0, 2.0]], &[[0, 1, far, far], [1, 0, far, far]]);
        assert!(tiled(&text, [3, 3]).curves.is_empty());
        let text = file(&[[1.0, 1.0], [2.0, 2.0]], &[[0, 1, far, 0], [1, 0, -far - 1, 0]]);
        assert_eq!(tiled(&text, [2, 1]).curves[0].points[1].x, 12.0 + far as f64 * 10.0);
    }

    #[test]
    fn a_tile_of_endless_shift_is_an_error() {
        let far = i64::from(i32::MIN);
        let text = file(&[[1.0, 1.0], [2.0, 2.0]], &[[0, 1, far, 0], [1, 0, far, 0]]);
        let message = tile(text.as_bytes()).unwrap_err().to_string();
        assert_eq!(message, "a yarn repeats -4294967296 cells farther on; 2147483647 is the most");
        let text = file(&[[1.0, 1.0], [2.0, 2.0]], &[[0, 1, far, 0], [1, 0, 0, 0]]);
        assert!(tile(text.as_bytes()).is_err());
    }

    #[test]
    fn mistakes_are_explained() {
        let good = file(&[[1.0, 1.0], [5.0, 1.0]], &[[0, 1, 0, 0], [1, 0, 1, 0]]);
        let replaced = |old: &str, new: &str| {
            assert!(good.contains(old), "{old}");
            good.replacen(old, new, 1)
        };
        for (text, expected) in [
            (String::new(), "expected a section *pattern, found none; is the file cut short?"),
            (
                "0 0 0\n".into(),
                "line 1: expected a section name such as *pattern, found \"0 0 0\"; is this another kind of file?",
            ),
            (replaced("*E", "*F"), "expected a section *E, found none; is the file cut short?"),
            (replaced("*RL", "*Q"), "line 12: expected one section *Q, found a second (first: line 4)"),
            (replaced("10 20 0.5 2\n", ""), "line 1: expected one row in *pattern, found none; is the file cut short?"),
            (replaced("\n*Q", "1 1 1 1\n*Q"), "line 3: expected one row in *pattern, found a second"),
            (replaced("10 20", "0 20"), "line 2: expected the period px above 0, found \"0\""),
            (replaced("0.5 2", "-0.5 2"), "line 2: expected the radius above 0, found \"-0.5\""),
            (replaced("0.5 2", "0.5 -2"), "line 2: expected a whole number for the number of vertices, found \"-2\""),
            (
                replaced("0.5 2", "0.5 3"),
                "line 4: expected 3 rows in *Q as *pattern says, found 2; is the file cut short?",
            ),
            (
                replaced("1 0 1 0\n", ""),
                "line 8: expected 2 rows in *E as *pattern says, found 1; is the file cut short?",
            ),
            (replaced("5 1 0 0.25", "5 1 0"), "line 6: expected four numbers \"x y z twist\", found \"5 1 0\""),
            (replaced("5 1 0 0.25", "5 NaN 0 0.25"), "line 6: expected a finite number for y, found \"NaN\""),
            (replaced("1 0 1 0", "1 2 1 0"), "line 10: expected a vertex from 0 to 1, found 2"),
            (replaced("1 0 1 0", "1 -1 1 0"), "line 10: expected a whole number for a vertex, found \"-1\""),
            (replaced("1 0 1 0", "1 0 0.5 0"), "line 10: expected a whole number for dx, found \"0.5\""),
            (
                replaced("1 0 1 0", "0 0 1 0"),
                "line 10: a second edge leaves vertex 0 (first: line 9); yarns cannot fork or merge",
            ),
            (
                replaced("1 0 1 0", "1 1 1 0"),
                "line 10: a second edge arrives at vertex 1 (first: line 9); yarns cannot fork or merge",
            ),
        ] {
            assert_eq!(message(&text), expected);
        }
    }

    #[test]
    fn the_number_of_cells_is_limited() {
        let text = file(&[[1.0, 1.0], [5.0, 1.0]], &[[0, 1, 0, 0], [1, 0, 1, 0]]);
        for (tile, expected) in [
            ([u32::MAX, u32::MAX], "4294967295 x 4294967295 cells of 2 points are more than the 134217728 allowed"),
            ([1, 0], "expected tile counts of 1 or more, found 1 x 0"),
        ] {
            let options = ReadOptions { tile, ..ReadOptions::default() };
            assert_eq!(parse(text.as_bytes(), &options).expect_err("a wrong tile").to_string(), expected);
        }
    }

    #[test]
    fn cells_too_far_away_are_an_error() {
        let text = file(&[[1.0, 1.0]], &[[0, 0, 1, 0]]).replacen("10 20", "1e308 20", 1);
        let error = parse(text.as_bytes(), &ReadOptions { tile: [3, 1], ..ReadOptions::default() });
        let message = error.expect_err("beyond f64").to_string();
        assert_eq!(message, "expected finite coordinates, found [inf, 1, 0] for vertex 0 in cell 2, 0");
    }
}
