//! A scene that can be traced: single rays, with a filter.

use std::{
    any::Any,
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    ptr,
};

use embree4_sys as sys;
use glam::Vec3A;

use super::scene::{Buffers, Handle};

/// A ray as Embree takes it; no field may be NaN.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RawRay {
    /// Where it starts.
    pub origin: Vec3A,
    /// Where it goes, of any length: the unit of distances along the ray.
    pub direction: Vec3A,
    /// Hits nearer than this do not count.
    pub t_near: f32,
    /// Hits farther than this do not count.
    pub t_far: f32,
    /// Time from 0 to 1, at which moving geometry is met.
    pub time: f32,
}

/// A point where a ray meets the outside or the inside of a curve's tube, or a triangle from either side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RawHit {
    /// Distance along the ray in lengths of its direction.
    pub t: f32,
    /// Outward normal, not of unit length.
    pub normal: Vec3A,
    /// Position along the segment, 0 to 1; in a triangle the weight of its second corner.
    pub u: f32,
    /// In a triangle the weight of its third corner.
    pub v: f32,
    /// The index of segment or triangle within its geometry.
    pub segment: u32,
    /// The geometry, as [`SceneBuilder`](super::SceneBuilder) returned its id.
    pub geometry: u32,
}

/// Decides which hits count. Called during traversal, in any order, and possibly more than once for one hit.
pub(crate) trait HitFilter {
    /// The distance at which the hit stands; `None` lets the ray pass. Beyond the hit's own distance it leaves room for nearer
    /// hits between, but a hit stands no farther away than one that stood before, nor than the ray goes.
    fn accept(&mut self, hit: &RawHit) -> Option<f32>;
}

/// Embree's context of a query with our own fields behind it: "users can extend the context at its end".
#[repr(C)]
struct QueryContext<'f, F> {
    base: sys::RTCRayQueryContext,
    filter: &'f mut F,
    /// How far the ray goes before the hit that is asked about: Embree writes the hit's distance over it.
    t_far: f32,
    panic: Option<Box<dyn Any + Send>>,
}

impl<'f, F> QueryContext<'f, F> {
    fn new(filter: &'f mut F, t_far: f32) -> Self {
        // SAFETY: the struct is plain integers, for which all bit patterns are valid; all ones is
        // RTC_INVALID_GEOMETRY_ID, which is what rtcInitRayQueryContext writes into each of its fields.
        let base = unsafe {
            let mut base = std::mem::MaybeUninit::<sys::RTCRayQueryContext>::uninit();
            ptr::write_bytes(base.as_mut_ptr(), 0xff, 1);
            base.assume_init()
        };
        Self { base, filter, t_far, panic: None }
    }
}

unsafe extern "C" fn filter_trampoline<F: HitFilter>(args: *const sys::RTCFilterFunctionNArguments) {
    // SAFETY: Embree passes valid arguments; the context is the `QueryContext<F>` of this very query, which is
    // the only user of it, on this thread; only single rays are traced (N is 1), for which the layouts of ray
    // and hit are those of the plain structs, readable (the ray's end writable too) for the time of the call.
    unsafe {
        let args = &*args;
        debug_assert_eq!(args.N, 1, "only single-ray queries are made");
        if *args.valid == 0 {
            return;
        }
        let context = &mut *args.context.cast::<QueryContext<'_, F>>();
        let ray = &mut *args.ray.cast::<sys::RTCRay>();
        let hit = &*args.hit.cast::<sys::RTCHit>();
        let hit = RawHit {
            t: ray.tfar,
            normal: Vec3A::new(hit.Ng_x, hit.Ng_y, hit.Ng_z),
            u: hit.u,
            v: hit.v,
            segment: hit.primID,
            geometry: hit.geomID,
        };
        let filter = &mut *context.filter;
        match catch_unwind(AssertUnwindSafe(|| filter.accept(&hit))) {
            // All of a ray that a filter may change is how far it goes, and that to no more than before the hit.
            Ok(Some(t)) => {
                context.t_far = context.t_far.min(t);
                ray.tfar = context.t_far;
            }
            Ok(None) => *args.valid = 0,
            Err(payload) => context.panic = Some(payload),
        }
    }
}

