//! The panels of a garment: connected charts of its texture coordinates, in millimetres, and what is sewn to what.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::{
    mesh::{Counted, Face, GarmentError, GarmentMesh, Part, panel_in_words},
    strain::{StrainRange, UNSTRAINED},
};

/// A connected piece of flat cloth.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Panel {
    /// Its group's name.
    pub group: String,
    /// Its material's name; empty without.
    pub material: String,
    /// Whether its texture coordinates were mirrored, and have been turned round.
    pub mirrored: bool,
    /// Number of its triangles.
    pub faces: usize,
    /// Its area as it is cut, mm2.
    pub area: f64,
    /// Where its first face is in the file.
    pub line: usize,
}

/// 3-D length over length in texture coordinates, by area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LengthRatio {
    /// A twentieth of it is below.
    pub p5: f64,
    /// The median.
    pub p50: f64,
    /// A twentieth is above.
    pub p95: f64,
}

/// The flat panels with the garment's positions.
#[derive(Clone, Debug)]
pub(super) struct Panels {
    /// For each welded point the first point of the file that lies there.
    pub(super) welded: Vec<u32>,
    /// Triangles over welded points, sewn: neighbours across a seam are neighbours here.
    pub(super) sewn: Vec<[u32; 3]>,
    /// The same triangles over corners, cut along seams.
    pub(super) cut: Vec<[u32; 3]>,
    /// Texture coordinates of corners, mm, turned so that they are counter-clockwise where positions are.
    pub(super) uvs: Vec<DVec2>,
    /// The panel of each triangle; those of a panel follow each other.
    pub(super) of_face: Vec<u32>,
    pub(super) panels: Vec<Panel>,
    pub(super) ratio: LengthRatio,
    /// Share of the area that is stretched by more than a tenth along one of them.
    pub(super) stretched: f64,
    /// The same of what is compressed.
    pub(super) compressed: f64,
    /// Millimetres per unit of the texture coordinates.
    pub(super) uv_mm: f64,
    pub(super) notes: Vec<String>,
}

/// Units that panels are drawn in, and their millimetres.
const UV_UNITS: [(&str, f64); 4] = [("m", 1000.0), ("cm", 10.0), ("mm", 1.0), ("in", 25.4)];

/// Beyond this factor panels and mesh do not belong to each other.
const WRONG_UNIT: f64 = 2.5;

impl Panels {
    /// `unit_mm` is the millimetres per unit of positions, `uv_mm` of texture coordinates, if that is known. Parts for which `rule`
    /// is not the same are panels of their own, also where the texture coordinates go on.
    pub(super) fn new(
        mesh: &GarmentMesh,
        unit_mm: f64,
        uv_mm: Option<f64>,
        rule: impl Fn(&Part) -> usize,
    ) -> Result<Self, GarmentError> {
        if mesh.uvs.is_empty() {
            let hint = "the texture coordinates are the flat panels of the garment: export them with the mesh";
            return Err(GarmentError::at(0, "no texture coordinates", hint));
        }
        let mut notes = mesh.notes.clone();
        let (weld, welded) = weld(&mesh.points);
        let areas = Areas { mesh, unit_mm };
        let (mut faces, grain) = areas.sound_faces(&weld, &mut notes)?;
        let rules: Vec<usize> = mesh.parts.iter().map(rule).collect();
        let Charts { faces, cut, mut uvs, of_face } = areas.charts(&mut faces, &weld, grain, &rules, &mut notes)?;

        let ratios: Vec<(f64, f64)> =
            faces.iter().map(|f| ((areas.of(f) / areas.in_uv(f).abs()).sqrt(), areas.of(f))).collect();
        let [found] = percentiles(ratios.clone(), [0.5]);
        let uv_mm = unit_of(found, uv_mm, &mut notes)?;
        for uv in &mut uvs {
            *uv *= uv_mm;
        }
        let panels = areas.upright_panels(&faces, &of_face, &cut, &mut uvs, &mut notes)?;
        same_unit(&panels, &ratios, uv_mm)?;
        let panels = panels.into_iter().map(|panel| Panel { area: panel.area * uv_mm * uv_mm, ..panel }).collect();

        let sewn: Vec<[u32; 3]> = faces.iter().map(|f| f.points.map(|i| weld[i as usize])).collect();
        non_manifold(&sewn, &faces, mesh, &mut notes);
        let along = along_axes(mesh, &faces, unit_mm, uv_mm);
        let (mut long, mut short, mut all) = (0.0, 0.0, 0.0);
        for pair in along.chunks_exact(2) {
            all += pair[0].1;
            long += if pair[0].0.max(pair[1].0) > 1.1 { pair[0].1 } else { 0.0 };
            short += if pair[0].0.min(pair[1].0) < 0.9 { pair[0].1 } else { 0.0 };
        }
        let (stretched, compressed) = (long / all, short / all);
        let [p5, p50, p95] = percentiles(along, [0.05, 0.5, 0.95]);
        let ratio = LengthRatio { p5, p50, p95 };
        Ok(Self { welded, sewn, cut, uvs, of_face, panels, ratio, stretched, compressed, uv_mm, notes })
    }

