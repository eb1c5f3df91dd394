// The traversal of a tree by one ray, nearest child first. It can be interrupted and continued.

// Children that wait to be visited, siblings together: the index of their first sibling, their lanes in the order of
// distance with three bits each below their number, and the least of their distances.
var<private> waiting: array<vec3<u32>, MAX_DEPTH>;
const COUNT_SHIFT: u32 = 24u;

// Index of the root.
var<private> root_node: u32;

// The state of a traversal. What searches keep in variables of functions stays in registers.
struct Traversal {
    slabs: SlabRay,
    node_idx: u32,
    n_waiting: u32,
    // Children of the node that are still to be visited, if the traversal was interrupted there.
    keys: ChildKeys,
    is_interrupted: bool,
    // Lanes of its child nodes in the order of distance, their number, and the keys of the first two.
    lanes_ahead: u32,
    n_ahead: u32,
    first_ahead: u32,
    second_ahead: u32,
}

// Calls `visit_block` for the blocks whose boxes the ray enters before `search_limit`, until it returns true. Each query
// has a structure `Search` of its own, which both take.
fn traverse(ray: Ray, search: ptr<function, Search>) {
    var traversal = start_traversal(ray);
    _ = continue_traversal(&traversal, search);
}

fn start_traversal(ray: Ray) -> Traversal {
    var traversal: Traversal;
    traversal.slabs = slab_ray(load_node(root_node), ray);
    traversal.node_idx = root_node;
    return traversal;
}

// Goes on until `visit_block` returns true. Returns false at the end of the way.
fn continue_traversal(traversal: ptr<function, Traversal>, search: ptr<function, Search>) -> bool {
    loop {
        let node = load_node((*traversal).node_idx);
        if !(*traversal).is_interrupted {
            (*traversal).keys = entered_children(node, (*traversal).slabs, search_limit(search));
            (*traversal).lanes_ahead = 0u;
            (*traversal).n_ahead = 0u;
        }
        (*traversal).is_interrupted = visit_children(node, traversal, search);
        if (*traversal).is_interrupted {
            return true;
        }
        let n_ahead = (*traversal).n_ahead;
        if n_ahead != 0u && key_distance((*traversal).first_ahead) <= search_limit(search) {
            let lanes = (*traversal).lanes_ahead;
            let n_waiting = (*traversal).n_waiting;
            if n_ahead != 1u && n_waiting < MAX_DEPTH {
                let rest = (lanes >> 3u) | ((n_ahead - 1u) << COUNT_SHIFT);
                waiting[n_waiting] = vec3<u32>(node.first_node, rest, (*traversal).second_ahead);
                (*traversal).n_waiting = n_waiting + 1u;
            }
            (*traversal).node_idx = node.first_node + (lanes & LANE_MASK);
        } else if !take_waiting(traversal, search_limit(search)) {
            return false;
        }
    }
    return false;
}

// Visits the blocks among the children of a node and notes the nodes among them. Returns true if a block interrupts.
fn visit_children(node: Node, traversal: ptr<function, Traversal>, search: ptr<function, Search>) -> bool {
    let n_nodes = n_child_nodes(node);
    loop {
        let key = nearest_key((*traversal).keys);
        if key == NO_CHILD {
            return false;
        }
        (*traversal).keys = without_key((*traversal).keys, key);
        let lane = key & LANE_MASK;
        if n_nodes <= lane {
            if search_limit(search) < key_distance(key) {
                return false;
            }
            if visit_block(child_block(node, lane), search) {
                return true;
            }
            continue;
        }
        let n_ahead = (*traversal).n_ahead;
        (*traversal).lanes_ahead |= lane << (3u * n_ahead);
        (*traversal).first_ahead = select((*traversal).first_ahead, key, n_ahead == 0u);
        (*traversal).second_ahead = select((*traversal).second_ahead, key, n_ahead == 1u);
        (*traversal).n_ahead = n_ahead + 1u;
    }
    return false;
}

// Goes to the next child that waits and is not beyond the limit of the search. Returns false if there is none.
fn take_waiting(traversal: ptr<function, Traversal>, limit: f32) -> bool {
    var n_waiting = (*traversal).n_waiting;
    loop {
        if n_waiting == 0u {
            return false;
        }
        n_waiting -= 1u;
        if key_distance(waiting[n_waiting].z) <= limit {
            break;
        }
    }
    let siblings = waiting[n_waiting];
    (*traversal).node_idx = siblings.x + (siblings.y & LANE_MASK);
    let n_left = (siblings.y >> COUNT_SHIFT) - 1u;
    if n_left != 0u {
        let rest = (siblings.y & ((1u << COUNT_SHIFT) - 1u)) >> 3u;
        waiting[n_waiting].y = rest | (n_left << COUNT_SHIFT);
        n_waiting += 1u;
    }
    (*traversal).n_waiting = n_waiting;
    return true;
}

// Returns the distance at which a child is entered.
fn key_distance(key: u32) -> f32 {
    return bitcast<f32>(key & ~LANE_MASK);
}
