//! `camera`, `[[light]]` and `[ground]`.

use std::{path::PathBuf, sync::Arc};

use glam::{DVec2, DVec3, Mat3A, Vec3A};

use super::{
    super::{
        LightGroups, Material,
        builder::GroundSetup,
        camera::Projection,
        defaults,
        motion::Aim,
        view::{CameraSetup, Focus, LensSetup},
    },
    Context, Range, Reader,
    mesh::{MaterialPlan, Materials, material_of},
    motion, radians, stage_camera,
};
use crate::{
    image,
    input::{
        diagnostic::{Span, shortened},
        document::Value,
    },
    light::{AreaLight, Environment, EnvironmentMap, Light, Shape},
    math::{Rgb, frame::orthonormal_basis},
};

/// Reads `camera = "frame"` or `[camera]`; without either the camera frames the cloth. `number` is that of the frame in a
/// sequence. With `frame` asked for, it goes to the face of flat cloth that it would see from the edge.
pub(super) fn camera(root: &Reader<'_>, context: &Context<'_>, frame: bool, number: u32) -> Option<CameraSetup> {
    read_camera(root, context, frame, number).map(|setup| CameraSetup { faces_cloth: frame, ..setup })
}

/// How a camera is told.
#[derive(Clone, Copy, PartialEq, Eq)]
enum CameraKind {
    /// From a direction, so that it sees all cloth.
    Frame,
    Perspective,
    Orthographic,
    /// One of a stage.
    Stage,
}

fn read_camera(root: &Reader<'_>, context: &Context<'_>, frame: bool, number: u32) -> Option<CameraSetup> {
    let Some(node) = root.node("camera") else { return Some(CameraSetup::default()) };
    if let Value::String(word) = &node.value {
        if word != "frame" {
            context.error(
                node.span,
                format!("unknown camera \"{word}\""),
                Some("camera = \"frame\", or a [camera] table".to_owned()),
            );
        }
        return Some(CameraSetup::default());
    }
    let table = root.table("camera")?;
    let kinds = [
        ("frame", CameraKind::Frame),
        ("perspective", CameraKind::Perspective),
        ("orthographic", CameraKind::Orthographic),
        ("usd", CameraKind::Stage),
    ];
    // Who says where it stands has no framing in mind.
    let stands = table.keys().any(|key| key == "position");
    let unsaid = if stands { CameraKind::Perspective } else { CameraKind::Frame };
    let Some(kind) = table.kind_or("type", unsaid, &kinds) else {
        table.finish();
        return None;
    };
    if kind == CameraKind::Stage {
        let setup = stage_camera::camera(&table, context, number);
        table.finish();
        return setup.map(|s| if frame { CameraSetup { margin: Some(defaults::MARGIN), aim: None, ..s } } else { s });
    }
    let up = DVec3::from(table.vec3_or("up", defaults::UP, Range::FINITE));
    let fov = |table: &Reader<'_>| {
        Projection::Perspective(radians(table.f64_or(
            "fov",
            defaults::FIELD_OF_VIEW,
            Range::above(0.0).and_below(180.0),
        )))
    };
    let plan = if kind == CameraKind::Frame {
        let direction = DVec3::from(table.vec3_or("direction", defaults::VIEW_FROM, Range::FINITE));
        let margin = table.f64_or("margin", defaults::MARGIN, Range::between(-5.0, 0.45));
        let flat = table.one_of_or("projection", false, &[("perspective", false), ("orthographic", true)]);
        let projection = if flat { Projection::Orthographic(1.0) } else { fov(&table) };
        let motion = motion::read(&table, context, None, projection);
        let setup = CameraSetup::framing(direction, up, projection);
        if setup.is_none() {
            table.error("`direction` and `up` of the camera must not be parallel or zero", None);
        }
        let lens = lens(&table, context, projection, Focus::Cloth);
        setup.map(|setup| CameraSetup { margin: Some(margin), lens, motion, ..setup })
    } else {
        let position = table.required_vec3("position", Range::PLACE);
        let target = table.vec3_or("target", [0.0; 3], Range::PLACE);
        let projection = if kind == CameraKind::Perspective {
            fov(&table)
        } else {
            Projection::Orthographic(table.required_f64("size", Range::POSITIVE).unwrap_or(1.0) * context.unit)
        };
        let aim = position.map(|p| Aim { position: context.position(p), target: context.position(target), up });
        let motion = motion::read(&table, context, aim.as_ref().filter(|_| !frame), projection);
        if aim.is_none() {
            // What its lens is sharp on is not known either.
            table.of_unknown_kind();
        }
        aim.and_then(|aim| {
            let setup = CameraSetup::aimed(aim, projection);
            if setup.is_none() {
                table.error_at("position", "`position` and `target` must differ, and not along `up`", None);
            }
            let focus = if frame { Focus::Cloth } else { Focus::Point(aim.target) };
            let lens = lens(&table, context, projection, focus);
            let setup = CameraSetup { lens, motion, ..setup? };
            // `--frame` keeps the directions only.
            Some(if frame { CameraSetup { margin: Some(defaults::MARGIN), aim: None, ..setup } } else { setup })
        })
    };
    table.finish();
    plan
}

