//! A scene described by values: what programs make without text, and what scene files are read into.

use std::{collections::HashSet, f64::consts::TAU, fmt, path::Path};

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::{
    Axes, CurveKind, Fabric, FabricMotion, GarmentFacts, Ground, Layers, LightGroups, Material, Object, RenderSettings,
    Scene, Storage, Taken, Tufts, Yarn, bounds, defaults, force, identity,
    view::{CameraSetup, Views},
};
use crate::{
    geometry::{
        curve::{Basis, Curve},
        density::KnownPacking,
        fiber::{Placement, packing},
        ply::PlyParameters,
        yarn::{MAX_PLIES, touching_plies},
    },
    image::png::Display,
    light::Light,
    math::{sampler::Stream, words::counted},
    scattering::fiber::FiberMaterial,
};

/// What a scene is made of, in its own place: millimetres, radians, +y up.
///
/// Everything has a default but the cloth ([`defaults`]). [`Self::build`] checks what belongs together, moves the middle
/// of the cloth to the origin, places camera and ground, and drops yarns that no fabric uses.
///
/// ```
/// use yarnray::{
///     pattern::{draft::Draft, weave::Weave},
///     scattering::fiber::FiberMaterial,
///     scene::{Fabric, SceneBuilder, Yarn},
/// };
///
/// let silk = FiberMaterial { r: [0.06; 3], tt: [0.8, 0.7, 0.5], ..FiberMaterial::default() };
/// let twists = [20f64.to_radians(), -10f64.to_radians()];
/// let mut scene = SceneBuilder::new("silk");
/// let yarn = scene.add_yarn(Yarn::of_equal_plies("silk", 0.1, 1, 60, 0.5, twists, ("silk".to_owned(), silk)).unwrap());
/// let weave = Weave::of(Draft::named("satin 5").unwrap(), 0.1);
/// let curves = weave.strands().unwrap().into_iter().map(|strand| strand.curve).collect::<Vec<_>>();
/// scene.fabrics.push(Fabric::new("satin", yarn, curves, 0.1, 1));
/// scene.size(320, 240);
/// let scene = scene.build().unwrap();
/// assert_eq!((scene.fabrics[0].curves.len(), scene.render.width), (40, 320));
/// ```
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    /// What messages call the scene: its file, if it has one.
    pub name: String,
    /// Settings of the render.
    pub render: RenderSettings,
    /// Which pictures are made, and how they are stored.
    pub output: OutputSettings,
    /// The camera.
    pub camera: CameraSetup,
    /// Kinds of yarn that fabrics may use.
    pub yarns: Vec<Yarn>,
    /// Fibres that fabrics may use by themselves: name and material.
    pub fibers: Vec<(String, FiberMaterial)>,
    /// The cloth.
    pub fabrics: Vec<Fabric>,
    /// Meshes beside it.
    pub objects: Vec<Object>,
    /// Materials of ground and meshes.
    pub materials: Vec<Material>,
    /// The lights.
    pub lights: Vec<Light>,
    /// The groups that they are in.
    pub light_groups: LightGroups,
    /// The floor, if there is one.
    pub ground: Option<GroundSetup>,
    /// What is known of fabrics that are laid on garments.
    pub garments: Vec<GarmentFacts>,
    /// What the user should know already.
    pub warnings: Vec<String>,
}

/// Which pictures are made of a film, and how they are stored.
#[derive(Clone, Copy, Debug, Default)]
pub struct OutputSettings {
    /// How pictures for a screen are made.
    pub display: Display,
    /// Layers of an EXR.
    pub layers: Layers,
    /// How an EXR is stored.
    pub storage: Storage,
    /// The unit and the axes of its places.
    pub axes: Axes,
    /// Whether a denoised picture is made as well.
    pub denoise: bool,
    /// Frames in a second of the sequence, if that is known: written to an EXR.
    pub frames_per_second: Option<f64>,
}

