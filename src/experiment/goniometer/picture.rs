//! Pictures and tables of what a goniometer measured.

use std::{f64::consts::TAU, fmt::Write as _, path::Path};

use super::{COLUMNS, Distribution, Mean, Measurement, ROWS};
use crate::{
    image::{ImageError, png, png::Display},
    report::plot::escaped,
};

/// Edge of a cell in the map, pixels.
const CELL: usize = 8;
/// Colours of the channels in plots.
const CHANNELS: [&str; 3] = ["#c22", "#181", "#24c"];

/// The distribution as a picture: azimuth to the right (-180 to 180 degrees, 0 back towards the camera), latitude
/// upwards, the brightest cell white. A second measurement stands to the right of the first, on the same scale.
///
/// # Errors
/// What writing a file can say.
pub fn write_map(path: &Path, all: &[&Measurement]) -> Result<(), ImageError> {
    let largest = all
        .iter()
        .flat_map(|m| (0..ROWS).flat_map(move |r| (0..COLUMNS).map(move |c| m.distribution.value(r, c))))
        .flatten()
        .fold(1e-30, f64::max);
    let width = all.len() * COLUMNS * CELL + (all.len() - 1) * CELL;
    png::write(path, width, ROWS * CELL, &Display::default(), |y, line| {
        let row = ROWS - 1 - y / CELL;
        for (i, m) in all.iter().enumerate() {
            let start = i * (COLUMNS + 1) * CELL;
            for (x, pixel) in line[start..start + COLUMNS * CELL].iter_mut().enumerate() {
                let [r, g, b] = m.distribution.value(row, x / CELL).map(|v| (v / largest) as f32);
                *pixel = [r, g, b, 1.0];
            }
        }
    })
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
    let mut svg = header(SIZE, SIZE + 20.0 * all.len() as f64, title);
    for ring in 1..=4 {
        let r = RADIUS * f64::from(ring) / 4.0;
        let _ = writeln!(svg, r##"<circle cx="{middle}" cy="{middle}" r="{r}" fill="none" stroke="#ddd"/>"##);
        let _ = writeln!(
            svg,
            r##"<text x="{:.1}" y="{:.1}" fill="#888">{:.3}</text>"##,
            middle + 3.0,
            middle - r - 2.0,
            largest * f64::from(ring) / 4.0
        );
    }
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
    svg + "</svg>\n"
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
                let _ = write!(out, ",{:.6},{:.2e}", m.mean, m.se);
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
    let mut svg = header(total, top + HEIGHT + 50.0 + 20.0 * names.len() as f64, title);
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
        for tick in 0..=4 {
            let (v, at) = (largest * f64::from(tick) / 4.0, low + span * f64::from(tick) / 4.0);
            let _ = writeln!(
                svg,
                r##"<text x="{:.1}" y="{:.1}" text-anchor="end" fill="#444">{v:.2}</text><text x="{:.1}" y="{:.1}" text-anchor="middle" fill="#444">{}</text>"##,
                x0 - 4.0,
                y(v) + 4.0,
                x(at),
                top + HEIGHT + 16.0,
                short(at)
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
                        let (px, a, b) = (x(row.at), y(v.mean - 2.0 * v.se), y(v.mean + 2.0 * v.se));
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
