// The splat of a ray: its gathered discs, blended.

fn splat(ray: Ray) -> SurfaceHit {
    gather(ray);
    if n_gathered == 0u {
        return missed_surface();
    }
    let nearest = slot_surfel(gathered_slots[0]);
    var sums = no_discs(nearest, ray.direction);
    for (var i = 0u; i < n_gathered; i++) {
        let surfel = slot_surfel(gathered_slots[i]);
        let offset = ray_at(ray, gathered_distances[i]) - surfel.center;
        sums = with_disc(sums, surfel, offset);
    }
    let normal = splat_normal(sums, ray.direction);
    let color = sums.color / sums.total_weight;
    let is_backface = 0.0 < dot(nearest.normal, ray.direction);
    return point_hit(gathered_distances[0], gathered_slots[0], nearest.radius, normal, color, is_backface);
}

// Returns the number of the discs that make the hit.
fn n_hit_discs() -> u32 {
    return n_gathered;
}

// Returns the slot of one of these discs.
fn hit_disc(disc_idx: u32) -> u32 {
    return gathered_slots[disc_idx];
}
