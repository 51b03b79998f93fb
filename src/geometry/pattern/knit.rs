//! Knitted cloth: loops drawn through loops, as a chart says, on a flat piece, a tube or a surface of revolution.
//!
//! Each stitch begins as a closed form (after Crane, "A Simple Parametric Model of Plain-Knit Yarns", 2023:
//! x = t + a sin 2t, y = -h cos t, z = -d cos 2t) whose depth takes its sign from the stitch at its feet and from the
//! stitch drawn through its head: that fixes which strand is in front wherever two cross. Then yarns find room:
//! `super::relax` keeps their length, straightens them and parts them until they touch. Cloth that repeats is relaxed
//! once, as one cell with periodic borders; shaped cloth as a whole. Inside this file the unit is the yarn's diameter.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{
    MAX_POINTS, PatternStrand, StrandKind,
    chart::{Chart, ChartError, Stitch},
    relax::{Ends, Relaxation, Rope},
    revolution::Revolution,
    tile::RelaxedRows,
};
use crate::geometry::curve::{Basis, Curve};

/// What a knit is knitted to.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// In the plane z = 0, centred, right side towards +z; each course an open curve.
    Flat,
    /// Round about the y axis, right side out; each course a ring. The radius is what the stitches need.
    Tube,
    /// On a surface of revolution about the y axis: the profile from the cast-on edge, radius and height in the unit of
    /// the diameter. Its right side is to the right of the way along the profile.
    Revolution(Vec<DVec2>),
}

/// A piece of knitting.
#[derive(Clone, Debug, PartialEq)]
pub struct Knit {
    /// Its rows.
    pub chart: Chart,
    /// Stitches cast on.
    pub stitches: u32,
    /// Rows to knit.
    pub rows: u32,
    /// Its form.
    pub form: Form,
    /// Width of a stitch in yarn diameters; what the pattern draws itself to if absent.
    pub stitch_width: Option<f64>,
    /// Distance between rows in yarn diameters, likewise.
    pub row_height: Option<f64>,
    /// Length of yarn in a stitch, in diameters.
    pub yarn_per_stitch: f64,
    /// Control points of a stitch.
    pub points: u32,
}

/// Proportions of stockinette as it relaxes, in yarn diameters: measured on relaxed knits of MADYPG's patterns and on
/// Yuksel's models, 13 to 15 diameters of yarn in a stitch 3.6 wide and 2.2 high.
pub const STITCH_WIDTH: f64 = 3.6;
/// As [`STITCH_WIDTH`].
pub const ROW_HEIGHT: f64 = 2.2;
/// As [`STITCH_WIDTH`].
pub const YARN_PER_STITCH: f64 = 13.9;
/// Control points of a stitch unless asked otherwise.
pub const POINTS: u32 = 24;

/// The largest cell that is relaxed once and repeated, in stitches.
const LARGEST_CELL: u32 = 2048;
/// A periodic cell is at least this wide and high, in diameters: neighbours must not meet their own images.
const SMALLEST_CELL: f64 = 9.0;
/// Tubes of a smaller radius, in diameters, are relaxed as a whole if they have no more than so many stitches.
const NARROW_TUBE: f64 = 60.0;
const LARGEST_NARROW_TUBE: u64 = 20_000;
const CELL_ROUNDS: usize = 500;
const PIECE_ROUNDS: usize = 100;

impl Knit {
    /// How many control points the cloth would have at most if it kept its width.
    pub fn control_points(&self) -> u64 {
        u64::from(self.stitches) * u64::from(self.rows) * u64::from(self.points) + u64::from(self.rows)
    }

