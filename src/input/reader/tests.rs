//! Whole messages, from text to what the user sees.

use super::*;
use crate::input::diagnostic::{Sources, unknown_name};

/// Reads a scene of a small made-up renderer and gives the messages.
fn check_with(text: &str, options: &[&str]) -> String {
    let mut sources = Sources::new();
    let diagnostics = Diagnostics::new();
    let document = Document::parse("scenes/x.toml", text, &mut sources, &diagnostics);
    if let Some(mut document) = document {
        for option in options {
            document.apply_option(option, &mut sources, &diagnostics);
        }
        read_sample(&document, &diagnostics);
    }
    diagnostics.render(&sources)
}

fn check(text: &str) -> String {
    check_with(text, &[])
}

fn read_sample(document: &Document, diagnostics: &Diagnostics) {
    let root = Reader::new(document, diagnostics);
    root.strings("library");
    if let Some(render) = root.table("render") {
        render.u64_or("spp", 64, 1..=65536);
        render.u64_or("seed", 0, 0..=u64::MAX);
        render.bool_or("denoise", false);
        render.one_of_or("filter", 0, &[("box", 0), ("gaussian", 1)]);
        render.finish();
    }
    for (_, yarn) in root.named_tables("yarn") {
        yarn.required_f64("radius", Range::POSITIVE);
        yarn.f64_or("ply_twist", 0.0, Range::FINITE);
        yarn.rgb_or("absorption", [0.0; 3], Range::at_least(0.0));
        yarn.numbers("lobes", Range::UNIT);
        if let Some(fiber) = yarn.string("fiber")
            && fiber != "silk"
        {
            let (message, hint) = unknown_name("fiber", fiber, ["silk", "wool"]);
            yarn.error_at("fiber", message, Some(&hint));
        }
        yarn.finish();
    }
    for light in root.tables("light") {
        if light.required("radiance") {
            light.rgb("radiance", Range::at_least(0.0));
        }
        light.vec3_or("direction", [0.0, 0.0, 1.0], Range::FINITE);
        if let Some(shape) = light.table("shape") {
            shape.vec2("size", Range::POSITIVE);
            shape.finish();
        }
        light.finish();
    }
    root.finish();
}

#[test]
fn a_good_scene_is_silent() {
    let text = "library = 'a.toml'\n[render]\nspp = 1_000\nseed = 0x10\n[yarn.silk1]\nradius = 1\nfiber = 'silk'\n\
        absorption = [0, 0.5, 1e3]\nlobes = [0, 1]\n[[light]]\nradiance = 1\nshape = { size = [1, 2] }\n\
        [[light]]\nradiance = [1, 2, 3]\n";
    assert_eq!(check(text), "");
    assert_eq!(check(""), "");
    assert_eq!(check("\u{feff}library = []\r\n"), "");
    // One table is an array of one.
    assert_eq!(check("[light]\nradiance = 1"), "");
}

#[test]
fn unknown_key_with_a_suggestion() {
    assert_eq!(
        check("[yarn.silk1]\nradius = 1\nradus = 0.3\n"),
        "scenes/x.toml:3:1: error: unknown key `radus` in [yarn.silk1]\n    3 | radus = 0.3\n      \
         | ^^^^^ did you mean `radius`?\n"
    );
    assert_eq!(
        check("[yarm.silk1]\nradius = 1\n"),
        "scenes/x.toml:1:2: error: unknown key `yarm`\n    1 | [yarm.silk1]\n      |  ^^^^ did you mean `yarn`?\n"
    );
}

#[test]
fn unknown_key_without_a_suggestion() {
    assert_eq!(
        check("[[light]]\nradiance = 1\n[[light]]\nradiance = 1\nwattage = 3\nshape.\"ö x\" = 1\n"),
        "scenes/x.toml:5:1: error: unknown key `wattage` in [[light]] 2\n    5 | wattage = 3\n      \
         | ^^^^^^^ known keys: `radiance`, `direction` and `shape`\n\
         scenes/x.toml:6:7: error: unknown key `ö x` in [light.shape] of [[light]] 2\n    6 | shape.\"ö x\" = 1\n      \
         |       ^^^^^ known keys: `size`\n"
    );
}

