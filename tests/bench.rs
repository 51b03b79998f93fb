//! `yarnray bench`: a small suite from end to end, and what is wrong with suites.
//!
//! Two models of yarns stand for fibres and yarns here: what is tested is the procedure.

use serde_json::Value;

use crate::support::{SWATCH, directory, listing, read_json, write, yarnray};

const SUITE: &str = r#"
title = "A small table"
reference = "yarn:two-stream"
tested = "yarn:aggregated"
target = 0.05
repeats = 2
converged = 2

[quick]
target = 0.1
repeats = 1
rows = ["swatch"]

[lighting.sky]
set = ["light=[{type=\"environment\", radiance=1}]"]
[lighting.front]
set = ["light=[{type=\"distant\", towards=[0.3, 0.2, 1], irradiance=3}]"]

[[other]]
name = "the paper's model"
method = "yarn:paper"

[[row]]
name = "swatch"
scene = "s.toml"
lights = ["sky", "front"]
paper = { seconds = [187, 29], megabytes = [210, 1.8], bounces = [12.4, 1.6] }

[[row]]
name = "glove"
scene = "s.toml"
curves = "none.bcc"
lights = ["front"]

[converge]
rows = ["swatch, front"]
seeds = 2
spp = 7
seconds = 5
converged_spp = 16
"#;

/// A suite of fidelity writes its table in three forms, and no page.
#[test]
fn a_small_suite_of_fidelity_from_end_to_end() {
    let directory = directory();
    let d = directory.path();
    write(d, "s.toml", SWATCH);
    let suite = "title = \"Small\"\nmeasure = \"fidelity\"\nreference = \"yarn:two-stream\"\ntested = \"yarn:aggregated\"\nmax_spp = 2\n\
                 [lighting.sky]\nwithin = 0.05\nset = [\"light=[{type=\\\"environment\\\", radiance=1}]\"]\n\
                 [[row]]\nname = \"swatch\"\nscene = \"s.toml\"\nlights = [\"sky\"]\n";
    write(d, "suite.toml", suite);
    let run = yarnray(d, &["bench", "suite.toml", "-o", "out"]).good();
    let files = listing(&d.join("out"));
    assert!(
        ["table.csv", "table.json", "table.md"].iter().all(|name| files.iter().any(|file| file == name)),
        "{files:?}"
    );
    assert!(files.iter().all(|file| file != "report.html"), "{files:?}");
    let csv = std::fs::read_to_string(d.join("out/table.csv")).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    assert!(lines.len() == 2 && lines[0].starts_with("name,held_out,"), "{csv}");
    assert!(lines[1].starts_with("\"swatch, sky\",false,0.05,"), "{csv} {}", run.stdout);
}

