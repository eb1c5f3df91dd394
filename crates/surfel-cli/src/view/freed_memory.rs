//! Memory that was freed, and that the allocator keeps for later use.

/// Lets the allocator of glibc keep little. By default it keeps up to 64 MiB at the end of each of its heaps, and serves
/// blocks of up to 32 MiB from them.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub fn keep_little() {
    /// Size in bytes from which on a block is mapped by itself, and free memory at the end of a heap given back.
    const THRESHOLD: i32 = 4 << 20;
    for parameter in [libc::M_MMAP_THRESHOLD, libc::M_TRIM_THRESHOLD] {
        // SAFETY: the function only sets a number, under a lock of its own.
        unsafe { libc::mallopt(parameter, THRESHOLD) };
    }
}

/// Gives back what lies between blocks that are in use.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub fn give_back() {
    // SAFETY: the function has no conditions; it locks the heaps itself.
    unsafe { libc::malloc_trim(0) };
}

/// Does nothing: how much other allocators keep is their own matter.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub fn keep_little() {}

/// Does nothing: how other allocators give memory back is their own matter.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub fn give_back() {}
