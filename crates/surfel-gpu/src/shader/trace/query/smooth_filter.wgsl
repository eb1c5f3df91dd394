// The filter by which discs count near which the ray hits the smooth surface, but for those through which it leaves the
// surface at its origin.

fn accepts_hit(ray: Ray, distance: f32, slot: u32) -> bool {
    let surfel = slot_surfel(slot);
    let leaves = distance < LEAVING_DISTANCE * surfel.radius && 0.0 < dot(surfel.normal, ray.direction);
    if leaves && (visits[visit_idx].has_front_sides | visits[visit_idx].has_outward_normals) != 0u {
        return false;
    }
    return find_surface(ray, distance, surfel).is_hit;
}
