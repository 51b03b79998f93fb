//! Outputs that fail, clash or have nowhere to go: no panic, no lost work, nothing written over.

use std::{
    fs::File,
    path::Path,
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use serde_json::Value;
use yarnray::image;

use crate::support::{SWATCH, directory, listing, program, write, yarnray};

/// A directory with a small scene, `s.toml`.
fn swatch() -> tempfile::TempDir {
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    directory
}

fn full() -> Stdio {
    Stdio::from(File::options().write(true).open("/dev/full").expect("/dev/full"))
}

fn words(text: &str) -> Vec<&str> {
    text.split_whitespace().collect()
}

/// A log that cannot be written is dropped; the picture is made.
#[test]
#[cfg(target_os = "linux")]
fn a_lost_log_loses_no_render() {
    for options in ["", "-v", "-vv", "--log-json"] {
        let d = swatch();
        let args = format!("render s.toml --spp 2 -o s.exr -o new/s.png {options}");
        let status = program(d.path()).args(words(&args)).stderr(full()).status().unwrap();
        assert_eq!(status.code(), Some(0), "{options}");
        assert_eq!(listing(d.path()), ["new", "s.exr", "s.toml"], "{options}");
        image::read(&d.path().join("s.exr")).unwrap();
    }
    let d = swatch();
    for args in ["make knit --stitches 4 --rows 4 -o k.txt", "make weave --warps 4 --wefts 4 -o w.txt"] {
        let status = program(d.path()).args(words(args)).stderr(full()).status().unwrap();
        assert_eq!(status.code(), Some(0), "{args}");
    }
    // An error has nowhere to go either: its exit status remains.
    let status = program(d.path()).args(["render", "none.toml"]).stderr(full()).status().unwrap();
    assert_eq!(status.code(), Some(2));
}

/// `| head -1`: whoever reads goes away after the first line, or before it.
#[test]
#[cfg(unix)]
fn a_closed_pipe_ends_quietly() {
    let d = swatch();
    write(d.path(), "w.txt", "0 0 0 1\n1 0 0 1\n2 1 0 1\n");
    let scatter = "scatter silk1 --samples 100 --sweep theta=0..60:3";
    for args in ["info s.toml", "info s.toml --json", "info w.txt", "stress --list", scatter, "--help"] {
        let mut child =
            program(d.path()).args(words(args)).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!(String::from_utf8_lossy(&output.stderr), "", "{args}");
        assert_eq!(output.status.code(), Some(0), "{args}");
    }
    let script = format!("'{}' render s.toml -vv --spp 4 -o s.exr 2>&1 | head -1", env!("CARGO_BIN_EXE_yarnray"));
    let status =
        Command::new("bash").args(["-c", &script]).current_dir(d.path()).stdout(Stdio::null()).status().unwrap();
    assert!(status.success());
    image::read(&d.path().join("s.exr")).expect("the picture is made after the pipe has closed");
}

/// What was asked for cannot be lost unnoticed.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_behind_standard_output_is_an_error() {
    let d = swatch();
    for args in ["info s.toml", "info s.toml --json", "stress --list"] {
        let output = program(d.path()).args(words(args)).stdout(full()).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{args}");
        assert_eq!(String::from_utf8_lossy(&output.stderr), "error: cannot write standard output: the disk is full\n");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn one_failed_output_drops_no_other() {
    let d = swatch();
    let d = d.path();
    let run = yarnray(d, &words("render s.toml --spp 2 -o /dev/full -o a.exr"));
    assert_eq!(run.status, Some(2), "a device has no extension: {}", run.stderr);
    std::os::unix::fs::symlink("/dev/full", d.join("full.png")).unwrap();
    std::os::unix::fs::symlink("/dev/full", d.join("full.json")).unwrap();
    let run = yarnray(d, &words("render s.toml --spp 2 -q -o full.png -o a.exr --stats full.json -o b.png"));
    assert_eq!(run.status, Some(2));
    assert_eq!(
        run.stderr,
        "error: cannot write full.png: the disk is full\nerror: cannot write full.json: the disk is full\n"
    );
    assert_eq!(listing(d), ["a.exr", "b.png", "full.json", "full.png", "s.toml"]);
    image::read(&d.join("a.exr")).unwrap();
    yarnray(d, &words("render s.toml --spp 2 -q -o a.film")).good();
    let run = yarnray(d, &words("merge a.film -q -o full.png -o m.exr"));
    assert_eq!((run.status, run.stderr.as_str()), (Some(2), "error: cannot write full.png: the disk is full\n"));
    image::read(&d.join("m.exr")).unwrap();
}

#[test]
fn two_names_of_one_file_are_refused_before_any_work() {
    let d = swatch();
    let d = d.path();
    std::fs::create_dir(d.join("sub")).unwrap();
    yarnray(d, &words("render s.toml --spp 2 -q --shard 1/2 -o p1.film")).good();
    yarnray(d, &words("render s.toml --spp 2 -q --shard 2/2 -o p2.film")).good();
    write(d, "w.txt", "0 0 0 1\n1 0 0 1\n2 1 0 1\n");
    let before = listing(d);
    let part = std::fs::read(d.join("p1.film")).unwrap();
    let scene = std::fs::read(d.join("s.toml")).unwrap();
    for (args, roles) in [
        ("render s.toml -o o.png --stats o.png", ["-o o.png", "--stats o.png"]),
        ("render s.toml -o o.png --stats sub/../o.png", ["-o o.png", "--stats sub/../o.png"]),
        ("render s.toml -o o.png --checkpoint o.png", ["-o o.png", "--checkpoint o.png"]),
        ("render s.toml -o o.png -o o.png", ["-o o.png", "-o o.png"]),
        ("render s.toml -o o.png --stats s.toml", ["SCENE s.toml", "--stats s.toml"]),
        ("render s.toml --curves w.txt -o o.png --stats w.txt", ["--curves w.txt", "--stats w.txt"]),
        ("render s.toml --denoise -o a.png -o a.denoised.png", ["-o a.denoised.png", "--denoise a.denoised.png"]),
        ("merge p1.film p2.film -o p1.film", ["PART p1.film", "-o p1.film"]),
        ("make knit --stitches 4 --rows 4 -o k.txt -o ./k.txt", ["-o k.txt", "-o ./k.txt"]),
    ] {
        let run = yarnray(d, &words(args));
        assert_eq!(run.status, Some(2), "{args}");
        let message =
            format!("error: {} and {} name the same file\n  hint: give each its own name\n", roles[0], roles[1]);
        assert_eq!(run.stderr, message, "{args}");
    }
    assert_eq!(listing(d), before);
    assert!(std::fs::read(d.join("p1.film")).unwrap() == part);
    assert!(std::fs::read(d.join("s.toml")).unwrap() == scene);
}

#[test]
fn a_folder_that_is_made_is_told() {
    let d = swatch();
    let run = yarnray(d.path(), &words("render s.toml --spp 1 -o deep/er/o.png")).good();
    assert!(run.stderr.contains("made the folder deep/er\n"), "{}", run.stderr);
    let run = yarnray(d.path(), &words("render s.toml --spp 1 -o deep/er/o.png")).good();
    assert!(!run.stderr.contains("made the folder"), "{}", run.stderr);
    let run = yarnray(d.path(), &words("make weave --warps 3 --wefts 3 -o there/w.bcc")).good();
    assert!(run.stderr.starts_with("made the folder there\n"), "{}", run.stderr);
    let run = yarnray(d.path(), &words("make weave --warps 3 --wefts 3 -q -o here/w.bcc")).good();
    assert_eq!(run.stderr, "");
}

/// A terminal that closes ends a render as TERM does; under `nohup` it goes on.
#[test]
#[cfg(target_os = "linux")]
fn a_terminal_that_closes_saves_unless_it_is_ignored() {
    fn ends_by(d: &Path, before: &str, spp: u32) -> Option<i32> {
        let script = format!(
            "{before} '{}' render s.toml -q --spp {spp} --checkpoint c.film --checkpoint-every 0.05 -o s.exr & pid=$!
             until [ -e c.film ]; do sleep 0.02; done
             kill -HUP $pid; wait $pid",
            env!("CARGO_BIN_EXE_yarnray")
        );
        let mut shell = Command::new("timeout");
        shell.args(["60", "bash", "-c", &script]).current_dir(d).stderr(Stdio::null()).stdout(Stdio::null());
        shell.status().unwrap().code()
    }
    let d = swatch();
    assert_eq!(ends_by(d.path(), "", 100_000_000), Some(129));
    image::read(&d.path().join("s.exr")).expect("what was rendered is saved");
    let d = swatch();
    assert_eq!(ends_by(d.path(), "nohup", 300), Some(0));
    let picture = image::read(&d.path().join("s.exr")).unwrap();
    assert!(picture.channel("samples.count").unwrap().iter().all(|&n| n == 300.0));
}

#[test]
fn memory_is_told_and_too_much_is_refused_at_once() {
    let d = swatch();
    let d = d.path();
    let info = |args: &str| -> Value {
        let run = yarnray(d, &words(&format!("info s.toml --json {args}"))).good();
        serde_json::from_str(&run.stdout).unwrap()
    };
    let memory = &info("--width 3840 --height 2160")["memory"];
    let film = memory["film_bytes"].as_u64().unwrap();
    assert!((144..150).contains(&(film / (3840 * 2160))), "{memory}");
    let denoised = &info("--width 100 --height 50 --set output.denoise=true")["memory"];
    assert_eq!(denoised["denoiser_bytes"], 100 * 50 * 48);
    let text = yarnray(d, &words("info s.toml --width 1920 --height 1080")).good().stdout;
    assert!(text.contains(" of BVH, 30") && text.contains(" MB of film\n"), "{text}");
    // The widest picture there is, with a film of 600 GB.
    let started = Instant::now();
    let run = yarnray(d, &words("render s.toml --width 65536 --height 65536 --max-memory 20 -o o.exr"));
    assert_eq!(run.status, Some(2));
    assert!(run.stderr.starts_with("error: 65536 x 65536 pixels need 6"), "{}", run.stderr);
    assert!(run.stderr.contains(" GB of film; all may take 20.00 GB\n  hint: --crop renders a part"), "{}", run.stderr);
    assert!(started.elapsed() < Duration::from_secs(10), "{:?}", started.elapsed());
    assert_eq!(listing(d), ["s.toml"]);
    let text = yarnray(d, &words("info s.toml --width 65536 --height 65536 --max-memory 20")).good().stdout;
    assert!(text.contains("more than the 20.00 GB that it may take"), "{text}");
    // Curves, BVH and film together.
    let film = info("")["memory"]["film_bytes"].as_u64().unwrap();
    let run = yarnray(d, &words(&format!("render s.toml --max-memory {} -o o.exr", (film + 1000) as f64 / 1e9)));
    assert_eq!(run.status, Some(2));
    assert!(run.stderr.contains(" kB of film and textures), but may take "), "{}", run.stderr);
}

/// A gigabyte of address space, and a film of five: no abort.
#[test]
#[cfg(target_os = "linux")]
fn an_allocation_that_fails_is_an_error() {
    let d = swatch();
    let script = format!(
        "ulimit -v 1000000; exec '{}' render s.toml -q -j 1 --width 8000 --height 8000 --max-memory 1000 -o o.png",
        env!("CARGO_BIN_EXE_yarnray")
    );
    let output = Command::new("bash").args(["-c", &script]).current_dir(d.path()).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.starts_with("error: no memory for a film of 5."), "{text}");
    assert_eq!(listing(d.path()), ["s.toml"]);
}
