//! Every command that the program or its documents print, run in a cheap form: few samples, small pictures.
//!
//! Commands are collected by themselves: the examples of each `--help`, whatever begins with `yarnray` in code of the
//! README and of docs, and in comments of scenes. Files that a command reads and nobody has written before it are made up.

use std::{collections::BTreeSet, path::Path, process::Command, sync::LazyLock};

use yarnray::pattern::{chart::PATTERNS, draft::NAMES};

use crate::support::{SWATCH, directory, program, project, scenes, write, yarnray};

/// Options whose value is written, not read.
const OUTPUTS: [&str; 6] = ["-o", "--out", "--stats", "--checkpoint", "--cache", "--display"];

/// Seconds from which on a command is named, so that a slow one is found.
const SLOW: u64 = 2;

/// Whether there is a denoiser on this machine.
static DENOISER: LazyLock<bool> = LazyLock::new(|| {
    let d = directory();
    write(d.path(), "s.toml", SWATCH);
    yarnray(d.path(), &["render", "s.toml", "-q", "--spp", "1", "--denoise", "-o", "s.png"]).status == Some(0)
});

/// The commands of a command's help, and of those within it.
fn examples_of_help(command: &[&str], out: &mut Vec<(String, Vec<String>)>) {
    let d = directory();
    // Wide enough for every line: help is wrapped.
    let output =
        program(d.path()).args(command).arg("--help").env("COLUMNS", "400").output().expect("the program starts");
    assert!(output.status.success(), "{command:?}");
    let help = String::from_utf8(output.stdout).expect("UTF-8");
    let within = |title: &str| -> Vec<String> {
        let lines = help.lines().skip_while(|l| l.trim() != title).skip(1);
        lines.map_while(|l| l.strip_prefix("  ").map(str::to_owned)).collect()
    };
    let examples = within("Examples:").iter().filter(|l| l.starts_with("yarnray ")).map(|l| alone(l)).collect();
    out.push((format!("yarnray {} --help", command.join(" ")), examples));
    for line in within("Commands:") {
        let name = line.split_whitespace().next().unwrap_or_default();
        if !name.is_empty() && name != "help" && !line.starts_with(' ') {
            examples_of_help(&[command, &[name]].concat(), out);
        }
    }
}

/// A command without the words about it, which two spaces set apart.
fn alone(line: &str) -> String {
    line.trim().split("  ").next().unwrap_or_default().to_owned()
}

/// The commands of a document: lines of code, and code within lines. Those with placeholders in capitals are passed over.
fn examples_of_document(text: &str) -> Vec<String> {
    let mut out = Vec::new();
    let mut fenced = false;
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
            continue;
        }
        let code = fenced || line.starts_with("    ");
        let command = line.trim().trim_start_matches("target/release/");
        if code && command.starts_with("yarnray ") {
            let mut command = alone(command);
            while let Some(start) = command.strip_suffix('\\') {
                command = format!("{start}{}", lines.next().unwrap_or_default().trim());
            }
            out.push(alone(&command));
        } else if !code {
            out.extend(line.split('`').skip(1).step_by(2).filter(|c| c.starts_with("yarnray ")).map(str::to_owned));
        }
    }
    let capitals = |c: &String| c.as_bytes().windows(3).any(|w| w.iter().all(u8::is_ascii_uppercase));
    // What is named only, such as `yarnray make knit`, has neither option nor file.
    let whole = |c: &String| c.split_whitespace().skip(2).any(|w| w.starts_with('-') || w.contains('.'));
    out.retain(|c| !capitals(c) && !c.contains("...") && whole(c));
    out
}

/// The commands that the comments of a scene name, each on a line of its own.
fn examples_of_scene(text: &str) -> Vec<String> {
    let comments = text.lines().filter_map(|l| l.strip_prefix('#')).map(str::trim);
    comments.filter(|c| c.starts_with("yarnray ")).map(alone).collect()
}

/// The words of a command as a shell makes them.
fn words(directory: &Path, command: &str) -> Vec<String> {
    let script = format!("printf '%s\\0' {command}");
    let output = Command::new("bash").args(["-c", &script]).current_dir(directory).output().expect("bash");
    assert!(output.status.success(), "{command}");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    text.split_terminator('\0').map(str::to_owned).collect()
}

/// Removes an option with its value.
fn without(words: &mut Vec<String>, option: &str) -> bool {
    let Some(i) = words.iter().position(|w| w == option) else { return false };
    words.drain(i..(i + 2).min(words.len()));
    true
}

fn with(words: &mut Vec<String>, more: &str) {
    words.extend(more.split_whitespace().map(str::to_owned));
}

