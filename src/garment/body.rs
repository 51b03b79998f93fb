//! The body under a garment: keeps yarns out of it.

use std::collections::HashMap;

use glam::DVec3;

use crate::geometry::mesh::Mesh;

/// Triangles of a body, sorted into the cells of a grid.
pub(super) struct Body {
    triangles: Vec<[DVec3; 3]>,
    /// Normals at the corners, for a side that is the same across edges.
    normals: Vec<[DVec3; 3]>,
    cells: HashMap<[i32; 3], Vec<u32>>,
    size: f64,
    /// How far inside of it a point still comes out, mm.
    depth: f64,
}

/// Cells that triangles are in, for each and for all: beyond that cells are made larger.
const MOST_ENTRIES: [f64; 2] = [32.0, 1e6];

impl Body {
    /// `reach` is the furthest from its surface that will be asked about, mm.
    pub(super) fn new(mesh: &Mesh, reach: f64) -> Self {
        let mut mesh = mesh.clone();
        mesh.smooth();
        let triangles: Vec<[DVec3; 3]> = mesh.triangles.iter().map(|t| t.map(|i| mesh.points[i as usize])).collect();
        let normals = mesh.triangles.iter().map(|t| t.map(|i| mesh.normals[i as usize])).collect();
        let mean = triangles.iter().map(|[a, b, _]| a.distance(*b)).sum::<f64>() / triangles.len().max(1) as f64;
        let depth = (2.0 * reach).max(mean);
        let mut size = depth;
        let range = |t: &[DVec3; 3], size: f64| {
            let [low, high] = [t[0].min(t[1]).min(t[2]) - reach, t[0].max(t[1]).max(t[2]) + reach];
            [low, high].map(|p| (p / size).floor())
        };
        // A floor of two triangles under a body of small ones is in very many cells of theirs.
        let entries = |size: f64| -> f64 {
            let count = |t: &[DVec3; 3]| {
                let [low, high] = range(t, size);
                (high - low + 1.0).element_product()
            };
            triangles.iter().map(count).sum()
        };
        while entries(size) > MOST_ENTRIES[0] * triangles.len() as f64 + MOST_ENTRIES[1] {
            size *= 2.0;
        }
        let mut cells: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
        for (i, t) in triangles.iter().enumerate() {
            let [low, high] = range(t, size).map(DVec3::as_ivec3);
            for z in low.z..=high.z {
                for y in low.y..=high.y {
                    for x in low.x..=high.x {
                        cells.entry([x, y, z]).or_default().push(i as u32);
                    }
                }
            }
        }
        Self { triangles, normals, cells, size, depth }
    }

    /// Where a point goes that is nearer to the body than `clearance` or inside of it by less than the reach.
    pub(super) fn push_out(&self, at: DVec3, clearance: f64) -> Option<DVec3> {
        let cell = (at / self.size).floor().as_ivec3();
        let near = self.cells.get(&cell.to_array())?;
        let mut best: Option<(f64, DVec3, DVec3)> = None;
        for &i in near {
            let (on, share) = closest(at, &self.triangles[i as usize]);
            let distance = on.distance_squared(at);
            if best.is_none_or(|b| distance < b.0) {
                let n = &self.normals[i as usize];
                best = Some((distance, on, n[0] * share[0] + n[1] * share[1] + n[2] * share[2]));
            }
        }
        let (_, on, normal) = best?;
        let normal = normal.normalize_or(DVec3::Y);
        let height = (at - on).dot(normal);
        (height < clearance && height > -self.depth).then(|| at + normal * (clearance - height))
    }
}

/// The point of a triangle nearest to another, and its barycentric coordinates (after Ericson, "Real-Time Collision
/// Detection", 2005, section 5.1.5).
fn closest(p: DVec3, [a, b, c]: &[DVec3; 3]) -> (DVec3, [f64; 3]) {
    let (ab, ac, ap) = (*b - *a, *c - *a, p - *a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    let bp = p - *b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    let cp = p - *c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    let share = if d1 <= 0.0 && d2 <= 0.0 {
        [1.0, 0.0, 0.0]
    } else if d3 >= 0.0 && d4 <= d3 {
        [0.0, 1.0, 0.0]
    } else if d6 >= 0.0 && d5 <= d6 {
        [0.0, 0.0, 1.0]
    } else if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        [1.0 - t, t, 0.0]
    } else if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        [1.0 - t, 0.0, t]
    } else if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let t = (d4 - d3) / (d4 - d3 + d5 - d6);
        [0.0, 1.0 - t, t]
    } else {
        let sum = va + vb + vc;
        [va / sum, vb / sum, vc / sum]
    };
    (*a * share[0] + *b * share[1] + *c * share[2], share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_near_and_inside_a_ball_come_out() {
        let body = Body::new(&Mesh::sphere(100.0, 96), 5.0);
        for (radius, moved) in [(101.0, true), (97.0, true), (103.0, false), (140.0, false)] {
            let at = DVec3::new(0.3, 0.5, 0.8).normalize() * radius;
            match body.push_out(at, 2.0) {
                Some(to) => {
                    assert!(moved);
                    assert!((to.length() - 102.0).abs() < 0.2, "{radius}: {}", to.length());
                }
                None => assert!(!moved, "{radius}"),
            }
        }
    }

    /// A body that stands on a floor of a kilometre: what is near the body is found as without the floor.
    #[test]
    fn a_wide_floor_takes_no_room() {
        let ball = Mesh::sphere(100.0, 96);
        let mut both = ball.clone();
        let first = both.points.len() as u32;
        let corner = |x: f64, z: f64| DVec3::new(5e5 * x, -100.0, 5e5 * z);
        both.points.extend([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
        both.triangles.extend([[first, first + 2, first + 1], [first, first + 3, first + 2]]);
        let (alone, standing) = (Body::new(&ball, 5.0), Body::new(&both, 5.0));
        assert!(standing.cells.values().map(Vec::len).sum::<usize>() < 3_000_000);
        for radius in [99.0, 101.0, 103.0] {
            let at = DVec3::new(0.3, 0.5, 0.8).normalize() * radius;
            let [a, b] = [&alone, &standing].map(|body| body.push_out(at, 2.0));
            assert_eq!(a.is_some(), b.is_some());
            assert!(a.zip(b).is_none_or(|(a, b)| a.distance(b) < 0.1), "{a:?} {b:?}");
        }
    }
}
