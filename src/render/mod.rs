//! The driver: samples in waves over tiles on all threads, until enough.
//!
//! A wave takes every pixel from one number of samples to another. Tiles own their pixels, and a sample depends on
//! (seed, pixel, sample number) only, so that the picture is the same to the bit for any number of threads.

pub mod denoise;
pub mod live;
pub mod picture;

use std::{
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use glam::Vec2;
use rayon::prelude::*;

use crate::{
    ffi::embree::Ray,
    film::{Film, Tile},
    integrator::{Counters, Integrator, Scratch},
    math::{
        sampler::{Sampler, hash2},
        warp::normal,
    },
    scene::{PixelFilter, Scene},
    trace::World,
};

/// Most samples per pixel of one wave.
const LARGEST_WAVE: u32 = 32;
/// Samples per pixel before the estimated noise is believed.
const WARM_UP: u32 = 32;

/// Why a render ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// All samples were taken.
    Samples,
    /// The time was over.
    Time,
    /// The estimated noise was low enough.
    Noise,
    /// The user or the system asked.
    Interrupted,
}

impl Stop {
    /// In words, for statistics and metadata.
    pub fn name(self) -> &'static str {
        match self {
            Self::Samples => "spp",
            Self::Time => "time",
            Self::Noise => "noise",
            Self::Interrupted => "interrupted",
        }
    }
}

/// Where a render stands, for a progress display.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// What pixels have collected so far.
    pub film: &'a Film,
    /// Samples per pixel taken so far, and at most to take.
    pub spp: u32,
    /// As `spp`.
    pub spp_end: u32,
    /// Share of all work done, 0 to 1, by samples or by time, whichever ends first.
    pub share: f64,
    /// Time since rendering began.
    pub elapsed: Duration,
    /// The estimated relative mean square error, once there is one.
    pub noise: Option<f64>,
}

/// A finished or interrupted render.
#[derive(Debug)]
pub struct Rendered {
    /// What pixels have collected.
    pub film: Film,
    /// What was done.
    pub counters: Counters,
    /// Time in which samples were taken.
    pub elapsed: Duration,
    /// Why it ended.
    pub stop: Stop,
}

/// Renders in the calling thread's rayon pool. `interrupt` ends the render after the tiles in work; `progress` is
/// called after every wave.
pub fn render(
    scene: &Scene,
    world: &World,
    interrupt: &AtomicBool,
    mut progress: impl FnMut(Progress<'_>),
) -> Rendered {
    let settings = &scene.render;
    let integrator = Integrator::new(scene, world);
    let mut film = Film::new(settings.crop, scene.collected(), scene.light_scale());
    let mut counters = Counters::default();
    let started = Instant::now();
    let deadline = settings.time.map(|t| started + Duration::from_secs_f64(t.min(1e9)));
    let mut done = 0;
    let mut wave = 1;
    let stop = loop {
        let end = settings.spp.min(done + wave);
        let ended_early = AtomicBool::new(false);
        let wave_counters = film
            .tiles_in_order()
            .into_par_iter()
            .with_max_len(1)
            .map_init(Scratch::default, |scratch, tile| {
                let late = deadline.is_some_and(|d| done > 0 && Instant::now() >= d);
                if late || interrupt.load(Ordering::Relaxed) {
                    ended_early.store(true, Ordering::Relaxed);
                    return Counters::default();
                }
                render_tile(scene, &integrator, tile, done..end, scratch)
            })
            .reduce(Counters::default, |mut a, b| {
                a.add(&b);
                a
            });
        counters.add(&wave_counters);
        let elapsed = started.elapsed();
        if interrupt.load(Ordering::Relaxed) {
            break Stop::Interrupted;
        }
        if ended_early.into_inner() {
            break Stop::Time;
        }
        done = end;
        let noise = if settings.noise.is_some() && done >= WARM_UP.min(settings.spp) {
            film.noise().map(|n| n.estimate)
        } else {
            None
        };
        let by_time = settings.time.map_or(0.0, |t| elapsed.as_secs_f64() / t);
        let share = (f64::from(done) / f64::from(settings.spp)).max(by_time).min(1.0);
        progress(Progress { film: &film, spp: done, spp_end: settings.spp, share, elapsed, noise });
        if done >= settings.spp {
            break Stop::Samples;
        }
        if let (Some(limit), Some(noise)) = (settings.noise, noise)
            && noise <= limit
        {
            break Stop::Noise;
        }
        if deadline.is_some_and(|d| Instant::now() >= d) {
            break Stop::Time;
        }
        wave = (2 * wave).min(LARGEST_WAVE);
    };
    Rendered { film, counters, elapsed: started.elapsed(), stop }
}

fn render_tile(
    scene: &Scene,
    integrator: &Integrator<'_>,
    tile: &mut Tile,
    samples: std::ops::Range<u32>,
    scratch: &mut Scratch,
) -> Counters {
    let settings = &scene.render;
    let mut counters = Counters::default();
    let seed = hash2(settings.frame.map_or(settings.seed, |f| hash2(settings.seed, f)), 0x79a2_17a5);
    let moves = !scene.camera_path.is_empty() || scene.cloth_moves();
    for y in 0..tile.height {
        for x in 0..tile.width {
            let (px, py) = (tile.x + x, tile.y + y);
            for index in samples.clone() {
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
                let sample = integrator.sample(ray, &mut sampler, scratch, &mut counters);
                if !tile.add(x, y, &sample) {
                    counters.invalid += 1;
                }
            }
        }
    }
    counters
}

/// An offset along one axis, in pixels, that follows the filter.
fn filter_offset(filter: PixelFilter, u: f32) -> f32 {
    match filter {
        PixelFilter::Box(half) => (2.0 * u - 1.0) * half,
        PixelFilter::Tent(reach) => {
            let x = 2.0 * u - 1.0;
            (1.0 - (1.0 - x.abs()).max(0.0).sqrt()).copysign(x) * reach
        }
        // Within three deviations: u is moved into the part of the distribution that is kept.
        PixelFilter::Gaussian(sigma) => normal(0.001_349_898 + u * (1.0 - 2.0 * 0.001_349_898)) * sigma,
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