/// The lens, if the camera has `aperture` or `f_number`; `otherwise` is sharp if the camera does not say.
fn lens(table: &Reader<'_>, context: &Context<'_>, projection: Projection, otherwise: Focus) -> Option<LensSetup> {
    let aperture = table.f64("aperture", Range::at_least(0.0)).map(|a| a * context.unit);
    let f_number = table.f64("f_number", Range::above(0.0));
    // A size in the world of cameras, whatever the scene's unit.
    let sensor = table.f64_or("sensor_height", defaults::SENSOR_HEIGHT, Range::POSITIVE);
    let distance = table.f64("focus_distance", Range::POSITIVE).map(|d| d * context.unit);
    let point = table.vec3("focus", Range::PLACE).map(|p| context.position(p));
    if aperture.is_some() && f_number.is_some() {
        table.error_at("f_number", "give `aperture` or `f_number`, not both", None);
    }
    if distance.is_some() && point.is_some() {
        table.error_at("focus_distance", "give `focus` or `focus_distance`, not both", None);
    }
    let diameter = match (aperture, f_number, projection) {
        (Some(aperture), _, _) => aperture,
        (None, Some(number), Projection::Perspective(angle)) => 0.5 * sensor / (0.5 * angle).tan() / number,
        (None, Some(_), Projection::Orthographic(_)) => {
            let hint = "give the opening's diameter: aperture = 4";
            table.error_at("f_number", "an orthographic camera has no focal length, hence no f-number", Some(hint));
            return None;
        }
        (None, None, _) => {
            if let Some(key) = ["focus", "focus_distance"].into_iter().find(|key| table.has(key)) {
                table.warning_at(key, format!("`{key}` does nothing without `aperture` or `f_number`"), None);
            }
            return None;
        }
    };
    let focus = distance.map(Focus::Distance).or(point.map(Focus::Point)).unwrap_or(otherwise);
    (diameter > 0.0).then_some(LensSetup { radius: 0.5 * diameter, focus })
}

/// What light may be.
const BRIGHT: Range = Range::at_least(0.0);

/// A light of a scene file, and the group that it is in.
pub(super) struct GroupedLight {
    pub(super) group: Option<String>,
    pub(super) light: LightPlan,
}

/// A light whose image is not read yet.
pub(super) enum LightPlan {
    Ready(Light),
    Image { path: PathBuf, span: Span, environment: Environment, rotation: Mat3A },
}

/// Reads every `[[light]]`. Where nothing is said of light, not even `light = []`, cloth and meshes have a sky and a sun.
pub(super) fn lights(root: &Reader<'_>, context: &Context<'_>) -> Vec<Option<GroupedLight>> {
    if !root.has("light") && (root.has("fabric") || root.has("mesh")) {
        let sky = Environment { radiance: Rgb::from(defaults::SKY), image: None, visible: true };
        let towards = DVec3::from(defaults::SUN_TOWARDS).normalize();
        let sun = sun(towards, radians(defaults::SUN_RADIUS), Rgb::from(defaults::SUN_IRRADIANCE));
        let plain = |light| Some(GroupedLight { group: None, light: LightPlan::Ready(light) });
        return [Light::Environment(sky), sun].map(plain).into();
    }
    let lights: Vec<Option<GroupedLight>> =
        root.tables("light").into_iter().map(|table| light(table, context)).collect();
    if LightGroups::new(lights.iter().flatten().map(|light| light.group.as_deref())).is_none() {
        let most = LightGroups::MOST;
        let hint = format!("lights without a `group` are one, `{}`", LightGroups::OTHERS);
        root.error_at("light", format!("expected at most {most} groups of lights"), Some(&hint));
    }
    lights
}

