//! The yarn and colour of every place of a fabric's curves, and the variants that they need.

use std::collections::HashMap;

use glam::Vec3;
use rayon::prelude::*;

use super::{
    super::{dyes::Dyes, tint::Print},
    coordinates::{FabricCoordinates, steps},
    variation::{SHADES, Variation, shine},
};
use crate::{
    geometry::curve::Curve,
    math::sampler::{Stream, hash2},
    pattern::StrandKind,
    scene::{Yarn, motif::CellMap},
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
    /// The variants that the curves need, in the order in which they are met, and which of them lies at each place along
    /// each curve. Where there are more variants than numbers for them, the last number stands for all of the rest.
    pub(super) fn paint(&self, curves: &[(Curve, Vec<f64>)]) -> (Vec<Yarn>, Vec<Vec<u16>>) {
        let mut painted: Vec<Numbered> =
            curves.par_iter().enumerate().map(|(index, (curve, radii))| self.keys(index, curve, radii)).collect();
        let mut all = Numbered::default();
        let renumber: Vec<Vec<u16>> =
            painted.iter().map(|curve| curve.keys.iter().map(|key| all.number(*key)).collect()).collect();
        painted.par_iter_mut().zip(&renumber).for_each(|(curve, numbers)| {
            curve.places.iter_mut().for_each(|place| *place = numbers[usize::from(*place)]);
        });
        let variants = all.keys.into_iter().map(|key| self.variant(key)).collect();
        (variants, painted.into_iter().map(|curve| curve.places).collect())
    }

    /// What lies at each place along a curve.
    fn keys(&self, index: usize, curve: &Curve, radii: &[f64]) -> Numbered {
        let shade = self.shades.map(|v| hash2(v.seed, index as u32 ^ 0x51ed_270b) % SHADES);
        // A print has the shade in its levels: that of the fibres before they are printed.
        let lightened = |yarn: usize| {
            let fiber = self.yarns[yarn].fibers.first().filter(|_| shade.is_some());
            fiber.map_or([1.0; 3], |(_, fiber)| fiber.lightening(self.shine(shade)).map(|v| v as f32))
        };
        let mut of_yarn = None;
        let cells = self.cells.of(index, self.coordinates);
        let own = self.coordinates.own.get(index).copied();
        let thread = self.coordinates.thread(index).filter(|_| self.cells.motif.is_none());
        let kind = self.coordinates.kinds.get(index).copied();
        let count = curve.points.len();
        let steps = steps(curve, radii);
        let places = if curve.closed { count * steps } else { (count - 1) * steps + 1 };
        let mut out = Numbered { places: Vec::with_capacity(places), ..Numbered::default() };
        for place in 0..places {
            let at = self.coordinates.between(index, place, steps, count);
            let cell = thread.unwrap_or(at);
            let yarn = own.unwrap_or_else(|| cells.at(cell[0], cell[1]));
            let dye = self.dyes.and_then(|d| d.at(index, kind, cell));
            let key = match &self.print {
                None => Key { yarn, shade, dye, levels: None },
                Some(print) => {
                    let next = self.coordinates.between(index, place + 1, steps, count);
                    let mut stream = Stream::new(hash2(index as u32, place as u32));
                    // One number for all channels: what is dithered is brightness, not the hue.
                    let dither = stream.next();
                    let lightened = match of_yarn {
                        Some((of, known)) if of == yarn => known,
                        _ => of_yarn.insert((yarn, lightened(yarn))).1,
                    };
                    let color = print.color(at, next);
                    let level = |c: usize| LEVELS * (lightened[c] * color[c]).clamp(0.0, 1.0).sqrt() + dither;
                    let levels = [0, 1, 2].map(|c| level(c).min(LEVELS) as u8);
                    Key { yarn, shade: None, dye, levels: Some(levels) }
                }
            };
            let number = out.number(key);
            out.places.push(number);
        }
        out
    }

    fn shine(&self, shade: Option<u32>) -> f64 {
        self.shades.zip(shade).map_or(1.0, |(v, shade)| f64::from(shine(v, shade)))
    }

    /// The yarn of a key, in its colour.
    fn variant(&self, key: Key) -> Yarn {
        let dyed = self.dyes.map_or(Vec3::ONE, |d| d.color(key.dye));
        let printed = key.levels.map_or(Vec3::ONE, |l| Vec3::from(l.map(|l| (f32::from(l) / LEVELS).powi(2))));
        let yarn = self.yarns[key.yarn].dyed((dyed * printed).to_array().map(f64::from));
        if key.shade.is_some() { yarn.lighter(self.shine(key.shade)) } else { yarn }
    }
}

/// What decides the yarn and colour of a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Key {
    yarn: usize,
    shade: Option<u32>,
    dye: Option<u32>,
    /// Of a print.
    levels: Option<[u8; 3]>,
}

/// Keys with numbers in the order in which they are met, and the numbers of places.
#[derive(Default)]
struct Numbered {
    keys: Vec<Key>,
    numbers: HashMap<Key, u16>,
    /// The key that was met last, and its number.
    last: Option<(Key, u16)>,
    places: Vec<u16>,
}

impl Numbered {
    fn number(&mut self, key: Key) -> u16 {
        if let Some((_, number)) = self.last.filter(|(last, _)| *last == key) {
            return number;
        }
        let number = *self.numbers.entry(key).or_insert_with(|| {
            self.keys.push(key);
            // Too many are told as an error before anyone looks.
            u16::try_from(self.keys.len() - 1).unwrap_or(u16::MAX)
        });
        self.last = Some((key, number));
        number
    }
}
