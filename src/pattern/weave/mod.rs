//! Woven cloth: one repeat of the draft is brought to equilibrium (`unit_cell`) and repeated.
//!
//! Yarns touch where they cross, share their crimp by stiffness as in Peirce's geometry ("The Geometry of Cloth
//! Structure", 1937), flatten at the same area (Kemp, "An Extension of Peirce's Cloth Geometry", 1958), and are as close
//! as the loom beats them up, unless spacings or a cover are given.

mod crowded;
mod edges;
mod intrusion;
mod minimize;
mod pile;
mod selvedge;
mod shuttle;
mod turn;
mod unit_cell;

#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use glam::DVec3;

pub use self::edges::{Edges, EdgesOf};
use self::unit_cell::{BEAT, CellOptions, UnitCell, full};
use super::{
    MAX_POINTS, PatternStrand, StrandKind,
    draft::{Draft, Threads},
};
use crate::geometry::curve::{Basis, Curve};

/// A rectangle of woven cloth in the plane z = 0: warps along y, wefts along x, right side towards +z. Lengths in the
/// unit of the radii.
#[derive(Clone, Debug, PartialEq)]
pub struct Weave {
    /// What lies over what.
    pub draft: Draft,
    /// How many warps, or how wide.
    pub warps: Extent,
    /// How many wefts, or how high.
    pub wefts: Extent,
    /// Half of the room that a warp and that a weft take where they are round: their radii, or less if they are plied.
    pub half_rooms: [f64; 2],
    /// These over the radii of the yarns themselves: 1, or less for plied yarns, which lie in each other's hollows.
    pub half_width: [f64; 2],
    /// Distance between warps; what the loom gives if absent.
    pub warp_spacing: Option<f64>,
    /// Distance between wefts.
    pub weft_spacing: Option<f64>,
    /// Share of the plane that yarns cover, 0 to 1; the spacings that are not given follow from it.
    pub cover: Option<f64>,
    /// The warp's share of the crimp: 0 leaves warps straight, 1 wefts; by the yarns' stiffness if absent.
    pub crimp: Option<f64>,
    /// Width over height of a yarn that nothing presses in this cloth, at least 1.
    pub flatten: f64,
    /// Control points between two crossings.
    pub points: u32,
    /// How it ends at its sides, at the bottom and at the top; cloth with a pile of wefts is cut.
    pub edges: Edges,
    /// How high the pile stands, where there is one.
    pub pile_height: f64,
    /// How warps differ, and wefts, one value for each of the draft's repeat.
    pub threads: [Threads; 2],
    /// The yarn of each weft, by a number, in turns from the bottom; all are of one where this is empty. Those of one yarn, one
    /// thickness and one layer are one strand where the cloth has selvedges.
    pub shuttles: Vec<u32>,
    /// Whether it is of whole repeats, so that it goes on at one border as it begins at the other.
    pub tile: bool,
}

/// How far cloth goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    /// So many yarns.
    Yarns(u32),
    /// As many as fill this length best.
    Length(f64),
}

/// Why there is no such cloth.
#[derive(Clone, Debug, PartialEq)]
pub enum Impossible {
    /// A spacing leaves yarns no room.
    TooTight {
        /// Whether it is the warps'; else the wefts'.
        warp: bool,
        /// About the least that is possible.
        least: f64,
    },
    /// More cover than the yarns can give.
    TooMuchCover {
        /// The most that is possible.
        most: f64,
    },
    /// Less cover than yarns give that are 64 times as far from each other as they have to be, or those whose spacing is given by
    /// themselves.
    TooLittleCover {
        /// The least that is possible.
        least: f64,
    },
    /// A width or height in which not one yarn, or not one repeat of a tile, has room.
    TooSmall {
        /// Whether it is the width, which warps fill; else the height.
        warp: bool,
        /// The smallest length.
        least: f64,
    },
    /// A number of warps that are twined in pairs, which leaves one alone.
    Unpaired {
        /// How many.
        warps: u32,
    },
    /// A single warp in a layer of cloth whose wefts turn at its sides: nothing would hold them.
    TooFewWarps {
        /// The least number of warps.
        least: u32,
    },
    /// More control points than [`MAX_POINTS`].
    TooLarge,
}

