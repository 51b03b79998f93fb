//! A row on its way over the stitches on the needle.

use super::{
    Item, KNOWN, Look, MOST_ROUNDS, MOST_STITCHES, Result, Side, Steps, brioche, error,
    turns::{Close, Mark, Marked, Stop, Turn, Turned},
};

/// How far a row has come.
pub(super) struct Place<'a> {
    pub(super) line: usize,
    pub(super) row: usize,
    pub(super) side: Side,
    /// Stitches that it has found, and those that are left.
    pub(super) found: u32,
    pub(super) left: u32,
    /// Rounds of repeats that are left: repeats of what takes no stitch would never end.
    pub(super) rounds: u32,
    pub(super) faces: &'a [bool],
    pub(super) overs: &'a [bool],
    pub(super) marks: &'a [Mark],
    /// Wrapped stitches, from the left, that are worked with their wraps.
    pub(super) wrapped: Vec<u32>,
    /// Whether all of this row are, and of those that come.
    pub(super) picks_up: [bool; 2],
    /// How it is turned.
    pub(super) turned: Option<Turned>,
    pub(super) steps: Vec<Steps>,
}

impl Place<'_> {
    fn wrong<T>(&self, problem: &str, hint: impl Into<String>) -> Result<T> {
        error(self.line, format!("row {} {problem}", self.row), hint)
    }

    fn push(&mut self, steps: Steps) {
        match self.steps.last_mut() {
            Some(last) if last.name == steps.name => last.count = last.count.saturating_add(steps.count),
            _ if steps.count > 0 => self.steps.push(steps),
            _ => {}
        }
    }

    /// Whether one of the stitches that each step takes has a yarn over, where it is of brioche; those that are cast on have none, and are
    /// worked as they are.
    fn has_overs(&self, steps: &Steps) -> Result<()> {
        if self.overs.is_empty() || !brioche::takes_over(&steps.name) {
            return Ok(());
        }
        let has_over = |at: u32| {
            let column = if self.side == Side::Right { self.found.checked_sub(at + 1) } else { Some(at) };
            column.and_then(|column| self.overs.get(column as usize)).copied().unwrap_or_default()
        };
        let first = self.found - self.left;
        for k in 0..steps.count {
            let own = first + k * steps.takes..first + (k + 1) * steps.takes;
            if !own.clone().any(has_over) {
                let problem = format!("works {} where stitch {} has no yarn over", steps.name, own.start + 1);
                return self
                    .wrong(&problem, "it is slipped with one in the row before: sl1yo; without one it is k1 or p1");
            }
        }
        Ok(())
    }

    /// Works steps that stand in the row, if there are stitches for them.
    fn take(&mut self, steps: &Steps) -> Result<()> {
        let takes = steps.takes.saturating_mul(steps.count);
        if takes > self.left {
            let problem = format!("needs {takes} stitches for {}, {} are left", steps.name, self.left);
            return self.wrong(&problem, "another number of `stitches` fits");
        }
        self.has_overs(steps)?;
        self.left -= takes;
        self.push(brioche::charted(steps));
        Ok(())
    }

    /// Knits the next stitches, or purls them.
    fn look(&mut self, look: Look, count: u32) -> Result<()> {
        if look == Look::Below && self.faces.is_empty() {
            return self
                .wrong("is the first one, and no stitches are there to look at", "say which are knitted: k2, p2");
        }
        for _ in 0..count {
            let at = (self.found - self.left) as usize;
            let purl = match (look, self.side) {
                (Look::Below, Side::Right) => self.faces.iter().rev().nth(at).copied().unwrap_or_default(),
                (Look::Below, Side::Wrong) => self.faces.get(at).copied().unwrap_or_default(),
                (look, _) => look == Look::Purl,
            };
            let name = if purl == (self.side == Side::Right) { "p" } else { "k" };
            self.push(Steps::of(name, 1));
            self.left -= 1;
        }
        Ok(())
    }

    /// Works a row that begins where `behind` stitches were left.
    pub(super) fn work(&mut self, behind: u32, items: &[Item]) -> Result<()> {
        self.follow(items)?;
        let left = self.left;
        if left > 0 && self.turned.is_none() {
            let problem = format!("leaves {left} of {} stitches unworked", self.found - behind);
            return self.wrong(&problem, "rep from * to end, `turn` for a short row, or another number of `stitches`");
        }
        let wraps = u32::from(self.turned.is_some_and(|(close, _)| close == Close::Wrap));
        self.push(Steps::of("-", left - wraps));
        Ok(())
    }

    fn follow(&mut self, items: &[Item]) -> Result<()> {
        let Some(fewer) = self.rounds.checked_sub(1) else {
            return self.wrong(&format!("repeats more than {MOST_ROUNDS} times"), "fewer repeats");
        };
        self.rounds = fewer;
        for item in items {
            match item {
                Item::Steps(steps) => self.take(steps)?,
                Item::Until(steps, stop) => {
                    let room = self.room(*stop)?;
                    if steps.takes == 0 || !room.is_multiple_of(steps.takes) {
                        return self.wrong(&format!("has {room} stitches, which {} does not fit", steps.name), KNOWN);
                    }
                    self.take(&Steps { count: room / steps.takes, ..steps.clone() })?;
                }
                Item::Look(look, stop) => {
                    let room = self.room(*stop)?;
                    self.look(*look, room)?;
                }
                Item::Turn(turn) => self.turned = Some(self.turn(turn)?),
                Item::Wrapped(steps) => {
                    self.wrapped(steps.count)?;
                    self.take(steps)?;
                }
                Item::Doubled(steps) => {
                    self.doubled(steps.count)?;
                    self.take(steps)?;
                }
                Item::PickUp { always } => {
                    self.picks_up[0] = true;
                    self.picks_up[1] |= always;
                }
                Item::Slide => {}
                Item::Times(sequence, times) => {
                    for _ in 0..*times {
                        self.follow(&sequence.0)?;
                    }
                }
                Item::Repeat(sequence, stop) => {
                    let takes = sequence.takes();
                    let room = self.room(*stop)?;
                    if takes == 0 {
                        let problem = "repeats what works none of the stitches that it finds, to no end";
                        return self.wrong(problem, "as in *k1, yo; rep from * to end, or say how often");
                    }
                    if room == 0 || !room.is_multiple_of(takes) {
                        let rest = room % takes;
                        let problem = format!("repeats over {takes} stitches, but has {room} for it");
                        let fewer = if rest > 0 && room > rest {
                            format!("{rest} fewer `stitches`, or ")
                        } else {
                            String::new()
                        };
                        return self.wrong(&problem, format!("{fewer}{} more `stitches` fit", takes - rest));
                    }
                    for _ in 0..room / takes {
                        self.follow(&sequence.0)?;
                    }
                }
            }
            if self.steps.len() > MOST_STITCHES as usize {
                return self.wrong(&format!("has more than {MOST_STITCHES} steps"), "fewer repeats");
            }
        }
        Ok(())
    }
}

