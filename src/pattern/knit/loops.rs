//! Which loop passes through which: a chart's stitches become loops, and the way of the yarn through each row.

mod double;
mod maker;

use self::maker::{LIFTED, Maker};
use super::{
    super::chart::Stitch,
    rims::{Closing, Rims},
};

/// How far feet and heads reach beyond the line where they hold each other, in rows (2.28 diameters apart).
pub(in super::super) const REACH: f64 = 0.775 / 2.28;
/// The room that three stitches take that become one, in rows.
pub(in super::super) const TRIPLE: f64 = 0.8;
/// The yarn of a bobble, in shares of a stitch's.
pub(in super::super) const BOBBLE: f64 = 10.0;
/// The room that a bobble takes above its row, in rows.
pub(in super::super) const BELLY: f64 = 1.9;

/// What happens between a visit and the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum Hold {
    None,
    /// The float goes between the cloth and the working yarn.
    Caught {
        /// Whether it goes on below what it was above, so that it is held: nothing else floats there.
        down: bool,
    },
    /// The working yarn goes behind the float.
    Catches,
    /// The yarn goes over to the other layer.
    Crosses,
}

/// A loop of yarn that a needle has held.
#[derive(Clone, Debug)]
pub(in super::super) struct Loop {
    /// The row it was made in; -1 is the cast-on edge.
    pub(in super::super) row: i32,
    /// Its middle across the cloth: in stitches, or in turns if the cloth is round.
    pub(in super::super) at: f64,
    /// 1 if it was drawn to the front, -1 to the back, 0 if it was laid over the needle.
    pub(in super::super) sign: f64,
    /// What it was drawn through, from the front as its own sign has it: the nearest to the new loop's head first.
    pub(in super::super) parents: Vec<u32>,
    /// What is drawn through it: loops of `held` and their sign.
    pub(in super::super) children: Vec<u32>,
    /// The row of its children, counted on beyond a periodic border.
    pub(in super::super) held: Option<i32>,
    /// Its place among the loops that its children are drawn through.
    pub(in super::super) rank: u8,
    /// 1 if its legs cross, the right one in front; -1 if the left one is; else 0.
    pub(in super::super) twist: f64,
    /// 1 if it passes in front of others that it changes places with, -1 behind; of a lifted strand, of what it lies between.
    pub(in super::super) layer: f64,
    /// Share of a stitch's yarn.
    pub(in super::super) yarn: f64,
    /// Width of its stitch, in mean widths: where decreases draw stitches together they are narrow.
    pub(in super::super) wide: f64,
    /// Where its feet are across the cloth: half way between its own middle and those of its parents.
    pub(in super::super) foot: f64,
    /// Whether it closes a bobble, which is drawn through what it is.
    pub(in super::super) bobble: bool,
    /// 1 in the front layer of a cloth of two, -1 in the back one; 0 where there is one layer.
    pub(in super::super) side: f64,
}

impl Loop {
    /// A loop with nothing around it yet, laid over the needle with a stitch's yarn.
    fn laid(row: i32, at: f64) -> Self {
        Self {
            row,
            at,
            sign: 0.0,
            parents: Vec::new(),
            children: Vec::new(),
            held: None,
            rank: 0,
            twist: 0.0,
            layer: 0.0,
            yarn: 1.0,
            wide: 1.0,
            foot: at,
            bobble: false,
            side: 0.0,
        }
    }

    /// Whether it is the strand between two stitches, lifted and twisted.
    pub(in super::super) fn is_lifted(&self) -> bool {
        self.sign == 0.0 && self.twist != 0.0 && self.yarn == LIFTED
    }
}

/// What the yarn does on its way along a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) enum Visit {
    /// It makes a loop.
    Loop(u32),
    /// It passes a stitch.
    Pass {
        /// Where.
        at: f64,
        /// Whether in front.
        front: bool,
    },
    /// It passes behind a stitch of another colour.
    Float {
        /// Where.
        at: f64,
    },
    /// It goes through a loop of the last row, to be drawn tight.
    Through {
        /// Where.
        at: f64,
    },
}

impl Visit {
    /// The loop that is made, if one is.
    fn made(self) -> Option<u32> {
        if let Self::Loop(i) = self { Some(i) } else { None }
    }
}

/// A yarn's way along a row, from left to right.
#[derive(Clone, Debug)]
pub(in super::super) struct Course {
    pub(in super::super) row: i32,
    /// What the yarn does, each with the column of the chart.
    pub(in super::super) visits: Vec<(u32, Visit)>,
    pub(in super::super) color: u16,
    /// Visits of the row before its own, where it is a field of one.
    pub(in super::super) first: usize,
    /// How far its floats are lifted, in rows: those of several colours lie beside each other.
    pub(in super::super) lift: f64,
    /// What happens after each visit; none where nothing does.
    pub(in super::super) holds: Vec<Hold>,
}

