//! What holds the stitches of a net: those beside each other, what each is drawn through, and what keeps rows and wales straight and
//! square to each other. The net of a repeat and that of a shaped piece have the same bonds, each with lengths of its own.

use crate::pattern::chart::Stitch;

/// A row, and a stitch of it.
pub(super) type At = [isize; 2];

/// How a stitch comes out of the row below.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    /// Drawn through stitches, in their wale.
    Drawn,
    /// Drawn through a stitch with which others have changed places.
    Crossed,
    /// Between two stitches.
    Between,
    /// Out of nothing.
    Cast,
}

/// What a stitch is made of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Made {
    pub(super) origin: Origin,
    /// The first and the last stitch of the row below that it takes, or lies between.
    pub(super) below: [isize; 2],
}

impl Made {
    pub(super) fn of(stitch: &Stitch) -> Self {
        let first = stitch.first_parent as isize;
        match stitch.parents {
            0 => Self { origin: Origin::Between, below: [first - 1, first] },
            parents => Self {
                origin: if stitch.is_in_line() { Origin::Drawn } else { Origin::Crossed },
                below: [first, first + isize::from(parents) - 1],
            },
        }
    }
}

/// A bond of a stitch with others; what is below comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bond {
    /// With the next one in its row.
    Beside([At; 2]),
    /// With one of so many that it is drawn through.
    Drawn { ends: [At; 2], count: isize },
    /// With what it is drawn through, where stitches have changed places.
    Crossed([At; 2]),
    /// With one of those that it lies between.
    Between([At; 2]),
    /// Across a mesh of four stitches.
    Askew([At; 2]),
    /// Three in a row or in a wale, which want to be on a line.
    Straight([At; 3]),
}

/// The bonds of a stitch with those beside it and below; `made` gives nothing where no stitch is.
pub(super) fn of_stitch(made: &dyn Fn(At) -> Option<Made>, own: At, bonds: &mut Vec<Bond>) {
    let [row, column] = own;
    let [before, next] = [[row, column - 1], [row, column + 1]];
    let Some(Made { origin, below: [first, last] }) = made(own) else { return };
    let beside = made(next);
    if beside.is_some() {
        bonds.push(Bond::Beside([own, next]));
        if made(before).is_some() {
            bonds.push(Bond::Straight([before, own, next]));
        }
    }
    for parent in first..=last {
        let ends = [[row - 1, parent], own];
        bonds.push(match origin {
            Origin::Drawn => Bond::Drawn { ends, count: last + 1 - first },
            Origin::Crossed => Bond::Crossed(ends),
            Origin::Between => Bond::Between(ends),
            Origin::Cast => break,
        });
    }
    if origin != Origin::Drawn {
        return;
    }
    let is_drawn = |made: &Made| made.origin == Origin::Drawn;
    // Of wales that come together none goes straight on.
    let under = made([row - 1, first]).filter(is_drawn).filter(|under| under.below[0] == under.below[1]);
    if let Some(under) = under.filter(|_| first == last) {
        bonds.push(Bond::Straight([[row - 2, under.below[0]], [row - 1, first], own]));
    }
    if let Some(right) = beside.filter(is_drawn).map(|made| made.below[0]).filter(|right| *right == last + 1) {
        bonds.push(Bond::Askew([[row - 1, last], next]));
        bonds.push(Bond::Askew([[row - 1, right], own]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of three stitches cast on, and one of a stitch of the first two and one of the last.
    fn made([row, column]: At) -> Option<Made> {
        match [row, column] {
            [0, 0..3] => Some(Made { origin: Origin::Cast, below: [0; 2] }),
            [1, 0] => Some(Made { origin: Origin::Drawn, below: [0, 1] }),
            [1, 1] => Some(Made { origin: Origin::Drawn, below: [2; 2] }),
            [2, 0] => Some(Made { origin: Origin::Drawn, below: [0; 2] }),
            [2, 1] => Some(Made { origin: Origin::Drawn, below: [1; 2] }),
            _ => None,
        }
    }

    fn of(own: At) -> Vec<Bond> {
        let mut bonds = Vec::new();
        of_stitch(&made, own, &mut bonds);
        bonds
    }

    #[test]
    fn rows_end_where_no_stitch_is() {
        assert_eq!(of([0, 1]), [Bond::Beside([[0, 1], [0, 2]]), Bond::Straight([[0, 0], [0, 1], [0, 2]])]);
        assert_eq!(of([0, 2]), []);
    }

    #[test]
    fn stitches_hold_to_all_that_they_take_and_wales_that_come_together_do_not_go_straight_on() {
        let drawn = |parent: isize| Bond::Drawn { ends: [[0, parent], [1, 0]], count: 2 };
        let askew = [Bond::Askew([[0, 1], [1, 1]]), Bond::Askew([[0, 2], [1, 0]])];
        assert_eq!(of([1, 0]), [&[Bond::Beside([[1, 0], [1, 1]]), drawn(0), drawn(1)], &askew[..]].concat());
        let one = |parent: At, own: At| Bond::Drawn { ends: [parent, own], count: 1 };
        let askew = [Bond::Askew([[1, 0], [2, 1]]), Bond::Askew([[1, 1], [2, 0]])];
        assert_eq!(of([2, 0]), [&[Bond::Beside([[2, 0], [2, 1]]), one([1, 0], [2, 0])], &askew[..]].concat());
        assert_eq!(of([2, 1]), [one([1, 1], [2, 1]), Bond::Straight([[0, 2], [1, 1], [2, 1]])]);
    }
}
