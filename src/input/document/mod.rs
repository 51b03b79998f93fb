//! TOML text and `--set` options as one tree that knows where everything was written.
//!
//! A [`Document`] begins as a scene file; library files are merged under it, options are laid over it.
//! It knows nothing of the keys of the renderer: that is the business of whoever reads it
//! through a [`Reader`](super::reader::Reader).

use std::cell::Cell;
use std::collections::HashMap;

use toml::de::{DeTable, DeValue};

use super::diagnostic::{Diagnostic, Diagnostics, SourceId, Sources, Span, shortened};

/// Files above this size are not scenes; the caller refuses them before reading.
pub const MAX_FILE_BYTES: u64 = 64 << 20;

/// Arrays and tables inside each other, at most; deeper trees would end on the stack.
pub const MAX_DEPTH: usize = 64;

/// A value and the place it was written.
#[derive(Clone, Debug)]
pub struct Node {
    /// What is written there.
    pub value: Value,
    /// Where; for a table with a header, the header.
    pub span: Span,
}

/// What a scene file can say. Dates, which TOML also has, are refused.
#[derive(Clone, Debug)]
pub enum Value {
    /// Text.
    String(String),
    /// A number without point and exponent.
    Integer(i64),
    /// A number with point or exponent, or `nan`, `inf`.
    Float(f64),
    /// `true` or `false`.
    Boolean(bool),
    /// Values in brackets, or an array of tables.
    Array(Vec<Node>),
    /// Keys and values.
    Table(Table),
}

impl Value {
    /// What it is, with its article: "a string", "a table".
    pub fn kind(&self) -> &'static str {
        match self {
            Value::String(_) => "a string",
            Value::Integer(_) => "an integer",
            Value::Float(_) => "a float",
            Value::Boolean(_) => "a boolean",
            Value::Array(_) => "an array",
            Value::Table(_) => "a table",
        }
    }
}

impl From<f64> for Value {
    fn from(value: f64) -> Value {
        Value::Float(value)
    }
}
impl From<i64> for Value {
    fn from(value: i64) -> Value {
        Value::Integer(value)
    }
}
impl From<u32> for Value {
    fn from(value: u32) -> Value {
        Value::Integer(value.into())
    }
}
impl From<bool> for Value {
    fn from(value: bool) -> Value {
        Value::Boolean(value)
    }
}
impl From<&str> for Value {
    fn from(value: &str) -> Value {
        Value::String(value.to_owned())
    }
}
impl From<String> for Value {
    fn from(value: String) -> Value {
        Value::String(value)
    }
}

/// Keys and values in the order they were written.
#[derive(Clone, Debug)]
pub struct Table {
    entries: Vec<Entry>,
    positions: HashMap<String, usize>,
    header: Span,
}

/// One key of a [`Table`] with its value.
#[derive(Clone, Debug)]
pub struct Entry {
    /// The key, without quotes.
    pub key: String,
    /// Where the key was written.
    pub key_span: Span,
    /// Its value.
    pub node: Node,
    read: Cell<bool>,
}

impl Entry {
    /// Remembers that somebody has made use of the key.
    pub fn mark_read(&self) {
        self.read.set(true);
    }

    /// Whether somebody has made use of the key.
    pub fn is_read(&self) -> bool {
        self.read.get()
    }
}

impl Table {
    /// A table without keys, announced at `header`.
    pub fn new(header: Span) -> Table {
        Table { entries: Vec::new(), positions: HashMap::new(), header }
    }

    /// Where the table is announced: `[yarn.silk1]`, or its opening brace, or its file for the outermost one.
    pub fn header(&self) -> Span {
        self.header
    }

