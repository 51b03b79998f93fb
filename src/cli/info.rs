//! `yarnray info`

use std::{
    borrow::Cow,
    path::{Path, PathBuf},
};

use clap::Args;
use glam::DVec3;
use serde_json::{Value, json};

use super::{Failure, SceneArgs, folds_in_words, overlap_in_words, positive, render::is_film_path, terminal::print};
use crate::{
    cloth::{self, Estimate},
    files::{
        curve_file::{self, ReadOptions},
        has_extension,
        mesh_file::MeshFacts,
        stage::{self, Stage},
    },
    geometry::{
        curve::{Basis, Curve, CurveSet},
        length::length,
        overlap::{Overlap, TOLERATED, overlap, overlap_of_plied},
        proposal::{self, Proposal},
        strand::Folds,
    },
    image::output::Format,
    input::diagnostic::listed,
    math::words::{bytes_in_words, counted},
    plan::{Feature, Memory, Plan},
    render::film_file,
    scene::{CurveKind, Fabric, GarmentFacts, Scene, Tufts},
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
        scene_report(&scene)
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
        None => curves_report(path, &read.map_err(|e| Failure::Input(format!("error: {e}")))?, radius),
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

/// The diameter by which overlap of scenes and garments is measured: yarns of several plies count as wide as they are in the mean.
const MEAN_WIDTH: &str = "mean width of plied yarn";

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

fn curves_report(path: &Path, set: &CurveSet, radius: Option<f64>) -> (Value, String) {
    // The radius that is asked for, or the curve's own.
    fn radii(curve: &Curve, radius: Option<f64>) -> Option<Cow<'_, [f64]>> {
        radius.map(|r| Cow::Owned(vec![r; curve.points.len()])).or(curve.radii.as_deref().map(Cow::Borrowed))
    }
    let with_radii = set.curves.iter().map(|c| Some((c, radii(c, radius)?))).collect::<Option<Vec<_>>>();
    let found = with_radii.and_then(|list| overlap(list.iter().map(|(c, r)| (*c, &**r))));
    let points: usize = set.curves.iter().map(|c| c.points.len()).sum();
    let closed = set.curves.iter().filter(|c| c.closed).count();
    let open = set.curves.len() - closed;
    let all = || set.curves.iter().flat_map(|c| &c.points);
    let low = all().copied().reduce(DVec3::min).unwrap_or_default();
    let high = all().copied().reduce(DVec3::max).unwrap_or_default();
    // A sum of nothing is -0.
    let length = set.curves.iter().map(length).fold(0.0, |a, b| a + b);
    let basis = match set.curves.first().map(|c| c.basis) {
        Some(Basis::CatmullRom) => "catmull-rom",
        Some(Basis::BSpline) => "b-spline",
        Some(Basis::Linear) => "linear",
        None => "none",
    };
    let radii = set.curves.iter().any(|c| c.radii.is_some());
    let colored = set.colors.iter().flatten().count();
    let distinct: std::collections::BTreeSet<[u32; 3]> =
        set.colors.iter().flatten().map(|c| c.map(f32::to_bits)).collect();
    let numbered: std::collections::BTreeSet<i64> = set.ids.iter().flatten().copied().collect();
    let of_plies: std::collections::BTreeSet<i64> = set.plies.iter().flatten().copied().collect();
    let up = set.up_axis.map(|a| ["x", "y", "z"][usize::from(a.min(2))]);
    // Of its yarn a file knows no more.
    let by = if radius.is_some() { "radius asked for" } else { "radius in the file" };
    // What the file does not say, and nobody has.
    let proposal = if radii || radius.is_some() { None } else { Proposal::new(set) };
    let sizes = proposal::sizes(set);
    let report = json!({
        "file": path.display().to_string(),
        "proposal": proposal.map(|p| json!({
            "radius": p.radius, "unit": p.unit.0, "overlap": overlap_json(Some(p.overlap), "radius proposed"),
            "bend_radius": {"p1": p.bends[0], "p50": p.bends[1]},
        })),
        "size_cm": sizes.iter().map(|(unit, size)| ((*unit).to_owned(), list(*size))).collect::<serde_json::Map<_, Value>>(),
        "curves": set.curves.len(), "closed": closed, "open": open,
        "points": points, "basis": basis, "radii": radii, "up": up,
        "unit_mm": set.unit_mm, "length": length, "overlap": overlap_json(found, by),
        "bounds": [list(low), list(high)], "notes": set.notes,
        "colored": colored, "colors": distinct.len(), "ids": numbered.len(),
        "plies": of_plies.len(),
    });
    let mut text = format!(
        "{}\n  curves    {} ({closed} closed, {open} open), {basis}\n  points    {points}\n  length    {length:.6}\n  bounds    {low:.4} to {high:.4}\n  radii     {}\n  unit      {}\n",
        path.display(),
        set.curves.len(),
        if radii { "in the file" } else { "none: the scene's yarn gives them" },
        unit_in_words(set.unit_mm),
    );
    if colored > 0 {
        let how = "`colors = true` in a scene's source dyes the yarns";
        text += &format!("  colours   {} on {}; {how}\n", distinct.len(), counted(colored, "curve"));
    }
    if let (Some(first), Some(last)) = (numbered.first(), numbered.last()) {
        text += &format!("  ids       {} from {first} to {last}\n", numbered.len());
    }
    if !of_plies.is_empty() {
        text += &format!("  plies     {}: curves are plies or fibres of yarns\n", of_plies.len());
    }
    let nestle =
        if radius.is_some() || of_plies.is_empty() { ": plied yarns that nestle count as overlapping" } else { "" };
    text += &overlap_line(found, &format!("by the {by}{nestle}"), false);
    if let Some(p) = proposal {
        text += &format!(
            "  proposal  radius {:.3}: at it {:.1} % of the length overlaps; one bend in a hundred is tighter than {:.3}, \
             half are tighter than {:.3}\n            unit \"{}\": the yarn would be {:.2} mm thick\n",
            Figure(p.radius),
            100.0 * p.overlap.share,
            Figure(p.bends[0]),
            Figure(p.bends[1]),
            p.unit.0,
            2.0 * p.radius * p.unit.1
        );
    }
    if set.unit_mm.is_none() {
        let size = |(unit, v): &(&str, DVec3)| {
            format!("{unit}: {:.3} x {:.3} x {:.3} cm", Figure(v.x), Figure(v.y), Figure(v.z))
        };
        text += &format!("  size      if it is in {}\n", sizes.iter().map(size).collect::<Vec<_>>().join("; in "));
    }
    for note in &set.notes {
        text += &format!("  note      {note}\n");
    }
    (report, text)
}

