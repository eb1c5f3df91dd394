// Leaf blocks of eight triangles with the attributes of their vertices.

// Attributes that a mesh may have, as bits.
const HAS_NORMALS: u32 = 1u;
const HAS_COLORS_OF_VERTICES: u32 = 2u;
// Vectors of four words that the corners and indices of a block, its normals and its colours take.
const CORNER_VECTORS: u32 = 20u;
const NORMAL_VECTORS: u32 = 18u;

// Returns the corners of the triangle at `slot`.
fn slot_corners(slot: u32) -> array<vec3<f32>, 3> {
    return array<vec3<f32>, 3>(slot_vector(slot, 0u, 0u), slot_vector(slot, 0u, 1u), slot_vector(slot, 0u, 2u));
}

// Returns a vector of a corner of the triangle at `slot`: values are stored by corner, axis and lane from `offset` on.
fn slot_vector(slot: u32, offset: u32, corner: u32) -> vec3<f32> {
    return vec3<f32>(
        slot_value(slot, offset, 3u * corner),
        slot_value(slot, offset, 3u * corner + 1u),
        slot_value(slot, offset, 3u * corner + 2u),
    );
}

fn slot_value(slot: u32, offset: u32, row: u32) -> f32 {
    let lane = slot & 7u;
    let vector = (slot >> 3u) * visit.block_vectors + offset + 2u * row + (lane >> 2u);
    return bitcast<f32>(blocks[vector][lane & 3u]);
}

// Returns a column of vertices at barycentric coordinates of the triangle at `slot`.
fn interpolate(slot: u32, offset: u32, weights: vec3<f32>) -> vec3<f32> {
    return weights.x * slot_vector(slot, offset, 0u)
        + weights.y * slot_vector(slot, offset, 1u)
        + weights.z * slot_vector(slot, offset, 2u);
}
