//! The order of the rooms, read from the source itself: `crate::`, `super::` and nested `use` trees.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use crate::support::project;

/// Every room from the ground up, and exactly the rooms that it uses. `main.rs` and `lib.rs` are the roof.
const ROOMS: [(&str, &[&str]); 20] = [
    ("ffi", &[]),
    ("math", &[]),
    ("input", &[]),
    ("image", &["ffi", "input", "math"]),
    ("geometry", &["math"]),
    ("pattern", &["geometry", "input", "math"]),
    ("files", &["geometry", "input", "math", "pattern"]),
    ("garment", &["files", "geometry", "input", "math", "pattern"]),
    ("trace", &["ffi", "geometry"]),
    ("scattering", &["geometry", "math"]),
    ("light", &["math"]),
    ("scene", &["files", "garment", "geometry", "image", "input", "light", "math", "pattern", "scattering"]),
    ("cloth", &["geometry", "math", "scattering", "scene", "trace"]),
    ("film", &["math", "scattering", "scene"]),
    ("integrator", &["cloth", "film", "geometry", "light", "math", "scattering", "scene", "trace"]),
    ("render", &["cloth", "ffi", "film", "geometry", "image", "integrator", "math", "scene"]),
    ("plan", &["film", "image", "light", "math", "scene"]),
    ("report", &["cloth", "geometry", "image", "light", "math", "plan", "render", "scene", "trace"]),
    (
        "experiment",
        &["cloth", "film", "geometry", "image", "input", "math", "render", "report", "scattering", "scene", "trace"],
    ),
    (
        "cli",
        &[
            "cloth",
            "experiment",
            "ffi",
            "files",
            "geometry",
            "image",
            "input",
            "math",
            "pattern",
            "plan",
            "render",
            "report",
            "scene",
            "trace",
        ],
    ),
];

/// All that a room takes from the foreign libraries: kept small, so that Embree could be exchanged.
const FROM_FFI: [(&str, &[&str]); 4] = [
    ("cli", &["ffi::heap", "ffi::oidn::Denoiser", "ffi::oidn::OidnError"]),
    (
        "image",
        &[
            "ffi::oiio",
            "ffi::oiio::OiioError",
            "ffi::oiio::TextureFile",
            "ffi::oiio::is_loaded",
            "ffi::oiio::texture_bytes",
        ],
    ),
    ("render", &["ffi::oidn::Denoiser", "ffi::oidn::Guides", "ffi::oidn::OidnError"]),
    (
        "trace",
        &[
            "ffi::embree::BvhLayout",
            "ffi::embree::CommittedScene",
            "ffi::embree::CurveBasis",
            "ffi::embree::Device",
            "ffi::embree::EmbreeError",
            "ffi::embree::HitFilter",
            "ffi::embree::RawHit",
            "ffi::embree::RawRay",
            "ffi::embree::SceneBuilder",
            "ffi::heap",
        ],
    ),
];

/// A source file without comments, text and tests.
struct Source {
    /// Path below `src`, with `/`.
    name: String,
    tokens: Vec<String>,
}

impl Source {
    /// The module that the file is, such as `["scene", "load", "view"]`.
    fn module(&self) -> Vec<String> {
        let mut parts: Vec<String> = self.name.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
        if parts.last().is_some_and(|last| last == "mod") {
            parts.pop();
        }
        parts
    }

    fn room(&self) -> String {
        self.module().remove(0)
    }

    /// Whole paths from the crate's root of everything that the file names through `crate` or `super`.
    fn paths(&self) -> Vec<Vec<String>> {
        let mut out = Vec::new();
        let mut i = 0;
        while i < self.tokens.len() {
            let starts = matches!(self.tokens[i].as_str(), "crate" | "super") && (i == 0 || self.tokens[i - 1] != "::");
            let is_path = starts && self.tokens.get(i + 1).is_some_and(|t| t == "::");
            i = if is_path { self.tree(i, &self.module(), &mut out) } else { i + 1 };
        }
        out
    }

