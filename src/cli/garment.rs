//! `yarnray make garment`: the yarns of a scene's cloth as curve files.

use std::path::PathBuf;

use clap::Args;

use super::{Failure, SceneArgs, log, make::write_curves};
use crate::geometry::{
    curve::{Curve, CurveSet},
    curve_file,
};

const EXAMPLES: &str = "Examples:
  yarnray make garment scenes/pullover.toml -o pullover.bcc
  yarnray make garment scenes/pullover.toml --set render.frame=12 -o pullover.0012.usdc
  yarnray info scenes/pullover.toml                               how many stitches there would be

The extension names the format: .bcc (no radii), .hair, .obj (lines, no radii), .txt (x y z radius). Positions are
millimetres, as the scene has them.";

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct GarmentArgs {
    /// The scene (.toml).
    scene: PathBuf,
    /// Where to write; the extension names the format. Repeatable.
    #[arg(short, long = "out", value_name = "PATH", required = true)]
    out: Vec<PathBuf>,
    /// Say nothing.
    #[arg(long)]
    quiet: bool,
    #[command(flatten)]
    options: SceneArgs,
}

pub(super) fn run(args: &GarmentArgs) -> Result<(), Failure> {
    for path in &args.out {
        if !curve_file::can_write(path) {
            let problem = format!("error: {}: expected a name that ends in .bcc, .hair, .obj or .txt", path.display());
            return Err(Failure::Input(problem));
        }
    }
    let scene = args.options.load(&args.scene)?;
    if scene.garments.is_empty() {
        let hint = "source = { type = \"garment\", path = \"pullover.obj\", cloth = { type = \"knit\" } }";
        let problem = format!("error: {}: no fabric is laid on a garment\n  help: {hint}", args.scene.display());
        return Err(Failure::Input(problem));
    }
    let facts = scene.garments.clone();
    let middle = scene.middle;
    let placed = |(mut curve, radii): (Curve, Vec<f64>)| {
        curve.points.iter_mut().for_each(|p| *p += middle);
        curve.radii = Some(radii);
        curve
    };
    let curves = scene.fabrics.into_iter().flat_map(|f| f.curves).map(placed).collect();
    let set = CurveSet { curves, unit_mm: Some(1.0), up_axis: Some(1), ..CurveSet::default() };
    for path in &args.out {
        write_curves(path, &set)?;
    }
    if !args.quiet {
        for path in &args.out {
            log::say(&format!("wrote {}", path.display()));
        }
        let points: usize = set.curves.iter().map(|c| c.points.len()).sum();
        let stitches: u64 = facts.iter().map(|f| f.stitches).sum();
        log::say(&format!("{stitches} stitches, {} yarns, {points} control points", set.curves.len()));
        for note in facts.iter().flat_map(|f| &f.repairs) {
            log::say(&format!("note: {note}"));
        }
    }
    Ok(())
}
