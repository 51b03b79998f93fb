//! Yarns on garments: a mesh whose texture coordinates are its flat panels, and cloth that repeats, laid over them.
//!
//! [`mesh`] reads the garment, `panels` finds its panels and what is sewn to what, `surface` makes it smooth, `lattice`
//! divides each panel into stitches up to its `border`, `strain` relaxes the cloth's tile at the strains that occur, `lay`
//! lays its yarns from row to row over the `sheet` of a frame, each colour with its `floats`, `sewing` says what is at the borders, of which `fold` turns
//! in what is sewn and `edges` makes the yarns, and `body` keeps them outside of who wears them. All lengths are
//! millimetres.

mod body;
mod border;
mod edges;
mod floats;
mod fold;
mod lattice;
mod lay;
pub(crate) mod mesh;
mod panels;
mod sewing;
mod sheet;
mod strain;
mod subdivide;
mod surface;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use self::{
    body::Body,
    edges::{Edging, finish, relaxed_link},
    floats::Lanes,
    lattice::Lattice,
    lay::{Laying, lay},
    panels::Panels,
    sewing::Sewing,
    strain::Shapes,
    surface::{Surface, bounds},
};
pub(crate) use self::{
    edges::SeamKind,
    floats::{Floats, Stranded},
    lay::{LaidYarn, Tension},
    mesh::{GarmentError, GarmentMesh},
    panels::{LengthRatio, Panel},
};
use crate::{
    files::stage::glob,
    geometry::mesh::Mesh,
    math::words::counted,
    pattern::{StrandKind, tile::Tile},
};

/// More stitches than these are not laid.
pub(crate) const MOST_STITCHES: f64 = 2e7;

/// The cloth of some panels.
#[derive(Clone, Debug)]
pub(crate) struct Cloth {
    /// Group or material of the panels, with `*` and `?`; `None` for all that no other cloth takes.
    pub group: Option<String>,
    /// What repeats, mm, at the gauge that it is to have.
    pub tile: Tile,
    /// Angle by which rows are turned against the panel's u axis, radians.
    pub grain: f64,
    /// Control points of a stitch.
    pub points: usize,
    /// How these panels are sewn, if not as all are; of two cloths that say it the later one counts.
    pub seam: Option<SeamKind>,
}

/// What is laid on a garment.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    /// Millimetres per unit of the mesh.
    pub unit_mm: f64,
    /// Millimetres per unit of its texture coordinates; found from lengths if absent.
    pub uv_mm: Option<f64>,
    /// The first is for panels that no other one names; later ones win.
    pub cloths: Vec<Cloth>,
    /// How panels are sewn.
    pub seam: SeamKind,
    /// How loops vary.
    pub tension: Option<Tension>,
    /// Whether yarns know their stitches.
    pub coordinates: bool,
    /// Whether seams are pressed flat, as over a body.
    pub pressed: bool,
    /// Only stitches so near to a place of the first frame are laid, mm; all if absent.
    pub near: Option<(DVec3, f64)>,
}

/// What is known of a garment before any yarn is laid.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Report {
    /// Its panels.
    pub panels: Vec<Panel>,
    /// Stitches (or crossings) of each panel.
    pub stitches: Vec<u64>,
    /// Which cloth each panel has.
    pub cloth: Vec<usize>,
    /// Length of the yarns of each cloth, about, without what finishes edges; mm.
    pub yarn_length: Vec<f64>,
    /// About as many control points of each cloth.
    pub control_points: Vec<u64>,
    /// 3-D length over length as cut.
    pub ratio: LengthRatio,
    /// Share of the area that is stretched by more than a tenth along u or v.
    pub stretched: f64,
    /// Millimetres per unit of the texture coordinates.
    pub uv_mm: f64,
    /// What was repaired or found out, one line each.
    pub notes: Vec<String>,
    /// The box around the mesh, mm.
    pub bounds: (DVec3, DVec3),
}

impl Report {
    /// Stitches of all panels.
    pub(crate) fn all_stitches(&self) -> u64 {
        self.stitches.iter().sum()
    }
}