#[test]
fn wrong_types() {
    assert_eq!(
        check("[yarn.a]\nradius = '1'\n"),
        "scenes/x.toml:2:10: error: `radius`: expected a number, found a string\n    2 | radius = '1'\n      \
         |          ^^^\n"
    );
    assert_eq!(
        check("[render]\nspp = 1e3\nseed = 1.5\ndenoise = 1\n"),
        "scenes/x.toml:2:7: error: `spp`: expected an integer, found a float\n    2 | spp = 1e3\n      \
         |       ^^^ write 1000\n\
         scenes/x.toml:3:8: error: `seed`: expected an integer, found a float\n    3 | seed = 1.5\n      |        ^^^\n\
         scenes/x.toml:4:11: error: `denoise`: expected true or false, found an integer\n    4 | denoise = 1\n      \
         |           ^\n"
    );
    assert_eq!(
        check("render = 1\nyarn = []\nlight = [1]\nlibrary = [true]"),
        "scenes/x.toml:1:10: error: `render`: expected a table, found an integer\n    1 | render = 1\n      \
         |          ^\n\
         scenes/x.toml:2:8: error: `yarn`: expected a table, found an array\n    2 | yarn = []\n      |        ^^\n\
         scenes/x.toml:3:10: error: `light`: expected a table or an array of tables, found an integer\n    \
         3 | light = [1]\n      |          ^\n\
         scenes/x.toml:4:12: error: `library`: expected a string or an array of strings, found a boolean\n    \
         4 | library = [true]\n      |            ^^^^\n"
    );
    assert_eq!(
        check("[light]\nradiance = [1, 2]\ndirection = 1"),
        "scenes/x.toml:2:12: error: `radiance`: expected a number or an array of 3 numbers, found 2 in the array\n    \
         2 | radiance = [1, 2]\n      |            ^^^^^^\n\
         scenes/x.toml:3:13: error: `direction`: expected an array of 3 numbers, found an integer\n    \
         3 | direction = 1\n      |             ^\n"
    );
}

#[test]
fn out_of_range() {
    assert_eq!(
        check("[yarn.a]\nradius = -0.3\nply_twist = nan\nabsorption = [0, -inf, 1e400]\n"),
        "scenes/x.toml:4:24: error: the number is too large\n    4 | absorption = [0, -inf, 1e400]\n      \
         |                        ^^^^^\n"
    );
    assert_eq!(
        check("[yarn.a]\nradius = -0.3\nply_twist = nan\nabsorption = [0, -inf, 1]\nlobes = [2]\n"),
        "scenes/x.toml:2:10: error: `radius` must be above 0, found -0.3\n    2 | radius = -0.3\n      \
         |          ^^^^\n\
         scenes/x.toml:3:13: error: `ply_twist` must be finite, found nan\n    3 | ply_twist = nan\n      \
         |             ^^^\n\
         scenes/x.toml:4:18: error: `absorption` must be at least 0, found -inf\n    4 | absorption = [0, -inf, 1]\n      \
         |                  ^^^^\n\
         scenes/x.toml:5:10: error: `lobes` must be from 0 to 1, found 2\n    5 | lobes = [2]\n      |          ^\n"
    );
    assert_eq!(
        check("[render]\nspp = 0\nseed = -1\n"),
        "scenes/x.toml:2:7: error: `spp` must be from 1 to 65536, found 0\n    2 | spp = 0\n      |       ^\n\
         scenes/x.toml:3:8: error: `seed` must be at least 0, found -1\n    3 | seed = -1\n      |        ^^\n"
    );
    assert_eq!(
        check("[render]\nseed = 99999999999999999999\n"),
        "scenes/x.toml:2:8: error: the integer is too large\n    2 | seed = 99999999999999999999\n      \
         |        ^^^^^^^^^^^^^^^^^^^^ at most 63 bits\n"
    );
}

