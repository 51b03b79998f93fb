//! A tile under strain: pulled and sheared, its yarns find their place anew, and those of a knit are pressed flat where they
//! lie on each other then.

use glam::{DVec2, DVec3, Vec3};
use rstar::RTree;

use super::{Section, Tile, TileStrand};
use crate::{
    geometry::curve::{Basis, Curve},
    pattern::{
        PatternStrand,
        knit::{Alike, Thickness, flatten_where_touching},
        relax::{Ends, Relaxation, Rope, sheared},
    },
};

impl Tile {
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

    /// How its yarns lie on each other, of a knit.
    pub fn pressing(&self) -> Option<Thickness> {
        let first = self.strands.first()?;
        Some(Thickness { radius: first.radius, half_width: first.half_width, flatten: self.flatten? })
    }

    /// Presses the yarns of a knit flat where they lie on each other when it is sheared, see [`Self::strained`].
    pub(super) fn press(&mut self, shear: f64) {
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
}
