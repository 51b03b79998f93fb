//! The stitches of a panel in one frame: where their corners lie, and what lies between and over them.

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::{
    border::NearSeam,
    fold::{Fold, Folds},
    hem::NearHem,
    lattice::{Lattice, PAD},
    seam::SeamKind,
    strain::{Strain, UNSTRAINED},
    surface::{Anchor, Pose, Surface, single},
};
use crate::math::special::smooth_step;

/// What a corner near a seam knows of it.
#[derive(Clone, Copy, Debug)]
struct BySeam {
    /// The place of the seam that is nearest, mm.
    on: Vec3,
    /// Unit vector on the cloth from the seam.
    inward: Vec3,
    kind: SeamKind,
    /// Whether what is laid to one side comes to lie under this one.
    first: bool,
}

impl BySeam {
    /// Distance of a place from the seam, negative beyond it, mm.
    fn distance(&self, at: Vec3) -> f32 {
        (at - self.on).dot(self.inward)
    }
}

/// What a corner near a hem knows of it.
#[derive(Clone, Copy, Debug)]
struct ByHem {
    /// Distance on the cloth, negative beyond the edge, mm.
    distance: f32,
    /// From the edge inwards, in stitches a millimetre.
    inward: Vec2,
}

/// How cloth is bent at the border of a panel.
#[derive(Clone, Debug)]
pub(super) struct Bends {
    /// At each kind of seam.
    pub(super) seams: Folds,
    /// At a hem.
    pub(super) hem: Option<Fold>,
    /// What lies under a hem makes room for the allowance of each kind of seam.
    pub(super) rooms: [Room; SeamKind::COUNT],
}

impl Bends {
    /// How far from a seam what lies under a hem may make room, mm.
    pub(super) fn widest_room(&self) -> f64 {
        self.rooms.iter().map(|room| room.until).fold(0.0, f64::max)
    }
}

/// How far what lies under a hem keeps from the cloth by a seam, for the seam's allowance lies between.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Room {
    /// So much lower, mm.
    pub(super) deep: f64,
    /// Within such a distance of the seam, mm, and less and less up to another.
    pub(super) within: f64,
    pub(super) until: f64,
}

impl Room {
    /// By how much it lies lower at a distance from the seam, mm.
    pub(super) fn at(&self, distance: f64) -> f64 {
        let width = (self.until - self.within).max(1e-9);
        self.deep * (1.0 - smooth_step((distance - self.within) / width))
    }
}

/// The corners of a panel's stitches in one frame.
#[derive(Clone, Debug)]
pub(super) struct Sheet<'a> {
    pub(super) lattice: &'a Lattice,
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    /// Of each corner, where any is near a seam that is turned in; empty without such seams.
    seams: Vec<Option<BySeam>>,
    /// The same of hems.
    hems: Vec<Option<ByHem>>,
    bends: &'a Bends,
}

