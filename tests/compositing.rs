//! What compositors get.

use std::collections::BTreeMap;

use yarnray::image::{self, Attribute};

use crate::support::{Picture, SWATCH, directory, listing, program, read_json, render, write, yarnray};

/// The layers of light by where it came from.
const PARTS: [&str; 13] = [
    "emission",
    "surface_direct",
    "surface_indirect",
    "R_direct",
    "TT_direct",
    "D_direct",
    "F_direct",
    "B_direct",
    "R_indirect",
    "TT_indirect",
    "D_indirect",
    "F_indirect",
    "B_indirect",
];

/// The swatch above a floor, with the sky above the horizon. Its fibres send some of TT all round, so that no lobe is dark.
fn on_a_floor() -> String {
    let view = "direction = [0.25, 0.12, 1.0]\nmargin = 0.25";
    SWATCH.replace("direction = [0.25, -0.35, 1.0]", view).replace("beta_n = 25.0", "beta_n = 60.0")
        + "[ground]\nalbedo = [0.5, 0.4, 0.3]\n[output]\nlayers = [\"lobes\", \"albedo\"]\n"
}

/// The largest difference between the picture and the sum of its parts, over the pixel's value and a hundredth.
fn worst_sum(picture: &Picture) -> f64 {
    let mut worst = 0.0_f64;
    for c in ["R", "G", "B"] {
        let parts = PARTS.map(|p| picture.channel(&format!("{p}.{c}")));
        for (i, &total) in picture.channel(c).iter().enumerate() {
            let sum: f64 = parts.iter().map(|p| f64::from(p[i])).sum();
            worst = worst.max((sum - f64::from(total)).abs() / (f64::from(total) + 0.01));
        }
    }
    worst
}

#[test]
fn the_parts_of_light_add_up_to_the_picture() {
    let picture = render(&on_a_floor(), &["--spp", "16"]);
    let worst = worst_sum(&picture);
    assert!(worst < 2e-6, "in single precision: {worst:e}");
    for part in PARTS {
        let sum: f32 = picture.channel(&format!("{part}.G")).iter().sum();
        // A flat floor does not light itself.
        assert_eq!(sum > 0.0, part != "surface_indirect", "{part}: {sum}");
    }
    let half = render(&on_a_floor(), &["--spp", "16", "--set", "output.lobe_precision=half"]);
    let worst = worst_sum(&half);
    // Half precision keeps eleven binary digits of every part.
    assert!(worst > 2e-6 && worst < 6e-4, "in half precision: {worst:e}");
    assert_eq!(half.channel("G"), picture.channel("G"));
}

/// The swatch on a floor under a sky, a lamp that the camera sees, a sun and a point, in three groups; every kind of light finds its way.
fn in_groups() -> String {
    let lights = "
[[light]]
type = \"environment\"
radiance = [0.2, 0.3, 0.4]
group = \"sky\"

[[light]]
type = \"rectangle\"
position = [-30, 40, 30]
size = [30, 30]
radiance = 6
group = \"key\"

[[light]]
type = \"distant\"
towards = [0.5, 0.6, 0.4]
irradiance = [1.5, 1.2, 0.9]

[[light]]
type = \"point\"
position = [0, 40, 20]
intensity = 600
group = \"key\"
";
    let swatch = on_a_floor();
    let (before, rest) = swatch.split_once("[[light]]").unwrap();
    let after = rest.find("\n[").map_or("", |next| &rest[next..]);
    format!("{before}{lights}{after}").replace("[\"lobes\", \"albedo\"]", "[\"light_groups\", \"lobes\"]")
}