impl Course {
    fn new(row: i32, visits: Vec<(u32, Visit)>) -> Self {
        Self { row, visits, color: 0, first: 0, lift: 0.0, holds: Vec::new() }
    }

    /// What happens between a visit and the next one.
    pub(in super::super) fn hold(&self, k: usize) -> Hold {
        self.holds.get(k).copied().unwrap_or(Hold::None)
    }

    /// Whether other colours change a visit: a float, a loop beside one, or one that catches another.
    pub(in super::super) fn is_mixed(&self, k: usize) -> bool {
        let n = self.visits.len();
        let before = (k + n - 1) % n;
        let float = |k: usize| matches!(self.visits[k].1, Visit::Float { .. });
        float(k) || float(before) || float((k + 1) % n) || self.hold(k) != Hold::None || self.hold(before) != Hold::None
    }
}

/// Loops and rows of a piece.
#[derive(Clone, Debug)]
pub(in super::super) struct Loops {
    pub(in super::super) loops: Vec<Loop>,
    pub(in super::super) courses: Vec<Course>,
    pub(in super::super) border: Border,
    /// Rows without edges, and stitches of the first one.
    pub(in super::super) rows: i32,
    pub(in super::super) wide: usize,
    /// How far up each row begins, in rows: those whose stitches change places have more room below them.
    heights: Vec<f64>,
    room: f64,
    /// Where rows are short, how far up each stitch of each row begins, and behind them the tops of all; else nothing.
    levels: Vec<Vec<f64>>,
    /// Where rows wave, how far each stitch of each row is above its row's height, from the left; else nothing.
    waves: Vec<Vec<(f64, f64)>>,
    /// In shaped flat cloth, whose wales lean, where the first stitch of each row is; else nothing.
    shaped: Vec<f64>,
    /// Whether any stitch is a bobble.
    bobbles: bool,
    /// How far each layer of a cloth of two is from the middle between them, in yarn diameters; 0 where there is one.
    pub(in super::super) apart: f64,
    /// Whether the last row is of wales of knit and of purl that the next one would go on.
    pub(in super::super) ribbed: bool,
}

/// What is beside the last stitch of a row, above the last row and below the first one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) struct Border {
    /// Of a row that goes round: by how much `at` grows in a round.
    pub(in super::super) round: Option<f64>,
    /// The last row is below the first.
    pub(in super::super) stacked: bool,
    /// Flat or round: whether `at` counts turns.
    pub(in super::super) turns: bool,
    /// The first row is cast on and the last one bound off or drawn together.
    pub(in super::super) finished: bool,
    /// How.
    pub(in super::super) rims: Rims,
    /// Whether it is cast on from left to right.
    pub(in super::super) mirrored: bool,
    /// Whether stitches of a flat piece go aside from row to row, though rows are of one width: cloth on the bias.
    pub(in super::super) slants: bool,
}

impl Border {
    /// Whether the last row is drawn together.
    pub(in super::super) fn is_drawn(&self) -> bool {
        self.finished && self.rims.top == Closing::Drawn
    }

    /// A difference across the cloth, the short way round.
    pub(in super::super) fn short(&self, d: f64) -> f64 {
        self.round.map_or(d, |round| d - round * (d / round).round())
    }
}

impl Loops {
    /// The loops of rows from the first one upwards.
    pub(in super::super) fn new(rows: &[Vec<Stitch>], cast_on: usize, border: Border) -> Self {
        let backwards = border.round.is_none() && rows.len() % 2 == 1;
        Self::bound_off(rows, cast_on, border, backwards, None)
    }

    /// The same, with the side from which a finished piece is bound off, and the row of plain stitches that would come next:
    /// it is bound off in its pattern.
    pub(in super::super) fn bound_off(
        rows: &[Vec<Stitch>],
        cast_on: usize,
        border: Border,
        backwards: bool,
        next: Option<&[Stitch]>,
    ) -> Self {
        let mut maker = Maker::new(rows, cast_on, border);
        maker.positions();
        maker.draw();
        match border.rims.top {
            _ if !border.finished => {}
            Closing::BoundOff => maker.bind_off(backwards, 1, next),
            Closing::Drawn => maker.draw_together(),
        }
        // Wales of both kinds that go on to the edge fold.
        let goes_on = |next: &[Stitch]| {
            rows.last().is_some_and(|last| last.iter().map(|s| s.purl).eq(next.iter().map(|s| s.purl)))
        };
        let is_mixed = |next: &[Stitch]| next.iter().any(|s| s.purl != next[0].purl);
        Self { ribbed: next.is_some_and(|next| goes_on(next) && is_mixed(next)), ..maker.finish() }
    }

    /// How far up a row is, in mean rows from the first one.
    pub(in super::super) fn up(&self, row: i32) -> f64 {
        match row.rem_euclid(self.rows) {
            within if self.border.stacked || within == row => f64::from(row - within) + self.heights[within as usize],
            _ => f64::from(row),
        }
    }

