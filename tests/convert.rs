//! Curve files from one format to another, and stages in scenes, by the program itself.

use std::fs;

use crate::support::{directory, project, read_json, write, yarnray};

#[test]
fn cloth_goes_round_through_every_format() {
    let folder = directory();
    let at = folder.path();
    yarnray(at, &["make", "knit", "--stitches", "4", "--rows", "4", "-o", "a.txt", "-o", "a.usdc", "-q"]).good();
    for (from, to) in [("a.usdc", "b.usda"), ("b.usda", "c.hair"), ("c.hair", "d.usd"), ("d.usd", "e.txt")] {
        yarnray(at, &["convert", from, to]).good();
    }
    let numbers = |name: &str| -> Vec<f64> {
        let text = fs::read_to_string(at.join(name)).unwrap();
        text.split_whitespace().filter_map(|word| word.parse().ok()).collect()
    };
    let (first, last) = (numbers("a.txt"), numbers("e.txt"));
    assert_eq!(first.len(), last.len());
    assert!(first.iter().zip(&last).all(|(a, b)| (a - b).abs() < 1e-4), "points and radii are those of the first file");
}

#[test]
fn what_is_lost_is_said_and_nothing_is_half_written() {
    let folder = directory();
    let at = folder.path();
    let matrix = project("tests/data/stages/matrix.usda");
    let matrix = matrix.to_str().unwrap();
    let lost = yarnray(at, &["convert", matrix, "a.bcc", "--prim", "/bspline_pinned_vertex"]).good().stderr;
    assert!(lost.contains("radii are lost") && lost.contains("unit is lost"), "{lost}");
    let guessed = yarnray(at, &["convert", "a.bcc", "g.usda"]).good().stderr;
    assert!(
        guessed.contains("taken for millimetres") && guessed.contains("curves without a radius have 0.5"),
        "{guessed}"
    );
    let said = yarnray(at, &["convert", "a.bcc", "g.usda", "--unit", "cm", "--radius", "0.1"]).good().stderr;
    assert!(!said.contains("millimetres") && !said.contains("radius"), "{said}");
    // Numbers that only some curves have.
    let curve = |name: &str, more: &str| {
        format!(
            "def BasisCurves \"{name}\" {{\nuniform token type = \"linear\"\nint[] curveVertexCounts = [2]\n\
             point3f[] points = [(0,0,0), (1,0,0)]\nfloat[] widths = [1, 1]\n{more}}}\n"
        )
    };
    let numbered = curve("a", "int[] primvars:yarnId = [50]\n");
    write(at, "some.usda", format!("#usda 1.0\n{numbered}{}", curve("b", "")));
    write(at, "all.usda", format!("#usda 1.0\n{numbered}"));
    for (from, lost) in [("some.usda", true), ("all.usda", false)] {
        let said = yarnray(at, &["convert", from, "g.usda"]).good().stderr;
        assert_eq!(said.contains("ids are lost: not all curves have one"), lost, "{from}: {said}");
    }
    for name in ["a.bcc", "g.usda"] {
        fs::remove_file(at.join(name)).unwrap();
    }
    for (arguments, expected) in [
        (vec!["convert", matrix, "b.bcc", "--prim", "/nothing"], "curves here: /linear_nonperiodic"),
        (vec!["convert", matrix, "b.bcc", "--prim", "nothing"], "begins with /"),
        (vec!["convert", matrix, "b.xyz"], "expected a name that ends in"),
        (vec!["convert", matrix, "b.bcc", "--unit", "cm"], "leave --unit out"),
        (vec!["convert", "missing.usda", "b.bcc"], "no such file"),
    ] {
        let refused = yarnray(at, &arguments);
        assert_eq!(refused.status, Some(2), "{arguments:?}");
        assert!(refused.stderr.contains(expected), "{arguments:?}: {}", refused.stderr);
        assert!(!at.join("b.bcc").exists());
    }
}

