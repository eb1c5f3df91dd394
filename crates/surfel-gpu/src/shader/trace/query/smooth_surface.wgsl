// The first hit of a ray on the smooth surface.

fn surface_hit(whole_ray: Ray) -> SurfaceHit {
    var ray = whole_ray;
    var hit = missed_surface();
    // The first disc that the ray passed, from its front where front sides are known.
    var passed = NearestHit(NO_LIMIT, NONE);
    for (var n_rejected = 0u; n_rejected < MAX_REJECTED_HITS; n_rejected++) {
        let nearest = closest_hit(ray);
        if nearest.slot == NONE {
            break;
        }
        let disc = slot_surfel(nearest.slot);
        nearest_slot = nearest.slot;
        // The surface may lie before a disc, and even before the discs that were rejected.
        let found = find_surface(whole_ray, nearest.distance, disc);
        if found.is_hit {
            let of_nearest = slot_surfel(nearest_slot);
            let color = mean_color(colors, of_nearest.color);
            let is_backface = 0.0 < dot(of_nearest.normal, ray.direction);
            hit = point_hit(found.distance, nearest_slot, disc.radius, found.normal, color, is_backface);
            break;
        }
        let is_front = dot(disc.normal, ray.direction) < 0.0;
        if passed.slot == NONE && (is_front || visits[visit_idx].has_front_sides == 0u) {
            passed = nearest;
        }
        let behind = nearest.distance + SMOOTH_RESTART_OFFSET * disc.radius;
        ray.t_min = max(behind, nearest.distance * (1.0 + 2.0 * EPSILON));
    }
    if passed.slot == NONE {
        return hit;
    }
    let disc = slot_surfel(passed.slot);
    if is_through_slit(disc, passed.distance, hit.distance, hit.is_backface, whole_ray) {
        let normal = facing(disc.normal, whole_ray.direction);
        return point_hit(passed.distance, passed.slot, disc.radius, normal, disc.color, false);
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
    evaluate_neighborhood(CandidateHit(position, -ray.direction, ray.direction, disc.radius));
    return is_surrounded(neighborhood, false) && !is_sparse(neighborhood);
}
