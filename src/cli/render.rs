//! `yarnray render`

use std::{
    io::IsTerminal as _,
    ops::RangeInclusive,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::{
    Failure, SceneArgs, bytes_in_words,
    files::{Attempts, Files},
    log::{self, LogArgs},
    signals::interrupt_flag,
    thread_pool, write_text,
};
use crate::{
    cloth::Cloth,
    ffi::oidn::Denoiser,
    image::{self, ImageError, output::Format, png::ToneMap},
    plan::Memory,
    render::{
        self, Checkpoints, Control, Job, Progress, Rendered, Shard, Stop,
        denoise::Denoised,
        film_file::{self, About},
        live::LiveView,
        picture::{self, Frame},
    },
    report::{self, Phases, RunRecord},
    scene::{Layers, Scene, animation::numbered},
    trace::World,
};

const EXAMPLES: &str = "Examples:
  yarnray render scenes/swatch.toml                                  writes out/swatch.exr
  yarnray render scenes/swatch.toml --spp 256 -o s.exr -o s.png      two formats of one render
  yarnray render scenes/glove.toml --curves glove.bcc --time 30      the best picture of half a minute
  yarnray render scenes/swatch.toml --crop 300,200,460,320 -o c.png  a part of the frame
  yarnray render scenes/swatch.toml --checkpoint c.film --resume     goes on where it was stopped
  yarnray render scenes/swatch.toml --shard 1/3 -o 1.film            a third of the samples, for `yarnray merge`
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
    #[arg(long, value_name = "STOPS", value_parser = stops)]
    exposure: Option<f32>,
    /// Write statistics as JSON.
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
    /// Save what there is to this film file: first after 5 seconds, then by interval, and at the end.
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Seconds between two checkpoints.
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = seconds, requires = "checkpoint")]
    checkpoint_every: f64,
    /// Go on from the checkpoint if there is one; more --spp than it has extends it.
    #[arg(long, requires = "checkpoint")]
    resume: bool,
    /// Take only this part of the samples, such as 2/3; `yarnray merge` puts films of all parts together.
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<Shard>,
    #[command(flatten)]
    log: LogArgs,
    #[command(flatten)]
    options: SceneArgs,
}

pub(super) fn run(args: &RenderArgs) -> Result<(), Failure> {
    args.log.start();
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
        args.checkpoint = self.checkpoint.as_ref().map(named).transpose()?;
        args.options.set.push(format!("render.frame={frame}"));
        Ok(args)
    }
}

