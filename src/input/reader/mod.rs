//! Typed reading of tables: every question names a key and what may stand there; wrong answers are collected.
//!
//! A [`Reader`] never stops at an error: it reports, answers with nothing (or the default), and goes on,
//! so that a user sees everything that is wrong at once. After the last question [`Reader::finish`]
//! reports every key nobody asked for. Whoever reads a table asks for all of its keys before judging their values together:
//! what returns early leaves valid keys to be called unknown.

mod range;
#[cfg(test)]
mod tests;
mod title;

use std::cell::{Cell, RefCell};
use std::ops::RangeInclusive;

use super::diagnostic::{Diagnostic, Diagnostics, Span, listed, nearest, shortened};
use super::document::{Document, Entry, Node, Table, Value};
pub(crate) use range::Range;
use range::number_text;
use title::Title;

/// Reads one table and reports what is wrong with it.
///
/// The plain methods answer `None` when the key is absent; the `required_` ones report that as an error;
/// those with `_or` answer a default. A wrong value is reported by all of them and counts as absent.
pub(crate) struct Reader<'a> {
    /// `None` for a table that is not there, whose keys have their defaults.
    table: Option<&'a Table>,
    header: Span,
    title: Title,
    diagnostics: &'a Diagnostics,
    asked: RefCell<Vec<String>>,
    /// Whether the key that says what the table is of has a wrong value: then nobody knows its other keys.
    of_unknown_kind: Cell<bool>,
}

