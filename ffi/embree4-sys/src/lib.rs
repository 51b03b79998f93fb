//! Raw bindings to the installed Embree 4. The safe face is `yarnray::ffi::embree`.
//!
//! The bindings are generated at build time, so their layout is that of the installed headers; the
//! assertions below say which layout the safe face was written for, and stop the build on any other.

#![allow(
    non_camel_case_types,
    non_snake_case,
    non_upper_case_globals,
    unreachable_pub,
    missing_docs,
    clippy::all,
    reason = "generated code keeps the names of the C header"
)]

include!(concat!(env!("OUT_DIR"), "/bindings.rs"));

/// Ids of "nothing": no geometry, no instance (`RTC_INVALID_GEOMETRY_ID` is a macro with a cast, which bindgen leaves out).
pub const INVALID_ID: u32 = u32::MAX;

const _: () = {
    use std::mem::{align_of, offset_of, size_of};
    assert!(RTC_VERSION_MAJOR == 4, "embree4-sys needs Embree 4");
    assert!(size_of::<RTCRay>() == 48 && align_of::<RTCRay>() == 16);
    assert!(offset_of!(RTCRay, tnear) == 12 && offset_of!(RTCRay, dir_x) == 16);
    assert!(offset_of!(RTCRay, tfar) == 32 && offset_of!(RTCRay, mask) == 36 && offset_of!(RTCRay, flags) == 44);
    assert!(offset_of!(RTCHit, Ng_x) == 0 && offset_of!(RTCHit, u) == 12 && offset_of!(RTCHit, v) == 16);
    assert!(offset_of!(RTCHit, primID) == 20 && offset_of!(RTCHit, geomID) == 24 && offset_of!(RTCHit, instID) == 28);
    // Since 4.3.0, with instance arrays compiled in, a hit also has instPrimID: 36 bytes, padded to 48.
    assert!(size_of::<RTCHit>() == 48 || (RTC_VERSION < 40300 && size_of::<RTCHit>() == 32));
    assert!(offset_of!(RTCRayHit, hit) == 48 && size_of::<RTCRayHit>() == 48 + size_of::<RTCHit>());
    assert!(size_of::<RTCRayQueryContext>() == 8 || (RTC_VERSION < 40300 && size_of::<RTCRayQueryContext>() == 4));
    assert!(size_of::<RTCFilterFunctionNArguments>() == 48);
    assert!(offset_of!(RTCFilterFunctionNArguments, context) == 16);
    assert!(offset_of!(RTCFilterFunctionNArguments, ray) == 24 && offset_of!(RTCFilterFunctionNArguments, hit) == 32);
    assert!(offset_of!(RTCFilterFunctionNArguments, N) == 40);
};