fn run_one(args: &RenderArgs) -> Result<(), Failure> {
    let started = Instant::now();
    let mut scene = args.options.load(&args.scene)?;
    let outputs = Outputs::new(args);
    let denoised: Vec<PathBuf> = outputs
        .pictures
        .iter()
        .filter(|_| args.denoise || scene.denoise)
        .filter_map(|p| picture::denoised_path(p))
        .collect();
    Files::default()
        .reads("SCENE", [&args.scene])
        .reads("--curves", &args.options.curves)
        .writes("-o", &outputs.pictures)
        .writes("-o", &outputs.films)
        .writes("--denoise", &denoised)
        .writes("--stats", &args.stats)
        .writes("--checkpoint", &args.checkpoint)
        .check(false)?;
    // A film may become any picture.
    let mut layered = !outputs.films.is_empty() || args.checkpoint.is_some();
    for path in &outputs.pictures {
        layered |= image::output::check_writable(path)? == Format::Exr;
    }
    for path in outputs.films.iter().chain(&args.checkpoint) {
        image::output::check_file(path)?;
    }
    check_shard(args, &scene, &outputs)?;
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
    let memory = Memory::new(&scene);
    memory.check()?;
    let (pool, threads) = thread_pool(scene.render.threads)?;
    let old = old_checkpoint(args)?;
    let load = started.elapsed();
    log::phase("load", load);
    pool.install(|| {
        // Making it takes the curves.
        let yarns: Vec<usize> = scene.fabrics.iter().map(|f| f.curves.len()).collect();
        let (cloth, made) = Cloth::consuming(&mut scene, threads, memory.limit, memory.bytes())?;
        let world = cloth.world();
        warn(args, &scene, world, &yarns);
        let denoiser = if scene.denoise { Some(Denoiser::new(threads)?) } else { None };
        log::phase("generate", made.generate);
        log::phase("build", made.build);
        let about = About::new(&scene, &world.embree_version(), report::metadata(&scene, world), args.shard);
        let job = match old {
            Some(old) => resumed(old, &about, args)?,
            None => Job::new(&scene, args.shard)?,
        };
        let before = job.elapsed;
        let interrupt = interrupt_flag();
        let bar = bar(args);
        let mut saver = Saver { args, about: &about, films: &outputs.films, failed: Vec::new(), written: Vec::new() };
        let mut last_line = None;
        let mut live = args.display.as_ref().map(|address| LiveView::connect(address, &scene.path));
        let rendered = render::run(
            &scene,
            &cloth,
            job,
            Control {
                interrupt: &interrupt,
                progress: &mut |p| {
                    show(&bar, &mut last_line, &p);
                    if let Some(live) = &mut live {
                        live.show(p.film);
                    }
                },
                checkpoints: saver.needed().then_some(Checkpoints {
                    every: args.checkpoint.is_some().then(|| Duration::from_secs_f64(args.checkpoint_every)),
                    save: &mut |job, last| saver.save(job, last),
                }),
            },
        );
        log::past(None);
        bar.finish_and_clear();
        if let (Some(problem), Some(address)) = (live.and_then(|l| l.finish(&rendered.film)), &args.display) {
            tracing::warn!("the viewer at {address}: {problem}");
        }
        let render = rendered.elapsed.saturating_sub(before);
        log::phase("render", render);

        let denoising = Instant::now();
        let denoised = denoiser.map(|d| Denoised::new(&d, &rendered.film)).transpose();
        let denoise = if scene.denoise { denoising.elapsed() } else { Duration::ZERO };
        let mut phases = Phases { denoise, load, made, render, ..Phases::default() };
        let writing = Instant::now();
        let command = std::env::args().collect::<Vec<_>>().join(" ");
        let record = |phases| RunRecord { scene: &scene, world, rendered: &rendered, phases, threads };
        let attributes = record(phases).attributes(&command);
        // What was rendered is kept even if the denoiser fails.
        let clean = denoised.as_ref().ok().and_then(Option::as_ref);
        // What one file's disk refuses, another's may take.
        let (mut attempts, mut written) = (Attempts::default(), Vec::new());
        let frame = Frame::new(&scene);
        for path in &outputs.pictures {
            if attempts.note(picture::write(path, &frame, &rendered.film, clean, &attributes)) {
                written.push(path.clone());
            }
            if let (Some(clean), Some(path)) = (clean, picture::denoised_path(path))
                && attempts.note(picture::write_denoised(&path, &frame, &rendered.film, clean))
            {
                written.push(path);
            }
        }
        attempts.note(denoised.map(drop));
        phases.write = writing.elapsed();
        log::phase("write", phases.write);
        phases.total = started.elapsed();
        if let Some(path) = &args.stats {
            let text = serde_json::to_string_pretty(&record(phases).to_json()).expect("numbers and text become JSON");
            attempts.note(write_text(path, &(text + "\n")));
        }
        written.extend(saver.written);
        summary(world, &rendered, &phases, &written);
        saver.failed.into_iter().for_each(|error| _ = attempts.note(Err::<(), _>(error)));
        attempts.finish()?;
        if rendered.stop == Stop::Interrupted { Err(Failure::Interrupted) } else { Ok(()) }
    })
}

/// Reads a number of stops.
fn stops(text: &str) -> Result<f32, String> {
    text.parse()
        .ok()
        .filter(|s| (-100.0..=100.0).contains(s))
        .ok_or_else(|| "expected a number of stops from -100 to 100".to_owned())
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
pub(super) fn is_film_path(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("film"))
}

/// Films and pictures apart.
struct Outputs {
    pictures: Vec<PathBuf>,
    films: Vec<PathBuf>,
}

impl Outputs {
    fn new(args: &RenderArgs) -> Self {
        let (films, pictures) = outputs(args).into_iter().partition(|path| is_film_path(path));
        Self { pictures, films }
    }
}

