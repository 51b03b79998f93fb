//! A scene while it takes geometry.

use std::{any::Any, sync::Arc};

use embree4_sys as sys;
use glam::{Vec3A, Vec4};
use rayon::prelude::*;

use super::{CommittedScene, Device, EmbreeError, last_error};

/// The basis in which Embree reads control points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CurveBasis {
    /// `RTC_GEOMETRY_TYPE_ROUND_CATMULL_ROM_CURVE`
    CatmullRom,
    /// `RTC_GEOMETRY_TYPE_ROUND_BSPLINE_CURVE`
    BSpline,
}

/// The trade that the BVH makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub(crate) enum BvhLayout {
    /// About 44 bytes per cubic segment; 3 to 10 % slower to trace.
    #[default]
    Compact,
    /// About 119 bytes per cubic segment.
    Fast,
}

/// A scene that still takes geometry.
#[derive(Debug)]
pub(crate) struct SceneBuilder {
    scene: Handle,
    buffers: Vec<Buffers>,
}

/// What Embree reads in place.
pub(super) type Buffers = Box<dyn Any + Send + Sync>;

#[derive(Debug)]
pub(super) struct Handle {
    pub(super) raw: sys::RTCScene,
    pub(super) device: Arc<Device>,
}

impl Drop for Handle {
    fn drop(&mut self) {
        // SAFETY: made by rtcNewScene, released once, before its device.
        unsafe { sys::rtcReleaseScene(self.raw) };
    }
}

impl SceneBuilder {
    /// An empty scene on `device`.
    pub(crate) fn new(device: &Arc<Device>, layout: BvhLayout) -> Result<Self, EmbreeError> {
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
    pub(crate) fn add_round_curves(
        &mut self,
        basis: CurveBasis,
        points: Vec<Arc<Vec<Vec4>>>,
        segments: Arc<Vec<u32>>,
    ) -> Result<u32, EmbreeError> {
        assert!(
            !points.is_empty() && points.iter().all(|p| p.len() == points[0].len()),
            "curves have as many control points at all times"
        );
        assert!(
            segments.par_iter().all(|&first| (first as usize) + 4 <= points[0].len()),
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
    pub(crate) fn add_triangles(
        &mut self,
        points: Arc<[Vec3A]>,
        triangles: Arc<[[u32; 3]]>,
    ) -> Result<u32, EmbreeError> {
        assert!(
            triangles.par_iter().flatten_iter().all(|&i| (i as usize) < points.len()),
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
    pub(crate) fn commit(self) -> Result<CommittedScene, EmbreeError> {
        // SAFETY: the scene is valid; no other thread uses it, for `self` is owned.
        unsafe { sys::rtcCommitScene(self.scene.raw) };
        match last_error(self.scene.device.handle, "building the BVH") {
            Some(error) => Err(error),
            None => Ok(CommittedScene::new(self.scene, self.buffers)),
        }
    }
}
