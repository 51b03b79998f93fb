//! How large a knit is to be: `gauge`, `width`, `height` and `circumference`, which count its stitches and rows.

use std::f64::consts::TAU;

use super::{Context, Range, Reader, garment};
use crate::{
    geometry::pattern::{
        knit::{Form, Knit, STITCHES_PER_SQUARE},
        revolution::Revolution,
    },
    input::diagnostic::Span,
};

/// Sizes that a knit was given, mm.
#[derive(Clone, Copy)]
pub(super) struct Sizes {
    /// Width and height of a stitch.
    stitch: Option<[f64; 2]>,
    /// Width of the piece or the way round it, and its height, each with its key.
    width: Option<(f64, &'static str)>,
    height: Option<f64>,
    /// Whether counts are given too.
    counted: [bool; 2],
    span: Span,
}

/// The shortest yarn of a stitch, and the narrowest stitch, in diameters: beyond them yarns would lie inside each other.
const SHORTEST: f64 = 11.0;
const NARROWEST: f64 = 1.5;
const LOWEST: f64 = 0.9;
/// Yarn of a firm stitch.
const FIRM: f64 = 14.0;

impl Sizes {
    /// Reads the keys; `fabric` may hold the gauge too.
    pub(super) fn read(
        table: &Reader<'_>,
        fabric: Option<&Reader<'_>>,
        context: &Context<'_>,
        form: &Option<Form>,
    ) -> Self {
        let own = table.has("gauge");
        let gauge = if own { Some(table) } else { fabric.filter(|f| f.has("gauge")) };
        let stitch = gauge.and_then(|t| garment::stitch(t, None)).map(|s| s.to_array());
        let mm = |key: &str| table.f64(key, Range::POSITIVE).map(|v| v * context.unit);
        let (width, height, round) = (mm("width"), mm("height"), mm("circumference"));
        let wrong = |key: &str, problem: &str, hint: &str| table.error_at(key, problem, Some(hint));
        match form {
            Some(Form::Tube) if width.is_some() => {
                wrong("width", "a tube has no width", "`circumference` is the way round it");
            }
            Some(Form::Flat) if round.is_some() => {
                wrong("circumference", "a flat piece has no circumference", "`width`, or form = \"tube\"");
            }
            Some(Form::Revolution(_)) => {
                for key in ["width", "height", "circumference", "gauge"].into_iter().filter(|k| table.has(k)) {
                    wrong(key, &format!("the profile says how large the piece is, not `{key}`"), "give one of them");
                }
            }
            _ => {}
        }
        for key in ["stitch_width", "row_height"].into_iter().filter(|k| stitch.is_some() && table.has(k)) {
            wrong(key, &format!("`{key}` and `gauge` are given"), "both say how large a stitch is: keep one");
        }
        let counted = ["stitches", "rows"].map(|key| table.has(key));
        for (k, keys) in [["width", "circumference"], ["height", "height"]].iter().enumerate() {
            if let Some(key) = keys.iter().find(|key| counted[k] && stitch.is_some() && table.has(key)) {
                let count = ["stitches", "rows"][k];
                wrong(key, &format!("`{key}`, `{count}` and `gauge` are given"), "two of them give the third");
            }
        }
        let named = |value: Option<f64>, key| value.map(|v| (v, key));
        Self {
            stitch,
            width: named(width, "width").or(named(round, "circumference")),
            height,
            counted,
            span: table.span("gauge").or(table.span("stitches")).unwrap_or(table.header()),
        }
    }

