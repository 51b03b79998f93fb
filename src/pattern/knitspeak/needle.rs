//! The stitches on the needle, and rows that are worked over them.

use super::{
    Item, KNOWN, Look, MOST_ROUNDS, MOST_STITCHES, Result, Sequence, Side, Steps, Written, brioche, error,
    turns::{Close, Mark, Turned},
};
use crate::pattern::chart::{Act, Chart, Stitch};

/// The stitches on the needle, and the rows below them.
#[derive(Clone)]
pub(super) struct Needle {
    pub(super) found: u32,
    /// Those that the row before has left when it turned.
    pub(super) behind: u32,
    /// The side of the row that comes next.
    pub(super) next: Side,
    /// Which of them show a purl stitch on the right side, from the left, if anyone asks.
    faces: Option<Vec<bool>>,
    /// Which of them lie with a yarn over, likewise.
    overs: Option<Vec<bool>>,
    /// Where rows have turned, and the stitches there are not worked yet.
    marks: Vec<Mark>,
    /// Where the row before has turned: what closes it comes now.
    turned: Option<Mark>,
    /// Whether all wraps are worked with their stitches.
    picks_up: bool,
    pub(super) rows: Vec<String>,
}

impl Needle {
    /// So many stitches that are cast on, for rows that ask for how they look.
    pub(super) fn new(cast_on: u32, rows: &[Written]) -> Self {
        let asks = |what: fn(&Item) -> bool| rows.iter().any(|row| row.body.any(what));
        let looks = asks(|item| matches!(item, Item::Look(Look::Below, _)));
        let is_brioche =
            asks(|item| matches!(item, Item::Steps(s) | Item::Until(s, _) if brioche::takes_over(&s.name)));
        Self {
            found: cast_on,
            behind: 0,
            next: rows.first().map_or(Side::Right, |row| row.side),
            faces: looks.then(Vec::new),
            overs: is_brioche.then(Vec::new),
            marks: Vec::new(),
            turned: None,
            picks_up: false,
            rows: Vec::with_capacity(rows.len()),
        }
    }

    /// Works a row, which is several where it turns and goes on.
    pub(super) fn work(&mut self, row: &Written) -> Result<()> {
        let parts: Vec<&[Item]> = row.body.parts().collect();
        let mut side = row.side;
        for (k, part) in parts.iter().enumerate() {
            let count = row.count.filter(|_| k + 1 == parts.len());
            self.work_part(row, part, side, count)?;
            side = side.other();
        }
        self.next = if row.round || row.slides { side.other() } else { side };
        Ok(())
    }

    fn work_part(&mut self, row: &Written, items: &[Item], side: Side, count: Option<u32>) -> Result<()> {
        let number = self.rows.len() + 1;
        if row.round && items.iter().any(|item| matches!(item, Item::Turn(_))) {
            let problem = format!("row {number} turns, and goes round");
            return error(
                row.line,
                problem,
                "short rows are knitted back and forth: Row 1 (RS), and `form = \"flat\"`",
            );
        }
        let mut place = Place {
            line: row.line,
            row: number,
            side,
            found: self.found,
            left: self.found - self.behind,
            rounds: MOST_ROUNDS,
            faces: self.faces.as_deref().unwrap_or_default(),
            overs: self.overs.as_deref().unwrap_or_default(),
            marks: &self.marks,
            wrapped: Vec::new(),
            picks_up: [self.picks_up; 2],
            turned: None,
            steps: Vec::new(),
        };
        place.begin(self.behind, self.turned.as_ref(), items);
        place.work(self.behind, items)?;
        let Place { steps: worked, left: ahead, wrapped, picks_up: [picks_up, always], turned, .. } = place;
        let made = worked.iter().map(|s| s.makes.saturating_mul(s.count)).fold(0, u32::saturating_add);
        if made == 0 && worked.iter().any(|s| s.name.starts_with("bo")) {
            let problem = format!("row {number} binds off all stitches");
            return error(row.line, problem, "the piece is bound off by a line of its own: Bind off");
        }
        if made == 0 || made > MOST_STITCHES {
            return error(row.line, format!("row {number} makes {made} stitches"), "1 to 20000 fit on a needle");
        }
        if let Some(count) = count.filter(|count| *count != made) {
            let problem = format!("row {number} makes {made} stitches, and says that it has {count}");
            return error(row.line, problem, "another number of `stitches` fits, or the row is another one");
        }
        let text = side.seen_from_right(worked, row.line, number)?;
        self.look(&text);
        let reached = match side {
            Side::Right => ahead..self.found - self.behind,
            Side::Wrong => self.behind..self.found - ahead,
        };
        self.rows.push(text);
        self.picks_up = always;
        let (worked, marks) = std::mem::take(&mut self.marks).into_iter().partition(|m| reached.contains(&m.column));
        self.marks = marks;
        for mark in worked {
            if picks_up || wrapped.contains(&mark.column) {
                self.pick_up(&mark);
            }
        }
        self.marks.extend(self.turned.take());
        self.turned = turned
            .filter(|(close, _)| ahead > 0 || *close == Close::Double)
            .map(|turned| Mark::new(turned, side, [ahead, made], self.rows.len()));
        (self.found, self.behind) = (made, ahead);
        Ok(())
    }

