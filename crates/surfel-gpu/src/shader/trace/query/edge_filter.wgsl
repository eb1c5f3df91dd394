// The filter by which only hits within the edge of the surface count.

fn accepts_hit(ray: Ray, distance: f32, slot: u32) -> bool {
    if visits[visit_idx].has_edge_test == 0u {
        return true;
    }
    let surfel = slot_surfel(slot);
    let normal = facing(surfel.normal, ray.direction);
    let radius = surfel.radius / visits[visit_idx].radius_factor;
    return is_enclosed(CandidateHit(ray_at(ray, distance), normal, ray.direction, radius), true);
}
