//! The page of Table 3: figures, pictures under a slider, maps of errors, lobes, plots.

use maud::{Markup, PreEscaped, html};

use super::{COLUMNS, Row, Table, megabytes, ratios, short};
use crate::{
    image::{
        metric::{flip, map},
        png::Display,
    },
    report::page::{self, Picture},
};

/// Pictures of one row.
#[derive(Clone, Debug)]
pub(crate) struct RowPictures {
    /// Explicit fibres.
    pub reference: Picture,
    /// What is compared with them.
    pub aggregated: Picture,
    /// The aggregated picture's light by lobe: names and pictures.
    pub lobes: Vec<(&'static str, Picture)>,
    /// Pictures of the other ways, in the order of the row.
    pub others: Vec<Picture>,
}

/// A plot with words.
#[derive(Clone, Debug)]
pub(crate) struct Plot {
    /// What it shows.
    pub caption: String,
    /// SVG.
    pub svg: String,
}

/// The whole page. A row without pictures is shown by its figures alone.
pub(crate) fn page(table: &Table, pictures: &[Option<RowPictures>], plots: &[Plot]) -> String {
    let body = html! {
        h1 { (table.title) }
        @for text in table.preface() { p { (text) } }
        div.scroll {
            table {
                tr { @for (name, _) in COLUMNS { th { (name) } } }
                @for row in &table.rows {
                    tr { @for (i, (_, text)) in COLUMNS.iter().enumerate() { td.n[i > 0] { (text(row)) } } }
                }
            }
        }
        @for missing in &table.missing { p.small { "Missing: " (missing.name) ": " (missing.reason) } }
        (paper(table))
        @if !plots.is_empty() {
            h2 { "Error against time" }
            @for plot in plots {
                figure { (PreEscaped(&plot.svg)) figcaption { (plot.caption) } }
            }
        }
        @for (i, (row, pictures)) in table.rows.iter().zip(pictures).enumerate() {
            h2 { (row.name) }
            p.small {
                (row.scene) ", " (row.size[0]) " x " (row.size[1]) " pixels; converged at "
                (format!("{:.0}", row.reference.converged_spp)) " and " (format!("{:.0}", row.aggregated.converged_spp)) " spp. "
                "Mean ratio " (ratios(row.model_error.mean_ratio)) ", relMSE " (format!("{:.4}", row.model_error.relmse))
                " at full resolution"
                @if let Some(relmse) = row.model_error.relmse_8 { ", " (format!("{relmse:.4}")) " in boxes of 8 x 8" }
                ", FLIP " (format!("{:.4}", row.model_error.flip)) "."
            }
            @if let Some(pictures) = pictures { (section(&format!("row{i}"), row, pictures)) }
        }
        h2 { "How it was measured" }
        p.small {
            "Suite " code { (table.suite) } ". Timed runs write no layers; the time is that of sampling, building is told beside it. Geometry is \
            control points, indices and per-point data; BVH is what Embree's memory monitor reports; process is the most memory that the run's \
            own process held. FLIP and error maps are of the converged pictures, whose noise is the rest of what is seen in flat parts."
        }
    };
    page::document(&table.title, &body)
}

/// The paper's own figures beside ours, where the suite has them.
fn paper(table: &Table) -> Markup {
    let rows: Vec<_> = table.rows.iter().filter_map(|row| Some((row, row.paper?))).collect();
    html! {
        @if !rows.is_empty() {
            h2 { "Beside the paper's table" }
            p.small { "The paper's scenes, pictures (768 x 576) and machine (16 cores) are not ours, and its memory is not split: only ratios compare, and those roughly." }
            table {
                tr { th { "row" } th.n { "time ratio: paper" } th.n { "here" } th.n { "memory: paper" } th.n { "here" } th.n { "bounces: paper" } th.n { "here" } }
                @for (row, paper) in rows {
                    tr {
                        td { (row.name) }
                        td.n { (short(paper.seconds[0] / paper.seconds[1])) }
                        td.n { (short(row.time_ratio)) }
                        td.n { (format!("{:.2} %", 100.0 * paper.megabytes[1] / paper.megabytes[0])) }
                        td.n { (format!("{:.2} %", 100.0 * row.memory_ratio)) " of " (megabytes(row.reference.geometry_bytes + row.reference.bvh_bytes)) " MB" }
                        td.n { (short(paper.bounces[0])) " / " (short(paper.bounces[1])) }
                        td.n { (short(row.reference.mean_bounces)) " / " (short(row.aggregated.mean_bounces)) }
                    }
                }
            }
        }
    }
}

/// Stops by which a picture is lightened or darkened so that its bright parts are just below white, in quarters.
fn exposure(picture: &Picture) -> f32 {
    let mut values: Vec<f32> = picture.colors.iter().map(|c| c[0].max(c[1]).max(c[2])).filter(|v| *v > 0.0).collect();
    values.sort_by(f32::total_cmp);
    let bright = values.get(values.len() * 98 / 100).copied().unwrap_or(1.0);
    ((0.85 / bright).log2() * 4.0).round().clamp(-40.0, 40.0) / 4.0
}

fn section(id: &str, row: &Row, pictures: &RowPictures) -> Markup {
    let (reference, aggregated) = (&pictures.reference, &pictures.aggregated);
    let stops = exposure(reference);
    let display = Display { exposure: stops, ..Display::default() };
    // The slider has every pixel; beside it small copies do, and the page is a third as large.
    let shown = |picture: &Picture, caption: &str| page::figure_shown(&picture.halved(), &display, caption);
    let flip_of = |picture: &Picture| {
        let values = flip::hdr(&picture.colors, &reference.colors, reference.width);
        Picture::of_map(&values.unwrap_or_else(|| vec![0.0; reference.colors.len()]), reference.width, map::magma)
    };
    html! {
        div.row {
            (page::slider(id, ["explicit fibres", "aggregated"], [reference, aggregated], stops))
            (page::figure(&flip_of(aggregated), &format!("HDR-FLIP, black 0 to white 1; mean {:.4}", row.model_error.flip)))
            div.thumbnails {
                (shown(reference, "explicit fibres"))
                (shown(aggregated, "aggregated"))
            }
        }
        @if !pictures.lobes.is_empty() {
            h3 { "Light by the lobe of its first scattering" }
            div.row.thumbnails { @for (name, picture) in &pictures.lobes { (shown(picture, name)) } }
        }
        @if !pictures.others.is_empty() {
            h3 { "Other models" }
            div.row.thumbnails {
                @for (other, picture) in row.others.iter().zip(&pictures.others) {
                    (shown(picture, &format!(
                        "{}: mean ratio {}, FLIP {:.4}",
                        other.name, ratios(other.model_error.mean_ratio), other.model_error.flip
                    )))
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::table3::tests::table;

    #[test]
    fn the_page_shows_every_row_and_stands_alone() {
        let table = table();
        let picture = Picture { width: 16, colors: (0..256).map(|i| [i as f32 / 1024.0; 3]).collect() };
        let pictures = RowPictures {
            reference: picture.clone(),
            aggregated: picture.clone(),
            lobes: vec![("R", picture.clone()), ("TT", picture.clone())],
            others: vec![picture.clone()],
        };
        let plot = Plot { caption: "a plot".to_owned(), svg: "<svg></svg>".to_owned() };
        let page = page(&table, &[Some(pictures)], &[plot]);
        for part in ["silk, front", "15.0 ± 2.00", "a plot", "<svg></svg>", "paper: mean ratio", "6.45", "glove"] {
            assert!(page.contains(part), "{part}");
        }
        // Two of the slider, two beside it, the map, two lobes, one other.
        assert_eq!(page.matches("data:image/png;base64,").count(), 8);
        assert!(!page.contains("http"));
        assert_eq!(exposure(&picture), 1.75, "a quarter of white becomes nearly white");
    }
}