    /// The keys in the order they were written; those of libraries and options come last.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter()
    }

    /// The entry under a key. Does not count as reading it.
    pub fn get(&self, key: &str) -> Option<&Entry> {
        self.positions.get(key).map(|&position| &self.entries[position])
    }

    fn get_mut(&mut self, key: &str) -> Option<&mut Entry> {
        self.positions.get(key).map(|&position| &mut self.entries[position])
    }

    /// Sets a key; a value that was there before is replaced in its place.
    pub fn insert(&mut self, key: String, key_span: Span, node: Node) {
        let entry = Entry { key, key_span, node, read: Cell::new(false) };
        if let Some(&position) = self.positions.get(&entry.key) {
            self.entries[position] = entry;
        } else {
            self.positions.insert(entry.key.clone(), self.entries.len());
            self.entries.push(entry);
        }
    }

    /// Adds what only `other` has. Where both have a table under a key, the two are merged the same way;
    /// for everything else, what is here stays.
    pub fn merge(&mut self, other: Table, sources: &Sources) {
        // An option may have announced a table that a file describes: messages shall point to the file.
        if sources.is_option(self.header.source()) {
            self.header = other.header;
        }
        for entry in other.entries {
            match (self.get_mut(&entry.key), entry.node.value) {
                (Some(Entry { node: Node { value: Value::Table(mine), span }, .. }), Value::Table(others)) => {
                    mine.merge(others, sources);
                    *span = mine.header;
                }
                (Some(_), _) => {}
                (None, value) => self.insert(entry.key, entry.key_span, Node { value, span: entry.node.span }),
            }
        }
    }
}

/// A scene as it was written: a file, libraries under it, options over it.
#[derive(Clone, Debug)]
pub struct Document {
    /// The outermost table.
    pub root: Table,
}

impl Document {
    /// Reads the text of a file; `path` is what messages call it. `None` when something was wrong
    /// with it; all of that is in `diagnostics` then.
    pub fn parse(path: &str, text: &str, sources: &mut Sources, diagnostics: &Diagnostics) -> Option<Document> {
        let source = sources.add_file(path, text);
        let (tree, errors) = DeTable::parse_recoverable(text);
        report_syntax_errors(&errors, text, source, diagnostics);
        if !errors.is_empty() {
            return None; // where the parser gave up it has put in values nobody wrote
        }
        let converter = Converter { source, offset: 0, diagnostics, failed: Cell::new(false) };
        let root = converter.table(tree.into_inner(), Span::whole(source), 0);
        (!converter.failed.get()).then_some(Document { root })
    }

    /// A document without keys, for a scene that is given by options alone; `label` is what messages call it.
    pub fn empty(label: &str, sources: &mut Sources) -> Document {
        Document { root: Table::new(Span::whole(sources.add_file(label, ""))) }
    }

    /// Adds what only the library has; see [`Table::merge`].
    pub fn merge(&mut self, library: Document, sources: &Sources) {
        self.root.merge(library.root, sources);
    }

    /// Applies one `--set` option, given as `KEY=VALUE`.
    ///
    /// The key is a path of names and, for arrays, indices counted from 0: `light.0.radiance=[1, 2, 3]`.
    /// Names with other than letters, digits, `_` and `-` may be quoted. The value is TOML, or else plain text.
    pub fn apply_option(&mut self, assignment: &str, sources: &mut Sources, diagnostics: &Diagnostics) {
        const OPTION: &str = "--set ";
        let source = sources.add_option(format!("{OPTION}{assignment}"));
        let steps = match parse_path(assignment) {
            Ok(steps) => steps,
            Err((start, end, message)) => {
                let span = Span::new(source, OPTION.len() + start, OPTION.len() + end);
                diagnostics.push(Diagnostic::error(message).at(span).hint("write KEY=VALUE, such as render.spp=16"));
                return;
            }
        };
        let value_start = steps.end + 1;
        let untrimmed = &assignment[value_start..];
        let text = untrimmed.trim();
        let offset = OPTION.len() + value_start + (untrimmed.len() - untrimmed.trim_start().len());
        let span = Span::new(source, offset, offset + text.len());
        let node = match DeValue::parse(text).map(|value| value.into_inner()) {
            // A date is nothing a scene could mean, but a name may look like one.
            Ok(DeValue::Datetime(_)) | Err(_) => Node { value: Value::String(text.to_owned()), span },
            Ok(_) if text.is_empty() => Node { value: Value::String(String::new()), span },
            Ok(value) => {
                let converter = Converter { source, offset, diagnostics, failed: Cell::new(false) };
                match converter.value(value, span, steps.list.len()) {
                    Some(value) if !converter.failed.get() => Node { value, span },
                    _ => return,
                }
            }
        };
        let step =
            |step: &Step| Step { start: OPTION.len() + step.start, end: OPTION.len() + step.end, ..step.clone() };
        let steps: Vec<Step> = steps.list.iter().map(step).collect();
        self.assign(&steps, node, source, diagnostics);
    }

