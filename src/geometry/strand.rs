//! Yarn curves made ready for Embree: resampled to a tolerance, with a frame and the plies' phase at every point.
//!
//! In: curves in scene units (`f64`, already centred). Out: control points and segments in single precision, a normal
//! that does not turn about the yarn (rotation-minimising, by double reflection: Wang et al., "Computation of
//! Rotation Minimizing Frames", ACM TOG 2008), and the phase of the plies against it, closed at seams.

mod frames;
mod making;
mod unevenness;
mod winding;

use std::{borrow::Cow, sync::Arc};

use glam::{DVec3, Vec2, Vec3A, Vec4};
use wide::f32x4;

use self::frames::{PointFrame, SegmentFrame};
pub use self::unevenness::Unevenness;
use super::{
    curve::{Basis, Curve},
    material_indices::MaterialIndices,
    segment_uvs::SegmentUvs,
    spline::{catmull_rom_f32, evaluate_f32},
    tube::curve_of,
    yarn_frame::{ROUND, SectionGrowth, YarnFrame},
};

/// What a curve must satisfy on its way to Embree.
#[derive(Clone, Debug)]
pub struct StrandOptions {
    /// The basis to hand to Embree: Catmull-Rom or B-spline.
    pub basis: Basis,
    /// How far the resampled curve may lie from the given one, in yarn radii; 0 keeps the given points.
    pub tolerance: f64,
    /// The longest segment, in yarn radii.
    pub longest_segment: f64,
    /// Turns of the plies, radians per yarn radius along the yarn.
    pub ply_rate: f64,
    /// The smallest turn that maps the section onto itself, radians: how closely a seam must close.
    pub symmetry: f64,
    /// Phase of the plies where each yarn starts, radians; yarn i takes entry i modulo their number.
    pub phases: Vec<f64>,
    /// Whether to keep how far along its yarn each point is: see [`Strands::distance_along`].
    pub distances: bool,
    /// How the thickness of yarns changes along them, if it does.
    pub unevenness: Option<Unevenness>,
    /// Radius of the tube that holds all plies, over the yarn's. Tolerance, longest segment and rate are in radii of the tube.
    pub tube: f64,
}

/// A bend whose radius of curvature is so much smaller than the yarn's radius that the tube folds into itself, and plies
/// are seen to break.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TightBend {
    /// Which yarn.
    pub yarn: usize,
    /// Which segment of it, as resampled.
    pub segment: usize,
    /// By how much the inner side of the bend runs backwards, in yarn radii; above a half, and finite for any curve.
    pub fold: f64,
    /// At how many places the yarn bends so; this is the worst of them.
    pub places: usize,
}

/// Where the yarns of a fabric fold into themselves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Folds {
    /// How many of the yarns do.
    pub yarns: usize,
    /// At how many places.
    pub places: usize,
    /// The worst place.
    pub worst: TightBend,
    /// Where that is, in the space of the points.
    pub at: DVec3,
    /// Length of all yarns, in diameters.
    pub length: f64,
}

impl Folds {
    /// Whether they are seen: plies break widely at one of them, or they come so often that some are in every picture.
    pub fn are_seen(&self) -> bool {
        const WIDE: f64 = 2.0;
        const APART: f64 = 1000.0;
        self.worst.fold > WIDE || self.places as f64 * APART > self.length
    }
}

/// Yarns of one kind in one geometry of Embree; where they move, at times evenly spaced over the shutter's.
#[derive(Clone, Debug)]
pub struct Strands {
    basis: Basis,
    points: Arc<Vec<Vec4>>,
    segments: Arc<Vec<u32>>,
    frames: Vec<PointFrame>,
    /// The same points and frames at later times; empty where yarns stand still.
    later: Vec<Pose>,
    /// The same at the frame's own time and one frame later; empty where yarns stand still or nobody asks.
    flow: Vec<Pose>,
    uvs: SegmentUvs,
    /// Short axis of the section at each point, see [`YarnFrame::flattening`]; empty where all yarns are round.
    flattening: Vec<Vec2>,
    /// How far along its yarn, at rest, each point is, in yarn radii; empty where nobody asks.
    distances: Vec<f32>,
    material_indices: MaterialIndices,
    /// The first segment of each yarn, and the number of all segments at the end.
    first_segments: Vec<u32>,
    tight_bends: Vec<TightBend>,
    length: f64,
}