/// A floor before it is known where the cloth lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundSetup {
    /// Its y, millimetres; `None` for right below all cloth and meshes.
    pub height: Option<f64>,
    /// Index into the materials.
    pub material: usize,
}

/// Why described parts do not make a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneError(String);

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for SceneError {}

impl SceneBuilder {
    /// A scene without anything in it.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), ..Self::default() }
    }

    /// Sets the size of the picture, pixels, and renders all of it.
    pub fn size(&mut self, width: u32, height: u32) {
        (self.render.width, self.render.height) = (width, height);
        self.render.crop = [0, 0, width, height];
    }

    /// Adds a kind of yarn and gives what fabrics of it are made of.
    pub fn add_yarn(&mut self, yarn: Yarn) -> CurveKind {
        self.yarns.push(yarn);
        CurveKind::Yarn(self.yarns.len() - 1)
    }

    /// Adds a material and gives its index, for meshes and the ground.
    pub fn add_material(&mut self, material: Material) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Makes the scene.
    ///
    /// # Errors
    /// If an index points at nothing, curves lack points or radii, a number is not finite, a light has no size, the picture has no pixels, or a
    /// feature cannot be forced.
    pub fn build(self) -> Result<Scene, SceneError> {
        self.check()?;
        let Self { name, render, output, camera, yarns, fibers, mut fabrics, mut objects, materials, .. } = self;
        let (mut lights, light_groups) = (self.lights, self.light_groups);
        let (ground, garments, warnings) = (self.ground, self.garments, self.warnings);
        tell_names_apart(&mut fabrics);

        // Single precision is kept for what is near: the middle of the cloth becomes the origin.
        let middle = bounds(&fabrics).or(bounds_of_objects(&objects));
        let middle = middle.map_or(DVec3::ZERO, |(low, high)| 0.5 * (low + high));
        for fabric in &mut fabrics {
            fabric.transform(&DAffine3::from_translation(-middle));
        }
        for object in &mut objects {
            object.mesh.transform(&DAffine3::from_translation(-middle));
            object.next.iter_mut().for_each(|p| *p -= middle);
        }
        for light in &mut lights {
            light.translate(-middle);
        }
        let aspect = f64::from(render.width) / f64::from(render.height);
        let frame = f64::from(render.frame.unwrap_or(defaults::FRAME));
        let Views { camera, path, flow } = camera.place(&fabrics, &objects, middle, aspect, frame);
        let ground = ground.map(|ground| {
            let lowest = [bounds(&fabrics), bounds_of_objects(&objects)].into_iter().flatten().map(|(low, _)| low.y);
            let lowest = lowest.reduce(f64::min).unwrap_or(0.0);
            let height = ground.height.map_or(lowest, |h| h - middle.y);
            Ground { height: height as f32, material: ground.material }
        });
        let OutputSettings { display, mut layers, storage, axes, denoise, frames_per_second } = output;
        layers.light_groups = layers.light_groups.min(light_groups.names().len() as u8);
        let mut scene = Scene {
            path: name,
            render,
            display,
            layers,
            storage,
            axes,
            denoise,
            camera,
            camera_path: path,
            camera_flow: layers.motion.then_some(flow),
            frames_per_second,
            yarns,
            fibers,
            fabrics,
            objects,
            materials,
            lights,
            light_groups,
            ground,
            middle,
            garments,
            identity: Vec::new(),
            fingerprint: String::new(),
            warnings,
        };
        let described = [scene.yarns.len(), scene.fibers.len()];
        keep_used(&mut scene);
        remove_lobes(&mut scene);
        scene.look_for_fibers();
        for name in scene.render.force.clone() {
            force::force(&mut scene, &name).map_err(SceneError)?;
        }
        warn_about_nothing(&mut scene, described);
        warn_about_size(&mut scene);
        warn_about_precision(&mut scene);
        warn_about_density(&mut scene);
        warn_about_standing_hairs(&mut scene);
        // Last: whatever changes the picture has its place in it.
        scene.identity = identity::identity(&scene);
        scene.fingerprint = identity::fingerprint(&scene.identity);
        Ok(scene)
    }

    /// What must hold of values that no reader has checked.
    fn check(&self) -> Result<(), SceneError> {
        let fail = |what: String| Err(SceneError(what));
        let RenderSettings { width, height, crop: [x0, y0, x1, y1], spp, .. } = self.render;
        if x0 >= x1 || y0 >= y1 || x1 > width || y1 > height || spp == 0 {
            return fail(format!(
                "expected at least one pixel and one sample: the crop is {:?} of {width} x {height} at {spp} spp",
                self.render.crop
            ));
        }
        if let Some(time) = self.render.time.filter(|time| time.is_nan() || *time < 0.0) {
            return fail(format!("expected a time of 0 seconds or more, found {time}"));
        }
        let unit = self.output.axes.unit;
        if !(unit.is_normal() && unit > 0.0) {
            return fail(format!("expected a unit of places above 0, found {unit} millimetres"));
        }
        for yarn in &self.yarns {
            if !(1..=MAX_PLIES).contains(&yarn.plies.len()) || yarn.plies.len() != yarn.fibers.len() {
                return fail(format!("yarn `{}`: expected 1 to {MAX_PLIES} plies, and as many fibres", yarn.name));
            }
            if !(yarn.radius > 0.0 && yarn.radius.is_finite()) {
                return fail(format!("yarn `{}`: expected a radius above 0, found {}", yarn.name, yarn.radius));
            }
            if let Some(k) = yarn.plies.iter().position(|ply| !ply.is_sound()) {
                return fail(format!(
                    "yarn `{}`: expected a ply of fibres, finite, with radii above 0; ply {} is {:?}",
                    yarn.name,
                    k + 1,
                    yarn.plies[k]
                ));
            }
        }
        for fabric in &self.fabrics {
            let known = match fabric.kind {
                CurveKind::Yarn(yarn) => yarn < self.yarns.len(),
                CurveKind::Fiber(fiber) => fiber < self.fibers.len(),
            };
            if !known {
                return fail(format!("fabric `{}`: the scene has no {:?}", fabric.name, fabric.kind));
            }
            if let Some(problem) = fabric.curves.par_iter().find_map_first(problem_of_curve) {
                return fail(format!("fabric `{}`: {problem}", fabric.name));
            }
            if let Some(problem) = fabric.problem() {
                return fail(format!("fabric `{}`: {problem}", fabric.name));
            }
        }
        for Object { origin, mesh, next, .. } in &self.objects {
            let n = mesh.points.len();
            let finite = mesh.points.iter().chain(next).chain(&mesh.normals).all(|p| p.is_finite());
            let counted = [mesh.normals.len(), mesh.uvs.len(), next.len()].iter().all(|count| [0, n].contains(count));
            if !finite || !counted || mesh.triangles.iter().flatten().any(|&i| i as usize >= n) {
                return fail(format!(
                    "mesh `{origin}`: expected finite points, for all of them or for none normals and texture \
                     coordinates, and triangles of them"
                ));
            }
        }
        if let Some((i, problem)) = self.lights.iter().enumerate().find_map(|(i, light)| Some((i, light.problem()?))) {
            return fail(format!("light {}: {problem}", i + 1));
        }
        let of_objects = self.objects.iter().map(|o| o.material);
        if let Some(none) = of_objects.chain(self.ground.map(|g| g.material)).find(|&m| m >= self.materials.len()) {
            return fail(format!("the scene has no material {none}, only {}", self.materials.len()));
        }
        Ok(())
    }
}

