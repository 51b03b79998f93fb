//! What a line is about: a row, rows that are repeated, or how the piece begins and ends.

use super::{KNOWN, MOST_ROWS, MOST_STITCHES, Result, Side, error, short, stitches_that_fit};

/// A sentence of the text, from where it begins.
#[derive(Clone, Debug)]
pub(super) enum Line {
    /// A row, or several that are alike, and how it is worked.
    Row(Head, String),
    /// Rows that are repeated.
    Again(Copies),
    /// So many stitches are cast on.
    CastOn(u32),
    /// It is bound off.
    BindOff,
    /// Nothing that is knitted.
    Nothing,
    /// It goes on with what stands before it.
    More(String),
}

/// What stands before the colon.
#[derive(Clone, Debug, Default)]
pub(super) struct Head {
    pub(super) rows: Vec<usize>,
    pub(super) side: Option<Side>,
    pub(super) round: bool,
    /// "Next row", "knit 3 rows": so many after those before it.
    pub(super) next: usize,
    /// "Row 2 and all WS rows": by how many rows they are apart.
    pub(super) all: Option<usize>,
    /// "All even rows": whether they are odd.
    pub(super) odd: Option<bool>,
    /// "Set-up row": whether it comes before the first one.
    pub(super) set_up: bool,
    /// "Short row 1": whether its number is one of short rows.
    pub(super) short: bool,
    /// "Row 1A", "Row 1 (MC)": whether it is one of two rows of a number, each of its own yarn.
    pub(super) pass: bool,
}

/// Which rows are repeated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Which {
    Rows(Vec<usize>),
    /// So many that were written last.
    Last(usize),
    From(usize),
    All,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Often {
    /// So many times more.
    More(u32),
    /// So many times in all.
    InAll(u32),
    /// For so many rows.
    Rows(usize),
    /// Until there are so many rows in all.
    RowsInAll(usize),
    /// Through the row with this number.
    Through(usize),
    /// Until so many stitches are left.
    Left(u32),
    /// Until so many stitches are on the needle.
    Have(u32),
    /// As long as the piece grows.
    Open,
}

/// The last row of those that are repeated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    On(Side),
    Row(usize),
}

/// "Rep rows 1-4 three times more."
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Copies {
    pub(super) which: Which,
    /// Whether its numbers are those of short rows.
    pub(super) short: bool,
    pub(super) often: Often,
    /// How high the piece is then, if that is said, mm.
    pub(super) height: Option<f64>,
    /// Which row is the last, if that is said.
    pub(super) ending: Option<Ending>,
}

/// A number in digits or as a word; also as in "1st" or "first".
pub(super) fn number(word: &str) -> Option<u32> {
    const WORDS: [[&str; 2]; 12] = [
        ["one", "first"],
        ["two", "second"],
        ["three", "third"],
        ["four", "fourth"],
        ["five", "fifth"],
        ["six", "sixth"],
        ["seven", "seventh"],
        ["eight", "eighth"],
        ["nine", "ninth"],
        ["ten", "tenth"],
        ["eleven", "eleventh"],
        ["twelve", "twelfth"],
    ];
    if let Some(n) = WORDS.iter().position(|words| words.contains(&word)) {
        return Some(n as u32 + 1);
    }
    let digits = word.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    matches!(&word[digits.len()..], "" | "st" | "nd" | "rd" | "th").then(|| digits.parse().ok()).flatten()
}

/// A piece of a head: a word in small letters, a sign, or what stands in brackets; and where it ends.
struct Token {
    text: String,
    end: usize,
}

/// The words, signs and brackets at the beginning of a text.
fn head_tokens(text: &str) -> Vec<Token> {
    /// No head is longer.
    const MOST: usize = 400;
    let mut out: Vec<Token> = Vec::new();
    let (mut word, mut close) = (String::new(), None);
    let flush = |word: &mut String, end: usize, out: &mut Vec<Token>| {
        if !word.is_empty() {
            out.push(Token { text: std::mem::take(word), end });
        }
    };
    for (i, c) in text.char_indices() {
        if let Some(end) = close {
            word.extend(c.to_lowercase());
            if c == end {
                close = None;
                flush(&mut word, i + c.len_utf8(), &mut out);
            }
            continue;
        }
        if c.is_alphanumeric() {
            // "R1", "Rnd2"
            let splits = c.is_ascii_digit() && !word.is_empty() && !word.ends_with(|d: char| d.is_ascii_digit());
            if splits && is_row(&word) {
                flush(&mut word, i, &mut out);
            }
            word.extend(c.to_lowercase());
            continue;
        }
        flush(&mut word, i, &mut out);
        if out.len() > MOST {
            break;
        }
        match c {
            '(' | '[' => {
                close = Some(if c == '(' { ')' } else { ']' });
                word.push(c);
            }
            c if c.is_whitespace() => {}
            c => out.push(Token { text: c.to_string(), end: i + c.len_utf8() }),
        }
    }
    flush(&mut word, text.len(), &mut out);
    out
}

