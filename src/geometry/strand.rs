//! Yarn curves made ready for Embree: resampled to a tolerance, with a frame and the plies' phase at every point.
//!
//! In: curves in scene units (`f64`, already centred). Out: control points and segments in single precision, a normal
//! that does not turn about the yarn (rotation-minimising, by double reflection: Wang et al., "Computation of
//! Rotation Minimizing Frames", ACM TOG 2008), and the phase of the plies against it, closed at seams.

use std::{f64::consts::TAU, sync::Arc};

use glam::{DVec3, DVec4, Vec3, Vec3A, Vec4};
use rayon::prelude::*;

use super::{
    curve::{Basis, Curve},
    section::Place,
    spline::{SplinePoint, evaluate, evaluate_f32},
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

/// A place where the radius exceeds the radius of curvature, so that the tube folds into itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TightBend {
    /// Which yarn.
    pub yarn: usize,
    /// Which segment of it, as resampled.
    pub segment: usize,
    /// Radius times curvature there; above 1.
    pub tightness: f64,
}

/// What is known at a control point beyond its position and radius.
#[derive(Clone, Copy, Debug)]
struct PointFrame {
    /// Rotation-minimising normal at the knot that this point stands for.
    normal: Vec3,
    /// Phase of the plies there, within a turn.
    phase: f32,
    /// By how much the phase grows along the segment that starts here.
    growth: f32,
}

/// Yarns of one kind in one geometry of Embree.
#[derive(Clone, Debug)]
pub struct Strands {
    basis: Basis,
    points: Arc<[Vec4]>,
    segments: Arc<[u32]>,
    frames: Vec<PointFrame>,
    /// The first segment of each yarn, and the number of all segments at the end.
    first_segments: Vec<u32>,
    tight_bends: Vec<TightBend>,
    length: f64,
}

/// One yarn before it joins the others.
struct Strand {
    points: Vec<Vec4>,
    frames: Vec<PointFrame>,
    tight: Option<(usize, f64)>,
    length: f64,
}

impl Strands {
    /// Prepares `curves`, each with its radii in the same unit; yarns are independent and made in parallel.
    pub fn new(curves: &[(Curve, Vec<f64>)], options: &StrandOptions) -> Self {
        let made: Vec<Strand> = curves
            .par_iter()
            .enumerate()
            .map(|(yarn, (curve, radii))| {
                let phase = if options.phases.is_empty() { 0.0 } else { options.phases[yarn % options.phases.len()] };
                Strand::new(curve, radii, options, phase)
            })
            .collect();
        let mut strands = Self {
            basis: options.basis,
            points: Arc::new([]),
            segments: Arc::new([]),
            frames: Vec::with_capacity(made.iter().map(|s| s.frames.len()).sum()),
            first_segments: Vec::with_capacity(made.len() + 1),
            tight_bends: Vec::new(),
            length: 0.0,
        };
        let mut segments = Vec::with_capacity(made.iter().map(|s| s.points.len().saturating_sub(3)).sum());
        let mut points = Vec::with_capacity(made.iter().map(|s| s.points.len()).sum());
        for (yarn, strand) in made.into_iter().enumerate() {
            strands.first_segments.push(segments.len() as u32);
            let first = points.len() as u32;
            segments.extend(first..first + strand.points.len().saturating_sub(3) as u32);
            points.extend(strand.points);
            strands.frames.extend(strand.frames);
            strands.length += strand.length;
            strands.tight_bends.extend(strand.tight.map(|(segment, tightness)| TightBend { yarn, segment, tightness }));
        }
        strands.first_segments.push(segments.len() as u32);
        strands.points = points.into();
        strands.segments = segments.into();
        strands
    }

    /// The basis of the control points.
    pub fn basis(&self) -> Basis {
        self.basis
    }