/// Length of a fabric's curves, millimetres.
fn length_of(fabric: &Fabric) -> f64 {
    fabric.curves.iter().map(|(c, _)| length(c)).sum()
}

/// A garment for programs: all that is known of it.
fn garment_json(facts: &GarmentFacts) -> Value {
    let numbered = facts.panels.iter().zip(1..);
    let panels: Vec<Value> = numbered
        .map(|((name, stitches), number)| json!({"number": number, "panel": name, "stitches": stitches}))
        .collect();
    let [p5, p50, p95] = facts.uv_ratio;
    json!({
        "path": facts.path, "cloth": facts.cloth, "stitches": facts.stitches, "panels": panels,
        "near": facts.near.map(|(at, radius)| json!({"at_mm": at.to_array(), "radius_mm": radius})),
        "yarn_length_mm": facts.yarn_length, "weight_g": facts.weight,
        "overlap": facts.overlap.map(|o| json!({"share": o.share, "deepest": o.deepest, "diameter": MEAN_WIDTH})),
        "control_points": facts.control_points,
        "uv_ratio": {"p5": p5, "p50": p50, "p95": p95}, "uv_unit_mm": facts.uv_mm, "stretched": facts.stretched,
        "compressed": facts.compressed, "sewn_mm": facts.sewn, "free_mm": facts.free,
        "repairs": facts.repairs,
    })
}

