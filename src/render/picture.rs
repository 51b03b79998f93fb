//! From a film to files: layers, their names, and the story an EXR tells about itself.

use std::path::Path;

use crate::{
    film::Film,
    image::{
        ImageError,
        exr::{self, Attribute, ChannelSpec, ExrLayout, Line, Sample},
        output::{self, Format},
    },
    integrator::LightParts,
    scene::Scene,
};

/// Names of the layers of light by where it came from, in the order of [`LightParts::to_array`]; together they are the
/// picture.
pub const PART_NAMES: [&str; LightParts::COUNT] = [
    "emission",
    "surface_direct",
    "surface_indirect",
    "R_direct",
    "TT_direct",
    "D_direct",
    "F_direct",
    "B_direct",
    "R_indirect",
    "TT_indirect",
    "D_indirect",
    "F_indirect",
    "B_indirect",
];

/// Writes the picture in the format that the path's extension names.
///
/// An EXR gets all layers of the scene and `attributes`; other formats get the colours.
///
/// # Errors
/// What stands in the way of the file; then nothing is left of it.
pub fn write(path: &Path, scene: &Scene, film: &Film, attributes: &[(String, Attribute)]) -> Result<(), ImageError> {
    if Format::of(path)? == Format::Exr {
        return write_exr(path, scene, film, attributes);
    }
    output::write_colors(path, film.width as usize, film.height as usize, &scene.display, |y, row| {
        for (x, out) in row.iter_mut().enumerate() {
            let p = film.pixel(x as u32, y as u32);
            *out = [p.color[0], p.color[1], p.color[2], p.alpha];
        }
    })
}

fn write_exr(path: &Path, scene: &Scene, film: &Film, attributes: &[(String, Attribute)]) -> Result<(), ImageError> {
    let layers = scene.layers;
    let mut channels: Vec<ChannelSpec> = ["R", "G", "B", "A"].map(|n| ChannelSpec::new(n, Sample::F32)).into();
    let mut layer = |wanted: bool, name: &str, parts: &[&str], sample: Sample| {
        if wanted {
            channels.extend(parts.iter().map(|part| ChannelSpec::new(format!("{name}.{part}"), sample)));
        }
    };
    layer(layers.depth, "depth", &["Z"], Sample::F32);
    layer(layers.normal, "N", &["X", "Y", "Z"], Sample::F32);
    layer(layers.albedo, "albedo", &["R", "G", "B"], Sample::F32);
    layer(layers.variance, "variance", &["R", "G", "B"], Sample::F32);
    layer(layers.samples, "samples", &["count"], Sample::U32);
    let precision = if scene.storage.half_lobes { Sample::F16 } else { Sample::F32 };
    for name in PART_NAMES {
        layer(layers.lobes, name, &["R", "G", "B"], precision);
    }
    let render = &scene.render;
    let mut layout = ExrLayout::new(film.width as usize, film.height as usize, channels);
    layout.origin = film.origin.map(|o| o as i32);
    layout.display_size = [render.width as usize, render.height as usize];
    layout.attributes = attributes.to_vec();
    layout.compression = scene.storage.compression;
    exr::write(path, &layout, |y, lines| {
        for x in 0..film.width {
            let p = film.pixel(x, y as u32);
            let mut values = Vec::with_capacity(lines.len());
            values.extend(p.color);
            values.push(p.alpha);
            if layers.depth {
                values.push(p.depth);
            }
            if layers.normal {
                values.extend(p.normal);
            }
            if layers.albedo {
                values.extend(p.albedo);
            }
            if layers.variance {
                values.extend(p.variance);
            }
            if layers.samples {
                values.push(0.0);
            }
            if layers.lobes {
                values.extend(p.parts.as_flattened());
            }
            for (line, value) in lines.iter_mut().zip(values) {
                match line {
                    Line::Float(line) => line[x as usize] = value,
                    Line::Whole(line) => line[x as usize] = p.samples,
                }
            }
        }
    })
}
