//! The stitches of a row by their words.

use super::{super::chart::WIDEST_CABLE, KNOWN, Look, MOST_STITCHES, Result, Steps, brioche, parser::Parser, short};

/// What words say.
pub(super) enum Phrase {
    Steps(Steps),
    /// A step over the whole row, unless it is told how far.
    Row(Steps),
    /// Nothing that is knitted: a marker.
    Nothing,
}

fn one(name: &str, takes: u32, makes: u32) -> Steps {
    Steps { name: name.into(), takes, makes, count: 1 }
}

/// Stitches in other words than their own: several words, and the one word that they stand for.
const SPELLED: [(&[&str], &str); 42] = [
    (&["yarn", "over"], "yo"),
    (&["yarn", "forward"], "yo"),
    (&["yarn", "fwd"], "yo"),
    (&["y", "o"], "yo"),
    (&["make", "1", "left"], "m1l"),
    (&["make", "1", "right"], "m1r"),
    (&["make", "one", "left"], "m1l"),
    (&["make", "one", "right"], "m1r"),
    (&["make", "1", "purlwise"], "m1lp"),
    (&["make", "1"], "m1l"),
    (&["make", "one"], "m1l"),
    (&["make", "bobble"], "mb"),
    (&["m", "1", "l"], "m1l"),
    (&["m", "1", "r"], "m1r"),
    (&["m", "1"], "m1l"),
    (&["m1", "purlwise"], "m1lp"),
    (&["m1", "p"], "m1lp"),
    (&["slip", "slip", "slip", "knit"], "sssk"),
    (&["slip", "slip", "knit"], "ssk"),
    (&["slip", "slip", "purl"], "ssp"),
    (&["slip", ",", "slip", ",", "knit"], "ssk"),
    (&["slip", ",", "slip", ",", "purl"], "ssp"),
    (&["knit", "into", "front", "and", "back", "of", "next", "st"], "kfb"),
    (&["knit", "into", "front", "and", "back"], "kfb"),
    (&["k", "into", "front", "and", "back"], "kfb"),
    (&["purl", "into", "front", "and", "back"], "pfb"),
    (&["k1", "f&b"], "kfb"),
    (&["p1", "f&b"], "pfb"),
    (&["left", "twist"], "1/1lc"),
    (&["right", "twist"], "1/1rc"),
    // Decreases by their motions.
    (&["sl2", "tog", "kwise", ",", "k1", ",", "p2sso"], "cdd"),
    (&["sl2", "kwise", ",", "k1", ",", "p2sso"], "cdd"),
    (&["sl", "2", "tog", "kwise", ",", "k1", ",", "p2sso"], "cdd"),
    (&["sl", "2", "tog", "knitwise", ",", "k1", ",", "p2sso"], "cdd"),
    (&["sl", "2", "kwise", ",", "k1", ",", "p2sso"], "cdd"),
    (&["sl2", ",", "k1", ",", "p2sso"], "cdd"),
    (&["sl", "2", ",", "k1", ",", "p2sso"], "cdd"),
    (&["slip", "2", ",", "k1", ",", "p2sso"], "cdd"),
    (&["s2kp", "2"], "cdd"),
    (&["yf", ",", "sl1", ",", "yb"], "slwyif"),
    (&["yf", "sl1", "yb"], "slwyif"),
    (&["yf", ",", "sl", "1", ",", "yb"], "slwyif"),
];

/// Markers are not kept.
const MARKERS: [&[&str]; 16] = [
    &["place", "marker"],
    &["slip", "marker"],
    &["slip", "m"],
    &["sl", "marker"],
    &["sl", "m"],
    &["remove", "marker"],
    &["remove", "m"],
    &["pm"],
    &["sm"],
    &["slm"],
    &["rm"],
    &["place", "m"],
    &["ybk"],
    &["yb"],
    &["wyib"],
    &["yarn", "back"],
];