fn is_row(word: &str) -> bool {
    is_round(word) || matches!(word, "row" | "rows" | "r" | "sr")
}

/// Names of the yarns of a knit of two colours.
fn is_color(word: &str) -> bool {
    matches!(word, "mc" | "cc" | "lc" | "dc" | "c1" | "c2" | "ca" | "cb")
}

fn is_round(word: &str) -> bool {
    matches!(word, "rnd" | "rnds" | "round" | "rounds")
}

/// The side that words name: both or none is none.
fn side_of(text: &str) -> Option<Side> {
    let words: Vec<&str> = text.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).collect();
    let says = |short: &str, long: &str| words.contains(&short) || words.windows(2).any(|w| w == [long, "side"]);
    match (says("rs", "right"), says("ws", "wrong")) {
        (true, false) => Some(Side::Right),
        (false, true) => Some(Side::Wrong),
        _ => None,
    }
}

impl Head {
    /// The head of a line and what stands behind it; `None` if it has none.
    pub(super) fn split(text: &str, line: usize) -> Result<Option<(Self, &str)>> {
        let mut reading = Reading::new();
        let tokens = head_tokens(text);
        let mut end = 0;
        for (i, token) in tokens.iter().enumerate() {
            let next = tokens.get(i + 1).map_or("", |t| t.text.as_str());
            let then = reading.word(&token.text, next, line)?;
            if then != Then::EndBefore {
                end = token.end;
            }
            if then != Then::GoOn {
                break;
            }
            reading.said.push_str(&token.text);
            reading.said.push(' ');
        }
        let Some(mut head) = reading.finish() else { return Ok(None) };
        let mut body = text[end..].trim();
        // "1st row: (RS). K2."
        for (open, close) in [('(', ')'), ('[', ']')] {
            if body.starts_with(open)
                && let Some(at) = body.find(close)
                && let Some(side) = side_of(&body[..at].to_lowercase())
            {
                head.side = Some(side);
                body = body[at + 1..].trim();
            }
        }
        Ok(Some((head, body.trim_start_matches([':', '.', '-', ' ']))))
    }
}

/// A head that is read word by word.
struct Reading {
    head: Head,
    /// Whether it says that it is of rows.
    known: bool,
    /// Whether the next number ends a range.
    range: bool,
    /// Whether the next number is another row: a list goes on behind a comma, and "Row 1 2/1 LC" is none.
    goes_on: bool,
    /// The words so far.
    said: String,
}

/// What follows a word of a head.
#[derive(Clone, Copy, PartialEq)]
enum Then {
    GoOn,
    /// The head ends behind it.
    EndBehind,
    /// The head ended before it.
    EndBefore,
}

fn is_number(word: &str) -> bool {
    number(word).is_some() || word.starts_with(|c: char| c.is_ascii_digit())
}

impl Reading {
    fn new() -> Self {
        Self { head: Head::default(), known: false, range: false, goes_on: true, said: String::new() }
    }

    fn word(&mut self, word: &str, next: &str, line: usize) -> Result<Then> {
        let head = &mut self.head;
        match word {
            ":" | "." => return Ok(Then::EndBehind),
            // "All even-numbered rows"
            "-" if next == "numbered" => {}
            "short" if next == "-" || is_row(next) => head.short = true,
            "-" if head.short && !self.known && is_row(next) => {}
            // "1st row - k2"
            "-" | "\u{2013}" | "\u{2014}" if !is_number(next) => return Ok(Then::EndBehind),
            "-" | "\u{2013}" | "\u{2014}" => self.range = true,
            "," | "&" | "and" | "plus" if is_number(next) || is_row(next) || is_all(next) => self.goes_on = true,
            "to" | "through" | "thru" if is_number(next) && !head.rows.is_empty() => self.range = true,
            word if is_row(word) => {
                self.known = true;
                head.round |= is_round(word);
                head.short |= word == "sr";
                self.goes_on |= head.rows.is_empty();
            }
            word if word.starts_with(['(', '[']) && plain_words(word).iter().any(|w| is_all(w)) => {
                self.and_all(&plain_words(word));
            }
            // "(RS)", "(24 sts)", "(dec row)"
            word if word.starts_with(['(', '['])
                && (side_of(word).is_some()
                    || is_count(word)
                    || plain_words(word).iter().any(|w| is_row(w) || is_color(w))) =>
            {
                head.pass |= plain_words(word).iter().any(|w| is_color(w));
            }
            // "Row 1 MC:"
            word if is_color(word) && !head.rows.is_empty() && (next == ":" || next.starts_with('(')) => {
                head.pass = true
            }
            word if is_all(word) => head.all = head.all.or(Some(1)),
            word if is_of_a_side(word) => {
                if matches!(word, "even" | "odd") {
                    head.odd = Some(word == "odd");
                }
                head.all = head.all.map(|_| 2);
            }
            "next" => head.next = 1,
            word if is_number(word) => return self.number(word, next, line),
            _ => return Ok(Then::EndBefore),
        }
        Ok(Then::GoOn)
    }

