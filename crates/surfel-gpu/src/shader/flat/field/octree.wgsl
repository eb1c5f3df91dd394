// Octrees whose cells hold the surface, which follow the nodes of the points' tree.

// The cube of a node.
struct CellCube {
    // Lower corner.
    low: vec3<f32>,
    size: f32,
}

struct OctreeNode {
    first_child: u32,
    // Index of the node's cell plus one, 0 if it has none.
    cell: u32,
    // A bit for each child that there is.
    children: u32,
    // True if the cell is as fine as the points there.
    is_finest: bool,
}

// The field at the corners of a cell.
struct CellCorners {
    // Values of the field in steps.
    values: array<f32, 8>,
    // Normals, 127 long.
    normals: array<vec3<f32>, 8>,
    // Slot of the point nearest to the middle.
    slot: u32,
}

// Returns the cube of the root, which has no size without a surface.
fn octree_cube() -> CellCube {
    let words = bitcast<vec4<f32>>(node_vector(visits[visit_idx].first_vector));
    return CellCube(words.xyz, words.w);
}

fn octree_node(node_idx: u32) -> OctreeNode {
    let words = node_vector(visits[visit_idx].first_vector + OCTREE_HEAD_VECTORS + node_idx);
    return OctreeNode(words.x, words.y, words.z & 0xffu, (words.z >> 8u) == 1u);
}

// Returns a vector of four words of a cell.
fn cell_vector(cell_idx: u32, n_vectors: u32, offset: u32) -> vec4<u32> {
    let first = visits[visit_idx].first_vector;
    return node_vector(first + node_vector(first + 1u).x + n_vectors * cell_idx + offset);
}

// Returns the unit normal of the plane of a cell, and the height of the cell's middle above it.
fn cell_plane(cell_idx: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(cell_vector(cell_idx, PLANE_VECTORS, 0u));
}

fn plane_slot(cell_idx: u32) -> u32 {
    return cell_vector(cell_idx, PLANE_VECTORS, 1u).x;
}

fn cell_corners(cell_idx: u32) -> CellCorners {
    var corners: CellCorners;
    let values = cell_vector(cell_idx, CORNER_CELL_VECTORS, 0u);
    let normals = array<vec4<u32>, 2>(
        cell_vector(cell_idx, CORNER_CELL_VECTORS, 1u),
        cell_vector(cell_idx, CORNER_CELL_VECTORS, 2u),
    );
    for (var i = 0u; i < 8u; i++) {
        corners.values[i] = f32(signed_bits(values[i >> 1u], 16u * (i & 1u), 16u));
        for (var axis = 0u; axis < 3u; axis++) {
            let byte_idx = 3u * i + axis;
            let word = normals[byte_idx >> 4u][(byte_idx >> 2u) & 3u];
            corners.normals[i][axis] = f32(signed_bits(word, 8u * (byte_idx & 3u), 8u));
        }
    }
    corners.slot = normals[1].z;
    return corners;
}

// Returns the signed number in some bits of a word.
fn signed_bits(word: u32, first: u32, n_bits: u32) -> i32 {
    return extractBits(bitcast<i32>(word), first, n_bits);
}
