//! `yarnray make`: curve files of cloth that the program makes.

mod colors;
mod fibers;
mod garment;
mod knit;
mod output;
mod weave;

use clap::{Args, Subcommand};

use self::{fibers::FibersArgs, garment::GarmentArgs, knit::KnitArgs, output::EXAMPLES, weave::WeaveArgs};
use super::Failure;

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct MakeArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand, Debug)]
enum What {
    /// Knitted cloth from a named pattern or a chart.
    Knit(Box<KnitArgs>),
    /// Woven cloth from a draft.
    Weave(Box<WeaveArgs>),
    /// The yarns of a scene's cloth, such as those laid on a garment.
    Garment(Box<GarmentArgs>),
    /// The explicit fibres or plies of a scene's cloth.
    Fibers(Box<FibersArgs>),
}

pub(super) fn run(args: &MakeArgs) -> Result<(), Failure> {
    match &args.what {
        What::Knit(args) => knit::run(args),
        What::Weave(args) => weave::run(args),
        What::Garment(args) => garment::run(args),
        What::Fibers(args) => fibers::run(args),
    }
}
