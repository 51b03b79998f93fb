//! Pictures and tables of what a goniometer measured.

use std::{f64::consts::TAU, fmt::Write as _, path::Path};

use super::{COLUMNS, Distribution, Mean, Measurement, ROWS};
use crate::{
    image::{ImageError, png, png::Display},
    report::{
        csv_cell,
        plot::{self, escaped},
    },
};

/// Edge of a cell in the map, pixels.
const CELL: usize = 8;
/// Colours of the channels in plots.
const CHANNELS: [&str; 3] = ["#c22", "#181", "#24c"];

/// Free space around a map for its axes, pixels: left and right, above, below.
const MARGIN: [usize; 3] = [52, 44, 44];

/// The distribution as a picture with axes: azimuth to the right (-180 to 180 degrees, 0 back towards the camera), latitude
/// upwards, the brightest cell of all white. Each measurement stands to the right of the one before, on the same scale.
///
/// # Errors
/// What writing a file can say.
pub fn write_map(path: &Path, title: &str, all: &[(&str, &Measurement)]) -> Result<(), ImageError> {
    let largest = all
        .iter()
        .flat_map(|(_, m)| (0..ROWS).flat_map(move |r| (0..COLUMNS).map(move |c| m.distribution.value(r, c))))
        .flatten()
        .fold(1e-30, f64::max);
    let [side, top, bottom] = MARGIN;
    let (map_width, map_height) = (COLUMNS * CELL, ROWS * CELL);
    let step = map_width + side;
    let mut plot = Pixels::new(all.len() * step + side, map_height + top + bottom);
    plot.text(side, 8, &format!("{title}; white is {} per steradian", short(largest)));
    for (i, (name, m)) in all.iter().enumerate() {
        let left = side + i * step;
        plot.centred(left + map_width / 2, top - 14, name);
        for (y, x) in (0..map_height).flat_map(|y| (0..map_width).map(move |x| (y, x))) {
            let [r, g, b] = m.distribution.value(ROWS - 1 - y / CELL, x / CELL).map(|v| (v / largest) as f32);
            plot.set(left + x, top + y, [r, g, b]);
        }
        for phi in (-180..=180).step_by(60) {
            let x = left + ((phi + 180) as usize * map_width / 360).min(map_width - 1);
            (0..5).for_each(|k| plot.set(x, top + map_height + k, [0.0; 3]));
            plot.centred(x, top + map_height + 8, &phi.to_string());
        }
        plot.centred(left + map_width / 2, top + map_height + 24, "azimuth phi, degrees; 0 is the camera's side");
        for theta in (-90..=90).step_by(30) {
            let y = top + ((90 - theta) as usize * map_height / 180).min(map_height - 1);
            (0..5).for_each(|k| plot.set(left - 1 - k, y, [0.0; 3]));
            let label = theta.to_string();
            plot.text(left - 8 - Pixels::GLYPH * label.len(), y - 3, &label);
        }
        plot.text(left - side + 2, top - 14, "latitude theta, degrees");
    }
    plot.write(path)
}

/// A white sheet to plot on, linear colours.
struct Pixels {
    width: usize,
    colors: Vec<[f32; 3]>,
}

impl Pixels {
    /// Width and height of a letter.
    const GLYPH: usize = 8;

    fn new(width: usize, height: usize) -> Self {
        Self { width, colors: vec![[1.0; 3]; width * height] }
    }

    fn set(&mut self, x: usize, y: usize, color: [f32; 3]) {
        if x < self.width
            && let Some(pixel) = self.colors.get_mut(y * self.width + x)
        {
            *pixel = color;
        }
    }

    /// Text from its upper left corner; what is not ASCII is left blank.
    fn text(&mut self, x: usize, y: usize, text: &str) {
        for (i, c) in text.chars().enumerate() {
            let glyph = font8x8::legacy::BASIC_LEGACY.get(c as usize).copied().unwrap_or_default();
            for (row, bits) in glyph.into_iter().enumerate() {
                // The lowest bit is the leftmost pixel.
                for column in (0..Self::GLYPH).filter(|k| bits >> k & 1 == 1) {
                    self.set(x + i * Self::GLYPH + column, y + row, [0.0; 3]);
                }
            }
        }
    }

