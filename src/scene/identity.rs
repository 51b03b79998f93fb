//! What makes a picture the one it is: every key that changes it, with its value.
//!
//! Two scenes with the same identity render the same picture, sample by sample: checkpoints and parts of a render carry
//! it, so that they are continued and put together with their like only, and so that a difference has a name.

use std::fmt::{Debug, Write as _};

use glam::{DVec2, DVec3, Vec2};
use rayon::prelude::*;
use twox_hash::XxHash3_128;

use super::{AlbedoTexture, Camera, CurveKind, Fabric, FabricMotion, Material, Object, RenderSettings, Scene, Yarn};
use crate::{
    geometry::{curve::Curve, density::KnownPacking, mesh::Mesh},
    light::{Environment, Light},
};

/// Values longer than this are told by their hash.
const LONGEST_VALUE: usize = 120;

/// Keys and values, in a fixed order: not of samples, time, threads or outputs. Keys are those of scene files where
/// they have one.
///
/// Every structure is taken apart field by field: a new field does not compile before it has its place here.
pub(crate) fn identity(scene: &Scene) -> Vec<(String, String)> {
    let Scene {
        path: _,
        render,
        // How the picture is shown and stored, and which layers are beside it.
        display: _,
        layers: _,
        light_groups: _,
        storage: _,
        axes: _,
        denoise: _,
        camera,
        camera_path,
        camera_flow,
        frames_per_second: _,
        yarns,
        fibers,
        fabrics,
        objects,
        materials,
        lights,
        ground,
        middle,
        identity: _,
        fingerprint: _,
        // Facts about fabrics, which are here themselves.
        garments: _,
        warnings: _,
    } = scene;
    let mut keys = Keys::default();
    of_settings(render, &mut keys);
    let Camera { position, right, up, back, projection, lens, shift } = camera;
    keys.add("camera.shutter", camera_path);
    if let Some(flow) = camera_flow {
        keys.add("camera.flow", flow);
    }
    keys.add("camera.position", position);
    keys.add("camera.direction", &[right, up, back]);
    keys.add("camera.projection", projection);
    keys.add("camera.lens", lens);
    if *shift != DVec2::ZERO {
        keys.add("camera.shift", shift);
    }
    for yarn in yarns {
        of_yarn(yarn, &mut keys);
    }
    for (name, material) in fibers {
        keys.add(&format!("fiber.{name}"), material);
    }
    for (i, fabric) in fabrics.iter().enumerate() {
        of_fabric(fabric, scene, &format!("fabric.{i}"), &mut keys);
    }
    for (i, light) in lights.iter().enumerate() {
        of_light(light, &format!("light.{i}"), &mut keys);
    }
    for (i, Material { surface, texture, holdout }) in materials.iter().enumerate() {
        let texture =
            texture.as_ref().map(|AlbedoTexture { texture, repeat }| (texture.size(), texture.hash(), repeat));
        keys.add(&format!("material.{i}"), &(surface, texture));
        if *holdout {
            keys.add(&format!("material.{i}.holdout"), holdout);
        }
    }
    for (i, Object { name: _, origin: _, mesh, material, next }) in objects.iter().enumerate() {
        let Mesh { points, normals, uvs, triangles } = mesh;
        let mut hash = Hash::default();
        points.iter().chain(normals).for_each(|p| hash.numbers(&p.to_array()));
        uvs.iter().for_each(|uv| hash.numbers(&uv.to_array()));
        triangles.iter().flatten().for_each(|i| hash.bytes(&i.to_le_bytes()));
        let lengths = [points.len(), normals.len(), uvs.len(), triangles.len()];
        keys.add(&format!("mesh.{i}"), &(material, lengths, hash.word()));
        if !next.is_empty() {
            let mut hash = Hash::default();
            next.iter().for_each(|p| hash.numbers(&p.to_array()));
            keys.add(&format!("mesh.{i}.next"), &hash.word());
        }
    }
    keys.add("ground", ground);
    keys.add("middle", middle);
    keys.0
}

/// Keys with their values, long ones by their hash.
#[derive(Default)]
struct Keys(Vec<(String, String)>);

impl Keys {
    fn add(&mut self, key: &str, value: &dyn Debug) {
        let text = format!("{value:?}");
        let shown = plain(&text);
        self.0.push((key.to_owned(), if shown.len() > LONGEST_VALUE { hashed(text.as_bytes()) } else { shown }));
    }
}

