//! What Embree asks during traversal.

use glam::Vec3A;

use super::{CurveGeometry, YarnGeometry, section_at};
use crate::{
    ffi::embree::{HitFilter, RawHit},
    geometry::{
        ray::{Ray, YarnPlace},
        section::{Crossings, Section},
        walk::Walker,
        yarn_frame::YarnFrame,
    },
};

/// Below this a shadow ray counts as blocked.
const OPAQUE: f32 = 1e-3;

/// How many segments from an end a ray leaves a yarn at the most that came in through it.
const NEAR_AN_END: f32 = 64.0;

/// The longest chord of a tube times the slope at which a ray leaves it, in yarn radii: 2 if it is straight.
const LONGEST_CHORD: f32 = 5.0;
/// The longest step by which a ray is followed back through a tube, in yarn radii; the longest where that leads astray in a bend of more
/// than so much of the curvature of a circle of the yarn's radius; and how many there are at the most.
const STEP: f32 = 1.0;
const SHORT_STEP: f32 = 0.25;
const SHARP: f32 = 0.4;
const MOST_STEPS: f32 = 64.0;
/// The square of how far from its axis a place still counts as within a tube while it is walked to, in yarn radii.
const ABOUT_WITHIN: f32 = 1.2;
/// A step along the yarn below which a place counts as abreast of a point, in yarn radii, and how many there are at the most.
const ABREAST: f32 = 0.01;
const MOST_CORRECTIONS: usize = 4;
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
    /// Where the ray enters the tube, or starts within it.
    pub(super) hit: RawHit,
    pub(super) section: Section<'a>,
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
        let slope = hit.normal.normalize_or_zero().dot(ray.direction);
        let count = segments_behind(yarns, hit, slope);
        let end = [false, true].into_iter().find_map(|forward| through_end(yarns, ray, hit, count, forward));
        end.map(|end| Self::entering(yarns, ray, end)).or_else(|| Self::within(yarns, ray, hit, slope))
    }

    #[inline]
    fn entering(yarns: &'a YarnGeometry, ray: &Ray, hit: RawHit) -> Self {
        Self { hit, section: section_at(yarns, ray, &hit) }
    }

    /// From the start of a ray within the yarn's tube, which it leaves at a slope, unless the ray is done with that.
    fn within(yarns: &'a YarnGeometry, ray: &Ray, leaving: &RawHit, slope: f32) -> Option<Self> {
        let strands = &yarns.strands;
        let done = |segment| {
            let own = (OWN / strands.stride_about(segment).max(1e-2)).ceil() as u32;
            ray.done.holds(YarnPlace { geometry: leaving.geometry, segment }, own)
        };
        let radius = strands.radius_about(leaving.segment);
        if leaving.t * slope > LONGEST_CHORD * radius || done(leaving.segment) {
            return None;
        }
        let at = Walker::new(strands, leaving.segment, leaving.u, ray.time);
        let back = |step: f32| walk_back(at, ray, leaving, step * radius);
        let found = match back(STEP) {
            Back::Lost => back(SHORT_STEP),
            found => found,
        };
        let Back::Abreast(walker, place) = found else { return None };
        let outside = (ray.origin - place.centre).length_squared() >= place.radius * place.radius;
        if outside || done(walker.segment()) {
            return None;
        }
        let hit = RawHit { t: 0.0, normal: Vec3A::ZERO, u: walker.u(), segment: walker.segment(), ..*leaving };
        let tilted = yarns.occluders.own().shape().tilted;
        let section = Section::at_start((walker, place), ray.origin, ray.direction, tilted);
        Some(Self { hit, section: Section { looked_at: ray.looks, ..section } })
    }
}

/// Where a ray starts along a yarn that it leaves.
enum Back<'a> {
    /// Abreast of this place.
    Abreast(Walker<'a>, YarnFrame),
    /// Outside of the tube, or beyond the yarn's end.
    Outside,
    /// Where the yarn bends sharply, steps of this length lead astray.
    Lost,
}