#[test]
fn a_small_suite_from_end_to_end() {
    let directory = directory();
    let d = directory.path();
    write(d, "s.toml", SWATCH);
    write(d, "suite.toml", SUITE);
    let run = yarnray(d, &["bench", "suite.toml", "-o", "out"]).good();
    assert!(run.stdout.starts_with("# A small table\n") && run.stdout.contains("| swatch, front | "), "{}", run.stdout);
    assert!(run.stdout.contains("Missing: glove: none.bcc is not there"), "{}", run.stdout);
    assert_eq!(listing(&d.join("out")), ["cache", "report.html", "rows", "table.csv", "table.json", "table.md"]);
    let table = read_json(&d.join("out/table.json"));
    assert_eq!(table["target"], 0.05);
    let rows = table["rows"].as_array().unwrap();
    assert_eq!(rows.iter().map(|r| r["name"].as_str().unwrap()).collect::<Vec<_>>(), ["swatch, sky", "swatch, front"]);
    for row in rows {
        for side in ["reference", "aggregated"] {
            let run = &row[side];
            let number = |key: &str| run[key].as_f64().unwrap_or_else(|| panic!("{key} of {run}"));
            for key in ["render_seconds", "geometry_bytes", "bvh_bytes", "spp", "rays"] {
                assert!(number(key) > 0.0, "{key} of {run}");
            }
            assert!(number("peak_rss_bytes") > number("geometry_bytes") + number("bvh_bytes"));
            assert!(number("mean_bounces") >= 1.0);
            // The runs are near the target, so that scaling by their error says little: 0.034 to 0.177 measured at one to
            // three samples a pixel, where single bright pixels count.
            for error in run["timed_relmse"].as_array().unwrap() {
                let error = error.as_f64().unwrap();
                assert!(error > 0.015 && error < 0.2, "{error}");
            }
        }
        // The same cloth, the same curves.
        assert_eq!(row["memory_ratio"], 1.0);
        // Two streams return more light of a sun in front than the lobes do: measured 1.020 to 1.069 under the sky and 1.299 to
        // 1.337 in front, FLIP 0.061 and 0.185, the same in every run: what is allowed beyond is for other processors.
        let (means, flip) = if row["name"] == "swatch, sky" { (0.97..1.09, 0.07) } else { (1.25..1.38, 0.21) };
        let ratios = row["model_error"]["mean_ratio"].as_array().unwrap();
        assert!(ratios.iter().all(|r| means.contains(&r.as_f64().unwrap())), "{row}");
        assert!(row["model_error"]["flip"].as_f64().unwrap() < flip, "{row}");
        assert_eq!(row["others"][0]["name"], "the paper's model");
    }
    let page = std::fs::read_to_string(d.join("out/report.html")).unwrap();
    assert!(page.contains("<svg") && page.contains("swatch, sky") && !page.contains("http://localhost"));

    // All of it is kept: once more, nothing is rendered. A row that is lost is measured again, from pictures that are kept.
    let rows = || listing(&d.join("out/rows")).into_iter().filter(|n| n.ends_with(".json")).collect::<Vec<_>>();
    let again = yarnray(d, &["bench", "suite.toml", "-o", "out"]).good();
    assert!(
        !again.stderr.contains("timed run") && again.stderr.matches("measured before").count() == 2,
        "{}",
        again.stderr
    );
    assert_eq!(again.stdout, run.stdout);
    std::fs::remove_file(d.join("out/rows").join(&rows()[0])).unwrap();
    let resumed = yarnray(d, &["bench", "suite.toml", "-o", "out"]).good();
    assert_eq!(resumed.stderr.matches("timed run").count(), 4, "{}", resumed.stderr);
    assert!(resumed.stderr.matches("measured before").count() == 1 && !resumed.stderr.contains("converged picture"));
    assert_eq!(rows().len(), 2);

    let quick = yarnray(d, &["bench", "suite.toml", "-o", "quick", "--quick", "--row", "sky", "-q"]).good();
    assert_eq!(quick.stderr, "");
    let table: Value = read_json(&d.join("quick/table.json"));
    assert_eq!((&table["target"], table["rows"].as_array().unwrap().len()), (&Value::from(0.1), 1));
}

#[test]
fn mistakes_in_suites_are_shown_where_they_are() {
    let directory = directory();
    let d = directory.path();
    write(d, "s.toml", SWATCH);
    for (from, to, message) in [
        (
            "reference = \"yarn:two-stream\"",
            "reference = \"yarn:two-steam\"",
            "suite.toml:3:13: error: unknown model `two-steam`; known are ",
        ),
        ("target = 0.05", "target = 0", "suite.toml:5:10: error: `target` must be above 0, found 0\n"),
        ("repeats = 2", "repeat = 2", "suite.toml:6:1: error: unknown key `repeat`\n"),
        ("lights = [\"sky\", \"front\"]", "lights = [\"sly\"]", "error: unknown lighting \"sly\"\n"),
        ("rows = [\"swatch\"]", "rows = [\"swotch\"]", "error: unknown row \"swotch\"\n"),
        (
            "rows = [\"swatch, front\"]",
            "rows = [\"swatch, back\"]",
            "error: unknown row and lighting \"swatch, back\"\n",
        ),
        ("name = \"glove\"", "name = \"swatch\"", "error: two rows are called \"swatch\"\n"),
        ("bounces = [12.4, 1.6]", "bounces = [12.4]", "expected an array of 2 numbers, found 1 in the array\n"),
        ("method = \"yarn:paper\"", "", "error: missing key `method` in [[other]] 1\n"),
        ("light=[{type", "lights=[{type", "row \"swatch, sky\" by yarn:two-stream does not load:\n"),
    ] {
        let text = SUITE.replacen(from, to, 1);
        assert_ne!(text, SUITE, "{from}");
        write(d, "suite.toml", text);
        let run = yarnray(d, &["bench", "suite.toml", "-q"]);
        assert_eq!((run.status, run.stdout.as_str()), (Some(2), ""), "{from}: {}", run.stderr);
        assert!(run.stderr.contains(message), "{from}:\n{}", run.stderr);
    }
    let run = yarnray(d, &["bench", "none.toml"]);
    assert_eq!((run.status, run.stderr.as_str()), (Some(2), "none.toml: error: no such file\n"));
    write(d, "suite.toml", SUITE);
    write(d, "long.toml", SUITE.split("[quick]").next().unwrap());
    let run = yarnray(d, &["bench", "long.toml", "--quick"]);
    assert!(run.status == Some(2) && run.stderr.contains("`--quick` needs a table [quick]"), "{}", run.stderr);
    let run = yarnray(d, &["bench", "suite.toml", "--row", "nothing"]);
    assert_eq!((run.status, run.stderr.as_str()), (Some(2), "error: no row of suite.toml contains nothing\n"));
}
