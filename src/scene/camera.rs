//! From a pixel to a ray.

use glam::{DMat3, DMat4, DQuat, DVec2, DVec3, DVec4, Vec2, Vec3, Vec3A};
use rayon::prelude::*;

use crate::{geometry::ray::Ray, math::warp};

/// How far the view opens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Vertical angle, radians.
    Perspective(f64),
    /// Height of the picture, millimetres.
    Orthographic(f64),
}

impl Projection {
    /// The same kind of projection with another angle or height.
    pub fn with(self, opening: f64) -> Self {
        match self {
            Self::Perspective(_) => Self::Perspective(opening),
            Self::Orthographic(_) => Self::Orthographic(opening),
        }
    }

    fn opening(self) -> f64 {
        let (Self::Perspective(opening) | Self::Orthographic(opening)) = self;
        opening
    }
}

/// A thin lens: what lies at the distance of focus is sharp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius of its opening, millimetres.
    pub radius: f64,
    /// Distance along the view, from the camera, of the plane that is sharp, millimetres.
    pub focus: f64,
}

/// A camera: where it stands and what it sees. Right-handed, +y up, looking along -z unless told otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it stands, millimetres about the scene's middle.
    pub position: DVec3,
    /// Unit vector to the right of the picture.
    pub right: DVec3,
    /// Unit vector up in the picture.
    pub up: DVec3,
    /// Unit vector from the picture towards the viewer.
    pub back: DVec3,
    /// How far the view opens.
    pub projection: Projection,
    /// The lens; `None` for a pinhole, which sees everything sharply.
    pub lens: Option<Lens>,
    /// How far the picture's middle lies beside the view, to the right and up, in heights of the picture.
    pub shift: DVec2,
}

impl Camera {
    /// At `position`, looking at `target`; `None` if they coincide or `up` is along the view.
    pub fn looking_at(position: DVec3, target: DVec3, up: DVec3, projection: Projection) -> Option<Self> {
        let back = (position - target).try_normalize()?;
        let right = up.cross(back).try_normalize()?;
        Some(Self { position, right, up: back.cross(right), back, projection, lens: None, shift: DVec2::ZERO })
    }

    /// Moves the camera so that all of `points` (position and radius) are in a picture of the given aspect (width over
    /// height), keeping its directions; `margin` is the share of the picture left free on each side.
    pub fn framing<'a>(
        &self,
        points: impl ParallelIterator<Item = (&'a DVec3, f64)> + Clone,
        aspect: f64,
        margin: f64,
    ) -> Self {
        let axes = [self.right, self.up, self.back];
        let [x, y, z] = points.clone().map(|(p, r)| axes.map(|axis| (p.dot(axis) - r, p.dot(axis) + r))).reduce(
            || [(f64::MAX, f64::MIN); 3],
            |a, b| std::array::from_fn(|i| (a[i].0.min(b[i].0), a[i].1.max(b[i].1))),
        );
        if x.0 > x.1 {
            return *self;
        }
        let mid = |r: (f64, f64)| 0.5 * (r.0 + r.1);
        let shrink = (1.0 - 2.0 * margin).max(0.05);
        let centre = mid(x) * self.right + mid(y) * self.up + mid(z) * self.back;
        match self.projection {
            Projection::Orthographic(_) => {
                let height = ((y.1 - y.0).max((x.1 - x.0) / aspect) / shrink).max(1e-9);
                let position = centre + (z.1 - mid(z) + height) * self.back;
                Self { position, projection: Projection::Orthographic(height), ..*self }
            }
            Projection::Perspective(angle) => {
                let slope_y = (0.5 * angle).tan() * shrink;
                let slope_x = slope_y * aspect;
                // A point at height h above the axis is seen from the distance h / slope in front of it.
                let distance = points
                    .map(|(p, r)| {
                        let q = *p - centre;
                        let side = ((q.dot(self.right).abs() + r) / slope_x).max((q.dot(self.up).abs() + r) / slope_y);
                        q.dot(self.back) + side
                    })
                    .reduce(|| 0.0, f64::max);
                Self { position: centre + distance.max(1e-9) * self.back, ..*self }
            }
        }
    }