    fn centred(&mut self, x: usize, y: usize, text: &str) {
        self.text(x.saturating_sub(Self::GLYPH * text.chars().count() / 2), y, text);
    }

    fn write(&self, path: &Path) -> Result<(), ImageError> {
        let height = self.colors.len() / self.width;
        png::write(path, self.width, height, &Display::default(), |y, line| {
            let row = &self.colors[y * self.width..][..self.width];
            line.iter_mut().zip(row).for_each(|(pixel, [r, g, b])| *pixel = [*r, *g, *b, 1.0]);
        })
    }
}

/// The distribution as a table: theta and phi of the middle of a cell in degrees, and for each measurement the values
/// per steradian of the three channels.
pub fn distribution_csv(all: &[(&str, &Measurement)]) -> String {
    let mut out = "theta,phi".to_owned();
    for (name, _) in all {
        let _ = write!(out, ",{name}_r,{name}_g,{name}_b");
    }
    out.push('\n');
    for row in 0..ROWS {
        for column in 0..COLUMNS {
            let _ = write!(
                out,
                "{:.3},{:.3}",
                Distribution::theta(row).to_degrees(),
                Distribution::phi(column).to_degrees()
            );
            for (_, m) in all {
                let [r, g, b] = m.distribution.value(row, column);
                let _ = write!(out, ",{r:.6e},{g:.6e},{b:.6e}");
            }
            out.push('\n');
        }
    }
    out
}

/// Share of the light per radian of azimuth.
fn around(m: &Measurement, column: usize) -> [f64; 3] {
    let width = TAU / COLUMNS as f64;
    (0..ROWS)
        .map(|r| m.distribution.energy[r * COLUMNS + column])
        .fold([0.0; 3], |sum, e| std::array::from_fn(|c| sum[c] + e[c] / width))
}

