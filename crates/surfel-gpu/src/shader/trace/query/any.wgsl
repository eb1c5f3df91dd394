// Any hit of a ray on points that are shapes of their own.

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
    let head = load_head(block_idx);
    for (var half = 0u; half < 2u; half++) {
        let distances = intersect_four(four_points(block_idx, head, half, query_ray.origin), query_ray);
        has_hit = has_hit || any((vec4<f32>(0.0) <= distances) & (distances <= vec4<f32>(query_ray.t_max)));
    }
    return has_hit;
}