    /// "(and all WS rows)", "(and every 4th row)".
    fn and_all(&mut self, words: &[String]) {
        let head = &mut self.head;
        for word in words {
            head.all = match (head.all, number(word)) {
                (None, _) => is_all(word).then_some(1),
                (Some(_), Some(apart)) => Some((apart as usize).max(1)),
                (Some(_), None) if is_of_a_side(word) => Some(2),
                (apart, None) => apart,
            };
        }
    }

    fn number(&mut self, word: &str, next: &str, line: usize) -> Result<Then> {
        // "rows 1-2, 3 times more"
        if matches!(next, "times" | "time" | "more" | "further") {
            return Ok(Then::EndBefore);
        }
        let head = &mut self.head;
        // "Row 1A"
        let letter = word.strip_suffix(['a', 'b']).filter(|digits| self.known && digits.parse::<u32>().is_ok());
        head.pass |= letter.is_some();
        let Some(n) = number(letter.unwrap_or(word)).map(|n| n as usize) else {
            if self.known && self.goes_on && head.all.is_none() {
                return error(line, format!("\"{}\" is no row", short(word)), "as in Row 1:");
            }
            return Ok(Then::EndBefore);
        };
        if head.next > 0 {
            head.next = n.min(MOST_ROWS);
        } else if let Some(apart) = &mut head.all {
            // "every 4th row"
            *apart = n.max(1);
        } else if std::mem::take(&mut self.range) {
            let first = head.rows.pop().unwrap_or(n);
            if first > n || n - first >= MOST_ROWS {
                return error(line, format!("\"{first}-{n}\" is no range of rows"), "as in Rows 1-4:");
            }
            head.rows.extend(first..=n);
        } else if self.goes_on {
            head.rows.push(n);
        } else {
            return Ok(Then::EndBefore);
        }
        self.goes_on = matches!(next, "-" | "\u{2013}" | "\u{2014}" | "to" | "through" | "thru");
        Ok(Then::GoOn)
    }

    /// The head, if that was one.
    fn finish(self) -> Option<Head> {
        let Self { mut head, known, said, .. } = self;
        head.side = side_of(&said);
        let plural = || ["rows", "rnds", "rounds"].iter().any(|rows| said.split(' ').any(|word| word == *rows));
        if head.rows.is_empty() && head.next == 0 && (head.side.is_some() || head.odd.is_some()) && plural() {
            head.all = Some(2);
        }
        (known && (!head.rows.is_empty() || head.next > 0 || head.all.is_some())).then_some(head)
    }
}

fn is_all(word: &str) -> bool {
    matches!(word, "all" | "every" | "each" | "foll" | "following")
}

/// Whether a word says that rows are those of one side, or every second one.
fn is_of_a_side(word: &str) -> bool {
    matches!(
        word,
        "ws" | "rs" | "wrong" | "right" | "side" | "alternate" | "alt" | "even" | "odd" | "other" | "numbered"
    )
}

/// Whether brackets hold a number of stitches.
fn is_count(brackets: &str) -> bool {
    let words = plain_words(brackets);
    words.first().is_some_and(|w| w.parse::<u32>().is_ok())
        && words.get(1).is_some_and(|w| matches!(w.as_str(), "st" | "sts" | "stitches"))
}

/// The words of a text in small letters, without the signs between them.
pub(super) fn plain_words(text: &str) -> Vec<String> {
    let lower = text.to_lowercase();
    let is_sign = |c: char| c.is_whitespace() || matches!(c, ',' | ';' | '.' | '(' | ')' | '[' | ']' | ':' | '*');
    lower.split(is_sign).filter(|w| !w.is_empty()).map(str::to_owned).collect()
}