/// What a weave came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measures {
    /// Distance between warps and between wefts.
    pub spacing: [f64; 2],
    /// Share of the plane that no yarn covers, seen from above.
    pub see_through: f64,
    /// Length of a warp and of a weft over the cloth's, less 1.
    pub crimp: [f64; 2],
    /// From the lowest to the highest point of a repeat.
    pub thickness: f64,
    /// Width and height of the cloth.
    pub size: [f64; 2],
    /// Length of all warps and of all wefts of the ground, cut all around; [`yarn_lengths`] counts edges and pile too.
    pub length: [f64; 2],
}

impl Measures {
    /// How high the cloth is at least when it is [hemmed](Edges::Finished); lower cloth has selvedges.
    pub fn least_hemmed(&self) -> f64 {
        edges::least_hemmed(self.thickness)
    }

    /// That it is too low for hems, if it is, for people, with heights in a unit of so many of its own.
    pub(crate) fn too_low_for_hems(&self, unit: f64) -> Option<String> {
        let [least, height] = [self.least_hemmed(), self.size[1]].map(|length| length / unit);
        let told = || {
            format!(
                "hems take a height of {least:.3} at least, and the cloth is {height:.3} high: it has selvedges alone"
            )
        };
        (height < least).then(told)
    }
}

/// Length of yarn of all warps and of all wefts, with what selvedges, hems, fringes and pile take.
pub fn yarn_lengths(strands: &[PatternStrand]) -> [f64; 2] {
    [StrandKind::Warp, StrandKind::Weft]
        .map(|kind| strands.iter().filter(|s| s.kind == kind).map(PatternStrand::yarn_length).sum())
}

/// Control points between crossings unless asked otherwise.
pub const POINTS: u32 = 8;
/// Yarns of each side unless asked otherwise.
pub const YARNS: u32 = 20;
/// Width over height of free yarns in cloth: staple yarns are 1.3 to 2 (Kemp 1958).
pub const FLATTEN: f64 = 1.5;

/// How far a fringe or a pile may stand out, by half of the room that a warp takes: the longest that can be asked for.
pub fn longest(half_room: f64) -> f64 {
    1000.0 * half_room
}

/// Length of a fringe unless asked otherwise, by half of the room that a warp takes.
pub fn fringe(half_room: f64) -> f64 {
    24.0 * half_room
}

/// How high pile stands unless asked otherwise, by half of the room that a warp takes: four times the room where it is
/// cut, twelve times as loops, which bend over.
pub fn pile_height(draft: &Draft, half_room: f64) -> f64 {
    let rooms = if draft.pile().is_some_and(|pile| !pile.cut) { 12.0 } else { 4.0 };
    2.0 * rooms * half_room
}

/// A number for each yarn of the weft, by what tells one from another: [`Weave::shuttles`].
pub fn shuttles<T: PartialEq>(yarns: &[T]) -> Vec<u32> {
    let first = |yarn: &T| yarns.iter().position(|other| other == yarn).unwrap_or(0) as u32;
    yarns.iter().map(first).collect()
}

/// Yarns that are pressed into each other by more than this share of their surface by more than 5 % of their diameter
/// have no room.
const MOST_OVERLAP: f64 = 0.03;
/// Distance of yarns, over the least, beyond which no cover is looked for: a plain weave of them covers a sixtieth of the plane.
const FARTHEST: f64 = 64.0;
/// Share of the distance at which yarns lie side by side below which no draft has room.
const HOPELESS: f64 = 0.2;
/// Distance of wefts over that of warps where wefts are cut: two picks to an end, so that the ground is closed when the floats
/// are gone.
const CUT_SETT: f64 = 0.5;
/// How much harder such cloth is beaten up than other: its wefts slide over each other.
const CUT_BEAT: f64 = 40.0;
/// The same of terry, whose picks are beaten up three at once.
const LOOP_BEAT: f64 = 3.0;

/// Woven cloth in equilibrium, ready to be repeated.
#[derive(Clone, Debug)]
pub struct Cloth<'a> {
    weave: &'a Weave,
    cell: UnitCell,
    /// Warps and wefts.
    count: [u32; 2],
}