/// The same crop of an eighth of the pixels each way, where the command says of how many it is.
fn smaller(words: &mut [String]) {
    let value_of = |option: &str| words.iter().position(|w| w == option).map(|i| i + 1).filter(|i| *i < words.len());
    let [Some(width), Some(height), Some(crop)] = ["--width", "--height", "--crop"].map(value_of) else { return };
    for place in [width, height, crop] {
        let eighth = |number: &str| number.parse::<u32>().map_or(number.to_owned(), |n| (n / 8).to_string());
        words[place] = words[place].split(',').map(eighth).collect::<Vec<_>>().join(",");
    }
}

/// What makes two commands the same: the name of a picture does not.
fn told_apart(words: &[String]) -> Vec<String> {
    let named = |i: usize, word: &str| i > 0 && words[i - 1] == "-o" && word.ends_with(".png");
    let words = words.iter().enumerate();
    words.map(|(i, word)| if named(i, word) { "x.png".to_owned() } else { word.clone() }).collect()
}

/// The same command with little work, without the program's name.
fn cheap(mut words: Vec<String>) -> Vec<String> {
    words.remove(0);
    match words[0].as_str() {
        "render" => {
            let shard = words.iter().any(|w| w == "--shard");
            ["--spp", "--time", "--noise", "--display", "--max-bounces"]
                .iter()
                .for_each(|o| _ = without(&mut words, o));
            if without(&mut words, "--frames") {
                with(&mut words, "--frames 1..2");
            }
            if words.iter().any(|w| w == "--crop") {
                smaller(&mut words);
            } else {
                ["--width", "--height"].iter().for_each(|o| _ = without(&mut words, o));
                with(&mut words, "--width 24 --height 18");
            }
            if !*DENOISER {
                words.retain(|w| w != "--denoise");
            }
            with(&mut words, if shard { "--spp 3" } else { "--spp 1" });
            with(&mut words, "--max-bounces 4 -q");
        }
        "scatter" => {
            if without(&mut words, "--truth") {
                with(&mut words, "--truth 50");
            }
            for word in &mut words {
                if let Some((range, _)) = word.clone().rsplit_once(':').filter(|(range, _)| range.contains("..")) {
                    *word = format!("{range}:2");
                }
            }
            without(&mut words, "--samples");
            with(&mut words, "--samples 100");
        }
        "converge" => {
            for option in ["--width", "--height", "--spp", "--seeds", "--converged-spp"] {
                without(&mut words, option);
            }
            words[1] = "tiny.toml".to_owned();
            with(&mut words, "--width 8 --height 6 --spp 2 --seeds 2 --converged-spp 2 --max-bounces 4 -q");
        }
        // Arguments and suite are read, then no row is found.
        "bench" => {
            without(&mut words, "--row");
            words.extend(["--row".to_owned(), "no row has this name".to_owned()]);
        }
        "stress" => with(&mut words, "--list"),
        "make" if words[1] == "fibers" => {
            without(&mut words, "-o");
            words.retain(|w| w != "--estimate");
            with(&mut words, "--estimate");
        }
        _ => {}
    }
    words
}

/// Makes the files that a command reads and that are not there.
fn provide(directory: &Path, words: &[String]) {
    let place = |name: &str| directory.join(name);
    for (i, word) in words.iter().enumerate() {
        if word.starts_with('-') || (i > 0 && OUTPUTS.contains(&words[i - 1].as_str())) || place(word).exists() {
            continue;
        }
        let quiet = |args: &str| {
            yarnray(directory, &args.split_whitespace().collect::<Vec<_>>()).good();
        };
        match Path::new(word).extension().and_then(|e| e.to_str()) {
            Some("toml") if !word.contains('=') => _ = write(directory, word, SWATCH),
            Some("bcc" | "hair" | "txt" | "obj") => {
                quiet(&format!("make knit --stitches 4 --rows 4 --radius 0.05 --quiet -o {word}"));
            }
            Some("exr") => quiet(&format!("render tiny.toml -q --spp 2 -o {word}")),
            _ => {}
        }
    }
}

/// A scene and the films that `merge` and `info` are shown with.
fn shown() -> tempfile::TempDir {
    let d = directory();
    write(d.path(), "tiny.toml", SWATCH);
    let render = |args: &str| {
        let args = format!("render tiny.toml -q --spp 3 {args}");
        yarnray(d.path(), &args.split_whitespace().collect::<Vec<_>>()).good();
    };
    (1..=3).for_each(|i| render(&format!("--shard {i}/3 -o part{i}.film")));
    render("-o frame.film");
    render("--crop 0,0,20,36 -o left.film");
    render("--crop 20,0,48,36 -o right.film");
    d
}

/// A directory in which examples can run, with what they are shown with.
fn place(shown: &Path) -> tempfile::TempDir {
    let d = directory();
    for name in ["scenes", "tools"] {
        #[cfg(unix)]
        std::os::unix::fs::symlink(project(name), d.path().join(name)).expect("a link");
    }
    for file in std::fs::read_dir(shown).expect("a directory").map(|e| e.expect("an entry")) {
        std::fs::copy(file.path(), d.path().join(file.file_name())).expect("a copy");
    }
    d
}

