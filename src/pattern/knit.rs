//! Knitted cloth: loops drawn through loops, as a chart says, on a flat piece, a tube or a surface of revolution.
//!
//! A chart becomes loops, each with what it is drawn through (`loops`); these become curves that cross on the right side of
//! each other (`shape`); the curves are relaxed as elastic rods, cloth that repeats as one cell with periodic borders that
//! finds its own gauge (`cell`); and a piece is put together, with one yarn from row to row and finished edges (`piece`), as
//! large as is asked for (`size`).
//! Last, yarns are pressed flat where they lie on each other (`pressed`). Inside this folder the unit is the distance at which the centre lines
//! of two yarns touch: the diameter of yarn that stays round ([`Thickness`]).

mod cell;
mod colors;
mod curl;
mod loops;
mod piece;
mod pressed;
mod rims;
mod shape;
mod short_rows;
mod size;

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

pub(crate) use self::colors::{Way, caught, in_use};
pub(super) use self::pressed::{Alike, flatten_where_touching};
use self::{
    cell::Cell,
    curl::Curl,
    loops::{Border, Loops},
    piece::{Laying, State, Surface, Thread, ease, settle, sheet::Sheet},
};
pub use self::{
    colors::{Colors, Work},
    rims::{CastOn, Closing, Rims},
    size::{Misfit, ROW_HEIGHTS, STITCH_WIDTHS, Sizes, Thickness, fits_stitch},
};
use super::{
    MAX_POINTS, PatternStrand, StrandKind,
    chart::{Act, Chart, ChartError, Stitch},
    revolution::Revolution,
    rods::Run,
    tile::RelaxedRows,
};
use crate::geometry::curve::{Basis, Curve};

/// What a knit is knitted to.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// In the plane z = 0, centred, right side towards +z; rows go back and forth.
    Flat,
    /// Round about the y axis, right side out, in one spiral. The radius is what the stitches need.
    Tube,
    /// On a surface of revolution about the y axis: the profile from the cast-on edge, radius and height in the unit of
    /// the diameter. Its right side is to the right of the way along the profile.
    Revolution(Vec<DVec2>),
}

/// How a piece begins and ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Edges {
    /// Cast on (long-tail) and bound off.
    #[default]
    Finished,
    /// The same, and the first stitch of each row of a flat piece is slipped: a chain along both sides.
    Slipped,
    /// Open loops at the top, nothing below the first row.
    Live,
    /// No edges at all: a flat patch whose rows are yarns that go on at one border as they begin at the other.
    Tile,
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
    /// How it begins and ends.
    pub edges: Edges,
    /// How a finished piece is cast on and closed at its top.
    pub rims: Rims,
    /// Width of a stitch in units; what the pattern draws itself to if absent.
    pub stitch_width: Option<f64>,
    /// Distance between rows in units, likewise.
    pub row_height: Option<f64>,
    /// Length of yarn in a stitch, in units; what suits the gauge if absent.
    pub yarn_per_stitch: Option<f64>,
    /// Control points of a stitch.
    pub points: u32,
    /// Colour work, if there is any: a yarn for each colour.
    pub colors: Option<Colors>,
    /// Whether a flat piece is blocked; else its edges roll as they would by themselves.
    pub flat: bool,
}

/// A piece as it came out.
#[derive(Clone, Debug)]
pub struct Knitted {
    /// Its yarns.
    pub strands: Vec<PatternStrand>,
    /// The colour of each yarn: 0 where there is no colour work.
    pub colors: Vec<u16>,
    /// Width of a stitch and distance between rows.
    pub gauge: [f64; 2],
}

/// Yarn in a stitch of plain knit of middling tightness, in units: Peirce's closed loop has 16.7, firm cloth 14.
pub const YARN_PER_STITCH: f64 = 16.2;
/// Width of a stitch of stockinette as it relaxes, in units.
pub const STITCH_WIDTH: f64 = 4.15;
/// Height of a row of stockinette as it relaxes, in units.
pub const ROW_HEIGHT: f64 = 2.9;
/// Stitches in the square of the length of yarn that one of them has: Munden's constant of fully relaxed plain knit.
pub const STITCHES_PER_SQUARE: f64 = 5.5 * 4.2;
/// Width over height of a yarn's section where stitches press on it, unless asked otherwise.
pub const FLATTEN: f64 = 1.5;
/// Control points of a stitch unless asked otherwise.
pub const POINTS: u32 = 24;

