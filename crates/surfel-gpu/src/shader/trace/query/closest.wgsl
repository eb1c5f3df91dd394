// The closest point on a ray, each a shape of its own.

struct NearestHit {
    distance: f32,
    // NONE for a miss.
    slot: u32,
}

struct Search {
    ray: Ray,
    nearest: NearestHit,
}

fn closest_hit(ray: Ray) -> NearestHit {
    var search = Search(ray, NearestHit(ray.t_max, NONE));
    traverse(ray, &search);
    return search.nearest;
}

fn search_limit(search: ptr<function, Search>) -> f32 {
    return (*search).nearest.distance;
}

// Equally near points are told apart by their slots.
fn visit_block(block_idx: u32, search: ptr<function, Search>) -> bool {
    let ray = (*search).ray;
    var nearest = (*search).nearest;
    let head = load_head(block_idx);
    for (var half = 0u; half < 2u; half++) {
        let distances = intersect_four(four_points(block_idx, head, half, ray.origin), ray);
        let first_slot = 8u * block_idx + 4u * half;
        for (var lane = 0u; lane < 4u; lane++) {
            let distance = distances[lane];
            let slot = first_slot + lane;
            let is_tie = distance == nearest.distance && slot < nearest.slot;
            if 0.0 <= distance && (distance < nearest.distance || is_tie) {
                nearest = NearestHit(distance, slot);
            }
        }
    }
    (*search).nearest = nearest;
    return false;
}
