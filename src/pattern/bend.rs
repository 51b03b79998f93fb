//! Bends that are tighter than a yarn is thick.

use glam::DVec3;
use rayon::prelude::*;

/// Points that one thread takes at once.
const CHUNK: usize = 1024;

/// How far a yarn has [`folded`] after each three of its points.
pub(super) fn folds(points: &[DVec3], radius: f64) -> impl Iterator<Item = f64> {
    let excess: Vec<f64> = points.par_windows(3).with_min_len(CHUNK).map(|w| excess(w, radius)).collect();
    excess.into_iter().scan(0.0, |fold, excess| {
        *fold = folded(*fold, excess);
        Some(*fold)
    })
}

/// By how much more than its radius allows a yarn turns at the middle one of three points, in radians; less than zero where it
/// turns less.
pub(super) fn excess(points: &[DVec3], radius: f64) -> f64 {
    let (a, b) = (points[1] - points[0], points[2] - points[1]);
    a.angle_between(b) - 0.5 * (a.length() + b.length()) / radius
}

/// How far a yarn has turned beyond what its radius allows, in radians, after one more point with an excess: there its inner
/// side runs backwards, and it folds into itself. `before` is what it was a point before.
pub(super) fn folded(before: f64, excess: f64) -> f64 {
    (before + excess).max(0.0)
}
