//! TOML text and `--set` options as one tree that knows where everything was written.
//!
//! A [`Document`] begins as a scene file; library files are merged under it, options are laid over it.
//! It knows nothing of the keys of the renderer: that is the business of whoever reads it
//! through a [`Reader`](super::reader::Reader).

mod convert;
mod path;
mod tree;

use std::cell::Cell;

use toml::de::{DeTable, DeValue};

use super::diagnostic::{Diagnostic, Diagnostics, SourceId, Sources, Span};
use convert::{Converter, report_syntax_errors, too_deep};
use path::{Container, Step, parse_path, path_text, place_at};
pub(crate) use tree::{Entry, Node, Table, Value};

/// Files above this size are not scenes; the caller refuses them before reading.
pub(crate) const MAX_FILE_BYTES: u64 = 64 << 20;

/// Arrays and tables inside each other, at most; deeper trees would end on the stack.
pub(crate) const MAX_DEPTH: usize = 64;

/// A scene as it was written: a file, libraries under it, options over it.
#[derive(Clone, Debug)]
pub(crate) struct Document {
    /// The outermost table.
    pub root: Table,
}

impl Document {
    /// Reads the text of a file; `path` is what messages call it. `None` when something was wrong
    /// with it; all of that is in `diagnostics` then.
    pub(crate) fn parse(path: &str, text: &str, sources: &mut Sources, diagnostics: &Diagnostics) -> Option<Document> {
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

    /// Adds what only the library has; see [`Table::merge`].
    pub(crate) fn merge(&mut self, library: Document, sources: &Sources) {
        self.root.merge(library.root, sources);
    }

    /// Applies one `--set` option, given as `KEY=VALUE`.
    ///
    /// The key is a path of names and, for arrays, indices counted from 0: `light.0.radiance=[1, 2, 3]`.
    /// Names with other than letters, digits, `_` and `-` may be quoted. The value is TOML, or else plain text.
    pub(crate) fn apply_option(&mut self, assignment: &str, sources: &mut Sources, diagnostics: &Diagnostics) {
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
    pub(crate) fn set(
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
