//! Tiles of what makes cloth: knits, weaves, and endless yarns of which nothing else is known.

use glam::{DVec2, DVec3};

use super::{Section, Tile, TileStrand};
use crate::pattern::{
    StrandKind,
    chart::ChartError,
    knit::{Knit, Thickness},
    weave::{Extent, Impossible, Weave},
};

/// A cell of a knit as its maker relaxes it: see [`Tile::of_rows`].
pub(in crate::pattern) struct RelaxedRows {
    pub(in crate::pattern) period: DVec2,
    pub(in crate::pattern) counts: [u32; 2],
    /// The points of each row, with wale and course.
    pub(in crate::pattern) rows: Vec<Vec<(DVec3, [f32; 2])>>,
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
        let across = strands
            .iter()
            .filter(|s| s.step[0] != 0)
            .map(|s| s.step[0].unsigned_abs())
            .fold(0, u32::saturating_add)
            .max(1);
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
}
