//! Smooth surfaces from triangles: Loop's subdivision, with the control points moved so that the limit passes through the
//! mesh's own vertices.
//!
//! C. Loop, "Smooth Subdivision Surfaces Based on Triangles", 1987; limit positions as in Hoppe et al., "Piecewise Smooth
//! Surface Reconstruction", 1994. Positions and texture coordinates are refined by the same rules, so that one is a
//! smooth function of the other and cloth does not show the triangles.

use std::{collections::HashMap, f64::consts::TAU};

use glam::DVec3;
use rayon::prelude::*;

/// Triangles over values, and what lies around each vertex.
#[derive(Clone, Debug)]
pub(super) struct Topology {
    pub(super) faces: Vec<[u32; 3]>,
    vertices: usize,
    /// Neighbours of vertex i: `around[starts[i]..starts[i + 1]]`; those on the border come first.
    starts: Vec<u32>,
    around: Vec<u32>,
    /// How many of a vertex's edges lie on the border: 0 inside, 2 on a plain border.
    border: Vec<u8>,
    /// Border vertices that stay where they are.
    corner: Vec<bool>,
    /// Each edge with the vertices opposite it.
    edges: Vec<Edge>,
    /// The edges of each face, from corner k to the next.
    face_edges: Vec<[u32; 3]>,
}

#[derive(Clone, Copy, Debug)]
struct Edge {
    ends: [u32; 2],
    /// The vertices across; the second equals the first on a border.
    opposite: [u32; 2],
    faces: u8,
}

impl Topology {
    /// Of triangles over so many vertices.
    pub(super) fn new(faces: Vec<[u32; 3]>, vertices: usize) -> Self {
        let mut known: HashMap<[u32; 2], u32> = HashMap::with_capacity(faces.len() * 3 / 2);
        let mut key = |a: u32, b: u32| {
            let next = known.len() as u32;
            *known.entry([a.min(b), a.max(b)]).or_insert(next)
        };
        let keys: Vec<[u32; 3]> = faces.iter().map(|&[a, b, c]| [key(a, b), key(b, c), key(c, a)]).collect();
        let count = known.len();
        Self::with_keys(faces, vertices, &keys, count)
    }

    /// Of triangles and, for each of their sides, a number below `count` that is the same for both sides of an edge.
    fn with_keys(faces: Vec<[u32; 3]>, vertices: usize, keys: &[[u32; 3]], count: usize) -> Self {
        const UNSEEN: u32 = u32::MAX;
        let mut places = vec![UNSEEN; count];
        let mut edges: Vec<Edge> = Vec::with_capacity(count);
        let face_edges: Vec<[u32; 3]> = faces
            .iter()
            .zip(keys)
            .map(|(f, keys)| {
                [0, 1, 2].map(|k| {
                    let (a, b, c) = (f[k], f[(k + 1) % 3], f[(k + 2) % 3]);
                    let place = &mut places[keys[k] as usize];
                    if *place == UNSEEN {
                        *place = edges.len() as u32;
                        edges.push(Edge { ends: [a, b], opposite: [c, c], faces: 1 });
                    } else {
                        let edge = &mut edges[*place as usize];
                        if edge.faces == 1 {
                            edge.opposite[1] = c;
                        }
                        edge.faces = edge.faces.saturating_add(1);
                    }
                    *place
                })
            })
            .collect();
        let mut count = vec![0_u32; vertices];
        let mut border = vec![0_u8; vertices];
        for edge in &edges {
            for v in edge.ends {
                count[v as usize] += 1;
                border[v as usize] = border[v as usize].saturating_add(u8::from(edge.faces != 2));
            }
        }
        let mut starts = vec![0_u32; vertices + 1];
        for v in 0..vertices {
            starts[v + 1] = starts[v] + count[v];
        }
        let mut at: Vec<u32> = starts[..vertices].to_vec();
        let mut around = vec![0; starts[vertices] as usize];
        for on_border in [true, false] {
            for edge in edges.iter().filter(|e| (e.faces != 2) == on_border) {
                for (v, other) in [(edge.ends[0], edge.ends[1]), (edge.ends[1], edge.ends[0])] {
                    around[at[v as usize] as usize] = other;
                    at[v as usize] += 1;
                }
            }
        }
        let corner = border.iter().map(|&b| b != 0 && b != 2).collect();
        Self { faces, vertices, starts, around, border, corner, edges, face_edges }
    }

    /// Vertices at which the border turns by more than `angle` (radians) stay where they are.
    pub(super) fn pin_corners(&mut self, values: &[DVec3], angle: f64) {
        for v in 0..self.vertices {
            if self.border[v] == 2 {
                let [a, b] = [0, 1].map(|k| values[self.around_of(v)[k] as usize] - values[v]);
                self.corner[v] |= a.angle_between(-b) > angle;
            }
        }
    }