/// Whether a word says to bind off; "off" follows some.
pub(super) fn binds_off(words: &[&str]) -> bool {
    matches!(words, ["bo" | "bindoff", ..] | ["bind" | "cast", "off", ..])
}

/// A set-up row as it would be written if it were not one: "Next row (WS): p" of "Set-up row (WS): p", "Row 2: k" of
/// "Foundation row 2: k".
fn set_up(text: &str) -> Option<String> {
    const NAMES: [&str; 6] = ["set-up", "set up", "setup", "foundation", "preparation", "preparatory"];
    let is_named = |name: &&str| text.get(..name.len()).is_some_and(|start| start.eq_ignore_ascii_case(name));
    let rest = text[NAMES.iter().find(|name| is_named(name))?.len()..].trim_start();
    let tokens = head_tokens(rest);
    let [row, behind @ ..] = tokens.as_slice() else { return None };
    let is_numbered = behind.first().is_some_and(|token| number(&token.text).is_some());
    is_row(&row.text).then(|| if is_numbered { rest.to_owned() } else { format!("next {rest}") })
}

/// What a piece of text is about.
pub(super) fn read(text: &str, line: usize) -> Result<Line> {
    if let Some(row) = set_up(text) {
        let split = Head::split(&row, line)?;
        let Some((head, body)) = split.filter(|(_, body)| !body.is_empty()) else { return no_row(text, line) };
        return Ok(Line::Row(Head { set_up: true, ..head }, body.to_owned()));
    }
    if let Some((head, body)) = Head::split(text, line)? {
        let words = plain_words(body);
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        // "Row 17: bind off all sts in pattern"
        if binds_off(&words) && !words.iter().any(|w| number(w).is_some() || matches!(*w, "next" | "first")) {
            return Ok(Line::BindOff);
        }
        return Ok(Line::Row(head, body.to_owned()));
    }
    let words = plain_words(text);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    if let Some(copies) = Copies::read(&words, text, line)? {
        return Ok(Line::Again(copies));
    }
    let whole_row = |name: &str| if name.starts_with('k') { "knit" } else { "purl" }.to_owned();
    Ok(match words[..] {
        // "Knit 3 rows."
        [name @ ("k" | "knit" | "p" | "purl"), n, row] if number(n).is_some() && is_row(row) => {
            let next = number(n).map_or(0, |n| n as usize).min(MOST_ROWS);
            Line::Row(Head { round: is_round(row), next, ..Head::default() }, whole_row(name))
        }
        // "Knit every row."
        [name @ ("k" | "knit" | "p" | "purl"), all, row] if is_all(all) && is_row(row) => {
            Line::Row(Head { round: is_round(row), all: Some(1), ..Head::default() }, whole_row(name))
        }
        ["cast", "on", n, ref behind @ ..] | ["co", n, ref behind @ ..] if number(n).is_some() => {
            let is_more = |w: &[&str]| (number(w[0]).is_some() || w[0] == "next") && is_row(w[1]);
            if behind.windows(2).any(is_more) {
                let hint = "rows stand behind it, each with its head: Knit 4 rows; stitches that are cast on later, in their row";
                return error(line, format!("\"{}\" is more than a cast-on", short(text)), hint);
            }
            let count = number(n).unwrap_or_default();
            if !(1..=MOST_STITCHES).contains(&count) {
                return error(line, format!("{count} stitches are cast on"), stitches_that_fit());
            }
            Line::CastOn(count)
        }
        ["cast", "on", ..] | ["co" | "multiple" | "fasten" | "note" | "notes", ..] => Line::Nothing,
        ref words if is_title_of_short_rows(text, words) => Line::Nothing,
        ["break" | "cut", "yarn" | "the", ..] | ["weave", "in", ..] | ["worked", "over", ..] => Line::Nothing,
        ref words if binds_off(words) && !words.iter().any(|w| number(w).is_some()) => Line::BindOff,
        _ => Line::More(text.to_owned()),
    })
}

/// "Short rows:", "Work short rows as follows:", "Short-row shaping".
fn is_title_of_short_rows(text: &str, words: &[&str]) -> bool {
    let filler = |w: &&str| {
        matches!(
            *w,
            "work" | "begin" | "shape" | "with" | "as" | "follows" | "shaping" | "the" | "heel" | "shoulder" | "back"
        ) || matches!(*w, "short" | "row" | "rows" | "short-row" | "short-rows" | "german" | "now" | "section" | "neck")
    };
    let names = words.iter().any(|w| w.starts_with("short")) && words.iter().all(filler);
    names && (text.ends_with(':') || words.contains(&"shaping") || words.contains(&"section"))
}

