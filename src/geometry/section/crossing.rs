//! What a ray's way through a yarn is made of: passages through plies, and the fibres on them.

use arrayvec::ArrayVec;
use glam::{Vec2, Vec3A};
use wide::f32x4;

use super::{Inside, Section, unrotate};
use crate::{
    geometry::{
        density::ChordFibers,
        gaps::PlyGaps,
        ply::fiber_tangent,
        way::{self, Station, Way},
        yarn::{MAX_PLIES, YarnShape},
        yarn_frame::{Pressed, SectionGrowth},
    },
    math::special::{GAUSS_LEGENDRE_2, GAUSS_LEGENDRE_4},
};

/// The same of a chord on which fibres are counted.
const STRAIGHT_CHORD: f32 = 0.3;

/// One passage of a ray through a ply. Depths are distances along the ray from where it enters the yarn, in yarn radii.
#[derive(Clone, Copy, Debug)]
pub struct PlyCrossing {
    /// Index of the ply in the yarn's shape.
    pub ply: usize,
    /// Depth at which the ray enters the ply's core; a ray that only grazes its outer fibres has `enter` = `exit`.
    pub enter: f32,
    /// Depth at which it leaves the core, beyond `enter`.
    pub exit: f32,
    /// Depth of the middle of the chord.
    pub foot: f32,
    /// The fibres on the chord if they were not tilted, and where they lie, by distances in the section: x from the middle.
    pub chord: ChordFibers,
    /// Signed distance of the ray from the ply's axis, in the circle of the ply's radius.
    pub offset: f32,
    /// How wide fibres are across the ray in that circle, over their radius.
    pub wide: f32,
    /// How much of that circle a unit of the ray passes in the section.
    pub length: f32,
    /// How far along the yarn the ray is at `enter` and at `exit`.
    pub travel: [f32; 2],
    /// Expected number of fibres on the chord.
    pub fibers: f32,
    /// How many more a unit of the chord meets where the ray comes in and where it goes out than on the mean, for the fibres' tilt
    /// against the ray is not the same all along; over what it would be across the yarn, of which packings are measured.
    pub ends: [f32; 2],
    /// The gaps between them.
    pub gaps: PlyGaps,
}

impl PlyCrossing {
    /// How far along the yarn the ray is at a depth of this crossing.
    #[inline]
    pub fn travel_at(&self, depth: f32) -> f32 {
        let length = self.exit - self.enter;
        let share = if length > 0.0 { (depth - self.enter) / length } else { 0.0 };
        self.travel[0] + share * (self.travel[1] - self.travel[0])
    }

    /// The share of [`Self::chord`] that lies before so many of [`Self::fibers`].
    ///
    /// The tilt of the fibres is taken to change along the chord as the parabola that has its mean and its values at both ends.
    #[inline]
    pub fn share_before(&self, fibers: f32) -> f32 {
        /// Beyond, the parabola would have no fibres somewhere.
        const MOST: f32 = 3.0;
        const STEPS: usize = 4;
        if self.fibers <= 0.0 {
            return 0.0;
        }
        let wanted = fibers / self.fibers;
        let [first, last] = self.ends.map(|end| end.min(MOST));
        if (first - 1.0).abs().max((last - 1.0).abs()) < 1e-3 {
            return wanted;
        }
        let (b, c) = (6.0 - 4.0 * first - 2.0 * last, 3.0 * (first + last) - 6.0);
        let mut x = wanted;
        for _ in 0..STEPS {
            let before = x * (first + x * (0.5 * b + x * (c / 3.0)));
            let slope = first + x * (b + x * c);
            x = (x + (wanted - before) / slope.max(0.1)).clamp(0.0, 1.0);
        }
        x
    }

    /// Outward unit normal of the ply where the ray enters.
    pub fn normal(&self, shape: &YarnShape, section: &Section<'_>) -> Vec3A {
        let ply = &shape.plies[self.ply];
        let spot = section.inside(shape, section.point(self.enter), self.travel[0]);
        let p = spot.at - ply.distance * ply.direction;
        // The gradient of the distance in the ply's circle, first in the unwound yarn.
        let (along, across) = (p.dot(ply.direction), ply.direction.perp_dot(p));
        let stretch = ply.stretch * ply.stretch;
        let gradient = stretch.x * along * ply.direction + stretch.y * across * ply.direction.perp();
        // A step along the yarn turns the point back by as much as the plies turn.
        let rate = section.turn(shape);
        let rise = -rate * gradient.dot(spot.at.perp()) / spot.straightness;
        let wound = spot.pressed.map_or(gradient, |pressed| pressed.round(gradient));
        spot.out(wound.extend(rise).into()).normalize_or(Vec3A::X)
    }

    /// Unit tangent of the fibres where the ray enters.
    pub fn tangent_at_entry(&self, shape: &YarnShape, section: &Section<'_>) -> Vec3A {
        section.fiber_tangent(shape, self.ply, section.point(self.enter), self.travel[0]).normalize()
    }

