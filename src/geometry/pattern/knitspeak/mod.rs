//! Written knitting instructions (KnitSpeak) as rows of a chart.
//!
//! `Row 1 (RS): k2, *p2, k2; rep from * to end.` is what patterns in books and on Stitch-Maps say. Rows on the wrong side
//! are worked from the other end and show the other face of each stitch; rounds are worked on the right side. Repeats to
//! the end depend on the stitches on the needle, so rows are counted from the cast-on on, and each becomes a row of a
//! chart over the whole width.

use std::{collections::BTreeMap, fmt};

/// Why instructions could not be followed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KnitSpeakError {
    /// Line of the text, from 0, if it is about one.
    pub line: Option<usize>,
    /// What is wrong.
    pub problem: String,
    /// What to do.
    pub hint: String,
}

impl fmt::Display for KnitSpeakError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}", self.problem, self.hint)
    }
}

impl std::error::Error for KnitSpeakError {}

type Result<T> = std::result::Result<T, KnitSpeakError>;

fn error<T>(line: usize, problem: impl Into<String>, hint: impl Into<String>) -> Result<T> {
    Err(KnitSpeakError { line: Some(line), problem: problem.into(), hint: hint.into() })
}

/// Most rows, and most stitches of one.
const MOST_ROWS: usize = 20_000;
const MOST_STITCHES: u32 = 20_000;
/// How deep repeats may lie in one another.
const MOST_NESTED: usize = 16;

const KNOWN: &str = "k, p, ktbl, ptbl, yo, k2tog, ssk, skp, p2tog, ssp, k3tog, sssk, sk2p, p3tog, cdd, kfb, m1l, m1r, sl1, \
                     sl1 wyif, tuck and cables such as c4f and 2/1 LC are known; write repeats as *...; rep from * to end, \
                     [...] 3 times";

/// The rows of a chart, from the cast-on edge up, each from left to right as seen from the right side.
///
/// # Errors
/// A word that is none, a row that does not fit the stitches it finds, rows that are missing or come twice.
pub fn chart_rows(text: &str, cast_on: u32) -> Result<Vec<String>> {
    let rows = written_rows(text)?;
    let mut found = cast_on;
    rows.iter()
        .enumerate()
        .map(|(i, row)| {
            let worked = row.body.work(found, row.line, i + 1)?;
            found = worked.iter().map(|s| s.makes * s.count).sum();
            if found == 0 || found > MOST_STITCHES {
                return error(row.line, format!("row {} makes {found} stitches", i + 1), "1 to 20000 fit on a needle");
            }
            row.side.seen_from_right(worked, row.line)
        })
        .collect()
}

/// Which side faces the knitter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Right,
    Wrong,
}

/// A row as it is written.
#[derive(Clone, Debug)]
struct Written {
    line: usize,
    side: Side,
    body: Sequence,
}

/// One or more of the same step.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Steps {
    name: String,
    takes: u32,
    makes: u32,
    count: u32,
}

#[derive(Clone, Debug)]
enum Item {
    Steps(Steps),
    /// A step until so many stitches are left.
    Until(Steps, u32),
    /// A sequence so many times.
    Times(Sequence, u32),
    /// A sequence until so many stitches are left.
    Repeat(Sequence, u32),
}

#[derive(Clone, Debug, Default)]
struct Sequence(Vec<Item>);

impl Sequence {
    fn work(&self, found: u32, line: usize, row: usize) -> Result<Vec<Steps>> {
        let mut out: Vec<Steps> = Vec::new();
        let mut left = found;
        self.follow(&mut left, &mut out, line, row)?;
        if left > 0 {
            let problem = format!("row {row} leaves {left} of {found} stitches unworked");
            return error(line, problem, "rep from * to end, or another number of `stitches`");
        }
        Ok(out)
    }

    fn takes(&self) -> u32 {
        let of = |item: &Item| match item {
            Item::Steps(steps) => steps.takes.saturating_mul(steps.count),
            Item::Times(sequence, times) => sequence.takes().saturating_mul(*times),
            Item::Until(..) | Item::Repeat(..) => 0,
        };
        self.0.iter().map(of).fold(0, u32::saturating_add)
    }

