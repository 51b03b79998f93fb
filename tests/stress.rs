//! `yarnray stress`: its promises to scripts.

use crate::support::{directory, listing, read_json, yarnray};

#[test]
fn stress_runs_cases_and_reports_them() {
    let directory = directory();
    let args = ["stress", "--quick", "--case", "closed_forms", "--case", "threads", "-o", "r.md", "-o", "r.json"];
    let run = yarnray(directory.path(), &args).good();
    assert!(run.stdout.contains("pass  closed_forms") && run.stdout.contains("0 failed"), "{}", run.stdout);
    assert_eq!(listing(directory.path()), ["r.json", "r.md"]);
    let report = read_json(&directory.path().join("r.json"));
    assert_eq!(report["passed"], true);
    assert_eq!(report["cases"].as_array().unwrap().len(), 2);
    for case in report["cases"].as_array().unwrap() {
        for check in case["checks"].as_array().unwrap() {
            assert!(check["worst"].is_number() && check["bound"].is_number() && check["count"].as_u64() > Some(0));
        }
    }
    let markdown = std::fs::read_to_string(directory.path().join("r.md")).unwrap();
    assert!(markdown.contains("| **closed_forms**") && markdown.contains("| pass |"), "{markdown}");
}

/// What one file's disk refuses, another's takes, and the terminal.
#[test]
#[cfg(target_os = "linux")]
fn a_report_that_cannot_be_written_loses_no_other() {
    let directory = directory();
    let d = directory.path();
    std::os::unix::fs::symlink("/dev/full", d.join("full.md")).unwrap();
    let run = yarnray(d, &["stress", "--quick", "--case", "threads", "-o", "full.md", "-o", "r.json"]);
    assert!(run.status == Some(2) && run.stderr.contains("cannot write full.md"), "{}", run.stderr);
    assert!(run.stdout.contains("0 failed") && read_json(&d.join("r.json"))["passed"] == true, "{}", run.stdout);
}

#[test]
fn stress_refuses_cases_that_it_does_not_have() {
    let directory = directory();
    for (args, word) in [
        (["stress", "--case", "closed_form"], "did you mean \"closed_forms\"?"),
        (["stress", "-o", "x.txt"], ".md or .json"),
    ] {
        let run = yarnray(directory.path(), &args);
        assert_eq!(run.status, Some(2), "{}", run.stderr);
        assert!(run.stderr.contains(word), "{}", run.stderr);
    }
    assert_eq!(listing(directory.path()), [""; 0]);
}

#[test]
fn the_program_is_not_linked_with_what_only_some_scenes_need() {
    // OpenImageIO and Open Image Denoise are loaded when a scene asks for them, if at all.
    let Ok(listed) = std::process::Command::new("ldd").arg(env!("CARGO_BIN_EXE_yarnray")).output() else {
        crate::support::skipped("there is no ldd");
        return;
    };
    let text = String::from_utf8_lossy(&listed.stdout).to_lowercase();
    assert!(text.contains("embree"), "{text}");
    assert!(!text.contains("openimageio") && !text.contains("openimagedenoise"), "{text}");
}
