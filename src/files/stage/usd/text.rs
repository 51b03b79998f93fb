//! Layers of text as the reader takes them.
//!
//! The `openusd` crate (0.6) types a sample of a number by how it is written, whatever the attribute says: `0` is whole and
//! `0.5` is not. Between whole ones, or one of each, it does not go evenly but stands still, and usd-core writes whole
//! numbers without a point. And it takes samples for sorted, which USD does not ask for. Both are put right in the text.

use std::{borrow::Cow, fs, ops::Range, path::Path};

use openusd::usda::parser::Parser;

/// What text is made of, for those who look for words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Letters, digits and what numbers and names of properties hold.
    Word,
    /// In quotes.
    Quoted,
    /// Between `@`.
    Asset,
    /// Between `<` and `>`.
    Path,
    Comment,
    /// Any other byte but white space.
    Mark(u8),
}

/// A piece of text.
pub(super) struct Piece {
    pub(super) kind: Kind,
    /// All of its bytes.
    pub(super) all: Range<usize>,
    /// Those between its quotes or brackets.
    pub(super) inner: Range<usize>,
}

/// The pieces of text from a byte on. What is not closed goes on to the end.
pub(super) fn pieces(bytes: &[u8], from: usize) -> impl Iterator<Item = Piece> {
    let mut at = from;
    std::iter::from_fn(move || {
        at += bytes[at..].iter().position(|b| !b.is_ascii_whitespace())?;
        let found = piece(bytes, at);
        at = found.all.end;
        Some(found)
    })
}

fn piece(bytes: &[u8], at: usize) -> Piece {
    let rest = &bytes[at..];
    let until = |end: &dyn Fn(u8) -> bool| rest.iter().position(|&b| end(b)).unwrap_or(rest.len());
    let (kind, length, quotes) = match rest[0] {
        b'#' => (Kind::Comment, until(&|b| b == b'\n'), 0),
        b'<' => (Kind::Path, (until(&|b| b == b'>') + 1).min(rest.len()), 1),
        quote @ (b'"' | b'\'' | b'@') => {
            let quotes = if rest.starts_with(&[quote; 3]) { 3 } else { 1 };
            let kind = if quote == b'@' { Kind::Asset } else { Kind::Quoted };
            (kind, closed(rest, quotes, kind == Kind::Quoted), quotes)
        }
        b if of_a_word(b) => (Kind::Word, until(&|b| !of_a_word(b)), 0),
        b => (Kind::Mark(b), 1, 0),
    };
    let inner = (at + quotes)..(at + length).saturating_sub(quotes).max(at + quotes);
    Piece { kind, all: at..at + length, inner }
}

/// The length of what begins and ends with so many equal quotes.
fn closed(text: &[u8], quotes: usize, escapes: bool) -> usize {
    let mut i = quotes;
    while i < text.len() && !text[i..].starts_with(&text[..quotes]) {
        i += if escapes && text[i] == b'\\' { 2 } else { 1 };
    }
    (i + quotes).min(text.len())
}

fn of_a_word(b: u8) -> bool {
    b.is_ascii_alphanumeric() || matches!(b, b'_' | b'.' | b'+' | b'-') || b >= 0x80
}

/// The line at which a file of text cannot be read on; none of what is no text, or sound.
pub(super) fn broken_line(path: &Path) -> Option<usize> {
    let text = fs::read_to_string(path).ok().filter(|text| text.trim_start().starts_with("#usda"))?;
    let mut parser = Parser::new(&text);
    parser.parse().err()?;
    parser.last_error_highlight().map(|place| place.line)
}

/// The same layer with samples of numbers written as fractions, and all samples in the order of time.
pub(super) fn with_even_samples(bytes: Vec<u8>) -> Vec<u8> {
    const SAMPLES: &[u8] = b".timeSamples";
    if !bytes.trim_ascii_start().starts_with(b"#usda") || !bytes.windows(SAMPLES.len()).any(|w| w == SAMPLES) {
        return bytes;
    }
    let mut out: Option<Vec<u8>> = None;
    let mut copied = 0;
    for (block, of_numbers) in blocks(&bytes, SAMPLES) {
        if let Some(text) = rewritten(&bytes[block.clone()], of_numbers) {
            let out = out.get_or_insert_with(|| Vec::with_capacity(bytes.len() + bytes.len() / 8));
            out.extend_from_slice(&bytes[copied..block.start]);
            out.extend(text);
            copied = block.end;
        }
    }
    match out {
        None => bytes,
        Some(mut out) => {
            out.extend_from_slice(&bytes[copied..]);
            out
        }
    }
}

