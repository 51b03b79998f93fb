//! Strands from curves: each yarn resampled and wound by itself, then all joined one behind the other.

use std::borrow::Cow;

use glam::{DVec2, DVec3, DVec4, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::{
    Along, FLATTEST, Pose, StrandMotion, StrandOptions, Strands, TightBend,
    frames::PointFrame,
    winding::{Tight, Winding},
};
use crate::geometry::{
    chain::{Chain, Fit, nearest_indices, resample, uvs_of_segments},
    curve::{Basis, Curve},
    material_indices::MaterialIndices,
    segment_uvs::SegmentUvs,
    yarn_frame::{Pressed, ROUND},
};

/// Points of curves that are made into yarns at a time, so that what is not joined yet stays small.
const BATCH: usize = 1 << 19;

/// What [`Strands::with`] promises. Curves that are handed over are freed as yarns are made of them.
pub(super) fn strands(
    mut curves: Cow<'_, [(Curve, Vec<f64>)]>,
    along: Along<'_>,
    motion: StrandMotion<'_>,
    options: &StrandOptions,
) -> Strands {
    let make = |yarn: usize, (curve, radii): &(Curve, Vec<f64>)| {
        let given = Given {
            curve,
            radii,
            along: along.of(yarn),
            later: motion.later.iter().chain(motion.flow).map(|curves| curves[yarn].as_slice()).collect(),
            rest: motion.rest.map(|curves| curves[yarn].as_slice()),
            phase: if options.phases.is_empty() { 0.0 } else { options.phases[yarn % options.phases.len()] },
        };
        Strand::new(&given, options, yarn)
    };
    let mut joined = Joined::new(curves.len(), motion.later.len() + motion.flow.len());
    let (mut first, mut made) = (0, Vec::new());
    while first < curves.len() {
        let end = first + batch(&curves[first..]);
        // Yarns are joined one behind the other while the next ones are made.
        let join = || made.drain(..).for_each(|strand| joined.push(strand));
        let make_next = || -> Vec<Strand> {
            let yarns = first..end;
            match &mut curves {
                Cow::Owned(curves) => yarns
                    .into_par_iter()
                    .zip(&mut curves[first..end])
                    .map(|(yarn, curve)| make(yarn, &std::mem::replace(curve, (emptied(&curve.0), Vec::new()))))
                    .collect(),
                Cow::Borrowed(curves) => yarns.into_par_iter().map(|yarn| make(yarn, &curves[yarn])).collect(),
            }
        };
        ((), made) = rayon::join(join, make_next);
        first = end;
    }
    made.into_iter().for_each(|strand| joined.push(strand));
    joined.finish(options.basis, motion.flow.len(), along.blended)
}

/// What is left of a curve whose points are taken.
fn emptied(curve: &Curve) -> Curve {
    Curve { points: Vec::new(), radii: None, flattening: None, ..*curve }
}

/// How many of the next curves are made at once: at least one.
fn batch(curves: &[(Curve, Vec<f64>)]) -> usize {
    let mut points = 0;
    let fits = |(curve, _): &&(Curve, Vec<f64>)| {
        let before = points;
        points += curve.points.len();
        before < BATCH
    };
    curves.iter().take_while(fits).count()
}

/// What a yarn is made from.
struct Given<'a> {
    curve: &'a Curve,
    radii: &'a [f64],
    /// Its material indices and texture coordinates; empty where there are none.
    along: (&'a [u16], &'a [Vec2]),
    /// Its points at later times, then those that its flow goes by.
    later: Vec<&'a [DVec3]>,
    /// Its points at rest, if other than the first.
    rest: Option<&'a [DVec3]>,
    /// Phase of the plies at its start, radians.
    phase: f64,
}

/// One yarn before it joins the others.
struct Strand {
    /// Points and frames at each time.
    poses: Vec<(Vec<Vec4>, Vec<PointFrame>)>,
    /// For each point, or empty.
    flattening: Vec<Vec2>,
    /// As before.
    distances: Vec<f32>,
    material_indices: Vec<u16>,
    uvs: SegmentUvs,
    tight: Option<Tight>,
    length: f64,
}