/// What to write in place of words that patterns have and charts do not.
pub(super) fn instead_of(word: &str) -> Option<&'static str> {
    let stem = word.trim_end_matches(|c: char| c.is_ascii_digit());
    Some(match stem {
        "k1b" | "p1b" | "below" => {
            "it is a stitch through the back loop to some, into the row below to others: k1 tbl, or `tuck` and k as in brioche"
        }
        "bind" | "bo" | "cast" | "co" => {
            "say how many: bind off 4 sts, cast on 4 sts; all of them by a line of its own: Bind off"
        }
        "inc" | "increase" => "say which increase: kfb, m1l, m1r or yo",
        "dec" | "decrease" => "say which decrease: k2tog, ssk, p2tog or ssp",
        "psso" | "p2sso" => "a decrease is one step: sl 1, k1, psso; sl 1, k2tog, psso; or ssk, sk2p, cdd",
        "work" | "patt" | "pattern" | "continue" | "cont" => "say which stitches: k, p, or k the knits and p the purls",
        "rib" => "say which rib: *k2, p2; rep from * to end",
        "m" | "marker" => "markers are not counted: say how many stitches",
        "join" | "pick" | "pu" => "a piece is knitted of the stitches that are cast on; `form = \"tube\"` knits round",
        "yf" | "yfwd" | "ytf" => {
            "brioche slips a stitch with a yarn over: sl1yo; a stitch with the yarn before it is sl1 wyif"
        }
        "wrap" | "wraps" | "wrapped" => {
            "say w&t where the row turns, and picking up wraps where they are worked with their stitches"
        }
        "br4st" | "brkyobrk" | "brpyobrp" | "brkyobrkyobrk" => {
            "of one stitch no more than two are made, and of no more than three one: kfb, m1l, brk2tog, brssk, brLsl dec, brRsl dec"
        }
        "t" | "cr" | "tw" => "cables are c4f, c4b, t3f, t3b, 2/1 LC, 2/1 RPC",
        _ => return None,
    })
}

/// Words that tell stitches by how they look: "k the knits and p the purls", "St st".
pub(super) fn look(words: &mut Parser<'_>) -> Option<Look> {
    const STOCKINETTE: [&[&str]; 6] = [
        &["st", "st"],
        &["stst"],
        &["stockinette", "stitch"],
        &["stockinette"],
        &["stocking", "st"],
        &["stocking", "stitch"],
    ];
    const REVERSE: [&[&str]; 5] = [
        &["rev", "st", "st"],
        &["rev", "stst"],
        &["reverse", "st", "st"],
        &["reverse", "stockinette", "stitch"],
        &["reverse", "stockinette"],
    ];
    let begins = ["in", "work", "work in"];
    let skipped = if matches!(words.peek(0), Some("work")) && words.peek(1) == Some("in") {
        2
    } else {
        usize::from(words.peek(0).is_some_and(|w| begins.contains(&w)))
    };
    let is = |of: &[&[&str]], words: &Parser<'_>| {
        of.iter().find(|want| want.iter().enumerate().all(|(i, w)| words.peek(skipped + i) == Some(w))).map(|w| w.len())
    };
    for (of, look) in [(&STOCKINETTE[..], Look::Knit), (&REVERSE[..], Look::Purl)] {
        if let Some(count) = is(of, words) {
            words.skip(skipped + count);
            return Some(look);
        }
    }
    as_they_appear(words).then_some(Look::Below)
}

/// "k the knits and p the purls", "work sts as they appear".
fn as_they_appear(words: &mut Parser<'_>) -> bool {
    let ends = |words: &Parser<'_>, at: usize| -> Option<usize> {
        const ENDS: [&[&str]; 9] = [
            &["as", "they", "appear"],
            &["as", "they", "face", "you"],
            &["as", "they", "face"],
            &["as", "they", "present", "themselves"],
            &["as", "they", "present"],
            &["as", "they", "show"],
            &["as", "they", "come"],
            &["as", "you", "see", "them"],
            &["facing", "you"],
        ];
        ENDS.iter().find(|e| e.iter().enumerate().all(|(i, w)| words.peek(at + i) == Some(w))).map(|e| e.len())
    };
    let skip = |words: &Parser<'_>, at: &mut usize, of: &[&str]| -> usize {
        let from = *at;
        while words.peek(*at).is_some_and(|w| of.contains(&w)) {
            *at += 1;
        }
        *at - from
    };
    const STITCHES: [&str; 4] = ["st", "sts", "stitch", "stitches"];
    if words.peek(0) == Some("work") {
        let mut at = 1;
        skip(words, &mut at, &["the", "all"]);
        if skip(words, &mut at, &STITCHES) > 0
            && let Some(end) = ends(words, at)
        {
            words.skip(at + end);
            return true;
        }
        return false;
    }
    let half = |words: &Parser<'_>, at: &mut usize, [verb, kind, plural]: [&[&str]; 3]| -> bool {
        if !words.peek(*at).is_some_and(|w| verb.contains(&w)) {
            return false;
        }
        *at += 1;
        let article = skip(words, at, &["the", "all"]);
        let Some(word) = words.peek(*at).filter(|w| kind.contains(w) || plural.contains(w)) else { return false };
        let plural = plural.contains(&word);
        *at += 1;
        skip(words, at, &STITCHES) > 0 || plural || article > 0
    };
    let knit: [&[&str]; 3] = [&["k", "knit"], &["k", "knit"], &["knits", "ks"]];
    let purl: [&[&str]; 3] = [&["p", "purl"], &["p", "purl"], &["purls", "ps"]];
    for [first, second] in [[knit, purl], [purl, knit]] {
        let mut at = 0;
        if half(words, &mut at, first) {
            skip(words, &mut at, &[",", "and", "&", ";"]);
            if half(words, &mut at, second) {
                let end = ends(words, at).unwrap_or(0);
                words.skip(at + end);
                return true;
            }
        }
    }
    false
}

