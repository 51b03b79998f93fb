//! What one step of a path costs: random numbers, a section and its plies, a vertex, the filter in Embree's traversal.
//!
//! `cargo bench --bench parts`, with `-- section` for some of them. For changes of the code between two runs on an idle
//! machine; what documents claim is measured in turn by the scripts beside this file.

use divan::{Bencher, black_box, counter::ItemsCount};
use glam::{DVec3, Vec3A};
use yarnray::{
    cloth::{Cloth, scatterer},
    geometry::{
        ray::Ray,
        section::{Crossings, Section},
    },
    math::{
        Rgb,
        sampler::{Sampler, Stream},
    },
    pattern::straight,
    scattering::fiber::FiberMaterial,
    scene::{Fabric, Model, Scene, SceneBuilder, Yarn},
    trace::{HitPlace, World},
};

/// Inputs of one round, so that no branch learns its one answer.
const ROUND: usize = 1024;

fn main() {
    divan::main();
}

/// Two plies as wool has them, or as many as are asked for.
fn yarn(plies: u32) -> Yarn {
    let wool = FiberMaterial { r: [0.05; 3], tt: [0.6, 0.4, 0.3], d: [0.2, 0.1, 0.1], ..FiberMaterial::default() };
    let twists = [25f64.to_radians(), -15f64.to_radians()];
    Yarn::of_equal_plies("wool", 0.25, plies, 120, 0.35, twists, ("wool".to_owned(), wool)).expect("a sound yarn")
}

/// Ten straight yarns that touch each other.
fn straight_yarns(plies: u32) -> Scene {
    let mut scene = SceneBuilder::new("straight yarns");
    let kind = scene.add_yarn(yarn(plies));
    scene.fabrics.push(Fabric::new("yarns", kind, straight(10, 10.0, 0.5), 0.25, 1));
    scene.build().expect("a sound scene")
}

/// Rays from all sides at the middle of the cloth.
fn rays() -> Vec<Ray> {
    let mut stream = Stream::new(7);
    (0..ROUND)
        .map(|_| {
            let [x, y, z] = [(); 3].map(|()| 2.0 * f64::from(stream.next()) - 1.0);
            let from = DVec3::new(x, y, 0.2 + z.abs()).normalize();
            let at = DVec3::new(4.0 * f64::from(stream.next()) - 2.0, 4.0 * f64::from(stream.next()) - 2.0, 0.0);
            Ray::new((at + 20.0 * from).as_vec3a(), (-from).as_vec3a())
        })
        .collect()
}

fn world(scene: &Scene) -> World {
    Cloth::new(scene, 1).expect("memory").0.into_world()
}

/// What the rays see of the yarns.
fn sections<'a>(world: &'a World, rays: &[Ray]) -> Vec<Section<'a>> {
    let place = |ray| match world.intersect(ray)?.place {
        HitPlace::Yarn(section) => Some(section),
        _ => None,
    };
    rays.iter().filter_map(place).collect()
}

#[divan::bench]
fn sampler_set_of_four(bencher: Bencher<'_, '_>) {
    bencher
        .counter(ItemsCount::new(ROUND))
        .bench(|| (0..ROUND as u32).map(|index| Sampler::new(1, black_box(5), 3, index).next4()[2]).sum::<f32>());
}

#[divan::bench(args = [1, 2, 4])]
fn section_crossings(bencher: Bencher<'_, '_>, plies: u32) {
    let scene = straight_yarns(plies);
    let world = world(&scene);
    let sections = sections(&world, &rays());
    let shape = yarn(plies).shape();
    bencher.counter(ItemsCount::new(sections.len())).bench(|| {
        let mut crossings = Crossings::new();
        let met = |section: &Section<'_>| {
            section.crossings(&shape, &mut crossings);
            crossings.len()
        };
        black_box(&sections).iter().map(met).sum::<usize>()
    });
}

/// A scattering as the integrator uses it: the vertex, light from one direction, and the next direction.
#[divan::bench(args = [Model::Aggregated, Model::TwoStream, Model::Paper])]
fn vertex(bencher: Bencher<'_, '_>, model: &Model) {
    let scene = straight_yarns(2);
    let world = world(&scene);
    let sections = sections(&world, &rays());
    let scatterer = scatterer(&yarn(2), *model);
    let light = Vec3A::new(0.36, 0.48, 0.8);
    bencher.counter(ItemsCount::new(sections.len())).bench(|| {
        let mut crossings = Crossings::new();
        let mut sum = Rgb::ZERO;
        for (index, section) in black_box(&sections).iter().enumerate() {
            section.crossings(scatterer.shape(), &mut crossings);
            let passed = scatterer.transparency(&crossings);
            if passed >= 1.0 {
                continue;
            }
            let mut sampler = Sampler::new(3, 0, 0, index as u32);
            let (u, [a, b, c, _]) = (sampler.next4(), sampler.next4());
            let mut stream = sampler.even_stream();
            let vertex = scatterer.vertex(section, &crossings, passed, Rgb::ONE, u, &mut stream);
            sum += vertex.evaluate(section.to_local(light), 1.0, 0.5).lobes.sum();
            sum += vertex.sample([a, b, c], &mut stream).map_or(Rgb::ZERO, |next| next.weight);
        }
        sum
    });
}

#[divan::bench(args = [1, 2, 4])]
fn nearest_hit(bencher: Bencher<'_, '_>, plies: u32) {
    let scene = straight_yarns(plies);
    let world = world(&scene);
    let rays = rays();
    bencher
        .counter(ItemsCount::new(ROUND))
        .bench(|| black_box(&rays).iter().filter(|ray| world.intersect(ray).is_some()).count());
}

#[divan::bench(args = [1, 2, 4])]
fn shadow_ray(bencher: Bencher<'_, '_>, plies: u32) {
    let scene = straight_yarns(plies);
    let world = world(&scene);
    let rays = rays();
    bencher.counter(ItemsCount::new(ROUND)).bench(|| {
        let mut crossings = Crossings::new();
        black_box(&rays).iter().map(|ray| world.transmittance(ray, &mut crossings)).sum::<f32>()
    });
}
