//! Rows in their order, with those that are repeated.

use std::collections::BTreeMap;

use super::{
    Instructions, Item, KNOWN, KnitSpeakError, MOST_ROWS, Result, Side, Written, error,
    lines::{self, Copies, Ending, Head, Line, Often, Which},
    words::parse_body,
};

/// Rows that go on after the last one, by their places.
#[derive(Clone, Debug)]
pub(super) struct Again {
    pub(super) rows: Vec<usize>,
    pub(super) until: Until,
    pub(super) line: usize,
}

/// How long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Until {
    /// Until so many stitches are left.
    Left(u32),
    /// Until so many stitches are on the needle.
    Have(u32),
    /// As long as the piece grows.
    Open,
}

/// After how many rows a piece may end: any number that leaves this rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EveryFew {
    /// Rows from one such number to the next, at least 1.
    pub apart: u32,
    /// What these numbers leave, divided by it.
    pub rest: u32,
}

impl EveryFew {
    /// Whether a piece may end after so many rows.
    pub fn holds(self, rows: u32) -> bool {
        rows % self.apart == self.rest
    }

    /// So many rows, or as many more as it takes.
    pub fn from(self, rows: u32) -> u32 {
        rows + (self.rest + self.apart - rows % self.apart) % self.apart
    }

    /// The number that is nearest to so many, and at least 1.
    pub fn nearest(self, rows: f64) -> u32 {
        let (apart, rest) = (f64::from(self.apart), f64::from(self.rest));
        let nearest = ((rows - rest) / apart).round().max(0.0) * apart + rest;
        self.from((nearest as u32).max(1))
    }
}

/// What has been read so far.
struct Reading {
    rows: BTreeMap<usize, Written>,
    /// How many rows come before the one that is written as the first: set-up rows, and others without a number.
    set_up: usize,
    /// After which numbers another row stands that has none of its own: the second of a number, or a short row.
    extra: Vec<usize>,
    /// Numbers of which there are two rows, each of its own yarn.
    pairs: Vec<usize>,
    /// Those that name a yarn, with their lines.
    of_a_yarn: Vec<(usize, usize)>,
    /// The short rows by their numbers, and where they are.
    short: BTreeMap<usize, usize>,
    /// Rows that are told to be like all others of a side, and how far they are apart.
    fill: Vec<(usize, usize, Written)>,
    first_side: Side,
    /// Whether a row says which side it is on; else the first one is on the right side.
    is_sided: bool,
    is_numbered: bool,
    round: bool,
    again: Option<Again>,
    cast_on: Option<u32>,
    /// How high the piece is when repeats without an end are done, mm.
    height: Option<f64>,
    /// Which row the repeats end with, and the line that says so.
    ending: Option<(Ending, usize)>,
    ends: bool,
}

/// Reads all of the text.
pub(super) fn written(text: &str) -> Result<Instructions> {
    let mut reading = Reading {
        rows: BTreeMap::new(),
        set_up: 0,
        extra: Vec::new(),
        pairs: Vec::new(),
        of_a_yarn: Vec::new(),
        short: BTreeMap::new(),
        fill: Vec::new(),
        first_side: Side::Right,
        is_sided: false,
        is_numbered: false,
        round: false,
        again: None,
        cast_on: None,
        height: None,
        ending: None,
        ends: false,
    };
    // A row may go on in the next lines.
    let mut row: Option<(usize, Head, String)> = None;
    for (line, whole) in text.lines().enumerate() {
        let whole = whole.trim();
        if whole.starts_with(['#', ';']) {
            continue;
        }
        for sentence in lines::sentences(whole) {
            let sentence = sentence.trim();
            if sentence.trim_matches('.').is_empty() {
                continue;
            }
            match lines::read(sentence, line)? {
                Line::More(more) => match &mut row {
                    Some((_, _, body)) if !more.contains(':') => {
                        body.push(' ');
                        body.push_str(&more);
                    }
                    _ => return lines::no_row(sentence, line),
                },
                other => {
                    if let Some((line, head, body)) = row.take() {
                        reading.row(line, head, &body)?;
                    }
                    match other {
                        Line::Row(head, body) => row = Some((line, head, body)),
                        Line::Again(copies) => reading.again(line, &copies)?,
                        Line::CastOn(_) if reading.last() > 0 => {
                            let hint = "write them in their row, as in Row 5: cast on 3 sts, k to end; or another piece by itself";
                            return error(line, "stitches are cast on behind rows that are written", hint);
                        }
                        Line::CastOn(count) => reading.cast_on = reading.cast_on.or(Some(count)),
                        Line::BindOff => reading.ends = true,
                        Line::Nothing | Line::More(_) => {}
                    }
                }
            }
        }
    }
    if let Some((line, head, body)) = row.take() {
        reading.row(line, head, &body)?;
    }
    reading.finish()
}

