//! Table 3: two ways to render the same cloth at equal quality, as Markdown, CSV and JSON; [`html`] has the page.

pub(crate) mod html;

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use super::{csv_cell, plus_minus};
use crate::image::metric::EPSILON;

/// What one way took to reach the target, means over repeated runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Run {
    /// Mode and model.
    pub method: String,
    /// Seconds of rendering.
    pub render_seconds: f64,
    /// Their standard deviation over the runs; not known from one.
    pub render_seconds_deviation: Option<f64>,
    /// Seconds for making curves and the BVH.
    pub build_seconds: f64,
    /// Control points, indices and what is kept for each point.
    pub geometry_bytes: u64,
    /// What Embree reports for its BVH.
    pub bvh_bytes: u64,
    /// The most memory that a process of its own has held.
    pub peak_rss_bytes: u64,
    /// Scattering events of a camera path that hits cloth.
    pub mean_bounces: f64,
    /// Samples per pixel.
    pub spp: f64,
    /// Rays of all kinds.
    pub rays: f64,
    /// Samples per pixel that the timed runs took.
    pub timed_spp: f64,
    /// relMSE of each timed run.
    pub timed_relmse: Vec<f64>,
    /// Seconds of rendering of each timed run.
    pub timed_seconds: Vec<f64>,
    /// Samples per pixel of the converged picture.
    pub converged_spp: f64,
}

/// How far what a method converges to is from the reference, on the cloth: pixels that the reference covers at least half.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ModelError {
    /// Mean over mean of the reference, each channel.
    pub mean_ratio: [f64; 3],
    /// relMSE without noise, full resolution.
    pub relmse: f64,
    /// relMSE without noise, after averaging boxes of 8 x 8 pixels; absent where the cloth fills none.
    pub relmse_8: Option<f64>,
    /// Mean HDR-FLIP, with the little noise that converged pictures have.
    pub flip: f64,
}

/// A third way, of which only the picture is compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Other {
    /// What it is called.
    pub name: String,
    /// How far it is from the reference.
    pub model_error: ModelError,
    /// File of its converged picture, from the directory of the table.
    pub picture: String,
}

/// Figures of the paper's table, reference and theirs: seconds, megabytes, bounces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Paper {
    /// Seconds at equal quality.
    pub seconds: [f64; 2],
    /// Memory in megabytes.
    pub megabytes: [f64; 2],
    /// Mean bounces.
    pub bounces: [f64; 2],
}

/// One row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    /// The cloth and its light.
    pub name: String,
    /// The scene file.
    pub scene: String,
    /// Size of the pictures.
    pub size: [usize; 2],
    /// Every fibre a curve.
    pub reference: Run,
    /// What is compared with it.
    pub aggregated: Run,
    /// Seconds of rendering, reference over aggregated.
    pub time_ratio: f64,
    /// Standard deviation of that ratio, from the spread of both where that is known.
    pub time_ratio_deviation: Option<f64>,
    /// Geometry and BVH, aggregated over reference.
    pub memory_ratio: f64,
    /// Mean bounces, aggregated over reference.
    pub bounce_ratio: f64,
    /// What the aggregated picture converges to, against the reference.
    pub model_error: ModelError,
    /// Other ways, compared by their pictures.
    pub others: Vec<Other>,
    /// What the paper says of the row that this one is like.
    pub paper: Option<Paper>,
    /// Files of the converged pictures, reference and aggregated, from the directory of the table.
    pub pictures: [String; 2],
}

/// A row that is not there, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Missing {
    /// The row's name.
    pub name: String,
    /// Why it is missing.
    pub reason: String,
}

/// All of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Table {
    /// What the suite calls itself.
    pub title: String,
    /// The suite file.
    pub suite: String,
    /// What it ran on.
    pub machine: String,
    /// The program.
    pub commit: String,
    /// What equal quality means.
    pub metric: String,
    /// Its value.
    pub target: f64,
    /// Timed runs of each kind behind every row.
    pub repeats: usize,
    /// Threads of each run; 0 for all.
    pub threads: usize,
    /// What was measured.
    pub rows: Vec<Row>,
    /// What was not.
    pub missing: Vec<Missing>,
}

/// The metric in words.
pub(crate) fn metric() -> String {
    format!(
        "relMSE: mean over pixels and channels of (picture - converged)^2 / (converged^2 + {EPSILON}), \
         against a converged picture of the same mode and model from independent seeds, without the latter's noise"
    )
}

