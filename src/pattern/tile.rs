//! A patch of cloth that repeats along x and y: what is laid over garments.
//!
//! Every maker of cloth can give one: a [`Knit`], a [`Weave`], a periodic curve file. A tile knows its stitches and its
//! yarns and nothing of where they came from.

use glam::{DVec2, DVec3, Vec3};
use rstar::RTree;

use super::{
    PatternStrand, StrandKind,
    chart::ChartError,
    knit::{Alike, Knit, Thickness, flatten_where_touching},
    relax::{Ends, Relaxation, Rope, sheared},
    weave::{Extent, Impossible, Weave},
};
use crate::geometry::{
    chain::spline_through,
    curve::{Basis, Curve},
    overlap::{Overlap, overlap_of_plied},
    spline::evaluate,
};

/// A periodic patch of cloth in the plane z = 0, right side towards +z, its lower left corner at the origin.
#[derive(Clone, Debug)]
pub struct Tile {
    /// Its width and height, after which it repeats, in the unit of all its lengths.
    pub period: DVec2,
    /// Stitches and rows of a knit in it, ends and picks of a weave.
    pub counts: [u32; 2],
    /// Its yarns, each once.
    pub strands: Vec<TileStrand>,
    /// Width over height to which stitches press its yarns where they lie on each other: sections follow from where yarns are.
    /// `None` where sections are as the tile's maker left them.
    pub flatten: Option<f64>,
}

/// One yarn of a [`Tile`] from its start to where it repeats.
#[derive(Clone, Debug)]
pub struct TileStrand {
    /// What it is in its cloth.
    pub kind: StrandKind,
    /// Which of its kind in the tile, from 0: row of a knit, warp or weft.
    pub index: u32,
    /// Points that it passes through smoothly; the point after the last is the first one, `step` periods on.
    pub points: Vec<DVec3>,
    /// How many periods across and up lie between its start and its own continuation; both 0 for a ring.
    pub step: [i32; 2],
    /// Its outer radius where it is round.
    pub radius: f64,
    /// Half of the room that it takes beside others, over its radius: see
    /// [`mean_half_width`](crate::geometry::yarn::mean_half_width).
    pub half_width: f64,
    /// Its section at each point; empty if it is round everywhere.
    pub sections: Vec<Section>,
    /// At each point its place in stitches and rows (ends and picks) from the tile's corner: what colours are laid by.
    pub coordinates: Vec<[f32; 2]>,
}

/// A section that is pressed flat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Half of its longer axis.
    pub half_width: f32,
    /// Direction of its shorter axis times the ratio of the shorter to the longer one, as [`Curve::flattening`] has it.
    pub short_axis: Vec3,
}

/// A cell of a knit as its maker relaxes it: see [`Tile::of_rows`].
pub(super) struct RelaxedRows {
    pub(super) period: DVec2,
    pub(super) counts: [u32; 2],
    /// The points of each row, with wale and course.
    pub(super) rows: Vec<Vec<(DVec3, [f32; 2])>>,
}

impl Tile {
    /// The repeat of a knit at its own gauge, of yarn that stitches press flat where they lie on each other.
    ///
    /// # Errors
    /// A chart that grows or shrinks has no repeat.
    pub fn of_knit(knit: &Knit, yarn: &Thickness) -> Result<Self, ChartError> {
        let mut tile = Self::of_rows(knit.relaxed_rows()?, yarn);
        tile.press(0.0);
        Ok(tile)
    }

    /// A tile of rows in units of a knit of such yarn, which is round.
    fn of_rows(cell: RelaxedRows, yarn: &Thickness) -> Self {
        let unit = yarn.pressed();
        let strand = |(row, points): (usize, Vec<(DVec3, [f32; 2])>)| TileStrand {
            kind: StrandKind::Course,
            index: row as u32,
            points: points.iter().map(|(p, _)| *p * unit).collect(),
            step: [1, 0],
            radius: yarn.radius,
            half_width: yarn.half_width,
            sections: Vec::new(),
            coordinates: points.into_iter().map(|(_, at)| at).collect(),
        };
        let strands = cell.rows.into_iter().enumerate().map(strand).collect();
        Self { period: cell.period * unit, counts: cell.counts, strands, flatten: Some(yarn.flatten) }
    }

    /// How its yarns lie on each other, of a knit.
    pub fn pressing(&self) -> Option<Thickness> {
        let first = self.strands.first()?;
        Some(Thickness { radius: first.radius, half_width: first.half_width, flatten: self.flatten? })
    }

