// The angular-gap test of a hit against the points around it.

// Returns true if the points around a hit enclose it; where they are few, those of a wider neighbourhood.
fn is_enclosed(hit: CandidateHit, rejects_backfaces: bool) -> bool {
    var stats = neighborhood_of(hit);
    if is_sparse(stats) {
        var wider = hit;
        wider.radius = RETRY_RADIUS_FACTOR * hit.radius;
        stats = neighborhood_of(wider);
    }
    return is_surrounded(stats, rejects_backfaces);
}

fn neighborhood_of(hit: CandidateHit) -> NeighborhoodStats {
    var stats = no_neighbors(hit);
    let reach = NEIGHBORHOOD_RADIUS_FACTOR * hit.radius;
    list_blocks(hit.position - reach, hit.position + reach, 0.0);
    loop {
        for (var i = 0u; i < n_listed; i++) {
            add_neighbors(&stats, listed_blocks[i]);
        }
        if !list_more() {
            break;
        }
    }
    return stats;
}

fn add_neighbors(stats: ptr<function, NeighborhoodStats>, block_idx: u32) {
    let points = load_points(block_idx, (*stats).hit.position);
    let reach = NEIGHBORHOOD_RADIUS_FACTOR * (*stats).hit.radius;
    for (var lanes = lanes_within(points, reach * reach); lanes != 0u; lanes &= lanes - 1u) {
        let point = point_at(points, firstTrailingBit(lanes));
        if 0.0 < point.radius && is_neighbor((*stats).hit, point.center) {
            add_neighbor(stats, point.center, point.normal);
        }
    }
}