    /// Sets one key from the program, for an option with its own name: `set("render.spp", 16, "--spp 16")`.
    ///
    /// `path` is as in [`Document::apply_option`]; messages show `label`, with the caret below what
    /// follows its first space or `=`.
    pub fn set(
        &mut self,
        path: &str,
        value: impl Into<Value>,
        label: &str,
        sources: &mut Sources,
        diagnostics: &Diagnostics,
    ) {
        let source = sources.add_option(label);
        let split = label.find([' ', '=']).unwrap_or(label.len());
        let key_span = Span::new(source, 0, split);
        let span = if split < label.len() { Span::new(source, split + 1, label.len()) } else { key_span };
        let mut node = Node { value: value.into(), span };
        place_at(&mut node, span);
        match parse_path(&format!("{path}=")) {
            Ok(steps) => {
                let steps: Vec<Step> =
                    steps.list.into_iter().map(|step| Step { start: 0, end: split, ..step }).collect();
                self.assign(&steps, node, source, diagnostics);
            }
            Err((_, _, message)) => diagnostics.push(Diagnostic::error(message).at(key_span)),
        }
    }

    /// Walks down the steps, making tables on the way, and sets the last one.
    fn assign(&mut self, steps: &[Step], node: Node, source: SourceId, diagnostics: &Diagnostics) {
        let Some((last, way)) = steps.split_last() else { return };
        let span = |step: &Step| Span::new(source, step.start, step.end);
        if steps.len() > MAX_DEPTH {
            diagnostics.push(too_deep(span(last)));
            return;
        }
        let mut place = Container::Table(&mut self.root);
        for (position, step) in way.iter().enumerate() {
            let next_is_index = steps[position + 1].index.is_some();
            match place.find(step) {
                Ok(Some(_)) => {}
                Ok(None) if next_is_index => {
                    // An array cannot come into being on the way: its other entries would be missing.
                    let message = format!("there is no `{}`, so it has no entries", path_text(&steps[..=position]));
                    diagnostics.push(Diagnostic::error(message).at(span(&steps[position + 1])));
                    return;
                }
                Ok(None) => {
                    let value = Value::Table(Table::new(span(step)));
                    place.insert(step, span(step), Node { value, span: span(step) });
                }
                Err(message) => {
                    let name = path_text(&steps[..position]);
                    diagnostics.push(Diagnostic::error(format!("`{name}` {message}")).at(span(step)));
                    return;
                }
            }
            let Ok(Some(inner)) = place.into_found(step) else { return };
            place = match &mut inner.value {
                Value::Table(table) => Container::Table(table),
                Value::Array(array) => Container::Array(array),
                other => {
                    let name = path_text(&steps[..=position]);
                    let message = format!("`{name}` is {}, so it has no keys", other.kind());
                    diagnostics.push(Diagnostic::error(message).at(span(&steps[position + 1])));
                    return;
                }
            };
        }
        match place.find(last) {
            Ok(_) => place.insert(last, span(last), node),
            Err(message) => {
                let name = path_text(way);
                diagnostics.push(Diagnostic::error(format!("`{name}` {message}")).at(span(last)));
            }
        }
    }
}

/// One name of a path and where it was written.
#[derive(Clone, Debug)]
struct Step {
    name: String,
    /// The name as a position in an array, if it can be one.
    index: Option<usize>,
    start: usize,
    end: usize,
}

struct Steps {
    list: Vec<Step>,
    /// Where the `=` is.
    end: usize,
}

