//! The tree: values with the places where they were written.

use std::{cell::Cell, collections::HashMap};

use super::super::diagnostic::{Sources, Span};

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

impl<const N: usize> From<[u32; N]> for Value {
    fn from(values: [u32; N]) -> Value {
        // They get the place of the whole where it is set.
        Value::Array(values.map(|value| Node { value: value.into(), span: Span::NONE }).into())
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
    pub(super) entries: Vec<Entry>,
    pub(super) positions: HashMap<String, usize>,
    pub(super) header: Span,
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

    pub(super) fn get_mut(&mut self, key: &str) -> Option<&mut Entry> {
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
