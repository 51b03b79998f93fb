//! What a render needs and what it leaves out, told from the checked scene before anything is built.
//!
//! What is left out is not computed, allocated or loaded; [`crate::scene::force`] brings it back, to measure what that saves.

mod memory;

pub use memory::{Memory, TooLarge};

use crate::{
    film::Tile,
    light::Light,
    scene::{CurveKind, Fabric, Layers, Mode, Scene},
};

/// One feature of the renderer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Feature {
    /// Stable name, as in `--stats`.
    pub name: &'static str,
    /// Whether the scene needs it.
    pub used: bool,
    /// Why, in words.
    pub reason: &'static str,
    /// Bytes that leaving it out saves, or that using it takes, where that is known before the render.
    pub bytes: Option<u64>,
}

/// Every feature, used or left out.
#[derive(Clone, Debug)]
pub struct Plan {
    /// In a fixed order.
    pub features: Vec<Feature>,
}

impl Plan {
    /// Decides for a scene.
    pub fn new(scene: &Scene) -> Self {
        let shapes: Vec<_> = scene.yarns.iter().map(super::scene::Yarn::shape).collect();
        let any_light = |test: &dyn Fn(&Light) -> bool| scene.lights.iter().any(test);
        let image = |l: &Light| matches!(l, Light::Environment(e) if e.image.is_some());
        let area = |l: &Light| matches!(l, Light::Area(_));
        let mut features = Vec::new();
        let mut add = |name, used, yes, no| {
            features.push(Feature { name, used, reason: if used { yes } else { no }, bytes: None });
        };
        let of_yarns = |mode: &dyn Fn(Mode) -> bool| {
            mode(scene.render.mode) && scene.fabrics.iter().any(|f| matches!(f.kind, CurveKind::Yarn(_)))
        };
        add(
            "aggregated_yarns",
            of_yarns(&|m| m != Mode::Fiber),
            "a model answers for the fibres in yarns or plies",
            "no yarn is aggregated",
        );
        add(
            "fiber_generation",
            of_yarns(&|m| m == Mode::Fiber),
            "every fibre of the yarns is a curve",
            "fibres in yarns are found analytically",
        );
        add(
            "flyaways",
            scene.yarns.iter().any(|y| y.flyaways.is_some()),
            "a yarn has fly-aways",
            "no yarn has fly-aways",
        );
        add("exit_rejection", !scene.fabrics.is_empty(), "Embree offers hits from inside of curves", "no curves");
        add(
            "all_lobes",
            scene
                .yarns
                .iter()
                .flat_map(|y| &y.fibers)
                .all(|(_, f)| [f.r, f.tt, f.d].iter().all(|albedo| albedo.iter().any(|a| *a > 0.0))),
            "every fibre has all of R, TT and D",
            "lobes of albedo 0 are neither evaluated nor sampled",
        );
        add(
            "ply_materials",
            scene.yarns.iter().any(|y| y.fibers.windows(2).any(|w| w[0].1 != w[1].1)),
            "plies of a yarn are of different fibres",
            "all plies of a yarn are of the same fibre",
        );
        add("ply_filter", shapes.iter().any(|s| !s.filled), "plies leave gaps", "plies fill the yarn");
        add(
            "flattening",
            scene.fabrics.iter().any(Fabric::is_pressed),
            "a yarn is pressed flat",
            "all yarns are round",
        );
        add("elliptical_plies", shapes.iter().any(|s| s.elliptical), "a ply is elliptical", "all plies are round");
        add(
            "ply_twist",
            shapes.iter().any(|s| s.ply_rate != 0.0),
            "plies wind around the yarn",
            "plies run along the yarn",
        );
        add(
            "tilted_plies",
            shapes.iter().any(|s| s.tilted),
            "rays follow plies along the yarn",
            "the section is perpendicular",
        );
        add("depth_of_field", scene.camera.lens.is_some(), "the camera has a lens", "the camera is a pinhole");
        add("environment", any_light(&|l| matches!(l, Light::Environment(_))), "the sky shines", "no sky");
        add("environment_image", any_light(&image), "the sky has an image", "no light has an image");
        add(
            "distant_light",
            any_light(&|l| matches!(l, Light::Distant { .. })),
            "a light is far away",
            "no distant light",
        );
        add("point_light", any_light(&|l| matches!(l, Light::Point { .. })), "a light is a point", "no point light");
        add("spot_light", any_light(&|l| matches!(l, Light::Spot { .. })), "a light is a spot", "no spot light");
        add("area_lights", any_light(&area), "a light is a surface", "no light is a surface");
        add(
            "light_choice",
            scene.lights.iter().filter(|l| l.needs_shadow_rays()).count() > 1,
            "each place chooses a light by what it can give there",
            "no more than one light is sampled",
        );
        add(
            "shadow_rays",
            any_light(&Light::needs_shadow_rays),
            "a light is sampled",
            "every light is found by sampled directions",
        );
        add(
            "mis",
            any_light(&|l| image(l) || area(l)),
            "a light is sampled in two ways",
            "each light is found in one way only",
        );
        add("ground", scene.ground.is_some(), "there is a floor", "no floor");
        add("albedo_layer", scene.layers.albedo, "asked for", "no output holds it");
        add("cryptomatte", scene.layers.cryptomatte, "asked for", "no output holds it");
        add("lobe_layers", scene.layers.lobes, "asked for", "no output holds them");
        add("depth_layer", scene.layers.depth, "asked for", "no output holds it");
        add("normal_layer", scene.layers.normal, "asked for", "no output holds it");
        add("variance_layer", scene.layers.variance, "asked for", "no output holds it");
        add("sample_layer", scene.layers.samples, "asked for", "no output holds it");
        add("position_layer", scene.layers.position, "asked for", "no output holds it");
        add("motion_layer", scene.layers.motion, "asked for", "no output holds it: the next frame is not read");
        add("uv_layer", scene.layers.uv, "asked for", "no output holds it");
        add("denoiser", scene.denoise, "asked for", "nobody asks for a denoised picture: not loaded");
        add(
            "camera_motion",
            !scene.camera_path.is_empty(),
            "the camera moves while the shutter is open",
            "the camera stands still",
        );
        add(
            "yarn_motion",
            scene.cloth_moves(),
            "yarns move while the shutter is open",
            "yarns stand still: one time in the BVH",
        );
        add("adaptive_sampling", scene.render.adaptive, "asked for", "all pixels get the same number of samples");
        add("openimageio", crate::image::oiio_loaded(), "an image needed it", "no image needs it: not loaded");
        add(
            "textures",
            scene.materials.iter().any(|m| m.texture.is_some()),
            "a surface has a texture",
            "no surface has a texture",
        );
        add(
            "yarn_variants",
            scene.fabrics.iter().any(|f| !f.variants.is_empty()),
            "a fabric has several yarns or colours",
            "every fabric is of one yarn throughout",
        );
        add("meshes", !scene.objects.is_empty(), "the scene has a mesh", "no mesh in the scene");
        add(
            "coated_surfaces",
            scene.materials.iter().any(|m| m.surface.is_coated()),
            "a surface has a coat",
            "no surface has a coat",
        );
        let pixels = {
            let [x0, y0, x1, y1] = scene.render.crop.map(u64::from);
            (x1 - x0) * (y1 - y0)
        };
        // What sums of a layer take; the variance layer shares the squares that the estimate of noise needs anyway.
        for (name, layer) in [
            ("lobe_layers", Layers { lobes: true, ..Layers::NONE }),
            ("depth_layer", Layers { depth: true, ..Layers::NONE }),
            ("normal_layer", Layers { normal: true, ..Layers::NONE }),
            ("albedo_layer", Layers { albedo: true, ..Layers::NONE }),
            ("cryptomatte", Layers { cryptomatte: true, ..Layers::NONE }),
            ("variance_layer", Layers { variance: true, ..Layers::NONE }),
            ("sample_layer", Layers { samples: true, ..Layers::NONE }),
            ("position_layer", Layers { position: true, ..Layers::NONE }),
            ("motion_layer", Layers { motion: true, ..Layers::NONE }),
            ("uv_layer", Layers { uv: true, ..Layers::NONE }),
        ] {
            let bytes = Tile::bytes_per_pixel(layer) - Tile::bytes_per_pixel(Layers::NONE);
            if let Some(feature) = features.iter_mut().find(|f| f.name == name) {
                feature.bytes = Some(bytes as u64 * pixels);
            }
        }
        Self { features }
    }

    /// Names of the features that are used, or of those left out.
    pub fn names(&self, used: bool) -> Vec<&'static str> {
        self.features.iter().filter(|f| f.used == used).map(|f| f.name).collect()
    }
}

#[cfg(test)]
mod tests;
