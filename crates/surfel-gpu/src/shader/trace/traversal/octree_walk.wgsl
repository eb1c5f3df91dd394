// The way of a ray through an octree: nodes and cells, about front to back.

// A cell with the interval of the ray's line in it.
struct CellInterval {
    cell_idx: u32,
    enter: f32,
    leave: f32,
    cube: CellCube,
}

// A node some of whose children wait to be visited: their bits, in the order of the visits.
struct PendingNode {
    node_idx: u32,
    waiting: u32,
    cube: CellCube,
}

var<private> walk_ray: Ray;
var<private> walk_inverse: vec3<f32>;
// The child that the ray enters first, if it enters all.
var<private> nearest_child: u32;
var<private> pending: array<PendingNode, OCTREE_DEPTH>;
var<private> n_pending: u32;
// The node that comes next, unless children of pending nodes do.
var<private> next_node: u32;
var<private> next_cube: CellCube;
var<private> has_next: bool;

fn start_walk(ray: Ray) {
    walk_ray = ray;
    let is_small = abs(ray.direction) < vec3<f32>(MIN_DIRECTION);
    walk_inverse = 1.0 / select(ray.direction, vec3<f32>(MIN_DIRECTION), is_small);
    let signs = select(vec3<u32>(0u), vec3<u32>(1u, 2u, 4u), ray.direction < vec3<f32>(0.0));
    nearest_child = signs.x | signs.y | signs.z;
    n_pending = 0u;
    next_node = 0u;
    next_cube = octree_cube();
    has_next = 0.0 < next_cube.size;
}

// Takes the next node; returns false if there is none.
fn take_node() -> bool {
    if has_next {
        has_next = false;
        return true;
    }
    while 0u < n_pending {
        let last = n_pending - 1u;
        let waiting = pending[last].waiting;
        if waiting == 0u {
            n_pending = last;
            continue;
        }
        let order = firstTrailingBit(waiting);
        pending[last].waiting = waiting & (waiting - 1u);
        let child = order ^ nearest_child;
        let node = octree_node(pending[last].node_idx);
        let before = node.children & ((1u << child) - 1u);
        next_node = node.first_child + countOneBits(before);
        next_cube = child_cube(pending[last].cube, child);
        return true;
    }
    return false;
}

fn child_cube(cube: CellCube, child: u32) -> CellCube {
    let size = 0.5 * cube.size;
    let upper = vec3<f32>((vec3<u32>(child) >> vec3<u32>(0u, 1u, 2u)) & vec3<u32>(1u));
    return CellCube(cube.low + size * upper, size);
}

// Returns the next cell that the ray passes through, or closely beside, in its range before a limit and that is fine
// enough; its index is NONE if there is none. `at_origin` and `per_distance` give the size of a pixel.
fn next_cell(limit: f32, at_origin: f32, per_distance: f32) -> CellInterval {
    while take_node() {
        let cube = next_cube;
        let low = (cube.low - walk_ray.origin) * walk_inverse;
        let high = (cube.low - walk_ray.origin + cube.size) * walk_inverse;
        let near = min(low, high);
        let far = max(low, high);
        // Intervals do not depend on the range, nor does the place where a surface is found in them.
        let enter = max(max(near.x, near.y), near.z);
        let leave = min(min(far.x, far.y), far.z);
        let margin = MAX_CELL_MARGIN * cube.size;
        if leave < enter || leave + margin < walk_ray.t_min || limit < enter - margin {
            continue;
        }
        let node = octree_node(next_node);
        let size = at_origin + per_distance * max(enter, walk_ray.t_min);
        let is_fine = node.is_finest || cube.size <= size;
        if node.cell != 0u && is_fine {
            return CellInterval(node.cell - 1u, enter, leave, cube);
        }
        add_children(node.children, cube);
    }
    return CellInterval(NONE, 0.0, 0.0, CellCube(vec3<f32>(0.0), 0.0));
}

// Lets the children of a node wait, the nearest first.
fn add_children(children: u32, cube: CellCube) {
    var waiting = 0u;
    for (var order = 0u; order < 8u; order++) {
        waiting |= ((children >> (order ^ nearest_child)) & 1u) << order;
    }
    if waiting != 0u && n_pending < OCTREE_DEPTH {
        pending[n_pending] = PendingNode(next_node, waiting, cube);
        n_pending += 1u;
    }
}