    /// Follows a path, or a tree of paths in braces, from token `i` in module `base`; gives the token after it.
    fn tree(&self, mut i: usize, base: &[String], out: &mut Vec<Vec<String>>) -> usize {
        let mut path = base.to_vec();
        loop {
            match self.tokens.get(i).map(String::as_str) {
                Some("{") => {
                    i += 1;
                    while self.tokens[i] != "}" {
                        i = self.tree(i, &path, out);
                        if self.tokens[i] == "," {
                            i += 1;
                        }
                    }
                    return i + 1;
                }
                Some("crate") => path.clear(),
                Some("super") => {
                    path.pop();
                }
                Some("self") => {}
                Some(name) => path.push(name.to_owned()),
                None => break,
            }
            i += 1;
            match self.tokens.get(i).map(String::as_str) {
                Some("::") => i += 1,
                Some("as") => {
                    i += 2;
                    break;
                }
                _ => break,
            }
        }
        out.push(path);
        i
    }
}

/// Words and signs of a source text; comments and literals are left out.
fn tokens(text: &str) -> Vec<String> {
    let c: Vec<char> = text.chars().collect();
    let at = |i: usize| c.get(i).copied().unwrap_or('\0');
    let mut out = Vec::new();
    let mut i = 0;
    while i < c.len() {
        if at(i) == '/' && at(i + 1) == '/' {
            while i < c.len() && c[i] != '\n' {
                i += 1;
            }
        } else if at(i) == '/' && at(i + 1) == '*' {
            while i < c.len() && !(c[i] == '*' && at(i + 1) == '/') {
                i += 1;
            }
            i += 2;
        } else if at(i) == 'r' && (at(i + 1) == '"' || (at(i + 1) == '#' && matches!(at(i + 2), '"' | '#'))) {
            let hashes = c[i + 1..].iter().take_while(|&&h| h == '#').count();
            i += hashes + 2;
            while i < c.len() && !(c[i] == '"' && (1..=hashes).all(|k| at(i + k) == '#')) {
                i += 1;
            }
            i += hashes + 1;
        } else if at(i) == '"' {
            i += 1;
            while i < c.len() && c[i] != '"' {
                i += if c[i] == '\\' { 2 } else { 1 };
            }
            i += 1;
        } else if at(i) == '\'' && at(i + 1) == '\\' {
            i += 3;
            while i < c.len() && c[i] != '\'' {
                i += 1;
            }
            i += 1;
        } else if at(i) == '\'' && at(i + 2) == '\'' {
            i += 3;
        } else if at(i).is_alphanumeric() || at(i) == '_' {
            let start = i;
            while at(i).is_alphanumeric() || at(i) == '_' {
                i += 1;
            }
            out.push(c[start..i].iter().collect());
        } else if at(i) == ':' && at(i + 1) == ':' {
            out.push("::".to_owned());
            i += 2;
        } else {
            if !at(i).is_whitespace() {
                out.push(at(i).to_string());
            }
            i += 1;
        }
    }
    out
}

/// Drops every item under `#[cfg(test)]`.
fn without_tests(tokens: Vec<String>) -> Vec<String> {
    let mark = ["#", "[", "cfg", "(", "test", ")", "]"];
    let mut out = Vec::new();
    let mut i = 0;
    while i < tokens.len() {
        if tokens[i..].iter().take(mark.len()).map(String::as_str).eq(mark) {
            let mut depth = 0;
            i += mark.len();
            while i < tokens.len() {
                let token = tokens[i].as_str();
                i += 1;
                match token {
                    "{" => depth += 1,
                    "}" => depth -= 1,
                    _ => {}
                }
                if depth == 0 && matches!(token, "}" | ";") {
                    break;
                }
            }
        } else {
            out.push(tokens[i].clone());
            i += 1;
        }
    }
    out
}

fn collect(folder: &Path, below: &str, out: &mut Vec<Source>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let file = path.file_name().unwrap().to_string_lossy().into_owned();
        let name = format!("{below}{file}");
        if path.is_dir() {
            if file != "tests" {
                collect(&path, &format!("{name}/"), out);
            }
        } else if file.ends_with(".rs") && file != "tests.rs" && name != "testing.rs" {
            let text = std::fs::read_to_string(&path).unwrap();
            out.push(Source { name, tokens: without_tests(tokens(&text)) });
        }
    }
}

fn sources() -> Vec<Source> {
    let mut out = Vec::new();
    collect(&project("src"), "", &mut out);
    out.sort_by(|a, b| a.name.cmp(&b.name));
    assert!(out.len() > 30);
    out
}

