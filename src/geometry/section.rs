//! A ray in the cross-section of a yarn: which plies it crosses, in order, and how many fibres on the way (paper Sec. 3.2).
//!
//! The paper takes the ray as perpendicular to the yarn. Here the section travels along: where the ray is deeper by
//! x it is farther along the yarn by x tan(theta), where the plies have turned and the yarn has bent. Embree's
//! filter and the shading both ask [`Section::crossings`] or [`Section::meets_ply`], which place plies by the same
//! function, so that they cannot disagree.
//!
//! Frame: z is the yarn's tangent, x points to the camera (projected into the section), y = z x x. Lengths are in
//! yarn radii. The ray travels towards -x at y = h.

use arrayvec::ArrayVec;
use glam::{Vec2, Vec3A};
use wide::f32x4;

use super::{
    density::ChordFibers,
    yarn::{MAX_PLIES, PlyShape, YarnShape, fiber_tangent},
};
use crate::math::{frame::sin_cos, special::GAUSS_LEGENDRE_4};

/// Slope along the yarn beyond which a ray counts as no steeper.
const MAX_SLOPE: f32 = 1.0;
/// How far along the yarn, in yarn radii, turning and bending are followed.
const MAX_TRAVEL: f32 = 1.2;

/// Turns of the plies, radians per yarn radius, beyond which they are placed with more care: about 28 degrees of twist.
const FAST_TURN: f32 = 1.0;

/// The same for the way of the light, measured to the plies' nearest points.
const MAX_LIGHT_TRAVEL: f32 = 1.2;

/// The place where a ray meets a yarn.
#[derive(Clone, Copy, Debug)]
pub struct YarnFrame {
    /// The yarn's centre.
    pub centre: Vec3A,
    /// Unit tangent of the yarn.
    pub tangent: Vec3A,
    /// Curvature vector: second derivative by arc length, 1/length.
    pub curvature: Vec3A,
    /// Outer radius of the yarn.
    pub radius: f32,
    /// Unit vector across the yarn that does not turn with the plies (rotation-minimising along the yarn).
    pub normal: Vec3A,
    /// Angle of the plies about the tangent, from `normal`, radians.
    pub phase: f32,
    /// Along the short axis of the section in the frame of `normal` and `tangent x normal`, as long as the ratio of the
    /// short axis to the long one: [`ROUND`], or any other vector of length 1, where the yarn is not pressed flat.
    pub flattening: Vec2,
    /// By how much that axis turns in the frame along the yarn, radians per yarn radius.
    pub flattening_turn: f32,
}

/// [`YarnFrame::flattening`] of a round yarn.
pub const ROUND: Vec2 = Vec2::X;
/// A section whose axes differ by less is round.
const NEARLY_ROUND: f32 = 0.9999;

impl YarnFrame {
    /// The point of the world at `at` of the round section that this one was pressed from, in yarn radii along `normal`
    /// and `tangent x normal`.
    pub fn point(&self, at: Vec2) -> Vec3A {
        let at = Pressed::new(self.flattening).map_or(at, |pressed| pressed.real(at));
        let across = self.tangent.cross(self.normal);
        self.centre + self.radius * (at.x * self.normal + at.y * across)
    }
}

/// How a section is pressed flat: an affine map that takes circles to ellipses, and with them the plies inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pressed {
    /// Unit vector along the short axis.
    axis: Vec2,
    /// Long over short axis, above 1.
    stretch: f32,
}

impl Pressed {
    /// From [`YarnFrame::flattening`]; `None` where the section is round.
    #[inline]
    pub fn new(flattening: Vec2) -> Option<Self> {
        let ratio = flattening.length();
        (ratio < NEARLY_ROUND).then(|| Self { axis: flattening / ratio, stretch: 1.0 / ratio })
    }

    /// A point or a vector of the pressed section in the round one.
    #[inline]
    pub fn round(&self, p: Vec2) -> Vec2 {
        p + (self.stretch - 1.0) * p.dot(self.axis) * self.axis
    }

    /// A point or a vector of the round section in the pressed one.
    #[inline]
    pub fn real(&self, p: Vec2) -> Vec2 {
        p + (1.0 / self.stretch - 1.0) * p.dot(self.axis) * self.axis
    }
}