/// Bytes in megabytes of a million.
fn megabytes(bytes: u64) -> String {
    let mb = bytes as f64 / 1e6;
    if mb < 10.0 { format!("{mb:.2}") } else { format!("{mb:.0}") }
}

/// Three figures that mean something.
fn short(value: f64) -> String {
    match value.abs() {
        v if v >= 100.0 => format!("{value:.0}"),
        v if v >= 10.0 => format!("{value:.1}"),
        v if v >= 0.1 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

fn ratios(mean_ratio: [f64; 3]) -> String {
    mean_ratio.map(|v| format!("{v:.3}")).join(" ")
}

/// The columns that people read: heading, and each row's text.
type Column<T> = (&'static str, fn(&T) -> String);
const COLUMNS: [Column<Row>; 13] = [
    ("row", |r| r.name.clone()),
    ("time, s: fibres / ours", |r| {
        format!("{} / {}", short(r.reference.render_seconds), short(r.aggregated.render_seconds))
    }),
    ("ratio", |r| short(r.time_ratio) + &plus_minus(r.time_ratio_deviation, " ± ", short)),
    ("spp", |r| format!("{:.0} / {:.0}", r.reference.spp, r.aggregated.spp)),
    ("build, s", |r| format!("{} / {}", short(r.reference.build_seconds), short(r.aggregated.build_seconds))),
    ("geometry, MB", |r| {
        format!("{} / {}", megabytes(r.reference.geometry_bytes), megabytes(r.aggregated.geometry_bytes))
    }),
    ("BVH, MB", |r| format!("{} / {}", megabytes(r.reference.bvh_bytes), megabytes(r.aggregated.bvh_bytes))),
    ("memory ratio", |r| format!("{:.2} %", 100.0 * r.memory_ratio)),
    ("process, MB", |r| {
        format!("{} / {}", megabytes(r.reference.peak_rss_bytes), megabytes(r.aggregated.peak_rss_bytes))
    }),
    ("bounces", |r| format!("{} / {}", short(r.reference.mean_bounces), short(r.aggregated.mean_bounces))),
    ("rays, millions", |r| format!("{} / {}", short(r.reference.rays / 1e6), short(r.aggregated.rays / 1e6))),
    ("mean ratio R G B", |r| ratios(r.model_error.mean_ratio)),
    ("relMSE 8x8, FLIP", |r| distance(&r.model_error)),
];

/// How far a picture is from the reference, in two figures.
fn distance(error: &ModelError) -> String {
    let relmse = error.relmse_8.map_or("–".to_owned(), |v| format!("{v:.4}"));
    format!("{relmse}, {:.3}", error.flip)
}

impl Table {
    /// What a reader must know before the figures.
    fn preface(&self) -> Vec<String> {
        vec![
            format!("Machine: {}. Program: {}.", self.machine, self.commit),
            format!(
                "Equal quality: every time is the time of rendering to an error of {} in {}. Each figure is the mean of {} runs of each kind (more of what is over in a moment), \
                 taken by turns, each a process of its own; a run takes about the samples that the target needs, and its time is \
                 scaled by its own error over the target.",
                self.target,
                self.metric,
                self.repeats
            ),
            "Of two figures the first is that of explicit fibres, the second that of the aggregated model; the time ratio is first over \
             second, the memory ratio (geometry and BVH) second over first. Model error, on the cloth, is that of the aggregated model's \
             converged picture against that of explicit fibres: ratio of the means, relMSE without noise after averaging boxes of 8 x 8 \
             pixels, mean HDR-FLIP."
                .to_owned(),
        ]
    }

    /// The table as Markdown.
    pub(crate) fn to_markdown(&self) -> String {
        let mut out = format!("# {}\n\n{}\n\n", self.title, self.preface().join("\n\n"));
        let _ = writeln!(out, "| {} |", COLUMNS.map(|(name, _)| name).join(" | "));
        let _ = writeln!(out, "|{}", " --- |".repeat(COLUMNS.len()));
        for row in &self.rows {
            let _ = writeln!(out, "| {} |", COLUMNS.map(|(_, text)| text(row)).join(" | "));
        }
        for missing in &self.missing {
            let _ = writeln!(out, "\nMissing: {}: {}", missing.name, missing.reason);
        }
        out + &self.others_to_markdown()
    }

    /// Other ways beside the aggregated model, if there are any: how far each is from explicit fibres.
    fn others_to_markdown(&self) -> String {
        let mut out = String::new();
        let Some(first) = self.rows.iter().find(|row| !row.others.is_empty()) else { return out };
        let names: Vec<&str> = first.others.iter().map(|other| other.name.as_str()).collect();
        let _ = writeln!(out, "\n## Other ways\n\nDistance from explicit fibres: relMSE 8x8, FLIP.\n");
        let _ = writeln!(out, "| row | aggregated | {} |", names.join(" | "));
        let _ = writeln!(out, "|{}", " --- |".repeat(2 + names.len()));
        for row in &self.rows {
            let of = |name: &&str| {
                let other = row.others.iter().find(|other| other.name == **name);
                other.map_or("–".to_owned(), |other| distance(&other.model_error))
            };
            let cells: Vec<String> = names.iter().map(of).collect();
            let _ = writeln!(out, "| {} | {} | {} |", row.name, distance(&row.model_error), cells.join(" | "));
        }
        out
    }

    /// Every figure, a line for each row.
    pub(crate) fn to_csv(&self) -> String {
        let of_run = |side: &str| RUN_COLUMNS.map(|(name, _)| format!("{side}_{name}"));
        let mut header: Vec<String> = ROW_COLUMNS.iter().map(|(name, _)| (*name).to_owned()).collect();
        header.extend(of_run("reference"));
        header.extend(of_run("aggregated"));
        header.extend(ERROR_COLUMNS.iter().map(|(name, _)| (*name).to_owned()));
        let mut out = header.join(",") + "\n";
        for row in &self.rows {
            let mut cells: Vec<String> = ROW_COLUMNS.iter().map(|(_, cell)| cell(row)).collect();
            for run in [&row.reference, &row.aggregated] {
                cells.extend(RUN_COLUMNS.iter().map(|(_, cell)| cell(run)));
            }
            cells.extend(ERROR_COLUMNS.iter().map(|(_, cell)| cell(row)));
            out += &(cells.join(",") + "\n");
        }
        out
    }

    /// The table as JSON.
    pub(crate) fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("numbers and text become JSON") + "\n"
    }
}

/// Text in quotes, as CSV has it.
pub(super) fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

/// The columns of the CSV that name a row.
const ROW_COLUMNS: [Column<Row>; 4] = [
    ("row", |row| quoted(&row.name)),
    ("scene", |row| quoted(&row.scene)),
    ("width", |row| row.size[0].to_string()),
    ("height", |row| row.size[1].to_string()),
];

/// Those of each of its two runs.
const RUN_COLUMNS: [Column<Run>; 9] = [
    ("render_seconds", |run| run.render_seconds.to_string()),
    ("render_seconds_deviation", |run| csv_cell(run.render_seconds_deviation, |v| v.to_string())),
    ("build_seconds", |run| run.build_seconds.to_string()),
    ("geometry_bytes", |run| run.geometry_bytes.to_string()),
    ("bvh_bytes", |run| run.bvh_bytes.to_string()),
    ("peak_rss_bytes", |run| run.peak_rss_bytes.to_string()),
    ("mean_bounces", |run| run.mean_bounces.to_string()),
    ("spp", |run| run.spp.to_string()),
    ("rays", |run| run.rays.to_string()),
];

/// Those that compare the two.
const ERROR_COLUMNS: [Column<Row>; 10] = [
    ("time_ratio", |row| row.time_ratio.to_string()),
    ("time_ratio_deviation", |row| csv_cell(row.time_ratio_deviation, |v| v.to_string())),
    ("memory_ratio", |row| row.memory_ratio.to_string()),
    ("bounce_ratio", |row| row.bounce_ratio.to_string()),
    ("mean_ratio_r", |row| row.model_error.mean_ratio[0].to_string()),
    ("mean_ratio_g", |row| row.model_error.mean_ratio[1].to_string()),
    ("mean_ratio_b", |row| row.model_error.mean_ratio[2].to_string()),
    ("relmse", |row| row.model_error.relmse.to_string()),
    ("relmse_8", |row| csv_cell(row.model_error.relmse_8, |v| v.to_string())),
    ("flip", |row| row.model_error.flip.to_string()),
];

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in super::super) fn run(seconds: f64, bytes: u64) -> Run {
        Run {
            method: "fiber".to_owned(),
            render_seconds: seconds,
            render_seconds_deviation: Some(0.1 * seconds),
            build_seconds: 0.5,
            geometry_bytes: bytes,
            bvh_bytes: 2 * bytes,
            peak_rss_bytes: 100_000_000,
            mean_bounces: 4.5,
            spp: 100.0,
            rays: 1.5e6,
            timed_spp: 110.0,
            timed_relmse: vec![0.01, 0.011],
            timed_seconds: vec![seconds; 2],
            converged_spp: 512.0,
        }
    }

    pub(in super::super) fn table() -> Table {
        let error = ModelError { mean_ratio: [1.0, 0.9, 1.1], relmse: 0.02, relmse_8: Some(0.01), flip: 0.05 };
        let row = Row {
            name: "silk, front".to_owned(),
            scene: "s.toml".to_owned(),
            size: [64, 48],
            reference: run(30.0, 50_000_000),
            aggregated: run(2.0, 100_000),
            time_ratio: 15.0,
            time_ratio_deviation: Some(2.0),
            memory_ratio: 0.002,
            bounce_ratio: 0.2,
            model_error: error.clone(),
            others: vec![Other { name: "paper".to_owned(), model_error: error, picture: "cache/x.exr".to_owned() }],
            paper: Some(Paper { seconds: [187.0, 29.0], megabytes: [210.0, 1.8], bounces: [12.4, 1.6] }),
            pictures: ["cache/a.exr".to_owned(), "cache/b.exr".to_owned()],
        };
        Table {
            title: "T".to_owned(),
            suite: "t.toml".to_owned(),
            machine: "M".to_owned(),
            commit: "c".to_owned(),
            metric: metric(),
            target: 0.01,
            repeats: 2,
            threads: 0,
            rows: vec![row],
            missing: vec![Missing { name: "glove".to_owned(), reason: "no file".to_owned() }],
        }
    }

    #[test]
    fn every_form_holds_the_figures() {
        let table = table();
        let text = table.to_markdown();
        assert!(text.contains("| silk, front | 30.0 / 2.00 | 15.0 ± 2.00 | 100 / 100 |"), "{text}");
        assert!(
            text.contains("| 50 / 0.10 | 100 / 0.20 | 0.20 % |")
                && text.contains("an error of 0.01 in relMSE: mean over"),
            "{text}"
        );
        assert!(text.contains("Missing: glove: no file"));
        let (rows, others) = text.split_once("## Other ways").unwrap();
        for (part, columns) in [(rows, COLUMNS.len()), (others, 3)] {
            let mut lines = part.lines().filter(|l| l.starts_with('|'));
            assert!(lines.all(|l| l.matches('|').count() == columns + 1), "{text}");
        }
        assert!(others.contains("| silk, front | 0.0100, 0.050 | 0.0100, 0.050 |"), "{text}");
        let csv = table.to_csv();
        let columns: Vec<usize> = csv.lines().map(|l| l.replace("\"silk, front\"", "x").matches(',').count()).collect();
        assert_eq!(columns, [columns[0]; 2]);
        let back: Table = serde_json::from_str(&table.to_json()).unwrap();
        assert_eq!(back, table);
    }

    #[test]
    fn json_has_the_keys_that_scripts_read() {
        let json: serde_json::Value = serde_json::from_str(&table().to_json()).unwrap();
        for key in ["machine", "commit", "metric", "target", "rows"] {
            assert!(!json[key].is_null(), "{key}");
        }
        let row = &json["rows"][0];
        for key in ["name", "reference", "aggregated", "time_ratio", "memory_ratio", "bounce_ratio", "model_error"] {
            assert!(!row[key].is_null(), "{key}");
        }
        for run in [&row["reference"], &row["aggregated"]] {
            for key in [
                "render_seconds",
                "build_seconds",
                "geometry_bytes",
                "bvh_bytes",
                "peak_rss_bytes",
                "mean_bounces",
                "spp",
                "rays",
            ] {
                assert!(run[key].is_number(), "{key}");
            }
        }
        assert!(["mean_ratio", "relmse_8", "flip"].iter().all(|key| !row["model_error"][*key].is_null()));
    }
}
