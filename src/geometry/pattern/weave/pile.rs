//! Pile: floats that stand up from the ground cloth as loops (terry) or as cut tufts (velvet, corduroy).

use std::f64::consts::PI;

use glam::DVec3;

use super::{
    Cloth, PatternStrand, StrandKind,
    edges::{Point, from_points, points},
};
use crate::math::sampler::hash2;

/// How far from the middle of a crossing that holds it a pile yarn stands up, in spacings.
const RISE: f64 = 0.7;
/// Distance of points of loops and legs, in radii of the yarn.
const STEP: f64 = 1.1;

/// Raises the floats of a pile yarn. It is held where it lies on the other side of the cloth.
pub(super) fn raise(cloth: &Cloth<'_>, strand: PatternStrand, number: i64, hem: i64) -> Vec<PatternStrand> {
    let draft = &cloth.weave.draft;
    let Some(pile) = draft.pile() else { return vec![strand] };
    let side = usize::from(strand.kind == StrandKind::Weft);
    let Some(back) = pile.stands(side, number.rem_euclid([draft.warps(), draft.wefts()][side] as i64) as usize) else {
        return vec![strand];
    };
    let nodes = cloth.cell.nodes as i64;
    let way = points(&strand);
    // Crossing c is at point `nodes / 2 + (c - first) * nodes`.
    let first = if side == 0 { -hem } else { 0 };
    let crossings = (way.len() as i64 - 1) / nodes;
    let held = |c: i64| {
        let size = [draft.warps(), draft.wefts()][1 - side] as i64;
        let (other, own) = ((c + first).rem_euclid(size) as usize, number.max(0) as usize);
        let own =
            if number < 0 { number.rem_euclid([draft.warps(), draft.wefts()][side] as i64) as usize } else { own };
        let warp_over = if side == 0 { draft.warp_over(other, own) } else { draft.warp_over(own, other) };
        let on_top = warp_over == (side == 0);
        on_top == back
    };
    let holds: Vec<i64> = (0..crossings).filter(|&c| held(c)).map(|c| nodes / 2 + c * nodes).collect();
    let rise = (RISE * nodes as f64).round() as i64;
    let made = Raised { cloth, side, up: if back { -1.0 } else { 1.0 }, seed: strand.index ^ ((side as u32) << 30) };
    let part = |from: i64, to: i64| way[from.max(0) as usize..=(to.min(way.len() as i64 - 1)) as usize].to_vec();
    let flat = cloth.weave.flatten > 1.0;
    if pile.cut {
        let tuft = |&at: &i64| {
            let base = part(at - rise, at + rise);
            let (a, b) = (base[0], base[base.len() - 1]);
            let mut all: Vec<Point> = made.leg(a, -1.0, at as u32);
            all.reverse();
            all.extend(&base);
            all.extend(made.leg(b, 1.0, at as u32));
            from_points(strand.kind, strand.index, &all, flat)
        };
        return holds.iter().map(tuft).collect();
    }
    let Some((&start, &end)) = holds.first().zip(holds.last()) else { return vec![strand] };
    let mut all = part(0, start + rise);
    for pair in holds.windows(2) {
        if pair[1] - pair[0] > nodes {
            let (a, b) = (all[all.len() - 1], way[(pair[1] - rise) as usize]);
            all.extend(made.arch(a, b, pair[0] as u32));
            all.extend(part(pair[1] - rise, pair[1] + rise));
        } else {
            all.extend(part(pair[0] + rise + 1, pair[1] + rise));
        }
    }
    all.extend(part(end + rise + 1, way.len() as i64 - 1));
    vec![from_points(strand.kind, strand.index, &all, flat)]
}

struct Raised<'a> {
    cloth: &'a Cloth<'a>,
    side: usize,
    /// 1 on the face, -1 on the back.
    up: f64,
    seed: u32,
}

impl Raised<'_> {
    fn radius(&self) -> f64 {
        [self.cloth.weave.warp_radius, self.cloth.weave.weft_radius][self.side]
    }

    /// From -1 to 1.
    fn random(&self, place: u32, what: u32) -> f64 {
        f64::from(hash2(hash2(self.seed, place), what) >> 8) / f64::from(1u32 << 23) - 1.0
    }

    /// Along the yarn, across it, up.
    fn direction(&self, along: f64, across: f64, up: f64) -> DVec3 {
        if self.side == 0 { DVec3::new(across, along, up * self.up) } else { DVec3::new(along, across, up * self.up) }
    }

    fn at(&self, p: DVec3, near: Point) -> Point {
        (p, self.radius(), self.direction(1.0, 0.0, 0.0), near.3)
    }

    /// A leg that stands up from `from` and leans to `out` along the yarn.
    fn leg(&self, from: Point, out: f64, place: u32) -> Vec<Point> {
        let (r, height) = (self.radius(), self.cloth.weave.pile_height);
        let what = if out > 0.0 { 0 } else { 8 };
        let (lean, aside) = (0.25 * self.random(place, what), 0.25 * self.random(place, what + 1));
        let height = height * (1.0 + 0.06 * self.random(place, what + 2));
        let steps = (height / (STEP * r)).ceil().max(2.0) as usize;
        let leg = |k: usize| {
            let s = k as f64 / steps as f64;
            let along = r * (0.5 * out * s + lean * s * s * height / r);
            let p = from.0 + self.direction(along, aside * height * s * s, height * s);
            self.at(p, from)
        };
        (1..=steps).map(leg).collect()
    }

    /// A loop from `from` to `to`, without both.
    fn arch(&self, from: Point, to: Point, place: u32) -> Vec<Point> {
        let (r, height) = (self.radius(), self.cloth.weave.pile_height);
        let height = height * (1.0 + 0.1 * self.random(place, 2));
        let (lean, aside) = (0.2 * height * self.random(place, 0), 0.35 * height * self.random(place, 1));
        let steps = (2.4 * height / (STEP * r)).ceil().max(6.0) as usize;
        let arch = |k: usize| {
            let s = k as f64 / steps as f64;
            let (sin, double) = ((PI * s).sin(), (2.0 * PI * s).sin());
            // Wider at the top than at the foot.
            let p = from.0.lerp(to.0, s) + self.direction(lean * sin - 1.2 * r * double, aside * sin, height * sin);
            self.at(p, if s < 0.5 { from } else { to })
        };
        (1..steps).map(arch).collect()
    }
}
