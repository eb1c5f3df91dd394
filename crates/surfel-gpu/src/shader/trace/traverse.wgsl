// The way of one ray through a tree, nearest child first.

// Nodes some of whose children wait to be visited: the index of the node, and the lanes of these children. The boxes
// are tested again when their turn comes, as the ray may have become shorter.
var<private> waiting: array<vec2<u32>, MAX_DEPTH>;

// Index of the root.
var<private> root_node: u32;

// Calls `visit_block` for the blocks whose boxes the ray enters before `search_limit()`, until it returns true.
fn traverse(ray: Ray) {
    let slabs = slab_ray(load_node(root_node), ray);
    var n_waiting = 0u;
    var node_idx = root_node;
    var open = 0xffu;
    loop {
        let node = load_node(node_idx);
        let step = node_step(node);
        let n_nodes = n_child_nodes(node);
        open &= (1u << n_children(node)) - 1u;
        var nodes_ahead = 0u;
        var blocks_ahead = 0u;
        var nearest = 3e38;
        var nearest_lane = 0u;
        while open != 0u {
            let lane = firstTrailingBit(open);
            open &= open - 1u;
            let entry = enter_child(node, step, lane, slabs, search_limit());
            if entry < 0.0 {
                continue;
            }
            if n_nodes <= lane {
                blocks_ahead |= 1u << lane;
                continue;
            }
            nodes_ahead |= 1u << lane;
            if entry < nearest {
                nearest = entry;
                nearest_lane = lane;
            }
        }
        while blocks_ahead != 0u {
            let lane = firstTrailingBit(blocks_ahead);
            blocks_ahead &= blocks_ahead - 1u;
            if visit_block(child_block(node, lane)) {
                return;
            }
        }
        if nodes_ahead != 0u {
            nodes_ahead &= ~(1u << nearest_lane);
            if nodes_ahead != 0u && n_waiting < MAX_DEPTH {
                waiting[n_waiting] = vec2<u32>(node_idx, nodes_ahead);
                n_waiting += 1u;
            }
            node_idx = node.first_node + nearest_lane;
            open = 0xffu;
            continue;
        }
        if n_waiting == 0u {
            return;
        }
        n_waiting -= 1u;
        node_idx = waiting[n_waiting].x;
        open = waiting[n_waiting].y;
    }
}
