// The search for the nearest Gaussians of a ray that have not been composited yet.

// The ray in the coordinates of the cloud, and the factor by which distances along it grow.
var<private> query_ray: Ray;
var<private> query_scale: f32;

// Adds the nearest Gaussians of a cloud to the buffer.
fn search_gaussians(world_ray: Ray) {
    query_scale = object_scale(world_ray);
    query_ray = object_ray(world_ray, query_scale);
    // World distances are rounded: `composited` tells the hits at the same distance apart.
    query_ray.t_min = max(query_ray.t_min, composited.distance * query_scale * (1.0 - 4.0 * EPSILON));
    root_node = visits[visit_idx].root_node;
    if query_ray.t_min <= search_limit() {
        traverse(query_ray);
    }
}

fn search_limit() -> f32 {
    return min(query_ray.t_max, scaled_limit(buffer_bound(), query_scale * (1.0 + 4.0 * EPSILON)));
}

fn visit_block(block_idx: u32) -> bool {
    for (var half = 0u; half < 2u; half++) {
        let four = load_gaussians(block_idx, half, query_ray.origin);
        let densest = intersect_gaussians(four, query_ray.direction);
        for (var lane = 0u; lane < 4u; lane++) {
            let distance = densest.distances[lane];
            let squared = densest.squares[lane];
            let max_squared = four.max_squared[lane];
            let is_hit = 0.0 < max_squared && squared <= max_squared && query_ray.t_min <= distance;
            if !is_hit || search_limit() < distance {
                continue;
            }
            let slot = 8u * block_idx + 4u * half + lane;
            let hit = GaussianHit(distance / query_scale, visit_idx, slot, squared);
            if comes_before(composited, hit) {
                insert_gaussian(hit);
            }
        }
    }
    return false;
}