/// A polar picture (SVG) of the light per radian of azimuth: the camera at the right, each channel a curve; the first
/// measurement drawn through, others dashed.
pub fn polar_svg(title: &str, all: &[(&str, &Measurement)]) -> String {
    const SIZE: f64 = 560.0;
    const RADIUS: f64 = 220.0;
    let largest = all.iter().flat_map(|(_, m)| (0..COLUMNS).flat_map(|c| around(m, c))).fold(1e-30, f64::max);
    let middle = SIZE / 2.0;
    let mut svg = header(SIZE, SIZE + 20.0 * (1 + all.len()) as f64, title);
    let rings = plot::ticks(0.0, largest);
    let radius = |v: f64| RADIUS * v / largest;
    for (v, _) in rings.iter().filter(|(v, _)| *v > 0.0) {
        let r = radius(*v);
        let _ = writeln!(svg, r##"<circle cx="{middle}" cy="{middle}" r="{r:.1}" fill="none" stroke="#ddd"/>"##);
    }
    let _ = writeln!(
        svg,
        r##"<path d="M{0} {middle}H{1}M{middle} {0}V{1}" stroke="#ddd"/>"##,
        middle - RADIUS,
        middle + RADIUS
    );
    for (angle, word) in [(0.0, "camera 0"), (90.0, "90"), (180.0, "180"), (270.0, "-90")] {
        let (s, c) = f64::to_radians(angle).sin_cos();
        let anchor = if c > 0.5 {
            "end"
        } else if c < -0.5 {
            "start"
        } else {
            "middle"
        };
        let _ = writeln!(
            svg,
            r##"<text x="{:.1}" y="{:.1}" text-anchor="{anchor}" fill="#444">{word}</text>"##,
            middle + c * (RADIUS + 55.0),
            middle - s * (RADIUS + 14.0) + 4.0
        );
    }
    for (index, (name, m)) in all.iter().enumerate() {
        for (channel, color) in CHANNELS.iter().enumerate() {
            let points: Vec<String> = (0..COLUMNS)
                .map(|column| {
                    let r = RADIUS * around(m, column)[channel] / largest;
                    let (s, c) = Distribution::phi(column).sin_cos();
                    format!("{:.1},{:.1}", middle + r * c, middle - r * s)
                })
                .collect();
            let _ = writeln!(
                svg,
                r#"<polygon points="{}" fill="none" stroke="{color}"{}/>"#,
                points.join(" "),
                dashes(index)
            );
        }
        legend(&mut svg, 20.0, SIZE + 20.0 * index as f64, index, name);
    }
    // Above the curves, along a direction that no other label stands in.
    let (s, c) = f64::to_radians(62.0).sin_cos();
    for (v, label) in rings.iter().filter(|(v, _)| *v > 0.0) {
        let _ = writeln!(
            svg,
            r##"<text x="{:.1}" y="{:.1}" fill="#555" stroke="#fff" stroke-width="3" paint-order="stroke">{label}</text>"##,
            middle + c * radius(*v),
            middle - s * radius(*v)
        );
    }
    channels(&mut svg, 20.0, SIZE + 20.0 * all.len() as f64);
    svg + "</svg>\n"
}

/// Which colour is which channel.
fn channels(svg: &mut String, x: f64, y: f64) {
    for (i, (color, name)) in CHANNELS.iter().zip(["red", "green", "blue"]).enumerate() {
        let x = x + 90.0 * i as f64;
        let _ = writeln!(
            svg,
            r##"<path d="M{x} {0}h24" stroke="{color}" stroke-width="2"/><text x="{1}" y="{y}">{name}</text>"##,
            y - 4.0,
            x + 30.0
        );
    }
}

/// One row of a sweep: the parameter, and reflected and transmitted shares by each measurement.
#[derive(Clone, Debug)]
pub struct SweepRow {
    /// The parameter's value.
    pub at: f64,
    /// Reflected and transmitted (with unscattered) shares per channel, one entry for each measurement.
    pub energies: Vec<([Mean; 3], [Mean; 3])>,
}

/// A sweep as a table: the parameter, and for each measurement reflected and transmitted shares with standard errors.
pub fn sweep_csv(key: &str, names: &[&str], rows: &[SweepRow]) -> String {
    let mut out = key.to_owned();
    for name in names {
        for part in ["reflected", "transmitted"] {
            for channel in ["r", "g", "b"] {
                let _ = write!(out, ",{name}_{part}_{channel},{name}_{part}_{channel}_se");
            }
        }
    }
    out.push('\n');
    for row in rows {
        let _ = write!(out, "{}", row.at);
        for (reflected, transmitted) in &row.energies {
            for m in reflected.iter().chain(transmitted) {
                let _ = write!(out, ",{:.6},{}", m.mean, csv_cell(m.se, |se| format!("{se:.2e}")));
            }
        }
        out.push('\n');
    }
    out
}

/// A sweep as a plot (SVG): two panels, reflected and transmitted. Measurements named "truth" are points with bars of
/// two standard errors, all others are lines.
pub fn sweep_svg(title: &str, key: &str, names: &[&str], rows: &[SweepRow]) -> String {
    const WIDTH: f64 = 360.0;
    const HEIGHT: f64 = 280.0;
    let (left, top) = (56.0, 48.0);
    let total = 2.0 * (WIDTH + left) + 20.0;
    let mut svg = header(total, top + HEIGHT + 50.0 + 20.0 * (1 + names.len()) as f64, title);
    let (low, high) = rows.iter().fold((f64::MAX, f64::MIN), |(l, h), r| (l.min(r.at), h.max(r.at)));
    let span = if high > low { high - low } else { 1.0 };
    for (panel, part) in ["reflected", "transmitted"].into_iter().enumerate() {
        let x0 = left + panel as f64 * (WIDTH + left);
        let of = |row: &SweepRow, m: usize| if panel == 0 { row.energies[m].0 } else { row.energies[m].1 };
        let largest =
            rows.iter().flat_map(|r| (0..names.len()).flat_map(move |m| of(r, m))).map(|m| m.mean).fold(0.1, f64::max)
                * 1.05;
        let x = |at: f64| x0 + (at - low) / span * WIDTH;
        let y = |v: f64| top + HEIGHT * (1.0 - v / largest);
        let _ = writeln!(
            svg,
            r##"<rect x="{x0}" y="{top}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#888"/><text x="{:.1}" y="{:.1}" text-anchor="middle">{part}</text>"##,
            x0 + WIDTH / 2.0,
            top - 8.0
        );
        for (v, label) in plot::ticks(0.0, largest) {
            let _ = writeln!(
                svg,
                r##"<path d="M{x0} {1:.1}h{WIDTH}" stroke="#eee"/><text x="{0:.1}" y="{2:.1}" text-anchor="end" fill="#444">{label}</text>"##,
                x0 - 4.0,
                y(v),
                y(v) + 4.0,
            );
        }
        for (at, label) in plot::ticks(low, low + span) {
            let _ = writeln!(
                svg,
                r##"<path d="M{0:.1} {top}v{HEIGHT}" stroke="#eee"/><text x="{0:.1}" y="{1:.1}" text-anchor="middle" fill="#444">{label}</text>"##,
                x(at),
                top + HEIGHT + 16.0,
            );
        }
        let _ = writeln!(
            svg,
            r#"<text x="{:.1}" y="{:.1}" text-anchor="middle">{}</text>"#,
            x0 + WIDTH / 2.0,
            top + HEIGHT + 34.0,
            escaped(key)
        );
        for (m, name) in names.iter().enumerate() {
            for (channel, color) in CHANNELS.iter().enumerate() {
                if *name == "truth" {
                    for row in rows {
                        let v = of(row, m)[channel];
                        let error = v.se.unwrap_or(0.0);
                        let (px, a, b) = (x(row.at), y(v.mean - 2.0 * error), y(v.mean + 2.0 * error));
                        let _ = writeln!(
                            svg,
                            r#"<circle cx="{px:.1}" cy="{:.1}" r="3" fill="{color}"/><path d="M{px:.1} {a:.1}V{b:.1}" stroke="{color}"/>"#,
                            y(v.mean)
                        );
                    }
                    continue;
                }
                let points: Vec<String> =
                    rows.iter().map(|r| format!("{:.1},{:.1}", x(r.at), y(of(r, m)[channel].mean))).collect();
                let _ = writeln!(
                    svg,
                    r#"<polyline points="{}" fill="none" stroke="{color}"{}/>"#,
                    points.join(" "),
                    dashes(m)
                );
            }
        }
    }
    for (m, name) in names.iter().enumerate() {
        let y = top + HEIGHT + 50.0 + 20.0 * m as f64;
        if *name == "truth" {
            let _ = writeln!(
                svg,
                r#"<circle cx="{}" cy="{}" r="3"/><text x="{}" y="{y}">truth, two standard errors</text>"#,
                left + 20.0,
                y - 4.0,
                left + 48.0
            );
        } else {
            legend(&mut svg, left, y, m, name);
        }
    }
    channels(&mut svg, left, top + HEIGHT + 50.0 + 20.0 * names.len() as f64);
    svg + "</svg>\n"
}

fn header(width: f64, height: f64, title: &str) -> String {
    format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="#fff"/><text x="12" y="18" font-size="14">{}</text>
"##,
        escaped(title)
    )
}

fn legend(svg: &mut String, x: f64, y: f64, index: usize, name: &str) {
    let _ = writeln!(
        svg,
        r##"<path d="M{x} {0}h40" stroke="#000"{1}/><text x="{2}" y="{y}">{3}</text>"##,
        y - 4.0,
        dashes(index),
        x + 48.0,
        escaped(name)
    );
}

/// The first measurement is drawn through, each other in its own dashes.
fn dashes(index: usize) -> String {
    match index {
        0 => String::new(),
        i => format!(r#" stroke-dasharray="{} {}""#, 8 / i.min(4), 3),
    }
}

/// A number with as many digits as an axis needs.
fn short(v: f64) -> String {
    let digits = if v == 0.0 { 0 } else { (2 - v.abs().log10().floor() as i32).clamp(0, 6) };
    format!("{v:.*}", digits as usize)
}