    /// Width of a stitch and distance between rows, in diameters.
    ///
    /// Ribs draw together and garter stitch draws up: by how far columns (or rows) of knit and purl alternate.
    pub fn gauge(&self) -> [f64; 2] {
        let wide = self.chart.even_width(LARGEST_CELL).unwrap_or(self.stitches.min(64)).max(2);
        let rows = self.chart.work(wide, self.chart.rows().min(LARGEST_CELL), 1 << 22).unwrap_or_default();
        let sign = |s: &Stitch| if s.purl { -1.0 } else { 1.0 };
        let columns = rows.iter().map(Vec::len).min().unwrap_or(0);
        let (mut across, mut up) = (0.0, 0.0);
        for j in 0..columns {
            let step = |r: &Vec<Stitch>| 0.5 * (sign(&r[(j + 1) % columns]) - sign(&r[j]));
            across += rows.iter().map(step).sum::<f64>().abs() / rows.len() as f64;
        }
        for (i, row) in rows.iter().enumerate() {
            let next = &rows[(i + 1) % rows.len()];
            up +=
                (0..columns).map(|j| 0.5 * (sign(&next[j]) - sign(&row[j]))).sum::<f64>().abs() / columns.max(1) as f64;
        }
        let (across, up) = (across / columns.max(1) as f64, up / rows.len().max(1) as f64);
        [
            self.stitch_width.unwrap_or(STITCH_WIDTH * (1.0 - 0.3 * across) * (1.0 + 0.15 * up)),
            self.row_height.unwrap_or(ROW_HEIGHT * (1.0 - 0.2 * up)),
        ]
    }

    /// The courses from the cast-on edge, in the unit of `diameter`.
    ///
    /// # Errors
    /// The chart does not fit the stitches, or asks for more than [`MAX_POINTS`] control points.
    pub fn strands(&self, diameter: f64) -> Result<Vec<PatternStrand>, ChartError> {
        let most = MAX_POINTS / u64::from(self.points).max(1);
        let rows = self.chart.work(self.stitches, self.rows, most)?;
        let [width, height] = self.gauge();
        let even = rows.iter().all(|r| r.len() == rows[0].len());
        let cell_width = self.chart.even_width(LARGEST_CELL);
        let repeats = even && cell_width.is_some_and(|w| w * self.chart.rows() <= LARGEST_CELL);
        // A cell bent round a narrow tube is pressed together on the inside: relax such a tube as a whole.
        let narrow = self.form == Form::Tube
            && width * f64::from(self.stitches) / TAU < NARROW_TUBE
            && u64::from(self.stitches) * u64::from(self.rows) <= LARGEST_NARROW_TUBE;
        let made = match (&self.form, cell_width) {
            (Form::Flat | Form::Tube, Some(cell_width)) if repeats && !narrow => {
                self.repeat_cell(cell_width, [width, height])
            }
            (form, _) => {
                let natural = f64::from(self.rows) * height;
                let surface = match form {
                    Form::Flat => Surface::Plane { width: width * f64::from(self.stitches), height },
                    Form::Tube => {
                        let radius = width * f64::from(self.stitches) / TAU;
                        let profile = [DVec2::new(radius, 0.0), DVec2::new(radius, natural)];
                        Surface::Round { revolution: Revolution::new(&profile), height }
                    }
                    Form::Revolution(profile) => {
                        let scaled: Vec<DVec2> = profile.iter().map(|p| *p / diameter).collect();
                        let revolution = Revolution::new(&scaled);
                        let height = revolution.length() / f64::from(self.rows);
                        Surface::Round { revolution, height }
                    }
                };
                self.relax_whole(&rows, &surface)
            }
        };
        Ok(made
            .into_iter()
            .enumerate()
            .map(|(row, course)| PatternStrand {
                curve: Curve {
                    basis: Basis::CatmullRom,
                    closed: course.closed,
                    points: course.points.into_iter().map(|p| p * diameter).collect(),
                    radii: None,
                    flattening: None,
                },
                kind: StrandKind::Course,
                index: row as u32,
                coordinates: course.coordinates,
            })
            .collect())
    }

    /// Relaxes some repeats of the chart, `cell_width` stitches wide each, with periodic borders.
    fn cell(&self, cell_width: u32, [width, height]: [f64; 2]) -> Cell {
        let chart_rows = self.chart.rows();
        let wide = cell_width * (SMALLEST_CELL / (f64::from(cell_width) * width)).ceil() as u32;
        let high = chart_rows * (SMALLEST_CELL / (f64::from(chart_rows) * height)).ceil() as u32;
        // The first row of a chart knitted on itself is a row like any other: start a repeat later.
        let rows =
            self.chart.work(wide, chart_rows + high, u64::MAX).unwrap_or_default().split_off(chart_rows as usize);
        let period = DVec2::new(f64::from(wide) * width, f64::from(high) * height);
        let surface = Surface::Plane { width: period.x, height };
        let mut relaxation = self.begin(&rows, &Layout::new(&rows, true, true), &surface, &|_| None);
        for rope in &mut relaxation.ropes {
            rope.ends = Ends::Joined(DVec3::X * period.x);
        }
        relaxation.period = Some(period);
        let order = Order::new(&rows, [cell_width, chart_rows], [width, height], self.points);
        relaxation.run(CELL_ROUNDS, |ropes| order.tidy(ropes));
        Cell { wide, high, period, rows: relaxation.ropes.into_iter().map(|rope| rope.points).collect() }
    }

