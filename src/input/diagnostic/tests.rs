use super::{names::edit_distance, show::escaped, *};

fn render(text: &str, start: usize, end: usize, hint: &str) -> String {
    let mut sources = Sources::new();
    let id = sources.add_file("scenes/x.toml", text);
    let diagnostics = Diagnostics::new();
    let mut diagnostic = Diagnostic::error("wrong").at(Span::new(id, start, end));
    if !hint.is_empty() {
        diagnostic = diagnostic.hint(hint);
    }
    diagnostics.push(diagnostic);
    diagnostics.render(&sources)
}

#[test]
fn caret_stands_below_the_text() {
    assert_eq!(
        render("a = 1\nradus = 0.3\n", 6, 11, "did you mean `radius`?"),
        "scenes/x.toml:2:1: error: wrong\n    2 | radus = 0.3\n      | ^^^^^ did you mean `radius`?\n"
    );
}

#[test]
fn lines_of_a_long_text_have_their_place() {
    let line_of = |text: &str, line: usize| {
        let mut sources = Sources::new();
        let id = sources.add_file("scenes/x.toml", text);
        let start = text.find('=').unwrap() + 2;
        let value = Span::new(id, start, text.trim_end().len());
        let found = sources.line_of_text(value, line);
        text[found.start as usize..found.end as usize].to_owned()
    };
    let rows = "a = \"\"\"\nRow 1: k\n  Row 2: q  \n\"\"\"\n";
    assert_eq!([line_of(rows, 0), line_of(rows, 1)], ["Row 1: k", "Row 2: q"]);
    assert_eq!(line_of("a = '''Row 1: k\r\nRow 2: q'''", 1), "Row 2: q");
    // Where lines of the value are not those of the file, it is shown whole.
    assert_eq!(line_of("a = \"Row 1: k\"", 0), "\"Row 1: k\"");
    assert_eq!(line_of("a = \"\"\"Row 1: \\\nk\"\"\"", 0), "\"\"\"Row 1: \\\nk\"\"\"");
}

#[test]
fn columns_count_characters() {
    let text = "näme = \"größe\" + 1";
    let start = text.find('+').unwrap();
    assert_eq!(
        render(text, start, start + 1, ""),
        "scenes/x.toml:1:16: error: wrong\n    1 | näme = \"größe\" + 1\n      |                ^\n"
    );
}

#[test]
fn tabs_and_wide_characters_keep_the_caret_in_place() {
    assert_eq!(render("\ta = 1", 1, 2, ""), "scenes/x.toml:1:2: error: wrong\n    1 |     a = 1\n      |     ^\n");
    assert_eq!(render("絹 = 1", 6, 7, ""), "scenes/x.toml:1:5: error: wrong\n    1 | 絹 = 1\n      |      ^\n");
}

#[test]
fn control_characters_are_escaped() {
    assert_eq!(
        render("a = \u{1b}[31m\r\nb", 5, 6, ""),
        "scenes/x.toml:1:6: error: wrong\n    1 | a = \\u{1b}[31m\n      |           ^\n"
    );
    assert_eq!(escaped("a\nb\u{202e}c"), "a\\nb\\u{202e}c");
}

#[test]
fn long_lines_are_cut_around_the_caret() {
    let text = format!("{}!{}", "a".repeat(500), "b".repeat(500));
    assert_eq!(
        render(&text, 500, 501, "here"),
        format!(
            "scenes/x.toml:1:501: error: wrong\n    1 | …{}!{}…\n      | {}^ here\n",
            "a".repeat(60),
            "b".repeat(99),
            " ".repeat(61)
        )
    );
    // The end of a long line: nothing is cut on the right.
    let shown = render(&text, 1000, 1001, "");
    assert_eq!(
        shown,
        format!("scenes/x.toml:1:1001: error: wrong\n    1 | …{}\n      | {}^\n", "b".repeat(160), " ".repeat(160))
    );
    // A caret longer than the line is cut too.
    let shown = render(&text, 0, 1001, "");
    let carets = shown.chars().filter(|&character| character == '^').count();
    assert_eq!(carets, 160, "{shown}");
}

