//! A safe face of Embree 4: a device, curve geometries, one committed scene, single-ray queries with a filter.
//!
//! The types carry the manual's rules: only a [`CommittedScene`] can be traced; buffers live as long as the
//! scene that reads them; a panic in a filter is parked and resumed after Embree has returned.

use std::{
    any::Any,
    ffi::{CStr, CString},
    fmt,
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    ptr,
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
};

use embree4_sys as sys;
use glam::{Vec3A, Vec4};

/// What Embree said when a call failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EmbreeError {
    /// What was being done.
    pub during: &'static str,
    /// Embree's own words, or its error code.
    pub message: String,
}

impl fmt::Display for EmbreeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Embree failed while {}: {}", self.during, self.message)
    }
}

impl std::error::Error for EmbreeError {}

/// Bytes that Embree holds, as its memory monitor reports them.
#[derive(Debug, Default)]
pub struct MemoryCounter {
    now: AtomicI64,
    peak: AtomicI64,
}

impl MemoryCounter {
    /// Bytes held now.
    pub fn bytes(&self) -> u64 {
        self.now.load(Ordering::Relaxed).max(0).unsigned_abs()
    }

    /// The most bytes held at any time, which includes what a build needs and gives back.
    pub fn peak_bytes(&self) -> u64 {
        self.peak.load(Ordering::Relaxed).max(0).unsigned_abs()
    }
}

/// Called by Embree, on any of its threads, before it allocates and after it frees.
unsafe extern "C" fn monitor_memory(counter: *mut std::ffi::c_void, bytes: isize, _post: bool) -> bool {
    // SAFETY: the pointer is the `MemoryCounter` given at registration; `Device` keeps it alive until after
    // the device is released, and all access is atomic.
    let counter = unsafe { &*counter.cast::<MemoryCounter>() };
    let now = counter.now.fetch_add(bytes as i64, Ordering::Relaxed) + bytes as i64;
    counter.peak.fetch_max(now, Ordering::Relaxed);
    true
}

/// An Embree device and its memory counter.
#[derive(Debug)]
pub struct Device {
    handle: sys::RTCDevice,
    memory: Arc<MemoryCounter>,
}

// SAFETY: "The Embree API is thread-safe" for devices (manual, rtcNewDevice): reference counts and creation
// of objects may happen on any thread.
unsafe impl Send for Device {}
// SAFETY: as above.
unsafe impl Sync for Device {}

impl Device {
    /// Opens a device whose builds use `threads` threads.
    pub fn new(threads: usize) -> Result<Arc<Self>, EmbreeError> {
        let config = CString::new(format!("threads={threads},user_threads={threads}")).expect("digits hold no NUL");
        // SAFETY: the string outlives the call; a null result is handled below.
        let handle = unsafe { sys::rtcNewDevice(config.as_ptr()) };
        if handle.is_null() {
            return Err(last_error(ptr::null_mut(), "opening a device").unwrap_or_else(|| EmbreeError {
                during: "opening a device",
                message: "no device and no reason given".to_owned(),
            }));
        }
        let memory = Arc::new(MemoryCounter::default());
        // SAFETY: the counter is alive until `Drop` has released the device.
        unsafe {
            sys::rtcSetDeviceMemoryMonitorFunction(handle, Some(monitor_memory), Arc::as_ptr(&memory) as *mut _);
        }
        Ok(Arc::new(Self { handle, memory }))
    }

    /// What Embree holds for this device.
    pub fn memory(&self) -> &MemoryCounter {
        &self.memory
    }

    /// The version of the library in use, as `major.minor.patch`.
    pub fn version(&self) -> String {
        // SAFETY: the handle is valid until `Drop`.
        let v = unsafe { sys::rtcGetDeviceProperty(self.handle, sys::RTC_DEVICE_PROPERTY_VERSION) };
        format!("{}.{}.{}", v / 10_000, v / 100 % 100, v % 100)
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: scenes hold an `Arc` of the device, so this is the last use of the handle.
        unsafe { sys::rtcReleaseDevice(self.handle) };
    }
}