impl Strand {
    fn new(given: &Given<'_>, options: &StrandOptions, yarn: usize) -> Self {
        let &Given { curve, radii, along: (material_indices, uvs), .. } = given;
        let uneven = options.unevenness.map(|u| u.of(yarn, curve, radii, given.rest.unwrap_or(&curve.points)));
        let (radii, pressed) = match &uneven {
            Some(uneven) => (uneven.radii.as_slice(), &uneven.flattening),
            None => (radii, &curve.flattening),
        };
        let tubes: Cow<'_, [f64]> = match options.tube {
            1.0 => radii.into(),
            tube => radii.iter().map(|radius| tube * radius).collect(),
        };
        let radii = &*tubes;
        let chain = Chain::new(curve, radii);
        let lengths = chain.lengths();
        let total = lengths[lengths.len() - 1];
        let closed = curve.closed && curve.points.len() >= 3;
        let knots = knots(&chain, &lengths, closed, radii, options);
        let material_indices = if material_indices.is_empty() {
            Vec::new()
        } else {
            nearest_indices(curve, material_indices, &chain, knots.as_deref())
        };
        let uvs =
            if uvs.is_empty() { SegmentUvs::default() } else { uvs_of_segments(curve, uvs, &chain, knots.as_deref()) };
        // The same places of the yarn at all times: points move with it.
        let resampled = |chain: Chain| match &knots {
            Some(knots) => chain.through(knots, closed, options.basis),
            None => chain,
        };
        let rest = given.rest.map(|points| resampled(Chain::at_time(curve, radii, points)));
        let poses: Vec<Chain> = std::iter::once(chain)
            .chain(given.later.iter().map(|points| Chain::at_time(curve, radii, points)))
            .map(resampled)
            .collect();
        let pressed = pressed.as_ref().map(|vectors| pressed_along(curve, vectors, knots.as_deref()));
        // Axes are those of the first pose, of which alone it is told how tightly it bends.
        let axes = |pose: usize| pressed.as_deref().filter(|_| pose == 0);
        let wound: Vec<Winding> =
            poses.iter().enumerate().map(|(i, pose)| Winding::new(pose, axes(i), options)).collect();
        let rest = rest.map(|rest| Winding::new(&rest, None, options));
        let at_rest = rest.as_ref().unwrap_or(&wound[0]);
        let frames = frames(&wound, at_rest, curve.closed, given.phase, options.symmetry);
        let distances = if options.distances { at_rest.distances() } else { Vec::new() };
        let flattening = match pressed {
            Some(pressed) => flattening_along(&pressed, &wound[0]),
            None => Vec::new(),
        };
        let points = |chain: &Chain| chain.points.iter().map(|p| p.as_vec4()).collect();
        let poses = poses.iter().map(points).zip(frames).collect();
        Self { poses, flattening, distances, material_indices, uvs, tight: wound[0].tight, length: total }
    }
}

/// Where a chain is resampled; nothing where its own points are kept.
fn knots(
    chain: &Chain,
    lengths: &[f64],
    closed: bool,
    radii: &[f64],
    options: &StrandOptions,
) -> Option<Vec<(usize, f64)>> {
    let total = lengths[lengths.len() - 1];
    let kept = options.tolerance <= 0.0 && chain.basis == options.basis;
    if kept || total <= 0.0 || total.is_nan() {
        return None;
    }
    let mean_radius = radii.iter().sum::<f64>() / radii.len().max(1) as f64;
    let fit = Fit {
        basis: options.basis,
        tolerance: options.tolerance * mean_radius,
        longest: options.longest_segment * mean_radius,
    };
    resample(chain, lengths, closed, &fit)
}

/// Frames of the control points at each time. The frame of a closed yarn comes back turned by some angle; what is missing
/// to a full `symmetry` is spread over the yarn, always the same one.
fn frames(wound: &[Winding], at_rest: &Winding, closed: bool, phase: f64, symmetry: f64) -> Vec<Vec<PointFrame>> {
    let missing = |residual: f64, from: f64| residual - symmetry * ((residual - from) / symmetry).round();
    let missing_at_rest = missing(at_rest.residual(at_rest), 0.0);
    let of = |winding: &Winding| {
        let missing = if closed { missing(winding.residual(at_rest), missing_at_rest) } else { 0.0 };
        winding.frames(at_rest, missing, phase)
    };
    wound.iter().map(of).collect()
}