#[test]
fn scenes_take_curves_meshes_and_cameras_of_stages() {
    let folder = directory();
    let stages = project("tests/data/stages");
    let stages = stages.to_str().unwrap();
    let scene = format!(
        "camera = {{ type = \"usd\", path = \"{stages}/scene.usda\", prim = \"/rig/camera\" }}\n\
         [render]\nwidth = 8\nheight = 8\nspp = 1\n\
         [fiber.wool]\nr = [0.1, 0.1, 0.1]\ntt = [0.3, 0.3, 0.3]\nd = [0.3, 0.3, 0.3]\nbeta_r = 8\nbeta_tt = 8\nbeta_n = 20\n\
         [yarn.one]\nradius = 0.3\nplies = 2\nfiber = \"wool\"\nfibers = 30\ndensity = 0.3\n\
         [[fabric]]\nyarn = \"one\"\nsource = {{ type = \"file\", path = \"{stages}/scene.usda\", prim = \"/moving\" }}\n\
         [[fabric]]\nyarn = \"one\"\nsource = {{ type = \"file\", path = \"{stages}/scene.abc\", prim = \"/place\", unit = \"mm\" }}\n\
         [[mesh]]\npath = \"{stages}/mesh.usda\"\nprim = \"/panels\"\n\
         [[mesh]]\npath = \"{stages}/scene.abc\"\nunit = \"mm\"\n\
         [[light]]\ntype = \"environment\"\nradiance = 1\n"
    );
    write(folder.path(), "s.toml", scene);
    yarnray(folder.path(), &["render", "s.toml", "-o", "s.exr", "-q", "--stats", "s.json"]).good();
    let stats = read_json(&folder.path().join("s.json"));
    assert_eq!(stats["curves"]["yarns"], 9);
}

/// Programs bind materials to subsets of their own, which lie across those of the panels: both name panels.
#[test]
fn panels_are_named_by_subsets_of_any_family() {
    let folder = directory();
    let at = folder.path();
    let subset = |name: &str, family: &str, faces: &str| {
        format!(
            "def GeomSubset \"{name}\" {{\nuniform token familyName = \"{family}\"\nint[] indices = [{faces}]\n}}\n"
        )
    };
    let subsets = [("body", "panel", "0"), ("rib", "panel", "1"), ("cuff", "panel", "2")]
        .map(|(name, family, faces)| subset(name, family, faces))
        .concat()
        + &subset("wool", "materialBind", "0, 1")
        + &subset("silk", "materialBind", "2");
    let points = "(0,0,0), (4,0,0), (4,4,0), (0,4,0), (6,0,0), (10,0,0), (10,4,0), (6,4,0), (12,0,0), (16,0,0), (16,4,0), (12,4,0)";
    let flat = points.replace(",0)", ")");
    write(
        at,
        "g.usda",
        format!(
            "#usda 1.0\ndef Mesh \"m\" {{\nint[] faceVertexCounts = [4, 4, 4]\n\
             int[] faceVertexIndices = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]\npoint3f[] points = [{points}]\n\
             texCoord2f[] primvars:st = [{flat}] (\ninterpolation = \"vertex\"\n)\n{subsets}}}\n"
        ),
    );
    let panels = |group: &str| {
        let scene = "[[fabric]]\nyarn = \"wool\"\nsource = { type = \"garment\", path = \"g.usda\", cloth = { type = \"knit\" } }\n";
        write(at, "s.toml", format!("{scene}[[fabric.panel]]\ngroup = \"{group}\"\nname = \"own\"\n"));
        yarnray(at, &["info", "s.toml"])
    };
    for group in ["body", "rib", "cuff", "wool", "silk"] {
        panels(group).good();
    }
    let none = panels("linen").stderr;
    assert!(none.contains("it has: body, cuff, rib, silk, wool"), "{none}");
}