/// A scene that can be traced, from any number of threads.
#[derive(Debug)]
pub(crate) struct CommittedScene {
    scene: Handle,
    _buffers: Vec<Buffers>,
}

// SAFETY: "rtcIntersect and rtcOccluded may be called concurrently" on a committed scene; nothing modifies it.
unsafe impl Send for CommittedScene {}

// SAFETY: as above.
unsafe impl Sync for CommittedScene {}

impl CommittedScene {
    /// Of a scene that has been committed, with what it reads.
    pub(super) fn new(scene: Handle, buffers: Vec<Buffers>) -> Self {
        Self { scene, _buffers: buffers }
    }

    /// The nearest hit that `filter` lets stand.
    #[inline]
    pub(crate) fn intersect<F: HitFilter>(&self, ray: &RawRay, filter: &mut F) -> Option<RawHit> {
        let mut context = QueryContext::new(filter, ray.t_far);
        let mut query = sys::RTCRayHit { ray: embree_ray(ray), hit: no_hit() };
        let mut args = sys::RTCIntersectArguments {
            flags: sys::RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER,
            feature_mask: sys::RTC_FEATURE_FLAG_ALL,
            context: ptr::from_mut(&mut context).cast(),
            filter: Some(filter_trampoline::<F>),
            intersect: None,
        };
        // SAFETY: the scene is committed; ray and context live on this stack for the time of the call, and are
        // aligned as their generated types demand.
        unsafe { sys::rtcIntersect1(self.scene.raw, &mut query, &mut args) };
        if let Some(payload) = context.panic.take() {
            resume_unwind(payload);
        }
        let hit = &query.hit;
        (hit.geomID != sys::INVALID_ID).then(|| RawHit {
            t: query.ray.tfar,
            normal: Vec3A::new(hit.Ng_x, hit.Ng_y, hit.Ng_z),
            u: hit.u,
            v: hit.v,
            segment: hit.primID,
            geometry: hit.geomID,
        })
    }

    /// Whether any hit stands that `filter` is asked about.
    #[inline]
    pub(crate) fn occluded<F: HitFilter>(&self, ray: &RawRay, filter: &mut F) -> bool {
        let mut context = QueryContext::new(filter, ray.t_far);
        let mut query = embree_ray(ray);
        let mut args = sys::RTCOccludedArguments {
            flags: sys::RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER,
            feature_mask: sys::RTC_FEATURE_FLAG_ALL,
            context: ptr::from_mut(&mut context).cast(),
            filter: Some(filter_trampoline::<F>),
            occluded: None,
        };
        // SAFETY: as in `intersect`.
        unsafe { sys::rtcOccluded1(self.scene.raw, &mut query, &mut args) };
        if let Some(payload) = context.panic.take() {
            resume_unwind(payload);
        }
        query.tfar == f32::NEG_INFINITY
    }
}

#[inline]
fn embree_ray(ray: &RawRay) -> sys::RTCRay {
    sys::RTCRay {
        org_x: ray.origin.x,
        org_y: ray.origin.y,
        org_z: ray.origin.z,
        tnear: ray.t_near,
        dir_x: ray.direction.x,
        dir_y: ray.direction.y,
        dir_z: ray.direction.z,
        time: ray.time,
        tfar: ray.t_far,
        mask: u32::MAX,
        id: 0,
        flags: 0,
    }
}

#[inline]
fn no_hit() -> sys::RTCHit {
    // SAFETY: plain integers and floats, for which zero bits are valid.
    let mut hit: sys::RTCHit = unsafe { std::mem::zeroed() };
    hit.geomID = sys::INVALID_ID;
    hit.primID = sys::INVALID_ID;
    hit.instID[0] = sys::INVALID_ID;
    hit
}