    /// Control points, radius in `w`.
    pub fn points(&self) -> &Arc<[Vec4]> {
        &self.points
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

    /// Bytes of points, segments and frames.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&*self.points)
            + size_of_val(&*self.segments)
            + size_of_val(&*self.frames)
            + size_of_val(&*self.first_segments)) as u64
    }

    /// The yarn that a segment belongs to.
    pub fn yarn_of(&self, segment: u32) -> usize {
        self.first_segments.partition_point(|&first| first <= segment) - 1
    }

    /// The segments of one yarn.
    pub fn segments_of(&self, yarn: usize) -> std::ops::Range<u32> {
        self.first_segments[yarn]..self.first_segments[yarn + 1]
    }

    /// Length of one yarn in scene units, from step to step.
    pub fn length_of(&self, yarn: usize) -> f64 {
        const STEPS: u8 = 4;
        let centre = |segment, k| self.place(segment, f32::from(k) / f32::from(STEPS)).centre;
        self.segments_of(yarn)
            .flat_map(|segment| (0..STEPS).map(move |k| (segment, k)))
            .map(|(segment, k)| f64::from(centre(segment, k).distance(centre(segment, k + 1))))
            .sum()
    }

    /// Mean radius of one yarn's control points.
    pub fn mean_radius_of(&self, yarn: usize) -> f64 {
        let segments = self.segments_of(yarn);
        let n = segments.len().max(1) as f64;
        segments.map(|s| f64::from(self.points[self.segments[s as usize] as usize + 1].w)).sum::<f64>() / n
    }

    /// Lets the plies' phase follow directions given at every knot of every yarn (one more than its segments), instead of
    /// turning at an even rate.
    pub fn align(&mut self, axes: &[Vec<Vec3A>]) {
        for (yarn, axes) in axes.iter().enumerate() {
            let segments = self.segments_of(yarn);
            let Some(first) = segments.clone().next() else { continue };
            let first = self.segments[first as usize] as usize;
            let angles: Vec<f32> = (0..=segments.len())
                .map(|knot| {
                    let (segment, u) = if knot < segments.len() { (knot, 0.0) } else { (knot - 1, 1.0) };
                    let place = self.place(segments.start + segment as u32, u);
                    let axis = axes[knot];
                    axis.dot(place.tangent.cross(place.normal)).atan2(axis.dot(place.normal))
                })
                .collect();
            for (knot, &angle) in angles.iter().enumerate() {
                let next = angles.get(knot + 1).copied().unwrap_or(angle);
                let growth = next - angle;
                let frame = &mut self.frames[first + 1 + knot];
                frame.phase = angle;
                frame.growth = growth - TAU as f32 * (growth / TAU as f32).round();
            }
        }
    }

    /// Everything a ray needs to know at `u` (0 to 1) of a segment.
    #[inline]
    pub fn place(&self, segment: u32, u: f32) -> Place {
        let first = self.segments[segment as usize] as usize;
        let p: &[Vec4; 4] = self.points[first..first + 4].try_into().expect("a segment has four points");
        let (at, d1, d2) = evaluate_f32(self.basis, p, u);
        let speed_squared = d1.length_squared().max(1e-30);
        let tangent = d1 / speed_squared.sqrt();
        let curvature = (d2 - d2.dot(tangent) * tangent) / speed_squared;
        let (a, b) = (&self.frames[first + 1], &self.frames[first + 2]);
        let normal = Vec3A::from(a.normal + u * (b.normal - a.normal));
        let normal = normal - normal.dot(tangent) * tangent;
        Place {
            centre: Vec3A::from_vec4(at),
            tangent,
            curvature,
            radius: at.w,
            normal: normal / normal.length().max(1e-10),
            phase: a.phase + u * a.growth,
        }
    }
}

/// A curve as a chain of segments that can be evaluated.
pub(super) struct Chain {
    basis: Basis,
    pub(super) points: Vec<DVec4>,
}

impl Chain {
    /// Adds the points that the ends need: closed curves repeat theirs, open Catmull-Rom curves reach their end
    /// points (a mirrored point beyond), B-splines with too few points repeat their ends.
    pub(super) fn new(curve: &Curve, radii: &[f64]) -> Self {
        let mut given: Vec<DVec4> = curve.points.iter().zip(radii).map(|(p, &r)| p.extend(r)).collect();
        // Only repeated B-spline points mean something; elsewhere they make segments without a direction.
        if curve.basis != Basis::BSpline {
            given.dedup_by(|a, b| a.truncate() == b.truncate());
        }
        let n = given.len();
        if n == 1 {
            let p = given[0];
            given.push(p + DVec4::new(1e-6 * p.w.max(1e-12), 0.0, 0.0, 0.0));
        }
        let n = n.max(2);
        let mut points = Vec::with_capacity(n + 3);
        if curve.closed && n >= 3 {
            points.push(given[n - 1]);
            points.extend(&given);
            points.extend([given[0], given[1]]);
        } else if curve.basis == Basis::BSpline {
            points.extend(&given);
            while points.len() < 4 {
                points.insert(0, given[0]);
                points.push(given[n - 1]);
            }
        } else {
            let beyond = |end: DVec4, next: DVec4| (2.0 * end - next).truncate().extend(end.w);
            points.push(beyond(given[0], given[1]));
            points.extend(&given);
            points.push(beyond(given[n - 1], given[n - 2]));
        }
        Self { basis: curve.basis, points }
    }

