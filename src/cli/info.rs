//! `yarnray info`: what a file is, for people and for programs.

mod curves;
mod scene;

use std::path::{Path, PathBuf};

use clap::Args;
use glam::DVec3;
use serde_json::{Value, json};

use self::{curves::CurveFacts, scene::SceneFacts};
use super::{Failure, SceneArgs, overlap_in_words, positive, render::is_film_path, terminal::print};
use crate::{
    files::{
        curve_file::{self, ReadOptions},
        has_extension,
        mesh_file::MeshFacts,
        stage::{self, Stage},
    },
    geometry::overlap::{Overlap, TOLERATED},
    image::output::Format,
    input::diagnostic::listed,
    math::words::counted,
    render::film_file,
};

const EXAMPLES: &str = "Examples:
  yarnray info scenes/swatch.toml          counts, bounds, memory, what is used and what is left out
  yarnray info glove.bcc --radius 0.08      what a curve file holds, and how far its yarns overlap
  yarnray info mannequin.obj               a mesh: whether it is closed, its groups, whether it has texture coordinates
  yarnray info part1.film                  how far a checkpoint or part of a render is, and of what
  yarnray info scenes/swatch.toml --json   the same for programs";

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct InfoArgs {
    /// A scene (.toml), a curve file (.bcc, .hair, .pyp, .obj, .yarns, .smobj, .txt, .curves, .usd, .usda, .usdc, .usdz, .abc), a mesh (.obj or a stage) or a film (a checkpoint, a part of a render).
    file: PathBuf,
    /// Radius of the yarns of a curve file, in its unit, in place of what it says: tells how far they overlap.
    #[arg(long, value_name = "R", value_parser = positive)]
    radius: Option<f64>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// No progress.
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    options: SceneArgs,
}

pub(super) fn run(args: &InfoArgs) -> Result<(), Failure> {
    let is_scene = has_extension(&args.file, "toml");
    if let Some(option) = args.options.given().filter(|_| !is_scene) {
        let problem = format!("{option}: only scenes take it, and {} is none", args.file.display());
        return Err(Failure::hinted(problem, "leave it out, or name a scene (.toml)"));
    }
    if args.radius.is_some() && is_scene {
        return Err(Failure::hinted("--radius: only files of curves take it", "--set yarn.NAME.radius=R"));
    }
    let (report, text) = if film_file::is_film(&args.file) || is_film_path(&args.file) {
        film_report(&args.file)?
    } else if is_scene {
        let scene = args.options.load_or_survey(&args.file, args.quiet, true)?;
        let facts = SceneFacts::new(&scene);
        (facts.json(), facts.text())
    } else {
        file_report(&args.file, args.radius)?
    };
    if args.json {
        print(&(serde_json::to_string_pretty(&report).expect("numbers and text become JSON") + "\n"))
    } else {
        print(&text)
    }
}

/// What a file of curves holds, or of faces alone.
fn file_report(path: &Path, radius: Option<f64>) -> Result<(Value, String), Failure> {
    if path.is_file() && Format::of(path).is_ok() {
        let problem = format!("{}: a picture, of which `info` tells nothing", path.display());
        return Err(Failure::hinted(problem, "`yarnray compare A B` measures pictures"));
    }
    let read = curve_file::read(path, &ReadOptions::default());
    let has_curves = read.as_ref().is_ok_and(|set| !set.curves.is_empty());
    let stage = if stage::is_stage(path) { Stage::open(path).ok() } else { None };
    let facts = match &stage {
        _ if has_curves => None,
        Some(stage) => MeshFacts::of_stage(stage).ok().flatten(),
        None if has_extension(path, "obj") => MeshFacts::read(path).ok().flatten(),
        None => None,
    };
    let own = match facts {
        Some(facts) => mesh_report(path, &facts),
        None => {
            let set = read.map_err(|e| Failure::Input(format!("error: {e}")))?;
            let facts = CurveFacts::new(path, &set, radius);
            (facts.json(), facts.text())
        }
    };
    Ok(match &stage {
        Some(stage) => with_stage(stage, own),
        None => own,
    })
}

/// What else is in a stage, for those who name it in a scene.
fn with_stage(stage: &Stage, (mut report, mut text): (Value, String)) -> (Value, String) {
    const MOST: usize = 8;
    let Ok(contents) = stage.contents() else { return (report, text) };
    let frames = stage.frames().filter(|[first, last]| first < last);
    if let Some([first, last]) = frames {
        text += &format!("  frames    {first} to {last}\n");
    }
    report["frames"] = json!(frames);
    let of_kinds = [
        ("curve_prims", "curves in", &contents.curves, ""),
        ("mesh_prims", "meshes", &contents.meshes, ""),
        ("cameras", "cameras", &contents.cameras, ""),
        ("lights", "lights", &contents.lights, "; not read: a scene has its own"),
    ];
    for (key, word, prims, more) in of_kinds {
        report[key] = json!(prims);
        let mut shown: Vec<String> = prims.iter().take(MOST).cloned().collect();
        if prims.len() > MOST {
            shown.push(counted((prims.len() - MOST) as u64, "other"));
        }
        if !shown.is_empty() {
            text += &format!("  {word:<9} {}{more}\n", listed(shown.into_iter(), "and"));
        }
    }
    (report, text)
}