/// A fibre that returns no light, of the default widths.
impl Default for FiberMaterial {
    fn default() -> Self {
        let [beta_r, beta_tt, beta_n] = [defaults::BETA_R, defaults::BETA_TT, defaults::BETA_N].map(f64::to_radians);
        Self { r: [0.0; 3], tt: [0.0; 3], d: [0.0; 3], beta_r, beta_tt, beta_n }
    }
}

/// What is wrong with a curve and its radii, if anything is.
fn problem_of_curve((curve, radii): &(Curve, Vec<f64>)) -> Option<String> {
    let points = curve.points.len();
    let finite = curve.points.iter().all(|p| p.is_finite()) && radii.iter().all(|r| *r >= 0.0 && r.is_finite());
    if points < 2 || radii.len() != points || !finite {
        let radii = radii.len();
        return Some(format!(
            "expected curves of two finite points or more and as many radii, found {points} and {radii}"
        ));
    }
    let flattened = curve.flattening.as_ref().is_none_or(|axes| axes.len() == points);
    (!flattened).then(|| "expected as many flattenings as points".to_owned())
}

impl Fabric {
    /// What does not fit its curves, where that is so.
    fn problem(&self) -> Option<&'static str> {
        let of_curves = |counts: &mut dyn Iterator<Item = usize>| {
            counts.eq(self.curves.iter().map(|(curve, _)| curve.points.len()))
        };
        let at_times = |times: &[Vec<Vec<DVec3>>]| times.iter().all(|t| of_curves(&mut t.iter().map(Vec::len)));
        let FabricMotion { later, rest, flow } = &self.motion;
        let moves = at_times(later) && at_times(flow) && at_times(rest.as_slice());
        let finite = later.iter().chain(flow).chain(rest).flatten().flatten().all(|p| p.is_finite());
        let of_variants =
            |indices: &Vec<u16>| !indices.is_empty() && indices.iter().all(|i| usize::from(*i) < self.variants.len());
        let colored = self.variants.is_empty()
            || (self.material_indices.len() == self.curves.len() && self.material_indices.par_iter().all(of_variants));
        if !moves || !finite {
            Some("expected finite points at all times, as many as its curves have")
        } else if !self.uvs.is_empty() && !of_curves(&mut self.uvs.iter().map(Vec::len)) {
            Some("expected texture coordinates for all points or for none")
        } else if !colored {
            Some("expected indices into its variants for each curve")
        } else if !self.curves.is_empty() && (self.phases.is_empty() || !self.phases.iter().all(|p| p.is_finite())) {
            Some("expected finite phases of its plies")
        } else {
            None
        }
    }

    /// Yarns or fibres of even radius (millimetres) along curves, without motion and of one colour. Plies start at
    /// phases that are random in `seed`.
    pub fn new(name: impl Into<String>, kind: CurveKind, curves: Vec<Curve>, radius: f64, seed: u32) -> Self {
        let mut stream = Stream::new(seed);
        Self {
            name: name.into(),
            named: true,
            origin: "a program".to_owned(),
            panels: Vec::new(),
            from_file: false,
            kind,
            tufts: Tufts::default(),
            motion: FabricMotion::default(),
            variants: Vec::new(),
            material_indices: Vec::new(),
            printed: false,
            uvs: Vec::new(),
            taken: Taken::default(),
            shows_fibers: false,
            phases: curves.iter().map(|_| TAU * f64::from(stream.next())).collect(),
            seed,
            basis: match curves.first().map(|curve| curve.basis) {
                Some(Basis::BSpline) => Basis::BSpline,
                _ => Basis::CatmullRom,
            },
            tolerance: defaults::CURVE_TOLERANCE,
            longest_segment: defaults::LONGEST_SEGMENT,
            curves: curves
                .into_iter()
                .map(|curve| {
                    let radii = vec![radius; curve.points.len()];
                    (curve, radii)
                })
                .collect(),
        }
    }
}

