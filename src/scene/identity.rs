//! What makes a picture the one it is: every key that changes it, with its value.
//!
//! Two scenes with the same identity render the same picture, sample by sample: checkpoints and parts of a render carry
//! it, so that they are continued and put together with their like only, and so that a difference has a name.

use std::fmt::{Debug, Write as _};

use super::{CurveKind, Fabric, Object, Scene};
use crate::light::{Environment, Light};

/// Values longer than this are told by their hash.
const LONGEST_VALUE: usize = 120;

/// Keys and values, in a fixed order: not of samples, time, threads or outputs. Keys are those of scene files where
/// they have one.
pub fn identity(scene: &Scene) -> Vec<(String, String)> {
    let mut out = Vec::new();
    let mut add = |key: String, value: &dyn Debug| {
        let text = format!("{value:?}");
        out.push((key, if text.len() > LONGEST_VALUE { hashed(text.as_bytes()) } else { text }));
    };
    let r = &scene.render;
    let mut setting = |name: &str, value: &dyn Debug| add(format!("render.{name}"), value);
    setting("mode", &r.mode.name());
    setting("model", &r.model.name());
    setting("width", &r.width);
    setting("height", &r.height);
    setting("crop", &r.crop);
    setting("filter", &r.filter);
    setting("max_bounces", &r.max_bounces);
    setting("seed", &r.seed);
    setting("frame", &r.frame);
    setting("adaptive", &r.adaptive);
    let camera = &scene.camera;
    add("camera.shutter".to_owned(), &scene.camera_path);
    add("camera.position".to_owned(), &camera.position);
    add("camera.direction".to_owned(), &[camera.right, camera.up, camera.back]);
    add("camera".to_owned(), camera);
    for yarn in &scene.yarns {
        let mut of_yarn = |name: &str, value: &dyn Debug| add(format!("yarn.{}.{name}", yarn.name), value);
        of_yarn("radius", &yarn.radius);
        of_yarn("ply", &yarn.plies);
        of_yarn("ply_twist", &yarn.ply_twist);
        of_yarn("fiber", &yarn.fibers.iter().map(|(name, _)| name).collect::<Vec<_>>());
        let mut fibers: Vec<_> = yarn.fibers.iter().collect();
        fibers.dedup_by_key(|(name, _)| name.clone());
        add(format!("yarn.{}", yarn.name), yarn);
        for (name, material) in fibers {
            add(format!("fiber.{name}"), material);
        }
    }
    for (name, material) in &scene.fibers {
        add(format!("fiber.{name}"), material);
    }
    for (i, fabric) in scene.fabrics.iter().enumerate() {
        let mut of_fabric = |name: &str, value: &dyn Debug| add(format!("fabric.{i}.{name}"), value);
        match fabric.kind {
            CurveKind::Yarn(i) => of_fabric("yarn", &scene.yarns[i].name),
            CurveKind::Fiber(i) => of_fabric("fiber", &scene.fibers[i].0),
        }
        of_fabric("phase", &fabric.phases);
        of_fabric("seed", &fabric.seed);
        if !fabric.variants.is_empty() {
            of_fabric("colors", &(&fabric.variants, &fabric.material_indices));
        }
        of_fabric("curves", &curves(fabric));
        of_fabric("shutter", &fabric.motion);
        of_fabric("curve_basis", &fabric.basis);
        of_fabric("curve_tolerance", &(fabric.tolerance, fabric.longest_segment));
    }
    for (i, light) in scene.lights.iter().enumerate() {
        match light {
            Light::Environment(Environment { radiance, image: Some(map), visible }) => {
                let pixels: Vec<u8> = map.pixels().as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
                add(format!("light.{i}"), &(radiance, visible, map.rotation(), hashed(&pixels)));
            }
            _ => add(format!("light.{i}"), light),
        }
    }
    for (i, material) in scene.materials.iter().enumerate() {
        // A texture by some of its colours: whoever changes a picture changes its mean, or one of many places.
        let texture = material.texture.as_ref().map(|t| {
            let colors =
                (0..4096).map(|i| t.texture.sample((i % 64) as f32 / 64.0, (i / 64) as f32 / 64.0, 1.0 / 64.0));
            let bytes: Vec<u8> = colors.flatten().flat_map(f32::to_le_bytes).collect();
            (t.repeat, t.texture.size(), hashed(&bytes))
        });
        add(format!("material.{i}"), &(&material.surface, texture));
    }
    for (i, object) in scene.objects.iter().enumerate() {
        add(format!("mesh.{i}"), &(object.material, triangles(object)));
    }
    add("ground".to_owned(), &scene.ground);
    out
}