    fn follow(&self, left: &mut u32, out: &mut Vec<Steps>, line: usize, row: usize) -> Result<()> {
        for item in &self.0 {
            match item {
                Item::Steps(steps) => {
                    let takes = steps.takes.saturating_mul(steps.count);
                    if takes > *left {
                        let problem = format!("row {row} needs {takes} stitches for {}, {left} are left", steps.name);
                        return error(line, problem, "another number of `stitches` fits");
                    }
                    *left -= takes;
                    push(out, steps.clone());
                }
                Item::Until(steps, last) => {
                    let room = left.saturating_sub(*last);
                    if steps.takes == 0 || !room.is_multiple_of(steps.takes) {
                        return error(line, format!("row {row}: {} does not fit {room} stitches", steps.name), KNOWN);
                    }
                    push(out, Steps { count: room / steps.takes, ..steps.clone() });
                    *left -= room;
                }
                Item::Times(sequence, times) => {
                    for _ in 0..*times {
                        sequence.follow(left, out, line, row)?;
                    }
                }
                Item::Repeat(sequence, last) => {
                    let takes = sequence.takes();
                    let room = left.saturating_sub(*last);
                    if takes == 0 || room == 0 || !room.is_multiple_of(takes) {
                        let rest = room.checked_rem(takes).unwrap_or(0);
                        let problem = format!("row {row} repeats over {takes} stitches, but has {room} for it");
                        return error(line, problem, format!("{rest} fewer `stitches`, or {} more, fit", takes - rest));
                    }
                    for _ in 0..room / takes {
                        sequence.follow(left, out, line, row)?;
                    }
                }
            }
            if out.len() > MOST_STITCHES as usize {
                return error(line, format!("row {row} has more than {MOST_STITCHES} steps"), "fewer repeats");
            }
        }
        Ok(())
    }
}

fn push(out: &mut Vec<Steps>, steps: Steps) {
    match out.last_mut() {
        Some(last) if last.name == steps.name => last.count += steps.count,
        _ if steps.count > 0 => out.push(steps),
        _ => {}
    }
}

impl Side {
    /// The steps of a worked row as a row of a chart.
    fn seen_from_right(self, mut worked: Vec<Steps>, line: usize) -> Result<String> {
        match self {
            // Rows on the right side run from right to left.
            Self::Right => worked.reverse(),
            Self::Wrong => {
                for steps in &mut worked {
                    let Some(name) = other_face(&steps.name) else {
                        let problem = format!("{} on the wrong side has no stitch that shows it", steps.name);
                        return error(line, problem, "work it on a right-side row");
                    };
                    steps.name = name.to_owned();
                }
            }
        }
        let words = worked.iter().map(|s| match (s.name.as_str(), s.count) {
            (name, 1) => name.to_owned(),
            ("k" | "p", n) => format!("{}{n}", s.name),
            (name, n) => vec![name; n as usize].join(" "),
        });
        Ok(words.collect::<Vec<String>>().join(" "))
    }
}

/// What a step on the wrong side looks like from the right side.
fn other_face(name: &str) -> Option<&'static str> {
    const FACES: [(&str, &str); 9] = [
        ("k", "p"),
        ("ktbl", "ptbl"),
        ("k2tog", "p2tog"),
        ("ssk", "ssp"),
        ("k3tog", "p3tog"),
        ("yo", "yo"),
        // The yarn in front of the knitter is behind the cloth.
        ("sl", "slwyif"),
        ("tuck", "tuck"),
        ("miss", "miss"),
    ];
    FACES.iter().find_map(|&(a, b)| {
        if name == a {
            Some(b)
        } else if name == b {
            Some(a)
        } else {
            None
        }
    })
}

