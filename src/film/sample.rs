//! What a film takes: one sample of a pixel.

use glam::{Vec2, Vec3A};

use super::LightParts;
use crate::{math::Rgb, scene::LightGroups};

/// The light of one path from the camera, and what it met first.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sample {
    /// Radiance.
    pub radiance: Rgb,
    /// 1 if the camera's ray met cloth, a mesh or ground that scattered it, or a light that is seen, else 0.
    pub alpha: f32,
    /// Depth along the view where it first scattered, millimetres; zero without.
    pub depth: f32,
    /// Unit normal where it first scattered; zero without.
    pub normal: Vec3A,
    /// Where it first scattered, millimetres about the scene's middle; zero without.
    pub position: Vec3A,
    /// By how many pixels that moves until the next frame, to the right and up, if a layer holds it.
    pub motion: Vec2,
    /// Texture coordinates where it first scattered, if a layer holds them.
    pub uv: Vec2,
    /// Albedo of what it first scattered at, 0 to 1.
    pub albedo: Rgb,
    /// The radiance by where it came from.
    pub parts: LightParts,
    /// The radiance by the group of the light that it is of.
    pub lights: [Rgb; LightGroups::MOST],
    /// At what it first scattered, if that is asked for.
    pub matte: Option<MatteId>,
}

/// A ply of a yarn of the scene, or a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MatteId {
    /// Index of the fabric; meshes are counted on from there, and then comes the ground. Those have one yarn and ply.
    pub fabric: u32,
    /// Index of the yarn within it.
    pub yarn: u32,
    /// Index of the ply within that.
    pub ply: u32,
}