/// All points of [`Strands`] at one time.
#[derive(Clone, Debug)]
struct Pose {
    points: Arc<Vec<Vec4>>,
    frames: Vec<PointFrame>,
}

/// Where the points of curves are at other times: for each time, for each curve, its points.
#[derive(Clone, Copy, Debug, Default)]
pub struct StrandMotion<'a> {
    /// At times that follow the curves' own, evenly spaced until the shutter closes.
    pub later: &'a [Vec<Vec<DVec3>>],
    /// At rest: by lengths along these, plies wind about the yarn, so that stretching carries them along.
    pub rest: Option<&'a [Vec<DVec3>]>,
    /// At the frame's own time and one frame later; or nothing.
    pub flow: &'a [Vec<Vec<DVec3>>],
}

/// What lies along curves beside their points: for each curve; empty where there is nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Along<'a> {
    /// Material indices, so many evenly from each given point to the next (a closed curve goes on to its first point, an
    /// open one ends with its last), of which each segment gets that nearest to its middle.
    pub material_indices: &'a [Vec<u16>],
    /// Whether these go over into each other along a curve: see [`MaterialIndices::new`].
    pub blended: bool,
    /// Texture coordinates of each given point.
    pub uvs: &'a [Vec<Vec2>],
}

impl<'a> Along<'a> {
    /// What lies along one curve.
    fn of(&self, curve: usize) -> (&'a [u16], &'a [Vec2]) {
        let of_curve = self.material_indices.get(curve).map_or(&[][..], Vec::as_slice);
        (of_curve, self.uvs.get(curve).map_or(&[], Vec::as_slice))
    }
}