/// All rows of the text in order.
fn written_rows(text: &str) -> Result<Vec<Written>> {
    let mut rows: BTreeMap<usize, Written> = BTreeMap::new();
    // Rows that are told to be like all others of a side, by parity.
    let mut fill: Vec<(usize, Written)> = Vec::new();
    let mut first_side = Side::Right;
    let mut round = false;
    for (line, written) in text.lines().enumerate() {
        let written = written.trim().trim_end_matches('.');
        if written.is_empty() || written.starts_with(['#', ';']) || starts_with(written, "cast on") {
            continue;
        }
        let Some((head, body)) = written.split_once(':') else {
            return error(line, format!("expected \"Row 1: ...\", found \"{}\"", short(written)), KNOWN);
        };
        let head = Head::read(head, line)?;
        round |= head.round;
        if let (Some(side), Some(&first)) = (head.side, head.rows.first()) {
            first_side = if (first % 2 == 1) == (side == Side::Right) { Side::Right } else { Side::Wrong };
        }
        if let Some(copied) = copied_rows(body, line)? {
            let pick = |k: usize| rows.get(&copied[k % copied.len()]).cloned();
            let copies: Vec<Option<Written>> = (0..head.rows.len()).map(pick).collect();
            for (&row, copy) in head.rows.iter().zip(copies) {
                let Some(copy) = copy else {
                    return error(line, format!("row {row} repeats a row that is not written before it"), KNOWN);
                };
                insert(&mut rows, row, Written { line, ..copy })?;
            }
            continue;
        }
        let body = parse_body(body, line)?;
        for &row in &head.rows {
            insert(&mut rows, row, Written { line, side: Side::Right, body: body.clone() })?;
        }
        if let (true, Some(&row)) = (head.and_all_like_it, head.rows.first()) {
            fill.push((row, Written { line, side: Side::Right, body }));
        }
    }
    let last = rows.keys().next_back().copied().unwrap_or(0);
    for (start, written) in fill {
        // One more, so that the last row of the repeat has its partner.
        for row in (start..=last + 1).step_by(2) {
            rows.entry(row).or_insert_with(|| written.clone());
        }
    }
    let last = rows.keys().next_back().copied().unwrap_or(0);
    if last == 0 {
        return Err(KnitSpeakError { line: None, problem: "no row is written".into(), hint: KNOWN.into() });
    }
    let mut out = Vec::with_capacity(last);
    for number in 1..=last {
        let Some(mut row) = rows.remove(&number) else {
            let problem = format!("row {number} is missing");
            return Err(KnitSpeakError { line: None, problem, hint: format!("rows 1 to {last} are expected") });
        };
        let odd = number % 2 == 1;
        row.side = if round || odd == (first_side == Side::Right) { Side::Right } else { Side::Wrong };
        out.push(row);
    }
    Ok(out)
}

fn insert(rows: &mut BTreeMap<usize, Written>, number: usize, row: Written) -> Result<()> {
    if number == 0 || number > MOST_ROWS {
        return error(row.line, format!("row {number} is not one of 1 to {MOST_ROWS}"), KNOWN);
    }
    let line = row.line;
    match rows.insert(number, row) {
        None => Ok(()),
        Some(_) => error(line, format!("row {number} is written twice"), KNOWN),
    }
}

/// What stands before the colon.
struct Head {
    rows: Vec<usize>,
    side: Option<Side>,
    round: bool,
    /// "Row 2 and all WS rows"
    and_all_like_it: bool,
}

impl Head {
    fn read(text: &str, line: usize) -> Result<Self> {
        let lower = text.to_lowercase();
        let side = match (lower.contains("(rs)"), lower.contains("(ws)")) {
            (true, false) => Some(Side::Right),
            (false, true) => Some(Side::Wrong),
            _ => None,
        };
        let round = starts_with(&lower, "rnd") || starts_with(&lower, "round");
        let and_all_like_it = ["all ws", "all rs", "all even", "all odd", "every alt", "all foll", "all other"]
            .iter()
            .any(|words| lower.contains(words));
        let known = round || starts_with(&lower, "row");
        let numbers = lower.split("all").next().unwrap_or_default();
        let mut rows = Vec::new();
        let digits = |t: &str| t.chars().filter(char::is_ascii_digit).collect::<String>().parse::<usize>().ok();
        for part in numbers.split([',', '&']).flat_map(|p| p.split(" and ")) {
            let ends: Vec<usize> = part.split(['-', '\u{2013}']).filter_map(digits).collect();
            match ends[..] {
                [] => {}
                [row] => rows.push(row),
                [first, last] if first <= last && last - first < MOST_ROWS => rows.extend(first..=last),
                _ => return error(line, format!("\"{}\" is no range of rows", short(part.trim())), "as in Rows 1-4:"),
            }
        }
        if !known || rows.is_empty() {
            return error(line, format!("expected \"Row 1:\" or \"Rnd 1:\", found \"{}:\"", short(text)), KNOWN);
        }
        Ok(Self { rows, side, round, and_all_like_it })
    }
}

