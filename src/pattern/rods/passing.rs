//! Whether yarns passed through each other while they relaxed, for tests: between two steps all points go straight, and two
//! segments that pass are for one moment in one plane and cross there.

use std::cell::Cell;

use glam::DVec3;

use super::{Rods, Work};
use crate::geometry::contact::nearest;

thread_local! {
    static PASSED: Cell<Option<usize>> = const { Cell::new(None) };
}

/// How often segments pass through each other in the relaxations that `act` does on this thread.
pub(in super::super) fn passed(act: impl FnOnce()) -> usize {
    PASSED.set(Some(0));
    act();
    PASSED.take().unwrap_or(0)
}

/// What a step begins with, if anyone asks.
pub(super) fn before(rods: &Rods) -> Option<Rods> {
    PASSED.get().is_some().then(|| rods.clone())
}

/// Farther than this apart, in diameters, segments cannot pass in one step.
const NEAR: f64 = 0.3;

/// Looks at a step from `before`.
pub(super) fn watch(before: &Rods, after: &Rods, has: &[bool], work: &Work) {
    // The strand that ends at a point and goes on with its first one.
    let mut joined = vec![None; after.points.len()];
    for (k, s) in after.strands.iter().enumerate().filter(|(_, s)| s.jump.is_some()) {
        joined[s.start + s.count - 1] = Some(k);
    }
    let next = |rods: &Rods, i: usize| match joined[i].map(|k: usize| &rods.strands[k]) {
        Some(s) => rods.points[s.start] + s.jump.unwrap_or_default(),
        None => rods.points[(i + 1).min(rods.points.len() - 1)],
    };
    for i in (0..after.points.len()).filter(|&i| has[i]) {
        for other in work.neighbours(i) {
            let j = other.segment as usize;
            let ends = |rods: &Rods| {
                let [x, y] = other.cells.map(f64::from);
                let period = rods.period.unwrap_or_default();
                let by = DVec3::new(x * period.x, y * period.y, 0.0);
                [rods.points[i], next(rods, i), rods.points[j] + by, next(rods, j) + by]
            };
            let last = ends(after);
            if nearest(last[0], last[1], last[2], last[3]).between.length_squared() > NEAR * NEAR {
                continue;
            }
            let first = ends(before);
            let at = |t: f64| [0, 1, 2, 3].map(|k| first[k].lerp(last[k], t));
            let volume = |[a, b, c, d]: [DVec3; 4]| (b - a).cross(d - c).dot(c - a);
            let (mut low, mut high) = (0.0, 1.0);
            let sign = volume(first) > 0.0;
            if sign == (volume(last) > 0.0) {
                continue;
            }
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                if (volume(at(middle)) > 0.0) == sign {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            let [a, b, c, d] = at(0.5 * (low + high));
            if nearest(a, b, c, d).between.length() < 1e-6 {
                PASSED.set(PASSED.get().map(|n| n + 1));
            }
        }
    }
}