/// One word for an identity.
pub fn fingerprint(identity: &[(String, String)]) -> String {
    let mut text = String::new();
    for (key, value) in identity {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{key}={value}");
    }
    hashed(text.as_bytes())
}

/// Keys whose values differ, or that only one has: "render.seed: 1 there, 2 here", one for each. A table is left out
/// where one of its own keys tells more.
pub fn differences(there: &[(String, String)], here: &[(String, String)]) -> Vec<String> {
    let find = |of: &[(String, String)], key: &str| of.iter().find(|(k, _)| k == key).map(|(_, value)| value.clone());
    let mut differing: Vec<(&String, Option<String>, Option<String>)> = Vec::new();
    for (key, _) in there.iter().chain(here) {
        let values = (find(there, key), find(here, key));
        if values.0 != values.1 && !differing.iter().any(|(k, ..)| *k == key) {
            differing.push((key, values.0, values.1));
        }
    }
    let tells_less = |table: &str| differing.iter().any(|(key, ..)| key.starts_with(&format!("{table}.")));
    let word = |value: &Option<String>| value.clone().unwrap_or_else(|| "nothing".to_owned());
    differing
        .iter()
        .filter(|(key, ..)| !tells_less(key))
        .map(|(key, there, here)| format!("{key}: {} there, {} here", word(there), word(here)))
        .collect()
}

/// A hash of curves and their radii.
fn curves(fabric: &Fabric) -> String {
    let mut bytes = Vec::new();
    for (curve, radii) in &fabric.curves {
        bytes.extend(format!("{:?} {} {}", curve.basis, curve.closed, radii.len()).into_bytes());
        for (p, r) in curve.points.iter().zip(radii) {
            bytes.extend([p.x, p.y, p.z, *r].map(f64::to_le_bytes).as_flattened());
        }
    }
    hashed(&bytes)
}

/// A hash of a mesh.
fn triangles(object: &Object) -> String {
    let mesh = &object.mesh;
    let mut bytes = format!("{} {}", mesh.normals.len(), mesh.uvs.len()).into_bytes();
    let vectors = mesh.points.iter().chain(&mesh.normals).flat_map(|p| p.to_array());
    bytes.extend(vectors.chain(mesh.uvs.iter().flat_map(|uv| uv.to_array())).flat_map(f64::to_le_bytes));
    bytes.extend(mesh.triangles.as_flattened().iter().flat_map(|i| i.to_le_bytes()));
    hashed(&bytes)
}

/// FNV-1a.
fn hashed(bytes: &[u8]) -> String {
    let mix = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
    format!("{:016x}", bytes.iter().fold(0xcbf2_9ce4_8422_2325, mix))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_have_names() {
        let list = |pairs: &[(&str, &str)]| -> Vec<(String, String)> {
            pairs.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect()
        };
        let there = list(&[("render.seed", "1"), ("camera", "a"), ("light.1", "sun"), ("light", "s")]);
        let here = list(&[("render.seed", "2"), ("camera", "a"), ("ground", "flat"), ("light", "t")]);
        assert_eq!(
            differences(&there, &here),
            ["render.seed: 1 there, 2 here", "light.1: sun there, nothing here", "ground: nothing there, flat here"]
        );
        assert!(differences(&here, &here).is_empty());
        assert_ne!(fingerprint(&there), fingerprint(&here));
    }
}