/// A garment divided into stitches, ready to be laid in any frame.
pub(crate) struct Garment {
    panels: Panels,
    surface: Surface,
    lattices: Vec<Lattice>,
    shapes: Vec<Shapes>,
    sewing: Sewing,
    edgings: Vec<Edging>,
    /// How far the fine points of the surface are kept from a body, mm, if not all by the same.
    clearances: Vec<f32>,
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
        let mut panels = Panels::new(mesh, options.unit_mm, options.uv_mm)?;
        let cloth = choose(&panels.panels, &options.cloths)?;
        panels.turn(&cloth.iter().map(|&c| -options.cloths[c].grain).collect::<Vec<_>>());
        let too_many: f64 = panels
            .panels
            .iter()
            .zip(&cloth)
            .map(|(p, &c)| p.area / options.cloths[c].tile.stitch().element_product())
            .sum();
        if too_many > MOST_STITCHES {
            let stitch = options.cloths[0].tile.stitch();
            let problem = format!(
                "{too_many:.2e} stitches of {:.4} x {:.4} mm; at most {MOST_STITCHES:.0e} are laid",
                stitch.x, stitch.y
            );
            return Err(GarmentError::new(problem, "a coarser gauge, or another `gauge_per` or `unit`"));
        }
        let points = panels.points(mesh, options.unit_mm);
        let ranges = panels.strains(&points, &cloth, options.cloths.len());
        let shapes: Vec<Shapes> = options
            .cloths
            .iter()
            .zip(ranges)
            .map(|(c, range)| Shapes::new(&c.tile, c.points, range))
            .collect::<Result<_, _>>()?;
        let widest = options.cloths.iter().map(|c| c.tile.stitch().x).fold(0.0, f64::max);
        let surface = Surface::new(&panels, &points, (1.5 * widest).max(2.5));
        let borders = surface.borders(panels.panels.len());
        let boxes = borders.iter().zip(&cloth).map(|(border, &c)| {
            let [low, high] = bounds(border);
            ((high - low).max(DVec2::ZERO) / options.cloths[c].tile.stitch()).element_product()
        });
        if let Some((panel, places)) = boxes.enumerate().find(|(_, places)| *places > 4.0 * MOST_STITCHES) {
            let panel = &panels.panels[panel];
            let problem = format!(
                "panel `{}` lies askew in the texture coordinates: the rows and wales of the box around it hold {places:.1e} stitches",
                panel.group
            );
            return Err(GarmentError::at(panel.line, problem, "turn it upright, or its wales with `grain`, or cut it"));
        }
        let pose = surface.pose(&points);
        let wanted = |at: DVec3| options.near.is_none_or(|(middle, radius)| at.distance(middle) <= radius);
        let lays = |anchor| wanted(surface.at(&pose, anchor).0);
        let sewing = Sewing::new(&options, &shapes, &borders, &cloth);
        let lattices: Vec<Lattice> = borders
            .par_iter()
            .enumerate()
            .map(|(panel, border)| Lattice::new(&surface, panel as u32, border, &sewing.division(panel), &lays))
            .collect();
        if lattices.iter().all(|l| l.stitches == 0) {
            if let Some((at, radius)) = options.near {
                let problem = format!("no stitch lies within {radius:.3} mm of {at:.3} mm");
                return Err(GarmentError::new(problem, "a place on the cloth in its first frame, or a larger radius"));
            }
            let stitch = options.cloths[0].tile.stitch();
            let problem = format!("no panel has room for a stitch of {:.3} x {:.3} mm", stitch.x, stitch.y);
            return Err(GarmentError::new(problem, "a finer gauge, another `unit`, or is the mesh cut short?"));
        }
        let mut notes = panels.notes.clone();
        for (lattice, panel) in lattices.iter().zip(&panels.panels) {
            if lattice.stitches == 0 && options.near.is_none() {
                notes.push(format!("panel `{}` has no room for a single stitch", panel.group));
            }
            if lattice.doubled * 100 > lattice.stitches as usize {
                let problem = format!(
                    "panel `{}` overlaps itself in the texture coordinates: {} of {} stitches have two places",
                    panel.group, lattice.doubled, lattice.stitches
                );
                return Err(GarmentError::at(panel.line, problem, "lay the panel out flat, without overlaps"));
            }
        }
        let mut edgings = sewing.edgings(&pose, &borders, &lattices);
        edgings.retain(|e| e.way.vertices.iter().any(|&v| wanted(pose.vertex(v).0)));
        let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let mut stitches_of = vec![0; shapes.len()];
        lattices.iter().zip(&cloth).for_each(|(lattice, own)| stitches_of[*own] += lattice.stitches);
        let report = Report {
            stitches: lattices.iter().map(|l| l.stitches).collect(),
            yarn_length: stitches_of.iter().zip(&shapes).map(|(n, shape)| *n as f64 * shape.length).collect(),
            control_points: (stitches_of.iter().zip(&shapes).zip(&options.cloths))
                .map(|((n, shape), cloth)| n * cloth.points as u64 * if shape.has_axis(1) { 2 } else { 1 })
                .collect(),
            cloth,
            ratio: panels.ratio,
            stretched: panels.stretched,
            uv_mm: panels.uv_mm,
            panels: panels.panels.clone(),
            notes,
            bounds: (low, high),
        };
        let clearances =
            if options.pressed { sewing.clearances(&pose, &borders, clearance(&shapes)) } else { Vec::new() };
        Ok(Self { panels, surface, lattices, shapes, sewing, edgings, clearances, options, report })
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
        let mut poses = Vec::with_capacity(frames.len());
        for (i, frame) in frames.iter().enumerate() {
            first.same_topology(frame).map_err(|problem| (i, problem))?;
            poses.push(self.surface.pose(&self.panels.points(frame, self.options.unit_mm)));
        }
        let stranded = |cloth: usize| stranded.get(cloth).and_then(Option::as_ref);
        let behind = |(cloth, shapes): (usize, &Shapes)| stranded(cloth).map_or(0.0, |_| Lanes::reach(shapes));
        let least = self.shapes.iter().enumerate().map(behind).fold(clearance(&self.shapes), f64::max);
        let of_point = |i: usize| self.clearances.get(i).map_or(least, |c| least.max(f64::from(*c)));
        let most = self.clearances.iter().map(|c| f64::from(*c)).fold(4.0 * least, f64::max);
        let bodies: Vec<Body> = bodies.par_iter().map(|mesh| Body::new(mesh, most)).collect();
        let mut laid: Vec<Laid> = vec![vec![Vec::new(); self.options.cloths.len()]; frames.len()];
        for (i, pose) in poses.iter_mut().enumerate() {
            let pushed = bodies.get(i).map_or(0, |body| pose.push_out(body, &of_point));
            if pushed > 0 {
                self.surface.turn_normals(pose);
            }
            if pushed > 0 && i == 0 {
                notes.push(format!("{} of the cloth moved out of the body or off its skin", counted(pushed, "point")));
            }
        }
        for (lattice, &cloth) in self.lattices.iter().zip(&self.report.cloth) {
            if lattice.stitches == 0 {
                continue;
            }
            let sheets: Vec<_> =
                poses.iter().map(|p| lattice.sheet(&self.surface, p, self.sewing.folds(cloth))).collect();
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
            for (frame, mut yarns) in laid.iter_mut().zip(finish(&poses, &own, &link)) {
                if self.options.coordinates {
                    for yarn in &mut yarns {
                        yarn.coordinates = vec![[0.5, 0.5]; yarn.points.len()];
                    }
                }
                frame[cloth].append(&mut yarns);
            }
        }
        Ok(laid)
    }
}

