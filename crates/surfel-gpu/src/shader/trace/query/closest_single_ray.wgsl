// Rays that search alone.

fn surface_hit_in_group(ray: Ray, is_searching: bool, local_idx: u32) -> SurfaceHit {
    if is_searching {
        return surface_hit(ray);
    }
    return missed_surface();
}
