//! Short rows: where a row turns, what closes the turn, and rows that go as far as another one has turned.

use super::{Item, Result, Side, Steps, lines::number, parser::Parser, short};

/// How a turn is closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Close {
    /// By what the next row begins with: its first plain stitch becomes a double one.
    Plain,
    /// The yarn goes around the next stitch, behind it and back in front of it.
    Wrap,
    /// The first stitch of the next row is a double one.
    Double,
}

/// A turn in a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    pub(super) close: Close,
    /// How many stitches it says that it leaves.
    pub(super) leaves: Option<u32>,
}

/// How a row has turned, and the step by which the yarn goes around what is wrapped.
pub(super) type Turned = (Close, &'static str);

/// What a row comes to where another one has turned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Marked {
    Wrapped,
    Double,
    /// Between the stitches that were worked and those that were left.
    Gap,
}

/// How far something is worked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stop {
    /// Until so many stitches are left.
    Left(u32),
    /// Until so many stitches before the next one of these.
    Before(Marked, u32),
    /// So many stitches behind it.
    Past(Marked, u32),
}

/// A place where a row has turned.
#[derive(Clone, Debug)]
pub(super) struct Mark {
    pub(super) close: Close,
    /// The stitch that is wrapped or doubled, from the left.
    pub(super) column: u32,
    /// Stitches to the left of the gap.
    pub(super) gap: u32,
    /// The step by which the yarn goes around a stitch that is wrapped.
    pub(super) passing: &'static str,
    /// The row that begins there, from 0, and its side.
    pub(super) row: usize,
    pub(super) side: Side,
}

impl Marked {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Wrapped => "wrapped stitch",
            Self::Double => "double stitch",
            Self::Gap => "gap of a turn",
        }
    }

    pub(super) fn is(self, mark: &Mark) -> bool {
        match self {
            Self::Wrapped => mark.close == Close::Wrap,
            Self::Double => mark.close != Close::Wrap,
            Self::Gap => true,
        }
    }
}

impl Mark {
    /// The turn of a row on a side that has left so many of its stitches. The next row is of such a number, from 0.
    pub(super) fn new((close, passing): Turned, side: Side, [left, all]: [u32; 2], row: usize) -> Self {
        let is_left = side == Side::Right;
        let gap = if is_left { left } else { all - left };
        let column = if is_left == (close == Close::Wrap) { gap.saturating_sub(1) } else { gap };
        Self { close, column, gap, passing, row, side: side.other() }
    }

    /// Where it is for a row on a side of so many stitches: the marked stitch by those before it, and the gap.
    pub(super) fn places(&self, side: Side, found: u32) -> Option<[u32; 2]> {
        match side {
            Side::Right => Some([found.checked_sub(self.column + 1)?, found.checked_sub(self.gap)?]),
            Side::Wrong => Some([self.column, self.gap]),
        }
    }
}

/// A double stitch, in words.
const DOUBLE: [&[&str]; 7] = [
    &["make", "double", "stitch"],
    &["make", "double", "st"],
    &["make", "a", "double", "stitch"],
    &["make", "ds"],
    &["make", "1", "ds"],
    &["mds"],
    &["ds"],
];

