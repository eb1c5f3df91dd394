// Nodes: the boxes of eight children as bytes on a grid, and the tests of all of them at once.

struct Node {
    origin: vec3<f32>,
    exponents_and_counts: u32,
    first_node: u32,
    lane_zero_as_block: u32,
    // Bounds along the three axes, four lanes a word.
    lower: array<vec3<u32>, 2>,
    upper: array<vec3<u32>, 2>,
}

fn load_node(node_idx: u32) -> Node {
    let first = node_idx * NODE_VECTORS;
    let head = node_vector(first);
    let a = node_vector(first + 1u);
    let b = node_vector(first + 2u);
    let c = node_vector(first + 3u);
    let d = node_vector(first + 4u);
    return Node(
        bitcast<vec3<f32>>(head.xyz),
        head.w,
        a.x,
        a.y,
        array<vec3<u32>, 2>(vec3<u32>(a.z, b.x, b.z), vec3<u32>(a.w, b.y, b.w)),
        array<vec3<u32>, 2>(vec3<u32>(c.x, c.z, d.x), vec3<u32>(c.y, c.w, d.y)),
    );
}

fn n_children(node: Node) -> u32 {
    return (node.exponents_and_counts >> 24u) & 0xfu;
}

fn n_child_nodes(node: Node) -> u32 {
    return node.exponents_and_counts >> 28u;
}

// Returns the index of the block in `lane`, which holds one.
fn child_block(node: Node, lane: u32) -> u32 {
    return (node.lane_zero_as_block + lane) & 0x7fffffffu;
}

// Returns the length of a step along each axis.
fn node_step(node: Node) -> vec3<f32> {
    let exponents = vec3<u32>(node.exponents_and_counts) >> vec3<u32>(0u, 8u, 16u);
    return bitcast<vec3<f32>>((exponents & vec3<u32>(0xffu)) << vec3<u32>(23u));
}

// Returns the bytes of a word, the lowest first.
fn bytes_of(word: u32) -> vec4<f32> {
    return vec4<f32>((vec4<u32>(word) >> vec4<u32>(0u, 8u, 16u, 24u)) & vec4<u32>(0xffu));
}

// Returns a bit for each of four lanes that is true.
fn lane_bits(lanes: vec4<bool>) -> u32 {
    let bits = select(vec4<u32>(0u), vec4<u32>(1u, 2u, 4u, 8u), lanes);
    return bits.x | bits.y | bits.z | bits.w;
}

// A ray prepared for the slab test. Along each axis it meets the nearer plane x of a box at the distance
// (x - `near_origin`) * `inverse`, and the farther one likewise.
struct SlabRay {
    inverse: vec3<f32>,
    is_negative: vec3<bool>,
    near_origin: vec3<f32>,
    far_origin: vec3<f32>,
    t_min: f32,
}

// Prepares a ray for the boxes of the tree below `root`.
fn slab_ray(root: Node, ray: Ray) -> SlabRay {
    let is_small = abs(ray.direction) < vec3<f32>(MIN_DIRECTION);
    let inverse = 1.0 / select(ray.direction, vec3<f32>(MIN_DIRECTION), is_small);
    let is_negative = inverse < vec3<f32>(0.0);
    let step = node_step(root);
    let coordinates = max(abs(root.origin), abs(ray.origin));
    let largest = max(max(coordinates.x, coordinates.y), coordinates.z);
    let slack = ROUNDING * (largest + 256.0 * max(max(step.x, step.y), step.z));
    let toward = select(vec3<f32>(slack), vec3<f32>(-slack), is_negative);
    return SlabRay(inverse, is_negative, ray.origin + toward, ray.origin - toward, ray.t_min);
}

// The children whose boxes a ray enters: the distance of each with the lane in its three lowest bits, so that keys are in
// the order of distances; NO_CHILD for the others.
struct ChildKeys {
    lanes: array<vec4<u32>, 2>,
}

const NO_CHILD: u32 = 0xffffffffu;
const LANE_MASK: u32 = 7u;

