//! Colour work: which yarn knits which stitch, and where the others are meanwhile.
//!
//! Each colour is a yarn of its own. In stranded work, in a row of several colours each one makes its own loops and floats behind those of the
//! others, from edge to edge, where it is caught and turns behind the edge stitch; one that a few rows do not need is carried up the side, or inside of a tube. Floats keep
//! their order, the first colour's below, so that no two yarns wind around each other. In intarsia each field of a colour has
//! a yarn, which turns where the field ends and is linked there with its neighbour's. In double knitting two colours knit a
//! layer each, and change layers where the picture changes its colour.

use std::ops::Range;

use super::{
    Form,
    loops::{Course, Hold, Loops, Visit},
};

/// How a row of several colours is knitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Yarns float behind stitches of other colours.
    Stranded,
    /// Each field of a colour has a yarn of its own; of flat pieces only.
    Intarsia,
    /// Two layers of plain knit back to back, of two colours that are exchanged on the other side.
    DoubleKnit,
}

/// Stitches over which a yarn floats before it is caught, and rows that it is carried, unless asked otherwise.
pub const CATCH_FLOATS: u32 = 7;
/// Rows without a colour over which its yarn is carried, unless asked otherwise.
pub const CARRY_ROWS: u32 = 6;

/// More yarns in a row than this are more than anyone strands.
const MOST_STRANDED: usize = 4;

impl Work {
    /// Those that have a yarn for each colour, by their names.
    pub const NAMES: [(&'static str, Self); 3] =
        [("stranded", Self::Stranded), ("intarsia", Self::Intarsia), ("double-knit", Self::DoubleKnit)];

    /// Whether a piece of some form is knitted so.
    ///
    /// # Errors
    /// What is wrong, and what to do.
    pub(crate) fn suits(self, form: &Form) -> Result<(), [&'static str; 2]> {
        if self == Self::Intarsia && form.is_round() {
            let hint = "in the round yarns would hang at the wrong side of their fields: \"stranded\"";
            return Err(["intarsia is knitted flat", hint]);
        }
        Ok(())
    }

    /// Whether a piece is knitted so of so many yarns.
    ///
    /// # Errors
    /// What is wrong.
    pub(crate) fn takes(self, yarns: usize) -> Result<(), String> {
        if self == Self::DoubleKnit && yarns != 2 {
            return Err(format!("double knitting takes two yarns, one for each layer, but found {yarns}"));
        }
        Ok(())
    }
}

/// What is told of a row of so many yarns, if that is more than anyone strands: `instead` none floats.
pub(crate) fn too_many_strands(row: &str, yarns: usize, instead: &str) -> Option<String> {
    let told = || {
        format!(
            "{row} is knitted of {yarns} yarns, and each floats behind the stitches of the others; with {instead} none does"
        )
    };
    (yarns > MOST_STRANDED).then(told)
}

/// The colours of a piece, and how they are worked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Colors {
    /// The colour of each stitch, from 0, by rows from the first. Those of the cast-on edge and of the bind-off are what
    /// most stitches beside them have.
    pub rows: Vec<Vec<u16>>,
    /// How several are knitted in a row.
    pub work: Work,
    /// A float over more stitches is caught by the working yarn between two of its stitches.
    pub catch: Option<u32>,
    /// A yarn that more rows do without is cut.
    pub carry: u32,
}

impl Colors {
    /// Colour of a stitch; of an edge, which has no rows of its own, what its row has most.
    pub(super) fn of(&self, row: i32, column: u32) -> u16 {
        let last = self.rows.len() as i32 - 1;
        let own = &self.rows[row.clamp(0, last) as usize];
        if (0..=last).contains(&row) {
            own.get(column as usize).or(own.last()).copied().unwrap_or(0)
        } else {
            self.of_edge(row)
        }
    }

    /// Colour of the cast-on edge or the bind-off: in intarsia that of the yarn which hangs there.
    fn of_edge(&self, row: i32) -> u16 {
        let last = self.rows.len() as i32 - 1;
        let own = &self.rows[row.clamp(0, last) as usize];
        match self.work {
            Work::Stranded | Work::DoubleKnit => most(own),
            Work::Intarsia if row > last && row.rem_euclid(2) == 1 => own.last().copied().unwrap_or(0),
            Work::Intarsia => own.first().copied().unwrap_or(0),
        }
    }

    /// Fields of one colour in a row: their colour and columns.
    fn fields(&self, row: i32) -> Vec<(u16, Range<u32>)> {
        let last = self.rows.len() as i32 - 1;
        let own = &self.rows[row.clamp(0, last) as usize];
        if !(0..=last).contains(&row) {
            return vec![(self.of_edge(row), 0..own.len() as u32)];
        }
        let mut fields: Vec<(u16, Range<u32>)> = Vec::new();
        for (k, &color) in own.iter().enumerate() {
            match fields.last_mut() {
                Some((c, columns)) if *c == color => columns.end += 1,
                _ => fields.push((color, k as u32..k as u32 + 1)),
            }
        }
        fields
    }

