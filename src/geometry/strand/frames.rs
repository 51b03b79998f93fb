//! What is known at a control point beyond its position and radius, packed, and what a segment makes of it.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3A};

/// What is known at a control point beyond its position and radius, in 12 bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct PointFrame {
    /// Rotation-minimising normal at the knot that this point stands for, in units of 1 / [`UNIT`].
    normal: [i16; 3],
    /// Whole turns of the plies along the segment that starts here, beyond what its ends' phases tell.
    turns: i16,
    /// Phase of the plies there, within a turn.
    phase: f32,
}

/// A unit vector's length in [`PointFrame::normal`], which is exact to 2e-5 radians.
const UNIT: f64 = 32_000.0;

impl PointFrame {
    /// At the `phase`, from which on it grows by `growth` to the next one, `next`, a turn being as good as another.
    pub(super) fn new(normal: DVec3, phase: f64, growth: f64, next: f64) -> Self {
        let turns = ((growth - f64::from(next as f32) + f64::from(phase as f32)) / TAU).round();
        let n = (UNIT * normal).round();
        Self { normal: [n.x as i16, n.y as i16, n.z as i16], turns: turns as i16, phase: phase as f32 }
    }

    #[inline]
    fn normal(&self) -> Vec3A {
        let [x, y, z] = self.normal;
        Vec3A::new(f32::from(x), f32::from(y), f32::from(z))
    }
}

/// What a segment knows of the frame along it.
#[derive(Clone, Copy)]
pub(super) struct SegmentFrame {
    /// Normals at its ends, of one length.
    pub(super) normals: [Vec3A; 2],
    /// Phase at its start, and by how much it grows to its end.
    pub(super) phase: f32,
    pub(super) growth: f32,
}

impl SegmentFrame {
    #[inline]
    pub(super) fn new(frames: &[PointFrame], first: usize) -> Self {
        let (a, b) = (&frames[first + 1], &frames[first + 2]);
        let growth = b.phase - a.phase + std::f32::consts::TAU * f32::from(a.turns);
        Self { normals: [a.normal(), b.normal()], phase: a.phase, growth }
    }

    /// The frame a share `s` of the way to that of a later time.
    pub(super) fn towards(&self, later: &Self, s: f32) -> Self {
        let turn = later.phase - self.phase;
        let turn = turn - std::f32::consts::TAU * (turn / std::f32::consts::TAU).round();
        Self {
            normals: std::array::from_fn(|i| self.normals[i].lerp(later.normals[i], s)),
            phase: self.phase + s * turn,
            growth: self.growth + s * (later.growth - self.growth),
        }
    }
}
