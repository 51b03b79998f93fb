//! Yarns on garments: a mesh whose texture coordinates are its flat panels, and cloth that repeats, laid over them.
//!
//! [`mesh`] reads the garment, `panels` finds its panels and what is sewn to what, `surface` makes it smooth, `lattice`
//! divides each panel into stitches up to its `border` and what lies under a `hem`, `strain` relaxes the cloth's tile at the strains that occur, `settle`
//! lets out what a frame presses together, `lay` lays its yarns from `run` to `run` over the `sheet` of a frame, each colour
//! with its `floats`, `sewing` says what is at the borders by the kind of `seam`, of which `fold` turns in what is sewn and
//! `edges` makes the yarns, and `body` keeps them outside of who wears them. `options` are what is asked for, `check` refuses
//! what cannot be laid, `report` tells what is known before. No part uses another that uses it. All lengths are millimetres.

mod body;
mod border;
mod check;
mod edges;
mod floats;
mod fold;
mod hem;
mod hem_threads;
mod lattice;
mod lay;
pub(crate) mod mesh;
mod open_edges;
mod options;
mod panels;
mod report;
mod run;
mod seam;
mod settle;
mod sewing;
mod sheet;
mod strain;
mod subdivide;
mod surface;

use std::borrow::Cow;

use glam::DVec3;
use rayon::prelude::*;

use self::{
    body::Body,
    edges::{Edging, finish, relaxed_link},
    floats::Lanes,
    hem_threads::{HemThread, hem_threads},
    lattice::{Ground, Lattice},
    lay::{Laying, lay},
    mesh::Part,
    panels::Panels,
    sewing::Sewing,
    sheet::Sheet,
    strain::Shapes,
    surface::Surface,
};
pub(crate) use self::{
    floats::{Floats, Stranded},
    hem::{Hem, HemKind},
    lay::{LaidYarn, Tension},
    mesh::{GarmentError, GarmentMesh},
    options::{Cloth, Options, PanelChoice},
    panels::Panel,
    report::Report,
    seam::SeamKind,
};
use crate::{files::stage::glob, geometry::mesh::Mesh, math::words::counted, pattern::StrandKind};

/// A garment divided into stitches, ready to be laid in any frame.
pub(crate) struct Garment {
    panels: Panels,
    surface: Surface,
    lattices: Vec<Lattice>,
    shapes: Vec<Shapes>,
    sewing: Sewing,
    edgings: Vec<Edging>,
    hem_threads: Vec<HemThread>,
    /// How far the fine points of the surface are kept from a body, mm, if not all by the same.
    clearances: Vec<f32>,
    /// The lengths of the surface's finest edges as the first frame is worn, mm.
    worn: Vec<f64>,
    options: Options,
    report: Report,
}

/// The yarns of one frame, for each cloth.
pub(crate) type Laid = Vec<Vec<LaidYarn>>;

impl Garment {
    /// Divides the panels of a mesh (the first frame of an animation) into stitches.
    ///
    /// # Errors
    /// What is wrong with the mesh, or with what is to be laid on it.
    pub(crate) fn new(mesh: &GarmentMesh, options: Options) -> Result<Self, GarmentError> {
        check::named(&mesh.parts, &options.cloths)?;
        let rule = |part: &Part| cloth_of(&part.group, &part.material, None, &options.cloths);
        let mut panels = Panels::new(mesh, options.unit_mm, options.uv_mm, rule)?;
        let cloth = choose(&panels.panels, &options.cloths)?;
        panels.turn(&cloth.iter().map(|&c| -options.cloths[c].grain).collect::<Vec<_>>());
        check::not_too_many(&panels.panels, &cloth, &options.cloths)?;
        let points = panels.points(mesh, options.unit_mm);
        let shapes = relaxed(&panels, &points, &cloth, &options.cloths)?;
        let widest = options.cloths.iter().map(|c| c.tile.stitch().x).fold(0.0, f64::max);
        let surface = Surface::new(&panels, &points, (1.5 * widest).max(2.5));
        let borders = surface.borders(panels.panels.len());
        check::upright(&panels.panels, &borders, &cloth, &options.cloths)?;
        let pose = surface.pose(&points);
        let wanted = |at: DVec3| options.near.is_none_or(|(middle, radius)| at.distance(middle) <= radius);
        let lays = |anchor| wanted(surface.at(&pose, anchor).0);
        let sewing = Sewing::new(&options, &shapes, &borders, &cloth);
        let grounds: Vec<Ground<'_>> = borders
            .par_iter()
            .enumerate()
            .map(|(panel, border)| sewing.division(panel).ground(&surface, panel as u32, border))
            .collect();
        check::hems(&sewing, &grounds, &borders, (&panels.panels, &cloth), &options.cloths)?;
        let lattices: Vec<Lattice> = borders
            .par_iter()
            .enumerate()
            .map(|(panel, border)| Lattice::new(&grounds[panel], panel as u32, border, &sewing.division(panel), &lays))
            .collect();
        check::has_room(&lattices, &panels.panels, &options)?;
        check::flat(&lattices, &panels.panels)?;
        let mut edgings = sewing.edgings(&pose, &borders, &lattices);
        edgings.retain(|e| e.way.vertices.iter().any(|&v| wanted(pose.vertex(v).0)));
        let (hem_threads, hemmed) = hem_threads(&sewing, &grounds, &pose, &borders);
        let hem_threads = hem_threads.into_iter().flat_map(|thread| thread.on(&lays)).collect();
        let clearances =
            if options.pressed { sewing.clearances(&pose, &borders, clearance(&shapes)) } else { Vec::new() };
        let worn = surface.worn_lengths(&pose, panels.panels.len());
        let edges = open_edges::lengths(&borders);
        let mut report = Report::new(&panels, &points, &lattices, (cloth, &shapes), &hemmed, edges, &options);
        open_edges::note_gaps(&panels.panels, &borders, &pose, &mut report.notes);
        Ok(Self { panels, surface, lattices, shapes, sewing, edgings, hem_threads, clearances, worn, options, report })
    }

