//! What is wrong with the user's files, and where: positions, messages, and how they are shown.
//!
//! Everything that comes from the user's files is escaped on its way out, so that no file can
//! play with the terminal. A diagnostic is one line of message, the line of text it is about, and a caret.

use std::cell::RefCell;
use std::fmt::Write as _;

/// How many diagnostics [`Diagnostics::render`] shows before it says "and N more".
pub const MAX_SHOWN: usize = 20;

/// Lines of text longer than this many columns are cut around the caret.
const MAX_LINE_COLUMNS: usize = 160;
/// Of a cut line, this many columns stay to the left of the caret.
const COLUMNS_BEFORE_CARET: usize = 60;
const TAB: &str = "    ";

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

    fn get(&self, id: SourceId) -> Option<&Source> {
        self.list.get(id.0 as usize)
    }
}

/// Whether the program can go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The scene cannot be used.
    Error,
    /// The scene can be used, but probably not as meant.
    Warning,
}

/// One thing the user should know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// Whether the program can go on.
    pub severity: Severity,
    /// One line, in lower case, without a full stop.
    pub message: String,
    /// Where it is, if it is anywhere.
    pub span: Option<Span>,
    /// What to do about it, shown beside the caret.
    pub hint: Option<String>,
}

impl Diagnostic {
    /// An error without a place or a hint.
    pub fn error(message: impl Into<String>) -> Diagnostic {
        Diagnostic { severity: Severity::Error, message: message.into(), span: None, hint: None }
    }

    /// A warning without a place or a hint.
    pub fn warning(message: impl Into<String>) -> Diagnostic {
        Diagnostic { severity: Severity::Warning, ..Diagnostic::error(message) }
    }

    /// The same at a place.
    pub fn at(self, span: Span) -> Diagnostic {
        Diagnostic { span: Some(span), ..self }
    }

    /// The same with a hint.
    pub fn hint(self, hint: impl Into<String>) -> Diagnostic {
        Diagnostic { hint: Some(hint.into()), ..self }
    }
}

/// Collects diagnostics. Shared by reference: many readers report into one collector.
#[derive(Default)]
pub struct Diagnostics {
    list: RefCell<Vec<Diagnostic>>,
}

impl Diagnostics {
    /// Nothing collected yet.
    pub fn new() -> Diagnostics {
        Diagnostics::default()
    }

    /// Adds one.
    pub fn push(&self, diagnostic: Diagnostic) {
        self.list.borrow_mut().push(diagnostic);
    }

    /// How many errors and warnings there are.
    pub fn len(&self) -> usize {
        self.list.borrow().len()
    }

    /// Whether there is nothing to tell.
    pub fn is_empty(&self) -> bool {
        self.list.borrow().is_empty()
    }

    /// How many errors there are; warnings do not count.
    pub fn error_count(&self) -> usize {
        self.list.borrow().iter().filter(|diagnostic| diagnostic.severity == Severity::Error).count()
    }

    /// Whether there is at least one error.
    pub fn has_errors(&self) -> bool {
        self.error_count() > 0
    }

    /// All of them in the order of their places: first by source, then from top to bottom;
    /// the same thing said twice is listed once, and what has no place comes last.
    pub fn sorted(&self) -> Vec<Diagnostic> {
        let mut list = self.list.borrow().clone();
        list.sort_by_key(|diagnostic| {
            // A message about a whole file comes before those about its lines.
            let place = diagnostic.span.map(|span| (span.source, !span.is_whole(), span.start));
            (place.is_none(), place)
        });
        list.dedup();
        list
    }

    /// The text for the user: each diagnostic with its line and a caret, the first [`MAX_SHOWN`] of them.
    pub fn render(&self, sources: &Sources) -> String {
        let list = self.sorted();
        let mut text = String::new();
        for diagnostic in list.iter().take(MAX_SHOWN) {
            render_one(&mut text, diagnostic, sources);
        }
        if list.len() > MAX_SHOWN {
            let _ = writeln!(text, "and {} more", list.len() - MAX_SHOWN);
        }
        text
    }
}

fn render_one(output: &mut String, diagnostic: &Diagnostic, sources: &Sources) {
    let severity = match diagnostic.severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
    };
    let message = escaped(&diagnostic.message);
    let hint = diagnostic.hint.as_deref().map(escaped);
    let place = diagnostic.span.and_then(|span| Some((span, sources.get(span.source)?)));

    // Writing into a string cannot fail.
    let (indent, excerpt) = match place {
        None => {
            let _ = writeln!(output, "{severity}: {message}");
            (None, None)
        }
        Some((span, source)) if source.is_option => {
            let excerpt = excerpt(&source.text, 0, source.text.len(), span);
            let _ = writeln!(output, "{}: {severity}: {message}", excerpt.line);
            (Some(String::new()), (!span.is_whole()).then_some(excerpt))
        }
        Some((span, source)) if span.is_whole() => {
            let _ = writeln!(output, "{}: {severity}: {message}", escaped(&source.name));
            (None, None)
        }
        Some((span, source)) => {
            let position = Position::of(&source.text, span);
            let (line, column) = (position.line, position.column);
            let _ = writeln!(output, "{}:{line}:{column}: {severity}: {message}", escaped(&source.name));
            let excerpt = excerpt(&source.text, position.line_start, position.line_end, span);
            let number = format!("{line:>5} | ");
            let _ = writeln!(output, "{}", format!("{number}{}", excerpt.line).trim_end());
            (Some(format!("{:>1$}", "| ", number.len())), Some(excerpt))
        }
    };
    match (indent, excerpt, hint) {
        (Some(indent), Some(excerpt), hint) => {
            let carets = "^".repeat(excerpt.caret_width);
            let _ = write!(output, "{indent}{:1$}{carets}", "", excerpt.caret_column);
            match hint {
                Some(hint) => {
                    let _ = writeln!(output, " {hint}");
                }
                None => output.push('\n'),
            }
        }
        (_, _, Some(hint)) => {
            let _ = writeln!(output, "      = {hint}");
        }
        (_, _, None) => {}
    }
}