// Returns the keys of the children whose boxes a ray enters up to `t_max`.
fn entered_children(node: Node, ray: SlabRay, t_max: f32) -> ChildKeys {
    let scale = node_step(node) * ray.inverse;
    let near = (node.origin - ray.near_origin) * ray.inverse;
    let far = (node.origin - ray.far_origin) * ray.inverse;
    let n = vec4<u32>(n_children(node));
    let range = vec2<f32>(ray.t_min, t_max);
    let lanes = vec4<u32>(0u, 1u, 2u, 3u);
    return ChildKeys(array<vec4<u32>, 2>(
        entered_four(node.lower[0], node.upper[0], ray.is_negative, scale, near, far, range, lanes, n),
        entered_four(node.lower[1], node.upper[1], ray.is_negative, scale, near, far, range, lanes + 4u, n),
    ));
}

fn entered_four(
    lower: vec3<u32>,
    upper: vec3<u32>,
    is_negative: vec3<bool>,
    scale: vec3<f32>,
    near_offset: vec3<f32>,
    far_offset: vec3<f32>,
    range: vec2<f32>,
    lanes: vec4<u32>,
    n_lanes: vec4<u32>,
) -> vec4<u32> {
    let near = select(lower, upper, is_negative);
    let far = select(upper, lower, is_negative);
    let near_x = bytes_of(near.x) * scale.x + near_offset.x;
    let near_y = bytes_of(near.y) * scale.y + near_offset.y;
    let near_z = bytes_of(near.z) * scale.z + near_offset.z;
    let far_x = bytes_of(far.x) * scale.x + far_offset.x;
    let far_y = bytes_of(far.y) * scale.y + far_offset.y;
    let far_z = bytes_of(far.z) * scale.z + far_offset.z;
    let enter = max(max(near_x, near_y), max(near_z, vec4<f32>(range.x)));
    let leave = min(min(far_x, far_y), min(far_z, vec4<f32>(range.y)));
    let is_entered = (enter <= leave) & (lanes < n_lanes);
    let keys = (bitcast<vec4<u32>>(max(enter, vec4<f32>(0.0))) & vec4<u32>(~LANE_MASK)) | lanes;
    return select(vec4<u32>(NO_CHILD), keys, is_entered);
}

// Returns the key of the nearest child.
fn nearest_key(keys: ChildKeys) -> u32 {
    let four = min(keys.lanes[0], keys.lanes[1]);
    return min(min(four.x, four.y), min(four.z, four.w));
}

fn without_key(keys: ChildKeys, key: u32) -> ChildKeys {
    let none = vec4<u32>(NO_CHILD);
    let is_key = array<vec4<bool>, 2>(keys.lanes[0] == vec4<u32>(key), keys.lanes[1] == vec4<u32>(key));
    return ChildKeys(array<vec4<u32>, 2>(
        select(keys.lanes[0], none, is_key[0]),
        select(keys.lanes[1], none, is_key[1]),
    ));
}

// Returns the lanes of the children whose boxes overlap the box from `low` to `high`, as bits.
fn overlapping_children(node: Node, low: vec3<f32>, high: vec3<f32>) -> u32 {
    // Steps are powers of two, so that the reciprocals are exact; those of flat boxes are limited.
    let per_step = 1.0 / max(node_step(node), vec3<f32>(1e-30));
    let first = (low - node.origin) * per_step;
    let last = (high - node.origin) * per_step;
    let bits = overlapping_four(node.lower[0], node.upper[0], first, last)
        | (overlapping_four(node.lower[1], node.upper[1], first, last) << 4u);
    return bits & ((1u << n_children(node)) - 1u);
}

fn overlapping_four(lower: vec3<u32>, upper: vec3<u32>, first: vec3<f32>, last: vec3<f32>) -> u32 {
    let begins = (bytes_of(lower.x) <= vec4<f32>(last.x))
        & (bytes_of(lower.y) <= vec4<f32>(last.y))
        & (bytes_of(lower.z) <= vec4<f32>(last.z));
    let ends = (vec4<f32>(first.x) <= bytes_of(upper.x))
        & (vec4<f32>(first.y) <= bytes_of(upper.y))
        & (vec4<f32>(first.z) <= bytes_of(upper.z));
    return lane_bits(begins & ends);
}