    /// Presses the yarns of a knit flat where they lie on each other when it is sheared, see [`Self::strained`].
    fn press(&mut self, shear: f64) {
        let Some(yarn) = self.pressing() else { return };
        let row = |strand: &TileStrand| {
            let next = strand.points[0] + strand.jump(self.period);
            let points = strand.points.iter().chain([&next]).map(|p| sheared(*p, shear)).collect();
            let curve = Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening: None };
            PatternStrand { curve, kind: strand.kind, index: strand.index, coordinates: Vec::new(), share: 1.0 }
        };
        let mut rows: Vec<PatternStrand> = self.strands.iter().map(row).collect();
        flatten_where_touching(&mut rows, &yarn, &Alike::Tile { period: self.period, shear });
        // Drawn back upright, as points are.
        let section = |(half_width, axis): (&f64, &Vec3)| {
            let upright = sheared(axis.as_dvec3(), -shear).as_vec3();
            Section { half_width: *half_width as f32, short_axis: upright.normalize_or(Vec3::Z) * axis.length() }
        };
        for (strand, row) in self.strands.iter_mut().zip(&rows) {
            let both = row.curve.radii.iter().flatten().zip(row.curve.flattening.iter().flatten());
            strand.sections = both.map(section).take(strand.points.len()).collect();
        }
    }

    /// The repeat of a weave, its yarns as flat as they lie in it and without pile; its numbers of warps and wefts do not
    /// matter.
    ///
    /// # Errors
    /// Spacings or a cover that leave yarns no room; too many control points.
    pub fn of_weave(weave: &Weave) -> Result<Self, Impossible> {
        let (warps, wefts) = (weave.draft.warps() as u32, weave.draft.wefts() as u32);
        // The one in the middle of three repeats has its like on both sides.
        let (three_warps, three_wefts) = (Extent::Yarns(3 * warps), Extent::Yarns(3 * wefts));
        let piece = Weave { warps: three_warps, wefts: three_wefts, ..weave.clone() };
        let cloth = piece.relax()?;
        let [warp_spacing, weft_spacing] = cloth.measures().spacing;
        let (width, height) = (f64::from(warps) * warp_spacing, f64::from(wefts) * weft_spacing);
        let corner = DVec3::new(-0.5 * width, -0.5 * height, 0.0);
        let mut strands = Vec::new();
        for strand in cloth.ground() {
            let is_warp = strand.kind == StrandKind::Warp;
            let (own, along, axis) = if is_warp { (warps, wefts, 1) } else { (wefts, warps, 0) };
            if !(own..2 * own).contains(&strand.index) {
                continue;
            }
            // From one crossing to the same one a repeat later: crossings are points.
            let from = along as f32 + 0.5 - 1e-4;
            let inside = |c: &[f32; 2]| (from..from + along as f32).contains(&c[axis]);
            let both = strand.curve.points.iter().zip(&strand.coordinates).filter(|(_, c)| inside(c));
            let (widths, axes) = (strand.curve.radii.iter().flatten(), strand.curve.flattening.iter().flatten());
            let sections = widths
                .zip(axes)
                .map(|(&half_width, &short_axis)| Section { half_width: half_width as f32, short_axis });
            strands.push(TileStrand {
                kind: strand.kind,
                index: strand.index - own,
                points: both.clone().map(|(p, _)| *p - corner).collect(),
                step: if is_warp { [0, 1] } else { [1, 0] },
                radius: weave.yarn_radii()[usize::from(!is_warp)],
                half_width: weave.half_width[usize::from(!is_warp)],
                sections: sections.zip(&strand.coordinates).filter(|(_, c)| inside(c)).map(|(s, _)| s).collect(),
                coordinates: both.map(|(_, c)| [c[0] - warps as f32, c[1] - wefts as f32]).collect(),
            });
        }
        Ok(Self { period: DVec2::new(width, height), counts: [warps, wefts], strands, flatten: None })
    }

    /// A tile of endless yarns of which nothing else is known: stitches and rows are counted from their shape.
    pub fn of_strands(period: DVec2, mut strands: Vec<TileStrand>) -> Self {
        let upright = |s: &TileStrand| s.step[0] == 0 && s.step[1] != 0;
        let warps = strands.iter().filter(|s| upright(s)).count() as u32;
        let across = strands.iter().filter(|s| s.step[0] != 0).map(|s| s.step[0].unsigned_abs()).sum::<u32>().max(1);
        let columns = if warps > 0 {
            warps
        } else {
            strands.iter().filter(|s| s.step[0] != 0).map(|s| s.heads() / s.step[0].unsigned_abs()).max().unwrap_or(1)
        };
        let counts = [columns.max(1), across];
        let (mut warp, mut row) = (0, 0);
        let stitch = period / DVec2::new(f64::from(counts[0]), f64::from(counts[1]));
        // The middle of the lowest row, and of the leftmost warp, half a stitch from the corner.
        let middle = |s: &TileStrand| s.points.iter().sum::<DVec3>() / s.points.len().max(1) as f64;
        let least = |axis: usize, upright_ones: bool| {
            let own = strands.iter().filter(|s| upright(s) == upright_ones && s.step != [0, 0]);
            own.map(|s| middle(s)[axis].rem_euclid(period[axis])).reduce(f64::min)
        };
        let corner = DVec2::new(
            least(0, true).map_or(0.0, |x| x - 0.5 * stitch.x),
            least(1, false).map_or(0.0, |y| y - 0.5 * stitch.y),
        );
        for strand in &mut strands {
            let to = DVec2::new(middle(strand).x, middle(strand).y) - corner + 1e-6 * stitch;
            let mut shift = -(to / period).floor() * period;
            // Along its own way a yarn may begin anywhere.
            shift[usize::from(upright(strand))] = 0.0;
            strand.points.iter_mut().for_each(|p| *p += (shift - corner).extend(0.0));
        }
        let order = |s: &TileStrand| middle(s)[usize::from(!upright(s))];
        strands.sort_by(|a, b| upright(a).cmp(&upright(b)).then(order(a).total_cmp(&order(b))));
        for strand in &mut strands {
            let number = if upright(strand) { &mut warp } else { &mut row };
            strand.index = *number;
            *number += 1;
            strand.kind = match (upright(strand), warps > 0) {
                (true, _) => StrandKind::Warp,
                (false, true) => StrandKind::Weft,
                (false, false) => StrandKind::Course,
            };
            strand.coordinates =
                strand.points.iter().map(|p| [(p.x / stitch.x) as f32, (p.y / stitch.y) as f32]).collect();
        }
        Self { period, counts, strands, flatten: None }
    }

    /// Width and height of a stitch.
    pub fn stitch(&self) -> DVec2 {
        self.period / DVec2::new(f64::from(self.counts[0]), f64::from(self.counts[1]))
    }

    /// Length of all its yarns.
    pub fn length(&self) -> f64 {
        self.strands.iter().map(|s| s.length(self.period)).sum()
    }

    /// The thickest yarn's diameter.
    pub fn diameter(&self) -> f64 {
        2.0 * self.strands.iter().map(|s| s.radius).fold(0.0, f64::max)
    }

    /// The tile, its yarns and their thickness, times a number.
    pub fn scaled(mut self, by: f64) -> Self {
        self.period *= by;
        for strand in &mut self.strands {
            strand.radius *= by;
            strand.points.iter_mut().for_each(|p| *p *= by);
            strand.sections.iter_mut().for_each(|s| s.half_width *= by as f32);
        }
        self
    }

    /// The same cloth pulled to another period: yarns keep length and thickness, loops open, close and turn. Yarns of
    /// unequal thickness are only moved apart.
    pub fn pulled(&self, period: DVec2, rounds: usize) -> Self {
        self.strained(period, 0.0, rounds)
    }

    /// The same cloth pulled to another period and sheared: the tile above begins `shear` times its height further along x.
    /// The yarns are given as they lie where the tile is drawn back upright, so that it repeats along x and y as any other
    /// does.
    pub fn strained(&self, period: DVec2, shear: f64, rounds: usize) -> Self {
        let stretch = period / self.period;
        let mut out = self.clone();
        out.period = period;
        for strand in &mut out.strands {
            for p in &mut strand.points {
                (p.x, p.y) = (p.x * stretch.x, p.y * stretch.y);
            }
        }
        let even = self.strands.iter().all(|s| (2.0 * s.radius - self.diameter()).abs() < 1e-6 * self.diameter());
        let touching = self.pressing().map(|yarn| yarn.pressed());
        let diameter = touching.or_else(|| self.closest_crossing()).unwrap_or_else(|| self.diameter());
        if !even || diameter <= 0.0 || self.strands.iter().any(|s| s.step[0] != 0 && s.step[1] != 0) {
            return out;
        }
        let rope = |(moved, at_rest): (&TileStrand, &TileStrand)| Rope {
            points: moved.points.iter().map(|p| sheared(*p, shear) / diameter).collect(),
            pinned: vec![false; moved.points.len()],
            ends: Ends::Joined(sheared(moved.jump(period), shear) / diameter),
            rest: at_rest.length(self.period) / diameter / moved.points.len() as f64,
        };
        let ropes = out.strands.iter().zip(&self.strands).map(rope).collect();
        let mut relaxation = Relaxation { ropes, period: Some(period / diameter), shear };
        relaxation.run(rounds, |_| {});
        for (strand, rope) in out.strands.iter_mut().zip(relaxation.ropes) {
            strand.points = rope.points.into_iter().map(|p| sheared(p, -shear) * diameter).collect();
        }
        out.press(shear);
        out
    }

    /// How far apart the centre lines of a warp and a weft are where they press on each other, if yarns are pressed flat:
    /// as round yarns of that diameter do, they lie on each other.
    fn closest_crossing(&self) -> Option<f64> {
        let of = |axis: usize| {
            let pressed = self.strands.iter().filter(move |s| s.step[axis] != 0 && !s.sections.is_empty());
            pressed.flat_map(|s| &s.points)
        };
        let inside = |p: DVec3| (p.truncate() - self.period * (p.truncate() / self.period).floor()).extend(p.z);
        let warps = RTree::bulk_load(of(1).map(|p| inside(*p).to_array()).collect());
        // Distances across the tile's border count too.
        let around = (-1..=1).flat_map(|y| (-1..=1).map(move |x| DVec2::new(f64::from(x), f64::from(y))));
        let shifts: Vec<DVec3> = around.map(|tiles| (tiles * self.period).extend(0.0)).collect();
        let distances = of(0).flat_map(|p| {
            let nearest = |shift: &DVec3| {
                let at = inside(*p) + *shift;
                Some(at.distance(DVec3::from_array(*warps.nearest_neighbor(&at.to_array())?)))
            };
            shifts.iter().filter_map(nearest).collect::<Vec<_>>()
        });
        distances.reduce(f64::min)
    }

    /// How far its yarns run into each other, lying flat; `None` where nothing lies near, and where yarns are so much thicker
    /// than the tile is wide that this would take more than 2^24 points.
    pub fn overlap(&self) -> Option<Overlap> {
        // Enough of it that most of the yarn has all its neighbours.
        let count = (16.0 * self.diameter() / self.period).ceil().max(DVec2::splat(3.0));
        let points: usize = self.strands.iter().map(|s| s.points.len()).sum();
        if count.max_element() > 3.0 && count.element_product() * points as f64 > f64::from(1 << 24) {
            return None;
        }
        let count = count.as_uvec2();
        let piece = self.repeated(count.x, count.y);
        let curves: Vec<(Curve, Vec<f64>, f64)> = piece
            .strands
            .into_iter()
            .map(|s| {
                let (radii, flattening) = s.radii_and_flattening();
                let closed = s.step == [0, 0];
                let curve = Curve { basis: Basis::CatmullRom, closed, points: s.points, radii: None, flattening };
                (curve, radii, s.half_width)
            })
            .collect();
        overlap_of_plied(curves.iter().map(|(curve, radii, half_width)| (curve, radii.as_slice(), *half_width)))
    }

    /// So many tiles beside and above each other as one: what is relaxed must not meet its own images.
    pub fn repeated(&self, across: u32, up: u32) -> Self {
        let [columns, rows] = self.counts;
        let mut strands = Vec::new();
        for strand in &self.strands {
            // Along its way copies continue each other, if it goes straight across or up.
            let [run, beside] = match strand.step {
                [1 | -1, 0] => [across, 1],
                [0, 1 | -1] => [up, 0],
                _ => [1, 2],
            };
            let copies: Vec<[u32; 2]> = match beside {
                0 => (0..across).map(|x| [x, 0]).collect(),
                1 => (0..up).map(|y| [0, y]).collect(),
                _ => (0..up).flat_map(|y| (0..across).map(move |x| [x, y])).collect(),
            };
            for (number, [x, y]) in copies.into_iter().enumerate() {
                let mut copy =
                    TileStrand { points: Vec::new(), sections: Vec::new(), coordinates: Vec::new(), ..strand.clone() };
                copy.index = strand.index + number as u32 * if beside == 0 { columns } else { rows };
                let step = DVec2::new(f64::from(strand.step[0]), f64::from(strand.step[1]));
                for k in 0..run {
                    let tiles = DVec2::new(f64::from(x), f64::from(y)) + f64::from(k) * step;
                    let shift = (tiles * self.period).extend(0.0);
                    let stitches = tiles * DVec2::new(f64::from(columns), f64::from(rows));
                    copy.points.extend(strand.points.iter().map(|p| *p + shift));
                    copy.sections.extend(&strand.sections);
                    let moved = |c: &[f32; 2]| [c[0] + stitches.x as f32, c[1] + stitches.y as f32];
                    copy.coordinates.extend(strand.coordinates.iter().map(moved));
                }
                strands.push(copy);
            }
        }
        let period = self.period * DVec2::new(f64::from(across), f64::from(up));
        Self { period, counts: [columns * across, rows * up], strands, flatten: self.flatten }
    }
}

