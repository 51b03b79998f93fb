//! `gauge` and `gauge_per`: how many stitches or threads are in a length.

use glam::DVec2;

use super::{Range, Reader};

/// Millimetres in which the numbers of `gauge` are counted.
pub(super) fn per(table: &Reader<'_>) -> f64 {
    let units = [("10 cm", 100.0), ("cm", 10.0), ("inch", 25.4), ("in", 25.4)];
    table.one_of_or("gauge_per", 100.0, &units)
}

/// The table that has the `gauge` of a source: its own or its fabric's; in both it is told.
pub(super) fn gauged<'r, 'a>(source: &'r Reader<'a>, fabric: Option<&'r Reader<'a>>) -> Option<&'r Reader<'a>> {
    let fabric = fabric.filter(|fabric| fabric.has("gauge"));
    if !source.has("gauge") {
        return fabric;
    }
    if let Some(fabric) = fabric {
        fabric.error_at("gauge", "the source has a `gauge` too", Some("leave one of them out"));
        stitch(fabric, None);
    }
    Some(source)
}

/// Width and height of a stitch from `gauge`, mm.
pub(super) fn stitch(table: &Reader<'_>, outer: Option<f64>) -> Option<DVec2> {
    let own = if table.has("gauge_per") || outer.is_none() { per(table) } else { outer.unwrap_or(100.0) };
    let gauge = table.vec2("gauge", Range::between(1e-3, 1e6))?;
    Some(own / DVec2::from(gauge))
}
