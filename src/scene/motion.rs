//! How a camera moves: by keys, around what it looks at, and while the shutter is open.

use glam::DVec3;

use super::{animation::Track, camera::Camera};

/// Poses of a camera within a shutter's time; between them it moves on straight lines.
const POSES: usize = 17;

/// Where a camera is told to be, by frame. Lengths are millimetres in the scene's own place.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraMotion {
    /// Where it stands; for a camera that has an [`Aim`].
    pub position: Option<Track>,
    /// What it looks at; for a camera that has an [`Aim`].
    pub target: Option<Track>,
    /// Vertical angle (radians) or height (millimetres) of the view, in x.
    pub opening: Option<Track>,
    /// Whether it goes around what it looks at.
    pub turntable: Option<Turntable>,
    /// When the shutter opens and closes, in frames from the frame's own time.
    pub shutter: Option<[f64; 2]>,
}

/// A camera that goes around what it looks at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turntable {
    /// The frame in which it stands where it would without turning.
    pub start: f64,
    /// Radians per frame.
    pub rate: f64,
}

/// What a camera looks at, and from where: millimetres in the scene's own place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// Where it stands.
    pub position: DVec3,
    /// What it looks at.
    pub target: DVec3,
    /// Which way is up.
    pub up: DVec3,
}

impl CameraMotion {
    /// Whether the camera is anywhere else at another time.
    fn moves(&self) -> bool {
        self.position.is_some() || self.target.is_some() || self.opening.is_some() || self.turntable.is_some()
    }

    /// Whether the camera goes around the cloth.
    pub(super) fn turns(&self) -> bool {
        self.turntable.is_some()
    }

    /// The camera at a time in frames; `still` is where it is without motion, and `pivot` what it turns about.
    fn pose(&self, still: &Camera, aim: Option<&Aim>, middle: DVec3, up: DVec3, time: f64) -> Camera {
        let mut camera = *still;
        if let Some(aim) = aim {
            let position = self.position.as_ref().map_or(aim.position, |t| t.at(time)) - middle;
            let target = self.target.as_ref().map_or(aim.target, |t| t.at(time)) - middle;
            let projection = self.opening.as_ref().map_or(still.projection, |t| still.projection.with(t.at(time).x));
            // Where position and target meet, the camera keeps its directions.
            let fallback = Camera { position, projection, ..*still };
            let turned = Camera::looking_at(position, target, aim.up, projection);
            camera = turned.map_or(fallback, |turned| Camera { shift: still.shift, ..turned });
        }
        if let Some(table) = &self.turntable {
            let pivot = aim.map_or(DVec3::ZERO, |a| self.target.as_ref().map_or(a.target, |t| t.at(time)) - middle);
            camera = camera.turned(up, pivot, table.rate * (time - table.start));
        }
        camera
    }

    /// The camera at a time in frames: `still` where it does not move.
    pub(super) fn at(&self, still: &Camera, aim: Option<&Aim>, middle: DVec3, up: DVec3, time: f64) -> Camera {
        if self.moves() { self.pose(still, aim, middle, up, time) } else { *still }
    }

    /// The camera in the middle of the shutter's time, and where it is from opening to closing if it moves meanwhile.
    pub(super) fn poses(
        &self,
        still: &Camera,
        aim: Option<&Aim>,
        middle: DVec3,
        up: DVec3,
        frame: f64,
    ) -> (Camera, Vec<Camera>) {
        if !self.moves() {
            return (*still, Vec::new());
        }
        let [open, close] = self.shutter.unwrap_or_default();
        let at = |share: f64| self.pose(still, aim, middle, up, frame + open + share * (close - open));
        let mut path: Vec<Camera> = (0..POSES).map(|i| at(i as f64 / (POSES - 1) as f64)).collect();
        if path.iter().all(|pose| *pose == path[0]) {
            path.clear();
        }
        (at(0.5), path)
    }
}

/// Places around which everything turns: the outline, ring by ring, of points (and their radii) turned about an axis
/// through the origin.
pub(super) fn revolved<'a>(points: impl Iterator<Item = (&'a DVec3, f64)> + Clone, up: DVec3) -> Vec<DVec3> {
    const RINGS: usize = 64;
    const CORNERS: usize = 32;
    let axis = up.normalize_or(DVec3::Y);
    let height = |(p, r): (&DVec3, f64)| (p.dot(axis) - r, p.dot(axis) + r);
    let (low, high) = points.clone().map(height).fold((f64::MAX, f64::MIN), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    if low > high {
        return Vec::new();
    }
    let step = ((high - low) / RINGS as f64).max(1e-12);
    let mut widths = [0.0_f64; RINGS];
    for (p, r) in points {
        let width = (*p - p.dot(axis) * axis).length() + r;
        let place = |h: f64| (((h - low) / step) as usize).min(RINGS - 1);
        for ring in &mut widths[place(p.dot(axis) - r)..=place(p.dot(axis) + r)] {
            *ring = ring.max(width);
        }
    }
    let (s, t) = axis.any_orthonormal_pair();
    let corner = |i: usize| {
        let angle = std::f64::consts::TAU * i as f64 / CORNERS as f64;
        // The corners' polygon lies around the circle.
        (angle.cos() * s + angle.sin() * t) / (std::f64::consts::PI / CORNERS as f64).cos()
    };
    let rings = widths.iter().enumerate().filter(|(_, w)| **w > 0.0);
    rings
        .flat_map(|(i, w)| [i as f64, i as f64 + 1.0].map(|h| (low + h * step, *w)))
        .flat_map(|(h, w)| (0..CORNERS).map(move |i| h * axis + w * corner(i)))
        .collect()
}
