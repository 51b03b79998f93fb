//! A motif: rows of signs, or an image, whose cells name yarns.

use std::path::{Path, PathBuf};

use glam::Vec3;

use super::super::{Context, Range, Reader};
use crate::{image, input::diagnostic::Span, math::srgb::srgb_to_linear};

/// A picture of cells, each of which names a yarn.
pub(super) struct Motif {
    pub(super) cells: Cells,
    /// What stands for which yarn.
    pub(super) key: Vec<(String, String)>,
    /// Of an image: drawn once over the whole fabric, not a pixel for each stitch.
    pub(super) stretched: bool,
    pub(super) offset: [i64; 2],
    /// Where its lower left corner is from that of a panel, mm, in place of the offset.
    pub(super) place: Option<[f64; 2]>,
    /// Whether it begins anew across and up.
    pub(super) again: [bool; 2],
    pub(super) span: Span,
}

pub(super) enum Cells {
    /// Rows of signs, the top one first.
    Text(Vec<String>),
    Image(PathBuf),
}

pub(super) fn motif(table: Reader<'_>, context: &Context<'_>, known: &dyn Fn(&str, Span)) -> Option<Motif> {
    let rows = table.strings("rows");
    let image = table.string("image").map(|p| context.resolve(p, table.span("image").unwrap_or(table.header())));
    let stretched = table.one_of_or("fit", false, &[("stitch", false), ("fabric", true)]);
    let repeats = [("both", [true; 2]), ("across", [true, false]), ("up", [false, true]), ("none", [false; 2])];
    let again = table.one_of_or("repeat", [true; 2], &repeats);
    let offset = table.vec2("offset", Range::between(-1e6, 1e6)).unwrap_or([0.0; 2]).map(|o| o.round() as i64);
    let place = table.vec2("place", Range::FINITE).map(|p| p.map(|v| v * context.unit));
    if table.has("offset") && table.has("place") {
        table.error_at("offset", "give `offset` or `place`, not both", None);
    }
    let mut key = Vec::new();
    if let Some(yarns) = table.required_table("yarns") {
        if yarns.keys().next().is_none() {
            context.error(yarns.header(), "`yarns` names no yarn", Some("as in \"#c02a1f\" = \"red\"".to_owned()));
            return None;
        }
        for sign in yarns.keys().collect::<Vec<_>>() {
            let span = yarns.span(sign).unwrap_or(yarns.header());
            if let Some(name) = yarns.string(sign) {
                known(name, span);
                key.push((sign.to_owned(), name.to_owned()));
            }
            if image.is_some() && hex(sign).is_none() {
                let message = format!("`{sign}` is no colour");
                context.error(span, message, Some("as in \"#c02a1f\" = \"red\"".to_owned()));
            } else if image.is_none() && sign.chars().count() != 1 {
                let message = format!("`{sign}` is not one sign");
                context.error(span, message, Some("as in \"#\" = \"red\"".to_owned()));
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
        (Some(path), true) => Some(Cells::Image(path)),
        (None, false) => {
            let width = rows[0].0.chars().count();
            for (row, span) in &rows {
                if row.chars().count() != width || width == 0 {
                    context.error(*span, format!("every row of a motif has {width} signs, like the first"), None);
                } else if let Some(sign) = row.chars().find(|c| !key.iter().any(|(s, _)| s.chars().eq([*c]))) {
                    let hint = Some("yarns = { \".\" = \"white\", \"#\" = \"red\" }".to_owned());
                    context.error(*span, format!("`{sign}` stands for no yarn"), hint);
                }
            }
            Some(Cells::Text(rows.into_iter().map(|(row, _)| row.to_owned()).collect()))
        }
        (None, true) => {
            if !table.has("rows") && !table.has("image") {
                table.error("missing key `rows` or `image` in the motif", Some("rows = [\".#.\", \"###\"]"));
            }
            None
        }
    };
    table.finish();
    Some(Motif { cells: cells?, key, stretched, offset, place, again, span })
}

/// `#rrggbb`, as sRGB.
pub(in crate::scene::load) fn hex(text: &str) -> Option<[f32; 3]> {
    let digits = text.strip_prefix('#').filter(|d| d.len() == 6 && d.is_ascii())?;
    let channel = |i: usize| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).ok().map(|v| f32::from(v) / 255.0);
    Some([channel(0)?, channel(1)?, channel(2)?])
}

/// Which of a list of yarns each cell of a grid is.
pub(super) struct CellMap {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Rows from the bottom.
    pub(super) cells: Vec<usize>,
    pub(super) offset: [i64; 2],
    /// Whether it begins anew across and up, and what is where it does not.
    pub(super) again: [bool; 2],
    pub(super) ground: usize,
}

impl CellMap {
    pub(super) fn at(&self, x: f32, y: f32) -> usize {
        let place = |v: f32, offset: i64| (v.floor() as i64).saturating_sub(offset);
        let (x, y) = (place(x, self.offset[0]), place(y, self.offset[1]));
        let (w, h) = (self.width as i64, self.height as i64);
        let outside = |v: i64, n: i64, again: bool| !again && !(0..n).contains(&v);
        if outside(x, w, self.again[0]) || outside(y, h, self.again[1]) {
            return self.ground;
        }
        self.cells[(y.rem_euclid(h) * w + x.rem_euclid(w)) as usize]
    }
}

impl Motif {
    /// Its cells where they are drawn; `stitch` is the size of a stitch, mm, where that is known.
    pub(super) fn placed(
        &self,
        extent: [f32; 2],
        stitch: Option<[f32; 2]>,
        yarns: &[usize],
        ground: usize,
    ) -> Result<CellMap, String> {
        let mut map = self.cells(extent, yarns, ground)?;
        if let Some(place) = self.place {
            let stitch = stitch
                .ok_or("`place` needs the panels of a garment, whose stitches have a size; elsewhere `offset`")?;
            map.offset = [0, 1].map(|k| (place[k] / f64::from(stitch[k])).round() as i64);
        }
        Ok(map)
    }

    pub(super) fn cells(&self, extent: [f32; 2], yarns: &[usize], ground: usize) -> Result<CellMap, String> {
        match &self.cells {
            Cells::Text(rows) => {
                let width = rows[0].chars().count();
                let yarn = |c: char| {
                    let place = self.key.iter().position(|(sign, _)| sign.chars().eq([c]));
                    place.map_or(yarns[0], |p| yarns[p])
                };
                let cells = rows.iter().rev().flat_map(|row| row.chars().map(yarn)).collect();
                Ok(CellMap { width, height: rows.len(), cells, offset: self.offset, again: self.again, ground })
            }
            Cells::Image(path) => self.image(path, extent, yarns, ground),
        }
    }

    /// A cell for each pixel, or for each stitch the mean of the pixels over it; the yarn of the nearest colour.
    fn image(&self, path: &Path, extent: [f32; 2], yarns: &[usize], ground: usize) -> Result<CellMap, String> {
        let picture = image::read(path).map_err(|e| e.to_string())?;
        let [r, g, b] = picture.rgb().ok_or_else(|| format!("{}: no colour channels", path.display()))?;
        let (w, h) = (picture.width, picture.height);
        let (width, height) = if self.stretched {
            (extent[0].ceil().max(1.0) as usize, extent[1].ceil().max(1.0) as usize)
        } else {
            (w, h)
        };
        // Distances are in the square root of light, as eyes nearly see it.
        let seen = |c: [f32; 3]| Vec3::from(c.map(|v| v.max(0.0).sqrt()));
        let colors: Vec<Vec3> =
            self.key.iter().map(|(sign, _)| seen(hex(sign).unwrap_or_default().map(srgb_to_linear))).collect();
        let mut cells = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let span = |i: usize, n: usize, of: usize| {
                    let start = i * of / n;
                    start..((i + 1) * of / n).clamp(start + 1, of)
                };
                // Rows of the picture run from the top.
                let (columns, rows) = (span(x, width, w), span(height - 1 - y, height, h));
                let mut sum = [0f32; 3];
                for i in rows.clone().flat_map(|row| columns.clone().map(move |column| row * w + column)) {
                    sum = [sum[0] + r[i], sum[1] + g[i], sum[2] + b[i]];
                }
                let mean = seen(sum.map(|s| s / (rows.len() * columns.len()) as f32));
                let nearest = (0..colors.len())
                    .min_by(|&i, &j| mean.distance_squared(colors[i]).total_cmp(&mean.distance_squared(colors[j])));
                cells.push(yarns[nearest.unwrap_or(0)]);
            }
        }
        Ok(CellMap { width, height, cells, offset: self.offset, again: self.again, ground })
    }
}
