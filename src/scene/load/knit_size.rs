//! Keys of how large a knit is to be: `gauge`, `width`, `height` and `circumference`.

use super::{Context, Range, Reader, gauge};
use crate::{
    input::diagnostic::Span,
    pattern::{
        knit::{Form, Knit, Sizes, Thickness},
        knitspeak::WrittenEnd,
    },
};

/// Sizes with the places where stitches and rows were said to be so many or so large.
#[derive(Clone, Copy)]
pub(super) struct GivenSizes {
    sizes: Sizes,
    stitches: Span,
    rows: Span,
    /// What says how high it is.
    height: Span,
}

impl GivenSizes {
    /// Reads the keys; `fabric` may hold the gauge too.
    pub(super) fn read(
        table: &Reader<'_>,
        fabric: Option<&Reader<'_>>,
        context: &Context<'_>,
        form: &Option<Form>,
    ) -> Self {
        let gauge = gauge::gauged(table, fabric);
        let mm = |key: &str| table.f64(key, Range::POSITIVE).map(|v| v * context.unit);
        let sizes = Sizes {
            stitch: gauge.and_then(|t| gauge::stitch(t, None)).map(|s| s.to_array()),
            width: mm("width"),
            circumference: mm("circumference"),
            height: mm("height"),
            counted: ["stitches", "rows"].map(|key| table.has(key)),
            ending: None,
        };
        let measured = ["stitch_width", "row_height"].map(|key| table.has(key));
        for wrong in sizes.clashes(form.as_ref(), measured, |key| format!("`{key}`")) {
            match wrong.key.filter(|key| table.has(key)) {
                Some(key) => table.error_at(key, wrong.problem, Some(&wrong.hint)),
                None => table.error(wrong.problem, Some(&wrong.hint)),
            }
        }
        let gauge = table.span("gauge");
        let [stitches, rows] = ["stitches", "rows"].map(|key| gauge.or(table.span(key)).unwrap_or(table.header()));
        let height = table.span("height").or(table.span("instructions")).unwrap_or(table.header());
        Self { sizes, stitches, rows, height }
    }

    /// The height that written instructions say, mm, and after how many rows they may end, where no key says how many there are.
    pub(super) fn or_written(&mut self, end: WrittenEnd, form: Option<&Form>, tile: bool) {
        self.sizes.or_written(end, form, tile);
    }

    /// The knit of this size, of yarn of a thickness. What cannot be knitted is told, with what would fit.
    pub(super) fn apply(&self, knit: &Knit, yarn: &Thickness, context: &Context<'_>) -> Option<Knit> {
        let sized = self.sizes.apply(knit, yarn);
        let place = |key| match key {
            Some("rows") => self.rows,
            Some("height") => self.height,
            _ => self.stitches,
        };
        sized.map_err(|wrong| context.error(place(wrong.key), wrong.problem, Some(wrong.hint))).ok()
    }
}
