// The nearest disc on a ray.

var<private> nearest_hit: NearestHit;

fn splat(ray: Ray) -> SurfaceHit {
    let nearest = closest_hit(ray);
    nearest_hit = nearest;
    if nearest.slot == NONE {
        return missed_surface();
    }
    let surfel = slot_surfel(nearest.slot);
    let normal = facing(surfel.normal, ray.direction);
    let is_backface = 0.0 < dot(surfel.normal, ray.direction);
    return point_hit(nearest.distance, nearest.slot, surfel.radius, normal, surfel.color, is_backface);
}

// Returns the number of the discs that make the hit.
fn n_hit_discs() -> u32 {
    return 1u;
}

// Returns the slot of one of these discs.
fn hit_disc(disc_idx: u32) -> u32 {
    return nearest_hit.slot;
}

// Returns the distance along the ray to the nearest disc.
fn nearest_disc_distance() -> f32 {
    return nearest_hit.distance;
}
