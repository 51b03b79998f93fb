//! What a run was: one record, written as statistics or as the metadata of a picture; and what was found by comparing
//! pictures, as text, JSON and pages.

pub(crate) mod compare;
pub(crate) mod convergence;
pub(crate) mod fidelity;
pub(crate) mod machine;
pub(crate) mod page;
pub(crate) mod plot;
pub(crate) mod table3;

use std::time::Duration;

use glam::{DMat4, DVec3};
use serde_json::{Value, json};

use crate::{
    cloth::BuildTimes,
    image::{Attribute, exr},
    plan::Plan,
    render::{Job, Rendered},
    scene::{Axes, Scene},
    trace::{CurveGeometry, World},
};

/// What a table says of what is not known, such as the standard error of one sample.
pub(crate) const UNKNOWN: &str = "n/a";

/// How far a figure may be off, behind its sign; nothing where that is not known.
pub(crate) fn plus_minus(error: Option<f64>, sign: &str, show: impl Fn(f64) -> String) -> String {
    error.map_or(String::new(), |error| sign.to_owned() + &show(error))
}

/// A cell of a CSV file: empty where its figure is not known.
pub(crate) fn csv_cell(figure: Option<f64>, show: impl Fn(f64) -> String) -> String {
    figure.map_or(String::new(), show)
}

/// Seconds of each phase.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Phases {
    /// Reading scene, curves and images.
    pub load: Duration,
    /// Curves, and Embree's BVH.
    pub made: BuildTimes,
    /// Samples, in this run.
    pub render: Duration,
    /// The denoised picture.
    pub denoise: Duration,
    /// Output files.
    pub write: Duration,
    /// From the start of the program.
    pub total: Duration,
}

/// Everything that is known of a run.
#[derive(Debug)]
pub(crate) struct RunRecord<'a> {
    /// What was rendered.
    pub scene: &'a Scene,
    /// With what.
    pub world: &'a World,
    /// The result.
    pub rendered: &'a Rendered,
    /// How long it took.
    pub phases: Phases,
    /// With how many threads.
    pub threads: usize,
}

/// The most memory this process has held, in bytes; 0 where the system does not say.
pub(crate) fn peak_rss_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()).map_or(0, |kib| kib * 1024)
}

impl RunRecord<'_> {
    /// The statistics of `--stats`.
    pub(crate) fn to_json(&self) -> Value {
        let scene = self.scene;
        let render = &scene.render;
        let film = &self.rendered.film;
        let counters = &self.rendered.counters;
        let (spp_min, spp_mean, spp_max) = film.samples();
        let geometries = self.world.geometries();
        let yarns = || {
            geometries.iter().filter_map(|t| match t {
                CurveGeometry::Yarns(yarns) => Some(&yarns.strands),
                CurveGeometry::Fibers(_) => None,
            })
        };
        let fibers = geometries
            .iter()
            .filter(|t| matches!(t, CurveGeometry::Fibers(_)))
            .map(CurveGeometry::count)
            .sum::<usize>();
        let plan = Plan::new(scene);
        let geometry = self.world.geometry_bytes();
        let bvh = self.world.bvh_bytes();
        let lights: u64 = scene
            .lights
            .iter()
            .map(|l| match l {
                crate::light::Light::Environment(e) => e.image.as_ref().map_or(0, |m| m.bytes()),
                _ => 0,
            })
            .sum();
        let seconds = |d: Duration| d.as_secs_f64();
        let noise = film.noise();
        json!({
            "yarnray": env!("CARGO_PKG_VERSION"),
            "commit": env!("YARNRAY_COMMIT"),
            "embree": self.world.embree_version(),
            "scene": scene.path,
            "fingerprint": scene.fingerprint,
            "frame": render.frame,
            "mode": render.mode.name(),
            "model": render.model.name(),
            "seed": render.seed,
            "threads": self.threads,
            "stopped_by": self.rendered.stop.name(),
            "image": {"width": film.width, "height": film.height, "spp_min": spp_min, "spp_mean": spp_mean, "spp_max": spp_max},
            "seconds": {
                "load": seconds(self.phases.load),
                "generate": seconds(self.phases.made.generate),
                "build": seconds(self.phases.made.build),
                "render": seconds(self.phases.render),
                "render_all_runs": seconds(self.rendered.elapsed),
                "denoise": seconds(self.phases.denoise),
                "write": seconds(self.phases.write),
                "total": seconds(self.phases.total),
            },
            "rays": {"camera": counters.camera, "bounce": counters.bounce, "shadow": counters.shadow},
            "mean_bounces": if counters.cloth_paths > 0 { counters.events as f64 / counters.cloth_paths as f64 } else { 0.0 },
            "invalid_samples": counters.invalid,
            "memory": {
                "geometry_bytes": geometry,
                "bvh_bytes": bvh,
                "scene_bytes": geometry + bvh + lights + crate::image::texture::bytes(),
                "peak_rss_bytes": peak_rss_bytes(),
            },
            "curves": {
                "yarns": yarns().map(crate::geometry::strand::Strands::yarns).sum::<usize>(),
                "fibers": fibers,
                "control_points": geometries.iter().map(|t| t.curves().1.len()).sum::<usize>(),
                "segments": geometries.iter().map(|t| t.curves().2.len()).sum::<usize>(),
                "given_points": scene.fabrics.iter().map(crate::scene::Fabric::control_points).sum::<usize>(),
                "length_mm": yarns().map(crate::geometry::strand::Strands::length).sum::<f64>(),
            },
            "noise": {
                "rel_mse_estimate": noise.map(|n| n.estimate),
                "rel_mse_interval": noise.map(|n| [n.low, n.high]),
            },
            "used": plan.names(true),
            "left_out": plan.names(false),
        })
    }

    /// The metadata of an EXR.
    pub(crate) fn attributes(&self, command_line: &str) -> Vec<(String, Attribute)> {
        let mut out = metadata(self.scene, self.world);
        let film = &self.rendered.film;
        let noise = film.noise().map(|n| [n.estimate, n.low, n.high]);
        out.extend(measured(film.samples().1, noise, self.rendered.elapsed, command_line));
        out.push(("yarnray.stopped_by".to_owned(), Attribute::Text(self.rendered.stop.name().to_owned())));
        out.push(("yarnray.threads".to_owned(), Attribute::Whole(self.threads as i32)));
        out
    }
}

