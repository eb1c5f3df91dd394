// Any hit of a ray on points that are shapes of their own.

struct AnyHit {
    distance: f32,
    // NONE for a miss.
    slot: u32,
}

struct Search {
    ray: Ray,
    hit: AnyHit,
}

fn is_occluded(ray: Ray) -> bool {
    return any_hit_of(ray).slot != NONE;
}

fn any_hit_of(ray: Ray) -> AnyHit {
    var search = Search(ray, AnyHit(0.0, NONE));
    traverse(ray, &search);
    return search.hit;
}

fn search_limit(search: ptr<function, Search>) -> f32 {
    return (*search).ray.t_max;
}

fn visit_block(block_idx: u32, search: ptr<function, Search>) -> bool {
    let ray = (*search).ray;
    let head = load_head(block_idx);
    for (var half = 0u; half < 2u; half++) {
        let distances = intersect_four(four_points(block_idx, head, half, ray.origin), ray);
        let is_in_range = (vec4<f32>(0.0) <= distances) & (distances <= vec4<f32>(ray.t_max));
        let lanes = lane_bits(is_in_range);
        if lanes != 0u {
            let lane = firstTrailingBit(lanes);
            (*search).hit = AnyHit(distances[lane], 8u * block_idx + 4u * half + lane);
            return true;
        }
    }
    return false;
}
