//! What Embree asks during traversal.

use super::{CurveGeometry, YarnGeometry, section_at};
use crate::{
    ffi::embree::{HitFilter, RawHit},
    geometry::{
        ray::Ray,
        section::{Crossings, Section},
    },
};

/// Below this a shadow ray counts as blocked.
const OPAQUE: f32 = 1e-3;

/// How many segments from an end a ray leaves a yarn at the most that came in through it.
const NEAR_AN_END: usize = 4;

/// Whether a hit is where the ray leaves a yarn.
#[inline]
fn leaves(ray: &Ray, hit: &RawHit) -> bool {
    hit.normal.dot(ray.direction) > 0.0
}

/// Where a ray that hits a yarn enters it: there, or, if it leaves there, at the flat end through which it came. Embree's tubes
/// are open, and offer the inside of the far wall alone. `None` if the ray started within the yarn.
#[inline]
pub(super) fn entry(yarns: &YarnGeometry, ray: &Ray, hit: &RawHit) -> Option<RawHit> {
    if leaves(ray, hit) {
        [false, true].into_iter().find_map(|forward| through_end(yarns, ray, hit, forward))
    } else {
        Some(*hit)
    }
}

/// Where a ray comes in through the yarn's last end, or its first, before it leaves.
fn through_end(yarns: &YarnGeometry, ray: &Ray, leaving: &RawHit, last: bool) -> Option<RawHit> {
    let strands = &yarns.strands;
    let mut segment = leaving.segment;
    for _ in 0..NEAR_AN_END {
        match strands.neighbour(segment, last) {
            Some(next) => segment = next,
            None => break,
        }
    }
    if strands.goes_on(segment, last) {
        return None;
    }
    let u = f32::from(u8::from(last));
    let place = strands.frame_at(segment, u, ray.time);
    let outward = if last { place.tangent } else { -place.tangent };
    let slope = ray.direction.dot(outward);
    let t = (place.centre - ray.origin).dot(outward) / slope;
    let off = ray.origin + t * ray.direction - place.centre;
    (slope < 0.0 && t > ray.t_near && t < leaving.t && off.length_squared() <= place.radius * place.radius)
        .then_some(RawHit { t, normal: outward, u, segment, ..*leaving })
}

/// Lets rays through between the plies.
pub(super) struct GapFilter<'a, 'r> {
    geometries: &'a [CurveGeometry],
    ray: &'r Ray,
    /// The hit accepted last and its section: mostly the one that stands in the end.
    last: Option<(RawHit, Section<'a>)>,
}

impl<'a, 'r> GapFilter<'a, 'r> {
    pub(super) fn new(geometries: &'a [CurveGeometry], ray: &'r Ray) -> Self {
        Self { geometries, ray, last: None }
    }

    /// The section at a hit: the one made when it was accepted, or made anew.
    #[inline]
    pub(super) fn section(&self, yarns: &'a YarnGeometry, hit: &RawHit) -> Section<'a> {
        match &self.last {
            Some((last, section))
                if last.segment == hit.segment && last.geometry == hit.geometry && last.u == hit.u =>
            {
                *section
            }
            _ => section_at(yarns, self.ray, &entry(yarns, self.ray, hit).unwrap_or(*hit)),
        }
    }
}

impl HitFilter for GapFilter<'_, '_> {
    #[inline]
    fn accept(&mut self, hit: &RawHit) -> bool {
        // Meshes count from both sides.
        let Some(geometry) = self.geometries.get(hit.geometry as usize) else { return true };
        let CurveGeometry::Yarns(yarns) = geometry else { return !leaves(self.ray, hit) };
        let Some(entry) = entry(yarns, self.ray, hit) else { return false };
        let shape = yarns.occluder_at(hit.segment).shape();
        if shape.filled && !yarns.strands.flattened() {
            return true;
        }
        let section = section_at(yarns, self.ray, &entry);
        let stands = section.meets_ply(shape);
        if stands {
            self.last = Some((*hit, section));
        }
        stands
    }
}

/// Number of hits a shadow ray remembers to tell repeats.
const REMEMBERED: usize = 8;

/// Multiplies what each yarn on a shadow ray lets pass; one hit counts once, however often Embree offers it.
pub(super) struct ShadowFilter<'a> {
    geometries: &'a [CurveGeometry],
    ray: &'a Ray,
    crossings: &'a mut Crossings,
    passed: f32,
    seen: [(u32, u32, f32); REMEMBERED],
    next: usize,
}

impl<'a> ShadowFilter<'a> {
    pub(super) fn new(geometries: &'a [CurveGeometry], ray: &'a Ray, crossings: &'a mut Crossings) -> Self {
        Self { geometries, ray, crossings, passed: 1.0, seen: [(u32::MAX, 0, 0.0); REMEMBERED], next: 0 }
    }

    /// The share of light that all hits so far let pass.
    pub(super) fn passed(&self) -> f32 {
        self.passed
    }

    /// Whether this is a hit seen before: the same place, offered again or by the neighbouring segment at a joint.
    #[inline]
    fn repeated(&mut self, hit: &RawHit, radius: f32) -> bool {
        let near = 1e-3 * radius;
        let same = |&(geometry, segment, t): &(u32, u32, f32)| {
            geometry == hit.geometry && segment.abs_diff(hit.segment) <= 1 && (t - hit.t).abs() <= near
        };
        if self.seen.iter().any(same) {
            return true;
        }
        self.seen[self.next % REMEMBERED] = (hit.geometry, hit.segment, hit.t);
        self.next += 1;
        false
    }
}

impl HitFilter for ShadowFilter<'_> {
    #[inline]
    fn accept(&mut self, hit: &RawHit) -> bool {
        let Some(geometry) = self.geometries.get(hit.geometry as usize) else { return true };
        let CurveGeometry::Yarns(yarns) = geometry else { return !leaves(self.ray, hit) };
        let Some(entry) = entry(yarns, self.ray, hit) else { return false };
        let section = section_at(yarns, self.ray, &entry);
        let yarn = yarns.occluder_at(hit.segment);
        section.crossings(yarn.shape(), self.crossings);
        if self.crossings.is_empty() {
            return false;
        }
        let through = yarn.transparency(self.crossings);
        if through < OPAQUE {
            return true;
        }
        if !self.repeated(hit, section.radius) {
            self.passed *= through;
        }
        self.passed < OPAQUE
    }
}

/// A filter that counts how often it is asked.
pub(super) struct Counting<F> {
    pub(super) filter: F,
    pub(super) calls: u32,
}

impl<F: HitFilter> HitFilter for Counting<F> {
    #[inline]
    fn accept(&mut self, hit: &RawHit) -> bool {
        self.calls += 1;
        self.filter.accept(hit)
    }
}