    /// A repeat of the chart as it relaxes: what a [`super::tile::Tile`] is made of.
    ///
    /// # Errors
    /// A chart that grows or shrinks has no repeat.
    pub(super) fn relaxed_rows(&self) -> Result<RelaxedRows, ChartError> {
        let width = self.chart.even_width(LARGEST_CELL).filter(|w| w * self.chart.rows() <= LARGEST_CELL);
        let Some(width) = width else {
            let hint = "every row makes as many stitches as it takes, and few rows and stitches repeat";
            return Err(ChartError::new(None, "a chart with shaping has no repeat that could be laid", hint));
        };
        let Cell { wide, high, period, rows } = self.cell(width, self.gauge());
        Ok(RelaxedRows { period, counts: [wide, high], rows })
    }

    /// Lays a relaxed cell out over the piece.
    fn repeat_cell(&self, cell_width: u32, [width, height]: [f64; 2]) -> Vec<Course> {
        let Cell { wide, high, period, rows: cell } = self.cell(cell_width, [width, height]);
        let per_stitch = self.points as usize;
        let per_row = wide as usize * per_stitch;
        let total = DVec2::new(f64::from(self.stitches) * width, f64::from(self.rows) * height);
        let round = self.form == Form::Tube;
        let radius = total.x / TAU;
        let count = self.stitches as usize * per_stitch;
        (0..self.rows)
            .map(|row| {
                let own = &cell[(row % high) as usize];
                let up = f64::from(row / high) * period.y;
                let last = if round { count } else { count + 1 };
                let mut course = Course::new(last, round);
                for i in 0..last {
                    // Cells begin at their left border, pieces at their middle.
                    let p = own[i % per_row] + DVec3::new((i / per_row) as f64 * period.x, up, 0.0);
                    let place = if round {
                        let (sin, cos) = (TAU * (p.x / total.x)).sin_cos();
                        DVec3::new((radius + p.z) * sin, p.y, (radius + p.z) * cos)
                    } else {
                        DVec3::new(p.x - 0.5 * total.x, p.y - 0.5 * total.y, p.z)
                    };
                    course.push(place, i as f64 / per_stitch as f64, row, self.points, i);
                }
                course
            })
            .collect()
    }

    /// Relaxes a whole piece.
    fn relax_whole(&self, rows: &[Vec<Stitch>], surface: &Surface) -> Vec<Course> {
        let round = matches!(surface, Surface::Round { .. });
        let layout = Layout::new(rows, round, false);
        let (cells, of_row) = self.cells_of_rows(rows);
        let mut relaxation = self.begin(rows, &layout, surface, &|r| of_row[r].map(|c| &cells[c]));
        relaxation.run(PIECE_ROUNDS, |_| {});
        let shift = match surface {
            Surface::Plane { width, height } => DVec3::new(-0.5 * width, -0.5 * height * rows.len() as f64, 0.0),
            Surface::Round { .. } => DVec3::ZERO,
        };
        let ropes = &relaxation.ropes;
        ropes
            .iter()
            .enumerate()
            .map(|(row, rope)| {
                let mut course = Course::new(rope.points.len(), round);
                for (i, &p) in rope.points.iter().enumerate() {
                    let wale = i as f64 / f64::from(self.points);
                    course.push(p + shift, wale, row as u32, self.points, i);
                }
                course
            })
            .collect()
    }

