//! The stitches of a panel in one frame: where their corners lie, and what lies between and over them.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{
    border::NearSeam,
    fold::Folds,
    lattice::{Lattice, PAD},
    seam::SeamKind,
    strain::{Strain, UNSTRAINED},
    surface::{Anchor, Pose, Surface, single},
};

/// What a corner near a seam knows of it.
#[derive(Clone, Copy, Debug)]
struct Hem {
    /// The place of the seam that is nearest, mm.
    on: Vec3,
    /// Unit vector on the cloth from the seam.
    inward: Vec3,
    kind: SeamKind,
    /// Whether what is laid to one side comes to lie under this one.
    first: bool,
}

impl Hem {
    /// Distance of a place from the seam, negative beyond it, mm.
    fn distance(&self, at: Vec3) -> f32 {
        (at - self.on).dot(self.inward)
    }
}

/// The corners of a panel's stitches in one frame.
#[derive(Clone, Debug)]
pub(super) struct Sheet<'a> {
    pub(super) lattice: &'a Lattice,
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    /// Of each corner, where any is near a seam that is turned in; empty without such seams.
    hems: Vec<Option<Hem>>,
    folds: &'a Folds,
}

impl<'a> Sheet<'a> {
    /// The corners of a panel as they lie in a pose; `folds` are those of each kind of seam.
    pub(super) fn new(lattice: &'a Lattice, surface: &Surface, pose: &Pose, folds: &'a Folds) -> Self {
        let place = |anchor: &Anchor| {
            if !anchor.is_some() {
                return (Vec3::NAN, Vec3::Y);
            }
            let (at, normal) = surface.at(pose, *anchor);
            (single(at), single(normal))
        };
        let (points, normals) = lattice.anchors.par_iter().with_min_len(256).map(place).unzip();
        let hems = if lattice.near.is_empty() { Vec::new() } else { vec![None; lattice.anchors.len()] };
        let mut sheet = Self { lattice, points, normals, hems, folds };
        for (i, near) in &lattice.near {
            sheet.approach(*i as usize, near, pose);
        }
        for _ in 0..PAD {
            sheet.extend();
        }
        sheet
    }

    /// Tells a corner of the seam that it is near; one beyond the seam is moved off it.
    fn approach(&mut self, i: usize, near: &NearSeam, pose: &Pose) {
        let [a, b]: [DVec3; 2] = near.vertices.map(|v| pose.vertex(v).0);
        let (on, along) = (single(a.lerp(b, f64::from(near.share))), single(b - a));
        let inward = self.normals[i].cross(along).normalize_or(Vec3::X);
        if near.over > 0.0 {
            self.points[i] = on - inward * near.over;
        }
        self.hems[i] = Some(Hem { on, inward, kind: near.kind, first: near.first });
    }

