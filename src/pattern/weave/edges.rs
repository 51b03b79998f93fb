//! How woven cloth ends: cut, with selvedges, with a fringe, or hemmed.
//!
//! Selvedges are in `selvedge`. A hem is a piece of cloth at the bottom and at the top that is folded to the back twice, its
//! cut edge inside.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::{Cloth, PatternStrand, StrandKind, strand};
use crate::{
    math::{sampler::hash2, special::smooth_step},
    pattern::{
        draft::Draft,
        rods::{Rods, Run, Strand},
    },
};

/// How the cloth ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Edges {
    /// All yarns are cut half a spacing beyond the last crossing.
    Live,
    /// The weft turns at the sides; warps are cut.
    Selvedge,
    /// Selvedges, and warps that go on for this length.
    Fringe(f64),
    /// Selvedges, and hems at the bottom and at the top.
    Finished,
}

/// Edges for a length of their fringe, if they have one.
pub type EdgesOf = fn(f64) -> Edges;

impl Edges {
    /// All by name.
    pub const NAMES: [(&'static str, EdgesOf); 4] = [
        ("finished", |_| Self::Finished),
        ("selvedge", |_| Self::Selvedge),
        ("fringe", Self::Fringe),
        ("live", |_| Self::Live),
    ];

    /// Whether cloth of a draft can end so.
    ///
    /// # Errors
    /// Why it cannot, and how it can.
    pub fn suit(self, draft: &Draft) -> Result<(), (&'static str, Self)> {
        let cut_warps = draft.pile().is_some_and(|pile| pile.cut) && !draft.cut_wefts();
        match self {
            Self::Fringe(_) if cut_warps => {
                Err(("the strands of a cut pile are not drawn out into a fringe", Self::Selvedge))
            }
            Self::Selvedge | Self::Finished if draft.cut_wefts() => {
                Err(("wefts that are cut do not turn at a selvedge", Self::Live))
            }
            Self::Finished if draft.layers() > 1 => {
                Err(("cloth of more than one layer is too thick to be folded into hems", Self::Selvedge))
            }
            _ => Ok(()),
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Live => "live",
            Self::Selvedge => "selvedge",
            Self::Fringe(_) => "fringe",
            Self::Finished => "finished",
        }
    }
}

/// Depth of a hem, in thicknesses of the cloth, and that of the part folded in.
const HEM: [f64; 2] = [4.0, 3.0];

/// How far apart layers of folded cloth lie, in thicknesses of it, so that what stands out of them does not meet.
const FOLDED: f64 = 1.2;

/// Where folded cloth keeps its length, in its thicknesses from its middle to the inside of the fold: about where its inner
/// wefts lie, which have no room to come closer together. Those outside part.
const NEUTRAL: f64 = 0.25;

/// A point of a yarn: where it is, half its width, its flattening, and its place in the cloth.
pub(super) type Point = (DVec3, f64, Vec3, [f32; 2]);

/// The points of a strand, so that it can be cut and joined.
pub(super) fn points(strand: &PatternStrand) -> Vec<Point> {
    let curve = &strand.curve;
    let radius = |i: usize| curve.radii.as_ref().map_or(0.0, |r| r[i]);
    let flattening = |i: usize| curve.flattening.as_ref().map_or(Vec3::Z, |f| f[i]);
    (0..curve.points.len()).map(|i| (curve.points[i], radius(i), flattening(i), strand.coordinates[i])).collect()
}

pub(super) fn from_points(kind: StrandKind, index: u32, points: &[Point], flat: bool) -> PatternStrand {
    let mut made = strand(kind, index, points.iter().map(|p| (p.0, p.3)));
    if flat {
        made.curve.radii = Some(points.iter().map(|p| p.1).collect());
        made.curve.flattening = Some(points.iter().map(|p| p.2).collect());
    }
    made
}

/// A point so far on the way from one to another.
pub(super) fn between(a: Point, b: Point, share: f64) -> Point {
    let coordinates = [0, 1].map(|k| a.3[k] + share as f32 * (b.3[k] - a.3[k]));
    (a.0.lerp(b.0, share), a.1 + share * (b.1 - a.1), a.2.lerp(b.2, share as f32), coordinates)
}

/// How far cloth that is folded bulges beyond where it begins to turn.
fn bulge(thickness: f64) -> f64 {
    (FOLDED + 0.5) * thickness
}

/// How high cloth is at least when it is hemmed at both ends: as far as a hem and the fold inside of it reach, twice, and one
/// thickness between them.
pub(super) fn least_hemmed(thickness: f64) -> f64 {
    // The fold is half as deep as its layers are apart, and half the cloth lies outside of its middle.
    let fold = 0.5 * FOLDED + 0.5;
    2.0 * (HEM[0] * FOLDED + fold) * thickness + 2.0 * bulge(thickness) + thickness
}

/// Wefts that a hem takes at each end, beside those of cloth as high as it is when it is hemmed.
pub(super) fn hem_wefts(thickness: f64, spacing: f64) -> u32 {
    let fold = Fold::new(0.0, thickness);
    let length = fold.first() + fold.second() + (HEM[0] + HEM[1]) * fold.layers - bulge(thickness);
    (length / spacing).floor() as u32
}

/// Lets warps go on beyond both ends, each its own way, beside each other.
pub(super) fn fringe(cloth: &Cloth<'_>, strands: &mut [PatternStrand], length: f64) {
    let (spacing, radius) = (cloth.cell.spacing[0], cloth.weave.half_rooms[0]);
    let flat = cloth.weave.sized();
    let step = 1.2 * radius;
    let steps = (length / step).ceil().max(2.0) as usize;
    // Cloths above each other end above each other.
    let falls = if cloth.weave.draft.layers() > 1 { 0.0 } else { 1.0 };
    let ends = [0, 1].map(|end| {
        let mut ways: Vec<Vec<Point>> = Vec::new();
        for strand in strands.iter().filter(|s| s.kind == StrandKind::Warp) {
            let way = points(strand);
            let last = if end == 0 { way[0] } else { way[way.len() - 1] };
            let away = if end == 0 { -1.0 } else { 1.0 };
            let random = |k: u32| f64::from(hash2(strand.index, 2 * k + end) >> 8) / f64::from(1u32 << 24) - 0.5;
            let (lean, bend, lift, cut) = (random(1), random(2), random(3), 1.0 + 0.15 * random(4));
            let aim = falls * (0.15 * radius - last.0.z);
            let at = |k: usize| {
                let s = k as f64 / steps as f64;
                let ease = smooth_step(s);
                let aside = spacing * (0.5 * lean * s + 0.7 * bend * (PI * s).sin()) * s;
                let height = aim * ease.min(1.0) + 1.4 * radius * lift * ease;
                let p = last.0 + DVec3::new(aside, away * length * cut * s, height);
                (p, last.1 + s * (radius - last.1), last.2.lerp(Vec3::Z, s as f32), last.3)
            };
            ways.push((0..=steps).map(at).collect());
        }
        find_room(&mut ways, radius);
        ways
    });
    let warps = strands.iter_mut().filter(|s| s.kind == StrandKind::Warp);
    for (strand, (before, after)) in warps.zip(ends[0].iter().zip(&ends[1])) {
        let before = before[1..].iter().rev().copied();
        let way: Vec<Point> = before.chain(points(strand)).chain(after[1..].iter().copied()).collect();
        *strand = from_points(StrandKind::Warp, strand.index, &way, flat);
    }
}

/// Lets yarns of a radius that are held where they begin find room beside each other.
fn find_room(ways: &mut [Vec<Point>], radius: f64) {
    const STEPS: usize = 300;
    const THIN: f64 = 0.3;
    let unit = 2.0 * radius;
    let mut rods = Rods::default();
    for way in ways.iter() {
        let start = rods.points.len();
        for (k, point) in way.iter().enumerate() {
            rods.points.push(point.0 / unit);
            rods.rest.push(way.get(k + 1).map_or(1e-3, |next| point.0.distance(next.0) / unit));
            rods.fixed.push(k == 0);
        }
        rods.strands.push(Strand { start, count: way.len(), jump: None });
    }
    rods.relax(&Run::finding_room(STEPS, THIN));
    for (point, at) in ways.iter_mut().flatten().zip(&rods.points) {
        point.0 = *at * unit;
    }
}

/// Folds both ends to the back, twice, so that what is left is so high.
pub(super) fn hem(strands: &mut [PatternStrand], height: f64, thickness: f64) {
    let fold = Fold::new(0.5 * height - bulge(thickness), thickness);
    for strand in strands {
        let flattening = strand.curve.flattening.as_mut();
        if let Some(axes) = flattening {
            for (axis, p) in axes.iter_mut().zip(&strand.curve.points) {
                *axis = fold.turn(p.y, axis.as_dvec3()).as_vec3();
            }
        }
        for p in &mut strand.curve.points {
            *p = fold.place(*p);
        }
    }
}

/// The way of a hem in the plane of y and z.
struct Fold {
    /// Where it begins to turn, from the middle of the cloth.
    half: f64,
    /// Distance of its layers.
    layers: f64,
    /// Depth of what keeps its length below the middle of the cloth.
    neutral: f64,
}

impl Fold {
    fn new(half: f64, thickness: f64) -> Self {
        Self { half, layers: FOLDED * thickness, neutral: NEUTRAL * thickness }
    }