    /// How far a row is above its height at a place of it: rows wave where wales lean.
    fn rise(&self, row: i32, at: f64) -> f64 {
        let Some(wave) = self.waves.get(row.rem_euclid(self.rows) as usize).filter(|w| !w.is_empty()) else {
            return 0.0;
        };
        let round = self.wide as f64;
        // Between the last stitch of the round before and the first of the next one.
        let first = wave[0].0;
        let at = first + (at - first).rem_euclid(round);
        let k = wave.partition_point(|knot| knot.0 <= at).max(1);
        let (a, b) = (wave[k - 1], wave.get(k).copied().unwrap_or((first + round, wave[0].1)));
        if b.0 > a.0 { a.1 + (b.1 - a.1) * (at - a.0) / (b.0 - a.0) } else { a.1 }
    }

    /// The height at a place of a row: rows wave, and short ones make some columns of a flat piece higher than others.
    pub(in super::super) fn up_at(&self, row: i32, at: f64) -> f64 {
        if !self.waves.is_empty() {
            return self.up(row) + self.rise(row, at);
        }
        let Some(levels) = usize::try_from(row).ok().and_then(|r| self.levels.get(r)) else { return self.up(row) };
        let last = levels.len() - 1;
        let x = (at + 0.5 * last as f64).clamp(0.0, last as f64);
        let k = (x as usize).min(last.saturating_sub(1));
        levels[k] + (levels[(k + 1).min(last)] - levels[k]) * (x - k as f64)
    }

    /// So many shares of a row's height above the beginning of a row, at a place of it.
    pub(in super::super) fn within(&self, row: i32, at: f64, share: f64) -> f64 {
        let base = self.up_at(row, at);
        if self.levels.is_empty() { base + share } else { base + share * (self.up_at(row + 1, at) - base) }
    }

    /// How far up the stitches of each row begin where rows are short, and behind them the tops of all.
    pub(in super::super) fn levels(&self) -> &[Vec<f64>] {
        &self.levels
    }

    /// How much higher rows are with the room that some have below them.
    pub(in super::super) fn room(&self) -> f64 {
        self.room
    }

    /// Whether a loop is bound off within the piece: what is drawn through it is of its own row.
    pub(in super::super) fn is_bound_within(&self, own: &Loop) -> bool {
        own.held == Some(own.row) && own.row < self.rows
    }

    /// Whether the cloth has two layers.
    pub(in super::super) fn is_double(&self) -> bool {
        self.apart > 0.0
    }

    /// How far out the layer is of what a yarn does.
    pub(in super::super) fn layer_of(&self, visit: &Visit) -> f64 {
        match visit {
            Visit::Loop(i) => self.apart * self.loops[*i as usize].side,
            Visit::Pass { .. } | Visit::Float { .. } | Visit::Through { .. } => 0.0,
        }
    }

    /// How far across from its column what a yarn does is, in stitches: layers are half a stitch apart.
    pub(in super::super) fn aside(&self, visit: &Visit) -> f64 {
        match visit {
            Visit::Loop(i) => -0.25 * self.loops[*i as usize].side,
            Visit::Pass { .. } | Visit::Float { .. } | Visit::Through { .. } => 0.0,
        }
    }

    /// Whether decreases and yarn-overs move its wales, so that rows wave.
    pub(in super::super) fn has_waves(&self) -> bool {
        !self.waves.is_empty()
    }

    /// Whether decreases and increases shape it, so that its wales lean.
    pub(in super::super) fn is_shaped(&self) -> bool {
        !self.shaped.is_empty()
    }

    /// For the cast-on edge, each row, and the top of the last one, where its first stitch is and how far up it begins, in rows.
    pub(in super::super) fn lines(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let cast_on = self.loops.first().filter(|l| l.row < 0).map_or(self.shaped[0], |l| l.at);
        let rows = (0..self.rows).map(|row| [self.shaped[row as usize], self.up(row)]);
        let top = [self.shaped[self.shaped.len() - 1], self.up(self.rows)];
        std::iter::once([cast_on, -1.0]).chain(rows).chain(std::iter::once(top))
    }

    pub(in super::super) fn has_bobbles(&self) -> bool {
        self.bobbles
    }

    /// How far feet and heads reach beyond the line where they hold each other, in mean rows: bobbles must not make them
    /// longer as they make rows higher.
    pub(in super::super) fn reach(&self) -> f64 {
        if self.bobbles { REACH / self.room } else { REACH }
    }

    /// Every loop with what is drawn through it: parent and child.
    #[cfg(test)]
    pub(in super::super) fn links(&self) -> Vec<(u32, u32)> {
        let of = |(i, l): (usize, &Loop)| l.parents.iter().map(|&p| (p, i as u32)).collect::<Vec<_>>();
        self.loops.iter().enumerate().flat_map(of).collect()
    }
}