impl Yarn {
    /// A yarn of `plies` equal round plies that touch each other, each of `fibers` fibres which fill the share `density`
    /// of it. `radius` in millimetres; twists, in radians, are those of the plies about the yarn and of the outermost
    /// fibres about the ply.
    ///
    /// # Errors
    /// If there are no plies or fibres, or a number is beyond its range.
    #[allow(clippy::too_many_arguments, reason = "what describes a yarn of equal plies, each by its name")]
    pub fn of_equal_plies(
        name: impl Into<String>,
        radius: f64,
        plies: u32,
        fibers: u32,
        density: f64,
        twists: [f64; 2],
        fiber: (String, FiberMaterial),
    ) -> Result<Self, SceneError> {
        let name = name.into();
        let fail = |what: &str| Err(SceneError(format!("yarn `{name}`: {what}")));
        if !(1..=MAX_PLIES as u32).contains(&plies) {
            return fail("expected 1 to 64 plies");
        }
        if fibers == 0 || !(density > 0.0 && density.is_finite()) || !(radius > 0.0 && radius.is_finite()) {
            return fail("expected fibres, and a radius and a density above 0");
        }
        let (ply_radius, distance) = touching_plies(plies);
        let fiber_radius = ply_radius * (density / f64::from(fibers)).sqrt();
        if fiber_radius >= ply_radius {
            return fail("its fibres do not fit its plies: a lower density, or more fibres");
        }
        let ply = |k: u32| PlyParameters {
            radius: ply_radius,
            aspect: defaults::PLY_ASPECT,
            distance,
            angle: TAU * f64::from(k) / f64::from(plies),
            fibers,
            fiber_radius,
            fiber_twist: twists[1],
        };
        Ok(Self {
            plies: (0..plies).map(ply).collect(),
            ply_twist: twists[0],
            fibers: vec![fiber; plies as usize],
            placement: Placement::Regular,
            known_packing: KnownPacking::default(),
            flyaways: None,
            unevenness: 0.0,
            tex: None,
            tilted: defaults::TILTED,
            name,
            radius,
        })
    }
}