/// The next stitches; none if their first word is of no stitch.
pub(super) fn phrase(words: &mut Parser<'_>) -> Result<Option<Phrase>> {
    if words.take_any(&MARKERS) {
        return Ok(Some(Phrase::Nothing));
    }
    if brioche::slipped(words) {
        return Ok(Some(Phrase::Steps(one("tuck", 1, 1))));
    }
    if words.double_stitch() {
        return Ok(Some(Phrase::Steps(one("ds", 1, 1))));
    }
    if let Some((_, name)) = SPELLED.iter().find(|(spelled, _)| words.take(spelled)) {
        return Ok(named(name).map(Phrase::Steps));
    }
    if let Some(steps) = bound_or_cast(words) {
        return Ok(Some(Phrase::Steps(steps)));
    }
    let word = words.peek(0).unwrap_or_default().to_owned();
    if let Some((name, takes, makes)) = brioche::named(&word) {
        words.skip(1);
        words.take(&["dec"]);
        return Ok(Some(Phrase::Steps(one(name, takes, makes))));
    }
    if let Some(steps) = named(&word) {
        words.skip(1);
        return Ok(Some(Phrase::Steps(through_back(words, steps))));
    }
    if word.contains('/') {
        words.skip(1);
        return cable(words, &word).map(|steps| Some(Phrase::Steps(steps)));
    }
    let digits = word.find(|c: char| c.is_ascii_digit()).unwrap_or(word.len());
    let (name, rest) = word.split_at(digits);
    let name = match name {
        "k" | "knit" => "k",
        "p" | "purl" => "p",
        "sl" | "slip" | "s" => "sl",
        _ => return Ok(None),
    };
    // "k4tbl", "sl1p" and "p2b" are one word.
    let tail = rest.trim_start_matches(|c: char| c.is_ascii_digit());
    let own = &rest[..rest.len() - tail.len()];
    if !matches!(tail, "" | "tbl" | "p" | "k" | "pwise" | "kwise" | "st" | "sts" | "wyif" | "wyib")
        || (!tail.is_empty() && name != "sl" && tail != "tbl")
    {
        return Ok(None);
    }
    words.skip(1);
    let mut count = if own.is_empty() { None } else { own.parse::<u32>().ok().or(Some(0)) };
    if count.is_none()
        && let Some(n) = words.number(0)
        && !matches!(words.peek(1), Some("times" | "time" | "more" | "x"))
    {
        words.skip(1);
        count = Some(n);
    }
    if count.is_some_and(|n| !(1..=MOST_STITCHES).contains(&n)) {
        return words.wrong(&format!("\"{}\" is no number of stitches", short(&word)), format!("1 to {MOST_STITCHES}"));
    }
    words.stitches();
    if name == "sl" {
        return slipped(words, count.unwrap_or(1), tail).map(|steps| Some(Phrase::Steps(steps)));
    }
    // "K 2 tog"
    if words.take_any(&[&["tog"], &["together"]]) {
        let together = format!("{name}{}tog", count.unwrap_or(0));
        return match named(&together) {
            Some(steps) => Ok(Some(Phrase::Steps(through_back(words, steps)))),
            None => words.wrong(&format!("\"{together}\" is no stitch that is known here"), KNOWN),
        };
    }
    let steps = Steps { count: count.unwrap_or(1), ..one(name, 1, 1) };
    let steps = if tail == "tbl" { Steps { name: format!("{name}tbl"), ..steps } } else { through_back(words, steps) };
    Ok(Some(match (word.as_str(), count) {
        ("knit" | "purl", None) => Phrase::Row(steps),
        _ => Phrase::Steps(steps),
    }))
}

