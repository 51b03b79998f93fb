//! Stranded colour work: each colour of a row is a yarn of its own, which floats behind the stitches of the others.
//!
//! The tile is relaxed as a knit of one yarn. In a row of several colours each yarn has the tile's way where it makes loops;
//! beside a float the last of it is led to the float's lane, which lies behind all that the tile has. Lanes of several
//! colours lie one above the other, in the same order in all of a row: yarns change places without winding around each other.

use std::sync::Arc;

use glam::Vec3;

use super::{
    lattice::Lattice,
    run::Run,
    strain::{Shape, Shapes, UNSTRAINED},
};
use crate::{
    math::special::smooth_step_f32,
    pattern::knit::{self, Colors, Work, caught, in_use},
};

/// Which yarn knits which stitch of a cloth, and how the others go on behind it.
pub(crate) struct Stranded {
    /// The colour of a stitch, from 0, by its column and row from the corner of the flat panel.
    pub color: Box<dyn Fn(usize, usize) -> u16 + Send + Sync>,
    /// A float over more stitches is caught by the working yarn between two of its stitches.
    pub catch: Option<u32>,
    /// A yarn that more rows do without is cut.
    pub carry: u32,
}

/// What the floats of a garment's panels come to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Floats {
    /// Stitches that yarns pass behind.
    pub stitches: u64,
    /// The most colours of a row.
    pub most: usize,
}

/// Places of a float's control points between the start of a stitch and that of the next.
pub(super) const FLOATING: [f32; 4] = [0.0, 0.2, 0.5, 0.8];
/// A lane lies so far behind the deepest of the cloth, from middle to middle, in diameters.
const BEHIND: f32 = 1.1;
/// Lanes that are closer above each other than this, in diameters, lie behind each other by turns.
const APART: f32 = 1.02;
/// The end of a loop beside a float is so far on its own side of the joint, in stitches.
const ASIDE: f32 = 0.15;
/// So much of a stitch is led to what is beside it.
const LED: f32 = 0.09;
/// Where a float is caught it is so far above or below the feet of the loops, on its lane's side, in diameters.
const CAUGHT: f32 = 0.74;
/// The yarn that catches it goes by on the other side of their feet, so far from them and so far behind the float.
const AROUND: [f32; 2] = [0.35, 0.5];
/// What is left behind that, in diameters: half a yarn, and lanes that lie deeper than others.
const REST: f32 = 1.35;

/// What one colour does between two stitches of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Joint {
    /// It goes from loop to loop.
    Knits,
    /// It goes from a loop to a float, or from a float to a loop.
    Leads {
        to_float: bool,
    },
    Floats,
    /// It floats, and is held by the yarn that knits.
    Caught,
    /// It goes from loop to loop behind the float of another colour.
    Catches(u16),
}

/// The colours of a row of several, as it lies in the whole panel.
#[derive(Debug)]
pub(super) struct Row {
    /// Its first stitch.
    first: usize,
    /// Whether the last stitch is beside the first.
    round: bool,
    colors: Vec<u16>,
    /// Each once, in order.
    used: Vec<u16>,
    /// After which stitches a float is caught: its colour and that of the working yarn.
    holds: Vec<Option<(u16, u16)>>,
}

impl Row {
    fn new(lattice: &Lattice, run: &Run, stranded: &Stranded) -> Self {
        let [first, last] = lattice.whole_run(run.line, run.first);
        let [columns, rows] = lattice.turned_in;
        // What is turned in has the colour of the stitch beside it.
        let of = |x: usize| (stranded.color)(x.saturating_sub(columns), run.line.saturating_sub(rows));
        let colors: Vec<u16> = (first..last).map(of).collect();
        let used = in_use(colors.iter().copied());
        let round = lattice.ring && last - first == lattice.counts[0];
        let holds = caught(&colors, &|_| true, &used, stranded.catch, round, run.line as i32);
        Self { first, round, colors, used, holds }
    }

    pub(super) fn is_mixed(&self) -> bool {
        self.used.len() > 1
    }

    /// Whether a colour knits a stitch.
    pub(super) fn knits(&self, color: u16, stitch: usize) -> bool {
        self.colors[stitch - self.first] == color
    }

    fn rank(&self, color: u16) -> usize {
        self.used.iter().position(|c| *c == color).unwrap_or(0)
    }

    /// How far up the lane of a colour is, in rows: lanes share the height of a row.
    fn lift(&self, color: u16) -> f32 {
        let count = self.used.len() as f32;
        (self.rank(color) as f32 - 0.5 * (count - 1.0)) / count
    }

    /// What a colour does before a stitch; `stitch` may be one after the last.
    fn joint(&self, color: u16, stitch: usize) -> Joint {
        let n = self.colors.len();
        let at = stitch - self.first;
        let (before, after) = match (at, self.round) {
            (0, true) => (n - 1, 0),
            (0, false) => (0, 0),
            (at, true) if at == n => (n - 1, 0),
            (at, false) if at == n => (n - 1, n - 1),
            _ => (at - 1, at),
        };
        let own = [before, after].map(|k| self.colors[k] == color);
        let hold = self.holds[before].filter(|_| before != after);
        match (own, hold) {
            ([true, true], Some((float, working))) if working == color => Joint::Catches(float),
            ([true, true], _) => Joint::Knits,
            ([false, false], Some((float, _))) if float == color => Joint::Caught,
            ([false, false], _) => Joint::Floats,
            ([knits, _], _) => Joint::Leads { to_float: knits },
        }
    }
}