/// Distance of wefts over that of warps that looms are set to: square where both show alike; the side that shows more lies
/// closer, so that its floats close up and hide the other: denim has 1.5 times as many ends as picks, warp satin twice.
fn sett(draft: &Draft) -> f64 {
    const MOST: f64 = 2.0;
    if draft.layers() > 1 {
        return 1.0;
    }
    if draft.cut_wefts() {
        return CUT_SETT;
    }
    let crossings = (0..draft.wefts()).flat_map(|weft| (0..draft.warps()).map(move |warp| (weft, warp)));
    let over = crossings.clone().filter(|&(weft, warp)| draft.warp_over(weft, warp)).count() as f64;
    let under = crossings.count() as f64 - over;
    (over / under.max(1.0)).sqrt().clamp(1.0 / MOST, MOST)
}

impl Weave {
    /// A weave of one round yarn as it comes by itself, cut all around: 20 by 20 yarns.
    pub fn of(draft: Draft, radius: f64) -> Self {
        Self {
            warps: Extent::Yarns(YARNS),
            wefts: Extent::Yarns(YARNS),
            half_rooms: [radius; 2],
            half_width: [1.0; 2],
            warp_spacing: None,
            weft_spacing: None,
            cover: None,
            crimp: None,
            flatten: FLATTEN,
            points: POINTS,
            edges: Edges::Live,
            pile_height: pile_height(&draft, radius),
            draft,
            threads: <[Threads; 2]>::default(),
            shuttles: Vec::new(),
            tile: false,
        }
    }

    /// Radii of warp and weft themselves, where they are round.
    pub fn yarn_radii(&self) -> [f64; 2] {
        [0, 1].map(|side| self.half_rooms[side] / self.half_width[side])
    }

    fn options(&self) -> CellOptions {
        let [p, q] = self.half_rooms.map(|r| r * r);
        let beat = match self.draft.pile() {
            Some(_) if self.draft.cut_wefts() => CUT_BEAT * BEAT,
            Some(pile) if !pile.cut => LOOP_BEAT * BEAT,
            _ => BEAT,
        };
        CellOptions {
            radius: self.half_rooms,
            aspect: [self.flatten; 2],
            // A strand of fibres that slide is as stiff as they are many; the stiffer side bends less.
            crimp: self.crimp.unwrap_or(q / (p + q)),
            spacing: [self.warp_spacing, self.weft_spacing],
            // Under pressure the crimp of equal yarns would all go into one of them.
            sett: (self.crimp.is_none() && (0.8..1.25).contains(&(self.half_rooms[0] / self.half_rooms[1])))
                .then(|| sett(&self.draft)),
            beat,
            nodes: self.nodes() as usize,
            thickness: [0, 1].map(|side| self.threads[side].thickness.clone()),
        }
    }

    /// Control points from one crossing to the next: where warps twine, these are so far apart that they turn twice between them, and
    /// between few nodes they would slip into the wefts.
    fn nodes(&self) -> u32 {
        if self.draft.twines() { 7 * self.points / 4 } else { self.points }
    }

    /// Control points of its longest yarn, at least, as far as they are known before it is relaxed: lengths and whole repeats may
    /// come to a single yarn.
    pub fn least_points(&self) -> u64 {
        let known = |extent: Extent| match extent {
            Extent::Yarns(count) if !self.tile => count,
            _ => 1,
        };
        self.points_of([known(self.warps), known(self.wefts)])
    }

    /// Control points of the longest yarn of so many warps and wefts, at least.
    fn points_of(&self, count: [u32; 2]) -> u64 {
        /// Warps beyond which a weft may turn.
        const TURNING: u64 = 12;
        let [warps, wefts] = count.map(u64::from);
        let (points, longest) = (u64::from(self.nodes()), warps.max(wefts));
        if self.edges == Edges::Live || self.draft.cut_wefts() {
            return longest * points + 1;
        }
        // Picks of one yarn, one thickness and one layer are one strand.
        let kinds = |sorted: &mut dyn Iterator<Item = u64>| sorted.collect::<BTreeSet<u64>>().len().max(1) as u64;
        let yarns = kinds(&mut self.shuttles.iter().map(|yarn| u64::from(*yarn)))
            * kinds(&mut self.threads[1].thickness.iter().map(|thickness| thickness.to_bits()))
            * self.draft.layers() as u64;
        let turning = wefts.div_ceil(yarns) * warps.saturating_sub(TURNING);
        turning.max(wefts) * points
    }