#[test]
fn ends_and_nonsense_are_survived() {
    assert_eq!(render("", 0, 0, ""), "scenes/x.toml:1:1: error: wrong\n    1 |\n      | ^\n");
    assert_eq!(render("a\n", 2, 9, ""), "scenes/x.toml:2:1: error: wrong\n    2 |\n      | ^\n");
    assert_eq!(render("ä", 1, 1, ""), "scenes/x.toml:1:1: error: wrong\n    1 | ä\n      | ^\n");
    // A span over several lines is marked in the first.
    assert_eq!(render("a = [\n1]", 4, 8, ""), "scenes/x.toml:1:5: error: wrong\n    1 | a = [\n      |     ^\n");
    render("\u{feff}a = 1", 0, 1, "");
    assert_eq!(render("\u{feff}a = 1", 3, 4, ""), "scenes/x.toml:1:1: error: wrong\n    1 | a = 1\n      | ^\n");
}

#[test]
fn without_a_line_the_hint_stands_below() {
    let mut sources = Sources::new();
    let id = sources.add_file("a.toml", "a = 1");
    let diagnostics = Diagnostics::new();
    diagnostics.push(Diagnostic::warning("odd"));
    diagnostics.push(Diagnostic::error("too big").at(Span::whole(id)).hint("make it smaller"));
    assert_eq!(diagnostics.render(&sources), "a.toml: error: too big\n  hint: make it smaller\nwarning: odd\n");
    assert_eq!(diagnostics.error_count(), 1);
}

#[test]
fn twenty_are_shown_in_order_and_repetitions_once() {
    let mut sources = Sources::new();
    let id = sources.add_file("a.toml", "x\n".repeat(30));
    let diagnostics = Diagnostics::new();
    for line in (0..23).rev() {
        for _ in 0..2 {
            diagnostics.push(Diagnostic::error("wrong").at(Span::new(id, 2 * line, 2 * line + 1)));
        }
    }
    let text = diagnostics.render(&sources);
    assert!(text.starts_with("a.toml:1:1: error: wrong\n    1 | x\n      | ^\na.toml:2:1:"), "{text}");
    assert!(text.ends_with("a.toml:20:1: error: wrong\n   20 | x\n      | ^\nand 3 more\n"), "{text}");
}

#[test]
fn nearest_forgives_slips() {
    let names = ["radius", "ply_twist", "silk", "n", "ior"];
    let nearest = |name| nearest(name, names);
    assert_eq!(nearest("radus"), Some("radius"));
    assert_eq!(nearest("Radius"), Some("radius"));
    assert_eq!(nearest("slk"), Some("silk"));
    assert_eq!(nearest("slik"), Some("silk"));
    assert_eq!(nearest("ply"), Some("ply_twist"));
    assert_eq!(nearest("silk_natural"), Some("silk"));
    assert_eq!(nearest("m"), None);
    assert_eq!(nearest(""), None);
    assert_eq!(nearest("wavelength"), None);
    assert_eq!(nearest(&"r".repeat(100_000)), None);
    let distance = |first: &str, second: &str| {
        edit_distance(&first.chars().collect::<Vec<_>>(), &second.chars().collect::<Vec<_>>())
    };
    assert_eq!(distance("", "abc"), 3);
    assert_eq!(distance("kitten", "sitting"), 3);
    assert_eq!(distance("ab", "ba"), 1);
}

#[test]
fn unknown_names_are_told_with_a_way_out() {
    let (message, hint) = unknown_name("fiber", "slk", ["silk", "wool"]);
    assert_eq!((message.as_str(), hint.as_str()), ("unknown fiber \"slk\"", "did you mean \"silk\"?"));
    let (_, hint) = unknown_name("fiber", "cotton", ["silk", "wool"]);
    assert_eq!(hint, "there is \"silk\" and \"wool\"");
    let (_, hint) = unknown_name("fiber", "cotton", []);
    assert_eq!(hint, "there is no fiber");
}