    /// Turns the texture coordinates of each panel by an angle, radians.
    pub(super) fn turn(&mut self, angles: &[f64]) {
        let mut done = vec![false; self.uvs.len()];
        for (face, &panel) in self.cut.iter().zip(&self.of_face) {
            let turn = DVec2::from_angle(angles[panel as usize]);
            for &c in face {
                if !std::mem::replace(&mut done[c as usize], true) {
                    self.uvs[c as usize] = turn.rotate(self.uvs[c as usize]);
                }
            }
        }
    }

    /// The least and the largest strain, but for a hundredth, of panels of each kind, of `kinds`; `points` are welded, mm.
    pub(super) fn strains(&self, points: &[DVec3], kind: &[usize], kinds: usize) -> Vec<StrainRange> {
        let mut all: Vec<[Vec<(f64, f64)>; 3]> = vec![Default::default(); kinds];
        for (i, panel) in self.of_face.iter().enumerate() {
            let [across, up] =
                axes(self.sewn[i].map(|p| points[p as usize]), self.cut[i].map(|c| self.uvs[c as usize]));
            let (lengths, area) = ([across.length(), up.length()], across.cross(up).length());
            let sine = across.dot(up) / (lengths[0] * lengths[1]).max(1e-300);
            let own = &mut all[kind[*panel as usize]];
            for (values, value) in own.iter_mut().zip([lengths[0], lengths[1], sine]) {
                values.push((value, area));
            }
        }
        let ends = |values: Vec<(f64, f64)>| percentiles(values, [0.01, 0.99]);
        let of_kind = |values: [Vec<_>; 3]| {
            // No panel may be of a kind.
            if values[0].is_empty() { UNSTRAINED.map(|v| [f64::from(v); 2]) } else { values.map(ends) }
        };
        all.into_iter().map(of_kind).collect()
    }

    /// Says which panels have wales that go down, for v of texture coordinates is upwards on the body; `points` are welded, mm.
    pub(super) fn note_upside_down(&self, points: &[DVec3], notes: &mut Vec<String>) {
        // Share of a wale's way, in the mean, that goes down: sleeves go aside, and what lies flat forwards.
        const DOWN: f64 = 0.5;
        let mut ways = vec![(DVec3::ZERO, 0.0); self.panels.len()];
        for (i, panel) in self.of_face.iter().enumerate() {
            let corners = self.sewn[i].map(|p| points[p as usize]);
            let [_, up] = axes(corners, self.cut[i].map(|c| self.uvs[c as usize]));
            let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
            let (way, all) = &mut ways[*panel as usize];
            *way += area * up.normalize_or_zero();
            *all += area;
        }
        let mut down = Counted::default();
        for (panel, (way, all)) in self.panels.iter().zip(ways) {
            if way.y < -DOWN * all {
                down.add(&panel.group, panel.line);
            }
        }
        down.note("panel", "with wales that go down, so that stitches stand on their heads; `grain` turns them", notes);
    }

    /// Welded points of a frame, mm.
    pub(super) fn points(&self, mesh: &GarmentMesh, unit_mm: f64) -> Vec<DVec3> {
        self.welded.iter().map(|&i| mesh.points[i as usize] * unit_mm).collect()
    }
}

/// Areas of a mesh's faces.
struct Areas<'a> {
    mesh: &'a GarmentMesh,
    unit_mm: f64,
}