fn bounds_of_objects(objects: &[Object]) -> Option<(DVec3, DVec3)> {
    objects.iter().filter_map(|o| o.mesh.bounds()).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// Numbers the fabrics whose name another one before them has; names that were given come before those of yarns.
fn tell_names_apart(fabrics: &mut [Fabric]) {
    let mut taken: HashSet<String> = HashSet::new();
    let (named, others): (Vec<_>, Vec<_>) = fabrics.iter_mut().partition(|fabric| fabric.named);
    for fabric in named.into_iter().chain(others) {
        let given = fabric.name.clone();
        let mut number = 1;
        while !taken.insert(fabric.name.clone()) {
            number += 1;
            fabric.name = format!("{given}_{number}");
        }
    }
}

/// Leaves out the lobes of single fibres that the settings name.
fn remove_lobes(scene: &mut Scene) {
    for lobe in scene.render.without.clone() {
        let Scene { yarns, fabrics, fibers, .. } = &mut *scene;
        let variants = fabrics.iter_mut().flat_map(|fabric| &mut fabric.variants);
        let of_yarns = yarns.iter_mut().chain(variants).flat_map(|yarn| &mut yarn.fibers);
        for (_, fiber) in of_yarns.chain(fibers) {
            lobe.remove_from(fiber);
        }
    }
}

/// Drops kinds of yarn and fibre that no fabric uses: libraries hold many.
fn keep_used(scene: &mut Scene) {
    let (mut yarns, mut fibers) = (Vec::new(), Vec::new());
    let place_in = |kept: &mut Vec<usize>, index: usize| {
        kept.iter().position(|&k| k == index).unwrap_or_else(|| {
            kept.push(index);
            kept.len() - 1
        })
    };
    for fabric in &mut scene.fabrics {
        fabric.kind = match fabric.kind {
            CurveKind::Yarn(yarn) => CurveKind::Yarn(place_in(&mut yarns, yarn)),
            CurveKind::Fiber(fiber) => CurveKind::Fiber(place_in(&mut fibers, fiber)),
        };
    }
    scene.yarns = yarns.into_iter().map(|y| scene.yarns[y].clone()).collect();
    scene.fibers = fibers.into_iter().map(|f| scene.fibers[f].clone()).collect();
}

/// Fibres that do not fit their ply: explicit ones overlap, and the model is held to none.
fn warn_about_density(scene: &mut Scene) {
    for yarn in &scene.yarns {
        let fullest = yarn.plies.iter().map(|p| f64::from(p.fibers) * (p.fiber_radius / p.radius).powi(2));
        let fullest = fullest.fold(0.0, f64::max);
        if fullest > packing::DENSEST {
            scene.warnings.push(format!(
                "yarn `{}`: fibres would fill {:.0} % of a ply; above {:.0} % they overlap",
                yarn.name,
                100.0 * fullest,
                100.0 * packing::DENSEST
            ));
        }
    }
}

/// Fly-aways are made where yarns are when the shutter opens, and stay there.
fn warn_about_standing_hairs(scene: &mut Scene) {
    let hairy = |thread| matches!(thread, CurveKind::Yarn(yarn) if scene.yarns[yarn].flyaways.is_some());
    let still = scene.fabrics.iter().filter(|f| !f.motion.later.is_empty() && hairy(f.kind));
    let warnings = still.map(|f| format!("the fly-aways of `{}` stand still while the shutter is open", f.name));
    scene.warnings.extend(warnings.collect::<Vec<_>>());
}

/// A picture of nothing is no mistake, but seldom what was meant. So many yarns and fibres are described, of which a library is.
fn warn_about_nothing(scene: &mut Scene, [yarns, fibers]: [usize; 2]) {
    if !scene.shows_nothing() {
        return;
    }
    let mut what = "there is nothing to see: the scene has no [[fabric]] and no [[mesh]]".to_owned();
    if yarns + fibers > 0 {
        let (yarns, fibers) = (counted(yarns, "yarn"), counted(fibers, "fibre"));
        let name = Path::new(&scene.path).file_name().unwrap_or_default().display();
        what += &format!("; it is a library of {yarns} and {fibers}, which a scene takes by `library = [\"{name}\"]`");
    }
    scene.warnings.push(what);
}

/// A glove of ten metres, or of a tenth of a millimetre, is in another unit than was thought.
fn warn_about_size(scene: &mut Scene) {
    let Some((low, high)) = bounds(&scene.fabrics) else { return };
    let size = (high - low).max_element();
    if !(0.5..=5000.0).contains(&size) {
        let shown = if size > 1.0 { format!("{:.1} m", size / 1000.0) } else { format!("{:.1} um", size * 1000.0) };
        scene.warnings.push(format!(
            "the cloth is {shown} wide: is the unit of its curves right? `unit` of a source gives it; `yarnray info` of a \
             curve file proposes one"
        ));
    }
}

/// Single-precision hits lose more than half a percent of a radius where the scene is a hundred thousand radii wide.
fn warn_about_precision(scene: &mut Scene) {
    let Some((low, high)) = scene.bounds() else { return };
    let thinnest = scene.fabrics.iter().flat_map(|f| &f.curves).flat_map(|(_, r)| r).copied().fold(f64::MAX, f64::min);
    if thinnest <= 0.0 {
        scene.warnings.push("yarns of radius 0 are not seen: `radius` of a fabric gives them one".to_owned());
        return;
    }
    let ratio = 0.5 * (high - low).length() / thinnest;
    let uncertain = 0.5 * f64::from(f32::EPSILON) * ratio;
    if ratio > 1e5 {
        scene.warnings.push(format!(
            "the scene is {ratio:.1e} times as wide as its thinnest yarn: positions of hits are uncertain by {:.1} % of that \
             yarn's radius",
            100.0 * uncertain
        ));
    }
}
