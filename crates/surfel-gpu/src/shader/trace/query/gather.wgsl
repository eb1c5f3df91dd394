// The gathered discs of a ray in any order: the nearest ones, by default all within a radius of each other.

var<private> query_ray: Ray;
var<private> gathered_distances: array<f32, MAX_DISCS>;
var<private> gathered_slots: array<u32, MAX_DISCS>;
var<private> n_gathered: u32;
var<private> gather_limit: f32;
// Distance behind a disc up to which others are blended with it; 0 if it is the disc's radius.
var<private> blend_distance: f32;

fn gather(ray: Ray) {
    query_ray = ray;
    blend_distance = select(0.0, visits[visit_idx].max_blend_distance, visits[visit_idx].gathers_to_nearest == 1u);
    n_gathered = 0u;
    gather_limit = ray.t_max;
    traverse(ray);
    drop_beyond(gather_limit);
}

// Drops the discs beyond a distance.
fn drop_beyond(limit: f32) {
    var n_kept = 0u;
    for (var i = 0u; i < n_gathered; i++) {
        let distance = gathered_distances[i];
        if distance <= limit {
            gathered_distances[n_kept] = distance;
            gathered_slots[n_kept] = gathered_slots[i];
            n_kept += 1u;
        }
    }
    n_gathered = n_kept;
}

fn search_limit() -> f32 {
    return gather_limit;
}

fn visit_block(block_idx: u32) -> bool {
    let head = load_head(block_idx);
    for (var half = 0u; half < 2u; half++) {
        let four = four_points(block_idx, head, half, query_ray.origin);
        let distances = intersect_four(four, query_ray);
        let is_in_range = (vec4<f32>(0.0) <= distances) & (distances <= vec4<f32>(gather_limit));
        for (var lanes = lane_bits(is_in_range); lanes != 0u; lanes &= lanes - 1u) {
            let lane = firstTrailingBit(lanes);
            let distance = distances[lane];
            if gather_limit < distance {
                continue;
            }
            gather_limit = min(gather_limit, distance + max(blend_distance, four.radius[lane]));
            add_disc(distance, 8u * block_idx + 4u * half + lane);
        }
    }
    return false;
}

// Adds a disc; of too many, the nearest are kept.
fn add_disc(distance: f32, slot: u32) {
    if n_gathered == MAX_DISCS {
        drop_beyond(gather_limit);
    }
    var at = n_gathered;
    if n_gathered == MAX_DISCS {
        at = farthest_disc();
        let other = gathered_distances[at];
        if other < distance || other == distance && gathered_slots[at] < slot {
            return;
        }
    } else {
        n_gathered += 1u;
    }
    gathered_distances[at] = distance;
    gathered_slots[at] = slot;
}

// Returns the place of the farthest disc; equally far ones are told apart by their slots.
fn farthest_disc() -> u32 {
    var farthest = 0u;
    for (var i = 1u; i < n_gathered; i++) {
        if is_before(farthest, i) {
            farthest = i;
        }
    }
    return farthest;
}

// Returns the place of the nearest disc.
fn nearest_disc() -> u32 {
    var nearest = 0u;
    for (var i = 1u; i < n_gathered; i++) {
        if is_before(i, nearest) {
            nearest = i;
        }
    }
    return nearest;
}

fn is_before(a: u32, b: u32) -> bool {
    let difference = gathered_distances[a] - gathered_distances[b];
    return difference < 0.0 || difference == 0.0 && gathered_slots[a] < gathered_slots[b];
}