/// The rows that "Repeat rows 1 and 2" names.
fn copied_rows(body: &str, line: usize) -> Result<Option<Vec<usize>>> {
    let lower = body.trim().to_lowercase();
    let rest = ["repeat row", "rep row", "work as row", "as row", "repeat rnd", "repeat round", "rep rnd"]
        .iter()
        .find_map(|start| lower.strip_prefix(start));
    let Some(rest) = rest else { return Ok(None) };
    Head::read(&format!("row {}", rest.trim_start_matches('s')), line).map(|head| Some(head.rows))
}

/// Words, brackets and signs of a row.
fn tokens(text: &str) -> Vec<String> {
    let spaced: String = text
        .to_lowercase()
        .chars()
        .map(|c| match c {
            '*' | '[' | ']' | '(' | ')' | ',' | ';' => format!(" {c} "),
            '.' => " ".to_owned(),
            c => c.to_string(),
        })
        .collect();
    spaced.split_whitespace().map(str::to_owned).collect()
}

fn parse_body(text: &str, line: usize) -> Result<Sequence> {
    let tokens = tokens(text);
    let mut parser = Parser { tokens: &tokens, at: 0, line };
    let sequence = parser.sequence(0)?;
    match parser.peek(0) {
        None if sequence.0.is_empty() => error(line, "a row without stitches", KNOWN),
        None => Ok(sequence),
        Some(token) => error(line, format!("\"{}\" closes nothing", short(token)), KNOWN),
    }
}

struct Parser<'a> {
    tokens: &'a [String],
    at: usize,
    line: usize,
}

