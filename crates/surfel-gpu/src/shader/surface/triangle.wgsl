// Triangles: flat between three corners, without gaps at shared edges.

// A ray with two axes perpendicular to it. Corners are projected along the ray onto the plane of these axes, where the
// ray is the origin.
struct RayFrame {
    ray: Ray,
    tangent: vec3<f32>,
    bitangent: vec3<f32>,
}

fn ray_frame(ray: Ray) -> RayFrame {
    let basis = tangent_basis(ray.direction);
    return RayFrame(ray, basis.tangent, basis.bitangent);
}

fn project(frame: RayFrame, corner: vec3<f32>) -> vec2<f32> {
    return vec2<f32>(dot(corner, frame.tangent), dot(corner, frame.bitangent));
}

// Returns the edge function at the origin: its sign tells on which side the edge passes. Both triangles at an edge
// evaluate it from the same end, as a driver may fuse the subtraction with one of the products, which rounds them apart.
fn edge_function(start: vec2<f32>, end: vec2<f32>) -> f32 {
    let is_from_start = start.x < end.x || start.x == end.x && start.y < end.y;
    let first = select(end, start, is_from_start);
    let last = select(start, end, is_from_start);
    let value = first.x * last.y - first.y * last.x;
    return select(-value, value, is_from_start);
}

// Returns the distance to both sides of a triangle whose corners are relative to the ray's origin, or -1 without a hit
// (after Woop, Benthin and Wald 2013: triangles that share a corner project it to the same point).
fn intersect_triangle(corners: array<vec3<f32>, 3>, frame: RayFrame) -> f32 {
    let a = project(frame, corners[0]);
    let b = project(frame, corners[1]);
    let c = project(frame, corners[2]);
    let edges = vec3<f32>(edge_function(b, c), edge_function(c, a), edge_function(a, b));
    let is_inside = all(vec3<f32>(0.0) <= edges) || all(edges <= vec3<f32>(0.0));
    let normal = cross(corners[1] - corners[0], corners[0] - corners[2]);
    let facing = dot(normal, frame.ray.direction);
    if !is_inside || facing == 0.0 {
        return -1.0;
    }
    let distance = dot(normal, corners[0]) / facing;
    return select(-1.0, distance, frame.ray.t_min <= distance && distance < NO_LIMIT);
}

// Returns the barycentric coordinates of the point where the line along `direction` meets a triangle.
fn barycentrics(corners: array<vec3<f32>, 3>, direction: vec3<f32>) -> vec3<f32> {
    let edges = vec3<f32>(
        line_side(corners[1], corners[2], direction),
        line_side(corners[2], corners[0], direction),
        line_side(corners[0], corners[1], direction),
    );
    let sum = edges.x + edges.y + edges.z;
    if sum == 0.0 {
        return vec3<f32>(1.0, 0.0, 0.0);
    }
    return edges / sum;
}

fn line_side(start: vec3<f32>, end: vec3<f32>, direction: vec3<f32>) -> f32 {
    return dot(cross(end - start, start + end), direction);
}
