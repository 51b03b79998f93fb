//! What is known of a garment before any yarn is laid.

use glam::DVec3;

use super::{
    box_around,
    hem::Hem,
    lattice::Lattice,
    mesh::panel_in_words,
    options::Options,
    panels::{LengthRatio, Panel, Panels},
    strain::Shapes,
};

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
    /// Share of it that is compressed by more than a tenth along u or v.
    pub compressed: f64,
    /// Millimetres per unit of the texture coordinates.
    pub uv_mm: f64,
    /// Length of all seams as cut, mm.
    pub sewn: f64,
    /// Length of all edges that are sewn to nothing, as cut, mm.
    pub free: f64,
    /// What was repaired or found out, one line each.
    pub notes: Vec<String>,
    /// The box around the mesh, mm.
    pub bounds: (DVec3, DVec3),
}

impl Report {
    /// Of panels divided into stitches; `points` are welded, mm, `cloth` is that of each panel, `hemmed` how long edges of each
    /// kind of hem are, mm, and then how long seams and free edges are.
    pub(super) fn new(
        panels: &Panels,
        points: &[DVec3],
        lattices: &[Lattice],
        (cloth, shapes): (Vec<usize>, &[Shapes]),
        hemmed: &[(Hem, f64)],
        [sewn, free]: [f64; 2],
        options: &Options,
    ) -> Self {
        let mut notes = panels.notes.clone();
        panels.note_upside_down(points, &mut notes);
        for (lattice, panel) in lattices.iter().zip(&panels.panels) {
            if lattice.stitches == 0 && options.near.is_none() {
                notes.push(format!("{} has no room for a single stitch", panel_in_words(&panel.group)));
            }
        }
        for (Hem { kind, width }, length) in hemmed {
            let kind = kind.told();
            notes.push(format!("hems of {width:.1} mm along {length:.0} mm of free edges, {kind}"));
        }
        let mut stitches_of = vec![0; shapes.len()];
        lattices.iter().zip(&cloth).for_each(|(lattice, own)| stitches_of[*own] += lattice.stitches);
        Self {
            stitches: lattices.iter().map(|l| l.stitches).collect(),
            yarn_length: stitches_of.iter().zip(shapes).map(|(n, shape)| *n as f64 * shape.length).collect(),
            control_points: (stitches_of.iter().zip(shapes).zip(&options.cloths))
                .map(|((n, shape), cloth)| n * cloth.points as u64 * if shape.has_axis(1) { 2 } else { 1 })
                .collect(),
            cloth,
            ratio: panels.ratio,
            stretched: panels.stretched,
            compressed: panels.compressed,
            uv_mm: panels.uv_mm,
            sewn,
            free,
            panels: panels.panels.clone(),
            notes,
            bounds: box_around(points),
        }
    }

    /// Stitches of all panels.
    pub(crate) fn all_stitches(&self) -> u64 {
        self.stitches.iter().sum()
    }
}