/// What a stage holds is told with the names by which a scene chooses it; that it moves is no warning of a render.
#[test]
fn stages_tell_what_they_hold() {
    let folder = directory();
    let at = folder.path();
    write(
        at,
        "shot.usda",
        "#usda 1.0\n(\nstartTimeCode = 1\nendTimeCode = 3\nmetersPerUnit = 0.001\n)\ndef BasisCurves \"yarn\" {\n\
         uniform token type = \"linear\"\nint[] curveVertexCounts = [2]\n\
         point3f[] points.timeSamples = { 1: [(0,0,0), (20,0,0)], 3: [(0,2,0), (20,2,0)] }\n}\n\
         def Camera \"shot\" {\n}\ndef DistantLight \"key\" {\n}\ndef DomeLight_1 \"sky\" {\n}\n",
    );
    let told = yarnray(at, &["info", "shot.usda"]).good().stdout;
    for line in ["frames    1 to 3", "curves in /yarn", "cameras   /shot", "lights    /key and /sky; not read"] {
        assert!(told.contains(line), "{line}: {told}");
    }
    let scene = "[render]\nwidth = 8\nheight = 8\nspp = 1\n[[fabric]]\nyarn = \"wool\"\n\
                 source = { type = \"file\", path = \"shot.usda\" }\n";
    write(at, "s.toml", scene);
    let render = yarnray(at, &["render", "s.toml", "-o", "s.####.exr", "--frames", "2..3"]).good().stderr;
    assert!(!render.contains("earliest"), "{render}");
    let convert = yarnray(at, &["convert", "shot.usda", "o.txt"]).good().stderr;
    assert!(convert.contains("frames 1 to 3 are in it: the curves are those of the earliest"), "{convert}");
}

/// Of a stage without a range of times, whose camera moves: its shutter is open meanwhile.
#[test]
fn the_only_camera_of_a_stage_is_taken_and_moves() {
    let folder = directory();
    let at = folder.path();
    let camera = |name: &str| {
        format!(
            "def Camera \"{name}\" {{\nfloat focalLength = 35\n\
             double3 xformOp:translate.timeSamples = {{ 1: (0, 0, 40), 2: (2, 0, 40) }}\n\
             uniform token[] xformOpOrder = [\"xformOp:translate\"]\n}}\n"
        )
    };
    let stage = |cameras: &str| write(at, "shot.usda", format!("#usda 1.0\n(\nmetersPerUnit = 0.001\n)\n{cameras}"));
    let scene = "[render]\nwidth = 16\nheight = 12\nspp = 1\n[camera]\ntype = \"usd\"\npath = \"shot.usda\"\n\
                 shutter = [0, 1]\n[[fabric]]\nyarn = \"wool\"\nsource = { type = \"straight\", length = 20 }\n";
    write(at, "s.toml", scene);
    stage(&camera("shot"));
    yarnray(at, &["render", "s.toml", "-o", "s.exr", "-q", "--frames", "1", "--stats", "s.json"]).good();
    let stats = read_json(&at.join("s.json"));
    assert!(stats["used"].as_array().unwrap().iter().any(|n| n == "camera_motion"), "{}", stats["used"]);
    stage(&(camera("left") + &camera("right")));
    let several = yarnray(at, &["info", "s.toml"]);
    assert_eq!(several.status, Some(2));
    let hint = "prim = \"/left\"; cameras here: /left, /right";
    assert!(several.stderr.contains("missing key `prim`") && several.stderr.contains(hint), "{}", several.stderr);
    stage("def Xform \"empty\" {\n}\n");
    let none = yarnray(at, &["info", "s.toml"]);
    assert!(none.stderr.contains("shot.usda: there is no camera in it"), "{}", none.stderr);
}