    /// The neighbours of a vertex.
    pub(super) fn around_of(&self, v: usize) -> &[u32] {
        &self.around[self.starts[v] as usize..self.starts[v + 1] as usize]
    }

    /// Edges with one face, or with more than two.
    pub(super) fn is_border(&self, face: usize, k: usize) -> bool {
        self.edges[self.face_edges[face][k] as usize].faces != 2
    }

    /// The two vertices of each edge.
    pub(super) fn edge_ends(&self) -> impl IndexedParallelIterator<Item = [u32; 2]> {
        self.edges.par_iter().map(|e| e.ends)
    }

    /// A length for each edge from that of each side of a face, which `of` tells: the mean of both where two meet.
    pub(super) fn edge_lengths(&self, of: impl Fn(usize, usize) -> f64) -> Vec<f64> {
        let mut lengths = vec![0.0; self.edges.len()];
        for (face, edges) in self.face_edges.iter().enumerate() {
            for (k, &edge) in edges.iter().enumerate() {
                lengths[edge as usize] += of(face, k) / f64::from(self.edges[edge as usize].faces);
            }
        }
        lengths
    }

    /// Vertex v times `own` plus its ring times `ring` in all; on a border only along that, by `border`.
    fn mixed(&self, v: usize, values: &[DVec3], ring: impl Fn(usize) -> f64, border: f64) -> DVec3 {
        let around = self.around_of(v);
        if self.corner[v] || around.is_empty() {
            return values[v];
        }
        if self.border[v] == 2 {
            let both = values[around[0] as usize] + values[around[1] as usize];
            return values[v] * (1.0 - 2.0 * border) + both * border;
        }
        let share = ring(around.len());
        let sum: DVec3 = around.iter().map(|&i| values[i as usize]).sum();
        values[v] * (1.0 - share * around.len() as f64) + sum * share
    }

    /// Where vertices go in the limit.
    pub(super) fn limit(&self, values: &[DVec3]) -> Vec<DVec3> {
        // beta of the refinement, and 1 / (3 / (8 beta) + n) of the limit.
        let ring = |n: usize| 1.0 / (0.375 / beta(n) + n as f64);
        (0..self.vertices).into_par_iter().map(|v| self.mixed(v, values, ring, 1.0 / 6.0)).collect()
    }

    /// Control points whose limit passes near the values.
    pub(super) fn through(&self, values: &[DVec3]) -> Vec<DVec3> {
        let mut control = values.to_vec();
        for _ in 0..4 {
            let limit = self.limit(&control);
            for ((c, l), v) in control.iter_mut().zip(&limit).zip(values) {
                *c += *v - *l;
            }
        }
        control
    }

    /// The topology of one refinement: face i becomes faces 4 i to 4 i + 3. New vertices follow the old ones, in the
    /// order of edges.
    pub(super) fn refined(&self) -> Self {
        let first = self.vertices as u32;
        let halves = 2 * self.edges.len() as u32;
        let mut faces = Vec::with_capacity(4 * self.faces.len());
        let mut keys = Vec::with_capacity(4 * self.faces.len());
        for (i, (&[a, b, c], e)) in self.faces.iter().zip(&self.face_edges).enumerate() {
            let [ab, bc, ca] = e.map(|e| first + e);
            faces.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
            // Each edge becomes two, by the end that they keep, and each face has three of its own: nothing is looked up.
            let half = |k: usize, end: u32| 2 * e[k] + u32::from(self.edges[e[k] as usize].ends[1] == end);
            let [by_a, by_b, by_c] = [0, 1, 2].map(|k| halves + 3 * i as u32 + k);
            keys.extend([
                [half(0, a), by_a, half(2, a)],
                [half(0, b), half(1, b), by_b],
                [by_c, half(1, c), half(2, c)],
                [by_b, by_c, by_a],
            ]);
        }
        let count = halves as usize + 3 * self.faces.len();
        let mut fine = Self::with_keys(faces, self.vertices + self.edges.len(), &keys, count);
        for v in 0..self.vertices {
            fine.corner[v] |= self.corner[v];
        }
        fine
    }

    /// Values at the vertices of [`Self::refined`].
    pub(super) fn refine(&self, values: &[DVec3]) -> Vec<DVec3> {
        let old = (0..self.vertices).into_par_iter().map(|v| self.mixed(v, values, beta, 0.125));
        let new = self.edges.par_iter().map(|e| {
            let [a, b] = e.ends.map(|v| values[v as usize]);
            if e.faces != 2 {
                return 0.5 * (a + b);
            }
            let [c, d] = e.opposite.map(|v| values[v as usize]);
            0.375 * (a + b) + 0.125 * (c + d)
        });
        old.chain(new).collect()
    }
}

