//! The smooth surface that cloth lies on: panels refined until triangles are no longer seen, and looked up by their
//! texture coordinates.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::{
    body::Body,
    panels::Panels,
    settle::settle,
    subdivide::{Topology, normals},
};

/// A place on the refined mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Anchor {
    /// The fine face; [`Anchor::NONE`] where there is none.
    pub(super) face: u32,
    /// Its barycentric coordinates of the second and third corner.
    pub(super) share: [f32; 2],
}

impl Anchor {
    pub(super) const NONE: Self = Self { face: u32::MAX, share: [0.0; 2] };

    pub(super) fn is_some(&self) -> bool {
        self.face != u32::MAX
    }
}

/// The refined garment.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    /// The sewn mesh at each refinement, the coarse one first.
    sewn: Vec<Topology>,
    /// The finest faces over corners.
    cut: Topology,
    /// Texture coordinates of the finest corners, mm.
    uvs: Vec<DVec2>,
    /// The panel of each coarse face.
    of_face: Vec<u32>,
}

/// The surface's points in one frame.
#[derive(Clone, Debug)]
pub(super) struct Pose {
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
}

impl Pose {
    /// Moves points out of a body, each so far from its skin; gives their number.
    pub(super) fn push_out(&mut self, body: &Body, clearance: &(impl Fn(usize) -> f64 + Sync)) -> usize {
        let push = |(i, p): (usize, &mut DVec3)| match body.push_out(*p, clearance(i)) {
            Some(out) => {
                *p = out;
                1
            }
            None => 0,
        };
        self.points.par_iter_mut().enumerate().with_min_len(1024).map(push).sum()
    }

    /// All fine points of the sewn mesh.
    pub(super) fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Position and normal of a fine point of the sewn mesh.
    pub(super) fn vertex(&self, v: u32) -> (DVec3, DVec3) {
        (self.points[v as usize], self.normals[v as usize])
    }
}

/// An edge of a panel's border, with the panel to its left.
#[derive(Clone, Copy, Debug)]
pub(super) struct BorderEdge {
    pub(super) ends: [DVec2; 2],
    pub(super) anchors: [Anchor; 2],
    /// Its ends among the points of the sewn mesh.
    pub(super) vertices: [u32; 2],
    /// The panel that is sewn to it, and that panel's edge; itself where it is free.
    pub(super) sewn_to: Option<(u32, u32)>,
}

/// The lowest and the highest corner of the box around a border; the lowest is above the highest where there is none.
pub(super) fn bounds(border: &[BorderEdge]) -> [DVec2; 2] {
    let ends = || border.iter().flat_map(|e| e.ends);
    [ends().fold(DVec2::INFINITY, DVec2::min), ends().fold(DVec2::NEG_INFINITY, DVec2::max)]
}

impl BorderEdge {
    /// Unit vector along it in the flat panel, which is to its left.
    pub(super) fn direction(&self) -> DVec2 {
        (self.ends[1] - self.ends[0]).normalize_or(DVec2::X)
    }

    /// Whether it, which is edge `i` of a panel, is the first of two that are sewn together.
    pub(super) fn is_first(&self, panel: u32, i: usize) -> bool {
        self.sewn_to.is_some_and(|mate| (panel, i as u32) < mate)
    }
}

/// A border that turns by more than 35 degrees has a corner there.
const CORNER: f64 = 0.6;
/// More triangles than these are not made for the sake of smoothness.
const MOST_FACES: usize = 3_000_000;

impl Surface {
    /// Refines until edges are about `finest` long, mm, or many.
    pub(super) fn new(panels: &Panels, points: &[DVec3], finest: f64) -> Self {
        let area: f64 = panels.panels.iter().map(|p| p.area).sum();
        let mut edge = (2.0 * area / panels.cut.len() as f64).sqrt();
        let mut refinements = 0;
        while edge > finest && panels.cut.len() << (2 * (refinements + 1)) <= MOST_FACES && refinements < 3 {
            refinements += 1;
            edge *= 0.5;
        }
        let flat = || {
            let flat: Vec<DVec3> = panels.uvs.iter().map(|uv| uv.extend(0.0)).collect();
            let mut cut = Topology::new(panels.cut.clone(), panels.uvs.len());
            cut.pin_corners(&flat, CORNER);
            let mut uvs = cut.through(&flat);
            for _ in 0..refinements {
                uvs = cut.refine(&uvs);
                cut = cut.refined();
            }
            let uvs: Vec<DVec2> = cut.limit(&uvs).into_iter().map(DVec3::truncate).collect();
            (cut, uvs)
        };
        let sewn = || {
            let mut first = Topology::new(panels.sewn.clone(), points.len());
            first.pin_corners(points, CORNER);
            let mut sewn = vec![first];
            for i in 0..refinements {
                sewn.push(sewn[i].refined());
            }
            sewn
        };
        let ((cut, uvs), sewn) = rayon::join(flat, sewn);
        Self { sewn, cut, uvs, of_face: panels.of_face.clone() }
    }

