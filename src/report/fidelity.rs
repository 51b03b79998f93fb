//! How faithful pictures are to explicit fibres: the table of a suite, as Markdown, CSV and JSON.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use super::table3::{Missing, ModelError, quoted};

/// A channel counts where it holds more than this share of the light.
const SHARE_THAT_COUNTS: f64 = 0.02;
/// No mean should be off by more.
const FARTHEST: f64 = 0.10;

/// One way to render a case, against the reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Way {
    /// Mode and model, or what the suite calls it.
    pub name: String,
    /// Means and distances, on the cloth.
    pub error: ModelError,
    /// Mean relative error of blocks of 8 x 8 pixels; absent where the cloth fills none.
    pub blocks: Option<f64>,
}

/// A fabric under a light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    /// Fabric and light.
    pub name: String,
    /// Whether the fabric was kept out of development.
    pub held_out: bool,
    /// How far means may be off.
    pub within: f64,
    /// How many packings of the fibres its pictures are means of.
    pub packings: u32,
    /// Samples per pixel of the reference.
    pub spp: f64,
    /// The reference's mean on the cloth.
    pub mean: [f64; 3],
    /// Its error: of several packings its standard error over them, of one half of the difference between two pictures with half of the
    /// samples.
    pub mean_error: [f64; 3],
    /// What the reference's own noise is in the error of blocks: of samples, and of packings where there are several.
    pub block_noise: Option<f64>,
    /// What is tested, first, and others.
    pub ways: Vec<Way>,
}

/// All of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Table {
    /// What the suite calls itself.
    pub title: String,
    /// The suite file.
    pub suite: String,
    /// The program.
    pub commit: String,
    /// Mode of the reference.
    pub reference: String,
    /// How many packings of the fibres pictures are means of where a row does not say otherwise.
    pub packings: u32,
    /// What was measured.
    pub rows: Vec<Row>,
    /// What was not.
    pub missing: Vec<Missing>,
}

impl Row {
    /// The largest distance of a mean's ratio from 1, over the channels that count.
    fn off(&self, way: &Way) -> f64 {
        let total: f64 = self.mean.iter().sum();
        (0..3)
            .filter(|k| self.mean[*k] > SHARE_THAT_COUNTS * total)
            .map(|k| (way.error.mean_ratio[k] - 1.0).abs())
            .fold(0.0, f64::max)
    }
}

impl Table {
    /// The table as Markdown: how many cases meet the goal, then every case.
    pub(crate) fn to_markdown(&self) -> String {
        let mut out = format!("# {}\n\n", self.title);
        let _ = writeln!(
            out,
            "`yarnray bench {}`, program {}. Reference: mode {}, every fibre a curve.\n\n\
             *ratio*: mean over the cloth's pixels over that of the reference, red, green, blue. *blocks*: mean of |error| / (reference + 0.05 mean) after \
             averaging 8 x 8 pixels; behind it what the reference's own noise makes of it. *relMSE*: of the same blocks, without noise. *FLIP*: mean HDR-FLIP, with \
             noise. *error of the mean*: of the reference, {}. A mean is *within* its goal if every channel with more than {:.0} % of the light is.\n",
            self.suite,
            self.commit,
            self.reference,
            match self.packings {
                1 => "from two halves of its samples".to_owned(),
                n => format!(
                    "a standard error over {n} packings of the fibres, of which every picture is the mean (where another number stands behind it, of so many)"
                ),
            },
            100.0 * SHARE_THAT_COUNTS
        );
        let _ = writeln!(
            out,
            "| fabrics | way | cases | within the goal | off by over {:.0} % | mean error of blocks |",
            100.0 * FARTHEST
        );
        let _ = writeln!(out, "|{}", " --- |".repeat(6));
        let names: Vec<&str> = self.rows.first().iter().flat_map(|r| &r.ways).map(|w| w.name.as_str()).collect();
        for (held_out, label) in [(false, "seen in development"), (true, "held out")] {
            for (k, name) in names.iter().enumerate() {
                let rows: Vec<&Row> = self.rows.iter().filter(|r| r.held_out == held_out && r.ways.len() > k).collect();
                if rows.is_empty() {
                    continue;
                }
                let count = |f: &dyn Fn(&Row) -> bool| rows.iter().filter(|r| f(r)).count();
                let blocks: Vec<f64> = rows.iter().filter_map(|r| r.ways[k].blocks).collect();
                let _ = writeln!(
                    out,
                    "| {label} | {name} | {} | {} | {} | {:.3} |",
                    rows.len(),
                    count(&|r| r.off(&r.ways[k]) <= r.within),
                    count(&|r| r.off(&r.ways[k]) > FARTHEST),
                    blocks.iter().sum::<f64>() / blocks.len().max(1) as f64
                );
            }
        }
        for (held_out, label) in [(false, "Seen in development"), (true, "Held out")] {
            if !self.rows.iter().any(|r| r.held_out == held_out) {
                continue;
            }
            let _ = writeln!(out, "\n## {label}\n");
            let _ = writeln!(
                out,
                "| fabric and light | way | ratio | blocks, noise | relMSE 8x8 | FLIP | error of the mean |"
            );
            let _ = writeln!(out, "|{}", " --- |".repeat(7));
            for row in self.rows.iter().filter(|r| r.held_out == held_out) {
                for (k, way) in row.ways.iter().enumerate() {
                    let worst = (0..3).map(|c| row.mean_error[c] / row.mean[c].max(1e-12)).fold(0.0, f64::max);
                    let number =
                        |v: Option<f64>, digits: usize| v.map_or("–".to_owned(), |v| format!("{v:.digits$}"));
                    let _ = writeln!(
                        out,
                        "| {} | {} | {} | {}, {} | {} | {:.3} | {} |",
                        if k == 0 { row.name.as_str() } else { "" },
                        way.name,
                        way.error.mean_ratio.map(|v| format!("{v:.3}")).join(" "),
                        number(way.blocks, 3),
                        number(row.block_noise, 3),
                        number(way.error.relmse_8, 4),
                        way.error.flip,
                        match row.packings {
                            _ if k > 0 => String::new(),
                            n if n == self.packings => format!("{:.1} %", 100.0 * worst),
                            n => format!("{:.1} %, {n}", 100.0 * worst),
                        },
                    );
                }
            }
        }
        for missing in &self.missing {
            let _ = writeln!(out, "\nMissing: {}: {}", missing.name, missing.reason);
        }
        out
    }

