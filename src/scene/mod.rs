//! What the user asked for: a checked [`Scene`].
//!
//! A [`SceneBuilder`] takes yarns, curves, lights and a camera as values and makes a [`Scene`] of them. [`load`] does so
//! from scene files: it knows their keys, ranges and units, and reads the files that a scene names. A [`Scene`] is a
//! plain value in millimetres and radians with its origin at the middle of the cloth; it knows nothing of TOML or
//! Embree.

pub(crate) mod animation;
mod axes;
pub mod builder;
pub mod camera;
pub mod defaults;
pub(crate) mod drawn_draft;
mod fiber_detail;
pub(crate) mod force;
pub(crate) mod identity;
mod layers;
mod light_groups;
pub mod load;
pub(crate) mod motif;
pub(crate) mod motion;
pub(crate) mod palette;
pub mod view;

use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec2};
use rayon::prelude::*;

pub use axes::Axes;
pub use builder::{SceneBuilder, SceneError};
pub use camera::{Camera, Footprint};
pub use fiber_detail::FiberDetail;
pub use layers::{LayerName, Layers};
pub use light_groups::LightGroups;

use crate::{
    geometry::{
        curve::{Basis, Curve},
        density::{KnownPacking, PlyPacking},
        fiber::{Placement, flyaway::Flyaways, slopes::Twist},
        mesh::Mesh,
        overlap::Overlap,
        ply::PlyParameters,
        yarn::{YarnShape, mean_half_width},
    },
    image::{Compression, png::Display, texture::Texture},
    light::Light,
    scattering::{fiber::FiberMaterial, surface::SurfaceMaterial},
};

/// How yarns are represented.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Yarns are curves; plies and fibres are found analytically.
    Yarn,
    /// Plies are curves; the fibres in them are found analytically.
    Ply,
    /// Every fibre is a curve: the reference.
    Fiber,
}

impl Mode {
    /// Every mode with its name in files and on the command line.
    pub const NAMES: [(&'static str, Self); 3] = [("yarn", Self::Yarn), ("ply", Self::Ply), ("fiber", Self::Fiber)];

    /// The name in files and on the command line.
    pub fn name(self) -> &'static str {
        name_of(self, &Self::NAMES)
    }
}

/// The scattering model of a yarn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// Chains of TT, single scattering along the chord, multiple scattering by escape: the default.
    Aggregated,
    /// Two-stream energies on the camera's chord.
    TwoStream,
    /// The paper's model in its most charitable reading.
    Paper,
    /// The paper's equations as printed: gains energy.
    Printed,
    /// Classical dual scattering, from which the paper starts.
    DualScattering,
}

impl Model {
    /// Every model with its name in files and on the command line.
    pub const NAMES: [(&'static str, Self); 5] = [
        ("aggregated", Self::Aggregated),
        ("two-stream", Self::TwoStream),
        ("paper", Self::Paper),
        ("printed", Self::Printed),
        ("dual-scattering", Self::DualScattering),
    ];

    /// The name in files and on the command line.
    pub fn name(self) -> &'static str {
        name_of(self, &Self::NAMES)
    }
}

