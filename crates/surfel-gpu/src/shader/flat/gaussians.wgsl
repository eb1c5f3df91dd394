// Leaf blocks of eight trained Gaussians, each followed by the coefficients of their colours.

// Four Gaussians of a block, one in each component, relative to the origin of a ray.
struct FourGaussians {
    center: array<vec4<f32>, 3>,
    // Rows of the matrices to coordinates in which all deviations are 1, axis by axis.
    rows: array<vec4<f32>, 9>,
    // Squares of the distances at which the Gaussians end, in deviations; below 0 in unused lanes.
    max_squared: vec4<f32>,
}

// Vectors of four words that the Gaussians of a block take.
const GAUSSIAN_VECTORS: u32 = 26u;

fn gaussian_vector(block_idx: u32, offset: u32) -> vec4<u32> {
    return block_vector(visits[visit_idx].first_vector + block_idx * visits[visit_idx].block_vectors + offset);
}

// Returns the first or the second four Gaussians of a block.
fn load_gaussians(block_idx: u32, half: u32, origin: vec3<f32>) -> FourGaussians {
    var four: FourGaussians;
    for (var axis = 0u; axis < 3u; axis++) {
        four.center[axis] = bitcast<vec4<f32>>(gaussian_vector(block_idx, 2u * axis + half)) - origin[axis];
    }
    for (var i = 0u; i < 9u; i++) {
        four.rows[i] = bitcast<vec4<f32>>(gaussian_vector(block_idx, 6u + 2u * i + half));
    }
    four.max_squared = bitcast<vec4<f32>>(gaussian_vector(block_idx, 24u + half));
    return four;
}

// Returns the square of the distance from its centre at which the Gaussian at `slot` ends.
fn slot_max_squared(slot: u32) -> f32 {
    return bitcast<f32>(gaussian_vector(slot >> 3u, 24u + ((slot >> 2u) & 1u))[slot & 3u]);
}

// Returns a row of the matrix of the Gaussian at `slot`.
fn slot_row(slot: u32, row: u32) -> vec3<f32> {
    let half = (slot >> 2u) & 1u;
    let lane = slot & 3u;
    let first = 6u + 6u * row + half;
    let x = gaussian_vector(slot >> 3u, first)[lane];
    let y = gaussian_vector(slot >> 3u, first + 2u)[lane];
    let z = gaussian_vector(slot >> 3u, first + 4u)[lane];
    return bitcast<vec3<f32>>(vec3<u32>(x, y, z));
}

// Returns the coefficient at an index among those of the Gaussian at `slot`.
fn coefficient(slot: u32, idx: u32) -> f32 {
    let half = (slot & 7u) * 3u * visits[visit_idx].n_harmonics + idx;
    let vector = gaussian_vector(slot >> 3u, GAUSSIAN_VECTORS + (half >> 3u));
    let bits = (vector[(half >> 1u) & 3u] >> (16u * (half & 1u))) & 0xffffu;
    // The exponent of a 16-bit float is 112 less than that of a 32-bit float.
    let magnitude = bitcast<f32>((bits & 0x7fffu) << 13u) * 5.192296858534828e33;
    return select(magnitude, -magnitude, (bits & 0x8000u) != 0u);
}