impl Reading {
    fn last(&self) -> usize {
        self.rows.keys().next_back().copied().unwrap_or(0)
    }

    fn row(&mut self, line: usize, mut head: Head, body: &str) -> Result<()> {
        if head.set_up {
            if self.is_numbered {
                let problem = "a set-up row comes after the rows that it sets up";
                return error(line, problem, "write it before Row 1, or give it the number that it has");
            }
        } else if !head.rows.is_empty() {
            // "Knit 3 rows. Row 1: ..."
            if !self.is_numbered && head.rows[0] == 1 {
                self.set_up = self.last();
            }
            self.is_numbered = true;
            if head.pass {
                self.of_a_yarn.extend(head.rows.iter().map(|row| (*row, line)));
            }
            head.rows = self.places(&head);
        }
        if head.next > 0 {
            self.fill_up(0);
            head.rows = (self.last() + 1..=self.last() + head.next).collect();
        }
        if head.set_up {
            self.set_up = self.set_up.max(head.rows.last().copied().unwrap_or_default());
        }
        if let Some(Again { .. }) = &self.again {
            let problem = "rows come after rows that are repeated without an end";
            return error(line, problem, "say how often those are repeated: Rep rows 1-4 3 times");
        }
        self.round |= head.round;
        if let (Some(side), Some(&first)) = (head.side, head.rows.first()) {
            let flips = self.rows.range(..first).map(|(_, row)| row.flips()).sum::<usize>();
            let first_side =
                if ((first + flips) % 2 == 1) == (side == Side::Right) { Side::Right } else { Side::Wrong };
            if self.is_sided && !self.round && first_side != self.first_side {
                let problem = format!(
                    "{} is said to be on the {} side, and other rows say otherwise",
                    self.name(first),
                    side.name()
                );
                return error(line, problem, "rows go back and forth: every second one is on the right side");
            }
            self.first_side = first_side;
            self.is_sided = true;
        }
        if let Some(copied) = lines::copied(body, line)? {
            self.fill_up(0);
            let pick = |k: usize| self.rows.get(&self.place(copied[k % copied.len()])).cloned();
            let copies: Vec<Option<Written>> = (0..head.rows.len()).map(pick).collect();
            for (&row, copy) in head.rows.iter().zip(copies) {
                let Some(copy) = copy else {
                    let row = self.name(row);
                    return error(line, format!("{row} repeats a row that is not written before it"), KNOWN);
                };
                self.insert(row, Written { line, said: None, count: None, ..copy })?;
            }
            return Ok(());
        }
        let number = head.rows.first().copied().unwrap_or_default();
        let (body, count) = lines::counted(body);
        let body = parse_body(body, line, number)?;
        let slides = body.any(|item| matches!(item, Item::Slide));
        if !self.pairs.is_empty() && (head.all.is_some() || head.rows.is_empty()) {
            let problem = "rows of a side, where each number has two rows";
            return error(line, problem, "write each of them, as in Row 2A: and Row 2B:");
        }
        let row = Written {
            line,
            side: Side::Right,
            round: false,
            said: head.side.filter(|_| head.rows.len() == 1),
            count,
            slides,
            body,
        };
        if head.rows.is_empty() {
            // Rows of a side, of whichever numbers.
            let apart = head.all.unwrap_or(2);
            let first = match (head.odd, head.side) {
                (Some(odd), _) if odd == self.set_up.is_multiple_of(2) => 1,
                // "All rows", of either side, or "every 4th row".
                (None, None) if apart == 1 => 1,
                (None, None) => self.set_up + apart,
                (None, side) if side == Some(self.first_side) => 1,
                _ => 2,
            };
            self.fill.push((first, apart, Written { said: None, count: None, ..row }));
            return Ok(());
        }
        for &number in &head.rows {
            self.insert(number, row.clone())?;
        }
        if let (Some(apart), Some(&first)) = (head.all, head.rows.first()) {
            self.fill.push((first, apart, Written { said: None, count: None, ..row }));
        }
        Ok(())
    }

