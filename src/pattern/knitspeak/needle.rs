//! The stitches on the needle, and rows that are worked over them.

use super::{
    Item, Look, MOST_ROUNDS, MOST_STITCHES, Result, Sequence, Side, Written, brioche, error,
    place::Place,
    stitches_that_fit,
    turns::{Close, Mark},
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
            return error(row.line, format!("row {number} makes {made} stitches"), stitches_that_fit());
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