#[test]
fn rooms_use_what_the_table_says_and_nothing_else() {
    let order: Vec<&str> = ROOMS.iter().map(|(room, _)| *room).collect();
    let mut used: BTreeMap<String, BTreeMap<String, BTreeSet<String>>> = BTreeMap::new();
    for source in sources() {
        let room = source.room();
        if matches!(room.as_str(), "lib" | "main") {
            continue;
        }
        assert!(order.contains(&room.as_str()), "src/{}: `{room}` is not in the table of rooms", source.name);
        let of_room = used.entry(room.clone()).or_default();
        for path in source.paths() {
            if path.first().is_some_and(|first| *first != room && order.contains(&first.as_str())) {
                of_room.entry(path[0].clone()).or_default().insert(format!("{} in {}", path.join("::"), source.name));
            }
        }
    }
    for (index, (room, allowed)) in ROOMS.iter().enumerate() {
        let found = used.remove(*room).unwrap_or_default();
        for (other, places) in &found {
            assert!(
                order[..index].contains(&other.as_str()),
                "`{room}` uses `{other}`, which stands above it: {places:?}"
            );
            assert!(allowed.contains(&other.as_str()), "`{room}` must not use `{other}`: {places:?}");
        }
        for other in *allowed {
            assert!(found.contains_key(*other), "`{room}` no longer uses `{other}`: take it out of the table");
        }
    }
}

/// A folder's own file and those in it know each other; of all others none uses another that uses it, by whatever way.
#[test]
fn files_do_not_use_each_other_in_a_circle() {
    let sources = sources();
    let modules: BTreeSet<Vec<String>> = sources.iter().map(Source::module).collect();
    let file_of = |path: Vec<String>| (1..=path.len()).rev().map(|n| path[..n].to_vec()).find(|m| modules.contains(m));
    let mut uses: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for source in &sources {
        let own = source.module();
        let others = source.paths().into_iter().filter_map(file_of);
        let others = others.filter(|other| !own.starts_with(other) && !other.starts_with(&own));
        uses.entry(own.join("::")).or_default().extend(others.map(|other| other.join("::")));
    }
    assert!(uses.values().map(BTreeSet::len).sum::<usize>() > 1000, "hardly anything is used");
    // What uses nothing that is left is taken away, and what nothing that is left uses, until nothing is.
    loop {
        let before = uses.len();
        let used: BTreeSet<String> = uses.values().flatten().cloned().collect();
        uses.retain(|file, _| used.contains(file));
        let left: BTreeSet<String> = uses.keys().cloned().collect();
        uses.values_mut().for_each(|others| others.retain(|other| left.contains(other)));
        uses.retain(|_, others| !others.is_empty());
        if uses.len() == before {
            break;
        }
    }
    assert!(uses.is_empty(), "these use each other in a circle: {uses:#?}");
}

#[test]
fn few_things_come_from_the_foreign_libraries() {
    let mut found: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for source in sources() {
        let room = source.room();
        let foreign = source.paths().into_iter().filter(|p| room != "ffi" && p.first().is_some_and(|f| f == "ffi"));
        let foreign: BTreeSet<String> = foreign.map(|p| p[..p.len().min(3)].join("::")).collect();
        if !foreign.is_empty() {
            found.entry(room).or_default().extend(foreign);
        }
    }
    let expected: BTreeMap<String, BTreeSet<String>> =
        FROM_FFI.iter().map(|(r, names)| ((*r).to_owned(), names.iter().map(|n| (*n).to_owned()).collect())).collect();
    assert_eq!(found, expected);
}

/// Files in which `test` holds for some token and the one after it.
fn files_with(test: impl Fn(&str, &str) -> bool) -> Vec<String> {
    let has = |s: &Source| s.tokens.windows(2).any(|w| test(&w[0], &w[1]));
    sources().into_iter().filter(has).map(|s| s.name).collect()
}

#[test]
fn unsafe_code_stands_under_ffi_only() {
    let files = files_with(|a, _| a == "unsafe");
    assert!(!files.is_empty() && files.iter().all(|f| f.starts_with("ffi/")), "{files:?}");
}

#[test]
fn only_the_document_knows_toml() {
    let files = files_with(|a, b| a == "toml" && b == "::");
    assert_eq!(files, ["input/document/convert.rs", "input/document/mod.rs"]);
}

#[test]
fn only_the_terminal_prints() {
    // These end the program where nobody listens.
    let files = files_with(|a, b| matches!(a, "println" | "eprintln" | "print" | "eprint" | "dbg") && b == "!");
    assert!(files.is_empty(), "{files:?}");
    let files = files_with(|a, b| matches!(a, "stdout" | "stderr") && b == "(");
    assert!(files.iter().any(|f| f == "cli/terminal.rs") && files.iter().all(|f| f.starts_with("cli/")), "{files:?}");
}