fn garment_lines(facts: &GarmentFacts) -> String {
    let [p5, p50, p95] = facts.uv_ratio;
    let mut text = format!(
        "  garment   {}: {} of {} in {}, about {:.1} m of yarn, {}\n  stretch   3-D over \
         flat lengths {p5:.3} to {p95:.3} (5 to 95 % of the cloth), median {p50:.3}; {:.1} % of the cloth is stretched by more \
         than a tenth, {:.1} % is compressed by more than a tenth\n",
        facts.path,
        counted(facts.stitches, "stitch"),
        facts.cloth,
        counted(facts.panels.len(), "panel"),
        facts.yarn_length / 1000.0,
        counted(facts.control_points, "control point"),
        100.0 * facts.stretched,
        100.0 * facts.compressed
    );
    text += &panel_lines(&facts.panels);
    text += &format!("  edges     {:.0} mm sewn, {:.0} mm free, as cut\n", facts.sewn, facts.free);
    if let Some((at, radius)) = facts.near {
        text += &format!("  near      only what lies within {radius:.3} mm of {at:.3} mm\n");
    }
    if let Some(weight) = facts.weight {
        text += &format!("  weight    {weight:.1} g of yarn\n");
    }
    if let Some(Overlap { share, deepest, .. }) = facts.overlap {
        let (share, deepest) = (100.0 * share, 100.0 * deepest);
        text += &format!(
            "  loops     {share:.1} % of the yarn overlaps where it lies flat, by at most {deepest:.0} % of its diameter\n"
        );
    }
    for repair in &facts.repairs {
        text += &format!("  repair    {repair}\n");
    }
    text
}

/// Panels with the numbers by which a scene may choose them, for people.
fn panel_lines(panels: &[(String, u64)]) -> String {
    const MOST: usize = 24;
    let mut text = String::new();
    for ((name, stitches), number) in panels.iter().take(MOST).zip(1..) {
        let label = if number == 1 { "panels" } else { "" };
        let name = if name.is_empty() { "without a name".to_owned() } else { format!("`{name}`") };
        text += &format!("  {label:<9} {number:>2} {name}: {}\n", counted(*stitches, "stitch"));
    }
    if panels.len() > MOST {
        let others = counted((panels.len() - MOST) as u64, "other");
        text += &format!("  {:<9} and {others}, which `--json` lists\n", "");
    }
    text
}

/// What is told of a scene.
struct SceneFacts<'a> {
    scene: &'a Scene,
    /// What each fabric takes, and all of them.
    estimates: Vec<Estimate>,
    total: Estimate,
    /// What is told of it as a render would.
    warnings: Vec<String>,
    plan: Plan,
    memory: Memory,
    /// The box around all cloth, millimetres, where the scene's file has it.
    bounds: [DVec3; 2],
    /// How far yarns run into each other.
    overlap: Option<Overlap>,
}

fn scene_report(scene: &Scene) -> (Value, String) {
    let facts = SceneFacts::new(scene);
    (facts.json(), facts.text())
}

/// How far the yarns of a scene run into each other, each as wide as it is in the mean; `None` where nothing lies near.
/// Without the strands of tufts, which are crowded in them as fibres are.
fn overlap_of<'s>(scene: &'s Scene) -> Option<Overlap> {
    let half_width = |fabric: &Fabric| match fabric.kind {
        CurveKind::Yarn(yarn) => scene.yarns[yarn].half_width(),
        CurveKind::Fiber(_) => 1.0,
    };
    let of_fabric = |fabric: &'s Fabric| {
        let half_width = half_width(fabric);
        let yarns = fabric.curves.iter().enumerate().filter(|(i, _)| !fabric.tufts.has(*i));
        yarns.map(move |(_, (curve, radii))| (curve, radii.as_slice(), half_width))
    };
    (scene.fabrics.iter().any(|f| !f.curves.is_empty()))
        .then(|| overlap_of_plied(scene.fabrics.iter().flat_map(of_fabric)))
        .flatten()
}