    /// As [`Self::ways`]: from row to row a yarn goes on in a field of its colour that is above its own.
    fn ways_of_fields(&self, finished: bool) -> Vec<Way> {
        let rows = self.rows.len() as i32;
        let mut ways: Vec<Way> = Vec::new();
        // The ways of the row below and the columns of their fields.
        let mut below: Vec<(usize, Range<u32>)> = Vec::new();
        for row in if finished { -1..rows + 1 } else { 0..rows } {
            let backwards = row.rem_euclid(2) == 1;
            let mut taken = vec![false; below.len()];
            let mut here = Vec::new();
            // In the order in which they are knitted: where a field parts, its yarn goes on with what comes first.
            let mut fields = self.fields(row);
            if backwards {
                fields.reverse();
            }
            for (color, columns) in fields {
                // Fields that touch at a corner only go on too.
                let touches = |other: &Range<u32>| other.start <= columns.end && columns.start <= other.end;
                // Where a yarn hangs after the row below is where the next one begins; the nearest is taken up.
                let begin = |field: &Range<u32>| if backwards { field.end } else { field.start };
                let best = (0..below.len())
                    .filter(|&b| !taken[b] && ways[below[b].0].color == color && touches(&below[b].1))
                    .min_by_key(|&b| begin(&below[b].1).abs_diff(begin(&columns)));
                let way = match best {
                    Some(b) => {
                        taken[b] = true;
                        below[b].0
                    }
                    None => {
                        ways.push(Way { color, rows: Vec::new() });
                        ways.len() - 1
                    }
                };
                ways[way].rows.push(Stretch { row, backwards, first: columns.start });
                here.push((way, columns));
            }
            below = here;
        }
        ways
    }

    /// What is told of its row of most yarns, if those are more than anyone strands.
    pub(crate) fn too_many(&self, instead: &str) -> Option<String> {
        let (most, row) = self.most_in_a_row();
        let stranded = self.work == Work::Stranded;
        too_many_strands(&format!("row {}", row + 1), most, instead).filter(|_| stranded)
    }

    /// The most yarns that any row has, and that row, from 0.
    pub fn most_in_a_row(&self) -> (usize, usize) {
        let count = |row: &Vec<u16>| in_use(row.iter().copied()).len();
        let counts = self.rows.iter().map(count).enumerate();
        counts.map(|(r, n)| (n, r)).max_by_key(|&(n, r)| (n, std::cmp::Reverse(r))).unwrap_or((0, 0))
    }

    /// The ways of all yarns through a piece of so many rows, each a list of rows and whether it goes from right to left there.
    /// They begin where a colour begins or was cut.
    pub(crate) fn ways(&self, finished: bool, round: bool) -> Vec<Way> {
        if self.work == Work::Intarsia {
            return self.ways_of_fields(finished);
        }
        let rows = self.rows.len() as i32;
        let mut open: Vec<Option<usize>> = Vec::new();
        let mut ways: Vec<Way> = Vec::new();
        let (first, after) = if finished { (-1, rows + 1) } else { (0, rows) };
        for row in first..after {
            let own = &self.rows[row.clamp(0, rows - 1) as usize];
            let used = match (0..rows).contains(&row) {
                true if self.work == Work::DoubleKnit => vec![0, 1],
                true => in_use(own.iter().copied()),
                false => vec![self.of_edge(row)],
            };
            for color in used {
                if open.len() <= usize::from(color) {
                    open.resize(usize::from(color) + 1, None);
                }
                let slot = &mut open[usize::from(color)];
                let near = |w: &usize| ways[*w].rows.last().is_some_and(|l| row - l.row - 1 <= self.carry as i32);
                let way = match slot.filter(near) {
                    Some(way) => way,
                    None => {
                        ways.push(Way { color, rows: Vec::new() });
                        ways.len() - 1
                    }
                };
                *slot = Some(way);
                // A yarn goes on from the side where it hangs.
                let backwards = match (round, ways[way].rows.last()) {
                    (true, _) => row == -1,
                    (false, Some(last)) => !last.backwards,
                    (false, None) => row.rem_euclid(2) == 1,
                };
                ways[way].rows.push(Stretch { row, backwards, first: 0 });
            }
        }
        ways
    }
}

/// The way of one yarn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Way {
    pub(crate) color: u16,
    pub(crate) rows: Vec<Stretch>,
}

/// A row or a part of it that a yarn goes through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stretch {
    pub(crate) row: i32,
    /// Whether it goes from right to left.
    pub(crate) backwards: bool,
    /// The column where it begins on the left.
    pub(crate) first: u32,
}

