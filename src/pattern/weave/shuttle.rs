//! Shuttles: every yarn of the weft has its own, and so has every layer of the cloth. A pick starts at the side where its
//! shuttle lies, which waits at the other while others are thrown, and is carried up the selvedge to its next pick.

/// Picks of others past which a yarn is carried; it is cut where there are more.
const LONGEST_CARRY: u32 = 12;
/// Yarns that are carried beside each other; one that would be more is cut.
const MOST_CARRIED: u8 = 3;

/// A pick on the way of its shuttle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pass {
    /// Which pick of the cloth.
    pub(super) pick: u32,
    /// Whether the shuttle goes to the right.
    pub(super) right: bool,
    /// How the yarn goes on to the next pass; `None` where it ends.
    pub(super) turn: Option<Turn>,
}

/// The way of a yarn from one pick to its next, at the side where the first ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Turn {
    /// The next pick.
    pub(super) to: u32,
    /// Picks of others that it passes.
    pub(super) past: u32,
    /// 1 beside the outermost warp, more around yarns that are carried there.
    pub(super) lane: u32,
}

/// The ways of all shuttles through a cloth.
#[derive(Clone, Debug)]
pub(super) struct Shuttles {
    /// Yarns from end to end, by their first picks.
    pub(super) yarns: Vec<Vec<Pass>>,
    /// Whether each pick goes to the right.
    right: Vec<bool>,
    /// For picks that end at the left, and at the right: from which their yarn comes.
    before: [Vec<Option<u32>>; 2],
}

/// A turn on its side.
#[derive(Clone, Copy)]
struct Held {
    from: u32,
    turn: Turn,
}

impl Shuttles {
    /// Of picks that are each of a yarn (the number of its shuttle). Pick i turns together with those of its layer, i + k
    /// `layers`. All begin at the left.
    pub(super) fn new(yarn: &[u32], layers: u32) -> Self {
        let count = yarn.iter().max().map_or(0, |most| *most as usize + 1);
        let mut last: Vec<Option<u32>> = vec![None; count];
        let mut right = vec![true; yarn.len()];
        let mut turns: [Vec<Held>; 2] = Default::default();
        for (pick, &yarn) in (0u32..).zip(yarn) {
            if let Some(from) = last[yarn as usize].replace(pick) {
                right[pick as usize] = !right[from as usize];
                let past = (pick - from) / layers - 1;
                turns[usize::from(right[from as usize])].push(Held { from, turn: Turn { to: pick, past, lane: 0 } });
            }
        }
        let mut lanes = vec![None; yarn.len()];
        let mut before = [vec![None; yarn.len()], vec![None; yarn.len()]];
        for (before, turns) in before.iter_mut().zip(turns) {
            for Held { from, turn } in with_lanes(carried(turns, yarn.len(), layers), layers) {
                lanes[from as usize] = Some(turn);
                before[turn.to as usize] = Some(from);
            }
        }
        let mut yarns: Vec<Vec<Pass>> = Vec::new();
        let mut of_pick = vec![0; yarn.len()];
        for pick in 0..yarn.len() {
            let from = before.iter().find_map(|b| b[pick]);
            of_pick[pick] = from.map_or(yarns.len(), |from: u32| of_pick[from as usize]);
            if from.is_none() {
                yarns.push(Vec::new());
            }
            yarns[of_pick[pick]].push(Pass { pick: pick as u32, right: right[pick], turn: lanes[pick] });
        }
        Self { yarns, right, before }
    }

    /// Turns at a side, as first and next pick.
    pub(super) fn turns(&self, right: bool) -> impl Iterator<Item = [u32; 2]> + '_ {
        let before = self.before[usize::from(right)].iter().enumerate();
        before.filter_map(|(to, from)| from.map(|from| [from, to as u32]))
    }

    /// Whether each pick goes under the outermost warp of a side, so that this holds each turn: over it as it enters, under it
    /// as it leaves. In a rib sheds change only where a turn asks for it.
    pub(super) fn under(&self, right: bool, rib: bool) -> Vec<bool> {
        if !rib {
            return self.right.iter().map(|r| *r == right).collect();
        }
        let mut under: Vec<bool> = Vec::with_capacity(self.right.len());
        for from in &self.before[usize::from(right)] {
            let before = under.last().copied().unwrap_or(true);
            under.push(from.map_or(before, |from| !under[from as usize]));
        }
        under
    }
}

/// The turns of a side but for those where the yarn is cut.
fn carried(mut turns: Vec<Held>, picks: usize, layers: u32) -> Vec<Held> {
    // Short ways come first.
    turns.sort_by_key(|t| (t.turn.past, t.from));
    let mut beside = vec![0u8; picks];
    turns.retain(|Held { from, turn }| {
        let way = || (*from..turn.to).step_by(layers as usize).map(|pick| pick as usize);
        let fits = turn.past <= LONGEST_CARRY && (turn.past == 0 || way().all(|pick| beside[pick] < MOST_CARRIED));
        if fits && turn.past > 0 {
            way().for_each(|pick| beside[pick] += 1);
        }
        fits
    });
    turns
}