#[test]
fn groups_of_lights_add_up_to_the_picture() {
    let picture = render(&in_groups(), &["--spp", "16"]);
    let groups = ["sky", "key", "others"];
    for c in ["R", "G", "B"] {
        let layers = groups.map(|group| picture.channel(&format!("light_{group}.{c}")));
        for (i, &total) in picture.channel(c).iter().enumerate() {
            let sum: f64 = layers.iter().map(|layer| f64::from(layer[i])).sum();
            let worst = (sum - f64::from(total)).abs() / (f64::from(total) + 0.01);
            assert!(worst < 2e-6, "{c} of pixel {i}: {sum} of {total}");
        }
    }
    // Each is what its lights give alone.
    for (group, others) in [("sky", ["key", "others"]), ("key", ["sky", "others"]), ("others", ["sky", "key"])] {
        let mut alone = in_groups();
        for light in alone.clone().split("[[light]]").skip(1) {
            let body = &light[..light.find("\n[").unwrap_or(light.len())];
            let of = others.iter().any(|other| match *other {
                "others" => !body.contains("group ="),
                name => body.contains(&format!("group = \"{name}\"")),
            });
            if of {
                alone = alone.replace(&format!("[[light]]{body}"), "");
            }
        }
        let alone = render(&alone, &["--spp", "64"]);
        let mean = |picture: &Picture, name: &str| {
            let all = picture.channel(name);
            f64::from(all.iter().sum::<f32>()) / all.len() as f64
        };
        let (part, whole) = (mean(&picture, &format!("light_{group}.G")), mean(&alone, "G"));
        assert!(whole > 0.01 && (part / whole - 1.0).abs() < 0.05, "{group}: {part} beside {whole}");
    }
}

#[test]
fn a_film_keeps_groups_of_lights() {
    let directory = directory();
    write(directory.path(), "s.toml", in_groups());
    let size = ["-q", "--spp", "4", "--width", "40", "--height", "30"];
    let run = |args: &[&str]| yarnray(directory.path(), &[args, &size].concat());
    run(&["render", "s.toml", "-o", "whole.exr"]).good();
    for part in ["1/2", "2/2"] {
        run(&["render", "s.toml", "--shard", part, "-o", &format!("{}.film", &part[..1])]).good();
    }
    yarnray(directory.path(), &["merge", "1.film", "2.film", "-o", "merged.exr"]).good();
    let [whole, merged] = ["whole.exr", "merged.exr"].map(|name| image::read(&directory.path().join(name)).unwrap());
    assert!(whole.channels.iter().any(|channel| channel.name == "light_key.G"));
    assert!(whole.channels == merged.channels);
    // Lights in other groups are another picture for it.
    write(directory.path(), "s.toml", in_groups().replace("\"key\"", "\"fill\""));
    run(&["render", "s.toml", "--shard", "2/2", "-o", "2.film"]).good();
    let told = yarnray(directory.path(), &["merge", "1.film", "2.film", "-o", "merged.exr"]);
    assert!(told.status != Some(0) && told.stderr.contains("light.group"), "{}", told.stderr);
}

#[test]
fn a_holdout_takes_away_what_is_behind_it_and_lights_as_ever() {
    let mesh = "
[[mesh]]
shape = \"box\"
size = [6, 400, 6]
translate = [0, 0, 25]
albedo = 0.8
";
    let scene = |holdout: bool| format!("{}{mesh}holdout = {holdout}\n", on_a_floor());
    let args = ["--spp", "16", "--set", "output.layers=[\"depth\"]"];
    let [shown, held] = [false, true].map(|holdout| render(&scene(holdout), &args));
    let [a, b] = [&shown, &held].map(|picture| picture.channel("A"));
    let [c, d] = [&shown, &held].map(|picture| picture.channel("G"));
    let depth = held.channel("depth.Z");
    let mut gone = 0;
    for i in 0..a.len() {
        if b[i] == 0.0 && a[i] == 1.0 {
            gone += 1;
            assert_eq!((d[i], depth[i]), (0.0, 0.0), "nothing of what is there or behind is seen in pixel {i}");
        } else if a[i] == b[i] {
            assert_eq!(c[i], d[i], "light and shadow of it stay in pixel {i}");
        }
    }
    assert!(gone > 20, "{gone} pixels");
}

#[test]
fn direct_light_is_what_remains_with_one_scattering() {
    let args = ["--spp", "16", "--set", "render.max_bounces=1"];
    let once = render(&on_a_floor(), &args);
    let all = render(&on_a_floor(), &["--spp", "16"]);
    for part in PARTS {
        let mean = |p: &Picture| p.channel(&format!("{part}.G")).iter().sum::<f32>() / 1728.0;
        let (once, all) = (mean(&once), mean(&all));
        if part.ends_with("_indirect") {
            assert!(once == 0.0 && (all > 0.0 || part == "surface_indirect"), "{part}: {once} of {all}");
        } else {
            assert!((once - all).abs() < 1e-5 * all, "{part}: {once}, of {all}");
        }
    }
}