impl<'a> SceneFacts<'a> {
    fn new(scene: &'a Scene) -> Self {
        let (estimates, folds): (Vec<Estimate>, Vec<_>) = cloth::surveyed(scene).into_iter().unzip();
        let folded = scene.fabrics.iter().zip(folds).filter_map(|(fabric, folds)| {
            let folds = folds.filter(Folds::are_seen)?;
            Some(folds_in_words(scene, fabric, &folds, fabric.curves.len()))
        });
        let warnings = scene.warnings.iter().cloned().chain(folded).collect();
        let total: Estimate = estimates.iter().copied().sum();
        let laid = scene.bounds().map(|(a, b)| (a + scene.middle, b + scene.middle));
        let meshes = scene.garments.iter().map(|g| g.bounds).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let (low, high) = laid.or(meshes).unwrap_or((DVec3::ZERO, DVec3::ZERO));
        // Of garments that are not laid only their tile is measured.
        let overlap = overlap_of(scene);
        let (plan, memory) = (Plan::new(scene), Memory::new(scene));
        Self { scene, estimates, total, warnings, plan, memory, bounds: [low, high], overlap }
    }

    /// Features that are used, or those left out.
    fn features(&self, used: bool) -> impl Iterator<Item = &Feature> {
        self.plan.features.iter().filter(move |f| f.used == used)
    }

    /// Fabrics with curves.
    fn laid(&self) -> impl Iterator<Item = (&Fabric, &Estimate)> {
        self.scene.fabrics.iter().zip(&self.estimates).filter(|(f, _)| !f.curves.is_empty())
    }

