//! The driver: samples in waves over tiles on all threads, until enough.
//!
//! A wave takes every pixel from one number of samples to another. Tiles own their pixels, a sample depends on (seed,
//! pixel, sample number) only, and sums are exact: the picture is the same to the bit for any number of threads, and
//! for any way to split its samples among runs and machines.

mod adaptive;
pub(crate) mod denoise;
pub(crate) mod film_file;
pub(crate) mod live;
pub(crate) mod merge;
pub mod picture;
mod stop;

use std::{
    ops::Range,
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use glam::Vec2;
use rayon::prelude::*;

pub use stop::Stop;

pub use crate::film::OutOfMemory;

use self::{
    adaptive::{PILOT, Target},
    stop::{WARM_UP, wave_end},
};
use crate::{
    cloth::Cloth,
    film::{Film, Noise, Tile},
    geometry::ray::Ray,
    integrator::{Counters, Integrator, Scratch},
    math::{
        sampler::{Sampler, hash2},
        warp::normal,
    },
    scene::{PixelFilter, Scene},
};

/// When the first checkpoint of a render is saved, if the interval is not shorter.
const FIRST_CHECKPOINT: Duration = Duration::from_secs(5);

/// One of several parts of a render, each with its share of the samples of every pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which one, from 1.
    pub index: u32,
    /// How many there are.
    pub count: u32,
}

impl Shard {
    /// The samples of this part of `spp`: parts differ by one sample at most.
    pub fn samples(self, spp: u32) -> Range<u32> {
        let cut = |i: u32| (u64::from(spp) * u64::from(i) / u64::from(self.count)) as u32;
        cut(self.index - 1)..cut(self.index)
    }
}

/// What there is to do and what has been done: all that a checkpoint must keep.
#[derive(Clone, Debug)]
pub struct Job {
    /// What pixels have collected.
    pub film: Film,
    /// The samples of each pixel's sequence that are asked for.
    pub samples: Range<u32>,
    /// How many of them every pixel has, in the mean.
    pub done: u32,
    /// Whether adaptive sampling has made its plan.
    pub planned: bool,
    /// What was done.
    pub counters: Counters,
    /// Time in which samples were taken, of all runs together.
    pub elapsed: Duration,
}

impl Job {
    /// A scene's render, or a part of it, from the beginning.
    ///
    /// # Errors
    /// If there is no memory for its film.
    pub fn new(scene: &Scene, shard: Option<Shard>) -> Result<Self, OutOfMemory> {
        let spp = scene.render.spp;
        let samples = shard.map_or(0..spp, |s| s.samples(spp));
        let mut film = Film::new(scene.render.crop, scene.collected(), scene.light_scale())?;
        film.tiles_mut().iter_mut().for_each(|t| t.next = [samples.start; 2]);
        let counters = Counters::default();
        Ok(Self { film, samples, done: 0, planned: false, counters, elapsed: Duration::ZERO })
    }

    /// How far tiles go so that all pixels have `level` samples in the mean.
    fn target(&self, level: u32) -> Target {
        if self.planned { Target::of_plan(&self.film, level) } else { Target::Even(self.samples.start + level) }
    }

    /// The noise, where a render in a piece would look at it: between waves, after the warm-up.
    fn noise_between_waves(&self) -> Option<Noise> {
        if self.done < WARM_UP {
            return None;
        }
        let target = self.target(self.done);
        self.film.tiles().iter().all(|t| t.next == target.of(t)).then(|| self.film.noise()).flatten()
    }
}

/// Where a render stands, for a progress display.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// What pixels have collected so far.
    pub film: &'a Film,
    /// Samples per pixel taken so far.
    pub spp: u32,
    /// Samples per pixel to take at most.
    pub spp_end: u32,
    /// Share of all work done, 0 to 1, by samples or by time, whichever ends first.
    pub share: f64,
    /// Time since this run's rendering began.
    pub elapsed: Duration,
    /// Time until all work is done, as the work of this run tells.
    pub left: Duration,
    /// The estimated relative mean square error, once there is one.
    pub noise: Option<f64>,
}

/// When to save what there is, and how.
pub struct Checkpoints<'a> {
    /// The time between two checkpoints, the first of which comes after five seconds; `None` saves at the end only.
    pub every: Option<Duration>,
    /// Saves a job; called between tiles, and once at the end with `true`.
    pub save: &'a mut dyn FnMut(&Job, bool),
}

/// What happens beside a render.
pub struct Control<'a> {
    /// Ends the render after the tiles in work.
    pub interrupt: &'a AtomicBool,
    /// Called after every wave.
    pub progress: &'a mut dyn FnMut(Progress<'_>),
    /// Checkpoints, if there are to be any.
    pub checkpoints: Option<Checkpoints<'a>>,
}

