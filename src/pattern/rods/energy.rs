//! The energy that a relaxation makes least.

use super::{APART, CONTACT, Rods, STRETCH, Work};
use crate::geometry::contact::nearest;

impl Rods {
    /// Energy of stretching, bending and contact, with contact as a relaxation begins.
    pub(in super::super) fn energy(&self) -> f64 {
        let has = self.has_segment();
        let mut work = Work { on_strands: self.on_strands(), ..Work::default() };
        self.search(&has, &mut work);
        self.along(&has, &work) + self.between(&work)
    }

    /// Of the yarns themselves.
    fn along(&self, has: &[bool], work: &Work) -> f64 {
        let edges = &work.edges;
        let bend = |a: usize, b: usize| {
            let (la, lb) = (self.rest[a], self.rest[b]);
            (edges[b] / lb - edges[a] / la).length_squared() / (la + lb)
        };
        let mut sum = 0.0;
        for s in &self.strands {
            let end = s.start + s.count;
            sum += (s.start + 1..end - usize::from(s.jump.is_none())).map(|i| bend(i - 1, i)).sum::<f64>();
            if s.jump.is_some() {
                sum += bend(end - 1, s.start);
            }
            let stretch = |i: usize| 0.5 * STRETCH / self.rest[i] * (edges[i].length() - self.rest[i]).powi(2);
            sum += (s.start..end).filter(|&i| has[i]).map(stretch).sum::<f64>();
        }
        sum
    }

    /// Of contact. (Yarns that are at rest are not so deep in each other that it becomes firmer.)
    fn between(&self, work: &Work) -> f64 {
        let period = self.period.unwrap_or_default();
        let mut sum = 0.0;
        for i in 0..self.points.len() {
            for other in work.neighbours(i) {
                let j = other.segment as usize;
                let [x, y] = other.cells.map(f64::from);
                let (p, q) = (self.points[i], self.points[j] + glam::DVec3::new(x * period.x, y * period.y, 0.0));
                let gap = APART - nearest(p, p + work.edges[i], q, q + work.edges[j]).between.length();
                sum += 0.5 * CONTACT * gap.max(0.0).powi(2);
            }
        }
        sum
    }
}