fn name_of<T: PartialEq>(value: T, names: &[(&'static str, T)]) -> &'static str {
    names.iter().find(|(_, v)| *v == value).map_or("?", |(name, _)| name)
}

/// A lobe of a single fibre.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FiberLobe {
    /// Reflection at the surface.
    R,
    /// Light that passes through.
    Tt,
    /// Light scattered diffusely inside.
    D,
}

impl FiberLobe {
    /// Every lobe with its name in files.
    pub const NAMES: [(&'static str, Self); 3] = [("R", Self::R), ("TT", Self::Tt), ("D", Self::D)];

    /// Takes the lobe away from a fibre.
    pub fn remove_from(self, fiber: &mut FiberMaterial) {
        match self {
            Self::R => fiber.r = [0.0; 3],
            Self::Tt => fiber.tt = [0.0; 3],
            Self::D => fiber.d = [0.0; 3],
        }
    }
}

/// How samples spread around a pixel's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PixelFilter {
    /// Even over a square of this half width, in pixels.
    Box(f32),
    /// Falling linearly to zero at this distance.
    Tent(f32),
    /// Normal with this standard deviation, cut at three of them.
    Gaussian(f32),
}

/// Settings of one render.
#[derive(Clone, Debug)]
pub struct RenderSettings {
    /// How yarns are represented.
    pub mode: Mode,
    /// The yarns' scattering model.
    pub model: Model,
    /// Lobes of single fibres that are left out, in every mode: the ablations of the paper's Fig. 6.
    pub without: Vec<FiberLobe>,
    /// Width of the picture, pixels.
    pub width: u32,
    /// Height of the picture, pixels.
    pub height: u32,
    /// The part that is rendered: x0, y0, x1, y1, the latter exclusive.
    pub crop: [u32; 4],
    /// Where a pixel's samples lie.
    pub filter: PixelFilter,
    /// Most samples per pixel.
    pub spp: u32,
    /// Stop after so many seconds of rendering.
    pub time: Option<f64>,
    /// Stop when the estimated relative mean square error is below this.
    pub noise: Option<f64>,
    /// More samples where the first ones say that they are needed.
    pub adaptive: bool,
    /// Most scattering events of a path.
    pub max_bounces: u32,
    /// Threads; `None` for all cores.
    pub threads: Option<usize>,
    /// Start of all random numbers.
    pub seed: u32,
    /// The number of the frame in a sequence; noise changes with it.
    pub frame: Option<u32>,
    /// Whether fibres are told apart where they are wide enough in the picture.
    pub fiber_detail: bool,
    /// Smaller or faster BVH.
    pub compact_bvh: bool,
    /// Bytes that curves, BVH, film and textures may take together; `None` for no limit.
    pub max_memory: Option<u64>,
    /// Features to bring in though the scene does not need them, for measurements.
    pub force: Vec<String>,
}

/// How EXR files are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Storage {
    /// How rows are compressed.
    pub compression: Compression,
    /// Whether the layers of light by where it came from have 16 bits; all else has 32.
    pub half_lobes: bool,
}

/// A kind of yarn.
#[derive(Clone, Debug)]
pub struct Yarn {
    /// Its name in the scene.
    pub name: String,
    /// Outer radius, millimetres, where curves have none of their own.
    pub radius: f64,
    /// The plies, lengths in yarn radii.
    pub plies: Vec<PlyParameters>,
    /// Angle of the plies against the yarn, radians.
    pub ply_twist: f64,
    /// The fibre of each ply: name and material.
    pub fibers: Vec<(String, FiberMaterial)>,
    /// Where explicit fibres lie.
    pub placement: Placement,
    /// How they lie, where that is known and not to be measured from `placement`.
    pub known_packing: KnownPacking,
    /// Fibres that leave the plies, lengths in yarn radii.
    pub flyaways: Option<Flyaways>,
    /// Standard deviation of its radius along it, relative; 0 for a yarn that is even.
    pub unevenness: f64,
    /// Grams in a kilometre, if known.
    pub tex: Option<f64>,
    /// Whether rays see plies as tilted cylinders; false is the paper's perpendicular section.
    pub tilted: bool,
}

impl Yarn {
    /// The same of dyed fibres: what passes through them, TT and D, times a colour; what their surface reflects is not.
    /// A colour above 1 stops where the fibre would make light.
    pub fn dyed(&self, color: [f64; 3]) -> Self {
        self.dyed_by_fiber(|_| color)
    }

    /// The same of fibres so dyed that thick cloth of them is `by` times as light: [`FiberMaterial::lightening`].
    pub fn lighter(&self, by: f64) -> Self {
        self.dyed_by_fiber(|fiber| fiber.lightening(by))
    }

    fn dyed_by_fiber(&self, color: impl Fn(&FiberMaterial) -> [f64; 3]) -> Self {
        let mut yarn = self.clone();
        for (_, fiber) in &mut yarn.fibers {
            for (c, factor) in color(fiber).into_iter().enumerate() {
                let inside = fiber.tt[c] + fiber.d[c];
                let most = if inside > 0.0 { (1.0 - fiber.r[c]).max(0.0) / inside } else { 1.0 };
                fiber.tt[c] *= factor.min(most);
                fiber.d[c] *= factor.min(most);
            }
        }
        yarn
    }

    /// Half of the room that it takes beside others, over its radius: see [`mean_half_width`].
    pub fn half_width(&self) -> f64 {
        mean_half_width(&self.plies)
    }

    /// Radius of the tube that holds all of its plies, over its own: 1, or more where elliptical plies have shoulders that stand out
    /// beyond it.
    pub fn tube(&self) -> f64 {
        // Round plies that touch the outline do so but for rounding.
        const ROUNDED: f64 = 1.0 + 1e-6;
        let reach = self.plies.iter().map(PlyParameters::reach).fold(1.0, f64::max);
        if reach > ROUNDED { reach } else { 1.0 }
    }

    /// The plies, lengths in radii of the tube that holds them.
    pub fn plies_in_tube(&self) -> Vec<PlyParameters> {
        let tube = self.tube();
        self.plies.iter().map(|ply| ply.in_units_of(tube)).collect()
    }

    /// The fly-aways, lengths in radii of that tube.
    pub fn flyaways_in_tube(&self) -> Option<Flyaways> {
        self.flyaways.map(|flyaways| flyaways.in_units_of(self.tube()))
    }

    /// The cross-section, ready for rays: lengths in radii of the tube that holds the plies.
    pub fn shape(&self) -> YarnShape {
        YarnShape::new(&self.plies_in_tube(), self.ply_twist, self.tilted)
    }

    /// How the fibres of each ply lie where the yarn's section is pressed to axes of `stretch` : 1. Measured from fibres placed for
    /// it: some milliseconds.
    pub fn packings(&self, stretch: f64) -> Vec<PlyPacking> {
        let mut packings: Vec<PlyPacking> = Vec::with_capacity(self.plies.len());
        let (shape, plies) = (self.shape(), self.plies_in_tube());
        for (k, ply) in plies.iter().enumerate() {
            let alike = |p: &PlyParameters| PlyParameters { angle: ply.angle, ..p.clone() } == *ply;
            let packing = match plies[..k].iter().position(alike) {
                Some(same) => packings[same],
                None => {
                    let twist = Twist::of(&shape.plies[k], shape.ply_rate);
                    self.placement.packing_of(ply, twist, self.known_packing, stretch)
                }
            };
            packings.push(packing);
        }
        packings
    }
}

/// What a fabric's curves are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveKind {
    /// Yarns: index into [`Scene::yarns`].
    Yarn(usize),
    /// Single fibres, explicit in every mode: index into [`Scene::fibers`].
    Fiber(usize),
}

/// Cut tufts of woven pile.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tufts {
    /// Yarns that are cut tufts.
    pub yarns: usize,
    /// Indices of the curves that are the strands which these open into, in order.
    pub strands: Vec<usize>,
}

