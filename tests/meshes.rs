//! Meshes and the materials of surfaces.

use crate::support::{difference, directory, render, render_file, write};

const CAMERA: &str = "camera = { type = \"perspective\", position = [0, 30, 60], target = [0, 4, 0], fov = 30 }\n";

#[test]
fn white_things_under_a_white_sky_are_as_bright_as_the_sky() {
    let scene = format!(
        "render = {{ width = 40, height = 30, spp = 64, max_bounces = 1000 }}\n{CAMERA}\
         ground = {{ height = 0, material = \"glaze\" }}\n\
         [material.chalk]\nalbedo = 1\n\
         [material.glaze]\ntype = \"coated\"\nalbedo = 1\nroughness = 0.4\n\
         [material.lacquer]\ntype = \"coated\"\nalbedo = 1\nroughness = 0.1\nior = 1.8\n\
         [[mesh]]\nshape = \"sphere\"\nradius = 5\ntranslate = [-6, 5, 0]\nmaterial = \"lacquer\"\n\
         [[mesh]]\nshape = \"cylinder\"\nradius = 4\nheight = 8\ntranslate = [5, 4, 2]\nmaterial = \"glaze\"\n\
         [[mesh]]\nshape = \"box\"\nsize = [6, 6, 6]\nrotate = [0, 30, 0]\ntranslate = [0, 3, -9]\nmaterial = \"chalk\"\n\
         [[light]]\ntype = \"environment\"\n"
    );
    let picture = render(&scene, &[]);
    let mean = picture.mean();
    assert!(mean.iter().all(|m| (m - 1.0).abs() < 0.006), "{mean:?}");
    assert!(picture.colors().iter().flatten().all(|c| (c - 1.0).abs() < 0.25), "an edge loses or makes light");
    assert_eq!(picture.stats["invalid_samples"], 0);
}

#[test]
fn a_wide_plane_is_as_the_ground() {
    let with = |floor: &str| {
        let scene = format!(
            "render = {{ width = 32, height = 24, spp = 128 }}\n{CAMERA}{floor}\
             [[mesh]]\nshape = \"sphere\"\nradius = 6\ntranslate = [0, 6, 0]\nalbedo = [0.8, 0.3, 0.2]\n\
             [[light]]\ntype = \"environment\"\nradiance = 0.3\n\
             [[light]]\ntype = \"disk\"\nposition = [20, 40, 10]\nradius = 8\nradiance = 9\nvisible = false\n"
        );
        render(&scene, &[])
    };
    let ground = with("ground = { height = 0, albedo = 0.6 }\n");
    let plane = with("[[mesh]]\nshape = \"plane\"\nsize = [20000, 20000]\nalbedo = 0.6\n");
    let off = difference(&ground, &plane);
    assert!(off < 0.03, "{off}");
    // The ball throws a shadow and reflects red light onto the floor.
    let colors = ground.colors();
    let below = colors[20 * 32 + 12];
    assert!(below[0] > 1.01 * below[2], "{below:?}");
}

#[test]
fn a_lit_triangle_has_the_radiance_of_lamberts_law() {
    let directory = directory();
    // Two units of the file are a millimetre; z is up in it.
    let obj = "v -100 -100 0\nv 100 -100 0\nv 100 100 0\nv -100 100 0\nf 1 2 3 4\n";
    write(directory.path(), "square.obj", obj);
    let scene = "render = { width = 8, height = 8, spp = 4 }\n\
        camera = { type = \"orthographic\", position = [0, 50, 0], target = [0, 0, 0], up = [0, 0, -1], size = 4 }\n\
        [[mesh]]\npath = \"square.obj\"\nunit = \"cm\"\nscale = 0.05\nup = \"z\"\nalbedo = [0.9, 0.5, 0.1]\n\
        translate = [0, 3, 0]\n\
        [[light]]\ntype = \"distant\"\ntowards = [0, 1, 1]\nirradiance = 4\n";
    let picture = render_file(&write(directory.path(), "s.toml", scene), &[]);
    for color in picture.colors() {
        for (c, albedo) in color.iter().zip([0.9, 0.5, 0.1]) {
            let want = albedo / std::f64::consts::PI * 4.0 * 0.5f64.sqrt();
            assert!((c / want - 1.0).abs() < 1e-4, "{c}, not {want}");
        }
    }
    assert!(picture.channel("depth.Z").iter().all(|d| (d - 47.0).abs() < 1e-3));
    assert!(picture.channel("N.Y").iter().all(|n| *n > 0.999));
}

#[test]
fn meshes_hide_cloth_and_cloth_hides_meshes() {
    let scene = |z: i32| {
        format!(
            "render = {{ width = 24, height = 24, spp = 4 }}\n\
             camera = {{ type = \"orthographic\", position = [0, 0, 50], target = [0, 0, 0], size = 4 }}\n\
             [fiber.f]\nr = 0.2\ntt = 0.3\nd = 0.2\n[yarn.y]\nradius = 5\nfiber = \"f\"\nfibers = 300\ndensity = 0.5\n\
             [[fabric]]\nyarn = \"y\"\nsource = {{ type = \"straight\", length = 60 }}\n\
             [[mesh]]\nshape = \"box\"\nsize = [30, 30, 1]\ntranslate = [0, 0, {z}]\nalbedo = [0.9, 0, 0]\n\
             [[light]]\ntype = \"environment\"\n"
        )
    };
    let front = render(&scene(10), &[]);
    assert!(front.colors().iter().all(|c| c[0] > 0.3 && c[1] < 1e-6), "the red box is in front");
    assert_eq!(front.stats["mean_bounces"], 0.0);
    let behind = render(&scene(-10), &[]);
    assert!(behind.mean()[1] > 0.1, "the yarn is in front");
    assert!(behind.stats["used"].as_array().unwrap().iter().any(|f| f == "meshes"));
}