/// A shard takes its samples, all of them, and leaves a film.
fn check_shard(args: &RenderArgs, scene: &Scene, outputs: &Outputs) -> Result<(), Failure> {
    if args.shard.is_none() {
        return Ok(());
    }
    let r = &scene.render;
    let wrong = [("time", r.time.is_some()), ("noise", r.noise.is_some()), ("adaptive", r.adaptive)];
    if let Some((name, _)) = wrong.iter().find(|(_, set)| *set) {
        return Err(Failure::Input(format!(
            "error: --shard with render.{name}: a shard takes just its samples, or the shards would not make one picture\n  \
             hint: leave out --{name}; --spp says how many samples all shards take together"
        )));
    }
    if outputs.films.is_empty() && args.checkpoint.is_none() {
        return Err(Failure::Input(
            "error: --shard without a film: pictures of shards cannot be merged\n  hint: -o PART.film, or --checkpoint PART.film"
                .to_owned(),
        ));
    }
    Ok(())
}

/// The checkpoint to go on from, if there is one and it is asked for.
fn old_checkpoint(args: &RenderArgs) -> Result<Option<(About, Job)>, Failure> {
    let Some(path) = args.checkpoint.as_deref().filter(|path| path.exists()) else { return Ok(None) };
    if !args.resume {
        return Err(Failure::Input(format!(
            "error: {} is there already\n  hint: --resume goes on with it; remove it to begin anew",
            path.display()
        )));
    }
    Ok(Some(film_file::read(path)?))
}

/// The job of a checkpoint, if it is this render's.
fn resumed((there, mut job): (About, Job), about: &About, args: &RenderArgs) -> Result<Job, Failure> {
    let path = args.checkpoint.as_deref().unwrap_or(Path::new("")).display();
    let differences = about.differences(&there);
    if !differences.is_empty() {
        return Err(Failure::Input(format!(
            "error: {path} is a checkpoint of another render:\n  {}\n  hint: render with the same keys, or remove it to begin \
             anew",
            differences.join("\n  ")
        )));
    }
    tracing::info!(checkpoint = %path, spp = job.done, "resumed from {path} at {} spp", job.done);
    if about.shard.is_none() {
        job.samples.end = about.spp;
    }
    if job.done > about.spp {
        tracing::warn!("{path} has {} spp already: they are kept", job.done);
    }
    Ok(job)
}

/// Saves films: the checkpoint now and then, and all of them at the end.
struct Saver<'a> {
    args: &'a RenderArgs,
    about: &'a About,
    films: &'a [PathBuf],
    /// Why the last ones could not be saved.
    failed: Vec<ImageError>,
    /// The films that were, besides the checkpoint.
    written: Vec<PathBuf>,
}

impl Saver<'_> {
    fn needed(&self) -> bool {
        self.args.checkpoint.is_some() || !self.films.is_empty()
    }

    fn save(&mut self, job: &Job, last: bool) {
        self.failed.clear();
        let films = if last { self.films } else { &[] };
        for path in self.args.checkpoint.iter().chain(films) {
            let began = Instant::now();
            match film_file::write(path, self.about, job) {
                Ok(()) => {
                    if films.contains(path) {
                        self.written.push(path.clone());
                    }
                    let seconds = began.elapsed().as_secs_f64();
                    let path = path.display();
                    tracing::debug!(checkpoint = %path, spp = job.done, seconds, "saved {path} in {seconds:.3} s");
                }
                Err(error) => {
                    // Hours of work are not thrown away for a disk that is full now.
                    if !last {
                        tracing::warn!("the render goes on without a checkpoint: {error}");
                    }
                    self.failed.push(error);
                }
            }
        }
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

/// `yarns` are the numbers of yarns of each fabric.
fn warn(args: &RenderArgs, scene: &Scene, world: &World, yarns: &[usize]) {
    for warning in &scene.warnings {
        tracing::warn!("{warning}");
    }
    for (i, fabric) in scene.fabrics.iter().enumerate() {
        let bends = || world.tight_bends().filter(|(of, _)| *of == i).map(|(_, bend)| bend);
        let Some(worst) = bends().max_by(|a, b| a.fold.total_cmp(&b.fold)) else { continue };
        tracing::warn!(
            "{}: {} of {} yarns bend so tightly that they fold into themselves and their plies break; the worst is yarn {} \
             at segment {}, whose inner side runs backwards by {:.1} of its radius{}",
            fabric.origin,
            bends().count(),
            yarns[i],
            worst.yarn,
            worst.segment,
            worst.fold,
            match (fabric.from_file && 2 * bends().count() > yarns[i], args.log.verbose > 0) {
                (true, _) => "; is the radius or the unit of the file another one? `yarnray info` of it proposes both",
                (false, false) => " (-v shows all)",
                (false, true) => "",
            }
        );
        for bend in bends() {
            tracing::debug!("yarn {} folds at segment {} by {:.2} of its radius", bend.yarn, bend.segment, bend.fold);
        }
    }
    if scene.lights.is_empty() {
        tracing::warn!("the scene has no light: the picture will be black");
    }
}

fn bar(args: &RenderArgs) -> ProgressBar {
    if args.log.quiet || args.log.log_json || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::stderr());
    let style = ProgressStyle::with_template("{wide_bar} {percent}%  {msg}  {elapsed}");
    bar.set_style(style.expect("the template is well formed"));
    log::past(Some(&bar));
    bar
}