impl Areas<'_> {
    /// Of the surface, square millimetres.
    fn of(&self, face: &Face) -> f64 {
        let [a, b, c] = face.points.map(|i| self.mesh.points[i as usize] * self.unit_mm);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Of the texture coordinates, in their own unit; negative where they are seen from behind.
    fn in_uv(&self, face: &Face) -> f64 {
        let [a, b, c] = face.uvs.map(|i| self.mesh.uvs[i as usize]);
        0.5 * (b - a).perp_dot(c - a)
    }

    fn group(&self, face: &Face) -> &str {
        self.mesh.parts[face.part as usize].group.as_str()
    }

    /// The faces that say something of the cloth, and the distance within which texture coordinates are the same.
    fn sound_faces(&self, weld: &[u32], notes: &mut Vec<String>) -> Result<(Vec<Face>, f64), GarmentError> {
        let faces = &self.mesh.faces;
        let total: f64 = faces.iter().map(|f| self.of(f)).sum();
        let total_uv: f64 = faces.iter().map(|f| self.in_uv(f).abs()).sum();
        let count = faces.len() as f64;
        if total <= 0.0 {
            let problem = "the faces have no area in space: their corners fall together, or lie on lines";
            return Err(GarmentError::at(0, problem, "were its numbers rounded? export it near the origin"));
        }
        if total_uv <= 0.0 {
            let hint = "the texture coordinates are the flat panels of the garment: unwrap it, or export them";
            return Err(GarmentError::at(0, "the texture coordinates have no area", hint));
        }
        if !(total_uv.is_finite() && total.is_finite()) {
            let problem = "the mesh is so large that its area is no number";
            return Err(GarmentError::at(0, problem, "coordinates of some thousands at the most, and another `unit`"));
        }
        let sound = |f: &Face| {
            let [a, b, c] = f.points.map(|i| weld[i as usize]);
            let wide = self.of(f) > 1e-6 * total / count && self.in_uv(f).abs() > 1e-6 * total_uv / count;
            wide && a != b && b != c && c != a
        };
        let mut flat = Counted::default();
        for face in faces.iter().filter(|f| !sound(f)) {
            flat.add(self.group(face), face.line as usize);
        }
        flat.note("triangle", "without area, left out", notes);
        let faces: Vec<Face> = faces.iter().copied().filter(sound).collect();
        if faces.is_empty() {
            let problem = "no triangle has an area both in space and in texture coordinates";
            return Err(GarmentError::at(0, problem, "export the mesh with the flat panels that belong to it"));
        }
        Ok((faces, 1e-7 * (total_uv / count).sqrt()))
    }

    /// Faces that are wound against most of those that they are joined to within their part would be knitted inside out: turns
    /// them round.
    fn wind_alike(&self, faces: &mut [Face], cut: &mut [[u32; 3]], notes: &mut Vec<String>) {
        // For each edge of two faces both of them, and whether the second one goes along it as the first one does.
        let mut edges: HashMap<[u32; 2], (u8, [usize; 2], [bool; 2])> = HashMap::with_capacity(cut.len() * 3 / 2);
        for (i, f) in cut.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (f[k], f[(k + 1) % 3]);
                let (count, both, ways) = edges.entry([a.min(b), a.max(b)]).or_default();
                if let Some(place) = both.get_mut(usize::from(*count)) {
                    (*place, ways[usize::from(*count)]) = (i, a < b);
                }
                *count = count.saturating_add(1);
            }
        }
        if edges.values().all(|(count, _, [first, second])| *count != 2 || first != second) {
            return;
        }
        let across = |i: usize| {
            let of = |k: usize| {
                let (a, b) = (cut[i][k], cut[i][(k + 1) % 3]);
                let (count, both, ways) = edges[&[a.min(b), a.max(b)]];
                (count == 2).then(|| (both[usize::from(both[0] == i)], ways[0] == ways[1]))
            };
            [0, 1, 2].map(of).into_iter().flatten()
        };
        let mut against: Vec<Option<bool>> = vec![None; cut.len()];
        let (mut turned, mut turn_round) = (Counted::default(), Vec::new());
        for start in 0..cut.len() {
            if against[start].is_some() {
                continue;
            }
            against[start] = Some(false);
            let (mut piece, mut done, mut one_sided) = (vec![start], 0, false);
            while let Some(&i) = piece.get(done) {
                done += 1;
                for (next, alike) in across(i) {
                    let side = against[i].map(|side| side != alike);
                    match against[next] {
                        None => {
                            against[next] = side;
                            piece.push(next);
                        }
                        Some(_) => one_sided |= against[next] != side,
                    }
                }
            }
            let other = piece.iter().filter(|&&i| against[i] == Some(true)).count();
            let wrong = 2 * other <= piece.len();
            // Of a band with one side no winding is right.
            piece.retain(|&i| !one_sided && against[i] == Some(wrong));
            piece.sort_unstable();
            for i in piece {
                turned.add(self.group(&faces[i]), faces[i].line as usize);
                faces[i].points.swap(1, 2);
                faces[i].uvs.swap(1, 2);
                turn_round.push(i);
            }
        }
        turn_round.into_iter().for_each(|i| cut[i].swap(1, 2));
        turned.note("triangle", "wound against their neighbours, turned round", notes);
    }

    /// The pieces of faces that hang together in the texture coordinates, cut where `rules`, those of the parts, are others.
    fn charts(
        &self,
        faces: &mut [Face],
        weld: &[u32],
        grain: f64,
        rules: &[usize],
        notes: &mut Vec<String>,
    ) -> Result<Charts, GarmentError> {
        let of_parts: Vec<usize> = faces.iter().map(|f| f.part as usize).collect();
        let (mut cut, uvs) = joined_corners(self.mesh, faces, weld, grain, &of_parts);
        self.wind_alike(faces, &mut cut, notes);
        let parted = charts(&cut, uvs.len(), faces, self.mesh)?;
        let mut turned = vec![0.0; faces.len()];
        for (&i, &chart) in parted.1.iter().zip(&parted.0) {
            turned[chart as usize] += self.in_uv(&faces[i]);
        }
        // Parts of one piece of cloth are joined, but not a panel and its mirror image that lies on it.
        let mut labels = vec![0; faces.len()];
        for (&i, &chart) in parted.1.iter().zip(&parted.0) {
            labels[i] = 2 * rules[faces[i].part as usize] + usize::from(turned[chart as usize] < 0.0);
        }
        let joined = joined_corners(self.mesh, faces, weld, grain, &labels);
        // Where parts lie on each other they stay apart.
        let (cut, uvs, (of_face, order)) = match charts(&joined.0, joined.1.len(), faces, self.mesh) {
            Ok(found) => (joined.0, joined.1, found),
            Err(_) => (cut, uvs, parted),
        };
        let faces = order.iter().map(|&i| faces[i]).collect();
        Ok(Charts { faces, cut: order.iter().map(|&i| cut[i]).collect(), uvs, of_face })
    }

    /// The panels, their areas in the unit of the file's texture coordinates. Those whose texture is seen from behind are
    /// turned round: an S twist stays S.
    fn upright_panels(
        &self,
        faces: &[Face],
        of_face: &[u32],
        cut: &[[u32; 3]],
        uvs: &mut [DVec2],
        notes: &mut Vec<String>,
    ) -> Result<Vec<Panel>, GarmentError> {
        let number = of_face.last().map_or(0, |&p| p as usize + 1);
        let mut turned = vec![0.0; number];
        for (face, &panel) in faces.iter().zip(of_face) {
            turned[panel as usize] += self.in_uv(face);
        }
        let mut panels: Vec<Panel> = Vec::with_capacity(number);
        let mut mirrored = Counted::default();
        let mut flipped = vec![Counted::default(); number];
        let mut done = vec![false; uvs.len()];
        for (i, face) in faces.iter().enumerate() {
            let panel = of_face[i] as usize;
            let mirror = turned[panel] < 0.0;
            if panel == panels.len() {
                let part = &self.mesh.parts[face.part as usize];
                if mirror {
                    mirrored.add(&part.group, face.line as usize);
                }
                panels.push(Panel {
                    group: part.group.clone(),
                    material: part.material.clone(),
                    mirrored: mirror,
                    faces: 0,
                    area: 0.0,
                    line: face.line as usize,
                });
            }
            panels[panel].faces += 1;
            panels[panel].area += self.in_uv(face).abs();
            if (self.in_uv(face) < 0.0) != mirror {
                flipped[panel].add(self.group(face), face.line as usize);
            }
            for c in cut[i] {
                if mirror && !std::mem::replace(&mut done[c as usize], true) {
                    uvs[c as usize].x = -uvs[c as usize].x;
                }
            }
        }
        mirrored.note("panel", "mirrored in its texture coordinates, turned round", notes);
        let all: usize = flipped.iter().map(Counted::count).sum();
        let worst = flipped.iter().zip(&panels).max_by_key(|(flipped, _)| flipped.count());
        if let Some((flipped, panel)) = worst.filter(|_| all * 20 > faces.len()) {
            let problem = format!(
                "{}: {} of its {} triangles lie upside down in the texture coordinates",
                panel_in_words(&panel.group),
                flipped.count(),
                panel.faces
            );
            let hint = "panels must lie flat, without folds over themselves: halves that share their texture coordinates \
                        are laid side by side";
            return Err(GarmentError::at(flipped.line(), problem, hint));
        }
        let upside_down = flipped.into_iter().reduce(Counted::with).unwrap_or_default();
        upside_down.note("triangle", "upside down in the texture coordinates, without stitches", notes);
        Ok(panels)
    }
}

