//! The words of a row: steps, repeats and brackets.

use super::{
    Item, KNOWN, MOST_NESTED, MOST_ROWS, MOST_STITCHES, Result, Sequence, Steps,
    lines::number,
    parser::Parser,
    short,
    step::{self, Phrase},
    turns::Stop,
};

/// Words, brackets and signs of a row.
fn tokens(text: &str) -> Vec<String> {
    let mut spaced = String::with_capacity(2 * text.len());
    for c in text.to_lowercase().chars() {
        match c {
            '*' | '[' | ']' | '(' | ')' | '{' | '}' | ',' | ';' | ':' => spaced.extend([' ', c, ' ']),
            '.' => spaced.push_str(" , "),
            '\u{d7}' => spaced.push('x'),
            c => spaced.push(c),
        }
    }
    let mut out = Vec::new();
    for word in spaced.split_whitespace() {
        // "k2tog-tbl", "p-wise"; a dash by itself parts.
        match word.replace(['-', '\u{2013}', '\u{2014}'], "") {
            joined if joined.is_empty() => out.push(",".to_owned()),
            joined => run_together(joined, &mut out),
        }
    }
    out
}

/// "k2p2" is two words.
fn run_together(word: String, out: &mut Vec<String>) {
    let mut parts: Vec<&str> = Vec::new();
    let mut from = 0;
    let bytes = word.as_bytes();
    for at in 1..bytes.len() {
        if bytes[at - 1].is_ascii_digit() && matches!(bytes[at], b'k' | b'p') {
            parts.push(&word[from..at]);
            from = at;
        }
    }
    parts.push(&word[from..]);
    let plain =
        |part: &&str| part.starts_with(['k', 'p']) && part.len() > 1 && part[1..].bytes().all(|b| b.is_ascii_digit());
    if parts.len() > 1 && parts.iter().all(plain) {
        out.extend(parts.into_iter().map(str::to_owned));
    } else {
        out.push(word);
    }
}

/// The steps of a row of a number, from 1.
pub(super) fn parse_body(text: &str, line: usize, row: usize) -> Result<Sequence> {
    let tokens = tokens(text);
    let mut parser = Parser { tokens: &tokens, at: 0, line, row };
    let mut sequence = parser.sequence(0)?;
    if let Some(token) = parser.peek(0) {
        return parser.wrong(&format!("\"{}\" closes nothing", short(token)), KNOWN);
    }
    // "Row 2: P.", "Row 2: P, picking up wraps."
    let stitches = |item: &&mut Item| !matches!(item, Item::PickUp { .. });
    let [first, second] = [0, 1].map(|k| tokens.get(k).map(String::as_str));
    if matches!((first, second), (Some("k" | "p"), None | Some(",")))
        && sequence.0.iter_mut().filter(stitches).count() == 1
        && let Some(item) = sequence.0.iter_mut().find(stitches)
        && let Item::Steps(steps) = item
    {
        *item = Item::Until(steps.clone(), Stop::Left(0));
    }
    if sequence.0.is_empty() {
        return parser.wrong("has no stitches", KNOWN);
    }
    let sequence = unrolled(sequence);
    if sequence.0.is_empty() {
        return parser.wrong("has no stitches", KNOWN);
    }
    let slides = |item: &Item| matches!(item, Item::Slide);
    if sequence.any(slides) && sequence.0.iter().position(slides) != Some(sequence.0.len() - 1) {
        return parser.wrong("slides before its end", "a row is worked to its end, and then slid: k to end, slide");
    }
    let is_inside = |item: &Item| matches!(item, Item::Times(body, _) | Item::Repeat(body, _) if body.turns());
    match sequence.0.len() > MOST_ROWS || sequence.0.iter().any(is_inside) {
        true => parser.wrong(
            "turns within a repeat",
            "say how often: [k5, turn, p5, turn] 3 times; or write a row for each turn",
        ),
        false => Ok(sequence),
    }
}

/// Repeats that turn, written out: rows end where they turn.
fn unrolled(sequence: Sequence) -> Sequence {
    let mut out = Vec::with_capacity(sequence.0.len());
    for item in sequence.0 {
        match item {
            Item::Times(body, times) if body.turns() => {
                let body = unrolled(body);
                if body.0.len().saturating_mul(times as usize) <= MOST_ROWS {
                    (0..times).for_each(|_| out.extend(body.0.iter().cloned()));
                } else {
                    out.push(Item::Times(body, times));
                }
            }
            item => out.push(item),
        }
    }
    Sequence(out)
}

/// Where a repeat begins, by the items before it.
#[derive(Default)]
struct Star {
    from: Option<usize>,
    /// Where the second star of a pair stands.
    closed: Option<usize>,
}