/// Where a span begins, as the user counts, and the line it begins in.
struct Position {
    line: usize,
    column: usize,
    line_start: usize,
    line_end: usize,
}

impl Position {
    fn of(text: &str, span: Span) -> Position {
        let start = floor_char_boundary(text, span.start as usize);
        let before = &text[..start];
        let mut line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        if line_start == 0 && text.starts_with('\u{feff}') {
            line_start = '\u{feff}'.len_utf8(); // a byte order mark is not part of the first line
        }
        let mut line_end = text[start..].find('\n').map_or(text.len(), |newline| start + newline);
        if text[..line_end].ends_with('\r') && line_end > start {
            line_end -= 1;
        }
        let line = before.bytes().filter(|&byte| byte == b'\n').count() + 1;
        let column = text.get(line_start..start).map_or(0, |text| text.chars().count()) + 1;
        Position { line, column, line_start: line_start.min(line_end), line_end }
    }
}

/// A line as it is shown, and where the caret goes below it.
struct Excerpt {
    line: String,
    caret_column: usize,
    caret_width: usize,
}

/// The part of `text[line_start..line_end]` around the span that fits into [`MAX_LINE_COLUMNS`].
fn excerpt(text: &str, line_start: usize, line_end: usize, span: Span) -> Excerpt {
    let (start, end) =
        if span.is_whole() { (line_start, line_start) } else { (span.start as usize, span.end as usize) };
    let start = floor_char_boundary(text, start).clamp(line_start, line_end);
    let end = floor_char_boundary(text, end).clamp(start, line_end);

    // The caret's own text and what follows it, as much as there may be room for.
    let mut shown = [String::new(), String::new()];
    let mut widths = [0, 0];
    let mut cut_right = false;
    for (offset, character) in text[start..line_end].char_indices() {
        let part = usize::from(start + offset >= end);
        let (cell, width) = cell(character);
        if widths[0] + widths[1] + width > MAX_LINE_COLUMNS {
            cut_right = true;
            break;
        }
        shown[part].push_str(&cell);
        widths[part] += width;
    }

    // What comes before, from the caret to the left; all of it when the whole line is short enough.
    let room = MAX_LINE_COLUMNS - widths[0] - widths[1];
    let mut before = Vec::new();
    let mut before_width = 0;
    let mut cut_left = false;
    for character in text[line_start..start].chars().rev() {
        let (cell, width) = cell(character);
        if before_width + width > room.max(COLUMNS_BEFORE_CARET) {
            cut_left = true;
            break;
        }
        before.push(cell);
        before_width += width;
    }

    // Take from the right what the left side has used up, but never the caret's first character.
    let [mut caret, mut after] = shown;
    let mut over = (before_width + widths[0] + widths[1]).saturating_sub(MAX_LINE_COLUMNS);
    for (part, least) in [(&mut after, 0), (&mut caret, 1)] {
        while over > 0 && part.chars().count() > least {
            over = over.saturating_sub(part.pop().map_or(0, display_width));
            cut_right = true;
        }
    }

    let mut line = String::new();
    if cut_left {
        line.push('…');
    }
    line.extend(before.into_iter().rev());
    let caret_width = caret.chars().map(display_width).sum::<usize>().max(1);
    line.push_str(&caret);
    line.push_str(&after);
    if cut_right {
        line.push('…');
    }
    Excerpt { line, caret_column: before_width + usize::from(cut_left), caret_width }
}

/// A character as it is shown, and how many columns that takes.
fn cell(character: char) -> (String, usize) {
    if character == '\t' {
        return (TAB.to_owned(), TAB.len());
    }
    let mut text = String::new();
    push_escaped(&mut text, character);
    let width = text.chars().map(display_width).sum();
    (text, width)
}

/// The text with everything escaped that would not show as itself.
pub fn escaped(text: &str) -> String {
    let mut output = String::with_capacity(text.len());
    text.chars().for_each(|character| push_escaped(&mut output, character));
    output
}

fn push_escaped(output: &mut String, character: char) {
    // Besides the control characters, those that reorder or hide the text around them.
    let hidden = matches!(character,
        '\u{200b}' | '\u{200e}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}');
    if character.is_control() || hidden {
        output.extend(character.escape_default());
    } else {
        output.push(character);
    }
}

