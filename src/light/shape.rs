//! Surfaces that shine: meeting them with a ray, drawing directions towards them, and with what density.
//!
//! A sphere is drawn by the cone in which it is seen, a rectangle by its solid angle (Ureña, Fajardo, King: "An
//! Area-Preserving Parametrization for Spherical Rectangles", EGSR 2013), a disk by its area.

use std::{f32::consts::PI, f64::consts::TAU};

use glam::{DVec2, Vec2, Vec3A};

use crate::math::{frame::orthonormal_basis, warp};

/// A surface, millimetres about the scene's middle. What is flat shines to the side of its normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A rectangle with `corner` and the unit vectors `x` and `y` along its edges; its normal is x cross y.
    Rectangle {
        /// The corner from which both edges start.
        corner: Vec3A,
        /// Unit vector along the first edge.
        x: Vec3A,
        /// Unit vector along the second edge.
        y: Vec3A,
        /// Lengths of the edges.
        size: Vec2,
    },
    /// A disk.
    Disk {
        /// Its middle.
        centre: Vec3A,
        /// Unit normal.
        normal: Vec3A,
        /// Its radius.
        radius: f32,
    },
    /// A ball, shining outward.
    Sphere {
        /// Its middle.
        centre: Vec3A,
        /// Its radius.
        radius: f32,
    },
}

/// A direction drawn towards a shape.
#[derive(Clone, Copy, Debug)]
pub struct ShapeSample {
    /// Unit vector.
    pub direction: Vec3A,
    /// How far the shape is in this direction.
    pub distance: f32,
    /// Density per steradian.
    pub pdf: f32,
}

/// Below this solid angle a rectangle is drawn by area: its solid angle is a difference of numbers near 2 pi.
const SMALLEST_SOLID_ANGLE: f64 = 1e-7;

impl Shape {
    /// Its middle.
    pub fn centre(&self) -> Vec3A {
        match *self {
            Self::Rectangle { corner, x, y, size } => corner + 0.5 * (size.x * x + size.y * y),
            Self::Disk { centre, .. } | Self::Sphere { centre, .. } => centre,
        }
    }

    /// The largest area that it shows to any side.
    pub fn area(&self) -> f32 {
        match *self {
            Self::Rectangle { size, .. } => size.x * size.y,
            Self::Disk { radius, .. } | Self::Sphere { radius, .. } => PI * radius * radius,
        }
    }

    /// Unit normal of what is flat.
    pub fn normal(&self) -> Option<Vec3A> {
        match *self {
            Self::Rectangle { x, y, .. } => Some(x.cross(y)),
            Self::Disk { normal, .. } => Some(normal),
            Self::Sphere { .. } => None,
        }
    }

    /// The same, moved.
    pub fn moved(self, by: Vec3A) -> Self {
        match self {
            Self::Rectangle { corner, x, y, size } => Self::Rectangle { corner: corner + by, x, y, size },
            Self::Disk { centre, normal, radius } => Self::Disk { centre: centre + by, normal, radius },
            Self::Sphere { centre, radius } => Self::Sphere { centre: centre + by, radius },
        }
    }

    /// Where a ray from `origin` in the unit direction `direction` meets the side that shines: its distance, above 0.
    #[inline]
    pub fn intersect(&self, origin: Vec3A, direction: Vec3A, two_sided: bool) -> Option<f32> {
        let plane = |point: Vec3A, normal: Vec3A| {
            let slope = direction.dot(normal);
            if slope == 0.0 || (slope > 0.0 && !two_sided) {
                return None;
            }
            let t = (point - origin).dot(normal) / slope;
            (t > 0.0 && t.is_finite()).then_some(t)
        };
        match *self {
            Self::Rectangle { corner, x, y, size } => {
                let t = plane(corner, x.cross(y))?;
                let p = origin + t * direction - corner;
                let (a, b) = (p.dot(x), p.dot(y));
                (a >= 0.0 && b >= 0.0 && a <= size.x && b <= size.y).then_some(t)
            }
            Self::Disk { centre, normal, radius } => {
                let t = plane(centre, normal)?;
                ((origin + t * direction - centre).length_squared() <= radius * radius).then_some(t)
            }
            Self::Sphere { centre, radius } => {
                let way = centre - origin;
                let along = way.dot(direction);
                // From the nearest point of the ray: no difference of large squares.
                let off = (way - along * direction).length_squared();
                let inside = way.length_squared() <= radius * radius;
                (!inside && along > 0.0 && off <= radius * radius)
                    .then(|| along - (radius * radius - off).max(0.0).sqrt())
            }
        }
    }

