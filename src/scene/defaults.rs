//! What holds where neither a program nor a file says otherwise: defaults of a scene, in the units of scene files.
//!
//! Scene files leave keys out, programs begin with `Default` or `new`: both read these numbers. What only a key of a file
//! has, such as those of motion and hairs, stands where the key is read; what made cloth has, in [`pattern`](crate::pattern).

use super::{Mode, Model, PixelFilter, RenderSettings};

/// Picture size, pixels: width and height.
pub const SIZE: [u32; 2] = [768, 576];
/// Samples per pixel.
pub const SPP: u32 = 64;
/// Half width of a box filter, pixels.
pub const BOX_WIDTH: f32 = 0.5;
/// Half width of a tent filter, pixels.
pub const TENT_WIDTH: f32 = 1.0;
/// Standard deviation of a Gaussian filter, pixels.
pub const GAUSSIAN_WIDTH: f32 = 0.5;
/// The frame of a sequence.
pub const FRAME: u32 = 1;

/// Whether rays see plies as tilted cylinders.
pub const TILTED: bool = true;
/// How far a resampled curve may lie from the given one, yarn radii.
pub const CURVE_TOLERANCE: f64 = 0.005;
/// The longest segment of a resampled curve, yarn radii.
pub const LONGEST_SEGMENT: f64 = 3.0;

/// Vertical angle of a perspective view, degrees.
pub const FIELD_OF_VIEW: f64 = 30.0;
/// Share of the picture left free on each side of framed cloth.
pub const MARGIN: f64 = 0.04;
/// From where a camera looks that frames the cloth.
pub const VIEW_FROM: [f64; 3] = [0.0, 0.0, 1.0];
/// Which way is up, for cameras and rectangles of light.
pub const UP: [f64; 3] = [0.0, 1.0, 0.0];
/// Height of a full-frame sensor, millimetres.
pub const SENSOR_HEIGHT: f64 = 24.0;

/// Longitudinal width of a fibre's R, degrees.
pub const BETA_R: f64 = 10.0;
/// Longitudinal width of a fibre's TT, degrees.
pub const BETA_TT: f64 = 10.0;
/// Azimuthal width of a fibre's TT, degrees.
pub const BETA_N: f64 = 20.0;
/// Radius, millimetres, of an explicit fibre whose file and fabric give none: that of fine wool and of cotton.
pub const FIBER_RADIUS: f64 = 0.01;
/// Short over long semi-axis of a ply.
pub const PLY_ASPECT: f64 = 1.0;

/// Albedo of a surface.
pub const ALBEDO: f64 = 0.5;
/// Roughness of a coat.
pub const ROUGHNESS: f64 = 0.3;
/// Refractive index of a coat.
pub const IOR: f64 = 1.5;
/// Segments around a mesh of revolution.
pub const MESH_SEGMENTS: u32 = 128;

/// The lights of a scene that says nothing of any: radiance of the sky, and direction, irradiance and angular radius (degrees) of the sun.
pub const SKY: [f64; 3] = [0.30, 0.33, 0.38];
/// As above.
pub const SUN_TOWARDS: [f64; 3] = [-0.8, 0.55, 0.55];
/// As above.
pub const SUN_IRRADIANCE: [f64; 3] = [4.2, 4.0, 3.6];
/// As above.
pub const SUN_RADIUS: f64 = 1.0;

/// Radiance of environment and area lights; radiant intensity of points and spots, per square of the file's unit.
pub const RADIANCE: f64 = 1.0;
/// Irradiance of a distant light: that of an environment of radiance 1.
pub const IRRADIANCE: f64 = std::f64::consts::PI;
/// Angle of a spot from its axis, degrees.
pub const SPOT_ANGLE: f64 = 30.0;
/// The part of a spot's angle in which it fades.
pub const SPOT_EDGE: f64 = 0.2;

/// Most scattering events of a path. Explicit fibres scatter dozens of times where a yarn scatters once.
pub fn max_bounces(mode: Mode) -> u32 {
    if mode == Mode::Fiber { 512 } else { 64 }
}

impl Default for RenderSettings {
    fn default() -> Self {
        let mode = Mode::Yarn;
        let [width, height] = SIZE;
        Self {
            mode,
            model: Model::Aggregated,
            without: Vec::new(),
            width,
            height,
            crop: [0, 0, width, height],
            filter: PixelFilter::Gaussian(GAUSSIAN_WIDTH),
            spp: SPP,
            time: None,
            noise: None,
            adaptive: false,
            max_bounces: max_bounces(mode),
            threads: None,
            seed: 0,
            frame: None,
            fiber_detail: true,
            compact_bvh: true,
            max_memory: None,
            force: Vec::new(),
        }
    }
}