/// What Rust prints for its programmers, for readers: `Some(3)` is 3, `None` none, `Vec3A(0.0, 1.0, 0.0)` an array,
/// `Gaussian(0.5)` gaussian (0.5), text without quotes. Nothing that tells two values apart is lost.
fn plain(debug: &str) -> String {
    let mut out = String::with_capacity(debug.len());
    // What closes each open bracket.
    let mut closing: Vec<&str> = Vec::new();
    let mut rest = debug;
    while let Some(c) = rest.chars().next() {
        let word = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        let is_name = c.is_alphabetic() && word > 0;
        if is_name {
            let (name, after) = rest.split_at(word);
            let is_vector = ["Vec", "DVec", "Rgb", "Mat3A", "f32x4"].iter().any(|v| name.starts_with(v));
            rest = after;
            match (name, after.starts_with('(')) {
                ("Some", true) => {
                    closing.push("");
                    rest = &after[1..];
                }
                (_, true) if is_vector => {
                    out.push('[');
                    closing.push("]");
                    rest = &after[1..];
                }
                (_, true) => {
                    out += &format!("{} (", name.to_lowercase());
                    closing.push(")");
                    rest = &after[1..];
                }
                _ => out += &name.to_lowercase(),
            }
            continue;
        }
        rest = &rest[c.len_utf8()..];
        match c {
            '(' | '[' | '{' => {
                out.push(c);
                closing.push(match c {
                    '(' => ")",
                    '[' => "]",
                    _ => "}",
                });
            }
            ')' | ']' | '}' => out += closing.pop().unwrap_or_default(),
            '"' => {
                // A name stays as it is written.
                let end = rest.find('"').unwrap_or(rest.len());
                out += &rest[..end];
                rest = rest.get(end + 1..).unwrap_or_default();
            }
            _ => out.push(c),
        }
    }
    out
}

fn of_settings(render: &RenderSettings, keys: &mut Keys) {
    let RenderSettings {
        mode,
        model,
        without,
        width,
        height,
        crop,
        filter,
        // When to stop: samples are the same however many are taken.
        spp: _,
        time: _,
        noise: _,
        adaptive,
        max_bounces,
        threads: _,
        seed,
        frame,
        fiber_detail,
        compact_bvh,
        max_memory: _,
        force,
    } = render;
    let mut setting = |name: &str, value: &dyn Debug| keys.add(&format!("render.{name}"), value);
    setting("mode", &mode.name());
    setting("model", &model.name());
    setting("without", without);
    setting("width", width);
    setting("height", height);
    setting("crop", crop);
    setting("filter", filter);
    setting("adaptive", adaptive);
    setting("max_bounces", max_bounces);
    setting("seed", seed);
    setting("frame", frame);
    setting("fiber_detail", fiber_detail);
    setting("bvh", &if *compact_bvh { "compact" } else { "fast" });
    setting("force", force);
}

fn of_yarn(yarn: &Yarn, keys: &mut Keys) {
    let Yarn { name, radius, plies, ply_twist, fibers, placement, known_packing, flyaways, unevenness, tex: _, tilted } =
        yarn;
    let mut key = |key: &str, value: &dyn Debug| keys.add(&format!("yarn.{name}.{key}"), value);
    key("radius", radius);
    key("ply", plies);
    key("ply_twist", ply_twist);
    key("fiber", &fibers.iter().map(|(name, _)| name).collect::<Vec<_>>());
    key("packing", placement);
    let KnownPacking { crowding, regularity } = known_packing;
    key("crowding", crowding);
    key("regularity", regularity);
    key("flyaways", flyaways);
    key("unevenness", unevenness);
    key("ply_intersection", &if *tilted { "tilted" } else { "perpendicular" });
    let mut different: Vec<_> = fibers.iter().collect();
    different.dedup_by_key(|(name, _)| name);
    for (name, material) in different {
        keys.add(&format!("fiber.{name}"), material);
    }
}

fn of_fabric(fabric: &Fabric, scene: &Scene, path: &str, keys: &mut Keys) {
    let Fabric {
        // Names are for messages and mattes: what covers a pixel is counted by number.
        name: _,
        named: _,
        origin: _,
        panels: _,
        from_file: _,
        // They are among the curves.
        tufts: _,
        kind,
        curves,
        motion,
        variants,
        material_indices,
        printed,
        uvs,
        taken: _,
        phases,
        // It follows from the rest.
        shows_fibers: _,
        seed,
        basis,
        tolerance,
        longest_segment,
    } = fabric;
    let mut key = |key: &str, value: &dyn Debug| keys.add(&format!("{path}.{key}"), value);
    match *kind {
        CurveKind::Yarn(i) => key("yarn", &scene.yarns[i].name),
        CurveKind::Fiber(i) => key("fiber", &scene.fibers[i].0),
    }
    key("phase", phases);
    key("seed", seed);
    if !variants.is_empty() {
        let of_curve = |indices: &Vec<u16>| {
            let mut hash = Hash::default();
            indices.iter().for_each(|index| hash.bytes(&index.to_le_bytes()));
            hash
        };
        key("colors", &(variants, printed, in_order(material_indices.par_iter().map(of_curve))));
    }
    let of_curve = |(Curve { basis, closed, points, radii: _, flattening }, radii): &(Curve, Vec<f64>)| {
        let mut hash = Hash::default();
        let pressed = flattening.as_ref().map(Vec::len);
        hash.bytes(format!("{basis:?} {closed} {} {} {pressed:?}", points.len(), radii.len()).as_bytes());
        flattening.iter().flatten().for_each(|v| hash.numbers(&v.as_dvec3().to_array()));
        points.iter().for_each(|p| hash.numbers(&p.to_array()));
        hash.numbers(radii);
        hash
    };
    key("curves", &in_order(curves.par_iter().map(of_curve)));
    if !uvs.is_empty() {
        let of_curve = |uvs: &Vec<Vec2>| {
            let mut hash = Hash::default();
            uvs.iter().for_each(|uv| hash.numbers(&uv.as_dvec2().to_array()));
            hash
        };
        key("uv", &in_order(uvs.par_iter().map(of_curve)));
    }
    let FabricMotion { later, rest, flow } = motion;
    let of_points = |points: &Vec<DVec3>| {
        let mut hash = Hash::default();
        hash.bytes(&points.len().to_le_bytes());
        points.iter().for_each(|p| hash.numbers(&p.to_array()));
        hash
    };
    if !flow.is_empty() {
        let poses: Vec<&Vec<DVec3>> = flow.iter().flatten().collect();
        key("flow", &in_order(poses.into_par_iter().map(of_points)));
    }
    if !later.is_empty() || rest.is_some() {
        let poses: Vec<&Vec<DVec3>> = later.iter().flatten().chain(rest.iter().flatten()).collect();
        key("shutter", &(later.len(), rest.is_some(), in_order(poses.into_par_iter().map(of_points))));
    }
    key("curve_basis", basis);
    key("curve_tolerance", &(tolerance, longest_segment));
}

