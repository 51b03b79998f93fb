//! What a render needs and what it leaves out, told from the checked scene before anything is built.
//!
//! What is left out is not computed, allocated or loaded; [`crate::scene::force`] brings it back, to measure what that saves.

mod memory;

pub(crate) use memory::{Memory, TooLarge};

use crate::{
    film::Tile,
    light::Light,
    scene::{CurveKind, Fabric, FiberDetail, Layers, Mode, Scene, Yarn},
};

/// One feature of the renderer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Feature {
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
pub(crate) struct Plan {
    /// In a fixed order.
    pub features: Vec<Feature>,
}

impl Plan {
    /// Decides for a scene.
    pub(crate) fn new(scene: &Scene) -> Self {
        let mut list = List::default();
        list.add_cloth(scene);
        list.add_sections(scene);
        list.add_camera_and_lights(scene);
        list.add_layers(scene);
        list.add_the_rest(scene);
        Self { features: list.0 }
    }

    /// Names of the features that are used, or of those left out.
    pub(crate) fn names(&self, used: bool) -> Vec<&'static str> {
        self.features.iter().filter(|f| f.used == used).map(|f| f.name).collect()
    }
}

/// Features, one after another.
#[derive(Default)]
struct List(Vec<Feature>);

impl List {
    /// A feature with the reason if it is used, and if it is not.
    fn add(&mut self, name: &'static str, used: bool, yes: &'static str, no: &'static str) {
        self.0.push(Feature { name, used, reason: if used { yes } else { no }, bytes: None });
    }

    /// How cloth is represented, and what its fibres are.
    fn add_cloth(&mut self, scene: &Scene) {
        let of_yarns = |mode: &dyn Fn(Mode) -> bool| {
            mode(scene.render.mode) && scene.fabrics.iter().any(|f| matches!(f.kind, CurveKind::Yarn(_)))
        };
        self.add(
            "aggregated_yarns",
            of_yarns(&|m| m != Mode::Fiber),
            "a model answers for the fibres in yarns or plies",
            "no yarn is aggregated",
        );
        self.add(
            "fiber_generation",
            of_yarns(&|m| m == Mode::Fiber),
            "every fibre of the yarns is a curve",
            "fibres in yarns are found analytically",
        );
        self.add(
            "flyaways",
            scene.yarns.iter().any(|y| y.flyaways.is_some()),
            "a yarn has fly-aways",
            "no yarn has fly-aways",
        );
        self.add(
            "uneven_yarns",
            scene.yarns.iter().any(|y| y.unevenness > 0.0),
            "the thickness of a yarn changes along it",
            "yarns are as thick as their curves say",
        );
        self.add("exit_rejection", !scene.fabrics.is_empty(), "Embree offers hits from inside of curves", "no curves");
        self.add(
            "all_lobes",
            scene
                .yarns
                .iter()
                .flat_map(|y| &y.fibers)
                .all(|(_, f)| [f.r, f.tt, f.d].iter().all(|albedo| albedo.iter().any(|a| *a > 0.0))),
            "every fibre has all of R, TT and D",
            "lobes of albedo 0 are neither evaluated nor sampled",
        );
        self.add(
            "ply_materials",
            scene.yarns.iter().any(|y| y.fibers.windows(2).any(|w| w[0].1 != w[1].1)),
            "plies of a yarn are of different fibres",
            "all plies of a yarn are of the same fibre",
        );
        self.add(
            "fiber_detail",
            scene.fabrics.iter().any(|f| f.shows_fibers),
            "fibres are wide enough in the picture to be told apart",
            if FiberDetail::of(scene).is_some() {
                "fibres are narrower than a quarter of a pixel"
            } else {
                "not asked for"
            },
        );
    }

    /// What rays find in the cross-sections of yarns.
    fn add_sections(&mut self, scene: &Scene) {
        let shapes: Vec<_> = scene.yarns.iter().map(Yarn::shape).collect();
        self.add("ply_filter", shapes.iter().any(|s| !s.filled), "plies leave gaps", "plies fill the yarn");
        self.add(
            "flattening",
            scene.fabrics.iter().any(Fabric::is_pressed),
            "a yarn is pressed flat",
            "all yarns are round",
        );
        self.add("elliptical_plies", shapes.iter().any(|s| s.elliptical), "a ply is elliptical", "all plies are round");
        self.add(
            "ply_twist",
            shapes.iter().any(|s| s.ply_rate != 0.0),
            "plies wind around the yarn",
            "plies run along the yarn",
        );
        self.add(
            "tilted_plies",
            shapes.iter().any(|s| s.tilted),
            "rays follow plies along the yarn",
            "the section is perpendicular",
        );
    }

