//! The closed form of one loop.

use std::f64::consts::TAU;

use super::{CLOSING, DEPTH, Foot, LAYER, LEAN, Piece, Place, STEPS, bobble::PILED, rims};
use crate::{
    math::special::smooth_step,
    pattern::knit::loops::{Loop, Loops},
};

/// Distance of cables that pass each other.
const CABLE: f64 = 2.6;
/// Width of a strand that is lifted between two stitches.
const NARROW: f64 = 0.9;
/// Points of such a strand, in shares of a stitch's: it goes up, crosses itself and comes down again as one.
const LIFTED_BENDS: f64 = 1.3;
/// How wide a stitch is out of which a bobble grows.
const HOLDS_BOBBLE: f64 = 1.35;

/// A loop between its feet and its head.
struct Form<'a> {
    loops: &'a Loops,
    own: &'a Loop,
    foot: Foot,
    /// Its left and right end.
    ends: [Foot; 2],
    /// Width of a stitch of its course.
    step: f64,
    /// The sign of what is drawn through it.
    child: f64,
    /// Where its head is across, and the row that holds it.
    head_at: f64,
    held: i32,
    swap: Option<Swap>,
    /// In shaped cloth, by how many stitches wales lean below its feet and above its head, in a row's height.
    leans: Option<[f64; 2]>,
    /// How deep head and feet dive.
    head_depth: f64,
    foot_depth: f64,
    /// How wide its head is.
    spread: f64,
    /// At which share of its height the legs of a twisted one cross.
    crossing: f64,
    /// How far each end goes over into the neighbour's, radians of the way.
    reach: [f64; 2],
}

/// A place on the way along a loop.
struct Along {
    /// From 0 to a turn.
    t: f64,
    /// The share of the loop's height, and how much it belongs to the head there.
    head: f64,
    upper: f64,
    /// 0 at the end of the loop, 1 where it is its own.
    inside: f64,
    /// -1 on the left leg, 1 on the right, and the end of that leg.
    side: f64,
    end: Foot,
}

impl Along {
    /// A value at the foot and one at the head.
    fn mix(&self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.upper
    }
}

impl<'a> Form<'a> {
    fn new(loops: &'a Loops, own: &'a Loop, foot: Foot, ends: [Foot; 2], step: f64) -> Self {
        let over = own.sign == 0.0;
        let children = || own.children.iter().map(|&c| &loops.loops[c as usize]);
        let count = own.children.len().max(1) as f64;
        let border = loops.border;
        let head_at = own.at + mean(children().map(|c| border.short(c.foot - own.at))).unwrap_or(0.0);
        let spread = match over && own.side != 0.0 {
            // Cast on for both layers, it is as wide as others where its layer is alone.
            true => 2.0,
            false if children().any(|c| c.bobble) => HOLDS_BOBBLE,
            false if loops.is_drawn(own) => rims::PINCHED,
            false => 1.0 + 0.8 * (count - 1.0),
        };
        let crossing = match over {
            true if own.is_lifted() => 0.46,
            true => 0.35,
            false => 0.5,
        };
        let through_strand = loops.is_of_strand(own);
        let mut form = Self {
            loops,
            own,
            foot,
            ends,
            step,
            child: loops.child_sign(own),
            head_at,
            held: own.held.unwrap_or(own.row + 1),
            swap: None,
            leans: loops
                .is_shaped()
                .then(|| [loops.lean_below(own), loops.lean_above(own)].map(|lean| lean.unwrap_or(head_at - foot.at))),
            head_depth: DEPTH + LAYER * f64::from(own.rank),
            foot_depth: loops.foot_depth(own),
            // Its head is as wide as what is drawn through it.
            spread: spread * mean(children().map(|c| c.wide)).unwrap_or(1.0),
            crossing,
            // A tuck stays on its side of the stitch that it is worked with, and so does what is drawn through a lifted strand.
            reach: ends.map(|end| match (over && own.rank > 0) || end.through || through_strand {
                true => TAU / 14.0,
                false => TAU / 6.0,
            }),
        };
        form.swap = loops.swap(own, form.head_up(head_at) - form.foot_up(head_at), head_at - foot.at);
        form.head_depth = form.swap.map_or(form.head_depth, |s| s.depth);
        form
    }

    /// How far up its head is at a place across.
    fn head_up(&self, at: f64) -> f64 {
        let bound = self.own.held == Some(self.own.row);
        match self.loops.is_drawn(self.own) {
            true => self.loops.ring(at) + rims::BEYOND,
            false => self.loops.up_at(self.held, at) + self.loops.reach() + if bound { 0.5 } else { 0.0 },
        }
    }

