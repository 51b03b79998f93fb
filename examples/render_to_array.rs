//! Renders a scene that is built in code, without files or text, to an array of pixels.
//!
//! `cargo run --release --example render_to_array`

use std::{error::Error, sync::atomic::AtomicBool};

use glam::DVec3;
use yarnray::{
    cloth::Cloth,
    light::{AreaLight, Environment, Light, Shape},
    math::Rgb,
    pattern::straight,
    render,
    scattering::fiber::FiberMaterial,
    scene::{Fabric, SceneBuilder, Yarn},
};

fn main() -> Result<(), Box<dyn Error>> {
    // A red fibre: albedos of R, TT and D for each channel; widths are the defaults.
    let wool = FiberMaterial { r: [0.05; 3], tt: [0.6, 0.1, 0.1], d: [0.2, 0.05, 0.05], ..FiberMaterial::default() };

    let mut scene = SceneBuilder::new("three yarns");
    scene.size(64, 48);
    scene.render.spp = 16;
    // 0.5 mm thick; two plies of 80 fibres each, twisted by 25 degrees one way and their fibres by 15 the other.
    let twists = [25f64.to_radians(), -15f64.to_radians()];
    let yarn = Yarn::of_equal_plies("wool", 0.25, 2, 80, 0.3, twists, ("wool".to_owned(), wool))?;
    let kind = scene.add_yarn(yarn);
    scene.fabrics.push(Fabric::new("yarns", kind, straight(3, 4.0, 0.6), 0.25, 1));
    scene.lights.push(Light::Environment(Environment { radiance: Rgb::splat(0.3), image: None, visible: false }));
    let shape = Shape::Sphere { centre: DVec3::new(3.0, 5.0, 4.0).as_vec3a(), radius: 1.0 };
    scene.lights.push(Light::Area(AreaLight { shape, radiance: Rgb::splat(200.0), two_sided: false, visible: false }));
    let scene = scene.build()?;

    let (cloth, _) = Cloth::new(&scene, 1)?;
    let film = render::render(&scene, &cloth, &AtomicBool::new(false), |_| {})?.film;

    // Linear Rec.709 radiance, row by row from the top; alpha is the share of each pixel that yarns cover.
    let pixels: Vec<[f32; 4]> = (0..film.height)
        .flat_map(|y| (0..film.width).map(move |x| (x, y)))
        .map(|(x, y)| film.pixel(x, y))
        .map(|p| [p.color[0], p.color[1], p.color[2], p.alpha])
        .collect();

    let mean = |c: usize| pixels.iter().map(|p| p[c]).sum::<f32>() / pixels.len() as f32;
    println!("{} x {} pixels, {} yarns", film.width, film.height, scene.fabrics[0].curves.len());
    println!("mean colour {:.4} {:.4} {:.4}, coverage {:.3}", mean(0), mean(1), mean(2), mean(3));
    // A look at it: dark to bright, one character for two pixels.
    for row in pixels.chunks(film.width as usize).step_by(2) {
        let line: String = row.iter().map(|p| b" .:-=+*#%@"[((p[0] * 9.0) as usize).min(9)] as char).collect();
        println!("{line}");
    }
    Ok(())
}
