//! `yarnray make garment`: the yarns of a scene's cloth as curve files, whether it is laid on a garment or not.

use std::path::PathBuf;

use clap::Args;

use crate::{
    cli::{
        Failure, SceneArgs,
        curve_files::{refuse_unknown, write_all},
        files::Files,
        level::{self, LEVELS},
        log,
    },
    math::words::counted,
};

const EXAMPLES: &str = "Examples:
  yarnray make garment scenes/pullover.toml -o pullover.bcc
  yarnray make garment scenes/beanie.toml -o beanie.usdc          what a scene knits or weaves without a mesh as well
  yarnray make garment scenes/pullover.toml --set render.frame=12 -o pullover.0012.usdc
  yarnray info scenes/pullover.toml                               how many stitches there would be

The extension names the format: .usda and .usdc (with colours and the numbers of yarns and plies), .bcc (no radii), .hair,
.obj (lines, no radii), .yarns, .txt (x y z radius). Positions are millimetres, as the scene has them.";

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct GarmentArgs {
    /// The scene (.toml).
    scene: PathBuf,
    /// Where to write; the extension names the format. Repeatable.
    #[arg(short, long = "out", value_name = "PATH", required = true)]
    out: Vec<PathBuf>,
    /// Write yarns, a curve for each ply, or every fibre.
    #[arg(long = "as", value_name = "LEVEL", default_value = "yarns", value_parser = LEVELS)]
    level: String,
    /// Say nothing.
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    options: SceneArgs,
}

pub(super) fn run(args: &GarmentArgs) -> Result<(), Failure> {
    refuse_unknown(&args.out)?;
    let files =
        Files::default().reads("scene", [&args.scene]).reads("--curves", &args.options.curves).writes("-o", &args.out);
    files.refuse()?;
    let mut scene = args.options.load(&args.scene, args.quiet)?;
    files.check(args.quiet)?;
    scene.render.mode = level::mode(&args.level);
    let set = level::curves(&scene)?;
    write_all(&args.out, &set, args.quiet)?;
    if !args.quiet {
        if !scene.garments.is_empty() {
            let stitches: u64 = scene.garments.iter().map(|f| f.stitches).sum();
            log::say(&counted(stitches, "stitch"));
        }
        for note in scene.garments.iter().flat_map(|f| &f.repairs) {
            log::say(&format!("note: {note}"));
        }
    }
    Ok(())
}
