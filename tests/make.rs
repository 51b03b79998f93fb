//! `make` and what `info` says of what it made.

use yarnray::{
    files::curve_file::{self, ReadOptions},
    geometry::curve::CurveSet,
};

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
    // The rims of a narrow tube are the tightest place: 4.12 % measured, the same in every run.
    assert!(info["overlap"]["share"].as_f64().unwrap() <= 0.042, "{}", info["overlap"]);
}

/// Sizes count stitches, rows and yarns, or say how large they are.
#[test]
fn sizes_are_kept_to_the_nearest_stitch_and_yarn() {
    let folder = directory();
    let d = folder.path();
    let made = |args: &[&str]| yarnray(d, &[&["make"], args, &["-o", "a.bcc"]].concat()).good().stderr;
    // 17.6 stitches and 20.4 rows, in repeats of two stitches.
    let said = made(&["knit", "--pattern", "seed", "--gauge", "22,34", "--width", "80", "--height", "60"]);
    assert!(said.contains("4.5455 from stitch to stitch, 2.9412 from row to row\n"), "{said}");
    assert!(said.contains("18 x 20, 81.818 wide, 58.824 high; "), "{said}");
    // A size and a count give the stitch.
    let tube = ["knit", "--form", "tube", "--stitches", "24", "--circumference", "96", "--rows", "8", "--height", "24"];
    let said = made(&tube);
    assert!(said.contains("24 x 8, 96.000 around, 24.000 high; "), "{said}");
    // A tube is of whole repeats too; where not one has room, that is told.
    let lace = |around: &'static str| {
        ["knit", "--form", "tube", "--chart", "k2tog yo", "--gauge", "22,34", "--circumference", around, "--rows", "8"]
    };
    let said = made(&lace("15"));
    assert!(said.contains("4 x 8, "), "{said}");
    for (args, least) in [
        (&lace("1")[..], "a circumference of 1.000 mm has no room for the smallest such knit\n  hint: it is 18.2 mm\n"),
        (
            &[
                "knit",
                "--instructions",
                "Row 1: k2tog, k to end",
                "--stitches",
                "12",
                "--gauge",
                "22,30",
                "--height",
                "90",
            ],
            "error: a height of 90.000 mm is 27 rows, of which 11 can be knitted of 12 stitches\n  hint: they are 36.7 mm high",
        ),
        (&["weave", "--width", "0.1"], "--width has no room for one yarn, or one repeat of a tile; at least "),
        (&["weave", "--height", "1", "--tile"], "--height has no room"),
    ] {
        let run = yarnray(d, &[&["make"], args, &["-o", "none.bcc"]].concat());
        assert!(run.status == Some(2) && run.stderr.contains(least), "{args:?}: {}", run.stderr);
    }
    // A tile is of whole repeats.
    let said = made(&["knit", "--pattern", "moss", "--tile", "--gauge", "22,34", "--width", "60", "--height", "39"]);
    assert!(said.contains("period 63.636364 across, 35.294118 up; "), "{said}");
    let said = made(&["weave", "--draft", "twill 2/1", "--warps", "10", "--wefts", "11", "--tile"]);
    assert!(said.contains("21 yarns, ") && said.contains("\nperiod "), "{said}");
    let said = made(&["weave", "--width", "24", "--wefts", "6", "--warp-spacing", "2.5"]);
    assert!(said.contains("16 yarns, ") && said.contains("25.000 wide, "), "{said}");
}