    /// Cells already relaxed for rows that are above and below their like, and which row takes which.
    fn cells_of_rows(&self, rows: &[Vec<Stitch>]) -> (Vec<Cell>, Vec<Option<usize>>) {
        const MOST_KINDS: usize = 6;
        let kinds: Vec<Option<Vec<bool>>> = rows.iter().map(|r| column_signs(r)).collect();
        let mut known: Vec<Vec<bool>> = Vec::new();
        let of_row = (0..rows.len())
            .map(|r| {
                let kind = kinds[r].as_ref()?;
                let alike =
                    |other: Option<usize>| other.and_then(|o| kinds.get(o)).is_none_or(|k| k.as_ref() == Some(kind));
                if !alike(r.checked_sub(1)) || !alike(Some(r + 1)) {
                    return None;
                }
                known.iter().position(|k| k == kind).or_else(|| {
                    known.push(kind.clone());
                    (known.len() <= MOST_KINDS).then(|| known.len() - 1)
                })
            })
            .collect();
        let cell = |kind: &Vec<bool>| {
            let row: Vec<&str> = kind.iter().map(|purl| if *purl { "p" } else { "k" }).collect();
            let knit = Self { chart: Chart::parse(&[row.join(" ")]).ok()?, form: Form::Flat, ..self.clone() };
            Some(knit.cell(kind.len() as u32, knit.gauge()))
        };
        known.truncate(MOST_KINDS);
        (known.par_iter().filter_map(cell).collect(), of_row)
    }

    /// The stitches on the surface: in their closed form, or as `cell` has them for their row.
    fn begin<'a>(
        &self,
        rows: &[Vec<Stitch>],
        layout: &Layout,
        surface: &Surface,
        cell: &(dyn Fn(usize) -> Option<&'a Cell> + Sync),
    ) -> Relaxation {
        let rope = |(r, row): (usize, &Vec<Stitch>)| {
            let (mut points, mut pinned) = (Vec::new(), Vec::new());
            let relaxed = cell(r);
            for (j, stitch) in row.iter().enumerate() {
                let form = layout.form(rows, r, j);
                let own = relaxed.filter(|_| stitch.parents < 2 && stitch.layer == 0);
                let extra = u32::from(!layout.ring && j + 1 == row.len());
                for k in 0..self.points + extra {
                    let t = TAU * f64::from(k) / f64::from(self.points);
                    let base = own.map(|cell| cell.stitch(j, k, self.points));
                    points.push(surface.place(&form.at(t, base, surface, row.len())));
                    // What nothing holds stays put: the feet of the first row and the heads of the last.
                    let head = 0.5 * (1.0 - t.cos());
                    pinned.push(!layout.periodic && ((r == 0 && head < 0.1) || (r + 1 == rows.len() && head > 0.9)));
                }
            }
            let ends = if layout.ring { Ends::Joined(DVec3::ZERO) } else { Ends::Open };
            Rope { points, pinned, ends, rest: self.yarn_per_stitch / f64::from(self.points) }
        };
        Relaxation { ropes: rows.par_iter().enumerate().map(rope).collect(), period: None }
    }
}

/// Knit or purl along a row, once around its repeat, if that is short.
fn column_signs(row: &[Stitch]) -> Option<Vec<bool>> {
    const LONGEST: usize = 12;
    let repeats = |n: &usize| (0..row.len()).all(|j| row[j].purl == row[j % n].purl);
    let n = (1..=LONGEST.min(row.len())).find(repeats)?;
    Some(row[..n].iter().map(|s| s.purl).collect())
}

/// Relaxed cloth with periodic borders.
struct Cell {
    /// Stitches of a row, and rows.
    wide: u32,
    high: u32,
    period: DVec2,
    /// Points of each row; it begins at the left border of the first stitch, half a row above the lower border.
    rows: Vec<Vec<DVec3>>,
}

impl Cell {
    /// Point k of stitch j of the first row: across and up from the stitch's middle in widths and heights of a stitch, and
    /// out in diameters.
    fn stitch(&self, j: usize, k: u32, points: u32) -> DVec3 {
        let j = j % self.wide as usize;
        let per_row = (self.wide * points) as usize;
        let i = j * points as usize + k as usize;
        let p = self.rows[0][i % per_row] + DVec3::X * (i / per_row) as f64 * self.period.x;
        let (width, height) = (self.period.x / f64::from(self.wide), self.period.y / f64::from(self.high));
        DVec3::new(p.x / width - (j as f64 + 0.5), p.y / height - 0.5, p.z)
    }
}

/// What a relaxed cell must keep of its chart: equal stitches are equal.
struct Order {
    /// Stitches and rows of the cell, and of the chart.
    size: [usize; 2],
    chart: [usize; 2],
    gauge: [f64; 2],
    points: usize,
}

impl Order {
    fn new(rows: &[Vec<Stitch>], chart: [u32; 2], gauge: [f64; 2], points: u32) -> Self {
        Self { size: [rows[0].len(), rows.len()], chart: chart.map(|c| c as usize), gauge, points: points as usize }
    }

