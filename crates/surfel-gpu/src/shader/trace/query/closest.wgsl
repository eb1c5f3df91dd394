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
    let block = load_block(block_idx);
    for (var lane = 0u; lane < 8u; lane++) {
        let point = block_point(block, lane, query_ray.origin);
        if point.radius <= 0.0 {
            continue;
        }
        let distance = intersect_shape(point, query_ray);
        let slot = 8u * block_idx + lane;
        let is_tie = distance == nearest_hit.distance && slot < nearest_hit.slot;
        if 0.0 <= distance && (distance < nearest_hit.distance || is_tie) {
            nearest_hit = NearestHit(distance, slot);
        }
    }
    return false;
}