/// The colours in a row, each once, in their order.
pub(crate) fn in_use(row: impl Iterator<Item = u16>) -> Vec<u16> {
    let mut used: Vec<u16> = row.collect();
    used.sort_unstable();
    used.dedup();
    used
}

/// What most stitches of a row have; the first of several.
fn most(row: &[u16]) -> u16 {
    let count = |color: u16| row.iter().filter(|c| **c == color).count();
    in_use(row.iter().copied()).into_iter().max_by_key(|&c| (count(c), std::cmp::Reverse(c))).unwrap_or(0)
}

impl Loops {
    /// Gives each colour of a row a course of its own.
    pub(super) fn dye(&mut self, colors: &Colors) {
        let courses = std::mem::take(&mut self.courses);
        for course in courses {
            let of = |k: usize| colors.of(course.row, course.visits[k].0);
            let n = course.visits.len();
            if colors.work == Work::Intarsia {
                self.courses.extend(fields(&course, &of));
                continue;
            }
            let stitches: Vec<u16> = (0..n).map(of).collect();
            let used = in_use(stitches.iter().copied());
            let is_loop = |k: usize| matches!(course.visits[k].1, Visit::Loop(_));
            let round = self.border.round.is_some();
            let mut holds = caught(&stitches, &is_loop, &used, colors.catch, round, course.row);
            if !round && colors.catch.is_some() {
                catch_at_edges(&stitches, &is_loop, &used, &mut holds);
            }
            for (rank, &color) in used.iter().enumerate() {
                let own = |k: usize| {
                    let (column, visit) = course.visits[k];
                    let at = match visit {
                        _ if of(k) == color => return (column, visit),
                        Visit::Loop(i) => self.loops[i as usize].foot,
                        Visit::Pass { at, .. } | Visit::Float { at } | Visit::Through { at } => at,
                    };
                    (column, Visit::Float { at })
                };
                // Below the first row it would be seen.
                let goes_down = |working: u16| course.row > 0 && used.iter().find(|c| **c != working) == Some(&color);
                let holds = (0..n).map(|k| match holds[k] {
                    Some((float, working)) if float == color => Hold::Caught { down: goes_down(working) },
                    Some((_, working)) if working == color => Hold::Catches,
                    _ => Hold::None,
                });
                self.courses.push(Course {
                    row: course.row,
                    visits: (0..n).map(own).collect(),
                    color,
                    first: 0,
                    lift: LIFT * (rank as f64 - 0.5 * (used.len() - 1) as f64),
                    holds: if used.len() > 1 { holds.collect() } else { Vec::new() },
                });
            }
        }
    }
}

/// A course for each field of a row.
fn fields(course: &Course, of: &dyn Fn(usize) -> u16) -> Vec<Course> {
    let n = course.visits.len();
    let mut starts: Vec<usize> = (0..n).filter(|&k| k == 0 || of(k) != of(k - 1)).collect();
    starts.push(n);
    let field = |w: &[usize]| Course {
        visits: course.visits[w[0]..w[1]].to_vec(),
        color: of(w[0]),
        first: w[0],
        holds: Vec::new(),
        ..*course
    };
    starts.windows(2).map(field).collect()
}

/// How far apart the floats of two colours lie, in rows.
const LIFT: f64 = 0.42;

/// After which stitches of a row of some colours a float is caught between two loops of one colour: its colour and that of
/// the working yarn. From row to row not above each other, where they would be seen from the front.
pub(crate) fn caught(
    colors: &[u16],
    is_loop: &dyn Fn(usize) -> bool,
    used: &[u16],
    catch: Option<u32>,
    round: bool,
    row: i32,
) -> Vec<Option<(u16, u16)>> {
    let n = colors.len();
    let mut holds = vec![None; n];
    let Some(longest) = catch.map(|c| c.max(1) as usize) else { return holds };
    if used.len() < 2 {
        return holds;
    }
    for &color in used {
        let own: Vec<usize> = (0..n).filter(|&k| colors[k] == color).collect();
        let mut spans: Vec<(usize, usize)> = own.windows(2).map(|w| (w[0] + 1, w[1])).collect();
        if let (Some(&first), Some(&last)) = (own.first(), own.last()) {
            if round {
                spans.push((last + 1, first + n));
            } else {
                spans.extend([(0, first), (last + 1, n)]);
            }
        }
        for (from, to) in spans.into_iter().filter(|(from, to)| to.saturating_sub(*from) > longest) {
            let count = (to - from).div_ceil(longest) - 1;
            for i in 1..=count {
                let ideal = from + (to - from) * i / (count + 1);
                let aside = usize::from((to - from).div_ceil(count + 1) < longest);
                let ideal = if row % 2 == 0 { ideal - aside } else { ideal + aside };
                // Between two loops of one colour, where nothing else is held.
                let fits = |k: &usize| {
                    let (a, b) = ((k - 1) % n, k % n);
                    colors[a] == colors[b] && is_loop(a) && is_loop(b) && holds[a].is_none()
                };
                let near = (from + 1..to).filter(fits).min_by_key(|k| (k.abs_diff(ideal), *k));
                if let Some(k) = near {
                    holds[(k - 1) % n] = Some((color, colors[k % n]));
                }
            }
        }
    }
    holds
}