/// A place seen by one ray.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    /// The frame's x axis in the world: across the yarn, towards the camera.
    pub x: Vec3A,
    /// The frame's y axis in the world: across the yarn and the ray.
    pub y: Vec3A,
    /// The frame's z axis in the world: the yarn's tangent.
    pub z: Vec3A,
    /// Origin of the frame in the world.
    pub centre: Vec3A,
    /// World length of one yarn radius.
    pub radius: f32,
    /// Offset of the ray from the yarn's axis, -1 to 1.
    pub h: f32,
    /// Where the ray enters the yarn: (`enter`, h).
    pub enter: f32,
    /// Sine of the camera direction's latitude against the yarn.
    pub sin: f32,
    /// Cosine of it, at least 1e-3.
    pub cos: f32,
    /// Travel along the yarn for each unit of x, towards the camera.
    pub slope: f32,
    /// Curvature in the section, 1/yarn radii.
    pub bend: Vec2,
    /// Whether depth and place along the yarn go together (see [`YarnShape::tilted`]).
    pub tilted: bool,
    /// (cos, sin) of the plies' phase in this frame.
    pub phase: Vec2,
    /// How the section is pressed flat, if it is. Plies are placed in the round section that it was pressed from.
    pub pressed: Option<Pressed>,
    /// By how much the axis of pressing turns along the yarn, radians per yarn radius.
    pub pressed_turn: f32,
}

/// One ply on the way of a ray.
#[derive(Clone, Copy, Debug)]
pub struct PlyCrossing {
    /// Index of the ply in the yarn's shape.
    pub ply: usize,
    /// Centre of the ply where the ray passes it, in the round section.
    pub centre: Vec2,
    /// Unit vector from the yarn's axis to the ply there, in the round section.
    pub axis: Vec2,
    /// Signed distance of the ray from the ply's axis, in the circle of the ply's radius.
    pub offset: f32,
    /// x at which the ray enters the ply's core; a ray that only grazes its outer fibres has `enter` = `exit`.
    pub enter: f32,
    /// x at which it leaves the core, below `enter`.
    pub exit: f32,
    /// The fibres on the chord if they were not tilted, and where they lie.
    pub chord: ChordFibers,
    /// x of the point of the chord nearest to the ply's axis.
    pub foot: f32,
    /// Expected number of fibres on the chord.
    pub fibers: f32,
}

impl PlyCrossing {
    /// Outward normal of the ply where the ray enters, in the section.
    pub fn normal(&self, section: &Section) -> Vec3A {
        // The normal of the pressed circle: of the map, the transpose of the inverse, which here is the way back.
        let n = section.round(section.round(Vec2::new(self.enter, section.h)) - self.centre).normalize_or(Vec2::X);
        Vec3A::new(n.x, n.y, 0.0)
    }

    /// Unit tangent of the fibres where the ray enters.
    pub fn tangent_at_entry(&self, shape: &YarnShape, section: &Section) -> Vec3A {
        let at = Vec2::new(self.enter, section.h);
        let straight = section.fiber_tangent(shape, self.ply, self.centre, self.axis, at);
        (straight + section.bent(section.travel(at.x))).normalize()
    }
}

/// The plies a ray crosses, nearest first.
pub type Crossings = ArrayVec<PlyCrossing, MAX_PLIES>;

/// A ply on a way through the yarn.
#[derive(Clone, Copy, Debug)]
pub struct PlyAhead {
    /// Index of the ply in the yarn's shape.
    pub ply: usize,
    /// Signed distance of the way from the ply's axis, in the circle of the ply's radius.
    pub offset: f32,
    /// Distance in the section from the start to the way's point nearest to the ply's axis; negative behind the start.
    pub foot: f32,
    /// Length in the circle of one unit of the way.
    pub length: f32,
}

/// A ply where a ray passes it, in the round section.
struct Passage {
    /// x of the ray there.
    x: f32,
    /// Unit vector from the yarn's axis to the ply.
    axis: Vec2,
    /// Centre of the ply.
    centre: Vec2,
    /// How the centre moves while the ray goes on by one unit of x: a tilted cylinder, seen in the section.
    drift: Vec2,
}