/// A finished or interrupted render.
#[derive(Debug)]
pub struct Rendered {
    /// What pixels have collected.
    pub film: Film,
    /// What was done.
    pub counters: Counters,
    /// Time in which samples were taken, of all runs together.
    pub elapsed: Duration,
    /// Why it ended.
    pub stop: Stop,
}

/// Renders in the calling thread's rayon pool. `interrupt` ends the render after the tiles in work; `progress` is
/// called after every wave.
///
/// # Errors
/// If there is no memory for a film.
pub fn render(
    scene: &Scene,
    cloth: &Cloth,
    interrupt: &AtomicBool,
    mut progress: impl FnMut(Progress<'_>),
) -> Result<Rendered, OutOfMemory> {
    let job = Job::new(scene, None)?;
    Ok(run(scene, cloth, job, Control { interrupt, progress: &mut progress, checkpoints: None }))
}

/// Goes on with a job until the first of the scene's limits, in the calling thread's rayon pool.
pub fn run(scene: &Scene, cloth: &Cloth, mut job: Job, mut control: Control<'_>) -> Rendered {
    let settings = &scene.render;
    let total = job.samples.end.saturating_sub(job.samples.start);
    let before = job.elapsed;
    let first_done = job.done;
    let started = Instant::now();
    let limits = Limits {
        interrupt: control.interrupt,
        deadline: settings.time.map(|t| started + Duration::from_secs_f64(t.min(1e9)).saturating_sub(before)),
    };
    let every = control.checkpoints.as_ref().and_then(|c| c.every);
    let mut next_save = every.map(|every| started + every.min(FIRST_CHECKPOINT));
    let mut save = |job: &mut Job, last: bool| -> Option<Instant> {
        job.elapsed = before + started.elapsed();
        if let Some(checkpoints) = &mut control.checkpoints {
            (checkpoints.save)(job, last);
        }
        every.map(|every| Instant::now() + every)
    };
    let integrator = Integrator::new(scene, cloth);
    let stop = loop {
        let noise = if settings.noise.is_some() { job.noise_between_waves() } else { None };
        if job.done > first_done {
            let elapsed = started.elapsed();
            let share = |done: f64, all: f64| (done / all.max(1e-9)).min(1.0);
            let of_samples = |from: u32| share(f64::from(job.done - from), f64::from(total.saturating_sub(from)));
            let of_time = |from: Duration| {
                settings.time.map_or(0.0, |t| share((before + elapsed - from).as_secs_f64(), t - from.as_secs_f64()))
            };
            let this_run = of_samples(first_done).max(of_time(before)).max(1e-6);
            (control.progress)(Progress {
                film: &job.film,
                spp: job.done,
                spp_end: total,
                share: of_samples(0).max(of_time(Duration::ZERO)),
                elapsed,
                left: elapsed.mul_f64((1.0 / this_run - 1.0).max(0.0)),
                noise: noise.map(|n| n.estimate),
            });
        }
        if job.done >= total {
            break Stop::Samples;
        }
        if let (Some(limit), Some(noise)) = (settings.noise, noise)
            && noise.estimate <= limit
        {
            break Stop::Noise;
        }
        let level = wave_end(job.done).min(total);
        let target = job.target(level);
        // A wave goes on after each checkpoint that is due within it.
        let complete = loop {
            let (counters, complete) = wave(scene, &integrator, &mut job.film, target, &limits, next_save);
            job.counters.add(&counters);
            if complete || limits.reached().is_some() {
                break complete;
            }
            next_save = save(&mut job, false);
        };
        if complete {
            job.done = level;
            if settings.adaptive && !job.planned && level == PILOT {
                adaptive::plan(&mut job.film);
                job.planned = true;
            }
        }
        if let Some(stop) = limits.reached().filter(|_| !complete || level < total) {
            break stop;
        }
        if next_save.is_some_and(|due| Instant::now() >= due) {
            next_save = save(&mut job, false);
        }
    };
    save(&mut job, true);
    Rendered { film: job.film, counters: job.counters, elapsed: job.elapsed, stop }
}

/// What ends a render between two tiles.
struct Limits<'a> {
    interrupt: &'a AtomicBool,
    deadline: Option<Instant>,
}

impl Limits<'_> {
    fn reached(&self) -> Option<Stop> {
        if self.interrupt.load(Ordering::Relaxed) {
            return Some(Stop::Interrupted);
        }
        self.deadline.is_some_and(|d| Instant::now() >= d).then_some(Stop::Time)
    }
}