    /// What is known of it.
    pub(crate) fn report(&self) -> &Report {
        &self.report
    }

    /// The panels of a cloth on which anything is laid.
    fn of_cloth(&self, cloth: usize) -> impl Iterator<Item = &Lattice> {
        let all = self.lattices.iter().zip(&self.report.cloth);
        all.filter(move |(l, c)| **c == cloth && l.stitches > 0).map(|(l, _)| l)
    }

    /// The most columns and rows of the panels of a cloth, from their flat corners on; `None` if none is of it.
    pub(crate) fn counts(&self, cloth: usize) -> Option<[usize; 2]> {
        let own = self.of_cloth(cloth).map(|l| [0, 1].map(|k| l.counts[k] - l.turned_in[k].min(l.counts[k] - 1)));
        own.reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])])
    }

    /// What the floats of a cloth come to, and about their length, mm, and control points.
    pub(crate) fn floats(&self, cloth: usize, stranded: &Stranded) -> (Floats, f64, u64) {
        let mut all = Floats::default();
        let mut length = 0.0;
        for lattice in self.of_cloth(cloth) {
            let own = floats::count(lattice, stranded);
            length += own.stitches as f64 * lattice.stitch.x;
            all = Floats { stitches: all.stitches + own.stitches, most: all.most.max(own.most) };
        }
        (all, length, all.stitches * floats::FLOATING.len() as u64)
    }

    /// What the yarns of a cloth are.
    pub(crate) fn kinds(&self, cloth: usize) -> Vec<StrandKind> {
        self.shapes[cloth].strands.iter().map(|s| s.kind).collect()
    }

    /// Whether yarns of a cloth are pressed flat.
    pub(crate) fn is_pressed(&self, cloth: usize) -> bool {
        self.shapes[cloth].strands.iter().any(|s| s.is_pressed())
    }

    /// Lays the yarns in some frames, which have the first one's topology: the same yarns with the same points in each.
    /// Bodies are as many as frames, or none. `stranded` says for each cloth whose colours are yarns of their own which
    /// those are; of what is beyond its end none are. Notes tell what had to be moved.
    ///
    /// # Errors
    /// A frame of another topology: its place among the frames, and what differs.
    pub(crate) fn lay(
        &self,
        first: &GarmentMesh,
        frames: &[&GarmentMesh],
        bodies: &[&Mesh],
        stranded: &[Option<Stranded>],
        notes: &mut Vec<String>,
    ) -> Result<Vec<Laid>, (usize, String)> {
        let origin = local_origin(&self.panels.points(first, self.options.unit_mm));
        let mut poses = Vec::with_capacity(frames.len());
        for (i, frame) in frames.iter().enumerate() {
            first.same_topology(frame).map_err(|problem| (i, problem))?;
            let mut points = self.panels.points(frame, self.options.unit_mm);
            points.iter_mut().for_each(|p| *p -= origin);
            poses.push(self.surface.pose(&points));
        }
        let stranded = |cloth: usize| stranded.get(cloth).and_then(Option::as_ref);
        let behind = |(cloth, shapes): (usize, &Shapes)| stranded(cloth).map_or(0.0, |_| Lanes::reach(shapes));
        let least = self.shapes.iter().enumerate().map(behind).fold(clearance(&self.shapes), f64::max);
        let of_point = |i: usize| self.clearances.get(i).map_or(least, |c| least.max(f64::from(*c)));
        let most = self.clearances.iter().map(|c| f64::from(*c)).fold(4.0 * least, f64::max);
        let bodies: Vec<Body> = bodies.par_iter().map(|mesh| Body::new(&moved(mesh, -origin), most)).collect();
        let mut laid: Vec<Laid> = vec![vec![Vec::new(); self.options.cloths.len()]; frames.len()];
        for (i, pose) in poses.iter_mut().enumerate() {
            let pushed = bodies.get(i).map_or(0, |body| pose.push_out(body, &of_point));
            let let_out = self.surface.settle(pose, &self.worn, bodies.get(i), &of_point);
            if pushed + let_out > 0 {
                self.surface.turn_normals(pose);
            }
            if pushed > 0 && i == 0 {
                notes.push(format!("{} of the cloth moved out of the body or off its skin", counted(pushed, "point")));
            }
            if let_out > 0 && i == 0 {
                let edges = counted(let_out, "edge");
                notes.push(format!("cloth let out where the mesh presses it together, at {edges} of its refinement"));
            }
        }
        for (lattice, &cloth) in self.lattices.iter().zip(&self.report.cloth) {
            if lattice.stitches == 0 {
                continue;
            }
            let sheets: Vec<_> =
                poses.iter().map(|p| Sheet::new(lattice, &self.surface, p, self.sewing.bends(cloth))).collect();
            let laying = Laying {
                tension: self.options.tension,
                stranded: stranded(cloth),
                coordinates: self.options.coordinates,
            };
            let yarns = lay(&sheets, &self.shapes[cloth], laying);
            for (frame, yarns) in laid.iter_mut().zip(yarns) {
                frame[cloth].extend(yarns);
            }
        }
        let link = relaxed_link();
        for cloth in 0..self.options.cloths.len() {
            let own: Vec<&Edging> = self.edgings.iter().filter(|e| e.cloth == cloth).collect();
            let threads: Vec<&HemThread> = self.hem_threads.iter().filter(|t| t.cloth == cloth).collect();
            for ((frame, pose), mut yarns) in laid.iter_mut().zip(&poses).zip(finish(&poses, &own, &link)) {
                yarns.par_extend(threads.par_iter().map(|thread| thread.lay(&self.surface, pose)));
                if self.options.coordinates {
                    for yarn in &mut yarns {
                        yarn.coordinates = vec![[0.5, 0.5]; yarn.points.len()];
                    }
                }
                frame[cloth].append(&mut yarns);
            }
        }
        if origin != DVec3::ZERO {
            let yarns = laid.par_iter_mut().flatten().flatten();
            yarns.for_each(|yarn| yarn.points.iter_mut().for_each(|p| *p += origin));
        }
        Ok(laid)
    }
}

