//! Runs of stitches, and in which order a yarn goes through them.

use super::lattice::Lattice;

/// A yarn goes on over so many stitches, then another begins: pieces of work for all threads.
const LONGEST: usize = 6000;
/// A row's end and the next row's are joined if they are no further apart, in stitches.
const FURTHEST: usize = 3;

/// A run of stitches of a line, walked forwards or backwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    pub(super) line: usize,
    pub(super) first: usize,
    pub(super) last: usize,
    pub(super) backwards: bool,
    /// It goes round and meets itself.
    pub(super) ring: bool,
}

impl Run {
    /// The corner at which it ends, in stitches.
    pub(super) fn end(&self) -> usize {
        if self.backwards { self.first } else { self.last }
    }

    /// The corner at which it starts.
    pub(super) fn start(&self) -> usize {
        if self.backwards { self.last } else { self.first }
    }
}

/// Runs of an axis, each joined to the nearest of the next line. Of a weave only wefts are, at selvedges: warps end, and so
/// does what was cut to be sewn.
pub(super) fn chains(lattice: &Lattice, axis: usize, woven: bool) -> Vec<Vec<Run>> {
    let turns = |run: &Run| !woven || (axis == 0 && lattice.is_free(run.end(), run.line + 1));
    let mut done: Vec<Vec<Run>> = Vec::new();
    let mut open: Vec<Vec<Run>> = Vec::new();
    for line in 0..lattice.counts[1 - axis] {
        let mut next: Vec<Vec<Run>> = Vec::new();
        let mut waiting = std::mem::take(&mut open);
        for [first, last] in lattice.runs(axis, line) {
            let ring = axis == 0 && lattice.ring && last - first == lattice.counts[0];
            if ring {
                done.push(vec![Run { line, first, last, backwards: false, ring }]);
                continue;
            }
            let mate = waiting.iter().position(|chain| {
                let before = chain[chain.len() - 1];
                let backwards = !before.backwards;
                let start = if backwards { last } else { first };
                let length: usize = chain.iter().map(|r| r.last - r.first).sum();
                start.abs_diff(before.end()) <= FURTHEST && length < LONGEST && turns(&before)
            });
            let mut chain = mate.map_or_else(Vec::new, |i| waiting.remove(i));
            let backwards = chain.last().is_some_and(|run| !run.backwards);
            chain.push(Run { line, first, last, backwards, ring });
            next.push(chain);
        }
        done.append(&mut waiting);
        open = next;
    }
    done.append(&mut open);
    done
}