fn of_light(light: &Light, path: &str, keys: &mut Keys) {
    match light {
        Light::Environment(Environment { radiance, image: Some(map), visible }) => {
            let mut hash = Hash::default();
            map.pixels().as_flattened().iter().for_each(|v| hash.bytes(&v.to_le_bytes()));
            keys.add(path, &(radiance, visible, map.rotation(), map.pixels().len(), hash.word()));
        }
        // Written out by what they derive: all of their fields.
        Light::Environment(_) | Light::Distant { .. } | Light::Point { .. } | Light::Spot { .. } | Light::Area(_) => {
            keys.add(path, light)
        }
    }
}

/// One word for an identity.
pub(crate) fn fingerprint(identity: &[(String, String)]) -> String {
    let mut text = String::new();
    for (key, value) in identity {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{key}={value}");
    }
    hashed(text.as_bytes())
}

/// Keys whose values differ, or that only one has, each in words with what the two are called: "render.seed: 1 there, 2
/// here". A table is left out where one of its own keys tells more.
pub(crate) fn differences(there: &[(String, String)], here: &[(String, String)], [a, b]: [&str; 2]) -> Vec<String> {
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
        .map(|(key, there, here)| format!("{key}: {} {a}, {} {b}", word(there), word(here)))
        .collect()
}

/// XXH3 of 128 bits, fed piece by piece.
#[derive(Default)]
struct Hash(XxHash3_128);

impl Hash {
    fn bytes(&mut self, bytes: &[u8]) {
        self.0.write(bytes);
    }

    fn numbers(&mut self, numbers: &[f64]) {
        numbers.iter().for_each(|v| self.0.write(&v.to_le_bytes()));
    }

    fn word(&self) -> String {
        format!("{:032x}", self.0.finish_128())
    }
}

/// One word for hashes in order, each made on any core.
fn in_order(hashes: impl IndexedParallelIterator<Item = Hash>) -> String {
    let hashes: Vec<u128> = hashes.map(|hash| hash.0.finish_128()).collect();
    let mut all = Hash::default();
    hashes.iter().for_each(|hash| all.bytes(&hash.to_le_bytes()));
    all.word()
}

/// A word for bytes that is the same in every build: XXH3 of 128 bits.
pub(crate) fn hashed(bytes: &[u8]) -> String {
    format!("{:032x}", XxHash3_128::oneshot(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_plain_words() {
        for (debug, words) in [
            ("Some(3)", "3"),
            ("None", "none"),
            ("Gaussian(0.5)", "gaussian (0.5)"),
            ("\"Wool\"", "Wool"),
            ("[Some(Vec3A(0.0, 1.0, -2.5)), None]", "[[0.0, 1.0, -2.5], none]"),
            (
                "Distant { towards: Vec3A(0.0, 1.0, 0.0), one_minus_cos: 1e-5 }",
                "distant { towards: [0.0, 1.0, 0.0], one_minus_cos: 1e-5 }",
            ),
            ("Perspective(0.43), [1, 2]", "perspective (0.43), [1, 2]"),
        ] {
            assert_eq!(plain(debug), words);
        }
    }

    #[test]
    fn differences_have_names() {
        let list = |pairs: &[(&str, &str)]| -> Vec<(String, String)> {
            pairs.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect()
        };
        let there = list(&[("render.seed", "1"), ("camera", "a"), ("light.1", "sun"), ("light", "s")]);
        let here = list(&[("render.seed", "2"), ("camera", "a"), ("ground", "flat"), ("light", "t")]);
        assert_eq!(
            differences(&there, &here, ["there", "here"]),
            ["render.seed: 1 there, 2 here", "light.1: sun there, nothing here", "ground: nothing there, flat here"]
        );
        assert!(differences(&here, &here, ["there", "here"]).is_empty());
        assert_ne!(fingerprint(&there), fingerprint(&here));
    }
}
