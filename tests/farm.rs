//! Checkpoints, shards and merging: the same picture to the bit, whatever happens on the way.

use std::{
    path::Path,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use serde_json::Value;
use yarnray::image::{self, Attribute, Image};

use crate::support::{Run, SWATCH, directory, listing, program, read_json, write, yarnray};

/// Every channel's name and bits.
fn bits(path: &Path) -> Vec<(String, Vec<u32>)> {
    let picture = image::read(path).expect("a picture");
    picture.channels.iter().map(|c| (c.name.clone(), c.samples.iter().map(|s| s.to_bits()).collect())).collect()
}

#[track_caller]
pub(crate) fn same(directory: &Path, a: &str, b: &str) {
    let [a, b] = [a, b].map(|name| bits(&directory.join(name)));
    assert_eq!(a.len(), b.len());
    for ((name, a), (_, b)) in a.iter().zip(&b) {
        assert!(a == b, "{name} differs in {} of {} pixels", a.iter().zip(b).filter(|(a, b)| a != b).count(), a.len());
    }
}

/// `render s.toml -q` with more arguments, given as one text.
fn render(directory: &Path, args: &str) -> Run {
    yarnray(directory, &["render s.toml -q", args].join(" ").split_whitespace().collect::<Vec<_>>())
}

fn merge(directory: &Path, args: &str) -> Run {
    yarnray(directory, &["merge -q", args].join(" ").split_whitespace().collect::<Vec<_>>())
}

/// A directory with the swatch, all layers asked for.
fn swatch() -> tempfile::TempDir {
    let directory = directory();
    let scene = SWATCH.replace("[camera]", "[output]\nlayers = [\"all\"]\n\n[camera]");
    write(directory.path(), "s.toml", scene);
    directory
}

#[test]
fn shards_make_the_picture_of_one_machine() {
    let d = swatch();
    let d = d.path();
    render(d, "--spp 10 -o whole.exr").good();
    for (i, threads) in [(1, 1), (2, 2), (3, 3)] {
        render(d, &format!("--spp 10 --shard {i}/3 -j {threads} -o {i}.film")).good();
    }
    merge(d, "2.film 3.film 1.film -o merged.exr -o merged.film -o merged.png").good();
    same(d, "whole.exr", "merged.exr");
    render(d, "--spp 10 -o whole.png").good();
    let [a, b] = ["whole.png", "merged.png"].map(|n| std::fs::read(d.join(n)).unwrap());
    assert!(a == b);
    // In steps, and back from a film.
    merge(d, "1.film 2.film --partial -o half.png").good();
    merge(d, "merged.film -o again.exr").good();
    same(d, "whole.exr", "again.exr");
    let [whole, merged] = ["whole.exr", "merged.exr"].map(|n| image::read(&d.join(n)).unwrap());
    let common = |p: &Image| {
        ["scene", "fingerprint", "seed", "model", "spp", "rel_mse_estimate", "rel_mse_low", "rel_mse_high"]
            .map(|n| p.attribute(&format!("yarnray.{n}")).unwrap_or_else(|| panic!("{n}")).clone())
    };
    assert_eq!(common(&whole), common(&merged));
    assert_eq!(merged.attribute("yarnray.parts"), Some(&Attribute::Whole(3)));
    // A merged film goes on as a whole one does.
    render(d, "--spp 14 --checkpoint merged.film --resume -o more.exr").good();
    render(d, "--spp 14 -o want14.exr").good();
    same(d, "want14.exr", "more.exr");
    // More shards than samples: some are empty.
    for i in 1..=5 {
        render(d, &format!("--spp 3 --shard {i}/5 -o s{i}.film")).good();
    }
    merge(d, "s1.film s2.film s3.film s4.film s5.film -o three.exr").good();
    render(d, "--spp 3 -o want.exr").good();
    same(d, "want.exr", "three.exr");
}

#[test]
fn crops_and_shards_of_crops_make_the_whole_frame() {
    let d = swatch();
    let d = d.path();
    render(d, "--spp 5 -o whole.exr").good();
    render(d, "--spp 5 --crop 0,0,19,36 -o left.film").good();
    render(d, "--spp 5 --crop 19,0,48,9 -o top.film").good();
    render(d, "--spp 5 --crop 19,9,48,36 --shard 1/2 -o a.film").good();
    render(d, "--spp 5 --crop 19,9,48,36 --shard 2/2 -o b.film").good();
    merge(d, "a.film left.film top.film b.film -o merged.exr").good();
    same(d, "whole.exr", "merged.exr");
    let without = merge(d, "left.film a.film b.film -o x.exr");
    assert_eq!(without.status, Some(2));
    assert_eq!(
        without.stderr, "error: pixels 19,0 to 48,9 are missing\n  hint: `--partial` merges what there is\n",
        "{}",
        without.stderr
    );
    render(d, "--spp 5 --crop 18,0,30,5 -o over.film").good();
    let over = merge(d, "left.film over.film -o x.exr").stderr;
    assert!(over.contains("left.film and over.film both hold pixels 18,0 to 19,5"), "{over}");
    assert!(!d.join("x.exr").exists());
}

#[test]
fn shards_cross_the_length_of_a_sobol_sequence() {
    let d = swatch();
    let d = d.path();
    let few = "--spp 65600 --crop 20,15,22,16 --max-bounces 2";
    render(d, &format!("{few} -o whole.exr")).good();
    for i in 1..=2 {
        render(d, &format!("{few} --shard {i}/2 -o {i}.film")).good();
    }
    merge(d, "1.film 2.film -o merged.exr").good();
    same(d, "whole.exr", "merged.exr");
}

#[test]
fn merging_refuses_what_is_not_one_picture() {
    let d = swatch();
    let d = d.path();
    for i in 1..=3 {
        render(d, &format!("--spp 7 --shard {i}/3 -o {i}.film")).good();
    }
    render(d, "--spp 7 --shard 2/3 --seed 4 --set light.0.radiance=0.2 -o foreign.film").good();
    render(d, "--spp 8 --shard 3/3 -o other.film").good();
    write(d, "text.film", "hello");
    let message = |args: &str| {
        let run = merge(d, &format!("{args} -o x.exr"));
        assert_eq!(run.status, Some(2), "{args}");
        assert!(!d.join("x.exr").exists());
        run.stderr
    };
    let foreign = message("1.film foreign.film 3.film");
    assert!(foreign.contains("foreign.film and 1.film are not of one render:"), "{foreign}");
    assert!(foreign.contains("render.seed: 4 in the former, 0 in the latter"), "{foreign}");
    assert!(foreign.contains("light.0") && !foreign.contains("camera"), "{foreign}");
    assert!(message("1.film 2.film other.film").contains("render.spp: 8 in the former, 7 in the latter"));
    assert_eq!(
        message("1.film 3.film"),
        "error: samples 2 to 4 of 7 are missing: shard 2/3\n  hint: `--partial` merges what there is\n"
    );
    assert!(message("2.film").contains("samples 0 to 2 of 7 are missing: shard 1/3"));
    assert!(message("1.film 1.film 2.film 3.film").contains("1.film and 1.film both hold samples 0 to 2"));
    assert!(message("text.film").contains("text.film: it is"), "{}", message("text.film"));
    assert!(message("none.film").contains("cannot read none.film: no such file"));
    let info = yarnray(d, &["info", "2.film"]).good().stdout;
    assert!(info.contains("shard     2/3 of 7 spp: samples 2 to 4, finished"), "{info}");
    let info: Value = serde_json::from_str(&yarnray(d, &["info", "2.film", "--json"]).good().stdout).unwrap();
    assert_eq!(
        (&info["shard"], &info["next"], &info["keys"]["render.seed"]),
        (&serde_json::json!([2, 3]), &serde_json::json!([4, 4]), &Value::from("0"))
    );
    merge(d, "1.film 3.film --partial -o part.exr").good();
    let part = image::read(&d.join("part.exr")).unwrap();
    assert!(part.channel("samples.count").unwrap().iter().all(|&n| n == 5.0));
    assert_eq!(merge(d, "1.film 3.film --partial -o part.film").status, Some(2));
    // What a shard cannot be.
    for (args, word) in [
        ("--shard 1/2 -o a.exr", "without a film"),
        ("--shard 1/2 --time 3 -o a.film", "render.time"),
        ("--shard 1/2 --set render.noise=0.1 -o a.film", "render.noise"),
        ("--shard 1/2 --adaptive -o a.film", "render.adaptive"),
        ("--shard 3/2 -o a.film", "expected I/N"),
        ("--shard 0/2 -o a.film", "expected I/N"),
    ] {
        let run = render(d, args);
        assert_eq!(run.status, Some(2), "{args}");
        assert!(run.stderr.contains(word), "{args}: {}", run.stderr);
    }
}

#[test]
fn a_finished_render_is_extended() {
    let d = swatch();
    let d = d.path();
    render(d, "--spp 45 -o want.exr").good();
    render(d, "--spp 3 --checkpoint c.film -o a.exr").good();
    render(d, "--spp 21 --checkpoint c.film --resume -j 1 -o b.exr").good();
    render(d, "--spp 45 --checkpoint c.film --resume -o c.exr --stats c.json").good();
    same(d, "want.exr", "c.exr");
    let stats = read_json(&d.join("c.json"));
    assert_eq!(stats["rays"]["camera"], 48 * 36 * 45, "counters go on as well");
    assert!(stats["seconds"]["render_all_runs"].as_f64() > stats["seconds"]["render"].as_f64());
    // Less than there is: nothing is lost.
    render(d, "--spp 7 --checkpoint c.film --resume -o d.exr").good();
    same(d, "want.exr", "d.exr");
}

/// Starts a render that goes on from its checkpoint.
fn start(directory: &Path, args: &[&str]) -> Child {
    let common = ["render", "s.toml", "-q", "--checkpoint", "c.film", "--resume"];
    program(directory).args(common).args(args).stderr(Stdio::null()).spawn().expect("the program starts")
}

fn send(signal: &str, child: &Child) {
    // The process may have ended meanwhile.
    let _ = Command::new("kill").args([signal, &child.id().to_string()]).stderr(Stdio::null()).status();
}

#[test]
fn a_render_that_is_killed_twenty_times_makes_the_same_picture() {
    let d = swatch();
    let d = d.path();
    let mut random = yarnray::math::sampler::Stream::new(77);
    let args = ["--spp", "1500", "--crop", "10,10,30,22", "--checkpoint-every", "0.03", "-o", "end.exr"];
    render(d, "--spp 1500 --crop 10,10,30,22 -o want.exr").good();
    let mut killed = [0, 0];
    loop {
        let mut child = start(d, &args);
        if killed == [10, 10] {
            assert!(child.wait().unwrap().success());
            break;
        }
        std::thread::sleep(Duration::from_secs_f32(0.25 * random.next()));
        let way = usize::from(killed[0] > killed[1]);
        send(["-TERM", "-KILL"][way], &child);
        let status = child.wait().unwrap();
        if status.success() {
            // This machine is fast: once more from the beginning.
            same(d, "want.exr", "end.exr");
            std::fs::remove_file(d.join("c.film")).unwrap();
            continue;
        }
        // 143 once the render is under way; before, and by KILL, the signal itself.
        assert!(status.code().is_none_or(|code| way == 0 && code == 143), "{status}");
        killed[way] += 1;
        // A TERM ends with a picture of what there is.
        let _ = std::fs::remove_file(d.join("end.exr"));
    }
    same(d, "want.exr", "end.exr");
}

#[test]
fn adaptive_renders_resume_and_do_not_depend_on_threads() {
    let d = swatch();
    let d = d.path();
    render(d, "--spp 100 --adaptive -j 1 -o want.exr --stats s.json").good();
    render(d, "--spp 20 --adaptive --checkpoint c.film -o a.exr").good();
    render(d, "--spp 100 --adaptive --checkpoint c.film --resume -j 3 -o end.exr").good();
    same(d, "want.exr", "end.exr");
    let stats = read_json(&d.join("s.json"));
    let [least, mean, most] = ["spp_min", "spp_mean", "spp_max"].map(|k| stats["image"][k].as_f64().unwrap());
    assert!((16.0..80.0).contains(&least) && most > 110.0 && (mean - 100.0).abs() < 2.0, "{least} {mean} {most}");
    let counts = image::read(&d.join("end.exr")).unwrap().channel("samples.count").unwrap().to_vec();
    assert!(counts.contains(&(least as f32)) && counts.contains(&(most as f32)));
    // Not in parts, whichever comes first.
    render(d, "--spp 20 --adaptive --crop 0,0,24,36 --checkpoint l.film -o l.exr").good();
    render(d, "--spp 20 --crop 24,0,48,36 --checkpoint r.film -o r.exr").good();
    for parts in ["l.film r.film", "r.film l.film"] {
        let told = merge(d, &format!("{parts} --partial -o m.exr"));
        assert!(told.status == Some(2) && told.stderr.contains("l.film was sampled adaptively"), "{}", told.stderr);
    }
    // Its film is no even one's.
    let other = render(d, "--spp 100 --checkpoint c.film --resume -o b.exr").stderr;
    assert!(other.contains("render.adaptive: true there, false here"), "{other}");
}

#[test]
fn checkpoints_of_other_renders_are_refused() {
    let d = swatch();
    let d = d.path();
    render(d, "--spp 2 --checkpoint c.film -o a.exr").good();
    let before = std::fs::read(d.join("c.film")).unwrap();
    for (args, key) in [
        ("--seed 3", "render.seed: 0 there, 3 here"),
        ("--model paper", "render.model: aggregated there, paper here"),
        ("--set yarn.wool3.radius=1.1", "yarn.wool3.radius: 1.0 there, 1.1 here"),
        ("--set fiber.wool.beta_n=21", "fiber.wool: "),
        ("--set camera.fov=26", "camera"),
        ("--set light.1.irradiance=1", "light.1: "),
        ("--crop 0,0,9,9", "render.crop: [0, 0, 48, 36] there, [0, 0, 9, 9] here"),
        ("--set fabric.0.source.rows=7", "fabric.0.curves: "),
        ("--set output.layers=[\"depth\"]", "output.layers: "),
        ("--shard 1/2", "shard: none there, 1/2 here"),
    ] {
        let run = render(d, &format!("--spp 4 --checkpoint c.film --resume -o b.exr {args}"));
        assert_eq!(run.status, Some(2), "{args}");
        assert!(run.stderr.starts_with("error: c.film is a checkpoint of another render:\n"), "{}", run.stderr);
        assert!(run.stderr.contains(&format!("\n  {key}")), "{args}: {}", run.stderr);
        assert!(!d.join("b.exr").exists());
    }
    // Without --resume it is not written over.
    let run = render(d, "--spp 4 --checkpoint c.film -o b.exr");
    assert_eq!((run.status, run.stderr.contains("--resume goes on with it")), (Some(2), true), "{}", run.stderr);
    // Another version of the program: its name is in the header.
    let (start, end) = (16, 16 + u32::from_le_bytes(before[12..16].try_into().unwrap()) as usize);
    let header = String::from_utf8(before[start..end].to_vec()).unwrap();
    let mut other = before[..start].to_vec();
    other.extend(header.replacen("yarnray 0.", "yarnray 9.", 1).into_bytes());
    assert_eq!(other.len(), end);
    other.extend(crc32fast::hash(&other).to_le_bytes());
    other.extend(&before[end + 4..]);
    write(d, "v.film", other);
    let run = render(d, "--spp 4 --checkpoint v.film --resume -o b.exr");
    assert!(run.stderr.contains("\n  yarnray: yarnray 9."), "{}", run.stderr);
    assert!(std::fs::read(d.join("c.film")).unwrap() == before, "the old checkpoint is as it was");
}

#[test]
fn damaged_checkpoints_are_refused() {
    let d = directory();
    let d = d.path();
    write(d, "s.toml", SWATCH);
    render(d, "--spp 1 --width 20 --height 17 --checkpoint c.film -o a.exr").good();
    let whole = std::fs::read(d.join("c.film")).unwrap();
    let refused = |bytes: &[u8], what: &str| {
        write(d, "bad.film", bytes);
        let run = render(d, "--spp 2 --width 20 --height 17 --checkpoint bad.film --resume -o a.exr");
        assert_eq!(run.status, Some(2), "{what}: {}", run.stderr);
        assert!(run.stderr.starts_with("error: cannot read bad.film: "), "{what}: {}", run.stderr);
        assert_eq!(run.stderr.lines().count(), 1, "{what}: {}", run.stderr);
        assert!(std::fs::read(d.join("bad.film")).unwrap() == bytes, "{what}: it stays as it was");
    };
    for cut in [0, 7, 15, 40, 900, whole.len() / 2, whole.len() - 1] {
        refused(&whole[..cut], &format!("cut at {cut}"));
    }
    refused(&[&whole[..], b"more"].concat(), "longer");
    for i in 0..40 {
        let mut bytes = whole.clone();
        // In the header's first bytes, the header, and all over the tiles.
        let place = if i < 20 { i } else { (i - 20) * (whole.len() - 1) / 19 };
        bytes[place] ^= 1 << (i % 8);
        refused(&bytes, &format!("a bit of byte {place}"));
    }
    // A header that promises more than there is, with a good checksum.
    let (start, end) = (16, 16 + u32::from_le_bytes(whole[12..16].try_into().unwrap()) as usize);
    let header = String::from_utf8(whole[start..end].to_vec()).unwrap();
    let large = header
        .replace("\"crop\":[0,0,20,17]", "\"crop\":[0,0,65536,65536]")
        .replace("\"width\":20", "\"width\":65536")
        .replace("\"height\":17", "\"height\":65536");
    assert_ne!(large, header);
    let mut bytes = whole[..12].to_vec();
    bytes.extend((large.len() as u32).to_le_bytes());
    bytes.extend(large.into_bytes());
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes.extend(&whole[end + 4..]);
    refused(&bytes, "a header of 4 billion pixels");
}

#[test]
fn what_cannot_be_written_is_an_error_and_the_old_file_stays() {
    let d = swatch();
    let d = d.path();
    render(d, "--spp 2 --checkpoint c.film -o a.exr").good();
    let before = std::fs::read(d.join("c.film")).unwrap();
    // A file may not grow beyond 100 kB: what a full disk is like. The picture is smaller than the film.
    let script = format!(
        "trap '' XFSZ; ulimit -f 100; exec '{}' render s.toml -q --spp 3 --checkpoint c.film --resume -o b.png",
        env!("CARGO_BIN_EXE_yarnray")
    );
    let full = Command::new("bash").args(["-c", &script]).current_dir(d).output().unwrap();
    let text = String::from_utf8(full.stderr).unwrap();
    assert_eq!(full.status.code(), Some(2), "{text}");
    assert!(text.starts_with("error: cannot write c.film: "), "{text}");
    assert!(std::fs::read(d.join("c.film")).unwrap() == before, "the old checkpoint stays");
    assert!(d.join("b.png").exists(), "the picture is written all the same");
    assert_eq!(listing(d), ["a.exr", "b.png", "c.film", "s.toml"]);
    // A file that may not be changed.
    let mut permissions = std::fs::metadata(d.join("c.film")).unwrap().permissions();
    permissions.set_readonly(true);
    std::fs::set_permissions(d.join("c.film"), permissions).unwrap();
    let run = render(d, "--spp 3 --checkpoint c.film --resume -o e.exr");
    assert_eq!(run.status, Some(2));
    assert!(run.stderr.contains("cannot write c.film: the file exists and is read-only"), "{}", run.stderr);
    let run = render(d, "--spp 3 --checkpoint s.toml/c.film -o e.exr");
    assert!(run.stderr.contains("a file is in its place"), "{}", run.stderr);
    assert!(!d.join("e.exr").exists());
}

#[test]
fn a_second_signal_ends_at_once() {
    let d = directory();
    let d = d.path();
    write(d, "s.toml", SWATCH);
    let mut child = start(d, &["--spp", "100000000", "--checkpoint-every", "0.05", "-o", "x.exr"]);
    let until = Instant::now() + Duration::from_secs(20);
    while !d.join("c.film").exists() && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(10));
    }
    // Stopped, it takes both signals in one moment.
    send("-STOP", &child);
    send("-INT", &child);
    send("-CONT", &child);
    send("-TERM", &child);
    let status = child.wait().unwrap();
    // Whichever is seen first; the other one is the second.
    assert!(matches!(status.code(), Some(130 | 143)), "{status}");
}

