// The kd-tree over the field of weighted planes, which follows the nodes of the points' tree.

// A node: a plane between two children, or a leaf.
struct KdNode {
    // Coordinate of the plane.
    split: f32,
    // The axis, or 3 for a leaf.
    axis: u32,
    // Index of the first child, or that of the leaf plus one; 0 for an empty leaf.
    idx: u32,
}

// Points of a leaf in a block of the points' tree.
struct LeafEntry {
    block_idx: u32,
    // The lanes of the points that have weight in the leaf.
    lanes: u32,
    // The lanes of the points whose normal is turned around.
    flips: u32,
}

fn kd_low() -> vec3<f32> {
    return bitcast<vec3<f32>>(node_vector(visits[visit_idx].first_vector).xyz);
}

fn kd_high() -> vec3<f32> {
    return bitcast<vec3<f32>>(node_vector(visits[visit_idx].first_vector + 1u).xyz);
}

fn kd_node(node_idx: u32) -> KdNode {
    let vector = node_vector(visits[visit_idx].first_vector + KD_HEAD_VECTORS + (node_idx >> 1u));
    let words = select(vector.xy, vector.zw, (node_idx & 1u) == 1u);
    return KdNode(bitcast<f32>(words.x), words.y & 3u, words.y >> 2u);
}

// Returns the index of the first entry of a leaf, which is the end of the leaf before.
fn leaf_start(leaf_idx: u32) -> u32 {
    let first = visits[visit_idx].first_vector;
    return node_vector(first + node_vector(first + 2u).x + (leaf_idx >> 2u))[leaf_idx & 3u];
}

fn leaf_entry(entry_idx: u32) -> LeafEntry {
    let first = visits[visit_idx].first_vector;
    let vector = node_vector(first + node_vector(first + 2u).y + (entry_idx >> 1u));
    let words = select(vector.xy, vector.zw, (entry_idx & 1u) == 1u);
    return LeafEntry(words.x, words.y & 0xffu, words.y >> 8u);
}
