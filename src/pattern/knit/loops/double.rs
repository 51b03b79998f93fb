//! Double knitting: two layers of plain knit back to back, which change places where the colour changes.
//!
//! On the needles the stitches of both layers stand by turns, knit ones of the front and purl ones of the back; each yarn works
//! one of every pair. Both yarns are behind the knit stitches and in front of the purl ones, so that what goes from one layer
//! to the other lies between them.

use super::{super::colors::Colors, Border, Course, Hold, Loops, Visit, maker::Maker};
use crate::pattern::chart::Stitch;

/// Yarn of a loop of the cast-on edge, which goes to the front and to the back by turns, in shares of a stitch's.
const ZIGZAG: f64 = 0.62;
/// How far above its way a yarn passes the other where both change layers, and that one below it, in rows.
const PASSING: f64 = 0.2;

impl Loops {
    /// The loops of both layers of plain rows, and for each row the courses of both colours. One yarn casts on to the front and
    /// to the back by turns; pairs are bound off together.
    pub(in super::super) fn double(rows: &[Vec<Stitch>], border: Border, backwards: bool, colors: &Colors) -> Self {
        let pairs = |row: &Vec<Stitch>| -> Vec<Stitch> {
            let of = |j: usize| Stitch { purl: j % 2 == 1, first_parent: j as u32, ..row[j / 2] };
            (0..2 * row.len()).map(of).collect()
        };
        let needles: Vec<Vec<Stitch>> = rows.iter().map(pairs).collect();
        let mut maker = Maker::new(&needles, needles[0].len(), border);
        maker.positions();
        maker.draw();
        if border.finished {
            maker.bind_off(backwards, 2, None);
        }
        let mut loops = maker.finish();
        loops.part();
        loops.work_in(colors);
        loops
    }

    /// Takes the stitches of both layers from beside each other to two layers, half a stitch apart across as on the needles.
    fn part(&mut self) {
        self.wide /= 2;
        let scale = if self.border.turns { 1.0 } else { 0.5 };
        for course in &mut self.courses {
            for (column, visit) in &mut course.visits {
                let Visit::Loop(i) = visit else { continue };
                let own = &mut self.loops[*i as usize];
                own.at *= scale;
                own.foot = own.at;
                if course.row < self.rows {
                    own.side = if *column % 2 == 0 { 1.0 } else { -1.0 };
                    *column /= 2;
                }
                if course.row < 0 {
                    (own.twist, own.yarn) = (0.0, ZIGZAG);
                }
            }
        }
    }

    /// Gives each colour a course in every row, and the edges one.
    fn work_in(&mut self, colors: &Colors) {
        let round = self.border.round.is_some();
        for course in std::mem::take(&mut self.courses) {
            let row = course.row;
            if !(0..self.rows).contains(&row) {
                self.courses.push(Course { color: colors.of(row, 0), ..course });
                continue;
            }
            let n = course.visits.len() / 2;
            for color in 0..2 {
                let is_front = |k: usize| colors.of(row, (k % n) as u32) == color;
                let crosses = |k: usize| (round || k + 1 < n) && is_front(k) != is_front(k + 1);
                self.courses.push(Course {
                    row,
                    visits: (0..n).map(|k| course.visits[2 * k + usize::from(!is_front(k))]).collect(),
                    color,
                    first: 0,
                    lift: if color == 0 { PASSING } else { -PASSING },
                    holds: (0..n).map(|k| if crosses(k) { Hold::Crosses } else { Hold::None }).collect(),
                });
            }
        }
    }
}