impl Strands {
    /// Prepares `curves`, each with its radii in the same unit; yarns are independent and made in parallel.
    pub fn new<'a>(curves: impl Into<Cow<'a, [(Curve, Vec<f64>)]>>, options: &StrandOptions) -> Self {
        Self::moving(curves, StrandMotion::default(), options)
    }

    /// Prepares curves that move.
    ///
    /// # Panics
    /// If curves or their points have other numbers at other times.
    pub fn moving<'a>(
        curves: impl Into<Cow<'a, [(Curve, Vec<f64>)]>>,
        motion: StrandMotion<'_>,
        options: &StrandOptions,
    ) -> Self {
        Self::with(curves, Along::default(), motion, options)
    }

    /// Prepares curves that move, with what lies along them. Curves that are handed over are freed as yarns are made of
    /// them.
    ///
    /// # Panics
    /// If curves or their points have other numbers at other times.
    pub fn with<'a>(
        curves: impl Into<Cow<'a, [(Curve, Vec<f64>)]>>,
        along: Along<'_>,
        motion: StrandMotion<'_>,
        options: &StrandOptions,
    ) -> Self {
        making::strands(curves.into(), along, motion, options)
    }

    /// The basis of the control points.
    pub fn basis(&self) -> Basis {
        self.basis
    }

    /// Control points, radius in `w`.
    pub fn points(&self) -> &Arc<Vec<Vec4>> {
        &self.points
    }

    /// Control points at all times: once where yarns stand still.
    pub fn points_in_time(&self) -> Vec<Arc<Vec<Vec4>>> {
        std::iter::once(&self.points).chain(self.later.iter().map(|pose| &pose.points)).map(Arc::clone).collect()
    }

    /// The first of the four control points of each segment.
    pub fn segments(&self) -> &Arc<Vec<u32>> {
        &self.segments
    }

    /// Number of yarns.
    pub fn yarns(&self) -> usize {
        self.first_segments.len() - 1
    }

    /// Length of all yarns together, in scene units.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// The tightest place of each yarn that bends more tightly than its radius allows.
    pub fn tight_bends(&self) -> &[TightBend] {
        &self.tight_bends
    }

    /// Where a yarn bends most tightly, in the space of the points.
    pub fn place_of(&self, bend: &TightBend) -> DVec3 {
        let segment = self.segments_of(bend.yarn).start + bend.segment as u32;
        self.frame(segment, 0.5).centre.as_dvec3()
    }

    /// What is known of all bends that are too tight, if there are any.
    pub fn folds(&self) -> Option<Folds> {
        let worst = *self.tight_bends.iter().max_by(|a, b| a.fold.total_cmp(&b.fold))?;
        // Yarns are as thick all along, or nearly.
        const SOME: usize = 4096;
        let some = self.points.chunks(self.points.len() / SOME + 1);
        let count = some.len().max(1) as f64;
        let radius = some.map(|points| f64::from(points[0].w)).sum::<f64>() / count;
        Some(Folds {
            yarns: self.tight_bends.len(),
            places: self.tight_bends.iter().map(|bend| bend.places).sum(),
            worst,
            at: self.place_of(&worst),
            length: self.length / (2.0 * radius).max(1e-300),
        })
    }

    /// Whether any yarn is pressed flat somewhere.
    pub fn flattened(&self) -> bool {
        !self.flattening.is_empty()
    }

    /// Mean ratio of the short to the long axis of the yarns' sections: 1 where all are round.
    pub fn mean_flattening(&self) -> f64 {
        let sum: f64 = self.flattening.iter().map(|f| f64::from(f.length())).sum();
        if self.flattening.is_empty() { 1.0 } else { sum / self.flattening.len() as f64 }
    }

    /// Bytes of points, segments and frames.
    pub fn bytes(&self) -> u64 {
        (size_of_val(self.points.as_slice())
            + size_of_val(self.segments.as_slice())
            + size_of_val(&*self.frames)
            + size_of_val(&*self.flattening)
            + size_of_val(&*self.distances)
            + self.uvs.bytes()
            + self
                .later
                .iter()
                .chain(&self.flow)
                .map(|p| size_of_val(p.points.as_slice()) + size_of_val(&*p.frames))
                .sum::<usize>()
            + size_of_val(&*self.first_segments)) as u64
            + self.material_indices.bytes()
    }

    /// The material index of a segment, if any has one.
    #[inline]
    pub fn material_index(&self, segment: u32) -> Option<u16> {
        self.material_indices.of(segment)
    }

    /// The material index at `u` (0 to 1) of a segment, if any has one: see [`MaterialIndices::at`].
    #[inline]
    pub fn material_index_at(&self, segment: u32, u: f32) -> Option<u16> {
        self.material_indices.at(segment, u, |forward| self.neighbour(segment, forward))
    }

    /// Texture coordinates along all segments.
    pub fn uvs(&self) -> &SegmentUvs {
        &self.uvs
    }

    /// Takes texture coordinates from elsewhere: none, or those of each segment.
    ///
    /// # Panics
    /// If their number is another.
    pub fn set_uvs(&mut self, uvs: SegmentUvs) {
        assert!(uvs.is_empty() || uvs.len() == self.segments.len(), "texture coordinates for each segment");
        self.uvs = uvs;
    }

    /// Frames at `u` (0 to 1) of a segment at the frame's own time and one frame later, if it moves.
    #[inline]
    pub fn flow(&self, segment: u32, u: f32) -> Option<[YarnFrame; 2]> {
        let [now, next] = self.flow.as_slice() else { return None };
        let first = self.segments[segment as usize] as usize;
        Some([now, next].map(|Pose { points, frames }| {
            let p: &[Vec4; 4] = points[first..first + 4].try_into().expect("a segment has four points");
            self.frame_of(first, p, &SegmentFrame::new(frames, first), u)
        }))
    }

    /// What segments are made of.
    pub fn material_indices(&self) -> &MaterialIndices {
        &self.material_indices
    }

    /// Sets the material indices, made elsewhere: none, or one for each segment.
    ///
    /// # Panics
    /// If their number is another.
    pub fn set_material_indices(&mut self, material_indices: MaterialIndices) {
        assert!(
            material_indices.is_empty() || material_indices.len() == self.segments.len(),
            "a material index for each segment"
        );
        self.material_indices = material_indices;
    }

    /// The yarn that a segment belongs to.
    pub fn yarn_of(&self, segment: u32) -> usize {
        self.first_segments.partition_point(|&first| first <= segment) - 1
    }

    /// The segments of one yarn.
    pub fn segments_of(&self, yarn: usize) -> std::ops::Range<u32> {
        self.first_segments[yarn]..self.first_segments[yarn + 1]
    }

    /// The segment of the same yarn before or behind another, if there is one without going over a seam.
    #[inline]
    pub fn neighbour(&self, segment: u32, forward: bool) -> Option<u32> {
        let next = if forward { segment.checked_add(1)? } else { segment.checked_sub(1)? };
        let first = *self.segments.get(next as usize)?;
        // Segments of one yarn begin at consecutive points.
        (first.abs_diff(self.segments[segment as usize]) == 1).then_some(next)
    }

    /// The last segment of a yarn, or its first, if it is at most so many segments from another one without going over a seam.
    #[inline]
    pub fn last_within(&self, segment: u32, forward: bool, count: u32) -> Option<u32> {
        let first = self.segments[segment as usize];
        let at = |n: u32| if forward { segment.checked_add(n) } else { segment.checked_sub(n) };
        // Segments of one yarn begin at consecutive points; from one yarn to the next there are more.
        let same = |n: u32| at(n).and_then(|s| self.segments.get(s as usize)).is_some_and(|f| f.abs_diff(first) == n);
        if same(count + 1) {
            return None;
        }
        let (mut own, mut beyond) = (0, count + 1);
        while beyond - own > 1 {
            let middle = (own + beyond) / 2;
            if same(middle) { own = middle } else { beyond = middle }
        }
        at(own)
    }

    /// Whether a yarn goes on before or behind one of its segments: it ends at the last one, unless it is closed.
    #[inline]
    pub fn goes_on(&self, segment: u32, forward: bool) -> bool {
        self.neighbour(segment, forward).is_some() || {
            let all = self.segments_of(self.yarn_of(segment));
            let first = |segment: u32| self.segments[segment as usize] as usize;
            let (start, end) = (first(all.start), first(all.end - 1));
            // A closed yarn begins with the points it ends with.
            let same = |i: usize| {
                let (a, b) = (self.points[start + i], self.points[end + i + 1]);
                a.distance_squared(b) <= 1e-8 * a.w * a.w
            };
            all.len() > 2 && same(1) && same(2)
        }
    }

    /// The yarns, each with its number, as curves with radii, to be written to a file; closed ones are cut at their seam, flat
    /// ones are round and of equal area. Those without segments are left out.
    pub fn curves(&self) -> impl Iterator<Item = (usize, Curve)> + '_ {
        (0..self.yarns()).filter(|&yarn| !self.segments_of(yarn).is_empty()).map(|yarn| {
            let segments = self.segments_of(yarn);
            let first = self.segments[segments.start as usize] as usize;
            let all = first..first + segments.len() + 3;
            if self.flattening.is_empty() {
                return (yarn, curve_of(self.basis, &self.points[all]));
            }
            let round = |i: usize| self.points[i] * Vec4::new(1.0, 1.0, 1.0, self.flattening[i].length().sqrt());
            (yarn, curve_of(self.basis, &all.map(round).collect::<Vec<_>>()))
        })
    }

    /// Length of one yarn in scene units, from step to step.
    pub fn length_of(&self, yarn: usize) -> f64 {
        const STEPS: u8 = 4;
        let mut length = 0.0;
        for segment in self.segments_of(yarn) {
            let mut before = self.frame(segment, 0.0).centre;
            for k in 1..=STEPS {
                let here = self.frame(segment, f32::from(k) / f32::from(STEPS)).centre;
                length += f64::from(here.distance(before));
                before = here;
            }
        }
        length
    }

    /// How far from the start of its yarn a place is, in yarn radii, by lengths at rest: as exact as its points are close. `None` where
    /// [`StrandOptions::distances`] did not ask.
    #[inline]
    pub fn distance_along(&self, segment: u32, u: f32) -> Option<f32> {
        let first = self.segments[segment as usize] as usize;
        let (from, to) = (self.distances.get(first + 1)?, self.distances.get(first + 2)?);
        let p = std::array::from_fn(|i| self.points[first + i]);
        // As fast at its ends as the segment, so that lines which wind about the yarn do not kink there.
        let [start, end] = [0.0, 1.0].map(|u| {
            let (at, speed, _) = evaluate_f32(self.basis, &p, u);
            speed.truncate().length() / at.w.max(1e-30)
        });
        let (length, v) = (to - from, 1.0 - u);
        Some(from + u * (u * (3.0 - 2.0 * u) * length + v * (v * start - u * end)))
    }

    /// Mean radius of one yarn's control points.
    pub fn mean_radius_of(&self, yarn: usize) -> f64 {
        let segments = self.segments_of(yarn);
        let n = segments.len().max(1) as f64;
        segments.map(|s| f64::from(self.points[self.segments[s as usize] as usize + 1].w)).sum::<f64>() / n
    }

    /// The larger radius of a segment's ends.
    #[inline]
    pub fn radius_about(&self, segment: u32) -> f32 {
        let first = self.segments[segment as usize] as usize;
        self.points[first + 1].w.max(self.points[first + 2].w)
    }

    /// About how long a segment is, in yarn radii.
    #[inline]
    pub fn stride_about(&self, segment: u32) -> f32 {
        let first = self.segments[segment as usize] as usize;
        let (from, to) = (self.points[first + 1], self.points[first + 2]);
        (to - from).truncate().length() / from.w.max(1e-30)
    }

    /// Everything a ray needs to know at `u` (0 to 1) of a segment.
    #[inline]
    pub fn frame(&self, segment: u32, u: f32) -> YarnFrame {
        let first = self.segments[segment as usize] as usize;
        let p: &[Vec4; 4] = self.points[first..first + 4].try_into().expect("a segment has four points");
        self.frame_of(first, p, &SegmentFrame::new(&self.frames, first), u)
    }

    /// Everything a ray needs to know at `u` (0 to 1) of a segment, at a time from 0, when the shutter opens, to 1, when it closes.
    #[inline]
    pub fn frame_at(&self, segment: u32, u: f32, time: f32) -> YarnFrame {
        if self.later.is_empty() { self.frame(segment, u) } else { self.frame_between(segment, u, time) }
    }

    fn frame_between(&self, segment: u32, u: f32, time: f32) -> YarnFrame {
        let x = (time * self.later.len() as f32).clamp(0.0, self.later.len() as f32);
        let step = (x as usize).min(self.later.len() - 1);
        let s = x - step as f32;
        let pose = |step: usize| match step.checked_sub(1) {
            None => (&self.points, &self.frames),
            Some(i) => (&self.later[i].points, &self.later[i].frames),
        };
        let ((points, frames), (next_points, next_frames)) = (pose(step), pose(step + 1));
        let first = self.segments[segment as usize] as usize;
        // As Embree moves them.
        let p = std::array::from_fn(|i| points[first + i].lerp(next_points[first + i], s));
        let frame = SegmentFrame::new(frames, first).towards(&SegmentFrame::new(next_frames, first), s);
        self.frame_of(first, &p, &frame, u)
    }

    #[inline]
    fn frame_of(&self, first: usize, p: &[Vec4; 4], frame: &SegmentFrame, u: f32) -> YarnFrame {
        let (at, speed, d2) = evaluate_f32(self.basis, p, u);
        let d1 = Vec3A::from_vec4(speed);
        let speed_squared = d1.length_squared().max(1e-30);
        let length = speed_squared.sqrt();
        let tangent = d1 / length;
        let stride = length / at.w.max(1e-30);
        let widening = speed.w / length;
        let curvature = (d2 - d2.dot(tangent) * tangent) / speed_squared;
        let normal = frame.normals[0].lerp(frame.normals[1], u);
        let normal = normal - normal.dot(tangent) * tangent;
        let (flattening, flattening_turn, thickening) = if self.flattening.is_empty() {
            (ROUND, 0.0, 0.0)
        } else {
            // The ratio by itself: between two axes a straight line is shorter than both. Its growth goes on from segment to segment, as
            // fibres lean with it.
            let near: &[Vec2; 4] = self.flattening[first..].first_chunk().expect("a segment has four points");
            let (x, y) = (f32x4::new(near.map(|f| f.x)), f32x4::new(near.map(|f| f.y)));
            let ratios = (x * x + y * y).sqrt().to_array();
            let [ratio, growth] = catmull_rom_f32(ratios, u);
            let ratio = ratio.clamp(FLATTEST as f32, 1.0);
            let (from, to) = (near[1], near[2]);
            let turn = from.perp_dot(to) / (ratios[1] * ratios[2]).max(1e-12);
            (ratio * from.lerp(to, u).normalize_or(ROUND), turn / stride, growth / stride)
        };
        YarnFrame {
            centre: Vec3A::from_vec4(at),
            tangent,
            curvature,
            radius: at.w,
            normal: normal / normal.length().max(1e-10),
            phase: frame.phase + u * frame.growth,
            turn: Some(frame.growth / stride),
            stride,
            flattening,
            flattening_turn,
            growth: SectionGrowth { widening, thickening },
        }
    }
}

/// The flattest section there is: short over long axis.
pub const FLATTEST: f64 = 0.05;

#[cfg(test)]
mod tests;