    /// Draws a direction from `at`; `None` where the shape shows no side that shines.
    #[inline]
    pub fn sample(&self, at: Vec3A, u: Vec2, two_sided: bool) -> Option<ShapeSample> {
        let to_point = |point: Vec3A, normal: Vec3A, area: f32| {
            let way = point - at;
            let square = way.length_squared();
            let distance = square.sqrt();
            let direction = way / distance.max(1e-20);
            let slope = facing(direction.dot(normal), two_sided)?;
            let pdf = square / (slope * area);
            (pdf > 0.0 && pdf.is_finite()).then_some(ShapeSample { direction, distance, pdf })
        };
        match *self {
            Self::Rectangle { corner, x, y, size } => {
                let normal = x.cross(y);
                facing((corner - at).dot(normal), two_sided)?;
                let seen = SphericalRectangle::new(corner - at, x, y, size);
                if seen.solid_angle < SMALLEST_SOLID_ANGLE {
                    return to_point(corner + u.x * size.x * x + u.y * size.y * y, normal, size.x * size.y);
                }
                let p = seen.sample(u);
                let way = p.x * x + p.y * y + (corner - at).dot(normal) * normal;
                let distance = way.length();
                let pdf = (1.0 / seen.solid_angle) as f32;
                (distance > 0.0).then(|| ShapeSample { direction: way / distance, distance, pdf })
            }
            Self::Disk { centre, normal, radius } => {
                let (x, y) = orthonormal_basis(normal);
                let p = radius * warp::disc(u);
                to_point(centre + p.x * x + p.y * y, normal, PI * radius * radius)
            }
            Self::Sphere { centre, radius } => {
                let way = centre - at;
                let square = way.length_squared();
                let one_minus_cos = cone_of_sphere(square, radius)?;
                let distance = square.sqrt();
                let axis = way / distance;
                let (x, y) = orthonormal_basis(axis);
                let w = warp::cone(u, one_minus_cos);
                let off = square * (1.0 - w.z) * (1.0 + w.z);
                let distance = distance * w.z - (radius * radius - off).max(0.0).sqrt();
                let direction = w.x * x + w.y * y + w.z * axis;
                Some(ShapeSample { direction, distance, pdf: 1.0 / (2.0 * PI * one_minus_cos) })
            }
        }
    }

    /// How far the side that shines is from `at` in a unit direction, and the density (1/steradian) with which [`Self::sample`] from there
    /// draws that direction.
    #[inline]
    pub fn seen(&self, at: Vec3A, direction: Vec3A, two_sided: bool) -> Option<(f32, f32)> {
        let t = self.intersect(at, direction, two_sided)?;
        let by_area = |normal: Vec3A, area: f32| t * t / (direction.dot(normal).abs() * area).max(1e-30);
        let pdf = match *self {
            Self::Rectangle { corner, x, y, size } => {
                let solid_angle = SphericalRectangle::new(corner - at, x, y, size).solid_angle;
                if solid_angle < SMALLEST_SOLID_ANGLE {
                    by_area(x.cross(y), size.x * size.y)
                } else {
                    (1.0 / solid_angle) as f32
                }
            }
            Self::Disk { normal, radius, .. } => by_area(normal, PI * radius * radius),
            Self::Sphere { centre, radius } => {
                cone_of_sphere((centre - at).length_squared(), radius).map_or(0.0, |c| 1.0 / (2.0 * PI * c))
            }
        };
        Some((t, pdf))
    }
}

/// The cosine towards the side that shines, if it is that side.
#[inline]
fn facing(along_normal: f32, two_sided: bool) -> Option<f32> {
    let cos = if two_sided { along_normal.abs() } else { -along_normal };
    (cos > 0.0).then_some(cos)
}

/// 1 - cos of the half angle under which a sphere is seen from outside.
#[inline]
fn cone_of_sphere(distance_squared: f32, radius: f32) -> Option<f32> {
    let sin_squared = radius * radius / distance_squared;
    (sin_squared < 1.0).then(|| sin_squared / (1.0 + (1.0 - sin_squared).sqrt()))
}

/// A rectangle on the unit sphere about the origin, in its own axes; in double precision, since its solid angle is a
/// small difference of large angles.
struct SphericalRectangle {
    low: DVec2,
    high: DVec2,
    /// Its plane's distance, negative.
    z: f64,
    /// z of the normals of the planes through the lower and the upper edge along x.
    b0: f64,
    b1: f64,
    k: f64,
    solid_angle: f64,
}

