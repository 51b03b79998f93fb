//! The heap of the C library, which Rust's allocations come from.

/// Has large pieces of memory come from the system one by one, and go back to it as soon as they are freed, from now on and in
/// the whole process. By itself glibc moves the limit up, to 32 MB, with the largest piece that was freed: what a scene's
/// curves leave behind then stays with the process while the BVH is built, two fifths of the peak of a large garment.
pub(crate) fn give_back_large_pieces() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        const LARGE: libc::c_int = 128 << 10;
        // SAFETY: the call takes two numbers, may come at any time, and refuses what it does not know.
        unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE) };
    }
}
