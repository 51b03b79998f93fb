//! A comparison of two pictures as text, JSON and a page, and the names by which thresholds know its metrics.

use maud::{Markup, html};
use serde_json::{Value, json};

use super::page::{self, Picture};
use crate::image::metric::{Comparison, EPSILON, Errors, TRIMMED, flip};

/// Names of metrics for thresholds; those of errors may be followed by `_2`, `_4` or `_8`, the edge of the boxes that were
/// averaged.
pub(crate) const METRICS: [&str; 7] =
    ["mean_ratio", "ssim", "flip_ldr", "flip_hdr", "rmse", "relmse", "relmse_trimmed"];

/// A metric by its name, as a threshold compares it: of `mean_ratio` the largest distance of a channel from 1.
/// `None` for an unknown name; NaN where the pictures do not have it.
pub(crate) fn metric(comparison: &Comparison, name: &str) -> Option<f64> {
    let (base, factor) = match name.rsplit_once('_').and_then(|(base, n)| Some((base, n.parse::<usize>().ok()?))) {
        Some((base, factor)) if matches!(factor, 2 | 4 | 8) => (base, factor),
        _ => (name, 1),
    };
    let error = |get: fn(&Errors) -> f64| comparison.reduced(factor).map_or(f64::NAN, get);
    Some(match (base, factor) {
        ("rmse", _) => error(|e| e.rmse),
        ("relmse", _) => error(|e| e.rel_mse),
        ("relmse_trimmed", _) => error(|e| e.rel_mse_trimmed),
        ("mean_ratio", 1) => {
            let distance = comparison.mean_ratio.map(|ratio| (ratio - 1.0).abs());
            if distance.iter().any(|d| d.is_nan()) { f64::NAN } else { distance.into_iter().fold(0.0, f64::max) }
        }
        ("ssim", 1) => comparison.ssim.unwrap_or(f64::NAN),
        ("flip_ldr", 1) => comparison.flip_ldr,
        ("flip_hdr", 1) => comparison.flip_hdr.unwrap_or(f64::NAN),
        _ => return None,
    })
}

/// Whether a metric is worse than a limit. A similarity is worse when it is lower; what is not a number is worse than any.
pub(crate) fn exceeds(name: &str, value: f64, limit: f64) -> bool {
    value.is_nan() || if name == "ssim" { value < limit } else { value > limit }
}

/// The comparison as JSON.
pub(crate) fn to_json(comparison: &Comparison) -> Value {
    let errors: Vec<Value> = comparison
        .errors
        .iter()
        .map(|e| {
            json!({
                "factor": e.factor, "count": e.count,
                "rmse": e.rmse, "relmse": e.rel_mse, "relmse_trimmed": e.rel_mse_trimmed,
                "noise": e.noise.map(|n| json!({"relmse": n.rel_mse, "z_rms": n.z_rms, "within_1_2_3": n.within})),
            })
        })
        .collect();
    json!({
        "pixels": comparison.pixels[0], "counted": comparison.pixels[1],
        "non_finite": comparison.non_finite,
        "means": comparison.means,
        "mean_ratio": comparison.mean_ratio,
        "mean_ratio_uncertainty": comparison.ratio_uncertainty,
        "ssim": comparison.ssim, "flip_ldr": comparison.flip_ldr, "flip_hdr": comparison.flip_hdr,
        "epsilon": EPSILON, "trimmed_share": TRIMMED, "pixels_per_degree": flip::PIXELS_PER_DEGREE,
        "errors": errors,
    })
}

