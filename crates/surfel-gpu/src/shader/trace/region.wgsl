// Queries for the blocks that overlap a box.

// Maximum number of blocks in the list.
const MAX_LISTED: u32 = 32u;

// The blocks that overlap the listed box, or as many of them as the list holds. Blocks are listed before their points are
// visited, so that the invocations of a group do the same work at the same time, and so that later queries find them.
var<private> listed_blocks: array<u32, MAX_LISTED>;
var<private> n_listed: u32;
var<private> listed_low: vec3<f32>;
var<private> listed_high: vec3<f32>;
// True if the list has all blocks that overlap the listed box.
var<private> is_complete: bool;
// The node at which the walk goes on, NONE at its end.
var<private> next_in_region: u32;

// Child nodes that wait to be visited: the index of their first sibling, and their lanes as bits.
var<private> waiting_in_region: array<vec2<u32>, MAX_DEPTH>;
var<private> n_waiting_in_region: u32;

// Lists every block whose box overlaps the box from `low` to `high`, and perhaps others near it. Those within `margin`
// around it are listed, too, where another query is expected. The list may need several parts: after the first,
// `list_more` gives the others.
fn list_blocks(low: vec3<f32>, high: vec3<f32>, margin: f32) {
    if is_complete && all(listed_low <= low) && all(high <= listed_high) {
        return;
    }
    listed_low = low - margin;
    listed_high = high + margin;
    n_waiting_in_region = 0u;
    next_in_region = 0u;
    is_complete = list_part();
}

// Lists the next part of the blocks. Returns false if there is none.
fn list_more() -> bool {
    if next_in_region == NONE {
        return false;
    }
    _ = list_part();
    return true;
}

// Lists blocks as long as the list has room for those of another node. Returns true at the end of the walk.
fn list_part() -> bool {
    let low = listed_low;
    let high = listed_high;
    var node_idx = next_in_region;
    var n_waiting = n_waiting_in_region;
    var n = 0u;
    loop {
        let node = load_node(node_idx);
        let lanes = overlapping_children(node, low, high);
        let nodes = lanes & ((1u << n_child_nodes(node)) - 1u);
        for (var blocks = lanes ^ nodes; blocks != 0u; blocks &= blocks - 1u) {
            listed_blocks[n] = child_block(node, firstTrailingBit(blocks));
            n += 1u;
        }
        if nodes != 0u && n_waiting < MAX_DEPTH {
            waiting_in_region[n_waiting] = vec2<u32>(node.first_node, nodes);
            n_waiting += 1u;
        }
        if n_waiting == 0u {
            node_idx = NONE;
            break;
        }
        let siblings = waiting_in_region[n_waiting - 1u];
        node_idx = siblings.x + firstTrailingBit(siblings.y);
        let rest = siblings.y & (siblings.y - 1u);
        waiting_in_region[n_waiting - 1u].y = rest;
        n_waiting -= select(0u, 1u, rest == 0u);
        if MAX_LISTED - 8u < n {
            break;
        }
    }
    n_listed = n;
    n_waiting_in_region = n_waiting;
    next_in_region = node_idx;
    return node_idx == NONE;
}
