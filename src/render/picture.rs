//! From a film to files: layers, their names, and the metadata of an EXR.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use glam::{DVec3, Vec3};

use crate::{
    film::{Film, LightParts, MatteId, Pixel},
    image::{
        ImageError, cryptomatte,
        exr::{self, Attribute, ChannelSpec, ExrLayout, Line, Sample},
        output::{self, Format},
        png::Display,
    },
    scene::{Axes, Layers, Scene, Storage},
};

use super::denoise::Denoised;

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

/// What must be known of a scene to write its picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Width of the whole picture, pixels.
    pub width: u32,
    /// Height of the whole picture, pixels.
    pub height: u32,
    /// Layers of an EXR.
    pub layers: Layers,
    /// How an EXR is stored.
    pub storage: Storage,
    /// The unit and the axes of its places.
    pub axes: Axes,
    /// How pictures for a screen are made.
    pub display: Display,
    /// Names of the fabrics, for Cryptomatte.
    pub fabrics: Vec<String>,
    /// Names of the meshes and of the ground, if there is one.
    pub surfaces: Vec<String>,
    /// Names of the groups of lights, in the order of [`Pixel::lights`].
    pub light_groups: Vec<String>,
    /// Where the film's origin lies in the world, millimetres.
    pub middle: [f64; 3],
}

impl Frame {
    /// Of a scene.
    pub fn new(scene: &Scene) -> Self {
        Self {
            width: scene.render.width,
            height: scene.render.height,
            layers: scene.layers,
            storage: scene.storage,
            axes: scene.axes,
            display: scene.display,
            fabrics: scene.fabrics.iter().map(|f| f.name.clone()).collect(),
            surfaces: {
                let ground = scene.ground.map(|_| "ground".to_owned());
                scene.objects.iter().map(|object| object.name.clone()).chain(ground).collect()
            },
            light_groups: scene.light_groups.names().to_vec(),
            middle: scene.middle.to_array(),
        }
    }
}

/// A picture that is done, and all that is written of it.
#[derive(Clone, Copy)]
pub struct Picture<'a> {
    /// What is known of its scene.
    pub frame: &'a Frame,
    /// Its pixels.
    pub film: &'a Film,
    /// It without noise.
    pub denoised: Option<&'a Denoised>,
    /// Metadata of an EXR.
    pub attributes: &'a [(String, Attribute)],
}

impl Picture<'_> {
    /// Writes the picture in the format that the path's extension names.
    ///
    /// An EXR gets all layers of the frame and the attributes, and a denoised picture as the layer `denoised`; other
    /// formats get the colours. A denoised picture in such a format is a file of its own ([`Self::write_denoised`]).
    ///
    /// # Errors
    /// What stands in the way of the file; then nothing is left of it.
    pub fn write(&self, path: &Path) -> Result<(), ImageError> {
        if Format::of(path)? == Format::Exr {
            return write_exr(path, self);
        }
        let film = self.film;
        output::write_colors(path, film.width as usize, film.height as usize, &self.frame.display, |y, row| {
            for (x, out) in row.iter_mut().enumerate() {
                let p = film.pixel(x as u32, y as u32);
                *out = [p.color[0], p.color[1], p.color[2], p.alpha];
            }
        })
    }

    /// Writes the denoised picture as a file of its own beside `path`, where there is one and `path` has no room for it;
    /// gives the file's name.
    ///
    /// # Errors
    /// If the file cannot be written; then nothing is left behind.
    pub fn write_denoised(&self, path: &Path) -> Result<Option<PathBuf>, ImageError> {
        let (Some(denoised), Some(path)) = (self.denoised, denoised_path(path)) else { return Ok(None) };
        let film = self.film;
        output::write_colors(&path, film.width as usize, film.height as usize, &self.frame.display, |y, row| {
            for (x, out) in row.iter_mut().enumerate() {
                let [r, g, b] = denoised.pixel(x as u32, y as u32);
                *out = [r, g, b, film.pixel(x as u32, y as u32).alpha];
            }
        })?;
        Ok(Some(path))
    }
}

/// The name of the denoised picture that belongs to `path`, where that is not an EXR: `a.denoised.png` for `a.png`.
pub fn denoised_path(path: &Path) -> Option<PathBuf> {
    if Format::of(path).ok()? == Format::Exr {
        return None;
    }
    let extension = path.extension()?.to_string_lossy();
    Some(path.with_extension(format!("denoised.{extension}")))
}

