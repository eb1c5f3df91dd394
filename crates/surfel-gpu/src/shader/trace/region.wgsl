// Queries for the blocks that overlap a box.

// Maximum number of blocks in the list.
const MAX_LISTED: u32 = 32u;

// The blocks that overlap the listed box, or as many of them as the list holds. Blocks are listed before they are visited,
// so that the invocations of a group do the same work at the same time, and so that later queries find them.
var<private> listed_blocks: array<u32, MAX_LISTED>;
var<private> n_listed: u32;
var<private> listed_low: vec3<f32>;
var<private> listed_high: vec3<f32>;
// True if the list has all blocks that overlap the listed box.
var<private> is_listed: bool;

// Child nodes that wait to be visited: the index of their first sibling, and their lanes as bits.
var<private> waiting_in_region: array<vec2<u32>, MAX_DEPTH>;
var<private> n_waiting_in_region: u32;

// Calls `visit_region_block` for every block whose box overlaps the box from `low` to `high`, and for some of the blocks
// within `margin` around it, which are listed for the next query.
fn query_box(low: vec3<f32>, high: vec3<f32>, margin: f32) {
    if is_listed && all(listed_low <= low) && all(high <= listed_high) {
        visit_listed();
        return;
    }
    listed_low = low - margin;
    listed_high = high + margin;
    n_waiting_in_region = 0u;
    var node_idx = list_blocks(0u);
    is_listed = node_idx == NONE;
    visit_listed();
    while node_idx != NONE {
        node_idx = list_blocks(node_idx);
        visit_listed();
    }
}

fn visit_listed() {
    for (var i = 0u; i < n_listed; i++) {
        visit_region_block(listed_blocks[i]);
    }
}

// Lists the blocks below a node and below the nodes that wait, as long as the list has room for those of another node.
// Returns the index of the next node, NONE if there is none.
fn list_blocks(first_node_idx: u32) -> u32 {
    var node_idx = first_node_idx;
    n_listed = 0u;
    loop {
        let node = load_node(node_idx);
        let lanes = overlapping_children(node, listed_low, listed_high);
        let nodes = lanes & ((1u << n_child_nodes(node)) - 1u);
        var lanes_of_blocks = lanes ^ nodes;
        while lanes_of_blocks != 0u {
            let lane = firstTrailingBit(lanes_of_blocks);
            lanes_of_blocks &= lanes_of_blocks - 1u;
            listed_blocks[n_listed] = child_block(node, lane);
            n_listed += 1u;
        }
        if nodes != 0u && n_waiting_in_region < MAX_DEPTH {
            waiting_in_region[n_waiting_in_region] = vec2<u32>(node.first_node, nodes);
            n_waiting_in_region += 1u;
        }
        if n_waiting_in_region == 0u {
            return NONE;
        }
        n_waiting_in_region -= 1u;
        let siblings = waiting_in_region[n_waiting_in_region];
        node_idx = siblings.x + firstTrailingBit(siblings.y);
        let rest = siblings.y & (siblings.y - 1u);
        if rest != 0u {
            waiting_in_region[n_waiting_in_region].y = rest;
            n_waiting_in_region += 1u;
        }
        if MAX_LISTED - 8u < n_listed {
            return node_idx;
        }
    }
    return NONE;
}