/// Shows the progress on the bar; tells it at most once a second, or of every wave with -vv.
fn show(bar: &ProgressBar, last_line: &mut Option<Instant>, p: &Progress<'_>) {
    let noise = p.noise.map_or(String::new(), |n| format!(", noise {n:.2e}"));
    let left = p.left.as_secs_f64();
    bar.set_position((p.share * 1000.0) as u64);
    bar.set_message(format!("{} of {} spp{noise}  (left: {left:.0} s)", p.spp, p.spp_end));
    let seconds = p.elapsed.as_secs_f64();
    let line = format!("{} of {} spp{noise}, {seconds:.1} s, about {left:.0} s left", p.spp, p.spp_end);
    let (spp, spp_end, share, noise) = (p.spp, p.spp_end, p.share, p.noise);
    if last_line.is_none_or(|t: Instant| t.elapsed() >= Duration::from_secs(1)) {
        *last_line = Some(Instant::now());
        tracing::debug!(phase = "render", spp, spp_end, share, noise, seconds, seconds_left = left, "{line}");
    } else {
        tracing::trace!(phase = "render", spp, spp_end, share, noise, seconds, seconds_left = left, "{line}");
    }
}

fn summary(world: &World, rendered: &Rendered, phases: &Phases, outputs: &[PathBuf]) {
    let s = |d: Duration| format!("{:.2} s", d.as_secs_f64());
    let (least, spp, most) = rendered.film.samples();
    let c = &rendered.counters;
    for path in outputs {
        tracing::info!(path = %path.display(), "wrote {}", path.display());
    }
    let denoise = if phases.denoise.is_zero() { String::new() } else { format!(", denoised in {}", s(phases.denoise)) };
    tracing::info!(
        spp,
        stopped_by = rendered.stop.name(),
        seconds = phases.total.as_secs_f64(),
        "{spp:.0} spp in {} ({:.2} M samples/s), stopped by {}; load {}, curves {}, BVH {}{denoise}, total {}",
        s(rendered.elapsed),
        c.camera as f64 / 1e6 / rendered.elapsed.as_secs_f64().max(1e-9),
        rendered.stop.name(),
        s(phases.load),
        s(phases.made.generate),
        s(phases.made.build),
        s(phases.total),
    );
    tracing::debug!(
        "curves {}, BVH {}, peak memory {}; rays: {} from the camera, {} bounced, {} to lights",
        bytes_in_words(world.geometry_bytes()),
        bytes_in_words(world.bvh_bytes()),
        bytes_in_words(report::peak_rss_bytes()),
        c.camera,
        c.bounce,
        c.shadow
    );
    if c.invalid > 0 {
        tracing::warn!("{} samples were not finite and were left out", c.invalid);
    }
    if least == 0 && most > 0 {
        tracing::warn!("some pixels have no sample and are black: the time was too short for one sample each");
    }
}
