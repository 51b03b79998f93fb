//! How one diagnostic is shown: its place, the line of text and the caret below it.

use std::fmt::Write as _;

use super::{Diagnostic, Sources, Span};

/// Lines of text longer than this many columns are cut around the caret.
const MAX_LINE_COLUMNS: usize = 160;

/// Of a cut line, this many columns stay to the left of the caret.
const COLUMNS_BEFORE_CARET: usize = 60;

const TAB: &str = "    ";

/// What a hint stands behind where no caret has room for it, on a line of its own.
const HINT: &str = "  hint: ";

/// A message with a hint on the line below.
pub(crate) fn hinted(message: impl std::fmt::Display, hint: impl std::fmt::Display) -> String {
    format!("{message}\n{HINT}{hint}")
}

/// `label` says how severe it is.
pub(super) fn render_one(output: &mut String, diagnostic: &Diagnostic, sources: &Sources, label: &str) {
    let message = escaped(&diagnostic.message);
    let hint = diagnostic.hint.as_deref().map(escaped);
    let place = diagnostic.span.and_then(|span| Some((span, sources.get(span.source)?)));

    // Writing into a string cannot fail.
    let (indent, excerpt) = match place {
        None => {
            let _ = writeln!(output, "{label}{message}");
            (None, None)
        }
        Some((span, source)) if source.is_option => {
            let excerpt = excerpt(&source.text, 0, source.text.len(), span);
            let _ = writeln!(output, "{}: {label}{message}", excerpt.line);
            (Some(String::new()), (!span.is_whole()).then_some(excerpt))
        }
        Some((span, source)) if span.is_whole() => {
            let _ = writeln!(output, "{}: {label}{message}", escaped(&source.name));
            (None, None)
        }
        Some((span, source)) => {
            let position = Position::of(&source.text, span);
            let (line, column) = (position.line, position.column);
            let _ = writeln!(output, "{}:{line}:{column}: {label}{message}", escaped(&source.name));
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
            let _ = writeln!(output, "{HINT}{hint}");
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
pub(crate) fn escaped(text: &str) -> String {
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