/// A line and a circle: a ray past a ply.
struct LineInPly {
    /// Signed distance of the line from the centre.
    offset: f32,
    /// x of the nearest point, from the centre.
    foot: f32,
    /// Length in the circle of one unit of x.
    length: f32,
}

#[inline]
fn rotate(v: Vec2, sin: f32, cos: f32) -> Vec2 {
    Vec2::new(v.x * cos - v.y * sin, v.x * sin + v.y * cos)
}

impl Section {
    /// The section at `place` for a ray from `origin` along the unit vector `direction`.
    #[inline]
    pub fn new(place: &YarnFrame, origin: Vec3A, direction: Vec3A, tilted: bool) -> Self {
        let z = place.tangent;
        let to_camera = -direction;
        let sin = to_camera.dot(z).clamp(-1.0, 1.0);
        let across = to_camera - sin * z;
        let length = across.length();
        // A ray along the yarn has no side: any will do.
        let x = if length > 1e-6 { across / length } else { place.normal };
        let y = z.cross(x);
        let h = ((origin - place.centre).dot(y) / place.radius).clamp(-1.0, 1.0);
        let cos = length.max(1e-3);
        let (bend, slope) = if tilted {
            let k = place.curvature * place.radius;
            (Vec2::new(k.dot(x), k.dot(y)), (sin / cos).clamp(-MAX_SLOPE, MAX_SLOPE))
        } else {
            (Vec2::ZERO, 0.0)
        };
        let (s, c) = sin_cos(place.phase);
        let normal = Vec2::new(place.normal.dot(x), place.normal.dot(y));
        let pressed = Pressed::new(place.flattening)
            .map(|pressed| Pressed { axis: rotate(normal, pressed.axis.y, pressed.axis.x), ..pressed });
        Self {
            x,
            y,
            z,
            centre: place.centre,
            radius: place.radius,
            h,
            enter: (1.0 - h * h).max(0.0).sqrt(),
            sin,
            cos,
            slope,
            bend,
            tilted,
            phase: rotate(normal, s, c),
            pressed,
            pressed_turn: place.flattening_turn,
        }
    }

    /// A vector of this frame in the world.
    #[inline]
    pub fn to_world(&self, v: Vec3A) -> Vec3A {
        v.x * self.x + v.y * self.y + v.z * self.z
    }

    /// A vector of the world in this frame.
    #[inline]
    pub fn to_local(&self, v: Vec3A) -> Vec3A {
        Vec3A::new(v.dot(self.x), v.dot(self.y), v.dot(self.z))
    }

    /// A point or a vector of this section in the round one that it was pressed from.
    #[inline]
    pub fn round(&self, p: Vec2) -> Vec2 {
        self.pressed.map_or(p, |pressed| pressed.round(p))
    }

    /// A point or a vector of that round section in this one.
    #[inline]
    pub fn real(&self, p: Vec2) -> Vec2 {
        self.pressed.map_or(p, |pressed| pressed.real(p))
    }

    /// By how much fibres are closer to each other than in the round section: its area over this one's.
    #[inline]
    pub fn squeeze(&self) -> f32 {
        self.pressed.map_or(1.0, |pressed| pressed.stretch)
    }

    /// The tangent (of z = 1) of a fibre at `at` of this section, on a yarn that is not bent, in a ply with centre `centre`
    /// and the unit vector `axis` to it, both in the round section.
    #[inline]
    pub fn fiber_tangent(&self, shape: &YarnShape, ply: usize, centre: Vec2, axis: Vec2, at: Vec2) -> Vec3A {
        let Some(pressed) = self.pressed else {
            return fiber_tangent(&shape.plies[ply], shape.ply_rate, centre, axis, at);
        };
        let round = pressed.round(at);
        let t = fiber_tangent(&shape.plies[ply], shape.ply_rate, centre, axis, round);
        // What presses turns as well: the map A at the angle phi is R(phi) S R(-phi), so that A' = phi' (J A - A J).
        let turned = self.pressed_turn * (at.perp() - pressed.real(round.perp()));
        (pressed.real(t.truncate()) + turned).extend(1.0).into()
    }

    /// The world position of the point on the camera's ray at depth `x`, rebuilt from the yarn's centre. A steep ray is
    /// taken as less so, which keeps the point inside a yarn that bends away.
    #[inline]
    pub fn point_on_ray(&self, x: f32) -> Vec3A {
        let along = (x - self.enter) * self.slope;
        self.centre + self.radius * (x * self.x + self.h * self.y + along * self.z)
    }