fn mesh_report(path: &Path, facts: &MeshFacts) -> (Value, String) {
    let &MeshFacts { vertices, triangles, open_edges, bounds: (low, high), uvs, unit_mm, .. } = facts;
    let report = json!({
        "file": path.display().to_string(), "vertices": vertices, "triangles": triangles, "open_edges": open_edges,
        "groups": facts.groups, "bounds": [list(low), list(high)],
        "uv_bounds": uvs.map(|(low, high)| [low.to_array(), high.to_array()]), "unit_mm": unit_mm,
    });
    let closed = match open_edges {
        0 => "closed".to_owned(),
        open => format!("open at {}", counted(open as u64, "edge")),
    };
    let uvs = uvs.map_or("none: a garment needs them".to_owned(), |(low, high)| format!("{low:.4} to {high:.4}"));
    let text = format!(
        "{}\n  mesh      {vertices} vertices, {}, {closed}\n  groups    {}\n  bounds    {low:.4} to {high:.4}\n  uvs       {uvs}\n  unit      {}\n",
        path.display(),
        counted(triangles as u64, "triangle"),
        listed(facts.groups.iter().map(|name| format!("`{name}`")), "and"),
        unit_in_words(unit_mm),
    );
    (report, text)
}

fn unit_in_words(unit_mm: Option<f64>) -> String {
    unit_mm.map_or("not stated".to_owned(), |unit| format!("{unit} mm"))
}

/// What a checkpoint or part of a render holds.
fn film_report(path: &Path) -> Result<(Value, String), Failure> {
    let header = film_file::check(path)?;
    let (about, [from, to], [least, most]) = (&header.about, header.samples, header.next);
    let [x0, y0, x1, y1] = header.crop;
    let seconds = header.elapsed.as_secs_f64();
    let shard = about.shard.map(|s| [s.index, s.count]);
    let report = json!({
        "file": path.display().to_string(), "width": about.frame.width, "height": about.frame.height,
        "crop": header.crop, "spp": about.spp, "shard": shard, "samples": [from, to], "next": [least, most],
        "adaptive": header.planned, "seconds": seconds,
        "keys": about.keys.iter().map(|(k, v)| (k.clone(), v.clone().into())).collect::<serde_json::Map<_, Value>>(),
    });
    let part = shard.map_or("whole ".to_owned(), |[i, n]| format!("shard     {i}/{n} of {} spp:", about.spp));
    let state = match (header.planned, least >= to) {
        (true, _) => "sampled adaptively".to_owned(),
        (_, true) => "finished".to_owned(),
        _ => format!("at {least} to {most}"),
    };
    let mut text = format!(
        "{}\n  film      {} x {}, pixels {x0},{y0} to {x1},{y1}\n  {part} samples {from} to {to}, {state}\n  time      {seconds:.2} s\n",
        path.display(),
        about.frame.width,
        about.frame.height,
    );
    for (key, value) in &about.keys {
        text += &format!("  {key} = {value}\n");
    }
    Ok((report, text))
}

fn list(v: DVec3) -> Value {
    json!([v.x, v.y, v.z])
}

/// A number with so many significant digits as the format's precision says.
struct Figure(f64);

impl std::fmt::Display for Figure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let digits = f.precision().unwrap_or(3) as i32;
        let size = if self.0 == 0.0 { 0 } else { self.0.abs().log10().floor() as i32 };
        write!(f, "{:.*}", (digits - 1 - size).max(0) as usize, self.0)
    }
}

/// Overlap as JSON: shares of the length and mean diameters, and which diameter that is.
fn overlap_json(found: Option<Overlap>, diameter: &str) -> Value {
    found.map_or(Value::Null, |o| {
        let nearest = if o.nearest.is_finite() { json!(o.nearest) } else { Value::Null };
        json!({"share": o.share, "tolerated": TOLERATED, "deepest": o.deepest, "nearest": nearest, "diameter": diameter})
    })
}

fn overlap_line(found: Option<Overlap>, by: &str, tufts: bool) -> String {
    found.map_or(String::new(), |o| format!("  overlap   {}\n", overlap_in_words(&o, by, tufts)))
}