fn write_exr(path: &Path, picture: &Picture) -> Result<(), ImageError> {
    let &Picture { frame, film, denoised, attributes } = picture;
    let mattes: Vec<MatteLayer> = if frame.layers.cryptomatte { MatteLayer::all(frame, film) } else { Vec::new() };
    let mut layers = exr_layers(frame, film, denoised, &mattes);
    let channels = layers.iter().flat_map(|layer| layer.channels.clone()).collect();
    let mut layout = ExrLayout::new(film.width as usize, film.height as usize, channels);
    layout.origin = film.origin.map(|o| o as i32);
    layout.display_size = [frame.width as usize, frame.height as usize];
    layout.attributes = attributes.to_vec();
    if let Some(denoised) = denoised {
        layout.attributes.push(("yarnray.denoised".to_owned(), Attribute::Text(denoised.by.clone())));
    }
    layout.attributes.extend(mattes.iter().flat_map(MatteLayer::attributes));
    layout.compression = frame.storage.compression;
    let mut values = Vec::new();
    exr::write(path, &layout, |y, lines| {
        for x in 0..film.width {
            let at = At { x, y: y as u32, pixel: film.pixel(x, y as u32) };
            values.clear();
            layers.iter_mut().for_each(|layer| (layer.values)(&at, &mut values));
            for (line, value) in lines.iter_mut().zip(&values) {
                match line {
                    Line::Float(line) => line[x as usize] = *value,
                    // The only whole number, which a float may round.
                    Line::Whole(line) => line[x as usize] = at.pixel.samples,
                }
            }
        }
    })
}

/// A pixel, and where it is in the film.
struct At {
    x: u32,
    y: u32,
    pixel: Pixel,
}

/// A layer of an EXR: its channels, and what they hold.
struct ExrLayer<'a> {
    channels: Vec<ChannelSpec>,
    values: AddValues<'a>,
}

/// Appends the values that the channels of a layer have at a pixel.
type AddValues<'a> = Box<dyn FnMut(&At, &mut Vec<f32>) + 'a>;

impl<'a> ExrLayer<'a> {
    /// Channels `NAME.PART`, or just `PART` if the name is empty.
    fn new<const COUNT: usize>(
        name: &str,
        parts: [&str; COUNT],
        sample: Sample,
        values: impl Fn(&At) -> [f32; COUNT] + 'a,
    ) -> Self {
        let dot = if name.is_empty() { "" } else { "." };
        let channels = parts.map(|part| ChannelSpec::new(format!("{name}{dot}{part}"), sample)).into();
        Self { channels, values: Box::new(move |at, out| out.extend(values(at))) }
    }

    fn of_matte(matte: &'a MatteLayer, film: &'a Film) -> Self {
        let mut buffer = Vec::new();
        let values = move |at: &At, out: &mut Vec<f32>| {
            out.extend(matte.ranks(film.covering(at.x, at.y), at.pixel.samples, &mut buffer));
        };
        Self { channels: cryptomatte::channels(matte.name).collect(), values: Box::new(values) }
    }
}