    /// Length of cloth in the fold at the end of the hemmed cloth, of which the third layer lies between the other two.
    fn first(&self) -> f64 {
        PI * (self.layers - self.neutral)
    }

    /// Length of cloth in the fold inside of the hem.
    fn second(&self) -> f64 {
        PI * (0.5 * self.layers - self.neutral)
    }

    /// At a distance beyond the edge: y beyond it, z, and how far the cloth has turned.
    fn at(&self, s: f64) -> (f64, f64, f64) {
        let t = self.layers;
        let back = HEM[0] * t;
        let (first, second) = (self.first(), self.second());
        if s <= first {
            let angle = PI * s / first;
            return (t * angle.sin(), -t * (1.0 - angle.cos()), angle);
        }
        let s = s - first;
        if s <= back {
            return (-s, -2.0 * t, PI);
        }
        let s = s - back;
        if s <= second {
            let angle = PI * s / second;
            return (-back - 0.5 * t * angle.sin(), -2.0 * t + 0.5 * t * (1.0 - angle.cos()), PI + angle);
        }
        (-back + (s - second), -t, 2.0 * PI)
    }

    fn turn(&self, y: f64, v: DVec3) -> DVec3 {
        let beyond = y.abs() - self.half;
        if beyond <= 0.0 {
            return v;
        }
        let (sin, cos) = self.at(beyond).2.sin_cos();
        let side = y.signum();
        // Outwards and up turn towards down and inwards.
        let (out, up) = (v.y * side, v.z);
        DVec3::new(v.x, side * (out * cos + up * sin), up * cos - out * sin)
    }

    fn place(&self, p: DVec3) -> DVec3 {
        let beyond = p.y.abs() - self.half;
        if beyond <= 0.0 {
            return p;
        }
        let (y, z, angle) = self.at(beyond);
        let side = p.y.signum();
        DVec3::new(p.x, side * (self.half + y + p.z * angle.sin()), z + p.z * angle.cos())
    }
}