    fn insert(&mut self, number: usize, row: Written) -> Result<()> {
        if number == 0 || number > MOST_ROWS {
            return error(row.line, format!("row {number} is not one of 1 to {MOST_ROWS}"), KNOWN);
        }
        let line = row.line;
        match self.rows.insert(number, row) {
            None => Ok(()),
            Some(_) => error(line, format!("{} is written twice", self.name(number)), KNOWN),
        }
    }

    /// Where a row is that is written with such a number: 0 is none.
    fn place(&self, row: usize) -> usize {
        let extra = self.extra.iter().filter(|before| **before < row).count();
        if row == 0 { 0 } else { row.saturating_add(self.set_up + extra) }
    }

    /// Where the rows of a head are. Short rows that are counted from 1 stand behind the others, and so does the second row of a
    /// number.
    fn places(&mut self, head: &Head) -> Vec<usize> {
        let mut places = Vec::with_capacity(head.rows.len());
        for &row in &head.rows {
            let last = self.number(self.last());
            let goes_on = self
                .short
                .last_key_value()
                .is_some_and(|(number, place)| number + 1 == row && *place != self.place(row - 1));
            let is_second =
                head.pass && row == last && !self.pairs.contains(&row) && self.rows.contains_key(&self.place(row));
            let place = if is_second || (head.short && last > 0 && (row <= last || goes_on)) {
                self.extra.push(last);
                self.last() + 1 + places.len()
            } else {
                self.place(row)
            };
            if is_second {
                self.pairs.push(row);
                let first = self.place(row);
                self.rows.entry(first).and_modify(|first| first.slides = true);
            }
            if head.short {
                self.short.insert(row, place);
            }
            places.push(place);
        }
        places
    }

    /// Where rows of such numbers are, in a repeat: with those that stand between them.
    fn repeated(&self, rows: &[usize]) -> Vec<usize> {
        let mut places = Vec::with_capacity(rows.len());
        for (k, &row) in rows.iter().enumerate() {
            let next = match rows.get(k + 1) {
                Some(next) if *next == row.saturating_add(1) => self.place(*next),
                _ => self.place(row).saturating_add(1 + usize::from(self.pairs.contains(&row))),
            };
            places.extend(self.place(row)..next);
        }
        places
    }

    /// The number of a row, or of the one before it that has one: 0 for set-up rows.
    fn number(&self, place: usize) -> usize {
        let mut number = place.saturating_sub(self.set_up);
        while self.place(number) > place {
            number -= 1;
        }
        number
    }

    /// What a row is called as it is written.
    fn name(&self, place: usize) -> String {
        match self.number(place) {
            0 => format!("set-up row {place}"),
            number if self.place(number) == place => format!("row {number}"),
            number => format!("the row behind row {number}"),
        }
    }

    /// Writes out rows that are like others, up to the last one and so many more.
    fn fill_up(&mut self, more: usize) {
        let last = self.last();
        for (start, apart, written) in &self.fill {
            for row in (*start..=last + more).step_by(*apart) {
                self.rows.entry(row).or_insert_with(|| written.clone());
            }
        }
    }