#[test]
fn what_cannot_be_made_is_refused() {
    let folder = directory();
    let d = folder.path();
    for (args, message) in [
        (
            &["knit", "-o", "a.xyz"][..],
            "error: a.xyz: expected a name that ends in .bcc, .hair, .obj, .yarns, .txt, .curves, .usda, .usdc or .usd\n",
        ),
        (
            &["knit", "--motif", ".#", "--motif", "#", "--color", ".=#ffffff", "--color", "#=#000000", "-o", "a.bcc"],
            "error: --motif #: every row of a motif has 2 signs, like the first\n  hint: ",
        ),
        (
            &["weave", "--draft", "plain", "--pile-height", "3", "-o", "a.bcc"],
            "error: --pile-height: this draft has no pile\n  hint: ",
        ),
        (
            &["knit", "--motif", "#", "--color", ".=#ffffff", "-o", "a.bcc"],
            "error: --motif #: `#` stands for no yarn\n  hint: ",
        ),
        (
            &["knit", "--motif", "#", "--color", "#c02a1f", "-o", "a.bcc"],
            "error: --color #c02a1f: expected a sign and a colour\n",
        ),
        (
            &["knit", "--motif", "@no.png", "--color", "#c02a1f", "-o", "a.bcc"],
            "error: --motif: cannot read no.png: no such file\n",
        ),
        (
            &["knit", "--motif", "#", "--color", "#=#c02a1f", "--color-work", "double-knit", "-o", "a.bcc"],
            "error: double knitting takes two yarns, one for each layer, but found 1\n  hint: ",
        ),
        (
            &[
                "knit",
                "--motif",
                "#",
                "--color",
                "#=#c02a1f",
                "--color-work",
                "intarsia",
                "--form",
                "tube",
                "-o",
                "a.bcc",
            ],
            "error: intarsia is knitted flat\n  hint: --color-work stranded\n",
        ),
        (&["knit", "--chart", "k q", "-o", "a.bcc"], "error: unknown step \"q\"; "),
        (
            &["knit", "--width", "1e9", "--rows", "2", "-o", "a.bcc"],
            "error: a width of 1000000000.000 mm takes more than 1000000 stitches",
        ),
        (
            &["knit", "--height", "1e9", "--stitches", "2", "-o", "a.bcc"],
            "error: a height of 1000000000.000 mm takes more than 1000000 rows",
        ),
        (
            &["knit", "--stitches", "1000000", "--rows", "1000000", "-o", "a.bcc"],
            "error: more than 2^27 control points",
        ),
        // Before it is knitted, which would take minutes.
        (
            &["knit", "--stitches", "1000", "--rows", "1000", "-o", "a.bcc", "-o", "a.hair"],
            "error: a.hair: a curve of a .hair file has at most 65536 points, and one yarn of this piece at least 24019200\n",
        ),
        // The same of a weave: of a warp of so many picks, and of a weft that turns at selvedges.
        (
            &["weave", "--wefts", "10000", "-o", "a.hair"],
            "error: a.hair: a curve of a .hair file has at most 65536 points, and one yarn of this piece at least 80001\n",
        ),
        (
            &["weave", "--warps", "132", "--wefts", "100", "--edges", "selvedge", "-o", "a.hair"],
            "error: a.hair: a curve of a .hair file has at most 65536 points, and one yarn of this piece at least 96000\n",
        ),
        // Lengths are known as soon as a repeat is relaxed.
        (
            &["weave", "--height", "20000", "--weft-spacing", "2", "--quiet", "-o", "a.hair"],
            "error: a.hair: a curve of a .hair file has at most 65536 points, and one yarn of this piece at least 80001\n",
        ),
        (&["knit", "--profile", "1,2", "-o", "a.bcc"], "error: a profile has 2 to 10000 points; as in "),
        (
            &["knit", "--form", "tube", "--stitches", "2", "-o", "a.bcc"],
            "error: knitting in the round takes at least 3 stitches\n  hint: ",
        ),
        (
            &["knit", "--yarn-per-stitch", "5", "-o", "a.bcc"],
            "error: invalid value '5' for '--yarn-per-stitch <D>': expected a number from 6 to 60",
        ),
        (
            &["weave", "--draft", "velvet", "--edges", "fringe", "-o", "a.bcc"],
            "error: the strands of a cut pile are not drawn out into a fringe\n  hint: --edges selvedge",
        ),
        (
            &["weave", "--draft", "corduroy", "--edges", "selvedge", "-o", "a.bcc"],
            "error: wefts that are cut do not turn at a selvedge\n  hint: --edges live",
        ),
        (
            &["weave", "--draft", "double cloth", "--edges", "finished", "-o", "a.bcc"],
            "error: cloth of more than one layer is too thick to be folded into hems\n  hint: --edges selvedge",
        ),
        (&["knit", "--instructions", "Row 1: k, frobnicate", "-o", "a.bcc"], "error: --instructions: line 1: "),
        (&["weave", "--draft", "twil", "-o", "a.bcc"], "error: unknown weave \"twil\"; "),
        (&["weave", "--warp-spacing", "0.7", "-o", "a.bcc"], "error: --warp-spacing leaves the yarns no room to pass"),
        (
            &["knit", "--gauge", "40,60", "-o", "a.bcc"],
            "error: a gauge of 40.0 x 60.0 in 10 cm is too dense for yarn 1.000 mm thick: a stitch of 2.500 x 1.667 mm takes \
             9.8 diameters of yarn\n  hint: at most ",
        ),
        (
            &["knit", "--form", "tube", "--stitches", "100", "--circumference", "100", "-o", "a.bcc"],
            "error: 100 stitches on a circumference of 100.0 mm are 1.00 yarn diameters wide; \
             1.5 to 20 can be knitted\n  hint: about 33 stitches in yarn",
        ),
        (
            &["knit", "--rows", "200", "--height", "0.6", "-o", "a.bcc"],
            "error: 200 rows on a height of 0.6 mm are 0.00 yarn diameters high; 0.9 to 20 can be knitted\n  hint: about 1 row in yarn ",
        ),
        (
            &["knit", "--stitches", "2", "--width", "1e12", "-o", "a.bcc"],
            "error: 2 stitches on a width of 1000000000000.0 mm are ",
        ),
        (&["weave", "--draft", "velvet", "--pile-height", "1e15", "-o", "a.bcc"], "error: --pile-height "),
        (
            &["knit", "--form", "tube", "--width", "100", "-o", "a.bcc"],
            "error: a tube has no width\n  hint: --circumference is the way round it\n",
        ),
        (
            &["knit", "--circumference", "100", "-o", "a.bcc"],
            "error: a flat piece has no circumference\n  hint: --width, or a tube by --form\n",
        ),
        (
            &["knit", "--gauge", "22,30", "--stitches", "20", "--width", "100", "-o", "a.bcc"],
            "error: --width, --stitches and --gauge are given\n  hint: two of them give the third\n",
        ),
        (
            &["knit", "--gauge", "22,30", "--row-height", "3", "-o", "a.bcc"],
            "error: --row-height and --gauge are given\n",
        ),
        (
            &["knit", "--profile", "90,0", "--profile", "60,80", "--height", "50", "-o", "a.bcc"],
            "error: the profile says how large the piece is, not --height\n",
        ),
        (
            &["knit", "--gauge", "22,0", "-o", "a.bcc"],
            "error: invalid value '22,0' for '--gauge <WALES,COURSES>': expected stitches and rows from 0.001",
        ),
        (
            &["weave", "--width", "10", "--warps", "9", "-o", "a.bcc"],
            "error: the argument '--width <L>' cannot be used with '--warps <N>'",
        ),
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

/// One straight yarn of the library: its plies and fibres are where the yarn's description says.
#[test]
fn plies_and_fibres_are_written_with_their_yarn_and_colour() {
    let folder = directory();
    let d = folder.path();
    write(d, "line.txt", "-6 0 0\n-3 0 0\n0 0 0\n3 0 0\n6 0 0\n\n-6 9 0\n-3 9 0\n0 9 0\n3 9 0\n6 9 0\n");
    write(
        d,
        "own.toml",
        "[fiber.red]\ntt = [0.5, 0.1, 0.1]\nd = [0.3, 0.1, 0.1]\n[fiber.white]\ntt = [0.5, 0.5, 0.5]\nd = [0.4, 0.4, 0.4]\n\
         [yarn.marl]\nradius = 0.5\nply_twist = 20\nply_distance = 0.25\n[[yarn.marl.ply]]\nfiber = \"red\"\nfibers = 7\ndensity = 0.3\nply_radius = 0.2\n\
         [[yarn.marl.ply]]\nfiber = \"white\"\nfibers = 5\ndensity = 0.3\nply_radius = 0.2\n",
    );
    let args = ["convert", "line.txt", "out.usda", "--unit", "cm", "--yarn", "marl", "--library", "own.toml", "--as"];
    let read = |level: &str, file: &str| {
        let args = [&args[..2], &[file], &args[3..], &[level]].concat();
        yarnray(d, &args).good();
        curve_file::read(&d.join(file), &ReadOptions::default()).unwrap()
    };
    let yarns = read("yarns", "y.usda");
    assert_eq!((yarns.curves.len(), yarns.plies.len(), yarns.unit_mm), (2, 0, Some(10.0)));
    assert!((yarns.curves[0].radii.as_ref().unwrap()[0] - 0.05).abs() < 1e-7, "0.5 mm in centimetres");
    let plies = read("plies", "p.usdc");
    assert_eq!(plies.ids, [0, 1, 0, 1].map(Some));
    assert_eq!(plies.plies, [0, 0, 1, 1].map(Some));
    for (i, curve) in plies.curves.iter().enumerate() {
        let [r, g, b] = plies.colors[i].unwrap();
        assert!(if i < 2 { r > 2.0 * g && g == b } else { r == g && g == b }, "{i}: {r} {g} {b}");
        let axis = 9.0 * plies.ids[i].unwrap() as f64;
        // The points that its B-spline passes.
        for w in curve.points.windows(3) {
            let p = (w[0] + 4.0 * w[1] + w[2]) / 6.0;
            let distance = (p.y - axis).hypot(p.z);
            assert!((distance - 0.025).abs() < 5e-6, "0.25 mm from the axis: {distance}");
        }
        assert!(curve.radii.as_ref().unwrap().iter().all(|r| (0.0185..=0.0201).contains(r)), "{:?}", curve.radii);
    }
    let fibers = read("fibers", "f.usdc");
    assert_eq!(fibers.curves.len(), 2 * (7 + 5));
    let of =
        |yarn: i64, ply: i64| (0..24).filter(|&i| fibers.ids[i] == Some(yarn) && fibers.plies[i] == Some(ply)).count();
    assert_eq!([of(0, 0), of(1, 0), of(0, 1), of(1, 1)], [7, 7, 5, 5]);
    // Each is within its ply, and as wide as its share of the ply's section says.
    let radius = 0.02 * (0.3f64 / 7.0).sqrt();
    let own = fibers.curves[0].radii.as_ref().unwrap();
    assert!(own.iter().all(|r| (r - radius).abs() < 1e-6 * radius.max(1.0)), "{radius}: {own:?}");
    // Without a yarn nobody knows what plies there are; without a unit nobody knows how thick they are.
    let refused = yarnray(d, &["convert", "line.txt", "n.usda", "--as", "plies"]);
    assert!(refused.stderr.contains("--as plies needs to know") && !d.join("n.usda").exists(), "{}", refused.stderr);
    let refused = yarnray(d, &["convert", "line.txt", "n.usda", "--as", "plies", "--yarn", "wool"]);
    assert!(refused.stderr.contains("a yarn needs the unit of its curves"), "{}", refused.stderr);
    let refused = yarnray(d, &["make", "knit", "--yarn", "wol", "-o", "n.usda"]);
    assert!(refused.stderr.contains("did you mean \"wool\"?"), "{}", refused.stderr);
    let lost = yarnray(d, &["convert", "p.usdc", "p.hair"]).good().stderr;
    assert!(lost.contains("numbers of plies are lost") && lost.contains("colours are lost"), "{lost}");
}

/// What a scene's cloth is of, made in the scene's mode: the same curves under every command.
#[test]
fn commands_agree_on_what_a_yarn_is_made_of() {
    let folder = directory();
    let d = folder.path();
    let library = project("scenes/yarns.toml");
    let scene = format!(
        "library = [{library:?}]\n[camera]\ntype = \"frame\"\n[[fabric]]\nyarn = \"cotton\"\nphase = 0\n\
         source = {{ type = \"straight\", count = 2, length = 4 }}\n"
    );
    write(d, "s.toml", scene);
    yarnray(d, &["make", "fibers", "s.toml", "--mode", "ply", "-o", "p.usda", "-o", "p.txt"]).good();
    let plies = curve_file::read(&d.join("p.usda"), &ReadOptions::default()).unwrap();
    assert_eq!(plies.ids.iter().flatten().max(), Some(&1));
    assert!(plies.colors.iter().all(Option::is_some) && plies.plies.iter().all(Option::is_some));
    let text = curve_file::read(&d.join("p.txt"), &ReadOptions::default()).unwrap();
    assert_eq!(text.curves.len(), plies.curves.len());
}

/// Pile and fringe of a plied yarn follow from the room that it takes, whoever weaves it.
#[test]
fn commands_and_scenes_weave_the_same_cloth() {
    let folder = directory();
    let d = folder.path();
    let library = project("scenes/yarns.toml");
    for (draft, edges) in [("terry", "live"), ("plain", "fringe")] {
        let source =
            format!("type = \"weave\", draft = {draft:?}, warps = 6, wefts = 6, edges = {edges:?}, flatten = 1");
        let fabric = format!("[[fabric]]\nyarn = \"polyester1\"\nphase = 0\nsource = {{ {source} }}\n");
        write(d, "s.toml", format!("library = [{library:?}]\n{fabric}"));
        yarnray(d, &["make", "fibers", "s.toml", "--mode", "ply", "-o", "scene.usdc"]).good();
        let counts = ["--warps", "6", "--wefts", "6", "--as", "plies", "-o", "made.usdc"];
        let command = ["make", "weave", "--draft", draft, "--edges", edges, "--yarn", "polyester1"];
        yarnray(d, &[command, counts].concat()).good();
        let size = |file: &str| {
            let set = curve_file::read(&d.join(file), &ReadOptions::default()).unwrap();
            let all = || set.curves.iter().flat_map(|c| &c.points).copied();
            let (low, high) = (all().reduce(|a, b| a.min(b)).unwrap(), all().reduce(|a, b| a.max(b)).unwrap());
            (all().count(), high - low)
        };
        let ((points, made), (wanted_points, wanted)) = (size("made.usdc"), size("scene.usdc"));
        assert_eq!(points, wanted_points, "{draft}");
        // Plies turn about their yarns from other places; by the yarns' radii all would be larger by a fifth.
        assert!(made.abs_diff_eq(wanted, 0.02 * wanted.max_element()), "{draft}: {made}, not {wanted}");
    }
}

#[test]
fn make_garment_writes_the_yarns_of_any_scene() {
    let folder = directory();
    let d = folder.path();
    let source = "source = { type = \"knit\", stitches = 6, rows = 5 }";
    write(d, "s.toml", format!("[[fabric]]\nyarn = \"wool\"\n{source}\n"));
    let run = yarnray(d, &["make", "garment", "s.toml", "-o", "y.txt"]).good();
    assert!(run.stderr.contains("1 yarn, ") && !run.stderr.contains("stitch"), "{}", run.stderr);
    assert!(!curve_file::read(&d.join("y.txt"), &ReadOptions::default()).unwrap().curves.is_empty());
    // What a format does not say is said, and only there.
    let told = "y.txt: its points are those of B-splines, which its format does not say";
    assert!(run.stderr.contains(told), "{}", run.stderr);
    let run = yarnray(d, &["make", "garment", "s.toml", "-o", "y.bcc", "-o", "y.usda"]).good();
    assert!(!run.stderr.contains("B-splines"), "{}", run.stderr);
    // The scene and its files tell one length of yarn.
    let told = |file: &str| -> serde_json::Value {
        serde_json::from_str(&yarnray(d, &["info", file, "--json"]).good().stdout).unwrap()
    };
    let lengths = ["y.bcc", "y.usda"].map(|file| told(file)["length"].as_f64().unwrap());
    let of_scene = told("s.toml")["fabrics"][0]["length_mm"].as_f64().unwrap();
    assert!(lengths.iter().all(|l| (l / of_scene - 1.0).abs() < 1e-4), "{lengths:?} {of_scene}");
}

/// A chart that makes more or fewer stitches is knitted once, and its narrowest and widest rows are told.
#[test]
fn shaped_charts_are_knitted_once_and_tell_their_widths() {
    let folder = directory();
    let d = folder.path();
    let said = |args: &[&str]| yarnray(d, &[&["make", "knit", "-o", "a.bcc"], args].concat()).stderr;
    let bound = ["--chart", "6: k", "--chart", "bo4 k8", "--chart", "6: k", "--stitches", "12"];
    let told = said(&bound);
    assert!(told.contains("8 to 12 x 13, ") && !told.contains("warning"), "{told}");
    let told = said(&[&bound[..], &["--rows", "20"]].concat());
    assert!(told.contains("row 20 ") && told.contains("or knit 13 rows, the whole chart; up to 19 fit"), "{told}");
    let wider = "Row 1 (RS): k1, m1l, k to last st, m1r, k1.\nRow 2: Purl.\nRep rows 1-2 until you have 9 sts.";
    let told = said(&["--instructions", wider, "--stitches", "3", "--gauge", "25,40"]);
    assert!(told.contains("3 to 9 x 6, 12.000 to 36.000 wide, 15.000 high; "), "{told}");
    let told = said(&["--profile", "40,0", "--profile", "30,20", "--stitches", "60", "--rows", "10"]);
    assert!(
        told.contains("60 x 10, ") && told.contains(" around, ") && told.contains(" along the profile; "),
        "{told}"
    );
    // A scene says the same.
    let source = "{ type = \"knit\", stitches = 12, chart = [\"6: k\", \"bo4 k8\", \"6: k\"], gauge = [25, 40] }";
    write(d, "s.toml", format!("[[fabric]]\nyarn = \"wool\"\nsource = {source}\n"));
    let told = yarnray(d, &["info", "s.toml"]).good().stdout;
    assert!(told.contains("8 to 12 x 13, ") && told.contains("32 to 48 mm wide, 32 mm high, "), "{told}");
}

/// What a scene warns of, `make knit` tells too.
#[test]
fn make_knit_warns_as_a_scene_does() {
    let folder = directory();
    let d = folder.path();
    // What is cut off.
    let source = "{ type = \"knit\", stitches = 6, rows = 8, chart = [\"8: k6\", \"p6\"] }";
    write(d, "s.toml", format!("[[fabric]]\nyarn = \"wool\"\nsource = {source}\n"));
    let of_scene = yarnray(d, &["info", "s.toml"]).good().stdout;
    let made = ["make", "knit", "--stitches", "6", "--rows", "8", "--chart", "8: k6", "--chart", "p6", "-o", "a.bcc"];
    let told = yarnray(d, &made).good().stderr;
    let cut_off = "8 rows are knitted of a chart of 9";
    assert!(
        told.contains(&format!("warning: {cut_off}\n")) && of_scene.contains(&format!("knit: {cut_off}\n")),
        "{told}"
    );
    let quiet = yarnray(d, &[&made[..], &["--quiet"]].concat()).good().stderr;
    assert!(quiet.is_empty(), "{quiet}");
    // A repeat that does not go into its rounds.
    let tube = |stitches: &str| {
        let made =
            ["make", "knit", "--pattern", "rib2x2", "--form", "tube", "--rows", "4", "-o", "b.bcc", "--stitches"];
        yarnray(d, &[&made[..], &[stitches]].concat()).good().stderr
    };
    let told = tube("30");
    let breaks = "the pattern repeats after 4 stitches and breaks where rounds of 30 begin; 28 or 32 would hold it";
    assert!(told.contains(&format!("warning: {breaks}\n")), "{told}");
    assert!(!tube("32").contains("warning"));
    // What finds no room.
    let made = ["make", "knit", "--stitches", "24", "--rows", "12", "--chart", "8: k24", "--chart", "12/12lc"];
    let size = ["--stitch-width", "3", "--row-height", "2.2", "-o", "b.bcc"];
    let told = yarnray(d, &[&made[..], &size].concat()).good().stderr;
    assert!(told.contains("warning: ") && told.contains("% of the yarn overlaps, by up to"), "{told}");
    assert!(told.contains("24 stitches change places in a row"), "{told}");
    let made = ["make", "weave", "--draft", "double cloth", "--edges", "selvedge", "-o", "b.bcc"];
    let told = yarnray(d, &[&made[..], &["--warps", "4", "--wefts", "5"]].concat()).good().stderr;
    assert!(told.contains("% of the yarn overlaps, by up to") && told.contains("a wider setting"), "{told}");
    assert!(!yarnray(d, &made).good().stderr.contains("warning"));
    // What is too low for its hems, in the unit of the scene.
    write(
        d,
        "low.toml",
        "unit = \"cm\"\n[[fabric]]\nyarn = \"wool\"\nsource = { type = \"weave\", wefts = 6, edges = \"finished\" }\n",
    );
    let told = yarnray(d, &["info", "low.toml"]).good().stdout;
    assert!(told.contains("hems take a height of ") && told.contains("it has selvedges alone"), "{told}");
}

/// The yarn of a weave is that of its file: selvedges, hems and fringes take some too.
#[test]
fn make_weave_tells_the_yarn_of_its_edges() {
    let folder = directory();
    let d = folder.path();
    let mut lengths = Vec::new();
    for edges in ["live", "selvedge", "finished", "fringe"] {
        let said = yarnray(d, &["make", "weave", "--edges", edges, "-o", "a.bcc"]).good().stderr;
        let number = |end: &str| -> f64 {
            let number = said.split(end).next().and_then(|s| s.rsplit(' ').next());
            number.and_then(|n| n.parse().ok()).unwrap_or_else(|| panic!("{said}"))
        };
        let info = yarnray(d, &["info", "a.bcc", "--json"]).good().stdout;
        let of_file = serde_json::from_str::<serde_json::Value>(&info).unwrap()["length"].as_f64().unwrap();
        let told = number(" of warp") + number(" of weft");
        assert!((told / of_file - 1.0).abs() < 0.01, "{edges}: {told} {of_file}");
        lengths.push(told);
    }
    assert!(lengths[1..].iter().all(|length| *length > 1.01 * lengths[0]), "{lengths:?}");
}

/// A line on overlap says of which diameter it is.
#[test]
fn overlap_says_its_diameter() {
    let folder = directory();
    let d = folder.path();
    let made = ["make", "knit", "--stitches", "8", "--rows", "6", "-o", "a.usdc"];
    let plied = yarnray(d, &[&made[..], &["--yarn", "wool"]].concat()).good().stderr;
    assert!(plied.contains("(they touch at 1), by the mean width of plied yarn, 0."), "{plied}");
    let of_file = yarnray(d, &["info", "a.usdc"]).good().stdout;
    let by_file = "(they touch at 1), by the radius in the file: plied yarns that nestle count as overlapping\n";
    assert!(of_file.contains(by_file), "{of_file}");
    // For programs too.
    let diameter = |args: &[&str]| {
        let json = yarnray(d, &[&["info", "--json"], args].concat()).good().stdout;
        serde_json::from_str::<serde_json::Value>(&json).unwrap()["overlap"]["diameter"].as_str().unwrap().to_owned()
    };
    assert_eq!(diameter(&["a.usdc"]), "radius in the file");
    assert_eq!(diameter(&["a.usdc", "--radius", "0.4"]), "radius asked for");
    write(d, "s.toml", "[[fabric]]\nyarn = \"wool\"\nsource = { type = \"stockinette\", stitches = 4, rows = 4 }\n");
    assert_eq!(diameter(&["s.toml"]), "mean width of plied yarn");
    let round = yarnray(d, &made).good().stderr;
    assert!(round.contains("(they touch at 1), by the radius written\n"), "{round}");
}

/// "Until piece measures" is how high the piece is, whatever a row of the yarn is, unless rows or a height are asked for.
#[test]
fn pieces_measure_what_their_instructions_say() {
    let folder = directory();
    let d = folder.path();
    let text = "Cast on 8 sts\\nRow 1: knit\\nRow 2: purl\\nRep rows 1-2 until piece measures 3 cm\\nBind off";
    let of_lines = text.replace("\\n", "\n");
    let high = |more: &[&str]| -> f64 {
        let say =
            yarnray(d, &[&["make", "knit", "--instructions", &of_lines, "-o", "a.bcc"], more].concat()).good().stderr;
        let number = say.split(" high").next().and_then(|s| s.rsplit(' ').next());
        number.and_then(|n| n.parse().ok()).unwrap_or_else(|| panic!("{say}"))
    };
    let ends = |side: &str| {
        let text = of_lines.replace("3 cm", &format!("3 cm, ending with a {side} row"));
        let made = ["make", "knit", "--gauge", "25,40", "--instructions", &text, "-o", "a.bcc"];
        yarnray(d, &made).good().stderr
    };
    assert!(ends("WS").contains("8 x 12, ") && ends("RS").contains("8 x 13, "), "{} {}", ends("WS"), ends("RS"));
    assert!((high(&["--yarn", "wool"]) - 30.0).abs() < 1.5, "{}", high(&["--yarn", "wool"]));
    assert!((high(&["--radius", "0.2"]) - 30.0).abs() < 0.6, "{}", high(&["--radius", "0.2"]));
    assert!(high(&["--yarn", "wool", "--rows", "4"]) < 15.0);
    let scene = format!("[[fabric]]\nyarn = \"wool\"\nsource = {{ type = \"knit\", instructions = \"{text}\" }}\n");
    write(d, "s.toml", &scene);
    let told = yarnray(d, &["info", "s.toml"]).good().stdout;
    // Rows of about 2.8 mm.
    assert!(["8 x 10,", "8 x 11,"].iter().any(|size| told.contains(size)), "{told}");
    write(d, "s.toml", scene.replace("type = \"knit\"", "type = \"knit\", height = 60"));
    let told = yarnray(d, &["info", "s.toml"]).good().stdout;
    assert!(["8 x 21,", "8 x 22,"].iter().any(|size| told.contains(size)), "{told}");
}

#[test]
fn written_instructions_are_knitted_from_the_command_line_and_from_a_file() {
    let folder = directory();
    let d = folder.path();
    let text = "Row 1 (RS): *k2, p2; rep from * to end.\nRow 2: *k2, p2; rep from * to end.\n";
    write(d, "rib.txt", text);
    let size = ["--stitches", "8", "--rows", "6"];
    for (how, out) in [(text, "a.txt"), ("@rib.txt", "b.txt")] {
        yarnray(d, &[&["make", "knit", "--instructions", how, "-o", out], &size[..]].concat()).good();
    }
    let read = |name: &str| std::fs::read(d.join(name)).unwrap();
    assert_eq!(read("a.txt"), read("b.txt"));
    // What is repeated without an end has as many rows as a chart, also where the text binds it off.
    let bound_off = text.to_owned() + "Rep rows 1-2. Bind off.";
    for (how, rows, out) in [(&*bound_off, None, "d.txt"), (text, Some("20"), "e.txt")] {
        let rows = rows.map_or(Vec::new(), |rows| vec!["--rows", rows]);
        let piece = ["make", "knit", "--stitches", "8", "--instructions", how, "-o", out];
        yarnray(d, &[&piece[..], &rows].concat()).good();
    }
    assert_eq!(read("d.txt"), read("e.txt"));
    // Charts are read from left to right, instructions from where a row begins.
    let rows = ["--chart", "p2 k2 p2 k2", "--chart", "p2 k2 p2 k2"];
    yarnray(d, &[&["make", "knit", "-o", "c.txt"], &rows[..], &size[..]].concat()).good();
    assert_eq!(read("a.txt"), read("c.txt"));
}

/// Short rows and brioche of instructions are those of charts.
#[test]
fn written_short_rows_and_brioche_are_those_of_charts() {
    let folder = directory();
    let d = folder.path();
    let wedge = "Row 1 (RS): k\nRow 2: p\nShort row 3 (RS): k to last 4 sts, w&t\nShort row 4 (WS): p to end\n\
                 Row 5: k to 3 sts before last wrapped st, w&t\nRow 6: p\nRow 7: k, picking up wraps\nRow 8: p\nBind off.";
    let of_charts =
        ["2: k", "-3 sl k8", "-3 ds k8", "-6 sl k5", "-6 ds k5", "2: k12"].map(|row| ["--chart", row]).concat();
    let brioche = "Row 1: *sl1yo, brk1; rep from *\nRow 2: *sl1yo, brk1; rep from *";
    let pairs: [[(&[&str], &str); 2]; 2] = [
        [(&["--instructions", wedge], "8"), (&of_charts, "8")],
        [(&["--instructions", brioche], "6"), (&["--pattern", "brioche"], "6")],
    ];
    for pair in pairs {
        let made = pair.map(|(how, rows)| {
            let size = ["--stitches", "12", "--rows", rows, "-o", "a.txt"];
            yarnray(d, &[&["make", "knit"], how, &size[..]].concat()).good();
            std::fs::read(d.join("a.txt")).unwrap()
        });
        assert!(made[0] == made[1], "{pair:?}");
    }
}

/// `make knit --motif` knits what a scene with that motif does: a yarn for each colour, dyed with it.
#[test]
fn commands_and_scenes_knit_the_same_colours() {
    let folder = directory();
    let d = folder.path();
    let motif =
        "motif = { rows = [\".#..\", \"###.\"], offset = [1, 0], yarns = { \".\" = \"wool\", \"#\" = \"grey_wool\" } }";
    let source =
        "type = \"knit\", stitches = 9, rows = 8, flatten = 1, color_work = \"WORK\", catch_floats = 2, carry_rows = 1";
    for work in ["stranded", "intarsia", "double-knit"] {
        let source = source.replace("WORK", work);
        write(d, "s.toml", format!("[[fabric]]\nyarn = \"wool\"\n{motif}\nsource = {{ {source} }}\n"));
        yarnray(d, &["make", "garment", "s.toml", "-o", "scene.yarns"]).good();
        let piece = ["make", "knit", "--yarn", "wool", "--stitches", "9", "--rows", "8", "-o", "made.yarns"];
        let signs = ["--motif", ".#..", "--motif", "###.", "--motif-offset", "1,0"];
        let colors = ["--color", ".=#f0e8d8", "--color", "#=#c02a1f"];
        let how = ["--color-work", work, "--catch-floats", "2", "--carry-rows", "1"];
        yarnray(d, &[&piece[..], &signs, &colors, &how].concat()).good();
        let [scene, made] = ["scene", "made"]
            .map(|n| curve_file::read(&d.join(format!("{n}.yarns")), &ReadOptions::default()).unwrap());
        let lengths = |set: &CurveSet| set.curves.iter().map(|c| c.polygon_length()).collect::<Vec<_>>();
        let (wanted, found) = (lengths(&scene), lengths(&made));
        assert_eq!(wanted.len(), found.len(), "{work}");
        assert!(found.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 0.01 * b), "{work}: {found:?}, not {wanted:?}");
        let reds = made.colors.iter().flatten().filter(|c| c[0] > 2.0 * c[1]).count();
        assert!(reds > 0 && reds < made.colors.len(), "{work}: {reds} yarns of {} are red", made.colors.len());
    }
    // A picture is the same motif; a format without colours is told.
    let mut encoder = png::Encoder::new(std::fs::File::create(d.join("m.png")).unwrap(), 4, 2);
    encoder.set_color(png::ColorType::Rgb);
    let pixels = [[0, 1, 0, 0], [1, 1, 1, 0]].concat();
    let pixels: Vec<u8> = pixels.into_iter().flat_map(|p| if p == 1 { [190, 40, 30] } else { [250; 3] }).collect();
    encoder.write_header().unwrap().write_image_data(&pixels).unwrap();
    let size = ["--stitches", "9", "--rows", "8"];
    let from = |motif: &[&str], out: &str| {
        let args = [&["make", "knit", "-o", out], &size[..], motif].concat();
        (yarnray(d, &args).good().stderr, std::fs::read(d.join(out)).unwrap())
    };
    let signs = ["--motif", ".#..", "--motif", "###.", "--color", ".=#ffffff", "--color", "#=#c02a1f"];
    let picture = ["--motif", "@m.png", "--color", "#ffffff", "--color", "#ff0000=#c02a1f"];
    let ((said, signs), (_, picture)) = (from(&signs, "a.txt"), from(&picture, "b.txt"));
    assert!(signs == picture);
    assert!(said.contains("a.txt: its format holds no colours"), "{said}");
}

#[test]
fn set_up_rows_and_a_cast_on_are_followed_from_the_command_line() {
    let folder = directory();
    let d = folder.path();
    let text = "Cast on 8 sts.\nSet-up row (WS): p\nRow 1 (RS): *k2, p2; rep from * to end.\nRow 2: *k2, p2; rep from * to end.\nRep rows 1-2";
    yarnray(d, &["make", "knit", "--instructions", text, "--rows", "5", "-o", "a.txt"]).good();
    let rib = ["--chart", "k8", "--chart", "4: p2 k2 p2 k2", "--stitches", "8", "--rows", "5"];
    yarnray(d, &[&["make", "knit", "-o", "b.txt"], &rib[..]].concat()).good();
    assert_eq!(std::fs::read(d.join("a.txt")).unwrap(), std::fs::read(d.join("b.txt")).unwrap());
}

#[test]
fn info_and_render_warn_alike_and_once() {
    let folder = directory();
    let d = folder.path();
    let draft = "source = { type = \"weave\", draft = [\"##\", \"##\"], warps = 2, wefts = 2, edges = \"live\" }";
    write(d, "s.toml", format!("light = []\n[[fabric]]\nyarn = \"wool\"\n{draft}\n"));
    let small = ["--width", "8", "--height", "6", "--spp", "1", "-o", "a.png"];
    let rendered = yarnray(d, &[&["render", "s.toml"], &small[..]].concat()).good().stderr;
    let info: serde_json::Value =
        serde_json::from_str(&yarnray(d, &["info", "s.toml", "--json"]).good().stdout).unwrap();
    let told: Vec<&str> = info["warnings"].as_array().unwrap().iter().map(|w| w.as_str().unwrap()).collect();
    assert!(told.iter().any(|w| w.contains("no light")) && told.iter().any(|w| w.contains("does not interlace")));
    for warning in told {
        assert!(rendered.contains(&format!("warning: {warning}\n")) && !warning.contains("warning"), "{rendered}");
    }
    let made = yarnray(d, &["make", "weave", "--draft", "##.", "--draft", "##.", "-o", "w.bcc"]).good().stderr;
    assert!(
        made.contains("note: this draft does not interlace: warp 1, 2, 3 of each 3 x 2 never change sides"),
        "{made}"
    );
}
