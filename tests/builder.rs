//! Scenes that are built in code: the same as from text, and errors in place of panics.

use glam::{DVec3, Vec3A};
use yarnray::{
    geometry::mesh::Mesh,
    light::{AreaLight, Environment, Light, Shape},
    math::Rgb,
    pattern::straight,
    scattering::{fiber::FiberMaterial, surface::SurfaceMaterial},
    scene::{
        CurveKind, Fabric, Material, Object, SceneBuilder, Yarn,
        builder::GroundSetup,
        load::{LoadOptions, parse},
    },
};

const TEXT: &str = r#"
[fiber.wool]
r = 0.05
tt = [0.6, 0.1, 0.1]
d = [0.2, 0.05, 0.05]
[yarn.wool]
radius = 0.25
plies = 2
fibers = 80
density = 0.3
fiber = "wool"
ply_twist = 25
fiber_twist = -15
[[fabric]]
name = "yarns"
yarn = "wool"
seed = 7
source = { type = "straight", count = 3, length = 4, spacing = 0.6 }
[[light]]
type = "environment"
[[light]]
type = "sphere"
position = [3, 5, 4]
radius = 1
radiance = 20
visible = false
"#;

fn in_code() -> SceneBuilder {
    let wool = FiberMaterial { r: [0.05; 3], tt: [0.6, 0.1, 0.1], d: [0.2, 0.05, 0.05], ..FiberMaterial::default() };
    let twists = [25f64.to_radians(), -15f64.to_radians()];
    let mut scene = SceneBuilder::new("a test");
    let yarn = Yarn::of_equal_plies("wool", 0.25, 2, 80, 0.3, twists, ("wool".to_owned(), wool)).unwrap();
    let kind = scene.add_yarn(yarn);
    scene.fabrics.push(Fabric::new("yarns", kind, straight(3, 4.0, 0.6), 0.25, 7));
    scene.lights.push(Light::Environment(Environment { radiance: Rgb::ONE, image: None, visible: true }));
    let shape = Shape::Sphere { centre: DVec3::new(3.0, 5.0, 4.0).as_vec3a(), radius: 1.0 };
    scene.lights.push(Light::Area(AreaLight { shape, radiance: Rgb::splat(20.0), two_sided: false, visible: false }));
    scene
}

#[test]
fn a_scene_in_code_is_that_of_the_text() {
    let from_text = parse("a test", TEXT, &LoadOptions::default()).unwrap();
    let built = in_code().build().unwrap();
    assert_eq!(built.identity, from_text.identity);
    assert_eq!(built.fingerprint, from_text.fingerprint);
    assert_eq!((built.render.spp, built.camera), (from_text.render.spp, from_text.camera));
}

#[test]
fn what_makes_no_scene_is_told() {
    let error = |change: &dyn Fn(&mut SceneBuilder)| {
        let mut scene = in_code();
        change(&mut scene);
        scene.build().unwrap_err().to_string()
    };
    assert!(error(&|s| s.fabrics[0].kind = CurveKind::Yarn(3)).contains("the scene has no Yarn(3)"));
    assert!(error(&|s| s.fabrics[0].curves[1].1.truncate(2)).contains("as many radii, found 4 and 2"));
    assert!(error(&|s| s.fabrics[0].curves[0].0.points[2].x = f64::NAN).contains("finite points"));
    assert!(error(&|s| s.ground = Some(GroundSetup { height: None, material: 0 })).contains("no material 0"));
    let light = |light: Light| error(&|s| s.lights.push(light.clone()));
    let sphere = |radius| Shape::Sphere { centre: Vec3A::ZERO, radius };
    let area = |shape, radiance| Light::Area(AreaLight { shape, radiance, two_sided: false, visible: true });
    assert!(light(area(sphere(0.0), Rgb::ONE)).contains("light 3: expected sizes above 0"));
    assert!(light(area(sphere(1.0), Rgb::splat(f32::NAN))).contains("light 3: expected finite light"));
    let at = |x| Light::Point { position: Vec3A::new(x, 0.0, 0.0), intensity: Rgb::ONE };
    assert!(light(at(f32::INFINITY)).contains("finite position"));
    let towards = |towards| Light::Distant { towards, one_minus_cos: 0.0, irradiance: Rgb::ONE };
    assert!(light(towards(Vec3A::splat(2.0))).contains("length 1"));
    let mesh = |change: &dyn Fn(&mut Mesh)| {
        let mut mesh = Mesh::cuboid(DVec3::ONE);
        change(&mut mesh);
        error(&|s| {
            let material =
                s.add_material(Material { surface: SurfaceMaterial::diffuse(Rgb::ONE), texture: None, holdout: false });
            s.objects.push(Object {
                name: "box".to_owned(),
                origin: "box".to_owned(),
                mesh: mesh.clone(),
                material,
                next: Vec::new(),
            });
        })
    };
    assert!(mesh(&|m| m.points[3].y = f64::NAN).contains("mesh `box`: expected finite points"));
    assert!(mesh(&|m| m.triangles[0][1] = 99).contains("triangles of them"));
    assert!(mesh(&|m| m.uvs.truncate(2)).contains("texture coordinates"));
    assert!(error(&|s| s.size(0, 48)).contains("at least one pixel"));
    assert!(error(&|s| s.yarns[0].fibers.clear()).contains("yarn `wool`"));
    assert!(error(&|s| s.yarns[0].plies[1].fibers = 0).contains("ply 2 is "));
    assert!(error(&|s| s.yarns[0].plies[0].radius = f64::NAN).contains("ply 1 is "));
    assert!(error(&|s| s.fabrics[0].phases.clear()).contains("phases"));
    assert!(error(&|s| s.fabrics[0].uvs = vec![Vec::new()]).contains("texture coordinates"));
    assert!(error(&|s| s.fabrics[0].motion.later = vec![vec![Vec::new()]]).contains("at all times"));
    let painted = |index: u16| {
        error(&|s| {
            s.fabrics[0].variants = vec![s.yarns[0].clone()];
            s.fabrics[0].material_indices = s.fabrics[0].curves.iter().map(|_| vec![index; 4]).collect();
            s.lights.push(at(f32::NAN));
        })
    };
    assert!(painted(1).contains("indices into its variants") && painted(0).contains("finite position"));
}

#[test]
fn yarns_have_plies_and_room_for_their_fibers() {
    let yarn = |plies, fibers, density| {
        let fiber = ("f".to_owned(), FiberMaterial::default());
        Yarn::of_equal_plies("y", 1.0, plies, fibers, density, [0.0; 2], fiber).map_err(|e| e.to_string())
    };
    assert_eq!(yarn(3, 40, 0.4).unwrap().plies.len(), 3);
    for (plies, fibers, density) in [(0, 40, 0.4), (65, 40, 0.4), (1, 0, 0.4), (1, 40, f64::NAN), (1, 4, 4.0)] {
        assert!(yarn(plies, fibers, density).is_err(), "{plies} {fibers} {density}");
    }
}
