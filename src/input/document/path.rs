//! Paths of names and indices into the tree, as options have them.

use super::{
    super::diagnostic::{Span, shortened},
    Node, Table, Value,
};

/// One name of a path and where it was written.
#[derive(Clone, Debug)]
pub(super) struct Step {
    pub(super) name: String,
    /// The name as a position in an array, if it can be one.
    pub(super) index: Option<usize>,
    pub(super) start: usize,
    pub(super) end: usize,
}

pub(super) struct Steps {
    pub(super) list: Vec<Step>,
    /// Where the `=` is.
    pub(super) end: usize,
}

/// The path up to `=`. An error is a range of bytes and what is wrong there.
pub(super) fn parse_path(text: &str) -> Result<Steps, (usize, usize, String)> {
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

pub(super) fn path_text(steps: &[Step]) -> String {
    let names: Vec<&str> = steps.iter().map(|step| step.name.as_str()).collect();
    shortened(&names.join("."))
}

/// Where a walk along a path has come to.
pub(super) enum Container<'a> {
    Table(&'a mut Table),
    Array(&'a mut Vec<Node>),
}

impl<'a> Container<'a> {
    /// What is under the step; `None` is a key that is not there. The error is the end of a sentence.
    pub(super) fn find<'b>(&'b mut self, step: &Step) -> Result<Option<&'b mut Node>, String> {
        match self {
            Container::Table(table) => Container::Table(table).into_found(step),
            Container::Array(array) => Container::Array(array).into_found(step),
        }
    }

    /// Puts a value under a step that [`Container::find`] has accepted.
    pub(super) fn insert(&mut self, step: &Step, key_span: Span, node: Node) {
        match self {
            Container::Table(table) => table.insert(step.name.clone(), key_span, node),
            Container::Array(_) => {
                if let Ok(Some(element)) = self.find(step) {
                    *element = node;
                }
            }
        }
    }

    pub(super) fn into_found(self, step: &Step) -> Result<Option<&'a mut Node>, String> {
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
pub(super) fn place_at(node: &mut Node, span: Span) {
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
