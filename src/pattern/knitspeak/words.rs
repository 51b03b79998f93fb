//! The words of a row: steps, repeats and brackets.

use super::{
    super::chart::WIDEST_CABLE, Item, KNOWN, MOST_NESTED, MOST_STITCHES, Result, Sequence, Steps, error, short,
};

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

pub(super) fn parse_body(text: &str, line: usize) -> Result<Sequence> {
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
        if let Some(turn) = self.turn()? {
            return Ok(turn);
        }
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

    /// "turn", "w&t", "wrap and turn", "turn, leaving rem sts unworked".
    fn turn(&mut self) -> Result<Option<Item>> {
        const WORDS: [&[&str]; 8] = [
            &["turn", "work"],
            &["turn"],
            &["w&t"],
            &["wt"],
            &["wrap", "and", "turn"],
            &["wrap", "&", "turn"],
            &["wrap", "next", "st", "and", "turn"],
            &["wrap", "next", "st", ",", "turn"],
        ];
        if !WORDS.iter().any(|words| self.take(words)) {
            return Ok(None);
        }
        self.separators();
        if self.take(&["leaving"]) || self.take(&["leave"]) {
            let _ = self.take(&["rem"]) || self.take(&["remaining"]);
            let _ = self.take(&["sts"]) || self.take(&["stitches"]);
            self.take(&["unworked"]);
        }
        match self.peek(0) {
            None => Ok(Some(Item::Turn)),
            Some(after) => error(
                self.line,
                format!("\"{}\" comes after the turn", short(after)),
                "a row ends where it turns: go on with the next one, as in Row 2: p10",
            ),
        }
    }

    /// "2/1 LC", "2/2 rpc".
    fn cable(&mut self, word: &str) -> Result<Item> {
        let kind = self.peek(0).unwrap_or_default().to_owned();
        self.at += 1;
        let counts: Vec<u32> = word.split('/').filter_map(|n| n.parse().ok()).collect();
        let &[front, back] = &counts[..] else { return error(self.line, format!("\"{word}\" is no cable"), KNOWN) };
        if !matches!(kind.as_str(), "lc" | "rc" | "lpc" | "rpc")
            || front == 0
            || back == 0
            || front.saturating_add(back) > WIDEST_CABLE.into()
        {
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
        "ds" => return one("ds", 1, 1),
        "miss" => return one("miss", 1, 1),
        "slwyif" => return one("slwyif", 1, 1),
        "mb" | "bobble" => return one("mb", 1, 1),
        _ => {}
    }
    if word.contains('/') {
        return one("cable", 0, 0);
    }
    // c4f, c6b, t3f: so many stitches cross.
    if let Some(rest) = word.strip_prefix(['c', 't'])
        && let Some(count) = rest.strip_suffix(['f', 'b'])
    {
        let count = count.parse::<u32>().ok().filter(|n| (2..=WIDEST_CABLE.into()).contains(n))?;
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
