//! Pictures that tint cloth: drawn over all of it, or printed on the panels of a garment.

use std::path::PathBuf;

use super::{Context, Range, Reader};
use crate::{image::texture::Texture, input::diagnostic::Span};

/// A tint as it is written.
pub(super) struct Tint {
    path: PathBuf,
    span: Span,
    laid: Laid,
}

enum Laid {
    /// So often across and up the whole fabric.
    Over([f64; 2]),
    /// Once, so wide and high, mm, its lower left corner so far from that of the panel.
    Printed { size: [f64; 2], place: [f64; 2] },
}

/// Reads `tint = { .. }`.
pub(super) fn tint(table: Reader<'_>, context: &Context<'_>) -> Option<Tint> {
    if !table.has("image") {
        table.error("missing key `image` in the tint", Some("tint = { image = \"pattern.png\" }"));
    }
    let path = table.string("image").map(|p| (p, table.span("image").unwrap_or(table.header())));
    let repeat = table.vec2("repeat", Range::POSITIVE).unwrap_or([1.0; 2]);
    let size = table.vec2("size", Range::POSITIVE);
    let place = table.vec2("place", Range::FINITE).unwrap_or([0.0; 2]);
    if table.has("size") && table.has("repeat") {
        table.error_at("repeat", "give `repeat` or `size`, not both", None);
    }
    if table.has("place") && !table.has("size") {
        table.error_at("place", "`place` says where a print of some `size` is", Some("size = [200, 250]"));
    }
    table.finish();
    let laid = match size {
        Some(size) => Laid::Printed { size: size.map(|v| v * context.unit), place: place.map(|v| v * context.unit) },
        None => Laid::Over(repeat),
    };
    path.map(|(path, span)| Tint { path: context.resolve(path, span), span, laid })
}

impl Tint {
    /// Opens the picture, for cloth of so many columns and rows, whose stitches are so wide and high, mm, if that is known.
    pub(super) fn open(&self, extent: [f32; 2], stitch: Option<[f32; 2]>, context: &Context<'_>) -> Option<Print> {
        let (scale, corner, once) = match (&self.laid, stitch) {
            (Laid::Over(repeat), _) => ([0, 1].map(|k| repeat[k] as f32 / extent[k]), [0.0; 2], false),
            (Laid::Printed { size, place }, Some(stitch)) => {
                ([0, 1].map(|k| stitch[k] / size[k] as f32), [0, 1].map(|k| place[k] as f32 / stitch[k]), true)
            }
            (Laid::Printed { .. }, None) => {
                let problem = "a print of a `size` needs the panels of a garment, whose stitches have one";
                context.error(
                    self.span,
                    problem,
                    Some("repeat = [1, 1] draws the picture over the whole cloth".into()),
                );
                return None;
            }
        };
        match Texture::open(&self.path) {
            Ok(texture) => Some(Print { texture, scale, corner, once }),
            Err(error) => {
                context.error(self.span, error.to_string(), None);
                None
            }
        }
    }
}

/// A picture over a fabric.
pub(super) struct Print {
    texture: Texture,
    /// Widths and heights of the picture in a stitch.
    scale: [f32; 2],
    /// Its lower left corner, in stitches.
    corner: [f32; 2],
    /// Whether there is nothing around it.
    once: bool,
}

impl Print {
    /// The colour at a place in stitches, as wide as to the next one; white beside the picture.
    pub(super) fn color(&self, here: [f32; 2], next: [f32; 2]) -> [f32; 3] {
        let uv = |at: [f32; 2]| [0, 1].map(|k| (at[k] - self.corner[k]) * self.scale[k]);
        let (here, next) = (uv(here), uv(next));
        if self.once && !here.iter().all(|v| (0.0..=1.0).contains(v)) {
            return [1.0; 3];
        }
        // But for a jump from one end of a round to its other.
        let width = (next[0] - here[0]).hypot(next[1] - here[1]).min(0.25);
        self.texture.sample(here[0], here[1], width)
    }
}
