//! What cannot be laid, told before anything is.

use glam::DVec2;

use super::{
    lattice::Lattice,
    mesh::GarmentError,
    options::{Cloth, Options},
    panels::Panel,
    surface::{BorderEdge, bounds},
};

/// More stitches than these are not laid.
const MOST_STITCHES: f64 = 2e7;

/// Panels that hold too many stitches; `cloth` is that of each of them.
pub(super) fn not_too_many(panels: &[Panel], cloth: &[usize], cloths: &[Cloth]) -> Result<(), GarmentError> {
    let stitches = |(panel, &c): (&Panel, &usize)| panel.area / cloths[c].tile.stitch().element_product();
    let all: f64 = panels.iter().zip(cloth).map(stitches).sum();
    if all <= MOST_STITCHES {
        return Ok(());
    }
    let stitch = cloths[0].tile.stitch();
    let problem =
        format!("{all:.2e} stitches of {:.4} x {:.4} mm; at most {MOST_STITCHES:.0e} are laid", stitch.x, stitch.y);
    Err(GarmentError::new(problem, "a coarser gauge, or another `gauge_per` or `unit`"))
}

/// A panel that lies askew: the box around it, which is divided, is far larger than it.
pub(super) fn upright(
    panels: &[Panel],
    borders: &[Vec<BorderEdge>],
    cloth: &[usize],
    cloths: &[Cloth],
) -> Result<(), GarmentError> {
    for ((panel, border), &c) in panels.iter().zip(borders).zip(cloth) {
        let [low, high] = bounds(border);
        let places = ((high - low).max(DVec2::ZERO) / cloths[c].tile.stitch()).element_product();
        if places > 4.0 * MOST_STITCHES {
            let problem = format!(
                "panel `{}` lies askew in the texture coordinates: the rows and wales of the box around it hold {places:.1e} stitches",
                panel.group
            );
            return Err(GarmentError::at(panel.line, problem, "turn it upright, or its wales with `grain`, or cut it"));
        }
    }
    Ok(())
}

/// A garment without a single stitch.
pub(super) fn has_room(lattices: &[Lattice], options: &Options) -> Result<(), GarmentError> {
    if lattices.iter().any(|l| l.stitches > 0) {
        return Ok(());
    }
    if let Some((at, radius)) = options.near {
        let problem = format!("no stitch lies within {radius:.3} mm of {at:.3} mm");
        return Err(GarmentError::new(problem, "a place on the cloth in its first frame, or a larger radius"));
    }
    let stitch = options.cloths[0].tile.stitch();
    let problem = format!("no panel has room for a stitch of {:.3} x {:.3} mm", stitch.x, stitch.y);
    Err(GarmentError::new(problem, "a finer gauge, another `unit`, or is the mesh cut short?"))
}

/// A panel that lies over itself.
pub(super) fn flat(lattices: &[Lattice], panels: &[Panel]) -> Result<(), GarmentError> {
    for (lattice, panel) in lattices.iter().zip(panels) {
        if lattice.doubled * 100 > lattice.stitches as usize {
            let problem = format!(
                "panel `{}` overlaps itself in the texture coordinates: {} of {} stitches have two places",
                panel.group, lattice.doubled, lattice.stitches
            );
            return Err(GarmentError::at(panel.line, problem, "lay the panel out flat, without overlaps"));
        }
    }
    Ok(())
}