impl SphericalRectangle {
    #[inline]
    fn new(corner: Vec3A, x: Vec3A, y: Vec3A, size: Vec2) -> Self {
        let low = DVec2::new(f64::from(corner.dot(x)), f64::from(corner.dot(y)));
        let high = low + size.as_dvec2();
        let z = -f64::from(corner.dot(x.cross(y))).abs();
        let normal_z = |along: f64| along / (z * z + along * along).sqrt().max(1e-300);
        let n = [normal_z(-low.y), normal_z(high.x), normal_z(high.y), normal_z(-low.x)];
        let angle = |i: usize, j: usize| (-n[i] * n[j]).clamp(-1.0, 1.0).acos();
        let k = TAU - angle(2, 3) - angle(3, 0);
        let solid_angle = angle(0, 1) + angle(1, 2) - k;
        Self { low, high, z, b0: n[0], b1: n[2], k, solid_angle }
    }

    /// The point of the rectangle, in its axes, for two uniform numbers.
    #[inline]
    fn sample(&self, u: Vec2) -> Vec2 {
        let a = f64::from(u.x) * self.solid_angle + self.k;
        let (sin, cos) = a.sin_cos();
        let f = (cos * self.b0 - self.b1) / sin;
        let c = (1.0 / (f * f + self.b0 * self.b0).sqrt()).copysign(f).clamp(-1.0, 1.0);
        let x = (-(c * self.z) / (1.0 - c * c).max(1e-300).sqrt()).clamp(self.low.x, self.high.x);
        let square = x * x + self.z * self.z;
        let edge = |y: f64| y / (square + y * y).sqrt();
        let h = edge(self.low.y) + f64::from(u.y) * (edge(self.high.y) - edge(self.low.y));
        let y = h * (square / (1.0 - h * h).max(1e-300)).sqrt();
        DVec2::new(x, y.clamp(self.low.y, self.high.y)).as_vec2()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{frame::sin_cos, sampler::Stream};

    const N: u32 = 60_000;

    fn uniform_direction(stream: &mut Stream) -> Vec3A {
        let z = 2.0 * stream.next() - 1.0;
        let (s, c) = sin_cos(2.0 * PI * stream.next());
        let r = (1.0 - z * z).sqrt();
        Vec3A::new(r * c, r * s, z)
    }

    fn rectangle(corner: [f32; 3], x: [f32; 3], y: [f32; 3], size: [f32; 2]) -> Shape {
        Shape::Rectangle { corner: corner.into(), x: x.into(), y: y.into(), size: size.into() }
    }

    /// Irradiance over radiance, by the shape's own sampling, on a surface at `at` with `normal`.
    fn irradiance(shape: &Shape, at: Vec3A, normal: Vec3A) -> f64 {
        let mut stream = Stream::new(11);
        (0..N)
            .filter_map(|_| shape.sample(at, Vec2::new(stream.next(), stream.next()), false))
            .map(|s| f64::from(s.direction.dot(normal).max(0.0) / s.pdf))
            .sum::<f64>()
            / f64::from(N)
    }

    /// Lambert's formula for the irradiance of a polygon all above the horizon.
    fn lambert(corners: [Vec3A; 4], at: Vec3A, normal: Vec3A) -> f64 {
        let edge = |i: usize| {
            let (a, b) = ((corners[i] - at).as_dvec3().normalize(), (corners[(i + 1) % 4] - at).as_dvec3().normalize());
            a.angle_between(b) * a.cross(b).normalize().dot(normal.as_dvec3())
        };
        0.5 * (0..4).map(edge).sum::<f64>().abs()
    }

    #[test]
    fn irradiance_is_that_of_the_closed_forms() {
        let at = Vec3A::new(0.2, 0.1, -0.3);
        // A sphere above the horizon: pi (r / d)^2 cos, however near.
        for (d, radius, tilt) in [(5.0f32, 1.0f32, 0.3f32), (1.2, 1.0, 0.0), (300.0, 0.5, 1.0)] {
            let sphere = Shape::Sphere { centre: at + d * Vec3A::new(tilt.sin(), 0.0, tilt.cos()), radius };
            let want = std::f64::consts::PI * f64::from((radius / d).powi(2) * tilt.cos());
            let got = irradiance(&sphere, at, Vec3A::Z);
            assert!((got / want - 1.0).abs() < 6e-3, "sphere at {d}: {got}, not {want}");
        }
        // A disk right above: pi R^2 / (R^2 + d^2).
        for (d, radius) in [(2.0f32, 1.0f32), (0.7, 2.0), (50.0, 0.1)] {
            let disk = Shape::Disk { centre: at + d * Vec3A::Z, normal: Vec3A::NEG_Z, radius };
            let want = std::f64::consts::PI * f64::from(radius * radius / (radius * radius + d * d));
            let got = irradiance(&disk, at, Vec3A::Z);
            assert!((got / want - 1.0).abs() < 2e-2, "disk at {d}: {got}, not {want}");
        }
        // A rectangle anywhere, by Lambert's formula.
        for (corner, size) in
            [([-0.5f32, -0.2, 1.0], [1.0f32, 2.0]), ([0.3, 0.3, 0.2], [4.0, 0.5]), ([9.0, 5.0, 60.0], [0.3, 0.2])]
        {
            // x cross y looks down.
            let shape = rectangle(corner, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], size);
            let c = Vec3A::from(corner);
            let (x, y) = (size[0] * Vec3A::Y, size[1] * Vec3A::X);
            let want = lambert([c, c + x, c + x + y, c + y], at, Vec3A::Z);
            let got = irradiance(&shape, at, Vec3A::Z);
            assert!((got / want - 1.0).abs() < 6e-3, "rectangle at {corner:?}: {got}, not {want}");
        }
    }

