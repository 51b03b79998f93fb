//! The heap of the C library, which Rust's allocations come from.

/// Has pieces of memory up to 4 MB stay with the process when they are freed, until [`give_back`], and larger ones come from
/// the system one by one and go back at once; from now on and in the whole process.
///
/// Memory from the system is cleared page by page: lists that a relaxation makes again and again would pay for that each time.
/// By itself glibc moves the limit up, to 32 MB, with the largest piece that was freed: what a scene's curves leave behind then
/// stays while the BVH is built, two fifths of the peak of a large garment.
pub(crate) fn keep_small_pieces() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        const LARGE: libc::c_int = 4 << 20;
        // SAFETY: the call takes two numbers, may come at any time, and refuses what it does not know.
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE);
            libc::mallopt(libc::M_TRIM_THRESHOLD, 8 * LARGE);
        }
    }
}

/// Gives back to the system what is free: between two phases of a render, of which the later one makes large pieces.
pub(crate) fn give_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        // SAFETY: the call takes a number of bytes to keep, and may come at any time.
        unsafe { libc::malloc_trim(0) };
    }
}
