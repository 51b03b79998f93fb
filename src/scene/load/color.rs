//! Colour work of a fabric: yarns by row, by column or by a motif, a picture that tints them, and variation from yarn
//! to yarn.
//!
//! All of it is decided here, once, for every place of a control point and some between them: a render only looks up which variant of the yarn a
//! segment is of, and not even that in a fabric of one colour.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

use glam::{Vec2, Vec3};

use super::{
    super::{CurveKind, Fabric, Yarn},
    Context, Range, Reader,
    dyes::Dyes,
    radians,
    tint::{Print, Tint, tint},
    yarns::Library,
};
use crate::{
    geometry::{
        curve::Curve,
        garment::Tension,
        pattern::{PatternStrand, StrandKind},
    },
    image,
    input::diagnostic::Span,
    math::{
        sampler::{Stream, hash2},
        srgb::srgb_to_linear,
        warp::normal,
    },
};

/// Levels of each channel of a tint, even in its square root; what lies between is dithered from point to point.
const LEVELS: f32 = 31.0;
/// Shades that variation draws yarns from.
const SHADES: u32 = 256;

/// The colour of each stitch by rows, from 0, and the yarn in the library that each colour is.
pub(super) type StitchColors = (Vec<Vec<u16>>, Vec<usize>);

/// Where each control point of a fabric lies in its own grid.
pub(super) struct FabricCoordinates {
    /// Wale and course, warp and weft, or the place along a yarn and the yarn's number; none where the latter holds for
    /// every curve.
    points: Vec<Vec<[f32; 2]>>,
    /// What each curve is in its cloth; none where nothing is known.
    kinds: Vec<StrandKind>,
    /// Columns and rows.
    extent: [f32; 2],
    /// Width and height of a stitch, mm, where that is known.
    stitch: Option<[f32; 2]>,
    /// The yarn of each curve in the library, where each is of one colour; else empty.
    own: Vec<usize>,
}

impl FabricCoordinates {
    /// That of curves of which nothing is known: `columns` along each, and one row each.
    pub(super) fn along(columns: f32, fabric: &Fabric) -> Self {
        let extent = [columns, fabric.curves.len() as f32];
        Self { points: Vec::new(), kinds: Vec::new(), extent, stitch: None, own: Vec::new() }
    }

    /// That of cloth that the program makes, and its curves.
    pub(super) fn of(strands: Vec<PatternStrand>, extent: [u32; 2]) -> (Vec<Curve>, Self) {
        let extent = extent.map(|n| n as f32);
        let mut grid = Self { points: Vec::new(), kinds: Vec::new(), extent, stitch: None, own: Vec::new() };
        let curves = strands.into_iter().map(PatternStrand::smooth).map(|strand| {
            grid.points.push(strand.coordinates);
            grid.kinds.push(strand.kind);
            strand.curve
        });
        (curves.collect(), grid)
    }

    /// That of yarns laid on a garment, by stitches and rows from the corner of each panel; a stitch is so wide and high, mm.
    pub(super) fn laid(points: Vec<Vec<[f32; 2]>>, kinds: Vec<StrandKind>, stitch: [f32; 2]) -> Self {
        let most = |k: usize| points.iter().flatten().map(|c| c[k]).fold(1.0, f32::max).ceil();
        let extent = [most(0), most(1)];
        Self { points, kinds, extent, stitch: Some(stitch), own: Vec::new() }
    }

    /// The same of curves each of which is of one yarn of the library.
    pub(super) fn with_yarns(mut self, own: Vec<usize>) -> Self {
        self.own = own;
        self
    }

    /// Of the curves of both, this one's first.
    pub(super) fn join(&mut self, other: Self) {
        self.points.extend(other.points);
        self.kinds.extend(other.kinds);
    }

    fn at(&self, curve: usize, point: usize, count: usize) -> [f32; 2] {
        match self.points.get(curve).and_then(|p| p.get(point)) {
            Some(at) => *at,
            None => [point as f32 / (count.max(2) - 1) as f32 * self.extent[0] * 0.999_99, curve as f32 + 0.5],
        }
    }

