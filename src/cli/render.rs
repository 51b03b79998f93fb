//! `yarnray render`

use std::{
    io::IsTerminal as _,
    ops::RangeInclusive,
    path::PathBuf,
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::{Failure, SceneArgs, bytes_in_words, write_text};
use crate::{
    ffi::oidn::Denoiser,
    image::{self, output::Format, png::ToneMap},
    render::{
        self, Progress, Rendered, Stop,
        denoise::Denoised,
        live::LiveView,
        picture::{self, Frame},
    },
    report::{Phases, RunRecord},
    scene::{Layers, Scene, animation::numbered},
    trace::World,
};

const EXAMPLES: &str = "Examples:
  yarnray render scenes/swatch.toml                                  writes out/swatch.exr
  yarnray render scenes/swatch.toml --spp 256 -o s.exr -o s.png      two formats of one render
  yarnray render scenes/glove.toml --curves glove.bcc --time 30      the best picture of half a minute
  yarnray render scenes/swatch.toml --crop 300,200,460,320 -o c.png  a part of the frame
  yarnray render scenes/single_yarn.toml --set yarn.sample.plies=1   any key of the scene";

#[derive(Args, Debug, Clone)]
#[command(after_help = EXAMPLES)]
pub(super) struct RenderArgs {
    /// The scene file.
    scene: PathBuf,
    /// Where to write; the extension names the format (.exr, .png, .hdr, .tif, ...). Repeatable. Default: out/SCENE.exr
    #[arg(short, long = "out", value_name = "PATH")]
    out: Vec<PathBuf>,
    /// Render these frames of a sequence, the last included; put #### or {frame} into the names of outputs.
    #[arg(long, value_name = "A..B", value_parser = frames)]
    frames: Option<Frames>,
    /// Add a denoised picture, by Open Image Denoise: a layer of an EXR, else a file of its own (x.denoised.png).
    #[arg(long)]
    denoise: bool,
    /// Show the picture while it is made, in a running tev (its own address is 127.0.0.1:14158).
    #[arg(long, value_name = "HOST:PORT", value_parser = host_and_port)]
    display: Option<String>,
    /// Curve of the picture for a screen.
    #[arg(long, value_parser = ["srgb", "filmic"])]
    tone_map: Option<String>,
    /// Exposure of the picture for a screen, in stops.
    #[arg(long, value_name = "STOPS", allow_hyphen_values = true)]
    exposure: Option<f32>,
    /// Write statistics as JSON.
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
    /// No progress and no summary.
    #[arg(long, short)]
    quiet: bool,
    /// More about the scene and the run.
    #[arg(long, short)]
    verbose: bool,
    #[command(flatten)]
    options: SceneArgs,
}

pub(super) fn run(args: &RenderArgs) -> Result<(), Failure> {
    let Some(frames) = &args.frames else { return run_one(args) };
    let each: Vec<RenderArgs> = frames.0.clone().map(|frame| args.of_frame(frame)).collect::<Result<_, _>>()?;
    each.iter().try_for_each(run_one)
}

impl RenderArgs {
    /// The arguments for one frame of several.
    fn of_frame(&self, frame: u32) -> Result<Self, Failure> {
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
        args.options.set.push(format!("render.frame={frame}"));
        Ok(args)
    }
}

fn run_one(args: &RenderArgs) -> Result<(), Failure> {
    let started = Instant::now();
    let mut scene = args.options.load(&args.scene)?;
    let outputs = outputs(args);
    let mut layered = false;
    for path in &outputs {
        layered |= image::output::check_writable(path)? == Format::Exr;
    }
    if let Some(stats) = &args.stats {
        image::output::check_target(stats)?;
    }
    scene.denoise |= args.denoise;
    if !layered {
        scene.layers = Layers::NONE;
    }
    match args.tone_map.as_deref() {
        Some("filmic") => scene.display.tone_map = ToneMap::Filmic,
        Some(_) => scene.display.tone_map = ToneMap::Srgb,
        None => {}
    }
    if let Some(exposure) = args.exposure {
        scene.display.exposure = exposure;
    }
    let threads = scene.render.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Failure::Input(format!("error: cannot start {threads} threads: {e}")))?;
    let load = started.elapsed();
    pool.install(|| {
        let (world, made) = World::new(&scene, threads)?;
        warn(args, &scene, &world);
        let denoiser = if scene.denoise { Some(Denoiser::new(threads)?) } else { None };
        let interrupt = interrupt_flag();
        let bar = bar(args);
        let mut live = args.display.as_ref().map(|address| LiveView::connect(address, &scene.path));
        let rendered = render::render(&scene, &world, &interrupt, |p| {
            show(&bar, args, &p);
            if let Some(live) = &mut live {
                live.show(p.film);
            }
        });
        bar.finish_and_clear();
        if let (Some(problem), Some(address)) = (live.and_then(|l| l.finish(&rendered.film)), &args.display)
            && !args.quiet
        {
            eprintln!("warning: the viewer at {address}: {problem}");
        }

        let denoising = Instant::now();
        let denoised = denoiser.map(|d| Denoised::new(&d, &rendered.film)).transpose();
        let denoise = denoising.elapsed();
        let mut phases = Phases { denoise, load, made, render: rendered.elapsed, ..Phases::default() };
        let writing = Instant::now();
        let command = std::env::args().collect::<Vec<_>>().join(" ");
        let record = |phases| RunRecord { scene: &scene, world: &world, rendered: &rendered, phases, threads };
        let attributes = record(phases).attributes(&command);
        // What was rendered is kept even if the denoiser fails.
        let clean = denoised.as_ref().ok().and_then(Option::as_ref);
        let mut written = Vec::new();
        let frame = Frame::new(&scene);
        for path in &outputs {
            picture::write(path, &frame, &rendered.film, clean, &attributes)?;
            written.push(path.clone());
            if let (Some(clean), Some(path)) = (clean, picture::denoised_path(path)) {
                picture::write_denoised(&path, &frame, &rendered.film, clean)?;
                written.push(path);
            }
        }
        denoised?;
        phases.write = writing.elapsed();
        phases.total = started.elapsed();
        if let Some(path) = &args.stats {
            let text = serde_json::to_string_pretty(&record(phases).to_json()).expect("numbers and text become JSON");
            write_text(path, &(text + "\n"))?;
        }
        if !args.quiet {
            summary(args, &world, &rendered, &phases, &written);
        }
        if rendered.stop == Stop::Interrupted { Err(Failure::Interrupted) } else { Ok(()) }
    })
}

