//! From the values and errors of the TOML parser to the tree and to diagnostics.

use std::cell::Cell;

use toml::de::{DeTable, DeValue};

use super::{
    super::diagnostic::{Diagnostic, Diagnostics, SourceId, Span, shortened},
    MAX_DEPTH, Node, Table, Value,
};

pub(super) fn too_deep(span: Span) -> Diagnostic {
    Diagnostic::error(format!("more than {MAX_DEPTH} arrays and tables inside each other")).at(span)
}

/// Reports what the parser complains about, without what only follows from an earlier mistake.
pub(super) fn report_syntax_errors(
    errors: &[toml::de::Error],
    text: &str,
    source: SourceId,
    diagnostics: &Diagnostics,
) {
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
pub(super) struct Converter<'a> {
    pub(super) source: SourceId,
    /// Where the parsed text begins in its source.
    pub(super) offset: usize,
    pub(super) diagnostics: &'a Diagnostics,
    pub(super) failed: Cell<bool>,
}

impl Converter<'_> {
    fn span(&self, range: std::ops::Range<usize>) -> Span {
        Span::new(self.source, self.offset + range.start, self.offset + range.end)
    }

    fn fail(&self, diagnostic: Diagnostic) {
        self.failed.set(true);
        self.diagnostics.push(diagnostic);
    }

    pub(super) fn table(&self, table: DeTable<'_>, header: Span, depth: usize) -> Table {
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

    pub(super) fn value(&self, value: DeValue<'_>, span: Span, depth: usize) -> Option<Value> {
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