    #[test]
    fn directions_have_the_density_they_say() {
        let shapes = [
            rectangle([-0.5, -0.2, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0]),
            rectangle([0.4, -1.0, 0.3], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [2.0, 2.0]),
            Shape::Disk {
                centre: Vec3A::new(0.3, 0.2, 0.8),
                normal: Vec3A::new(-0.3, 0.1, -1.0).normalize(),
                radius: 0.7,
            },
            Shape::Sphere { centre: Vec3A::new(0.5, 0.2, 1.4), radius: 0.9 },
        ];
        for shape in shapes {
            let mut stream = Stream::new(5);
            let at = Vec3A::ZERO;
            // Solid angle two ways, the mean position on the sphere two ways, and the density's mass.
            let (mut by_own, mut by_uniform, mut mass) = (Vec3A::ZERO, Vec3A::ZERO, 0.0);
            for _ in 0..4 * N {
                if let Some(s) = shape.sample(at, Vec2::new(stream.next(), stream.next()), false) {
                    assert!((s.direction.length() - 1.0).abs() < 1e-5);
                    // A direction to the very edge may pass beside it after rounding.
                    if let Some((t, pdf)) = shape.seen(at, s.direction, false) {
                        assert!((t / s.distance - 1.0).abs() < 2e-3, "{shape:?}: {t} {}", s.distance);
                        assert!((pdf / s.pdf - 1.0).abs() < 1e-3, "{shape:?}: {pdf} {}", s.pdf);
                    }
                    by_own += s.direction / (s.pdf * 4.0 * N as f32);
                }
                let w = uniform_direction(&mut stream);
                let pdf = shape.seen(at, w, false).map_or(0.0, |(_, pdf)| pdf);
                mass += pdf * 4.0 * PI / (4.0 * N as f32);
                if pdf > 0.0 {
                    by_uniform += w * (4.0 * PI / (4.0 * N as f32));
                }
            }
            assert!((mass - 1.0).abs() < 0.02, "{shape:?}: the density has mass {mass}");
            assert!((by_own - by_uniform).length() < 0.02 * by_own.length(), "{shape:?}: {by_own} {by_uniform}");
        }
    }

    #[test]
    fn backs_are_dark_and_the_inside_of_a_ball_too() {
        let disk = Shape::Disk { centre: Vec3A::Z, normal: Vec3A::Z, radius: 1.0 };
        assert!(disk.sample(Vec3A::ZERO, Vec2::splat(0.3), false).is_none());
        assert!(disk.sample(Vec3A::ZERO, Vec2::splat(0.3), true).is_some());
        assert!(disk.intersect(Vec3A::ZERO, Vec3A::Z, false).is_none());
        assert_eq!(disk.intersect(Vec3A::ZERO, Vec3A::Z, true), Some(1.0));
        let ball = Shape::Sphere { centre: Vec3A::ZERO, radius: 1.0 };
        assert!(ball.sample(Vec3A::splat(0.1), Vec2::splat(0.5), false).is_none());
        assert_eq!(ball.intersect(Vec3A::new(0.0, 0.0, 3.0), Vec3A::NEG_Z, false), Some(2.0));
        let seen_from_its_edge = rectangle([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0]);
        assert!(seen_from_its_edge.sample(Vec3A::new(3.0, 0.0, 0.0), Vec2::splat(0.5), true).is_none());
    }
}
