//! What `info` tells of a scene, its fabrics and its garments.

use glam::DVec3;
use serde_json::{Value, json};

use super::{list, overlap_json, overlap_line};
use crate::{
    cli::folds_in_words,
    cloth::{self, Estimate},
    geometry::{
        length::length,
        overlap::{Overlap, overlap_of_plied},
        strand::Folds,
    },
    input::diagnostic::listed,
    math::words::{bytes_in_words, counted},
    plan::{Feature, Memory, Plan},
    scene::{CurveKind, Fabric, GarmentFacts, PanelFacts, Scene, Tufts},
};

/// The diameter by which overlap of scenes and garments is measured: yarns of several plies count as wide as they are in the mean.
const MEAN_WIDTH: &str = "mean width of plied yarn";

/// Length of a fabric's curves, millimetres.
fn length_of(fabric: &Fabric) -> f64 {
    fabric.curves.iter().map(|(c, _)| length(c)).sum()
}

/// A garment for programs: all that is known of it.
fn garment_json(facts: &GarmentFacts) -> Value {
    let numbered = facts.panels.iter().zip(1..);
    let panels: Vec<Value> = numbered
        .map(|(panel, number)| {
            json!({"number": number, "panel": panel.name, "cloth": panel.cloth, "stitches": panel.stitches})
        })
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

/// The names of what its panels are of, that of the garment first.
fn cloths_of(facts: &GarmentFacts) -> String {
    let mut names: Vec<&str> = Vec::new();
    for panel in &facts.panels {
        match panel.cloth.as_str() {
            name if names.contains(&name) => {}
            name if name == facts.cloth => names.insert(0, name),
            name => names.push(name),
        }
    }
    listed(names.into_iter().map(str::to_owned), "and")
}

fn garment_lines(facts: &GarmentFacts) -> String {
    let [p5, p50, p95] = facts.uv_ratio;
    let mut text = format!(
        "  garment   {}: {} of {} in {}, about {:.1} m of yarn, {}\n  stretch   3-D over \
         flat lengths {p5:.3} to {p95:.3} (5 to 95 % of the cloth), median {p50:.3}; {:.1} % of the cloth is stretched by more \
         than a tenth, {:.1} % is compressed by more than a tenth\n",
        facts.path,
        counted(facts.stitches, "stitch"),
        cloths_of(facts),
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
fn panel_lines(panels: &[PanelFacts]) -> String {
    const MOST: usize = 24;
    let mut text = String::new();
    for (PanelFacts { name, cloth, stitches }, number) in panels.iter().take(MOST).zip(1..) {
        let label = if number == 1 { "panels" } else { "" };
        let name = if name.is_empty() { "without a name".to_owned() } else { format!("`{name}`") };
        text += &format!("  {label:<9} {number:>2} {name}: {} of {cloth}\n", counted(*stitches, "stitch"));
    }
    if panels.len() > MOST {
        let others = counted((panels.len() - MOST) as u64, "other");
        text += &format!("  {:<9} and {others}, which `--json` lists\n", "");
    }
    text
}

/// What is told of a scene.
pub(super) struct SceneFacts<'a> {
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
    pub(super) fn new(scene: &'a Scene) -> Self {
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

    pub(super) fn json(&self) -> Value {
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

    pub(super) fn text(&self) -> String {
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
