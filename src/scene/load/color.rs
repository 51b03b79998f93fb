//! Colour work of a fabric: yarns by row, by column or by a motif, a picture that tints them, and variation from yarn
//! to yarn.
//!
//! All of it is decided here, once, for every place of a control point and some between them: a render only looks up which variant of the yarn a
//! segment is of, and not even that in a fabric of one colour.

mod coordinates;
mod motif;
mod painter;
mod variation;

pub(super) use self::coordinates::FabricCoordinates;
use self::{
    motif::{NamedMotif, motif},
    painter::{LaidCells, Painter},
    variation::Variation,
};
use super::{
    super::{CurveKind, Fabric, Yarn, motif::CellMap},
    Context, Range, Reader,
    dyes::Dyes,
    radians,
    tint::{Tint, tint},
    yarns::Library,
};
use crate::{garment::Tension, input::diagnostic::Span, pattern::StrandKind};

/// The colour of each stitch by rows, from 0, and the yarn in the library that each colour is.
pub(super) type StitchColors = (Vec<Vec<u16>>, Vec<usize>);

/// The colour of a stitch by its column and row, from 0, and the yarn in the library that each colour is.
pub(super) type LaidColors = (Box<dyn Fn(usize, usize) -> u16 + Send + Sync>, Vec<usize>);

/// Which yarn is where.
#[derive(Default)]
struct Layout {
    /// From the bottom; of a weave its wefts.
    rows: Vec<String>,
    /// From the left; of a weave its warps.
    columns: Vec<String>,
    motif: Option<NamedMotif>,
}

/// The colour work of a fabric as it is written.
pub(super) struct ColorPlan {
    layout: Layout,
    tint: Option<Tint>,
    variation: Option<Variation>,
    header: Span,
}

/// Reads `rows`, `columns`, `motif`, `tint` and `vary` of a fabric.
pub(super) fn plan(table: &Reader<'_>, context: &Context<'_>, library: &Library) -> ColorPlan {
    for other in ["rows", "columns"] {
        if table.has(other) && table.has("motif") {
            table.error_at("motif", format!("give `{other}` or `motif`, not both"), None);
        }
    }
    let known = |name: &str, span: Span| {
        context.check_yarn(span, name, library);
    };
    let names = |key: &str| in_turns(table, key, context, &known);
    let layout = Layout {
        rows: names("rows"),
        columns: names("columns"),
        motif: table.table("motif").and_then(|t| motif(t, context, &known)),
    };
    let tint = table.table("tint").and_then(|table| tint(table, context));
    let variation = table.table("vary").map(|vary| {
        let seed = vary.u64_or("seed", 0, 0..=u64::from(u32::MAX)) as u32;
        let radius = vary.f64_or("radius", 0.0, Range::between(0.0, 0.5));
        let phase = radians(vary.f64_or("phase", 0.0, Range::between(0.0, 360.0)));
        let color = vary.f64_or("color", 0.0, Range::between(0.0, 1.0));
        let tension = vary.f64_or("tension", 0.0, Range::between(0.0, 0.2));
        vary.finish();
        Variation { seed, radius, phase, color, tension }
    });
    ColorPlan { layout, tint, variation, header: table.header() }
}

/// The yarns under a key: `"navy"`, or `"4 navy"` for four of them. `known` tells of names that no yarn has.
pub(super) fn in_turns(
    table: &Reader<'_>,
    key: &str,
    context: &Context<'_>,
    known: &dyn Fn(&str, Span),
) -> Vec<String> {
    let entries = table.strings(key);
    if entries.is_empty() && table.has(key) {
        table.error_at(key, format!("`{key}` names no yarn"), None);
    }
    let mut names = Vec::new();
    for (entry, span) in entries {
        let (count, name) = turn(entry);
        known(name, span);
        match count {
            Some(count) => names.extend(std::iter::repeat_n(name.to_owned(), count)),
            None => context.error(span, format!("expected 1 to {MOST_IN_TURN} of a yarn in turn"), None),
        }
    }
    names
}

/// The most of one yarn that an entry stands for.
const MOST_IN_TURN: usize = 10_000;