/// Turns, and what rows come to where others have turned.
impl Place<'_> {
    /// Begins the row where the one before has turned, and closes the turn.
    pub(super) fn begin(&mut self, behind: u32, turned: Option<&Mark>, items: &[Item]) {
        match turned {
            Some(mark) if mark.close == Close::Wrap => {
                self.push(Steps::of("-", behind.saturating_sub(1)));
                self.push(Steps::of(mark.passing, 1));
            }
            Some(mark) if mark.close == Close::Double && !is_double(items.first()) => {
                self.push(Steps::of("-", behind));
                self.push(Steps::of("ds", 1));
                self.left = self.left.saturating_sub(1);
            }
            _ => self.push(Steps::of("-", behind)),
        }
    }

    /// Turns, and gives how that is closed.
    fn turn(&mut self, turn: &Turn) -> Result<Turned> {
        let (left, passing) = (self.left, passing(self.steps.last()));
        if let Some(leaves) = turn.leaves.filter(|leaves| *leaves != left) {
            let problem = format!("turns beside {left} stitches, and says that it leaves {leaves}");
            return self.wrong(&problem, "another number of `stitches` fits, or the row is another one");
        }
        if turn.close == Close::Wrap {
            if left == 0 {
                return self.wrong("has no stitch left to wrap (w&t)", "it ends at the edge: `turn`, or nothing");
            }
            self.push(Steps::of(passing, 1));
        }
        Ok((turn.close, passing))
    }

    /// The places of what is marked ahead: the stitch, and the gap.
    fn ahead(&self, of: Marked) -> impl Iterator<Item = [u32; 2]> {
        let at = self.found - self.left;
        let places = self.marks.iter().filter(move |mark| of.is(mark)).filter_map(|m| m.places(self.side, self.found));
        places.filter(move |[stitch, gap]| if of == Marked::Gap { *gap >= at } else { *stitch >= at })
    }

    /// How many stitches are worked until a stop.
    fn room(&self, stop: Stop) -> Result<u32> {
        let (of, before, past) = match stop {
            Stop::Left(last) => return Ok(self.left.saturating_sub(last)),
            Stop::Before(of, count) => (of, count, None),
            Stop::Past(of, count) => (of, 0, Some(count)),
        };
        let at = self.found - self.left;
        let places = self.ahead(of).map(|[stitch, gap]| if of == Marked::Gap { gap } else { stitch });
        let Some(place) = places.min() else {
            return self.wrong(&format!("comes to no {}", of.name()), "say how many stitches: k5, or k to last 5 sts");
        };
        let to = place - at;
        // The stitch itself is worked too.
        let own = if past.is_some() && of != Marked::Gap { 1 } else { 0 };
        let behind = self.left.saturating_sub(to + own);
        match (past, to.checked_sub(before)) {
            (Some(past), _) if past <= behind => Ok(to + own + past),
            (Some(past), _) => {
                self.wrong(&format!("has {behind} stitches behind the {}, not {past}", of.name()), "fewer of them")
            }
            (None, Some(room)) => Ok(room),
            (None, None) => {
                let problem = format!("has {to} stitches before the {}, not {before}", of.name());
                self.wrong(&problem, "fewer of them, or `turn`")
            }
        }
    }

    /// Whether wraps lie around the next stitches, which are worked with them.
    fn wrapped(&mut self, count: u32) -> Result<()> {
        let at = self.found - self.left;
        for place in at..at + count.min(self.left) {
            if !self.ahead(Marked::Wrapped).any(|[stitch, _]| stitch == place) {
                return self.wrong(
                    &format!("has no wrap around stitch {}", place + 1),
                    "w&t wraps the stitch behind the turn",
                );
            }
            self.wrapped.push(if self.side == Side::Right { self.found - 1 - place } else { place });
        }
        Ok(())
    }

    /// Whether the next stitches are double ones.
    fn doubled(&mut self, count: u32) -> Result<()> {
        let at = self.found - self.left;
        match (at..at + count.min(self.left)).find(|p| !self.ahead(Marked::Double).any(|[stitch, _]| stitch == *p)) {
            Some(place) => {
                let problem = format!("has no double stitch where stitch {} is", place + 1);
                self.wrong(&problem, "a row that turns makes the first stitch of the next one double")
            }
            None => Ok(()),
        }
    }
}

/// Which way the yarn passes the stitch that it wraps, first on its way there and then back, both as the knitter sees it: where
/// it is after the last stitch.
fn passing(last: Option<&Steps>) -> &'static str {
    match last {
        Some(steps) if steps.name.starts_with('p') => "slwyif",
        _ => "sl",
    }
}

fn is_double(item: Option<&Item>) -> bool {
    matches!(item, Some(Item::Steps(steps)) if steps.name == "ds")
}