/// What stands between the braces of all samples, and whether they are of single numbers.
fn blocks(bytes: &[u8], samples: &[u8]) -> Vec<(Range<usize>, bool)> {
    let mut found = Vec::new();
    // Whether the last word is the type of a number, and whether what stands before the name that is read is.
    let (mut number, mut of_number) = (false, false);
    let mut in_name = false;
    // After `.timeSamples`: how far `= {` has come, and the depth in the braces.
    let (mut awaited, mut depth, mut start) = (0, 0usize, 0);
    for piece in pieces(bytes, 0) {
        if depth > 0 {
            match piece.kind {
                Kind::Mark(b'{' | b'[' | b'(') => depth += 1,
                Kind::Mark(b'}' | b']' | b')') => depth -= 1,
                _ => {}
            }
            if depth == 0 {
                found.push((start..piece.all.start, of_number));
                (awaited, number) = (0, false);
            }
            continue;
        }
        match (piece.kind, awaited) {
            (Kind::Comment, _) => {}
            (Kind::Mark(b'='), 1) => awaited = 2,
            (Kind::Mark(b'{'), 2) => (depth, start) = (1, piece.all.end),
            (Kind::Word, _) => {
                let word = &bytes[piece.all];
                awaited = usize::from(word.ends_with(samples));
                if !std::mem::take(&mut in_name) {
                    (of_number, number) = (number, matches!(word, b"float" | b"double" | b"half"));
                }
            }
            // Of a name in parts.
            (Kind::Mark(b':'), _) => in_name = true,
            _ => (awaited, number, in_name) = (0, false, false),
        }
    }
    found
}

/// Samples anew where they are not as the reader takes them.
fn rewritten(block: &[u8], of_numbers: bool) -> Option<Vec<u8>> {
    let mut samples: Vec<(f64, Cow<'_, [u8]>)> = Vec::new();
    let mut depth = 0usize;
    let (mut start, mut colon, mut end) = (None, None, 0);
    let marks = pieces(block, 0).filter(|p| p.kind != Kind::Comment).map(|p| (p.kind, p.all));
    for (kind, all) in marks.chain([(Kind::Mark(b','), block.len()..block.len())]) {
        match kind {
            Kind::Mark(b'{' | b'[' | b'(') => depth += 1,
            Kind::Mark(b'}' | b']' | b')') => depth = depth.saturating_sub(1),
            Kind::Mark(b':') if depth == 0 && colon.is_none() => colon = Some(all.clone()),
            Kind::Mark(b',') if depth == 0 => {
                if let (Some(start), Some(colon)) = (start.take(), colon.take()) {
                    let time: f64 = std::str::from_utf8(&block[start..colon.start]).ok()?.trim().parse().ok()?;
                    samples.push((time, Cow::Borrowed(block[colon.end..end].trim_ascii())));
                }
                continue;
            }
            _ => {}
        }
        start.get_or_insert(all.start);
        end = all.end;
    }
    let mut changed = !samples.is_sorted_by(|a, b| a.0 <= b.0);
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    if of_numbers {
        for (_, value) in &mut samples {
            if std::str::from_utf8(value).is_ok_and(|v| v.parse::<i64>().is_ok()) {
                value.to_mut().extend(b".0");
                changed = true;
            }
        }
    }
    let written = |(time, value): (f64, Cow<'_, [u8]>)| [format!("{time}: ").as_bytes(), &value, b", "].concat();
    changed.then(|| samples.into_iter().flat_map(written).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn anew(text: &str) -> String {
        String::from_utf8(with_even_samples(text.as_bytes().to_vec())).unwrap()
    }

    #[test]
    fn whole_numbers_become_fractions_where_the_type_is_one() {
        let layer = |own: &str| format!("#usda 1.0\ndef Camera \"c\"\n{{\n    {own}\n    int a = 1\n}}\n");
        let same = |own: &str| assert_eq!(anew(&layer(own)), layer(own));
        let becomes = |own: &str, other: &str| assert_eq!(anew(&layer(own)), layer(other));
        becomes("float f.timeSamples = { 1: 35, 2.5: 50.5, }", "float f.timeSamples = {1: 35.0, 2.5: 50.5, }");
        becomes("custom double a:b.timeSamples={-1:-3,2:None}", "custom double a:b.timeSamples={-1: -3.0, 2: None, }");
        becomes("float f.timeSamples = { # \"1: 2\n 1: 2 # of }\n, 3: 4 }", "float f.timeSamples = {1: 2.0, 3: 4.0, }");
        same("int f.timeSamples = { 1: 35, 2: 50 }");
        same("float[] f.timeSamples = { 1: [3, 4], 2: [5, 6] }");
        same("string f = \"float f.timeSamples = { 1: 35 }\"");
        same("float f = 3\n    int g.timeSamples = { 1: 35, 2: 50 }");
        same("float f\n    int g.timeSamples = { 1: 35, 2: 50 }");
        same("float f.timeSamples = { 1: 3.5, 2: 5e1 }");
    }

    #[test]
    fn samples_are_put_in_the_order_of_time() {
        let layer = |own: &str| format!("#usda 1.0\ndef Mesh \"m\"\n{{\n    {own}\n}}\n");
        assert_eq!(
            anew(&layer("point3f[] points.timeSamples = { 2: [(1, 2, 3), (4, 5, 6)], 1: [], }")),
            layer("point3f[] points.timeSamples = {1: [], 2: [(1, 2, 3), (4, 5, 6)], }")
        );
        assert_eq!(
            anew(&layer("token visibility.timeSamples = { 3: \"inherited\", 1: \"in,vis:ible\" }")),
            layer("token visibility.timeSamples = {1: \"in,vis:ible\", 3: \"inherited\", }")
        );
    }

    #[test]
    fn broken_samples_are_left_to_the_reader() {
        for text in ["float f.timeSamples = { a: 3, 2: 1 }", "float f.timeSamples = { 1: 3", "float f.timeSamples = 3"]
        {
            let text = format!("#usda 1.0\n{text}");
            assert_eq!(anew(&text), text);
        }
    }
}
