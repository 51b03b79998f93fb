//! Error against run time: how fast each method's pictures get to what they converge to, and how far that is from explicit
//! fibres.
//!
//! A method's converged picture, and the reference, are two halves of independent seeds; the renders that are measured have
//! other seeds again, so that no picture is compared with its own samples. Errors are estimated without the noise of what
//! they are measured against (see [`Halves`](crate::image::metric::Halves)).

use std::{
    path::Path,
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use super::{
    converged::{self, Converged, Half},
    method::Method,
};
use crate::{
    cloth::Cloth,
    film::{Film, OutOfMemory},
    image::{Channel, Image, ImageError},
    math::stats::Estimate,
    render,
    report::convergence::{Convergence, Curve, Point},
    scene::{Layers, Scene},
};

/// What to measure.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    /// The methods, a curve each.
    pub methods: Vec<Method>,
    /// The method that counts as true; `None` measures noise only.
    pub reference: Option<Method>,
    /// Renders behind every point.
    pub seeds: u32,
    /// Most samples per pixel of a curve.
    pub spp: u32,
    /// Longest render of a curve, in seconds.
    pub seconds: Option<f64>,
    /// Samples per pixel of each half of a converged picture.
    pub converged_spp: u32,
    /// Error for which times are told.
    pub target: f64,
    /// Threads of every render.
    pub threads: usize,
}

/// Why there is no result.
#[derive(Debug)]
pub(crate) enum ConvergeError {
    /// A scene cannot be loaded or built, or a file written: text for the user.
    Failed(String),
    /// The user or the system asked to stop.
    Interrupted,
}

impl From<ImageError> for ConvergeError {
    fn from(error: ImageError) -> Self {
        Self::Failed(format!("error: {error}"))
    }
}

/// A method with all that its renders need.
struct Prepared {
    scene: Scene,
    cloth: Cloth,
    setup: Duration,
    converged: Converged,
}

/// Measures a scene. `load` gives it for a method; converged pictures are kept in the directory `cache`; `say` is told
/// what is being done.
///
/// # Errors
/// See [`ConvergeError`].
pub(crate) fn run(
    load: impl Fn(Method) -> Result<Scene, String>,
    options: &Options,
    cache: &Path,
    interrupt: &AtomicBool,
    mut say: impl FnMut(&str),
) -> Result<Convergence, ConvergeError> {
    let mut prepare = |method: Method| -> Result<Prepared, ConvergeError> {
        let started = Instant::now();
        let mut scene = load(method).map_err(ConvergeError::Failed)?;
        scene.layers = Layers::NONE;
        scene.render.time = None;
        scene.render.noise = None;
        let (cloth, _) =
            Cloth::new(&scene, options.threads).map_err(|e| ConvergeError::Failed(format!("error: {e}")))?;
        let setup = started.elapsed();
        let name = format!("converged picture of {method}");
        let path = converged::path(cache, &[&scene.fingerprint, &options.converged_spp.to_string()]);
        if let Some(converged) = Converged::load(&path) {
            say(&format!("{name}: from {}", path.display()));
            return Ok(Prepared { scene, cloth, setup, converged });
        }
        let mut halves = Vec::new();
        for half in 0..2 {
            say(&format!("{name}: half {} of 2, {} spp", half + 1, options.converged_spp));
            let mut scene = scene.clone();
            scene.render.spp = options.converged_spp;
            scene.render.seed = seed(&scene, half);
            let rendered = render::render(&scene, &cloth, interrupt, |_| {}).map_err(no_memory)?;
            if interrupt.load(Ordering::Relaxed) {
                return Err(ConvergeError::Interrupted);
            }
            let seconds = rendered.elapsed.as_secs_f64();
            halves.push(Half { image: image_of(&rendered.film), spp: f64::from(options.converged_spp), seconds });
        }
        let converged = Converged::new(&halves[0], &halves[1])
            .ok_or_else(|| ConvergeError::Failed("error: a picture without colours".to_owned()))?;
        converged.store(&path)?;
        Ok(Prepared { scene, cloth, setup, converged })
    };

    // The reference's cloth is dropped before others are measured: it may fill the memory.
    let truth = options.reference.map(&mut prepare).transpose()?.map(|reference| reference.converged);
    let mut curves = Vec::new();
    let mut first: Option<(String, [usize; 2])> = None;
    for &method in &options.methods {
        let prepared = prepare(method)?;
        let size = [
            prepared.converged.halves.width,
            prepared.converged.halves.alpha.len() / prepared.converged.halves.width.max(1),
        ];
        first.get_or_insert((prepared.scene.path.clone(), size));
        let truth = truth.as_ref().filter(|_| options.reference != Some(method));
        curves.push(curve(method, &prepared, truth, options, interrupt)?);
    }
    let (scene, size) = first.unwrap_or_default();
    Ok(Convergence {
        scene,
        size,
        threads: options.threads,
        seeds: options.seeds as usize,
        reference: options.reference.map(|method| method.to_string()),
        target: options.target,
        curves,
    })
}