fn light(table: Reader<'_>, context: &Context<'_>) -> Option<GroupedLight> {
    type Read = fn(&Reader<'_>, &Context<'_>) -> Option<LightPlan>;
    let kinds: [(&str, Read); 7] = [
        ("environment", environment),
        ("distant", distant),
        ("point", point),
        ("spot", spot),
        ("rectangle", |table, context| area(table, rectangle(table, context), true)),
        ("disk", |table, context| area(table, disk(table, context), true)),
        ("sphere", |table, context| area(table, sphere(table, context), false)),
    ];
    let plan = table.kind("type", &kinds).and_then(|read| read(&table, context));
    let group = table.string("group").map(str::to_owned);
    let names_a_layer = |name: &String| !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    if let Some(name) = group.as_ref().filter(|name| !names_a_layer(name)) {
        let message = format!("`{}` names no layer: expected letters, digits and _", shortened(name));
        table.error_at("group", message, Some("group = \"key\""));
    }
    table.finish();
    plan.map(|light| GroupedLight { group, light })
}

fn environment(table: &Reader<'_>, context: &Context<'_>) -> Option<LightPlan> {
    let radiance = Rgb::from(table.rgb_or("radiance", [defaults::RADIANCE; 3], BRIGHT));
    let environment = Environment { radiance, image: None, visible: table.bool_or("visible", true) };
    let turn = radians(table.f64_or("rotate", 0.0, Range::FINITE).rem_euclid(360.0)) as f32;
    let Some(path) = table.string("image") else {
        return Some(LightPlan::Ready(Light::Environment(environment)));
    };
    let span = table.span("image").unwrap_or(table.header());
    let rotation = Mat3A::from_rotation_y(-turn);
    Some(LightPlan::Image { path: context.resolve(path, span), span, environment, rotation })
}

fn distant(table: &Reader<'_>, _: &Context<'_>) -> Option<LightPlan> {
    let towards = table.required_vec3("towards", Range::FINITE);
    let angle = radians(table.f64_or("angular_radius", 0.0, Range::between(0.0, 90.0)));
    let irradiance = Rgb::from(table.rgb_or("irradiance", [defaults::IRRADIANCE; 3], BRIGHT));
    let Some(unit) = DVec3::from(towards?).try_normalize() else {
        table.error_at("towards", "the direction towards a light cannot be zero", None);
        return None;
    };
    Some(LightPlan::Ready(sun(unit, angle, irradiance)))
}

/// A distant light in the direction of a unit vector, with an angular radius in radians.
fn sun(towards: DVec3, angle: f64, irradiance: Rgb) -> Light {
    // 1 - cos, without the cancellation of small angles.
    let one_minus_cos = (2.0 * (0.5 * angle).sin().powi(2)) as f32;
    // Rays exactly across a straight curve make Embree offer one hit hundreds of times; a tilt of a millionth,
    // far below any shadow's edge, does not.
    let tilted = (towards + 1e-6 * DVec3::new(0.57, 0.31, 0.76)).normalize();
    Light::Distant { towards: tilted.as_vec3a(), one_minus_cos, irradiance }
}

fn point(table: &Reader<'_>, context: &Context<'_>) -> Option<LightPlan> {
    let position = table.required_vec3("position", Range::PLACE);
    let intensity = intensity(table, context);
    Some(LightPlan::Ready(Light::Point { position: context.position(position?).as_vec3a(), intensity }))
}

fn spot(table: &Reader<'_>, context: &Context<'_>) -> Option<LightPlan> {
    let aim = aim(table, context);
    let intensity = intensity(table, context);
    let angle = table.f64_or("angle", defaults::SPOT_ANGLE, Range::above(0.0).and_at_most(180.0));
    let edge = table.f64_or("edge", defaults::SPOT_EDGE * angle, Range::at_least(0.0));
    if edge > angle {
        table.error_at("edge", format!("`edge` must be at most `angle`, {angle}"), None);
    }
    let (position, axis) = aim?;
    let cos = |degrees: f64| radians(degrees).cos() as f32;
    let (cos_inner, cos_outer) = (cos((angle - edge).max(0.0)), cos(angle));
    Some(LightPlan::Ready(Light::Spot { position, axis, intensity, cos_inner, cos_outer }))
}

/// A shape that shines; what is `flat` may do so to both sides.
fn area(table: &Reader<'_>, shape: Option<Shape>, flat: bool) -> Option<LightPlan> {
    let radiance = Rgb::from(table.rgb_or("radiance", [defaults::RADIANCE; 3], BRIGHT));
    let visible = table.bool_or("visible", true);
    let two_sided = flat && table.bool_or("two_sided", false);
    Some(LightPlan::Ready(Light::Area(AreaLight { shape: shape?, radiance, two_sided, visible })))
}

fn disk(table: &Reader<'_>, context: &Context<'_>) -> Option<Shape> {
    let aim = aim(table, context);
    let radius = radius(table, context);
    let (centre, normal) = aim?;
    Some(Shape::Disk { centre, normal, radius: radius? })
}

