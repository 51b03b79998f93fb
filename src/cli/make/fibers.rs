//! `yarnray make fibers`: the explicit fibres or plies of a scene's cloth as curve files.

use std::path::PathBuf;

use clap::Args;

use crate::{
    cli::{
        Failure, SceneArgs,
        curve_files::{refuse_unknown, write_all},
        files::Files,
        level,
        terminal::print,
    },
    cloth::{self, Estimate},
    math::words::{bytes_in_words, counted},
    scene::Mode,
};

const EXAMPLES: &str = "Examples:
  yarnray make fibers scenes/woven_silk.toml -o silk.txt          every fibre, as x y z radius for Mitsuba's bsplinecurve
  yarnray make fibers scenes/knit.toml --mode ply -o plies.usdc   one curve for each ply
  yarnray make fibers scenes/knit.toml --estimate                 how many there would be

The extension names the format: .usda and .usdc (with colours and the numbers of yarns and plies), .bcc (no radii), .hair,
.obj (lines, no radii), .yarns, .txt (x y z radius). Positions are millimetres.";

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct FibersArgs {
    /// The scene (.toml).
    scene: PathBuf,
    /// Where to write; the extension names the format. Repeatable.
    #[arg(short, long = "out", value_name = "PATH", required_unless_present = "estimate")]
    out: Vec<PathBuf>,
    /// Only tell how many curves' points there would be, and how much memory they take.
    #[arg(long)]
    estimate: bool,
    /// Say nothing.
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    options: SceneArgs,
}

pub(super) fn run(args: &FibersArgs) -> Result<(), Failure> {
    refuse_unknown(&args.out)?;
    let files =
        Files::default().reads("SCENE", [&args.scene]).reads("--curves", &args.options.curves).writes("-o", &args.out);
    files.refuse()?;
    let mut scene = args.options.load(&args.scene, args.quiet)?;
    // Yarns are what the scene's own curve files hold: this command is for what is in them.
    if scene.render.mode == Mode::Yarn {
        scene.render.mode = Mode::Fiber;
    }
    if args.estimate {
        let total: Estimate = cloth::estimates(&scene).into_iter().sum();
        print(&format!(
            "{}, {}; {} of curves and {} of BVH when rendered\n",
            counted(total.points, "control point"),
            counted(total.segments, "segment"),
            bytes_in_words(total.geometry_bytes),
            bytes_in_words(total.bvh_bytes)
        ))?;
    }
    if args.out.is_empty() {
        return Ok(());
    }
    files.check(args.quiet)?;
    write_all(&args.out, &level::curves(&scene)?, args.quiet)
}