/// Gives each turn of a side its lane: two that overlap have different ones, and what begins and ends while another is
/// carried goes around it, so that it is caught.
fn with_lanes(mut turns: Vec<Held>, layers: u32) -> Vec<Held> {
    turns.sort_by_key(|t| (std::cmp::Reverse(t.turn.past), t.from));
    let picks = turns.iter().map(|t| t.turn.to + 1).max().unwrap_or(0);
    let mut laid: Vec<Option<Turn>> = vec![None; picks as usize];
    for Held { from, turn } in &mut turns {
        let nearest = from.saturating_sub((LONGEST_CARRY + 1) * layers);
        let others = (nearest..turn.to).filter(|other| (other % layers) == *from % layers);
        let beside: Vec<(u32, Turn)> =
            others.filter_map(|o| Some((o, laid[o as usize]?))).filter(|(_, o)| o.to > *from).collect();
        let around = beside.iter().filter(|(o, other)| o < from && other.to > turn.to).map(|(_, o)| o.lane).max();
        let first = around.map_or(1, |lane| lane + 1);
        turn.lane = (first..).find(|lane| beside.iter().all(|(_, o)| o.lane != *lane)).unwrap_or(first);
        laid[*from as usize] = Some(*turn);
    }
    turns
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(order: &str, picks: usize) -> Shuttles {
        let yarns: Vec<u32> = order.bytes().cycle().take(picks).map(|b| u32::from(b - b'a')).collect();
        Shuttles::new(&yarns, 1)
    }

    /// Whether the outermost warp holds each turn: over it on one way, under it on the other.
    fn all_held(shuttles: &Shuttles, rib: bool) -> bool {
        [false, true].into_iter().all(|right| {
            let under = shuttles.under(right, rib);
            shuttles.turns(right).all(|[from, to]| under[from as usize] != under[to as usize])
        })
    }

    #[test]
    fn one_yarn_goes_to_and_fro() {
        let shuttles = of("a", 5);
        assert_eq!(shuttles.yarns.len(), 1);
        assert_eq!(shuttles.yarns[0].iter().map(|p| p.right).collect::<Vec<_>>(), [true, false, true, false, true]);
        assert!(shuttles.yarns[0].iter().all(|p| p.turn.is_none_or(|t| (t.past, t.lane) == (0, 1))));
        assert_eq!(shuttles.under(true, false), [true, false, true, false, true]);
        assert_eq!(shuttles.under(true, true), [true, false, false, true, true]);
        assert_eq!(shuttles.under(false, true), [true, true, false, false, true]);
    }

    #[test]
    fn each_yarn_starts_where_its_shuttle_lies() {
        // Two picks of each: both always come back to the left.
        let pairs = of("aabb", 12);
        assert_eq!(pairs.yarns.len(), 2);
        assert!(pairs.yarns.iter().flatten().all(|p| p.right == p.pick.is_multiple_of(2)));
        assert_eq!(pairs.turns(true).count(), 6);
        // One pick of each: they wait on the same side by turns; three and one: on either.
        let single = of("ab", 8);
        assert_eq!(single.yarns[1].iter().map(|p| p.right).collect::<Vec<_>>(), [true, false, true, false]);
        let odd = of("aaab", 8);
        let directions = |yarn: usize| odd.yarns[yarn].iter().map(|p| p.right).collect::<Vec<_>>();
        assert_eq!(directions(0), [true, false, true, false, true, false]);
        assert_eq!(directions(1), [true, false]);
    }

    #[test]
    fn every_turn_is_held() {
        for order in ["a", "ab", "aab", "abb", "aabb", "aaab", "abc", "aaaabbbbc", "aaaaaaaaaaaaaaaaab", "abcde"] {
            for picks in [1, 2, 7, 40] {
                assert!(all_held(&of(order, picks), false) && all_held(&of(order, picks), true), "{order} {picks}");
            }
        }
    }

    #[test]
    fn what_turns_while_a_yarn_is_carried_goes_around_it() {
        // The second yarn turns twice at the left while the first is carried there.
        let shuttles = of("aabbbb", 12);
        let turn = |pick: u32| shuttles.yarns.iter().flatten().find(|p| p.pick == pick).unwrap().turn.unwrap();
        assert_eq!(turn(1), Turn { to: 6, past: 4, lane: 1 });
        assert_eq!(turn(3), Turn { to: 4, past: 0, lane: 2 });
        assert_eq!(turn(0).lane, 1);
        // Lanes of turns that overlap differ, and there are no more than are carried and one around them.
        for order in ["ab", "abc", "abcd", "abcdef", "aabbcc", "aaabbbccc", "abacabad"] {
            let shuttles = of(order, 60);
            for right in [false, true] {
                let turns: Vec<_> = shuttles.yarns.iter().flatten().filter(|p| p.right == right).collect();
                let turns = turns.iter().filter_map(|p| Some((p.pick, p.turn?))).collect::<Vec<_>>();
                for (i, (a, s)) in turns.iter().enumerate() {
                    assert!(s.lane <= u32::from(MOST_CARRIED) + 2, "{order} {s:?}");
                    let beside = turns[i + 1..].iter().filter(|(b, t)| *a < t.to && *b < s.to);
                    assert!(beside.into_iter().all(|(_, t)| t.lane != s.lane), "{order}: {a} {s:?}");
                }
            }
        }
    }

    #[test]
    fn long_ways_are_cut() {
        let order = |others: usize| format!("aa{}", "b".repeat(others));
        assert_eq!(of(&order(12), 56).yarns.len(), 2);
        // Four times two picks, each a yarn of its own.
        let cut = of(&order(14), 64);
        assert_eq!(cut.yarns.len(), 1 + 4);
        // The shuttle lies where it was.
        assert!(cut.yarns.iter().filter(|y| y.len() == 2).all(|y| y[0].right && !y[1].right));
        // Not more than three are carried beside each other.
        assert!(of("abcdefgh", 64).yarns.len() > 8);
    }

    #[test]
    fn layers_turn_by_themselves() {
        let yarns: Vec<u32> = (0..12).map(|i| i % 2).collect();
        let shuttles = Shuttles::new(&yarns, 2);
        assert_eq!(shuttles.yarns.len(), 2);
        assert!(shuttles.yarns.iter().flatten().all(|p| p.turn.is_none_or(|t| (t.past, t.lane) == (0, 1))));
    }
}