impl TileStrand {
    /// Half of the section's longer axis at each point, and what presses it flat there, if anything does.
    fn radii_and_flattening(&self) -> (Vec<f64>, Option<Vec<Vec3>>) {
        if self.sections.is_empty() {
            return (vec![self.radius; self.points.len()], None);
        }
        let (widths, axes) = self.sections.iter().map(|s| (f64::from(s.half_width), s.short_axis)).unzip();
        (widths, Some(axes))
    }

    /// From its start to its own continuation.
    pub fn jump(&self, period: DVec2) -> DVec3 {
        (DVec2::new(f64::from(self.step[0]), f64::from(self.step[1])) * period).extend(0.0)
    }

    /// Point i, where those before the first and after the last are of the repeats around.
    fn around(&self, i: isize, period: DVec2) -> DVec3 {
        let n = self.points.len() as isize;
        self.points[i.rem_euclid(n) as usize] + self.jump(period) * i.div_euclid(n) as f64
    }

    /// The place between point i and the next.
    fn at(&self, i: isize, u: f64, period: DVec2) -> DVec3 {
        let p = [-1, 0, 1, 2].map(|k| self.around(i + k, period).extend(0.0));
        evaluate(Basis::CatmullRom, p, u).at.truncate()
    }

    /// Its length from its start to its own continuation.
    pub fn length(&self, period: DVec2) -> f64 {
        self.lengths(period).last().copied().unwrap_or(0.0)
    }

