// The surface of discs and splats: the first hit that the edge test does not reject.

fn surface_hit(first_ray: Ray) -> SurfaceHit {
    var ray = first_ray;
    for (var n_rejected = 0u; n_rejected < MAX_REJECTED_HITS; n_rejected++) {
        let found = splat(ray);
        // Where too few points are near the ray, it goes through a hole.
        let is_dense = visits[visit_idx].min_discs <= n_hit_discs();
        if !found.is_hit || is_dense && is_within_edge(ray, found) {
            return found;
        }
        let nearest = nearest_disc_distance();
        let behind = nearest + RESTART_OFFSET * found.radius;
        ray.t_min = max(behind, nearest * (1.0 + 2.0 * EPSILON));
    }
    return missed_surface();
}
