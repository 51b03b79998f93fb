//! How a camera moves: `[[camera.key]]`, `[camera.turntable]` and the shutter.

use glam::DVec3;

use super::{
    super::{
        animation::Track,
        camera::{Camera, Projection},
    },
    Context, Range, Reader, radians,
};

/// Poses of a camera within a shutter's time; between them it moves on straight lines.
const POSES: usize = 17;

/// Where the camera is told to be, by frame. Lengths are millimetres in the scene's own place.
#[derive(Default)]
pub(super) struct Motion {
    position: Option<Track>,
    target: Option<Track>,
    /// Vertical angle or height.
    opening: Option<Track>,
    turntable: Option<Turntable>,
    /// When the shutter opens and closes, in frames from the frame's own time.
    pub(super) shutter: Option<[f64; 2]>,
}

/// A camera that goes around what it looks at.
struct Turntable {
    start: f64,
    /// Radians per frame.
    rate: f64,
}

/// What a moving camera looks at when it stands still.
pub(super) struct Aim {
    pub(super) position: DVec3,
    pub(super) target: DVec3,
    pub(super) up: DVec3,
}

impl Motion {
    /// Reads the keys of `[camera]`; `aim` is absent for a camera that finds its own place.
    pub(super) fn read(table: &Reader<'_>, context: &Context<'_>, aim: Option<&Aim>, projection: Projection) -> Self {
        let shutter = table.vec2("shutter", Range::between(-10.0, 10.0));
        if shutter.is_some_and(|[open, close]| open > close) {
            table.error_at("shutter", "the shutter must open before it closes", Some("shutter = [-0.25, 0.25]"));
        }
        let mut motion = Self {
            turntable: table.table("turntable").map(Turntable::read),
            shutter: shutter.filter(|[open, close]| open < close),
            ..Self::default()
        };
        let (mut positions, mut targets, mut openings) = (Vec::new(), Vec::new(), Vec::new());
        let mut before = f64::NEG_INFINITY;
        for key in table.tables("key") {
            if aim.is_none() {
                key.error(
                    "a camera that frames the cloth finds its own place and takes no keys",
                    Some("type = \"perspective\" with position and target, or [camera.turntable]"),
                );
            }
            let place = |name| key.vec3(name, Range::FINITE).map(|p| context.position(p));
            let (position, target) = (place("position"), place("target"));
            let opening = match projection {
                Projection::Perspective(_) => key.f64("fov", Range::above(0.0).and_below(180.0)).map(radians),
                Projection::Orthographic(_) => key.f64("size", Range::POSITIVE).map(|s| s * context.unit),
            };
            match key.required_f64("frame", Range::FINITE) {
                Some(frame) if frame <= before => {
                    let message = format!("the keys of a camera stand in order: {frame} comes after {before}");
                    key.error_at("frame", message, None);
                }
                Some(frame) => {
                    before = frame;
                    positions.extend(position.map(|p| (frame, p)));
                    targets.extend(target.map(|p| (frame, p)));
                    openings.extend(opening.map(|o| (frame, DVec3::splat(o))));
                }
                None => {}
            }
            key.finish();
        }
        motion.position = Track::new(positions);
        motion.target = Track::new(targets);
        motion.opening = Track::new(openings);
        motion
    }

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
            camera = Camera::looking_at(position, target, aim.up, projection).unwrap_or(fallback);
        }
        if let Some(table) = &self.turntable {
            let pivot = aim.map_or(DVec3::ZERO, |a| self.target.as_ref().map_or(a.target, |t| t.at(time)) - middle);
            camera = camera.turned(up, pivot, table.rate * (time - table.start));
        }
        camera
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

impl Turntable {
    fn read(table: Reader<'_>) -> Self {
        let frames = table.required_f64("frames", Range::POSITIVE).unwrap_or(1.0);
        let degrees = table.f64_or("degrees", 360.0, Range::FINITE);
        let start = table.f64_or("start", 1.0, Range::FINITE);
        table.finish();
        Self { start, rate: radians(degrees) / frames }
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