    pub(super) fn segments(&self) -> usize {
        self.points.len() - 3
    }

    pub(super) fn at(&self, segment: usize, u: f64) -> SplinePoint {
        let p = &self.points[segment..segment + 4];
        evaluate(self.basis, [p[0], p[1], p[2], p[3]], u)
    }

    /// Arc length at `steps` points of each segment, from the chain's start.
    fn lengths(&self, steps: usize) -> Vec<f64> {
        let mut lengths = Vec::with_capacity(self.segments() * steps + 1);
        lengths.push(0.0);
        let mut sum = 0.0;
        for segment in 0..self.segments() {
            for step in 0..steps {
                // Two-point Gauss quadrature of the speed.
                let h = 1.0 / steps as f64;
                let at = |x: f64| self.at(segment, (step as f64 + x) * h).d1.truncate().length();
                sum += 0.5 * h * (at(0.211_324_865_405_187_1) + at(0.788_675_134_594_812_9));
                lengths.push(sum);
            }
        }
        lengths
    }
}

/// Steps per given segment at which arc length is known.
const LENGTH_STEPS: usize = 8;
/// Steps per resampled segment along which frames are carried.
const FRAME_STEPS: usize = 16;

impl Strand {
    fn new(curve: &Curve, radii: &[f64], options: &StrandOptions, phase: f64) -> Self {
        let chain = Chain::new(curve, radii);
        let lengths = chain.lengths(LENGTH_STEPS);
        let total = lengths[lengths.len() - 1];
        let mean_radius = radii.iter().sum::<f64>() / radii.len().max(1) as f64;
        let kept = options.tolerance <= 0.0 && chain.basis == options.basis;
        let resampled = if kept || total <= 0.0 || total.is_nan() {
            Chain { basis: if kept { options.basis } else { Basis::CatmullRom }, points: chain.points }
        } else {
            resample(&chain, &lengths, curve.closed && curve.points.len() >= 3, mean_radius, options)
        };
        Self::with_frames(&resampled, curve.closed, options, phase, total)
    }

    /// Carries the normal along the chain and integrates the phase of the plies.
    fn with_frames(chain: &Chain, closed: bool, options: &StrandOptions, phase: f64, length: f64) -> Self {
        let segments = chain.segments();
        let tangent_of = |p: &SplinePoint, fallback: DVec3| p.d1.truncate().try_normalize().unwrap_or(fallback);
        let mut here = chain.at(0, 0.0);
        let mut tangent = tangent_of(&here, DVec3::X);
        // Any rule will do for where the turning starts; this one is easy to reproduce: +z, laid across the yarn.
        let across = |axis: DVec3| (axis - axis.dot(tangent) * tangent).try_normalize();
        let mut normal = if tangent.z.abs() < 0.999 { across(DVec3::Z) } else { across(DVec3::X) }.unwrap_or(DVec3::Y);
        let start = normal;
        let mut knots = Vec::with_capacity(segments + 1);
        let mut turned = 0.0;
        let mut tight: Option<(usize, f64)> = None;
        knots.push((normal, turned));
        for segment in 0..segments {
            for step in 1..=FRAME_STEPS {
                let next = chain.at(segment, step as f64 / FRAME_STEPS as f64);
                let next_tangent = tangent_of(&next, tangent);
                normal = double_reflection(here.at.truncate(), tangent, next.at.truncate(), next_tangent, normal);
                let distance = next.at.truncate().distance(here.at.truncate());
                let radius = (0.5 * (here.at.w + next.at.w)).max(1e-300);
                turned += options.ply_rate * distance / radius;
                let speed = next.d1.truncate().length();
                if speed > 0.0 {
                    let curvature = next.d1.truncate().cross(next.d2.truncate()).length() / (speed * speed * speed);
                    let tightness = curvature * next.at.w;
                    if tightness > 1.0 && tight.is_none_or(|(_, worst)| tightness > worst) {
                        tight = Some((segment, tightness));
                    }
                }
                (here, tangent) = (next, next_tangent);
            }
            knots.push((normal, turned));
        }
        if closed {
            // The frame comes back turned by some angle; spread what is missing to a full symmetry over the yarn.
            let angle = tangent.dot(start.cross(normal)).atan2(start.dot(normal));
            let residual = angle + turned;
            let missing = residual - options.symmetry * (residual / options.symmetry).round();
            for (i, knot) in knots.iter_mut().enumerate() {
                knot.1 -= missing * i as f64 / segments as f64;
            }
        }
        // Knot i is where segment i starts: the second of its four points.
        let frame = |i: usize| {
            let (normal, angle) = knots[i.min(segments)];
            let growth = knots[(i + 1).min(segments)].1 - angle;
            let wrapped = phase + angle;
            let wrapped = wrapped - TAU * (wrapped / TAU).round();
            PointFrame { normal: normal.as_vec3(), phase: wrapped as f32, growth: growth as f32 }
        };
        let mut frames = Vec::with_capacity(segments + 3);
        frames.push(frame(0));
        frames.extend((0..=segments).map(frame));
        frames.push(frame(segments));
        Self { points: chain.points.iter().map(|p| p.as_vec4()).collect(), frames, tight, length }
    }
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
    let carried = if c2 > 1e-300 { reflect(n, turn, c2) } else { n };
    // Rounding must not accumulate over thousands of segments.
    (carried - carried.dot(next_tangent) * next_tangent).try_normalize().unwrap_or(normal)
}

