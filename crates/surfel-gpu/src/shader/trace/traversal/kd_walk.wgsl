// The way of a ray through a kd-tree: its leaves, front to back, with the interval of its line in each.

// A part of the ray's line in a node that is still to be visited, or in a leaf, whose index is NONE if there is none.
struct NodeInterval {
    idx: u32,
    enter: f32,
    leave: f32,
}

var<private> walk_origin: vec3<f32>;
var<private> walk_inverse: vec3<f32>;
// The range of the ray.
var<private> walk_range: vec2<f32>;
var<private> pending: array<NodeInterval, KD_DEPTH>;
var<private> n_pending: u32;

// Starts where the line of a ray enters the tree.
fn start_walk(ray: Ray) {
    walk_origin = ray.origin;
    walk_range = vec2<f32>(ray.t_min, ray.t_max);
    let is_small = abs(ray.direction) < vec3<f32>(MIN_DIRECTION);
    walk_inverse = 1.0 / select(ray.direction, vec3<f32>(MIN_DIRECTION), is_small);
    let low = (kd_low() - ray.origin) * walk_inverse;
    let high = (kd_high() - ray.origin) * walk_inverse;
    let near = min(low, high);
    let far = max(low, high);
    // Intervals do not depend on the range, nor does the place where a zero is found in them.
    let enter = max(max(near.x, near.y), near.z);
    let leave = min(min(far.x, far.y), far.z);
    pending[0] = NodeInterval(0u, enter, leave);
    // A box without an inside contains no surface.
    n_pending = select(0u, 1u, enter <= leave && all(kd_low() <= kd_high()));
}

// Returns the next leaf that is not empty and in which some of the ray's range lies.
fn next_leaf() -> NodeInterval {
    var part = NodeInterval(NONE, 0.0, 0.0);
    loop {
        if part.idx == NONE {
            if n_pending == 0u {
                return part;
            }
            n_pending -= 1u;
            part = pending[n_pending];
        }
        if walk_range.y < part.enter {
            part.idx = NONE;
            continue;
        }
        let node = kd_node(part.idx);
        if node.axis == 3u {
            if node.idx != 0u && walk_range.x <= part.leave {
                return NodeInterval(node.idx - 1u, part.enter, part.leave);
            }
            part.idx = NONE;
            continue;
        }
        let inverse = walk_inverse[node.axis];
        let crossing = (node.split - walk_origin[node.axis]) * inverse;
        let is_upper_near = inverse < 0.0;
        let near = node.idx + select(0u, 1u, is_upper_near);
        let far = node.idx + select(1u, 0u, is_upper_near);
        if crossing <= max(part.enter, walk_range.x) {
            part = NodeInterval(far, max(part.enter, crossing), part.leave);
        } else if part.leave <= crossing {
            part.idx = near;
        } else {
            pending[n_pending] = NodeInterval(far, crossing, part.leave);
            n_pending += 1u;
            part.idx = near;
            part.leave = crossing;
        }
    }
    return part;
}