/// Reads and clears the calling thread's first error.
fn last_error(device: sys::RTCDevice, during: &'static str) -> Option<EmbreeError> {
    // SAFETY: a null device asks for the error of a failed rtcNewDevice, any other is valid.
    let code = unsafe { sys::rtcGetDeviceError(device) };
    if code == sys::RTC_ERROR_NONE {
        return None;
    }
    // SAFETY: as above; the string belongs to Embree and stays valid until the next error.
    let text = unsafe { sys::rtcGetDeviceLastErrorMessage(device) };
    let message = if text.is_null() {
        format!("error code {code}")
    } else {
        // SAFETY: Embree returns a NUL-terminated string.
        unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
    };
    Some(EmbreeError { during, message })
}

/// The basis in which Embree reads control points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveBasis {
    /// `RTC_GEOMETRY_TYPE_ROUND_CATMULL_ROM_CURVE`
    CatmullRom,
    /// `RTC_GEOMETRY_TYPE_ROUND_BSPLINE_CURVE`
    BSpline,
}

/// The trade that the BVH makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum BvhLayout {
    /// About 44 bytes per cubic segment; 3 to 10 % slower to trace.
    #[default]
    Compact,
    /// About 119 bytes per cubic segment.
    Fast,
}

/// A scene that still takes geometry.
#[derive(Debug)]
pub struct SceneBuilder {
    scene: Handle,
    buffers: Vec<Buffers>,
}

/// What Embree reads in place.
type Buffers = Box<dyn Any + Send + Sync>;

#[derive(Debug)]
struct Handle {
    raw: sys::RTCScene,
    device: Arc<Device>,
}

impl Drop for Handle {
    fn drop(&mut self) {
        // SAFETY: made by rtcNewScene, released once, before its device.
        unsafe { sys::rtcReleaseScene(self.raw) };
    }
}

impl SceneBuilder {
    /// An empty scene on `device`.
    pub fn new(device: &Arc<Device>, layout: BvhLayout) -> Result<Self, EmbreeError> {
        // SAFETY: the device is valid; a null result is handled below.
        let raw = unsafe { sys::rtcNewScene(device.handle) };
        if let Some(error) = last_error(device.handle, "making a scene") {
            return Err(error);
        }
        let mut flags = sys::RTC_SCENE_FLAG_ROBUST | sys::RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS;
        if layout == BvhLayout::Compact {
            flags |= sys::RTC_SCENE_FLAG_COMPACT;
        }
        // SAFETY: the scene is valid and not committed.
        unsafe { sys::rtcSetSceneFlags(raw, flags) };
        Ok(Self { scene: Handle { raw, device: Arc::clone(device) }, buffers: Vec::new() })
    }