#[test]
fn a_matte_floor_and_an_empty_sky_have_the_guides_they_should() {
    let picture = render(&on_a_floor(), &["--spp", "4"]);
    let albedo = ["R", "G", "B"].map(|c| picture.channel(&format!("albedo.{c}")));
    let alpha = picture.channel("A");
    assert!(albedo.iter().all(|c| c.iter().all(|v| (0.0..=1.0).contains(v))));
    for i in 0..alpha.len() {
        if alpha[i] == 0.0 {
            assert_eq!(albedo.map(|c| c[i]), [0.0; 3], "nothing is there");
        }
    }
    // One fibre of the wool, and the floor.
    let near = |i: usize, want: [f32; 3]| (0..3).all(|c| (albedo[c][i] - want[c]).abs() < 1e-5);
    assert!((0..alpha.len()).any(|i| near(i, [0.97, 0.94, 0.86])));
    assert!((0..alpha.len()).any(|i| near(i, [0.5, 0.4, 0.3])));
}

#[test]
fn every_compression_holds_the_same_picture() {
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    let picture = |name: &str, args: &[&str]| {
        let out = format!("{name}.exr");
        let all = [&["render", "s.toml", "-q", "--spp", "1", "-o", &out], args].concat();
        yarnray(directory.path(), &all).good();
        image::read(&directory.path().join(out)).unwrap()
    };
    let plain = picture("plain", &[]);
    for name in ["zips", "zip", "piz", "rle", "none"] {
        let other = picture(name, &["--set", &format!("output.compression={name}")]);
        assert!(other.channels == plain.channels, "{name}");
        assert!(matches!(other.attribute("software"), Some(Attribute::Text(_))));
    }
}

/// A Cryptomatte layer, decoded by the words of the specification.
struct Matte {
    /// Names by the bits of their identifiers.
    names: BTreeMap<u32, String>,
    /// For each pixel what covers it, by name, and how much.
    pixels: Vec<BTreeMap<String, f32>>,
}

fn matte(picture: &Picture, layer: &str) -> Matte {
    let attributes = &picture.image.attributes;
    let text = |name: &str| match picture.image.attribute(name) {
        Some(Attribute::Text(text)) => text.as_str(),
        other => panic!("{name}: {other:?}"),
    };
    let key = attributes
        .iter()
        .find_map(|(name, value)| {
            let key = name.strip_prefix("cryptomatte/")?.strip_suffix("/name")?;
            (*value == Attribute::Text(layer.into())).then_some(key)
        })
        .expect("the layer is announced");
    assert!(key.len() == 7 && key.bytes().all(|b| b.is_ascii_hexdigit()), "{key}");
    assert_eq!(text(&format!("cryptomatte/{key}/hash")), "MurmurHash3_32");
    assert_eq!(text(&format!("cryptomatte/{key}/conversion")), "uint32_to_float32");
    let manifest: BTreeMap<String, String> =
        serde_json::from_str(text(&format!("cryptomatte/{key}/manifest"))).expect("a manifest");
    let names: BTreeMap<u32, String> =
        manifest.into_iter().map(|(name, id)| (u32::from_str_radix(&id, 16).unwrap(), name)).collect();
    let channel = |pair: usize, part: &str| picture.channel(&format!("{layer}{pair:02}.{part}"));
    let pixels = (0..picture.channel("R").len()).map(|i| {
        let mut covered = BTreeMap::new();
        let mut before = f32::INFINITY;
        for (pair, id, coverage) in (0..3).flat_map(|pair| [(pair, "R", "G"), (pair, "B", "A")]) {
            let (id, coverage) = (channel(pair, id)[i], channel(pair, coverage)[i]);
            assert!((0.0..=before).contains(&coverage), "ranks go down");
            before = coverage;
            if coverage > 0.0 {
                let name = names.get(&id.to_bits()).expect("the manifest has every name");
                assert_eq!(covered.insert(name.clone(), coverage), None, "{name} is there twice");
            } else {
                assert_eq!(id, 0.0);
            }
        }
        covered
    });
    let pixels = pixels.collect();
    Matte { names, pixels }
}