    /// A camera that sees flat cloth from its face, if this one looks at its edge: flat is what is four times as wide as
    /// it is thick, and an edge is seen from within 20 degrees of the cloth's plane.
    pub fn facing<'a>(&self, points: impl Iterator<Item = &'a DVec3>) -> Self {
        let Some((low, high)) = points.fold(None, |box_: Option<(DVec3, DVec3)>, p| {
            Some(box_.map_or((*p, *p), |(low, high)| (low.min(*p), high.max(*p))))
        }) else {
            return *self;
        };
        let size = (high - low).to_array();
        let thin = (0..3).min_by(|a, b| size[*a].total_cmp(&size[*b])).unwrap_or(2);
        let narrowest = (0..3).filter(|&k| k != thin).map(|k| size[k]).fold(f64::MAX, f64::min);
        let normal = DVec3::AXES[thin];
        if size[thin] > 0.25 * narrowest || self.back.dot(normal).abs() > 20f64.to_radians().sin() {
            return *self;
        }
        // What lies flat is seen from above with its far end up, what stands from the side.
        let up = if thin == 1 { DVec3::NEG_Z } else { DVec3::Y };
        Self::looking_at(self.position + normal, self.position, up, self.projection).map_or(*self, |camera| Self {
            position: self.position,
            lens: self.lens,
            shift: self.shift,
            ..camera
        })
    }

    /// The camera after a turn about an axis through `pivot`, in radians.
    pub fn turned(&self, axis: DVec3, pivot: DVec3, angle: f64) -> Self {
        let turn = DQuat::from_axis_angle(axis.normalize_or(DVec3::Y), angle);
        Self {
            position: pivot + turn * (self.position - pivot),
            right: turn * self.right,
            up: turn * self.up,
            back: turn * self.back,
            ..*self
        }
    }

    /// The camera a share `s` of the way to where it is a little later.
    pub fn towards(&self, later: &Self, s: f64) -> Self {
        let back = self.back.lerp(later.back, s).normalize_or(self.back);
        let right = self.up.lerp(later.up, s).cross(back).normalize_or(self.right);
        let opening = self.projection.opening();
        let lens = match (self.lens, later.lens) {
            (Some(a), Some(b)) => {
                Some(Lens { radius: a.radius + s * (b.radius - a.radius), focus: a.focus + s * (b.focus - a.focus) })
            }
            (lens, _) => lens,
        };
        Self {
            position: self.position.lerp(later.position, s),
            right,
            up: back.cross(right),
            back,
            projection: self.projection.with(opening + s * (later.projection.opening() - opening)),
            lens,
            shift: self.shift.lerp(later.shift, s),
        }
    }

    /// The ray through a point of a picture, in pixels from its upper left corner; `lens` are two uniform numbers for
    /// where it passes the lens, if there is one.
    #[inline]
    pub fn ray(&self, point: Vec2, lens: Vec2, width: u32, height: u32) -> Ray {
        let (w, h) = (f64::from(width), f64::from(height));
        let x = (2.0 * f64::from(point.x) - w) / h + 2.0 * self.shift.x;
        let y = 1.0 - 2.0 * f64::from(point.y) / h + 2.0 * self.shift.y;
        let (origin, direction) = match self.projection {
            Projection::Perspective(angle) => {
                let slope = (0.5 * angle).tan();
                (self.position, (x * slope * self.right + y * slope * self.up - self.back).normalize())
            }
            Projection::Orthographic(size) => {
                // A ray exactly across a straight curve makes Embree offer one hit dozens of times; a tilt of a
                // millionth, far below a pixel, does not.
                let tilt = 1e-6 * (self.right + 0.6 * self.up);
                (self.position + 0.5 * size * (x * self.right + y * self.up), (tilt - self.back).normalize())
            }
        };
        let (origin, direction) = match self.lens {
            None => (origin, direction),
            Some(Lens { radius, focus }) => {
                // All rays of a point of the picture meet where the one through the lens's middle meets the sharp plane.
                let sharp = focus / -direction.dot(self.back) * direction;
                let on_lens = radius * warp::disc(lens).as_dvec2();
                let offset = on_lens.x * self.right + on_lens.y * self.up;
                (origin + offset, (sharp - offset).normalize())
            }
        };
        Ray::new(Vec3A::from(origin.as_vec3()), Vec3A::from(direction.as_vec3()))
    }

    /// Where a point of the world is seen, in pixels from the upper left corner of a picture; `None` if it is not in front.
    #[inline]
    pub fn project(&self, point: DVec3, width: u32, height: u32) -> Option<DVec2> {
        let q = point - self.position;
        let depth = -q.dot(self.back);
        let half = match self.projection {
            Projection::Perspective(_) if depth <= 0.0 => return None,
            Projection::Perspective(angle) => depth * (0.5 * angle).tan(),
            Projection::Orthographic(size) => 0.5 * size,
        };
        let (w, h) = (f64::from(width), f64::from(height));
        let pixel = 0.5 * h / half;
        let middle = DVec2::new(0.5 * w - h * self.shift.x, 0.5 * h + h * self.shift.y);
        Some(middle + pixel * DVec2::new(q.dot(self.right), -q.dot(self.up)))
    }

    /// From the world, whose origin is at `-middle` of this camera's, to the camera: x to the right, y up, -z ahead.
    pub fn world_to_camera(&self, middle: DVec3) -> DMat4 {
        let to_world = DMat3::from_cols(self.right, self.up, self.back);
        let turn = to_world.transpose();
        DMat4::from_mat3_translation(turn, -(turn * (self.position + middle)))
    }

    /// From the same world to a picture of the given aspect (width over height), whose upper left corner is (0, 0) and
    /// lower right (1, 1), after a division by w; z grows with depth.
    pub fn world_to_ndc(&self, middle: DVec3, aspect: f64) -> DMat4 {
        let middle_of_view = DVec2::new(0.5 - self.shift.x / aspect, 0.5 + self.shift.y);
        let to_picture = match self.projection {
            Projection::Perspective(angle) => {
                let scale = 0.5 / (0.5 * angle).tan();
                DMat4::from_cols(
                    DVec4::new(scale / aspect, 0.0, 0.0, 0.0),
                    DVec4::new(0.0, -scale, 0.0, 0.0),
                    // w is the depth, -z; z / w is 0 a millimetre ahead and 1 far away.
                    DVec4::new(-middle_of_view.x, -middle_of_view.y, -1.0, -1.0),
                    DVec4::new(0.0, 0.0, -1.0, 0.0),
                )
            }
            Projection::Orthographic(size) => DMat4::from_cols(
                DVec4::new(1.0 / (size * aspect), 0.0, 0.0, 0.0),
                DVec4::new(0.0, -1.0 / size, 0.0, 0.0),
                DVec4::new(0.0, 0.0, -1.0, 0.0),
                DVec4::new(middle_of_view.x, middle_of_view.y, 0.0, 1.0),
            ),
        };
        to_picture * self.world_to_camera(middle)
    }

    /// How wide the pixels of a picture of so many rows are.
    pub fn footprint(&self, height: u32) -> Footprint {
        let (width, per_length) = match self.projection {
            Projection::Perspective(angle) => (0.0, (2.0 * (0.5 * angle).tan() / f64::from(height)) as f32),
            Projection::Orthographic(size) => ((size / f64::from(height)) as f32, 0.0),
        };
        Footprint { camera: self.position.as_vec3a(), width, per_length }
    }

    /// The direction towards the viewer in single precision: distances along it are depths.
    pub fn back_f32(&self) -> Vec3 {
        self.back.as_vec3()
    }
}