    /// Adds round curves and returns their geometry id: 0, 1, 2, ... in the order of the calls.
    ///
    /// `points` are positions with the radius in `w`, at one time or at several that are evenly spaced from 0 to 1, between
    /// which all moves on straight lines; each of `segments` is the index of the first of the four
    /// control points of one cubic segment. Embree reads both in place.
    ///
    /// # Panics
    /// If a segment reaches beyond the points, or there are no points or not as many at all times.
    pub fn add_round_curves(
        &mut self,
        basis: CurveBasis,
        points: Vec<Arc<[Vec4]>>,
        segments: Arc<[u32]>,
    ) -> Result<u32, EmbreeError> {
        assert!(
            !points.is_empty() && points.iter().all(|p| p.len() == points[0].len()),
            "curves have as many control points at all times"
        );
        assert!(
            segments.iter().all(|&first| (first as usize) + 4 <= points[0].len()),
            "a curve segment reaches beyond its control points"
        );
        let kind = match basis {
            CurveBasis::CatmullRom => sys::RTC_GEOMETRY_TYPE_ROUND_CATMULL_ROM_CURVE,
            CurveBasis::BSpline => sys::RTC_GEOMETRY_TYPE_ROUND_BSPLINE_CURVE,
        };
        let count = points.len() as u32;
        let length = segments.len();
        let first_of_each = segments.as_ptr();
        let steps: Vec<(*const Vec4, usize)> = points.iter().map(|p| (p.as_ptr(), p.len())).collect();
        self.attach(kind, "adding curves", Box::new((points, segments)), |geometry| {
            // SAFETY: `attach` keeps the buffers until the scene is released; they have the stated formats and lengths,
            // and each Vec4 is 16-byte aligned and fully readable.
            unsafe {
                if count > 1 {
                    sys::rtcSetGeometryTimeStepCount(geometry, count);
                }
                for (step, (data, length)) in steps.into_iter().enumerate() {
                    sys::rtcSetSharedGeometryBuffer(
                        geometry,
                        sys::RTC_BUFFER_TYPE_VERTEX,
                        step as u32,
                        sys::RTC_FORMAT_FLOAT4,
                        data.cast(),
                        0,
                        size_of::<Vec4>(),
                        length,
                    );
                }
                sys::rtcSetSharedGeometryBuffer(
                    geometry,
                    sys::RTC_BUFFER_TYPE_INDEX,
                    0,
                    sys::RTC_FORMAT_UINT,
                    first_of_each.cast(),
                    0,
                    size_of::<u32>(),
                    length,
                );
            }
        })
    }

    /// Adds triangles, each of three indices of points, and returns their geometry id as [`Self::add_round_curves`]
    /// does. Embree reads both in place.
    ///
    /// # Panics
    /// If a triangle names a point that is not there.
    pub fn add_triangles(&mut self, points: Arc<[Vec3A]>, triangles: Arc<[[u32; 3]]>) -> Result<u32, EmbreeError> {
        assert!(
            triangles.iter().flatten().all(|&i| (i as usize) < points.len()),
            "a triangle names a point that is not there"
        );
        let (corners, corner_count) = (points.as_ptr(), points.len());
        let (indices, index_count) = (triangles.as_ptr(), triangles.len());
        let kept = Box::new((points, triangles));
        self.attach(sys::RTC_GEOMETRY_TYPE_TRIANGLE, "adding triangles", kept, |geometry| {
            // SAFETY: as for curves; a Vec3A is three floats in 16 bytes, all of which may be read.
            unsafe {
                sys::rtcSetSharedGeometryBuffer(
                    geometry,
                    sys::RTC_BUFFER_TYPE_VERTEX,
                    0,
                    sys::RTC_FORMAT_FLOAT3,
                    corners.cast(),
                    0,
                    size_of::<Vec3A>(),
                    corner_count,
                );
                sys::rtcSetSharedGeometryBuffer(
                    geometry,
                    sys::RTC_BUFFER_TYPE_INDEX,
                    0,
                    sys::RTC_FORMAT_UINT3,
                    indices.cast(),
                    0,
                    size_of::<[u32; 3]>(),
                    index_count,
                );
            }
        })
    }

    /// Makes a geometry that reads `buffers`, lets `set` describe it, and attaches it.
    ///
    /// The buffers are the scene's before Embree hears of them: whatever fails, it never holds memory that is freed. A
    /// geometry that Embree refuses is not attached; its id stays empty and the scene can be used without it.
    fn attach(
        &mut self,
        kind: sys::RTCGeometryType,
        during: &'static str,
        buffers: Buffers,
        set: impl FnOnce(sys::RTCGeometry),
    ) -> Result<u32, EmbreeError> {
        let id = self.buffers.len() as u32;
        self.buffers.push(buffers);
        let device = self.scene.device.handle;
        let failed = || last_error(device, during).map_or(Ok(()), Err);
        // SAFETY: the device is valid; without an error the geometry is.
        let geometry = unsafe { sys::rtcNewGeometry(device, kind) };
        failed()?;
        set(geometry);
        let described = failed().and_then(|()| {
            // SAFETY: the geometry is valid and its buffers live as long as the scene.
            unsafe { sys::rtcCommitGeometry(geometry) };
            failed()
        });
        let attached = described.and_then(|()| {
            // SAFETY: as above; no other geometry has this id.
            unsafe { sys::rtcAttachGeometryByID(self.scene.raw, geometry, id) };
            failed()
        });
        // SAFETY: made above; the scene holds a reference of its own if it was attached.
        unsafe { sys::rtcReleaseGeometry(geometry) };
        attached.map(|()| id)
    }