/// Panels that a table names are a matte of that name; others are the garment's.
#[test]
fn mattes_tell_panels_apart_by_their_names() {
    let folder = directory();
    let panel = |x: u32| {
        let corners = [(x, 0), (x + 4, 0), (x + 4, 4), (x, 4)];
        let places: String = corners.map(|(x, y)| format!("v {x} {y} 0\n")).concat();
        let flat: String = corners.map(|(x, y)| format!("vt {x} {y}\n")).concat();
        places + &flat
    };
    let faces = "g body\nf 1/1 2/2 3/3 4/4\ng rib\nf 5/5 6/6 7/7 8/8\ng cuff\nf 9/9 10/10 11/11 12/12\n";
    write(folder.path(), "g.obj", panel(0) + &panel(6) + &panel(12) + faces);
    let scene = "[render]\nwidth = 48\nheight = 16\nspp = 4\n[output]\nlayers = [\"cryptomatte\"]\n[[fabric]]\nname = \"shirt\"\n\
                 yarn = \"wool\"\nsource = { type = \"garment\", path = \"g.obj\", unit = \"cm\", cloth = { type = \"knit\" } }\n\
                 [[fabric.panel]]\ngroup = \"rib\"\nname = \"ribs\"\n[[fabric.panel]]\ngroup = \"cuff\"\n";
    write(folder.path(), "s.toml", scene);
    yarnray(folder.path(), &["render", "s.toml", "-q", "-o", "s.exr"]).good();
    let image = image::read(&folder.path().join("s.exr")).unwrap();
    let picture = Picture { image, stats: serde_json::Value::Null };
    let names: std::collections::BTreeSet<String> = matte(&picture, "CryptoFabric").names.into_values().collect();
    assert_eq!(names, ["shirt", "ribs", "shirt_2"].map(String::from).into());
}

#[test]
fn mattes_tell_fabrics_yarns_and_plies_apart() {
    let scene = SWATCH.replace("yarn = \"wool3\"\n", "name = \"front\"\nyarn = \"wool3\"\n")
        + "[[fabric]]\nyarn = \"wool3\"\ntranslate = [0, 0, -4]\n\
           source = { type = \"straight\", count = 12, length = 30, spacing = 2.5 }\n";
    let picture = render(&scene, &["--spp", "16", "--set", "output.layers=cryptomatte"]);
    let [fabric, yarn, ply] = ["CryptoFabric", "CryptoYarn", "CryptoPly"].map(|layer| matte(&picture, layer));
    assert_eq!(
        fabric.names.values().cloned().collect::<std::collections::BTreeSet<_>>(),
        ["front", "wool3"].map(String::from).into()
    );
    assert!(yarn.names.values().any(|n| n == "front/yarn0"), "{:?}", yarn.names);
    assert!(ply.names.values().any(|n| n == "wool3/yarn5/ply2"), "{:?}", ply.names);
    let alpha = picture.channel("A");
    let mut mixed = 0;
    for (i, &covered) in alpha.iter().enumerate() {
        let sum = |m: &Matte| m.pixels[i].values().sum::<f32>();
        assert!((sum(&fabric) - covered).abs() < 1e-6, "pixel {i}");
        // Six plies are kept; where there are no more, they make up their yarns.
        if ply.pixels[i].len() < 6 {
            for (level, of) in [(&fabric, &yarn), (&yarn, &ply)] {
                let mut made: BTreeMap<String, f32> = BTreeMap::new();
                for (name, coverage) in &of.pixels[i] {
                    *made.entry(name.rsplit_once('/').unwrap().0.to_owned()).or_default() += coverage;
                }
                assert_eq!(made, level.pixels[i], "pixel {i}: coverages are sixteenths, so sums are exact");
            }
        }
        mixed += usize::from(yarn.pixels[i].len() > 1);
    }
    assert!(mixed > 50, "edges hold several yarns: {mixed}");
}

#[test]
fn mattes_hold_meshes_and_the_ground() {
    let scene = on_a_floor().replace("\"lobes\", \"albedo\"", "\"cryptomatte\"")
        + "[[mesh]]\nshape = \"sphere\"\nradius = 4\ntranslate = [12, 0, 0]\n\
           [[mesh]]\nname = \"head\"\nshape = \"box\"\nsize = [6, 6, 6]\ntranslate = [-12, 0, 0]\n";
    let folder = directory();
    write(folder.path(), "s.toml", scene);
    let run = |args: &str| {
        yarnray(folder.path(), &args.split_whitespace().collect::<Vec<_>>()).good();
        let image = image::read(&folder.path().join("s.exr")).unwrap();
        Picture { image, stats: serde_json::Value::Null }
    };
    let picture = run("render s.toml -q --spp 8 -o s.exr");
    let [fabric, yarn, ply] = ["CryptoFabric", "CryptoYarn", "CryptoPly"].map(|layer| matte(&picture, layer));
    let names: std::collections::BTreeSet<&str> = fabric.names.values().map(String::as_str).collect();
    assert_eq!(names, ["wool3", "sphere", "head", "ground"].into());
    assert!(yarn.names.values().chain(ply.names.values()).all(|name| name.starts_with("wool3/")));
    let mut met = BTreeMap::new();
    for (pixels, &covered) in fabric.pixels.iter().zip(picture.channel("A")) {
        let sum: f32 = pixels.values().sum();
        assert!((sum - covered).abs() < 1e-6, "{sum} of {covered}");
        pixels.keys().for_each(|name| *met.entry(name.clone()).or_insert(0) += 1);
    }
    assert!(names.iter().all(|&name| met[name] > 10), "{met:?}");
    // A film keeps their names.
    yarnray(folder.path(), &["render", "s.toml", "-q", "--spp", "8", "-o", "s.film"]).good();
    let merged = run("merge -q s.film -o s.exr");
    assert_eq!(matte(&merged, "CryptoFabric").pixels, fabric.pixels);
}

