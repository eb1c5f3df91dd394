// Leaf blocks of eight points, quantised relative to their common lower corner.

// The words of a block: corner and steps, positions by axis, normals, radii and colours.
struct PointBlock {
    head: vec4<u32>,
    x: vec4<u32>,
    y: vec4<u32>,
    z: vec4<u32>,
    normals: array<vec4<u32>, 2>,
    radii: vec2<u32>,
}

// A point relative to the position for which its block was decoded.
struct Point {
    center: vec3<f32>,
    // Integer components.
    normal: vec3<f32>,
    // 0 in unused lanes.
    radius: f32,
}

struct Surfel {
    center: vec3<f32>,
    normal: vec3<f32>,
    radius: f32,
    color: vec3<f32>,
}

// Vectors of four words that a block takes in `blocks`.
const BLOCK_VECTORS: u32 = 8u;


fn load_block(block_idx: u32) -> PointBlock {
    let first = block_idx * BLOCK_VECTORS;
    return PointBlock(
        block_vector(first),
        block_vector(first + 1u),
        block_vector(first + 2u),
        block_vector(first + 3u),
        array<vec4<u32>, 2>(block_vector(first + 4u), block_vector(first + 5u)),
        block_vector(first + 6u).xy,
    );
}

// Returns the point in `lane` relative to `origin`. The corner is subtracted first, so that rounding errors are
// proportional to the distance from `origin`.
fn block_point(block: PointBlock, lane: u32, origin: vec3<f32>) -> Point {
    let step = bitcast<f32>((block.head.w & 0xffu) << 23u);
    let radius_step = bitcast<f32>(block.head.w & 0xffffff00u);
    let words = vec3<u32>(block.x[lane >> 1u], block.y[lane >> 1u], block.z[lane >> 1u]);
    let steps = (words >> vec3<u32>(16u * (lane & 1u))) & vec3<u32>(0xffffu);
    let normal = block.normals[lane >> 2u][lane & 3u];
    let radius = (block.radii[lane >> 2u] >> (8u * (lane & 3u))) & 0xffu;
    return Point(
        (bitcast<vec3<f32>>(block.head.xyz) - origin) + vec3<f32>(steps) * step,
        integer_normal(normal),
        f32(radius + ((normal >> 30u) << 8u)) * radius_step,
    );
}

fn integer_normal(bits: u32) -> vec3<f32> {
    let word = vec3<i32>(i32(bits));
    return vec3<f32>((word << vec3<u32>(22u, 12u, 2u)) >> vec3<u32>(22u));
}

// Returns the linear colour of the point at `slot`.
fn slot_color(slot: u32) -> vec3<f32> {
    let first = 3u * (slot & 7u);
    return vec3<f32>(color_byte(slot, first), color_byte(slot, first + 1u), color_byte(slot, first + 2u));
}

// Returns a byte of the colours of the block of `slot`, which follow its eight radii, as linear light.
fn color_byte(slot: u32, byte_idx: u32) -> f32 {
    let word = 2u + (byte_idx >> 2u);
    let vector = block_vector((slot >> 3u) * BLOCK_VECTORS + 6u + (word >> 2u));
    let encoded = (vector[word & 3u] >> (8u * (byte_idx & 3u))) & 0xffu;
    return tables.srgb[encoded >> 2u][encoded & 3u];
}

// Returns the point at `slot` in the coordinates of the object.
fn slot_point(slot: u32) -> Point {
    return block_point(load_block(slot >> 3u), slot & 7u, vec3<f32>(0.0));
}

fn slot_surfel(slot: u32) -> Surfel {
    let point = slot_point(slot);
    return Surfel(point.center, normalize(point.normal), point.radius, slot_color(slot));
}