/// A colour's way through a row of several.
#[derive(Clone, Copy)]
pub(super) struct Strand<'a> {
    pub(super) row: &'a Row,
    pub(super) color: u16,
}

impl Strand<'_> {
    pub(super) fn rank(&self) -> usize {
        self.row.rank(self.color)
    }
}

/// Where floats lie behind a cloth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lanes {
    /// Feet of loops above the line of their row, in rows.
    foot: f32,
    /// How far out floats lie, mm.
    depth: f32,
    diameter: f32,
    /// A diameter, in rows.
    flat: f32,
}

impl Lanes {
    pub(super) fn new(shapes: &Shapes, lattice: &Lattice) -> Self {
        let foot = |shape: &Shape| shapes.control(shape, 0, UNSTRAINED).y - shape.index as f32;
        let diameter = shapes.diameter as f32;
        Self {
            foot: shapes.strands.iter().map(foot).sum::<f32>() / shapes.strands.len().max(1) as f32,
            depth: shapes.heights[0] as f32 - BEHIND * diameter,
            diameter,
            flat: diameter / lattice.stitch.y as f32,
        }
    }

    /// How far behind the sheet yarns of stranded cloth reach, mm.
    pub(super) fn reach(shapes: &Shapes) -> f64 {
        shapes.diameter * f64::from(BEHIND + AROUND[1] + REST) - shapes.heights[0]
    }

    /// Where a colour floats, in stitches across, rows up and mm out.
    pub(super) fn float(&self, strand: Strand<'_>, line: usize, x: f32) -> Vec3 {
        let row = strand.row;
        let count = row.used.len();
        let apart = 1.0 / (count as f32 * self.flat);
        let turn = (line * count + row.rank(strand.color)) % 2;
        let deeper = if turn == 1 { (APART * APART - apart * apart).max(0.0).sqrt() } else { 0.0 };
        Vec3::new(x, line as f32 + self.foot + row.lift(strand.color), self.depth - deeper * self.diameter)
    }

    /// Where a colour lies before a stitch, if that is not where the tile has it.
    pub(super) fn joint(&self, strand: Strand<'_>, line: usize, stitch: usize) -> Option<Vec3> {
        let x = stitch as f32;
        match strand.row.joint(strand.color, stitch) {
            Joint::Knits => None,
            Joint::Floats => Some(self.float(strand, line, x)),
            Joint::Leads { to_float } => Some(self.float(strand, line, if to_float { x - ASIDE } else { x + ASIDE })),
            Joint::Caught => Some(self.caught(strand, line, x, CAUGHT)),
            Joint::Catches(color) => {
                let [aside, behind] = AROUND;
                let float = self.caught(Strand { color, ..strand }, line, x, -aside);
                Some(float - Vec3::Z * behind * self.diameter)
            }
        }
    }

    /// As deep as a float where it is caught, so many diameters to its lane's side of the feet of the loops.
    fn caught(&self, strand: Strand<'_>, line: usize, x: f32, aside: f32) -> Vec3 {
        let side = if strand.row.lift(strand.color) < 0.0 { -1.0 } else { 1.0 };
        let float = self.float(strand, line, x);
        Vec3::new(x, line as f32 + self.foot + side * aside * self.flat, float.z)
    }
}

/// How much of what leads to a joint is left at a share of a stitch from it.
pub(super) fn led(share: f32) -> f32 {
    smooth_step_f32(1.0 - share / LED)
}

/// A yarn's way through a panel: its runs, its colour, and the rows' colours where they have several.
pub(super) struct Way {
    pub(super) runs: Vec<Run>,
    pub(super) color: u16,
    pub(super) rows: Vec<Arc<Row>>,
}

impl Way {
    /// Of cloth of one yarn.
    pub(super) fn plain(runs: Vec<Run>) -> Self {
        Self { runs, color: 0, rows: Vec::new() }
    }

    /// What it does in one of its runs, where that has several colours.
    pub(super) fn strand(&self, run: usize) -> Option<Strand<'_>> {
        let row = self.rows.get(run).filter(|row| row.is_mixed())?;
        Some(Strand { row, color: self.color })
    }

    /// A way for each colour of a chain of runs: each goes on from the side where it hangs.
    pub(super) fn of_colors(lattice: &Lattice, chain: &[Run], stranded: &Stranded) -> Vec<Self> {
        let rows: Vec<Arc<Row>> = chain.iter().map(|run| Arc::new(Row::new(lattice, run, stranded))).collect();
        let colors = Colors {
            rows: rows.iter().map(|row| row.used.clone()).collect(),
            work: Work::Stranded,
            catch: None,
            carry: stranded.carry,
        };
        let way = |way: knit::Way| {
            let own = || way.rows.iter().map(|stretch| (stretch.row as usize, stretch.backwards));
            Self {
                runs: own().map(|(k, backwards)| Run { backwards, ..chain[k] }).collect(),
                color: way.color,
                rows: own().map(|(k, _)| Arc::clone(&rows[k])).collect(),
            }
        };
        colors.ways(false, chain[0].ring).into_iter().map(way).collect()
    }
}

/// What a panel's floats come to.
pub(super) fn count(lattice: &Lattice, stranded: &Stranded) -> Floats {
    let mut floats = Floats::default();
    for line in 0..lattice.counts[1] {
        for [first, last] in lattice.runs(0, line) {
            let run = Run { line, first, last, backwards: false, ring: false };
            let used = Row::new(lattice, &run, stranded).used.len();
            floats.stitches += ((used - 1) * (last - first)) as u64;
            floats.most = floats.most.max(used);
        }
    }
    floats
}
