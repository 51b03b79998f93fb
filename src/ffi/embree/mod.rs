//! A safe face of Embree 4: a device, curve geometries, one committed scene, single-ray queries with a filter.
//!
//! The types carry the manual's rules: only a [`CommittedScene`] can be traced; buffers live as long as the
//! scene that reads them; a panic in a filter is parked and resumed after Embree has returned.

mod query;
mod scene;
#[cfg(test)]
mod tests;

use std::{
    ffi::{CStr, CString},
    fmt, ptr,
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
};

use embree4_sys as sys;

pub(crate) use query::{CommittedScene, HitFilter, RawHit, RawRay};
pub(crate) use scene::{BvhLayout, CurveBasis, SceneBuilder};

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
pub(crate) struct MemoryCounter {
    now: AtomicI64,
}

impl MemoryCounter {
    /// Bytes held now.
    pub(crate) fn bytes(&self) -> u64 {
        self.now.load(Ordering::Relaxed).max(0).unsigned_abs()
    }
}

/// Called by Embree, on any of its threads, before it allocates and after it frees.
unsafe extern "C" fn monitor_memory(counter: *mut std::ffi::c_void, bytes: isize, _post: bool) -> bool {
    // SAFETY: the pointer is the `MemoryCounter` given at registration; `Device` keeps it alive until after
    // the device is released, and all access is atomic.
    let counter = unsafe { &*counter.cast::<MemoryCounter>() };
    counter.now.fetch_add(bytes as i64, Ordering::Relaxed);
    true
}

/// An Embree device and its memory counter.
#[derive(Debug)]
pub(crate) struct Device {
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
    pub(crate) fn new(threads: usize) -> Result<Arc<Self>, EmbreeError> {
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
    pub(crate) fn memory(&self) -> &MemoryCounter {
        &self.memory
    }

    /// The version of the library in use, as `major.minor.patch`.
    pub(crate) fn version(&self) -> String {
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
