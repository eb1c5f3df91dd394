// The filter by which discs count near which the ray hits the smooth surface, but for those through which it leaves the
// surface at its origin.

fn accepts_hit(ray: Ray, distance: f32, slot: u32) -> bool {
    let surfel = slot_surfel(slot);
    let has_known_sides = visits[visit_idx].has_front_sides + visits[visit_idx].has_outward_normals != 0u;
    let leaves = has_known_sides && distance < LEAVING_DISTANCE * surfel.radius &&
        0.0 < dot(surfel.normal, ray.direction);
    return !leaves && find_surface(ray, distance, surfel).is_hit;
}