    /// Whether its curves carry the widths and heights of their yarns.
    fn sized(&self) -> bool {
        self.flatten > 1.0 || self.threads.iter().any(|t| !t.thickness.is_empty())
    }

    /// Relaxes a repeat.
    ///
    /// # Errors
    /// Spacings or a cover that leave yarns no room; too many control points.
    pub fn relax(&self) -> Result<Cloth<'_>, Impossible> {
        let options = self.options();
        let free = || UnitCell::relax(&self.draft, &CellOptions { spacing: [None; 2], ..options.clone() });
        // Where the others may give way, yarns need not have more room than side by side.
        let side_by_side = || [0, 1].map(|side| full(&self.draft, &options, side));
        let too_tight = |least: [f64; 2], share: f64| {
            let tight = |side: usize| options.spacing[side].is_some_and(|s| s < least[side] * share);
            let side = [0, 1].into_iter().find(|&side| tight(side))?;
            Some(Impossible::TooTight { warp: side == 0, least: least[side] })
        };
        // Each yarn would meet all the others.
        if let Some(impossible) = too_tight(side_by_side(), HOPELESS) {
            return Err(impossible);
        }
        if let Some(cover) = self.cover {
            let spacing = self.spacing_for(cover, &UnitCell::relax(&self.draft, &options))?;
            return self.cloth(UnitCell::relax(&self.draft, &CellOptions { spacing, ..options.clone() }));
        }
        let cell = UnitCell::relax(&self.draft, &options);
        if options.spacing != [None; 2] && cell.overlap(options.unit())[1] > MOST_OVERLAP {
            let least = if options.spacing.iter().all(Option::is_some) { free().spacing } else { side_by_side() };
            // What the loom gives by itself always fits.
            if let Some(impossible) = too_tight(least, 0.999) {
                return Err(impossible);
            }
        }
        self.cloth(cell)
    }

    fn cloth(&self, cell: UnitCell) -> Result<Cloth<'_>, Impossible> {
        let count = |side: usize, extent: Extent, repeat: usize| {
            let spacing = cell.spacing[side];
            let wanted = match extent {
                Extent::Yarns(count) => f64::from(count),
                // Threads of several spacings are so far apart in the mean.
                Extent::Length(length) => length / spacing,
            };
            let paired = side == 0 && self.draft.twines() && !self.tile;
            if let Extent::Yarns(warps) = extent
                && paired
                && !warps.is_multiple_of(2)
            {
                return Err(Impossible::Unpaired { warps });
            }
            let of = if self.tile {
                repeat as f64
            } else if paired {
                2.0
            } else {
                1.0
            };
            let repeats = (wanted / of).round();
            if repeats < 1.0 && matches!(extent, Extent::Length(_)) {
                return Err(Impossible::TooSmall { warp: side == 0, least: of * spacing });
            }
            Ok((repeats.clamp(1.0, 1e9 / of) * of) as u32)
        };
        let count = [count(0, self.warps, self.draft.warps())?, count(1, self.wefts, self.draft.wefts())?];
        let least = 2 * self.draft.layers() as u32;
        if count[0] < least && self.edges != Edges::Live && !self.draft.cut_wefts() {
            return Err(Impossible::TooFewWarps { least });
        }
        // In f64, which does not overflow.
        let points = 2.0 * f64::from(count[0]) * f64::from(count[1]) * f64::from(self.nodes());
        if points > MAX_POINTS as f64 {
            return Err(Impossible::TooLarge);
        }
        Ok(Cloth { weave: self, cell, count })
    }

    /// Spacings at which the cloth covers so much of the plane, which is `closest` where spacings are open.
    fn spacing_for(&self, cover: f64, closest: &UnitCell) -> Result<[Option<f64>; 2], Impossible> {
        let options = self.options();
        let at = |factor: f64| [0, 1].map(|side| Some(options.spacing[side].unwrap_or(closest.spacing[side] * factor)));
        let covered = |factor: f64| {
            let cell = UnitCell::relax(&self.draft, &CellOptions { spacing: at(factor), ..options.clone() });
            1.0 - cell.see_through()
        };
        let most = 1.0 - closest.see_through();
        if cover > most + 0.02 {
            return Err(Impossible::TooMuchCover { most });
        }
        if cover >= most {
            return Ok(at(1.0));
        }
        // Cover falls as spacings grow; yarns that do not touch any more are straight.
        let (mut low, mut high) = (1.0, 2.0);
        while covered(high) > cover {
            if high >= FARTHEST {
                return Err(Impossible::TooLittleCover { least: covered(FARTHEST) });
            }
            (low, high) = (high, 2.0 * high);
        }
        for _ in 0..10 {
            let middle = 0.5 * (low + high);
            if covered(middle) > cover { low = middle } else { high = middle }
        }
        Ok(at(0.5 * (low + high)))
    }

    /// The warps, from left to right, then the wefts, from bottom to top; each an open curve.
    ///
    /// # Errors
    /// Spacings or a cover that leave yarns no room; too many control points.
    pub fn strands(&self) -> Result<Vec<PatternStrand>, Impossible> {
        Ok(self.relax()?.strands())
    }
}

