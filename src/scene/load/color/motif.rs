//! A motif as scenes have it: its keys, and the names of its yarns.

use super::super::{Context, Range, Reader};
use crate::{
    input::diagnostic::Span,
    scene::motif::{CellMap, Cells, FITS, Motif, REPEATS, WrongRow, wrong_row, wrong_sign},
};

/// A motif, and where it was written.
pub(super) struct NamedMotif {
    pub(super) motif: Motif,
    /// The yarn of each of its signs.
    pub(super) names: Vec<String>,
    /// Where its lower left corner is from that of a panel, mm, in place of the offset.
    pub(super) place: Option<[f64; 2]>,
    pub(super) span: Span,
}

pub(super) fn motif(table: Reader<'_>, context: &Context<'_>, known: &dyn Fn(&str, Span)) -> Option<NamedMotif> {
    let rows = table.strings("rows");
    let image = table.string("image").map(|p| context.resolve(p, table.span("image").unwrap_or(table.header())));
    let stretched = table.one_of_or("fit", false, &FITS);
    let again = table.one_of_or("repeat", [true; 2], &REPEATS);
    let offset = table.vec2("offset", Range::between(-1e6, 1e6)).unwrap_or([0.0; 2]).map(|o| o.round() as i64);
    let place = table.vec2("place", Range::FINITE).map(|p| p.map(|v| v * context.unit));
    if table.has("offset") && table.has("place") {
        table.error_at("offset", "give `offset` or `place`, not both", None);
    }
    let (mut signs, mut names) = (Vec::new(), Vec::new());
    if let Some(yarns) = table.required_table("yarns") {
        if yarns.keys().next().is_none() {
            context.error(yarns.header(), "`yarns` names no yarn", Some("as in \"#c02a1f\" = \"red\"".to_owned()));
            return None;
        }
        for sign in yarns.keys().collect::<Vec<_>>() {
            let span = yarns.span(sign).unwrap_or(yarns.header());
            if let Some(name) = yarns.string(sign) {
                known(name, span);
                signs.push(sign.to_owned());
                names.push(name.to_owned());
            }
            if let Some(problem) = wrong_sign(sign, image.is_some()) {
                let example = if image.is_some() { "#c02a1f" } else { "#" };
                context.error(span, problem, Some(format!("as in \"{example}\" = \"red\"")));
            }
        }
        yarns.finish();
    }
    let span = table.span("image").unwrap_or(table.header());
    let cells = match (image, rows.is_empty()) {
        (Some(_), false) => {
            table.error_at("rows", "give `image` or `rows`, not both", None);
            None
        }
        (Some(path), true) => Some(Cells::Picture(path)),
        (None, false) => {
            let width = rows[0].0.chars().count();
            for (row, span) in &rows {
                match wrong_row(row, width, signs.iter().map(String::as_str)) {
                    Some(WrongRow::Width(problem)) => context.error(*span, problem, None),
                    Some(WrongRow::Sign(problem)) => {
                        let hint = "yarns = { \".\" = \"white\", \"#\" = \"red\" }";
                        context.error(*span, problem, Some(hint.to_owned()));
                    }
                    None => {}
                }
            }
            Some(Cells::Signs(rows.into_iter().map(|(row, _)| row.to_owned()).collect()))
        }
        (None, true) => {
            let hint = Some("rows = [\".#.\", \"###\"]");
            if table.has("rows") {
                table.error_at("rows", "a motif has one row or more", hint);
            } else if !table.has("image") {
                table.error("missing key `rows` or `image` in the motif", hint);
            }
            None
        }
    };
    table.finish();
    Some(NamedMotif { motif: Motif { cells: cells?, signs, stretched, offset, again }, names, place, span })
}

impl NamedMotif {
    /// Its cells where they are drawn; `stitch` is the size of a stitch, mm, where that is known.
    pub(super) fn placed(
        &self,
        extent: [f32; 2],
        stitch: Option<[f32; 2]>,
        yarns: &[usize],
        ground: usize,
    ) -> Result<CellMap, String> {
        let mut map = self.motif.cells(extent, yarns, ground)?;
        if let Some(place) = self.place {
            let stitch = stitch
                .ok_or("`place` needs the panels of a garment, whose stitches have a size; elsewhere `offset`")?;
            map.offset = [0, 1].map(|k| (place[k] / f64::from(stitch[k])).round() as i64);
        }
        Ok(map)
    }
}