/// Faces, those of a panel after each other, over corners with their texture coordinates, and the panel of each.
struct Charts {
    faces: Vec<Face>,
    cut: Vec<[u32; 3]>,
    uvs: Vec<DVec2>,
    of_face: Vec<u32>,
}

/// Corners that share place, texture coordinates (within `grain`) and the label of their face are one: the corners of each face,
/// and the texture coordinates of all corners.
fn joined_corners(
    mesh: &GarmentMesh,
    faces: &[Face],
    weld: &[u32],
    grain: f64,
    labels: &[usize],
) -> (Vec<[u32; 3]>, Vec<DVec2>) {
    let mut corners: HashMap<(u32, [i64; 2], usize), u32> = HashMap::new();
    let mut uvs = Vec::new();
    let cut = faces
        .iter()
        .zip(labels)
        .map(|(f, &label)| {
            [0, 1, 2].map(|k| {
                let uv = mesh.uvs[f.uvs[k] as usize];
                let key = (weld[f.points[k] as usize], (uv / grain).round().to_array().map(|v| v as i64), label);
                *corners.entry(key).or_insert_with(|| {
                    uvs.push(uv);
                    uvs.len() as u32 - 1
                })
            })
        })
        .collect();
    (cut, uvs)
}

/// The welded point of each point, and the first point of each welded one: what coincides is one.
fn weld(points: &[DVec3]) -> (Vec<u32>, Vec<u32>) {
    let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let grain = (1e-6 * (high - low).length()).max(1e-300);
    let mut cells: HashMap<[i64; 3], u32> = HashMap::with_capacity(points.len());
    let mut first = Vec::new();
    let weld = points
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let scaled = (*p - low) / grain;
            let key = |q: DVec3| q.floor().to_array().map(|v| v as i64);
            // Within half a cell of a border, the neighbour's cell may hold it.
            let near = [-0.25, 0.25];
            let around = near.iter().flat_map(|&x| near.iter().flat_map(move |&y| near.map(|z| DVec3::new(x, y, z))));
            if let Some(&found) = around.map(|d| key(scaled + d)).find_map(|k| cells.get(&k)) {
                return found;
            }
            first.push(i as u32);
            *cells.entry(key(scaled)).or_insert(first.len() as u32 - 1)
        })
        .collect();
    (weld, first)
}

