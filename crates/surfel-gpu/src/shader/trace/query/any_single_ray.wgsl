// Rays toward lights that search alone.

fn is_blocked_in_group(ray: Ray, is_searching: bool, local_idx: u32) -> bool {
    return is_searching && is_occluded(ray);
}