    /// How the stitches look that a row has made, if anyone asks.
    fn look(&mut self, row: &str) {
        if self.faces.is_none() && self.overs.is_none() {
            return;
        }
        let worked = Chart::parse(&[row]).and_then(|chart| chart.work(self.found, 1, u64::MAX)).unwrap_or_default();
        let worked: Vec<Stitch> = worked.into_iter().flatten().filter(|s| s.act != Act::BindOff).collect();
        let below = |of: &[bool], s: &Stitch| of.get(s.first_parent as usize).copied().unwrap_or_default();
        if let Some(faces) = &mut self.faces {
            let face = |s: &Stitch| match s.act {
                Act::Pass { .. } | Act::Tuck | Act::Unworked | Act::Double => below(faces, s),
                Act::Draw | Act::Over | Act::Lift { .. } | Act::Bobble | Act::BindOff | Act::CastOn => s.purl,
            };
            *faces = worked.iter().map(face).collect();
        }
        if let Some(overs) = &mut self.overs {
            let has_over = |s: &Stitch| match s.act {
                Act::Tuck => true,
                Act::Pass { .. } | Act::Unworked | Act::Double => below(overs, s),
                Act::Draw | Act::Over | Act::Lift { .. } | Act::Bobble | Act::BindOff | Act::CastOn => false,
            };
            *overs = worked.iter().map(has_over).collect();
        }
    }

    /// Lifts a wrap onto the needle: its yarn lies over it with the stitch, in place of going back around that.
    fn pick_up(&mut self, mark: &Mark) {
        let Some(row) = self.rows.get_mut(mark.row).filter(|_| mark.close == Close::Wrap) else { return };
        let mut steps: Vec<&str> = row.split(' ').collect();
        let is_worked = |step: &&str| !step.starts_with('-');
        // The row begins with the wrap.
        let first = match mark.side {
            Side::Right => steps.iter().rposition(is_worked),
            Side::Wrong => steps.iter().position(is_worked),
        };
        if let Some(first) = first {
            steps[first] = "ds";
            *row = steps.join(" ");
        }
    }
}

/// How far a row has come.
pub(super) struct Place<'a> {
    line: usize,
    row: usize,
    pub(super) side: Side,
    /// Stitches that it has found, and those that are left.
    pub(super) found: u32,
    pub(super) left: u32,
    /// Rounds of repeats that are left: repeats of what takes no stitch would never end.
    rounds: u32,
    faces: &'a [bool],
    pub(super) overs: &'a [bool],
    pub(super) marks: &'a [Mark],
    /// Wrapped stitches, from the left, that are worked with their wraps.
    pub(super) wrapped: Vec<u32>,
    /// Whether all of this row are, and of those that come.
    picks_up: [bool; 2],
    /// How it is turned.
    turned: Option<Turned>,
    pub(super) steps: Vec<Steps>,
}

impl Place<'_> {
    pub(super) fn wrong<T>(&self, problem: &str, hint: impl Into<String>) -> Result<T> {
        error(self.line, format!("row {} {problem}", self.row), hint)
    }

    pub(super) fn push(&mut self, steps: Steps) {
        match self.steps.last_mut() {
            Some(last) if last.name == steps.name => last.count = last.count.saturating_add(steps.count),
            _ if steps.count > 0 => self.steps.push(steps),
            _ => {}
        }
    }

    /// Works steps that stand in the row, if there are stitches for them.
    fn take(&mut self, steps: &Steps) -> Result<()> {
        let takes = steps.takes.saturating_mul(steps.count);
        if takes > self.left {
            let problem = format!("needs {takes} stitches for {}, {} are left", steps.name, self.left);
            return self.wrong(&problem, "another number of `stitches` fits");
        }
        brioche::check(self, steps)?;
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
    fn work(&mut self, behind: u32, items: &[Item]) -> Result<()> {
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
                    if takes == 0 || room == 0 || !room.is_multiple_of(takes) {
                        let rest = room.checked_rem(takes).unwrap_or(0);
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

impl Steps {
    /// So many stitches, each of one.
    pub(super) fn of(name: &str, count: u32) -> Self {
        Self { name: name.to_owned(), takes: 1, makes: 1, count }
    }
}

impl Sequence {
    /// Whether any of its items, in repeats too, is of a kind.
    pub(super) fn any(&self, is: fn(&Item) -> bool) -> bool {
        self.0.iter().any(|item| match item {
            Item::Times(sequence, _) | Item::Repeat(sequence, _) => sequence.any(is),
            item => is(item),
        })
    }

    /// Whether the yarn turns in it.
    pub(super) fn turns(&self) -> bool {
        self.any(|item| matches!(item, Item::Turn(_)))
    }

    /// What is worked from turn to turn.
    pub(super) fn parts(&self) -> impl Iterator<Item = &[Item]> {
        self.0.split_inclusive(|item| matches!(item, Item::Turn(_)))
    }

    pub(super) fn takes(&self) -> u32 {
        let of = |item: &Item| match item {
            Item::Steps(steps) | Item::Wrapped(steps) | Item::Doubled(steps) => steps.takes.saturating_mul(steps.count),
            Item::Times(sequence, times) => sequence.takes().saturating_mul(*times),
            Item::Until(..) | Item::Look(..) | Item::Repeat(..) => 0,
            Item::Turn(_) | Item::PickUp { .. } | Item::Slide => 0,
        };
        self.0.iter().map(of).fold(0, u32::saturating_add)
    }
}
