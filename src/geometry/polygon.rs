//! Polygons cut into triangles.
//!
//! Own code: libraries leave out corners that lie on a straight line, and neighbouring faces end there.

use std::{collections::HashSet, hash::Hash};

use glam::{DVec2, DVec3};

/// Less than this share of a polygon's area is none.
const GRAIN: f64 = 1e-9;

/// The triangles of a polygon, two fewer than its corners, as indices of `corners` in its sense: a fan about the first corner where
/// every triangle of it has an area, as of a convex polygon; else ears, as of a hollow one (Meisters, "Polygons Have Ears", 1975).
/// What crosses itself may be cut either way.
pub(crate) fn triangles(corners: &[DVec2]) -> Vec<[usize; 3]> {
    let fan = || (2..corners.len()).map(|k| [0, k - 1, k]);
    let area: f64 = fan().map(|t| doubled(corners, t)).sum();
    let (side, least) = (area.signum(), GRAIN * area.abs());
    if corners.len() == 3 || fan().all(|t| side * doubled(corners, t) > least) {
        return fan().collect();
    }
    // A sliver may be nothing but rounding and yet the last ear that there is.
    let cut = [least, 0.0].into_iter().find_map(|least| ears(corners, side, least));
    cut.unwrap_or_else(|| fan().collect())
}

/// Corners of a face in space as they are seen along the axis that it looks along most.
pub(crate) fn in_plane(corners: &[DVec3]) -> Vec<DVec2> {
    let first = corners.first().copied().unwrap_or_default();
    // Newell's normal; corners may lie out of one plane.
    let normal: DVec3 = corners.windows(2).map(|w| (w[0] - first).cross(w[1] - first)).sum();
    let axis = normal.abs().max_position();
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    corners.iter().map(|p| DVec2::new(p[u], p[v])).collect()
}

/// The edges around triangles that belong together, each from corner to corner, in their order: the same however they are cut.
pub(crate) fn outline<T: Copy + Ord + Hash>(triangles: impl Iterator<Item = [T; 3]>) -> Vec<[T; 2]> {
    let mut around: Vec<[T; 2]> = triangles.flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    if around.len() > 3 {
        let all: HashSet<[T; 2]> = around.iter().copied().collect();
        around.retain(|&[a, b]| !all.contains(&[b, a]));
    }
    around.sort_unstable();
    around
}

/// Twice the area of a triangle, negative where it is clockwise.
fn doubled(corners: &[DVec2], [a, b, c]: [usize; 3]) -> f64 {
    (corners[b] - corners[a]).perp_dot(corners[c] - corners[a])
}

/// Cuts off one ear after the other, if there are any.
fn ears(corners: &[DVec2], side: f64, least: f64) -> Option<Vec<[usize; 3]>> {
    let mut left: Vec<usize> = (0..corners.len()).collect();
    let mut out = Vec::with_capacity(corners.len());
    let (mut at, mut tried) = (1, 0);
    while left.len() > 3 {
        let n = left.len();
        if tried == n {
            return None;
        }
        at %= n;
        let ear = [left[(at + n - 1) % n], left[at], left[(at + 1) % n]];
        if is_ear(corners, &left, ear, side, least) {
            out.push(ear);
            left.remove(at);
            tried = 0;
        } else {
            tried += 1;
        }
        // The next ear does not share the edge of this one: fewer slivers.
        at += 1;
    }
    out.push([left[0], left[1], left[2]]);
    Some(out)
}