/// Connected pieces of faces that share edges: the piece of each face in a new order, and that order.
fn charts(
    cut: &[[u32; 3]],
    corners: usize,
    faces: &[Face],
    mesh: &GarmentMesh,
) -> Result<(Vec<u32>, Vec<usize>), GarmentError> {
    let mut parent: Vec<u32> = (0..cut.len() as u32).collect();
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    let mut edges: HashMap<[u32; 2], (u32, u8)> = HashMap::with_capacity(cut.len() * 3 / 2);
    debug_assert!(corners > 0);
    for (i, f) in cut.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (f[k], f[(k + 1) % 3]);
            let entry = edges.entry([a.min(b), a.max(b)]).or_insert((i as u32, 0));
            entry.1 = entry.1.saturating_add(1);
            if entry.1 > 2 {
                let name = &mesh.parts[faces[i].part as usize].group;
                let problem = format!("{}: an edge with more than two faces in the flat panel", panel_in_words(name));
                return Err(GarmentError::at(faces[i].line as usize, problem, "remove doubled or inner faces"));
            }
            let (x, y) = (root(&mut parent, entry.0), root(&mut parent, i as u32));
            // The earlier one is the root, so that panels are in the file's order.
            parent[x.max(y) as usize] = x.min(y);
        }
    }
    let roots: Vec<u32> = (0..cut.len() as u32).map(|i| root(&mut parent, i)).collect();
    let mut order: Vec<usize> = (0..cut.len()).collect();
    order.sort_by_key(|&i| (roots[i], i));
    let mut number = 0;
    let of_face = (0..order.len())
        .map(|k| {
            number += u32::from(k > 0 && roots[order[k]] != roots[order[k - 1]]);
            number
        })
        .collect();
    Ok((of_face, order))
}

