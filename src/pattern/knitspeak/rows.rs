//! Which row a line is about, and in which order rows come.

use std::collections::BTreeMap;

use super::{KNOWN, KnitSpeakError, MOST_ROWS, Result, Side, Written, error, short, starts_with, words::parse_body};

/// All rows of the text in order.
pub(super) fn written_rows(text: &str) -> Result<Vec<Written>> {
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
        let says = |side: &str| [")", ","].iter().any(|end| lower.contains(&format!("({side}{end}")));
        let side = match (says("rs"), says("ws")) {
            (true, false) => Some(Side::Right),
            (false, true) => Some(Side::Wrong),
            _ => None,
        };
        let round = starts_with(&lower, "rnd") || starts_with(&lower, "round");
        let and_all_like_it = ["all ws", "all rs", "all even", "all odd", "every alt", "all foll", "all other"]
            .iter()
            .any(|words| lower.contains(words));
        let known = round || starts_with(&lower, "row");
        // Sides and counts of stitches stand in brackets.
        let mut deep = 0_i32;
        let outside = |c: &char| {
            let was = deep;
            deep += i32::from(*c == '(') - i32::from(*c == ')');
            was == 0 && *c != '('
        };
        let plain: String = lower.chars().filter(outside).collect();
        let numbers = plain.split("all").next().unwrap_or_default();
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
