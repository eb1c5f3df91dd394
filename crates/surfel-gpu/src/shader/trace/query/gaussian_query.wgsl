// The search for the nearest Gaussians of a ray that have not been composited yet.

struct Search {
    // The ray in the coordinates of the cloud.
    ray: Ray,
    // The factor by which distances along it grow.
    scale: f32,
}

// Adds the nearest Gaussians of a cloud to the buffer.
fn search_gaussians(world_ray: Ray) {
    let scale = object_scale(world_ray);
    var ray = object_ray(world_ray, scale);
    // World distances are rounded: `composited` tells the hits at the same distance apart.
    ray.t_min = max(ray.t_min, composited.distance * scale * (1.0 - 4.0 * EPSILON));
    root_node = visits[visit_idx].root_node;
    var search = Search(ray, scale);
    if ray.t_min <= search_limit(&search) {
        traverse(ray, &search);
    }
}

fn search_limit(search: ptr<function, Search>) -> f32 {
    return min((*search).ray.t_max, scaled_limit(buffer_bound(), (*search).scale * (1.0 + 4.0 * EPSILON)));
}

fn visit_block(block_idx: u32, search: ptr<function, Search>) -> bool {
    let ray = (*search).ray;
    for (var half = 0u; half < 2u; half++) {
        let four = load_gaussians(block_idx, half, ray.origin);
        let densest = intersect_gaussians(four, ray.direction);
        for (var lane = 0u; lane < 4u; lane++) {
            let distance = densest.distances[lane];
            let squared = densest.squares[lane];
            let max_squared = four.max_squared[lane];
            let is_hit = 0.0 < max_squared && squared <= max_squared && ray.t_min <= distance;
            if !is_hit || search_limit(search) < distance {
                continue;
            }
            let slot = 8u * block_idx + 4u * half + lane;
            let hit = GaussianHit(distance / (*search).scale, visit_idx, slot, squared);
            if comes_before(composited, hit) {
                insert_gaussian(hit);
            }
        }
    }
    return false;
}