/// Columns a character takes in a terminal; a short table is enough to keep carets in place.
fn display_width(character: char) -> usize {
    match u32::from(character) {
        0x0300..=0x036f | 0x200c..=0x200d | 0xfe00..=0xfe0f => 0,
        0x1100..=0x115f | 0x2e80..=0xa4cf | 0xac00..=0xd7a3 | 0xf900..=0xfaff | 0xfe30..=0xfe6f => 2,
        0xff00..=0xff60 | 0xffe0..=0xffe6 | 0x1f300..=0x1f64f | 0x1f900..=0x1f9ff | 0x20000..=0x3fffd => 2,
        _ => 1,
    }
}

/// The last character boundary at or before `byte`.
fn floor_char_boundary(text: &str, byte: usize) -> usize {
    let mut byte = byte.min(text.len());
    while !text.is_char_boundary(byte) {
        byte -= 1;
    }
    byte
}

/// The candidate that `name` was probably meant to be: at most two slips of the finger away
/// (one for names of up to three letters; upper and lower case are the same), or else
/// the one that goes on where `name` stops, or stops before it.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    const LONGEST: usize = 64; // nobody types more by hand, and the distance costs the product of the lengths
    const SHORTEST_PREFIX: usize = 3;
    let wanted: Vec<char> = name.chars().take(LONGEST + 1).map(|character| character.to_ascii_lowercase()).collect();
    if wanted.is_empty() || wanted.len() > LONGEST {
        return None;
    }
    let allowed = if wanted.len() <= 3 { 1 } else { 2 };
    let mut best: Option<(usize, &str)> = None;
    for candidate in candidates {
        let letters: Vec<char> =
            candidate.chars().take(LONGEST + 1).map(|character| character.to_ascii_lowercase()).collect();
        if letters.is_empty() || letters.len() > LONGEST {
            continue;
        }
        let distance = edit_distance(&wanted, &letters);
        let shares_prefix = wanted.len().min(letters.len()) >= SHORTEST_PREFIX
            && (wanted.starts_with(&letters) || letters.starts_with(&wanted));
        let score = match distance {
            // Replacing every letter is no slip.
            distance if distance <= allowed && distance < wanted.len().max(letters.len()) => distance,
            distance if shares_prefix => allowed + distance,
            _ => continue,
        };
        if best.is_none_or(|(least, _)| score < least) {
            best = Some((score, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// Damerau-Levenshtein distance in its restricted form: insert, delete, replace, swap two neighbours.
fn edit_distance(first: &[char], second: &[char]) -> usize {
    let mut two_above: Vec<usize> = Vec::new();
    let mut above: Vec<usize> = (0..=second.len()).collect();
    for row in 1..=first.len() {
        let mut current = vec![row];
        for column in 1..=second.len() {
            let replace = above[column - 1] + usize::from(first[row - 1] != second[column - 1]);
            let mut least = replace.min(above[column] + 1).min(current[column - 1] + 1);
            let swapped =
                row > 1 && column > 1 && first[row - 1] == second[column - 2] && first[row - 2] == second[column - 1];
            if swapped {
                least = least.min(two_above[column - 2] + 1);
            }
            current.push(least);
        }
        two_above = std::mem::replace(&mut above, current);
    }
    above[second.len()]
}

/// Message and hint for a name that is not among `candidates`:
/// `unknown fiber "slk"` and `did you mean "silk"?`, or else a list of what there is.
pub fn unknown_name<'a>(
    what: &str,
    name: &str,
    candidates: impl IntoIterator<Item = &'a str> + Clone,
) -> (String, String) {
    let message = format!("unknown {what} \"{}\"", shortened(name));
    let hint = match nearest(name, candidates.clone()) {
        Some(candidate) => format!("did you mean \"{candidate}\"?"),
        None => match listed(candidates.into_iter().map(|candidate| format!("\"{candidate}\"")), "and") {
            list if list.is_empty() => format!("there is no {what}"),
            list => format!("there is {list}"),
        },
    };
    (message, hint)
}

/// `a, b or c`; long lists end in `...`.
pub(crate) fn listed(words: impl IntoIterator<Item = String>, last: &str) -> String {
    const MOST: usize = 30;
    let mut words: Vec<String> = words.into_iter().collect();
    if words.len() > MOST {
        words.truncate(MOST);
        return words.join(", ") + ", ...";
    }
    let Some(end) = words.pop() else { return String::new() };
    if words.is_empty() { end } else { format!("{} {last} {end}", words.join(", ")) }
}

/// The user's own text, cut to a length that fits into a message.
pub(crate) fn shortened(text: &str) -> String {
    const MOST: usize = 60;
    match text.char_indices().nth(MOST) {
        Some((byte, _)) => format!("{}…", &text[..byte]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(diagnostics.render(&sources), "a.toml: error: too big\n      = make it smaller\nwarning: odd\n");
        assert_eq!((diagnostics.len(), diagnostics.error_count()), (2, 1));
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
}
