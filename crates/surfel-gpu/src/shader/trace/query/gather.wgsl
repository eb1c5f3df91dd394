// The gathered discs of a ray: the nearest ones, by default all within a radius of each other.

var<private> query_ray: Ray;
var<private> gathered_distances: array<f32, MAX_DISCS>;
var<private> gathered_slots: array<u32, MAX_DISCS>;
var<private> n_gathered: u32;
var<private> gather_limit: f32;

fn gather(ray: Ray) {
    query_ray = ray;
    n_gathered = 0u;
    gather_limit = ray.t_max;
    traverse(ray);
}

// Drops the discs beyond a distance.
fn drop_beyond(limit: f32) {
    while 0u < n_gathered && limit < gathered_distances[n_gathered - 1u] {
        n_gathered -= 1u;
    }
}

fn search_limit() -> f32 {
    if n_gathered == MAX_DISCS {
        return min(gather_limit, gathered_distances[MAX_DISCS - 1u]);
    }
    return gather_limit;
}

fn visit_block(block_idx: u32) -> bool {
    let block = load_block(block_idx);
    for (var lane = 0u; lane < 8u; lane++) {
        let point = block_point(block, lane, query_ray.origin);
        if point.radius <= 0.0 {
            continue;
        }
        let distance = intersect_shape(point, query_ray);
        if distance < 0.0 || gather_limit < distance {
            continue;
        }
        let length =
            select(point.radius, visits[visit_idx].max_blend_distance, visits[visit_idx].gathers_to_nearest == 1u);
        gather_limit = min(gather_limit, distance + length);
        insert_disc(distance, 8u * block_idx + lane);
        drop_beyond(gather_limit);
    }
    return false;
}

// Inserts a disc in the order of distance and slot; of too many, the nearest are kept.
fn insert_disc(distance: f32, slot: u32) {
    var at = n_gathered;
    if n_gathered == MAX_DISCS {
        at = MAX_DISCS - 1u;
        if !is_before(distance, slot, at) {
            return;
        }
    } else {
        n_gathered += 1u;
    }
    while 0u < at && is_before(distance, slot, at - 1u) {
        gathered_distances[at] = gathered_distances[at - 1u];
        gathered_slots[at] = gathered_slots[at - 1u];
        at -= 1u;
    }
    gathered_distances[at] = distance;
    gathered_slots[at] = slot;
}

fn is_before(distance: f32, slot: u32, at: u32) -> bool {
    let other = gathered_distances[at];
    return distance < other || distance == other && slot < gathered_slots[at];
}