#[test]
fn missing_key() {
    assert_eq!(
        check("# thin\n[yarn.silk1]\nfiber = 'silk'\n[[light]]\n"),
        "scenes/x.toml:2:1: error: missing key `radius` in [yarn.silk1]\n    2 | [yarn.silk1]\n      | ^^^^^^^^^^^^\n\
         scenes/x.toml:4:1: error: missing key `radiance` in [[light]] 1\n    4 | [[light]]\n      | ^^^^^^^^^\n"
    );
    assert_eq!(
        check("yarn = { a = {} }"),
        "scenes/x.toml:1:14: error: missing key `radius` in [yarn.a]\n    1 | yarn = { a = {} }\n      \
         |              ^^\n"
    );
    let mut sources = Sources::new();
    let diagnostics = Diagnostics::new();
    let document = Document::parse("scenes/x.toml", "", &mut sources, &diagnostics).unwrap();
    assert!(Reader::new(&document, &diagnostics).required_table("camera").is_none());
    assert_eq!(diagnostics.render(&sources), "scenes/x.toml: error: missing key `camera`\n");
}

#[test]
fn syntax_errors() {
    assert_eq!(
        check("[render]\nspp = [1, 2\n[yarn]\nb = 1\n"),
        "scenes/x.toml:3:1: error: missing comma between array elements\n    3 | [yarn]\n      \
         | ^ expected `,` or `]`\n"
    );
    assert_eq!(
        check("[render\nspp == 3\n[yarn.a]\nradius 3\nfiber = 'silk\nb = silk\n"),
        "scenes/x.toml:1:8: error: unclosed table\n    1 | [render\n      |        ^ expected `]`\n\
         scenes/x.toml:2:6: error: extra `=`\n    2 | spp == 3\n      |      ^\n\
         scenes/x.toml:4:8: error: key with no value\n    4 | radius 3\n      |        ^ expected `=`\n"
    );
    assert_eq!(
        check("a = 01\nb = {c = 1\n"),
        "scenes/x.toml:1:5: error: unexpected leading zero\n    1 | a = 01\n      |     ^\n\
         scenes/x.toml:2:11: error: unclosed inline table\n    2 | b = {c = 1\n      |           ^ expected `}`\n"
    );
    assert_eq!(
        check("a = 1979-05-27\n"),
        "scenes/x.toml:1:5: error: a date has no meaning here\n    1 | a = 1979-05-27\n      \
         |     ^^^^^^^^^^ write text in quotes\n"
    );
}

#[test]
fn duplicate_keys() {
    assert_eq!(
        check("[render]\nspp = 1\n\nspp = 2\n[render]\n"),
        "scenes/x.toml:4:1: error: the key `spp` is there twice\n    4 | spp = 2\n      | ^^^ remove one of the two\n\
         scenes/x.toml:5:2: error: the key `render` is there twice\n    5 | [render]\n      \
         |  ^^^^^^ remove one of the two\n"
    );
}

#[test]
fn unknown_choice_and_name() {
    assert_eq!(
        check("[render]\nfilter = 'gausian'\n[yarn.a]\nradius = 1\nfiber = \"slk\"\n"),
        "scenes/x.toml:2:10: error: unknown value \"gausian\" for `filter`\n    2 | filter = 'gausian'\n      \
         |          ^^^^^^^^^ did you mean \"gaussian\"?\n\
         scenes/x.toml:5:9: error: unknown fiber \"slk\"\n    5 | fiber = \"slk\"\n      \
         |         ^^^^^ did you mean \"silk\"?\n"
    );
    assert_eq!(
        check("[render]\nfilter = 'mitchell'\n"),
        "scenes/x.toml:2:10: error: unknown value \"mitchell\" for `filter`\n    2 | filter = 'mitchell'\n      \
         |          ^^^^^^^^^^ expected \"box\" or \"gaussian\"\n"
    );
}

#[test]
fn characters_before_the_caret() {
    assert_eq!(
        check("render = { filter = 'ä\u{1b}ß', spq = 1 }\n"),
        "scenes/x.toml:1:23: error: invalid literal string\n    1 | render = { filter = 'ä\\u{1b}ß', spq = 1 }\n      \
         |                       ^ expected non-single-quote visible characters\n"
    );
    assert_eq!(
        check("yarn = { 'grün' = { radius = 1, raduis = 2 } }\n"),
        "scenes/x.toml:1:33: error: unknown key `raduis` in [yarn.\"grün\"]\n    \
         1 | yarn = { 'grün' = { radius = 1, raduis = 2 } }\n      \
         |                                 ^^^^^^ did you mean `radius`?\n"
    );
}

