//! Brings features into a scene that does not need them, without changing what its picture shows: to measure what
//! leaving them out saves, and to prove that nothing is lost by it.

use std::sync::Arc;

use glam::{DVec3, Mat3A, Vec3A};

use super::{Material, Object, Scene, Yarn, camera::Lens};
use crate::{
    geometry::{fiber::flyaway::Flyaways, mesh::Mesh},
    light::{AreaLight, EnvironmentMap, Light, Shape},
    math::Rgb,
    scattering::surface::SurfaceMaterial,
};

/// Light that shines on nothing anybody could see, but that shadow rays look for.
const FAINT: f32 = 1e-30;

/// Names of features that can be forced, as the plan of a render has them.
pub(crate) const FORCEABLE: [&str; 22] = [
    "ply_filter",
    "elliptical_plies",
    "ply_twist",
    "all_lobes",
    "flyaways",
    "uneven_yarns",
    "environment_image",
    "distant_light",
    "point_light",
    "area_lights",
    "depth_of_field",
    "meshes",
    "lobe_layers",
    "depth_layer",
    "normal_layer",
    "albedo_layer",
    "cryptomatte",
    "variance_layer",
    "sample_layer",
    "position_layer",
    "motion_layer",
    "uv_layer",
];

/// Makes the scene need a feature. Does nothing where it needs it already.
///
/// # Errors
/// The feature cannot be forced.
pub(crate) fn force(scene: &mut Scene, name: &str) -> Result<(), String> {
    if force_layer(scene, name) || force_of_yarns(&mut scene.yarns, name) || force_around(scene, name) {
        return Ok(());
    }
    Err(format!("`{name}` cannot be forced; these can: {}", FORCEABLE.join(", ")))
}

/// A layer of the picture; whether the name is one's.
fn force_layer(scene: &mut Scene, name: &str) -> bool {
    let layers = &mut scene.layers;
    let layer = match name {
        "lobe_layers" => &mut layers.lobes,
        "depth_layer" => &mut layers.depth,
        "normal_layer" => &mut layers.normal,
        "albedo_layer" => &mut layers.albedo,
        "cryptomatte" => &mut layers.cryptomatte,
        "variance_layer" => &mut layers.variance,
        "sample_layer" => &mut layers.samples,
        "position_layer" => &mut layers.position,
        "uv_layer" => &mut layers.uv,
        "motion_layer" => {
            // Cloth whose next frame was not read stands still.
            scene.camera_flow.get_or_insert([scene.camera; 2]);
            &mut layers.motion
        }
        _ => return false,
    };
    *layer = true;
    true
}

/// A feature of yarns and fibres; whether the name is one's.
fn force_of_yarns(yarns: &mut [Yarn], name: &str) -> bool {
    match name {
        // A hair's breadth between the ply and the yarn's outline: rays have to be asked.
        "ply_filter" => {
            for ply in yarns.iter_mut().flat_map(|y| &mut y.plies) {
                ply.radius = ply.radius.min(1.0 - 1e-7);
            }
        }
        "elliptical_plies" => {
            for ply in yarns.iter_mut().flat_map(|y| &mut y.plies) {
                ply.aspect = ply.aspect.min(1.0 - 2e-6);
            }
        }
        "ply_twist" => {
            for yarn in yarns.iter_mut().filter(|y| y.ply_twist == 0.0) {
                yarn.ply_twist = 1e-9;
            }
        }
        "all_lobes" => {
            for (_, fiber) in yarns.iter_mut().flat_map(|y| &mut y.fibers) {
                for albedo in [&mut fiber.r, &mut fiber.tt, &mut fiber.d] {
                    if albedo.iter().all(|a| *a == 0.0) {
                        *albedo = [1e-12; 3];
                    }
                }
            }
        }
        "flyaways" => {
            let none = Flyaways {
                hair_density: 0.0,
                hair_start: [0.0; 2],
                hair_rise: [0.0; 2],
                hair_length: [0.0; 2],
                hair_turn: [0.0; 2],
                loop_density: 0.0,
                loop_height: [0.0; 2],
                loop_turns: 1.0,
            };
            for yarn in yarns {
                yarn.flyaways.get_or_insert(none);
            }
        }
        "uneven_yarns" => yarns.iter_mut().for_each(|yarn| yarn.unevenness = yarn.unevenness.max(1e-30)),
        _ => return false,
    }
    true
}

/// A light, a lens or a mesh; whether the name is one's.
fn force_around(scene: &mut Scene, name: &str) -> bool {
    match name {
        "environment_image" => {
            for light in &mut scene.lights {
                if let Light::Environment(sky) = light {
                    let even = || Arc::new(EnvironmentMap::new(64, 32, vec![[1.0; 3]; 64 * 32], Mat3A::IDENTITY));
                    sky.image.get_or_insert_with(even);
                }
            }
        }
        "distant_light" => {
            let towards = Vec3A::new(0.3, 0.8, 0.52).normalize();
            scene.lights.push(Light::Distant { towards, one_minus_cos: 0.0, irradiance: Rgb::splat(FAINT) });
        }
        "point_light" => {
            let position = Vec3A::from(far_corner(scene).as_vec3());
            scene.lights.push(Light::Point { position, intensity: Rgb::splat(FAINT) });
        }
        "area_lights" => {
            let centre = far_corner(scene).as_vec3a();
            let radius = 1e-3 * centre.length();
            let shape = Shape::Sphere { centre, radius };
            let light = AreaLight { shape, radiance: Rgb::splat(FAINT), two_sided: false, visible: false };
            scene.lights.push(Light::Area(light));
        }
        // An opening of a billionth of the distance: no circle of confusion reaches a pixel.
        "depth_of_field" => {
            let focus = scene.camera.position.length().max(1.0);
            scene.camera.lens.get_or_insert(Lens { radius: 1e-9 * focus, focus });
        }
        // A speck outside of the cloth's box.
        "meshes" => {
            let at = far_corner(scene);
            let mut mesh = Mesh::plane(glam::DVec2::splat(1e-7 * at.length()));
            for p in &mut mesh.points {
                *p += at;
            }
            scene.materials.push(Material {
                surface: SurfaceMaterial::diffuse(Rgb::ZERO),
                texture: None,
                holdout: false,
            });
            let material = scene.materials.len() - 1;
            scene.objects.push(Object {
                name: "forced".to_owned(),
                origin: "forced".to_owned(),
                mesh,
                material,
                next: Vec::new(),
            });
        }
        _ => return false,
    }
    true
}

/// A place outside of the cloth, seen from its middle.
fn far_corner(scene: &Scene) -> DVec3 {
    let (low, high) = scene.bounds().unwrap_or((-DVec3::ONE, DVec3::ONE));
    high + 0.6 * (high - low)
}