    /// Where it is at steps between points, [`STEPS`] each, to its own continuation.
    fn steps(&self, period: DVec2) -> Vec<DVec3> {
        let of_point = |i: isize| (1..=STEPS).map(move |k| self.at(i, k as f64 / STEPS as f64, period));
        std::iter::once(self.at(0, 0.0, period)).chain((0..self.points.len() as isize).flat_map(of_point)).collect()
    }

    /// Length from the start to each of its steps.
    fn lengths(&self, period: DVec2) -> Vec<f64> {
        summed(self.steps(period).windows(2).map(|w| w[1].distance(w[0])))
    }

    /// Places of `count` points evenly along the yarn, in points from the first, the first among them.
    pub fn evenly(&self, count: usize, period: DVec2) -> Vec<f64> {
        Self::shared_out(&self.lengths(period), count)
    }

    /// As [`Self::evenly`], but closer to each other where the yarn bends: a spline through them keeps closer to it.
    pub fn closer_in_bends(&self, count: usize, period: DVec2) -> Vec<f64> {
        let ways: Vec<DVec3> = self.steps(period).windows(2).map(|w| w[1] - w[0]).collect();
        let weight = |k: usize| {
            let (before, after) = (ways[(k + ways.len() - 1) % ways.len()], ways[(k + 1) % ways.len()]);
            let length = ways[k].length();
            let bend = before.angle_between(after) / (2.0 * length).max(1e-300);
            length * (1.0 + 4.0 * self.radius * bend).sqrt()
        };
        Self::shared_out(&summed((0..ways.len()).map(weight)), count)
    }