    /// The knit with counts and stitches that make it so large, knitted of yarn of a diameter (mm). What cannot be knitted is
    /// told, with what would fit.
    pub(super) fn apply(&self, knit: &Knit, diameter: f64, context: &Context<'_>) -> Option<Knit> {
        let mut knit = knit.clone();
        if let Some([width, height]) = self.stitch {
            (knit.stitch_width, knit.row_height) = (Some(width / diameter), Some(height / diameter));
        }
        let [width, height] = [self.width.map(|w| w.0), self.height].map(|size| size.map(|mm| mm / diameter));
        // A size and a count give the stitch.
        if let (Some(width), true) = (width, self.counted[0]) {
            knit.stitch_width = Some(width / f64::from(knit.stitches));
        }
        if let (Some(height), true) = (height, self.counted[1]) {
            knit.row_height = Some(height / f64::from(knit.rows));
        }
        self.check(&knit, diameter, context)?;
        let open = [width.filter(|_| !self.counted[0]), height.filter(|_| !self.counted[1])];
        if open != [None, None] {
            let stitch = knit.gauge();
            let count = |size: f64, own: f64, of: u32| {
                let of = f64::from(of.max(1));
                ((size / own / of).round().clamp(1.0, (1e6 / of).max(1.0)) * of) as u32
            };
            // Whole repeats, where rows do not fit otherwise or must close to a ring.
            let whole = knit.form != Form::Flat || !knit.chart.is_plain();
            let repeat = knit.chart.even_width(10_000).filter(|_| whole).unwrap_or(1);
            if let Some(width) = open[0] {
                knit.stitches = count(width, stitch[0], repeat);
            }
            if let Some(height) = open[1] {
                knit.rows = count(height, stitch[1], 1);
            }
            if knit.form != Form::Flat {
                knit.stitches = knit.stitches.max(3);
            }
        }
        Some(knit)
    }

    /// Whether yarn of this thickness can be knitted so.
    fn check(&self, knit: &Knit, d: f64, context: &Context<'_>) -> Option<()> {
        let tell = |problem: String, hint: String| {
            context.error(self.span, problem, Some(hint));
            None
        };
        if let (Some(width), Some(height)) = (knit.stitch_width, knit.row_height) {
            let length = (STITCHES_PER_SQUARE * width * height).sqrt();
            if length < SHORTEST || width < NARROWEST {
                let [across, up] = [width, height].map(|s| 100.0 / (s * d));
                let radius = 0.5 * d * (length / FIRM).min(width / 3.0);
                let by = (FIRM / length).max(3.0 / width);
                let problem = format!(
                    "a gauge of {across:.1} x {up:.1} in 10 cm is too dense for yarn {d:.3} mm thick: a stitch of {:.3} x {:.3} mm \
                     takes {length:.1} diameters of yarn",
                    width * d,
                    height * d
                );
                return tell(
                    problem,
                    format!("at most {:.1} x {:.1}, or yarn of a radius of {radius:.3}", across / by, up / by),
                );
            }
        } else if let Some(width) = knit.stitch_width.filter(|w| *w < NARROWEST) {
            let size = self.width.map_or(width * f64::from(knit.stitches) * d, |w| w.0);
            let most = (size / (3.0 * d)).floor();
            let key = self.width.map_or("width", |w| w.1);
            let problem =
                format!("{} stitches on a {key} of {size:.1} mm are {width:.2} yarn diameters wide", knit.stitches);
            return tell(problem, format!("about {most} stitches fit yarn {d:.3} mm thick"));
        }
        let Form::Revolution(profile) = &knit.form else { return Some(()) };
        let widths = knit.widths().ok()?;
        let surface = Revolution::new(profile);
        let height = surface.length() / widths.len() as f64;
        let of_row = |(row, count): (usize, &u32)| {
            let round = TAU * surface.radius((row as f64 + 0.5) * height);
            (round / f64::from(*count) / d, row, round, *count)
        };
        let tightest = widths.iter().enumerate().map(of_row).min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((width, row, round, count)) = tightest.filter(|t| t.0 < NARROWEST) {
            let problem = format!(
                "{count} stitches of row {} on a circumference of {round:.1} mm are {width:.2} yarn diameters wide",
                row + 1
            );
            let most = (round / (3.0 * d)).floor().max(1.0);
            let radius = 0.5 * d * width / 3.0;
            return tell(problem, format!("about {most} stitches there, or yarn of a radius of {radius:.3} mm"));
        }
        if height < LOWEST * d {
            let problem = format!(
                "{} rows on a profile {:.1} mm long are {:.2} yarn diameters high",
                knit.rows,
                surface.length(),
                height / d
            );
            let most = (surface.length() / (2.2 * d)).floor();
            return tell(problem, format!("about {most} rows fit yarn {d:.3} mm thick"));
        }
        Some(())
    }
}