    /// How far up its foot is at a place across: where rows are short a row may climb along a stitch.
    fn foot_up(&self, at: f64) -> f64 {
        let level = self.loops.up_at(self.own.row, self.foot.at);
        self.foot.up + (self.loops.up_at(self.own.row, at) - level)
    }

    fn along(&self, k: usize) -> Along {
        let t = TAU * k as f64 / STEPS as f64;
        let head = 0.5 - 0.5 * t.cos();
        let (side, end, reach) = match k <= STEPS / 2 {
            true => (-1.0, self.ends[0], self.reach[0]),
            false => (1.0, self.ends[1], self.reach[1]),
        };
        let (upper, inside) = (smooth_step((head - 0.3) / 0.4), smooth_step(t.min(TAU - t) / reach));
        Along { t, head, upper, inside, side, end }
    }

    fn place(&self, along: &Along) -> Place {
        let at = self.across(along);
        let low = self.foot_up(at);
        let Along { head, inside, end, .. } = along;
        let up = low + (self.head_up(at) - low) * head + (1.0 - inside) * (end.up - self.foot_up(end.at));
        Place { at, up, out: self.out(along) }
    }

    /// Where its middle is in shaped cloth, at a share of its height: it follows its wale from row to row.
    fn leaning(&self, [below, above]: [f64; 2], head: f64) -> f64 {
        let base = self.loops.up(self.own.row);
        let rows = self.loops.up(self.held) - base;
        let up = self.foot.up + (self.head_up(self.foot.at) - self.foot.up) * head - base;
        let lean = self.head_at - self.foot.at;
        let share = (up / rows.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        self.foot.at + below * up.min(0.0) + lean * share + above * (up - rows).max(0.0)
    }

    /// How far across it is.
    fn across(&self, along: &Along) -> f64 {
        let &Along { t, head, upper, inside, side, end } = along;
        let Self { own, foot, step, head_at, crossing, .. } = *self;
        let turned = if own.twist == 0.0 { 1.0 } else { 1.0 - 2.0 * smooth_step((head - crossing) / 0.24 + 0.5) };
        let wide = match own.is_lifted() {
            true => NARROW,
            // What closes a bobble goes through heads that lie close.
            false => along.mix(if own.bobble { CLOSING } else { own.wide }, self.spread),
        };
        let lean = if own.sign == 0.0 { 0.5 } else { 1.0 } * LEAN;
        let across = (t / TAU - 0.5 + lean * (2.0 * t).sin()) * wide * turned;
        // Layers that are bound off together are beside each other before what closes them comes through.
        let bound_off = self.loops.border.finished && self.held == self.loops.rows;
        let behind = if own.side != 0.0 && bound_off { smooth_step((head - 0.2) / 0.4) } else { upper };
        let middle = match (self.swap, self.leans) {
            (Some(swap), _) => foot.at + (head_at - foot.at) * swap.moved(head),
            (None, Some(leans)) => self.leaning(leans, head),
            (None, None) => foot.at + (head_at - foot.at) * behind,
        };
        middle + step * across + (1.0 - inside) * (end.at - (foot.at + side * 0.5 * step * own.wide))
    }

    /// How far out of the cloth it is.
    fn out(&self, along: &Along) -> f64 {
        let &Along { t, head, upper, inside, side, end } = along;
        let own = self.own;
        let mut out = if own.sign == 0.0 {
            laid_over(own, self.child, [self.foot.out, self.head_depth], head)
        } else {
            let cos2 = (2.0 * t).cos();
            let deep = |depth: f64| if cos2 > 0.0 { depth } else { DEPTH };
            along.mix(-own.sign * deep(self.foot_depth), -self.child * deep(self.head_depth)) * cos2
        };
        out += self.swap.map_or(0.0, |s| s.raised(head)) + self.loops.layer(own, head);
        if self.loops.is_drawn(own) {
            out += (Loops::around(t / TAU) - out) * upper;
        }
        if own.bobble {
            // The last one of those that it is drawn through lies in the cloth.
            out += PILED * (1.0 - smooth_step((head - 0.42) / 0.16));
        }
        if own.twist != 0.0 {
            let bump = 1.0 - smooth_step((head - self.crossing).abs() / 0.25);
            out += side * own.twist * 0.55 * bump;
        }
        out + (1.0 - inside) * (end.out - self.foot.out)
    }
}

/// How far out a loop is that was laid over the needle, at a share of its height.
fn laid_over(own: &Loop, child: f64, [foot, head_depth]: [f64; 2], head: f64) -> f64 {
    let legs = if own.rank > 0 { 0.12 } else { 0.06 };
    // A lifted strand stays on its side of the heads of the row below.
    let [from, over] = match own.is_lifted() {
        true if own.layer == child => [0.5, 0.25],
        true => [0.3, 0.2],
        false => [0.0, 0.5],
    };
    let (low, high) = (smooth_step((head - from) / over), smooth_step(2.0 * head - 1.0));
    foot * (1.0 - low) - child * (legs * low + (head_depth - legs) * high)
}

/// None of nothing.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// A loop on its way to where it is worked passes others, between the heads of its own row and the feet of that above.
#[derive(Clone, Copy)]
struct Swap {
    /// From which share of its height on; it ends as far from the other end.
    from: f64,
    /// How far in front of the others it passes.
    front: f64,
    /// How far it lies over the last of those that are worked together with it, up to its head.
    over: f64,
    /// How deep its head dives without that.
    depth: f64,
}

impl Swap {
    /// The share of its height in which it comes forward, and goes back again.
    fn ramp(self) -> f64 {
        0.25 * (1.0 - 2.0 * self.from)
    }