impl Tufts {
    /// Of curves that are followed by other ones: how many come first, and the tufts of those that follow.
    pub(crate) fn followed(mut self, curves: usize, other: &Self) -> Self {
        self.strands.extend(other.strands.iter().map(|i| curves + i));
        Self { yarns: self.yarns + other.yarns, ..self }
    }

    /// Whether a curve is a strand of one.
    pub(crate) fn has(&self, curve: usize) -> bool {
        self.strands.binary_search(&curve).is_ok()
    }
}

/// Curves of one kind of yarn or fibre.
#[derive(Clone, Debug)]
pub struct Fabric {
    /// Its name, of which there is no other: given, or that of its yarn.
    pub name: String,
    /// Whether that was given to it, and is not its yarn's.
    pub named: bool,
    /// Where the curves came from, for messages.
    pub origin: String,
    /// Of cloth on a garment: from which of its curves on they lie on the panel of a name.
    pub panels: Vec<(usize, String)>,
    /// Whether a file gave the curves: its unit or radius may have been meant otherwise.
    pub from_file: bool,
    /// What they are.
    pub kind: CurveKind,
    /// The cut tufts of woven pile among its curves.
    pub tufts: Tufts,
    /// Curves and their radii, millimetres, about the scene's middle. None are left in a render: its yarns are made of them.
    pub curves: Vec<(Curve, Vec<f64>)>,
    /// Where they are at other times.
    pub motion: FabricMotion,
    /// What the yarn turns into here and there: its colours; empty for a fabric of one.
    pub variants: Vec<Yarn>,
    /// Indices into `variants` along each curve, as many from each control point to the next; empty without variants.
    pub material_indices: Vec<Vec<u16>>,
    /// Whether these are colours of a print, which go over into each other along a yarn.
    pub printed: bool,
    /// Texture coordinates of each control point of each curve, 0 to 1 over the fabric; empty if no layer holds them.
    pub uvs: Vec<Vec<Vec2>>,
    /// What they were, where a render has taken them.
    pub taken: Taken,
    /// Phase of the plies where each yarn starts, radians; reused in turn if there are fewer than yarns.
    pub phases: Vec<f64>,
    /// Whether its fibres are told apart somewhere in the picture.
    pub shows_fibers: bool,
    /// Start of what is random in it: where explicit fibres lie.
    pub seed: u32,
    /// The basis for Embree.
    pub basis: Basis,
    /// How far a resampled curve may lie from the given one, in yarn radii; 0 keeps the given points.
    pub tolerance: f64,
    /// The longest segment, in yarn radii.
    pub longest_segment: f64,
}

