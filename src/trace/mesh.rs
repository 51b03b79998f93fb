//! Meshes as rays meet them.

use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3, Vec3A};

use crate::{
    ffi::embree::RawHit,
    geometry::{mesh::Mesh, ray::Ray},
};

/// A mesh in single precision.
#[derive(Debug)]
pub struct TriangleMesh {
    /// Corners.
    pub(super) points: Arc<[Vec3A]>,
    /// Three indices for each triangle.
    pub(super) triangles: Arc<[[u32; 3]]>,
    /// For each point, or empty.
    normals: Vec<Vec3>,
    /// For each point, or empty.
    uvs: Vec<Vec2>,
    material: usize,
    /// The points one frame later, or empty.
    next: Vec<Vec3A>,
}

/// A place on a mesh or on the ground.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePlace {
    /// Where it is.
    pub point: Vec3A,
    /// Where it is one frame later.
    pub next: Vec3A,
    /// Unit normal of the flat surface, on the side from which the ray came.
    pub normal: Vec3A,
    /// Unit normal for shading, on the same side.
    pub shading: Vec3A,
    /// Texture coordinates; zero for a mesh without.
    pub uv: Vec2,
    /// By how much texture coordinates change per millimetre across the surface; zero for a mesh without.
    pub uv_per_length: f32,
    /// Index into the scene's materials.
    pub material: usize,
    /// Index of the mesh; `None` for the ground.
    pub mesh: Option<u32>,
}

impl TriangleMesh {
    /// Of a mesh in millimetres, its points one frame later (none if it stands still), and the index of its material.
    pub fn new(mesh: &Mesh, next: &[DVec3], material: usize) -> Self {
        Self {
            points: mesh.points.iter().map(|p| p.as_vec3a()).collect(),
            triangles: mesh.triangles.iter().copied().collect(),
            normals: mesh.normals.iter().map(|n| n.as_vec3()).collect(),
            uvs: mesh.uvs.iter().map(|uv| uv.as_vec2()).collect(),
            material,
            next: next.iter().map(|p| p.as_vec3a()).collect(),
        }
    }

    pub(super) fn bytes(&self) -> u64 {
        (size_of_val(&*self.points)
            + size_of_val(&*self.triangles)
            + size_of_val(&*self.normals)
            + size_of_val(&*self.uvs)
            + size_of_val(&*self.next)) as u64
    }

    /// What is at a hit.
    pub(super) fn place(&self, index: usize, ray: &Ray, hit: &RawHit) -> SurfacePlace {
        let corners = self.triangles[hit.segment as usize].map(|i| i as usize);
        let [a, b, c] = corners.map(|i| self.points[i]);
        let (u, v) = (hit.u, hit.v);
        // From the corners, which rounds less than from the far end of the ray.
        let at = |[a, b, c]: [Vec3A; 3]| a + u * (b - a) + v * (c - a);
        let point = at([a, b, c]);
        let next = if self.next.is_empty() { point } else { at(corners.map(|i| self.next[i])) };
        let towards = |n: Vec3A| if n.dot(ray.direction) > 0.0 { -n } else { n };
        let across = (b - a).cross(c - a);
        let normal = towards(across.normalize_or(-ray.direction));
        let mut shading = normal;
        if !self.normals.is_empty() {
            let [na, nb, nc] = corners.map(|i| Vec3A::from(self.normals[i]));
            let smooth = (na + u * (nb - na) + v * (nc - na)).normalize_or(normal);
            let smooth = if smooth.dot(normal) < 0.0 { -smooth } else { smooth };
            // Seen from behind the smooth surface, only the flat one can tell what is in front.
            if smooth.dot(ray.direction) < -1e-3 {
                shading = smooth;
            }
        }
        let (mut uv, mut uv_per_length) = (Vec2::ZERO, 0.0);
        if !self.uvs.is_empty() {
            let [ta, tb, tc] = corners.map(|i| self.uvs[i]);
            uv = ta + u * (tb - ta) + v * (tc - ta);
            uv_per_length = ((tb - ta).perp_dot(tc - ta).abs() / across.length().max(1e-30)).sqrt();
        }
        SurfacePlace {
            point,
            next,
            normal,
            shading,
            uv,
            uv_per_length,
            material: self.material,
            mesh: Some(index as u32),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    #[test]
    fn a_place_has_point_normals_and_texture_of_its_triangle() {
        let mut mesh = Mesh::plane(DVec2::new(4.0, 2.0));
        mesh.normals = vec![DVec3::new(0.1, 1.0, 0.0).normalize(); 4];
        let next: Vec<DVec3> = mesh.points.iter().map(|p| *p * 2.0).collect();
        let mesh = TriangleMesh::new(&mesh, &next, 3);
        let ray = Ray::new(Vec3A::new(0.0, 3.0, 0.0), Vec3A::NEG_Y);
        let hit = |u, v| RawHit { t: 3.0, normal: Vec3A::Y, u, v, segment: 0, geometry: 0 };
        let place = mesh.place(0, &ray, &hit(0.25, 0.5));
        assert!((place.point - Vec3A::new(1.0, 0.0, 0.0)).length() < 1e-6, "{place:?}");
        assert!((place.next - Vec3A::new(2.0, 0.0, 0.0)).length() < 1e-6, "{place:?}");
        assert!((place.uv - Vec2::new(0.75, 0.5)).length() < 1e-6);
        assert!((place.uv_per_length - 1.0 / 8f32.sqrt()).abs() < 1e-6);
        assert_eq!((place.normal, place.material), (Vec3A::Y, 3));
        assert!(place.shading.x > 0.05 && place.shading.y > 0.9);
        // From below both normals point down.
        let below = mesh.place(0, &Ray::new(Vec3A::new(0.0, -3.0, 0.0), Vec3A::Y), &hit(0.25, 0.5));
        assert!(below.normal == Vec3A::NEG_Y && below.shading.y < -0.9);
    }
}