    /// By which diameter overlap is measured.
    fn diameter(&self) -> &'static str {
        let scene = self.scene;
        let is_plied = |f: &Fabric| matches!(f.kind, CurveKind::Yarn(yarn) if scene.yarns[yarn].half_width() < 1.0);
        if scene.fabrics.iter().any(is_plied) { MEAN_WIDTH } else { "radius of the yarn" }
    }

    fn json(&self) -> Value {
        let Self { scene, total, memory, .. } = self;
        let render = &scene.render;
        let fabrics = self.laid().map(|(f, estimate)| {
            let (kind, number, name) = match f.kind {
                CurveKind::Yarn(yarn) => ("yarn", "yarns", &scene.yarns[yarn].name),
                CurveKind::Fiber(fiber) => ("fiber", "fibers", &scene.fibers[fiber].0),
            };
            json!({
                "source": f.origin, kind: name, number: f.curves.len(), "given_points": f.control_points(),
                "segments": estimate.segments, "length_mm": length_of(f), "tight_bends": estimate.tight_bends,
            })
        });
        let fabrics: Vec<Value> = fabrics.collect();
        let reasons = |used: bool| -> Vec<Value> {
            self.features(used).map(|f| json!({"name": f.name, "reason": f.reason, "bytes": f.bytes})).collect()
        };
        let garments: Vec<Value> = scene.garments.iter().map(garment_json).collect();
        let pixels = u64::from(render.crop[2] - render.crop[0]) * u64::from(render.crop[3] - render.crop[1]);
        json!({
            "scene": scene.path, "fingerprint": scene.fingerprint,
            "mode": render.mode.name(), "model": render.model.name(),
            "image": {"width": render.width, "height": render.height, "spp": render.spp},
            "fabrics": fabrics, "garments": garments, "overlap": overlap_json(self.overlap, self.diameter()),
            "bounds_mm": self.bounds.map(list),
            "memory": {
                "geometry_bytes": total.geometry_bytes, "bvh_bytes": total.bvh_bytes, "film_bytes": memory.film,
                "texture_bytes": memory.textures, "denoiser_bytes": memory.denoiser, "limit_bytes": memory.limit,
            },
            "pixels": pixels,
            "used": reasons(true), "left_out": reasons(false),
            "warnings": self.warnings,
        })
    }

    fn text(&self) -> String {
        let scene = self.scene;
        let render = &scene.render;
        let [low, high] = self.bounds;
        let mut text = format!(
            "{}\n  picture   {} x {}, {} spp, mode {}, model {}\n  bounds    {low:.3} to {high:.3} mm\n",
            scene.path,
            render.width,
            render.height,
            render.spp,
            render.mode.name(),
            render.model.name()
        );
        for (fabric, estimate) in self.laid() {
            text += &fabric_line(scene, fabric, estimate);
        }
        for facts in &scene.garments {
            text += &garment_lines(facts);
        }
        let by = format!("by the {}", self.diameter());
        text += &overlap_line(self.overlap, &by, scene.fabrics.iter().any(|f| f.tufts.yarns > 0));
        text += &self.memory_lines();
        for used in [true, false] {
            text += if used { "  used\n" } else { "  left out\n" };
            for f in self.features(used) {
                let verb = if used { "takes" } else { "saves" };
                let memory = f.bytes.filter(|b| *b > 0).map(|b| format!(" ({verb} {})", bytes_in_words(b)));
                text += &format!("    {:18}{}{}\n", f.name, f.reason, memory.unwrap_or_default());
            }
        }
        for warning in &self.warnings {
            text += &format!("  warning   {warning}\n");
        }
        text
    }

    fn memory_lines(&self) -> String {
        let Self { total, memory, .. } = self;
        let beside = |bytes: u64, what: &str| match bytes {
            0 => String::new(),
            _ => format!(", {} of {what}", bytes_in_words(bytes)),
        };
        let mut text = format!(
            "  memory    about {} of curves, {} of BVH, {} of film{}{}\n",
            bytes_in_words(total.geometry_bytes),
            bytes_in_words(total.bvh_bytes),
            bytes_in_words(memory.film),
            beside(memory.textures, "textures"),
            beside(memory.denoiser, "the denoiser"),
        );
        if let Some(limit) = memory.limit.filter(|limit| total.bytes() + memory.bytes() > *limit) {
            text += &format!(
                "            more than the {} that it may take: `render` would refuse it\n",
                bytes_in_words(limit)
            );
        }
        text
    }
}

fn fabric_line(scene: &Scene, fabric: &Fabric, estimate: &Estimate) -> String {
    let (noun, of) = match fabric.kind {
        CurveKind::Yarn(yarn) => {
            let yarn = &scene.yarns[yarn];
            let tufts = match &fabric.tufts {
                Tufts { yarns: 0, .. } => String::new(),
                Tufts { yarns, strands } => {
                    format!("and {} ({}) ", counted(*yarns, "cut tuft"), counted(strands.len(), "strand"))
                }
            };
            let (plies, fibers) = (counted(yarn.plies.len(), "ply"), counted(yarn.plies[0].fibers, "fibre"));
            ("yarn", format!("{tufts}of `{}` ({plies} of {fibers})", yarn.name))
        }
        CurveKind::Fiber(fiber) => ("fibre", format!("of `{}`", scene.fibers[fiber].0)),
    };
    format!(
        "  fabric    {}: {} {of}, {:.1} m, {} given, {} to make\n",
        fabric.origin,
        counted(fabric.curves.len() - fabric.tufts.strands.len(), noun),
        length_of(fabric) / 1000.0,
        counted(fabric.control_points(), "point"),
        counted(estimate.segments, "segment")
    )
}