/// "Bind off 4 sts purlwise", "bo4", "cast on 4 sts".
fn bound_or_cast(words: &mut Parser<'_>) -> Option<Steps> {
    const NAMES: [(&[&str], bool); 5] = [
        (&["bind", "off"], true),
        (&["cast", "off"], true),
        (&["cast", "on"], false),
        (&["bo"], true),
        (&["co"], false),
    ];
    let spelled = NAMES.iter().find(|(name, _)| name.iter().enumerate().all(|(i, w)| words.peek(i) == Some(w)));
    let (binds, mut at, mut count) = match spelled {
        Some((name, binds)) => (*binds, name.len(), None),
        // "bo4"
        None => {
            let word = words.peek(0)?;
            let digits = word.strip_prefix("bo").or_else(|| word.strip_prefix("co"))?;
            (word.starts_with('b'), 1, Some(digits.parse::<u32>().ok()?))
        }
    };
    if count.is_none() {
        at += (at..).take_while(|i| matches!(words.peek(*i), Some("the" | "next"))).count();
        count = words.number(at);
        at += 1;
    }
    let count = count.filter(|n| (1..=MOST_STITCHES).contains(n))?;
    words.skip(at);
    words.stitches();
    let purl = words.take_any(&[&["purlwise"], &["pwise"]]);
    words.take_any(&[&["knitwise"], &["kwise"]]);
    Some(match binds {
        true => Steps { count, ..one(if purl { "bop" } else { "bo" }, 1, 0) },
        false => Steps { count, ..one("co", 0, 1) },
    })
}

/// The same stitch through the back of its loops, if the next words say so.
fn through_back(words: &mut Parser<'_>, steps: Steps) -> Steps {
    let Some(twisted) = twisted(&steps.name) else { return steps };
    const BACK: [&[&str]; 6] = [
        &["tbl"],
        &["through", "back", "loop"],
        &["through", "back", "loops"],
        &["through", "the", "back", "loop"],
        &["through", "the", "back", "loops"],
        &["thru", "back", "loop"],
    ];
    if words.take_any(&BACK) { Steps { name: twisted.to_owned(), ..steps } } else { steps }
}

fn twisted(name: &str) -> Option<&'static str> {
    Some(match name {
        "k" => "ktbl",
        "p" => "ptbl",
        // The needle comes from the other side, so that the other one is on top.
        "k2tog" => "ssk",
        "p2tog" => "ssp",
        "k3tog" => "sssk",
        "p3tog" => "sssp",
        _ => return None,
    })
}

/// "sl 1, k2tog, psso", "sl 2 purlwise wyif", behind the count.
fn slipped(words: &mut Parser<'_>, count: u32, tail: &str) -> Result<Steps> {
    let side = |words: &mut Parser<'_>| {
        words.take_any(&[
            &["purlwise"],
            &["pwise"],
            &["knitwise"],
            &["kwise"],
            &["as", "if", "to", "knit"],
            &["as", "if", "to", "purl"],
        ])
    };
    side(words);
    if count == 1 {
        for (passed, name) in
            [(&["k1"][..], "ssk"), (&["k", "1"], "ssk"), (&["k2tog"], "sssk"), (&["k", "2", "tog"], "sssk")]
        {
            let spelled = [passed, &[",", "psso"]].concat();
            let all = [&[","][..], &spelled].concat();
            let close = [passed, &["psso"]].concat();
            if words.take(&all)
                || words.take(&spelled)
                || words.take(&close)
                || words.take(&[&[","], &close[..]].concat())
            {
                return Ok(named(name).unwrap_or_else(|| one(name, 2, 1)));
            }
        }
    }
    let front: [&[&str]; 5] =
        [&["wyif"], &["with", "yarn", "in", "front"], &[",", "wyif"], &["with", "yarn", "at", "front"], &["yf"]];
    let back: [&[&str]; 4] = [&["wyib"], &["with", "yarn", "in", "back"], &["with", "yarn", "at", "back"], &["yb"]];
    let name = if tail == "wyif" || words.take_any(&front) {
        "slwyif"
    } else {
        words.take_any(&back);
        "sl"
    };
    side(words);
    Ok(Steps { count, ..one(name, 1, 1) })
}