    fn tidy(&self, ropes: &mut [Rope]) {
        let [n, rows] = self.size;
        let per_row = n * self.points;
        let [wide, high] = [self.chart[0] * self.points, self.chart[1]];
        let step = DVec3::new(self.chart[0] as f64 * self.gauge[0], self.chart[1] as f64 * self.gauge[1], 0.0);
        let (across, up) = (per_row / wide, rows / high);
        for r in 0..high {
            for i in 0..wide {
                let copies = || (0..up).flat_map(move |b| (0..across).map(move |a| (a, b)));
                let place = |(a, b): (usize, usize)| (r + b * high, i + a * wide);
                let moved = |(a, b): (usize, usize)| DVec3::new(a as f64 * step.x, b as f64 * step.y, 0.0);
                let at = |c| {
                    let (row, point) = place(c);
                    ropes[row].points[point] - moved(c)
                };
                let mean = copies().map(at).sum::<DVec3>() / (across * up) as f64;
                for c in copies() {
                    let (row, point) = place(c);
                    ropes[row].points[point] = mean + moved(c);
                }
            }
        }
    }
}

/// One row as it was made.
struct Course {
    points: Vec<DVec3>,
    coordinates: Vec<[f32; 2]>,
    closed: bool,
}

impl Course {
    fn new(count: usize, closed: bool) -> Self {
        Self { points: Vec::with_capacity(count), coordinates: Vec::with_capacity(count), closed }
    }

    fn push(&mut self, point: DVec3, wale: f64, row: u32, per_stitch: u32, i: usize) {
        // A loop reaches from the middle of the row below to the middle of the row above.
        let head = 0.5 - 0.5 * (TAU * (i as f64 / f64::from(per_stitch))).cos();
        self.points.push(point);
        self.coordinates.push([wale as f32, (f64::from(row) + head) as f32]);
    }
}

/// Where stitches are laid out. `across` is a share of the width or of a turn.
enum Surface {
    Plane { width: f64, height: f64 },
    Round { revolution: Revolution, height: f64 },
}

/// A place before it is laid on the surface: share of the width, plus diameters across, up from the first row, out.
struct SheetPoint {
    share: f64,
    across: f64,
    up: f64,
    out: f64,
}

impl Surface {
    fn height(&self) -> f64 {
        match self {
            Self::Plane { height, .. } | Self::Round { height, .. } => *height,
        }
    }

    /// Width of the whole cloth at a height, in diameters.
    fn width(&self, up: f64) -> f64 {
        match self {
            Self::Plane { width, .. } => *width,
            Self::Round { revolution, .. } => TAU * revolution.radius(up),
        }
    }

    fn place(&self, p: &SheetPoint) -> DVec3 {
        match self {
            Self::Plane { width, .. } => DVec3::new(p.share * width + p.across, p.up, p.out),
            Self::Round { revolution, .. } => {
                revolution.place(p.share + p.across / (TAU * revolution.radius(p.up)), p.up, p.out)
            }
        }
    }
}

/// Where stitches are across the cloth, and how they hang together.
struct Layout {
    /// Share of the width of each stitch's middle.
    middle: Vec<Vec<f64>>,
    /// Stitches drawn through each: the first, and how many; cables and decreases make no other pattern.
    children: Vec<Vec<(u32, u8)>>,
    /// Whether the last stitch of a row is beside the first.
    ring: bool,
    /// Whether the last row is below the first.
    periodic: bool,
}

/// A stitch's own numbers, from which its curve follows.
struct StitchForm {
    share: f64,
    row: usize,
    /// Shares of the width by which feet and head lean; at the feet's outer ends half way to the neighbours'.
    foot: [f64; 3],
    head: f64,
    /// 1 to the front, -1 to the back: at feet (left end, own, right end) and head.
    foot_sign: [f64; 3],
    head_sign: f64,
    /// How far out: feet (left end, own, right end), middle, head.
    foot_out: [f64; 3],
    out: f64,
    head_out: f64,
    /// How far the feet reach down and how deep they dive, against a plain stitch.
    foot_reach: f64,
    foot_depth: f64,
}

fn sign(stitch: &Stitch) -> f64 {
    if stitch.purl { -1.0 } else { 1.0 }
}

/// Difference of two shares, the short way round.
fn short(d: f64, ring: bool) -> f64 {
    if ring { d - d.round() } else { d }
}

fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// How far cables part in depth, and stitches worked together.
const CABLE_OUT: f64 = 1.1;
const TOGETHER_OUT: f64 = 0.55;
/// How far knit columns come forward where they alternate with purl ones.
const RIB_OUT: f64 = 0.35;

impl Layout {
    fn new(rows: &[Vec<Stitch>], ring: bool, periodic: bool) -> Self {
        let middle = rows.iter().map(|r| (0..r.len()).map(|j| (j as f64 + 0.5) / r.len() as f64).collect()).collect();
        let mut children: Vec<Vec<(u32, u8)>> = rows.iter().map(|r| vec![(0, 0); r.len()]).collect();
        for (r, row) in rows.iter().enumerate() {
            let below = if r > 0 { r - 1 } else { rows.len() - 1 };
            if r == 0 && !periodic {
                continue;
            }
            for (j, stitch) in row.iter().enumerate() {
                for p in stitch.first_parent..stitch.first_parent + u32::from(stitch.parents) {
                    let child = &mut children[below][p as usize];
                    *child = if child.1 == 0 { (j as u32, 1) } else { (child.0, child.1 + 1) };
                }
            }
        }
        let mut layout = Self { middle, children, ring, periodic };
        if rows.iter().flatten().any(|s| s.layer != 0) {
            layout.spread(rows);
        }
        layout
    }

    fn below(&self, r: usize) -> Option<usize> {
        if r > 0 { Some(r - 1) } else { self.periodic.then(|| self.middle.len() - 1) }
    }

    fn above(&self, r: usize) -> Option<usize> {
        if r + 1 < self.middle.len() { Some(r + 1) } else { self.periodic.then_some(0) }
    }

    /// Lets cables draw their neighbourhood along: each stitch between its neighbours, its parents and its children.
    fn spread(&mut self, rows: &[Vec<Stitch>]) {
        const ROUNDS: usize = 6;
        const LINKS: f64 = 0.3;
        for _ in 0..ROUNDS {
            let mut next = self.middle.clone();
            for (r, row) in rows.iter().enumerate() {
                let n = row.len();
                let own = &self.middle[r];
                for j in 0..n {
                    let (mut sum, mut count) = (0.0, 0.0);
                    if let (Some(below), true) = (self.below(r), row[j].parents > 0) {
                        sum += short(self.parent_middle(below, &row[j]) - own[j], self.ring);
                        count += 1.0;
                    }
                    let (child, held) = self.children[r][j];
                    if let (Some(above), true) = (self.above(r), held > 0) {
                        sum += short(self.middle[above][child as usize] - own[j], self.ring);
                        count += 1.0;
                    }
                    let neighbour = |k: isize| {
                        let other = (j as isize + k).rem_euclid(n as isize) as usize;
                        short(own[other] - own[j] - k as f64 / n as f64, true)
                    };
                    let beside = match (self.ring, j) {
                        (false, 0) => neighbour(1),
                        (false, j) if j + 1 == n => neighbour(-1),
                        _ => 0.5 * (neighbour(-1) + neighbour(1)),
                    };
                    next[r][j] += LINKS * if count > 0.0 { sum / count } else { 0.0 } + (1.0 - LINKS) * 0.5 * beside;
                }
            }
            self.middle = next;
        }
    }

    fn parent_middle(&self, below: usize, stitch: &Stitch) -> f64 {
        let at = |p: u32| self.middle[below][p as usize];
        let first = at(stitch.first_parent);
        let last = at(stitch.first_parent + u32::from(stitch.parents.max(1)) - 1);
        first + 0.5 * short(last - first, self.ring)
    }

    /// How far left or right of its middle a stitch's feet are: half way to what they are drawn through.
    fn foot(&self, rows: &[Vec<Stitch>], r: usize, j: usize) -> f64 {
        let stitch = &rows[r][j];
        match self.below(r) {
            Some(below) if stitch.parents > 0 => {
                0.5 * short(self.parent_middle(below, stitch) - self.middle[r][j], self.ring)
            }
            _ => 0.0,
        }
    }