#[test]
fn logs_are_lines_of_json() {
    let d = directory();
    let d = d.path();
    write(d, "s.toml", SWATCH);
    let args = ["render", "s.toml", "--log-json", "--spp", "8", "--checkpoint", "c.film", "-o", "x.exr"];
    let run = yarnray(d, &args).good();
    let events: Vec<Value> =
        run.stderr.lines().map(|l| serde_json::from_str(l).unwrap_or_else(|e| panic!("{e}: {l}"))).collect();
    for phase in ["load", "generate", "build", "render", "write"] {
        let found = events.iter().any(|e| e["phase"] == phase && e["seconds"].as_f64().is_some_and(|s| s >= 0.0));
        assert!(found, "{phase}: {}", run.stderr);
    }
    assert!(events.iter().all(|e| e["timestamp"].is_string() && e["level"].is_string() && e["message"].is_string()));
    assert!(events.iter().any(|e| e["spp"] == 8 && e["share"] == 1.0 || e["stopped_by"] == "spp"), "{}", run.stderr);
    assert!(events.iter().any(|e| e["checkpoint"] == "c.film"));
    // Errors too, and nothing else.
    let run = yarnray(d, &["render", "none.toml", "--log-json"]);
    let event: Value = serde_json::from_str(&run.stderr).unwrap();
    assert_eq!((run.status, &event["level"]), (Some(2), &Value::from("ERROR")));
    assert!(event["message"].as_str().unwrap().contains("none.toml"));
}

