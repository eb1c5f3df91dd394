// Rays toward lights that share the tests of their hits.

// Number of hits that a workgroup tests in a round, apart from those in the same blocks.
const NOTED_PER_ROUND: u32 = 2u * WORKGROUP_SIZE;
const MAX_NOTED: u32 = NOTED_PER_ROUND + 8u * WORKGROUP_SIZE;

var<workgroup> is_blocked: array<atomic<u32>, WORKGROUP_SIZE>;

struct Search {
    ray: Ray,
    // Number of hits that the ray may still note in this round.
    n_allowed: u32,
}

// Searches until each ray of the workgroup is blocked or has reached its end. Returns true if the own ray is blocked.
fn is_blocked_in_group(ray: Ray, starts: bool, local_idx: u32) -> bool {
    own_idx = local_idx;
    group_rays[own_idx] = ray;
    atomicStore(&is_blocked[own_idx], 0u);
    var is_searching = starts;
    var search = Search(ray, 0u);
    var traversal = start_traversal(ray);
    loop {
        let n_rays = begin_round(is_searching);
        if n_rays == 0u {
            break;
        }
        search.n_allowed = max(NOTED_PER_ROUND / n_rays, 1u);
        if is_searching {
            is_searching = continue_traversal(&traversal, &search);
        }
        workgroupBarrier();
        test_hits();
        workgroupBarrier();
        is_searching = is_searching && atomicLoad(&is_blocked[own_idx]) == 0u;
    }
    return atomicLoad(&is_blocked[own_idx]) == 1u;
}

fn test_hits() {
    let n = atomicLoad(&n_noted);
    for (var i = own_idx; i < n; i += WORKGROUP_SIZE) {
        let ray_idx = noted_rays[i];
        if atomicLoad(&is_blocked[ray_idx]) == 0u && accepts_hit(group_rays[ray_idx], noted_distances[i], noted_slots[i]) {
            atomicStore(&is_blocked[ray_idx], 1u);
        }
    }
}

fn search_limit(search: ptr<function, Search>) -> f32 {
    return (*search).ray.t_max;
}

// Interrupts the search once the ray has noted as many hits as it may.
fn visit_block(block_idx: u32, search: ptr<function, Search>) -> bool {
    let ray = (*search).ray;
    var n_allowed = (*search).n_allowed;
    let head = load_head(block_idx);
    for (var half = 0u; half < 2u; half++) {
        let distances = intersect_four(four_points(block_idx, head, half, ray.origin), ray);
        let is_in_range = (vec4<f32>(0.0) <= distances) & (distances <= vec4<f32>(ray.t_max));
        for (var lanes = lane_bits(is_in_range); lanes != 0u; lanes &= lanes - 1u) {
            let lane = firstTrailingBit(lanes);
            note_hit(distances[lane], 8u * block_idx + 4u * half + lane);
            n_allowed = max(n_allowed, 1u) - 1u;
        }
    }
    (*search).n_allowed = n_allowed;
    return n_allowed == 0u;
}