/// What is known of curves that a fabric does not hold: a render has taken them, or a survey has not made them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Taken {
    points: usize,
    pressed: bool,
    /// Length of curves that a survey has not made, in yarn radii; 0 of those that a render has taken.
    length: f64,
}

impl Taken {
    /// Of curves that a survey does not make: about so many points, and so many yarn radii of length.
    pub(crate) fn not_made(points: u64, length: f64, pressed: bool) -> Self {
        Self { points: points as usize, pressed, length }
    }
}

/// A straight piece of a fabric's yarn in place of all its curves.
pub(crate) struct Sample {
    /// The fabric, with this one curve.
    pub fabric: Fabric,
    /// How many times as much the fabric has.
    pub times: f64,
}

/// The points of a fabric's curves at other times: for each time, for each curve, millimetres.
#[derive(Clone, Debug, Default)]
pub struct FabricMotion {
    /// Evenly spaced from the opening of the shutter, which `curves` shows, to its closing. Empty if nothing moves.
    pub later: Vec<Vec<Vec<DVec3>>>,
    /// At rest: plies wind by lengths along these. `None` if the curves are at rest.
    pub rest: Option<Vec<Vec<DVec3>>>,
    /// At the frame's own time and one frame later, for the layer of motion. Empty if nothing moves or no layer holds it.
    pub flow: Vec<Vec<Vec<DVec3>>>,
}

impl Fabric {
    /// Moves curves, at all times, by a transform whose scale is the same along all axes; radii grow with it.
    pub fn transform(&mut self, by: &DAffine3) {
        transform_curves(&mut self.curves, by);
        let FabricMotion { later, rest, flow } = &mut self.motion;
        for curve in later.iter_mut().chain(flow).flatten().chain(rest.iter_mut().flatten()) {
            for p in curve {
                *p = by.transform_point3(*p);
            }
        }
    }