    /// Repeats rows after the last one.
    fn again(&mut self, line: usize, copies: &Copies) -> Result<()> {
        if copies.often == Often::Open {
            self.height = copies.height.or(self.height);
        }
        self.ending = copies.ending.map(|ending| (ending, line)).or(self.ending);
        if self.again.is_some() {
            // "These 4 rows form the pattern. Cont in patt until ..."
            if copies.often == Often::Open {
                return Ok(());
            }
            self.again = None;
        }
        // So that the last row of the repeat has its partner.
        let named = match &copies.which {
            Which::Rows(rows) if !copies.short => self.place(rows.iter().copied().max().unwrap_or(0)),
            _ => 0,
        };
        let more = named.min(MOST_ROWS).saturating_sub(self.last());
        self.fill_up(more.max(self.last() % 2));
        let last = self.last();
        if let Which::Last(count) = copies.which
            && count > last
        {
            let problem = format!("{count} rows are to be repeated, and {last} are written");
            return error(line, problem, "as many as are written at most");
        }
        let rows: Vec<usize> = match &copies.which {
            Which::Rows(rows) if copies.short => {
                let Some(places) = rows.iter().map(|row| self.short.get(row).copied()).collect() else {
                    return error(
                        line,
                        "short rows are repeated that are not written before",
                        "as in Short row 1 (RS): k20, w&t",
                    );
                };
                places
            }
            Which::Rows(rows) => self.repeated(rows),
            Which::Last(0) => Vec::new(),
            // Both rows of each number.
            Which::Last(count) if !self.pairs.is_empty() => {
                let first = self.number(last).saturating_sub(count - 1).max(1);
                (self.place(first)..=last).collect()
            }
            Which::Last(count) => (last + 1 - (*count).min(last + 1)..=last).collect(),
            Which::From(first) => (self.place(*first)..=last).collect(),
            Which::All => (self.set_up + 1..=last).collect(),
        };
        if let Some(missing) = rows.iter().find(|row| !self.rows.contains_key(row)) {
            let problem = format!("{} is repeated and is not written before", self.name(*missing));
            let hint = match last.saturating_sub(self.set_up) {
                0 => KNOWN.to_owned(),
                last => format!("rows 1 to {last} are there"),
            };
            return error(line, problem, hint);
        }
        if rows.is_empty() {
            return error(line, "no row is there to repeat", KNOWN);
        }
        if !self.pairs.is_empty() && matches!(copies.often, Often::Rows(_) | Often::RowsInAll(_) | Often::Through(_)) {
            return error(
                line,
                "rows are counted, where each number has two of them",
                "as in Rep rows 1-2 10 times more",
            );
        }
        let count = match copies.often {
            Often::More(times) => (times as usize).saturating_mul(rows.len()),
            // They were worked once where they are written.
            Often::InAll(times) => (times.saturating_sub(1) as usize).saturating_mul(rows.len()),
            Often::Rows(count) => count,
            Often::RowsInAll(count) => self.up_to(count, line)?,
            Often::Through(number) => self.up_to(self.place(number), line)?,
            Often::Left(_) | Often::Have(_) | Often::Open => {
                let until = match copies.often {
                    Often::Left(left) => Until::Left(left),
                    Often::Have(count) => Until::Have(count),
                    _ => Until::Open,
                };
                self.again = Some(Again { rows: rows.iter().map(|row| row - 1).collect(), until, line });
                return Ok(());
            }
        };
        if let (Some(Ending::Row(number)), Some(at)) = (copies.ending, count.checked_sub(1)) {
            let last = rows[at % rows.len()];
            if self.number(last) != number {
                let problem = format!("the repeats end with {}, and are to end with row {number}", self.name(last));
                return error(line, problem, "another number of rows, or leave out what it ends with");
            }
        }
        if count > MOST_ROWS {
            return error(line, format!("{count} rows more are too many"), format!("at most {MOST_ROWS} are knitted"));
        }
        // Rows without a number of their own have none where they are repeated either.
        let is_numbered: Vec<bool> = rows.iter().map(|&row| self.place(self.number(row)) == row).collect();
        let mut number = self.number(last);
        for k in 0..count {
            let copy = self.rows[&rows[k % rows.len()]].clone();
            self.insert(last + 1 + k, Written { line, said: None, count: None, ..copy })?;
            if is_numbered[k % rows.len()] {
                number += 1;
            } else {
                self.extra.push(number);
            }
        }
        self.ends = true;
        Ok(())
    }

    /// How many rows are wanting to so many in all.
    fn up_to(&self, count: usize, line: usize) -> Result<usize> {
        let last = self.last();
        let problem = || format!("{last} rows are written, and it is to end after {count}");
        count.checked_sub(last).map_or_else(|| error(line, problem(), "at least as many as are written"), Ok)
    }