/// The same beside the edge stitches of a flat row: what floats there would be drawn out of them where it turns.
fn catch_at_edges(colors: &[u16], is_loop: &dyn Fn(usize) -> bool, used: &[u16], holds: &mut [Option<(u16, u16)>]) {
    let n = colors.len();
    for joint in [0, n.saturating_sub(2)].into_iter().filter(|j| j + 1 < n) {
        let working = colors[joint];
        let fits = working == colors[joint + 1] && is_loop(joint) && is_loop(joint + 1) && holds[joint].is_none();
        let float = used.iter().copied().find(|&color| color != working);
        holds[joint] = holds[joint].or(float.filter(|_| fits).map(|float| (float, working)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colors(rows: &[&str]) -> Colors {
        let row = |r: &&str| r.bytes().map(|b| u16::from(b - b'a')).collect();
        Colors { rows: rows.iter().map(row).collect(), work: Work::Stranded, catch: None, carry: 2 }
    }

    #[test]
    fn a_yarn_goes_on_from_the_side_where_it_hangs_and_is_cut_after_a_while() {
        let ways = colors(&["aa", "ab", "ab", "aa", "aa", "aa", "ab"]).ways(false, false);
        assert_eq!(ways.len(), 3);
        let rows = |n: i32| (0..n).map(|r| (r, r % 2 == 1)).collect::<Vec<_>>();
        assert_eq!(drawn(&ways[0]), (0, rows(7)));
        assert_eq!(drawn(&ways[1]), (1, vec![(1, true), (2, false)]));
        assert_eq!(drawn(&ways[2]), (1, vec![(6, false)]));
        // A row that it does without leaves it on its side.
        let ways = colors(&["aa", "bb", "aa"]).ways(false, false);
        assert_eq!(drawn(&ways[0]), (0, vec![(0, false), (2, true)]));
        assert_eq!(drawn(&ways[1]), (1, vec![(1, true)]));
    }

    fn drawn(way: &Way) -> (u16, Vec<(i32, bool)>) {
        (way.color, way.rows.iter().map(|s| (s.row, s.backwards)).collect())
    }

    #[test]
    fn each_field_of_intarsia_has_a_yarn() {
        let colors = Colors { work: Work::Intarsia, ..colors(&["aaabbb", "aabbbb", "aabbaa"]) };
        let ways = colors.ways(false, false);
        let rows = |w: &Way| w.rows.iter().map(|s| (s.row, s.first)).collect::<Vec<_>>();
        assert_eq!(ways.len(), 3);
        assert_eq!(rows(&ways[0]), [(0, 0), (1, 0), (2, 0)]);
        assert_eq!(rows(&ways[1]), [(0, 3), (1, 2), (2, 2)]);
        assert_eq!(rows(&ways[2]), [(2, 4)]);
        // Cast on with the yarn on the left; bound off from the right with what hangs there.
        let ways = colors.ways(true, false);
        assert_eq!(ways.iter().map(|w| (w.color, w.rows[0].row)).collect::<Vec<_>>(), [(0, -1), (1, 0), (0, 2)]);
        assert_eq!(ways[2].rows.last().map(|s| s.row), Some(3));
    }

    /// The yarn goes on with what it comes to first; the field beyond has a new one, which hangs nearer where both meet again.
    #[test]
    fn a_field_of_intarsia_parts_and_meets_again() {
        let colors = Colors { work: Work::Intarsia, ..colors(&["aaaaa", "aabaa", "aaaaa"]) };
        let rows = |w: &Way| (w.color, w.rows.iter().map(|s| (s.row, s.first)).collect::<Vec<_>>());
        let ways: Vec<_> = colors.ways(false, false).iter().map(rows).collect();
        assert_eq!(ways, [(0, vec![(0, 0), (1, 3)]), (1, vec![(1, 2)]), (0, vec![(1, 0), (2, 0)])]);
    }

    #[test]
    fn edges_have_the_colour_of_most_stitches_beside_them() {
        let colors = colors(&["abb", "aab"]);
        assert_eq!((colors.of(-1, 0), colors.of(2, 2)), (1, 0));
        assert_eq!(colors.most_in_a_row(), (2, 0));
    }
}