    /// How much of the way across is behind it at a share of its height.
    fn moved(self, head: f64) -> f64 {
        smooth_step((head - self.from - self.ramp()) / (2.0 * self.ramp()))
    }

    /// How far it is in front there.
    fn raised(self, head: f64) -> f64 {
        let by = |off: f64| smooth_step((off - self.from) / self.ramp());
        self.front * by(head.min(1.0 - head)) + self.over * by(head)
    }
}

impl Loops {
    /// The yarn of a loop that is worked in a column, from end to end.
    pub(super) fn loop_piece(&self, own: &Loop, column: u32, foot: Foot, ends: [Foot; 2], step: f64) -> Piece {
        let form = Form::new(self, own, foot, ends, step);
        let at = |k: usize| {
            let along = form.along(k);
            let grid = [column as f32 + (along.t / TAU) as f32, own.row as f32 + 0.02 + 0.96 * along.head as f32];
            (form.place(&along), grid)
        };
        let (places, grid) = (0..=STEPS).map(at).unzip();
        let bends = if own.is_lifted() { LIFTED_BENDS } else { own.yarn };
        Piece { places, grid, yarn: own.yarn, bends }
    }

    /// By how many stitches a loop leans from those of the row below that it is drawn through, if they have not changed places.
    fn lean_below(&self, own: &Loop) -> Option<f64> {
        let parents = own.parents.iter().map(|&p| &self.loops[p as usize]);
        let parents = parents.filter(|p| p.row < own.row && own.layer == 0.0);
        let leans = parents.map(|p| (own.foot - p.at) / f64::from(own.row - p.row));
        mean(leans)
    }

    /// By how many stitches what is drawn through a loop leans on its way up.
    fn lean_above(&self, own: &Loop) -> Option<f64> {
        let of = |child: &Loop| {
            let next = child.children.iter().map(|&c| &self.loops[c as usize]);
            let next = next.filter(|c| c.row > child.row && c.layer == 0.0);
            mean(next.map(|c| (c.foot - child.at) / f64::from(c.row - child.row)))
        };
        mean(own.children.iter().filter_map(|&c| of(&self.loops[c as usize])))
    }

    pub(super) fn child_sign(&self, own: &Loop) -> f64 {
        let sign = own.children.first().map_or(own.sign, |&c| self.loops[c as usize].sign);
        if sign == 0.0 { 1.0 } else { sign }
    }

    /// How a loop so many rows high, worked so far across from its feet, passes those that it changes places with, or that are
    /// worked together with it.
    fn swap(&self, own: &Loop, high: f64, across: f64) -> Option<Swap> {
        const FAR: f64 = 0.6;
        let child = &self.loops[*own.children.first()? as usize];
        let stitches = |d: f64| d.abs() * if self.border.turns { self.wide as f64 } else { 1.0 };
        let together = || child.parents.iter().map(|p| &self.loops[*p as usize]);
        let beside = together().any(|l| stitches(self.border.short(l.at - own.at)) > 0.25);
        let bound = together().any(|l| l.row == child.row);
        let last = (child.parents.len() - 1) as f64;
        let (mut front, mut over, mut depth) = (0.0, 0.0, DEPTH + LAYER * f64::from(own.rank));
        if child.layer != 0.0 {
            front = CABLE * child.layer.max(0.0);
        } else if beside && !bound {
            over = child.sign * LAYER * (last - f64::from(own.rank));
            depth = DEPTH + LAYER * last;
        } else if self.is_shaped() || stitches(across) < FAR {
            return None;
        }
        // Heads reach so far up from the row below, and feet down from that above.
        Some(Swap { from: (2.0 * self.reach() / high).min(0.4), front, over, depth })
    }
}
