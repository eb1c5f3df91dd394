// The gathered discs of a ray in any order: the nearest ones, by default all within a radius of each other.

struct Search {
    ray: Ray,
    limit: f32,
    // Distance behind a disc up to which others are blended with it; 0 if it is the disc's radius.
    blend_distance: f32,
    n_gathered: u32,
}

var<private> gathered_distances: array<f32, MAX_DISCS>;
var<private> gathered_slots: array<u32, MAX_DISCS>;
var<private> n_gathered: u32;

fn gather(ray: Ray) {
    let gathers_to_nearest = visits[visit_idx].gathers_to_nearest == 1u;
    let blend_distance = select(0.0, visits[visit_idx].max_blend_distance, gathers_to_nearest);
    var search = Search(ray, ray.t_max, blend_distance, 0u);
    traverse(ray, &search);
    n_gathered = n_within(search.n_gathered, search.limit);
}

// Drops the gathered discs beyond a distance.
fn drop_beyond(limit: f32) {
    n_gathered = n_within(n_gathered, limit);
}

// Drops those of `n` discs that are beyond a distance. Returns the number of the others.
fn n_within(n: u32, limit: f32) -> u32 {
    var n_kept = 0u;
    for (var i = 0u; i < n; i++) {
        let distance = gathered_distances[i];
        if distance <= limit {
            gathered_distances[n_kept] = distance;
            gathered_slots[n_kept] = gathered_slots[i];
            n_kept += 1u;
        }
    }
    return n_kept;
}

fn search_limit(search: ptr<function, Search>) -> f32 {
    return (*search).limit;
}

fn visit_block(block_idx: u32, search: ptr<function, Search>) -> bool {
    let ray = (*search).ray;
    var limit = (*search).limit;
    var n = (*search).n_gathered;
    let head = load_head(block_idx);
    for (var half = 0u; half < 2u; half++) {
        let four = four_points(block_idx, head, half, ray.origin);
        let distances = intersect_four(four, ray);
        let is_in_range = (vec4<f32>(0.0) <= distances) & (distances <= vec4<f32>(limit));
        for (var lanes = lane_bits(is_in_range); lanes != 0u; lanes &= lanes - 1u) {
            let lane = firstTrailingBit(lanes);
            let distance = distances[lane];
            if limit < distance {
                continue;
            }
            limit = min(limit, distance + max((*search).blend_distance, four.radius[lane]));
            n = with_disc_added(n, limit, distance, 8u * block_idx + 4u * half + lane);
        }
    }
    (*search).limit = limit;
    (*search).n_gathered = n;
    return false;
}

// Adds a disc to `n` others; of too many, the nearest are kept. Returns the number of discs.
fn with_disc_added(n: u32, limit: f32, distance: f32, slot: u32) -> u32 {
    var at = n;
    if at == MAX_DISCS {
        at = n_within(n, limit);
    }
    var n_after = at + 1u;
    if at == MAX_DISCS {
        at = farthest_disc(n);
        n_after = n;
        let other = gathered_distances[at];
        if other < distance || other == distance && gathered_slots[at] < slot {
            return n;
        }
    }
    gathered_distances[at] = distance;
    gathered_slots[at] = slot;
    return n_after;
}

// Returns the index of the farthest of `n` discs; equally far ones are told apart by their slots.
fn farthest_disc(n: u32) -> u32 {
    var farthest = 0u;
    for (var i = 1u; i < n; i++) {
        if is_before(farthest, i) {
            farthest = i;
        }
    }
    return farthest;
}

// Returns the index of the nearest disc.
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
