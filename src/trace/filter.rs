//! What Embree asks during traversal.

use glam::Vec3A;

use super::{CurveGeometry, YarnGeometry, section_at};
use crate::{
    ffi::embree::{HitFilter, RawHit},
    geometry::{
        ray::{Ray, YarnPlace},
        section::{Crossings, Section},
        walk::{LEAST_STRAIGHTNESS, Walker},
    },
};

/// Below this a shadow ray counts as blocked.
const OPAQUE: f32 = 1e-3;

/// How many segments from an end a ray leaves a yarn at the most that came in through it.
const NEAR_AN_END: usize = 4;

/// The longest chord of a tube times the slope at which a ray leaves it, in yarn radii: 2 if it is straight.
const LONGEST_CHORD: f32 = 3.0;
/// A step along the yarn below which a place counts as abreast of a point, in yarn radii.
const ABREAST: f32 = 0.01;
/// How far along the yarn a ray may be from where it was scattered, and still be within the same stretch of it, in yarn radii.
const OWN: f32 = 8.0;

/// Whether a hit is where the ray leaves a yarn.
#[inline]
fn leaves(ray: &Ray, hit: &RawHit) -> bool {
    hit.normal.dot(ray.direction) > 0.0
}

/// A yarn where a ray meets it.
#[derive(Clone, Copy)]
pub(super) struct Met<'a> {
    /// Where: the distance is that of the tube, or, for a ray that starts within it, that of the first ply.
    pub(super) hit: RawHit,
    pub(super) section: Section<'a>,
    /// How far it is to the first ply, about: infinite unless it was asked.
    first_ply: f32,
}

impl<'a> Met<'a> {
    /// At one of Embree's hits: where the ray enters the yarn, or comes in through its flat end, or starts within its tube with
    /// plies still ahead. Embree's tubes are open, and offer the inside of the far wall alone to the latter two. `None` where the
    /// ray only leaves the yarn.
    #[inline]
    fn at(yarns: &'a YarnGeometry, ray: &Ray, hit: &RawHit) -> Option<Self> {
        if !leaves(ray, hit) {
            return Some(Self::entering(yarns, ray, *hit));
        }
        let end = [false, true].into_iter().find_map(|forward| through_end(yarns, ray, hit, forward));
        end.map(|end| Self::entering(yarns, ray, end)).or_else(|| Self::within(yarns, ray, hit))
    }

    #[inline]
    fn entering(yarns: &'a YarnGeometry, ray: &Ray, hit: RawHit) -> Self {
        Self { hit, section: section_at(yarns, ray, &hit), first_ply: f32::INFINITY }
    }

    /// From the start of a ray within the yarn's tube, unless the ray is done with that.
    fn within(yarns: &'a YarnGeometry, ray: &Ray, leaving: &RawHit) -> Option<Self> {
        let place = |segment| YarnPlace { geometry: leaving.geometry, segment };
        if ray.done.holds(place(leaving.segment), 3) {
            return None;
        }
        let slope = leaving.normal.normalize_or_zero().dot(ray.direction);
        if leaving.t * slope > LONGEST_CHORD * yarns.strands.radius_about(leaving.segment) {
            return None;
        }
        let (mut walker, mut abreast) = Walker::new(&yarns.strands, leaving.segment, leaving.u, ray.time);
        for _ in 0..4 {
            let off = ray.origin - abreast.centre;
            let along = off.dot(abreast.tangent) / abreast.radius;
            if along.abs() < ABREAST {
                break;
            }
            let straightness = (1.0 - off.dot(abreast.curvature)).max(LEAST_STRAIGHTNESS);
            abreast = walker.walk(along / straightness)?;
        }
        let own = (OWN / abreast.stride.max(1e-2)).ceil() as u32;
        let outside = (ray.origin - abreast.centre).length_squared() >= abreast.radius * abreast.radius;
        if outside || ray.done.holds(place(walker.segment()), own) {
            return None;
        }
        let hit = RawHit { t: 0.0, normal: Vec3A::ZERO, u: walker.u(), segment: walker.segment(), ..*leaving };
        let tilted = yarns.occluders.own().shape().tilted;
        let section = Section::at_start((walker, abreast), ray.origin, ray.direction, tilted);
        Some(Self { hit, section: Section { looked_at: ray.looks, ..section }, first_ply: f32::INFINITY })
    }

    /// Whether the ray starts within the yarn's tube.
    #[inline]
    fn starts(&self) -> bool {
        self.hit.normal == Vec3A::ZERO
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
    /// The hit accepted last, as Embree offered it, and the yarn there: the one that stands in the end.
    last: Option<(RawHit, Met<'a>)>,
}

impl<'a, 'r> GapFilter<'a, 'r> {
    pub(super) fn new(geometries: &'a [CurveGeometry], ray: &'r Ray) -> Self {
        Self { geometries, ray, last: None }
    }

    /// The yarn at the hit that stands: as it was when it was accepted, or made anew.
    #[inline]
    pub(super) fn met(&self, yarns: &'a YarnGeometry, hit: &RawHit) -> Met<'a> {
        match &self.last {
            Some((last, met)) if last.segment == hit.segment && last.geometry == hit.geometry && last.u == hit.u => {
                *met
            }
            _ => Met::at(yarns, self.ray, hit).unwrap_or_else(|| Met::entering(yarns, self.ray, *hit)),
        }
    }
}

impl HitFilter for GapFilter<'_, '_> {
    #[inline]
    fn accept(&mut self, hit: &RawHit) -> Option<f32> {
        // Meshes count from both sides.
        let Some(geometry) = self.geometries.get(hit.geometry as usize) else { return Some(hit.t) };
        let CurveGeometry::Yarns(yarns) = geometry else { return (!leaves(self.ray, hit)).then_some(hit.t) };
        let mut met = Met::at(yarns, self.ray, hit)?;
        let depth = met.section.meets_ply(yarns.occluder_at(hit.segment).shape())?;
        met.first_ply = met.hit.t + depth * met.section.radius;
        // Tubes overlap where yarns touch that are pressed flat: what counts is whose plies come first.
        if self.last.as_ref().is_some_and(|(_, last)| last.first_ply <= met.first_ply) {
            return None;
        }
        if met.starts() {
            met.hit.t = met.first_ply.min(hit.t);
        }
        self.last = Some((*hit, met));
        Some(met.hit.t)
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
    fn accept(&mut self, hit: &RawHit) -> Option<f32> {
        let Some(geometry) = self.geometries.get(hit.geometry as usize) else { return Some(hit.t) };
        let CurveGeometry::Yarns(yarns) = geometry else { return (!leaves(self.ray, hit)).then_some(hit.t) };
        let Met { section, .. } = Met::at(yarns, self.ray, hit)?;
        let yarn = yarns.occluder_at(hit.segment);
        section.crossings(yarn.shape(), self.crossings);
        if self.crossings.is_empty() {
            return None;
        }
        let through = yarn.transparency(self.crossings);
        if through >= OPAQUE && !self.repeated(hit, section.radius) {
            self.passed *= through;
        }
        (through.min(self.passed) < OPAQUE).then_some(hit.t)
    }
}

/// A filter that counts how often it is asked.
pub(super) struct Counting<F> {
    pub(super) filter: F,
    pub(super) calls: u32,
}

impl<F: HitFilter> HitFilter for Counting<F> {
    #[inline]
    fn accept(&mut self, hit: &RawHit) -> Option<f32> {
        self.calls += 1;
        self.filter.accept(hit)
    }
}