fn sphere(table: &Reader<'_>, context: &Context<'_>) -> Option<Shape> {
    let position = table.required_vec3("position", Range::PLACE);
    let radius = radius(table, context);
    Some(Shape::Sphere { centre: context.position(position?).as_vec3a(), radius: radius? })
}

/// Radius of a round light.
fn radius(table: &Reader<'_>, context: &Context<'_>) -> Option<f32> {
    table.required_f64("radius", Range::POSITIVE).map(|r| (r * context.unit) as f32)
}

/// Radiant intensity, which is per square of the scene's unit.
fn intensity(table: &Reader<'_>, context: &Context<'_>) -> Rgb {
    let intensity = table.rgb_or("intensity", [defaults::RADIANCE; 3], BRIGHT);
    Rgb::from(intensity.map(|i| i * context.unit * context.unit))
}

/// `position` and the unit vector from there to `target`.
fn aim(table: &Reader<'_>, context: &Context<'_>) -> Option<(Vec3A, Vec3A)> {
    let position = table.required_vec3("position", Range::PLACE);
    let target = context.position(table.vec3_or("target", [0.0; 3], Range::PLACE));
    let position = context.position(position?);
    let direction = (target - position).try_normalize();
    if direction.is_none() {
        table.error_at("position", "`position` and `target` of a light must differ", None);
    }
    direction.map(|d| (position.as_vec3a(), d.as_vec3a()))
}

/// A rectangle about `position` that faces `target`, its height along `up` as far as that is possible.
fn rectangle(table: &Reader<'_>, context: &Context<'_>) -> Option<Shape> {
    let aim = aim(table, context);
    let up = Vec3A::from(table.vec3_or("up", defaults::UP, Range::FINITE).map(|v| v as f32));
    if !table.has("size") {
        table.error("missing key `size` in the light: width and height", Some("size = [40, 20]"));
    }
    let size = table.vec2("size", Range::POSITIVE).map(|s| DVec2::from(s) * context.unit);
    let ((centre, normal), size) = aim.zip(size)?;
    let size = size.as_vec2();
    // One that looks straight up or down has no up of its own.
    let x = up.cross(normal).try_normalize().unwrap_or_else(|| orthonormal_basis(normal).0);
    let y = normal.cross(x);
    Some(Shape::Rectangle { corner: centre - 0.5 * (size.x * x + size.y * y), x, y, size })
}

impl LightPlan {
    /// Reads the image, if the light has one.
    pub(super) fn make(self, context: &Context<'_>) -> Option<Light> {
        let (path, span, environment, rotation) = match self {
            Self::Ready(light) => return Some(light),
            Self::Image { path, span, environment, rotation } => (path, span, environment, rotation),
        };
        let picture = match image::read(&path) {
            Ok(picture) => picture,
            Err(error) => {
                context.error(span, error.to_string(), None);
                return None;
            }
        };
        let Some(planes) = picture.rgb() else {
            context.error(span, format!("{}: no colour channels", path.display()), None);
            return None;
        };
        let map = EnvironmentMap::new(picture.width, picture.height, image::interleaved(planes), rotation);
        Some(Light::Environment(Environment { image: Some(Arc::new(map)), ..environment }))
    }
}

/// A floor before the cloth is known.
pub(super) struct GroundPlan {
    /// In scene units; `None` for right below the cloth.
    height: Option<f64>,
    material: MaterialPlan,
}

impl GroundPlan {
    /// Reads what its material names.
    pub(super) fn make(
        self,
        context: &Context<'_>,
        materials: &mut Vec<(MaterialPlan, Material)>,
    ) -> Option<GroundSetup> {
        if let Some(span) = self.material.texture_span() {
            context.error(span, "the ground has no texture coordinates: give this material to a plane", None);
        }
        let material = self.material.make(context, materials)?;
        Some(GroundSetup { height: self.height.map(|h| h * context.unit), material })
    }
}

/// Reads `[ground]`.
pub(super) fn ground(root: &Reader<'_>, context: &Context<'_>, materials: &Materials) -> Option<GroundPlan> {
    let table = root.table("ground")?;
    let auto = match table.node("height") {
        None => true,
        Some(node) => match &node.value {
            Value::String(word) if word == "auto" => true,
            Value::String(word) => {
                context.error(
                    node.span,
                    format!("unknown height \"{word}\""),
                    Some("a number, or \"auto\" for right below the cloth".to_owned()),
                );
                true
            }
            _ => false,
        },
    };
    let height = if auto { None } else { table.f64("height", Range::FINITE) };
    let material = material_of(&table, context, materials);
    table.finish();
    Some(GroundPlan { height, material: material? })
}
