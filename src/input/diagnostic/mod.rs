//! What is wrong with the user's files, and where: positions, messages, and how they are shown.
//!
//! Everything that comes from the user's files is escaped on its way out, so that no file can
//! play with the terminal. A diagnostic is one line of message, the line of text it is about, and a caret.

mod names;
mod show;
#[cfg(test)]
mod tests;

use std::{cell::RefCell, fmt::Write as _};

pub(crate) use names::{excerpt, listed, shortened};
pub(crate) use names::{nearest, unknown_name};
pub(crate) use show::hinted;
use show::render_one;

/// How many diagnostics [`Diagnostics::render`] shows before it says "and N more".
pub(crate) const MAX_SHOWN: usize = 20;

/// Names one text in [`Sources`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SourceId(u32);

/// A place in a text: a range of bytes in one source, or the source as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Span {
    source: SourceId,
    start: u32,
    end: u32,
}

impl Span {
    /// Of what has no place yet.
    pub(super) const NONE: Self = Self { source: SourceId(0), start: u32::MAX, end: u32::MAX };

    /// The bytes from `start` up to but without `end`.
    pub fn new(source: SourceId, start: usize, end: usize) -> Span {
        let offset = |byte: usize| u32::try_from(byte).unwrap_or(u32::MAX - 1);
        Span { source, start: offset(start), end: offset(end.max(start)) }
    }

    /// The source as a whole; shown with its name only, without a line or a caret.
    pub fn whole(source: SourceId) -> Span {
        Span { source, start: u32::MAX, end: u32::MAX }
    }

    /// The source this place is in.
    pub fn source(self) -> SourceId {
        self.source
    }

    fn is_whole(self) -> bool {
        self.start == u32::MAX
    }
}

struct Source {
    name: String,
    text: String,
    is_option: bool,
}

/// The texts that spans point into: files, and options of the command line.
#[derive(Default)]
pub struct Sources {
    list: Vec<Source>,
}

impl Sources {
    /// No texts yet.
    pub fn new() -> Sources {
        Sources::default()
    }

    /// Remembers a file under the path to show for it.
    pub fn add_file(&mut self, path: impl Into<String>, text: impl Into<String>) -> SourceId {
        self.add(Source { name: path.into(), text: text.into(), is_option: false })
    }

    /// Remembers an option of the command line, written as the user wrote it: `--set render.spp=16`.
    pub fn add_option(&mut self, text: impl Into<String>) -> SourceId {
        self.add(Source { name: String::new(), text: text.into(), is_option: true })
    }

    fn add(&mut self, source: Source) -> SourceId {
        self.list.push(source);
        SourceId(u32::try_from(self.list.len() - 1).expect("fewer than four billion sources"))
    }

    /// The path of a file, or the text of an option.
    pub fn name(&self, id: SourceId) -> &str {
        self.get(id).map_or("", |source| if source.is_option { &source.text } else { &source.name })
    }

    /// The text of a source.
    pub fn text(&self, id: SourceId) -> &str {
        self.get(id).map_or("", |source| &source.text)
    }

    /// Whether the source is an option of the command line.
    pub fn is_option(&self, id: SourceId) -> bool {
        self.get(id).is_some_and(|source| source.is_option)
    }

    /// The place of a line, from 0, of the text that a value of several lines at `span` holds; the whole value where it stands
    /// on one line, or where `\\` makes other lines of it.
    pub(crate) fn line_of_text(&self, span: Span, line: usize) -> Span {
        let find = || {
            let raw = self.text(span.source).get(span.start as usize..span.end as usize)?;
            let text = ["\"\"\"", "'''"].iter().find_map(|quotes| raw.strip_prefix(quotes)?.strip_suffix(quotes))?;
            if text.contains('\\') {
                return None;
            }
            // A line that begins behind the quotes is none of the text.
            let behind = text.strip_prefix('\n').or(text.strip_prefix("\r\n")).unwrap_or(text);
            let found = behind.split_inclusive('\n').nth(line)?;
            let start = found.as_ptr() as usize - raw.as_ptr() as usize + found.len() - found.trim_start().len();
            let start = span.start as usize + start;
            Some(Span::new(span.source, start, start + found.trim().len()))
        };
        find().unwrap_or(span)
    }

    fn get(&self, id: SourceId) -> Option<&Source> {
        self.list.get(id.0 as usize)
    }
}

/// Whether the program can go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Severity {
    /// The scene cannot be used.
    Error,
    /// The scene can be used, but probably not as meant.
    Warning,
}

impl Severity {
    /// What stands before the message.
    fn label(self) -> &'static str {
        match self {
            Self::Error => "error: ",
            Self::Warning => "warning: ",
        }
    }
}