/// The comparison for people, some lines.
pub(crate) fn to_text(comparison: &Comparison, names: [&str; 2]) -> String {
    let colors = |c: [f64; 3]| format!("R {:.5}  G {:.5}  B {:.5}", c[0], c[1], c[2]);
    let known = |v: Option<f64>| v.map_or("none".to_owned(), |v| format!("{v:.5}"));
    let [pixels, counted] = comparison.pixels;
    let mut text = format!("{} against {}: {counted} of {pixels} pixels count\n", names[0], names[1]);
    for (name, count) in names.into_iter().zip(comparison.non_finite) {
        if count > 0 {
            text += &format!("  {count} pixels of {name} are not finite; they do not count\n");
        }
    }
    text += &format!("  means       {}\n  of the 2nd  {}\n", colors(comparison.means[0]), colors(comparison.means[1]));
    text += &format!("  mean ratio  {}\n", colors(comparison.mean_ratio));
    if let Some(uncertainty) = comparison.ratio_uncertainty {
        text += &format!("  +- at 95 %  {}\n", colors(uncertainty));
    }
    text += &format!("  SSIM        {}\n", known(comparison.ssim));
    text += &format!("  FLIP        {:.5} (LDR)  {} (HDR)\n", comparison.flip_ldr, known(comparison.flip_hdr));
    text += "  boxes of    RMSE        relMSE      trimmed     relMSE of noise alone  z rms   |z| within 1, 2, 3\n";
    for e in &comparison.errors {
        text += &format!("  {:<10}  {:<10.4e}  {:<10.4e}  {:<10.4e}", e.factor, e.rmse, e.rel_mse, e.rel_mse_trimmed);
        if let Some(n) = e.noise {
            let [a, b, c] = n.within;
            text += &format!("  {:<21.4e}  {:<6.3}  {a:.3} {b:.3} {c:.3}", n.rel_mse, n.z_rms);
        }
        text.truncate(text.trim_end().len());
        text += "\n";
    }
    text + &format!(
        "  relMSE: square error / (square of the 2nd + {EPSILON}); trimmed: without the worst {TRIMMED} of pixels\n"
    )
}

/// The comparison as a page of its own: metrics, a slider between the pictures, the error map.
pub(crate) fn to_html(comparison: &Comparison, names: [&str; 2], pictures: [&Picture; 2], map: &Picture) -> String {
    let table: Markup = html! {
        table {
            tr { th { "" } th { "R" } th { "G" } th { "B" } }
            @for (name, values) in [(names[0], comparison.means[0]), (names[1], comparison.means[1]), ("mean ratio", comparison.mean_ratio)] {
                tr { td { (name) } @for v in values { td.n { (format!("{v:.5}")) } } }
            }
            @if let Some(uncertainty) = comparison.ratio_uncertainty {
                tr { td { "± at 95 %" } @for v in uncertainty { td.n { (format!("{v:.5}")) } } }
            }
        }
        table {
            tr { th { "boxes of" } th { "RMSE" } th { "relMSE" } th { "trimmed" } th { "relMSE of noise alone" } th { "z rms" } }
            @for e in &comparison.errors {
                tr {
                    td { (e.factor) }
                    @for v in [Some(e.rmse), Some(e.rel_mse), Some(e.rel_mse_trimmed), e.noise.map(|n| n.rel_mse), e.noise.map(|n| n.z_rms)] {
                        td.n { (v.map_or("–".to_owned(), |v| format!("{v:.3e}"))) }
                    }
                }
            }
        }
        p {
            "SSIM " (comparison.ssim.map_or("–".to_owned(), |v| format!("{v:.4}")))
            ", FLIP " (format!("{:.4}", comparison.flip_ldr)) " (LDR), "
            (comparison.flip_hdr.map_or("–".to_owned(), |v| format!("{v:.4}"))) " (HDR). "
            (comparison.pixels[1]) " of " (comparison.pixels[0]) " pixels count."
        }
    };
    let body = html! {
        h1 { (names[0]) " against " (names[1]) }
        (table)
        div.row {
            (page::slider("pictures", names, pictures, 0.0))
            (page::figure(map, "FLIP (LDR), black 0 to white 1"))
        }
    };
    page::document(&format!("{} against {}", names[0], names[1]), &body)
}