/// What presses a curve flat, at each knot of the chain made from it: the direction of the short axis, with the ratio of both axes.
fn pressed_along(curve: &Curve, vectors: &[Vec3], knots: Option<&[(usize, f64)]>) -> Vec<DVec4> {
    assert_eq!(vectors.len(), curve.points.len(), "a curve is pressed flat at each of its points or at none");
    // An axis has no sign: each points to the side of the one before. Its direction and its ratio make a chain of their
    // own, which has its knots where the curve has them.
    let mut axis = DVec3::ZERO;
    let chain = Chain::of_values(curve, |i| {
        let v = vectors[i].as_dvec3().try_normalize().unwrap_or(axis);
        axis = if v.dot(axis) < 0.0 { -v } else { v };
        axis.extend(f64::from(vectors[i].length()))
    });
    let at = |(segment, u): (usize, f64)| chain.at(segment, u).at;
    match knots {
        Some(knots) => knots.iter().copied().map(at).collect(),
        None => (0..chain.segments()).map(|i| (i, 0.0)).chain([(chain.segments() - 1, 1.0)]).map(at).collect(),
    }
}

/// The same in the frame of each point of the chain: it moves with that frame.
fn flattening_along(pressed: &[DVec4], wound: &Winding) -> Vec<Vec2> {
    let mut before = DVec2::ZERO;
    // The first and the last knot stand for the points beyond them too.
    let mut made = Vec::with_capacity(pressed.len() + 2);
    made.push(ROUND);
    made.extend(pressed.iter().zip(&wound.knots).map(|(place, knot)| {
        let axis = place.truncate();
        let across = DVec2::new(axis.dot(knot.normal), axis.dot(knot.tangent.cross(knot.normal)));
        let across = across.try_normalize().unwrap_or(DVec2::X) * place.w.clamp(FLATTEST, 1.0);
        before = if across.dot(before) < 0.0 { -across } else { across };
        before.as_vec2()
    }));
    made[0] = made[1];
    made.push(made[made.len() - 1]);
    made
}

/// Yarns one behind the other.
struct Joined {
    poses: Vec<(Vec<Vec4>, Vec<PointFrame>)>,
    /// Of the points of all yarns up to the last that is pressed flat.
    flattening: Vec<Vec2>,
    distances: Vec<f32>,
    segments: Vec<u32>,
    material_indices: Vec<u16>,
    uvs: SegmentUvs,
    first_segments: Vec<u32>,
    tight_bends: Vec<TightBend>,
    length: f64,
}

impl Joined {
    fn new(yarns: usize, later: usize) -> Self {
        Self {
            poses: vec![(Vec::new(), Vec::new()); 1 + later],
            flattening: Vec::new(),
            distances: Vec::new(),
            segments: Vec::new(),
            material_indices: Vec::new(),
            uvs: SegmentUvs::default(),
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
        self.distances.extend(strand.distances);
        self.material_indices.extend(strand.material_indices);
        self.uvs.append(&strand.uvs);
        self.length += strand.length;
        let bend = |Tight { segment, fold, places }| TightBend { yarn, segment, fold, places };
        self.tight_bends.extend(strand.tight.map(bend));
    }

    fn finish(mut self, basis: Basis, flow: usize, blended: bool) -> Strands {
        self.first_segments.push(self.segments.len() as u32);
        if self.flattening.iter().all(|f| Pressed::new(*f).is_none()) {
            self.flattening = Vec::new();
        } else {
            self.flattening.resize(self.poses[0].0.len(), ROUND);
        }
        let pose = |(mut points, mut frames): (Vec<Vec4>, Vec<PointFrame>)| {
            points.shrink_to_fit();
            frames.shrink_to_fit();
            Pose { points: points.into(), frames }
        };
        self.segments.shrink_to_fit();
        self.distances.shrink_to_fit();
        self.flattening.shrink_to_fit();
        self.material_indices.shrink_to_fit();
        self.uvs.shrink_to_fit();
        self.first_segments.shrink_to_fit();
        self.tight_bends.shrink_to_fit();
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
            distances: self.distances,
            material_indices: MaterialIndices::new(self.material_indices, blended),
            first_segments: self.first_segments,
            tight_bends: self.tight_bends,
            length: self.length,
        }
    }
}
