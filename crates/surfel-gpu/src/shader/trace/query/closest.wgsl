// The closest point on a ray, each a shape of its own.

struct NearestHit {
    distance: f32,
    // NONE for a miss.
    slot: u32,
}

var<private> query_ray: Ray;
var<private> nearest_hit: NearestHit;

fn closest_hit(ray: Ray) -> NearestHit {
    query_ray = ray;
    nearest_hit = NearestHit(ray.t_max, NONE);
    traverse(ray);
    return nearest_hit;
}

fn search_limit() -> f32 {
    return nearest_hit.distance;
}

// Equally near points are told apart by their slots.
fn visit_block(block_idx: u32) -> bool {
    let head = load_head(block_idx);
    for (var half = 0u; half < 2u; half++) {
        let distances = intersect_four(four_points(block_idx, head, half, query_ray.origin), query_ray);
        let first_slot = 8u * block_idx + 4u * half;
        for (var lane = 0u; lane < 4u; lane++) {
            let distance = distances[lane];
            let slot = first_slot + lane;
            let is_tie = distance == nearest_hit.distance && slot < nearest_hit.slot;
            if 0.0 <= distance && (distance < nearest_hit.distance || is_tie) {
                nearest_hit = NearestHit(distance, slot);
            }
        }
    }
    return false;
}