    /// Number of control points, as given.
    pub fn control_points(&self) -> usize {
        self.taken.points + self.curves.iter().map(|(c, _)| c.points.len()).sum::<usize>()
    }

    /// What stands for curves that a survey has not made: a piece of yarn of as many points on its length; `None` where
    /// there are none such.
    pub(crate) fn sample(&self, radius: f64) -> Option<Sample> {
        /// Enough that what is at its ends does not count.
        const POINTS: usize = 10_000;
        let Taken { points, pressed, length } = self.taken;
        if points < 2 || length <= 0.0 {
            return None;
        }
        let count = points.clamp(4, POINTS);
        let step = length * radius / points as f64;
        let curve = Curve {
            basis: Basis::BSpline,
            closed: false,
            points: (0..count).map(|i| DVec3::new(step * i as f64, 0.0, 0.0)).collect(),
            radii: None,
            flattening: pressed.then(|| vec![glam::Vec3::Y * 0.8; count]),
        };
        let curves = vec![(curve, vec![radius; count])];
        let fabric = Self { curves, motion: FabricMotion::default(), taken: Taken::default(), ..self.clone() };
        Some(Sample { fabric, times: points as f64 / count as f64 })
    }

    /// Whether any of its yarns is pressed flat.
    pub fn is_pressed(&self) -> bool {
        self.taken.pressed || self.curves.iter().any(|(curve, _)| curve.flattening.is_some())
    }

    /// The name of the garment's panel on which a curve lies, if it has one.
    pub fn panel_of(&self, curve: usize) -> Option<&str> {
        let after = self.panels.partition_point(|(first, _)| *first <= curve);
        let (_, name) = self.panels.get(after.checked_sub(1)?)?;
        (!name.is_empty()).then_some(name)
    }

    /// Takes the curves out of it, and leaves what statistics tell of them.
    pub fn take_curves(&mut self) -> Vec<(Curve, Vec<f64>)> {
        self.taken = Taken { points: self.control_points(), pressed: self.is_pressed(), length: 0.0 };
        std::mem::take(&mut self.curves)
    }
}

/// What is known of a garment and of the cloth on it.
#[derive(Clone, Debug, PartialEq)]
pub struct GarmentFacts {
    /// Its mesh.
    pub path: String,
    /// The name of its cloth, of which panels may have others.
    pub cloth: String,
    /// Its panels, by the numbers that choose them.
    pub panels: Vec<PanelFacts>,
    /// Stitches of all panels; crossings of a weave.
    pub stitches: u64,
    /// Place and radius of the part that is laid, millimetres, where that is not all: stitches, yarns and points are of it.
    pub near: Option<(DVec3, f64)>,
    /// Length of all yarns, millimetres; without seams and finished edges where it was not laid.
    pub yarn_length: f64,
    /// Weight of all yarns, grams, where every yarn's `tex` is known.
    pub weight: Option<f64>,
    /// How far the yarns of its cloth run into each other where it lies flat. Of several cloths that with the most.
    pub overlap: Option<Overlap>,
    /// About as many control points.
    pub control_points: u64,
    /// 3-D length over length as cut, by area: at 5, 50 and 95 %.
    pub uv_ratio: [f64; 3],
    /// Share of the area that is stretched by more than a tenth.
    pub stretched: f64,
    /// Share of it that is compressed by more than a tenth.
    pub compressed: f64,
    /// Millimetres per unit of its texture coordinates.
    pub uv_mm: f64,
    /// Length of its seams as cut, millimetres.
    pub sewn: f64,
    /// Length of its free edges as cut, millimetres.
    pub free: f64,
    /// The box around its mesh, millimetres, before the fabric is moved to its place.
    pub bounds: (DVec3, DVec3),
    /// What was repaired or found out, one line each.
    pub repairs: Vec<String>,
}

/// What is known of a panel of a garment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PanelFacts {
    /// The name of its group, empty if it has none.
    pub name: String,
    /// The name of its cloth.
    pub cloth: String,
    /// Its stitches; crossings of a weave.
    pub stitches: u64,
}