    /// Texture coordinates of each control point: columns and rows as shares of the fabric's, as a tint sees them.
    pub(super) fn uvs(&self, fabric: &Fabric) -> Vec<Vec<Vec2>> {
        let of_curve = |(i, (curve, _)): (usize, &(Curve, Vec<f64>))| {
            let count = curve.points.len();
            (0..count).map(|point| Vec2::from(self.at(i, point, count)) / Vec2::from(self.extent)).collect()
        };
        fabric.curves.iter().enumerate().map(of_curve).collect()
    }

    /// At the place `place` of `steps` from each control point to the next.
    fn between(&self, curve: usize, place: usize, steps: usize, count: usize) -> [f32; 2] {
        let (point, share) = ((place / steps).min(count - 1), (place % steps) as f32 / steps as f32);
        let (a, b) = (self.at(curve, point, count), self.at(curve, (point + 1).min(count - 1), count));
        // Where a round begins anew, its coordinates jump.
        if (0..2).any(|k| (b[k] - a[k]).abs() > 0.5 * self.extent[k]) {
            return a;
        }
        [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
    }
}

/// Into how many steps the way from one control point to the next is divided: about as long as the yarn is thick.
fn steps(curve: &Curve, radii: &[f64]) -> usize {
    let thickness = 2.0 * radii.iter().sum::<f64>() / radii.len().max(1) as f64;
    let length = curve.polygon_length() / curve.points.len().max(2) as f64;
    ((length / thickness).ceil() as usize).clamp(1, 1024)
}

/// A picture of cells, each of which names a yarn.
struct Motif {
    cells: Cells,
    /// What stands for which yarn.
    key: Vec<(String, String)>,
    /// Of an image: drawn once over the whole fabric, not a pixel for each stitch.
    stretched: bool,
    offset: [i64; 2],
    /// Where its lower left corner is from that of a panel, mm, in place of the offset.
    place: Option<[f64; 2]>,
    /// Whether it begins anew across and up.
    again: [bool; 2],
    span: Span,
}

enum Cells {
    /// Rows of signs, the top one first.
    Text(Vec<String>),
    Image(PathBuf),
}

/// Which yarn is where.
#[derive(Default)]
struct Layout {
    /// From the bottom; of a weave its wefts.
    rows: Vec<String>,
    /// From the left; of a weave its warps.
    columns: Vec<String>,
    motif: Option<Motif>,
}

/// How much yarns differ; standard deviations.
#[derive(Clone, Copy)]
struct Variation {
    seed: u32,
    /// Of the radius, relative.
    radius: f64,
    /// Of the phase, radians.
    phase: f64,
    /// Of the colour, relative.
    color: f64,
    /// Of the size of loops, on garments.
    tension: f64,
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
        if !library.yarn_names.iter().any(|n| n == name) {
            context.unknown(span, "yarn", name, library.yarn_names.iter().map(String::as_str));
        }
    };
    let names = |key: &str| -> Vec<String> {
        let names = table.strings(key);
        names.iter().for_each(|(name, span)| known(name, *span));
        if names.is_empty() && table.has(key) {
            table.error_at(key, format!("`{key}` names no yarn"), None);
        }
        names.into_iter().map(|(name, _)| name.to_owned()).collect()
    };
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

const SAME_BUILD: &str = "yarns that take turns within a fabric differ in their fibres only";

/// Why a yarn cannot take turns with another.
fn other_build(yarn: &Yarn, base: &Yarn) -> Option<String> {
    (yarn.plies.len() != base.plies.len() || yarn.ply_twist != base.ply_twist)
        .then(|| format!("yarn \"{}\" has other plies or another ply_twist than \"{}\"", yarn.name, base.name))
}

fn motif(table: Reader<'_>, context: &Context<'_>, known: &dyn Fn(&str, Span)) -> Option<Motif> {
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
pub(super) fn hex(text: &str) -> Option<[f32; 3]> {
    let digits = text.strip_prefix('#').filter(|d| d.len() == 6 && d.is_ascii())?;
    let channel = |i: usize| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).ok().map(|v| f32::from(v) / 255.0);
    Some([channel(0)?, channel(1)?, channel(2)?])
}

/// Which of a list of yarns each cell of a grid is.
struct CellMap {
    width: usize,
    height: usize,
    /// Rows from the bottom.
    cells: Vec<usize>,
    offset: [i64; 2],
    /// Whether it begins anew across and up, and what is where it does not.
    again: [bool; 2],
    ground: usize,
}

impl CellMap {
    fn at(&self, x: f32, y: f32) -> usize {
        let place = |v: f32, offset: i64| v.floor() as i64 - offset;
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
    fn placed(
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

    fn cells(&self, extent: [f32; 2], yarns: &[usize], ground: usize) -> Result<CellMap, String> {
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

    /// Whether all stitches are of the fabric's own yarn.
    pub(super) fn is_plain(&self) -> bool {
        let Layout { rows, columns, motif } = &self.layout;
        rows.is_empty() && columns.is_empty() && motif.is_none()
    }

    /// Which yarn knits each stitch of a knit, by rows of so many stitches, and the yarns in the library.
    pub(super) fn stitches(
        &self,
        widths: &[u32],
        base: usize,
        context: &Context<'_>,
        library: &Library,
    ) -> Option<StitchColors> {
        let widest = widths.iter().copied().max().unwrap_or(1);
        let cells = self.cells([widest as f32, widths.len() as f32], None, false, base, context, library)?;
        let map = cells.of_rows();
        let at = |(row, width): (usize, &u32)| -> Vec<usize> {
            (0..*width).map(|column| map.at(column as f32 + 0.5, row as f32 + 0.5)).collect()
        };
        let yarns: Vec<Vec<usize>> = widths.iter().enumerate().map(at).collect();
        // The yarn of most stitches is the first one.
        let mut counts: Vec<(usize, usize)> = Vec::new();
        for &yarn in yarns.iter().flatten() {
            match counts.iter_mut().find(|c| c.1 == yarn) {
                Some(count) => count.0 += 1,
                None => counts.push((1, yarn)),
            }
        }
        counts.sort_by_key(|&(count, yarn)| (std::cmp::Reverse(count), yarn));
        let order: Vec<usize> = counts.into_iter().map(|c| c.1).collect();
        let color = |yarn: &usize| order.iter().position(|y| y == yarn).unwrap_or(0) as u16;
        Some((yarns.iter().map(|row| row.iter().map(color).collect()).collect(), order))
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
            let asked = (0..fabric.curves.len()).any(|curve| std::ptr::eq(cells.of(curve, &coordinates), map));
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
        let painter = Painter { coordinates: &coordinates, cells: &cells, dyes, print, shades, yarns: &yarns };
        let mut variants = Variants::default();
        let curves = fabric.curves.iter().enumerate();
        let material_indices =
            curves.map(|(index, (curve, radii))| painter.paint(index, curve, radii, &mut variants)).collect();
        if variants.made.len() > usize::from(u16::MAX) {
            let hint = "fewer yarns, or a picture of fewer colours";
            context.error(self.header, "more than 65535 kinds and colours of yarn", Some(hint.to_owned()));
            return None;
        }
        fabric.variants = variants.made;
        fabric.material_indices = material_indices;
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
                let yarns: Vec<usize> = motif.key.iter().map(|(_, name)| index_of(name)).collect();
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

/// Which yarn lies in each cell of a fabric.
struct LaidCells {
    by_row: CellMap,
    by_column: CellMap,
    /// In place of both, if there is one.
    motif: Option<CellMap>,
    /// Whether strands that are neither warp nor weft follow the columns.
    by_columns: bool,
}

impl LaidCells {
    fn maps(&self) -> impl Iterator<Item = &CellMap> {
        [&self.by_row, &self.by_column].into_iter().chain(&self.motif)
    }

    /// Those of the stitches of a knit.
    fn of_rows(&self) -> &CellMap {
        match &self.motif {
            Some(motif) => motif,
            None if self.by_columns => &self.by_column,
            None => &self.by_row,
        }
    }

    /// The cells that a curve of the fabric runs through.
    fn of(&self, curve: usize, coordinates: &FabricCoordinates) -> &CellMap {
        match (&self.motif, coordinates.kinds.get(curve)) {
            (Some(motif), _) => motif,
            // A weft keeps its colour all along, and so does a warp.
            (None, Some(StrandKind::Warp)) => &self.by_column,
            (None, Some(StrandKind::Weft)) => &self.by_row,
            (None, _) => self.of_rows(),
        }
    }
}

/// Decides the colour at every place of a fabric's curves.
struct Painter<'a> {
    coordinates: &'a FabricCoordinates,
    cells: &'a LaidCells,
    /// Colours that came with the curves.
    dyes: Option<&'a Dyes>,
    /// A picture over the cloth.
    print: Option<Print>,
    /// How yarns differ in colour, if they do.
    shades: Option<Variation>,
    yarns: &'a [&'a Yarn],
}

impl Painter<'_> {
    /// The material index at each place along a curve; variants are made as they are met.
    fn paint(&self, index: usize, curve: &Curve, radii: &[f64], variants: &mut Variants) -> Vec<u16> {
        let shade = self.shades.map(|v| hash2(v.seed, index as u32 ^ 0x51ed_270b) % SHADES);
        let shine = self.shades.zip(shade).map_or(1.0, |(v, shade)| shine(v, shade));
        let cells = self.cells.of(index, self.coordinates);
        let own = self.coordinates.own.get(index).copied();
        let count = curve.points.len();
        let steps = steps(curve, radii);
        let places = if curve.closed { count * steps } else { (count - 1) * steps + 1 };
        let material_at = |place: usize| {
            let [x, y] = self.coordinates.between(index, place, steps, count);
            let yarn = own.unwrap_or_else(|| cells.at(x, y));
            let kind = self.coordinates.kinds.get(index).copied();
            let dye = self.dyes.and_then(|d| d.at(index, kind, [x, y]));
            let dyed = self.dyes.map_or(Vec3::ONE, |d| d.color(dye));
            let (key, color) = match &self.print {
                None => (Key { yarn, shade, dye, levels: [0; 3] }, dyed * shine),
                Some(print) => {
                    let next = self.coordinates.between(index, place + 1, steps, count);
                    let mut stream = Stream::new(hash2(index as u32, place as u32));
                    let levels = print
                        .color([x, y], next)
                        .map(|v| (LEVELS * (shine * v).clamp(0.0, 1.0).sqrt() + stream.next()).min(LEVELS) as u8);
                    let color = levels.map(|l| (f32::from(l) / LEVELS).powi(2));
                    (Key { yarn, shade: None, dye, levels }, dyed * Vec3::from(color))
                }
            };
            variants.material_index(key, || self.yarns[key.yarn].dyed(color.to_array().map(f64::from)))
        };
        (0..places).map(material_at).collect()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Key {
    yarn: usize,
    shade: Option<u32>,
    dye: Option<u32>,
    levels: [u8; 3],
}

/// Yarns as they are asked for, each made once.
#[derive(Default)]
struct Variants {
    made: Vec<Yarn>,
    places: HashMap<Key, u16>,
}

impl Variants {
    fn material_index(&mut self, key: Key, make: impl FnOnce() -> Yarn) -> u16 {
        *self.places.entry(key).or_insert_with(|| {
            self.made.push(make());
            // Too many are told as an error before anyone looks.
            u16::try_from(self.made.len() - 1).unwrap_or(u16::MAX)
        })
    }
}

/// The brightness of a shade, mean 1.
fn shine(variation: Variation, shade: u32) -> f32 {
    let z = normal((shade as f32 + 0.5) / SHADES as f32);
    (1.0 + variation.color as f32 * z).max(0.0)
}

impl Variation {
    fn apply(self, fabric: &mut Fabric) {
        let count = fabric.curves.len();
        let deviate = |index: usize, what: u32| {
            f64::from(normal(Stream::new(hash2(hash2(self.seed, index as u32), what)).next()))
        };
        if self.radius > 0.0 {
            for (index, (_, radii)) in fabric.curves.iter_mut().enumerate() {
                // Never thinner than a fifth, however wide the spread.
                let factor = (1.0 + self.radius * deviate(index, 1)).max(0.2);
                radii.iter_mut().for_each(|r| *r *= factor);
            }
        }
        if self.phase > 0.0 && !fabric.phases.is_empty() {
            let given = std::mem::take(&mut fabric.phases);
            fabric.phases = (0..count).map(|i| given[i % given.len()] + self.phase * deviate(i, 2)).collect();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::diagnostic::{SourceId, Sources};

    fn span() -> Span {
        let id: SourceId = Sources::new().add_file("s.toml", "");
        Span::whole(id)
    }

    fn motif(cells: Cells, key: [&str; 2], stretched: bool) -> Motif {
        let key = key.map(|k| (k.to_owned(), String::new())).to_vec();
        Motif { cells, key, stretched, offset: [0; 2], place: None, again: [true; 2], span: span() }
    }

    /// The cells of a map as they are seen, the top row first.
    fn drawn(map: &CellMap, width: usize, height: usize) -> Vec<String> {
        let sign = |x: usize, y: usize| ['.', '#'][map.at(x as f32 + 0.5, y as f32 + 0.5)];
        (0..height).rev().map(|y| (0..width).map(|x| sign(x, y)).collect()).collect()
    }

    const LETTER: [&str; 5] = ["####", "#...", "###.", "#...", "#..."];

    #[test]
    fn a_motif_stands_upright_and_repeats() {
        let rows = LETTER.map(str::to_owned).to_vec();
        let mut letter = motif(Cells::Text(rows), [".", "#"], false);
        let map = letter.cells([8.0, 5.0], &[0, 1], 0).unwrap();
        assert_eq!(drawn(&map, 4, 5), LETTER);
        assert_eq!(drawn(&map, 8, 1), ["#...#..."]);
        letter.offset = [1, 0];
        let map = letter.cells([8.0, 5.0], &[0, 1], 0).unwrap();
        assert_eq!(drawn(&map, 4, 1), [".#.."]);
        // The same in millimetres, of stitches of 4 x 3.
        letter.place = Some([4.5, -0.5]);
        let map = letter.placed([8.0, 5.0], Some([4.0, 3.0]), &[0, 1], 0).unwrap();
        assert_eq!(drawn(&map, 4, 1), [".#.."]);
        assert!(letter.placed([8.0, 5.0], None, &[0, 1], 0).is_err_and(|problem| problem.contains("`offset`")));
    }

    #[test]
    fn an_image_stands_upright_and_is_averaged_where_it_is_finer_than_the_stitches() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("letter.png");
        let (w, h) = (4u32, 5u32);
        let mut encoder = png::Encoder::new(std::fs::File::create(&path).unwrap(), 3 * w, 3 * h);
        encoder.set_color(png::ColorType::Rgb);
        let mut bytes = Vec::new();
        for y in 0..3 * h {
            for x in 0..3 * w {
                let red = LETTER[(y / 3) as usize].as_bytes()[(x / 3) as usize] == b'#';
                // A stray pixel in the middle of each cell must not matter.
                let red = red != (x % 3 == 1 && y % 3 == 1);
                bytes.extend(if red { [190, 30, 30] } else { [250, 250, 240] });
            }
        }
        encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
        let stretched = motif(Cells::Image(path.clone()), ["#ffffff", "#c02020"], true);
        let map = stretched.cells([4.0, 5.0], &[0, 1], 0).unwrap();
        assert_eq!(drawn(&map, 4, 5), LETTER);
        let pixels = motif(Cells::Image(path), ["#ffffff", "#c02020"], false);
        let map = pixels.cells([4.0, 5.0], &[0, 1], 0).unwrap();
        assert_eq!(drawn(&map, 12, 15)[0], "#.##.##.##.#".replace('.', "#"));
        assert_eq!(drawn(&map, 12, 15)[1], "#.##.##.##.#");
        let absent = motif(Cells::Image(folder.path().join("no.png")), ["#ffffff", "#000000"], true);
        assert!(absent.cells([4.0, 5.0], &[0, 1], 0).is_err());
    }

    #[test]
    fn colours_are_read_as_they_are_written() {
        assert_eq!(hex("#ff0080"), Some([1.0, 0.0, 128.0 / 255.0]));
        assert!(["ff0080", "#ff008", "#ff00zz", "#ffé08"].into_iter().all(|t| hex(t).is_none()));
    }

    #[test]
    fn shades_have_the_spread_that_is_asked_for() {
        let variation = Variation { seed: 1, radius: 0.0, phase: 0.0, color: 0.1, tension: 0.0 };
        let all: Vec<f64> = (0..SHADES).map(|s| f64::from(shine(variation, s))).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let deviation = (all.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / all.len() as f64).sqrt();
        assert!((mean - 1.0).abs() < 1e-3 && (deviation - 0.1).abs() < 2e-3, "{mean} {deviation}");
    }
}