#[test]
fn a_denoised_picture_is_a_layer_or_a_file_of_its_own() {
    let directory = directory();
    let path = directory.path();
    write(path, "s.toml", SWATCH);
    let args = ["render", "s.toml", "-q", "--spp", "4", "-o", "a.exr", "-o", "a.png", "--stats", "a.json"];
    yarnray(path, &args).good();
    let plain = image::read(&path.join("a.exr")).unwrap();
    let noise = read_json(&path.join("a.json"))["noise"]["rel_mse_estimate"].clone();
    let png = std::fs::read(path.join("a.png")).unwrap();
    let run = yarnray(path, &[&args[..], &["--denoise"]].concat());
    if run.status == Some(2) && run.stderr.contains("cannot be loaded") {
        crate::support::skipped("Open Image Denoise is not installed");
        return;
    }
    run.good();
    assert_eq!(listing(path), ["a.denoised.png", "a.exr", "a.json", "a.png", "s.toml"]);
    let both = image::read(&path.join("a.exr")).unwrap();
    assert!(
        matches!(both.attribute("yarnray.denoised"), Some(Attribute::Text(by)) if by.starts_with("Open Image Denoise 2."))
    );
    for channel in &plain.channels {
        assert!(both.channel(&channel.name) == Some(&channel.samples), "{} changes", channel.name);
    }
    let denoised = both.layer_rgb("denoised").expect("the layer");
    let mean = |c: &[f32]| c.iter().sum::<f32>() / c.len() as f32;
    for (clean, noisy) in denoised.iter().zip(plain.rgb().unwrap()) {
        assert!((mean(clean) / mean(noisy) - 1.0).abs() < 0.05 && *clean != noisy);
    }
    assert_eq!(
        read_json(&path.join("a.json"))["noise"]["rel_mse_estimate"],
        noise,
        "figures are of the rendered picture"
    );
    assert_eq!(std::fs::read(path.join("a.png")).unwrap(), png);
}

#[test]
fn where_there_is_no_denoiser_a_message_says_how_to_get_it() {
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    let mut command = program(directory.path());
    command.env("OIDN_DIR", directory.path()).args(["render", "s.toml", "-o", "a.exr", "--set", "output.denoise=true"]);
    let output = command.output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.starts_with("error: denoising needs Open Image Denoise 2, which cannot be loaded ("), "{message}");
    assert!(message.contains("set OIDN_DIR to its folder"), "{message}");
    assert_eq!(listing(directory.path()), ["s.toml"]);
}

#[test]
fn a_viewer_sees_the_picture_and_a_missing_one_is_no_harm() {
    let directory = directory();
    write(directory.path(), "s.toml", SWATCH);
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let viewer = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut listener.accept().unwrap().0, &mut bytes).unwrap();
        bytes
    });
    let args = ["render", "s.toml", "--spp", "2", "-o", "a.exr", "--display", &address];
    let run = yarnray(directory.path(), &args).good();
    assert!(!run.stderr.contains("viewer"), "{}", run.stderr);
    let bytes = viewer.join().unwrap();
    assert!(bytes.len() > 48 * 36 * 16 && bytes.windows(6).any(|w| w == b"s.toml"), "{} bytes", bytes.len());
    // The listener is gone with its thread.
    let run = yarnray(directory.path(), &args).good();
    assert!(run.stderr.contains(&format!("warning: the viewer at {address}: ")), "{}", run.stderr);
}
