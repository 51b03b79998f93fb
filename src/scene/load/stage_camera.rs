//! `camera = { type = "usd", path, prim }`: the camera of a stage, with its lens and its way in time.

use glam::{DMat4, DVec2, DVec3};

use super::{
    super::{
        animation::Track,
        camera::Projection,
        defaults,
        motion::Aim,
        view::{CameraSetup, Focus, LensSetup},
    },
    Context, Reader, UNITS, Y_UP, motion, z_up,
};
use crate::files::stage::{Stage, StageCamera, StageError};

/// Frames around the shutter's time of which the camera's place is known: its way between them is smooth.
const FRAMES_AROUND: i64 = 3;

/// A camera in millimetres, +y up.
struct Pose {
    aim: Aim,
    projection: Projection,
    lens: Option<LensSetup>,
    /// In heights of the picture, as of a [`Camera`](super::super::camera::Camera).
    shift: DVec2,
}

impl Pose {
    fn new(camera: &StageCamera, unit: f64, z_up: bool) -> Self {
        let turn = if z_up { DMat4::from_mat3(Y_UP) } else { DMat4::IDENTITY };
        let to_world = DMat4::from_scale(DVec3::splat(unit)) * turn * camera.to_stage;
        let position = to_world.w_axis.truncate();
        let back = to_world.z_axis.truncate().normalize();
        let up = to_world.y_axis.truncate().normalize();
        let film = camera.film_unit * unit;
        // What it looks at is what is sharp, or somewhere ahead.
        let distance = if camera.focus_distance > 0.0 { camera.focus_distance * unit } else { 1000.0 };
        let [_, height] = camera.aperture;
        let shift = DVec2::from(camera.offset) / height;
        let projection = match camera.focal_length {
            Some(focal) => Projection::Perspective(2.0 * (0.5 * height / focal).atan()),
            None => Projection::Orthographic(height * unit),
        };
        let opening = camera.focal_length.filter(|_| camera.f_stop > 0.0).map(|focal| focal * film / camera.f_stop);
        let lens = opening.filter(|_| camera.focus_distance > 0.0);
        Self {
            aim: Aim { position, target: position - distance * back, up },
            projection,
            lens: lens.map(|diameter| LensSetup { radius: 0.5 * diameter, focus: Focus::Distance(distance) }),
            shift,
        }
    }
}

/// Reads the keys of such a camera and its stage.
pub(super) fn camera(table: &Reader<'_>, context: &Context<'_>, frame: u32) -> Option<CameraSetup> {
    let path = table.required_string("path").map(|p| context.resolve(p, table.span("path").unwrap_or(table.header())));
    let prim = table.string("prim").map(str::to_owned);
    let fallback = Projection::Perspective(defaults::FIELD_OF_VIEW.to_radians());
    let unit = table.one_of("unit", &UNITS);
    let z_up = z_up(table);
    let own_motion = motion::read(table, context, None, fallback);
    let path = path?;
    let [open, close] = own_motion.shutter.unwrap_or_default();
    let stage = context.stages.open(&path).map_err(|error| table.error_at("path", error.to_string(), None)).ok()?;
    let prim = match prim {
        Some(prim) => prim,
        None => only_camera(&stage, table)?,
    };
    // USD says both, Alembic neither.
    let unit = unit.or(stage.unit_mm()).unwrap_or(context.unit);
    let space = (unit, z_up.unwrap_or(stage.up_axis() == Some(2)));
    match poses(&stage, &prim, f64::from(frame), [open, close], space) {
        Ok((own, around)) => {
            let Some(mut setup) = CameraSetup::aimed(own.aim, own.projection) else {
                table.error_at("prim", "the camera has no direction", None);
                return None;
            };
            setup.lens = own.lens;
            setup.camera.shift = own.shift;
            setup.motion = own_motion;
            if around.len() > 1 {
                let track =
                    |value: &dyn Fn(&Pose) -> DVec3| Track::new(around.iter().map(|(t, p)| (*t, value(p))).collect());
                setup.motion.position = track(&|p| p.aim.position);
                setup.motion.target = track(&|p| p.aim.target);
                setup.motion.opening = track(&|p| match p.projection {
                    Projection::Perspective(opening) | Projection::Orthographic(opening) => DVec3::splat(opening),
                });
            }
            Some(setup)
        }
        Err(error) => {
            table.error_at("path", error.to_string(), None);
            None
        }
    }
}

/// The camera of a stage that has one.
fn only_camera(stage: &Stage, table: &Reader<'_>) -> Option<String> {
    let cameras = stage.contents().map_err(|error| table.error_at("path", error.to_string(), None)).ok()?.cameras;
    match <[String; 1]>::try_from(cameras) {
        Ok([only]) => Some(only),
        Err(none) if none.is_empty() => {
            table.error_at("path", format!("{}: there is no camera in it", stage.path().display()), None);
            None
        }
        Err(several) => {
            let hint = format!("prim = {:?}; cameras here: {}", several[0], several.join(", "));
            table.error("missing key `prim`: which camera of the stage it is", Some(&hint));
            None
        }
    }
}

/// The camera at a frame, and at the frames around the shutter's time if it moves. Stages may have samples without telling
/// a range of times.
fn poses(
    stage: &Stage,
    prim: &str,
    frame: f64,
    [open, close]: [f64; 2],
    (unit, z_up): (f64, bool),
) -> Result<(Pose, Vec<(f64, Pose)>), StageError> {
    let at = |frame: f64| stage.camera(prim, Some(frame)).map(|camera| Pose::new(&camera, unit, z_up));
    let own = at(frame)?;
    let first = (frame + open).floor() as i64 - FRAMES_AROUND;
    let last = (frame + close).ceil() as i64 + FRAMES_AROUND;
    let around = (first..=last).map(|f| Ok((f as f64, at(f as f64)?))).collect::<Result<Vec<_>, StageError>>()?;
    let still = around.iter().all(|(_, p)| p.aim == own.aim && p.projection == own.projection);
    Ok((own, if still { Vec::new() } else { around }))
}