#[test]
fn options() {
    let scene = "[render]\nspp = 1\n[[light]]\nradiance = 1\n[[light]]\nradiance = 1\n";
    let good = [
        "render.spp=16",
        "render.filter=box",
        "render.denoise = true",
        "light.1.radiance=[1, 2, 3]",
        "light.1.radiance.2=5",
        "yarn.silk1.radius=0.3",
        "yarn.'two words'.radius=1",
        "library=scenes/a b.toml",
        "yarn.silk1={ radius = 3 }",
    ];
    assert_eq!(check_with(scene, &good), "");
    assert_eq!(
        check_with(scene, &["yarn.silk1.radus=0.3", "render.spp=many", "render.seed= -1"]),
        "--set yarn.silk1.radus=0.3: error: missing key `radius` in [yarn.silk1]\n           ^^^^^\n\
         --set yarn.silk1.radus=0.3: error: unknown key `radus` in [yarn.silk1]\n                 \
         ^^^^^ did you mean `radius`?\n\
         --set render.spp=many: error: `spp`: expected an integer, found a string\n                 ^^^^\n\
         --set render.seed= -1: error: `seed` must be at least 0, found -1\n                   ^^\n"
    );
    assert_eq!(
        check_with(scene, &["yarn.silk1.radius=.3", "light.0.radiance=-5.", "render.spp=1."]),
        "--set yarn.silk1.radius=.3: error: `radius`: expected a number, found a string\n                        \
         ^^ in TOML a point stands between digits: write 0.3\n\
         --set light.0.radiance=-5.: error: `radiance`: expected a number or an array of 3 numbers, found a string\n                       \
         ^^^ in TOML a point stands between digits: write -5\n\
         --set render.spp=1.: error: `spp`: expected an integer, found a string\n                 \
         ^^ in TOML a point stands between digits: write 1\n"
    );
    assert_eq!(
        check_with(scene, &["light.0.radiance=[.45, 1, 2.]"]),
        "--set light.0.radiance=[.45, 1, 2.]: error: `radiance`: expected a number or an array of 3 numbers, found a \
         string\n                       ^^^^^^^^^^^^ in TOML a point stands between digits: write [0.45, 1, 2]\n"
    );
    assert_eq!(
        check_with(scene, &["light.2.radiance=1", "light.x.radiance=1", "render.spp.x=1", "lamp.0.radiance=1"]),
        "--set light.2.radiance=1: error: `light` has 2 entries, with indices from 0 to 1\n            ^\n\
         --set light.x.radiance=1: error: `light` is an array: expected an index, found `x`\n            ^\n\
         --set render.spp.x=1: error: `render.spp` is an integer, so it has no keys\n                 ^\n\
         --set lamp.0.radiance=1: error: there is no `lamp`, so it has no entries\n           ^\n"
    );
    assert_eq!(
        check_with(scene, &["render.spp", "render..spp=1", "=3", "", "'a=1", "'a'b=1", "a\nb=1"]),
        "--set render.spp: error: no value for `render.spp`\n      ^^^^^^^^^^ write KEY=VALUE, such as render.spp=16\n\
         --set render..spp=1: error: expected the name of a key\n             \
         ^ write KEY=VALUE, such as render.spp=16\n\
         --set =3: error: expected the name of a key\n      ^ write KEY=VALUE, such as render.spp=16\n\
         --set : error: expected KEY=VALUE\n      ^ write KEY=VALUE, such as render.spp=16\n\
         --set 'a=1: error: the quote ' is never closed\n      ^^^^ write KEY=VALUE, such as render.spp=16\n\
         --set 'a'b=1: error: expected `.` or `=` after a name\n         \
         ^ write KEY=VALUE, such as render.spp=16\n\
         --set a\\nb=1: error: unknown key `a\\nb`\n      \
         ^^^^ known keys: `library`, `render`, `yarn` and `light`\n"
    );
    assert_eq!(
        check_with(
            scene,
            &["light.1.radiance=[1, 2, 3]", "light.1.radiance.3=1", "render.spp=[1,", "render.seed=1e999"]
        ),
        "--set light.1.radiance.3=1: error: `light.1.radiance` has 3 entries, with indices from 0 to 2\n                       ^\n\
         --set render.spp=[1,: error: `spp`: expected an integer, found a string\n                 ^^^\n\
         --set render.seed=1e999: error: the number is too large\n                  ^^^^^\n"
    );
}