    /// Builds the BVH. Afterwards the scene can be traced and no longer changed.
    pub fn commit(self) -> Result<CommittedScene, EmbreeError> {
        // SAFETY: the scene is valid; no other thread uses it, for `self` is owned.
        unsafe { sys::rtcCommitScene(self.scene.raw) };
        match last_error(self.scene.device.handle, "building the BVH") {
            Some(error) => Err(error),
            None => Ok(CommittedScene { scene: self.scene, _buffers: self.buffers }),
        }
    }
}

/// A ray as Embree takes it; no field may be NaN.
#[derive(Clone, Copy, Debug)]
pub struct RawRay {
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
pub struct RawHit {
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
    /// The geometry, as returned by [`SceneBuilder::add_round_curves`] or [`SceneBuilder::add_triangles`].
    pub geometry: u32,
}

/// Decides which hits count. Called during traversal, in any order, and possibly more than once for one hit.
pub trait HitFilter {
    /// Whether the hit stands. A hit that does not stand lets the ray pass.
    fn accept(&mut self, hit: &RawHit) -> bool;
}

/// Embree's context of a query with our own fields behind it: "users can extend the context at its end".
#[repr(C)]
struct QueryContext<'f, F> {
    base: sys::RTCRayQueryContext,
    filter: &'f mut F,
    panic: Option<Box<dyn Any + Send>>,
}

impl<'f, F> QueryContext<'f, F> {
    fn new(filter: &'f mut F) -> Self {
        // SAFETY: the struct is plain integers, for which all bit patterns are valid; all ones is
        // RTC_INVALID_GEOMETRY_ID, which is what rtcInitRayQueryContext writes into each of its fields.
        let base = unsafe {
            let mut base = std::mem::MaybeUninit::<sys::RTCRayQueryContext>::uninit();
            ptr::write_bytes(base.as_mut_ptr(), 0xff, 1);
            base.assume_init()
        };
        Self { base, filter, panic: None }
    }
}

unsafe extern "C" fn filter_trampoline<F: HitFilter>(args: *const sys::RTCFilterFunctionNArguments) {
    // SAFETY: Embree passes valid arguments; the context is the `QueryContext<F>` of this very query, which is
    // the only user of it, on this thread; only single rays are traced (N is 1), for which the layouts of ray
    // and hit are those of the plain structs, readable for the time of the call.
    unsafe {
        let args = &*args;
        debug_assert_eq!(args.N, 1, "only single-ray queries are made");
        if *args.valid == 0 {
            return;
        }
        let context = &mut *args.context.cast::<QueryContext<'_, F>>();
        let ray = &*args.ray.cast::<sys::RTCRay>();
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
            Ok(true) => {}
            Ok(false) => *args.valid = 0,
            Err(payload) => context.panic = Some(payload),
        }
    }
}

/// A scene that can be traced, from any number of threads.
#[derive(Debug)]
pub struct CommittedScene {
    scene: Handle,
    _buffers: Vec<Buffers>,
}

// SAFETY: "rtcIntersect and rtcOccluded may be called concurrently" on a committed scene; nothing modifies it.
unsafe impl Send for CommittedScene {}
// SAFETY: as above.
unsafe impl Sync for CommittedScene {}