/// The least and the greatest coordinates of points.
fn box_around(points: &[DVec3]) -> (DVec3, DVec3) {
    let all = || points.iter().copied();
    (all().fold(DVec3::INFINITY, DVec3::min), all().fold(DVec3::NEG_INFINITY, DVec3::max))
}

/// Where cloth is laid from: sheets are of single precision, which tells places within 10 m apart by a thousandth of a millimetre.
fn local_origin(points: &[DVec3]) -> DVec3 {
    const FAR: f64 = 1e4;
    let (low, high) = box_around(points);
    if low.abs().max(high.abs()).max_element() > FAR { (0.5 * (low + high)).round() } else { DVec3::ZERO }
}

/// A mesh moved by so much.
fn moved(mesh: &Mesh, by: DVec3) -> Cow<'_, Mesh> {
    let mut mesh = Cow::Borrowed(mesh);
    if by != DVec3::ZERO {
        mesh.to_mut().points.iter_mut().for_each(|p| *p += by);
    }
    mesh
}

/// The tile of each cloth at the strains that occur on its panels.
fn relaxed(panels: &Panels, points: &[DVec3], cloth: &[usize], cloths: &[Cloth]) -> Result<Vec<Shapes>, GarmentError> {
    let ranges = panels.strains(points, cloth, cloths.len());
    cloths.iter().zip(ranges).map(|(c, range)| Shapes::new(&c.tile, c.points, range)).collect()
}

/// How far cloth is kept from a body, mm.
fn clearance(shapes: &[Shapes]) -> f64 {
    shapes.iter().map(|s| 2.2 * s.diameter).fold(0.0, f64::max)
}

/// The last cloth that a group or material has, or a panel of a number, from 1; else the first one.
fn cloth_of(group: &str, material: &str, number: Option<usize>, cloths: &[Cloth]) -> usize {
    let takes = |cloth: &Cloth| match &cloth.panels {
        Some(PanelChoice::Named(name)) => glob(name, group) || glob(name, material),
        Some(PanelChoice::Numbered(chosen)) => Some(*chosen) == number,
        None => false,
    };
    cloths.iter().rposition(takes).unwrap_or(0)
}

/// The cloth of each panel.
fn choose(panels: &[Panel], cloths: &[Cloth]) -> Result<Vec<usize>, GarmentError> {
    check::numbered(panels.len(), cloths)?;
    let numbered = panels.iter().zip(1..);
    Ok(numbered.map(|(panel, number)| cloth_of(&panel.group, &panel.material, Some(number), cloths)).collect())
}

#[cfg(test)]
mod tests;
