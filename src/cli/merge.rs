//! `yarnray merge`

use std::path::PathBuf;

use clap::Args;

use super::{
    Failure,
    files::{Attempts, Files},
    log::LogArgs,
    render::is_film_path,
};
use crate::{
    image::{output, whole_file},
    math::words::counted,
    render::{film_file, merge::merge, picture},
    report,
};

const EXAMPLES: &str = "Examples:
  yarnray merge part1.film part2.film part3.film -o frame.exr   shards of one render, from any machines
  yarnray merge left.film right.film -o frame.exr -o frame.png  crops of one frame
  yarnray merge part*.film --partial -o preview.png             what there is so far
  yarnray merge frame.film -o frame.exr                         a picture from a checkpoint";

#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct MergeArgs {
    /// Film files: shards, crops, checkpoints of one render.
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    /// Where to write; the extension names the format (.exr, .png, ..., or .film to go on merging). Repeatable.
    #[arg(short, long = "out", value_name = "PATH", required = true)]
    out: Vec<PathBuf>,
    /// Merge what there is, even if samples or pixels are missing.
    #[arg(long)]
    partial: bool,
    #[command(flatten)]
    log: LogArgs,
}

pub(super) fn run(args: &MergeArgs) -> Result<(), Failure> {
    args.log.start();
    Files::default().reads("PART", &args.parts).writes("-o", &args.out).check(false)?;
    for path in &args.out {
        if is_film_path(path) {
            whole_file::check(path)?;
            if args.partial {
                return Err(Failure::Input(format!(
                    "error: {}: a partial merge cannot be a film: nobody could tell later which samples it has",
                    path.display()
                )));
            }
        } else {
            output::check_writable(path)?;
        }
    }
    let (about, job) = merge(&args.parts, args.partial).map_err(|error| Failure::Input(format!("error: {error}")))?;
    let command = std::env::args().collect::<Vec<_>>().join(" ");
    let attributes = report::merged_attributes(&about.metadata, &job, args.parts.len(), &command);
    let mut attempts = Attempts::default();
    for path in &args.out {
        let result = if is_film_path(path) {
            film_file::write(path, &about, &job)
        } else {
            picture::write(path, &about.frame, &job.film, None, &attributes)
        };
        if attempts.note(result) {
            tracing::info!(path = %path.display(), "wrote {}", path.display());
        }
    }
    let (least, mean, most) = job.film.samples();
    let spp =
        if least == most { format!("{least} spp") } else { format!("{least} to {most} spp, {mean:.1} in the mean") };
    tracing::info!(
        parts = args.parts.len(),
        spp_min = least,
        spp_mean = mean,
        spp_max = most,
        "{}, {spp}",
        counted(args.parts.len(), "part")
    );
    if least == 0 {
        tracing::warn!("some pixels have no sample: they are black");
    }
    attempts.finish()
}
