//! How far flattened yarns run into each other: points of each yarn's surface, looked for inside the others.

use glam::DVec3;
use rayon::prelude::*;
use rstar::{AABB, RTree, primitives::GeomWithData, primitives::Rectangle};

/// A cross-section: an ellipse about a yarn's centre.
#[derive(Clone, Copy, Debug)]
pub(super) struct Section {
    /// Centre.
    pub(super) at: DVec3,
    /// Unit vector along the yarn.
    pub(super) tangent: DVec3,
    /// Unit vector along the minor axis.
    pub(super) minor: DVec3,
    /// Half width and half height.
    pub(super) axes: [f64; 2],
}

/// Points around a section.
const AROUND: usize = 16;
/// Most sections whose surface is looked at: of larger cloth, each of so many.
const MOST: usize = 1 << 15;

/// The box about what lies from one section of a yarn to the next, and of which yarn that is.
type Piece<'a> = GeomWithData<Rectangle<[f64; 3]>, (usize, &'a [Section])>;

/// The box about some sections, whichever way they lie.
fn around(sections: &[Section]) -> AABB<[f64; 3]> {
    // How far a surface may be from its middle line.
    let widest = sections.iter().fold(0.0f64, |w, s| w.max(s.axes[0]).max(s.axes[1]));
    let low = sections.iter().fold(DVec3::INFINITY, |m, s| m.min(s.at)) - widest;
    let high = sections.iter().fold(DVec3::NEG_INFINITY, |m, s| m.max(s.at)) + widest;
    AABB::from_corners(low.to_array(), high.to_array())
}

/// The deepest point of any yarn inside another, as a length, and the share of surface points deeper than `tolerated`.
/// Yarns are chains of sections.
pub(super) fn intrusion(yarns: &[Vec<Section>], tolerated: f64) -> (f64, f64) {
    let pieces = yarns.iter().enumerate().flat_map(|(yarn, sections)| {
        sections.windows(2).map(move |ends| Piece::new(around(ends).into(), (yarn, ends)))
    });
    let tree = RTree::bulk_load(pieces.collect());
    let all: Vec<(usize, &Section)> = (0..).zip(yarns).flat_map(|(yarn, s)| s.iter().map(move |s| (yarn, s))).collect();
    let some: Vec<(usize, &Section)> = all.iter().copied().step_by(all.len().div_ceil(MOST).max(1)).collect();
    let of = |&(yarn, section): &(usize, &Section)| {
        let near: Vec<&[Section]> = tree
            .locate_in_envelope_intersecting(&around(std::slice::from_ref(section)))
            .filter(|piece| piece.data.0 != yarn)
            .map(|piece| piece.data.1)
            .collect();
        let major = section.tangent.cross(section.minor);
        let depth = |k: usize| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / AROUND as f64).sin_cos();
            let point = section.at + major * (cos * section.axes[0]) + section.minor * (sin * section.axes[1]);
            near.iter().map(|ends| depth_in(ends, point)).fold(0.0, f64::max)
        };
        (0..AROUND).map(depth).fold((0.0f64, 0usize), |(deepest, deep), depth| {
            (deepest.max(depth), deep + usize::from(depth > tolerated))
        })
    };
    // The same of any number of threads: neither the greatest nor a count depends on the order.
    let (deepest, deep) = some.par_iter().map(of).reduce(|| (0.0, 0), |a, b| (a.0.max(b.0), a.1 + b.1));
    (deepest, deep as f64 / (some.len() * AROUND).max(1) as f64)
}

/// How deep a point is inside a yarn.
fn depth_in(yarn: &[Section], point: DVec3) -> f64 {
    let mut best = 0.0f64;
    for pair in yarn.windows(2) {
        let (a, b) = (&pair[0], &pair[1]);
        let way = b.at - a.at;
        let s = ((point - a.at).dot(way) / way.length_squared().max(1e-30)).clamp(0.0, 1.0);
        let off = point - (a.at + s * way);
        let axes = [0, 1].map(|c| a.axes[c] + s * (b.axes[c] - a.axes[c]));
        if off.length_squared() >= axes[0].max(axes[1]).powi(2) {
            continue;
        }
        let tangent = a.tangent.lerp(b.tangent, s).normalize_or(a.tangent);
        let minor = a.minor.lerp(b.minor, s);
        let minor = (minor - minor.dot(tangent) * tangent).normalize_or(a.minor);
        // What lies along the yarn is no distance from its axis but at its ends.
        let (p, q) = (off.dot(tangent.cross(minor)), off.dot(minor));
        let root = ((p / axes[0]).powi(2) + (q / axes[1]).powi(2)).sqrt();
        if root < 1.0 {
            // To first order the distance to the surface; near the axis that breaks down, and less than half of the thinner
            // half axis is never right.
            let slope = 2.0 * (p / (axes[0] * axes[0])).hypot(q / (axes[1] * axes[1]));
            best = best.max(((1.0 - root * root) / slope.max(1e-12)).min(axes[0].min(axes[1])));
        }
    }
    best
}
