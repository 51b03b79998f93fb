//! `yarnray merge`

use std::path::PathBuf;

use clap::Args;

use super::{
    Failure, command_line,
    files::{Attempts, Files},
    log::LogArgs,
    named,
    render::{is_film_path, stops},
    thread_pool,
};
use crate::{
    ffi::oidn::Denoiser,
    image::{output, png::ToneMap, whole_file},
    math::words::counted,
    render::{
        Job,
        denoise::Denoised,
        film_file::{self, About},
        merge::merge,
        picture,
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
    /// Curve of the picture for a screen, in place of the scene's.
    #[arg(long, value_parser = named(&ToneMap::NAMES))]
    tone_map: Option<ToneMap>,
    /// Exposure of the picture for a screen, in stops, in place of the scene's.
    #[arg(long, value_name = "STOPS", value_parser = stops)]
    exposure: Option<f32>,
    #[command(flatten)]
    log: LogArgs,
}

pub(super) fn run(args: &MergeArgs) -> Result<(), Failure> {
    args.log.start();
    let beside: Vec<PathBuf> = args
        .out
        .iter()
        .filter(|path| args.denoise && !is_film_path(path))
        .filter_map(|p| picture::denoised_path(p))
        .collect();
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
    about.frame.display.tone_map = args.tone_map.unwrap_or(about.frame.display.tone_map);
    about.frame.display.exposure = args.exposure.unwrap_or(about.frame.display.exposure);
    let clean = if args.denoise { Some(denoised(&about, &job)?) } else { None };
    let command = command_line();
    let attributes = report::merged_attributes(&about.metadata, &job, args.parts.len(), &command);
    let mut attempts = Attempts::default();
    for path in &args.out {
        let result = if is_film_path(path) {
            film_file::write(path, &about, &job)
        } else {
            picture::write(path, &about.frame, &job.film, clean.as_ref(), &attributes)
        };
        if let (Some(clean), Some(path)) = (&clean, picture::denoised_path(path).filter(|_| !is_film_path(path)))
            && attempts.note(picture::write_denoised(&path, &about.frame, &job.film, clean))
        {
            tracing::info!(path = %path.display(), "wrote {}", path.display());
        }
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

/// The film without noise, if it holds what guides a denoiser.
fn denoised(about: &About, job: &Job) -> Result<Denoised, Failure> {
    if !(about.collected.albedo && about.collected.normal) {
        let hint = "parts that are rendered with --denoise hold them, or those of a scene with both layers";
        return Err(Failure::hinted("--denoise: the parts hold no albedo and normal", hint));
    }
    let (_, threads) = thread_pool(None)?;
    Ok(Denoised::new(&Denoiser::new(threads)?, &job.film)?)
}
