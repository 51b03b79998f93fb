//! `make` and what `info` says of what it made.

use crate::support::{directory, listing, project, write, yarnray};

#[test]
fn made_cloth_is_written_in_every_format_and_read_again() {
    let folder = directory();
    let d = folder.path();
    let out = ["-o", "a.bcc", "-o", "a.hair", "-o", "a.obj", "-o", "a.txt"];
    yarnray(
        d,
        &[&["make", "weave", "--draft", "twill 2/1", "--warps", "9", "--wefts", "7", "--weft-radius", "0.3"][..], &out]
            .concat(),
    )
    .good();
    for (file, radii) in [("a.bcc", false), ("a.hair", true), ("a.obj", false), ("a.txt", true)] {
        let json = |args: &[&str]| -> serde_json::Value {
            let run = yarnray(d, &[&["info", file, "--json"], args].concat());
            serde_json::from_str(&run.good().stdout).unwrap()
        };
        let info = json(&[]);
        assert_eq!((info["curves"].as_u64(), info["radii"].as_bool()), (Some(16), Some(radii)), "{file}");
        assert_eq!(info["overlap"].is_null(), !radii, "{file}: {}", info["overlap"]);
        let overlap = if radii { info["overlap"].clone() } else { json(&["--radius", "0.3"])["overlap"].clone() };
        assert_eq!(overlap["share"].as_f64(), Some(0.0), "{file}: {overlap}");
    }
}

#[test]
fn the_same_knit_is_the_same_file_and_keeps_its_yarns_apart() {
    let folder = directory();
    let d = folder.path();
    for file in ["a.bcc", "b.bcc"] {
        yarnray(
            d,
            &["make", "knit", "--pattern", "rib2x2", "--stitches", "24", "--rows", "6", "--form", "tube", "-o", file],
        )
        .good();
    }
    assert_eq!(std::fs::read(d.join("a.bcc")).unwrap(), std::fs::read(d.join("b.bcc")).unwrap());
    let run = yarnray(d, &["info", "a.bcc", "--radius", "0.5", "--json"]);
    let info: serde_json::Value = serde_json::from_str(&run.good().stdout).unwrap();
    assert_eq!((info["curves"].as_u64(), info["closed"].as_u64()), (Some(1), Some(0)));
    // The rims of a narrow tube are the tightest place: 4.2 % measured, 5 % is what `info` tolerates.
    assert!(info["overlap"]["share"].as_f64().unwrap() <= 0.05, "{}", info["overlap"]);
}

#[test]
fn what_cannot_be_made_is_refused() {
    let folder = directory();
    let d = folder.path();
    for (args, message) in [
        (
            &["knit", "-o", "a.xyz"][..],
            "error: a.xyz: expected a name that ends in .bcc, .hair, .obj, .yarns, .txt, .usda or .usdc\n",
        ),
        (&["knit", "--chart", "k q", "-o", "a.bcc"], "error: unknown step \"q\"; "),
        (
            &["knit", "--stitches", "1000000", "--rows", "1000000", "-o", "a.bcc"],
            "error: more than 2^27 control points",
        ),
        (&["knit", "--profile", "1,2", "-o", "a.bcc"], "error: a profile has two or more points"),
        (&["weave", "--draft", "twil", "-o", "a.bcc"], "error: unknown weave \"twil\"; "),
        (&["weave", "--warp-spacing", "0.7", "-o", "a.bcc"], "error: --warp-spacing leaves the yarns no room to pass"),
    ] {
        let run = yarnray(d, &[&["make"], args].concat());
        assert!(run.stderr.starts_with(message), "{args:?}: {}", run.stderr);
        assert_eq!((run.status, run.stdout.as_str(), listing(d).len()), (Some(2), "", 0), "{args:?}");
    }
}

/// A draft of a weaving program: 24 x 24 threads of four colours, one of them a cord.
#[test]
fn a_wif_draft_gives_threads_colours_and_measures() {
    let folder = directory();
    let d = folder.path();
    std::fs::create_dir(d.join("drafts")).unwrap();
    std::fs::copy(project("tests/data/drafts/tartan.wif"), d.join("drafts/t.wif")).unwrap();
    let library = project("scenes/yarns.toml");
    let scene = |draft: &str| {
        format!(
            "library = [{library:?}]\n[camera]\ntype = \"frame\"\ndirection = [0, 0, 1]\n[[fabric]]\nyarn = \"cotton\"\n\
             source = {{ type = \"weave\", edges = \"live\", draft = {draft} }}\n[[light]]\ntype = \"environment\"\nradiance = [1, 1, 1]\n"
        )
    };
    write(d, "s.toml", scene("{ type = \"wif\", path = \"drafts/t.wif\" }"));
    let said = yarnray(d, &["info", "s.toml"]).good().stdout;
    // 25 mm of cloth: 24 threads of 1 mm, and a cord that takes more.
    assert!(
        said.contains("Tartan with a corded line, 24 x 24: 9.5 ends and 10.0 picks per cm, 25.3 x 24.0 mm"),
        "{said}"
    );
    assert!(said.contains("several yarns or colours"), "{said}");
    let plain = "{ type = \"wif\", path = \"drafts/t.wif\", colors = false, spacing = false, thickness = false }";
    write(d, "s.toml", scene(plain));
    let said = yarnray(d, &["info", "s.toml"]).good().stdout;
    assert!(said.contains("every fabric is of one yarn throughout") && !said.contains("25.3 x 24.0 mm"), "{said}");
    // What is wrong is told where it stands.
    let text = std::fs::read_to_string(d.join("drafts/t.wif")).unwrap();
    write(d, "drafts/t.wif", text.replace("\n24=4\n\n[TIEUP]", "\n24=5\n\n[TIEUP]"));
    let run = yarnray(d, &["info", "s.toml"]);
    assert!(
        run.stderr.contains("t.wif: line 77: [THREADING] names shaft 5, the file says that there are 4"),
        "{}",
        run.stderr
    );
    // Without a scene.
    let file = project("tests/data/drafts/tartan.wif");
    yarnray(d, &["make", "weave", "--draft", file.to_str().unwrap(), "-o", "t.txt"]).good();
    let run = yarnray(d, &["info", "t.txt", "--json"]);
    let info: serde_json::Value = serde_json::from_str(&run.good().stdout).unwrap();
    assert_eq!(info["curves"].as_u64(), Some(48));
}