impl Parser<'_> {
    /// "make double stitch", "mds", "ds": the stitch that closes a turn.
    pub(super) fn double_stitch(&mut self) -> bool {
        self.take_any(&DOUBLE)
    }

    /// "turn", "w&t", "wrap and turn", "turn, make double stitch", "turn, leaving rem sts unworked".
    pub(super) fn turn(&mut self) -> Option<Item> {
        let close = self.turning()?;
        // "wrap & turn (w&t)"
        self.take(&["(", "w&t", ")"]);
        let leaves = self.leaving();
        let from = self.at;
        self.commas();
        let close = match close {
            Close::Plain if self.double_stitch() => Close::Double,
            close => {
                self.at = from;
                close
            }
        };
        Some(Item::Turn(Turn { close, leaves: leaves.or_else(|| self.leaving()) }))
    }

    fn turning(&mut self) -> Option<Close> {
        const WRAPS: [&[&str]; 7] =
            [&["w&t"], &["w+t"], &["wt"], &["w/t"], &["w", "&", "t"], &["w", "and", "t"], &["wrap&turn"]];
        if self.take_any(&WRAPS) {
            return Some(Close::Wrap);
        }
        // "wrap next st and turn"
        if self.peek(0) == Some("wrap") {
            let filler = |w: &&str| {
                matches!(*w, "the" | "next" | "following" | "st" | "stitch" | "and" | "&" | "+" | "," | "then")
            };
            let count = (1..).take_while(|k| self.peek(*k).is_some_and(|w| filler(&w))).count();
            if self.peek(1 + count) == Some("turn") {
                self.at += 2 + count;
                self.take(&["work"]);
                return Some(Close::Wrap);
            }
            return None;
        }
        self.take_any(&[&["turn", "work"], &["turn", "the", "work"], &["turn"]]).then_some(Close::Plain)
    }

    /// "leaving rem sts unworked", "leave last 5 sts on hold": how many, or 0 if it is not said.
    fn leaving(&mut self) -> Option<u32> {
        let from = self.at;
        self.commas();
        let bracket = self.take(&["("]);
        self.take_any(&[&["leaving"], &["leave"]]);
        while self.take_any(&[&["the"], &["all"], &["last"], &["rem"], &["remaining"], &["other"]]) {}
        let count = self.number(0);
        self.at += usize::from(count.is_some());
        self.take_any(&[&["rem"], &["remaining"]]);
        let is_told =
            self.stitches() && self.take_any(&[&["unworked"], &["on", "hold"], &["unknit"], &["on", "needle"]]);
        let is_told = is_told && (!bracket || self.take(&[")"]));
        if !is_told {
            self.at = from;
        }
        count.filter(|_| is_told)
    }

    fn commas(&mut self) {
        while self.take_any(&[&[","], &[";"], &["and"], &["then"], &["&"]]) {}
    }

    /// "wrapped st", "3 sts before last wrapped st", "1 st past gap", behind "to".
    pub(super) fn mark(&mut self) -> Option<Stop> {
        let from = self.at;
        self.take_any(&[&["within"]]);
        let count = self.number(0).filter(|_| matches!(self.peek(1), Some("st" | "sts" | "stitch" | "stitches")));
        let mut past = false;
        if count.is_some() {
            self.at += 2;
            past = self.take_any(&[&["past"], &["after"], &["beyond"], &["behind"]]);
            if !past && !self.take_any(&[&["before"], &["from"], &["of"], &["short", "of"]]) {
                self.at = from;
                return None;
            }
        }
        while self.take_any(&[
            &["the"],
            &["last"],
            &["previous"],
            &["prev"],
            &["next"],
            &["first"],
            &["prior"],
            &["previously"],
        ]) {}
        let Some(of) = self.marked() else {
            self.at = from;
            return None;
        };
        let count = count.unwrap_or(0);
        Some(if past { Stop::Past(of, count) } else { Stop::Before(of, count) })
    }

    fn marked(&mut self) -> Option<Marked> {
        const WRAPPED: [&[&str]; 10] = [
            &["wrapped", "and", "turned"],
            &["wrapped", "st"],
            &["wrapped", "stitch"],
            &["wrapped", "sts"],
            &["wrapped"],
            &["wrap"],
            &["w&t"],
            &["w", "&", "t"],
            &["wrap", "and", "turn"],
            &["w+t"],
        ];
        const DOUBLED: [&[&str]; 5] =
            [&["double", "stitch"], &["double", "st"], &["doubled", "st"], &["doubled", "stitch"], &["ds"]];
        const GAP: [&[&str]; 7] = [
            &["gap"],
            &["turning", "point"],
            &["turning", "gap"],
            &["turned", "st"],
            &["turned", "stitch"],
            &["turning"],
            &["turn"],
        ];
        let found = [(&WRAPPED[..], Marked::Wrapped), (&DOUBLED, Marked::Double), (&GAP, Marked::Gap)]
            .into_iter()
            .find_map(|(words, of)| self.take_any(words).then_some(of))?;
        self.stitches();
        Some(found)
    }

    /// What is said of wraps and double stitches that are worked: "picking up wraps", "knit wrap with st", "working double
    /// stitches as one", which goes without saying.
    pub(super) fn closed(&mut self) -> Result<Option<Option<Item>>> {
        let clause: Vec<String> = self.tokens[self.at..].iter().take_while(|t| !is_end(t)).cloned().collect();
        let clause: Vec<&str> = clause.iter().map(String::as_str).collect();
        let says = |words: &[&str]| clause.iter().any(|word| words.contains(word));
        let wraps = says(&["wrap", "wraps", "wrapped"]);
        let double = |pair: &[&str]| pair[0] == "double" && pair[1].starts_with("st");
        let doubles = says(&["ds", "dss"]) || clause.windows(2).any(double);
        let Some(verb) = clause.first().map(|first| first.trim_end_matches(|c: char| c.is_ascii_digit())) else {
            return Ok(None);
        };
        let goes_on = !verb.ends_with("ing") && clause.iter().skip(1).any(|w| is_verb(w) && w.ends_with("ing"));
        let is_step = matches!(clause.get(1), Some(&("to" | "until"))) || says(&["turn"]) || goes_on;
        if !(wraps || doubles) || is_step || !is_verb(verb) {
            return Ok(None);
        }
        self.at += clause.len();
        self.skip_them();
        let digits = &clause[0][verb.len()..];
        let count =
            if digits.is_empty() { clause.get(1).and_then(|w| number(w)) } else { digits.parse().ok().or(Some(0)) };
        let many = says(&["wraps", "all", "each", "every", "dss", "stitches", "sts"]) || verb.ends_with("ing");
        if many && count.is_none() {
            let always = says(&["come", "encounter", "always", "throughout", "whenever", "reach"]);
            return Ok(Some(wraps.then_some(Item::PickUp { always })));
        }
        let name = match verb {
            "k" | "knit" => "k",
            "p" | "purl" => "p",
            _ if says(&["k", "knit"]) => "k",
            _ if says(&["p", "purl"]) => "p",
            _ => {
                let problem = format!("\"{}\" does not say how it is worked", short(&clause.join(" ")));
                return self.wrong(&problem, "as in knit wrap with st, k ds, purl next st together with its wrap");
            }
        };
        let count = count.unwrap_or(1);
        if !(1..=super::MOST_STITCHES).contains(&count) {
            return self.wrong(&format!("\"{}\" is no number of stitches", short(clause[0])), "as in k1 with its wrap");
        }
        let steps = Steps::of(name, count);
        Ok(Some(Some(match (wraps, says(&["wrap", "wraps"])) {
            (true, true) => Item::Wrapped(steps),
            // Its wrap stays where it lies.
            (true, false) => Item::Steps(steps),
            (false, _) => Item::Doubled(steps),
        })))
    }

    /// "and working them together with their sts", behind the wraps.
    fn skip_them(&mut self) {
        let from = self.at;
        self.commas();
        let is_worked =
            matches!(self.peek(0), Some("work" | "working" | "knit" | "knitting" | "purl" | "purling" | "k" | "p"));
        if !(is_worked && matches!(self.peek(1), Some("them" | "it" | "each"))) {
            self.at = from;
            return;
        }
        while self.peek(0).is_some_and(|t| !is_end(t)) {
            self.at += 1;
        }
    }

    /// "slide", "do not turn": the next row is of the same side.
    pub(super) fn slide(&mut self) -> bool {
        const NOT: [&[&str]; 5] =
            [&["do", "not", "turn"], &["don't", "turn"], &["dont", "turn"], &["without", "turning"], &["slide"]];
        if !self.take_any(&NOT) {
            return false;
        }
        // "do not turn, slide sts to other end of needle"
        self.commas();
        self.take(&["slide"]);
        let filler = |w: &str| {
            matches!(w, "sts" | "stitches" | "work" | "the" | "all" | "back" | "to" | "other" | "opposite" | "right")
                || matches!(w, "end" | "tip" | "of" | "needle" | "needles" | "beginning" | "row")
        };
        while self.peek(0).is_some_and(filler) {
            self.at += 1;
        }
        true
    }
}

/// Whether a clause ends before a word.
fn is_end(word: &str) -> bool {
    matches!(word, "," | ";" | ":" | "]" | ")" | "}" | "[" | "(" | "{" | "*")
}

fn is_verb(word: &str) -> bool {
    matches!(
        word,
        "k" | "knit"
            | "p"
            | "purl"
            | "pick"
            | "lift"
            | "work"
            | "hide"
            | "close"
            | "picking"
            | "lifting"
            | "working"
            | "knitting"
            | "purling"
            | "hiding"
            | "closing"
            | "treating"
            | "while"
    )
}
