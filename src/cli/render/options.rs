//! What the command line says.

use std::{
    ops::RangeInclusive,
    path::{Path, PathBuf},
};

use clap::Args;

use super::super::{Failure, SceneArgs, log::LogArgs, pictures::DisplayArgs};
use crate::{files::has_extension, render::Shard, scene::animation::numbered};

const EXAMPLES: &str = "Examples:
  yarnray render scenes/swatch.toml                                  writes out/swatch.exr
  yarnray render scenes/swatch.toml --spp 256 -o s.exr -o s.png      two formats of one render
  yarnray render scenes/swatch.toml --spp 100000 --time 30           the best picture of half a minute
  yarnray render scenes/swatch.toml --crop 300,200,460,320 -o c.png  a part of the frame
  yarnray render scenes/swatch.toml --checkpoint c.film --resume     goes on where it was stopped
  yarnray render scenes/swatch.toml --shard 1/3 -o 1.film            a third of the samples, for `yarnray merge`
  yarnray render scenes/single_yarn.toml --set yarn.sample.plies=1   any key of the scene";

#[derive(Args, Debug, Clone)]
#[command(after_help = EXAMPLES)]
pub(in crate::cli) struct RenderArgs {
    /// The scene file.
    pub(super) scene: PathBuf,
    /// Where to write; the extension names the format (.exr, .png, .hdr, .tif, ...). Repeatable. Default: out/SCENE.exr
    #[arg(short, long = "out", value_name = "PATH")]
    pub(super) out: Vec<PathBuf>,
    /// Render these frames of a sequence, the last included; put #### or {frame} into the names of outputs.
    #[arg(long, value_name = "A..B", value_parser = frames)]
    pub(super) frames: Option<Frames>,
    /// Add a denoised picture, by Open Image Denoise: a layer of an EXR, else a file of its own (x.denoised.png).
    #[arg(long)]
    pub(super) denoise: bool,
    /// Show the picture while it is made, in a running tev (its own address is 127.0.0.1:14158).
    #[arg(long, value_name = "HOST:PORT", value_parser = host_and_port)]
    pub(super) display: Option<String>,
    #[command(flatten)]
    pub(super) screen: DisplayArgs,
    /// Write statistics as JSON.
    #[arg(long, value_name = "FILE.json")]
    pub(super) stats: Option<PathBuf>,
    /// Save what there is to this film file: first after 5 seconds, then by interval, and at the end.
    #[arg(long, value_name = "FILE")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Seconds between two checkpoints.
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = seconds, requires = "checkpoint")]
    pub(super) checkpoint_every: f64,
    /// Go on from the checkpoint if there is one; more --spp than it has extends it.
    #[arg(long, requires = "checkpoint")]
    pub(super) resume: bool,
    /// Take only this part of the samples, such as 2/3; `yarnray merge` puts films of all parts together.
    #[arg(long, value_name = "I/N", value_parser = shard)]
    pub(super) shard: Option<Shard>,
    #[command(flatten)]
    pub(super) log: LogArgs,
    #[command(flatten)]
    pub(super) options: SceneArgs,
}

impl RenderArgs {
    /// The arguments for one frame of several.
    pub(super) fn of_frame(&self, frame: u32) -> Result<Self, Failure> {
        let alone = self.frames.as_ref().is_none_or(|f| f.0.start() == f.0.end());
        let named = |path: &PathBuf| match numbered(path, frame) {
            Some(path) => Ok(path),
            None if alone => Ok(path.clone()),
            None => Err(Failure::Input(format!(
                "error: --frames would write every frame to {}: put #### or {{frame}} into its name",
                path.display()
            ))),
        };
        let mut args = self.clone();
        args.out = outputs(self).iter().map(named).collect::<Result<_, _>>()?;
        args.stats = self.stats.as_ref().map(named).transpose()?;
        args.checkpoint = self.checkpoint.as_ref().map(named).transpose()?;
        args.options.set.push(format!("render.frame={frame}"));
        // What is missing for any of them is told before the first is rendered.
        args.options.frames = self.frames.as_ref().map(|frames| frames.0.clone()).filter(|all| *all.start() == frame);
        Ok(args)
    }
}

/// Numbers of frames, from the first to the last.
#[derive(Clone, Debug)]
pub(super) struct Frames(pub(super) RangeInclusive<u32>);

fn frames(text: &str) -> Result<Frames, String> {
    let (first, last) = text.split_once("..").unwrap_or((text, text));
    match (first.trim().parse(), last.trim().parse()) {
        (Ok(first), Ok(last)) if first <= last => Ok(Frames(first..=last)),
        _ => Err("expected one frame or the first and the last of several, as in 1..24".to_owned()),
    }
}

/// An address as the option wants it; who is there is found out later.
fn host_and_port(text: &str) -> Result<String, String> {
    let port =
        text.rsplit_once(':').filter(|(host, _)| !host.is_empty()).and_then(|(_, port)| port.parse::<u16>().ok());
    port.filter(|p| *p > 0)
        .map(|_| text.to_owned())
        .ok_or_else(|| "expected HOST:PORT, as in localhost:14158".to_owned())
}

/// What is to be written: as asked for, or by the scene's name.
fn outputs(args: &RenderArgs) -> Vec<PathBuf> {
    if !args.out.is_empty() {
        return args.out.clone();
    }
    let stem = args.scene.file_stem().map_or("scene".into(), |s| s.to_string_lossy().into_owned());
    let number = if args.frames.is_some() { ".####" } else { "" };
    let name = match args.shard {
        // The checkpoint of a shard is all that is needed of it.
        Some(_) if args.checkpoint.is_some() => return Vec::new(),
        Some(Shard { index, count }) => format!("{stem}{number}.{index}of{count}.film"),
        None => format!("{stem}{number}.exr"),
    };
    vec![Path::new("out").join(name)]
}

/// Whether a path names a film file.
pub(in crate::cli) fn is_film_path(path: &Path) -> bool {
    has_extension(path, "film")
}

/// Films and pictures apart.
pub(super) struct Outputs {
    pub(super) pictures: Vec<PathBuf>,
    pub(super) films: Vec<PathBuf>,
}

impl Outputs {
    pub(super) fn new(args: &RenderArgs) -> Self {
        let (films, pictures) = outputs(args).into_iter().partition(|path| is_film_path(path));
        Self { pictures, films }
    }
}

/// Reads `2/3`.
fn shard(text: &str) -> Result<Shard, String> {
    let numbers = text.split_once('/').and_then(|(i, n)| Some((i.trim().parse().ok()?, n.trim().parse().ok()?)));
    match numbers {
        Some((index, count)) if 1 <= index && index <= count => Ok(Shard { index, count }),
        _ => Err("expected I/N with I from 1 to N, as in 2/3".to_owned()),
    }
}

/// Reads a number of seconds.
fn seconds(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|s| (1e-3..1e9).contains(s))
        .ok_or_else(|| "expected a number of seconds above 0".to_owned())
}