    /// Places between which a sum over steps grows by as much, the first at its start.
    fn shared_out(lengths: &[f64], count: usize) -> Vec<f64> {
        let total = lengths[lengths.len() - 1];
        (0..count)
            .map(|k| {
                let wanted = total * k as f64 / count as f64;
                let i = lengths.partition_point(|&l| l <= wanted).clamp(1, lengths.len() - 1) - 1;
                let span = (lengths[i + 1] - lengths[i]).max(1e-300);
                (i as f64 + ((wanted - lengths[i]) / span).clamp(0.0, 1.0)) / STEPS as f64
            })
            .collect()
    }

    /// Control points of the uniform cubic B-spline that passes through its places, given in points from the first. As
    /// the points, they repeat one step on.
    pub fn spline(&self, places: &[f64], period: DVec2) -> Vec<DVec3> {
        let at = |place: &f64| self.at(place.floor() as isize, place.fract(), period);
        periodic_spline(&places.iter().map(at).collect::<Vec<_>>(), self.jump(period))
    }

    /// Sections at places, given in points from the first, as control points of the same spline have them; empty if it is
    /// round. Of those between two places the narrowest counts, so that nothing that presses is passed by.
    pub fn sections_at(&self, places: &[f64]) -> Vec<Section> {
        if self.sections.is_empty() {
            return Vec::new();
        }
        let n = self.sections.len();
        let of = |i: isize| self.sections[i.rem_euclid(n as isize) as usize];
        let at = |place: f64| {
            let (i, u) = (place.floor() as isize, place.fract() as f32);
            let (a, b) = (of(i), of(i + 1));
            // An axis has no sign.
            let next = if a.short_axis.dot(b.short_axis) < 0.0 { -b.short_axis } else { b.short_axis };
            Section {
                half_width: a.half_width + u * (b.half_width - a.half_width),
                short_axis: a.short_axis.lerp(next, u),
            }
        };
        let around = |k: usize| {
            let place = |k: isize| {
                let (turns, k) = (k.div_euclid(places.len() as isize), k.rem_euclid(places.len() as isize));
                places[k as usize] + (turns * n as isize) as f64
            };
            let [before, own, after] = [-1, 0, 1].map(|by| place(k as isize + by));
            let between = own.midpoint(before).floor() as isize..=own.midpoint(after).ceil() as isize;
            let narrow = |s: &Section| s.half_width * s.short_axis.length();
            between.map(of).fold(at(own), |a, b| if narrow(&b) < narrow(&a) { b } else { a })
        };
        let mut sections: Vec<Section> = (0..places.len()).map(around).collect();
        // Widths and ratios follow the spline, directions are those of its knots.
        let sizes = sections.iter().map(|s| DVec3::new(s.half_width.into(), s.short_axis.length().into(), 0.0));
        let sizes: Vec<DVec3> = sizes.collect();
        for (section, size) in sections.iter_mut().zip(periodic_spline(&sizes, DVec3::ZERO)) {
            section.half_width = size.x as f32;
            section.short_axis = section.short_axis.normalize_or(Vec3::Z) * (size.y as f32).clamp(FLATTEST, 1.0);
        }
        sections
    }

