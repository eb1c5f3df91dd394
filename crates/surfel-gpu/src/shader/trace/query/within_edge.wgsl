// The edge of the surface at the outermost points.

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
