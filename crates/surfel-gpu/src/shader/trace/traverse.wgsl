// The way of one ray through a tree, nearest child first. It can be interrupted and continued.

// Children that wait to be visited, siblings together: the index of their first sibling, their lanes in the order of
// distance with three bits each below their number, and the least of their distances.
var<private> waiting: array<vec3<u32>, MAX_DEPTH>;
var<private> n_waiting: u32;
const COUNT_SHIFT: u32 = 24u;

// Index of the root.
var<private> root_node: u32;

// The ray, and the node that it visits.
var<private> slabs: SlabRay;
var<private> visited_node: u32;
// Children of this node that are still to be visited, if the way was interrupted.
var<private> visited_keys: ChildKeys;
var<private> is_interrupted: bool;
// Lanes of its child nodes in the order of distance, their number, and the keys of the first two.
var<private> ahead_lanes: u32;
var<private> n_ahead: u32;
var<private> first_ahead: u32;
var<private> second_ahead: u32;

// Calls `visit_block` for the blocks whose boxes the ray enters before `search_limit()`, until it returns true.
fn traverse(ray: Ray) {
    start_traversal(ray);
    _ = continue_traversal();
}

fn start_traversal(ray: Ray) {
    slabs = slab_ray(load_node(root_node), ray);
    n_waiting = 0u;
    visited_node = root_node;
    is_interrupted = false;
}

// Goes on until `visit_block` returns true. Returns false at the end of the way.
fn continue_traversal() -> bool {
    loop {
        let node = load_node(visited_node);
        if !is_interrupted {
            visited_keys = entered_children(node, slabs, search_limit());
            ahead_lanes = 0u;
            n_ahead = 0u;
        }
        is_interrupted = visit_children(node);
        if is_interrupted {
            return true;
        }
        if n_ahead != 0u && !is_behind_limit(first_ahead) {
            if n_ahead != 1u && n_waiting < MAX_DEPTH {
                let rest = (ahead_lanes >> 3u) | ((n_ahead - 1u) << COUNT_SHIFT);
                waiting[n_waiting] = vec3<u32>(node.first_node, rest, second_ahead);
                n_waiting += 1u;
            }
            visited_node = node.first_node + (ahead_lanes & LANE_MASK);
        } else if !take_waiting() {
            return false;
        }
    }
    return false;
}

// Visits the blocks among the children of a node and notes the nodes among them. Returns true if a block interrupts.
fn visit_children(node: Node) -> bool {
    let n_nodes = n_child_nodes(node);
    loop {
        let key = nearest_key(visited_keys);
        if key == NO_CHILD {
            return false;
        }
        visited_keys = without_key(visited_keys, key);
        let lane = key & LANE_MASK;
        if n_nodes <= lane {
            if is_behind_limit(key) {
                return false;
            }
            if visit_block(child_block(node, lane)) {
                return true;
            }
            continue;
        }
        ahead_lanes |= lane << (3u * n_ahead);
        first_ahead = select(first_ahead, key, n_ahead == 0u);
        second_ahead = select(second_ahead, key, n_ahead == 1u);
        n_ahead += 1u;
    }
    return false;
}

// Goes to the next child that waits. Returns false if there is none.
fn take_waiting() -> bool {
    loop {
        if n_waiting == 0u {
            return false;
        }
        n_waiting -= 1u;
        if !is_behind_limit(waiting[n_waiting].z) {
            break;
        }
    }
    let siblings = waiting[n_waiting];
    visited_node = siblings.x + (siblings.y & LANE_MASK);
    let n_left = (siblings.y >> COUNT_SHIFT) - 1u;
    if n_left != 0u {
        let rest = (siblings.y & ((1u << COUNT_SHIFT) - 1u)) >> 3u;
        waiting[n_waiting].y = rest | (n_left << COUNT_SHIFT);
        n_waiting += 1u;
    }
    return true;
}

// Returns true if a child is entered beyond the limit of the search.
fn is_behind_limit(key: u32) -> bool {
    return search_limit() < bitcast<f32>(key & ~LANE_MASK);
}