#[test]
fn options_of_the_program() {
    let mut sources = Sources::new();
    let diagnostics = Diagnostics::new();
    let mut document = Document::parse("x.toml", "[render]\nspp = 3", &mut sources, &diagnostics).unwrap();
    document.set("render.spp", 0_u32, "--spp 0", &mut sources, &diagnostics);
    document.set("render.seeed", 1_i64, "--seed 1", &mut sources, &diagnostics);
    document.set("render.denoise", "x", "--denoise", &mut sources, &diagnostics);
    read_sample(&document, &diagnostics);
    assert_eq!(
        diagnostics.render(&sources),
        "--spp 0: error: `spp` must be from 1 to 65536, found 0\n      ^\n\
         --seed 1: error: unknown key `seeed` in [render]\n^^^^^^ did you mean `seed`?\n\
         --denoise: error: `denoise`: expected true or false, found a string\n^^^^^^^^^\n"
    );
}

#[test]
fn libraries_lie_under_the_scene() {
    let mut sources = Sources::new();
    let diagnostics = Diagnostics::new();
    let mut parse = |path, text| Document::parse(path, text, &mut sources, &diagnostics).unwrap();
    let mut scene = parse("scene.toml", "[yarn.a]\nradius = 1\n[light]\nradiance = 1");
    let library = parse("library.toml", "[yarn.a]\nradius = -1\nply_twist = -inf\n[yarn.b]\nradius = 'x'\n");
    scene.apply_option("yarn.b.ply_twist=3", &mut sources, &diagnostics);
    scene.merge(library, &sources);
    let twist = scene.root.get("yarn").map(|entry| match &entry.node.value {
        Value::Table(yarns) => yarns.entries().map(|entry| entry.key.clone()).collect::<Vec<_>>(),
        _ => Vec::new(),
    });
    assert_eq!(twist, Some(vec!["a".to_owned(), "b".to_owned()]));
    read_sample(&scene, &diagnostics);
    assert_eq!(
        diagnostics.render(&sources),
        "library.toml:3:13: error: `ply_twist` must be finite, found -inf\n    3 | ply_twist = -inf\n      \
         |             ^^^^\n\
         library.toml:5:10: error: `radius`: expected a number, found a string\n    5 | radius = 'x'\n      \
         |          ^^^\n"
    );
}

#[test]
fn ranges_in_words() {
    let words = |range: Range| range.to_string();
    assert_eq!(words(Range::at_least(0.0)), "at least 0");
    assert_eq!(words(Range::above(0.0)), "above 0");
    assert_eq!(words(Range::between(0.0, 1.0)), "from 0 to 1");
    assert_eq!(words(Range::FINITE), "finite");
    assert_eq!(words(Range::above(0.0).and_at_most(1.0)), "above 0 and at most 1");
    assert_eq!(words(Range::above(0.0).and_below(180.0)), "above 0 and below 180");
    for range in [Range::FINITE, Range::at_least(0.0), Range::UNIT] {
        assert!(!range.contains(f64::NAN) && !range.contains(f64::INFINITY) && !range.contains(f64::NEG_INFINITY));
    }
    assert!(!Range::POSITIVE.contains(0.0) && Range::at_least(0.0).contains(0.0) && Range::UNIT.contains(1.0));
    assert!(!Range::above(0.0).and_below(1.0).contains(1.0));
}