/// Knots at equal arc length, as few as keep the new curve within the tolerance of the old one.
fn resample(chain: &Chain, lengths: &[f64], closed: bool, radius: f64, options: &StrandOptions) -> Chain {
    let total = lengths[lengths.len() - 1];
    let point_at = |s: f64| {
        let i = lengths.partition_point(|&l| l <= s).clamp(1, lengths.len() - 1) - 1;
        let span = lengths[i + 1] - lengths[i];
        let t = if span > 0.0 { ((s - lengths[i]) / span).clamp(0.0, 1.0) } else { 0.0 };
        let place = i as f64 + t;
        let segment = ((place / LENGTH_STEPS as f64) as usize).min(chain.segments() - 1);
        chain.at(segment, place / LENGTH_STEPS as f64 - segment as f64)
    };
    let longest = (options.longest_segment * radius).max(total * 1e-7);
    let fewest = if closed { 4 } else { 1 };
    let mut count = ((total / longest).ceil() as usize).max(fewest);
    // With as many points as were given, those given are exact; another basis may need some more.
    let exact = chain.basis == options.basis;
    let most = if exact { chain.segments() } else { 2 * chain.segments() }.max(fewest);
    count = count.min(most);
    loop {
        let knots: Vec<DVec4> = (0..=count).map(|i| point_at(total * i as f64 / count as f64).at).collect();
        let made = interpolate(&knots, closed, options.basis);
        let allowed = options.tolerance * radius;
        let worst = (0..count)
            .flat_map(|i| [0.25, 0.5, 0.75].map(|u| (i, u)))
            .map(|(i, u)| {
                let want = point_at(total * (i as f64 + u) / count as f64);
                let off = made.at(i, u).at.truncate() - want.at.truncate();
                // A shift along the yarn is no error of its shape.
                let t = want.d1.truncate().try_normalize().unwrap_or(DVec3::ZERO);
                (off - off.dot(t) * t).length()
            })
            .fold(0.0, f64::max);
        if worst <= allowed || (count >= most && !exact) {
            return made;
        }
        if count >= most {
            return Chain { basis: chain.basis, points: chain.points.clone() };
        }
        // The error of a cubic falls with the third power of the spacing at least.
        let grow = (worst / allowed).powf(1.0 / 3.0).clamp(1.1, 2.0);
        count = ((count as f64 * grow).ceil() as usize).min(most);
    }
}