/// Where in a line another sentence begins that is about rows: "Row 1: Knit. Row 2: Purl."
pub(super) fn sentences(text: &str) -> Vec<&str> {
    let mut out = Vec::new();
    let mut rest = text;
    let mut from = 0;
    while let Some(at) = rest[from..].find(['.', ')', ']']).map(|at| from + at + 1) {
        from = at;
        let next = rest[at..].trim_start();
        let starts = !next.is_empty() && next.len() < rest[at..].len() && begins(next);
        if starts && !rest[..at].trim().is_empty() {
            // "Row 1. (RS) k2": a head has begun, and goes on.
            out.push(&rest[..at]);
            rest = next;
            from = 0;
        }
    }
    out.push(rest);
    out
}

/// Whether a text begins with a row or a repeat of rows.
fn begins(text: &str) -> bool {
    // Heads are short, and another sentence is no part of this one: "Knit 4 rows. Row 1: ..."
    let start: String = text.chars().take(200).collect();
    let end = start.match_indices('.').map(|(at, _)| at + 1).find(|at| start[*at..].starts_with(char::is_whitespace));
    let start = &start[..end.unwrap_or(start.len())];
    !matches!(read(start, 0), Ok(Line::More(_)))
}

impl Copies {
    /// "Repeat rows 1 and 2", "rep the last 4 rows twice more", "these 4 rows form the pattern", "cont in patt until ...".
    pub(super) fn read(words: &[&str], text: &str, line: usize) -> Result<Option<Self>> {
        // "Rep short rows 1 and 2"
        let is_short = words.windows(2).any(|w| w[0] == "short" && is_row(w[1]))
            || words.iter().any(|w| w.starts_with("short-row"));
        let words: Vec<&str> =
            words.iter().filter(|w| !(is_short && **w == "short")).map(|w| w.trim_start_matches("short-")).collect();
        let words = &words[..];
        let (verb, rest) = match words {
            [
                verb @ ("rep" | "repeat" | "work" | "continue" | "cont"),
                "in" | "as",
                "patt" | "pattern" | "pat" | "set" | "established" | "this",
                rest @ ..,
            ] => (*verb, (Which::All, rest)),
            ["cont" | "continue", "working" | "to" | "even", rest @ ..] => ("cont", (Which::All, rest)),
            [verb @ ("rep" | "repeat" | "work" | "continue" | "cont"), rest @ ..] => {
                let rest = match rest {
                    ["with" | "for" | "as" | "to", rest @ ..] => rest,
                    rest => rest,
                };
                match (of_a_count(verb, rest, line)?, which(rest, text, line)?) {
                    (Some(found), _) | (None, Some(found)) => (*verb, found),
                    (None, None) => return Ok(None),
                }
            }
            // "These 4 rows form the pattern."
            [first, .., last] if matches!(*first, "these" | "this" | "the" | "last" | "rows" | "row") => {
                let forms = words.iter().position(|w| matches!(*w, "form" | "forms" | "set" | "sets" | "make"));
                let is_pattern = matches!(*last, "patt" | "pattern" | "pat" | "rib" | "ribbing");
                match (forms, which(words, text, line)?) {
                    (Some(forms), Some((found, _))) if is_pattern => ("form", (found, &words[forms..])),
                    _ => return Ok(None),
                }
            }
            _ => return Ok(None),
        };
        let (which, rest) = rest;
        if let Some(word) = rest
            .iter()
            .find(|w| matches!(**w, "inc" | "dec" | "increase" | "decrease" | "increasing" | "decreasing" | "inc'g"))
        {
            let hint = "write rows that change their number of stitches out, as in Row 5: k1, k2tog, k to end";
            return error(line, format!("\"{}\" in rows that are repeated is not followed", short(word)), hint);
        }
        // "Then bind off" goes without saying.
        let bound = (0..rest.len()).find(|&at| binds_off(&rest[at..])).unwrap_or(rest.len());
        let (rest, ending) = ending(&rest[..bound], line)?;
        if let Some(at) = another(rest) {
            let hint = "write what comes behind it as a line of its own";
            return error(
                line,
                format!("\"{}\" stands behind the end of a repeat", short(&rest[at..].join(" "))),
                hint,
            );
        }
        let height = measure(text);
        let often = match (verb, often(rest)) {
            ("work", Some(Often::More(n))) if !rest.contains(&"more") => Often::InAll(n),
            (_, Some(often)) => often,
            ("form", None) => Often::Open,
            (_, None) if height.is_some() || goes_on(rest) => Often::Open,
            (_, None) => return error(line, format!("\"{}\" says no end of the repeat", short(&rest.join(" "))), ENDS),
        };
        Ok(Some(Self { which, short: is_short, often, height, ending }))
    }
}