/// A floor.
#[derive(Clone, Copy, Debug)]
pub struct Ground {
    /// Its y, millimetres.
    pub height: f32,
    /// Index into [`Scene::materials`].
    pub material: usize,
}

/// What the ground and meshes are made of.
#[derive(Clone, Debug)]
pub struct Material {
    /// How it scatters.
    pub surface: SurfaceMaterial,
    /// What its albedo is multiplied with, by a mesh's texture coordinates.
    pub texture: Option<AlbedoTexture>,
    /// Whether the camera sees nothing where it is, not even what is behind it.
    pub holdout: bool,
}

/// A picture over a surface.
#[derive(Clone, Debug)]
pub struct AlbedoTexture {
    /// The picture.
    pub texture: Arc<Texture>,
    /// How often it is repeated over 0 to 1 of the texture coordinates.
    pub repeat: Vec2,
}

/// A mesh of the scene.
#[derive(Clone, Debug)]
pub struct Object {
    /// What mattes call it.
    pub name: String,
    /// Its file or shape, for messages.
    pub origin: String,
    /// The triangles, millimetres, about the scene's middle.
    pub mesh: Mesh,
    /// Index into [`Scene::materials`].
    pub material: usize,
    /// Its points one frame later, for the layer of motion; empty if they are the same. It stands still while the shutter is
    /// open.
    pub next: Vec<DVec3>,
}

/// A checked scene: millimetres, radians, origin at the middle of the cloth.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The scene file, as it was named.
    pub path: String,
    /// Settings of the render.
    pub render: RenderSettings,
    /// How pictures for a screen are made.
    pub display: Display,
    /// Layers of an EXR.
    pub layers: Layers,
    /// How an EXR is stored.
    pub storage: Storage,
    /// The unit and the axes of its places.
    pub axes: Axes,
    /// Whether a denoised picture is made as well.
    pub denoise: bool,
    /// The view, in the middle of the shutter's time.
    pub camera: Camera,
    /// The view from when the shutter opens to when it closes, evenly spaced in time; empty if it stands still.
    pub camera_path: Vec<Camera>,
    /// The view at the frame's own time and one frame later, if the layer of motion holds how it moves.
    pub camera_flow: Option<[Camera; 2]>,
    /// Frames in a second of the sequence, as its user told.
    pub frames_per_second: Option<f64>,
    /// Kinds of yarn that fabrics use.
    pub yarns: Vec<Yarn>,
    /// Fibres that fabrics use by themselves: name and material.
    pub fibers: Vec<(String, FiberMaterial)>,
    /// The cloth.
    pub fabrics: Vec<Fabric>,
    /// What stands beside it.
    pub objects: Vec<Object>,
    /// Materials of ground and objects.
    pub materials: Vec<Material>,
    /// The lights.
    pub lights: Vec<Light>,
    /// The groups that they are in.
    pub light_groups: LightGroups,
    /// The floor.
    pub ground: Option<Ground>,
    /// What was subtracted from all positions, millimetres.
    pub middle: DVec3,
    /// What is known of the fabrics that are laid on garments.
    pub garments: Vec<GarmentFacts>,
    /// Every key that changes the picture, with its value: [`identity::identity`].
    pub identity: Vec<(String, String)>,
    /// A fingerprint of everything that changes the picture.
    pub fingerprint: String,
    /// What the user should know and what did not stop the scene from loading.
    pub warnings: Vec<String>,
}

impl Scene {
    /// Whether there is nothing to see: neither cloth nor a mesh.
    pub(crate) fn shows_nothing(&self) -> bool {
        self.fabrics.is_empty() && self.objects.is_empty()
    }

    /// Whether cloth moves while the shutter is open.
    pub fn cloth_moves(&self) -> bool {
        self.fabrics.iter().any(|f| !f.motion.later.is_empty())
    }