    /// The surface through the welded points of a frame.
    pub(super) fn pose(&self, points: &[DVec3]) -> Pose {
        let mut values = self.sewn[0].through(points);
        for topology in &self.sewn[..self.sewn.len() - 1] {
            values = topology.refine(&values);
        }
        let finest = &self.sewn[self.sewn.len() - 1];
        let points = finest.limit(&values);
        let normals = normals(&finest.faces, &points);
        Pose { points, normals }
    }

    /// The flat lengths of the finest edges of the sewn mesh, mm, as far as a pose says that they are worn: where a quarter of
    /// a panel's edges are shorter by a share, all of it is made so small and not pressed.
    pub(super) fn worn_lengths(&self, pose: &Pose, panels: usize) -> Vec<f64> {
        let finest = &self.sewn[self.sewn.len() - 1];
        let flat = |face: usize, k: usize| {
            let uvs = self.uvs_of(face as u32);
            uvs[k].distance(uvs[(k + 1) % 3])
        };
        let share = |panel: usize| {
            let ratio = |face: u32| {
                let face = face as usize;
                let at = finest.faces[face].map(|i| pose.points[i as usize]);
                [0, 1, 2].map(|k| at[k].distance(at[(k + 1) % 3]) / flat(face, k))
            };
            let mut ratios: Vec<f64> = self.faces_of(panel as u32).flat_map(ratio).collect();
            let quarter = ratios.len() / 4;
            if ratios.is_empty() { 1.0 } else { ratios.select_nth_unstable_by(quarter, f64::total_cmp).1.min(1.0) }
        };
        let shares: Vec<f64> = (0..panels).into_par_iter().map(share).collect();
        finest.edge_lengths(|face, k| flat(face, k) * shares[self.panel_of(face as u32) as usize])
    }

    /// Lets out what is pressed together in a pose, off a body if there is one; gives the number of edges. `worn` are the lengths
    /// of [`Self::worn_lengths`].
    pub(super) fn settle(
        &self,
        pose: &mut Pose,
        worn: &[f64],
        body: Option<&Body>,
        clearance: &(impl Fn(usize) -> f64 + Sync),
    ) -> usize {
        let keep_off = |i: usize, at: DVec3| body.and_then(|b| b.push_out(at, clearance(i))).unwrap_or(at);
        settle(&self.sewn[self.sewn.len() - 1], worn, &mut pose.points, &keep_off)
    }

    /// Turns the normals of a pose after its points.
    pub(super) fn turn_normals(&self, pose: &mut Pose) {
        pose.normals = normals(&self.sewn[self.sewn.len() - 1].faces, &pose.points);
    }

    /// The fine faces of a panel.
    pub(super) fn faces_of(&self, panel: u32) -> std::ops::Range<u32> {
        let each = (self.cut.faces.len() / self.of_face.len()) as u32;
        let first = self.of_face.partition_point(|&p| p < panel) as u32;
        let last = self.of_face.partition_point(|&p| p <= panel) as u32;
        first * each..last * each
    }

    fn panel_of(&self, face: u32) -> u32 {
        self.of_face[face as usize * self.of_face.len() / self.cut.faces.len()]
    }

    /// Texture coordinates of a fine face's corners.
    pub(super) fn uvs_of(&self, face: u32) -> [DVec2; 3] {
        self.cut.faces[face as usize].map(|i| self.uvs[i as usize])
    }

    /// The border of every panel. Edges along which more than two faces meet are sewn to nothing.
    pub(super) fn borders(&self, panels: usize) -> Vec<Vec<BorderEdge>> {
        let finest = &self.sewn[self.sewn.len() - 1];
        let mut out: Vec<Vec<BorderEdge>> = vec![Vec::new(); panels];
        let mut waiting = std::collections::HashMap::new();
        for face in 0..self.cut.faces.len() {
            for k in 0..3 {
                if !self.cut.is_border(face, k) {
                    continue;
                }
                let panel = self.panel_of(face as u32);
                let corners = [k, (k + 1) % 3];
                let at = |k: usize| [f32::from(u8::from(k == 1)), f32::from(u8::from(k == 2))];
                let place = out[panel as usize].len() as u32;
                let mut sewn_to = None;
                if !finest.is_border(face, k) {
                    let [a, b] = corners.map(|c| finest.faces[face][c]);
                    match waiting.remove(&[a.min(b), a.max(b)]) {
                        Some((other, edge)) => {
                            sewn_to = Some((other, edge));
                            let other: &mut Vec<BorderEdge> = &mut out[other as usize];
                            other[edge as usize].sewn_to = Some((panel, place));
                        }
                        None => {
                            waiting.insert([a.min(b), a.max(b)], (panel, place));
                        }
                    }
                }
                out[panel as usize].push(BorderEdge {
                    ends: corners.map(|c| self.uvs_of(face as u32)[c]),
                    anchors: corners.map(|c| Anchor { face: face as u32, share: at(c) }),
                    vertices: corners.map(|c| finest.faces[face][c]),
                    sewn_to,
                });
            }
        }
        out
    }

