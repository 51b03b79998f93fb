//! Yarn curves made ready for Embree: resampled to a tolerance, with a frame and the plies' phase at every point.
//!
//! In: curves in scene units (`f64`, already centred). Out: control points and segments in single precision, a normal
//! that does not turn about the yarn (rotation-minimising, by double reflection: Wang et al., "Computation of
//! Rotation Minimizing Frames", ACM TOG 2008), and the phase of the plies against it, closed at seams.

use std::{
    borrow::Cow,
    f64::consts::{FRAC_PI_2, TAU},
    sync::Arc,
};

use glam::{DVec2, DVec3, Vec2, Vec3A, Vec4};
use rayon::prelude::*;

use super::{
    chain::{Chain, Fit, GAUSS, nearest_indices, resample, uvs_of_segments},
    curve::{Basis, Curve},
    spline::{SplinePoint, Weights, evaluate_f32},
    tube::curve_of,
    yarn_frame::{Pressed, ROUND, YarnFrame},
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
}

/// How far the inner side of a bend may run backwards, in yarn radii, before plies are seen to break: about the radius of one
/// ply of three.
const SEEN_FOLD: f64 = 0.5;

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
}

/// What is known at a control point beyond its position and radius, in 12 bytes.
#[derive(Clone, Copy, Debug)]
struct PointFrame {
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
    fn new(normal: DVec3, phase: f64, growth: f64, next: f64) -> Self {
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
struct SegmentFrame {
    /// Normals at its ends, of one length.
    normals: [Vec3A; 2],
    /// Phase at its start, and by how much it grows to its end.
    phase: f32,
    growth: f32,
}

impl SegmentFrame {
    #[inline]
    fn new(frames: &[PointFrame], first: usize) -> Self {
        let (a, b) = (&frames[first + 1], &frames[first + 2]);
        let growth = b.phase - a.phase + std::f32::consts::TAU * f32::from(a.turns);
        Self { normals: [a.normal(), b.normal()], phase: a.phase, growth }
    }

    /// The frame a share `s` of the way to that of a later time.
    fn towards(&self, later: &Self, s: f32) -> Self {
        let turn = later.phase - self.phase;
        let turn = turn - std::f32::consts::TAU * (turn / std::f32::consts::TAU).round();
        Self {
            normals: std::array::from_fn(|i| self.normals[i].lerp(later.normals[i], s)),
            phase: self.phase + s * turn,
            growth: self.growth + s * (later.growth - self.growth),
        }
    }
}

/// Yarns of one kind in one geometry of Embree; where they move, at times evenly spaced over the shutter's.
#[derive(Clone, Debug)]
pub struct Strands {
    basis: Basis,
    points: Arc<[Vec4]>,
    segments: Arc<[u32]>,
    frames: Vec<PointFrame>,
    /// The same points and frames at later times; empty where yarns stand still.
    later: Vec<Pose>,
    /// The same at the frame's own time and one frame later; empty where yarns stand still or nobody asks.
    flow: Vec<Pose>,
    /// Texture coordinates where each segment starts and ends; empty if nobody asks.
    uvs: Vec<[Vec2; 2]>,
    /// As [`YarnFrame::flattening`], for each point; empty where all yarns are round.
    flattening: Vec<Vec2>,
    /// What was nearest for each segment: see [`Self::material_index`].
    material_indices: Vec<u16>,
    /// The first segment of each yarn, and the number of all segments at the end.
    first_segments: Vec<u32>,
    tight_bends: Vec<TightBend>,
    length: f64,
}

/// All points of [`Strands`] at one time.
#[derive(Clone, Debug)]
struct Pose {
    points: Arc<[Vec4]>,
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
    /// Texture coordinates of each given point.
    pub uvs: &'a [Vec<Vec2>],
}

/// One yarn before it joins the others.
struct Strand {
    /// Points and frames at each time.
    poses: Vec<(Vec<Vec4>, Vec<PointFrame>)>,
    /// For each point, or empty.
    flattening: Vec<Vec2>,
    material_indices: Vec<u16>,
    /// For each segment, or empty.
    uvs: Vec<[Vec2; 2]>,
    tight: Option<(usize, f64)>,
    length: f64,
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
        let mut curves = curves.into();
        let mut joined = Joined::new(curves.len(), motion.later.len() + motion.flow.len());
        let mut first = 0;
        while first < curves.len() {
            // A few at a time, so that what is not joined yet stays small.
            let mut points = 0;
            let fits = |(curve, _): &&(Curve, Vec<f64>)| {
                let before = points;
                points += curve.points.len();
                before < BATCH
            };
            let end = first + curves[first..].iter().take_while(fits).count();
            let made: Vec<Strand> = (first..end)
                .into_par_iter()
                .map(|yarn| {
                    let (curve, radii) = &curves[yarn];
                    let phase =
                        if options.phases.is_empty() { 0.0 } else { options.phases[yarn % options.phases.len()] };
                    let later = motion.later.iter().chain(motion.flow);
                    let later: Vec<&[DVec3]> = later.map(|curves| curves[yarn].as_slice()).collect();
                    let rest = motion.rest.map(|curves| curves[yarn].as_slice());
                    Strand::new(curve, radii, along.of(yarn), &later, rest, options, phase)
                })
                .collect();
            if let Cow::Owned(curves) = &mut curves {
                for (curve, radii) in &mut curves[first..end] {
                    (curve.points, *radii) = (Vec::new(), Vec::new());
                }
            }
            made.into_iter().for_each(|strand| joined.push(strand));
            first = end;
        }
        joined.finish(options.basis, motion.flow.len())
    }

    /// The basis of the control points.
    pub fn basis(&self) -> Basis {
        self.basis
    }

    /// Control points, radius in `w`.
    pub fn points(&self) -> &Arc<[Vec4]> {
        &self.points
    }

    /// Control points at all times: once where yarns stand still.
    pub fn points_in_time(&self) -> Vec<Arc<[Vec4]>> {
        std::iter::once(&self.points).chain(self.later.iter().map(|pose| &pose.points)).map(Arc::clone).collect()
    }

    /// The first of the four control points of each segment.
    pub fn segments(&self) -> &Arc<[u32]> {
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
        (size_of_val(&*self.points)
            + size_of_val(&*self.segments)
            + size_of_val(&*self.frames)
            + size_of_val(&*self.flattening)
            + size_of_val(&*self.uvs)
            + self
                .later
                .iter()
                .chain(&self.flow)
                .map(|p| size_of_val(&*p.points) + size_of_val(&*p.frames))
                .sum::<usize>()
            + size_of_val(&*self.material_indices)
            + size_of_val(&*self.first_segments)) as u64
    }

    /// The material index of a segment, if any has one.
    #[inline]
    pub fn material_index(&self, segment: u32) -> Option<u16> {
        self.material_indices.get(segment as usize).copied()
    }

    /// Texture coordinates at `u` (0 to 1) of a segment; zero if nobody asked for them.
    #[inline]
    pub fn uv(&self, segment: u32, u: f32) -> Vec2 {
        self.uvs.get(segment as usize).map_or(Vec2::ZERO, |[start, end]| start.lerp(*end, u))
    }

    /// Whether texture coordinates were asked for.
    pub fn has_uvs(&self) -> bool {
        !self.uvs.is_empty()
    }

    /// Takes texture coordinates from elsewhere; nothing, or a pair for each segment.
    pub fn set_uvs(&mut self, uvs: Vec<[Vec2; 2]>) {
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

    /// Takes what was nearest_indices for every segment from elsewhere; nothing, or one for each.
    pub fn set_material_indices(&mut self, material_indices: Vec<u16>) {
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

    /// Mean radius of one yarn's control points.
    pub fn mean_radius_of(&self, yarn: usize) -> f64 {
        let segments = self.segments_of(yarn);
        let n = segments.len().max(1) as f64;
        segments.map(|s| f64::from(self.points[self.segments[s as usize] as usize + 1].w)).sum::<f64>() / n
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
        let (at, d1, d2) = evaluate_f32(self.basis, p, u);
        let speed_squared = d1.length_squared().max(1e-30);
        let speed = speed_squared.sqrt();
        let tangent = d1 / speed;
        let stride = speed / at.w.max(1e-30);
        let curvature = (d2 - d2.dot(tangent) * tangent) / speed_squared;
        let normal = frame.normals[0].lerp(frame.normals[1], u);
        let normal = normal - normal.dot(tangent) * tangent;
        let (flattening, flattening_turn) = if self.flattening.is_empty() {
            (ROUND, 0.0)
        } else {
            let (from, to) = (self.flattening[first + 1], self.flattening[first + 2]);
            let length = |v: Vec2| v.length();
            // The ratio by itself: between two axes a straight line is shorter than both.
            let ratio = length(from) + u * (length(to) - length(from));
            let turn = from.perp_dot(to) / (length(from) * length(to)).max(1e-12);
            (ratio * from.lerp(to, u).normalize_or(ROUND), turn / stride)
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
        }
    }
}

/// The flattest section there is: short over long axis.
pub const FLATTEST: f64 = 0.05;

/// Points of curves that are made into yarns at a time.
const BATCH: usize = 1 << 20;

/// Yarns one behind the other.
struct Joined {
    poses: Vec<(Vec<Vec4>, Vec<PointFrame>)>,
    /// Of the points of all yarns up to the last that is pressed flat.
    flattening: Vec<Vec2>,
    segments: Vec<u32>,
    material_indices: Vec<u16>,
    uvs: Vec<[Vec2; 2]>,
    first_segments: Vec<u32>,
    tight_bends: Vec<TightBend>,
    length: f64,
}

impl<'a> Along<'a> {
    /// What lies along one curve.
    fn of(&self, curve: usize) -> (&'a [u16], &'a [Vec2]) {
        let of_curve = self.material_indices.get(curve).map_or(&[][..], Vec::as_slice);
        (of_curve, self.uvs.get(curve).map_or(&[], Vec::as_slice))
    }
}

impl Joined {
    fn new(yarns: usize, later: usize) -> Self {
        Self {
            poses: vec![(Vec::new(), Vec::new()); 1 + later],
            flattening: Vec::new(),
            segments: Vec::new(),
            material_indices: Vec::new(),
            uvs: Vec::new(),
            first_segments: Vec::with_capacity(yarns + 1),
            tight_bends: Vec::new(),
            length: 0.0,
        }
    }

    fn push(&mut self, strand: Strand) {
        let yarn = self.first_segments.len();
        self.first_segments.push(self.segments.len() as u32);
        let first = self.poses[0].0.len() as u32;
        self.segments.extend(first..first + strand.poses[0].0.len().saturating_sub(3) as u32);
        if !strand.flattening.is_empty() {
            self.flattening.resize(first as usize, ROUND);
            self.flattening.extend(strand.flattening);
        }
        for (all, (points, frames)) in self.poses.iter_mut().zip(strand.poses) {
            all.0.extend(points);
            all.1.extend(frames);
        }
        self.material_indices.extend(strand.material_indices);
        self.uvs.extend(strand.uvs);
        self.length += strand.length;
        self.tight_bends.extend(strand.tight.map(|(segment, fold)| TightBend { yarn, segment, fold }));
    }

    fn finish(mut self, basis: Basis, flow: usize) -> Strands {
        self.first_segments.push(self.segments.len() as u32);
        if self.flattening.iter().all(|f| Pressed::new(*f).is_none()) {
            self.flattening = Vec::new();
        } else {
            self.flattening.resize(self.poses[0].0.len(), ROUND);
        }
        let pose = |(points, mut frames): (Vec<Vec4>, Vec<PointFrame>)| {
            frames.shrink_to_fit();
            Pose { points: points.into(), frames }
        };
        let mut poses = self.poses.into_iter().map(pose);
        let first = poses.next().expect("yarns are somewhere when the shutter opens");
        let mut later: Vec<Pose> = poses.collect();
        let flow = later.split_off(later.len() - flow);
        Strands {
            basis,
            points: first.points,
            segments: self.segments.into(),
            frames: first.frames,
            later,
            flow,
            uvs: self.uvs,
            flattening: self.flattening,
            material_indices: self.material_indices,
            first_segments: self.first_segments,
            tight_bends: self.tight_bends,
            length: self.length,
        }
    }
}

impl Strand {
    fn new(
        curve: &Curve,
        radii: &[f64],
        (material_indices, uvs): (&[u16], &[Vec2]),
        later: &[&[DVec3]],
        rest: Option<&[DVec3]>,
        options: &StrandOptions,
        phase: f64,
    ) -> Self {
        let chain = Chain::new(curve, radii);
        let lengths = chain.lengths();
        let total = lengths[lengths.len() - 1];
        let closed = curve.closed && curve.points.len() >= 3;
        let mean_radius = radii.iter().sum::<f64>() / radii.len().max(1) as f64;
        let kept = options.tolerance <= 0.0 && chain.basis == options.basis;
        let knots = if kept || total <= 0.0 || total.is_nan() {
            None
        } else {
            let fit = Fit {
                basis: options.basis,
                tolerance: options.tolerance * mean_radius,
                longest: options.longest_segment * mean_radius,
            };
            resample(&chain, &lengths, closed, &fit)
        };
        let material_indices = if material_indices.is_empty() {
            Vec::new()
        } else {
            nearest_indices(curve, material_indices, &chain, knots.as_deref())
        };
        let uvs = if uvs.is_empty() { Vec::new() } else { uvs_of_segments(curve, uvs, &chain, knots.as_deref()) };
        // The same places of the yarn at all times: points move with it.
        let resampled = |chain: Chain| match &knots {
            Some(knots) => chain.through(knots, closed, options.basis),
            None => chain,
        };
        let rest = rest.map(|points| resampled(Chain::at_time(curve, radii, points)));
        let poses: Vec<Chain> = std::iter::once(chain)
            .chain(later.iter().map(|points| Chain::at_time(curve, radii, points)))
            .map(resampled)
            .collect();
        let wound: Vec<Winding> = poses.iter().map(|pose| Winding::new(pose, options)).collect();
        let at_rest = rest.map(|rest| Winding::new(&rest, options));
        let at_rest = at_rest.as_ref().unwrap_or(&wound[0]);
        let missing =
            |residual: f64, from: f64| residual - options.symmetry * ((residual - from) / options.symmetry).round();
        let missing_at_rest = missing(at_rest.residual(at_rest), 0.0);
        let frames = |winding: &Winding| {
            // The frame of a closed yarn comes back turned by some angle; what is missing to a full symmetry is spread
            // over the yarn, always the same one.
            let missing = if curve.closed { missing(winding.residual(at_rest), missing_at_rest) } else { 0.0 };
            winding.frames(at_rest, missing, phase)
        };
        let tight = wound[0].tight;
        let flattening = match &curve.flattening {
            Some(vectors) => flattening_along(curve, vectors, knots.as_deref(), &wound[0]),
            None => Vec::new(),
        };
        let points = |chain: &Chain| chain.points.iter().map(|p| p.as_vec4()).collect();
        let poses = poses.iter().zip(&wound).map(|(chain, winding)| (points(chain), frames(winding))).collect();
        Self { poses, flattening, material_indices, uvs, tight, length: total }
    }
}

/// What presses a curve flat, in the frame of each point of the chain made from it: it moves with that frame.
fn flattening_along(curve: &Curve, vectors: &[DVec3], knots: Option<&[(usize, f64)]>, wound: &Winding) -> Vec<Vec2> {
    assert_eq!(vectors.len(), curve.points.len(), "a curve is pressed flat at each of its points or at none");
    // An axis has no sign: each points to the side of the one before. Its direction and its ratio make a chain of their
    // own, which has its knots where the curve has them.
    let mut axis = DVec3::ZERO;
    let axes: Vec<DVec3> = vectors
        .iter()
        .map(|v| {
            let v = v.try_normalize().unwrap_or(axis);
            axis = if v.dot(axis) < 0.0 { -v } else { v };
            axis
        })
        .collect();
    let ratios: Vec<f64> = vectors.iter().map(|v| v.length()).collect();
    let chain = Chain::at_time(curve, &ratios, &axes);
    let ends = || (0..chain.segments()).map(|i| (i, 0.0)).chain([(chain.segments() - 1, 1.0)]);
    let at: Vec<(usize, f64)> = knots.map_or_else(|| ends().collect(), <[_]>::to_vec);
    let mut before = DVec2::ZERO;
    let made = at.iter().zip(&wound.knots).map(|(&(segment, u), knot)| {
        let place = chain.at(segment, u);
        let axis = place.at.truncate();
        let across = DVec2::new(axis.dot(knot.normal), axis.dot(knot.tangent.cross(knot.normal)));
        let across = across.try_normalize().unwrap_or(DVec2::X) * place.at.w.clamp(FLATTEST, 1.0);
        before = if across.dot(before) < 0.0 { -across } else { across };
        before.as_vec2()
    });
    let made: Vec<Vec2> = made.collect();
    std::iter::once(made[0]).chain(made.iter().copied()).chain([made[made.len() - 1]]).collect()
}

/// A normal carried along a chain, and how far plies have turned about it.
struct Winding {
    knots: Vec<Knot>,
    /// By how much a closed chain turns the normal against itself.
    angle: f64,
    tight: Option<(usize, f64)>,
}

/// A knot of a chain.
#[derive(Clone, Copy)]
struct Knot {
    tangent: DVec3,
    normal: DVec3,
    /// The angle of the plies' turns up to here.
    turned: f64,
}

/// Segments along which a normal is carried in one go; longer chains are cut, whatever the number of threads.
const STRETCH: usize = 16_384;

impl Winding {
    /// Carries the normal along the chain and integrates the phase of the plies.
    fn new(chain: &Chain, options: &StrandOptions) -> Self {
        let segments = chain.segments();
        let starts: Vec<usize> = (0..segments.max(1)).step_by(STRETCH).collect();
        let stretches: Vec<_> = starts
            .into_par_iter()
            .map(|start| carry(chain, start, (start + STRETCH).min(segments), options.ply_rate))
            .collect();
        // Each stretch began with a normal of its own: turned as a whole, it goes on where the one before ends.
        let mut knots: Vec<Knot> = Vec::with_capacity(segments + 1);
        let mut tight: Option<(usize, f64)> = None;
        for (mut stretch, its_tight) in stretches {
            if let Some(end) = knots.pop() {
                let first = stretch[0];
                let (sin, cos) = (end.normal.dot(first.tangent.cross(first.normal)), end.normal.dot(first.normal));
                let size = sin.hypot(cos);
                let (sin, cos) = if size > 0.0 { (sin / size, cos / size) } else { (0.0, 1.0) };
                for knot in &mut stretch {
                    knot.normal = cos * knot.normal + sin * knot.tangent.cross(knot.normal);
                    knot.turned += end.turned;
                }
            }
            knots.append(&mut stretch);
            if let Some((_, fold)) = its_tight
                && tight.is_none_or(|(_, worst)| fold > worst)
            {
                tight = its_tight;
            }
        }
        let (start, end) = (knots[0].normal, knots[knots.len() - 1]);
        let angle = end.tangent.dot(start.cross(end.normal)).atan2(start.dot(end.normal));
        Self { knots, angle, tight }
    }

    /// By how much a closed yarn's section comes back turned, when its plies turn as they do at rest.
    fn residual(&self, at_rest: &Self) -> f64 {
        self.angle + at_rest.knots[at_rest.knots.len() - 1].turned
    }

    /// What is known at each control point.
    fn frames(&self, at_rest: &Self, missing: f64, phase: f64) -> Vec<PointFrame> {
        let segments = self.knots.len() - 1;
        let turned = |i: usize| at_rest.knots[i].turned - missing * i as f64 / segments as f64;
        // Knot i is where segment i starts: the second of its four points.
        let frame = |i: usize| {
            let angle = |i: usize| phase + turned(i.min(segments));
            let within = |angle: f64| angle - TAU * (angle / TAU).round();
            let growth = angle(i + 1) - angle(i);
            let normal = self.knots[i.min(segments)].normal;
            PointFrame::new(normal, within(angle(i)), growth, within(angle(i + 1)))
        };
        let mut frames = Vec::with_capacity(segments + 3);
        frames.push(frame(0));
        frames.extend((0..=segments).map(frame));
        frames.push(frame(segments));
        frames
    }
}

/// Carries a normal, whichever is easy to find at their start, along the segments from `start` to `end` of a chain: the
/// knots from there to there, and the tightest bend.
fn carry(chain: &Chain, start: usize, end: usize, ply_rate: f64) -> (Vec<Knot>, Option<(usize, f64)>) {
    let [a, b, c, d] = GAUSS;
    let nodes = [a, b, c, d, (1.0, 0.0)].map(|(u, weight)| (Weights::new(chain.basis, u), weight));
    let tangent_of = |p: &SplinePoint, fallback: DVec3| p.d1.truncate().try_normalize().unwrap_or(fallback);
    // Where the segment before ends: straight segments do not go on as they began.
    let mut here = if start == 0 { chain.at(0, 0.0) } else { chain.at(start - 1, 1.0) };
    let mut tangent = tangent_of(&here, DVec3::X);
    // Any rule will do for where the turning starts; this one is easy to reproduce: +z, laid across the yarn.
    let across = |axis: DVec3| (axis - axis.dot(tangent) * tangent).try_normalize();
    let mut normal = if tangent.z.abs() < 0.999 { across(DVec3::Z) } else { across(DVec3::X) }.unwrap_or(DVec3::Y);
    let mut turned = 0.0;
    let (mut fold, mut tight): (f64, Option<(usize, f64)>) = (0.0, None);
    let mut knots = Vec::with_capacity(end - start + 1);
    knots.push(Knot { tangent, normal, turned });
    for segment in start..end {
        let points = chain.points_of(segment);
        for (weights, weight) in &nodes {
            let next = weights.evaluate(points);
            let velocity = next.d1.truncate();
            let speed = velocity.length();
            let next_tangent = velocity.try_normalize().unwrap_or(tangent);
            normal = double_reflection(here.at.truncate(), tangent, next.at.truncate(), next_tangent, normal);
            turned += weight * ply_rate * speed / next.at.w.max(1e-300);
            // The inner side of a step is as much shorter than its middle as the step turns, times the radius; what is
            // less than nothing runs backwards. Angles and lengths stay finite where curvature does not.
            let distance = next.at.truncate().distance(here.at.truncate());
            let forward = distance / (0.5 * (here.at.w + next.at.w)).max(1e-300);
            // An angle is at most pi / 2 times its chord.
            if fold > 0.0 || FRAC_PI_2 * tangent.distance(next_tangent) > forward {
                fold = (fold + tangent.angle_between(next_tangent) - forward).max(0.0);
                if fold > SEEN_FOLD && tight.is_none_or(|(_, worst)| fold > worst) {
                    tight = Some((segment, fold));
                }
            }
            (here, tangent) = (next, next_tangent);
        }
        // Rounding must not accumulate over thousands of segments.
        normal = (normal - normal.dot(tangent) * tangent).try_normalize().unwrap_or(normal);
        knots.push(Knot { tangent, normal, turned });
    }
    (knots, tight)
}

/// Carries `normal` from one point of a curve to the next without turning it about the tangent.
fn double_reflection(from: DVec3, tangent: DVec3, to: DVec3, next_tangent: DVec3, normal: DVec3) -> DVec3 {
    let reflect = |v: DVec3, plane: DVec3, square: f64| v - 2.0 / square * plane.dot(v) * plane;
    let step = to - from;
    let c1 = step.length_squared();
    if c1 == 0.0 {
        return normal;
    }
    let (n, t) = (reflect(normal, step, c1), reflect(tangent, step, c1));
    let turn = next_tangent - t;
    let c2 = turn.length_squared();
    if c2 > 1e-300 { reflect(n, turn, c2) } else { n }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(basis: Basis) -> StrandOptions {
        StrandOptions { basis, tolerance: 0.01, longest_segment: 1.5, ply_rate: 0.4, symmetry: TAU, phases: vec![0.7] }
    }

    fn knit_like(n: usize, closed: bool) -> Curve {
        let points = (0..n)
            .map(|i| {
                let t = TAU * i as f64 / n as f64;
                DVec3::new(10.0 * t.cos(), 10.0 * t.sin(), 2.0 * (3.0 * t).sin())
            })
            .collect();
        Curve { basis: Basis::CatmullRom, closed, points, radii: None, flattening: None }
    }

    fn strands(curve: Curve, radius: f64, options: &StrandOptions) -> Strands {
        let radii = vec![radius; curve.points.len()];
        Strands::new(&[(curve, radii)], options)
    }

    #[test]
    fn segments_take_the_material_index_nearest_to_their_middle() {
        for basis in [Basis::CatmullRom, Basis::BSpline] {
            for (closed, tolerance) in [(false, 0.01), (true, 0.01), (false, 0.0), (true, 0.0)] {
                let curve = Curve { basis, ..knit_like(400, closed) };
                // Three from point to point.
                let count = if closed { 1200 } else { 1198 };
                let material_indices: Vec<u16> = (0..count).map(|i| u16::from((300..750).contains(&i))).collect();
                let of = StrandOptions { tolerance, ..options(basis) };
                let s = Strands::with(
                    &[(curve.clone(), vec![0.5; 400])],
                    Along { material_indices: &[material_indices], ..Along::default() },
                    StrandMotion::default(),
                    &of,
                );
                for segment in 0..s.segments().len() as u32 {
                    let at = s.frame(segment, 0.5).centre.as_dvec3();
                    let angle = at.y.atan2(at.x).rem_euclid(TAU) / TAU * 400.0;
                    // Not where one changes into the other.
                    if [0.0, 100.0, 250.0, 400.0].iter().all(|edge: &f64| (angle - edge).abs() > 3.0) {
                        let want = u16::from((100.0..250.0).contains(&angle));
                        assert_eq!(s.material_index(segment), Some(want), "{basis:?} {closed} {tolerance}: at {angle}");
                    }
                }
                assert_eq!(strands(curve, 0.5, &of).material_index(0), None);
            }
        }
    }

    #[test]
    fn resampling_keeps_the_curve_within_its_tolerance_with_fewer_points() {
        for basis in [Basis::CatmullRom, Basis::BSpline] {
            for closed in [true, false] {
                let curve = knit_like(400, closed);
                let s = strands(curve.clone(), 0.5, &options(basis));
                assert!(s.segments().len() < 260, "{basis:?} {closed}: {} segments", s.segments().len());
                let worst = curve
                    .points
                    .iter()
                    .map(|p| {
                        (0..s.segments().len() as u32)
                            .flat_map(|i| (0..=8).map(move |k| (i, k as f32 / 8.0)))
                            .map(|(i, u)| {
                                let place = s.frame(i, u);
                                let off = p.as_vec3a() - place.centre;
                                (off - off.dot(place.tangent) * place.tangent).length()
                                    + if off.length() > 1.0 { 9.0 } else { 0.0 }
                            })
                            .fold(f32::MAX, f32::min)
                    })
                    .fold(0.0, f32::max);
                assert!(worst < 0.011 * 0.5, "{basis:?} closed {closed}: {worst}");
            }
        }
    }

    #[test]
    fn frames_are_continuous_across_segments_and_seams() {
        for basis in [Basis::CatmullRom, Basis::BSpline] {
            let s = strands(knit_like(200, true), 0.5, &options(basis));
            let last = s.segments().len() as u32 - 1;
            for i in 0..=last {
                let next = if i == last { 0 } else { i + 1 };
                let (a, b) = (s.frame(i, 1.0), s.frame(next, 0.0));
                assert!((a.centre - b.centre).length() < 1e-4);
                let ply = |p: &YarnFrame| {
                    let across = p.tangent.cross(p.normal);
                    p.normal * p.phase.cos() + across * p.phase.sin()
                };
                assert!((ply(&a) - ply(&b)).length() < 3e-3, "segment {i} of {last}: {} {}", ply(&a), ply(&b));
            }
        }
    }

    #[test]
    fn a_flattened_section_keeps_its_axes_wherever_points_are_put() {
        for (basis, closed) in [(Basis::CatmullRom, true), (Basis::CatmullRom, false), (Basis::BSpline, true)] {
            // The short axis across the plane in which the curve mostly lies, turned by up to half a radian, with signs that
            // say nothing.
            let curve = knit_like(200, closed);
            let short = |p: &DVec3| {
                let angle = p.y.atan2(p.x);
                let outward = DVec3::new(p.x, p.y, 0.0).normalize();
                let tilt = 0.5 * (2.0 * angle).sin();
                (DVec3::Z * tilt.cos() + outward * tilt.sin(), 0.6 + 0.2 * angle.cos())
            };
            let vectors = curve.points.iter().enumerate().map(|(i, p)| {
                let (axis, ratio) = short(p);
                axis * if i % 3 == 0 { -ratio } else { ratio }
            });
            let flattening = Some(vectors.collect());
            let round = strands(curve.clone(), 0.5, &options(basis));
            let pose = vec![curve.points.iter().map(|p| *p + DVec3::X).collect()];
            let radii = vec![0.5; curve.points.len()];
            let movement = StrandMotion { later: &[pose], ..StrandMotion::default() };
            let s = Strands::moving(&[(Curve { flattening, ..curve }, radii)], movement, &options(basis));
            assert!(s.flattened() && !round.flattened() && round.mean_flattening() == 1.0);
            assert_eq!(s.segments().len(), round.segments().len());
            for i in 0..s.segments().len() as u32 {
                for (u, time) in [(0.0, 0.0), (0.3, 0.5), (0.5, 1.0), (1.0, 0.0)] {
                    let place = s.frame_at(i, u, time);
                    let centre = place.centre - Vec3A::X * time;
                    let (axis, ratio) = short(&centre.as_dvec3());
                    let axis = axis - axis.dot(place.tangent.as_dvec3()) * place.tangent.as_dvec3();
                    let found = (place.flattening.length(), place.point(place.flattening.normalize()) - place.centre);
                    assert!((f64::from(found.0) - ratio).abs() < 0.01, "{basis:?} {i} {u}: {} {ratio}", found.0);
                    let cos = found.1.normalize().as_dvec3().dot(axis.normalize()).abs();
                    assert!(cos > 0.998, "{basis:?} closed {closed} {i} {u}: {cos}");
                    assert!((f64::from(found.1.length()) / 0.5 - ratio).abs() < 0.01, "pressed along its axis");
                }
            }
        }
    }

    #[test]
    fn what_moves_is_between_its_poses_and_takes_its_plies_along() {
        for (basis, closed) in [(Basis::CatmullRom, true), (Basis::CatmullRom, false), (Basis::BSpline, true)] {
            let curve = knit_like(200, closed);
            let radii = vec![0.5; curve.points.len()];
            // Lifted, turned a little and stretched by a fifth along x.
            let move_by = |s: f64, p: &DVec3| {
                let turn = glam::DQuat::from_rotation_y(0.2 * s);
                turn * DVec3::new(p.x * (1.0 + 0.2 * s), p.y, p.z) + DVec3::new(0.0, 3.0 * s, 0.0)
            };
            let pose = |s: f64| -> Vec<Vec<DVec3>> { vec![curve.points.iter().map(|p| move_by(s, p)).collect()] };
            let later = [pose(0.5), pose(1.0)];
            let rest = [curve.points.clone()];
            let motion = StrandMotion { later: &later, rest: Some(&rest), ..StrandMotion::default() };
            let o = options(basis);
            let moving = Strands::moving(&[(curve.clone(), radii.clone())], motion, &o);
            let still = strands(curve.clone(), 0.5, &o);
            for i in (0..still.segments().len() as u32).step_by(7) {
                let (a, b) = (moving.frame_at(i, 0.3, 0.0), still.frame(i, 0.3));
                assert_eq!((a.centre, a.phase), (b.centre, b.phase), "it starts where it is");
                let centre = b.centre.as_dvec3();
                for s in [0.25, 0.5, 0.75, 1.0] {
                    let place = moving.frame_at(i, 0.3, s as f32);
                    let want = move_by(s, &centre).as_vec3a();
                    assert!((place.centre - want).length() < 0.03, "{basis:?} {s}: {} {want}", place.centre);
                    let turn = (place.phase - b.phase) / std::f32::consts::TAU;
                    let off = (turn - turn.round()).abs() * std::f32::consts::TAU;
                    // A closed yarn shares out how much its frame turns more or less on the way around.
                    assert!(off < if closed { 0.3 } else { 1e-5 }, "{basis:?} closed {closed} at {s}: {off}");
                }
            }
        }
    }

    #[test]
    fn a_seam_of_equal_plies_closes_on_a_part_of_a_turn() {
        let mut o = options(Basis::CatmullRom);
        o.symmetry = TAU / 3.0;
        let free = strands(knit_like(200, false), 0.5, &o).frame(0, 0.0).phase;
        let s = strands(knit_like(200, true), 0.5, &o);
        let last = s.segments().len() as u32 - 1;
        let (a, b) = (s.frame(last, 1.0), s.frame(0, 0.0));
        let across = a.tangent.cross(a.normal);
        let ply = a.normal * a.phase.cos() + across * a.phase.sin();
        let angle = ply.dot(b.tangent.cross(b.normal)).atan2(ply.dot(b.normal)) - b.phase;
        let turns = f64::from(angle) / (TAU / 3.0);
        assert!((turns - turns.round()).abs() < 2e-3, "{turns}");
        assert_eq!(free, b.phase);
    }

    #[test]
    fn the_phase_grows_with_arc_length_over_the_radius() {
        let curve = Curve {
            basis: Basis::Linear,
            closed: false,
            points: (0..50).map(|i| DVec3::new(f64::from(i) * 0.4, 0.0, 0.0)).collect(),
            radii: None,
            flattening: None,
        };
        let s = strands(curve, 0.5, &options(Basis::CatmullRom));
        let total: f32 = (0..s.segments().len()).map(|i| SegmentFrame::new(&s.frames, i).growth).sum();
        assert!((f64::from(total) - 0.4 * 49.0 * 0.4 / 0.5).abs() < 1e-3, "{total}");
        assert_eq!(s.frame(0, 0.0).phase, 0.7);
        assert!((s.frame(3, 0.3).normal - Vec3A::Z).length() < 1e-6, "a straight yarn carries +z along");
        assert!((s.length() - 19.6).abs() < 1e-9);
    }

    #[test]
    fn tight_bends_are_found_where_they_are() {
        let points = (0..41)
            .map(|i| {
                let x = f64::from(i) - 20.0;
                DVec3::new(x, 6.0 * (-x * x / 2.0).exp(), 0.0)
            })
            .collect();
        let curve = Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening: None };
        let s = strands(curve, 0.5, &options(Basis::CatmullRom));
        assert_eq!(s.tight_bends().len(), 1);
        let bend = s.tight_bends()[0];
        let place = s.frame(bend.segment as u32, 0.5);
        assert!(place.centre.x.abs() < 1.5 && bend.fold > 0.5 && bend.fold < 3.0, "{bend:?} at {}", place.centre);
    }

    /// Curvature of real files is without bounds: a point given twice, a step there and back.
    #[test]
    fn a_bend_without_radius_has_a_fold_of_a_number() {
        let p = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        let there_and_back = vec![p(0.0, 0.0), p(5.0, 0.0), p(10.0, 0.0), p(5.0, 1e-9), p(0.0, 0.0)];
        let twice = vec![p(0.0, 0.0), p(5.0, 0.0), p(5.0, 0.0), p(5.0, 5.0), p(5.0, 10.0)];
        let arc = (0..20).map(|i| f64::from(i) * 0.1).map(|a| p(3.0 * a.cos(), 3.0 * a.sin())).collect();
        for (points, folded) in [(there_and_back, true), (twice, false), (arc, false)] {
            let curve = Curve { basis: Basis::CatmullRom, closed: false, points, radii: None, flattening: None };
            let s = strands(curve, 0.5, &options(Basis::CatmullRom));
            assert_eq!(!s.tight_bends().is_empty(), folded, "{:?}", s.tight_bends());
            // A turn back is half a turn.
            assert!(s.tight_bends().iter().all(|b| b.fold > 0.5 && b.fold < 3.2), "{:?}", s.tight_bends());
        }
    }

    #[test]
    fn degenerate_curves_do_not_break() {
        let p = |x: f64| DVec3::new(x, 0.0, 0.0);
        for (points, closed, basis) in [
            (vec![p(0.0), p(0.0)], false, Basis::CatmullRom),
            (vec![p(0.0), p(1.0)], true, Basis::CatmullRom),
            (vec![p(0.0), p(1.0)], false, Basis::BSpline),
            (vec![p(0.0), p(1.0), p(0.0)], false, Basis::CatmullRom),
            (vec![p(0.0), p(1.0), p(1.0), p(2.0)], false, Basis::Linear),
            (vec![p(0.0), p(1.0), p(0.0)], true, Basis::BSpline),
        ] {
            for target in [Basis::CatmullRom, Basis::BSpline] {
                let curve = Curve { basis, closed, points: points.clone(), radii: None, flattening: None };
                let s = strands(curve, 0.3, &options(target));
                for i in 0..s.segments().len() as u32 {
                    let place = s.frame(i, 0.5);
                    assert!(
                        place.centre.is_finite() && place.normal.is_finite() && place.phase.is_finite(),
                        "{points:?}"
                    );
                }
            }
        }
        assert_eq!(Strands::new(Vec::new(), &options(Basis::CatmullRom)).yarns(), 0);
    }
}
