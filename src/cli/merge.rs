//! `yarnray merge`

use std::path::PathBuf;

use clap::Args;

use super::{
    Failure, command_line,
    files::{Attempts, Files},
    log::LogArgs,
    pictures::{DisplayArgs, denoised_beside, write_pictures},
    render::is_film_path,
    thread_pool,
};
use crate::{
    ffi::oidn::Denoiser,
    image::{output, whole_file},
    math::words::counted,
    render::{
        Job,
        denoise::Denoised,
        film_file::{self, About},
        merge::merge,
        picture::Picture,
    },
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
    /// Add a denoised picture, by Open Image Denoise, as `render` does: of parts that were rendered with --denoise, or with the
    /// layers albedo and normal.
    #[arg(long)]
    denoise: bool,
    #[command(flatten)]
    screen: DisplayArgs,
    #[command(flatten)]
    log: LogArgs,
}

pub(super) fn run(args: &MergeArgs) -> Result<(), Failure> {
    args.log.start();
    let beside = if args.denoise { denoised_beside(&args.out) } else { Vec::new() };
    Files::default().reads("PART", &args.parts).writes("-o", &args.out).writes("--denoise", &beside).check(false)?;
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
    let (mut about, job) =
        merge(&args.parts, args.partial).map_err(|error| Failure::Input(format!("error: {error}")))?;
    args.screen.apply(&mut about.frame.display);
    let clean = if args.denoise { Some(denoised(&about, &job)?) } else { None };
    let command = command_line();
    let attributes = report::merged_attributes(&about.metadata, &job, args.parts.len(), &command);
    let mut attempts = Attempts::default();
    let picture = Picture { frame: &about.frame, film: &job.film, denoised: clean.as_ref(), attributes: &attributes };
    for path in &args.out {
        let written = if !is_film_path(path) {
            write_pictures(std::slice::from_ref(path), &picture, &mut attempts)
        } else if attempts.note(film_file::write(path, &about, &job)) {
            vec![path.clone()]
        } else {
            Vec::new()
        };
        for path in written {
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

/// The film without noise, if it holds what guides a denoiser.
fn denoised(about: &About, job: &Job) -> Result<Denoised, Failure> {
    if !(about.collected.albedo && about.collected.normal) {
        let hint = "parts that are rendered with --denoise hold them, or those of a scene with both layers";
        return Err(Failure::hinted("--denoise: the parts hold no albedo and normal", hint));
    }
    let (_, threads) = thread_pool(None)?;
    Ok(Denoised::new(&Denoiser::new(threads)?, &job.film)?)
}