/// "2/1 LC", "2/2 rpc", behind the first word.
fn cable(words: &mut Parser<'_>, word: &str) -> Result<Steps> {
    let digits = word.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let kind = if digits.len() < word.len() {
        word[digits.len()..].to_owned()
    } else {
        let kind = words.peek(0).unwrap_or_default().to_owned();
        words.skip(1);
        kind
    };
    let counts: Vec<u32> = digits.split('/').filter_map(|n| n.parse().ok()).collect();
    let hint = "as in 2/1 LC, 2/2 RPC";
    let &[front, back] = &counts[..] else { return words.wrong(&format!("\"{}\" is no cable", short(word)), hint) };
    if !matches!(kind.as_str(), "lc" | "rc" | "lpc" | "rpc")
        || front == 0
        || back == 0
        || front.saturating_add(back) > WIDEST_CABLE.into()
    {
        return words.wrong(&format!("\"{} {}\" is no cable", short(digits), short(&kind)), hint);
    }
    Ok(one(&format!("{digits}{kind}"), front + back, front + back))
}

/// A stitch by one word: its name in charts, and what it takes and makes.
fn named(word: &str) -> Option<Steps> {
    let (name, takes, makes) = match word {
        "ktbl" | "k1tbl" => ("ktbl", 1, 1),
        "ptbl" | "p1tbl" => ("ptbl", 1, 1),
        "yo" | "yfwd" | "yon" | "yrn" | "yfrn" | "yfon" | "o" => ("yo", 0, 1),
        "k2tog" => ("k2tog", 2, 1),
        "ssk" | "skp" | "skpo" | "k2togtbl" | "k2togb" | "s1kp" | "sl1k1psso" | "s1k1psso" => ("ssk", 2, 1),
        "p2tog" => ("p2tog", 2, 1),
        "ssp" | "p2togtbl" | "p2togb" => ("ssp", 2, 1),
        "k3tog" => ("k3tog", 3, 1),
        "sssk" | "sk2p" | "sk2po" | "k3togtbl" | "sl1k2togpsso" => ("sssk", 3, 1),
        "p3tog" => ("p3tog", 3, 1),
        "sssp" | "p3togtbl" => ("sssp", 3, 1),
        "cdd" | "s2kp" | "s2kp2" | "s2kpo" | "sl2k1p2sso" => ("cdd", 3, 1),
        "cddp" => ("cddp", 3, 1),
        "kfb" | "k1fb" | "k1f&b" => ("kfb", 1, 2),
        "pfb" | "p1fb" | "p1f&b" => ("pfb", 1, 2),
        "m1" | "m1l" | "m1k" | "m1lk" => ("m1l", 0, 1),
        "m1r" | "m1rk" => ("m1r", 0, 1),
        "m1p" | "m1pl" | "m1lp" => ("m1lp", 0, 1),
        "m1pr" | "m1rp" => ("m1rp", 0, 1),
        "tuck" | "sl1yo" => ("tuck", 1, 1),
        "miss" => ("miss", 1, 1),
        "slwyif" => ("slwyif", 1, 1),
        "mb" | "bobble" => ("mb", 1, 1),
        "lt" => ("1/1lc", 2, 2),
        "rt" => ("1/1rc", 2, 2),
        _ => {
            // c4f, c6b, t3f: so many stitches cross; l and r as f and b.
            let rest = word.strip_prefix(['c', 't'])?;
            let count = rest.trim_end_matches(['f', 'b', 'l', 'r']);
            let side = match &rest[count.len()..] {
                "f" | "l" => "f",
                "b" | "r" => "b",
                _ => return None,
            };
            let wide = count.parse::<u32>().ok().filter(|n| (2..=WIDEST_CABLE.into()).contains(n))?;
            return Some(one(&format!("{}{wide}{side}", &word[..1]), wide, wide));
        }
    };
    Some(one(name, takes, makes))
}
