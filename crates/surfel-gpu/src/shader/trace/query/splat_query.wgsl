// The splat of a ray: its gathered discs, blended.

// Distance along the ray to the nearest disc.
var<private> nearest_distance: f32;

fn splat(ray: Ray) -> SurfaceHit {
    gather(ray);
    if n_gathered == 0u {
        return missed_surface();
    }
    let nearest_idx = nearest_disc();
    nearest_distance = gathered_distances[nearest_idx];
    let nearest_slot = gathered_slots[nearest_idx];
    let nearest = slot_surfel(nearest_slot);
    if visits[visit_idx].gathers_to_nearest == 1u {
        drop_beyond(nearest_distance + nearest.radius);
    }
    let position = ray_at(ray, nearest_distance);
    if SURFACE == SPLAT_FIT {
        keep_nearest_discs(position, nearest.radius);
    }
    var sums = no_discs(nearest, nearest_distance, ray.direction);
    for (var i = 0u; i < n_gathered; i++) {
        let surfel = slot_surfel(gathered_slots[i]);
        let offset = ray_at(ray, gathered_distances[i]) - surfel.center;
        sums = with_disc(sums, surfel, gathered_distances[i], offset);
    }
    var normal = splat_normal(sums, ray.direction);
    if SURFACE == SPLAT_FIT {
        normal = fitted_normal(position, nearest.radius, normal);
    }
    let color = sums.color / sums.total_weight;
    let is_backface = 0.0 < dot(nearest.normal, ray.direction);
    let radius = nearest.radius / visits[visit_idx].radius_factor;
    return point_hit(splat_distance(sums), nearest_slot, radius, normal, color, is_backface);
}

// Returns the number of the discs that make the hit.
fn n_hit_discs() -> u32 {
    return n_gathered;
}

// Returns the slot of one of these discs.
fn hit_disc(disc_idx: u32) -> u32 {
    return gathered_slots[disc_idx];
}

// Returns the distance along the ray to the nearest disc.
fn nearest_disc_distance() -> f32 {
    return nearest_distance;
}