impl Parser<'_> {
    fn peek(&self, ahead: usize) -> Option<&str> {
        self.tokens.get(self.at + ahead).map(String::as_str)
    }

    /// Takes the next words if they are these.
    fn take(&mut self, words: &[&str]) -> bool {
        let found = words.iter().enumerate().all(|(i, word)| self.peek(i) == Some(word));
        if found {
            self.at += words.len();
        }
        found
    }

    fn separators(&mut self) {
        while matches!(self.peek(0), Some("," | ";" | "and" | "then")) {
            self.at += 1;
        }
    }

    fn sequence(&mut self, depth: usize) -> Result<Sequence> {
        if depth > MOST_NESTED {
            return error(self.line, format!("repeats lie more than {MOST_NESTED} deep"), KNOWN);
        }
        let mut out = Sequence::default();
        let (mut star, mut closed) = (None, false);
        loop {
            self.separators();
            match self.peek(0) {
                None | Some("]" | ")") => break,
                Some("*") => {
                    self.at += 1;
                    // "*k1, p1* repeat to end": the second star ends what the first one begins.
                    closed = star.is_some() && matches!(self.peek(0), Some("rep" | "repeat"));
                    if !closed {
                        star = Some(out.0.len());
                    }
                }
                Some("rep" | "repeat") => {
                    self.at += 1;
                    let Some(start) = star.take() else {
                        return error(self.line, "a repeat without a * where it begins", KNOWN);
                    };
                    if !self.take(&["from", "*"]) && !closed {
                        return error(self.line, "expected \"rep from *\"", KNOWN);
                    }
                    let body = Sequence(out.0.split_off(start));
                    let _ = self.take(&["across"]) || self.take(&["around"]);
                    let again = match self.until()? {
                        Some(last) => Item::Repeat(body, last),
                        // Once as written, and so many times more.
                        None => match self.times()? {
                            Some(times) => Item::Times(body, times + 1),
                            None => Item::Repeat(body, 0),
                        },
                    };
                    out.0.push(again);
                }
                Some(open @ ("[" | "(")) => {
                    let close = if open == "[" { "]" } else { ")" };
                    self.at += 1;
                    let body = self.sequence(depth + 1)?;
                    if !self.take(&[close]) {
                        return error(self.line, format!("a bracket is not closed by {close}"), KNOWN);
                    }
                    let item = match self.until()? {
                        Some(last) => Item::Repeat(body, last),
                        None => Item::Times(body, self.times()?.unwrap_or(1)),
                    };
                    out.0.push(item);
                }
                Some(_) => {
                    let item = self.step()?;
                    out.0.push(item);
                }
            }
        }
        Ok(out)
    }

    /// "to end", "to last 3 sts": how many stitches are left then.
    fn until(&mut self) -> Result<Option<u32>> {
        if self.take(&["across"]) || self.take(&["around"]) || self.take(&["all", "sts"]) {
            return Ok(Some(0));
        }
        if !matches!(self.peek(0), Some("to" | "until")) {
            return Ok(None);
        }
        self.at += 1;
        self.take(&["the"]);
        if self.take(&["end"]) {
            let _ = self.take(&["of", "row"]) || self.take(&["of", "rnd"]) || self.take(&["of", "round"]);
            return Ok(Some(0));
        }
        if self.take(&["last"]) {
            let count = self.peek(0).and_then(|t| t.parse::<u32>().ok());
            self.at += usize::from(count.is_some());
            let _ = self.take(&["sts"]) || self.take(&["st"]) || self.take(&["stitches"]) || self.take(&["stitch"]);
            return Ok(Some(count.unwrap_or(1)));
        }
        error(self.line, "expected \"to end\" or \"to last 3 sts\"", KNOWN)
    }

    /// "3 times", "twice", "once more", "4 more times".
    fn times(&mut self) -> Result<Option<u32>> {
        let count = match self.peek(0) {
            Some("once") => 1,
            Some("twice") => 2,
            Some("thrice") => 3,
            Some(word) => {
                let Ok(count) = word.trim_end_matches('x').parse::<u32>() else { return Ok(None) };
                if !word.ends_with('x') && !matches!(self.peek(1), Some("times" | "time" | "more")) {
                    return Ok(None);
                }
                count
            }
            None => return Ok(None),
        };
        if count > MOST_STITCHES {
            return error(self.line, format!("{count} times are too many"), KNOWN);
        }
        self.at += 1;
        while matches!(self.peek(0), Some("times" | "time" | "more")) {
            self.at += 1;
        }
        Ok(Some(count))
    }

    fn step(&mut self) -> Result<Item> {
        let word = self.peek(0).unwrap_or_default().to_owned();
        self.at += 1;
        let Some(mut steps) = step(&word) else {
            return error(self.line, format!("\"{}\" is no stitch that is known here", short(&word)), KNOWN);
        };
        if steps.name == "cable" {
            return self.cable(&word);
        }
        if matches!(self.peek(0), Some("tbl")) && matches!(steps.name.as_str(), "k" | "p") {
            self.at += 1;
            steps.name.push_str("tbl");
        }
        if steps.name == "sl" {
            // "sl 1, k2tog, psso" is one decrease.
            let counted = self.take(&["1"]);
            for (passed, name) in [("k1", "skp"), ("k2tog", "sk2p")] {
                if self.take(&[",", passed, ",", "psso"]) || self.take(&[passed, "psso"]) {
                    return Ok(Item::Steps(step(name).expect("a stitch that is known")));
                }
            }
            if !counted
                && let Some(count) =
                    self.peek(0).and_then(|n| n.parse().ok()).filter(|n| (1..=MOST_STITCHES).contains(n))
            {
                self.at += 1;
                steps.count = count;
            }
            let _ = self.take(&["st"]) || self.take(&["sts"]) || self.take(&["purlwise"]) || self.take(&["pwise"]);
            if self.take(&["wyif"]) {
                steps.name = "slwyif".into();
            } else {
                self.take(&["wyib"]);
            }
        }
        Ok(match self.until()? {
            Some(last) => Item::Until(Steps { count: 1, ..steps }, last),
            // "Row 2: Purl."
            None if matches!(word.as_str(), "knit" | "purl") => Item::Until(steps, 0),
            None => Item::Steps(steps),
        })
    }

    /// "2/1 LC", "2/2 rpc".
    fn cable(&mut self, word: &str) -> Result<Item> {
        let kind = self.peek(0).unwrap_or_default().to_owned();
        self.at += 1;
        let counts: Vec<u32> = word.split('/').filter_map(|n| n.parse().ok()).collect();
        let &[front, back] = &counts[..] else { return error(self.line, format!("\"{word}\" is no cable"), KNOWN) };
        if !matches!(kind.as_str(), "lc" | "rc" | "lpc" | "rpc") || front == 0 || back == 0 || front + back > 24 {
            return error(self.line, format!("\"{word} {}\" is no cable", short(&kind)), "as in 2/1 LC, 2/2 RPC");
        }
        let both = front + back;
        Ok(Item::Steps(Steps { name: format!("{word}{kind}"), takes: both, makes: both, count: 1 }))
    }
}