/// How many of which yarn `"4 navy"` is; one of what has no count, `None` of what may not be counted so.
pub(super) fn turn(entry: &str) -> (Option<usize>, &str) {
    let is_count = |text: &&str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    match entry.split_once(' ').filter(|(count, _)| is_count(count)) {
        Some((count, name)) => (count.parse().ok().filter(|n| (1..=MOST_IN_TURN).contains(n)), name.trim()),
        None => (Some(1), entry),
    }
}

const SAME_BUILD: &str = "yarns that take turns within a fabric differ in their fibres only";

/// Why a yarn cannot take turns with another.
fn other_build(yarn: &Yarn, base: &Yarn) -> Option<String> {
    (yarn.plies.len() != base.plies.len() || yarn.ply_twist != base.ply_twist)
        .then(|| format!("yarn \"{}\" has other plies or another ply_twist than \"{}\"", yarn.name, base.name))
}

impl ColorPlan {
    /// How loops of a garment vary, if they do.
    pub(super) fn tension(&self) -> Option<Tension> {
        self.variation.filter(|v| v.tension > 0.0).map(|v| Tension { seed: v.seed, spread: v.tension })
    }

    /// Whether colours depend on places in the cloth.
    pub(super) fn needs_places(&self) -> bool {
        let Layout { rows, columns, motif } = &self.layout;
        !rows.is_empty() || !columns.is_empty() || motif.is_some() || self.tint.is_some()
    }

    /// Takes the yarns of warps and of wefts from the weave itself.
    pub(super) fn take_order(&mut self, table: &Reader<'_>, [warps, wefts]: &[Vec<String>; 2]) {
        let sides = [
            ("columns", "warp_order", &mut self.layout.columns, warps),
            ("rows", "weft_order", &mut self.layout.rows, wefts),
        ];
        for (key, own, list, order) in sides {
            if order.is_empty() {
                continue;
            }
            if !list.is_empty() || self.layout.motif.is_some() {
                let other = if list.is_empty() { "motif" } else { key };
                table.error_at(other, format!("give `{other}` or `{own}`, not both"), None);
            }
            list.clone_from(order);
        }
    }

    /// The yarns of the rows, which are the wefts of a weave, in turns, if they differ.
    pub(super) fn rows(&self) -> &[String] {
        if self.layout.motif.is_some() { &[] } else { &self.layout.rows }
    }

    /// Whether all stitches are of the fabric's own yarn.
    pub(super) fn is_plain(&self) -> bool {
        let Layout { rows, columns, motif } = &self.layout;
        rows.is_empty() && columns.is_empty() && motif.is_none()
    }

    /// Which yarn knits each stitch of a knit, by rows of so many stitches that may go round, and the yarns in the library.
    pub(super) fn stitches(
        &self,
        (widths, round): (&[u32], bool),
        base: usize,
        context: &Context<'_>,
        library: &Library,
    ) -> Option<StitchColors> {
        let widest = widths.iter().copied().max().unwrap_or(1);
        let cells = self.cells([widest as f32, widths.len() as f32], None, false, base, context, library)?;
        if round
            && let Some(motif) = &self.layout.motif
            && let Some(problem) = cells.of_rows().breaks_in_rounds(widths)
        {
            context.warning_once(motif.span, problem);
        }
        Some(cells.of_rows().colors(widths))
    }

    /// Which colour each stitch of a knit on a garment has, by columns and rows from a panel's corner, and the yarns in the
    /// library that the colours are: the fabric's own is the first.
    pub(super) fn laid(
        &self,
        extent: [f32; 2],
        stitch: [f32; 2],
        base: usize,
        context: &Context<'_>,
        library: &Library,
    ) -> Option<LaidColors> {
        let mut map = self.cells(extent, Some(stitch), false, base, context, library)?.into_rows();
        let mut yarns = vec![base];
        for cell in &mut map.cells {
            let color = yarns.iter().position(|y| y == cell).unwrap_or_else(|| {
                yarns.push(*cell);
                yarns.len() - 1
            });
            *cell = color;
        }
        map.ground = 0;
        let color = move |column: usize, row: usize| map.at(column as f32 + 0.5, row as f32 + 0.5) as u16;
        Some((Box::new(color), yarns))
    }