impl<'a> Sheet<'a> {
    /// The corners of a panel as they lie in a pose.
    pub(super) fn new(lattice: &'a Lattice, surface: &Surface, pose: &Pose, bends: &'a Bends) -> Self {
        let place = |anchor: &Anchor| {
            if !anchor.is_some() {
                return (Vec3::NAN, Vec3::Y);
            }
            let (at, normal) = surface.at(pose, *anchor);
            (single(at), single(normal))
        };
        let (points, normals) = lattice.anchors.par_iter().with_min_len(256).map(place).unzip();
        let seams = if lattice.near.is_empty() { Vec::new() } else { vec![None; lattice.anchors.len()] };
        let hems = if lattice.near_hem.is_empty() { Vec::new() } else { vec![None; lattice.anchors.len()] };
        let mut sheet = Self { lattice, points, normals, seams, hems, bends };
        for (i, near) in &lattice.near {
            sheet.approach(*i as usize, near, pose);
        }
        for (i, near) in &lattice.near_hem {
            sheet.approach_hem(*i as usize, near, pose);
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
        self.seams[i] = Some(BySeam { on, inward, kind: near.kind, first: near.first });
    }

    /// Tells a corner of the hem that it is near; one beyond the edge goes on straight from it.
    fn approach_hem(&mut self, i: usize, near: &NearHem, pose: &Pose) {
        if near.distance < 0.0 && !self.points[i].is_nan() {
            let [a, b]: [DVec3; 2] = near.vertices.map(|v| pose.vertex(v).0);
            let inward = self.normals[i].cross(single(b - a)).normalize_or(Vec3::X);
            self.points[i] = single(a.lerp(b, f64::from(near.share))) + inward * near.distance;
        }
        let inward = near.inward / self.lattice.stitch.as_vec2();
        self.hems[i] = Some(ByHem { distance: near.distance, inward });
    }

    /// Goes on straight by one more corner on all sides.
    fn extend(&mut self) {
        let lattice = self.lattice;
        let (w, h) = (lattice.width(), lattice.height());
        let pad = if lattice.ring { 0 } else { PAD as isize };
        let made: Vec<(usize, Vec3, Vec3, Option<BySeam>)> = (0..w * h)
            .into_par_iter()
            .with_min_len(1024)
            .filter(|&i| self.points[i].is_nan())
            .filter_map(|i| {
                let (x, y) = ((i % w) as isize - pad, (i / w) as isize - PAD as isize);
                let known = |dx: isize, dy: isize| lattice.index(x + dx, y + dy).filter(|&k| !self.points[k].is_nan());
                let mut best = (0.0, Vec3::ZERO, Vec3::ZERO);
                let mut seam: Option<(f32, BySeam)> = None;
                // Straight on from the two before counts most; slantwise or from one alone is a last resort.
                for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)] {
                    let Some(a) = known(dx, dy) else { continue };
                    let slant = if dx != 0 && dy != 0 { 0.05 } else { 1.0 };
                    let (at, weight) = match known(2 * dx, 2 * dy) {
                        Some(b) => (2.0 * self.points[a] - self.points[b], slant),
                        None => (self.points[a], 1e-4 * slant),
                    };
                    best = (best.0 + weight, best.1 + weight * at, best.2 + weight * self.normals[a]);
                    if let Some(own) = self.seam(a).filter(|_| seam.is_none_or(|(most, _)| weight > most)) {
                        seam = Some((weight, own));
                    }
                }
                (best.0 > 0.0).then(|| (i, best.1 / best.0, best.2.normalize_or(Vec3::Y), seam.map(|s| s.1)))
            })
            .collect();
        for (i, point, normal, seam) in made {
            (self.points[i], self.normals[i]) = (point, normal);
            if let Some(own) = self.seams.get_mut(i) {
                *own = seam;
            }
        }
    }

    fn seam(&self, i: usize) -> Option<BySeam> {
        self.seams.get(i).copied().flatten()
    }

    fn hem(&self, i: usize) -> Option<ByHem> {
        self.hems.get(i).copied().flatten()
    }

    /// Whether a corner is by a seam that is turned in, or under a hem.
    pub(super) fn is_turned_in(&self, x: usize, y: usize) -> bool {
        let Some(i) = self.corner(x as isize, y as isize) else { return false };
        let beyond_seam = self.seam(i).is_some_and(|seam| seam.distance(self.points[i]) < 0.0);
        beyond_seam || self.hem(i).is_some_and(|hem| hem.distance < 0.0)
    }

    /// The place in stitches across, rows up and mm out: where cloth is turned in it goes round with it.
    #[inline]
    pub(super) fn place(&self, p: Vec3) -> Vec3 {
        let (p, under) = if self.hems.is_empty() { (p, 0.0) } else { self.turned_up(p) };
        let (at, normal) = self.at(p.x, p.y);
        if self.seams.is_empty() {
            return at + normal * p.z;
        }
        let Some((inward, distance, kind, first)) = self.by_seam(p, at) else { return at + normal * p.z };
        let Some(fold) = &self.bends.seams[kind as usize] else { return at + normal * p.z };
        let side = if first { 1.0 } else { -1.0 };
        let [s, out] = fold.bend(f64::from(distance), f64::from(p.z), side).map(|c| c as f32);
        let bent = at + inward * (s - distance) + normal * out;
        if under == 0.0 {
            return bent;
        }
        // What lies under a hem goes on flat under the seam's allowance.
        let room = self.bends.rooms[kind as usize].at(f64::from(distance)) as f32;
        bent.lerp(at + normal * (p.z - room), under)
    }

    /// Where a place comes to lie by a hem: under which place of the panel, and to which share it is turned.
    fn turned_up(&self, p: Vec3) -> (Vec3, f32) {
        let (i, j) = (p.x.floor(), p.y.floor());
        let (mut distance, mut inward) = (0.0, Vec2::ZERO);
        for (dx, dy, share) in corner_shares(p.x - i, p.y - j) {
            let corner = self.lattice.index(i as isize + dx, j as isize + dy);
            let Some(hem) = corner.and_then(|k| self.hem(k)) else { return (p, 0.0) };
            distance += share * hem.distance;
            inward += share * hem.inward;
        }
        let Some(fold) = self.bends.hem.as_ref().filter(|fold| f64::from(distance) < fold.begin()) else {
            return (p, 0.0);
        };
        let [to, out] = fold.bend(f64::from(distance), f64::from(p.z), 1.0).map(|c| c as f32);
        let under = smooth_step(fold.turned_share(f64::from(distance)));
        ((p.truncate() + inward * (to - distance)).extend(out), under as f32)
    }

    /// The place, and in which direction a small step from it goes.
    pub(super) fn place_and_direction(&self, p: Vec3, step: Vec3) -> (Vec3, Vec3) {
        let (i, j) = (p.x.floor(), p.y.floor());
        let (u, v) = (p.x - i, p.y - j);
        let (i, j) = (i as isize, j as isize);
        let flat = self.seams.is_empty() && self.hems.is_empty();
        if flat || self.corner(i, j).is_some_and(|k| self.seam(k).is_none() && self.hem(k).is_none()) {
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

    /// Unit vector from the seam, distance, kind and whether it is the first side, of a place that is at `at` on the flat cloth,
    /// if it is near a seam.
    fn by_seam(&self, p: Vec3, at: Vec3) -> Option<(Vec3, f32, SeamKind, bool)> {
        let (i, j) = (p.x.floor(), p.y.floor());
        let (u, v) = (p.x - i, p.y - j);
        let (mut inward, mut distance, mut most) = (Vec3::ZERO, 0.0, (0.0, SeamKind::None, false));
        for (dx, dy, share) in corner_shares(u, v) {
            let seam = self.seam(self.corner(i as isize + dx, j as isize + dy)?)?;
            inward += share * seam.inward;
            distance += share * seam.distance(at);
            most = if share > most.0 { (share, seam.kind, seam.first) } else { most };
        }
        Some((inward, distance, most.1, most.2))
    }

    fn corner(&self, x: isize, y: isize) -> Option<usize> {
        self.lattice.index(x, y).filter(|&i| !self.points[i].is_nan())
    }

    /// How a stitch is strained against its cut.
    pub(super) fn strain(&self, x: isize, y: isize) -> Strain {
        let middle = Vec3::new(x as f32 + 0.5, y as f32 + 0.5, 0.0);
        let under = self.lattice.index(x, y).and_then(|i| self.hem(i)).filter(|hem| hem.distance < 0.0);
        if under.is_none() {
            return self.strain_on_panel(x, y);
        }
        // As the cloth that it lies under, and sheared the other way.
        let at = self.turned_up(middle).0.floor();
        let [across, up, sine] = self.strain_on_panel(at.x as isize, at.y as isize);
        [across, up, -sine]
    }

    fn strain_on_panel(&self, x: isize, y: isize) -> Strain {
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
