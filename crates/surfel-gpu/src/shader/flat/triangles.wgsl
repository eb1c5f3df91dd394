// Leaf blocks of eight triangles with the attributes of their vertices.

// Vectors of four words that the corners and indices of a block take, and one component of the three corners.
const CORNER_VECTORS: u32 = 20u;
const COMPONENT_VECTORS: u32 = 6u;

// Returns the corners of the triangle at `slot`.
fn slot_corners(slot: u32) -> array<vec3<f32>, 3> {
    return array<vec3<f32>, 3>(
        slot_vector(slot, 0u, 3u, 0u).xyz,
        slot_vector(slot, 0u, 3u, 1u).xyz,
        slot_vector(slot, 0u, 3u, 2u).xyz,
    );
}

// Returns a vector of `n` components of a corner of the triangle at `slot`: values are stored by corner, component and
// lane from `offset` on.
fn slot_vector(slot: u32, offset: u32, n: u32, corner: u32) -> vec4<f32> {
    let lane = slot & 7u;
    let first = (slot >> 3u) * visits[visit_idx].block_vectors + offset + 2u * n * corner + (lane >> 2u);
    var vector = vec4<f32>(0.0);
    for (var i = 0u; i < n; i++) {
        vector[i] = bitcast<f32>(block_vector(first + 2u * i)[lane & 3u]);
    }
    return vector;
}

// Returns a column of `n` components of vertices at barycentric coordinates of the triangle at `slot`.
fn interpolate(slot: u32, offset: u32, n: u32, weights: vec3<f32>) -> vec4<f32> {
    return weights.x * slot_vector(slot, offset, n, 0u)
        + weights.y * slot_vector(slot, offset, n, 1u)
        + weights.z * slot_vector(slot, offset, n, 2u);
}

// Returns true if the mesh has a column.
fn has_column(column: u32) -> bool {
    return (visits[visit_idx].attributes & column) != 0u;
}
