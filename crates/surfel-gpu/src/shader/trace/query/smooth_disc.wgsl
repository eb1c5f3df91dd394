// The hit of a ray on the smooth surface near a disc, and slits between points.

// The surface may lie before the disc, and even before discs that were rejected.
fn hit_near_disc(ray: Ray, disc_distance: f32, disc_slot: u32) -> SurfaceHit {
    let disc = slot_surfel(disc_slot);
    nearest_slot = disc_slot;
    let found = find_surface(ray, disc_distance, disc);
    if !found.is_hit {
        return missed_surface();
    }
    let of_nearest = slot_surfel(nearest_slot);
    let color = mean_color(colors, of_nearest.color);
    let is_backface = 0.0 < dot(of_nearest.normal, ray.direction);
    return point_hit(found.distance, nearest_slot, disc.radius, found.normal, color, is_backface);
}

// Returns a hit or a miss, or the hit on a disc that the ray passed before, if it went through a slit there.
fn hit_before_slit(hit: SurfaceHit, passed_slot: u32, passed_distance: f32, ray: Ray) -> SurfaceHit {
    let disc = slot_surfel(passed_slot);
    if is_through_slit(disc, passed_distance, hit.distance, hit.is_backface, ray) {
        let normal = facing(disc.normal, ray.direction);
        return point_hit(passed_distance, passed_slot, disc.radius, normal, disc.color, false);
    }
    return hit;
}

// Returns true if a ray went through a slit between the points around a disc, which it passed before its hit or a miss:
// it hits a back face, or sees points all around and the disc not from its side.
fn is_through_slit(
    disc: Surfel,
    disc_distance: f32,
    hit_distance: f32,
    hit_is_backface: bool,
    ray: Ray,
) -> bool {
    if hit_distance <= disc_distance + MIN_SLIT_DEPTH * disc.radius {
        return false;
    }
    if visits[visit_idx].has_front_sides == 1u && hit_is_backface {
        return true;
    }
    if visits[visit_idx].has_edge_test == 0u || abs(dot(disc.normal, ray.direction)) < MIN_SLIT_COSINE {
        return false;
    }
    let position = ray_at(ray, disc_distance);
    let stats = neighborhood_of(CandidateHit(position, -ray.direction, ray.direction, disc.radius));
    return is_surrounded(stats, false) && !is_sparse(stats);
}