    /// How often it rises to a head: as many loops as a row of a knit has in a period.
    fn heads(&self) -> u32 {
        let (low, high) = self.points.iter().fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p.y), h.max(p.y)));
        let middle = 0.5 * (low + high);
        let n = self.points.len();
        let rises = (0..n).filter(|&i| self.points[i].y < middle && self.points[(i + 1) % n].y >= middle).count();
        rises.max(1) as u32
    }
}

/// Sums of the first none, one, two and so on.
fn summed(parts: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sum = 0.0;
    let sums = parts.map(|part| {
        sum += part;
        sum
    });
    std::iter::once(0.0).chain(sums).collect()
}

/// Control points of the uniform cubic B-spline through knots that go on `jump` further with the first of them.
fn periodic_spline(knots: &[DVec3], jump: DVec3) -> Vec<DVec3> {
    // After so many knots a B-spline has forgotten another.
    const FAR: usize = 28;
    let n = knots.len();
    let knot = |k: usize| knots[k % n] + jump * (k / n) as f64;
    // The repeats before the first are counted from some way back.
    let back = FAR.div_ceil(n) * n;
    let all = (0..back + n + FAR).map(knot).collect::<Vec<_>>();
    let shift = jump * (back / n) as f64;
    // One control point lies before the first knot.
    spline_through(all.into_iter()).iter().skip(back + 1).take(n).map(|p| *p - shift).collect()
}

/// One link of a chain of loops, each drawn through the one before, as it relaxes with links `link` apart: control points
/// of a B-spline in yarn diameters, x along the chain, y across, z out of the front, where loops lie as a row of V. The
/// next link is the same, `link` further on.
pub fn chain(link: f64) -> Vec<DVec3> {
    const LINKS: usize = 4;
    const POINTS: usize = 16;
    // Out of the loop before, along the front, round, back, and behind to the next.
    let way = [
        [0.3, -0.3, 0.0],
        [0.8, -0.8, 0.8],
        [0.5 * link + 0.4, -1.0, 0.95],
        [link + 0.5, -0.95, 0.5],
        [link + 1.15, -0.35, 0.2],
        [link + 1.15, 0.35, 0.2],
        [link + 0.5, 0.95, 0.5],
        [0.5 * link + 0.4, 1.0, 0.95],
        [0.8, 0.8, 0.8],
        [0.3, 0.3, 0.0],
        [0.2, 0.2, -0.8],
        [0.6 * link, 0.0, -0.9],
    ];
    let period = DVec2::new(LINKS as f64 * link, 20.0);
    let strand = TileStrand {
        kind: StrandKind::Course,
        index: 0,
        points: (0..LINKS).flat_map(|k| way.map(|[x, y, z]| DVec3::new(x + k as f64 * link, y, z))).collect(),
        step: [1, 0],
        radius: 0.5,
        half_width: 1.0,
        sections: Vec::new(),
        coordinates: Vec::new(),
    };
    let places = strand.evenly(LINKS * 2 * POINTS, period);
    let points = places.iter().map(|p| strand.at(p.floor() as isize, p.fract(), period)).collect();
    let fine = TileStrand { points, ..strand };
    let length = fine.length(period);
    let count = fine.points.len();
    let rope = Rope {
        pinned: vec![false; count],
        ends: Ends::Joined(fine.jump(period)),
        rest: length / count as f64,
        points: fine.points.clone(),
    };
    let mut relaxation = Relaxation { ropes: vec![rope], period: Some(period), shear: 0.0 };
    relaxation.run(300, |_| {});
    let relaxed = TileStrand { points: relaxation.ropes.swap_remove(0).points, ..fine };
    let places = relaxed.evenly(LINKS * POINTS, period);
    relaxed.spline(&places, period).into_iter().take(POINTS).collect()
}