impl Parser<'_> {
    fn separators(&mut self) {
        while matches!(self.peek(0), Some("," | ";" | ":" | "and" | "then" | "&")) {
            self.at += 1;
        }
    }

    fn sequence(&mut self, depth: usize) -> Result<Sequence> {
        if depth > MOST_NESTED {
            return self.wrong(&format!("repeats lie more than {MOST_NESTED} deep"), KNOWN);
        }
        let mut out = Sequence::default();
        let mut star = Star::default();
        // A repeat that goes on until what ends the row, and how many items are before that.
        let mut ending: Option<(usize, usize)> = None;
        loop {
            self.separators();
            match self.peek(0) {
                None | Some("]" | ")" | "}") => break,
                Some("*") => {
                    self.at += 1;
                    if star.from.is_some() && star.closed.is_none() {
                        // "*k1, p1*, repeat to end": the second star ends what the first one begins.
                        star.closed = Some(out.0.len());
                        // "*k1, p1* to end"
                        if let Some(item) = self.paired(&star, &out)? {
                            out.0.truncate(star.from.unwrap_or_default());
                            out.0.push(item);
                            star = Star::default();
                        }
                    } else {
                        star = Star { from: Some(out.0.len()), closed: None };
                    }
                }
                Some("rep" | "repeat") => {
                    self.at += 1;
                    let item = self.again(&mut star, &mut out)?;
                    out.0.push(item);
                    if self.is_ending() {
                        ending = Some((out.0.len() - 1, out.0.len()));
                    }
                }
                Some(open @ ("[" | "(" | "{")) => {
                    let close = match open {
                        "[" => "]",
                        "(" => ")",
                        _ => "}",
                    };
                    self.at += 1;
                    let body = self.sequence(depth + 1)?;
                    if !self.take(&[close]) {
                        return self.wrong(&format!("a bracket is not closed by {close}"), KNOWN);
                    }
                    let item = match self.until()? {
                        Some(last) => Item::Repeat(body, last),
                        None => match self.times()? {
                            Some(times) => Item::Times(body, times),
                            None => Item::Times(body, 1),
                        },
                    };
                    out.0.push(item);
                }
                Some(_) => {
                    let item = self.step()?;
                    out.0.extend(item);
                }
            }
        }
        if let Some((repeat, from)) = ending {
            let rest = Sequence(out.0.split_off(from));
            if let Some(Item::Repeat(_, last)) = out.0.get_mut(repeat) {
                *last = Stop::Left(rest.takes());
            }
            out.0.extend(rest.0);
        }
        Ok(out)
    }

    /// What stands between two stars, where it is told how far or how often behind them.
    fn paired(&mut self, star: &Star, out: &Sequence) -> Result<Option<Item>> {
        let body = || Sequence(out.0[star.from.unwrap_or_default()..].to_vec());
        if let Some(last) = self.until()? {
            return Ok(Some(Item::Repeat(body(), last)));
        }
        Ok(self.times()?.map(|times| Item::Times(body(), times)))
    }

    /// "End P1, K4" behind a repeat.
    fn is_ending(&mut self) -> bool {
        let at = self.at;
        self.separators();
        if self.take_any(&[&["ending", "last", "rep"], &["end", "last", "rep"], &["ending"], &["end"]]) {
            self.take(&["with"]);
            return true;
        }
        self.at = at;
        false
    }

    /// What "rep from * to end" repeats, behind its first word.
    fn again(&mut self, star: &mut Star, out: &mut Sequence) -> Result<Item> {
        let named = self.take_any(&[
            &["from", "*", "to", "*"],
            &["from", "*"],
            &["between", "*", "and", "*"],
            &["between", "*s"],
            &["between", "*"],
            &["*", "to", "*"],
            &["*"],
        ]);
        // "between *s"
        if named {
            self.take(&["s"]);
        }
        let Star { from, closed } = std::mem::take(star);
        let body = match (from, closed) {
            (Some(from), Some(to)) if named || to == out.0.len() => Sequence(out.0[from..to].to_vec()),
            (Some(from), _) if named => Sequence(out.0[from..].to_vec()),
            (Some(_), _) => return self.wrong("expected \"rep from *\"", KNOWN),
            (None, _) => match out.0.pop() {
                // "[k1, p1] rep to end"
                Some(Item::Times(body, 1)) if !named => {
                    return Ok(match (self.until()?, self.times()?) {
                        (Some(last), _) => Item::Repeat(body, last),
                        // "(k1, p1) rep 3 times"
                        (None, Some(times)) => Item::Times(body, times),
                        (None, None) => Item::Repeat(body, Stop::Left(0)),
                    });
                }
                _ => return self.wrong("a repeat without a * where it begins", KNOWN),
            },
        };
        // What stands between the second star and here was worked once, and is not repeated.
        let from = from.unwrap_or_default();
        let apart = closed.is_some_and(|to| to < out.0.len());
        if !apart {
            out.0.truncate(from);
        }
        self.take(&[","]);
        Ok(match self.until()? {
            Some(last) => Item::Repeat(body, last),
            // Once as written, and so many times more.
            None => match self.times()? {
                Some(times) => Item::Times(body, times + u32::from(!apart)),
                None => Item::Repeat(body, Stop::Left(0)),
            },
        })
    }

    /// "to end", "to last 3 sts", "until 3 sts remain", "to wrapped st".
    pub(super) fn until(&mut self) -> Result<Option<Stop>> {
        let across = self.take_any(&[&["across", "row"], &["across"], &["around"]]).then_some(Stop::Left(0));
        Ok(self.until_said()?.or(across))
    }

    fn until_said(&mut self) -> Result<Option<Stop>> {
        if self.take_any(&[&["all", "sts"], &["all", "stitches"], &["every", "st"], &["each", "st"]]) {
            self.take_any(&[&["across"], &["to", "end"]]);
            return Ok(Some(Stop::Left(0)));
        }
        // "k2, p2 to end" is of the purls only.
        if !matches!(self.peek(0), Some("to" | "until")) {
            return Ok(None);
        }
        self.at += 1;
        self.take(&["the"]);
        if self.take(&["end"]) {
            self.take(&["of"]);
            self.take(&["the"]);
            self.take_any(&[&["row"], &["rnd"], &["round"]]);
            return Ok(Some(Stop::Left(0)));
        }
        if let Some(stop) = self.mark() {
            return Ok(Some(stop));
        }
        if self.take(&["last"]) {
            let count = self.number(0);
            self.at += usize::from(count.is_some());
            self.stitches();
            return Ok(Some(Stop::Left(count.unwrap_or(1))));
        }
        if let Some(count) = self.number(0)
            && matches!(self.peek(1), Some("st" | "sts" | "stitches" | "stitch"))
        {
            self.at += 2;
            let left = self.take_any(&[
                &["before", "the", "end"],
                &["before", "end"],
                &["from", "the", "end"],
                &["from", "end"],
                &["remain"],
                &["remains"],
                &["rem"],
                &["are", "left"],
                &["left"],
            ]);
            if left {
                return Ok(Some(Stop::Left(count)));
            }
        }
        if matches!(self.peek(0), Some("m" | "marker" | "pm" | "mkr")) {
            return self.wrong("markers are not counted", "say how many stitches: k5, or k to last 5 sts");
        }
        let named = self.peek(0).map(short).unwrap_or_default();
        self.wrong(&format!("expected \"to end\", \"to last 3 sts\" or \"to wrapped st\", found \"{named}\""), KNOWN)
    }

    /// "3 times", "twice", "once more", "4 more times", "x 6".
    pub(super) fn times(&mut self) -> Result<Option<u32>> {
        let (count, words) = match (self.peek(0), self.peek(1)) {
            (Some("once"), _) => (1, 1),
            (Some("twice"), _) => (2, 1),
            (Some("thrice"), _) => (3, 1),
            (Some("x"), Some(_)) if self.number(1).is_some() => (self.number(1).unwrap_or(1), 2),
            (Some(word), Some("x")) if number(word).is_some() => (number(word).unwrap_or(1), 2),
            (Some(word), next) => {
                // "six" is none of these.
                let digits = if number(word).is_some() { word } else { word.trim_matches('x') };
                let (Some(count), is_marked) = (number(digits), digits.len() < word.len()) else { return Ok(None) };
                if !is_marked && !matches!(next, Some("times" | "time" | "more")) {
                    return Ok(None);
                }
                (count, 1)
            }
            (None, _) => return Ok(None),
        };
        if count > MOST_STITCHES {
            return self.wrong(&format!("{count} times are too many"), KNOWN);
        }
        self.at += words;
        while matches!(self.peek(0), Some("times" | "time" | "more")) {
            self.at += 1;
        }
        Ok(Some(count))
    }

    fn step(&mut self) -> Result<Option<Item>> {
        if let Some(turn) = self.turn() {
            return Ok(Some(turn));
        }
        if self.slide() {
            return Ok(Some(Item::Slide));
        }
        if let Some(closed) = self.closed()? {
            return Ok(closed);
        }
        if let Some(look) = step::look(self) {
            let stop = self.until()?.unwrap_or(Stop::Left(0));
            return Ok(Some(Item::Look(look, stop)));
        }
        let start = self.at;
        let Some(phrase) = step::phrase(self)? else {
            let word = self.tokens[start].clone();
            return self.wrong(
                &format!("\"{}\" is no stitch that is known here", short(&word)),
                step::instead_of(&word).unwrap_or(KNOWN),
            );
        };
        let (steps, whole_row) = match phrase {
            Phrase::Nothing => return Ok(None),
            Phrase::Steps(steps) => (steps, false),
            Phrase::Row(steps) => (steps, true),
        };
        Ok(Some(match self.until()? {
            Some(last) => Item::Until(Steps { count: 1, ..steps }, last),
            // "Row 2: Purl."
            None if whole_row => Item::Until(steps, Stop::Left(0)),
            None => match self.times()? {
                Some(times) => {
                    let count = steps.count.saturating_mul(times).min(MOST_STITCHES + 1);
                    Item::Steps(Steps { count, ..steps })
                }
                None => Item::Steps(steps),
            },
        }))
    }
}