    /// How far along the yarn from the frame's origin the ray is when it is at depth `x`.
    #[inline]
    pub fn travel(&self, x: f32) -> f32 {
        ((x - self.enter) * self.slope / self.straightness(Vec2::new(x, self.h))).clamp(-MAX_TRAVEL, MAX_TRAVEL)
    }

    /// By how much a tangent (of z = 1) turns over a `travel` along the bent yarn.
    #[inline]
    pub fn bent(&self, travel: f32) -> Vec3A {
        Vec3A::new(self.bend.x * travel, self.bend.y * travel, 0.0)
    }

    /// (sin, cos) of the turn of the plies over a `travel` along the yarn.
    #[inline]
    pub fn turn(shape: &YarnShape, travel: f32) -> (f32, f32) {
        sin_cos(shape.ply_rate * travel)
    }

    /// Unit vector towards ply `ply` in a section whose plies have turned by (sin, cos) from this one's origin.
    #[inline]
    pub fn ply_axis(&self, ply: &PlyShape, turn: (f32, f32)) -> Vec2 {
        let d = ply.direction;
        let here = Vec2::new(self.phase.x * d.x - self.phase.y * d.y, self.phase.x * d.y + self.phase.y * d.x);
        rotate(here, turn.0, turn.1)
    }

    /// Centre of a ply on the bent yarn, in the round section.
    #[inline]
    pub fn ply_centre(&self, ply: &PlyShape, axis: Vec2, travel: f32) -> Vec2 {
        ply.distance * axis + self.round((0.5 * travel * travel) * self.bend)
    }

    /// How much of a step along the yarn's axis a point away from it makes: less outside of a bend.
    #[inline]
    fn straightness(&self, at: Vec2) -> f32 {
        (1.0 - self.bend.dot(at)).max(0.4)
    }

    /// Where the ray passes a ply.
    ///
    /// Depth and turning depend on each other; two rounds settle them, three where the ray is steep or the plies turn
    /// fast.
    #[inline]
    fn follow(&self, shape: &YarnShape, ply: &PlyShape) -> Passage {
        let mut axis = self.ply_axis(ply, (0.0, 1.0));
        let mut centre = ply.distance * axis;
        let mut x = self.real(centre).x;
        if self.slope == 0.0 {
            return Passage { x, axis, centre, drift: Vec2::ZERO };
        }
        let untwisted = shape.ply_rate == 0.0;
        let mut travel = 0.0;
        let mut straightness = 1.0;
        for _ in 0..if self.slope.abs() < 1.0 && shape.ply_rate.abs() < FAST_TURN { 2 } else { 3 } {
            straightness = self.straightness(Vec2::new(x, self.h));
            travel = (-(self.enter - x) * self.slope / straightness).clamp(-MAX_TRAVEL, MAX_TRAVEL);
            if !untwisted {
                axis = self.ply_axis(ply, Self::turn(shape, travel));
            }
            centre = self.ply_centre(ply, axis, travel);
            x = self.real(centre).x;
        }
        if travel.abs() == MAX_TRAVEL {
            return Passage { x, axis, centre, drift: Vec2::ZERO };
        }
        let turning = shape.ply_rate * ply.distance * axis.perp();
        let drift = self.slope / straightness * (turning + self.round(travel * self.bend));
        Passage { x, axis, centre, drift }
    }

    /// The ray's line past the ply's moving centre, in the circle that the ply's section becomes.
    #[inline]
    fn line_in_ply(&self, ply: &PlyShape, at: &Passage) -> LineInPly {
        let along = self.round(Vec2::X) - at.drift;
        let start = self.round(Vec2::new(at.x, self.h)) - at.centre;
        let (along, start) = if ply.stretch.x == 1.0 {
            (along, start)
        } else {
            let to_circle = |p: Vec2| Vec2::new(p.dot(at.axis), at.axis.perp_dot(p)) * ply.stretch;
            (to_circle(along), to_circle(start))
        };
        let length = along.length().max(1e-3);
        LineInPly { offset: along.perp_dot(start) / length, foot: -along.dot(start) / (length * length), length }
    }