/// The largest cell that is relaxed once and repeated, in stitches.
const LARGEST_CELL: u32 = 2048;
/// Steps for edges, and for a piece that has no cell.
const EDGE_STEPS: usize = 300;
const PIECE_STEPS: usize = 40;
const FINE_STEPS: usize = 8;
const EASE_STEPS: usize = 20;
/// Points of a stitch while a piece without a cell is relaxed.
const COARSE: u32 = 14;

impl Knit {
    /// How many control points the cloth would have at most if it kept its width.
    pub fn control_points(&self) -> u64 {
        self.layers()
            * (u64::from(self.stitches) * u64::from(self.rows) * u64::from(self.points) + u64::from(self.rows))
    }

    fn size(&self) -> [Option<f64>; 2] {
        [self.stitch_width, self.row_height]
    }

    /// Length of yarn in a stitch, in diameters: given, or by Munden what a gauge of both width and height needs.
    fn yarn(&self, size: [Option<f64>; 2]) -> f64 {
        self.yarn_per_stitch.unwrap_or(match size {
            [Some(width), Some(height)] => (STITCHES_PER_SQUARE * width * height).sqrt(),
            _ => YARN_PER_STITCH,
        })
    }

    /// Width and height of a stitch on a profile: the mean of all rows.
    fn size_on(&self, profile: &Revolution, rows: &[Vec<Stitch>]) -> [f64; 2] {
        let height = profile.length() / rows.len() as f64;
        let width =
            |(r, row): (usize, &Vec<Stitch>)| TAU * profile.radius((r as f64 + 0.5) * height) / row.len() as f64;
        [rows.iter().enumerate().map(width).sum::<f64>() / rows.len() as f64, height]
    }

    /// The repeat of the chart, if it has one that fits the stitches.
    fn repeat(&self) -> Option<u32> {
        let wide = self.chart.even_width(LARGEST_CELL)?;
        (u64::from(wide) * u64::from(self.chart.rows()) <= LARGEST_CELL.into()).then_some(wide)
    }

    /// The same, or what is wrong with asking for one.
    fn repeat_for(&self, what: &str) -> Result<u32, ChartError> {
        let hint = "every row makes as many stitches as it takes, and few rows and stitches repeat";
        let problem = || format!("a chart with shaping or short rows has no repeat {what}");
        self.repeat().ok_or_else(|| ChartError::new(None, problem(), hint))
    }

    /// Width of a stitch and distance between rows, in diameters: given, or found by relaxing a repeat of the chart.
    pub fn gauge(&self) -> [f64; 2] {
        if let [Some(width), Some(height)] = self.size() {
            return [width, height];
        }
        match self.repeat() {
            Some(wide) => self.cell(wide, self.size(), self.points).gauge(),
            None => {
                let rows = self.worked().unwrap_or_default();
                let points = if short_rows::any(&rows) { self.points } else { COARSE };
                self.rows_of_a_kind(&rows, self.size(), points).gauge(self.size())
            }
        }
    }

    fn cell(&self, wide: u32, size: [Option<f64>; 2], points: u32) -> Cell {
        Cell::relaxed(&self.chart, wide, self.yarn(size), points, size)
    }

    /// A repeat of the chart as it relaxes: what a [`super::tile::Tile`] is made of. It is large enough that no yarn is
    /// near its own image.
    ///
    /// # Errors
    /// A chart that grows or shrinks has no repeat.
    pub(super) fn relaxed_rows(&self) -> Result<RelaxedRows, ChartError> {
        const SMALLEST: f64 = 9.0;
        let wide = self.repeat_for("that could be laid")?;
        let cell = self.cell(wide, self.size(), self.points);
        let [across, up] = (SMALLEST / cell.period).ceil().max(DVec2::ONE).to_array();
        let row = |r: usize| -> Vec<(DVec3, [f32; 2])> {
            let visits = (cell.visits[r % cell.high as usize].len() - 1) * across as usize;
            (0..visits).flat_map(|k| cell.visit(r, k)).collect()
        };
        Ok(RelaxedRows {
            period: cell.period * DVec2::new(across, up),
            counts: [cell.wide * across as u32, cell.high * up as u32],
            rows: (0..cell.high as usize * up as usize).map(row).collect(),
        })
    }