/// One thing the user should know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Diagnostic {
    /// Whether the program can go on.
    pub severity: Severity,
    /// One line, in lower case, without a full stop.
    pub message: String,
    /// Where it is, if it is anywhere.
    pub span: Option<Span>,
    /// What to do about it, shown beside the caret.
    pub hint: Option<String>,
    /// A key that its table does not know, and the table: where else it is known is found out when all tables are read.
    pub misplaced: Option<(String, String)>,
}

impl Diagnostic {
    /// An error without a place or a hint.
    pub(crate) fn error(message: impl Into<String>) -> Diagnostic {
        Diagnostic { severity: Severity::Error, message: message.into(), span: None, hint: None, misplaced: None }
    }

    /// A warning without a place or a hint.
    pub(crate) fn warning(message: impl Into<String>) -> Diagnostic {
        Diagnostic { severity: Severity::Warning, ..Diagnostic::error(message) }
    }

    /// The same at a place.
    pub(crate) fn at(self, span: Span) -> Diagnostic {
        Diagnostic { span: Some(span), ..self }
    }

    /// The same with a hint.
    pub(crate) fn hint(self, hint: impl Into<String>) -> Diagnostic {
        Diagnostic { hint: Some(hint.into()), ..self }
    }
}

/// Collects diagnostics. Shared by reference: many readers report into one collector.
#[derive(Default)]
pub(crate) struct Diagnostics {
    list: RefCell<Vec<Diagnostic>>,
    /// Names of tables with the keys that they know.
    tables: RefCell<Vec<(String, Vec<String>)>>,
}

impl Diagnostics {
    /// Nothing collected yet.
    pub(crate) fn new() -> Diagnostics {
        Diagnostics::default()
    }

    /// Adds one.
    pub(crate) fn push(&self, diagnostic: Diagnostic) {
        self.list.borrow_mut().push(diagnostic);
    }

    /// Adds one, unless the same was said there already.
    pub(crate) fn push_once(&self, diagnostic: Diagnostic) {
        let mut list = self.list.borrow_mut();
        if !list.iter().any(|d| d.message == diagnostic.message && d.span == diagnostic.span) {
            list.push(diagnostic);
        }
    }

    /// Remembers which keys a table knows.
    pub(crate) fn add_table(&self, name: &str, keys: Vec<String>) {
        self.tables.borrow_mut().push((name.to_owned(), keys));
    }

    /// The other tables that know a key, if they are few.
    fn homes(&self, key: &str, own: &str) -> Option<String> {
        const MOST: usize = 3;
        let tables = self.tables.borrow();
        let know = tables.iter().filter(|(name, keys)| name != own && keys.iter().any(|known| known == key));
        let mut names: Vec<&str> = know.map(|(name, _)| name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        let names = names.into_iter().map(|name| if name.is_empty() { "the scene itself" } else { name }.to_owned());
        (1..=MOST).contains(&names.len()).then(|| listed(names, "and"))
    }

    /// How many errors there are; warnings do not count.
    pub(crate) fn error_count(&self) -> usize {
        self.list.borrow().iter().filter(|diagnostic| diagnostic.severity == Severity::Error).count()
    }

    /// Whether there is at least one error.
    pub(crate) fn has_errors(&self) -> bool {
        self.error_count() > 0
    }

    /// All of them in the order of their places: first by source, then from top to bottom;
    /// the same thing said twice is listed once, and what has no place comes last.
    pub(crate) fn sorted(&self) -> Vec<Diagnostic> {
        let mut list = self.list.borrow().clone();
        list.sort_by_key(|diagnostic| {
            // A message about a whole file comes before those about its lines.
            let place = diagnostic.span.map(|span| (span.source, !span.is_whole(), span.start));
            (place.is_none(), place)
        });
        list.dedup();
        for diagnostic in &mut list {
            if let Some((key, table)) = &diagnostic.misplaced
                && let Some(homes) = self.homes(key, table)
            {
                diagnostic.hint = Some(format!("`{key}` is a key of {homes}"));
            }
        }
        list
    }

    /// All that is collected, for who says himself that these are warnings: each with its line and a caret.
    pub(crate) fn warnings(&self, sources: &Sources) -> Vec<String> {
        let shown = |diagnostic: &Diagnostic| {
            let mut text = String::new();
            render_one(&mut text, diagnostic, sources, "");
            text.trim_end().to_owned()
        };
        self.sorted().iter().map(shown).collect()
    }

    /// The text for the user: each diagnostic with its line and a caret, the first [`MAX_SHOWN`] of them.
    pub(crate) fn render(&self, sources: &Sources) -> String {
        let list = self.sorted();
        let mut text = String::new();
        for diagnostic in list.iter().take(MAX_SHOWN) {
            render_one(&mut text, diagnostic, sources, diagnostic.severity.label());
        }
        if list.len() > MAX_SHOWN {
            let _ = writeln!(text, "and {} more", list.len() - MAX_SHOWN);
        }
        text
    }
}