/// What is not as it was meant is said in a render, for meshes as for curves, once for all frames.
#[test]
fn meshes_of_stages_tell_what_is_missing() {
    let folder = directory();
    let at = folder.path();
    write(
        at,
        "body.usda",
        "#usda 1.0\ndef Mesh \"body\" {\nint[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]\n\
         point3f[] points.timeSamples = { 1: [(0,0,0), (1,0,0), (0,1,0)], 9: [(1,0,0), (2,0,0), (1,1,0)] }\n\
         int[] primvars:skel:jointIndices = [0, 0, 0]\n}\ndef \"hat\" (\nreferences = @hat.usda@\n) {\n}\n",
    );
    let scene = "[render]\nwidth = 8\nheight = 8\nspp = 1\n[output]\nlayers = [\"motion\"]\n[[mesh]]\n\
                 path = \"body.usda\"\n[[fabric]]\nyarn = \"wool\"\nsource = { type = \"straight\", length = 20 }\n";
    write(at, "s.toml", scene);
    let told = yarnray(at, &["render", "s.toml", "-o", "s.exr"]).good().stderr;
    assert_eq!(told.matches("/body is as modelled, in no pose").count(), 1, "{told}");
    assert!(told.contains("hat.usda"), "{told}");
}

#[test]
fn shells_and_manuals_know_every_command() {
    let folder = directory();
    for shell in ["bash", "zsh", "fish"] {
        let text = yarnray(folder.path(), &["completions", shell]).good().stdout;
        assert!(text.contains("converge") && text.contains("--spp"), "{shell}");
    }
    yarnray(folder.path(), &["man", "man1"]).good();
    let page = fs::read_to_string(folder.path().join("man1/yarnray-render.1")).unwrap();
    assert!(page.starts_with(".ie") && page.contains("spp"), "{page:.200}");
}

/// What stands before every fabric of the scenes below.
fn head(yarn: &str) -> String {
    format!(
        "unit = \"mm\"\n[render]\nwidth = 48\nheight = 48\nspp = 4\n[camera]\ntype = \"frame\"\ndirection = [0, 0.2, 1]\n\
         [fiber.wool]\nr = [0.05, 0.05, 0.05]\ntt = [0.4, 0.4, 0.4]\nd = [0.4, 0.4, 0.4]\nbeta_r = 8\nbeta_tt = 8\nbeta_n = 20\n\
         [yarn.one]\nradius = {yarn}\nplies = 2\nfiber = \"wool\"\nfibers = 30\ndensity = 0.3\n\
         [[light]]\ntype = \"environment\"\nradiance = [1, 1, 1]\n"
    )
}