/// The path up to `=`. An error is a range of bytes and what is wrong there.
fn parse_path(text: &str) -> Result<Steps, (usize, usize, String)> {
    let mut list = Vec::new();
    let mut position = 0;
    loop {
        let rest = &text[position..];
        let (name, length, quoted) = match rest.chars().next() {
            Some(quote @ ('"' | '\'')) => match rest[1..].find(quote) {
                Some(length) => (&rest[1..=length], length + 2, true),
                None => return Err((position, text.len(), format!("the quote {quote} is never closed"))),
            },
            _ => {
                let length = rest.find(['.', '=']).unwrap_or(rest.len());
                (rest[..length].trim(), length, false)
            }
        };
        if name.is_empty() && !quoted {
            let message = if text[position..].starts_with('=') || text.contains('=') {
                "expected the name of a key"
            } else {
                "expected KEY=VALUE"
            };
            return Err((position, position + 1, message.to_owned()));
        }
        let end = position + length;
        let digits = !quoted && name.bytes().all(|byte| byte.is_ascii_digit());
        let index = if digits { name.parse().ok().or(Some(usize::MAX)) } else { None };
        list.push(Step { name: name.to_owned(), index, start: position, end });
        match text[end..].chars().next() {
            Some('=') => return Ok(Steps { list, end }),
            Some('.') => position = end + 1,
            Some(_) => return Err((end, end + 1, "expected `.` or `=` after a name".to_owned())),
            None => return Err((0, text.len(), format!("no value for `{}`", shortened(text)))),
        }
    }
}

fn path_text(steps: &[Step]) -> String {
    let names: Vec<&str> = steps.iter().map(|step| step.name.as_str()).collect();
    shortened(&names.join("."))
}

/// Where a walk along a path has come to.
enum Container<'a> {
    Table(&'a mut Table),
    Array(&'a mut Vec<Node>),
}

impl<'a> Container<'a> {
    /// What is under the step; `None` is a key that is not there. The error is the end of a sentence.
    fn find<'b>(&'b mut self, step: &Step) -> Result<Option<&'b mut Node>, String> {
        match self {
            Container::Table(table) => Container::Table(table).into_found(step),
            Container::Array(array) => Container::Array(array).into_found(step),
        }
    }

    /// Puts a value under a step that [`Container::find`] has accepted.
    fn insert(&mut self, step: &Step, key_span: Span, node: Node) {
        match self {
            Container::Table(table) => table.insert(step.name.clone(), key_span, node),
            Container::Array(_) => {
                if let Ok(Some(element)) = self.find(step) {
                    *element = node;
                }
            }
        }
    }

    fn into_found(self, step: &Step) -> Result<Option<&'a mut Node>, String> {
        match self {
            Container::Table(table) => Ok(table.get_mut(&step.name).map(|entry| &mut entry.node)),
            Container::Array(array) => {
                let count = array.len();
                let Some(index) = step.index else {
                    return Err(format!("is an array: expected an index, found `{}`", shortened(&step.name)));
                };
                let there_are = match count {
                    0 => "has no entries".to_owned(),
                    1 => "has 1 entry, with the index 0".to_owned(),
                    _ => format!("has {count} entries, with indices from 0 to {}", count - 1),
                };
                array.get_mut(index).map(Some).ok_or(there_are)
            }
        }
    }
}

/// Gives a value that no file has written the place of the option it came from.
fn place_at(node: &mut Node, span: Span) {
    node.span = span;
    match &mut node.value {
        Value::Array(array) => array.iter_mut().for_each(|element| place_at(element, span)),
        Value::Table(table) => {
            table.header = span;
            for entry in &mut table.entries {
                entry.key_span = span;
                place_at(&mut entry.node, span);
            }
        }
        _ => {}
    }
}

fn too_deep(span: Span) -> Diagnostic {
    Diagnostic::error(format!("more than {MAX_DEPTH} arrays and tables inside each other")).at(span)
}

/// Reports what the parser complains about, without what only follows from an earlier mistake.
fn report_syntax_errors(errors: &[toml::de::Error], text: &str, source: SourceId, diagnostics: &Diagnostics) {
    let start_of = |error: &toml::de::Error| error.span().map_or(text.len(), |span| span.start.min(text.len()));
    let mut errors: Vec<&toml::de::Error> = errors.iter().collect();
    errors.sort_by_key(|error| start_of(error)); // the parser works in passes, each from the top
    let mut reported_up_to = 0;
    for error in errors {
        // After the first error in a line the parser has lost its way for the rest of the line.
        let start = start_of(error);
        if start < reported_up_to {
            continue;
        }
        diagnostics.push(syntax_error(error, text, source));
        // In a bracket that is never closed, everything that follows looks wrong.
        let message = error.message();
        let in_bracket = message.contains("array element") || message.contains("in array");
        if in_bracket || message.contains("key-value pairs") || message.contains("inline table element") {
            return;
        }
        let newline = text.as_bytes()[start..].iter().position(|&byte| byte == b'\n');
        reported_up_to = newline.map_or(text.len(), |newline| start + newline) + 1;
    }
}