impl CommittedScene {
    /// The nearest hit that `filter` lets stand.
    #[inline]
    pub fn intersect<F: HitFilter>(&self, ray: &RawRay, filter: &mut F) -> Option<RawHit> {
        let mut context = QueryContext::new(filter);
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
    pub fn occluded<F: HitFilter>(&self, ray: &RawRay, filter: &mut F) -> bool {
        let mut context = QueryContext::new(filter);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn straight_yarn(device: &Arc<Device>) -> CommittedScene {
        let points: Arc<[Vec4]> = (0..8).map(|i| Vec4::new(i as f32, 0.0, 0.0, 0.25)).collect();
        let segments: Arc<[u32]> = (0..5).collect();
        let mut builder = SceneBuilder::new(device, BvhLayout::Compact).unwrap();
        builder.add_round_curves(CurveBasis::CatmullRom, vec![points], segments).unwrap();
        builder.commit().unwrap()
    }

    #[test]
    fn a_ray_meets_a_moving_curve_where_it_is_at_its_time() {
        let device = Device::new(1).unwrap();
        let at = |y: f32| -> Arc<[Vec4]> { (0..8).map(|i| Vec4::new(i as f32, y, 0.0, 0.25)).collect() };
        let mut builder = SceneBuilder::new(&device, BvhLayout::Compact).unwrap();
        // Up by two, then back by one.
        let segments: Arc<[u32]> = (0..5).collect();
        builder.add_round_curves(CurveBasis::CatmullRom, vec![at(0.0), at(2.0), at(1.0)], segments).unwrap();
        let scene = builder.commit().unwrap();
        let mut filter = Counting { guard: 0, calls: 0, accept: true };
        for (time, y) in [(0.0, 0.0), (0.25, 1.0), (0.5, 2.0), (0.75, 1.5), (1.0, 1.0)] {
            let ray = RawRay { time, ..endless(Vec3A::new(3.2, 5.0, 0.0), Vec3A::new(0.01, -1.0, 0.002)) };
            let hit = scene.intersect(&ray, &mut filter).unwrap();
            assert!((hit.t - (4.75 - y)).abs() < 2e-3, "at {time}: {}", hit.t);
        }
    }

    fn endless(origin: Vec3A, direction: Vec3A) -> RawRay {
        RawRay { origin, direction, t_near: 0.0, t_far: f32::INFINITY, time: 0.0 }
    }

    /// Embree takes at most 129 times: what it refuses must be neither freed under it nor in the way of what follows.
    #[test]
    fn a_refused_geometry_keeps_its_buffers_and_harms_nothing() {
        let device = Device::new(1).unwrap();
        let points: Arc<[Vec4]> = (0..8).map(|i| Vec4::new(i as f32, 0.0, 0.0, 0.25)).collect();
        let segments: Arc<[u32]> = (0..5).collect();
        let mut builder = SceneBuilder::new(&device, BvhLayout::Compact).unwrap();
        let too_many = vec![Arc::clone(&points); 200];
        let error = builder.add_round_curves(CurveBasis::CatmullRom, too_many, Arc::clone(&segments)).unwrap_err();
        assert_eq!(error.during, "adding curves");
        assert_eq!(Arc::strong_count(&points), 201, "the buffers are kept");
        assert_eq!(builder.add_round_curves(CurveBasis::CatmullRom, vec![points], segments), Ok(1));
        let scene = builder.commit().unwrap();
        let mut filter = Counting { guard: 0, calls: 0, accept: true };
        let hit = scene.intersect(&endless(Vec3A::new(3.2, 1.0, 0.0), Vec3A::NEG_Y), &mut filter).unwrap();
        assert_eq!(hit.geometry, 1);
    }

    /// Counts hits behind a guard value, where a context that Embree thinks larger would be overwritten.
    struct Counting {
        guard: u64,
        calls: u64,
        accept: bool,
    }

    impl HitFilter for Counting {
        fn accept(&mut self, _: &RawHit) -> bool {
            self.calls += 1;
            self.accept
        }
    }

    #[test]
    fn fields_behind_the_context_survive_a_million_hits() {
        let device = Device::new(1).unwrap();
        let scene = straight_yarn(&device);
        let mut filter = Counting { guard: 0x0123_4567_89ab_cdef, calls: 0, accept: true };
        let mut hits = 0;
        while filter.calls < 1_000_000 {
            let x = 2.0 + (hits % 1000) as f32 * 3e-3;
            let ray = endless(Vec3A::new(x, 1.0, 0.1), Vec3A::new(0.03, -1.0, 0.01));
            assert!(scene.intersect(&ray, &mut filter).is_some(), "ray {hits} misses the yarn");
            hits += 1;
        }
        assert_eq!(filter.guard, 0x0123_4567_89ab_cdef, "Embree wrote behind its context");
    }

    #[test]
    fn a_rejected_hit_lets_the_ray_pass() {
        let device = Device::new(1).unwrap();
        let scene = straight_yarn(&device);
        let ray = endless(Vec3A::new(3.2, 1.0, 0.0), Vec3A::new(0.01, -1.0, 0.02));
        let mut reject = Counting { guard: 0, calls: 0, accept: false };
        assert!(scene.intersect(&ray, &mut reject).is_none());
        assert!(reject.calls >= 2, "entry and exit are both offered");
        assert!(!scene.occluded(&ray, &mut reject));
        let mut accept = Counting { guard: 0, calls: 0, accept: true };
        let hit = scene.intersect(&ray, &mut accept).unwrap();
        assert!((hit.t - 0.75).abs() < 1e-3, "hit at {}", hit.t);
        assert!(hit.normal.y > 0.0, "the normal points outward");
        assert!(scene.occluded(&ray, &mut accept));
    }

    #[test]
    fn triangles_are_met_from_both_sides() {
        let device = Device::new(1).unwrap();
        let points: Arc<[Vec3A]> = [Vec3A::ZERO, Vec3A::X, Vec3A::Y].into();
        let mut builder = SceneBuilder::new(&device, BvhLayout::Compact).unwrap();
        assert_eq!(builder.add_triangles(points, [[0, 1, 2]].into()), Ok(0));
        let scene = builder.commit().unwrap();
        let mut filter = Counting { guard: 0, calls: 0, accept: true };
        for (from, towards) in [(5.0, Vec3A::NEG_Z), (-5.0, Vec3A::Z)] {
            let hit = scene.intersect(&endless(Vec3A::new(0.25, 0.5, from), towards), &mut filter).unwrap();
            assert!((hit.t - 5.0).abs() < 1e-5 && (hit.u - 0.25).abs() < 1e-5 && (hit.v - 0.5).abs() < 1e-5);
            assert!(hit.normal.z > 0.0, "counter-clockwise is outside");
        }
        assert_eq!(filter.calls, 2);
        assert!(scene.intersect(&endless(Vec3A::new(0.7, 0.7, 5.0), Vec3A::NEG_Z), &mut filter).is_none());
    }

    #[test]
    fn a_panic_in_a_filter_comes_back_to_rust() {
        struct Panicking;
        impl HitFilter for Panicking {
            fn accept(&mut self, _: &RawHit) -> bool {
                panic!("parked")
            }
        }
        let device = Device::new(1).unwrap();
        let scene = straight_yarn(&device);
        let ray = endless(Vec3A::new(3.2, 1.0, 0.0), Vec3A::new(0.01, -1.0, 0.02));
        let caught = catch_unwind(AssertUnwindSafe(|| scene.intersect(&ray, &mut Panicking)));
        assert_eq!(caught.unwrap_err().downcast_ref::<&str>(), Some(&"parked"));
    }

    #[test]
    fn memory_is_counted_and_given_back() {
        let device = Device::new(1).unwrap();
        let before = device.memory().bytes();
        let scene = straight_yarn(&device);
        assert!(device.memory().bytes() > before);
        assert!(device.memory().peak_bytes() >= device.memory().bytes());
        drop(scene);
        assert!(device.memory().bytes() <= before, "{} > {before}", device.memory().bytes());
        assert!(device.version().starts_with("4."));
    }
}