/// "Continue for 10 rows", "rep last", of rows that are counted: "4 rows" is no row 4.
fn of_a_count<'a, 'w>(verb: &str, words: &'a [&'w str], line: usize) -> Result<Option<(Which, &'a [&'w str])>> {
    let [n, "rows" | "rnds" | "rounds", behind @ ..] = words else { return Ok(None) };
    let Ok(count) = n.parse::<usize>() else { return Ok(None) };
    if matches!(verb, "rep" | "repeat") {
        return Ok(Some((Which::Last(count), behind)));
    }
    let filler = |w: &&str| {
        matches!(*w, "more" | "in" | "as" | "patt" | "pattern" | "pat" | "set" | "established" | "this" | "the")
            || matches!(*w, "even" | "straight" | "above" | "before" | "manner" | "way" | "and" | "then")
    };
    if behind.iter().all(filler) {
        return Ok(Some((Which::All, words)));
    }
    let problem = format!("\"{}\" does not say what is worked in them", short(&words.join(" ")));
    error(line, problem, "as in Knit 4 rows; or rows with numbers, and Rep rows 1-4")
}

/// Where something else begins behind the end of a repeat: "twice, then rows 1-3 once more", "for 10 cm, then knit 4 rows".
fn another(words: &[&str]) -> Option<usize> {
    let verb = |w: &str| matches!(w, "rep" | "repeat" | "knit" | "purl" | "k" | "p" | "work" | "then");
    (1..words.len()).find(|&at| {
        let (first, behind) = words.split_at(at);
        let has_end = || often(first).is_some() || measure(&format!("for {}", first.join(" "))).is_some();
        verb(words[at]) && behind.iter().any(|w| is_row(w)) && has_end()
    })
}

/// How repeats may end.
const ENDS: &str = "3 times more, a total of 5 times, for 20 rows, until 30 rows have been worked, until 9 sts remain, until there are \
                    9 sts and until piece measures 10 cm are known, and ending with a WS row behind them";

/// Whether what stands behind rows that are repeated says that they go on without an end: "for pattern", "to desired length".
fn goes_on(words: &[&str]) -> bool {
    let filler = |w: &&str| {
        matches!(
            *w,
            "for" | "in" | "as" | "to" | "until" | "the" | "of" | "this" | "set" | "established" | "manner" | "way"
        ) || matches!(*w, "work" | "working" | "piece" | "end" | "rest" | "and" | "then" | "even")
    };
    let open = |w: &&str| {
        matches!(*w, "throughout" | "length" | "desired" | "required" | "wanted" | "wished" | "like" | "wish" | "long")
    };
    let pattern = |w: &&str| matches!(*w, "patt" | "pattern" | "pat" | "rib" | "ribbing" | "st" | "stitch");
    words.iter().all(filler)
        || words.iter().any(open)
        || (words.iter().any(pattern) && !words.iter().any(|w| is_until(w)))
}

fn is_until(word: &str) -> bool {
    matches!(word, "until" | "till" | "til")
}

/// "Ending with a WS row", "end on row 4": the words without it, and what it says.
fn ending<'a, 'w>(words: &'a [&'w str], line: usize) -> Result<(&'a [&'w str], Option<Ending>)> {
    let ends = |pair: &[&str]| {
        matches!(pair, ["end" | "ends" | "ending" | "finish" | "finishing", "with" | "after" | "on" | "by" | "having"])
    };
    let Some(at) = words.windows(2).position(ends) else { return Ok((words, None)) };
    let tail = &words[at + 2..];
    let named = match tail {
        ["a" | "an" | "the", rest @ ..] => rest,
        rest => rest,
    };
    let is_last = |row: &str, n: &str| is_row(row) && number(n).is_some();
    let ending = match (side_of(&named.iter().take(2).copied().collect::<Vec<_>>().join(" ")), named) {
        (Some(side), _) => Some(Ending::On(side)),
        (None, [row, n, ..]) if is_last(row, n) => number(n).map(|n| Ending::Row(n as usize)),
        // "Ending with the 4th row"
        (None, [n, row, ..]) if is_last(row, n) => number(n).map(|n| Ending::Row(n as usize)),
        _ => None,
    };
    match ending {
        Some(_) => Ok((&words[..at], ending)),
        None => error(
            line,
            format!("\"{}\" ends on no row", short(&words[at..].join(" "))),
            "as in ending with a WS row, or ending with row 4",
        ),
    }
}