/// The metadata that all parts of a render share: what the picture is of.
pub(crate) fn metadata(scene: &Scene, world: &World) -> Vec<(String, Attribute)> {
    [
        ("scene", scene.path.clone()),
        ("fingerprint", scene.fingerprint.clone()),
        ("mode", scene.render.mode.name().to_owned()),
        ("model", scene.render.model.name().to_owned()),
        ("seed", scene.render.seed.to_string()),
        ("embree", world.embree_version()),
    ]
    .map(|(name, value)| (format!("yarnray.{name}"), Attribute::Text(value)))
    .into_iter()
    .chain(scene.render.frame.map(|frame| ("yarnray.frame".to_owned(), Attribute::Whole(frame as i32))))
    .chain(of_camera(scene))
    .collect()
}

/// What OpenEXR has names for: colours, time, and the camera in the middle of the shutter's time; and the unit and the axes
/// of places, as USD has them.
fn of_camera(scene: &Scene) -> Vec<(String, Attribute)> {
    let rows = |m: DMat4| Attribute::Matrix(m.transpose().as_mat4().to_cols_array_2d());
    let aspect = f64::from(scene.render.width) / f64::from(scene.render.height);
    let Axes { unit, z_up } = scene.axes;
    let to_scene = scene.axes.to_scene();
    let to_unit = DMat4::from_scale(DVec3::splat(1.0 / unit));
    let mut out = vec![
        ("chromaticities".to_owned(), exr::REC_709),
        ("worldToCamera".to_owned(), rows(to_unit * scene.camera.world_to_camera(scene.middle) * to_scene)),
        ("worldToNDC".to_owned(), rows(scene.camera.world_to_ndc(scene.middle, aspect) * to_scene)),
        ("yarnray.meters_per_unit".to_owned(), Attribute::Double(unit / 1000.0)),
        ("yarnray.up_axis".to_owned(), Attribute::Text(if z_up { "Z" } else { "Y" }.to_owned())),
    ];
    if let Some(rate) = scene.frames_per_second {
        let [frames, seconds] = as_ratio(rate);
        out.push(("framesPerSecond".to_owned(), Attribute::Ratio(frames as i32, seconds)));
    }
    out
}

/// A rate of frames as a ratio: 23.976 and 23.98 are 24000/1001, as film and video have it.
fn as_ratio(rate: f64) -> [u32; 2] {
    let whole = rate.round();
    let slowed = rate.ceil() * 1000.0;
    if (rate - whole).abs() < 1e-6 {
        [whole as u32, 1]
    } else if (rate - slowed / 1001.0).abs() < 0.005 {
        [slowed as u32, 1001]
    } else {
        [(rate * 1000.0).round() as u32, 1000]
    }
}

/// The metadata of a picture that was merged from so many parts.
pub(crate) fn merged_attributes(
    metadata: &[(String, Attribute)],
    job: &Job,
    parts: usize,
    command_line: &str,
) -> Vec<(String, Attribute)> {
    let mut out = metadata.to_vec();
    let noise = job.film.noise().map(|n| [n.estimate, n.low, n.high]);
    out.extend(measured(job.film.samples().1, noise, job.elapsed, command_line));
    out.push(("yarnray.parts".to_owned(), Attribute::Whole(parts as i32)));
    out
}

/// What was measured: samples of a pixel, noise with the ends of its interval of 95 %, the time on all machines together.
fn measured(spp: f64, noise: Option<[f64; 3]>, elapsed: Duration, command_line: &str) -> Vec<(String, Attribute)> {
    let mut out = vec![
        ("yarnray.spp".to_owned(), Attribute::Double(spp)),
        ("yarnray.seconds".to_owned(), Attribute::Double(elapsed.as_secs_f64())),
        ("yarnray.command".to_owned(), Attribute::Text(command_line.to_owned())),
    ];
    if let Some([estimate, low, high]) = noise {
        out.extend(
            [("estimate", estimate), ("low", low), ("high", high)]
                .map(|(name, value)| (format!("yarnray.rel_mse_{name}"), Attribute::Double(value))),
        );
    }
    out
}