    /// How many stitches each row has.
    ///
    /// # Errors
    /// A chart that does not fit the stitches or the rows, or that makes too many control points.
    pub fn widths(&self) -> Result<Vec<u32>, ChartError> {
        Ok(self.worked()?.iter().map(|row| row.len() as u32).collect())
    }

    /// The ways of its yarns through its rows, of which the first may go from right to left.
    fn ways(&self, rows: &[Vec<Stitch>], from_right: bool) -> Vec<Way> {
        let (finished, round) = (self.is_finished(), self.form != Form::Flat);
        let one = || Colors { rows: vec![vec![0]; self.rows as usize], work: Work::Stranded, catch: None, carry: 0 };
        let mut ways = self.colors.as_ref().unwrap_or(&one()).ways(finished, round);
        if short_rows::any(rows) {
            short_rows::lead(&mut ways, rows, from_right);
        }
        ways
    }

    /// A patch that repeats, of one colour, centred.
    fn patch(&self, yarn: &Thickness) -> Result<Knitted, ChartError> {
        let diameter = yarn.pressed();
        let wide = self.repeat_for("for a tile")?;
        let high = self.chart.rows();
        if !self.stitches.is_multiple_of(wide) || !self.rows.is_multiple_of(high) {
            let problem = format!("a tile of {} x {} of what repeats over {wide} x {high}", self.stitches, self.rows);
            return Err(ChartError::new(None, problem, "give multiples of these stitches and rows"));
        }
        let cell = self.cell(wide, self.size(), self.points);
        let [width, height] = cell.gauge();
        let size = DVec2::new(f64::from(self.stitches) * width, f64::from(self.rows) * height);
        let row = |r: usize| {
            let visits = (cell.visits[r % high as usize].len() - 1) * (self.stitches / wide) as usize;
            // The first point of the next patch ends it.
            let mut way: Vec<_> = (0..visits).flat_map(|k| cell.visit(r, k)).collect();
            way.extend(cell.visit(r, visits).next());
            let (points, coordinates) =
                way.into_iter().map(|(p, g)| ((p - (0.5 * size).extend(0.0)) * diameter, g)).unzip();
            PatternStrand {
                curve: Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening: None },
                kind: StrandKind::Course,
                index: r as u32,
                coordinates,
                share: 1.0,
            }
        };
        let mut strands: Vec<_> = (0..self.rows as usize).map(row).collect();
        flatten_where_touching(&mut strands, yarn, &Alike::Tile { period: size * diameter, shear: 0.0 });
        Ok(Knitted { colors: vec![0; strands.len()], strands, gauge: [width * diameter, height * diameter] })
    }

    /// The profile that it is knitted to, in yarn diameters, if it has one.
    fn profile(&self, diameter: f64, rows: &[Vec<Stitch>]) -> Result<Option<Revolution>, ChartError> {
        let scaled = match &self.form {
            Form::Revolution(profile) => Some(profile.iter().map(|p| *p / diameter).collect()),
            _ => None,
        };
        let profile = match self.rims.top {
            Closing::BoundOff => scaled,
            Closing::Drawn => Some(rims::drawn(self, scaled, rows)?),
        };
        Ok(profile.map(|points: Vec<DVec2>| Revolution::new(&points)))
    }

    /// What is drawn through what, in all colours.
    fn loops(&self, rows: &[Vec<Stitch>], border: Border, backwards: bool) -> Loops {
        match &self.colors {
            Some(colors) if colors.work == Work::DoubleKnit => Loops::double(rows, border, backwards, colors),
            colors => {
                let mut loops =
                    Loops::bound_off(rows, self.stitches as usize, border, backwards, self.next(rows).as_deref());
                colors.iter().for_each(|colors| loops.dye(colors));
                loops
            }
        }
    }

    /// The row that would come above the last one, of a chart that repeats, where each of its stitches is drawn through one
    /// of that row: what is bound off goes on in the pattern.
    fn next(&self, rows: &[Vec<Stitch>]) -> Option<Vec<Stitch>> {
        let bound_off = self.is_finished() && self.rims.top == Closing::BoundOff && self.repeat().is_some();
        let last = rows.last().filter(|_| bound_off)?;
        let next = self.chart.work(self.stitches, self.rows + 1, u64::MAX).ok()?.pop()?;
        let is_plain = |s: &Stitch| s.act == Act::Draw && s.parents == 1 && s.layer == 0 && !s.twisted;
        (next.len() == last.len() && next.iter().all(is_plain)).then_some(next)
    }

    fn worked(&self) -> Result<Vec<Vec<Stitch>>, ChartError> {
        let mut rows =
            self.chart.work(self.stitches, self.rows, MAX_POINTS / (self.layers() * u64::from(self.points)).max(1))?;
        short_rows::turned(&mut rows, self)?;
        if self.has_tucks() {
            // Beyond the last stitch nothing holds a yarn over: without it these make a chain along the side.
            for r in 0..rows.len() {
                for side in [0, rows[r].len().saturating_sub(1)] {
                    let stitch = |row: &Vec<Stitch>| row.get(side).copied();
                    let is_drawn = |s: &Stitch| s.act == Act::Draw;
                    if rows[r].len() > 2 && rows[r][side].act == Act::Tuck {
                        let worked = rows[r..].iter().chain(rows[..r].iter().rev()).filter_map(stitch).find(is_drawn);
                        // The yarn passes where the chain is not seen.
                        rows[r][side].act = Act::Pass { front: worked.is_some_and(|s| s.purl) };
                    }
                }
            }
        }
        if self.has_slipped_sides() {
            let right = short_rows::from_right(&rows, self.is_finished());
            // Rows begin on the left and on the right by turns. The first one holds the cast-on edge.
            for (r, row) in rows.iter_mut().enumerate().skip(1).filter(|(_, row)| row.len() > 2) {
                let first = if (r % 2 == 1) == right { 0 } else { row.len() - 1 };
                if row[first].act == Act::Draw && row[first].parents == 1 && row[first].layer == 0 {
                    row[first].act = Act::Pass { front: false };
                }
            }
        }
        Ok(rows)
    }

    fn is_finished(&self) -> bool {
        matches!(self.edges, Edges::Finished | Edges::Slipped)
    }

    fn has_slipped_sides(&self) -> bool {
        self.edges == Edges::Slipped && self.form == Form::Flat
    }

    /// Whether a flat piece with sides has tucks, which come to them.
    fn has_tucks(&self) -> bool {
        self.is_finished() && self.form == Form::Flat && self.chart.has_tucks()
    }

    fn is_double(&self) -> bool {
        self.colors.as_ref().is_some_and(|c| c.work == Work::DoubleKnit)
    }

    fn layers(&self) -> u64 {
        if self.is_double() { 2 } else { 1 }
    }

    /// What cannot be knitted together.
    fn check(&self) -> Result<(), ChartError> {
        let slipped = self.edges == Edges::Slipped;
        let plain = Chart::named("stockinette").is_some_and(|plain| plain == self.chart);
        let wrong = match &self.colors {
            _ if slipped && self.form != Form::Flat => {
                ("what is knitted round has no sides to slip", "edges = \"finished\"")
            }
            Some(_) if slipped => (
                "slipped sides are knitted of one yarn",
                "edges = \"finished\" where several yarns come and go at the sides",
            ),
            Some(colors) if colors.work == Work::DoubleKnit => match self.form {
                _ if colors.rows.iter().flatten().any(|c| *c > 1) => {
                    ("double knitting takes two colours, one for each layer", "a third is knitted with \"stranded\"")
                }
                _ if self.edges == Edges::Tile => {
                    ("a tile is of one yarn in each row, and double knitting of two", "leave out `tile`")
                }
                _ if !plain => {
                    ("both sides of double knitting are stockinette", "leave out `pattern`, `chart` and `instructions`")
                }
                Form::Revolution(_) => {
                    ("both layers of double knitting have the same rows and stitches", "form = \"flat\" or \"tube\"")
                }
                _ => return Ok(()),
            },
            _ if self.flat => return Ok(()),
            _ if self.form != Form::Flat || self.edges == Edges::Tile => {
                ("only flat pieces with edges are blocked or curl", "leave out `flat`")
            }
            _ if self.repeat().is_none() => {
                ("how a chart with shaping curls is not known: it has no repeat", "leave out `flat`")
            }
            _ => return Ok(()),
        };
        Err(ChartError::new(None, wrong.0, wrong.1))
    }

    /// The yarns of the piece, round and `diameter` apart where they touch.
    ///
    /// # Errors
    /// A chart that does not fit the stitches or the rows, or that makes too many control points.
    pub fn strands(&self, diameter: f64) -> Result<Vec<PatternStrand>, ChartError> {
        Ok(self.knitted(diameter)?.strands)
    }

    /// The piece, as [`Self::strands`].
    ///
    /// # Errors
    /// The chart does not fit the stitches, or asks for more than [`MAX_POINTS`] control points.
    pub fn knitted(&self, diameter: f64) -> Result<Knitted, ChartError> {
        let yarn = Thickness::round(0.5 * diameter);
        self.pressed(&yarn)
    }

    /// The piece of yarn of a thickness, pressed flat where stitches lie on each other.
    ///
    /// # Errors
    /// As [`Self::knitted`].
    pub fn pressed(&self, yarn: &Thickness) -> Result<Knitted, ChartError> {
        self.check()?;
        let diameter = yarn.pressed();
        if self.edges == Edges::Tile {
            return self.patch(yarn);
        }
        let rows = self.worked()?;
        let finished = self.is_finished();
        let round = self.form != Form::Flat;
        let rims = self.rims;
        let mirrored = short_rows::from_right(&rows, finished);
        let border = Border { round: round.then_some(1.0), stacked: false, turns: round, finished, rims, mirrored };
        let ways = self.ways(&rows, mirrored);
        let backwards = ways.iter().flat_map(|w| &w.rows).any(|s| s.row == rows.len() as i32 && s.backwards);
        let mut loops = self.loops(&rows, border, backwards);
        let profile = self.profile(diameter, &rows)?;
        let size = profile.as_ref().map_or(self.size(), |p| self.size_on(p, &rows).map(Some));
        let cell =
            self.repeat().map(|wide| self.cell(wide, size, if profile.is_some() { COARSE } else { self.points }));
        let back = cell.as_ref().filter(|_| self.is_double()).map(Cell::turned);
        loops.apart = if self.is_double() { cell.as_ref().map_or(0.0, Cell::touching) } else { 0.0 };
        let even = cell.is_some() && profile.is_none();
        let points = if even || short_rows::any(&rows) { self.points } else { COARSE };
        let kinds = if cell.is_none() { self.rows_of_a_kind(&rows, size, points) } else { Kinds::default() };
        let [width, height] = cell.as_ref().map_or_else(|| kinds.gauge(size), Cell::gauge);
        let count = f64::from(self.rows);
        let surface = match (&self.form, profile) {
            (_, Some(revolution)) => Surface::Round { revolution, height },
            (Form::Tube, _) => Surface::Round { revolution: piece::tube(self.stitches, width, count, height), height },
            _ if !loops.levels().is_empty() => Surface::Bent(Sheet::relaxed(loops.levels(), &rows, [width, height])),
            _ => Surface::Plane { width, height },
        };
        let cell_of = |row: usize| match &cell {
            _ if row >= rows.len() => None,
            Some(cell) => Some((cell, row)),
            None => kinds.of_row.get(row).copied().flatten().map(|k| (&kinds.cells[k], 0)),
        };
        let laying = Laying {
            loops: &loops,
            surface: &surface,
            cells: &cell_of,
            back: back.as_ref(),
            even,
            own_cells: cell.is_some(),
            slipped: self.has_slipped_sides() || self.has_tucks(),
            yarn: self.yarn(size),
            points,
        };
        let mut threads = laying.threads(&ways);
        if even {
            settle(&mut threads, &finding_room(EDGE_STEPS, 0.6));
        } else {
            let run = finding_room(PIECE_STEPS, 0.8);
            settle(&mut threads, &run);
            threads.iter_mut().for_each(|t| t.refine(f64::from(self.points) / f64::from(points)));
            let run = Run { growing: 0, ..run };
            settle(&mut threads, &Run { steps: FINE_STEPS, firm: 4.0, ..run });
            ease(&mut threads, self.points as usize, yarn.radius / diameter, &Run { steps: EASE_STEPS, ..run });
        }
        let shift = match &surface {
            Surface::Plane { height, .. } => DVec3::new(0.0, -0.5 * height * count, 0.0),
            Surface::Round { .. } | Surface::Bent(_) => DVec3::ZERO,
        };
        if let (false, Some(cell)) = (self.flat || self.is_double(), &cell) {
            let curl = Curl::of(cell, DVec2::new(width * f64::from(self.stitches), height * count));
            roll_up(&mut threads, &curl, shift);
        }
        let alike = match &cell {
            Some(cell) if even && yarn.flatten != 1.0 && matches!(surface, Surface::Plane { .. }) && self.flat => {
                self.alike(cell, &threads)
            }
            _ => Alike::No,
        };
        let strand = |(index, thread): (usize, Thread)| PatternStrand {
            curve: Curve {
                basis: Basis::CatmullRom,
                closed: false,
                points: thread.points.into_iter().map(|p| (p + shift) * diameter).collect(),
                radii: None,
                flattening: None,
            },
            kind: StrandKind::Course,
            index: index as u32,
            coordinates: thread.grid,
            share: 1.0,
        };
        let mut strands: Vec<_> = threads.into_iter().enumerate().map(strand).collect();
        flatten_where_touching(&mut strands, yarn, &alike);
        let colors = ways.iter().map(|w| w.color).collect();
        Ok(Knitted { strands, colors, gauge: [width * diameter, height * diameter] })
    }

    /// Which points of a flat piece lie alike: those that rest where their cell has them, in stitches around which all do.
    fn alike(&self, cell: &Cell, threads: &[Thread]) -> Alike {
        // As far as a loop reaches, and one more.
        const AROUND: i32 = 2;
        if self.colors.is_some() {
            return Alike::No;
        }
        let [wide, high] = [self.stitches as i32, self.rows as i32];
        let stitch = |grid: &[f32; 2]| [grid[0].floor() as i32, grid[1].floor() as i32];
        let inside = |x: i32, y: i32| (0..wide).contains(&x) && (0..high).contains(&y);
        let at = |x: i32, y: i32| y as usize * wide as usize + x as usize;
        // Whether a stitch, and then whether all around it, rests.
        let mut rests = vec![true; wide as usize * high as usize];
        for thread in threads {
            for (grid, _) in thread.grid.iter().zip(&thread.state).filter(|(_, state)| **state != State::Rest) {
                let [x, y] = stitch(grid);
                if inside(x, y) {
                    rests[at(x, y)] = false;
                }
            }
        }
        let deep = |x: i32, y: i32| {
            let mut around = (y - AROUND..=y + AROUND).flat_map(|y| (x - AROUND..=x + AROUND).map(move |x| (x, y)));
            around.all(|(x, y)| inside(x, y) && rests[at(x, y)])
        };
        let deep: Vec<bool> =
            (0..rests.len()).into_par_iter().map(|i| deep(i as i32 % wide, i as i32 / wide)).collect();
        let kind = |(grid, point): (&[f32; 2], &DVec3)| {
            let [x, y] = stitch(grid);
            if !inside(x, y) || !deep[at(x, y)] {
                return pressed::ALONE;
            }
            // Copies differ by less than this in what rounding makes of them.
            let part = |v: f32, of: u32| (f64::from(v).rem_euclid(of.into()) * 1024.0).round() as u64;
            part(grid[0], cell.wide) << 42 | part(grid[1], cell.high) << 20 | ((point.z + 64.0) * 4096.0) as u64
        };
        let of_thread = |thread: &Thread| thread.grid.iter().zip(&thread.points).map(kind).collect::<Vec<_>>();
        Alike::Points(threads.iter().flat_map(of_thread).collect())
    }

    /// Cells for rows of knit and purl columns that are above and below their like: what a shaped piece begins with.
    fn rows_of_a_kind(&self, rows: &[Vec<Stitch>], size: [Option<f64>; 2], points: u32) -> Kinds {
        const MOST_KINDS: usize = 6;
        let kinds: Vec<Option<Vec<bool>>> = rows.iter().map(|r| column_signs(r)).collect();
        let mut known: Vec<Vec<bool>> = Vec::new();
        let of_row: Vec<Option<usize>> = (0..rows.len())
            .map(|r| {
                let kind = kinds[r].as_ref()?;
                let alike =
                    |other: Option<usize>| other.and_then(|o| kinds.get(o)).is_none_or(|k| k.as_ref() == Some(kind));
                if !alike(r.checked_sub(1)) || !alike(Some(r + 1)) {
                    return None;
                }
                known.iter().position(|k| k == kind).or_else(|| {
                    (known.len() < MOST_KINDS).then(|| {
                        known.push(kind.clone());
                        known.len() - 1
                    })
                })
            })
            .collect();
        if known.is_empty() {
            known.push(vec![false]);
        }
        let cell = |kind: &Vec<bool>| {
            let row: Vec<&str> = kind.iter().map(|purl| if *purl { "p" } else { "k" }).collect();
            let chart = Chart::parse(&[row.join(" ")]).expect("knits and purls are a chart");
            Cell::relaxed(&chart, kind.len() as u32, self.yarn(size), points, size)
        };
        Kinds { cells: known.par_iter().map(cell).collect(), of_row }
    }
}

