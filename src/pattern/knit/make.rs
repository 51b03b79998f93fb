//! A piece from its rows to its yarns: loops are laid out and relaxed, edges roll, and yarns are pressed.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{
    COARSE, Closing, Colors, Edges, Form, Knit, Knitted, Thickness, Work,
    cell::Cell,
    colors::Way,
    curl::Curl,
    kinds::{self, Kinds},
    loops::{Border, Loops},
    piece::{Laying, State, Surface, Thread, ease, settle, shaped::Shaped, sheet::Sheet},
    pressed::{self, Alike, flatten_where_touching},
    rims,
    round::Rounds,
    short_rows,
};
use crate::{
    geometry::curve::{Basis, Curve},
    pattern::{
        PatternStrand, StrandKind,
        chart::{ChartError, Stitch},
        revolution::Revolution,
        rods::Run,
    },
};

/// Steps for edges, and for a piece that has no cell.
const EDGE_STEPS: usize = 300;
const PIECE_STEPS: usize = 40;
const FINE_STEPS: usize = 8;
const EASE_STEPS: usize = 20;

/// What the stitches of a piece are laid out by.
struct Layout {
    /// The cell of the chart's repeat, if it has one.
    cell: Option<Cell>,
    /// That of the back layer, of a cloth of two.
    back: Option<Cell>,
    /// The cells of single rows otherwise.
    kinds: Kinds,
    /// How many rows there are.
    rows: usize,
    /// Whether all of the piece repeats as its cell does.
    even: bool,
    /// Points of a stitch as it is laid out.
    points: u32,
    /// Width and height of a stitch that the piece is knitted to, and as they are found where these are open.
    size: [Option<f64>; 2],
    gauge: [f64; 2],
    /// Width of a stitch in each row.
    widths: Vec<f64>,
    /// Whether rows of other widths, of a piece that does not repeat, are laid as their cells have them.
    in_sections: bool,
}

impl Layout {
    /// What lies on a `profile`, or is `closed` at its top, is not even.
    fn new(knit: &Knit, rows: &[Vec<Stitch>], profile: Option<&Revolution>, closed: bool) -> Self {
        let bent = closed || profile.is_some();
        let own = knit.size();
        let repeat = knit.repeat_of(rows, own);
        let size = match (profile, &repeat) {
            (Some(profile), _) => knit.size_on(profile, rows).map(Some),
            // Of few points its cell would find another one.
            (None, Some(repeat)) if closed => knit.cell(repeat, own, knit.points).gauge().map(Some),
            (None, _) => own,
        };
        let points_of_cell = if bent { COARSE } else { knit.points };
        let cell = knit.repeat_of(rows, size).map(|repeat| knit.cell(&repeat, size, points_of_cell));
        let even = cell.is_some() && !bent;
        let points = if even || short_rows::any(rows) { knit.points } else { COARSE };
        let kinds = if cell.is_none() { knit.rows_of_a_kind(rows, size, points) } else { Kinds::default() };
        let gauge = cell.as_ref().map_or_else(|| kinds.gauge(size), Cell::gauge);
        let back = cell.as_ref().filter(|_| knit.is_double()).map(Cell::turned);
        let widths = if cell.is_some() { vec![gauge[0]; rows.len()] } else { kinds.widths(size[0]) };
        let in_sections = cell.is_none() && kinds::in_sections(rows);
        Self { cell, back, kinds, rows: rows.len(), even, points, size, gauge, widths, in_sections }
    }

    /// How far apart two layers lie.
    fn apart(&self) -> f64 {
        if self.back.is_some() { self.cell.as_ref().map_or(0.0, Cell::touching) } else { 0.0 }
    }

    /// The cell of a row, and the row in it.
    fn cell_of(&self, row: usize) -> Option<(&Cell, usize)> {
        match &self.cell {
            _ if row >= self.rows => None,
            Some(cell) => Some((cell, row)),
            None => self.kinds.of(row),
        }
    }
}