/// Whether a cheap command does no more than to render a scene of the project, as `tests/scenes.rs` does with all of them: a part of the picture
/// takes as long to lay out as the whole.
fn renders_a_scene(words: &[String]) -> bool {
    let mut words = words.to_vec();
    for option in ["-o", "--width", "--height", "--crop", "--spp", "--max-bounces"] {
        without(&mut words, option);
    }
    words.retain(|w| w != "-q");
    matches!(&words[..], [render, scene] if render == "render" && scene.starts_with("scenes/") && project(scene).exists())
}

/// Runs commands one after the other in one directory; gives what went wrong.
fn run_all(title: &str, commands: &[String], shown: &Path, seen: &mut BTreeSet<Vec<String>>) -> Vec<String> {
    let mut problems = Vec::new();
    if commands.is_empty() {
        return problems;
    }
    let d = place(shown);
    for command in commands {
        let words = cheap(words(d.path(), command));
        if !seen.insert(told_apart(&words)) || renders_a_scene(&words) {
            continue;
        }
        provide(d.path(), &words);
        let began = std::time::Instant::now();
        let output = program(d.path()).args(&words).output().expect("the program starts");
        if began.elapsed().as_secs() >= SLOW {
            eprintln!("{:.1} s: {}", began.elapsed().as_secs_f64(), words.join(" "));
        }
        let stderr = String::from_utf8_lossy(&output.stderr);
        let good = match words[0].as_str() {
            "bench" => output.status.code() == Some(2) && stderr.contains("no row of"),
            // A threshold may be broken.
            "compare" => matches!(output.status.code(), Some(0 | 1)),
            _ => output.status.code() == Some(0),
        };
        if !good {
            problems.push(format!("{title}: {command}\n  run as: {}\n  {}", words.join(" "), stderr.trim()));
        }
    }
    problems
}

#[test]
fn every_printed_command_runs() {
    let mut all = Vec::new();
    examples_of_help(&[], &mut all);
    let mut documents = vec![project("README.md")];
    let entries = std::fs::read_dir(project("docs")).expect("docs").map(|e| e.expect("an entry").path());
    documents.extend(entries.filter(|p| p.extension().is_some_and(|e| e == "md")));
    documents.sort();
    for path in &documents {
        let text = std::fs::read_to_string(path).expect("a document");
        all.push((path.file_name().unwrap_or_default().to_string_lossy().into_owned(), examples_of_document(&text)));
    }
    for path in scenes(&project("scenes")) {
        let text = std::fs::read_to_string(&path).expect("a scene");
        all.push((path.display().to_string(), examples_of_scene(&text)));
    }
    let mut seen = BTreeSet::new();
    let shown = shown();
    let run = |(title, commands): &(String, Vec<String>)| run_all(title, commands, shown.path(), &mut seen);
    let problems: Vec<String> = all.iter().flat_map(run).collect();
    eprintln!("{} commands of {} texts", seen.len(), all.iter().filter(|(_, c)| !c.is_empty()).count());
    assert!(seen.len() >= 60, "only {} commands were found", seen.len());
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

#[test]
fn commands_are_found_in_documents() {
    let text = "Run `yarnray info a.toml` or `yarnray render NAME.toml`.\n\n    yarnray merge 1.film \\\n        -o a.exr   on one machine\n\n```\ntarget/release/yarnray info b.toml\ncargo build\n```\n    and yarnray\n";
    assert_eq!(
        examples_of_document(text),
        ["yarnray info a.toml", "yarnray merge 1.film -o a.exr", "yarnray info b.toml"]
    );
}

/// docs/structures.md shows every pattern and every draft with a name, and each of its pictures is there.
#[test]
fn every_structure_is_shown() {
    let page = std::fs::read_to_string(project("docs/structures.md")).expect("a document");
    let rows: Vec<&str> = page.lines().filter(|line| line.starts_with("| ![")).collect();
    let names: BTreeSet<&str> = rows.iter().filter_map(|row| row.split('`').nth(1)).collect();
    let missing: Vec<&str> = PATTERNS.iter().map(|(name, _)| *name).filter(|name| !names.contains(name)).collect();
    assert!(missing.is_empty(), "not shown: {missing:?}");
    // Drafts are families, `twill 2/1` one of `twill M/N`.
    let family = |name: &str| name.split(' ').next().map(str::to_owned);
    let families: BTreeSet<String> = names.iter().filter_map(|name| family(name)).collect();
    let missing: Vec<&&str> =
        NAMES.iter().filter(|name| !family(name).is_some_and(|f| families.contains(&f))).collect();
    assert!(missing.is_empty(), "not shown: {missing:?}");
    for row in rows {
        let file = row.split(['(', ')']).nth(1).expect("a picture");
        assert!(project("docs").join(file).exists(), "{file} is not there");
    }
}
