//! Bends that are tighter than a yarn is thick.

use glam::DVec3;

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