#[test]
fn depth_is_limited() {
    let nested = |depth: usize| format!("library = {}{}", "[".repeat(depth), "]".repeat(depth));
    assert!(check(&nested(50)).contains("expected a string"), "{}", check(&nested(50)));
    let message = "scenes/x.toml:1:75: error: more than 64 arrays and tables inside each other\n";
    assert!(check(&nested(70)).starts_with(message), "{}", check(&nested(70)));
    for text in [
        nested(100_000),
        "a = ".to_owned() + &"[".repeat(100_000),
        "a = ".to_owned() + &"{a=".repeat(100_000),
        "a".to_owned() + &".a".repeat(100_000) + " = 1",
        "[a".to_owned() + &".a".repeat(100_000) + "]",
        // Dotted keys inside nested inline tables: the deepest tree the parser lets through.
        format!(
            "[{0}]\n{0} = {1}1{2}",
            vec!["a"; 79].join("."),
            format!("{{ {} = ", vec!["a"; 79].join(".")).repeat(79),
            "}".repeat(79)
        ),
    ] {
        assert!(check(&text).contains("more than 64 arrays and tables inside each other"), "{}", check(&text));
    }
    let option = format!("a{}=1", ".a".repeat(100_000));
    assert!(check_with("", &[&option]).contains("more than 64"));
    assert_eq!(check_with("", &[&nested(70).replace(' ', "")]).matches("more than 64").count(), 1);
}

/// Scenes and options with random damage never panic, whatever they say.
#[test]
fn random_damage_is_survived() {
    const CASES: u64 = 4000;
    const SCENE: &str = "library = ['a.toml', \"b\\u00e4.toml\"] # häufig\n[render]\nspp = 1_0\nseed = 0x1F\n\
        [yarn.silk1]\nradius = 1.5e-3\nfiber = '''silk'''\nlobes = [0, 1, nan]\n[yarn.\"grün絹\"]\nradius = -inf\n\
        [[light]]\nradiance = [1, 2,\n\t3]\nshape = { size = [1, 2] }\n[[light]]\nradiance = 0.5\n";
    const OPTIONS: &str = "light.1.shape.size=[1, {a=2}]";
    const PIECES: &[&str] = &[
        "[",
        "]",
        "[[",
        "]]",
        "{",
        "}",
        "=",
        ".",
        ",",
        "\"",
        "'",
        "'''",
        "\"\"\"",
        "\\",
        "\\u",
        "#",
        "\n",
        "\r\n",
        "\t",
        "\0",
        "\u{feff}",
        "é",
        "絹",
        "🧶",
        "0",
        "-",
        "_",
        "e",
        "inf",
        "nan",
        "true",
        "1e999",
        "light",
        "render",
        "yarn",
        "1979-05-27",
        "[light.shape]\n",
        "[[light.shape]]\n",
        "a.b = {c.d = 1}\n",
        " ",
    ];
    let cases = std::env::var("YARNRAY_FUZZ_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(CASES);
    let mut state = 1_u64;
    let mut random = move |below: usize| {
        // Knuth's constants; the low bits are poor, so the high ones are used.
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((state >> 33) as usize) % below.max(1)
    };
    // The sample itself is read to the end, so that the damage reaches every part.
    let wrong = check_with(SCENE, &[OPTIONS]);
    assert_eq!(wrong.matches("error").count(), 3, "{wrong}");
    let mut damaged = |text: &str| {
        let mut characters: Vec<char> = text.chars().collect();
        for _ in 0..=random(6) {
            let position = random(characters.len() + 1);
            let end = (position + random(12)).min(characters.len());
            match random(4) {
                0 => drop(characters.drain(position..end)),
                1 => {
                    let copy: Vec<char> = characters[position..end].to_vec();
                    let target = random(characters.len() + 1);
                    characters.splice(target..target, copy);
                }
                2 => drop(characters.splice(position..position, PIECES[random(PIECES.len())].chars())),
                _ => drop(characters.splice(position..end, PIECES[random(PIECES.len())].chars())),
            }
        }
        characters.into_iter().collect::<String>()
    };
    for case in 0..cases {
        let (scene, option) = (damaged(SCENE), damaged(OPTIONS));
        let scene = if case % 4 == 0 { SCENE.to_owned() } else { scene };
        let outcome = std::panic::catch_unwind(|| check_with(&scene, &[&option]));
        match outcome {
            Ok(messages) => {
                let hidden = |character: char| character.is_control() && character != '\n';
                assert!(!messages.contains(hidden), "case {case}: {messages:?}");
            }
            Err(_) => panic!("case {case} panicked:\n{scene:?}\nwith {option:?}"),
        }
    }
}
