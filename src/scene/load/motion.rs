//! `[[camera.key]]`, `[camera.turntable]` and the shutter.

use glam::DVec3;

use super::{
    super::{
        animation::Track,
        camera::Projection,
        motion::{Aim, CameraMotion, Turntable},
    },
    Context, Range, Reader, radians,
};

/// Reads the keys of `[camera]`; `aim` is absent for a camera that finds its own place.
pub(super) fn read(
    table: &Reader<'_>,
    context: &Context<'_>,
    aim: Option<&Aim>,
    projection: Projection,
) -> CameraMotion {
    let shutter = table.vec2("shutter", Range::between(-10.0, 10.0));
    if shutter.is_some_and(|[open, close]| open > close) {
        table.error_at("shutter", "the shutter must open before it closes", Some("shutter = [-0.25, 0.25]"));
    }
    let mut motion = CameraMotion {
        turntable: table.table("turntable").map(turntable),
        shutter: shutter.filter(|[open, close]| open < close),
        ..CameraMotion::default()
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
        let place = |name| key.vec3(name, Range::PLACE).map(|p| context.position(p));
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

fn turntable(table: Reader<'_>) -> Turntable {
    let frames = table.required_f64("frames", Range::POSITIVE).unwrap_or(1.0);
    let degrees = table.f64_or("degrees", 360.0, Range::FINITE);
    let start = table.f64_or("start", 1.0, Range::FINITE);
    table.finish();
    Turntable { start, rate: radians(degrees) / frames }
}