/// Numbers of frames, from the first to the last.
#[derive(Clone, Debug)]
struct Frames(RangeInclusive<u32>);

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

fn outputs(args: &RenderArgs) -> Vec<PathBuf> {
    if args.out.is_empty() {
        let stem = args.scene.file_stem().map_or("scene".into(), |s| s.to_string_lossy().into_owned());
        let number = if args.frames.is_some() { ".####" } else { "" };
        return vec![PathBuf::from("out").join(format!("{stem}{number}.exr"))];
    }
    args.out.clone()
}

/// Raised by SIGINT or SIGTERM; a second signal ends the process at once.
pub(super) fn interrupt_flag() -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        // Registration fails only for signals that cannot be caught.
        let _ = signal_hook::flag::register_conditional_shutdown(signal, 130, Arc::clone(&flag));
        let _ = signal_hook::flag::register(signal, Arc::clone(&flag));
    }
    flag
}

fn warn(args: &RenderArgs, scene: &Scene, world: &World) {
    if args.quiet {
        return;
    }
    for warning in &scene.warnings {
        eprintln!("warning: {warning}");
    }
    const SHOWN: usize = 3;
    let total = world.tight_bends().count();
    for (weave, bend) in world.tight_bends().take(if args.verbose { usize::MAX } else { SHOWN }) {
        eprintln!(
            "warning: {}: yarn {} bends too tightly at segment {}: its radius is {:.2} times its radius of curvature, \
             and the tube folds into itself",
            scene.fabrics[weave].origin, bend.yarn, bend.segment, bend.tightness
        );
    }
    if total > SHOWN && !args.verbose {
        eprintln!("warning: ... and {} more yarns with such bends (-v shows all)", total - SHOWN);
    }
    if scene.lights.is_empty() {
        eprintln!("warning: the scene has no light: the picture will be black");
    }
}

fn bar(args: &RenderArgs) -> ProgressBar {
    if args.quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::stderr());
    let style = ProgressStyle::with_template("{wide_bar} {percent}%  {msg}  {elapsed} (left: {eta})");
    bar.set_style(style.expect("the template is well formed"));
    bar
}

fn show(bar: &ProgressBar, args: &RenderArgs, p: &Progress<'_>) {
    let noise = p.noise.map_or(String::new(), |n| format!(", noise {n:.2e}"));
    bar.set_position((p.share * 1000.0) as u64);
    bar.set_message(format!("{} of {} spp{noise}", p.spp, p.spp_end));
    if args.verbose && bar.is_hidden() && !args.quiet {
        let left = p.elapsed.as_secs_f64() * (1.0 / p.share.max(1e-3) - 1.0);
        eprintln!("{} of {} spp{noise}, {:.1} s, about {left:.0} s left", p.spp, p.spp_end, p.elapsed.as_secs_f64());
    }
}

fn summary(args: &RenderArgs, world: &World, rendered: &Rendered, phases: &Phases, outputs: &[PathBuf]) {
    let s = |d: Duration| format!("{:.2} s", d.as_secs_f64());
    let (_, spp, _) = rendered.film.samples();
    let c = &rendered.counters;
    for path in outputs {
        eprintln!("wrote {}", path.display());
    }
    eprintln!(
        "{spp:.0} spp in {} ({:.2} M samples/s), stopped by {}; load {}, curves {}, BVH {}, total {}",
        s(phases.render),
        c.camera as f64 / 1e6 / phases.render.as_secs_f64().max(1e-9),
        rendered.stop.name(),
        s(phases.load),
        s(phases.made.generate),
        s(phases.made.build),
        s(phases.total),
    );
    if args.verbose {
        eprintln!(
            "curves {}, BVH {}, peak memory {}; rays: {} from the camera, {} bounced, {} to lights",
            bytes_in_words(world.geometry_bytes()),
            bytes_in_words(world.bvh_bytes()),
            bytes_in_words(crate::report::peak_rss_bytes()),
            c.camera,
            c.bounce,
            c.shadow
        );
    }
    if c.invalid > 0 {
        eprintln!("warning: {} samples were not finite and were left out", c.invalid);
    }
}
