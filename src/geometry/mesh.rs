//! Triangle meshes: tables, stands and bodies for cloth to lie on.

use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DVec2, DVec3};

/// Triangles with what is known at their corners. Wound counter-clockwise as seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Corners, in the unit of the scene or file.
    pub points: Vec<DVec3>,
    /// Unit normals for shading, one for each point; empty for flat triangles.
    pub normals: Vec<DVec3>,
    /// Texture coordinates, one pair for each point; (0, 0) is the lower left of an image. Empty without.
    pub uvs: Vec<DVec2>,
    /// Three indices of points each.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// A flat rectangle about the origin in the plane y = 0, seen from above, `size` along x and z. The texture's left is -x, its
    /// bottom +z.
    pub fn plane(size: DVec2) -> Self {
        let corner = |u: f64, v: f64| DVec3::new((u - 0.5) * size.x, 0.0, (0.5 - v) * size.y);
        let uvs = vec![DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        Self {
            points: uvs.iter().map(|uv| corner(uv.x, uv.y)).collect(),
            normals: Vec::new(),
            uvs,
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    /// A box about the origin with these edges. Each face carries the whole texture.
    pub fn cuboid(size: DVec3) -> Self {
        let mut mesh = Self::default();
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let mut n = DVec3::ZERO;
                n[axis] = side;
                // Upright on the walls: v goes up.
                let v = if axis == 1 { DVec3::NEG_Z * side } else { DVec3::Y };
                let u = v.cross(n);
                let first = mesh.points.len() as u32;
                for uv in [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y] {
                    let p = n + (2.0 * uv.x - 1.0) * u + (2.0 * uv.y - 1.0) * v;
                    mesh.points.push(0.5 * p * size);
                    mesh.uvs.push(uv);
                }
                mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            }
        }
        mesh
    }

    /// A ball about the origin with `segments` triangles around.
    pub fn sphere(radius: f64, segments: u32) -> Self {
        let rows = (segments / 2).max(2);
        let profile: Vec<DVec2> = (0..=rows)
            .map(|i| {
                let (sin, cos) = (PI * f64::from(i) / f64::from(rows)).sin_cos();
                // From the south pole up; a pole has no sine left over.
                DVec2::new(if i == rows { 0.0 } else { sin }, -cos)
            })
            .collect();
        let mut mesh = Self::default();
        let points: Vec<DVec2> = profile.iter().map(|p| radius * *p).collect();
        mesh.add_strip(&points, &profile, segments);
        mesh
    }

    /// An upright cylinder about the origin, closed at both ends.
    pub fn cylinder(radius: f64, height: f64, segments: u32) -> Self {
        let h = 0.5 * height;
        let mut mesh = Self::default();
        let mut strip = |a: DVec2, b: DVec2, n: DVec2| mesh.add_strip(&[a, b], &[n, n], segments);
        strip(DVec2::new(0.0, -h), DVec2::new(radius, -h), DVec2::NEG_Y);
        strip(DVec2::new(radius, -h), DVec2::new(radius, h), DVec2::X);
        strip(DVec2::new(radius, h), DVec2::new(0.0, h), DVec2::Y);
        mesh
    }

    /// The surface that a profile of radius and height, from the bottom up, sweeps about the y axis: smooth along the
    /// profile but where it turns by more than 40 degrees.
    pub fn revolution(profile: &[DVec2], segments: u32) -> Self {
        let mut mesh = Self::default();
        let edge_normal = |i: usize| {
            let d = profile[i + 1] - profile[i];
            DVec2::new(d.y, -d.x).normalize_or(DVec2::X)
        };
        let edges = profile.len().saturating_sub(1);
        let creased = |i: usize| edge_normal(i - 1).dot(edge_normal(i)) < 40f64.to_radians().cos();
        let mut start = 0;
        for end in 1..=edges {
            if end < edges && !creased(end) {
                continue;
            }
            let normals: Vec<DVec2> = (start..=end)
                .map(|i| {
                    let below = edge_normal(i.max(start + 1) - 1);
                    let above = edge_normal(i.min(end - 1));
                    (below + above).normalize_or(above)
                })
                .collect();
            mesh.add_strip(&profile[start..=end], &normals, segments);
            start = end;
        }
        mesh
    }

    /// Adds a strip of a surface of revolution. Texture: once around, and from 0 to 1 along the profile.
    fn add_strip(&mut self, profile: &[DVec2], normals: &[DVec2], segments: u32) {
        let first = self.points.len() as u32;
        let columns = segments + 1;
        let lengths: Vec<f64> = std::iter::once(0.0)
            .chain(profile.windows(2).scan(0.0, |sum, w| {
                *sum += w[0].distance(w[1]);
                Some(*sum)
            }))
            .collect();
        let total = lengths[lengths.len() - 1].max(1e-300);
        for ((p, n), length) in profile.iter().zip(normals).zip(&lengths) {
            for column in 0..columns {
                let u = f64::from(column) / f64::from(segments);
                // The seam is behind; seen from the front, u grows to the right.
                let (sin, cos) = (TAU * u).sin_cos();
                let around = |v: DVec2| DVec3::new(-v.x * sin, v.y, -v.x * cos);
                self.points.push(around(*p));
                self.normals.push(around(*n));
                self.uvs.push(DVec2::new(u, length / total));
            }
        }
        for row in 0..profile.len() as u32 - 1 {
            for column in 0..segments {
                let a = first + row * columns + column;
                let (b, c, d) = (a + 1, a + columns + 1, a + columns);
                // At a pole one of the two has no area.
                if profile[row as usize].x > 0.0 {
                    self.triangles.push([a, b, c]);
                }
                if profile[row as usize + 1].x > 0.0 {
                    self.triangles.push([a, c, d]);
                }
            }
        }
    }

    /// Normals at the points, as means over the triangles around weighed by their area.
    pub fn smooth(&mut self) {
        let mut sums = vec![DVec3::ZERO; self.points.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|i| self.points[i as usize]);
            let normal = (b - a).cross(c - a);
            for &i in t {
                sums[i as usize] += normal;
            }
        }
        self.normals = sums.into_iter().map(|n| n.normalize_or(DVec3::Y)).collect();
    }

    /// Moves it by a transform of rotation, translation and one scale.
    pub fn transform(&mut self, by: &DAffine3) {
        for p in &mut self.points {
            *p = by.transform_point3(*p);
        }
        for n in &mut self.normals {
            *n = by.transform_vector3(*n).normalize_or(*n);
        }
    }

    /// The box around it; `None` if it is empty.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        self.points.iter().map(|&p| (p, p)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume inside and area, by the divergence theorem: right only if all triangles face outward.
    fn measure(mesh: &Mesh) -> (f64, f64) {
        let mut out = (0.0, 0.0);
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.points[i as usize]);
            out.0 += a.dot(b.cross(c)) / 6.0;
            out.1 += 0.5 * (b - a).cross(c - a).length();
        }
        out
    }

    fn sound(mesh: &Mesh) {
        let n = mesh.points.len();
        assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < n));
        assert!(mesh.uvs.len() == n && (mesh.normals.is_empty() || mesh.normals.len() == n));
        assert!(mesh.uvs.iter().all(|uv| uv.min_element() >= 0.0 && uv.max_element() <= 1.0 + 1e-12));
        if mesh.normals.is_empty() {
            return;
        }
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.points[i as usize]);
            let face = (b - a).cross(c - a).normalize();
            for &i in t {
                let normal = mesh.normals[i as usize];
                assert!((normal.length() - 1.0).abs() < 1e-9 && normal.dot(face) > 0.7, "{normal} {face}");
            }
        }
    }

    #[test]
    fn shapes_are_closed_and_face_outward() {
        let close = |(v, a): (f64, f64), volume: f64, area: f64| {
            assert!((v / volume - 1.0).abs() < 0.01 && (a / area - 1.0).abs() < 0.01, "{v} {volume}, {a} {area}");
        };
        let ball = Mesh::sphere(2.0, 96);
        sound(&ball);
        close(measure(&ball), 4.0 / 3.0 * PI * 8.0, 4.0 * PI * 4.0);
        let cylinder = Mesh::cylinder(1.5, 4.0, 96);
        sound(&cylinder);
        close(measure(&cylinder), PI * 2.25 * 4.0, TAU * 1.5 * 4.0 + TAU * 2.25);
        let cuboid = Mesh::cuboid(DVec3::new(1.0, 2.0, 3.0));
        sound(&cuboid);
        close(measure(&cuboid), 6.0, 22.0);
        let bowl = [[0.0, -1.0], [1.0, -1.0], [1.0, 1.0], [0.0, 1.0]].map(DVec2::from);
        let turned = Mesh::revolution(&bowl, 96);
        sound(&turned);
        close(measure(&turned), TAU, TAU * 2.0 + TAU);
    }

    #[test]
    fn textures_stand_upright_on_what_faces_the_viewer() {
        // Of all points that face +z, u grows with x and v with y.
        for mesh in [Mesh::sphere(1.0, 64), Mesh::cylinder(1.0, 2.0, 64), Mesh::cuboid(DVec3::ONE)] {
            for t in &mesh.triangles {
                let corner = |k: usize| (mesh.points[t[k] as usize], mesh.uvs[t[k] as usize]);
                let [(a, ua), (b, ub), (c, uc)] = [corner(0), corner(1), corner(2)];
                let face = (b - a).cross(c - a).normalize();
                if face.z > 0.8 {
                    for ((p, up), (q, uq)) in [((a, ua), (b, ub)), ((b, ub), (c, uc)), ((c, uc), (a, ua))] {
                        assert!((q.x - p.x) * (uq.x - up.x) >= -1e-9 && (q.y - p.y) * (uq.y - up.y) >= -1e-9);
                    }
                }
            }
        }
        let plane = Mesh::plane(DVec2::new(4.0, 2.0));
        let at = |uv: DVec2| plane.points[plane.uvs.iter().position(|&w| w == uv).unwrap()];
        assert_eq!(at(DVec2::ZERO), DVec3::new(-2.0, 0.0, 1.0));
        assert_eq!(at(DVec2::ONE), DVec3::new(2.0, 0.0, -1.0));
        assert!(measure(&plane).1 == 8.0);
    }

    #[test]
    fn smooth_normals_and_transforms_agree() {
        let mut ball = Mesh::sphere(1.0, 64);
        // A seam and poles apart, whose triangles lie on one side only.
        let exact = std::mem::take(&mut ball.normals);
        ball.smooth();
        let middle = ball.points.iter().position(|p| p.z > 0.99).unwrap();
        assert!(ball.normals[middle].dot(exact[middle]) > 0.9999);
        let turn = DAffine3::from_scale_rotation_translation(
            DVec3::splat(3.0),
            glam::DQuat::from_rotation_x(1.0),
            DVec3::new(1.0, 2.0, 3.0),
        );
        ball.transform(&turn);
        let (low, high) = ball.bounds().unwrap();
        assert!(
            (low - DVec3::new(-2.0, -1.0, 0.0)).length() < 0.02 && (high - DVec3::new(4.0, 5.0, 6.0)).length() < 0.02
        );
        assert!(ball.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-9));
    }
}
