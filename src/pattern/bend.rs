//! Bends that are tighter than a yarn is thick.

use glam::DVec3;

/// How far a yarn has turned beyond what its radius allows, in radians, after three more points: there its inner side runs
/// backwards, and it folds into itself. `before` is what it was a point before.
pub(super) fn folded(before: f64, points: &[DVec3], radius: f64) -> f64 {
    let (a, b) = (points[1] - points[0], points[2] - points[1]);
    (before + a.angle_between(b) - 0.5 * (a.length() + b.length()) / radius).max(0.0)
}
