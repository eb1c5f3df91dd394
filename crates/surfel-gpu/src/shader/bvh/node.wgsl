// Nodes: the boxes of eight children as bytes on a grid, and the slab test of one child.

struct Node {
    origin: vec3<f32>,
    exponents_and_counts: u32,
    first_node: u32,
    lane_zero_as_block: u32,
    // Four lanes a word, two words an axis.
    lower: array<u32, 6>,
    upper: array<u32, 6>,
}

// Words of four bytes that a node takes in `nodes`, and those that it fills.
const NODE_VECTORS: u32 = 5u;

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
        array<u32, 6>(a.z, a.w, b.x, b.y, b.z, b.w),
        array<u32, 6>(c.x, c.y, c.z, c.w, d.x, d.y),
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

fn lower_bound(node: Node, step: vec3<f32>, lane: u32) -> vec3<f32> {
    let word = lane >> 2u;
    let steps = vec3<u32>(node.lower[word], node.lower[2u + word], node.lower[4u + word]);
    return node.origin + vec3<f32>((steps >> vec3<u32>(8u * (lane & 3u))) & vec3<u32>(0xffu)) * step;
}

fn upper_bound(node: Node, step: vec3<f32>, lane: u32) -> vec3<f32> {
    let word = lane >> 2u;
    let steps = vec3<u32>(node.upper[word], node.upper[2u + word], node.upper[4u + word]);
    return node.origin + vec3<f32>((steps >> vec3<u32>(8u * (lane & 3u))) & vec3<u32>(0xffu)) * step;
}

// Allowance for rounding, relative to the largest coordinates involved.
const ROUNDING: f32 = 1e-6;
// Components of directions nearer to zero than this are replaced by it.
const MIN_DIRECTION: f32 = 1e-18;

// A ray prepared for the slab test: it meets the plane at x at distance x * `inverse` - `at_origin`.
struct SlabRay {
    inverse: vec3<f32>,
    low_at_origin: vec3<f32>,
    high_at_origin: vec3<f32>,
    t_min: f32,
}

// Prepares a ray for the boxes of the tree below `root`.
fn slab_ray(root: Node, ray: Ray) -> SlabRay {
    let is_small = abs(ray.direction) < vec3<f32>(MIN_DIRECTION);
    let inverse = 1.0 / select(ray.direction, vec3<f32>(MIN_DIRECTION), is_small);
    let step = node_step(root);
    let coordinates = max(abs(root.origin), abs(ray.origin));
    let largest = max(max(coordinates.x, coordinates.y), coordinates.z);
    let slack = ROUNDING * (largest + 256.0 * max(max(step.x, step.y), step.z));
    return SlabRay(
        inverse,
        (ray.origin + slack) * inverse,
        (ray.origin - slack) * inverse,
        ray.t_min,
    );
}

// Returns the distance at which a ray enters the box of a child up to `t_max`, or -1 if it misses the box.
fn enter_child(node: Node, step: vec3<f32>, lane: u32, ray: SlabRay, t_max: f32) -> f32 {
    let at_low = lower_bound(node, step, lane) * ray.inverse - ray.low_at_origin;
    let at_high = upper_bound(node, step, lane) * ray.inverse - ray.high_at_origin;
    let near = min(at_low, at_high);
    let far = max(at_low, at_high);
    let enter = max(max(near.x, near.y), max(near.z, ray.t_min));
    let leave = min(min(far.x, far.y), min(far.z, t_max));
    return select(-1.0, enter, enter <= leave);
}