/// The weight of each of n neighbours in a refinement.
fn beta(n: usize) -> f64 {
    match n {
        6 => 0.0625,
        n => (0.625 - (0.375 + 0.25 * (TAU / n as f64).cos()).powi(2)) / n as f64,
    }
}

/// Unit normals at vertices, as means over the triangles around weighed by their area.
pub(super) fn normals(faces: &[[u32; 3]], points: &[DVec3]) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; points.len()];
    for f in faces {
        let [a, b, c] = f.map(|i| points[i as usize]);
        let normal = (b - a).cross(c - a);
        for &i in f {
            sums[i as usize] += normal;
        }
    }
    sums.into_par_iter().map(|n| n.normalize_or(DVec3::Y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::mesh::Mesh;

    #[test]
    fn a_plane_stays_a_plane_with_its_corners() {
        let n = 5;
        let points: Vec<DVec3> = (0..n * n).map(|i| DVec3::new(f64::from(i % n), f64::from(i / n), 0.0)).collect();
        let n = n as u32;
        let faces: Vec<[u32; 3]> = (0..n - 1)
            .flat_map(|y| (0..n - 1).map(move |x| y * n + x))
            .flat_map(|i| [[i, i + 1, i + n + 1], [i, i + n + 1, i + n]])
            .collect();
        let mut coarse = Topology::new(faces, points.len());
        coarse.pin_corners(&points, 0.7);
        let control = coarse.through(&points);
        let fine = coarse.refined();
        let values = fine.limit(&coarse.refine(&control));
        assert!(values.iter().all(|p| p.z.abs() < 1e-12));
        for (v, p) in points.iter().enumerate() {
            assert!(values[v].distance(*p) < 0.01, "{v}: {} {p}", values[v]);
        }
        assert_eq!(fine.faces.len(), 4 * coarse.faces.len());
    }

    /// Two triangles that share all three edges, as at the corner of a pillow, are closed, and stay so.
    #[test]
    fn faces_that_share_two_edges_keep_edges_of_their_own() {
        let mut both = Topology::new(vec![[0, 1, 2], [0, 2, 1]], 3);
        for _ in 0..3 {
            let borders = |face: usize| (0..3).filter(|&k| both.is_border(face, k)).count();
            assert_eq!((0..both.faces.len()).map(borders).sum::<usize>(), 0);
            assert_eq!(2 * both.edges.len(), 3 * both.faces.len());
            both = both.refined();
        }
    }

    /// Edges are as they are found anew from the refined faces.
    #[test]
    fn refined_edges_are_those_of_the_faces() {
        let grid = |i: u32, j: u32| i * 4 + j;
        let cell = |i: u32, j: u32| {
            [[grid(i, j), grid(i + 1, j), grid(i + 1, j + 1)], [grid(i, j), grid(i + 1, j + 1), grid(i, j + 1)]]
        };
        let faces: Vec<[u32; 3]> = (0..3).flat_map(|i| (0..3).flat_map(move |j| cell(i, j))).collect();
        let fine = Topology::new(faces, 16).refined().refined();
        let anew = Topology::new(fine.faces.clone(), fine.vertices);
        assert_eq!((fine.face_edges, fine.around, fine.border), (anew.face_edges, anew.around, anew.border));
    }

    #[test]
    fn a_ball_becomes_round() {
        let ball = Mesh::sphere(1.0, 16);
        // Welded: the seam and the poles are one.
        let mut unique: Vec<DVec3> = Vec::new();
        let place: Vec<u32> = ball
            .points
            .iter()
            .map(|p| {
                unique.iter().position(|q| q.distance(*p) < 1e-9).unwrap_or_else(|| {
                    unique.push(*p);
                    unique.len() - 1
                }) as u32
            })
            .collect();
        let faces: Vec<[u32; 3]> = ball.triangles.iter().map(|t| t.map(|i| place[i as usize])).collect();
        let mut topology = Topology::new(faces, unique.len());
        let mut values = topology.through(&unique);
        for _ in 0..2 {
            values = topology.refine(&values);
            topology = topology.refined();
        }
        let points = topology.limit(&values);
        let off = points.iter().map(|p| (p.length() - 1.0).abs()).fold(0.0, f64::max);
        // The chords of 16 triangles around are off by 0.019.
        assert!(off < 0.008, "{off}");
        let normals = normals(&topology.faces, &points);
        let worst = points.iter().zip(&normals).map(|(p, n)| p.normalize().dot(*n)).fold(1.0, f64::min);
        assert!(worst > 0.99, "{worst}");
    }
}
