//! Plots with two logarithmic axes, as SVG.

use std::fmt::Write as _;

use crate::math::stats::PowerLaw;

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 470.0;
/// Left, right, top and bottom of the frame.
const FRAME: [f64; 4] = [72.0, WIDTH - 16.0, 34.0, HEIGHT - 52.0];
/// Told apart by people who see fewer colours as well (after Okabe and Ito).
const COLORS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#7a6a00", "#56b4e9", "#333333"];

/// One series of points.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Series {
    /// For the legend.
    pub name: String,
    /// Argument, value, and half the width of its interval.
    pub points: Vec<[f64; 3]>,
    /// Series of one group have one colour.
    pub group: usize,
    /// Dashed, with open marks.
    pub dashed: bool,
    /// A law to draw through the points.
    pub fit: Option<PowerLaw>,
}

/// Two logarithmic axes in the frame: decimal logarithms of what lies at its ends.
struct Axes {
    x: (f64, f64),
    y: (f64, f64),
}

/// Whether a point has a place on logarithmic axes.
fn shown(p: &&[f64; 3]) -> bool {
    p[0] > 0.0 && p[1] > 0.0 && p[0].is_finite() && p[1].is_finite()
}

/// A plot of series that fall. Points that are not positive are left out.
pub(crate) fn log_log(title: &str, axes: [&str; 2], series: &[Series], level: Option<f64>) -> String {
    let scale = Axes::around(series, level);
    let left = FRAME[0];
    let height = HEIGHT + 18.0 * series.len() as f64;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height}\" viewBox=\"0 0 {WIDTH} {height}\" \
         font-family=\"DejaVu Sans, Helvetica, Arial, sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n<text x=\"{left}\" y=\"20\" font-size=\"14\">{}</text>\n",
        escaped(title)
    );
    scale.draw(&mut svg, axes, level);
    for (i, s) in series.iter().enumerate() {
        s.draw(&mut svg, &scale);
        s.draw_name(&mut svg, HEIGHT + 18.0 * i as f64);
    }
    svg + "</svg>\n"
}

impl Axes {
    /// Those that show all points and a level.
    fn around(series: &[Series], level: Option<f64>) -> Self {
        let all = || series.iter().flat_map(|s| s.points.iter().filter(shown));
        let range = |k: usize, more: Option<f64>| {
            let values = all().map(|p| p[k].log10()).chain(more.filter(|v| *v > 0.0).map(f64::log10));
            let (low, high) = values.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
            if low > high { (0.0, 1.0) } else { (low - 0.08, high.max(low + 0.3) + 0.08) }
        };
        Self { x: range(0, None), y: range(1, level) }
    }

    fn at_x(&self, v: f64) -> f64 {
        let [left, right, ..] = FRAME;
        left + (v.log10() - self.x.0) / (self.x.1 - self.x.0) * (right - left)
    }

    fn at_y(&self, v: f64) -> f64 {
        let [_, _, top, bottom] = FRAME;
        bottom - (v.log10() - self.y.0) / (self.y.1 - self.y.0) * (bottom - top)
    }

    /// The frame, lines at round values, and a dotted line at a level.
    fn draw(&self, svg: &mut String, names: [&str; 2], level: Option<f64>) {
        let [left, right, top, bottom] = FRAME;
        // A line for each 1, 2, 5 of a decade, or for decades alone where there are many.
        let many = self.x.1 - self.x.0 > 3.0 || self.y.1 - self.y.0 > 4.0;
        let steps: &[f64] = if many { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let ticks = |(low, high): (f64, f64)| {
            let decades = (low.floor() as i32)..=(high.ceil() as i32);
            let all = decades.flat_map(move |d| steps.iter().map(move |s| s * 10f64.powi(d)));
            all.filter(move |v| v.log10() >= low && v.log10() <= high)
        };
        for v in ticks(self.x) {
            let p = self.at_x(v);
            let _ = writeln!(
                svg,
                "<path d=\"M{p:.1} {top}V{bottom}\" stroke=\"#ddd\"/><text x=\"{p:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                bottom + 16.0,
                number(v)
            );
        }
        for v in ticks(self.y) {
            let p = self.at_y(v);
            let _ = writeln!(
                svg,
                "<path d=\"M{left} {p:.1}H{right}\" stroke=\"#ddd\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                left - 6.0,
                p + 4.0,
                number(v)
            );
        }
        if let Some(level) = level {
            let p = self.at_y(level);
            let _ = writeln!(svg, "<path d=\"M{left} {p:.1}H{right}\" stroke=\"#888\" stroke-dasharray=\"2 3\"/>");
        }
        let _ = writeln!(
            svg,
            "<rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#333\"/>\n\
             <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n\
             <text transform=\"translate(16 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            right - left,
            bottom - top,
            0.5 * (left + right),
            bottom + 38.0,
            escaped(names[0]),
            0.5 * (top + bottom),
            escaped(names[1])
        );
    }
}

impl Series {
    fn color(&self) -> &'static str {
        COLORS[self.group % COLORS.len()]
    }

