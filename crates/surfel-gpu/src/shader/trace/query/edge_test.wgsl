// The angular-gap test of a hit against the points around it.

var<private> neighborhood: NeighborhoodStats;

// Returns true if the points around a hit enclose it; where they are few, those of a wider neighbourhood.
fn is_enclosed(hit: CandidateHit, rejects_backfaces: bool) -> bool {
    evaluate_neighborhood(hit);
    if is_sparse(neighborhood) {
        var wider = hit;
        wider.radius = RETRY_RADIUS_FACTOR * hit.radius;
        evaluate_neighborhood(wider);
    }
    return is_surrounded(neighborhood, rejects_backfaces);
}

fn evaluate_neighborhood(hit: CandidateHit) {
    neighborhood = no_neighbors(hit);
    let reach = NEIGHBORHOOD_RADIUS_FACTOR * hit.radius;
    query_box(hit.position - reach, hit.position + reach, 0.0);
}

fn add_neighbors(block_idx: u32) {
    let head = load_head(block_idx);
    let position = neighborhood.hit.position;
    let reach = NEIGHBORHOOD_RADIUS_FACTOR * neighborhood.hit.radius;
    for (var lanes = lanes_within(block_idx, head, position, reach * reach); lanes != 0u; lanes &= lanes - 1u) {
        let point = block_point(block_idx, head, firstTrailingBit(lanes), position);
        if 0.0 < point.radius && is_neighbor(neighborhood.hit, point.center) {
            add_neighbor(&neighborhood, point.center, point.normal);
        }
    }
}

// Returns a normal turned against a direction.
fn facing(normal: vec3<f32>, direction: vec3<f32>) -> vec3<f32> {
    return select(normal, -normal, 0.0 < dot(normal, direction));
}
