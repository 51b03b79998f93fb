//! `yarnray render`

mod checkpoint;
mod options;
mod progress;

use std::time::{Duration, Instant};

use super::{
    Failure, command_line,
    files::{Attempts, Files},
    log,
    pictures::{denoised_beside, write_pictures},
    signals::{interrupt_flag, interrupted},
    thread_pool, write_text,
};
use crate::{
    cloth::Cloth,
    ffi::{heap, oidn::Denoiser},
    image::{self, output::Format},
    plan::Memory,
    render::{
        self, Checkpoints, Control, Job, Rendered, Stop,
        denoise::Denoised,
        film_file::About,
        live::LiveView,
        picture::{Frame, Picture},
    },
    report::{self, Phases, RunRecord},
    scene::{Layers, Scene},
};
use checkpoint::{Lock, Saver, check_shard, old_checkpoint, resumed};
use options::Outputs;
pub(super) use options::{RenderArgs, is_film_path};
use progress::{bar, show, summary, warn};

pub(super) fn run(args: &RenderArgs) -> Result<(), Failure> {
    args.log.start();
    let Some(frames) = &args.frames else { return run_one(args) };
    frames.0.clone().try_for_each(|frame| run_one(&args.of_frame(frame)?))
}

fn run_one(args: &RenderArgs) -> Result<(), Failure> {
    let started = Instant::now();
    let outputs = Outputs::new(args);
    for path in &outputs.pictures {
        Format::of(path)?;
    }
    files(args, &outputs).refuse()?;
    let mut scene = args.options.load(&args.scene, args.log.quiet || args.log.log_json)?;
    check_and_apply(args, &outputs, &mut scene)?;
    let memory = Memory::new(&scene);
    memory.check()?;
    let (pool, threads) = thread_pool(scene.render.threads)?;
    let _lock = Lock::take(args)?;
    let old = old_checkpoint(args)?;
    heap::give_back();
    let load = started.elapsed();
    log::phase("load", load);
    // Of a sequence: what came while a later frame was loaded.
    if interrupted() {
        return Err(Failure::Interrupted);
    }
    pool.install(|| {
        // Making it takes the curves.
        let yarns: Vec<usize> = scene.fabrics.iter().map(|f| f.curves.len()).collect();
        let (cloth, made) = Cloth::consuming(&mut scene, threads, memory.limit, memory.bytes())?;
        let world = cloth.world();
        warn(args, &scene, world, &yarns);
        // A film keeps what guides it, for a merge of all parts.
        let denoiser = if scene.denoise && !outputs.pictures.is_empty() { Some(Denoiser::new(threads)?) } else { None };
        log::phase("generate", made.generate);
        log::phase("build", made.build);
        let about = About::new(&scene, &world.embree_version(), report::metadata(&scene, world), args.shard);
        let job = match old {
            Some(old) => resumed(old, &about, args)?,
            None => Job::new(&scene, args.shard)?,
        };
        let before = job.elapsed;
        let mut saver = Saver { args, about: &about, films: &outputs.films, failed: Vec::new(), written: Vec::new() };
        let rendered = render_shown(args, &scene, &cloth, job, &mut saver);
        let render = rendered.elapsed.saturating_sub(before);
        log::phase("render", render);

        let denoising = Instant::now();
        let denoised = denoiser.map(|d| Denoised::new(&d, &rendered.film)).transpose();
        let denoise = if scene.denoise { denoising.elapsed() } else { Duration::ZERO };
        let mut phases = Phases { denoise, load, made, render, ..Phases::default() };
        let writing = Instant::now();
        let command = command_line();
        let record = |phases| RunRecord { scene: &scene, world, rendered: &rendered, phases, threads };
        let attributes = record(phases).attributes(&command);
        // What was rendered is kept even if the denoiser fails.
        let clean = denoised.as_ref().ok().and_then(Option::as_ref);
        // What one file's disk refuses, another's may take.
        let mut attempts = Attempts::default();
        let frame = Frame::new(&scene);
        let picture = Picture { frame: &frame, film: &rendered.film, denoised: clean, attributes: &attributes };
        let mut written = write_pictures(&outputs.pictures, &picture, &mut attempts);
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
        let counters = &rendered.counters;
        if counters.invalid > counters.camera / 2 {
            let problem = format!("{} of {} samples are not finite", counters.invalid, counters.camera);
            return Err(Failure::hinted(problem, "lights too bright, or places too far, for single precision"));
        }
        match rendered.stop {
            Stop::Interrupted => Err(Failure::Interrupted),
            Stop::Time if counters.camera == 0 => {
                Err(Failure::hinted("no sample was taken in the time", "a longer --time"))
            }
            _ => Ok(()),
        }
    })
}

/// What is read and written, but for pictures without noise, which the scene may ask for.
fn files(args: &RenderArgs, outputs: &Outputs) -> Files {
    Files::default()
        .reads("SCENE", [&args.scene])
        .reads("--curves", &args.options.curves)
        .writes("-o", &outputs.pictures)
        .writes("-o", &outputs.films)
        .writes("--stats", &args.stats)
        .writes("--checkpoint", &args.checkpoint)
}

/// Refuses outputs that cannot be written, before any work, and lets options of the output win over the scene's.
fn check_and_apply(args: &RenderArgs, outputs: &Outputs, scene: &mut Scene) -> Result<(), Failure> {
    let denoised = if args.denoise || scene.denoise { denoised_beside(&outputs.pictures) } else { Vec::new() };
    files(args, outputs).writes("--denoise", &denoised).check(false)?;
    // A film may become any picture.
    let mut layered = !outputs.films.is_empty() || args.checkpoint.is_some();
    let [x0, y0, x1, y1] = scene.render.crop.map(|v| v as usize);
    for path in &outputs.pictures {
        layered |= image::output::check_writable(path)? == Format::Exr;
        image::output::check_size(path, x1 - x0, y1 - y0)?;
    }
    for path in outputs.films.iter().chain(&args.checkpoint).chain(&args.stats) {
        image::whole_file::check(path)?;
    }
    check_shard(args, scene, outputs)?;
    scene.denoise |= args.denoise;
    if !layered {
        scene.layers = Layers::NONE;
    }
    args.screen.apply(&mut scene.display);
    Ok(())
}

/// Renders, tells how far it is and shows the picture while it is made, and saves films.
fn render_shown(args: &RenderArgs, scene: &Scene, cloth: &Cloth, job: Job, saver: &mut Saver<'_>) -> Rendered {
    let interrupt = interrupt_flag();
    let bar = bar(args);
    let mut last_line = None;
    let mut live = args.display.as_ref().map(|address| LiveView::connect(address, &scene.path));
    let rendered = render::run(
        scene,
        cloth,
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
    rendered
}