/// A message of the TOML parser in our words where they are clearer.
fn syntax_error(error: &toml::de::Error, text: &str, source: SourceId) -> Diagnostic {
    let range = error.span();
    let span = range.clone().map_or(Span::whole(source), |range| Span::new(source, range.start, range.end));
    let (message, expected) = match error.message().split_once(", expected ") {
        Some((message, "nothing")) => (message, None),
        Some((message, expected)) => (message, Some(expected)),
        None => (error.message(), None),
    };
    let diagnostic = match message {
        "duplicate key" => {
            let key = range.and_then(|range| text.get(range)).unwrap_or_default();
            Diagnostic::error(format!("the key `{}` is there twice", shortened(key))).hint("remove one of the two")
        }
        "cannot recurse further; max recursion depth met" | "recursion limit" => return too_deep(span),
        message => Diagnostic::error(message),
    };
    let diagnostic = diagnostic.at(span);
    match expected {
        // The closing bracket is what most often is missing.
        Some("`,`") if message.contains("array") => diagnostic.hint("expected `,` or `]`"),
        Some("`,`") => diagnostic.hint("expected `,` or `}`"),
        Some(expected) => diagnostic.hint(format!("expected {expected}")),
        None => diagnostic,
    }
}

/// Turns the parser's tree into ours.
struct Converter<'a> {
    source: SourceId,
    /// Where the parsed text begins in its source.
    offset: usize,
    diagnostics: &'a Diagnostics,
    failed: Cell<bool>,
}

impl Converter<'_> {
    fn span(&self, range: std::ops::Range<usize>) -> Span {
        Span::new(self.source, self.offset + range.start, self.offset + range.end)
    }

    fn fail(&self, diagnostic: Diagnostic) {
        self.failed.set(true);
        self.diagnostics.push(diagnostic);
    }

    fn table(&self, table: DeTable<'_>, header: Span, depth: usize) -> Table {
        // The parser sorts its keys by name; the order of writing is in their positions.
        let mut entries: Vec<_> = table.into_iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        let mut result = Table::new(header);
        for (key, value) in entries {
            let span = self.span(value.span());
            let key_span = self.span(key.span());
            if let Some(value) = self.value(value.into_inner(), span, depth + 1) {
                result.insert(key.into_inner().into_owned(), key_span, Node { value, span });
            }
        }
        result
    }

    fn value(&self, value: DeValue<'_>, span: Span, depth: usize) -> Option<Value> {
        if depth > MAX_DEPTH && matches!(value, DeValue::Array(_) | DeValue::Table(_)) {
            self.fail(too_deep(span));
            return None;
        }
        match value {
            DeValue::String(text) => Some(Value::String(text.into_owned())),
            DeValue::Boolean(value) => Some(Value::Boolean(value)),
            DeValue::Integer(integer) => {
                let value = i64::from_str_radix(integer.as_str(), integer.radix()).ok();
                if value.is_none() {
                    self.fail(Diagnostic::error("the integer is too large").at(span).hint("at most 63 bits"));
                }
                value.map(Value::Integer)
            }
            DeValue::Float(float) => {
                let value: Option<f64> = float.as_str().parse().ok();
                let overflow = value.is_none_or(|value| value.is_infinite() && !float.as_str().contains("inf"));
                if overflow {
                    self.fail(Diagnostic::error("the number is too large").at(span));
                    return None;
                }
                value.map(Value::Float)
            }
            DeValue::Datetime(_) => {
                self.fail(Diagnostic::error("a date has no meaning here").at(span).hint("write text in quotes"));
                None
            }
            DeValue::Array(array) => {
                let elements = array.into_iter().filter_map(|element| {
                    let span = self.span(element.span());
                    self.value(element.into_inner(), span, depth + 1).map(|value| Node { value, span })
                });
                Some(Value::Array(elements.collect()))
            }
            DeValue::Table(table) => Some(Value::Table(self.table(table, span, depth))),
        }
    }
}