impl Cloth<'_> {
    /// What it came to.
    pub fn measures(&self) -> Measures {
        let cell = &self.cell;
        let crimp = [0, 1].map(|side| {
            let straight = cell.spacing[1 - side] * cell.yarns[1 - side].len() as f64;
            cell.length(side) / (straight * cell.yarns[side].len() as f64) - 1.0
        });
        let (low, high) = cell
            .yarns
            .iter()
            .flatten()
            .flatten()
            .fold((f64::MAX, f64::MIN), |(l, h), n| (l.min(n.height - n.axes[1]), h.max(n.height + n.axes[1])));
        let size = [0, 1].map(|side| self.size(side));
        let length = [0, 1].map(|side| f64::from(self.count[side]) * size[1 - side] * (1.0 + crimp[side]));
        let thickness = high - low;
        Measures { spacing: cell.spacing, see_through: cell.see_through(), crimp, thickness, size, length }
    }

    /// Width of the warps, or height of the wefts.
    fn size(&self, side: usize) -> f64 {
        self.cell.spacing[side] * room_before(&self.weave.threads[side].spacing, i64::from(self.count[side]))
    }

    /// Where a place of a side is, from the middle of the cloth: yarn i goes from i to i + 1, and its centre is at i + 1/2.
    fn position(&self, side: usize, place: f64) -> f64 {
        let given = &self.weave.threads[side].spacing;
        let spacing = self.cell.spacing[side];
        if given.is_empty() {
            return (place - 0.5 * f64::from(self.count[side])) * spacing;
        }
        let centre = |yarn: i64| 0.5 * (room_before(given, yarn) + room_before(given, yarn + 1));
        let yarn = (place - 0.5).floor();
        let (a, b) = (centre(yarn as i64), centre(yarn as i64 + 1));
        (a + (place - 0.5 - yarn) * (b - a)) * spacing - 0.5 * self.size(side)
    }

    /// Control points of its longest yarn, at least.
    pub fn least_points(&self) -> u64 {
        self.weave.points_of(self.count)
    }

    /// Numbers of warps and wefts.
    pub fn count(&self) -> [u32; 2] {
        self.count
    }

    /// The yarns as the draft has them, cut all around, without pile: warps from left to right, then wefts from bottom to
    /// top.
    pub fn ground(&self) -> Vec<PatternStrand> {
        let sides = (0..2).flat_map(|side| (0..self.count[side]).map(move |index| (side, index)));
        self.widened(sides.map(|(side, index)| self.strand(side, index, 0)).collect())
    }

    /// Strands as wide as their yarns, which were as wide as the room that these take.
    fn widened(&self, mut strands: Vec<PatternStrand>) -> Vec<PatternStrand> {
        for strand in &mut strands {
            let half_width = self.weave.half_width[usize::from(strand.kind == StrandKind::Weft)];
            strand.curve.radii.iter_mut().flatten().for_each(|r| *r /= half_width);
        }
        strands
    }

    /// The yarns of the cloth: warps from left to right, those of the selvedges last, then wefts from bottom to top. Selvedges
    /// make one strand of the wefts of a shuttle, with the number of the first.
    pub fn strands(&self) -> Vec<PatternStrand> {
        let measures = self.measures();
        let Measures { thickness, size, .. } = measures;
        let cut = self.weave.draft.cut_wefts();
        let edges = match self.weave.edges {
            Edges::Finished if cut || measures.least_hemmed() > size[1] => Edges::Selvedge,
            edges => edges,
        };
        let hem = if edges == Edges::Finished { edges::hem_wefts(thickness, self.cell.spacing[1]) } else { 0 };
        let numbers = [0..self.count[0], 0..self.count[1] + 2 * hem];
        let strands = |side: usize| {
            numbers[side].clone().flat_map(move |index| {
                let number = i64::from(index) - if side == 1 { i64::from(hem) } else { 0 };
                pile::raise(self, self.strand(side, index, hem), number, i64::from(hem))
            })
        };
        let diameter = self.weave.half_rooms[0] + self.weave.half_rooms[1];
        let mut strands = pile::settle(strands(0).chain(strands(1)).collect(), diameter);
        // Wefts that are cut end where warps are drawn out.
        if edges != Edges::Live && !cut {
            strands = selvedge::selvedges(self, strands, hem);
        }
        if let Edges::Fringe(length) = edges {
            edges::fringe(self, &mut strands, length);
        }
        if edges == Edges::Finished {
            edges::hem(&mut strands, size[1], thickness);
        }
        self.widened(strands)
    }

    /// A yarn across all of the other side, with half a spacing beyond the first and the last. There are `hem` more wefts
    /// at the bottom and at the top.
    fn strand(&self, side: usize, index: u32, hem: u32) -> PatternStrand {
        let cell = &self.cell;
        let nodes = cell.nodes as i64;
        let hem = i64::from(hem);
        // The first and the number of the yarns on both sides.
        let range = [(0, i64::from(self.count[0])), (-hem, i64::from(self.count[1]) + 2 * hem)];
        let (first, others) = range[1 - side];
        let number = range[side].0 + i64::from(index);
        let across = self.position(side, number as f64 + 0.5);
        let yarn = &cell.yarns[side][number.rem_euclid(cell.yarns[side].len() as i64) as usize];
        let steps = first * nodes - nodes / 2..=(first + others - 1) * nodes + nodes / 2;
        let node = |k: i64| yarn[k.rem_euclid(yarn.len() as i64) as usize];
        let place = |k: i64| k as f64 / nodes as f64 + 0.5;
        let point = |k: i64| {
            let (a, b) = (self.position(1 - side, place(k)), across + node(k).aside);
            if side == 0 { DVec3::new(b, a, node(k).height) } else { DVec3::new(a, b, node(k).height) }
        };
        let coordinates = |k: i64| {
            let (i, place) = (number as f32 + 0.5, place(k) as f32);
            if side == 0 { [i, place] } else { [place, i] }
        };
        // The short axis is in the plane that stands on the cloth along the yarn.
        let flattening = |k: i64| {
            let tangent = (point(k + 1) - point(k - 1)).normalize();
            let [wide, high] = node(k).axes;
            ((DVec3::Z - tangent.z * tangent).normalize_or(DVec3::Z) * (high / wide)).as_vec3()
        };
        let kind = [StrandKind::Warp, StrandKind::Weft][side];
        let mut made = strand(kind, index, steps.clone().map(|k| (point(k), coordinates(k))));
        if self.weave.sized() {
            made.curve.radii = Some(steps.clone().map(|k| node(k).axes[0]).collect());
            made.curve.flattening = Some(steps.map(flattening).collect());
        }
        made
    }
}

/// Room of the yarns before one, in mean spacings; yarns repeat.
fn room_before(spacing: &[f64], yarn: i64) -> f64 {
    let count = spacing.len() as i64;
    if count == 0 {
        return yarn as f64;
    }
    let rest = yarn.rem_euclid(count) as usize;
    yarn.div_euclid(count) as f64 * spacing.iter().sum::<f64>() + spacing[..rest].iter().sum::<f64>()
}

/// A round strand through points, each with its place in the cloth.
fn strand(kind: StrandKind, index: u32, points: impl Iterator<Item = (DVec3, [f32; 2])>) -> PatternStrand {
    let (points, coordinates) = points.unzip();
    PatternStrand {
        curve: Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening: None },
        kind,
        index,
        coordinates,
        share: 1.0,
    }
}