    /// Whether the ray meets any ply: what the filter asks of every candidate hit.
    #[inline]
    pub fn meets_ply(&self, shape: &YarnShape) -> bool {
        shape.plies.iter().any(|ply| self.line_in_ply(ply, &self.follow(shape, ply)).offset.abs() < ply.radius)
    }

    /// Fills `out` with the plies on the ray's way, nearest first.
    #[inline]
    pub fn crossings(&self, shape: &YarnShape, out: &mut Crossings) {
        out.clear();
        for (index, ply) in shape.plies.iter().enumerate() {
            let at = self.follow(shape, ply);
            let LineInPly { offset, foot, length } = self.line_in_ply(ply, &at);
            if offset.abs() >= ply.radius || ply.fibers == 0.0 {
                continue;
            }
            let half = (ply.core_radius * ply.core_radius - offset * offset).max(0.0).sqrt() / length;
            let (enter, exit) = (at.x + foot + half, at.x + foot - half);
            let chord = ply.chord(offset, length);
            let fibers = chord.total() * self.tilt_factor(shape, index, &at, enter, exit);
            let (Passage { centre, axis, .. }, foot) = (at, 0.5 * (enter + exit));
            let crossing = PlyCrossing { ply: index, centre, axis, offset, enter, exit, chord, foot, fibers };
            let place = out.iter().position(|c| c.enter < enter).unwrap_or(out.len());
            out.insert(place, crossing);
        }
    }

    /// The plies that lie ahead of a point inside the yarn, in a direction `w` of this frame.
    ///
    /// `start` is a point of this (not the round) section that is `travel` farther along the yarn than the frame's
    /// origin. Of a pressed section fibres are closer to each other than of the round one by [`Self::squeeze`]. As for
    /// rays, each ply is placed where the way passes nearest to it, and moves on from there.
    #[inline]
    pub fn plies_ahead(&self, shape: &YarnShape, start: Vec2, travel: f32, w: Vec3A, mut visit: impl FnMut(PlyAhead)) {
        let cos = (1.0 - w.z * w.z).max(1e-9).sqrt();
        let ahead = Vec2::new(w.x, w.y) / cos;
        // As far along the yarn as is needed to cross it once and a bit.
        let slope = if self.tilted { w.z / cos } else { 0.0 };
        let turn_here = Self::turn(shape, travel);
        let (round_start, round_ahead) = (self.round(start), self.round(ahead));
        for (index, ply) in shape.plies.iter().enumerate() {
            let mut axis = self.ply_axis(ply, turn_here);
            let mut centre = self.ply_centre(ply, axis, travel);
            let nearest = ((centre - round_start).dot(round_ahead) / round_ahead.length_squared()).max(0.0);
            let slope = slope / self.straightness(start + nearest * ahead);
            let further = (nearest * slope).clamp(-MAX_LIGHT_TRAVEL, MAX_LIGHT_TRAVEL);
            if further != 0.0 {
                if shape.ply_rate != 0.0 {
                    axis = self.ply_axis(ply, Self::turn(shape, travel + further));
                }
                centre = self.ply_centre(ply, axis, travel + further);
            }
            // The centre moves on while the way goes past it.
            let drift = if further.abs() < MAX_LIGHT_TRAVEL {
                let turning = shape.ply_rate * ply.distance * axis.perp();
                slope * (turning + self.round((travel + further) * self.bend))
            } else {
                Vec2::ZERO
            };
            let (from, way) = (round_start - centre + nearest * drift, round_ahead - drift);
            let (from, way) = if ply.stretch.x == 1.0 {
                (from, way)
            } else {
                let to_circle = |p: Vec2| Vec2::new(p.dot(axis), axis.perp_dot(p)) * ply.stretch;
                (to_circle(from), to_circle(way))
            };
            let square = way.length_squared().max(1e-6);
            let foot = -from.dot(way) / square;
            let reach = foot * foot - (from.length_squared() - ply.radius * ply.radius) / square;
            if reach > 0.0 && foot + reach.sqrt() > 0.0 {
                let length = square.sqrt();
                visit(PlyAhead { ply: index, offset: way.perp_dot(from) / length, foot, length });
            }
        }
    }

