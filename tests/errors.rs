//! What bad input is answered with.
//!
//! `tests/errors` holds scenes that are wrong, each beside the whole message it must give (`NAME.toml`, `NAME.txt`).
//! `YARNRAY_BLESS=1` writes the messages anew: read the difference before you keep it.

use std::path::Path;

use crate::support::{SWATCH, bcc, directory, listing, project, write, yarnray};

#[test]
fn wrong_scenes_give_their_message() {
    let folder = project("tests/errors");
    let bless = std::env::var_os("YARNRAY_BLESS").is_some();
    let scenes: Vec<String> = listing(&folder).into_iter().filter(|n| n.ends_with(".toml")).collect();
    assert!(scenes.len() > 20);
    let mut wrong = Vec::new();
    for scene in scenes {
        let out = directory();
        let picture = out.path().join("out.exr").display().to_string();
        let run = yarnray(&folder, &["render", &scene, "-o", &picture, "--spp", "1", "--width", "8", "--height", "8"]);
        let expected = folder.join(scene.replace(".toml", ".txt"));
        if run.status != Some(2) || !run.stdout.is_empty() || !listing(out.path()).is_empty() {
            wrong.push(format!("{scene}: {run:?}, left {:?}", listing(out.path())));
        } else if bless {
            std::fs::write(&expected, &run.stderr).unwrap();
        } else {
            let expected = std::fs::read_to_string(&expected).unwrap_or_default();
            if run.stderr != expected {
                wrong.push(format!("{scene}: expected\n{expected}found\n{}", run.stderr));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Runs with bad input in a folder of `files`; whole message, status 2, and nothing new in the folder.
#[track_caller]
fn refused(folder: &Path, args: &[&str], message: &str) {
    let before = listing(folder);
    let run = yarnray(folder, args);
    assert_eq!(run.stderr, message, "{args:?}");
    assert_eq!((run.status, run.stdout.as_str()), (Some(2), ""), "{args:?}");
    assert_eq!(listing(folder), before, "{args:?}");
}

/// As [`refused`], for messages of which only parts are ours.
#[track_caller]
fn refused_with(folder: &Path, args: &[&str], parts: &[&str]) {
    let before = listing(folder);
    let run = yarnray(folder, args);
    for part in parts {
        assert!(run.stderr.contains(part), "{args:?}: {part} not in\n{}", run.stderr);
    }
    assert_eq!((run.status, run.stdout.as_str()), (Some(2), ""), "{args:?}");
    assert_eq!(listing(folder), before, "{args:?}");
}

/// What other programs keep for themselves is told by its name, wherever it is named, with what to export instead.
#[test]
fn files_of_other_programs_are_told_by_their_names() {
    let folder = directory();
    let at = folder.path();
    write(at, "shirt.fbx", "Kaydara FBX Binary");
    write(at, "shirt.glb", "glTF");
    write(
        at,
        "g.toml",
        "[[fabric]]\nyarn = \"wool\"\nsource = { type = \"garment\", path = \"shirt.fbx\", cloth = { type = \"knit\" } }\n",
    );
    write(
        at,
        "m.toml",
        "[[mesh]]\npath = \"shirt.glb\"\n[[fabric]]\nyarn = \"wool\"\nsource = { type = \"straight\" }\n",
    );
    let fbx = "shirt.fbx: FBX files are not read";
    refused_with(at, &["info", "g.toml"], &[fbx, "export it as USD, Alembic or OBJ, with its texture coordinates"]);
    refused_with(at, &["info", "m.toml"], &["m.toml:2:8: error: shirt.glb: glTF files are not read; export it as USD"]);
    refused_with(at, &["info", "shirt.fbx"], &[fbx, "export it as USD, Alembic or OBJ"]);
}

/// A stage tells the line at which its text breaks off, and what it refers to and cannot find where nothing is left.
#[test]
fn stages_tell_their_line_and_what_is_missing() {
    let folder = directory();
    let at = folder.path();
    let scene = |path: &str| {
        format!(
            "[[fabric]]\nyarn = \"wool\"\nsource = {{ type = \"garment\", path = \"{path}\", cloth = {{ type = \"knit\" }} }}\n"
        )
    };
    write(at, "cut.usda", "#usda 1.0\ndef Mesh \"m\" {\n    int[] faceVertexCounts = [3\n");
    write(at, "cut.toml", scene("cut.usda"));
    refused_with(at, &["info", "cut.toml"], &["cut.toml:3:37: error: cut.usda: line "]);
    write(at, "shot.usda", "#usda 1.0\ndef \"hero\" (\n    payload = @hero.usda@\n) {\n}\n");
    write(at, "shot.toml", scene("shot.usda"));
    refused_with(
        at,
        &["info", "shot.toml"],
        &["shot.usda: no visible mesh is chosen; meshes here: none; ", "hero.usda"],
    );
    refused_with(at, &["convert", "shot.usda", "o.txt"], &["shot.usda: there are no curves in it; ", "hero.usda"]);
}

#[test]
fn damaged_curve_files_name_the_byte() {
    let directory = directory();
    let d = directory.path();
    let whole = bcc(&[(false, vec![[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [8.0, 1.0, 0.0]]), (true, vec![[0.0; 3]; 4])]);
    let with = |at: usize, bytes: &[u8]| {
        let mut file = whole.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        file
    };
    write(d, "s.toml", SWATCH);
    for (name, bytes, message) in [
        ("empty.bcc", vec![], "byte 0: the header takes 64 bytes but the file ends here; is the file cut short?"),
        (
            "header.bcc",
            whole[..40].to_vec(),
            "byte 40: the header takes 64 bytes but the file ends here; is the file cut short?",
        ),
        (
            "cut.bcc",
            whole[..90].to_vec(),
            "byte 64: curve 0 claims 3 points but only 22 bytes follow; is the file cut short?",
        ),
        ("name.bcc", with(0, b"ABC"), "byte 0: expected the letters BCC, found \"ABC\"; is this another kind of file?"),
        (
            "bezier.bcc",
            with(4, b"BZ"),
            "byte 4: expected curve type C0, BS or PL, found BZ; \
             Bezier curves are not supported, so convert them to Catmull-Rom curves (C0)",
        ),
        (
            "count.bcc",
            with(8, &u64::MAX.to_le_bytes()),
            "byte 8: the header promises 18446744073709551615 curves but only 92 bytes follow it; is the file cut short?",
        ),
        (
            "points.bcc",
            with(64, &i32::MIN.to_le_bytes()),
            "byte 64: curve 0 claims 2147483648 points but only 88 bytes follow; is the file cut short?",
        ),
        (
            "nan.bcc",
            with(84, &f32::NAN.to_le_bytes()),
            "byte 84: expected a finite number for y of point 1 of curve 0, found NaN",
        ),
        (
            "inf.bcc",
            with(68, &f32::INFINITY.to_le_bytes()),
            "byte 68: expected a finite number for x of point 0 of curve 0, found inf",
        ),
    ] {
        write(d, name, bytes);
        let line = format!("error: {name}: {message}\n");
        refused(d, &["info", name], &line);
        let in_scene = format!("{name}: {message}");
        refused_with(d, &["render", "s.toml", "--curves", name, "-o", "out.exr"], &[&in_scene, "error: "]);
    }
}

#[test]
fn bad_text_curves_name_the_line() {
    let directory = directory();
    let d = directory.path();
    for (name, text, message) in [
        ("word.txt", "0 0 0\n1 x 0\n", "line 2: expected a finite number for y, found \"x\""),
        ("nan.txt", "0 0 0\n1 0 nan\n", "line 2: expected a finite number for z, found \"nan\""),
        (
            "two.txt",
            "0 0\n",
            "line 1: expected \"x y z\" or \"x y z radius\", found \"0 0\"; numbers are separated by spaces",
        ),
        (
            "mixed.txt",
            "0 0 0 1\n1 0 0\n",
            "line 2: found no radius here but one in line 1; give every line a radius, or none",
        ),
        ("negative.txt", "0 0 0 -1\n1 0 0 1\n", "line 1: expected a radius of 0 or more, found \"-1\""),
        (
            "single.txt",
            "0 0 0\n\n1 1 1\n2 2 2\n",
            "line 1: expected a curve of two points or more, found one; is there a blank line too many?",
        ),
    ] {
        write(d, name, text);
        refused(d, &["info", name], &format!("error: {name}: {message}\n"));
    }
}

#[test]
fn missing_files_are_named() {
    let directory = directory();
    let d = directory.path();
    write(d, "s.toml", SWATCH);
    refused(d, &["render", "none.toml", "-o", "o.exr"], "none.toml: error: no such file\n");
    refused(d, &["render", ".", "-o", "o.exr"], ".: error: not a file\n");
    refused_with(d, &["info", "none.bcc"], &["error: none.bcc: no such file"]);
    refused_with(d, &["render", "s.toml", "--curves", "none.bcc", "-o", "o.exr"], &["none.bcc: no such file"]);
    write(d, "what.xyz", "0 0 0\n");
    refused(
        d,
        &["info", "what.xyz"],
        "error: what.xyz: expected a curve file, found neither the letters BCC or HAIR nor a known extension; \
         name it .bcc, .hair, .pyp, .obj, .yarns, .txt, .curves, .smobj, .usda, .usdc, .usd, .usdz or .abc after its content\n",
    );
    write(d, "bytes.toml", b"[render]\nspp = \xff\n");
    refused(d, &["render", "bytes.toml", "-o", "o.exr"], "bytes.toml: error: byte 15: not UTF-8 text\n");
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_rendering() {
    let directory = directory();
    let d = directory.path();
    write(d, "s.toml", SWATCH);
    write(d, "file", "");
    std::fs::create_dir(d.join("folder.png")).unwrap();
    let endless = ["render", "s.toml", "--spp", "100000000"];
    let to = |args: &[&'static str]| [&endless[..], args].concat();
    refused(
        d,
        &to(&["-o", "file/x.exr"]),
        "error: cannot write file/x.exr: no directory `file`, and it cannot be created: a file is in its place\n",
    );
    refused(d, &to(&["-o", "folder.png"]), "error: cannot write folder.png: it is a directory\n");
    refused(
        d,
        &to(&["-o", "x.gif"]),
        "error: cannot write x.gif: unknown extension `gif`; \
         known are exr, png, hdr, tif, tiff, jpg, jpeg, bmp, tga, ppm and webp\n",
    );
    refused(
        d,
        &to(&["-o", "x"]),
        "error: cannot write x: it has no extension; known are exr, png, hdr, tif, tiff, jpg, jpeg, bmp, tga, ppm and webp\n",
    );
    // Before anything is read that may be large.
    refused_with(d, &["render", "none.toml", "-o", "x.gif"], &["cannot write x.gif: unknown extension"]);
    for command in [&["make", "fibers", "none.toml", "-o", "file/x.txt"][..], &["converge", "none.toml", "-o", "file"]]
    {
        refused_with(d, command, &["cannot write file/"]);
    }
    // The second output counts as well, and the statistics.
    refused_with(d, &to(&["-o", "x.exr", "-o", "file/y.png"]), &["cannot write file/y.png: "]);
    refused_with(d, &to(&["-o", "x.exr", "--stats", "file/s.json"]), &["cannot write file/s.json: "]);
    refused_with(d, &to(&["-o", "x.exr", "--stats", "folder.png"]), &["cannot write folder.png: it is a directory"]);
}

#[test]
fn wrong_options_are_refused() {
    let directory = directory();
    let d = directory.path();
    write(d, "s.toml", SWATCH);
    for (args, parts) in [
        (&["--mode", "cloth"][..], &["invalid value 'cloth' for '--mode", "yarn"][..]),
        (&["--model", "magic"], &["invalid value 'magic' for '--model", "aggregated", "two-stream"]),
        (&["--spp", "many"], &["invalid value 'many' for '--spp"]),
        (&["--spp", "-1"], &["invalid value '-1' for '--spp <N>'"]),
        (&["--spp", "0"], &["--spp 0: error: `spp` must be from 1 to 4294967295, found 0"]),
        (&["--time", "0"], &["error: `time` must be above 0, found 0"]),
        (&["--time", "nan"], &["error: `time` must be "]),
        (&["--noise=-1"], &["error: `noise` must be above 0, found -1"]),
        (&["--width", "0"], &["error: `width` must be from 1 to 65536, found 0"]),
        (&["--threads", "0"], &["error: `threads` must be from 1 to 4096, found 0"]),
        (&["--crop", "0,0,4"], &["--crop"]),
        (&["--crop", "0,0,49,4"], &["error: the crop must be whole pixels x0 < x1 <= 48 and y0 < y1 <= 36"]),
        (&["--crop", "5,5,5,9"], &["error: the crop must be whole pixels x0 < x1 <= 48 and y0 < y1 <= 36"]),
        (&["--set", "nonsense"], &["--set nonsense", "error: ", "write KEY=VALUE, such as render.spp=16"]),
        (&["--set", "=3"], &["--set =3", "error: "]),
        (&["--set", "render.sp=3"], &["error: unknown key `sp` in [render]", "did you mean `spp`?"]),
        (&["--set", "light.9.radiance=3"], &["--set light.9.radiance=3", "error: "]),
        (&["--set", "render.spp=\"x\""], &["error: `spp`: expected an integer, found a string"]),
        (&["--tone-map", "sepia"], &["invalid value 'sepia' for '--tone-map", "filmic"]),
        (&["--display", "localhost"], &["invalid value 'localhost' for '--display", "HOST:PORT"]),
        (&["--display", "localhost:port"], &["--display", "as in localhost:14158"]),
        (&["--nonsense"], &["unexpected argument '--nonsense' found"]),
    ] {
        let all = [&["render", "s.toml", "-o", "o.exr"], args].concat();
        refused_with(d, &all, parts);
    }
    refused_with(d, &["rendr", "s.toml"], &["unrecognized subcommand 'rendr'", "render"]);
    refused_with(d, &["render"], &["<SCENE>"]);
}

#[test]
fn all_mistakes_of_a_scene_are_told_at_once() {
    let directory = directory();
    let d = directory.path();
    let scene = SWATCH.replace("fov = 25", "fov = 250").replace("fibers = 60", "fibres = 60");
    write(d, "s.toml", scene);
    refused_with(d, &["render", "s.toml", "-o", "o.exr"], &["`fov` must be ", "did you mean `fibers`?", "`fibers`"]);
}

/// What a file is, and which command reads it.
#[test]
fn info_says_what_it_cannot_tell_of() {
    let folder = directory();
    let at = folder.path();
    write(at, "empty.txt", "");
    write(at, "a.exr", "picture");
    write(at, "cut.film", "yarn");
    write(at, "no.abc", "usda");
    write(at, "yarns.dat", "1 2 3");
    refused(at, &["info", "empty.txt"], "error: empty.txt: the file is empty; is the file cut short?\n");
    refused_with(at, &["info", "a.exr"], &["error: a.exr: a picture", "`yarnray compare A B` measures pictures"]);
    refused_with(at, &["info", "cut.film"], &["cut.film"]);
    refused_with(
        at,
        &["info", "no.abc"],
        &[if cfg!(feature = "usd") { "expected an Alembic file" } else { "Alembic" }],
    );
    refused_with(at, &["info", "yarns.dat"], &[".smobj"]);
}

/// Before a long render, as pictures.
#[test]
fn statistics_that_cannot_be_written_are_refused_before_the_render() {
    let folder = directory();
    let at = folder.path();
    write(at, "s.toml", SWATCH);
    let run = yarnray(at, &["render", "s.toml", "-o", "o.png", "--stats", "/dev/null/s.json"]);
    assert!(run.status == Some(2) && !at.join("o.png").exists(), "{run:?}");
    #[cfg(target_os = "linux")]
    {
        let run = yarnray(at, &["render", "s.toml", "-o", "o.png", "--stats", "/proc/s.json"]);
        assert!(run.status == Some(2) && !at.join("o.png").exists(), "{run:?}");
    }
}

#[test]
fn libraries_of_the_command_line_are_read() {
    let folder = directory();
    let at = folder.path();
    write(at, "lib.toml", "[yarn.mine]\nradius = 1\nfiber = \"wool\"\nfibers = 60\ndensity = 0.4\n");
    write(at, "s.toml", "[[fabric]]\nyarn = \"mine\"\nsource = { type = \"straight\", count = 3, length = 20 }\n");
    let with = |library: &str| yarnray(at, &["info", "s.toml", "--set", library, "--set", "yarn.mine.radius=2"]);
    assert!(with("library=[\"lib.toml\"]").good().stdout.contains("`mine`"));
    assert!(with("library=[\"none.toml\"]").stderr.contains("cannot read the library"));
}