/// A tube of 12 x 3 faces in usd-core's own file, and in one of Alembic: 12.6 cm around, 3 cm high, a hem of its own cloth.
#[test]
fn garments_are_laid_on_meshes_of_stages() {
    let folder = directory();
    let at = folder.path();
    let stages = project("tests/data/stages");
    let info = |file: &str, more: &str, set: &[&str]| {
        let scene = head("0.5")
            + &format!(
                "[[fabric]]\nyarn = \"one\"\ngauge = [30, 40]\nsource = {{ type = \"garment\", path = {:?}, {more}\
                 cloth = {{ type = \"knit\" }} }}\n[[fabric.panel]]\ngroup = \"hem\"\ncloth = {{ type = \"knit\", pattern = \"rib1x1\" }}\n",
                stages.join(file)
            );
        write(at, "s.toml", scene);
        yarnray(at, &[&["info", "s.toml", "--json"], set].concat())
    };
    let said = |run: crate::support::Run| -> serde_json::Value { serde_json::from_str(&run.good().stdout).unwrap() };
    let usd = said(info("garment.usda", "prim = \"/figure/tube\", ", &[]));
    let garment = |v: &serde_json::Value| v["garments"][0].clone();
    // 37.8 wales around 126 mm; eight courses above the hem, and three in it.
    assert_eq!(garment(&usd)["stitches"].as_u64(), Some(38 * (8 + 3)), "{usd}");
    // Chords of a dodecagon, where the texture coordinates have the arc.
    let ratio = garment(&usd)["uv_ratio"]["p50"].as_f64().unwrap();
    assert!((0.98..=1.02).contains(&ratio), "{usd}");
    let panels = garment(&usd)["panels"].to_string();
    assert!(panels.contains("hem") && panels.contains("tube"), "{panels}");
    // The other format, which knows no unit, gives the same.
    let abc = said(info("garment.abc", "unit = \"cm\", ", &[]));
    assert_eq!(garment(&abc)["stitches"], garment(&usd)["stitches"]);
    // What a file knows of itself counts, of the garment and of its body, and that is said.
    let stage = stages.join("garment.usda");
    let body = format!("prim = \"/figure/tube\", unit = \"mm\", body = {stage:?}, body_prim = \"/figure/tube\", ");
    for more in ["prim = \"/figure/tube\", unit = \"mm\", ", &body] {
        let other = said(info("garment.usda", more, &[]));
        assert_eq!(garment(&other)["stitches"], garment(&usd)["stitches"], "{other}");
        let told = "garment.usda: a unit of 10 mm is its own; the scene's, of 1 mm, is not used";
        assert!(other["warnings"].to_string().contains(told), "{other}");
    }
    let same = said(info("garment.usda", "prim = \"/figure/tube\", unit = \"cm\", ", &[]));
    assert!(!same["warnings"].to_string().contains("is its own"), "{same}");
    // So of meshes beside the cloth.
    let beside = |unit: &str| {
        let mesh = format!("[[mesh]]\npath = {stage:?}\nprim = \"/figure/tube\"\n{unit}");
        let cloth = "[[fabric]]\nyarn = \"one\"\nsource = { type = \"stockinette\", stitches = 4, rows = 4 }\n";
        write(at, "m.toml", head("0.5") + cloth + &mesh);
        said(yarnray(at, &["info", "m.toml", "--json"]))["warnings"].to_string()
    };
    assert!(beside("unit = \"m\"").contains("a unit of 10 mm is its own; the scene's, of 1000 mm, is not used"));
    assert!(!beside("").contains("is its own"));
    info("garment.usda", "prim = \"/figure/tube\", ", &[]);
    // z points up in the one file, y in the other.
    yarnray(at, &["make", "garment", "s.toml", "-o", "g.txt"]).good();
    let made = yarnray(at, &["info", "g.txt", "--json"]);
    let bounds = serde_json::from_str::<serde_json::Value>(&made.good().stdout).unwrap()["bounds"].clone();
    let size = [0, 1, 2].map(|k| bounds[1][k].as_f64().unwrap() - bounds[0][k].as_f64().unwrap());
    assert!(size[0] > 38.0 && size[2] > 38.0 && (27.0..33.0).contains(&size[1]), "{size:?}");
    let missing = info("garment.usda", "prim = \"/figure/bare\", ", &[]);
    assert!(missing.stderr.contains("garment.usda: a mesh without texture coordinates"), "{}", missing.stderr);
    let missing = info("garment.usda", "prim = \"/none\", ", &[]);
    assert!(missing.stderr.contains("meshes here: /figure/tube, /figure/bare"), "{}", missing.stderr);
    // It moves while the shutter is open.
    info("garment.usda", "prim = \"/figure/tube\", ", &[]);
    let args = [
        "render",
        "s.toml",
        "--set",
        "camera.shutter=[0,1]",
        "--set",
        "render.frame=1",
        "-o",
        "a.exr",
        "--stats",
        "a.json",
    ];
    yarnray(at, &args).good();
    assert!(
        read_json(&at.join("a.json"))["used"].to_string().contains("yarn_motion"),
        "{}",
        read_json(&at.join("a.json"))["used"]
    );
}