/// Edges at which more than two panels meet are sewn as they are found.
fn non_manifold(sewn: &[[u32; 3]], faces: &[Face], mesh: &GarmentMesh, notes: &mut Vec<String>) {
    let mut edges: HashMap<[u32; 2], u8> = HashMap::with_capacity(sewn.len() * 3 / 2);
    let mut many = Counted::default();
    for (f, face) in sewn.iter().zip(faces) {
        for k in 0..3 {
            let (a, b) = (f[k], f[(k + 1) % 3]);
            let count = edges.entry([a.min(b), a.max(b)]).or_insert(0);
            *count = count.saturating_add(1);
            if *count == 3 {
                many.add(&mesh.parts[face.part as usize].group, face.line as usize);
            }
        }
    }
    many.note("edge", "of more than two faces: panels end there instead of being sewn", notes);
}

/// 3-D lengths over flat lengths along both axes of each face, with its area.
fn along_axes(mesh: &GarmentMesh, faces: &[Face], unit_mm: f64, uv_mm: f64) -> Vec<(f64, f64)> {
    faces
        .iter()
        .flat_map(|f| {
            let points = f.points.map(|i| mesh.points[i as usize] * unit_mm);
            let [across, up] = axes(points, f.uvs.map(|i| mesh.uvs[i as usize] * uv_mm));
            let area = (points[1] - points[0]).cross(points[2] - points[0]).length();
            [(across.length(), area), (up.length(), area)]
        })
        .collect()
}

/// Where a step along u and one along v go in space, of a triangle.
fn axes([p, q, r]: [DVec3; 3], [a, b, c]: [DVec2; 3]) -> [DVec3; 2] {
    let (d1, d2) = (b - a, c - a);
    let det = d1.perp_dot(d2);
    [((q - p) * d2.y - (r - p) * d1.y) / det, ((r - p) * d1.x - (q - p) * d2.x) / det]
}

/// The value below which a share of the weight lies.
fn percentiles<const N: usize>(mut values: Vec<(f64, f64)>, shares: [f64; N]) -> [f64; N] {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = values.iter().map(|v| v.1).sum();
    shares.map(|share| {
        let mut sum = 0.0;
        for (value, weight) in &values {
            sum += weight;
            if sum >= share * total {
                return *value;
            }
        }
        values.last().map_or(1.0, |v| v.0)
    })
}

/// Panels whose texture coordinates are in another unit than those of the others; `ratios` are 3-D lengths over theirs of the faces,
/// panel by panel, with their areas.
fn same_unit(panels: &[Panel], ratios: &[(f64, f64)], uv_mm: f64) -> Result<(), GarmentError> {
    let mut rest = ratios;
    for panel in panels {
        let (own, others) = rest.split_at(panel.faces);
        rest = others;
        let [found] = percentiles(own.to_vec(), [0.5]);
        let ratio = found / uv_mm;
        if !(1.0 / WRONG_UNIT..=WRONG_UNIT).contains(&ratio) {
            let problem = format!(
                "{} is {ratio:.3} times as long as in the texture coordinates: their unit is about {found:.4} mm there and \
                 {uv_mm:.4} mm in the whole garment",
                panel_in_words(&panel.group)
            );
            let hint = "give the texture coordinates of all panels one scale, or leave out what is no cloth";
            return Err(GarmentError::at(panel.line, problem, hint));
        }
    }
    Ok(())
}