    /// Gives a fabric its variants and what varies. `coordinates` are asked for only if something depends on them; `dyes`
    /// are used where the scene does not say which yarn lies where.
    pub(super) fn apply(
        &self,
        fabric: &mut Fabric,
        dyes: Option<&Dyes>,
        coordinates: impl FnOnce(&Fabric) -> FabricCoordinates,
        context: &Context<'_>,
        library: &Library,
    ) -> Option<()> {
        if let Some(variation) = self.variation {
            variation.apply(fabric);
        }
        let shades = self.variation.filter(|v| v.color > 0.0);
        let dyes = dyes.filter(|_| self.is_plain());
        if self.is_plain() && self.tint.is_none() && shades.is_none() && dyes.is_none() {
            return Some(());
        }
        let CurveKind::Yarn(base) = fabric.kind else {
            context.error(self.header, "colours of single fibres are those of their [fiber] table", None);
            return None;
        };
        let coordinates = coordinates(fabric);
        let yarns: Vec<&Yarn> = library.yarns.values().collect();
        let woven = coordinates.kinds.iter().any(|kind| *kind != StrandKind::Course);
        let cells = self.cells(coordinates.extent, coordinates.stitch, woven, base, context, library)?;
        for map in cells.maps() {
            let asked = (0..fabric.curves.len().max(coordinates.kinds.len()))
                .any(|curve| std::ptr::eq(cells.of(curve, &coordinates), map));
            let wrong = map.cells.iter().find_map(|&yarn| other_build(yarns[yarn], yarns[base]));
            if let Some(problem) = wrong.filter(|_| asked) {
                context.error(self.header, problem, Some(SAME_BUILD.to_owned()));
                return None;
            }
        }
        let print = match &self.tint {
            None => None,
            Some(tint) => Some(tint.open(coordinates.extent, coordinates.stitch, context)?),
        };
        if fabric.curves.is_empty() {
            // Of cloth that is not laid, what may lie on it.
            let mut known: Vec<usize> = cells.maps().flat_map(|map| map.cells.iter().copied()).collect();
            known.sort_unstable();
            known.dedup();
            fabric.variants = known.into_iter().map(|yarn| yarns[yarn].clone()).collect();
            return Some(());
        }
        let printed = print.is_some();
        let painter = Painter { coordinates: &coordinates, cells: &cells, dyes, print, shades, yarns: &yarns };
        let (variants, material_indices) = painter.paint(&fabric.curves);
        if variants.len() > usize::from(u16::MAX) {
            let hint = "fewer yarns, or a picture of fewer colours";
            context.error(self.header, "more than 65535 kinds and colours of yarn", Some(hint.to_owned()));
            return None;
        }
        fabric.variants = variants;
        (fabric.material_indices, fabric.printed) = (material_indices, printed);
        Some(())
    }

    /// Which yarn lies where, as the layout says; `base` where it does not.
    fn cells(
        &self,
        extent: [f32; 2],
        stitch: Option<[f32; 2]>,
        woven: bool,
        base: usize,
        context: &Context<'_>,
        library: &Library,
    ) -> Option<LaidCells> {
        let Layout { rows, columns, motif } = &self.layout;
        if !rows.is_empty() && !columns.is_empty() && !woven {
            let hint = "in a weave they are the yarns of wefts and of warps; elsewhere a `motif` says both";
            context.error(self.header, "both `rows` and `columns` are given", Some(hint.to_owned()));
            return None;
        }
        let index_of = |name: &String| library.yarns.keys().position(|n| n == name).unwrap_or(base);
        let list = |names: &[String], across: bool| {
            let cells: Vec<usize> = if names.is_empty() { vec![base] } else { names.iter().map(index_of).collect() };
            let (width, height) = if across { (cells.len(), 1) } else { (1, cells.len()) };
            CellMap { width, height, cells, offset: [0; 2], again: [true; 2], ground: base }
        };
        let motif = match motif {
            None => None,
            Some(motif) => {
                let yarns: Vec<usize> = motif.names.iter().map(index_of).collect();
                match motif.placed(extent, stitch, &yarns, base) {
                    Ok(cells) => Some(cells),
                    Err(problem) => {
                        context.error(motif.span, problem, None);
                        return None;
                    }
                }
            }
        };
        let by_columns = !columns.is_empty();
        Some(LaidCells { by_row: list(rows, false), by_column: list(columns, true), motif, by_columns })
    }
}

#[cfg(test)]
mod tests;
