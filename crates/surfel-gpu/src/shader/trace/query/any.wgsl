// Any hit of a ray on points that are shapes of their own.

struct Search {
    ray: Ray,
    has_hit: bool,
}

fn is_occluded(ray: Ray) -> bool {
    var search = Search(ray, false);
    traverse(ray, &search);
    return search.has_hit;
}

fn search_limit(search: ptr<function, Search>) -> f32 {
    return (*search).ray.t_max;
}

fn visit_block(block_idx: u32, search: ptr<function, Search>) -> bool {
    let ray = (*search).ray;
    let head = load_head(block_idx);
    var has_hit = false;
    for (var half = 0u; half < 2u; half++) {
        let distances = intersect_four(four_points(block_idx, head, half, ray.origin), ray);
        has_hit = has_hit || any((vec4<f32>(0.0) <= distances) & (distances <= vec4<f32>(ray.t_max)));
    }
    (*search).has_hit = has_hit;
    return has_hit;
}