    /// Unit tangent of the ply's axis where the ray passes it.
    #[inline]
    pub fn ply_tangent(&self, shape: &YarnShape, section: &Section<'_>) -> Vec3A {
        let depth = self.foot.clamp(self.enter, self.exit);
        let spot = section.inside(shape, section.point(depth), self.travel_at(depth));
        let ply = &shape.plies[self.ply];
        spot.tangent_at(shape, section, self.ply, ply.distance * ply.direction).normalize()
    }
}

/// The plies a ray crosses, nearest first; a ray along the yarn may cross one more than once.
pub type Crossings = ArrayVec<PlyCrossing, MAX_PLIES>;

/// A ply on a way out of a yarn.
#[derive(Clone, Copy, Debug)]
pub struct PlyAhead<'w> {
    /// Index of the ply in the yarn's shape.
    pub ply: usize,
    /// Signed distance of the way from the ply's axis, in the circle of the ply's radius.
    pub offset: f32,
    /// Distance in the section from the start to the way's point nearest to the ply's axis; negative behind the start.
    pub foot: f32,
    /// Length in the circle of one unit of that distance.
    pub length: f32,
    /// How much longer a step there is in the circle than in the round yarn: 1 if the ply is round.
    pub stretched: f32,
    /// The whole way, from `start` in the section's frame.
    pub(super) way: &'w [Station],
    pub(super) start: Vec3A,
    /// Whether it bends so much that the ply is not met as by a straight one.
    pub(super) bent: bool,
    /// Length in the section of one unit of it.
    pub(super) cos: f32,
}

impl PlyAhead<'_> {
    /// How many more fibres the way in the direction `w` meets there than one across untwisted plies, from one inside the yarn: |w x t| at the
    /// middle of what is ahead of the ply's `chord`, over the way's length in the section, times [`Section::squeeze`].
    #[inline]
    pub fn tilt(&self, shape: &YarnShape, section: &Section<'_>, from: &Inside, w: Vec3A, chord: &ChordFibers) -> f32 {
        let (enter, exit) = ((self.foot - chord.half).max(0.0), (self.foot + chord.half).max(0.0));
        if self.bent {
            return self.mean_tilt(shape, section, w, [enter, exit]);
        }
        let station = way::station_at(self.way, 0.5 * (enter + exit) / self.cos);
        // The direction as it is seen from the unwound yarn's axes there.
        let turned = from.turn * (station.travel - from.travel);
        let turned = Vec2::new(1.0 - 0.5 * turned * turned, turned);
        let across = unrotate(from.across(w), turned);
        let along = station.advance * station.straightness;
        let of = &shape.plies[self.ply];
        let at = station.at;
        let t = fiber_tangent(of, shape.ply_rate, of.distance * of.direction, of.direction, at).truncate();
        let pressed = from.pressed.map(|pressed| Pressed { axis: unrotate(pressed.axis, turned), ..pressed });
        let t = section.real_slope(pressed, at, t);
        let (w, t) = (across.extend(along), (t / station.straightness).extend(1.0));
        let square = w.cross(t).length_squared() / w.length_squared().max(1e-12);
        section.squeeze() * square.max(1e-9).sqrt() / self.cos
    }

    /// The same as the mean of two places between distances at which the way is in the ply.
    fn mean_tilt(&self, shape: &YarnShape, section: &Section<'_>, w: Vec3A, [enter, exit]: [f32; 2]) -> f32 {
        let tilt_at = |share: f32| {
            let depth = (enter + share * (exit - enter)) / self.cos;
            let travel = way::station_at(self.way, depth).travel;
            let t = section.fiber_tangent(shape, self.ply, self.start + depth * w, travel);
            w.cross(t).length()
        };
        let mean = 0.5 * GAUSS_LEGENDRE_2.map(|share| tilt_at(share as f32)).iter().sum::<f32>();
        section.squeeze() * mean.max(3e-5) / self.cos
    }
}