    fn dash(&self) -> &'static str {
        if self.dashed { " stroke-dasharray=\"6 4\"" } else { "" }
    }

    /// The line through its points, its law, and a mark for each point with its interval.
    fn draw(&self, svg: &mut String, axes: &Axes) {
        let (color, dash) = (self.color(), self.dash());
        let points: Vec<[f64; 3]> = self.points.iter().filter(shown).copied().collect();
        let path: Vec<String> =
            points.iter().map(|p| format!("{:.1} {:.1}", axes.at_x(p[0]), axes.at_y(p[1]))).collect();
        if path.len() > 1 {
            let _ = writeln!(
                svg,
                "<path d=\"M{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.6\"{dash}/>",
                path.join("L")
            );
        }
        if let (Some(fit), [first, .., last]) = (self.fit, points.as_slice()) {
            let _ = writeln!(
                svg,
                "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\" stroke=\"{color}\" stroke-width=\"4\" opacity=\"0.2\"/>",
                axes.at_x(first[0]),
                axes.at_y(fit.at(first[0])),
                axes.at_x(last[0]),
                axes.at_y(fit.at(last[0]))
            );
        }
        let [_, _, top, bottom] = FRAME;
        for [px, py, half] in &points {
            let fill = if self.dashed { "#fff" } else { color };
            let (x, y) = (axes.at_x(*px), axes.at_y(*py));
            let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{fill}\" stroke=\"{color}\"/>");
            if *half > 0.0 && half.is_finite() {
                // An interval that reaches below zero ends at the frame.
                let low = if py - half > 0.0 { axes.at_y(py - half).min(bottom) } else { bottom };
                let high = axes.at_y(py + half).max(top);
                let _ = writeln!(svg, "<path d=\"M{x:.1} {low:.1}V{high:.1}\" stroke=\"{color}\"/>");
            }
        }
    }

    /// Its line of the legend, at this height.
    fn draw_name(&self, svg: &mut String, line: f64) {
        let left = FRAME[0];
        let _ = writeln!(
            svg,
            "<path d=\"M{left} {}h28\" stroke=\"{}\" stroke-width=\"1.6\"{}/><text x=\"{}\" y=\"{line}\">{}</text>",
            line - 4.0,
            self.color(),
            self.dash(),
            left + 36.0,
            escaped(&self.name)
        );
    }
}

/// Round values from `low` to `high`, four to nine of them, each with the digits that tell it from its neighbours.
pub(crate) fn ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let span = high - low;
    if !(span > 0.0 && span.is_finite()) {
        return vec![(low, format!("{low}"))];
    }
    let decade = 10f64.powf((span / 8.0).log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0].map(|s| s * decade).into_iter().find(|s| span / s <= 8.0).unwrap_or(span);
    let digits = (0..12).find(|d| (step * 10f64.powi(*d)).fract().abs() < 1e-6).unwrap_or(12) as usize;
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last).map(|i| i as f64 * step).map(|v| (v, format!("{v:.digits$}"))).collect()
}

fn number(v: f64) -> String {
    if (1e-3..1e4).contains(&v) { format!("{}", (v * 1e6).round() / 1e6) } else { format!("{v:.0e}") }
}

/// Text as it stands in SVG.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_told_apart() {
        let labels = |low, high| -> Vec<String> { ticks(low, high).into_iter().map(|(_, label)| label).collect() };
        assert_eq!(labels(0.0, 0.525), ["0.0", "0.1", "0.2", "0.3", "0.4", "0.5"]);
        assert_eq!(labels(0.1, 0.7), ["0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7"]);
        assert_eq!(labels(0.0, 60.0), ["0", "10", "20", "30", "40", "50", "60"]);
        assert_eq!(labels(3.0, 3.0), ["3"]);
        for (low, high) in [(-1.0, 1.0), (0.0, 0.13), (1e-5, 9e-5), (0.0, 1234.0)] {
            let all = labels(low, high);
            assert!((4..=9).contains(&all.len()), "{all:?}");
            let mut different = all.clone();
            different.dedup();
            assert_eq!(all, different);
        }
    }

    #[test]
    fn plots_hold_what_can_be_shown() {
        let series = Series {
            name: "a < b".to_owned(),
            points: vec![[0.1, 1.0, 0.1], [1.0, 0.1, 0.2], [10.0, -0.01, 0.0], [f64::NAN, 1.0, 0.0]],
            group: 0,
            dashed: false,
            fit: PowerLaw::fit(&[(0.1, 1.0), (1.0, 0.1)]),
        };
        let svg = log_log("t & u", ["x", "y"], &[series], Some(0.5));
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(svg.contains("a &lt; b") && svg.contains("t &amp; u") && !svg.contains("NaN") && !svg.contains("inf"));
        assert!(svg.ends_with("</svg>\n"));
        let empty = log_log("", ["", ""], &[], None);
        assert!(!empty.contains("NaN"));
    }
}
