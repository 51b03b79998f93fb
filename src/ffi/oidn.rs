//! Open Image Denoise 2, loaded at run time if somebody asks for a denoised picture and has it.
//!
//! The few functions of its C API that are used are declared here by hand, so that neither headers nor library are
//! needed to build. Pictures stay in our memory, which the CPU device reads in place.

use std::{
    ffi::{CStr, c_char, c_int, c_void},
    fmt,
    path::PathBuf,
    ptr,
};

use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};

use super::reason;

/// The library's name where the system has it, of the major version whose functions are declared here.
const SONAME: &str = "libOpenImageDenoise.so.2";

/// Why there is no denoised picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OidnError {
    /// The library cannot be loaded; the loader's reason.
    Missing(String),
    /// Its own message.
    Failed(String),
}

impl fmt::Display for OidnError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing(reason) => write!(
                f,
                "denoising needs Open Image Denoise 2, which cannot be loaded ({reason}); \
                 unpack a release of it (openimagedenoise.org) and set OIDN_DIR to its folder, or to the folder of {SONAME}"
            ),
            Self::Failed(reason) => write!(f, "Open Image Denoise: {reason}"),
        }
    }
}

impl std::error::Error for OidnError {}

type Handle = *mut c_void;

/// `OIDN_DEVICE_TYPE_CPU`: the one device whose result does not depend on a graphics card.
const DEVICE_CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`
const FLOAT3: c_int = 3;

/// The functions, as oidn.h 2.x declares them.
struct Api {
    new_device: unsafe extern "C" fn(c_int) -> Handle,
    set_device_int: unsafe extern "C" fn(Handle, *const c_char, c_int),
    set_device_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    get_device_int: unsafe extern "C" fn(Handle, *const c_char) -> c_int,
    commit_device: unsafe extern "C" fn(Handle),
    device_error: unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int,
    release_device: unsafe extern "C" fn(Handle),
    new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Handle,
    set_image: unsafe extern "C" fn(Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize),
    set_filter_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    commit_filter: unsafe extern "C" fn(Handle),
    execute_filter: unsafe extern "C" fn(Handle),
    release_filter: unsafe extern "C" fn(Handle),
    /// Keeps the functions above where they are.
    _library: Library,
}

impl Api {
    fn load() -> Result<Self, OidnError> {
        let mut first_reason = None;
        for path in candidates() {
            // SAFETY: the library's initialisers are those of a published C++ library; a path that the user names is
            // trusted as any program that the user runs.
            match unsafe { Library::open(Some(&path), RTLD_NOW | RTLD_LOCAL) } {
                Ok(library) => return Self::from_library(library).map_err(|e| OidnError::Missing(reason(&e))),
                Err(error) => {
                    first_reason.get_or_insert(reason(&error));
                }
            }
        }
        Err(OidnError::Missing(first_reason.unwrap_or_default()))
    }

    fn from_library(library: Library) -> Result<Self, libloading::Error> {
        // SAFETY: each type above is that of the function of this name in oidn.h of version 2, the only major version
        // that the file name admits; the library is kept as long as the pointers.
        unsafe {
            Ok(Self {
                new_device: *library.get(b"oidnNewDevice\0")?,
                set_device_int: *library.get(b"oidnSetDeviceInt\0")?,
                set_device_bool: *library.get(b"oidnSetDeviceBool\0")?,
                get_device_int: *library.get(b"oidnGetDeviceInt\0")?,
                commit_device: *library.get(b"oidnCommitDevice\0")?,
                device_error: *library.get(b"oidnGetDeviceError\0")?,
                release_device: *library.get(b"oidnReleaseDevice\0")?,
                new_filter: *library.get(b"oidnNewFilter\0")?,
                set_image: *library.get(b"oidnSetSharedFilterImage\0")?,
                set_filter_bool: *library.get(b"oidnSetFilterBool\0")?,
                commit_filter: *library.get(b"oidnCommitFilter\0")?,
                execute_filter: *library.get(b"oidnExecuteFilter\0")?,
                release_filter: *library.get(b"oidnReleaseFilter\0")?,
                _library: library,
            })
        }
    }
}

/// Where the library may be: below `OIDN_DIR`, else where the system finds libraries.
fn candidates() -> Vec<PathBuf> {
    match std::env::var_os("OIDN_DIR").filter(|d| !d.is_empty()).map(PathBuf::from) {
        Some(folder) => ["lib", "lib64", "."].map(|sub| folder.join(sub).join(SONAME)).into(),
        None => vec![PathBuf::from(SONAME)],
    }
}

/// A device that denoises on the CPU.
pub struct Denoiser {
    api: Api,
    device: Handle,
}

impl fmt::Debug for Denoiser {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Open Image Denoise {}", self.version())
    }
}

/// What denoising sees of a picture besides its colours, pixel by pixel.
#[derive(Clone, Copy, Debug)]
pub struct Guides<'a> {
    /// Albedo of what is seen first, 0 to 1.
    pub albedo: &'a [[f32; 3]],
    /// Its normal, of unit length or zero.
    pub normal: &'a [[f32; 3]],
}

impl Denoiser {
    /// Loads the library and opens a device with so many threads.
    ///
    /// # Errors
    /// The library is not there, or does not want to.
    pub fn new(threads: usize) -> Result<Self, OidnError> {
        let api = Api::load()?;
        // SAFETY: the functions are those of oidn.h; a null device is handled below.
        let device = unsafe { (api.new_device)(DEVICE_CPU) };
        let denoiser = Self { api, device };
        if denoiser.device.is_null() {
            return denoiser.check().and(Err(OidnError::Failed("it has no device for the CPU".to_owned())));
        }
        // SAFETY: the device is valid and not committed; names end in NUL.
        unsafe {
            (denoiser.api.set_device_int)(device, c"numThreads".as_ptr(), threads.min(1 << 16) as c_int);
            (denoiser.api.set_device_bool)(device, c"setAffinity".as_ptr(), false);
            (denoiser.api.commit_device)(device);
        }
        denoiser.check()?;
        Ok(denoiser)
    }

    /// The library's version, such as "2.3.1".
    pub fn version(&self) -> String {
        let part = |name: &CStr| {
            // SAFETY: the device is valid; the name ends in NUL.
            unsafe { (self.api.get_device_int)(self.device, name.as_ptr()) }
        };
        format!("{}.{}.{}", part(c"versionMajor"), part(c"versionMinor"), part(c"versionPatch"))
    }

    /// Denoises linear colours with any range. The guides are denoised first, since they are noisy themselves where
    /// yarns are thinner than pixels.
    ///
    /// # Errors
    /// The library's own.
    ///
    /// # Panics
    /// If a picture does not have width x height pixels.
    pub fn denoise(
        &self,
        width: usize,
        height: usize,
        color: &[[f32; 3]],
        guides: &Guides<'_>,
    ) -> Result<Vec<[f32; 3]>, OidnError> {
        let size = (width, height);
        let albedo = self.filter(size, &[(c"albedo", guides.albedo)], &[])?;
        let normal = self.filter(size, &[(c"normal", guides.normal)], &[])?;
        let images = [(c"color", color), (c"albedo", &albedo), (c"normal", &normal)];
        self.filter(size, &images, &[c"hdr", c"cleanAux"])
    }

    /// Runs the filter for path-traced pictures.
    fn filter(
        &self,
        (width, height): (usize, usize),
        images: &[(&CStr, &[[f32; 3]])],
        switches: &[&CStr],
    ) -> Result<Vec<[f32; 3]>, OidnError> {
        let mut out = vec![[0.0_f32; 3]; width * height];
        // SAFETY: the device is valid; the name ends in NUL. The filter is released below, whatever happens between.
        let filter = unsafe { (self.api.new_filter)(self.device, c"RT".as_ptr()) };
        if filter.is_null() {
            return self.check().map(|()| out);
        }
        let set = |name: &CStr, data: *mut c_void| {
            // SAFETY: `data` has width x height packed pixels of three floats, which outlive the filter's execution; the
            // filter writes to the image called "output" only, which is the mutable one.
            unsafe { (self.api.set_image)(filter, name.as_ptr(), data, FLOAT3, width, height, 0, 0, 0) }
        };
        for (name, pixels) in images {
            assert_eq!(pixels.len(), width * height, "as many pixels as the picture has");
            set(name, pixels.as_ptr().cast_mut().cast());
        }
        set(c"output", out.as_mut_ptr().cast());
        // SAFETY: the filter is valid; names end in NUL; execution has ended when the call returns.
        unsafe {
            for name in switches {
                (self.api.set_filter_bool)(filter, name.as_ptr(), true);
            }
            (self.api.commit_filter)(filter);
            (self.api.execute_filter)(filter);
            (self.api.release_filter)(filter);
        }
        self.check().map(|()| out)
    }

    /// Reads and clears this thread's first error.
    fn check(&self) -> Result<(), OidnError> {
        let mut message: *const c_char = ptr::null();
        // SAFETY: a null device asks for the error of a failed oidnNewDevice; the message is read at once.
        unsafe {
            if (self.api.device_error)(self.device, &mut message) == 0 {
                return Ok(());
            }
            let text = if message.is_null() { c"an error without a message" } else { CStr::from_ptr(message) };
            Err(OidnError::Failed(text.to_string_lossy().into_owned()))
        }
    }
}

impl Drop for Denoiser {
    fn drop(&mut self) {
        if !self.device.is_null() {
            // SAFETY: the last use of the device; all filters have been released.
            unsafe { (self.api.release_device)(self.device) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_goes_and_edges_stay() {
        let denoiser = match Denoiser::new(1) {
            Ok(denoiser) => denoiser,
            Err(error) => {
                assert!(matches!(error, OidnError::Missing(_)), "{error}");
                assert!(error.to_string().contains("OIDN_DIR"), "{error}");
                crate::testing::skipped(&error.to_string());
                return;
            }
        };
        assert!(denoiser.version().starts_with("2."), "{denoiser:?}");
        let (width, height) = (64, 48);
        let truth = |i: usize| if i % width < width / 2 { 0.2_f32 } else { 3.0 };
        let mut state = 1_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let color: Vec<_> = (0..width * height).map(|i| [truth(i) * 2.0 * noise(); 3]).collect();
        let flat = vec![[0.5; 3]; width * height];
        let front = vec![[0.0, 0.0, 1.0]; width * height];
        let guides = Guides { albedo: &flat, normal: &front };
        let out = denoiser.denoise(width, height, &color, &guides).unwrap();
        let error = |p: &[[f32; 3]]| p.iter().enumerate().map(|(i, c)| (c[1] / truth(i) - 1.0).powi(2)).sum::<f32>();
        assert!(error(&out) < 0.2 * error(&color), "{} of {}", error(&out), error(&color));
    }
}