    /// Goes on straight by one more corner on all sides.
    fn extend(&mut self) {
        let lattice = self.lattice;
        let (w, h) = (lattice.width(), lattice.height());
        let pad = if lattice.ring { 0 } else { PAD as isize };
        let made: Vec<(usize, Vec3, Vec3, Option<Hem>)> = (0..w * h)
            .into_par_iter()
            .with_min_len(1024)
            .filter(|&i| self.points[i].is_nan())
            .filter_map(|i| {
                let (x, y) = ((i % w) as isize - pad, (i / w) as isize - PAD as isize);
                let known = |dx: isize, dy: isize| lattice.index(x + dx, y + dy).filter(|&k| !self.points[k].is_nan());
                let mut best = (0.0, Vec3::ZERO, Vec3::ZERO);
                let mut hem: Option<(f32, Hem)> = None;
                // Straight on from the two before counts most; slantwise or from one alone is a last resort.
                for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)] {
                    let Some(a) = known(dx, dy) else { continue };
                    let slant = if dx != 0 && dy != 0 { 0.05 } else { 1.0 };
                    let (at, weight) = match known(2 * dx, 2 * dy) {
                        Some(b) => (2.0 * self.points[a] - self.points[b], slant),
                        None => (self.points[a], 1e-4 * slant),
                    };
                    best = (best.0 + weight, best.1 + weight * at, best.2 + weight * self.normals[a]);
                    if let Some(own) = self.hem(a).filter(|_| hem.is_none_or(|(most, _)| weight > most)) {
                        hem = Some((weight, own));
                    }
                }
                (best.0 > 0.0).then(|| (i, best.1 / best.0, best.2.normalize_or(Vec3::Y), hem.map(|h| h.1)))
            })
            .collect();
        for (i, point, normal, hem) in made {
            (self.points[i], self.normals[i]) = (point, normal);
            if let Some(own) = self.hems.get_mut(i) {
                *own = hem;
            }
        }
    }

    fn hem(&self, i: usize) -> Option<Hem> {
        self.hems.get(i).copied().flatten()
    }

    /// Whether a corner is by a seam that is turned in.
    pub(super) fn is_turned_in(&self, x: usize, y: usize) -> bool {
        let found = self.corner(x as isize, y as isize).and_then(|i| Some((self.points[i], self.hem(i)?)));
        found.is_some_and(|(at, hem)| hem.distance(at) < 0.0)
    }

    /// The place in stitches across, rows up and mm out: where cloth is turned in it goes round with it.
    #[inline]
    pub(super) fn place(&self, p: Vec3) -> Vec3 {
        let (at, normal) = self.at(p.x, p.y);
        if self.hems.is_empty() {
            return at + normal * p.z;
        }
        self.folded(p, at).map_or(at + normal * p.z, |(inward, [aside, out])| at + inward * aside + normal * out)
    }

    /// The place, and in which direction a small step from it goes.
    pub(super) fn place_and_direction(&self, p: Vec3, step: Vec3) -> (Vec3, Vec3) {
        let (i, j) = (p.x.floor(), p.y.floor());
        let (u, v) = (p.x - i, p.y - j);
        let (i, j) = (i as isize, j as isize);
        if self.hems.is_empty() || self.corner(i, j).is_some_and(|k| self.hem(k).is_none()) {
            let weights = [(cubic(u), cubic(v)), (cubic_slope(u), cubic(v)), (cubic(u), cubic_slope(v))];
            let [point, across, up] = self.bicubic([i, j], weights);
            if !point.is_nan() {
                let normal = self.linear([i, j], [u, v]).1;
                return (point + normal * p.z, across * step.x + up * step.y + normal * step.z);
            }
        }
        // Where it is turned in, or beyond what is known.
        let at = self.place(p);
        (at, self.place(p + step) - at)
    }

    /// By how much a place, which is at `at` on the flat cloth, is moved from the seam and lies over it, if it is near a seam.
    fn folded(&self, p: Vec3, at: Vec3) -> Option<(Vec3, [f32; 2])> {
        let (i, j) = (p.x.floor(), p.y.floor());
        let (u, v) = (p.x - i, p.y - j);
        let (mut inward, mut distance, mut most) = (Vec3::ZERO, 0.0, (0.0, SeamKind::None, false));
        for (dx, dy, share) in corner_shares(u, v) {
            let hem = self.hem(self.corner(i as isize + dx, j as isize + dy)?)?;
            inward += share * hem.inward;
            distance += share * hem.distance(at);
            most = if share > most.0 { (share, hem.kind, hem.first) } else { most };
        }
        let fold = self.folds[most.1 as usize].as_ref()?;
        let side = if most.2 { 1.0 } else { -1.0 };
        let [s, out] = fold.bend(f64::from(distance), f64::from(p.z), side);
        Some((inward, [s as f32 - distance, out as f32]))
    }

    fn corner(&self, x: isize, y: isize) -> Option<usize> {
        self.lattice.index(x, y).filter(|&i| !self.points[i].is_nan())
    }

    /// How a stitch is strained against its cut.
    pub(super) fn strain(&self, x: isize, y: isize) -> Strain {
        let corner = |dx, dy| self.corner(x + dx, y + dy).map(|i| self.points[i]);
        let (Some(a), Some(b), Some(c), Some(d)) = (corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)) else {
            return UNSTRAINED;
        };
        let size = self.lattice.stitch.as_vec2();
        let (across, up) = (0.5 * (b - a + d - c), 0.5 * (c - a + d - b));
        let lengths = [across.length(), up.length()];
        let sine = across.dot(up) / (lengths[0] * lengths[1]).max(1e-12);
        [lengths[0] / size.x, lengths[1] / size.y, sine]
    }

    /// Position and unit normal at a place, in stitches across and rows up.
    #[inline]
    pub(super) fn at(&self, x: f32, y: f32) -> (Vec3, Vec3) {
        let (i, j) = (x.floor(), y.floor());
        let (u, v) = (x - i, y - j);
        let (i, j) = (i as isize, j as isize);
        let [mut point] = self.bicubic([i, j], [(cubic(u), cubic(v))]);
        let (flat, normal) = self.linear([i, j], [u, v]);
        if point.is_nan() {
            // Beyond what is known: the nearest that is.
            point = flat.unwrap_or_else(|| self.nearest(x, y));
        }
        (point, normal)
    }

    /// Sums of the corners around a stitch with some weights across and up; NaN where one is not known.
    #[inline]
    fn bicubic<const N: usize>(&self, [i, j]: [isize; 2], weights: [([f32; 4], [f32; 4]); N]) -> [Vec3; N] {
        let mut sums = [Vec3::ZERO; N];
        for row in 0..4 {
            for column in 0..4 {
                let k = self.lattice.index(i + column as isize - 1, j + row as isize - 1);
                let point = k.map_or(Vec3::NAN, |k| self.points[k]);
                for (sum, (wu, wv)) in sums.iter_mut().zip(&weights) {
                    *sum += wu[column] * wv[row] * point;
                }
            }
        }
        sums
    }

    /// Means of a stitch's four corners: place, if any is known near, and unit normal. Normals turn slowly: linear ones will do.
    #[inline]
    fn linear(&self, [i, j]: [isize; 2], [u, v]: [f32; 2]) -> (Option<Vec3>, Vec3) {
        let (mut flat, mut normal, mut weight) = (Vec3::ZERO, Vec3::ZERO, 0.0);
        for (dx, dy, share) in corner_shares(u, v) {
            if let Some(k) = self.corner(i + dx, j + dy) {
                flat += share * self.points[k];
                normal += share * self.normals[k];
                weight += share;
            }
        }
        ((weight > 1e-3).then(|| flat / weight), normal.normalize_or(Vec3::Y))
    }

    fn nearest(&self, x: f32, y: f32) -> Vec3 {
        let (i, j) = (x.round() as isize, y.round() as isize);
        (0..8_isize)
            .flat_map(|r| (-r..=r).flat_map(move |dy| (-r..=r).map(move |dx| (dx, dy))))
            .find_map(|(dx, dy)| self.corner(i + dx, j + dy))
            .map_or(Vec3::ZERO, |k| self.points[k])
    }
}

/// The corners around a place within a stitch, as steps from the lower left one, and their shares in it: bilinear.
#[inline]
fn corner_shares(u: f32, v: f32) -> [(isize, isize, f32); 4] {
    [(0, 0, (1.0 - u) * (1.0 - v)), (1, 0, u * (1.0 - v)), (0, 1, (1.0 - u) * v), (1, 1, u * v)]
}

/// How [`cubic`] changes with t.
#[inline]
fn cubic_slope(t: f32) -> [f32; 4] {
    let t2 = t * t;
    [
        0.5 * (4.0 * t - 1.0 - 3.0 * t2),
        0.5 * (9.0 * t2 - 10.0 * t),
        0.5 * (1.0 + 8.0 * t - 9.0 * t2),
        0.5 * (3.0 * t2 - 2.0 * t),
    ]
}

/// Weights of four values in a row, between the second and the third: Catmull-Rom.
#[inline]
fn cubic(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [0.5 * (2.0 * t2 - t - t3), 0.5 * (2.0 - 5.0 * t2 + 3.0 * t3), 0.5 * (t + 4.0 * t2 - 3.0 * t3), 0.5 * (t3 - t2)]
}
