//! Memory that was freed, and that the allocator keeps for later use.

/// Gives freed memory back to the system. glibc keeps most of it, scattered among what is in use.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub fn give_back() {
    // SAFETY: the function has no conditions; it locks the heaps itself.
    unsafe { libc::malloc_trim(0) };
}

/// Does nothing: how an allocator gives memory back is its own matter.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub fn give_back() {}
