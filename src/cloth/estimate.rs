//! How much memory cloth takes for rays, known before it is made.

use std::{fmt, iter::Sum};

use crate::{
    math::words::{bytes_in_words, counted},
    trace::EmbreeError,
};

/// Bytes of Embree's BVH for a cubic segment: compact and fast, measured on fibres and on yarns.
const BVH_BYTES: [f64; 2] = [44.0, 119.0];
/// Bytes of a control point with its radius.
const POINT_BYTES: u64 = 16;
/// Bytes that a yarn keeps beside each point.
const FRAME_BYTES: u64 = 12;
/// Of what presses a point's section flat, in yarns that are.
pub(super) const FLATTENING_BYTES: u64 = 8;
/// Bytes of each point's distance along its yarn, where fibres are told apart.
pub(super) const DISTANCE_BYTES: u64 = 4;
/// Bytes of a segment's index.
const SEGMENT_BYTES: u64 = 4;
/// Bytes of the material index of each segment, in a fabric with variants.
pub(super) const MATERIAL_INDEX_BYTES: u64 = 2;

/// Why a scene could not be made ready for rays.
#[derive(Clone, Debug, PartialEq)]
pub enum BuildError {
    /// What Embree said.
    Embree(EmbreeError),
    /// It would take more memory than it may.
    Memory {
        /// What it would take.
        needed: Estimate,
        /// What the render takes besides, such as its film; bytes.
        beside: u64,
        /// What all may take, bytes.
        limit: u64,
    },
}

impl From<EmbreeError> for BuildError {
    fn from(error: EmbreeError) -> Self {
        Self::Embree(error)
    }
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Embree(error) => error.fmt(f),
            Self::Memory { needed, beside, limit } => {
                write!(
                    f,
                    "the scene needs about {} ({} of curves, {} of BVH, {}, {} of film and textures), but may take {}",
                    bytes_in_words(needed.bytes() + beside),
                    bytes_in_words(needed.geometry_bytes),
                    bytes_in_words(needed.bvh_bytes),
                    counted(needed.segments, "segment"),
                    bytes_in_words(*beside),
                    bytes_in_words(*limit)
                )
            }
        }
    }
}

impl std::error::Error for BuildError {}

/// What curves will take, and where they cannot be followed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Control points.
    pub points: u64,
    /// Segments.
    pub segments: u64,
    /// Bytes of control points, indices and what is kept for each point.
    pub geometry_bytes: u64,
    /// Bytes of Embree's BVH.
    pub bvh_bytes: u64,
    /// Yarns that bend more tightly somewhere than their radius allows.
    pub tight_bends: usize,
}

impl Sum for Estimate {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |a, b| Self {
            points: a.points + b.points,
            segments: a.segments + b.segments,
            geometry_bytes: a.geometry_bytes + b.geometry_bytes,
            bvh_bytes: a.bvh_bytes + b.bvh_bytes,
            tight_bends: a.tight_bends + b.tight_bends,
        })
    }
}

impl Estimate {
    /// All bytes.
    pub fn bytes(&self) -> u64 {
        self.geometry_bytes + self.bvh_bytes
    }

    /// That of so many times as much.
    pub(super) fn times(self, times: f64) -> Self {
        let [points, segments, geometry_bytes, bvh_bytes] =
            [self.points, self.segments, self.geometry_bytes, self.bvh_bytes].map(|n| (n as f64 * times) as u64);
        Self { points, segments, geometry_bytes, bvh_bytes, tight_bends: self.tight_bends }
    }

    pub(super) fn add(&mut self, points: u64, segments: u64, framed: bool, compact: bool) {
        self.points += points;
        self.segments += segments;
        self.geometry_bytes += points * (POINT_BYTES + if framed { FRAME_BYTES } else { 0 }) + segments * SEGMENT_BYTES;
        self.bvh_bytes += (segments as f64 * BVH_BYTES[usize::from(!compact)]) as u64;
    }
}
