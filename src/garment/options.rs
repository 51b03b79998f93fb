//! What is laid on a garment, as it was asked for.

use std::fmt;

use glam::DVec3;

use super::{hem::Hem, lay::Tension, seam::SeamKind};
use crate::pattern::tile::Tile;

/// Which panels a cloth is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum PanelChoice {
    /// Group or material, with `*` and `?`.
    Named(String),
    /// As `info` counts them, from 1.
    Numbered(usize),
}

impl fmt::Display for PanelChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Named(name) => write!(f, "{name}"),
            Self::Numbered(number) => write!(f, "{number}"),
        }
    }
}

/// The cloth of some panels.
#[derive(Clone, Debug)]
pub(crate) struct Cloth {
    /// Which panels; `None` for all that no other cloth takes.
    pub panels: Option<PanelChoice>,
    /// What repeats, mm, at the gauge that it is to have.
    pub tile: Tile,
    /// Angle by which rows are turned against the panel's u axis, radians.
    pub grain: f64,
    /// Control points of a stitch.
    pub points: usize,
    /// How these panels are sewn, if not as all are; of two cloths that say it the later one counts.
    pub seam: Option<SeamKind>,
    /// How free edges of these panels are hemmed, if they are.
    pub hem: Option<Hem>,
    /// Whether that is said of these panels and not of all.
    pub hems_itself: bool,
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