/// How wide pixels are at the places that they show.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    camera: Vec3A,
    /// At the camera, millimetres, and by how much more for each of them of distance.
    width: f32,
    per_length: f32,
}

impl Footprint {
    /// The width of a pixel at a place, millimetres.
    #[inline]
    pub fn at(&self, place: Vec3A) -> f32 {
        self.width + self.per_length * (place - self.camera).length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud() -> Vec<DVec3> {
        (0..200)
            .map(|i| {
                let t = f64::from(i);
                DVec3::new(30.0 * (0.7 * t).sin(), 12.0 * (1.3 * t).cos(), 8.0 * (2.1 * t).sin())
            })
            .collect()
    }

    #[test]
    fn framing_shows_every_point_and_fills_the_picture() {
        for projection in [Projection::Perspective(0.6), Projection::Orthographic(1.0)] {
            for (aspect, direction) in
                [(1.0, DVec3::Z), (1.8, DVec3::new(1.0, 0.5, 0.3)), (0.6, DVec3::new(-0.2, 1.0, 0.4))]
            {
                let points = cloud();
                let camera = Camera::looking_at(direction, DVec3::ZERO, DVec3::Y, projection).unwrap();
                let camera = camera.framing(points.par_iter().map(|p| (p, 0.5)), aspect, 0.05);
                let mut widest: f64 = 0.0;
                for p in &points {
                    let q = *p - camera.position;
                    let (x, y, z) = (q.dot(camera.right), q.dot(camera.up), -q.dot(camera.back));
                    assert!(z > 0.0, "in front of the camera");
                    let half = match camera.projection {
                        Projection::Perspective(a) => z * (0.5 * a).tan(),
                        Projection::Orthographic(h) => 0.5 * h,
                    };
                    widest = widest.max(x.abs() / (half * aspect)).max(y.abs() / half);
                }
                assert!(widest < 0.91 && widest > 0.75, "{projection:?} {aspect}: {widest}");
            }
        }
    }

    #[test]
    fn flat_cloth_is_seen_from_its_face() {
        let projection = Projection::Perspective(0.5);
        let from = |direction| Camera::looking_at(direction, DVec3::ZERO, DVec3::Y, projection).unwrap();
        let sheet = |thin: usize| -> Vec<DVec3> {
            (0..100)
                .map(|i| {
                    let mut p = [f64::from(i % 10), f64::from(i / 10), f64::from(i % 3)];
                    p[2] *= 0.3;
                    p.swap(2, thin);
                    DVec3::from(p)
                })
                .collect()
        };
        for (thin, direction, back) in [
            (2, DVec3::Z, DVec3::Z),
            (2, DVec3::X, DVec3::Z),
            (1, DVec3::Z, DVec3::Y),
            (0, DVec3::Z, DVec3::X),
            // From 45 degrees its face is seen already.
            (1, DVec3::new(0.0, 1.0, 1.0), DVec3::new(0.0, 1.0, 1.0).normalize()),
        ] {
            let camera = from(direction).facing(sheet(thin).iter());
            assert!((camera.back - back).length() < 1e-12, "{thin} {direction}: {}", camera.back);
        }
        let ball = cloud();
        assert_eq!(from(DVec3::X).facing(ball.iter()), from(DVec3::X));
    }

    #[test]
    fn rays_go_where_the_picture_shows() {
        let camera =
            Camera::looking_at(DVec3::new(0.0, 0.0, 10.0), DVec3::ZERO, DVec3::Y, Projection::Perspective(1.0))
                .unwrap();
        let middle = camera.ray(Vec2::new(50.0, 25.0), Vec2::ZERO, 100, 50);
        assert!((middle.direction - Vec3A::NEG_Z).length() < 1e-6);
        let corner = camera.ray(Vec2::ZERO, Vec2::ZERO, 100, 50).direction;
        assert!(corner.x < 0.0 && corner.y > 0.0, "the first pixel is at the upper left");
        assert!((corner.y / -corner.z - 0.5f32.tan()).abs() < 1e-5);
        // A picture that lies to the right and up of the view has the view's middle at its lower left.
        let shifted = Camera { shift: DVec2::new(1.0, 0.5), ..camera };
        let ahead = shifted.ray(Vec2::new(0.0, 50.0), Vec2::ZERO, 100, 50);
        assert!((ahead.direction - Vec3A::NEG_Z).length() < 1e-6);
        assert!(Camera::looking_at(DVec3::ZERO, DVec3::ZERO, DVec3::Y, Projection::Perspective(1.0)).is_none());
        assert!(Camera::looking_at(DVec3::Y, DVec3::ZERO, DVec3::Y, Projection::Perspective(1.0)).is_none());
    }

    #[test]
    fn what_a_ray_sees_is_projected_to_where_the_ray_began() {
        let of_both = |shift| [(Projection::Perspective(0.7), shift), (Projection::Orthographic(25.0), shift)];
        for (projection, shift) in of_both(DVec2::ZERO).into_iter().chain(of_both(DVec2::new(0.3, -0.1))) {
            let camera = Camera::looking_at(DVec3::new(7.0, -4.0, 30.0), DVec3::ONE, DVec3::Y, projection).unwrap();
            let camera = Camera { shift, ..camera };
            let middle = DVec3::new(100.0, 20.0, -5.0);
            let (to_camera, to_ndc) = (camera.world_to_camera(middle), camera.world_to_ndc(middle, 64.0 / 48.0));
            for (pixel, distance) in [(Vec2::new(3.25, 40.5), 20.0), (Vec2::new(60.0, 5.0), 47.0)] {
                let ray = camera.ray(pixel, Vec2::ZERO, 64, 48);
                let point = ray.origin.as_dvec3() + distance * ray.direction.as_dvec3();
                let seen = camera.project(point, 64, 48).unwrap();
                // An orthographic ray is tilted by a millionth.
                assert!((seen - pixel.as_dvec2()).length() < 1e-3, "{projection:?}: {seen}");
                let ndc = to_ndc * (point + middle).extend(1.0);
                let ndc = ndc.truncate() / ndc.w;
                assert!((ndc.truncate() * DVec2::new(64.0, 48.0) - seen).length() < 1e-9, "{projection:?}: {ndc}");
                let local = to_camera.transform_point3(point + middle);
                let depth = (camera.position - point).dot(camera.back);
                assert!((-local.z - depth).abs() < 1e-9 && ndc.z > 0.0, "{projection:?}: {local}, {depth}");
            }
            let behind = camera.position + camera.back;
            assert_eq!(camera.project(behind, 64, 48).is_none(), matches!(projection, Projection::Perspective(_)));
        }
    }

    #[test]
    fn between_two_poses_a_camera_is_between_them() {
        let camera = |position: DVec3, angle| {
            Camera::looking_at(position, DVec3::ZERO, DVec3::Y, Projection::Perspective(angle)).unwrap()
        };
        let still = camera(DVec3::new(0.0, 2.0, 10.0), 0.5);
        let turned = still.turned(DVec3::Y, DVec3::ZERO, 0.1);
        let half = still.turned(DVec3::Y, DVec3::ZERO, 0.05);
        let between = still.towards(&turned, 0.5);
        assert!((between.position - half.position).length() < 0.02, "a chord of the arc");
        for (a, b) in [(between.right, half.right), (between.up, half.up), (between.back, half.back)] {
            assert!((a - b).length() < 1e-3 && (a.length() - 1.0).abs() < 1e-12);
        }
        assert!((still.towards(&turned, 1.0).right - turned.right).length() < 1e-12);
        let wider = camera(DVec3::new(0.0, 2.0, 10.0), 0.7);
        assert_eq!(still.towards(&wider, 0.25).projection, Projection::Perspective(0.55));
    }

    #[test]
    fn a_lens_blurs_by_its_circle_of_confusion() {
        let (radius, focus) = (1.5, 40.0);
        for projection in [Projection::Perspective(0.8), Projection::Orthographic(20.0)] {
            let pinhole = Camera::looking_at(DVec3::new(3.0, -2.0, 10.0), DVec3::ZERO, DVec3::Y, projection).unwrap();
            let camera = Camera { lens: Some(Lens { radius, focus }), ..pinhole };
            let pixel = Vec2::new(11.0, 20.0);
            // Where a ray is at a depth, across the view.
            let at = |ray: Ray, depth: f64| {
                let (o, d) = (ray.origin.as_dvec3() - pinhole.position, ray.direction.as_dvec3());
                let p = o + (-depth - o.dot(pinhole.back)) / d.dot(pinhole.back) * d;
                glam::DVec2::new(p.dot(pinhole.right), p.dot(pinhole.up))
            };
            let middle = pinhole.ray(pixel, Vec2::ZERO, 64, 48);
            for depth in [10.0, 40.0, 90.0] {
                let (mut widest, mut mean) = (0f64, glam::DVec2::ZERO);
                let n = 64;
                for i in 0..n * n {
                    let u = (Vec2::new((i % n) as f32, (i / n) as f32) + 0.5) / n as f32;
                    let off = at(camera.ray(pixel, u, 64, 48), depth) - at(middle, depth);
                    widest = widest.max(off.length());
                    mean += off / f64::from(n * n);
                }
                // Similar triangles between lens and sharp plane.
                let want = radius * (depth / focus - 1.0).abs();
                assert!(
                    (widest - want).abs() < 0.02 * want + 1e-4,
                    "{projection:?}, depth {depth}: {widest}, not {want}"
                );
                assert!(mean.length() < 0.01 * want + 1e-4, "the blur is centred");
            }
        }
    }
}