fn no_memory(error: OutOfMemory) -> ConvergeError {
    ConvergeError::Failed(format!("error: {error}"))
}

/// Seeds of halves and of measured renders, all different.
fn seed(scene: &Scene, number: u32) -> u32 {
    scene.render.seed.wrapping_add(1 + number)
}

/// Renders with every seed and looks at the picture each time the samples have doubled.
fn curve(
    method: Method,
    prepared: &Prepared,
    truth: Option<&Converged>,
    options: &Options,
    interrupt: &AtomicBool,
) -> Result<Curve, ConvergeError> {
    /// One render after one wave.
    struct Look {
        spp: u32,
        seconds: f64,
        noise: f64,
        error: Option<f64>,
    }
    let mut looks: Vec<Vec<Look>> = Vec::new();
    for number in 0..options.seeds {
        let mut scene = prepared.scene.clone();
        scene.render.seed = seed(&scene, 2 + number);
        scene.render.spp = options.spp;
        scene.render.time = options.seconds;
        let mut seen: Vec<Look> = Vec::new();
        // What looking takes is no rendering.
        let mut looking = Duration::ZERO;
        let rendered = render::render(&scene, &prepared.cloth, interrupt, |progress| {
            let last = seen.last().map_or(0, |look| look.spp);
            if progress.spp < 2 * last {
                return;
            }
            let started = Instant::now();
            let colors = colors_of(progress.film);
            seen.push(Look {
                spp: progress.spp,
                seconds: progress.elapsed.saturating_sub(looking).as_secs_f64(),
                noise: prepared.converged.halves.rel_mse(&colors),
                error: truth.map(|truth| truth.halves.rel_mse(&colors)),
            });
            looking += started.elapsed();
        });
        let rendered = rendered.map_err(no_memory)?;
        if rendered.stop == render::Stop::Interrupted {
            return Err(ConvergeError::Interrupted);
        }
        looks.push(seen);
    }
    // A point for each wave that all seeds have come to.
    let waves = looks.iter().map(Vec::len).min().unwrap_or(0);
    let points = (0..waves)
        .filter_map(|wave| {
            let of = |get: &dyn Fn(&Look) -> Option<f64>| -> Option<Estimate> {
                let values: Option<Vec<f64>> = looks.iter().map(|seen| get(&seen[wave])).collect();
                Estimate::of(&values?)
            };
            Some(Point {
                spp: looks[0][wave].spp,
                seconds: of(&|look| Some(look.seconds))?,
                noise: of(&|look| Some(look.noise))?,
                error: of(&|look| look.error),
            })
        })
        .collect();
    Ok(Curve {
        method: method.to_string(),
        setup_seconds: prepared.setup.as_secs_f64(),
        converged_spp: prepared.converged.spp,
        points,
    })
}

fn colors_of(film: &Film) -> Vec<[f32; 3]> {
    (0..film.height).flat_map(|y| (0..film.width).map(move |x| film.pixel(x, y).color)).collect()
}

fn image_of(film: &Film) -> Image {
    let mut image = Image::new(film.width as usize, film.height as usize);
    let pixels: Vec<_> = (0..film.height).flat_map(|y| (0..film.width).map(move |x| film.pixel(x, y))).collect();
    for (k, name) in ["R", "G", "B"].into_iter().enumerate() {
        image.channels.push(Channel { name: name.to_owned(), samples: pixels.iter().map(|p| p.color[k]).collect() });
    }
    image.channels.push(Channel { name: "A".to_owned(), samples: pixels.iter().map(|p| p.alpha).collect() });
    image
}