impl<'a> Reader<'a> {
    /// Reads the outermost table of a document.
    pub(crate) fn new(document: &'a Document, diagnostics: &'a Diagnostics) -> Reader<'a> {
        let title = Title { path: String::new(), text: String::new(), suffix: String::new() };
        Reader::with_title(Some(&document.root), document.root.header(), title, diagnostics)
    }

    fn with_title(table: Option<&'a Table>, header: Span, title: Title, diagnostics: &'a Diagnostics) -> Reader<'a> {
        Reader { table, header, title, diagnostics, asked: RefCell::new(Vec::new()), of_unknown_kind: Cell::new(false) }
    }

    // Places and messages.

    /// The table's name for messages: `[yarn.silk1]`, `[[light]] 2`; empty for the outermost table.
    pub(crate) fn title(&self) -> &str {
        &self.title.text
    }

    /// Where the table is announced.
    pub(crate) fn header(&self) -> Span {
        self.header
    }

    /// Where the value of a key was written. Does not count as asking for the key.
    pub(crate) fn span(&self, key: &str) -> Option<Span> {
        self.table?.get(key).map(|entry| entry.node.span)
    }

    /// Whether the key is there, right or wrong. Counts as asking for it.
    pub(crate) fn has(&self, key: &str) -> bool {
        self.entry(key).is_some()
    }

    /// The keys that are there, in the order they were written. Does not count as asking for them.
    pub(crate) fn keys(&self) -> impl Iterator<Item = &'a str> {
        self.table.into_iter().flat_map(Table::entries).map(|entry| entry.key.as_str())
    }

    /// Reports an error at the value of a key, or at the table's header when the key is absent.
    pub(crate) fn error_at(&self, key: &str, message: impl Into<String>, hint: Option<&str>) {
        self.report(Diagnostic::error(message), self.span(key), hint);
    }

    /// Reports a warning at the value of a key, or at the table's header when the key is absent.
    pub(crate) fn warning_at(&self, key: &str, message: impl Into<String>, hint: Option<&str>) {
        self.report(Diagnostic::warning(message), self.span(key), hint);
    }

    /// Reports an error at the table's header.
    pub(crate) fn error(&self, message: impl Into<String>, hint: Option<&str>) {
        self.report(Diagnostic::error(message), None, hint);
    }

    fn report(&self, diagnostic: Diagnostic, span: Option<Span>, hint: Option<&str>) {
        let diagnostic = diagnostic.at(span.unwrap_or(self.header()));
        self.diagnostics.push(match hint {
            Some(hint) => diagnostic.hint(hint),
            None => diagnostic,
        });
    }

    /// Reports every key that is there but was never asked for, unless the table is of an unknown kind ([`Self::kind`]).
    pub(crate) fn finish(self) {
        if self.of_unknown_kind.get() {
            return;
        }
        let asked = self.asked.take();
        for entry in self.table.into_iter().flat_map(Table::entries).filter(|entry| !entry.is_read()) {
            let message = format!("unknown key `{}`{}", shortened(&entry.key), self.title.inside());
            let hint = match nearest(&entry.key, asked.iter().map(String::as_str)) {
                Some(key) => format!("did you mean `{key}`?"),
                None if asked.is_empty() => "there are no keys here".to_owned(),
                None => format!("known keys: {}", listed(asked.iter().map(|key| format!("`{key}`")), "and")),
            };
            let diagnostic = Diagnostic::error(message).at(entry.key_span).hint(hint);
            let misplaced = Some((shortened(&entry.key), self.title.kind().to_owned()));
            self.diagnostics.push(Diagnostic { misplaced, ..diagnostic });
        }
        self.diagnostics.add_table(self.title.kind(), asked);
    }

    // Asking.

    /// The value under a key as it is.
    pub(crate) fn node(&self, key: &str) -> Option<&'a Node> {
        self.entry(key).map(|entry| &entry.node)
    }

    fn entry(&self, key: &str) -> Option<&'a Entry> {
        let mut asked = self.asked.borrow_mut();
        if !asked.iter().any(|known| known == key) {
            asked.push(key.to_owned());
        }
        let entry = self.table?.get(key)?;
        entry.mark_read();
        Some(entry)
    }

    /// The value under a key; its absence is an error at the table's header.
    fn required(&self, key: &str) -> bool {
        let there = self.has(key);
        if !there {
            self.error(format!("missing key `{key}`{}", self.title.inside()), None);
        }
        there
    }

    fn wrong_type(&self, key: &str, expected: &str, node: &Node) {
        let message = format!("`{key}`: expected {expected}, found {}", node.value.kind());
        let diagnostic = Diagnostic::error(message).at(node.span);
        self.diagnostics.push(match half_written(&node.value) {
            Some(number) => diagnostic.hint(format!("in TOML a point stands between digits: write {number}")),
            None => diagnostic,
        });
    }

    // Numbers.

    /// A number; integers are numbers too.
    pub(crate) fn f64(&self, key: &str, range: Range) -> Option<f64> {
        self.number(key, self.node(key)?, range, "a number")
    }

    /// A number, or the default.
    pub(crate) fn f64_or(&self, key: &str, default: f64, range: Range) -> f64 {
        self.f64(key, range).unwrap_or(default)
    }

    /// A number that must be there.
    pub(crate) fn required_f64(&self, key: &str, range: Range) -> Option<f64> {
        if self.required(key) { self.f64(key, range) } else { None }
    }

    fn number(&self, key: &str, node: &Node, range: Range, expected: &str) -> Option<f64> {
        let value = match node.value {
            Value::Float(value) => value,
            Value::Integer(value) => value as f64,
            _ => {
                self.wrong_type(key, expected, node);
                return None;
            }
        };
        if !range.contains(value) {
            let message = format!("`{key}` must be {range}, found {}", number_text(value));
            self.diagnostics.push(Diagnostic::error(message).at(node.span));
            return None;
        }
        Some(value)
    }

    /// A whole number, written without point and exponent.
    pub(crate) fn u64(&self, key: &str, range: RangeInclusive<u64>) -> Option<u64> {
        let node = self.node(key)?;
        let value = match node.value {
            Value::Integer(value) => value,
            Value::Float(value) => {
                let message = format!("`{key}`: expected an integer, found a float");
                let mut diagnostic = Diagnostic::error(message).at(node.span);
                // Below 2^53 floats are exact, so the suggestion says the same number.
                if value.fract() == 0.0 && (0.0..9e15).contains(&value) {
                    diagnostic = diagnostic.hint(format!("write {value}"));
                }
                self.diagnostics.push(diagnostic);
                return None;
            }
            _ => {
                self.wrong_type(key, "an integer", node);
                return None;
            }
        };
        match u64::try_from(value) {
            Ok(value) if range.contains(&value) => Some(value),
            _ => {
                let (low, high) = (range.start(), range.end());
                let allowed = match *high {
                    u64::MAX => format!("at least {low}"),
                    _ => format!("from {low} to {high}"),
                };
                let message = format!("`{key}` must be {allowed}, found {value}");
                self.diagnostics.push(Diagnostic::error(message).at(node.span));
                None
            }
        }
    }

    /// A whole number, or the default.
    pub(crate) fn u64_or(&self, key: &str, default: u64, range: RangeInclusive<u64>) -> u64 {
        self.u64(key, range).unwrap_or(default)
    }

    /// Three numbers in brackets, each in the range.
    pub(crate) fn vec3(&self, key: &str, range: Range) -> Option<[f64; 3]> {
        self.array(key, self.node(key)?, range, "an array of 3 numbers")
    }

    /// Three numbers in brackets, or the default.
    pub(crate) fn vec3_or(&self, key: &str, default: [f64; 3], range: Range) -> [f64; 3] {
        self.vec3(key, range).unwrap_or(default)
    }

    /// Three numbers in brackets that must be there.
    pub(crate) fn required_vec3(&self, key: &str, range: Range) -> Option<[f64; 3]> {
        if self.required(key) { self.vec3(key, range) } else { None }
    }

    /// Two numbers in brackets, each in the range.
    pub(crate) fn vec2(&self, key: &str, range: Range) -> Option<[f64; 2]> {
        self.array(key, self.node(key)?, range, "an array of 2 numbers")
    }

    /// Red, green and blue in brackets, or one number for all three.
    pub(crate) fn rgb(&self, key: &str, range: Range) -> Option<[f64; 3]> {
        const EXPECTED: &str = "a number or an array of 3 numbers";
        let node = self.node(key)?;
        match node.value {
            Value::Array(_) => self.array(key, node, range, EXPECTED),
            _ => self.number(key, node, range, EXPECTED).map(|value| [value; 3]),
        }
    }

    /// A color, or the default.
    pub(crate) fn rgb_or(&self, key: &str, default: [f64; 3], range: Range) -> [f64; 3] {
        self.rgb(key, range).unwrap_or(default)
    }

    /// Any count of numbers in brackets, or one number without.
    pub(crate) fn numbers(&self, key: &str, range: Range) -> Option<Vec<f64>> {
        const EXPECTED: &str = "a number or an array of numbers";
        let node = self.node(key)?;
        let elements = match &node.value {
            Value::Array(elements) => elements.as_slice(),
            _ => std::slice::from_ref(node),
        };
        self.all(elements, |element| self.number(key, element, range, EXPECTED))
    }

    /// Pairs of numbers: an array of arrays of two.
    pub(crate) fn pairs(&self, key: &str, range: Range) -> Option<Vec<[f64; 2]>> {
        const EXPECTED: &str = "an array of pairs of numbers";
        let node = self.node(key)?;
        let Value::Array(elements) = &node.value else {
            self.wrong_type(key, EXPECTED, node);
            return None;
        };
        self.all(elements, |element| self.array(key, element, range, EXPECTED))
    }

    fn array<const COUNT: usize>(&self, key: &str, node: &Node, range: Range, expected: &str) -> Option<[f64; COUNT]> {
        let Value::Array(elements) = &node.value else {
            self.wrong_type(key, expected, node);
            return None;
        };
        if elements.len() != COUNT {
            let message = format!("`{key}`: expected {expected}, found {} in the array", elements.len());
            self.diagnostics.push(Diagnostic::error(message).at(node.span));
            return None;
        }
        let numbers = self.all(elements, |element| self.number(key, element, range, "a number"))?;
        numbers.try_into().ok()
    }

    /// Reads every element, so that all errors are reported, and gives nothing if there was one.
    fn all<T>(&self, elements: &'a [Node], read: impl Fn(&'a Node) -> Option<T>) -> Option<Vec<T>> {
        let values: Vec<T> = elements.iter().filter_map(read).collect();
        (values.len() == elements.len()).then_some(values)
    }

    // Words.

    /// `true` or `false`.
    pub(crate) fn bool(&self, key: &str) -> Option<bool> {
        let node = self.node(key)?;
        match node.value {
            Value::Boolean(value) => Some(value),
            _ => {
                self.wrong_type(key, "true or false", node);
                None
            }
        }
    }

    /// `true` or `false`, or the default.
    pub(crate) fn bool_or(&self, key: &str, default: bool) -> bool {
        self.bool(key).unwrap_or(default)
    }

    /// Text in quotes.
    pub(crate) fn string(&self, key: &str) -> Option<&'a str> {
        let node = self.node(key)?;
        match &node.value {
            Value::String(text) => Some(text),
            _ => {
                self.wrong_type(key, "a string", node);
                None
            }
        }
    }

    /// Text, or the default.
    pub(crate) fn string_or(&self, key: &str, default: &'a str) -> &'a str {
        self.string(key).unwrap_or(default)
    }

    /// Text that must be there.
    pub(crate) fn required_string(&self, key: &str) -> Option<&'a str> {
        if self.required(key) { self.string(key) } else { None }
    }

    /// An array of texts, or one text; each with its place. Empty when the key is absent or wrong.
    pub(crate) fn strings(&self, key: &str) -> Vec<(&'a str, Span)> {
        let Some(node) = self.node(key) else { return Vec::new() };
        let elements = match &node.value {
            Value::Array(elements) => elements.as_slice(),
            _ => std::slice::from_ref(node),
        };
        let read = |element: &'a Node| match &element.value {
            Value::String(text) => Some((text.as_str(), element.span)),
            _ => {
                self.wrong_type(key, "a string or an array of strings", element);
                None
            }
        };
        self.all(elements, read).unwrap_or_default()
    }

    /// One of the names, as what it stands for.
    pub(crate) fn one_of<T: Clone>(&self, key: &str, choices: &[(&str, T)]) -> Option<T> {
        let text = self.string(key)?;
        if let Some((_, value)) = choices.iter().find(|(name, _)| *name == text) {
            return Some(value.clone());
        }
        let hint = match nearest(text, choices.iter().map(|(name, _)| *name)) {
            Some(name) => format!("did you mean \"{name}\"?"),
            None => format!("expected {}", listed(choices.iter().map(|(name, _)| format!("\"{name}\"")), "or")),
        };
        self.error_at(key, format!("unknown value \"{}\" for `{key}`", shortened(text)), Some(&hint));
        None
    }

    /// One of the names, or the default.
    pub(crate) fn one_of_or<T: Clone>(&self, key: &str, default: T, choices: &[(&str, T)]) -> T {
        self.one_of(key, choices).unwrap_or(default)
    }

    /// One of the names, for a key that decides which other keys a table has. Where its value is wrong, or the key is
    /// missing, [`Self::finish`] calls no key unknown: one mistake is told once.
    pub(crate) fn kind<T: Clone>(&self, key: &str, choices: &[(&str, T)]) -> Option<T> {
        let kind = self.required_one_of(key, choices);
        if kind.is_none() {
            self.of_unknown_kind();
        }
        kind
    }

    /// Says that nobody knows which keys the table has: [`Self::finish`] calls none unknown.
    pub(crate) fn of_unknown_kind(&self) {
        self.of_unknown_kind.set(true);
    }

    /// As [`Self::kind`], with a default for a table that does not say.
    pub(crate) fn kind_or<T: Clone>(&self, key: &str, default: T, choices: &[(&str, T)]) -> Option<T> {
        if self.has(key) { self.kind(key, choices) } else { Some(default) }
    }

    /// One of the names; the key must be there.
    pub(crate) fn required_one_of<T: Clone>(&self, key: &str, choices: &[(&str, T)]) -> Option<T> {
        if self.required(key) { self.one_of(key, choices) } else { None }
    }

    // Tables.

    /// A table.
    pub(crate) fn table(&self, key: &str) -> Option<Reader<'a>> {
        self.inner(key, self.node(key)?, self.title.table(key), "a table")
    }

    /// A table; where it is not there, one without keys.
    pub(crate) fn table_or_empty(&self, key: &str) -> Reader<'a> {
        let empty = || Reader::with_title(None, self.header, self.title.table(key), self.diagnostics);
        self.table(key).unwrap_or_else(empty)
    }

    /// A table that must be there.
    pub(crate) fn required_table(&self, key: &str) -> Option<Reader<'a>> {
        if self.required(key) { self.table(key) } else { None }
    }

    /// An array of tables, or one table. Empty when the key is absent; what is no table is left out.
    pub(crate) fn tables(&self, key: &str) -> Vec<Reader<'a>> {
        const EXPECTED: &str = "a table or an array of tables";
        let Some(node) = self.node(key) else { return Vec::new() };
        let Value::Array(elements) = &node.value else {
            return self.inner(key, node, self.title.table(key), EXPECTED).into_iter().collect();
        };
        let elements = elements.iter().enumerate();
        elements
            .filter_map(|(index, element)| self.inner(key, element, self.title.element(key, index + 1), EXPECTED))
            .collect()
    }

    /// The tables inside the table under a key, with their names: all `[yarn.NAME]` for `yarn`.
    /// Empty when the key is absent.
    pub(crate) fn named_tables(&self, key: &str) -> Vec<(&'a str, Reader<'a>)> {
        let Some(outer) = self.table(key) else { return Vec::new() };
        let names: Vec<&str> = outer.keys().collect();
        names.into_iter().filter_map(|name| Some((name, outer.table(name)?))).collect()
    }

    fn inner(&self, key: &str, node: &'a Node, title: Title, expected: &str) -> Option<Reader<'a>> {
        match &node.value {
            Value::Table(table) => Some(Reader::with_title(Some(table), table.header(), title, self.diagnostics)),
            _ => {
                self.wrong_type(&shortened(key), expected, node);
                None
            }
        }
    }
}

/// Text that is a number, or an array of numbers, but for points without a digit on one side, as TOML would have it: 0.1 for `.1`.
fn half_written(value: &Value) -> Option<String> {
    let Value::String(text) = value else { return None };
    let array = text.strip_prefix('[').and_then(|text| text.strip_suffix(']'));
    let parts: Vec<&str> = array.unwrap_or(text).split(',').map(str::trim).collect();
    let numbers: Vec<f64> = parts.iter().map(|part| part.parse()).collect::<Result<_, _>>().ok()?;
    let is_half = |part: &&str| part.trim_start_matches(['+', '-']).starts_with('.') || part.ends_with('.');
    let written = numbers.into_iter().map(number_text).collect::<Vec<_>>().join(", ");
    parts.iter().any(is_half).then(|| if array.is_some() { format!("[{written}]") } else { written })
}
