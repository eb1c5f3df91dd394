// Queries for the blocks that overlap a box.

// Nodes some of whose children wait to be visited, apart from those of a ray that waits for the answer.
var<private> waiting_in_region: array<vec2<u32>, MAX_DEPTH>;

// Calls `visit_region_block` for every block whose box overlaps the box from `low` to `high`.
fn query_box(low: vec3<f32>, high: vec3<f32>) {
    var n_waiting = 0u;
    var node_idx = 0u;
    var open = 0xffu;
    loop {
        let node = load_node(node_idx);
        let step = node_step(node);
        let n_nodes = n_child_nodes(node);
        open &= (1u << n_children(node)) - 1u;
        var nodes_ahead = 0u;
        while open != 0u {
            let lane = firstTrailingBit(open);
            open &= open - 1u;
            let begins = all(lower_bound(node, step, lane) <= high);
            if !(begins && all(low <= upper_bound(node, step, lane))) {
                continue;
            }
            if n_nodes <= lane {
                visit_region_block(child_block(node, lane));
            } else {
                nodes_ahead |= 1u << lane;
            }
        }
        if nodes_ahead == 0u {
            if n_waiting == 0u {
                return;
            }
            n_waiting -= 1u;
            node_idx = waiting_in_region[n_waiting].x;
            nodes_ahead = waiting_in_region[n_waiting].y;
        }
        let lane = firstTrailingBit(nodes_ahead);
        nodes_ahead &= nodes_ahead - 1u;
        let parent = load_node(node_idx);
        if nodes_ahead != 0u && n_waiting < MAX_DEPTH {
            waiting_in_region[n_waiting] = vec2<u32>(node_idx, nodes_ahead);
            n_waiting += 1u;
        }
        node_idx = parent.first_node + lane;
        open = 0xffu;
    }
}