    /// How many more fibres a chord meets because they are squeezed and tilted: the chord's mean of
    /// sqrt(1 - (w.T)^2) / (cos theta_w cos alpha). (The paper's 1 / cos(theta_fiber), Eq. 2, takes the worst place
    /// for all: fibres near the ply's axis are not tilted.)
    #[inline]
    fn tilt_factor(&self, shape: &YarnShape, ply: usize, at: &Passage, enter: f32, exit: f32) -> f32 {
        if shape.plies[ply].fiber_rate == 0.0 && shape.ply_rate == 0.0 {
            return self.squeeze();
        }
        // With t = (tx, ty, 1) a fibre's tangent and w = (cos, 0, sin), the factor is sqrt(|t|^2 - (w.t)^2) / cos,
        // by four-point Gauss-Legendre quadrature; t is linear along the chord.
        let end = |x: f32| {
            let centre = at.centre + (x - at.x) * at.drift;
            self.fiber_tangent(shape, ply, centre, at.axis, Vec2::new(x, self.h))
        };
        let (a, b) = (end(enter), end(exit));
        let nodes = f32x4::new(GAUSS_LEGENDRE_4.map(|(node, _)| node as f32));
        let weights = f32x4::new(GAUSS_LEGENDRE_4.map(|(_, weight)| weight as f32));
        let tx = f32x4::splat(a.x) + nodes * f32x4::splat(b.x - a.x);
        let ty = f32x4::splat(a.y) + nodes * f32x4::splat(b.y - a.y);
        let along = tx * f32x4::splat(self.cos) + f32x4::splat(self.sin);
        let square = f32x4::ONE + tx * tx + ty * ty - along * along;
        let root = square.fast_max(f32x4::splat(1e-9)).sqrt() * weights;
        self.squeeze() * root.reduce_add() / self.cos
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::yarn::{PlyParameters, tests::touching_yarn};

    fn place() -> YarnFrame {
        YarnFrame {
            centre: Vec3A::ZERO,
            tangent: Vec3A::Z,
            curvature: Vec3A::ZERO,
            radius: 1.0,
            normal: Vec3A::X,
            phase: 0.3,
            flattening: ROUND,
            flattening_turn: 0.0,
        }
    }

    fn ray(theta: f32, phi: f32, h: f32) -> (Vec3A, Vec3A) {
        let to_camera = Vec3A::new(theta.cos() * phi.cos(), theta.cos() * phi.sin(), theta.sin());
        let y = Vec3A::Z.cross(to_camera).normalize();
        (to_camera * 20.0 + h * y, -to_camera)
    }

    #[test]
    fn a_point_on_the_ray_is_on_the_ray() {
        for (theta, phi, h) in [(0.0, 0.2, 0.4), (0.7, 2.0, -0.7), (-0.6, -1.0, 0.1)] {
            let (origin, direction) = ray(theta, phi, h);
            let section = Section::new(&place(), origin, direction, true);
            assert!((section.h - h).abs() < 1e-5);
            // The frame's origin is beside the entry point, as Embree's u is.
            let entry = section.point_on_ray(section.enter);
            let shifted = place().centre + (origin - entry).dot(direction) * 0.0;
            let from_entry = section.point_on_ray(-0.2) - entry + shifted;
            assert!(from_entry.cross(direction).length() < 1e-5, "{from_entry} is off {direction}");
        }
    }

    #[test]
    fn crossings_agree_with_a_brute_force_walk_along_the_ray() {
        // Walk the ray through the turning plies and note which are entered, in which order, and how deep.
        let shape = touching_yarn(3, 60, 0.4, 0.35, -0.4);
        let mut crossings = Crossings::new();
        let mut seen = 0;
        for i in 0..600 {
            let (theta, phi) = (-0.5 + 0.0016 * i as f32, 0.05 * i as f32);
            let h = -0.99 + 1.98 * ((i * 37 % 600) as f32) / 599.0;
            let (origin, direction) = ray(theta, phi, h);
            let section = Section::new(&place(), origin, direction, true);
            section.crossings(&shape, &mut crossings);
            let steps = 8000;
            let mut inside = [0usize; 3];
            for s in 0..steps {
                let x = section.enter * (1.0 - 2.0 * (s as f32 + 0.5) / steps as f32);
                let travel = section.travel(x);
                for (k, ply) in shape.plies.iter().enumerate() {
                    let axis = section.ply_axis(ply, Section::turn(&shape, travel));
                    let d = Vec2::new(x, section.h) - ply.distance * axis;
                    inside[k] += usize::from(d.length() < ply.core_radius);
                }
            }
            for (k, count) in inside.iter().enumerate() {
                let walked = *count as f32 / steps as f32 * 2.0 * section.enter;
                let chord = crossings.iter().find(|c| c.ply == k).map_or(0.0, |c| c.enter - c.exit);
                // Within a ply the turning is linearised: chords agree to a few percent of the ply's diameter.
                assert!((walked - chord).abs() < 0.06, "ray {i} ply {k}: walked {walked}, crossing {chord}");
                seen += usize::from(chord > 0.0);
            }
            assert!(crossings.windows(2).all(|w| w[0].enter >= w[1].enter), "nearest first");
            let meets = shape.plies.iter().any(|_| !crossings.is_empty());
            assert_eq!(section.meets_ply(&shape), meets, "filter and shading agree");
        }
        assert!(seen > 600);
    }

    #[test]
    fn pressed_plies_are_the_pressed_image_of_round_ones() {
        // Points of the ray are in a ply if their image in the round section is.
        let shape = touching_yarn(3, 60, 0.4, 0.35, -0.4);
        let mut crossings = Crossings::new();
        let mut seen = 0;
        for i in 0..400 {
            let (theta, phi) = (-0.5 + 0.0024 * i as f32, 0.05 * i as f32);
            let h = -0.99 + 1.98 * ((i * 37 % 400) as f32) / 399.0;
            let ratio = 0.4 + 0.0015 * i as f32;
            let place = YarnFrame { flattening: ratio * Vec2::from_angle(0.7 * i as f32), ..place() };
            let (origin, direction) = ray(theta, phi, h);
            let section = Section::new(&place, origin, direction, true);
            section.crossings(&shape, &mut crossings);
            let steps = 8000;
            let mut inside = [0usize; 3];
            for s in 0..steps {
                let x = section.enter * (1.0 - 2.0 * (s as f32 + 0.5) / steps as f32);
                let point = section.round(Vec2::new(x, section.h));
                for (k, ply) in shape.plies.iter().enumerate() {
                    let centre = ply.distance * section.ply_axis(ply, Section::turn(&shape, section.travel(x)));
                    inside[k] += usize::from((point - centre).length() < ply.core_radius);
                }
            }
            for (k, count) in inside.iter().enumerate() {
                let walked = *count as f32 / steps as f32 * 2.0 * section.enter;
                let chord = crossings.iter().find(|c| c.ply == k).map_or(0.0, |c| c.enter - c.exit);
                assert!((walked - chord).abs() < 0.06, "ray {i} ply {k}: walked {walked}, crossing {chord}");
                seen += usize::from(chord > 0.0);
            }
            assert_eq!(section.meets_ply(&shape), !crossings.is_empty(), "filter and shading agree");
        }
        assert!(seen > 300);
    }

    #[test]
    fn pressing_keeps_the_fibers_that_rays_along_its_axes_meet() {
        // Across the short axis a ray meets what it met before; across the long one all fibres in less height.
        let shape = touching_yarn(1, 60, 0.4, 0.0, 0.0);
        let mut crossings = Crossings::new();
        let mut count = |flattening: Vec2, h: f32| {
            let section =
                Section::new(&YarnFrame { flattening, ..place() }, ray(0.0, 0.0, h).0, ray(0.0, 0.0, h).1, true);
            section.crossings(&shape, &mut crossings);
            crossings.iter().map(|c| c.fibers).sum::<f32>()
        };
        for h in [0.0, 0.2, -0.4] {
            let round = count(ROUND, h);
            assert!((count(Vec2::new(0.5, 0.0), h) / round - 1.0).abs() < 1e-5);
            assert!((count(Vec2::new(0.0, 0.5), 0.5 * h) / round - 2.0).abs() < 1e-5);
        }
        assert_eq!(count(Vec2::new(0.0, 0.5), 0.6), 0.0, "a ray that meets the round tube only passes");
    }

    #[test]
    fn perpendicular_rays_see_the_same_with_and_without_tilt() {
        let mut shape = touching_yarn(3, 60, 0.4, 0.35, -0.4);
        let (mut a, mut b) = (Crossings::new(), Crossings::new());
        let (origin, direction) = ray(0.0, 0.7, 0.3);
        Section::new(&place(), origin, direction, true).crossings(&shape, &mut a);
        shape.tilted = false;
        Section::new(&place(), origin, direction, false).crossings(&shape, &mut b);
        assert_eq!(a.len(), b.len());
        for (a, b) in a.iter().zip(&b) {
            assert!((a.enter - b.enter).abs() < 1e-6 && (a.fibers - b.fibers).abs() < 1e-5);
        }
    }

    #[test]
    fn the_picture_does_not_depend_on_where_the_camera_stands() {
        // Two cameras see the same ply at the same place in the world.
        let shape = touching_yarn(3, 60, 0.4, 0.0, 0.0);
        for phi in [0.0f32, 1.0, 2.5, 4.0] {
            let (origin, direction) = ray(0.0, phi, 0.0);
            let section = Section::new(&place(), origin, direction, true);
            for (k, ply) in shape.plies.iter().enumerate() {
                let axis = section.ply_axis(ply, (0.0, 1.0));
                let world = section.to_world(Vec3A::new(axis.x, axis.y, 0.0));
                let angle = 0.3 + std::f32::consts::TAU * k as f32 / 3.0;
                assert!((world - Vec3A::new(angle.cos(), angle.sin(), 0.0)).length() < 1e-5);
            }
        }
    }

    #[test]
    fn elliptical_plies_have_the_chords_of_their_ellipse() {
        let ply = PlyParameters {
            radius: 0.5,
            aspect: 0.64,
            distance: 0.45,
            angle: 0.4,
            fibers: 100,
            fiber_radius: 1e-4,
            fiber_twist: 0.0,
        };
        let shape = YarnShape::new(&[ply], 0.0, true);
        assert!(shape.elliptical && !shape.filled);
        let (short, long) = (0.5 * 0.8, 0.5 / 0.8);
        let mut crossings = Crossings::new();
        for i in 0..200 {
            let phi = 0.1 * i as f32;
            let h = -0.95 + 0.0095 * i as f32;
            let (origin, direction) = ray(0.0, phi, h);
            let section = Section::new(&place(), origin, direction, true);
            section.crossings(&shape, &mut crossings);
            let axis = section.ply_axis(&shape.plies[0], (0.0, 1.0));
            let inside = (0..40_000)
                .filter(|s| {
                    let x = 1.0 - 2.0 * (*s as f32 + 0.5) / 40_000.0;
                    let p = Vec2::new(x, h) - 0.45 * axis;
                    (p.dot(axis) / short).powi(2) + (p.perp_dot(axis) / long).powi(2) < 1.0
                })
                .count() as f32
                / 20_000.0;
            let chord = crossings.first().map_or(0.0, |c| c.enter - c.exit);
            assert!((inside - chord).abs() < 2e-3, "ray {i}: {inside} {chord}");
            if let Some(c) = crossings.first() {
                // Even fibres: 2 r_f n / area of the ellipse for each unit of chord.
                let want = 2.0 * 1e-4 * 100.0 / (std::f32::consts::PI * 0.25) * chord;
                assert!(chord < 0.05 || (c.fibers / want - 1.0).abs() < 2e-2, "ray {i}: {} {want}", c.fibers);
            }
        }
    }

    #[test]
    fn extreme_rays_stay_finite() {
        let shape = touching_yarn(3, 60, 0.4, 1.5, -1.5);
        let mut crossings = Crossings::new();
        for theta in [std::f32::consts::FRAC_PI_2, 1.57, -1.57, 0.0] {
            for h in [-1.0, 1.0, 0.0, 0.999_999] {
                let (origin, direction) = ray(theta, 0.3, h);
                let section = Section::new(&place(), origin, direction, true);
                section.crossings(&shape, &mut crossings);
                for c in &crossings {
                    assert!(c.fibers.is_finite() && c.enter.is_finite() && c.exit.is_finite(), "{c:?}");
                    assert!(c.normal(&section).is_finite() && c.tangent_at_entry(&shape, &section).is_finite());
                }
            }
        }
    }
}