/// A step by its word: its name in charts, and what it takes and makes.
fn step(word: &str) -> Option<Steps> {
    let one = |name: &str, takes, makes| Some(Steps { name: name.into(), takes, makes, count: 1 });
    match word {
        "knit" => return one("k", 1, 1),
        "purl" => return one("p", 1, 1),
        "ktbl" | "k1tbl" | "k1-tbl" => return one("ktbl", 1, 1),
        "ptbl" | "p1tbl" | "p1-tbl" => return one("ptbl", 1, 1),
        "yo" | "yfwd" | "yon" | "yrn" => return one("yo", 0, 1),
        "k2tog" => return one("k2tog", 2, 1),
        "ssk" | "skp" | "skpo" => return one("ssk", 2, 1),
        "p2tog" => return one("p2tog", 2, 1),
        "ssp" => return one("ssp", 2, 1),
        "k3tog" => return one("k3tog", 3, 1),
        "sssk" | "sk2p" | "sk2po" => return one("sssk", 3, 1),
        "p3tog" => return one("p3tog", 3, 1),
        "cdd" | "s2kp" | "s2kp2" => return one("cdd", 3, 1),
        "kfb" | "k1fb" => return one("kfb", 1, 2),
        "m1" | "m1l" => return one("m1l", 0, 1),
        "m1r" => return one("m1r", 0, 1),
        "tuck" => return one("tuck", 1, 1),
        "miss" => return one("miss", 1, 1),
        "slwyif" => return one("slwyif", 1, 1),
        _ => {}
    }
    if word.contains('/') {
        return one("cable", 0, 0);
    }
    // c4f, c6b, t3f: so many stitches cross.
    if let Some(rest) = word.strip_prefix(['c', 't'])
        && let Some(count) = rest.strip_suffix(['f', 'b'])
    {
        let count = count.parse::<u32>().ok().filter(|n| (2..=24).contains(n))?;
        return one(word, count, count);
    }
    let digits = word.find(|c: char| c.is_ascii_digit());
    let (name, count) = match digits {
        Some(i) => (&word[..i], word[i..].parse::<u32>().ok().filter(|n| (1..=MOST_STITCHES).contains(n))?),
        None => (word, 1),
    };
    match name {
        "k" | "p" | "sl" => Some(Steps { name: name.into(), takes: 1, makes: 1, count }),
        _ => None,
    }
}

fn starts_with(text: &str, words: &str) -> bool {
    text.get(..words.len()).is_some_and(|start| start.eq_ignore_ascii_case(words))
}