/// Takes all tiles to their target, unless a limit or the time `until` comes first: what was done, and whether it was
/// all.
fn wave(
    scene: &Scene,
    integrator: &Integrator<'_>,
    film: &mut Film,
    target: Target,
    limits: &Limits<'_>,
    until: Option<Instant>,
) -> (Counters, bool) {
    let one = |scratch: &mut Scratch, tile: &mut Tile| {
        let to = target.of(tile);
        if tile.next[0] >= to[0] && tile.next[1] >= to[1] {
            return (Counters::default(), true);
        }
        if limits.reached().is_some() || until.is_some_and(|u| Instant::now() >= u) {
            return (Counters::default(), false);
        }
        (render_tile(scene, integrator, tile, to, scratch), true)
    };
    film.tiles_in_order().into_par_iter().with_max_len(1).map_init(Scratch::default, one).reduce(
        || (Counters::default(), true),
        |mut a, b| {
            a.0.add(&b.0);
            (a.0, a.1 && b.1)
        },
    )
}

/// Tells the random numbers of pictures from others that begin with the same seed.
const STREAM: u32 = 0x79a2_17a5;

/// Takes the pixels of a tile to a number of samples, by their colour on the chessboard.
fn render_tile(
    scene: &Scene,
    integrator: &Integrator<'_>,
    tile: &mut Tile,
    to: [u32; 2],
    scratch: &mut Scratch,
) -> Counters {
    let settings = &scene.render;
    let mut by_color = [Counters::default(); 2];
    let seed = hash2(settings.frame.map_or(settings.seed, |f| hash2(settings.seed, f)), STREAM);
    let moves = !scene.camera_path.is_empty() || scene.cloth_moves();
    for y in 0..tile.height {
        for x in 0..tile.width {
            let (px, py) = (tile.x + x, tile.y + y);
            let color = tile.color_of(x, y);
            let counters = &mut by_color[color];
            for index in tile.next[color]..to[color] {
                let mut sampler = Sampler::new(seed, px, py, index);
                let [u, v, lens_u, lens_v] = sampler.next4();
                let offset = Vec2::new(filter_offset(settings.filter, u), filter_offset(settings.filter, v));
                let point = Vec2::new(px as f32 + 0.5, py as f32 + 0.5) + offset;
                let lens = Vec2::new(lens_u, lens_v);
                let ray = if moves {
                    let [time, ..] = sampler.next4();
                    Ray { time, ..scene.camera_at(time).ray(point, lens, settings.width, settings.height) }
                } else {
                    scene.camera.ray(point, lens, settings.width, settings.height)
                };
                let sample = integrator.sample(ray, &mut sampler, scratch, counters);
                if !tile.add(x, y, &sample) {
                    counters.invalid += 1;
                }
            }
        }
    }
    for (rays, c) in tile.rays.iter_mut().zip(&by_color) {
        *rays += c.camera + c.bounce + c.shadow;
    }
    tile.next = std::array::from_fn(|k| tile.next[k].max(to[k]));
    let [mut counters, odd] = by_color;
    counters.add(&odd);
    counters
}

/// Share of a normal distribution beyond three deviations, to each side.
const BEYOND: f32 = 0.001_349_898;

/// An offset along one axis, in pixels, that follows the filter.
fn filter_offset(filter: PixelFilter, u: f32) -> f32 {
    match filter {
        PixelFilter::Box(half) => (2.0 * u - 1.0) * half,
        PixelFilter::Tent(reach) => {
            let x = 2.0 * u - 1.0;
            (1.0 - (1.0 - x.abs()).max(0.0).sqrt()).copysign(x) * reach
        }
        // Within three deviations: u is moved into the part of the distribution that is kept.
        PixelFilter::Gaussian(sigma) => normal(BEYOND + u * (1.0 - 2.0 * BEYOND)) * sigma,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_have_the_spread_they_say() {
        let n = 100_000;
        for (filter, deviation, reach) in [
            (PixelFilter::Box(0.5), 0.5 / 3f64.sqrt(), 0.5),
            (PixelFilter::Tent(1.0), 1.0 / 6f64.sqrt(), 1.0),
            (PixelFilter::Gaussian(0.5), 0.4935, 1.5),
        ] {
            let offsets: Vec<f64> =
                (0..n).map(|i| f64::from(filter_offset(filter, (i as f32 + 0.5) / n as f32))).collect();
            let mean = offsets.iter().sum::<f64>() / f64::from(n);
            let variance = offsets.iter().map(|o| o * o).sum::<f64>() / f64::from(n);
            assert!(mean.abs() < 1e-4, "{filter:?}: mean {mean}");
            assert!((variance.sqrt() - deviation).abs() < 2e-3, "{filter:?}: {}", variance.sqrt());
            assert!(offsets.iter().all(|o| o.abs() <= reach + 1e-3));
        }
    }
}