/// The picture, the layers that the frame wants, and the denoised picture if there is one.
fn exr_layers<'a>(
    frame: &'a Frame,
    film: &'a Film,
    denoised: Option<&'a Denoised>,
    mattes: &'a [MatteLayer],
) -> Vec<ExrLayer<'a>> {
    use Sample::{F16, F32, U32};
    const RGB: [&str; 3] = ["R", "G", "B"];
    const XYZ: [&str; 3] = ["X", "Y", "Z"];
    let picture = |at: &At| {
        let [r, g, b] = at.pixel.color;
        [r, g, b, at.pixel.alpha]
    };
    let mut layers = vec![ExrLayer::new("", ["R", "G", "B", "A"], F32, picture)];
    let mut add = |wanted: bool, layer: ExrLayer<'a>| {
        if wanted {
            layers.push(layer);
        }
    };
    let (wanted, axes) = (frame.layers, &frame.axes);
    add(wanted.depth, ExrLayer::new("depth", ["Z"], F32, |at| [(f64::from(at.pixel.depth) / axes.unit) as f32]));
    add(
        wanted.normal,
        ExrLayer::new("N", XYZ, F32, |at| axes.direction(Vec3::from(at.pixel.normal).as_dvec3()).as_vec3().to_array()),
    );
    add(wanted.albedo, ExrLayer::new("albedo", RGB, F32, |at| at.pixel.albedo));
    add(wanted.variance, ExrLayer::new("variance", RGB, F32, |at| at.pixel.variance));
    add(wanted.samples, ExrLayer::new("samples", ["count"], U32, |at| [at.pixel.samples as f32]));
    add(wanted.position, ExrLayer::new("P", XYZ, F32, |at| in_world(&at.pixel, frame)));
    // As Nuke calls them.
    add(wanted.motion, ExrLayer::new("forward", ["u", "v"], F32, |at| at.pixel.motion));
    add(wanted.uv, ExrLayer::new("uv", ["U", "V"], F32, |at| at.pixel.uv));
    let precision = if frame.storage.half_lobes { F16 } else { F32 };
    for (part, name) in PART_NAMES.into_iter().enumerate() {
        add(wanted.lobes, ExrLayer::new(name, RGB, precision, move |at| at.pixel.parts[part]));
    }
    for (group, name) in frame.light_groups.iter().take(wanted.light_groups.into()).enumerate() {
        add(true, ExrLayer::new(&format!("light_{name}"), RGB, precision, move |at| at.pixel.lights[group]));
    }
    let denoised = denoised.map(|d| ExrLayer::new("denoised", RGB, F32, |at| d.pixel(at.x, at.y)));
    layers.extend(denoised);
    layers.extend(mattes.iter().map(|matte| ExrLayer::of_matte(matte, film)));
    layers
}

/// The place of a pixel in the world; the origin where nothing is.
fn in_world(pixel: &Pixel, frame: &Frame) -> [f32; 3] {
    if pixel.alpha > 0.0 {
        let at = Vec3::from(pixel.position).as_dvec3() + DVec3::from(frame.middle);
        frame.axes.place(at).as_vec3().to_array()
    } else {
        [0.0; 3]
    }
}

/// What a matte tells apart.
#[derive(Clone, Copy)]
enum Level {
    Fabric,
    Yarn,
    Ply,
}

/// One Cryptomatte layer, with the names that are in the picture.
struct MatteLayer {
    name: &'static str,
    names: BTreeMap<MatteId, (String, u32)>,
    level: Level,
}

impl MatteLayer {
    /// The layers of a film: fabrics with all other surfaces, yarns, plies.
    fn all(frame: &Frame, film: &Film) -> Vec<Self> {
        let pixels = (0..film.height).flat_map(|y| (0..film.width).map(move |x| (x, y)));
        let seen: BTreeSet<MatteId> = pixels.flat_map(|(x, y)| film.covering(x, y)).map(|(id, _)| *id).collect();
        [("CryptoFabric", Level::Fabric), ("CryptoYarn", Level::Yarn), ("CryptoPly", Level::Ply)]
            .map(|(name, level)| {
                let named = |id: &MatteId| {
                    let index = id.fabric as usize;
                    let text = match (level, frame.fabrics.get(index)) {
                        (Level::Fabric, Some(fabric)) => fabric.clone(),
                        (Level::Fabric, None) => frame.surfaces.get(index - frame.fabrics.len())?.clone(),
                        (Level::Yarn, fabric) => format!("{}/yarn{}", fabric?, id.yarn),
                        (Level::Ply, fabric) => format!("{}/yarn{}/ply{}", fabric?, id.yarn, id.ply),
                    };
                    let hash = cryptomatte::id(&text);
                    Some((level.of(*id), (text, hash)))
                };
                Self { name, names: seen.iter().filter_map(named).collect(), level }
            })
            .into()
    }

    fn attributes(&self) -> Vec<(String, Attribute)> {
        cryptomatte::attributes(self.name, self.names.values().map(|(name, _)| name.as_str()))
    }

    /// The samples of a pixel, from what covers it.
    fn ranks(
        &self,
        met: &[(MatteId, u32)],
        samples: u32,
        buffer: &mut Vec<(u32, u32)>,
    ) -> [f32; 2 * cryptomatte::DEPTH] {
        buffer.clear();
        buffer.extend(met.iter().filter_map(|(id, count)| Some((self.names.get(&self.level.of(*id))?.1, *count))));
        cryptomatte::rank(buffer, samples)
    }
}

impl Level {
    /// The id of what a ply is part of.
    fn of(self, id: MatteId) -> MatteId {
        match self {
            Self::Fabric => MatteId { yarn: 0, ply: 0, ..id },
            Self::Yarn => MatteId { ply: 0, ..id },
            Self::Ply => id,
        }
    }
}