impl Knit {
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
    /// The chart does not fit the stitches, or asks for more than [`MAX_POINTS`](crate::pattern::MAX_POINTS) control points.
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
        if self.edges == Edges::Tile {
            return self.patch(yarn);
        }
        let diameter = yarn.pressed();
        let rows = self.worked()?;
        let mirrored = short_rows::from_right(&rows, self.is_finished());
        let ways = self.ways(&rows, mirrored);
        let ring = match self.rims.top {
            Closing::BoundOff => None,
            Closing::Drawn => Some(rims::drawn_to(self, &rows)?),
        };
        let profile = self.profile(diameter, ring);
        let layout = Layout::new(self, &rows, profile.as_ref(), ring.is_some());
        if let Some(cell) = layout.cell.as_ref().filter(|_| profile.is_none()) {
            self.check_relaxed(cell)?;
        }
        let mut loops = self.loops(&rows, &ways, mirrored);
        loops.apart = layout.apart();
        let surface = self.surface(&layout, profile, ring, &loops, &rows)?;
        let mut threads = self.laid(&layout, &loops, &surface, &ways);
        self.relax(&layout, &mut threads, yarn.radius / diameter);
        let [width, height] = layout.gauge;
        let extent = DVec2::new(width * f64::from(self.stitches), height * f64::from(self.rows));
        let to_middle = match &surface {
            Surface::Plane { .. } | Surface::Rows { .. } => DVec3::new(0.0, -0.5 * extent.y, 0.0),
            Surface::Round { .. } | Surface::Bent(_) | Surface::Shaped(_) => DVec3::ZERO,
        };
        if let (false, Some(cell)) = (self.flat || self.is_double(), &layout.cell) {
            roll_up(&mut threads, &Curl::of(cell, extent), to_middle);
        }
        let alike = if yarn.flatten == 1.0 { Alike::No } else { self.alike(&layout, &surface, &threads) };
        let mut strands: Vec<_> = threads
            .into_iter()
            .enumerate()
            .map(|(index, thread)| {
                let points = thread.points.into_iter().map(|p| (p + to_middle) * diameter).collect();
                strand(index, points, thread.grid)
            })
            .collect();
        flatten_where_touching(&mut strands, yarn, &alike);
        let colors = ways.iter().map(|w| w.color).collect();
        let widths = layout.widths.iter().map(|width| width * diameter).collect();
        Ok(Knitted { strands, colors, gauge: layout.gauge.map(|length| length * diameter), widths })
    }

    /// A patch that repeats, of one colour, centred.
    fn patch(&self, yarn: &Thickness) -> Result<Knitted, ChartError> {
        let diameter = yarn.pressed();
        let repeat = self.repeat_for("for a tile")?;
        self.check_held_on(&repeat)?;
        let (wide, high) = (repeat.wide, repeat.chart.rows());
        if !self.stitches.is_multiple_of(wide) || !self.rows.is_multiple_of(high) {
            let problem = format!("a tile of {} x {} of what repeats over {wide} x {high}", self.stitches, self.rows);
            return Err(ChartError::new(None, problem, "give multiples of these stitches and rows"));
        }
        let cell = self.cell(&repeat, self.size(), self.points);
        self.check_relaxed(&cell)?;
        let [width, height] = cell.gauge();
        let size = DVec2::new(f64::from(self.stitches) * width, f64::from(self.rows) * height);
        let row = |r: usize| {
            let visits = (cell.visits[r % high as usize].len() - 1) * (self.stitches / wide) as usize;
            // The first point of the next patch ends it.
            let mut way: Vec<_> = (0..visits).flat_map(|k| cell.visit(r, k)).collect();
            way.extend(cell.visit(r, visits).next());
            let (points, coordinates) =
                way.into_iter().map(|(p, g)| ((p - (0.5 * size).extend(0.0)) * diameter, g)).unzip();
            strand(r, points, coordinates)
        };
        let mut strands: Vec<_> = (0..self.rows as usize).map(row).collect();
        flatten_where_touching(&mut strands, yarn, &Alike::Tile { period: size * diameter, shear: 0.0 });
        let gauge = [width * diameter, height * diameter];
        Ok(Knitted { colors: vec![0; strands.len()], strands, gauge, widths: vec![gauge[0]; self.rows as usize] })
    }

    /// The ways of its yarns through its rows, of which the first may go from right to left.
    pub(super) fn ways(&self, rows: &[Vec<Stitch>], from_right: bool) -> Vec<Way> {
        let (finished, round) = (self.is_finished(), self.form.is_round());
        let one = || Colors { rows: vec![vec![0]; self.rows as usize], work: Work::Stranded, catch: None, carry: 0 };
        let mut ways = self.colors.as_ref().unwrap_or(&one()).ways(finished, round);
        if from_right || short_rows::any(rows) {
            short_rows::lead(&mut ways, rows, from_right);
        }
        ways
    }

    /// The profile that it is knitted to, in yarn diameters, if it is given one; its top is drawn to a `ring`.
    fn profile(&self, diameter: f64, ring: Option<f64>) -> Option<Revolution> {
        let Form::Revolution(profile) = &self.form else { return None };
        let scaled: Vec<DVec2> = profile.iter().map(|p| *p / diameter).collect();
        let whole = match ring {
            Some(ring) => rims::drawn(scaled, ring),
            None => scaled,
        };
        Some(Revolution::new(&whole))
    }

    /// What is drawn through what, in all colours, where yarns go through the rows on these ways.
    fn loops(&self, rows: &[Vec<Stitch>], ways: &[Way], mirrored: bool) -> Loops {
        let round = self.form.is_round();
        let border = Border {
            round: round.then_some(1.0),
            stacked: false,
            turns: round,
            finished: self.is_finished(),
            rims: self.rims,
            mirrored,
            slants: self.slants(rows),
        };
        let backwards = ways.iter().flat_map(|w| &w.rows).any(|s| s.row == rows.len() as i32 && s.backwards);
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

    /// What the piece lies on; a tube may be drawn to a `ring` at its top.
    fn surface(
        &self,
        layout: &Layout,
        profile: Option<Revolution>,
        ring: Option<f64>,
        loops: &Loops,
        rows: &[Vec<Stitch>],
    ) -> Result<Surface, ChartError> {
        let [width, height] = layout.gauge;
        Ok(match (&self.form, profile) {
            (_, Some(revolution)) => Surface::Round { revolution, height },
            (Form::Tube, _) => {
                let counts = rows.iter().map(Vec::len).collect();
                let revolution = Rounds { widths: &layout.widths, counts, height, ring }.tube()?;
                let height = revolution.length() / rows.len() as f64;
                Surface::Round { revolution, height }
            }
            _ if !loops.levels().is_empty() => Surface::Bent(Sheet::relaxed(loops.levels(), rows, layout.gauge)),
            _ if loops.is_shaped() => {
                Surface::Shaped(Shaped::relaxed(rows, &loops.lines().collect::<Vec<_>>(), &layout.widths, height))
            }
            _ if layout.even => Surface::Plane { width, height },
            _ => Surface::Rows { widths: layout.widths.clone(), height },
        })
    }

    /// The yarns as they are laid out.
    fn laid(&self, layout: &Layout, loops: &Loops, surface: &Surface, ways: &[Way]) -> Vec<Thread> {
        let by_cells = match surface {
            Surface::Rows { .. } => layout.in_sections,
            Surface::Shaped(_) => false,
            Surface::Plane { .. } | Surface::Round { .. } | Surface::Bent(_) => true,
        };
        let laying = Laying {
            loops,
            surface,
            cells: &|row| layout.cell_of(row).filter(|_| by_cells),
            back: layout.back.as_ref(),
            even: layout.even,
            own_cells: layout.cell.is_some(),
            slipped: self.has_slipped_sides() || self.has_tucks(),
            yarn: self.yarn(layout.size),
            points: layout.points,
        };
        laying.threads(ways)
    }

    /// Lets yarns of a radius, in units, find room: at the edges where the rest repeats, else everywhere.
    fn relax(&self, layout: &Layout, threads: &mut [Thread], radius: f64) {
        if layout.even {
            settle(threads, &Run::finding_room(EDGE_STEPS, 0.6));
            return;
        }
        let run = Run::finding_room(PIECE_STEPS, 0.8);
        settle(threads, &run);
        threads.iter_mut().for_each(|t| t.refine(f64::from(self.points) / f64::from(layout.points)));
        let run = Run { growing: 0, ..run };
        settle(threads, &Run { steps: FINE_STEPS, firm: 4.0, ..run });
        ease(threads, self.points as usize, radius, &Run { steps: EASE_STEPS, ..run });
    }

    /// Which points of a flat piece lie alike: those that rest where their cell has them, in stitches around which all do.
    fn alike(&self, layout: &Layout, surface: &Surface, threads: &[Thread]) -> Alike {
        // As far as a loop reaches, and one more.
        const AROUND: i32 = 2;
        let repeats = layout.even && self.colors.is_none();
        let lies_flat = self.flat && matches!(surface, Surface::Plane { .. });
        let Some(cell) = layout.cell.as_ref().filter(|_| repeats && lies_flat) else { return Alike::No };
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
}

/// A round yarn through points that have this wale and course.
fn strand(index: usize, points: Vec<DVec3>, coordinates: Vec<[f32; 2]>) -> PatternStrand {
    PatternStrand {
        curve: Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening: None },
        kind: StrandKind::Course,
        index: index as u32,
        coordinates,
        share: 1.0,
    }
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
    settle(threads, &Run { growing: 0, ..Run::finding_room(PIECE_STEPS, 1.0) });
}