/// A piece of the text for a message.
fn short(text: &str) -> String {
    text.chars().take(30).collect::<String>().escape_debug().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str, stitches: u32) -> Vec<String> {
        chart_rows(text, stitches).unwrap()
    }

    #[test]
    fn flat_rows_turn_at_the_edge() {
        // Two rows of rib: what is knitted on one side is purled on the other, over the same stitches.
        let rib = "Row 1 (RS): k2, *p2, k2; rep from * to end.\nRow 2 (WS): p2, *k2, p2; rep from * to end.";
        assert_eq!(rows(rib, 10), ["k2 p2 k2 p2 k2"; 2]);
        // A row of one side only shows where the row begins.
        assert_eq!(rows("Row 1: k3, p1\nRow 2: k1, p3", 4), ["p k3", "p k3"]);
    }

    #[test]
    fn rounds_are_all_on_the_right_side() {
        assert_eq!(rows("Rnd 1: *k1, p1; rep from * to end\nRnd 2: knit", 4), ["p k p k", "k4"]);
        assert_eq!(rows("Rnd 1: *k1, p1; repeat from * around.", 4), ["p k p k"]);
        assert_eq!(rows("Row 1: *k1, p1* repeat to end", 4), ["p k p k"]);
        let decreases = "Row 1: sl 1, k2tog, psso, sl 1, k1, psso, k to end\nRow 2: purl\nRow 3: sl 2, k to end";
        assert_eq!(rows(decreases, 7), ["k2 ssk sssk", "k4", "k2 sl sl"]);
    }

    #[test]
    fn lace_keeps_its_count() {
        let lace = "Cast on 14 sts.\nRow 1 (RS): k2, *yo, ssk, k1, k2tog, yo; rep from * to last 2 sts, k2.\n\
                    Row 2 and all WS rows: Purl.\nRow 3: k2, [yo, k1, sk2p, k1, yo] twice, k2.";
        assert_eq!(
            rows(lace, 14),
            ["k2 yo k2tog k ssk yo yo k2tog k ssk yo k2", "k14", "k2 yo k sssk k yo yo k sssk k yo k2", "k14"]
        );
    }

    #[test]
    fn charts_know_every_stitch_that_is_understood() {
        let all = "Row 1: k1, p1, k1 tbl, p1 tbl, yo, k2tog, ssk, p2tog, ssp, k3tog, sssk, p3tog, cdd, kfb, m1l, m1r, sl1, \
                   sl1 wyif, tuck, miss, c4f, c4b, t3f, t3b, 2/1 LC, 2/1 RPC\nRow 2: k to last 2 sts, p2, yo";
        let rows = rows(all, 49);
        let chart = crate::geometry::pattern::chart::Chart::parse(&rows).unwrap();
        assert_eq!(chart.work(49, 2, 1 << 20).unwrap().len(), 2);
    }

    #[test]
    fn repeats_and_ranges() {
        assert_eq!(rows("Rows 1-2: k\nRows 3 and 4: Repeat rows 1-2", 1), ["k", "p", "k", "p"]);
        assert_eq!(rows("Row 1: *k1, p1; rep from * 2 more times, k to end", 8), ["k2 p k p k p k"]);
        assert_eq!(rows("Row 1: (k1, [p1, k1] 2 times) 2x", 10), ["k p k p k2 p k p k"]);
        assert_eq!(rows("Row 1: sl1 wyif, k to last 2 sts, k1 tbl, sl1 wyib", 6), ["sl ktbl k3 slwyif"]);
        assert_eq!(rows("Row 1: 2/1 LC, c4f, k1", 8), ["k c4f 2/1lc"]);
    }

    #[test]
    fn mistakes_are_named() {
        let wrong = |text: &str, stitches| chart_rows(text, stitches).unwrap_err();
        assert!(wrong("Row 1: k2, zork", 4).problem.contains("zork"));
        assert!(wrong("Row 1: k2", 4).problem.contains("leaves 2 of 4"));
        assert!(wrong("Row 1: *k3; rep from * to end", 8).to_string().contains("2 fewer"));
        assert!(wrong("Row 1: k6", 4).problem.contains("needs 6"));
        assert!(wrong("Row 1: k\nRow 3: k", 1).problem.contains("row 2 is missing"));
        assert!(wrong("Row 1: k\nRow 1: k", 1).problem.contains("twice"));
        assert!(wrong("Row 1: [k1, p1", 2).problem.contains("not closed"));
        assert!(wrong("Row 1: k1] ", 1).problem.contains("closes nothing"));
        assert!(wrong("k2, p2", 4).line == Some(0));
        assert!(wrong("", 4).problem.contains("no row"));
        let deep = format!("Row 1: {}k1", "[".repeat(100));
        assert!(wrong(&deep, 1).problem.contains("deep"));
    }
}