/// Walks back from where a ray leaves a yarn, which is within the tube all the way if it starts there, to the place abreast of its start.
fn walk_back<'a>((mut walker, mut place): (Walker<'a>, YarnFrame), ray: &Ray, leaving: &RawHit, step: f32) -> Back<'a> {
    let mut sharpest = 0.0f32;
    let steps = (leaving.t / step).ceil().clamp(1.0, MOST_STEPS);
    let mut left = steps;
    let mut corrections = 0;
    loop {
        let point = ray.origin + left / steps * leaving.t * ray.direction;
        if left < steps {
            let Some(next) = walker.walk_abreast(&place, point) else { return Back::Outside };
            place = next;
            sharpest = sharpest.max(place.curvature.length() * place.radius);
        }
        let astray = || if sharpest > SHARP { Back::Lost } else { Back::Outside };
        if place.beside(point).length_squared() > ABOUT_WITHIN * place.radius * place.radius {
            return astray();
        }
        if left > 0.0 {
            left -= 1.0;
        } else if (point - place.centre).dot(place.tangent).abs() < ABREAST * place.radius {
            return Back::Abreast(walker, place);
        } else if corrections == MOST_CORRECTIONS {
            return astray();
        } else {
            corrections += 1;
        }
    }
}

/// How many segments back a ray may have come in that leaves a yarn at a slope: the flatter, the more.
#[inline]
fn segments_behind(yarns: &YarnGeometry, leaving: &RawHit, slope: f32) -> u32 {
    let strands = &yarns.strands;
    let chord = (LONGEST_CHORD / slope).min(leaving.t / strands.radius_about(leaving.segment));
    (chord / strands.stride_about(leaving.segment)).clamp(1.0, NEAR_AN_END).ceil() as u32
}

/// Where a ray comes in through the yarn's last end, or its first, at most `count` segments from where it leaves.
fn through_end(yarns: &YarnGeometry, ray: &Ray, leaving: &RawHit, count: u32, last: bool) -> Option<RawHit> {
    let strands = &yarns.strands;
    let segment = strands.last_within(leaving.segment, last, count)?;
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

/// Lets rays through between the plies, and finds whose plies come first: tubes overlap where yarns touch that are pressed flat.
pub(super) struct GapFilter<'a, 'r> {
    geometries: &'a [CurveGeometry],
    ray: &'r Ray,
    /// How far it is to the hit that stands: in a yarn, to its first ply.
    nearest: f32,
    /// The yarn's hit accepted last, as Embree offered it, and the yarn there.
    last: Option<(RawHit, Met<'a>)>,
}

impl<'a, 'r> GapFilter<'a, 'r> {
    pub(super) fn new(geometries: &'a [CurveGeometry], ray: &'r Ray) -> Self {
        Self { geometries, ray, nearest: f32::INFINITY, last: None }
    }

    /// How far it is to what is met at the hit that stands, if one does.
    pub(super) fn nearest(&self) -> f32 {
        self.nearest
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

    /// How far it is to what is met at a hit: in a yarn, about to its first ply.
    #[inline]
    fn distance(&mut self, hit: &RawHit) -> Option<f32> {
        // Meshes count from both sides.
        let Some(geometry) = self.geometries.get(hit.geometry as usize) else { return Some(hit.t) };
        let CurveGeometry::Yarns(yarns) = geometry else { return (!leaves(self.ray, hit)).then_some(hit.t) };
        let shape = yarns.occluder_at(hit.segment).shape();
        if shape.filled && !yarns.strands.flattened() && !leaves(self.ray, hit) {
            return Some(hit.t);
        }
        let met = Met::at(yarns, self.ray, hit)?;
        let distance = met.hit.t + met.section.meets_ply(shape)? * met.section.radius;
        if distance < self.nearest {
            self.last = Some((*hit, met));
        }
        Some(distance)
    }
}

impl HitFilter for GapFilter<'_, '_> {
    #[inline]
    fn accept(&mut self, hit: &RawHit) -> Option<f32> {
        let distance = self.distance(hit)?;
        (distance < self.nearest).then(|| {
            self.nearest = distance;
            distance
        })
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
        let Met { hit, section } = Met::at(yarns, self.ray, hit)?;
        let yarn = yarns.occluder_at(hit.segment);
        section.crossings(yarn.shape(), self.crossings);
        if self.crossings.is_empty() {
            return None;
        }
        let through = yarn.transparency(self.crossings);
        if through >= OPAQUE && !self.repeated(&hit, section.radius) {
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
