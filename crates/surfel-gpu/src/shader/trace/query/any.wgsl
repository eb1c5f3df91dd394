// Any hit of a ray that counts.

var<private> query_ray: Ray;
var<private> has_hit: bool;

fn is_occluded(ray: Ray) -> bool {
    query_ray = ray;
    has_hit = false;
    traverse(ray);
    return has_hit;
}

fn search_limit() -> f32 {
    return query_ray.t_max;
}

fn visit_block(block_idx: u32) -> bool {
    let block = load_block(block_idx);
    for (var lane = 0u; lane < 8u; lane++) {
        let point = block_point(block, lane, query_ray.origin);
        if point.radius <= 0.0 {
            continue;
        }
        let distance = intersect_shape(point, query_ray);
        let is_in_range = 0.0 <= distance && distance <= query_ray.t_max;
        if is_in_range && accepts_hit(query_ray, distance, 8u * block_idx + lane) {
            has_hit = true;
            return true;
        }
    }
    return false;
}
