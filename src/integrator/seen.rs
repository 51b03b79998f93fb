//! What layers hold of the place that a camera path meets first.

use glam::{Vec2, Vec3A};

use super::{Integrator, Path, Scratch};
use crate::{
    film::Sample,
    geometry::section::Section,
    math::sampler::hash2,
    scattering::yarn::YarnScatterer,
    scene::{Camera, Scene},
    trace::{Hit, YarnGeometry},
};

/// The most pixels by which anything is said to move: what passes close by the camera moves without end.
const MOST_PIXELS: f64 = 65_536.0;

/// The stream of random numbers by which fibres are told apart.
const SEEN_FIBER: u32 = 0xf1be_7000;

/// The view at the frame's own time and one frame later.
#[derive(Debug)]
pub(super) struct Flow {
    cameras: [Camera; 2],
    size: [u32; 2],
}

impl Flow {
    pub(super) fn of(scene: &Scene) -> Option<Self> {
        let size = [scene.render.width, scene.render.height];
        scene.camera_flow.filter(|_| scene.layers.motion).map(|cameras| Self { cameras, size })
    }

    /// By how many pixels, to the right and up, something moves from one place to another while the camera moves, too;
    /// nothing where it is not in front of it.
    fn pixels(&self, from: Vec3A, to: Vec3A) -> Vec2 {
        let [width, height] = self.size;
        let seen = |camera: &Camera, at: Vec3A| camera.project(at.as_dvec3(), width, height);
        match (seen(&self.cameras[0], from), seen(&self.cameras[1], to)) {
            (Some(a), Some(b)) => {
                let moved = (b - a).clamp(glam::DVec2::splat(-MOST_PIXELS), glam::DVec2::splat(MOST_PIXELS));
                Vec2::new(moved.x as f32, -moved.y as f32)
            }
            _ => Vec2::ZERO,
        }
    }
}

impl Integrator<'_> {
    /// Notes a place that stands still in the world.
    #[inline]
    pub(super) fn sees(&self, sample: &mut Sample, point: Vec3A) {
        self.sees_moving(sample, point, point);
    }

    /// Notes a place that is elsewhere one frame later.
    #[inline]
    pub(super) fn sees_moving(&self, sample: &mut Sample, point: Vec3A, next: Vec3A) {
        sample.position = point;
        if let Some(flow) = &self.flow {
            sample.motion = flow.pixels(point, next);
        }
    }

    /// Which fibre the camera sees first, by [`crate::geometry::section::SeenFiber::numbers`], if fibres are told apart there.
    #[inline]
    pub(super) fn seen_fiber(
        &self,
        hit: &Hit<'_>,
        section: &Section<'_>,
        (yarns, yarn): (&YarnGeometry, &YarnScatterer),
        path: &Path<'_>,
        scratch: &Scratch,
    ) -> Option<[f32; 2]> {
        let detail = self.fiber_detail.filter(|_| path.bounces == 0)?;
        let front = scratch.crossings.first()?;
        let shape = yarn.shape();
        let width = 2.0 * shape.plies[front.ply].fiber_radius * section.radius;
        let mut stream = path.sampler.stream(SEEN_FIBER);
        if stream.next() >= detail.chance(width, section.point_on_ray(front.enter)) {
            return None;
        }
        let distance = yarns.strands.distance_along(hit.segment, hit.u)?;
        let ply = (yarns.first_ply + front.ply) as u32;
        let key = hash2(hash2(yarns.fabric as u32, yarns.strands.yarn_of(hit.segment) as u32), ply);
        Some(section.seen_fiber(shape, front, distance).numbers(key, [stream.next(), stream.next(), stream.next()]))
    }

    /// Notes a place on a yarn, which may move: it keeps its place in the yarn's frame.
    #[inline]
    pub(super) fn sees_yarn(&self, sample: &mut Sample, hit: &Hit<'_>, yarns: &YarnGeometry, point: Vec3A, time: f32) {
        sample.position = point;
        if self.layers.uv {
            sample.uv = yarns.strands.uvs().at(hit.segment, hit.u);
        }
        let Some(flow) = &self.flow else { return };
        let [from, to] = match yarns.strands.flow(hit.segment, hit.u) {
            None => [point; 2],
            Some(frames) => {
                let seen = yarns.strands.frame_at(hit.segment, hit.u, time);
                let off = point - seen.centre;
                let across = seen.tangent.cross(seen.normal);
                let [t, n, b] = [seen.tangent, seen.normal, across].map(|axis| off.dot(axis));
                frames.map(|f| f.centre + t * f.tangent + n * f.normal + b * f.tangent.cross(f.normal))
            }
        };
        sample.motion = flow.pixels(from, to);
    }
}
