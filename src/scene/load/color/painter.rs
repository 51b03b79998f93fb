//! The yarn and colour of every place of a fabric's curves, and the variants that they need.

use std::collections::HashMap;

use glam::Vec3;

use super::{
    super::{dyes::Dyes, tint::Print},
    coordinates::{FabricCoordinates, steps},
    motif::CellMap,
    variation::{SHADES, Variation, shine},
};
use crate::{
    geometry::{curve::Curve, pattern::StrandKind},
    math::sampler::{Stream, hash2},
    scene::Yarn,
};

/// Levels of each channel of a tint, even in its square root; what lies between is dithered from point to point.
const LEVELS: f32 = 31.0;

/// Which yarn lies in each cell of a fabric.
pub(super) struct LaidCells {
    pub(super) by_row: CellMap,
    pub(super) by_column: CellMap,
    /// In place of both, if there is one.
    pub(super) motif: Option<CellMap>,
    /// Whether strands that are neither warp nor weft follow the columns.
    pub(super) by_columns: bool,
}

impl LaidCells {
    pub(super) fn maps(&self) -> impl Iterator<Item = &CellMap> {
        [&self.by_row, &self.by_column].into_iter().chain(&self.motif)
    }

    /// Those of the stitches of a knit.
    pub(super) fn of_rows(&self) -> &CellMap {
        match &self.motif {
            Some(motif) => motif,
            None if self.by_columns => &self.by_column,
            None => &self.by_row,
        }
    }

    /// The same, when nothing else is wanted.
    pub(super) fn into_rows(self) -> CellMap {
        match self.motif {
            Some(motif) => motif,
            None if self.by_columns => self.by_column,
            None => self.by_row,
        }
    }

    /// The cells that a curve of the fabric runs through.
    pub(super) fn of(&self, curve: usize, coordinates: &FabricCoordinates) -> &CellMap {
        match (&self.motif, coordinates.kinds.get(curve)) {
            (Some(motif), _) => motif,
            // A weft keeps its colour all along, and so does a warp.
            (None, Some(StrandKind::Warp)) => &self.by_column,
            (None, Some(StrandKind::Weft)) => &self.by_row,
            (None, _) => self.of_rows(),
        }
    }
}

/// Decides the colour at every place of a fabric's curves.
pub(super) struct Painter<'a> {
    pub(super) coordinates: &'a FabricCoordinates,
    pub(super) cells: &'a LaidCells,
    /// Colours that came with the curves.
    pub(super) dyes: Option<&'a Dyes>,
    /// A picture over the cloth.
    pub(super) print: Option<Print>,
    /// How yarns differ in colour, if they do.
    pub(super) shades: Option<Variation>,
    pub(super) yarns: &'a [&'a Yarn],
}

impl Painter<'_> {
    /// The material index at each place along a curve; variants are made as they are met.
    pub(super) fn paint(&self, index: usize, curve: &Curve, radii: &[f64], variants: &mut Variants) -> Vec<u16> {
        let shade = self.shades.map(|v| hash2(v.seed, index as u32 ^ 0x51ed_270b) % SHADES);
        let shine = self.shades.zip(shade).map_or(1.0, |(v, shade)| shine(v, shade));
        let cells = self.cells.of(index, self.coordinates);
        let own = self.coordinates.own.get(index).copied();
        let count = curve.points.len();
        let steps = steps(curve, radii);
        let places = if curve.closed { count * steps } else { (count - 1) * steps + 1 };
        let material_at = |place: usize| {
            let [x, y] = self.coordinates.between(index, place, steps, count);
            let yarn = own.unwrap_or_else(|| cells.at(x, y));
            let kind = self.coordinates.kinds.get(index).copied();
            let dye = self.dyes.and_then(|d| d.at(index, kind, [x, y]));
            let dyed = self.dyes.map_or(Vec3::ONE, |d| d.color(dye));
            let (key, color) = match &self.print {
                None => (Key { yarn, shade, dye, levels: [0; 3] }, dyed * shine),
                Some(print) => {
                    let next = self.coordinates.between(index, place + 1, steps, count);
                    let mut stream = Stream::new(hash2(index as u32, place as u32));
                    let levels = print
                        .color([x, y], next)
                        .map(|v| (LEVELS * (shine * v).clamp(0.0, 1.0).sqrt() + stream.next()).min(LEVELS) as u8);
                    let color = levels.map(|l| (f32::from(l) / LEVELS).powi(2));
                    (Key { yarn, shade: None, dye, levels }, dyed * Vec3::from(color))
                }
            };
            variants.material_index(key, || self.yarns[key.yarn].dyed(color.to_array().map(f64::from)))
        };
        (0..places).map(material_at).collect()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Key {
    yarn: usize,
    shade: Option<u32>,
    dye: Option<u32>,
    levels: [u8; 3],
}

/// Yarns as they are asked for, each made once.
#[derive(Default)]
pub(super) struct Variants {
    pub(super) made: Vec<Yarn>,
    places: HashMap<Key, u16>,
}

impl Variants {
    fn material_index(&mut self, key: Key, make: impl FnOnce() -> Yarn) -> u16 {
        *self.places.entry(key).or_insert_with(|| {
            self.made.push(make());
            // Too many are told as an error before anyone looks.
            u16::try_from(self.made.len() - 1).unwrap_or(u16::MAX)
        })
    }
}
