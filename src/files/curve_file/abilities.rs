//! What the formats that are written can hold.

use std::path::Path;

#[cfg(feature = "usd")]
use super::layer;
use super::{Format, bcc, hair, written_as};
use crate::geometry::curve::Basis;

/// What a format can say of curves.
#[derive(Clone, Copy)]
pub(crate) struct Abilities {
    pub(crate) radii: bool,
    /// Whether radii change along a curve.
    pub(crate) varying: bool,
    /// Whether it has a unit; such a format needs radii as well.
    pub(crate) unit: bool,
    pub(crate) colors: bool,
    pub(crate) ids: bool,
    /// The bases that it tells apart.
    pub(crate) bases: &'static [Basis],
    /// The most control points of a curve, where there is a limit; a closed curve reaches it one point earlier.
    pub(crate) most_points: Option<usize>,
}

/// By the name of a file that [`write()`](super::write) makes; of another one the least.
pub(crate) fn abilities(path: &Path) -> Abilities {
    const ALL: &[Basis] = &[Basis::CatmullRom, Basis::BSpline, Basis::Linear];
    let least =
        Abilities { radii: true, varying: true, unit: false, colors: false, ids: false, bases: &[], most_points: None };
    #[cfg(feature = "usd")]
    if layer::can_write(path) {
        return Abilities { unit: true, colors: true, ids: true, bases: ALL, ..least };
    }
    match written_as(path) {
        Some(Format::Bcc) => Abilities { radii: false, bases: ALL, most_points: Some(bcc::MOST_POINTS), ..least },
        Some(Format::Hair) => Abilities { bases: &[Basis::CatmullRom], most_points: Some(hair::MOST_POINTS), ..least },
        Some(Format::Obj) => Abilities { radii: false, ..least },
        Some(Format::Yarns) => {
            Abilities { varying: false, colors: true, bases: &[Basis::CatmullRom, Basis::BSpline], ..least }
        }
        Some(Format::Pyp | Format::Text) | None => least,
    }
}