    /// The camera at a time from 0, when the shutter opens, to 1, when it closes.
    #[inline]
    pub fn camera_at(&self, time: f32) -> Camera {
        let Some(steps) = self.camera_path.len().checked_sub(1) else { return self.camera };
        let x = f64::from(time) * steps as f64;
        let step = (x as usize).min(steps.saturating_sub(1));
        self.camera_path[step].towards(&self.camera_path[(step + 1).min(steps)], x - step as f64)
    }

    /// The layers that a film must collect: those of the EXR, and what guides a denoiser.
    pub fn collected(&self) -> Layers {
        Layers { albedo: self.layers.albedo || self.denoise, normal: self.layers.normal || self.denoise, ..self.layers }
    }

    /// A power of two by which light is divided before a film sums it up: 1 for all lights but very faint and very
    /// strong ones, for a film counts in steps that suit radiances about 1.
    pub fn light_scale(&self) -> f32 {
        let power: f64 = self.lights.iter().map(|l| f64::from(l.irradiance_at_middle())).sum();
        let exponent = if power > 0.0 && power.is_finite() { power.log2().round() } else { 0.0 };
        // Beyond 2^120 the scale itself would leave single precision.
        if exponent.abs() <= 20.0 { 1.0 } else { exponent.clamp(-120.0, 120.0).exp2() as f32 }
    }

    /// The box around all control points, with their radii; `None` without cloth.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        bounds(&self.fabrics)
    }
}

/// The box around the control points of `fabrics`, with their radii.
pub fn bounds(fabrics: &[Fabric]) -> Option<(DVec3, DVec3)> {
    let joined = |a: (DVec3, DVec3), b: (DVec3, DVec3)| (a.0.min(b.0), a.1.max(b.1));
    let of_curve = |(curve, radii): &(Curve, Vec<f64>)| {
        curve.points.iter().zip(radii).map(|(p, &r)| (*p - r, *p + r)).reduce(joined)
    };
    fabrics.par_iter().flat_map(|f| &f.curves).filter_map(of_curve).reduce_with(joined)
}

/// Moves curves by a transform whose scale is the same along all axes; radii grow with it, and short axes of pressed sections
/// turn with it.
pub fn transform_curves(curves: &mut [(Curve, Vec<f64>)], by: &DAffine3) {
    let scale = by.matrix3.x_axis.length();
    curves.par_iter_mut().for_each(|(curve, radii)| {
        for p in &mut curve.points {
            *p = by.transform_point3(*p);
        }
        // Their length is a ratio.
        for axis in curve.flattening.iter_mut().flatten() {
            *axis = (by.transform_vector3(axis.as_dvec3()) / scale).as_vec3();
        }
        if scale != 1.0 {
            for r in radii {
                *r *= scale;
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, Vec3};

    use super::*;

    #[test]
    fn short_axes_of_sections_turn_with_their_yarn() {
        let points = vec![DVec3::ZERO, DVec3::X, 2.0 * DVec3::X];
        let flattening = Some(vec![0.5 * Vec3::Z; 3]);
        let curve = Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening };
        let mut curves = [(curve, vec![1.0; 3])];
        // x becomes y, y becomes z and z becomes x.
        let turn = DQuat::from_axis_angle(DVec3::ONE.normalize(), std::f64::consts::TAU / 3.0);
        let by = DAffine3::from_scale_rotation_translation(DVec3::splat(3.0), turn, DVec3::new(4.0, 5.0, 6.0));
        transform_curves(&mut curves, &by);
        let [(curve, radii)] = &curves;
        assert!(curve.points[1].abs_diff_eq(DVec3::new(4.0, 8.0, 6.0), 1e-12), "{}", curve.points[1]);
        let axes = curve.flattening.as_ref().unwrap();
        assert!(axes.iter().all(|axis| axis.abs_diff_eq(0.5 * Vec3::X, 1e-6)), "{axes:?}");
        assert_eq!(*radii, [3.0; 3]);
    }
}