#[test]
fn forced_features_are_part_of_what_a_checkpoint_is_of() {
    let d = swatch();
    let d = d.path();
    render(d, "--spp 2 --set render.force=point_light --checkpoint c.film -o a.exr").good();
    let run = render(d, "--spp 4 --checkpoint c.film --resume -o b.exr");
    assert_eq!(run.status, Some(2));
    assert!(run.stderr.contains("render.force: [point_light] there, [] here"), "{}", run.stderr);
    assert!(run.stderr.contains("light.2: ") && run.stderr.contains(" there, nothing here"), "{}", run.stderr);
    render(d, "--spp 4 --set render.force=point_light --checkpoint c.film --resume -o b.exr").good();
    // No form of Rust's own in what people read.
    let info = yarnray(d, &["info", "c.film"]).good().stdout;
    for word in ["Some(", "None", "Vec3", "Gaussian(", "\""] {
        assert!(!info.contains(word), "{word}: {info}");
    }
    // Damage anywhere is seen by `info` as well.
    let mut bytes = std::fs::read(d.join("c.film")).unwrap();
    let place = bytes.len() - 100;
    bytes[place] ^= 1;
    write(d, "c.film", bytes);
    let run = yarnray(d, &["info", "c.film"]);
    assert_eq!(run.status, Some(2), "{}", run.stdout);
    assert!(run.stderr.contains("is damaged"), "{}", run.stderr);
}

/// The second of two runs on one checkpoint would write over what the first has.
#[test]
fn a_checkpoint_is_one_run_s_at_a_time() {
    let folder = directory();
    let d = folder.path();
    write(d, "s.toml", SWATCH);
    let other = std::fs::File::create(d.join("c.film.lock")).unwrap();
    other.lock().unwrap();
    let refused = render(d, "--spp 1 --checkpoint c.film -o a.exr");
    assert!(
        refused.status == Some(2) && refused.stderr.contains("another run renders to c.film\n"),
        "{}",
        refused.stderr
    );
    assert!(!d.join("c.film").exists() && d.join("c.film.lock").exists());
    drop(other);
    render(d, "--spp 1 --checkpoint c.film -o a.exr").good();
    assert!(d.join("c.film").exists() && !d.join("c.film.lock").exists());
}