/// Whether a triangle at three corners that follow each other has an area, and no other corner in it or on its edges.
fn is_ear(corners: &[DVec2], left: &[usize], ear: [usize; 3], side: f64, least: f64) -> bool {
    let [a, b, c] = ear;
    let inside = |p: usize| {
        let apart = ear.iter().all(|&q| corners[q] != corners[p]);
        apart && [[a, b, p], [b, c, p], [c, a, p]].iter().all(|t| side * doubled(corners, *t) >= -least)
    };
    side * doubled(corners, ear) > least && !left.iter().any(|&p| inside(p))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    fn turned(corners: &[DVec2], by: usize) -> Vec<DVec2> {
        let mut corners = corners.to_vec();
        corners.rotate_left(by);
        corners
    }

    /// Cut from every corner on, in both senses, the triangles of a polygon fill it and none is turned over.
    fn fills(corners: &[DVec2]) {
        let backwards: Vec<DVec2> = corners.iter().rev().copied().collect();
        for (by, outline) in (0..corners.len()).flat_map(|by| [(by, corners), (by, &backwards)]) {
            let corners = turned(outline, by);
            let area = |t: &[usize; 3]| doubled(&corners, *t);
            let whole: f64 = (0..corners.len()).map(|i| corners[i].perp_dot(corners[(i + 1) % corners.len()])).sum();
            let cut = triangles(&corners);
            assert_eq!(cut.len(), corners.len() - 2);
            assert!(cut.iter().all(|t| area(t) * whole.signum() > 1e-6), "{by}: {cut:?}");
            let sum: f64 = cut.iter().map(area).sum();
            assert!((sum - whole).abs() < 1e-9 * whole.abs(), "{by}: {sum} {whole}");
            assert!((0..corners.len()).all(|i| cut.iter().flatten().any(|&k| k == i)), "{by}: a corner is left out");
        }
    }

    fn of(corners: &[[f64; 2]]) -> Vec<DVec2> {
        corners.iter().map(|&c| DVec2::from(c)).collect()
    }

    #[test]
    fn hollow_polygons_are_filled_within_their_outline() {
        fills(&of(&[[0.0, 0.0], [12.0, 0.0], [12.0, 5.0], [5.0, 5.0], [5.0, 12.0], [0.0, 12.0]]));
        fills(&of(&[[0.0, 0.0], [12.0, 6.0], [24.0, 0.0], [12.0, 24.0]]));
        // With corners on straight edges, which neighbours have too.
        fills(&of(&[[4.0, 4.0], [6.0, 4.0], [8.0, 4.0], [8.0, 6.0], [6.0, 6.0], [6.0, 8.0], [4.0, 8.0], [4.0, 6.0]]));
        fills(&of(&[[0.0, 0.0], [6.0, 0.0], [12.0, 0.0], [12.0, 12.0], [6.0, 14.0], [0.0, 12.0]]));
        let star = |i: u32| f64::from(10 - 5 * (i % 2)) * DVec2::from_angle(TAU * f64::from(i) / 10.0);
        fills(&(0..10).map(star).collect::<Vec<_>>());
        // A comb of many teeth.
        let teeth = (0..40).map(|i| [f64::from(i), if i % 2 == 0 { 0.2 } else { 9.0 }]);
        fills(&of(&teeth.chain([[39.0, -1.0], [0.0, -1.0]]).collect::<Vec<_>>()));
    }

    #[test]
    fn outlines_do_not_know_how_polygons_are_cut() {
        let of = |cut: &[[u32; 3]]| outline(cut.iter().copied());
        assert_eq!(of(&[[0, 1, 2], [0, 2, 3]]), [[0, 1], [1, 2], [2, 3], [3, 0]]);
        assert_eq!(of(&[[0, 1, 2], [0, 2, 3]]), of(&[[1, 2, 3], [0, 1, 3]]));
        assert_ne!(of(&[[0, 1, 2], [0, 2, 3]]), of(&[[0, 2, 1], [0, 3, 2]]));
    }

    #[test]
    fn convex_polygons_are_fans() {
        let round: Vec<DVec2> = (0..9).map(|i| DVec2::from_angle(TAU * f64::from(i) / 9.0)).collect();
        let fan: Vec<[usize; 3]> = (2..9).map(|k| [0, k - 1, k]).collect();
        assert_eq!(triangles(&round), fan);
        assert_eq!(triangles(&of(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])), [[0, 1, 2], [0, 2, 3]]);
        // The same from the other side.
        assert_eq!(triangles(&of(&[[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]])), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn what_is_no_polygon_is_cut_all_the_same() {
        for corners in [
            vec![DVec2::ZERO; 5],
            of(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]),
            of(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]),
            of(&[[f64::NAN, 0.0], [f64::INFINITY, 1.0], [1.0, 0.0], [0.0, 1.0]]),
        ] {
            let cut = triangles(&corners);
            assert_eq!(cut.len(), corners.len() - 2);
            assert!(cut.iter().flatten().all(|&i| i < corners.len()));
        }
    }

    #[test]
    fn faces_are_seen_where_they_are_widest() {
        let hollow = [[0.0, 0.0, 0.0], [0.0, 12.0, 6.0], [0.0, 24.0, 0.0], [0.0, 12.0, 24.0]].map(DVec3::from);
        assert_eq!(in_plane(&hollow)[1], DVec2::new(12.0, 6.0));
        let cut = triangles(&in_plane(&hollow));
        assert!(cut.iter().all(|t| t.contains(&1) && t.contains(&3)), "{cut:?}");
    }
}