/// Which rows words name, and the words behind them.
fn which<'a, 'w>(words: &'a [&'w str], text: &str, line: usize) -> Result<Option<(Which, &'a [&'w str])>> {
    let words = if let ["the", rest @ ..] = words { rest } else { words };
    Ok(match words {
        ["from", row, n, rest @ ..] if is_row(row) => number(n).map(|n| (Which::From(n as usize), rest)),
        ["last" | "these" | "previous" | "above" | "prev", n, row, rest @ ..] if is_row(row) => {
            number(n).map(|n| (Which::Last(n as usize), rest))
        }
        ["last" | "this" | "previous" | "above" | "prev", row, rest @ ..] if is_row(row) => {
            Some((Which::Last(1), rest))
        }
        ["these", row, rest @ ..] if is_row(row) => Some((Which::All, rest)),
        [row, ..]
            if is_row(row)
                || row.starts_with(|c: char| c.is_ascii_digit())
                || is_row(row.trim_end_matches(|c: char| c.is_ascii_digit())) =>
        {
            // As a head has them, with its signs.
            let lower = text.to_lowercase();
            let begins = |at: &usize| !lower[..*at].ends_with(|c: char| c.is_alphanumeric());
            let Some(at) = lower.match_indices(row).map(|(at, _)| at).find(begins) else { return Ok(None) };
            let Some((head, body)) = Head::split(&lower[at..], line)? else { return Ok(None) };
            let behind = plain_words(body).len();
            (!head.rows.is_empty()).then(|| (Which::Rows(head.rows), &words[words.len().saturating_sub(behind)..]))
        }
        _ => None,
    })
}

/// "twice more", "3 times", "a total of 3 times", "until 5 sts remain", "until there are 9 sts", "for 20 rows", "until 30 rows have been
/// worked".
fn often(words: &[&str]) -> Option<Often> {
    let times = |w: &str| match w {
        "once" => Some(1),
        "twice" => Some(2),
        "thrice" => Some(3),
        _ => None,
    };
    let until = words.iter().position(|w| is_until(w));
    let in_all =
        words.iter().any(|w| matches!(*w, "total" | "altogether")) || words.windows(2).any(|w| w == ["in", "all"]);
    let repeats = |n: u32| if in_all { Often::InAll(n) } else { Often::More(n) };
    for (i, word) in words.iter().enumerate() {
        if let Some(n) = times(word) {
            return Some(repeats(n));
        }
        let rest = &words[i + 1..];
        // "until row 30 has been worked"
        let is_start = i > 0 && words[i - 1] == "from";
        if let (true, [n, ..]) = (is_row(word) && !is_start, rest)
            && let Some(n) = number(n)
        {
            return Some(Often::Through(n as usize));
        }
        let n = number(word).or_else(|| number(word.trim_matches('x')));
        match (n, rest) {
            (Some(n), ["times" | "time", ..] | ["more" | "further", "times" | "time", ..]) => return Some(repeats(n)),
            (Some(n), ["rows" | "rnds" | "rounds", behind @ ..]) => {
                let whole = in_all || (until.is_some_and(|u| u < i) && !behind.contains(&"more"));
                return Some(if whole { Often::RowsInAll(n as usize) } else { Often::Rows(n as usize) });
            }
            (Some(n), ["more" | "further", "rows" | "rnds" | "rounds", ..]) => return Some(Often::Rows(n as usize)),
            (Some(n), ["st" | "sts" | "stitch" | "stitches", behind @ ..]) => {
                if let Some(often) = stitches(n, &words[..i], behind) {
                    return Some(often);
                }
            }
            (Some(n), []) if word.trim_matches('x').len() < word.len() => return Some(repeats(n)),
            _ => {}
        }
    }
    None
}

/// "Until 5 sts remain", "until there are 9 sts on the needle".
fn stitches(n: u32, before: &[&str], behind: &[&str]) -> Option<Often> {
    let remain = |w: &&str| matches!(*w, "rem" | "remain" | "remains" | "left" | "remaining");
    if behind.iter().take(3).any(remain) || before.last().is_some_and(|w| matches!(*w, "only" | "just" | "last")) {
        return Some(Often::Left(n));
    }
    let until = before.iter().any(|w| is_until(w) || *w == "to");
    let counts = |w: &&str| {
        matches!(
            *w,
            "are" | "on" | "in" | "the" | "your" | "needle" | "needles" | "total" | "all" | "altogether" | "each"
        )
    };
    (until && behind.iter().all(counts)).then_some(Often::Have(n))
}