/// How far cloth is kept from a body, mm.
fn clearance(shapes: &[Shapes]) -> f64 {
    shapes.iter().map(|s| 2.2 * s.diameter).fold(0.0, f64::max)
}

/// The cloth of each panel.
fn choose(panels: &[Panel], cloths: &[Cloth]) -> Result<Vec<usize>, GarmentError> {
    let chosen: Vec<usize> = panels
        .iter()
        .map(|panel| {
            let takes = |c: &Cloth| c.group.as_ref().is_some_and(|g| glob(g, &panel.group) || glob(g, &panel.material));
            cloths.iter().rposition(takes).unwrap_or(0)
        })
        .collect();
    for (i, cloth) in cloths.iter().enumerate() {
        let Some(group) = &cloth.group else { continue };
        if !panels.iter().any(|p| glob(group, &p.group) || glob(group, &p.material)) {
            let mut names: Vec<&str> =
                panels.iter().flat_map(|p| [p.group.as_str(), p.material.as_str()]).filter(|n| !n.is_empty()).collect();
            names.sort_unstable();
            names.dedup();
            names.truncate(24);
            let hint = if names.is_empty() {
                "the mesh has neither groups nor materials".to_owned()
            } else {
                format!("it has: {}", names.join(", "))
            };
            return Err(GarmentError::new(format!("no group or material of the mesh is called \"{group}\""), hint));
        }
        debug_assert!(i > 0, "the first cloth is for the rest");
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests;
