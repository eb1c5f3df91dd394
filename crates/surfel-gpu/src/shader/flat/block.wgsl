// Leaf blocks of eight points, quantised relative to their common lower corner.

// The corner of a block and the steps of its positions and radii.
struct BlockHead {
    corner: vec3<f32>,
    step: f32,
    radius_step: f32,
}

// A point relative to the position for which its block was decoded.
struct Point {
    center: vec3<f32>,
    // Integer components.
    normal: vec3<f32>,
    // 0 in unused lanes.
    radius: f32,
}

// Four points of a block, one in each component, relative to the position for which they were decoded.
struct FourPoints {
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
    // Integer components.
    normal_x: vec4<f32>,
    normal_y: vec4<f32>,
    normal_z: vec4<f32>,
    // 0 in unused lanes.
    radius: vec4<f32>,
}

struct Surfel {
    center: vec3<f32>,
    normal: vec3<f32>,
    radius: f32,
    color: vec3<f32>,
}

// Vectors of four words that a block takes in `blocks`: corner and steps, positions by axis, normals, radii and colours.
const BLOCK_VECTORS: u32 = 8u;
// Indices of the first word of the positions, the normals and the radii.
const POSITION_WORDS: u32 = 4u;
const NORMAL_WORDS: u32 = 16u;
const RADIUS_WORDS: u32 = 24u;

fn load_head(block_idx: u32) -> BlockHead {
    let head = block_vector(block_idx * BLOCK_VECTORS);
    let step = bitcast<f32>((head.w & 0xffu) << 23u);
    return BlockHead(bitcast<vec3<f32>>(head.xyz), step, bitcast<f32>(head.w & 0xffffff00u));
}

fn word_of_block(block_idx: u32, word_idx: u32) -> u32 {
    return block_word(block_idx * (4u * BLOCK_VECTORS) + word_idx);
}

// Returns the lower or the upper four points of a block relative to `origin`.
fn four_points(block_idx: u32, head: BlockHead, half: u32, origin: vec3<f32>) -> FourPoints {
    let first = block_idx * BLOCK_VECTORS;
    let corner = head.corner - origin;
    let words = block_vector(first + 4u + half);
    let radii = word_of_block(block_idx, RADIUS_WORDS + half);
    let normals = bitcast<vec4<i32>>(words);
    return FourPoints(
        four_steps(block_vector(first + 1u), half) * head.step + corner.x,
        four_steps(block_vector(first + 2u), half) * head.step + corner.y,
        four_steps(block_vector(first + 3u), half) * head.step + corner.z,
        vec4<f32>((normals << vec4<u32>(22u)) >> vec4<u32>(22u)),
        vec4<f32>((normals << vec4<u32>(12u)) >> vec4<u32>(22u)),
        vec4<f32>((normals << vec4<u32>(2u)) >> vec4<u32>(22u)),
        (bytes_of(radii) + vec4<f32>((words >> vec4<u32>(30u)) << vec4<u32>(8u))) * head.radius_step,
    );
}

// Returns four of the eight positions along one axis, in steps.
fn four_steps(words: vec4<u32>, half: u32) -> vec4<f32> {
    let pairs = select(words.xy, words.zw, half == 1u);
    return vec4<f32>((pairs.xxyy >> vec4<u32>(0u, 16u, 0u, 16u)) & vec4<u32>(0xffffu));
}

fn point_of_four(four: FourPoints, lane: u32) -> Point {
    return Point(
        vec3<f32>(four.x[lane], four.y[lane], four.z[lane]),
        vec3<f32>(four.normal_x[lane], four.normal_y[lane], four.normal_z[lane]),
        four.radius[lane],
    );
}

// The words of a block's points, for kernels that visit several of them.
struct BlockPoints {
    // With the corner relative to the position for which the block was loaded.
    head: BlockHead,
    x: vec4<u32>,
    y: vec4<u32>,
    z: vec4<u32>,
    lower_normals: vec4<u32>,
    upper_normals: vec4<u32>,
    radii: vec2<u32>,
}