/// The first length of a text, mm: "10 cm", "4.5in", "4 1/2 inches", "25 cm [10 in]".
fn measure(text: &str) -> Option<f64> {
    let lower = text.to_lowercase();
    let words: Vec<&str> =
        lower.split(|c: char| c.is_whitespace() || "()[],;:*".contains(c)).filter(|w| !w.is_empty()).collect();
    words.iter().enumerate().find_map(|(i, word)| {
        let digits = |c: char| c.is_ascii_digit() || "./\u{bc}\u{bd}\u{be}".contains(c);
        let (figure, behind) = word.split_at(word.find(|c| !digits(c)).unwrap_or(word.len()));
        let unit = if behind.is_empty() { words.get(i + 1)? } else { behind };
        // "Rows 1 and 2 in pattern"
        if unit == "in" && behind.is_empty() && !words[..i].iter().any(|w| is_of_length(w)) {
            return None;
        }
        let unit = match unit.trim_end_matches('.') {
            "mm" => 1.0,
            "cm" | "cms" | "centimetres" | "centimeters" => 10.0,
            "in" | "ins" | "inch" | "inches" | "\"" | "\u{201d}" => 25.4,
            _ => return None,
        };
        let own = amount(figure)?;
        // "4 1/2 in"
        let before = i.checked_sub(1).filter(|_| figure.contains('/')).and_then(|i| words[i].parse::<u32>().ok());
        Some((own + before.map_or(0.0, f64::from)) * unit).filter(|mm| mm.is_finite() && *mm > 0.0)
    })
}

/// Whether a length may come behind a word.
fn is_of_length(word: &str) -> bool {
    is_until(word)
        || matches!(word, "for" | "about" | "approx" | "approximately" | "another" | "is")
        || word.starts_with("measur")
}

/// "4", "4.5", "1/2", "4\u{bd}".
fn amount(figure: &str) -> Option<f64> {
    if let Some((above, below)) = figure.split_once('/') {
        return Some(above.parse::<f64>().ok()? / below.parse::<f64>().ok()?);
    }
    let part = |sign| match sign {
        '\u{bc}' => Some(0.25),
        '\u{bd}' => Some(0.5),
        '\u{be}' => Some(0.75),
        _ => None,
    };
    match figure.chars().next_back().and_then(part) {
        Some(part) => {
            let whole = figure.trim_end_matches(|c: char| !c.is_ascii());
            Some(part + if whole.is_empty() { 0.0 } else { whole.parse().ok()? })
        }
        None => figure.parse().ok(),
    }
}

/// The rows that "as row 1" or "repeat rows 1 and 2 twice" in the place of a row names.
pub(super) fn copied(body: &str, line: usize) -> Result<Option<Vec<usize>>> {
    let words = plain_words(body);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let rest = match &words[..] {
        ["same" | "work" | "knit", "as", "for", rest @ ..]
        | ["as", "for", rest @ ..]
        | ["same" | "work", "as", rest @ ..] => rest,
        ["as" | "repeat" | "rep" | "work", rest @ ..] => rest,
        _ => return Ok(None),
    };
    match which(rest, body, line)? {
        Some((Which::Rows(rows), _)) => Ok(Some(rows)),
        Some(_) => error(line, format!("\"{}\" does not number its rows", short(body)), "as in Row 3: as row 1"),
        None => Ok(None),
    }
}

/// A count of stitches at the end of a row, and the row without it: "(24 sts)", "- 24 sts".
pub(super) fn counted(body: &str) -> (&str, Option<u32>) {
    let body = body.trim().trim_end_matches('.').trim_end();
    let count = |text: &str| {
        let words = plain_words(text);
        match words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
            [n, "st" | "sts" | "stitch" | "stitches"]
            | [n, "st" | "sts" | "stitch" | "stitches", "rem" | "remain" | "remaining" | "left"] => n.parse().ok(),
            _ => None,
        }
    };
    let open = if body.ends_with(')') {
        body.rfind('(')
    } else if body.ends_with(']') {
        body.rfind('[')
    } else {
        None
    };
    let dash = body.char_indices().rfind(|(_, c)| matches!(c, '-' | '\u{2013}' | '\u{2014}' | '.' | '='));
    let dash = dash.map(|(at, c)| (at, at + c.len_utf8()));
    let place = open.map(|at| (at, at)).or(dash);
    if let Some((at, from)) = place
        && let Some(count) = count(&body[from..])
    {
        return (body[..at].trim_end().trim_end_matches(['.', ',', ';']), Some(count));
    }
    (body, None)
}

/// What is told where no row begins.
pub(super) fn no_row<T>(text: &str, line: usize) -> Result<T> {
    error(line, format!("expected \"Row 1: ...\", found \"{}\"", short(text)), KNOWN)
}