    /// Position and unit normal at a place. Between corners the surface bends as its normals do (Boubekeur and Alexa,
    /// "Phong Tessellation", 2008).
    pub(super) fn at(&self, pose: &Pose, anchor: Anchor) -> (DVec3, DVec3) {
        let corners = self.sewn[self.sewn.len() - 1].faces[anchor.face as usize].map(|i| i as usize);
        let [v, w] = anchor.share.map(f64::from);
        let share = [1.0 - v - w, v, w];
        let (mut flat, mut normal) = (DVec3::ZERO, DVec3::ZERO);
        for (i, s) in corners.into_iter().zip(share) {
            flat += s * pose.points[i];
            normal += s * pose.normals[i];
        }
        let mut bent = DVec3::ZERO;
        for (i, s) in corners.into_iter().zip(share) {
            let n = pose.normals[i];
            bent += s * (flat - n * (flat - pose.points[i]).dot(n));
        }
        (flat.lerp(bent, 0.75), normal.normalize_or(DVec3::Y))
    }
}

/// Which fine face of a panel lies where in its texture coordinates.
pub(super) struct Finder<'a> {
    surface: &'a Surface,
    low: DVec2,
    size: f64,
    cells: [usize; 2],
    starts: Vec<u32>,
    faces: Vec<u32>,
}

impl<'a> Finder<'a> {
    pub(super) fn new(surface: &'a Surface, panel: u32) -> Self {
        let range = surface.faces_of(panel);
        let corners = || range.clone().flat_map(|f| surface.uvs_of(f));
        let low = corners().fold(DVec2::INFINITY, DVec2::min);
        let high = corners().fold(DVec2::NEG_INFINITY, DVec2::max);
        let extent = (high - low).max(DVec2::splat(1e-9));
        let size = (2.0 * extent.x * extent.y / range.len().max(1) as f64).sqrt().max(1e-3 * extent.max_element());
        let cells = [(extent.x / size) as usize + 1, (extent.y / size) as usize + 1];
        let reach = |f: u32| {
            let uvs = surface.uvs_of(f);
            let (a, b) = (uvs[0].min(uvs[1]).min(uvs[2]), uvs[0].max(uvs[1]).max(uvs[2]));
            let cell = |p: DVec2, k: usize| (((p - low)[k] / size) as usize).min(cells[k] - 1);
            (cell(a, 0)..=cell(b, 0), cell(a, 1)..=cell(b, 1))
        };
        let mut starts = vec![0_u32; cells[0] * cells[1] + 1];
        let each = |act: &mut dyn FnMut(usize, u32)| {
            for f in range.clone() {
                let (xs, ys) = reach(f);
                for y in ys {
                    for x in xs.clone() {
                        act(y * cells[0] + x, f);
                    }
                }
            }
        };
        each(&mut |cell, _| starts[cell + 1] += 1);
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut at = starts.clone();
        let mut faces = vec![0; starts[starts.len() - 1] as usize];
        each(&mut |cell, f| {
            faces[at[cell] as usize] = f;
            at[cell] += 1;
        });
        Self { surface, low, size, cells, starts, faces }
    }

    pub(super) fn low(&self) -> DVec2 {
        self.low
    }

    fn around(&self, uv: DVec2) -> &[u32] {
        let at = (uv - self.low) / self.size;
        if !(at.x >= 0.0 && at.y >= 0.0) || at.x >= self.cells[0] as f64 || at.y >= self.cells[1] as f64 {
            return &[];
        }
        let cell = at.y as usize * self.cells[0] + at.x as usize;
        &self.faces[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    fn shares(&self, face: u32, uv: DVec2) -> [f64; 2] {
        let [a, b, c] = self.surface.uvs_of(face);
        let det = (b - a).perp_dot(c - a);
        let d = uv - a;
        [d.perp_dot(c - a) / det, (b - a).perp_dot(d) / det]
    }

    /// The face at texture coordinates, if there is one; the first of several.
    pub(super) fn find(&self, uv: DVec2) -> Anchor {
        const EDGE: f64 = -1e-7;
        let found = self.around(uv).iter().find_map(|&face| {
            let [v, w] = self.shares(face, uv);
            (v >= EDGE && w >= EDGE && 1.0 - v - w >= EDGE).then_some(Anchor { face, share: [v as f32, w as f32] })
        });
        found.unwrap_or(Anchor::NONE)
    }

    /// How many faces lie there, well inside.
    pub(super) fn layers(&self, uv: DVec2) -> usize {
        let inside = |&&face: &&u32| {
            let [v, w] = self.shares(face, uv);
            v > 1e-6 && w > 1e-6 && 1.0 - v - w > 1e-6
        };
        self.around(uv).iter().filter(inside).count()
    }
}

/// As single precision.
pub(super) fn single(v: DVec3) -> Vec3 {
    v.as_vec3()
}