// Loads the points of a block relative to `origin`.
fn load_points(block_idx: u32, origin: vec3<f32>) -> BlockPoints {
    let first = block_idx * BLOCK_VECTORS;
    let head = load_head(block_idx);
    return BlockPoints(
        BlockHead(head.corner - origin, head.step, head.radius_step),
        block_vector(first + 1u),
        block_vector(first + 2u),
        block_vector(first + 3u),
        block_vector(first + 4u),
        block_vector(first + 5u),
        block_vector(first + 6u).xy,
    );
}

// Returns the lanes of the points that are nearer to the origin than the square root of `max_squared`, as bits.
fn lanes_within(points: BlockPoints, max_squared: f32) -> u32 {
    var lanes = 0u;
    for (var half = 0u; half < 2u; half++) {
        let x = four_steps(points.x, half) * points.head.step + points.head.corner.x;
        let y = four_steps(points.y, half) * points.head.step + points.head.corner.y;
        let z = four_steps(points.z, half) * points.head.step + points.head.corner.z;
        lanes |= lane_bits(x * x + y * y + z * z < vec4<f32>(max_squared)) << (4u * half);
    }
    return lanes;
}

// Returns the point in `lane`.
fn point_at(points: BlockPoints, lane: u32) -> Point {
    let pair = lane >> 1u;
    let words = vec3<u32>(component(points.x, pair), component(points.y, pair), component(points.z, pair));
    let steps = (words >> vec3<u32>(16u * (lane & 1u))) & vec3<u32>(0xffffu);
    let is_upper = 4u <= lane;
    let normal = component(select(points.lower_normals, points.upper_normals, is_upper), lane & 3u);
    let radius = (select(points.radii.x, points.radii.y, is_upper) >> (8u * (lane & 3u))) & 0xffu;
    return decoded_point(points.head, steps, normal, radius);
}

// Returns the point with these steps of its position, word of its normal and lower byte of its radius.
fn decoded_point(head: BlockHead, steps: vec3<u32>, normal: u32, radius: u32) -> Point {
    return Point(
        head.corner + vec3<f32>(steps) * head.step,
        integer_normal(normal),
        f32(radius + ((normal >> 30u) << 8u)) * head.radius_step,
    );
}

// Returns a component of a vector. Indexing by a variable would keep the vector in memory.
fn component(vector: vec4<u32>, i: u32) -> u32 {
    let pair = select(vector.xy, vector.zw, 2u <= i);
    return select(pair.x, pair.y, (i & 1u) == 1u);
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
    let word = word_of_block(slot >> 3u, RADIUS_WORDS + 2u + (byte_idx >> 2u));
    let encoded = (word >> (8u * (byte_idx & 3u))) & 0xffu;
    return tables.srgb[encoded >> 2u][encoded & 3u];
}

// Returns the point at `slot` relative to `origin`. The corner is subtracted first, so that rounding errors are
// proportional to the distance from `origin`.
fn slot_point(slot: u32, origin: vec3<f32>) -> Point {
    let block_idx = slot >> 3u;
    let lane = slot & 7u;
    let head = load_head(block_idx);
    let pair = POSITION_WORDS + (lane >> 1u);
    let words = vec3<u32>(
        word_of_block(block_idx, pair),
        word_of_block(block_idx, pair + 4u),
        word_of_block(block_idx, pair + 8u),
    );
    let steps = (words >> vec3<u32>(16u * (lane & 1u))) & vec3<u32>(0xffffu);
    let normal = word_of_block(block_idx, NORMAL_WORDS + lane);
    let radius = (word_of_block(block_idx, RADIUS_WORDS + (lane >> 2u)) >> (8u * (lane & 3u))) & 0xffu;
    return decoded_point(BlockHead(head.corner - origin, head.step, head.radius_step), steps, normal, radius);
}

fn slot_surfel(slot: u32) -> Surfel {
    let point = slot_point(slot, vec3<f32>(0.0));
    return Surfel(point.center, normalize(point.normal), point.radius, slot_color(slot));
}
