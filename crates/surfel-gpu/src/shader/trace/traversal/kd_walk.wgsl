// The way of a ray through a kd-tree: its leaves, front to back, with the ray's interval in each.

// A part of the ray in a node that is still to be visited, or in a leaf, whose index is NONE if there is none.
struct NodeInterval {
    idx: u32,
    enter: f32,
    leave: f32,
}

var<private> walk_origin: vec3<f32>;
var<private> walk_inverse: vec3<f32>;
var<private> pending: array<NodeInterval, KD_DEPTH>;
var<private> n_pending: u32;

// Starts where the range of a ray enters the tree.
fn start_walk(ray: Ray) {
    walk_origin = ray.origin;
    let is_small = abs(ray.direction) < vec3<f32>(MIN_DIRECTION);
    walk_inverse = 1.0 / select(ray.direction, vec3<f32>(MIN_DIRECTION), is_small);
    let low = (kd_low() - ray.origin) * walk_inverse;
    let high = (kd_high() - ray.origin) * walk_inverse;
    let near = min(low, high);
    let far = max(low, high);
    let enter = max(max(near.x, near.y), max(near.z, ray.t_min));
    let leave = min(min(far.x, far.y), min(far.z, ray.t_max));
    pending[0] = NodeInterval(0u, enter, leave);
    // A box without an inside contains no surface.
    n_pending = select(0u, 1u, enter <= leave && all(kd_low() <= kd_high()));
}

// Returns the next leaf that is not empty.
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
        let node = kd_node(part.idx);
        if node.axis == 3u {
            if node.idx != 0u {
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
        if crossing <= part.enter {
            part.idx = far;
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
