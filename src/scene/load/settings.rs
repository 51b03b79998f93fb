//! `[render]` and `[output]`.

use super::{
    super::{builder::OutputSettings, force::FORCEABLE, *},
    Range, Reader, UNITS, z_up,
};
use crate::{image::png::ToneMap, input::diagnostic::shortened};

const SIZE: std::ops::RangeInclusive<u64> = 1..=65_536;

/// On how many threads a scene is loaded and rendered, where it says so.
pub(super) fn threads(table: &Reader<'_>) -> Option<usize> {
    table.u64("threads", 1..=4096).map(|t| t as usize)
}

/// The settings of `[render]`.
pub(super) fn render(table: &Reader<'_>) -> RenderSettings {
    let otherwise = RenderSettings::default();
    let width = table.u64_or("width", otherwise.width.into(), SIZE) as u32;
    let height = table.u64_or("height", otherwise.height.into(), SIZE) as u32;
    let crop = table.numbers("crop", Range::at_least(0.0));
    let crop = match crop.as_deref() {
        None => [0, 0, width, height],
        Some(&[x0, y0, x1, y1]) => {
            let c = [x0, y0, x1, y1].map(|v| v as u32);
            if c[0] >= c[2]
                || c[1] >= c[3]
                || c[2] > width
                || c[3] > height
                || [x0, y0, x1, y1].iter().any(|v| v.fract() != 0.0)
            {
                let message = format!("the crop must be whole pixels x0 < x1 <= {width} and y0 < y1 <= {height}");
                table.error_at("crop", message, Some("crop = [x0, y0, x1, y1], the latter two exclusive"));
            }
            c
        }
        Some(_) => {
            table.error_at("crop", "expected four numbers", Some("crop = [x0, y0, x1, y1], the latter two exclusive"));
            [0, 0, width, height]
        }
    };
    let kind = table.one_of_or("filter", 2, &[("box", 0), ("tent", 1), ("gaussian", 2)]);
    let filter_width = table.f64("filter_width", Range::above(0.0).and_at_most(16.0)).map(|w| w as f32);
    let filter = match kind {
        0 => PixelFilter::Box(filter_width.unwrap_or(defaults::BOX_WIDTH)),
        1 => PixelFilter::Tent(filter_width.unwrap_or(defaults::TENT_WIDTH)),
        _ => PixelFilter::Gaussian(filter_width.unwrap_or(defaults::GAUSSIAN_WIDTH)),
    };
    let mode = table.one_of_or("mode", otherwise.mode, &Mode::NAMES);
    let model = table.one_of_or("model", otherwise.model, &Model::NAMES);
    if mode == Mode::Fiber && model != otherwise.model {
        let message = format!("the model `{}` is of yarns and plies, and mode fiber shows neither", model.name());
        table.warning_at("model", message, Some("mode = \"yarn\" or \"ply\", or leave the model out"));
    }
    RenderSettings {
        mode,
        model,
        without: without(table),
        width,
        height,
        crop,
        filter,
        spp: table.u64_or("spp", otherwise.spp.into(), 1..=u64::from(u32::MAX)) as u32,
        time: table.f64("time", Range::above(0.0)),
        noise: table.f64("noise", Range::above(0.0)),
        max_bounces: table.u64_or("max_bounces", defaults::max_bounces(mode).into(), 0..=1_000_000) as u32,
        adaptive: table.bool_or("adaptive", otherwise.adaptive),
        threads: threads(table),
        seed: table.u64_or("seed", otherwise.seed.into(), 0..=u64::from(u32::MAX)) as u32,
        frame: table.u64("frame", 0..=u64::from(u32::MAX)).map(|f| f as u32),
        fiber_detail: table.bool_or("fiber_detail", otherwise.fiber_detail),
        compact_bvh: table.one_of_or("bvh", otherwise.compact_bvh, &[("compact", true), ("fast", false)]),
        max_memory: table.f64("max_memory", Range::above(0.0)).map(|g| (g * 1e9) as u64),
        force: force(table),
    }
}

/// `without = ["D"]`: lobes of single fibres to leave out.
fn without(table: &Reader<'_>) -> Vec<FiberLobe> {
    let mut lobes = Vec::new();
    if table.has("without") {
        for (name, _) in table.strings("without") {
            match FiberLobe::NAMES.iter().find(|(known, _)| *known == name) {
                Some((_, lobe)) => lobes.push(*lobe),
                None => {
                    let message = format!("unknown lobe `{name}` of a fibre");
                    table.error_at("without", message, Some("known are R, TT and D"));
                }
            }
        }
    }
    lobes
}

/// `force = ["distant_light"]`: features to bring in.
fn force(table: &Reader<'_>) -> Vec<String> {
    let names: Vec<String> = table.strings("force").into_iter().map(|(name, _)| name.to_owned()).collect();
    for name in names.iter().filter(|name| !FORCEABLE.contains(&name.as_str())) {
        let hint = format!("these can: {}", FORCEABLE.join(", "));
        table.error_at("force", format!("`{}` cannot be forced", shortened(name)), Some(&hint));
    }
    names
}

/// The settings of `[output]`.
pub(super) fn output(table: Reader<'_>) -> OutputSettings {
    let otherwise = OutputSettings::default();
    let display = Display {
        tone_map: table.one_of_or("tone_map", otherwise.display.tone_map, &ToneMap::NAMES),
        exposure: table.f64_or("exposure", otherwise.display.exposure.into(), Range::between(-100.0, 100.0)) as f32,
        alpha: table.bool_or("alpha", otherwise.display.alpha),
    };
    let storage = Storage {
        compression: table.one_of_or("compression", otherwise.storage.compression, &Compression::NAMES),
        half_lobes: table.one_of_or(
            "lobe_precision",
            otherwise.storage.half_lobes,
            &[("float", false), ("half", true)],
        ),
    };
    let axes = Axes {
        unit: table.one_of_or("unit", otherwise.axes.unit, &UNITS),
        z_up: z_up(&table).unwrap_or(otherwise.axes.z_up),
    };
    let mut layers = otherwise.layers;
    if table.has("layers") {
        layers = Layers::NONE;
        for (name, _) in table.strings("layers") {
            match Layers::NAMES.iter().find(|(known, _)| *known == name) {
                Some((_, layer)) => *layer(&mut layers) = true,
                None if name == Layers::LIGHT_GROUPS => layers.light_groups = Layers::ALL.light_groups,
                None if name == "all" => layers = Layers::ALL,
                None => table.error_at(
                    "layers",
                    format!("unknown layer `{}`", shortened(name)),
                    Some(&format!("known are {} and all", Layers::names().collect::<Vec<_>>().join(", "))),
                ),
            }
        }
    }
    let denoise = table.bool_or("denoise", otherwise.denoise);
    let frames_per_second = table.f64("frames_per_second", Range::between(0.01, 10_000.0));
    table.finish();
    OutputSettings { display, layers, storage, axes, denoise, frames_per_second }
}