    fn form(&self, rows: &[Vec<Stitch>], r: usize, j: usize) -> StitchForm {
        let row = &rows[r];
        let n = row.len();
        let stitch = &row[j];
        let beside = |k: isize| {
            let other = j as isize + k;
            if self.ring { other.rem_euclid(n as isize) as usize } else { other.clamp(0, n as isize - 1) as usize }
        };
        let foot_layer = |s: &Stitch| f64::from(s.layer) * CABLE_OUT;
        let around = |of: &dyn Fn(usize) -> f64| {
            let own = of(j);
            [0.5 * (own + of(beside(-1))), own, 0.5 * (own + of(beside(1)))]
        };
        let (child, held) = self.children[r][j];
        let child = self.above(r).filter(|_| held > 0).map(|above| (above, child as usize));
        let (mut head, mut head_sign, mut head_out, mut child_layer) = (0.0, sign(stitch), 0.0, 0.0);
        if let Some((above, c)) = child {
            let s = &rows[above][c];
            let last = c + usize::from(held) - 1;
            // Where the child's feet are is where this head is.
            let at = |c: usize| self.middle[above][c] + self.foot(rows, above, c);
            head = short(at(c) - self.middle[r][j], self.ring) + 0.5 * short(at(last) - at(c), self.ring);
            head_sign = sign(s);
            child_layer = foot_layer(s);
            head_out = child_layer;
            if s.parents == 2 {
                let left = s.first_parent as usize == j;
                head_out += if left == s.left_on_top { TOGETHER_OUT } else { -TOGETHER_OUT };
            }
        }
        let plain_foot = |k: usize| if row[k].parents == 2 { 1.5 } else { 1.0 };
        StitchForm {
            share: self.middle[r][j],
            row: r,
            foot: around(&|k| self.foot(rows, r, k)),
            head,
            foot_sign: around(&|k| sign(&row[k])),
            head_sign,
            foot_out: around(&|k| foot_layer(&row[k])),
            out: 0.5 * (foot_layer(stitch) + child_layer),
            head_out,
            foot_reach: if stitch.parents == 0 && self.below(r).is_some() { 0.3 } else { 1.0 },
            foot_depth: plain_foot(j),
        }
    }
}

impl StitchForm {
    /// The curve at `t`: 0 and 2 pi between stitches, pi at the head. `relaxed` is its place in a plain stitch, as
    /// [`Cell::stitch`] gives it, if that is known.
    fn at(&self, t: f64, relaxed: Option<DVec3>, surface: &Surface, stitches: usize) -> SheetPoint {
        // Shape of the densest plain stitch of this form whose strands keep apart, found by a search: how far a loop
        // reaches up and down, leans out and dives, for a stitch 4.13 wide and rows 2.28 apart.
        const REACH: f64 = 1.915 / 2.28;
        const LEAN: f64 = 0.982 / 4.13;
        const DEPTH: f64 = 0.763;
        let height = surface.height();
        let middle = (self.row as f64 + 0.5) * height;
        let width = surface.width(middle) / stitches as f64;
        let (cos, sin2, cos2) = (t.cos(), (2.0 * t).sin(), (2.0 * t).cos());
        let head = 0.5 * (1.0 - cos);
        let upper = smooth((head - 0.3) / 0.4);
        // Near its ends a foot goes over into the neighbour's.
        let inside = smooth(t.min(TAU - t) / (TAU / 6.0));
        let end = if t < 0.5 * TAU { 0 } else { 2 };
        let mixed = |v: &[f64; 3]| v[end] + (v[1] - v[end]) * inside;
        let mix = |low: f64, high: f64| low + (high - low) * upper;
        let foot_reach = if cos > 0.0 { self.foot_reach } else { 1.0 };
        let depth = DEPTH * mix(self.foot_depth, 1.0) * mix(mixed(&self.foot_sign), self.head_sign);
        let out = if head < 0.5 {
            let x = smooth(2.0 * head);
            mixed(&self.foot_out) * (1.0 - x) + self.out * x
        } else {
            let x = smooth(2.0 * head - 1.0);
            self.out * (1.0 - x) + self.head_out * x
        };
        let share = self.share + mix(mixed(&self.foot), self.head);
        if let Some(p) = relaxed {
            return SheetPoint { share, across: width * p.x, up: middle + height * p.y, out: p.z + out };
        }
        let rib = RIB_OUT * mixed(&self.foot_sign);
        SheetPoint {
            share,
            across: width * (t / TAU - 0.5) + LEAN * width.min(4.13) * sin2,
            up: middle - REACH * height * foot_reach * cos,
            out: out + rib - depth * cos2,
        }
    }
}

#[cfg(test)]
mod tests;