#[test]
fn colours_of_curves_dye_yarns_where_the_scene_asks_for_it() {
    let folder = directory();
    let at = folder.path();
    let file = project("tests/data/stages/colors.usda");
    let run = yarnray(at, &["info", file.to_str().unwrap(), "--json"]);
    let info: serde_json::Value = serde_json::from_str(&run.good().stdout).unwrap();
    // Red, blue, green, and the mean of red and blue; the last prim has none.
    assert_eq!(
        (info["curves"].as_u64(), info["colored"].as_u64(), info["colors"].as_u64()),
        (Some(10), Some(8), Some(4))
    );
    assert_eq!(info["ids"].as_u64(), Some(2));
    let mean = |colors: &str, prim: &str| -> Vec<f64> {
        let source = format!("source = {{ type = \"file\", path = {file:?}, prim = \"{prim}\"{colors} }}");
        write(at, "s.toml", head("0.2") + "[[fabric]]\nyarn = \"one\"\n" + &source + "\n");
        yarnray(at, &["render", "s.toml", "-o", "a.exr", "--spp", "16"]).good();
        let picture = yarnray::image::read(&at.join("a.exr")).unwrap();
        let rgb = picture.rgb().unwrap();
        let alpha = &picture.channels.iter().find(|c| c.name == "A").unwrap().samples;
        let covered: Vec<usize> = (0..alpha.len()).filter(|&i| alpha[i] == 1.0).collect();
        assert!(covered.len() > 20);
        rgb.iter().map(|c| covered.iter().map(|&i| f64::from(c[i])).sum::<f64>() / covered.len() as f64).collect()
    };
    let plain = mean("", "/constant");
    assert!((plain[0] - plain[2]).abs() < 0.02 * plain[0], "{plain:?}");
    let red = mean(", colors = true", "/constant");
    assert!(red[0] > 3.0 * red[2] && red[0] < plain[0], "{red:?}");
    let none =
        yarnray(at, &["render", "s.toml", "--set", "fabric.0.source.prim=/none", "-o", "b.png", "--spp", "1"]).good();
    assert!(none.stderr.contains("no curve has one"), "{}", none.stderr);
    // They survive a conversion.
    yarnray(at, &["convert", file.to_str().unwrap(), "c.usda", "--prim", "/uniform"]).good();
    let text = fs::read_to_string(at.join("c.usda")).unwrap();
    assert!(
        text.contains("[7, 9]") && text.contains("(0.800000011920929, 0.05000000074505806, 0.05000000074505806)"),
        "{text}"
    );
}

/// Yarns of stitch meshes, and a chart that is a picture.
#[test]
fn stitch_meshes_become_yarns() {
    let folder = directory();
    let at = folder.path();
    let mesh = "L k -l1 +y1 +l1 -y1\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 2 0\nv 0 2 0\nf 1 2 3 4\nT 1\nf 4 3 5 6\nT 1\ne 1/3 2/-1\n";
    let faces = "face k\nedge (-1,-1) -l1\nedge (1,-1) +y1\nedge (1,1) +l1\nedge (-1,1) -y1\nyarn [3:0.5,0] (-0.5,0,0.1) [2:0.7,0]\n\
                 yarn [2:0.3,0] (0.5,0,0.1) [1:0.5,0]\nyarn [0:0.3,0] (0,0.6,-0.1) [0:0.7,0]\n";
    write(at, "a.smobj", mesh);
    write(at, "other.sf", faces);
    let refused = yarnray(at, &["convert", "a.smobj", "a.yarns"]);
    assert!(refused.stderr.contains("a.sf: no such file"), "{}", refused.stderr);
    yarnray(at, &["convert", "a.smobj", "a.yarns", "--faces", "other.sf", "--radius", "0.05"]).good();
    let info: serde_json::Value =
        serde_json::from_str(&yarnray(at, &["info", "a.yarns", "--json"]).good().stdout).unwrap();
    // The loop of the lower stitch, its foot, and the two ends of the upper one.
    assert_eq!(
        (info["curves"].as_u64(), info["radii"].as_bool(), info["colored"].as_u64()),
        (Some(4), Some(true), Some(4))
    );
    let lost = yarnray(at, &["convert", "a.yarns", "a.bcc"]).good().stderr;
    assert!(lost.contains("colours are lost") && lost.contains("radii are lost"), "{lost}");
}