/// A chain through `knots` in the wanted basis; for closed curves the last knot is the first again.
fn interpolate(knots: &[DVec4], closed: bool, basis: Basis) -> Chain {
    let n = knots.len();
    let curve = |points: Vec<DVec4>| Curve {
        basis,
        closed,
        points: points.iter().map(|p| p.truncate()).collect(),
        radii: None,
    };
    let distinct = if closed { &knots[..n - 1] } else { knots };
    let radii: Vec<f64> = distinct.iter().map(|p| p.w).collect();
    if basis != Basis::BSpline {
        return Chain::new(&curve(distinct.to_vec()), &radii);
    }
    // Control points c with (c[i-1] + 4 c[i] + c[i+1]) / 6 = knot i. The matrix is dominated by its diagonal, so
    // Gauss-Seidel gains a digit in two rounds.
    let m = distinct.len();
    let mut c = distinct.to_vec();
    let mirrored = |c: &[DVec4], i: isize| -> DVec4 {
        if closed {
            c[i.rem_euclid(m as isize) as usize]
        } else if i < 0 {
            2.0 * c[0] - c[1]
        } else if i >= m as isize {
            2.0 * c[m - 1] - c[m - 2]
        } else {
            c[i as usize]
        }
    };
    for _ in 0..24 {
        for i in 0..m {
            let (a, b) = (mirrored(&c, i as isize - 1), mirrored(&c, i as isize + 1));
            c[i] = if !closed && (i == 0 || i == m - 1) { distinct[i] } else { (6.0 * distinct[i] - a - b) / 4.0 };
        }
    }
    let mut points = Vec::with_capacity(m + 3);
    points.push(mirrored(&c, -1));
    points.extend(&c);
    points.push(mirrored(&c, m as isize));
    if closed {
        points.push(mirrored(&c, m as isize + 1));
    }
    for p in &mut points {
        p.w = p.w.max(0.0);
    }
    Chain { basis, points }
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
        Curve { basis: Basis::CatmullRom, closed, points, radii: None }
    }

    fn strands(curve: Curve, radius: f64, options: &StrandOptions) -> Strands {
        let radii = vec![radius; curve.points.len()];
        Strands::new(&[(curve, radii)], options)
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
                                let place = s.place(i, u);
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
                let (a, b) = (s.place(i, 1.0), s.place(next, 0.0));
                assert!((a.centre - b.centre).length() < 1e-4);
                let ply = |p: &Place| {
                    let across = p.tangent.cross(p.normal);
                    p.normal * p.phase.cos() + across * p.phase.sin()
                };
                assert!((ply(&a) - ply(&b)).length() < 3e-3, "segment {i} of {last}: {} {}", ply(&a), ply(&b));
            }
        }
    }

    #[test]
    fn a_seam_of_equal_plies_closes_on_a_part_of_a_turn() {
        let mut o = options(Basis::CatmullRom);
        o.symmetry = TAU / 3.0;
        let free = strands(knit_like(200, false), 0.5, &o).place(0, 0.0).phase;
        let s = strands(knit_like(200, true), 0.5, &o);
        let last = s.segments().len() as u32 - 1;
        let (a, b) = (s.place(last, 1.0), s.place(0, 0.0));
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
        };
        let s = strands(curve, 0.5, &options(Basis::CatmullRom));
        let total: f32 = (0..s.segments().len()).map(|i| s.frames[i + 1].growth).sum();
        assert!((f64::from(total) - 0.4 * 49.0 * 0.4 / 0.5).abs() < 1e-3, "{total}");
        assert_eq!(s.place(0, 0.0).phase, 0.7);
        assert!((s.place(3, 0.3).normal - Vec3A::Z).length() < 1e-6, "a straight yarn carries +z along");
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
        let curve = Curve { basis: Basis::CatmullRom, closed: false, points, radii: None };
        let s = strands(curve, 0.5, &options(Basis::CatmullRom));
        assert_eq!(s.tight_bends().len(), 1);
        let bend = s.tight_bends()[0];
        let place = s.place(bend.segment as u32, 0.5);
        assert!(place.centre.x.abs() < 1.5 && bend.tightness > 1.0, "{bend:?} at {}", place.centre);
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
                let curve = Curve { basis, closed, points: points.clone(), radii: None };
                let s = strands(curve, 0.3, &options(target));
                for i in 0..s.segments().len() as u32 {
                    let place = s.place(i, 0.5);
                    assert!(
                        place.centre.is_finite() && place.normal.is_finite() && place.phase.is_finite(),
                        "{points:?}"
                    );
                }
            }
        }
        assert_eq!(Strands::new(&[], &options(Basis::CatmullRom)).yarns(), 0);
    }
}