    /// The table as CSV: a line for every way of every case.
    pub(crate) fn to_csv(&self) -> String {
        let mut out =
            "name,held_out,within,packings,spp,way,ratio_r,ratio_g,ratio_b,blocks,block_noise,relmse,relmse_8,flip,\
                       mean_r,mean_g,mean_b,mean_error_r,mean_error_g,mean_error_b\n"
                .to_owned();
        let number = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
        for row in &self.rows {
            for Way { name, error, blocks } in &row.ways {
                let mut cells = vec![quoted(&row.name), row.held_out.to_string(), row.within.to_string()];
                cells.extend([row.packings.to_string(), row.spp.to_string(), quoted(name)]);
                cells.extend(error.mean_ratio.map(|v| v.to_string()));
                cells.extend(
                    [*blocks, row.block_noise, Some(error.relmse), error.relmse_8, Some(error.flip)].map(number),
                );
                cells.extend(row.mean.iter().chain(&row.mean_error).map(f64::to_string));
                out += &(cells.join(",") + "\n");
            }
        }
        out
    }

    /// The table as JSON.
    pub(crate) fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("numbers and text become JSON") + "\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(name: &str, held_out: bool, ratio: [f64; 3], mean: [f64; 3]) -> Row {
        let error = ModelError { mean_ratio: ratio, relmse: 0.1, relmse_8: Some(0.01), flip: 0.2 };
        Row {
            name: name.to_owned(),
            held_out,
            within: 0.05,
            packings: 4,
            spp: 64.0,
            mean,
            mean_error: mean.map(|m| 0.01 * m),
            block_noise: Some(0.02),
            ways: vec![Way { name: "yarn".to_owned(), error, blocks: Some(0.1) }],
        }
    }

    #[test]
    fn only_channels_with_light_decide_and_both_halves_are_told_apart() {
        let table = Table {
            title: "T".to_owned(),
            suite: "s.toml".to_owned(),
            commit: "c".to_owned(),
            reference: "fiber".to_owned(),
            packings: 4,
            rows: vec![
                row("a", false, [1.04, 0.96, 1.5], [1.0, 1.0, 0.01]),
                Row { packings: 1, ..row("b", true, [1.04, 0.96, 1.5], [1.0, 1.0, 0.5]) },
            ],
            missing: vec![Missing { name: "m".to_owned(), reason: "gone".to_owned() }],
        };
        let text = table.to_markdown();
        assert!(text.contains("| seen in development | yarn | 1 | 1 | 0 | 0.100 |"), "{text}");
        assert!(text.contains("| held out | yarn | 1 | 0 | 1 | 0.100 |"), "{text}");
        assert!(text.contains("| b | yarn | 1.040 0.960 1.500 | 0.100, 0.020 | 0.0100 | 0.200 | 1.0 %, 1 |"), "{text}");
        assert!(text.contains("over 4 packings of the fibres"), "{text}");
        assert!(text.contains("Missing: m: gone"));
        assert_eq!(serde_json::from_str::<Table>(&table.to_json()).unwrap(), table);
        let csv = table.to_csv();
        let lines: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
        assert!(lines.len() == 3 && lines.iter().all(|cells| cells.len() == lines[0].len()), "{csv}");
        assert_eq!(lines[2][..10], ["\"b\"", "true", "0.05", "1", "64", "\"yarn\"", "1.04", "0.96", "1.5", "0.1"]);
    }
}