impl Section<'_> {
    /// How far beside the ray the middle of the first fibre of a crossing is, which `u` draws: in the circle of the ply's radius, signed as
    /// [`PlyCrossing::offset`].
    #[inline]
    pub fn first_beside(&self, shape: &YarnShape, crossing: &PlyCrossing, u: f32) -> f32 {
        let PlyCrossing { ply, offset, wide, .. } = crossing;
        shape.plies[*ply].middle_beside(*offset, *wide, u) - offset
    }

    /// How deep the first fibre of a crossing is, so far `beside` the ray, which the gaps between fibres have at a `depth`, inside the yarn there:
    /// below the end of its own chord of the core, as [`FirstFiber`](crate::geometry::first_fiber::FirstFiber) has it.
    #[inline]
    pub fn first_depth(
        &self,
        shape: &YarnShape,
        crossing: &PlyCrossing,
        inside: &Inside,
        depth: f32,
        beside: f32,
    ) -> f32 {
        let PlyCrossing { ply, foot, chord, offset, wide, length, .. } = crossing;
        let of = &shape.plies[*ply];
        let half = of.half_chord(offset + beside, *wide) / length;
        let below = chord.half - (foot - depth) * self.cos;
        let below = of.first.map_or(below, |first| {
            let thick = self.thinness() * of.fiber_radius;
            thick
                * first.depth(
                    below / thick,
                    of.first_by_rim(*offset),
                    inside.along_short_axis(shape, *ply, self.direction()),
                )
        });
        (foot - (half - below).max(-half) / self.cos).max(0.0)
    }

    /// Fibres that a unit of a chord's depth meets over those that it would meet across untwisted round plies: the mean
    /// from `enter` to `exit` of |w x t| for the unit vector w of the ray and the tangents t (of z = 1) of the fibres, times
    /// [`Self::squeeze`]. (The paper's 1 / cos(theta_fiber), Eq. 2, takes the worst place for all: fibres near the ply's
    /// axis are not tilted.) And how many times as many at both ends: [`PlyCrossing::ends`].
    #[inline]
    pub(super) fn fibers_over_chord(
        &self,
        shape: &YarnShape,
        ply: usize,
        way: &Way,
        enter: &Station,
        exit: &Station,
    ) -> (f32, [f32; 2]) {
        let of = &shape.plies[ply];
        let along = |at: &Station| if self.tilted { at.advance * at.straightness } else { -self.sin };
        if of.fiber_rate == 0.0 && shape.ply_rate == 0.0 && self.growth == SectionGrowth::default() {
            // Fibres along the yarn.
            let along = 0.5 * (along(enter) + along(exit));
            return ((1.0 - along * along).max(1e-6).sqrt() * self.squeeze(), [1.0; 2]);
        }
        // Tangent and ray at both ends; between them both are linear, or the parabola through the middle where the ray is
        // seen to bend. The mean is by four-point Gauss-Legendre quadrature.
        let direction = self.direction();
        let end = |at: &Station| match self.pressed {
            // In the unwound yarn's axes: the ray moves as it is seen to, and as those axes turn.
            None => {
                let t = fiber_tangent(of, shape.ply_rate, of.distance * of.direction, of.direction, at.at);
                let w = at.slope + self.turn(shape) * at.advance * at.at.perp();
                (self.real_slope(None, at.at, t.truncate()) / at.straightness, w, along(at))
            }
            Some(_) => {
                let t = self.fiber_tangent(shape, ply, self.point(at.depth), at.travel);
                let t = t / t.z.abs().max(1e-6).copysign(t.z);
                (t.truncate(), direction.truncate(), -self.sin)
            }
        };
        let ((ta, wa, za), (tb, wb, zb)) = (end(enter), end(exit));
        let nodes = f32x4::new(GAUSS_LEGENDRE_4.map(|(node, _)| node as f32));
        let weights = f32x4::new(GAUSS_LEGENDRE_4.map(|(_, weight)| weight as f32));
        let (mut tm, mut wm, mut zm) = (Vec2::ZERO, Vec2::ZERO, 0.0);
        if (shape.ply_rate * (exit.travel - enter.travel)).abs() > STRAIGHT_CHORD {
            let (t, w, z) = end(&way::station_at(way, 0.5 * (enter.depth + exit.depth)));
            (tm, wm, zm) = (4.0 * t - 2.0 * (ta + tb), 4.0 * w - 2.0 * (wa + wb), 4.0 * z - 2.0 * (za + zb));
        }
        let bow = nodes * (f32x4::ONE - nodes);
        let mix = |a: f32, b: f32, m: f32| f32x4::splat(a) + nodes * f32x4::splat(b - a) + bow * f32x4::splat(m);
        let (tx, ty) = (mix(ta.x, tb.x, tm.x), mix(ta.y, tb.y, tm.y));
        let (wx, wy, wz) = (mix(wa.x, wb.x, wm.x), mix(wa.y, wb.y, wm.y), mix(za, zb, zm));
        let (cx, cy, cz) = (wy - wz * ty, wz * tx - wx, wx * ty - wy * tx);
        // Between two places where the unwound yarn's axes have turned, the straight line is shorter than w.
        let square = (cx * cx + cy * cy + cz * cz) / (wx * wx + wy * wy + wz * wz);
        let mean = (square.sqrt() * weights).reduce_add();
        // The same of a ray across the yarn.
        let (level, turned) = (wx * wx + wy * wy, wx * ty - wy * tx);
        let mean_across = (((level + turned * turned) / level).sqrt() * weights).reduce_add();
        let at_end = |t: Vec2, w: Vec2, z: f32| {
            let (level, turned) = (w.length_squared(), w.perp_dot(t));
            let (w, t) = (w.extend(z), t.extend(1.0));
            let square = w.cross(t).length_squared() / w.length_squared() * level / (level + turned * turned);
            square.sqrt() * mean_across / mean
        };
        (mean * self.squeeze(), [at_end(ta, wa, za), at_end(tb, wb, zb)])
    }
}
