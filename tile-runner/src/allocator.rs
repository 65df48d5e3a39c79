//! How the system's allocator gives memory back.

/// Buffers from here on go back to the system when they are freed, bytes.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE: libc::c_int = 1 << 20;

/// Has large buffers given back as soon as they are freed. Call it before starting a thread.
///
/// Left alone, glibc raises the size from which it does so to that of the largest buffer freed so far, and keeps what is smaller, for each
/// thread apart: chunks of a file come in all sizes, and on a 4096-wide PIZ render 44 MiB were kept that way. Other systems' allocators do not.
///
/// All threads share one arena: each of its own would take 64 MiB of address space, which `ulimit -v` counts, and what is allocated while a
/// run is under way is large, and little.
pub(crate) fn give_large_buffers_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: sets numbers of the allocator's, which it reads under its own locks, and there is one thread.
    unsafe {
        // refused, they leave the process as it was
        libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE);
        libc::mallopt(libc::M_ARENA_MAX, 1);
    }
}