/// How the yarns of a piece relax, which begin so thin.
fn finding_room(steps: usize, thin: f64) -> Run {
    Run { steps, growing: steps / 3, thin, free: [false; 2], load: DVec2::ZERO, press: 0.0, firm: 2.0, calm: 0.02 }
}

/// Lays a piece as it curls; then its yarns find room.
fn roll_up(threads: &mut [Thread], curl: &Curl, to_middle: DVec3) {
    if curl.is_flat() {
        return;
    }
    for thread in threads.iter_mut() {
        thread.points.iter_mut().for_each(|p| *p = curl.place(*p + to_middle) - to_middle);
        thread.state.fill(State::Move);
    }
    settle(threads, &Run { growing: 0, ..finding_room(PIECE_STEPS, 1.0) });
}

/// Cells of rows that are alike, and which row takes which.
#[derive(Default)]
struct Kinds {
    cells: Vec<Cell>,
    of_row: Vec<Option<usize>>,
}

impl Kinds {
    /// That of the cell that most rows take, unless it is given.
    fn gauge(&self, given: [Option<f64>; 2]) -> [f64; 2] {
        let count = |k: usize| self.of_row.iter().filter(|o| **o == Some(k)).count();
        let most = (0..self.cells.len()).max_by_key(|&k| (count(k), std::cmp::Reverse(k)));
        let own = most.map_or([4.0, 2.8], |k| self.cells[k].gauge());
        [0, 1].map(|c| given[c].unwrap_or(own[c]))
    }
}

/// Knit or purl along a row, once around its repeat, if that is short.
fn column_signs(row: &[Stitch]) -> Option<Vec<bool>> {
    const LONGEST: usize = 12;
    let repeats = |n: &usize| (0..row.len()).all(|j| row[j].purl == row[j % n].purl);
    let n = (1..=LONGEST.min(row.len())).find(repeats)?;
    Some(row[..n].iter().map(|s| s.purl).collect())
}

#[cfg(test)]
mod tests;
