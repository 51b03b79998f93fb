//! What a render needs and what it leaves out, decided from the checked scene before anything is built.

use crate::scene::{Light, Scene};

/// One feature of the renderer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Feature {
    /// Stable name, as in `--stats`.
    pub name: &'static str,
    /// Whether the scene needs it.
    pub used: bool,
    /// Why, in words.
    pub reason: &'static str,
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
        let mut add = |name, used, yes, no| features.push(Feature { name, used, reason: if used { yes } else { no } });
        add("ply_filter", shapes.iter().any(|s| !s.filled), "plies leave gaps", "plies fill the yarn");
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
            "lights are chosen by power",
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
        add("denoiser", scene.denoise, "asked for", "nobody asks for a denoised picture: not loaded");
        add("openimageio", crate::image::oiio_loaded(), "an image needed it", "no image needs it: not loaded");
        add("textures", false, "", "no texture in the scene");
        add("meshes", !scene.objects.is_empty(), "the scene has a mesh", "no mesh in the scene");
        add(
            "coated_surfaces",
            scene.materials.iter().any(|m| m.surface.is_coated()),
            "a surface has a coat",
            "no surface has a coat",
        );
        Self { features }
    }

    /// Names of the features that are used, or of those left out.
    pub fn names(&self, used: bool) -> Vec<&'static str> {
        self.features.iter().filter(|f| f.used == used).map(|f| f.name).collect()
    }
}
