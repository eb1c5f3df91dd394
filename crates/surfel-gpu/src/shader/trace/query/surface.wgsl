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

fn is_within_edge(ray: Ray, found: SurfaceHit) -> bool {
    if visits[visit_idx].has_edge_test == 0u {
        return true;
    }
    let position = ray_at(ray, found.distance);
    let candidate = CandidateHit(position, found.normal, ray.direction, found.radius);
    return is_enclosed_by_blocks(candidate) || is_enclosed(candidate, true);
}

// Returns true if a hit is enclosed already by the points in the blocks of the discs that the ray hits.
fn is_enclosed_by_blocks(hit: CandidateHit) -> bool {
    var stats = no_neighbors(hit);
    for (var i = 0u; i < n_hit_discs(); i++) {
        let block_idx = hit_disc(i) >> 3u;
        var is_new = true;
        for (var earlier = 0u; earlier < i; earlier++) {
            is_new = is_new && hit_disc(earlier) >> 3u != block_idx;
        }
        if is_new {
            add_neighbors(&stats, block_idx);
        }
    }
    return is_surrounded(stats, true) && !is_sparse(stats);
}
