//! What cannot be laid, told before anything is.

use glam::DVec2;

use super::{
    hem::NoRoom,
    lattice::{Ground, Lattice},
    mesh::{GarmentError, Part, panel_in_words},
    options::{Cloth, Options, PanelChoice},
    panels::Panel,
    sewing::Sewing,
    surface::{BorderEdge, bounds},
};
use crate::{files::stage::glob, math::words::counted};

/// More stitches than these are not laid.
const MOST_STITCHES: f64 = 2e7;

/// How panels without a name of their own are chosen.
const BY_NUMBER: &str = "`panel = 1` chooses by number, as `info` counts them";

/// Groups or materials that no part of the mesh has.
pub(super) fn named(parts: &[Part], cloths: &[Cloth]) -> Result<(), GarmentError> {
    for (i, cloth) in cloths.iter().enumerate() {
        let Some(PanelChoice::Named(name)) = &cloth.panels else { continue };
        if parts.iter().any(|part| glob(name, &part.group) || glob(name, &part.material)) {
            continue;
        }
        let all = parts.iter().flat_map(|part| [part.group.as_str(), part.material.as_str()]);
        let mut names: Vec<&str> = all.filter(|name| !name.is_empty()).collect();
        names.sort_unstable();
        names.dedup();
        names.truncate(24);
        let hint = match names.is_empty() {
            true => format!("the mesh has neither groups nor materials; {BY_NUMBER}"),
            false => format!("it has: {}", names.join(", ")),
        };
        let problem = format!("no group or material of the mesh is called \"{name}\"");
        return Err(GarmentError { cloth: Some(i), ..GarmentError::new(problem, hint) });
    }
    Ok(())
}

/// Numbers that no panel has, of so many.
pub(super) fn numbered(panels: usize, cloths: &[Cloth]) -> Result<(), GarmentError> {
    for (i, cloth) in cloths.iter().enumerate() {
        if let Some(PanelChoice::Numbered(number)) = cloth.panels
            && !(1..=panels).contains(&number)
        {
            let problem = format!("there is no panel {number}: the garment has {}", counted(panels as u64, "panel"));
            return Err(GarmentError { cloth: Some(i), ..GarmentError::new(problem, BY_NUMBER) });
        }
    }
    Ok(())
}

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
                "{} lies askew in the texture coordinates: the rows and wales of the box around it hold {places:.1e} stitches",
                panel_in_words(&panel.group)
            );
            return Err(GarmentError::at(panel.line, problem, "turn it upright, or its wales with `grain`, or cut it"));
        }
    }
    Ok(())
}

/// A garment without a single stitch.
pub(super) fn has_room(lattices: &[Lattice], panels: &[Panel], options: &Options) -> Result<(), GarmentError> {
    if lattices.iter().any(|l| l.stitches > 0) {
        return Ok(());
    }
    if let Some((at, radius)) = options.near {
        let problem = format!("no stitch lies within {radius:.3} mm of {at:.3} mm");
        return Err(GarmentError::new(problem, "a place on the cloth in its first frame, or a larger radius"));
    }
    let stitch = options.cloths[0].tile.stitch();
    let largest = panels.iter().map(|p| p.area).fold(0.0, f64::max);
    let problem = format!(
        "no panel has room for a stitch of {:.3} x {:.3} mm: the largest has an area of {largest:.3} mm2",
        stitch.x, stitch.y
    );
    Err(GarmentError::new(problem, "a finer gauge, another `unit`, or is the mesh cut short?"))
}

/// A panel that lies over itself.
pub(super) fn flat(lattices: &[Lattice], panels: &[Panel]) -> Result<(), GarmentError> {
    for (lattice, panel) in lattices.iter().zip(panels) {
        if lattice.doubled * 100 > lattice.stitches as usize {
            let problem = format!(
                "{} overlaps itself in the texture coordinates: {} of {} stitches have two places",
                panel_in_words(&panel.group),
                lattice.doubled,
                lattice.stitches
            );
            return Err(GarmentError::at(panel.line, problem, "lay the panel out flat, without overlaps"));
        }
    }
    Ok(())
}

/// A hem holds so many stitches of the cloth beside its bend.
const LEAST_IN_HEM: f64 = 3.0;
/// No more of a hem's length than this may have no cloth over it, or a hem across: by a seam that slants the panel is narrower.
const BARE: f64 = 0.2;

/// Hems of panels that are sewn all round, or that are too narrow or too wide; `cloth` is that of each panel.
pub(super) fn hems(
    sewing: &Sewing,
    grounds: &[Ground<'_>],
    borders: &[Vec<BorderEdge>],
    (panels, cloth): (&[Panel], &[usize]),
    cloths: &[Cloth],
) -> Result<(), GarmentError> {
    for (i, asked) in cloths.iter().enumerate() {
        let Some(hem) = asked.hem else { continue };
        let mut found = false;
        for panel in (0..panels.len()).filter(|&p| cloth[p] == i) {
            let Ground { finder, hem: Some(line), .. } = &grounds[panel] else { continue };
            let Panel { group, line: at, .. } = &panels[panel];
            found = true;
            let least = 2.0 * line.turnup.fold.begin() + LEAST_IN_HEM * sewing.division(panel).stitch.max_element();
            if hem.width < least {
                let problem =
                    format!("a hem of {:.2} mm is too narrow for the cloth of {}", hem.width, panel_in_words(group));
                return Err(GarmentError::at(*at, problem, format!("`hem_width` of {least:.2} mm or more")));
            }
            let NoRoom { bare, met } = line.without_room(finder, hem.width);
            let why = match (bare > BARE, met > BARE) {
                (true, _) => format!("is wider than {} is high over it", panel_in_words(group)),
                (_, true) => format!("meets the one across {}", panel_in_words(group)),
                _ => continue,
            };
            let problem = format!("a hem of {:.2} mm {why}", hem.width);
            // Rounded down, so that it fits.
            let widest = (10.0 * line.widest(finder, BARE)).floor() / 10.0;
            let instead = "`hem = \"none\"` of that panel";
            let hint = match widest < least {
                true => format!("{instead}: it has no room for a hem"),
                false => format!("`hem_width` of at most {widest:.1} mm, or {instead}"),
            };
            return Err(GarmentError::at(*at, problem, hint));
        }
        if let (false, Some(chosen)) = (found, &asked.panels)
            && asked.hems_itself
        {
            let problem = format!("no edge of the panels \"{chosen}\" is free to be hemmed: all are sewn");
            return Err(GarmentError::new(problem, "leave `hem` out, or name the panels whose edges are free"));
        }
    }
    let hemmed = (0..panels.len()).any(|p| (0..borders[p].len()).any(|edge| sewing.is_hemmed(p, edge)));
    if hemmed || cloths.iter().all(|c| c.hem.is_none()) {
        return Ok(());
    }
    Err(GarmentError::new("no edge of the garment is free to be hemmed: all are sewn", "leave `hem` out"))
}