    /// After how many of the rows the piece may end, by what is said of its last row.
    fn every_few(&self, rows: &[Written]) -> Result<Option<EveryFew>> {
        let parts = |row: &Written| row.body.parts().count();
        let count = rows.iter().map(parts).sum::<usize>();
        let Some((ending, line)) = self.ending else {
            // No yarn hangs at an edge within short rows: they are worked to their end.
            let again =
                self.again.iter().find(|a| a.until == Until::Open && a.rows.iter().any(|r| rows[*r].body.turns()));
            let apart = again.map(|again| again.rows.iter().map(|r| parts(&rows[*r])).sum::<usize>());
            return Ok(apart.map(|apart| EveryFew { apart: apart as u32, rest: (count % apart) as u32 }));
        };
        let found = match ending {
            Ending::On(_) if rows.iter().any(|row| row.slides) => {
                return error(
                    line,
                    "two rows are of each side, of which either may be the last",
                    "as in ending with row 2",
                );
            }
            Ending::On(Side::Right) if self.round => None,
            Ending::On(Side::Wrong) if self.round => {
                return error(line, "rounds have no wrong side to end with", "rows go back and forth: Row 1 (RS)");
            }
            Ending::On(side) => Some(EveryFew { apart: 2, rest: u32::from(side == rows[0].side) }),
            Ending::Row(number) => {
                let Some(Again { rows: repeated, .. }) = &self.again else { return Ok(None) };
                let place = self.repeated(&[number]).pop().unwrap_or_default().wrapping_sub(1);
                let Some(at) = repeated.iter().position(|row| *row == place) else {
                    let problem = format!("row {number} is to be the last, and is not repeated");
                    return error(line, problem, "ending with one of the rows that are repeated");
                };
                // The repeat begins behind the rows that are written.
                let worked = |repeated: &[usize]| repeated.iter().map(|row| parts(&rows[*row])).sum::<usize>();
                let apart = worked(repeated);
                Some(EveryFew { apart: apart as u32, rest: ((count + worked(&repeated[..=at])) % apart) as u32 })
            }
        };
        if self.again.is_none() && found.is_some_and(|ending| !ending.holds(count as u32)) {
            let side = rows[rows.len() - 1].side.name();
            let problem = format!("row {count} is the last and on the {side} side");
            return error(line, problem, "a row more or fewer, or leave out what it ends with");
        }
        if let Some((again, ends)) = self.again.as_ref().filter(|again| again.until == Until::Open).zip(found) {
            // Rows are repeated whole: after so many of them the same numbers come again.
            let numbers = again.rows.len() * ends.apart as usize;
            let mut worked = again.rows.iter().cycle().take(numbers).scan(count, |count, row| {
                *count += parts(&rows[*row]);
                Some(*count)
            });
            if !ends.holds(count as u32) && !worked.any(|count| ends.holds(count as u32)) {
                let problem = "none of the repeated rows ends on the side that the piece is to end on";
                return error(line, problem, "a row that turns and goes back is two: leave out what it ends with");
            }
        }
        Ok(found)
    }

    fn finish(mut self) -> Result<Instructions> {
        // One more, so that the last row of the repeat has its partner.
        if self.again.is_none() {
            // Where no row has a number, each of them is there once.
            let own = self.fill.iter().map(|(_, apart, _)| *apart).max().filter(|_| self.last() == self.set_up);
            self.fill_up(own.unwrap_or(self.last() % 2).min(MOST_ROWS));
        }
        let last = self.last();
        if last == 0 {
            return Err(KnitSpeakError { line: None, problem: "no row is written".into(), hint: KNOWN.into() });
        }
        if !self.is_sided && !self.set_up.is_multiple_of(2) {
            self.first_side = Side::Wrong;
        }
        if let Some((row, line)) = self.of_a_yarn.iter().find(|(row, _)| !self.pairs.contains(row)) {
            let problem = format!("row {row} is told to be of a yarn, and is the only row {row}");
            return error(
                *line,
                problem,
                "the yarns of rows are `rows` of the fabric; Row 1A and Row 1B are two rows of one side",
            );
        }
        let mut rows = Vec::with_capacity(last);
        let mut flips = 0;
        for number in 1..=last {
            let Some(mut row) = self.rows.remove(&number) else {
                let problem = format!("{} is missing", self.name(number));
                let hint = format!("rows 1 to {} are expected", last.saturating_sub(self.set_up).max(1));
                return Err(KnitSpeakError { line: None, problem, hint });
            };
            let odd = (number + flips) % 2 == 1;
            row.side = if self.round || odd == (self.first_side == Side::Right) { Side::Right } else { Side::Wrong };
            row.round = self.round;
            flips += row.flips();
            if let Some(said) = row.said.filter(|said| *said != row.side && !self.round && flips > 0) {
                let problem = format!(
                    "{} is said to be on the {} side, and turns before it say otherwise",
                    self.name(number),
                    said.name()
                );
                return error(
                    row.line,
                    problem,
                    "a row that turns and goes back ends where it began: the next one is of that side",
                );
            }
            rows.push(row);
        }
        Ok(Instructions {
            set_up: self.set_up.min(rows.len()),
            ending: self.every_few(&rows)?,
            rows,
            again: self.again,
            cast_on: self.cast_on,
            height: self.height,
            ends: self.ends,
        })
    }
}
