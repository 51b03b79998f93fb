//! Fibres and yarns alone: what a goniometer needs of a scene or library file.

use std::{collections::BTreeMap, path::Path, sync::LazyLock};

use super::{super::Yarn, Context, LoadError, LoadOptions, UNITS, color, complete, read_text, yarns, yarns::Library};
use crate::{
    input::{
        diagnostic::{Diagnostics, Sources, hinted, unknown_name},
        document::{Document, Node, Value},
        reader::Reader,
    },
    scattering::fiber::FiberMaterial,
};

/// The library that travels inside the program.
const BUILT_IN: &str = include_str!("../../../scenes/yarns.toml");
/// What messages call it.
const BUILT_IN_NAME: &str = "the built-in library";
/// What it defines: read once, when something is asked for that a scene does not define.
static BUILT_IN_DEFINITIONS: LazyLock<Option<Definitions>> =
    LazyLock::new(|| load_definitions(None, &LoadOptions::default()).ok());

/// What a file says of fibres and yarns.
#[derive(Clone, Debug)]
pub struct Definitions {
    /// Fibres by name.
    pub fibers: BTreeMap<String, FiberMaterial>,
    /// Yarns by name; also those of the library inside the program that fabrics of the file name.
    pub yarns: BTreeMap<String, Yarn>,
    /// Names of yarns that the file describes itself, or a library that it names.
    described: Vec<String>,
}

impl Definitions {
    /// A yarn by name.
    ///
    /// # Errors
    /// There is none of this name; the message names the nearest.
    pub fn yarn(&self, name: &str) -> Result<&Yarn, LoadError> {
        find(&self.yarns, "yarn", name)
    }

    /// Whether the file only names this yarn, which the library inside the program describes.
    pub fn is_built_in(&self, name: &str) -> bool {
        !self.described.iter().any(|of| of == name)
    }

    /// A fibre by name.
    ///
    /// # Errors
    /// There is none of this name; the message names the nearest.
    pub fn fiber(&self, name: &str) -> Result<&FiberMaterial, LoadError> {
        find(&self.fibers, "fiber", name)
    }
}

fn find<'a, T>(all: &'a BTreeMap<String, T>, kind: &str, name: &str) -> Result<&'a T, LoadError> {
    all.get(name).ok_or_else(|| {
        let (message, hint) = unknown_name(kind, name, all.keys().map(String::as_str));
        LoadError(hinted(format!("error: {message}"), hint) + "\n")
    })
}

/// Names of yarns (`kind` "yarn") or fibres ("fiber") of the library inside the program.
pub(super) fn built_in_names(kind: &str) -> impl Iterator<Item = &'static str> + Clone + use<'_> {
    BUILT_IN
        .lines()
        .filter_map(move |line| line.strip_prefix('[')?.strip_prefix(kind)?.strip_prefix('.')?.strip_suffix(']'))
        // Not the tables within them.
        .filter(|name| !name.contains('.'))
}

/// A fibre of the library inside the program.
pub(super) fn built_in_fiber(name: &str) -> Option<FiberMaterial> {
    // Nothing is read for a name that it does not have.
    built_in_names("fiber").find(|of| *of == name)?;
    BUILT_IN_DEFINITIONS.as_ref()?.fibers.get(name).cloned()
}

/// Adds yarns and fibres of the library inside the program that fabrics name and that nothing else defines. `fabrics` is
/// what stands under `fabric`.
pub(super) fn add_built_in(library: &mut Library, fabrics: Option<&Node>, tilted: bool) {
    let mut named = Vec::new();
    texts(fabrics, &mut named);
    // Yarns that take turns may be counted.
    named.iter_mut().for_each(|name| *name = color::turn(name).1);
    let unknown = |names: &[String], name: &str| !names.iter().any(|n| n == name);
    named.retain(|name| unknown(&library.yarn_names, name) || unknown(&library.fiber_names, name));
    let defines = |name: &str| ["yarn", "fiber"].iter().any(|kind| built_in_names(kind).any(|of| of == name));
    // Nothing is read that no fabric names.
    if !named.iter().any(|name| defines(name)) {
        return;
    }
    let Some(built_in) = &*BUILT_IN_DEFINITIONS else { return };
    for name in named {
        if let Some(yarn) = built_in.yarns.get(name).filter(|_| unknown(&library.yarn_names, name)) {
            library.yarns.insert(name.to_owned(), Yarn { tilted, ..yarn.clone() });
            library.yarn_names.push(name.to_owned());
        }
        if let Some(fiber) = built_in.fibers.get(name).filter(|_| unknown(&library.fiber_names, name)) {
            library.fibers.insert(name.to_owned(), fiber.clone());
            library.fiber_names.push(name.to_owned());
        }
    }
}

/// All texts in a value.
fn texts<'a>(node: Option<&'a Node>, out: &mut Vec<&'a str>) {
    match node.map(|node| &node.value) {
        Some(Value::String(text)) => out.push(text),
        Some(Value::Array(elements)) => elements.iter().for_each(|element| texts(Some(element), out)),
        Some(Value::Table(table)) => table.entries().for_each(|entry| texts(Some(&entry.node), out)),
        _ => {}
    }
}

/// Reads the fibres and yarns of a scene or library file, or of the library inside the program if there is no `path`.
/// All else in the file is passed over.
///
/// # Errors
/// Everything that is wrong with them, as text for the user.
pub fn load_definitions(path: Option<&Path>, options: &LoadOptions) -> Result<Definitions, LoadError> {
    let mut sources = Sources::new();
    let diagnostics = Diagnostics::new();
    let (name, text) = match path {
        None => (BUILT_IN_NAME.to_owned(), BUILT_IN.to_owned()),
        Some(path) => {
            let name = path.display().to_string();
            let text = read_text(path).map_err(|problem| LoadError(format!("{name}: error: {problem}\n")))?;
            (name, text)
        }
    };
    let definitions = Document::parse(&name, &text, &mut sources, &diagnostics).and_then(|mut document| {
        complete(&mut document, options, &mut sources, &diagnostics);
        if diagnostics.has_errors() {
            return None;
        }
        let root = Reader::new(&document, &diagnostics);
        let unit = root.one_of_or("unit", 1.0, &UNITS);
        let context = Context::new(&sources, &diagnostics, unit, true);
        let mut library = yarns::read(&root, &context, true, built_in_fiber);
        let described = library.yarn_names.clone();
        if path.is_some() {
            add_built_in(&mut library, root.node("fabric"), true);
        }
        Some(Definitions { fibers: library.fibers, yarns: library.yarns, described })
    });
    match definitions {
        Some(definitions) if !diagnostics.has_errors() => Ok(definitions),
        _ => Err(LoadError(diagnostics.render(&sources))),
    }
}