/// No section is flatter than this, as the ratio of its axes.
const FLATTEST: f32 = 0.2;
/// Steps between two points at which lengths are known.
const STEPS: usize = 4;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::{
        chart::Chart,
        draft::Draft,
        knit::{Edges, Form, POINTS, ROW_HEIGHT, Rims, STITCH_WIDTH, YARN_PER_STITCH},
    };

    fn stockinette() -> Tile {
        let knit = Knit {
            chart: Chart::named("stockinette").unwrap(),
            stitches: 1,
            rows: 1,
            form: Form::Flat,
            stitch_width: Some(STITCH_WIDTH),
            row_height: Some(ROW_HEIGHT),
            yarn_per_stitch: Some(YARN_PER_STITCH),
            edges: Edges::Live,
            rims: Rims::default(),
            points: POINTS,
            colors: None,
            flat: true,
        };
        Tile::of_knit(&knit, &Thickness::round(0.25)).unwrap()
    }

    #[test]
    fn a_knit_gives_its_repeat() {
        let tile = stockinette();
        assert!((tile.stitch() - 0.5 * DVec2::new(STITCH_WIDTH, ROW_HEIGHT)).length() < 1e-9, "{}", tile.stitch());
        let found = tile.overlap().unwrap();
        assert!(found.share < 0.05 && found.nearest < 1.1, "{found:?}");
        // Yarns a thousand times as thick as the tile would run through millions of its repeats.
        let mut thick = tile.clone();
        thick.strands.iter_mut().for_each(|s| s.radius *= 1000.0);
        assert!(thick.overlap().is_none());
        let per_stitch = tile.length() / f64::from(tile.counts[0] * tile.counts[1]) / 0.5;
        assert!((per_stitch - YARN_PER_STITCH).abs() < 0.4, "{per_stitch}");
        assert_eq!(tile.strands.len(), tile.counts[1] as usize);
        let last = tile.strands[0].coordinates.last().unwrap()[0];
        assert!(last < tile.counts[0] as f32 && last > tile.counts[0] as f32 - 0.1);
    }

    #[test]
    fn a_weave_gives_its_repeat() {
        let weave = Weave { crimp: Some(0.5), ..Weave::of(Draft::named("twill 2/1").unwrap(), 0.5) };
        let tile = Tile::of_weave(&weave).unwrap();
        assert_eq!((tile.counts, tile.strands.len()), ([3, 3], 6));
        for strand in &tile.strands {
            // Yarns sway a little from their places.
            assert!(strand.points.iter().all(|p| p.x > -0.3 && p.y > -0.3 && p.z.abs() <= 0.9));
            let along = usize::from(strand.kind == StrandKind::Warp);
            assert_eq!(strand.step[along], 1);
            // It goes on where it stopped: no step is longer than another by much.
            let step = |i: isize| strand.around(i + 1, tile.period).distance(strand.around(i, tile.period));
            let n = strand.points.len() as isize;
            assert!(step(n - 1) < 1.5 * step(n - 2), "{} {}", step(n - 1), step(n - 2));
            // As flat as it lies in the cloth, with the round yarn's area.
            assert_eq!(strand.sections.len(), strand.points.len());
            for Section { half_width, short_axis } in &strand.sections {
                let ratio = short_axis.length();
                assert!(
                    ratio < 0.9 && (half_width * half_width * ratio / 0.25 - 1.0).abs() < 1e-3,
                    "{half_width} {ratio}"
                );
            }
        }
    }

    #[test]
    fn pulling_a_weave_keeps_length_and_parts_yarns() {
        let spacing = Some(1.9);
        let plain = Weave::of(Draft::named("plain").unwrap(), 0.5);
        let tile = Tile::of_weave(&Weave { warp_spacing: spacing, weft_spacing: spacing, ..plain }).unwrap();
        let settled = tile.pulled(tile.period, 150);
        for (x, y) in [(1.02, 1.0), (1.0, 0.97), (0.97, 1.02)] {
            let pulled = tile.pulled(tile.period * DVec2::new(x, y), 150);
            let grown = pulled.length() / settled.length();
            // Measured: 1.2 % shorter at most.
            assert!((grown - 1.0).abs() < 0.015, "{x} {y}: {grown}");
            let found = pulled.overlap().unwrap();
            assert!(found.deepest < 0.1, "{x} {y}: {found:?}");
        }
    }

    #[test]
    fn splines_pass_their_places_and_repeat() {
        let tile = stockinette();
        let strand = &tile.strands[0];
        let count = 12 * tile.counts[0] as usize;
        let places = strand.evenly(count, tile.period);
        let control = strand.spline(&places, tile.period);
        assert_eq!(control.len(), count);
        let at = |k: isize| {
            control[k.rem_euclid(count as isize) as usize]
                + strand.jump(tile.period) * k.div_euclid(count as isize) as f64
        };
        for (k, place) in places.iter().enumerate() {
            let k = k as isize;
            let passed = (at(k - 1) + 4.0 * at(k) + at(k + 1)) / 6.0;
            let want = strand.at(place.floor() as isize, place.fract(), tile.period);
            assert!(passed.distance(want) < 1e-9, "{k}: {passed} {want}");
        }
    }

    #[test]
    fn pulling_keeps_length_and_thickness() {
        let tile = stockinette();
        for (x, y) in [(1.15, 1.0), (1.0, 1.12), (0.9, 1.05)] {
            let pulled = tile.pulled(tile.period * DVec2::new(x, y), 150);
            let grown = pulled.length() / tile.length();
            // Measured: 1.4, 1.6 and 0.3 % longer.
            assert!((grown - 1.0).abs() < 0.018, "{x} {y}: {grown}");
            assert_eq!(pulled.diameter(), tile.diameter());
        }
    }

    #[test]
    fn shearing_keeps_length_and_parts_yarns() {
        let tile = stockinette();
        for sine in [-0.4_f64, 0.4] {
            let cosine = (1.0 - sine * sine).sqrt();
            let shear = sine / cosine;
            let at = |rounds: usize| {
                let mut cloth = tile.strained(tile.period * DVec2::new(1.0, cosine), shear, rounds).repeated(3, 3);
                cloth.strands.iter_mut().flat_map(|s| &mut s.points).for_each(|p| *p = sheared(*p, shear));
                let length = cloth.length() / 9.0 / tile.length();
                let curve = |s: TileStrand| {
                    let radii = vec![s.radius; s.points.len()];
                    let basis = Basis::CatmullRom;
                    (Curve { basis, closed: false, points: s.points, radii: None, flattening: None }, radii)
                };
                let curves: Vec<_> = cloth.strands.into_iter().map(curve).collect();
                (length, crate::geometry::overlap::overlap(curves.iter().map(|(c, r)| (c, r.as_slice()))).unwrap())
            };
            let ((_, as_drawn), (length, found)) = (at(0), at(150));
            assert!((length - 1.0).abs() < 0.045, "{sine}: {length}");
            assert!(found.share < 0.5 * as_drawn.share && found.deepest < as_drawn.deepest, "{found:?} {as_drawn:?}");
        }
        // Upright it is what pulling gives.
        let (a, b) = (tile.strained(tile.period, 0.0, 20), tile.pulled(tile.period, 20));
        assert!(a.strands.iter().zip(&b.strands).all(|(a, b)| a.points == b.points));
    }

    #[test]
    fn yarns_of_a_knit_give_way_where_stitches_press_on_them_however_it_is_strained() {
        let tile = crate::testing::pressed_stockinette();
        for (x, y, shear) in [(1.0, 1.0, 0.0), (1.1, 0.95, 0.0), (1.0, 1.0, 0.35), (0.95, 1.05, -0.35)] {
            let strained = tile.strained(tile.period * DVec2::new(x, y), shear, 120);
            let sections = strained.strands.iter().flat_map(|s| &s.sections);
            let flattest = sections.map(|s| s.short_axis.length()).fold(1.0, f32::min);
            assert!(flattest < 0.85, "{flattest}");
            let curves = |round: bool| {
                let of = move |s: TileStrand| {
                    let (radii, axes) = s.radii_and_flattening();
                    // As it lies: axes are drawn upright with the points.
                    let lies = |axis: &Vec3| sheared(axis.as_dvec3(), shear).normalize().as_vec3() * axis.length();
                    let flattening = axes.filter(|_| !round).map(|axes| axes.iter().map(lies).collect());
                    let radii = if round { vec![s.radius; s.points.len()] } else { radii };
                    let points = s.points.into_iter().map(|p| sheared(p, shear)).collect();
                    let curve = Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening };
                    (curve, radii, s.half_width)
                };
                strained.repeated(2, 2).strands.into_iter().map(of).collect::<Vec<_>>()
            };
            let share = |curves: &[(Curve, Vec<f64>, f64)]| {
                overlap_of_plied(curves.iter().map(|(c, r, half_width)| (c, r.as_slice(), *half_width))).unwrap().share
            };
            let (round, pressed) = (share(&curves(true)), share(&curves(false)));
            assert!(round > 0.5 && pressed < 0.03, "{round} {pressed}");
        }
    }

    #[test]
    fn repeating_keeps_stitches_and_length() {
        let tile = stockinette();
        let four = tile.repeated(2, 2);
        assert_eq!(four.counts, tile.counts.map(|c| 2 * c));
        assert!((four.length() - 4.0 * tile.length()).abs() < 1e-9);
        assert_eq!(four.strands.len(), 2 * tile.strands.len());
    }
}