    fn add_camera_and_lights(&mut self, scene: &Scene) {
        let any_light = |test: &dyn Fn(&Light) -> bool| scene.lights.iter().any(test);
        let image = |l: &Light| matches!(l, Light::Environment(e) if e.image.is_some());
        let area = |l: &Light| matches!(l, Light::Area(_));
        self.add("depth_of_field", scene.camera.lens.is_some(), "the camera has a lens", "the camera is a pinhole");
        self.add("environment", any_light(&|l| matches!(l, Light::Environment(_))), "the sky shines", "no sky");
        self.add("environment_image", any_light(&image), "the sky has an image", "no light has an image");
        self.add(
            "distant_light",
            any_light(&|l| matches!(l, Light::Distant { .. })),
            "a light is far away",
            "no distant light",
        );
        self.add(
            "point_light",
            any_light(&|l| matches!(l, Light::Point { .. })),
            "a light is a point",
            "no point light",
        );
        self.add("spot_light", any_light(&|l| matches!(l, Light::Spot { .. })), "a light is a spot", "no spot light");
        self.add("area_lights", any_light(&area), "a light is a surface", "no light is a surface");
        self.add(
            "light_choice",
            scene.lights.iter().filter(|l| l.needs_shadow_rays()).count() > 1,
            "each place chooses a light by what it can give there",
            "no more than one light is sampled",
        );
        self.add(
            "shadow_rays",
            any_light(&Light::needs_shadow_rays),
            "a light is sampled",
            "every light is found by sampled directions",
        );
        self.add(
            "mis",
            any_light(&|l| image(l) || area(l)),
            "a light is sampled in two ways",
            "each light is found in one way only",
        );
        self.add("ground", scene.ground.is_some(), "there is a floor", "no floor");
    }

    /// Layers, with the bytes of their sums (the variance layer shares the squares that the estimate of noise needs
    /// anyway), and the denoiser.
    fn add_layers(&mut self, scene: &Scene) {
        const NONE: Layers = Layers::NONE;
        const NOBODY: &str = "no output holds it";
        let [x0, y0, x1, y1] = scene.render.crop.map(u64::from);
        let pixels = (x1 - x0) * (y1 - y0);
        let asked = scene.layers;
        for (name, used, alone, no) in [
            ("albedo_layer", asked.albedo, Layers { albedo: true, ..NONE }, NOBODY),
            ("cryptomatte", asked.cryptomatte, Layers { cryptomatte: true, ..NONE }, NOBODY),
            ("lobe_layers", asked.lobes, Layers { lobes: true, ..NONE }, "no output holds them"),
            ("depth_layer", asked.depth, Layers { depth: true, ..NONE }, NOBODY),
            ("normal_layer", asked.normal, Layers { normal: true, ..NONE }, NOBODY),
            ("variance_layer", asked.variance, Layers { variance: true, ..NONE }, NOBODY),
            ("sample_layer", asked.samples, Layers { samples: true, ..NONE }, NOBODY),
            ("position_layer", asked.position, Layers { position: true, ..NONE }, NOBODY),
            (
                "motion_layer",
                asked.motion,
                Layers { motion: true, ..NONE },
                "no output holds it: the next frame is not read",
            ),
            ("uv_layer", asked.uv, Layers { uv: true, ..NONE }, NOBODY),
            (
                "light_groups",
                asked.light_groups > 0,
                Layers { light_groups: asked.light_groups, ..NONE },
                "no light is in a group, or no output holds them",
            ),
        ] {
            let bytes = Tile::bytes_per_pixel(alone) - Tile::bytes_per_pixel(NONE);
            let reason = if used { "asked for" } else { no };
            self.0.push(Feature { name, used, reason, bytes: Some(bytes as u64 * pixels) });
        }
        self.add("denoiser", scene.denoise, "asked for", "nobody asks for a denoised picture: not loaded");
    }

    /// Motion, sampling, pictures and surfaces.
    fn add_the_rest(&mut self, scene: &Scene) {
        self.add(
            "camera_motion",
            !scene.camera_path.is_empty(),
            "the camera moves while the shutter is open",
            "the camera stands still",
        );
        self.add(
            "yarn_motion",
            scene.cloth_moves(),
            "yarns move while the shutter is open",
            "yarns stand still: one time in the BVH",
        );
        self.add("adaptive_sampling", scene.render.adaptive, "asked for", "all pixels get the same number of samples");
        self.add("openimageio", crate::image::oiio_loaded(), "an image needed it", "no image needs it: not loaded");
        self.add(
            "textures",
            scene.materials.iter().any(|m| m.texture.is_some()),
            "a surface has a texture",
            "no surface has a texture",
        );
        self.add(
            "yarn_variants",
            scene.fabrics.iter().any(|f| !f.variants.is_empty()),
            "a fabric has several yarns or colours",
            "every fabric is of one yarn throughout",
        );
        self.add("meshes", !scene.objects.is_empty(), "the scene has a mesh", "no mesh in the scene");
        self.add(
            "coated_surfaces",
            scene.materials.iter().any(|m| m.surface.is_coated()),
            "a surface has a coat",
            "no surface has a coat",
        );
    }
}

#[cfg(test)]
mod tests;