/// Millimetres per unit of texture coordinates, from what is said or from the ratio of lengths.
fn unit_of(found: f64, said: Option<f64>, notes: &mut Vec<String>) -> Result<f64, GarmentError> {
    if let Some(said) = said {
        let ratio = found / said;
        if !(1.0 / WRONG_UNIT..=WRONG_UNIT).contains(&ratio) {
            let problem = format!(
                "the garment is {ratio:.3} times as long as its panels: a unit of the texture coordinates is about {found:.4} mm"
            );
            let hint = "set `uv_unit` (or leave it out), or `unit` of the positions";
            return Err(GarmentError::at(0, problem, hint));
        }
        return Ok(said);
    }
    let near = UV_UNITS.iter().find(|(_, mm)| (found / mm).ln().abs() < 0.2);
    Ok(match near {
        Some((name, mm)) => {
            notes.push(format!("texture coordinates are in {name}, by the lengths of the mesh"));
            *mm
        }
        None => {
            notes.push(format!("a unit of the texture coordinates is {found:.4} mm, by the lengths of the mesh"));
            found
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two squares of 100 mm sewn along one side, `second` as the texture coordinates of the right one.
    fn two(second: &str) -> String {
        format!(
            "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nv 20 0 0\nv 20 10 0\nvt 0 0\nvt 10 0\nvt 10 10\nvt 0 10\n{second}\
             g left\nf 1/1 2/2 3/3 4/4\ng right\nf 2/5 5/6 6/7 3/8\n"
        )
    }

    const PLAIN: &str = "vt 30 0\nvt 40 0\nvt 40 10\nvt 30 10\n";

    fn panels(text: &str) -> Result<Panels, GarmentError> {
        Panels::new(&GarmentMesh::parse(text).unwrap(), 10.0, None, |_| 0)
    }

    #[test]
    fn charts_become_panels_and_seams_are_sewn() {
        let panels = panels(&two(PLAIN)).unwrap();
        assert_eq!(panels.panels.iter().map(|p| p.group.as_str()).collect::<Vec<_>>(), ["left", "right"]);
        assert_eq!(panels.of_face, [0, 0, 1, 1]);
        assert_eq!((panels.welded.len(), panels.uvs.len()), (6, 8));
        assert_eq!(panels.uv_mm, 10.0);
        assert!((panels.ratio.p50 - 1.0).abs() < 1e-12 && (panels.panels[0].area - 1e4).abs() < 1e-6);
    }

    #[test]
    fn mirrored_panels_are_turned_round() {
        let panels = panels(&two("vt 40 0\nvt 30 0\nvt 30 10\nvt 40 10\n")).unwrap();
        assert!(!panels.panels[0].mirrored && panels.panels[1].mirrored);
        assert!(panels.notes.iter().any(|n| n.contains("mirrored") && n.contains("`right`")), "{:?}", panels.notes);
        for face in &panels.cut {
            let [a, b, c] = face.map(|i| panels.uvs[i as usize]);
            assert!((b - a).perp_dot(c - a) > 0.0);
        }
        let nameless = two("vt 40 0\nvt 30 0\nvt 30 10\nvt 40 10\n").replace("g right", "g");
        let notes = self::panels(&nameless).unwrap().notes;
        assert!(notes.iter().any(|n| n.contains("first in the panel without a name")), "{notes:?}");
    }

    #[test]
    fn units_are_found_and_checked() {
        let text = two(PLAIN);
        let mesh = GarmentMesh::parse(&text).unwrap();
        assert!(Panels::new(&mesh, 10.0, Some(1000.0), |_| 0).unwrap_err().problem.contains("10.0000 mm"));
        assert_eq!(Panels::new(&mesh, 1.0, None, |_| 0).unwrap().uv_mm, 1.0);
        let odd = Panels::new(&mesh, 3.0, None, |_| 0).unwrap();
        assert!((odd.uv_mm - 3.0).abs() < 1e-9 && odd.notes[0].contains("3.0000 mm"), "{:?}", odd.notes);
    }

    #[test]
    fn bad_faces_are_told() {
        let flat = panels(&(two(PLAIN) + "f 1/1 1/1 2/2\n")).unwrap();
        assert!(flat.notes.iter().any(|n| n.contains("without area")), "{:?}", flat.notes);
        let doubled = panels(&(two(PLAIN) + "g left\nf 1/1 2/2 3/3\nf 1/1 2/2 4/4\n")).unwrap_err();
        assert!(doubled.problem.contains("`left`") && doubled.line > 0, "{doubled:?}");
        let none = panels("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 0 0\nvt 0 0\nf 1/1 2/2 3/3\n").unwrap_err();
        assert!(none.problem.contains("texture coordinates have no area"));
        let line = panels("v 0 0 0\nv 1 0 0\nv 2 0 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n").unwrap_err();
        assert!(line.problem.contains("no area in space") && line.of_mesh, "{line:?}");
        // One triangle has an area in space alone, and the other one on its panel.
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt 2 0\nf 1/1 2/2 3/4\nf 1/1 2/2 4/3\n";
        assert!(panels(text).unwrap_err().problem.contains("both in space and in texture"));
    }

    #[test]
    fn panels_of_another_unit_are_told() {
        let error = panels(&two("vt 300 0\nvt 400 0\nvt 400 100\nvt 300 100\n")).unwrap_err();
        assert!(error.problem.starts_with("panel `left` is 10.000 times as long"), "{error:?}");
        assert_eq!(error.line, 16);
        // A band that is stretched is none of these.
        panels(&two("vt 30 0\nvt 35 0\nvt 35 10\nvt 30 10\n")).unwrap();
    }

    #[test]
    fn folded_panels_are_named() {
        let folded = panels(&two("vt 30 0\nvt 40 0\nvt 40 10\nvt 39 9\n")).unwrap();
        assert!(folded.notes.iter().all(|n| !n.contains("upside down")), "cut as it lies flat: {:?}", folded.notes);
        let text = two(PLAIN).replace("f 2/5 5/6 6/7 3/8\n", "f 2/5 5/6 6/7\nf 2/5 6/7 3/6\n");
        let error = panels(&text).unwrap_err();
        assert!(error.problem.starts_with("panel `right`: 1 of its 2 triangles lie upside down"), "{error:?}");
        assert_eq!(error.line, 19);
    }

    /// A grid of 4 x 4 squares of 10 mm in one piece, a group for each row where `rows` says so.
    fn grid(rows: bool) -> String {
        let mut text = String::new();
        for (y, x) in (0..5).flat_map(|y| (0..5).map(move |x| (y, x))) {
            text += &format!("v {x} {y} 0\nvt {x} {y}\n");
        }
        for (y, x) in (0..4).flat_map(|y| (0..4).map(move |x| (y, x))) {
            let [a, b, c, d] = [1, 2, 7, 6].map(|k| k + 5 * y + x);
            text += &if rows { format!("g row{y}\n") } else { String::new() };
            text += &format!("f {a}/{a} {b}/{b} {c}/{c} {d}/{d}\n");
        }
        text
    }

    #[test]
    fn faces_wound_against_their_neighbours_are_turned() {
        let plain = panels(&grid(false)).unwrap();
        let flipped = panels(&grid(false).replace("f 7/7 8/8 13/13 12/12\n", "f 12/12 13/13 8/8 7/7\n")).unwrap();
        let told =
            "2 triangles wound against their neighbours, turned round (first in the panel without a name, line 56)";
        assert!(flipped.notes.iter().any(|n| n == told), "{:?}", flipped.notes);
        assert!(
            flipped.notes.iter().all(|n| !n.contains("upside down")) && plain.panels[0].area == flipped.panels[0].area
        );
        for face in &flipped.cut {
            let [a, b, c] = face.map(|i| flipped.uvs[i as usize]);
            assert!((b - a).perp_dot(c - a) > 0.0);
        }
    }

    #[test]
    fn parts_are_joined_unless_rules_differ() {
        let mesh = GarmentMesh::parse(&grid(true)).unwrap();
        let of = |rule: fn(&Part) -> usize| Panels::new(&mesh, 10.0, None, rule).unwrap();
        assert_eq!(of(|_| 0).panels.len(), 1);
        let cut = of(|part| usize::from(part.group == "row2"));
        assert_eq!(cut.panels.iter().map(|p| p.group.as_str()).collect::<Vec<_>>(), ["row0", "row2", "row3"]);
    }

    #[test]
    fn mirror_images_that_lie_on_each_other_stay_apart() {
        // Front and back are one over the other in the texture coordinates, and meet at the side.
        let panels = panels(&two("vt 10 0\nvt 0 0\nvt 0 10\nvt 10 10\n")).unwrap();
        assert_eq!(panels.panels.iter().map(|p| p.mirrored).collect::<Vec<_>>(), [false, true]);
    }
}
